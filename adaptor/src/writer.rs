//! Writes files on a thread of its own.

use std::{
    collections::{HashMap, VecDeque, hash_map::Entry},
    num::NonZeroU32,
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex,
        mpsc::{Receiver, SyncSender, sync_channel},
    },
    thread::JoinHandle,
};

use tombolo_pipelines::{
    extract::Extract,
    files::{self, Database, Series},
    render::Picture,
    run::Table,
};

use crate::lock::lock;
use crate::table::OpenTable;

/// Files and rows that may wait to be written; the solver waits where the disk is slower than this.
const WAITING: usize = 2;
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
    /// A file of its own; of the pipeline only so many stay.
    Extract(Arc<Extract>, Option<NonZeroU32>),
    /// A picture of a step.
    Picture(Arc<Picture>, u64),
    /// A row of a table.
    Row(Arc<Table>, u64, Vec<f64>),
}

/// Starts its thread with the first file.
#[derive(Default)]
pub(crate) struct Writer {
    jobs: Option<SyncSender<Job>>,
    thread: Option<JoinHandle<()>>,
    faults: Arc<Mutex<Vec<String>>>,
    told: usize,
}

impl Writer {
    pub(crate) fn write(&mut self, job: Job) {
        if self.jobs.is_none() {
            let (jobs, next) = sync_channel(WAITING);
            let faults = Arc::clone(&self.faults);
            let spawned = std::thread::Builder::new()
                .name("tombolo-write".into())
                .spawn(move || work(&next, &faults));
            match spawned {
                Ok(thread) => (self.jobs, self.thread) = (Some(jobs), Some(thread)),
                Err(error) => {
                    return note(
                        &self.faults,
                        format!("{}: no thread to write it: {error}", job.path.display()),
                    );
                }
            }
        }
        if let Some(Err(lost)) = self.jobs.as_ref().map(|jobs| jobs.send(job)) {
            note(
                &self.faults,
                format!("{}: the thread that writes has ended", lost.0.path.display()),
            );
        }
    }

    /// Faults that were not told yet.
    pub(crate) fn faults(&mut self) -> Vec<String> {
        let faults = lock(&self.faults);
        let new = faults.get(self.told..).unwrap_or_default().to_vec();
        self.told = faults.len();
        new
    }

    /// Waits until all is written; all faults.
    pub(crate) fn finish(&mut self) -> Vec<String> {
        self.jobs = None;
        if self.thread.take().is_some_and(|thread| thread.join().is_err()) {
            note(&self.faults, "the thread that writes files has failed".into());
        }
        lock(&self.faults).clone()
    }
}

fn note(faults: &Mutex<Vec<String>>, fault: String) {
    let mut faults = lock(faults);
    if faults.len() < FAULTS {
        faults.push(fault);
    }
}

/// The files written so far.
#[derive(Default)]
struct Written {
    /// Of each pipeline.
    files: HashMap<Arc<str>, Files>,
    /// Databases of pictures, by path.
    databases: HashMap<PathBuf, Database>,
    /// By path; `None` where a table cannot be written, which has been told.
    tables: HashMap<PathBuf, Option<OpenTable>>,
}

/// The files that a pipeline has written: its first file, and the series once there is a second.
enum Files {
    One(PathBuf, f64),
    Many(Series),
    /// The newest ones, the oldest first.
    Kept(VecDeque<(PathBuf, f64)>),
}

fn work(jobs: &Receiver<Job>, faults: &Mutex<Vec<String>>) {
    let mut written = Written::default();
    while let Ok(job) = jobs.recv() {
        let outcome = match &job.content {
            Content::Extract(extract, keep) => written.extract(&job, extract, *keep),
            Content::Picture(picture, cycle) => written.draw(&job, picture, *cycle),
            Content::Row(table, cycle, values) => written.row(&job, table, *cycle, values),
        };
        if let Err(fault) = outcome {
            note(faults, fault);
        }
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
        keep: Option<NonZeroU32>,
    ) -> Result<(), String> {
        files::write(&job.path, extract).map_err(told)?;
        let series = || {
            let directory = job.path.parent().unwrap_or(Path::new("."));
            directory.join(format!("{}.pvd", job.pipeline))
        };
        if let Some(keep) = keep {
            let files = self.files.entry(Arc::clone(&job.pipeline));
            let files = files.or_insert_with(|| Files::Kept(VecDeque::new()));
            if !matches!(files, Files::Kept(_)) {
                // The pipeline was replaced: what it wrote before all stays.
                *files = Files::Kept(VecDeque::new());
            }
            let Files::Kept(kept) = files else { return Ok(()) };
            if kept.back().is_some_and(|(path, _)| *path == job.path) {
                kept.pop_back();
            }
            kept.push_back((job.path.clone(), job.time));
            let mut gone = Vec::new();
            while kept.len() > keep.get() as usize {
                gone.extend(kept.pop_front());
            }
            // The series never names a file that is not there.
            if kept.len() > 1 || !gone.is_empty() {
                let shown = kept.iter().map(|(path, time)| (*time, &**path));
                Series::of(&series(), shown).map_err(told)?;
            }
            return gone.iter().try_for_each(|(path, _)| files::remove(path).map_err(told));
        }
        match self.files.get_mut(&job.pipeline) {
            None => {
                let first = Files::One(job.path.clone(), job.time);
                self.files.insert(Arc::clone(&job.pipeline), first);
            }
            Some(Files::One(path, _)) if *path == job.path => {}
            Some(Files::One(path, time)) => {
                let mut series = Series::create(&series()).map_err(told)?;
                series.push(*time, path).map_err(told)?;
                series.push(job.time, &job.path).map_err(told)?;
                self.files.insert(Arc::clone(&job.pipeline), Files::Many(series));
            }
            Some(Files::Many(series)) => series.push(job.time, &job.path).map_err(told)?,
            Some(Files::Kept(kept)) => {
                // The pipeline was replaced: from now on all stay.
                let kept = kept.iter().map(|(path, time)| (*time, &**path));
                let mut all = Series::of(&series(), kept).map_err(told)?;
                all.push(job.time, &job.path).map_err(told)?;
                self.files.insert(Arc::clone(&job.pipeline), Files::Many(all));
            }
        }
        Ok(())
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
        let Some(opened) = open else { return Ok(()) };
        opened.push(cycle, job.time, row).map_err(|fault| {
            *open = None;
            format!("{}: {fault}", job.path.display())
        })
    }

    /// Writes a picture to its file, or adds it to its database, which the first of a run begins.
    fn draw(&mut self, job: &Job, picture: &Picture, cycle: u64) -> Result<(), String> {
        if job.path.extension().is_none_or(|extension| extension != "cdb") {
            return files::write_picture(&job.path, &picture.image).map_err(told);
        }
        if !self.databases.contains_key(&job.path) {
            let database = Database::create(&job.path).map_err(told)?;
            self.databases.insert(job.path.clone(), database);
        }
        match self.databases.get_mut(&job.path) {
            Some(database) => database.push(cycle, job.time, picture).map_err(told),
            None => Ok(()),
        }
    }
}
