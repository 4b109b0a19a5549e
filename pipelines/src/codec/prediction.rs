//! What a value will be, as far as its neighbours and the frames before know.

use super::hierarchy::{CONTEXT, Stencil};
use super::kriging::NEIGHBOURS;

/// The state of a component at one point: its values in this frame and the two before, in steps of
/// the grid, and the magnitude of the last difference.
pub(super) type Node = [f32; 4];

/// The weights of four differences: of the neighbours' prediction to that of the last frame; of the
/// neighbours' prediction to the last value; of the last value to the one before; of the
/// neighbours' prediction of the last frame to that of the one before.
pub(super) type Coefficients = [f32; 4];

/// The prediction of a value from its neighbours now and in the two frames before, and their
/// magnitudes; the sums are taken from the nearest to the farthest, in single precision.
// A function of its own: inlined, its lanes would be summed one by one.
#[inline(never)]
pub(super) fn sums(nodes: &[Node], stencil: &Stencil) -> Node {
    let (mut sums, mut context) = ([0.0f32; 4], 0.0);
    for index in 0..NEIGHBOURS {
        let [now, last, second, magnitude] = nodes[stencil.places[index] as usize];
        let weight = stencil.weights[index];
        // All four, so that they are one instruction; the fourth of it is not used.
        let products = [weight * now, weight * last, weight * second, weight * magnitude];
        sums = [
            sums[0] + products[0],
            sums[1] + products[1],
            sums[2] + products[2],
            sums[3] + products[3],
        ];
        if index < CONTEXT.len() {
            context += f32::from(CONTEXT[index]) * magnitude;
        }
    }
    sums[3] = context;
    sums
}

/// The prediction behind the sums, in this order.
#[inline(always)]
pub(super) fn predict(sums: Node, node: Node, by: Coefficients) -> f32 {
    let [now, before, earlier, _] = sums;
    let [_, last, second, _] = node;
    last + by[0] * (now - before)
        + by[1] * (now - last)
        + by[2] * (last - second)
        + by[3] * (before - earlier)
}
