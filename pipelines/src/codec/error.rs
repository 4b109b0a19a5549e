//! Why bytes are no topology and no field.

/// Why bytes could not be decoded, or arrays not be coded.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CodecError {
    /// The bytes end too early.
    #[error("the message is truncated")]
    Truncated,
    /// The bytes say something that cannot be.
    #[error("the message is damaged: {0}")]
    Damaged(&'static str),
    /// The message unfolds to more than a message may.
    #[error("{found} {what}, at most {most} are read")]
    TooLarge {
        /// The things counted.
        what: &'static str,
        /// How many the message says there are.
        found: u64,
        /// How many there may be.
        most: u64,
    },
    /// A cell names a point that there is none of.
    #[error("point {point} of {points}")]
    Point {
        /// The point that is named.
        point: u32,
        /// How many there are.
        points: usize,
    },
    /// Positions that are not finite, or too far apart for their bound.
    #[error("the positions cannot be coded within the bound")]
    Positions,
    /// An array that does not fit its points.
    #[error("{found} values, expected {expected}")]
    Length {
        /// How many values there are.
        found: usize,
        /// How many there should be.
        expected: usize,
    },
}
