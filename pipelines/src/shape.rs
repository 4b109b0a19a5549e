//! From a stack of edits to the shapes that a solver is handed.

use std::sync::Arc;

use serde::Serialize;
use tombolo_deform::{
    mesh::{Mesh, Vector},
    quality::{Guard, PathQuality, Refusal, judge, shape_at},
    schedule::Schedule,
    surface::{Edit, EditError, Editor, Surface, SurfaceError},
    volume::{Deform, VolumeError, VolumeOperator},
};

/// Volume operators kept, one for each way to deform that was asked for: the newest ones.
const OPERATORS: usize = 2;

/// Seconds that the parts of a plan took.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct ShapeSeconds {
    /// The displacement of the surface, from the edits.
    pub surface: f64,
    /// The motion of the volume; with it the set-up of its operator where this plan was the first to need it.
    pub volume: f64,
    /// The check of every mesh on the way.
    pub guard: f64,
}

/// Why a stack of edits makes no shape that could be handed to a solver. Nothing was changed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Refused {
    /// An edit asks for what the surface cannot do.
    #[error(transparent)]
    Edit(#[from] EditError),
    /// The volume cannot follow.
    #[error(transparent)]
    Volume(#[from] VolumeError),
    /// A mesh on the way would be broken.
    #[error(transparent)]
    Guard(#[from] Refusal),
}

impl Refused {
    /// The least scaled Jacobian on the way, where that is what was wrong.
    #[must_use]
    pub fn min_scaled_jacobian(&self) -> Option<f64> {
        match self {
            Refused::Guard(Refusal::Quality(path)) => Some(path.min_scaled_jacobian),
            _ => None,
        }
    }
}

/// The shape that a stack of edits makes.
#[derive(Debug, Clone, PartialEq)]
pub struct Target {
    /// The coordinates of every vertex: the reference's plus the displacement; bit for bit the reference's where nothing moves.
    pub points: Arc<[Vector]>,
    /// Seconds spent so far; `guard` is 0.
    pub seconds: ShapeSeconds,
    /// Iterations of the linear solver.
    pub iterations: usize,
}

/// A way from one shape to another, every mesh of which has been judged.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    start: Arc<[Vector]>,
    end: Arc<[Vector]>,
    schedule: Schedule,
    quality: PathQuality,
    largest_displacement: f64,
    seconds: ShapeSeconds,
}

impl Plan {
    /// How many shapes there are.
    #[must_use]
    pub fn shapes(&self) -> u32 {
        self.schedule.steps.get()
    }

    /// When they are due.
    #[must_use]
    pub fn schedule(&self) -> &Schedule {
        &self.schedule
    }

    /// Writes the coordinates of the `shape`-th shape, counted from 1, into `points`; the last is exactly [`Plan::end`].
    ///
    /// # Panics
    /// Where `points` has another length than the mesh has vertices.
    pub fn write_shape(&self, shape: u32, points: &mut [Vector]) {
        let fraction = self.schedule.fraction(shape);
        assert_eq!(points.len(), self.end.len(), "one point for each vertex");
        for ((point, &start), &end) in points.iter_mut().zip(&*self.start).zip(&*self.end) {
            *point = shape_at(start, end, fraction);
        }
    }

    /// Where it starts.
    #[must_use]
    pub fn start(&self) -> &Arc<[Vector]> {
        &self.start
    }

    /// Where it ends.
    #[must_use]
    pub fn end(&self) -> &Arc<[Vector]> {
        &self.end
    }

    /// The quality of the meshes on the way.
    #[must_use]
    pub fn quality(&self) -> &PathQuality {
        &self.quality
    }

    /// The longest way that a vertex of the surface goes from the start to the end, in units of the mesh.
    #[must_use]
    pub fn largest_displacement(&self) -> f64 {
        self.largest_displacement
    }

    /// Seconds that it took to make.
    #[must_use]
    pub fn seconds(&self) -> ShapeSeconds {
        self.seconds
    }
}

/// Makes shapes of one mesh from stacks of edits.
///
/// What an answer needs beyond the stack is set up once from the reference mesh and kept: the polyharmonic operators of the
/// surface, the operator of the volume. The shape of a stack does not depend on what was asked before: the same stack gives
/// the same bits.
///
/// ```
/// use std::sync::Arc;
/// use tombolo_deform::{quality::Guard, schedule::Schedule, shapes::box_of_tets, surface::{Edit, FeatureSettings, Surface},
///     volume::Deform};
/// use tombolo_pipelines::shape::Shaper;
///
/// let mesh = Arc::new(box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]));
/// let surface = Arc::new(Surface::extract(&mesh, &FeatureSettings::default())?);
/// let [floor, ceiling] = [0, 1].map(|index| surface.features().names()[index].clone());
/// let edits: Vec<Edit> = serde_json::from_value(serde_json::json!([
///     {"translate": {"features": [floor], "fixed": [ceiling], "by": [0.0, 0.0, -0.1]}}
/// ]))?;
/// let mut shaper = Shaper::new(Arc::clone(&mesh), surface)?;
/// let reference: Arc<[_]> = mesh.points().into();
/// let plan = shaper.plan(&edits, reference, &Deform::default(), &Schedule::default(), &Guard::default())?;
/// assert!(plan.quality().min_scaled_jacobian > 0.02);
///
/// let back = shaper.plan(&[], Arc::clone(plan.end()), &Deform::default(), &Schedule::default(), &Guard::default())?;
/// assert_eq!(&**back.end(), mesh.points());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Shaper {
    mesh: Arc<Mesh>,
    surface: Arc<Surface>,
    editor: Editor,
    operators: Vec<(Deform, Arc<VolumeOperator>)>,
}

