//! Shapes that one linear solve from the reference does not reach.

use std::sync::Arc;

use tombolo_deform::{
    mesh::Vector,
    quality::{Guard, Otherwise, Refusal, keeps, turns_over},
    schedule::Schedule,
    surface::{Advance, Edit, Editor, Surface},
    volume::{BoundaryMotion, FollowError, Route, Untangler, follow},
};

use crate::language::DeformStage;

use super::carry::Carrier;
use super::plan::{Place, Plan, travel};
use super::{Refused, ShapeSeconds, Shaper, Stopwatch, Target, moved};

/// Mended shapes that are kept: the newest ones.
const KEPT: usize = 4;

/// Fractions that are tried for the largest feasible one, and how finely it is found where it has to be searched for.
const PROBES: usize = 9;
const FINE: f64 = 1.0 / 128.0;

/// A shape and all that it is a function of.
pub(super) struct Mended {
    stack: Vec<Edit>,
    deform: DeformStage,
    guard: Guard,
    target: Target,
}

/// An edit evaluated on the reference surface, as it is for a shape of one solve.
struct OnReference<'a> {
    editor: &'a mut Editor,
    /// Where a part of the surface is let go: what says where it ends.
    carrier: Option<Arc<Carrier>>,
    surface: Arc<Surface>,
    stack: Vec<Edit>,
    edit: Edit,
    /// Where the surface lies before the edit and its displacement there, where that is not what the stack says.
    ground: Option<(Vec<Vector>, Vec<Vector>)>,
}

impl BoundaryMotion for OnReference<'_> {
    type Error = Refused;

    fn at(&mut self, _: f64, to: f64, _: &[Vector]) -> Result<Vec<Vector>, Refused> {
        if let Some(last) = self.stack.last_mut() {
            *last = self.edit.scaled(to);
        }
        let displacement = displacement(self.editor, &self.stack, self.carrier.as_deref())?;
        Ok(match &self.ground {
            None => self.surface.points().iter().zip(&displacement).map(|(&point, &by)| moved(point, by)).collect(),
            Some((places, ground)) => places
                .iter()
                .zip(ground.iter().zip(&displacement))
                .map(|(&place, (ground, by))| moved(place, std::array::from_fn(|axis| by[axis] - ground[axis])))
                .collect(),
        })
    }

    fn folds(&self, shape: &[Vector], places: &[Vector]) -> bool {
        folds(&self.surface, shape, places)
    }
}

/// The same edit evaluated on the shape reached: each sub-step's motion of the handle is carried to the free surface as that lies
/// then. A surface that follows in this way does not fold as long as no sub-step folds it.
struct OnShape<'a> {
    on_reference: OnReference<'a>,
    advance: Advance,
}

impl BoundaryMotion for OnShape<'_> {
    type Error = Refused;

    fn at(&mut self, from: f64, to: f64, shape: &[Vector]) -> Result<Vec<Vector>, Refused> {
        let mut places = self.on_reference.at(from, to, shape)?;
        let vertices = self.on_reference.surface.vertices();
        let now: Vec<Vector> = vertices.iter().map(|&vertex| shape[vertex as usize]).collect();
        self.advance.carry(&now, &mut places)?;
        Ok(places)
    }

    fn folds(&self, shape: &[Vector], places: &[Vector]) -> bool {
        self.on_reference.folds(shape, places)
    }
}

/// The displacement of the surface that a stack makes, with what is let go of it where it ends.
fn displacement(editor: &mut Editor, stack: &[Edit], carrier: Option<&Carrier>) -> Result<Vec<Vector>, Refused> {
    let surface = editor.displacement(stack)?;
    match carrier {
        Some(carrier) => Ok(carrier.settle(surface)?),
        None => Ok(surface),
    }
}

/// Whether a triangle of the surface turns over.
fn folds(surface: &Surface, shape: &[Vector], places: &[Vector]) -> bool {
    let vertices = surface.vertices();
    surface.triangles().iter().any(|triangle| {
        let before = triangle.map(|vertex| shape[vertices[vertex as usize] as usize]);
        turns_over(&before, &triangle.map(|vertex| places[vertex as usize]))
    })
}

