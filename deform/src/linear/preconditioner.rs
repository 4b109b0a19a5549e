//! Incomplete factorisations as preconditioners.

use super::matrix::{Block, invert_positive};
use super::{LinearError, SparseMatrix};
use crate::parallel;

/// Rows are cut into at most this many pieces, each factorised by itself. It bounds the threads that one application can use.
const PIECES: usize = 2;

/// A piece has at least this many rows.
const PIECE_ROWS: usize = 2048;

/// Which factorisation a [`BlockPreconditioner`] is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Factorization {
    /// Incomplete Cholesky without fill-in. Where it breaks down, the diagonal is raised (Manteuffel 1980) until it does not.
    IncompleteCholesky,
    /// Symmetric Gauss–Seidel: it never breaks down, and converges on some nearly degenerate meshes on which the other stalls.
    GaussSeidel,
}

/// `(D + L) D⁻¹ (D + L)ᵀ` for each of a few pieces of consecutive rows, couplings between the pieces left out.
///
/// The blocks are stored in single precision, half the memory to be read in each iteration; vectors stay in double precision.
/// How the rows are cut depends on their number alone.
#[derive(Debug, Clone)]
pub struct BlockPreconditioner<const B: usize> {
    piece_rows: usize,
    offsets: Vec<usize>,
    columns: Vec<u32>,
    lower: Vec<[[f32; B]; B]>,
    inverse_diagonal: Vec<[[f32; B]; B]>,
}

/// One piece while it is factorised.
struct Piece<const B: usize> {
    offsets: Vec<usize>,
    columns: Vec<u32>,
    lower: Vec<Block<B>>,
    inverse_diagonal: Vec<Block<B>>,
}

impl<const B: usize> BlockPreconditioner<B> {
    /// Factorises a symmetric matrix that has all of its diagonal blocks.
    ///
    /// # Errors
    /// [`LinearError::Diagonal`] for a diagonal block that is missing or not positive definite.
    pub fn new(matrix: &SparseMatrix<B>, factorization: Factorization) -> Result<Self, LinearError> {
        let rows = matrix.rows();
        let piece_rows = rows.div_ceil(PIECES).max(PIECE_ROWS);
        let pieces = parallel::map_chunks(rows, piece_rows, |range| Piece::new(matrix, range, factorization));
        let mut result = Self {
            piece_rows,
            offsets: Vec::with_capacity(rows + 1),
            columns: Vec::new(),
            lower: Vec::new(),
            inverse_diagonal: Vec::with_capacity(rows),
        };
        result.offsets.push(0);
        let single = |block: &Block<B>| {
            #[expect(clippy::cast_possible_truncation, reason = "single precision is what is wanted")]
            block.map(|row| row.map(|entry| entry as f32))
        };
        for piece in pieces {
            let piece = piece?;
            let base = result.columns.len();
            result.offsets.extend(piece.offsets[1..].iter().map(|offset| base + offset));
            result.columns.extend_from_slice(&piece.columns);
            result.lower.extend(piece.lower.iter().map(single));
            result.inverse_diagonal.extend(piece.inverse_diagonal.iter().map(single));
        }
        Ok(result)
    }

    /// `result = M⁻¹ vector`.
    ///
    /// # Panics
    /// Where either has another number of rows than the matrix.
    pub fn apply(&self, vector: &[[f64; B]], result: &mut [[f64; B]]) {
        let rows = self.inverse_diagonal.len();
        assert!(vector.len() == rows && result.len() == rows, "one value for each row");
        parallel::for_each_chunk(result, self.piece_rows, |piece, part| {
            let first = piece * self.piece_rows;
            self.apply_piece(first, &vector[first..first + part.len()], part);
        });
    }

    fn apply_piece(&self, first: usize, vector: &[[f64; B]], result: &mut [[f64; B]]) {
        let row = |index: usize| {
            let range = self.offsets[first + index]..self.offsets[first + index + 1];
            self.columns[range.clone()].iter().zip(&self.lower[range])
        };
        for index in 0..result.len() {
            let mut sum = vector[index];
            for (&column, block) in row(index) {
                let value = result[column as usize - first];
                for (total, entries) in sum.iter_mut().zip(block) {
                    for (&entry, value) in entries.iter().zip(value) {
                        *total -= f64::from(entry) * value;
                    }
                }
            }
            result[index] = multiply(&self.inverse_diagonal[first + index], sum);
        }
        let mut above = vec![[0.0; B]; result.len()];
        for index in (0..result.len()).rev() {
            let correction = multiply(&self.inverse_diagonal[first + index], above[index]);
            let value: [f64; B] = std::array::from_fn(|axis| result[index][axis] - correction[axis]);
            result[index] = value;
            for (&column, block) in row(index) {
                let total = &mut above[column as usize - first];
                for (entries, value) in block.iter().zip(value) {
                    for (total, &entry) in total.iter_mut().zip(entries) {
                        *total += f64::from(entry) * value;
                    }
                }
            }
        }
    }
}

