//! The thread on which shapes are planned while the solver keeps stepping.

use std::{
    sync::{
        Arc, Mutex, PoisonError,
        mpsc::{Receiver, RecvError, Sender, TryRecvError, channel},
    },
    thread::JoinHandle,
};

use tombolo_deform::{
    quality::{Guard, Quality, quality},
    schedule::Schedule,
    surface::Edit,
    volume::Deform,
};
use tombolo_pipelines::shape::{Place, Plan, Refused, ShapeSeconds, Shaper};

use super::queue::Queue;

/// What a plan is made from.
#[derive(Debug, Clone)]
pub(crate) struct Wish {
    pub(crate) stack: Vec<Edit>,
    /// How many of them the present shape has already.
    pub(crate) kept: usize,
    pub(crate) start: Place,
    pub(crate) deform: Deform,
    pub(crate) schedule: Schedule,
    pub(crate) guard: Guard,
}

impl Wish {
    pub(crate) fn plan(&self, shaper: &Mutex<Shaper>) -> Result<Plan, Rejection> {
        // A panic in the kernel leaves at worst a cache without its entry.
        let mut shaper = shaper.lock().unwrap_or_else(PoisonError::into_inner);
        let plan =
            caught(|| shaper.reach(&self.stack, self.kept, &self.start, &self.deform, &self.schedule, &self.guard));
        plan.map_err(|rejection| Rejection { seconds: shaper.spent(), ..rejection })
    }
}

/// Why an order is not carried out, and what it took to find out.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Rejection {
    pub(crate) reason: String,
    /// What the way would have come down to, where the guard did not let it through.
    pub(crate) min_scaled_jacobian: Option<f64>,
    /// What fraction would have passed.
    pub(crate) fraction: Option<f64>,
    pub(crate) seconds: ShapeSeconds,
}

impl<T: ToString> From<T> for Rejection {
    fn from(reason: T) -> Self {
        Self { reason: reason.to_string(), min_scaled_jacobian: None, fraction: None, seconds: ShapeSeconds::default() }
    }
}

/// Runs a piece of the kernel so that a fault in it rejects one order instead of ending the solver.
pub(crate) fn caught<T>(attempt: impl FnOnce() -> Result<T, Refused>) -> Result<T, Rejection> {
    match std::panic::catch_unwind(std::panic::AssertUnwindSafe(attempt)) {
        Ok(result) => result.map_err(|refused| Rejection {
            min_scaled_jacobian: refused.min_scaled_jacobian(),
            fraction: refused.feasible_fraction(),
            ..Rejection::from(&refused)
        }),
        Err(panic) => {
            let message = panic
                .downcast_ref::<&str>()
                .map(|text| (*text).to_owned())
                .or_else(|| panic.downcast_ref::<String>().cloned())
                .unwrap_or_else(|| "no reason given".into());
            Err(Rejection::from(format!("the geometry kernel failed, which is a defect of it: {message}")))
        }
    }
}

enum Job {
    Prepare(Deform),
    Plan(Wish),
}

/// What the worker has to say.
pub(crate) enum Done {
    /// The quality of the reference mesh.
    Prepared(Box<Quality>),
    Planned(Box<Result<Plan, Rejection>>),
}

/// The thread. It ends when this is dropped, after the job at hand.
pub(crate) struct Worker {
    jobs: Option<Sender<Job>>,
    done: Receiver<Done>,
    thread: Option<JoinHandle<()>>,
}

impl Worker {
    /// Starts the thread; `queue` is called whenever it is done with something.
    pub(crate) fn start(shaper: Arc<Mutex<Shaper>>, queue: Arc<Queue>) -> std::io::Result<Self> {
        let (jobs, next) = channel();
        let (tell, done) = channel();
        let work = move || {
            for job in next {
                let message = match job {
                    Job::Prepare(deform) => Done::Prepared(Box::new(prepare(&shaper, &deform))),
                    Job::Plan(wish) => Done::Planned(Box::new(wish.plan(&shaper))),
                };
                if tell.send(message).is_err() {
                    return;
                }
                queue.call();
            }
        };
        let thread = std::thread::Builder::new().name("tombolo-shape".into()).spawn(work)?;
        Ok(Self { jobs: Some(jobs), done, thread: Some(thread) })
    }

    /// Sets up the operator of the volume.
    pub(crate) fn prepare(&self, deform: Deform) {
        self.send(Job::Prepare(deform));
    }

    pub(crate) fn plan(&self, wish: Wish) {
        self.send(Job::Plan(wish));
    }

    fn send(&self, job: Job) {
        if let Some(jobs) = &self.jobs {
            // A thread that is gone shows when its answer is asked for.
            let _ = jobs.send(job);
        }
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

fn gone() -> Done {
    Done::Planned(Box::new(Err(Rejection::from("the thread that plans shapes has ended"))))
}

fn prepare(shaper: &Mutex<Shaper>, deform: &Deform) -> Quality {
    let mut shaper = shaper.lock().unwrap_or_else(PoisonError::into_inner);
    let mesh = Arc::clone(shaper.mesh());
    // An operator that cannot be made is reported by the order that needs it.
    let _ = caught(|| shaper.prepare(deform));
    drop(shaper);
    quality(mesh.cells(), mesh.points())
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.jobs = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
