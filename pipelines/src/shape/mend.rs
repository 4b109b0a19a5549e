//! Shapes that one linear solve from the reference does not reach.

use std::{cell::OnceCell, sync::Arc};

use tombolo_deform::{
    mesh::Vector,
    quality::{Guard, Otherwise, turns_over},
    schedule::Schedule,
    surface::{Advance, Edit, Editor},
    volume::{BoundaryMotion, Domain, FollowError, Route, Untangler, VolumeError, follow},
};

use crate::language::{DeformStage, check_stack};

use super::boundary::Boundary;
use super::carry::Carrier;
use super::plan::{Body, Place, Plan, travel};
use super::{Refused, ShapeSeconds, Shaper, Stopwatch, Target, displaced, moved};

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

/// An edit evaluated on the reference surface, as it is for a shape of one solve. Places and displacements are those of the
/// boundary's vertices.
struct OnReference<'a> {
    editor: Option<&'a mut Editor>,
    /// Where a part of the surface is let go: what says where it ends.
    carrier: Option<Arc<Carrier>>,
    boundary: Arc<Boundary>,
    /// Where the boundary lies in the reference.
    places: Vec<Vector>,
    stack: Vec<Edit>,
    edit: Edit,
    /// Where the boundary lies before the edit and its displacement there, where that is not what the stack says.
    ground: Option<(Vec<Vector>, Vec<Vector>)>,
}

impl BoundaryMotion for OnReference<'_> {
    type Error = Refused;

    fn at(&mut self, _: f64, to: f64, _: &[Vector]) -> Result<Vec<Vector>, Refused> {
        if let Some(last) = self.stack.last_mut() {
            *last = self.edit.scaled(to);
        }
        let editor = self.editor.as_deref_mut();
        let displacement =
            displacement(editor, &self.boundary, &self.stack, self.carrier.as_deref())?;
        Ok(match &self.ground {
            None => self
                .places
                .iter()
                .zip(&displacement)
                .map(|(&point, &by)| moved(point, by))
                .collect(),
            Some((places, ground)) => places
                .iter()
                .zip(ground.iter().zip(&displacement))
                .map(|(&place, (ground, by))| {
                    moved(place, std::array::from_fn(|axis| by[axis] - ground[axis]))
                })
                .collect(),
        })
    }

    fn folds(&self, shape: &[Vector], places: &[Vector]) -> bool {
        folds(&self.boundary, shape, places)
    }
}

/// The same edit evaluated on the shape reached: each sub-step's motion of the handle is carried to the free surface as that lies
/// then. A surface that follows in this way does not fold as long as no sub-step folds it.
struct OnShape<'a> {
    on_reference: OnReference<'a>,
    /// Where the surface is.
    advance: Option<Advance>,
}

impl BoundaryMotion for OnShape<'_> {
    type Error = Refused;

    fn at(&mut self, from: f64, to: f64, shape: &[Vector]) -> Result<Vec<Vector>, Refused> {
        let places = self.on_reference.at(from, to, shape)?;
        let boundary = &self.on_reference.boundary;
        let now = boundary.gather(shape)?;
        let mut wanted = boundary.gather(&with_boundary(boundary, shape, &places))?;
        let carried = match &self.advance {
            Some(advance) => {
                advance.carry(&now, &mut wanted).map(|()| wanted).map_err(Refused::from)
            }
            None => Ok(Vec::new()),
        };
        boundary.scatter(carried)
    }

    fn is_stated(&self) -> bool {
        false
    }

    fn folds(&self, shape: &[Vector], places: &[Vector]) -> bool {
        self.on_reference.folds(shape, places)
    }
}

/// The displacement of the boundary that a stack makes, with what is let go of it where it ends.
fn displacement(
    editor: Option<&mut Editor>,
    boundary: &Boundary,
    stack: &[Edit],
    carrier: Option<&Carrier>,
) -> Result<Vec<Vector>, Refused> {
    let displacement = boundary.scatter(displaced(editor, stack))?;
    match carrier {
        Some(carrier) => carrier.settle(displacement),
        None => Ok(displacement),
    }
}

