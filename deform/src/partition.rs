//! What an algorithm must know of the other ranks where the mesh it works on is a part of a larger one.
//!
//! Cells belong to one rank each; a vertex on the border between parts is held by several. A sum over cells is then what the ranks
//! have between them, added up at the vertices that they share. Everything here that works on [`Partition`]s is collective: all
//! ranks call it, in the same order, and all get the same outcome. An error of one rank is [`VolumeError::OtherRank`] on the
//! others.
//!
//! [`VolumeError::OtherRank`]: crate::volume::VolumeError::OtherRank

use std::fmt::Debug;
use std::sync::Arc;

use crate::linear::{LinearError, LinearSolver, Schwarz, SparseMatrix};
use crate::mesh::Cells;

/// How the values of the ranks are combined.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reduction {
    /// The smallest; NaN is passed over.
    Minimum,
    /// The largest; NaN is passed over.
    Maximum,
    /// The sum, added in a fixed order, so that the bits do not depend on chance.
    Sum,
}

impl Reduction {
    /// Takes `more` into `values`.
    pub fn take_in(self, values: &mut [f64], more: &[f64]) {
        for (value, more) in values.iter_mut().zip(more) {
            *value = match self {
                Reduction::Minimum => value.min(*more),
                Reduction::Maximum => value.max(*more),
                Reduction::Sum => *value + more,
            };
        }
    }
}

/// The vertices that this rank and another both have.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Neighbour {
    /// The other rank.
    pub rank: usize,
    /// The vertices, in the same order on both ranks: that of their numbers in the whole mesh.
    pub vertices: Vec<u32>,
}

/// The parts that a mesh is in, as the rank that has one of them sees them.
///
/// The methods that speak with other ranks ([`reduce`](Partition::reduce), [`gather`](Partition::gather),
/// [`exchange`](Partition::exchange), and making and using a solver) are collective.
pub trait Partition: Debug + Send + Sync {
    /// This rank's number, from 0.
    fn rank(&self) -> usize {
        0
    }

    /// How many ranks there are. One of them has the whole mesh, and no method of this trait does anything.
    fn ranks(&self) -> usize {
        1
    }

    /// Combines each value over all ranks, which bring the same number of them; every rank has the result, the same bits.
    fn reduce(&self, reduction: Reduction, values: &mut [f64]) {
        let _ = (reduction, values);
    }

    /// What all ranks bring, one after the other in the order of their numbers.
    fn gather(&self, values: &[f64]) -> Vec<f64> {
        values.to_vec()
    }

    /// Sends each message to its rank and returns those sent here with their senders, in the order of the senders.
    fn exchange(&self, messages: Vec<(usize, Vec<f64>)>) -> Vec<(usize, Vec<f64>)> {
        messages
    }

    /// Whether this rank is the one of those that have a vertex in a cell of their own that speaks for it.
    fn owns(&self, vertex: u32) -> bool {
        let _ = vertex;
        true
    }

    /// The ranks that have vertices of this rank too, rising.
    fn neighbours(&self) -> &[Neighbour] {
        &[]
    }

    /// The number in the whole mesh of a cell of the part.
    fn cell_number(&self, cell: usize) -> usize {
        cell
    }

    /// The faces of the part that lie on the boundary of the whole mesh; `None` where all do that one cell has.
    fn boundary_faces(&self) -> Option<&Cells> {
        None
    }

    /// A solver of its own for a system with one value for each of `vertices`; `None` for that of [`scalar_solver`]. The matrix
    /// is the sum of the ranks'; a right side is the sum of theirs too, and a solution is the same on all ranks that have a
    /// vertex.
    fn scalar_solver(&self, matrix: &Arc<SparseMatrix<1>>, vertices: &[u32]) -> Option<Solver<1>> {
        let _ = (matrix, vertices);
        None
    }

