//! Texts of the JSON language, read with every error's place.

use pyo3::prelude::*;
use tombolo::deform::edit::Edit;
use tombolo::pipelines::language::{
    self, Change, Command, Content, Order, TimedCommand, check_content,
};

use crate::error::{ConfigurationError, of_language};

/// Reads a configuration, so that whatever is wrong with it is raised.
#[pyfunction]
pub(crate) fn check_configuration(py: Python<'_>, text: &str, name: &str) -> PyResult<()> {
    py.detach(|| language::check(text, name)).map(drop).map_err(of_language)
}

/// An order of a new shape or a list of edits; `name` is what errors call the text, and where files
/// that edits name are looked for.
pub(crate) fn order(text: &str, name: &str) -> PyResult<Order> {
    let wrong = |found: &str| {
        ConfigurationError::new_err(format!(
            "{name}: found {found}, expected an order of a new shape or a list of edits"
        ))
    };
    match check_content(text, name, None).map_err(of_language)? {
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

/// Whether an edit's numbers are in a file.
pub(crate) fn names_file(edit: &Edit) -> bool {
    matches!(edit, Edit::Displacement(import) if import.file.is_some())
}
