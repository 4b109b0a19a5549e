//! The shape of one mesh and the orders that change it.

mod handing;
mod recorded;
mod saved;
#[cfg(test)]
mod tests;
mod waiting;

use std::{
    collections::VecDeque,
    sync::{Arc, Mutex},
    time::{Duration, Instant},
};

use tombolo_deform::{
    mesh::{Domain, Mesh, Vector},
    quality::{Quality, quality},
    shape::{CurrentShape, Forecast, Plan, Shaper},
    surface::Surface,
};
use tombolo_pipelines::language::{HandedShape, Order};

use super::{
    Defaults, EditStack, Forecaster, Log, MeshMotion, OrderStatus, Queue, Reservation,
    SurfaceMotion,
    forecaster::{Planning, Present},
    lent::{Own, Rounding},
    planner::{PlanRequest, Planner, Rejection},
    stack::StackError,
    together::PlanTogether,
    worker::{Done, Worker},
};
use crate::{lock::lock, step::Moment};
use handing::{Motion, Pending};
use recorded::Recorded;
pub(crate) use saved::SavedSteering;

/// An order waiting for its turn.
struct Task {
    id: String,
    order: Order,
    background: bool,
    reservation: Option<Reservation>,
}

/// An order whose plan is being made.
struct Computing {
    id: String,
    /// The number of the plan.
    number: u64,
    order: Order,
    /// The settings of orders as they were when it was asked for.
    defaults: Defaults,
    stack: EditStack,
    asked: PlanRequest,
    /// Whether the mesh stays where it is until the plan is made, because the one before started
    /// elsewhere.
    resting: bool,
    /// The plan, which waits until the run is no longer paused.
    planned: Option<Plan>,
    background: bool,
    /// Given back when its turn has come.
    reservation: Option<Reservation>,
}

impl Computing {
    /// The order, to be planned anew.
    fn into_task(self) -> Task {
        let Self { id, order, background, reservation, .. } = self;
        Task { id, order, background, reservation }
    }
}

/// The shape of one mesh and the orders that change it.
pub(crate) struct Steerer {
    log: Arc<Log>,
    defaults: Defaults,
    planner: Arc<Mutex<Planner>>,
    worker: Option<Worker>,
    /// On several ranks, what they plan together.
    together: Option<Arc<PlanTogether>>,
    /// Whether the operator of the volume was set up, or is being set up.
    is_ready: bool,
    /// Extracts the skeleton, where an order could need it.
    skeleton: Option<Box<dyn FnOnce() + Send>>,
    /// The stack and the present shape once more, for other threads.
    present: Arc<Mutex<Present>>,
    /// Whether the next order of a file was looked ahead to from the present shape.
    looked_ahead: bool,
    stack: EditStack,
    here: CurrentShape,
    waiting: VecDeque<Task>,
    /// How long an order of a viewer may wait.
    deadline: Duration,
    /// Whether the run is paused: then plans are made, and no order begins to move the mesh.
    paused: bool,
    computing: Option<Computing>,
    motion: Option<Motion>,
    /// The motion that was handed out last.
    handed_out: MeshMotion,
    // Both here too, because the planner is locked as long as its thread is at work.
    domain: Domain,
    surface: Option<Arc<Surface>>,
    /// The coordinates that all shapes are measured from.
    reference: Arc<[Vector]>,
    rounding: Rounding,
    pending: Option<Pending>,
    /// The mesh as it was lent last, against the shape.
    own: Own,
    /// The shapes of the journal that is carried out again, in place of the schedules.
    recorded: Option<Recorded>,
    /// The quality of the present shape as far as it is known: least and mean scaled Jacobian.
    quality: Option<(f64, f64)>,
    reference_quality: Option<(f64, f64, usize)>,
}

