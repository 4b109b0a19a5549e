//! The Cholesky factor of a sparse positive definite matrix, front by front.

use std::ops::Range;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::linalg::triangular_solve;
use faer::{Accum, MatMut, Par, Spec};

use super::dissection::Branch;
use crate::parallel;

/// The rows of a symmetric matrix, by places in the order of elimination.
pub(super) trait Rows {
    /// Calls `entry` with places and values of row `place`. Every other place comes once at most; those before `place` may be
    /// left out.
    fn row(&mut self, place: usize, entry: impl FnMut(usize, f64));
}

/// The factor `C` of `A = C C^T`.
///
/// The multifrontal method (Duff and Reid 1983; Liu 1992): the vertices of a [`Branch`] are eliminated together from one small
/// dense matrix, their front, which takes up what the eliminations of its parts have left over. Branches that do not couple are
/// worked on at the same time where there are threads; no bit depends on it.
pub(super) struct Factor {
    /// Those of the parts of a branch before its own.
    fronts: Vec<Front>,
    size: usize,
}

/// Some columns of the factor: rows `own`, then those of `boundary`.
struct Front {
    own: Range<usize>,
    /// The later places that its columns reach, rising.
    boundary: Vec<u32>,
    /// Column after column; what is above the diagonal has no meaning.
    values: Vec<f64>,
}

/// Why there is no factor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum NoFactor {
    OutOfMemory,
    NotPositive,
}

/// How many numbers one front may have (8 bytes each). A front so large is one that no order of elimination makes small.
const LARGEST: usize = 1 << 28;

impl Factor {
    /// Factors a matrix that couples no two parts of any branch. `rows` makes what reads it, once for each thread.
    pub fn new<R: Rows>(branch: &Branch, rows: &(impl Fn() -> R + Sync)) -> Result<Self, NoFactor> {
        let size = branch.own.end;
        let worker = Worker::new(rows, size);
        // Few pieces whatever the number of threads: each takes memory.
        let piece = (size / 8).max(1 << 13);
        let (fronts, _) = worker.eliminate(branch, piece)?;
        Ok(Self { fronts, size })
    }

    /// How many numbers it holds.
    pub fn len(&self) -> usize {
        self.fronts.iter().map(|front| front.values.len()).sum()
    }

    /// Solves `A x = b` for columns one after the other in `values`.
    pub fn solve_in_place(&self, values: &mut [f64]) {
        let longest = self.fronts.iter().map(Front::rows).max().unwrap_or(0);
        let mut work = vec![0.0; longest];
        for front in &self.fronts {
            for values in values.chunks_exact_mut(self.size) {
                front.forward(values, &mut work);
            }
        }
        for front in self.fronts.iter().rev() {
            for values in values.chunks_exact_mut(self.size) {
                front.backward(values, &mut work);
            }
        }
    }
}

impl Front {
    fn rows(&self) -> usize {
        self.own.len() + self.boundary.len()
    }

    /// `C y = b`.
    fn forward(&self, values: &mut [f64], work: &mut [f64]) {
        let (own, rows) = (self.own.len(), self.rows());
        let work = &mut work[..rows];
        work[..own].copy_from_slice(&values[self.own.clone()]);
        work[own..].fill(0.0);
        for (column, entries) in self.values.chunks_exact(rows.max(1)).enumerate() {
            let value = work[column] / entries[column];
            work[column] = value;
            for (work, entry) in work[column + 1..].iter_mut().zip(&entries[column + 1..]) {
                *work -= entry * value;
            }
        }
        values[self.own.clone()].copy_from_slice(&work[..own]);
        for (&place, change) in self.boundary.iter().zip(&work[own..]) {
            values[place as usize] += change;
        }
    }

    /// `C^T x = y`.
    fn backward(&self, values: &mut [f64], work: &mut [f64]) {
        let (own, rows) = (self.own.len(), self.rows());
        let work = &mut work[..rows];
        work[..own].copy_from_slice(&values[self.own.clone()]);
        for (&place, work) in self.boundary.iter().zip(&mut work[own..]) {
            *work = values[place as usize];
        }
        for (column, entries) in self.values.chunks_exact(rows.max(1)).enumerate().rev() {
            work[column] = (work[column] - dot(&entries[column + 1..], &work[column + 1..])) / entries[column];
        }
        values[self.own.clone()].copy_from_slice(&work[..own]);
    }
}

/// In eight sums side by side, for which processors have room.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (a, b) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f64 = a.remainder().iter().zip(b.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in a.zip(b) {
        for lane in 0..8 {
            sums[lane] += a[lane] * b[lane];
        }
    }
    sums.iter().sum::<f64>() + rest
}

/// What the eliminations of a branch have left over: the lower triangle of a dense matrix among the boundary of its front, column
/// after column from the start; the rest of the memory has no meaning.
type LeftOver = Vec<f64>;

