//! Carrying a motion of the boundary that one linear solve cannot follow into the volume in sub-steps.

use std::sync::Arc;

use super::spring::sprung;
use super::{Deform, Impossible, Untangler, VolumeError, VolumeOperator, agreed};
use crate::linear::LinearError;
use crate::mesh::{Mesh, Vector};
use crate::partition::{Partition, any};
use crate::quality::{Guard, Refusal, judge_in_parts, keeps_in_parts, quality_in_parts};
use crate::vector::{add, scale, subtract};

/// The first sub-step, what a sub-step that holds lets the next one grow by, and the least one tried.
const FIRST: f64 = 0.2;
const GROWTH: f64 = 1.5;
const LEAST: f64 = 1.0 / 512.0;

/// The least one tried where the boundary itself folds.
const LEAST_FOLDING: f64 = 1.0 / 128.0;

/// Sub-steps longer than this are halved before the volume is untangled.
const UNTANGLED_BELOW: f64 = 0.06;

/// The exponent of the stiffening in sub-steps after one that did not hold with a smaller exponent.
const STIFFER: f64 = 1.0;

/// Sub-steps tried before it is given up, and those of them that were untangled in vain.
const TRIES: usize = 200;
const UNTANGLED_IN_VAIN: usize = 4;

/// Shapes tried in between on the way from one valid shape to another.
const BETWEEN: usize = 200;

/// How often the part of the way is halved within which the boundary becomes impossible.
const HALVINGS: usize = 12;

/// Sub-steps are solved no finer than this: what a solve leaves out is small against a sub-step, and the boundary is set exactly.
const TOLERANCE: f64 = 1e-5;

/// A shape on the way of [`follow`].
#[derive(Debug, Clone, PartialEq)]
pub struct Waypoint {
    /// How far along the motion of the boundary it lies, from 0 to 1. Where that motion could not be followed, but a way to its end was
    /// found on which the boundary goes elsewhere, how far along that.
    pub fraction: f64,
    /// The coordinates of every vertex of the mesh.
    pub points: Arc<[Vector]>,
}

/// A way along which the volume followed its boundary: every straight piece of it was judged.
#[derive(Debug, Clone, PartialEq)]
pub struct Route {
    /// The shapes after the first one; the last has the fraction 1.
    pub waypoints: Vec<Waypoint>,
    /// Sub-steps that were tried and did not hold.
    pub rejected: usize,
    /// Sub-steps that held only after they were untangled.
    pub untangled: usize,
    /// Iterations of the linear solver in all.
    pub iterations: usize,
}

/// A way that ended before the boundary had come to its place.
#[derive(Debug, Clone, PartialEq)]
pub struct Stalled {
    /// As far as it came; its last fraction is the largest that was reached.
    pub route: Route,
    /// What is wrong with the smallest sub-step from there.
    pub refusal: Refusal,
    /// Whether it is the boundary itself that folds in that sub-step.
    pub folds: bool,
    /// Why there is no valid mesh at the end of the way, where that is proved.
    pub impossible: Option<Impossible>,
    /// Whether a valid mesh was found at the end of the way: then it is the way to it that was not.
    pub end_is_valid: bool,
}

impl Stalled {
    /// How far along the motion of the boundary the volume could follow.
    #[must_use]
    pub fn fraction(&self) -> f64 {
        self.route.waypoints.last().map_or(0.0, |last| last.fraction)
    }
}

/// Why the volume did not follow.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FollowError<E> {
    /// The boundary has no place at some fraction.
    #[error(transparent)]
    Boundary(E),
    /// An equation could not be set up or solved.
    #[error(transparent)]
    Volume(VolumeError),
    /// No further sub-step keeps to the guard.
    #[error("the volume can follow {:.1} % of the way: {}", 100.0 * .0.fraction(), .0.refusal.flaw())]
    Stalled(Box<Stalled>),
}

/// A motion of the boundary: where its vertices lie at the fraction `to`, going on from the shape of the whole mesh that was
/// reached at the fraction `from`.
pub trait BoundaryMotion {
    /// Why there is no such place.
    type Error;

