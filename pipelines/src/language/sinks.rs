//! Where monitors go besides viewers and reports.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Problem;

/// A table of monitors, with `cycle` and `time` in front and a row for each time the pipeline comes
/// to it. The first line names the columns, with units in brackets; what could not be measured is
/// `nan`. Rank 0 writes, on a thread of its own, and flushes the file after each row.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Csv {
    /// The file, ending in `.csv`. A relative one lies in the run's output directory. No two
    /// pipelines write one file.
    pub file: String,
    /// The monitors and parameters, as in conditions; left out, all monitors of the pipeline.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub monitors: Vec<String>,
    /// How a file that exists already is treated.
    #[serde(default)]
    pub existing: Existing,
}

/// How a file that exists when the run begins is treated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Existing {
    /// It is replaced when the first row is written.
    #[default]
    Replace,
    /// Rows are added to it. Its first line must be that of this table; else nothing is written, and
    /// that is told.
    Continue,
}

/// A line in the log, on rank 0.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Log {
    /// The line; monitors and parameters stand in braces: `pressure drop {drop} at {time}`. Left
    /// out, all monitors of the pipeline with their values.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub message: Option<String>,
    /// How important it is. The programs here show warnings only, unless they are told otherwise.
    pub level: LogLevel,
}

/// How important a line in the log is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LogLevel {
    /// Worth knowing.
    Info,
    /// Worth looking at.
    #[default]
    Warning,
    /// Something is wrong.
    Error,
}

impl Csv {
    pub(super) fn check(&self) -> Result<(), Problem> {
        if self.file.to_ascii_lowercase().ends_with(".csv") {
            return Ok(());
        }
        let message = format!("found the file `{}`, expected one that ends in `.csv`", self.file);
        Err(Problem::new(message).within("file"))
    }
}

impl Log {
    /// The parts of the message by turns: text, then the name of a number.
    ///
    /// # Errors
    /// A [`Problem`] for a brace without its partner.
    pub(crate) fn parts(&self) -> Result<Vec<(&str, Option<&str>)>, Problem> {
        let mut rest = self.message.as_deref().unwrap_or_default();
        let mut parts = Vec::new();
        while let Some((before, after)) = rest.split_once('{') {
            let Some((name, after)) = after.split_once('}') else {
                return Err(Problem::new("found '{' without its '}'").within("message"));
            };
            parts.push((before, Some(name)));
            rest = after;
        }
        parts.push((rest, None));
        Ok(parts)
    }
}
