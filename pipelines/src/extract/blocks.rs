//! Runs of cells with the vertices that they have, so that most cells need not be looked at.

use std::ops::Range;

use tombolo_deform::mesh::Cells;

/// Cells of a block. Where neighbours in the numbering are neighbours in space, so many tetrahedra
/// have about half as many vertices.
const CELLS: usize = 64;

/// Blocks of cells that follow one another, each with its vertices. It depends on the cells alone,
/// and takes some three bytes a tetrahedron.
#[derive(Debug)]
pub(super) struct Blocks {
    cells: usize,
    /// Where each block's vertices end.
    ends: Vec<usize>,
    vertices: Vec<u32>,
}

impl Blocks {
    pub(super) fn new(cells: &Cells, points: usize) -> Self {
        let (mut ends, mut vertices) = (Vec::new(), Vec::new());
        let mut last_block = vec![usize::MAX; points];
        for block in 0..cells.len().div_ceil(CELLS) {
            for cell in range(block, cells.len()) {
                for &vertex in cells.vertices(cell) {
                    if std::mem::replace(&mut last_block[vertex as usize], block) != block {
                        vertices.push(vertex);
                    }
                }
            }
            ends.push(vertices.len());
        }
        Self { cells: cells.len(), ends, vertices }
    }

    /// The cells and the vertices of each block.
    pub(super) fn iter(&self) -> impl Iterator<Item = (Range<usize>, &[u32])> {
        let mut start = 0;
        self.ends.iter().enumerate().map(move |(block, &end)| {
            let vertices = &self.vertices[std::mem::replace(&mut start, end)..end];
            (range(block, self.cells), vertices)
        })
    }
}

fn range(block: usize, cells: usize) -> Range<usize> {
    block * CELLS..cells.min((block + 1) * CELLS)
}

#[cfg(test)]
mod tests {
    use tombolo_deform::shapes::box_of_mixed_cells;

    use super::*;

    #[test]
    fn every_cell_is_in_one_block_that_has_its_vertices() {
        let mesh = box_of_mixed_cells([7, 5, 4], [0.0; 3], [1.0; 3]);
        let (cells, mut next) = (mesh.cells(), 0);
        for (block, vertices) in Blocks::new(cells, mesh.points().len()).iter() {
            assert_eq!(std::mem::replace(&mut next, block.end), block.start);
            let mut of_cells: Vec<u32> =
                block.flat_map(|cell| cells.vertices(cell)).copied().collect();
            of_cells.sort_unstable();
            of_cells.dedup();
            let mut vertices = vertices.to_vec();
            vertices.sort_unstable();
            assert_eq!(vertices, of_cells);
        }
        assert_eq!(next, cells.len());
    }
}
