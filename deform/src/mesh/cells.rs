//! Cells of any linear type, owned.

use std::ops::Range;

use super::cell_type::Types;
use super::{CellType, MeshError};
use crate::topology::{indices, marked, marks};

/// Cells of any mix of linear types, as compressed rows of vertex numbers.
///
/// A polyhedron's row lists its distinct vertices; its faces are kept beside it.
///
/// The cells of a [`Mesh`](super::Mesh) are right-handed: types that were given left-handed, as in
/// a mirrored mesh, are turned where the mesh is made. [`Cells::as_given`] has them as they came.
#[derive(Debug, Clone)]
pub struct Cells {
    types: Vec<CellType>,
    starts: Starts,
    connectivity: Vec<u32>,
    polyhedra: Vec<PolyhedronFaces>,
    /// The types whose cells were turned; `None` before any points have told.
    turned: Option<Types>,
}

/// Where the vertices of each cell begin.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Starts {
    /// All cells have as many.
    Equal(usize),
    /// Of cells of several sizes, with the end of the last one.
    Listed(Vec<usize>),
}

impl Default for Starts {
    fn default() -> Self {
        Self::Equal(0)
    }
}

impl Starts {
    #[inline]
    fn of(&self, cell: usize) -> usize {
        match self {
            Self::Equal(size) => size * cell,
            Self::Listed(starts) => starts[cell],
        }
    }

    #[inline]
    fn range(&self, cell: usize) -> Range<usize> {
        self.of(cell)..self.of(cell + 1)
    }

    /// Takes one more cell, after `count` of them.
    fn push(&mut self, count: usize, size: usize) {
        match self {
            Self::Equal(known) if count == 0 => *known = size,
            Self::Equal(known) if *known == size => {}
            Self::Equal(known) => {
                let end = *known * count;
                let before = (0..=count).map(|cell| *known * cell);
                *self = Self::Listed(before.chain([end + size]).collect());
            }
            Self::Listed(starts) => {
                let end = starts.last().copied().unwrap_or(0);
                starts.push(end + size);
            }
        }
    }
}

impl PartialEq for Cells {
    fn eq(&self, other: &Self) -> bool {
        let types = |cells: &Self| cells.turned.unwrap_or_default();
        self.types == other.types
            && self.starts == other.starts
            && self.connectivity == other.connectivity
            && self.polyhedra == other.polyhedra
            && types(self) == types(other)
    }
}

impl Eq for Cells {}

/// The faces of one polyhedral cell.
#[derive(Debug, Clone, PartialEq, Eq)]
struct PolyhedronFaces {
    cell: usize,
    faces: Vec<Vec<u32>>,
}

impl Default for Cells {
    /// No cells.
    fn default() -> Self {
        Self::new()
    }
}

impl Cells {
    /// No cells.
    #[must_use]
    pub fn new() -> Self {
        Self {
            types: Vec::new(),
            starts: Starts::default(),
            connectivity: Vec::new(),
            polyhedra: Vec::new(),
            turned: None,
        }
    }

    /// Cells that are all of one type with a fixed number of vertices.
    ///
    /// # Errors
    /// [`MeshError::CellType`] for a type whose vertex count varies; [`MeshError::VertexCount`]
    /// where `connectivity` is not a whole number of cells.
    pub fn uniform(cell_type: CellType, connectivity: Vec<u32>) -> Result<Self, MeshError> {
        let size = cell_type.vertex_count().ok_or(MeshError::CellType {
            cell: 0,
            found: cell_type,
            expected: "a type with a fixed vertex count",
        })?;
        if !connectivity.len().is_multiple_of(size) {
            return Err(MeshError::VertexCount {
                cell: connectivity.len() / size,
                cell_type,
                found: connectivity.len() % size,
            });
        }
        let count = connectivity.len() / size;
        Ok(Self {
            types: vec![cell_type; count],
            starts: if count == 0 { Starts::default() } else { Starts::Equal(size) },
            connectivity,
            polyhedra: Vec::new(),
            turned: None,
        })
    }

