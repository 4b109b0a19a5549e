//! Source stages and derived fields: closed forms, invariants, what is kept, and what goes wrong.

mod common;

use std::sync::Arc;

use common::hide;
use tombolo_deform::communicator::{Communicator, Solo, threads};
use tombolo_deform::distributed::{Part, in_order};
use tombolo_deform::mesh::{
    ArrayView, CellType, Cells, FeatureSource, Mesh, MeshView, Values, Vector, ghosts,
};
use tombolo_deform::shapes::{box_of_hexahedra, box_of_mixed_cells, box_of_tets, single_cell};
use tombolo_deform::vector::{add, cross, dot, length, polygon_normal, scale, subtract};
use tombolo_pipelines::extract::{Association, Channel, Extract, Field, FieldView, Snapshot};
use tombolo_pipelines::run::{Output, Runner};

fn runner(stages: &str, communicator: Arc<dyn Communicator>) -> Runner {
    common::runner(&format!(r#"{{"name": "view", "stages": [{stages}]}}"#), communicator)
}

/// The extract of a step, and what was told.
fn step(
    runner: &mut Runner,
    cycle: u64,
    mesh: MeshView,
    fields: &[FieldView],
) -> (Option<Arc<Extract>>, Vec<String>) {
    let channels = [Channel::new("fluid", mesh, fields)];
    let (mut extract, mut errors) = (None, Vec::new());
    for output in runner.run(&Snapshot { cycle, time: 0.5, channels: &channels }) {
        match output {
            Output::Frame(frame) => extract = Some(frame.extract),
            Output::Write { extract: written, .. } => extract = Some(written),
            Output::Error { message, .. } => errors.push(message),
            _ => {}
        }
    }
    (extract, errors)
}

fn once(stages: &str, mesh: &Mesh, fields: &[FieldView]) -> Extract {
    let (extract, errors) = step(&mut runner(stages, Arc::new(Solo)), 0, mesh.into(), fields);
    assert_eq!(errors, [""; 0]);
    Extract::clone(&extract.unwrap())
}

fn told(stages: &str, mesh: &Mesh, fields: &[FieldView]) -> Vec<String> {
    step(&mut runner(stages, Arc::new(Solo)), 0, mesh.into(), fields).1
}

fn field<'a>(extract: &'a Extract, name: &str) -> &'a Field {
    extract.fields.iter().find(|field| field.name == name).unwrap_or_else(|| panic!("{name}"))
}

fn values(mesh: &Mesh, of: impl Fn(Vector) -> f64) -> Vec<f64> {
    mesh.points().iter().copied().map(of).collect()
}

fn triangles(extract: &Extract) -> impl Iterator<Item = [Vector; 3]> {
    extract.cells.iter().flat_map(|(_, corners)| {
        let at = |index: usize| extract.points[corners[index] as usize];
        (1..corners.len() - 1).map(move |index| [at(0), at(index), at(index + 1)])
    })
}

fn area(extract: &Extract) -> f64 {
    triangles(extract).map(|[a, b, c]| length(cross(subtract(b, a), subtract(c, a))) / 2.0).sum()
}

/// The volume inside closed polygons (the divergence theorem).
fn enclosed(extract: &Extract) -> f64 {
    triangles(extract).map(|[a, b, c]| dot(a, cross(b, c)) / 6.0).sum()
}

/// Each edge is in two polygons, once in each direction.
fn is_closed(extract: &Extract) -> bool {
    let mut edges = std::collections::BTreeMap::new();
    for (_, corners) in extract.cells.iter() {
        for index in 0..corners.len() {
            let (a, b) = (corners[index], corners[(index + 1) % corners.len()]);
            *edges.entry((a.min(b), a.max(b))).or_insert(0) += if a < b { 1 } else { -1 };
        }
    }
    edges.values().all(|&count| count == 0)
}

const SPHERE: &str = r#"{"sphere": {"center": [0.52, 0.47, 0.51], "radius": 0.3}}"#;

