//! The program `tombolo`.

use std::{
    path::Path,
    process::{Command, Output},
};

/// Runs a task in a directory: its exit code, what it printed, and both streams apart.
pub fn tombolo(directory: &Path, arguments: &[&str]) -> (i32, String, Output) {
    let output = Command::new(env!("CARGO_BIN_EXE_tombolo"))
        .args(arguments)
        .current_dir(directory)
        .output()
        .expect("runs");
    let said = String::from_utf8_lossy(&output.stdout).into_owned()
        + &String::from_utf8_lossy(&output.stderr);
    (output.status.code().expect("a code"), said, output)
}
