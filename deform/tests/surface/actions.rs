//! What each kind of edit does, against closed forms; regions, muting, and what is refused.

use super::*;
use tombolo_deform::edit::{EditError, InvalidEdit, Region};
use tombolo_deform::shapes;

fn edit(json: serde_json::Value) -> Edit {
    serde_json::from_value(json).expect("an edit")
}

/// The product of unit quaternions turns a vector; written without the formula that the kernel
/// uses.
fn turned(axis: Vector, degrees: f64, point: Vector) -> Vector {
    let length = axis.iter().map(|part| part * part).sum::<f64>().sqrt();
    let half = degrees.to_radians() / 2.0;
    let q = [
        half.cos(),
        axis[0] / length * half.sin(),
        axis[1] / length * half.sin(),
        axis[2] / length * half.sin(),
    ];
    let times = |a: [f64; 4], b: [f64; 4]| {
        [
            a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
            a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
            a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
            a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
        ]
    };
    let [_, x, y, z] =
        times(times(q, [0.0, point[0], point[1], point[2]]), [q[0], -q[1], -q[2], -q[3]]);
    [x, y, z]
}

fn difference(a: Vector, b: Vector) -> f64 {
    (0..3).fold(0.0f64, |length, axis| length.hypot(a[axis] - b[axis]))
}

fn everything() -> serde_json::Value {
    serde_json::json!({"sphere": {"center": [0, 0, 0], "radius": 1e6}})
}

#[test]
fn a_handle_turns_about_axis_and_centre() {
    let mut editor = editor(&shapes::box_of_tets([4, 3, 3], [0.0; 3], [2.0, 1.0, 1.0]));
    let surface = Arc::clone(editor.surface());
    let handle = surface.features().index("x-max").unwrap();
    for (axis, degrees, center) in [
        ([1.0, 2.0, -0.5], 37.0, [0.3, -1.0, 2.0]),
        ([0.0, 0.0, 1e-200], -123.4, [2.0, 0.5, 0.5]),
        ([1e300, -1e300, 1e300], 1e-7, [0.0; 3]),
        ([0.0, 3.0, 0.0], 725.0, [1.0, 1.0, 1.0]),
    ] {
        let rotate = edit(serde_json::json!({"rotate": {
            "features": ["x-max"], "fixed": ["x-min"], "axis": axis, "degrees": degrees, "center": center
        }}));
        let shape = moved(&surface, &editor.displacement(&[rotate]).unwrap());
        let largest = axis.iter().fold(0.0f64, |largest, part: &f64| largest.max(part.abs()));
        for &vertex in surface.features().vertices(handle) {
            let point = surface.points()[vertex as usize];
            let from = [0, 1, 2].map(|k| point[k] - center[k]);
            let to = turned(axis.map(|part| part / largest), degrees, from);
            let expected = [0, 1, 2].map(|k| center[k] + to[k]);
            assert!(difference(shape[vertex as usize], expected) < 1e-14, "{axis:?} {degrees}");
        }
    }
}

#[test]
fn quarter_turns_are_exact_and_whole_turns_are_nothing() {
    let mut editor = editor(&shapes::box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]));
    let surface = Arc::clone(editor.surface());
    let mut turn = |degrees: f64| {
        let rotate = serde_json::json!({"rotate": {"region": everything(), "axis": [0, 0, 2], "degrees": degrees}});
        moved(&surface, &editor.displacement(&[edit(rotate)]).unwrap())
    };
    // The centre is that of the box, (0.5, 0.5, 0.5).
    let quarter: Vec<Vector> = surface.points().iter().map(|&[x, y, z]| [1.0 - y, x, z]).collect();
    let half: Vec<Vector> =
        surface.points().iter().map(|&[x, y, z]| [1.0 - x, 1.0 - y, z]).collect();
    let back: Vec<Vector> = surface.points().iter().map(|&[x, y, z]| [y, 1.0 - x, z]).collect();
    for (degrees, expected) in
        [(90.0, &quarter), (450.0, &quarter), (-180.0, &half), (-90.0, &back), (270.0, &back)]
    {
        assert_eq!(&turn(degrees), expected, "{degrees}");
    }
    for degrees in [0.0, 360.0, -720.0, 3.6e10] {
        assert_eq!(turn(degrees), surface.points(), "{degrees}");
    }
}

