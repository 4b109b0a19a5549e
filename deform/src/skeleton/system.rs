//! The sparse least squares problem of one step of the flow.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::sparse::linalg::cholesky::{self, CholeskySymbolicParams, LltRef, SymmetricOrdering};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, Mat, Par, Side, Spec};

use crate::mesh::Vector;

/// One equation: a sum of unknowns, each with its factor, and what it should be.
pub(super) struct Row {
    pub entries: Vec<(u32, f64)>,
    pub right_side: Vector,
}

/// Minimises `|A x - b|^2 + sum of diagonal_i |x_i|^2 - 2 right_side_i x_i` for the rows of `A` and `b` given, by normal
/// equations and a Cholesky factorisation. The diagonal must be positive. `None` where the digits do not suffice.
pub(super) fn least_squares(
    rows: &[Row],
    diagonal: &[f64],
    mut right_side: Mat<f64>,
) -> Option<Mat<f64>> {
    let size = diagonal.len();
    // The rows that hold each unknown.
    let mut starts = vec![0usize; size + 1];
    for (column, _) in rows.iter().flat_map(|row| &row.entries) {
        starts[*column as usize + 1] += 1;
    }
    for column in 0..size {
        starts[column + 1] += starts[column];
    }
    let mut holders = vec![(0u32, 0.0f64); starts[size]];
    let mut next = starts.clone();
    for (number, row) in rows.iter().enumerate() {
        for &(column, factor) in &row.entries {
            holders[next[column as usize]] = (number as u32, factor);
            next[column as usize] += 1;
            for axis in 0..3 {
                right_side[(column as usize, axis)] += factor * row.right_side[axis];
            }
        }
    }

    // The upper triangle of A' A + diagonal, column after column.
    let mut column_starts = Vec::with_capacity(size + 1);
    column_starts.push(0u32);
    let mut row_numbers: Vec<u32> = Vec::new();
    let mut values: Vec<f64> = Vec::new();
    let mut sums = vec![0.0; size];
    let mut met = vec![u32::MAX; size];
    let mut pattern: Vec<u32> = Vec::new();
    for column in 0..size {
        pattern.clear();
        for &(row, factor) in &holders[starts[column]..starts[column + 1]] {
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
            row_numbers.push(row);
            values.push(sums[row as usize]);
        }
        column_starts.push(u32::try_from(row_numbers.len()).ok()?);
    }

    let shape =
        SymbolicSparseColMatRef::new_checked(size, size, &column_starts, None, &row_numbers);
    let order = SymmetricOrdering::Amd;
    let symbolic = cholesky::factorize_symbolic_cholesky(
        shape,
        Side::Upper,
        order,
        CholeskySymbolicParams::default(),
    )
    .ok()?;
    let mut factor = Vec::new();
    factor.try_reserve_exact(symbolic.len_val()).ok()?;
    factor.resize(symbolic.len_val(), 0.0);
    let scratch = symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Spec::default());
    let mut memory = MemBuffer::try_new(scratch).ok()?;
    symbolic
        .factorize_numeric_llt(
            &mut factor,
            SparseColMatRef::new(shape, &values),
            Side::Upper,
            LltRegularization::default(),
            Par::Seq,
            MemStack::new(&mut memory),
            Spec::default(),
        )
        .ok()?;
    let scratch = symbolic.solve_in_place_scratch::<f64>(3, Par::Seq);
    LltRef::new(&symbolic, &factor).solve_in_place_with_conj(
        Conj::No,
        right_side.as_mut(),
        Par::Seq,
        MemStack::new(&mut MemBuffer::try_new(scratch).ok()?),
    );
    Some(right_side)
}