    /// Appends one cell.
    ///
    /// # Errors
    /// [`MeshError::VertexCount`] where the type asks for another number of vertices;
    /// [`MeshError::CellType`] for a polyhedron (use [`Cells::push_polyhedron`]).
    pub fn push(&mut self, cell_type: CellType, vertices: &[u32]) -> Result<(), MeshError> {
        let fits = match cell_type {
            CellType::Polyhedron => {
                return Err(MeshError::CellType {
                    cell: self.len(),
                    found: cell_type,
                    expected: "a cell described by its vertices alone",
                });
            }
            CellType::PolyVertex => !vertices.is_empty(),
            CellType::PolyLine => vertices.len() >= 2,
            CellType::TriangleStrip | CellType::Polygon => vertices.len() >= 3,
            fixed => fixed.vertex_count() == Some(vertices.len()),
        };
        if !fits {
            return Err(MeshError::VertexCount {
                cell: self.len(),
                cell_type,
                found: vertices.len(),
            });
        }
        self.append(cell_type, vertices.iter().copied());
        Ok(())
    }

    /// Appends a polyhedron given by its faces, each counter-clockwise seen from outside.
    ///
    /// # Errors
    /// [`MeshError::VertexCount`] where there are fewer than four faces or a face has fewer than
    /// three vertices.
    pub fn push_polyhedron(&mut self, faces: &[Vec<u32>]) -> Result<(), MeshError> {
        let smallest = faces.iter().map(Vec::len).min().unwrap_or(0);
        if faces.len() < 4 || smallest < 3 {
            return Err(MeshError::VertexCount {
                cell: self.len(),
                cell_type: CellType::Polyhedron,
                found: faces.iter().map(Vec::len).sum(),
            });
        }
        let mut vertices: Vec<u32> = faces.concat();
        vertices.sort_unstable();
        vertices.dedup();
        self.polyhedra.push(PolyhedronFaces { cell: self.len(), faces: faces.to_vec() });
        self.append(CellType::Polyhedron, vertices);
        Ok(())
    }

    fn append(&mut self, cell_type: CellType, vertices: impl IntoIterator<Item = u32>) {
        let before = self.connectivity.len();
        self.connectivity.extend(vertices);
        self.starts.push(self.types.len(), self.connectivity.len() - before);
        self.types.push(cell_type);
    }

