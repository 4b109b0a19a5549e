//! A mesh dealt out to ranks.

use std::sync::Arc;

use tombolo_deform::communicator::{Communicator, Reduction, agree};
use tombolo_deform::distributed::{DistributedError, Part};
use tombolo_deform::mesh::{Cells, Mesh, MeshError, SharedVertices, Vector};
use tombolo_deform::quality::quality;
use tombolo_deform::surface::Surface;

use crate::Patch;
use crate::partition::{PartitionError, partition};
use crate::report::MeshReport;

/// How a mesh is dealt out to ranks; the answer does not depend on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Dealing {
    /// A rank that gets nothing of the mesh.
    pub empty_rank: Option<usize>,
    /// Numbers the vertices and cells of each part at random, from this seed.
    pub shuffle: Option<u64>,
    /// Keeps from the adaptor which vertices of the ranks are the same, so that it must find out by
    /// their places.
    pub without_numbers: bool,
}

/// Why a mesh cannot be dealt out.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DealError {
    /// It cannot be cut.
    #[error(transparent)]
    Partition(#[from] PartitionError),
    /// There is no such rank, or no other.
    #[error("rank {rank} cannot be left empty; expected one of several, below {ranks}")]
    EmptyRank {
        /// The rank.
        rank: usize,
        /// How many there are.
        ranks: usize,
    },
    /// A part makes no mesh.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}

/// One rank's share of a mesh, and how it hangs together with the others.
#[derive(Debug)]
pub struct Share {
    /// Its part: its own cells, and the others' that touch one of them.
    pub part: Part,
    /// The part as a mesh of its own.
    pub mesh: Mesh,
    /// Which vertices other ranks have too.
    pub shared: SharedVertices,
    own: Cells,
    without_numbers: bool,
}

impl Share {
    /// Cuts a mesh, which every rank has read, and finds out what the ranks have in common.
    /// Collective. `patches` hold the triangles of the whole boundary in the numbers of `mesh`;
    /// what comes back are those of this part, in its own.
    ///
    /// # Errors
    /// [`DistributedError`], the same on all ranks.
    pub fn of(
        communicator: &Arc<dyn Communicator>,
        mesh: &Mesh,
        surface: &Surface,
        patches: Vec<Patch>,
        dealing: Dealing,
    ) -> Result<(Self, Vec<Patch>), DistributedError> {
        let (rank, ranks) = (communicator.rank(), communicator.size());
        if ranks == 1 {
            if let Some(rank) = dealing.empty_rank {
                agree(communicator, Err::<(), _>(DealError::EmptyRank { rank, ranks }))?;
            }
            let part = Part::of(&mesh.into())?;
            let shared = SharedVertices::find(communicator, &part)?;
            let own = part.cells.clone();
            return Ok((
                Self { mesh: mesh.clone(), part, shared, own, without_numbers: true },
                patches,
            ));
        }
        // One rank says who gets what, so that all are sure to mean the same.
        let dealt = if rank == 0 { deal(mesh, ranks, dealing) } else { Ok(Vec::new()) };
        let mut bytes: Vec<u8> = agree(communicator, dealt)?
            .into_iter()
            .flat_map(|rank| (rank as u64).to_le_bytes())
            .collect();
        communicator.broadcast(0, &mut bytes);
        let of_cells: Vec<usize> = bytes
            .as_chunks()
            .0
            .iter()
            .map(|eight| usize::try_from(u64::from_le_bytes(*eight)).unwrap_or(0))
            .collect();
        let cut = Part::cut(mesh, &of_cells, rank, true).map(|part| match dealing.shuffle {
            Some(seed) => part.shuffled(seed.wrapping_add(rank as u64)),
            None => part,
        });
        let made = cut.and_then(|part| Ok((part.view().to_mesh()?, part.own_cells(), part)));
        let (own_mesh, own, part) = agree(communicator, made)?;
        let shared = SharedVertices::find(communicator, &part)?;
        let patches = own_patches(&part, surface, mesh, patches);
        let without_numbers = dealing.without_numbers;
        Ok((Self { mesh: own_mesh, part, shared, own, without_numbers }, patches))
    }

    /// The part as the adaptor sees it, at other coordinates.
    #[must_use]
    pub fn view<'a>(&'a self, points: &'a [Vector]) -> tombolo_deform::mesh::MeshView<'a> {
        use tombolo_deform::mesh::ArrayView;
        let mut view = self.part.view();
        view.points = ArrayView::vectors(points);
        if self.without_numbers {
            view.global_vertices = None;
            view.global_cells = None;
        }
        view
    }

    /// The whole mesh at this shape. Collective.
    #[must_use]
    pub fn measure(&self, communicator: &dyn Communicator, points: &[Vector]) -> MeshReport {
        let shape = quality(&self.own, points);
        let (cells, inverted) =
            (communicator.total(self.own.len()), communicator.total(shape.inverted));
        let least = if self.own.is_empty() { f64::INFINITY } else { shape.min };
        let least = communicator.reduced(Reduction::Minimum, least);
        let vertices = usize::try_from(self.shared.count()).unwrap_or(usize::MAX);
        MeshReport { vertices, cells, inverted, min_scaled_jacobian: least }
    }

    /// Brings what the ranks have at their vertices together on rank 0, where it takes the place of
    /// `all`, in the numbers of the mesh that was dealt out. Collective; `None` on the other ranks.
    #[must_use]
    pub fn gather(
        &self,
        communicator: &dyn Communicator,
        values: &[Vector],
        mut all: Vec<Vector>,
    ) -> Option<Vec<Vector>> {
        if communicator.size() == 1 {
            return Some(values.to_vec());
        }
        let numbers = self.part.global_vertices.as_deref().unwrap_or_default();
        let mut message = Vec::new();
        for ((vertex, value), number) in (0..).zip(values).zip(numbers) {
            if self.shared.owns(vertex) {
                message.extend(number.to_le_bytes());
                value.iter().for_each(|value| message.extend(value.to_le_bytes()));
            }
        }
        let gathered = communicator.gather(0, &message)?;
        for entry in gathered.iter().flat_map(|message| message.as_chunks::<32>().0) {
            let [number, value @ ..] = [0, 1, 2, 3]
                .map(|index: usize| std::array::from_fn(|byte| entry[8 * index + byte]));
            let number = u64::from_le_bytes(number);
            if let Some(place) = usize::try_from(number).ok().and_then(|number| all.get_mut(number))
            {
                *place = value.map(f64::from_le_bytes);
            }
        }
        Some(all)
    }
}

/// The rank of each cell.
fn deal(mesh: &Mesh, ranks: usize, dealing: Dealing) -> Result<Vec<usize>, DealError> {
    let Some(empty) = dealing.empty_rank else { return Ok(partition(mesh, ranks)?) };
    if empty >= ranks || ranks == 1 {
        return Err(DealError::EmptyRank { rank: empty, ranks });
    }
    Ok(partition(mesh, ranks - 1)?
        .into_iter()
        .map(|rank| rank + usize::from(rank >= empty))
        .collect())
}

/// The triangles of the whole boundary that belong to a cell of the part, in the part's numbers.
fn own_patches(part: &Part, surface: &Surface, mesh: &Mesh, patches: Vec<Patch>) -> Vec<Patch> {
    let mut numbers = vec![u32::MAX; mesh.points().len()];
    for (number, &vertex) in (0..).zip(part.global_vertices.iter().flatten()) {
        numbers[usize::try_from(vertex).unwrap_or_default()] = number;
    }
    let mut has_cell = vec![false; mesh.cells().len()];
    for &cell in part.global_cells.iter().flatten() {
        has_cell[usize::try_from(cell).unwrap_or_default()] = true;
    }
    // The corners of a triangle, sorted, of those whose cell is here.
    let here: std::collections::HashSet<[u32; 3]> = surface
        .triangles()
        .iter()
        .zip(surface.triangle_faces())
        .filter(|(_, face)| has_cell[surface.owner_cells()[**face as usize] as usize])
        .map(|(triangle, _)| sorted(triangle.map(|vertex| surface.vertices()[vertex as usize])))
        .collect();
    let own = |patch: Patch| {
        let triangles =
            patch.triangles.iter().filter(|triangle| here.contains(&sorted(**triangle)));
        let triangles =
            triangles.map(|triangle| triangle.map(|vertex| numbers[vertex as usize])).collect();
        Patch { triangles, ..patch }
    };
    patches.into_iter().map(own).collect()
}

fn sorted(mut triangle: [u32; 3]) -> [u32; 3] {
    triangle.sort_unstable();
    triangle
}

/// A communicator that several parts of a run share.
pub type Ranks = Arc<dyn Communicator>;
