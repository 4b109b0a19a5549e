//! A rank's own cells in a tree of boxes, by which those that a point lies in are found.

use tombolo_deform::bounds::{Bounds, BoxTree};
use tombolo_deform::mesh::Vector;

use super::Association;
use super::source::Source;

/// How far beside a cell a point may lie that is in it but for rounding: in parametric coordinates,
/// and in diagonals of the cells' bounding box.
pub(super) const SLACK: f64 = 1e-9;

/// By how much of the largest coordinate a point may lie beside a cell, all the same.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

/// The own cells of a rank that have an inside, where they are now.
#[derive(Debug)]
pub(super) struct Search {
    cells: Vec<u32>,
    tree: BoxTree,
    /// How far beside a cell a point may lie, in units of the mesh.
    pub(super) slack: f64,
}

impl Search {
    pub(super) fn new(source: &Source) -> Self {
        let (cells, points) = (source.cells(), &source.positions.points);
        #[expect(clippy::cast_possible_truncation, reason = "cells are numbered with 32 bits")]
        let own: Vec<u32> = (0..cells.len())
            .filter(|&cell| {
                cells.cell_type(cell).dimension() >= 2 && source.counts(Association::Element, cell)
            })
            .map(|cell| cell as u32)
            .collect();
        let bounds = |&cell: &u32| {
            let vertices = cells.vertices(cell as usize);
            Bounds::around(vertices.iter().map(|&vertex| points[vertex as usize]))
        };
        let boxes: Vec<Bounds> = own.iter().map(bounds).collect();
        let all = boxes.iter().fold(Bounds::EMPTY, |all, bounds| all.join(bounds));
        // In a face that lies far from the origin, what lies in it is rounded by more.
        let largest =
            all.corners().as_flattened().iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        let slack = (SLACK * all.diagonal()).max(ROUNDING * largest);
        let slack = if own.is_empty() { 0.0 } else { slack };
        Self { cells: own, tree: BoxTree::new(&boxes), slack }
    }

    /// The cells whose boxes a point lies in, but for rounding.
    pub(super) fn around(&self, point: Vector) -> Vec<u32> {
        let mut around = Vec::new();
        self.tree.around(point, self.slack, |index| around.push(self.cells[index as usize]));
        around
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use tombolo_deform::communicator::Solo;
    use tombolo_deform::distributed::Part;
    use tombolo_deform::shapes::box_of_tets;

    use crate::extract::{Channel, FieldView, Input};
    use crate::language::{Glyphs, Streamlines};

    use super::*;

    /// What a line or a glyph stands in is looked for in one tree until the mesh moves.
    #[test]
    fn a_mesh_at_rest_keeps_its_tree() {
        let mesh = box_of_tets([3, 3, 3], [0.0; 3], [1.0; 3]);
        let mut part = Part::cut(&mesh, &vec![0; mesh.cells().len()], 0, false).unwrap();
        let stage = r#"{"field": "u", "points": [[0.2, 0.4, 0.6]]}"#;
        let lines: Streamlines = serde_json::from_str(stage).unwrap();
        let arrows: Glyphs = serde_json::from_str(stage).unwrap();
        let u = vec![[1.0, 0.1, 0.2]; part.points.len()];
        let fields = [FieldView::vertex("u", &u)];
        let mut source = Source::new(&Channel::new("fluid", part.view(), &fields)).unwrap();
        let mut run = |part: &Part| {
            let channel = Channel::new("fluid", part.view(), &fields);
            let input =
                Input { channel: &channel, cycle: 0, wanted: &|_| true, communicator: &Solo };
            let taken = source.streamlines(&input, &lines).unwrap();
            let tree = Arc::clone(source.search());
            source.glyphs(&input, &arrows).unwrap();
            assert!(Arc::ptr_eq(&tree, source.search()));
            (taken.extract, tree)
        };
        let (first, tree) = run(&part);
        let (again, same) = run(&part);
        assert!(Arc::ptr_eq(&tree, &same));
        assert_eq!(first, again);
        part.points.iter_mut().for_each(|point| point[0] += 0.1);
        let (moved, other) = run(&part);
        assert!(!Arc::ptr_eq(&tree, &other));
        let leftmost = |points: &[[f64; 3]]| points.iter().map(|it| it[0]).fold(1.0, f64::min);
        assert!(leftmost(&first.points) < 0.05 && leftmost(&moved.points) >= 0.1);
    }
}
