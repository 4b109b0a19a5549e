//! A configuration: the views to stream, the monitors to watch, and how orders become mesh motion.

use std::borrow::Cow;
use std::net::SocketAddr;
use std::num::NonZeroU32;

use super::DeformStage;
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Deserialize, Serialize};
use tombolo_deform::mesh::Vector;
use tombolo_deform::quality::Guard;
use tombolo_deform::schedule::{Every, Schedule};
use tombolo_deform::surface::{
    Affine, Displacement, Edit, Rotate, ScaleDirection, ScaleNormals, Skeleton, Translate,
};

/// A whole configuration file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// The version of this language: 1.
    #[schemars(range(min = 1, max = 1))]
    pub version: u32,
    /// The server that viewers connect to; left out, there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stream: Option<StreamServer>,
    /// The file that every command and its outcome is written to, one JSON object a line. It can be given as a file of orders
    /// to another run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub journal: Option<String>,
    /// How orders from viewers are carried out.
    #[serde(default)]
    pub steering: Steering,
    /// What is done at which steps.
    #[serde(default)]
    pub pipelines: Vec<Pipeline>,
}

/// The server that viewers connect to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StreamServer {
    /// The address and port to listen on. Port 0 takes any free one. Anything but a loopback address is open to the network.
    #[schemars(with = "String")]
    pub listen: SocketAddr,
    /// The token that viewers must show: 16 to 128 letters, digits, `-` or `_`. Left out, a new one is made for each run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub token: Option<String>,
}

impl Default for StreamServer {
    fn default() -> Self {
        Self { listen: SocketAddr::from(([127, 0, 0, 1], 7070)), token: None }
    }
}

/// How orders from viewers are carried out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Steering {
    /// Whether the solver keeps stepping while a new shape is computed. The motion then starts at the first step after it is
    /// ready, so that the cycle depends on the machine's speed; otherwise the solver waits and the cycle is that of the order.
    pub background: bool,
    /// Whether the solver waits before its first step until a viewer has connected. Needs `stream`.
    pub wait_for_viewer: bool,
    /// On several ranks: at every how many calls of `execute` the ranks come together to hear what was asked for and whether one of
    /// them has an error, by one reduction of six numbers. In between a call returns at once, and what falls due waits for the
    /// next such call. While the mesh moves they come together at every call.
    pub poll_steps: NonZeroU32,
}

impl Default for Steering {
    fn default() -> Self {
        Self { background: true, wait_for_viewer: false, poll_steps: NonZeroU32::MIN }
    }
}

/// Stages that run one after the other at some steps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "PipelineFields", into = "PipelineFields")]
pub struct Pipeline {
    /// Its name, which is also that of its view; no two pipelines share one.
    pub name: String,
    /// The channel it reads, and of one that runs on orders the channel whose mesh they change; `None` is the solver's first.
    pub channel: Option<String>,
    /// When it runs.
    pub due: Due,
    /// What it does.
    pub stages: Vec<Stage>,
    /// The condition, over the monitors of its stages, under which `then` is done. Without one, `then` is always done.
    pub when: Option<String>,
    /// What is done when the condition holds.
    pub then: Vec<Action>,
}

/// When a pipeline runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Due {
    /// Again and again.
    Every(Every),
    /// Once.
    At(At),
    /// For each order: its stages are the settings of orders that bring none.
    OnOrder,
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
            // Time steps add up with rounding: a moment that is a billionth away is not worth a step's wait.
            At::Time(at) => time >= at - 1e-9 * at.abs(),
        }
    }
}

