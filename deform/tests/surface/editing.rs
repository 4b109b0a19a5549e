use std::sync::Arc;

use super::*;
use tombolo_deform::edit::{EditError, InvalidEdit};
use tombolo_deform::mesh::{CellType, Cells};
use tombolo_deform::shapes;

/// A flat strip of `columns` squares from x = 0 to 1, with three more on each side that are fixed
/// (feature-0) and moved (feature-2).
fn strip(columns: usize) -> Mesh {
    let width = 3.0 / columns as f64;
    let plate = shapes::plate([columns + 6, 4], [-width, 0.0], [1.0 + width, 4.0 / columns as f64]);
    let mut face_tags = Vec::new();
    for (_, triangle) in plate.cells().iter() {
        let x =
            triangle.iter().map(|&vertex| plate.points()[vertex as usize][0]).sum::<f64>() / 3.0;
        face_tags.push(if x < 0.0 {
            0
        } else if x > 1.0 {
            2
        } else {
            1
        });
    }
    let faces = plate.cells().clone();
    let tagged = tombolo_deform::mesh::TaggedFaces { faces, tags: face_tags, names: vec![] };
    Mesh::new(plate.points().to_vec(), plate.cells().clone(), FeatureSource::Faces(tagged)).unwrap()
}

/// The polynomial through the points (x, y), at `at`.
fn interpolate(nodes: &[(f64, f64)], at: f64) -> f64 {
    let term = |(i, &(x, y)): (usize, &(f64, f64))| {
        let others = nodes.iter().enumerate().filter(|(j, _)| *j != i);
        y * others.map(|(_, &(other, _))| (at - other) / (x - other)).product::<f64>()
    };
    nodes.iter().enumerate().map(term).sum()
}

/// The largest difference to the polynomial that the scheme reproduces, and to the one of the
/// continuous problem.
fn strip_errors(columns: usize, order: HarmonicOrder) -> (f64, f64) {
    let mesh = strip(columns);
    let mut editor = editor(&mesh);
    let displacement = editor
        .displacement(&[translate(&["feature-2"], &["feature-0"], [0.0, 0.0, 1.0], order)])
        .unwrap();
    let step = 1.0 / columns as f64;
    let mut nodes = Vec::new();
    for ring in 0..order as usize {
        nodes.push((-step * ring as f64, 0.0));
        nodes.push((1.0 + step * ring as f64, 1.0));
    }
    let mut errors = (0.0f64, 0.0f64);
    for (point, moved) in editor.surface().points().iter().zip(&displacement) {
        let x = point[0].clamp(0.0, 1.0);
        let smooth = match order {
            HarmonicOrder::Harmonic => x,
            HarmonicOrder::Biharmonic => x * x * (3.0 - 2.0 * x),
            HarmonicOrder::Triharmonic => x * x * x * (10.0 - 15.0 * x + 6.0 * x * x),
        };
        errors.0 = errors.0.max((moved[2] - interpolate(&nodes, x)).abs());
        errors.1 = errors.1.max((moved[2] - smooth).abs());
    }
    errors
}

#[test]
fn a_strip_bends_as_the_closed_form_of_each_order() {
    for (order, discrete) in ORDERS.into_iter().zip([1e-13, 1e-11, 1e-8]) {
        let errors = [16, 32, 64].map(|columns| strip_errors(columns, order));
        for (exact, _) in errors {
            assert!(exact < discrete, "order {order}: {exact:e} from the scheme's own polynomial");
        }
        if order == HarmonicOrder::Harmonic {
            assert!(errors[2].1 < 1e-13);
        } else {
            // The slope is clamped between the two outermost rings, half a face outside: first
            // order.
            for pair in errors.windows(2) {
                let ratio = pair[0].1 / pair[1].1;
                assert!((1.7..2.3).contains(&ratio), "order {order}: {ratio} where 2 is expected");
            }
        }
    }
}