    /// The coordinates of each boundary vertex at the fraction `to`.
    ///
    /// # Errors
    /// Where there are none.
    fn at(&mut self, from: f64, to: f64, shape: &[Vector]) -> Result<Vec<Vector>, Self::Error>;

    /// Whether its places at a fraction do not depend on the shape that was reached before it: then they are asked for in any order.
    fn is_stated(&self) -> bool {
        true
    }

    /// Whether the boundary folds over itself on its way to `places`, so that no motion of the inside can help.
    fn folds(&self, shape: &[Vector], places: &[Vector]) -> bool {
        let _ = (shape, places);
        false
    }
}

/// What is taken along with its boundary.
#[derive(Debug, Clone, Copy)]
pub struct Domain<'a> {
    /// The reference mesh, or this rank's part of it, whose cells no other rank has.
    pub mesh: &'a Mesh,
    /// Its vertices on the boundary of the whole mesh.
    pub boundary: &'a [u32],
    /// The parts that the mesh is in.
    pub partition: &'a Arc<dyn Partition>,
    /// An operator of this boundary, set up on the mesh where it starts, if there is one already.
    pub operator: Option<&'a Arc<VolumeOperator>>,
}

/// Takes the volume along with a motion of its boundary from the shape `start` on.
///
/// One linear solve on the shape reached, with a material stiffened anew, makes a sub-step: a fifth of the way at first. The
/// first that the guard does not let through is tried again with a stiffening of 1, which the rest of the way keeps, unless it
/// was that or more; others are halved, and a small one is untangled (see [`Untangler`]). After one that holds, the next may be
/// half as long again. Each solve starts from what the last one found, made as long as the sub-step.
///
/// Where untangling a small sub-step does not help either, the end of the way is gone for at once: the whole mesh is untangled with its
/// boundary there. From the shape reached to the one found the way goes straight where it can, else over a shape half way between, which
/// is untangled where need be, and so on. Where the boundary's own way is broken, the shape found is let go and springs back, and the way
/// is that of its springing back, the other way round: vertices of the boundary that lie at the end where they do at the start stay there all
/// the way, others are not where the motion has them until the end. A boundary for which [`Impossible`] has a proof is told before anything is solved, and
/// followed as far as there is none. So what is found is a function of the arguments alone.
///
/// `untangler`, called where it is needed, is of the reference mesh, which is what cells are drawn back to. Collective, where the
/// mesh is in parts: the motion then must fail on all ranks or on none.
///
/// # Errors
/// [`FollowError`]; [`FollowError::Stalled`] with how far it came. A linear system that cannot be solved is a sub-step that does not hold.
pub fn follow<M: BoundaryMotion>(
    domain: Domain<'_>,
    start: &Arc<[Vector]>,
    motion: &mut M,
    settings: &Deform,
    guard: &Guard,
    untangler: Option<&dyn Fn() -> Arc<Untangler>>,
) -> Result<Route, FollowError<M::Error>> {
    let settings = Deform { tolerance: settings.tolerance.max(TOLERANCE), ..*settings };
    let route = Route { waypoints: Vec::new(), rejected: 0, untangled: 0, iterations: 0 };
    let here = Waypoint { fraction: 0.0, points: Arc::clone(start) };
    let mut follower = Follower { domain, motion, guard, untangler, here, route };
    let (goal, impossible) = follower.goal().map_err(FollowError::Boundary)?;
    let mut step = FIRST;
    let mut stiffening = settings.stiffening;
    let mut operator = domain.operator.map(Arc::clone);
    // What the last sub-step was solved to, and how long it was.
    let mut latest: Option<(Vec<Vector>, f64)> = None;
    let (mut in_vain, mut end_is_valid) = (0, None);
    while follower.here.fraction < goal {
        let shape = Arc::clone(&follower.here.points);
        let reached = follower.here.fraction;
        // Both that it started from and what was solved for are finite.
        let stiffened = domain.mesh.with_points(shape.to_vec()).map_err(|_| overflow());
        let stiffened = agreed(&**domain.partition, stiffened).map_err(FollowError::Volume)?;
        let mut current = match operator.take() {
            Some(first) if follower.route.waypoints.is_empty() => Some(first),
            before => follower.operator(before.as_deref(), &stiffened, stiffening, &settings)?,
        };
        loop {
            // A last sub-step that would leave next to nothing takes it along.
            let next = if reached + 1.25 * step >= goal { goal } else { reached + step };
            let places =
                follower.motion.at(reached, next, &shape).map_err(FollowError::Boundary)?;
            let guess = latest
                .as_ref()
                .map(|(displacement, length)| scaled(displacement, (next - reached) / length));
            let mut candidate = match follower.moved(current.as_deref(), &shape, &places, guess)? {
                Some((displacement, candidate)) => {
                    latest = Some((displacement, next - reached));
                    candidate
                }
                None => follower.placed(&shape, &places),
            };
            let mut holds = follower.keeps(&shape, &candidate);
            let folds = !holds && any(&**domain.partition, follower.motion.folds(&shape, &places));
            if holds {
                follower.go(next, candidate.as_slice().into());
            } else if next - reached <= UNTANGLED_BELOW && untangler.is_some() {
                if !folds && follower.untangle(&mut candidate) {
                    let there = Waypoint { fraction: next, points: candidate.as_slice().into() };
                    holds = follower.bridge(there).map_err(FollowError::Boundary)?;
                }
                in_vain += usize::from(!holds && !folds);
                if !holds && end_is_valid.is_none() && follower.motion.is_stated() {
                    let found = follower.end(goal, current.as_deref())?;
                    end_is_valid = Some(found.is_some());
                    if let Some(end) = found
                        && !follower.bridge(end.clone()).map_err(FollowError::Boundary)?
                        && goal == 1.0
                    {
                        follower.spring(start, &end);
                    }
                }
            }
            if follower.here.fraction > reached {
                step = if holds { GROWTH * (next - reached) } else { FIRST * UNTANGLED_BELOW };
                break;
            }
            follower.route.rejected += 1;
            if stiffening < STIFFER && !folds {
                stiffening = STIFFER;
                current =
                    follower.operator(current.as_deref(), &stiffened, stiffening, &settings)?;
                continue;
            }
            step = 0.5 * (next - reached);
            let given_up = follower.route.rejected >= TRIES || in_vain >= UNTANGLED_IN_VAIN;
            if step < (if folds { LEAST_FOLDING } else { LEAST }) || given_up {
                let end_is_valid = goal == 1.0 && end_is_valid == Some(true);
                return Err(follower.stalled(&candidate, folds, impossible, end_is_valid));
            }
        }
        operator = current;
    }
    if goal < 1.0 {
        let Waypoint { fraction, points } = follower.here.clone();
        let places = follower.motion.at(fraction, 1.0, &points).map_err(FollowError::Boundary)?;
        let candidate = follower.placed(&points, &places);
        return Err(follower.stalled(&candidate, false, impossible, false));
    }
    Ok(follower.route)
}

