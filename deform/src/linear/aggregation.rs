//! Coarser systems by smoothed aggregation.

use super::matrix::invert_positive;
use super::{Block, ROW_CHUNK, SparseMatrix};
use crate::parallel;

/// How many coarse rows are worked on at a time.
const COARSE_CHUNK: usize = 64;

/// A row that belongs to no aggregate.
const NONE: u32 = u32::MAX;

/// Rows put together into coarser ones.
#[derive(Debug, Clone)]
pub(super) struct Aggregates {
    /// For each block of the matrix, whether it counts in smoothing.
    strong: Vec<bool>,
    /// The aggregate of each row.
    of_row: Vec<u32>,
    count: usize,
}

impl Aggregates {
    /// Rows with the rows that they are strongly coupled to: `|A_ij|² > threshold² |A_ii| |A_jj|`. A row that is so coupled
    /// to none is in no aggregate: smoothing alone solves for it.
    pub(super) fn new<const B: usize>(matrix: &SparseMatrix<B>, threshold: f64) -> Self {
        let rows = matrix.rows();
        let sizes: Vec<f64> = parallel::map_chunks(rows, ROW_CHUNK, |range| {
            let size = |row: usize| {
                let (columns, blocks) = matrix.row(row);
                let place = columns.binary_search_by_key(&row, |&column| column as usize);
                place.map_or(0.0, |place| square(&blocks[place]).sqrt())
            };
            range.map(size).collect::<Vec<_>>()
        })
        .concat();
        let threshold = threshold * threshold;
        let strong: Vec<bool> = parallel::map_chunks(rows, ROW_CHUNK, |range| {
            let mut strong = Vec::with_capacity(matrix.offsets()[range.end] - matrix.offsets()[range.start]);
            for row in range {
                let (columns, blocks) = matrix.row(row);
                strong.extend(columns.iter().zip(blocks).map(|(&column, block)| {
                    let other = column as usize;
                    other != row && square(block) > threshold * sizes[row] * sizes[other]
                }));
            }
            strong
        })
        .concat();
        let (of_row, count) = group(matrix, &strong);
        Self { strong, of_row, count }
    }

    /// The interpolation from the aggregates to the rows: constant on each, smoothed by one step of damped Jacobi with the
    /// matrix whose weak blocks are lumped into the diagonal (P. Vaněk, J. Mandel, M. Brezina 1996).
    pub(super) fn prolongation<const B: usize>(&self, matrix: &SparseMatrix<B>, damping: f64) -> SparseMatrix<B> {
        let offsets = matrix.offsets();
        let parts = parallel::map_chunks(matrix.rows(), ROW_CHUNK, |range| {
            let mut found = RowsFound::default();
            let mut row_blocks: Vec<(u32, Block<B>)> = Vec::new();
            for row in range {
                row_blocks.clear();
                let (columns, blocks) = matrix.row(row);
                let strong = &self.strong[offsets[row]..offsets[row + 1]];
                let mut diagonal = [[0.0; B]; B];
                let mut whole = [[0.0; B]; B];
                for ((&column, block), &strong) in columns.iter().zip(blocks).zip(strong) {
                    if column as usize == row {
                        whole = *block;
                    }
                    if !strong {
                        accumulate(&mut diagonal, block, 1.0);
                        continue;
                    }
                    let aggregate = self.of_row[column as usize];
                    if aggregate == NONE {
                        continue;
                    }
                    match row_blocks.iter_mut().find(|(other, _)| *other == aggregate) {
                        Some((_, sum)) => accumulate(sum, block, 1.0),
                        None => row_blocks.push((aggregate, *block)),
                    }
                }
                let own = self.of_row[row];
                if own == NONE {
                    found.lengths.push(0);
                    continue;
                }
                let lumped = invert_positive(&diagonal).filter(|_| dominates(&diagonal, &whole));
                let inverse = match lumped.or_else(|| {
                    diagonal = whole;
                    invert_positive(&whole)
                }) {
                    Some(inverse) => inverse,
                    None => [[0.0; B]; B],
                };
                // With the diagonal's own block the smoother takes off `damping` of the constant.
                match row_blocks.iter_mut().find(|(other, _)| *other == own) {
                    Some((_, sum)) => accumulate(sum, &diagonal, 1.0),
                    None => row_blocks.push((own, diagonal)),
                }
                row_blocks.sort_unstable_by_key(|(aggregate, _)| *aggregate);
                for (aggregate, sum) in &row_blocks {
                    let mut value = product(&inverse, sum).map(|entries| entries.map(|entry| -damping * entry));
                    if *aggregate == own {
                        for (axis, entries) in value.iter_mut().enumerate() {
                            entries[axis] += 1.0;
                        }
                    }
                    found.columns.push(*aggregate);
                    found.blocks.push(value);
                }
                found.lengths.push(row_blocks.len());
            }
            found
        });
        collect(matrix.rows(), ROW_CHUNK, &parts)
    }

