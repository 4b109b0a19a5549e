//! The lower half of a symmetric matrix.

use std::ops::Range;
use std::sync::Arc;

use super::iteration::Matrix;
use super::pieces::{Around, Pieces, among};
use super::real::Real;
use super::{Block, ROW_CHUNK, SparseMatrix};
use crate::parallel;

/// Entries on the diagonal of a matrix whose halves single precision can hold in two numbers each.
const ORDINARY: std::ops::RangeInclusive<f64> = 1e-25..=1e30;

/// The blocks of a symmetric matrix on one side of its diagonal, where its rows are gone through
/// piece by piece: first all pieces with even numbers, then all with odd ones. A row has its blocks
/// in the columns before it, those of the pieces on both sides of an odd one among them. Each block
/// serves twice, as it is and transposed, so that products with the whole matrix read half of it.
#[derive(Debug)]
pub(super) struct Lower<T, const B: usize> {
    pieces: Pieces,
    offsets: Vec<u32>,
    columns: Vec<u32>,
    /// The entries of all blocks, row after row, and one more, so that four can be read from where
    /// the last row of a block begins.
    entries: Vec<T>,
}

/// The entries of blocks, in some precision.
pub(super) trait Entries<S>: Copy {
    /// Three rows of a block of 3 by 3 that begins at `first`, each with the entry after it.
    fn three_rows(self, first: usize) -> [[S; 4]; 3];

    /// One entry.
    fn entry(self, index: usize) -> S;
}

impl<T: Real> Entries<T> for &[T] {
    #[inline(always)]
    fn three_rows(self, first: usize) -> [[T; 4]; 3] {
        match self.get(first..).and_then(<[T]>::first_chunk::<10>) {
            Some(&[a, b, c, d, e, f, g, h, i, j]) => [[a, b, c, d], [d, e, f, g], [g, h, i, j]],
            None => [[T::default(); 4]; 3],
        }
    }

    #[inline(always)]
    fn entry(self, index: usize) -> T {
        self[index]
    }
}

/// Sums of two numbers each, the second what the first leaves out; none of the second where the
/// first leave nothing out.
#[derive(Clone, Copy)]
pub(super) struct Pairs<'a, T>(pub(super) &'a [T], pub(super) &'a [T]);

impl<T: Real> Entries<f64> for Pairs<'_, T> {
    #[inline(always)]
    fn three_rows(self, first: usize) -> [[f64; 4]; 3] {
        let (high, low) = (self.0.three_rows(first), self.1.three_rows(first));
        std::array::from_fn(|row| {
            std::array::from_fn(|lane| high[row][lane].wide() + low[row][lane].wide())
        })
    }

    #[inline(always)]
    fn entry(self, index: usize) -> f64 {
        self.0[index].wide() + self.1.get(index).map_or(0.0, |rest| rest.wide())
    }
}

impl<T: Real, const B: usize> Lower<T, B> {
    /// The half of the first rows and columns of a matrix, those of `pieces`. `None` where it has
    /// too many blocks.
    pub(super) fn new(matrix: &SparseMatrix<B>, pieces: Pieces) -> Option<Self> {
        let rows = pieces.rows();
        let counts = parallel::map_chunks(rows, ROW_CHUNK, |range| {
            range.map(|row| runs(matrix, pieces, row).iter().map(Range::len).sum()).collect()
        });
        let mut offsets = Vec::with_capacity(rows + 1);
        offsets.push(0);
        let mut end = 0usize;
        for count in counts.iter().flat_map(|counts: &Vec<usize>| counts) {
            end += count;
            offsets.push(u32::try_from(end).ok()?);
        }
        let mut half = Self {
            pieces,
            offsets,
            columns: vec![0; end],
            entries: vec![T::default(); B * B * end + 1],
        };
        let Self { offsets, columns, entries, .. } = &mut half;
        let (blocks, _) = entries.as_chunks_mut::<B>();
        let (blocks, _) = blocks.as_chunks_mut::<B>();
        let parts = parts(offsets, ROW_CHUNK, columns, blocks);
        parallel::for_each(parts, |(rows, columns, found)| {
            let mut kept = columns.iter_mut().zip(found);
            for run in rows.flat_map(|row| runs(matrix, pieces, row)) {
                let blocks = matrix.columns()[run.clone()].iter().zip(&matrix.values()[run]);
                // The blocks come first, so that none of those to be kept is passed over where
                // they end.
                for ((&column, block), (kept_column, kept)) in blocks.zip(kept.by_ref()) {
                    *kept_column = column;
                    *kept = block.map(|entries| entries.map(T::of));
                }
            }
        });
        Some(half)
    }

