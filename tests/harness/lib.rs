//! Harness of the whole-system tests: the programs, built once, run as a user runs them; a small nozzle; a viewer in a few
//! lines; programs over CGAL.

mod cgal;
mod generated;
mod mesh;
mod run;
mod small;
mod viewer;

pub use cgal::{cgal, cgal_program, off};
pub use generated::generated_surfaces;
pub use mesh::{NOZZLE_FEATURES, write_nozzle};
pub use run::{Run, program, programs, tombolo};
pub use small::Small;
pub use viewer::{Link, Message, Viewer};

use std::path::{Path, PathBuf};

/// The root of the project.
///
/// # Panics
/// Never: the manifest of this crate lies one level under it.
#[must_use]
pub fn project() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("tests/ lies in the project")
}

/// The directory that cargo builds in, for what tests make once and keep.
///
/// # Panics
/// Outside of a test that cargo built.
#[must_use]
pub fn target() -> PathBuf {
    // A test lies in target/debug/deps.
    let test = std::env::current_exe().expect("a running test has a path");
    test.ancestors().nth(3).expect("a test lies in target/debug/deps").to_owned()
}

/// The programs of the book, run as tests.
#[cfg(doctest)]
mod book {
    #[doc = include_str!("../../docs/instrument-your-solver.md")]
    struct InstrumentYourSolver;
}
