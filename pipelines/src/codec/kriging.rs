//! The weights by which ordinary kriging predicts a value from its neighbours'.
//!
//! The variogram is `r^1.5`, distances in units of the mean distance to the neighbours, with a
//! nugget. All in double precision, in the order written here, without fused operations: the same
//! bits on every machine.

/// The most neighbours of a point.
pub(super) const NEIGHBOURS: usize = 8;
/// The variance of repeated values at one point.
const NUGGET: f64 = 0.02;
/// The covariance at no distance; what it is does not change the weights.
const SILL: f64 = 64.0;
/// A pivot below it is taken for zero.
const LEAST_PIVOT: f64 = 1e-9;

/// The square of the distance between two places.
pub(super) fn square(a: [i32; 3], b: [i32; 3]) -> f64 {
    let [x, y, z] = [0, 1, 2].map(|axis| f64::from(a[axis]) - f64::from(b[axis]));
    x * x + y * y + z * z
}

/// The weights of `places` for a value at `at`, in single precision; zero behind the last.
///
/// `squares` are the squared distances of the places from `at`.
pub(super) fn weights(places: &[[i32; 3]], squares: &[f64]) -> [f32; NEIGHBOURS] {
    let count = places.len();
    let mut result = [0.0; NEIGHBOURS];
    let Some(solved) = solve(places, squares) else {
        #[expect(clippy::cast_possible_truncation, reason = "single precision is enough")]
        let equal = (1.0 / count.max(1) as f64) as f32;
        result[..count].fill(equal);
        return result;
    };
    #[expect(clippy::cast_possible_truncation, reason = "single precision is enough")]
    for (weight, solved) in result[..count].iter_mut().zip(solved) {
        *weight = solved as f32;
    }
    result
}

/// `None` for fewer than two places, or for places that all coincide.
#[expect(clippy::needless_range_loop, reason = "the indices of a matrix")]
fn solve(places: &[[i32; 3]], squares: &[f64]) -> Option<[f64; NEIGHBOURS]> {
    let count = places.len();
    if count < 2 {
        return None;
    }
    let mut mean = 0.0;
    for square in squares {
        mean += square.sqrt();
    }
    mean /= count as f64;
    if mean <= 0.0 {
        return None;
    }
    let covariance = |square: f64| {
        let distance = square.sqrt() / mean;
        SILL - distance * distance.sqrt()
    };
    // The lower triangle, factored in place: L below the diagonal, the pivots on it. Beside it the
    // two right-hand sides: the covariances with the place sought, and ones.
    let mut matrix = [[0.0; NEIGHBOURS]; NEIGHBOURS];
    let (mut right, mut ones) = ([0.0; NEIGHBOURS], [1.0; NEIGHBOURS]);
    for row in 0..count {
        for column in 0..row {
            matrix[row][column] = covariance(square(places[row], places[column]));
        }
        matrix[row][row] = SILL + NUGGET;
        right[row] = covariance(squares[row]);
    }
    for row in 0..count {
        for column in 0..row {
            let mut value = matrix[row][column];
            for inner in 0..column {
                value -= matrix[row][inner] * matrix[column][inner];
            }
            matrix[row][column] = value / matrix[column][column];
        }
        let mut pivot = matrix[row][row];
        for inner in 0..row {
            pivot -= matrix[row][inner] * matrix[row][inner];
        }
        if pivot.is_nan() || pivot < LEAST_PIVOT {
            return None;
        }
        matrix[row][row] = pivot.sqrt();
        for inner in 0..row {
            right[row] -= matrix[row][inner] * right[inner];
            ones[row] -= matrix[row][inner] * ones[inner];
        }
        right[row] /= matrix[row][row];
        ones[row] /= matrix[row][row];
    }
    // With C = L Lᵀ and 1ᵀ w = 1: w = C⁻¹ (c + m 1).
    let (mut with, mut without) = (0.0, 0.0);
    for row in 0..count {
        with += ones[row] * right[row];
        without += ones[row] * ones[row];
    }
    let multiplier = (1.0 - with) / without;
    for row in 0..count {
        right[row] += multiplier * ones[row];
    }
    for row in (0..count).rev() {
        for inner in row + 1..count {
            right[row] -= matrix[inner][row] * right[inner];
        }
        right[row] /= matrix[row][row];
    }
    Some(right)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(places: &[[i32; 3]], at: [i32; 3]) -> [f32; NEIGHBOURS] {
        let squares: Vec<f64> = places.iter().map(|&place| square(place, at)).collect();
        weights(places, &squares)
    }

    #[test]
    fn weights_add_up_to_one_and_share_the_symmetry_of_the_places() {
        let square = [[0, 0, 0], [10, 0, 0], [0, 10, 0], [10, 10, 0]];
        let found = of(&square, [5, 5, 0]);
        assert!(found[..4].iter().all(|weight| (weight - 0.25).abs() < 1e-6), "{found:?}");
        let found = of(&[[0, 0, 0], [10, 0, 0], [30, 5, 2]], [4, 1, 0]);
        assert!((found.iter().sum::<f32>() - 1.0).abs() < 1e-6 && found[0] > found[1]);
        assert_eq!(of(&[[1, 2, 3]], [0, 0, 0])[0], 1.0);
        assert_eq!(of(&[[1, 2, 3]; 4], [1, 2, 3])[..4], [0.25; 4]);
        let far = [[i32::MIN; 3], [i32::MAX; 3], [0; 3]];
        assert!(of(&far, [7; 3]).iter().all(|weight| weight.is_finite()));
    }

    #[test]
    fn a_line_of_values_is_continued() {
        // Between two neighbours and beyond: kriging with r^1.5 is nearly a cubic spline's.
        let found = of(&[[-10, 0, 0], [10, 0, 0], [-30, 0, 0], [30, 0, 0]], [0; 3]);
        let value: f32 = found.iter().zip([-10.0, 10.0, -30.0, 30.0]).map(|(w, x)| w * x).sum();
        assert!(value.abs() < 1e-5, "{value}");
    }
}
