//! Why an extract was not encoded, and why bytes were not decoded.

use tombolo_deform::mesh::CellType;

use crate::codec::CodecError;

/// Why an extract was not encoded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EncodeError {
    /// A coordinate or the time is NaN or infinite.
    #[error("`{array}` is {value} at entity {entity}; only finite numbers are sent")]
    NotFinite {
        /// `points` or `time`.
        array: String,
        /// The point of the extract.
        entity: usize,
        /// The value found.
        value: f64,
    },
    /// A field does not fit the points or cells.
    #[error("`{array}` has {found} values, expected {expected}")]
    Length {
        /// The field.
        array: String,
        /// How many values it has.
        found: usize,
        /// How many it needs.
        expected: usize,
    },
    /// Volume cells, which a viewer cannot show.
    #[error("cell {cell} is a {cell_type}; only surfaces and lines are sent")]
    VolumeCell {
        /// The cell.
        cell: usize,
        /// Its type.
        cell_type: CellType,
    },
    /// The codec cannot take the arrays: too many points, or cells of points that do not exist.
    #[error(transparent)]
    Codec(#[from] CodecError),
    /// The compressor failed.
    #[error("compression: {0}")]
    Compression(#[from] std::io::Error),
}

/// Why bytes could not be decoded as a frame.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{part}: {message}")]
pub struct DecodeError {
    /// The part of the frame: the preamble, the header, or an array.
    pub part: String,
    /// The thing found, and the thing expected.
    pub message: String,
}

pub(super) fn error(part: impl Into<String>, message: impl Into<String>) -> DecodeError {
    DecodeError { part: part.into(), message: message.into() }
}
