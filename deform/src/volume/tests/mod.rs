//! The volume operator against closed forms.

mod closed_forms;
mod input;
mod numbering;
mod sliding;
mod solvers;

use super::*;
use crate::linear::BuiltIn;
use crate::mesh::{Cells, FeatureSource, Mesh};
use crate::shapes;

const TIGHT: Deform = Deform {
    method: Method::Elasticity,
    stiffening: 0.0,
    poisson_ratio: 0.3,
    tolerance: 1e-13,
    improve: 0,
};

/// A number from -1 to 1 that looks random.
fn noise(seed: usize) -> f64 {
    let mixed = (seed as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    (mixed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

/// The vertices of the unit cube's surface.
pub(super) fn cube_boundary(mesh: &Mesh) -> Vec<u32> {
    let outside = |point: &Vector| point.iter().any(|&x| x == 0.0 || x == 1.0);
    (0..).zip(mesh.points()).filter(|(_, point)| outside(point)).map(|(vertex, _)| vertex).collect()
}

/// Moves every vertex inside the unit cube by up to `amount` along each axis.
fn jiggled(mesh: &Mesh, amount: f64) -> Mesh {
    let mut points = mesh.points().to_vec();
    for (vertex, point) in points.iter_mut().enumerate() {
        if point.iter().all(|&x| x > 0.0 && x < 1.0) {
            for (axis, value) in point.iter_mut().enumerate() {
                *value += amount * noise(3 * vertex + axis);
            }
        }
    }
    mesh.with_points(points).unwrap()
}

fn cube(count: usize) -> Mesh {
    shapes::box_of_tets([count; 3], [0.0; 3], [1.0; 3])
}

/// Hexahedra, wedges, pyramids and tetrahedra side by side.
fn mixed(count: usize) -> Mesh {
    mixed_of(
        count,
        &jiggled(&shapes::box_of_hexahedra([count; 3], [0.0; 3], [1.0; 3]), 0.15 / count as f64),
    )
}

fn mixed_of(count: usize, hexahedra: &Mesh) -> Mesh {
    let mut points = hexahedra.points().to_vec();
    let mut cells = Cells::new();
    for (cell, (_, vertices)) in hexahedra.cells().iter().enumerate() {
        let v: [u32; 8] = vertices.try_into().unwrap();
        let (i, j, k) = (cell % count, cell / count % count, cell / count / count);
        if i == 0 {
            cells.push(CellType::Wedge, &[v[0], v[1], v[2], v[4], v[5], v[6]]).unwrap();
            cells.push(CellType::Wedge, &[v[0], v[2], v[3], v[4], v[6], v[7]]).unwrap();
        } else if (i + j + k) % 2 == 0 {
            let centre = points.len() as u32;
            points.push(crate::mesh::cell_geometry::centroid(
                hexahedra.cells(),
                cell,
                hexahedra.points(),
            ));
            for face in CellType::Hexahedron.faces() {
                // Inwards, as the base of a pyramid whose apex is the centre.
                let base: Vec<u32> = face.iter().rev().map(|&local| v[local]).collect();
                let on_side =
                    |side: f64| base.iter().all(|&vertex| points[vertex as usize][0] == side);
                if on_side(1.0) {
                    cells.push(CellType::Tetra, &[base[0], base[1], base[2], centre]).unwrap();
                    cells.push(CellType::Tetra, &[base[0], base[2], base[3], centre]).unwrap();
                } else {
                    cells
                        .push(CellType::Pyramid, &[base[0], base[1], base[2], base[3], centre])
                        .unwrap();
                }
            }
        } else {
            cells.push(CellType::Hexahedron, &v).unwrap();
        }
    }
    Mesh::new(points, cells, FeatureSource::SharpEdges).unwrap()
}

fn polyhedra(count: usize) -> Mesh {
    polyhedra_of(&jiggled(
        &shapes::box_of_hexahedra([count; 3], [0.0; 3], [1.0; 3]),
        0.15 / count as f64,
    ))
}

fn polyhedra_of(hexahedra: &Mesh) -> Mesh {
    let mut cells = Cells::new();
    for cell in 0..hexahedra.cells().len() {
        let mut faces = Vec::new();
        hexahedra.cells().for_each_face(cell, |face| faces.push(face.to_vec()));
        cells.push_polyhedron(&faces).unwrap();
    }
    Mesh::new(hexahedra.points().to_vec(), cells, FeatureSource::SharpEdges).unwrap()
}

/// Each hexahedron of a box as two wedges.
fn wedges(count: usize) -> Mesh {
    let hexahedra = shapes::box_of_hexahedra([count; 3], [0.0; 3], [1.0; 3]);
    let mut cells = Cells::new();
    for (_, v) in hexahedra.cells().iter() {
        cells.push(CellType::Wedge, &[v[0], v[1], v[2], v[4], v[5], v[6]]).unwrap();
        cells.push(CellType::Wedge, &[v[0], v[2], v[3], v[4], v[6], v[7]]).unwrap();
    }
    Mesh::new(hexahedra.points().to_vec(), cells, FeatureSource::SharpEdges).unwrap()
}

/// Each hexahedron of a box as six pyramids about its centre.
fn pyramids(count: usize) -> Mesh {
    let hexahedra = shapes::box_of_hexahedra([count; 3], [0.0; 3], [1.0; 3]);
    let mut points = hexahedra.points().to_vec();
    let mut cells = Cells::new();
    for (cell, (_, v)) in hexahedra.cells().iter().enumerate() {
        let centre = points.len() as u32;
        points.push(crate::mesh::cell_geometry::centroid(
            hexahedra.cells(),
            cell,
            hexahedra.points(),
        ));
        for face in CellType::Hexahedron.faces() {
            let base: Vec<u32> = face.iter().rev().map(|&local| v[local]).collect();
            cells.push(CellType::Pyramid, &[base[0], base[1], base[2], base[3], centre]).unwrap();
        }
    }
    Mesh::new(points, cells, FeatureSource::SharpEdges).unwrap()
}

fn voxels(count: usize) -> Mesh {
    let hexahedra = shapes::box_of_hexahedra([count; 3], [0.0; 3], [1.0; 3]);
    let order = [0, 1, 3, 2, 4, 5, 7, 6];
    let connectivity =
        hexahedra.cells().iter().flat_map(|(_, v)| order.map(|local| v[local])).collect();
    let cells = Cells::uniform(CellType::Voxel, connectivity).unwrap();
    Mesh::new(hexahedra.points().to_vec(), cells, FeatureSource::SharpEdges).unwrap()
}

fn all_meshes() -> Vec<(&'static str, Mesh)> {
    let hexahedra = shapes::box_of_hexahedra([4; 3], [0.0; 3], [1.0; 3]);
    vec![
        ("tets", jiggled(&cube(4), 0.05)),
        ("hexahedra", jiggled(&hexahedra, 0.05)),
        ("voxels", voxels(4)),
        ("wedges", wedges(4)),
        ("pyramids", pyramids(4)),
        ("mixed", mixed(4)),
        ("polyhedra", polyhedra(4)),
    ]
}

/// The largest difference from `field` at any vertex, the field being prescribed on the boundary.
fn error_of(mesh: &Mesh, settings: &Deform, field: impl Fn(Vector) -> Vector) -> f64 {
    let boundary = cube_boundary(mesh);
    let operator = VolumeOperator::new(mesh, &boundary, settings).unwrap();
    let motion: Vec<Vector> =
        boundary.iter().map(|&vertex| field(mesh.points()[vertex as usize])).collect();
    let solution = operator.solve(&motion).unwrap();
    let difference = |(value, &point): (&Vector, &Vector)| {
        let exact = field(point);
        (0..3).map(|axis| (value[axis] - exact[axis]).abs()).fold(0.0, f64::max)
    };
    solution.displacement.iter().zip(mesh.points()).map(difference).fold(0.0, f64::max)
}

/// The faces of the unit cube that `slides` names by axis and side, as sliding vertices; all its
/// other boundary vertices.
fn split_boundary(mesh: &Mesh, slides: &[(usize, f64)]) -> (Vec<u32>, Vec<Sliding>) {
    let mut boundary = Vec::new();
    let mut sliding = Vec::new();
    for vertex in cube_boundary(mesh) {
        let point = mesh.points()[vertex as usize];
        let held = (0..3).any(|axis| {
            [0.0, 1.0].iter().any(|&side| point[axis] == side && !slides.contains(&(axis, side)))
        });
        if held {
            boundary.push(vertex);
            continue;
        }
        for &(axis, side) in slides.iter().filter(|(axis, side)| point[*axis] == *side) {
            let mut normal = [0.0; 3];
            normal[axis] = 2.0 * side - 1.0;
            sliding.push(Sliding { vertex, normal });
        }
    }
    (boundary, sliding)
}