#[test]
fn the_side_of_a_box_follows_its_end_linearly_or_by_the_smooth_step() {
    let error = |columns: usize, order: HarmonicOrder| {
        let mesh =
            shapes::box_of_tets([columns, columns / 5, columns / 5], [0.0; 3], [1.0, 0.2, 0.2]);
        let mut editor = editor(&mesh);
        let displacement = editor
            .displacement(&[translate(&["x-max"], &["x-min"], [0.0, 1.0, 0.0], order)])
            .unwrap();
        let expected =
            |x: f64| if order == HarmonicOrder::Harmonic { x } else { x * x * (3.0 - 2.0 * x) };
        let points = editor.surface().points().iter();
        points
            .zip(&displacement)
            .map(|(point, moved)| (moved[1] - expected(point[0])).abs())
            .fold(0.0, f64::max)
    };
    assert!(error(20, HarmonicOrder::Harmonic) < 1e-12);
    let errors = [10, 20, 40].map(|columns| error(columns, HarmonicOrder::Biharmonic));
    // The ring of faces beyond the rim holds the slope: first order, as on the strip.
    assert!(
        errors[0] / errors[1] > 1.5 && errors[1] / errors[2] > 1.7 && errors[2] < 0.01,
        "{errors:?}"
    );
}

/// A flat plate whose inner vertices are shifted at random, so that no two triangles are alike.
fn rough_plate(count: usize) -> Mesh {
    let plate = shapes::plate([count, count], [0.0, 0.0], [1.0, 1.0]);
    let mut random = noise(7);
    let step = 1.0 / count as f64;
    let points = plate
        .points()
        .iter()
        .map(|&[x, y, z]| {
            let inner = (step / 2.0..1.0 - step / 2.0).contains(&x)
                && (step / 2.0..1.0 - step / 2.0).contains(&y);
            let by = if inner { 0.7 * step } else { 0.0 };
            [x + by * (random() - 0.5), y + by * (random() - 0.5), z]
        })
        .collect();
    let middle = |[x, y, _]: Vector| i64::from((0.3..0.7).contains(&x) && (0.3..0.7).contains(&y));
    tagged(&plate.with_points(points).unwrap(), middle)
}

#[test]
fn affine_motion_is_reproduced_on_flat_pieces() {
    // feature-0 is the outside, whose vertices make the handle; what is inside feature-1 only is
    // free.
    let mesh = rough_plate(20);
    let mut editor = editor(&mesh);
    let factors = [1.3, 0.6, 1.0];
    for (order, tolerance) in ORDERS.into_iter().zip([1e-13, 1e-12, 1e-12]) {
        let displacement =
            editor.displacement(&[scale(&["feature-0"], &[], factors, order)]).unwrap();
        let handle = editor.surface().features().vertices(0);
        assert!(handle.len() < displacement.len() - 20);
        for (point, moved) in editor.surface().points().iter().zip(&displacement) {
            for axis in 0..2 {
                let expected = (factors[axis] - 1.0) * (point[axis] - 0.5);
                assert!(
                    (moved[axis] - expected).abs() < tolerance,
                    "order {order}: {:e}",
                    moved[axis] - expected
                );
            }
            assert_eq!(moved[2], 0.0);
        }
    }
}

#[test]
fn one_translation_of_every_handle_moves_the_whole_surface_with_it() {
    let mesh = shapes::box_of_tets([6, 5, 4], [0.0; 3], [1.0; 3]);
    let mut editor = editor(&mesh);
    for order in ORDERS {
        let by = [0.1, -20.3, 1e-5];
        let displacement =
            editor.displacement(&[translate(&["x-min", "z-max"], &[], by, order)]).unwrap();
        assert!(displacement.iter().all(|&moved| moved == by), "order {order}");
    }
}

