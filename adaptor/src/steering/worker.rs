//! The thread on which shapes are planned while the solver keeps stepping.
//!
//! It computes on threads of its own: were they the solver's, a solver would wait for the plan in
//! its own loops. Orders come first, then forecasts, then what is only made ready.

use std::{
    collections::VecDeque,
    num::NonZeroUsize,
    sync::{
        Arc, Condvar, Mutex,
        mpsc::{Receiver, Sender, TryRecvError, channel},
    },
    thread::JoinHandle,
    time::{Duration, Instant},
};

use rayon::ThreadPool;
use tombolo_deform::cancellation::Cancellation;
use tombolo_deform::quality::{Quality, quality};
use tombolo_deform::shape::{Forecast, Plan};
use tombolo_pipelines::language::Deformation;

use super::{
    planner::{PlanRequest, Planner, Rejection},
    queue::Queue,
};

use crate::{
    allocator::give_back_freed,
    lock::{lock, wait},
};

/// A message of the worker.
pub(crate) enum Done {
    /// The quality of the reference mesh.
    Prepared(Box<Quality>),
    /// The plan of this number.
    Planned(u64, Box<Result<Plan, Rejection>>),
    /// The thread has ended.
    Gone,
}

/// How long the end of a run waits for a thread that is at work.
const END: Duration = Duration::from_secs(2);

/// Takes the answer to a forecast, on the worker's thread, or why there is none, on any thread.
pub(crate) type Answer = Box<dyn FnOnce(Result<Forecast, &'static str>) + Send>;

/// After how long a forecast is given up once its asker wants to know something else. One that takes less
/// is finished: whoever asks at every move of a handle hears of one after the other.
const LONG: Duration = Duration::from_secs(2);

/// Why a forecast is not answered.
pub(crate) const OVERTAKEN: &str =
    "a later forecast of the same client has taken the place of this one";
/// Why a forecast is not answered that its asker has taken back.
pub(crate) const WITHDRAWN: &str = "the client has withdrawn this forecast";
const GONE: &str = "the mesh whose shape could be changed is gone";

/// A forecast that waits, and who asked for it.
struct Question {
    asker: u64,
    asked: PlanRequest,
    answer: Answer,
}

/// The forecast that is next or being found.
struct ForecastUnderWay {
    asker: u64,
    asked: PlanRequest,
    /// Since when the kernel is at it: before that another thread may have the kernel.
    begun: Option<Instant>,
    given_up: Option<GivenUp>,
}

/// Why a forecast is given up.
#[derive(Clone, Copy)]
enum GivenUp {
    /// An order comes first: the forecast is begun anew after it.
    Delayed,
    /// Its asker wants to know something else.
    Overtaken,
    /// Its asker has taken it back, or is gone.
    Withdrawn,
}

/// The jobs that wait, by how urgent they are.
#[derive(Default)]
struct WaitingJobs {
    plans: VecDeque<(u64, PlanRequest)>,
    /// The number of the plan that is being made.
    at_plan: Option<u64>,
    /// The newest of each asker.
    forecasts: VecDeque<Question>,
    at_forecast: Option<ForecastUnderWay>,
    prepare: Option<Deformation>,
    ahead: Option<PlanRequest>,
    /// Whether another thread makes a plan, or waits to: no forecast is begun before it.
    is_planned_elsewhere: bool,
    /// Whatever is asked for is given up.
    gives_up: bool,
    closed: bool,
}

enum Job {
    Plan(u64, PlanRequest),
    Forecast(Question),
    Prepare(Deformation),
    Ahead(PlanRequest),
}

/// The jobs of the worker.
pub(crate) struct Jobs {
    state: Mutex<WaitingJobs>,
    changed: Condvar,
    /// Gives up what the kernel is at.
    cancellation: Cancellation,
}

/// Another thread makes a plan until this is dropped.
struct Elsewhere<'a>(&'a Jobs);

impl Drop for Elsewhere<'_> {
    fn drop(&mut self) {
        self.0.change(|state| state.is_planned_elsewhere = false);
    }
}

impl Jobs {
    fn change<T>(&self, change: impl FnOnce(&mut WaitingJobs) -> T) -> T {
        let changed = change(&mut lock(&self.state));
        self.changed.notify_one();
        changed
    }

