//! The orders of a run and how far each has come; kept for the viewers, the report and the journal.

use std::sync::{Arc, Mutex};

use serde_json::{Value, json};
use tombolo_pipelines::language::{
    CheckpointNote, Command, CommandAuthor, HandedShape, JournalEntry, JournalNote,
    OrderStatus as JournalStatus, PinnedNote, RunEnd,
};

use super::{
    NotFollowed,
    events::Events,
    known::{KnownCommands, KnownOrder, Named, hash_of},
    order_report::{OrderReport, OrderStatus},
    planner::Rejection,
    room::is_urgent,
    source::Source,
};
use crate::{journal::Journal, lock::lock, step::Moment, stream::Hub};

/// The reason told for a command that a run which goes on from the checkpoint carries out.
const LEFT_OPEN: &str = "the run ended before its turn came; a run that goes on from its \
                         checkpoint carries it out";

/// Shared by the thread that reads from viewers and the solver's.
pub(crate) struct Log {
    state: Mutex<KnownCommands>,
    journal: Journal,
    hub: Option<Arc<Hub>>,
    events: Events,
}

impl Log {
    pub(crate) fn new(journal: Journal, hub: Option<Arc<Hub>>, events: Events) -> Self {
        Self { state: Mutex::default(), journal, hub, events }
    }

    /// The number of the run, as its events have it; `None` where another rank speaks.
    pub(crate) fn run(&self) -> Option<&str> {
        self.events.run()
    }

    /// Goes on from the commands of an earlier run.
    pub(crate) fn resume(&self, known: KnownCommands) {
        *lock(&self.state) = known;
    }

    /// Goes on with the notes that were pinned in an earlier run.
    pub(crate) fn resume_notes(&self, notes: Vec<PinnedNote>) {
        notes.iter().for_each(|note| self.journal.note(&JournalNote::Note(note.clone())));
        if let Some(hub) = &self.hub {
            hub.resume_notes(notes);
        }
    }

    /// The commands so far.
    pub(crate) fn known(&self) -> KnownCommands {
        lock(&self.state).clone()
    }

    /// Keeps the name of a command of an earlier run from others, but for the viewer that sends it
    /// again.
    pub(crate) fn reserve(&self, id: &str, command: &Command) {
        let digest = hash_of(command);
        lock(&self.state).reserve(id, digest);
    }