/// A displacement of every vertex, and the shape after it.
type Moved = (Vec<Vector>, Vec<Vector>);

/// What goes along a way.
struct Follower<'a, M> {
    domain: Domain<'a>,
    motion: &'a mut M,
    guard: &'a Guard,
    untangler: Option<&'a dyn Fn() -> Arc<Untangler>>,
    here: Waypoint,
    route: Route,
}

impl<M: BoundaryMotion> Follower<'_, M> {
    /// How far the boundary can be followed at most, and why no further.
    fn goal(&mut self) -> Result<(f64, Option<Impossible>), M::Error> {
        if !self.motion.is_stated() {
            return Ok((1.0, None));
        }
        let Domain { mesh, boundary, partition, .. } = self.domain;
        let floor = quality_in_parts(mesh.cells(), mesh.points(), &**partition)
            .min
            .min(self.guard.min_scaled_jacobian);
        let floor = floor - 1e-6 * floor.abs();
        let mut proof = |fraction: f64| {
            let places = self.motion.at(0.0, fraction, &self.here.points)?;
            let points = with_boundary(boundary, &self.here.points, &places);
            Ok(Impossible::find(mesh, boundary, &points, floor, &**partition))
        };
        let impossible = proof(1.0)?;
        if impossible.is_none() {
            return Ok((1.0, None));
        }
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if proof(middle)?.is_some() { high = middle } else { low = middle }
        }
        Ok((low, impossible))
    }

    fn keeps(&self, from: &[Vector], to: &[Vector]) -> bool {
        keeps_in_parts(self.domain.mesh, from, to, self.guard, &**self.domain.partition)
    }

    fn untangle(&self, points: &mut [Vector]) -> bool {
        let Domain { mesh, boundary, partition, .. } = self.domain;
        let floor = self.guard.min_scaled_jacobian;
        let possible = Impossible::find(mesh, boundary, points, 0.0, &**partition).is_none();
        possible
            && self.untangler.is_some_and(|untangler| untangler().untangle(mesh, points, floor))
    }

    fn go(&mut self, fraction: f64, points: Arc<[Vector]>) {
        self.here = Waypoint { fraction, points };
        self.route.waypoints.push(self.here.clone());
    }

    fn placed(&self, shape: &[Vector], places: &[Vector]) -> Vec<Vector> {
        with_boundary(self.domain.boundary, shape, places)
    }

    /// The valid mesh with its boundary where it is at `fraction`, if it is found.
    fn end(
        &mut self,
        fraction: f64,
        operator: Option<&VolumeOperator>,
    ) -> Result<Option<Waypoint>, FollowError<M::Error>> {
        let shape = Arc::clone(&self.here.points);
        let places =
            self.motion.at(self.here.fraction, fraction, &shape).map_err(FollowError::Boundary)?;
        let solved = self.moved(operator, &shape, &places, None)?.map(|(_, candidate)| candidate);
        // From where the solve leaves the inside, and from where it is.
        for start in solved.into_iter().chain([self.placed(&shape, &places)]) {
            let mut points = start;
            if self.untangle(&mut points) {
                return Ok(Some(Waypoint { fraction, points: points.into() }));
            }
        }
        Ok(None)
    }

    /// Goes to another valid shape over straight pieces, as far as these can be found; says whether it came there.
    fn bridge(&mut self, end: Waypoint) -> Result<bool, M::Error> {
        let mut ahead = vec![end];
        let mut between = 0;
        while let Some(next) = ahead.pop() {
            if self.keeps(&self.here.points, &next.points) {
                self.route.untangled += 1;
                self.go(next.fraction, next.points);
                continue;
            }
            between += 1;
            if next.fraction - self.here.fraction < LEAST || between > BETWEEN {
                return Ok(false);
            }
            let fraction = 0.5 * (self.here.fraction + next.fraction);
            let places = self.motion.at(self.here.fraction, fraction, &self.here.points)?;
            let middle: Vec<Vector> = self
                .here
                .points
                .iter()
                .zip(&*next.points)
                .map(|(&a, &b)| scale(add(a, b), 0.5))
                .collect();
            let mut middle = self.placed(&middle, &places);
            if !self.keeps(&middle, &middle) && !self.untangle(&mut middle) {
                return Ok(false);
            }
            ahead.push(next);
            ahead.push(Waypoint { fraction, points: middle.into() });
        }
        Ok(true)
    }

    /// Goes from `start` to a valid shape over shapes whose boundary is not where the motion has it, if there is such a way.
    fn spring(&mut self, start: &Arc<[Vector]>, end: &Waypoint) {
        let keeps = |from: &[Vector], to: &[Vector]| self.keeps(from, to);
        let Some(way) = sprung(self.domain, start, &end.points, &keeps) else { return };
        self.route.waypoints.clear();
        let count = way.len();
        for (index, points) in way.into_iter().enumerate() {
            #[expect(clippy::cast_precision_loss, reason = "a few hundred shapes")]
            let fraction = if index + 1 == count {
                end.fraction
            } else {
                end.fraction * (index + 1) as f64 / count as f64
            };
            self.route.untangled += 1;
            self.go(fraction, points);
        }
    }

    /// The operator on another shape; `None` where its equations cannot be set up with any stiffening.
    fn operator(
        &self,
        before: Option<&VolumeOperator>,
        stiffened: &Mesh,
        stiffening: f64,
        settings: &Deform,
    ) -> Result<Option<Arc<VolumeOperator>>, FollowError<M::Error>> {
        let Domain { boundary, partition, .. } = self.domain;
        for stiffening in [stiffening, 0.0] {
            let made = match before {
                Some(before) => before.restiffened(stiffened, stiffening),
                None => {
                    let settings = Deform { stiffening, ..*settings };
                    VolumeOperator::of_part(stiffened, boundary, &[], &settings, partition)
                }
            };
            match made {
                Ok(made) => return Ok(Some(Arc::new(made.with_tolerance(settings.tolerance)))),
                Err(VolumeError::Linear(_)) => {}
                // A mesh that the guard lets through and the material does not is one that no solve can follow.
                Err(VolumeError::InvertedCell { .. } | VolumeError::OtherRank)
                    if self.here.fraction > 0.0 => {}
                Err(error) => return Err(FollowError::Volume(error)),
            }
        }
        Ok(None)
    }

    /// The displacement that takes the boundary to `places`, solved for from a guess, and the shape after it; `None` where it cannot be
    /// solved for.
    fn moved(
        &mut self,
        operator: Option<&VolumeOperator>,
        shape: &[Vector],
        places: &[Vector],
        guess: Option<Vec<Vector>>,
    ) -> Result<Option<Moved>, FollowError<M::Error>> {
        let Some(operator) = operator else { return Ok(None) };
        match moved(operator, shape, places, guess, &mut self.route.iterations) {
            Ok(found) => Ok(Some(found)),
            Err(VolumeError::Linear(_)) => Ok(None),
            Err(error) => Err(FollowError::Volume(error)),
        }
    }

    fn stalled(
        self,
        candidate: &[Vector],
        folds: bool,
        impossible: Option<Impossible>,
        end_is_valid: bool,
    ) -> FollowError<M::Error> {
        let Domain { mesh, partition, .. } = self.domain;
        match judge_in_parts(mesh, &self.here.points, candidate, &[1.0], self.guard, &**partition) {
            Err(refusal) => FollowError::Stalled(Box::new(Stalled {
                route: self.route,
                refusal,
                folds,
                impossible,
                end_is_valid,
            })),
            // `keeps` and `judge` are one test.
            Ok(_) => FollowError::Volume(overflow()),
        }
    }
}

