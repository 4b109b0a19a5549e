//! A pipeline: its stages, when it runs, and what is done under which condition.

use std::num::NonZeroU64;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tombolo_deform::schedule::{Every, Interval};

use super::stage::{Action, FileSink, Stage};

/// Stages that run one after the other at some steps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "PipelineFields", into = "PipelineFields")]
pub struct Pipeline {
    /// Its name, which is also that of its view; no two pipelines share one.
    pub name: String,
    /// A description of the pipeline, for people.
    pub description: Option<String>,
    /// The channel it reads, and of one that runs on orders the channel whose mesh they change;
    /// `None` is the solver's first.
    pub channel: Option<String>,
    /// When it runs.
    pub due: Due,
    /// How much of the run's time it may take.
    pub budget: Option<Budget>,
    /// Its stages, in order.
    pub stages: Vec<Stage>,
    /// The condition, over monitors and parameters, under which `then` is done. Without one, `then`
    /// is always done.
    pub when: Option<String>,
    /// How long the condition must have held.
    pub lasting: Option<Every>,
    /// When `then` may be done once more.
    pub again_after: Option<AgainAfter>,
    /// The actions taken when the condition holds.
    pub then: Vec<Action>,
}

impl Pipeline {
    /// Whether it streams a view.
    #[must_use]
    pub fn streams(&self) -> bool {
        self.stages.iter().any(|stage| matches!(stage, Stage::Stream(_)))
            || self.then.iter().any(|action| matches!(action, Action::Stream(_)))
    }

    /// Whether it gives orders of a new shape.
    #[must_use]
    pub fn can_order(&self) -> bool {
        self.stages.iter().any(|stage| matches!(stage, Stage::Order(_)))
            || self.then.iter().any(|action| matches!(action, Action::Order(_)))
    }

    /// Its stages and actions that write files.
    pub(crate) fn file_sinks(&self) -> impl Iterator<Item = FileSink<'_>> {
        let of_stages = self.stages.iter().filter_map(Stage::file_sink);
        of_stages.chain(self.then.iter().filter_map(Action::file_sink))
    }
}

/// When a pipeline runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Due {
    /// Again and again.
    Every(Cadence),
    /// Once.
    At(At),
    /// For each order: its stages are the settings of orders that bring none.
    OnOrder,
    /// At the first step after a viewer has come.
    OnViewer,
    /// When the run ends: there is no mesh any more, only monitors.
    OnEnd,
}

/// How often a pipeline runs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Cadence {
    /// At each step whose number is a multiple of this.
    Steps(NonZeroU64),
    /// Each time this much simulated time has gone by, in the solver's unit.
    Time(Interval),
    /// Each time so many seconds have gone by on the clock: at the first step of which rank 0 knows
    /// before it begins, the same on all ranks.
    Seconds(Interval),
}

/// A moment of the run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum At {
    /// The first step whose number is at least this.
    Cycle(u64),
    /// The first step whose time is at least this.
    Time(f64),
}

impl At {
    /// Whether the moment has come.
    #[must_use]
    pub fn has_come(self, cycle: u64, time: f64) -> bool {
        match self {
            At::Cycle(at) => cycle >= at,
            // Time steps add up with rounding: a moment that is a billionth away is not worth a
            // step's wait.
            At::Time(at) => time >= at - 1e-9 * at.abs(),
        }
    }
}

/// When the actions of a condition may be taken once more.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AgainAfter {
    /// So many steps later.
    Steps(NonZeroU64),
    /// So much simulated time later.
    Time(Interval),
    /// Once this condition has held: `"velocity.max < 80"` beside a `when` of
    /// `"velocity.max > 100"`.
    Condition(String),
}

/// How much of the run's time a pipeline may take.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Budget {
    /// The percentage of the time of the whole run that the pipeline may take inside `execute`, above
    /// 0 and at most 100. A pipeline that takes more runs at every second, fourth ... of its times
    /// only, and more often again where it takes a quarter of it; each change is said.
    pub percent: f64,
}

