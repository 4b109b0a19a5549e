//! A way between two valid shapes on which the boundary need not be where a motion has it.

use std::sync::Arc;

use super::foldover;
use super::newton::{Energy, Pull};
use super::rotation::Rigid;
use super::route::Volume;
use super::untangle::Untangler;
use crate::communicator::{Communicator, Reduction};
use crate::mesh::Vector;
use crate::number::real;

/// Newton steps in which a shape goes back to another at most; how stiff the springs to that are at
/// first and at last, by the stiffness of the cells, and by how much they become stiffer where the
/// shape has settled.
const STEPS: usize = 300;
const FIRST_PULL: f64 = 1e-5;
const LAST_PULL: f64 = 1e3;
const STIFFER: f64 = 10.0;

/// A shape on its way back is settled once a Newton step takes less than this part of what energy
/// it has more than at rest.
const SETTLED: f64 = 0.01;

/// The regularisation, by the least determinant.
const EPSILON: f64 = 0.01;

/// The shapes from `start`, itself not among them, to `end`, which is the last; `None` where no way
/// was found.
///
/// The end is let go, but for the vertices of the boundary that lie where they do in `start`, and
/// springs back: these are the shapes, the other way round. A body that is held nowhere springs
/// back to a shape that is turned and shifted against `start`; turning and shifting it is the rest
/// of the way. `keeps` says whether a straight step may be made.
pub(super) fn sprung(
    volume: Volume<'_>,
    start: &Arc<[Vector]>,
    end: &Arc<[Vector]>,
    keeps: &dyn Fn(&[Vector], &[Vector]) -> bool,
) -> Option<Vec<Arc<[Vector]>>> {
    let Volume { domain, boundary, cancellation, .. } = volume;
    let still = |vertex: &&u32| start[**vertex as usize] == end[**vertex as usize];
    let held: Vec<u32> = boundary.iter().filter(still).copied().collect();
    let free = domain.communicator().total(held.len()) == 0;
    let turned = |shape: &[Vector]| -> Rigid {
        if free { Rigid::nearest(start, shape, domain) } else { Rigid::IDENTITY }
    };
    let mut back = vec![Arc::clone(end)];
    let untangler = Untangler::new(domain, &held).with_cancellation(cancellation.clone());
    let arrived =
        untangler.take_back(end, &|shape| turned(shape).of(start, 1.0), keeps, &mut |shape| {
            back.push(shape.into());
            keeps(&turned(shape).of(start, 1.0), shape)
        });
    if !arrived {
        return None;
    }
    let last = back.last().map(Arc::clone)?;
    let rigid = turned(&last);
    for step in (1..=rigid.steps()).rev() {
        back.push(rigid.of(start, f64::from(step) / f64::from(rigid.steps())).into());
    }
    let mut way: Vec<Arc<[Vector]>> = Vec::new();
    while let Some(mut next) = back.len().checked_sub(1) {
        let here = way.last().unwrap_or(start);
        if !keeps(here, &back[next]) {
            return None;
        }
        // As far as a straight step goes, in strides that grow.
        let mut stride = 1;
        while let Some(further) =
            next.checked_sub(stride).filter(|&further| keeps(here, &back[further]))
        {
            (next, stride) = (further, 2 * stride);
        }
        way.push(Arc::clone(&back[next]));
        back.truncate(next);
    }
    Some(way)
}

impl Untangler {
    /// Takes a valid shape back towards the one that `towards` makes of it: the cells are drawn to
    /// those of the reference, and every vertex that is free to its position in the other shape,
    /// the more the longer it takes. Each step is one that `goes` from a shape to the next; it ends
    /// where `arrives` says so, and says whether it did.
    ///
    /// A body that is let go springs back: this is how a way is found between shapes whose
    /// boundaries a straight one breaks.
    fn take_back(
        &self,
        points: &[Vector],
        towards: &dyn Fn(&[Vector]) -> Vec<Vector>,
        goes: &dyn Fn(&[Vector], &[Vector]) -> bool,
        arrives: &mut dyn FnMut(&[Vector]) -> bool,
    ) -> bool {
        if self.is_idle(points) {
            return false;
        }
        let mut points = points.to_vec();
        let mut near = self.numbering.gather(&points).into_owned();
        let rest = foldover::ENERGY_AT_REST
            * self.domain.communicator().reduced(Reduction::Sum, real(self.corners.len()));
        let stiffnesses = self.newton.stiffnesses(&self.corners);
        let mut stiffness = FIRST_PULL;
        for _ in 0..STEPS {
            let towards = towards(&points);
            let pull = Pull {
                positions: self.newton.positions(&self.numbering.gather(&towards)),
                weights: stiffnesses.iter().map(|value| stiffness * value).collect(),
            };
            let epsilon = EPSILON * self.newton.least(&self.corners, &near).max(0.0);
            let energy = Energy { corners: &self.corners, epsilon, pull: Some(&pull) };
            // Where the way to a shape would be broken, that is no shape to go to.
            let allowed = |next: &[Vector]| {
                let mut moved = points.clone();
                self.numbering.scatter(next, &mut moved);
                goes(&points, &moved)
            };
            let step = self.newton.step(&energy, &mut near, &allowed);
            if self.is_given_up() {
                return false;
            }
            if step.is_some() {
                self.numbering.scatter(&near, &mut points);
                if arrives(&points) {
                    return true;
                }
            }
            if step.is_none_or(|step| step.before - step.after < SETTLED * (step.before - rest)) {
                stiffness *= STIFFER;
                if stiffness > LAST_PULL {
                    return false;
                }
            }
        }
        false
    }
}
