//! Sparse matrices and the solvers of linear systems.
//!
//! A [`LinearSolver`] is set up for one symmetric positive definite matrix and answers any number
//! of right sides. A semi-definite one whose [`NullSpace`] is known is for [`Multigrid`].
//! [`solver`] chooses one: [`Cholesky`] for small systems, [`Multigrid`] for all others, which
//! falls back on [`ConjugateGradients`] with a [`BlockPreconditioner`]. All of it is deterministic:
//! sums are taken in chunks whose size does not depend on the number of threads.

use std::sync::Arc;

mod aggregation;
mod border;
pub(crate) mod cholesky;
mod conjugate_gradients;
mod distribution;
mod gathered;
mod gauss_seidel;
mod hierarchy;
mod iteration;
mod lower;
#[cfg(test)]
mod lower_tests;
mod matrix;
mod multigrid;
mod null_space;
mod ordering;
mod pieces;
mod preconditioner;
mod real;
#[cfg(test)]
mod tests;
mod transfer;

use crate::cancellation::Cancellation;
use crate::communicator::{Communicator, Halo};
use crate::vector::Vector;
pub use cholesky::Cholesky;
pub use conjugate_gradients::ConjugateGradients;
use iteration::each_column;
pub(crate) use iteration::norms;
use matrix::add;
pub use matrix::{Block, SparseMatrix};
pub(crate) use matrix::{ROW_CHUNK, invert_positive};
pub use multigrid::{Multigrid, MultigridSettings, Precision};
pub use null_space::NullSpace;
pub use ordering::reverse_cuthill_mckee;
pub use preconditioner::{BlockPreconditioner, Factorization};

/// Systems of at most this many equations are solved directly.
const DIRECT: usize = 1500;

/// The solver for a symmetric positive definite matrix that is quickest at its size. On several
/// ranks it is one for the sum of their matrices; the rows are the entries of `halo`. Collective.
///
/// # Errors
/// [`LinearError::Diagonal`]; [`LinearError::OtherRank`].
pub fn solver<const B: usize>(
    matrix: Arc<SparseMatrix<B>>,
    halo: &Halo,
) -> Result<Box<dyn LinearSolver<B>>, LinearError> {
    Cancellable::default().solver(matrix, halo)
}

fn of_one_process() -> MultigridSettings {
    MultigridSettings { by_half: true, ..MultigridSettings::default() }
}

/// The kernel's own solvers, which are given up where that is asked for: it is looked at before each
/// set-up and each iteration. Of several ranks all have to see the same at each look, as they do with
/// [`Cancelling`](crate::communicator::Cancelling).
#[derive(Debug, Clone, Default)]
pub struct Cancellable(pub Cancellation);

impl Cancellable {
    fn solver<const B: usize>(&self, matrix: Arc<SparseMatrix<B>>, halo: &Halo) -> Solver<B> {
        let is_alone = halo.communicator().size() == 1;
        if is_alone
            && B * matrix.rows() <= DIRECT
            && let Ok(direct) = Cholesky::new(Arc::clone(&matrix))
        {
            return Ok(Box::new(direct));
        }
        if self.0.is_cancelled() {
            return Err(LinearError::Cancelled);
        }
        let multigrid = if is_alone {
            Multigrid::new(matrix, of_one_process())?
        } else {
            // Sweeps know less of the other ranks' rows, and more of them are needed before
            // multigrid has stalled.
            let settings =
                MultigridSettings { max_iterations: 300, ..MultigridSettings::default() };
            Multigrid::distributed(halo.clone(), matrix, settings)?
        };
        Ok(Box::new(multigrid.with_cancellation(self.0.clone())))
    }
}

impl Solvers for Cancellable {
    fn scalar(&self, matrix: Arc<SparseMatrix<1>>, halo: &Halo, _: &[Vector]) -> Solver<1> {
        self.solver(matrix, halo)
    }

    fn vector(&self, matrix: Arc<SparseMatrix<3>>, halo: &Halo, _: &[Vector]) -> Solver<3> {
        self.solver(matrix, halo)
    }

    fn are_wanted(&self) -> bool {
        !self.0.is_cancelled()
    }
}

/// The choice of solvers for the systems of a volume.
///
/// On several ranks the matrix is the sum of the ranks' and a right side the sum of theirs; a
/// solution is the same on all ranks that have an entry. The rows are the entries of `halo`, and
/// `positions` are where their vertices lie. To make a solver, and to use it, is collective.
pub trait Solvers: std::fmt::Debug + Send + Sync {
    /// A solver for one value at each vertex.
    ///
    /// # Errors
    /// [`LinearError`], on all ranks.
    fn scalar(&self, matrix: Arc<SparseMatrix<1>>, halo: &Halo, positions: &[Vector]) -> Solver<1>;

    /// A solver for three values at each vertex.
    ///
    /// # Errors
    /// [`LinearError`], on all ranks.
    fn vector(&self, matrix: Arc<SparseMatrix<3>>, halo: &Halo, positions: &[Vector]) -> Solver<3>;

    /// Whether anybody still waits for the systems to be set up. It is asked between the steps of
    /// the set-up, which ends where it is not so with [`LinearError::Cancelled`]. Of several ranks
    /// all have to say the same.
    fn are_wanted(&self) -> bool {
        true
    }

    /// These solvers with what has a set-up and a solve given up; `None` where these are finished
    /// first.
    fn with_cancellation(&self, cancellation: &Cancellation) -> Option<Arc<dyn Solvers>> {
        let _ = cancellation;
        None
    }
}

/// A solver, or why there is none.
pub type Solver<const B: usize> = Result<Box<dyn LinearSolver<B>>, LinearError>;

/// The kernel's own solvers: those that [`solver`] chooses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BuiltIn;

