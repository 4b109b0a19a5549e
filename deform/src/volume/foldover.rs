//! The foldover-free energy of one tetrahedron, its gradient and a positive definite Hessian.

use crate::linear::Block;
use crate::mesh::Vector;
use crate::vector::{add, cross, determinant, dot, length, scale, subtract, unit};

/// The weight of the term that resists a change of volume; the rest is that of the term that
/// resists a change of shape.
const VOLUME: f64 = 0.5;

/// The energy of a corner that is as in the reference: the least there is.
pub(super) const ENERGY_AT_REST: f64 = 3.0 * (1.0 - VOLUME) + 2.0 * VOLUME;

/// Eigenvalues of a Hessian are kept above this part of that of the shape term.
const LEAST: f64 = 1e-3;

/// A matrix by its rows.
type Matrix = [Vector; 3];

/// The ten pairs of corners of a tetrahedron for which [`Local::blocks`] has a block.
pub(super) const PAIRS: [[usize; 2]; 10] =
    [[0, 0], [0, 1], [0, 2], [0, 3], [1, 1], [1, 2], [1, 3], [2, 2], [2, 3], [3, 3]];

/// The energy of one tetrahedron to second order.
#[derive(Debug, Clone, Copy)]
pub(super) struct Local {
    /// The derivatives by the corners' coordinates.
    pub(super) gradient: [Vector; 4],
    /// The second derivatives, projected, for each of [`PAIRS`].
    pub(super) blocks: [Block<3>; 10],
}

/// The gradient of the map that takes the reference, where the shape functions have `gradients`, to
/// `points`.
#[inline]
pub(super) fn jacobian(points: [Vector; 4], gradients: &[Vector; 4]) -> Matrix {
    let mut rows = [[0.0; 3]; 3];
    for corner in 1..4 {
        let edge = subtract(points[corner], points[0]);
        for (row, value) in rows.iter_mut().zip(edge) {
            *row = add(*row, scale(gradients[corner], value));
        }
    }
    rows
}

#[inline]
pub(super) fn determinant_of(j: &Matrix) -> f64 {
    determinant(j[0], j[1], j[2])
}

/// `χ` and the root in it.
#[inline]
fn regularised(determinant: f64, epsilon: f64) -> (f64, f64) {
    let root = determinant.hypot(epsilon);
    // Without cancellation where the determinant is negative.
    let chi = if determinant > 0.0 {
        0.5 * (determinant + root)
    } else {
        0.5 * epsilon * epsilon / (root - determinant)
    };
    (chi, root)
}

/// `χ`.
#[inline]
pub(super) fn chi(determinant: f64, epsilon: f64) -> f64 {
    regularised(determinant, epsilon).0
}

/// `(1 - t) tr(JᵀJ) / χ^⅔ + t (1 + det²J) / χ`: at least 2 for a rotation.
#[inline]
pub(super) fn energy(j: &Matrix, epsilon: f64) -> f64 {
    let determinant = determinant_of(j);
    let (chi, _) = regularised(determinant, epsilon);
    let square = dot(j[0], j[0]) + dot(j[1], j[1]) + dot(j[2], j[2]);
    let third = chi.cbrt();
    (1.0 - VOLUME) * square / (third * third) + VOLUME * (1.0 + determinant * determinant) / chi
}

