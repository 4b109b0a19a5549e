//! Displacements whose values are known.

use super::*;

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

/// Wedges whose first triangle faces outwards, as VTK's manual has it, give the same displacement
/// as the others.
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

/// A displacement without body force and with change of volume, after Papkovich and Neuber: `grad(z
/// b) - 4 (1 - ν) b e_z`.
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
