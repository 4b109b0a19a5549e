//! The stabilised bi-conjugate gradient method, for three right-hand sides of one matrix at once.

use tombolo_deform::communicator::Halo;
use tombolo_deform::linear::SparseMatrix;

use super::{BlockIncompleteLu, Outcome, for_each, sum};
use crate::ranks::total;

/// One value of three components for each row.
pub type Tuples = Vec<[f64; 3]>;

/// BiCGStab (van der Vorst 1992), preconditioned from the right, for three systems that share a
/// matrix.
///
/// Each component has its own scalars and rests once it has converged. `held` marks components of
/// rows that are prescribed although the matrix does not say so: the operator is the identity
/// there. On several ranks each has its own rows of the matrix first; `right` holds the values of
/// its rows, `solution` those of all its vertices.
#[derive(Debug, Default)]
pub struct BiCgStab {
    residual: Tuples,
    shadow: Tuples,
    direction: Tuples,
    preconditioned: Tuples,
    image: Tuples,
    second: Tuples,
    second_image: Tuples,
}

impl BiCgStab {
    /// Improves `solution` until each component's residual is below its `tolerance` (absolute,
    /// Euclidean norm).
    ///
    /// Gives up after `limit` iterations; a breakdown restarts from the residual reached. NaN in,
    /// NaN out: the outcome then is not converged. Collective.
    #[expect(clippy::too_many_arguments, reason = "the parts of one linear system")]
    pub fn solve(
        &mut self,
        matrix: &SparseMatrix<1>,
        preconditioner: &BlockIncompleteLu,
        halo: &Halo,
        held: &[[bool; 3]],
        right: &[[f64; 3]],
        solution: &mut [[f64; 3]],
        tolerance: [f64; 3],
        limit: usize,
    ) -> Outcome {
        let rows = right.len();
        for buffer in [
            &mut self.residual,
            &mut self.shadow,
            &mut self.direction,
            &mut self.image,
            &mut self.second_image,
        ] {
            buffer.resize(rows, [0.0; 3]);
        }
        // What the matrix is applied to has values at the other ranks' vertices too.
        for buffer in [&mut self.preconditioned, &mut self.second] {
            buffer.resize(solution.len(), [0.0; 3]);
        }
        halo.update(3, solution.as_flattened_mut());
        let dot = |a: &[[f64; 3]], b: &[[f64; 3]]| total(halo.communicator(), dot(a, b));
        let mut iterations = 0;
        let mut norms = [f64::INFINITY; 3];
        while iterations < limit {
            subtract_product(matrix, held, right, solution, &mut self.residual);
            norms = dot(&self.residual, &self.residual).map(f64::sqrt);
            let open: [bool; 3] = std::array::from_fn(|c| norms[c] > tolerance[c]);
            if !open.contains(&true) {
                break;
            }
            let done = self.run(
                matrix,
                preconditioner,
                halo,
                held,
                solution,
                tolerance,
                open,
                limit - iterations,
            );
            iterations += done.max(1);
            if norms.iter().any(|norm| !norm.is_finite()) {
                break;
            }
        }
        let converged = (0..3).all(|c| norms[c] <= tolerance[c]);
        Outcome { iterations, residual: norms.into_iter().fold(0.0, f64::max), converged }
    }

