//! Rows cut into pieces that can be worked on at the same time.

use std::ops::Deref;

use super::SparseMatrix;
use super::real::Real;
use crate::parallel;

/// Rows are cut into at most this many pieces. Half of it bounds the threads that can be used.
const PIECES: usize = 32;

/// A piece has at least this many rows.
const PIECE_ROWS: usize = 256;

/// Rows cut into pieces at least as long as the matrix is wide about its diagonal, so that no piece
/// couples with any but the ones beside it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pieces {
    rows: usize,
    length: usize,
}

/// The parts of a vector in the pieces with even numbers, and in those with odd ones.
pub(super) type Halves<P> = (Vec<P>, Vec<P>);

/// What work on a piece has beside its own values: the values of the pieces before and after it,
/// and sums for the rows of all three. An even piece is by itself: its blocks with the pieces beside
/// it belong to these.
pub(super) struct Around<'a, V> {
    pub(super) before: &'a [V],
    pub(super) after: &'a [V],
    pub(super) sums_before: &'a mut [V],
    pub(super) sums: &'a mut [V],
    pub(super) sums_after: &'a mut [V],
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
        Self { rows, length: rows.div_ceil(PIECES).max(PIECE_ROWS).max(width) }
    }

    /// One piece.
    pub(super) fn whole(rows: usize) -> Self {
        Self { rows, length: rows.max(1) }
    }

    pub(super) fn rows(&self) -> usize {
        self.rows
    }

    /// The number of rows in each piece but the last.
    pub(super) fn length(&self) -> usize {
        self.length
    }

    /// The rows in pieces with odd numbers, were the last of these whole.
    pub(super) fn odd_rows(&self) -> usize {
        self.rows.div_ceil(self.length) / 2 * self.length
    }

    /// The first row of the piece that a row is in, and whether that has an odd number.
    pub(super) fn start(&self, row: usize) -> (usize, bool) {
        let piece = row / self.length;
        (piece * self.length, piece % 2 == 1)
    }

    /// A value for each row, piece by piece.
    pub(super) fn halves<'a, V>(&self, values: &'a [V]) -> Halves<&'a [V]> {
        halves(values.chunks(self.length))
    }

    /// A value for each row, piece by piece, to be changed.
    pub(super) fn halves_mut<'a, V>(&self, values: &'a mut [V]) -> Halves<&'a mut [V]> {
        halves(values.chunks_mut(self.length))
    }

    /// Calls `work` with the first row of each even piece, its part of a vector and its sums, all of
    /// them at the same time.
    pub(super) fn through_even<V: Send, P: Send>(
        &self,
        even: impl IntoIterator<Item = P>,
        sums: &mut [&mut [V]],
        work: impl Fn(usize, P, Around<'_, V>) + Sync,
    ) {
        let parts = even.into_iter().zip(sums).enumerate().collect();
        parallel::for_each(parts, |(number, (own, sums)): (usize, (P, &mut &mut [V]))| {
            let (before, after, sums_before, sums_after) =
                (&[][..], &[][..], &mut [][..], &mut [][..]);
            work(
                2 * number * self.length,
                own,
                Around { before, after, sums_before, sums, sums_after },
            );
        });
    }

    /// Calls `work` with the first row of each odd piece, its part of a vector and its sums, all of
    /// them at the same time. `even` is the vector in the even pieces, and `beside` memory for
    /// [`Pieces::odd_rows`].
    pub(super) fn through_odd<T: Real, const B: usize, const K: usize, P: Send>(
        &self,
        even: &[impl Deref<Target = [[[T; B]; K]]> + Sync],
        odd: impl IntoIterator<Item = P>,
        even_sums: &mut [&mut [[[T; B]; K]]],
        odd_sums: Vec<&mut [[[T; B]; K]]>,
        beside: &mut [[[T; B]; K]],
        work: impl Fn(usize, P, Around<'_, [[T; B]; K]>) + Sync,
    ) {
        // A piece has an odd one on both sides: what the one before it finds for it is added
        // afterwards.
        let all = odd.into_iter().zip(odd_sums).zip(&mut *even_sums);
        let parts = all.zip(beside.chunks_mut(self.length)).enumerate().collect::<Vec<_>>();
        parallel::for_each(parts, |(number, (((own, sums), sums_before), sums_after))| {
            sums_after.fill([[T::default(); B]; K]);
            let before = even.get(number).map_or(&[][..], |piece| piece);
            let after = even.get(number + 1).map_or(&[][..], |piece| piece);
            let around = Around { before, after, sums_before, sums, sums_after };
            work((2 * number + 1) * self.length, own, around);
        });
        let parts =
            even_sums.iter_mut().skip(1).zip(beside.chunks(self.length)).collect::<Vec<_>>();
        parallel::for_each(parts, |(sums, beside)| {
            for (sum, more) in sums.as_flattened_mut().iter_mut().zip(beside.as_flattened()) {
                sum.iter_mut().zip(more).for_each(|(sum, &more)| *sum += more);
            }
        });
    }
}

fn halves<P>(pieces: impl Iterator<Item = P>) -> Halves<P> {
    let (mut even, mut odd) = (Vec::new(), Vec::new());
    for (number, piece) in pieces.enumerate() {
        if number % 2 == 0 { even.push(piece) } else { odd.push(piece) }
    }
    (even, odd)
}

/// The columns of a row that are below `count`.
pub(super) fn among<const B: usize>(matrix: &SparseMatrix<B>, row: usize, count: usize) -> &[u32] {
    let columns = matrix.row(row).0;
    // Most rows have no others.
    match columns.last() {
        Some(&last) if last as usize >= count => {
            &columns[..columns.partition_point(|&column| (column as usize) < count)]
        }
        _ => columns,
    }
}