#[test]
fn turns_about_the_same_axis_add_up() {
    let mut editor = editor(&shapes::box_of_tets([4, 2, 2], [0.0; 3], [2.0, 1.0, 1.0]));
    let turn = |degrees: f64| {
        edit(serde_json::json!({"rotate": {
            "features": ["x-max"], "fixed": ["x-min"], "axis": [1, 1, 0], "degrees": degrees, "center": [2, 0, 0]
        }}))
    };
    let twice = editor.displacement(&[turn(25.0), turn(-60.0)]).unwrap();
    let once = editor.displacement(&[turn(-35.0)]).unwrap();
    let handle = editor.surface().features().index("x-max").unwrap();
    for &vertex in editor.surface().features().vertices(handle) {
        assert!(difference(twice[vertex as usize], once[vertex as usize]) < 1e-14);
    }
}

#[test]
fn an_affine_map_is_made_as_it_is_written() {
    let mut editor = editor(&shapes::box_of_hexahedra([3, 2, 2], [0.0; 3], [2.0, 1.0, 1.0]));
    let surface = Arc::clone(editor.surface());
    let handle = surface.features().vertices(surface.features().index("x-max").unwrap()).to_vec();
    let matrix = [[0.9, 0.2, -0.1], [0.0, 1.5, 0.3], [0.25, 0.0, 0.7]];
    let (translation, center): (Vector, Vector) = ([0.1, -0.2, 0.3], [1.0, 0.5, -2.0]);
    let affine = edit(serde_json::json!({"affine": {
        "features": ["x-max"], "fixed": ["x-min"], "matrix": matrix, "translation": translation, "center": center
    }}));
    let shape = moved(&surface, &editor.displacement(&[affine]).unwrap());
    for &vertex in &handle {
        let point = surface.points()[vertex as usize];
        let expected = [0, 1, 2].map(|row| {
            let turned: f64 =
                (0..3).map(|column| matrix[row][column] * (point[column] - center[column])).sum();
            turned + center[row] + translation[row]
        });
        assert!(difference(shape[vertex as usize], expected) < 1e-14);
    }

    // A diagonal matrix is a scaling, to the bit; a singular one flattens onto the centre of the
    // handle's box.
    let diagonal = |matrix: serde_json::Value| {
        edit(
            serde_json::json!({"affine": {"features": ["x-max"], "fixed": ["x-min"], "matrix": matrix}}),
        )
    };
    let scaled = scale(&["x-max"], &["x-min"], [1.5, 0.25, -2.0], HarmonicOrder::Biharmonic);
    let same = diagonal(serde_json::json!([[1.5, 0, 0], [0, 0.25, 0], [0, 0, -2]]));
    assert_eq!(editor.displacement(&[same]).unwrap(), editor.displacement(&[scaled]).unwrap());
    let flat = diagonal(serde_json::json!([[0, 0, 0], [0, 0, 0], [0, 0, 0]]));
    let shape = moved(&surface, &editor.displacement(&[flat]).unwrap());
    for &vertex in &handle {
        assert_eq!(shape[vertex as usize], [2.0, 0.5, 0.5]);
    }
}

#[test]
fn a_rigid_motion_of_the_whole_surface_keeps_its_shape() {
    let mut editor = editor(&shapes::torus(2.0, 0.5, [24, 12]));
    let surface = Arc::clone(editor.surface());
    let stack = [
        edit(
            serde_json::json!({"rotate": {"region": everything(), "axis": [1, 2, 3], "degrees": 50}}),
        ),
        edit(serde_json::json!({"translate": {"region": everything(), "by": [5, -3, 0.5]}})),
    ];
    let shape = moved(&surface, &editor.displacement(&stack).unwrap());
    for &[a, b, c] in surface.triangles() {
        for [p, q] in [[a, b], [b, c], [c, a]].map(|edge| edge.map(|vertex| vertex as usize)) {
            let before = difference(surface.points()[p], surface.points()[q]);
            assert!((difference(shape[p], shape[q]) - before).abs() < 1e-13);
        }
    }
}