    /// The parts of the matrix's entries that these leave out.
    fn rests(&self, matrix: &SparseMatrix<B>) -> Vec<T> {
        let mut rests = vec![T::default(); self.entries.len()];
        let (blocks, _) = rests.as_chunks_mut::<B>();
        let (blocks, _) = blocks.as_chunks_mut::<B>();
        let mut none = vec![(); self.columns.len()];
        let parts = parts(&self.offsets, ROW_CHUNK, &mut none, blocks);
        parallel::for_each(parts, |(rows, _, found)| {
            let runs = rows.flat_map(|row| runs(matrix, self.pieces, row));
            let blocks = runs.flat_map(|run| &matrix.values()[run]);
            for (rest, block) in found.iter_mut().zip(blocks) {
                *rest = block.map(|row| row.map(|entry| T::of(entry - T::of(entry).wide())));
            }
        });
        rests
    }

    pub(super) fn pieces(&self) -> Pieces {
        self.pieces
    }

    pub(super) fn entries(&self) -> &[T] {
        &self.entries
    }

    /// Whether the blocks lie where those of a matrix do.
    fn has_pattern_of(&self, matrix: &SparseMatrix<B>) -> bool {
        matrix.rows() == self.pieces.rows()
            && 2 * self.columns.len() + matrix.rows() == matrix.columns().len()
            && (0..matrix.rows()).all(|row| {
                let runs = runs(matrix, self.pieces, row).into_iter();
                runs.flat_map(|run| &matrix.columns()[run]).eq(&self.columns[self.range(row)])
            })
    }

    /// The whole matrix, whose diagonal this is; `entries` are those of the half.
    fn whole(&self, entries: impl Entries<f64>, diagonal: &[Block<B>]) -> SparseMatrix<B> {
        let rows = self.pieces.rows();
        let mut found: Vec<Vec<(u32, Block<B>)>> =
            (0..).zip(diagonal).map(|(row, block)| vec![(row, *block)]).collect();
        for row in 0..rows {
            for index in self.range(row) {
                let block: Block<B> = std::array::from_fn(|i| {
                    std::array::from_fn(|j| entries.entry(B * (B * index + i) + j))
                });
                let column = self.columns[index];
                found[row].push((column, block));
                let transposed = std::array::from_fn(|i| std::array::from_fn(|j| block[j][i]));
                found[column as usize].push((crate::number::index(row), transposed));
            }
        }
        let (mut offsets, mut columns, mut values) = (vec![0], Vec::new(), Vec::new());
        for mut row in found {
            row.sort_unstable_by_key(|(column, _)| *column);
            for (column, block) in row {
                columns.push(column);
                values.push(block);
            }
            offsets.push(columns.len());
        }
        SparseMatrix::from_parts(offsets, columns, values)
    }

    fn range(&self, row: usize) -> Range<usize> {
        self.offsets[row] as usize..self.offsets[row + 1] as usize
    }

    /// Calls `visit` with the index of each block of a row of the piece that starts at row `first`
    /// where it lies before the piece, in it or after it.
    #[inline(always)]
    fn for_each_block(&self, row: usize, first: usize, mut visit: impl FnMut(usize, Side, usize)) {
        let Range { start: mut index, end } = self.range(row);
        let columns = &self.columns[..end];
        let length = self.pieces.length();
        while let Some(&column) = columns.get(index).filter(|column| (**column as usize) < first) {
            visit(index, Side::Before, column as usize + length - first);
            index += 1;
        }
        while let Some(&column) = columns.get(index).filter(|column| (**column as usize) < row) {
            visit(index, Side::Own, column as usize - first);
            index += 1;
        }
        while let Some(&column) = columns.get(index) {
            visit(index, Side::After, column as usize - first - length);
            index += 1;
        }
    }

