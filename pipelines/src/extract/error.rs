//! Why something could not be taken out of a channel.

use tombolo_deform::mesh::MeshError;
use tombolo_deform::surface::SurfaceError;

use super::Association;

/// Why an extract, or one field of it, could not be made. The solver goes on.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ExtractError {
    /// A field holds NaN or an infinity.
    #[error(
        "cycle {cycle}: field `{field}` is {value} at {association} {entity}; it is left out of the extract"
    )]
    FieldNotFinite {
        /// The field.
        field: String,
        /// What it has one value for.
        association: Association,
        /// The vertex or cell of the solver's mesh.
        entity: usize,
        /// What was found.
        value: f64,
        /// The cycle.
        cycle: u64,
    },
    /// A coordinate is NaN or infinite.
    #[error("cycle {cycle}: a coordinate of vertex {vertex} is {value}")]
    PointNotFinite {
        /// The vertex.
        vertex: usize,
        /// What was found.
        value: f64,
        /// The cycle.
        cycle: u64,
    },
    /// A field has another number of tuples than its mesh has vertices or cells.
    #[error(
        "field `{field}` has {found} tuples, the mesh has {expected} for the association {association}"
    )]
    FieldLength {
        /// The field.
        field: String,
        /// Its association.
        association: Association,
        /// How many tuples it has.
        found: usize,
        /// How many it needs.
        expected: usize,
    },
    /// The cells are not those of a mesh.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// The parts that the ranks have do not make a mesh.
    #[error(transparent)]
    Distributed(#[from] crate::distributed::DistributedError),
    /// The mesh has no surface that could be taken.
    #[error(transparent)]
    Surface(#[from] SurfaceError),
}

impl ExtractError {
    /// The field that the error is about: only that field is missing from the extract. `None` where there is no extract.
    #[must_use]
    pub fn field(&self) -> Option<&str> {
        match self {
            ExtractError::FieldNotFinite { field, .. }
            | ExtractError::FieldLength { field, .. } => Some(field),
            _ => None,
        }
    }
}
