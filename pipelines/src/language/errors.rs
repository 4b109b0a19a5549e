//! All errors of a text, or of a configuration, at once.

use std::fmt::{self, Display};

use super::{LanguageError, Problem};
use crate::limits::ERRORS;

/// All errors of a JSON text, at least one, in the order of the text.
///
/// Shown, each has a line of its own. Of very many only the first stay, as many as
/// [`ERRORS`] says; how many more there were is told behind them.
///
/// ```
/// use tombolo_pipelines::language::check;
///
/// let errors = check(
///     r#"{"version": 2, "pipelines": [
///         {"name": "mid", "stages": [{"slice": {"origin": [0, 0, 0], "nromal": [1, 0, 0]}}]}]}"#,
///     "views.json",
/// )
/// .unwrap_err();
/// assert_eq!(
///     errors.to_string(),
///     "views.json:1:13: version: found version 2, expected 1\n\
///      views.json:2:68: pipelines[0].stages[0].slice.nromal: found the unknown key `nromal`, \
///      expected `origin`, `normal`, `planes`, `cylinder` or `sphere`; did you mean `normal`?"
/// );
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LanguageErrors {
    first: Box<LanguageError>,
    others: Vec<LanguageError>,
    more: usize,
}

impl LanguageErrors {
    /// The errors that are told, and how many more there are; `None` where there are none.
    pub(super) fn new(told: Vec<LanguageError>, more: usize) -> Option<Self> {
        let mut told = told.into_iter();
        let first = Box::new(told.next()?);
        Some(Self { first, others: told.collect(), more })
    }

    /// Adds errors that stand behind these.
    pub(super) fn append(&mut self, other: Self) {
        self.more += other.more;
        for error in std::iter::once(*other.first).chain(other.others) {
            if 1 + self.others.len() < ERRORS.most {
                self.others.push(error);
            } else {
                self.more += 1;
            }
        }
    }

    /// Moves the errors so many lines down.
    pub(super) fn moved(mut self, lines: usize) -> Self {
        self.first.line += lines;
        self.others.iter_mut().for_each(|error| error.line += lines);
        self
    }

    /// The first error.
    #[must_use]
    pub fn first(&self) -> &LanguageError {
        &self.first
    }

    /// The first error alone.
    #[must_use]
    pub fn into_first(self) -> LanguageError {
        *self.first
    }

    /// The errors that are told, in the order of the text.
    pub fn iter(&self) -> impl Iterator<Item = &LanguageError> {
        std::iter::once(&*self.first).chain(&self.others)
    }

    /// How many errors there are.
    #[must_use]
    pub fn count(&self) -> usize {
        1 + self.others.len() + self.more
    }

    /// How many errors there are besides those that are told.
    #[must_use]
    pub fn more(&self) -> usize {
        self.more
    }
}

impl From<LanguageError> for LanguageErrors {
    fn from(first: LanguageError) -> Self {
        Self { first: Box::new(first), others: Vec::new(), more: 0 }
    }
}

impl Display for LanguageErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        show(f, self.iter(), self.more)
    }
}

impl std::error::Error for LanguageErrors {}

/// All problems of a value, at least one.
///
/// Shown, each has a line of its own, up to as many as [`ERRORS`] says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Problems {
    first: Box<Problem>,
    others: Vec<Problem>,
}

impl Problems {
    /// The problems in their order.
    ///
    /// # Errors
    /// The problems, where there are any.
    pub fn none(problems: Vec<Problem>) -> Result<(), Self> {
        let mut problems = problems.into_iter();
        match problems.next() {
            None => Ok(()),
            Some(first) => Err(Self { first: first.into(), others: problems.collect() }),
        }
    }

    /// The first problem alone.
    #[must_use]
    pub fn into_first(self) -> Problem {
        *self.first
    }

    /// The problems in their order.
    pub fn iter(&self) -> impl Iterator<Item = &Problem> {
        std::iter::once(&*self.first).chain(&self.others)
    }
}

impl From<Problem> for Problems {
    fn from(first: Problem) -> Self {
        Self { first: first.into(), others: Vec::new() }
    }
}

impl Display for Problems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let more = (1 + self.others.len()).saturating_sub(ERRORS.most);
        show(f, self.iter().take(ERRORS.most), more)
    }
}

impl std::error::Error for Problems {}

/// Shows errors line by line, and how many more there are.
fn show<T: Display>(
    f: &mut fmt::Formatter<'_>,
    errors: impl Iterator<Item = T>,
    more: usize,
) -> fmt::Result {
    for (index, error) in errors.enumerate() {
        if index > 0 {
            f.write_str("\n")?;
        }
        write!(f, "{error}")?;
    }
    match more {
        0 => Ok(()),
        more => write!(f, "\nand {more} more"),
    }
}
