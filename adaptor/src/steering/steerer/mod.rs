//! The shape of one mesh and the orders that change it.

mod handing;
mod planning;
mod recorded;
mod saved;
#[cfg(test)]
mod tests;
mod waiting;

use std::{
    collections::VecDeque,
    sync::{Arc, Mutex},
    time::Duration,
};

use tombolo_deform::{
    mesh::{Domain, Mesh, Vector},
    quality::quality,
    shape::{CurrentShape, Forecast, Plan, Shaper},
    surface::Surface,
};
use tombolo_pipelines::language::{HandedShape, Order};

use super::{
    Defaults, EditStack, Forecaster, Log, MeshMotion, Queue, Reservation, SurfaceMotion,
    forecaster::{Planning, Present},
    lent::{Own, Rounding},
    planner::{PlanRequest, Planner, Rejection},
    stack::StackError,
    together::{PlanTogether, UnderWay},
    worker::Worker,
};
use crate::lock::lock;
use handing::{Motion, Pending};
use recorded::Recorded;
pub(crate) use saved::SavedSteering;

/// An order waiting for its turn.
struct Task {
    id: String,
    order: Order,
    background: bool,
    reservation: Option<Reservation>,
    /// The order that it waits for, as was told last.
    behind: Option<String>,
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
        Task { id, order, background, reservation, behind: None }
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
    /// Whether the kernel was given up because the run ends: the order whose shapes were being found
    /// is left as it is, for a checkpoint to hold it.
    ends: bool,
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
            ends: false,
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

    /// The forecast of an order, made at once; on rank 0 `asker` says who wants to know. Collective.
    pub(crate) fn forecast(&self, order: &Order, asker: Option<u64>) -> Forecast {
        match self.asked(order) {
            Ok((_, asked)) => {
                let forecast = || lock(&self.planner).forecast(&asked);
                match &self.together {
                    Some(together) => together.run(asker.map(UnderWay::Forecast), forecast),
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
}
