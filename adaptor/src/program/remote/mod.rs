//! The tasks that reach a run: they watch and steer it through its link.

mod doctor;
mod link;
mod order;
mod queue;
mod status;
mod steer;
mod target;
mod watch;

use std::{ffi::OsString, path::Path, time::Duration};

use crate::client::{Client, ClientError, Drives, Event, Options};
use clap::Subcommand;
use serde_json::json;

use crate::program::{Failure, say};

pub(crate) use target::Target;

pub(crate) const EXIT_CODES: &str = "Exit codes: 0 done; 1 refused or failed; 2 wrong use, or no connection (`tombolo doctor LINK` says why).";

/// The names of these tasks, which have exit codes of their own.
const NAMES: [&str; 14] = [
    "status", "watch", "order", "forecast", "undo", "queue", "replace", "pause", "resume", "stop",
    "set", "cancel", "link", "doctor",
];

/// How long the wheel is asked for: longer than a server keeps it for a driver that was lost.
const WHEEL: Duration = Duration::from_secs(8);
/// How long a run may take to answer what its server answers at once, with time to connect again.
pub(crate) const ANSWER: Duration = Duration::from_secs(120);
/// How long a solver that computes is waited for at once.
const WAIT: Duration = Duration::from_secs(3600);
/// Said of an order that the run has taken and the solver has not come to.
const NOT_YET: &str = "taken: it takes effect at the solver's next safe point";

#[derive(Debug, Subcommand)]
pub(crate) enum Task {
    /// Tell how far a run is
    #[command(after_help = EXIT_CODES)]
    Status(Target),
    /// Print what a run tells, as it comes: status, monitors, orders, errors
    #[command(after_help = EXIT_CODES)]
    Watch(watch::Options),
    /// Give a run an order of a new shape
    #[command(after_help = EXIT_CODES)]
    Order(order::Options),
    /// Ask what an order would come to; nothing changes
    #[command(after_help = EXIT_CODES)]
    Forecast(order::ForecastOptions),
    /// Take the last orders back
    #[command(after_help = EXIT_CODES)]
    Undo(order::UndoOptions),
    /// List the orders that wait: why, and since when
    #[command(after_help = EXIT_CODES)]
    Queue(Target),
    /// Put another order in the place of one that has not begun to move the mesh
    #[command(after_help = EXIT_CODES)]
    Replace(order::ReplaceOptions),
    /// Hold the solver at its next safe point
    #[command(after_help = EXIT_CODES)]
    Pause(Target),
    /// Let the solver go on
    #[command(after_help = EXIT_CODES)]
    Resume(Target),
    /// Ask the solver to end
    #[command(after_help = EXIT_CODES)]
    Stop(Target),
    /// Give a parameter of the solver a new value
    #[command(after_help = EXIT_CODES)]
    Set(steer::SetOptions),
    /// Take an order back that has not begun to move the mesh
    #[command(after_help = EXIT_CODES)]
    Cancel(steer::CancelOptions),
    /// Print a link for somebody else: it opens one browser, once
    #[command(after_help = EXIT_CODES)]
    Link(link::Options),
    /// Say why a connection does not work, and what to do about it
    #[command(after_help = EXIT_CODES)]
    Doctor(Target),
}

/// Whether one of these tasks has this name.
pub(crate) fn has(name: &str) -> bool {
    NAMES.contains(&name)
}

/// The error where a task is given several files of links, to which a shell expands `*.link`; `None`
/// where it is not. `arguments` begin with the name of the program.
pub(crate) fn several(arguments: &[OsString]) -> Option<String> {
    let (task, rest) = arguments.get(1..)?.split_first()?;
    if !task.to_str().is_some_and(has) {
        return None;
    }
    let is_file =
        |path: &&Path| path.extension().is_some_and(|end| end == "link") && path.is_file();
    let files: Vec<_> = rest.iter().map(Path::new).filter(is_file).map(Path::display).collect();
    let names = files.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
    (files.len() > 1).then(|| {
        format!(
            "found {} files of links ({names}), expected one; each run has its own, and one that was killed leaves it behind: \
             `tombolo doctor FILE` says whether its run answers",
            files.len()
        )
    })
}

pub(crate) fn run(task: &Task) -> Result<(), Failure> {
    let (done, as_json) = match task {
        Task::Status(target) => (status::status(target), target.json),
        Task::Watch(options) => (watch::watch(options), options.target.json),
        Task::Order(options) => (order::order(options), options.target.json),
        Task::Forecast(options) => (order::forecast(options), options.target.json),
        Task::Undo(options) => (order::undo(options), options.target.json),
        Task::Queue(target) => (queue::queue(target), target.json),
        Task::Replace(options) => (order::replace(options), options.target.json),
        Task::Pause(target) => (steer::pause(target), target.json),
        Task::Resume(target) => (steer::resume(target), target.json),
        Task::Stop(target) => (steer::stop(target), target.json),
        Task::Set(options) => (steer::set(options), options.target.json),
        Task::Cancel(options) => (steer::cancel(options), options.target.json),
        Task::Link(options) => (link::link(options), options.target.json),
        Task::Doctor(target) => (doctor::doctor(target), target.json),
    };
    if let (Err(Failure::Wrong(message) | Failure::NoConnection(message)), true) = (&done, as_json)
    {
        say(json!({"error": {"message": message}}))?;
    }
    done
}

/// The program's failure for an error of the client.
pub(crate) fn failed(error: ClientError) -> Failure {
    match error {
        ClientError::Closed
        | ClientError::Rejected { .. }
        | ClientError::NotDriver { .. }
        | ClientError::NoAnswer { .. }
        | ClientError::Answer { .. }
        | ClientError::TooMuch { .. } => Failure::Wrong(error.to_string()),
        error => Failure::NoConnection(error.to_string()),
    }
}

pub(crate) fn connect(target: &Target, drives: Drives) -> Result<Client, Failure> {
    let link = target.link().map_err(|error| Failure::NoConnection(error.to_string()))?;
    Client::connect(&link, &Options { drives, ..Options::default() }).map_err(failed)
}

/// Connects and takes the wheel.
pub(crate) fn steer(target: &Target) -> Result<Client, Failure> {
    let client = connect(target, Drives::OnRequest)?;
    client.drive(WHEEL).map_err(failed)?;
    Ok(client)
}

/// An error that answers a command.
fn refused(event: &Event, id: &str) -> Result<(), Failure> {
    match event {
        Event::Error(error) if error.id.as_deref() == Some(id) => {
            Err(Failure::Wrong(error.message.clone()))
        }
        _ => Ok(()),
    }
}
