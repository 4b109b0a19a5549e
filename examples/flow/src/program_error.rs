//! Why the program could not do a run.

use std::path::PathBuf;

use tombolo::communicator::RankError;
use tombolo::{ExecuteError, FinalizeError, InitializeError, JournalError};
use tombolo_deform::distributed::DistributedError;
use tombolo_deform::mesh::MeshError;
use tombolo_deform::surface::SurfaceError;
use tombolo_pipelines::files::FileError;
use tombolo_pipelines::language::ReadError;

use crate::SolverError;
use crate::case::CaseError;
use crate::saved::StateError;

/// Why a run could not be done, or ended early.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ProgramError {
    /// The case makes no sense.
    #[error(transparent)]
    Case(#[from] CaseError),
    /// A file cannot be read or written.
    #[error("{}: {source}", file.display())]
    File {
        /// The file.
        file: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// A file of pipelines or orders cannot be read, or makes no sense.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The mesh cannot be read, or the result not written.
    #[error(transparent)]
    Mesh(#[from] FileError),
    /// The mesh has no boundary to speak of.
    #[error(transparent)]
    Surface(#[from] SurfaceError),
    /// The flow cannot be solved.
    #[error(transparent)]
    Solver(#[from] SolverError),
    /// The state of a run cannot be saved or gone on from.
    #[error(transparent)]
    State(#[from] StateError),
    /// The adaptor could not be set up.
    #[error(transparent)]
    Initialize(#[from] InitializeError),
    /// The adaptor was called wrongly.
    #[error(transparent)]
    Execute(#[from] ExecuteError),
    /// The adaptor could not write everything.
    #[error(transparent)]
    Finalize(#[from] FinalizeError),
    /// The journal of the run could not be written.
    #[error(transparent)]
    Journal(#[from] JournalError),
    /// A mesh that is none.
    #[error(transparent)]
    Points(#[from] MeshError),
    /// The mesh cannot be dealt out to the ranks.
    #[error(transparent)]
    Distributed(#[from] DistributedError),
    /// Something is wrong on one rank. All ranks have this error.
    #[error(transparent)]
    Rank(#[from] RankError),
}
