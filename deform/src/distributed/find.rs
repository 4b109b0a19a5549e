//! Finding the vertices that several ranks have.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::positions::{self, Candidate, Doubt, Held, Twins};
use super::{DistributedError, Part, TOLERANCE};
use crate::communicator::{Communicator, Garbled, Halo, Reader, Writer, agree};
use crate::mesh::SharedVertices;
use crate::number::index;
use crate::surface::BoundaryFaces;
use crate::topology::marks;

impl SharedVertices {
    /// Finds the shared vertices together with the other ranks. Collective. Vertices without global
    /// numbers are matched by their positions within [`TOLERANCE`].
    ///
    /// # Errors
    /// [`DistributedError`], the same on all ranks.
    pub fn find(
        communicator: &Arc<dyn Communicator>,
        part: &Part,
    ) -> Result<Self, DistributedError> {
        Self::find_within(communicator, part, TOLERANCE)
    }

    /// Finds the shared vertices within a tolerance, a fraction of the diagonal of the whole mesh's
    /// bounding box.
    ///
    /// # Errors
    /// [`DistributedError`], the same on all ranks.
    pub fn find_within(
        communicator: &Arc<dyn Communicator>,
        part: &Part,
        tolerance: f64,
    ) -> Result<Self, DistributedError> {
        let ranks = &**communicator;
        let tolerable = if (0.0..=0.01).contains(&tolerance) {
            Ok(())
        } else {
            Err(DistributedError::Tolerance(tolerance))
        };
        agree(ranks, tolerable)?;
        let outer = super::boundary::outer_faces(ranks, part)?;
        Self::beside(communicator, part, &outer, tolerance, Doubt::Refused)
    }

    /// Finds the shared vertices where the faces that belong to one cell of the part are known.
    pub(super) fn beside(
        communicator: &Arc<dyn Communicator>,
        part: &Part,
        outer: &BoundaryFaces,
        tolerance: f64,
        doubt: Doubt,
    ) -> Result<Self, DistributedError> {
        let ranks = &**communicator;
        let (rank, count) = (ranks.rank(), part.points.len());
        if ranks.size() == 1 {
            return Self::alone(communicator, part);
        }
        let held = held(part, ranks.most(part.cells.dimension()));
        // Which ranks number their vertices; whether any has ghosts.
        let numbers = part.global_vertices.as_deref().filter(|_| count > 0);
        let numbering = ranks.least(if numbers.is_some() { rank } else { usize::MAX });
        let by_number = numbering < usize::MAX;
        let fault = (by_number && numbers.is_none() && count > 0)
            .then_some(DistributedError::Numbers { other: numbering });
        agree(ranks, fault.map_or(Ok(()), Err))?;
        let ghosts = (0..part.cells.len()).any(|cell| !part.is_own(cell));
        let lower = (0..count).any(|vertex| held[vertex] == Held::Lower);
        let may_lie_inside = ranks.any(ghosts || lower);

        let mut candidates = candidates(part, outer, &held, may_lie_inside);
        if !by_number && doubt == Doubt::Refused {
            let spare = spare(part);
            candidates.retain(|&(vertex, _)| !spare[vertex as usize]);
        }
        if doubt == Doubt::Apart {
            // A vertex of no cell, as those that finer grids cover, is not shown: it casts no doubt
            // on others. Points alone, such as particles, are each their own, wherever they are.
            let connected = part.cells.iter().filter(|(cell_type, _)| cell_type.dimension() > 0);
            let used = marks(count, connected.flat_map(|(_, vertices)| vertices));
            candidates.retain(|&(vertex, _)| used[vertex as usize]);
        }
        let twins = match (by_number, numbers) {
            (true, numbers) => {
                positions::by_number(ranks, numbers.unwrap_or_default(), &candidates)
            }
            (false, _) => positions::by_position(ranks, part, &candidates, tolerance, doubt),
        };
        let twins = agree(ranks, twins)?;
        let mut owners = vec![index(rank); count];
        for (vertex, twins) in &twins {
            let own = (held[*vertex as usize], owners[*vertex as usize]);
            let best =
                twins.iter().map(|twin| (twin.held, twin.rank)).fold(own, std::cmp::Ord::min);
            owners[*vertex as usize] = best.1;
        }
        let owned = owners.iter().filter(|&&owner| owner as usize == rank).count();
        let total = ranks.total(owned) as u64;
        if total >= u64::from(u32::MAX) {
            return Err(DistributedError::TooLarge { vertices: total });
        }
        let short: Option<Vec<u32>> =
            numbers.unwrap_or_default().iter().map(|&id| u32::try_from(id).ok()).collect();
        let numbers = match short.filter(|short| short.iter().all(|&number| number < u32::MAX)) {
            short if by_number && ranks.all(short.is_some()) => short.unwrap_or_default(),
            _ => consecutive(ranks, &owners, owned, &twins)?,
        };
        let halo = halo(communicator, &twins, &numbers, &owners);
        Ok(Self { owners, numbers, owned, count: total, halo })
    }

