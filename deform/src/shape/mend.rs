//! Shapes that one linear solve from the reference does not reach.

use std::{cell::OnceCell, sync::Arc};

use crate::{
    edit::{Advance, Edit, Editor},
    mesh::Vector,
    quality::{Guard, Otherwise, SurfaceRule, check_ends, turns_over},
    schedule::Schedule,
    volume::{BoundaryMotion, FollowError, Route, Untangler, Volume, follow, with_boundary},
};

use super::body::Body;
use super::carry::Carrier;
use super::plan::{CurrentShape, Plan};
use super::travel::travel;
use super::{
    Deformation, Phase, Refused, Request, ShapeSeconds, Shaper, Target, check_stack, displaced,
    moved,
};
use crate::communicator::Communicator;

/// Mended shapes that are kept: the newest ones.
const KEPT: usize = 4;

/// Fractions that are tried for the largest feasible one, and how finely it is found where it has
/// to be searched for.
const PROBES: usize = 9;
const FINE: f64 = 1.0 / 128.0;

/// Fractions that are tried before one is told as feasible.
const CONFIRMATIONS: usize = 4;

/// A fraction below this is none.
const LEAST: f64 = 1e-6;

/// What passes is not at the very edge, where the last bit decides.
const ROUNDED_DOWN: f64 = 1.0 - 1e-6;

/// A shape and all that it is a function of.
pub(super) struct Mended {
    stack: Vec<Edit>,
    deform: Deformation,
    guard: Guard,
    target: Target,
}

/// An edit evaluated on the reference surface, as it is for a shape of one solve. Positions and
/// displacements are those of the boundary's vertices.
struct OnReference<'a> {
    editor: Option<&'a mut Editor>,
    /// Where a part of the surface is let go: what says where it ends.
    carrier: Option<Arc<Carrier>>,
    body: Arc<Body>,
    /// Where the boundary lies in the reference.
    positions: Vec<Vector>,
    stack: Vec<Edit>,
    edit: Edit,
    /// Whether no vertex may leave the plane of its mesh.
    in_plane: bool,
    /// Where the boundary lies before the edit and its displacement there, where that is not what
    /// the stack says.
    ground: Option<(Vec<Vector>, Vec<Vector>)>,
    rule: SurfaceRule,
}

impl BoundaryMotion for OnReference<'_> {
    type Error = Refused;

    fn at(&mut self, _: f64, to: f64, _: &[Vector]) -> Result<Vec<Vector>, Refused> {
        self.body.require_wanted()?;
        if let Some(last) = self.stack.last_mut() {
            *last = self.edit.scaled(to);
        }
        let editor = self.editor.as_deref_mut();
        let carrier = self.carrier.as_deref();
        let displacement = displacement(editor, &self.body, &self.stack, carrier, self.in_plane)?;
        Ok(match &self.ground {
            None => self
                .positions
                .iter()
                .zip(&displacement)
                .map(|(&point, &by)| moved(point, by))
                .collect(),
            Some((positions, ground)) => positions
                .iter()
                .zip(ground.iter().zip(&displacement))
                .map(|(&position, (ground, by))| {
                    moved(position, std::array::from_fn(|axis| by[axis] - ground[axis]))
                })
                .collect(),
        })
    }

    fn is_sound(&self, shape: &[Vector]) -> bool {
        let gathered = self.body.gather(shape);
        gathered.and_then(|shape| self.body.require_sound(&shape, self.rule)).is_ok()
    }

    fn folds(&self, shape: &[Vector], positions: &[Vector]) -> bool {
        folds(&self.body, shape, positions)
    }
}

/// An edit evaluated on the shape reached: each sub-step's motion of the handle is carried to the
/// free surface as that lies then. A surface that follows in this way does not fold as long as no
/// sub-step folds it.
struct OnShape<'a> {
    on_reference: OnReference<'a>,
    /// Where the surface is.
    advance: Option<Advance>,
}

impl BoundaryMotion for OnShape<'_> {
    type Error = Refused;

    fn at(&mut self, from: f64, to: f64, shape: &[Vector]) -> Result<Vec<Vector>, Refused> {
        let positions = self.on_reference.at(from, to, shape)?;
        let body = &self.on_reference.body;
        let now = body.gather(shape)?;
        let mut wanted = body.gather(&with_boundary(body.vertices(), shape, &positions))?;
        let carried = match &self.advance {
            Some(advance) => {
                advance.carry(&now, &mut wanted).map(|()| wanted).map_err(Refused::from)
            }
            None => Ok(Vec::new()),
        };
        body.scatter(carried)
    }

    fn is_stated(&self) -> bool {
        false
    }

    fn folds(&self, shape: &[Vector], positions: &[Vector]) -> bool {
        self.on_reference.folds(shape, positions)
    }
}

