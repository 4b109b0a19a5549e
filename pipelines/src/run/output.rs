//! The outputs of pipelines.

use std::num::NonZeroU32;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::extract::Extract;
use crate::language::{Command, ErrorBound, Existing, LogLevel, StreamStage};
use crate::render::Picture;

/// How exactly an extract is sent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Encoding {
    /// By how much a field's value may differ in the viewer.
    pub fields: ErrorBound,
    /// By how much a point's coordinates may; relative to the diagonal of the bounding box.
    pub positions: ErrorBound,
}

impl Default for Encoding {
    /// Fields to a thousandth of their range, points to a hundred-thousandth of the diagonal.
    fn default() -> Self {
        StreamStage::default().into()
    }
}

impl From<StreamStage> for Encoding {
    fn from(stage: StreamStage) -> Self {
        Self {
            fields: stage.error,
            positions: stage.positions.unwrap_or(ErrorBound::Relative(1e-5)),
        }
    }
}

/// An extract to be encoded and sent as the newest frame of a view.
#[derive(Debug, Clone)]
pub struct Frame {
    /// The pipeline, which is the view.
    pub pipeline: Arc<str>,
    /// The step.
    pub cycle: u64,
    /// The simulated time.
    pub time: f64,
    /// The extract to send.
    pub extract: Arc<Extract>,
    /// How exactly.
    pub encoding: Encoding,
}

/// The values of a pipeline's monitors at a step.
#[derive(Debug, Clone, PartialEq)]
pub struct MonitorValues {
    /// The pipeline.
    pub pipeline: Arc<str>,
    /// The step.
    pub cycle: u64,
    /// The simulated time.
    pub time: f64,
    /// Names such as `quality.min`, and their values; NaN where nothing could be measured.
    pub values: Vec<(String, f64)>,
}

/// A table of monitors that is written as the run goes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Table {
    /// The file. A relative one lies in the run's output directory.
    pub file: String,
    /// The titles of the columns behind `cycle` and `time`, with units.
    pub titles: Vec<String>,
    /// How a file that exists already is treated.
    pub existing: Existing,
}

/// A thing that a pipeline wants done.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum Output {
    /// Send this to viewers.
    Frame(Frame),
    /// Write this to a file.
    Write {
        /// The pipeline.
        pipeline: Arc<str>,
        /// The file, its pattern filled in. A relative one lies in the run's output directory.
        path: String,
        /// The step.
        cycle: u64,
        /// The simulated time.
        time: f64,
        /// The extract to write.
        extract: Arc<Extract>,
        /// The .pvd series that the file belongs to; `None` where each step writes the same file. A
        /// relative one lies in the run's output directory.
        series: Option<String>,
        /// How many files of the series stay; `None`: all.
        keep: Option<NonZeroU32>,
    },
    /// Add a row to a table. On rank 0.
    Row {
        /// The pipeline.
        pipeline: Arc<str>,
        /// The table.
        table: Arc<Table>,
        /// The step.
        cycle: u64,
        /// The simulated time.
        time: f64,
        /// The values of the columns; NaN where nothing could be measured.
        values: Vec<f64>,
    },
    /// Write a line to the log. On rank 0.
    Log {
        /// The pipeline.
        pipeline: Arc<str>,
        /// How important it is.
        level: LogLevel,
        /// The line.
        message: String,
    },
    /// Write this picture to a file.
    Picture {
        /// The pipeline.
        pipeline: Arc<str>,
        /// The file, its pattern filled in: a `.png`, or a `.cdb`, the database that the picture is
        /// added to. A relative one lies in the run's output directory.
        path: String,
        /// The step.
        cycle: u64,
        /// The simulated time.
        time: f64,
        /// The picture to write.
        picture: Arc<Picture>,
    },
    /// Tell viewers and reports.
    Monitor(MonitorValues),
    /// Carry this out, as if a viewer had asked for it.
    Command {
        /// The pipeline.
        pipeline: Arc<str>,
        /// A pause, a stop, a value of a parameter, or an order of a new shape.
        command: Command,
    },
    /// Something could not be done, or is done in another way; tell viewers and the log.
    Error {
        /// The pipeline.
        pipeline: Arc<str>,
        /// The step.
        cycle: u64,
        /// The fault, where it is, and what was expected.
        message: String,
    },
}

/// A view that a pipeline streams.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct View {
    /// The pipeline's name.
    pub name: String,
    /// The kind of view.
    pub kind: ViewKind,
    /// The channel that it shows; left out, the solver's first.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub channel: Option<String>,
}

/// The kind of a view.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ViewKind {
    /// The boundary of a mesh.
    Surface,
    /// A cut.
    Slice,
}
