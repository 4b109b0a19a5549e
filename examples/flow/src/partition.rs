//! Which rank gets which cell.

use tombolo_deform::mesh::{Mesh, Vector};

/// Why a mesh cannot be cut.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PartitionError {
    /// METIS gave up.
    #[error("METIS cannot partition the mesh: {0}")]
    Metis(String),
}

/// The rank of each cell, for `ranks` ranks: by METIS, with as few faces between parts as it can
/// find.
///
/// # Errors
/// [`PartitionError::Metis`].
#[cfg(feature = "distributed")]
pub fn partition(mesh: &Mesh, ranks: usize) -> Result<Vec<usize>, PartitionError> {
    let cells = mesh.cells();
    // METIS divides by what a part gets, and has nothing to do for one.
    if ranks <= 1 || cells.len() < 8 * ranks {
        return Ok(bisected(mesh, ranks));
    }
    let failed = |error: &dyn std::fmt::Display| PartitionError::Metis(error.to_string());
    let number = |value: usize| metis::Idx::try_from(value).map_err(|error| failed(&error));
    let starts = cells.offsets().map(number).collect::<Result<Vec<_>, _>>()?;
    let vertices = cells
        .connectivity()
        .iter()
        .map(|&vertex| number(vertex as usize))
        .collect::<Result<Vec<_>, _>>()?;
    // Cells are neighbours where they share a face.
    let mut dual = metis::mesh_to_dual(&starts, &vertices, 3).map_err(|error| failed(&error))?;
    let (neighbours_starts, neighbours) = dual.as_mut();
    let mut of_cells = vec![0; cells.len()];
    metis::Graph::new(1, number(ranks)?, neighbours_starts, neighbours)
        .map_err(|error| failed(&error))?
        .set_option(metis::option::Seed(1))
        .part_kway(&mut of_cells)
        .map_err(|error| failed(&error))?;
    Ok(of_cells.into_iter().map(|rank| usize::try_from(rank).unwrap_or(0)).collect())
}

/// The rank of each cell, for `ranks` ranks: by recursive bisection of the cells' centres along the
/// longest extent (Berger and Bokhari 1987).
///
/// # Errors
/// None.
#[cfg(not(feature = "distributed"))]
pub fn partition(mesh: &Mesh, ranks: usize) -> Result<Vec<usize>, PartitionError> {
    Ok(bisected(mesh, ranks))
}

fn bisected(mesh: &Mesh, ranks: usize) -> Vec<usize> {
    let cells = mesh.cells();
    let centre = |cell: usize| -> Vector {
        let vertices = cells.vertices(cell);
        let sum = |axis: usize| {
            vertices.iter().map(|&vertex| mesh.points()[vertex as usize][axis]).sum::<f64>()
        };
        [0, 1, 2].map(|axis: usize| sum(axis) / vertices.len().max(1) as f64)
    };
    let mut centres: Vec<(Vector, usize)> =
        (0..cells.len()).map(|cell| (centre(cell), cell)).collect();
    let mut of_cells = vec![0; cells.len()];
    bisect(&mut centres, 0, ranks, &mut of_cells);
    of_cells
}

fn bisect(centres: &mut [(Vector, usize)], first: usize, ranks: usize, of_cells: &mut [usize]) {
    if ranks <= 1 {
        centres.iter().for_each(|&(_, cell)| of_cells[cell] = first);
        return;
    }
    let extent = |axis: usize| {
        let values = || centres.iter().map(|(centre, _)| centre[axis]);
        values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min)
    };
    let axis = (0..3).max_by(|&a, &b| extent(a).total_cmp(&extent(b))).unwrap_or(0);
    let half = ranks / 2;
    let middle = centres.len() * half / ranks;
    centres.sort_unstable_by(|a, b| a.0[axis].total_cmp(&b.0[axis]).then(a.1.cmp(&b.1)));
    let (low, high) = centres.split_at_mut(middle);
    bisect(low, first, half, of_cells);
    bisect(high, first + half, ranks - half, of_cells);
}
