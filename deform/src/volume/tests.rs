//! The volume operator against closed forms.

mod numbering;

use proptest::prelude::*;

use super::*;
use crate::linear::{Cholesky, LinearError, LinearSolver, Multigrid, MultigridSettings, Tolerance};
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
fn cube_boundary(mesh: &Mesh) -> Vec<u32> {
    let outside = |point: &Vector| point.iter().any(|&x| x == 0.0 || x == 1.0);
    (0..).zip(mesh.points()).filter(|(_, point)| outside(point)).map(|(vertex, _)| vertex).collect()
}

/// The same mesh with every vertex inside the unit cube moved by up to `amount` along each axis.
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
            points.push(crate::quality::centroid(hexahedra.cells(), cell, hexahedra.points()));
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
        points.push(crate::quality::centroid(hexahedra.cells(), cell, hexahedra.points()));
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

#[test]
fn rigid_motions_are_exact_whatever_the_stiffening_and_tolerance() {
    for (name, mesh) in all_meshes() {
        for method in [Method::Elasticity, Method::Harmonic] {
            let settings = Deform { method, tolerance: 1e-2, ..Deform::default() };
            let error = error_of(&mesh, &settings, |_| [0.3, -2.0, 0.7]);
            assert!(error < 1e-9, "{name}, {method:?}: translation off by {error:e}");
        }
        let turn =
            |[x, y, z]: Vector| [0.2 * y - 0.1 * z, -0.2 * x + 0.4 * z + 1.0, 0.1 * x - 0.4 * y];
        let error = error_of(&mesh, &Deform { tolerance: 1e-2, ..Deform::default() }, turn);
        assert!(error < 1e-9, "{name}: rotation off by {error:e}");
    }
}

#[test]
fn linear_fields_are_reproduced() {
    let field = |[x, y, z]: Vector| {
        [0.3 * x - 0.2 * y + 0.1, 0.5 * y + 0.4 * z - 0.3 * x, -0.7 * z + 0.2 * x - y]
    };
    for (name, mesh) in all_meshes() {
        for method in [Method::Elasticity, Method::Harmonic] {
            let error = error_of(&mesh, &Deform { method, ..TIGHT }, field);
            assert!(error < 1e-9, "{name}, {method:?}: off by {error:e}");
        }
    }
}

/// Wedges whose first triangle faces outwards, as VTK's manual has it, give the same displacement as the others.
#[test]
fn wedges_of_either_order_are_the_same() {
    let mesh = mixed(4);
    let mut cells = Cells::new();
    for (cell_type, v) in mesh.cells().iter() {
        let swapped;
        let vertices = if cell_type == CellType::Wedge {
            swapped = [v[0], v[2], v[1], v[3], v[5], v[4]];
            &swapped[..]
        } else {
            v
        };
        cells.push(cell_type, vertices).unwrap();
    }
    let other = Mesh::new(mesh.points().to_vec(), cells, FeatureSource::SharpEdges).unwrap();
    let boundary = cube_boundary(&mesh);
    let motion: Vec<Vector> =
        boundary.iter().map(|&vertex| [noise(vertex as usize), 0.0, 1.0]).collect();
    let solve = |mesh| {
        VolumeOperator::new(mesh, &boundary, &TIGHT).unwrap().solve(&motion).unwrap().displacement
    };
    for (a, b) in solve(&mesh).iter().zip(solve(&other)) {
        assert!((0..3).all(|axis| (a[axis] - b[axis]).abs() < 1e-10));
    }
}

/// `b = exp(√2 x) sin y sin z` is harmonic; its value and gradient.
fn harmonic([x, y, z]: Vector) -> (f64, Vector) {
    let root = 2.0f64.sqrt();
    let e = (root * x).exp();
    (
        e * y.sin() * z.sin(),
        [root * e * y.sin() * z.sin(), e * y.cos() * z.sin(), e * y.sin() * z.cos()],
    )
}

fn check_second_order(settings: &Deform, field: impl Fn(Vector) -> Vector) {
    let hexahedra = |count: usize| shapes::box_of_hexahedra([count; 3], [0.0; 3], [1.0; 3]);
    let builds: [(&str, &dyn Fn(usize) -> Mesh); 7] = [
        ("tets", &cube),
        ("hexahedra", &hexahedra),
        ("voxels", &voxels),
        ("wedges", &wedges),
        ("pyramids", &pyramids),
        ("mixed", &|count| mixed_of(count, &hexahedra(count))),
        ("polyhedra", &|count| polyhedra_of(&hexahedra(count))),
    ];
    let orders: Vec<(&str, f64)> = builds
        .iter()
        .map(|(name, build)| {
            let errors = [8, 16].map(|count| error_of(&build(count), settings, &field));
            (*name, (errors[0] / errors[1]).log2())
        })
        .collect();
    assert!(orders.iter().all(|(_, order)| *order > 1.8), "{:?}: {orders:?}", settings.method);
}