#[test]
fn a_closed_surface_grows_evenly_along_its_normals() {
    // The vertices lie on the tube of radius 0.5; offset by 0.2 they lie on that of radius 0.7, up
    // to how well the mean of flat faces gives the normal, which is of second order in their size.
    let errors: Vec<f64> = [1, 2]
        .map(|fine| {
            let mut editor = editor(&shapes::torus(2.0, 0.5, [32 * fine, 16 * fine]));
            let surface = Arc::clone(editor.surface());
            let grow = edit(
                serde_json::json!({"scale_normals": {"region": everything(), "distance": 0.2}}),
            );
            let displacement = editor.displacement(&[grow]).unwrap();
            assert!(
                displacement.iter().all(|moved| (difference(*moved, [0.0; 3]) - 0.2).abs() < 1e-15)
            );
            let shape = moved(&surface, &displacement);
            let off = |&[x, y, z]: &Vector| ((x.hypot(y) - 2.0).hypot(z) - 0.7).abs();
            assert!(
                enclosed_volume(&surface, &shape) > enclosed_volume(&surface, surface.points())
            );
            shape.iter().map(off).fold(0.0, f64::max)
        })
        .to_vec();
    assert!(errors[0] < 2e-3 && errors[1] < errors[0] / 3.0, "{errors:?}");
}

#[test]
fn regions_are_measured_on_the_reference_surface() {
    let mesh = shapes::box_of_tets([10, 4, 4], [0.0; 3], [1.0, 0.4, 0.4]);
    let mut editor = editor(&mesh);
    let surface = Arc::clone(editor.surface());
    let normal = [1.0, 0.5, 0.0];
    let cases: [(serde_json::Value, &dyn Fn(Vector) -> bool); 3] = [
        (
            // 0.3 in the file and 3 * 0.1 in the mesh are not the same number.
            serde_json::json!({"box": {"lower": [0.3, 0, 0], "upper": [0.7, 0.4, 0.2]}}),
            &|p| p[0] > 0.29 && p[0] < 0.71 && p[2] < 0.21,
        ),
        (serde_json::json!({"sphere": {"center": [1, 0.2, 0.2], "radius": 0.3}}), &|p| {
            difference(p, [1.0, 0.2, 0.2]) < 0.3 + 1e-7
        }),
        (serde_json::json!({"half_space": {"origin": [0.6, 0, 0], "normal": normal}}), &|p| {
            (p[0] - 0.6) * normal[0] + p[1] * normal[1] > -1e-7
        }),
    ];
    for (region, inside) in cases {
        let away =
            edit(serde_json::json!({"translate": {"region": everything(), "by": [100, 0, 0]}}));
        let lift = edit(serde_json::json!({"translate": {
            "region": region, "fixed": ["x-min"], "by": [0, 0, 1], "harmonic_order": 1
        }}));
        let count = surface.points().iter().filter(|&&point| inside(point)).count();
        assert!(count > 5 && count < surface.points().len() * 2 / 3, "{region}: {count}");
        let found: Region = serde_json::from_value(region).unwrap();
        assert_eq!(found.vertices(&surface).unwrap().len(), count);
        for stack in [vec![lift.clone()], vec![away, lift]] {
            let displacement = editor.displacement(&stack).unwrap();
            for (point, moved) in surface.points().iter().zip(&displacement) {
                // Everything else is strictly between the handle and what is fixed.
                assert_eq!(moved[2] == 1.0, inside(*point), "{point:?} {moved:?}");
            }
        }
    }
}

