//! Algebraic multigrid by smoothed aggregation.

use std::sync::Arc;

use super::{Matrix, Pattern, for_each_chunk, norm};

/// Matrices no larger than this are factored densely.
const COARSEST: usize = 150;
/// Where coarsening stalls above this size, the coarsest level is left at its diagonal.
const LARGEST_DENSE: usize = 1500;
/// An entry is strong where it exceeds this share of its two diagonals' geometric mean.
const STRENGTH: f64 = 0.08;
/// The smoother damps the error between this share of the largest eigenvalue and the largest.
const SMOOTHED_SHARE: f64 = 0.15;

/// Smoothed aggregation (Vanek, Mandel and Brezina 1996) with Chebyshev smoothing (Adams et al. 2003), as one symmetric V-cycle:
/// a preconditioner for matrices like a Laplacian's.
///
/// A semi-definite matrix (constants in its null space) is treated by lifting the coarsest level's diagonal slightly.
#[derive(Debug)]
pub struct Multigrid {
    levels: Vec<Level>,
    coarsest: DenseCholesky,
    coarse_right: Vec<f64>,
}

#[derive(Debug)]
struct Level {
    matrix: Matrix,
    prolongation: Matrix,
    restriction: Matrix,
    inverse_diagonal: Vec<f64>,
    largest_eigenvalue: f64,
    right: Vec<f64>,
    solution: Vec<f64>,
    residual: Vec<f64>,
    update: Vec<f64>,
}

impl Multigrid {
    /// Sets the levels up for a symmetric matrix.
    #[must_use]
    pub fn new(matrix: &Matrix) -> Self {
        let mut levels = Vec::new();
        let mut current = matrix.clone();
        while current.columns > COARSEST {
            let inverse_diagonal = inverse_diagonal(&current);
            let (aggregates, count) = aggregate(&current, &inverse_diagonal);
            if count == 0 || count * 10 > current.columns * 9 {
                break;
            }
            let largest_eigenvalue = largest_eigenvalue(&current, &inverse_diagonal);
            let tentative = tentative(&aggregates, count);
            let prolongation =
                smoothed(&current, &inverse_diagonal, largest_eigenvalue, &tentative);
            let restriction = prolongation.transpose();
            let coarse = restriction.times(&current.times(&prolongation));
            let rows = current.columns;
            levels.push(Level {
                matrix: std::mem::replace(&mut current, coarse),
                prolongation,
                restriction,
                inverse_diagonal,
                largest_eigenvalue,
                right: vec![0.0; rows],
                solution: vec![0.0; rows],
                residual: vec![0.0; rows],
                update: vec![0.0; rows],
            });
        }
        let coarsest = DenseCholesky::new(&current);
        Self { levels, coarse_right: vec![0.0; current.columns], coarsest }
    }

    /// `result` = one V-cycle from zero for the right-hand side `right`.
    pub fn apply(&mut self, right: &[f64], result: &mut [f64]) {
        if self.levels.is_empty() {
            self.coarse_right.copy_from_slice(right);
            self.coarsest.solve(&mut self.coarse_right);
            result.copy_from_slice(&self.coarse_right);
            return;
        }
        self.levels[0].right.copy_from_slice(right);
        for index in 0..self.levels.len() {
            let (fine, coarser) = self.levels.split_at_mut(index + 1);
            let level = &mut fine[index];
            level.solution.fill(0.0);
            level.smooth(true);
            level.matrix.residual(&level.right, &level.solution, &mut level.residual);
            let target = coarser.first_mut().map_or(&mut self.coarse_right, |next| &mut next.right);
            level.restriction.multiply(&level.residual, target);
        }
        self.coarsest.solve(&mut self.coarse_right);
        for index in (0..self.levels.len()).rev() {
            let (fine, coarser) = self.levels.split_at_mut(index + 1);
            let level = &mut fine[index];
            let correction: &[f64] =
                coarser.first().map_or(&self.coarse_right, |next| &next.solution);
            let prolongation = &level.prolongation;
            for_each_chunk(&mut level.solution, |start, chunk| {
                for (offset, value) in chunk.iter_mut().enumerate() {
                    *value += prolongation.row_times(start + offset, correction);
                }
            });
            level.smooth(false);
        }
        result.copy_from_slice(&self.levels[0].solution);
    }
}

