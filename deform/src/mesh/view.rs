//! Meshes of a solver, borrowed for the length of one call.

use std::ops::Range;

use super::{ArrayView, CellType, Cells, FeatureSource, Indices, Mesh, MeshError, ghosts};
use crate::bounds::Bounds;

/// Cells borrowed from the solver.
#[derive(Debug, Clone, Copy)]
pub enum CellsView<'a> {
    /// All of one type with a fixed number of vertices.
    Uniform {
        /// The type.
        cell_type: CellType,
        /// The vertices, cell after cell.
        connectivity: Indices<'a>,
    },
    /// Cells of several types with a fixed number of vertices each, type after type: the vertices,
    /// cell after cell.
    Types(&'a [(CellType, Indices<'a>)]),
    /// Any mix of types but polyhedra.
    Mixed {
        /// VTK's number of each cell's type.
        types: &'a [u8],
        /// Row starts into `connectivity`, one more than there are cells.
        offsets: Indices<'a>,
        /// The vertices, cell after cell.
        connectivity: Indices<'a>,
    },
    /// Cells that the kernel owns already.
    Owned(&'a Cells),
}

impl CellsView<'_> {
    /// How many cells there are.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            CellsView::Uniform { cell_type, connectivity } => count(*cell_type, connectivity),
            CellsView::Types(types) => {
                types.iter().map(|(cell_type, connectivity)| count(*cell_type, connectivity)).sum()
            }
            CellsView::Mixed { types, .. } => types.len(),
            CellsView::Owned(cells) => cells.len(),
        }
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// A copy that owns its arrays.
    ///
    /// # Errors
    /// [`MeshError::UnknownCellType`], [`MeshError::Offsets`], [`MeshError::VertexCount`] or
    /// [`MeshError::VertexNumber`] with the first cell that is wrong.
    pub fn to_cells(&self) -> Result<Cells, MeshError> {
        self.copied(u32::MAX as usize)
    }

    /// A copy of the cells of a mesh of so many vertices, on which errors alone depend.
    fn copied(self, vertex_count: usize) -> Result<Cells, MeshError> {
        let vertex = |cell: usize, numbers: &Indices<'_>, index: usize| {
            let vertex = || numbers.signed(index);
            u32::try_from(numbers.get(index)).map_err(|_| MeshError::VertexNumber {
                cell,
                vertex: vertex(),
                vertex_count,
            })
        };
        match self {
            CellsView::Owned(cells) => Ok(cells.clone()),
            CellsView::Uniform { cell_type, connectivity } => {
                let size = cell_type.vertex_count().unwrap_or(1);
                // Not collected: that would set aside up to twice as much, without knowing how much.
                let mut vertices = Vec::with_capacity(connectivity.len());
                for index in 0..connectivity.len() {
                    vertices.push(vertex(index / size, &connectivity, index)?);
                }
                Cells::uniform(cell_type, vertices)
            }
            CellsView::Types(types) => {
                let mut cells = Cells::new();
                let mut row = Vec::new();
                for (cell_type, connectivity) in types {
                    let size = cell_type.vertex_count().unwrap_or(1);
                    for first in (0..connectivity.len()).step_by(size) {
                        row.clear();
                        for index in first..(first + size).min(connectivity.len()) {
                            row.push(vertex(cells.len(), connectivity, index)?);
                        }
                        cells.push(*cell_type, &row)?;
                    }
                }
                Ok(cells)
            }
            CellsView::Mixed { types, offsets, connectivity } => {
                let mut cells = Cells::new();
                let mut row = Vec::new();
                check_length("offsets", offsets.len(), types.len() + 1)?;
                for cell in 0..types.len() {
                    let (cell_type, range) = mixed_cell(cell, types, offsets, connectivity.len())?;
                    row.clear();
                    for index in range {
                        row.push(vertex(cell, &connectivity, index)?);
                    }
                    cells.push(cell_type, &row)?;
                }
                Ok(cells)
            }
        }
    }
}

/// How many cells of a type there are.
fn count(cell_type: CellType, connectivity: &Indices<'_>) -> usize {
    connectivity.len() / cell_type.vertex_count().unwrap_or(1)
}

/// A mesh borrowed from the solver for the length of one call.
#[derive(Debug, Clone, Copy)]
pub struct MeshView<'a> {
    /// The coordinates of each vertex: 2 or 3 components.
    pub points: ArrayView<'a>,
    /// The cells.
    pub cells: CellsView<'a>,
    /// Where the features come from.
    pub features: &'a FeatureSource,
    /// Counted up by the solver whenever cells or features change, so that nothing need be
    /// compared.
    pub generation: u64,
    /// The vertices' numbers in the whole, distributed mesh, where the solver knows them.
    pub global_vertices: Option<Indices<'a>>,
    /// The cells' numbers in the whole, distributed mesh, where the solver knows them. With both,
    /// what is made of the whole mesh does not depend on how it is distributed.
    pub global_cells: Option<Indices<'a>>,
    /// The bits of each cell's `vtkGhostType`, which say whether it is a copy of another rank's, or
    /// hidden ([`ghosts`]); `None`: all cells are this rank's own.
    ///
    /// [`ghosts`]: super::ghosts
    pub ghost_cells: Option<&'a [u8]>,
    /// The boxes that the grids of the whole mesh fill, those of all ranks, where it is made of
    /// grids of several levels along the axes. A face between two of them is inside, though no cell
    /// beyond it has the same corners. Empty for any other mesh.
    pub grid_boxes: &'a [Bounds],
}

