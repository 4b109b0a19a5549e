//! Writes files on a thread of its own.

use std::{
    collections::HashMap,
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex,
        mpsc::{Receiver, SyncSender, sync_channel},
    },
    thread::JoinHandle,
};

use tombolo_pipelines::{
    extract::Extract,
    files::{self, Series},
};

use crate::lock::lock;

/// Extracts that may wait to be written; the solver waits where the disk is slower than this.
const WAITING: usize = 2;
/// Faults that are kept.
const FAULTS: usize = 100;

struct Job {
    pipeline: Arc<str>,
    path: PathBuf,
    time: f64,
    extract: Arc<Extract>,
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
    pub(crate) fn write(
        &mut self,
        pipeline: &Arc<str>,
        path: PathBuf,
        time: f64,
        extract: Arc<Extract>,
    ) {
        let job = Job { pipeline: Arc::clone(pipeline), path, time, extract };
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

/// The files that a pipeline has written: its first file, and the series once there is a second.
enum Written {
    One(PathBuf, f64),
    Many(Series),
}

fn work(jobs: &Receiver<Job>, faults: &Mutex<Vec<String>>) {
    let mut written: HashMap<Arc<str>, Written> = HashMap::new();
    while let Ok(job) = jobs.recv() {
        if let Err(fault) = write(&job, &mut written) {
            note(faults, fault);
        }
    }
}

fn write(job: &Job, written: &mut HashMap<Arc<str>, Written>) -> Result<(), String> {
    let told = |error: files::FileError| error.to_string();
    files::write(&job.path, &job.extract).map_err(told)?;
    match written.get_mut(&job.pipeline) {
        None => {
            written.insert(Arc::clone(&job.pipeline), Written::One(job.path.clone(), job.time));
        }
        Some(Written::One(path, _)) if *path == job.path => {}
        Some(Written::One(path, time)) => {
            let directory = path.parent().unwrap_or(Path::new("."));
            let mut series =
                Series::create(&directory.join(format!("{}.pvd", job.pipeline))).map_err(told)?;
            series.push(*time, path).map_err(told)?;
            series.push(job.time, &job.path).map_err(told)?;
            written.insert(Arc::clone(&job.pipeline), Written::Many(series));
        }
        Some(Written::Many(series)) => series.push(job.time, &job.path).map_err(told)?,
    }
    Ok(())
}