#[test]
fn an_empty_stack_gives_exact_zeros_and_a_stack_taken_back_its_old_bits() {
    let mesh = shapes::torus(2.0, 0.7, [24, 12]);
    let mut editor = editor(&mesh);
    assert!(editor.displacement(&[]).unwrap().iter().flatten().all(|value| value.to_bits() == 0));
    let first =
        translate(&["feature-0"], &["feature-2"], [0.0, 0.0, 1.0], HarmonicOrder::Biharmonic);
    let second = scale(&["feature-1"], &["feature-3"], [1.0, 2.0, 0.5], HarmonicOrder::Triharmonic);
    let one = editor.displacement(std::slice::from_ref(&first)).unwrap();
    let two = editor.displacement(&[first.clone(), second.clone()]).unwrap();
    assert_ne!(one, two);
    assert_eq!(editor.displacement(std::slice::from_ref(&first)).unwrap(), one);
    assert_eq!(editor.displacement(&[first.clone(), second.clone()]).unwrap(), two);
    assert_eq!(
        super::editor(&mesh).displacement(&[first, second]).unwrap(),
        two,
        "from nothing: the same bits"
    );
    assert!(editor.displacement(&[]).unwrap().iter().flatten().all(|value| value.to_bits() == 0));
}

#[test]
fn a_pinched_throat_has_half_its_thickness_and_moves_along_z_only() {
    let channel = shapes::box_of_tets([4, 42, 6], [-0.025, -0.525, -0.05], [0.025, 0.525, 0.05]);
    let channel = tagged(&channel, |[_, y, _]| {
        if y < -0.524 {
            1
        } else if y > 0.524 {
            2
        } else {
            i64::from(y.abs() < 0.11) * 3
        }
    });
    let mut editor = editor(&channel);
    for order in ORDERS {
        let pinch = scale(&["feature-3"], &["feature-1", "feature-2"], [1.0, 1.0, 0.5], order);
        let displacement = editor.displacement(&[pinch]).unwrap();
        let surface = editor.surface();
        assert!(displacement.iter().all(|moved| moved[0] == 0.0 && moved[1] == 0.0));
        let throat = surface.features().index("feature-3").unwrap();
        for &vertex in surface.features().vertices(throat) {
            let [point, moved] = [surface.points()[vertex as usize], displacement[vertex as usize]];
            assert!((point[2] + moved[2] - 0.5 * point[2]).abs() < 1e-15);
        }
        for feature in ["feature-1", "feature-2"] {
            for &vertex in surface.features().vertices(surface.features().index(feature).unwrap()) {
                assert_eq!(displacement[vertex as usize], [0.0; 3]);
            }
        }
        let extreme = displacement.iter().map(|moved| moved[2].abs()).fold(0.0, f64::max);
        assert!(
            extreme < 0.0251 + if order == HarmonicOrder::Harmonic { 0.0 } else { 0.005 },
            "{extreme}"
        );
    }
}