#[test]
fn laplace_converges_with_order_two() {
    let settings = Deform { method: Method::Harmonic, ..TIGHT };
    check_second_order(&settings, |point| {
        [harmonic(point).0, 0.0, harmonic([point[1], point[2], point[0]]).0]
    });
}

/// A displacement without body force and with change of volume, after Papkovich and Neuber: `grad(z b) - 4 (1 - ν) b e_z`.
#[test]
fn elasticity_converges_with_order_two() {
    check_second_order(&TIGHT, |point| {
        let (b, gradient) = harmonic(point);
        let along = gradient.map(|value| point[2] * value);
        [along[0], along[1], along[2] + b - 4.0 * (1.0 - TIGHT.poisson_ratio) * b]
    });
}

/// With stiffening, a thin layer keeps more of its thickness than without.
#[test]
fn stiffening_protects_thin_cells() {
    let mesh = cube(8);
    let graded: Vec<Vector> = mesh.points().iter().map(|&[x, y, z]| [x, y, z * z * z]).collect();
    let mesh = mesh.with_points(graded).unwrap();
    let boundary = cube_boundary(&mesh);
    let press: Vec<Vector> = boundary
        .iter()
        .map(|&vertex| {
            let [x, y, z] = mesh.points()[vertex as usize];
            [0.0, 0.0, if z == 0.0 { 8.0 * x * (1.0 - x) * y * (1.0 - y) } else { 0.0 }]
        })
        .collect();
    // The height of the first layer over the middle of the floor, before: (1/8)³.
    let column = 4 + 9 * 4;
    let height = |stiffening: f64| {
        let settings = Deform { stiffening, ..Deform::default() };
        let solution =
            VolumeOperator::new(&mesh, &boundary, &settings).unwrap().solve(&press).unwrap();
        let top = column + 81;
        (1.0f64 / 512.0 + solution.displacement[top][2] - solution.displacement[column][2]) * 512.0
    };
    assert!(height(1.0) > height(0.0) + 0.05, "{} {}", height(0.0), height(1.0));
}

#[test]
fn no_motion_gives_exact_zeros_and_still_components_stay_still() {
    let mesh = jiggled(&cube(5), 0.03);
    let boundary = cube_boundary(&mesh);
    for method in [Method::Elasticity, Method::Harmonic] {
        let operator =
            VolumeOperator::new(&mesh, &boundary, &Deform { method, ..Deform::default() }).unwrap();
        let solution = operator.solve(&vec![[0.0; 3]; boundary.len()]).unwrap();
        assert!(solution.displacement.as_flattened().iter().all(|value| value.to_bits() == 0));
        assert_eq!(solution.iterations, 0);
    }
    let operator = VolumeOperator::new(
        &mesh,
        &boundary,
        &Deform { method: Method::Harmonic, ..Deform::default() },
    )
    .unwrap();
    let motion: Vec<Vector> =
        boundary.iter().map(|&vertex| [0.0, noise(vertex as usize), 0.0]).collect();
    let solution = operator.solve(&motion).unwrap();
    assert!(
        solution
            .displacement
            .iter()
            .all(|value| value[0].to_bits() == 0 && value[2].to_bits() == 0)
    );
    assert!(solution.displacement.iter().any(|value| value[1] != 0.0));
}

#[test]
fn prescribed_vertices_get_exactly_their_value_and_vertices_without_cells_stay() {
    let mesh = jiggled(&cube(4), 0.03);
    let mut points = mesh.points().to_vec();
    points.push([9.0; 3]);
    let mesh = Mesh::new(points, mesh.cells().clone(), FeatureSource::SharpEdges).unwrap();
    let mut boundary = cube_boundary(&mesh);
    boundary.reverse();
    let motion: Vec<Vector> = boundary
        .iter()
        .map(|&v| [noise(v as usize), noise(v as usize + 1000), 1e-3 * noise(v as usize + 2000)])
        .collect();
    let solution =
        VolumeOperator::new(&mesh, &boundary, &Deform::default()).unwrap().solve(&motion).unwrap();
    for (&vertex, value) in boundary.iter().zip(&motion) {
        assert_eq!(&solution.displacement[vertex as usize], value);
    }
    assert_eq!(solution.displacement[mesh.points().len() - 1], [0.0; 3]);
}

