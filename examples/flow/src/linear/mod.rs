//! The iterative solver of the momentum equation, whose matrix is not symmetric; that of the
//! pressure is the kernel's.
//!
//! Everything here gives the same bits whatever the number of threads: a row is summed by one
//! thread in the order of its entries, and reductions are summed over chunks of a fixed length, and
//! of several ranks in the order of a fixed tree.

mod bicgstab;
mod incomplete_lu;
mod vectors;

pub use bicgstab::{BiCgStab, Tuples};
pub use incomplete_lu::BlockIncompleteLu;
pub use vectors::{CHUNK, for_each, sum};

/// The outcome of an iterative solve.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Outcome {
    /// How many iterations it took.
    pub iterations: usize,
    /// The norm of the residual at the end, in the units of the right-hand side.
    pub residual: f64,
    /// Whether the residual is below what was asked.
    pub converged: bool,
}
