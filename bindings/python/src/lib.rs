//! Tombolo for Python: the module `tombolo._native`, on which the package `tombolo` rests.
//!
//! The package itself is written in Python (`python/tombolo`), and says what each class does. Here is
//! what only Rust can do: lend NumPy's arrays to the adaptor, decode what a run sends, move meshes.
//! Whatever takes time lets other threads of Python run meanwhile.

mod array;
mod client;
mod error;
mod given;
mod language;
mod lender;
mod motion;
mod run;
mod shaper;

use std::ffi::OsString;

use pyo3::prelude::*;

/// Does what the program `tombolo` does with these arguments, the first of which is its name; returns
/// its exit code.
#[pyfunction]
fn program(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| tombolo::program::run(arguments))
}

#[pymodule(gil_used = false)]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("VERSION", env!("CARGO_PKG_VERSION"))?;
    module.add("DISTRIBUTED", cfg!(feature = "distributed"))?;
    module.add_class::<run::Run>()?;
    module.add_class::<motion::Motion>()?;
    module.add_class::<client::Client>()?;
    module.add_class::<client::Prepared>()?;
    module.add_class::<shaper::Shaper>()?;
    module.add_function(wrap_pyfunction!(program, module)?)?;
    module.add_function(wrap_pyfunction!(lender::lent, module)?)?;
    module.add_function(wrap_pyfunction!(language::check_configuration, module)?)
}
