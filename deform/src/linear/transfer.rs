//! Between a system and the next coarser one.

use std::ops::Range;

use super::real::Real;
use super::{Block, ROW_CHUNK, SparseMatrix};
use crate::number::index;
use crate::parallel;
use crate::topology::Groups;
use crate::vector::{Vector, cross};

/// How many coarse rows are worked on at a time.
const COARSE_CHUNK: usize = 64;

/// How many coarse rows may need parts of `A P` at a time; whole chunks.
const COARSE_WINDOW: usize = 16 * COARSE_CHUNK;

/// A column that the present row has no block in.
const NONE: u32 = u32::MAX;

/// How much stiffer against turning an aggregate is made than it is, in parts of its stiffness
/// against shifts: what lies on one line, or is one vertex, does not resist all turns.
const TURNING: f64 = 1e-4;

/// How coarse values make fine ones, in compressed rows: each by a weight.
///
/// Coarse values of 6 entries are a shift and a turn; there is an arm for each weight then, and a
/// fine shift is the sum of `weight shift + turn × arm`, a fine turn that of `turn_factor weight
/// turn`.
#[derive(Debug, Clone, Default)]
pub(super) struct Interpolation {
    pub(super) offsets: Vec<usize>,
    pub(super) columns: Vec<u32>,
    pub(super) weights: Vec<f64>,
    pub(super) arms: Vec<Vector>,
    pub(super) turn: f64,
}

impl Interpolation {
    pub(super) fn rows(&self) -> usize {
        self.offsets.len() - 1
    }

    fn arm(&self, entry: usize) -> Vector {
        self.arms.get(entry).copied().unwrap_or_default()
    }

    /// The rows that have a weight in each column, and the indices of these weights.
    pub(super) fn transposed(&self, columns: usize) -> Transposed {
        let weights = self.offsets.windows(2).zip(0..).flat_map(|(range, row)| {
            let weights = self.columns[range[0]..range[1]].iter().zip(index(range[0])..);
            weights.map(move |(&column, weight)| (column, (row, weight)))
        });
        Groups::new(columns, weights)
    }
}

/// An interpolation by its columns: rows, and the indices of their weights.
pub(super) type Transposed = Groups<(u32, u32)>;

/// A block of a coarse column in a fine row.
type Image<const F: usize, const C: usize> = [[f64; C]; F];

