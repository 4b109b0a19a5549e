//! The levels of a multigrid method, and one cycle through them.

use std::borrow::Cow;
use std::sync::Arc;

use super::ROW_CHUNK;
use super::SparseMatrix;
use super::aggregation::{Across, Aggregates, Bodies, couplings};
use super::border::Border;
use super::cholesky::Factor;
use super::distribution::{Distribution, Order};
use super::gathered::Gathered;
use super::gauss_seidel::{GaussSeidel, Sweep};
use super::lower::Lower;
use super::null_space::NullSpace;
use super::pieces::Pieces;
use super::real::Real;
use super::transfer::{Transfer, galerkin};
use crate::communicator::{Communicator, Halo};
use crate::number::real;
use crate::parallel;
use crate::vector::Vector;

/// Systems of at most this many equations are solved directly.
const COARSEST: usize = 1000;

/// Where the ranks' own aggregates would not make a system smaller, because they have few rows
/// each, one of at most this many equations is gathered on all of them.
const LARGEST: usize = 100_000;

/// A coarser system of ranks is to have at most this part of the rows.
const COARSER: f64 = 0.5;

/// Couplings weaker than this are left out where aggregates are formed; half of it on each coarser
/// level.
const THRESHOLD: f64 = 0.08;

/// The shift of the diagonal of a semi-definite matrix, relative to it, that makes the matrix
/// positive definite.
const LIFT: f64 = 1e-8;

/// How far interpolation is smoothed.
const DAMPING: f64 = 2.0 / 3.0;

/// A system of `B` by `B` blocks and ever coarser ones of `C` by `C`, by smoothed aggregation. `C`
/// is `B`, or 6 where aggregates turn as rigid bodies.
///
/// The system may be distributed over ranks ([`Distribution`]): each rank then makes aggregates of
/// its own rows, and sweeps through these; couplings between ranks count in the interpolation, in
/// residuals and in coarser matrices as all others do.
#[derive(Debug)]
pub(super) struct Hierarchy<T, const B: usize, const C: usize> {
    /// The order of the rows, where they are parts of a sum.
    order: Option<Order>,
    finest: Option<Level<T, B>>,
    coarser: Vec<Level<T, C>>,
    coarsest: Coarsest<T, B, C>,
}

/// The smallest system of all.
#[derive(Debug)]
enum Coarsest<T, const B: usize, const C: usize> {
    /// The one to be solved is small.
    Finest(Direct<T, B>),
    Coarse(Direct<T, C>),
}

/// A small system that is solved as a whole.
#[derive(Debug)]
struct Direct<T, const B: usize> {
    rows: Gathered,
    inverse: Inverse<T, B>,
}

/// The inverse of a matrix, or a cycle in its place.
#[derive(Debug)]
enum Inverse<T, const B: usize> {
    Factor(Box<Factor>),
    /// A cycle: many ranks have many rows between them, however few each of them has.
    Cycle(Box<Hierarchy<T, B, B>>),
}

impl<T: Real, const B: usize> Direct<T, B> {
    /// `None` where there is no inverse. Collective over the ranks of a distribution.
    fn new(system: &System<'_, B>) -> Option<Self> {
        let System { matrix, distribution, null_space, .. } = system;
        let (rows, whole) = Gathered::new(matrix, distribution.as_ref(), *null_space);
        Some(Self { rows, inverse: Inverse::new(&whole, *null_space)? })
    }

    fn solve<const K: usize>(&self, vectors: &mut Vectors<T, B, K>) {
        let Vectors { right_side, solution, .. } = vectors;
        self.rows.solve(right_side, solution, |vector, result| self.inverse.apply(vector, result));
    }
}

