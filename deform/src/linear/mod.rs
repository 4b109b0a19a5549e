//! Sparse matrices and the solvers of linear systems.

/// Why a linear system was not solved.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LinearError {
    /// The iteration ended before the residual was small enough.
    #[error(
        "the linear solve reached a relative residual of {residual:.3e} in {iterations} iterations; {tolerance:.3e} was asked for"
    )]
    NotConverged {
        /// How many iterations were made.
        iterations: usize,
        /// The relative residual reached.
        residual: f64,
        /// The relative residual asked for.
        tolerance: f64,
    },
    /// The matrix, or its preconditioner, is not positive definite.
    #[error("the linear system is not positive definite (curvature {curvature:.3e} at iteration {iteration})")]
    Indefinite {
        /// The iteration that met it.
        iteration: usize,
        /// The value that should have been positive.
        curvature: f64,
    },
    /// The right side, or something computed from it, is NaN or infinite.
    #[error("the linear solve met a value that is not finite at iteration {iteration}")]
    NotFinite {
        /// The iteration that met it.
        iteration: usize,
    },
}
