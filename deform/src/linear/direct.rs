//! The system that multigrid ends with.

use std::sync::Arc;

use super::cholesky::Factor;
use super::gauss_seidel::Pieces;
use super::hierarchy::{COARSEST, Hierarchy, Vectors};
use super::parts::Parts;
use super::real::Real;
use super::{Block, SparseMatrix, add};
use crate::partition::{Partition, Shares};

/// A small system that is solved as a whole. Where its rows are spread over ranks, each of them has the whole of it.
#[derive(Debug)]
pub(super) struct Direct<T, const B: usize> {
    inverse: Inverse<T, B>,
    rows: usize,
    pieces: Pieces,
    spread: Option<Spread>,
}

/// What stands for the inverse of a matrix.
#[derive(Debug)]
enum Inverse<T, const B: usize> {
    Factor(Box<Factor<B>>),
    /// A cycle: many ranks have many rows between them, however few each of them has.
    Cycle(Box<Hierarchy<T, B, B>>),
}

impl<T: Real, const B: usize> Inverse<T, B> {
    fn new(matrix: &SparseMatrix<B>) -> Option<Self> {
        if B * matrix.rows() <= COARSEST {
            return Factor::new(matrix).map(|factor| Self::Factor(Box::new(factor)));
        }
        Hierarchy::new(matrix, None, None, None).map(|levels| Self::Cycle(Box::new(levels)))
    }

    fn apply<const K: usize>(&self, vector: &[[[f64; B]; K]], result: &mut [[[f64; B]; K]]) {
        match self {
            Self::Factor(factor) => factor.solve(vector, result),
            Self::Cycle(levels) => levels.apply(&mut levels.workspace(), [1.0; K], vector, result),
        }
    }
}

/// The rows of one rank.
#[derive(Debug)]
struct Spread {
    partition: Arc<dyn Partition>,
    /// What is shared of vectors, which are in the order of the pieces.
    shares: Shares,
    /// The numbers of the rows among the rows of all ranks.
    numbers: Vec<usize>,
}

impl<T: Real, const B: usize> Direct<T, B> {
    /// `None` where there is no inverse. `pieces` is the order of this rank's own rows in vectors. Collective over the ranks of `parts`;
    /// the matrix is then an assembled one.
    pub(super) fn new(
        matrix: &SparseMatrix<B>,
        pieces: Pieces,
        parts: Option<&Parts>,
    ) -> Option<Self> {
        let rows = matrix.rows();
        let Some(parts) = parts else {
            return Some(Self { inverse: Inverse::new(matrix)?, rows, pieces, spread: None });
        };
        let (spread, whole) = Spread::new(parts, matrix, pieces);
        Some(Self { inverse: Inverse::new(&whole)?, rows, pieces, spread: Some(spread) })
    }

    pub(super) fn rows(&self) -> usize {
        self.rows
    }

    /// Adds up what the ranks have of each row.
    pub(super) fn sum<const K: usize>(&self, right_side: &mut [[[T; B]; K]]) {
        if let Some(Spread { partition, shares, .. }) = &self.spread {
            shares.sum_real(&**partition, B * K, right_side.as_flattened_mut().as_flattened_mut());
        }
    }

    /// The solution for the right side, which is that of the sum.
    pub(super) fn solve<const K: usize>(&self, vectors: &mut Vectors<T, B, K>) {
        let own = 0..self.pieces.rows();
        let wide = |row: usize| {
            vectors.right_side[self.pieces.slot(row)].map(|column| column.map(T::wide))
        };
        let mut right_side: Vec<[[f64; B]; K]> = own.map(wide).collect();
        if let Some(spread) = &self.spread {
            let all = spread.partition.gather(right_side.as_flattened().as_flattened());
            right_side = all.as_chunks::<B>().0.as_chunks::<K>().0.to_vec();
        }
        let mut solution = right_side.clone();
        self.inverse.apply(&right_side, &mut solution);
        for row in 0..self.rows {
            let number = self.spread.as_ref().map_or(row, |spread| spread.numbers[row]);
            vectors.solution[self.pieces.slot(row)] =
                solution[number].map(|column| column.map(T::of));
        }
    }
}

impl Spread {
    /// The rows, and the sum of the ranks' matrices.
    #[expect(
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "numbers of rows, which are 32-bit"
    )]
    fn new<const B: usize>(
        parts: &Parts,
        matrix: &SparseMatrix<B>,
        pieces: Pieces,
    ) -> (Self, SparseMatrix<B>) {
        let (partition, own) = (Arc::clone(parts.partition()), parts.own());
        let counts = partition.gather(&[own as f64]);
        let first: f64 = counts.iter().take(partition.rank()).sum();
        let total: f64 = counts.iter().sum();
        let mut numbers: Vec<f64> = (0..parts.rows()).map(|row| first + row as f64).collect();
        parts.shares().spread(&*partition, 1, &mut numbers);
        let numbers: Vec<usize> = numbers.into_iter().map(|number| number as usize).collect();
        let mut entries: Vec<f64> = Vec::new();
        for row in 0..matrix.rows() {
            let (columns, blocks) = matrix.row(row);
            for (&column, block) in columns.iter().zip(blocks) {
                entries.extend([numbers[row] as f64, numbers[column as usize] as f64]);
                entries.extend(block.as_flattened());
            }
        }
        let all = partition.gather(&entries);
        let all = all.chunks_exact(2 + B * B).map(|entry| {
            let block = std::array::from_fn(|i| std::array::from_fn(|j| entry[2 + B * i + j]));
            (entry[0] as usize, entry[1] as u32, block)
        });
        let slot = |row: u32| pieces.slot(row as usize) as u32;
        let shares = parts.shares().moved(slot);
        (Self { partition, shares, numbers }, summed(total as usize, all.collect()))
    }
}

/// The matrix of so many rows whose blocks are the sums of those given for their places.
fn summed<const B: usize>(
    rows: usize,
    mut entries: Vec<(usize, u32, Block<B>)>,
) -> SparseMatrix<B> {
    // Those of one place stay as they came, so that sums are always taken in the same order.
    entries.sort_by_key(|&(row, column, _)| (row, column));
    let (mut offsets, mut columns, mut blocks) = (vec![0], Vec::new(), Vec::<Block<B>>::new());
    let mut last = None;
    for (row, column, block) in entries {
        match blocks.last_mut().filter(|_| last == Some((row, column))) {
            Some(sum) => add(sum, &block),
            None => {
                while offsets.len() <= row {
                    offsets.push(columns.len());
                }
                columns.push(column);
                blocks.push(block);
            }
        }
        last = Some((row, column));
    }
    while offsets.len() <= rows {
        offsets.push(columns.len());
    }
    SparseMatrix::from_parts(offsets, columns, blocks)
}
