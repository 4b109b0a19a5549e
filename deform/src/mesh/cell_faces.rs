//! The faces of cells, one cell after the other.

use super::{CellType, Cells};

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

/// The four lowest vertices in rising order (`u32::MAX` for a triangle's fourth).
pub(crate) fn lowest_four(vertices: &[u32]) -> [u32; 4] {
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
#[derive(Default)]
pub(crate) struct FaceBuffer {
    distinct: Vec<u32>,
}

impl FaceBuffer {
    /// Calls `visit` with each face of a cell: its position among them, and its distinct vertices
    /// in order around. A cell of dimension 2 is its own face; a strip has its triangles for faces.
    pub fn for_each(
        &mut self,
        cells: &Cells,
        cell: usize,
        dimension: usize,
        mut visit: impl FnMut(u32, &[u32]),
    ) {
        let cell_type = cells.cell_type(cell);
        if cell_type.dimension() != dimension {
            return;
        }
        let mut position = 0;
        let mut take = |face: &[u32]| {
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
            return;
        }
        match (cell_type, cells.vertices(cell)) {
            (CellType::Pixel, &[a, b, c, d]) => take(&[a, b, d, c]),
            (CellType::TriangleStrip, vertices) => {
                for (start, triple) in vertices.windows(3).enumerate() {
                    match *triple {
                        [a, b, c] if start % 2 == 1 => take(&[b, a, c]),
                        _ => take(triple),
                    }
                }
            }
            (_, vertices) => take(vertices),
        }
    }
}

/// The vertices in rising order.
pub(crate) fn sorted(vertices: &[u32]) -> Vec<u32> {
    let mut vertices = vertices.to_vec();
    vertices.sort_unstable();
    vertices
}
