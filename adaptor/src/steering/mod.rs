//! From orders to mesh motion.
//!
//! Orders are carried out one after the other, in the order in which they came in. Each is planned from the shape that the mesh
//! has when its turn comes: if an earlier order's schedule is still under way then, its remaining shapes are dropped and the new
//! motion starts where the mesh is. Nothing is lost by that, because shapes are measured from the reference: the new target
//! holds the earlier order's edits too (or not, if the new order takes it back). If the new order is refused, the schedule under
//! way goes on as if nothing had been asked.
//!
//! Orders of viewers are planned on a thread of their own while the solver keeps stepping, and a schedule under way goes on
//! meanwhile. Where the mesh has moved since, the way from its present shape is judged again before the first shape is handed
//! out, so that what a journal replays is the same bits: the start of each motion depends only on the cycle at which it began.

mod forecaster;
mod lent;
mod log;
mod parameters;
mod planner;
mod queue;
mod stack;
mod timed;
mod worker;

use std::{
    collections::VecDeque,
    sync::{Arc, Mutex},
    time::Instant,
};

use tombolo_deform::{
    mesh::{ArrayView, Mesh, Vector},
    partition::Partition,
    quality::{Guard, Quality, judge_in_parts, quality_in_parts},
    schedule::Schedule,
    surface::Surface,
};
use tombolo_pipelines::{
    language::{DeformStage, Order},
    shape::{Forecast, Judged, Place, Plan, Shaper},
};

pub(crate) use forecaster::Forecaster;
pub use lent::NotFollowed;
use lent::{HandedOut, Own, Rounding};
pub(crate) use log::{Log, Moment, Source};
pub(crate) use parameters::Parameters;
pub use parameters::{Parameter, ParameterError};
pub(crate) use queue::{Asked, Queue, Received};
pub(crate) use stack::EditStack;
use stack::{ShapeSettings, StackError};
pub(crate) use timed::Timed;

use crate::report::OrderStatus;
use forecaster::Present;
use planner::{Planner, Rejection, Wish};
use worker::{Done, Worker, lock};

/// The settings of orders that bring none.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Defaults {
    pub(crate) deform: DeformStage,
    pub(crate) guard: Guard,
    pub(crate) schedule: Schedule,
}

impl Defaults {
    /// The stack that an order makes of `stack`, and what its plan from the place `start` is made from.
    fn wish(
        &self,
        stack: &EditStack,
        start: Place,
        order: &Order,
    ) -> Result<(EditStack, Wish), StackError> {
        let default = ShapeSettings { deform: self.deform.clone(), guard: self.guard };
        let (after, settings) =
            stack.after(&order.change, order.deform.as_ref(), order.guard, &default)?;
        let ShapeSettings { deform, guard } = settings;
        let wish = Wish {
            stack: after.edits(),
            kept: stack.shared(&after),
            start,
            own: None,
            deform,
            schedule: order.schedule.unwrap_or(self.schedule),
            guard,
        };
        Ok((after, wish))
    }
}

/// An order waiting for its turn.
struct Task {
    id: String,
    order: Order,
    background: bool,
}

/// An order whose plan is being made.
struct Computing {
    id: String,
    stack: EditStack,
    wish: Wish,
    /// Whether the mesh stays where it is until the plan is made, because the one before started elsewhere.
    resting: bool,
}

/// A schedule under way.
struct Motion {
    id: String,
    plan: Plan,
    guard: Guard,
    begun: Moment,
    /// Shapes that were handed out.
    taken: u32,
    /// The shape that the mesh has, which is the last one taken if that was followed.
    reached: u32,
}

/// The last shape that was handed out, until the next call shows whether the solver went there.
struct Pending {
    handed: HandedOut,
    /// Where the shape was before, and its quality.
    before: (Place, Option<(f64, f64)>),
    reached: u32,
    id: String,
    shape: u32,
    cycle: u64,
}

