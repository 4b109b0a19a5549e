//! What can be wrong with a call, and the status that says so.

use tombolo::pipelines::extract::ChannelError;
use tombolo::{ExecuteError, FinalizeError, InitializeError};

/// What a call answers: Catalyst's own statuses, and above 99 those of this implementation (100 to 102 as ParaView uses them).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
#[non_exhaustive]
pub enum Status {
    /// Done.
    Ok = 0,
    /// The call came before `initialize` or after `finalize`.
    NoImplementation = 1,
    /// The process exports no `catalyst_conduit_*` functions that could read or fill its nodes.
    ConduitMismatch = 7,
    /// The node is null, lacks something that is needed, or holds what it should not.
    InvalidNode = 100,
    /// The results could not be filled in.
    Results = 101,
    /// The adaptor could not be set up, a file could not be written, or the call met a defect of this library; the solver may
    /// go on.
    Failed = 102,
}

/// Why a call did not answer [`Status::Ok`].
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CatalystError {
    /// The node pointer is null.
    #[error("the conduit node is null")]
    NullNode,
    /// The call came before `initialize` or after `finalize`.
    #[error("called outside of catalyst_initialize ... catalyst_finalize")]
    NotInitialized,
    /// The host exports no usable Conduit.
    #[error(
        "this process does not export '{symbol}'; the solver must be linked with libcatalyst (2.0 or newer)"
    )]
    MissingSymbol {
        /// The first function that was not found.
        symbol: &'static str,
    },
    /// A path that is needed is not there.
    #[error("'{path}' is missing; expected {expected}")]
    Missing {
        /// The path.
        path: String,
        /// What should stand there.
        expected: &'static str,
    },
    /// A path holds something else than is needed.
    #[error("'{path}': found {found}; expected {expected}")]
    Wrong {
        /// The path.
        path: String,
        /// What stands there.
        found: String,
        /// What should.
        expected: String,
    },
    /// An argument, or an array that was named, makes no sense.
    #[error("{what}: found {found}; expected {expected}")]
    Argument {
        /// What is wrong.
        what: String,
        /// What it is.
        found: String,
        /// What it should be.
        expected: String,
    },
    /// The configuration cannot be read.
    #[error("{0}")]
    Configuration(String),
    /// Another rank cannot go on.
    #[error("rank {rank}: {message}")]
    Rank {
        /// The lowest rank with an error.
        rank: usize,
        /// Its error.
        message: String,
        /// Its status.
        status: Status,
    },
    /// Ranks let different pipelines run.
    #[error(
        "'catalyst/state/pipelines': found other names on other ranks; expected the same on all"
    )]
    Choices,
    /// The adaptor could not be set up.
    #[error(transparent)]
    Initialize(#[from] InitializeError),
    /// A channel's arrays do not fit together.
    #[error(transparent)]
    Channel(#[from] ChannelError),
    /// The adaptor refused a step.
    #[error(transparent)]
    Execute(#[from] ExecuteError),
    /// Something was not written.
    #[error(transparent)]
    Finalize(#[from] FinalizeError),
}

impl CatalystError {
    /// The status that says this to the host.
    #[must_use]
    pub fn status(&self) -> Status {
        match self {
            CatalystError::NotInitialized => Status::NoImplementation,
            CatalystError::MissingSymbol { .. } => Status::ConduitMismatch,
            CatalystError::Rank { status, .. } => *status,
            CatalystError::Initialize(_) | CatalystError::Finalize(_) => Status::Failed,
            _ => Status::InvalidNode,
        }
    }
}