/// `Pᵀ A P` for the matrix `A` and interpolation `P`, with as many rows as `P` has columns;
/// `transposed` is that of `P`. `sizes` are those of the aggregates, where they turn.
pub(super) fn galerkin<const F: usize, const C: usize>(
    matrix: &SparseMatrix<F>,
    interpolation: &Interpolation,
    transposed: &Transposed,
    sizes: &[f64],
) -> SparseMatrix<C> {
    let count = transposed.offsets.len() - 1;
    let image_of = |chunk: usize| {
        let mut row = Accumulator::new(count, [[0.0; C]; F]);
        let mut found: RowsFound<Image<F, C>> = RowsFound::default();
        for index in chunk * ROW_CHUNK..((chunk + 1) * ROW_CHUNK).min(matrix.rows()) {
            let (columns, blocks) = matrix.row(index);
            for (&column, block) in columns.iter().zip(blocks) {
                let column = column as usize;
                for entry in interpolation.offsets[column]..interpolation.offsets[column + 1] {
                    let sum = row.at(interpolation.columns[entry]);
                    let (weight, arm) = (interpolation.weights[entry], interpolation.arm(entry));
                    for (sum, entries) in sum.iter_mut().zip(block) {
                        add_row(sum, entries, weight, arm, interpolation.turn);
                    }
                }
            }
            // The sums that follow take the columns in any order.
            row.finish(&mut found);
        }
        found
    };
    let sums_of = |image: &[RowsFound<Image<F, C>>], range: Range<usize>| {
        let mut row = Accumulator::new(count, [[0.0; C]; C]);
        let mut found = RowsFound::default();
        for coarse in range {
            for &(fine, entry) in transposed.of(index(coarse)) {
                let (fine, entry) = (fine as usize, entry as usize);
                let (weight, arm) = (interpolation.weights[entry], interpolation.arm(entry));
                let (columns, blocks) = image[fine / ROW_CHUNK].row(fine % ROW_CHUNK);
                for (&column, block) in columns.iter().zip(blocks) {
                    add_rows(row.at(column), block, weight, arm, interpolation.turn);
                }
            }
            if C == 6 {
                let own = row.at(index(coarse));
                let stiffness =
                    TURNING * sizes[coarse] * sizes[coarse] * (own[0][0] + own[1][1] + own[2][2])
                        / 3.0;
                for (axis, entries) in own.iter_mut().enumerate().skip(3) {
                    entries[axis] += stiffness;
                }
            }
            row.sort();
            row.finish(&mut found);
        }
        found
    };
    // `A P` is made where the first coarse row needs it, and given up after the last: where rows are
    // numbered well, little of it is there at a time.
    let chunks = |coarse: usize| {
        transposed.of(index(coarse)).iter().map(|&(fine, _)| fine as usize / ROW_CHUNK)
    };
    let mut last = vec![None; matrix.rows().div_ceil(ROW_CHUNK)];
    (0..count).for_each(|coarse| chunks(coarse).for_each(|chunk| last[chunk] = Some(coarse)));
    let mut image: Vec<RowsFound<Image<F, C>>> = Vec::new();
    image.resize_with(last.len(), RowsFound::default);
    let mut is_made = vec![false; last.len()];
    let mut parts = Vec::with_capacity(count.div_ceil(COARSE_CHUNK));
    for start in (0..count).step_by(COARSE_WINDOW) {
        let end = (start + COARSE_WINDOW).min(count);
        let mut missing = Vec::new();
        for chunk in (start..end).flat_map(chunks) {
            if !std::mem::replace(&mut is_made[chunk], true) {
                missing.push(chunk);
            }
        }
        let made = parallel::map_chunks(missing.len(), 1, |range| image_of(missing[range.start]));
        missing.into_iter().zip(made).for_each(|(chunk, made)| image[chunk] = made);
        parts.extend(parallel::map_chunks(end - start, COARSE_CHUNK, |range| {
            sums_of(&image, start + range.start..start + range.end)
        }));
        for (rows, last) in image.iter_mut().zip(&last) {
            if last.is_none_or(|last| last < end) {
                *rows = RowsFound::default();
            }
        }
    }
    collected(COARSE_CHUNK, &parts)
}

/// `sum += row P_block` for one row of a block of the matrix.
#[inline(always)]
fn add_row<const F: usize, const C: usize>(
    sum: &mut [f64; C],
    row: &[f64; F],
    weight: f64,
    arm: Vector,
    turn_factor: f64,
) {
    for (sum, entry) in sum.iter_mut().zip(row).take(if C == 6 { 3 } else { C }) {
        *sum += weight * entry;
    }
    if C == 6 {
        for (axis, turn) in cross(arm, first_three(row)).into_iter().enumerate() {
            sum[3 + axis] += turn;
            if F == 6 {
                sum[3 + axis] += turn_factor * weight * row[3 + axis];
            }
        }
    }
}

/// `sum += P_blockᵀ block`.
#[inline(always)]
fn add_rows<const F: usize, const C: usize>(
    sum: &mut Block<C>,
    block: &Image<F, C>,
    weight: f64,
    arm: Vector,
    turn_factor: f64,
) {
    for (sum, row) in sum.iter_mut().zip(block).take(if C == 6 { 3 } else { C }) {
        for (sum, entry) in sum.iter_mut().zip(row) {
            *sum += weight * entry;
        }
    }
    if C == 6 && F >= 3 {
        for column in 0..C {
            let turn = cross(arm, [block[0][column], block[1][column], block[2][column]]);
            for (axis, turn) in turn.into_iter().enumerate() {
                sum[3 + axis][column] += turn;
                if F == 6 {
                    sum[3 + axis][column] += turn_factor * weight * block[3 + axis][column];
                }
            }
        }
    }
}