impl Solvers for BuiltIn {
    fn scalar(&self, matrix: Arc<SparseMatrix<1>>, halo: &Halo, _: &[Vector]) -> Solver<1> {
        solver(matrix, halo)
    }

    fn vector(&self, matrix: Arc<SparseMatrix<3>>, halo: &Halo, _: &[Vector]) -> Solver<3> {
        solver(matrix, halo)
    }

    fn with_cancellation(&self, cancellation: &Cancellation) -> Option<Arc<dyn Solvers>> {
        Some(Arc::new(Cancellable(cancellation.clone())))
    }
}

/// When an iterative solve may stop: once the residual's 2-norm is at most the larger of the two,
/// and the error as the preconditioner estimates it (the largest change that it would make to any
/// value, by the largest value) at most ten times the relative one. The second matters where
/// stiffnesses differ by many orders of magnitude: the residual is then that of the stiff unknowns.
/// A residual below the absolute tolerance is rounding, and its error is not estimated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tolerance {
    /// A multiple of the 2-norm of the right side.
    pub relative: f64,
    /// A 2-norm of the residual.
    pub absolute: f64,
}

/// How a solve went.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Convergence {
    /// How many iterations it took; 0 for a direct solver.
    pub iterations: usize,
    /// The 2-norm of the residual by that of the right side; 0 where the right side is.
    pub residual: f64,
}

/// A solver set up for one symmetric positive definite matrix of `B` by `B` blocks.
pub trait LinearSolver<const B: usize>: std::fmt::Debug + Send + Sync {
    /// How many unknown vectors of `B` values the system has on this process.
    fn unknowns(&self) -> usize;

    /// Solves for one right side, from zero. `right_side` and `solution` have
    /// [`LinearSolver::unknowns`] entries each.
    ///
    /// A right side of zeros gives exact zeros.
    ///
    /// # Errors
    /// [`LinearError`]; `solution` then holds nothing of use.
    ///
    /// # Panics
    /// Where either has another number of entries.
    fn solve(
        &self,
        right_side: &[[f64; B]],
        solution: &mut [[f64; B]],
        tolerance: Tolerance,
    ) -> Result<Convergence, LinearError> {
        solution.fill([0.0; B]);
        self.solve_from(right_side, solution, tolerance)
    }

    /// Solves for one right side from what `solution` holds, which the iteration leaves as it is
    /// where it is good enough already.
    ///
    /// # Errors
    /// As [`LinearSolver::solve`].
    fn solve_from(
        &self,
        right_side: &[[f64; B]],
        solution: &mut [[f64; B]],
        tolerance: Tolerance,
    ) -> Result<Convergence, LinearError>;

    /// Solves for three right sides side by side, from what `solutions` holds: quicker than one
    /// after the other, where the solver reads its matrix once for all three.
    ///
    /// # Errors
    /// As [`LinearSolver::solve`].
    fn solve_three_from(
        &self,
        right_sides: &[[[f64; B]; 3]],
        solutions: &mut [[[f64; B]; 3]],
        tolerances: [Tolerance; 3],
    ) -> Result<[Convergence; 3], LinearError> {
        each_column(right_sides, solutions, |column, right_side, solution| {
            self.solve_from(right_side, solution, tolerances[column])
        })
    }

    /// A solver of this kind for another matrix. Where that has its blocks at the same positions,
    /// what depends on these alone is used again.
    ///
    /// # Errors
    /// [`LinearError::Diagonal`], [`LinearError::Factor`].
    fn renewed(
        &self,
        matrix: Arc<SparseMatrix<B>>,
    ) -> Result<Box<dyn LinearSolver<B>>, LinearError>;
}

/// Why a linear system was not solved.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LinearError {
    /// The iteration ended before the residual was small enough.
    #[error(
        "the linear solve reached a relative residual of {residual:.3e} in {iterations} iterations; {tolerance:.3e} was asked \
         for"
    )]
    NotConverged {
        /// How many iterations were made.
        iterations: usize,
        /// The relative residual reached.
        residual: f64,
        /// The relative residual asked for.
        tolerance: f64,
    },
    /// The matrix is not positive definite.
    #[error(
        "the linear system is not positive definite (curvature {curvature:.3e} at iteration {iteration})"
    )]
    Indefinite {
        /// The iteration that met it.
        iteration: usize,
        /// The value that should have been positive.
        curvature: f64,
    },
    /// A block on the diagonal is not positive definite, so that no preconditioner can be built.
    #[error("the diagonal block of unknown {row} is not positive definite")]
    Diagonal {
        /// The row of the block.
        row: usize,
    },
    /// Rigid bodies need a position for each row of 3 by 3 blocks.
    #[error(
        "{found} positions given for {expected} rows of {block} by {block} blocks; rigid bodies need one for each row of 3 by 3 blocks"
    )]
    Positions {
        /// How many positions were given.
        found: usize,
        /// How many rows there are.
        expected: usize,
        /// How large the blocks are.
        block: usize,
    },
    /// A library that solves for us says no.
    #[error("{name} could not solve the linear system (its error {code})")]
    Library {
        /// The library.
        name: &'static str,
        /// Its error code.
        code: i32,
    },
    /// It was given up: see [`Cancellable`].
    #[error("the linear system was given up before it was solved")]
    Cancelled,
    /// Another of the ranks that solve together could not go on.
    #[error("the linear system could not be set up on another rank")]
    OtherRank,
    /// A matrix could not be factored.
    #[error(
        "the linear system has no Cholesky factor: it is not positive definite, or too large for memory"
    )]
    Factor,
    /// The right side, or something computed from it, is NaN or infinite.
    #[error("the linear solve met a value that is not finite at iteration {iteration}")]
    NotFinite {
        /// The iteration that met it.
        iteration: usize,
    },
}