impl Steerer {
    /// Takes over a mesh at its reference shape. `skeleton` says whether an order could drag the
    /// skeleton.
    ///
    /// On one process orders are planned on other threads. On several ranks no other thread could
    /// speak with them, so that orders are planned when their turn comes, on all ranks in the same
    /// call, and given up together ([`PlanTogether`]). Collective, as are [`Steerer::advance`] and
    /// whatever else makes plans.
    pub(crate) fn new(
        shaper: Shaper,
        defaults: Defaults,
        log: Arc<Log>,
        queue: Arc<Queue>,
        skeleton: bool,
    ) -> std::io::Result<Self> {
        let domain = shaper.domain().clone();
        if domain.communicator().size() > 1 {
            let quality = quality(domain.mesh().cells(), shaper.reference()).gathered(&domain);
            let together = PlanTogether::new(shaper.cancellation().clone(), queue);
            let mut steerer = Self::of_shaper(shaper, defaults, log);
            steerer.together = Some(Arc::new(together));
            steerer.reference_quality = Some((quality.min, quality.mean, quality.inverted));
            return Ok(steerer);
        }
        let in_advance = shaper.skeleton_in_advance().filter(|_| skeleton);
        let mut steerer = Self::of_shaper(shaper, defaults, log);
        let run = steerer.log.run();
        steerer.worker = Some(Worker::start(Arc::clone(&steerer.planner), queue, run)?);
        steerer.skeleton = in_advance.map(|extract| Box::new(extract) as Box<_>);
        Ok(steerer)
    }

    /// Sets up what no order changes, so that the first one need not wait for it: the operator of
    /// the volume and, where an order could need it, the skeleton. On one process another thread
    /// does. Without this the first order does. Collective.
    pub(crate) fn make_ready(&mut self) {
        if std::mem::replace(&mut self.is_ready, true) {
            return;
        }
        match &mut self.worker {
            Some(worker) => {
                worker.prepare(self.defaults.deform.clone());
                if let Some(Err(error)) = self.skeleton.take().map(|extract| worker.beside(extract))
                {
                    let run = self.log.run();
                    tracing::warn!(run, "the first drag will extract the skeleton: {error}");
                }
            }
            None => {
                if let Some(together) = &self.together {
                    together.run(None, || lock(&self.planner).prepare(&self.defaults.deform));
                }
            }
        }
    }

    /// Whether [`Steerer::make_ready`] was called.
    pub(crate) fn is_ready(&self) -> bool {
        self.is_ready
    }

    fn of_shaper(shaper: Shaper, defaults: Defaults, log: Arc<Log>) -> Self {
        let reference = Arc::clone(shaper.reference());
        let here: CurrentShape = Arc::clone(&reference).into();
        let domain = shaper.domain().clone();
        let surface = shaper.surface().cloned();
        let boundary = shaper.boundary_vertices().into();
        let rounding = Rounding::of(shaper.reference(), domain.communicator());
        let planner = Arc::new(Mutex::new(Planner::new(shaper)));
        let stack = EditStack::default();
        let present = Present {
            defaults: defaults.clone(),
            stack: stack.clone(),
            here: here.clone(),
            own: None,
        };
        let present = Arc::new(Mutex::new(present));
        Self {
            domain,
            surface,
            reference,
            rounding,
            pending: None,
            own: Own::default(),
            log,
            defaults,
            planner,
            worker: None,
            together: None,
            is_ready: false,
            skeleton: None,
            present,
            looked_ahead: false,
            stack,
            here,
            waiting: VecDeque::new(),
            deadline: Duration::MAX,
            paused: false,
            computing: None,
            motion: None,
            handed_out: MeshMotion {
                surface: SurfaceMotion { vertices: boundary, ..SurfaceMotion::default() },
                ..MeshMotion::default()
            },
            recorded: None,
            quality: None,
            reference_quality: None,
        }
    }

    /// Hands the shapes of a journal out, each at its cycle, whatever the schedules say.
    pub(crate) fn repeat(&mut self, shapes: Vec<HandedShape>) {
        self.recorded = Some(Recorded::new(shapes));
    }

    /// Hands the shapes of the end of a journal out again, each at its cycle; behind this cycle the
    /// schedules count.
    pub(crate) fn repeat_until(&mut self, shapes: Vec<HandedShape>, cycle: u64) {
        self.recorded = Some(Recorded::new(shapes).until(cycle));
    }

    /// Limits how long an order of a viewer may wait for its turn, where orders are planned beside
    /// the solver.
    pub(crate) fn set_deadline(&mut self, deadline: Duration) {
        self.deadline = deadline;
    }