fn first_three<const F: usize>(row: &[f64; F]) -> Vector {
    row.first_chunk().copied().unwrap_or_default()
}

/// Some rows of a matrix while it is built.
#[derive(Debug)]
pub(super) struct RowsFound<T> {
    /// Where each row ends.
    ends: Vec<usize>,
    columns: Vec<u32>,
    blocks: Vec<T>,
}

impl<T> Default for RowsFound<T> {
    fn default() -> Self {
        Self { ends: Vec::new(), columns: Vec::new(), blocks: Vec::new() }
    }
}

impl<T> RowsFound<T> {
    /// One more block of the row that is being built.
    pub(super) fn push(&mut self, column: u32, block: T) {
        self.columns.push(column);
        self.blocks.push(block);
    }

    /// The row is complete.
    pub(super) fn end(&mut self) {
        self.ends.push(self.columns.len());
    }

    fn row(&self, row: usize) -> (&[u32], &[T]) {
        let range = row.checked_sub(1).map_or(0, |before| self.ends[before])..self.ends[row];
        (&self.columns[range.clone()], &self.blocks[range])
    }
}

/// One matrix of rows that were built `chunk` at a time.
pub(super) fn collected<const B: usize>(
    chunk: usize,
    parts: &[RowsFound<Block<B>>],
) -> SparseMatrix<B> {
    let mut offsets = vec![0];
    let mut base = 0;
    for part in parts {
        offsets.extend(part.ends.iter().map(|end| base + end));
        base += part.columns.len();
    }
    let mut columns = vec![0; base];
    let mut blocks = vec![[[0.0; B]; B]; base];
    parallel::for_each_rows(
        chunk,
        (&offsets, &mut columns),
        (&offsets, &mut blocks),
        |rows, columns, blocks| {
            let part = &parts[rows.start / chunk];
            columns.copy_from_slice(&part.columns);
            blocks.copy_from_slice(&part.blocks);
        },
    );
    SparseMatrix::from_parts(offsets, columns, blocks)
}

/// A row that is dense to look up and sparse to walk.
struct Accumulator<T> {
    indices: Vec<u32>,
    entries: Vec<(u32, T)>,
    zero: T,
}

impl<T: Copy> Accumulator<T> {
    fn new(columns: usize, zero: T) -> Self {
        Self { indices: vec![NONE; columns], entries: Vec::new(), zero }
    }

    #[inline]
    fn at(&mut self, column: u32) -> &mut T {
        let entry = &mut self.indices[column as usize];
        if *entry == NONE {
            *entry = index(self.entries.len());
            self.entries.push((column, self.zero));
        }
        &mut self.entries[*entry as usize].1
    }

    /// Puts the entries in the order of their columns; nothing may be looked up any more.
    fn sort(&mut self) {
        self.entries.sort_unstable_by_key(|(column, _)| *column);
    }

    fn finish(&mut self, found: &mut RowsFound<T>) {
        for (column, _) in &self.entries {
            self.indices[*column as usize] = NONE;
        }
        for (column, block) in self.entries.drain(..) {
            found.push(column, block);
        }
        found.end();
    }
}

/// An [`Interpolation`] or its transpose, as cycles use it.
#[derive(Debug)]
pub(super) struct Transfer<T> {
    offsets: Vec<usize>,
    columns: Vec<u32>,
    weights: Vec<T>,
    arms: Vec<[T; 3]>,
    turn: T,
}

impl<T: Real> Transfer<T> {
    /// The interpolation.
    pub(super) fn interpolation(from: &Interpolation) -> Self {
        Self::new(from.rows(), from, |row, push| {
            for entry in from.offsets[row]..from.offsets[row + 1] {
                push(from.columns[entry], entry);
            }
        })
    }