    /// Iterates from `self.residual` until all components that are `open` rest or one breaks down.
    #[expect(clippy::too_many_arguments, reason = "the parts of one linear system")]
    fn run(
        &mut self,
        matrix: &SparseMatrix<1>,
        preconditioner: &BlockIncompleteLu,
        halo: &Halo,
        held: &[[bool; 3]],
        solution: &mut [[f64; 3]],
        tolerance: [f64; 3],
        mut open: [bool; 3],
        limit: usize,
    ) -> usize {
        let rows = self.residual.len();
        let dot = |a: &[[f64; 3]], b: &[[f64; 3]]| total(halo.communicator(), dot(a, b));
        self.shadow.copy_from_slice(&self.residual);
        self.direction.fill([0.0; 3]);
        self.image.fill([0.0; 3]);
        let (mut rho, mut alpha, mut omega) = ([1.0; 3], [1.0; 3], [1.0; 3]);
        for iteration in 0..limit {
            let next = dot(&self.shadow, &self.residual);
            let beta = quotient(open, |c| next[c] * alpha[c], |c| rho[c] * omega[c]);
            rho = next;
            let (residual, image) = (&self.residual, &self.image);
            for_each(&mut self.direction, |row, value| {
                for c in 0..3 {
                    value[c] = residual[row][c] + beta[c] * (value[c] - omega[c] * image[row][c]);
                }
            });
            preconditioner.apply(matrix, &self.direction, &mut self.preconditioned[..rows]);
            halo.update(3, self.preconditioned.as_flattened_mut());
            multiply(matrix, held, &self.preconditioned, &mut self.image);
            let against = dot(&self.shadow, &self.image);
            alpha = quotient(open, |c| rho[c], |c| against[c]);
            update(solution, alpha, &self.preconditioned);
            update(&mut self.residual, alpha.map(|value| -value), &self.image);

            preconditioner.apply(matrix, &self.residual, &mut self.second[..rows]);
            halo.update(3, self.second.as_flattened_mut());
            multiply(matrix, held, &self.second, &mut self.second_image);
            let (top, bottom) = (
                dot(&self.second_image, &self.residual),
                dot(&self.second_image, &self.second_image),
            );
            omega = quotient(open, |c| top[c], |c| bottom[c]);
            update(solution, omega, &self.second);
            update(&mut self.residual, omega.map(|value| -value), &self.second_image);

            let norms = dot(&self.residual, &self.residual).map(f64::sqrt);
            let mut broken = false;
            for c in 0..3 {
                open[c] &= norms[c] > tolerance[c];
                broken |= open[c] && (omega[c] == 0.0 || alpha[c] == 0.0);
            }
            if broken || !open.contains(&true) || norms.iter().any(|norm| !norm.is_finite()) {
                return iteration + 1;
            }
        }
        limit
    }
}

/// The quotient for the components that are still open; 0 for the others and where the divisor
/// vanishes.
fn quotient(
    open: [bool; 3],
    top: impl Fn(usize) -> f64,
    bottom: impl Fn(usize) -> f64,
) -> [f64; 3] {
    std::array::from_fn(|c| {
        let divisor = bottom(c);
        if open[c] && divisor != 0.0 { top(c) / divisor } else { 0.0 }
    })
}

fn dot(a: &[[f64; 3]], b: &[[f64; 3]]) -> [f64; 3] {
    sum(a.len(), |range| {
        let mut total = [0.0; 3];
        for (a, b) in a[range.clone()].iter().zip(&b[range]) {
            for c in 0..3 {
                total[c] += a[c] * b[c];
            }
        }
        total
    })
}

fn update(values: &mut [[f64; 3]], factor: [f64; 3], by: &[[f64; 3]]) {
    for_each(values, |index, value| {
        for c in 0..3 {
            value[c] += factor[c] * by[index][c];
        }
    });
}

fn row_image(
    matrix: &SparseMatrix<1>,
    held: &[[bool; 3]],
    row: usize,
    vector: &[[f64; 3]],
) -> [f64; 3] {
    let (columns, entries) = matrix.row(row);
    let mut value = [0.0; 3];
    for (&column, [[entry]]) in columns.iter().zip(entries) {
        let other = &vector[column as usize];
        value[0] += entry * other[0];
        value[1] += entry * other[1];
        value[2] += entry * other[2];
    }
    for c in 0..3 {
        if held[row][c] {
            value[c] = vector[row][c];
        }
    }
    value
}

fn multiply(
    matrix: &SparseMatrix<1>,
    held: &[[bool; 3]],
    vector: &[[f64; 3]],
    result: &mut [[f64; 3]],
) {
    for_each(result, |index, value| {
        *value = row_image(matrix, held, index, vector);
    });
}

fn subtract_product(
    matrix: &SparseMatrix<1>,
    held: &[[bool; 3]],
    right: &[[f64; 3]],
    vector: &[[f64; 3]],
    result: &mut [[f64; 3]],
) {
    for_each(result, |index, value| {
        let image = row_image(matrix, held, index, vector);
        *value = std::array::from_fn(|c| right[index][c] - image[c]);
    });
}
