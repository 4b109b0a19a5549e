//! From a stack of edits to the shapes that a solver is handed.

mod boundary;
mod carry;
mod forecast;
mod mend;
mod plan;
mod surface_only;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use serde::Serialize;
use tombolo_deform::{
    mesh::{FeatureSource, Mesh, Vector},
    partition::Partition,
    quality::{Guard, Refusal, SurfaceRule, keeps_in_parts},
    schedule::Schedule,
    surface::{
        BrokenSurface, Edit, EditError, Editor, FeatureSettings, Surface, SurfaceError,
        UnknownFeature, require_sound,
    },
    volume::{Impossible, Improver, Untangler, VolumeError},
};

use crate::communicator::{Communicator, agree};
use crate::distributed::{DistributedError, Part, PartBoundary, Ranks};
use crate::language::{DeformStage, check_stack};
use crate::limits::Exceeded;
pub use boundary::Elsewhere;
use boundary::{Boundary, Parts};
use carry::Carrier;
pub use forecast::{Forecast, Outcome};
use mend::Mended;
pub use plan::{Judged, Place, Plan};

/// Volume operators kept, one for each way to deform that was asked for: the newest ones.
const OPERATORS: usize = 2;

/// Seconds that the parts of a plan took.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct ShapeSeconds {
    /// The displacement of the surface, from the edits, and its check.
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
    /// The surface folds over or intersects itself.
    #[error(transparent)]
    Surface(#[from] Box<BrokenSurface>),
    /// A feature that should slide or be free is none of the surface.
    #[error("deform.{field}: {source}")]
    Feature {
        /// `sliding` or `free`.
        field: &'static str,
        /// The name, and those that there are.
        source: UnknownFeature,
    },
    /// Features that slide or are free leave nothing that holds a part of the mesh.
    #[error(
        "deform.{}: nothing holds the part of the mesh that {} {}, so that it could go anywhere; keep a feature of it off the list",
        match (sliding.is_empty(), free.is_empty()) {
            (false, true) => "sliding",
            (true, _) => "free",
            _ => "sliding and deform.free",
        },
        sliding.iter().chain(free).map(|name| format!("'{name}'")).collect::<Vec<_>>().join(", "),
        if sliding.len() + free.len() == 1 { "bounds" } else { "bound" }
    )]
    LetGo {
        /// Those of its features that slide.
        sliding: Vec<String>,
        /// Those that are free.
        free: Vec<String>,
    },
    /// The volume cannot follow.
    #[error(transparent)]
    Volume(#[from] VolumeError),
    /// A mesh on the way would be broken.
    #[error(transparent)]
    Guard(#[from] Refusal),
    /// An edit cannot be followed to its end, not in sub-steps and not by untangling.
    #[error(
        "edit {edit} ({name}) can be done to {:.2} % of its amount; beyond that{} {}{}",
        (1e4 * fraction).floor() / 1e2,
        if *folds { " the surface itself folds:" } else { "" },
        refusal.flaw(),
        at_its_end(impossible.as_deref(), *end_is_valid)
    )]
    Stalled {
        /// The place of the edit in the stack, counted from 0.
        edit: usize,
        /// Its kind.
        name: &'static str,
        /// What fraction of its amount was reached.
        fraction: f64,
        /// Whether it is the prescribed surface that folds there.
        folds: bool,
        /// What is wrong with going further.
        refusal: Refusal,
        /// Why there is no valid mesh at the edit's whole amount, where that is proved.
        impossible: Option<Box<Impossible>>,
        /// Whether a valid mesh was found at the edit's whole amount, to which there was no way.
        end_is_valid: bool,
    },
    /// What ranks said to each other was not understood.
    #[error(transparent)]
    Distributed(#[from] DistributedError),
    /// There are more edits or shapes than are allowed.
    #[error(transparent)]
    Limit(#[from] Exceeded),
    /// Another rank has the reason, in its own words.
    #[error("{0}")]
    Elsewhere(Elsewhere),
}

/// What is known of the end of an edit that cannot be followed to it.
fn at_its_end(impossible: Option<&Impossible>, end_is_valid: bool) -> String {
    match impossible {
        Some(proof) => {
            format!("; no motion of the inside gives a valid mesh at its whole amount: {proof}")
        }
        None if end_is_valid => String::from(
            "; there is a valid mesh at its whole amount, but no way to it was found: make the edit in parts",
        ),
        None => String::new(),
    }
}

impl Refused {
    /// Whether it is the surface that is broken.
    fn is_surface(&self) -> bool {
        matches!(self, Refused::Surface(_) | Refused::Elsewhere(Elsewhere { is_surface: true, .. }))
    }

    /// Whether a mesh on a straight way would be broken.
    fn is_quality(&self) -> bool {
        matches!(
            self,
            Refused::Guard(Refusal::Quality(_))
                | Refused::Elsewhere(Elsewhere { is_quality: true, .. })
        )
    }

    /// The least scaled Jacobian on the way, where that is what was wrong.
    #[must_use]
    pub fn min_scaled_jacobian(&self) -> Option<f64> {
        match self {
            Refused::Guard(Refusal::Quality(path))
            | Refused::Stalled { refusal: Refusal::Quality(path), .. } => {
                Some(path.min_scaled_jacobian)
            }
            Refused::Elsewhere(elsewhere) => elsewhere.min_scaled_jacobian,
            _ => None,
        }
    }

    /// What fraction would pass: of the way, or of the amount of the edit that cannot be followed.
    #[must_use]
    pub fn feasible_fraction(&self) -> Option<f64> {
        match self {
            Refused::Guard(Refusal::Quality(path)) => Some(path.feasible_fraction),
            Refused::Stalled { fraction, .. } => Some(*fraction),
            Refused::Surface(broken) => Some(broken.sound_fraction),
            Refused::Elsewhere(elsewhere) => elsewhere.feasible_fraction,
            _ => None,
        }
    }
}

/// The shape that a stack of edits makes.
#[derive(Debug, Clone, PartialEq)]
pub struct Target {
    /// The coordinates of every vertex: the reference's plus the displacement; bit for bit the reference's where nothing moves.
    pub points: Arc<[Vector]>,
    /// The coordinates of the reference.
    pub reference: Arc<[Vector]>,
    /// The shapes over which it is reached from the reference, the last of them `points`: every straight piece between them was
    /// judged. Empty where that was not asked.
    pub way: Vec<Arc<[Vector]>>,
    /// The fraction of the edits that was done: below 1 where they were clamped.
    pub fraction: f64,
    /// Seconds spent so far.
    pub seconds: ShapeSeconds,
    /// Iterations of the linear solver.
    pub iterations: usize,
    /// Sub-steps that it took beyond one solve from the reference.
    pub sub_steps: usize,
    /// Whether only the boundary is where it should be, and the volume is left to the solver.
    pub surface_only: bool,
}

impl Target {
    /// The place it is, once the mesh is there.
    #[must_use]
    pub fn place(&self) -> Place {
        let mut back: Vec<_> = self.way.iter().rev().skip(1).cloned().collect();
        if !self.way.is_empty() && !Arc::ptr_eq(&self.points, &self.reference) {
            back.push(Arc::clone(&self.reference));
        }
        Place { points: Arc::clone(&self.points), back, surface_only: self.surface_only }
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
/// use tombolo_deform::{quality::Guard, schedule::Schedule, shapes::box_of_tets, surface::{Edit, FeatureSettings, Surface}};
/// use tombolo_pipelines::{language::DeformStage, shape::Shaper};
///
/// let mesh = Arc::new(box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]));
/// let surface = Arc::new(Surface::extract(&mesh, &FeatureSettings::default())?);
/// let [floor, ceiling] = [0, 1].map(|index| surface.features().names()[index].clone());
/// let edits: Vec<Edit> = serde_json::from_value(serde_json::json!([
///     {"translate": {"features": [floor], "fixed": [ceiling], "by": [0.0, 0.0, -0.1]}}
/// ]))?;
/// let mut shaper = Shaper::new(Arc::clone(&mesh), surface)?;
/// let reference: Arc<[_]> = mesh.points().into();
/// let plan = shaper.plan(&edits, reference, &DeformStage::default(), &Schedule::default(), &Guard::default())?;
/// assert!(plan.quality().min_scaled_jacobian > 0.02);
///
/// let back = shaper.plan(&[], Arc::clone(plan.end()), &DeformStage::default(), &Schedule::default(), &Guard::default())?;
/// assert_eq!(&**back.end(), mesh.points());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # On several ranks
/// Of a mesh in parts ([`Shaper::of_part`]) each rank has a shaper of its own part; rank 0 has the surface and evaluates the edits.
/// Everything that makes or judges shapes is then collective: all ranks ask for the same, on the thread from which the communicator
/// may be used, and get the same outcome, the same refusal, and the shape of their own vertices, ghosts among them.
pub struct Shaper {
    mesh: Arc<Mesh>,
    boundary: Arc<Boundary>,
    /// Where the surface is.
    editor: Option<Editor>,
    operators: Vec<(DeformStage, Arc<Carrier>)>,
    reference: Arc<[Vector]>,
    untangler: Option<Arc<Untangler>>,
    improver: Option<Arc<Improver>>,
    /// Shapes that took more than one solve, the newest last.
    mended: Vec<Mended>,
    spent: ShapeSeconds,
}

impl Shaper {
    /// A shaper of the reference mesh `mesh`, whose surface is `surface`.
    ///
    /// # Errors
    /// As [`Editor::new`].
    pub fn new(mesh: Arc<Mesh>, surface: Arc<Surface>) -> Result<Self, SurfaceError> {
        let editor = Editor::new(Arc::clone(&surface))?;
        Ok(Self::with_boundary(mesh, Boundary::of_surface(surface), Some(editor)))
    }

    /// A shaper of the part that this rank has of the reference mesh. `partition` may put another partition in place of the one
    /// that the ranks make, such as one with solvers of its own. Collective.
    ///
    /// ```
    /// use std::sync::Arc;
    /// use tombolo_deform::{shapes::box_of_tets, surface::{Edit, FeatureSettings}};
    /// use tombolo_pipelines::{communicator::{Communicator, threads}, distributed::Part, shape::Shaper};
    ///
    /// let mesh = box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]);
    /// let half = |cell: usize| usize::from(2 * cell >= mesh.cells().len());
    /// let of_cells: Vec<usize> = (0..mesh.cells().len()).map(half).collect();
    /// let edits: Vec<Edit> = serde_json::from_value(serde_json::json!([
    ///     {"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0.0, 0.0, -0.1]}}
    /// ]))?;
    /// let least = threads::run(2, |ranks| {
    ///     let part = Part::cut(&mesh, &of_cells, ranks.rank(), false).map_err(|error| error.to_string())?;
    ///     let mut shaper = Shaper::of_part(Arc::new(ranks), &part, &FeatureSettings::default(), |ranks| Arc::new(ranks))
    ///         .map_err(|error| error.to_string())?;
    ///     let start = Arc::clone(shaper.reference());
    ///     let plan = shaper.plan(&edits, start, &Default::default(), &Default::default(), &Default::default());
    ///     plan.map(|plan| plan.quality().min_scaled_jacobian).map_err(|error| error.to_string())
    /// });
    /// assert!(least[0].as_ref().is_ok_and(|least| *least > 0.02));
    /// assert_eq!(least[0], least[1]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`DistributedError`], the same on all ranks.
    pub fn of_part(
        communicator: Arc<dyn Communicator>,
        part: &Part,
        settings: &FeatureSettings,
        partition: impl FnOnce(Ranks) -> Arc<dyn Partition>,
    ) -> Result<Self, DistributedError> {
        let (shared, boundary) = PartBoundary::find(&*communicator, part, settings)?;
        let shared = Arc::new(shared);
        let editor = boundary.surface().map(|surface| Editor::new(Arc::clone(surface))).transpose();
        let editor = agree(&*communicator, editor)?;
        let own = agree(&*communicator, own_mesh(part))?;
        let numbers = cell_numbers(&*communicator, part, &own.1);
        let partition = partition(Ranks::new(
            Arc::clone(&communicator),
            Arc::clone(&shared),
            &boundary,
            numbers,
        ));
        let parts = Parts { communicator, shared, boundary };
        Ok(Self::with_boundary(Arc::new(own.0), Boundary::of_parts(parts, partition), editor))
    }

    fn with_boundary(mesh: Arc<Mesh>, boundary: Boundary, editor: Option<Editor>) -> Self {
        let reference = mesh.points().into();
        Self {
            mesh,
            boundary: Arc::new(boundary),
            editor,
            operators: Vec::new(),
            reference,
            untangler: None,
            improver: None,
            mended: Vec::new(),
            spent: ShapeSeconds::default(),
        }
    }

    /// The reference mesh.
    #[must_use]
    pub fn mesh(&self) -> &Arc<Mesh> {
        &self.mesh
    }

    /// The coordinates of the reference mesh.
    #[must_use]
    pub fn reference(&self) -> &Arc<[Vector]> {
        &self.reference
    }

    /// Seconds spent by the last [`Shaper::reach`], and by what was asked since: also where it was refused.
    #[must_use]
    pub fn spent(&self) -> ShapeSeconds {
        self.spent
    }

    /// Its surface; on several ranks that of the whole mesh, on rank 0 alone.
    #[must_use]
    pub fn surface(&self) -> Option<&Arc<Surface>> {
        self.boundary.surface()
    }

    /// The vertices of the mesh on its surface.
    #[must_use]
    pub fn boundary_vertices(&self) -> &[u32] {
        self.boundary.vertices()
    }

    /// The parts that the mesh is in.
    #[must_use]
    pub fn partition(&self) -> &Arc<dyn Partition> {
        self.boundary.partition()
    }

    /// The editor of its surface, where that is.
    pub fn editor(&mut self) -> Option<&mut Editor> {
        self.editor.as_mut()
    }

    /// Extracts the skeleton of the surface when it is called, on whatever thread that is, so that the first order need not.
    pub fn skeleton_in_advance(&self) -> Option<impl FnOnce() + Send + 'static + use<>> {
        self.editor.as_ref().map(Editor::skeleton_in_advance)
    }

    /// Sets up the operator of the volume, so that the first order need not.
    ///
    /// # Errors
    /// [`Refused::Volume`] where the mesh has none; [`Refused::Feature`].
    pub fn prepare(&mut self, deform: &DeformStage) -> Result<(), Refused> {
        if deform.surface_only {
            return Ok(());
        }
        self.operator(deform).map(drop)
    }

    /// Holds a shape of the surface (coordinates of each of its vertices, on the rank that has it) to `rule`.
    fn require_sound(&self, shape: &[Vector], rule: SurfaceRule) -> Result<(), Refused> {
        let sound = match (rule, self.boundary.surface()) {
            (SurfaceRule::Allow, _) | (_, None) => Ok(()),
            (_, Some(surface)) => {
                require_sound(surface, surface.points(), shape).map_err(Refused::from)
            }
        };
        self.boundary.agree(sound)
    }

    fn operator(&mut self, deform: &DeformStage) -> Result<Arc<Carrier>, Refused> {
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
        let operator = Arc::new(Carrier::new(&self.mesh, &self.boundary, deform)?);
        self.operators.push((deform.clone(), Arc::clone(&operator)));
        Ok(operator)
    }

    /// The shape that `stack` makes, measured from the reference mesh. Its surface is held to `rule` before any volume work; the
    /// volume is not judged yet.
    ///
    /// # Errors
    /// [`Refused::Edit`], [`Refused::Surface`], [`Refused::Feature`], [`Refused::Volume`], [`Refused::Limit`].
    pub fn target(
        &mut self,
        stack: &[Edit],
        deform: &DeformStage,
        rule: SurfaceRule,
    ) -> Result<Target, Refused> {
        check_stack(stack)?;
        deform.equation.validate()?;
        let mut seconds = ShapeSeconds::default();
        let watch = Stopwatch::start();
        let boundary = Arc::clone(&self.boundary);
        let displaced = displaced(self.editor.as_mut(), stack).and_then(|displacement| {
            // Where a part of the surface is let go, it is looked at where it ends.
            if let (Some(surface), false, SurfaceRule::Reject) =
                (boundary.surface(), deform.lets_go(), rule)
            {
                let moved = surface
                    .points()
                    .iter()
                    .zip(&displacement)
                    .map(|(&point, &by)| moved(point, by));
                require_sound(surface, surface.points(), &moved.collect::<Vec<Vector>>())?;
            }
            Ok(displacement)
        });
        let surface = boundary.scatter(displaced);
        seconds.surface = watch.seconds();
        self.spent.surface += seconds.surface;
        let surface = surface?;
        let reference = Arc::clone(&self.reference);
        let still = boundary.all(surface.iter().all(|displacement| *displacement == [0.0; 3]));
        if still {
            let points = Arc::clone(&reference);
            let (way, fraction, iterations, sub_steps) = (Vec::new(), 1.0, 0, 0);
            let surface_only = deform.surface_only;
            return Ok(Target {
                points,
                reference,
                way,
                fraction,
                seconds,
                iterations,
                sub_steps,
                surface_only,
            });
        }
        if deform.surface_only {
            return self.of_surface(&surface, seconds);
        }
        let watch = Stopwatch::start();
        let solution = self.operator(deform)?.solve(&surface).and_then(|solution| {
            let moved =
                reference.iter().zip(&solution.displacement).map(|(&point, &by)| moved(point, by));
            let mut points: Vec<Vector> = moved.collect();
            boundary.take_from_owners(&mut points)?;
            let improved =
                self.improved(&points, deform)?.filter(|improved| self.straight(improved));
            Ok((improved.unwrap_or_else(|| points.into()), solution.iterations))
        });
        seconds.volume = watch.seconds();
        self.spent.volume += seconds.volume;
        let (points, iterations) = solution?;
        if deform.lets_go() {
            let watch = Stopwatch::start();
            let sound = boundary.gather(&points).and_then(|shape| self.require_sound(&shape, rule));
            seconds.surface += watch.seconds();
            self.spent.surface += watch.seconds();
            sound?;
        }
        let (way, fraction, sub_steps) = (Vec::new(), 1.0, 0);
        Ok(Target {
            points,
            reference,
            way,
            fraction,
            seconds,
            iterations,
            sub_steps,
            surface_only: false,
        })
    }

    /// The shape with its worst cells lifted, where that could be done.
    fn improved(
        &mut self,
        points: &[Vector],
        deform: &DeformStage,
    ) -> Result<Option<Arc<[Vector]>>, Refused> {
        if deform.equation.improve == 0 {
            return Ok(None);
        }
        let (mesh, boundary) = (&self.mesh, &self.boundary);
        let improver = self.improver.get_or_insert_with(|| {
            Arc::new(Improver::of_part(mesh, boundary.vertices(), boundary.partition()))
        });
        let mut points = points.to_vec();
        if !improver.improve(&mut points, deform.equation.improve) {
            return Ok(None);
        }
        boundary.take_from_owners(&mut points)?;
        Ok(Some(points.into()))
    }

    /// Whether every cell stays valid on the straight way from the reference.
    fn straight(&self, points: &[Vector]) -> bool {
        let guard = Guard { min_scaled_jacobian: 0.0, ..Guard::default() };
        self.keeps(&self.reference, points, &guard)
    }

    fn keeps(&self, start: &[Vector], end: &[Vector], guard: &Guard) -> bool {
        keeps_in_parts(&self.mesh, start, end, guard, &**self.boundary.partition())
    }

    /// The way from the shape `start` (coordinates of every vertex) to that of a stack: [`Shaper::reach`] where no way back is
    /// known.
    ///
    /// # Errors
    /// As [`Shaper::reach`].
    pub fn plan(
        &mut self,
        stack: &[Edit],
        start: Arc<[Vector]>,
        deform: &DeformStage,
        schedule: &Schedule,
        guard: &Guard,
    ) -> Result<Plan, Refused> {
        self.reach(stack, 0, &start.into(), deform, schedule, guard)
    }
}

/// The displacement of the surface that a stack makes, where the surface is.
fn displaced(editor: Option<&mut Editor>, stack: &[Edit]) -> Result<Vec<Vector>, Refused> {
    editor.map_or_else(|| Ok(Vec::new()), |editor| Ok(editor.displacement(stack)?))
}

/// The cells of a part that are its own and of volume, with all its vertices, and where they stand among the part's cells.
fn own_mesh(part: &Part) -> Result<(Mesh, Vec<usize>), tombolo_deform::mesh::MeshError> {
    let is_own =
        |cell: &usize| !part.is_ghost(*cell) && part.cells.cell_type(*cell).dimension() == 3;
    let own: Vec<usize> = (0..part.cells.len()).filter(is_own).collect();
    let cells = part.cells.subset(own.iter().copied());
    Ok((Mesh::new(part.points.clone(), cells, FeatureSource::SharpEdges)?, own))
}

/// The numbers in the whole mesh of a part's own cells: the solver's, else they count through the ranks. Collective.
fn cell_numbers(communicator: &dyn Communicator, part: &Part, own: &[usize]) -> Vec<u64> {
    let counts = communicator.gather(0, &(part.cells.len() as u64).to_le_bytes());
    let mut all = counts.unwrap_or_default().concat();
    communicator.broadcast(0, &mut all);
    let counts = all.as_chunks().0.iter().map(|count| u64::from_le_bytes(*count));
    let first: u64 = counts.take(communicator.rank()).sum();
    let number = |&cell: &usize| match &part.global_cells {
        Some(numbers) => numbers.get(cell).copied().unwrap_or(u64::MAX),
        None => first + cell as u64,
    };
    own.iter().map(number).collect()
}

/// Adding 0 would turn a coordinate of -0 into 0: what does not move keeps its bits.
fn moved(point: Vector, by: Vector) -> Vector {
    std::array::from_fn(|axis| if by[axis] == 0.0 { point[axis] } else { point[axis] + by[axis] })
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
