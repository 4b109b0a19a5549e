//! The thread that writes a journal, and what waits for it.
//!
//! All lines that have come while it wrote the ones before are written together and are on disk
//! together. Where writing fails, lines are kept, up to a limit, and written once it goes on.

use std::{
    collections::VecDeque,
    path::Path,
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    thread::JoinHandle,
    time::{Duration, Instant},
};

use tombolo_pipelines::{
    language::{CheckpointNote, JournalEntry, JournalNote, LostLines, OrderStatus, RunHeader},
    limits::{DOCUMENT, Exceeded, VALUES, WAITING, WAITING_BYTES},
};

use super::{
    JournalError,
    store::{Append, Store},
};
use crate::lock::lock;

/// Bytes of lines that nobody waits for and that are kept while nothing can be written, or while the
/// disk takes longer than [`PATIENCE`]. Lines about checkpoints, without which a restart does not find
/// what came after, are kept up to twice as many.
const KEPT: usize = 4 << 20;
/// How long a disk may take before the journal counts as lost.
const PATIENCE: Duration = Duration::from_secs(2);
/// How long a journal that cannot be written is left alone.
const PAUSE: Duration = Duration::from_millis(500);
/// How long lines that nobody waits for are gathered, so that a run which moves its mesh at every step
/// does not have the disk busy with it.
const GATHERED: Duration = Duration::from_millis(200);
/// How long the end of a run waits for the disk.
const END: Duration = Duration::from_secs(2);

/// The outcome of a line that somebody waits for: it is on disk, or the reason why it will not be.
type Outcome = Result<(), String>;

/// Called once, on any thread.
type Settle = Box<dyn FnOnce(Outcome) + Send>;
/// Called with the reason when the journal is lost, and with `None` when it goes on.
type Tell = Box<dyn Fn(Option<&str>) + Send + Sync>;

/// A journal being written, or none. Dropping it writes what is left, if the disk lets it.
pub(crate) struct Journal {
    shared: Option<Arc<Shared>>,
    thread: Mutex<Option<JoinHandle<()>>>,
}

struct Shared {
    state: Mutex<Waiting>,
    changed: Condvar,
    tell: Tell,
    /// The number of the run.
    run: String,
}

/// A line that is not on disk yet.
struct Line {
    text: Vec<u8>,
    /// Who waits for it; and the line that takes it back, should they have been told that it is not
    /// written and then it is.
    asked: Option<(Settle, Vec<u8>)>,
    /// Somebody waited for it, and does not any more.
    is_withdrawn: bool,
}

#[derive(Default)]
struct Waiting {
    lines: VecDeque<Line>,
    /// The lines that are being written, and since when.
    under_way: Vec<Line>,
    since: Option<Instant>,
    bytes: usize,
    /// The bytes among these of lines that nobody has ever waited for.
    kept: usize,
    asked: usize,
    /// Lines that could not be kept.
    lost: u64,
    /// Why nothing can be written.
    trouble: Option<String>,
    is_closed: bool,
    has_ended: bool,
}

impl Journal {
    /// No journal: every line is let go.
    pub(crate) fn none() -> Self {
        Self { shared: None, thread: Mutex::default() }
    }

    /// Goes on with the journal of a file, or begins it, with the first line of a run. `tell` is
    /// called when the journal is lost, and when it goes on.
    pub(crate) fn open(
        path: &Path,
        first: RunHeader,
        tell: impl Fn(Option<&str>) + Send + Sync + 'static,
    ) -> Result<Self, JournalError> {
        let mut store = Store::open(path)?;
        let run = first.id.clone();
        store
            .append(&line(&JournalNote::Run(first)))
            .map_err(|source| JournalError::Write { path: path.into(), source })?;
        Self::start(store, run, tell)
    }

    fn start(
        store: impl Append,
        run: String,
        tell: impl Fn(Option<&str>) + Send + Sync + 'static,
    ) -> Result<Self, JournalError> {
        let shared = Arc::new(Shared {
            state: Mutex::default(),
            changed: Condvar::new(),
            tell: Box::new(tell),
            run,
        });
        let writing = Arc::clone(&shared);
        let thread = std::thread::Builder::new()
            .name("tombolo-journal".into())
            .spawn(move || writing.write_until_closed(store))
            .map_err(JournalError::Thread)?;
        Ok(Self { shared: Some(shared), thread: Mutex::new(Some(thread)) })
    }