impl<T: Real, const B: usize> Inverse<T, B> {
    fn new(matrix: &SparseMatrix<B>, null_space: NullSpace) -> Option<Self> {
        if B * matrix.rows() <= COARSEST {
            let matrix = match null_space {
                NullSpace::Zero => Cow::Borrowed(matrix),
                NullSpace::Constants => Cow::Owned(lifted(matrix)),
            };
            return Factor::of(&matrix).map(|factor| Self::Factor(Box::new(factor)));
        }
        Hierarchy::new(matrix, &Halo::none(), null_space, None, None)
            .map(|levels| Self::Cycle(Box::new(levels)))
    }

    fn apply<const K: usize>(&self, vector: &[[[f64; B]; K]], result: &mut [[[f64; B]; K]]) {
        match self {
            Self::Factor(factor) => factor.solve(vector, result),
            Self::Cycle(levels) => levels.apply(&mut levels.workspace(), [1.0; K], vector, result),
        }
    }
}

#[derive(Debug)]
struct Level<T, const B: usize> {
    aggregates: Arc<Aggregates>,
    pieces: Pieces,
    /// How many rows vectors have here; those of other ranks come after the pieces.
    rows: usize,
    smoother: GaussSeidel<T, B>,
    border: Option<Border<T, B>>,
    interpolation: Transfer<T>,
    restriction: Transfer<T>,
}

/// The vectors of one level.
#[derive(Debug)]
struct Vectors<T, const B: usize, const K: usize> {
    right_side: Vec<[[T; B]; K]>,
    solution: Vec<[[T; B]; K]>,
    residual: Vec<[[T; B]; K]>,
    /// What sweeps need beside them.
    beside: Vec<[[T; B]; K]>,
}

impl<T: Real, const B: usize, const K: usize> Vectors<T, B, K> {
    fn new(rows: usize, beside: usize) -> Self {
        let zeros = |rows| vec![[[T::default(); B]; K]; rows];
        Self {
            right_side: zeros(rows),
            solution: zeros(rows),
            residual: zeros(rows),
            beside: zeros(beside),
        }
    }

    /// The vectors of a sweep through the first `rows` rows.
    fn sweep(&mut self, rows: usize) -> Sweep<'_, T, B, K> {
        Sweep {
            right_side: &self.right_side[..rows],
            solution: &mut self.solution[..rows],
            residual: &mut self.residual[..rows],
            beside: &mut self.beside,
        }
    }
}

/// The memory of cycles with `K` right sides.
#[derive(Debug)]
pub(super) struct Workspace<T, const B: usize, const C: usize, const K: usize> {
    finest: Vectors<T, B, K>,
    coarser: Vec<Vectors<T, C, K>>,
}

/// Where rows lie, and the size that a turn of theirs is told by (0 where they do not turn).
type Positions = (Vec<Vector>, f64);

/// A system while its levels are made: the matrix, the pieces of its own rows, and who owns its
/// rows.
struct System<'a, const B: usize> {
    matrix: Cow<'a, SparseMatrix<B>>,
    distribution: Option<Distribution>,
    null_space: NullSpace,
    pieces: Pieces,
}

impl<'a, const B: usize> System<'a, B> {
    /// Collective over the ranks of a distribution, as all that is done with it.
    fn new(
        matrix: Cow<'a, SparseMatrix<B>>,
        distribution: Option<Distribution>,
        null_space: NullSpace,
        order: Option<&Order>,
    ) -> Self {
        let matrix = match &distribution {
            Some(distribution) => Cow::Owned(distribution.assembled(&matrix, order)),
            None => matrix,
        };
        let own = distribution.as_ref().map_or(matrix.rows(), Distribution::own);
        let pieces =
            if B * own <= COARSEST { Pieces::whole(own) } else { Pieces::new(&matrix, own) };
        Self { matrix, distribution, null_space, pieces }
    }

    /// The number of rows of all ranks.
    fn total(&self) -> usize {
        self.distribution
            .as_ref()
            .map_or(self.matrix.rows(), |rows| rows.communicator().total(rows.own()))
    }