#[test]
fn picked_faces_and_parts_of_features_move() {
    let mut editor = editor(&shapes::box_of_hexahedra([4, 4, 4], [0.0; 3], [1.0; 3]));
    let surface = Arc::clone(editor.surface());
    let faces = [3u32, 17, 40];
    let by = [0.25, -0.5, 0.125];
    let pick = edit(serde_json::json!({"translate": {
        "region": {"faces": faces}, "fixed_region": {"faces": [80, 81]}, "by": by, "harmonic_order": 1
    }}));
    let displacement = editor.displacement(&[pick]).unwrap();
    for (list, expected) in [(&faces[..], by), (&[80, 81][..], [0.0; 3])] {
        for &face in list {
            for &vertex in surface.faces().vertices(face as usize) {
                assert_eq!(displacement[vertex as usize], expected);
            }
        }
    }

    // Of the feature, what lies in the half space, along the feature's own normal even at its rim.
    let grow = edit(serde_json::json!({"scale_normals": {
        "features": ["z-max"], "fixed": ["z-min"], "distance": 0.5, "harmonic_order": 1,
        "region": {"half_space": {"origin": [0.5, 0, 0], "normal": [3, 0, 0]}}
    }}));
    let displacement = editor.displacement(&[grow]).unwrap();
    let mut counted = 0;
    for (point, moved) in surface.points().iter().zip(&displacement) {
        if point[2] == 1.0 && point[0] >= 0.5 {
            assert_eq!(*moved, [0.0, 0.0, 0.5]);
            counted += 1;
        } else {
            assert!(moved[2] < 0.5);
        }
    }
    assert_eq!(counted, 3 * 5);
}

#[test]
fn a_vertex_alone_in_a_region_has_the_normal_of_all_its_faces() {
    let mut editor = editor(&shapes::box_of_hexahedra([2, 2, 2], [0.0; 3], [1.0; 3]));
    let corner = edit(serde_json::json!({"scale_normals": {
        "region": {"sphere": {"center": [1, 1, 1], "radius": 0.1}}, "fixed": ["x-min"], "distance": 3
    }}));
    let displacement = editor.displacement(&[corner]).unwrap();
    let place = editor.surface().points().iter().position(|point| *point == [1.0; 3]).unwrap();
    assert!(difference(displacement[place], [3.0f64.sqrt(); 3]) < 1e-14);
}

#[test]
fn a_muted_layer_does_nothing_and_is_still_checked() {
    let mut editor = editor(&shapes::box_of_tets([3, 3, 3], [0.0; 3], [1.0; 3]));
    let layer = |by: f64, muted: bool| {
        edit(serde_json::json!({"translate": {
            "features": ["x-max"], "fixed": ["x-min"], "by": [by, 0.3, 0], "muted": muted, "name": "layer"
        }}))
    };
    let turn = edit(serde_json::json!({"rotate": {
        "features": ["z-max"], "fixed": ["z-min"], "axis": [0, 0, 1], "degrees": 20
    }}));
    let with = editor.displacement(&[layer(0.1, true), turn.clone(), layer(0.7, true)]).unwrap();
    let without = editor.displacement(std::slice::from_ref(&turn)).unwrap();
    assert_eq!(with, without);
    let zeros = editor.displacement(&[layer(0.1, true), layer(0.7, true)]).unwrap();
    assert!(zeros.iter().flatten().all(|value| value.to_bits() == 0));
    let wrong = edit(
        serde_json::json!({"translate": {"features": ["x-mix"], "by": [1, 0, 0], "muted": true}}),
    );
    assert!(matches!(
        editor.displacement(&[turn, wrong]),
        Err(EditError::UnknownFeature { edit: 1, .. })
    ));

    let layers = editor.layers(&[layer(0.4, false), layer(0.7, true)]).unwrap();
    assert_eq!((layers[0].handle_vertices, layers[0].largest_displacement), (16, 0.5));
    assert_eq!((layers[1].muted, layers[1].largest_displacement), (true, 0.0));
    assert_eq!(layers[1].name.as_deref(), Some("layer"));
}

