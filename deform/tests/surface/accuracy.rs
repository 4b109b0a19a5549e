use std::sync::Arc;

use super::*;
use tombolo_deform::edit::EditError;
use tombolo_deform::mesh::{CellType, Cells};
use tombolo_deform::shapes;
use tombolo_deform::surface::SurfaceError;

fn torus(counts: [usize; 2]) -> Mesh {
    tagged(&shapes::torus(2.0, 0.7, counts), |[x, ..]| {
        if x > 1.7 {
            0
        } else if x < -1.7 {
            1
        } else {
            2
        }
    })
}

#[test]
fn rounding_leaves_less_than_a_hundred_millionth_of_the_motion() {
    let mut editor = editor(&torus([160, 60]));
    for (order, most) in ORDERS.into_iter().zip([1e-13, 1e-11, 1e-8]) {
        let stack = [translate(&["feature-0"], &["feature-1"], [0.1, 0.2, 0.3], order)];
        let error = editor.forward_error(&stack).unwrap();
        assert!(error < most, "order {order}: {error:e}");
    }
    assert_eq!(editor.forward_error(&[]).unwrap(), 0.0);
}

/// Edits of every kind that has an amount, with amounts that need some, all and none of their
/// bases.
fn amounts(kind: usize, amount: f64) -> Edit {
    let body = match kind {
        0 => format!(r#"{{"translate": {{"by": [{amount}, 0, 0.5]"#),
        1 => format!(r#"{{"rotate": {{"axis": [0, {amount}, 1], "degrees": {}"#, 20.0 * amount),
        2 => format!(
            r#"{{"scale_direction": {{"factors": [1, {}, {}]"#,
            1.0 + amount,
            1.0 + 0.5 * amount
        ),
        3 => format!(r#"{{"scale_normals": {{"distance": {}"#, 0.1 * amount),
        _ => format!(
            r#"{{"affine": {{"matrix": [[1, {amount}, 0], [0, 1, 0], [0, 0, 1]], "translation": [0, 0, {}]"#,
            amount.floor()
        ),
    };
    serde_json::from_str(&format!(
        r#"{body}, "features": ["feature-0"], "fixed": ["feature-1"]}}}}"#
    ))
    .unwrap()
}

#[test]
fn a_drag_gives_the_bits_of_a_first_answer() {
    let mesh = torus([24, 10]);
    let mut kept = editor(&mesh);
    let mut memory = Vec::new();
    let below =
        translate(&["feature-1"], &["feature-0"], [0.0, 0.3, 0.0], HarmonicOrder::Triharmonic);
    for kind in 0..5 {
        for amount in [0.5, 0.0, -0.25, 1.5, 0.5] {
            for stack in [vec![amounts(kind, amount)], vec![below.clone(), amounts(kind, amount)]] {
                kept.displacement_into(&stack, &mut memory).unwrap();
                assert_eq!(memory, editor(&mesh).displacement(&stack).unwrap(), "{stack:?}");
            }
        }
    }
    // A layer in the middle, a muted one, and one taken out again.
    let top = amounts(2, 0.5);
    for stack in [
        vec![below.clone(), amounts(0, 0.1), top.clone()],
        vec![below.clone(), amounts(0, 0.2), top.clone()],
        vec![below.clone(), top.clone()],
        vec![top.clone(), below],
        vec![top],
        vec![],
    ] {
        kept.displacement_into(&stack, &mut memory).unwrap();
        assert_eq!(memory, editor(&mesh).displacement(&stack).unwrap(), "{stack:?}");
    }
}

#[test]
fn an_amount_that_is_not_finite_is_refused_in_a_drag_too() {
    let mut editor = editor(&torus([12, 6]));
    let by = |z: f64| {
        [translate(&["feature-0"], &["feature-1"], [0.0, 0.0, z], HarmonicOrder::Biharmonic)]
    };
    let first = editor.displacement(&by(1.0)).unwrap();
    assert!(matches!(editor.displacement(&by(f64::NAN)), Err(EditError::Invalid { edit: 0, .. })));
    assert_eq!(editor.displacement(&by(1.0)).unwrap(), first);
}

#[test]
fn without_a_fixed_feature_the_component_goes_with_its_handle() {
    let mut editor = editor(&torus([24, 10]));
    for order in ORDERS {
        let by = [0.25, -3.0, 1e-3];
        let displacement =
            editor.displacement(&[translate(&["feature-0"], &[], by, order)]).unwrap();
        assert!(displacement.iter().all(|&moved| moved == by));
    }
}

fn triangles(points: &[Vector], corners: &[u32]) -> Mesh {
    let tags: Vec<i64> = points.iter().map(|point| i64::from(point[0] > 0.5)).collect();
    let cells = Cells::uniform(CellType::Triangle, corners.to_vec()).unwrap();
    Mesh::new(points.to_vec(), cells, FeatureSource::Vertices(tags.into())).unwrap()
}

#[test]
fn a_vertex_that_joins_faces_by_itself_is_named() {
    // Two squares of two triangles that share a corner, 2, and nothing else.
    let points = [
        [-1.0, -1.0, 0.0],
        [0.0, -1.0, 0.0],
        [0.0, 0.0, 0.0],
        [-1.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, 1.0, 0.0],
    ];
    let mesh = triangles(&points, &[0, 1, 2, 0, 2, 3, 2, 4, 5, 2, 5, 6]);
    let error = Editor::new(Arc::new(extract(&mesh))).unwrap_err();
    assert_eq!(error, SurfaceError::NonManifoldVertex { vertex: 2 });
    assert!(error.to_string().contains("mesh vertex 2"));
    // Joined by a face on one side, they make a surface.
    let mesh = triangles(&points, &[0, 1, 2, 0, 2, 3, 2, 4, 5, 2, 5, 6, 1, 4, 2]);
    assert!(Editor::new(Arc::new(extract(&mesh))).is_ok());
}

#[test]
fn a_seam_that_an_edit_would_open_is_named() {
    // Two squares side by side: the vertices 4 and 5 lie where 1 and 2 do.
    let points = [
        [0.0, 0.0, 0.0],
        [0.5, 0.0, 0.0],
        [0.5, 1.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.5, 0.0, 0.0],
        [0.5, 1.0, -0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
    ];
    let mesh = triangles(&points, &[0, 1, 2, 0, 2, 3, 4, 6, 7, 4, 7, 5]);
    let tags = vec![0, 0, 0, 0, 1, 1, 1, 1];
    let mesh = Mesh::new(
        mesh.points().to_vec(),
        mesh.cells().clone(),
        FeatureSource::Vertices(tags.into()),
    )
    .unwrap();
    let mut editor = editor(&mesh);
    let order = HarmonicOrder::Harmonic;
    let open = translate(&["feature-1"], &["feature-0"], [0.0, 0.0, 1.0], order);
    match editor.displacement(&[open]).unwrap_err() {
        EditError::OpensSeam { edit: 0, vertices, .. } => {
            assert!([[1, 4], [2, 5]].contains(&vertices))
        }
        other => panic!("{other}"),
    }
    let both = translate(&["feature-0", "feature-1"], &[], [0.0, 0.0, 1.0], order);
    assert!(editor.displacement(&[both]).is_ok());
}

/// What becomes of a strip one square high whose ends are `rings` squares wide, against the profile
/// of the continuous problem.
fn profile_error(
    columns: usize,
    rings: usize,
    order: HarmonicOrder,
    profile: impl Fn(f64) -> f64,
) -> f64 {
    let step = 1.0 / columns as f64;
    let out = (rings - 1) as f64 * step;
    let mesh = tagged(
        &shapes::plate([columns + 2 * (rings - 1), 3], [-out, 0.0], [1.0 + out, 3.0 * step]),
        |[x, ..]| i64::from(x > 0.5),
    );
    let region = |lower: f64, upper: f64| {
        format!(r#"{{"box": {{"lower": [{lower}, -1, -1], "upper": [{upper}, 9, 1]}}}}"#)
    };
    let edit: Edit = serde_json::from_str(&format!(
        r#"{{"translate": {{"by": [0, 0, 1], "harmonic_order": {order}, "region": {}, "fixed_region": {}}}}}"#,
        region(1.0, 9.0),
        region(-9.0, 0.0)
    ))
    .unwrap();
    let mut editor = editor(&mesh);
    let displacement = editor.displacement(&[edit]).unwrap();
    let points = editor.surface().points().iter().zip(&displacement);
    points
        .map(|(point, moved)| (moved[2] - profile(point[0].clamp(0.0, 1.0))).abs())
        .fold(0.0, f64::max)
}

/// As many rings of prescribed vertices as the order clamp as many derivatives, and an open rim is
/// a mirror: it doubles the rings that end there.
#[test]
fn each_ring_of_prescribed_vertices_clamps_one_derivative_more() {
    let line = |x: f64| x;
    let cubic = |x: f64| x * x * (3.0 - 2.0 * x);
    let quintic = |x: f64| x * x * x * (10.0 - 15.0 * x + 6.0 * x * x);
    // The polynomial of degree 5 whose first and third derivatives vanish at both ends: the
    // curvature is free there.
    let mirrored = |x: f64| 2.5 * x * x - 2.5 * x.powi(4) + x.powi(5);
    for (rings, order, profile) in [
        (1, HarmonicOrder::Harmonic, &line as &dyn Fn(f64) -> f64),
        (1, HarmonicOrder::Biharmonic, &cubic),
        (2, HarmonicOrder::Biharmonic, &cubic),
        (3, HarmonicOrder::Biharmonic, &cubic),
        (1, HarmonicOrder::Triharmonic, &mirrored),
        (2, HarmonicOrder::Triharmonic, &quintic),
        (3, HarmonicOrder::Triharmonic, &quintic),
        (4, HarmonicOrder::Triharmonic, &quintic),
    ] {
        let [coarse, fine] = [16, 32].map(|columns| profile_error(columns, rings, order, profile));
        assert!(
            fine < 1e-8 || (1.6..4.6).contains(&(coarse / fine)),
            "{rings} rings, order {order}: {coarse} {fine}"
        );
    }
}

#[test]
fn a_vertex_with_too_many_neighbours_is_refused_before_memory_is_asked_for() {
    // A wheel: every vertex of the rim is coupled with every other one through the hub.
    let count = 9000;
    let mut points = vec![[0.0; 3]];
    points.extend((0..count).map(|place| {
        let angle = std::f64::consts::TAU * f64::from(place) / f64::from(count);
        [angle.cos(), angle.sin(), 0.0]
    }));
    let corners: Vec<u32> =
        (0..count).flat_map(|place| [0, 1 + place, 1 + (place + 1) % count]).collect();
    let mut editor = editor(&triangles(&points, &corners));
    let edit = |order| [translate(&["feature-1"], &[], [0.0, 0.0, 1.0], order)];
    let error = editor.displacement(&edit(HarmonicOrder::Biharmonic)).unwrap_err();
    assert!(matches!(error, EditError::NotSolvable { edit: 0, .. }), "{error}");
    assert!(error.to_string().contains("does not fit in memory"), "{error}");
    assert!(editor.displacement(&edit(HarmonicOrder::Harmonic)).is_ok());
}

#[cfg(feature = "parallel")]
#[test]
fn no_bit_depends_on_the_number_of_threads() {
    let mesh = torus([300, 120]);
    let shaped = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut editor = editor(&mesh);
            ORDERS.map(|order| {
                editor
                    .displacement(&[translate(
                        &["feature-0"],
                        &["feature-1"],
                        [0.1, 0.2, 0.3],
                        order,
                    )])
                    .unwrap()
            })
        })
    };
    let one = shaped(1);
    for threads in [2, 3, 8] {
        assert!(shaped(threads) == one, "{threads} threads");
    }
}