    fn agreed<R>(&self, found: Option<R>) -> Option<R> {
        match &self.distribution {
            Some(distribution) => distribution.agreed(found),
            None => found,
        }
    }
}

impl<T: Real, const B: usize, const C: usize> Hierarchy<T, B, C> {
    /// `None` where a diagonal block of any level is not positive definite, or the ranks' rows
    /// cannot be aggregated. On several ranks the matrix is one of those that they have of a sum.
    /// `like` is a hierarchy of a matrix with the same pattern, whose aggregates are used again.
    /// `positions` are those of the rows where aggregates are to turn, which those of parts cannot.
    pub(super) fn new(
        matrix: &SparseMatrix<B>,
        halo: &Halo,
        null_space: NullSpace,
        like: Option<&Self>,
        positions: Option<&[Vector]>,
    ) -> Option<Self> {
        let several = (halo.communicator().size() > 1).then_some(halo);
        let (distribution, order) =
            several.map(|halo| Distribution::new(halo, matrix.rows())).unzip();
        let mut positions = positions.map(|positions| (positions.to_vec(), 0.0));
        let system = System::new(Cow::Borrowed(matrix), distribution, null_space, order.as_ref());
        let known =
            like.and_then(|like| like.finest.as_ref()).map(|level| Arc::clone(&level.aggregates));
        let (finest, mut current) =
            match coarsened::<T, B, C>(system, known, THRESHOLD, &mut positions)? {
                Step::Last(direct) => {
                    return Some(Self {
                        order,
                        finest: None,
                        coarser: Vec::new(),
                        coarsest: Coarsest::Finest(*direct),
                    });
                }
                Step::Level(found) => *found,
            };
        let mut coarser: Vec<Level<T, C>> = Vec::new();
        let mut threshold = THRESHOLD;
        loop {
            threshold *= 0.5;
            let known = like.and_then(|like| like.coarser.get(coarser.len()));
            let known = known.map(|level| Arc::clone(&level.aggregates));
            match coarsened::<T, C, C>(current, known, threshold, &mut positions)? {
                Step::Last(direct) => {
                    return Some(Self {
                        order,
                        finest: Some(finest),
                        coarser,
                        coarsest: Coarsest::Coarse(*direct),
                    });
                }
                Step::Level(found) => {
                    let (level, next) = *found;
                    coarser.push(level);
                    current = next;
                }
            }
        }
    }

    pub(super) fn workspace<const K: usize>(&self) -> Workspace<T, B, C, K> {
        let coarsest = match &self.coarsest {
            Coarsest::Finest(direct) => {
                return Workspace {
                    finest: Vectors::new(direct.rows.count(), 0),
                    coarser: Vec::new(),
                };
            }
            Coarsest::Coarse(direct) => Vectors::new(direct.rows.count(), 0),
        };
        let coarser = self.coarser.iter().map(Level::vectors).chain([coarsest]);
        Workspace {
            finest: self.finest.as_ref().map_or_else(|| Vectors::new(0, 0), Level::vectors),
            coarser: coarser.collect(),
        }
    }

    /// The lower half of the matrix of one process, where there is a level that has it.
    pub(super) fn lower(&self) -> Option<&Arc<Lower<T, B>>> {
        match (&self.finest, &self.order) {
            (Some(level), None) => Some(level.smoother.lower()),
            _ => None,
        }
    }