    /// Gives orders that begin from now on other settings where they bring none.
    pub(crate) fn set_defaults(&mut self, defaults: &Defaults) {
        if self.defaults != *defaults {
            self.defaults.clone_from(defaults);
            lock(&self.present).defaults.clone_from(defaults);
            self.looked_ahead = false;
        }
    }

    /// The surface of the mesh, where this process has it.
    pub(crate) fn surface(&self) -> Option<Arc<Surface>> {
        self.surface.clone()
    }

    /// The reference mesh, or this rank's part of it, which shares its arrays.
    pub(crate) fn mesh(&self) -> Mesh {
        self.domain.mesh().clone()
    }

    /// A forecaster for other threads; `None` where the worker has ended.
    pub(crate) fn forecaster(&self) -> Option<Forecaster> {
        let planning = match &self.together {
            Some(together) => Planning::Together(Arc::clone(together)),
            None => Planning::Beside(Arc::clone(self.worker.as_ref()?.jobs())),
        };
        Some(Forecaster { present: Arc::clone(&self.present), planning })
    }

    /// The forecast of an order, made at once. Collective.
    pub(crate) fn forecast(&self, order: &Order) -> Forecast {
        match self.asked(order) {
            Ok((_, asked)) => {
                let forecast = || lock(&self.planner).forecast(&asked);
                match &self.together {
                    Some(together) => together.run(None, forecast),
                    None => forecast(),
                }
            }
            Err(error) => {
                let Rejection { reason, seconds, .. } = Rejection::from(error);
                Forecast::rejected(reason, None, None, seconds)
            }
        }
    }

    /// Has the plan of an order that will come made ahead, as far as it can be known now; once for
    /// each shape.
    pub(crate) fn look_ahead(&mut self, order: Option<&Order>) {
        let Some(order) =
            order.filter(|_| !self.looked_ahead && self.is_at_rest() && self.computing.is_none())
        else {
            return;
        };
        self.looked_ahead = true;
        // An order with a fault is refused at its own cycle, not here.
        if let (Some(worker), Ok((_, asked))) = (&self.worker, self.asked(order)) {
            worker.look_ahead(asked);
        }
    }

    fn asked(&self, order: &Order) -> Result<(EditStack, PlanRequest), StackError> {
        let (stack, request) = self.defaults.request(&self.stack, self.here.clone(), order)?;
        // A journal holds only what was let through with the motion that the solver had then.
        let own = self
            .own
            .offsets
            .clone()
            .filter(|_| self.recorded.as_ref().is_none_or(|it| !it.is_whole()));
        Ok((stack, PlanRequest { request, own }))
    }

    /// How many vertices the mesh has.
    pub(crate) fn vertex_count(&self) -> usize {
        self.here.points.len()
    }

    /// Whether nothing is under way and nothing waits.
    #[inline]
    pub(crate) fn is_at_rest(&self) -> bool {
        self.motion.is_none() && self.waiting.is_empty() && self.pending.is_none()
    }

    /// Whether it will compare the mesh as it is lent now with the shape that it was asked to have.
    pub(crate) fn looks_at_mesh(&self) -> bool {
        !self.is_at_rest() || self.computing.is_some()
    }

    pub(crate) fn stack(&self) -> &EditStack {
        &self.stack
    }

    /// The least and the mean scaled Jacobian of the present shape and its inverted elements, as
    /// far as they are known.
    pub(crate) fn quality(&self) -> Option<(f64, f64, usize)> {
        // A shape that passed the guard holds no inverted element; of a volume that is the solver's
        // nothing is known.
        let reference = self.reference_quality.filter(|_| !self.here.surface_only);
        self.quality.map(|(min, mean)| (min, mean, 0)).or(reference)
    }

    /// Puts an order into the queue, with the room that it takes there: at the end, or where a
    /// withdrawn one was.
    pub(crate) fn take(
        &mut self,
        id: String,
        order: Order,
        background: bool,
        reservation: Option<Reservation>,
        index: Option<usize>,
    ) {
        let background = background && self.worker.is_some();
        let index = index.unwrap_or(self.waiting.len()).min(self.waiting.len());
        self.waiting.insert(index, Task { id, order, background, reservation });
        self.say_why(index);
        self.say_why(index + 1);
    }

