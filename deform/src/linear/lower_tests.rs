//! Halves of matrices against the matrices.

use std::sync::Arc;

use super::gauss_seidel::{GaussSeidel, Sweep};
use super::iteration::Matrix;
use super::lower::Symmetric;
use super::pieces::Pieces;
use super::real::Real;
use super::{SparseMatrix, invert_positive};

/// A number from -1 to 1 that looks random.
fn noise(seed: usize) -> f64 {
    let mixed = (seed as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    (mixed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

/// A symmetric matrix of `rows` rows, each coupled to the ones at these distances, whose blocks are
/// not symmetric themselves.
fn banded<const B: usize>(rows: usize, distances: &[usize]) -> SparseMatrix<B> {
    let entry = |row: usize, column: usize, i: usize, j: usize| {
        let (row, column, i, j) =
            if row < column { (column, row, j, i) } else { (row, column, i, j) };
        noise(((row * 1009 + column) * 7 + i) * 7 + j)
    };
    let (mut offsets, mut columns, mut values) = (vec![0], Vec::new(), Vec::new());
    for row in 0..rows {
        let before = distances.iter().rev().filter_map(|&distance| row.checked_sub(distance));
        let after = distances.iter().map(|distance| row + distance).filter(|&other| other < rows);
        for column in before.chain([row]).chain(after) {
            columns.push(column as u32);
            values.push(std::array::from_fn(|i| {
                std::array::from_fn(|j| match (row == column, i == j) {
                    (true, true) => 30.0 + noise(row),
                    (true, false) => 0.1,
                    _ => entry(row, column, i, j),
                })
            }));
        }
        offsets.push(columns.len());
    }
    SparseMatrix::from_parts(offsets, columns, values)
}

fn vector<const B: usize>(rows: usize) -> Vec<[[f64; B]; 1]> {
    (0..rows).map(|row| [std::array::from_fn(|axis| noise(5 * row + axis))]).collect()
}

fn largest<T: Real, const B: usize>(a: &[[[T; B]; 1]], b: &[[[f64; B]; 1]]) -> f64 {
    let pairs = a.as_flattened().as_flattened().iter().zip(b.as_flattened().as_flattened());
    pairs.map(|(a, b)| (a.wide() - b).abs()).fold(0.0, f64::max)
}

fn product<const B: usize>(matrix: &SparseMatrix<B>, of: &[[[f64; B]; 1]]) -> Vec<[[f64; B]; 1]> {
    let mut product = of.to_vec();
    matrix.multiply_columns(of, &mut product);
    product
}

fn narrow<T: Real, const B: usize>(values: &[[[f64; B]; 1]]) -> Vec<[[T; B]; 1]> {
    values.iter().map(|value| value.map(|column| column.map(T::of))).collect()
}

/// One, two, three and eight pieces, the last of them shorter.
fn check<T: Real, const B: usize>(accuracy: f64, of_products: f64) {
    for rows in [200, 400, 700, 2000] {
        let matrix = banded::<B>(rows, &[1, 2, 17, 200]);
        let pieces = Pieces::new(&matrix, rows);
        let smoother = GaussSeidel::<T, B>::new(&matrix, pieces, &[]).unwrap();
        let whole = Symmetric::new(smoother.lower(), &matrix).unwrap();
        let start = vector(rows);
        let mut found = start.clone();
        whole.multiply_columns(&start, &mut found);
        let expected = product(&matrix, &start);
        assert!(largest(&found, &expected) <= of_products, "{}", largest(&found, &expected));
        assert!(whole.has_pattern_of(&matrix));
        assert!(!whole.has_pattern_of(&banded(rows, &[1, 2, 18, 200])));
        let again = whole.whole();
        assert!(
            again.has_pattern_of(&matrix)
                && largest(&product(&again, &start), &expected) <= of_products
        );

        // A sweep from zero leaves the residual that it says.
        let mut solution = vec![[[T::default(); B]]; rows];
        let (mut residual, mut beside) =
            (solution.clone(), vec![[[T::default(); B]]; pieces.odd_rows()]);
        let right_side = narrow(&start);
        smoother.forward(Sweep {
            right_side: &right_side,
            solution: &mut solution,
            residual: &mut residual,
            beside: &mut beside,
        });
        let wide = |values: &[[[T; B]; 1]]| -> Vec<[[f64; B]; 1]> {
            values.iter().map(|value| value.map(|column| column.map(T::wide))).collect()
        };
        let mut rest = product(&matrix, &wide(&solution));
        rest.as_flattened_mut().as_flattened_mut().iter_mut().for_each(|value| *value = -*value);
        for (rest, start) in rest.iter_mut().zip(&start) {
            rest[0].iter_mut().zip(start[0]).for_each(|(rest, start)| *rest += start);
        }
        assert!(largest(&residual, &rest) < accuracy);

        // A sweep backwards makes row after row right: odd pieces first, each from its end.
        let mut expected = wide(&solution);
        let mut order: Vec<usize> = (0..rows).collect();
        order.sort_by_key(|&row| (!pieces.start(row).1, std::cmp::Reverse(row)));
        for row in order {
            let (columns, blocks) = matrix.row(row);
            let mut right = start[row][0];
            for (&column, block) in columns.iter().zip(blocks) {
                for (right, entries) in right.iter_mut().zip(block) {
                    if column as usize != row {
                        let value = expected[column as usize][0];
                        *right -= entries.iter().zip(value).map(|(a, b)| a * b).sum::<f64>();
                    }
                }
            }
            let inverse = invert_positive(&matrix.diagonal(row).unwrap()).unwrap();
            expected[row] = [inverse.map(|row| row.iter().zip(right).map(|(a, b)| a * b).sum())];
        }
        smoother.backward(Sweep {
            right_side: &right_side,
            solution: &mut solution,
            residual: &mut residual,
            beside: &mut beside,
        });
        assert!(largest(&solution, &expected) < accuracy);
    }
}

#[test]
fn halves_do_what_their_matrices_do() {
    check::<f64, 1>(1e-13, 1e-13);
    check::<f64, 3>(1e-13, 1e-13);
    check::<f32, 1>(1e-5, 1e-12);
    check::<f32, 3>(1e-5, 1e-12);
    check::<f32, 6>(1e-5, 1e-12);
}

#[test]
fn what_single_precision_cannot_hold_is_kept_in_rows() {
    let mut matrix = banded::<1>(300, &[1]);
    matrix.values_mut().iter_mut().flatten().flatten().for_each(|value| *value *= 1e-30);
    let smoother = GaussSeidel::<f32, 1>::new(&matrix, Pieces::new(&matrix, 300), &[]);
    assert!(smoother.is_none_or(|smoother| Symmetric::new(smoother.lower(), &matrix).is_none()));
    let settings = super::MultigridSettings { by_half: true, ..Default::default() };
    let solver = super::Multigrid::new(Arc::new(matrix), settings).unwrap();
    let mut solution = vec![[0.0]; 300];
    let tolerance = super::Tolerance { relative: 1e-10, absolute: 0.0 };
    super::LinearSolver::solve(&solver, &[[1e-30]; 300], &mut solution, tolerance).unwrap();
    assert!(solution.iter().all(|value| value[0].is_finite() && value[0] != 0.0));
}

/// A solver that keeps the half of a matrix has no need of the whole.
#[test]
fn multigrid_lets_go_of_the_matrix() {
    let matrix = Arc::new(banded::<3>(2000, &[1, 30]));
    let settings = super::MultigridSettings { by_half: true, ..Default::default() };
    let solver = super::Multigrid::new(Arc::clone(&matrix), settings).unwrap();
    assert_eq!(Arc::strong_count(&matrix), 1);
    assert!(solver.matrix().has_pattern_of(&matrix));
}
