//! The couplings of a level of multigrid between rows of different ranks.

use super::SparseMatrix;
use super::distribution::Distribution;
use super::real::Real;
use crate::communicator::Halo;

/// The damping added to the diagonal of a row, in parts of the sum of its couplings with rows of
/// other ranks. With half of it sweeps that each rank makes on its own rows cannot overshoot (A.
/// Baker, R. Falgout, T. Kolev, U. Yang, Multigrid smoothers for ultraparallel computing, 2011).
const DAMPING: f64 = 0.5;

/// The couplings of a level between rows of different ranks; vectors have this rank's own rows, and
/// then the others.
#[derive(Debug)]
pub(super) struct Border<T, const B: usize> {
    halo: Halo,
    own: usize,
    /// The rows of these couplings that this rank has.
    rows: Vec<u32>,
    offsets: Vec<usize>,
    columns: Vec<u32>,
    blocks: Vec<[[T; B]; B]>,
    /// The own rows that any rank has couplings of, and what is added to their diagonals.
    touched: Vec<(u32, [T; B])>,
}

impl<T: Real, const B: usize> Border<T, B> {
    /// The border of an assembled part, and what is added to the diagonal of each of its own rows.
    /// Collective.
    pub(super) fn new(rows: &Distribution, matrix: &SparseMatrix<B>) -> (Self, Vec<[f64; B]>) {
        let own = rows.own();
        let mut border = Self {
            halo: rows.halo().clone(),
            own,
            rows: Vec::new(),
            offsets: vec![0],
            columns: Vec::new(),
            blocks: Vec::new(),
            touched: Vec::new(),
        };
        let mut added = vec![[0.0; B]; rows.rows()];
        for row in (0..).take(rows.rows()) {
            let (columns, blocks) = matrix.row(row as usize);
            let from = if (row as usize) < own {
                columns.partition_point(|&column| (column as usize) < own)
            } else {
                0
            };
            if from == columns.len() {
                continue;
            }
            for (&column, block) in columns.iter().zip(blocks).skip(from) {
                border.columns.push(column);
                border.blocks.push(block.map(|entries| entries.map(T::of)));
                for (added, entries) in added[row as usize].iter_mut().zip(block) {
                    *added += DAMPING * entries.iter().map(|entry| entry.abs()).sum::<f64>();
                }
            }
            border.rows.push(row);
            border.offsets.push(border.columns.len());
        }
        rows.halo().sum(B, added.as_flattened_mut());
        added.truncate(own);
        let touched =
            (0..).zip(&added).filter(|(_, added)| added.iter().any(|&value| value != 0.0));
        border.touched = touched.map(|(row, added)| (row, added.map(T::of))).collect();
        (border, added)
    }

    /// Gives all ranks what the owners of the rows have found.
    pub(super) fn update<const K: usize>(&self, values: &mut [[[T; B]; K]]) {
        self.halo.update(B * K, values.as_flattened_mut().as_flattened_mut());
    }

    /// Adds up what the ranks have of each row.
    pub(super) fn sum<const K: usize>(&self, values: &mut [[[T; B]; K]]) {
        self.halo.sum(B * K, values.as_flattened_mut().as_flattened_mut());
    }

    /// Makes of the residual of each rank's own rows by themselves this rank's part of that of the
    /// system.
    pub(super) fn complete<const K: usize>(
        &self,
        solution: &[[[T; B]; K]],
        residual: &mut [[[T; B]; K]],
    ) {
        residual[self.own..].fill([[T::default(); B]; K]);
        for (row, added) in &self.touched {
            let row = *row as usize;
            for (value, found) in residual[row].iter_mut().zip(&solution[row]) {
                (0..B).for_each(|axis| value[axis] += added[axis] * found[axis]);
            }
        }
        self.multiply(solution, |value, found| *value += -found, residual);
    }

    /// Makes of the right side that of a sweep which starts from `solution`; `sums` is overwritten.
    pub(super) fn prepare<const K: usize>(
        &self,
        solution: &[[[T; B]; K]],
        right_side: &mut [[[T; B]; K]],
        sums: &mut [[[T; B]; K]],
    ) {
        sums[self.own..].fill([[T::default(); B]; K]);
        self.touched.iter().for_each(|(row, _)| sums[*row as usize] = [[T::default(); B]; K]);
        self.multiply(solution, |value, found| *value += found, sums);
        self.sum(sums);
        for (row, added) in &self.touched {
            let row = *row as usize;
            for column in 0..K {
                for axis in 0..B {
                    right_side[row][column][axis] +=
                        added[axis] * solution[row][column][axis] - sums[row][column][axis];
                }
            }
        }
    }

    /// Puts each value of the product with `vector` to those of `result`.
    fn multiply<const K: usize>(
        &self,
        vector: &[[[T; B]; K]],
        put: impl Fn(&mut T, T),
        result: &mut [[[T; B]; K]],
    ) {
        for (index, &row) in self.rows.iter().enumerate() {
            let mut sum = [[T::default(); B]; K];
            let range = self.offsets[index]..self.offsets[index + 1];
            for (&column, block) in self.columns[range.clone()].iter().zip(&self.blocks[range]) {
                for (sum, value) in sum.iter_mut().zip(&vector[column as usize]) {
                    for (sum, entries) in sum.iter_mut().zip(block) {
                        entries
                            .iter()
                            .zip(value)
                            .for_each(|(&entry, &value)| *sum += entry * value);
                    }
                }
            }
            let values = result[row as usize].as_flattened_mut().iter_mut();
            values.zip(sum.as_flattened()).for_each(|(value, &found)| put(value, found));
        }
    }
}
