//! What an algorithm must know of the other ranks where the mesh it works on is a part of a larger one.
//!
//! Cells belong to one rank each; a vertex on the border between parts is held by several. A sum over cells is then what the ranks
//! have between them, added up at the vertices that they share. Everything here that works on [`Partition`]s is collective: all
//! ranks call it, in the same order, and all get the same outcome. An error of one rank is [`VolumeError::OtherRank`] on the
//! others.
//!
//! [`VolumeError::OtherRank`]: crate::volume::VolumeError::OtherRank

mod shares;

use std::fmt::Debug;
use std::sync::Arc;

use crate::linear::{DistributedMultigrid, LinearError, LinearSolver, SparseMatrix};
use crate::mesh::Cells;
pub use shares::Shares;

/// How the values of the ranks are combined.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reduction {
    /// The smallest; NaN is passed over.
    Minimum,
    /// The largest; NaN is passed over.
    Maximum,
    /// The sum, added in a fixed order, so that the bits do not depend on chance.
    Sum,
}

impl Reduction {
    /// Takes `more` into `values`.
    pub fn take_in(self, values: &mut [f64], more: &[f64]) {
        for (value, more) in values.iter_mut().zip(more) {
            *value = match self {
                Reduction::Minimum => value.min(*more),
                Reduction::Maximum => value.max(*more),
                Reduction::Sum => *value + more,
            };
        }
    }
}

/// The vertices that this rank and another both have.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Neighbour {
    /// The other rank.
    pub rank: usize,
    /// The vertices, in the same order on both ranks: that of their numbers in the whole mesh.
    pub vertices: Vec<u32>,
}

/// The parts that a mesh is in, as the rank that has one of them sees them.
///
/// The methods that speak with other ranks ([`reduce`](Partition::reduce), [`gather`](Partition::gather),
/// [`exchange`](Partition::exchange), and making and using a solver) are collective.
pub trait Partition: Debug + Send + Sync {
    /// This rank's number, from 0.
    fn rank(&self) -> usize {
        0
    }

    /// How many ranks there are. One of them has the whole mesh, and no method of this trait does anything.
    fn ranks(&self) -> usize {
        1
    }

    /// Combines each value over all ranks, which bring the same number of them; every rank has the result, the same bits.
    fn reduce(&self, reduction: Reduction, values: &mut [f64]) {
        let _ = (reduction, values);
    }

    /// What all ranks bring, one after the other in the order of their numbers.
    fn gather(&self, values: &[f64]) -> Vec<f64> {
        values.to_vec()
    }

    /// Sends each message to its rank and returns those sent here with their senders, in the order of the senders.
    fn exchange(&self, messages: Vec<(usize, Vec<f64>)>) -> Vec<(usize, Vec<f64>)> {
        messages
    }

    /// The same where every rank knows whom it hears: each of the ranks `from`, rising, sends one message here, and no other does.
    fn exchange_with(
        &self,
        messages: Vec<(usize, Vec<f64>)>,
        from: &[usize],
    ) -> Vec<(usize, Vec<f64>)> {
        let _ = from;
        self.exchange(messages)
    }

    /// Whether this rank is the one of those that have a vertex in a cell of their own that speaks for it.
    fn owns(&self, vertex: u32) -> bool {
        let _ = vertex;
        true
    }

    /// The ranks that have vertices of this rank too, rising.
    fn neighbours(&self) -> &[Neighbour] {
        &[]
    }

    /// The number in the whole mesh of a cell of the part.
    fn cell_number(&self, cell: usize) -> usize {
        cell
    }

    /// The faces of the part that lie on the boundary of the whole mesh; `None` where all do that one cell has.
    fn boundary_faces(&self) -> Option<&Cells> {
        None
    }

    /// A solver of its own for a system with one value for each of `vertices`; `None` for that of [`scalar_solver`]. The matrix
    /// is the sum of the ranks'; a right side is the sum of theirs too, and a solution is the same on all ranks that have a
    /// vertex.
    fn scalar_solver(&self, matrix: &Arc<SparseMatrix<1>>, vertices: &[u32]) -> Option<Solver<1>> {
        let _ = (matrix, vertices);
        None
    }

    /// The same for three values.
    fn vector_solver(&self, matrix: &Arc<SparseMatrix<3>>, vertices: &[u32]) -> Option<Solver<3>> {
        let _ = (matrix, vertices);
        None
    }
}

/// A solver, or why there is none.
pub type Solver<const B: usize> = Result<Box<dyn LinearSolver<B>>, LinearError>;

/// The partition of a mesh that this process has as a whole.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Whole;

impl Partition for Whole {}

/// The partition of a mesh that this process has as a whole.
#[must_use]
pub fn whole() -> Arc<dyn Partition> {
    Arc::new(Whole)
}

/// The solver for a symmetric positive definite matrix that is the sum of the ranks', each with a row for each of its `vertices`:
/// the partition's own, or [`DistributedMultigrid`]; of one process that of [`linear::solver`](crate::linear::solver). Collective.
///
/// # Errors
/// [`LinearError`], on all ranks.
pub fn scalar_solver(
    partition: &Arc<dyn Partition>,
    matrix: Arc<SparseMatrix<1>>,
    vertices: &[u32],
) -> Solver<1> {
    match partition.scalar_solver(&matrix, vertices) {
        Some(solver) => solver,
        None if partition.ranks() == 1 => crate::linear::solver(matrix),
        None => Ok(Box::new(DistributedMultigrid::new(Arc::clone(partition), matrix, vertices)?)),
    }
}

/// The same for three values at each vertex.
///
/// # Errors
/// [`LinearError`], on all ranks.
pub fn vector_solver(
    partition: &Arc<dyn Partition>,
    matrix: Arc<SparseMatrix<3>>,
    vertices: &[u32],
) -> Solver<3> {
    match partition.vector_solver(&matrix, vertices) {
        Some(solver) => solver,
        None if partition.ranks() == 1 => crate::linear::solver(matrix),
        None => Ok(Box::new(DistributedMultigrid::new(Arc::clone(partition), matrix, vertices)?)),
    }
}

/// Whether something holds on all ranks.
pub(crate) fn all(partition: &dyn Partition, mine: bool) -> bool {
    let mut holds = [f64::from(u8::from(mine))];
    partition.reduce(Reduction::Minimum, &mut holds);
    holds[0] > 0.0
}

/// Whether something holds on any rank.
pub(crate) fn any(partition: &dyn Partition, mine: bool) -> bool {
    !all(partition, !mine)
}

/// The sum of counts.
#[expect(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "below 2^53"
)]
pub(crate) fn count(partition: &dyn Partition, mine: usize) -> usize {
    let mut sum = [mine as f64];
    partition.reduce(Reduction::Sum, &mut sum);
    sum[0] as usize
}

/// The largest of counts.
#[expect(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "below 2^53"
)]
pub(crate) fn most(partition: &dyn Partition, mine: usize) -> usize {
    let mut most = [mine as f64];
    partition.reduce(Reduction::Maximum, &mut most);
    most[0] as usize
}
