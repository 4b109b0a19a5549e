//! Conjugate gradients over the ranks of a partition.

use std::sync::{Arc, OnceLock};

use super::iteration::{Columns, Operator, conjugate_gradients, dot, largest, single_column, single_column_mut};
use super::{
    BlockPreconditioner, Convergence, Factorization, LinearError, LinearSolver, Multigrid, MultigridSettings,
    SparseMatrix, Tolerance,
};
use crate::partition::{Partition, Reduction, Shares, all};

/// The iterations after which multigrid is taken to have stalled, and those that the fallback may take.
const ITERATIONS: usize = 300;
const FALLBACK_ITERATIONS: usize = 5000;

/// Conjugate gradients for a matrix that is the sum of the ranks', preconditioned by additive Schwarz (M. Dryja, O. Widlund 1987):
/// each rank applies one V-cycle of [`Multigrid`] to its own matrix, whose diagonal at the vertices that it shares is that of the
/// sum, and what they find is added up.
///
/// There is no coarse space over the ranks, so that the number of iterations grows with them: meant for few ranks. Should it stall,
/// the solve is made again with symmetric Gauss–Seidel on each rank.
///
/// # Guarantees
/// - All ranks have the same solution where they share a vertex, bit for bit, and the same error.
/// - The same bits in every run on the same parts.
#[derive(Debug)]
pub struct Schwarz<const B: usize> {
    partition: Arc<dyn Partition>,
    shares: Shares,
    matrix: Arc<SparseMatrix<B>>,
    /// The matrix with the diagonal of the sum, and its solver; none on a rank without unknowns.
    local: Option<Local<B>>,
}

#[derive(Debug)]
struct Local<const B: usize> {
    matrix: Arc<SparseMatrix<B>>,
    multigrid: Box<Multigrid<B>>,
    fallback: OnceLock<Option<BlockPreconditioner<B>>>,
}

impl<const B: usize> Local<B> {
    fn new(matrix: Arc<SparseMatrix<B>>, like: Option<&Self>) -> Result<Option<Self>, LinearError> {
        if matrix.rows() == 0 {
            return Ok(None);
        }
        let multigrid = match like {
            Some(like) => like.multigrid.of_like_matrix(Arc::clone(&matrix))?,
            None => Multigrid::new(Arc::clone(&matrix), MultigridSettings::default())?,
        };
        Ok(Some(Self { matrix, multigrid: Box::new(multigrid), fallback: OnceLock::new() }))
    }
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
                    *sum -= (0..B).map(|axis| a[place][column][axis] * b[place][column][axis]).sum::<f64>();
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

impl<const B: usize> Schwarz<B> {
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
        let mut whole = SparseMatrix::clone(&matrix);
        let mut diagonal = vec![[[0.0; B]; B]; matrix.rows()];
        let place_of = |place: u32| {
            let (columns, _) = matrix.row(place as usize);
            columns.binary_search(&place).ok().map(|found| matrix.offsets()[place as usize] + found)
        };
        for &place in shares.places() {
            diagonal[place as usize] = place_of(place).map_or([[0.0; B]; B], |found| matrix.values()[found]);
        }
        shares.sum(&*partition, B * B, diagonal.as_flattened_mut().as_flattened_mut());
        let (_, _, values) = whole.offsets_and_values_mut();
        for &place in shares.places() {
            if let Some(found) = place_of(place) {
                values[found] = diagonal[place as usize];
            }
        }
        drop(diagonal);
        let local = Local::new(Arc::new(whole), like.and_then(|like| like.local.as_ref()));
        match (all(&*partition, local.is_ok()), local) {
            (true, Ok(local)) => Ok(Self { partition, shares, matrix, local }),
            (_, Err(error)) => Err(error),
            (false, Ok(_)) => Err(LinearError::OtherRank),
        }
    }

    /// The same for another matrix of the same rows; aggregates are used again where it has its blocks at the same places.
    /// Collective.
    ///
    /// # Errors
    /// As [`Schwarz::new`].
    pub fn of_like_matrix(&self, matrix: Arc<SparseMatrix<B>>) -> Result<Self, LinearError> {
        Self::with_shares(Arc::clone(&self.partition), self.shares.clone(), matrix, Some(self))
    }