#[test]
fn a_surface_as_the_whole_domain_has_nothing_to_solve_for() {
    let mesh = shapes::plate([3, 3], [0.0; 2], [1.0; 2]);
    let boundary: Vec<u32> = (0..mesh.points().len() as u32).collect();
    let operator = VolumeOperator::new(&mesh, &boundary, &Deform::default()).unwrap();
    let motion: Vec<Vector> = boundary.iter().map(|&vertex| [noise(vertex as usize); 3]).collect();
    assert_eq!(operator.solve(&motion).unwrap().displacement, motion);
}

/// The faces of the unit cube that `slides` names by axis and side, as sliding vertices; all its other boundary vertices.
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

/// A bar that is pulled while its sides slide stretches evenly, and narrows nowhere.
#[test]
fn sliding_sides_follow_a_stretch() {
    let sides = [(1, 0.0), (1, 1.0), (2, 0.0), (2, 1.0)];
    for (name, mesh) in all_meshes() {
        for method in [Method::Elasticity, Method::Harmonic] {
            let (boundary, sliding) = split_boundary(&mesh, &sides);
            let settings = Deform { method, tolerance: 1e-12, ..TIGHT };
            let operator =
                VolumeOperator::with_sliding(&mesh, &boundary, &sliding, &settings).unwrap();
            let stretch = |point: Vector| [0.3 * point[0], 0.0, 0.0];
            let motion: Vec<Vector> =
                boundary.iter().map(|&v| stretch(mesh.points()[v as usize])).collect();
            let solution = operator.solve(&motion).unwrap();
            for (value, &point) in solution.displacement.iter().zip(mesh.points()) {
                let exact = stretch(point);
                assert!(
                    (0..3).all(|axis| (value[axis] - exact[axis]).abs() < 1e-9),
                    "{name}, {method:?}: {value:?}"
                );
            }
            for sliding in &sliding {
                let value = solution.displacement[sliding.vertex as usize];
                assert!(
                    crate::vector::dot(value, sliding.normal).abs() < 1e-14,
                    "{name}, {method:?}: {value:?}"
                );
            }
        }
    }
}

/// Sides that move are followed across, and every rigid motion of all of them is reproduced.
#[test]
fn sliding_sides_may_move() {
    let (mesh, sides) = (jiggled(&cube(6), 0.02), [(1, 0.0), (2, 1.0)]);
    let (boundary, sliding) = split_boundary(&mesh, &sides);
    let operator =
        VolumeOperator::with_sliding(&mesh, &boundary, &sliding, &Deform::default()).unwrap();
    let turn = |[x, y, z]: Vector| [0.2 * y - 0.1 * z, -0.2 * x + 0.4 * z + 1.0, 0.1 * x - 0.4 * y];
    let at = |vertex: u32| turn(mesh.points()[vertex as usize]);
    let motion: Vec<Vector> = boundary.iter().map(|&vertex| at(vertex)).collect();
    let sides: Vec<Vector> = sliding.iter().map(|sliding| at(sliding.vertex)).collect();
    let solution = operator.solve_sliding(&motion, &sides).unwrap();
    for (value, &point) in solution.displacement.iter().zip(mesh.points()) {
        let exact = turn(point);
        assert!((0..3).all(|axis| (value[axis] - exact[axis]).abs() < 1e-9), "{value:?} {exact:?}");
    }
    assert_eq!(
        operator.solve_sliding(&motion, &[]),
        Err(VolumeError::SlidingCount { found: 0, expected: sliding.len() })
    );
    let zero = [Sliding { vertex: sliding[0].vertex, normal: [0.0; 3] }];
    let error =
        VolumeOperator::with_sliding(&mesh, &boundary, &zero, &Deform::default()).unwrap_err();
    assert!(matches!(error, VolumeError::SlidingNormal { .. }), "{error}");
    let held = [Sliding { vertex: boundary[0], normal: [1.0; 3] }];
    let error =
        VolumeOperator::with_sliding(&mesh, &boundary, &held, &Deform::default()).unwrap_err();
    assert_eq!(error, VolumeError::BoundaryTwice { vertex: boundary[0] });
}

