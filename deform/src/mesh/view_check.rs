//! What can be wrong with a borrowed mesh: found without a copy, and without a look at the values
//! where lengths tell it.

use std::ops::Range;

use super::view::{check_length, mixed_cell};
use super::{ArrayView, CellType, Cells, CellsView, FeatureSource, Indices, MeshError, MeshView};

/// Values looked at together.
const CHUNK: usize = 1024;

impl ArrayView<'_> {
    /// The first value that is NaN or infinite: its tuple, its component and what it is. One pass
    /// over the values.
    #[must_use]
    pub fn first_not_finite(&self) -> Option<(usize, usize, f64)> {
        let suspicious = |from: usize, to: usize| -> bool {
            // Times 0 every finite value is 0, and every other NaN.
            let sum =
                |component| (from..to).map(|tuple| self.get(tuple, component) * 0.0).sum::<f64>();
            (0..self.components()).any(|component| sum(component) != 0.0)
        };
        let in_chunk = |from: usize, to: usize| {
            let values = (from..to)
                .flat_map(|tuple| (0..self.components()).map(move |component| (tuple, component)));
            values
                .map(|(tuple, axis)| (tuple, axis, self.get(tuple, axis)))
                .find(|(_, _, value)| !value.is_finite())
        };
        if let Some(values) = self.contiguous() {
            // Neither a branch nor a sum in a certain order: processors check many numbers at once.
            let is_bad =
                |chunk: &[f64]| chunk.iter().fold(false, |bad, value| bad | !value.is_finite());
            let chunk = values.chunks(CHUNK).position(is_bad)?;
            let index = chunk * CHUNK
                + values[chunk * CHUNK..].iter().position(|value| !value.is_finite())?;
            return Some((index / self.components(), index % self.components(), values[index]));
        }
        let mut starts =
            (0..self.len()).step_by(CHUNK).map(|from| (from, (from + CHUNK).min(self.len())));
        starts.find(|&(from, to)| suspicious(from, to)).and_then(|(from, to)| in_chunk(from, to))
    }

    /// Refuses coordinates that are NaN or infinite. One pass over them.
    ///
    /// # Errors
    /// [`MeshError::NotFinite`] with the first.
    pub fn check_finite(&self) -> Result<(), MeshError> {
        match self.first_not_finite() {
            None => Ok(()),
            Some((vertex, axis, value)) => Err(MeshError::NotFinite {
                vertex,
                axis: ["x", "y", "z"].get(axis).unwrap_or(&"of no axis"),
                value,
            }),
        }
    }
}