    /// The matrix of this rank.
    #[must_use]
    pub fn matrix(&self) -> &SparseMatrix<B> {
        &self.matrix
    }

    /// Calls `work` with the preconditioner: to a vector that all ranks have the same of, what multigrid makes of it on this rank
    /// alone.
    pub fn with_own_cycle<R>(
        &self,
        scale: f64,
        work: impl FnOnce(&mut dyn FnMut(&[[f64; B]], &mut [[f64; B]])) -> R,
    ) -> R {
        match &self.local {
            Some(local) => local.multigrid.with_cycle([scale], |cycle| {
                work(&mut |vector, result| cycle(single_column(vector), single_column_mut(result)))
            }),
            None => work(&mut |_, _| {}),
        }
    }

    fn solve_columns<const K: usize>(
        &self,
        right_side: &[Columns<B, K>],
        solution: &mut [Columns<B, K>],
        tolerances: [Tolerance; K],
    ) -> Result<[Convergence; K], LinearError> {
        let sum = Sum { matrix: &self.matrix, shares: &self.shares, partition: &*self.partition };
        let mut right_side = right_side.to_vec();
        sum.assemble(&mut right_side);
        let scale = sum.dot(&right_side, &right_side).map(|square| {
            let scale = 1.0 / square.sqrt();
            if scale.is_normal() { scale } else { 1.0 }
        });
        let mut iterate = |cycle: &mut dyn FnMut(&[Columns<B, K>], &mut [Columns<B, K>])| {
            let precondition = |vector: &[Columns<B, K>], result: &mut [Columns<B, K>]| {
                cycle(vector, result);
                sum.assemble(result);
            };
            conjugate_gradients(&sum, precondition, &right_side, solution, tolerances, ITERATIONS)
        };
        let result = match &self.local {
            Some(local) => local.multigrid.with_cycle(scale, &mut iterate),
            None => iterate(&mut |_, _| {}),
        };
        match result {
            Err(LinearError::NotConverged { .. } | LinearError::Indefinite { .. }) => {}
            Err(LinearError::NotFinite { iteration }) if iteration > 0 => {}
            other => return other,
        }
        solution.iter_mut().for_each(|value| *value = [[0.0; B]; K]);
        let fallback = self.local.as_ref().map(|local| {
            local.fallback.get_or_init(|| BlockPreconditioner::new(&local.matrix, Factorization::GaussSeidel).ok())
        });
        if !all(&*self.partition, !matches!(fallback, Some(None))) {
            return result;
        }
        let precondition = |vector: &[Columns<B, K>], result: &mut [Columns<B, K>]| {
            if let Some(Some(fallback)) = fallback {
                for column in 0..K {
                    let one: Vec<[f64; B]> = vector.iter().map(|value| value[column]).collect();
                    let mut found = vec![[0.0; B]; one.len()];
                    fallback.apply(&one, &mut found);
                    result.iter_mut().zip(found).for_each(|(value, found)| value[column] = found);
                }
            }
            sum.assemble(result);
        };
        conjugate_gradients(&sum, precondition, &right_side, solution, tolerances, FALLBACK_ITERATIONS)
    }
}

impl<const B: usize> LinearSolver<B> for Schwarz<B> {
    fn unknowns(&self) -> usize {
        self.matrix.rows()
    }

    fn solve_from(
        &self,
        right_side: &[[f64; B]],
        solution: &mut [[f64; B]],
        tolerance: Tolerance,
    ) -> Result<Convergence, LinearError> {
        let [convergence] = self.solve_columns(single_column(right_side), single_column_mut(solution), [tolerance])?;
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

    fn renewed(&self, matrix: Arc<SparseMatrix<B>>) -> Result<Box<dyn LinearSolver<B>>, LinearError> {
        Ok(Box::new(self.of_like_matrix(matrix)?))
    }
}