fn assert_independent_of_numbers(counts: [usize; 2], roughness: f64) {
    let mesh = tagged(&shapes::torus(2.0, 0.7, counts), |[x, y, _]| {
        if x > 1.5 {
            0
        } else if x < -1.5 && y > -0.5 {
            1
        } else {
            2
        }
    });
    // Irregular, so that triangles are obtuse and edges flip.
    let mut random = noise(3);
    let points: Vec<Vector> = mesh
        .points()
        .iter()
        .map(|point| point.map(|value| value + roughness * (random() - 0.5)))
        .collect();
    let mesh = mesh.with_points(points).unwrap();
    let count = mesh.points().len();
    let mut order: Vec<usize> = (0..count).collect();
    for last in (1..count).rev() {
        order.swap(last, (random() * (last + 1) as f64) as usize);
    }
    let mut new_number = vec![0u32; count];
    for (new, &old) in order.iter().enumerate() {
        new_number[old] = new as u32;
    }
    let FeatureSource::Vertices(tagged) = mesh.features() else { unreachable!() };
    let mut triangles: Vec<Vec<u32>> = mesh
        .cells()
        .iter()
        .map(|(_, triangle)| {
            (1..4).map(|corner| new_number[triangle[corner % 3] as usize]).collect()
        })
        .collect();
    triangles.reverse();
    let shuffled = Mesh::new(
        order.iter().map(|&old| mesh.points()[old]).collect(),
        Cells::uniform(CellType::Triangle, triangles.concat()).unwrap(),
        FeatureSource::Vertices(
            order.iter().map(|&old| tagged.tags[old]).collect::<Vec<i64>>().into(),
        ),
    )
    .unwrap();
    let (mut first, mut second) = (editor(&mesh), editor(&shuffled));
    for order in ORDERS {
        let stack = [
            scale(&["feature-0"], &["feature-1"], [1.0, 1.5, 0.7], order),
            translate(&["feature-1"], &["feature-0"], [-0.5, 0.0, 0.5], order),
        ];
        let [a, b] = [first.displacement(&stack).unwrap(), second.displacement(&stack).unwrap()];
        for (old, moved) in a.iter().enumerate() {
            for axis in 0..3 {
                let difference = moved[axis] - b[new_number[old] as usize][axis];
                assert!(difference.abs() < 1e-10, "order {order}: {difference:e}");
            }
        }
    }
}

#[test]
fn results_do_not_depend_on_vertex_numbers() {
    assert_independent_of_numbers([40, 20], 0.12);
    assert_independent_of_numbers([260, 80], 0.02);
}

#[test]
fn layers_act_on_the_shape_below() {
    let mesh = shapes::box_of_tets([6, 2, 2], [0.0; 3], [3.0, 1.0, 1.0]);
    let mut editor = editor(&mesh);
    let order = HarmonicOrder::Biharmonic;
    let handle = editor.surface().features().index("x-max").unwrap();
    let halve = scale(&["x-max"], &["x-min"], [1.0, 1.0, 0.5], order);
    let lift = translate(&["x-max"], &["x-min"], [0.0, 0.0, 10.0], order);
    let displacement = editor.displacement(&[halve.clone(), lift, halve]).unwrap();
    for &vertex in editor.surface().features().vertices(handle) {
        let z = editor.surface().points()[vertex as usize][2];
        // Halved about the middle of the handle as it lies, twice.
        assert!((z + displacement[vertex as usize][2] - (10.5 + 0.25 * (z - 0.5))).abs() < 1e-12);
    }
}

#[test]
fn a_centre_can_be_given() {
    let mesh = shapes::box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]);
    let mut editor = editor(&mesh);
    let edit = Edit::ScaleDirection(ScaleDirection {
        features: names(&shapes::BOX_FEATURES),
        factors: [2.0, 0.0, -1.0],
        center: Some([1.0, 2.0, 3.0]),
        ..ScaleDirection::default()
    });
    let displacement = editor.displacement(&[edit]).unwrap();
    for (point, moved) in editor.surface().points().iter().zip(&displacement) {
        assert_eq!(*moved, [point[0] - 1.0, 2.0 - point[1], -2.0 * (point[2] - 3.0)]);
    }
}

#[test]
fn what_is_fixed_stays_even_where_it_is_in_the_handle() {
    let mesh = shapes::box_of_tets([3, 3, 3], [0.0; 3], [1.0; 3]);
    let mut editor = editor(&mesh);
    let edits = [
        translate(&["x-max"], &["y-min"], [1.0; 3], HarmonicOrder::Biharmonic),
        scale(&["x-max"], &["y-min"], [1.0, 2.0, 3.0], HarmonicOrder::Harmonic),
        scale_normals(&["x-max"], &["y-min"], 0.3),
    ];
    let displacement = editor.displacement(&edits).unwrap();
    let fixed = editor.surface().features().index("y-min").unwrap();
    for &vertex in editor.surface().features().vertices(fixed) {
        assert_eq!(displacement[vertex as usize], [0.0; 3]);
    }
}

