//! A tree of boxes.

use std::cell::Cell;

use super::{BITS, Bounds, along_curve};
use crate::vector::Vector;

/// How many boxes share a leaf.
const LEAF: usize = 4;

/// Something in a box, which can be joined with others.
pub trait Boxed: Copy {
    /// The join of none.
    const NONE: Self;

    /// The box.
    fn bounds(&self) -> &Bounds;

    /// This and another as one.
    #[must_use]
    fn join(&self, other: &Self) -> Self;
}

impl Boxed for Bounds {
    const NONE: Self = Self::EMPTY;

    #[inline]
    fn bounds(&self) -> &Bounds {
        self
    }

    #[inline]
    fn join(&self, other: &Self) -> Self {
        Self::join(self, other)
    }
}

/// A tree over boxes that finds those around a point and those that meet one another.
///
/// The boxes lie along a Morton curve, four to a leaf, under a full binary tree. It is built by one
/// sort and depends on the boxes alone.
///
/// ```
/// use tombolo_deform::bounds::{BoxTree, Bounds};
///
/// let cube = |x: f64| Bounds { lower: [x, 0.0, 0.0], upper: [x + 1.0, 1.0, 1.0] };
/// let tree = BoxTree::new(&[cube(0.0), cube(0.5), cube(2.0)]);
/// let mut around = Vec::new();
/// tree.around([0.75, 0.5, 0.5], 0.0, |index| around.push(index));
/// assert_eq!(around, [0, 1]);
/// assert!(!tree.contains([1.75, 0.5, 0.5]));
/// ```
#[derive(Debug)]
pub struct BoxTree<B = Bounds> {
    /// The box at each position along the curve, by its index.
    order: Vec<u32>,
    items: Vec<B>,
    /// Node `n` has the children `2 n + 1` and `2 n + 2`; the last half are the leaves.
    nodes: Vec<B>,
    leaves: usize,
}

impl<B: Boxed> BoxTree<B> {
    /// A tree over boxes, which are called by their indices. There are fewer than 2^32 of them.
    pub fn new(boxes: &[B]) -> Self {
        let all = boxes.iter().fold(Bounds::EMPTY, |all, item| all.join(item.bounds()));
        let size = (0..3).map(|axis| all.upper[axis] - all.lower[axis]).fold(0.0, f64::max);
        let scale = if size > 0.0 { f64::from((1u32 << BITS) - 1) / size } else { 0.0 };
        let mut curve: Vec<(u64, u32)> = (0..)
            .zip(boxes)
            .map(|(index, item)| {
                let center = item.bounds().center();
                let steps = [0, 1, 2].map(|axis| ((center[axis] - all.lower[axis]) * scale) as u64);
                (along_curve(steps), index)
            })
            .collect();
        curve.sort_unstable();
        let order: Vec<u32> = curve.into_iter().map(|(_, index)| index).collect();
        let items: Vec<B> = order.iter().map(|&index| boxes[index as usize]).collect();

        let leaves = items.len().div_ceil(LEAF).next_power_of_two();
        let mut nodes = vec![B::NONE; 2 * leaves - 1];
        for (node, part) in nodes[leaves - 1..].iter_mut().zip(items.chunks(LEAF)) {
            *node = part.iter().fold(B::NONE, |node, item| node.join(item));
        }
        for number in (0..leaves - 1).rev() {
            nodes[number] = nodes[2 * number + 1].join(&nodes[2 * number + 2]);
        }
        Self { order, items, nodes, leaves }
    }

    /// Calls `visit` with the index of each box no further from a point than `slack`.
    pub fn around(&self, point: Vector, slack: f64, mut visit: impl FnMut(u32)) {
        let near = |bounds: &Bounds| bounds.squared_distance(point) <= slack * slack;
        self.descend(
            |node, _, _| near(node.bounds()),
            |leaf| {
                for position in self.positions(leaf) {
                    if near(self.items[position].bounds()) {
                        visit(self.order[position]);
                    }
                }
            },
        );
    }

    /// The index of the box nearest to a point, the lowest of several, with the square of its
    /// distance; `None` where all are further than `reach`.
    #[must_use]
    pub fn nearest(&self, point: Vector, reach: f64) -> Option<(u32, f64)> {
        let best = Cell::new((reach * reach, u32::MAX));
        self.descend(
            |node, _, _| node.bounds().squared_distance(point) <= best.get().0,
            |leaf| {
                for position in self.positions(leaf) {
                    let square = self.items[position].bounds().squared_distance(point);
                    let (index, (least, lowest)) = (self.order[position], best.get());
                    let is_less = square < least || square == least && index < lowest;
                    if is_less && square.is_finite() {
                        best.set((square, index));
                    }
                }
            },
        );
        let (square, index) = best.get();
        (index < u32::MAX).then_some((index, square))
    }

    /// Whether a point lies in one of the boxes.
    #[must_use]
    pub fn contains(&self, point: Vector) -> bool {
        let mut found = false;
        self.around(point, 0.0, |_| found = true);
        found
    }

    /// How many leaves there are, for [`for_each_pair`](Self::for_each_pair).
    #[must_use]
    pub fn leaves(&self) -> usize {
        self.items.len().div_ceil(LEAF)
    }

