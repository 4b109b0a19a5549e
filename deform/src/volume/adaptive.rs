//! Carrying a motion of the boundary that one linear solve cannot follow into the volume in sub-steps.

use std::sync::Arc;

use super::{Deform, Untangler, VolumeError, VolumeOperator, agreed};
use crate::linear::LinearError;
use crate::mesh::{Mesh, Vector};
use crate::partition::{Partition, any};
use crate::quality::{Guard, Refusal, judge_in_parts, keeps_in_parts};
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

/// Sub-steps tried before it is given up.
const TRIES: usize = 200;

/// Sub-steps are solved no finer than this: what a solve leaves out is small against a sub-step, and the boundary is set exactly.
const TOLERANCE: f64 = 1e-5;

/// A shape on the way of [`follow`].
#[derive(Debug, Clone, PartialEq)]
pub struct Waypoint {
    /// How far along the motion of the boundary it lies, from 0 to 1.
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
/// half as long again. Each solve starts from what the last one found, made as long as the sub-step. So what is found is a function
/// of the arguments alone.
///
/// `untangler`, called where it is needed, is of the reference mesh, which is what cells are drawn back to. Collective, where the mesh is in parts: the motion
/// then must fail on all ranks or on none.
///
/// # Errors
/// [`FollowError`]; [`FollowError::Stalled`] with how far it came.
pub fn follow<M: BoundaryMotion>(
    domain: Domain<'_>,
    start: &Arc<[Vector]>,
    motion: &mut M,
    settings: &Deform,
    guard: &Guard,
    untangler: Option<&dyn Fn() -> Arc<Untangler>>,
) -> Result<Route, FollowError<M::Error>> {
    let Domain { mesh, boundary, partition, operator } = domain;
    let settings = Deform { tolerance: settings.tolerance.max(TOLERANCE), ..*settings };
    let mut route = Route { waypoints: Vec::new(), rejected: 0, untangled: 0, iterations: 0 };
    let mut shape = Arc::clone(start);
    let (mut reached, mut step) = (0.0, FIRST);
    let mut stiffening = settings.stiffening;
    let mut operator = operator.map(Arc::clone);
    // What the last sub-step was solved to, and how long it was.
    let mut latest: Option<(Vec<Vector>, f64)> = None;
    while reached < 1.0 {
        // Both that it started from and what was solved for are finite.
        let stiffened = mesh.with_points(shape.to_vec()).map_err(|_| overflow());
        let stiffened = agreed(&**partition, stiffened).map_err(FollowError::Volume)?;
        let mut current = match operator.take() {
            Some(first) if route.waypoints.is_empty() => first,
            Some(before) => restiffened(&before, &stiffened, stiffening, &settings).map_err(FollowError::Volume)?,
            None => Arc::new(
                VolumeOperator::of_part(&stiffened, boundary, &[], &settings, partition)
                    .map_err(FollowError::Volume)?,
            ),
        };
        loop {
            // A last sub-step that would leave next to nothing takes it along.
            let next = if reached + 1.25 * step >= 1.0 { 1.0 } else { reached + step };
            let places = motion.at(reached, next, &shape).map_err(FollowError::Boundary)?;
            let guess = latest.as_ref().map(|(displacement, length)| scaled(displacement, (next - reached) / length));
            let (displacement, mut candidate) =
                moved(&current, &shape, &places, guess, &mut route.iterations).map_err(FollowError::Volume)?;
            latest = Some((displacement, next - reached));
            let mut holds = keeps_in_parts(mesh, &shape, &candidate, guard, &**partition);
            let folds = !holds && any(&**partition, motion.folds(&shape, &places));
            if let Some(untangler) = untangler
                && !(holds || folds)
                && next - reached <= UNTANGLED_BELOW
                && untangler().untangle(mesh, &mut candidate, guard.min_scaled_jacobian)
            {
                holds = keeps_in_parts(mesh, &shape, &candidate, guard, &**partition);
                route.untangled += usize::from(holds);
            }
            if holds {
                shape = candidate.into();
                route.waypoints.push(Waypoint { fraction: next, points: Arc::clone(&shape) });
                (reached, step) = (next, GROWTH * (next - reached));
                break;
            }
            route.rejected += 1;
            if stiffening < STIFFER && !folds {
                stiffening = STIFFER;
                current = restiffened(&current, &stiffened, stiffening, &settings).map_err(FollowError::Volume)?;
                continue;
            }
            step = 0.5 * (next - reached);
            if step < (if folds { LEAST_FOLDING } else { LEAST }) || route.rejected >= TRIES {
                return Err(stalled(domain, &shape, &candidate, guard, route, folds));
            }
        }
        operator = Some(current);
    }
    Ok(route)
}

fn restiffened(
    operator: &VolumeOperator,
    mesh: &Mesh,
    stiffening: f64,
    settings: &Deform,
) -> Result<Arc<VolumeOperator>, VolumeError> {
    Ok(Arc::new(operator.restiffened(mesh, stiffening)?.with_tolerance(settings.tolerance)))
}

fn scaled(displacement: &[Vector], factor: f64) -> Vec<Vector> {
    displacement.iter().map(|&by| scale(by, factor)).collect()
}

/// The displacement that takes the boundary to `places`, solved for from a guess, and the shape after it.
fn moved(
    operator: &VolumeOperator,
    shape: &[Vector],
    places: &[Vector],
    guess: Option<Vec<Vector>>,
    iterations: &mut usize,
) -> Result<(Vec<Vector>, Vec<Vector>), VolumeError> {
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
    let mut candidate: Vec<Vector> = shape.iter().zip(&solution.displacement).map(|(&a, &b)| add(a, b)).collect();
    for (&vertex, &place) in operator.boundary().iter().zip(places) {
        candidate[vertex as usize] = place;
    }
    Ok((solution.displacement, candidate))
}

fn overflow() -> VolumeError {
    LinearError::NotFinite { iteration: 0 }.into()
}

fn stalled<E>(
    Domain { mesh, partition, .. }: Domain<'_>,
    shape: &[Vector],
    candidate: &[Vector],
    guard: &Guard,
    route: Route,
    folds: bool,
) -> FollowError<E> {
    match judge_in_parts(mesh, shape, candidate, &[1.0], guard, &**partition) {
        Err(refusal) => FollowError::Stalled(Box::new(Stalled { route, refusal, folds })),
        // `keeps` and `judge` are one test.
        Ok(_) => FollowError::Volume(overflow()),
    }
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
            let domain = Domain { mesh: &mesh, boundary: &boundary, partition: &partition, operator: None };
            let mut motion = Places(|to| twisted(&mesh, &boundary, 180.0 * to));
            let route = follow(domain, &start, &mut motion, &Deform::default(), &guard, Some(&untangler)).unwrap();
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
            let again = follow(domain, &start, &mut motion, &Deform::default(), &guard, Some(&untangler)).unwrap();
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
        let domain = Domain { mesh: &mesh, boundary: &boundary, partition: &partition, operator: None };
        let result = follow(domain, &start, &mut Places(pressed), &Deform::default(), &guard, Some(&untangler));
        let Err(FollowError::Stalled(stalled)) = result else { panic!("{result:?}") };
        assert!((0.6..0.8).contains(&stalled.fraction()), "{}", stalled.fraction());
        assert!(matches!(stalled.refusal, Refusal::Quality(_)));
        let error = FollowError::<Infallible>::Stalled(stalled).to_string();
        assert!(error.contains("can follow 7") || error.contains("can follow 6"), "{error}");
    }
}
