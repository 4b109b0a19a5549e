//! Gauss–Seidel sweeps that give the same bits on any number of threads.

use std::ops::Range;

use super::matrix::invert_positive;
use super::real::Real;
use super::rows::{Rows, Run};
use super::{ROW_CHUNK, SparseMatrix};
use crate::parallel;

/// Rows are cut into at most this many pieces. Half of it bounds the threads that one sweep can
/// use.
const PIECES: usize = 32;

/// A piece has at least this many rows.
const PIECE_ROWS: usize = 256;

/// Rows cut into pieces at least as long as the matrix is wide about its diagonal, so that no piece
/// couples with any but the ones beside it. Those with even numbers are placed before those with
/// odd numbers.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pieces {
    rows: usize,
    piece_rows: usize,
    even_rows: usize,
}

impl Pieces {
    /// The pieces of the first `rows` rows and columns of a matrix.
    pub(super) fn new<const B: usize>(matrix: &SparseMatrix<B>, rows: usize) -> Self {
        let width = |row: usize| {
            let columns = among(matrix, row, rows);
            let first = columns.first().map_or(0, |&column| row.saturating_sub(column as usize));
            columns.last().map_or(0, |&column| (column as usize).saturating_sub(row)).max(first)
        };
        let width = (0..rows).map(width).max().unwrap_or(0);
        let piece_rows = rows.div_ceil(PIECES).max(PIECE_ROWS).max(width);
        let whole = rows / piece_rows;
        let rest = rows % piece_rows;
        let even_rows =
            whole.div_ceil(2) * piece_rows + if whole.is_multiple_of(2) { rest } else { 0 };
        Self { rows, piece_rows, even_rows }
    }

    /// One piece.
    pub(super) fn whole(rows: usize) -> Self {
        Self { rows, piece_rows: rows.max(1), even_rows: rows }
    }

    /// Whether a row is in an odd piece, and which of those rows it is.
    fn half_and_index(&self, row: usize) -> (bool, usize) {
        let piece = row / self.piece_rows;
        (piece % 2 == 1, piece / 2 * self.piece_rows + row % self.piece_rows)
    }

    /// Where a row is placed. Rows after those of the pieces stay where they are.
    pub(super) fn slot(&self, row: usize) -> usize {
        if row >= self.rows {
            return row;
        }
        let (odd, index) = self.half_and_index(row);
        if odd { self.even_rows + index } else { index }
    }

    /// The row that is placed there.
    pub(super) fn row(&self, slot: usize) -> usize {
        if slot >= self.rows {
            return slot;
        }
        let (odd, index) =
            if slot < self.even_rows { (0, slot) } else { (1, slot - self.even_rows) };
        (2 * (index / self.piece_rows) + odd) * self.piece_rows + index % self.piece_rows
    }

    /// Calls `copy` with each run of rows, and of the slots where they are placed.
    pub(super) fn for_each_run(
        &self,
        mut copy: impl FnMut(std::ops::Range<usize>, std::ops::Range<usize>),
    ) {
        for start in (0..self.rows).step_by(self.piece_rows) {
            let count = self.piece_rows.min(self.rows - start);
            let slot = self.slot(start);
            copy(start..start + count, slot..slot + count);
        }
    }

    pub(super) fn rows(&self) -> usize {
        self.rows
    }
}

/// The columns of a row that are below `count`.
fn among<const B: usize>(matrix: &SparseMatrix<B>, row: usize, count: usize) -> &[u32] {
    let columns = matrix.row(row).0;
    // Most rows have no others.
    match columns.last() {
        Some(&last) if last as usize >= count => {
            &columns[..columns.partition_point(|&column| (column as usize) < count)]
        }
        _ => columns,
    }
}

/// The sweeps of Gauss–Seidel through the first rows and columns of one matrix, in the order of
/// [`Pieces`]: first through all even pieces, then through all odd ones, or back.
#[derive(Debug)]
pub(super) struct GaussSeidel<T, const B: usize> {
    pieces: Pieces,
    even: Half<T, B>,
    odd: Half<T, B>,
}

/// The rows of all even or all odd pieces.
#[derive(Debug)]
struct Half<T, const B: usize> {
    /// Columns of the same half, before and after the diagonal.
    lower: Rows<T, B>,
    upper: Rows<T, B>,
    /// Columns of the other half.
    cross: Rows<T, B>,
    inverse_diagonal: Vec<[[T; B]; B]>,
}

/// The blocks of one row.
struct RowRuns {
    /// Of its own piece, before and after the diagonal.
    lower: Run,
    upper: Run,
    /// Of the pieces before and after it.
    cross: [Run; 2],
}

