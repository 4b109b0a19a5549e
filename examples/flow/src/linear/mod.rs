//! Sparse matrices and the iterative solvers of the flow solver.
//!
//! Everything here gives the same bits whatever the number of threads: a row is summed by one thread in the order of its
//! entries, and reductions are summed over chunks of a fixed length, and of several ranks in the order of a fixed tree ([`Halo`]).

mod bicgstab;
mod conjugate_gradients;
mod halo;
mod incomplete_lu;
mod matrix;
mod multigrid;
mod schwarz;
mod vectors;

pub use bicgstab::{BiCgStab, Tuples};
pub use conjugate_gradients::ConjugateGradients;
pub use halo::{Halo, Values};
pub use incomplete_lu::BlockIncompleteLu;
pub use matrix::{Matrix, Pattern};
pub use multigrid::Multigrid;
pub use schwarz::Schwarz;
pub use vectors::{CHUNK, for_each_chunk, norm, sum};

/// What an iterative solve came to.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Outcome {
    /// How many iterations it took.
    pub iterations: usize,
    /// The norm of the residual at the end, in the units of the right-hand side.
    pub residual: f64,
    /// Whether the residual is below what was asked.
    pub converged: bool,
}
