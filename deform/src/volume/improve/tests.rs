use super::*;
use crate::mesh::Mesh;
use crate::quality::{normalized_scaled_jacobians, quality};
use crate::shapes;
use crate::volume::tests::cube_boundary;

/// The inside shaken by less than would turn a cell inside out.
fn shaken(mesh: &Mesh, boundary: &[u32]) -> Vec<Vector> {
    let mut points = mesh.points().to_vec();
    for (vertex, point) in points.iter_mut().enumerate() {
        if !boundary.contains(&(vertex as u32)) {
            let wave = |phase: f64| 0.045 * (12.9898 * vertex as f64 + phase).sin();
            *point = [point[0] + wave(0.0), point[1] + wave(2.0), point[2] + wave(4.0)];
        }
    }
    points
}

fn spread(mesh: &Mesh, points: &[Vector]) -> (f64, f64) {
    let values = normalized_scaled_jacobians(mesh.cells(), mesh.points(), points);
    (
        values.iter().copied().fold(f64::INFINITY, f64::min),
        values.iter().sum::<f64>() / values.len() as f64,
    )
}

fn meshes() -> Vec<Mesh> {
    let size = ([5, 6, 4], [0.0; 3], [1.0; 3]);
    vec![
        shapes::box_of_tets(size.0, size.1, size.2),
        shapes::box_of_hexahedra(size.0, size.1, size.2),
    ]
}

/// With the boundary where it was, every cell can have the quality of the reference.
#[test]
fn the_worst_cells_and_the_mean_get_better() {
    for mesh in meshes() {
        let boundary = cube_boundary(&mesh);
        let start = shaken(&mesh, &boundary);
        let mut points = start.clone();
        let (least, mean) = spread(&mesh, &start);
        assert!(least > 0.0 && least < 0.7, "{least}");
        assert!(Improver::new(&mesh, &boundary).improve(&mut points, 20));
        let (after, mean_after) = spread(&mesh, &points);
        assert!(after > 0.9 && mean_after > mean, "{least} -> {after}, {mean} -> {mean_after}");
        assert_eq!(quality(mesh.cells(), &points).inverted, 0);
        for &vertex in &boundary {
            assert_eq!(points[vertex as usize], start[vertex as usize]);
        }
    }
}

#[test]
fn good_and_broken_meshes_stay_as_they_are() {
    for mesh in meshes() {
        let boundary = cube_boundary(&mesh);
        let improver = Improver::new(&mesh, &boundary);
        // Turned and moved.
        let (s, c) = 0.7f64.sin_cos();
        let turned: Vec<Vector> = mesh
            .points()
            .iter()
            .map(|&[x, y, z]| [c * x - s * y + 3.0, s * x + c * y, z - 1.0])
            .collect();
        let mirrored: Vec<Vector> = mesh.points().iter().map(|&[x, y, z]| [x, y, -z]).collect();
        for mut points in [turned, mirrored] {
            let start = points.clone();
            assert!(!improver.improve(&mut points, 5));
            assert_eq!(points, start);
        }
        assert!(!improver.improve(&mut shaken(&mesh, &boundary), 0));
        assert!(!improver.improve(&mut shaken(&mesh, &boundary)[1..], 5));
    }
}

/// Where the shear has worn all cells alike, what lifts some costs others as much.
#[test]
fn what_gains_nothing_stays_as_it_was_solved() {
    let mesh = shapes::box_of_tets([9, 9, 9], [0.0; 3], [1.0; 3]);
    let boundary = cube_boundary(&mesh);
    let sheared: Vec<Vector> =
        mesh.points().iter().map(|&[x, y, z]| [x + 0.08 * z * z, y, z]).collect();
    let (least, _) = spread(&mesh, &sheared);
    assert!(least > worth::ENOUGH && least < GOOD, "{least}");
    let mut points = sheared.clone();
    assert!(!Improver::new(&mesh, &boundary).improve(&mut points, 10));
    assert_eq!(points, sheared);
    assert!(Improver::new(&mesh, &boundary).lifting_to(GOOD).improve(&mut points, 10));
    assert_ne!(points, sheared);
}

