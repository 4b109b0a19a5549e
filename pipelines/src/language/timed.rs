//! Commands and when they are carried out, and the lines of a journal about them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::order::{Cancel, Command, Order};
use super::parameter::Parameter;
use super::parse::Validate;
use super::{At, PipelineChange, Problem};
use crate::limits::WAITING;

/// A command and when it is carried out: exactly one of `order`, `pause`, `resume`, `stop`,
/// `parameter`, `pipelines` and `cancel`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "TimedFields", into = "TimedFields")]
pub struct TimedCommand {
    /// When; `None` is the first step.
    pub at: Option<At>,
    /// A name for it in reports.
    pub id: Option<String>,
    /// The command.
    pub command: Command,
}

/// Declares the JSON form of a type that holds a command among other keys, so that unknown keys
/// stay errors (serde's `flatten` would let them pass).
macro_rules! with_command {
    ($(#[$attribute:meta])* struct $name:ident { $($(#[$field_attribute:meta])* $field:ident: $type:ty,)* }) => {
        #[derive(Clone, Default, Serialize, Deserialize, JsonSchema)]
        #[serde(deny_unknown_fields)]
        $(#[$attribute])*
        struct $name {
            $(#[serde(default, skip_serializing_if = "Option::is_none")] $(#[$field_attribute])* $field: Option<$type>,)*
            /// A new shape.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            order: Option<Order>,
            /// The solver waits inside `execute` until it is resumed.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            pause: Option<Empty>,
            /// The solver goes on.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            resume: Option<Empty>,
            /// The solver is asked to end.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            stop: Option<Empty>,
            /// A parameter that the solver has declared gets a new value.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            parameter: Option<Parameter>,
            /// Pipelines are added, replaced or removed.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            pipelines: Option<PipelineChange>,
            /// An order that has not begun to move the mesh is taken back.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            cancel: Option<Cancel>,
        }

        impl $name {
            /// The command, if there is one; an error where there are several.
            fn take_command(&mut self) -> Result<Option<Command>, String> {
                let mut commands: Vec<Command> = [
                    self.order.take().map(Command::Order),
                    self.pause.take().map(|_| Command::Pause {}),
                    self.resume.take().map(|_| Command::Resume {}),
                    self.stop.take().map(|_| Command::Stop {}),
                    self.parameter.take().map(Command::Parameter),
                    self.pipelines.take().map(Command::Pipelines),
                    self.cancel.take().map(Command::Cancel),
                ]
                .into_iter()
                .flatten()
                .collect();
                if commands.len() > 1 {
                    return Err(format!("found {} commands, expected exactly one of {COMMANDS}", commands.len()));
                }
                Ok(commands.pop())
            }

            fn set_command(&mut self, command: Command) {
                match command {
                    Command::Order(order) => self.order = Some(order),
                    Command::Pause {} => self.pause = Some(Empty {}),
                    Command::Resume {} => self.resume = Some(Empty {}),
                    Command::Stop {} => self.stop = Some(Empty {}),
                    Command::Parameter(parameter) => self.parameter = Some(parameter),
                    Command::Pipelines(change) => self.pipelines = Some(change),
                    Command::Cancel(cancel) => self.cancel = Some(cancel),
                }
            }
        }
    };
}

const COMMANDS: &str = "`order`, `pause`, `resume`, `stop`, `parameter`, `pipelines` and `cancel`";

/// No settings.
#[derive(Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Empty {}

with_command! {
    /// A timed command as it stands in JSON.
    struct TimedFields {
        /// When; left out, at the first step.
        at: At,
        /// A name for it in reports.
        id: String,
    }
}

impl TryFrom<TimedFields> for TimedCommand {
    type Error = String;

    fn try_from(mut fields: TimedFields) -> Result<Self, String> {
        let command = fields
            .take_command()?
            .ok_or(format!("found no command, expected one of {COMMANDS}"))?;
        Ok(Self { at: fields.at, id: fields.id, command })
    }
}

impl From<TimedCommand> for TimedFields {
    fn from(timed: TimedCommand) -> Self {
        let mut fields = Self { at: timed.at, id: timed.id, ..Self::default() };
        fields.set_command(timed.command);
        fields
    }
}

/// The state that a command has reached.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OrderStatus {
    /// It is well-formed and waits for a safe point.
    Accepted,
    /// It has taken effect.
    Applied,
    /// It has not and will not take effect.
    Rejected,
    /// It was applied, but the solver has not moved its mesh to a shape that it was handed.
    NotFollowed,
    /// It was applied, but the run ended before a call could show whether the solver went to the
    /// last shape that it was handed.
    NotConfirmed,
}

/// Who gave a command.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CommandAuthor {
    /// The viewer of this name.
    Viewer(String),
    /// A file of orders.
    File,
    /// The pipeline of this name.
    Pipeline(String),
    /// The file of the configuration, which has changed.
    Configuration,
    /// The program that the adaptor is linked into.
    Program,
}

/// One line of a journal. A command has a line when it is accepted, which holds the command, and a
/// line of the same id when it is applied or rejected; one more where the solver did not follow, or
/// where nobody could see whether it did.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "JournalFields", into = "JournalFields")]
pub struct JournalEntry {
    /// The command's id.
    pub id: String,
    /// The state that it has reached.
    pub status: OrderStatus,
    /// The cycle at which it was reached; for an applied order, the one at which its motion began,
    /// and for one that was not followed or not confirmed, the one that handed the shape out.
    pub cycle: u64,
    /// The simulated time then.
    pub time: f64,
    /// The command; in the line that says it was accepted.
    pub command: Option<Command>,
    /// Who gave the command; in the line that says it was accepted.
    pub by: Option<CommandAuthor>,
    /// Why it was rejected.
    pub reason: Option<String>,
    /// The least scaled Jacobian on the path; of an order that the guard rejected, what it would
    /// have come to.
    pub min_scaled_jacobian: Option<f64>,
    /// The fraction of an order's amounts that was done, where the guard clamped it; of a rejected
    /// one, what would pass.
    pub fraction: Option<f64>,
}

with_command! {
    /// A line of a journal as it stands in JSON.
    struct JournalFields {
        /// The command's id.
        id: String,
        /// The state that it has reached.
        status: OrderStatus,
        /// The cycle at which it was reached.
        cycle: u64,
        /// The simulated time then.
        time: f64,
        /// Who gave the command.
        by: CommandAuthor,
        /// Why it was rejected.
        reason: String,
        /// The least scaled Jacobian on the path; of an order that the guard rejected, what it
        /// would have come to.
        min_scaled_jacobian: f64,
        /// The fraction of an order's amounts that was done, where the guard clamped it; of a
        /// rejected one, what would pass.
        fraction: f64,
    }
}

impl TryFrom<JournalFields> for JournalEntry {
    type Error = String;

    fn try_from(mut fields: JournalFields) -> Result<Self, String> {
        let command = fields.take_command()?;
        let status = fields.status.ok_or("the key `status` is missing")?;
        if command.is_none() && status == OrderStatus::Accepted {
            return Err(format!("found no command, expected one of {COMMANDS}"));
        }
        Ok(Self {
            id: fields.id.ok_or("the key `id` is missing")?,
            status,
            cycle: fields.cycle.ok_or("the key `cycle` is missing")?,
            time: fields.time.ok_or("the key `time` is missing")?,
            command,
            by: fields.by,
            reason: fields.reason,
            min_scaled_jacobian: fields.min_scaled_jacobian,
            fraction: fields.fraction,
        })
    }
}

impl From<JournalEntry> for JournalFields {
    fn from(entry: JournalEntry) -> Self {
        let mut fields = Self {
            id: Some(entry.id),
            status: Some(entry.status),
            cycle: Some(entry.cycle),
            time: Some(entry.time),
            by: entry.by,
            reason: entry.reason,
            min_scaled_jacobian: entry.min_scaled_jacobian,
            fraction: entry.fraction,
            ..Self::default()
        };
        if let Some(command) = entry.command {
            fields.set_command(command);
        }
        fields
    }
}

impl Validate for Vec<TimedCommand> {
    fn validate(&self) -> Result<(), Problem> {
        WAITING.check(self.len())?;
        self.iter()
            .enumerate()
            .try_for_each(|(index, timed)| timed.validate().map_err(|problem| problem.at(index)))
    }

    fn problems(&self) -> Vec<Problem> {
        let too_many = WAITING.check(self.len()).err().map(Problem::from);
        let of_item = |(index, timed): (usize, &TimedCommand)| {
            timed.problems().into_iter().map(move |problem| problem.at(index))
        };
        too_many.into_iter().chain(self.iter().enumerate().flat_map(of_item)).collect()
    }
}

impl Validate for JournalEntry {
    fn validate(&self) -> Result<(), Problem> {
        self.command.as_ref().map_or(Ok(()), Validate::validate)
    }

    fn problems(&self) -> Vec<Problem> {
        self.command.as_ref().map_or_else(Vec::new, Validate::problems)
    }
}

/// The lines that are not empty, each with its number from 0.
pub(super) fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let is_empty = |line: &str| line.trim_start_matches('\u{feff}').trim().is_empty();
    text.lines().enumerate().filter(move |(_, line)| !is_empty(line))
}

/// The number of the line that a killed run may have left half-written: the last.
pub(super) fn torn_line(text: &str) -> Option<usize> {
    text.lines().count().checked_sub(1).filter(|_| !text.ends_with('\n'))
}
