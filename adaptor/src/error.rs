//! Why a call of the adaptor failed.

use tombolo_deform::{communicator::RankError, number::Number};
use tombolo_pipelines::{extract::ChannelError, language::Problems};

use crate::{
    checkpoint::CheckpointError, journal::JournalError, recording::RecordError, report::Report,
    steering::ParameterError, stream::StreamError,
};

/// Why a run could not be set up.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum InitializeError {
    /// The server for viewers could not be started.
    #[error(transparent)]
    Stream(#[from] StreamError),
    /// The journal could not be created.
    #[error(transparent)]
    Journal(#[from] JournalError),
    /// The recording could not be begun.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// A parameter's declaration makes no sense.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The configuration makes no sense.
    #[error("the configuration: {0}")]
    Configuration(Problems),
    /// The file of the configuration cannot be watched.
    #[error("watch: {}: {source}", file.display())]
    Watch {
        /// The file.
        file: std::path::PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The checkpoint cannot be gone on from.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// One of the commands given beforehand makes no sense.
    #[error("the orders given beforehand: {0}")]
    Orders(Problems),
    /// Something is wrong on one rank. All ranks have this error.
    #[error(transparent)]
    Rank(#[from] RankError),
    /// One rank was given something that makes no sense, or the ranks were given different things. All
    /// ranks have this error.
    #[error(transparent)]
    Given(RankError),
}

impl InitializeError {
    /// Whether what was given makes no sense, rather than that something could not be done.
    #[must_use]
    pub fn is_mistake(&self) -> bool {
        matches!(
            self,
            Self::Configuration(_) | Self::Orders(_) | Self::Parameter(_) | Self::Given(_)
        )
    }
}

/// A mistake of the solver. Nothing was changed; it may go on and call again.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExecuteError {
    /// Nothing was handed over.
    #[error("cycle {cycle}: no channel was given")]
    NoChannel {
        /// The step.
        cycle: u64,
    },
    /// The channel that orders change was there, and is not any more.
    #[error("cycle {cycle}: {reason}; orders change the shape of that channel")]
    SteeredChannel {
        /// The step.
        cycle: u64,
        /// Which channel, and which there are.
        reason: String,
    },
    /// A time that is none.
    #[error("cycle {cycle}: {what} is {}; it must be finite{}", Number(*value), if *what == "time_step" { " and not below 0" } else { "" })]
    Time {
        /// The step.
        cycle: u64,
        /// `time` or `time_step`.
        what: &'static str,
        /// The value.
        value: f64,
    },
    /// An array, number or name that was lent makes no sense.
    #[error("cycle {cycle}: {source}")]
    Channel {
        /// The step.
        cycle: u64,
        /// Which channel, which array, and what was expected.
        source: ChannelError,
    },
    /// The mesh has the vertices of the first call, and other cells.
    #[error(
        "cycle {cycle}: channel '{channel}' has other cells than the reference mesh of the first call ({found} now, {expected} then); \
         shapes are measured from that mesh, so its cells must stay the same, in their order; a solver that makes another mesh calls release_shape"
    )]
    OtherCells {
        /// The step.
        cycle: u64,
        /// The channel.
        channel: String,
        /// How many there are.
        found: usize,
        /// How many there were.
        expected: usize,
    },
    /// The run goes on from a checkpoint of another mesh.
    #[error(
        "cycle {cycle}: channel '{channel}' is not the mesh of the checkpoint that the run goes on from: {reason}"
    )]
    Restart {
        /// The step.
        cycle: u64,
        /// The channel.
        channel: String,
        /// What is different.
        reason: String,
    },
    /// Something is wrong on one rank. All ranks have this error, that of the lowest rank on which
    /// something is wrong.
    #[error(transparent)]
    Rank(#[from] RankError),
    /// As [`ExecuteError::Rank`], where what is wrong is a mesh or a field that was lent.
    #[error(transparent)]
    Lent(RankError),
    /// The ranks have come to different cycles.
    #[error(
        "the ranks call execute for cycles from {lowest} to {highest}; expected the same cycle on all of them"
    )]
    Cycles {
        /// The lowest.
        lowest: u64,
        /// The highest.
        highest: u64,
    },
    /// The ranks have come to different times.
    #[error(
        "cycle {cycle}: the ranks call execute for times from {earliest} to {latest}; expected the same time on all of them"
    )]
    Times {
        /// The step.
        cycle: u64,
        /// The earliest.
        earliest: f64,
        /// The latest.
        latest: f64,
    },
    /// The mesh is not the one of the first call.
    #[error(
        "cycle {cycle}: channel '{channel}' has {found} vertices, but the reference mesh of the first call had {expected}; \
         shapes are measured from that mesh, so its vertices must stay the same"
    )]
    VertexCount {
        /// The step.
        cycle: u64,
        /// The channel.
        channel: String,
        /// How many there are.
        found: usize,
        /// How many there were.
        expected: usize,
    },
}

impl ExecuteError {
    /// Whether a mesh or a field that was lent makes no sense, rather than the step itself.
    #[must_use]
    pub fn is_of_lent(&self) -> bool {
        matches!(
            self,
            Self::Channel { .. }
                | Self::OtherCells { .. }
                | Self::VertexCount { .. }
                | Self::Lent(_)
        )
    }
}

/// The faults of a run that did not stop it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FinalizeError {
    /// Files that pipelines asked for were not written.
    #[error("{count} file(s) could not be written; the first: {first}")]
    Files {
        /// How many.
        count: usize,
        /// The first of them.
        first: String,
        /// The report of the run.
        report: Box<Report>,
    },
}
