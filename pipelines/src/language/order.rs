//! Orders of a new shape and the other commands that steer a run.

use std::num::NonZeroU32;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tombolo_deform::edit::Edit;
use tombolo_deform::quality::Guard;
use tombolo_deform::schedule::Schedule;

use super::{Deformation, Parameter, PipelineChange};

/// An order of a new shape: exactly one of `edits`, `stack` and `undo`, and settings for this order
/// alone.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "OrderFields", into = "OrderFields")]
pub struct Order {
    /// The change of the stack of edits.
    pub change: Change,
    /// In how many steps the shape is reached; `None` for the schedule of the configuration.
    pub schedule: Option<Schedule>,
    /// How the motion of the surface is carried into the volume; `None` is the configuration's.
    pub deform: Option<Deformation>,
    /// The guard that the mesh must keep to; `None` is the configuration's.
    pub guard: Option<Guard>,
    /// The id of an order that has not begun to move the mesh, whose place this one takes: that one is
    /// rejected at the same safe point. Where it has begun, this one is rejected.
    pub replaces: Option<String>,
    /// Seconds that the order of a viewer may wait for its turn, where that is less than the
    /// configuration's `steering.deadline`.
    pub deadline: Option<NonZeroU32>,
}

/// A change of the stack of edits.
#[derive(Debug, Clone, PartialEq)]
pub enum Change {
    /// Puts these edits on top.
    Edits(Vec<Edit>),
    /// Replaces the whole stack. An empty one is the reference shape.
    Stack(Vec<Edit>),
    /// Takes this many of the last orders back.
    Undo(NonZeroU32),
}

impl Order {
    /// Whether any edit of the order drags the skeleton.
    #[must_use]
    pub fn drags_skeleton(&self) -> bool {
        self.edits().iter().any(|edit| matches!(edit, Edit::Skeleton(_)))
    }

    /// The edits that the order brings.
    #[must_use]
    pub fn edits(&self) -> &[Edit] {
        match &self.change {
            Change::Edits(edits) | Change::Stack(edits) => edits,
            Change::Undo(_) => &[],
        }
    }

    /// The edits that the order brings, to be changed.
    #[must_use]
    pub fn edits_mut(&mut self) -> &mut [Edit] {
        match &mut self.change {
            Change::Edits(edits) | Change::Stack(edits) => edits,
            Change::Undo(_) => &mut [],
        }
    }
}

impl From<Change> for Order {
    /// The change with the configuration's settings.
    fn from(change: Change) -> Self {
        Self { change, schedule: None, deform: None, guard: None, replaces: None, deadline: None }
    }
}

/// An order as it stands in JSON.
#[derive(Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [{"required": ["edits"]}, {"required": ["stack"]}, {"required": ["undo"]}]))]
struct OrderFields {
    /// Edits that are put on top of the stack, applied one after the other.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    edits: Option<Vec<Edit>>,
    /// Edits that replace the whole stack. None at all is the reference shape.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    stack: Option<Vec<Edit>>,
    /// How many of the last orders are taken back.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    undo: Option<NonZeroU32>,
    /// In how many steps the shape is reached.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    schedule: Option<Schedule>,
    /// How the motion of the surface is carried into the volume.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    deform: Option<Deformation>,
    /// The guard that the mesh must keep to.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    guard: Option<Guard>,
    /// The id of an order that has not begun to move the mesh, whose place this one takes: that one is
    /// rejected at the same safe point. Where it has begun, this one is rejected.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    replaces: Option<String>,
    /// Seconds that the order of a viewer may wait for its turn, from when it came in, where that is less
    /// than `steering.deadline`. It is rejected then.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    deadline: Option<NonZeroU32>,
}

impl TryFrom<OrderFields> for Order {
    type Error = String;

    fn try_from(fields: OrderFields) -> Result<Self, String> {
        let change = match (fields.edits, fields.stack, fields.undo) {
            (Some(edits), None, None) => Change::Edits(edits),
            (None, Some(stack), None) => Change::Stack(stack),
            (None, None, Some(undo)) => Change::Undo(undo),
            (None, None, None) => {
                return Err(
                    "found none of `edits`, `stack` and `undo`, expected exactly one".into()
                );
            }
            _ => {
                return Err(
                    "found more than one of `edits`, `stack` and `undo`, expected exactly one"
                        .into(),
                );
            }
        };
        let OrderFields { schedule, deform, guard, replaces, deadline, .. } = fields;
        Ok(Self { change, schedule, deform, guard, replaces, deadline })
    }
}

impl From<Order> for OrderFields {
    fn from(order: Order) -> Self {
        let Order { change, schedule, deform, guard, replaces, deadline } = order;
        let fields = Self { schedule, deform, guard, replaces, deadline, ..Self::default() };
        match change {
            Change::Edits(edits) => Self { edits: Some(edits), ..fields },
            Change::Stack(stack) => Self { stack: Some(stack), ..fields },
            Change::Undo(undo) => Self { undo: Some(undo), ..fields },
        }
    }
}

/// A command of a viewer or of a file of orders.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Command {
    /// A new shape.
    Order(Order),
    /// The solver waits inside `execute` until it is resumed.
    Pause {},
    /// The solver goes on.
    Resume {},
    /// The solver is asked to end.
    Stop {},
    /// A parameter that the solver has declared gets a new value.
    Parameter(Parameter),
    /// Pipelines are added, replaced or removed.
    Pipelines(PipelineChange),
    /// An order that has not begun to move the mesh is taken back.
    Cancel(Cancel),
}

/// Takes an order back that waits or whose shapes are being found. One whose motion is under way is
/// undone by another order.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cancel {
    /// The id of the order.
    pub order: String,
}

impl Command {
    /// Whether it is for the job that it is given in, and not for a run that goes on from there: a
    /// pause, what ends one, or a stop.
    #[must_use]
    pub fn is_of_job(&self) -> bool {
        matches!(self, Command::Pause {} | Command::Resume {} | Command::Stop {})
    }

    /// The key by which JSON knows the command.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Command::Order(_) => "order",
            Command::Pause {} => "pause",
            Command::Resume {} => "resume",
            Command::Stop {} => "stop",
            Command::Parameter(_) => "parameter",
            Command::Pipelines(_) => "pipelines",
            Command::Cancel(_) => "cancel",
        }
    }

    /// The first edit of an order that names a file, and the file.
    #[must_use]
    pub fn file(&self) -> Option<(usize, &str)> {
        let Command::Order(order) = self else { return None };
        order.edits().iter().enumerate().find_map(|(index, edit)| match edit {
            Edit::Displacement(import) => Some((index, import.file.as_deref()?)),
            _ => None,
        })
    }
}

/// A question that a viewer may ask without steering.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Question {
    /// Asks what an order would come to, were it given now.
    Forecast(Order),
    /// Takes back the forecasts that were asked for.
    WithdrawForecast {},
}