/// One change of the mesh, to be made over the coming step.
#[derive(Debug, Clone, Default)]
pub(crate) struct Shape {
    pub(crate) displacement: Vec<Vector>,
    pub(crate) velocity: Vec<Vector>,
    /// Where the mesh will be, where that is not the shape itself.
    carried: Option<Arc<[Vector]>>,
    /// The same of the vertices of the boundary.
    pub(crate) surface: SurfaceShape,
    pub(crate) shape: (u32, u32),
    pub(crate) order: String,
}

/// One change of the boundary.
#[derive(Debug, Clone, Default)]
pub(crate) struct SurfaceShape {
    pub(crate) coordinates: Vec<Vector>,
    pub(crate) displacement: Vec<Vector>,
    pub(crate) velocity: Vec<Vector>,
}

/// The shape of one mesh and the orders that change it.
pub(crate) struct Steerer {
    log: Arc<Log>,
    defaults: Defaults,
    planner: Arc<Mutex<Planner>>,
    worker: Option<Worker>,
    /// The stack and the place once more, for other threads.
    present: Arc<Mutex<Present>>,
    /// Whether the next order of a file was looked ahead to from the present shape.
    foreseen: bool,
    stack: EditStack,
    place: Place,
    waiting: VecDeque<Task>,
    computing: Option<Computing>,
    motion: Option<Motion>,
    shape: Shape,
    mesh: Arc<Mesh>,
    partition: Arc<dyn Partition>,
    boundary: Arc<[u32]>,
    rounding: Rounding,
    pending: Option<Pending>,
    /// The mesh as it was lent last, against the shape.
    own: Own,
    /// The quality of the present shape as far as it is known: least and mean scaled Jacobian.
    quality: Option<(f64, f64)>,
    reference_quality: Option<(f64, f64, usize)>,
}

impl Steerer {
    /// Takes over a mesh at its reference shape, and makes ready on other threads what no order changes: the operator of the
    /// volume and, where an order could need it, the skeleton.
    pub(crate) fn new(
        shaper: Shaper,
        defaults: Defaults,
        log: Arc<Log>,
        queue: Arc<Queue>,
        skeleton: bool,
    ) -> std::io::Result<Self> {
        let in_advance = shaper.skeleton_in_advance().filter(|_| skeleton);
        let mut steerer = Self::of_shaper(shaper, defaults, log);
        let mut worker = Worker::start(Arc::clone(&steerer.planner), queue)?;
        worker.prepare(steerer.defaults.deform.clone());
        if let Some(in_advance) = in_advance {
            worker.beside(in_advance)?;
        }
        steerer.worker = Some(worker);
        Ok(steerer)
    }

    /// Takes over this rank's part of a mesh, and makes ready at once what no order changes: there is no other thread that could
    /// speak with the ranks, so that orders are planned when their turn comes, on all ranks in the same call. Collective, as are
    /// [`Steerer::advance`] and whatever else makes plans.
    pub(crate) fn of_part(shaper: Shaper, defaults: Defaults, log: Arc<Log>) -> Self {
        let quality =
            quality_in_parts(shaper.mesh().cells(), shaper.reference(), &**shaper.partition());
        let mut steerer = Self::of_shaper(shaper, defaults, log);
        lock(&steerer.planner).prepare(&steerer.defaults.deform);
        steerer.reference_quality = Some((quality.min, quality.mean, quality.inverted));
        steerer
    }

    fn of_shaper(shaper: Shaper, defaults: Defaults, log: Arc<Log>) -> Self {
        let place: Place = Arc::clone(shaper.reference()).into();
        let (mesh, partition) = (Arc::clone(shaper.mesh()), Arc::clone(shaper.partition()));
        let boundary = shaper.boundary_vertices().into();
        let rounding = Rounding::of(shaper.reference(), &*partition);
        let planner = Arc::new(Mutex::new(Planner::new(shaper)));
        let stack = EditStack::default();
        let present =
            Arc::new(Mutex::new(Present { stack: stack.clone(), place: place.clone(), own: None }));
        Self {
            mesh,
            partition,
            boundary,
            rounding,
            pending: None,
            own: Own::default(),
            log,
            defaults,
            planner,
            worker: None,
            present,
            foreseen: false,
            stack,
            place,
            waiting: VecDeque::new(),
            computing: None,
            motion: None,
            shape: Shape::default(),
            quality: None,
            reference_quality: None,
        }
    }

