//! What a run tells its clients.

use std::{collections::BTreeMap, sync::Arc};

use serde::{Deserialize, Serialize, de::DeserializeOwned};
use serde_json::Value;
use tombolo_deform::shape::Forecast;
use tombolo_pipelines::{
    encode::DecodedFrame,
    language::{LinkFor, PinnedNote, UnpinnedNote},
};

use crate::OrderReport;

/// Something that a run told.
#[derive(Debug, Clone)]
pub struct Received {
    /// The message, decoded.
    pub event: Event,
    /// The message as it came, one JSON object; empty for a frame and for what the client itself
    /// tells ([`Event::Lost`]).
    pub text: Arc<str>,
}

/// A message of the protocol from a run to its clients.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum Event {
    /// The facts of a run: sent first, and again when any of them changes but the values of
    /// parameters.
    Hello(Box<Hello>),
    /// How far the solver is. Of several that nobody has read the newest is kept.
    Status(Box<Status>),
    /// A change in the life of an order.
    Order(Box<OrderReport>),
    /// The values of the parameters, one of which was set. Of several that nobody has read the newest
    /// is kept.
    Parameters(ParameterValues),
    /// A change of the stack of edits; [`Client::stack`](super::Client::stack) gets it.
    Stack(StackChange),
    /// How exact the frames of a view are from now on.
    Precision(Precision),
    /// The values of a pipeline's monitors.
    Monitor(Values),
    /// The answer to [`Client::forecast`](super::Client::forecast).
    Forecast(Box<Foretold>),
    /// The outcome of a change of the pipelines.
    Pipelines(PipelinesChanged),
    /// A command has taken effect.
    Done(Done),
    /// The answer to [`Client::link_for`](super::Client::link_for).
    Link(LinkTold),
    /// The clients that are connected.
    People(People),
    /// A note was pinned in the picture.
    Note(PinnedNote),
    /// A note was taken away.
    NoteRemoved(UnpinnedNote),
    /// Something is wrong, with a command of this client where it has an id.
    Error(Complaint),
    /// The run has ended: nothing comes after it.
    End(End),
    /// A frame of a view, where [`Options::views`](super::Options::views) asks for them.
    Frame(Box<DecodedFrame>),
    /// The connection was lost, and is made again.
    Lost {
        /// Why it was lost.
        reason: String,
    },
    /// A message that this version does not know: one JSON value.
    Unknown(Value),
}

/// Whether a client steers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// Its commands are obeyed.
    Driver,
    /// It looks on.
    Watcher,
}

/// The facts of a run: views, features, fields, parameters, edits and orders.
#[derive(Debug, Clone, Deserialize)]
pub struct Hello {
    /// The version of the protocol.
    pub protocol: u32,
    /// The name of this client.
    pub client: String,
    /// With its name, what this client comes back by after a lost connection.
    #[serde(default)]
    pub back: Option<String>,
    /// Whether this client steers.
    pub role: Role,
    /// Whether this client may have the wheel; `None` where nothing is said of it.
    #[serde(default)]
    pub may_drive: Option<bool>,
    /// From where to where a recording goes, where this is one and no run.
    #[serde(default)]
    pub recording: Option<Value>,
    /// The live views.
    #[serde(default)]
    pub views: Vec<View>,
    /// The monitors.
    #[serde(default)]
    pub monitors: Vec<MonitorName>,
    /// The parameters of the solver.
    #[serde(default)]
    pub parameters: Vec<ParameterInformation>,
    /// The orders so far, the oldest first; in the first of a connection.
    #[serde(default)]
    pub orders: Vec<OrderReport>,
    /// How many edits make the shape; in the first of a connection.
    #[serde(default)]
    pub stack: Option<StackChange>,
    /// The named parts of the surface.
    #[serde(default)]
    pub features: Vec<Value>,
    /// The notes that are pinned, the oldest first; in the first of a connection.
    #[serde(default)]
    pub notes: Vec<PinnedNote>,
    /// The reference surface; `None` where the shape cannot be changed, or not yet.
    #[serde(default)]
    pub surface: Option<Value>,
}

