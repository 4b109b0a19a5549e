//! From a stack of edits to the shapes that a solver is handed.

mod body;
mod carry;
mod deformation;
mod forecast;
mod mend;
mod phase;
mod plan;
mod refused;
mod request;
mod saved;
mod surface_only;
mod travel;
// Ranks are threads, which WebAssembly does not have.
#[cfg(all(test, not(target_family = "wasm")))]
mod cancelled;
#[cfg(all(test, not(target_family = "wasm")))]
mod tests;

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::cancellation::Cancellation;
use crate::communicator::{Cancelling, Communicator, agree};
use crate::distributed::{DistributedError, PartBoundary};
use crate::edit::{Edit, EditError, Editor};
use crate::limits::{EDITS, Exceeded, LISTED};
use crate::linear::{Cancellable, Solvers};
use crate::mesh::{Domain, Mesh, Vector};
use crate::quality::{Guard, SurfaceRule};
use crate::surface::{Surface, require_sound};
use crate::volume::{Deform, Improver, Untangler};
use body::Body;
use carry::Carrier;
pub use deformation::Deformation;
pub use forecast::{Forecast, Outcome};
use mend::Mended;
pub use phase::{CurrentPhase, Phase};
pub use plan::{CurrentShape, Judged, Plan};
pub use refused::{Elsewhere, Refused};
pub use request::Request;
pub use saved::{SavedPlan, SavedPoints, SavedShape};

/// Whether a stack may hold all of these edits.
///
/// # Errors
/// [`Exceeded`] for too many edits, or too many vertices and faces that they list.
pub fn check_stack<'a>(edits: impl IntoIterator<Item = &'a Edit>) -> Result<(), Exceeded> {
    let (mut count, mut listed) = (0, 0_usize);
    for edit in edits {
        count += 1;
        listed = listed.saturating_add(edit.listed());
    }
    EDITS.check(count)?;
    LISTED.check(listed)
}

/// Volume operators kept, one for each way to deform that was asked for: the newest ones.
const OPERATORS: usize = 2;

/// Seconds that the parts of a plan took.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct ShapeSeconds {
    /// The displacement of the surface, from the edits, and its check.
    pub surface: f64,
    /// The motion of the volume; with it the set-up of its operator where this plan was the first
    /// to need it.
    pub volume: f64,
    /// The check of every mesh on the way.
    pub guard: f64,
}

/// The shape that a stack of edits makes.
#[derive(Debug, Clone, PartialEq)]
pub struct Target {
    /// The coordinates of every vertex: the reference's plus the displacement; bit for bit the
    /// reference's where nothing moves.
    pub points: Arc<[Vector]>,
    /// The coordinates of the reference.
    pub reference: Arc<[Vector]>,
    /// The shapes over which it is reached from the reference, the last of them `points`: every
    /// straight piece between them was judged. Empty where that was not asked.
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
    fn new(points: Arc<[Vector]>, reference: &Arc<[Vector]>, seconds: ShapeSeconds) -> Self {
        Self {
            points,
            reference: Arc::clone(reference),
            way: Vec::new(),
            fraction: 1.0,
            seconds,
            iterations: 0,
            sub_steps: 0,
            surface_only: false,
        }
    }

    /// The current shape, once the mesh is there.
    #[must_use]
    pub fn reached(&self) -> CurrentShape {
        let mut back: Vec<_> = self.way.iter().rev().skip(1).cloned().collect();
        if !self.way.is_empty() && !Arc::ptr_eq(&self.points, &self.reference) {
            back.push(Arc::clone(&self.reference));
        }
        CurrentShape { points: Arc::clone(&self.points), back, surface_only: self.surface_only }
    }
}

