//! Harness of the whole-system tests: the programs, built once, run as a user runs them.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

/// The root of the project.
#[must_use]
pub fn project() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("tests/ lies in the project")
}

/// Where cargo puts the programs of this profile; they are built at the first call.
///
/// # Panics
/// Where they do not build.
#[must_use]
pub fn programs() -> &'static Path {
    static PROGRAMS: OnceLock<PathBuf> = OnceLock::new();
    PROGRAMS.get_or_init(|| {
        let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
        let output = Command::new(cargo)
            .current_dir(project())
            .args(["build", "--quiet", "--workspace", "--bins"])
            .output()
            .expect("cargo runs");
        assert!(output.status.success(), "the programs do not build:\n{}", String::from_utf8_lossy(&output.stderr));
        // A test lies in target/debug/deps, the programs in target/debug.
        let test = std::env::current_exe().expect("a running test has a path");
        test.ancestors().nth(2).expect("a test lies in target/debug/deps").to_owned()
    })
}

/// A program by name, ready for arguments, run from the root of the project.
#[must_use]
pub fn program(name: &str) -> Command {
    let mut command = Command::new(programs().join(name));
    command.current_dir(project());
    command
}

/// Runs `tombolo` to its end.
///
/// # Panics
/// Where it cannot be started.
pub fn tombolo<S: AsRef<OsStr>>(arguments: &[S]) -> Output {
    program("tombolo").args(arguments).output().expect("tombolo starts")
}
