//! The multifrontal Cholesky factor of a sparse positive definite matrix.
//!
//! Beside faer's factor because of two things that faer has not: separate branches of the
//! elimination are factored at the same time, with the same bits on any number of threads; and its
//! loops are small, so that a browser's engine has compiled them by the time that faer's general
//! kernels would still be warming up.

use std::ops::Range;

use super::dissection::Branch;
use super::front::{self, LANES, Lanes, strips, trapezoid, triangle};
use crate::parallel;

/// A symmetric matrix, whose rows and columns are numbered in the order of elimination.
pub(crate) trait Rows {
    /// Calls `entry` with columns and values of a row. Every column comes once at most; those
    /// before the diagonal may be left out.
    fn row(&mut self, row: usize, entry: impl FnMut(usize, f64));
}

/// The factor `C` of `A = C C^T`.
///
/// The multifrontal method (Duff and Reid 1983; Liu 1992): the vertices of a [`Branch`] are
/// eliminated together from one small dense matrix, their front, which takes up what the
/// eliminations of its parts have left over. Branches that do not couple are worked on at the same
/// time where there are threads; no bit depends on it.
pub(crate) struct MultifrontalFactor {
    /// The fronts, those of the parts of a branch before its own.
    fronts: Vec<Front>,
    size: usize,
}

/// Some columns of the factor: rows `own`, then those of `boundary`, either filled up to whole
/// strips.
struct Front {
    own: Range<usize>,
    /// The later positions that its columns reach, rising.
    boundary: Vec<u32>,
    /// Strip after strip, see [`trapezoid`].
    values: Vec<Lanes>,
}

/// Why there is no factor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum NoFactor {
    OutOfMemory,
    NotPositive,
}

/// How many numbers one front may have (8 bytes each). A front so large is one that no order of
/// elimination makes small.
const LARGEST: usize = 1 << 28;

impl MultifrontalFactor {
    /// Factors a matrix that couples no two parts of any branch. `rows` makes what reads it, once
    /// for each thread.
    pub fn new<R: Rows>(branch: &Branch, rows: &(impl Fn() -> R + Sync)) -> Result<Self, NoFactor> {
        let size = branch.own.end;
        let worker = Worker::new(rows, size);
        // Few pieces whatever the number of threads: each takes memory.
        let piece = (size / 8).max(1 << 11);
        let (fronts, _) = worker.eliminate(branch, piece)?;
        Ok(Self { fronts, size })
    }

    /// How many numbers it holds.
    pub fn len(&self) -> usize {
        self.fronts.iter().map(|front| LANES * front.values.len()).sum()
    }

