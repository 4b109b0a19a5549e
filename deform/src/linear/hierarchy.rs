//! The levels of a multigrid method, and one cycle through them.

use super::ROW_CHUNK;
use super::SparseMatrix;
use super::aggregation::{Aggregates, galerkin, transpose};
use super::cholesky::Factor;
use super::gauss_seidel::{GaussSeidel, Pieces};
use super::real::Real;
use super::rows::Rows;
use crate::parallel;

/// Systems of at most this many equations are solved directly.
const COARSEST: usize = 1000;

/// Couplings weaker than this are left out where aggregates are formed; half of it on each coarser level.
const THRESHOLD: f64 = 0.08;

/// How far interpolation is smoothed.
const DAMPING: f64 = 2.0 / 3.0;

/// A system and ever coarser ones, by smoothed aggregation.
#[derive(Debug)]
pub(super) struct Hierarchy<T, const B: usize> {
    levels: Vec<Level<T, B>>,
    coarsest: Factor<B>,
    coarsest_rows: usize,
}

#[derive(Debug)]
struct Level<T, const B: usize> {
    aggregates: Aggregates,
    pieces: Pieces,
    smoother: GaussSeidel<T, B>,
    prolongation: Rows<T, B>,
    restriction: Rows<T, B>,
}

/// The vectors of one level.
#[derive(Debug)]
struct Vectors<T, const B: usize, const K: usize> {
    right_side: Vec<[[T; B]; K]>,
    solution: Vec<[[T; B]; K]>,
    residual: Vec<[[T; B]; K]>,
}

impl<T: Real, const B: usize, const K: usize> Vectors<T, B, K> {
    fn new(rows: usize) -> Self {
        let zeros = || vec![[[T::default(); B]; K]; rows];
        Self { right_side: zeros(), solution: zeros(), residual: zeros() }
    }
}

/// The memory of cycles with `K` right sides.
#[derive(Debug)]
pub(super) struct Workspace<T, const B: usize, const K: usize>(Vec<Vectors<T, B, K>>);

impl<T: Real, const B: usize> Hierarchy<T, B> {
    /// `None` where a diagonal block of any level is not positive definite. `like` is a hierarchy of a matrix with the same
    /// pattern, whose aggregates are used again.
    pub(super) fn new(matrix: &SparseMatrix<B>, like: Option<&Self>) -> Option<Self> {
        let mut levels: Vec<Level<T, B>> = Vec::new();
        let mut coarse: Option<SparseMatrix<B>> = None;
        let mut pieces = Pieces::new(matrix);
        let mut threshold = THRESHOLD;
        loop {
            let current = coarse.as_ref().unwrap_or(matrix);
            if B * current.rows() <= COARSEST {
                let coarsest = Factor::new(current)?;
                return Some(Self { levels, coarsest, coarsest_rows: current.rows() });
            }
            let aggregates = match like.and_then(|like| like.levels.get(levels.len())) {
                Some(level) => level.aggregates.clone(),
                None => Aggregates::new(current, threshold),
            };
            let prolongation = aggregates.prolongation(current, DAMPING);
            let next = galerkin(current, &prolongation, aggregates.count());
            let next_pieces = if B * next.rows() <= COARSEST { Pieces::whole(next.rows()) } else { Pieces::new(&next) };
            levels.push(Level::new(current, &prolongation, pieces, next_pieces, aggregates)?);
            coarse = Some(next);
            pieces = next_pieces;
            threshold *= 0.5;
        }
    }

    pub(super) fn workspace<const K: usize>(&self) -> Workspace<T, B, K> {
        let rows = self.levels.iter().map(|level| level.pieces.rows()).chain([self.coarsest_rows]);
        Workspace(rows.map(Vectors::new).collect())
    }

