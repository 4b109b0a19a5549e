//! Measures against VTK's, and the guard against closed forms.

use proptest::prelude::*;

use super::*;
use crate::mesh::{FeatureSource, Mesh};
use crate::shapes;
use crate::vector::scale;

#[derive(serde::Deserialize)]
struct Row {
    cell_type: CellType,
    points: Vec<Vector>,
    scaled_jacobian: f64,
}

/// The table that tests/vtk/scaled_jacobian.py writes.
fn table() -> Vec<Row> {
    serde_json::from_str(include_str!("scaled_jacobian.json")).unwrap()
}

#[test]
fn the_measure_is_that_of_vtk() {
    let rows = table();
    assert_eq!(rows.len(), 72);
    for row in rows {
        let value = scaled_jacobian(row.cell_type, &row.points).unwrap();
        assert!(
            (value - row.scaled_jacobian).abs() < 1e-10,
            "{} at {:?}: {value}, VTK {}",
            row.cell_type,
            row.points,
            row.scaled_jacobian
        );
    }
}

#[test]
fn pixels_voxels_and_strips_follow_their_like() {
    for row in table() {
        let p = &row.points;
        let pick = |order: &[usize]| order.iter().map(|&local| p[local]).collect::<Vec<_>>();
        let (other, points) = match row.cell_type {
            CellType::Quad => (CellType::Pixel, pick(&[0, 1, 3, 2])),
            CellType::Hexahedron => (CellType::Voxel, pick(&[0, 1, 3, 2, 4, 5, 7, 6])),
            CellType::Triangle => (CellType::TriangleStrip, p.clone()),
            _ => continue,
        };
        assert_eq!(scaled_jacobian(other, &points), scaled_jacobian(row.cell_type, p));
    }
}

#[test]
fn regular_polygons_are_ideal_and_other_counts_are_no_cells() {
    for count in 3..9 {
        let angle = |index: i32| std::f64::consts::TAU * f64::from(index) / f64::from(count);
        let points: Vec<Vector> =
            (0..count).map(|i| [angle(i).cos(), angle(i).sin(), 2.0]).collect();
        assert!((scaled_jacobian(CellType::Polygon, &points).unwrap() - 1.0).abs() < 1e-12);
        assert_eq!(scaled_jacobian(CellType::Hexahedron, &points[..1]), None);
    }
    assert_eq!(scaled_jacobian(CellType::Line, &[[0.0; 3]; 2]), None);
    assert_eq!(scaled_jacobian(CellType::Tetra, &[[1.0; 3]; 4]), Some(0.0), "shrunk to a point");
}

/// Mirrored cells: negative (Verdict gives pyramids 0), and always counted as inverted.
#[test]
fn every_mirrored_volume_cell_is_inverted() {
    for cell_type in CellType::ALL.into_iter().filter(|cell| cell.dimension() == 3) {
        let mesh = shapes::single_cell(cell_type);
        let whole = quality(mesh.cells(), mesh.points());
        assert!(whole.inverted == 0 && whole.min > 0.0, "{cell_type}: {whole:?}");
        let mirrored: Vec<Vector> = mesh.points().iter().map(|&[x, y, z]| [x, y, -z]).collect();
        let inverted = quality(mesh.cells(), &mirrored);
        assert!(inverted.inverted == 1 && inverted.min <= 0.0, "{cell_type}: {inverted:?}");
        // Whatever its order, the guard sees it pass through itself.
        let refusal =
            judge(&mesh, mesh.points(), &mirrored, &[1.0], &Guard::default()).unwrap_err();
        let Refusal::Quality(path) = refusal else { panic!("{cell_type}: {refusal}") };
        assert_eq!((path.inverted, path.failing), (1, 1), "{cell_type}");
        assert!(
            path.feasible_fraction < 0.5 && path.feasible_fraction > 0.3,
            "{cell_type}: {path:?}"
        );
        assert!(path.folded_faces > 0);
    }
}

