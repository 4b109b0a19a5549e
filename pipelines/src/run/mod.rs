//! Pipelines at work: which are due, and what comes of them.

mod audience;
mod cost;
mod dormancy;
mod due;
mod history;
#[cfg(feature = "files")]
mod mesh_trial;
mod output;
mod pipeline;
mod replace;
mod saved;
mod trigger;

use std::collections::HashMap;
use std::sync::Arc;
use std::time::Instant;

use tombolo_deform::{mesh::Mesh, surface::Surface};

use crate::extract::{Channel, Snapshot, Source};
use crate::language::{Config, Due, Monitored, Pipeline, Problem, Stage, Validate, monitors};
use due::Now;
use history::Board;
use pipeline::Prepared;
use tombolo_deform::communicator::{Communicator, Solo, agree};

pub use audience::Audience;
pub use cost::Cost;
pub use history::{History, Measured};
#[cfg(feature = "files")]
pub use mesh_trial::MeshTrial;
pub use output::{Encoding, Frame, MonitorValues, Output, Table, View, ViewKind};
pub use replace::{ReplaceError, Replacement};

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
    /// The pipelines of the configuration, also those that wait for orders.
    all: Vec<Pipeline>,
    sources: HashMap<String, Source>,
    communicator: Arc<dyn Communicator>,
    board: Board,
    /// The clock and the viewers, equal on all ranks.
    outside: Now,
    clock: Box<dyn Fn() -> f64 + Send + Sync>,
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
        let (pipelines, histories) = prepared(config)?;
        let begun = Instant::now();
        Ok(Self {
            pipelines,
            all: config.pipelines.clone(),
            sources: HashMap::new(),
            communicator,
            board: Board { histories, parameters: Vec::new() },
            outside: Now::default(),
            clock: Box::new(move || begun.elapsed().as_secs_f64()),
        })
    }

    /// Measures what pipelines cost by another clock: seconds that rise.
    #[must_use]
    pub fn with_clock(self, clock: impl Fn() -> f64 + Send + Sync + 'static) -> Self {
        Self { clock: Box::new(clock), ..self }
    }

    /// Tells what goes on outside: how many seconds have gone by since the run began, and how many
    /// viewers have come so far. Pipelines that wait for either are due from then on; all ranks are
    /// told the same.
    pub fn tell(&mut self, seconds: f64, viewers: u64) {
        (self.outside.seconds, self.outside.viewers) = (seconds, viewers);
    }

    /// Says which views somebody looks at; at first somebody looks at all. While nobody does, a pipeline
    /// of which nothing comes but a view runs so seldom that it takes no more than a thousandth of the
    /// time. Once somebody does it runs at the next step, where one of its times has gone by. All ranks
    /// say the same, and [`tell`](Self::tell) the seconds.
    pub fn set_audience(&mut self, audience: Audience) {
        self.outside.audience = audience;
    }

    /// The views that somebody looks at, as was said last.
    #[must_use]
    pub fn audience(&self) -> Audience {
        self.outside.audience
    }

    /// Says that pipelines could run last at this cycle, for ranks that do not come together at
    /// every step: those of every so many steps make up for a multiple that went by since. All
    /// ranks say the same.
    pub fn set_met(&mut self, cycle: u64) {
        self.outside.met = Some(cycle);
    }

    /// Whether any pipeline waits for what [`tell`](Self::tell) tells, or heeds whether it is watched.
    #[must_use]
    pub fn listens(&self) -> bool {
        let listens = |it: &Prepared| it.due.listens() || it.dormancy.only_shows();
        self.pipelines.iter().any(listens)
    }

    /// Tells the values of the solver's parameters, which conditions may name.
    pub fn set_parameters<'a>(&mut self, parameters: impl IntoIterator<Item = (&'a str, f64)>) {
        let parameters = parameters.into_iter().map(|(name, value)| (name.to_owned(), value));
        self.board.parameters = parameters.collect();
    }

    /// The monitors of a pipeline and what they have measured; `None` where there is no pipeline of
    /// this name.
    #[must_use]
    pub fn history(&self, pipeline: &str) -> Option<&History> {
        let prepared = self.pipelines.iter().find(|prepared| prepared.pipeline.name == pipeline);
        prepared.and_then(|prepared| self.board.histories.get(prepared.index))
    }

    /// The cost of each pipeline so far, by name.
    pub fn costs(&self) -> impl Iterator<Item = (&str, Cost)> {
        self.pipelines.iter().map(|prepared| {
            let history = self.board.histories.get(prepared.index).map_or(0, History::bytes);
            let memory = prepared.cost.memory + history as u64;
            let every = prepared.thinning.every();
            (&*prepared.name, Cost { memory, every, ..prepared.cost })
        })
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
        let now = Now { cycle, time, ..self.outside };
        self.pipelines.iter().any(|prepared| prepared.is_due(&now))
    }

    /// Whether any pipeline that is due at this step looks at the channel of this name; `is_first`
    /// says whether it is the first that the solver shows.
    #[must_use]
    pub fn reads(&self, cycle: u64, time: f64, channel: &str, is_first: bool) -> bool {
        let reads = |name: Option<&str>| name.map_or(is_first, |name| name == channel);
        let now = Now { cycle, time, ..self.outside };
        let due = self.pipelines.iter().filter(|prepared| prepared.is_due(&now));
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
        let now = Now { cycle: snapshot.cycle, time: snapshot.time, ..self.outside };
        for prepared in &mut self.pipelines {
            if !prepared.is_due(&now) {
                continue;
            }
            prepared.due.take(&now);
            let is_back = prepared.dormancy.wakes(&now);
            if !(prepared.thinning.admits() || is_back) {
                continue;
            }
            let begun = (self.clock)();
            let name = prepared.pipeline.channel.as_deref();
            let measured =
                match source(&mut self.sources, snapshot.channels, name, &self.communicator) {
                    Ok((channel, source)) => prepared.run(
                        snapshot,
                        channel,
                        source,
                        &self.communicator,
                        &self.board,
                        &mut outputs,
                    ),
                    Err(message) => prepared.without_channel(snapshot, message, &mut outputs),
                };
            if let Some(history) = self.board.histories.get_mut(prepared.index)
                && !measured.is_empty()
            {
                history.push(Measured { cycle: now.cycle, time: now.time, values: measured });
            }
            let ended = (self.clock)();
            let message = prepared.ran(&now, begun, ended, &*self.communicator);
            if let Some(message) = message.filter(|_| self.communicator.rank() == 0) {
                let pipeline = Arc::clone(&prepared.name);
                outputs.push(Output::Error { pipeline, cycle: now.cycle, message });
            }
        }
        outputs
    }

    /// Runs the pipelines that wait for the end of the run, of which this is the last step. On all
    /// ranks alike.
    pub fn finish(&mut self, cycle: u64, time: f64) -> Vec<Output> {
        let mut outputs = Vec::new();
        for prepared in &mut self.pipelines {
            if !(prepared.is_chosen && prepared.pipeline.due == Due::OnEnd) {
                continue;
            }
            let begun = (self.clock)();
            let values = prepared.end(cycle, time, &*self.communicator, &self.board, &mut outputs);
            if let Some(history) = self.board.histories.get_mut(prepared.index)
                && !values.is_empty()
            {
                history.push(Measured { cycle, time, values });
            }
            prepared.cost.ran((self.clock)() - begun);
        }
        outputs
    }

    /// Lets the pipelines use the cells and the surface of a channel that were taken over elsewhere,
    /// so that neither is copied or worked out twice. On one process.
    ///
    /// # Errors
    /// A text that says what is wrong with the channel's ghosts.
    pub fn share_mesh(
        &mut self,
        channel: &Channel,
        mesh: &Mesh,
        surface: &Surface,
    ) -> Result<(), String> {
        let mut source = if channel.mesh.is_plain() {
            Source::of_mesh(channel, mesh)
        } else {
            // The mesh is without the ghosts, which pipelines may be asked for.
            Source::distributed(channel, &self.communicator).map_err(|error| error.to_string())?
        };
        source.set_surface(surface);
        self.sources.insert(channel.name.to_owned(), source);
        Ok(())
    }
}

/// The pipelines of a configuration that run at steps or at the end, and empty histories of all.
fn prepared(config: &Config) -> Result<(Vec<Prepared>, Vec<History>), Problem> {
    config.validate()?;
    let all = &config.pipelines;
    let indices = (0..all.len()).filter(|&index| all[index].due != Due::OnOrder);
    let monitored = Monitored::of(all);
    let prepared = |index: usize| {
        let located = |problem: Problem| problem.at(index).within("pipelines");
        Prepared::new(&monitored, index).map_err(located)
    };
    let pipelines: Result<Vec<_>, _> = indices.map(prepared).collect();
    let history = |pipeline| History::new(monitors(pipeline).split_off(2));
    Ok((pipelines?, all.iter().map(history).collect()))
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
