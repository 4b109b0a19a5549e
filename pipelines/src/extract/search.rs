//! A rank's own cells in a tree of boxes, by which those that a point lies in are found.

use std::sync::OnceLock;

use tombolo_deform::bounds::{Bounds, BoxTree};
use tombolo_deform::mesh::{Cells, Vector};

/// How far beside a cell a point may lie that is in it but for rounding: in parametric coordinates,
/// and in diagonals of the cells' bounding box.
pub(super) const SLACK: f64 = 1e-9;

/// By how much of the largest coordinate a point may lie beside a cell, all the same.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

/// The own cells of a rank that have an inside, where they are now.
#[derive(Debug)]
pub(super) struct Search {
    pub(super) cells: Vec<u32>,
    /// The tree of their boxes, once a point is looked for by itself.
    tree: OnceLock<BoxTree>,
    /// How far beside a cell a point may lie, in units of the mesh.
    pub(super) slack: f64,
}

impl Search {
    /// Of cells and their points as they are now; `counts` says which are this rank's own.
    pub(super) fn new(cells: &Cells, points: &[Vector], counts: impl Fn(usize) -> bool) -> Self {
        let mut own = Vec::with_capacity(cells.len());
        let mut is_used = vec![false; points.len()];
        for (cell, (cell_type, vertices)) in (0..).zip(cells.iter()) {
            if cell_type.dimension() >= 2 && counts(cell as usize) {
                own.push(cell);
                vertices.iter().for_each(|&vertex| is_used[vertex as usize] = true);
            }
        }
        let used = points.iter().zip(&is_used).filter(|(_, is_used)| **is_used);
        let all = Bounds::around(used.map(|(point, _)| *point));
        // In a face that lies far from the origin, what lies in it is rounded by more.
        let largest =
            all.corners().as_flattened().iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        let slack = (SLACK * all.diagonal()).max(ROUNDING * largest);
        let slack = if own.is_empty() { 0.0 } else { slack };
        Self { cells: own, tree: OnceLock::new(), slack }
    }

    /// The cells whose boxes a point lies in, but for rounding.
    pub(super) fn around(&self, cells: &Cells, points: &[Vector], point: Vector) -> Vec<u32> {
        let tree = self.tree.get_or_init(|| {
            let boxes: Vec<Bounds> =
                self.cells.iter().map(|&cell| bounds(cells, points, cell)).collect();
            BoxTree::new(&boxes)
        });
        let mut around = Vec::new();
        tree.around(point, self.slack, |index| around.push(self.cells[index as usize]));
        around
    }
}

/// The box around a cell.
pub(super) fn bounds(cells: &Cells, points: &[Vector], cell: u32) -> Bounds {
    let mut bounds = Bounds::EMPTY;
    for &vertex in cells.vertices(cell as usize) {
        let point = points[vertex as usize];
        // All are numbers, so that a look at which is smaller is enough.
        let smaller = |a: f64, b: f64| if a < b { a } else { b };
        let larger = |a: f64, b: f64| if a > b { a } else { b };
        bounds = Bounds {
            lower: std::array::from_fn(|axis| smaller(point[axis], bounds.lower[axis])),
            upper: std::array::from_fn(|axis| larger(point[axis], bounds.upper[axis])),
        };
    }
    bounds
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use tombolo_deform::communicator::Solo;
    use tombolo_deform::distributed::Part;
    use tombolo_deform::shapes::box_of_tets;

    use crate::extract::{Channel, FieldView, Input, Source};
    use crate::language::{Glyphs, Streamlines};

    /// What a line or a glyph stands in is looked for in one tree until the mesh moves.
    #[test]
    fn a_mesh_at_rest_keeps_its_tree() {
        let mesh = box_of_tets([3, 3, 3], [0.0; 3], [1.0; 3]);
        let mut part = Part::whole(&mesh).unwrap();
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
