//! The sparse least squares problem of one step of the flow.

use faer::Mat;

use crate::linear::cholesky::{Factor, UpperTriangle};
use crate::mesh::Vector;
use crate::topology::Groups;

/// An equation of the least squares problem: the unknowns in it with their factors, and its right
/// side along each axis.
pub(super) struct Row {
    pub entries: Vec<(u32, f64)>,
    pub right_side: Vector,
}

/// Minimises `|A x - b|^2 + sum of diagonal_i |x_i|^2 - 2 right_side_i x_i` for the rows of `A` and
/// `b` given, by normal equations and a Cholesky factorisation. The diagonal must be positive.
/// `None` where the digits do not suffice.
pub(super) fn least_squares(
    rows: &[Row],
    diagonal: &[f64],
    mut right_side: Mat<f64>,
) -> Option<Mat<f64>> {
    let size = diagonal.len();
    // The rows that hold each unknown.
    let entries = rows.iter().zip(0u32..);
    let entries = entries.flat_map(|(row, number)| {
        row.entries.iter().map(move |&(column, factor)| (column, (number, factor)))
    });
    let holders = Groups::new(size, entries);
    for row in rows {
        for &(column, factor) in &row.entries {
            for axis in 0..3 {
                right_side[(column as usize, axis)] += factor * row.right_side[axis];
            }
        }
    }

    let mut upper = UpperTriangle::new(size);
    let mut sums = vec![0.0; size];
    let mut met = vec![u32::MAX; size];
    let mut pattern: Vec<u32> = Vec::new();
    for column in 0..size {
        pattern.clear();
        for &(row, factor) in holders.of(column as u32) {
            for &(other, value) in &rows[row as usize].entries {
                if other as usize <= column {
                    if std::mem::replace(&mut met[other as usize], column as u32) != column as u32 {
                        pattern.push(other);
                        sums[other as usize] = 0.0;
                    }
                    sums[other as usize] += factor * value;
                }
            }
        }
        if met[column] != column as u32 {
            pattern.push(column as u32);
            sums[column] = 0.0;
        }
        sums[column] += diagonal[column];
        pattern.sort_unstable();
        for &row in &pattern {
            upper.push(row, sums[row as usize]);
        }
        upper.end_column()?;
    }
    Factor::new(&upper)?.solve_in_place(right_side.as_mut());
    Some(right_side)
}