/// The stack of edits, in short.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
pub struct StackChange {
    /// Rises by one with every change.
    pub revision: u64,
    /// How many edits there are.
    pub edits: usize,
    /// How many of them, from the first on, are those of before.
    #[serde(default)]
    pub kept: usize,
    /// How many orders can be taken back.
    #[serde(default)]
    pub undoable: usize,
}

/// How exact the frames of a view are, where the connection does not carry them as they are.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Precision {
    /// The view.
    pub view: String,
    /// So many times the error that the view asks for; 1 where frames are as it asks.
    pub coarser: f64,
}

/// A live view.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
pub struct View {
    /// The name of its pipeline.
    pub name: String,
    /// The kind of extract: `surface`, `slice`, ...
    pub kind: String,
}

/// A monitor.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
pub struct MonitorName {
    /// Its pipeline.
    pub pipeline: String,
    /// Its name.
    pub name: String,
    /// Its unit, where it is known.
    #[serde(default)]
    pub unit: Option<String>,
}

/// A number of the solver that can be steered.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ParameterInformation {
    /// Its name.
    pub name: String,
    /// Its value now.
    pub value: f64,
    /// The least value it may take.
    pub minimum: f64,
    /// The greatest.
    pub maximum: f64,
    /// Its unit, where it is known.
    #[serde(default)]
    pub unit: Option<String>,
}

/// How far the solver is.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Status {
    /// The last cycle that it told.
    pub cycle: u64,
    /// The simulated time, in the solver's unit.
    pub time: f64,
    /// Whether it waits to be resumed.
    #[serde(default)]
    pub paused: bool,
    /// Whether it was asked to stop.
    #[serde(default)]
    pub stopped: bool,
    /// Seconds that a step takes, where it is known.
    #[serde(default)]
    pub step_seconds: Option<f64>,
    /// How many clients are connected.
    #[serde(default)]
    pub viewers: u32,
    /// The name of the client that steers.
    #[serde(default)]
    pub driver: Option<String>,
    /// The quality of the mesh, where it is known.
    #[serde(default)]
    pub quality: Option<StatusQuality>,
}

/// The quality of the mesh, in short.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct StatusQuality {
    /// The least scaled Jacobian.
    pub min: f64,
    /// The mean scaled Jacobian.
    pub mean: f64,
    /// How many cells are inverted.
    pub inverted: u64,
}

/// The values of a pipeline's monitors at a cycle.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Values {
    /// The pipeline.
    pub pipeline: String,
    /// The cycle.
    pub cycle: u64,
    /// The simulated time.
    pub time: f64,
    /// The values by name; `None` where nothing could be measured.
    pub values: BTreeMap<String, Option<f64>>,
}

/// The forecast of an order.
#[derive(Debug, Clone, Deserialize)]
pub struct Foretold {
    /// The id of the question.
    pub id: Option<String>,
    /// The forecast.
    pub order: Forecast,
}

/// The outcome of a change of the pipelines.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
pub struct PipelinesChanged {
    /// The id of the change.
    pub id: Option<String>,
    /// `accepted` or `applied`.
    pub status: String,
    /// The cycle at which it was made.
    #[serde(default)]
    pub cycle: Option<u64>,
}

/// The values that the parameters of the solver have now.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct ParameterValues {
    /// By the names of the parameters.
    pub values: BTreeMap<String, f64>,
}

/// A command that has taken effect.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Done {
    /// The id of the command.
    pub id: String,
    /// The cycle at which it took effect.
    #[serde(default)]
    pub cycle: Option<u64>,
    /// The simulated time then.
    #[serde(default)]
    pub time: Option<f64>,
}

