//! What can be wrong with a borrowed mesh: found without a copy, and without a look at the values
//! where lengths tell it.

use std::ops::Range;

use super::view::{check_length, mixed_cell};
use super::{ArrayView, Cells, CellsView, FeatureSource, Indices, MeshError, MeshView};

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
                let expected = "a type with a fixed vertex count";
                let size = cell_type.vertex_count().ok_or(MeshError::CellType {
                    cell: 0,
                    found: cell_type,
                    expected,
                })?;
                let (cell, found) = (connectivity.len() / size, connectivity.len() % size);
                if found > 0 {
                    Err(MeshError::VertexCount { cell, cell_type, found })
                } else {
                    Ok(())
                }
            }
            CellsView::Mixed { types, offsets, connectivity } => {
                check_length("offsets", offsets.len(), types.len() + 1)?;
                let (start, end, length) =
                    (offsets.get(0), offsets.get(types.len()), connectivity.len());
                if start > end || end > length as u64 {
                    return Err(MeshError::Offsets {
                        cell: types.len().saturating_sub(1),
                        start,
                        end,
                        length,
                    });
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
                let size = cell_type.vertex_count().unwrap_or(1);
                in_range(connectivity, 0..connectivity.len(), vertex_count).map_err(
                    |(index, vertex)| MeshError::VertexNumber {
                        cell: index / size,
                        vertex,
                        vertex_count,
                    },
                )
            }
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
                let size = cell_type.vertex_count().unwrap_or(1);
                for index in 0..connectivity.len() {
                    if index % size == 0 {
                        hash.add(u64::from(cell_type.vtk()));
                    }
                    hash.add(connectivity.get(index));
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

/// FNV-1a of whole numbers.
struct Hash(u64);

impl Default for Hash {
    fn default() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }
}

impl Hash {
    fn add(&mut self, number: u64) {
        self.0 = (self.0 ^ number).wrapping_mul(0x0100_0000_01b3);
        // The product's low bits know nothing of the number's high ones.
        self.0 ^= self.0 >> 29;
    }
}
