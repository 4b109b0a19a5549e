//! Direct solves by a sparse Cholesky factorisation.

use std::sync::Arc;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::cholesky::{self, LltRef, SymbolicCholesky, SymmetricOrdering};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, Mat, Par, Side};

use super::iteration::{conjugate_gradients, single_column, single_column_mut};
use super::{Convergence, LinearError, LinearSolver, SparseMatrix, Tolerance};

/// Iterations that refine what the factor gives; one is enough unless the matrix is close to singular.
const REFINEMENTS: usize = 50;

/// The sparse Cholesky factorisation of a symmetric positive definite matrix (faer's, with an approximate minimum degree
/// ordering).
///
/// The quickest choice for small systems: its set-up grows faster than the system. A solution that rounding keeps above the
/// tolerance is refined by conjugate gradients with the factor as preconditioner.
#[derive(Debug)]
pub struct Cholesky<const B: usize> {
    matrix: Arc<SparseMatrix<B>>,
    factor: Factor<B>,
}

impl<const B: usize> Cholesky<B> {
    /// Factors a matrix.
    ///
    /// # Errors
    /// [`LinearError::Factor`] where it is not positive definite to rounding, or its factor does not fit in memory.
    pub fn new(matrix: impl Into<Arc<SparseMatrix<B>>>) -> Result<Self, LinearError> {
        let matrix = matrix.into();
        let factor = Factor::new(&matrix).ok_or(LinearError::Factor)?;
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
            self.factor.solve(vector, result)
        };
        let (right_side, solution) = (single_column(right_side), single_column_mut(solution));
        let [mut convergence] = conjugate_gradients(
            &*self.matrix,
            apply,
            right_side,
            solution,
            [tolerance],
            REFINEMENTS,
        )?;
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

/// A factor without its matrix.
#[derive(Debug)]
pub(super) struct Factor<const B: usize> {
    /// `None` for a matrix without rows.
    factor: Option<(SymbolicCholesky<u32>, Vec<f64>)>,
}

impl<const B: usize> Factor<B> {
    /// `None` where the matrix is not positive definite or its factor does not fit in memory.
    pub(super) fn new(matrix: &SparseMatrix<B>) -> Option<Self> {
        if matrix.rows() == 0 {
            return Some(Self { factor: None });
        }
        // A symmetric matrix: the upper triangle by columns is the lower one by rows.
        let size = B * matrix.rows();
        u32::try_from(size).ok()?;
        let mut starts = Vec::with_capacity(size + 1);
        let (mut rows, mut values) = (Vec::new(), Vec::new());
        starts.push(0u32);
        for row in 0..matrix.rows() {
            let (columns, blocks) = matrix.row(row);
            for axis in 0..B {
                for (&column, block) in
                    columns.iter().zip(blocks).take_while(|(column, _)| **column as usize <= row)
                {
                    let count = if column as usize == row { axis + 1 } else { B };
                    for (other, &value) in block[axis].iter().enumerate().take(count) {
                        rows.push(u32::try_from(B * column as usize + other).ok()?);
                        values.push(value);
                    }
                }
                starts.push(u32::try_from(i32::try_from(rows.len()).ok()?).ok()?);
            }
        }
        let pattern = SymbolicSparseColMatRef::new_checked(size, size, &starts, None, &rows);
        let symbolic = cholesky::factorize_symbolic_cholesky(
            pattern,
            Side::Upper,
            SymmetricOrdering::Amd,
            cholesky::CholeskySymbolicParams::default(),
        )
        .ok()?;
        let mut factor = Vec::new();
        factor.try_reserve_exact(symbolic.len_val()).ok()?;
        factor.resize(symbolic.len_val(), 0.0);
        let scratch =
            symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, faer::Spec::default());
        let mut memory = MemBuffer::try_new(scratch).ok()?;
        symbolic
            .factorize_numeric_llt(
                &mut factor,
                SparseColMatRef::new(pattern, &values),
                Side::Upper,
                faer::linalg::cholesky::llt::factor::LltRegularization::default(),
                Par::Seq,
                MemStack::new(&mut memory),
                faer::Spec::default(),
            )
            .ok()?;
        factor
            .iter()
            .all(|value| value.is_finite())
            .then_some(Self { factor: Some((symbolic, factor)) })
    }

    /// `result = A⁻¹ vector` for `K` right sides side by side.
    pub(super) fn solve<const K: usize>(
        &self,
        vector: &[[[f64; B]; K]],
        result: &mut [[[f64; B]; K]],
    ) {
        let Some((symbolic, factor)) = &self.factor else { return };
        let mut sides =
            Mat::from_fn(B * vector.len(), K, |row, side| vector[row / B][side][row % B]);
        let scratch = symbolic.solve_in_place_scratch::<f64>(K, Par::Seq);
        LltRef::new(symbolic, factor).solve_in_place_with_conj(
            Conj::No,
            sides.as_mut(),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
        );
        for (row, value) in result.iter_mut().enumerate() {
            *value = std::array::from_fn(|side| {
                std::array::from_fn(|axis| sides[(B * row + axis, side)])
            });
        }
    }
}
