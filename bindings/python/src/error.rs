//! Errors of Rust as exceptions of Python, with their texts.

use std::panic::{AssertUnwindSafe, catch_unwind};

use pyo3::prelude::*;
use tombolo::client::ClientError;
use tombolo::foreign::RunError;
use tombolo::{ExecuteError, InitializeError, pipelines::language::LanguageErrors};

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
}

pub(crate) use classes::*;

const DEFECT: &str = "a defect of tombolo stopped this call; the program may go on";

/// Runs a call so that no panic crosses the border.
pub(crate) fn guarded<T>(call: impl FnOnce() -> PyResult<T>) -> PyResult<T> {
    catch_unwind(AssertUnwindSafe(call)).unwrap_or_else(|_| Err(FailedError::new_err(DEFECT)))
}

pub(crate) fn of_run(error: RunError) -> PyErr {
    let text = error.to_string();
    match error {
        RunError::Configuration(_)
        | RunError::Initialize(
            InitializeError::Configuration(_)
            | InitializeError::Orders(_)
            | InitializeError::Parameter(_),
        ) => ConfigurationError::new_err(text),
        RunError::Execute(
            ExecuteError::Channel { .. }
            | ExecuteError::OtherCells { .. }
            | ExecuteError::VertexCount { .. },
        ) => MeshError::new_err(text),
        RunError::Execute(_) | RunError::Choices => StepError::new_err(text),
        error if error.is_failure() => FailedError::new_err(text),
        _ => MeshError::new_err(text),
    }
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
