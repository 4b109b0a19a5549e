//! Incomplete factorisations as preconditioners.

use super::matrix::{Block, invert_positive};
use super::{LinearError, SparseMatrix};
use crate::number::index;
use crate::parallel;
use crate::topology::Groups;

/// Rows are cut into at most this many pieces. Half of it bounds the threads that one application
/// can use.
const PIECES: usize = 8;

/// A piece has at least this many rows.
const PIECE_ROWS: usize = 512;

/// Which factorisation a [`BlockPreconditioner`] is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Factorization {
    /// Incomplete Cholesky without fill-in. Where it breaks down, the diagonal is raised
    /// (Manteuffel 1980) until it does not.
    IncompleteCholesky,
    /// Symmetric Gauss–Seidel: it never breaks down, and converges on some nearly degenerate meshes
    /// on which the other stalls.
    GaussSeidel,
}

/// `(D + L) D⁻¹ (D + L)ᵀ`, with `L` in the pattern of the matrix's lower triangle.
///
/// Rows are cut into pieces of consecutive rows. Those with even numbers come first in the order of
/// elimination and do not couple with each other, nor do the odd ones, so that either half is
/// worked on in parallel. Nothing is left out where a piece is at least as long as the matrix is
/// wide about its diagonal, which decides how many pieces there are; so number the unknowns well
/// ([`reverse_cuthill_mckee`](super::reverse_cuthill_mckee)).
///
/// The blocks are stored in single precision, half the memory to be read in each iteration; vectors
/// stay in double precision.
#[derive(Debug, Clone)]
pub struct BlockPreconditioner<const B: usize> {
    piece_rows: usize,
    lower: Rows<B>,
    /// For the rows of even pieces, the blocks of `lower` in their column that lie in odd pieces,
    /// not transposed.
    below: Rows<B>,
    inverse_diagonal: Vec<SingleBlock<B>>,
}

type SingleBlock<const B: usize> = [[f32; B]; B];

/// Blocks in compressed rows.
#[derive(Debug, Clone)]
struct Rows<const B: usize> {
    offsets: Vec<usize>,
    columns: Vec<u32>,
    blocks: Vec<SingleBlock<B>>,
}

impl<const B: usize> Rows<B> {
    #[inline]
    fn row(&self, row: usize) -> impl Iterator<Item = (usize, &SingleBlock<B>)> {
        let range = self.offsets[row]..self.offsets[row + 1];
        self.columns[range.clone()].iter().map(|&column| column as usize).zip(&self.blocks[range])
    }
}

/// One piece while it is factorised.
struct PieceFactor<const B: usize> {
    first: usize,
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
    pub fn new(
        matrix: &SparseMatrix<B>,
        factorization: Factorization,
    ) -> Result<Self, LinearError> {
        let rows = matrix.rows();
        let width = (0..rows)
            .filter_map(|row| Some(row.saturating_sub(*matrix.row(row).0.first()? as usize)))
            .max();
        let piece_rows = rows.div_ceil(PIECES).max(PIECE_ROWS).max(width.unwrap_or(0));
        let pieces = rows.div_ceil(piece_rows);
        let range = |piece: usize| piece * piece_rows..((piece + 1) * piece_rows).min(rows);
        let even = parallel::map_chunks(pieces.div_ceil(2), 1, |index| {
            PieceFactor::new(matrix, range(2 * index.start), [None, None], factorization)
        });
        let even = even.into_iter().collect::<Result<Vec<_>, _>>()?;
        let odd = parallel::map_chunks(pieces / 2, 1, |index| {
            let neighbours = [even.get(index.start), even.get(index.start + 1)];
            PieceFactor::new(matrix, range(2 * index.start + 1), neighbours, factorization)
        });
        let odd = odd.into_iter().collect::<Result<Vec<_>, _>>()?;

        let mut lower = Rows { offsets: vec![0], columns: Vec::new(), blocks: Vec::new() };
        let mut inverse_diagonal = Vec::with_capacity(rows);
        for piece in 0..pieces {
            let piece = if piece % 2 == 0 { &even[piece / 2] } else { &odd[piece / 2] };
            let base = lower.columns.len();
            lower.offsets.extend(piece.offsets[1..].iter().map(|offset| base + offset));
            lower.columns.extend_from_slice(&piece.columns);
            lower.blocks.extend(piece.lower.iter().map(single));
            inverse_diagonal.extend(piece.inverse_diagonal.iter().map(single));
        }
        let below = below(&lower, piece_rows);
        Ok(Self { piece_rows, lower, below, inverse_diagonal })
    }

