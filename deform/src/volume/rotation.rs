//! The rotation and shift that take one shape nearest to another.

use super::foldover::singular;
use crate::communicator::{Communicator, Reduction};
use crate::mesh::Domain;
use crate::mesh::Vector;
use crate::vector::{add, cross, dot, length, scale, subtract, unit};

/// Rotations are gone in steps of at most this angle: a straight step of it shortens a body by a
/// seventh half way.
const ANGLE: f64 = std::f64::consts::FRAC_PI_3;

/// A rotation about a centre, and a shift.
pub(super) struct Rigid {
    centre: Vector,
    shift: Vector,
    axis: Vector,
    angle: f64,
}

impl Rigid {
    pub(super) const IDENTITY: Self =
        Self { centre: [0.0; 3], shift: [0.0; 3], axis: [0.0, 0.0, 1.0], angle: 0.0 };

    /// The one that takes `from` nearest to `to`, by the squares of the distances (W. Kabsch 1976).
    pub(super) fn nearest(from: &[Vector], to: &[Vector], domain: &Domain) -> Self {
        let pairs = || {
            (0u32..)
                .zip(from.iter().zip(to))
                .filter(|(vertex, _)| domain.owns(*vertex))
                .map(|(_, pair)| pair)
        };
        let mut sums = [0.0; 7];
        for (a, b) in pairs() {
            sums[0] += 1.0;
            (0..3).for_each(|axis| (sums[1 + axis] += a[axis], sums[4 + axis] += b[axis]).0);
        }
        domain.communicator().reduce(Reduction::Sum, &mut sums);
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
        domain.communicator().reduce(Reduction::Sum, products.as_flattened_mut());
        let (left, _, right) = singular(&products);
        let rotation: [Vector; 3] = std::array::from_fn(|row| {
            (0..3).fold([0.0; 3], |sum, k| add(sum, scale(right[k], left[k][row])))
        });
        let (axis, angle) = axis_and_angle(&rotation);
        Self { centre, shift: subtract(there, centre), axis, angle }
    }

    /// The straight steps that it is gone in; none where it moves nothing.
    pub(super) fn steps(&self) -> u32 {
        if self.angle == 0.0 && self.shift == [0.0; 3] {
            0
        } else {
            ((self.angle / ANGLE).ceil() as u32).max(1)
        }
    }

    /// A shape after a `fraction` of it.
    pub(super) fn of(&self, shape: &[Vector], fraction: f64) -> Vec<Vector> {
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
    let sine = length(twice);
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
    (unit(column), std::f64::consts::PI)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rigid_motion_is_found_again() {
        let domain = Domain::from(crate::shapes::box_of_tets([1, 1, 1], [0.0; 3], [1.0; 3]));
        let points =
            [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.3, 0.2, 3.0], [1.0, 1.0, 1.0]];
        for (angle, axis) in [
            (0.3, [0.0, 0.0, 1.0]),
            (3.0, [0.6, 0.0, 0.8]),
            (std::f64::consts::PI, [0.0, -0.6, 0.8]),
        ] {
            let there = Rigid { centre: [0.1, 0.2, 0.3], shift: [4.0, -5.0, 6.0], axis, angle }
                .of(&points, 1.0);
            let found = Rigid::nearest(&points, &there, &domain);
            for (a, b) in found.of(&points, 1.0).iter().zip(&there) {
                let off = subtract(*a, *b);
                assert!(dot(off, off) < 1e-16, "{angle}: {a:?} {b:?}");
            }
            assert!((found.angle - angle).abs() < 1e-8);
        }
    }
}