    /// Hands a line over to be written. Never waits.
    pub(crate) fn write(&self, entry: &JournalEntry) {
        self.push(line(entry));
    }

    /// Hands a line over to be written, unless nobody who reads the journal would take it. Never
    /// waits.
    ///
    /// # Errors
    /// The limit that it exceeds.
    pub(crate) fn try_write(&self, entry: &JournalEntry) -> Result<(), Exceeded> {
        if !self.is_kept() {
            return Ok(());
        }
        let text = line(entry);
        check(&text)?;
        self.push(text);
        Ok(())
    }

    /// Hands a line about the run over to be written. Never waits.
    pub(crate) fn note(&self, note: &JournalNote) {
        self.push(line(note));
    }

    /// Hands a line about a checkpoint over to be written, and returns once it and all before it are
    /// on disk: after two seconds at the latest, and at once while nothing can be written. It stays
    /// where it is among the lines until it is written.
    pub(crate) fn checkpoint(&self, note: CheckpointNote) {
        let Some(shared) = &self.shared else { return };
        let text = line(&JournalNote::Checkpoint(note));
        let mut state = lock(&shared.state);
        if (state.trouble.is_some() || state.is_slow()) && state.kept + text.len() > 2 * KEPT {
            state.lost += 1;
        } else {
            state.push(Line { text, asked: None, is_withdrawn: false });
        }
        drop(state);
        self.wait();
    }

    /// Returns once all lines so far are on disk and whoever waits for one of them has heard of it:
    /// after two seconds at the latest, and at once while nothing can be written.
    pub(crate) fn wait(&self) {
        let Some(shared) = &self.shared else { return };
        let (done, written) = std::sync::mpsc::channel();
        let mut state = lock(&shared.state);
        if state.trouble.is_some() || state.is_closed {
            return;
        }
        let settle: Settle = Box::new(move |_| {
            let _ = done.send(());
        });
        // It has no text of its own, and none that takes it back.
        let asked = Some((settle, Vec::new()));
        state.push(Line { text: Vec::new(), asked, is_withdrawn: false });
        shared.changed.notify_all();
        drop(state);
        if written.recv_timeout(END).is_err() {
            let run = &*shared.run;
            tracing::warn!(
                run,
                "the disk does not answer: the journal's last lines are not on it yet"
            );
        }
    }

    /// Whether there is a journal.
    pub(crate) fn is_kept(&self) -> bool {
        self.shared.is_some()
    }

    fn push(&self, text: Vec<u8>) {
        let Some(shared) = &self.shared else { return };
        let mut state = lock(&shared.state);
        // A disk that is well takes a moment too, for a long line more than for a short one.
        if (state.trouble.is_some() || state.is_slow()) && state.kept + text.len() > KEPT {
            state.lost += 1;
            return;
        }
        state.push(Line { text, asked: None, is_withdrawn: false });
        shared.changed.notify_all();
    }

    /// Has a line written, and `settle` called once it is on disk, or once it is known that it will
    /// not be. Without a journal that is at once.
    pub(crate) fn ask(&self, entry: &JournalEntry, settle: impl FnOnce(Outcome) + Send + 'static) {
        let Some(shared) = &self.shared else { return settle(Ok(())) };
        let taken_back = JournalEntry {
            status: OrderStatus::Rejected,
            command: None,
            by: None,
            reason: Some("it was refused: the journal took too long to write it".into()),
            ..entry.clone()
        };
        let (text, taken_back) = (line(entry), line(&taken_back));
        // Numbers may take more letters than they came in.
        if let Err(exceeded) = check(&text) {
            return settle(Err(format!("{exceeded}, in its line of the journal")));
        }
        let mut state = lock(&shared.state);
        let room = WAITING
            .check(state.asked + 1)
            .and_then(|()| WAITING_BYTES.check(state.bytes + text.len()));
        let refused = match (&state.trouble, room) {
            (Some(reason), _) => reason.clone(),
            (None, Err(exceeded)) => format!("{exceeded}, that wait to be written to the journal"),
            (None, Ok(())) => {
                let asked = Some((Box::new(settle) as Settle, taken_back));
                state.push(Line { text, asked, is_withdrawn: false });
                shared.changed.notify_all();
                return;
            }
        };
        drop(state);
        settle(Err(refused));
    }

