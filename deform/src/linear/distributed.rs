//! Multigrid over the ranks of a partition.

use std::sync::{Arc, OnceLock};

use super::hierarchy::Hierarchy;
use super::iteration::{
    Columns, Operator, conjugate_gradients, dot, largest, single_column, single_column_mut,
};
use super::{
    BlockPreconditioner, Convergence, Factorization, LinearError, LinearSolver, SparseMatrix,
    Tolerance,
};
use crate::partition::{Partition, Reduction, Shares, all};

/// The iterations after which multigrid is taken to have stalled, and those that the fallback may take.
const ITERATIONS: usize = 300;
const FALLBACK_ITERATIONS: usize = 5000;

/// Conjugate gradients for a matrix that is the sum of the ranks', preconditioned by one V-cycle of algebraic multigrid over all of
/// them: the smoothed aggregation of [`Multigrid`](super::Multigrid), whose aggregates each rank forms of the rows that it speaks for.
/// Couplings between ranks count in the interpolation, in residuals and in all coarser matrices, which stay sums of parts; a sweep of
/// Gauss–Seidel goes through each rank's own rows with what the others had before it (A. Baker, R. Falgout, T. Kolev, U. Yang 2011).
/// The coarsest system is gathered, and solved on every rank.
///
/// The number of iterations hardly grows with the system or the ranks. An aggregate lies on one rank; where ranks have few rows left,
/// the system is gathered on all of them and made coarser there, which is what bounds the number of ranks: to a few ten thousands.
/// Where there are more, or the parts are not connected in themselves, or multigrid stalls, the solve is made with symmetric
/// Gauss–Seidel on each rank.
///
/// # Guarantees
/// - All ranks have the same solution where they share a vertex, bit for bit, and the same error.
/// - The same bits in every run on the same parts.
#[derive(Debug)]
pub struct DistributedMultigrid<const B: usize> {
    partition: Arc<dyn Partition>,
    shares: Shares,
    matrix: Arc<SparseMatrix<B>>,
    levels: Option<Hierarchy<f32, B, B>>,
    /// On a rank that has rows; why there is none on any.
    fallback: OnceLock<Result<Option<BlockPreconditioner<B>>, LinearError>>,
}

/// The sum of the ranks' matrices. Vectors are the same on all ranks at what they share.
struct Sum<'a, const B: usize> {
    matrix: &'a SparseMatrix<B>,
    shares: &'a Shares,
    partition: &'a dyn Partition,
}

impl<const B: usize> Sum<'_, B> {
    /// Adds up what the ranks have.
    fn assemble<const K: usize>(&self, vector: &mut [Columns<B, K>]) {
        self.shares.sum(self.partition, B * K, vector.as_flattened_mut().as_flattened_mut());
    }

    /// What this rank has to add to an inner product: everything, less the values that others speak for.
    fn own_dot<const K: usize>(&self, a: &[Columns<B, K>], b: &[Columns<B, K>]) -> [f64; K] {
        let mut sum = dot(a, b);
        for &place in self.shares.places() {
            let place = place as usize;
            if !self.shares.owns(place) {
                for (column, sum) in sum.iter_mut().enumerate() {
                    *sum -= (0..B)
                        .map(|axis| a[place][column][axis] * b[place][column][axis])
                        .sum::<f64>();
                }
            }
        }
        sum
    }
}

impl<const B: usize> Operator<B> for Sum<'_, B> {
    fn rows(&self) -> usize {
        self.matrix.rows()
    }

    fn multiply<const K: usize>(&self, vector: &[Columns<B, K>], result: &mut [Columns<B, K>]) {
        self.matrix.multiply_columns(vector, result);
        self.assemble(result);
    }

    fn dot<const K: usize>(&self, a: &[Columns<B, K>], b: &[Columns<B, K>]) -> [f64; K] {
        let mut sum = self.own_dot(a, b);
        self.partition.reduce(Reduction::Sum, &mut sum);
        sum
    }

    fn largest<const K: usize>(&self, vector: &[Columns<B, K>]) -> [f64; K] {
        let mut most = largest(vector);
        self.partition.reduce(Reduction::Maximum, &mut most);
        most
    }
}

