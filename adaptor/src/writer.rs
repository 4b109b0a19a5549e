//! Writes files on a thread of its own.

mod series;

use std::{
    collections::{HashMap, hash_map::Entry},
    path::PathBuf,
    sync::{
        Arc, Mutex,
        atomic::{AtomicU64, Ordering},
        mpsc::{Receiver, SyncSender, TrySendError, sync_channel},
    },
    thread::JoinHandle,
    time::{Duration, Instant},
};

use tombolo_pipelines::{
    extract::Extract,
    files::{self, Database},
    render::Picture,
    run::Table,
};

use crate::lock::lock;
use crate::step::Moment;
use crate::table::OpenTable;
use series::AllSeries;
pub(crate) use series::Membership;

/// Files and rows that may wait to be written; the solver waits where the disk is slower than this.
const WAITING: usize = 2;
/// How long it waits for a disk that finishes no file meanwhile.
const PATIENCE: Duration = Duration::from_secs(if cfg!(test) { 1 } else { 60 });
/// Faults that are kept.
const FAULTS: usize = 100;

/// A file that a pipeline asks for.
pub(crate) struct Job {
    pub(crate) pipeline: Arc<str>,
    pub(crate) path: PathBuf,
    pub(crate) time: f64,
    pub(crate) content: Content,
}

/// The content of a file.
pub(crate) enum Content {
    /// A file of its own, and the series that it belongs to, where each step has another file.
    Extract(Arc<Extract>, Option<Membership>),
    /// A picture of a step.
    Picture(Arc<Picture>, u64),
    /// A row of a table.
    Row(Arc<Table>, u64, Vec<f64>),
}

/// What the thread is asked for.
enum Task {
    Write(Job),
    /// To let go of this, once all before it is written.
    Answer(SyncSender<()>),
}

/// Starts its thread with the first file.
#[derive(Default)]
pub(crate) struct Writer {
    tasks: Option<SyncSender<Task>>,
    thread: Option<JoinHandle<()>>,
    faults: Arc<Mutex<Vec<String>>>,
    /// How many tasks the thread has come to the end of.
    done: Arc<AtomicU64>,
    /// How many it had when it was last waited for in vain.
    hangs_at: Option<u64>,
    told: usize,
    since: Option<Moment>,
}

impl Writer {
    /// Lets series and databases go on as they were at this moment, where they are there.
    pub(crate) fn resume(&mut self, since: Moment) {
        self.since = Some(since);
    }

    pub(crate) fn write(&mut self, job: Job) {
        if self.tasks.is_none() {
            let (tasks, next) = sync_channel(WAITING);
            let (faults, since) = (Arc::clone(&self.faults), self.since);
            let done = Arc::clone(&self.done);
            let spawned = std::thread::Builder::new()
                .name("tombolo-write".into())
                .spawn(move || work(&next, &faults, &done, since));
            match spawned {
                Ok(thread) => (self.tasks, self.thread) = (Some(tasks), Some(thread)),
                Err(error) => {
                    return note(
                        &self.faults,
                        format!("{}: no thread to write it: {error}", job.path.display()),
                    );
                }
            }
        }
        let Some(tasks) = &self.tasks else { return };
        let path = job.path.clone();
        let (done, was_hanging) = (&*self.done, self.hangs_at.take());
        let mut sent = tasks.try_send(Task::Write(job));
        let mut waiting = Waiting::new(done);
        while let Err(TrySendError::Full(task)) = sent {
            let hangs = was_hanging == Some(waiting.done()) || waiting.is_in_vain();
            if hangs {
                self.hangs_at = Some(waiting.done());
                let path = path.display();
                return note(&self.faults, format!("{path}: it was not written: {HANGS}"));
            }
            std::thread::sleep(Duration::from_millis(1));
            sent = tasks.try_send(task);
        }
        if sent.is_err() {
            let path = path.display();
            note(&self.faults, format!("{path}: the thread that writes has ended"));
        }
    }

    /// Waits until all that was given so far is written, at most so long.
    pub(crate) fn flush(&self, longest: Duration) {
        let Some(tasks) = &self.tasks else { return };
        let until = Instant::now() + longest;
        let (answer, answered) = sync_channel(0);
        let mut sent = tasks.try_send(Task::Answer(answer));
        while let Err(TrySendError::Full(task)) = sent {
            if Instant::now() > until {
                return;
            }
            std::thread::sleep(Duration::from_millis(1));
            sent = tasks.try_send(task);
        }
        // The thread may have ended, which is told where files are written.
        if sent.is_err() {
            return;
        }
        // It is never sent: the thread lets go of it.
        let _ = answered.recv_timeout(until.saturating_duration_since(Instant::now()));
    }

    /// Faults that were not told yet.
    pub(crate) fn faults(&mut self) -> Vec<String> {
        let faults = lock(&self.faults);
        let new = faults.get(self.told..).unwrap_or_default().to_vec();
        self.told = faults.len();
        new
    }