struct Worker<'a, R, F> {
    make_rows: &'a F,
    rows: R,
    /// Where the rows of the present front are in it, counted from 1; 0 for others.
    local: Vec<u32>,
    entries: Vec<(u32, u32, f64)>,
    /// Memory to be used again: taking it from the system costs more than the arithmetic.
    pool: Vec<LeftOver>,
}

impl<'a, R: Rows, F: Fn() -> R + Sync> Worker<'a, R, F> {
    fn new(make_rows: &'a F, size: usize) -> Self {
        Self { make_rows, rows: make_rows(), local: vec![0; size], entries: Vec::new(), pool: Vec::new() }
    }

    /// The fronts of a branch, its own last, and what they leave over.
    fn eliminate(mut self, branch: &Branch, piece: usize) -> Result<(Vec<Front>, LeftOver), NoFactor> {
        let mut fronts = Vec::new();
        let left_over = match branch.parts.as_slice() {
            [first, second] if first.size() > piece => {
                let (make_rows, size) = (self.make_rows, self.local.len());
                let (first, second) = parallel::join(
                    || Worker::new(make_rows, size).eliminate(first, piece),
                    || Worker::new(make_rows, size).eliminate(second, piece),
                );
                let mut parts = Vec::new();
                for part in [first, second] {
                    let (more, left_over) = part?;
                    fronts.extend(more);
                    parts.push((fronts.len() - 1, left_over));
                }
                self.eliminate_own(branch, parts, &mut fronts)?
            }
            _ => self.eliminate_here(branch, &mut fronts)?,
        };
        Ok((fronts, left_over))
    }

    fn eliminate_here(&mut self, branch: &Branch, fronts: &mut Vec<Front>) -> Result<LeftOver, NoFactor> {
        let mut parts = Vec::with_capacity(branch.parts.len());
        for part in &branch.parts {
            let left_over = self.eliminate_here(part, fronts)?;
            parts.push((fronts.len() - 1, left_over));
        }
        self.eliminate_own(branch, parts, fronts)
    }

    /// Eliminates what belongs to the branch itself. `parts` are the numbers of the fronts of its parts and what they leave over.
    fn eliminate_own(
        &mut self,
        branch: &Branch,
        parts: Vec<(usize, LeftOver)>,
        fronts: &mut Vec<Front>,
    ) -> Result<LeftOver, NoFactor> {
        let Range { start, end } = branch.own;
        let own = end - start;
        let boundary = self.read_rows(start..end, parts.iter().map(|(part, _)| &fronts[*part].boundary));
        let rows = own + boundary.len();
        let local = |place: u32| match place as usize {
            place if place < end => place - start,
            place => self.local[place] as usize - 1,
        };

        let mut values = Vec::new();
        resize(&mut values, rows, own)?;
        for &(column, place, value) in &self.entries {
            values[column as usize * rows + local(place)] = value;
        }
        let moved: Vec<Vec<usize>> =
            parts.iter().map(|(part, _)| fronts[*part].boundary.iter().map(|&place| local(place)).collect()).collect();
        for ((_, from), moved) in parts.iter().zip(&moved) {
            let columns = moved.iter().take_while(|&&column| column < own);
            for (index, &column) in columns.enumerate() {
                let target = &mut values[column * rows..(column + 1) * rows];
                for (&row, entry) in moved[index..].iter().zip(&from[index * moved.len() + index..]) {
                    target[row] += entry;
                }
            }
        }
        for &place in &boundary {
            self.local[place as usize] = 0;
        }

        let mut left_over = self.pool.pop().unwrap_or_default();
        if left_over.len() < boundary.len().saturating_mul(boundary.len()) {
            resize(&mut left_over, boundary.len(), boundary.len())?;
        }
        factor_front(&mut values, own, boundary.len(), &mut left_over)?;
        for ((_, from), moved) in parts.iter().zip(&moved) {
            for (index, &column) in moved.iter().enumerate().skip_while(|(_, column)| **column < own) {
                let target = &mut left_over[(column - own) * boundary.len()..(column - own + 1) * boundary.len()];
                for (&row, entry) in moved[index..].iter().zip(&from[index * moved.len() + index..]) {
                    target[row - own] += entry;
                }
            }
        }
        self.pool.extend(parts.into_iter().map(|(_, left_over)| left_over));
        fronts.push(Front { own: start..end, boundary, values });
        Ok(left_over)
    }

    /// Reads the rows of a front into `entries`, finds its boundary and fills in `local`.
    fn read_rows<'b>(&mut self, own: Range<usize>, parts: impl Iterator<Item = &'b Vec<u32>>) -> Vec<u32> {
        let Range { start, end } = own;
        let mut boundary = Vec::new();
        let Self { rows, local, entries, .. } = self;
        let mut reach = |place: u32| {
            if place as usize >= end && std::mem::replace(&mut local[place as usize], 1) == 0 {
                boundary.push(place);
            }
        };
        entries.clear();
        for place in own {
            rows.row(place, |other, value| {
                if other >= place {
                    entries.push(((place - start) as u32, other as u32, value));
                    reach(other as u32);
                }
            });
        }
        parts.flatten().for_each(|&place| reach(place));
        boundary.sort_unstable();
        for (number, &place) in boundary.iter().enumerate() {
            self.local[place as usize] = (end - start + number + 1) as u32;
        }
        boundary
    }
}