    /// The same for three values.
    fn vector_solver(&self, matrix: &Arc<SparseMatrix<3>>, vertices: &[u32]) -> Option<Solver<3>> {
        let _ = (matrix, vertices);
        None
    }
}

/// A solver, or why there is none.
pub type Solver<const B: usize> = Result<Box<dyn LinearSolver<B>>, LinearError>;

/// The partition of a mesh that this process has as a whole.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Whole;

impl Partition for Whole {}

/// The partition of a mesh that this process has as a whole.
#[must_use]
pub fn whole() -> Arc<dyn Partition> {
    Arc::new(Whole)
}

/// The solver for a symmetric positive definite matrix that is the sum of the ranks', each with a row for each of its `vertices`:
/// the partition's own, or [`Schwarz`]; of one process that of [`linear::solver`](crate::linear::solver). Collective.
///
/// # Errors
/// [`LinearError`], on all ranks.
pub fn scalar_solver(partition: &Arc<dyn Partition>, matrix: Arc<SparseMatrix<1>>, vertices: &[u32]) -> Solver<1> {
    match partition.scalar_solver(&matrix, vertices) {
        Some(solver) => solver,
        None if partition.ranks() == 1 => crate::linear::solver(matrix),
        None => Ok(Box::new(Schwarz::new(Arc::clone(partition), matrix, vertices)?)),
    }
}

/// The same for three values at each vertex.
///
/// # Errors
/// [`LinearError`], on all ranks.
pub fn vector_solver(partition: &Arc<dyn Partition>, matrix: Arc<SparseMatrix<3>>, vertices: &[u32]) -> Solver<3> {
    match partition.vector_solver(&matrix, vertices) {
        Some(solver) => solver,
        None if partition.ranks() == 1 => crate::linear::solver(matrix),
        None => Ok(Box::new(Schwarz::new(Arc::clone(partition), matrix, vertices)?)),
    }
}

/// Whether something holds on all ranks.
pub(crate) fn all(partition: &dyn Partition, mine: bool) -> bool {
    let mut holds = [f64::from(u8::from(mine))];
    partition.reduce(Reduction::Minimum, &mut holds);
    holds[0] > 0.0
}

/// Whether something holds on any rank.
pub(crate) fn any(partition: &dyn Partition, mine: bool) -> bool {
    !all(partition, !mine)
}

/// The sum of counts.
#[expect(clippy::cast_precision_loss, clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below 2^53")]
pub(crate) fn count(partition: &dyn Partition, mine: usize) -> usize {
    let mut sum = [mine as f64];
    partition.reduce(Reduction::Sum, &mut sum);
    sum[0] as usize
}

/// The largest of counts.
#[expect(clippy::cast_precision_loss, clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below 2^53")]
pub(crate) fn most(partition: &dyn Partition, mine: usize) -> usize {
    let mut most = [mine as f64];
    partition.reduce(Reduction::Maximum, &mut most);
    most[0] as usize
}

/// Which of a list of values, one for each of some vertices, are those of vertices that other ranks list too.
#[derive(Debug, Clone)]
pub struct Shares {
    rank: usize,
    /// The other ranks, rising, and the places of what is shared with each, in the same order on both.
    others: Vec<(usize, Vec<u32>)>,
    /// All places that are shared, each once.
    places: Vec<u32>,
    /// Whether this rank speaks for each value; empty where it does for all.
    owned: Arc<[bool]>,
}

