//! Infinitesimal rigid motions.

use crate::communicator::{Communicator, Reduction};
use crate::linear::invert_positive;
use crate::mesh::Vector;
use crate::number::real;
use crate::vector::{add, cross, dot, scale, subtract};

/// `translation + rotation × (point - centre)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct RigidMotion {
    centre: Vector,
    translation: Vector,
    rotation: Vector,
}

impl RigidMotion {
    /// The motion nearest to `displacement` at `points` in the least squares; of those that the
    /// ranks have between them where each rank brings the points that it owns. Where the points do
    /// not tell the rotation (all on one line), it is left out.
    pub(super) fn nearest(
        points: &[Vector],
        displacement: &[Vector],
        communicator: &dyn Communicator,
    ) -> Self {
        let mut sums = [real(points.len()), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        sums[1..4].copy_from_slice(&points.iter().copied().fold([0.0; 3], add));
        sums[4..].copy_from_slice(&displacement.iter().copied().fold([0.0; 3], add));
        communicator.reduce(Reduction::Sum, &mut sums);
        let [count, sums @ ..] = sums;
        let [centre, translation] = [0, 3]
            .map(|from| scale([sums[from], sums[from + 1], sums[from + 2]], 1.0 / count.max(1.0)));
        let mut inertia = [[0.0; 3]; 3];
        let mut moment = [0.0; 3];
        for (&point, &value) in points.iter().zip(displacement) {
            let arm = subtract(point, centre);
            moment = add(moment, cross(arm, subtract(value, translation)));
            let square = dot(arm, arm);
            for (i, row) in inertia.iter_mut().enumerate() {
                for (j, entry) in row.iter_mut().enumerate() {
                    *entry += if i == j { square - arm[i] * arm[j] } else { -arm[i] * arm[j] };
                }
            }
        }
        let mut sums: [f64; 12] = [0.0; 12];
        sums[..9].copy_from_slice(inertia.as_flattened());
        sums[9..].copy_from_slice(&moment);
        communicator.reduce(Reduction::Sum, &mut sums);
        let row = |from: usize| [sums[from], sums[from + 1], sums[from + 2]];
        let (inertia, moment) = ([row(0), row(3), row(6)], row(9));
        let rotation = invert_positive(&inertia)
            .map_or([0.0; 3], |inverse| inverse.map(|row| dot(row, moment)));
        Self { centre, translation, rotation }
    }

    /// The motion without its rotation.
    pub(super) fn translation(self) -> Self {
        Self { rotation: [0.0; 3], ..self }
    }

    pub(super) fn at(&self, point: Vector) -> Vector {
        if self.rotation == [0.0; 3] {
            return self.translation;
        }
        add(scale(self.translation, 1.0), cross(self.rotation, subtract(point, self.centre)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::communicator::Solo;

    #[test]
    fn finds_the_motion_it_was_given() {
        let points = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.5], [0.0, 1.0, 0.0], [0.3, 0.2, 3.0]];
        let (shift, turn) = ([1.0, -2.0, 0.5], [0.3, 0.1, -0.7]);
        let moved = points.map(|point| add(shift, cross(turn, point)));
        let motion = RigidMotion::nearest(&points, &moved, &Solo);
        for (point, value) in points.into_iter().zip(moved) {
            assert!(subtract(motion.at(point), value).iter().all(|error| error.abs() < 1e-13));
        }
        let line = [[0.0; 3], [1.0, 0.0, 0.0]];
        assert_eq!(RigidMotion::nearest(&line, &[[1.0; 3]; 2], &Solo).at([5.0; 3]), [1.0; 3]);
    }
}
