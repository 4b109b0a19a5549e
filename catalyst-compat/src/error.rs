//! What can be wrong with a call of Catalyst's, and the status that says so.

use tombolo::foreign::RunError;

/// The answer of a call: Catalyst's own statuses, and above 99 those of this implementation (100 to
/// 102 as ParaView uses them).
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
    /// The adaptor could not be set up, a file could not be written, or the call met a defect of
    /// this library; the solver may go on.
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
    /// A node that makes no sense, or asks for what cannot be done.
    #[error(transparent)]
    Run(#[from] RunError),
}

impl CatalystError {
    /// The status that says this to the host.
    #[must_use]
    pub fn status(&self) -> Status {
        match self {
            CatalystError::NotInitialized => Status::NoImplementation,
            CatalystError::MissingSymbol { .. } => Status::ConduitMismatch,
            CatalystError::Run(error) if error.is_failure() => Status::Failed,
            CatalystError::NullNode | CatalystError::Run(_) => Status::InvalidNode,
        }
    }
}