impl Shares {
    /// What is shared of a list of vertices, no vertex twice. Collective.
    #[must_use]
    pub fn new(partition: &dyn Partition, vertices: &[u32]) -> Self {
        let rank = partition.rank();
        if partition.ranks() == 1 {
            return Self { rank, others: Vec::new(), places: Vec::new(), owned: Arc::new([]) };
        }
        let count = vertices.iter().max().map_or(0, |&last| last as usize + 1);
        let mut place_of = vec![u32::MAX; count];
        (0..).zip(vertices).for_each(|(place, &vertex)| place_of[vertex as usize] = place);
        let place = |vertex: u32| place_of.get(vertex as usize).copied().filter(|&place| place != u32::MAX);
        let listed = |neighbour: &Neighbour| -> Vec<f64> {
            neighbour.vertices.iter().map(|&vertex| f64::from(u8::from(place(vertex).is_some()))).collect()
        };
        let messages = partition.neighbours().iter().map(|neighbour| (neighbour.rank, listed(neighbour))).collect();
        let heard = partition.exchange(messages);
        let mut others = Vec::new();
        for neighbour in partition.neighbours() {
            let theirs = heard.iter().find(|(from, _)| *from == neighbour.rank).map_or(&[][..], |(_, marks)| marks);
            let common = neighbour.vertices.iter().zip(theirs).filter(|(_, mark)| **mark > 0.0);
            let common: Vec<u32> = common.filter_map(|(&vertex, _)| place(vertex)).collect();
            if !common.is_empty() {
                others.push((neighbour.rank, common));
            }
        }
        let mut places: Vec<u32> = others.iter().flat_map(|(_, places)| places.iter().copied()).collect();
        places.sort_unstable();
        places.dedup();
        let owned = vertices.iter().map(|&vertex| partition.owns(vertex)).collect();
        Self { rank, others, places, owned }
    }

    /// The places of what other ranks list too, rising.
    #[must_use]
    pub fn places(&self) -> &[u32] {
        &self.places
    }

    /// Whether this rank speaks for the value at a place: exactly one of those that list the vertex does.
    #[must_use]
    pub fn owns(&self, place: usize) -> bool {
        self.owned.get(place).is_none_or(|&owned| owned)
    }

    /// Those of the places for which `wanted` holds, the same ones on all ranks.
    #[must_use]
    pub fn only(&self, wanted: impl Fn(u32) -> bool) -> Self {
        let filter = |places: &[u32]| places.iter().copied().filter(|&place| wanted(place)).collect::<Vec<u32>>();
        let others = self.others.iter().map(|(rank, places)| (*rank, filter(places)));
        Self {
            rank: self.rank,
            others: others.filter(|(_, places)| !places.is_empty()).collect(),
            places: filter(&self.places),
            owned: Arc::clone(&self.owned),
        }
    }

    /// Adds up what the ranks have at the places that they share, in the order of the ranks: all get the same bits. `values` holds
    /// `width` values for each place. What is missing of a message becomes NaN. Collective.
    pub fn sum(&self, partition: &dyn Partition, width: usize, values: &mut [f64]) {
        if partition.ranks() == 1 {
            return;
        }
        let at = |place: u32| place as usize * width..(place as usize + 1) * width;
        let message = |places: &[u32], values: &[f64]| {
            let mut message = Vec::with_capacity(width * places.len());
            places.iter().for_each(|&place| message.extend_from_slice(&values[at(place)]));
            message
        };
        let messages = self.others.iter().map(|(rank, places)| (*rank, message(places, values))).collect();
        let heard = partition.exchange(messages);
        let own = message(&self.places, values);
        self.places.iter().for_each(|&place| values[at(place)].fill(0.0));
        let mut add = |places: &[u32], more: &[f64]| {
            let mut more = more.iter();
            for &place in places {
                for value in &mut values[at(place)] {
                    *value += more.next().copied().unwrap_or(f64::NAN);
                }
            }
        };
        let theirs = |rank: usize| heard.iter().find(|(from, _)| *from == rank).map_or(&[][..], |(_, values)| values);
        let below = self.others.partition_point(|(rank, _)| *rank < self.rank);
        self.others[..below].iter().for_each(|(rank, places)| add(places, theirs(*rank)));
        add(&self.places, &own);
        self.others[below..].iter().for_each(|(rank, places)| add(places, theirs(*rank)));
    }
}
