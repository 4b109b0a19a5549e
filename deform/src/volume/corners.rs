//! The tetrahedra at the corners of cells, by which these are held to be valid.

use super::foldover;
use crate::mesh::cell_geometry::{
    HEXAHEDRON_CORNERS, PYRAMID_CORNERS, VOXEL_AS_HEXAHEDRON, WEDGE_CORNERS, tet_determinant,
};
use crate::mesh::{CellType, Mesh, Vector};
use crate::number::index;
use crate::vector::{add, cross, scale, subtract};

/// A tetrahedron at a corner of a cell.
#[derive(Debug, Clone, Copy)]
pub(super) struct Corner {
    pub(super) vertices: [u32; 4],
    pub(super) cell: u32,
    /// The gradients of its linear shape functions in the reference.
    pub(super) gradients: [Vector; 4],
}

impl Corner {
    /// `None` where it is flat or inverted in the reference.
    fn new(cell: usize, vertices: [u32; 4], points: &[Vector]) -> Option<Self> {
        let [p, q, r, s] = vertices.map(|vertex| points[vertex as usize]);
        let (u, v, w) = (subtract(q, p), subtract(r, p), subtract(s, p));
        let determinant = tet_determinant([p, q, r, s]);
        (determinant > 0.0).then(|| {
            let [g, h, k] =
                [cross(v, w), cross(w, u), cross(u, v)].map(|face| scale(face, 1.0 / determinant));
            Corner {
                vertices,
                cell: index(cell),
                gradients: [scale(add(add(g, h), k), -1.0), g, h, k],
            }
        })
    }

    /// The gradient of the map from the reference.
    #[inline]
    pub(super) fn jacobian(&self, points: &[Vector]) -> [Vector; 3] {
        foldover::jacobian(self.vertices.map(|vertex| points[vertex as usize]), &self.gradients)
    }
}

/// The corners of the cells, each right-handed in a valid mesh; those flat in the reference are
/// left out.
pub(super) fn corners(mesh: &Mesh) -> Vec<Corner> {
    let mut corners = Vec::with_capacity(mesh.cells().len());
    for_each_corner_of(mesh, |corner| corners.push(corner));
    corners
}

/// Visits the corners of the cells in their order, without those flat in the reference.
pub(super) fn for_each_corner_of(mesh: &Mesh, mut visit: impl FnMut(Corner)) {
    for (cell, (cell_type, vertices)) in mesh.cells().iter().enumerate() {
        for_each_corner(cell_type, |local| {
            let corner = Corner::new(cell, local.map(|index| vertices[index]), mesh.points());
            corner.into_iter().for_each(&mut visit);
        });
    }
}

/// Whether cells of this type have corners.
pub(super) fn has_corners(cell_type: CellType) -> bool {
    let mut found = false;
    for_each_corner(cell_type, |_| found = true);
    found
}

/// For each edge of hexahedra, and each edge between the triangles of wedges, the two tetrahedra of
/// the edge, a neighbour of one of its ends and the other neighbour of the other end.
///
/// With `h` the edge, `u` and `v` the other edges at its two ends, the determinant of the cell's
/// map is along the edge the polynomial with the Bernstein coefficients `det(u₀ v₀ h)`, `½ (det(u₀
/// v₁ h) + det(u₁ v₀ h))` and `det(u₁ v₁ h)`. The first and the last belong to the corners, the
/// terms of the one between to these.
pub(super) fn edges(mesh: &Mesh, cell: usize, edges: &mut Vec<Corner>) {
    let (cell_type, vertices) = (mesh.cells().cell_type(cell), mesh.cells().vertices(cell));
    let mut corners: Vec<[usize; 4]> = Vec::with_capacity(8);
    for_each_corner(cell_type, |local| corners.push(local));
    // With one of the neighbours last.
    let turned = |[a, x, y, z]: [usize; 4]| [[a, x, y, z], [a, y, z, x], [a, z, x, y]];
    for [a, x, y, b] in corners.iter().flat_map(|&corner| turned(corner)) {
        let other = corners
            .iter()
            .flat_map(|&corner| turned(corner))
            .find(|other| other[0] == b && other[3] == a);
        // Seen from the other end, what came first comes second.
        let Some([_, across_y, across_x, _]) = other.filter(|_| a < b) else { continue };
        if across_x != x && across_y != y {
            for tetrahedron in [[a, x, across_y, b], [a, across_x, y, b]] {
                edges.extend(Corner::new(
                    cell,
                    tetrahedron.map(|index| vertices[index]),
                    mesh.points(),
                ));
            }
        }
    }
}

fn for_each_corner(cell_type: CellType, mut visit: impl FnMut([usize; 4])) {
    match cell_type {
        CellType::Tetra => visit([0, 1, 2, 3]),
        CellType::Hexahedron => HEXAHEDRON_CORNERS.into_iter().for_each(visit),
        CellType::Voxel => {
            HEXAHEDRON_CORNERS
                .into_iter()
                .for_each(|corner| visit(corner.map(|local| VOXEL_AS_HEXAHEDRON[local])));
        }
        CellType::Wedge => WEDGE_CORNERS.into_iter().for_each(visit),
        CellType::Pyramid => PYRAMID_CORNERS.into_iter().for_each(visit),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes;

    /// All of them right-handed, so that none is left out, and no larger than the cell.
    #[test]
    fn tetrahedra_of_a_cell_are_right_handed() {
        for (cell_type, at_corners, at_edges) in [
            (CellType::Tetra, 1, 0),
            (CellType::Pyramid, 4, 0),
            (CellType::Wedge, 6, 6),
            (CellType::Hexahedron, 8, 24),
            (CellType::Voxel, 8, 24),
        ] {
            let mesh = shapes::single_cell(cell_type);
            let mut found = Vec::new();
            edges(&mesh, 0, &mut found);
            assert_eq!((corners(&mesh).len(), found.len()), (at_corners, at_edges), "{cell_type}");
        }
    }
}
