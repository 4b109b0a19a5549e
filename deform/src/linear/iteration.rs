//! The iteration of conjugate gradients, for any preconditioner and several right sides at once.

use super::{Convergence, LinearError, ROW_CHUNK, SparseMatrix, Tolerance};
use crate::communicator::{Communicator, Halo, Reduction};
use crate::parallel;

/// The vectors at one unknown: `K` right sides of `B` values each.
pub(super) type Columns<const B: usize, const K: usize> = [[f64; B]; K];

/// Vectors as one column.
pub(super) fn single_column<const B: usize>(vector: &[[f64; B]]) -> &[Columns<B, 1>] {
    vector.as_chunks().0
}

/// Vectors as one column.
pub(super) fn single_column_mut<const B: usize>(vector: &mut [[f64; B]]) -> &mut [Columns<B, 1>] {
    vector.as_chunks_mut().0
}

/// Solves for each column by itself: `solve` has its index, its right side and what its solution
/// starts from.
pub(super) fn each_column<const B: usize, const K: usize>(
    right_sides: &[Columns<B, K>],
    solutions: &mut [Columns<B, K>],
    mut solve: impl FnMut(usize, &[[f64; B]], &mut [[f64; B]]) -> Result<Convergence, LinearError>,
) -> Result<[Convergence; K], LinearError> {
    let mut result = [Convergence::default(); K];
    for (column, result) in result.iter_mut().enumerate() {
        let right_side: Vec<[f64; B]> = right_sides.iter().map(|value| value[column]).collect();
        let mut solution: Vec<[f64; B]> = solutions.iter().map(|value| value[column]).collect();
        *result = solve(column, &right_side, &mut solution)?;
        solutions.iter_mut().zip(solution).for_each(|(value, found)| value[column] = found);
    }
    Ok(result)
}

/// A square matrix by its products.
pub(super) trait Matrix<const B: usize> {
    /// How many rows it has.
    fn rows(&self) -> usize;

    /// `result` becomes the product with `K` vectors side by side.
    fn multiply_columns<const K: usize>(
        &self,
        vector: &[Columns<B, K>],
        result: &mut [Columns<B, K>],
    );
}

impl<const B: usize> Matrix<B> for SparseMatrix<B> {
    fn rows(&self) -> usize {
        SparseMatrix::rows(self)
    }

    fn multiply_columns<const K: usize>(
        &self,
        vector: &[Columns<B, K>],
        result: &mut [Columns<B, K>],
    ) {
        SparseMatrix::multiply_columns(self, vector, result);
    }
}

/// A matrix that is the sum of the ranks'. Vectors are the same on all ranks where these share
/// entries.
pub(super) struct Sum<'a, M, const B: usize> {
    pub(super) matrix: &'a M,
    pub(super) halo: &'a Halo,
}

impl<M: Matrix<B>, const B: usize> Sum<'_, M, B> {
    /// Adds up what the ranks have of a vector.
    pub(super) fn add_up<const K: usize>(&self, vector: &mut [Columns<B, K>]) {
        self.halo.sum(B * K, vector.as_flattened_mut().as_flattened_mut());
    }

    /// `result = self * vector`.
    pub(super) fn multiply<const K: usize>(
        &self,
        vector: &[Columns<B, K>],
        result: &mut [Columns<B, K>],
    ) {
        self.matrix.multiply_columns(vector, result);
        self.add_up(result);
    }

    /// The inner product of each column.
    pub(super) fn dot<const K: usize>(&self, a: &[Columns<B, K>], b: &[Columns<B, K>]) -> [f64; K] {
        // Everything, less the entries of other ranks.
        let mut sum = dot(a, b);
        for entry in self
            .halo
            .shared()
            .iter()
            .map(|&entry| entry as usize)
            .filter(|&entry| !self.halo.owns(entry))
        {
            for (column, sum) in sum.iter_mut().enumerate() {
                *sum -=
                    (0..B).map(|axis| a[entry][column][axis] * b[entry][column][axis]).sum::<f64>();
            }
        }
        self.halo.communicator().reduce(Reduction::Sum, &mut sum);
        sum
    }

    /// The largest value of each column.
    fn largest<const K: usize>(&self, vector: &[Columns<B, K>]) -> [f64; K] {
        let mut most = largest(vector);
        self.halo.communicator().reduce(Reduction::Maximum, &mut most);
        most
    }

    /// Brings each column to the order of 1, by its norm.
    pub(super) fn scale<const K: usize>(&self, vector: &[Columns<B, K>]) -> [f64; K] {
        self.dot(vector, vector).map(|square| {
            let scale = 1.0 / square.sqrt();
            if scale.is_normal() { scale } else { 1.0 }
        })
    }
}