impl Shaper {
    /// The way from `start` to the shape that `stack` makes, as `guard` has it: the shape of one linear solve, else what
    /// [`Guard::otherwise`] says. Of a stack that is clamped, the first `kept` edits stay whole.
    ///
    /// Whatever it comes to, the shape depends on the reference mesh and the arguments other than `start` and `schedule` alone
    /// (with [`Otherwise::Clamp`], how far it goes depends on these too).
    ///
    /// # Errors
    /// [`Refused`], with what was reached, where it broke, and what fraction would pass.
    pub fn reach(
        &mut self,
        stack: &[Edit],
        kept: usize,
        start: &Place,
        deform: &DeformStage,
        schedule: &Schedule,
        guard: &Guard,
    ) -> Result<Plan, Refused> {
        self.spent = ShapeSeconds::default();
        match guard.otherwise {
            Otherwise::Untangle => {
                let target = self.settled(stack, deform, guard)?;
                let shape: Vec<Vector> =
                    self.surface.vertices().iter().map(|&vertex| target.points[vertex as usize]).collect();
                self.require_sound(&shape, guard.surface)?;
                self.go(start, &target, schedule, guard)
            }
            Otherwise::Clamp => self.clamped(stack, kept, start, deform, schedule, guard),
            _ => {
                let target = self.target(stack, deform, guard.surface)?;
                self.go(start, &target, schedule, guard)
            }
        }
    }

    /// The way from `start` to a target.
    ///
    /// # Errors
    /// [`Refused::Guard`].
    pub fn go(&mut self, start: &Place, target: &Target, schedule: &Schedule, guard: &Guard) -> Result<Plan, Refused> {
        let watch = Stopwatch::start();
        let plan = travel(&self.mesh, start, target, schedule, guard);
        let spent = watch.seconds();
        self.spent.guard += spent;
        let seconds = ShapeSeconds { guard: target.seconds.guard + spent, ..target.seconds };
        Ok(plan?.finished(self.surface.vertices(), seconds))
    }

    /// The shape of a stack: of one linear solve from the reference where the guard lets that through, else the shape of the
    /// edits below the last one, from which the last one is followed in sub-steps.
    fn settled(&mut self, stack: &[Edit], deform: &DeformStage, guard: &Guard) -> Result<Target, Refused> {
        let mut lower = stack.len();
        let mut target = loop {
            let known =
                |mended: &&Mended| mended.stack == stack[..lower] && mended.deform == *deform && mended.guard == *guard;
            if let Some(found) = self.mended.iter().find(known) {
                break Target { seconds: ShapeSeconds::default(), ..found.target.clone() };
            }
            let mut linear = match self.target(&stack[..lower], deform, guard.surface) {
                // Followed in sub-steps, the surface may come out sound.
                Err(Refused::Surface(_)) if lower > 0 => {
                    lower -= 1;
                    continue;
                }
                linear => linear?,
            };
            let watch = Stopwatch::start();
            let holds = lower == 0 || keeps(self.mesh(), &self.reference, &linear.points, guard);
            linear.seconds.guard += watch.seconds();
            self.spent.guard += linear.seconds.guard;
            if holds {
                linear.way = vec![Arc::clone(&linear.points)];
                break linear;
            }
            lower -= 1;
        };
        for place in lower..stack.len() {
            target = self.followed(&stack[..=place], target, deform, guard)?;
            if self.mended.len() >= KEPT {
                self.mended.remove(0);
            }
            let stack = stack[..=place].to_vec();
            self.mended.push(Mended { stack, deform: deform.clone(), guard: *guard, target: target.clone() });
        }
        Ok(target)
    }