#[test]
fn normals_are_those_of_the_handle_alone() {
    let mesh = shapes::box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]);
    let mut editor = editor(&mesh);
    let displacement = editor.displacement(&[scale_normals(&["z-max"], &["z-min"], 0.25)]).unwrap();
    let top = editor.surface().features().index("z-max").unwrap();
    for &vertex in editor.surface().features().vertices(top) {
        assert_eq!(displacement[vertex as usize], [0.0, 0.0, 0.25], "at the rim too");
    }
    assert!(displacement.iter().all(|moved| moved[0] == 0.0 && moved[1] == 0.0));
}

#[test]
fn a_torus_scaled_along_its_normals_is_a_thicker_torus() {
    let error = |around: usize| {
        let mesh = shapes::torus(2.0, 0.5, [4 * around, around]);
        let mut editor = editor(&mesh);
        let all = ["feature-0", "feature-1", "feature-2", "feature-3"];
        let displacement = editor.displacement(&[scale_normals(&all, &[], 0.2)]).unwrap();
        let distance = |[x, y, z]: Vector| (x.hypot(y) - 2.0).hypot(z);
        let shape = moved(editor.surface(), &displacement);
        shape.into_iter().map(|point| (distance(point) - 0.7).abs()).fold(0.0, f64::max)
    };
    let [coarse, fine] = [error(12), error(24)];
    assert!(fine < 1e-3 && coarse / fine > 3.0, "{coarse:e} {fine:e}");
}

#[test]
fn components_on_which_nothing_is_prescribed_stay() {
    let mesh = shapes::box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]);
    let count = mesh.points().len() as u32;
    let mut points = mesh.points().to_vec();
    points.extend(mesh.points().iter().map(|point| [point[0] + 5.0, point[1], point[2]]));
    let connectivity = mesh.cells().connectivity();
    let both = connectivity
        .iter()
        .copied()
        .chain(connectivity.iter().map(|vertex| vertex + count))
        .collect();
    let two = Mesh::new(
        points,
        Cells::uniform(CellType::Tetra, both).unwrap(),
        FeatureSource::SharpEdges,
    )
    .unwrap();
    let mut editor = editor(&two);
    assert_eq!(editor.surface().features().names().len(), 12);
    for order in ORDERS {
        let edit = translate(&["feature-1"], &["feature-2"], [1.0, 2.0, 3.0], order);
        let displacement = editor.displacement(&[edit]).unwrap();
        for (point, moved) in editor.surface().points().iter().zip(&displacement) {
            assert!(point[0] < 4.0 || *moved == [0.0; 3]);
            assert!(moved.iter().all(|value| value.abs() < 4.0));
        }
    }
}

#[test]
fn triangles_without_area_do_no_harm() {
    // Columns of a plate drawn together until whole rows of triangles have no area.
    let plate = shapes::plate([10, 4], [0.0, 0.0], [10.0, 4.0]);
    let points: Vec<Vector> =
        plate.points().iter().map(|&[x, y, z]| [if x == 5.0 { 4.0 } else { x }, y, z]).collect();
    let mesh = tagged(&plate.with_points(points).unwrap(), |[x, ..]| {
        if x < 2.5 { 0 } else { 1 + i64::from(x > 7.5) }
    });
    let mut editor = editor(&mesh);
    for order in ORDERS {
        let edit = translate(&["feature-2"], &["feature-0"], [0.0, 0.0, 1.0], order);
        let displacement = editor.displacement(&[edit]).unwrap();
        assert!(displacement.iter().all(|moved| (-0.2..1.2).contains(&moved[2])), "order {order}");
    }
}

