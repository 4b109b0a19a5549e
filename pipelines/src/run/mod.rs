//! Pipelines at work: which are due, and what comes of them.

mod due;
mod output;
mod pipeline;

use std::collections::HashMap;
use std::sync::Arc;

use tombolo_deform::surface::Surface;

use crate::extract::{Channel, Snapshot, Source};
use crate::language::{Config, Due, Problem, Stage, Validate};
use pipeline::Prepared;
use tombolo_deform::communicator::{Communicator, Solo, agree};

pub use output::{Encoding, Frame, MonitorValues, Output, View, ViewKind};

/// Runs the pipelines of a configuration.
///
/// # Example
/// ```
/// use tombolo_deform::{mesh::MeshView, shapes};
/// use tombolo_pipelines::extract::{Channel, Snapshot};
/// use tombolo_pipelines::language::{Command, parse};
/// use tombolo_pipelines::run::{Output, Runner};
///
/// let config = parse(
///     r#"{"version": 1, "pipelines": [
///         {"name": "health", "every": {"steps": 10}, "stages": [{"quality": {}}],
///          "when": "quality.min < 0.9", "then": [{"stop": {}}]}]}"#,
///     "health.json",
/// )?;
/// let mut runner = Runner::new(&config)?;
/// assert!(!runner.is_due(3, 0.3));
/// assert!(runner.is_due(20, 2.0));
///
/// let mesh = shapes::box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]);
/// let channels = [Channel { name: "fluid", mesh: MeshView::from(&mesh), fields: &[] }];
/// let outputs = runner.run(&Snapshot { cycle: 20, time: 2.0, channels: &channels });
/// assert!(matches!(outputs[..], [Output::Monitor(_), Output::Command { command: Command::Stop {}, .. }]));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Runner {
    pipelines: Vec<Prepared>,
    sources: HashMap<String, Source>,
    communicator: Arc<dyn Communicator>,
}

impl Runner {
    /// Prepares the pipelines for one process.
    ///
    /// # Errors
    /// The first [`Problem`] of a configuration that did not come from the parser.
    pub fn new(config: &Config) -> Result<Self, Problem> {
        Self::with_communicator(config, Arc::new(Solo))
    }

    /// Prepares the pipelines for the processes of a communicator.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn with_communicator(
        config: &Config,
        communicator: Arc<dyn Communicator>,
    ) -> Result<Self, Problem> {
        config.validate()?;
        let pipelines = config.pipelines.iter().filter(|pipeline| pipeline.due != Due::OnOrder);
        let pipelines: Result<Vec<_>, _> = pipelines.map(Prepared::new).collect();
        Ok(Self { pipelines: pipelines?, sources: HashMap::new(), communicator })
    }

    /// The views that the pipelines stream.
    #[must_use]
    pub fn views(&self) -> Vec<View> {
        self.pipelines
            .iter()
            .filter(|prepared| prepared.streams())
            .map(|prepared| View {
                name: prepared.pipeline.name.clone(),
                kind: match prepared.pipeline.stages.iter().find(|stage| stage.is_source()) {
                    Some(Stage::Surface {}) | None => ViewKind::Surface,
                    Some(_) => ViewKind::Slice,
                },
                channel: prepared.pipeline.channel.clone(),
            })
            .collect()
    }

    /// Whether any pipeline is due at this step. Allocates nothing and looks at no data.
    #[must_use]
    #[inline]
    pub fn is_due(&self, cycle: u64, time: f64) -> bool {
        self.pipelines.iter().any(|prepared| prepared.is_chosen && prepared.due.is_due(cycle, time))
    }

    /// Whether any pipeline that is due at this step looks at the channel of this name; `is_first`
    /// says whether it is the first that the solver shows.
    #[must_use]
    pub fn reads(&self, cycle: u64, time: f64, channel: &str, is_first: bool) -> bool {
        let reads = |name: Option<&str>| name.map_or(is_first, |name| name == channel);
        let due = self
            .pipelines
            .iter()
            .filter(|prepared| prepared.is_chosen && prepared.due.is_due(cycle, time));
        due.map(|prepared| prepared.pipeline.channel.as_deref()).any(reads)
    }

    /// Runs only the chosen pipelines from now on. A pipeline that was left out is due again once
    /// it is chosen. To be called on all processes alike.
    pub fn choose(&mut self, is_chosen: impl Fn(&str) -> bool) {
        for prepared in &mut self.pipelines {
            prepared.is_chosen = is_chosen(&prepared.pipeline.name);
        }
    }

    /// Runs the pipelines that are due, in the order of the configuration. Collective.
    ///
    /// A failure of one pipeline comes out as [`Output::Error`] and stops neither the others nor
    /// the solver. An error that lasts is told once, and again after it has been gone.
    pub fn run(&mut self, snapshot: &Snapshot) -> Vec<Output> {
        let mut outputs = Vec::new();
        for prepared in &mut self.pipelines {
            if !prepared.is_chosen || !prepared.due.is_due(snapshot.cycle, snapshot.time) {
                continue;
            }
            prepared.due.take(snapshot.cycle, snapshot.time);
            let name = prepared.pipeline.channel.as_deref();
            match source(&mut self.sources, snapshot.channels, name, &self.communicator) {
                Ok((channel, source)) => {
                    prepared.run(snapshot, channel, source, &self.communicator, &mut outputs);
                }
                Err(message) => {
                    prepared.report(snapshot.cycle, vec![("channel".into(), message)], &mut outputs)
                }
            }
        }
        outputs
    }

    /// Lets the pipelines use a surface that was extracted from the same channel elsewhere.
    ///
    /// # Errors
    /// A text that names the channel or what is wrong with its mesh.
    pub fn set_surface(
        &mut self,
        channels: &[Channel],
        name: Option<&str>,
        surface: &Surface,
    ) -> Result<(), String> {
        let (_, source) = source(&mut self.sources, channels, name, &self.communicator)?;
        source.set_surface(surface);
        Ok(())
    }
}

/// The channel of this name and what is known of its cells, taken anew where they have changed.
fn source<'a, 'c>(
    sources: &'a mut HashMap<String, Source>,
    channels: &'c [Channel<'c>],
    name: Option<&str>,
    communicator: &Arc<dyn Communicator>,
) -> Result<(&'c Channel<'c>, &'a mut Source), String> {
    let found = Channel::find(channels, name);
    let channel = if communicator.size() == 1 {
        found?
    } else {
        agree(communicator, found).map_err(|error| error.to_string())?
    };
    // Taken anew where the cells of any rank have changed.
    if communicator.any(!sources.get(channel.name).is_some_and(|source| source.is_of(channel))) {
        sources.remove(channel.name);
        let source = Source::distributed(channel, communicator);
        let source = source.map_err(|error| format!("channel `{}`: {error}", channel.name))?;
        sources.insert(channel.name.to_owned(), source);
    }
    match sources.get_mut(channel.name) {
        Some(source) => Ok((channel, source)),
        None => Err(format!("channel `{}` is not known", channel.name)),
    }
}