/// The least over the corners of a wedge of the determinant of its three edges by their lengths, 1
/// where the triangles are equilateral: a corner's neighbours are the other two of its triangle and
/// the one across.
fn worst_corner_of_wedge(points: &[Vector], sign: f64) -> f64 {
    let corner = |at: usize| {
        let top = at / 3 * 3;
        let [a, b, c] = [top + (at + 1) % 3, top + (at + 2) % 3, (at + 3) % 6]
            .map(|to| crate::vector::subtract(points[to], points[at]));
        let upwards = if top == 0 { 1.0 } else { -1.0 };
        let length = |v: Vector| v.iter().map(|x| x * x).sum::<f64>().sqrt();
        sign * upwards * crate::vector::determinant(a, b, c) / (length(a) * length(b) * length(c))
    };
    2.0 / 3.0f64.sqrt() * (0..6).map(corner).fold(f64::INFINITY, f64::min)
}

proptest! {
    /// A wedge has the quality of its worst corner in whichever of the two orders it is written,
    /// and no cell is better than ideal.
    #[test]
    fn wedges_of_either_order_have_their_worst_corner(moves in prop::collection::vec(prop::array::uniform3(-0.4..0.4f64), 6)) {
        let unit = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 0.866, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.5, 0.866, 1.0]];
        let points: Vec<Vector> =
            unit.iter().zip(&moves).map(|(&a, &b)| crate::vector::add(a, b)).collect();
        let mut found = Vec::new();
        for order in [[0, 1, 2, 3, 4, 5], [0, 2, 1, 3, 5, 4], [3, 4, 5, 0, 1, 2]] {
            let cells = Cells::uniform(CellType::Wedge, order.to_vec()).unwrap();
            // The order is told by a mesh that is sound, and kept when it moves.
            let mesh = Mesh::new(unit.to_vec(), cells.clone(), FeatureSource::SharpEdges).unwrap();
            prop_assert!(mesh.cells().as_given().connectivity() == &order[..]);
            let value = scaled_jacobians(mesh.cells(), &points)[0];
            prop_assert!((value - worst_corner_of_wedge(&points, 1.0)).abs() < 1e-12, "{order:?}: {value}");
            let whole = quality(mesh.cells(), &points);
            prop_assert!(whole.max <= 1.0 + 1e-12 && whole.min == value);
            prop_assert!(volumes(mesh.cells(), mesh.points())[0] > 0.4);
            found.push((whole.inverted, (value * 1e9).round()));
        }
        prop_assert!(found.iter().all(|other| *other == found[0]), "{found:?}");
    }

    /// No scaled Jacobian exceeds 1, of no cell of any shape.
    #[test]
    fn no_cell_is_better_than_ideal(coordinates in prop::collection::vec(prop::array::uniform3(-1.0..1.0f64), 12)) {
        for cell_type in CellType::ALL {
            let Some(count) = cell_type.vertex_count() else { continue };
            let value = scaled_jacobian(cell_type, &coordinates[..count]);
            prop_assert!(value.is_none_or(|value| value <= 1.0 + 1e-12), "{cell_type}: {value:?}");
            let cells = Cells::uniform(cell_type, (0..).take(count).collect()).unwrap();
            prop_assert!(quality(&cells, &coordinates).max <= 1.0 + 1e-12, "{cell_type}");
        }
    }
}

#[test]
fn a_mesh_is_summed_up() {
    let mesh = shapes::box_of_tets([20, 10, 10], [0.0; 3], [2.0, 1.0, 1.0]);
    let mut points = mesh.points().to_vec();
    let moved = 7 + 21 * (5 + 11 * 5);
    points[moved][0] += 0.15;
    let values = scaled_jacobians(mesh.cells(), &points);
    let sum = quality(mesh.cells(), &points);
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    assert_eq!((sum.cells, sum.min), (values.len(), least));
    assert!((sum.mean - mean).abs() < 1e-12 && sum.max <= 1.0);
    assert_eq!(sum.inverted, values.iter().filter(|&&value| value <= 0.0).count());
    assert!(sum.inverted > 0);
    assert_eq!(sum.histogram.iter().sum::<u64>(), values.len() as u64);
    let mut sorted: Vec<(f64, usize)> = values.iter().copied().zip(0..).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let worst: Vec<(f64, usize)> =
        sum.worst.iter().map(|cell| (cell.scaled_jacobian, cell.cell)).collect();
    assert_eq!(worst, sorted[..10]);
    assert_eq!(sum.worst[0].centroid, centroid(mesh.cells(), sum.worst[0].cell, &points));

    let normalized = normalized_scaled_jacobians(mesh.cells(), mesh.points(), &points);
    assert!(normalized.iter().any(|&value| value < 0.0) && normalized.contains(&1.0));

    points[moved][1] = f64::NAN;
    let broken = quality(mesh.cells(), &points);
    assert_eq!((broken.min, broken.inverted), (-1.0, 24), "the tetrahedra around one vertex");
}