    /// Says what an order of the queue waits for, where it is another order.
    fn say_why(&self, index: usize) {
        let Some(task) = self.waiting.get(index) else { return };
        let before = match index.checked_sub(1).and_then(|index| self.waiting.get(index)) {
            Some(before) => Some(&before.id),
            None => self.computing.as_ref().map(|computing| &computing.id),
        };
        if let Some(before) = before {
            let reason = format!("order {before}, which came before it");
            self.log.update(&task.id, |order| order.waits_for = Some(reason));
        }
    }

    /// Takes an order out of the queue, or one that does not move the mesh yet, and returns its place
    /// in the queue; the error says that it moves the mesh already. `None` where it is neither.
    pub(crate) fn withdraw(&mut self, id: &str) -> Option<Result<usize, String>> {
        if let Some(index) = self.waiting.iter().position(|task| task.id == id) {
            self.waiting.remove(index);
            return Some(Ok(index));
        }
        if let Some(computing) = self.computing.take_if(|computing| computing.id == id) {
            if let Some(worker) = &self.worker {
                worker.cancel(computing.number);
            }
            return Some(Ok(0));
        }
        let motion = self.motion.as_ref().filter(|motion| motion.id == id)?;
        Some(Err(format!(
            "order '{id}' moves the mesh already (shape {} of {}), so that it cannot be taken back; an order {{\"undo\": 1}} goes back",
            motion.taken,
            motion.plan.shapes()
        )))
    }

    /// Brings orders as far as they can come now; says whether anything changed. Called at safe
    /// points only. On several ranks an order whose plan is given up waits again, in its place, and
    /// so do those behind it: the next call brings what it was given up for.
    pub(crate) fn advance(&mut self, moment: Moment, step_seconds: Option<f64>) -> bool {
        let mut changed = false;
        loop {
            changed |= self.collect(moment, step_seconds);
            if let Some(computing) = &self.computing {
                if self.paused {
                    return changed;
                }
                if computing.planned.is_some() {
                    self.begin_planned(moment, step_seconds);
                    changed = true;
                    continue;
                }
                // An order that must take effect at this cycle waits for the one before it.
                if self.waiting.iter().all(|task| task.background) {
                    return changed;
                }
                let done = self.worker.as_ref().map(Worker::take);
                if let Some(done) = done {
                    self.finish(done, moment, step_seconds);
                }
                changed = true;
                continue;
            }
            let Some(task) = self.waiting.pop_front() else { return changed };
            changed = true;
            if let Some(given_up) = self.start(task, moment, step_seconds) {
                self.waiting.push_front(given_up);
                return changed;
            }
        }
    }

    /// Takes what the worker has finished.
    fn collect(&mut self, moment: Moment, step_seconds: Option<f64>) -> bool {
        let mut changed = false;
        while let Some(done) = self.worker.as_ref().and_then(Worker::try_take) {
            self.finish(done, moment, step_seconds);
            changed = true;
        }
        changed
    }

    /// Has the shapes of an order found; of one that the ranks gave up meanwhile, the order.
    fn start(&mut self, task: Task, moment: Moment, step_seconds: Option<f64>) -> Option<Task> {
        let Task { id, order, background, reservation } = task;
        let (stack, asked) = match self.asked(&order) {
            Ok(asked) => asked,
            Err(error) => {
                self.log.reject(&id, moment, &error.into());
                return None;
            }
        };
        self.log.update(&id, |order| {
            order.status = OrderStatus::Computing;
            order.waits_for = None;
        });
        let defaults = self.defaults.clone();
        let mut computing = Computing {
            id,
            number: 0,
            order,
            defaults,
            stack,
            asked,
            resting: false,
            planned: None,
            background,
            reservation,
        };
        match &mut self.worker {
            Some(worker) if background => {
                computing.number = worker.plan(computing.asked.clone());
                self.computing = Some(computing);
            }
            worker => {
                let begun = Instant::now();
                let plan = match (worker, &self.together) {
                    (Some(worker), _) => worker.plan_here(&self.planner, &computing.asked),
                    (None, None) => lock(&self.planner).plan(&computing.asked),
                    (None, Some(together)) => {
                        // What a run has done before, nobody takes back.
                        let recorded = self.recorded.as_ref();
                        let is_repeated = recorded.is_some_and(|it| it.repeats(moment.cycle));
                        let id = (!is_repeated).then_some(&*computing.id);
                        let plan = || lock(&self.planner).plan(&computing.asked);
                        let plan = together.run(id, plan);
                        if plan.as_ref().is_err_and(|rejection| rejection.is_cancelled) {
                            return Some(computing.into_task());
                        }
                        plan
                    }
                };
                self.take_plan(computing, plan, moment, begun, step_seconds);
            }
        }
        None
    }

