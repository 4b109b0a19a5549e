//! The features found at sharp edges are those that CGAL finds.

use std::f64::consts::PI;

use tombolo_deform::features::FeatureSettings;
use tombolo_deform::mesh::{CellType, Cells, FeatureSource, Mesh, Vector};
use tombolo_deform::shapes;
use tombolo_deform::surface::Surface;
use tombolo_pipelines::files::read_mesh;
use tombolo_tests::{cgal, generated_surfaces, off};

const ANGLES: [f64; 11] = [0.0, 1.0, 5.0, 10.0, 20.0, 30.0, 45.0, 60.0, 89.0, 120.0, 180.0];

/// The triangles of a surface as a mesh of their own, which has no features but by angle.
fn triangulated(mesh: &Mesh) -> Mesh {
    let surface = Surface::extract(mesh, &FeatureSettings::default()).expect("a surface");
    triangles(surface.points().to_vec(), surface.triangles())
}

fn triangles(points: Vec<Vector>, triangles: &[[u32; 3]]) -> Mesh {
    let cells = Cells::uniform(CellType::Triangle, triangles.concat()).expect("triangles");
    Mesh::new(points, cells, FeatureSource::SharpEdges).expect("a mesh")
}

fn feature_of_each_face(mesh: &Mesh, sharp_angle_degrees: f64) -> Vec<u32> {
    let surface =
        Surface::extract(mesh, &FeatureSettings { sharp_angle_degrees }).expect("a surface");
    assert_eq!(surface.faces().len(), mesh.cells().len());
    surface.features().face_features().to_vec()
}

/// Numbers renamed in the order they come up in: equal for equal partitions.
fn partition(numbers: impl Iterator<Item = u32>) -> Vec<usize> {
    let mut seen = std::collections::HashMap::new();
    numbers
        .map(|number| {
            let next = seen.len();
            *seen.entry(number).or_insert(next)
        })
        .collect()
}

/// Compares a mesh of triangles at these angles; how many features there are at each.
fn agree(name: &str, mesh: &Mesh, angles: &[f64]) -> Vec<usize> {
    let corners: Vec<[u32; 3]> =
        mesh.cells().iter().map(|(_, face)| [face[0], face[1], face[2]]).collect();
    let words: Vec<String> = angles.iter().map(|angle| format!("{angle:?}")).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let text = cgal("features", &words, &off(mesh.points(), &corners));
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), angles.len());
    let mut counts = Vec::new();
    for (&angle, line) in angles.iter().zip(lines) {
        let theirs = partition(line.split_whitespace().map(|word| word.parse().expect("a patch")));
        let ours = partition(feature_of_each_face(mesh, angle).into_iter());
        assert_eq!(ours.len(), theirs.len(), "{name}");
        let count = ours.iter().max().map_or(0, |last| last + 1);
        let expected = theirs.iter().max().map_or(0, |last| last + 1);
        assert!(
            ours == theirs,
            "{name} at {angle} degrees: {count} features, CGAL finds {expected}"
        );
        counts.push(count);
    }
    counts
}

#[test]
fn on_the_generated_meshes() {
    let names = [
        "channel",
        "channel-60k",
        "cylinder-coarse",
        "boundary-layer",
        "pipe-1",
        "bypass-0",
        "bypass-1",
    ];
    for (name, file) in names.into_iter().zip(generated_surfaces(&names)) {
        let mesh = triangulated(&read_mesh(&file).expect("a mesh").mesh);
        let counts = agree(name, &mesh, &ANGLES);
        assert_eq!(
            counts.first(),
            Some(&mesh.cells().len()),
            "{name}: at 0 degrees each face is a feature"
        );
        match name {
            // Flat sides; at 60 degrees six of them.
            "channel" | "channel-60k" | "boundary-layer" => {
                assert_eq!(counts[3..9], [6; 6], "{name}")
            }
            // Two ends and the side.
            "cylinder-coarse" | "pipe-1" => assert_eq!(counts[5..8], [3; 3], "{name}"),
            _ => assert!(counts[1] > counts[5], "{name}"),
        }
    }
}

#[test]
fn on_shapes_of_known_angles() {
    agree("torus", &triangulated(&shapes::torus(1.0, 0.3, [48, 24])), &ANGLES);
    agree(
        "box of tetrahedra",
        &triangulated(&shapes::box_of_tets([4, 3, 2], [0.0; 3], [4.0, 3.0, 2.0])),
        &ANGLES,
    );
    let hexahedra = shapes::box_of_hexahedra([4, 3, 2], [0.0; 3], [4.0, 3.0, 2.0]);
    let counts = agree("box of hexahedra", &triangulated(&hexahedra), &ANGLES);
    assert_eq!(counts[8..10], [6, 1]);
    agree("plate", &triangulated(&shapes::plate([6, 4], [0.0; 2], [3.0, 2.0])), &ANGLES);
    // A box whose inner corners are pushed about.
    let bent = hexahedra
        .with_points(hexahedra.points().iter().map(|&point| wave(point)).collect())
        .expect("a mesh");
    agree("bent box", &triangulated(&bent), &ANGLES);
}

