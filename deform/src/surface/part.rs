//! The surface of a mesh of which only a part is at hand: its faces, to be put together elsewhere with those of the other parts.

use super::extraction::{check_parts, may_run_either_way, turn_alike};
use super::faces::{self, FaceBuffer, TagLookup, most_frequent};
use super::{FeatureSettings, Surface, SurfaceError};
use crate::mesh::{CellType, Cells, FeatureSource, Vector};

/// The faces of a part of a mesh that belong to one of its cells only: its boundary, and where it was cut off from other parts.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct BoundaryFaces {
    /// The faces by the vertex numbers of the part, counter-clockwise seen from outside the volume.
    pub faces: Cells,
    /// The cell of each face, rising.
    pub cells: Vec<u32>,
    /// The place of each face among those of its cell.
    pub places: Vec<u32>,
    /// Whether faces may run one way or the other round, as those of polyhedra and of cells of dimension 2 may.
    pub may_run_either_way: bool,
}

/// What a mesh says of the features of faces.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct FaceTags {
    /// The number of each face's feature; `None` where nothing is said.
    pub tags: Vec<Option<i64>>,
    /// The names of features, by their number.
    pub names: Vec<(i64, String)>,
}

impl BoundaryFaces {
    /// The faces of the cells of this dimension (3, or 2 for a mesh that is its own surface) that belong to one cell only. Cells
    /// marked in `ghosts` do not count.
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
    /// [`SurfaceError::SharedFace`], [`SurfaceError::DuplicateCells`]; [`SurfaceError::Parts`] for a cell that names a vertex that
    /// is not there.
    pub fn find(
        points: &[Vector],
        cells: &Cells,
        dimension: usize,
        ghosts: Option<&[bool]>,
    ) -> Result<Self, SurfaceError> {
        cells.validate(points.len())?;
        let cells = &*cells.right_handed(points);
        let found = faces::boundary_faces(cells, points.len(), dimension, ghosts)?;
        let mut boundary = Self {
            faces: Cells::new(),
            cells: Vec::with_capacity(found.len()),
            places: Vec::with_capacity(found.len()),
            may_run_either_way: may_run_either_way(dimension, cells),
        };
        let mut buffer = FaceBuffer::default();
        for same_cell in found.chunk_by(|a, b| a.cell == b.cell) {
            let cell = same_cell[0].cell;
            let mut wanted = same_cell.iter().peekable();
            buffer.for_each(cells, cell as usize, dimension, |place, vertices| {
                if wanted.next_if(|face| face.face == place).is_none() {
                    return;
                }
                let cell_type = match vertices.len() {
                    3 => CellType::Triangle,
                    4 => CellType::Quad,
                    _ => CellType::Polygon,
                };
                // A face has three vertices at least, so that it is always taken.
                if boundary.faces.push(cell_type, vertices).is_ok() {
                    boundary.cells.push(cell);
                    boundary.places.push(place);
                }
            });
        }
        Ok(boundary)
    }

    /// Those of the faces whose cell is `wanted`.
    #[must_use]
    pub fn of_cells(&self, wanted: impl Fn(usize) -> bool) -> Self {
        let kept: Vec<usize> =
            (0..self.cells.len()).filter(|&face| wanted(self.cells[face] as usize)).collect();
        Self {
            faces: self.faces.subset(kept.iter().copied()),
            cells: kept.iter().map(|&face| self.cells[face]).collect(),
            places: kept.iter().map(|&face| self.places[face]).collect(),
            may_run_either_way: self.may_run_either_way,
        }
    }
}

/// What the source of a mesh's features says of faces given by the vertex numbers of the mesh; `None` where features are to be
/// found at sharp edges.
#[must_use]
pub fn face_tags(source: &FeatureSource, faces: &Cells) -> Option<FaceTags> {
    match source {
        FeatureSource::SharpEdges => None,
        FeatureSource::Faces(tagged) => {
            let lookup = TagLookup::new(&tagged.faces, &tagged.tags);
            let tags = faces.iter().map(|(_, vertices)| lookup.get(vertices)).collect();
            Some(FaceTags { tags, names: tagged.names.clone() })
        }
        FeatureSource::Vertices(numbers) => {
            let tags = faces.iter().map(|(_, vertices)| majority(numbers, vertices)).collect();
            Some(FaceTags { tags, names: Vec::new() })
        }
    }
}

/// The number that most of the vertices carry, the lowest on a tie.
fn majority(tags: &[i64], vertices: &[u32]) -> Option<i64> {
    most_frequent(
        vertices.iter().filter_map(|&vertex| tags.get(vertex as usize).copied()).collect(),
    )
}

impl Surface {
    /// A surface from the boundary faces of the parts of a mesh. `vertices` are the numbers in the whole mesh of the `points`,
    /// rising; `faces` are by surface vertex numbers, `owner_cells` the numbers of their cells in the whole mesh; without `tags`
    /// features are found at sharp edges; `may_run_either_way` says that of the faces of any part. Faces in the order of their cells make the surface that [`Surface::extract`] makes of
    /// the whole mesh.
    ///
    /// # Errors
    /// [`SurfaceError::Parts`], [`SurfaceError::VertexOrder`], [`SurfaceError::Unreferenced`] for what does not fit together,
    /// [`SurfaceError::NoBoundary`] without faces; [`SurfaceError::SharpAngle`].
    pub fn assemble(
        points: Vec<Vector>,
        vertices: Vec<u32>,
        mut faces: Cells,
        owner_cells: Vec<u32>,
        may_run_either_way: bool,
        tags: Option<&FaceTags>,
        settings: &FeatureSettings,
    ) -> Result<Self, SurfaceError> {
        settings.validate()?;
        check_parts(&points, &vertices, &faces)?;
        for found in
            [Some(owner_cells.len()), tags.map(|tags| tags.tags.len())].into_iter().flatten()
        {
            if found != faces.len() {
                let what = "faces";
                return Err(crate::mesh::MeshError::FeatureCount {
                    found,
                    expected: faces.len(),
                    what,
                }
                .into());
            }
        }
        if may_run_either_way {
            turn_alike(&points, &mut faces);
        }
        Ok(Self::put_together(points, vertices, faces, owner_cells, tags, settings))
    }
}