    /// One V-cycle: `result` becomes an approximate inverse of the matrix times `vector`, a
    /// symmetric positive definite one. `scale` brings each column of the vector to the order of 1.
    /// Of parts of a sum, all ranks have the same `vector` where they share rows, and get the same
    /// `result`; collective.
    pub(super) fn apply<const K: usize>(
        &self,
        workspace: &mut Workspace<T, B, C, K>,
        scale: [f64; K],
        vector: &[[[f64; B]; K]],
        result: &mut [[[f64; B]; K]],
    ) {
        let Workspace { finest, coarser } = workspace;
        let narrow = |wide: &[[f64; B]; K]| -> [[T; B]; K] {
            std::array::from_fn(|column| wide[column].map(|entry| T::of(scale[column] * entry)))
        };
        match &self.order {
            None => parallel::for_each_chunk(&mut finest.right_side, ROW_CHUNK, |chunk, part| {
                let vector = &vector[chunk * ROW_CHUNK..];
                part.iter_mut().zip(vector).for_each(|(value, wide)| *value = narrow(wide));
            }),
            Some(order) => {
                for (row, &old) in order.old.iter().enumerate() {
                    finest.right_side[row] = narrow(&vector[old as usize]);
                }
            }
        }
        match (&self.finest, &self.coarsest, coarser.first_mut()) {
            (Some(level), _, Some(next)) => {
                level.down(finest, next);
                self.cycle(&self.coarser, coarser);
                if let Some(next) = coarser.first() {
                    level.up(finest, next);
                }
            }
            (_, Coarsest::Finest(direct), _) => direct.solve(finest),
            _ => {}
        }
        let scale = scale.map(|scale| 1.0 / scale);
        let widen = |value: &[[T; B]; K]| -> [[f64; B]; K] {
            std::array::from_fn(|column| value[column].map(|entry| scale[column] * entry.wide()))
        };
        match &self.order {
            None => parallel::for_each_chunk(result, ROW_CHUNK, |chunk, part| {
                let found = &finest.solution[chunk * ROW_CHUNK..];
                part.iter_mut().zip(found).for_each(|(wide, value)| *wide = widen(value));
            }),
            Some(order) => {
                for (row, &old) in order.old.iter().enumerate() {
                    result[old as usize] = widen(&finest.solution[row]);
                }
            }
        }
    }

    fn cycle<const K: usize>(&self, levels: &[Level<T, C>], vectors: &mut [Vectors<T, C, K>]) {
        let Some((own, coarser)) = vectors.split_first_mut() else { return };
        let Some((level, coarser_levels)) = levels.split_first() else {
            if let Coarsest::Coarse(direct) = &self.coarsest {
                direct.rows.sum(&mut own.right_side);
                direct.solve(own);
            }
            return;
        };
        let Some(next) = coarser.first_mut() else { return };
        if let Some(border) = &level.border {
            border.sum(&mut own.right_side);
        }
        level.down(own, next);
        self.cycle(coarser_levels, coarser);
        if let Some(next) = coarser.first() {
            level.up(own, next);
        }
    }
}

/// A semi-definite matrix made definite.
fn lifted<const B: usize>(matrix: &SparseMatrix<B>) -> SparseMatrix<B> {
    let mut lifted = matrix.clone();
    let (offsets, columns, blocks) = lifted.offsets_and_values_mut();
    for row in 0..offsets.len() - 1 {
        let range = offsets[row]..offsets[row + 1];
        for (_, block) in columns[range.clone()]
            .iter()
            .zip(&mut blocks[range])
            .filter(|(c, _)| **c as usize == row)
        {
            (0..B).for_each(|axis| block[axis][axis] *= 1.0 + LIFT);
        }
    }
    lifted
}