/// The displacement of the boundary that a stack makes, with what is let go of it where it ends.
fn displacement(
    editor: Option<&mut Editor>,
    body: &Body,
    stack: &[Edit],
    carrier: Option<&Carrier>,
    in_plane: bool,
) -> Result<Vec<Vector>, Refused> {
    let displacement = body.scatter(displaced(editor, stack, in_plane))?;
    match carrier {
        Some(carrier) => carrier.settle(displacement),
        None => Ok(displacement),
    }
}

/// Whether a triangle of the surface turns over, as far as this process can say.
fn folds(body: &Body, shape: &[Vector], positions: &[Vector]) -> bool {
    let gathered = body.gather(shape).and_then(|before| {
        let after = body.gather(&with_boundary(body.vertices(), shape, positions))?;
        Ok((before, after))
    });
    let (Ok((before, after)), Some(surface)) = (gathered, body.surface()) else { return false };
    surface.triangles().iter().any(|triangle| {
        let at = |shape: &[Vector]| triangle.map(|vertex| shape[vertex as usize]);
        turns_over(&at(&before), &at(&after))
    })
}

impl Shaper {
    /// The way to the shape that is asked for, as the guard has it: the shape of one linear solve,
    /// else what [`Guard::otherwise`] says.
    ///
    /// The shape depends on the reference mesh and on the request's stack, deformation and guard
    /// alone; with [`Otherwise::Clamp`], how far it goes depends on the start and the schedule too.
    ///
    /// # Errors
    /// [`Refused`], with what was reached, where it broke, and what fraction would pass.
    pub fn plan(&mut self, request: &Request) -> Result<Plan, Refused> {
        self.spent = ShapeSeconds::default();
        let plan = self.way_to(request);
        self.body.unless_given_up(plan)
    }

    fn way_to(&mut self, request: &Request) -> Result<Plan, Refused> {
        let Request { stack, start, deformation, schedule, guard, .. } = request;
        check_stack(&**stack)?;
        schedule.check()?;
        match guard.otherwise {
            Otherwise::Untangle if !deformation.surface_only => {
                let target = self.settled(stack, deformation, guard)?;
                let shape = self.body.gather(&target.points)?;
                self.body.require_sound(&shape, guard.surface)?;
                self.go(start, &target, schedule, guard)
            }
            Otherwise::Clamp => self.clamped(request),
            _ => {
                let target = self.target(stack, deformation, guard)?;
                match self.go(start, &target, schedule, guard) {
                    Err(refused) if refused.is_quality() => self.confirmed(request, refused),
                    plan => plan,
                }
            }
        }
    }

    /// The refusal of a request, with a feasible fraction that was tried: that of the straight way to
    /// its shape is another where edits turn or shapes are improved.
    ///
    /// # Errors
    /// Always: the refusal, or that it was given up.
    fn confirmed(&mut self, request: &Request, refused: Refused) -> Result<Plan, Refused> {
        let Some(mut fraction) = refused.feasible_fraction() else { return Err(refused) };
        if request.kept >= request.stack.len() {
            return Err(refused);
        }
        for _ in 0..CONFIRMATIONS {
            if fraction <= LEAST {
                break;
            }
            let passes = match self.part(request, fraction * ROUNDED_DOWN) {
                Ok(_) => return self.body.agree(Err(refused.with_feasible_fraction(fraction))),
                Err(refused) if refused.is_cancelled() => return Err(refused),
                Err(refused) => refused.feasible_fraction().filter(|passes| *passes < 1.0),
            };
            fraction *= passes.unwrap_or(0.5);
        }
        self.body.agree(Err(refused.with_feasible_fraction(0.0)))
    }

    /// The way to the shape of a fraction of the edits after those that are kept.
    fn part(&mut self, request: &Request, fraction: f64) -> Result<Plan, Refused> {
        let Request { stack, kept, start, deformation, schedule, guard } = request;
        let scaled: Vec<Edit> = (stack.iter().enumerate())
            .map(|(index, edit)| if index < *kept { edit.clone() } else { edit.scaled(fraction) })
            .collect();
        let target = self.target(&scaled, deformation, guard)?;
        self.go(start, &Target { fraction, ..target }, schedule, guard)
    }

