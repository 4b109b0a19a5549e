//! Preconditioned conjugate gradients.

use std::borrow::Cow;
use std::sync::{Arc, OnceLock};

use super::iteration::{Columns, Sum, conjugate_gradients, single_column, single_column_mut};
use super::{
    BlockPreconditioner, Convergence, Factorization, LinearError, LinearSolver, SparseMatrix,
    Tolerance,
};
use crate::cancellation::Cancellation;
use crate::communicator::{Communicator, Halo};

/// Conjugate gradients (Hestenes, Stiefel 1952) preconditioned by a [`BlockPreconditioner`].
///
/// It starts with incomplete Cholesky. Should that not converge, as can happen on a nearly
/// degenerate mesh, the solve is made again with symmetric Gauss–Seidel before it is given up.
#[derive(Debug)]
pub struct ConjugateGradients<const B: usize> {
    halo: Halo,
    matrix: Arc<SparseMatrix<B>>,
    first: OnceLock<Prepared<B>>,
    fallback: OnceLock<Prepared<B>>,
    max_iterations: usize,
    cancellation: Cancellation,
}

/// A preconditioner, on a rank that has rows; or why there is none on any.
type Prepared<const B: usize> = Result<Option<BlockPreconditioner<B>>, LinearError>;

impl<const B: usize> ConjugateGradients<B> {
    /// A solver for a symmetric positive definite matrix.
    ///
    /// # Errors
    /// [`LinearError::Diagonal`].
    pub fn new(matrix: impl Into<Arc<SparseMatrix<B>>>) -> Result<Self, LinearError> {
        Self::distributed(Halo::none(), matrix)
    }

    /// A solver for the sum of the ranks' matrices, whose rows are the entries of `halo`. Each rank
    /// preconditions with its own part. Collective.
    ///
    /// # Errors
    /// [`LinearError::Diagonal`]; [`LinearError::OtherRank`].
    pub fn distributed(
        halo: Halo,
        matrix: impl Into<Arc<SparseMatrix<B>>>,
    ) -> Result<Self, LinearError> {
        let matrix = matrix.into();
        let [first, fallback] = [const { OnceLock::new() }; 2];
        let (max_iterations, cancellation) = (2000, Cancellation::default());
        let solver = Self { halo, matrix, first, fallback, max_iterations, cancellation };
        solver.preconditioner(Factorization::IncompleteCholesky)?;
        Ok(solver)
    }

    /// The solver with another limit of iterations for each preconditioner; 2000 otherwise.
    #[must_use]
    pub fn with_max_iterations(self, max_iterations: usize) -> Self {
        Self { max_iterations, ..self }
    }

    /// The solver with what has a solve given up, which is looked at before each iteration.
    pub(crate) fn with_cancellation(self, cancellation: Cancellation) -> Self {
        Self { cancellation, ..self }
    }

    /// The matrix of this rank.
    #[must_use]
    pub fn matrix(&self) -> &SparseMatrix<B> {
        &self.matrix
    }

    fn sum(&self) -> Sum<'_, SparseMatrix<B>, B> {
        Sum { matrix: &self.matrix, halo: &self.halo }
    }

    /// A preconditioner of each rank's own matrix, whose diagonal at shared rows is that of the
    /// sum. Collective.
    fn preconditioner(
        &self,
        kind: Factorization,
    ) -> Result<Option<&BlockPreconditioner<B>>, LinearError> {
        let kept = if kind == Factorization::GaussSeidel { &self.fallback } else { &self.first };
        let found = kept.get_or_init(|| {
            let matrix = self.with_whole_diagonal();
            let found =
                (matrix.rows() > 0).then(|| BlockPreconditioner::new(&matrix, kind)).transpose();
            match (self.halo.communicator().all(found.is_ok()), found) {
                (false, Ok(_)) => Err(LinearError::OtherRank),
                (_, found) => found,
            }
        });
        found.as_ref().map(Option::as_ref).map_err(|error| *error)
    }

    fn with_whole_diagonal(&self) -> Cow<'_, SparseMatrix<B>> {
        let (matrix, shared) = (&*self.matrix, self.halo.shared());
        if self.halo.communicator().size() == 1 {
            return Cow::Borrowed(matrix);
        }
        let position = |row: u32| {
            let (columns, _) = matrix.row(row as usize);
            columns.binary_search(&row).ok().map(|found| matrix.offsets()[row as usize] + found)
        };
        let mut diagonal = vec![[[0.0; B]; B]; matrix.rows()];
        for &row in shared {
            diagonal[row as usize] =
                position(row).map_or([[0.0; B]; B], |found| matrix.values()[found]);
        }
        self.halo.sum(B * B, diagonal.as_flattened_mut().as_flattened_mut());
        let mut whole = matrix.clone();
        let (_, _, values) = whole.offsets_and_values_mut();
        for &row in shared {
            if let Some(found) = position(row) {
                values[found] = diagonal[row as usize];
            }
        }
        Cow::Owned(whole)
    }

    /// `result` becomes what the ranks' preconditioners make of a vector, added up. Collective.
    pub(super) fn apply(
        &self,
        kind: Factorization,
        vector: &[[f64; B]],
        result: &mut [[f64; B]],
    ) -> Result<(), LinearError> {
        match self.preconditioner(kind)? {
            Some(preconditioner) => preconditioner.apply(vector, result),
            None => result.fill([0.0; B]),
        }
        self.sum().add_up(single_column_mut(result));
        Ok(())
    }

    /// Solves from what `solution` holds. The right side is the same on all ranks where these share
    /// rows.
    pub(super) fn iterate(
        &self,
        right_side: &[[f64; B]],
        solution: &mut [[f64; B]],
        tolerance: Tolerance,
    ) -> Result<Convergence, LinearError> {
        let mut iterate = |kind| {
            self.preconditioner(kind)?;
            let apply = |vector: &[Columns<B, 1>], result: &mut [Columns<B, 1>]| {
                if self.cancellation.is_cancelled() {
                    return Err(LinearError::Cancelled);
                }
                // That it can be made was seen above.
                let _ = self.apply(kind, vector.as_flattened(), result.as_flattened_mut());
                Ok(())
            };
            let (right_side, solution) = (single_column(right_side), single_column_mut(solution));
            let [convergence] = conjugate_gradients(
                &self.sum(),
                apply,
                right_side,
                solution,
                [tolerance],
                self.max_iterations,
            )?;
            Ok(convergence)
        };
        match iterate(Factorization::IncompleteCholesky) {
            Err(LinearError::NotConverged { .. } | LinearError::Indefinite { .. }) => {
                iterate(Factorization::GaussSeidel)
            }
            other => other,
        }
    }
}

