//! Conjugate gradients with a multigrid preconditioner.

use std::sync::{Arc, OnceLock};

use super::hierarchy::Hierarchy;
use super::iteration::{Columns, conjugate_gradients, dot, single_column, single_column_mut};
use super::real::Real;
use super::{ConjugateGradients, Convergence, LinearError, LinearSolver, SparseMatrix, Tolerance};
use crate::mesh::Vector;

/// The precision that a preconditioner is kept and applied in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Precision {
    /// Half the memory to be read; the accuracy of the solution is not touched.
    #[default]
    Single,
    /// The precision of the matrix.
    Double,
}

/// What may be chosen about [`Multigrid`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MultigridSettings {
    /// The precision of the preconditioner.
    pub precision: Precision,
    /// The iterations after which multigrid is taken to have stalled, and the fallback goes on from there.
    pub max_iterations: usize,
}

impl Default for MultigridSettings {
    /// Single precision, 100 iterations.
    fn default() -> Self {
        Self { precision: Precision::Single, max_iterations: 100 }
    }
}

/// Conjugate gradients preconditioned by one V-cycle of algebraic multigrid: smoothed aggregation of whole blocks (P. Vaněk, J.
/// Mandel, M. Brezina 1996), one sweep of block Gauss–Seidel forwards before and backwards after each coarser level, Cholesky
/// on the coarsest.
///
/// The number of iterations hardly grows with the system. Where multigrid cannot be set up, or stalls, or breaks down, the solve
/// goes on with [`ConjugateGradients`], set up at that moment.
///
/// Number the unknowns well ([`reverse_cuthill_mckee`](super::reverse_cuthill_mckee)): the narrower the matrix is about its
/// diagonal, the more threads can be used.
#[derive(Debug)]
pub struct Multigrid<const B: usize> {
    matrix: Arc<SparseMatrix<B>>,
    settings: MultigridSettings,
    levels: Levels<B>,
    fallback: OnceLock<Result<ConjugateGradients<B>, LinearError>>,
}

#[derive(Debug)]
enum Levels<const B: usize> {
    Single(Hierarchy<f32, B, B>),
    Double(Hierarchy<f64, B, B>),
    /// Aggregates turn as rigid bodies; where the unknowns lie.
    Bodies(Box<Hierarchy<f32, B, 6>>, Arc<[Vector]>),
    /// A diagonal block of some level was not positive definite.
    None,
}

impl<const B: usize> Multigrid<B> {
    /// A solver for a symmetric positive definite matrix.
    ///
    /// # Errors
    /// [`LinearError::Diagonal`].
    pub fn new(
        matrix: impl Into<Arc<SparseMatrix<B>>>,
        settings: MultigridSettings,
    ) -> Result<Self, LinearError> {
        let matrix = matrix.into();
        let levels = match settings.precision {
            Precision::Single => Hierarchy::new(&matrix, None, None, None).map(Levels::Single),
            Precision::Double => Hierarchy::new(&matrix, None, None, None).map(Levels::Double),
        };
        Self::with_levels(matrix, settings, levels)
    }

    /// The same where each aggregate of unknowns may turn about its centre as well as shift: `places` are where the vertices of
    /// the unknowns lie. An iteration costs up to twice as much; elastic bodies that are held at few places, or slide, need
    /// fewer of them.
    ///
    /// # Errors
    /// [`LinearError::Places`], [`LinearError::Diagonal`].
    pub fn with_rigid_bodies(
        matrix: impl Into<Arc<SparseMatrix<B>>>,
        places: impl Into<Arc<[Vector]>>,
        settings: MultigridSettings,
    ) -> Result<Self, LinearError> {
        let (matrix, places) = (matrix.into(), places.into());
        if B != 3 || places.len() != matrix.rows() {
            return Err(LinearError::Places {
                found: places.len(),
                expected: matrix.rows(),
                block: B,
            });
        }
        let levels = Hierarchy::new(&matrix, None, None, Some(&places));
        Self::with_levels(
            matrix,
            settings,
            levels.map(|levels| Levels::Bodies(Box::new(levels), places)),
        )
    }

    /// The same for another matrix; the aggregates are used again where that has its blocks at the same places.
    pub(super) fn of_like_matrix(&self, matrix: Arc<SparseMatrix<B>>) -> Result<Self, LinearError> {
        let same = self.matrix.has_pattern_of(&matrix);
        let levels = match &self.levels {
            Levels::Single(like) => {
                Hierarchy::new(&matrix, None, same.then_some(like), None).map(Levels::Single)
            }
            Levels::Double(like) => {
                Hierarchy::new(&matrix, None, same.then_some(like), None).map(Levels::Double)
            }
            Levels::Bodies(like, places) => (places.len() == matrix.rows())
                .then(|| Hierarchy::new(&matrix, None, same.then_some(&**like), Some(places)))
                .flatten()
                .map(|levels| Levels::Bodies(Box::new(levels), Arc::clone(places))),
            Levels::None => return Self::new(matrix, self.settings),
        };
        Self::with_levels(matrix, self.settings, levels)
    }

