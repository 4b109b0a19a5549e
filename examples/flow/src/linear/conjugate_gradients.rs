//! The conjugate gradient method.

use super::{Halo, Matrix, Outcome, Schwarz, for_each_chunk, sum};

/// Conjugate gradients (Hestenes and Stiefel 1952), preconditioned by multigrid, with the buffers kept between solves.
///
/// On several ranks each has its rows of the matrix; `right` holds the values of its rows, `solution` those of all its vertices.
#[derive(Debug, Default)]
pub struct ConjugateGradients {
    residual: Vec<f64>,
    preconditioned: Vec<f64>,
    direction: Vec<f64>,
    image: Vec<f64>,
}

impl ConjugateGradients {
    /// Improves `solution` of the symmetric positive (semi-)definite system until the Euclidean norm of its residual is at most
    /// `tolerance`, or `limit` iterations are done. Collective.
    #[expect(clippy::too_many_arguments, reason = "the parts of one linear system")]
    pub fn solve(
        &mut self,
        matrix: &Matrix,
        preconditioner: &mut Schwarz,
        halo: &Halo,
        right: &[f64],
        solution: &mut [f64],
        tolerance: f64,
        limit: usize,
    ) -> Outcome {
        let rows = right.len();
        for buffer in [&mut self.residual, &mut self.preconditioned, &mut self.image] {
            buffer.resize(rows, 0.0);
        }
        self.direction.resize(solution.len(), 0.0);
        matrix.residual(right, solution, &mut self.residual);
        let dot = |a: &[f64], b: &[f64]| halo.sum([dot(a, b)])[0];
        let mut size = dot(&self.residual, &self.residual).sqrt();
        let mut iterations = 0;
        let mut product = 0.0;
        while size > tolerance && size.is_finite() && iterations < limit {
            preconditioner.apply(&self.residual, &mut self.preconditioned, halo);
            let next = dot(&self.residual, &self.preconditioned);
            let beta = if iterations == 0 { 0.0 } else { next / product };
            product = next;
            let preconditioned = &self.preconditioned;
            for_each_chunk(&mut self.direction[..rows], |start, chunk| {
                for (offset, value) in chunk.iter_mut().enumerate() {
                    *value = if beta == 0.0 { 0.0 } else { beta * *value }
                        + preconditioned[start + offset];
                }
            });
            halo.update(&mut self.direction);
            matrix.multiply(&self.direction, &mut self.image);
            let curvature = dot(&self.direction[..rows], &self.image);
            if curvature <= 0.0 || !curvature.is_finite() {
                break;
            }
            let step = product / curvature;
            add(solution, step, &self.direction);
            add(&mut self.residual, -step, &self.image);
            size = dot(&self.residual, &self.residual).sqrt();
            iterations += 1;
        }
        Outcome { iterations, residual: size, converged: size <= tolerance }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    let [total] =
        sum(a.len(), |range| [a[range.clone()].iter().zip(&b[range]).map(|(a, b)| a * b).sum()]);
    total
}

fn add(values: &mut [f64], factor: f64, by: &[f64]) {
    for_each_chunk(values, |start, chunk| {
        for (offset, value) in chunk.iter_mut().enumerate() {
            *value += factor * by[start + offset];
        }
    });
}
