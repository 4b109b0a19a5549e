//! The events of a run's orders and commands, for whoever listens by `tracing`: one for each step.

use std::sync::Arc;

use tombolo_pipelines::language::{Change, Command, CommandAuthor};
use tracing::{debug, info};

use super::{order_report::OrderStatus, source::Source};
use crate::{
    step::Moment,
    stream::{Clock, Hub},
};

/// Tells of a run, by its number.
#[derive(Clone, Default)]
pub(crate) struct Events {
    /// `None` where another rank speaks.
    run: Option<Arc<str>>,
    clock: Arc<Clock>,
}

impl Events {
    pub(crate) fn new(run: Option<Arc<str>>, clock: Arc<Clock>) -> Self {
        Self { run, clock }
    }

    /// The number of the run; `None` where another rank speaks.
    pub(crate) fn run(&self) -> Option<&str> {
        self.run.as_deref()
    }

    /// A command was taken in.
    pub(super) fn accepted(&self, id: &str, source: &Source, command: &Command, moment: Moment) {
        let Some(run) = self.run() else { return };
        let cycle = moment.cycle;
        let (viewer, pipeline) = (viewer(source), pipeline(source));
        let Command::Order(order) = command else {
            let command = command.name();
            debug!(run, cycle, command, id, viewer, pipeline, "{command} '{id}': accepted");
            return;
        };
        let (order, undo) = match order.change {
            Change::Undo(count) => (id, Some(count.get())),
            Change::Edits(_) | Change::Stack(_) => (id, None),
        };
        let status = OrderStatus::Accepted.name();
        info!(run, cycle, order, status, undo, viewer, pipeline, "order '{order}': {status}");
    }

    /// An order has come further; `status` and `reason` say how far and why.
    pub(super) fn order(&self, order: &str, status: &str, reason: Option<&str>) {
        let Some(run) = self.run() else { return };
        let cycle = self.clock.get().cycle;
        match reason {
            Some(reason) => {
                info!(run, cycle, order, status, reason, "order '{order}': {status}: {reason}");
            }
            None if status == OrderStatus::Computing.name() => {
                debug!(run, cycle, order, status, "order '{order}': {status}");
            }
            None => info!(run, cycle, order, status, "order '{order}': {status}"),
        }
    }

    /// A command that is no order took effect, or why it did not.
    pub(super) fn settled(
        &self,
        command: &str,
        id: &str,
        source: &Source,
        moment: Moment,
        outcome: &Result<(), String>,
    ) {
        let Some(run) = self.run() else { return };
        let cycle = moment.cycle;
        let (viewer, pipeline) = (viewer(source), pipeline(source));
        match outcome {
            Ok(()) => info!(run, cycle, command, id, viewer, pipeline, "{command} '{id}': done"),
            Err(reason) => info!(
                run,
                cycle,
                command,
                id,
                viewer,
                pipeline,
                reason = &**reason,
                "{command} '{id}': not done: {reason}"
            ),
        }
    }
}

/// The viewer that gave a command.
fn viewer(source: &Source) -> Option<String> {
    match source {
        Source::Viewer(client) => Some(Hub::name(*client)),
        Source::Earlier(CommandAuthor::Viewer(name), _) => Some(name.clone()),
        _ => None,
    }
}

/// The pipeline that gave a command.
fn pipeline(source: &Source) -> Option<&str> {
    match source {
        Source::Pipeline(name) | Source::Earlier(CommandAuthor::Pipeline(name), _) => Some(name),
        _ => None,
    }
}
