//! What can be wrong with a call of a solver in another language.

use tombolo_deform::mesh::MeshError;
use tombolo_pipelines::extract::ChannelError;
use tombolo_pipelines::language::{LanguageErrors, ReadError};

use crate::{CheckpointError, ExecuteError, FinalizeError, InitializeError, ParameterError};

/// The subject of an error, by which a binding chooses its class.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A configuration, orders, a parameter or a condition.
    Configuration,
    /// A mesh or a field.
    Mesh,
    /// A step.
    Step,
    /// Something that could not be done.
    Failure,
}

/// Why a run did not begin, or a call of it was refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RunError {
    /// A path that is needed is not there.
    #[error("'{path}' is missing; expected {expected}")]
    Missing {
        /// The path.
        path: String,
        /// The content that is needed there.
        expected: &'static str,
    },
    /// A path holds something else than is needed.
    #[error("'{path}': found {found}; expected {expected}")]
    Wrong {
        /// The path.
        path: String,
        /// The content that was found.
        found: String,
        /// The content that is needed.
        expected: String,
    },
    /// Cells are wrong.
    #[error("{place}: {source}")]
    Cells {
        /// The path of their node, or words for them.
        place: String,
        /// The mistake in them.
        source: MeshError,
    },
    /// An argument, or an array that was named, makes no sense.
    #[error("{what}: found {found}; expected {expected}")]
    Argument {
        /// The name of the argument.
        what: String,
        /// Its value.
        found: String,
        /// The values that it can have.
        expected: String,
    },
    /// A number of the step makes no sense.
    #[error("{what}: found {found}; expected {expected}")]
    Step {
        /// `cycle`, `time` or `time_step`.
        what: &'static str,
        /// Its value.
        found: String,
        /// The values that it can have.
        expected: &'static str,
    },
    /// The configuration cannot be read.
    #[error("{0}")]
    Configuration(String),
    /// A parameter that is declared makes no sense.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// Another rank cannot go on.
    #[error("rank {rank}: {message}")]
    Rank {
        /// The lowest rank with an error.
        rank: usize,
        /// Its error.
        message: String,
        /// The kind of its error.
        kind: Kind,
        /// Whether [`RunError::is_failure`] of its error.
        is_failure: bool,
    },
    /// Ranks are at the end of the run, and others are not.
    #[error("the run was ended on other ranks; expected the same call on all")]
    Ending,
    /// The solver has failed on this rank.
    #[error("the solver has failed: {0}")]
    Left(String),
    /// Ranks let different pipelines run.
    #[error(
        "the pipelines that are to run: found other names on other ranks; expected the same on all"
    )]
    Choices,
    /// The adaptor could not be set up.
    #[error(transparent)]
    Initialize(#[from] InitializeError),
    /// The state of the run could not be saved.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// A channel's arrays do not fit together.
    #[error(transparent)]
    Channel(#[from] ChannelError),
    /// The adaptor refused a step.
    #[error(transparent)]
    Execute(#[from] ExecuteError),
    /// Something was not written.
    #[error(transparent)]
    Finalize(#[from] FinalizeError),
    /// The report of the run was not written.
    #[error("the report {file}: {source}")]
    Report {
        /// Its file.
        file: String,
        /// The reason.
        source: std::io::Error,
    },
}

impl From<LanguageErrors> for RunError {
    fn from(errors: LanguageErrors) -> Self {
        Self::Configuration(errors.to_string())
    }
}

impl From<ReadError> for RunError {
    fn from(error: ReadError) -> Self {
        Self::Configuration(error.to_string())
    }
}

impl RunError {
    /// The error that a path holds something else than is needed.
    #[must_use]
    pub fn wrong(path: impl ToString, found: impl ToString, expected: impl ToString) -> Self {
        Self::Wrong {
            path: path.to_string(),
            found: found.to_string(),
            expected: expected.to_string(),
        }
    }

    /// The subject of the error, the same on all ranks.
    #[must_use]
    pub fn kind(&self) -> Kind {
        match self {
            RunError::Rank { kind, .. } => *kind,
            RunError::Configuration(_) | RunError::Parameter(_) => Kind::Configuration,
            RunError::Initialize(error) if error.is_mistake() => Kind::Configuration,
            RunError::Execute(error) if error.is_of_lent() => Kind::Mesh,
            RunError::Step { .. } | RunError::Execute(_) | RunError::Choices | RunError::Ending => {
                Kind::Step
            }
            error if error.is_failure() => Kind::Failure,
            _ => Kind::Mesh,
        }
    }

    /// Whether the run could not do what it was told, rather than was given what makes no sense.
    #[must_use]
    pub fn is_failure(&self) -> bool {
        match self {
            RunError::Rank { is_failure, .. } => *is_failure,
            RunError::Initialize(_)
            | RunError::Finalize(_)
            | RunError::Checkpoint(_)
            | RunError::Report { .. }
            | RunError::Left(_) => true,
            _ => false,
        }
    }
}