/// The next step for a system.
enum Step<T, const B: usize, const C: usize> {
    /// It is small: the last one.
    Last(Box<Direct<T, B>>),
    /// A level, and the next coarser system.
    Level(Box<(Level<T, B>, System<'static, C>)>),
}

/// `positions` becomes that of the coarser rows. `None` where there is no inverse on the way.
fn coarsened<T: Real, const B: usize, const C: usize>(
    system: System<'_, B>,
    known: Option<Arc<Aggregates>>,
    threshold: f64,
    positions: &mut Option<Positions>,
) -> Option<Step<T, B, C>> {
    let System { matrix, distribution, null_space, pieces } = &system;
    let total = system.total();
    let last = || system.agreed(Direct::new(&system)).map(|direct| Step::Last(Box::new(direct)));
    if B * total <= COARSEST {
        return last();
    }
    let couplings = couplings(matrix);
    let (border, added) = distribution.as_ref().map(|rows| Border::new(rows, matrix)).unzip();
    let added = added.unwrap_or_default();
    let reaches =
        |row: usize| added.get(row).is_some_and(|added| added.iter().any(|&value| value != 0.0));
    let aggregates = known.unwrap_or_else(|| {
        Arc::new(Aggregates::new(matrix, &couplings, threshold, pieces.rows(), reaches))
    });
    if let Some(rows) = distribution
        && real(rows.communicator().total(aggregates.count())) > COARSER * real(total)
    {
        return if B * total <= LARGEST { last() } else { None };
    }
    let bodies =
        positions.take().map(|(positions, size)| Bodies::new(&aggregates, positions, size));
    let (interpolation, coarse) = match distribution {
        Some(rows) => {
            let (interpolation, coarse) =
                rows.interpolation(matrix, &couplings, &aggregates, DAMPING);
            (interpolation, Some(coarse))
        }
        None => {
            let none = Across::default();
            (aggregates.interpolation(matrix, &couplings, DAMPING, bodies.as_ref(), &none), None)
        }
    };
    let transposed =
        interpolation.transposed(coarse.as_ref().map_or(aggregates.count(), Distribution::rows));
    let sizes = bodies.as_ref().map_or(&[][..], Bodies::sizes);
    let next = galerkin::<B, C>(matrix, &interpolation, &transposed, sizes);
    *positions = bodies.map(Bodies::into_coarse);
    let next = System::new(Cow::Owned(next), coarse, *null_space, None);
    let smoother = system.agreed(GaussSeidel::new(matrix, *pieces, &added))?;
    let level = Level {
        aggregates,
        pieces: *pieces,
        rows: matrix.rows(),
        smoother,
        border,
        interpolation: Transfer::interpolation(&interpolation),
        restriction: Transfer::restriction(&interpolation, &transposed),
    };
    Some(Step::Level(Box::new((level, next))))
}

impl<T: Real, const B: usize> Level<T, B> {
    fn vectors<const K: usize>(&self) -> Vectors<T, B, K> {
        Vectors::new(self.rows, self.pieces.odd_rows())
    }

    /// A sweep, and what it leaves to the coarser level.
    fn down<const C: usize, const K: usize>(
        &self,
        own: &mut Vectors<T, B, K>,
        next: &mut Vectors<T, C, K>,
    ) {
        self.smoother.forward(own.sweep(self.pieces.rows()));
        if let Some(border) = &self.border {
            border.update(&mut own.solution);
            border.complete(&own.solution, &mut own.residual);
        }
        parallel::for_each_chunk(&mut next.right_side, ROW_CHUNK / 8, |chunk, part| {
            for (index, value) in part.iter_mut().enumerate() {
                *value = [[T::default(); C]; K];
                self.restriction.restrict(chunk * (ROW_CHUNK / 8) + index, &own.residual, value);
            }
        });
    }

    /// Adds the correction of the coarser level, and sweeps back.
    fn up<const C: usize, const K: usize>(
        &self,
        own: &mut Vectors<T, B, K>,
        next: &Vectors<T, C, K>,
    ) {
        parallel::for_each_chunk(&mut own.solution, ROW_CHUNK, |chunk, part| {
            for (index, value) in part.iter_mut().enumerate() {
                self.interpolation.interpolate(chunk * ROW_CHUNK + index, &next.solution, value);
            }
        });
        if let Some(border) = &self.border {
            border.prepare(&own.solution, &mut own.right_side, &mut own.residual);
        }
        self.smoother.backward(own.sweep(self.pieces.rows()));
        if let Some(border) = &self.border {
            border.update(&mut own.solution);
        }
    }
}