/// The energy to second order at `j`.
///
/// In the frame of the singular vectors the Hessian falls apart into 3×3 for the singular values
/// and three pairs of a twist and a flip (B. Smith, F. de Goes, T. Kim, *Analytic eigensystems for
/// isotropic distortion energies*, 2019).
pub(super) fn local(j: &Matrix, epsilon: f64, gradients: &[Vector; 4]) -> Local {
    let determinant = determinant_of(j);
    let (chi, root) = regularised(determinant, epsilon);
    let square = dot(j[0], j[0]) + dot(j[1], j[1]) + dot(j[2], j[2]);
    let (slope, bend) = (chi / root, 0.5 * epsilon * epsilon / (root * root * root));
    let shape = (1.0 - VOLUME) / chi.cbrt().powi(2);
    // Derivatives by the squared norm and the determinant.
    let by_square = shape;
    let mixed = -2.0 / 3.0 * shape / chi * slope;
    let by_determinant = square * mixed
        + VOLUME * (2.0 * determinant - (1.0 + determinant * determinant) * slope / chi) / chi;
    let twice = square * shape * (10.0 / 9.0 * (slope / chi).powi(2) - 2.0 / 3.0 * bend / chi)
        + VOLUME / chi
            * (2.0
                - 4.0 * determinant * slope / chi
                - (1.0 + determinant * determinant) * (bend / chi - 2.0 * (slope / chi).powi(2)));

    let cofactors = [cross(j[1], j[2]), cross(j[2], j[0]), cross(j[0], j[1])];
    let stress: Matrix = std::array::from_fn(|row| {
        add(scale(j[row], 2.0 * by_square), scale(cofactors[row], by_determinant))
    });
    let gradient = gradients.map(|g| stress.map(|row| dot(row, g)));

    let (left, sigma, right) = singular(j);
    let floor = LEAST * 2.0 * by_square;
    let others = [[1, 2], [2, 0], [0, 1]];
    let minors = others.map(|[a, b]| sigma[a] * sigma[b]);
    let mut stretch = [[0.0; 3]; 3];
    for a in 0..3 {
        for b in 0..3 {
            let own = if a == b { 2.0 * by_square } else { by_determinant * sigma[3 - a - b] };
            stretch[a][b] = own
                + 2.0 * mixed * (sigma[a] * minors[b] + sigma[b] * minors[a])
                + twice * minors[a] * minors[b];
        }
    }
    let stretch = projected(stretch, floor);
    // For each axis, half the sum and half the difference of the flip and the twist about it.
    let pairs = sigma.map(|value| {
        let twist = (2.0 * by_square + by_determinant * value).max(floor);
        let flip = (2.0 * by_square - by_determinant * value).max(floor);
        (0.5 * (flip + twist), 0.5 * (flip - twist))
    });

    let local = gradients.map(|g| right.map(|axis| dot(axis, g)));
    let blocks = PAIRS.map(|[a, b]| {
        let (a, b) = (local[a], local[b]);
        let mut block = [[0.0; 3]; 3];
        for (row, values) in block.iter_mut().enumerate() {
            for (column, value) in values.iter_mut().enumerate() {
                *value = stretch[row][column] * a[row] * b[column];
            }
        }
        for (axis, [p, q]) in others.into_iter().enumerate() {
            let (sum, difference) = pairs[axis];
            block[p][p] += sum * a[q] * b[q];
            block[q][q] += sum * a[p] * b[p];
            block[p][q] += difference * a[q] * b[p];
            block[q][p] += difference * a[p] * b[q];
        }
        rotated(&left, &block)
    });
    Local { gradient, blocks }
}

/// `Σ left[p] block[p][q] left[q]ᵀ`.
fn rotated(left: &Matrix, block: &Block<3>) -> Block<3> {
    let half: Matrix = std::array::from_fn(|p| {
        (0..3).fold([0.0; 3], |sum, q| add(sum, scale(left[q], block[p][q])))
    });
    std::array::from_fn(|row| {
        (0..3).fold([0.0; 3], |sum, p| add(sum, scale(half[p], left[p][row])))
    })
}

/// `J = Σ sigma[k] left[k] right[k]ᵀ` to rounding, with right-handed vectors and the sign of the
/// determinant in the last value.
pub(super) fn singular(j: &Matrix) -> (Matrix, Vector, Matrix) {
    let mut square = [[0.0; 3]; 3];
    for (a, row) in square.iter_mut().enumerate() {
        for (b, value) in row.iter_mut().enumerate() {
            *value = j[0][a] * j[0][b] + j[1][a] * j[1][b] + j[2][a] * j[2][b];
        }
    }
    let (values, mut right) = eigen(square);
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| values[b].total_cmp(&values[a]));
    right = order.map(|index| right[index]);
    right[2] = cross(right[0], right[1]);
    let image = |v: Vector| j.map(|row| dot(row, v));
    let first = image(right[0]);
    let size = length(first);
    if size.is_nan() || size <= 0.0 {
        return ([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], [0.0; 3], right);
    }
    let first = scale(first, 1.0 / size);
    let second = image(right[1]);
    let second = subtract(second, scale(first, dot(first, second)));
    let width = length(second);
    let second = if width > 1e-14 * size { scale(second, 1.0 / width) } else { across(first) };
    let third = cross(first, second);
    let sigma = [size, dot(second, image(right[1])), dot(third, image(right[2]))];
    ([first, second, third], sigma, right)
}

/// A unit vector across a unit vector.
fn across(v: Vector) -> Vector {
    let axis = if v[0].abs() < 0.6 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
    let across = cross(v, axis);
    unit(across)
}

/// The symmetric matrix with its eigenvalues raised to `floor`.
fn projected(matrix: Matrix, floor: f64) -> Matrix {
    let (values, vectors) = eigen(matrix);
    if values.iter().all(|&value| value >= floor) {
        return matrix;
    }
    let mut result = [[0.0; 3]; 3];
    for (value, vector) in values.into_iter().zip(vectors) {
        for (row, factor) in result.iter_mut().zip(vector) {
            *row = add(*row, scale(vector, factor * value.max(floor)));
        }
    }
    result
}