    /// The way from `start` to a target.
    ///
    /// # Errors
    /// [`Refused::Guard`], [`Refused::Limit`].
    pub fn go(
        &mut self,
        start: &CurrentShape,
        target: &Target,
        schedule: &Schedule,
        guard: &Guard,
    ) -> Result<Plan, Refused> {
        schedule.check()?;
        self.body.require_wanted()?;
        let watch = self.stopwatch(Phase::Guard);
        if target.surface_only || start.surface_only {
            let ends = check_ends(self.body.domain.mesh(), &start.points, &target.points);
            self.body.agree(ends.map_err(Refused::from))?;
            if !target.surface_only {
                // The solver moves its volume on the way; where that ends, it is the target's.
                let end = self.body.judge(&target.points, &target.points, &[1.0], guard);
                let end = self.body.unless_given_up(end.map_err(Refused::from));
                self.body.agree(end)?;
            }
            let plan = self.along_surface(start, target, schedule, guard);
            let spent = watch.seconds();
            self.spent.guard += spent;
            let seconds = ShapeSeconds { guard: target.seconds.guard + spent, ..target.seconds };
            return Ok(plan?.finished(&self.body, seconds));
        }
        // Of several ranks all say the same, each with its own cells' numbers in it.
        let plan = self.body.unless_given_up(travel(&self.body, start, target, schedule, guard));
        let plan = self.body.agree(plan);
        let spent = watch.seconds();
        self.spent.guard += spent;
        let seconds = ShapeSeconds { guard: target.seconds.guard + spent, ..target.seconds };
        Ok(plan?.finished(&self.body, seconds))
    }

