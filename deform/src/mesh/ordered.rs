//! Numbering vertices and cells by where they lie.

use std::borrow::Cow;
use std::sync::Arc;

use super::{FeatureSource, Mesh, Vector};
use crate::bounds::{self, BITS, Bounds};
use crate::number::real;
use crate::parallel;
use crate::topology::{Groups, indices};

/// Vertices of a cell whose numbers lie this far apart in the mean, in units of the vertices in a
/// section through a cube of as many, are near enough.
const NEAR: f64 = 2.0;

/// A mesh whose vertices and cells are numbered along a curve that fills space (G. M. Morton 1966),
/// so that what is near in space is near in memory: mesh generators number at random, and work on
/// such a mesh waits for memory most of the time.
///
/// A mesh that is numbered well stays as it is. The order depends on the coordinates; vertices in
/// one place keep theirs.
#[derive(Debug)]
pub(crate) struct Ordered {
    mesh: Mesh,
    numbering: Numbering,
    /// The number in the other mesh of each cell of the ordered one, where they differ.
    cells: Option<Vec<u32>>,
}

/// The numbers of the vertices of an ordered mesh in the other one, and the other way round.
#[derive(Debug)]
pub(crate) struct Numbering {
    count: usize,
    /// The vertices in their order, and the index of each; `None` where they are numbered as they
    /// were.
    numbers: Option<(Vec<u32>, Vec<u32>)>,
}

impl Ordered {
    /// The mesh must have fewer than 2³² cells.
    pub(crate) fn new(mesh: &Mesh) -> Self {
        let count = mesh.points.len();
        if is_near(mesh) {
            return Self {
                mesh: mesh.clone(),
                numbering: Numbering { count, numbers: None },
                cells: None,
            };
        }
        let vertices = along_curve(&mesh.points);
        let indices = indices(count, &vertices);
        let cells = by_first_vertex(mesh, &indices);
        let ordered = Mesh {
            points: vertices.iter().map(|&vertex| mesh.points[vertex as usize]).collect(),
            cells: Arc::new(mesh.cells.renumbered(&cells, &indices)),
            features: Arc::new(FeatureSource::default()),
        };
        let numbering = Numbering { count, numbers: Some((vertices, indices)) };
        Self { mesh: ordered, numbering, cells: Some(cells) }
    }

    /// The mesh in its order; it may have no features.
    pub(crate) fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// Another mesh with the same cells, which has finite coordinates, in this order.
    pub(crate) fn like(&self, mesh: &Mesh) -> Mesh {
        Mesh {
            points: match self.numbering.gather(&mesh.points) {
                Cow::Borrowed(_) => Arc::clone(&mesh.points),
                Cow::Owned(points) => points.into(),
            },
            cells: Arc::clone(&self.mesh.cells),
            features: Arc::clone(&self.mesh.features),
        }
    }

    pub(crate) fn numbering(&self) -> &Numbering {
        &self.numbering
    }

    pub(crate) fn into_parts(self) -> (Mesh, Numbering) {
        (self.mesh, self.numbering)
    }

    /// The number in the other mesh of a cell of the ordered one.
    pub(crate) fn cell(&self, index: usize) -> usize {
        self.cells.as_ref().map_or(index, |cells| cells[index] as usize)
    }
}

impl Numbering {
    /// The number in the ordered mesh of a vertex of the other, if it has that.
    pub(crate) fn index(&self, vertex: u32) -> Option<u32> {
        match &self.numbers {
            Some((_, indices)) => indices.get(vertex as usize).copied(),
            None => Some(vertex).filter(|&vertex| (vertex as usize) < self.count),
        }
    }

    /// The number in the other mesh of a vertex of the ordered one.
    pub(crate) fn vertex(&self, index: u32) -> u32 {
        self.numbers.as_ref().map_or(index, |(vertices, _)| vertices[index as usize])
    }

    /// A value for each vertex of the other mesh, in this order.
    pub(crate) fn gather<'a>(&self, values: &'a [Vector]) -> Cow<'a, [Vector]> {
        match &self.numbers {
            Some((vertices, _)) => vertices.iter().map(|&vertex| values[vertex as usize]).collect(),
            None => Cow::Borrowed(values),
        }
    }

    /// Gives back a value for each vertex in this order.
    pub(crate) fn scatter(&self, ordered: &[Vector], values: &mut [Vector]) {
        match &self.numbers {
            Some((vertices, _)) => {
                for (&vertex, &value) in vertices.iter().zip(ordered) {
                    values[vertex as usize] = value;
                }
            }
            None => values.copy_from_slice(ordered),
        }
    }
}

/// Whether the vertices of a cell have numbers near to each other already.
fn is_near(mesh: &Mesh) -> bool {
    let spread = |vertices: &[u32]| {
        let (least, most) =
            vertices.iter().fold((u32::MAX, 0), |(a, b), &vertex| (a.min(vertex), b.max(vertex)));
        u64::from(most.saturating_sub(least))
    };
    let sum: u64 = mesh.cells.iter().map(|(_, vertices)| spread(vertices)).sum();
    sum as f64 <= NEAR * real(mesh.points.len()).powf(2.0 / 3.0) * real(mesh.cells.len())
}