impl Shaper {
    /// A shaper of the reference mesh `mesh`, whose surface is `surface`.
    ///
    /// # Errors
    /// As [`Editor::new`].
    pub fn new(mesh: Arc<Mesh>, surface: Arc<Surface>) -> Result<Self, SurfaceError> {
        let editor = Editor::new(Arc::clone(&surface))?;
        Ok(Self { mesh, surface, editor, operators: Vec::new() })
    }

    /// The reference mesh.
    #[must_use]
    pub fn mesh(&self) -> &Arc<Mesh> {
        &self.mesh
    }

    /// Its surface.
    #[must_use]
    pub fn surface(&self) -> &Arc<Surface> {
        &self.surface
    }

    /// Sets up the operator of the volume, so that the first order need not.
    ///
    /// # Errors
    /// [`Refused::Volume`] where the mesh has none.
    pub fn prepare(&mut self, deform: &Deform) -> Result<(), Refused> {
        Ok(self.operator(deform).map(drop)?)
    }

    fn operator(&mut self, deform: &Deform) -> Result<Arc<VolumeOperator>, VolumeError> {
        if let Some(found) = self.operators.iter().position(|(settings, _)| settings == deform) {
            // The newest last, so that the oldest is the first to go.
            let entry = self.operators.remove(found);
            let operator = Arc::clone(&entry.1);
            self.operators.push(entry);
            return Ok(operator);
        }
        if self.operators.len() >= OPERATORS {
            self.operators.remove(0);
        }
        let operator = Arc::new(VolumeOperator::new(&self.mesh, self.surface.vertices(), deform)?);
        self.operators.push((*deform, Arc::clone(&operator)));
        Ok(operator)
    }

    /// The shape that `stack` makes, measured from the reference mesh, not judged yet.
    ///
    /// # Errors
    /// [`Refused::Edit`], [`Refused::Volume`].
    pub fn target(&mut self, stack: &[Edit], deform: &Deform) -> Result<Target, Refused> {
        deform.validate()?;
        let mut seconds = ShapeSeconds::default();
        let watch = Stopwatch::start();
        let surface = self.editor.displacement(stack)?;
        seconds.surface = watch.seconds();
        let mesh = Arc::clone(&self.mesh);
        let reference = mesh.points();
        let still = surface.iter().all(|displacement| *displacement == [0.0; 3]);
        if still {
            return Ok(Target { points: reference.into(), seconds, iterations: 0 });
        }
        let watch = Stopwatch::start();
        let solution = self.operator(deform)?.solve(&surface)?;
        // Adding 0 would turn a coordinate of -0 into 0: what does not move keeps its bits.
        let moved = |point: f64, by: f64| if by == 0.0 { point } else { point + by };
        let points = reference
            .iter()
            .zip(&solution.displacement)
            .map(|(point, by)| std::array::from_fn(|axis| moved(point[axis], by[axis])))
            .collect();
        seconds.volume = watch.seconds();
        Ok(Target { points, seconds, iterations: solution.iterations })
    }

    /// The way from `start` (coordinates of every vertex) to a target in the steps of `schedule`, if `guard` lets it through.
    ///
    /// # Errors
    /// [`Refused::Guard`] with the worst cells and the largest feasible fraction.
    pub fn judge(
        &self,
        start: Arc<[Vector]>,
        target: &Target,
        schedule: &Schedule,
        guard: &Guard,
    ) -> Result<Plan, Refused> {
        let watch = Stopwatch::start();
        let quality = judge(&self.mesh, &start, &target.points, &schedule.fractions(), guard)?;
        let seconds = ShapeSeconds { guard: watch.seconds(), ..target.seconds };
        let largest_displacement = self.surface.vertices().iter().fold(0.0_f64, |largest, &vertex| {
            let [from, to] = [&start, &target.points].map(|points| points[vertex as usize]);
            largest.max((to[0] - from[0]).hypot(to[1] - from[1]).hypot(to[2] - from[2]))
        });
        let end = Arc::clone(&target.points);
        Ok(Plan { start, end, schedule: *schedule, quality, largest_displacement, seconds })
    }

    /// [`Shaper::target`], then [`Shaper::judge`].
    ///
    /// # Errors
    /// As these.
    pub fn plan(
        &mut self,
        stack: &[Edit],
        start: Arc<[Vector]>,
        deform: &Deform,
        schedule: &Schedule,
        guard: &Guard,
    ) -> Result<Plan, Refused> {
        let target = self.target(stack, deform)?;
        self.judge(start, &target, schedule, guard)
    }
}

/// Measures time where there is a clock; in a browser the caller has a better one.
struct Stopwatch {
    #[cfg(not(target_arch = "wasm32"))]
    start: std::time::Instant,
}

impl Stopwatch {
    fn start() -> Self {
        Self {
            #[cfg(not(target_arch = "wasm32"))]
            start: std::time::Instant::now(),
        }
    }

    #[cfg(not(target_arch = "wasm32"))]
    fn seconds(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }

    #[cfg(target_arch = "wasm32")]
    fn seconds(&self) -> f64 {
        0.0
    }
}
