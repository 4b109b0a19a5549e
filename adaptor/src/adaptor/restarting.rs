//! Runs that go on from a checkpoint.
//!
//! What the checkpoint does not hold, because it came after it, is in the journal of the run that made
//! it: it is done again, each at its cycle, and the shapes are those that the solver was handed then.
//! Behind the end of that journal the run goes on by itself.

use std::{
    collections::{HashMap, HashSet, VecDeque},
    fs::File,
    io::BufReader,
    path::Path,
};

use serde::{Deserialize, Serialize};
use tombolo_deform::{
    communicator::{Communicator, agree},
    shape::SavedPoints,
};
use tombolo_pipelines::language::{
    Command, CommandAuthor, HandedShape, Outcome, PinnedNote, RestartedFrom, Since, Taken,
};

use super::Adaptor;
use crate::{
    checkpoint::{
        Checkpoint, CheckpointError, Restart, SavedCommand, SavedMesh, SavedRun, read_of_ranks,
    },
    settings::Settings,
    steering::{Source, Steerer},
    step::Moment,
};

/// The state of a checkpoint that a restarted run goes on from.
#[derive(Default)]
pub(super) struct Resumed {
    mesh: Option<(SavedMesh, SavedPoints)>,
    again: Again,
    /// How many new commands wait until nothing is repeated any more, and are told so.
    pub(super) put_off: usize,
}

/// The commands carried out again after a checkpoint, equal on all ranks.
#[derive(Default, Serialize, Deserialize)]
struct Again {
    commands: VecDeque<CommandAgain>,
    /// The commands that changed nothing, and why.
    rejected: Vec<(SavedCommand, String)>,
    shapes: Vec<HandedShape>,
    /// The notes that were pinned.
    notes: Vec<PinnedNote>,
    /// The last cycle of which the journal tells.
    until: Option<u64>,
}

#[derive(Serialize, Deserialize)]
struct CommandAgain {
    id: String,
    by: CommandAuthor,
    command: Command,
    /// The cycle at which it took effect, or from which on it may.
    cycle: u64,
    /// Whether it comes after those of pipelines and files.
    comes_late: bool,
    /// Whether it had taken effect.
    has_settled: bool,
}

/// A checkpoint, and what came after it.
pub(super) struct Continued {
    pub(super) checkpoint: Checkpoint,
    again: Again,
}

impl Continued {
    /// Finds out where a run goes on from. Collective.
    pub(super) fn of(settings: &mut Settings) -> Result<Option<Self>, CheckpointError> {
        let communicator = &*settings.communicator;
        check_given(communicator, settings.restart.as_ref())?;
        let Some(restart) = settings.restart.take() else { return Ok(None) };
        let checkpoint = match restart {
            Restart::Checkpoint(checkpoint) => *checkpoint,
            Restart::File(file) => read_of_ranks(communicator, &file)?,
        };
        check_ranks(communicator, &checkpoint.run)?;
        let is_first = communicator.rank() == 0;
        let journal = settings.config.journal.as_ref().map(|path| settings.output.join(path));
        let since = match journal.filter(|_| is_first && settings.replay.is_none()) {
            Some(file) => read_since(&file, &checkpoint.run)
                .inspect(|since| warn_of_other_journal(&file, &checkpoint.run, since)),
            None => Ok(Since::default()),
        };
        let since = if communicator.size() == 1 { since? } else { agree(communicator, since)? };
        let mut told = if is_first {
            serde_json::to_vec(&Again::of(&checkpoint.run, since)).unwrap_or_default()
        } else {
            Vec::new()
        };
        communicator.broadcast(0, &mut told);
        let again = serde_json::from_slice(&told);
        let again = again.map_err(|error| CheckpointError::Damaged(error.to_string()));
        let again = if communicator.size() == 1 { again? } else { agree(communicator, again)? };
        if settings.config.pipelines == checkpoint.run.pipelines[0] {
            settings.config.pipelines.clone_from(&checkpoint.run.pipelines[1]);
        }
        Ok(Some(Self { checkpoint, again }))
    }

    /// What the journal says of it.
    pub(super) fn restarted_from(&self) -> RestartedFrom {
        restarted_from(&self.checkpoint.run)
    }

    /// The notes that were pinned in the run before.
    pub(super) fn notes(&self) -> &[PinnedNote] {
        &self.again.notes
    }

    /// What is left once a run has been set up.
    pub(super) fn into_resumed(self) -> Resumed {
        let Checkpoint { run, points, .. } = self.checkpoint;
        Resumed { mesh: run.mesh.zip(points), again: self.again, put_off: 0 }
    }
}

