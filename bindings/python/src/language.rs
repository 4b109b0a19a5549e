//! Texts of the JSON language, read with every error's place.

use pyo3::prelude::*;
use serde_json::Value;
use tombolo::deform::edit::Edit;
use tombolo::pipelines::language::{
    self, Change, Command, Content, Order, TimedCommand, check_content, nearest,
};

use crate::error::{ConfigurationError, of_language};

/// The keys of which an order of a new shape has one.
const OF_ORDERS: [&str; 5] = ["edits", "stack", "undo", "at", "order"];

/// Reads a configuration, so that whatever is wrong with it is raised.
#[pyfunction]
pub(crate) fn check_configuration(py: Python<'_>, text: &str, name: &str) -> PyResult<()> {
    py.detach(|| language::check(text, name)).map(drop).map_err(of_language)
}

/// An order of a new shape or a list of edits; `name` is what errors call the text, and where files
/// that edits name are looked for.
pub(crate) fn order(text: &str, name: &str) -> PyResult<Order> {
    let expected = r#"an order of a new shape, {"edits": [...]}, or a list of edits, [{...}]"#;
    let wrong = |found: &str| {
        ConfigurationError::new_err(format!("{name}: found {found}, expected {expected}"))
    };
    let content = check_content(text, name, None).map_err(|errors| match unlike_an_order(text) {
        Some(found) => wrong(&found),
        None => of_language(errors),
    });
    match content? {
        Content::Order(order) => Ok(*order),
        Content::Edits(edits) => Ok(Change::Edits(edits).into()),
        Content::Configuration(_) => Err(wrong("a configuration")),
        // As one of edits and as one of orders an empty list looks alike.
        Content::Orders(commands) if commands.is_empty() && text.trim_start().starts_with('[') => {
            Err(ConfigurationError::new_err(format!("{name}: expected at least one edit")))
        }
        Content::Orders(commands) => match <[_; 1]>::try_from(commands) {
            Ok([TimedCommand { at: None, command: Command::Order(order), .. }]) => Ok(order),
            _ => Err(wrong("commands of a file of orders")),
        },
    }
}

/// What a text is that nobody can have meant as an order, such as one edit by itself.
fn unlike_an_order(text: &str) -> Option<String> {
    match serde_json::from_str::<Value>(text).ok()? {
        Value::Array(_) => None,
        Value::Object(object) => {
            let is_like = |key: &str| nearest(key, OF_ORDERS).is_some();
            if object.keys().any(|key| is_like(key)) {
                return None;
            }
            let keys: Vec<String> = object.keys().take(3).map(|key| format!("`{key}`")).collect();
            Some(match keys.as_slice() {
                [] => "an object without a key".to_owned(),
                [key] => format!("an object with the key {key} alone"),
                _ => format!("an object with the keys {}", keys.join(", ")),
            })
        }
        other => Some(other.to_string()),
    }
}

/// Whether an edit's numbers are in a file.
pub(crate) fn names_file(edit: &Edit) -> bool {
    matches!(edit, Edit::Displacement(import) if import.file.is_some())
}
