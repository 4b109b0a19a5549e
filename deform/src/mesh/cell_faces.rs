//! The faces of cells, one cell after the other.

use super::Cells;

/// A face of a cell: the cell and its position among the faces of that cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct CellFace {
    pub cell: u32,
    pub face: u32,
}

/// The vertices of one face, in order around, without repeats.
pub(crate) fn face_vertices(cells: &Cells, dimension: usize, wanted: CellFace) -> Vec<u32> {
    let mut found = Vec::new();
    FaceBuffer::default().for_each(cells, wanted.cell as usize, dimension, |face, vertices| {
        if face == wanted.face {
            found = vertices.to_vec();
        }
    });
    found
}

/// The four lowest of a face's vertices in rising order, `u32::MAX` for a triangle's fourth: the same
/// for two faces that have the same vertices, whichever of them each begins with.
#[must_use]
pub fn lowest_four(vertices: &[u32]) -> [u32; 4] {
    let mut lowest = [u32::MAX; 4];
    for &vertex in vertices {
        let mut carried = vertex;
        for slot in &mut lowest {
            if carried < *slot {
                std::mem::swap(slot, &mut carried);
            }
        }
    }
    lowest
}

/// Memory in which the faces of one cell after the other are put together.
#[derive(Debug, Default)]
pub struct FaceBuffer {
    distinct: Vec<u32>,
}

impl FaceBuffer {
    /// Calls `visit` with each face of a cell of this dimension, and with none of another: its
    /// position among them, and its distinct vertices in order around. Faces that have collapsed to
    /// fewer than three vertices are passed over. A cell of dimension 2 is its own face; a strip has
    /// its triangles for faces.
    pub fn for_each(
        &mut self,
        cells: &Cells,
        cell: usize,
        dimension: usize,
        mut visit: impl FnMut(u32, &[u32]),
    ) {
        if cells.cell_type(cell).dimension() != dimension {
            return;
        }
        let mut position = 0;
        let take = |face: &[u32]| {
            if (1..face.len()).all(|end| !face[..end].contains(&face[end])) {
                visit(position, face);
            } else {
                self.distinct.clear();
                for &vertex in face {
                    if !self.distinct.contains(&vertex) {
                        self.distinct.push(vertex);
                    }
                }
                if self.distinct.len() >= 3 {
                    visit(position, &self.distinct);
                }
            }
            position += 1;
        };
        if dimension == 3 {
            cells.for_each_face(cell, take);
        } else {
            cells.for_each_polygon(cell, take);
        }
    }
}

/// The vertices in rising order.
pub(crate) fn sorted(vertices: &[u32]) -> Vec<u32> {
    let mut vertices = vertices.to_vec();
    vertices.sort_unstable();
    vertices
}
