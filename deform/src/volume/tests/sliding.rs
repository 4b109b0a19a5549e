//! Vertices that slide along planes.

use super::*;

/// A bar that is pulled while its sides slide stretches evenly, and narrows nowhere.
#[test]
fn sliding_sides_follow_a_stretch() {
    let sides = [(1, 0.0), (1, 1.0), (2, 0.0), (2, 1.0)];
    for (name, mesh) in all_meshes() {
        for method in [Method::Elasticity, Method::Harmonic] {
            let (boundary, sliding) = split_boundary(&mesh, &sides);
            let settings = Deform { method, tolerance: 1e-12, ..TIGHT };
            let operator =
                VolumeOperator::with_sliding(&mesh, &boundary, &sliding, &settings, &BuiltIn)
                    .unwrap();
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
        VolumeOperator::with_sliding(&mesh, &boundary, &sliding, &Deform::default(), &BuiltIn)
            .unwrap();
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
    let error = VolumeOperator::with_sliding(&mesh, &boundary, &zero, &Deform::default(), &BuiltIn)
        .unwrap_err();
    assert!(matches!(error, VolumeError::SlidingNormal { .. }), "{error}");
    let held = [Sliding { vertex: boundary[0], normal: [1.0; 3] }];
    let error = VolumeOperator::with_sliding(&mesh, &boundary, &held, &Deform::default(), &BuiltIn)
        .unwrap_err();
    assert_eq!(error, VolumeError::BoundaryTwice { vertex: boundary[0] });
}