    /// The restriction: the transpose of an interpolation.
    pub(super) fn restriction(from: &Interpolation, transposed: &Transposed) -> Self {
        Self::new(transposed.offsets.len() - 1, from, |row, push| {
            for &(fine, entry) in transposed.of(index(row)) {
                push(fine, entry as usize);
            }
        })
    }

    fn new(
        count: usize,
        from: &Interpolation,
        row: impl Fn(usize, &mut dyn FnMut(u32, usize)) + Sync,
    ) -> Self {
        let parts = parallel::map_chunks(count, ROW_CHUNK, |range| {
            let (mut ends, mut found) = (Vec::with_capacity(range.len()), Vec::new());
            for index in range {
                row(index, &mut |column, entry| found.push((column, entry)));
                ends.push(found.len());
            }
            (ends, found)
        });
        let mut result = Self {
            offsets: vec![0],
            columns: Vec::with_capacity(from.columns.len()),
            weights: Vec::with_capacity(from.columns.len()),
            arms: Vec::with_capacity(from.arms.len()),
            turn: T::of(from.turn),
        };
        for (ends, found) in parts {
            let base = result.columns.len();
            result.offsets.extend(ends.into_iter().map(|end| base + end));
            result.columns.extend(found.iter().map(|&(column, _)| column));
            result.weights.extend(found.iter().map(|&(_, entry)| T::of(from.weights[entry])));
            if !from.arms.is_empty() {
                result.arms.extend(found.iter().map(|&(_, entry)| from.arms[entry].map(T::of)));
            }
        }
        result
    }

    /// `value += P coarse` for one row.
    #[inline(always)]
    pub(super) fn interpolate<const F: usize, const C: usize, const K: usize>(
        &self,
        row: usize,
        coarse: &[[[T; C]; K]],
        value: &mut [[T; F]; K],
    ) {
        for entry in self.offsets[row]..self.offsets[row + 1] {
            let weight = self.weights[entry];
            for (value, coarse) in value.iter_mut().zip(&coarse[self.columns[entry] as usize]) {
                for (value, &coarse) in
                    value.iter_mut().zip(coarse).take(if C == 6 { 3 } else { C })
                {
                    *value += weight * coarse;
                }
                if C == 6 && F >= 3 {
                    let turn = [coarse[3], coarse[4], coarse[5]];
                    for (value, moved) in value.iter_mut().zip(product(turn, self.arms[entry])) {
                        *value += moved;
                    }
                    if F == 6 {
                        for (value, &coarse) in value.iter_mut().zip(coarse).skip(3) {
                            *value += self.turn * weight * coarse;
                        }
                    }
                }
            }
        }
    }

    /// `value += Pᵀ fine` for one row of the transpose.
    #[inline(always)]
    pub(super) fn restrict<const F: usize, const C: usize, const K: usize>(
        &self,
        row: usize,
        fine: &[[[T; F]; K]],
        value: &mut [[T; C]; K],
    ) {
        for entry in self.offsets[row]..self.offsets[row + 1] {
            let weight = self.weights[entry];
            for (value, fine) in value.iter_mut().zip(&fine[self.columns[entry] as usize]) {
                for (value, &fine) in value.iter_mut().zip(fine).take(if C == 6 { 3 } else { C }) {
                    *value += weight * fine;
                }
                if C == 6 && F >= 3 {
                    let turned = product(self.arms[entry], [fine[0], fine[1], fine[2]]);
                    for (axis, turned) in turned.into_iter().enumerate() {
                        value[3 + axis] += turned;
                        if F == 6 {
                            value[3 + axis] += self.turn * weight * fine[3 + axis];
                        }
                    }
                }
            }
        }
    }
}

/// The cross product.
#[inline(always)]
fn product<T: Real>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
