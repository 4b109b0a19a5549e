//! Runs the pipelines that are due and hands on what they make.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::{Arc, Mutex},
    time::Duration,
};

use serde_json::{Map, Value, json};
use tombolo_deform::communicator::{self, Communicator};
use tombolo_deform::{mesh::Mesh, surface::Surface};
use tombolo_pipelines::{
    encode::Encoder,
    extract::{Channel, Snapshot},
    language::{Command, Config, ErrorBound, LogLevel, Monitor, Pipeline, Stage},
    run::{Audience, Cost, Encoding, Frame, History, MonitorValues, Output, Replacement, Runner},
};
use tracing::{error, info, warn};

use crate::{
    checkpoint::CheckpointError,
    error::InitializeError,
    lock::lock,
    report::PipelineReport,
    steering::Parameter,
    step::{Moment, Outside},
    stream::{COARSER, Hub, LEVELS},
    writer::{Content, Job, Membership, Writer},
};

/// The pipelines of a run.
pub(crate) struct Pipelines {
    runner: Runner,
    views: Vec<LiveView>,
    /// How many views there have been.
    numbers: usize,
    /// The titles of the tables that the run writes or has written, by file.
    tables: BTreeMap<String, Vec<String>>,
    description: Arc<Value>,
    monitors: Arc<Value>,
    can_order: bool,
    drags_skeleton: bool,
    listens: bool,
    output: PathBuf,
    /// The number of the run.
    run: Arc<str>,
    writer: Writer,
}

/// A view that viewers see.
struct LiveView {
    name: String,
    /// Its number among all that there have been.
    number: usize,
    /// The encoders of the view's frames, one for each level.
    encoders: Arc<[Mutex<Encoder>; LEVELS]>,
}

/// Tables that a run may begin, of which each stays open.
const TABLES: usize = 256;
/// How long what is saved waits for files that are still being written.
const LONGEST_FLUSH: Duration = Duration::from_secs(10);

/// The requests of pipelines besides what was sent and written.
#[derive(Default)]
pub(crate) struct Asked {
    /// Commands, each with the pipeline that gives it.
    pub(crate) commands: Vec<(String, Command)>,
    /// The faults.
    pub(crate) faults: Vec<String>,
}

/// The names of the pipelines that a change has changed, and the frames of its trial.
#[derive(Debug)]
pub(crate) struct Changed {
    pub(crate) added: Vec<String>,
    pub(crate) replaced: Vec<String>,
    pub(crate) removed: Vec<String>,
    pub(crate) frames: Vec<Frame>,
}

impl Pipelines {
    pub(crate) fn new(
        config: &Config,
        communicator: Arc<dyn Communicator>,
        output: &Path,
        run: Arc<str>,
    ) -> Result<Self, InitializeError> {
        let runner = Runner::with_communicator(config, communicator)
            .map_err(|problem| InitializeError::Configuration(problem.into()))?;
        let mut pipelines = Self {
            runner,
            views: Vec::new(),
            numbers: 0,
            tables: BTreeMap::new(),
            description: Arc::default(),
            monitors: Arc::default(),
            can_order: false,
            drags_skeleton: false,
            listens: false,
            output: output.into(),
            run,
            writer: Writer::default(),
        };
        pipelines.describe(config);
        Ok(pipelines)
    }

    /// Brings what is told of the pipelines up to date.
    fn describe(&mut self, config: &Config) {
        let views = self.runner.views();
        self.description = Arc::new(json!(views));
        self.monitors = Arc::new(monitors(&self.runner, config));
        let mut before = std::mem::take(&mut self.views);
        for view in views {
            let known = before.iter().position(|known| known.name == view.name);
            let view = known.map(|known| before.swap_remove(known)).unwrap_or_else(|| {
                self.numbers += 1;
                LiveView { name: view.name, number: self.numbers - 1, encoders: Arc::default() }
            });
            self.views.push(view);
        }
        for table in self.runner.tables() {
            self.tables.insert(table.file.clone(), table.titles.clone());
        }
        self.can_order = config.pipelines.iter().any(Pipeline::can_order);
        self.drags_skeleton = (config.pipelines.iter().flat_map(|pipeline| &pipeline.stages))
            .any(|stage| matches!(stage, Stage::Skeleton(_)));
        self.listens = self.runner.listens();
    }

