//! The state of a run, saved.

use std::path::Path;

use tombolo_deform::communicator::{Alarm, Communicator, Writer};
use tombolo_pipelines::language::CheckpointNote;

use super::{Adaptor, SteeredMesh};
use crate::{
    checkpoint::{Checkpoint, CheckpointError, SavedCommand, SavedMesh, SavedRun, write_of_ranks},
    step::Moment,
};

impl Adaptor {
    /// The state of the run at the end of the step that the last call of
    /// [`execute`](Adaptor::execute) has begun, to be saved with the solver's own state at the end of
    /// that step; [`Settings::restart`](crate::Settings::restart) goes on from it. See
    /// [`Checkpoint`], which has an example.
    ///
    /// It copies no coordinates. The journal gets a line that says where it was made, and this waits
    /// until that line and all before it are on disk, two seconds at most: a run that is killed and
    /// restarted has lost none of them. Files and rows that pipelines write at steps so far are
    /// waited for as well, ten seconds at most: the run that goes on does not write them again.
    ///
    /// On several ranks it is collective, and each rank has the checkpoint of its own part.
    #[must_use]
    pub fn checkpoint(&mut self) -> Checkpoint {
        let _alarm = Alarm::among(&self.communicator);
        let Moment { cycle, time } = self.moment;
        let mut id = random_name().into_bytes();
        self.communicator.broadcast(0, &mut id);
        let id = String::from_utf8_lossy(&id).into_owned();
        // Before anything is looked at: what has a line behind it is not missed, even if it is here
        // too.
        let note = CheckpointNote { id: id.clone(), cycle, time };
        self.log.checkpoint(note);
        if let Some(run) = self.log.run() {
            tracing::debug!(run, cycle, checkpoint = &*id, "the checkpoint {id} is made");
        }
        let changes = self.waiting_changes.iter().map(super::changing::WaitingChange::saved);
        let mut waiting: Vec<SavedCommand> = changes.chain(self.resumed.waiting()).collect();
        let before = waiting.len();
        self.queue.look(|received| {
            waiting.push(SavedCommand {
                id: received.id.clone(),
                by: (&received.source).into(),
                command: received.command.clone(),
            });
        });
        self.saved = Some(waiting.len() - before);
        let mut pipelines = Writer::default();
        self.pipelines.save(&mut pipelines);
        let (mesh, points) = match (&self.mesh, self.lent.reference()) {
            (SteeredMesh::Steered(steerer, _), Some(cells)) => {
                let (steering, points) = steerer.save();
                (Some(SavedMesh { cells, steering }), Some(points))
            }
            // It was not gone on with yet.
            (SteeredMesh::Unknown, _) => self.resumed.mesh().unzip(),
            _ => (None, None),
        };
        let parameters = self.parameters.all().iter().map(|it| (it.name.clone(), it.value));
        let run = SavedRun {
            id,
            run: self.run.as_ref().into(),
            rank: self.communicator.rank(),
            ranks: self.communicator.size(),
            has_begun: self.has_begun,
            cycle,
            time,
            met: self.meetings.last,
            parameters: parameters.collect(),
            pipelines: [self.given.pipelines.clone(), self.config.pipelines.clone()],
            timed: (self.given.orders, self.timed.left().to_vec()),
            carried_out: self.timed.carried_out().to_vec(),
            defaults: self.defaults.clone(),
            known: self.log.known(),
            waiting,
            mesh,
        };
        Checkpoint { run, pipelines: pipelines.into_bytes(), points }
    }

    /// The step of the last call, of this run or of the one that it goes on from.
    pub(crate) fn last_moment(&self) -> Option<Moment> {
        self.has_begun.then_some(self.moment)
    }

    /// Saves the state of the run, as [`checkpoint`](Adaptor::checkpoint) does, in a file of its own:
    /// whole, or not at all. On several ranks rank 0 writes what all have, one after the other. It
    /// waits for the disk.
    ///
    /// # Errors
    /// [`CheckpointError`], the same on all ranks; the run can go on, and an older file is still
    /// there.
    pub fn write_checkpoint(&mut self, file: impl AsRef<Path>) -> Result<(), CheckpointError> {
        let checkpoint = self.checkpoint();
        let _alarm = Alarm::among(&self.communicator);
        let file = file.as_ref();
        write_of_ranks(&*self.communicator, file, &checkpoint)?;
        if let Some(run) = self.log.run() {
            let (cycle, path) = (checkpoint.run.cycle, file.display());
            tracing::info!(run, cycle, %path, "the checkpoint {path} is written");
        }
        Ok(())
    }
}

/// A name that no other run or checkpoint has.
pub(super) fn random_name() -> String {
    let mut number = [0; 8];
    // Without random numbers the moment tells runs apart well enough.
    let _ = getrandom::fill(&mut number);
    let since = std::time::SystemTime::now().duration_since(std::time::SystemTime::UNIX_EPOCH);
    let nanoseconds = since.unwrap_or_default().subsec_nanos();
    format!("{:016x}", u64::from_le_bytes(number) ^ u64::from(nanoseconds))
}

/// The pipelines and commands that a run was begun with, by which a restart knows whether it was
/// given others.
#[derive(Default)]
pub(super) struct Given {
    pub(super) pipelines: Vec<tombolo_pipelines::language::Pipeline>,
    /// A hash of the commands.
    pub(super) orders: u64,
}