/// Eigenvalues and unit eigenvectors of a symmetric matrix, by Jacobi's rotations.
fn eigen(mut a: Matrix) -> (Vector, Matrix) {
    let mut vectors = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for _ in 0..12 {
        let off = a[0][1].abs().max(a[0][2].abs()).max(a[1][2].abs());
        if off <= 1e-15 * (a[0][0].abs() + a[1][1].abs() + a[2][2].abs()) || !off.is_finite() {
            break;
        }
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if a[p][q] == 0.0 {
                continue;
            }
            let theta = 0.5 * (a[q][q] - a[p][p]) / a[p][q];
            let t = theta.signum() / (theta.abs() + theta.hypot(1.0));
            let c = 1.0 / t.hypot(1.0);
            let s = t * c;
            for row in &mut a {
                let (x, y) = (row[p], row[q]);
                (row[p], row[q]) = (c * x - s * y, s * x + c * y);
            }
            let (x, y) = (a[p], a[q]);
            a[p] = subtract(scale(x, c), scale(y, s));
            a[q] = add(scale(x, s), scale(y, c));
            let (x, y) = (vectors[p], vectors[q]);
            vectors[p] = subtract(scale(x, c), scale(y, s));
            vectors[q] = add(scale(x, s), scale(y, c));
        }
    }
    ([a[0][0], a[1][1], a[2][2]], vectors)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const GRADIENTS: [Vector; 4] =
        [[-1.0, -1.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]

        #[test]
        fn singular_values_rebuild_the_matrix(values in prop::array::uniform3(prop::array::uniform3(-2.0..2.0f64))) {
            let (left, sigma, right) = singular(&values);
            for a in 0..3 {
                for b in 0..3 {
                    let sum: f64 = (0..3).map(|k| sigma[k] * left[k][a] * right[k][b]).sum();
                    prop_assert!((sum - values[a][b]).abs() < 1e-7, "{sum} {}", values[a][b]);
                }
            }
            prop_assert!((determinant_of(&left) - 1.0).abs() < 1e-9 && (determinant_of(&right) - 1.0).abs() < 1e-9);
        }

        /// The gradient against central differences, whatever the sign of the determinant.
        #[test]
        fn the_gradient_is_that_of_the_energy(
            points in prop::array::uniform4(prop::array::uniform3(-1.0..1.0f64)),
            corner in 0usize..4,
            axis in 0usize..3,
        ) {
            let epsilon = 0.5;
            let at = |step: f64| {
                let mut moved = points;
                moved[corner][axis] += step;
                energy(&jacobian(moved, &GRADIENTS), epsilon)
            };
            let local = local(&jacobian(points, &GRADIENTS), epsilon, &GRADIENTS);
            let difference = (at(1e-5) - at(-1e-5)) / 2e-5;
            prop_assert!((difference - local.gradient[corner][axis]).abs() < 1e-5 * (1.0 + difference.abs()));
        }

        /// Where a cell is stretched nothing is projected, and the Hessian is that of the energy.
        #[test]
        fn the_hessian_is_that_of_the_energy(
            moves in prop::array::uniform4(prop::array::uniform3(-0.05..0.05f64)),
            first in 0usize..12,
            second in 0usize..12,
        ) {
            let mut points = [[0.0; 3], [1.3, 0.0, 0.0], [0.0, 1.3, 0.0], [0.0, 0.0, 1.3]];
            for (point, by) in points.iter_mut().zip(moves) {
                *point = add(*point, by);
            }
            let gradient = |step: f64| {
                let mut moved = points;
                moved[first / 3][first % 3] += step;
                local(&jacobian(moved, &GRADIENTS), 1e-3, &GRADIENTS).gradient[second / 3][second % 3]
            };
            let difference = (gradient(1e-5) - gradient(-1e-5)) / 2e-5;
            let blocks = local(&jacobian(points, &GRADIENTS), 1e-3, &GRADIENTS).blocks;
            let (a, b) = if first / 3 <= second / 3 { (first, second) } else { (second, first) };
            let pair = PAIRS.iter().position(|pair| *pair == [a / 3, b / 3]).unwrap();
            let value = blocks[pair][a % 3][b % 3];
            prop_assert!((difference - value).abs() < 1e-4 * (1.0 + value.abs()), "{difference} {value}");
        }

        #[test]
        fn the_projected_hessian_is_positive(
            points in prop::array::uniform4(prop::array::uniform3(-1.0..1.0f64)),
            direction in prop::array::uniform4(prop::array::uniform3(-1.0..1.0f64)),
        ) {
            let blocks = local(&jacobian(points, &GRADIENTS), 1e-2, &GRADIENTS).blocks;
            let sum: f64 = PAIRS.iter().zip(&blocks).map(|(&[a, b], block)| {
                let value = dot(direction[a], block.map(|row| dot(row, direction[b])));
                if a == b { value } else { 2.0 * value }
            }).sum();
            prop_assert!(sum > 0.0, "{sum}");
        }
    }
}