    /// The surface of the mesh, where this process has it.
    pub(crate) fn surface(&self) -> Option<Arc<Surface>> {
        lock(&self.planner).shaper().surface().cloned()
    }

    /// What answers forecasts; `None` where the worker has ended.
    pub(crate) fn forecaster(&self) -> Option<Forecaster> {
        let jobs = Arc::clone(self.worker.as_ref()?.jobs());
        Some(Forecaster {
            defaults: self.defaults.clone(),
            present: Arc::clone(&self.present),
            jobs,
        })
    }

    /// What an order would come to, found out at once. Collective, where the mesh is in parts.
    pub(crate) fn forecast(&self, order: &Order) -> Forecast {
        match self.wish(order) {
            Ok((_, wish)) => lock(&self.planner).forecast(&wish),
            Err(error) => {
                let Rejection { reason, seconds, .. } = Rejection::from(error);
                Forecast::rejected(reason, None, None, seconds)
            }
        }
    }

    /// Has the plan of an order that will come made ahead, as far as it can be known now; once for each shape.
    pub(crate) fn look_ahead(&mut self, order: Option<&Order>) {
        let Some(order) =
            order.filter(|_| !self.foreseen && self.is_at_rest() && self.computing.is_none())
        else {
            return;
        };
        self.foreseen = true;
        // What is wrong with it is told when its turn comes.
        if let (Some(worker), Ok((_, wish))) = (&self.worker, self.wish(order)) {
            worker.look_ahead(wish);
        }
    }

    fn wish(&self, order: &Order) -> Result<(EditStack, Wish), StackError> {
        let (stack, wish) = self.defaults.wish(&self.stack, self.place.clone(), order)?;
        Ok((stack, Wish { own: self.own.offsets.clone(), ..wish }))
    }

