//! The built library, called by a C program as `libcatalyst` would call it.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// The shared library that cargo built beside this test.
fn library() -> PathBuf {
    let mut path = std::env::current_exe().expect("a running test has a path");
    path.set_file_name("libtombolo_catalyst.so");
    path
}

/// Compiles `tests/host.c`; with `exporting`, its Conduit functions can be found by the library.
fn compile(directory: &Path, exporting: bool) -> PathBuf {
    let host = directory.join("host");
    let source = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/host.c");
    let mut compiler = Command::new("cc");
    compiler.args(["-Wall", "-Werror", "-O1", source, "-o"]).arg(&host);
    if exporting {
        compiler.arg("-rdynamic");
    }
    let output = compiler.args(["-ldl", "-lm"]).output().expect("cc is installed (scripts/setup)");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    host
}

fn run(host: &Path) -> (Output, String) {
    let output = Command::new(host).arg(library()).output().expect("the host was just compiled");
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    (output, errors)
}

#[test]
fn a_host_gets_the_documented_answers() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let (output, errors) = run(&compile(directory.path(), true));
    assert!(output.status.success(), "{errors}");
    assert_eq!(errors.matches("mesh channels are not read yet").count(), 1, "told once:\n{errors}");
    for told in [
        "catalyst_execute: 'catalyst' is missing",
        "catalyst_execute: 'catalyst/state/time' is missing",
        "'catalyst/state/time' is NaN; it must be finite",
        "'catalyst/state/cycle' must hold one 32- or 64-bit number, but holds a value of conduit type 13",
        "catalyst_initialize: the conduit node is null",
    ] {
        assert!(errors.contains(told), "'{told}' is not in:\n{errors}");
    }
}

#[test]
fn a_host_without_conduit_is_told_so() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let (output, errors) = run(&compile(directory.path(), false));
    assert!(!output.status.success());
    assert!(errors.contains("does not export 'catalyst_conduit_node_has_path'"), "{errors}");
    assert!(errors.contains("about before initialize: 7 where 0 is expected"), "{errors}");
}
