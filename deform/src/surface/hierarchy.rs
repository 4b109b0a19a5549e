//! A hierarchy of bounding boxes over triangles, to find those that may touch.

use crate::bounds::{BITS, Bounds, along_curve};
use crate::mesh::Vector;

/// How many triangles share a leaf.
const LEAF: usize = 4;

/// A node of the hierarchy: the box of its triangles, and whether any of its triangles moves.
#[derive(Debug, Clone, Copy)]
struct Node {
    bounds: Bounds,
    moves: bool,
}

const NOTHING: Node = Node { bounds: Bounds::EMPTY, moves: false };

impl Node {
    #[inline]
    fn may_touch(&self, other: &Self) -> bool {
        (self.moves | other.moves) && self.bounds.meets(&other.bounds)
    }

    fn join(&self, other: &Self) -> Self {
        Self { bounds: self.bounds.join(&other.bounds), moves: self.moves | other.moves }
    }
}

/// Triangles along a Morton curve, four to a leaf, under a full binary tree: it is built by one
/// sort, and depends on the triangles alone.
pub(super) struct Hierarchy {
    /// The triangle at each position along the curve.
    order: Vec<u32>,
    items: Vec<Node>,
    /// Node `n` has the children `2 n + 1` and `2 n + 2`; the last half are the leaves.
    nodes: Vec<Node>,
    leaves: usize,
}

impl Hierarchy {
    /// Over the triangles of `chosen`; `moves` tells which of all triangles move.
    pub fn new(
        points: &[Vector],
        triangles: &[[u32; 3]],
        chosen: &[u32],
        moves: impl Fn(u32) -> bool,
    ) -> Self {
        let bounds_of = |triangle: u32| {
            Bounds::around(triangles[triangle as usize].map(|vertex| points[vertex as usize]))
        };
        let all =
            chosen.iter().fold(Bounds::EMPTY, |all, &triangle| all.join(&bounds_of(triangle)));
        let size = (0..3).map(|axis| all.upper[axis] - all.lower[axis]).fold(0.0, f64::max);
        let scale = if size > 0.0 { f64::from((1u32 << BITS) - 1) / size } else { 0.0 };
        let mut curve: Vec<(u64, u32)> = chosen
            .iter()
            .map(|&triangle| {
                let bounds = bounds_of(triangle);
                let middle = bounds.center();
                (
                    along_curve(
                        [0, 1, 2].map(|axis| ((middle[axis] - all.lower[axis]) * scale) as u64),
                    ),
                    triangle,
                )
            })
            .collect();
        curve.sort_unstable();
        let order: Vec<u32> = curve.into_iter().map(|(_, triangle)| triangle).collect();
        let items: Vec<Node> = order
            .iter()
            .map(|&triangle| Node { bounds: bounds_of(triangle), moves: moves(triangle) })
            .collect();

        let leaves = items.len().div_ceil(LEAF).next_power_of_two();
        let mut nodes = vec![NOTHING; 2 * leaves - 1];
        for (node, part) in nodes[leaves - 1..].iter_mut().zip(items.chunks(LEAF)) {
            *node = part.iter().fold(NOTHING, |node, item| node.join(item));
        }
        for number in (0..leaves - 1).rev() {
            nodes[number] = nodes[2 * number + 1].join(&nodes[2 * number + 2]);
        }
        Self { order, items, nodes, leaves }
    }

    /// How many leaves there are.
    pub fn leaves(&self) -> usize {
        self.items.len().div_ceil(LEAF)
    }

    /// Calls `visit` with each pair of triangles whose boxes meet, of which one moves, and of which
    /// the first on the curve lies in `leaf`. Over all leaves each pair comes once.
    pub fn for_each_pair(&self, leaf: usize, mut visit: impl FnMut(u32, u32)) {
        let own = &self.nodes[self.leaves - 1 + leaf];
        // Each level leaves one node waiting at most.
        let mut waiting = [(0, 0, 0); usize::BITS as usize + 1];
        waiting[0] = (0, 0, self.leaves);
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let (number, first, size) = waiting[count];
            if first + size <= leaf || !own.may_touch(&self.nodes[number]) {
                continue;
            }
            if size == 1 {
                self.pairs_of_leaves(leaf, first, &mut visit);
            } else {
                let half = size / 2;
                waiting[count] = (2 * number + 2, first + half, half);
                waiting[count + 1] = (2 * number + 1, first, half);
                count += 2;
            }
        }
    }

    fn pairs_of_leaves(&self, leaf: usize, other: usize, visit: &mut impl FnMut(u32, u32)) {
        let items = |leaf: usize| leaf * LEAF..((leaf + 1) * LEAF).min(self.items.len());
        for a in items(leaf) {
            for b in items(other) {
                if a < b && self.items[a].may_touch(&self.items[b]) {
                    visit(self.order[a], self.order[b]);
                }
            }
        }
    }
}
