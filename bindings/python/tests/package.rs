//! The package in Python: what pytest finds in this folder, the examples of the package's own documentation, and the types.
//!
//! The library that `cargo test` has built is put beside the package's sources, where Python finds it, so that nothing is
//! compiled twice.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;

use tombolo_tests::{library, project, succeed};

/// Puts the library beside the package's sources; returns the folder that they are in.
fn package() -> io::Result<PathBuf> {
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("python");
    // Replaced in one piece: another Python may have it loaded.
    let new = sources.join(format!("tombolo/_native.{:?}", std::thread::current().id()));
    fs::copy(library("lib_native.so"), &new)?;
    fs::rename(new, sources.join("tombolo/_native.abi3.so"))?;
    Ok(sources)
}

#[track_caller]
fn passes(arguments: &[&str]) {
    let package = package().expect("the library lies beside this test");
    let mut python = Command::new(project().join(".venv/bin/python"));
    python.args(["-X", "dev"]).args(arguments).current_dir(env!("CARGO_MANIFEST_DIR"));
    succeed(python.env("PYTHONPATH", package));
}

#[test]
fn the_tests_and_examples_of_the_package_run() {
    passes(&["-m", "pytest", "-q", "--doctest-modules", "tests", "python"]);
}

#[test]
fn the_types_of_the_package_hold() {
    passes(&["-m", "mypy"]);
    // What is said of the library's types is so.
    passes(&["-m", "mypy.stubtest", "tombolo._native"]);
}

#[test]
fn the_sources_of_the_package_are_in_order() {
    let sources = [".", "../../examples", "../../clients"];
    let ruff = |task: &[&str]| {
        let settings = ["--no-cache", "--config", "pyproject.toml"];
        passes(&[&["-m", "ruff"], task, &settings, &sources].concat());
    };
    ruff(&["check"]);
    ruff(&["format", "--check"]);
}