    /// The product of a row of the piece that starts at row `first` with the values of the piece and
    /// those around it.
    #[inline(always)]
    pub(super) fn product<S: Real, const K: usize>(
        &self,
        entries: impl Entries<S>,
        row: usize,
        first: usize,
        own: &[[[S; B]; K]],
        around: &Around<'_, [[S; B]; K]>,
    ) -> [[S; B]; K] {
        let mut sum = [[S::default(); B]; K];
        // Four numbers at a time, as processors have it. The fourth comes to nothing.
        let mut wide = [[[S::default(); 4]; 3]; K];
        self.for_each_block(row, first, |index, side, position| {
            let values = match side {
                Side::Before => &around.before[position],
                Side::Own => &own[position],
                Side::After => &around.after[position],
            };
            if B == 3 {
                let block = entries.three_rows(9 * index);
                for (sums, value) in wide.iter_mut().zip(values) {
                    let value = [value[0], value[1], value[2], S::default()];
                    for (sum, row) in sums.iter_mut().zip(&block) {
                        for ((sum, &entry), value) in sum.iter_mut().zip(row).zip(value) {
                            *sum += entry * value;
                        }
                    }
                }
                return;
            }
            for (sum, value) in sum.iter_mut().zip(values) {
                for (i, sum) in sum.iter_mut().enumerate() {
                    for (j, &value) in value.iter().enumerate() {
                        *sum += entries.entry(B * (B * index + i) + j) * value;
                    }
                }
            }
        });
        if B == 3 {
            for (sum, wide) in sum.iter_mut().zip(&wide) {
                for (sum, [x, y, z, _]) in sum.iter_mut().zip(wide) {
                    *sum += *x;
                    *sum += *y;
                    *sum += *z;
                }
            }
        }
        sum
    }

    /// Adds the products of the transposed blocks of a row with `value` to the sums of their
    /// columns.
    #[inline(always)]
    pub(super) fn add_transposed<S: Real, const K: usize>(
        &self,
        entries: impl Entries<S>,
        row: usize,
        first: usize,
        value: &[[S; B]; K],
        around: &mut Around<'_, [[S; B]; K]>,
    ) {
        self.for_each_block(row, first, |index, side, position| {
            let sums = match side {
                Side::Before => &mut around.sums_before[position],
                Side::Own => &mut around.sums[position],
                Side::After => &mut around.sums_after[position],
            };
            if B == 3 {
                let block = entries.three_rows(9 * index);
                for (sum, value) in sums.iter_mut().zip(value) {
                    let mut wide = [S::default(); 4];
                    for (row, &value) in block.iter().zip(value) {
                        for (sum, &entry) in wide.iter_mut().zip(row) {
                            *sum += entry * value;
                        }
                    }
                    for (sum, wide) in sum.iter_mut().zip(wide) {
                        *sum += wide;
                    }
                }
                return;
            }
            for (sum, value) in sums.iter_mut().zip(value) {
                for (i, &value) in value.iter().enumerate() {
                    for (j, sum) in sum.iter_mut().enumerate() {
                        *sum += entries.entry(B * (B * index + i) + j) * value;
                    }
                }
            }
        });
    }
}

/// A whole symmetric matrix by its lower half: half the memory of compressed rows. In single
/// precision each entry is the sum of two numbers, which have 48 bits of it between them.
#[derive(Debug)]
pub(super) struct Symmetric<T, const B: usize> {
    lower: Arc<Lower<T, B>>,
    /// What is left out of each entry of the half; empty where that is nothing.
    rests: Vec<T>,
    diagonal: Vec<Block<B>>,
}

