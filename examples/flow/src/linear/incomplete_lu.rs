//! Incomplete factorisation without fill, block by block.

use std::ops::Range;

use rayon::prelude::*;
use tombolo_deform::linear::SparseMatrix;

/// How many rows a block has at least.
const BLOCK_ROWS: usize = 4096;

/// ILU(0) of the diagonal blocks of a matrix (Meijerink and van der Vorst 1977; block Jacobi
/// between the blocks).
///
/// The blocks are ranges of rows whose number depends on the size of the matrix alone, so that
/// threads work on blocks of their own and the result does not depend on how many threads there
/// are. Entries between blocks are left out.
#[derive(Debug)]
pub struct BlockIncompleteLu {
    diagonal: Vec<usize>,
    blocks: Vec<Block>,
}

#[derive(Debug)]
struct Block {
    rows: Range<usize>,
    /// The position in the matrix of the first entry of these rows.
    base: usize,
    /// The entries of the block's rows from that of its first row on: below the diagonal L, the
    /// rest U.
    values: Vec<f64>,
    /// The inverses of U's diagonal.
    pivots: Vec<f64>,
    /// For each row, the entries that lie within the block.
    inside: Vec<(usize, usize)>,
}

impl BlockIncompleteLu {
    /// Sets the blocks of the first rows of a matrix up, as many as there are positions of a
    /// `diagonal` entry; [`BlockIncompleteLu::factor`] fills them.
    #[must_use]
    pub fn new(matrix: &SparseMatrix<1>, diagonal: &[usize]) -> Self {
        let rows = diagonal.len();
        let count = (rows / BLOCK_ROWS).max(1);
        let blocks = (0..count)
            .map(|block| {
                let rows = block * rows / count..(block + 1) * rows / count;
                let inside = rows
                    .clone()
                    .map(|row| {
                        let (start, columns) = (matrix.offsets()[row], matrix.row(row).0);
                        let first =
                            columns.partition_point(|&column| (column as usize) < rows.start);
                        let last = columns.partition_point(|&column| (column as usize) < rows.end);
                        (start + first, start + last)
                    })
                    .collect();
                let base = matrix.offsets()[rows.start];
                let entries = matrix.offsets()[rows.end] - base;
                Block {
                    base,
                    values: vec![0.0; entries],
                    pivots: vec![1.0; rows.len()],
                    inside,
                    rows,
                }
            })
            .collect();
        Self { diagonal: diagonal.to_vec(), blocks }
    }

    /// Factors a matrix that has its entries where the one that this was made for has them.
    pub fn factor(&mut self, matrix: &SparseMatrix<1>) {
        let diagonal = &self.diagonal;
        self.blocks.par_iter_mut().for_each(|block| block.factor(diagonal, matrix));
    }

    /// `result = (LU)^-1 vector`, three components at once, for the matrix that was factored.
    pub fn apply(&self, matrix: &SparseMatrix<1>, vector: &[[f64; 3]], result: &mut [[f64; 3]]) {
        let mut rest = result;
        let mut slices = Vec::with_capacity(self.blocks.len());
        for block in &self.blocks {
            let (slice, after) = rest.split_at_mut(block.rows.len());
            slices.push(slice);
            rest = after;
        }
        self.blocks.par_iter().zip(slices).for_each(|(block, slice)| {
            block.apply(matrix.columns(), &self.diagonal, vector, slice)
        });
    }
}

impl Block {
    fn factor(&mut self, diagonal: &[usize], matrix: &SparseMatrix<1>) {
        let (columns, entries) = (matrix.columns(), matrix.values().as_flattened().as_flattened());
        let first = self.rows.start;
        let base = self.base;
        self.values.copy_from_slice(&entries[base..matrix.offsets()[self.rows.end]]);
        let mut place = vec![usize::MAX; self.rows.len()];
        for row in self.rows.clone() {
            let (start, end) = self.inside[row - first];
            for entry in start..end {
                place[columns[entry] as usize - first] = entry;
            }
            for entry in start..diagonal[row] {
                let other = columns[entry] as usize;
                let factor = self.values[entry - base] * self.pivots[other - first];
                self.values[entry - base] = factor;
                let (_, other_end) = self.inside[other - first];
                for upper in diagonal[other] + 1..other_end {
                    let target = place[columns[upper] as usize - first];
                    if target != usize::MAX {
                        self.values[target - base] -= factor * self.values[upper - base];
                    }
                }
            }
            let pivot = self.values[diagonal[row] - base];
            let original = entries[diagonal[row]];
            // A pivot that elimination has all but wiped out would blow the solve up: fall back on
            // the diagonal's own value.
            let pivot = if pivot.abs() > 1e-3 * original.abs() { pivot } else { original };
            self.pivots[row - first] = if pivot == 0.0 { 1.0 } else { 1.0 / pivot };
            for entry in start..end {
                place[columns[entry] as usize - first] = usize::MAX;
            }
        }
    }

    fn apply(
        &self,
        columns: &[u32],
        diagonal: &[usize],
        vector: &[[f64; 3]],
        result: &mut [[f64; 3]],
    ) {
        let (first, base) = (self.rows.start, self.base);
        for row in self.rows.clone() {
            let mut total = vector[row];
            for entry in self.inside[row - first].0..diagonal[row] {
                let (value, known) =
                    (self.values[entry - base], &result[columns[entry] as usize - first]);
                for component in 0..3 {
                    total[component] -= value * known[component];
                }
            }
            result[row - first] = total;
        }
        for row in self.rows.clone().rev() {
            let mut total = result[row - first];
            for entry in diagonal[row] + 1..self.inside[row - first].1 {
                let (value, known) =
                    (self.values[entry - base], &result[columns[entry] as usize - first]);
                for component in 0..3 {
                    total[component] -= value * known[component];
                }
            }
            result[row - first] = total.map(|value| value * self.pivots[row - first]);
        }
    }
}