impl<const B: usize> DistributedMultigrid<B> {
    /// A solver for the sum of the ranks' matrices, which is symmetric and positive definite; `vertices` are those of this rank's
    /// rows, no vertex twice. Collective.
    ///
    /// # Errors
    /// [`LinearError::Diagonal`]; [`LinearError::OtherRank`].
    pub fn new(
        partition: Arc<dyn Partition>,
        matrix: Arc<SparseMatrix<B>>,
        vertices: &[u32],
    ) -> Result<Self, LinearError> {
        let shares = Shares::new(&*partition, vertices);
        Self::with_shares(partition, shares, matrix, None)
    }

    /// The same where what is shared of the rows is known. Collective.
    pub(crate) fn with_shares(
        partition: Arc<dyn Partition>,
        shares: Shares,
        matrix: Arc<SparseMatrix<B>>,
        like: Option<&Self>,
    ) -> Result<Self, LinearError> {
        let like = like.filter(|like| all(&*partition, like.matrix.has_pattern_of(&matrix)));
        let like = like.and_then(|like| like.levels.as_ref());
        let parts = (partition.ranks() > 1).then_some((&partition, &shares));
        let levels = Hierarchy::new(&matrix, parts, like, None);
        let solver = Self { partition, shares, matrix, levels, fallback: OnceLock::new() };
        if solver.levels.is_none() {
            solver.fallback()?;
        }
        Ok(solver)
    }

    /// The same for another matrix of the same rows; aggregates are used again where it has its blocks at the same places.
    /// Collective.
    ///
    /// # Errors
    /// As [`DistributedMultigrid::new`].
    pub fn of_like_matrix(&self, matrix: Arc<SparseMatrix<B>>) -> Result<Self, LinearError> {
        Self::with_shares(Arc::clone(&self.partition), self.shares.clone(), matrix, Some(self))
    }

    /// The matrix of this rank.
    #[must_use]
    pub fn matrix(&self) -> &SparseMatrix<B> {
        &self.matrix
    }

    /// `result` becomes the product of the sum with a vector that all ranks have the same of. Collective.
    pub fn multiply(&self, vector: &[[f64; B]], result: &mut [[f64; B]]) {
        self.sum().multiply(single_column(vector), single_column_mut(result));
    }

    /// Calls `work` with the preconditioner, an approximate inverse of the sum: from a vector that all ranks have the same of, to one
    /// that they do. `scale`, the same on all ranks, brings vectors to the order of 1. Collective, as the preconditioner is.
    pub fn with_cycle<R>(
        &self,
        scale: f64,
        work: impl FnOnce(&mut dyn FnMut(&[[f64; B]], &mut [[f64; B]])) -> R,
    ) -> R {
        match &self.levels {
            Some(levels) => {
                let mut workspace = levels.workspace();
                work(&mut |vector, result| {
                    levels.apply(
                        &mut workspace,
                        [scale],
                        single_column(vector),
                        single_column_mut(result),
                    );
                })
            }
            None => work(&mut |vector, result| {
                self.fall_back(single_column(vector), single_column_mut(result))
            }),
        }
    }