/// A pipeline as it stands in JSON.
#[derive(Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Pipeline")]
struct PipelineFields {
    /// Its name, which is also that of its view; no two pipelines share one.
    name: String,
    /// The channel it reads; left out, the solver's first. Of a pipeline with `"on": "order"`, the channel whose mesh orders change.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    channel: Option<String>,
    /// How often it runs. At most one of `every`, `at` and `on` is given; without any it runs at every step.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    every: Option<Every>,
    /// The one moment at which it runs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    at: Option<At>,
    /// The event at which it runs: the stages of a pipeline with `"on": "order"` (`deform`, `guard`, `schedule`) are the
    /// settings of orders that bring none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    on: Option<Event>,
    /// What it does, in this order. Each stage is an object with one key, the stage's name.
    stages: Vec<Stage>,
    /// A condition over the monitors of its stages, such as `quality.min < 0.05 || velocity.max > 100`. `cycle` and `time` may be
    /// named too.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    when: Option<String>,
    /// What is done when the condition holds; without a condition, whenever the pipeline has run.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    then: Vec<Action>,
}

/// What a pipeline can wait for.
#[derive(Clone, Copy, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Event {
    /// An order of a new shape.
    Order,
}

impl TryFrom<PipelineFields> for Pipeline {
    type Error = String;

    fn try_from(fields: PipelineFields) -> Result<Self, String> {
        let due = match (fields.every, fields.at, fields.on) {
            (None, None, None) => Due::Every(Schedule::default().every),
            (Some(every), None, None) => Due::Every(every),
            (None, Some(at), None) => Due::At(at),
            (None, None, Some(Event::Order)) => Due::OnOrder,
            _ => {
                return Err(
                    "found more than one of `every`, `at` and `on`, expected at most one".into()
                );
            }
        };
        let PipelineFields { name, channel, stages, when, then, .. } = fields;
        Ok(Self { name, channel, due, stages, when, then })
    }
}

impl From<Pipeline> for PipelineFields {
    fn from(pipeline: Pipeline) -> Self {
        let (every, at, on) = match pipeline.due {
            Due::Every(every) => (Some(every), None, None),
            Due::At(at) => (None, Some(at), None),
            Due::OnOrder => (None, None, Some(Event::Order)),
        };
        let Pipeline { name, channel, stages, when, then, .. } = pipeline;
        Self { name, channel, every, at, on, stages, when, then }
    }
}

impl JsonSchema for Pipeline {
    fn schema_name() -> Cow<'static, str> {
        PipelineFields::schema_name()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        PipelineFields::json_schema(generator)
    }
}

/// One stage of a pipeline.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Stage {
    /// Takes the boundary of the mesh, with its features. Must come first.
    Surface {},
    /// Cuts the mesh with a plane. Must come first.
    Slice(Slice),
    /// Leaves only some fields.
    Select(Select),
    /// Measures the cells: monitors `quality.min`, `quality.mean`, `quality.max` and `quality.inverted`, and the element field
    /// `scaled_jacobian`.
    Quality {},
    /// Measures a field: monitors `<field>.min`, `.max`, `.mean`, `.l2` (of the magnitude, for a vector) and `.non_finite`.
    Statistics(Statistics),
    /// Sends the extract to the viewers as the view of this pipeline.
    Stream(StreamStage),
    /// Writes the extract, or the whole mesh where no stage has extracted anything, to a file.
    Write(Write),
    /// An edit of the shape, for `order`.
    Translate(Translate),
    /// An edit of the shape, for `order`.
    Rotate(Rotate),
    /// An edit of the shape, for `order`.
    ScaleDirection(ScaleDirection),
    /// An edit of the shape, for `order`.
    ScaleNormals(ScaleNormals),
    /// An edit of the shape, for `order`.
    Affine(Affine),
    /// An edit of the shape, for `order`.
    Displacement(Displacement),
    /// An edit of the shape, for `order`.
    Skeleton(Skeleton),
    /// Orders the edits of the stages before it.
    Order(OrderStage),
    /// How the motion of the surface is carried into the volume. Only with `"on": "order"`.
    Deform(DeformStage),
    /// What the mesh must keep to. Only with `"on": "order"`.
    Guard(Guard),
    /// In how many steps the shape is reached. Only with `"on": "order"`.
    Schedule(Schedule),
    /// Pauses the solver.
    Pause {},
    /// Asks the solver to stop.
    Stop {},
}