#[test]
fn an_imported_displacement_is_added_exactly() {
    let mut editor = editor(&shapes::box_of_tets([3, 3, 3], [0.0; 3], [1.0; 3]));
    let surface = Arc::clone(editor.surface());
    let vertices: Vec<u32> = surface.vertices().iter().copied().rev().step_by(3).collect();
    let mut random = noise(5);
    let values: Vec<Vector> = vertices.iter().map(|_| [random(), random(), random()]).collect();
    let import = |more: serde_json::Value| {
        let mut body = serde_json::json!({"vertices": vertices, "values": values});
        body.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        edit(serde_json::json!({"displacement": body}))
    };
    let expected = |takes: &dyn Fn(Vector) -> bool, factor: f64| -> Vec<Vector> {
        let given = |vertex: u32| vertices.iter().position(|given| *given == vertex);
        let points = surface.vertices().iter().zip(surface.points());
        let value =
            |(vertex, point): (&u32, &Vector)| match given(*vertex).filter(|_| takes(*point)) {
                Some(place) => values[place].map(|part| part * factor),
                None => [0.0; 3],
            };
        points.map(value).collect()
    };
    assert_eq!(
        editor.displacement(&[import(serde_json::json!({}))]).unwrap(),
        expected(&|_| true, 1.0)
    );
    assert_eq!(
        editor.displacement(&[import(serde_json::json!({"scale": -2.5}))]).unwrap(),
        expected(&|_| true, -2.5)
    );
    let part = import(serde_json::json!({"features": ["x-max", "y-max"], "fixed": ["z-min"]}));
    let takes = |p: Vector| (p[0] == 1.0 || p[1] == 1.0) && p[2] > 0.0;
    assert_eq!(editor.displacement(&[part]).unwrap(), expected(&takes, 1.0));

    let inside = (0..).find(|vertex| surface.vertices().binary_search(vertex).is_err()).unwrap();
    let wrong = edit(
        serde_json::json!({"displacement": {"vertices": [0, inside], "values": [[0, 0, 1], [0, 0, 1]]}}),
    );
    let error = editor.displacement(&[wrong]).unwrap_err();
    assert_eq!(
        error.to_string(),
        format!("edit 0 (displacement): vertices[1]: mesh vertex {inside} is not on the surface")
    );
    let unread = edit(serde_json::json!({"displacement": {"file": "lift.txt"}}));
    assert!(matches!(editor.displacement(&[unread]), Err(EditError::Unread { edit: 0, .. })));
}

#[test]
fn regions_that_hold_nothing_are_named_with_what_is_near() {
    let mut editor = editor(&shapes::box_of_hexahedra([2, 2, 2], [0.0; 3], [1.0; 3]));
    let mut refused =
        |json: serde_json::Value| editor.displacement(&[edit(json)]).unwrap_err().to_string();
    let translate = |body: serde_json::Value| {
        let mut whole = serde_json::json!({"by": [1, 0, 0]});
        whole.as_object_mut().unwrap().extend(body.as_object().unwrap().clone());
        serde_json::json!({ "translate": whole })
    };

    let error = refused(translate(serde_json::json!({"region": {"faces": [0, 24, 99]}})));
    assert_eq!(
        error,
        "edit 0 (translate): region.faces[1]: there is no face 24; the surface has 24 faces, numbered from 0"
    );
    let error = refused(translate(
        serde_json::json!({"region": {"sphere": {"center": [4, 1, 1], "radius": 1}}}),
    ));
    assert!(
        error.starts_with("edit 0 (translate): region: no vertex of the surface lies in it"),
        "{error}"
    );
    assert!(
        error.contains("at (1, 1, 1), is 2 away") && error.contains("from (0, 0, 0) to (1, 1, 1)"),
        "{error}"
    );
    let far = serde_json::json!({"half_space": {"origin": [0, 0, 1.5], "normal": [0, 0, 1e-300]}});
    let error = refused(translate(serde_json::json!({"features": ["x-max"], "fixed_region": far})));
    assert!(error.contains("fixed_region: no vertex") && error.contains("is 0.5 away"), "{error}");
    let corner = serde_json::json!({"box": {"lower": [0, 0, 0], "upper": [0, 0, 0]}});
    let error = refused(translate(serde_json::json!({"features": ["x-max"], "region": corner})));
    assert!(error.contains("no vertex of [\"x-max\"] lies in it, though 1 other"), "{error}");
    let error = refused(translate(serde_json::json!({"region": corner, "fixed": ["x-min"]})));
    assert!(error.contains("every vertex of the region is also fixed"), "{error}");
}

