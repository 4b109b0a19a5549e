//! The processes that a mesh is distributed over.

/// How [`Communicator::reduce`] combines the values of the ranks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reduction {
    /// The smallest.
    Minimum,
    /// The largest.
    Maximum,
    /// The sum, added in the order of the ranks so that the bits do not depend on chance.
    Sum,
}

/// The processes that run together: one ([`Solo`]) or the ranks of an MPI communicator.
///
/// Every method but [`rank`](Communicator::rank) and [`size`](Communicator::size) is collective: all ranks call it, in the same
/// order, or all wait.
pub trait Communicator: Send + Sync {
    /// This process's number, from 0.
    fn rank(&self) -> usize;
    /// How many processes there are, at least 1.
    fn size(&self) -> usize;
    /// Replaces `bytes` on every rank with those of `root`.
    fn broadcast(&self, root: usize, bytes: &mut Vec<u8>);
    /// The bytes of all ranks in the order of their numbers on `root`; `None` elsewhere.
    fn gather(&self, root: usize, bytes: &[u8]) -> Option<Vec<Vec<u8>>>;
    /// Combines each value over all ranks; every rank has the result.
    fn reduce(&self, reduction: Reduction, values: &mut [f64]);
    /// Returns once every rank has come here.
    fn barrier(&self);
}

/// A communicator of one process.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Solo;

impl Communicator for Solo {
    fn rank(&self) -> usize {
        0
    }
    fn size(&self) -> usize {
        1
    }
    fn broadcast(&self, _root: usize, _bytes: &mut Vec<u8>) {}
    fn gather(&self, _root: usize, bytes: &[u8]) -> Option<Vec<Vec<u8>>> {
        Some(vec![bytes.to_vec()])
    }
    fn reduce(&self, _reduction: Reduction, _values: &mut [f64]) {}
    fn barrier(&self) {}
}
