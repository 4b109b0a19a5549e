//! Harness of the whole-system tests: the programs, built once, run as a user runs them; a small nozzle; a viewer in a few lines.

mod mesh;
mod run;
mod viewer;

pub use mesh::{NOZZLE_FEATURES, write_nozzle};
pub use run::{Run, program, programs, tombolo};
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
