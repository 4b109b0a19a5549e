//! `tombolo watch`.

use std::time::Duration;

use crate::client::{ClientError, Drives, Event};
use clap::{Args, ValueEnum};

use super::{Target, connect, failed, order, status};
use crate::program::{Failure, say};

/// How long nothing is waited for at once.
const WAIT: Duration = Duration::from_secs(3600);

#[derive(Debug, Args)]
pub(crate) struct Options {
    #[command(flatten)]
    pub(super) target: Target,
    /// How the run has to end for the exit code 0
    #[arg(long, value_enum, default_value = "ended")]
    until: Until,
}

/// How a run has to end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Until {
    /// The solver came to its end, or was asked to stop
    Ended,
    /// The solver came to its end
    Finished,
}

pub(crate) fn watch(options: &Options) -> Result<(), Failure> {
    let client = connect(&options.target, Drives::Never)?;
    loop {
        let told = match client.next(WAIT) {
            Ok(Some(told)) => told,
            Ok(None) => continue,
            Err(ClientError::Closed) => break,
            Err(error) => return Err(failed(error)),
        };
        if options.target.json {
            match &told.event {
                Event::Lost { reason } => eprintln!("tombolo: connection lost: {reason}"),
                _ if told.text.is_empty() => {}
                _ => say(&told.text)?,
            }
        } else if let Some(line) = line(&told.event, status::is_recording(&client)) {
            say(line)?;
        }
    }
    let how = client.end().map_or_else(|| "unknown".to_owned(), |end| end.how);
    match (how.as_str(), options.until) {
        ("finished", _) | ("stopped", Until::Ended) => Ok(()),
        _ => Err(Failure::Wrong(format!("the run has ended: {how}"))),
    }
}

/// The line that is printed for an event.
fn line(event: &Event, is_recording: bool) -> Option<String> {
    Some(match event {
        Event::Status(status) => status::line(status, is_recording),
        Event::Order(report) => order::line(report),
        Event::Monitor(values) => {
            let number = |value: &Option<f64>| match value {
                Some(value) => value.to_string(),
                None => "none".to_owned(),
            };
            let each =
                values.values.iter().map(|(name, value)| format!("{name} {}", number(value)));
            let all = each.collect::<Vec<_>>().join(", ");
            let time = status::rounded(values.time);
            format!("{}: cycle {}, time {time}: {all}", values.pipeline, values.cycle)
        }
        Event::Pipelines(change) => match change.cycle {
            Some(cycle) => format!("pipelines: {} at cycle {cycle}", change.status),
            None => format!("pipelines: {}", change.status),
        },
        Event::Precision(precision) if precision.coarser > 1.0 => format!(
            "{}: the connection is slow, values are within {} times the error",
            precision.view, precision.coarser
        ),
        Event::Precision(precision) => format!("{}: as exact as it asks for", precision.view),
        Event::Error(error) => format!("error: {}", error.message),
        Event::Lost { reason } => format!("connection lost: {reason}"),
        Event::End(end) => {
            format!("{}: cycle {}, time {}", end.how, end.cycle, status::rounded(end.time))
        }
        _ => return None,
    })
}