    /// How many aggregates there are.
    pub(super) fn count(&self) -> usize {
        self.count
    }
}

/// Each row that is free, with all that it is coupled to, makes an aggregate; then what is left joins its neighbours.
fn group<const B: usize>(matrix: &SparseMatrix<B>, strong: &[bool]) -> (Vec<u32>, usize) {
    let (offsets, columns) = (matrix.offsets(), matrix.columns());
    let neighbours = |row: usize| {
        let range = offsets[row]..offsets[row + 1];
        columns[range.clone()]
            .iter()
            .zip(&strong[range])
            .filter(|(_, strong)| **strong)
            .map(|(&column, _)| column as usize)
    };
    let mut of_row = vec![NONE; matrix.rows()];
    let mut count = 0u32;
    for row in 0..matrix.rows() {
        if of_row[row] == NONE && neighbours(row).next().is_some() && neighbours(row).all(|other| of_row[other] == NONE)
        {
            of_row[row] = count;
            for other in neighbours(row) {
                of_row[other] = count;
            }
            count += 1;
        }
    }
    let first = of_row.clone();
    for (row, own) in of_row.iter_mut().enumerate() {
        if *own == NONE
            && let Some(other) = neighbours(row).find(|&other| first[other] != NONE)
        {
            *own = first[other];
        }
    }
    for row in 0..matrix.rows() {
        if of_row[row] == NONE && neighbours(row).next().is_some() {
            of_row[row] = count;
            for other in neighbours(row) {
                if of_row[other] == NONE {
                    of_row[other] = count;
                }
            }
            count += 1;
        }
    }
    (of_row, count as usize)
}

/// `Pᵀ A P` for the matrix `A` and interpolation `P`, with as many rows as `P` has columns.
pub(super) fn galerkin<const B: usize>(
    matrix: &SparseMatrix<B>,
    prolongation: &SparseMatrix<B>,
    count: usize,
) -> SparseMatrix<B> {
    let image = parallel::map_chunks(matrix.rows(), ROW_CHUNK, |range| {
        let mut row = Accumulator::new(count);
        let mut found = RowsFound::default();
        for index in range {
            let (columns, blocks) = matrix.row(index);
            for (&column, block) in columns.iter().zip(blocks) {
                let (aggregates, values) = prolongation.row(column as usize);
                for (&aggregate, value) in aggregates.iter().zip(values) {
                    add_product(row.at(aggregate), block, value);
                }
            }
            row.finish(&mut found);
        }
        found
    });
    let image = collect(matrix.rows(), ROW_CHUNK, &image);
    let (starts, entries) = transpose(prolongation, count);
    let parts = parallel::map_chunks(count, COARSE_CHUNK, |range| {
        let mut row = Accumulator::new(count);
        let mut found = RowsFound::default();
        for coarse in range {
            for &(fine, place) in &entries[starts[coarse]..starts[coarse + 1]] {
                let value = &prolongation.values()[place as usize];
                let (columns, blocks) = image.row(fine as usize);
                for (&column, block) in columns.iter().zip(blocks) {
                    add_transposed_product(row.at(column), value, block);
                }
            }
            row.finish(&mut found);
        }
        found
    });
    collect(count, COARSE_CHUNK, &parts)
}

/// For each column of a matrix the rows that have a block there, and where in the matrix that is.
pub(super) fn transpose<const B: usize>(matrix: &SparseMatrix<B>, columns: usize) -> (Vec<usize>, Vec<(u32, u32)>) {
    let mut starts = vec![0usize; columns + 2];
    for &column in matrix.columns() {
        starts[column as usize + 2] += 1;
    }
    for column in 2..starts.len() {
        starts[column] += starts[column - 1];
    }
    let mut entries = vec![(0, 0); matrix.columns().len()];
    #[expect(clippy::cast_possible_truncation, reason = "rows are 32-bit, and they have few blocks")]
    for row in 0..matrix.rows() {
        for place in matrix.offsets()[row]..matrix.offsets()[row + 1] {
            let next = &mut starts[matrix.columns()[place] as usize + 1];
            entries[*next] = (row as u32, place as u32);
            *next += 1;
        }
    }
    starts.pop();
    (starts, entries)
}

