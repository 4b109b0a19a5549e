//! Four numbers in single precision side by side: the state of a component at one point.
//!
//! Every operation is that of its numbers one by one, so that the bits do not depend on the
//! processor; one register takes all four.

/// The state of a component at one point: the magnitude of the last difference, and the values in this
/// frame and the two before, in steps of the grid. Or sums of such numbers.
#[derive(Debug, Clone, Copy)]
#[repr(align(16))]
pub(super) struct Node(pub(super) [f32; 4]);

impl Node {
    pub(super) const ZERO: Self = Self([0.0; 4]);

    /// Adds the product with one number, and with another where the magnitudes stand.
    #[inline(always)]
    pub(super) fn add(&mut self, node: Self, weight: f32, of_magnitude: f32) {
        let [magnitude, now, last, second] = node.0;
        self.0[0] += of_magnitude * magnitude;
        self.0[1] += weight * now;
        self.0[2] += weight * last;
        self.0[3] += weight * second;
    }

    /// The value of this frame.
    #[inline(always)]
    pub(super) fn now(self) -> f32 {
        self.0[1]
    }

    /// The magnitude of the last difference.
    #[inline(always)]
    pub(super) fn magnitude(self) -> f32 {
        self.0[0]
    }

    /// Another difference and value of this frame.
    #[inline(always)]
    pub(super) fn set(&mut self, magnitude: f32, now: f32) {
        self.0[0] = magnitude;
        self.0[1] = now;
    }
}
