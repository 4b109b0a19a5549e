//! The end of a run: every command has an outcome, every thread ends, and there is a report.

use tombolo_deform::communicator::{Alarm, Reduction};
use tombolo_pipelines::language::Command;

use super::{Adaptor, SteeredMesh};
use crate::{
    error::FinalizeError,
    report::Report,
    steering::{Forecaster, Received, Source},
    stream::End,
};

/// The reason for which a command whose turn did not come is refused.
const TOO_LATE: &str = "the run ended before its turn came";

impl Adaptor {
    /// Ends the run: viewers are disconnected, and every thread has ended when it returns.
    ///
    /// # Errors
    /// [`FinalizeError`] where a file that a pipeline asked for could not be written; it holds the
    /// report all the same.
    pub fn finalize(mut self) -> Result<Report, FinalizeError> {
        let _alarm = Alarm::among(&self.communicator);
        if let SteeredMesh::Steered(steerer, _) = &mut self.mesh {
            steerer.end(self.moment, self.saved.is_some());
        }
        self.end_changes();
        self.end_queue();
        self.forecaster.get().into_iter().for_each(Forecaster::give_up);
        self.mesh = SteeredMesh::Unknown;
        let asked = self.pipelines.end(self.moment, self.hub.as_ref());
        asked.faults.iter().for_each(|fault| self.complain(fault));
        self.watch = None;
        if let Some(hub) = &self.hub {
            hub.ends(if self.stopped { End::Stopped } else { End::Finished });
        }
        self.server = None;
        self.recorder = None;
        // The server may have taken commands in until now: each has an outcome.
        self.log.wait();
        self.end_queue();
        self.log.end(self.moment);
        let faults = self.pipelines.finish();
        // Rank 0 writes: what was asked for is there before any rank goes on.
        self.communicator.reduce(Reduction::Maximum, &mut [0.0]);
        let report = Report {
            cycles: self.timing.cycles,
            orders: self.log.reports(),
            step_seconds: self.timing.steps.spread(),
            adaptor_seconds: self.timing.parts(),
            stream: self.hub.as_ref().map(|hub| hub.counts()).unwrap_or_default(),
            pipelines: self.pipelines.reports(),
            journal_lost: self.log.journal_lost(),
        };
        match faults.first() {
            None => Ok(report),
            Some(first) => Err(FinalizeError::Files {
                count: faults.len(),
                first: first.clone(),
                report: Box::new(report),
            }),
        }
    }

    /// Tells of all commands in the queue that the run ended before their turn came.
    fn end_queue(&mut self) {
        for Received { id, command, source, .. } in self.queue.take() {
            // The journal has what came after the checkpoint.
            let goes_on = match &mut self.saved {
                None => false,
                Some(0) => self.log.has_journal(),
                Some(left) => {
                    *left -= 1;
                    true
                }
            };
            let name = command.name();
            match command {
                Command::Order(_) if goes_on => self.log.leave_open(&id),
                Command::Order(_) => self.log.reject(&id, self.moment, &TOO_LATE.into()),
                // It ends, as was asked.
                Command::Stop {} => self.log.settle(name, &id, &source, self.moment, Ok(())),
                // They were for this run alone.
                Command::Pause {} | Command::Resume {} | Command::Cancel(_) => {
                    self.end_command(name, &id, &source, false);
                }
                Command::Parameter(_) | Command::Pipelines(_) => {
                    self.end_command(name, &id, &source, goes_on);
                }
            }
        }
    }

    /// Tells of a command that is no order that the run ended before its turn came. Where the run
    /// `goes_on` from a checkpoint, it is carried out there, and stays open in the journal.
    pub(super) fn end_command(&self, command: &str, id: &str, source: &Source, goes_on: bool) {
        if goes_on {
            self.log.leave_command_open(id, source, self.moment);
        } else {
            self.log.settle(command, id, source, self.moment, Err(TOO_LATE.into()));
        }
    }
}