/// Some rows of a matrix while it is built.
#[derive(Debug)]
struct RowsFound<const B: usize> {
    lengths: Vec<usize>,
    columns: Vec<u32>,
    blocks: Vec<Block<B>>,
}

impl<const B: usize> Default for RowsFound<B> {
    fn default() -> Self {
        Self { lengths: Vec::new(), columns: Vec::new(), blocks: Vec::new() }
    }
}

/// One matrix of rows that were built `chunk` at a time.
fn collect<const B: usize>(rows: usize, chunk: usize, parts: &[RowsFound<B>]) -> SparseMatrix<B> {
    let mut offsets = Vec::with_capacity(rows + 1);
    offsets.push(0);
    let mut end = 0;
    for length in parts.iter().flat_map(|part| &part.lengths) {
        end += length;
        offsets.push(end);
    }
    let mut columns = vec![0; end];
    let mut blocks = vec![[[0.0; B]; B]; end];
    parallel::for_each_rows(chunk, (&offsets, &mut columns), (&offsets, &mut blocks), |rows, columns, blocks| {
        let part = &parts[rows.start / chunk];
        columns.copy_from_slice(&part.columns);
        blocks.copy_from_slice(&part.blocks);
    });
    SparseMatrix::from_parts(offsets, columns, blocks)
}

/// A row that is dense to look up and sparse to walk.
struct Accumulator<const B: usize> {
    places: Vec<u32>,
    entries: Vec<(u32, Block<B>)>,
}

impl<const B: usize> Accumulator<B> {
    fn new(columns: usize) -> Self {
        Self { places: vec![NONE; columns], entries: Vec::new() }
    }

    #[inline]
    fn at(&mut self, column: u32) -> &mut Block<B> {
        let place = &mut self.places[column as usize];
        if *place == NONE {
            #[expect(clippy::cast_possible_truncation, reason = "a row has fewer blocks than there are columns")]
            (*place = self.entries.len() as u32);
            self.entries.push((column, [[0.0; B]; B]));
        }
        &mut self.entries[*place as usize].1
    }

    fn finish(&mut self, found: &mut RowsFound<B>) {
        self.entries.sort_unstable_by_key(|(column, _)| *column);
        found.lengths.push(self.entries.len());
        for (column, block) in self.entries.drain(..) {
            self.places[column as usize] = NONE;
            found.columns.push(column);
            found.blocks.push(block);
        }
    }
}

fn square<const B: usize>(block: &Block<B>) -> f64 {
    block.as_flattened().iter().map(|entry| entry * entry).sum()
}

/// Whether lumping has left enough of a diagonal block to divide by.
fn dominates<const B: usize>(lumped: &Block<B>, whole: &Block<B>) -> bool {
    (0..B).all(|axis| lumped[axis][axis] > 0.1 * whole[axis][axis])
}

#[inline(always)]
fn accumulate<const B: usize>(sum: &mut Block<B>, block: &Block<B>, factor: f64) {
    for (sum, entries) in sum.iter_mut().zip(block) {
        for (sum, entry) in sum.iter_mut().zip(entries) {
            *sum += factor * entry;
        }
    }
}

fn product<const B: usize>(a: &Block<B>, b: &Block<B>) -> Block<B> {
    let mut result = [[0.0; B]; B];
    add_product(&mut result, a, b);
    result
}

/// `sum += a b`.
#[inline(always)]
fn add_product<const B: usize>(sum: &mut Block<B>, a: &Block<B>, b: &Block<B>) {
    for (sum, row) in sum.iter_mut().zip(a) {
        for (&factor, other) in row.iter().zip(b) {
            for (sum, entry) in sum.iter_mut().zip(other) {
                *sum += factor * entry;
            }
        }
    }
}

/// `sum += aᵀ b`.
#[inline(always)]
fn add_transposed_product<const B: usize>(sum: &mut Block<B>, a: &Block<B>, b: &Block<B>) {
    for (row, other) in a.iter().zip(b) {
        for (sum, &factor) in sum.iter_mut().zip(row) {
            for (sum, entry) in sum.iter_mut().zip(other) {
                *sum += factor * entry;
            }
        }
    }
}