impl CellsView<'_> {
    /// Compares the lengths of the arrays. Looks at two offsets and at nothing else.
    ///
    /// # Errors
    /// [`MeshError::CellType`], [`MeshError::VertexCount`], [`MeshError::ArrayLength`] or
    /// [`MeshError::Offsets`].
    pub fn check_lengths(&self) -> Result<(), MeshError> {
        match *self {
            CellsView::Owned(_) => Ok(()),
            CellsView::Uniform { cell_type, connectivity } => {
                check_whole(&[(cell_type, connectivity)])
            }
            CellsView::Types(types) => check_whole(types),
            CellsView::Mixed { types, offsets, connectivity } => {
                check_length("offsets", offsets.len(), types.len() + 1)?;
                let (length, count) = (connectivity.len(), types.len());
                let (start, end) = (offsets.get(0), offsets.get(count));
                if start > end || end > length as u64 {
                    // The cell whose offset lies outside.
                    let cell = if start > length as u64 { 0 } else { count.saturating_sub(1) };
                    let ends = [cell, (cell + 1).min(count)];
                    let [start, end] = ends.map(|index| offsets.signed(index));
                    return Err(MeshError::Offsets { cell, start, end, length });
                }
                Ok(())
            }
        }
    }

    /// Refuses cells that name vertices at or above `vertex_count`, or are none. One pass over the
    /// connectivity, without a copy.
    ///
    /// # Errors
    /// As [`check_lengths`](Self::check_lengths); [`MeshError::UnknownCellType`],
    /// [`MeshError::Offsets`], [`MeshError::VertexCount`] or [`MeshError::VertexNumber`] with the
    /// first cell that is wrong.
    pub fn validate(&self, vertex_count: usize) -> Result<(), MeshError> {
        self.check_lengths()?;
        match *self {
            CellsView::Owned(cells) => cells.validate(vertex_count),
            CellsView::Uniform { cell_type, connectivity } => {
                types_in_range(&[(cell_type, connectivity)], vertex_count)
            }
            CellsView::Types(types) => types_in_range(types, vertex_count),
            CellsView::Mixed { types, offsets, connectivity } => {
                for cell in 0..types.len() {
                    let (cell_type, range) = mixed_cell(cell, types, offsets, connectivity.len())?;
                    let found = range.len();
                    if cell_type.vertex_count() != Some(found) {
                        // What the types with any number of vertices allow is known there.
                        Cells::new()
                            .push(cell_type, &vec![0; found])
                            .map_err(|error| at(cell, error))?;
                    }
                    in_range(connectivity, range, vertex_count).map_err(|(_, vertex)| {
                        MeshError::VertexNumber { cell, vertex, vertex_count }
                    })?;
                }
                Ok(())
            }
        }
    }

    /// A number that tells, without a look at a value, that a solver hands over the same cells as
    /// in the step before: of where the connectivity lies in memory, and how.
    #[must_use]
    pub fn identity(&self) -> u64 {
        let mut hash = Hash::default();
        let mut add = |numbers: &[usize]| {
            numbers.iter().for_each(|&number| hash.add(number as u64));
        };
        match self {
            CellsView::Uniform { connectivity, .. } | CellsView::Mixed { connectivity, .. } => {
                add(&connectivity.location());
            }
            CellsView::Types(types) => {
                types.iter().for_each(|(_, connectivity)| add(&connectivity.location()));
            }
            CellsView::Owned(cells) => {
                add(&[cells.connectivity().as_ptr().addr(), cells.connectivity().len()]);
            }
        }
        hash.0
    }

    /// A number that other cells almost certainly do not have: of their types and vertices, in
    /// their order. One pass.
    #[must_use]
    pub fn fingerprint(&self) -> u64 {
        let mut hash = Hash::default();
        hash.add(self.len() as u64);
        match *self {
            CellsView::Owned(cells) => {
                cells.iter().for_each(|(cell_type, vertices)| {
                    hash.add(u64::from(cell_type.vtk()));
                    vertices.iter().for_each(|&vertex| hash.add(u64::from(vertex)));
                });
            }
            CellsView::Uniform { cell_type, connectivity } => {
                hash.add_cells(cell_type, connectivity);
            }
            CellsView::Types(types) => {
                for &(cell_type, connectivity) in types {
                    hash.add_cells(cell_type, connectivity);
                }
            }
            CellsView::Mixed { types, offsets, connectivity } => {
                for (cell, &cell_type) in types.iter().enumerate() {
                    hash.add(u64::from(cell_type));
                    (offsets.get(cell) as usize..offsets.get(cell + 1) as usize)
                        .for_each(|index| hash.add(connectivity.get(index)));
                }
            }
        }
        hash.0
    }
}

impl MeshView<'_> {
    /// Compares the lengths of all arrays. Looks at no value.
    ///
    /// # Errors
    /// [`MeshError::Components`], [`MeshError::ArrayLength`], [`MeshError::FeatureCount`]; as
    /// [`CellsView::check_lengths`].
    pub fn check_lengths(&self) -> Result<(), MeshError> {
        let (vertices, components) = (self.points.len(), self.points.components());
        if components > 3 {
            return Err(MeshError::Components { found: components });
        }
        self.cells.check_lengths()?;
        let cells = self.cells.len();
        if let Some(ghosts) = self.ghost_cells {
            check_length("ghost_cells", ghosts.len(), cells)?;
        }
        if let Some(numbers) = self.global_cells {
            check_length("global_cells", numbers.len(), cells)?;
        }
        if let Some(numbers) = self.global_vertices {
            check_length("global_vertices", numbers.len(), vertices)?;
        }
        let count = |found, expected, what| {
            if found == expected {
                Ok(())
            } else {
                Err(MeshError::FeatureCount { found, expected, what })
            }
        };
        match self.features {
            FeatureSource::SharpEdges => Ok(()),
            FeatureSource::Faces(tagged) => count(tagged.tags.len(), tagged.faces.len(), "faces"),
            FeatureSource::Vertices(tagged) => count(tagged.tags.len(), vertices, "vertices"),
        }
    }

    /// Refuses cells and tagged faces that name vertices beyond the last, and coordinates that are
    /// not finite. One pass over the mesh, without a copy.
    ///
    /// # Errors
    /// As [`check_lengths`](Self::check_lengths), [`CellsView::validate`] and
    /// [`ArrayView::check_finite`].
    pub fn validate(&self) -> Result<(), MeshError> {
        self.check_lengths()?;
        self.points.check_finite()?;
        self.cells.validate(self.points.len())?;
        self.features.validate(self.points.len())
    }
}

