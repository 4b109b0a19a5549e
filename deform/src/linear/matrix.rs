//! Sparse matrices in compressed rows of small dense blocks.

use crate::parallel;

/// How many rows are worked on at a time.
pub(crate) const ROW_CHUNK: usize = 1024;

/// A small dense block, row after row.
pub type Block<const B: usize> = [[f64; B]; B];

/// A sparse matrix of dense `B` by `B` blocks in compressed rows; with `B` 1 an ordinary sparse
/// matrix, with 3 one that acts on vectors in space.
///
/// Within a row the columns rise. The matrix need not be square.
#[derive(Debug, Clone, PartialEq)]
pub struct SparseMatrix<const B: usize> {
    offsets: Vec<usize>,
    columns: Vec<u32>,
    values: Vec<Block<B>>,
}

impl<const B: usize> SparseMatrix<B> {
    /// A matrix of zeros: row `i` has blocks at `columns[offsets[i]..offsets[i + 1]]`.
    ///
    /// # Panics
    /// Where `offsets` does not rise from 0 to the number of columns, or the columns of a row do
    /// not rise.
    #[must_use]
    pub fn zeros(offsets: Vec<usize>, columns: Vec<u32>) -> Self {
        assert!(
            offsets.first() == Some(&0) && offsets.last() == Some(&columns.len()),
            "offsets span the columns"
        );
        assert!(offsets.is_sorted(), "offsets rise");
        for row in offsets.windows(2) {
            assert!(columns[row[0]..row[1]].is_sorted_by(|a, b| a < b), "columns of a row rise");
        }
        let values = vec![[[0.0; B]; B]; columns.len()];
        Self { offsets, columns, values }
    }

    /// As [`SparseMatrix::zeros`], with values, of parts known to fit.
    pub(crate) fn from_parts(
        offsets: Vec<usize>,
        columns: Vec<u32>,
        values: Vec<Block<B>>,
    ) -> Self {
        debug_assert!(offsets.last() == Some(&columns.len()) && columns.len() == values.len());
        Self { offsets, columns, values }
    }

    /// Whether the blocks lie at the same places.
    pub(super) fn has_pattern_of(&self, other: &Self) -> bool {
        self.offsets == other.offsets && self.columns == other.columns
    }

    /// How many rows of blocks there are.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Row starts, one more than there are rows.
    #[must_use]
    pub fn offsets(&self) -> &[usize] {
        &self.offsets
    }

    /// The columns of all blocks, row after row.
    #[must_use]
    pub fn columns(&self) -> &[u32] {
        &self.columns
    }

    /// The blocks, row after row.
    #[must_use]
    pub fn values(&self) -> &[Block<B>] {
        &self.values
    }

    /// The blocks, row after row, to be changed.
    pub fn values_mut(&mut self) -> &mut [Block<B>] {
        &mut self.values
    }

    pub(crate) fn offsets_and_values_mut(&mut self) -> (&[usize], &[u32], &mut [Block<B>]) {
        (&self.offsets, &self.columns, &mut self.values)
    }

    /// The columns and blocks of one row.
    ///
    /// # Panics
    /// Where there is no such row.
    #[must_use]
    pub fn row(&self, row: usize) -> (&[u32], &[Block<B>]) {
        let range = self.offsets[row]..self.offsets[row + 1];
        (&self.columns[range.clone()], &self.values[range])
    }

    /// The block of a row on the diagonal, if it has one.
    pub(super) fn diagonal(&self, row: usize) -> Option<Block<B>> {
        let (columns, blocks) = self.row(row);
        let found = columns.binary_search_by_key(&row, |&column| column as usize).ok()?;
        Some(blocks[found])
    }

    /// `result = self * vector`.
    ///
    /// # Panics
    /// Where `result` is not one for each row or `vector` ends before the last column.
    pub fn multiply(&self, vector: &[[f64; B]], result: &mut [[f64; B]]) {
        self.multiply_columns::<1>(vector.as_chunks().0, result.as_chunks_mut().0);
    }