    /// A mesh that one process has as a whole.
    fn alone(communicator: &Arc<dyn Communicator>, part: &Part) -> Result<Self, DistributedError> {
        let count = part.points.len();
        let (owners, halo) = (vec![0; count], Halo::alone(Arc::clone(communicator)));
        let number = |number: u64| u32::try_from(number).ok();
        let given: Option<Vec<u32>> = part
            .global_vertices
            .as_ref()
            .and_then(|ids| ids.iter().map(|&id| number(id)).collect());
        let vertices = count as u64;
        if vertices >= u64::from(u32::MAX) {
            return Err(DistributedError::TooLarge { vertices });
        }
        let numbers = given.unwrap_or_else(|| (0..index(count)).collect());
        Ok(Self { owners, numbers, owned: count, count: vertices, halo })
    }
}

/// What the rank has of its own around each vertex of a mesh of this dimension.
fn held(part: &Part, dimension: usize) -> Vec<Held> {
    let mut held = vec![Held::Nothing; part.points.len()];
    for (cell, (cell_type, vertices)) in part.cells.iter().enumerate() {
        if part.is_own(cell) {
            let is_whole = cell_type.dimension() == dimension;
            let of_cell = if is_whole { Held::Whole } else { Held::Lower };
            for &vertex in vertices {
                let known = &mut held[vertex as usize];
                *known = of_cell.min(*known);
            }
        }
    }
    held
}

/// For each vertex whether it is one of several that lie at one point and belong to no cell, as at
/// the end of an array that is longer than what is used of it. Such a vertex is shared with nobody.
fn spare(part: &Part) -> Vec<bool> {
    let used = marks(part.points.len(), part.cells.connectivity());
    let mut unused: Vec<([u64; 3], usize)> = (0..part.points.len())
        .filter(|&vertex| !used[vertex])
        .map(|vertex| (part.points[vertex].map(f64::to_bits), vertex))
        .collect();
    unused.sort_unstable();
    let mut spare = vec![false; part.points.len()];
    for same in unused.chunk_by(|a, b| a.0 == b.0).filter(|same| same.len() > 1) {
        same.iter().for_each(|&(_, vertex)| spare[vertex] = true);
    }
    spare
}

/// The vertices that other ranks may have. Where no rank has ghosts, or cells of a lower dimension
/// apart from those that they lie in, those are not inside the part: around a vertex of which
/// another rank has cells there is a face that has a cell here on one side only.
fn candidates(
    part: &Part,
    outer: &BoundaryFaces,
    held: &[Held],
    may_lie_inside: bool,
) -> Vec<Candidate> {
    let count = part.points.len();
    let mut inside = vec![false; count];
    if !may_lie_inside && part.cells.dimension() == 3 {
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
    let counts = communicator.gather_all(&(owned as u64).to_le_bytes());
    let before = (0..).zip(&counts).take(rank).map(|(from, count)| Reader::new(from, count).u64());
    let start: u64 = before.sum::<Result<u64, Garbled>>()?;
    let mut numbers = vec![u32::MAX; owners.len()];
    let owned = numbers.iter_mut().zip(owners).filter(|(_, owner)| **owner as usize == rank);
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
            *numbers.get_mut(vertex as usize).ok_or(Garbled { rank: from })? = number;
        }
    }
    Ok(numbers)
}

fn halo(
    communicator: &Arc<dyn Communicator>,
    twins: &Twins,
    numbers: &[u32],
    owners: &[u32],
) -> Halo {
    let mut by_rank: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for (vertex, twins) in twins {
        twins.iter().for_each(|twin| by_rank.entry(twin.rank).or_default().push(*vertex));
    }
    let with = |(rank, mut vertices): (u32, Vec<u32>)| {
        vertices.sort_unstable_by_key(|&vertex| numbers[vertex as usize]);
        let shared =
            vertices.into_iter().map(|vertex| (vertex, owners[vertex as usize] == rank)).collect();
        (rank as usize, shared)
    };
    let rank = communicator.rank();
    let owned = owners.iter().map(|&owner| owner as usize == rank).collect();
    Halo::new(Arc::clone(communicator), by_rank.into_iter().map(with).collect(), owned)
}
