//! The weights by which ordinary kriging predicts a value from its neighbours'.
//!
//! The variogram is `r^1.5`, distances in units of the mean distance to the neighbours, with a
//! nugget. All in double precision, in the order written here, without fused operations: the same
//! bits on every machine.

use tombolo_deform::lanes::{LANES, Lanes};

/// The most neighbours of a point.
pub(super) const NEIGHBOURS: usize = 8;
/// The variance of repeated values at one point.
const NUGGET: f64 = 0.02;
/// The covariance at no distance; what it is does not change the weights.
const SILL: f64 = 64.0;
/// A pivot below it is taken for zero.
const LEAST_PIVOT: f64 = 1e-9;

/// The square of the distance between two positions.
#[inline(always)]
pub(super) fn square(a: [i32; 3], b: [i32; 3]) -> f64 {
    let x = f64::from(a[0]) - f64::from(b[0]);
    let y = f64::from(a[1]) - f64::from(b[1]);
    let z = f64::from(a[2]) - f64::from(b[2]);
    x * x + y * y + z * z
}

/// The neighbours that four values are predicted from, the nearest first: their positions, and the
/// squares of their distances.
#[derive(Clone, Copy)]
pub(super) struct Four {
    positions: [[[i32; LANES]; 3]; NEIGHBOURS],
    squares: [Lanes; NEIGHBOURS],
}

impl Four {
    pub(super) const NONE: Self =
        Self { positions: [[[0; LANES]; 3]; NEIGHBOURS], squares: [Lanes::ZERO; NEIGHBOURS] };

    /// Sets a neighbour of one of the four.
    #[inline(always)]
    pub(super) fn set(&mut self, lane: usize, index: usize, position: [i32; 3], square: f64) {
        for (axis, steps) in position.into_iter().enumerate() {
            self.positions[index][axis][lane] = steps;
        }
        self.squares[index].0[lane] = square;
    }
}

/// The weights of so many neighbours of each of the four, in single precision; zero behind the last.
#[inline(always)]
pub(super) fn weights(of: &Four, count: usize) -> [[f32; NEIGHBOURS]; LANES] {
    let (solved, is_sound) = if count == NEIGHBOURS {
        // The number is known when it is compiled: most have as many.
        solve(of, NEIGHBOURS)
    } else {
        solve(of, count)
    };
    let equal = 1.0 / count.max(1) as f64;
    let mut weights = [[0.0; NEIGHBOURS]; LANES];
    for lane in 0..LANES {
        for index in 0..count {
            let weight = if is_sound[lane] { solved[index].0[lane] } else { equal };
            #[expect(clippy::cast_possible_truncation, reason = "single precision is enough")]
            {
                weights[lane][index] = weight as f32;
            }
        }
    }
    weights
}

/// Solves four systems, of which those are not sound that have fewer than two positions, or
/// positions that all coincide.
#[inline(always)]
#[expect(clippy::needless_range_loop, reason = "the indices of a matrix")]
fn solve(of: &Four, count: usize) -> ([Lanes; NEIGHBOURS], [bool; LANES]) {
    let mut is_sound = [count >= 2; LANES];
    let mut mean = Lanes::ZERO;
    let mut positions = [[Lanes::ZERO; 3]; NEIGHBOURS];
    for row in 0..count {
        positions[row] = of.positions[row].map(|axis| Lanes(axis.map(f64::from)));
        mean += of.squares[row].sqrt();
    }
    mean = mean / Lanes::all(count as f64);
    for lane in 0..LANES {
        is_sound[lane] &= mean.0[lane] > 0.0;
    }
    let covariance = |square: Lanes| {
        let distance = square.sqrt() / mean;
        Lanes::all(SILL) - distance * distance.sqrt()
    };
    // The lower triangle, factored in place: L below the diagonal, the pivots on it. Beside it the
    // two right-hand sides: the covariances with the position sought, and ones.
    let mut matrix = [[Lanes::ZERO; NEIGHBOURS]; NEIGHBOURS];
    let (mut right, mut ones) = ([Lanes::ZERO; NEIGHBOURS], [Lanes::all(1.0); NEIGHBOURS]);
    for row in 0..count {
        for column in 0..row {
            let x = positions[row][0] - positions[column][0];
            let y = positions[row][1] - positions[column][1];
            let z = positions[row][2] - positions[column][2];
            matrix[row][column] = covariance(x * x + y * y + z * z);
        }
        matrix[row][row] = Lanes::all(SILL + NUGGET);
        right[row] = covariance(of.squares[row]);
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
        for lane in 0..LANES {
            // NaN, too.
            is_sound[lane] &= pivot.0[lane] >= LEAST_PIVOT;
        }
        matrix[row][row] = pivot.sqrt();
        for inner in 0..row {
            right[row] -= matrix[row][inner] * right[inner];
            ones[row] -= matrix[row][inner] * ones[inner];
        }
        right[row] = right[row] / matrix[row][row];
        ones[row] = ones[row] / matrix[row][row];
    }
    // With C = L Lᵀ and 1ᵀ w = 1: w = C⁻¹ (c + m 1).
    let (mut with, mut without) = (Lanes::ZERO, Lanes::ZERO);
    for row in 0..count {
        with += ones[row] * right[row];
        without += ones[row] * ones[row];
    }
    let multiplier = (Lanes::all(1.0) - with) / without;
    for row in 0..count {
        right[row] += multiplier * ones[row];
    }
    for row in (0..count).rev() {
        for inner in row + 1..count {
            right[row] -= matrix[inner][row] * right[inner];
        }
        right[row] = right[row] / matrix[row][row];
    }
    (right, is_sound)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(positions: &[[i32; 3]], at: [i32; 3]) -> [f32; NEIGHBOURS] {
        let mut four = Four::NONE;
        for (index, &position) in positions.iter().enumerate() {
            four.set(1, index, position, square(position, at));
        }
        weights(&four, positions.len())[1]
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
