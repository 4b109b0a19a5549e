//! What the check of a surface finds, and what it does not mistake for a flaw.

use super::*;
use proptest::prelude::*;
use tombolo_deform::mesh::{CellType, Cells};
use tombolo_deform::shapes;
use tombolo_deform::surface::{check, check_triangles, require_sound, sound_fraction};

fn torus() -> Surface {
    extract(&shapes::torus(1.0, 0.3, [40, 20]))
}

fn plate() -> Surface {
    extract(&shapes::plate([8, 8], [0.0; 2], [1.0; 2]))
}

/// The unit square, and the same at this height, one above the other.
fn two_plates(height: f64) -> Surface {
    let one = plate();
    let count = one.points().len() as u32;
    let mut points = one.points().to_vec();
    // Turned a little, so that no edges lie on each other.
    points.extend(
        one.points().iter().map(|[x, y, _]| [0.9 * x + 0.1 * y, 0.9 * y - 0.1 * x, height]),
    );
    let corners = one.triangles().iter().flatten();
    let corners: Vec<u32> =
        corners.clone().copied().chain(corners.map(|vertex| vertex + count)).collect();
    let cells = Cells::uniform(CellType::Triangle, corners).expect("triangles");
    extract(&Mesh::new(points, cells, FeatureSource::SharpEdges).expect("a mesh"))
}

fn shaped(surface: &Surface, shape: impl Fn(Vector) -> Vector) -> Vec<Vector> {
    surface.points().iter().map(|&point| shape(point)).collect()
}