/// Whether all ranks were given a checkpoint to go on from, or none was. Collective.
fn check_given(
    communicator: &dyn Communicator,
    restart: Option<&Restart>,
) -> Result<(), CheckpointError> {
    if communicator.size() == 1 {
        return Ok(());
    }
    let own = match restart {
        None => b"none".to_vec(),
        Some(Restart::Checkpoint(_)) => b"own".to_vec(),
        Some(Restart::File(file)) => [b"file ", file.as_os_str().as_encoded_bytes()].concat(),
    };
    let mut first = own.clone();
    communicator.broadcast(0, &mut first);
    let same = if own == first {
        Ok(())
    } else {
        Err("it is to go on from another checkpoint than rank 0, or only one of the two is")
    };
    Ok(agree(communicator, same)?)
}

fn check_ranks(communicator: &dyn Communicator, run: &SavedRun) -> Result<(), CheckpointError> {
    let (rank, size) = (communicator.rank(), communicator.size());
    let mut first = serde_json::to_vec(&(&run.id, run.cycle)).unwrap_or_default();
    communicator.broadcast(0, &mut first);
    let (id, first_cycle): (String, u64) = serde_json::from_slice(&first).unwrap_or_default();
    let checked = if run.ranks != size {
        Err(CheckpointError::Ranks { found: run.ranks, expected: size })
    } else if run.id != id || run.rank != rank {
        Err(CheckpointError::OtherMoment { rank, of: run.rank, cycle: run.cycle, first_cycle })
    } else {
        Ok(())
    };
    if size == 1 { checked } else { Ok(agree(communicator, checked)?) }
}

fn read_since(file: &Path, run: &SavedRun) -> Result<Since, CheckpointError> {
    let error = |reason: String| CheckpointError::Journal { file: file.into(), reason };
    let journal = match File::open(file) {
        Ok(journal) => BufReader::new(journal),
        // It goes on in another place; what was accepted after the checkpoint is not known there.
        Err(reason) if reason.kind() == std::io::ErrorKind::NotFound => {
            return Ok(Since::default());
        }
        Err(reason) => return Err(error(reason.to_string())),
    };
    Since::read(journal, &restarted_from(run)).map_err(|reason| error(reason.to_string()))
}

/// Says so where the journal is that of other runs: the run goes on without what it does not tell.
fn warn_of_other_journal(file: &Path, run: &SavedRun, since: &Since) {
    if since.has_checkpoint {
        return;
    }
    let (journal, cycle, id) = (file.display(), run.cycle, &run.run);
    tracing::warn!(
        run = id,
        cycle,
        "the journal {journal} does not tell of the checkpoint at cycle {cycle} of run {id}: what was accepted after \
         it, if anything, is not carried out; it would be in the journal of that run"
    );
}

fn restarted_from(run: &SavedRun) -> RestartedFrom {
    RestartedFrom { run: run.run.clone(), checkpoint: run.id.clone(), cycle: run.cycle }
}

impl Again {
    fn of(run: &SavedRun, since: Since) -> Self {
        let Since { commands, shapes, notes, until, .. } = since;
        let open = until.unwrap_or(0);
        let mut outcomes: HashMap<String, (usize, Taken)> =
            (0..).zip(commands).map(|(at, taken)| (taken.id.clone(), (at, taken))).collect();
        let mut again = Self { shapes, notes, until, ..Self::default() };
        // Those that had taken effect in that order, then those that waited, the oldest first.
        let (mut settled, mut waiting) = (Vec::new(), Vec::new());
        let orders = run.mesh.iter().flat_map(|mesh| &mesh.steering.waiting);
        let orders = orders.map(|(id, order)| SavedCommand {
            id: id.clone(),
            by: CommandAuthor::Program,
            command: Command::Order(order.clone()),
        });
        // One that was still to be carried out again when the checkpoint was made is in both lists.
        let mut known = HashSet::new();
        let of_checkpoint = orders.chain(run.waiting.iter().cloned());
        let of_checkpoint = of_checkpoint.filter(|saved| known.insert(saved.id.clone()));
        let of_checkpoint = of_checkpoint.map(|saved| {
            let SavedCommand { id, by, command } = saved;
            let outcome = Outcome::Open {};
            let new = Taken { id, by: by.clone(), command: None, outcome };
            let (at, mut taken) = outcomes.remove(&new.id).unwrap_or((usize::MAX, new));
            if taken.command.is_none() {
                (taken.by, taken.command) = (by, Some(command));
            }
            (at, taken)
        });
        let of_checkpoint: Vec<_> = of_checkpoint.collect();
        let mut rest: Vec<_> = outcomes.into_values().collect();
        rest.sort_by_key(|(at, _)| *at);
        for (at, taken) in of_checkpoint.into_iter().chain(rest) {
            let Taken { id, by, command, outcome } = taken;
            // One that neither the journal nor the checkpoint has was settled before that.
            let Some(command) = command else { continue };
            let is_lasting = matches!(
                command,
                Command::Order(_) | Command::Parameter(_) | Command::Pipelines(_)
            );
            let (cycle, comes_late, has_settled) = match outcome {
                Outcome::Rejected { reason, .. } => {
                    again.rejected.push((SavedCommand { id, by, command }, reason));
                    continue;
                }
                Outcome::Applied { cycle, comes_late } => (cycle, comes_late, true),
                Outcome::Open {} => (open, true, false),
            };
            let command = CommandAgain { id, by, command, cycle, comes_late, has_settled };
            match () {
                // What a pause or a stop was for went with the run that was killed.
                () if !is_lasting => {}
                () if has_settled => settled.push((at, command)),
                () => waiting.push(command),
            }
        }
        settled.sort_by_key(|(at, _)| *at);
        again.commands = settled.into_iter().map(|(_, command)| command).chain(waiting).collect();
        again
    }
}

