//! What a value will be, as far as its neighbours and the frames before know.

use super::hierarchy::{BLOCK, CONTEXT, Stencil};
use super::kriging::NEIGHBOURS;
use super::node::Node;

/// The weights of four differences: of the neighbours' prediction to that of the last frame; of the
/// neighbours' prediction to the last value; of the last value to the one before; of the
/// neighbours' prediction of the last frame to that of the one before.
pub(super) type Coefficients = [f32; 4];

/// The context of a value, which is a whole number, and its prediction from its neighbours now and in
/// the two frames before, summed from the nearest to the farthest in single precision.
#[inline(always)]
fn sum(nodes: &[Node], stencil: &Stencil, context: &[f32; NEIGHBOURS], sums: &mut Node) {
    let mut sum = Node::ZERO;
    for index in 0..NEIGHBOURS {
        let node = nodes[stencil.indices[index] as usize];
        sum.add(node, stencil.weights[index], context[index]);
    }
    *sums = sum;
}

/// The sums of points, but for those with a mask, with the nodes as they are.
#[inline(always)]
pub(super) fn sums_of(
    nodes: &[Node],
    stencils: &[Stencil],
    mask: Option<&[bool]>,
    sums: &mut [Node; BLOCK],
) {
    // As constants they would be put together anew for each neighbour of each point in WebAssembly.
    let context = std::hint::black_box(CONTEXT);
    for (index, (stencil, sums)) in stencils.iter().zip(sums).enumerate() {
        if mask.is_none_or(|mask| !mask[index]) {
            sum(nodes, stencil, &context, sums);
        }
    }
}

/// The sums as [`sums_of`] has them, of some points: from the first on, and then after each stride.
#[inline(always)]
pub(super) fn sums_of_some(
    nodes: &[Node],
    stencils: &[Stencil],
    mask: Option<&[bool]>,
    (first, stride): (usize, usize),
    sums: &mut [Node; BLOCK],
) {
    for index in (first..stencils.len()).step_by(stride) {
        if mask.is_none_or(|mask| !mask[index]) {
            sum(nodes, &stencils[index], &CONTEXT, &mut sums[index]);
        }
    }
}

/// The sums of the next points of a list, as many as there is room for.
#[inline(always)]
pub(super) fn sums_of_each<'sums>(
    nodes: &[Node],
    stencils: &[Stencil],
    points: &mut impl Iterator<Item = usize>,
    sums: &'sums mut [(usize, Node); BLOCK],
) -> &'sums [(usize, Node)] {
    let mut count = 0;
    for ((to, sums), point) in sums.iter_mut().zip(points) {
        *to = point;
        sum(nodes, &stencils[point], &CONTEXT, sums);
        count += 1;
    }
    &sums[..count]
}

/// The prediction behind the sums, in this order.
#[inline(always)]
pub(super) fn predict(sums: Node, node: Node, by: Coefficients) -> f32 {
    let [_, now, before, earlier] = sums.0;
    let [_, _, last, second] = node.0;
    last + by[0] * (now - before)
        + by[1] * (now - last)
        + by[2] * (last - second)
        + by[3] * (before - earlier)
}
