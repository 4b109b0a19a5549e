//! Linear solvers on hard meshes, from earlier solutions and with several threads.

use super::*;
use crate::linear::{Cholesky, LinearError, LinearSolver, Multigrid, MultigridSettings, Tolerance};

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
        // With stiffness in proportion to the volumes' inverse as well: a residual is all that can
        // be asked for.
        let settings = Deform { method, tolerance: 1e-12, ..Deform::default() };
        let solution =
            VolumeOperator::new(&mesh, &boundary, &settings).unwrap().solve(&motion).unwrap();
        assert!(solution.residual <= 1e-12, "{method:?}: {:e}", solution.residual);
    }
}

/// Where stiffness differs by many orders of magnitude, the residual tells of the stiff cells
/// alone: the solvers must not stop before the soft ones are right as well. Volumes differ by a
/// factor of more than 2.6e9.
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
    assert_eq!(error, LinearError::Positions { found: 1, expected: matrix.rows(), block: 3 });
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