fn scaled(displacement: &[Vector], factor: f64) -> Vec<Vector> {
    displacement.iter().map(|&by| scale(by, factor)).collect()
}

fn with_boundary(boundary: &[u32], shape: &[Vector], places: &[Vector]) -> Vec<Vector> {
    let mut shape = shape.to_vec();
    for (&vertex, &place) in boundary.iter().zip(places) {
        shape[vertex as usize] = place;
    }
    shape
}

/// The displacement that takes the boundary to `places`, solved for from a guess, and the shape after it.
fn moved(
    operator: &VolumeOperator,
    shape: &[Vector],
    places: &[Vector],
    guess: Option<Vec<Vector>>,
    iterations: &mut usize,
) -> Result<Moved, VolumeError> {
    let displacement: Vec<Vector> = operator
        .boundary()
        .iter()
        .zip(places)
        .map(|(&vertex, place)| subtract(*place, shape[vertex as usize]))
        .collect();
    let solution = match guess {
        Some(guess) => operator.solve_from(&displacement, &guess)?,
        None => operator.solve(&displacement)?,
    };
    *iterations += solution.iterations;
    let candidate: Vec<Vector> =
        shape.iter().zip(&solution.displacement).map(|(&a, &b)| add(a, b)).collect();
    Ok((solution.displacement, with_boundary(operator.boundary(), &candidate, places)))
}

