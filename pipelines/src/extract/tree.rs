//! A tree of boxes, by which the boxes around a point are found.

use tombolo_deform::bounds::Bounds;
use tombolo_deform::mesh::Vector;

/// How many boxes a leaf has at most.
const LEAF: usize = 8;

/// Boxes in a binary tree, halved along the longest axis.
#[derive(Default)]
pub(super) struct Tree {
    boxes: Vec<Bounds>,
    /// The boxes by their numbers, leaf after leaf.
    order: Vec<u32>,
    nodes: Vec<Node>,
}

struct Node {
    bounds: Bounds,
    start: usize,
    end: usize,
    /// The second child; the first is the next node. 0 for a leaf.
    second: usize,
}

impl Tree {
    pub(super) fn new(boxes: Vec<Bounds>) -> Self {
        #[expect(clippy::cast_possible_truncation, reason = "cells are numbered with 32 bits")]
        let order = (0..boxes.len() as u32).collect();
        let count = boxes.len();
        let mut tree = Self { boxes, order, nodes: Vec::new() };
        if count > 0 {
            tree.build(0, count);
        }
        tree
    }

    fn build(&mut self, start: usize, end: usize) {
        let part = &mut self.order[start..end];
        let boxes = &self.boxes;
        let bounds =
            part.iter().fold(Bounds::EMPTY, |bounds, &index| bounds.join(&boxes[index as usize]));
        let node = self.nodes.len();
        self.nodes.push(Node { bounds, start, end, second: 0 });
        if part.len() <= LEAF {
            return;
        }
        let axis = bounds.longest_axis();
        let middle = part.len() / 2;
        let key = |index: u32| boxes[index as usize].center()[axis];
        part.select_nth_unstable_by(middle, |&a, &b| key(a).total_cmp(&key(b)).then(a.cmp(&b)));
        self.build(start, start + middle);
        self.nodes[node].second = self.nodes.len();
        self.build(start + middle, end);
    }

    /// Calls `visit` with the number of each box that a point is in or no further from than
    /// `slack`.
    pub(super) fn at(&self, point: Vector, slack: f64, mut visit: impl FnMut(u32)) {
        let mut open: Vec<usize> = (0..self.nodes.len().min(1)).collect();
        while let Some(node) = open.pop() {
            let Node { bounds, start, end, second } = &self.nodes[node];
            if distance(bounds, point) > slack * slack {
                continue;
            }
            if *second > 0 {
                open.extend([node + 1, *second]);
                continue;
            }
            for &index in &self.order[*start..*end] {
                if distance(&self.boxes[index as usize], point) <= slack * slack {
                    visit(index);
                }
            }
        }
    }
}

/// The square of the distance from a box.
fn distance(bounds: &Bounds, point: Vector) -> f64 {
    let beside = |axis: usize| {
        (bounds.lower[axis] - point[axis]).max(point[axis] - bounds.upper[axis]).max(0.0)
    };
    (0..3).map(|axis| beside(axis).powi(2)).sum()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// As a look at every box finds it.
        #[test]
        fn trees_find_the_boxes_around(
            corners in prop::collection::vec(prop::array::uniform6(-4_i8..4), 0..60),
            point in prop::array::uniform3(-5_i8..5),
        ) {
            let boxes: Vec<Bounds> = corners
                .iter()
                .map(|c| Bounds::around([[c[0], c[1], c[2]], [c[3], c[4], c[5]]].map(|p| p.map(f64::from))))
                .collect();
            let point = point.map(f64::from);
            let tree = Tree::new(boxes.clone());
            let mut found = Vec::new();
            tree.at(point, 0.5, |index| found.push(index as usize));
            found.sort_unstable();
            let near = |index: &usize| distance(&boxes[*index], point) <= 0.25;
            prop_assert_eq!(found, (0..boxes.len()).filter(near).collect::<Vec<_>>());
        }
    }
}