    /// The shape of a stack whose edits below the last one make the shape `base`.
    fn followed(
        &mut self,
        stack: &[Edit],
        base: Target,
        deform: &DeformStage,
        guard: &Guard,
    ) -> Result<Target, Refused> {
        let Some((edit, below)) = stack.split_last().filter(|(edit, _)| !edit.muted()) else { return Ok(base) };
        let watch = Stopwatch::start();
        let untangler = Arc::clone(
            self.untangler.get_or_insert_with(|| Arc::new(Untangler::new(&self.mesh, self.surface.vertices()))),
        );
        let places: Vec<Vector> = self.surface.vertices().iter().map(|&vertex| base.points[vertex as usize]).collect();
        let carrier = if deform.lets_go() { Some(self.operator(deform)?) } else { None };
        let ground = displacement(&mut self.editor, below, carrier.as_deref())?;
        let as_stated = self
            .surface
            .points()
            .iter()
            .zip(&ground)
            .zip(&places)
            .all(|((&point, &by), place)| moved(point, by) == *place);
        let mut motion = OnReference {
            editor: &mut self.editor,
            carrier,
            surface: Arc::clone(&self.surface),
            stack: stack.to_vec(),
            edit: edit.clone(),
            ground: (!as_stated).then_some((places, ground)),
        };
        let vertices = self.surface.vertices();
        let mut route =
            follow(&self.mesh, vertices, &base.points, &mut motion, &deform.equation, guard, Some(&untangler));
        // No volume can follow a surface that folds or shrinks to nothing: it is asked for in another way.
        if matches!(route, Err(FollowError::Stalled(_)))
            && !deform.lets_go()
            && let Some(advance) = Advance::new(&motion.surface, edit, stack.len() - 1)?
        {
            let mut motion = OnShape { on_reference: motion, advance };
            let second =
                follow(&self.mesh, vertices, &base.points, &mut motion, &deform.equation, guard, Some(&untangler));
            if further(&second) > further(&route) {
                route = second;
            }
        }
        let place = stack.len() - 1;
        let mut target = match route {
            Ok(route) => extended(base, route),
            Err(error) => {
                self.spent.volume += watch.seconds();
                return Err(refused(error, place, edit));
            }
        };
        if let Some(improved) = self.improved(&target.points, deform)
            && keeps(&self.mesh, &target.points, &improved, guard)
        {
            target.points = Arc::clone(&improved);
            target.way.push(improved);
        }
        let seconds = watch.seconds();
        self.spent.volume += seconds;
        target.seconds.volume += seconds;
        Ok(target)
    }

    /// The largest fraction of the edits after the first `kept` ones that the guard lets through.
    fn clamped(
        &mut self,
        stack: &[Edit],
        kept: usize,
        start: &Place,
        deform: &DeformStage,
        schedule: &Schedule,
        guard: &Guard,
    ) -> Result<Plan, Refused> {
        let whole = self.target(stack, deform, guard.surface);
        let refused = match whole.and_then(|whole| self.go(start, &whole, schedule, guard)) {
            Err(refused @ (Refused::Guard(Refusal::Quality(_)) | Refused::Surface(_))) if kept < stack.len() => refused,
            other => return other,
        };
        let mut part = |fraction: f64| -> Result<Option<Plan>, Refused> {
            let scaled: Vec<Edit> = stack
                .iter()
                .enumerate()
                .map(|(place, edit)| if place < kept { edit.clone() } else { edit.scaled(fraction) })
                .collect();
            let target = self.target(&scaled, deform, guard.surface);
            match target.and_then(|target| self.go(start, &Target { fraction, ..target }, schedule, guard)) {
                Ok(plan) => Ok(Some(plan)),
                Err(Refused::Guard(Refusal::Quality(_)) | Refused::Surface(_)) => Ok(None),
                Err(other) => Err(other),
            }
        };
        // The shapes of most edits lie on a straight way, on which the fraction is known.
        let (mut low, mut high, mut best) = (0.0, 1.0, None::<Plan>);
        let mut guess = refused.feasible_fraction().unwrap_or(0.5) * (1.0 - 1e-6);
        for _ in 0..PROBES {
            if !(guess > 1e-6 && guess < 1.0) {
                guess = 0.5 * (low + high);
            }
            let before = std::mem::replace(&mut guess, f64::NAN);
            match part(before)? {
                Some(plan) => {
                    if best.is_none() {
                        guess = before + FINE;
                    }
                    (low, best) = (before, Some(plan));
                }
                None => high = before,
            }
            if high - low <= FINE {
                break;
            }
        }
        best.ok_or(refused)
    }
}

/// How far a way came.
fn further<E>(route: &Result<Route, FollowError<E>>) -> f64 {
    match route {
        Ok(_) => 1.0,
        Err(FollowError::Stalled(stalled)) => stalled.fraction(),
        Err(_) => -1.0,
    }
}

fn refused(error: FollowError<Refused>, edit: usize, what: &Edit) -> Refused {
    match error {
        FollowError::Boundary(error) => error,
        FollowError::Volume(error) => error.into(),
        FollowError::Stalled(stalled) => Refused::Stalled {
            edit,
            name: what.name(),
            fraction: stalled.fraction(),
            folds: stalled.folds,
            refusal: stalled.refusal,
        },
    }
}

/// The target that a route from `base` leads to.
fn extended(base: Target, route: Route) -> Target {
    let mut target = base;
    target.iterations += route.iterations;
    target.sub_steps += route.waypoints.len();
    if Arc::ptr_eq(&target.points, &target.reference) {
        target.way.clear();
    }
    target.way.extend(route.waypoints.into_iter().map(|waypoint| waypoint.points));
    if let Some(last) = target.way.last() {
        target.points = Arc::clone(last);
    }
    target
}
