//! Conjugate gradients with a multigrid preconditioner.

use std::borrow::Cow;
use std::sync::{Arc, OnceLock};

use super::hierarchy::Hierarchy;
use super::iteration::{
    Columns, Matrix, Sum, conjugate_gradients, each_column, single_column, single_column_mut,
};
use super::lower::Symmetric;
use super::null_space::{Constants, NullSpace};
use super::real::Real;
use super::{
    ConjugateGradients, Convergence, Factorization, LinearError, LinearSolver, SparseMatrix,
    Tolerance,
};
use crate::cancellation::Cancellation;
use crate::communicator::{Communicator, Halo};
use crate::vector::Vector;

/// The precision that a preconditioner is kept and applied in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Precision {
    /// Half the memory to be read; the accuracy of the solution is not touched.
    #[default]
    Single,
    /// The precision of the matrix.
    Double,
}

/// The settings of [`Multigrid`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MultigridSettings {
    /// The precision of the preconditioner.
    pub precision: Precision,
    /// The iterations after which multigrid is taken to have stalled, and the fallback goes on from
    /// there.
    pub max_iterations: usize,
    /// The vectors that the matrix takes to zero.
    pub null_space: NullSpace,
    /// Whether the matrix of one process is kept by its lower half, to 48 bits of each entry in
    /// single precision, so that a caller who lets go of it has half the memory.
    pub by_half: bool,
}

impl Default for MultigridSettings {
    /// Single precision, 100 iterations, a positive definite matrix.
    fn default() -> Self {
        Self {
            precision: Precision::Single,
            max_iterations: 100,
            null_space: NullSpace::Zero,
            by_half: false,
        }
    }
}

/// Conjugate gradients preconditioned by one V-cycle of algebraic multigrid: smoothed aggregation
/// of whole blocks (P. Vaněk, J. Mandel, M. Brezina 1996), one sweep of block Gauss–Seidel forwards
/// before and backwards after each coarser level, Cholesky on the coarsest.
///
/// The number of iterations hardly grows with the system. Where multigrid cannot be set up, or
/// stalls, or breaks down, the solve goes on with [`ConjugateGradients`], set up at that moment.
///
/// A semi-definite matrix is solved where its [`NullSpace`] is told
/// ([`MultigridSettings::null_space`]): the coarsest system, which has the same one, is made
/// definite by a little on its diagonal, and solved for what is orthogonal to it.
///
/// Number the unknowns well ([`reverse_cuthill_mckee`](super::reverse_cuthill_mckee)): the narrower
/// the matrix is about its diagonal, the more threads can be used.
///
/// # On several ranks
/// The matrix is the sum of the ranks', a right side too; a solution is the same, bit for bit, on
/// all ranks that have an entry. Each rank forms aggregates of its own rows. Couplings between
/// ranks count in the interpolation, in residuals and in all coarser matrices, which stay sums of
/// parts; a sweep of Gauss–Seidel goes through each rank's own rows with what the others had before
/// it (A. Baker, R. Falgout, T. Kolev, U. Yang 2011). The coarsest system is gathered, and solved
/// on every rank.
///
/// An aggregate lies on one rank; where ranks have few rows left, the system is gathered on all of
/// them and made coarser there, which is what bounds the number of ranks: to a few ten thousands.
/// Where there are more, or the parts are not connected in themselves, the solve is made with
/// [`ConjugateGradients`].
#[derive(Debug)]
pub struct Multigrid<const B: usize> {
    halo: Halo,
    matrix: Kept<B>,
    settings: MultigridSettings,
    levels: Arc<Levels<B>>,
    constants: Option<Arc<Constants>>,
    fallback: OnceLock<Result<ConjugateGradients<B>, LinearError>>,
    cancellation: Cancellation,
}

/// The matrix, as products need it.
#[derive(Debug)]
enum Kept<const B: usize> {
    Rows(Arc<SparseMatrix<B>>),
    /// By the half that the finest level has as well.
    Single(Symmetric<f32, B>),
    Double(Symmetric<f64, B>),
}