    /// How many cells there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.types.len()
    }

    /// Whether there is no cell.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.types.is_empty()
    }

    /// The type of a cell.
    ///
    /// # Panics
    /// Where `cell` is not below [`Cells::len`].
    #[must_use]
    #[inline]
    pub fn cell_type(&self, cell: usize) -> CellType {
        self.types[cell]
    }

    /// The types of all cells.
    #[must_use]
    pub fn types(&self) -> &[CellType] {
        &self.types
    }

    /// The vertices of a cell, in VTK's order. The normal of a wedge's first triangle points at the
    /// second in a mesh, which is one of the two orders that VTK's programs and pages have.
    ///
    /// # Panics
    /// Where `cell` is not below [`Cells::len`].
    #[must_use]
    #[inline]
    pub fn vertices(&self, cell: usize) -> &[u32] {
        &self.connectivity[self.starts.range(cell)]
    }

    /// Row starts into [`Cells::connectivity`], `len() + 1` of them. Where all cells have as many
    /// vertices they are kept nowhere.
    pub fn offsets(&self) -> impl Iterator<Item = usize> + Clone {
        (0..=self.len()).map(|cell| self.starts.of(cell))
    }

    /// The vertices of all cells, row after row.
    #[must_use]
    pub fn connectivity(&self) -> &[u32] {
        &self.connectivity
    }

    /// Bytes of memory, but for the faces of polyhedra.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let starts = match &self.starts {
            Starts::Equal(_) => 0,
            Starts::Listed(starts) => starts.len(),
        };
        self.types.len() + size_of::<usize>() * starts + size_of::<u32>() * self.connectivity.len()
    }

    /// Each cell's type and vertices, in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = (CellType, &[u32])> + Clone {
        (0..self.len()).map(|cell| (self.types[cell], self.vertices(cell)))
    }

    /// The one type all cells have, if there is one.
    #[must_use]
    pub fn uniform_type(&self) -> Option<CellType> {
        let first = *self.types.first()?;
        self.types.iter().all(|&other| other == first).then_some(first)
    }

    /// The highest dimension of any cell; 0 where there is none.
    #[must_use]
    pub fn dimension(&self) -> usize {
        self.types.iter().map(|cell| cell.dimension()).max().unwrap_or(0)
    }

    /// Calls `visit` with each face of a volume cell: global vertex numbers, counter-clockwise seen
    /// from outside.
    pub fn for_each_face(&self, cell: usize, mut visit: impl FnMut(&[u32])) {
        if self.types[cell] == CellType::Polyhedron {
            for face in self.polyhedron_faces(cell) {
                visit(face);
            }
            return;
        }
        let vertices = self.vertices(cell);
        let mut face_vertices = [0u32; 6];
        for face in self.types[cell].faces() {
            for (slot, &local) in face_vertices.iter_mut().zip(face.iter()) {
                *slot = vertices[local];
            }
            visit(&face_vertices[..face.len()]);
        }
    }

    /// Calls `visit` with each polygon of a cell of dimension 2: global vertex numbers in order
    /// around, all turned as the cell is. A triangle strip has one for each of its triangles, any
    /// other such cell is one polygon.
    ///
    /// ```
    /// use tombolo_deform::mesh::{CellType, Cells};
    ///
    /// let mut cells = Cells::new();
    /// cells.push(CellType::TriangleStrip, &[4, 5, 6, 7])?;
    /// let mut triangles = Vec::new();
    /// cells.for_each_polygon(0, |polygon| triangles.push(polygon.to_vec()));
    /// assert_eq!(triangles, [[4, 5, 6], [6, 5, 7]]);
    /// # Ok::<(), tombolo_deform::mesh::MeshError>(())
    /// ```
    pub fn for_each_polygon(&self, cell: usize, mut visit: impl FnMut(&[u32])) {
        match (self.types[cell], self.vertices(cell)) {
            (CellType::Triangle | CellType::Quad | CellType::Polygon, vertices) => visit(vertices),
            (CellType::Pixel, &[a, b, c, d]) => visit(&[a, b, d, c]),
            (CellType::TriangleStrip, vertices) => {
                for (start, triangle) in vertices.windows(3).enumerate() {
                    match *triangle {
                        [a, b, c] if start % 2 == 1 => visit(&[b, a, c]),
                        _ => visit(triangle),
                    }
                }
            }
            _ => {}
        }
    }

    /// The faces of a polyhedron; empty for any other cell.
    #[must_use]
    pub fn polyhedron_faces(&self, cell: usize) -> &[Vec<u32>] {
        match self.polyhedra.binary_search_by_key(&cell, |entry| entry.cell) {
            Ok(found) => &self.polyhedra[found].faces,
            Err(_) => &[],
        }
    }

    /// The cells of `order`, one after the other, with other numbers for their vertices.
    pub(super) fn renumbered(&self, order: &[u32], number: &[u32]) -> Self {
        let mut cells = Self {
            types: Vec::with_capacity(order.len()),
            starts: Starts::default(),
            connectivity: Vec::with_capacity(self.connectivity.len()),
            polyhedra: Vec::new(),
            turned: self.turned,
        };
        let renumbered =
            |vertices: &[u32]| vertices.iter().map(|&vertex| number[vertex as usize]).collect();
        for (index, &cell) in order.iter().enumerate() {
            let cell = cell as usize;
            let vertices = self.vertices(cell).iter().map(|&vertex| number[vertex as usize]);
            cells.append(self.types[cell], vertices);
            if self.types[cell] == CellType::Polyhedron {
                let faces =
                    self.polyhedron_faces(cell).iter().map(|face| renumbered(face)).collect();
                cells.polyhedra.push(PolyhedronFaces { cell: index, faces });
            }
        }
        cells
    }

    /// The cells with the numbers `cells`, in that order, turned as these are.
    ///
    /// # Panics
    /// Where a number is not below [`Cells::len`].
    #[must_use]
    pub fn subset(&self, cells: impl IntoIterator<Item = usize>) -> Self {
        let mut subset = Self { turned: self.turned, ..Self::new() };
        for cell in cells {
            if self.types[cell] == CellType::Polyhedron {
                let faces = self.polyhedron_faces(cell).to_vec();
                subset.polyhedra.push(PolyhedronFaces { cell: subset.len(), faces });
            }
            subset.append(self.types[cell], self.vertices(cell).iter().copied());
        }
        subset
    }

    /// The cells with the number `numbers[vertex]` for each vertex.
    ///
    /// # Panics
    /// Where a cell names a vertex beyond `numbers`.
    #[must_use]
    pub fn with_vertices(&self, numbers: &[u32]) -> Self {
        let mut cells = self.clone();
        let all = cells.polyhedra.iter_mut().flat_map(|polyhedron| &mut polyhedron.faces).flatten();
        for vertex in cells.connectivity.iter_mut().chain(all) {
            *vertex = numbers[*vertex as usize];
        }
        cells
    }

    /// The cells with only those of `points` points that they have, and which those are, rising.
    ///
    /// ```
    /// use tombolo_deform::mesh::{CellType, Cells};
    ///
    /// let mut cells = Cells::new();
    /// cells.push(CellType::Triangle, &[4, 2, 7])?;
    /// let (compact, points) = cells.compact(9);
    /// assert_eq!((compact.vertices(0), &*points), (&[1, 0, 2][..], &[2, 4, 7][..]));
    /// # Ok::<(), tombolo_deform::mesh::MeshError>(())
    /// ```
    ///
    /// # Panics
    /// Where a cell names a point beyond those.
    #[must_use]
    pub fn compact(&self, points: usize) -> (Self, Vec<u32>) {
        let used = marked(&marks(points, self.connectivity()));
        (self.with_vertices(&indices(points, &used)), used)
    }

    /// The types whose cells were turned; `None` before any points have told.
    pub(super) fn turned_types(&self) -> Option<Types> {
        self.turned
    }

    /// The cells, those of the types `turned` taken as turned.
    pub(super) fn with_turned_types(self, turned: Option<Types>) -> Self {
        Self { turned, ..self }
    }

    /// The vertices of a cell, to be put in another order.
    pub(super) fn vertices_mut(&mut self, cell: usize) -> &mut [u32] {
        &mut self.connectivity[self.starts.range(cell)]
    }

    /// The faces of all polyhedra, whose vertices are to be put in another order.
    pub(super) fn polyhedron_faces_mut(&mut self) -> impl Iterator<Item = &mut Vec<u32>> {
        self.polyhedra.iter_mut().flat_map(|polyhedron| &mut polyhedron.faces)
    }

    /// Refuses a vertex number at or above `vertex_count`.
    ///
    /// # Errors
    /// [`MeshError::VertexNumber`] with the first such cell.
    pub fn validate(&self, vertex_count: usize) -> Result<(), MeshError> {
        for cell in 0..self.len() {
            for &vertex in self.vertices(cell) {
                if vertex as usize >= vertex_count {
                    return Err(MeshError::VertexNumber {
                        cell,
                        vertex: u64::from(vertex),
                        vertex_count,
                    });
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn starts_are_listed_where_cells_differ() {
        let tets = Cells::uniform(CellType::Tetra, (0..12).collect()).unwrap();
        let mut cells = Cells::new();
        assert_eq!(cells.offsets().collect::<Vec<_>>(), [0]);
        for cell in 0..3 {
            cells.push(CellType::Tetra, tets.vertices(cell)).unwrap();
        }
        assert_eq!(cells.offsets().collect::<Vec<_>>(), [0, 4, 8, 12]);
        assert_eq!((&cells, cells.bytes()), (&tets, 3 + 12 * 4));
        cells.push(CellType::Pyramid, &[7, 6, 5, 4, 3]).unwrap();
        cells.push(CellType::Tetra, &[0, 1, 2, 4]).unwrap();
        assert_eq!(cells.offsets().collect::<Vec<_>>(), [0, 4, 8, 12, 17, 21]);
        assert_eq!(cells.vertices(3), [7, 6, 5, 4, 3]);
        assert_eq!(cells.vertices(4), [0, 1, 2, 4]);
        assert_eq!(cells.subset([0, 1, 2]), tets);
        assert_eq!(cells.subset(0..5), cells);
        assert_ne!(cells.subset([1, 3]), cells.subset([3, 1]));
    }
}
