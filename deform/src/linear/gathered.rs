//! The system that multigrid ends with, brought together from all ranks.

use std::borrow::Cow;

use super::distribution::Distribution;
use super::null_space::{Constants, NullSpace};
use super::real::Real;
use super::{Block, SparseMatrix, add};
use crate::communicator::{Communicator, Halo, Reader, Writer};

/// The rows of a small system that is solved as a whole. Where they are spread over ranks, each of
/// them has the whole of it.
#[derive(Debug)]
pub(super) struct Gathered {
    /// The constants of the whole system, where it is semi-definite.
    constants: Option<Constants>,
    rows: usize,
    /// How many of them this rank owns.
    own: usize,
    spread: Option<Spread>,
}

/// The rows of one rank.
#[derive(Debug)]
struct Spread {
    halo: Halo,
    /// The numbers of the rows among the rows of all ranks.
    numbers: Vec<usize>,
}

impl Gathered {
    /// The rows, and the matrix of the whole system. Collective over the ranks of a distribution; the matrix is then an assembled one.
    pub(super) fn new<'a, const B: usize>(
        matrix: &'a SparseMatrix<B>,
        distribution: Option<&Distribution>,
        null_space: NullSpace,
    ) -> (Self, Cow<'a, SparseMatrix<B>>) {
        let rows = matrix.rows();
        let (spread, whole) = match distribution {
            None => (None, Cow::Borrowed(matrix)),
            Some(distribution) => {
                let (spread, whole) = Spread::new(distribution, matrix);
                (Some(spread), Cow::Owned(whole))
            }
        };
        let constants =
            (null_space == NullSpace::Constants).then(|| Constants::new(&whole, &Halo::none()));
        (Self { constants, rows, own: distribution.map_or(rows, Distribution::own), spread }, whole)
    }

    /// How many rows this rank has in vectors, those of other ranks among them.
    pub(super) fn count(&self) -> usize {
        self.rows
    }

    /// Adds up what the ranks have of each row.
    pub(super) fn sum<T: Real, const B: usize, const K: usize>(
        &self,
        right_side: &mut [[[T; B]; K]],
    ) {
        if let Some(Spread { halo, .. }) = &self.spread {
            halo.sum(B * K, right_side.as_flattened_mut().as_flattened_mut());
        }
    }

    /// The solution for the right side, which is that of the sum. `apply` solves the whole system.
    pub(super) fn solve<T: Real, const B: usize, const K: usize>(
        &self,
        own_right_side: &[[[T; B]; K]],
        own_solution: &mut [[[T; B]; K]],
        apply: impl FnOnce(&[[[f64; B]; K]], &mut [[[f64; B]; K]]),
    ) {
        let own = own_right_side.iter().take(self.own);
        let mut right_side: Vec<[[f64; B]; K]> =
            own.map(|value| value.map(|column| column.map(T::wide))).collect();
        if let Some(spread) = &self.spread {
            right_side = spread.gathered(&right_side);
        }
        if let Some(constants) = &self.constants {
            constants.remove(&Halo::none(), &mut right_side);
        }
        let mut solution = right_side.clone();
        apply(&right_side, &mut solution);
        if let Some(constants) = &self.constants {
            constants.remove(&Halo::none(), &mut solution);
        }
        for (row, own) in own_solution.iter_mut().enumerate().take(self.rows) {
            let number = self.spread.as_ref().map_or(row, |spread| spread.numbers[row]);
            *own = solution[number].map(|column| column.map(T::of));
        }
    }
}

impl Spread {
    /// The rows, and the sum of the ranks' matrices.
    fn new<const B: usize>(
        distribution: &Distribution,
        matrix: &SparseMatrix<B>,
    ) -> (Self, SparseMatrix<B>) {
        let (communicator, own) = (distribution.communicator(), distribution.own() as u64);
        let counts = communicator.gather_all(&own.to_le_bytes());
        let counts = counts
            .iter()
            .enumerate()
            .map(|(rank, count)| Reader::new(rank, count).u64().unwrap_or(0));
        let counts: Vec<u64> = counts.collect();
        let first: u64 = counts[..communicator.rank()].iter().sum();
        let mut numbers: Vec<u64> = (first..).take(distribution.rows()).collect();
        distribution.halo().update(1, &mut numbers);
        let mut message = Writer::default();
        for row in 0..matrix.rows() {
            let (columns, blocks) = matrix.row(row);
            for (&column, block) in columns.iter().zip(blocks) {
                message.u64(numbers[row]);
                message.u64(numbers[column as usize]);
                message.f64s(block.as_flattened());
            }
        }
        let index = |number: u64| usize::try_from(number).unwrap_or(usize::MAX);
        let mut entries: Vec<(usize, u32, Block<B>)> = Vec::new();
        for (rank, bytes) in communicator.gather_all(&message.into_bytes()).iter().enumerate() {
            let mut reader = Reader::new(rank, bytes);
            while let (Ok(row), Ok(column), Ok(block)) =
                (reader.u64(), reader.u64(), reader.f64s(B * B))
            {
                let block = std::array::from_fn(|i| std::array::from_fn(|j| block[B * i + j]));
                entries.push((index(row), u32::try_from(column).unwrap_or(u32::MAX), block));
            }
        }
        let halo = distribution.halo().clone();
        let numbers = numbers.into_iter().map(index).collect();
        (Self { halo, numbers }, summed(index(counts.iter().sum()), entries))
    }

    /// The values of all ranks' own rows, on every rank.
    fn gathered<const B: usize, const K: usize>(
        &self,
        own: &[[[f64; B]; K]],
    ) -> Vec<[[f64; B]; K]> {
        let mut message = Writer::default();
        message.f64s(own.as_flattened().as_flattened());
        let all = self.halo.communicator().gather_all(&message.into_bytes()).concat();
        let values: Vec<f64> =
            all.as_chunks().0.iter().map(|value| f64::from_le_bytes(*value)).collect();
        values.as_chunks::<B>().0.as_chunks::<K>().0.to_vec()
    }
}

/// The matrix of so many rows whose blocks are the sums of the entries of the same row and column.
fn summed<const B: usize>(
    rows: usize,
    mut entries: Vec<(usize, u32, Block<B>)>,
) -> SparseMatrix<B> {
    // The sort is stable: the entries of a block are always added in the same order.
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
