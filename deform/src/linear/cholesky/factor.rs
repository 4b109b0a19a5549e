//! The sparse Cholesky factor that faer makes.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::sparse::linalg::cholesky::{
    self, CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, Mat, MatMut, Par, Side, Spec};

use crate::linear::SparseMatrix;

/// The upper triangle of a symmetric matrix of numbers, column after column.
#[derive(Debug)]
pub(crate) struct UpperTriangle {
    starts: Vec<u32>,
    rows: Vec<u32>,
    values: Vec<f64>,
}

impl UpperTriangle {
    /// A triangle of no columns so far.
    pub(crate) fn new(columns: usize) -> Self {
        let mut starts = Vec::with_capacity(columns + 1);
        starts.push(0);
        Self { starts, rows: Vec::new(), values: Vec::new() }
    }

    /// Adds an entry to the last column; the rows of a column rise.
    pub(crate) fn push(&mut self, row: u32, value: f64) {
        self.rows.push(row);
        self.values.push(value);
    }

    /// Ends a column; `None` where there are more entries than faer can count.
    pub(crate) fn end_column(&mut self) -> Option<()> {
        self.starts.push(u32::try_from(i32::try_from(self.rows.len()).ok()?).ok()?);
        Some(())
    }

    fn of<const B: usize>(matrix: &SparseMatrix<B>) -> Option<Self> {
        // A symmetric matrix: the upper triangle by columns is the lower one by rows.
        let size = B * matrix.rows();
        u32::try_from(size).ok()?;
        let mut upper = Self::new(size);
        for row in 0..matrix.rows() {
            let (columns, blocks) = matrix.row(row);
            for axis in 0..B {
                for (&column, block) in
                    columns.iter().zip(blocks).take_while(|(column, _)| **column as usize <= row)
                {
                    let count = if column as usize == row { axis + 1 } else { B };
                    for (other, &value) in block[axis].iter().enumerate().take(count) {
                        upper.push(u32::try_from(B * column as usize + other).ok()?, value);
                    }
                }
                upper.end_column()?;
            }
        }
        Some(upper)
    }
}

/// The Cholesky factor of a symmetric positive definite matrix, which it does not keep.
#[derive(Debug)]
pub(crate) struct Factor {
    /// `None` for a matrix without rows.
    factor: Option<(SymbolicCholesky<u32>, Vec<f64>)>,
}

impl Factor {
    /// Factors a matrix of blocks; `None` where it is not positive definite or its factor does not
    /// fit in memory.
    pub(crate) fn of<const B: usize>(matrix: &SparseMatrix<B>) -> Option<Self> {
        Self::new(&UpperTriangle::of(matrix)?)
    }

    /// Factors a matrix; `None` where it is not positive definite or its factor does not fit in
    /// memory.
    pub(crate) fn new(upper: &UpperTriangle) -> Option<Self> {
        let size = upper.starts.len() - 1;
        if size == 0 {
            return Some(Self { factor: None });
        }
        let pattern =
            SymbolicSparseColMatRef::new_checked(size, size, &upper.starts, None, &upper.rows);
        let order = SymmetricOrdering::Amd;
        let symbolic = cholesky::factorize_symbolic_cholesky(
            pattern,
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
                SparseColMatRef::new(pattern, &upper.values),
                Side::Upper,
                LltRegularization::default(),
                Par::Seq,
                MemStack::new(&mut memory),
                Spec::default(),
            )
            .ok()?;
        factor
            .iter()
            .all(|value| value.is_finite())
            .then_some(Self { factor: Some((symbolic, factor)) })
    }

    /// Solves for right sides side by side, which become the solutions.
    pub(crate) fn solve_in_place(&self, sides: MatMut<'_, f64>) {
        let Some((symbolic, factor)) = &self.factor else { return };
        let scratch = symbolic.solve_in_place_scratch::<f64>(sides.ncols(), Par::Seq);
        let mut memory = MemBuffer::new(scratch);
        LltRef::new(symbolic, factor).solve_in_place_with_conj(
            Conj::No,
            sides,
            Par::Seq,
            MemStack::new(&mut memory),
        );
    }

    /// `result = A⁻¹ vector` for `K` right sides side by side.
    pub(crate) fn solve<const B: usize, const K: usize>(
        &self,
        vector: &[[[f64; B]; K]],
        result: &mut [[[f64; B]; K]],
    ) {
        let mut sides =
            Mat::from_fn(B * vector.len(), K, |row, side| vector[row / B][side][row % B]);
        self.solve_in_place(sides.as_mut());
        for (row, value) in result.iter_mut().enumerate() {
            *value = std::array::from_fn(|side| {
                std::array::from_fn(|axis| sides[(B * row + axis, side)])
            });
        }
    }
}
