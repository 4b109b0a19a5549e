//! From text to checked values.

use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;

use super::LanguageErrors;
use super::error::{LanguageError, Problem, error, from_serde};
use super::scan::{Node, scan};
use crate::limits::{DOCUMENT, Limit};

/// Values that can be well-formed and still mean nothing.
pub trait Validate {
    /// Finds the first thing that means nothing.
    ///
    /// # Errors
    /// A [`Problem`] with the way to it.
    fn validate(&self) -> Result<(), Problem>;

    /// Finds everything that means nothing; unless it is told otherwise, the first thing alone.
    fn problems(&self) -> Vec<Problem> {
        self.validate().err().into_iter().collect()
    }
}

/// Bytes as text, which must be UTF-8.
///
/// # Errors
/// A [`LanguageError`] at the first byte that is not.
pub fn text<'a>(bytes: &'a [u8], file: &str) -> Result<&'a str, LanguageError> {
    std::str::from_utf8(bytes).map_err(|failure| {
        let valid = String::from_utf8_lossy(&bytes[..failure.valid_up_to()]);
        let byte = bytes.get(failure.valid_up_to()).copied().unwrap_or_default();
        let message = format!("found the byte 0x{byte:02x}, expected UTF-8 text");
        error(&valid, file, valid.len(), String::new(), message, None)
    })
}

/// Why a file could not be read as text.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// It cannot be read.
    #[error("{}: {source}", file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// It is no text, or too long, or does not say what it should: all errors that it has.
    #[error(transparent)]
    Text(#[from] LanguageErrors),
}

impl From<LanguageError> for ReadError {
    fn from(error: LanguageError) -> Self {
        ReadError::Text(error.into())
    }
}

/// Reads the text of a file of at most so many bytes: [`DOCUMENT`], or of orders
/// [`WAITING_BYTES`](crate::limits::WAITING_BYTES).
///
/// # Errors
/// [`ReadError`], which names the file. No more than the limit is read of it.
pub fn read_text(file: &Path, limit: Limit) -> Result<String, ReadError> {
    let unreadable = |source| ReadError::Unreadable { file: file.into(), source };
    let opened = File::open(file).map_err(unreadable)?;
    let stated = opened.metadata().map_err(unreadable)?.len();
    let mut bytes = Vec::new();
    if stated <= limit.most as u64 {
        opened.take(limit.most as u64 + 1).read_to_end(&mut bytes).map_err(unreadable)?;
    }
    let name = file.display().to_string();
    check_length(usize::try_from(stated).unwrap_or(usize::MAX).max(bytes.len()), &name, limit)?;
    text(&bytes, &name)?;
    // Looked at above; nothing is copied here.
    Ok(String::from_utf8(bytes).unwrap_or_default())
}

/// Refuses a text that is too long.
pub(super) fn check_length(found: usize, file: &str, limit: Limit) -> Result<(), LanguageError> {
    limit
        .check(found)
        .map_err(|exceeded| error("", file, 0, String::new(), exceeded.to_string(), None))
}

/// Reads one value of any type from JSON.
///
/// Stricter than serde_json: no key may stand twice in an object, an array is never taken for a
/// struct, every number must be finite in double precision, and the document must keep to the
/// [limits](crate::limits).
///
/// # Errors
/// A [`LanguageError`] whose line and column are those of the token at fault.
///
/// # Example
/// ```
/// use tombolo_pipelines::language::parse_json;
///
/// #[derive(serde::Deserialize, Debug)]
/// #[serde(deny_unknown_fields)]
/// struct Fluid { density: f64, viscosity: f64 }
///
/// let failure = parse_json::<Fluid>(r#"{"density": 1.0, "viscocity": 0.1}"#, "case.json").unwrap_err();
/// assert_eq!((failure.line, failure.column), (1, 18));
/// assert_eq!(failure.suggestion.as_deref(), Some("viscosity"));
/// ```
pub fn parse_json<T: DeserializeOwned>(text: &str, file: &str) -> Result<T, LanguageError> {
    Document::read(text, file)?.value()
}

/// Reads one value and checks its meaning.
///
/// # Errors
/// As [`parse_json`]; the first [`Problem`] at its position in the text.
pub fn parse_valid<T: DeserializeOwned + Validate>(
    text: &str,
    file: &str,
) -> Result<T, LanguageError> {
    Document::read(text, file)?.valid()
}

/// A problem that was found after reading, at its token in the text that was read.
#[must_use]
pub fn locate(problem: Problem, text: &str, file: &str) -> LanguageError {
    match Document::read(text, file) {
        Ok(document) => document.locate(problem),
        Err(error) => error,
    }
}

/// A JSON text that was read, and is still to be taken for something.
pub(super) struct Document<'a> {
    pub(super) root: Node,
    pub(super) text: &'a str,
    pub(super) file: &'a str,
}

impl<'a> Document<'a> {
    pub(super) fn read(text: &'a str, file: &'a str) -> Result<Self, LanguageError> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        check_length(text.len(), file, DOCUMENT)?;
        let root = scan(text)
            .map_err(|syntax| error(text, file, syntax.at, syntax.path, syntax.message, None))?;
        Ok(Self { root, text, file })
    }

    pub(super) fn value<T: DeserializeOwned>(&self) -> Result<T, LanguageError> {
        serde_path_to_error::deserialize(&self.root)
            .map_err(|failure| from_serde(&failure, &self.root, self.text, self.file))
    }

    pub(super) fn locate(&self, problem: Problem) -> LanguageError {
        problem.locate(&self.root, self.text, self.file)
    }

    pub(super) fn valid<T: DeserializeOwned + Validate>(&self) -> Result<T, LanguageError> {
        let value: T = self.value()?;
        value.validate().map_err(|problem| self.locate(problem))?;
        Ok(value)
    }
}