impl Stage {
    /// The stage's key in JSON.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Stage::Surface {} => "surface",
            Stage::Slice(_) => "slice",
            Stage::Select(_) => "select",
            Stage::Quality {} => "quality",
            Stage::Statistics(_) => "statistics",
            Stage::Stream(_) => "stream",
            Stage::Write(_) => "write",
            Stage::Translate(_) => "translate",
            Stage::Rotate(_) => "rotate",
            Stage::ScaleDirection(_) => "scale_direction",
            Stage::ScaleNormals(_) => "scale_normals",
            Stage::Affine(_) => "affine",
            Stage::Displacement(_) => "displacement",
            Stage::Skeleton(_) => "skeleton",
            Stage::Order(_) => "order",
            Stage::Deform(_) => "deform",
            Stage::Guard(_) => "guard",
            Stage::Schedule(_) => "schedule",
            Stage::Pause {} => "pause",
            Stage::Stop {} => "stop",
        }
    }

    /// The edit that the stage is, if it is one.
    #[must_use]
    pub fn edit(&self) -> Option<Edit> {
        match self {
            Stage::Translate(edit) => Some(Edit::Translate(edit.clone())),
            Stage::Rotate(edit) => Some(Edit::Rotate(edit.clone())),
            Stage::ScaleDirection(edit) => Some(Edit::ScaleDirection(edit.clone())),
            Stage::ScaleNormals(edit) => Some(Edit::ScaleNormals(edit.clone())),
            Stage::Affine(edit) => Some(Edit::Affine(edit.clone())),
            Stage::Displacement(edit) => Some(Edit::Displacement(edit.clone())),
            Stage::Skeleton(edit) => Some(Edit::Skeleton(edit.clone())),
            _ => None,
        }
    }
}

/// What a pipeline does when its condition holds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Action {
    /// Pauses the solver.
    Pause {},
    /// Asks the solver to stop.
    Stop {},
    /// Sends the extract to the viewers.
    Stream(StreamStage),
    /// Writes the extract, or the whole mesh where no stage has extracted anything, to a file.
    Write(Write),
    /// Orders the edits of the stages.
    Order(OrderStage),
}

impl Action {
    /// The action's key in JSON.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Action::Pause {} => "pause",
            Action::Stop {} => "stop",
            Action::Stream(_) => "stream",
            Action::Write(_) => "write",
            Action::Order(_) => "order",
        }
    }
}

/// A plane that cuts the mesh.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Slice {
    /// A point of the plane.
    pub origin: Vector,
    /// The direction across the plane, of any length but 0.
    pub normal: Vector,
}

/// Fields to keep.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Select {
    /// The names of the fields to keep.
    pub fields: Vec<String>,
}

/// A field to measure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Statistics {
    /// The field's name.
    pub field: String,
}

/// How an extract is sent to viewers.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StreamStage {
    /// By how much a field's value may differ in the viewer.
    pub error: ErrorBound,
    /// By how much a point's coordinates may differ in the viewer; `relative` is to the diagonal of the bounding box.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub positions: Option<ErrorBound>,
}

/// By how much a number may differ after it was sent. The bound holds for every value.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ErrorBound {
    /// This part of the widest range of any component over the extract.
    Relative(f64),
    /// This much, in the field's unit.
    Absolute(f64),
    /// Not at all.
    Lossless,
}

impl Default for ErrorBound {
    fn default() -> Self {
        ErrorBound::Relative(1e-3)
    }
}

/// A file to write.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Write {
    /// The file, ending in `.vtu` or `.vtp`, or in `.vtpd`, `.pvtu` or `.pvtp`, which name a file in a folder beside them that holds
    /// the data. `{cycle}` and `{time}` stand for those of the step; `{cycle:4}` has four digits or more instead of six, `{time:3}`
    /// three behind the point. A relative one lies in the run's output directory.
    pub file: String,
}

/// How the edits of a pipeline are ordered. What is left out is taken from the pipeline with `"on": "order"`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OrderStage {
    /// In how many steps the shape is reached.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub schedule: Option<Schedule>,
    /// How the motion of the surface is carried into the volume.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub deform: Option<DeformStage>,
    /// What the mesh must keep to.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub guard: Option<Guard>,
}