    /// Waits until all is written, unless the disk hangs; all faults.
    pub(crate) fn finish(&mut self) -> Vec<String> {
        self.tasks = None;
        if let Some(thread) = self.thread.take() {
            let mut waiting = Waiting::new(&self.done);
            while !thread.is_finished() && !waiting.is_in_vain() {
                std::thread::sleep(Duration::from_millis(1));
            }
            if !thread.is_finished() {
                // It ends with the process.
                note(&self.faults, format!("the last files were not written: {HANGS}"));
            } else if thread.join().is_err() {
                note(&self.faults, "the thread that writes files has failed".into());
            }
        }
        lock(&self.faults).clone()
    }
}

/// The reason for which files are left out while the disk hangs.
const HANGS: &str = "the disk has finished nothing for a minute";

/// How long a thread has come to the end of nothing.
struct Waiting<'a> {
    done: &'a AtomicU64,
    seen: u64,
    since: Instant,
}

impl<'a> Waiting<'a> {
    fn new(done: &'a AtomicU64) -> Self {
        Self { done, seen: done.load(Ordering::Relaxed), since: Instant::now() }
    }

    fn done(&self) -> u64 {
        self.done.load(Ordering::Relaxed)
    }

    /// Whether nothing has come to its end for [`PATIENCE`].
    fn is_in_vain(&mut self) -> bool {
        if self.done() != self.seen {
            *self = Self::new(self.done);
        }
        self.since.elapsed() > PATIENCE
    }
}

fn note(faults: &Mutex<Vec<String>>, fault: String) {
    let mut faults = lock(faults);
    if faults.len() < FAULTS {
        faults.push(fault);
    }
}

/// The files written so far.
struct Written {
    series: AllSeries,
    /// Databases of pictures, by path.
    databases: HashMap<PathBuf, Database>,
    /// By path; `None` where a table cannot be begun, which has been told.
    tables: HashMap<PathBuf, Option<OpenTable>>,
    /// The cycle of the checkpoint that the run went on from.
    since: Option<u64>,
}

fn work(
    tasks: &Receiver<Task>,
    faults: &Mutex<Vec<String>>,
    done: &AtomicU64,
    since: Option<Moment>,
) {
    let mut written = Written {
        series: AllSeries::new(since.map(|since| since.time)),
        databases: HashMap::new(),
        tables: HashMap::new(),
        since: since.map(|since| since.cycle),
    };
    while let Ok(task) = tasks.recv() {
        let job = match task {
            Task::Write(job) => job,
            Task::Answer(answer) => {
                drop(answer);
                continue;
            }
        };
        let outcome = match &job.content {
            Content::Extract(extract, membership) => {
                written.extract(&job, extract, membership.as_ref())
            }
            Content::Picture(picture, cycle) => written.draw(&job, picture, *cycle),
            Content::Row(table, cycle, values) => written.row(&job, table, *cycle, values),
        };
        if let Err(fault) = outcome {
            note(faults, fault);
        }
        done.fetch_add(1, Ordering::Relaxed);
    }
}

fn told(error: files::FileError) -> String {
    error.to_string()
}

impl Written {
    fn extract(
        &mut self,
        job: &Job,
        extract: &Extract,
        membership: Option<&Membership>,
    ) -> Result<(), String> {
        files::write(&job.path, extract).map_err(told)?;
        let Some(membership) = membership else { return Ok(()) };
        self.series.add(&job.pipeline, membership, &job.path, job.time).map_err(told)
    }

    fn row(&mut self, job: &Job, table: &Table, cycle: u64, row: &[f64]) -> Result<(), String> {
        let open = match self.tables.entry(job.path.clone()) {
            Entry::Occupied(open) => open.into_mut(),
            Entry::Vacant(place) => {
                let opened = OpenTable::open(&job.path, table);
                let (open, fault) = match opened {
                    Ok(open) => (Some(open), Ok(())),
                    Err(fault) => (None, Err(fault)),
                };
                let open = place.insert(open);
                fault?;
                open
            }
        };
        let Some(open) = open else { return Ok(()) };
        open.push(cycle, job.time, row).map_err(|fault| format!("{}: {fault}", job.path.display()))
    }

    /// Writes a picture to its file, or adds it to its database. The first of a run begins the
    /// database; after a restart it goes on.
    fn draw(&mut self, job: &Job, picture: &Picture, cycle: u64) -> Result<(), String> {
        if job.path.extension().is_none_or(|extension| extension != "cdb") {
            return files::write_picture(&job.path, &picture.image).map_err(told);
        }
        if !self.databases.contains_key(&job.path) {
            let database = match self.since {
                Some(cycle) => Database::resume(&job.path, cycle),
                None => Database::create(&job.path),
            };
            let database = database.map_err(told)?;
            self.databases.insert(job.path.clone(), database);
        }
        match self.databases.get_mut(&job.path) {
            Some(database) => database.push(cycle, job.time, picture).map_err(told),
            None => Ok(()),
        }
    }
}

#[cfg(all(test, unix))]
mod tests;
