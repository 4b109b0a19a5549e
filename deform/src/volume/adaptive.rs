//! Carrying a motion of the boundary that one linear solve cannot follow into the volume in
//! sub-steps.

use std::sync::Arc;

use super::impossible::Prescribed;
use super::route::{BoundaryMotion, FollowError, Route, Stalled, Volume, Waypoint};
use super::spring::sprung;
use super::untangle::Regularisation;
use super::{Deform, Impossible, Untangler, VolumeError, VolumeOperator, agreed};
use crate::communicator::Communicator;
use crate::linear::LinearError;
use crate::mesh::{Mesh, Vector};
use crate::number::real;
use crate::quality::{Guard, Refusal, judge_unless, keeps_unless, quality};
use crate::vector::{add, scale, subtract};

/// The first sub-step, what a sub-step that holds lets the next one grow by, and the least one
/// tried.
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
const UNTANGLED_IN_VAIN: usize = 2;

/// The least one tried where the whole way is proved to be impossible: the fraction is advice then,
/// and no shape is handed out.
const LEAST_IMPOSSIBLE: f64 = 1.0 / 128.0;

/// Shapes tried in between on the way from one valid shape to another.
const BETWEEN: usize = 200;

/// How often the part of the way is halved within which the boundary becomes impossible.
const HALVINGS: usize = 12;

/// Sub-steps are solved no finer than this: what a solve leaves out is small against a sub-step,
/// and the boundary is set exactly.
const TOLERANCE: f64 = 1e-5;

