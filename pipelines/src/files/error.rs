//! Why a file was refused.

use std::path::{Path, PathBuf};

use tombolo_deform::mesh::MeshError;

/// Why a file could not be read or written: which file, where in it, and what is wrong there.
#[derive(Debug, thiserror::Error)]
#[error("{}{position}: {problem}", file.display())]
pub struct FileError {
    /// The file.
    pub file: PathBuf,
    /// Where in the file.
    pub position: Position,
    /// The problem.
    #[source]
    pub problem: Box<Problem>,
}

/// A position in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Position {
    /// The file as a whole.
    Whole,
    /// A line of text, counted from 1.
    Line(usize),
    /// A character of a line of text, both counted from 1.
    Column {
        /// The line.
        line: usize,
        /// The character.
        column: usize,
    },
    /// A byte, counted from 0.
    Byte(usize),
}

impl std::fmt::Display for Position {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Position::Whole => Ok(()),
            Position::Line(line) => write!(f, ", line {line}"),
            Position::Column { line, column } => write!(f, ", line {line}, column {column}"),
            Position::Byte(byte) => write!(f, ", byte {byte}"),
        }
    }
}

/// A problem of a file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Problem {
    /// The operating system refused.
    #[error("{0}")]
    System(#[from] std::io::Error),
    /// The name says neither of the formats that are known.
    #[error("the extension '{found}' is not known here; known are {expected}")]
    Extension {
        /// The extension.
        found: String,
        /// The known ones.
        expected: &'static str,
    },
    /// Something else stands where something is needed.
    #[error("found {found} where {expected} is needed")]
    Unexpected {
        /// The thing found.
        found: String,
        /// The thing expected.
        expected: String,
    },
    /// The file ends, or the bytes of an array do, before all was there that it announced.
    #[error("{what} needs {needed} bytes, but only {left} are left")]
    Truncated {
        /// The thing that is cut off.
        what: String,
        /// How many bytes it needs at least.
        needed: u64,
        /// How many there are.
        left: usize,
    },
    /// Two counts that must agree do not.
    #[error("{what}: {found} where there must be {expected}")]
    Count {
        /// The things counted.
        what: String,
        /// The one count.
        found: u64,
        /// The other.
        expected: u64,
    },
    /// Something that the format allows and this reader or writer does not.
    #[error("{what} cannot be used; {instead}")]
    Unsupported {
        /// The thing that cannot be read.
        what: String,
        /// The remedy.
        instead: &'static str,
    },
    /// The file is well formed and its mesh is not.
    #[error("{0}")]
    Mesh(#[from] MeshError),
}

/// A [`FileError`] before it knows its file.
#[derive(Debug)]
pub(super) struct Flaw {
    pub position: Position,
    pub problem: Problem,
}

impl Flaw {
    pub fn in_file(self, file: &Path) -> FileError {
        FileError {
            file: file.to_path_buf(),
            position: self.position,
            problem: Box::new(self.problem),
        }
    }
}

impl<P: Into<Problem>> From<P> for Flaw {
    fn from(problem: P) -> Self {
        Flaw { position: Position::Whole, problem: problem.into() }
    }
}

impl Problem {
    /// Something else than what is needed; long text is cut.
    pub(super) fn unexpected(found: &[u8], expected: impl Into<String>) -> Self {
        const LONGEST: usize = 40;
        let text = String::from_utf8_lossy(found.get(..LONGEST).unwrap_or(found));
        let found = match (found.is_empty(), found.len() > LONGEST) {
            (true, _) => "nothing".to_owned(),
            (false, true) => format!("{text:?}..."),
            (false, false) => format!("{text:?}"),
        };
        Problem::wrong(found, expected)
    }

    /// One thing, described, where another is needed.
    pub(super) fn wrong(found: impl Into<String>, expected: impl Into<String>) -> Self {
        Problem::Unexpected { found: found.into(), expected: expected.into() }
    }

    /// Refuses a count that is not the one that it must be.
    pub(super) fn check_count(
        what: impl Into<String>,
        found: usize,
        expected: usize,
    ) -> Result<(), Self> {
        if found == expected {
            return Ok(());
        }
        Err(Problem::Count { what: what.into(), found: found as u64, expected: expected as u64 })
    }
}
