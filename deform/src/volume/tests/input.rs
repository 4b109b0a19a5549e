//! Bad and absurd input.

use proptest::prelude::*;

use super::*;

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
