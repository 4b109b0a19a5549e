//! A way between two valid shapes on which the boundary need not be where a motion has it.

use std::sync::Arc;

use super::adaptive::Domain;
use super::foldover::singular;
use super::untangle::Untangler;
use crate::mesh::Vector;
use crate::partition::{Partition, Reduction};
use crate::vector::{add, cross, dot, scale, subtract};

/// Rotations are gone in steps of at most this angle: a straight step of it shortens a body by a seventh half way.
const ANGLE: f64 = std::f64::consts::FRAC_PI_3;

/// The shapes from `start`, itself not among them, to `end`, which is the last; `None` where no way was found.
///
/// The end is let go, but for the vertices of the boundary that lie where they do in `start`, and springs back: these are the shapes,
/// the other way round. A body that is held nowhere springs back to a shape that is turned and shifted against `start`; turning and
/// shifting it is the rest of the way. `keeps` says whether a straight step may be made.
pub(super) fn sprung(
    domain: Domain<'_>,
    start: &Arc<[Vector]>,
    end: &Arc<[Vector]>,
    keeps: &dyn Fn(&[Vector], &[Vector]) -> bool,
) -> Option<Vec<Arc<[Vector]>>> {
    let Domain { mesh, boundary, partition, .. } = domain;
    let still = |vertex: &&u32| start[**vertex as usize] == end[**vertex as usize];
    let held: Vec<u32> = boundary.iter().filter(still).copied().collect();
    let free = crate::partition::count(&**partition, held.len()) == 0;
    let turned = |shape: &[Vector]| -> Rigid {
        if free { Rigid::nearest(start, shape, &**partition) } else { Rigid::IDENTITY }
    };
    let mut back = vec![Arc::clone(end)];
    let arrived = Untangler::of_part(mesh, &held, partition).take_back(
        end,
        &|shape| turned(shape).of(start, 1.0),
        keeps,
        &mut |shape| {
            back.push(shape.into());
            keeps(&turned(shape).of(start, 1.0), shape)
        },
    );
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

/// A rotation about a centre, and a shift.
struct Rigid {
    centre: Vector,
    shift: Vector,
    axis: Vector,
    angle: f64,
}

impl Rigid {
    const IDENTITY: Self =
        Self { centre: [0.0; 3], shift: [0.0; 3], axis: [0.0, 0.0, 1.0], angle: 0.0 };

    /// The one that takes `from` nearest to `to`, by the squares of the distances (W. Kabsch 1976).
    fn nearest(from: &[Vector], to: &[Vector], partition: &dyn Partition) -> Self {
        let pairs = || {
            (0u32..)
                .zip(from.iter().zip(to))
                .filter(|(vertex, _)| partition.owns(*vertex))
                .map(|(_, pair)| pair)
        };
        let mut sums = [0.0; 7];
        for (a, b) in pairs() {
            sums[0] += 1.0;
            (0..3).for_each(|axis| (sums[1 + axis] += a[axis], sums[4 + axis] += b[axis]).0);
        }
        partition.reduce(Reduction::Sum, &mut sums);
        let [count, rest @ ..] = sums;
        let mean =
            |at: usize| -> Vector { std::array::from_fn(|axis| rest[at + axis] / count.max(1.0)) };
        let (centre, there) = (mean(0), mean(3));
        let mut products = [[0.0; 3]; 3];
        for (a, b) in pairs() {
            let (a, b) = (subtract(*a, centre), subtract(*b, there));
            for (row, value) in products.iter_mut().zip(b) {
                *row = add(*row, scale(a, value));
            }
        }
        partition.reduce(Reduction::Sum, products.as_flattened_mut());
        let (left, _, right) = singular(&products);
        let rotation: [Vector; 3] = std::array::from_fn(|row| {
            (0..3).fold([0.0; 3], |sum, k| add(sum, scale(right[k], left[k][row])))
        });
        let (axis, angle) = axis_and_angle(&rotation);
        Self { centre, shift: subtract(there, centre), axis, angle }
    }

    /// The straight steps that it is gone in; none where it moves nothing.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most 3")]
    fn steps(&self) -> u32 {
        if self.angle == 0.0 && self.shift == [0.0; 3] {
            0
        } else {
            ((self.angle / ANGLE).ceil() as u32).max(1)
        }
    }

    /// A shape after a `fraction` of it.
    fn of(&self, shape: &[Vector], fraction: f64) -> Vec<Vector> {
        if self.steps() == 0 {
            return shape.to_vec();
        }
        let (sine, cosine) = (fraction * self.angle).sin_cos();
        let centre = add(self.centre, scale(self.shift, fraction));
        let place = |&point: &Vector| {
            // O. Rodrigues 1840.
            let arm = subtract(point, self.centre);
            let along = scale(self.axis, dot(self.axis, arm) * (1.0 - cosine));
            add(centre, add(add(scale(arm, cosine), scale(cross(self.axis, arm), sine)), along))
        };
        shape.iter().map(place).collect()
    }
}

/// The unit axis of a rotation, and its angle from 0 to π.
fn axis_and_angle(rotation: &[Vector; 3]) -> (Vector, f64) {
    let [a, b, c] = rotation;
    let twice = [c[1] - b[2], a[2] - c[0], b[0] - a[1]];
    let sine = dot(twice, twice).sqrt();
    let cosine = a[0] + b[1] + c[2] - 1.0;
    let angle = sine.atan2(cosine);
    if sine > 1e-6 {
        return (scale(twice, 1.0 / sine), angle);
    }
    if cosine > 0.0 {
        return (Rigid::IDENTITY.axis, 0.0);
    }
    // Half a turn: the symmetric part is twice the axis times itself, less one.
    let squares = [a[0] + 1.0, b[1] + 1.0, c[2] + 1.0];
    let most =
        (0..3).fold(0, |most, index| if squares[index] > squares[most] { index } else { most });
    let column: Vector =
        std::array::from_fn(|row| rotation[row][most] + if row == most { 1.0 } else { 0.0 });
    (scale(column, 1.0 / dot(column, column).sqrt()), std::f64::consts::PI)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::partition::Whole;

    #[test]
    fn a_rigid_motion_is_found_again() {
        let points =
            [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.3, 0.2, 3.0], [1.0, 1.0, 1.0]];
        for (angle, axis) in [
            (0.3, [0.0, 0.0, 1.0]),
            (3.0, [0.6, 0.0, 0.8]),
            (std::f64::consts::PI, [0.0, -0.6, 0.8]),
        ] {
            let there = Rigid { centre: [0.1, 0.2, 0.3], shift: [4.0, -5.0, 6.0], axis, angle }
                .of(&points, 1.0);
            let found = Rigid::nearest(&points, &there, &Whole);
            for (a, b) in found.of(&points, 1.0).iter().zip(&there) {
                let off = subtract(*a, *b);
                assert!(dot(off, off) < 1e-16, "{angle}: {a:?} {b:?}");
            }
            assert!((found.angle - angle).abs() < 1e-8);
        }
    }
}
