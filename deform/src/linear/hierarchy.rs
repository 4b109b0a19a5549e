//! The levels of a multigrid method, and one cycle through them.

use std::sync::Arc;

use super::ROW_CHUNK;
use super::SparseMatrix;
use super::aggregation::{Aggregates, Bodies, couplings};
use super::cholesky::Factor;
use super::gauss_seidel::{GaussSeidel, Pieces};
use super::real::Real;
use super::transfer::{Interpolation, Transfer, galerkin};
use crate::mesh::Vector;
use crate::parallel;

/// Systems of at most this many equations are solved directly.
const COARSEST: usize = 1000;

/// Couplings weaker than this are left out where aggregates are formed; half of it on each coarser level.
const THRESHOLD: f64 = 0.08;

/// How far interpolation is smoothed.
const DAMPING: f64 = 2.0 / 3.0;

/// A system of `B` by `B` blocks and ever coarser ones of `C` by `C`, by smoothed aggregation. `C` is `B`, or 6 where aggregates
/// turn as rigid bodies.
#[derive(Debug)]
pub(super) struct Hierarchy<T, const B: usize, const C: usize> {
    finest: Option<Level<T, B>>,
    coarser: Vec<Level<T, C>>,
    coarsest: Coarsest<B, C>,
}

/// The smallest system of all.
#[derive(Debug)]
enum Coarsest<const B: usize, const C: usize> {
    /// The one to be solved is small.
    Finest(Factor<B>, usize),
    Coarse(Factor<C>, usize),
}

#[derive(Debug)]
struct Level<T, const B: usize> {
    aggregates: Arc<Aggregates>,
    pieces: Pieces,
    smoother: GaussSeidel<T, B>,
    interpolation: Transfer<T>,
    restriction: Transfer<T>,
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
pub(super) struct Workspace<T, const B: usize, const C: usize, const K: usize> {
    finest: Vectors<T, B, K>,
    coarser: Vec<Vectors<T, C, K>>,
}

/// Where rows lie, and the size that a turn of theirs is told by (0 where they do not turn).
type Places = (Vec<Vector>, f64);

impl<T: Real, const B: usize, const C: usize> Hierarchy<T, B, C> {
    /// `None` where a diagonal block of any level is not positive definite. `like` is a hierarchy of a matrix with the same
    /// pattern, whose aggregates are used again. `places` are those of the rows where aggregates are to turn.
    pub(super) fn new(matrix: &SparseMatrix<B>, like: Option<&Self>, places: Option<&[Vector]>) -> Option<Self> {
        if B * matrix.rows() <= COARSEST {
            let coarsest = Coarsest::Finest(Factor::new(matrix)?, matrix.rows());
            return Some(Self { finest: None, coarser: Vec::new(), coarsest });
        }
        let mut places = places.map(|places| (places.to_vec(), 0.0));
        let known = like.and_then(|like| like.finest.as_ref()).map(|level| Arc::clone(&level.aggregates));
        let (finest, mut current, mut pieces) =
            coarsened::<T, B, C>(matrix, Pieces::new(matrix), known, THRESHOLD, &mut places)?;
        let mut coarser: Vec<Level<T, C>> = Vec::new();
        let mut threshold = THRESHOLD;
        while C * current.rows() > COARSEST {
            threshold *= 0.5;
            let known = like.and_then(|like| like.coarser.get(coarser.len()));
            let known = known.map(|level| Arc::clone(&level.aggregates));
            let (level, next, next_pieces) = coarsened::<T, C, C>(&current, pieces, known, threshold, &mut places)?;
            coarser.push(level);
            (current, pieces) = (next, next_pieces);
        }
        let coarsest = Coarsest::Coarse(Factor::new(&current)?, current.rows());
        Some(Self { finest: Some(finest), coarser, coarsest })
    }

    pub(super) fn workspace<const K: usize>(&self) -> Workspace<T, B, C, K> {
        let coarsest = match self.coarsest {
            Coarsest::Finest(_, rows) => return Workspace { finest: Vectors::new(rows), coarser: Vec::new() },
            Coarsest::Coarse(_, rows) => rows,
        };
        let rows = self.coarser.iter().map(|level| level.pieces.rows()).chain([coarsest]);
        let finest = self.finest.as_ref().map_or(0, |level| level.pieces.rows());
        Workspace { finest: Vectors::new(finest), coarser: rows.map(Vectors::new).collect() }
    }

    /// One V-cycle: `result` becomes an approximate inverse of the matrix times `vector`, a symmetric positive definite one.
    /// `scale` brings each column of the vector to the order of 1.
    pub(super) fn apply<const K: usize>(
        &self,
        workspace: &mut Workspace<T, B, C, K>,
        scale: [f64; K],
        vector: &[[[f64; B]; K]],
        result: &mut [[[f64; B]; K]],
    ) {
        let Workspace { finest, coarser } = workspace;
        let pieces = self.finest.as_ref().map_or_else(|| Pieces::whole(vector.len()), |level| level.pieces);
        pieces.for_each_run(|rows, slots| {
            parallel::for_each_chunk(&mut finest.right_side[slots], ROW_CHUNK, |chunk, part| {
                for (value, wide) in part.iter_mut().zip(&vector[rows.start + chunk * ROW_CHUNK..rows.end]) {
                    *value = std::array::from_fn(|column| wide[column].map(|entry| T::of(scale[column] * entry)));
                }
            });
        });
        match (&self.finest, &self.coarsest, coarser.first_mut()) {
            (Some(level), _, Some(next)) => {
                level.down(finest, next);
                self.cycle(&self.coarser, coarser);
                if let Some(next) = coarser.first() {
                    level.up(finest, next);
                }
            }
            (_, Coarsest::Finest(factor, _), _) => solve(factor, finest),
            _ => {}
        }
        let scale = scale.map(|scale| 1.0 / scale);
        pieces.for_each_run(|rows, slots| {
            parallel::for_each_chunk(&mut result[rows], ROW_CHUNK, |chunk, part| {
                for (wide, value) in part.iter_mut().zip(&finest.solution[slots.start + chunk * ROW_CHUNK..slots.end]) {
                    *wide = std::array::from_fn(|column| value[column].map(|entry| scale[column] * entry.wide()));
                }
            });
        });
    }

