//! Blocks in compressed rows, as a preconditioner keeps them.

use super::ROW_CHUNK;
use super::real::Real;
use crate::parallel;

/// Blocks in compressed rows, each stored column after column.
#[derive(Debug, Clone)]
pub(super) struct Rows<T, const B: usize> {
    offsets: Vec<usize>,
    columns: Vec<u32>,
    /// The entries of all blocks, and one more, so that four entries can be read from where the last column begins.
    entries: Vec<T>,
}

impl<T: Real, const B: usize> Rows<T, B> {
    /// Rows from what `blocks` calls its second argument with for each of them; it is called twice for each row.
    pub(super) fn new(count: usize, blocks: impl Fn(usize, &mut dyn FnMut(u32, &[[f64; B]; B])) + Sync) -> Self {
        let lengths = parallel::map_chunks(count, ROW_CHUNK, |range| {
            let length = |row| {
                let mut length = 0;
                blocks(row, &mut |_, _| length += 1);
                length
            };
            range.map(length).collect::<Vec<usize>>()
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
        parallel::for_each_rows(ROW_CHUNK, (&offsets, &mut columns), (&offsets, found), |rows, columns, found| {
            let mut places = columns.iter_mut().zip(found);
            for row in rows {
                blocks(row, &mut |column, block| {
                    if let Some((place, found)) = places.next() {
                        *place = column;
                        *found = std::array::from_fn(|j| std::array::from_fn(|i| T::of(block[i][j])));
                    }
                });
            }
        });
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
        let range = self.offsets[row]..self.offsets[row + 1];
        let entries = &self.entries[B * B * range.start..=B * B * range.end];
        if B == 3 {
            // Four entries at a time, as processors have it; the fourth is the next column's and comes to nothing.
            let mut wide = [[T::default(); 4]; K];
            for (index, &column) in self.columns[range].iter().enumerate() {
                let Some(block) = entries[9 * index..].first_chunk::<10>() else { break };
                for (sum, vector) in wide.iter_mut().zip(&vector[column as usize - first]) {
                    for j in 0..3 {
                        for lane in 0..4 {
                            sum[lane] += block[3 * j + lane] * vector[j];
                        }
                    }
                }
            }
            for (sum, wide) in sum.iter_mut().zip(&wide) {
                for (sum, &wide) in sum.iter_mut().zip(wide) {
                    *sum += wide;
                }
            }
            return;
        }
        for (block, &column) in entries.chunks_exact(B * B).zip(&self.columns[range]) {
            for (sum, vector) in sum.iter_mut().zip(&vector[column as usize - first]) {
                for (column, &value) in block.chunks_exact(B).zip(vector) {
                    for (total, &entry) in sum.iter_mut().zip(column) {
                        *total += entry * value;
                    }
                }
            }
        }
    }
}