    /// Finds out whether the disk takes too long, and refuses what waits for it then. To be called a
    /// few times a second by somebody who does not wait for the disk.
    pub(crate) fn look_at_time(&self) {
        let Some(shared) = &self.shared else { return };
        let mut state = lock(&shared.state);
        if state.trouble.is_some() || !state.is_slow() {
            return;
        }
        let reason = format!("the disk has not answered for {} seconds", PATIENCE.as_secs());
        state.trouble = Some(reason.clone());
        let refused = state.withdraw(true);
        drop(state);
        (shared.tell)(Some(&reason));
        refused.into_iter().for_each(|settle| settle(Err(reason.clone())));
    }

    /// Why nothing can be written, or that lines are missing.
    pub(crate) fn lost(&self) -> Option<String> {
        let state = lock(&self.shared.as_ref()?.state);
        let missing = (state.lost > 0).then(|| format!("{} lines are missing", state.lost));
        state.trouble.clone().or(missing)
    }

    /// Waits until all lines are on disk, two seconds at most, and ends the thread. No line is
    /// written afterwards.
    pub(crate) fn close(&self) {
        let Some(shared) = &self.shared else { return };
        let Some(thread) = lock(&self.thread).take() else { return };
        let mut state = lock(&shared.state);
        state.is_closed = true;
        shared.changed.notify_all();
        if thread.thread().id() == std::thread::current().id() {
            // Whoever waited for a line was the last to hold this; the thread ends by itself.
            return;
        }
        let until = Instant::now() + END;
        while !state.has_ended {
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                tracing::warn!(
                    run = &*shared.run,
                    "the journal's last {} lines are not on disk: {}",
                    state.lines.len() + state.under_way.len(),
                    state.trouble.as_deref().unwrap_or("the disk does not answer")
                );
                // The thread hangs in the system; it ends with the process.
                return;
            }
            state = shared.wait(state, left);
        }
        drop(state);
        let _ = thread.join();
    }
}

impl Drop for Journal {
    fn drop(&mut self) {
        self.close();
    }
}

impl Line {
    /// Whether nobody has ever waited for it.
    fn is_kept(&self) -> bool {
        self.asked.is_none() && !self.is_withdrawn
    }
}

impl Waiting {
    fn push(&mut self, line: Line) {
        self.bytes += line.text.len();
        self.kept += if line.is_kept() { line.text.len() } else { 0 };
        self.asked += usize::from(line.asked.is_some());
        self.lines.push_back(line);
    }

    fn has_nothing_to_write(&self) -> bool {
        self.lines.is_empty() && self.lost == 0
    }

    /// Whether the disk has not answered for too long.
    fn is_slow(&self) -> bool {
        self.since.is_some_and(|since| since.elapsed() >= PATIENCE)
    }

    /// Those who wait, who are to be told that it was in vain. What they asked for is not written
    /// any more; what is being written is taken back by another line where `may_succeed`.
    fn withdraw(&mut self, may_succeed: bool) -> Vec<Settle> {
        let mut refused = Vec::new();
        let mut taken_back = Vec::new();
        for line in &mut self.under_way {
            if let Some((settle, back)) = line.asked.take() {
                refused.push(settle);
                taken_back.push(back);
                line.is_withdrawn = true;
            }
        }
        for mut line in std::mem::take(&mut self.lines) {
            match line.asked.take() {
                Some((settle, _)) => {
                    self.bytes -= line.text.len();
                    refused.push(settle);
                }
                None => self.lines.push_back(line),
            }
        }
        for text in taken_back.into_iter().filter(|_| may_succeed) {
            self.push(Line { text, asked: None, is_withdrawn: false });
        }
        self.asked = 0;
        refused
    }
}

