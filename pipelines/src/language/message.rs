//! Messages of viewers.

use serde::Deserialize;

use super::order::{Command, Question};
use super::parse::Document;
use super::scan::Value;
use super::together::Together;
use super::{LanguageError, Problem};

/// Characters that the id of a message may have.
const ID: usize = 64;

/// A message of a viewer.
#[derive(Debug, Clone, PartialEq)]
pub enum Message {
    /// Steers the run.
    Command(Command),
    /// Asks something.
    Question(Question),
    /// Settles who drives.
    Wheel(Wheel),
    /// Is about the viewers themselves, and changes nothing of the run.
    Together(Together),
}

/// A message that settles who drives.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Wheel {
    /// Asks to become the driver.
    Drive {},
    /// The driver gives the wheel to another.
    HandOver {
        /// The other's name.
        to: String,
    },
    /// The driver keeps the wheel, and has those told who asked for it.
    Keep {},
    /// The driver ends another's connection.
    Kick {
        /// The other's name.
        client: String,
    },
    /// The driver is there, though it gives no command.
    Here {},
}

/// Reads a message: an object with one key, and an `id` beside it at will.
///
/// The id is there also where the message says nothing that is understood, so that the answer can
/// name it.
///
/// ```
/// use tombolo_pipelines::language::{Command, Message, parse_message};
///
/// let (id, message) = parse_message(r#"{"id": "c1-7", "pause": {}}"#);
/// assert_eq!((id.as_deref(), message), (Some("c1-7"), Ok(Message::Command(Command::Pause {}))));
/// let (id, message) = parse_message(r#"{"id": "c1-8", "puase": {}}"#);
/// assert!(id.is_some() && message.is_err_and(|error| error.suggestion.as_deref() == Some("pause")));
/// let (id, message) = parse_message(r#"{"id": "c1-9", "parameter": {"name": "a", "value": 1e999}}"#);
/// assert!(id.as_deref() == Some("c1-9") && message.is_err());
/// ```
pub fn parse_message(text: &str) -> (Option<String>, Result<Message, LanguageError>) {
    let mut document = match Document::read(text, "message") {
        Ok(document) => document,
        Err(error) => return (id_of_unread(text), Err(error)),
    };
    let id = match take_id(&mut document) {
        Ok(id) => id,
        Err(error) => return (None, Err(error)),
    };
    (id, message(&document))
}

/// The id of a message that is JSON and yet cannot be read, such as one with a number beyond range.
fn id_of_unread(text: &str) -> Option<String> {
    #[derive(Deserialize)]
    struct Named {
        id: String,
    }
    serde_json::from_str::<Named>(text).ok().map(|named| named.id).filter(|id| is_id(id))
}

fn is_id(id: &str) -> bool {
    !id.is_empty() && id.chars().count() <= ID && !id.chars().any(char::is_control)
}

fn take_id(document: &mut Document<'_>) -> Result<Option<String>, LanguageError> {
    let Some(member) = document.root.member("id") else { return Ok(None) };
    let id = match &member.node.value {
        Value::String(id) if is_id(id) => id.clone(),
        _ => {
            let message = format!("expected a text of 1 to {ID} visible characters");
            return Err(document.locate(Problem::new(message).within("id")));
        }
    };
    if let Value::Object(members) = &mut document.root.value {
        members.retain(|member| member.key != "id");
    }
    Ok(Some(id))
}

fn message(document: &Document<'_>) -> Result<Message, LanguageError> {
    let key = match &document.root.value {
        Value::Object(members) if members.len() == 1 => {
            members.first().map_or("", |member| member.key.as_str())
        }
        _ => "",
    };
    match key {
        "forecast" | "withdraw_forecast" => document.valid().map(Message::Question),
        "drive" | "hand_over" | "keep" | "kick" | "here" => document.value().map(Message::Wheel),
        "link" | "name" | "follow" | "camera" | "note" | "remove_note" | "views" => {
            document.valid().map(Message::Together)
        }
        _ => document.valid().map(Message::Command),
    }
}