impl Resumed {
    /// Whether there is something to be done again at this cycle.
    #[inline]
    pub(super) fn is_due(&self, cycle: u64) -> bool {
        self.again.commands.front().is_some_and(|next| next.cycle <= cycle)
    }

    /// The last cycle at which what the journal tells is repeated, unless that is behind.
    #[inline]
    pub(super) fn repeats_until(&self, cycle: u64) -> Option<u64> {
        self.again.until.filter(|until| cycle <= *until)
    }

    /// Whether new commands were put off and nothing is repeated any more.
    #[inline]
    pub(super) fn has_put_off(&self, cycle: u64) -> bool {
        self.put_off > 0 && self.repeats_until(cycle).is_none()
    }

    pub(super) fn is_over(&self) -> bool {
        self.again.commands.is_empty()
    }

    /// Whether there is a mesh to be gone on with, as long as the solver has not shown its own.
    pub(super) fn has_mesh(&self) -> bool {
        self.mesh.is_some()
    }

    /// The mesh to be gone on with.
    pub(super) fn mesh(&self) -> Option<(SavedMesh, SavedPoints)> {
        self.mesh.clone()
    }

    /// The commands that are still to be done again.
    pub(super) fn waiting(&self) -> impl Iterator<Item = SavedCommand> {
        self.again.commands.iter().map(|CommandAgain { id, by, command, .. }| SavedCommand {
            id: id.clone(),
            by: by.clone(),
            command: command.clone(),
        })
    }

    /// Lets a steerer go on with the shapes that were handed out.
    ///
    /// # Errors
    /// Why its mesh cannot be the one that was saved.
    pub(super) fn hand_over(&mut self, steerer: &mut Steerer) -> Result<(), String> {
        let Some((saved, points)) = self.mesh.take() else { return Ok(()) };
        steerer
            .resume(&saved.steering, points)
            .map_err(|_| "the checkpoint's shapes do not go together with the mesh".to_owned())?;
        if let Some(until) = self.again.until {
            steerer.repeat_until(std::mem::take(&mut self.again.shapes), until);
        }
        Ok(())
    }
}

impl Adaptor {
    /// Keeps the names of commands of the run before, and says what became of those that were
    /// rejected then.
    pub(super) fn announce_resumed(&self) {
        if self.communicator.rank() > 0 {
            return;
        }
        for (SavedCommand { id, by, command }, reason) in &self.resumed.again.rejected {
            self.log.reserve(id, command);
            if !matches!(command, Command::Order(_)) {
                continue;
            }
            // One that came in after the checkpoint is in the report and the journal of this run too.
            if !self.log.has_order(id) {
                let source = Source::Earlier(by.clone(), true);
                self.log.accept_again(id, &source, command, self.moment);
            }
            self.log.reject(id, self.moment, &reason.into());
        }
        for CommandAgain { id, command, .. } in &self.resumed.again.commands {
            self.log.reserve(id, command);
        }
    }

    /// Does again what is due of the commands of the run before; first those that were there before
    /// the commands of pipelines and files, then all. Collective.
    pub(super) fn obey_again(&mut self, moment: Moment, all: bool) {
        while self.resumed.is_due(moment.cycle) {
            let commands = &mut self.resumed.again.commands;
            if !all && commands.front().is_some_and(|next| next.comes_late) {
                return;
            }
            let front = commands.pop_front();
            let Some(CommandAgain { id, by, command, has_settled, .. }) = front else {
                return;
            };
            let source = Source::Earlier(by, has_settled);
            // A run that is carried out again has the lines up to the checkpoint and those of this run;
            // a line that says the same twice does no harm.
            if self.communicator.rank() == 0 {
                self.log.accept_again(&id, &source, &command, moment);
            }
            self.obey(id, &source, command, None, moment);
        }
    }
}