    /// Calls `visit` with the indices of each pair that `may_meet`, of which the first on the curve
    /// lies in `leaf`. Over all leaves each pair comes once. Where two may meet, so may their joins
    /// with others.
    pub fn for_each_pair(
        &self,
        leaf: usize,
        may_meet: impl Fn(&B, &B) -> bool,
        mut visit: impl FnMut(u32, u32),
    ) {
        let own = &self.nodes[self.leaves - 1 + leaf];
        self.descend(
            |node, first, size| first + size > leaf && may_meet(own, node),
            |other| {
                for a in self.positions(leaf) {
                    for b in self.positions(other) {
                        if a < b && may_meet(&self.items[a], &self.items[b]) {
                            visit(self.order[a], self.order[b]);
                        }
                    }
                }
            },
        );
    }

    /// Visits the leaves below the nodes that `enter` lets in by themselves, their first leaf and
    /// how many leaves they have.
    fn descend(&self, enter: impl Fn(&B, usize, usize) -> bool, mut visit_leaf: impl FnMut(usize)) {
        // Each level leaves one node waiting at most.
        let mut waiting = [(0, 0, 0); usize::BITS as usize + 1];
        waiting[0] = (0, 0, self.leaves);
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let (number, first, size) = waiting[count];
            if !enter(&self.nodes[number], first, size) {
                continue;
            }
            if size == 1 {
                visit_leaf(first);
            } else {
                let half = size / 2;
                waiting[count] = (2 * number + 2, first + half, half);
                waiting[count + 1] = (2 * number + 1, first, half);
                count += 2;
            }
        }
    }

    fn positions(&self, leaf: usize) -> std::ops::Range<usize> {
        (leaf * LEAF).min(self.items.len())..((leaf + 1) * LEAF).min(self.items.len())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn boxes(corners: &[[i8; 6]]) -> Vec<Bounds> {
        let corner = |corner: &[i8]| std::array::from_fn(|axis| f64::from(corner[axis]));
        corners.iter().map(|c| Bounds::around([corner(&c[..3]), corner(&c[3..])])).collect()
    }

    #[test]
    fn no_box_is_around_a_point_that_is_not_a_number() {
        let boxes = boxes(&[[0, 0, 0, 1, 1, 1], [1, 0, 0, 2, 1, 1]]);
        let tree = BoxTree::new(&boxes);
        for axis in 0..3 {
            let mut point = [0.5; 3];
            point[axis] = f64::NAN;
            assert_eq!(boxes[0].squared_distance(point), f64::INFINITY);
            assert!(!tree.contains(point));
            tree.around(point, 1.0, |index| panic!("box {index}"));
            assert_eq!(tree.nearest(point, 1.0), None);
        }
        assert_eq!(Bounds::EMPTY.squared_distance([0.5; 3]), f64::INFINITY);
    }

    proptest! {
        /// As a look at every box finds them.
        #[test]
        fn the_boxes_around_a_point_are_found(
            corners in prop::collection::vec(prop::array::uniform6(-4_i8..4), 0..60),
            point in prop::array::uniform3(-5_i8..5),
        ) {
            let (boxes, point) = (boxes(&corners), point.map(f64::from));
            let tree = BoxTree::new(&boxes);
            let mut found = Vec::new();
            tree.around(point, 0.5, |index| found.push(index as usize));
            found.sort_unstable();
            let near = |index: &usize| boxes[*index].squared_distance(point) <= 0.25;
            prop_assert_eq!(found, (0..boxes.len()).filter(near).collect::<Vec<_>>());
            let inside = |bounds: &Bounds| bounds.squared_distance(point) == 0.0;
            prop_assert_eq!(tree.contains(point), boxes.iter().any(inside));
            let squares = (0..).zip(&boxes).map(|(index, it)| (index, it.squared_distance(point)));
            let least = squares.min_by(|a, b| a.1.total_cmp(&b.1));
            prop_assert_eq!(tree.nearest(point, 1e3), least);
            prop_assert_eq!(tree.nearest(point, 1.0), least.filter(|(_, square)| *square <= 1.0));
        }

        /// As a look at every pair finds them, each once.
        #[test]
        fn the_pairs_that_meet_are_found(
            corners in prop::collection::vec(prop::array::uniform6(-9_i8..9), 0..60),
        ) {
            let boxes = boxes(&corners);
            let tree = BoxTree::new(&boxes);
            let mut found = Vec::new();
            for leaf in 0..tree.leaves() {
                let visit = |a: u32, b: u32| found.push([a.min(b), a.max(b)]);
                tree.for_each_pair(leaf, Bounds::meets, visit);
            }
            found.sort_unstable();
            let count = u32::try_from(boxes.len()).unwrap();
            let pairs = (0..count).flat_map(|a| (a + 1..count).map(move |b| [a, b]));
            let meet = |[a, b]: &[u32; 2]| boxes[*a as usize].meets(&boxes[*b as usize]);
            prop_assert_eq!(found, pairs.filter(meet).collect::<Vec<_>>());
        }
    }
}
