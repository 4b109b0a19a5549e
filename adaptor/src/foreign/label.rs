//! The labels of a channel, its meshes and their parts in errors.

use std::fmt;

use crate::foreign::error::RunError;

/// The label that errors have for a thing that a solver shows, in the terms in which it was shown.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Label {
    /// The path of a node, below which its parts lie.
    Path(String),
    /// Words such as `channel 'fluid'`, behind which its parts are named.
    Words(String),
}

impl Default for Label {
    fn default() -> Self {
        Self::Words(String::new())
    }
}

impl Label {
    /// The label of a part: of the node `below` this one, or of the `name` behind these words.
    #[must_use]
    pub fn part(&self, below: &str, name: &str) -> Self {
        match self {
            Self::Path(path) => Self::Path(format!("{path}/{below}")),
            Self::Words(words) => Self::Words(format!("{words}, {name}")),
        }
    }

    /// The label of a field, which lies in the node `below` this one.
    pub(super) fn field(&self, below: &str, name: &str) -> Self {
        self.part(below, &format!("field '{name}'"))
    }

    /// The label as errors begin with it: a path in quotes, and words as they are.
    pub(super) fn place(&self) -> String {
        match self {
            Self::Path(path) => format!("'{path}'"),
            Self::Words(words) => words.clone(),
        }
    }

    /// The error that something else was found than is needed.
    #[must_use]
    pub fn wrong(&self, found: impl ToString, expected: impl ToString) -> RunError {
        match self {
            Self::Path(path) => RunError::wrong(path, found, expected),
            Self::Words(words) => RunError::Argument {
                what: words.clone(),
                found: found.to_string(),
                expected: expected.to_string(),
            },
        }
    }
}

impl fmt::Display for Label {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Path(text) | Self::Words(text) => f.write_str(text),
        }
    }
}