/// A shape of the mesh with its boundary at `places`.
fn with_boundary(boundary: &Boundary, shape: &[Vector], places: &[Vector]) -> Vec<Vector> {
    let mut shape = shape.to_vec();
    for (&vertex, &place) in boundary.vertices().iter().zip(places) {
        shape[vertex as usize] = place;
    }
    shape
}

/// Whether a triangle of the surface turns over, as far as this process can say.
fn folds(boundary: &Boundary, shape: &[Vector], places: &[Vector]) -> bool {
    let gathered = boundary.gather(shape).and_then(|before| {
        let after = boundary.gather(&with_boundary(boundary, shape, places))?;
        Ok((before, after))
    });
    let (Ok((before, after)), Some(surface)) = (gathered, boundary.surface()) else { return false };
    surface.triangles().iter().any(|triangle| {
        let at = |shape: &[Vector]| triangle.map(|vertex| shape[vertex as usize]);
        turns_over(&at(&before), &at(&after))
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
        check_stack(stack)?;
        schedule.check()?;
        match guard.otherwise {
            Otherwise::Untangle if !deform.surface_only => {
                let target = self.settled(stack, deform, guard)?;
                let shape = self.boundary.gather(&target.points)?;
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
    /// [`Refused::Guard`], [`Refused::Limit`].
    pub fn go(
        &mut self,
        start: &Place,
        target: &Target,
        schedule: &Schedule,
        guard: &Guard,
    ) -> Result<Plan, Refused> {
        schedule.check()?;
        let watch = Stopwatch::start();
        if target.surface_only || start.surface_only {
            let plan = self.along_surface(start, target, schedule, guard);
            let spent = watch.seconds();
            self.spent.guard += spent;
            let seconds = ShapeSeconds { guard: target.seconds.guard + spent, ..target.seconds };
            return Ok(plan?.finished(&self.boundary, seconds));
        }
        let body = Body { mesh: &self.mesh, boundary: &self.boundary };
        // Of several ranks all say the same, each with its own cells' numbers in it.
        let plan = self.boundary.agree(travel(body, start, target, schedule, guard));
        let spent = watch.seconds();
        self.spent.guard += spent;
        let seconds = ShapeSeconds { guard: target.seconds.guard + spent, ..target.seconds };
        Ok(plan?.finished(&self.boundary, seconds))
    }

    /// The shape of a stack: of one linear solve from the reference where the guard lets that through, else the shape of the
    /// edits below the last one, from which the last one is followed in sub-steps.
    fn settled(
        &mut self,
        stack: &[Edit],
        deform: &DeformStage,
        guard: &Guard,
    ) -> Result<Target, Refused> {
        let mut lower = stack.len();
        let mut target = loop {
            let known = |mended: &&Mended| {
                mended.stack == stack[..lower] && mended.deform == *deform && mended.guard == *guard
            };
            if let Some(found) = self.mended.iter().find(known) {
                break Target { seconds: ShapeSeconds::default(), ..found.target.clone() };
            }
            let mut linear = match self.target(&stack[..lower], deform, guard.surface) {
                // Followed in sub-steps, the surface may come out sound, and a solve that broke down may be smaller ones that do not.
                Err(refused)
                    if (refused.is_surface() || self.breaks_down(&refused)) && lower > 0 =>
                {
                    lower -= 1;
                    continue;
                }
                linear => linear?,
            };
            let watch = Stopwatch::start();
            let holds = lower == 0 || self.keeps(&self.reference, &linear.points, guard);
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
            self.mended.push(Mended {
                stack,
                deform: deform.clone(),
                guard: *guard,
                target: target.clone(),
            });
        }
        Ok(target)
    }

    /// Whether a linear system could not be solved. Of several ranks each may have another reason, and none can go on alone.
    fn breaks_down(&self, refused: &Refused) -> bool {
        self.boundary.partition().ranks() == 1
            && matches!(refused, Refused::Volume(VolumeError::Linear(_)))
    }

    /// The shape of a stack whose edits below the last one make the shape `base`.
    fn followed(
        &mut self,
        stack: &[Edit],
        base: Target,
        deform: &DeformStage,
        guard: &Guard,
    ) -> Result<Target, Refused> {
        let Some((edit, below)) = stack.split_last().filter(|(edit, _)| !edit.muted()) else {
            return Ok(base);
        };
        let watch = Stopwatch::start();
        let boundary = Arc::clone(&self.boundary);
        let places = boundary.places(&base.points);
        let set_up = self.operator(deform)?;
        // Sub-steps prescribe the whole boundary, also where the deformation lets go of some of it.
        let at_reference = Arc::ptr_eq(&base.points, &self.reference) && !deform.lets_go();
        let operator = at_reference.then(|| Arc::clone(set_up.operator()));
        let carrier = deform.lets_go().then_some(set_up);
        let known = self.untangler.clone().map_or_else(OnceCell::new, OnceCell::from);
        let untangler = || {
            let made = || {
                Arc::new(Untangler::of_part(&self.mesh, boundary.vertices(), boundary.partition()))
            };
            Arc::clone(known.get_or_init(made))
        };
        let ground = displacement(self.editor.as_mut(), &boundary, below, carrier.as_deref())?;
        let reference = boundary.places(&self.reference);
        let as_stated = boundary.all(
            reference
                .iter()
                .zip(&ground)
                .zip(&places)
                .all(|((&point, &by), place)| moved(point, by) == *place),
        );
        let mut motion = OnReference {
            editor: self.editor.as_mut(),
            carrier,
            boundary: Arc::clone(&boundary),
            places: reference,
            stack: stack.to_vec(),
            edit: edit.clone(),
            ground: (!as_stated).then_some((places, ground)),
        };
        let domain = Domain {
            mesh: &self.mesh,
            boundary: boundary.vertices(),
            partition: boundary.partition(),
            operator: operator.as_ref(),
        };
        let mut route =
            follow(domain, &base.points, &mut motion, &deform.equation, guard, Some(&untangler));
        // No volume can follow a surface that folds or shrinks to nothing: it is asked for in another way.
        if matches!(route, Err(FollowError::Stalled(_))) && !deform.lets_go() {
            let advance = boundary
                .surface()
                .map(|surface| Advance::new(surface, edit, stack.len() - 1))
                .transpose();
            let advance = boundary.agree(advance.map_err(Refused::from))?.flatten();
            if boundary.of_root(f64::from(u8::from(advance.is_some()))) > 0.0 {
                let mut motion = OnShape { on_reference: motion, advance };
                let second = follow(
                    domain,
                    &base.points,
                    &mut motion,
                    &deform.equation,
                    guard,
                    Some(&untangler),
                );
                if further(&second) > further(&route) {
                    route = second;
                }
            }
        }
        self.untangler = known.into_inner();
        let place = stack.len() - 1;
        let mut target = match route {
            Ok(route) => extended(base, with_ghosts(&boundary, route)?),
            Err(error) => {
                self.spent.volume += watch.seconds();
                return boundary.agree(Err(refused(error, place, edit)));
            }
        };
        if let Some(improved) = self.improved(&target.points, deform)?
            && self.keeps(&target.points, &improved, guard)
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
            Err(refused)
                if (refused.is_quality() || refused.is_surface()) && kept < stack.len() =>
            {
                refused
            }
            other => return other,
        };
        let mut part = |fraction: f64| -> Result<Option<Plan>, Refused> {
            let scaled: Vec<Edit> = stack
                .iter()
                .enumerate()
                .map(
                    |(place, edit)| if place < kept { edit.clone() } else { edit.scaled(fraction) },
                )
                .collect();
            let target = self.target(&scaled, deform, guard.surface);
            match target
                .and_then(|target| self.go(start, &Target { fraction, ..target }, schedule, guard))
            {
                Ok(plan) => Ok(Some(plan)),
                Err(refused) if refused.is_quality() || refused.is_surface() => Ok(None),
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
            impossible: stalled.impossible.map(Box::new),
            end_is_valid: stalled.end_is_valid,
        },
    }
}

/// The route with the vertices of ghost cells, which did not come along, where their owners have them.
fn with_ghosts(boundary: &Boundary, mut route: Route) -> Result<Route, Refused> {
    if boundary.partition().ranks() > 1 {
        for waypoint in &mut route.waypoints {
            let mut points = waypoint.points.to_vec();
            boundary.take_from_owners(&mut points)?;
            waypoint.points = points.into();
        }
    }
    Ok(route)
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
