//! Carrying the motion of the boundary into the volume.
//!
//! A [`VolumeOperator`] is set up once from the reference mesh and then answers any number of
//! boundary motions. It solves, on linear finite elements, either linear elasticity with a material
//! that is stiffer where cells are small (T. Tezduyar et al. 1992; K. Stein, T. Tezduyar, R. Benney
//! 2003) or Laplace's equation for each component of the displacement.

mod adaptive;
mod assembly;
mod barrier;
mod colours;
mod corners;
mod element;
mod equations;
mod foldover;
mod impossible;
mod improve;
mod newton;
mod operator;
mod rigid;
mod rotation;
mod route;
mod settings;
mod sliding;
mod solve;
mod spring;
#[cfg(test)]
mod tests;
mod untangle;

pub use adaptive::follow;
pub(crate) use adaptive::with_boundary;
pub use impossible::Impossible;
pub use improve::Improver;
pub use operator::{VolumeOperator, VolumeSolution};
pub use route::{BoundaryMotion, FollowError, Route, Stalled, Volume, Waypoint};
pub use settings::{Deform, Method};
pub use sliding::Sliding;
pub use untangle::Untangler;

use crate::communicator::Communicator;
use crate::mesh::{CellType, Vector};
use crate::number::Number;
use crate::vector::Position;

impl VolumeError {
    /// Whether it was given up, of which nothing follows for the next solve.
    #[must_use]
    pub fn is_cancelled(&self) -> bool {
        matches!(self, Self::Linear(crate::linear::LinearError::Cancelled))
    }

    /// Whether the reason lies with another rank, which has an error of its own.
    #[must_use]
    pub fn is_of_other_rank(&self) -> bool {
        matches!(self, Self::OtherRank | Self::Linear(crate::linear::LinearError::OtherRank))
    }
}

/// The value of this rank, where all ranks have one; an error on all of them where one has none.
fn agreed<T>(
    communicator: &dyn Communicator,
    mine: Result<T, VolumeError>,
) -> Result<T, VolumeError> {
    match (communicator.all(mine.is_ok()), mine) {
        (true, mine) => mine,
        (false, Err(error)) => Err(error),
        (false, Ok(_)) => Err(VolumeError::OtherRank),
    }
}

fn of_them_left_handed(count: usize) -> String {
    match count {
        0 => String::new(),
        _ => format!(
            ", {count} of them left-handed where most of their type are not: give the vertices of all cells of a type the same way round"
        ),
    }
}

/// Why a volume could not be deformed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum VolumeError {
    /// A setting is out of its range.
    #[error("deform.{name} is {}; it must be {expected}", Number(*value))]
    Setting {
        /// The setting.
        name: &'static str,
        /// The value.
        value: f64,
        /// The range that is allowed.
        expected: &'static str,
    },
    /// A cell of the reference mesh is flat or turned inside out.
    #[error(
        "cell {cell} ({cell_type}) at {} has no positive volume in the reference mesh; {count} such \
         cell(s) in all{}",
        Position(*centroid), of_them_left_handed(*left_handed)
    )]
    InvertedCell {
        /// The first such cell.
        cell: usize,
        /// Its type.
        cell_type: CellType,
        /// The mean of its vertices.
        centroid: Vector,
        /// How many there are.
        count: usize,
        /// How many of them are left-handed at every corner, where the mesh is right-handed.
        left_handed: usize,
    },
    /// More cells than 32-bit numbers can count.
    #[error("{cells} cells in one mesh; at most {} can be deformed as one", u32::MAX)]
    TooLarge {
        /// How many there are.
        cells: usize,
    },
    /// A mesh with other cells than those of the operator.
    #[error("the mesh does not have the cells that the volume operator was set up for")]
    OtherCells,
    /// A boundary vertex that the mesh does not have.
    #[error(
        "boundary vertex {vertex} does not exist; the mesh has {vertex_count} vertices, numbered from 0"
    )]
    BoundaryVertex {
        /// The vertex.
        vertex: u32,
        /// How many the mesh has.
        vertex_count: usize,
    },
    /// A boundary vertex that is listed more than once.
    #[error("boundary vertex {vertex} is listed more than once")]
    BoundaryTwice {
        /// The vertex.
        vertex: u32,
    },
    /// Cells that hang together with no boundary vertex, so that nothing says where they go.
    #[error(
        "vertex {vertex} belongs to cells that no boundary vertex holds; {count} such vertices in all"
    )]
    Unattached {
        /// The first such vertex.
        vertex: usize,
        /// How many there are.
        count: usize,
    },
    /// A direction across a sliding surface that is no direction.
    #[error("the normal of sliding vertex {vertex} is {normal:?}; it must be finite and not zero")]
    SlidingNormal {
        /// The vertex.
        vertex: u32,
        /// Its normal.
        normal: Vector,
    },
    /// Another number of displacements than there are sliding vertices.
    #[error("{found} displacements given for {expected} sliding vertices")]
    SlidingCount {
        /// How many were given.
        found: usize,
        /// How many there are.
        expected: usize,
    },
    /// A displacement to start from that is not one of every vertex.
    #[error("{found} displacements given to start from; the mesh has {expected} vertices")]
    StartCount {
        /// How many were given.
        found: usize,
        /// How many there are.
        expected: usize,
    },
    /// Another number of displacements than there are boundary vertices.
    #[error("{found} boundary displacements given for {expected} boundary vertices")]
    BoundaryCount {
        /// How many were given.
        found: usize,
        /// How many there are.
        expected: usize,
    },
    /// A displacement that is NaN or infinite.
    #[error("the displacement of boundary vertex {vertex} is {value:?}; it must be finite")]
    NotFinite {
        /// The vertex.
        vertex: u32,
        /// Its displacement.
        value: Vector,
    },
    /// Another of the ranks that each have a part of the mesh could not go on.
    #[error("another rank could not go on")]
    OtherRank,
    /// The linear solve failed.
    #[error(transparent)]
    Linear(#[from] crate::linear::LinearError),
}