/// Makes shapes of one mesh from stacks of edits.
///
/// The polyharmonic operators of the surface and the operator of the volume are set up once from
/// the reference mesh and kept. The shape of a stack does not depend on what was asked before: the
/// same stack gives the same bits.
///
/// ```
/// use std::sync::Arc;
/// use tombolo_deform::{shapes::box_of_tets, edit::Edit, features::FeatureSettings, surface::Surface};
/// use tombolo_deform::shape::{Request, Shaper};
///
/// let mesh = Arc::new(box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]));
/// let surface = Arc::new(Surface::extract(&mesh, &FeatureSettings::default())?);
/// let [floor, ceiling] = [0, 1].map(|index| surface.features().names()[index].clone());
/// let edits: Vec<Edit> = serde_json::from_value(serde_json::json!([
///     {"translate": {"features": [floor], "fixed": [ceiling], "by": [0.0, 0.0, -0.1]}}
/// ]))?;
/// let mut shaper = Shaper::new(Arc::clone(&mesh), surface)?;
/// let reference: Arc<[_]> = mesh.points().into();
/// let plan = shaper.plan(&Request::new(edits, reference))?;
/// assert!(plan.quality().min_scaled_jacobian > 0.02);
///
/// let back = shaper.plan(&Request::new([], Arc::clone(plan.end())))?;
/// assert_eq!(&**back.end(), mesh.points());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # On several ranks
/// Of a domain of several ranks each rank has a shaper of its own part; rank 0 has the surface and
/// evaluates the edits. Everything that makes or judges shapes is then collective: all ranks ask
/// for the same, on the thread from which the communicator may be used, and get the same outcome,
/// the same refusal, and the shape of their own vertices, ghosts among them.
pub struct Shaper {
    body: Arc<Body>,
    /// Where the surface is.
    editor: Option<Editor>,
    operators: Vec<(Deformation, Arc<Carrier>)>,
    reference: Arc<[Vector]>,
    untangler: Option<Arc<Untangler>>,
    improver: Option<Arc<Improver>>,
    /// Shapes that took more than one solve, the newest last.
    mended: Vec<Mended>,
    spent: ShapeSeconds,
    phase: CurrentPhase,
    clock: fn() -> f64,
    /// Whether vertices may move along x and y alone.
    in_plane: bool,
}

impl Shaper {
    /// A shaper of a reference mesh with its surface; or of the part that this rank has of one,
    /// with its boundary, as [`domain`](crate::distributed::domain) finds them. Collective.
    ///
    /// ```
    /// use std::sync::Arc;
    /// use tombolo_deform::{shapes::box_of_tets, edit::Edit, features::FeatureSettings};
    /// use tombolo_deform::communicator::{Communicator, threads};
    /// use tombolo_deform::{distributed::{Part, domain}, shape::{Request, Shaper}};
    ///
    /// let mesh = box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]);
    /// let half = |cell: usize| usize::from(2 * cell >= mesh.cells().len());
    /// let of_cells: Vec<usize> = (0..mesh.cells().len()).map(half).collect();
    /// let edits: Vec<Edit> = serde_json::from_value(serde_json::json!([
    ///     {"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0.0, 0.0, -0.1]}}
    /// ]))?;
    /// let least = threads::run(2, |ranks| {
    ///     let part = Part::cut(&mesh, &of_cells, ranks.rank(), false).map_err(|error| error.to_string())?;
    ///     let ranks: Arc<dyn Communicator> = Arc::new(ranks);
    ///     let found = domain(&ranks, &part, &FeatureSettings::default());
    ///     let shaper = found.and_then(|(domain, boundary)| Shaper::new(domain, boundary));
    ///     let mut shaper = shaper.map_err(|error| error.to_string())?;
    ///     let start = Arc::clone(shaper.reference());
    ///     let plan = shaper.plan(&Request::new(edits.clone(), start));
    ///     plan.map(|plan| plan.quality().min_scaled_jacobian).map_err(|error| error.to_string())
    /// });
    /// assert!(least[0].as_ref().is_ok_and(|least| *least > 0.02));
    /// assert_eq!(least[0], least[1]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`DistributedError`], the same on all ranks: for the reasons of [`Editor::new`].
    pub fn new(
        domain: impl Into<Domain>,
        boundary: impl Into<PartBoundary>,
    ) -> Result<Self, DistributedError> {
        let (domain, boundary) = (domain.into(), boundary.into());
        let editor = boundary.surface().map(|surface| Editor::new(Arc::clone(surface))).transpose();
        let ranks = domain.communicator();
        let editor = if ranks.size() == 1 { editor? } else { agree(&**ranks, editor)? };
        let reference = Arc::clone(domain.mesh().shared_points());
        let (domain, cancellation) = if ranks.size() == 1 {
            (domain, Cancellation::default())
        } else {
            let cancellation = Cancellation::of_ranks();
            let ranks = Cancelling::new(Arc::clone(ranks), cancellation.clone());
            (domain.among(Arc::new(ranks)), cancellation)
        };
        // The surface is on one rank, which edits it alone.
        let editor = editor.map(|editor| editor.with_cancellation(cancellation.of_this_rank()));
        let solvers = Arc::new(Cancellable(cancellation.clone()));
        Ok(Self {
            body: Arc::new(Body { domain, boundary, solvers, cancellation }),
            editor,
            operators: Vec::new(),
            reference,
            untangler: None,
            improver: None,
            mended: Vec::new(),
            spent: ShapeSeconds::default(),
            phase: CurrentPhase::default(),
            clock: no_clock,
            in_plane: false,
        })
    }