/// An error of a cell that was looked at by itself.
fn at(cell: usize, error: MeshError) -> MeshError {
    match error {
        MeshError::VertexCount { cell_type, found, .. } => {
            MeshError::VertexCount { cell, cell_type, found }
        }
        MeshError::CellType { found, expected, .. } => {
            MeshError::CellType { cell, found, expected }
        }
        other => other,
    }
}

/// The first of these numbers that is out of range, and where it stands.
fn in_range(numbers: Indices<'_>, range: Range<usize>, count: usize) -> Result<(), (usize, u64)> {
    let beyond =
        range.map(|index| (index, numbers.get(index))).find(|(_, number)| *number >= count as u64);
    beyond.map_or(Ok(()), |(index, _)| Err((index, numbers.signed(index))))
}

/// Refuses types of which the vertices make no whole number of cells.
fn check_whole(types: &[(CellType, Indices<'_>)]) -> Result<(), MeshError> {
    let mut cells = 0;
    for &(cell_type, connectivity) in types {
        let expected = "a type with a fixed vertex count";
        let size = cell_type.vertex_count().ok_or(MeshError::CellType {
            cell: cells,
            found: cell_type,
            expected,
        })?;
        cells += connectivity.len() / size;
        let found = connectivity.len() % size;
        if found > 0 {
            return Err(MeshError::VertexCount { cell: cells, cell_type, found });
        }
    }
    Ok(())
}

/// Refuses the first cell of these types that names a vertex beyond the last.
fn types_in_range(types: &[(CellType, Indices<'_>)], vertex_count: usize) -> Result<(), MeshError> {
    let mut first = 0;
    for &(cell_type, connectivity) in types {
        let size = cell_type.vertex_count().unwrap_or(1);
        in_range(connectivity, 0..connectivity.len(), vertex_count).map_err(
            |(index, vertex)| MeshError::VertexNumber {
                cell: first + index / size,
                vertex,
                vertex_count,
            },
        )?;
        first += connectivity.len() / size;
    }
    Ok(())
}

/// FNV-1a of whole numbers.
struct Hash(u64);

impl Default for Hash {
    fn default() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }
}

impl Hash {
    fn add_cells(&mut self, cell_type: CellType, connectivity: Indices<'_>) {
        let size = cell_type.vertex_count().unwrap_or(1);
        for index in 0..connectivity.len() {
            if index % size == 0 {
                self.add(u64::from(cell_type.vtk()));
            }
            self.add(connectivity.get(index));
        }
    }

    fn add(&mut self, number: u64) {
        self.0 = (self.0 ^ number).wrapping_mul(0x0100_0000_01b3);
        // The product's low bits know nothing of the number's high ones.
        self.0 ^= self.0 >> 29;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TETS: [[i32; 4]; 3] = [[0, 1, 2, 4], [1, 3, 2, 5], [2, 4, 5, 6]];
    const HEXAHEDRON: [u64; 8] = [0, 1, 3, 2, 4, 5, 7, 6];

    /// The tetrahedra and the hexahedron as the kernel owns them.
    fn owned() -> Cells {
        let mut cells = Cells::new();
        for tet in TETS {
            cells.push(CellType::Tetra, &tet.map(|vertex| vertex as u32)).unwrap();
        }
        cells.push(CellType::Hexahedron, &HEXAHEDRON.map(|vertex| vertex as u32)).unwrap();
        cells
    }

    /// The tetrahedra as an array in Fortran order: the first vertex of each, then the second, ...
    fn columns() -> Vec<i32> {
        (0..4).flat_map(|corner| TETS.map(|tet| tet[corner])).collect()
    }

    #[test]
    fn cells_of_several_types_are_those_in_every_layout() {
        let owned = owned();
        let columns = columns();
        let columns = Indices::from(&columns).table(0, [3, 4], [1, 3]).unwrap();
        let hexahedron = (CellType::Hexahedron, Indices::from(&HEXAHEDRON[..]));
        for tets in [Indices::from(&TETS[..]), columns] {
            let types = [(CellType::Tetra, tets), hexahedron, (CellType::Pyramid, Indices::EMPTY)];
            let view = CellsView::Types(&types);
            assert_eq!(view.len(), 4);
            assert_eq!(view.to_cells().unwrap(), owned);
            assert_eq!(view.fingerprint(), CellsView::Owned(&owned).fingerprint());
            view.validate(8).unwrap();
            let found = view.validate(7).unwrap_err();
            let expected = MeshError::VertexNumber { cell: 3, vertex: 7, vertex_count: 7 };
            assert_eq!(found, expected);
            let uniform = CellsView::Uniform { cell_type: CellType::Tetra, connectivity: tets };
            let alone = TETS.as_flattened().iter().map(|&vertex| vertex as u32).collect();
            let alone = Cells::uniform(CellType::Tetra, alone).unwrap();
            assert_eq!(uniform.to_cells().unwrap(), alone);
        }
    }

    #[test]
    fn what_makes_no_whole_cells_of_a_type_is_refused() {
        let tets = (CellType::Tetra, Indices::from(&TETS[..]));
        let wrong = (CellType::Hexahedron, Indices::from(&HEXAHEDRON[..7]));
        let types = [tets, wrong];
        let expected =
            MeshError::VertexCount { cell: 3, cell_type: CellType::Hexahedron, found: 7 };
        assert_eq!(CellsView::Types(&types).check_lengths().unwrap_err(), expected);
        assert_eq!(CellsView::Types(&types).to_cells().unwrap_err(), expected);
        let types = [tets, (CellType::Polygon, Indices::EMPTY)];
        let found = CellsView::Types(&types).check_lengths().unwrap_err();
        assert!(matches!(found, MeshError::CellType { cell: 3, .. }), "{found}");
    }

    #[test]
    fn an_offset_below_0_is_told_as_it_was_given_with_its_cell() {
        let (types, connectivity) = ([10; 3], [0_u32; 12]);
        for (offsets, cell) in [([-1, 4, 8, 12], 0), ([0, 4, 8, -5], 2), ([0, -7, 8, 12], 0)] {
            let view = CellsView::Mixed {
                types: &types,
                offsets: Indices::from(&offsets[..]),
                connectivity: Indices::from(&connectivity[..]),
            };
            let error = view.validate(4).unwrap_err();
            assert!(matches!(error, MeshError::Offsets { cell: found, .. } if found == cell));
            let least = offsets.iter().min().map(i64::to_string).unwrap_or_default();
            assert!(error.to_string().contains(&least), "{error}");
        }
    }

    #[test]
    fn a_vertex_below_0_is_told_as_it_was_given() {
        let points = [[0.0; 3]; 4];
        let cells = [[0, 1, 2, -1]];
        let error = MeshView::tets(&points[..], &cells[..]).to_mesh().unwrap_err().to_string();
        assert!(error.contains("-1") && error.contains('4'), "{error}");
    }

    #[test]
    fn the_same_numbers_in_another_layout_are_other_cells() {
        let numbers = [0_u32; 24];
        let whole = Indices::from(&numbers[..]);
        let of = |connectivity: Indices<'_>| {
            CellsView::Uniform { cell_type: CellType::Tetra, connectivity }.identity()
        };
        let (near, far) = (whole.table(0, [3, 4], [4, 1]), whole.table(0, [3, 4], [8, 1]));
        let (near, far) = (near.unwrap(), far.unwrap());
        assert_eq!(of(near), of(whole.table(0, [3, 4], [4, 1]).unwrap()));
        assert_ne!(of(near), of(far));
        let types = [(CellType::Tetra, near), (CellType::Quad, far)];
        let others = [(CellType::Tetra, near), (CellType::Quad, near)];
        assert_ne!(CellsView::Types(&types).identity(), CellsView::Types(&others).identity());
    }
}