/// The cells at the edges of the box have no vertex inside, and keep the quality that the shear has
/// left them: to lift others above it would cost the mean, and the mesh would gain nothing.
#[test]
fn others_are_not_lifted_above_cells_that_cannot_be_moved() {
    let mesh = shapes::box_of_tets([9, 9, 9], [0.0; 3], [1.0; 3]);
    let boundary = cube_boundary(&mesh);
    let improver = Improver::new(&mesh, &boundary);
    let sheared: Vec<Vector> =
        mesh.points().iter().map(|&[x, y, z]| [x + 0.3 * z * z, y, z]).collect();
    let near = improver.numbering.gather(&sheared).into_owned();
    let (least, fixed) = (improver.qualities(&near).least, improver.least_fixed(&near));
    assert!(fixed < least + 1e-12 && least < worth::ENOUGH, "{fixed}, {least}");
    let mut points = sheared.clone();
    assert!(!improver.improve(&mut points, 10));
    assert_eq!(points, sheared);
    // The others could be lifted.
    assert!(improver.lifting_to(GOOD).improve(&mut points, 10));
    let lifted = Improver::new(&mesh, &boundary);
    let near = lifted.numbering.gather(&points).into_owned();
    assert!(lifted.qualities(&near).least > least + 1e-3);
}

/// Whatever has been gained for good, further sweeps would change by rounding alone.
#[test]
fn sweeps_end_where_they_gain_nothing() {
    for mesh in meshes() {
        let boundary = cube_boundary(&mesh);
        let improver = Improver::new(&mesh, &boundary);
        let of_sweeps = |sweeps| {
            let mut points = shaken(&mesh, &boundary);
            assert!(improver.improve(&mut points, sweeps));
            points
        };
        assert_ne!(of_sweeps(1), of_sweeps(2));
        assert_eq!(of_sweeps(99), of_sweeps(100));
    }
}

/// Sweeps that pass over sleeping vertices are sweeps through all vertices.
#[test]
fn vertices_that_sleep_would_have_stayed() {
    let mesh = shapes::box_of_tets([9, 9, 9], [0.0; 3], [1.0; 3]);
    let improver = Improver::new(&mesh, &cube_boundary(&mesh));
    let mut points = improver.numbering.gather(mesh.points()).into_owned();
    for point in points.iter_mut().filter(|point| point.iter().all(|&x| x > 0.0 && x < 0.3)) {
        *point = [point[0] + 0.04, point[1] - 0.03, point[2] + 0.02];
    }
    let (mut all, sweeps, mut slept) = (points.clone(), Sweeps::new(&improver), 0);
    for _ in 0..6 {
        let least = improver.qualities(&points).least;
        assert!(least > 0.0 && least < GOOD, "{least}");
        sweeps.through(&mut points, 0..improver.colours.len(), least);
        Sweeps::new(&improver).through(&mut all, 0..improver.colours.len(), least);
        assert_eq!(points, all);
        slept = sweeps.asleep();
    }
    let free: usize = improver.colours.iter().map(Vec::len).sum();
    assert!(slept > free / 2 && slept < free, "{slept} of {free}");
}

#[cfg(feature = "parallel")]
#[test]
fn the_same_bits_whatever_the_number_of_threads() {
    let mesh = shapes::box_of_tets([9, 9, 9], [0.0; 3], [1.0; 3]);
    let boundary = cube_boundary(&mesh);
    let improver = Improver::new(&mesh, &boundary);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut points = shaken(&mesh, &boundary);
        let start = points.clone();
        for point in &mut points {
            *point = [point[0], point[1], point[2] + 0.3 * point[0]];
        }
        pool.install(|| improver.improve(&mut points, 3));
        assert_ne!(points, start);
        points
    };
    let one = run(1);
    assert_eq!(one, run(2));
    assert_eq!(one, run(3));
}
