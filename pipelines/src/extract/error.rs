//! Why something could not be taken out of a channel.

use tombolo_deform::limits::Exceeded;
use tombolo_deform::mesh::{MeshError, Vector};
use tombolo_deform::names::hint;
use tombolo_deform::surface::SurfaceError;
use tombolo_deform::vector::Position;

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
        /// The entities that it has one value for.
        association: Association,
        /// The vertex or cell of the solver's mesh.
        entity: usize,
        /// The value found.
        value: f64,
        /// The cycle.
        cycle: u64,
    },
    /// A field that decides what is taken holds NaN or an infinity.
    #[error(
        "cycle {cycle}: field `{field}` is {value} at {association} {entity}; nothing is taken by it"
    )]
    DecidingNotFinite {
        /// The field.
        field: String,
        /// The entities that it has one value for.
        association: Association,
        /// The vertex or cell of the solver's mesh.
        entity: usize,
        /// The value found.
        value: f64,
        /// The cycle.
        cycle: u64,
    },
    /// The channel has no field of this name.
    #[error("{0}")]
    UnknownField(String),
    /// A field of another association than is needed.
    #[error("field `{field}` has values for {association} entities, expected a vertex field")]
    NotOfVertices {
        /// The field.
        field: String,
        /// Its association.
        association: Association,
    },
    /// A field that is no vector.
    #[error("field `{field}` has {components} components, expected a vector of 2 or 3")]
    NoVector {
        /// The field.
        field: String,
        /// How many components it has.
        components: usize,
    },
    /// There is no place to begin at.
    #[error("{0}")]
    Seeds(String),
    /// It would have more than is allowed.
    #[error(transparent)]
    Exceeded(#[from] Exceeded),
    /// Another rank has failed, and tells why.
    #[error("another rank could not take it")]
    Elsewhere,
    /// Points of a probe lie in no cell.
    #[error(
        "{outside} of {points} points lie in no cell and are left out, first {}",
        Position(*first)
    )]
    OutsidePoints {
        /// How many.
        outside: usize,
        /// How many points there are.
        points: usize,
        /// The first of them.
        first: Vector,
    },
    /// A coordinate is NaN or infinite.
    #[error("cycle {cycle}: a coordinate of vertex {vertex} is {value}")]
    PointNotFinite {
        /// The vertex.
        vertex: usize,
        /// The value found.
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
    Distributed(#[from] tombolo_deform::distributed::DistributedError),
    /// The mesh has no surface that could be taken.
    #[error(transparent)]
    Surface(#[from] SurfaceError),
}

impl ExtractError {
    /// The field that the error is about: only that field is missing from the extract. `None` where
    /// there is no extract.
    #[must_use]
    pub fn field(&self) -> Option<&str> {
        match self {
            ExtractError::FieldNotFinite { field, .. }
            | ExtractError::FieldLength { field, .. } => Some(field),
            _ => None,
        }
    }
}

/// A text that says that there is no such field, which there are, and the nearest.
pub(crate) fn unknown_field<'a>(
    name: &str,
    known: impl Iterator<Item = &'a str> + Clone,
) -> String {
    let hint = hint(name, known.clone());
    let known: Vec<&str> = known.collect();
    if known.is_empty() {
        return format!("the channel has no field `{name}`, nor any other");
    }
    format!("the channel has no field `{name}`; its fields are {}{hint}", known.join(", "))
}

/// A text that says that there is no such feature, which there are, and the nearest.
pub(crate) fn unknown_feature(name: &str, known: &[String]) -> String {
    let hint = hint(name, known.iter().map(String::as_str));
    format!("the surface has no feature `{name}`; its features are {}{hint}", known.join(", "))
}
