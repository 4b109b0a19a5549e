//! Runs the pipelines that are due and hands on what they make.

use std::{
    path::{Path, PathBuf},
    sync::{Arc, Mutex},
};

use serde_json::{Map, Value, json};
use tombolo_deform::communicator::Communicator;
use tombolo_deform::surface::Surface;
use tombolo_pipelines::{
    encode::Encoder,
    extract::{Channel, Snapshot},
    language::{Action, Command, Config, LogLevel, Monitor, Stage},
    run::{Cost, Frame, History, MonitorValues, Output, Runner},
};

use crate::{
    error::InitializeError,
    lock::lock,
    report::PipelineReport,
    steering::Parameter,
    step::{Moment, Outside},
    stream::Hub,
    writer::{Content, Job, Writer},
};

/// The pipelines of a run.
pub(crate) struct Pipelines {
    runner: Runner,
    /// The name of each view, and the encoder of its frames.
    views: Vec<(String, Arc<Mutex<Encoder>>)>,
    description: Value,
    monitors: Value,
    can_order: bool,
    drags_skeleton: bool,
    listens: bool,
    output: PathBuf,
    writer: Writer,
}

/// The requests of pipelines besides what was sent and written.
#[derive(Default)]
pub(crate) struct Asked {
    /// Commands, each with the pipeline that gives it.
    pub(crate) commands: Vec<(String, Command)>,
    /// The faults.
    pub(crate) faults: Vec<String>,
}

impl Pipelines {
    pub(crate) fn new(
        config: &Config,
        communicator: Arc<dyn Communicator>,
        output: &Path,
    ) -> Result<Self, InitializeError> {
        let runner = Runner::with_communicator(config, communicator)
            .map_err(|problem| InitializeError::Configuration(problem.into()))?;
        let (views, listens) = (runner.views(), runner.listens());
        let can_order = config.pipelines.iter().any(|pipeline| {
            pipeline.stages.iter().any(|stage| matches!(stage, Stage::Order(_)))
                || pipeline.then.iter().any(|action| matches!(action, Action::Order(_)))
        });
        let monitors = monitors(&runner, config);
        Ok(Self {
            runner,
            description: json!(views),
            monitors,
            views: views.into_iter().map(|view| (view.name, Arc::default())).collect(),
            can_order,
            drags_skeleton: (config.pipelines.iter().flat_map(|pipeline| &pipeline.stages))
                .any(|stage| matches!(stage, Stage::Skeleton(_))),
            listens,
            output: output.into(),
            writer: Writer::default(),
        })
    }

    /// The description of the views in `hello`.
    pub(crate) fn views(&self) -> &Value {
        &self.description
    }

    /// The description of the monitors in `hello`.
    pub(crate) fn monitors(&self) -> &Value {
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

    /// Lets the views use a surface of a channel that is known already.
    pub(crate) fn share_surface(
        &mut self,
        channels: &[Channel<'_>],
        channel: &str,
        surface: &Surface,
    ) {
        // Where it does not fit, the pipelines work out their own and say what is wrong.
        let _ = self.runner.set_surface(channels, Some(channel), surface);
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
                Output::Write { pipeline, path, time, extract, keep, .. } => {
                    let path = self.output.join(path);
                    let content = Content::Extract(extract, keep);
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
                    let level = match level {
                        LogLevel::Info => log::Level::Info,
                        LogLevel::Warning => log::Level::Warn,
                        LogLevel::Error => log::Level::Error,
                    };
                    log::log!(level, "cycle {cycle}, pipeline '{pipeline}': {message}");
                }
                Output::Monitor(values) => {
                    if let Some(hub) = hub {
                        hub.monitor(&monitor(&values));
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
    fn send(&self, frame: Frame, hub: &Hub) {
        let Some(view) = self.views.iter().position(|(name, _)| **name == *frame.pipeline) else {
            return;
        };
        let encoder = Arc::clone(&self.views[view].1);
        let encode =
            move |key: bool| lock(&encoder).encode(&frame, key).map_err(|error| error.to_string());
        hub.frame(view, Arc::new(encode));
    }

    /// Waits for files that are still being written; what was wrong with any of the run.
    pub(crate) fn finish(&mut self) -> Vec<String> {
        self.writer.finish()
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
