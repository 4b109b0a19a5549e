//! The thread on which shapes are planned while the solver keeps stepping.
//!
//! It computes on threads of its own: were they the solver's, a solver would wait for the plan in its own loops. Orders come
//! first, then forecasts, then what is only made ready.

use std::{
    collections::VecDeque,
    num::NonZeroUsize,
    sync::{
        Arc, Condvar, Mutex, MutexGuard, PoisonError,
        mpsc::{Receiver, RecvError, Sender, TryRecvError, channel},
    },
    thread::JoinHandle,
};

use rayon::ThreadPool;
use tombolo_deform::quality::{Quality, quality};
use tombolo_pipelines::{
    language::DeformStage,
    shape::{Forecast, Plan},
};

use super::{
    planner::{Planner, Rejection, Wish},
    queue::Queue,
};

/// What the worker has to say.
pub(crate) enum Done {
    /// The quality of the reference mesh.
    Prepared(Box<Quality>),
    Planned(Box<Result<Plan, Rejection>>),
}

/// Takes the answer to a forecast, on the worker's thread.
pub(crate) type Answer = Box<dyn FnOnce(Forecast) + Send>;

/// A forecast that waits, and who asked for it.
struct Asked {
    asker: u64,
    wish: Wish,
    answer: Answer,
}

#[derive(Default)]
struct State {
    plans: VecDeque<Wish>,
    /// The newest of each asker.
    forecasts: VecDeque<Asked>,
    prepare: Option<DeformStage>,
    ahead: Option<Wish>,
    closed: bool,
}

enum Job {
    Plan(Wish),
    Forecast(Asked),
    Prepare(DeformStage),
    Ahead(Wish),
}

/// What there is to do.
#[derive(Default)]
pub(crate) struct Jobs {
    state: Mutex<State>,
    changed: Condvar,
}

impl Jobs {
    fn change(&self, change: impl FnOnce(&mut State)) {
        change(&mut lock(&self.state));
        self.changed.notify_one();
    }

    /// The most urgent job; waits for one. `None` once the worker is to end.
    fn next(&self) -> Option<Job> {
        let mut state = lock(&self.state);
        loop {
            if state.closed {
                return None;
            }
            let job = (state.plans.pop_front().map(Job::Plan))
                .or_else(|| state.forecasts.pop_front().map(Job::Forecast))
                .or_else(|| state.prepare.take().map(Job::Prepare))
                .or_else(|| state.ahead.take().map(Job::Ahead));
            if job.is_some() {
                return job;
            }
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Asks what a wish would come to, in place of what the same asker wanted to know before and was not told yet.
    pub(crate) fn forecast(&self, asker: u64, wish: Wish, answer: Answer) {
        self.change(|state| {
            state.forecasts.retain(|waiting| waiting.asker != asker);
            state.forecasts.push_back(Asked { asker, wish, answer });
        });
    }
}

/// The thread. It ends when this is dropped, after the job at hand.
pub(crate) struct Worker {
    jobs: Arc<Jobs>,
    done: Receiver<Done>,
    threads: Vec<JoinHandle<()>>,
}

impl Worker {
    /// Starts the thread; `queue` is called whenever it is done with something.
    pub(crate) fn start(planner: Arc<Mutex<Planner>>, queue: Arc<Queue>) -> std::io::Result<Self> {
        let (tell, done) = channel();
        // The core that the solver has not less of is left to it.
        let cores = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
        let pool = pool("tombolo-plan", cores.saturating_sub(1).max(1))?;
        let jobs = Arc::new(Jobs::default());
        let work = {
            let jobs = Arc::clone(&jobs);
            move || pool.install(|| work(&jobs, &planner, &tell, &queue))
        };
        let thread = std::thread::Builder::new().name("tombolo-shape".into()).spawn(work)?;
        Ok(Self { jobs, done, threads: vec![thread] })
    }

    /// Runs `work` beside everything else, on one more thread.
    pub(crate) fn beside(&mut self, work: impl FnOnce() + Send + 'static) -> std::io::Result<()> {
        let pool = pool("tombolo-beside", 1)?;
        let work = move || pool.install(work);
        self.threads.push(std::thread::Builder::new().name("tombolo-ready".into()).spawn(work)?);
        Ok(())
    }

    /// What can be asked of it from other threads.
    pub(crate) fn jobs(&self) -> &Arc<Jobs> {
        &self.jobs
    }

    /// Sets up the operator of the volume.
    pub(crate) fn prepare(&self, deform: DeformStage) {
        self.jobs.change(|state| state.prepare = Some(deform));
    }

    /// Makes a plan that will be asked for.
    pub(crate) fn look_ahead(&self, wish: Wish) {
        self.jobs.change(|state| state.ahead = Some(wish));
    }

    pub(crate) fn plan(&self, wish: Wish) {
        self.jobs.change(|state| state.plans.push_back(wish));
    }

    /// What is done, if anything is.
    pub(crate) fn try_take(&self) -> Option<Done> {
        match self.done.try_recv() {
            Ok(done) => Some(done),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => Some(gone()),
        }
    }

    /// What is done next; waits for it.
    pub(crate) fn take(&self) -> Done {
        self.done.recv().unwrap_or_else(|RecvError| gone())
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.jobs.change(|state| state.closed = true);
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}

fn work(jobs: &Jobs, planner: &Mutex<Planner>, tell: &Sender<Done>, queue: &Queue) {
    while let Some(job) = jobs.next() {
        let done = match job {
            Job::Plan(wish) => Done::Planned(Box::new(lock(planner).plan(&wish))),
            Job::Prepare(deform) => Done::Prepared(Box::new(prepare(planner, &deform))),
            Job::Forecast(Asked { wish, answer, .. }) => {
                let forecast = lock(planner).forecast(&wish);
                answer(forecast);
                continue;
            }
            Job::Ahead(wish) => {
                // Whoever asks for it is told what is wrong with it.
                let _ = lock(planner).plan(&wish);
                continue;
            }
        };
        if tell.send(done).is_err() {
            return;
        }
        queue.call();
    }
}

fn prepare(planner: &Mutex<Planner>, deform: &DeformStage) -> Quality {
    let mesh = {
        let mut planner = lock(planner);
        planner.prepare(deform);
        Arc::clone(planner.shaper().mesh())
    };
    quality(mesh.cells(), mesh.points())
}

fn pool(name: &'static str, threads: usize) -> std::io::Result<ThreadPool> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .thread_name(move |thread| format!("{name}-{thread}"))
        .build()
        .map_err(std::io::Error::other)
}

fn gone() -> Done {
    Done::Planned(Box::new(Err(Rejection::from("the thread that plans shapes has ended"))))
}

/// A panic in the kernel leaves at worst a cache without its entry.
pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
