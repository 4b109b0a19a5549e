//! `tombolo pause`, `tombolo resume`, `tombolo stop`, `tombolo set` and `tombolo cancel`.

use crate::{
    client::{Client, ClientError, Event},
    pipelines::language::{Cancel, Command, Parameter},
};
use clap::Args;
use serde_json::json;

use super::{Target, WAIT, failed, refused, steer};
use crate::program::{Failure, say};

#[derive(Debug, Args)]
pub(crate) struct SetOptions {
    #[command(flatten)]
    pub(super) target: Target,
    /// The parameter's name
    name: String,
    /// Its new value, within its bounds
    #[arg(allow_negative_numbers = true)]
    value: f64,
}

#[derive(Debug, Args)]
pub(crate) struct CancelOptions {
    #[command(flatten)]
    pub(super) target: Target,
    /// The id of the order, as `tombolo status` and `tombolo order` tell it
    order: String,
}

pub(crate) fn pause(target: &Target) -> Result<(), Failure> {
    give(target, &Command::Pause {}, "paused")
}

pub(crate) fn resume(target: &Target) -> Result<(), Failure> {
    give(target, &Command::Resume {}, "resumed")
}

pub(crate) fn stop(target: &Target) -> Result<(), Failure> {
    give(target, &Command::Stop {}, "stopped")
}

pub(crate) fn set(options: &SetOptions) -> Result<(), Failure> {
    let SetOptions { target, name, value } = options;
    if !value.is_finite() {
        return Err(Failure::NoConnection(format!("found the value {value}, expected a number")));
    }
    let parameter = Parameter { name: name.clone(), value: *value };
    give(target, &Command::Parameter(parameter), "set")
}

pub(crate) fn cancel(options: &CancelOptions) -> Result<(), Failure> {
    let cancel = Cancel { order: options.order.clone() };
    give(&options.target, &Command::Cancel(cancel), "cancelled")
}

/// Sends a command and waits until it has taken effect.
fn give(target: &Target, command: &Command, done: &str) -> Result<(), Failure> {
    let client = steer(target)?;
    let id = client.send(command).map_err(failed)?;
    let tell = |cycle: Option<u64>| match target.json {
        true => say(json!({"done": {"id": id, "cycle": cycle}})),
        false => say(cycle.map_or_else(|| done.into(), |cycle| format!("{done} at cycle {cycle}"))),
    };
    loop {
        if let Some(cycle) = seen(&client, command) {
            return tell(Some(cycle));
        }
        let told = match client.next(WAIT) {
            Ok(Some(told)) => told,
            Ok(None) => return Err(Failure::Wrong("the run tells nothing".into())),
            // It ended before it told that it would.
            Err(ClientError::Closed) if matches!(command, Command::Stop {}) => {
                return tell(client.end().map(|end| end.cycle));
            }
            Err(error) => return Err(failed(error)),
        };
        match &told.event {
            Event::Done(done) if done.id == id => return tell(done.cycle),
            event => refused(event, &id)?,
        }
    }
}

/// The cycle of a status that shows the command's effect.
fn seen(client: &Client, command: &Command) -> Option<u64> {
    let status = client.status()?;
    let is_seen = match command {
        Command::Pause {} => status.paused,
        Command::Stop {} => status.stopped,
        _ => false,
    };
    is_seen.then_some(status.cycle)
}
