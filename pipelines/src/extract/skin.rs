//! The outside of an extract of volume cells, which is what viewers can show of one.

use std::collections::HashSet;

use tombolo_deform::mesh::{CellType, Cells, FaceBuffer, MeshError, lowest_four};

use super::Extract;

/// The faces that only one cell of the extract has, and its cells of lower dimension, with their
/// fields; `None` where there is no volume cell. Element fields are those of the cell behind.
///
/// A quadrilateral of one cell and two triangles of another that fill it are a face of both.
///
/// # Errors
/// None for an extract whose cells are sound.
pub(crate) fn skin(extract: &Extract) -> Result<Option<Extract>, MeshError> {
    if extract.cells.dimension() < 3 {
        return Ok(None);
    }
    Ok(Some(Outside::of(&extract.cells, None).taken(extract)?.0))
}

/// The faces of volume cells that no other cell has.
pub(super) struct Outside {
    faces: Vec<Face>,
    corners: Vec<u32>,
    /// For each cell whether it is passed over; `None` where none is.
    hidden: Option<Vec<bool>>,
}

impl Outside {
    /// The outside of the cells that are not hidden.
    pub(super) fn of(cells: &Cells, hidden: Option<Vec<bool>>) -> Self {
        let (mut faces, mut buffer) = (Faces::default(), FaceBuffer::default());
        for cell in 0..cells.len() {
            let is_hidden = hidden.as_ref().is_some_and(|hidden| hidden[cell]);
            if !is_hidden {
                buffer.for_each(cells, cell, 3, |_, face| faces.push(cell, face));
            }
        }
        Self { hidden, ..faces.outside() }
    }

    /// The corners of each face, by a number that [`retain`](Self::retain) knows it by.
    pub(super) fn faces(&self) -> impl Iterator<Item = &[u32]> {
        self.faces.iter().map(|face| &self.corners[face.start..face.end])
    }

    /// Keeps only those of the faces for which `is_kept` holds, by their numbers.
    pub(super) fn retain(&mut self, is_kept: impl Fn(usize) -> bool) {
        let mut numbers = 0..;
        self.faces.retain(|_| numbers.next().is_some_and(&is_kept));
    }

    /// The cells that the faces belong to.
    pub(super) fn owners(&self) -> impl Iterator<Item = usize> {
        self.faces.iter().map(|face| face.cell)
    }

    /// The faces, and cells of lower dimension, as an extract; and which of the points they have.
    pub(super) fn taken(&self, extract: &Extract) -> Result<(Extract, Vec<u32>), MeshError> {
        let mut taken = Cells::new();
        let mut owners = Vec::new();
        let mut outer = self.faces.iter().peekable();
        for (number, (cell_type, vertices)) in (0..).zip(extract.cells.iter()) {
            let cell = number as usize;
            let is_hidden = self.hidden.as_ref().is_some_and(|hidden| hidden[cell]);
            if cell_type.dimension() < 3 && !is_hidden {
                taken.push(cell_type, vertices)?;
                owners.push(number);
            }
            while let Some(face) = outer.next_if(|face| face.cell == cell) {
                let face = &self.corners[face.start..face.end];
                taken.push(CellType::of_polygon(face.len()), face)?;
                owners.push(number);
            }
        }
        let (cells, points) = taken.compact(extract.points.len());
        Ok((extract.part(&points, cells.into(), &owners), points))
    }
}

/// Faces of cells, of which some may be the same.
#[derive(Default)]
pub(super) struct Faces {
    faces: Vec<Face>,
    corners: Vec<u32>,
}

impl Faces {
    /// Adds a face of a cell.
    pub(super) fn push(&mut self, cell: usize, face: &[u32]) {
        let start = self.corners.len();
        self.corners.extend(face);
        self.faces.push(Face { key: lowest_four(face), cell, start, end: self.corners.len() });
    }

    /// The faces that occur once.
    pub(super) fn outside(self) -> Outside {
        let Self { mut faces, corners } = self;
        faces.sort_by_key(|face| (face.key, face.cell));
        let single = faces.chunk_by(|a, b| a.key == b.key);
        let mut faces: Vec<Face> =
            single.filter_map(|same| if let [one] = same { Some(*one) } else { None }).collect();
        remove_split(&mut faces, &corners);
        faces.sort_by_key(|face| (face.cell, face.start));
        Outside { faces, corners, hidden: None }
    }
}

/// A face of a cell.
#[derive(Clone, Copy)]
struct Face {
    /// Its four lowest corners; of a triangle three and `u32::MAX`.
    key: [u32; 4],
    cell: usize,
    start: usize,
    end: usize,
}

/// Takes out quadrilaterals, with the two triangles that fill each of them.
fn remove_split(outer: &mut Vec<Face>, corners: &[u32]) {
    let triangles: HashSet<[u32; 4]> =
        outer.iter().map(|face| face.key).filter(|key| key[3] == u32::MAX).collect();
    let mut inner = HashSet::new();
    for face in outer.iter().filter(|face| face.end - face.start == 4) {
        let [a, b, c, d] = [0, 1, 2, 3].map(|corner| corners[face.start + corner]);
        for halves in [[[a, b, c], [a, c, d]], [[a, b, d], [b, c, d]]] {
            let halves = halves.map(|half| lowest_four(&half));
            if halves.iter().all(|half| triangles.contains(half)) {
                inner.extend([face.key, halves[0], halves[1]]);
            }
        }
    }
    outer.retain(|face| !inner.contains(&face.key));
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A hexahedron that has collapsed to a wedge, and a tetrahedron on its lower side.
    #[test]
    fn faces_between_collapsed_cells_are_inside() {
        let mut cells = Cells::new();
        cells.push(CellType::Hexahedron, &[0, 1, 2, 2, 4, 5, 6, 6]).unwrap();
        cells.push(CellType::Tetra, &[0, 2, 1, 3]).unwrap();
        let extract = Extract {
            points: (0..7).map(|x| [f64::from(x), 0.0, 0.0]).collect(),
            cells: cells.into(),
            vertices: None,
            features: None,
            fields: Vec::new(),
        };
        let skin = skin(&extract).unwrap().unwrap();
        let mut corners: Vec<usize> = skin.cells.iter().map(|(_, face)| face.len()).collect();
        corners.sort_unstable();
        // The upper side and three walls of the wedge, and the other sides of the tetrahedron.
        assert_eq!(corners, [3, 3, 3, 3, 4, 4, 4]);
    }
}