/// How much larger than the tolerance the last correction may be, each by the largest value of its
/// vector.
const CORRECTION: f64 = 10.0;

/// Conjugate gradients (Hestenes, Stiefel 1952) from what `solution` holds, for each column by
/// itself. `precondition` sets its second argument to an approximate inverse times its first, or
/// says why the iteration is to end.
///
/// A column is done once its residual is small enough, and the preconditioner says the same of the
/// error: it must not want to change any value by more than [`CORRECTION`] times the relative
/// tolerance. On a mesh whose cells differ much in stiffness the residual is that of the stiff
/// ones, and tells next to nothing of the error in the soft ones.
///
/// # Errors
/// The first failure of any column. `solution` then holds the last iterate, which is finite unless
/// the error is [`LinearError::NotFinite`].
pub(super) fn conjugate_gradients<M: Matrix<B>, const B: usize, const K: usize>(
    matrix: &Sum<'_, M, B>,
    mut precondition: impl FnMut(&[Columns<B, K>], &mut [Columns<B, K>]) -> Result<(), LinearError>,
    right_side: &[Columns<B, K>],
    solution: &mut [Columns<B, K>],
    tolerances: [Tolerance; K],
    max_iterations: usize,
) -> Result<[Convergence; K], LinearError> {
    assert!(
        right_side.len() == matrix.matrix.rows() && solution.len() == matrix.matrix.rows(),
        "one value for each row of the matrix"
    );
    let whole = matrix.dot(right_side, right_side).map(f64::sqrt);
    if !whole.iter().all(|norm| norm.is_finite()) {
        return Err(LinearError::NotFinite { iteration: 0 });
    }
    let target: [f64; K] = std::array::from_fn(|column| {
        (tolerances[column].relative * whole[column]).max(tolerances[column].absolute)
    });
    let relative = |column: usize, residual: f64| {
        if whole[column] > 0.0 { residual / whole[column] } else { 0.0 }
    };

    let mut residual = right_side.to_vec();
    let mut image = vec![[[0.0; B]; K]; residual.len()];
    if matrix.largest(solution).iter().any(|&value| value != 0.0) {
        matrix.multiply(solution, &mut image);
        add_multiple(&mut residual, [-1.0; K], &image);
    }
    let mut reached = matrix.dot(&residual, &residual).map(f64::sqrt);
    for column in 0..K {
        if whole[column] <= target[column] && reached[column] > target[column] {
            // Nothing to solve for: zero answers it, whatever the iteration was to start from.
            solution.iter_mut().for_each(|value| value[column] = [0.0; B]);
            residual
                .iter_mut()
                .zip(right_side)
                .for_each(|(value, right)| value[column] = right[column]);
            reached[column] = whole[column];
        }
    }
    if !reached.iter().all(|norm| norm.is_finite()) {
        return Err(LinearError::NotFinite { iteration: 0 });
    }
    let mut result: [Convergence; K] = std::array::from_fn(|column| Convergence {
        iterations: 0,
        residual: relative(column, reached[column]),
    });
    // Exact zeros, and what only rounding has left, need no preconditioner.
    if (0..K).all(|column| reached[column] <= tolerances[column].absolute || reached[column] == 0.0)
    {
        return Ok(result);
    }
    let mut preconditioned = vec![[[0.0; B]; K]; residual.len()];
    precondition(&residual, &mut preconditioned)?;
    let mut active = unfinished(matrix, tolerances, target, reached, solution, &preconditioned);
    if !active.contains(&true) {
        return Ok(result);
    }
    let mut direction = preconditioned.clone();
    let mut energy = matrix.dot(&residual, &preconditioned);
    for iteration in 1..=max_iterations {
        matrix.multiply(&direction, &mut image);
        let curvature = matrix.dot(&direction, &image);
        let mut step = [0.0; K];
        for column in (0..K).filter(|&column| active[column]) {
            let (curvature, energy) = (curvature[column], energy[column]);
            if !(curvature.is_finite() && energy.is_finite()) {
                return Err(LinearError::NotFinite { iteration });
            }
            if curvature <= 0.0 || energy <= 0.0 {
                return Err(LinearError::Indefinite {
                    iteration,
                    curvature: curvature.min(energy),
                });
            }
            step[column] = energy / curvature;
        }
        add_multiple(solution, step, &direction);
        add_multiple(&mut residual, step.map(|step| -step), &image);
        let square = matrix.dot(&residual, &residual);
        for column in (0..K).filter(|&column| active[column]) {
            reached[column] = square[column].sqrt();
            result[column] =
                Convergence { iterations: iteration, residual: relative(column, reached[column]) };
        }
        if (0..K).all(|column| {
            !active[column]
                || reached[column] <= tolerances[column].absolute
                || reached[column] == 0.0
        }) {
            return Ok(result);
        }
        precondition(&residual, &mut preconditioned)?;
        let still = unfinished(matrix, tolerances, target, reached, solution, &preconditioned);
        active = std::array::from_fn(|column| active[column] && still[column]);
        if !active.contains(&true) {
            return Ok(result);
        }
        let before = std::mem::replace(&mut energy, matrix.dot(&residual, &preconditioned));
        let factor: [f64; K] =
            std::array::from_fn(
                |column| if active[column] { energy[column] / before[column] } else { 0.0 },
            );
        parallel::for_each_chunk(&mut direction, ROW_CHUNK, |chunk, part| {
            for (value, new) in part.iter_mut().zip(&preconditioned[chunk * ROW_CHUNK..]) {
                *value = std::array::from_fn(|column| {
                    std::array::from_fn(|axis| {
                        new[column][axis] + factor[column] * value[column][axis]
                    })
                });
            }
        });
    }
    let column = active.iter().position(|&active| active).unwrap_or(0);
    Err(LinearError::NotConverged {
        iterations: max_iterations,
        residual: relative(column, reached[column]),
        tolerance: relative(column, target[column]),
    })
}

