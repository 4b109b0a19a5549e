//! Direct solves by sparse Cholesky factorisations.
//!
//! [`Cholesky`] and [`Factor`] are faer's, for small systems and the coarsest level of multigrid.
//! [`MultifrontalFactor`] is our own, for the operators of a surface: see there for the reason.
//! `dense` is for matrices of a few rows.

use std::sync::Arc;

mod dense;
mod dissection;
mod factor;
mod front;
mod multifrontal;

pub(crate) use dense::{factor_dense, solve_dense};
pub(crate) use dissection::dissect;
pub(crate) use factor::{Factor, UpperTriangle};
pub(crate) use multifrontal::{MultifrontalFactor, NoFactor, Rows};

use super::iteration::{Sum, conjugate_gradients, single_column, single_column_mut};
use super::{Convergence, LinearError, LinearSolver, SparseMatrix, Tolerance};
use crate::communicator::Halo;

/// Iterations that refine what the factor gives; one is enough unless the matrix is close to
/// singular.
const REFINEMENTS: usize = 50;

/// The sparse Cholesky factorisation of a symmetric positive definite matrix (faer's, with an
/// approximate minimum degree ordering).
///
/// The quickest choice for small systems: its set-up grows faster than the system. A solution that
/// rounding keeps above the tolerance is refined by conjugate gradients with the factor as
/// preconditioner.
#[derive(Debug)]
pub struct Cholesky<const B: usize> {
    matrix: Arc<SparseMatrix<B>>,
    factor: Factor,
}

impl<const B: usize> Cholesky<B> {
    /// Factors a matrix.
    ///
    /// # Errors
    /// [`LinearError::Factor`] where it is not positive definite to rounding, or its factor does
    /// not fit in memory.
    pub fn new(matrix: impl Into<Arc<SparseMatrix<B>>>) -> Result<Self, LinearError> {
        let matrix = matrix.into();
        let factor = Factor::of(&matrix).ok_or(LinearError::Factor)?;
        Ok(Self { matrix, factor })
    }
}

impl<const B: usize> LinearSolver<B> for Cholesky<B> {
    fn unknowns(&self) -> usize {
        self.matrix.rows()
    }

    fn solve_from(
        &self,
        right_side: &[[f64; B]],
        solution: &mut [[f64; B]],
        tolerance: Tolerance,
    ) -> Result<Convergence, LinearError> {
        let apply = |vector: &[[[f64; B]; 1]], result: &mut [[[f64; B]; 1]]| {
            self.factor.solve(vector, result);
            Ok(())
        };
        let (right_side, solution) = (single_column(right_side), single_column_mut(solution));
        let sum = Sum { matrix: &*self.matrix, halo: &Halo::none() };
        let [mut convergence] =
            conjugate_gradients(&sum, apply, right_side, solution, [tolerance], REFINEMENTS)?;
        convergence.iterations = 0;
        Ok(convergence)
    }

    fn renewed(
        &self,
        matrix: Arc<SparseMatrix<B>>,
    ) -> Result<Box<dyn LinearSolver<B>>, LinearError> {
        Ok(Box::new(Self::new(matrix)?))
    }
}