impl<const B: usize> Kept<B> {
    /// The matrix of this rank, by the half that its levels have where they do.
    fn new(matrix: Arc<SparseMatrix<B>>, levels: &Levels<B>) -> Self {
        let single = |half| Symmetric::new(half, &matrix).map(Self::Single);
        let double = |half| Symmetric::new(half, &matrix).map(Self::Double);
        let kept = match levels {
            Levels::Single(levels) => levels.lower().and_then(single),
            Levels::Double(levels) => levels.lower().and_then(double),
            Levels::Bodies(levels, _) => levels.lower().and_then(single),
            Levels::None => None,
        };
        kept.unwrap_or(Self::Rows(matrix))
    }

    fn has_pattern_of(&self, other: &SparseMatrix<B>) -> bool {
        match self {
            Self::Rows(matrix) => matrix.has_pattern_of(other),
            Self::Single(matrix) => matrix.has_pattern_of(other),
            Self::Double(matrix) => matrix.has_pattern_of(other),
        }
    }

    fn in_rows(&self) -> Arc<SparseMatrix<B>> {
        match self {
            Self::Rows(matrix) => Arc::clone(matrix),
            Self::Single(matrix) => Arc::new(matrix.whole()),
            Self::Double(matrix) => Arc::new(matrix.whole()),
        }
    }
}

impl<const B: usize> Matrix<B> for Kept<B> {
    fn rows(&self) -> usize {
        match self {
            Self::Rows(matrix) => matrix.rows(),
            Self::Single(matrix) => matrix.rows(),
            Self::Double(matrix) => matrix.rows(),
        }
    }

