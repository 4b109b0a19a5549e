//! Harness of the whole-system tests: the programs, built once, run as a user runs them; a small nozzle; a viewer in a few lines.

mod mesh;
mod run;
mod small;
mod viewer;

pub use mesh::{NOZZLE_FEATURES, write_nozzle};
pub use run::{Run, program, programs, tombolo};
pub use small::Small;
pub use viewer::{Link, Message, Viewer};

use std::path::Path;

/// The root of the project.
///
/// # Panics
/// Never: the manifest of this crate lies one level under it.
#[must_use]
pub fn project() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("tests/ lies in the project")
}

/// The programs of the book, run as tests.
#[cfg(doctest)]
mod book {
    #[doc = include_str!("../../docs/instrument-your-solver.md")]
    struct InstrumentYourSolver;
}
