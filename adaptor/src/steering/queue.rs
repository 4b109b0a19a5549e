//! Commands on their way from the viewers' thread to the solver's.

use std::{
    collections::VecDeque,
    sync::{
        Arc, Condvar, Mutex,
        atomic::{AtomicBool, Ordering},
    },
    time::Duration,
};

use tombolo_pipelines::{
    language::{Command, Order, StreamLimits},
    limits::Exceeded,
};

use super::{
    Source,
    room::{Reservation, Room, is_urgent},
};
use crate::lock::lock;

/// A command that was read, found valid and written to the journal.
#[derive(Debug)]
pub(crate) struct Received {
    pub(crate) source: Source,
    pub(crate) id: String,
    pub(crate) command: Command,
    /// The room that it takes while it waits; none for one that no viewer sent.
    pub(crate) reservation: Option<Reservation>,
}

/// A forecast that a viewer asks for where only all ranks together can answer.
#[derive(Debug)]
pub(crate) struct Asked {
    pub(crate) client: u64,
    pub(crate) id: Option<String>,
    pub(crate) order: Box<Order>,
}

/// The forecasts that viewers have asked for.
#[derive(Debug, Default)]
struct Questions {
    waiting: Vec<Asked>,
    /// Those who asked what the ranks have taken up together last.
    taken_up: Vec<u64>,
}

/// The queue. To look whether anything happened costs the solver one atomic load.
#[derive(Debug)]
pub(crate) struct Queue {
    attention: AtomicBool,
    /// Whether there has been a viewer that may steer.
    driven: AtomicBool,
    waiting: Mutex<VecDeque<Received>>,
    room: Arc<Room>,
    /// The room for commands that a run must hear whatever else waits.
    urgent: Arc<Room>,
    questions: Mutex<Questions>,
    arrived: Condvar,
}

impl Default for Queue {
    fn default() -> Self {
        Self::new(&StreamLimits::default())
    }
}

impl Queue {
    /// A queue with room for so much.
    pub(crate) fn new(limits: &StreamLimits) -> Self {
        Self {
            attention: AtomicBool::default(),
            driven: AtomicBool::default(),
            waiting: Mutex::default(),
            room: Arc::new(Room::new(limits)),
            urgent: Arc::new(Room::new(&StreamLimits::default())),
            questions: Mutex::default(),
            arrived: Condvar::default(),
        }
    }

    /// Takes room for one more command, which came in so many bytes. It is given back when its turn
    /// has come.
    ///
    /// # Errors
    /// [`Exceeded`] where too much waits already.
    pub(crate) fn reserve(&self, command: &Command, bytes: usize) -> Result<Reservation, Exceeded> {
        let room = if is_urgent(command) { &self.urgent } else { &self.room };
        room.reserve(bytes)
    }

    pub(crate) fn push(&self, received: Received) {
        self.push_and_tell(received, || {});
    }

    /// Puts a command into the queue and calls `tell` before the solver's thread can take it from
    /// there: who hears of a command finds it in the queue, and hears nothing else of it before. The
    /// queue is locked meanwhile: nothing that `tell` locks may be held by who comes here.
    pub(crate) fn push_and_tell(&self, received: Received, tell: impl FnOnce()) {
        let mut waiting = lock(&self.waiting);
        waiting.push_back(received);
        tell();
        drop(waiting);
        self.call();
    }

    /// Asks in place of what the same client asked before and was not told yet, which is returned.
    pub(crate) fn ask(&self, asked: Asked) -> Option<Asked> {
        let mut questions = lock(&self.questions);
        let waiting = &mut questions.waiting;
        let before = waiting.iter().position(|before| before.client == asked.client);
        let overtaken = before.map(|index| waiting.remove(index));
        waiting.push(asked);
        drop(questions);
        self.call();
        overtaken
    }

    /// All that is asked: the ranks take it up.
    pub(crate) fn take_questions(&self) -> Vec<Asked> {
        let mut questions = lock(&self.questions);
        let taken = std::mem::take(&mut questions.waiting);
        questions.taken_up = taken.iter().map(|asked| asked.client).collect();
        taken
    }

    /// Lets go of what a client wanted to know; returns what the ranks have not taken up.
    pub(crate) fn withdraw(&self, client: u64) -> Vec<Asked> {
        let mut questions = lock(&self.questions);
        questions.taken_up.retain(|&asker| asker != client);
        let waiting = std::mem::take(&mut questions.waiting);
        let (withdrawn, others) = waiting.into_iter().partition(|asked| asked.client == client);
        questions.waiting = others;
        withdrawn
    }

    /// Whether a client still wants to know what the ranks have taken up.
    pub(crate) fn is_wanted(&self, client: u64) -> bool {
        lock(&self.questions).taken_up.contains(&client)
    }

    /// Tells the solver's thread that there is something to look at.
    pub(crate) fn call(&self) {
        // Under the lock, so that a thread about to wait cannot miss it.
        let _held = lock(&self.waiting);
        self.attention.store(true, Ordering::Release);
        self.arrived.notify_all();
    }

    /// Tells the solver's thread that a viewer may steer from now on.
    pub(crate) fn drive(&self) {
        self.driven.store(true, Ordering::Release);
        self.call();
    }

    /// Whether there has been a viewer that may steer.
    pub(crate) fn is_driven(&self) -> bool {
        self.driven.load(Ordering::Acquire)
    }

    /// Whether there was a call since [`Queue::take`].
    #[inline]
    pub(crate) fn has_called(&self) -> bool {
        self.attention.load(Ordering::Acquire)
    }

    /// Whether the run is to stop as soon as what waits is looked at.
    pub(crate) fn has_stop(&self) -> bool {
        let is_stop = |received: &Received| matches!(received.command, Command::Stop {});
        lock(&self.waiting).iter().any(is_stop)
    }

    /// All that waits.
    pub(crate) fn take(&self) -> VecDeque<Received> {
        let mut waiting = lock(&self.waiting);
        self.attention.store(false, Ordering::Release);
        std::mem::take(&mut *waiting)
    }

    /// The pauses and stops that wait, and what ends a pause. The rest is left.
    pub(crate) fn take_pauses(&self) -> VecDeque<Received> {
        let mut waiting = lock(&self.waiting);
        self.attention.store(false, Ordering::Release);
        let (pauses, rest) = std::mem::take(&mut *waiting)
            .into_iter()
            .partition(|received| received.command.is_of_job());
        *waiting = rest;
        pauses
    }

    /// Does something with all that waits, and leaves it there.
    pub(crate) fn look(&self, look: impl FnMut(&Received)) {
        lock(&self.waiting).iter().for_each(look);
    }

    /// Waits for a call, `patience` at most; says whether there was one.
    pub(crate) fn wait(&self, patience: Duration) -> bool {
        let waiting = lock(&self.waiting);
        drop(self.arrived.wait_timeout_while(waiting, patience, |_| !self.has_called()));
        self.has_called()
    }
}