    /// The shape of a stack: of one linear solve from the reference where the guard lets that
    /// through, else the shape of the edits below the last one, from which the last one is followed
    /// in sub-steps.
    fn settled(
        &mut self,
        stack: &[Edit],
        deform: &Deformation,
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
            let mut linear = match self.target(&stack[..lower], deform, guard) {
                // Followed in sub-steps, the surface may come out sound, and a solve that broke
                // down may be smaller ones that do not.
                Err(refused) if (refused.is_surface() || refused.breaks_down()) && lower > 0 => {
                    lower -= 1;
                    continue;
                }
                linear => linear?,
            };
            let watch = self.stopwatch(Phase::Guard);
            let holds = lower == 0 || self.body.keeps(&self.reference, &linear.points, guard);
            linear.seconds.guard += watch.seconds();
            self.spent.guard += linear.seconds.guard;
            if holds {
                linear.way = vec![Arc::clone(&linear.points)];
                break linear;
            }
            lower -= 1;
        };
        for index in lower..stack.len() {
            let followed = self.followed(&stack[..=index], target, deform, guard);
            // A result that was interrupted by a cancellation is kept for no later order.
            self.body.require_wanted()?;
            target = followed?;
            if self.mended.len() >= KEPT {
                self.mended.remove(0);
            }
            let stack = stack[..=index].to_vec();
            self.mended.push(Mended {
                stack,
                deform: deform.clone(),
                guard: *guard,
                target: target.clone(),
            });
        }
        Ok(target)
    }

    /// The shape of a stack whose edits below the last one make the shape `base`.
    fn followed(
        &mut self,
        stack: &[Edit],
        base: Target,
        deform: &Deformation,
        guard: &Guard,
    ) -> Result<Target, Refused> {
        let Some((edit, below)) = stack.split_last().filter(|(edit, _)| !edit.muted()) else {
            return Ok(base);
        };
        let watch = self.stopwatch(Phase::Volume);
        let body = Arc::clone(&self.body);
        let positions = body.positions(&base.points);
        let set_up = self.operator(deform)?;
        // Sub-steps prescribe the whole boundary, also where the deformation lets go of some of it.
        let at_reference = Arc::ptr_eq(&base.points, &self.reference) && !deform.lets_go();
        let operator = at_reference.then(|| Arc::clone(set_up.operator()));
        let carrier = deform.lets_go().then_some(set_up);
        let known = self.untangler.clone().map_or_else(OnceCell::new, OnceCell::from);
        let untangler = || {
            let made = || {
                let untangler = Untangler::new(&body.domain, body.vertices());
                Arc::new(untangler.with_cancellation(body.cancellation.clone()))
            };
            Arc::clone(known.get_or_init(made))
        };
        let ground =
            displacement(self.editor.as_mut(), &body, below, carrier.as_deref(), self.in_plane)?;
        let reference = body.positions(&self.reference);
        let stated = reference.iter().zip(&ground).map(|(&point, &by)| moved(point, by));
        let as_stated = body.communicator().all(stated.eq(positions.iter().copied()));
        let mut motion = OnReference {
            editor: self.editor.as_mut(),
            carrier,
            body: Arc::clone(&body),
            positions: reference,
            stack: stack.to_vec(),
            edit: edit.clone(),
            in_plane: self.in_plane,
            ground: (!as_stated).then_some((positions, ground)),
            rule: guard.surface,
        };
        let volume = Volume {
            domain: &body.domain,
            boundary: body.vertices(),
            solvers: &*body.solvers,
            operator: operator.as_ref(),
            cancellation: &body.cancellation,
        };
        let mut route =
            follow(volume, &base.points, &mut motion, &deform.equation, guard, Some(&untangler));
        // No volume can follow a surface that folds or shrinks to nothing: it is asked for in
        // another way.
        if matches!(route, Err(FollowError::Stalled(_))) && !deform.lets_go() {
            let advance = body
                .surface()
                .map(|surface| Advance::new(surface, edit, stack.len() - 1))
                .transpose();
            let advance = body.agree(advance.map_err(Refused::from))?.flatten();
            if body.of_root(usize::from(advance.is_some())) > 0 {
                let mut motion = OnShape { on_reference: motion, advance };
                let second = follow(
                    volume,
                    &base.points,
                    &mut motion,
                    &deform.equation,
                    guard,
                    Some(&untangler),
                );
                if is_cancelled(&second) || further(&second) > further(&route) {
                    route = second;
                }
            }
        }
        self.untangler = known.into_inner();
        let index = stack.len() - 1;
        let mut target = match route {
            Ok(route) => extended(base, with_ghosts(&body, route)),
            Err(error) => {
                self.spent.volume += watch.seconds();
                return body.agree(Err(refused(error, index, edit)));
            }
        };
        if let Some(improved) = self.improved(&target.points, deform)
            && body.keeps(&target.points, &improved, guard)
        {
            target.points = Arc::clone(&improved);
            target.way.push(improved);
        }
        let seconds = watch.seconds();
        self.spent.volume += seconds;
        target.seconds.volume += seconds;
        Ok(target)
    }

    /// The largest fraction of the edits after those that are kept that the guard lets through.
    fn clamped(&mut self, request: &Request) -> Result<Plan, Refused> {
        let Request { stack, kept, start, deformation, schedule, guard } = request;
        let whole = self.target(stack, deformation, guard);
        let refused = match whole.and_then(|whole| self.go(start, &whole, schedule, guard)) {
            Err(refused)
                if (refused.is_quality() || refused.is_surface()) && *kept < stack.len() =>
            {
                refused
            }
            other => return other,
        };
        // The shapes of most edits lie on a straight way, on which the fraction is known.
        let (mut low, mut high, mut best) = (0.0, 1.0, None::<Plan>);
        let mut guess = refused.feasible_fraction().unwrap_or(0.5) * ROUNDED_DOWN;
        for _ in 0..PROBES {
            if !(guess > LEAST && guess < 1.0) {
                guess = 0.5 * (low + high);
            }
            let before = std::mem::replace(&mut guess, f64::NAN);
            match self.part(request, before) {
                Ok(plan) => {
                    if best.is_none() {
                        guess = before + FINE;
                    }
                    (low, best) = (before, Some(plan));
                }
                Err(refused) if refused.is_cancelled() => return Err(refused),
                // A part may be refused for what the whole is not, such as leaving its plane on the way.
                Err(_) => high = before,
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

fn is_cancelled(route: &Result<Route, FollowError<Refused>>) -> bool {
    match route {
        Err(FollowError::Boundary(error)) => error.is_cancelled(),
        Err(FollowError::Volume(error)) => error.is_cancelled(),
        Ok(_) | Err(FollowError::Stalled(_)) => false,
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

/// The route with the vertices of ghost cells, which did not come along, where their owners have
/// them.
fn with_ghosts(body: &Body, mut route: Route) -> Route {
    if body.communicator().size() > 1 {
        for waypoint in &mut route.waypoints {
            let mut points = waypoint.points.to_vec();
            body.update(&mut points);
            waypoint.points = points.into();
        }
    }
    route
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
