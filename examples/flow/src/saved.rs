//! The state of a run in one file: the flow, and the adaptor's checkpoint beside it.

use std::io;
use std::path::{Path, PathBuf};

use tombolo::communicator::{Communicator, RankError, Reader, Writer};
use tombolo::{Checkpoint, CheckpointError};
use tombolo_pipelines::files::write_durably;

use crate::SolverError;
use crate::folder::make_folder_of;
use crate::ranks::agreed;
use crate::solver::Solver;

const MAGIC: &[u8] = b"flow state 2\n";

/// Why a state cannot be written, read or gone on from.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StateError {
    /// The file cannot be read or written.
    #[error("{}: {source}", file.display())]
    File {
        /// The file.
        file: PathBuf,
        /// Why not.
        source: io::Error,
    },
    /// The flow cannot go on from it.
    #[error(transparent)]
    Solver(#[from] SolverError),
    /// The adaptor cannot go on from it.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// Something is wrong on one rank. All ranks have this error.
    #[error(transparent)]
    Rank(#[from] RankError),
}

/// Writes the state of all ranks to a file, which is there whole or not at all. Collective.
pub(crate) fn write(
    communicator: &dyn Communicator,
    file: &Path,
    solver: &Solver,
    checkpoint: &Checkpoint,
) -> Result<(), StateError> {
    let mut mine = Writer::default();
    solver.save(&mut mine);
    mine.bytes(&checkpoint.to_bytes());
    let mut mine = mine.into_bytes();
    mine.extend(crc32fast::hash(&mine).to_le_bytes());
    let all = communicator.gather(0, &mine);
    let written = all.map_or(Ok(()), |all| replace(file, &all));
    let written = written.map_err(|source| StateError::File { file: file.into(), source });
    agreed(communicator, written)
}

fn replace(file: &Path, states: &[Vec<u8>]) -> io::Result<()> {
    make_folder_of(file)?;
    write_durably(file, |out| {
        out.write_all(MAGIC)?;
        for state in states {
            out.write_all(&(state.len() as u64).to_le_bytes())?;
            out.write_all(state)?;
        }
        Ok(())
    })
}

/// This rank's state in a file.
pub(crate) struct State {
    bytes: Vec<u8>,
}

impl State {
    /// Reads the state that this rank has written.
    pub(crate) fn read(file: &Path, rank: usize) -> Result<Self, StateError> {
        let failed = |source| StateError::File { file: file.into(), source };
        let all = std::fs::read(file).map_err(failed)?;
        let other = || {
            failed(io::Error::new(
                io::ErrorKind::InvalidData,
                "this is not the whole state of a run of flow on as many ranks",
            ))
        };
        let mut states = Reader::new(0, all.strip_prefix(MAGIC).ok_or_else(other)?);
        let mut mine = states.bytes();
        for _ in 0..rank {
            mine = states.bytes();
        }
        let (mine, checksum) = mine.map_err(|_| other())?.split_last_chunk().ok_or_else(other)?;
        if crc32fast::hash(mine) != u32::from_le_bytes(*checksum) {
            return Err(failed(io::Error::new(
                io::ErrorKind::InvalidData,
                "the state is damaged: its checksum is another",
            )));
        }
        Ok(Self { bytes: mine.to_vec() })
    }

    /// Lets a solver go on from it; the adaptor's checkpoint. Collective.
    pub(crate) fn restore(
        &self,
        communicator: &dyn Communicator,
        solver: &mut Solver,
    ) -> Result<Checkpoint, StateError> {
        let mut reader = Reader::new(0, &self.bytes);
        solver.restore(&mut reader)?;
        let bytes = reader.bytes().map_err(|_| SolverError::Saved.into());
        let read = bytes.and_then(|bytes| Ok(Checkpoint::from_bytes(bytes)?));
        agreed(communicator, read)
    }
}
