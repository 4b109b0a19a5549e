//! Blocks in compressed rows, as a preconditioner keeps them.

use std::ops::Range;

use super::real::Real;
use super::{ROW_CHUNK, SparseMatrix};
use crate::parallel;

/// Blocks in compressed rows, each stored column after column.
#[derive(Debug, Clone)]
pub(super) struct Rows<T, const B: usize> {
    offsets: Vec<usize>,
    columns: Vec<u32>,
    /// The entries of all blocks, and one more, so that four entries can be read from where the
    /// last column begins.
    entries: Vec<T>,
}

/// Blocks of a matrix that lie side by side.
#[derive(Debug, Clone, Default)]
pub(super) struct Run {
    /// Their indices among its blocks.
    pub(super) indices: Range<usize>,
    /// The shift added to their columns, wrapping around.
    pub(super) shift: u32,
}

impl<T: Real, const B: usize> Rows<T, B> {
    /// `count` rows of blocks of a matrix, each of two runs.
    pub(super) fn new(
        matrix: &SparseMatrix<B>,
        count: usize,
        runs: impl Fn(usize) -> [Run; 2] + Sync,
    ) -> Self {
        let lengths = parallel::map_chunks(count, ROW_CHUNK, |range| {
            range
                .map(|row| runs(row).iter().map(|run| run.indices.len()).sum())
                .collect::<Vec<usize>>()
        });
        let mut offsets = Vec::with_capacity(count + 1);
        offsets.push(0);
        let mut end = 0;
        for length in lengths.iter().flatten() {
            end += length;
            offsets.push(end);
        }
        let mut columns = vec![0; end];
        let mut entries = vec![T::default(); B * B * end + 1];
        let (found, _) = entries.as_chunks_mut::<B>();
        let (found, _) = found.as_chunks_mut::<B>();
        parallel::for_each_rows(
            ROW_CHUNK,
            (&offsets, &mut columns),
            (&offsets, found),
            |rows, columns, found| {
                let mut kept = columns.iter_mut().zip(found);
                for row in rows {
                    for Run { indices, shift } in runs(row) {
                        let blocks =
                            matrix.columns()[indices.clone()].iter().zip(&matrix.values()[indices]);
                        // The blocks come first, so that none of those to be kept is passed over
                        // where they end.
                        for ((&column, block), (kept_column, found)) in blocks.zip(kept.by_ref()) {
                            *kept_column = column.wrapping_add(shift);
                            *found = std::array::from_fn(|j| {
                                std::array::from_fn(|i| T::of(block[i][j]))
                            });
                        }
                    }
                }
            },
        );
        Self { offsets, columns, entries }
    }

    /// `sum += self[row] vector`; `first` is the column of the vector's first entry.
    #[inline(always)]
    pub(super) fn add_product<const K: usize>(
        &self,
        row: usize,
        vector: &[[[T; B]; K]],
        first: usize,
        sum: &mut [[T; B]; K],
    ) {
        self.add_product_either_way::<K, false>(row, vector, first, sum);
    }

    /// Adds the product from the last block to the first: where rows are gone through backwards,
    /// memory is then read in one direction throughout, which processors see coming.
    #[inline(always)]
    pub(super) fn add_product_backwards<const K: usize>(
        &self,
        row: usize,
        vector: &[[[T; B]; K]],
        first: usize,
        sum: &mut [[T; B]; K],
    ) {
        self.add_product_either_way::<K, true>(row, vector, first, sum);
    }

    #[inline(always)]
    fn add_product_either_way<const K: usize, const BACKWARDS: bool>(
        &self,
        row: usize,
        vector: &[[[T; B]; K]],
        first: usize,
        sum: &mut [[T; B]; K],
    ) {
        let range = self.offsets[row]..self.offsets[row + 1];
        let entries = &self.entries[B * B * range.start..=B * B * range.end];
        let columns = &self.columns[range];
        let indices = (0..columns.len())
            .map(|index| if BACKWARDS { columns.len() - 1 - index } else { index });
        if B == 3 {
            // Four entries at a time, as processors have it; the fourth is the next column's and
            // comes to nothing. Each column of a block has its own sum, so that none need wait for
            // another.
            let mut wide = [[[T::default(); 4]; 3]; K];
            for index in indices {
                let Some(block) = entries[9 * index..].first_chunk::<10>() else { break };
                for (sums, vector) in wide.iter_mut().zip(&vector[columns[index] as usize - first])
                {
                    for (j, sum) in sums.iter_mut().enumerate() {
                        for lane in 0..4 {
                            sum[lane] += block[3 * j + lane] * vector[j];
                        }
                    }
                }
            }
            for (sum, wide) in sum.iter_mut().zip(&wide) {
                for (axis, sum) in sum.iter_mut().enumerate() {
                    *sum += wide[0][axis];
                    *sum += wide[1][axis];
                    *sum += wide[2][axis];
                }
            }
            return;
        }
        for index in indices {
            let block = &entries[B * B * index..B * B * (index + 1)];
            for (sum, vector) in sum.iter_mut().zip(&vector[columns[index] as usize - first]) {
                for (column, &value) in block.chunks_exact(B).zip(vector) {
                    for (total, &entry) in sum.iter_mut().zip(column) {
                        *total += entry * value;
                    }
                }
            }
        }
    }
}