    fn finish(&mut self, done: Done, moment: Moment, step_seconds: Option<f64>) {
        match done {
            Done::Prepared(quality) => {
                let Quality { min, mean, inverted, .. } = *quality;
                self.reference_quality = Some((min, mean, inverted));
            }
            Done::Gone => {
                self.worker = None;
                if let Some(computing) = self.computing.take_if(|asked| asked.planned.is_none()) {
                    let gone = Rejection::from("the thread that plans shapes has ended");
                    self.log.reject(&computing.id, moment, &gone);
                }
            }
            Done::Planned(number, plan) => {
                // One that was cancelled counts no more.
                let Some(computing) = self.computing.take_if(|asked| asked.number == number) else {
                    return;
                };
                let is_stale = (*plan).as_ref().is_ok_and(|plan| !self.is_of_now(plan))
                    || computing.defaults != self.defaults;
                if is_stale && self.worker.is_some() {
                    return self.plan_anew(computing, moment);
                }
                self.take_plan(computing, *plan, moment, Instant::now(), step_seconds);
            }
        }
    }

    /// Has the plan of an order made from where the mesh is now. The worker may be at a forecast: the
    /// mesh waits for the plan, not the solver.
    fn plan_anew(&mut self, computing: Computing, moment: Moment) {
        let (stack, asked) = match self.asked(&computing.order) {
            Ok(asked) => asked,
            Err(error) => return self.log.reject(&computing.id, moment, &error.into()),
        };
        let Some(worker) = &mut self.worker else { return };
        let number = worker.plan(asked.clone());
        let defaults = self.defaults.clone();
        self.computing =
            Some(Computing { number, defaults, stack, asked, resting: true, ..computing });
    }

    /// Makes a plan the motion under way, or says why not.
    fn commit(
        &mut self,
        computing: Computing,
        plan: Result<Plan, Rejection>,
        moment: Moment,
        begun: Instant,
        step_seconds: Option<f64>,
    ) {
        let Computing { id, stack, asked, .. } = computing;
        let plan = match plan {
            Ok(plan) => plan,
            Err(rejection) => return self.log.reject(&id, moment, &rejection),
        };
        if let Some(before) = self.motion.take() {
            self.log.update(&before.id, |order| {
                order.status = OrderStatus::Applied;
                order.reason = Some(format!("order {id} went on from shape {}", before.taken));
            });
        }
        let fraction = plan.target().fraction;
        self.stack =
            if fraction < 1.0 { stack.clamped(asked.request.kept, fraction) } else { stack };
        self.looked_ahead = false;
        lock(&self.present).stack.clone_from(&self.stack);
        let clamped = (fraction < 1.0).then_some(fraction);
        self.log.begin(&id, moment, plan.min_scaled_jacobian(), clamped);
        self.log.update(&id, |order| {
            order.status = OrderStatus::Applying;
            order.cycle_applied = Some(moment.cycle);
            order.shapes = plan.shapes();
            order.min_scaled_jacobian = plan.min_scaled_jacobian();
            order.judged = Some(plan.judged());
            order.largest_displacement = Some(plan.largest_displacement());
            order.fraction = Some(fraction);
            order.seconds = plan.seconds();
            order.added_steps = step_seconds.map(|step| begun.elapsed().as_secs_f64() / step);
        });
        self.motion = Some(Motion {
            id,
            plan,
            guard: asked.request.guard,
            begun: moment,
            taken: 0.0,
            reached: 0.0,
        });
    }
}