#[test]
fn an_updated_operator_is_that_of_the_moved_mesh() {
    let mesh = jiggled(&cube(10), 0.01);
    let boundary = cube_boundary(&mesh);
    let motion: Vec<Vector> =
        boundary.iter().map(|&vertex| [noise(vertex as usize), 0.0, 0.3]).collect();
    for method in [Method::Elasticity, Method::Harmonic] {
        let settings = Deform { method, tolerance: 1e-11, ..Deform::default() };
        let operator = VolumeOperator::new(&mesh, &boundary, &settings).unwrap();
        // Where nothing moved it is the same to the bit.
        assert_eq!(operator.updated(&mesh).unwrap().solve(&motion), operator.solve(&motion));
        let moved = jiggled(&mesh, 0.015);
        let fresh =
            VolumeOperator::new(&moved, &boundary, &settings).unwrap().solve(&motion).unwrap();
        let updated = operator.updated(&moved).unwrap().solve(&motion).unwrap();
        for (a, b) in fresh.displacement.iter().zip(&updated.displacement) {
            assert!((0..3).all(|axis| (a[axis] - b[axis]).abs() < 1e-8), "{a:?} {b:?}");
        }
        assert_eq!(operator.updated(&cube(9)).unwrap_err(), VolumeError::OtherCells);
    }
}

/// Cells whose volumes differ by a factor of more than 10⁸.
#[test]
fn a_nearly_degenerate_mesh_is_solved() {
    let mesh = cube(12);
    let squeeze = |z: f64| if z > 0.0 && z < 1.0 { z.powi(8) } else { z };
    let points: Vec<Vector> = mesh.points().iter().map(|&[x, y, z]| [x, y, squeeze(z)]).collect();
    let mesh = mesh.with_points(points).unwrap();
    let volumes = crate::quality::scaled_jacobians(mesh.cells(), mesh.points());
    assert!(volumes.iter().all(|&value| value > 0.0));
    let ratio = (1.0 - (11.0f64 / 12.0).powi(8)) / (1.0f64 / 12.0).powi(8);
    assert!(ratio > 1e8, "{ratio:e}");
    let field = |[x, y, z]: Vector| [0.3 * x - 0.2 * y, 0.5 * y + 0.4 * z, 0.2 * x - 0.7 * z];
    let boundary = cube_boundary(&mesh);
    let motion: Vec<Vector> =
        boundary.iter().map(|&vertex| field(mesh.points()[vertex as usize])).collect();
    for method in [Method::Elasticity, Method::Harmonic] {
        let error = error_of(&mesh, &Deform { method, tolerance: 1e-10, ..TIGHT }, field);
        assert!(error < 1e-4, "{method:?}: off by {error:e}");
        // With stiffness in proportion to the volumes' inverse as well: a residual is all that can be asked for.
        let settings = Deform { method, tolerance: 1e-12, ..Deform::default() };
        let solution =
            VolumeOperator::new(&mesh, &boundary, &settings).unwrap().solve(&motion).unwrap();
        assert!(solution.residual <= 1e-12, "{method:?}: {:e}", solution.residual);
    }
}

/// Where stiffness differs by many orders of magnitude, the residual tells of the stiff cells alone: the solvers must not stop
/// before the soft ones are right as well. Volumes differ by a factor of more than 2.6e9.
#[test]
fn soft_cells_beside_stiff_ones_are_as_exact_as_was_asked_for() {
    let mesh = cube(12);
    let squeeze = |z: f64| if z > 0.0 && z < 1.0 { z.powi(9) } else { z };
    let mesh = mesh
        .with_points(mesh.points().iter().map(|&[x, y, z]| [x, y, squeeze(z)]).collect())
        .unwrap();
    let boundary = cube_boundary(&mesh);
    let bend = |[x, y, z]: Vector| [0.3 * (3.0 * z).sin() * x, 0.2 * x * y, 0.1 * x * x - 0.2 * z];
    let motion: Vec<Vector> =
        boundary.iter().map(|&vertex| bend(mesh.points()[vertex as usize])).collect();
    let operator =
        VolumeOperator::new(&mesh, &boundary, &Deform { stiffening: 1.0, ..Deform::default() })
            .unwrap();
    let (matrix, right_side) = operator.coupled_equations(&motion).unwrap();
    let tight = Tolerance { relative: 1e-13, absolute: 0.0 };
    let mut exact = vec![[0.0; 3]; right_side.len()];
    Cholesky::new(matrix.clone()).unwrap().solve(&right_side, &mut exact, tight).unwrap();
    let largest = exact.as_flattened().iter().fold(0.0, |most: f64, value| most.max(value.abs()));
    let asked = Tolerance { relative: 1e-6, absolute: 0.0 };
    let solvers: [Box<dyn LinearSolver<3>>; 2] = [
        Box::new(Multigrid::new(matrix.clone(), MultigridSettings::default()).unwrap()),
        Box::new(
            Multigrid::with_rigid_bodies(
                matrix.clone(),
                operator.unknown_points(),
                MultigridSettings::default(),
            )
            .unwrap(),
        ),
    ];
    for solver in &solvers {
        let mut solution = vec![[0.0; 3]; right_side.len()];
        let convergence = solver.solve(&right_side, &mut solution, asked).unwrap();
        let error =
            solution.as_flattened().iter().zip(exact.as_flattened()).map(|(a, b)| (a - b).abs());
        let error = error.fold(0.0, f64::max) / largest;
        assert!(error < 1e-4, "off by {error:e} after {convergence:?}");
    }
}

