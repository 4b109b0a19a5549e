//! The vertices that several ranks have.

use std::collections::BTreeMap;

use tombolo_deform::{mesh::Vector, partition::Neighbour, surface::BoundaryFaces};

use super::message::{Reader, Writer};
use super::places::{self, Candidate, Doubt, Twins};
use super::{DistributedError, Part, TOLERANCE};
use crate::communicator::{Communicator, Reduction, agree};

/// A neighbour's rank, and its values at vertices that are shared with it.
type FromNeighbour = (usize, Vec<(u32, Vector)>);

/// Which vertices of a part other ranks have too, who owns each vertex, and its number in the whole mesh.
///
/// Each vertex has one owner: of the ranks that have it in a cell of their own (no ghost), the lowest. The numbers are the
/// solver's global ones, where it gives them and 32 bits hold them; else they count the vertices of rank 0, then those of rank 1,
/// and so on, each with its owner.
///
/// ```
/// use tombolo_deform::shapes::box_of_tets;
/// use tombolo_pipelines::{communicator::{Communicator, threads}, distributed::{Part, SharedVertices}};
///
/// // Two boxes side by side, which have 9 vertices in common.
/// let shared = threads::run(2, |ranks| {
///     let x = ranks.rank() as f64;
///     let mesh = box_of_tets([2, 2, 2], [x, 0.0, 0.0], [x + 1.0, 1.0, 1.0]);
///     let part = Part { points: mesh.points().to_vec(), cells: mesh.cells().clone(), ..Part::default() };
///     SharedVertices::find(&ranks, &part)
/// });
/// let shared = shared.into_iter().collect::<Result<Vec<_>, _>>()?;
/// assert_eq!(shared[0].neighbours()[0].vertices.len(), 9);
/// assert_eq!((shared[0].owned(), shared[1].owned(), shared[0].count()), (27, 18, 45));
/// # Ok::<(), tombolo_pipelines::distributed::DistributedError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SharedVertices {
    rank: usize,
    owners: Vec<u32>,
    numbers: Vec<u32>,
    owned: usize,
    count: u64,
    neighbours: Vec<Neighbour>,
}

impl SharedVertices {
    /// Finds them together with the other ranks. Collective. Vertices without global numbers are matched by their places within
    /// [`TOLERANCE`].
    ///
    /// # Errors
    /// [`DistributedError`], the same on all ranks.
    pub fn find(communicator: &dyn Communicator, part: &Part) -> Result<Self, DistributedError> {
        Self::find_within(communicator, part, TOLERANCE)
    }

    /// The same with another tolerance, a fraction of the diagonal of the whole mesh's bounding box.
    ///
    /// # Errors
    /// [`DistributedError`], the same on all ranks.
    pub fn find_within(
        communicator: &dyn Communicator,
        part: &Part,
        tolerance: f64,
    ) -> Result<Self, DistributedError> {
        let tolerable = if (0.0..=0.01).contains(&tolerance) {
            Ok(())
        } else {
            Err(DistributedError::Tolerance(tolerance))
        };
        agree(communicator, tolerable)?;
        let outer = super::boundary::outer_faces(communicator, part)?;
        Self::beside(communicator, part, &outer, tolerance, Doubt::Refused)
    }

