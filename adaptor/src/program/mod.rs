//! The program `tombolo`: see `tombolo --help`.
//!
//! It is in the library so that the package of Python carries it too; `src/bin/tombolo.rs` runs it.

mod check;
mod edit;
mod export;
mod features;
mod mesh;
mod play;
mod relay;
mod remote;
mod skeleton;

use std::{
    ffi::OsString,
    fmt::Display,
    io::Write,
    path::{Path, PathBuf},
};

use crate::pipelines::{language, limits};
use clap::{Parser, Subcommand, error::ErrorKind};

const EXIT_CODES: &str = "Exit codes: 0 done; 1 something is wrong with what was given; 2 the shape that was asked for is refused, or
there is no such task.
The tasks that take a LINK have exit codes of their own; their --help tells them.";

/// Checks configurations, looks at meshes, gives them other shapes without a solver, and watches and
/// steers runs through their links.
#[derive(Debug, Parser)]
#[command(name = "tombolo", version, after_help = EXIT_CODES)]
struct Arguments {
    #[command(subcommand)]
    task: Task,
}

#[derive(Debug, Subcommand)]
enum Task {
    /// Check a configuration or a file of orders: every error goes to the error output with its
    /// file, line and column
    #[command(after_help = check::EXIT_CODES)]
    Check(check::Options),
    /// Print the JSON Schema of configurations
    Schema,
    /// Look at a mesh
    #[command(subcommand)]
    Mesh(MeshTask),
    /// List the features of a mesh, the named parts of its surface that edits move or hold
    Features(features::Options),
    /// Give a mesh another shape; exit code 2 where the order is refused, and nothing is written
    /// then
    Edit(edit::Options),
    /// Find the curve skeleton of a mesh's surface
    Skeleton(skeleton::Options),
    /// Show a recording in the viewer
    Play(play::Options),
    /// Let runs connect here, and viewers reach them through it
    Relay(relay::Options),
    /// Write files of a recording: VTK, CSV, pictures
    Export(export::Options),
    #[command(flatten)]
    Remote(remote::Task),
}

#[derive(Debug, Subcommand)]
enum MeshTask {
    /// Print the counts, bounds, features and quality of a mesh
    Info {
        /// The mesh: .vtu, .vtk, .vtp or .msh
        file: PathBuf,
        /// Print one JSON object
        #[arg(long)]
        json: bool,
    },
}

/// Why a task was not done.
enum Failure {
    /// Something is wrong with what was given: exit code 1.
    Wrong(String),
    /// Something is wrong with what was given, and was said already: exit code 1.
    Reported,
    /// The shape that was asked for is refused: exit code 2.
    Refused(String),
    /// A run is not reached, or a task that would reach it was used wrongly: exit code 2.
    NoConnection(String),
    /// A run is not reached, and it was said already: exit code 2.
    Unreached,
}

impl<E: std::error::Error> From<E> for Failure {
    fn from(error: E) -> Self {
        Failure::Wrong(error.to_string())
    }
}

/// Does what the arguments ask for, the first of which is the name of the program; returns its exit
/// code.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let given: Vec<OsString> = arguments.into_iter().collect();
    if let Some(message) = remote::several(&given) {
        eprintln!("tombolo: {message}");
        return 2;
    }
    let arguments = match Arguments::try_parse_from(&given) {
        Ok(arguments) => arguments,
        Err(asked) => return answer(&asked, given.get(1)),
    };
    let done = match arguments.task {
        Task::Check(options) => check::check(&options),
        Task::Schema => json(&language::config_schema()),
        Task::Mesh(MeshTask::Info { file, json }) => mesh::info(&file, json),
        Task::Features(options) => features::features(&options),
        Task::Edit(options) => edit::edit(&options),
        Task::Skeleton(options) => skeleton::skeleton(&options),
        Task::Play(options) => play::play(&options),
        Task::Relay(options) => relay::relay(&options),
        Task::Export(options) => export::export(&options),
        Task::Remote(task) => remote::run(&task),
    };
    match done {
        Ok(()) => 0,
        Err(Failure::Wrong(message)) => {
            eprintln!("tombolo: {message}");
            1
        }
        Err(Failure::Reported) => 1,
        Err(Failure::Refused(message)) => {
            eprintln!("tombolo: refused: {message}");
            2
        }
        Err(Failure::NoConnection(message)) => {
            eprintln!("tombolo: {message}");
            2
        }
        Err(Failure::Unreached) => 2,
    }
}

/// Prints the help or version that was asked for, or what is wrong with the arguments: 1 then,
/// because 2 says that a shape is refused. Of a task that reaches a run it is 2, and so it is of one that
/// there is not, which may have been meant as such a task.
fn answer(asked: &clap::Error, task: Option<&OsString>) -> u8 {
    let printed = asked.print().is_ok();
    match task.and_then(|task| task.to_str()) {
        _ if printed && asked.exit_code() == 0 => 0,
        Some(task) if remote::has(task) => 2,
        _ if asked.kind() == ErrorKind::InvalidSubcommand => 2,
        _ => 1,
    }
}

/// The text of a file; an error names the file.
fn read(file: &Path) -> Result<String, Failure> {
    Ok(language::read_text(file, limits::DOCUMENT)?)
}

/// Prints one line; a pipe that was closed early is an error, not a panic.
fn say(line: impl Display) -> Result<(), Failure> {
    Ok(writeln!(std::io::stdout(), "{line}")?)
}

fn json(value: &impl serde::Serialize) -> Result<(), Failure> {
    say(serde_json::to_string_pretty(value)?)
}
