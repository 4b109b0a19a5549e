//! The package in Python: what pytest finds in this folder, the examples of the package's own documentation, and the types.
//!
//! The library that `cargo test` has built is put beside the package's sources, where Python finds it, so that nothing is
//! compiled twice.

use std::env;
use std::ffi::OsString;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn python() -> PathBuf {
    root().join(".venv/bin/python")
}

/// Puts the library beside the package's sources; returns the folder that they are in.
fn package() -> io::Result<PathBuf> {
    let test = env::current_exe()?;
    let built = test.ancestors().nth(2).ok_or(io::ErrorKind::NotFound)?.join("lib_native.so");
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("python");
    // Replaced in one piece: another Python may have it loaded.
    let (new, place) =
        (sources.join("tombolo/_native.new"), sources.join("tombolo/_native.abi3.so"));
    fs::copy(built, &new)?;
    fs::rename(new, place)?;
    Ok(sources)
}

fn run(arguments: &[&str]) -> io::Result<Output> {
    let mut path = OsString::from(package()?);
    if let Some(others) = env::var_os("PYTHONPATH") {
        path.push(":");
        path.push(others);
    }
    Command::new(python())
        .args(["-X", "dev"])
        .args(arguments)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .env("PYTHONPATH", path)
        .output()
}

#[track_caller]
fn passes(arguments: &[&str]) {
    assert!(python().is_file(), "there is no {}; scripts/setup makes it", python().display());
    let Output { status, stdout, stderr } = run(arguments).expect("Python runs");
    let [stdout, stderr] = [stdout, stderr].map(|text| String::from_utf8_lossy(&text).into_owned());
    assert!(status.success(), "{}\n{stdout}\n{stderr}", arguments.join(" "));
}

#[test]
fn the_package_passes_its_tests_and_its_examples_run() {
    passes(&["-m", "pytest", "-q", "--doctest-modules", "tests", "python"]);
}

#[test]
fn the_types_hold() {
    passes(&["-m", "mypy"]);
}

#[test]
fn the_sources_are_in_order() {
    passes(&["-m", "ruff", "check", "--no-cache", "."]);
    passes(&["-m", "ruff", "format", "--no-cache", "--check", "."]);
}