impl<const B: usize> LinearSolver<B> for ConjugateGradients<B> {
    fn unknowns(&self) -> usize {
        self.matrix.rows()
    }

    fn solve_from(
        &self,
        right_side: &[[f64; B]],
        solution: &mut [[f64; B]],
        tolerance: Tolerance,
    ) -> Result<Convergence, LinearError> {
        if self.halo.communicator().size() == 1 {
            return self.iterate(right_side, solution, tolerance);
        }
        let mut whole = right_side.to_vec();
        self.sum().add_up(single_column_mut(&mut whole));
        self.iterate(&whole, solution, tolerance)
    }

    fn renewed(
        &self,
        matrix: Arc<SparseMatrix<B>>,
    ) -> Result<Box<dyn LinearSolver<B>>, LinearError> {
        Ok(Box::new(
            Self::distributed(self.halo.clone(), matrix)?
                .with_max_iterations(self.max_iterations)
                .with_cancellation(self.cancellation.clone()),
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The Laplacian of a chain with its ends held, `-u'' = 1`: the solution is a parabola.
    fn chain(count: u32, off: f64) -> SparseMatrix<1> {
        let rows: Vec<Vec<u32>> =
            (0..count).map(|i| (i.saturating_sub(1)..(i + 2).min(count)).collect()).collect();
        let offsets = std::iter::once(0)
            .chain(rows.iter().scan(0, |sum, row| {
                *sum += row.len();
                Some(*sum)
            }))
            .collect();
        let mut matrix = SparseMatrix::zeros(offsets, rows.concat());
        let diagonal: Vec<bool> = rows
            .iter()
            .enumerate()
            .flat_map(|(i, row)| row.iter().map(move |&j| j as usize == i))
            .collect();
        for (value, diagonal) in matrix.offsets_and_values_mut().2.iter_mut().zip(diagonal) {
            *value = [[if diagonal { 2.0 } else { off }]];
        }
        matrix
    }

    const TIGHT: Tolerance = Tolerance { relative: 1e-12, absolute: 0.0 };

    #[test]
    fn solves_a_chain_over_several_pieces() {
        let count = 5000;
        let solver =
            ConjugateGradients::new(chain(count, -1.0)).unwrap().with_max_iterations(20_000);
        let mut solution = vec![[0.0]; count as usize];
        let convergence = solver.solve(&vec![[1.0]; count as usize], &mut solution, TIGHT).unwrap();
        for (i, value) in solution.iter().enumerate() {
            let exact = 0.5 * (i as f64 + 1.0) * (f64::from(count) - i as f64);
            assert!((value[0] - exact).abs() < 1e-6 * exact, "{i}: {} {exact}", value[0]);
        }
        assert!(convergence.residual <= 1e-12 && convergence.iterations < 60, "{convergence:?}");
    }

    #[test]
    fn failures_are_told_apart() {
        let mut solution = vec![[0.0]; 50];
        let ones = vec![[1.0]; 50];
        let indefinite = ConjugateGradients::new(chain(50, -1.5)).unwrap();
        assert!(matches!(
            indefinite.solve(&ones, &mut solution, TIGHT),
            Err(LinearError::Indefinite { .. })
        ));
        let short = ConjugateGradients::new(chain(5000, -1.0)).unwrap().with_max_iterations(2);
        let mut long = vec![[0.0]; 5000];
        let error = short.solve(&vec![[1.0]; 5000], &mut long, TIGHT).unwrap_err();
        assert!(
            matches!(error, LinearError::NotConverged { iterations: 2, residual, .. } if residual > 0.0),
            "{error}"
        );
        let solver = ConjugateGradients::new(chain(50, -1.0)).unwrap();
        let mut bad = ones;
        bad[7][0] = f64::NAN;
        assert_eq!(
            solver.solve(&bad, &mut solution, TIGHT),
            Err(LinearError::NotFinite { iteration: 0 })
        );
    }

    #[test]
    fn zero_gives_exact_zero() {
        let solver = ConjugateGradients::new(chain(50, -1.0)).unwrap();
        let mut solution = vec![[1.0]; 50];
        let convergence = solver.solve(&vec![[0.0]; 50], &mut solution, TIGHT).unwrap();
        assert_eq!(convergence, Convergence::default());
        assert!(solution.iter().all(|value| value[0].to_bits() == 0));
    }
}