    /// The most urgent job; waits for one. `None` once the worker is to end.
    fn next(&self) -> Option<Job> {
        let mut state = lock(&self.state);
        loop {
            if state.closed {
                return None;
            }
            state.at_plan = state.plans.front().map(|(number, _)| *number);
            if !state.gives_up {
                self.cancellation.renew();
            }
            let job = (state.plans.pop_front().map(|(number, asked)| Job::Plan(number, asked)))
                .or_else(|| {
                    let is_free = !state.is_planned_elsewhere;
                    is_free.then(|| state.forecasts.pop_front().map(Job::Forecast)).flatten()
                })
                .or_else(|| state.prepare.take().map(Job::Prepare))
                .or_else(|| state.ahead.take().map(Job::Ahead));
            if let Some(job) = job {
                if let Job::Forecast(Question { asker, asked, .. }) = &job {
                    let (asker, asked) = (*asker, asked.clone());
                    let underway = ForecastUnderWay { asker, asked, begun: None, given_up: None };
                    state.at_forecast = Some(underway);
                }
                return Some(job);
            }
            state = wait(&self.changed, state);
        }
    }

    /// Gives up the plan of this number; it is answered by a rejection, or not at all.
    fn cancel(&self, number: u64) {
        let mut state = lock(&self.state);
        state.plans.retain(|(waiting, _)| *waiting != number);
        if state.at_plan == Some(number) {
            self.cancellation.cancel();
        }
    }

    /// Has a plan of this number made, before all forecasts but the one under way whose shape it takes.
    fn plan(&self, number: u64, asked: PlanRequest) {
        self.change(|state| {
            self.give_forecast_up(state, GivenUp::Delayed, |underway| {
                underway.given_up.is_none() && !underway.asked.is(&asked)
            });
            state.plans.push_back((number, asked));
        });
    }

    /// Notes that the kernel is at the forecast from now on; whether it is still wanted. Whoever calls it has
    /// the planner.
    fn begin_forecast(&self) -> bool {
        let mut state = lock(&self.state);
        if !state.gives_up {
            self.cancellation.renew();
        }
        match &mut state.at_forecast {
            Some(underway) if underway.given_up.is_none() => {
                underway.begun = Some(Instant::now());
                true
            }
            _ => false,
        }
    }

    /// Notes that the kernel is at the forecast no more; why it was given up, if it was. Whoever calls it has
    /// the planner.
    fn end_forecast(&self) -> Option<GivenUp> {
        lock(&self.state).at_forecast.take().and_then(|underway| underway.given_up)
    }

    /// Gives up the forecast under way, if it is one of these.
    fn give_forecast_up(
        &self,
        state: &mut WaitingJobs,
        why: GivenUp,
        is_meant: impl FnOnce(&ForecastUnderWay) -> bool,
    ) {
        if let Some(underway) = state.at_forecast.as_mut().filter(|it| is_meant(it)) {
            underway.given_up = Some(why);
            if underway.begun.is_some() {
                self.cancellation.cancel();
            }
        }
    }

    /// Gives up the forecasts of an asker who has taken them back, or is gone, and says so.
    pub(crate) fn withdraw(&self, asker: u64) {
        // Told once the lock is free.
        let withdrawn: VecDeque<Question> = self.change(|state| {
            self.give_forecast_up(state, GivenUp::Withdrawn, |underway| underway.asker == asker);
            let (withdrawn, others) =
                state.forecasts.drain(..).partition(|waiting| waiting.asker == asker);
            state.forecasts = others;
            withdrawn
        });
        for Question { answer, .. } in withdrawn {
            answer(Err(WITHDRAWN));
        }
    }

    /// Answers a question with what was found, unless it was given up.
    fn answer(&self, question: Question, found: Result<Forecast, GivenUp>) {
        // Told once the lock is free.
        let (question, told) = {
            let mut state = lock(&self.state);
            let is_overtaken = state.forecasts.iter().any(|it| it.asker == question.asker);
            match found {
                Ok(forecast) => (question, Ok(forecast)),
                Err(GivenUp::Delayed) if state.closed => (question, Err(GONE)),
                Err(GivenUp::Delayed) if !is_overtaken => {
                    return state.forecasts.push_front(question);
                }
                Err(GivenUp::Delayed | GivenUp::Overtaken) => (question, Err(OVERTAKEN)),
                Err(GivenUp::Withdrawn) => (question, Err(WITHDRAWN)),
            }
        };
        (question.answer)(told);
    }