#[test]
fn nothing_to_measure_is_nothing_broken() {
    let none = quality(&Cells::new(), &[]);
    assert_eq!((none.cells, none.min, none.mean, none.max, none.inverted), (0, 1.0, 1.0, 1.0, 0));
}

#[cfg(feature = "parallel")]
#[test]
fn the_same_bits_whatever_the_number_of_threads() {
    let mesh = shapes::box_of_tets([16; 3], [0.0; 3], [1.0, 2.0, 3.0]);
    let end: Vec<Vector> =
        mesh.points().iter().map(|&[x, y, z]| [x + 0.1 * (7.0 * z).sin(), y * y, z]).collect();
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let judged = judge(
                &mesh,
                mesh.points(),
                &end,
                &[0.5, 1.0],
                &Guard { min_scaled_jacobian: 0.0, ..Guard::default() },
            );
            (quality(mesh.cells(), &end), judged)
        })
    };
    let one = run(1);
    assert_eq!(one, run(2));
    assert_eq!(one, run(3));
}

fn one_tet() -> Mesh {
    shapes::single_cell(CellType::Tetra)
}

fn broken(result: Result<PathQuality, Refusal>) -> BrokenPath {
    match result {
        Err(Refusal::Quality(path)) => *path,
        other => panic!("{other:?}"),
    }
}

/// Turning the base of a tetrahedron by half a turn about its axis: both ends are the same good
/// cell, but on straight paths every base vertex passes through the axis, where the cell has no
/// volume.
#[test]
fn an_inversion_between_valid_shapes_is_caught() {
    let turn = |angle: f64| -> Vec<Vector> {
        let corner = |index: f64| angle + index * std::f64::consts::TAU / 3.0;
        let base = [0.0, 1.0, 2.0].map(|index| [corner(index).cos(), corner(index).sin(), 0.0]);
        base.into_iter().chain([[0.0, 0.0, 1.0]]).collect()
    };
    let cells = Cells::uniform(CellType::Tetra, vec![0, 1, 2, 3]).unwrap();
    let mesh = Mesh::new(turn(0.0), cells, FeatureSource::SharpEdges).unwrap();
    let half = turn(std::f64::consts::PI);
    assert_eq!(quality(mesh.cells(), &half).inverted, 0);
    let path = broken(judge(&mesh, mesh.points(), &half, &[1.0], &Guard::default()));
    assert_eq!(path.inverted, 1);
    assert!((path.worst[0].fraction - 0.5).abs() < 1e-6, "{path:?}");
    assert!(path.min_scaled_jacobian.abs() < 1e-6);
    assert_eq!(path.folded_faces, 3, "the three side faces look the other way");
    assert!((0.4..0.5).contains(&path.feasible_fraction));
    // A quarter turn shrinks the cell on the way but does not invert it.
    assert!(judge(&mesh, mesh.points(), &turn(1.5), &[1.0], &Guard::default()).is_ok());
}