#[test]
fn a_sphere_is_cut_out_closed_and_seen_from_outside() {
    let expected = 4.0 / 3.0 * std::f64::consts::PI * 0.3_f64.powi(3);
    for (mesh, name) in [
        (box_of_tets([16; 3], [0.0; 3], [1.0; 3]), "tetrahedra"),
        (box_of_hexahedra([16; 3], [0.0; 3], [1.0; 3]), "hexahedra"),
        (box_of_mixed_cells([16; 3], [0.0; 3], [1.0; 3]), "mixed cells"),
    ] {
        let cut = once(&format!(r#"{{"slice": {SPHERE}}}, {{"stream": {{}}}}"#), &mesh, &[]);
        assert!(is_closed(&cut), "{name}");
        assert!((enclosed(&cut) / expected - 1.0).abs() < 0.04, "{name}: {}", enclosed(&cut));
        // The outside of the part in the sphere is that surface, but for how it is triangulated.
        for invert in [false, true] {
            let sphere = &SPHERE[1..SPHERE.len() - 1];
            let clip =
                format!(r#"{{"clip": {{{sphere}, "invert": {invert}}}}}, {{"stream": {{}}}}"#);
            let skin = once(&clip, &mesh, &[]);
            let sign = if invert { -1.0 } else { 1.0 };
            let expected = if invert { 1.0 - expected } else { expected };
            assert!((enclosed(&skin) / expected - 1.0).abs() < 0.04, "{name}: {}", enclosed(&skin));
            if name == "tetrahedra" {
                let inside = if invert { 1.0 - enclosed(&skin) } else { enclosed(&skin) };
                assert!((inside - enclosed(&cut)).abs() < 1e-12, "{sign}");
                assert!(is_closed(&skin), "{name}");
            }
        }
    }
}

#[test]
fn what_a_box_keeps_and_leaves_fills_the_mesh() {
    let mesh = box_of_mixed_cells([5, 4, 6], [0.0; 3], [1.0; 3]);
    let clip = |invert: bool| {
        let clip = format!(
            r#"{{"clip": {{"box": {{"lower": [0.13, 0.2, 0.25], "upper": [0.61, 0.77, 2]}}, "invert": {invert}}}}}, {{"stream": {{}}}}"#
        );
        enclosed(&once(&clip, &mesh, &[]))
    };
    let inside = 0.48 * 0.57 * 0.75;
    assert!((clip(false) - inside).abs() < 1e-12, "{}", clip(false));
    assert!((clip(true) - (1.0 - inside)).abs() < 1e-12, "{}", clip(true));
}

#[test]
fn contours_of_a_linear_field_are_planes() {
    let mesh = box_of_mixed_cells([4, 3, 4], [0.0; 3], [1.0; 3]);
    let x = values(&mesh, |p| 2.0 * p[0]);
    let fields = [FieldView::vertex("x", &x)];
    let contour = once(
        r#"{"contour": {"field": "x", "values": [0.3, 1.1, 5]}}, {"stream": {}}"#,
        &mesh,
        &fields,
    );
    assert!((area(&contour) - 2.0).abs() < 1e-12);
    assert!(
        field(&contour, "x")
            .values
            .iter()
            .all(|x| (x - 0.3).abs() < 1e-14 || (x - 1.1).abs() < 1e-14)
    );
    for [a, b, c] in triangles(&contour) {
        assert!(cross(subtract(b, a), subtract(c, a))[0] > 0.0, "seen from where it is larger");
    }
}

/// The part that depends on the mesh is made anew when the mesh moves, and only then.
#[test]
fn what_is_kept_follows_the_mesh() {
    let mesh = box_of_tets([4; 3], [0.0; 3], [1.0; 3]);
    for stage in [
        r#"{"slice": {"origin": [0.4, 0, 0], "normal": [1, 0, 0]}}"#,
        r#"{"clip": {"plane": {"origin": [0.4, 0, 0], "normal": [1, 0, 0]}}}"#,
        r#"{"probe": {"line": {"from": [0.4, 0.1, 0.1], "to": [0.4, 0.9, 0.8], "count": 5}}}"#,
    ] {
        let mut runner =
            runner(&format!(r#"{stage}, {{"write": {{"file": "a.vtu"}}}}"#), Arc::new(Solo));
        let x = values(&mesh, |p| p[0]);
        let twice: Vec<f64> = x.iter().map(|x| 2.0 * x).collect();
        let mut take = |cycle: u64, mesh: MeshView, x: &[f64]| {
            let (extract, errors) = step(&mut runner, cycle, mesh, &[FieldView::vertex("x", x)]);
            assert_eq!(errors, [""; 0], "{stage}");
            extract.unwrap()
        };
        let first = take(0, (&mesh).into(), &x);
        let second = take(1, (&mesh).into(), &twice);
        assert!(Arc::ptr_eq(&first.cells, &second.cells), "{stage}");
        assert_eq!(first.points, second.points);
        for (one, two) in field(&first, "x").values.iter().zip(&field(&second, "x").values) {
            assert_eq!(2.0 * one, *two);
        }
        // One vertex moves, in an array of another kind, and back.
        let mut coordinates: Vec<f32> =
            mesh.points().as_flattened().iter().map(|&x| x as f32).collect();
        let points = ArrayView::interleaved(Values::F32(&coordinates), 3).unwrap();
        let view: MeshView = (&mesh).into();
        let third = take(2, MeshView { points, ..view }, &x);
        assert!(
            Arc::ptr_eq(&first.cells, &third.cells),
            "quarters are the same in single precision"
        );
        let vertex = mesh.points().iter().position(|p| *p == [0.5, 0.5, 0.5]).unwrap();
        coordinates[3 * vertex] = 0.55;
        let points = ArrayView::interleaved(Values::F32(&coordinates), 3).unwrap();
        let fourth = take(3, MeshView { points, ..view }, &x);
        assert!(!Arc::ptr_eq(&first.cells, &fourth.cells), "{stage}");
        assert_ne!(first.fields, fourth.fields, "{stage}");
        let fifth = take(4, view, &x);
        assert_eq!((&first.points, &first.fields), (&fifth.points, &fifth.fields), "{stage}");
    }
}

#[test]
fn gradients_of_linear_fields_are_exact_in_every_cell_type() {
    for cell_type in CellType::ALL.into_iter().filter(|cell| cell.dimension() >= 2) {
        let mesh = single_cell(cell_type);
        let scalar = values(&mesh, |[x, y, z]| 1.0 + 2.0 * x - 3.0 * y + 0.5 * z);
        let velocity: Vec<Vector> =
            mesh.points().iter().map(|[x, y, z]| [y - z, 2.0 * z, x + 4.0 * y]).collect();
        let fields = [FieldView::vertex("p", &scalar), FieldView::vertex("u", &velocity)];
        let all = once(
            r#"{"gradient": {"field": "p"}}, {"vorticity": {"field": "u"}}, {"divergence": {"field": "u"}}, {"write": {"file": "a.vtu"}}"#,
            &mesh,
            &fields,
        );
        // Nothing is known across a face.
        let expected = [2.0, -3.0, if cell_type.dimension() == 2 { 0.0 } else { 0.5 }];
        for found in field(&all, "gradient").values.chunks(3) {
            assert!(
                (0..3).all(|axis| (found[axis] - expected[axis]).abs() < 1e-12),
                "{cell_type}: {found:?}"
            );
        }
        if cell_type.dimension() == 3 {
            for found in field(&all, "vorticity").values.chunks(3) {
                let expected = [2.0, -2.0, -1.0];
                assert!(
                    (0..3).all(|axis| (found[axis] - expected[axis]).abs() < 1e-12),
                    "{cell_type}: {found:?}"
                );
            }
            assert!(field(&all, "divergence").values.iter().all(|x| x.abs() < 1e-12));
        }
    }
}

#[test]
fn gradients_along_lines_have_no_part_across_them() {
    let ends: [[Vector; 2]; 3] = [
        [[0.956, 0.948, 0.0566], [0.0849, 0.835, 0.736]],
        [[0.0; 3], [2.0, 0.0, 0.0]],
        [[1e3, 2.0, 0.1], [1e3 + 0.1, 2.3, -0.4]],
    ];
    for [from, to] in ends {
        let mut cells = Cells::new();
        cells.push(CellType::Line, &[0, 1]).unwrap();
        let mesh = Mesh::new(vec![from, to], cells, FeatureSource::SharpEdges).unwrap();
        let x = values(&mesh, |[x, ..]| x);
        let all = once(
            r#"{"gradient": {"field": "x"}}, {"write": {"file": "a.vtu"}}"#,
            &mesh,
            &[FieldView::vertex("x", &x)],
        );
        let along = subtract(to, from);
        let expected = along.map(|part| part * along[0] / dot(along, along));
        for found in field(&all, "gradient").values.chunks(3) {
            assert!((0..3).all(|axis| (found[axis] - expected[axis]).abs() < 1e-12), "{found:?}");
        }
    }
}

/// A strip and a fan of a quadrilateral, a pixel and a pentagon, all seen from above.
fn flat_cells() -> Mesh {
    let points = vec![
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, 2.0, 0.0],
        [1.0, 2.0, 0.0],
        [2.0, 0.0, 0.0],
        [2.0, 1.0, 0.0],
        [3.0, 0.0, 0.0],
        [3.0, 1.0, 0.0],
        [1.5, 2.5, 0.0],
        [2.0, 2.0, 0.0],
    ];
    let mut cells = Cells::new();
    cells.push(CellType::TriangleStrip, &[0, 1, 2, 3, 4, 5]).unwrap();
    cells.push(CellType::Quad, &[1, 6, 7, 3]).unwrap();
    cells.push(CellType::Pixel, &[6, 8, 7, 9]).unwrap();
    cells.push(CellType::Polygon, &[3, 7, 11, 10, 5]).unwrap();
    Mesh::new(points, cells, FeatureSource::SharpEdges).unwrap()
}

#[test]
fn faces_that_are_clipped_stay_turned_as_they_were() {
    let mesh = flat_cells();
    let whole: f64 = 2.0 + 1.0 + 1.0 + 1.25;
    for (x, y) in [(0.4, 0.3), (0.37, -1.0), (-0.8, 0.55), (1.0, 1.0)] {
        let mut areas = 0.0;
        for sign in [1.0, -1.0] {
            let part = once(
                &format!(
                    r#"{{"clip": {{"plane": {{"origin": [1.3, 0.8, 0], "normal": [{}, {}, 0]}}}}}}, {{"write": {{"file": "a.vtu"}}}}"#,
                    sign * x,
                    sign * y
                ),
                &mesh,
                &[],
            );
            for cell in 0..part.cells.len() {
                part.cells.for_each_polygon(cell, |polygon| {
                    let up = polygon_normal(&part.points, polygon)[2];
                    assert!(up > -1e-12, "a face is turned over: {polygon:?}");
                    areas += up / 2.0;
                });
            }
        }
        assert!((areas - whole).abs() < 1e-12, "{areas}");
    }
}

#[test]
fn quality_leaves_a_field_of_the_solver_alone() {
    let mesh = box_of_tets([2; 3], [0.0; 3], [1.0; 3]);
    let own: Vec<f64> = (0..mesh.cells().len()).map(|cell| cell as f64).collect();
    let stages = r#"{"clip": {"plane": {"origin": [0.0, 0, 0], "normal": [1, 0, 0]}}}, {"quality": {}}, {"write": {"file": "a.vtu"}}"#;
    let all = once(stages, &mesh, &[FieldView::element("scaled_jacobian", &own[..])]);
    assert_eq!(field(&all, "scaled_jacobian").values, own);
    let measured = once(stages, &mesh, &[]);
    assert!(field(&measured, "scaled_jacobian").values.iter().all(|&quality| quality < 1.0));
}

#[test]
fn formulas_take_fields_coordinates_and_time() {
    let mesh = box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]);
    let p = values(&mesh, |p| p[0] + 1.0);
    let u: Vec<Vector> = mesh.points().iter().map(|p| [p[2], 7.0, p[1]]).collect();
    let load: Vec<f64> = (0..mesh.cells().len()).map(|cell| cell as f64).collect();
    let fields =
        [FieldView::vertex("p", &p), FieldView::vertex("u", &u), FieldView::element("load", &load)];
    let all = once(
        r#"{"magnitude": {"field": "u", "name": "speed"}},
           {"expression": {"name": "head", "formula": "p + u.z * time + speed^2 + if(x > 0.4, 1, 0) + cycle"}},
           {"expression": {"name": "twice", "components": ["2 * u.x", "y", "p"]}},
           {"expression": {"name": "in cells", "formula": "{load} * 0 + x"}},
           {"statistics": {"field": "twice"}}, {"select": {"fields": ["head", "twice", "in cells"]}}, {"write": {"file": "a.vtu"}}"#,
        &mesh,
        &fields,
    );
    assert_eq!(all.fields.len(), 3);
    for (vertex, &[x, y, z]) in mesh.points().iter().enumerate() {
        let speed = (z * z + 49.0 + y * y).sqrt();
        let head = x + 1.0 + y * 0.5 + speed * speed + f64::from(u8::from(x > 0.4));
        assert!((field(&all, "head").values[vertex] - head).abs() < 1e-12);
        assert_eq!(field(&all, "twice").values[3 * vertex..3 * vertex + 3], [2.0 * z, y, x + 1.0]);
    }
    let in_cells = field(&all, "in cells");
    assert_eq!(in_cells.association, Association::Element);
    let mean: f64 =
        mesh.cells().vertices(5).iter().map(|&v| mesh.points()[v as usize][0] / 4.0).sum();
    assert!((in_cells.values[5] - mean).abs() < 1e-15);
}

#[test]
fn magnitudes_of_large_vectors_are_finite() {
    let mesh = box_of_tets([2, 1, 1], [0.0; 3], [1.0; 3]);
    let u: Vec<Vector> = mesh.points().iter().map(|_| [3e200, 0.0, -4e200]).collect();
    let stages = r#"{"magnitude": {"field": "u", "name": "speed"}}, {"threshold": {"field": "speed", "min": 1}}, {"write": {"file": "a.vtu"}}"#;
    let extract = once(stages, &mesh, &[FieldView::vertex("u", &u)]);
    assert_eq!(extract.cells.len(), mesh.cells().len());
    assert!(
        field(&extract, "speed").values.iter().all(|speed| (speed / 5e200 - 1.0).abs() < 1e-15)
    );
}

#[test]
fn mistakes_are_told_by_name() {
    let mesh = box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]);
    let mut p = values(&mesh, |p| p[0]);
    let load = vec![1.0; mesh.cells().len()];
    let u = vec![[1.0; 3]; p.len()];
    let all = |p: &[f64], stages: &str| {
        let fields = [
            FieldView::vertex("pressure", p),
            FieldView::vertex("u", &u),
            FieldView::element("load", &load),
        ];
        let told = told(stages, &mesh, &fields);
        assert_eq!(told.len(), 1, "{stages}: {told:?}");
        told[0].clone()
    };
    for (stage, message) in [
        (
            r#"{"contour": {"field": "presure", "values": [1]}}"#,
            "contour: the channel has no field `presure`; its fields are pressure, u, load; did you mean `pressure`?",
        ),
        (
            r#"{"contour": {"field": "load", "values": [1]}}"#,
            "contour: field `load` has values for element entities, expected a vertex field",
        ),
        (
            r#"{"threshold": {"field": "lod", "min": 1}}"#,
            "threshold: the channel has no field `lod`; its fields are pressure, u, load; did you mean `load`?",
        ),
        (
            r#"{"gradient": {"field": "v"}}"#,
            "gradient: the channel has no field `v`; its fields are pressure, u, load",
        ),
        (
            r#"{"vorticity": {"field": "load"}}"#,
            "vorticity: field `load` has 1 components, expected a vector of 2 or 3",
        ),
        (
            r#"{"magnitude": {"field": "u", "name": "load"}}"#,
            "magnitude: the channel has a field `load` already",
        ),
        (
            r#"{"expression": {"name": "a", "formula": "u + 1"}}"#,
            "expression: field `u` has 3 components, expected one of them, such as `u.x`",
        ),
        (
            r#"{"expression": {"name": "a", "formula": "u.w"}}"#,
            "expression: field `u` has 3 components, none of which is `u.w`",
        ),
        (
            r#"{"expression": {"name": "a", "formula": "load * pressure"}}"#,
            "expression: `load` is a field of association element, `pressure` of association vertex; expected fields of one",
        ),
        (
            r#"{"probe": {"points": [[0.5, 0.5, 0.5], [3, 0, 0]]}}"#,
            "probe: 1 of 2 points lie in no cell and are left out, first (3, 0, 0)",
        ),
    ] {
        let told = all(&p, &format!("{stage}, {{\"pause\": {{}}}}"));
        assert!(told.starts_with(message), "{told}");
    }
    p[13] = f64::NAN;
    let told = all(&p, r#"{"contour": {"field": "pressure", "values": [0.5]}}"#);
    assert_eq!(
        told,
        "contour: cycle 0: field `pressure` is NaN at vertex 13; nothing is taken by it"
    );
}

#[test]
fn probes_keep_their_order_and_their_neighbours() {
    let mesh = box_of_hexahedra([3, 3, 3], [0.0; 3], [1.0; 3]);
    let x = values(&mesh, |p| p[0]);
    let load: Vec<f64> = (0..27).map(f64::from).collect();
    let fields = [FieldView::vertex("x", &x), FieldView::element("load", &load)];
    // Five points of seven are in the mesh.
    let line = r#"{"probe": {"line": {"from": [-0.5, 0.1, 0.1], "to": [1.0, 0.1, 0.1], "count": 7}}}, {"write": {"file": "a.vtu"}}"#;
    let (extract, errors) = step(&mut runner(line, Arc::new(Solo)), 0, (&mesh).into(), &fields);
    let extract = extract.unwrap();
    assert_eq!(
        errors,
        ["probe: 2 of 7 points lie in no cell and are left out, first (-0.5, 0.1, 0.1)"]
    );
    assert_eq!((extract.points.len(), extract.cells.len()), (5, 4));
    assert!(extract.cells.iter().all(|(cell_type, _)| cell_type == CellType::Line));
    for (point, x) in extract.points.iter().zip(&field(&extract, "x").values) {
        assert!((point[0] - x).abs() < 1e-15);
    }
    assert_eq!(field(&extract, "load").association, Association::Vertex);
    assert_eq!(field(&extract, "load").values, [0.0, 0.0, 1.0, 2.0, 2.0]);
    // Points of a grid are those of its corners.
    let grid = r#"{"probe": {"grid": {"lower": [0, 0.2, 0], "upper": [1, 0.2, 1], "counts": [4, 1, 3]}}}, {"stream": {}}"#;
    let extract = once(grid, &mesh, &fields);
    assert_eq!((extract.points.len(), extract.cells.len()), (12, 6));
    assert!((area(&extract) - 1.0).abs() < 1e-15);
    let nearest = r#"{"probe": {"points": [[0.4, 0.1, 0.1], [0.6, 0.1, 0.1]], "method": "nearest"}}, {"stream": {}}"#;
    assert_eq!(field(&once(nearest, &mesh, &fields), "x").values, [1.0 / 3.0, 2.0 / 3.0]);
}

/// Geographic coordinates, in metres, and a face that lies aslant.
#[test]
fn a_probe_takes_what_lies_on_a_surface_but_for_rounding() {
    let from = [5e5, 5e6, 300.0];
    let points = vec![from, add(from, [90.0, 10.0, 20.0]), add(from, [15.0, 80.0, -10.0])];
    let mut cells = Cells::new();
    cells.push(CellType::Triangle, &[0, 1, 2]).unwrap();
    let mesh = Mesh::new(points, cells, FeatureSource::SharpEdges).unwrap();
    let at = |index: usize| mesh.points()[index];
    let normal = cross(subtract(at(1), at(0)), subtract(at(2), at(0)));
    let [a, b, c] = [0, 1, 2].map(at);
    let middle: Vector = std::array::from_fn(|axis| (a[axis] + b[axis] + c[axis]) / 3.0);
    // In diagonals of the mesh, of some 124 m.
    for (beside, is_found) in [(0.0, true), (0.5e-9, true), (-0.5e-9, true), (2e-9, false)] {
        let [x, y, z] = add(middle, scale(normal, beside * 124.0 / length(normal)));
        let probe = format!(r#"{{"probe": {{"points": [[{x}, {y}, {z}]]}}}}, {{"stream": {{}}}}"#);
        let (extract, errors) = step(&mut runner(&probe, Arc::new(Solo)), 0, (&mesh).into(), &[]);
        assert_eq!(errors.is_empty(), is_found, "{beside}: {errors:?}");
        assert_eq!(extract.unwrap().points.len(), usize::from(is_found), "{beside}");
    }
    // Of a small face the rounding of the coordinates is what counts.
    let points: Vec<Vector> =
        [at(0), at(1), at(2)].map(|point| add(at(0), scale(subtract(point, at(0)), 1e-3))).to_vec();
    let mesh = mesh.with_points(points).unwrap();
    let [a, b, c] = [0, 1, 2].map(|index| mesh.points()[index]);
    let inside = (1..10).map(|step| {
        let part = f64::from(step) / 20.0;
        let [x, y, z] =
            add(a, add(scale(subtract(b, a), part), scale(subtract(c, a), 0.45 - part / 2.0)));
        format!("[{x}, {y}, {z}]")
    });
    let inside: Vec<String> = inside.collect();
    let probe =
        format!(r#"{{"probe": {{"points": [{}]}}}}, {{"stream": {{}}}}"#, inside.join(", "));
    assert_eq!(once(&probe, &mesh, &[]).points.len(), 9);
}

#[test]
fn the_apex_of_pyramids_lies_in_them() {
    let mut points = single_cell(CellType::Hexahedron).points().to_vec();
    points.push([0.5; 3]);
    let mut cells = Cells::new();
    for face in CellType::Hexahedron.faces() {
        let mut corners: Vec<u32> = face.iter().rev().map(|&corner| corner as u32).collect();
        corners.push(8);
        cells.push(CellType::Pyramid, &corners).unwrap();
    }
    let mesh = Mesh::new(points, cells, FeatureSource::SharpEdges).unwrap();
    let x = values(&mesh, |[x, y, z]| x + 2.0 * y + 4.0 * z);
    let probe = r#"{"probe": {"points": [[0.5, 0.5, 0.5]]}}, {"stream": {}}"#;
    let extract = once(probe, &mesh, &[FieldView::vertex("x", &x)]);
    assert_eq!(field(&extract, "x").values, [3.5]);
}

/// Hidden cells and copies are in nothing that is taken or derived, and what stands in them is
/// nobody's business.
#[test]
fn ghosts_are_left_out() {
    let mesh = box_of_tets([4, 2, 2], [0.0; 3], [2.0, 1.0, 1.0]);
    let count = mesh.cells().len();
    // The half beyond x = 1 is hidden.
    let center = |cell: usize| {
        mesh.cells().vertices(cell).iter().map(|&v| mesh.points()[v as usize][0]).sum::<f64>() / 4.0
    };
    let hidden: Vec<u8> =
        (0..count).map(|cell| if center(cell) > 1.0 { ghosts::HIDDEN } else { 0 }).collect();
    let p = values(&mesh, |p| if p[0] > 1.0 { f64::NAN } else { p[1] });
    let load: Vec<f64> =
        (0..count).map(|cell| if center(cell) > 1.0 { f64::NAN } else { 2.0 }).collect();
    let fields = [FieldView::vertex("p", &p), FieldView::element("load", &load)];
    let view = MeshView { ghost_cells: Some(&hidden), ..(&mesh).into() };
    let take = |stages: &str| {
        let (extract, errors) = step(&mut runner(stages, Arc::new(Solo)), 0, view, &fields);
        assert_eq!(errors, [""; 0], "{stages}");
        Extract::clone(&extract.unwrap())
    };
    let contour = take(r#"{"contour": {"field": "p", "values": [0.3]}}, {"stream": {}}"#);
    assert!((area(&contour) - 1.0).abs() < 1e-12);
    let clip = take(
        r#"{"clip": {"plane": {"origin": [0, 0.25, 0], "normal": [0, 1, 0]}}}, {"stream": {}}"#,
    );
    assert!((enclosed(&clip) - 0.75).abs() < 1e-12);
    assert!(
        (enclosed(&take(r#"{"threshold": {"field": "load", "min": 1}}, {"stream": {}}"#)) - 1.0)
            .abs()
            < 1e-12
    );
    let gradient = take(
        r#"{"gradient": {"field": "p"}}, {"slice": {"origin": [0.6, 0, 0], "normal": [1, 0, 0]}}, {"stream": {}}"#,
    );
    assert!(field(&gradient, "gradient").values.chunks(3).all(|g| (g[1] - 1.0).abs() < 1e-12));
    let probe = r#"{"probe": {"points": [[0.5, 0.5, 0.5], [1.5, 0.5, 0.5]]}}, {"stream": {}}"#;
    let (extract, errors) = step(&mut runner(probe, Arc::new(Solo)), 0, view, &fields);
    assert_eq!((extract.unwrap().points.len(), errors.len()), (1, 1));
}

/// The cells that hold the most displaced vertex are the worst, and their quality comes along.
#[test]
fn the_worst_cells_are_taken_by_their_quality() {
    let mut mesh = box_of_tets([4; 3], [0.0; 3], [1.0; 3]);
    let is_middle = |point: &Vector| point.iter().all(|part| (part - 0.5).abs() < 1e-9);
    let middle = mesh.points().iter().position(is_middle).unwrap();
    let mut points = mesh.points().to_vec();
    points[middle][0] += 0.2;
    mesh = Mesh::new(points, mesh.cells().clone(), FeatureSource::SharpEdges).unwrap();
    let stages = |least: f64| {
        format!(
            r#"{{"threshold": {{"field": "scaled_jacobian", "max": {least}}}}}, {{"select": {{"fields": ["scaled_jacobian"]}}}}, {{"stream": {{}}}}"#
        )
    };
    let worst = once(&stages(0.15), &mesh, &[]);
    let qualities = &field(&worst, "scaled_jacobian").values;
    assert!(!qualities.is_empty() && qualities.iter().all(|&quality| quality <= 0.15));
    let near = |point: &Vector| point.iter().all(|part| (part - 0.5).abs() < 0.26);
    assert!(worst.points.iter().all(near));
    let all = once(&stages(1.0), &mesh, &[]);
    assert!((enclosed(&all) - 1.0).abs() < 1e-12, "{}", enclosed(&all));
    // One of the solver's own comes first.
    let own = vec![1.0; mesh.cells().len()];
    let (extract, _) = step(
        &mut runner(&stages(0.15), Arc::new(Solo)),
        0,
        (&mesh).into(),
        &[FieldView::element("scaled_jacobian", &own[..])],
    );
    assert!(extract.is_none_or(|extract| extract.cells.is_empty()));
}

/// Hidden cells and copies on three ranks: all is as on one.
#[test]
fn ranks_leave_out_the_ghosts_that_one_process_does() {
    let mesh = box_of_mixed_cells([6, 3, 4], [0.0; 3], [2.0, 1.0, 1.0]);
    let count = mesh.cells().len();
    let hidden: Vec<u8> = (0..count)
        .map(|cell| [0, 0, ghosts::HIDDEN, 0, ghosts::REFINED, 0, 16][cell * cell % 7])
        .collect();
    let stages = [
        r#"{"slice": {"sphere": {"center": [1, 0.5, 0.5], "radius": 0.4}}}, {"stream": {}}"#,
        r#"{"contour": {"field": "p", "values": [0.3, 0.8]}}, {"stream": {}}"#,
        r#"{"threshold": {"field": "p", "min": 0.3}}, {"stream": {}}"#,
        r#"{"clip": {"box": {"lower": [0.3, 0.1, 0.2], "upper": [1.7, 0.8, 0.9]}}}, {"stream": {}}"#,
        r#"{"gradient": {"field": "p"}}, {"expression": {"name": "g", "formula": "gradient.x"}}, {"contour": {"field": "g", "values": [0.6]}}, {"stream": {}}"#,
    ];
    for stages in stages {
        let made = |part: &Part, communicator: Arc<dyn Communicator>| {
            let p: Vec<f64> = part.points.iter().map(|[x, y, z]| x * y + 0.3 * z * z).collect();
            let fields = [FieldView::vertex("p", &p)];
            step(&mut runner(stages, communicator), 0, part.view(), &fields)
        };
        let whole = Part { ghosts: Some(hidden.clone()), ..Part::of(&(&mesh).into()).unwrap() };
        let (serial, errors) = made(&whole, Arc::new(Solo));
        assert_eq!(errors, [""; 0], "{stages}");
        let outcomes = threads::run(3, |ranks| {
            let of_cells = in_order(count, 3);
            let mut part = Part::cut(&mesh, &of_cells, ranks.rank(), true).unwrap();
            hide(&mut part, &hidden);
            made(&part, Arc::new(ranks))
        });
        let (found, errors) = &outcomes[0];
        assert_eq!(errors, &[""; 0], "{stages}");
        let (found, serial) = (found.as_ref().unwrap(), serial.unwrap());
        assert_eq!(
            (found.points.len(), found.cells.len()),
            (serial.points.len(), serial.cells.len()),
            "{stages}"
        );
        assert!(area(&serial) > 0.1, "{stages}");
        assert!((area(found) - area(&serial)).abs() < 1e-12 * area(&serial), "{stages}");
    }
}

/// A rank without cells, and one without a field.
#[test]
fn ranks_agree_on_what_can_be_derived() {
    let mesh = box_of_tets([4, 2, 2], [0.0; 3], [2.0, 1.0, 1.0]);
    let of_cells: Vec<usize> = (0..mesh.cells().len()).map(|cell| [0, 2][cell % 2]).collect();
    for lacking in [false, true] {
        let outcomes = threads::run(3, |ranks| {
            let rank = ranks.rank();
            let part = Part::cut(&mesh, &of_cells, rank, false).unwrap();
            let p: Vec<f64> = part.points.iter().map(|p| p[0] * p[1]).collect();
            let fields = [FieldView::vertex("p", &p)];
            let shown =
                if part.points.is_empty() || lacking && rank == 2 { &[] } else { &fields[..] };
            let stages = r#"{"gradient": {"field": "p"}}, {"expression": {"name": "q", "formula": "gradient.y - x"}},
                {"contour": {"field": "q", "values": [0.5]}}, {"stream": {}}"#;
            step(&mut runner(stages, Arc::new(ranks)), 0, part.view(), shown)
        });
        let (extract, errors) = &outcomes[0];
        if lacking {
            assert!(
                errors.iter().any(
                    |error| error.starts_with("rank 2: gradient: the channel has no field `p`")
                ),
                "{errors:?}"
            );
            assert!(extract.is_none());
        } else {
            assert_eq!(errors, &[""; 0]);
            let serial = once(
                r#"{"gradient": {"field": "p"}}, {"expression": {"name": "q", "formula": "gradient.y - x"}},
                {"contour": {"field": "q", "values": [0.5]}}, {"stream": {}}"#,
                &mesh,
                &[FieldView::vertex("p", &values(&mesh, |p| p[0] * p[1]))],
            );
            assert!((area(&serial) - area(extract.as_ref().unwrap())).abs() < 1e-12);
        }
    }
}

#[test]
fn lines_and_polygons_are_taken_too() {
    let mut cells = Cells::new();
    cells.push(CellType::Polygon, &[0, 1, 2, 3, 4]).unwrap();
    let points =
        vec![[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 1.0, 0.0], [1.0, 1.5, 0.0], [0.0, 1.0, 0.0]];
    let mesh = Mesh::new(points, cells, FeatureSource::SharpEdges).unwrap();
    let clip = once(
        r#"{"clip": {"plane": {"origin": [0.5, 0, 0], "normal": [1, 0, 0]}}}, {"stream": {}}"#,
        &mesh,
        &[],
    );
    assert!((area(&clip) - (2.5 - 0.5 * 1.125)).abs() < 1e-12, "{}", area(&clip));
    let cut = once(
        r#"{"slice": {"sphere": {"center": [0, 0, 0], "radius": 0.5}}}, {"stream": {}}"#,
        &mesh,
        &[],
    );
    assert_eq!((cut.cells.len(), cut.cells.cell_type(0)), (1, CellType::Line));
}