    /// Makes way for a plan that another thread is about to make, as for one of the worker's own.
    fn begin_elsewhere(&self, asked: &PlanRequest) -> Elsewhere<'_> {
        self.change(|state| {
            state.is_planned_elsewhere = true;
            self.give_forecast_up(state, GivenUp::Delayed, |underway| {
                underway.given_up.is_none() && !underway.asked.is(asked)
            });
        });
        Elsewhere(self)
    }

    /// Lets a plan go on that another thread makes while this one has no plan under way: what was
    /// cancelled before it is over.
    fn renew(&self) {
        let mut state = lock(&self.state);
        state.at_plan = None;
        if !state.gives_up {
            self.cancellation.renew();
        }
    }

    /// Whether the plan of this number is still the one under way.
    fn are_at(&self, number: u64) -> bool {
        lock(&self.state).at_plan == Some(number)
    }

    /// Gives up whatever is under way, and what will be asked for from now on.
    pub(crate) fn give_up(&self) {
        self.change(|state| {
            state.gives_up = true;
            self.cancellation.cancel();
        });
    }

    /// Asks for a forecast, in place of what the same asker wanted to know before and was not told
    /// yet.
    pub(crate) fn forecast(&self, asker: u64, asked: PlanRequest, answer: Answer) {
        let question = Question { asker, asked, answer };
        // Told once the lock is free.
        let unanswered = self.change(|state| {
            if state.closed {
                return Some((question, GONE));
            }
            let before = state.forecasts.iter().position(|waiting| waiting.asker == asker);
            let overtaken = before.and_then(|index| state.forecasts.remove(index));
            state.forecasts.push_back(question);
            self.give_forecast_up(state, GivenUp::Overtaken, |underway| {
                underway.asker == asker
                    && underway.given_up.is_none()
                    && underway.begun.is_some_and(|begun| begun.elapsed() >= LONG)
            });
            overtaken.map(|overtaken| (overtaken, OVERTAKEN))
        });
        if let Some((Question { answer, .. }, why)) = unanswered {
            answer(Err(why));
        }
    }

    /// Has the thread end, and tells those whose forecasts have not begun.
    fn close(&self) {
        self.give_up();
        let waiting = self.change(|state| {
            state.closed = true;
            std::mem::take(&mut state.forecasts)
        });
        for Question { answer, .. } in waiting {
            answer(Err(GONE));
        }
    }
}

/// The thread. It ends when this is dropped; the job at hand is given up.
pub(crate) struct Worker {
    jobs: Arc<Jobs>,
    /// How many plans were asked for.
    plans: u64,
    done: Receiver<Done>,
    threads: Vec<JoinHandle<()>>,
    /// The number of the run.
    run: Option<String>,
}

impl Worker {
    /// Starts the thread of a run; `queue` is called whenever it is done with something.
    pub(crate) fn start(
        planner: Arc<Mutex<Planner>>,
        queue: Arc<Queue>,
        run: Option<&str>,
    ) -> std::io::Result<Self> {
        let (tell, done) = channel();
        // The core that the solver has not less of is left to it.
        let cores = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
        let pool = pool("tombolo-plan", cores.saturating_sub(1).max(1))?;
        let cancellation = lock(&planner).shaper().cancellation().clone();
        let jobs = Jobs { state: Mutex::default(), changed: Condvar::new(), cancellation };
        let jobs = Arc::new(jobs);
        let work = {
            let jobs = Arc::clone(&jobs);
            move || pool.install(|| work(&jobs, &planner, &tell, &queue))
        };
        let thread = std::thread::Builder::new().name("tombolo-shape".into()).spawn(work)?;
        let run = run.map(str::to_owned);
        Ok(Self { jobs, plans: 0, done, threads: vec![thread], run })
    }

