//! Meshes: owned ([`Mesh`]) and borrowed from a solver ([`MeshView`]), of any mix of linear VTK
//! cells.
//!
//! The kernel works on owned meshes in double precision. A solver's arrays are borrowed as they lie
//! in its memory, strided, separate or interleaved, of any common number type ([`ArrayView`],
//! [`CellsView`]); nothing is copied until something needs it.

use std::sync::Arc;

mod array;
mod cell_faces;
pub(crate) mod cell_geometry;
mod cell_type;
mod cells;
mod domain;
mod feature;
pub mod ghosts;
mod handedness;
mod indices;
mod ordered;
mod other_order;
mod shared;
mod view;
mod view_check;

pub use crate::vector::Vector;
pub use array::{ArrayView, NumberType, Values};
pub(crate) use cell_faces::{CellFace, face_vertices, sorted};
pub use cell_faces::{FaceBuffer, lowest_four};
pub use cell_type::CellType;
pub use cells::Cells;
pub use domain::Domain;
pub use feature::{FeatureSource, TaggedFaces, TaggedVertices};
pub(crate) use handedness::is_left_handed;
pub use indices::Indices;
#[cfg(test)]
pub(crate) use ordered::shuffled;
pub(crate) use ordered::{Numbering, Ordered};
pub use other_order::OtherOrder;
pub use shared::SharedVertices;
pub use view::{CellsView, MeshView};

/// An unstructured mesh that owns its arrays. To clone a mesh copies none of them.
///
/// Invariants, kept by [`Mesh::new`]: every coordinate is finite, every vertex number is in range,
/// and of each type of volume cell no more are left-handed than right-handed. A mesh whose cells
/// are left-handed throughout, because it was mirrored or its vertices stand in another order, is
/// read as well: its cells are turned here, once, and [`Cells::as_given`] has them as they came.
#[derive(Debug, Clone, PartialEq)]
pub struct Mesh {
    // Shared with clones, and the cells with meshes of other coordinates.
    points: Arc<[Vector]>,
    cells: Arc<Cells>,
    features: Arc<FeatureSource>,
}

impl Mesh {
    /// A mesh from its points (length units of the caller), its cells and where its features come
    /// from.
    ///
    /// # Errors
    /// [`MeshError::NotFinite`] for a NaN or infinite coordinate, [`MeshError::VertexNumber`] for a
    /// vertex that does not exist, [`MeshError::FeatureCount`] where the feature tags do not match
    /// the mesh, [`MeshError::OtherOrder`] where most cells of a type have their vertices in an
    /// order that is not VTK's and can be told.
    pub fn new(
        points: Vec<Vector>,
        cells: Cells,
        features: FeatureSource,
    ) -> Result<Self, MeshError> {
        check_finite(&points)?;
        cells.validate(points.len())?;
        features.validate(points.len())?;
        let cells = cells.of_mesh(&points)?;
        Ok(Self { points: points.into(), cells: Arc::new(cells), features: Arc::new(features) })
    }

    /// The coordinates of each vertex.
    #[must_use]
    pub fn points(&self) -> &[Vector] {
        &self.points
    }

    /// The cells, right-handed.
    #[must_use]
    pub fn cells(&self) -> &Cells {
        &self.cells
    }

    /// Where the features come from.
    #[must_use]
    pub fn features(&self) -> &FeatureSource {
        &self.features
    }

    /// The coordinates of each vertex, to be kept without a copy.
    pub(crate) fn shared_points(&self) -> &Arc<[Vector]> {
        &self.points
    }

    /// The cells, to be kept without a copy.
    #[must_use]
    pub fn shared_cells(&self) -> &Arc<Cells> {
        &self.cells
    }

    /// The mesh with its vertices at other coordinates, without a copy of its cells.
    ///
    /// # Errors
    /// [`MeshError::PointCount`] where there are more or fewer points than before;
    /// [`MeshError::NotFinite`].
    pub fn with_points(&self, points: Vec<Vector>) -> Result<Self, MeshError> {
        if points.len() != self.points.len() {
            return Err(MeshError::PointCount { found: points.len(), expected: self.points.len() });
        }
        check_finite(&points)?;
        Ok(Self {
            points: points.into(),
            cells: Arc::clone(&self.cells),
            features: Arc::clone(&self.features),
        })
    }
}

pub(crate) fn check_finite(points: &[Vector]) -> Result<(), MeshError> {
    for (vertex, point) in points.iter().enumerate() {
        for (axis, value) in point.iter().enumerate() {
            if !value.is_finite() {
                return Err(MeshError::NotFinite {
                    vertex,
                    axis: ["x", "y", "z"][axis],
                    value: *value,
                });
            }
        }
    }
    Ok(())
}

