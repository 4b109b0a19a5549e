//! What a benchmark says.

use std::fmt;

use serde::Serialize;

/// Everything that one benchmark measured, and what it should have been.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// What was measured.
    pub rows: Vec<Row>,
    /// What it should be, computed from the rows.
    pub targets: Vec<Target>,
}

/// One measurement: the median of at least 5 runs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// What.
    pub case: String,
    /// Seconds it took.
    pub seconds: f64,
    /// The same in steps of the solver, where that says something.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steps: Option<f64>,
}

/// What a number should be.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Target {
    /// What.
    pub name: String,
    /// What was measured.
    pub value: f64,
    /// What it should be at most.
    pub target: f64,
    /// Whether it is.
    pub holds: bool,
}

impl Target {
    /// A number that should be `most` at most.
    pub fn at_most(name: &str, value: f64, most: f64) -> Self {
        Self { name: name.to_owned(), value, target: most, holds: value <= most }
    }
}

impl Report {
    /// As one line of JSON.
    pub fn json(&self) -> String {
        serde_json::to_string(self).unwrap_or_else(|error| format!("{{\"error\": \"{error}\"}}"))
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{:<44} {:>12} {:>14}", "case", "seconds", "solver steps")?;
        for row in &self.rows {
            let steps = row.steps.map_or_else(String::new, |steps| format!("{steps:.2e}"));
            writeln!(f, "{:<44} {:>12.3e} {:>14}", row.case, row.seconds, steps)?;
        }
        writeln!(f, "\n{:<44} {:>12} {:>14}", "target", "value", "at most")?;
        for target in &self.targets {
            let verdict = if target.holds { "holds" } else { "does not hold" };
            writeln!(
                f,
                "{:<44} {:>12.3e} {:>14.3e}  {verdict}",
                target.name, target.value, target.target
            )?;
        }
        Ok(())
    }
}