/// The rotation of a unit quaternion from four numbers, then a shift.
fn rigid([a, b, c, d]: [f64; 4], shift: Vector) -> impl Fn(Vector) -> Vector {
    let length = (a * a + b * b + c * c + d * d).sqrt().max(1e-3);
    let [a, b, c, d] = [a, b, c, d].map(|value| value / length);
    let rows = [
        [a * a + b * b - c * c - d * d, 2.0 * (b * c - a * d), 2.0 * (b * d + a * c)],
        [2.0 * (b * c + a * d), a * a - b * b + c * c - d * d, 2.0 * (c * d - a * b)],
        [2.0 * (b * d - a * c), 2.0 * (c * d + a * b), a * a - b * b - c * c + d * d],
    ];
    move |[x, y, z]| {
        std::array::from_fn(|row| {
            rows[row][0] * x + rows[row][1] * y + rows[row][2] * z + shift[row]
        })
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    /// Of the whole: also where coordinates are far from the origin, and where flat sides are
    /// tilted.
    #[test]
    fn a_rigid_motion_breaks_nothing(turn in [-1.0..1.0f64, -1.0..1.0, -1.0..1.0, 0.1..1.0], far in 0.0..6.0f64, which in 0..3usize) {
        let surface = match which {
            0 => torus(),
            1 => extract(&shapes::box_of_tets([3, 4, 5], [0.0; 3], [1.0; 3])),
            _ => extract(&shapes::box_of_hexahedra([3, 4, 5], [0.0; 3], [1.0; 3])),
        };
        let far = 10f64.powf(far) - 1.0;
        let shape = shaped(&surface, rigid(turn, [far, -far, 0.5 * far]));
        let report = check(&surface, surface.points(), &shape);
        prop_assert!(report.is_sound(), "{report}");
    }

    /// Numbers are no matter: neither of vertices nor of faces.
    #[test]
    fn renumbering_changes_no_count(seed in 0..1000u64, size in 0.0..0.15f64) {
        let surface = torus();
        let mut random = noise(seed);
        let shape: Vec<Vector> = surface.points().iter().map(|point| point.map(|value| value + size * (random() - 0.5))).collect();
        let count = surface.points().len() as u32;
        let renamed = |vertex: u32| (vertex * 397 + 11) % count;
        let [mut points, mut other_shape] = [vec![[0.0; 3]; count as usize], vec![[0.0; 3]; count as usize]];
        for vertex in 0..count {
            points[renamed(vertex) as usize] = surface.points()[vertex as usize];
            other_shape[renamed(vertex) as usize] = shape[vertex as usize];
        }
        let mut corners: Vec<[u32; 3]> = surface.triangles().iter().map(|corners| corners.map(renamed)).collect();
        corners.reverse();
        let cells = Cells::uniform(CellType::Triangle, corners.concat()).expect("triangles");
        let other = extract(&Mesh::new(points, cells, FeatureSource::SharpEdges).expect("a mesh"));
        let [one, two] = [check(&surface, surface.points(), &shape), check(&other, other.points(), &other_shape)];
        prop_assert_eq!(one.intersections.count, two.intersections.count);
        prop_assert_eq!(one.flipped.count, two.flipped.count);
        prop_assert_eq!(one.degenerate.count, two.degenerate.count);
    }

    #[test]
    fn no_coordinates_make_it_panic(seed in 0..1000u64, values in prop::collection::vec(any::<f64>(), 8)) {
        let surface = plate();
        let mut random = noise(seed);
        let mut shape = surface.points().to_vec();
        for &value in &values {
            let [vertex, axis] = [81.0, 3.0].map(|count| (random() * count) as usize);
            shape[vertex][axis] = value;
        }
        let report = check(&surface, surface.points(), &shape);
        if values.iter().any(|value| !value.is_finite()) {
            prop_assert!(report.degenerate.count > 0);
        }
    }
}

#[test]
fn parts_that_turn_against_each_other_are_no_folds() {
    // One end of a box is turned by 180 degrees, the rest follows evenly.
    let surface = extract(&shapes::box_of_tets([4, 4, 40], [-0.5, -0.5, 0.0], [0.5, 0.5, 10.0]));
    let shape = shaped(&surface, |[x, y, z]| {
        let (sine, cosine) = (z / 10.0 * std::f64::consts::PI).sin_cos();
        [cosine * x - sine * y, sine * x + cosine * y, z]
    });
    let report = check(&surface, surface.points(), &shape);
    assert!(report.is_sound(), "{report}");
}

#[test]
fn a_vertex_drawn_over_its_neighbours_folds_the_faces_behind_it() {
    let surface = plate();
    let middle =
        surface.points().iter().position(|point| *point == [0.5, 0.5, 0.0]).expect("a vertex");
    for tilt in [0.0, 0.7] {
        let motion = rigid([1.0, tilt, 0.3 * tilt, 0.0], [0.0; 3]);
        let mut moved = surface.points().to_vec();
        moved[middle][0] += 0.2;
        let shape: Vec<Vector> = moved.into_iter().map(motion).collect();
        let report = check(&surface, surface.points(), &shape);
        // Off the axes rounding lifts the faces out of their plane, some of them clear of each
        // other.
        assert!(
            report.flipped.count > 0 && (tilt != 0.0 || report.intersections.count > 0),
            "{report}"
        );
        let around = |face: u32| surface.faces().vertices(face as usize).contains(&(middle as u32));
        assert!(
            report.flipped.first.iter().all(|flawed| around(flawed.face)),
            "only faces at the vertex are folded"
        );
        let refused = require_sound(&surface, surface.points(), &shape).unwrap_err();
        assert!(
            refused.to_string().contains("fold over") && refused.to_string().contains("feasible"),
            "{refused}"
        );
        // The faces behind lose their area where the vertex meets the next one, after 0.125 of the
        // 0.2.
        if tilt == 0.0 {
            assert!((refused.sound_fraction - 0.625).abs() < 2e-3, "{}", refused.sound_fraction);
        }
    }
}

#[test]
fn plates_that_pass_each_other_meet_where_and_when_they_should() {
    let surface = two_plates(0.25);
    let count = surface.points().len() / 2;
    let mut shape = surface.points().to_vec();
    for point in &mut shape[count..] {
        // It comes down tilted and ends with half of it below.
        point[2] = 0.4 * (point[0] - 0.5);
    }
    let report = check(&surface, surface.points(), &shape);
    assert!(
        report.intersections.count > 0 && report.degenerate.count + report.flipped.count == 0,
        "{report}"
    );
    assert_eq!(report.intersections.first.len(), report.intersections.count.min(16));
    for pair in &report.intersections.first {
        assert!(
            pair.position[2].abs() < 1e-12 && (pair.position[0] - 0.5).abs() < 1e-9,
            "{:?}",
            pair.position
        );
        let [a, b] =
            pair.faces.map(|face| surface.faces().vertices(face as usize)[0] as usize >= count);
        assert!(!a && b, "one face of each plate");
    }
    // Straight down: contact after 0.25 of 1, and touching is meeting.
    let down = shaped(&surface, |[x, y, z]| if z > 0.0 { [x, y, z - 1.0] } else { [x, y, z] });
    assert!(check(&surface, surface.points(), &down).is_sound(), "on the other side nothing meets");
    let contact = shaped(&surface, |[x, y, _]| [x, y, 0.0]);
    assert!(check(&surface, surface.points(), &contact).intersections.count > 0);
    assert!((sound_fraction(&surface, surface.points(), &contact) - 1023.0 / 1024.0).abs() < 1e-12);
}

#[test]
fn all_triangles_with_a_flaw_are_told_where_the_report_names_the_first() {
    let plates = two_plates(1.0);
    let lower = plate().points().len();
    // The lower plate is tilted through the height of the upper one, which it crosses at x = 0.45.
    let mut shape = plates.points().to_vec();
    for point in &mut shape[..lower] {
        point[2] = 1.0 + (point[0] - 0.45);
    }
    let (report, triangles) = check_triangles(&plates, plates.points(), &shape);
    assert_eq!(report, check(&plates, plates.points(), &shape));
    assert!(report.intersections.count > 16 && !report.intersections.more, "{report}");
    assert!(triangles.is_sorted_by(|a, b| a < b));
    for (number, corners) in (0..).zip(plates.triangles()) {
        let corners = corners.map(|vertex| vertex as usize);
        if corners.iter().any(|&vertex| vertex >= lower) {
            continue;
        }
        let span = |axis: usize| {
            corners
                .map(|vertex| shape[vertex][axis])
                .into_iter()
                .fold((f64::MAX, f64::MIN), |(low, high), value| (low.min(value), high.max(value)))
        };
        let (left, right) = span(0);
        let crosses = left < 0.45 && 0.45 < right;
        // The upper plate ends at some y below 0.9.
        if !crosses || span(1).1 < 0.8 {
            assert_eq!(
                triangles.contains(&number),
                crosses,
                "triangle {number} at {left} to {right}"
            );
        }
    }
    let (report, triangles) = check_triangles(&plates, plates.points(), plates.points());
    assert!(report.is_sound() && triangles.is_empty());
}

#[test]
fn what_the_reference_has_does_not_count() {
    let surface = two_plates(0.25);
    let count = surface.points().len() / 2;
    let mut crossed = surface.points().to_vec();
    crossed[count..].iter_mut().for_each(|point| point[2] = 0.4 * (point[0] - 0.5));
    assert!(check(&surface, &crossed, &crossed).is_sound(), "nothing moves");
    let lifted: Vec<Vector> = crossed.iter().map(|[x, y, z]| [x + 0.125, *y, z + 0.25]).collect();
    assert!(check(&surface, &crossed, &lifted).is_sound(), "all moves alike");
    let flat = vec![[0.5, 0.25, 0.0]; surface.points().len()];
    let all = surface.faces().len();
    assert_eq!(check(&surface, &crossed, &flat).degenerate.count, all);
    assert!(check(&surface, &flat, &flat.iter().map(|_| [1.0; 3]).collect::<Vec<_>>()).is_sound());
}

#[test]
fn faces_without_area_are_named() {
    let surface = torus();
    let [a, b, _] = surface.triangles()[100];
    let mut shape = surface.points().to_vec();
    shape[a as usize] = shape[b as usize];
    let report = check(&surface, surface.points(), &shape);
    let expected: Vec<u32> = (0..surface.triangles().len() as u32)
        .filter(|&face| {
            [a, b].iter().all(|vertex| surface.triangles()[face as usize].contains(vertex))
        })
        .collect();
    let found: Vec<u32> = report.degenerate.first.iter().map(|flawed| flawed.face).collect();
    assert_eq!((found, report.degenerate.count), (expected, 2));
}