/// A vertex pressed towards the opposite face: the height falls as `1 - 2 t`, and so does the
/// determinant.
#[test]
fn the_feasible_fraction_is_that_of_the_closed_form() {
    let mesh = one_tet();
    let mut end = mesh.points().to_vec();
    end[3][2] = -1.0;
    let guard = Guard { min_scaled_jacobian: 0.0, ..Guard::default() };
    let path = broken(judge(&mesh, mesh.points(), &end, &[0.25, 0.5, 0.75, 1.0], &guard));
    assert!((path.feasible_fraction - 0.5).abs() < 2e-6, "{path:?}");
    assert!(path.feasible_fraction < 0.5);
    assert_eq!(path.worst[0].fraction, 1.0);
    let path = broken(judge(&mesh, mesh.points(), &end, &[1.0], &Guard::default()));
    // With height h < 1 the scaled Jacobian is √2 h / (√2 √(1 + h²)) at the sharpest corner.
    let h = 1.0 - 2.0 * path.feasible_fraction;
    let mut at = mesh.points().to_vec();
    at[3][2] = h;
    let value = scaled_jacobian(CellType::Tetra, &at).unwrap();
    assert!((value - 0.02).abs() < 1e-5 && value >= 0.02, "{value}");
    let error = Refusal::Quality(Box::new(path)).to_string();
    assert!(
        error.contains("cell 0") && error.contains("inside out") && error.contains("feasible"),
        "{error}"
    );
}

#[test]
fn a_mesh_below_the_floor_may_move_but_not_get_worse() {
    let flat: Vec<Vector> = one_tet().points().iter().map(|&[x, y, z]| [x, y, 0.01 * z]).collect();
    let mesh = one_tet().with_points(flat).unwrap();
    let shift = |by: f64, squeeze: f64| -> Vec<Vector> {
        mesh.points()
            .iter()
            .map(|&[x, y, z]| [x + by, y - 0.7 * by, squeeze * z + 0.3 * by])
            .collect()
    };
    let fractions = [0.2, 0.4, 1.0];
    let path =
        judge(&mesh, mesh.points(), &shift(1e3, 1.0), &fractions, &Guard::default()).unwrap();
    assert!(path.floor < 0.02 && (path.min_scaled_jacobian - path.floor).abs() < 1e-9);
    assert_eq!(path.shapes.len(), 3);
    assert!(judge(&mesh, mesh.points(), &shift(0.0, 0.9), &fractions, &Guard::default()).is_err());
    assert!(judge(&mesh, mesh.points(), &shift(0.0, 1.1), &fractions, &Guard::default()).is_ok());
}

#[test]
fn polygons_must_not_fold_over() {
    let mesh = shapes::plate([4, 4], [0.0; 2], [1.0; 2]);
    let mut end = mesh.points().to_vec();
    end[6][0] += 0.2;
    assert!(judge(&mesh, mesh.points(), &end, &[1.0], &Guard::default()).is_ok());
    end[6][0] += 0.2;
    let path = broken(judge(&mesh, mesh.points(), &end, &[1.0], &Guard::default()));
    assert!(path.inverted > 0 && path.folded_faces > 0);
}

/// A dart has a corner that turns against its normal, which no order has made.
#[test]
fn a_cell_that_is_broken_in_the_reference_hinders_only_what_moves_it() {
    let points = vec![
        [0.0, 0.0, 0.0],
        [2.0, 1.0, 0.0],
        [0.0, 2.0, 0.0],
        [0.5, 1.0, 0.0],
        [5.0, 0.0, 0.0],
        [6.0, 0.0, 0.0],
        [5.0, 1.0, 0.0],
    ];
    let mut cells = Cells::new();
    cells.push(CellType::Quad, &[0, 1, 2, 3]).unwrap();
    cells.push(CellType::Triangle, &[4, 5, 6]).unwrap();
    let mesh = Mesh::new(points, cells, FeatureSource::SharpEdges).unwrap();
    let moved = |vertex: usize, by: f64| {
        let mut end = mesh.points().to_vec();
        end[vertex][1] += by;
        end
    };
    let guard = Guard::default();
    let allows = |end: &[Vector]| {
        let judged = judge(&mesh, mesh.points(), end, &[0.5, 1.0], &guard);
        assert_eq!(judged.is_ok(), keeps(&mesh, mesh.points(), end, &guard));
        judged.is_ok()
    };
    assert!(allows(&moved(6, 0.5)), "the dart rests");
    assert!(!allows(&moved(6, -2.0)), "the triangle turns over");
    assert!(!allows(&moved(1, 0.1)), "the dart moves");
    let shifted = moved(1, 0.1);
    assert!(judge(&mesh, &shifted, &shifted, &[1.0], &guard).is_err(), "it rests elsewhere");
}