    /// `result = M⁻¹ vector`.
    ///
    /// # Panics
    /// Where either has another number of rows than the matrix.
    pub fn apply(&self, vector: &[[f64; B]], result: &mut [[f64; B]]) {
        let rows = self.inverse_diagonal.len();
        assert!(vector.len() == rows && result.len() == rows, "one value for each row");
        let (mut even, mut odd) = (Vec::new(), Vec::new());
        for (index, part) in result.chunks_mut(self.piece_rows).enumerate() {
            if index % 2 == 0 { even.push(part) } else { odd.push(part) }
        }
        parallel::for_each_chunk(&mut even, 1, |index, part| {
            self.forward(2 * index * self.piece_rows, vector, part[0], [&[], &[]]);
        });
        parallel::for_each_chunk(&mut odd, 1, |index, part| {
            let after: &[[f64; B]] = even.get(index + 1).map_or(&[], |slice| slice);
            let first = (2 * index + 1) * self.piece_rows;
            self.forward(first, vector, part[0], [&*even[index], after]);
            self.backward(first, part[0], vec![[0.0; B]; part[0].len()]);
        });
        parallel::for_each_chunk(&mut even, 1, |index, part| {
            let first = 2 * index * self.piece_rows;
            let end = first + part[0].len();
            let before: &[[f64; B]] =
                index.checked_sub(1).and_then(|before| odd.get(before)).map_or(&[], |slice| slice);
            let after: &[[f64; B]] = odd.get(index).map_or(&[], |slice| slice);
            let above = (first..end)
                .map(|row| {
                    let mut total = [0.0; B];
                    for (other, block) in self.below.row(row) {
                        let value = if other < first {
                            before[other + self.piece_rows - first]
                        } else {
                            after[other - end]
                        };
                        add_transposed(&mut total, block, value);
                    }
                    total
                })
                .collect();
            self.backward(first, part[0], above);
        });
    }

    /// Solves `(D + L) w = vector` for the rows of a piece that starts at row `first`; `before` and
    /// `after` hold `w` for the pieces on either side.
    fn forward(
        &self,
        first: usize,
        vector: &[[f64; B]],
        result: &mut [[f64; B]],
        [before, after]: [&[[f64; B]]; 2],
    ) {
        let end = first + result.len();
        for row in first..end {
            let mut sum = vector[row];
            for (column, block) in self.lower.row(row) {
                let value = if column >= end {
                    &after[column - end]
                } else if column >= first {
                    &result[column - first]
                } else {
                    &before[column + self.piece_rows - first]
                };
                for (total, entries) in sum.iter_mut().zip(block) {
                    for (&entry, value) in entries.iter().zip(value) {
                        *total -= f64::from(entry) * value;
                    }
                }
            }
            result[row - first] = multiply(&self.inverse_diagonal[row], sum);
        }
    }

    /// Solves `(I + D⁻¹ Lᵀ) z = w` for the rows of a piece that starts at row `first`, `w` and then
    /// `z` being `result`. `above` holds what the rows of other pieces add to `Lᵀ z`.
    fn backward(&self, first: usize, result: &mut [[f64; B]], mut above: Vec<[f64; B]>) {
        let end = first + result.len();
        for row in (first..end).rev() {
            let correction = multiply(&self.inverse_diagonal[row], above[row - first]);
            let value: [f64; B] =
                std::array::from_fn(|axis| result[row - first][axis] - correction[axis]);
            result[row - first] = value;
            for (column, block) in self.lower.row(row) {
                if (first..end).contains(&column) {
                    add_transposed(&mut above[column - first], block, value);
                }
            }
        }
    }
}

/// The blocks of rows in odd pieces and columns in even ones, in the order of their columns.
fn below<const B: usize>(lower: &Rows<B>, piece_rows: usize) -> Rows<B> {
    let rows = lower.offsets.len() - 1;
    let across = (0..rows).filter(|row| row / piece_rows % 2 == 1).flat_map(|row| {
        let columns =
            (lower.offsets[row]..lower.offsets[row + 1]).map(|entry| (lower.columns[entry], entry));
        let across =
            columns.filter(move |(column, _)| *column as usize / piece_rows != row / piece_rows);
        across.map(move |(column, entry)| (column, (index(row), entry)))
    });
    let Groups { offsets, items } = Groups::new(rows, across);
    let (columns, entries): (Vec<u32>, Vec<usize>) = items.into_iter().unzip();
    Rows {
        offsets,
        columns,
        blocks: entries.into_iter().map(|entry| lower.blocks[entry]).collect(),
    }
}

fn single<const B: usize>(block: &Block<B>) -> SingleBlock<B> {
    block.map(|row| row.map(|entry| entry as f32))
}