    /// The same where the faces that belong to one cell of the part are known.
    pub(super) fn beside(
        communicator: &dyn Communicator,
        part: &Part,
        outer: &BoundaryFaces,
        tolerance: f64,
        doubt: Doubt,
    ) -> Result<Self, DistributedError> {
        let (rank, count) = (communicator.rank(), part.points.len());
        let held = held(part);
        if communicator.size() == 1 {
            return Self::alone(part);
        }
        // Which ranks number their vertices; whether any has ghosts.
        let numbers = part.global_vertices.as_deref().filter(|_| count > 0);
        #[expect(
            clippy::cast_precision_loss,
            reason = "ranks below 2^53; numbers are compared with 2^32"
        )]
        let mut sums = [
            if numbers.is_some() { -(rank as f64) } else { f64::NEG_INFINITY },
            f64::from(u8::from(part.ghosts.as_ref().is_some_and(|ghosts| ghosts.contains(&true)))),
            numbers.unwrap_or_default().iter().copied().max().map_or(0.0, |highest| highest as f64),
        ];
        communicator.reduce(Reduction::Maximum, &mut sums);
        let [numbering, ghosts, highest] = sums;
        let by_number = numbering.is_finite();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a rank")]
        let fault = (by_number && numbers.is_none() && count > 0)
            .then(|| DistributedError::Numbers { other: (-numbering) as usize });
        agree(communicator, fault.map_or(Ok(()), Err))?;

        let mut candidates = candidates(part, outer, &held, ghosts > 0.0);
        if doubt == Doubt::Apart {
            // A vertex of no cell, as those that finer grids cover, is not shown: it casts no doubt on others. Points alone, such
            // as particles, are each their own, wherever they are.
            let mut used = vec![false; count];
            let connected = part.cells.iter().filter(|(cell_type, _)| cell_type.dimension() > 0);
            connected.for_each(|(_, vertices)| {
                vertices.iter().for_each(|&vertex| used[vertex as usize] = true)
            });
            candidates.retain(|&(vertex, _)| used[vertex as usize]);
        }
        let twins = match (by_number, numbers) {
            (true, numbers) => {
                places::by_number(communicator, numbers.unwrap_or_default(), &candidates)
            }
            (false, _) => places::by_place(communicator, part, &candidates, tolerance, doubt),
        };
        let twins = agree(communicator, twins)?;
        #[expect(clippy::cast_possible_truncation, reason = "ranks are numbered with 32 bits")]
        let mut owners = vec![rank as u32; count];
        for (vertex, twins) in &twins {
            let own = (!held[*vertex as usize], owners[*vertex as usize]);
            let best =
                twins.iter().map(|twin| (!twin.held, twin.rank)).fold(own, std::cmp::Ord::min);
            owners[*vertex as usize] = best.1;
        }
        let owned = owners.iter().filter(|&&owner| owner as usize == rank).count();
        #[expect(clippy::cast_precision_loss, reason = "counts below 2^53")]
        let mut total = [owned as f64];
        communicator.reduce(Reduction::Sum, &mut total);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count")]
        let total = total[0] as u64;
        if total >= u64::from(u32::MAX) {
            return Err(DistributedError::TooLarge { vertices: total });
        }
        #[expect(clippy::cast_possible_truncation, reason = "checked: the highest is below")]
        let numbers: Vec<u32> = match numbers {
            Some(numbers) if highest < f64::from(u32::MAX) => {
                numbers.iter().map(|&number| number as u32).collect()
            }
            _ if by_number && highest < f64::from(u32::MAX) => Vec::new(),
            _ => consecutive(communicator, &owners, owned, &twins)?,
        };
        let neighbours = neighbours(&twins, &numbers);
        Ok(Self { rank, owners, numbers, owned, count: total, neighbours })
    }

    /// A mesh that one process has as a whole.
    fn alone(part: &Part) -> Result<Self, DistributedError> {
        let count = part.points.len();
        let (rank, owners, neighbours) = (0, vec![0; count], Vec::new());
        let number = |number: u64| u32::try_from(number).ok();
        let given: Option<Vec<u32>> = part
            .global_vertices
            .as_ref()
            .and_then(|ids| ids.iter().map(|&id| number(id)).collect());
        let vertices = count as u64;
        if vertices >= u64::from(u32::MAX) {
            return Err(DistributedError::TooLarge { vertices });
        }
        #[expect(clippy::cast_possible_truncation, reason = "checked above")]
        let numbers = given.unwrap_or_else(|| (0..count as u32).collect());
        Ok(Self { rank, owners, numbers, owned: count, count: vertices, neighbours })
    }

    /// The rank that owns each vertex of the part.
    #[must_use]
    pub fn owners(&self) -> &[u32] {
        &self.owners
    }

    /// Whether this rank owns a vertex.
    #[must_use]
    pub fn owns(&self, vertex: u32) -> bool {
        self.owners.get(vertex as usize).is_some_and(|&owner| owner as usize == self.rank)
    }

    /// The number of each vertex in the whole mesh.
    #[must_use]
    pub fn numbers(&self) -> &[u32] {
        &self.numbers
    }

    /// How many vertices this rank owns.
    #[must_use]
    pub fn owned(&self) -> usize {
        self.owned
    }

    /// How many vertices the whole mesh has, each counted once.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.count
    }

    /// The ranks that have vertices of this rank too, rising.
    #[must_use]
    pub fn neighbours(&self) -> &[Neighbour] {
        &self.neighbours
    }

    /// Adds up what the ranks have at the vertices that several of them have. Collective among neighbours. The ranks' values are
    /// added in the order of the ranks, so that all of them get the same bits.
    ///
    /// # Errors
    /// [`DistributedError::Garbled`].
    pub fn sum(
        &self,
        communicator: &dyn Communicator,
        values: &mut [Vector],
    ) -> Result<(), DistributedError> {
        let others = self.swap(communicator, values, |_, _| true)?;
        let own: Vec<(u32, Vector)> =
            self.shared().map(|vertex| (vertex, values[vertex as usize])).collect();
        own.iter().for_each(|&(vertex, _)| values[vertex as usize] = [0.0; 3]);
        let add = |values: &mut [Vector], vertex: u32, more: Vector| {
            let value = &mut values[vertex as usize];
            *value = std::array::from_fn(|axis| value[axis] + more[axis]);
        };
        let is_below = |neighbour: &&(usize, Vec<(u32, Vector)>)| neighbour.0 < self.rank;
        for (_, theirs) in others.iter().take_while(is_below) {
            theirs.iter().for_each(|&(vertex, more)| add(values, vertex, more));
        }
        own.iter().for_each(|&(vertex, more)| add(values, vertex, more));
        for (_, theirs) in others.iter().skip_while(is_below) {
            theirs.iter().for_each(|&(vertex, more)| add(values, vertex, more));
        }
        Ok(())
    }

    /// Gives every rank that has a vertex, be it in a ghost cell alone, the value of its owner. Collective among neighbours.
    ///
    /// # Errors
    /// [`DistributedError::Garbled`].
    pub fn take_from_owners(
        &self,
        communicator: &dyn Communicator,
        values: &mut [Vector],
    ) -> Result<(), DistributedError> {
        let owners = self.swap(communicator, values, |from, vertex| {
            self.owners[vertex as usize] as usize == from
        })?;
        for (_, theirs) in owners {
            theirs.into_iter().for_each(|(vertex, value)| values[vertex as usize] = value);
        }
        Ok(())
    }

    /// Marks on every rank the vertices that any rank marks. Collective among neighbours.
    pub(super) fn any(&self, communicator: &dyn Communicator, marks: &mut [bool]) {
        let messages = self.neighbours.iter().map(|neighbour| {
            let marked = neighbour.vertices.iter().map(|&vertex| u8::from(marks[vertex as usize]));
            (neighbour.rank, marked.collect())
        });
        let messages = messages.collect();
        for (rank, bytes) in communicator.exchange(messages) {
            let Some(neighbour) = self.neighbours.iter().find(|neighbour| neighbour.rank == rank)
            else {
                continue;
            };
            for (&vertex, mark) in neighbour.vertices.iter().zip(bytes) {
                marks[vertex as usize] |= mark != 0;
            }
        }
    }

    /// The vertices that other ranks have too, each once, rising.
    pub fn shared(&self) -> impl Iterator<Item = u32> {
        let mut all: Vec<u32> = self
            .neighbours
            .iter()
            .flat_map(|neighbour| neighbour.vertices.iter().copied())
            .collect();
        all.sort_unstable();
        all.dedup();
        all.into_iter()
    }

    /// The other ranks that have a vertex, in compressed rows: starts, and ranks, rising.
    pub(super) fn sharers(&self) -> (Vec<usize>, Vec<u32>) {
        let mut starts = vec![0; self.owners.len() + 1];
        for &vertex in self.neighbours.iter().flat_map(|neighbour| &neighbour.vertices) {
            starts[vertex as usize + 1] += 1;
        }
        for vertex in 0..self.owners.len() {
            starts[vertex + 1] += starts[vertex];
        }
        let mut next = starts.clone();
        let mut ranks = vec![0; starts[self.owners.len()]];
        for neighbour in &self.neighbours {
            for &vertex in &neighbour.vertices {
                #[expect(
                    clippy::cast_possible_truncation,
                    reason = "ranks are numbered with 32 bits"
                )]
                {
                    ranks[next[vertex as usize]] = neighbour.rank as u32;
                }
                next[vertex as usize] += 1;
            }
        }
        (starts, ranks)
    }

    /// What the neighbours have at the shared vertices for which `wanted` holds of the rank that sends.
    fn swap(
        &self,
        communicator: &dyn Communicator,
        values: &[Vector],
        wanted: impl Fn(usize, u32) -> bool,
    ) -> Result<Vec<FromNeighbour>, DistributedError> {
        let mut messages = Vec::new();
        for neighbour in &self.neighbours {
            let mut message = Writer::with_capacity(24 * neighbour.vertices.len());
            for &vertex in neighbour.vertices.iter().filter(|&&vertex| wanted(self.rank, vertex)) {
                message.f64s(&values[vertex as usize]);
            }
            messages.push((neighbour.rank, message.into_bytes()));
        }
        let heard: BTreeMap<usize, Vec<u8>> = communicator.exchange(messages).into_iter().collect();
        let mut others = Vec::with_capacity(self.neighbours.len());
        for neighbour in &self.neighbours {
            let bytes = heard
                .get(&neighbour.rank)
                .ok_or(DistributedError::Garbled { rank: neighbour.rank })?;
            let mut reader = Reader::new(neighbour.rank, bytes);
            let vertices =
                neighbour.vertices.iter().filter(|&&vertex| wanted(neighbour.rank, vertex));
            let theirs: Result<Vec<(u32, Vector)>, DistributedError> =
                vertices.map(|&vertex| Ok((vertex, reader.vector()?))).collect();
            others.push((neighbour.rank, theirs?));
        }
        Ok(others)
    }
}