impl Branch {
    fn size(&self) -> usize {
        let first = self.parts.first().map_or(self.own.start, |part| part.own.end - part.size());
        self.own.end - first
    }
}

fn resize(values: &mut Vec<f64>, rows: usize, columns: usize) -> Result<(), NoFactor> {
    let size = rows.checked_mul(columns).filter(|&size| size <= LARGEST).ok_or(NoFactor::OutOfMemory)?;
    values.clear();
    values.try_reserve_exact(size).map_err(|_| NoFactor::OutOfMemory)?;
    values.resize(size, 0.0);
    Ok(())
}

/// Eliminates the `own` columns of a symmetric matrix, and puts `-B B^T` into `left_over` for the rows `B` of its boundary.
fn factor_front(values: &mut [f64], own: usize, boundary: usize, left_over: &mut [f64]) -> Result<(), NoFactor> {
    let (mut top, mut bottom) = MatMut::from_column_major_slice_mut(values, own + boundary, own).split_at_row_mut(own);
    let scratch = llt::factor::cholesky_in_place_scratch::<f64>(own, Par::Seq, Spec::default());
    let mut memory = MemBuffer::try_new(scratch).map_err(|_| NoFactor::OutOfMemory)?;
    llt::factor::cholesky_in_place(
        top.as_mut(),
        llt::factor::LltRegularization::default(),
        Par::Seq,
        MemStack::new(&mut memory),
        Spec::default(),
    )
    .map_err(|_| NoFactor::NotPositive)?;
    // A factor that is not finite would poison every solution without a word.
    if !(0..own).all(|place| top[(place, place)].is_finite()) {
        return Err(NoFactor::NotPositive);
    }
    if boundary > 0 {
        triangular_solve::solve_lower_triangular_in_place(top.as_ref(), bottom.as_mut().transpose_mut(), Par::Seq);
        triangular::matmul(
            MatMut::from_column_major_slice_mut(&mut left_over[..boundary * boundary], boundary, boundary),
            BlockStructure::TriangularLower,
            Accum::Replace,
            bottom.as_ref(),
            BlockStructure::Rectangular,
            bottom.as_ref().transpose(),
            BlockStructure::Rectangular,
            -1.0,
            Par::Seq,
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Dense(Vec<Vec<f64>>);

    impl Rows for Dense {
        fn row(&mut self, place: usize, mut entry: impl FnMut(usize, f64)) {
            for (other, &value) in self.0[place].iter().enumerate() {
                if value != 0.0 {
                    entry(other, value);
                }
            }
        }
    }

    /// Two chains that meet in two vertices, one of which a branch with a single part eliminates.
    fn example() -> (Branch, Vec<Vec<f64>>) {
        let leaf = |own| Branch { own, parts: vec![] };
        let branch = Branch { own: 7..8, parts: vec![Branch { own: 6..7, parts: vec![leaf(0..3), leaf(3..6)] }] };
        let mut matrix = vec![vec![0.0; 8]; 8];
        for (i, j) in [(0, 1), (1, 2), (2, 6), (3, 4), (4, 5), (5, 7), (6, 7), (3, 6), (0, 7)] {
            let value = -1.0 - 0.1 * (i + j) as f64;
            matrix[i][j] = value;
            matrix[j][i] = value;
            matrix[i][i] -= value;
            matrix[j][j] -= value;
        }
        for (place, row) in matrix.iter_mut().enumerate() {
            row[place] += 0.1;
        }
        (branch, matrix)
    }

    #[test]
    fn solutions_solve_every_column() {
        let (branch, matrix) = example();
        let factor = Factor::new(&branch, &|| Dense(matrix.clone())).unwrap();
        let expected: Vec<f64> = (0..16).map(|place| (place as f64 * 0.7).sin()).collect();
        let mut values: Vec<f64> = (0..16)
            .map(|place| {
                let column = &expected[place / 8 * 8..][..8];
                matrix[place % 8].iter().zip(column).map(|(entry, value)| entry * value).sum()
            })
            .collect();
        factor.solve_in_place(&mut values);
        for (value, expected) in values.iter().zip(&expected) {
            assert!((value - expected).abs() < 1e-13, "{value} {expected}");
        }
    }

    #[test]
    fn what_is_not_positive_definite_has_no_factor() {
        for bad in [-1.0, 0.0, f64::NAN, f64::INFINITY] {
            let (branch, mut matrix) = example();
            matrix[4][4] = bad;
            assert_eq!(Factor::new(&branch, &|| Dense(matrix.clone())).err(), Some(NoFactor::NotPositive), "{bad}");
        }
    }
}