    /// Solves `A x = b` for columns one after the other in `values`.
    pub fn solve_in_place(&self, values: &mut [f64]) {
        let longest = self.fronts.iter().map(Front::strips).max().unwrap_or(0);
        let mut work = vec![[0.0; LANES]; longest];
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
    fn strips(&self) -> usize {
        strips(self.own.len()) + strips(self.boundary.len())
    }

    /// `C y = b`.
    fn forward(&self, values: &mut [f64], work: &mut [Lanes]) {
        let own = strips(self.own.len());
        let work = &mut work[..self.strips()];
        work.fill([0.0; LANES]);
        work.as_flattened_mut()[..self.own.len()].copy_from_slice(&values[self.own.clone()]);
        front::forward(&self.values, own, work);
        values[self.own.clone()].copy_from_slice(&work.as_flattened()[..self.own.len()]);
        for (&position, change) in self.boundary.iter().zip(work[own..].as_flattened()) {
            values[position as usize] += change;
        }
    }

    /// `C^T x = y`.
    fn backward(&self, values: &mut [f64], work: &mut [Lanes]) {
        let own = strips(self.own.len());
        let work = &mut work[..self.strips()];
        work.fill([0.0; LANES]);
        work.as_flattened_mut()[..self.own.len()].copy_from_slice(&values[self.own.clone()]);
        for (&position, work) in self.boundary.iter().zip(work[own..].as_flattened_mut()) {
            *work = values[position as usize];
        }
        front::backward(&self.values, own, work);
        values[self.own.clone()].copy_from_slice(&work.as_flattened()[..self.own.len()]);
    }
}

/// The remainder of the eliminations of a branch: the lower triangle of a dense matrix among the
/// boundary of its front, strip after strip ([`triangle`]).
type LeftOver = Vec<Lanes>;

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
        Self {
            make_rows,
            rows: make_rows(),
            local: vec![0; size],
            entries: Vec::new(),
            pool: Vec::new(),
        }
    }

    /// The fronts of a branch, its own last, and what they leave over.
    fn eliminate(
        mut self,
        branch: &Branch,
        piece: usize,
    ) -> Result<(Vec<Front>, LeftOver), NoFactor> {
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

    fn eliminate_here(
        &mut self,
        branch: &Branch,
        fronts: &mut Vec<Front>,
    ) -> Result<LeftOver, NoFactor> {
        let mut parts = Vec::with_capacity(branch.parts.len());
        for part in &branch.parts {
            let left_over = self.eliminate_here(part, fronts)?;
            parts.push((fronts.len() - 1, left_over));
        }
        self.eliminate_own(branch, parts, fronts)
    }

    /// Eliminates what belongs to the branch itself. `parts` are the numbers of the fronts of its
    /// parts and what they leave over.
    fn eliminate_own(
        &mut self,
        branch: &Branch,
        parts: Vec<(usize, LeftOver)>,
        fronts: &mut Vec<Front>,
    ) -> Result<LeftOver, NoFactor> {
        let Range { start, end } = branch.own;
        let own = end - start;
        let boundary =
            self.read_rows(start..end, parts.iter().map(|(part, _)| &fronts[*part].boundary));
        let [own_strips, strips] = [strips(own), strips(own) + strips(boundary.len())];
        let local = |position: u32| match position as usize {
            position if position < end => position - start,
            position => self.local[position] as usize - 1,
        };

        let mut values = Vec::new();
        resize(&mut values, trapezoid(own_strips, strips))?;
        for &(column, position, value) in &self.entries {
            let row = local(position);
            values[trapezoid(own_strips, row / LANES) + column as usize][row % LANES] = value;
        }
        // What fills up the last strip stays by itself.
        for row in own..LANES * own_strips {
            values[triangle(row / LANES) + row][row % LANES] = 1.0;
        }
        let mut moved: Vec<Vec<usize>> = parts
            .iter()
            .map(|(part, _)| {
                fronts[*part].boundary.iter().map(|&position| local(position)).collect()
            })
            .collect();
        for ((_, from), moved) in parts.iter().zip(&moved) {
            let inside = moved.partition_point(|&row| row < own);
            for (position, &row) in moved.iter().enumerate() {
                let lanes = [row, position].map(|row| row % LANES);
                let target = &mut values[trapezoid(own_strips, row / LANES)..];
                add_row(
                    target,
                    from[triangle(position / LANES)..].iter(),
                    &moved[..inside.min(position + 1)],
                    lanes,
                );
            }
        }
        for &position in &boundary {
            self.local[position as usize] = 0;
        }

        let mut left_over = self.pool.pop().unwrap_or_default();
        resize(&mut left_over, triangle(strips - own_strips))?;
        for ((_, from), moved) in parts.iter().zip(&mut moved) {
            let inside = moved.partition_point(|&row| row < own);
            moved[inside..].iter_mut().for_each(|row| *row -= LANES * own_strips);
            for (position, &row) in moved.iter().enumerate().skip(inside) {
                let lanes = [row, position].map(|row| row % LANES);
                let target = &mut left_over[triangle(row / LANES)..];
                add_row(
                    target,
                    from[triangle(position / LANES)..].iter().skip(inside),
                    &moved[inside..=position],
                    lanes,
                );
            }
        }
        if !front::eliminate(&mut values, own_strips, strips, &mut left_over) {
            return Err(NoFactor::NotPositive);
        }
        self.pool.extend(parts.into_iter().map(|(_, left_over)| left_over));
        fronts.push(Front { own: start..end, boundary, values });
        Ok(left_over)
    }

    /// Reads the rows of a front into `entries`, finds its boundary and fills in `local`.
    fn read_rows<'b>(
        &mut self,
        own: Range<usize>,
        parts: impl Iterator<Item = &'b Vec<u32>>,
    ) -> Vec<u32> {
        let Range { start, end } = own;
        let mut boundary = Vec::new();
        let Self { rows, local, entries, .. } = self;
        let mut reach = |position: u32| {
            if position as usize >= end && std::mem::replace(&mut local[position as usize], 1) == 0
            {
                boundary.push(position);
            }
        };
        entries.clear();
        for position in own {
            rows.row(position, |other, value| {
                if other >= position {
                    entries.push(((position - start) as u32, other as u32, value));
                    reach(other as u32);
                }
            });
        }
        parts.flatten().for_each(|&position| reach(position));
        boundary.sort_unstable();
        for (number, &position) in boundary.iter().enumerate() {
            self.local[position as usize] = (LANES * strips(end - start) + number + 1) as u32;
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

/// Adds one row of what was left over to a row of another matrix: its lane of each entry to that
/// lane of the given columns.
#[cfg_attr(target_arch = "wasm32", inline(never))]
fn add_row<'a>(
    target: &mut [Lanes],
    from: impl Iterator<Item = &'a Lanes>,
    columns: &[usize],
    [target_lane, from_lane]: [usize; 2],
) {
    for (&column, entry) in columns.iter().zip(from) {
        target[column][target_lane] += entry[from_lane];
    }
}

fn resize(values: &mut Vec<Lanes>, size: usize) -> Result<(), NoFactor> {
    values.clear();
    if size > LARGEST / LANES {
        return Err(NoFactor::OutOfMemory);
    }
    values.try_reserve_exact(size).map_err(|_| NoFactor::OutOfMemory)?;
    values.resize(size, [0.0; LANES]);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Dense(Vec<Vec<f64>>);

    impl Rows for Dense {
        fn row(&mut self, position: usize, mut entry: impl FnMut(usize, f64)) {
            for (other, &value) in self.0[position].iter().enumerate() {
                if value != 0.0 {
                    entry(other, value);
                }
            }
        }
    }

    /// Two chains that meet in two vertices, one of which a branch with a single part eliminates.
    fn example() -> (Branch, Vec<Vec<f64>>) {
        let leaf = |own| Branch { own, parts: vec![] };
        let branch = Branch {
            own: 7..8,
            parts: vec![Branch { own: 6..7, parts: vec![leaf(0..3), leaf(3..6)] }],
        };
        let mut matrix = vec![vec![0.0; 8]; 8];
        for (i, j) in [(0, 1), (1, 2), (2, 6), (3, 4), (4, 5), (5, 7), (6, 7), (3, 6), (0, 7)] {
            let value = -1.0 - 0.1 * (i + j) as f64;
            matrix[i][j] = value;
            matrix[j][i] = value;
            matrix[i][i] -= value;
            matrix[j][j] -= value;
        }
        for (position, row) in matrix.iter_mut().enumerate() {
            row[position] += 0.1;
        }
        (branch, matrix)
    }

    #[test]
    fn solutions_solve_every_column() {
        let (branch, matrix) = example();
        let factor = MultifrontalFactor::new(&branch, &|| Dense(matrix.clone())).unwrap();
        let expected: Vec<f64> = (0..16).map(|position| (position as f64 * 0.7).sin()).collect();
        let mut values: Vec<f64> = (0..16)
            .map(|position| {
                let column = &expected[position / 8 * 8..][..8];
                matrix[position % 8].iter().zip(column).map(|(entry, value)| entry * value).sum()
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
            assert_eq!(
                MultifrontalFactor::new(&branch, &|| Dense(matrix.clone())).err(),
                Some(NoFactor::NotPositive),
                "{bad}"
            );
        }
    }
}