fn wave([x, y, z]: Vector) -> Vector {
    [x + 0.1 * (3.0 * y).sin(), y + 0.2 * (2.0 * x + z).cos(), z + 0.15 * (1.7 * x - y).sin()]
}

#[test]
fn where_edges_turn_by_exactly_the_angle() {
    // Regular prisms: rounding alone decides which of their edges are over the threshold, and it
    // must decide alike.
    for sides in [4, 6, 8, 9, 12, 18, 36, 72] {
        let angle = 360.0 / f64::from(sides);
        for [tilt, size] in [[0.0, 1.0], [0.3, 1.0], [1.1, 3e-5], [0.7, 2.5e4]] {
            agree(
                &format!("prism of {sides} sides"),
                &prism(sides, tilt, size),
                &[angle, 90.0, 180.0 - angle],
            );
        }
    }
}

/// An open prism of regular cross-section and three rings of triangles, tilted.
fn prism(sides: u32, tilt: f64, size: f64) -> Mesh {
    let mut points = Vec::new();
    for ring in 0..4 {
        for side in 0..sides {
            let turn = 2.0 * PI * f64::from(side) / f64::from(sides);
            let [x, y, z] = [turn.cos(), turn.sin(), f64::from(ring) * 0.37];
            points.push(
                [x, y * tilt.cos() - z * tilt.sin(), y * tilt.sin() + z * tilt.cos()]
                    .map(|value| value * size),
            );
        }
    }
    let mut corners = Vec::new();
    for ring in 0..3 {
        for side in 0..sides {
            let [a, b] = [side, (side + 1) % sides].map(|side| ring * sides + side);
            corners.extend([[a, b, b + sides], [a, b + sides, a + sides]]);
        }
    }
    triangles(points, &corners)
}

#[test]
fn on_surfaces_that_are_open_or_no_manifold() {
    // Three half-planes at one edge: CGAL cuts them apart there, as we do, at whatever angle they
    // meet.
    let points = vec![
        [0.0, 0.0, 0.0],
        [0.0, 0.0, 1.0],
        [1.0, 0.0, 0.5],
        [-1.0, 0.1, 0.5],
        [0.1, 1.0, 0.5],
        [2.0, 0.0, 0.5],
    ];
    let fan = triangles(points, &[[0, 1, 2], [1, 0, 3], [1, 0, 4], [2, 1, 5]]);
    assert_eq!(agree("three half-planes", &fan, &[30.0, 120.0, 179.0]), [3, 3, 3]);
    // Two boxes that touch in one edge, and two that touch in one vertex.
    for shift in [[1.0, 1.0, 0.0], [1.0, 1.0, 1.0]] {
        let cube = triangulated(&shapes::box_of_tets([1, 1, 1], [0.0; 3], [1.0; 3]));
        let mut points = cube.points().to_vec();
        let mut corners: Vec<[u32; 3]> =
            cube.cells().iter().map(|(_, face)| [face[0], face[1], face[2]]).collect();
        let mut other = Vec::new();
        for &point in cube.points() {
            let moved: Vector = std::array::from_fn(|axis| point[axis] + shift[axis]);
            other.push(
                points.iter().position(|known| *known == moved).unwrap_or(points.len()) as u32
            );
            if other.last().is_some_and(|&vertex| vertex as usize == points.len()) {
                points.push(moved);
            }
        }
        corners.extend(
            corners.clone().into_iter().map(|face| face.map(|vertex| other[vertex as usize])),
        );
        assert_eq!(
            agree("two boxes", &triangles(points, &corners), &[30.0, 60.0, 89.0]),
            [12, 12, 12]
        );
    }
    // Neighbours that run opposite ways round.
    let sheet = triangulated(&shapes::plate([5, 5], [0.0; 2], [1.0, 1.0]));
    let bent: Vec<Vector> = sheet.points().iter().map(|&point| wave(point)).collect();
    let mut corners: Vec<[u32; 3]> =
        sheet.cells().iter().map(|(_, face)| [face[0], face[1], face[2]]).collect();
    corners.iter_mut().step_by(3).for_each(|face| face.swap(1, 2));
    agree("mixed directions", &triangles(bent, &corners), &ANGLES);
    // A face without area is sharp to all its neighbours below a right angle.
    let points =
        vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, -1.0, 0.0]];
    let flat = triangles(points, &[[0, 1, 3], [1, 2, 3], [0, 2, 1], [2, 0, 4]]);
    assert_eq!(agree("a face without area", &flat, &[30.0, 120.0]), [3, 1]);
}
