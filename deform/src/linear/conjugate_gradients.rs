//! Preconditioned conjugate gradients.

use std::sync::OnceLock;

use super::{
    BlockPreconditioner, Convergence, Factorization, LinearError, LinearSolver, ROW_CHUNK, SparseMatrix, Tolerance,
};
use crate::parallel;

/// Conjugate gradients (Hestenes, Stiefel 1952) preconditioned by a [`BlockPreconditioner`].
///
/// It starts with incomplete Cholesky. Should that not converge, as can happen on a nearly degenerate mesh, the solve is made
/// again with symmetric Gauss–Seidel before it is given up.
#[derive(Debug)]
pub struct ConjugateGradients<const B: usize> {
    matrix: SparseMatrix<B>,
    preconditioner: BlockPreconditioner<B>,
    fallback: OnceLock<Result<BlockPreconditioner<B>, LinearError>>,
    max_iterations: usize,
}

impl<const B: usize> ConjugateGradients<B> {
    /// A solver for a symmetric positive definite matrix.
    ///
    /// # Errors
    /// [`LinearError::Diagonal`].
    pub fn new(matrix: SparseMatrix<B>) -> Result<Self, LinearError> {
        let preconditioner = BlockPreconditioner::new(&matrix, Factorization::IncompleteCholesky)?;
        Ok(Self { matrix, preconditioner, fallback: OnceLock::new(), max_iterations: 2000 })
    }

    /// The same with another limit of iterations for each preconditioner; 2000 otherwise.
    #[must_use]
    pub fn with_max_iterations(self, max_iterations: usize) -> Self {
        Self { max_iterations, ..self }
    }

    /// The matrix.
    #[must_use]
    pub fn matrix(&self) -> &SparseMatrix<B> {
        &self.matrix
    }

    fn iterate(
        &self,
        preconditioner: &BlockPreconditioner<B>,
        right_side: &[[f64; B]],
        solution: &mut [[f64; B]],
        tolerance: Tolerance,
    ) -> Result<Convergence, LinearError> {
        solution.fill([0.0; B]);
        let whole = norm(right_side);
        if !whole.is_finite() {
            return Err(LinearError::NotFinite { iteration: 0 });
        }
        let target = (tolerance.relative * whole).max(tolerance.absolute);
        let relative = |residual: f64| if whole > 0.0 { residual / whole } else { 0.0 };
        if whole <= target {
            return Ok(Convergence { iterations: 0, residual: relative(whole) });
        }
        let mut residual = right_side.to_vec();
        let mut preconditioned = vec![[0.0; B]; residual.len()];
        preconditioner.apply(&residual, &mut preconditioned);
        let mut direction = preconditioned.clone();
        let mut image = vec![[0.0; B]; residual.len()];
        let mut energy = dot(&residual, &preconditioned);
        let mut reached = whole;
        for iteration in 1..=self.max_iterations {
            self.matrix.multiply(&direction, &mut image);
            let curvature = dot(&direction, &image);
            if !(curvature.is_finite() && energy.is_finite()) {
                return Err(LinearError::NotFinite { iteration });
            }
            if curvature <= 0.0 || energy <= 0.0 {
                return Err(LinearError::Indefinite { iteration, curvature: curvature.min(energy) });
            }
            let step = energy / curvature;
            add_multiple(solution, step, &direction);
            add_multiple(&mut residual, -step, &image);
            reached = norm(&residual);
            if reached <= target {
                return Ok(Convergence { iterations: iteration, residual: relative(reached) });
            }
            preconditioner.apply(&residual, &mut preconditioned);
            let energy_before = std::mem::replace(&mut energy, dot(&residual, &preconditioned));
            let factor = energy / energy_before;
            parallel::for_each_chunk(&mut direction, ROW_CHUNK, |chunk, part| {
                for (value, new) in part.iter_mut().zip(&preconditioned[chunk * ROW_CHUNK..]) {
                    *value = std::array::from_fn(|axis| new[axis] + factor * value[axis]);
                }
            });
        }
        Err(LinearError::NotConverged {
            iterations: self.max_iterations,
            residual: relative(reached),
            tolerance: relative(target),
        })
    }
}

