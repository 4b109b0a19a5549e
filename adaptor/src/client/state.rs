//! What a client's thread and its owner share: events that nobody has read, commands that nobody
//! has answered.

use std::{
    collections::{BTreeSet, HashMap, VecDeque},
    sync::{Arc, Condvar, Mutex},
    time::{Duration, Instant},
};

use tokio::sync::Notify;
use tombolo_pipelines::encode::DecodedFrame;

use super::{ClientError, End, Event, Hello, Received, Role, Status};
use crate::lock::lock;

/// Texts that wait to be read, and their bytes; beyond either the oldest make way.
const TEXTS: usize = 4096;
const BYTES: usize = 1 << 28;
/// Frames that wait to be read; beyond it the oldest make way.
const FRAMES: usize = 64;
/// Commands that wait for an answer, and their bytes.
const COMMANDS: usize = 256;
const COMMAND_BYTES: usize = 1 << 28;
/// Choices of views that wait to be sent; beyond it the oldest make way.
const CHOICES: usize = 256;
/// The id under which the wheel is asked for again.
const WHEEL: &str = "wheel";
/// How long the wheel is asked for again: longer than a server takes to see that a connection is gone.
const REGAIN: Duration = Duration::from_secs(45);

/// A command that was not answered yet.
pub(super) struct Pending {
    pub(super) id: String,
    pub(super) text: String,
    /// Whether it was sent over the connection there is.
    pub(super) is_sent: bool,
}

/// A frame that waits to be read.
struct Waiting {
    frame: Received,
    connection: u64,
}

#[derive(Default)]
pub(super) struct State {
    texts: VecDeque<Received>,
    bytes: usize,
    frames: VecDeque<Waiting>,
    pub(super) hello: Option<Arc<Hello>>,
    pub(super) status: Option<Arc<Status>>,
    pub(super) end: Option<End>,
    pub(super) pending: VecDeque<Pending>,
    /// The number of the connection there is.
    pub(super) connection: u64,
    /// Frames of this connection that were read or made way.
    pub(super) taken: u64,
    /// Whether this client has driven, and takes the wheel again after a lost connection.
    pub(super) drives: bool,
    /// Until when the wheel is asked for again, before any command is sent.
    regain: Option<Instant>,
    /// The name under which this client drove.
    former: Option<String>,
    pub(super) missed: u64,
    /// The questions that somebody waits for, and their answers: whoever reads events meanwhile does
    /// not take these.
    pub(super) asked: HashMap<String, Option<Event>>,
    /// The names of the views whose frames are wanted; all where that is `None`.
    pub(super) chosen: Option<BTreeSet<String>>,
    /// The choices that were not sent yet, the oldest first.
    pub(super) choices: VecDeque<Option<BTreeSet<String>>>,
    /// Why nothing comes any more.
    pub(super) failure: Option<ClientError>,
    pub(super) closing: bool,
}

/// The state that the client and its connection's thread share.
#[derive(Default)]
pub(super) struct Shared {
    state: Mutex<State>,
    changed: Condvar,
    /// Wakes the client's thread.
    pub(super) wake: Notify,
}

impl Shared {
    /// Reads or changes what is shared, and wakes whoever waits for it.
    pub(super) fn with<T>(&self, change: impl FnOnce(&mut State) -> T) -> T {
        let done = change(&mut lock(&self.state));
        self.changed.notify_all();
        done
    }

    /// Waits until `look` finds something, `patience` at most.
    pub(super) fn wait<T>(
        &self,
        patience: Duration,
        mut look: impl FnMut(&mut State) -> Option<T>,
    ) -> Option<T> {
        // So far away that no clock ends before.
        let until = Instant::now() + patience.min(Duration::from_secs(1 << 30));
        let mut state = lock(&self.state);
        loop {
            if let Some(found) = look(&mut state) {
                return Some(found);
            }
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return None;
            }
            let waited = self.changed.wait_timeout(state, left);
            state = waited.unwrap_or_else(std::sync::PoisonError::into_inner).0;
        }
    }

    /// Takes a command to be sent.
    pub(super) fn send(&self, pending: Pending) -> Result<(), ClientError> {
        self.with(|state| {
            if let Some(failure) = &state.failure {
                return Err(failure.clone());
            }
            let bytes = state.pending.iter().map(|pending| pending.text.len()).sum::<usize>();
            let found = bytes + pending.text.len();
            if found > COMMAND_BYTES {
                let what = "bytes of commands without an answer";
                return Err(ClientError::TooMuch { what, found, most: COMMAND_BYTES });
            }
            if state.pending.len() >= COMMANDS {
                let (what, found) = ("commands without an answer", state.pending.len() + 1);
                return Err(ClientError::TooMuch { what, found, most: COMMANDS });
            }
            state.pending.push_back(pending);
            Ok(())
        })?;
        self.wake.notify_one();
        Ok(())
    }

    /// The next event, the texts before the frames.
    pub(super) fn next(&self, patience: Duration) -> Result<Option<Received>, ClientError> {
        let next = self.wait(patience, |state| match state.take() {
            Some(told) => Some(Ok(told)),
            None => state.failure.clone().map(Err),
        });
        if matches!(&next, Some(Ok(told)) if matches!(told.event, Event::Frame(_))) {
            self.wake.notify_one();
        }
        next.transpose()
    }
}