/// Which columns are not solved yet; `correction` is what the preconditioner makes of their
/// residuals.
fn unfinished<M: Matrix<B>, const B: usize, const K: usize>(
    matrix: &Sum<'_, M, B>,
    tolerances: [Tolerance; K],
    target: [f64; K],
    reached: [f64; K],
    solution: &[Columns<B, K>],
    correction: &[Columns<B, K>],
) -> [bool; K] {
    let met: [bool; K] = std::array::from_fn(|column| reached[column] <= target[column]);
    if !met.contains(&true) {
        return [true; K];
    }
    let (size, change) = (matrix.largest(solution), matrix.largest(correction));
    std::array::from_fn(|column| {
        let small = change[column] <= CORRECTION * tolerances[column].relative * size[column];
        !(met[column] && (small || reached[column] <= tolerances[column].absolute))
    })
}

/// The largest value of each column.
fn largest<const B: usize, const K: usize>(vector: &[Columns<B, K>]) -> [f64; K] {
    let parts = parallel::map_chunks(vector.len(), ROW_CHUNK, |range| {
        vector[range].iter().fold([0.0; K], |most: [f64; K], value| {
            std::array::from_fn(|column| {
                value[column].iter().fold(most[column], |most, entry| most.max(entry.abs()))
            })
        })
    });
    parts.into_iter().fold([0.0; K], |most: [f64; K], part| {
        std::array::from_fn(|column| most[column].max(part[column]))
    })
}

/// The inner product of each column, summed chunk by chunk.
fn dot<const B: usize, const K: usize>(a: &[Columns<B, K>], b: &[Columns<B, K>]) -> [f64; K] {
    let parts = parallel::map_chunks(a.len(), ROW_CHUNK, |range| {
        // Four sums side by side, so that one need not wait for another.
        let mut sums = [[0.0; K]; 4];
        let (a, b) = (a[range.clone()].chunks(4), b[range].chunks(4));
        for (a, b) in a.zip(b) {
            for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
                for column in 0..K {
                    for axis in 0..B {
                        sum[column] += a[column][axis] * b[column][axis];
                    }
                }
            }
        }
        std::array::from_fn(|column| {
            (sums[0][column] + sums[1][column]) + (sums[2][column] + sums[3][column])
        })
    });
    parts.into_iter().fold([0.0; K], |total, part: [f64; K]| {
        std::array::from_fn(|column| total[column] + part[column])
    })
}

fn add_multiple<const B: usize, const K: usize>(
    target: &mut [Columns<B, K>],
    factor: [f64; K],
    vector: &[Columns<B, K>],
) {
    parallel::for_each_chunk(target, ROW_CHUNK, |chunk, part| {
        for (value, change) in part.iter_mut().zip(&vector[chunk * ROW_CHUNK..]) {
            for column in 0..K {
                for axis in 0..B {
                    value[column][axis] += factor[column] * change[column][axis];
                }
            }
        }
    });
}

/// The 2-norm of each column.
pub(crate) fn norms<const B: usize, const K: usize>(vector: &[Columns<B, K>]) -> [f64; K] {
    dot(vector, vector).map(f64::sqrt)
}