    /// Keeps the names of commands that were given beforehand for them.
    pub(crate) fn expect<'a>(&self, ids: impl Iterator<Item = &'a str>) {
        let mut state = lock(&self.state);
        ids.for_each(|id| state.expect(id));
    }

    /// Takes a command in that an earlier run has accepted, under its name.
    pub(crate) fn accept_again(
        &self,
        id: &str,
        source: &Source,
        command: &Command,
        moment: Moment,
    ) {
        let digest = hash_of(command);
        let is_known = lock(&self.state).reserve(id, digest);
        self.journal.write(&accepted(id, source, command, moment));
        if !is_known {
            self.events.accepted(id, source, command, moment);
            self.admit(id, command, moment);
        }
    }

    /// Takes a command in that no viewer sent: gives it a name unless it has one, hands it to the
    /// journal, tells the viewers of an order. Never waits for the disk.
    ///
    /// # Errors
    /// Where another command has that name already, or the journal has no room for its line.
    pub(crate) fn accept(
        &self,
        wanted: Option<String>,
        source: &Source,
        command: &Command,
        moment: Moment,
    ) -> Result<String, String> {
        let named = {
            let mut state = lock(&self.state);
            if let (Source::File, Some(id)) = (source, &wanted) {
                state.has_come(id);
            }
            state.name(wanted, None)?
        };
        let (Named::New(id) | Named::Again(id)) = named;
        if let Err(exceeded) = self.journal.try_write(&accepted(&id, source, command, moment)) {
            self.forget(&id);
            return Err(format!("'{id}': {exceeded}, in its line of the journal"));
        }
        self.events.accepted(&id, source, command, moment);
        self.admit(&id, command, moment);
        Ok(id)
    }

    /// Names a command of a viewer. It may come again where a connection was lost: it is answered by
    /// what became of it.
    ///
    /// # Errors
    /// Where another command has that name already.
    pub(crate) fn name(
        &self,
        client: u64,
        wanted: Option<String>,
        command: &Command,
    ) -> Result<Option<String>, String> {
        // A large one takes a while, in which nobody is to wait.
        let digest = hash_of(command);
        let named = lock(&self.state).name(wanted, Some(digest))?;
        match named {
            Named::New(id) => Ok(Some(id)),
            Named::Again(id) => {
                let outcome = lock(&self.state).outcome(&id);
                if let (Some(outcome), Some(hub)) = (outcome, &self.hub) {
                    hub.tell_client(client, outcome);
                }
                Ok(None)
            }
        }
    }

    /// Lets go of a name that was given to a command which is not taken after all.
    pub(crate) fn forget(&self, id: &str) {
        lock(&self.state).forget(id);
    }

    /// Takes a command of a viewer in, under the name that it was given. `then` is called once it is
    /// on disk, on another thread, with what tells viewers that it is taken: to be called when it is
    /// where the solver finds it. It is called with `None` where the journal cannot be written, which
    /// the viewer is told. What a run must hear in any case (pause, resume, stop, cancel) does not
    /// wait for the disk, unless it cancels an order that does.
    pub(crate) fn accept_from(
        self: &Arc<Self>,
        client: u64,
        id: String,
        command: &Command,
        moment: Moment,
        then: impl FnOnce(Option<&dyn Fn()>) + Send + 'static,
    ) {
        let source = Source::Viewer(client);
        let entry = accepted(&id, &source, command, moment);
        if is_urgent(command) && !self.cancels_unwritten(command) {
            self.journal.write(&entry);
            self.events.accepted(&id, &source, command, moment);
            return then(Some(&|| self.admit(&id, command, moment)));
        }
        let (log, command) = (Arc::clone(self), command.clone());
        self.journal.ask(&entry, move |outcome| match outcome {
            Ok(()) => {
                log.events.accepted(&id, &source, &command, moment);
                then(Some(&|| log.admit(&id, &command, moment)));
            }
            Err(reason) => {
                lock(&log.state).forget(&id);
                then(None);
                if let Some(hub) = &log.hub {
                    let message = format!(
                        "it was not taken, because the journal cannot be written: {reason}; try again once it can"
                    );
                    hub.tell_client(
                        client,
                        move || json!({"error": {"message": message, "id": id}}),
                    );
                }
            }
        });
    }

    /// Whether a command cancels an order that is named and not in the journal yet.
    fn cancels_unwritten(&self, command: &Command) -> bool {
        matches!(command, Command::Cancel(cancel) if lock(&self.state).is_only_named(&cancel.order))
    }

    /// Notes and tells a command that is in the journal.
    fn admit(&self, id: &str, command: &Command, moment: Moment) {
        match command {
            Command::Order(order) => {
                lock(&self.state).add(id, order, moment.cycle);
                self.tell(id);
            }
            Command::Pipelines(_) => {
                if let Some(hub) = &self.hub {
                    let id = id.to_owned();
                    hub.tell(
                        move || json!({"pipelines": {"id": id, "status": JournalStatus::Accepted}}),
                    );
                }
            }
            _ => {}
        }
    }

    /// Notes that a command that is no order took effect, or why it did not, and tells who gave it;
    /// `command` is its [name](Command::name).
    pub(crate) fn settle(
        &self,
        command: &str,
        id: &str,
        source: &Source,
        moment: Moment,
        outcome: Result<(), String>,
    ) {
        self.events.settled(command, id, source, moment, &outcome);
        self.answer(id, source, moment, &outcome);
        match outcome {
            Ok(()) => self.journal(id, JournalStatus::Applied, moment, None, [None; 2]),
            Err(reason) => {
                self.journal(id, JournalStatus::Rejected, moment, Some(reason), [None; 2])
            }
        }
    }

    /// Tells who gave a command that is no order what became of it.
    fn answer(&self, id: &str, source: &Source, moment: Moment, outcome: &Result<(), String>) {
        let Moment { cycle, time } = moment;
        let told = match outcome {
            Ok(()) => json!({"done": {"id": id, "cycle": cycle, "time": time}}),
            Err(reason) => json!({"error": {"message": reason, "id": id}}),
        };
        match (source, &self.hub) {
            (Source::Viewer(client), Some(hub)) => {
                let told = told.clone();
                hub.tell_client(*client, move || told);
            }
            // Who gave it may be another viewer of this run.
            (Source::Earlier(CommandAuthor::Viewer(_), _), Some(hub)) => {
                let told = told.clone();
                hub.tell(move || told);
            }
            _ => {}
        }
        lock(&self.state).settle(id, told);
    }

    /// Tells that the run ended before the turn of an order came. In the journal it stays open: a run
    /// that goes on from the checkpoint carries it out.
    pub(crate) fn leave_open(&self, id: &str) {
        self.tell_rejected(id, OrderStatus::name, &LEFT_OPEN.into());
    }

    /// Does what [`leave_open`](Log::leave_open) does for a command that is no order.
    pub(crate) fn leave_command_open(&self, id: &str, source: &Source, moment: Moment) {
        self.answer(id, source, moment, &Err(LEFT_OPEN.into()));
    }

    /// Changes what is known of an order and tells the viewers.
    pub(crate) fn update(&self, id: &str, change: impl FnOnce(&mut OrderReport)) {
        self.update_as(id, OrderStatus::name, change);
    }

    /// Does what [`update`](Log::update) does; `named` gives the status that the event of a new state
    /// shows.
    fn update_as(
        &self,
        id: &str,
        named: impl FnOnce(OrderStatus) -> &'static str,
        change: impl FnOnce(&mut OrderReport),
    ) {
        let come_to = {
            let mut state = lock(&self.state);
            let Some(order) = state.order_mut(id) else { return };
            let before = order.status;
            change(order);
            if !matches!(order.status, OrderStatus::Accepted | OrderStatus::Computing) {
                order.waits_for = None;
            }
            (order.status != before).then(|| (order.status, order.reason.clone()))
        };
        if let Some((status, reason)) = come_to {
            self.events.order(id, named(status), reason.as_deref());
        }
        self.tell(id);
    }

    /// Whether an order of this name is known.
    pub(crate) fn has_order(&self, id: &str) -> bool {
        lock(&self.state).order(id).is_some()
    }

    /// Notes that the solver was handed a shape, or a position between two.
    pub(crate) fn handed(&self, id: &str, shape: f64, moment: Moment) {
        let handed = HandedShape { order: id.into(), shape, cycle: moment.cycle };
        self.journal.note(&JournalNote::Shape(handed));
    }

    /// Hands a line about the run to the journal.
    pub(crate) fn note(&self, note: &JournalNote) {
        self.journal.note(note);
    }

    /// Has a line about a checkpoint in the journal, and waits until it and all before it are on disk,
    /// two seconds at most.
    pub(crate) fn checkpoint(&self, note: CheckpointNote) {
        self.journal.checkpoint(note);
    }

    /// Waits until the journal's lines so far are on disk and the commands in them are taken in, two
    /// seconds at most.
    pub(crate) fn wait(&self) {
        self.journal.wait();
    }

    /// Whether there is a journal.
    pub(crate) fn has_journal(&self) -> bool {
        self.journal.is_kept()
    }

    /// How many orders have come to which state.
    pub(crate) fn order_counts(&self) -> Vec<(&'static str, usize)> {
        lock(&self.state).counts()
    }

    /// Notes that the run comes to its end, and waits for the disk, for two seconds at most.
    pub(crate) fn end(&self, moment: Moment) {
        let Moment { cycle, time } = moment;
        self.journal.note(&JournalNote::End(RunEnd { cycle, time }));
        self.journal.close();
    }

    /// Looks whether the disk takes too long. To be called a few times a second.
    pub(crate) fn look_at_time(&self) {
        self.journal.look_at_time();
    }

    /// Why the journal cannot be written, or that lines of it are missing.
    pub(crate) fn journal_lost(&self) -> Option<String> {
        self.journal.lost()
    }

    /// Notes that an order changes nothing, and why.
    pub(crate) fn reject(&self, id: &str, moment: Moment, rejection: &Rejection) {
        self.reject_as(id, OrderStatus::name, moment, rejection);
    }

    /// Notes that an order was taken back before it changed anything, and by whom.
    pub(crate) fn cancel(&self, id: &str, moment: Moment, reason: String) {
        self.reject_as(id, |_| "cancelled", moment, &reason.into());
    }

    fn reject_as(
        &self,
        id: &str,
        named: impl FnOnce(OrderStatus) -> &'static str,
        moment: Moment,
        rejection: &Rejection,
    ) {
        let Rejection { reason, min_scaled_jacobian, fraction, .. } = rejection;
        let numbers = [*min_scaled_jacobian, *fraction];
        self.journal(id, JournalStatus::Rejected, moment, Some(reason.clone()), numbers);
        self.tell_rejected(id, named, rejection);
    }

    fn tell_rejected(
        &self,
        id: &str,
        named: impl FnOnce(OrderStatus) -> &'static str,
        rejection: &Rejection,
    ) {
        let Rejection { reason, min_scaled_jacobian, fraction, seconds, .. } = rejection;
        self.update_as(id, named, |order| {
            order.status = OrderStatus::Rejected;
            order.reason = Some(reason.clone());
            order.min_scaled_jacobian = *min_scaled_jacobian;
            order.fraction = *fraction;
            order.seconds = *seconds;
        });
    }

    /// Notes that the motion of an order begins; `clamped` is the fraction that is done, where that
    /// is not all of it.
    pub(crate) fn begin(
        &self,
        id: &str,
        moment: Moment,
        min_scaled_jacobian: Option<f64>,
        clamped: Option<f64>,
    ) {
        self.journal(id, JournalStatus::Applied, moment, None, [min_scaled_jacobian, clamped]);
    }

    /// Notes how far the mesh was from where it was asked to be, which is not far.
    pub(crate) fn deviates(&self, id: &str, distance: f64) {
        if distance > 0.0 {
            self.update(id, |order| {
                order.deviation =
                    Some(order.deviation.map_or(distance, |known| known.max(distance)))
            });
        }
    }

    /// Notes that the solver did not take a motion; it is said once for each order.
    pub(crate) fn not_followed(&self, id: &str, handed_out: Moment, not: NotFollowed) {
        let NotFollowed { cycle, shape, distance } = not;
        let mut first = None;
        self.update(id, |order| {
            order.deviation = Some(order.deviation.map_or(distance, |known| known.max(distance)));
            if order.not_followed.is_none() {
                order.not_followed = Some(not);
                first = Some(order.shapes);
            }
        });
        let Some(shapes) = first else { return };
        let reason = format!(
            "shape {shape} of {shapes}, handed out at cycle {cycle}, is not where the solver's mesh is at the next call; its \
             vertices are up to {distance:.3e} from there"
        );
        let message = format!("order '{id}': applied, not followed: {reason}");
        self.journal(id, JournalStatus::NotFollowed, handed_out, Some(reason), [None; 2]);
        let (run, order) = (self.run(), id);
        tracing::warn!(run, cycle, order, shape, "{message}");
        if let Some(hub) = &self.hub {
            let id = id.to_owned();
            hub.tell(move || json!({"error": {"message": message, "id": id}}));
        }
    }

    /// Notes that no call came after the one that handed a shape out.
    pub(crate) fn not_confirmed(&self, id: &str, handed_out: Moment, shape: u32) {
        let mut shapes = shape;
        self.update(id, |order| {
            order.not_confirmed = Some(shape);
            shapes = order.shapes;
        });
        let reason = format!(
            "shape {shape} of {shapes}, handed out at cycle {}, was the last: no call after it shows whether the solver's mesh is there",
            handed_out.cycle
        );
        if let Some(run) = self.run() {
            let cycle = handed_out.cycle;
            tracing::info!(
                run,
                cycle,
                order = id,
                "order '{id}': applied, not confirmed: {reason}"
            );
        }
        self.journal(id, JournalStatus::NotConfirmed, handed_out, Some(reason), [None; 2]);
    }

    fn journal(
        &self,
        id: &str,
        status: JournalStatus,
        moment: Moment,
        reason: Option<String>,
        [min_scaled_jacobian, fraction]: [Option<f64>; 2],
    ) {
        let Moment { cycle, time } = moment;
        self.journal.write(&JournalEntry {
            id: id.into(),
            status,
            cycle,
            time,
            command: None,
            by: None,
            reason,
            min_scaled_jacobian,
            fraction,
        });
    }

    fn tell(&self, id: &str) {
        let Some(hub) = &self.hub else { return };
        let known = lock(&self.state).known(id);
        if let Some(mut order) = known {
            // The edits of an order are sent once, when it is accepted; a viewer that connects later
            // gets them in its `hello`.
            if order.report.status != OrderStatus::Accepted {
                order.given = None;
            }
            hub.tell(move || json!({ "order": order.told() }));
        }
    }

    /// The newest orders, for a viewer that connects.
    pub(crate) fn told(&self) -> Value {
        let newest = lock(&self.state).newest();
        newest.iter().map(KnownOrder::told).collect()
    }

    pub(crate) fn reports(&self) -> Vec<OrderReport> {
        lock(&self.state).reports()
    }
}