impl State {
    fn take(&mut self) -> Option<Received> {
        if let Some(told) = self.texts.pop_front() {
            self.bytes -= told.text.len();
            return Some(told);
        }
        let Waiting { frame, connection } = self.frames.pop_front()?;
        self.taken += u64::from(connection == self.connection);
        Some(frame)
    }

    /// Takes an event in: what it tells is known from here on, and what it answers is answered.
    pub(super) fn put(&mut self, event: Event, text: &str) {
        match &event {
            Event::Hello(hello) => {
                if hello.role == Role::Driver {
                    self.drives = true;
                    self.regain = None;
                    self.pending.retain(|pending| pending.id != WHEEL);
                }
                self.hello = Some(Arc::new((**hello).clone()));
                self.texts.retain(|told| !matches!(told.event, Event::Hello(_)));
            }
            Event::Parameters(told) => {
                if let Some(hello) = &mut self.hello {
                    for parameter in &mut Arc::make_mut(hello).parameters {
                        let value = told.values.get(&parameter.name);
                        parameter.value = value.copied().unwrap_or(parameter.value);
                    }
                }
                self.texts.retain(|told| !matches!(told.event, Event::Parameters(_)));
            }
            Event::Status(status) => {
                self.status = Some(Arc::new((**status).clone()));
                self.texts.retain(|told| !matches!(told.event, Event::Status(_)));
            }
            Event::End(end) => self.end = Some(end.clone()),
            _ => {}
        }
        if let Some(id) = event.answers() {
            self.pending.retain(|pending| pending.id != id);
            if id == WHEEL {
                // It is asked for again, or the commands that wait are refused with the reason.
                return;
            }
        }
        if let Some(answer) = event.answers().and_then(|id| self.asked.get_mut(id)) {
            *answer = Some(event);
            return;
        }
        self.bytes = self.texts.iter().map(|told| told.text.len()).sum::<usize>() + text.len();
        self.texts.push_back(Received { event, text: text.into() });
        while self.texts.len() > TEXTS || self.bytes > BYTES && self.texts.len() > 1 {
            let monitor = self.texts.iter().position(|t| matches!(t.event, Event::Monitor(_)));
            if let Some(gone) = self.texts.remove(monitor.unwrap_or(0)) {
                self.bytes -= gone.text.len();
            }
            self.missed += 1;
        }
    }

    /// Takes a choice of views in.
    pub(super) fn choose(&mut self, names: Option<BTreeSet<String>>) {
        self.chosen.clone_from(&names);
        if self.choices.len() >= CHOICES {
            self.choices.pop_front();
        }
        self.choices.push_back(names);
    }

    /// Takes a frame in.
    pub(super) fn put_frame(&mut self, frame: DecodedFrame) {
        let frame = Received { event: Event::Frame(frame.into()), text: "".into() };
        self.frames.push_back(Waiting { frame, connection: self.connection });
        if self.frames.len() > FRAMES {
            if let Some(Waiting { connection, .. }) = self.frames.pop_front() {
                self.taken += u64::from(connection == self.connection);
            }
            self.missed += 1;
        }
    }

    /// Begins a connection: what was not answered is sent again, but for orders that the run knows.
    pub(super) fn begin(&mut self, hello: &Hello) {
        self.connection += 1;
        self.taken = 0;
        // A run sends all views until it is told.
        self.choices = self.chosen.clone().map(Some).into_iter().collect();
        self.former = self.hello.as_ref().map(|hello| hello.client.clone());
        let regains = self.drives && hello.role == Role::Watcher;
        self.regain = regains.then(|| Instant::now() + REGAIN);
        self.pending.retain(|pending| hello.orders.iter().all(|order| order.id != pending.id));
        self.pending.iter_mut().for_each(|pending| pending.is_sent = false);
    }

    /// Asks for the wheel again after a lost connection: a server may take a while to see that the
    /// old one is gone. Given up where somebody else drives.
    pub(super) fn regain(&mut self) {
        let Some(until) = self.regain else { return };
        let driver = self.status.as_ref().and_then(|status| status.driver.as_ref());
        if Instant::now() >= until || driver.is_some() && driver != self.former.as_ref() {
            self.regain = None;
        } else if self.pending.iter().all(|pending| pending.id != WHEEL) {
            let text = format!(r#"{{"id": "{WHEEL}", "drive": {{}}}}"#);
            self.pending.push_front(Pending { id: WHEEL.into(), text, is_sent: false });
        }
    }

    /// The commands that were not sent over this connection.
    pub(super) fn unsent(&mut self) -> Vec<String> {
        let waits = self.regain.is_some();
        let is_next = |pending: &&mut Pending| !pending.is_sent && (!waits || pending.id == WHEEL);
        let unsent = self.pending.iter_mut().filter(is_next);
        unsent
            .map(|pending| {
                pending.is_sent = true;
                pending.text.clone()
            })
            .collect()
    }
}