#[test]
fn senseless_arguments_are_named() {
    let mesh = one_tet();
    let points = mesh.points();
    let guard = Guard::default();
    let mut bad = points.to_vec();
    bad[2][1] = f64::INFINITY;
    assert!(matches!(
        judge(&mesh, &points[..3], points, &[1.0], &guard),
        Err(Refusal::PointCount { which: "start", .. })
    ));
    assert!(matches!(
        judge(&mesh, points, &bad, &[1.0], &guard),
        Err(Refusal::NotFinite { which: "end", vertex: 2, .. })
    ));
    for fractions in [&[0.0][..], &[0.5, 0.5], &[1.5], &[f64::NAN]] {
        assert!(matches!(
            judge(&mesh, points, points, fractions, &guard),
            Err(Refusal::Fraction { .. })
        ));
    }
    let guard = Guard { min_scaled_jacobian: f64::NAN, ..guard };
    assert!(matches!(judge(&mesh, points, points, &[1.0], &guard), Err(Refusal::Floor { .. })));
    let message =
        serde_json::from_str::<Guard>(r#"{"otherwise": "mend"}"#).unwrap_err().to_string();
    assert!(message.contains("mend") && message.contains("reject"), "{message}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    /// Whatever the guard lets through has no inverted cell in any of very many shapes along the
    /// way.
    #[test]
    fn what_is_let_through_is_valid_all_along(
        motion in prop::collection::vec(-0.6..0.6f64, 12),
        absurd in 0usize..20,
    ) {
        let mesh = one_tet();
        let factor = if absurd == 0 { 1e300 } else { 1.0 };
        let end: Vec<Vector> = mesh.points().iter().zip(motion.chunks_exact(3))
            .map(|(p, d)| std::array::from_fn(|axis| p[axis] + factor * d[axis])).collect();
        let guard = Guard { min_scaled_jacobian: 0.0, ..Guard::default() };
        let shape = |fraction: f64| -> Vec<Vector> {
            mesh.points().iter().zip(&end).map(|(&a, &b)| shape_at(a, b, fraction)).collect()
        };
        let valid = |fraction: f64| quality(mesh.cells(), &shape(fraction)).inverted == 0;
        match judge(&mesh, mesh.points(), &end, &[1.0], &guard) {
            Ok(_) => prop_assert!((1..=400).all(|k| valid(f64::from(k) / 400.0))),
            Err(Refusal::Quality(path)) => {
                let feasible = path.feasible_fraction;
                prop_assert!((1..=400).all(|k| valid(feasible * f64::from(k) / 400.0)));
                prop_assert!(feasible < 1.0);
            }
            Err(other) => prop_assert!(false, "{other}"),
        }
    }
}

/// Pixels and strips list their vertices in another order than around them.
#[test]
fn every_cell_of_dimension_2_is_judged_around() {
    for (cell_type, area) in [
        (CellType::Triangle, 0.5),
        (CellType::Quad, 1.0),
        (CellType::Pixel, 1.0),
        (CellType::TriangleStrip, 1.0),
    ] {
        let mesh = shapes::single_cell(cell_type);
        let measured = volumes(mesh.cells(), mesh.points());
        assert!((measured[0] - area).abs() < 1e-14, "{cell_type}: {measured:?}");
        let larger: Vec<Vector> = mesh.points().iter().map(|&point| scale(point, 1.5)).collect();
        let guard = Guard::default();
        judge(&mesh, mesh.points(), &larger, &[0.5, 1.0], &guard).expect("it only grows");
        // The first corner goes over to the other side.
        let mut over = mesh.points().to_vec();
        over[0] = [2.0, 2.0, 0.0];
        assert!(judge(&mesh, mesh.points(), &over, &[1.0], &guard).is_err(), "{cell_type}");
    }
}