fn overflow() -> VolumeError {
    LinearError::NotFinite { iteration: 0 }.into()
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

    use super::*;
    use crate::partition::whole;
    use crate::quality::{keeps, quality};
    use crate::shapes;

    struct Places<F>(F);

    impl<F: FnMut(f64) -> Vec<Vector>> BoundaryMotion for Places<F> {
        type Error = Infallible;

        fn at(&mut self, _: f64, to: f64, _: &[Vector]) -> Result<Vec<Vector>, Infallible> {
            Ok((self.0)(to))
        }
    }

    fn boundary(mesh: &Mesh) -> Vec<u32> {
        let on = |p: &Vector| p.iter().any(|&x| x == 0.0 || x == 1.0);
        (0..).zip(mesh.points()).filter(|(_, p)| on(p)).map(|(vertex, _)| vertex).collect()
    }

    /// The unit cube twisted about its axis by `degrees` from bottom to top.
    fn twisted(mesh: &Mesh, boundary: &[u32], degrees: f64) -> Vec<Vector> {
        let place = |&vertex: &u32| {
            let [x, y, z] = mesh.points()[vertex as usize];
            let (s, c) = (degrees * z).to_radians().sin_cos();
            [0.5 + c * (x - 0.5) - s * (y - 0.5), 0.5 + s * (x - 0.5) + c * (y - 0.5), z]
        };
        boundary.iter().map(place).collect()
    }

    fn single(mesh: &Mesh, boundary: &[u32], places: &[Vector]) -> Vec<Vector> {
        let operator = VolumeOperator::new(mesh, boundary, &Deform::default()).unwrap();
        moved(&operator, mesh.points(), places, None, &mut 0).unwrap().1
    }

    /// A turn that a single solve cannot follow, on tetrahedra and on hexahedra; every piece of the way holds.
    #[test]
    fn a_half_twist_is_followed() {
        let guard = Guard { min_scaled_jacobian: 0.01, ..Guard::default() };
        for mesh in [
            shapes::box_of_tets([6, 6, 8], [0.0; 3], [1.0; 3]),
            shapes::box_of_hexahedra([6, 6, 8], [0.0; 3], [1.0; 3]),
        ] {
            let boundary = boundary(&mesh);
            let end = twisted(&mesh, &boundary, 180.0);
            assert!(!keeps(&mesh, mesh.points(), &single(&mesh, &boundary, &end), &guard));
            let start: Arc<[Vector]> = mesh.points().into();
            let untangler = Arc::new(Untangler::new(&mesh, &boundary));
            let untangler = || Arc::clone(&untangler);
            let partition = whole();
            let domain =
                Domain { mesh: &mesh, boundary: &boundary, partition: &partition, operator: None };
            let mut motion = Places(|to| twisted(&mesh, &boundary, 180.0 * to));
            let route =
                follow(domain, &start, &mut motion, &Deform::default(), &guard, Some(&untangler))
                    .unwrap();
            let mut before = &start;
            for point in &route.waypoints {
                assert!(keeps(&mesh, before, &point.points, &guard));
                before = &point.points;
            }
            assert!(quality(mesh.cells(), before).min >= 0.01);
            assert_eq!(route.waypoints.last().unwrap().fraction, 1.0);
            for (&vertex, place) in boundary.iter().zip(&end) {
                assert_eq!(before[vertex as usize], *place);
            }
            let again =
                follow(domain, &start, &mut motion, &Deform::default(), &guard, Some(&untangler))
                    .unwrap();
            assert_eq!(route, again);
        }
    }

    /// A cube pressed flat and beyond: it stops short of it, and says where.
    #[test]
    fn what_cannot_be_followed_is_told_with_the_fraction_reached() {
        let mesh = shapes::box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]);
        let boundary = boundary(&mesh);
        let start: Arc<[Vector]> = mesh.points().into();
        let pressed = |to: f64| {
            let place = |&vertex: &u32| {
                let [x, y, z] = mesh.points()[vertex as usize];
                [x, y, z * (1.0 - 1.25 * to)]
            };
            boundary.iter().map(place).collect::<Vec<_>>()
        };
        let untangler = Arc::new(Untangler::new(&mesh, &boundary));
        let untangler = || Arc::clone(&untangler);
        let guard = Guard { min_scaled_jacobian: 0.05, ..Guard::default() };
        let partition = whole();
        let domain =
            Domain { mesh: &mesh, boundary: &boundary, partition: &partition, operator: None };
        let result = follow(
            domain,
            &start,
            &mut Places(pressed),
            &Deform::default(),
            &guard,
            Some(&untangler),
        );
        let Err(FollowError::Stalled(stalled)) = result else { panic!("{result:?}") };
        assert!((0.6..0.8).contains(&stalled.fraction()), "{}", stalled.fraction());
        assert!(matches!(stalled.refusal, Refusal::Quality(_)));
        let error = FollowError::<Infallible>::Stalled(stalled).to_string();
        assert!(error.contains("can follow 7") || error.contains("can follow 6"), "{error}");
    }
}