#[test]
fn what_makes_no_sense_is_named_by_its_field() {
    let mut editor = editor(&shapes::box_of_hexahedra([2, 2, 2], [0.0; 3], [1.0; 3]));
    let cases = [
        (
            r#"{"rotate": {"features": ["x-max"], "axis": [0, 0, 0], "degrees": 3}}"#,
            "axis: expected a direction",
        ),
        (r#"{"rotate": {"axis": [0, 0, 1], "degrees": 3}}"#, "features: there is no handle"),
        (
            r#"{"translate": {"by": [0, 0, 1], "region": {"box": {"lower": [0, 2, 0], "upper": [1, 1, 1]}}}}"#,
            "region.box.lower[1]: 2 is above the upper corner's 1",
        ),
        (
            r#"{"translate": {"by": [0, 0, 1], "region": {"sphere": {"center": [0, 2, 0], "radius": -1}}}}"#,
            "region.sphere.radius: -1 is below 0",
        ),
        (
            r#"{"translate": {"by": [0, 0, 1], "features": ["x-max"], "fixed_region": {"half_space": {"origin": [0, 2, 0], "normal": [0, 0, 0]}}}}"#,
            "fixed_region.half_space.normal: expected a direction",
        ),
        (
            r#"{"translate": {"by": [0, 0, 1], "region": {"faces": []}}}"#,
            "region.faces: the list is empty",
        ),
        (
            r#"{"translate": {"by": [0, 0, 1], "features": ["x-max"], "name": " "}}"#,
            "name: expected 1 to 200",
        ),
        (
            r#"{"displacement": {}}"#,
            "vertices: expected either both `vertices` and `values` or `file`, which only a JSON file can name",
        ),
        (
            r#"{"displacement": {"file": "a.txt", "vertices": [1]}}"#,
            "file: expected either both `vertices` and `values` or `file`",
        ),
        (
            r#"{"displacement": {"vertices": [1], "values": []}}"#,
            "values: found 0 values for 1 vertices",
        ),
        (
            r#"{"displacement": {"vertices": [5, 1, 5], "values": [[0, 0, 0], [0, 0, 0], [0, 0, 0]]}}"#,
            "vertices[2]: vertex 5 is also vertices[0]",
        ),
        (r#"{"skeleton": {"at": [0, 0, 0]}}"#, "at: expected either both `at` and `by` or `moves`"),
        (r#"{"skeleton": {}}"#, "moves: expected either both `at` and `by` or `moves`"),
    ];
    for (json, expected) in cases {
        let edit: Edit = serde_json::from_str(json).unwrap();
        let error = editor.displacement(std::slice::from_ref(&edit)).unwrap_err();
        let EditError::Invalid { edit: 0, source, .. } = &error else { panic!("{json}: {error}") };
        assert!(source.to_string().starts_with(expected), "{json}: {source}");
        assert!(source.to_string().starts_with(&source.field()), "{source}");
        assert!(error.to_string().starts_with(&format!("edit 0 ({}): ", edit.name())));
    }
    let infinite = Edit::Affine(tombolo_deform::edit::Affine {
        features: names(&["x-max"]),
        matrix: [[1.0; 3], [1.0, f64::NAN, 1.0], [1.0; 3]],
        ..Default::default()
    });
    assert!(
        matches!(infinite.validate(), Err(InvalidEdit::NotFinite { field, .. }) if field == "matrix[1][1]")
    );
}

#[test]
fn layers_in_another_order_are_another_stack_and_come_back_the_same() {
    let mut editor = editor(&shapes::box_of_tets([4, 3, 3], [0.0; 3], [2.0, 1.0, 1.0]));
    let turn = edit(serde_json::json!({"rotate": {
        "features": ["x-max"], "fixed": ["x-min"], "axis": [0, 0, 1], "degrees": 40, "center": [0, 0, 0]
    }}));
    let scale = scale(&["x-max"], &["x-min"], [2.0, 0.5, 1.0], HarmonicOrder::Biharmonic);
    let first = editor.displacement(&[turn.clone(), scale.clone()]).unwrap();
    let other = editor.displacement(&[scale.clone(), turn.clone()]).unwrap();
    assert_ne!(first, other);
    assert_eq!(editor.displacement(&[turn, scale]).unwrap(), first);
}