/// The line that says that a command was accepted.
fn accepted(id: &str, source: &Source, command: &Command, moment: Moment) -> JournalEntry {
    let Moment { cycle, time } = moment;
    JournalEntry {
        id: id.into(),
        status: JournalStatus::Accepted,
        cycle,
        time,
        command: Some(command.clone()),
        by: Some(source.into()),
        reason: None,
        min_scaled_jacobian: None,
        fraction: None,
    }
}

#[cfg(test)]
mod tests {
    use tombolo_pipelines::language::{Cancel, Order};

    use super::*;
    use crate::steering::Events;

    /// A cancel waits for the disk with its order, and for no other command.
    #[test]
    fn a_cancel_waits_for_an_order_that_is_not_on_disk() {
        let log = Log::new(Journal::none(), None, Events::default());
        let order: Order = serde_json::from_value(serde_json::json!({"undo": 1})).unwrap();
        let command = Command::Order(order);
        let cancels =
            |order: &str| log.cancels_unwritten(&Command::Cancel(Cancel { order: order.into() }));
        assert!(!cancels("a"));
        log.name(1, Some("a".into()), &command).unwrap();
        assert!(cancels("a") && !cancels("b") && !log.cancels_unwritten(&Command::Pause {}));
        log.admit("a", &command, Moment::default());
        assert!(!cancels("a"));
    }
}
