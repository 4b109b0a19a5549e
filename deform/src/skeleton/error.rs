//! Why a surface has no skeleton.

use super::InvalidSkeleton;
use crate::number::Number;

/// Why a surface has no skeleton.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SkeletonError {
    /// The surface has no triangle with three different vertices.
    #[error("the surface has no triangles")]
    NoTriangles,
    /// More than two faces meet in an edge, so that inside and outside cannot be told apart.
    #[error(
        "{faces} faces meet in the edge between vertices {} and {}: expected 1 or 2; a skeleton needs a surface with an inside",
        edge[0], edge[1]
    )]
    NonManifoldEdge {
        /// The mesh vertices at its ends.
        edge: [u32; 2],
        /// How many faces meet there.
        faces: usize,
    },
    /// The surface has one side only, as a Möbius strip.
    #[error("the surface has one side only: it comes back turned over at the edge between vertices {} and {}", edge[0], edge[1])]
    OneSided {
        /// The mesh vertices at the ends of the edge where it shows.
        edge: [u32; 2],
    },
    /// A connected piece of the surface encloses no volume, even with its holes closed.
    #[error(
        "the piece of the surface at vertex {vertex} ({triangles} triangles) is flat: it encloses no volume, so that it has no \
         middle line"
    )]
    Flat {
        /// A mesh vertex of the piece.
        vertex: u32,
        /// How many triangles the piece has.
        triangles: usize,
    },
    /// A setting is out of range.
    #[error(
        "the skeleton's setting {name} is {}: expected a finite number that is not negative, and `keep` above 0",
        Number(*value)
    )]
    Setting {
        /// Its name.
        name: &'static str,
        /// The value given.
        value: f64,
    },
    /// It was given up: see [`Skeleton::extract_unless`](super::Skeleton::extract_unless).
    #[error("the skeleton was given up before it was known")]
    Cancelled,
    /// The result is no skeleton: a defect of this library.
    #[error("the extraction ended in what is no skeleton: {0}")]
    Invalid(#[from] InvalidSkeleton),
}