/// For each vertex whether it belongs to a cell of the rank's own.
fn held(part: &Part) -> Vec<bool> {
    let mut held = vec![false; part.points.len()];
    for (cell, (_, vertices)) in part.cells.iter().enumerate() {
        if !part.is_ghost(cell) {
            vertices.iter().for_each(|&vertex| held[vertex as usize] = true);
        }
    }
    held
}

/// The vertices that other ranks may have. Without ghosts those are not inside the part: around a vertex of which another rank has
/// cells there is a face that has a cell here on one side only.
fn candidates(part: &Part, outer: &BoundaryFaces, held: &[bool], ghosts: bool) -> Vec<Candidate> {
    let count = part.points.len();
    let mut inside = vec![false; count];
    if !ghosts && part.cells.dimension() == 3 {
        for (_, vertices) in part.cells.iter().filter(|(cell_type, _)| cell_type.dimension() == 3) {
            vertices.iter().for_each(|&vertex| inside[vertex as usize] = true);
        }
        outer.faces.connectivity().iter().for_each(|&vertex| inside[vertex as usize] = false);
    }
    (0..)
        .zip(held)
        .zip(inside)
        .filter(|(_, inside)| !inside)
        .map(|((vertex, &held), _)| (vertex, held))
        .collect()
}

/// Numbers that count through the ranks.
fn consecutive(
    communicator: &dyn Communicator,
    owners: &[u32],
    owned: usize,
    twins: &Twins,
) -> Result<Vec<u32>, DistributedError> {
    let rank = communicator.rank();
    let counts = communicator.gather(0, &(owned as u64).to_le_bytes());
    let mut starts = Vec::new();
    if let Some(counts) = counts {
        let mut start = 0;
        for (to, count) in counts.into_iter().enumerate() {
            let mut message = Writer::default();
            message.u64(start);
            start += Reader::new(to, &count).u64()?;
            starts.push((to, message.into_bytes()));
        }
    }
    let starts = communicator.exchange(starts);
    let start = starts.first().map_or(Ok(0), |(from, bytes)| Reader::new(*from, bytes).u64())?;
    let mut numbers = vec![u32::MAX; owners.len()];
    let owned = numbers.iter_mut().zip(owners).filter(|(_, owner)| **owner as usize == rank);
    #[expect(clippy::cast_possible_truncation, reason = "fewer vertices than 2^32")]
    for (next, (number, _)) in (start as u32..).zip(owned) {
        *number = next;
    }
    let mut messages: BTreeMap<u32, Writer> = BTreeMap::new();
    for (vertex, twins) in
        twins.iter().filter(|(vertex, _)| owners[*vertex as usize] as usize == rank)
    {
        for twin in twins {
            let message = messages.entry(twin.rank).or_default();
            message.u32(twin.vertex);
            message.u32(numbers[*vertex as usize]);
        }
    }
    let messages =
        messages.into_iter().map(|(rank, message)| (rank as usize, message.into_bytes())).collect();
    for (from, bytes) in communicator.exchange(messages) {
        let mut reader = Reader::new(from, &bytes);
        while !reader.is_empty() {
            let (vertex, number) = (reader.u32()?, reader.u32()?);
            *numbers.get_mut(vertex as usize).ok_or(DistributedError::Garbled { rank: from })? =
                number;
        }
    }
    Ok(numbers)
}

fn neighbours(twins: &Twins, numbers: &[u32]) -> Vec<Neighbour> {
    let mut by_rank: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for (vertex, twins) in twins {
        twins.iter().for_each(|twin| by_rank.entry(twin.rank).or_default().push(*vertex));
    }
    let neighbour = |(rank, mut vertices): (u32, Vec<u32>)| {
        vertices.sort_unstable_by_key(|&vertex| numbers[vertex as usize]);
        Neighbour { rank: rank as usize, vertices }
    };
    by_rank.into_iter().map(neighbour).collect()
}