    /// The shaper with another choice of solvers for its volume. Before anything is asked of it.
    #[must_use]
    pub fn with_solvers(self, solvers: Arc<dyn Solvers>) -> Self {
        let Body { domain, boundary, cancellation, .. } = &*self.body;
        let solvers = solvers.with_cancellation(cancellation).unwrap_or(solvers);
        let body = Body {
            domain: domain.clone(),
            boundary: boundary.clone(),
            solvers,
            cancellation: cancellation.clone(),
        };
        Self { body: Arc::new(body), operators: Vec::new(), ..self }
    }

    /// The shaper with a clock, in seconds from any moment on, by which it says how long it took;
    /// without one that is 0.
    #[must_use]
    pub fn with_clock(self, clock: fn() -> f64) -> Self {
        Self { clock, ..self }
    }

    /// The shaper of a mesh whose vertices have two coordinates for whoever gets its shapes: edits that
    /// move any along z are refused. Rank 0, which has the surface, says so for all.
    #[must_use]
    pub fn in_plane(self, in_plane: bool) -> Self {
        Self { in_plane, ..self }
    }

    /// By which another thread has a plan under way given up: it is refused with
    /// [`Refused::Cancelled`] at the next look, in the set-up, the iterations of a solve or of an
    /// untangling, and the checks, and so are those that follow until [`Cancellation::renew`]; with
    /// solvers [other](Self::with_solvers) than the kernel's a set-up and a solve of theirs are
    /// finished first.
    ///
    /// Of several ranks any may ask. All of them are refused, at the same place, behind the next
    /// reduction: see [`Cancelling`]. Before the next plan all renew.
    #[must_use]
    pub fn cancellation(&self) -> &Cancellation {
        &self.body.cancellation
    }

    /// The phase of the plan that is under way, or of the last one.
    #[must_use]
    pub fn phase(&self) -> &CurrentPhase {
        &self.phase
    }

    /// Enters a phase, and measures how long it takes.
    fn stopwatch(&self, phase: Phase) -> Stopwatch {
        self.phase.enter(phase);
        Stopwatch { clock: self.clock, start: (self.clock)() }
    }

    /// The reference mesh.
    #[must_use]
    pub fn mesh(&self) -> &Mesh {
        self.body.domain.mesh()
    }

    /// The coordinates of the reference mesh.
    #[must_use]
    pub fn reference(&self) -> &Arc<[Vector]> {
        &self.reference
    }

    /// Seconds spent by the last [`Shaper::plan`], and by what was asked since: also where it was
    /// refused.
    #[must_use]
    pub fn spent(&self) -> ShapeSeconds {
        self.spent
    }

    /// Its surface; on several ranks that of the whole mesh, on rank 0 alone.
    #[must_use]
    pub fn surface(&self) -> Option<&Arc<Surface>> {
        self.body.surface()
    }