/// Numbers one after the other, as many as one reads.
fn listed<T: ToString>(numbers: &[T]) -> String {
    const SHOWN: usize = 12;
    let shown = numbers.iter().take(SHOWN).map(T::to_string).collect::<Vec<_>>().join(", ");
    match numbers.len() {
        0 => "none".into(),
        count if count > SHOWN => format!("{shown} and {} more", count - SHOWN),
        _ => shown,
    }
}

/// Why a mesh was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshError {
    /// A coordinate is NaN or infinite.
    #[error("vertex {vertex}: coordinate {axis} is {value}; every coordinate must be finite")]
    NotFinite {
        /// The vertex.
        vertex: usize,
        /// The axis: x, y or z.
        axis: &'static str,
        /// The value of the coordinate.
        value: f64,
    },
    /// A cell names a vertex that does not exist.
    #[error(
        "cell {cell}: vertex {} does not exist; the mesh has {vertex_count} vertices, numbered from 0",
        vertex.cast_signed()
    )]
    VertexNumber {
        /// The cell.
        cell: usize,
        /// The vertex it names; negative numbers are told as such.
        vertex: u64,
        /// How many there are.
        vertex_count: usize,
    },
    /// A cell has a number of vertices that its type does not have.
    #[error("cell {cell}: {found} vertices do not make a {cell_type}{}", expected_count(*cell_type))]
    VertexCount {
        /// The cell.
        cell: usize,
        /// Its type.
        cell_type: CellType,
        /// How many vertices were given.
        found: usize,
    },
    /// A cell is of a type that cannot be used here.
    #[error("cell {cell}: {found} found where {expected} is needed")]
    CellType {
        /// The cell.
        cell: usize,
        /// Its type.
        found: CellType,
        /// The types that can be used.
        expected: &'static str,
    },
    /// The vertices of cells stand in another order than VTK's.
    #[error("{0}")]
    OtherOrder(Box<OtherOrder>),
    /// A cell type number that is not a linear VTK cell.
    #[error(
        "cell {cell}: VTK cell type {number} is not a linear cell; the linear ones are 1 to 16 and 42"
    )]
    UnknownCellType {
        /// The cell.
        cell: usize,
        /// The number.
        number: u64,
    },
    /// Offsets that are not those of compressed rows.
    #[error(
        "cell {cell}: its connectivity would run from {} to {} in an array of {length}",
        start.cast_signed(),
        end.cast_signed()
    )]
    Offsets {
        /// The cell.
        cell: usize,
        /// Where it starts; negative numbers are told as such, here and at the end.
        start: u64,
        /// Where it ends.
        end: u64,
        /// The length of the connectivity.
        length: usize,
    },
    /// Coordinates of more than three components.
    #[error("the coordinates have {found} components; expected 1 to 3")]
    Components {
        /// How many there are.
        found: usize,
    },
    /// Coordinates for another number of vertices.
    #[error("{found} points given for a mesh of {expected}")]
    PointCount {
        /// How many were given.
        found: usize,
        /// How many the mesh has.
        expected: usize,
    },
    /// Feature tags that match neither the faces nor the vertices they were given for.
    #[error("{found} feature tags given for {expected} {what}")]
    FeatureCount {
        /// How many were given.
        found: usize,
        /// How many there should be.
        expected: usize,
        /// Faces or vertices.
        what: &'static str,
    },
    /// A tagged face is none of the mesh.
    #[error(
        "face {face} of those with features ({feature}, vertices {}) is no face of any cell; so are {loose} of {faces} in all",
        listed(vertices)
    )]
    LooseFace {
        /// The face.
        face: usize,
        /// The name of its feature, or its number.
        feature: String,
        /// Its vertices.
        vertices: Vec<u32>,
        /// How many are none.
        loose: usize,
        /// How many there are.
        faces: usize,
    },
    /// A feature is named whose number no face has.
    #[error(
        "feature '{name}' has the number {number}, which no face has; the faces have {}",
        listed(numbers)
    )]
    EmptyFeature {
        /// Its number.
        number: i64,
        /// Its name.
        name: String,
        /// The numbers that faces have.
        numbers: Vec<i64>,
    },
    /// An array is too short for the values that its stride asks for, or has another number of
    /// values than is needed.
    #[error("array '{name}': {found} values where {expected} are needed")]
    ArrayLength {
        /// The array.
        name: String,
        /// How many values it has.
        found: usize,
        /// How many are needed.
        expected: usize,
    },
}

fn expected_count(cell_type: CellType) -> String {
    cell_type.vertex_count().map_or_else(String::new, |count| format!(", which has {count}"))
}
