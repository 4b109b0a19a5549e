//! Harness of the whole-system tests: the programs, built once, run as a user runs them; a small
//! nozzle; a viewer in a few lines; programs over CGAL.

mod cgal;
mod command;
mod curves;
mod generated;
mod mesh;
mod proxy;
mod run;
mod small;
mod viewer;

pub use cgal::{cgal, cgal_program, off};
pub use command::{install, library, output, succeed};
pub use curves::CurveGraph;
pub use generated::{generated_mesh, generated_surfaces};
pub use mesh::{NOZZLE_FEATURES, write_nozzle};
pub use proxy::{Proxy, free_ports};
pub use run::{Run, program, programs, tombolo};
pub use small::{Small, pinch};
pub use viewer::{Link, Message, Viewer, driving};

use std::path::{Path, PathBuf};
use std::time::Duration;

/// How long a test waits for what should come: so long that only what never comes is missed, on
/// however busy a machine.
pub const PATIENCE: Duration = Duration::from_secs(900);

/// The root of the project.
///
/// # Panics
/// Never: the manifest of this crate lies one level under it.
#[must_use]
pub fn project() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("tests/ lies in the project")
}

/// The directory that cargo builds in, for what tests and benchmarks make once and keep.
///
/// # Panics
/// Outside of a program that cargo built.
#[must_use]
pub fn target() -> PathBuf {
    let program = std::env::current_exe().expect("a running program has a path");
    // A test lies in target/debug/deps, a benchmark in target/release.
    let profile = program.ancestors().skip(1).find(|directory| !directory.ends_with("deps"));
    profile
        .and_then(Path::parent)
        .expect("a program lies in target/debug or target/release")
        .to_owned()
}

/// The programs of the book, run as tests.
#[cfg(doctest)]
mod book {
    #[doc = include_str!("../../docs/instrument-your-solver.md")]
    struct InstrumentYourSolver;
}

/// Where a test leaves a picture of `docs/gallery.md`, for `scripts/pictures gallery`.
///
/// # Panics
/// Where the folder cannot be made.
#[must_use]
pub fn gallery(picture: &str) -> PathBuf {
    let folder = target().join("gallery");
    std::fs::create_dir_all(&folder).expect("the target directory can be written");
    folder.join(picture)
}
