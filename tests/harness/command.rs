//! Commands that tests run, and the libraries that cargo has built for them.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::project;

/// A library that cargo has built beside the running test.
///
/// # Panics
/// Outside of a program that cargo built.
#[must_use]
pub fn library(name: &str) -> PathBuf {
    let mut path = std::env::current_exe().expect("a running test has a path");
    path.set_file_name(name);
    path
}

/// Runs a command to its end.
///
/// # Panics
/// Where it cannot be started.
#[track_caller]
pub fn output(command: &mut Command) -> Output {
    command.output().unwrap_or_else(|error| {
        panic!("{command:?} does not run ({error}); scripts/setup installs it")
    })
}

/// Runs a command to its end, and gives what it printed and what it complained of.
///
/// # Panics
/// Where it cannot be started, or fails.
#[track_caller]
pub fn succeed(command: &mut Command) -> String {
    let output = output(command);
    let told = format!(
        "{}{}",
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
    assert!(output.status.success(), "{command:?}\n{told}");
    told
}

/// The command that installs the libraries of this build into a prefix.
#[must_use]
pub fn install(prefix: &Path) -> Command {
    let mut install = Command::new(project().join("scripts/install-catalyst"));
    install.arg(prefix).arg("--library").arg(library("libcatalyst.so"));
    install.arg("--tombolo").arg(library("libtombolo_c.so"));
    install.arg("--implementation").arg(library("libtombolo_catalyst.so"));
    install
}
