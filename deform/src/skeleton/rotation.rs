//! Rotations as unit quaternions.

use crate::mesh::Vector;
use crate::vector::{add, cross, dot, length, scale, unit};

/// A rotation by the angle `2 atan2(|vector|, scalar)` about `vector`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rotation {
    scalar: f64,
    vector: Vector,
}

impl Rotation {
    pub const IDENTITY: Self = Self { scalar: 1.0, vector: [0.0; 3] };

    /// About a unit vector by an angle in radians.
    pub fn about(axis: Vector, angle: f64) -> Self {
        let (sine, cosine) = (0.5 * angle).sin_cos();
        Self { scalar: cosine, vector: scale(axis, sine) }
    }

    /// The least rotation that takes one unit vector to another; for opposite ones, one of the half
    /// turns that do.
    pub fn between(from: Vector, to: Vector) -> Self {
        if from == to {
            return Self::IDENTITY;
        }
        let half = add(from, to);
        let length = length(half);
        if length > 1e-8 {
            let half = scale(half, 1.0 / length);
            return Self { scalar: dot(from, half), vector: cross(from, half) }.normalised();
        }
        let axis = (0..3).min_by(|&a, &b| from[a].abs().total_cmp(&from[b].abs())).unwrap_or(0);
        let mut across = [0.0; 3];
        across[axis] = 1.0;
        let across = cross(from, across);
        Self { scalar: 0.0, vector: unit(across) }
    }

    /// This rotation after another.
    pub fn after(self, first: Self) -> Self {
        let scalar = self.scalar * first.scalar - dot(self.vector, first.vector);
        let vector = add(
            add(scale(first.vector, self.scalar), scale(self.vector, first.scalar)),
            cross(self.vector, first.vector),
        );
        Self { scalar, vector }.normalised()
    }

    pub fn inverse(self) -> Self {
        Self { scalar: self.scalar, vector: scale(self.vector, -1.0) }
    }

    /// The change of a vector by the rotation: exact zeros for no rotation, and accurate for small
    /// ones.
    pub fn change(self, vector: Vector) -> Vector {
        let twice = scale(cross(self.vector, vector), 2.0);
        add(scale(twice, self.scalar), cross(self.vector, twice))
    }

    pub fn apply(self, vector: Vector) -> Vector {
        add(vector, self.change(vector))
    }

    /// The angle about a unit vector of a rotation that keeps it, in radians between -pi and pi.
    pub fn angle_about(self, axis: Vector) -> f64 {
        let sign = if self.scalar < 0.0 { -1.0 } else { 1.0 };
        2.0 * (sign * dot(self.vector, axis)).atan2(sign * self.scalar)
    }

    /// The rotation about the same axis by a part of the angle, taken between -pi and pi.
    pub fn part(self, fraction: f64) -> Self {
        let length = dot(self.vector, self.vector).sqrt();
        if length == 0.0 || fraction == 1.0 {
            return self;
        }
        let sign = if self.scalar < 0.0 { -1.0 } else { 1.0 };
        let angle = 2.0 * length.atan2(sign * self.scalar);
        Self::about(scale(self.vector, sign / length), fraction * angle)
    }

    /// Between this rotation (0) and another one (1), along the shorter way.
    pub fn blend(self, other: Self, fraction: f64) -> Self {
        let aligned = self.scalar * other.scalar + dot(self.vector, other.vector);
        let weight = if aligned < 0.0 { -fraction } else { fraction };
        Self {
            scalar: (1.0 - fraction) * self.scalar + weight * other.scalar,
            vector: add(scale(self.vector, 1.0 - fraction), scale(other.vector, weight)),
        }
        .normalised()
    }

    fn normalised(self) -> Self {
        let length = (self.scalar * self.scalar + dot(self.vector, self.vector)).sqrt();
        if length > 0.0 && length.is_finite() {
            Self { scalar: self.scalar / length, vector: scale(self.vector, 1.0 / length) }
        } else {
            Self::IDENTITY
        }
    }
}