    fn sum(&self) -> Sum<'_, B> {
        Sum { matrix: &self.matrix, shares: &self.shares, partition: &*self.partition }
    }

    /// Sweeps of each rank's own matrix, whose diagonal at shared vertices is that of the sum. Collective.
    fn fallback(&self) -> Result<Option<&BlockPreconditioner<B>>, LinearError> {
        let found = self.fallback.get_or_init(|| {
            let (matrix, shares) = (&*self.matrix, &self.shares);
            let mut whole = SparseMatrix::clone(matrix);
            let mut diagonal = vec![[[0.0; B]; B]; matrix.rows()];
            let place_of = |place: u32| {
                let (columns, _) = matrix.row(place as usize);
                columns
                    .binary_search(&place)
                    .ok()
                    .map(|found| matrix.offsets()[place as usize] + found)
            };
            for &place in shares.places() {
                diagonal[place as usize] =
                    place_of(place).map_or([[0.0; B]; B], |found| matrix.values()[found]);
            }
            shares.sum(&*self.partition, B * B, diagonal.as_flattened_mut().as_flattened_mut());
            let (_, _, values) = whole.offsets_and_values_mut();
            for &place in shares.places() {
                if let Some(found) = place_of(place) {
                    values[found] = diagonal[place as usize];
                }
            }
            let found = (matrix.rows() > 0)
                .then(|| BlockPreconditioner::new(&whole, Factorization::GaussSeidel));
            let found = found.transpose();
            match (all(&*self.partition, found.is_ok()), found) {
                (false, Ok(_)) => Err(LinearError::OtherRank),
                (_, found) => found,
            }
        });
        found.as_ref().map(Option::as_ref).map_err(|error| *error)
    }

    /// What the ranks' sweeps make of a vector, added up.
    fn fall_back<const K: usize>(&self, vector: &[Columns<B, K>], result: &mut [Columns<B, K>]) {
        if let Ok(Some(fallback)) = self.fallback() {
            for column in 0..K {
                let one: Vec<[f64; B]> = vector.iter().map(|value| value[column]).collect();
                let mut found = vec![[0.0; B]; one.len()];
                fallback.apply(&one, &mut found);
                result.iter_mut().zip(found).for_each(|(value, found)| value[column] = found);
            }
        }
        self.sum().assemble(result);
    }

    fn solve_columns<const K: usize>(
        &self,
        right_side: &[Columns<B, K>],
        solution: &mut [Columns<B, K>],
        tolerances: [Tolerance; K],
    ) -> Result<[Convergence; K], LinearError> {
        let sum = self.sum();
        let mut right_side = right_side.to_vec();
        sum.assemble(&mut right_side);
        let scale = sum.dot(&right_side, &right_side).map(|square| {
            let scale = 1.0 / square.sqrt();
            if scale.is_normal() { scale } else { 1.0 }
        });
        if let Some(levels) = &self.levels {
            let mut workspace = levels.workspace();
            let precondition = |vector: &[Columns<B, K>], result: &mut [Columns<B, K>]| {
                levels.apply(&mut workspace, scale, vector, result);
            };
            match conjugate_gradients(
                &sum,
                precondition,
                &right_side,
                solution,
                tolerances,
                ITERATIONS,
            ) {
                Err(LinearError::NotConverged { .. } | LinearError::Indefinite { .. }) => {}
                Err(LinearError::NotFinite { iteration }) if iteration > 0 => {}
                other => return other,
            }
        }
        solution.iter_mut().for_each(|value| *value = [[0.0; B]; K]);
        self.fallback()?;
        let precondition =
            |vector: &[Columns<B, K>], result: &mut [Columns<B, K>]| self.fall_back(vector, result);
        conjugate_gradients(
            &sum,
            precondition,
            &right_side,
            solution,
            tolerances,
            FALLBACK_ITERATIONS,
        )
    }
}

impl<const B: usize> LinearSolver<B> for DistributedMultigrid<B> {
    fn unknowns(&self) -> usize {
        self.matrix.rows()
    }

    fn solve_from(
        &self,
        right_side: &[[f64; B]],
        solution: &mut [[f64; B]],
        tolerance: Tolerance,
    ) -> Result<Convergence, LinearError> {
        let [convergence] = self.solve_columns(
            single_column(right_side),
            single_column_mut(solution),
            [tolerance],
        )?;
        Ok(convergence)
    }

    fn solve_three_from(
        &self,
        right_sides: &[[[f64; B]; 3]],
        solutions: &mut [[[f64; B]; 3]],
        tolerances: [Tolerance; 3],
    ) -> Result<[Convergence; 3], LinearError> {
        self.solve_columns(right_sides, solutions, tolerances)
    }

    fn renewed(
        &self,
        matrix: Arc<SparseMatrix<B>>,
    ) -> Result<Box<dyn LinearSolver<B>>, LinearError> {
        Ok(Box::new(self.of_like_matrix(matrix)?))
    }
}