impl<T: Real, const B: usize> Symmetric<T, B> {
    /// The matrix that this is the half of. `None` where a row of it has no diagonal, or one that is
    /// too large or too small for the precision.
    pub(super) fn new(lower: &Arc<Lower<T, B>>, matrix: &SparseMatrix<B>) -> Option<Self> {
        let diagonal =
            (0..matrix.rows()).map(|row| matrix.diagonal(row)).collect::<Option<Vec<_>>>()?;
        let is_ordinary =
            |block: &Block<B>| (0..B).all(|axis| ORDINARY.contains(&block[axis][axis]));
        if !diagonal.iter().all(is_ordinary) {
            return None;
        }
        let rests = if T::IS_EXACT { Vec::new() } else { lower.rests(matrix) };
        Some(Self { lower: Arc::clone(lower), rests, diagonal })
    }

    fn entries(&self) -> Pairs<'_, T> {
        Pairs(&self.lower.entries, &self.rests)
    }

    /// The matrix in compressed rows.
    pub(super) fn whole(&self) -> SparseMatrix<B> {
        self.lower.whole(self.entries(), &self.diagonal)
    }

    /// Whether the blocks lie where those of another matrix do.
    pub(super) fn has_pattern_of(&self, matrix: &SparseMatrix<B>) -> bool {
        self.lower.has_pattern_of(matrix)
    }
}

impl<T: Real, const B: usize> Matrix<B> for Symmetric<T, B> {
    fn rows(&self) -> usize {
        self.diagonal.len()
    }

    fn multiply_columns<const K: usize>(
        &self,
        vector: &[[[f64; B]; K]],
        result: &mut [[[f64; B]; K]],
    ) {
        let pieces = self.lower.pieces;
        let (even, odd) = pieces.halves(vector);
        let (mut even_sums, odd_sums) = pieces.halves_mut(result);
        let mut beside = vec![[[0.0; B]; K]; pieces.odd_rows()];
        let work = |first: usize, own: &[[[f64; B]; K]], mut around: Around<'_, [[f64; B]; K]>| {
            for (index, value) in own.iter().enumerate() {
                let row = first + index;
                let mut sum = self.lower.product(self.entries(), row, first, own, &around);
                for (sum, value) in sum.iter_mut().zip(value) {
                    for (sum, entries) in sum.iter_mut().zip(&self.diagonal[row]) {
                        *sum += entries.iter().zip(value).map(|(a, b)| a * b).sum::<f64>();
                    }
                }
                around.sums[index] = sum;
                self.lower.add_transposed(self.entries(), row, first, value, &mut around);
            }
        };
        pieces.through_even(even.iter().copied(), &mut even_sums, work);
        pieces.through_odd(&even, odd, &mut even_sums, odd_sums, &mut beside, work);
    }
}

/// Where a block lies, seen from the piece of its row.
#[derive(Clone, Copy)]
enum Side {
    Before,
    Own,
    After,
}

/// The blocks of a row that are kept: before the diagonal, or of a row in an odd piece also those
/// in the piece after.
fn runs<const B: usize>(matrix: &SparseMatrix<B>, pieces: Pieces, row: usize) -> [Range<usize>; 2] {
    let (start, odd) = pieces.start(row);
    let (first, columns) = (matrix.offsets()[row], among(matrix, row, pieces.rows()));
    let below = |bound: usize| first + columns.partition_point(|&column| (column as usize) < bound);
    let (diagonal, end) = (below(row), first + columns.len());
    if odd {
        [first..diagonal, below(start + pieces.length())..end]
    } else {
        [below(start)..diagonal, end..end]
    }
}

/// Rows, and what two arrays in compressed rows have of them, `chunk` rows at a time.
fn parts<'a, T, U>(
    offsets: &[u32],
    chunk: usize,
    mut values: &'a mut [T],
    mut others: &'a mut [U],
) -> Vec<(Range<usize>, &'a mut [T], &'a mut [U])> {
    let rows = offsets.len() - 1;
    let mut parts = Vec::with_capacity(rows.div_ceil(chunk));
    for start in (0..rows).step_by(chunk) {
        let end = (start + chunk).min(rows);
        let count = (offsets[end] - offsets[start]) as usize;
        let (part, rest) = values.split_at_mut(count);
        let (other, other_rest) = others.split_at_mut(count);
        parts.push((start..end, part, other));
        (values, others) = (rest, other_rest);
    }
    parts
}
