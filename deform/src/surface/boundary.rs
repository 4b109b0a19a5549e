//! The boundary faces of a mesh, or of a part of one.

use super::{SurfaceError, boundary_of_cells, boundary_of_tets};
use crate::mesh::{CellType, Cells, FaceBuffer, Vector};

/// The faces of a part of a mesh that belong to one of its cells only: its boundary, and where it
/// was cut off from other parts.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct BoundaryFaces {
    /// The faces by the vertex numbers of the part, counter-clockwise seen from outside the volume.
    pub faces: Cells,
    /// The cell of each face, rising.
    pub cells: Vec<u32>,
    /// The position of each face among those of its cell.
    pub positions: Vec<u32>,
    /// Whether faces may run one way or the other round, as those of polyhedra and of cells of
    /// dimension 2 may.
    pub may_run_either_way: bool,
}

impl BoundaryFaces {
    /// The faces of the cells of this dimension (3, or 2 for a mesh that is its own surface) that
    /// belong to one cell only. Cells marked in `ghosts` do not count.
    ///
    /// ```
    /// use tombolo_deform::{shapes::box_of_tets, surface::BoundaryFaces};
    ///
    /// let mesh = box_of_tets([2, 1, 1], [0.0; 3], [2.0, 1.0, 1.0]);
    /// // Only the cells of the left half.
    /// let ghosts: Vec<bool> = mesh.cells().iter()
    ///     .map(|(_, vertices)| vertices.iter().any(|&vertex| mesh.points()[vertex as usize][0] > 1.0))
    ///     .collect();
    /// let boundary = BoundaryFaces::find(mesh.points(), mesh.cells(), 3, Some(&ghosts))?;
    /// assert_eq!(boundary.faces.len(), 12);
    /// # Ok::<(), tombolo_deform::surface::SurfaceError>(())
    /// ```
    ///
    /// # Errors
    /// [`SurfaceError::SharedFace`], [`SurfaceError::DuplicateCells`]; [`SurfaceError::Parts`] for
    /// a cell that names a vertex that is not there.
    pub fn find(
        points: &[Vector],
        cells: &Cells,
        dimension: usize,
        ghosts: Option<&[bool]>,
    ) -> Result<Self, SurfaceError> {
        cells.validate(points.len())?;
        let cells = &*cells.right_handed(points);
        let of_tets = || boundary_of_tets::boundary_faces(cells, points.len(), ghosts);
        let found = match (dimension == 3).then(of_tets).flatten() {
            Some(found) => found,
            None => boundary_of_cells::boundary_faces(cells, points.len(), dimension, ghosts)?,
        };
        let mut boundary = Self {
            faces: Cells::new(),
            cells: Vec::with_capacity(found.len()),
            positions: Vec::with_capacity(found.len()),
            may_run_either_way: may_run_either_way(dimension, cells),
        };
        let mut buffer = FaceBuffer::default();
        for same_cell in found.chunk_by(|a, b| a.cell == b.cell) {
            let cell = same_cell[0].cell;
            let mut wanted = same_cell.iter().peekable();
            buffer.for_each(cells, cell as usize, dimension, |position, vertices| {
                if wanted.next_if(|face| face.face == position).is_none() {
                    return;
                }
                let cell_type = CellType::of_polygon(vertices.len());
                // A face has three vertices at least, so that it is always taken.
                if boundary.faces.push(cell_type, vertices).is_ok() {
                    boundary.cells.push(cell);
                    boundary.positions.push(position);
                }
            });
        }
        Ok(boundary)
    }

    /// The faces whose cell is `wanted`.
    #[must_use]
    pub fn of_cells(&self, wanted: impl Fn(usize) -> bool) -> Self {
        self.of_faces(|face| wanted(self.cells[face] as usize))
    }

    /// The faces that are `wanted`, by their index.
    #[must_use]
    pub fn of_faces(&self, wanted: impl Fn(usize) -> bool) -> Self {
        let kept: Vec<usize> = (0..self.cells.len()).filter(|&face| wanted(face)).collect();
        Self {
            faces: self.faces.subset(kept.iter().copied()),
            cells: kept.iter().map(|&face| self.cells[face]).collect(),
            positions: kept.iter().map(|&face| self.positions[face]).collect(),
            may_run_either_way: self.may_run_either_way,
        }
    }
}

/// Whether the faces of these cells may run one way or the other round: those of volume cells other
/// than polyhedra are known to run the same way round.
pub(super) fn may_run_either_way(dimension: usize, cells: &Cells) -> bool {
    dimension == 2 || cells.types().contains(&CellType::Polyhedron)
}
