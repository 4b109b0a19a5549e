//! The domain that the parts of several ranks make.

use std::sync::Arc;

use super::{DistributedError, Part, PartBoundary, handedness};
use crate::communicator::{Communicator, agree};
use crate::features::FeatureSettings;
use crate::mesh::{Domain, FeatureSource, Mesh, MeshError};

/// The domain of which each rank has a part, and its boundary. The mesh of the domain has the
/// part's own cells of the whole mesh's dimension, volumes or faces, and all of its vertices.
/// Collective.
///
/// # Errors
/// [`DistributedError`], the same on all ranks.
pub fn domain(
    communicator: &Arc<dyn Communicator>,
    part: &Part,
    settings: &FeatureSettings,
) -> Result<(Domain, PartBoundary), DistributedError> {
    let (shared, boundary) = PartBoundary::find(communicator, part, settings)?;
    let dimension = communicator.most(part.cells.dimension()).max(2);
    let (mesh, own) = agree(communicator, own_mesh(part, dimension))?;
    // Its own cells alone may seem to be of the other hand than those beside them.
    handedness::check(&**communicator, mesh.cells(), mesh.points())?;
    let numbers = cell_numbers(&**communicator, part, &own);
    Ok((Domain::of_rank(mesh, &shared, numbers, boundary.faces().clone()), boundary))
}

/// The cells of a part that are its own and of this dimension, with all its vertices, and where they
/// stand among the part's cells.
fn own_mesh(part: &Part, dimension: usize) -> Result<(Mesh, Vec<usize>), MeshError> {
    let is_own =
        |cell: &usize| part.is_own(*cell) && part.cells.cell_type(*cell).dimension() == dimension;
    let own: Vec<usize> = (0..part.cells.len()).filter(is_own).collect();
    let cells = part.cells.subset(own.iter().copied());
    Ok((Mesh::new(part.points.clone(), cells, FeatureSource::SharpEdges)?, own))
}

/// The numbers in the whole mesh of a part's own cells: the solver's, else they count through the
/// ranks. Collective.
fn cell_numbers(communicator: &dyn Communicator, part: &Part, own: &[usize]) -> Vec<u64> {
    let counts = communicator.gather_all(&(part.cells.len() as u64).to_le_bytes()).concat();
    let counts = counts.as_chunks().0.iter().map(|count| u64::from_le_bytes(*count));
    let first: u64 = counts.take(communicator.rank()).sum();
    let number = |&cell: &usize| match &part.global_cells {
        Some(numbers) => numbers.get(cell).copied().unwrap_or(u64::MAX),
        None => first + cell as u64,
    };
    own.iter().map(number).collect()
}