impl<'a> MeshView<'a> {
    /// A mesh that is whole on this rank, its features found at sharp edges.
    #[must_use]
    pub fn new(points: ArrayView<'a>, cells: CellsView<'a>) -> Self {
        Self {
            points,
            cells,
            features: &FeatureSource::SharpEdges,
            generation: 0,
            global_vertices: None,
            global_cells: None,
            ghost_cells: None,
            grid_boxes: &[],
        }
    }

    /// A mesh of tetrahedra: its points (flat arrays are `x0 y0 z0 x1 y1 z1 ...`), and four
    /// vertices for each cell, in VTK's order.
    ///
    /// ```
    /// use tombolo_deform::mesh::MeshView;
    ///
    /// let points = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    /// let mesh = MeshView::tets(&points[..], &[0, 1, 2, 3][..]);
    /// assert_eq!((mesh.points.len(), mesh.cells.len()), (4, 1));
    /// mesh.to_mesh()?;
    ///
    /// let points = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    /// let cells = vec![[0_u32, 1, 2, 3]];
    /// assert_eq!(MeshView::tets(&points, &cells).to_mesh()?, mesh.to_mesh()?);
    /// # Ok::<(), tombolo_deform::mesh::MeshError>(())
    /// ```
    #[must_use]
    pub fn tets(points: impl Into<ArrayView<'a>>, vertices: impl Into<Indices<'a>>) -> Self {
        let cells =
            CellsView::Uniform { cell_type: CellType::Tetra, connectivity: vertices.into() };
        Self::new(points.into().as_coordinates(), cells)
    }

    /// A mesh of any mix of cells but polyhedra: its points (flat arrays are `x0 y0 z0 x1 y1 z1
    /// ...`), VTK's number of each cell's type, row starts into `connectivity` (one more than there
    /// are cells), and the vertices of the cells, in VTK's order.
    #[must_use]
    pub fn cells(
        points: impl Into<ArrayView<'a>>,
        types: &'a [u8],
        offsets: impl Into<Indices<'a>>,
        connectivity: impl Into<Indices<'a>>,
    ) -> Self {
        let cells =
            CellsView::Mixed { types, offsets: offsets.into(), connectivity: connectivity.into() };
        Self::new(points.into().as_coordinates(), cells)
    }

    /// Whether the boundary of the mesh is that of all its cells: none is a ghost or hidden, and it
    /// is not of several levels.
    #[must_use]
    pub fn is_plain(&self) -> bool {
        self.grid_boxes.is_empty()
            && self.ghost_cells.is_none_or(|bits| bits.iter().copied().all(ghosts::is_own))
    }

    /// The mesh with these features.
    #[must_use]
    pub fn with_features(self, features: &'a FeatureSource) -> Self {
        Self { features, ..self }
    }

    /// A copy that owns its arrays, checked.
    ///
    /// # Errors
    /// As [`CellsView::to_cells`] and [`Mesh::new`].
    pub fn to_mesh(&self) -> Result<Mesh, MeshError> {
        let cells = self.cells.copied(self.points.len())?;
        Mesh::new(self.points.to_vectors(), cells, self.features.clone())
    }
}

impl<'a> From<&'a Mesh> for MeshView<'a> {
    fn from(mesh: &'a Mesh) -> Self {
        MeshView::new(ArrayView::vectors(mesh.points()), CellsView::Owned(mesh.cells()))
            .with_features(mesh.features())
    }
}

/// Refuses an array of another length than it must have.
pub(super) fn check_length(name: &str, found: usize, expected: usize) -> Result<(), MeshError> {
    if found == expected {
        Ok(())
    } else {
        Err(MeshError::ArrayLength { name: name.into(), found, expected })
    }
}

/// The type of one of several cells of mixed types, and the range of the connectivity, which has
/// `length` entries, that names its vertices.
pub(super) fn mixed_cell(
    cell: usize,
    types: &[u8],
    offsets: Indices<'_>,
    length: usize,
) -> Result<(CellType, Range<usize>), MeshError> {
    let number = u64::from(types[cell]);
    let cell_type =
        CellType::from_vtk(types[cell]).ok_or(MeshError::UnknownCellType { cell, number })?;
    let (start, end) = (offsets.get(cell), offsets.get(cell + 1));
    if start > end || end > length as u64 {
        let (start, end) = (offsets.signed(cell), offsets.signed(cell + 1));
        return Err(MeshError::Offsets { cell, start, end, length });
    }
    Ok((cell_type, start as usize..end as usize))
}