    /// The matrix.
    #[must_use]
    pub fn matrix(&self) -> &SparseMatrix<B> {
        &self.matrix
    }

    fn with_levels(
        matrix: Arc<SparseMatrix<B>>,
        settings: MultigridSettings,
        levels: Option<Levels<B>>,
    ) -> Result<Self, LinearError> {
        let solver = Self {
            matrix,
            settings,
            levels: levels.unwrap_or(Levels::None),
            fallback: OnceLock::new(),
        };
        if matches!(solver.levels, Levels::None) {
            solver.fallback()?;
        }
        Ok(solver)
    }

    fn fallback(&self) -> Result<&ConjugateGradients<B>, LinearError> {
        self.fallback
            .get_or_init(|| ConjugateGradients::new(Arc::clone(&self.matrix)))
            .as_ref()
            .map_err(|error| *error)
    }

    fn iterate<T: Real, const C: usize, const K: usize>(
        &self,
        hierarchy: &Hierarchy<T, B, C>,
        right_side: &[Columns<B, K>],
        solution: &mut [Columns<B, K>],
        tolerances: [Tolerance; K],
    ) -> Result<[Convergence; K], LinearError> {
        let mut workspace = hierarchy.workspace();
        let scale = dot(right_side, right_side).map(|square| {
            let scale = 1.0 / square.sqrt();
            if scale.is_normal() { scale } else { 1.0 }
        });
        let precondition = |vector: &[Columns<B, K>], result: &mut [Columns<B, K>]| {
            hierarchy.apply(&mut workspace, scale, vector, result);
        };
        let limit = self.settings.max_iterations;
        conjugate_gradients(&*self.matrix, precondition, right_side, solution, tolerances, limit)
    }

    fn solve_columns<const K: usize>(
        &self,
        right_side: &[Columns<B, K>],
        solution: &mut [Columns<B, K>],
        tolerances: [Tolerance; K],
    ) -> Result<[Convergence; K], LinearError> {
        let result = match &self.levels {
            Levels::Single(hierarchy) => self.iterate(hierarchy, right_side, solution, tolerances),
            Levels::Double(hierarchy) => self.iterate(hierarchy, right_side, solution, tolerances),
            Levels::Bodies(hierarchy, _) => {
                self.iterate(hierarchy, right_side, solution, tolerances)
            }
            Levels::None => Err(LinearError::NotConverged {
                iterations: 0,
                residual: f64::NAN,
                tolerance: tolerances[0].relative,
            }),
        };
        let before = match result {
            Err(LinearError::NotConverged { iterations, .. }) => iterations,
            Err(
                LinearError::Indefinite { iteration, .. } | LinearError::NotFinite { iteration },
            ) if iteration > 0 => iteration,
            other => return other,
        };
        let fallback = self.fallback()?;
        let mut result = [Convergence::default(); K];
        for (column, result) in result.iter_mut().enumerate() {
            let right: Vec<[f64; B]> = right_side.iter().map(|value| value[column]).collect();
            let mut start: Vec<[f64; B]> = solution.iter().map(|value| value[column]).collect();
            if !start.as_flattened().iter().all(|value| value.is_finite()) {
                start.fill([0.0; B]);
            }
            *result = fallback.solve_from(&right, &mut start, tolerances[column])?;
            result.iterations += before;
            for (value, found) in solution.iter_mut().zip(start) {
                value[column] = found;
            }
        }
        Ok(result)
    }
}

impl<const B: usize> LinearSolver<B> for Multigrid<B> {
    fn unknowns(&self) -> usize {
        self.matrix.rows()
    }

    fn solve_from(
        &self,
        right_side: &[[f64; B]],
        solution: &mut [[f64; B]],
        tolerance: Tolerance,
    ) -> Result<Convergence, LinearError> {
        let [convergence] = self.solve_columns(
            single_column(right_side),
            single_column_mut(solution),
            [tolerance],
        )?;
        Ok(convergence)
    }

    fn solve_three_from(
        &self,
        right_sides: &[[[f64; B]; 3]],
        solutions: &mut [[[f64; B]; 3]],
        tolerances: [Tolerance; 3],
    ) -> Result<[Convergence; 3], LinearError> {
        self.solve_columns(right_sides, solutions, tolerances)
    }

    fn renewed(
        &self,
        matrix: Arc<SparseMatrix<B>>,
    ) -> Result<Box<dyn LinearSolver<B>>, LinearError> {
        Ok(Box::new(self.of_like_matrix(matrix)?))
    }
}