/// A Moebius strip: no way round is the outer one.
pub fn moebius_strip() -> Mesh {
    let count = 24;
    let mut points = Vec::new();
    for place in 0..count {
        let angle = std::f64::consts::TAU * place as f64 / count as f64;
        for across in [-0.4, 0.0, 0.4] {
            let radius = 2.0 + across * (angle / 2.0).cos();
            points.push([radius * angle.cos(), radius * angle.sin(), across * (angle / 2.0).sin()]);
        }
    }
    let mut cells = Cells::new();
    for place in 0..count as u32 {
        let next = |row: u32| if place + 1 == count as u32 { 2 - row } else { 3 * place + 3 + row };
        for row in 0..2 {
            cells
                .push(
                    CellType::Quad,
                    &[3 * place + row, next(row), next(row + 1), 3 * place + row + 1],
                )
                .unwrap();
        }
    }
    let tags: Vec<i64> = points
        .iter()
        .map(|point| if point[0] > 1.0 { 0 } else { 1 + i64::from(point[0] < -1.0) })
        .collect();
    Mesh::new(points, cells, FeatureSource::Vertices(tags.into())).unwrap()
}

#[test]
fn a_surface_with_one_side_only_can_be_edited() {
    let mesh = moebius_strip();
    let mut editor = editor(&mesh);
    for order in ORDERS {
        let displacement = editor
            .displacement(&[translate(&["feature-2"], &["feature-0"], [0.0, 0.0, 1.0], order)])
            .unwrap();
        assert!(displacement.iter().all(|moved| (-0.5..1.5).contains(&moved[2])), "order {order}");
    }
}

#[test]
fn lengths_and_places_of_any_size_do_no_harm() {
    let reference = shapes::box_of_tets([6, 2, 2], [0.0; 3], [3.0, 1.0, 1.0]);
    let answer = |size: f64| {
        let points =
            reference.points().iter().map(|point| point.map(|value| value * size)).collect();
        let mut editor = editor(&reference.with_points(points).unwrap());
        let by = [0.0, 0.0, size];
        let edit = translate(&["x-max"], &["x-min"], by, HarmonicOrder::Triharmonic);
        editor
            .displacement(&[edit])
            .unwrap()
            .into_iter()
            .map(|moved| moved[2] / size)
            .collect::<Vec<_>>()
    };
    let one = answer(1.0);
    for size in [1e-150, 1e-6, 1e9, 1e200] {
        for (a, b) in answer(size).iter().zip(&one) {
            assert!((a - b).abs() < 1e-9, "size {size:e}");
        }
    }
}

#[test]
fn more_choices_than_are_kept_give_the_same_answers() {
    let mesh = shapes::box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]);
    let mut editor = editor(&mesh);
    let edits: Vec<Edit> = shapes::BOX_FEATURES
        .iter()
        .flat_map(|feature| {
            ORDERS.map(|order| translate(&[feature], &["x-min", "y-min"], [0.1, 0.2, 0.3], order))
        })
        .filter(|edit| !["x-min", "y-min"].contains(&edit.features()[0].as_str()))
        .collect();
    let once: Vec<_> =
        edits.iter().map(|edit| editor.displacement(std::slice::from_ref(edit)).unwrap()).collect();
    for (edit, expected) in edits.iter().zip(&once).rev() {
        assert_eq!(&editor.displacement(std::slice::from_ref(edit)).unwrap(), expected);
    }
}

