//! The journal: every command of a run and what became of it, and every shape that the solver was
//! handed, one JSON object a line.
//!
//! A journal replays: [`Settings::replay`](crate::Settings::replay) carries its newest run out
//! again, each shape at its cycle. A thread of its own writes it, so that neither the solver nor the
//! stream waits for a disk.

mod store;
mod writer;

use std::{io, path::PathBuf};

pub(crate) use writer::Journal;

/// Why the journal cannot be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum JournalError {
    /// The file cannot be opened or written.
    #[error("the journal {} cannot be written: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// Another run writes to the file.
    #[error(
        "the journal {} is being written by another run; expected a file of this run's own",
        path.display()
    )]
    InUse {
        /// The file.
        path: PathBuf,
    },
    /// The file holds something else.
    #[error(
        "the journal {} holds something else; expected an empty file, none, or the journal of an earlier run, which this \
         one goes on below",
        path.display()
    )]
    OtherFile {
        /// The file.
        path: PathBuf,
    },
    /// The thread that writes could not be started.
    #[error("the thread that writes the journal could not be started: {0}")]
    Thread(io::Error),
}
