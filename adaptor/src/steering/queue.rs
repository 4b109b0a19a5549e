//! Commands on their way from the viewers' thread to the solver's.

use std::{
    collections::VecDeque,
    sync::{
        Condvar, Mutex,
        atomic::{AtomicBool, Ordering},
    },
};

use tombolo_pipelines::{
    language::{Command, Order},
    limits::{Exceeded, WAITING, WAITING_BYTES},
};

use super::Source;
use crate::lock::{lock, wait};

/// A command that was read, found valid and written to the journal.
#[derive(Debug)]
pub(crate) struct Received {
    pub(crate) source: Source,
    pub(crate) id: String,
    pub(crate) command: Command,
    /// How many bytes it came in.
    pub(crate) bytes: usize,
}

/// A forecast that a viewer asks for where only all ranks together can answer.
#[derive(Debug)]
pub(crate) struct Asked {
    pub(crate) client: u64,
    pub(crate) id: Option<String>,
    pub(crate) order: Box<Order>,
}

/// The queue. To look whether anything happened costs the solver one atomic load.
#[derive(Debug, Default)]
pub(crate) struct Queue {
    attention: AtomicBool,
    /// Whether there has been a viewer that may steer.
    driven: AtomicBool,
    waiting: Mutex<VecDeque<Received>>,
    questions: Mutex<Vec<Asked>>,
    arrived: Condvar,
}

impl Queue {
    /// Refuses one more of so many bytes where there is no room for it.
    pub(crate) fn check_room(&self, bytes: usize) -> Result<(), Exceeded> {
        let waiting = lock(&self.waiting);
        WAITING.check(waiting.len() + 1)?;
        WAITING_BYTES.check(
            waiting.iter().map(|received| received.bytes).sum::<usize>().saturating_add(bytes),
        )
    }

    pub(crate) fn push(&self, received: Received) {
        lock(&self.waiting).push_back(received);
        self.call();
    }

    /// Asks in place of what the same client asked before and was not told yet.
    pub(crate) fn ask(&self, asked: Asked) {
        let mut questions = lock(&self.questions);
        questions.retain(|waiting| waiting.client != asked.client);
        questions.push(asked);
        drop(questions);
        self.call();
    }

    /// All that is asked.
    pub(crate) fn take_questions(&self) -> Vec<Asked> {
        std::mem::take(&mut *lock(&self.questions))
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

    /// Does something with all that waits, and leaves it there.
    pub(crate) fn look(&self, look: impl FnMut(&Received)) {
        lock(&self.waiting).iter().for_each(look);
    }

    /// Returns once there was a call.
    pub(crate) fn wait(&self) {
        let mut waiting = lock(&self.waiting);
        while !self.has_called() {
            waiting = wait(&self.arrived, waiting);
        }
    }
}