#[test]
fn every_mistake_is_named_and_changes_nothing() {
    let mesh = shapes::box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]);
    let mut editor = editor(&mesh);
    let order = HarmonicOrder::Biharmonic;
    let good = translate(&["x-max"], &["x-min"], [0.1, 0.0, 0.0], order);
    let expected = editor.displacement(std::slice::from_ref(&good)).unwrap();
    let mut refused = |second: Edit| {
        let error = editor.displacement(&[good.clone(), second]).unwrap_err();
        assert_eq!(editor.displacement(std::slice::from_ref(&good)).unwrap(), expected);
        error
    };

    let error = refused(translate(&["x-maxi"], &[], [0.0; 3], order));
    assert!(matches!(&error, EditError::UnknownFeature { edit: 1, field: "features", .. }));
    assert!(error.to_string().starts_with(
        "edit 1 (translate): features: there is no feature 'x-maxi'; did you mean 'x-max'"
    ));
    let error = refused(scale(&["x-max"], &["inlet"], [1.0; 3], order));
    assert!(matches!(&error, EditError::UnknownFeature { edit: 1, field: "fixed", .. }), "{error}");
    assert!(error.to_string().contains("the features are x-min, x-max"));

    let error = refused(translate(&["x-max"], &[], [0.0, f64::NAN, 0.0], order));
    assert_eq!(error.to_string(), "edit 1 (translate): by[1]: NaN is not a finite number");
    let error = refused(scale_normals(&["x-max"], &[], f64::INFINITY));
    assert_eq!(error.to_string(), "edit 1 (scale_normals): distance: inf is not a finite number");
    let error = refused(translate(&[], &[], [0.0; 3], order));
    assert!(matches!(error, EditError::Invalid { edit: 1, source: InvalidEdit::NoHandle, .. }));

    let error = refused(translate(&["x-max"], &["x-max", "x-min"], [1.0; 3], order));
    assert!(matches!(&error, EditError::HandleFixed { edit: 1, .. }), "{error}");

    // A displacement of vertices that are all fixed, or none of which lies in what may move.
    let top = surface_vertices(&mesh, "x-max");
    let values: Vec<[f64; 3]> = top.iter().map(|_| [0.1, 0.0, 0.0]).collect();
    for (parts, moves) in [
        (r#""fixed": ["x-max"]"#, false),
        (r#""features": ["x-min"]"#, false),
        (r#""fixed": ["y-max"]"#, true),
    ] {
        let edit = format!(
            r#"{{"displacement": {{{parts}, "vertices": {top:?}, "values": {values:?}}}}}"#
        );
        let edit: Edit = serde_json::from_str(&edit).unwrap();
        if moves {
            assert!(editor.displacement(&[edit]).is_ok());
        } else {
            let error = editor.displacement(&[edit]).unwrap_err();
            let count = top.len();
            assert_eq!(error, EditError::NothingMoves { edit: 0, vertices: count });
            assert!(error.to_string().contains("so that nothing can move"), "{error}");
        }
    }
}

fn surface_vertices(mesh: &Mesh, feature: &str) -> Vec<u32> {
    let surface = extract(mesh);
    let feature = surface.features().index(feature).unwrap();
    surface
        .features()
        .vertices(feature)
        .iter()
        .map(|&vertex| surface.vertices()[vertex as usize])
        .collect()
}

#[test]
fn what_overflows_or_has_no_normal_is_refused() {
    let mesh = shapes::box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]);
    let mut editor = editor(&mesh);
    let order = HarmonicOrder::Harmonic;
    let far = translate(&["x-max"], &["x-min"], [1.7e308, 0.0, 0.0], order);
    let error = editor.displacement(&[far.clone(), far]).unwrap_err();
    assert!(matches!(error, EditError::OutOfRange { edit: 1, .. }), "{error}");
    let flat = scale(&["x-max"], &["x-min"], [1.0, 0.0, 0.0], order);
    let error =
        editor.displacement(&[flat, scale_normals(&["x-max"], &["x-min"], 1.0)]).unwrap_err();
    assert!(matches!(error, EditError::NoNormal { edit: 1, .. }), "{error}");
}

#[test]
fn an_editor_can_be_handed_to_another_thread() {
    fn is_send<T: Send + Sync>(_: &T) {}
    let surface = Arc::new(extract(&shapes::torus(2.0, 0.5, [8, 8])));
    is_send(&Editor::new(surface).unwrap());
}
