//! What comes out does not depend on how vertices and cells are numbered, and errors name what the
//! caller has.

use super::*;
use crate::mesh::shuffled;

/// Values in the order of the original mesh, from those in the order of the shuffled one.
fn unshuffled(values: &[Vector], number: &[u32]) -> Vec<Vector> {
    number.iter().map(|&number| values[number as usize]).collect()
}

fn largest_difference(a: &[Vector], b: &[Vector]) -> f64 {
    let pairs = a.as_flattened().iter().zip(b.as_flattened());
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn bent(&[x, y, z]: &Vector) -> Vector {
    [0.1 * (3.0 * y).sin(), 0.2 * x * z, 0.1 * x]
}

#[test]
fn displacements_are_those_of_the_same_vertices() {
    for (name, mesh) in [("tets", jiggled(&cube(9), 0.02)), ("mixed", mixed(7))] {
        let (other, number) = shuffled(&mesh);
        let (held, sliding) = split_boundary(&mesh, &[(2, 1.0)]);
        let numbered = |vertices: &[u32]| {
            vertices.iter().map(|&vertex| number[vertex as usize]).collect::<Vec<_>>()
        };
        let slides: Vec<Sliding> = sliding
            .iter()
            .map(|slide| Sliding { vertex: number[slide.vertex as usize], ..*slide })
            .collect();
        let motion: Vec<Vector> =
            held.iter().map(|&vertex| bent(&mesh.points()[vertex as usize])).collect();
        for method in [Method::Elasticity, Method::Harmonic] {
            let settings = Deform { method, stiffening: 0.5, ..TIGHT };
            let plain =
                VolumeOperator::with_sliding(&mesh, &held, &sliding, &settings, &BuiltIn).unwrap();
            let shuffled = VolumeOperator::with_sliding(
                &other,
                &numbered(&held),
                &slides,
                &settings,
                &BuiltIn,
            )
            .unwrap();
            let expected = plain.solve(&motion).unwrap().displacement;
            let found = shuffled.solve(&motion).unwrap().displacement;
            let difference = largest_difference(&expected, &unshuffled(&found, &number));
            assert!(difference < 1e-10, "{name}: {difference}");

            // Set up again on a shape of its own, and started from what was found.
            let moved = |mesh: &Mesh, by: &[Vector]| {
                let points = mesh
                    .points()
                    .iter()
                    .zip(by)
                    .map(|(&point, &by)| crate::vector::add(point, by))
                    .collect();
                mesh.with_points(points).unwrap()
            };
            let [plain, shuffled] = [(plain, &mesh, &expected), (shuffled, &other, &found)].map(
                |(operator, mesh, by)| {
                    operator
                        .updated(&moved(mesh, by))
                        .unwrap()
                        .solve_from(&motion, by)
                        .unwrap()
                        .displacement
                },
            );
            let difference = largest_difference(&plain, &unshuffled(&shuffled, &number));
            assert!(difference < 1e-10, "{name}: {difference}");
        }
    }
}

#[test]
fn errors_name_the_callers_vertices_and_cells() {
    let settings = Deform::default();
    let (mesh, number) = shuffled(&cube(9));
    let boundary = cube_boundary(&mesh);
    // A vertex drawn through the faces opposite to it.
    let inside = number[5 + 10 * (5 + 10 * 5)];
    let mut points = mesh.points().to_vec();
    points[inside as usize] = [0.95, 0.5, 0.5];
    let mesh = mesh.with_points(points).unwrap();
    let Err(VolumeError::InvertedCell { cell, count, .. }) =
        VolumeOperator::new(&mesh, &boundary, &settings)
    else {
        panic!("an inverted cell was let through");
    };
    let is_inverted = |cell: usize| {
        let corners: Vec<Vector> = mesh
            .cells()
            .vertices(cell)
            .iter()
            .map(|&vertex| mesh.points()[vertex as usize])
            .collect();
        crate::mesh::cell_geometry::tet_determinant(corners.try_into().unwrap()) <= 0.0
    };
    let inverted: Vec<usize> = (0..mesh.cells().len()).filter(|&cell| is_inverted(cell)).collect();
    assert_eq!((cell, count), (inverted[0], inverted.len()));

    let (mesh, _) = shuffled(&cube(9));
    let error = VolumeOperator::new(&mesh, &[7, 7], &settings).unwrap_err();
    assert_eq!(error, VolumeError::BoundaryTwice { vertex: 7 });
    let error = VolumeOperator::new(&mesh, &[1000], &settings).unwrap_err();
    assert_eq!(error, VolumeError::BoundaryVertex { vertex: 1000, vertex_count: 1000 });
    let error = VolumeOperator::new(&mesh, &[], &settings).unwrap_err();
    assert_eq!(error, VolumeError::Unattached { vertex: 0, count: 1000 });
}

#[test]
fn untangling_and_improving_move_the_same_vertices() {
    for mesh in [cube(9), mixed(6)] {
        let (other, number) = shuffled(&mesh);
        let boundary = cube_boundary(&mesh);
        let other_boundary = cube_boundary(&other);
        let spoiled = |amount: f64| {
            let mut points = mesh.points().to_vec();
            for (vertex, point) in points
                .iter_mut()
                .enumerate()
                .filter(|(vertex, _)| !boundary.contains(&(*vertex as u32)))
            {
                *point =
                    std::array::from_fn(|axis| point[axis] + amount * noise(3 * vertex + axis));
            }
            let mut shuffled = points.clone();
            number
                .iter()
                .zip(&points)
                .for_each(|(&number, &point)| shuffled[number as usize] = point);
            (points, shuffled)
        };
        let (mut expected, mut found) = spoiled(0.015);
        assert!(Improver::new(&mesh, &boundary).improve(&mut expected, 5));
        assert!(Improver::new(&other, &other_boundary).improve(&mut found, 5));
        let difference = largest_difference(&expected, &unshuffled(&found, &number));
        assert!(difference < 1e-9, "{difference}");

        let (mut expected, mut found) = spoiled(0.12);
        assert!(Untangler::new(&mesh, &boundary).untangle(&mut expected, 0.0));
        assert!(Untangler::new(&other, &other_boundary).untangle(&mut found, 0.0));
        // The equations of a step are solved to a hundredth.
        let difference = largest_difference(&expected, &unshuffled(&found, &number));
        assert!(difference < 0.02, "{difference}");
    }
}

/// An operator gives the pattern of its equations up; those made from it find it again.
#[test]
fn the_pattern_of_the_equations_is_found_again() {
    use std::sync::Arc;

    use crate::mesh::{Domain, Ordered};
    use crate::volume::assembly::Graph;

    for mesh in [cube(9), mixed(5), shuffled(&jiggled(&cube(8), 0.02)).0] {
        let (held, _) = split_boundary(&mesh, &[(2, 1.0)]);
        let ordered = Arc::new(Ordered::new(&mesh));
        let (graph, pattern) = Graph::new(ordered, &held, &Domain::from(&mesh)).unwrap();
        assert_eq!(graph.pattern(), pattern);
    }
}
