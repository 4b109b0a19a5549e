//! The handedness of the cells of a mesh of which each rank has a part.

use super::DistributedError;
use crate::communicator::{Communicator, Reduction};
use crate::mesh::{CellType, Cells, Vector};

/// Refuses a mesh whose cells of one type are left-handed on one rank and right-handed on another:
/// each rank has turned its own, and on one process the mesh would not be sound. Collective.
pub(super) fn check(
    communicator: &dyn Communicator,
    cells: &Cells,
    points: &[Vector],
) -> Result<(), DistributedError> {
    let given = cells.given_hands(points);
    let rank = communicator.rank() as u64;
    let of_type =
        |types: &Vec<CellType>, cell_type| if types.contains(&cell_type) { rank } else { u64::MAX };
    let mut lowest =
        CellType::ALL.map(|cell_type| given.each_ref().map(|types| of_type(types, cell_type)));
    communicator.reduce_integers(Reduction::Minimum, lowest.as_flattened_mut());
    let mixed = CellType::ALL.into_iter().zip(lowest).find(|(_, ranks)| !ranks.contains(&u64::MAX));
    mixed.map_or(Ok(()), |(cell_type, ranks)| {
        let [left, right] = ranks.map(|rank| usize::try_from(rank).unwrap_or(usize::MAX));
        Err(DistributedError::Hands { cell_type, left, right })
    })
}