/// A slender bar that is held at one end alone bends as bodies do.
#[test]
fn rigid_bodies_save_iterations_where_little_is_held() {
    let mesh = shapes::box_of_tets([48, 6, 6], [0.0; 3], [1.0, 0.12, 0.12]);
    let end: Vec<u32> =
        (0..).zip(mesh.points()).filter(|(_, p)| p[0] == 0.0).map(|(vertex, _)| vertex).collect();
    let operator = VolumeOperator::new(&mesh, &end, &TIGHT).unwrap();
    let (matrix, _) = operator.coupled_equations(&vec![[0.0; 3]; end.len()]).unwrap();
    let weight = vec![[0.0, 0.0, -1.0]; matrix.rows()];
    let tolerance = Tolerance { relative: 1e-8, absolute: 0.0 };
    let settings = MultigridSettings::default();
    let plain = Multigrid::new(matrix.clone(), settings).unwrap();
    let bodies =
        Multigrid::with_rigid_bodies(matrix.clone(), operator.unknown_points(), settings).unwrap();
    let [(plain, first), (bodies, second)] = [plain, bodies].map(|solver| {
        let mut solution = vec![[0.0; 3]; weight.len()];
        let convergence = solver.solve(&weight, &mut solution, tolerance).unwrap();
        (solution, convergence.iterations)
    });
    assert!(3 * second < 2 * first, "{second} iterations with rigid bodies, {first} without");
    let largest = plain.as_flattened().iter().fold(0.0, |most: f64, value| most.max(value.abs()));
    for (a, b) in plain.as_flattened().iter().zip(bodies.as_flattened()) {
        assert!((a - b).abs() < 1e-5 * largest);
    }
    let error = Multigrid::with_rigid_bodies(matrix.clone(), vec![[0.0; 3]], settings).unwrap_err();
    assert_eq!(error, LinearError::Places { found: 1, expected: matrix.rows(), block: 3 });
}

#[test]
fn a_solve_from_a_like_motion_is_shorter() {
    let mesh = jiggled(&cube(14), 0.01);
    let boundary = cube_boundary(&mesh);
    let motion = |amount: f64| -> Vec<Vector> {
        boundary
            .iter()
            .map(|&v| mesh.points()[v as usize].map(|x| amount * (4.0 * x).sin()))
            .collect()
    };
    for method in [Method::Elasticity, Method::Harmonic] {
        let operator =
            VolumeOperator::new(&mesh, &boundary, &Deform { method, ..Deform::default() }).unwrap();
        let like = operator.solve(&motion(0.1)).unwrap();
        let fresh = operator.solve(&motion(0.1001)).unwrap();
        let warm = operator.solve_from(&motion(0.1001), &like.displacement).unwrap();
        assert!(
            warm.iterations < fresh.iterations,
            "{method:?}: {} {}",
            warm.iterations,
            fresh.iterations
        );
        for (a, b) in fresh.displacement.iter().zip(&warm.displacement) {
            assert!((0..3).all(|axis| (a[axis] - b[axis]).abs() < 1e-7), "{method:?}: {a:?} {b:?}");
        }
        let expected = mesh.points().len();
        assert_eq!(
            operator.solve_from(&motion(0.1), &[]),
            Err(VolumeError::StartCount { found: 0, expected })
        );
    }
}

