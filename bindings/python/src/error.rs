//! Errors of Rust as exceptions of Python, with their texts.

use std::panic::{AssertUnwindSafe, catch_unwind};

use pyo3::exceptions::{PyException, PyMemoryError};
use pyo3::prelude::*;
use tombolo::client::ClientError;
use tombolo::foreign::{Kind, RunError};
use tombolo::pipelines::extract::ChannelError;
use tombolo::pipelines::language::LanguageErrors;

mod classes {
    pyo3::import_exception!(tombolo.errors, CallError);
    pyo3::import_exception!(tombolo.errors, ConfigurationError);
    pyo3::import_exception!(tombolo.errors, EndedError);
    pyo3::import_exception!(tombolo.errors, FailedError);
    pyo3::import_exception!(tombolo.errors, LinkError);
    pyo3::import_exception!(tombolo.errors, MeshError);
    pyo3::import_exception!(tombolo.errors, NotDriverError);
    pyo3::import_exception!(tombolo.errors, RejectedError);
    pyo3::import_exception!(tombolo.errors, StepError);
    pyo3::import_exception!(tombolo.errors, WaitError);
}

pub(crate) use classes::*;

const DEFECT: &str = "a defect of tombolo stopped this call; the program may go on";

/// Runs a call so that no panic crosses the border.
pub(crate) fn guarded<T>(call: impl FnOnce() -> PyResult<T>) -> PyResult<T> {
    catch_unwind(AssertUnwindSafe(call)).unwrap_or_else(|_| Err(FailedError::new_err(DEFECT)))
}

pub(crate) fn of_run(error: RunError) -> PyErr {
    let text = error.to_string();
    match error.kind() {
        Kind::Configuration => ConfigurationError::new_err(text),
        Kind::Mesh => MeshError::new_err(text),
        Kind::Step => StepError::new_err(text),
        Kind::Failure => FailedError::new_err(text),
    }
}

/// Why what was given cannot be taken.
#[derive(Debug)]
pub(crate) enum Mistake {
    /// It makes no sense.
    Given(RunError),
    /// Code of the caller's ran for it, and was interrupted or had no memory: no mistake of its own.
    Raised(PyErr),
}

impl From<RunError> for Mistake {
    fn from(error: RunError) -> Self {
        Self::Given(error)
    }
}

impl From<ChannelError> for Mistake {
    fn from(error: ChannelError) -> Self {
        Self::Given(error.into())
    }
}

impl From<Mistake> for PyErr {
    fn from(mistake: Mistake) -> Self {
        match mistake {
            Mistake::Given(error) => of_run(error),
            Mistake::Raised(error) => error,
        }
    }
}

/// What an error of Python's says of an argument, as far as it is of the argument.
pub(crate) fn raised(error: PyErr, mistake: impl FnOnce(&PyErr) -> RunError) -> Mistake {
    let is_of_argument = Python::attach(|py| {
        error.is_instance_of::<PyException>(py) && !error.is_instance_of::<PyMemoryError>(py)
    });
    if is_of_argument { Mistake::Given(mistake(&error)) } else { Mistake::Raised(error) }
}

pub(crate) fn of_language(errors: impl Into<LanguageErrors>) -> PyErr {
    ConfigurationError::new_err(errors.into().to_string())
}

pub(crate) fn of_client(error: ClientError) -> PyErr {
    let text = error.to_string();
    match error {
        ClientError::Closed => EndedError::new_err(text),
        ClientError::NotDriver { .. } => NotDriverError::new_err(text),
        ClientError::Rejected { .. } => RejectedError::new_err(text),
        ClientError::NoAnswer { .. } => WaitError::new_err(text),
        ClientError::TooMuch { .. } | ClientError::System { .. } => FailedError::new_err(text),
        _ => LinkError::new_err(text),
    }
}

/// The mistake of a caller in an argument.
pub(crate) fn argument(
    what: impl ToString,
    found: impl ToString,
    expected: impl ToString,
) -> RunError {
    RunError::Argument {
        what: what.to_string(),
        found: found.to_string(),
        expected: expected.to_string(),
    }
}