    /// Lets the pipelines of another configuration take over, where they are found fit for the mesh
    /// at hand. Collective.
    ///
    /// # Errors
    /// Why they are not, the same on all ranks; then those before go on.
    pub(crate) fn replace(
        &mut self,
        config: &Config,
        moment: Moment,
        channels: &[Channel<'_>],
        parameters: &[Parameter],
        hub: Option<&Arc<Hub>>,
    ) -> Result<Changed, String> {
        let Moment { cycle, time } = moment;
        let values = parameters.iter().map(|parameter| (&*parameter.name, parameter.value));
        self.runner.set_parameters(values);
        let prepared = self.runner.prepare(config, &Snapshot { cycle, time, channels });
        let mut next = prepared.map_err(|error| error.to_string())?;
        self.check_tables(&next)?;
        let changed = Changed {
            added: next.added().to_vec(),
            replaced: next.replaced().to_vec(),
            removed: next.removed().to_vec(),
            frames: next.take_frames(),
        };
        let (kept, gone) = std::mem::take(&mut self.views)
            .into_iter()
            .partition::<Vec<_>, _>(|view| next.keeps(&view.name));
        self.views = kept;
        self.runner.replace(next, channels);
        self.describe(config);
        if let Some(hub) = hub {
            gone.iter().for_each(|view| hub.forget(view.number));
            hub.costs(self.runner.costs());
        }
        Ok(changed)
    }

    /// Refuses tables with other columns than the run has begun them with: rows that were written
    /// are not to be lost.
    fn check_tables(&self, next: &Replacement) -> Result<(), String> {
        let mut new = 0;
        for table in next.tables() {
            match self.tables.get(&table.file) {
                Some(titles) if *titles != table.titles => {
                    return Err(format!(
                        "the table `{}` of this run has other columns: found {}, expected {}; \
                         another file can have these",
                        table.file,
                        table.titles.join(", "),
                        titles.join(", ")
                    ));
                }
                Some(_) => {}
                None => new += 1,
            }
        }
        if new > 0 && self.tables.len() + new > TABLES {
            return Err(format!("a run that has begun {TABLES} tables begins no more"));
        }
        Ok(())
    }

    /// Writes down what the pipelines have come to, once their files of all steps so far are
    /// written.
    pub(crate) fn save(&self, writer: &mut communicator::Writer) {
        self.writer.flush(LONGEST_FLUSH);
        self.runner.save(writer);
    }

    /// Goes on from what was written down, after a step where there was one.
    pub(crate) fn restore(
        &mut self,
        saved: &[u8],
        last: Option<Moment>,
    ) -> Result<(), CheckpointError> {
        if let Some(last) = last {
            self.writer.resume(last);
        }
        Ok(self.runner.restore(&mut communicator::Reader::new(0, saved))?)
    }

    /// The description of the views in `hello`.
    pub(crate) fn views(&self) -> &Arc<Value> {
        &self.description
    }

    /// The description of the monitors in `hello`.
    pub(crate) fn monitors(&self) -> &Arc<Value> {
        &self.monitors
    }

    /// Whether a pipeline can give an order of a new shape.
    pub(crate) fn can_order(&self) -> bool {
        self.can_order
    }

    /// Whether any of these orders drags the skeleton.
    pub(crate) fn drags_skeleton(&self) -> bool {
        self.drags_skeleton
    }

    /// Lets the views use the cells and the surface of a channel that are known already.
    pub(crate) fn share_mesh(&mut self, channel: &Channel<'_>, mesh: &Mesh, surface: &Surface) {
        // Where that cannot be, the pipelines work out their own and say what is wrong.
        let _ = self.runner.share_mesh(channel, mesh, surface);
    }

    /// Lets only those run from now on whose names are chosen.
    pub(crate) fn choose(&mut self, is_chosen: impl Fn(&str) -> bool) {
        self.runner.choose(is_chosen);
    }

    #[inline]
    pub(crate) fn is_due(&self, moment: Moment) -> bool {
        self.runner.is_due(moment.cycle, moment.time)
    }

    /// Whether anything that is due looks at the channel of this name.
    pub(crate) fn reads(&self, moment: Moment, channel: &str, is_first: bool) -> bool {
        self.runner.reads(moment.cycle, moment.time, channel, is_first)
    }

    /// Whether a pipeline waits for what [`tell`](Self::tell) tells.
    #[inline]
    pub(crate) fn listens(&self) -> bool {
        self.listens
    }

    /// Tells what goes on outside, alike on all ranks: it counts from the next step on.
    pub(crate) fn tell(&mut self, outside: Outside) {
        self.runner.tell(outside.seconds, outside.viewers);
        self.runner.set_audience(outside.audience);
    }

    /// Says which views somebody looks at, alike on all ranks.
    pub(crate) fn set_audience(&mut self, audience: Audience) {
        self.runner.set_audience(audience);
    }

    /// The views that somebody looks at, as was said last.
    #[inline]
    pub(crate) fn audience(&self) -> Audience {
        self.runner.audience()
    }

    /// Says that pipelines could run last at this cycle, where they cannot at every step.
    #[inline]
    pub(crate) fn set_met(&mut self, cycle: u64) {
        self.runner.set_met(cycle);
    }

    /// The cost and the monitors of each pipeline.
    pub(crate) fn reports(&self) -> Vec<PipelineReport> {
        let report = |(name, cost): (&str, Cost)| {
            let history = self.runner.history(name);
            PipelineReport::new(name, cost, history)
        };
        self.runner.costs().map(report).collect()
    }

    /// The monitors of a pipeline and what they have measured.
    pub(crate) fn history(&self, pipeline: &str) -> Option<&History> {
        self.runner.history(pipeline)
    }

    /// Runs what is due.
    pub(crate) fn run(
        &mut self,
        moment: Moment,
        channels: &[Channel<'_>],
        parameters: &[Parameter],
        hub: Option<&Arc<Hub>>,
    ) -> Asked {
        let Moment { cycle, time } = moment;
        let values = parameters.iter().map(|parameter| (&*parameter.name, parameter.value));
        self.runner.set_parameters(values);
        let outputs = self.runner.run(&Snapshot { cycle, time, channels });
        let asked = self.hand_on(outputs, cycle, hub);
        if let Some(hub) = hub {
            hub.costs(self.runner.costs());
        }
        asked
    }

    /// Runs what waits for the end of the run.
    pub(crate) fn end(&mut self, moment: Moment, hub: Option<&Arc<Hub>>) -> Asked {
        let outputs = self.runner.finish(moment.cycle, moment.time);
        self.hand_on(outputs, moment.cycle, hub)
    }

    fn hand_on(&mut self, outputs: Vec<Output>, cycle: u64, hub: Option<&Arc<Hub>>) -> Asked {
        let mut asked = Asked::default();
        for output in outputs {
            match output {
                Output::Frame(frame) => {
                    if let Some(hub) = hub {
                        self.send(frame, hub);
                    }
                }
                Output::Write { pipeline, path, time, extract, series, keep, .. } => {
                    let path = self.output.join(path);
                    let series = series.map(|series| self.output.join(series));
                    let membership = series.map(|series| Membership { series, keep });
                    let content = Content::Extract(extract, membership);
                    self.writer.write(Job { pipeline, path, time, content });
                }
                Output::Picture { pipeline, path, cycle, time, picture } => {
                    let path = self.output.join(path);
                    let content = Content::Picture(picture, cycle);
                    self.writer.write(Job { pipeline, path, time, content });
                }
                Output::Row { pipeline, table, cycle, time, values } => {
                    let path = self.output.join(&table.file);
                    let content = Content::Row(table, cycle, values);
                    self.writer.write(Job { pipeline, path, time, content });
                }
                Output::Log { pipeline, level, message } => {
                    let (run, pipeline) = (&*self.run, &*pipeline);
                    let message = format_args!("cycle {cycle}, pipeline '{pipeline}': {message}");
                    match level {
                        LogLevel::Info => info!(run, cycle, pipeline, "{message}"),
                        LogLevel::Warning => warn!(run, cycle, pipeline, "{message}"),
                        LogLevel::Error => error!(run, cycle, pipeline, "{message}"),
                    }
                }
                Output::Monitor(values) => {
                    if let Some(hub) = hub {
                        hub.monitor(move || monitor(&values));
                    }
                }
                Output::Command { pipeline, command } => {
                    asked.commands.push((pipeline.to_string(), command))
                }
                Output::Error { pipeline, cycle, message } => {
                    asked.faults.push(format!("cycle {cycle}, pipeline '{pipeline}': {message}"));
                }
                other => asked.faults.push(format!("cycle {cycle}: not understood: {other:?}")),
            }
        }
        asked.faults.extend(self.writer.faults());
        asked
    }

    /// Hands a frame to the encoder's thread.
    pub(crate) fn send(&self, frame: Frame, hub: &Hub) {
        let Some(view) = self.views.iter().find(|view| *view.name == *frame.pipeline) else {
            return;
        };
        let (encoders, name) = (Arc::clone(&view.encoders), Arc::clone(&frame.pipeline));
        let encode = move |level: usize, key: bool| {
            let fields = wider(frame.encoding.fields, COARSER[level]);
            let encoding = Encoding { fields, ..frame.encoding };
            let frame = Frame { encoding, ..frame.clone() };
            lock(&encoders[level]).encode(&frame, key).map_err(|error| error.to_string())
        };
        hub.frame(view.number, &name, Arc::new(encode));
    }

    /// Waits for files that are still being written; what was wrong with any of the run.
    pub(crate) fn finish(&mut self) -> Vec<String> {
        self.writer.finish()
    }
}

/// A bound so many times as wide; in place of none at all, so many thousandths of the range.
fn wider(bound: ErrorBound, times: f64) -> ErrorBound {
    match bound {
        bound if times <= 1.0 => bound,
        ErrorBound::Relative(part) => ErrorBound::Relative(part * times),
        ErrorBound::Absolute(bound) => ErrorBound::Absolute(bound * times),
        ErrorBound::Lossless => ErrorBound::Relative(1e-3 * times),
    }
}

/// The monitors of all pipelines with their units.
fn monitors(runner: &Runner, config: &Config) -> Value {
    let of_pipeline = |name: &str| {
        let monitors = runner.history(name).map(History::monitors).unwrap_or_default();
        let described = |monitor: &Monitor| json!({"pipeline": name, "name": monitor.name, "unit": monitor.unit});
        monitors.iter().map(described).collect::<Vec<_>>()
    };
    config.pipelines.iter().flat_map(|pipeline| of_pipeline(&pipeline.name)).collect()
}

/// The message about the values of monitors; what could not be measured is null.
fn monitor(values: &MonitorValues) -> Value {
    let by_name: Map<String, Value> =
        values.values.iter().map(|(name, value)| (name.clone(), json!(value))).collect();
    let (pipeline, cycle, time) = (&*values.pipeline, values.cycle, values.time);
    json!({"monitor": {"pipeline": pipeline, "cycle": cycle, "time": time, "values": by_name}})
}
