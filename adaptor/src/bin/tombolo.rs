//! The program `tombolo`: see `tombolo --help`.

use std::process::ExitCode;

fn main() -> ExitCode {
    tombolo::program::run(std::env::args_os()).into()
}