    /// How many vertices the mesh has.
    pub(crate) fn vertex_count(&self) -> usize {
        self.place.points.len()
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

    /// Finds out where the solver has moved the mesh since the last call: whether it followed what was handed out, and what motion
    /// of its own there is. Collective.
    pub(crate) fn observe(&mut self, lent: &ArrayView<'_>) {
        let partition = &*self.partition;
        if let Some(Pending { handed, before, reached, id, shape, cycle }) = self.pending.take() {
            let outcome = self.rounding.compare(&handed, lent, partition);
            let distance = outcome.distance;
            if outcome.is_followed {
                self.log.deviates(&id, distance);
            } else {
                self.log.not_followed(&id, NotFollowed { cycle, shape, distance });
                (self.place, self.quality) = before;
                lock(&self.present).place.clone_from(&self.place);
                if let Some(motion) = self.motion.as_mut().filter(|motion| motion.id == id) {
                    motion.reached = reached;
                }
            }
        }
        self.own = self.rounding.own(&self.place.points, lent, partition);
        lock(&self.present).own.clone_from(&self.own.offsets);
    }

    pub(crate) fn stack(&self) -> &EditStack {
        &self.stack
    }

    /// The least and the mean scaled Jacobian of the present shape and its inverted elements, as far as they are known.
    pub(crate) fn quality(&self) -> Option<(f64, f64, usize)> {
        // A shape that passed the guard holds no inverted element; of a volume that is the solver's nothing is known.
        let reference = self.reference_quality.filter(|_| !self.place.surface_only);
        self.quality.map(|(min, mean)| (min, mean, 0)).or(reference)
    }

    /// Puts an order at the end of the queue.
    pub(crate) fn take(&mut self, id: String, order: Order, background: bool) {
        self.waiting.push_back(Task { id, order, background: background && self.worker.is_some() });
    }

    /// Brings orders as far as they can come now; says whether anything changed. Called at safe points only.
    pub(crate) fn advance(&mut self, moment: Moment, step_seconds: Option<f64>) -> bool {
        let mut changed = false;
        loop {
            changed |= self.collect(moment, step_seconds);
            if self.computing.is_some() {
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
            self.start(task, moment, step_seconds);
            changed = true;
        }
    }

    /// Takes what the worker has finished.
    fn collect(&mut self, moment: Moment, step_seconds: Option<f64>) -> bool {
        let mut changed = false;
        while let Some(done) = self.worker.as_ref().and_then(Worker::try_take) {
            let is_gone = matches!(done, Done::Planned(_)) && self.computing.is_none();
            self.finish(done, moment, step_seconds);
            if is_gone {
                self.worker = None;
            }
            changed = true;
        }
        changed
    }

    fn start(&mut self, task: Task, moment: Moment, step_seconds: Option<f64>) {
        let Task { id, order, background } = task;
        let (stack, wish) = match self.wish(&order) {
            Ok(wish) => wish,
            Err(error) => return self.log.reject(&id, moment, &error.into()),
        };
        self.log.update(&id, |order| order.status = OrderStatus::Computing);
        let computing = Computing { id, stack, wish, resting: false };
        match &self.worker {
            Some(worker) if background => {
                worker.plan(computing.wish.clone());
                self.computing = Some(computing);
            }
            _ => {
                let begun = Instant::now();
                let plan = lock(&self.planner).plan(&computing.wish);
                self.commit(computing, plan, moment, begun, step_seconds);
            }
        }
    }

    fn finish(&mut self, done: Done, moment: Moment, step_seconds: Option<f64>) {
        match done {
            Done::Prepared(quality) => {
                let Quality { min, mean, inverted, .. } = *quality;
                self.reference_quality = Some((min, mean, inverted));
            }
            Done::Planned(plan) => {
                if let Some(mut computing) = self.computing.take() {
                    let is_stale = plan
                        .as_ref()
                        .as_ref()
                        .is_ok_and(|plan| !Arc::ptr_eq(plan.start(), &self.place.points));
                    if let Some(worker) = self.worker.as_ref().filter(|_| is_stale) {
                        // The worker may be at a forecast: the mesh waits for the way from here, not the solver.
                        computing.wish.start = self.place.clone();
                        computing.wish.own.clone_from(&self.own.offsets);
                        computing.resting = true;
                        worker.plan(computing.wish.clone());
                        self.computing = Some(computing);
                        return;
                    }
                    self.commit(computing, *plan, moment, Instant::now(), step_seconds);
                }
            }
        }
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
        let Computing { id, stack, wish, .. } = computing;
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
        self.stack = if fraction < 1.0 { stack.clamped(wish.kept, fraction) } else { stack };
        self.foreseen = false;
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
        self.motion =
            Some(Motion { id, plan, guard: wish.guard, begun: moment, taken: 0, reached: 0 });
    }

    /// The last change of the mesh and the coordinates at its end.
    pub(crate) fn present(&self) -> (&Shape, &[Vector]) {
        (&self.shape, self.shape.carried.as_deref().unwrap_or(&self.place.points))
    }

    /// The vertices of the boundary, in the order of [`Shape::surface`].
    pub(crate) fn boundary(&self) -> &[u32] {
        &self.boundary
    }

    /// Takes the next shape of the schedule under way for the coming step, if it is due; says whether it was.
    pub(crate) fn next_shape(&mut self, moment: Moment, time_step: f64) -> bool {
        if self.computing.as_ref().is_some_and(|computing| computing.resting) {
            return false;
        }
        let Some(motion) = self.motion.as_mut() else { return false };
        let (cycles, time) =
            (moment.cycle.saturating_sub(motion.begun.cycle), moment.time - motion.begun.time);
        if !motion.plan.schedule().is_due(motion.taken, cycles, time) {
            return false;
        }
        let next = motion.taken + 1;
        if !motion.plan.is_straight(motion.reached, next) {
            let reason = format!(
                "the mesh stayed at shape {}, from which shape {next} is not a straight step",
                motion.reached
            );
            self.give_up(&reason);
            return false;
        }
        let last = next >= motion.plan.shapes();
        let points: Arc<[Vector]> = if last {
            Arc::clone(motion.plan.end())
        } else {
            let mut points = vec![[0.0; 3]; self.place.points.len()];
            motion.plan.write_shape(next, &mut points);
            points.into()
        };
        let before = self.own.lent.as_ref().unwrap_or(&self.place.points);
        let carried: Option<Arc<[Vector]>> = self.own.lent.as_ref().map(|lent| {
            let shapes = self.place.points.iter().zip(&*points);
            lent.iter()
                .zip(shapes)
                .map(|(&lent, (&now, &next))| self.rounding.carried(lent, now, next))
                .collect()
        });
        let after = carried.as_ref().unwrap_or(&points);
        // The shape was judged as it is; what the mesh will be with the solver's own motion was known up to the last call at most.
        if self.own.offsets.is_some() && motion.plan.judged() == Judged::Volume {
            let judged =
                judge_in_parts(&self.mesh, before, after, &[1.0], &motion.guard, &*self.partition);
            if let Err(refusal) = judged {
                let reason =
                    format!("shape {next} is not handed out; with the mesh's own motion {refusal}");
                self.give_up(&reason);
                return false;
            }
        }
        let shape = &mut self.shape;
        shape.displacement.resize(points.len(), [0.0; 3]);
        shape.velocity.resize(points.len(), [0.0; 3]);
        for (((displacement, velocity), new), old) in
            shape.displacement.iter_mut().zip(&mut shape.velocity).zip(&**after).zip(&**before)
        {
            for axis in 0..3 {
                displacement[axis] = new[axis] - old[axis];
                velocity[axis] = if time_step > 0.0 { displacement[axis] / time_step } else { 0.0 };
            }
        }
        let of_boundary = |all: &[Vector], surface: &mut Vec<Vector>| {
            surface.clear();
            surface.extend(self.boundary.iter().map(|&vertex| all[vertex as usize]));
        };
        of_boundary(after, &mut shape.surface.coordinates);
        of_boundary(&shape.displacement, &mut shape.surface.displacement);
        of_boundary(&shape.velocity, &mut shape.surface.velocity);
        self.pending = Some(Pending {
            handed: HandedOut { from: Arc::clone(before), to: Arc::clone(after) },
            before: (self.place.clone(), self.quality),
            reached: motion.reached,
            id: motion.id.clone(),
            shape: next,
            cycle: moment.cycle,
        });
        shape.carried = carried;
        (motion.taken, motion.reached) = (next, next);
        shape.shape = (motion.taken, motion.plan.shapes());
        shape.order.clone_from(&motion.id);
        self.place = motion.plan.place(motion.taken, points);
        lock(&self.present).place.clone_from(&self.place);
        let quality = motion.plan.quality().shapes.get(motion.taken as usize - 1);
        self.quality = quality.map(|quality| (quality.min, quality.mean));
        let taken = motion.taken;
        self.log.update(&motion.id, |order| {
            order.shape = taken;
            if last {
                order.status = OrderStatus::Applied;
            }
        });
        if last {
            self.motion = None;
        }
        true
    }

    /// Ends the schedule under way where the mesh is.
    fn give_up(&mut self, reason: &str) {
        let Some(motion) = self.motion.take() else { return };
        self.log.update(&motion.id, |order| {
            order.status = OrderStatus::Applied;
            order.reason = Some(format!(
                "ended at shape {} of {}: {reason}",
                motion.reached,
                motion.plan.shapes()
            ));
        });
    }
}