    fn cycle<const K: usize>(&self, levels: &[Level<T, C>], vectors: &mut [Vectors<T, C, K>]) {
        let Some((own, coarser)) = vectors.split_first_mut() else { return };
        let Some((level, coarser_levels)) = levels.split_first() else {
            if let Coarsest::Coarse(factor, _) = &self.coarsest {
                solve(factor, own);
            }
            return;
        };
        let Some(next) = coarser.first_mut() else { return };
        level.down(own, next);
        self.cycle(coarser_levels, coarser);
        if let Some(next) = coarser.first() {
            level.up(own, next);
        }
    }
}

fn solve<T: Real, const B: usize, const K: usize>(factor: &Factor<B>, vectors: &mut Vectors<T, B, K>) {
    let wide: Vec<[[f64; B]; K]> =
        vectors.right_side.iter().map(|value| value.map(|column| column.map(T::wide))).collect();
    let mut solution = wide.clone();
    factor.solve(&wide, &mut solution);
    for (value, wide) in vectors.solution.iter_mut().zip(&solution) {
        *value = wide.map(|column| column.map(T::of));
    }
}

/// The level of a matrix, the next coarser matrix, and the pieces of its rows. `places` becomes that of the coarser rows.
fn coarsened<T: Real, const B: usize, const C: usize>(
    matrix: &SparseMatrix<B>,
    pieces: Pieces,
    known: Option<Arc<Aggregates>>,
    threshold: f64,
    places: &mut Option<Places>,
) -> Option<(Level<T, B>, SparseMatrix<C>, Pieces)> {
    let couplings = couplings(matrix);
    let aggregates = known.unwrap_or_else(|| Arc::new(Aggregates::new(matrix, &couplings, threshold)));
    let bodies = places.take().map(|(places, size)| Bodies::new(&aggregates, places, size));
    let interpolation = aggregates.interpolation(matrix, &couplings, DAMPING, bodies.as_ref());
    let (starts, entries) = interpolation.transposed(aggregates.count());
    let sizes = bodies.as_ref().map_or(&[][..], Bodies::sizes);
    let next = galerkin::<B, C>(matrix, &interpolation, (&starts, &entries), sizes);
    *places = bodies.map(Bodies::into_coarse);
    let next_pieces = if C * next.rows() <= COARSEST { Pieces::whole(next.rows()) } else { Pieces::new(&next) };
    let level = Level::new(matrix, &interpolation, (&starts, &entries), pieces, next_pieces, aggregates)?;
    Some((level, next, next_pieces))
}

impl<T: Real, const B: usize> Level<T, B> {
    fn new(
        matrix: &SparseMatrix<B>,
        interpolation: &Interpolation,
        transposed: (&[usize], &[(u32, u32)]),
        pieces: Pieces,
        coarse: Pieces,
        aggregates: Arc<Aggregates>,
    ) -> Option<Self> {
        Some(Self {
            aggregates,
            pieces,
            smoother: GaussSeidel::new(matrix, pieces)?,
            interpolation: Transfer::interpolation(
                interpolation,
                |slot| pieces.row(slot),
                |column| coarse.slot(column),
            ),
            restriction: Transfer::restriction(
                interpolation,
                transposed,
                |slot| coarse.row(slot),
                |row| pieces.slot(row),
            ),
        })
    }

    /// A sweep, and what it leaves to the coarser level.
    fn down<const C: usize, const K: usize>(&self, own: &mut Vectors<T, B, K>, next: &mut Vectors<T, C, K>) {
        self.smoother.forward(&own.right_side, &mut own.solution);
        self.smoother.residual(&own.solution, &mut own.residual);
        parallel::for_each_chunk(&mut next.right_side, ROW_CHUNK / 8, |chunk, part| {
            for (index, value) in part.iter_mut().enumerate() {
                *value = [[T::default(); C]; K];
                self.restriction.restrict(chunk * (ROW_CHUNK / 8) + index, &own.residual, value);
            }
        });
    }

    /// What the coarser level has found, and a sweep back.
    fn up<const C: usize, const K: usize>(&self, own: &mut Vectors<T, B, K>, next: &Vectors<T, C, K>) {
        parallel::for_each_chunk(&mut own.solution, ROW_CHUNK, |chunk, part| {
            for (index, value) in part.iter_mut().enumerate() {
                self.interpolation.interpolate(chunk * ROW_CHUNK + index, &next.solution, value);
            }
        });
        self.smoother.backward(&own.right_side, &mut own.solution);
    }
}