    /// The product with `K` vectors side by side.
    pub(crate) fn multiply_columns<const K: usize>(
        &self,
        vector: &[[[f64; B]; K]],
        result: &mut [[[f64; B]; K]],
    ) {
        assert_eq!(result.len(), self.rows(), "one result for each row");
        parallel::for_each_chunk(result, ROW_CHUNK, |chunk, part| {
            for (index, value) in part.iter_mut().enumerate() {
                let (columns, blocks) = self.row(chunk * ROW_CHUNK + index);
                let mut sum = [[0.0; B]; K];
                for (&column, block) in columns.iter().zip(blocks) {
                    multiply_add(&mut sum, block, &vector[column as usize]);
                }
                *value = sum;
            }
        });
    }
}

/// `sum += block * vector`, for each column of the vector.
#[inline(always)]
fn multiply_add<const B: usize, const K: usize>(
    sum: &mut [[f64; B]; K],
    block: &Block<B>,
    vector: &[[f64; B]; K],
) {
    for (sum, vector) in sum.iter_mut().zip(vector) {
        for (total, row) in sum.iter_mut().zip(block) {
            for (entry, value) in row.iter().zip(vector) {
                *total += entry * value;
            }
        }
    }
}

/// `sum += block`.
pub(super) fn add<const B: usize>(sum: &mut Block<B>, block: &Block<B>) {
    for (sum, value) in sum.as_flattened_mut().iter_mut().zip(block.as_flattened()) {
        *sum += value;
    }
}

/// The inverse of a symmetric positive definite block; `None` where a pivot falls below `1e-10` of
/// its diagonal entry.
#[expect(clippy::needless_range_loop, reason = "the indices are those of the formulas")]
pub(crate) fn invert_positive<const B: usize>(block: &Block<B>) -> Option<Block<B>> {
    // Cholesky, then the inverse of the factor, then inverse = factor⁻ᵀ factor⁻¹.
    let mut factor = [[0.0; B]; B];
    for i in 0..B {
        for j in 0..=i {
            let sum: f64 = (0..j).map(|k| factor[i][k] * factor[j][k]).sum();
            if i == j {
                let pivot = block[i][i] - sum;
                if !(pivot > 1e-10 * block[i][i] && pivot.is_finite() && block[i][i] > 0.0) {
                    return None;
                }
                factor[i][i] = pivot.sqrt();
            } else {
                factor[i][j] = (block[i][j] - sum) / factor[j][j];
            }
        }
    }
    // Column by column: the solution of `factor x = e_j`.
    let mut inverse_factor = [[0.0; B]; B];
    for j in 0..B {
        for i in j..B {
            let unit = if i == j { 1.0 } else { 0.0 };
            let sum: f64 = (j..i).map(|k| factor[i][k] * inverse_factor[k][j]).sum();
            inverse_factor[i][j] = (unit - sum) / factor[i][i];
        }
    }
    let mut inverse = [[0.0; B]; B];
    for (i, row) in inverse.iter_mut().enumerate() {
        for (j, entry) in row.iter_mut().enumerate() {
            *entry = (i.max(j)..B).map(|k| inverse_factor[k][i] * inverse_factor[k][j]).sum();
        }
    }
    Some(inverse)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn multiplies_blocks() {
        let mut matrix = SparseMatrix::<2>::zeros(vec![0, 1, 3], vec![1, 0, 1]);
        let (_, _, values) = matrix.offsets_and_values_mut();
        values.copy_from_slice(&[
            [[1.0, 2.0], [3.0, 4.0]],
            [[5.0, 6.0], [7.0, 8.0]],
            [[1.0, 0.0], [0.0, 1.0]],
        ]);
        let mut result = [[0.0; 2]; 2];
        matrix.multiply(&[[1.0, 2.0], [3.0, 4.0]], &mut result);
        assert_eq!(result, [[11.0, 25.0], [5.0 + 12.0 + 3.0, 7.0 + 16.0 + 4.0]]);
    }

    #[test]
    fn inverts_positive_blocks_and_only_those() {
        let block = [[4.0, 1.0, 0.5], [1.0, 3.0, -1.0], [0.5, -1.0, 2.0]];
        let inverse = invert_positive(&block).unwrap();
        for (i, row) in block.iter().enumerate() {
            for j in 0..3 {
                let product: f64 =
                    row.iter().zip(&inverse).map(|(entry, other)| entry * other[j]).sum();
                assert!((product - f64::from(u8::from(i == j))).abs() < 1e-14);
            }
        }
        assert_eq!(invert_positive(&[[1.0, 2.0], [2.0, 1.0]]), None);
        assert_eq!(invert_positive(&[[f64::NAN]]), None);
    }
}