    /// One V-cycle: `result` becomes an approximate inverse of the matrix times `vector`, a symmetric positive definite one.
    /// `scale` brings each column of the vector to the order of 1.
    pub(super) fn apply<const K: usize>(
        &self,
        Workspace(vectors): &mut Workspace<T, B, K>,
        scale: [f64; K],
        vector: &[[[f64; B]; K]],
        result: &mut [[[f64; B]; K]],
    ) {
        let pieces = self.levels.first().map_or_else(|| Pieces::whole(self.coarsest_rows), |level| level.pieces);
        let Some(finest) = vectors.first_mut() else { return };
        pieces.for_each_run(|rows, slots| {
            parallel::for_each_chunk(&mut finest.right_side[slots], ROW_CHUNK, |chunk, part| {
                for (value, wide) in part.iter_mut().zip(&vector[rows.start + chunk * ROW_CHUNK..rows.end]) {
                    *value = std::array::from_fn(|column| wide[column].map(|entry| T::of(scale[column] * entry)));
                }
            });
        });
        self.cycle(&self.levels, vectors);
        let Some(finest) = vectors.first() else { return };
        let scale = scale.map(|scale| 1.0 / scale);
        pieces.for_each_run(|rows, slots| {
            parallel::for_each_chunk(&mut result[rows], ROW_CHUNK, |chunk, part| {
                for (wide, value) in part.iter_mut().zip(&finest.solution[slots.start + chunk * ROW_CHUNK..slots.end]) {
                    *wide = std::array::from_fn(|column| value[column].map(|entry| scale[column] * entry.wide()));
                }
            });
        });
    }

    fn cycle<const K: usize>(&self, levels: &[Level<T, B>], vectors: &mut [Vectors<T, B, K>]) {
        let Some((own, coarser)) = vectors.split_first_mut() else { return };
        let Some((level, coarser_levels)) = levels.split_first() else {
            let wide: Vec<[[f64; B]; K]> =
                own.right_side.iter().map(|value| value.map(|column| column.map(T::wide))).collect();
            let mut solution = wide.clone();
            self.coarsest.solve(&wide, &mut solution);
            for (value, wide) in own.solution.iter_mut().zip(&solution) {
                *value = wide.map(|column| column.map(T::of));
            }
            return;
        };
        level.smoother.forward(&own.right_side, &mut own.solution);
        level.smoother.residual(&own.solution, &mut own.residual);
        let Some(next) = coarser.first_mut() else { return };
        parallel::for_each_chunk(&mut next.right_side, ROW_CHUNK / 8, |chunk, part| {
            for (index, value) in part.iter_mut().enumerate() {
                *value = [[T::default(); B]; K];
                level.restriction.add_product(chunk * (ROW_CHUNK / 8) + index, &own.residual, 0, value);
            }
        });
        self.cycle(coarser_levels, coarser);
        let Some(next) = coarser.first() else { return };
        parallel::for_each_chunk(&mut own.solution, ROW_CHUNK, |chunk, part| {
            for (index, value) in part.iter_mut().enumerate() {
                level.prolongation.add_product(chunk * ROW_CHUNK + index, &next.solution, 0, value);
            }
        });
        level.smoother.backward(&own.right_side, &mut own.solution);
    }
}

impl<T: Real, const B: usize> Level<T, B> {
    fn new(
        matrix: &SparseMatrix<B>,
        prolongation: &SparseMatrix<B>,
        pieces: Pieces,
        coarse: Pieces,
        aggregates: Aggregates,
    ) -> Option<Self> {
        let smoother = GaussSeidel::new(matrix, pieces)?;
        #[expect(clippy::cast_possible_truncation, reason = "rows are 32-bit")]
        let rows = Rows::new(matrix.rows(), |slot, push| {
            let (columns, blocks) = prolongation.row(pieces.row(slot));
            for (&column, block) in columns.iter().zip(blocks) {
                push(coarse.slot(column as usize) as u32, block);
            }
        });
        let (starts, entries) = transpose(prolongation, aggregates.count());
        #[expect(clippy::cast_possible_truncation, reason = "rows are 32-bit")]
        let restriction = Rows::new(aggregates.count(), |slot, push| {
            let row = coarse.row(slot);
            for &(fine, place) in &entries[starts[row]..starts[row + 1]] {
                let block = &prolongation.values()[place as usize];
                let transposed = std::array::from_fn(|i| std::array::from_fn(|j| block[j][i]));
                push(pieces.slot(fine as usize) as u32, &transposed);
            }
        });
        Some(Self { aggregates, pieces, smoother, prolongation: rows, restriction })
    }
}
