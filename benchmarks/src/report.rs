//! The report of a benchmark: rows and targets, as tables or as one line of JSON.

use std::fmt;

use serde::Serialize;

/// Everything that one benchmark measured, and what it should have been.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report<R = Row> {
    /// The measurements.
    pub rows: Vec<R>,
    /// The targets, computed from the rows.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub targets: Vec<Target>,
}

/// A row of a table.
pub trait Line: Serialize {
    /// The names of the columns.
    const HEADINGS: &'static [&'static str];

    /// The text of each column.
    fn cells(&self) -> Vec<String>;
}

/// One measurement: the median of at least 5 runs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// The name of the measurement.
    pub case: String,
    /// Seconds it took.
    pub seconds: f64,
    /// The seconds in steps of the solver, where that says something.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steps: Option<f64>,
}

impl Row {
    /// The seconds of a case.
    pub fn new(case: impl Into<String>, seconds: f64) -> Self {
        Self { case: case.into(), seconds, steps: None }
    }
}

impl Line for Row {
    const HEADINGS: &'static [&'static str] = &["case", "seconds", "solver steps"];

    fn cells(&self) -> Vec<String> {
        let steps = self.steps.map_or_else(String::new, |steps| format!("{steps:.2e}"));
        vec![self.case.clone(), format!("{:.3e}", self.seconds), steps]
    }
}

/// A number and what it should be at most.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Target {
    /// The name of the measurement.
    pub name: String,
    /// The number.
    pub value: f64,
    /// The largest number that holds.
    pub target: f64,
    /// Whether it is.
    pub holds: bool,
}

impl Target {
    /// A number that should be `most` at most.
    pub fn at_most(name: impl Into<String>, value: f64, most: f64) -> Self {
        Self { name: name.into(), value, target: most, holds: value <= most }
    }
}

impl Line for Target {
    const HEADINGS: &'static [&'static str] = &["target", "value", "at most", ""];

    fn cells(&self) -> Vec<String> {
        let verdict = if self.holds { "holds" } else { "does not hold" };
        vec![
            self.name.clone(),
            format!("{:.3e}", self.value),
            format!("{:.3e}", self.target),
            verdict.into(),
        ]
    }
}

impl<R: Line> Report<R> {
    /// The report as tables, or as one line of JSON.
    pub fn text(&self, json: bool) -> Result<String, serde_json::Error> {
        if json { Ok(serde_json::to_string(self)? + "\n") } else { Ok(self.to_string()) }
    }
}

impl<R: Line> fmt::Display for Report<R> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        table(formatter, &self.rows)?;
        if self.targets.is_empty() {
            return Ok(());
        }
        writeln!(formatter)?;
        table(formatter, &self.targets)
    }
}

/// Writes lines below their headings, each column as wide as its longest text.
fn table<L: Line>(formatter: &mut fmt::Formatter<'_>, lines: &[L]) -> fmt::Result {
    let headings = L::HEADINGS.iter().map(|&heading| heading.to_owned()).collect();
    let lines: Vec<Vec<String>> =
        std::iter::once(headings).chain(lines.iter().map(L::cells)).collect();
    for line in &lines {
        for (column, text) in line.iter().enumerate() {
            let texts = lines.iter().filter_map(|line| line.get(column));
            let width = texts.map(|text| text.chars().count()).max().unwrap_or_default();
            match column {
                0 => write!(formatter, "{text:<width$}")?,
                _ => write!(formatter, "  {text:>width$}")?,
            }
        }
        writeln!(formatter)?;
    }
    Ok(())
}
