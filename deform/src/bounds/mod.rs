//! Boxes along the axes, and a tree of them.

mod tree;

pub use tree::{BoxTree, Boxed};

use crate::communicator::Communicator;
use crate::vector::{Vector, subtract};

/// The least box along the axes around some points.
///
/// ```
/// use tombolo_deform::bounds::Bounds;
///
/// let bounds = Bounds::around([[0.0, 1.0, 2.0], [4.0, 1.0, 0.0]]);
/// assert_eq!((bounds.lower, bounds.upper), ([0.0, 1.0, 0.0], [4.0, 1.0, 2.0]));
/// assert_eq!((bounds.center(), bounds.longest_axis()), ([2.0, 1.0, 1.0], 0));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// The lowest coordinate along each axis.
    pub lower: Vector,
    /// The highest coordinate along each axis.
    pub upper: Vector,
}

impl Bounds {
    /// The box around no points: from infinity to minus infinity.
    pub const EMPTY: Self = Self { lower: [f64::INFINITY; 3], upper: [f64::NEG_INFINITY; 3] };

    /// The least box around points. Coordinates that are NaN are left out.
    pub fn around(points: impl IntoIterator<Item = Vector>) -> Self {
        points
            .into_iter()
            .fold(Self::EMPTY, |bounds, point| bounds.join(&Self { lower: point, upper: point }))
    }

    /// The least box around two boxes.
    #[inline]
    #[must_use]
    pub fn join(&self, other: &Self) -> Self {
        Self {
            lower: std::array::from_fn(|axis| self.lower[axis].min(other.lower[axis])),
            upper: std::array::from_fn(|axis| self.upper[axis].max(other.upper[axis])),
        }
    }

    /// The least box around the boxes of all ranks. Collective.
    #[must_use]
    pub fn of_ranks(&self, communicator: &dyn Communicator) -> Self {
        let mut ranges: [[f64; 2]; 3] =
            std::array::from_fn(|axis| [self.lower[axis], self.upper[axis]]);
        communicator.join_ranges(&mut ranges);
        Self { lower: ranges.map(|[lower, _]| lower), upper: ranges.map(|[_, upper]| upper) }
    }

    /// The two corners: the lowest coordinates, then the highest.
    #[must_use]
    pub fn corners(&self) -> [Vector; 2] {
        [self.lower, self.upper]
    }

    /// The length of the box along each axis.
    #[must_use]
    pub fn extent(&self) -> Vector {
        subtract(self.upper, self.lower)
    }

    /// The axis along which the box is longest, the first of several.
    #[must_use]
    pub fn longest_axis(&self) -> usize {
        // Halved, so that no extent is infinite.
        let extent = [0, 1, 2].map(|axis| 0.5 * self.upper[axis] - 0.5 * self.lower[axis]);
        (1..3).fold(0, |longest, axis| if extent[axis] > extent[longest] { axis } else { longest })
    }

    /// The length of the diagonal, without overflow on the way to it.
    #[must_use]
    pub fn diagonal(&self) -> f64 {
        self.extent().iter().fold(0.0f64, |length, part| length.hypot(*part))
    }

    /// The point in the middle of the box.
    #[must_use]
    pub fn center(&self) -> Vector {
        [0, 1, 2].map(|axis| 0.5 * self.lower[axis] + 0.5 * self.upper[axis])
    }

    /// The point in the middle of what two boxes share.
    #[must_use]
    pub fn center_with(&self, other: &Self) -> Vector {
        std::array::from_fn(|axis| {
            let low = self.lower[axis].max(other.lower[axis]);
            let high = self.upper[axis].min(other.upper[axis]);
            low + 0.5 * (high - low)
        })
    }

    /// The square of the distance of a point from the box, 0 inside. Infinite for no box, and for a
    /// point with a coordinate that is NaN.
    #[inline]
    #[must_use]
    pub fn squared_distance(&self, point: Vector) -> f64 {
        let beside = |axis: usize| {
            let beside = (self.lower[axis] - point[axis]).max(point[axis] - self.upper[axis]);
            // Not `max`, which passes NaN over.
            if beside <= 0.0 { 0.0 } else { beside }
        };
        let square: f64 = (0..3).map(|axis| beside(axis).powi(2)).sum();
        // NaN becomes infinite.
        square.min(f64::INFINITY)
    }

    /// Whether two boxes share a point.
    #[inline]
    #[must_use]
    pub fn meets(&self, other: &Self) -> bool {
        (self.lower[0] <= other.upper[0])
            & (other.lower[0] <= self.upper[0])
            & (self.lower[1] <= other.upper[1])
            & (other.lower[1] <= self.upper[1])
            & (self.lower[2] <= other.upper[2])
            & (other.lower[2] <= self.upper[2])
    }
}

/// Bits of each coordinate on Morton's curve.
pub(crate) const BITS: u32 = 21;

/// How far a point lies along the curve that fills a cube (G. M. Morton 1966), by the steps from
/// its lowest corner along each axis, of which the lowest [`BITS`] count.
pub(crate) fn along_curve(steps: [u64; 3]) -> u64 {
    // Two zeros after each bit.
    let spread = |steps: u64| {
        let mut bits = steps & ((1 << BITS) - 1);
        for (shift, mask) in [
            (32, 0x001f_0000_0000_ffff),
            (16, 0x001f_0000_ff00_00ff),
            (8, 0x100f_00f0_0f00_f00f),
            (4, 0x10c3_0c30_c30c_30c3),
            (2, 0x1249_2492_4924_9249),
        ] {
            bits = (bits | bits << shift) & mask;
        }
        bits
    };
    let [x, y, z] = steps.map(spread);
    x | y << 1 | z << 2
}