#[cfg(feature = "parallel")]
#[test]
fn the_same_bits_whatever_the_number_of_threads() {
    let mesh = jiggled(&cube(22), 0.01);
    let boundary = cube_boundary(&mesh);
    let motion: Vec<Vector> = boundary
        .iter()
        .map(|&vertex| [0.02 * noise(vertex as usize), 0.0, mesh.points()[vertex as usize][0]])
        .collect();
    for method in [Method::Elasticity, Method::Harmonic] {
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let settings = Deform { method, ..Deform::default() };
                let solution = VolumeOperator::new(&mesh, &boundary, &settings)
                    .unwrap()
                    .solve(&motion)
                    .unwrap();
                let bits: Vec<u64> = solution
                    .displacement
                    .as_flattened()
                    .iter()
                    .map(|value| value.to_bits())
                    .collect();
                (bits, solution.iterations)
            })
        };
        let one = run(1);
        assert!(one.1 > 5);
        assert!(one == run(2) && one == run(3));
    }
}

#[test]
fn bad_input_is_named() {
    let mesh = cube(2);
    let boundary = cube_boundary(&mesh);
    let new =
        |mesh: &Mesh, boundary: &[u32]| VolumeOperator::new(mesh, boundary, &Deform::default());
    assert_eq!(
        new(&mesh, &[99]).unwrap_err(),
        VolumeError::BoundaryVertex { vertex: 99, vertex_count: 27 }
    );
    assert_eq!(new(&mesh, &[3, 4, 3]).unwrap_err(), VolumeError::BoundaryTwice { vertex: 3 });
    assert_eq!(new(&mesh, &[]).unwrap_err(), VolumeError::Unattached { vertex: 0, count: 27 });
    let operator = new(&mesh, &boundary).unwrap();
    assert_eq!(operator.unknowns(), 1);
    assert_eq!(
        operator.solve(&[[0.0; 3]]).unwrap_err(),
        VolumeError::BoundaryCount { found: 1, expected: boundary.len() }
    );
    let mut motion = vec![[0.0; 3]; boundary.len()];
    motion[5][1] = f64::NAN;
    let error = operator.solve(&motion).unwrap_err();
    assert!(
        matches!(error, VolumeError::NotFinite { vertex, .. } if vertex == boundary[5]),
        "{error}"
    );

    // The one inner vertex pushed out of the box turns cells inside out.
    let mut points = mesh.points().to_vec();
    points[13] = [0.5, 0.5, 1.5];
    let inverted = mesh.with_points(points).unwrap();
    let error = new(&inverted, &boundary).unwrap_err();
    let expected = crate::quality::quality(inverted.cells(), inverted.points()).inverted;
    assert!(
        matches!(error, VolumeError::InvertedCell { count, .. } if count == expected),
        "{error}"
    );
    assert!(error.to_string().contains("tetra"), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Whatever is prescribed, the answer is finite or an error, and never a panic.
    #[test]
    fn absurd_displacements_are_answered(
        values in prop::collection::vec(prop::num::f64::ANY, 26 * 3),
        elastic in any::<bool>(),
    ) {
        let mesh = cube(2);
        let boundary = cube_boundary(&mesh);
        let method = if elastic { Method::Elasticity } else { Method::Harmonic };
        let operator = VolumeOperator::new(&mesh, &boundary, &Deform { method, ..Deform::default() }).unwrap();
        let motion: Vec<Vector> = values.chunks_exact(3).map(|v| [v[0], v[1], v[2]]).collect();
        if let Ok(solution) = operator.solve(&motion) {
            prop_assert!(solution.displacement.as_flattened().iter().all(|value| value.is_finite()));
        }
    }

    /// Whatever the reference looks like, setting up gives an operator or an error.
    #[test]
    fn absurd_references_are_answered(values in prop::collection::vec(-1e3..1e3f64, 27 * 3), power in -300i32..300) {
        let mesh = cube(2);
        let boundary = cube_boundary(&mesh);
        let points = values.chunks_exact(3).map(|v| [v[0], v[1], v[2] * 10f64.powi(power)]).collect();
        let mesh = mesh.with_points(points).unwrap();
        if let Ok(operator) = VolumeOperator::new(&mesh, &boundary, &Deform::default()) {
            let _ = operator.solve(&vec![[1.0, 0.5, 0.0]; boundary.len()]);
        }
    }
}