/// A pipeline as it stands in JSON.
#[derive(Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct PipelineFields {
    /// Its name, which is also that of its view; no two pipelines share one.
    name: String,
    /// A description of the pipeline, for people.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    description: Option<String>,
    /// The channel it reads; left out, the solver's first. Of a pipeline with `"on": "order"`, the
    /// channel whose mesh orders change.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    channel: Option<String>,
    /// How often it runs. At most one of `every`, `at` and `on` is given; without any it runs at
    /// every step.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    every: Option<Cadence>,
    /// The one moment at which it runs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    at: Option<At>,
    /// The event at which it runs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    on: Option<Event>,
    /// How much of the run's time it may take; left out, all it needs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    budget: Option<Budget>,
    /// Its stages, in order. Each stage is an object with one key, the stage's name.
    stages: Vec<Stage>,
    /// A condition over monitors and parameters, such as
    /// `quality.min < 0.05 || velocity.max > 100`: the monitors of its own stages, those of other
    /// pipelines (`inlet.mean`, or `{duct/inlet.mean}` where several have one of that name) as they
    /// were measured last, `parameter.inflow`, `cycle` and `time`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    when: Option<String>,
    /// How long the condition must have held, whenever the pipeline ran; left out, it need hold
    /// once.
    #[serde(default, rename = "for", skip_serializing_if = "Option::is_none")]
    lasting: Option<Every>,
    /// When the actions may be taken once more, after they were; left out, whenever the pipeline
    /// runs and the condition holds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    again_after: Option<AgainAfter>,
    /// The actions taken when the condition holds; without a condition, whenever the pipeline has
    /// run.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    then: Vec<Action>,
}

/// An event that a pipeline can wait for.
#[derive(Clone, Copy, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Event {
    /// An order of a new shape: the stages (`deform`, `guard`, `schedule`) are the settings of
    /// orders that bring none.
    Order,
    /// A viewer that comes: the pipeline runs at the next step, the same on all ranks.
    Viewer,
    /// The end of the run. There is no mesh any more: the stages are `difference`, `csv` and `log`,
    /// of the monitors of other pipelines.
    End,
}

impl TryFrom<PipelineFields> for Pipeline {
    type Error = String;

    fn try_from(fields: PipelineFields) -> Result<Self, String> {
        let due = match (fields.every, fields.at, fields.on) {
            (None, None, None) => Due::Every(Cadence::Steps(NonZeroU64::MIN)),
            (Some(every), None, None) => Due::Every(every),
            (None, Some(at), None) => Due::At(at),
            (None, None, Some(Event::Order)) => Due::OnOrder,
            (None, None, Some(Event::Viewer)) => Due::OnViewer,
            (None, None, Some(Event::End)) => Due::OnEnd,
            _ => {
                return Err(
                    "found more than one of `every`, `at` and `on`, expected at most one".into()
                );
            }
        };
        let PipelineFields { name, description, channel, budget, stages, when, .. } = fields;
        let PipelineFields { lasting, again_after, then, .. } = fields;
        Ok(Self {
            name,
            description,
            channel,
            due,
            budget,
            stages,
            when,
            lasting,
            again_after,
            then,
        })
    }
}

impl From<Pipeline> for PipelineFields {
    fn from(pipeline: Pipeline) -> Self {
        let (every, at, on) = match pipeline.due {
            Due::Every(every) => (Some(every), None, None),
            Due::At(at) => (None, Some(at), None),
            Due::OnOrder => (None, None, Some(Event::Order)),
            Due::OnViewer => (None, None, Some(Event::Viewer)),
            Due::OnEnd => (None, None, Some(Event::End)),
        };
        let Pipeline { name, description, channel, budget, stages, when, .. } = pipeline;
        let Pipeline { lasting, again_after, then, .. } = pipeline;
        Self {
            name,
            description,
            channel,
            every,
            at,
            on,
            budget,
            stages,
            when,
            lasting,
            again_after,
            then,
        }
    }
}