/// Takes the volume along with a motion of its boundary from the shape `start` on.
///
/// One linear solve on the shape reached, with a material stiffened anew, makes a sub-step: a fifth
/// of the way at first. The first that the guard does not let through is tried again with a
/// stiffening of 1, which the rest of the way keeps, unless it was that or more; others are halved,
/// and a small one is untangled (see [`Untangler`]). After one that holds, the next may be half as
/// long again. Each solve starts from what the last one found, made as long as the sub-step.
///
/// Where untangling a small sub-step does not help either, the end of the way is gone for at once:
/// the whole mesh is untangled with its boundary there, from up to three starts. From the shape
/// reached to the one found the way goes straight where it can, else over a shape half way between,
/// which is untangled where need be, and so on. Where the boundary's own way is broken, the shape
/// found is let go and springs back, and the way is that of its springing back, the other way
/// round: vertices of the boundary that lie at the end where they do at the start stay there all
/// the way, others are not where the motion has them until the end.
///
/// A boundary for which [`Impossible`] has a proof is told before anything is solved, and followed
/// nearly as far as there is none. Where there is no proof, two sub-steps untangled in vain end the
/// search. All limits are counts, so that what is found is a function of the arguments alone.
///
/// `untangler`, called where it is needed, is of the reference mesh, which is what cells are drawn
/// back to. Collective, where the mesh is in parts: the motion then must fail on all ranks or on
/// none.
///
/// # Errors
/// [`FollowError`]; [`FollowError::Stalled`] with how far it came. A linear system that cannot be
/// solved is a sub-step that does not hold. Where it is given up, [`FollowError::Volume`] with an
/// error that [says so](VolumeError::is_cancelled).
pub fn follow<M: BoundaryMotion>(
    volume: Volume<'_>,
    start: &Arc<[Vector]>,
    motion: &mut M,
    settings: &Deform,
    guard: &Guard,
    untangler: Option<&dyn Fn() -> Arc<Untangler>>,
) -> Result<Route, FollowError<M::Error>> {
    let settings = Deform { tolerance: settings.tolerance.max(TOLERANCE), ..*settings };
    let route = Route { waypoints: Vec::new(), rejected: 0, untangled: 0, iterations: 0 };
    let here = Waypoint { fraction: 0.0, points: Arc::clone(start) };
    let prescribed = Prescribed::new(volume.domain, volume.boundary);
    let mut follower = Follower { volume, prescribed, motion, guard, untangler, here, route };
    // 1. What no motion of the inside can do.
    let (goal, impossible) = follower.goal().map_err(FollowError::Boundary)?;
    let mut step = FIRST;
    let mut stiffening = settings.stiffening;
    let mut operator = volume.operator.map(Arc::clone);
    // What the last sub-step was solved to, and how long it was.
    let mut latest: Option<(Vec<Vector>, f64)> = None;
    let (mut in_vain, mut end_is_valid) = (0, None);
    while follower.here.fraction < goal {
        let shape = Arc::clone(&follower.here.points);
        let reached = follower.here.fraction;
        // Both that it started from and what was solved for are finite.
        let stiffened = volume.domain.mesh().with_points(shape.to_vec()).map_err(|_| overflow());
        let stiffened =
            agreed(volume.domain.communicator(), stiffened).map_err(FollowError::Volume)?;
        let mut current = match operator.take() {
            Some(first) if follower.route.waypoints.is_empty() => Some(first),
            before => follower.operator(before.as_deref(), &stiffened, stiffening, &settings)?,
        };
        loop {
            if volume.cancellation.is_cancelled() {
                return Err(FollowError::Volume(LinearError::Cancelled.into()));
            }
            // 2. A sub-step by one linear solve. A last one that would leave next to nothing takes
            //    it along.
            let next = if reached + 1.25 * step >= goal { goal } else { reached + step };
            let positions =
                follower.motion.at(reached, next, &shape).map_err(FollowError::Boundary)?;
            let guess = latest
                .as_ref()
                .map(|(displacement, length)| scaled(displacement, (next - reached) / length));
            let mut candidate =
                match follower.moved(current.as_deref(), &shape, &positions, guess)? {
                    Some((displacement, candidate)) => {
                        latest = Some((displacement, next - reached));
                        candidate
                    }
                    None => follower.placed(&shape, &positions),
                };
            // 3. Where that does not hold and is small, the same sub-step untangled; then the end
            //    of the way.
            let mut holds = follower.keeps(&shape, &candidate);
            let folds = !holds
                && volume.domain.communicator().any(follower.motion.folds(&shape, &positions));
            if holds {
                follower.go(next, candidate.as_slice().into());
            } else if next - reached <= UNTANGLED_BELOW && untangler.is_some() {
                if !folds && follower.untangle(&mut candidate, Regularisation::Fitting) {
                    let there = Waypoint { fraction: next, points: candidate.as_slice().into() };
                    holds = follower.bridge(there).map_err(FollowError::Boundary)?;
                }
                in_vain += usize::from(!holds && !folds);
                if !holds
                    && end_is_valid.is_none()
                    && impossible.is_none()
                    && follower.motion.is_stated()
                {
                    end_is_valid = Some(follower.go_for_end(start, current.as_deref())?);
                }
            }
            if follower.here.fraction > reached {
                step = if holds { GROWTH * (next - reached) } else { FIRST * UNTANGLED_BELOW };
                break;
            }
            // 4. The same with more stiffening, else a shorter one, as long as there is hope.
            follower.route.rejected += 1;
            if stiffening < STIFFER && !folds {
                stiffening = STIFFER;
                current =
                    follower.operator(current.as_deref(), &stiffened, stiffening, &settings)?;
                continue;
            }
            step = 0.5 * (next - reached);
            let (least, most) = match (folds, impossible) {
                (true, _) => (LEAST_FOLDING, UNTANGLED_IN_VAIN),
                (false, Some(_)) => (LEAST_IMPOSSIBLE, 1),
                (false, None) => (LEAST, UNTANGLED_IN_VAIN),
            };
            if step < least || in_vain >= most || follower.route.rejected >= TRIES {
                return Err(follower.stalled(
                    &candidate,
                    folds,
                    impossible,
                    end_is_valid == Some(true),
                ));
            }
        }
        operator = current;
    }
    if goal < 1.0 {
        let Waypoint { fraction, points } = follower.here.clone();
        let positions =
            follower.motion.at(fraction, 1.0, &points).map_err(FollowError::Boundary)?;
        let candidate = follower.placed(&points, &positions);
        return Err(follower.stalled(&candidate, false, impossible, false));
    }
    Ok(follower.route)
}

/// A displacement of every vertex, and the shape after it.
type Moved = (Vec<Vector>, Vec<Vector>);

