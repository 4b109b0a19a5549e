//! The Cholesky factor of a small dense matrix.

/// The lower factor of a symmetric positive definite matrix.
pub(crate) fn factor_dense(mut matrix: Vec<Vec<f64>>) -> Option<Vec<Vec<f64>>> {
    for row in 0..matrix.len() {
        for column in 0..=row {
            let (done, rest) = matrix.split_at(row);
            let other = if column < row { &done[column] } else { &rest[0] };
            let product: f64 =
                rest[0][..column].iter().zip(&other[..column]).map(|(a, b)| a * b).sum();
            let value = rest[0][column] - product;
            matrix[row][column] =
                if column < row { value / matrix[column][column] } else { value.sqrt() };
        }
        // Also where the root was of a negative number.
        if !(matrix[row][row] > 0.0 && matrix[row][row].is_finite()) {
            return None;
        }
    }
    Some(matrix)
}

/// Solves with the lower factor of a symmetric positive definite matrix, in place.
pub(crate) fn solve_dense(factor: &[Vec<f64>], values: &mut [f64]) {
    for row in 0..values.len() {
        let product: f64 = factor[row][..row].iter().zip(&values[..row]).map(|(a, b)| a * b).sum();
        values[row] = (values[row] - product) / factor[row][row];
    }
    for row in (0..values.len()).rev() {
        let product: f64 =
            (row + 1..values.len()).map(|below| factor[below][row] * values[below]).sum();
        values[row] = (values[row] - product) / factor[row][row];
    }
}