/// Carries rotations along two curves: from unit tangents `reference` and `deformed` to the
/// rotation that takes each of the one to its partner, without twist between neighbours but for
/// what brings the least rotation to both ends, spread evenly over `lengths` (arc length from the
/// first node, rising). On closed curves the twist is 0 on the mean.
pub(super) fn transported(
    reference: &[Vector],
    deformed: &[Vector],
    lengths: &[f64],
    period: Option<f64>,
) -> Vec<Rotation> {
    let mut rotations: Vec<Rotation> = Vec::with_capacity(reference.len());
    let step = |rotation: Rotation, from: usize, to: usize| {
        let carried = Rotation::between(deformed[from], deformed[to])
            .after(rotation)
            .after(Rotation::between(reference[from], reference[to]).inverse());
        // Rounding must not add up along a long curve.
        Rotation::between(carried.apply(reference[to]), deformed[to]).after(carried)
    };
    for node in 0..reference.len() {
        rotations.push(match rotations.last() {
            Some(&before) => step(before, node - 1, node),
            None => Rotation::between(reference[0], deformed[0]),
        });
    }
    let Some(last) = reference.len().checked_sub(1) else { return rotations };
    let twist = |rotation: Rotation, node: usize| {
        let least = Rotation::between(reference[node], deformed[node]);
        rotation.after(least.inverse()).angle_about(deformed[node])
    };
    let (total, excess) = match period {
        None => (lengths[last] - lengths[0], twist(rotations[last], last)),
        Some(period) => (period, twist(step(rotations[last], last, 0), 0)),
    };
    let turn = |rotations: &mut [Rotation], angle: &dyn Fn(usize) -> f64| {
        for (node, rotation) in rotations.iter_mut().enumerate() {
            let angle = angle(node);
            if angle != 0.0 {
                *rotation = Rotation::about(deformed[node], angle).after(*rotation);
            }
        }
    };
    if total > 0.0 {
        turn(&mut rotations, &|node| -excess * (lengths[node] - lengths[0]) / total);
    }
    if period.is_some() {
        let mut mean = 0.0;
        let mut before = 0.0f64;
        for (node, &rotation) in rotations.iter().enumerate() {
            let angle = twist(rotation, node);
            // Without the jumps by a whole turn.
            before =
                angle + ((before - angle) / std::f64::consts::TAU).round() * std::f64::consts::TAU;
            mean += before / reference.len() as f64;
        }
        turn(&mut rotations, &|_| -mean);
    }
    rotations
}

/// The direction of a vector; `None` for one without.
pub(super) fn direction(vector: Vector) -> Option<Vector> {
    let largest = vector.iter().fold(0.0f64, |largest, value| largest.max(value.abs()));
    if !(largest > 0.0 && largest.is_finite()) {
        return None;
    }
    let vector = scale(vector, 1.0 / largest);
    Some(unit(vector))
}

/// From 0 to 1 as `x` runs from 0 to 1, level at both ends.
pub(super) fn smooth_step(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vector::distance;

    fn near(a: Vector, b: Vector) {
        assert!(distance(a, b) < 1e-14, "{a:?} {b:?}");
    }

    #[test]
    fn rotations_turn_as_their_names_say() {
        let quarter = Rotation::about([0.0, 0.0, 1.0], std::f64::consts::FRAC_PI_2);
        near(quarter.apply([1.0, 0.0, 5.0]), [0.0, 1.0, 5.0]);
        near(quarter.after(quarter).apply([1.0, 0.0, 0.0]), [-1.0, 0.0, 0.0]);
        near(quarter.inverse().apply([0.0, 1.0, 0.0]), [1.0, 0.0, 0.0]);
        near(
            quarter.part(1.0 / 3.0).after(quarter.part(2.0 / 3.0)).apply([0.0, 1.0, 0.0]),
            [-1.0, 0.0, 0.0],
        );
        near(
            Rotation::IDENTITY.blend(quarter, 0.5).apply([1.0, 0.0, 0.0]),
            [0.5f64.sqrt(), 0.5f64.sqrt(), 0.0],
        );
        assert!((quarter.angle_about([0.0, 0.0, 1.0]) - std::f64::consts::FRAC_PI_2).abs() < 1e-15);
        assert_eq!(Rotation::IDENTITY.change([1.0, 2.0, 3.0]), [0.0; 3]);
        let [a, b] = [[0.6, 0.8, 0.0], [0.0, -0.6, 0.8]];
        near(Rotation::between(a, b).apply(a), b);
        near(Rotation::between(a, scale(a, -1.0)).apply(a), scale(a, -1.0));
    }

    #[test]
    fn transport_is_without_twist_and_least_at_both_ends() {
        // A helix against a straight line.
        let count = 200;
        let straight = vec![[0.0, 0.0, 1.0]; count];
        let helix: Vec<Vector> = (0..count)
            .map(|node| 4.0 * std::f64::consts::PI * node as f64 / (count - 1) as f64)
            .filter_map(|angle| direction([-angle.sin(), angle.cos(), 1.0]))
            .collect();
        let lengths: Vec<f64> = (0..count).map(|node| node as f64).collect();
        let rotations = transported(&straight, &helix, &lengths, None);
        for (node, rotation) in rotations.iter().enumerate() {
            near(rotation.apply(straight[node]), helix[node]);
        }
        for node in [0, count - 1] {
            let least = Rotation::between(straight[node], helix[node]);
            near(rotations[node].apply([1.0, 0.0, 0.0]), least.apply([1.0, 0.0, 0.0]));
        }
        // The same little twist in each step.
        let twists: Vec<f64> = (1..count)
            .map(|node| {
                let carried =
                    Rotation::between(helix[node - 1], helix[node]).after(rotations[node - 1]);
                rotations[node].after(carried.inverse()).angle_about(helix[node])
            })
            .collect();
        assert!(twists.iter().all(|twist| (twist - twists[0]).abs() < 1e-12));
    }
}