/// A volume on its way.
struct Follower<'a, M> {
    volume: Volume<'a>,
    prescribed: Prescribed<'a>,
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
        let Volume { domain, boundary, .. } = self.volume;
        let mesh = domain.mesh();
        let least = quality(mesh.cells(), mesh.points()).gathered(domain).min;
        let floor = least.min(self.guard.min_scaled_jacobian);
        let floor = floor - 1e-6 * floor.abs();
        let mut proof = |fraction: f64| {
            let positions = self.motion.at(0.0, fraction, &self.here.points)?;
            let points = with_boundary(boundary, &self.here.points, &positions);
            Ok(self.prescribed.proof(&points, floor))
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
        keeps_unless(self.volume.domain, from, to, self.guard, self.volume.cancellation)
    }

    fn untangle(&self, points: &mut [Vector], from: Regularisation) -> bool {
        let floor = self.guard.min_scaled_jacobian;
        let possible = self.prescribed.proof(points, 0.0).is_none();
        possible
            && self
                .untangler
                .is_some_and(|untangler| untangler().untangle_from(points, floor, from))
    }

    fn go(&mut self, fraction: f64, points: Arc<[Vector]>) {
        self.here = Waypoint { fraction, points };
        self.route.waypoints.push(self.here.clone());
    }

    fn placed(&self, shape: &[Vector], positions: &[Vector]) -> Vec<Vector> {
        with_boundary(self.volume.boundary, shape, positions)
    }

    /// Goes for a valid mesh at the end of the way; says whether one was found, from which `here`
    /// may still be far.
    fn go_for_end(
        &mut self,
        start: &Arc<[Vector]>,
        operator: Option<&VolumeOperator>,
    ) -> Result<bool, FollowError<M::Error>> {
        let mut found = false;
        // From where a solve leaves the inside, and from where it is.
        let attempts = [
            (true, Regularisation::Fitting),
            (false, Regularisation::Fitting),
            (true, Regularisation::Large),
        ];
        for (solved, regularisation) in attempts {
            let shape = Arc::clone(&self.here.points);
            let positions =
                self.motion.at(self.here.fraction, 1.0, &shape).map_err(FollowError::Boundary)?;
            let mut points =
                match self.moved(operator.filter(|_| solved), &shape, &positions, None)? {
                    Some((_, candidate)) => candidate,
                    None if solved => continue,
                    None => self.placed(&shape, &positions),
                };
            if !self.untangle(&mut points, regularisation) {
                continue;
            }
            found = true;
            let end = Waypoint { fraction: 1.0, points: points.into() };
            if self.bridge(end.clone()).map_err(FollowError::Boundary)? || self.spring(start, &end)
            {
                break;
            }
        }
        Ok(found)
    }

    /// Goes to another valid shape over straight pieces, as far as these can be found; says whether
    /// it came there.
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
            let positions = self.motion.at(self.here.fraction, fraction, &self.here.points)?;
            let middle: Vec<Vector> = self
                .here
                .points
                .iter()
                .zip(&*next.points)
                .map(|(&a, &b)| scale(add(a, b), 0.5))
                .collect();
            let mut middle = self.placed(&middle, &positions);
            if !self.keeps(&middle, &middle) && !self.untangle(&mut middle, Regularisation::Fitting)
            {
                return Ok(false);
            }
            ahead.push(next);
            ahead.push(Waypoint { fraction, points: middle.into() });
        }
        Ok(true)
    }

    /// Goes from `start` to a valid shape over shapes whose boundary is not where the motion has
    /// it, if there is such a way.
    fn spring(&mut self, start: &Arc<[Vector]>, end: &Waypoint) -> bool {
        let keeps =
            |from: &[Vector], to: &[Vector]| self.keeps(from, to) && self.motion.is_sound(to);
        let Some(way) = sprung(self.volume, start, &end.points, &keeps) else { return false };
        self.route.waypoints.clear();
        let count = way.len();
        for (index, points) in way.into_iter().enumerate() {
            let fraction = if index + 1 == count {
                end.fraction
            } else {
                end.fraction * real(index + 1) / real(count)
            };
            self.route.untangled += 1;
            self.go(fraction, points);
        }
        true
    }

    /// The operator on another shape; `None` where its equations cannot be set up with any
    /// stiffening.
    fn operator(
        &self,
        before: Option<&VolumeOperator>,
        stiffened: &Mesh,
        stiffening: f64,
        settings: &Deform,
    ) -> Result<Option<Arc<VolumeOperator>>, FollowError<M::Error>> {
        let Volume { domain, boundary, solvers, .. } = self.volume;
        for stiffening in [stiffening, 0.0] {
            let made = match before {
                Some(before) => before.restiffened(stiffened, stiffening),
                None => {
                    let settings = Deform { stiffening, ..*settings };
                    VolumeOperator::with_sliding(
                        domain.with_mesh(stiffened.clone()),
                        boundary,
                        &[],
                        &settings,
                        solvers,
                    )
                }
            };
            match made {
                Ok(made) => return Ok(Some(Arc::new(made.with_tolerance(settings.tolerance)))),
                Err(error) if error.is_cancelled() => return Err(FollowError::Volume(error)),
                Err(VolumeError::Linear(_)) => {}
                // A mesh that the guard lets through and the material does not is one that no solve
                // can follow.
                Err(VolumeError::InvertedCell { .. } | VolumeError::OtherRank)
                    if self.here.fraction > 0.0 => {}
                Err(error) => return Err(FollowError::Volume(error)),
            }
        }
        Ok(None)
    }

    /// The displacement that takes the boundary to `positions`, solved for from a guess, and the
    /// shape after it; `None` where it cannot be solved for.
    fn moved(
        &mut self,
        operator: Option<&VolumeOperator>,
        shape: &[Vector],
        positions: &[Vector],
        guess: Option<Vec<Vector>>,
    ) -> Result<Option<Moved>, FollowError<M::Error>> {
        let Some(operator) = operator else { return Ok(None) };
        match moved(operator, shape, positions, guess, &mut self.route.iterations) {
            Ok(found) => Ok(Some(found)),
            Err(error) if error.is_cancelled() => Err(FollowError::Volume(error)),
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
        let Volume { domain, cancellation, .. } = self.volume;
        let here = &self.here.points;
        match judge_unless(domain, here, candidate, &[1.0], self.guard, cancellation) {
            Err(Refusal::Cancelled) => FollowError::Volume(LinearError::Cancelled.into()),
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

/// A shape with the vertices `boundary` at other positions.
pub(crate) fn with_boundary(
    boundary: &[u32],
    shape: &[Vector],
    positions: &[Vector],
) -> Vec<Vector> {
    let mut shape = shape.to_vec();
    for (&vertex, &position) in boundary.iter().zip(positions) {
        shape[vertex as usize] = position;
    }
    shape
}

/// The displacement that takes the boundary to `positions`, solved for from a guess, and the shape
/// after it.
fn moved(
    operator: &VolumeOperator,
    shape: &[Vector],
    positions: &[Vector],
    guess: Option<Vec<Vector>>,
    iterations: &mut usize,
) -> Result<Moved, VolumeError> {
    let displacement: Vec<Vector> = operator
        .boundary()
        .iter()
        .zip(positions)
        .map(|(&vertex, position)| subtract(*position, shape[vertex as usize]))
        .collect();
    let solution = match guess {
        Some(guess) => operator.solve_from(&displacement, &guess)?,
        None => operator.solve(&displacement)?,
    };
    *iterations += solution.iterations;
    let candidate: Vec<Vector> =
        shape.iter().zip(&solution.displacement).map(|(&a, &b)| add(a, b)).collect();
    Ok((solution.displacement, with_boundary(operator.boundary(), &candidate, positions)))
}

fn overflow() -> VolumeError {
    LinearError::NotFinite { iteration: 0 }.into()
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

    use super::*;
    use crate::cancellation::Cancellation;
    use crate::linear::BuiltIn;
    use crate::mesh::Domain;
    use crate::mesh::Mesh;
    use crate::quality::{Refusal, keeps, quality};
    use crate::shapes;
    use crate::volume::tests::cube_boundary;

    fn volume<'a>(
        domain: &'a Domain,
        boundary: &'a [u32],
        cancellation: &'a Cancellation,
    ) -> Volume<'a> {
        Volume { domain, boundary, solvers: &BuiltIn, operator: None, cancellation }
    }

    struct Places<F>(F);

    impl<F: FnMut(f64) -> Vec<Vector>> BoundaryMotion for Places<F> {
        type Error = Infallible;

        fn at(&mut self, _: f64, to: f64, _: &[Vector]) -> Result<Vec<Vector>, Infallible> {
            Ok((self.0)(to))
        }
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

    /// A turn that a single solve cannot follow, on tetrahedra and on hexahedra; every piece of the
    /// way holds.
    #[test]
    fn a_half_twist_is_followed() {
        let guard = Guard { min_scaled_jacobian: 0.01, ..Guard::default() };
        for mesh in [
            shapes::box_of_tets([6, 6, 8], [0.0; 3], [1.0; 3]),
            shapes::box_of_hexahedra([6, 6, 8], [0.0; 3], [1.0; 3]),
        ] {
            let boundary = cube_boundary(&mesh);
            let end = twisted(&mesh, &boundary, 180.0);
            assert!(!keeps(&mesh, mesh.points(), &single(&mesh, &boundary, &end), &guard));
            let start: Arc<[Vector]> = mesh.points().into();
            let untangler = Arc::new(Untangler::new(&mesh, &boundary));
            let untangler = || Arc::clone(&untangler);
            let (domain, wanted) = (Domain::from(&mesh), Cancellation::default());
            let volume = volume(&domain, &boundary, &wanted);
            let mut motion = Places(|to| twisted(&mesh, &boundary, 180.0 * to));
            let route =
                follow(volume, &start, &mut motion, &Deform::default(), &guard, Some(&untangler))
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
                follow(volume, &start, &mut motion, &Deform::default(), &guard, Some(&untangler))
                    .unwrap();
            assert_eq!(route, again);
        }
    }

    /// A cube pressed flat and beyond: it stops short of it, and says where.
    #[test]
    fn what_cannot_be_followed_is_told_with_the_fraction_reached() {
        let mesh = shapes::box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]);
        let boundary = cube_boundary(&mesh);
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
        let domain = Domain::from(&mesh);
        let wanted = Cancellation::default();
        let volume = volume(&domain, &boundary, &wanted);
        let result = follow(
            volume,
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