impl Shared {
    /// Waits for a change, for so long at most.
    fn wait<'a>(&self, state: MutexGuard<'a, Waiting>, time: Duration) -> MutexGuard<'a, Waiting> {
        self.changed.wait_timeout(state, time).unwrap_or_else(PoisonError::into_inner).0
    }

    fn write_until_closed(&self, mut store: impl Append) {
        let mut state = lock(&self.state);
        let mut last: Option<Instant> = None;
        loop {
            while state.has_nothing_to_write() && state.trouble.is_none() && !state.is_closed {
                state = crate::lock::wait(&self.changed, state);
            }
            if state.has_nothing_to_write() && state.is_closed {
                break;
            }
            let until = last.map(|last| last + GATHERED);
            while state.asked == 0 && !state.is_closed {
                let left = until.map(|until| until.saturating_duration_since(Instant::now()));
                match left.filter(|left| !left.is_zero()) {
                    Some(left) => state = self.wait(state, left),
                    None => break,
                }
            }
            let lost = state.lost;
            let mut text = Vec::with_capacity(state.bytes);
            state.under_way = std::mem::take(&mut state.lines).into();
            state.under_way.iter().for_each(|line| text.extend(&line.text));
            // Where nothing is left of what could not be written, this finds out whether it goes on.
            if lost > 0 || text.is_empty() && state.trouble.is_some() {
                text.extend(line(&JournalNote::Lost(LostLines { lines: lost })));
            }
            state.since = Some(Instant::now());
            last = state.since;
            let is_last = state.is_closed;
            drop(state);
            let written = store.append(&text);
            state = lock(&self.state);
            state.since = None;
            let lines = std::mem::take(&mut state.under_way);
            let was_lost = state.trouble.take();
            let (settled, trouble) = match written {
                Ok(()) => {
                    state.lost -= lost;
                    state.bytes -= lines.iter().map(|line| line.text.len()).sum::<usize>();
                    let kept = lines.iter().filter(|line| line.is_kept());
                    state.kept -= kept.map(|line| line.text.len()).sum::<usize>();
                    let asked = lines.into_iter().filter_map(|line| line.asked);
                    let settled: Vec<Settle> = asked.map(|(settle, _)| settle).collect();
                    state.asked -= settled.len();
                    (settled, None)
                }
                Err(reason) => {
                    let reason = reason.to_string();
                    // Those who wait are refused; the other lines are for the next time.
                    state.under_way = lines;
                    let refused = state.withdraw(false);
                    let kept = std::mem::take(&mut state.under_way).into_iter();
                    let (withdrawn, kept): (Vec<_>, Vec<_>) =
                        kept.partition(|line| line.is_withdrawn);
                    state.bytes -= withdrawn.iter().map(|line| line.text.len()).sum::<usize>();
                    kept.into_iter().rev().for_each(|line| state.lines.push_front(line));
                    state.trouble = Some(reason.clone());
                    (refused, Some(reason))
                }
            };
            drop(state);
            match (&was_lost, &trouble) {
                (Some(_), None) => (self.tell)(None),
                (before, Some(now)) if before.as_ref() != Some(now) => (self.tell)(Some(now)),
                _ => {}
            }
            let outcome = trouble.clone().map_or(Ok(()), Err);
            settled.into_iter().for_each(|settle| settle(outcome.clone()));
            state = lock(&self.state);
            if trouble.is_some() {
                // Once it is closed it is tried once more.
                if is_last {
                    break;
                }
                let until = Instant::now() + PAUSE;
                while !state.is_closed && Instant::now() < until {
                    let left = until.saturating_duration_since(Instant::now());
                    state = self.wait(state, left);
                }
            }
        }
        if !state.lines.is_empty() {
            let path = store.path().display();
            tracing::warn!(
                run = &*self.run,
                %path,
                "the journal {path} lacks its last {} lines: {}",
                state.lines.len(),
                state.trouble.as_deref().unwrap_or("")
            );
        }
        state.has_ended = true;
        self.changed.notify_all();
    }
}

/// A line of JSON. What a journal holds has text keys alone and cannot fail.
fn line(of: &impl serde::Serialize) -> Vec<u8> {
    let mut line = serde_json::to_vec(of).unwrap_or_default();
    line.push(b'\n');
    line
}

/// Whether a line is one that is read: a run that goes on, or a replay, reads it with the limits of a
/// document.
fn check(line: &[u8]) -> Result<(), Exceeded> {
    DOCUMENT.check(line.len())?;
    // A value begins a list or an object, or follows a comma.
    let begins = |letter: &&u8| matches!(letter, b',' | b'[' | b'{');
    VALUES.check(line.iter().filter(begins).count() + 1)
}

#[cfg(test)]
mod tests;