impl<const B: usize> LinearSolver<B> for ConjugateGradients<B> {
    fn unknowns(&self) -> usize {
        self.matrix.rows()
    }

    fn solve(
        &self,
        right_side: &[[f64; B]],
        solution: &mut [[f64; B]],
        tolerance: Tolerance,
    ) -> Result<Convergence, LinearError> {
        match self.iterate(&self.preconditioner, right_side, solution, tolerance) {
            Err(LinearError::NotConverged { .. } | LinearError::Indefinite { .. }) => {
                let fallback = self
                    .fallback
                    .get_or_init(|| BlockPreconditioner::new(&self.matrix, Factorization::GaussSeidel))
                    .as_ref()
                    .map_err(|error| *error)?;
                self.iterate(fallback, right_side, solution, tolerance)
            }
            other => other,
        }
    }
}

/// The 2-norm.
pub(crate) fn norm<const B: usize>(vector: &[[f64; B]]) -> f64 {
    dot(vector, vector).sqrt()
}

/// The inner product, summed chunk by chunk.
fn dot<const B: usize>(a: &[[f64; B]], b: &[[f64; B]]) -> f64 {
    parallel::map_chunks(a.len(), ROW_CHUNK, |range| {
        let (a, b) = (a[range.clone()].as_flattened(), b[range].as_flattened());
        // Four sums side by side, so that one need not wait for another.
        let mut sums = [0.0; 4];
        let (chunks_a, chunks_b) = (a.chunks_exact(4), b.chunks_exact(4));
        let rest: f64 = chunks_a.remainder().iter().zip(chunks_b.remainder()).map(|(a, b)| a * b).sum();
        for (a, b) in chunks_a.zip(chunks_b) {
            for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
                *sum += a * b;
            }
        }
        (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
    })
    .into_iter()
    .sum()
}

fn add_multiple<const B: usize>(target: &mut [[f64; B]], factor: f64, vector: &[[f64; B]]) {
    parallel::for_each_chunk(target, ROW_CHUNK, |chunk, part| {
        for (value, change) in part.iter_mut().zip(&vector[chunk * ROW_CHUNK..]) {
            for (value, change) in value.iter_mut().zip(change) {
                *value += factor * change;
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The Laplacian of a chain with its ends held, `-u'' = 1`: the solution is a parabola.
    fn chain(count: u32, off: f64) -> SparseMatrix<1> {
        let rows: Vec<Vec<u32>> = (0..count).map(|i| (i.saturating_sub(1)..(i + 2).min(count)).collect()).collect();
        let offsets = std::iter::once(0)
            .chain(rows.iter().scan(0, |sum, row| {
                *sum += row.len();
                Some(*sum)
            }))
            .collect();
        let mut matrix = SparseMatrix::zeros(offsets, rows.concat());
        let diagonal: Vec<bool> =
            rows.iter().enumerate().flat_map(|(i, row)| row.iter().map(move |&j| j as usize == i)).collect();
        for (value, diagonal) in matrix.offsets_and_values_mut().2.iter_mut().zip(diagonal) {
            *value = [[if diagonal { 2.0 } else { off }]];
        }
        matrix
    }

    const TIGHT: Tolerance = Tolerance { relative: 1e-12, absolute: 0.0 };

    #[test]
    fn solves_a_chain_over_several_pieces() {
        let count = 5000;
        let solver = ConjugateGradients::new(chain(count, -1.0)).unwrap().with_max_iterations(20_000);
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
        assert!(matches!(indefinite.solve(&ones, &mut solution, TIGHT), Err(LinearError::Indefinite { .. })));
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
        assert_eq!(solver.solve(&bad, &mut solution, TIGHT), Err(LinearError::NotFinite { iteration: 0 }));
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