    /// Runs `work` beside everything else, on one more thread.
    pub(crate) fn beside(&mut self, work: impl FnOnce() + Send + 'static) -> std::io::Result<()> {
        let pool = pool("tombolo-beside", 1)?;
        let work = move || {
            pool.install(work);
            give_back_freed();
        };
        self.threads.push(std::thread::Builder::new().name("tombolo-ready".into()).spawn(work)?);
        Ok(())
    }

    /// The jobs of the worker, which other threads may add to.
    pub(crate) fn jobs(&self) -> &Arc<Jobs> {
        &self.jobs
    }

    /// Sets up the operator of the volume.
    pub(crate) fn prepare(&self, deform: Deformation) {
        self.jobs.change(|state| state.prepare = Some(deform));
    }

    /// Makes a plan that will be asked for.
    pub(crate) fn look_ahead(&self, asked: PlanRequest) {
        self.jobs.change(|state| state.ahead = Some(asked));
    }

    /// Has a plan made; tells its number.
    pub(crate) fn plan(&mut self, asked: PlanRequest) -> u64 {
        self.plans += 1;
        self.jobs.plan(self.plans, asked);
        self.plans
    }

    /// Gives up the plan of this number, whose answer counts no more.
    pub(crate) fn cancel(&self, number: u64) {
        self.jobs.cancel(number);
    }

    /// Makes a plan at once, on this thread, after what the worker is at.
    pub(crate) fn plan_here(
        &self,
        planner: &Mutex<Planner>,
        asked: &PlanRequest,
    ) -> Result<Plan, Rejection> {
        let _elsewhere = self.jobs.begin_elsewhere(asked);
        let mut planner = lock(planner);
        self.jobs.renew();
        planner.plan(asked)
    }

    /// The next finished job, if there is one.
    pub(crate) fn try_take(&self) -> Option<Done> {
        match self.done.try_recv() {
            Ok(done) => Some(done),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => Some(Done::Gone),
        }
    }

    /// Waits for the next finished job.
    pub(crate) fn take(&self) -> Done {
        self.done.recv().unwrap_or(Done::Gone)
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.jobs.close();
        let until = Instant::now() + END;
        while !self.threads.iter().all(JoinHandle::is_finished) {
            if Instant::now() >= until {
                // What it is at cannot be given up, such as the set-up of an operator. It hands
                // nothing to anybody any more, and ends with the process at the latest.
                let run = self.run.as_deref();
                tracing::warn!(
                    run,
                    "a thread that finds shapes is still at work; it is left behind"
                );
                return;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}

fn work(jobs: &Jobs, planner: &Mutex<Planner>, tell: &Sender<Done>, queue: &Queue) {
    while let Some(job) = jobs.next() {
        let done = match job {
            Job::Plan(number, asked) => {
                let mut planner = lock(planner);
                // It was cancelled while another thread made a plan.
                if !jobs.are_at(number) {
                    continue;
                }
                Done::Planned(number, Box::new(planner.plan(&asked)))
            }
            Job::Prepare(deform) => Done::Prepared(Box::new(prepare(planner, &deform))),
            Job::Forecast(question) => {
                let found = {
                    let mut planner = lock(planner);
                    let forecast = jobs.begin_forecast().then(|| planner.forecast(&question.asked));
                    match (forecast, jobs.end_forecast()) {
                        (Some(forecast), None) => Ok(forecast),
                        (_, given_up) => Err(given_up.unwrap_or(GivenUp::Delayed)),
                    }
                };
                jobs.answer(question, found);
                continue;
            }
            Job::Ahead(asked) => {
                // Whoever asks for it is told what is wrong with it.
                let _ = lock(planner).plan(&asked);
                continue;
            }
        };
        if tell.send(done).is_err() {
            return;
        }
        queue.call();
    }
}

fn prepare(planner: &Mutex<Planner>, deform: &Deformation) -> Quality {
    let mesh = {
        let mut planner = lock(planner);
        planner.prepare(deform);
        planner.shaper().mesh().clone()
    };
    let quality = quality(mesh.cells(), mesh.points());
    // From here on the run may wait for its first order for ever.
    give_back_freed();
    quality
}

fn pool(name: &'static str, threads: usize) -> std::io::Result<ThreadPool> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .thread_name(move |thread| format!("{name}-{thread}"))
        .build()
        .map_err(std::io::Error::other)
}

#[cfg(test)]
mod tests;