#[inline(always)]
fn multiply<const B: usize>(block: &[[f32; B]; B], vector: [f64; B]) -> [f64; B] {
    std::array::from_fn(|i| (0..B).map(|j| f64::from(block[i][j]) * vector[j]).sum())
}

/// `a -= b cᵀ`.
#[inline(always)]
fn subtract_product<const B: usize>(a: &mut Block<B>, b: &Block<B>, c: &Block<B>) {
    for i in 0..B {
        for j in 0..B {
            a[i][j] -= (0..B).map(|k| b[i][k] * c[j][k]).sum::<f64>();
        }
    }
}

impl<const B: usize> Piece<B> {
    fn new(
        matrix: &SparseMatrix<B>,
        rows: std::ops::Range<usize>,
        factorization: Factorization,
    ) -> Result<Self, LinearError> {
        let first = rows.start;
        let mut piece = Self { offsets: vec![0], columns: Vec::new(), lower: Vec::new(), inverse_diagonal: Vec::new() };
        let mut diagonal = Vec::with_capacity(rows.len());
        for row in rows {
            let (columns, blocks) = matrix.row(row);
            let place = columns.binary_search_by_key(&row, |&column| column as usize);
            let place = place.map_err(|_| LinearError::Diagonal { row })?;
            let start = columns.partition_point(|&column| (column as usize) < first);
            piece.columns.extend_from_slice(&columns[start..place]);
            piece.lower.extend_from_slice(&blocks[start..place]);
            piece.offsets.push(piece.columns.len());
            piece.inverse_diagonal.push(invert_positive(&blocks[place]).ok_or(LinearError::Diagonal { row })?);
            diagonal.push(blocks[place]);
        }
        if factorization == Factorization::IncompleteCholesky {
            for shift in [0.0, 1e-3, 1e-2, 1e-1] {
                if let Some((lower, inverse_diagonal)) = piece.incomplete_cholesky(first, &diagonal, shift) {
                    (piece.lower, piece.inverse_diagonal) = (lower, inverse_diagonal);
                    break;
                }
            }
            // If every shift broke down, the matrix's own blocks are left: Gauss–Seidel.
        }
        Ok(piece)
    }

    /// `None` where a pivot is not positive.
    fn incomplete_cholesky(
        &self,
        first: usize,
        diagonal: &[Block<B>],
        shift: f64,
    ) -> Option<(Vec<Block<B>>, Vec<Block<B>>)> {
        let mut lower = self.lower.clone();
        let mut inverse_diagonal: Vec<Block<B>> = Vec::with_capacity(diagonal.len());
        // Where in the present row a column's block lies, and that block times the inverse of the column's diagonal.
        let mut place = vec![u32::MAX; diagonal.len()];
        let mut scaled: Vec<Block<B>> = Vec::new();
        for (row, &block) in diagonal.iter().enumerate() {
            let range = self.offsets[row]..self.offsets[row + 1];
            let columns = &self.columns[range.clone()];
            let mut pivot = block;
            for (axis, entries) in pivot.iter_mut().enumerate() {
                entries[axis] *= 1.0 + shift;
            }
            scaled.clear();
            for (index, &column) in columns.iter().enumerate() {
                let column = column as usize - first;
                let mut value = lower[range.start + index];
                let other = self.offsets[column]..self.offsets[column + 1];
                for (&shared, block) in self.columns[other.clone()].iter().zip(&lower[other]) {
                    if let Some(found) = scaled.get(place[shared as usize - first] as usize) {
                        subtract_product(&mut value, found, block);
                    }
                }
                lower[range.start + index] = value;
                let inverse = &inverse_diagonal[column];
                scaled.push(std::array::from_fn(|i| {
                    std::array::from_fn(|j| (0..B).map(|k| value[i][k] * inverse[k][j]).sum())
                }));
                #[expect(clippy::cast_possible_truncation, reason = "a row has few blocks")]
                (place[column] = index as u32);
                subtract_product(&mut pivot, &scaled[index], &value);
            }
            for &column in columns {
                place[column as usize - first] = u32::MAX;
            }
            inverse_diagonal.push(invert_positive(&pivot)?);
        }
        Some((lower, inverse_diagonal))
    }
}