/// A link that opens one browser, once.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
pub struct LinkTold {
    /// The rights that it gives.
    pub r#for: LinkFor,
    /// The address, relative to that of the viewer's page.
    pub path: String,
    /// The id of the question.
    #[serde(default)]
    pub id: Option<String>,
}

/// The clients that are connected.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
pub struct People {
    /// Each of them, the first to come first.
    pub viewers: Vec<Person>,
}

/// A client that is connected.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
pub struct Person {
    /// The name of the client.
    pub client: String,
    /// The name that it has given itself. Two may have the same.
    #[serde(default)]
    pub name: Option<String>,
    /// Whether it steers.
    pub role: Role,
    /// Whether it could.
    pub may_drive: bool,
}

/// An error that the run tells.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
pub struct Complaint {
    /// A text that says what is wrong.
    pub message: String,
    /// The id of the command that it answers.
    #[serde(default)]
    pub id: Option<String>,
}

/// How a run ended.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct End {
    /// `finished`, `stopped` or `failed`.
    pub how: String,
    /// The last cycle.
    pub cycle: u64,
    /// The simulated time then.
    pub time: f64,
}

impl Event {
    /// Reads a text message; the reason says why it is none of this protocol.
    ///
    /// One that has another name or another form than is known is [`Event::Unknown`].
    pub(super) fn read(text: &str) -> Result<Self, String> {
        let message: Value = serde_json::from_str(text).map_err(|error| error.to_string())?;
        let members = message.as_object().ok_or("expected an object")?;
        let mut members = members.iter().filter(|(key, _)| *key != "id");
        let (Some((key, value)), None) = (members.next(), members.next()) else {
            return Err("expected an object of one key".into());
        };
        fn read<T: DeserializeOwned>(value: &Value) -> Option<T> {
            T::deserialize(value).ok()
        }
        let event = match key.as_str() {
            "hello" => read(value).map(Event::Hello),
            "status" => read(value).map(Event::Status),
            "order" => read(value).map(Event::Order),
            "parameters" => read(value).map(Event::Parameters),
            "stack" => read(value).map(Event::Stack),
            "precision" => read(value).map(Event::Precision),
            "forecast" => read(value).map(Event::Forecast),
            "monitor" => read(value).map(Event::Monitor),
            "pipelines" => read(value).map(Event::Pipelines),
            "done" => read(value).map(Event::Done),
            "link" => read(value).map(Event::Link),
            "people" => read(value).map(Event::People),
            "note" => read(value).map(Event::Note),
            "note_removed" => read(value).map(Event::NoteRemoved),
            "error" => read(value).map(Event::Error),
            "end" => read(value).map(Event::End),
            _ => None,
        };
        Ok(event.unwrap_or(Event::Unknown(message)))
    }

    /// The id of the command that this answers.
    pub(super) fn answers(&self) -> Option<&str> {
        match self {
            Event::Order(order) => Some(&order.id),
            Event::Forecast(forecast) => forecast.id.as_deref(),
            Event::Pipelines(change) => change.id.as_deref(),
            Event::Done(done) => Some(&done.id),
            Event::Error(error) => error.id.as_deref(),
            Event::Link(link) => link.id.as_deref(),
            Event::Unknown(value) => {
                value.as_object()?.values().find_map(|value| value.get("id")?.as_str())
            }
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_known_is_passed_on_and_what_is_no_message_is_not() {
        assert!(matches!(Event::read(r#"{"weather": {"id": "a"}}"#), Ok(Event::Unknown(_))));
        assert!(matches!(Event::read(r#"{"status": {"cycle": -1}}"#), Ok(Event::Unknown(_))));
        let done = Event::read(r#"{"done": {"id": "a", "cycle": 3, "time": 0.1}}"#).expect("known");
        assert_eq!(done.answers(), Some("a"));
        for nonsense in ["", "[]", "{}", "null", r#"{"status": {}, "error": {}}"#, "\u{0}"] {
            assert!(Event::read(nonsense).is_err(), "{nonsense}");
        }
    }
}