/// `sum += blockᵀ vector`.
#[inline(always)]
fn add_transposed<const B: usize>(sum: &mut [f64; B], block: &SingleBlock<B>, vector: [f64; B]) {
    for (entries, value) in block.iter().zip(vector) {
        for (total, &entry) in sum.iter_mut().zip(entries) {
            *total += f64::from(entry) * value;
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

impl<const B: usize> PieceFactor<B> {
    /// `neighbours` are the pieces before and after, where those are eliminated before this one.
    fn new(
        matrix: &SparseMatrix<B>,
        rows: std::ops::Range<usize>,
        neighbours: [Option<&Self>; 2],
        factorization: Factorization,
    ) -> Result<Self, LinearError> {
        let mut piece = Self {
            first: rows.start,
            offsets: vec![0],
            columns: Vec::new(),
            lower: Vec::new(),
            inverse_diagonal: Vec::new(),
        };
        let mut diagonal = Vec::with_capacity(rows.len());
        for row in rows.clone() {
            let (columns, blocks) = matrix.row(row);
            let on_diagonal = columns.binary_search_by_key(&row, |&column| column as usize);
            let on_diagonal = on_diagonal.map_err(|_| LinearError::Diagonal { row })?;
            // In the order of elimination: the pieces beside this one, then this one.
            let own = columns.partition_point(|&column| (column as usize) < rows.start);
            let after = columns.partition_point(|&column| (column as usize) < rows.end);
            let before = neighbours[0].map_or(own, |other| {
                columns.partition_point(|&column| (column as usize) < other.first)
            });
            let last = neighbours[1].map_or(after, |other| {
                columns.partition_point(|&column| (column as usize) < other.first + other.rows())
            });
            for range in [before..own, after..last, own..on_diagonal] {
                piece.columns.extend_from_slice(&columns[range.clone()]);
                piece.lower.extend_from_slice(&blocks[range]);
            }
            piece.offsets.push(piece.columns.len());
            piece
                .inverse_diagonal
                .push(invert_positive(&blocks[on_diagonal]).ok_or(LinearError::Diagonal { row })?);
            diagonal.push(blocks[on_diagonal]);
        }
        if factorization == Factorization::IncompleteCholesky {
            for shift in [0.0, 1e-3, 1e-2, 1e-1] {
                if let Some((lower, inverse_diagonal)) =
                    piece.incomplete_cholesky(&diagonal, neighbours, shift)
                {
                    (piece.lower, piece.inverse_diagonal) = (lower, inverse_diagonal);
                    break;
                }
            }
            // If every shift broke down, the matrix's own blocks are left: Gauss–Seidel.
        }
        Ok(piece)
    }

    fn rows(&self) -> usize {
        self.offsets.len() - 1
    }

    /// `None` where a pivot is not positive.
    fn incomplete_cholesky(
        &self,
        diagonal: &[Block<B>],
        [before, after]: [Option<&Self>; 2],
        shift: f64,
    ) -> Option<(Vec<Block<B>>, Vec<Block<B>>)> {
        let end = self.first + self.rows();
        let base = before.map_or(self.first, |other| other.first);
        let mut lower = self.lower.clone();
        let mut inverse_diagonal: Vec<Block<B>> = Vec::with_capacity(diagonal.len());
        // Where in the present row a column's block lies, and that block times the inverse of the
        // column's diagonal.
        let mut entry_of = vec![u32::MAX; end - base + after.map_or(0, Self::rows)];
        let mut scaled: Vec<Block<B>> = Vec::new();
        for (row, &block) in diagonal.iter().enumerate() {
            let start = self.offsets[row];
            let columns = &self.columns[start..self.offsets[row + 1]];
            let mut pivot = block;
            for (axis, entries) in pivot.iter_mut().enumerate() {
                entries[axis] *= 1.0 + shift;
            }
            scaled.clear();
            for (entry, &column) in columns.iter().enumerate() {
                let global = column as usize;
                let owner = if global < self.first {
                    before
                } else if global >= end {
                    after
                } else {
                    Some(self)
                };
                let owner = owner?;
                let local = global - owner.first;
                let range = owner.offsets[local]..owner.offsets[local + 1];
                let own = (self.first..end).contains(&global);
                let (blocks, inverse) = if own {
                    (&lower[range.clone()], &inverse_diagonal[local])
                } else {
                    (&owner.lower[range.clone()], &owner.inverse_diagonal[local])
                };
                let mut value = lower[start + entry];
                for (&shared, block) in owner.columns[range].iter().zip(blocks) {
                    if let Some(found) =
                        entry_of.get(shared as usize - base).and_then(|&at| scaled.get(at as usize))
                    {
                        subtract_product(&mut value, found, block);
                    }
                }
                scaled.push(std::array::from_fn(|i| {
                    std::array::from_fn(|j| (0..B).map(|k| value[i][k] * inverse[k][j]).sum())
                }));
                lower[start + entry] = value;
                entry_of[global - base] = index(entry);
                subtract_product(&mut pivot, &scaled[entry], &value);
            }
            for &column in columns {
                entry_of[column as usize - base] = u32::MAX;
            }
            inverse_diagonal.push(invert_positive(&pivot)?);
        }
        Some((lower, inverse_diagonal))
    }
}