    fn multiply_columns<const K: usize>(
        &self,
        vector: &[Columns<B, K>],
        result: &mut [Columns<B, K>],
    ) {
        match self {
            Self::Rows(matrix) => matrix.multiply_columns(vector, result),
            Self::Single(matrix) => matrix.multiply_columns(vector, result),
            Self::Double(matrix) => matrix.multiply_columns(vector, result),
        }
    }
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
        Self::distributed(Halo::none(), matrix, settings)
    }

    /// A solver for the sum of the ranks' matrices, which is symmetric and positive definite; the
    /// rows are the entries of `halo`. Collective, as is its use.
    ///
    /// # Errors
    /// [`LinearError::Diagonal`]; [`LinearError::OtherRank`].
    pub fn distributed(
        halo: Halo,
        matrix: impl Into<Arc<SparseMatrix<B>>>,
        settings: MultigridSettings,
    ) -> Result<Self, LinearError> {
        let matrix = matrix.into();
        let null_space = settings.null_space;
        let levels = match settings.precision {
            Precision::Single => {
                Hierarchy::new(&matrix, &halo, null_space, None, None).map(Levels::Single)
            }
            Precision::Double => {
                Hierarchy::new(&matrix, &halo, null_space, None, None).map(Levels::Double)
            }
        };
        Self::with_levels(halo, matrix, settings, levels)
    }

    /// A solver for a symmetric positive definite matrix where each aggregate of unknowns may turn
    /// about its centre as well as shift: `positions` are where the vertices of the unknowns lie.
    /// An iteration costs up to twice as much; elastic bodies that are held at few places, or
    /// slide, need fewer of them.
    ///
    /// # Errors
    /// [`LinearError::Positions`], [`LinearError::Diagonal`].
    pub fn with_rigid_bodies(
        matrix: impl Into<Arc<SparseMatrix<B>>>,
        positions: impl Into<Arc<[Vector]>>,
        settings: MultigridSettings,
    ) -> Result<Self, LinearError> {
        let (matrix, positions, halo) = (matrix.into(), positions.into(), Halo::none());
        if B != 3 || positions.len() != matrix.rows() {
            return Err(LinearError::Positions {
                found: positions.len(),
                expected: matrix.rows(),
                block: B,
            });
        }
        let levels = Hierarchy::new(&matrix, &halo, settings.null_space, None, Some(&positions));
        let levels = levels.map(|levels| Levels::Bodies(Box::new(levels), positions));
        Self::with_levels(halo, matrix, settings, levels)
    }

    /// A solver for another matrix of the same rows; the aggregates are used again where that has
    /// its blocks at the same positions. Collective.
    ///
    /// # Errors
    /// As [`Multigrid::distributed`].
    pub fn of_like_matrix(&self, matrix: Arc<SparseMatrix<B>>) -> Result<Self, LinearError> {
        let same = self.halo.communicator().all(self.matrix.has_pattern_of(&matrix));
        let (halo, null_space) = (&self.halo, self.settings.null_space);
        let levels = match &*self.levels {
            Levels::Single(like) => {
                Hierarchy::new(&matrix, halo, null_space, same.then_some(like), None)
                    .map(Levels::Single)
            }
            Levels::Double(like) => {
                Hierarchy::new(&matrix, halo, null_space, same.then_some(like), None)
                    .map(Levels::Double)
            }
            Levels::Bodies(like, positions) => (positions.len() == matrix.rows())
                .then(|| {
                    Hierarchy::new(
                        &matrix,
                        halo,
                        null_space,
                        same.then_some(&**like),
                        Some(positions),
                    )
                })
                .flatten()
                .map(|levels| Levels::Bodies(Box::new(levels), Arc::clone(positions))),
            Levels::None => return Self::distributed(halo.clone(), matrix, self.settings),
        };
        Self::with_levels(halo.clone(), matrix, self.settings, levels)
    }

    /// A solver for a matrix that differs little from this one's, with the preconditioner of this
    /// one's: nothing is set up. The more they differ, the more iterations it takes.
    ///
    /// # Panics
    /// Where the matrix has another number of rows.
    #[must_use]
    pub fn of_similar_matrix(&self, matrix: Arc<SparseMatrix<B>>) -> Self {
        assert_eq!(matrix.rows(), self.matrix.rows(), "as many rows");
        Self {
            halo: self.halo.clone(),
            matrix: Kept::Rows(matrix),
            settings: self.settings,
            levels: Arc::clone(&self.levels),
            constants: self.constants.clone(),
            fallback: OnceLock::new(),
            cancellation: self.cancellation.clone(),
        }
    }

    /// The solver with what has a solve given up, which is looked at before each iteration.
    pub(crate) fn with_cancellation(self, cancellation: Cancellation) -> Self {
        let of_own = |own: ConjugateGradients<B>| own.with_cancellation(cancellation.clone());
        let fallback = self
            .fallback
            .into_inner()
            .map_or_else(OnceLock::new, |made| OnceLock::from(made.map(of_own)));
        Self { fallback, cancellation, ..self }
    }

    /// The matrix of this rank. Where it is kept by its half, which the levels need as well, it is
    /// made anew, to 48 bits of each entry.
    #[must_use]
    pub fn matrix(&self) -> Arc<SparseMatrix<B>> {
        self.matrix.in_rows()
    }

    /// `result` becomes the product of the sum with a vector that all ranks have the same of.
    /// Collective.
    pub fn multiply(&self, vector: &[[f64; B]], result: &mut [[f64; B]]) {
        self.sum().multiply(single_column(vector), single_column_mut(result));
    }

    /// Calls `work` with the preconditioner, an approximate inverse of the sum: from a vector that
    /// all ranks have the same of, to one that they do. `scale`, the same on all ranks, brings
    /// vectors to the order of 1. Collective, as the preconditioner is.
    pub fn with_cycle<R>(
        &self,
        scale: f64,
        work: impl FnOnce(&mut dyn FnMut(&[[f64; B]], &mut [[f64; B]])) -> R,
    ) -> R {
        match &*self.levels {
            Levels::Single(hierarchy) => cycle_of(hierarchy, scale, work),
            Levels::Double(hierarchy) => cycle_of(hierarchy, scale, work),
            Levels::Bodies(hierarchy, _) => cycle_of(hierarchy, scale, work),
            Levels::None => work(&mut |vector, result| {
                let applied = self
                    .fallback()
                    .and_then(|own| own.apply(Factorization::GaussSeidel, vector, result));
                if applied.is_err() {
                    result.fill([0.0; B]);
                }
            }),
        }
    }

    fn sum(&self) -> Sum<'_, Kept<B>, B> {
        Sum { matrix: &self.matrix, halo: &self.halo }
    }

    fn with_levels(
        halo: Halo,
        matrix: Arc<SparseMatrix<B>>,
        settings: MultigridSettings,
        levels: Option<Levels<B>>,
    ) -> Result<Self, LinearError> {
        let levels = Arc::new(levels.unwrap_or(Levels::None));
        let constants = match settings.null_space {
            NullSpace::Zero => None,
            NullSpace::Constants => Some(Arc::new(Constants::new(&matrix, &halo))),
        };
        let matrix = if settings.by_half { Kept::new(matrix, &levels) } else { Kept::Rows(matrix) };
        let (fallback, cancellation) = (OnceLock::new(), Cancellation::default());
        let solver = Self { halo, matrix, settings, levels, constants, fallback, cancellation };
        if matches!(*solver.levels, Levels::None) {
            solver.fallback()?;
        }
        Ok(solver)
    }

    fn fallback(&self) -> Result<&ConjugateGradients<B>, LinearError> {
        let made = || {
            ConjugateGradients::distributed(self.halo.clone(), self.matrix())
                .map(|own| own.with_cancellation(self.cancellation.clone()))
        };
        self.fallback.get_or_init(made).as_ref().map_err(|error| *error)
    }

    fn iterate<T: Real, const C: usize, const K: usize>(
        &self,
        hierarchy: &Hierarchy<T, B, C>,
        right_side: &[Columns<B, K>],
        solution: &mut [Columns<B, K>],
        tolerances: [Tolerance; K],
    ) -> Result<[Convergence; K], LinearError> {
        let mut workspace = hierarchy.workspace();
        let scale = self.sum().scale(right_side);
        let precondition = |vector: &[Columns<B, K>], result: &mut [Columns<B, K>]| {
            if self.cancellation.is_cancelled() {
                return Err(LinearError::Cancelled);
            }
            hierarchy.apply(&mut workspace, scale, vector, result);
            Ok(())
        };
        let limit = self.settings.max_iterations;
        conjugate_gradients(&self.sum(), precondition, right_side, solution, tolerances, limit)
    }

    fn solve_columns<const K: usize>(
        &self,
        right_side: &[Columns<B, K>],
        solution: &mut [Columns<B, K>],
        tolerances: [Tolerance; K],
    ) -> Result<[Convergence; K], LinearError> {
        let mut right_side = Cow::Borrowed(right_side);
        if self.halo.communicator().size() > 1 {
            self.sum().add_up(right_side.to_mut());
        }
        if let Some(constants) = &self.constants {
            constants.remove(&self.halo, right_side.to_mut());
        }
        let result = self.solve_consistent(&right_side, solution, tolerances)?;
        if let Some(constants) = &self.constants {
            constants.remove(&self.halo, solution);
        }
        Ok(result)
    }

    /// Solves for right sides that have a solution, and are the same on all ranks where these share
    /// rows.
    fn solve_consistent<const K: usize>(
        &self,
        right_side: &[Columns<B, K>],
        solution: &mut [Columns<B, K>],
        tolerances: [Tolerance; K],
    ) -> Result<[Convergence; K], LinearError> {
        let result = match &*self.levels {
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
        each_column(right_side, solution, |column, right_side, start| {
            if !self
                .halo
                .communicator()
                .all(start.as_flattened().iter().all(|value| value.is_finite()))
            {
                start.fill([0.0; B]);
            }
            let converged = fallback.iterate(right_side, start, tolerances[column])?;
            Ok(Convergence { iterations: converged.iterations + before, ..converged })
        })
    }
}

fn cycle_of<T: Real, const B: usize, const C: usize, R>(
    hierarchy: &Hierarchy<T, B, C>,
    scale: f64,
    work: impl FnOnce(&mut dyn FnMut(&[[f64; B]], &mut [[f64; B]])) -> R,
) -> R {
    let mut workspace = hierarchy.workspace();
    work(&mut |vector, result| {
        hierarchy.apply(&mut workspace, [scale], single_column(vector), single_column_mut(result));
    })
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
        if self.cancellation.is_cancelled() {
            return Err(LinearError::Cancelled);
        }
        Ok(Box::new(self.of_like_matrix(matrix)?.with_cancellation(self.cancellation.clone())))
    }
}
