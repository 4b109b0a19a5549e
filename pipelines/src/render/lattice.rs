//! Numbers rounded before they are drawn.
//!
//! The last bits of a point that was cut out depend on the numbers of the vertices, which each rank
//! has of its own. What is drawn is rounded first to far less than a pixel, so that every rank
//! draws the same.

use tombolo_deform::bounds::Bounds;
use tombolo_deform::mesh::Vector;

/// Added before rounding, so that numbers that people choose do not lie where it turns.
const ASIDE: f64 = 0.381_966_011_250_105;
/// Into how many steps the longest side of a scene is divided, at least.
const STEPS: f64 = (1_u64 << 32) as f64;

/// A number rounded to one of the steps of this length.
pub(super) fn rounded(value: f64, step: f64) -> f64 {
    (value / step + ASIDE).floor() * step
}

/// The least power of 2 that is above a positive number, by a wide margin where it is just below
/// one.
fn power_above(value: f64) -> f64 {
    let exponent = ((value * 1.18).to_bits() >> 52).clamp(1, 2045) + 1;
    f64::from_bits(exponent << 52)
}

/// Points of a box, as whole numbers of steps from its middle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Lattice {
    origin: Vector,
    step: f64,
}

impl Lattice {
    /// The lattice for a scene within `bounds`.
    pub(super) fn new(bounds: &Bounds) -> Self {
        let longest = bounds.extent().into_iter().fold(0.0, f64::max);
        let size = bounds.corners().iter().flatten().fold(0.0_f64, |most, x| most.max(x.abs()));
        // No finer than the numbers themselves are.
        let longest = longest.max(1e-6 * size).max(1e-150);
        let step = power_above(longest) / STEPS;
        let coarse = step * 65536.0;
        Self { origin: bounds.center().map(|x| rounded(x, coarse)), step }
    }

    /// The nearest point of the lattice.
    pub(super) fn point(&self, point: Vector) -> [i64; 3] {
        #[expect(clippy::cast_possible_truncation, reason = "at most 2^34 steps within the box")]
        [0, 1, 2].map(|axis| ((point[axis] - self.origin[axis]) / self.step + ASIDE).floor() as i64)
    }

    /// Where a point of the lattice lies, from its origin.
    pub(super) fn position(&self, point: [i64; 3]) -> Vector {
        #[expect(clippy::cast_precision_loss, reason = "at most 2^34")]
        point.map(|steps| steps as f64 * self.step)
    }

    /// Where a point of space lies from the origin.
    pub(super) fn relative(&self, point: Vector) -> Vector {
        [0, 1, 2].map(|axis| point[axis] - self.origin[axis])
    }
}
