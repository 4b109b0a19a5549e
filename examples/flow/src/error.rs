//! Why the solver stopped.

use tombolo_deform::communicator::RankError;
use tombolo_deform::linear::LinearError;
use tombolo_deform::mesh::{CellType, Vector};

/// Why the solver cannot start, or cannot go on.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SolverError {
    /// A volume cell of another type.
    #[error("cell {cell} is a {found}; the flow solver needs tetrahedra")]
    CellType {
        /// The cell.
        cell: usize,
        /// Its type.
        found: CellType,
    },
    /// A mesh without volume.
    #[error(
        "the mesh has no tetrahedron; the flow solver needs a mesh of the volume, not of its surface"
    )]
    NoCells,
    /// A vertex with too many neighbours.
    #[error("vertex {vertex} has more than 65535 neighbours")]
    Valence {
        /// The vertex.
        vertex: usize,
    },
    /// A patch names a vertex that does not exist.
    #[error("patch '{patch}': vertex {vertex} does not exist")]
    PatchVertex {
        /// The patch.
        patch: String,
        /// The vertex.
        vertex: u32,
    },
    /// An outlet that has no vertex of its own.
    #[error(
        "patch '{patch}': every vertex of it lies on a wall or on an inlet too, so that nothing gets out there; an outlet needs a finer mesh"
    )]
    Outlet {
        /// The patch.
        patch: String,
    },
    /// An array for another number of vertices.
    #[error("{what}: {found} values for a mesh of {expected} vertices")]
    Length {
        /// Which array.
        what: &'static str,
        /// How many values it has.
        found: usize,
        /// How many are needed.
        expected: usize,
    },
    /// A number that must be positive and finite is not.
    #[error("{what} is {value}; it must be positive and finite")]
    NotPositive {
        /// The name of the number.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// A boundary value that is not finite.
    #[error("the {quantity} on '{patch}' would be {value} at ({:.6}, {:.6}, {:.6}); it must be finite", position[0], position[1], position[2])]
    NotFinite {
        /// The patch.
        patch: String,
        /// Velocity or pressure.
        quantity: &'static str,
        /// Where.
        position: Vector,
        /// The value.
        value: f64,
    },
    /// A state that was saved of something else.
    #[error(
        "the saved state is not that of this mesh; expected one of the same case on as many ranks"
    )]
    Saved,
    /// The pressure equation has no solver.
    #[error("the pressure equation cannot be solved: {0}")]
    Pressure(#[from] LinearError),
    /// Something is wrong on one rank. All ranks have this error.
    #[error(transparent)]
    Rank(#[from] RankError),
    /// An inverted or flat element.
    #[error("cycle {cycle}: cell {cell} at ({:.6}, {:.6}, {:.6}) is inverted or flat (volume {volume:.3e})", position[0], position[1], position[2])]
    Inverted {
        /// The cycle.
        cycle: u64,
        /// The cell.
        cell: usize,
        /// Its centre.
        position: Vector,
        /// Its volume.
        volume: f64,
    },
    /// The solution is no longer finite.
    #[error("cycle {cycle}, time {time:.6}: the {quantity} at vertex {vertex}, ({:.6}, {:.6}, {:.6}), is {value}: the solution has diverged; a smaller time step or a schedule of more steps may help", position[0], position[1], position[2])]
    Diverged {
        /// The cycle.
        cycle: u64,
        /// The time at the end of the step.
        time: f64,
        /// Velocity or pressure.
        quantity: &'static str,
        /// The first vertex where it is not finite.
        vertex: usize,
        /// Where that is.
        position: Vector,
        /// The value that was found.
        value: f64,
    },
}