    /// The vertices of the mesh on its surface.
    #[must_use]
    pub fn boundary_vertices(&self) -> &[u32] {
        self.body.vertices()
    }

    /// The reference mesh and its ranks.
    #[must_use]
    pub fn domain(&self) -> &Domain {
        &self.body.domain
    }

    /// The editor of its surface, where that is.
    pub fn editor(&mut self) -> Option<&mut Editor> {
        self.editor.as_mut()
    }

    /// Extracts the skeleton of the surface when it is called, on whatever thread that is, so that
    /// the first order need not.
    pub fn skeleton_in_advance(&self) -> Option<impl FnOnce() + Send + 'static + use<>> {
        self.editor.as_ref().map(Editor::skeleton_in_advance)
    }

    /// Sets up the operator of the volume, so that the first order need not.
    ///
    /// # Errors
    /// [`Refused::Volume`] where the mesh has none; [`Refused::Feature`].
    pub fn prepare(&mut self, deform: &Deformation) -> Result<(), Refused> {
        if deform.surface_only {
            return Ok(());
        }
        self.operator(deform).map(drop)
    }

    fn operator(&mut self, deform: &Deformation) -> Result<Arc<Carrier>, Refused> {
        // How often a shape is improved is no matter of its operator.
        let equation = Deform { improve: 0, ..deform.equation };
        let wanted = Deformation { equation, ..deform.clone() };
        if let Some(found) = self.operators.iter().position(|(settings, _)| *settings == wanted) {
            // The newest last, so that the oldest is the first to go.
            let entry = self.operators.remove(found);
            let operator = Arc::clone(&entry.1);
            self.operators.push(entry);
            return Ok(operator);
        }
        if self.operators.len() >= OPERATORS {
            self.operators.remove(0);
        }
        let operator = Arc::new(Carrier::new(&self.body, &wanted)?);
        self.operators.push((wanted, Arc::clone(&operator)));
        Ok(operator)
    }

    /// The shape that `stack` makes, measured from the reference mesh. Its surface is held to
    /// the guard's rule before any volume work; the volume is not judged yet.
    ///
    /// # Errors
    /// [`Refused::Edit`], [`Refused::Surface`], [`Refused::Feature`], [`Refused::Volume`],
    /// [`Refused::Limit`].
    pub fn target(
        &mut self,
        stack: &[Edit],
        deform: &Deformation,
        guard: &Guard,
    ) -> Result<Target, Refused> {
        let rule = guard.surface;
        check_stack(stack)?;
        deform.equation.validate()?;
        self.body.require_wanted()?;
        let mut seconds = ShapeSeconds::default();
        let watch = self.stopwatch(Phase::Surface);
        let body = Arc::clone(&self.body);
        let in_plane = self.in_plane;
        let displaced = displaced(self.editor.as_mut(), stack, in_plane).and_then(|displacement| {
            // Where a part of the surface is let go, it is looked at where it ends.
            if let (Some(surface), false, SurfaceRule::Reject) =
                (body.surface(), deform.lets_go() && !deform.surface_only, rule)
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
        let surface = body.scatter(displaced);
        seconds.surface = watch.seconds();
        self.spent.surface += seconds.surface;
        let surface = surface?;
        let reference = Arc::clone(&self.reference);
        let still =
            body.communicator().all(surface.iter().all(|displacement| *displacement == [0.0; 3]));
        if still {
            let target = Target::new(Arc::clone(&reference), &reference, seconds);
            return Ok(Target { surface_only: deform.surface_only, ..target });
        }
        if deform.surface_only {
            return self.of_surface(&surface, seconds);
        }
        let watch = self.stopwatch(Phase::Volume);
        let solution = self.operator(deform)?.solve(&surface).map(|solution| {
            let moved =
                reference.iter().zip(&solution.displacement).map(|(&point, &by)| moved(point, by));
            let mut points: Vec<Vector> = moved.collect();
            body.update(&mut points);
            let improved = self
                .improved(&points, deform)
                .filter(|improved| self.may_replace(improved, &points, guard));
            (improved.unwrap_or_else(|| points.into()), solution.iterations)
        });
        seconds.volume = watch.seconds();
        self.spent.volume += seconds.volume;
        let (points, iterations) = solution?;
        if deform.lets_go() {
            let watch = self.stopwatch(Phase::Surface);
            let sound = body.gather(&points).and_then(|shape| body.require_sound(&shape, rule));
            seconds.surface += watch.seconds();
            self.spent.surface += watch.seconds();
            sound?;
        }
        let target = Target { iterations, ..Target::new(points, &reference, seconds) };
        // What it was improved by, or not, may be due to that.
        self.body.unless_given_up(Ok(target))
    }

    /// The shape with its worst cells lifted, where that could be done.
    fn improved(&mut self, points: &[Vector], deform: &Deformation) -> Option<Arc<[Vector]>> {
        if deform.equation.improve == 0 {
            return None;
        }
        let body = &self.body;
        let improver = self.improver.get_or_insert_with(|| {
            let improver = Improver::new(&body.domain, body.vertices());
            Arc::new(improver.with_cancellation(body.cancellation.clone()))
        });
        let mut points = points.to_vec();
        if !improver.improve(&mut points, deform.equation.improve) {
            return None;
        }
        body.update(&mut points);
        Some(points.into())
    }

    /// Whether an improved shape may take the place of the solve's: the guard lets it through, or
    /// lets neither through while every cell of the improved one stays valid on the straight way
    /// from the reference. The improver lifts the part of its quality that each cell has kept. A
    /// cell that was poor in the reference may lose some of it, and fall below the guard's floor.
    fn may_replace(&self, improved: &[Vector], points: &[Vector], guard: &Guard) -> bool {
        let valid = Guard { min_scaled_jacobian: 0.0, ..Guard::default() };
        let keeps =
            |points: &[Vector], guard: &Guard| self.body.keeps(&self.reference, points, guard);
        keeps(improved, guard) || (!keeps(points, guard) && keeps(improved, &valid))
    }
}

/// The displacement of the surface that a stack makes, where the surface is; `in_plane` refuses one
/// along z.
fn displaced(
    editor: Option<&mut Editor>,
    stack: &[Edit],
    in_plane: bool,
) -> Result<Vec<Vector>, Refused> {
    let Some(editor) = editor else { return Ok(Vec::new()) };
    let displacement = editor.displacement(stack).map_err(|error| match error {
        EditError::Cancelled => Refused::Cancelled,
        error => error.into(),
    })?;
    if in_plane {
        require_plane(editor.surface().points(), &displacement)?;
    }
    Ok(displacement)
}

/// What is out of the plane by less than this part of the largest displacement is rounding.
const OUT_OF_PLANE: f64 = 1e-9;

fn require_plane(points: &[Vector], displacement: &[Vector]) -> Result<(), Refused> {
    let largest =
        displacement.as_flattened().iter().fold(0.0_f64, |most, value| most.max(value.abs()));
    let farthest =
        points.iter().zip(displacement).max_by(|(_, a), (_, b)| a[2].abs().total_cmp(&b[2].abs()));
    match farthest {
        Some((&at, by)) if by[2].abs() > OUT_OF_PLANE * largest => {
            Err(Refused::LeavesPlane { at, by: by[2] })
        }
        _ => Ok(()),
    }
}

/// Adding 0 would turn a coordinate of -0 into 0: what does not move keeps its bits.
fn moved(point: Vector, by: Vector) -> Vector {
    std::array::from_fn(|axis| if by[axis] == 0.0 { point[axis] } else { point[axis] + by[axis] })
}

/// A clock that stands still.
fn no_clock() -> f64 {
    0.0
}

/// The seconds since a moment, by a clock.
struct Stopwatch {
    clock: fn() -> f64,
    start: f64,
}

impl Stopwatch {
    fn seconds(&self) -> f64 {
        (self.clock)() - self.start
    }
}