impl Level {
    /// Two steps of the Chebyshev iteration on the Jacobi-preconditioned matrix.
    fn smooth(&mut self, from_zero: bool) {
        let high = 1.1 * self.largest_eigenvalue;
        let low = SMOOTHED_SHARE * high;
        let (centre, half) = (0.5 * (high + low), 0.5 * (high - low));
        let sigma = centre / half;
        let mut rho = 1.0 / sigma;
        if from_zero {
            self.residual.copy_from_slice(&self.right);
        } else {
            self.matrix.residual(&self.right, &self.solution, &mut self.residual);
        }
        let (residual, diagonal) = (&self.residual, &self.inverse_diagonal);
        for_each_chunk(&mut self.update, |start, chunk| {
            for (offset, value) in chunk.iter_mut().enumerate() {
                *value = residual[start + offset] * diagonal[start + offset] / centre;
            }
        });
        let update = &self.update;
        for_each_chunk(&mut self.solution, |start, chunk| {
            for (offset, value) in chunk.iter_mut().enumerate() {
                *value += update[start + offset];
            }
        });
        let next = 1.0 / (2.0 * sigma - rho);
        self.matrix.residual(&self.right, &self.solution, &mut self.residual);
        let (residual, diagonal) = (&self.residual, &self.inverse_diagonal);
        for_each_chunk(&mut self.update, |start, chunk| {
            for (offset, value) in chunk.iter_mut().enumerate() {
                let row = start + offset;
                *value = next * rho * *value + 2.0 * next / half * residual[row] * diagonal[row];
            }
        });
        rho = next;
        debug_assert!(rho > 0.0);
        let update = &self.update;
        for_each_chunk(&mut self.solution, |start, chunk| {
            for (offset, value) in chunk.iter_mut().enumerate() {
                *value += update[start + offset];
            }
        });
    }
}

fn inverse_diagonal(matrix: &Matrix) -> Vec<f64> {
    let mut inverse = vec![1.0; matrix.columns];
    for (row, value) in inverse.iter_mut().enumerate() {
        for entry in matrix.pattern.row(row) {
            if matrix.pattern.columns[entry] as usize == row && matrix.values[entry] > 0.0 {
                *value = 1.0 / matrix.values[entry];
            }
        }
    }
    inverse
}

/// An estimate of the largest eigenvalue of D^-1 A by the power method, from a fixed start.
fn largest_eigenvalue(matrix: &Matrix, inverse_diagonal: &[f64]) -> f64 {
    // A vector of mixed signs that no symmetry of a mesh shares: the fractional parts of multiples of the golden ratio.
    #[expect(clippy::cast_precision_loss, reason = "a start vector, not a count")]
    let mut vector: Vec<f64> = (0..matrix.columns)
        .map(|row| (row as f64 * 0.618_033_988_749_894_9).fract() - 0.5)
        .collect();
    let mut image = vec![0.0; vector.len()];
    let mut estimate = 1.0;
    for _ in 0..12 {
        let size = norm(&vector);
        if size == 0.0 {
            break;
        }
        vector.iter_mut().for_each(|value| *value /= size);
        matrix.multiply(&vector, &mut image);
        image.iter_mut().zip(inverse_diagonal).for_each(|(value, inverse)| *value *= inverse);
        estimate = norm(&image);
        std::mem::swap(&mut vector, &mut image);
    }
    estimate
}

/// Groups vertices that are strongly connected; a row without strong connections is left out (`u32::MAX`).
fn aggregate(matrix: &Matrix, inverse_diagonal: &[f64]) -> (Vec<u32>, usize) {
    const OPEN: u32 = u32::MAX;
    let strong = |row: usize| {
        matrix.pattern.row(row).filter_map(move |entry| {
            let (column, value) = (matrix.pattern.columns[entry] as usize, matrix.values[entry]);
            let scaled = value * value * inverse_diagonal[row] * inverse_diagonal[column];
            (column != row && value != 0.0 && scaled > STRENGTH * STRENGTH)
                .then_some((column, scaled))
        })
    };
    let rows = matrix.columns;
    let mut aggregates = vec![OPEN; rows];
    let mut count = 0u32;
    for row in 0..rows {
        let mut connected = false;
        let free = aggregates[row] == OPEN
            && strong(row).all(|(column, _)| {
                connected = true;
                aggregates[column] == OPEN
            });
        if free && connected {
            aggregates[row] = count;
            for (column, _) in strong(row) {
                aggregates[column] = count;
            }
            count += 1;
        }
    }
    let first_pass = aggregates.clone();
    for row in 0..rows {
        if aggregates[row] == OPEN {
            let mut best = (0.0, OPEN);
            for (column, scaled) in strong(row) {
                if first_pass[column] != OPEN && scaled > best.0 {
                    best = (scaled, first_pass[column]);
                }
            }
            aggregates[row] = best.1;
        }
    }
    for row in 0..rows {
        if aggregates[row] == OPEN && strong(row).next().is_some() {
            aggregates[row] = count;
            for (column, _) in strong(row) {
                if aggregates[column] == OPEN {
                    aggregates[column] = count;
                }
            }
            count += 1;
        }
    }
    (aggregates, count as usize)
}