/// The vertices in the order of Morton's curve through their bounding cube.
fn along_curve(points: &[Vector]) -> Vec<u32> {
    const CHUNK: usize = 16384;
    let bounds = Bounds::around(points.iter().copied());
    let (lower, size) = (bounds.lower, bounds.extent().into_iter().fold(0.0, f64::max));
    let steps = f64::from((1u32 << BITS) - 1);
    let mut order = vec![(0u64, 0u32); points.len()];
    parallel::for_each_chunk(&mut order, CHUNK, |chunk, part| {
        for (index, entry) in part.iter_mut().enumerate() {
            let vertex = chunk * CHUNK + index;
            let steps =
                [0, 1, 2].map(|axis| ((points[vertex][axis] - lower[axis]) / size * steps) as u64);
            *entry = (bounds::along_curve(steps), vertex as u32);
        }
    });
    parallel::sort(&mut order);
    order.into_iter().map(|(_, vertex)| vertex).collect()
}

/// The cells in the order of the first of their vertices.
fn by_first_vertex(mesh: &Mesh, indices: &[u32]) -> Vec<u32> {
    const CHUNK: usize = 16384;
    let first = |cell: usize| {
        mesh.cells.vertices(cell).iter().map(|&vertex| indices[vertex as usize]).min().unwrap_or(0)
    };
    let firsts = parallel::map_chunks(mesh.cells.len(), CHUNK, |range| {
        range.map(first).collect::<Vec<u32>>()
    });
    Groups::new(indices.len(), firsts.iter().flatten().copied().zip(0..)).items
}

/// A mesh whose vertices and cells have other numbers, and those of the vertices.
#[cfg(test)]
pub(crate) fn shuffled(mesh: &Mesh) -> (Mesh, Vec<u32>) {
    let turned = |count: usize, step: usize| -> Vec<u32> {
        (0..count).map(|i| (i * step % count) as u32).collect()
    };
    // Steps without a factor in common with the counts visit all of them.
    let number = turned(mesh.points.len(), 619);
    let mut points = vec![[0.0; 3]; number.len()];
    for (&number, &point) in number.iter().zip(mesh.points()) {
        points[number as usize] = point;
    }
    let order = turned(mesh.cells.len(), 1009);
    (
        Mesh::new(points, mesh.cells.renumbered(&order, &number), FeatureSource::default())
            .unwrap(),
        number,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{CellType, Cells};
    use crate::shapes;

    #[test]
    fn every_vertex_and_cell_has_one_new_number_and_lies_where_it_did() {
        let (mesh, _) = shuffled(&shapes::box_of_mixed_cells([6, 6, 6], [0.0; 3], [1.0; 3]));
        let ordered = Ordered::new(&mesh);
        let numbering = ordered.numbering();
        assert!(!is_near(&mesh) && is_near(ordered.mesh()));
        let mut seen = vec![false; mesh.points().len()];
        for index in 0..mesh.points().len() {
            let vertex = numbering.vertex(index as u32);
            assert!(!std::mem::replace(&mut seen[vertex as usize], true));
            assert_eq!(numbering.index(vertex), Some(index as u32));
            assert_eq!(ordered.mesh().points()[index], mesh.points()[vertex as usize]);
        }
        let mut seen = vec![false; mesh.cells().len()];
        for index in 0..mesh.cells().len() {
            let cell = ordered.cell(index);
            assert!(!std::mem::replace(&mut seen[cell], true));
            let (new, old) = (ordered.mesh().cells(), mesh.cells());
            assert_eq!(new.cell_type(index), old.cell_type(cell));
            let back: Vec<u32> =
                new.vertices(index).iter().map(|&vertex| numbering.vertex(vertex)).collect();
            assert_eq!(back, old.vertices(cell));
        }
        let mut values = vec![[0.0; 3]; mesh.points().len()];
        numbering.scatter(&numbering.gather(mesh.points()), &mut values);
        assert_eq!(values, mesh.points());
        assert_eq!(ordered.like(&mesh), *ordered.mesh());
        assert_eq!(numbering.index(mesh.points().len() as u32), None);
    }

    #[test]
    fn faces_of_polyhedra_are_renumbered_too() {
        let mut cells = Cells::new();
        let faces = vec![vec![0, 2, 1], vec![0, 1, 3], vec![1, 2, 3], vec![0, 3, 2]];
        cells.push(CellType::Tetra, &[0, 1, 2, 3]).unwrap();
        cells.push_polyhedron(&faces).unwrap();
        let number = [9, 7, 5, 3, 1];
        let renumbered = cells.renumbered(&[1, 0], &number);
        assert_eq!(renumbered.polyhedron_faces(0)[0], [9, 5, 7]);
        assert_eq!(renumbered.polyhedron_faces(1).len(), 0);
        assert_eq!(renumbered.vertices(1), [9, 7, 5, 3]);
    }

    #[test]
    fn a_mesh_in_order_stays_as_it_is() {
        let mesh = shapes::box_of_tets([9, 9, 9], [0.0; 3], [1.0; 3]);
        let ordered = Ordered::new(&mesh);
        let numbering = ordered.numbering();
        assert!(numbering.numbers.is_none());
        assert_eq!(*ordered.mesh(), mesh);
        assert_eq!(
            (numbering.index(5), numbering.vertex(5), ordered.cell(7), numbering.index(1000)),
            (Some(5), 5, 7, None)
        );
    }

    #[test]
    fn a_mesh_of_one_point_and_one_of_none_have_an_order() {
        for points in [vec![], vec![[1.0; 3]], vec![[f64::MAX; 3], [-f64::MAX; 3]]] {
            assert_eq!(along_curve(&points).len(), points.len());
        }
    }
}
