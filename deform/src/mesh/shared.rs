//! The vertices that several ranks have.

use crate::communicator::Halo;
use crate::number::index;
use crate::topology::Groups;

/// Which vertices of a part other ranks have too, who owns each vertex, and its number in the whole
/// mesh.
///
/// Each vertex has one owner: of the ranks that have it in a cell of their own (no ghost), the
/// lowest. The numbers are the solver's global ones, where it gives them and 32 bits hold them;
/// else they count the vertices of rank 0, then those of rank 1, and so on, each with its owner.
///
/// ```
/// use std::sync::Arc;
/// use tombolo_deform::communicator::{Communicator, threads};
/// use tombolo_deform::{distributed::Part, mesh::SharedVertices, shapes::box_of_tets};
///
/// // Two boxes side by side, which have 9 vertices in common.
/// let shared = threads::run(2, |ranks| {
///     let x = ranks.rank() as f64;
///     let mesh = box_of_tets([2, 2, 2], [x, 0.0, 0.0], [x + 1.0, 1.0, 1.0]);
///     let part = Part { points: mesh.points().to_vec(), cells: mesh.cells().clone(), ..Part::default() };
///     SharedVertices::find(&(Arc::new(ranks) as Arc<dyn Communicator>), &part)
/// });
/// let shared = shared.into_iter().collect::<Result<Vec<_>, _>>()?;
/// assert_eq!(shared[0].halo().neighbours()[0].entries.len(), 9);
/// assert_eq!((shared[0].owned(), shared[1].owned(), shared[0].count()), (27, 18, 45));
/// # Ok::<(), tombolo_deform::distributed::DistributedError>(())
/// ```
#[derive(Debug, Clone)]
pub struct SharedVertices {
    pub(crate) owners: Vec<u32>,
    pub(crate) numbers: Vec<u32>,
    pub(crate) owned: usize,
    pub(crate) count: u64,
    pub(crate) halo: Halo,
}

impl SharedVertices {
    /// The rank that owns each vertex of the part.
    #[must_use]
    pub fn owners(&self) -> &[u32] {
        &self.owners
    }

    /// Whether this rank owns a vertex.
    #[must_use]
    pub fn owns(&self, vertex: u32) -> bool {
        self.halo.owns(vertex as usize)
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

    /// The vertices that other ranks have too: the indices are those of the part's vertices.
    #[must_use]
    pub fn halo(&self) -> &Halo {
        &self.halo
    }

    /// The other ranks that have each vertex, rising.
    pub(crate) fn sharers(&self) -> Groups<u32> {
        let ranks = self.halo.neighbours().iter().flat_map(|neighbour| {
            let rank = index(neighbour.rank);
            neighbour.entries.iter().map(move |&vertex| (vertex, rank))
        });
        Groups::new(self.owners.len(), ranks)
    }
}