fn tentative(aggregates: &[u32], count: usize) -> Matrix {
    let mut sizes = vec![0.0f64; count];
    for &aggregate in aggregates.iter().filter(|&&aggregate| aggregate != u32::MAX) {
        sizes[aggregate as usize] += 1.0;
    }
    let mut starts = vec![0];
    let (mut columns, mut values) = (Vec::new(), Vec::new());
    for &aggregate in aggregates {
        if aggregate != u32::MAX {
            columns.push(aggregate);
            values.push(1.0 / sizes[aggregate as usize].sqrt());
        }
        starts.push(columns.len());
    }
    Matrix { pattern: Arc::new(Pattern { starts, columns }), values, columns: count }
}

/// (I - 4/3 / λ D^-1 A) T.
fn smoothed(
    matrix: &Matrix,
    inverse_diagonal: &[f64],
    eigenvalue: f64,
    tentative: &Matrix,
) -> Matrix {
    let omega = 4.0 / 3.0 / eigenvalue.max(1e-300);
    let mut smoother = matrix.clone();
    for row in 0..matrix.columns {
        for entry in matrix.pattern.row(row) {
            let identity = if matrix.pattern.columns[entry] as usize == row { 1.0 } else { 0.0 };
            smoother.values[entry] =
                identity - omega * inverse_diagonal[row] * matrix.values[entry];
        }
    }
    smoother.times(tentative)
}

/// A small symmetric matrix, factored; where it is not definite, its diagonal is lifted slightly.
#[derive(Debug)]
pub(super) struct DenseCholesky {
    size: usize,
    factor: Vec<f64>,
    inverse_diagonal: Vec<f64>,
}

impl DenseCholesky {
    fn new(matrix: &Matrix) -> Self {
        let size = matrix.columns;
        let inverse_diagonal = inverse_diagonal(matrix);
        if size > LARGEST_DENSE {
            return Self { size, factor: Vec::new(), inverse_diagonal };
        }
        let mut factor = vec![0.0; size * size];
        for row in 0..size {
            for entry in matrix.pattern.row(row) {
                factor[row * size + matrix.pattern.columns[entry] as usize] = matrix.values[entry];
            }
        }
        Self::factored(factor, size, inverse_diagonal)
    }

    /// The same of a dense matrix, row by row.
    pub(super) fn of_dense(values: Vec<f64>, size: usize) -> Self {
        Self::factored(values, size, Vec::new())
    }

    fn factored(mut factor: Vec<f64>, size: usize, inverse_diagonal: Vec<f64>) -> Self {
        let largest = (0..size).map(|row| factor[row * size + row]).fold(0.0, f64::max);
        for row in 0..size {
            factor[row * size + row] += 1e-10 * largest;
        }
        for row in 0..size {
            for column in 0..=row {
                let mut value = factor[row * size + column];
                for k in 0..column {
                    value -= factor[row * size + k] * factor[column * size + k];
                }
                factor[row * size + column] = if row == column {
                    value.max(1e-14 * largest).max(f64::MIN_POSITIVE).sqrt()
                } else {
                    value / factor[column * size + column]
                };
            }
        }
        Self { size, factor, inverse_diagonal }
    }

    pub(super) fn solve(&self, values: &mut [f64]) {
        let size = self.size;
        if self.factor.is_empty() {
            values
                .iter_mut()
                .zip(&self.inverse_diagonal)
                .for_each(|(value, inverse)| *value *= inverse);
            return;
        }
        for row in 0..size {
            let mut value = values[row];
            for k in 0..row {
                value -= self.factor[row * size + k] * values[k];
            }
            values[row] = value / self.factor[row * size + row];
        }
        for row in (0..size).rev() {
            let mut value = values[row];
            for k in row + 1..size {
                value -= self.factor[k * size + row] * values[k];
            }
            values[row] = value / self.factor[row * size + row];
        }
    }
}
