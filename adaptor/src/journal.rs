//! The journal: every command of a run and what became of it, one JSON object a line, each line
//! flushed.
//!
//! A journal is a valid file of orders: given to another run of the same solver it replays this
//! one. The commands of pipelines stand in it without their text, because a replay's own pipelines
//! will give them again.

use std::{
    fs::File,
    io::{self, Write},
    path::{Path, PathBuf},
    sync::Mutex,
};

use tombolo_pipelines::language::JournalEntry;

use crate::lock::lock;

/// Why the journal cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("the journal {} cannot be written: {source}", path.display())]
pub struct JournalError {
    path: PathBuf,
    source: io::Error,
}

/// A journal being written, or none.
pub(crate) struct Journal {
    file: Mutex<Option<(PathBuf, File)>>,
}

impl Journal {
    /// No journal: every line is let go.
    pub(crate) fn none() -> Self {
        Self { file: Mutex::new(None) }
    }

    /// Starts a journal, and the directory for it where there is none; one of the same name is
    /// replaced.
    pub(crate) fn create(path: &Path) -> Result<Self, JournalError> {
        let directory = path.parent().unwrap_or(Path::new(""));
        let made =
            if directory == Path::new("") { Ok(()) } else { std::fs::create_dir_all(directory) };
        let file = made
            .and_then(|()| File::create(path))
            .map_err(|source| JournalError { path: path.into(), source })?;
        Ok(Self { file: Mutex::new(Some((path.into(), file))) })
    }

    /// Writes one line.
    ///
    /// # Errors
    /// Where the line could not be written; no further one will be tried, so that no line stands
    /// after a torn one.
    pub(crate) fn write(&self, entry: &JournalEntry) -> Result<(), JournalError> {
        let mut guard = lock(&self.file);
        let Some((path, file)) = guard.as_mut() else { return Ok(()) };
        let written = serde_json::to_vec(entry).map_err(io::Error::other).and_then(|mut line| {
            line.push(b'\n');
            // One call for the whole line: a killed run tears at most the last one.
            file.write_all(&line)?;
            file.flush()
        });
        let Err(source) = written else { return Ok(()) };
        let path = path.clone();
        *guard = None;
        Err(JournalError { path, source })
    }
}
