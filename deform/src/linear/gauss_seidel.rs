//! Gauss–Seidel sweeps that give the same bits on any number of threads.

use std::sync::Arc;

use super::lower::Lower;
use super::matrix::invert_positive;
use super::pieces::{Around, Pieces};
use super::real::Real;
use super::{ROW_CHUNK, SparseMatrix};
use crate::parallel;

/// The sweeps of Gauss–Seidel through the first rows and columns of one symmetric matrix, in the
/// order of [`Pieces`]: first through all even pieces, then through all odd ones, or back. Each
/// reads every block once.
#[derive(Debug)]
pub(super) struct GaussSeidel<T, const B: usize> {
    lower: Arc<Lower<T, B>>,
    inverse_diagonal: Vec<[[T; B]; B]>,
}

/// The vectors of a sweep with `K` right sides.
pub(super) struct Sweep<'a, T, const B: usize, const K: usize> {
    pub(super) right_side: &'a [[[T; B]; K]],
    pub(super) solution: &'a mut [[[T; B]; K]],
    /// The residual after a sweep forwards; after one backwards of no use.
    pub(super) residual: &'a mut [[[T; B]; K]],
    /// Memory for [`Pieces::odd_rows`].
    pub(super) beside: &'a mut [[[T; B]; K]],
}

impl<T: Real, const B: usize> GaussSeidel<T, B> {
    /// The rows and columns of `pieces`, with what is `added` to the diagonal of each, if anything
    /// is. `None` where a diagonal block is missing, or not positive definite, or has no inverse in
    /// this precision.
    pub(super) fn new(
        matrix: &SparseMatrix<B>,
        pieces: Pieces,
        added: &[[f64; B]],
    ) -> Option<Self> {
        let inverse_diagonal = parallel::map_chunks(pieces.rows(), ROW_CHUNK, |range| {
            let invert = |row: usize| {
                let mut block = matrix.diagonal(row)?;
                for (axis, more) in added.get(row).into_iter().flatten().enumerate() {
                    block[axis][axis] += more;
                }
                let inverse = invert_positive(&block)?.map(|entries| entries.map(T::of));
                inverse
                    .as_flattened()
                    .iter()
                    .all(|value| value.wide().is_finite())
                    .then_some(inverse)
            };
            range.map(invert).collect::<Option<Vec<_>>>()
        });
        Some(Self {
            lower: Arc::new(Lower::new(matrix, pieces)?),
            inverse_diagonal: inverse_diagonal.into_iter().collect::<Option<Vec<_>>>()?.concat(),
        })
    }

    /// The half of the matrix that is swept through.
    pub(super) fn lower(&self) -> &Arc<Lower<T, B>> {
        &self.lower
    }

    /// One sweep forwards from zero.
    pub(super) fn forward<const K: usize>(&self, sweep: Sweep<'_, T, B, K>) {
        let Sweep { right_side, solution, residual, beside } = sweep;
        let pieces = self.lower.pieces();
        let (mut even, odd) = pieces.halves_mut(solution);
        let (mut even_sums, odd_sums) = pieces.halves_mut(residual);
        let work = |first: usize, own: &mut [[[T; B]; K]], mut around: Around<'_, [[T; B]; K]>| {
            for index in 0..own.len() {
                let row = first + index;
                let sum = self.lower.product(self.lower.entries(), row, first, own, &around);
                own[index] = self.divide(row, &right_side[row], &sum);
                around.sums[index] = [[T::default(); B]; K];
                // What is left of the right side is what the columns before the row have not seen.
                let value = own[index].map(|column| column.map(|value| -value));
                self.lower.add_transposed(self.lower.entries(), row, first, &value, &mut around);
            }
        };
        pieces.through_even(even.iter_mut().map(|own| &mut **own), &mut even_sums, work);
        pieces.through_odd(&even, odd, &mut even_sums, odd_sums, beside, work);
    }

    /// One sweep backwards from what the solution holds.
    pub(super) fn backward<const K: usize>(&self, sweep: Sweep<'_, T, B, K>) {
        let Sweep { right_side, solution, residual, beside } = sweep;
        parallel::for_each_chunk(residual, ROW_CHUNK, |_, part| {
            part.fill([[T::default(); B]; K]);
        });
        let pieces = self.lower.pieces();
        let (even, odd) = pieces.halves_mut(solution);
        let (mut even_sums, odd_sums) = pieces.halves_mut(residual);
        let work = |first: usize, own: &mut [[[T; B]; K]], mut around: Around<'_, [[T; B]; K]>| {
            for index in (0..own.len()).rev() {
                let row = first + index;
                let mut sum = self.lower.product(self.lower.entries(), row, first, own, &around);
                for (sum, more) in sum.iter_mut().zip(&around.sums[index]) {
                    sum.iter_mut().zip(more).for_each(|(sum, &more)| *sum += more);
                }
                own[index] = self.divide(row, &right_side[row], &sum);
                self.lower.add_transposed(
                    self.lower.entries(),
                    row,
                    first,
                    &own[index],
                    &mut around,
                );
            }
        };
        pieces.through_odd(&even, odd, &mut even_sums, odd_sums, beside, work);
        pieces.through_even(even, &mut even_sums, work);
    }

    /// `D⁻¹ (right - sum)`.
    #[inline(always)]
    fn divide<const K: usize>(
        &self,
        row: usize,
        right: &[[T; B]; K],
        sum: &[[T; B]; K],
    ) -> [[T; B]; K] {
        let mut result = [[T::default(); B]; K];
        let inverse = &self.inverse_diagonal[row];
        for column in 0..K {
            for (j, inverse) in inverse.iter().enumerate() {
                let rest = right[column][j] - sum[column][j];
                for (total, &entry) in result[column].iter_mut().zip(inverse) {
                    *total += entry * rest;
                }
            }
        }
        result
    }
}
