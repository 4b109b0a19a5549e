//! Motions of a mesh's boundary that no straight way of the inside can follow, for tests and
//! benchmarks.
//!
//! Each takes a mesh about the box from `[0, 0, 0]` to `[1, 1, height]`, such as those of
//! [`shapes`](crate::shapes), and says where its boundary vertices lie at a fraction of the way. A
//! valid mesh at the end is known for all but [`Warp::Shake`] and [`Warp::Wobble`]: the map is one
//! of space, which is one-to-one on the box.

use crate::mesh::Vector;
use crate::vector::{add, cross, dot, scale, subtract, unit};

/// A motion of the boundary of a box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Warp {
    /// The box turned about its axis, by this many degrees from bottom to top.
    Twist {
        /// The turn of the top.
        degrees: f64,
    },
    /// The box bent about an axis along y, so that its top has turned by this many degrees: 300
    /// make of a column an open ring.
    Bend {
        /// The turn of the top.
        degrees: f64,
    },
    /// The middle of the box widened about its axis: by this factor where it is widest.
    Bulge {
        /// The factor; below 1 a waist.
        factor: f64,
    },
    /// The box laid along an open trefoil knot, as thick as it is: a column of a height of 24 or
    /// more. Its boundary goes there in a straight line, on which it cannot be followed.
    Knot,
    /// Each boundary vertex displaced at random, by at most this much in each direction.
    Shake {
        /// The largest displacement.
        amount: f64,
        /// Another number for another motion.
        seed: u64,
    },
    /// The box displaced by smooth waves, each at most this high.
    Wobble {
        /// The largest displacement by one wave.
        amount: f64,
        /// Another number for another motion.
        seed: u64,
    },
}

impl Warp {
    /// Where a point of the reference lies at a `fraction` of the way; `height` is that of the box,
    /// `number` tells points apart.
    #[must_use]
    pub fn position(self, point: Vector, number: u32, height: f64, fraction: f64) -> Vector {
        let [x, y, z] = [point[0] - 0.5, point[1] - 0.5, point[2]];
        match self {
            Self::Twist { degrees } => {
                let (sine, cosine) = (degrees * fraction * z / height).to_radians().sin_cos();
                [0.5 + cosine * x - sine * y, 0.5 + sine * x + cosine * y, z]
            }
            Self::Bend { degrees } => {
                let turn = (degrees * fraction).to_radians();
                if turn.abs() < 1e-9 {
                    return point;
                }
                let radius = height / turn;
                let (sine, cosine) = (turn * z / height).sin_cos();
                [0.5 + radius - (radius - x) * cosine, point[1], (radius - x) * sine]
            }
            Self::Bulge { factor } => {
                let wave = (std::f64::consts::PI * z / height).sin();
                let factor = 1.0 + fraction * (factor - 1.0) * wave * wave;
                [0.5 + factor * x, 0.5 + factor * y, z]
            }
            Self::Knot => {
                let knotted = knot([x, y, z], height);
                add(scale(point, 1.0 - fraction), scale(knotted, fraction))
            }
            Self::Shake { amount, seed } => {
                let axis =
                    |axis: u64| amount * fraction * random(seed, u64::from(number) * 3 + axis);
                [point[0] + axis(0), point[1] + axis(1), point[2] + axis(2)]
            }
            Self::Wobble { amount, seed } => {
                let mut moved = point;
                for wave in 0..4 {
                    let number = |which: u64| random(seed, 16 * wave + which);
                    let direction = [4.0 * number(0), 4.0 * number(1), 4.0 * number(2)];
                    let phase = dot(direction, point) + 3.0 * number(3);
                    let high = [amount * number(4), amount * number(5), amount * number(6)];
                    moved = add(moved, scale(high, fraction * phase.sin()));
                }
                moved
            }
        }
    }

    /// Where the vertices `boundary` of a mesh with these points lie at a `fraction` of the way.
    #[must_use]
    pub fn positions(self, points: &[Vector], boundary: &[u32], fraction: f64) -> Vec<Vector> {
        let height = points.iter().map(|point| point[2]).fold(0.0, f64::max);
        boundary
            .iter()
            .map(|&vertex| self.position(points[vertex as usize], vertex, height, fraction))
            .collect()
    }
}

/// A number from -1 to 1.
fn random(seed: u64, number: u64) -> f64 {
    // SplitMix64 (Steele, Lea, Flood 2014).
    let mut value = seed
        .wrapping_mul(0xd134_2543_de82_ef95)
        .wrapping_add(number.wrapping_mul(0x9e37_79b9_7f4a_7c15));
    value = (value ^ (value >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    value = (value ^ (value >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    let unit = ((value ^ (value >> 31)) >> 11) as f64 / (1u64 << 53) as f64;
    2.0 * unit - 1.0
}

/// The point of a column along a trefoil, `z` of `height` along it, `x` and `y` across it.
fn knot([x, y, z]: Vector, height: f64) -> Vector {
    // The curve is 29.8 long for a size of 1; its strands come no nearer to each other than 1.7.
    let size = height / 29.8;
    let curve = |t: f64| {
        scale(
            [
                t.sin() + 2.0 * (2.0 * t).sin(),
                t.cos() - 2.0 * (2.0 * t).cos(),
                -1.5 * (3.0 * t).sin(),
            ],
            size,
        )
    };
    let t = 0.3 + 5.7 * z / height;
    let step = 1e-4;
    let along = subtract(curve(t + step), curve(t - step));
    let along = unit(along);
    // Outwards from the axis of the torus that the curve winds around.
    let centre = curve(t);
    let out = [centre[0], centre[1], 2.0 * centre[2]];
    let out = subtract(out, scale(along, dot(out, along)));
    let out = unit(out);
    let across = cross(along, out);
    add(centre, add(scale(out, x), scale(across, y)))
}
