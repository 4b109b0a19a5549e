//! The corners by which cells are judged.

use crate::mesh::cell_geometry::{
    HEXAHEDRON_CORNERS, PYRAMID_CORNERS, VOXEL_AS_HEXAHEDRON, WEDGE_CORNERS, tet_determinant,
};
use crate::mesh::{CellType, Mesh};
use crate::quality::scaled_jacobians;
use crate::volume::barrier::Simplex;

/// The corners whose least is the quality of their cell. Vertices of cells that have none are taken
/// out of `free`.
pub(super) fn simplices(mesh: &Mesh, free: &mut [bool]) -> Vec<Simplex> {
    let (cells, points) = (mesh.cells(), mesh.points());
    let reference = scaled_jacobians(cells, points);
    let mut simplices = Vec::with_capacity(cells.len());
    for ((cell_type, vertices), &scaled) in cells.iter().zip(&reference) {
        let root = std::f64::consts::SQRT_2;
        let (corners, regular, whole): (&[[usize; 4]], f64, bool) = match cell_type {
            CellType::Tetra => (&[[0, 1, 2, 3]], root, true),
            CellType::Hexahedron | CellType::Voxel => (&HEXAHEDRON_CORNERS, 1.0, false),
            CellType::Wedge => (&WEDGE_CORNERS, 2.0 / 3.0f64.sqrt(), false),
            CellType::Pyramid => (&PYRAMID_CORNERS, 2.0, true),
            _ => (&[], 0.0, false),
        };
        let from = simplices.len();
        for corner in corners {
            let local = if cell_type == CellType::Voxel {
                corner.map(|local| VOXEL_AS_HEXAHEDRON[local])
            } else {
                *corner
            };
            let vertices = local.map(|index| vertices[index]);
            if tet_determinant(vertices.map(|vertex| points[vertex as usize])) > 0.0 {
                simplices.push(Simplex { vertices, factor: regular / scaled, whole });
            }
        }
        let known = simplices.len() - from == corners.len() && !corners.is_empty() && scaled > 0.0;
        if !known && cell_type.dimension() == 3 {
            simplices.truncate(from);
            vertices.iter().for_each(|&vertex| free[vertex as usize] = false);
        }
    }
    simplices
}