impl RowRuns {
    /// The blocks of the row in a slot, which is the one of number `index` in its half.
    fn new<const B: usize>(
        matrix: &SparseMatrix<B>,
        pieces: Pieces,
        slot: usize,
        index: usize,
    ) -> Self {
        let row = pieces.row(slot);
        let piece = row / pieces.piece_rows;
        let own = piece * pieces.piece_rows;
        let (first, columns) = (matrix.offsets()[row], among(matrix, row, pieces.rows));
        let below =
            |bound: usize| first + columns.partition_point(|&column| (column as usize) < bound);
        let (begin, middle, end) = (below(own), below(row), below(own + pieces.piece_rows));
        let after = middle
            + usize::from(
                columns.get(middle - first).is_some_and(|&column| column as usize == row),
            );
        // Wrapping, as the shift is where it is added.
        let run = |indices: Range<usize>, from: usize, to: usize| Run {
            indices,
            shift: to.wrapping_sub(from) as u32,
        };
        // No piece couples with any but the ones beside it.
        let beside = |piece: usize| (piece * pieces.piece_rows, piece / 2 * pieces.piece_rows);
        let ((before, before_index), (next, next_index)) =
            (beside(piece.saturating_sub(1)), beside(piece + 1));
        Self {
            lower: run(begin..middle, row, index),
            upper: run(after..end, row, index),
            cross: [
                run(first..begin, before, before_index),
                run(end..first + columns.len(), next, next_index),
            ],
        }
    }
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
        let half = |odd: bool| {
            let slots = if odd { pieces.even_rows..pieces.rows } else { 0..pieces.even_rows };
            let (start, count) = (slots.start, slots.len());
            let runs = |index: usize| RowRuns::new(matrix, pieces, start + index, index);
            let inverse_diagonal = parallel::map_chunks(count, ROW_CHUNK, |range| {
                let invert = |index: usize| {
                    let row = pieces.row(start + index);
                    let (columns, blocks) = matrix.row(row);
                    let diagonal =
                        columns.binary_search_by_key(&row, |&column| column as usize).ok()?;
                    let mut block = blocks[diagonal];
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
            Some(Half {
                lower: Rows::new(matrix, count, |index| [runs(index).lower, Run::default()]),
                upper: Rows::new(matrix, count, |index| [runs(index).upper, Run::default()]),
                cross: Rows::new(matrix, count, |index| runs(index).cross),
                inverse_diagonal: inverse_diagonal
                    .into_iter()
                    .collect::<Option<Vec<_>>>()?
                    .concat(),
            })
        };
        Some(Self { pieces, even: half(false)?, odd: half(true)? })
    }

    /// One sweep forwards from zero.
    pub(super) fn forward<const K: usize>(
        &self,
        right_side: &[[[T; B]; K]],
        solution: &mut [[[T; B]; K]],
    ) {
        let size = self.pieces.piece_rows;
        let (even_right, odd_right) = right_side.split_at(self.pieces.even_rows);
        let (even, odd) = solution.split_at_mut(self.pieces.even_rows);
        parallel::for_each_chunk(even, size, |chunk, part| {
            self.even.forward(chunk * size, even_right, part, None);
        });
        parallel::for_each_chunk(odd, size, |chunk, part| {
            self.odd.forward(chunk * size, odd_right, part, Some(even));
        });
    }

    /// The residual after [`GaussSeidel::forward`].
    pub(super) fn residual<const K: usize>(
        &self,
        solution: &[[[T; B]; K]],
        residual: &mut [[[T; B]; K]],
    ) {
        let (even, odd) = solution.split_at(self.pieces.even_rows);
        let (even_residual, odd_residual) = residual.split_at_mut(self.pieces.even_rows);
        for (half, own, other, residual) in
            [(&self.even, even, Some(odd), even_residual), (&self.odd, odd, None, odd_residual)]
        {
            parallel::for_each_chunk(residual, ROW_CHUNK, |chunk, part| {
                for (index, value) in part.iter_mut().enumerate() {
                    let row = chunk * ROW_CHUNK + index;
                    let mut sum = [[T::default(); B]; K];
                    half.upper.add_product(row, own, 0, &mut sum);
                    if let Some(other) = other {
                        half.cross.add_product(row, other, 0, &mut sum);
                    }
                    *value = sum.map(|column| column.map(|value| -value));
                }
            });
        }
    }

    /// One sweep backwards from what `solution` holds.
    pub(super) fn backward<const K: usize>(
        &self,
        right_side: &[[[T; B]; K]],
        solution: &mut [[[T; B]; K]],
    ) {
        let size = self.pieces.piece_rows;
        let (even_right, odd_right) = right_side.split_at(self.pieces.even_rows);
        let (even, odd) = solution.split_at_mut(self.pieces.even_rows);
        parallel::for_each_chunk(odd, size, |chunk, part| {
            self.odd.backward(chunk * size, odd_right, part, even);
        });
        parallel::for_each_chunk(even, size, |chunk, part| {
            self.even.backward(chunk * size, even_right, part, odd);
        });
    }
}

impl<T: Real, const B: usize> Half<T, B> {
    #[inline]
    fn forward<const K: usize>(
        &self,
        first: usize,
        right_side: &[[[T; B]; K]],
        part: &mut [[[T; B]; K]],
        other: Option<&[[[T; B]; K]]>,
    ) {
        for index in 0..part.len() {
            let row = first + index;
            let mut sum = [[T::default(); B]; K];
            if let Some(other) = other {
                self.cross.add_product(row, other, 0, &mut sum);
            }
            self.lower.add_product(row, part, first, &mut sum);
            part[index] = self.divide(row, &right_side[row], &sum);
        }
    }

    #[inline]
    fn backward<const K: usize>(
        &self,
        first: usize,
        right_side: &[[[T; B]; K]],
        part: &mut [[[T; B]; K]],
        other: &[[[T; B]; K]],
    ) {
        for index in (0..part.len()).rev() {
            let row = first + index;
            let mut sum = [[T::default(); B]; K];
            self.cross.add_product_backwards(row, other, 0, &mut sum);
            self.lower.add_product_backwards(row, part, first, &mut sum);
            self.upper.add_product_backwards(row, part, first, &mut sum);
            part[index] = self.divide(row, &right_side[row], &sum);
        }
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
