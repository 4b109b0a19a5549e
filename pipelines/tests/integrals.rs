//! Integrals over extracts and whole meshes: closed forms, VTK's own, and several ranks.

mod common;

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use common::{cell_numbers, runner, shown};
use serde_json::Value;
use tombolo_deform::communicator::{Communicator, Solo, threads};
use tombolo_deform::distributed::{Part, in_order};
use tombolo_deform::features::FeatureSettings;
use tombolo_deform::mesh::{CellType, Cells, FeatureSource, Mesh, Vector, ghosts};
use tombolo_deform::shapes::{box_of_hexahedra, box_of_mixed_cells, box_of_tets};
use tombolo_deform::surface::Surface;
use tombolo_pipelines::extract::{Channel, FieldView, Snapshot};
use tombolo_pipelines::files;
use tombolo_pipelines::language::parse;
use tombolo_pipelines::run::{Output, Runner};

const UPPER: Vector = [2.0, 1.0, 1.0];

/// Monitors by their names, and the messages.
type Found = (BTreeMap<String, f64>, Vec<String>);

/// What pipelines measure of a part: the vertex fields `p` of `scalar` and `u` of `vector`, and
/// `load`, the number of each cell.
fn found(
    pipelines: &str,
    part: &Part,
    communicator: Arc<dyn Communicator>,
    scalar: fn(Vector) -> f64,
    vector: fn(Vector) -> Vector,
) -> Found {
    let p: Vec<f64> = part.points.iter().map(|&point| scalar(point)).collect();
    let u: Vec<Vector> = part.points.iter().map(|&point| vector(point)).collect();
    let load = cell_numbers(part);
    let fields =
        [FieldView::vertex("p", &p), FieldView::vertex("u", &u), FieldView::element("load", &load)];
    let channels = [Channel::new("fluid", part.view(), shown(part, &fields))];
    let mut runner = runner(pipelines, communicator);
    let (mut values, mut messages) = (BTreeMap::new(), Vec::new());
    for output in runner.run(&Snapshot { cycle: 0, time: 0.0, channels: &channels }) {
        match output {
            Output::Monitor(monitor) => values.extend(monitor.values),
            Output::Error { message, .. } => messages.push(message),
            Output::Write { extract, .. } => {
                let names = extract.fields.iter().map(|field| field.name.as_str());
                assert!(names.eq(["load"]), "only what is selected is written");
            }
            other => panic!("{other:?}"),
        }
    }
    (values, messages)
}

/// The same on several ranks with and without copies of each other's cells and with an empty rank.
fn on_ranks(
    mesh: &Mesh,
    pipelines: &str,
    scalar: fn(Vector) -> f64,
    vector: fn(Vector) -> Vector,
) -> Vec<Found> {
    let mut all = Vec::new();
    for (ranks, ghosts) in [(3, true), (3, false), (4, true)] {
        let of_cells: Vec<usize> =
            in_order(mesh.cells().len(), 7).iter().map(|piece| piece % 3).collect();
        all.extend(threads::run(ranks, |ranks| {
            let part = Part::cut(mesh, &of_cells, ranks.rank(), ghosts).unwrap();
            found(pipelines, &part, Arc::new(ranks), scalar, vector)
        }));
    }
    all
}

fn is_near(value: f64, expected: f64, what: &str) {
    assert!(
        (value - expected).abs() <= 1e-11 * expected.abs().max(1.0),
        "{what}: {value}, expected {expected}"
    );
}

fn is_alike(several: &[Found], one: &Found) {
    for (values, _) in several {
        assert_eq!(values.len(), one.0.len());
        for (name, value) in values {
            is_near(*value, one.0[name], name);
        }
    }
}

/// The mesh with its vertices moved a little inside; the faces of the box stay.
fn warped(mesh: &Mesh) -> Mesh {
    let bend = |[x, y, z]: Vector| {
        let inside = 0.5 * x * (2.0 - x) * y * (1.0 - y) * z * (1.0 - z);
        let wave = |phase: f64| inside * (7.0 * x + 5.0 * y - 6.0 * z + phase).sin();
        [x + wave(0.0), y + wave(1.0), z + wave(2.0)]
    };
    let points = mesh.points().iter().copied().map(bend).collect();
    Mesh::new(points, mesh.cells().clone(), FeatureSource::SharpEdges).unwrap()
}

const REGIONS: &str = r#"
    {"name": "all", "stages": [{"integrate": {"name": "whole", "field": "p", "vector": "u"}},
        {"integrate": {"name": "cells", "field": "load"}}]},
    {"name": "outside", "stages": [{"surface": {}}, {"select": {"fields": ["load"]}},
        {"integrate": {"name": "surface", "field": "p", "vector": "u"}}, {"write": {"file": "a.vtu"}}]},
    {"name": "plane", "stages": [{"slice": {"origin": [0.9, 0.4, 0.5], "normal": [2, 0.6, -0.4]}},
        {"integrate": {"name": "cut", "field": "p", "vector": "u"}}, {"integrate": {"name": "cut load", "field": "load"}}]},
    {"name": "half", "stages": [{"clip": {"plane": {"origin": [0.9, 0.4, 0.5], "normal": [2, 0.6, -0.4]}}},
        {"integrate": {"name": "part", "field": "p", "vector": "u"}}, {"integrate": {"name": "part load", "field": "load"}}]}"#;

/// Parts that the fields decide.
const BY_FIELDS: &str = r#"
    {"name": "level", "stages": [{"contour": {"field": "p", "values": [0.11]}},
        {"integrate": {"name": "level", "field": "p", "vector": "u"}}, {"integrate": {"name": "level load", "field": "load"}}]},
    {"name": "few", "stages": [{"threshold": {"field": "load", "min": 30, "max": 99}},
        {"integrate": {"name": "few", "field": "p", "vector": "u"}}, {"integrate": {"name": "few load", "field": "load"}}]},
    {"name": "inside", "stages": [{"clip": {"field": {"name": "p", "value": 0.2}}},
        {"integrate": {"name": "inside", "field": "p", "vector": "u"}}, {"integrate": {"name": "inside load", "field": "load"}}]},
    {"name": "friction", "stages": [{"surface": {}}, {"force": {"name": "drag", "velocity": "u", "viscosity": 1}}]}"#;

/// A level and a clip by a linear field are those by a plane.
#[test]
fn parts_by_a_linear_field_are_those_by_a_plane() {
    let scalar = |[x, y, z]: Vector| 1.0 + x - 3.0 * y + 2.0 * z;
    let vector = |[x, y, z]: Vector| [x + y, 2.0 * y - z, 3.0 * z + 1.0];
    let pipelines = r#"
        {"name": "a", "stages": [{"contour": {"field": "p", "values": [1.75]}}, {"integrate": {"name": "level", "field": "p", "vector": "u"}}]},
        {"name": "b", "stages": [{"slice": {"origin": [0.75, 0, 0], "normal": [1, -3, 2]}}, {"integrate": {"name": "plane", "field": "p", "vector": "u"}}]},
        {"name": "c", "stages": [{"clip": {"field": {"name": "p", "value": 1.75}}}, {"integrate": {"name": "above", "field": "p", "vector": "u"}}]},
        {"name": "d", "stages": [{"clip": {"plane": {"origin": [0.75, 0, 0], "normal": [1, -3, 2]}}}, {"integrate": {"name": "side", "field": "p", "vector": "u"}}]},
        {"name": "e", "stages": [{"clip": {"field": {"name": "p", "value": 1.75}, "invert": true}}, {"integrate": {"name": "below", "field": "p", "vector": "u"}}]}"#;
    let tets = warped(&box_of_tets([5, 4, 4], [0.0; 3], UPPER));
    let mixed = box_of_mixed_cells([6, 4, 4], [0.0; 3], UPPER);
    for mesh in [&tets, &mixed] {
        let one = found(pipelines, &Part::whole(mesh).unwrap(), Arc::new(Solo), scalar, vector);
        assert!(one.1.is_empty(), "{:?}", one.1);
        for (by_field, by_plane) in [("level", "plane"), ("above", "side")] {
            for (name, value) in one.0.iter().filter(|(name, _)| name.starts_with(by_field)) {
                is_near(*value, one.0[&name.replace(by_field, by_plane)], name);
            }
        }
        is_near(one.0["level.mean"], 1.75, "level");
        is_near(one.0["above.size"] + one.0["below.size"], 2.0, "both");
        is_near(one.0["above.integral"] + one.0["below.integral"], 3.0, "both");
        is_alike(&on_ranks(mesh, pipelines, scalar, vector), &one);
    }
}

#[test]
fn linear_fields_have_their_closed_forms() {
    let scalar = |[x, y, z]: Vector| 1.0 + x - 3.0 * y + 2.0 * z;
    let vector = |[x, y, z]: Vector| [x + y, 2.0 * y - z, 3.0 * z + 1.0];
    let tets = warped(&box_of_tets([5, 4, 4], [0.0; 3], UPPER));
    let mixed = box_of_mixed_cells([6, 4, 4], [0.0; 3], UPPER);
    for mesh in [&tets, &mixed] {
        let one = found(REGIONS, &Part::whole(mesh).unwrap(), Arc::new(Solo), scalar, vector);
        assert!(one.1.is_empty(), "{:?}", one.1);
        for (name, expected) in [
            ("whole.size", 2.0),
            ("whole.integral", 2.0 * 1.5),
            ("whole.mean", 1.5),
            ("whole.integral.x", 2.0 * 1.5),
            ("whole.mean.y", 0.5),
            ("whole.mean.z", 2.5),
            ("surface.size", 10.0),
            ("surface.integral", 10.0 * 1.5),
            // The divergence of `u`, times the volume.
            ("surface.flow_rate", 6.0 * 2.0),
            // A plane through the whole box cuts off 1 / cos of its section.
            ("cut.size", (4.0_f64 + 0.36 + 0.16).sqrt() / 2.0),
            // On that plane the middle of the section lies at x = 0.9 + 0.3 (0.4 - 0.5).
            ("part.size", 2.0 - 0.87),
        ] {
            is_near(one.0[name], expected, name);
        }
        // What flows out of the part past the plane is what does not flow out elsewhere.
        assert!(one.0["cut.flow_rate"] > 0.0);
        is_alike(&on_ranks(mesh, REGIONS, scalar, vector), &one);
    }
}

#[test]
fn integrals_are_those_of_vtk() {
    let scalar = |[x, y, z]: Vector| x * y + z * z - 0.5 * x;
    let vector = |[x, y, z]: Vector| [y * z - 0.3 * x, (2.0 * x).sin() + z, 0.5 * x * x - y];
    let mesh = warped(&box_of_tets([5, 4, 4], [0.0; 3], UPPER));
    let pipelines = format!("{REGIONS}, {BY_FIELDS}");
    let one = found(&pipelines, &Part::whole(&mesh).unwrap(), Arc::new(Solo), scalar, vector);
    is_alike(&on_ranks(&mesh, &pipelines, scalar, vector), &one);

    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mesh.vtu");
    let all = r#"{"version": 1, "pipelines": [{"name": "all", "stages": [{"write": {"file": "a.vtu"}}]}]}"#;
    let p: Vec<f64> = mesh.points().iter().map(|&point| scalar(point)).collect();
    let u: Vec<Vector> = mesh.points().iter().map(|&point| vector(point)).collect();
    let load: Vec<f64> = (0..mesh.cells().len()).map(|cell| cell as f64).collect();
    let fields =
        [FieldView::vertex("p", &p), FieldView::vertex("u", &u), FieldView::element("load", &load)];
    let channels = [Channel::new("fluid", (&mesh).into(), &fields)];
    let mut runner = Runner::new(&parse(all, "test.json").unwrap()).unwrap();
    let outputs = runner.run(&Snapshot { cycle: 0, time: 0.0, channels: &channels });
    let [Output::Write { extract, .. }] = &outputs[..] else { panic!("{outputs:?}") };
    files::write(&file, extract).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/vtk/integrals.py");
    let mut command = Command::new("/usr/bin/python3");
    command.arg(script).arg(&file).args(["0.9,0.4,0.5", "2,0.6,-0.4"]);
    let output = command.output().expect("scripts/setup installs VTK");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let theirs: Value = serde_json::from_slice(&output.stdout).expect("JSON");

    let near = |ours: &str, theirs: &Value| {
        let (ours_value, theirs) = (one.0[ours], theirs.as_f64().unwrap());
        assert!((ours_value - theirs).abs() < 1e-6, "{ours}: {ours_value}, VTK has {theirs}");
    };
    for region in ["whole", "surface", "cut", "part", "level", "few", "inside"] {
        near(&format!("{region}.size"), &theirs[region]["size"]);
        near(&format!("{region}.integral"), &theirs[region]["p"][0]);
        for (axis, letter) in ["x", "y", "z"].iter().enumerate() {
            near(&format!("{region}.integral.{letter}"), &theirs[region]["u"][axis]);
        }
    }
    near("surface.flow_rate", &theirs["surface"]["flow_rate"]);
    near("cut.flow_rate", &theirs["cut"]["flow_rate"]);
    near("cells.integral", &theirs["whole"]["load"][0]);
    near("cut load.integral", &theirs["cut"]["load"][0]);
    near("part load.integral", &theirs["part"]["load"][0]);
    near("level load.integral", &theirs["level"]["load"][0]);
    near("few load.integral", &theirs["few"]["load"][0]);
    near("inside load.integral", &theirs["inside"]["load"][0]);
    for (axis, letter) in ["x", "y", "z"].iter().enumerate() {
        near(&format!("drag.{letter}"), &theirs["viscous"][axis]);
    }
}

#[test]
fn features_of_a_surface_are_integrated_by_themselves() {
    let scalar = |[x, y, _]: Vector| x + y;
    let vector = |[x, _, z]: Vector| [1.0 + z, 0.0, x];
    let mesh = warped(&box_of_tets([5, 4, 4], [0.0; 3], UPPER));
    let surface = Surface::extract(&mesh, &FeatureSettings::default()).unwrap();
    let features = surface.features();
    // The feature of the face at x = 2.
    let is_end = |face: usize| {
        let corners = surface.faces().vertices(face).iter();
        corners.into_iter().all(|&vertex| surface.points()[vertex as usize][0] == 2.0)
    };
    let end = (0..surface.faces().len()).find(|&face| is_end(face)).unwrap();
    let name = &features.names()[features.face_features()[end] as usize];
    let pipelines = format!(
        r#"{{"name": "ends", "stages": [{{"surface": {{}}}}, {{"integrate":
            {{"name": "outlet", "features": ["{name}"], "field": "p", "vector": "u"}}}}]}}"#
    );
    let one = found(&pipelines, &Part::whole(&mesh).unwrap(), Arc::new(Solo), scalar, vector);
    is_near(one.0["outlet.size"], 1.0, "size");
    is_near(one.0["outlet.mean"], 2.5, "mean");
    is_near(one.0["outlet.flow_rate"], 1.5, "flow rate");
    is_near(one.0["outlet.mean.z"], 2.0, "mean of z");
    is_alike(&on_ranks(&mesh, &pipelines, scalar, vector), &one);

    let wrong = pipelines.replace(name.as_str(), &format!("{name}s"));
    let expected = format!("did you mean `{name}`?");
    let alone = found(&wrong, &Part::whole(&mesh).unwrap(), Arc::new(Solo), scalar, vector);
    assert!(alone.1.len() == 1 && alone.1[0].ends_with(&expected), "{:?}", alone.1);
    let several = on_ranks(&mesh, &wrong, scalar, vector);
    assert_eq!(several.iter().filter(|found| !found.1.is_empty()).count(), 3, "rank 0 speaks");
    for (values, messages) in several.iter().chain([&alone]) {
        assert!(values.values().all(|value| value.is_nan()), "{values:?}");
        assert!(messages.iter().all(|message| message.ends_with(&expected)), "{messages:?}");
    }
}

#[test]
fn hidden_cells_and_what_is_not_finite_do_not_count() {
    let mesh = box_of_hexahedra([4, 2, 2], [0.0; 3], UPPER);
    let middle = |cell: usize| {
        let vertices = mesh.cells().vertices(cell).iter();
        vertices.map(|&vertex| mesh.points()[vertex as usize][0]).sum::<f64>() / 8.0
    };
    let bit = |cell: usize| if middle(cell) > 1.5 { ghosts::HIDDEN } else { 0 };
    let bits: Vec<u8> = (0..mesh.cells().len()).map(bit).collect();
    let part = Part { ghosts: Some(bits), ..Part::whole(&mesh).unwrap() };
    let (values, messages) = found(REGIONS, &part, Arc::new(Solo), |[x, ..]| x, |point| point);
    assert!(messages.is_empty(), "{messages:?}");
    is_near(values["whole.size"], 1.5, "whole");
    is_near(values["whole.mean"], 0.75, "mean");
    is_near(values["surface.size"], 8.0, "surface");
    is_near(values["surface.flow_rate"], 4.5, "flow rate");

    let nan = |[x, y, z]: Vector| if x + y + z == 0.0 { f64::NAN } else { x };
    let all = [found(REGIONS, &Part::whole(&mesh).unwrap(), Arc::new(Solo), nan, |point| point)];
    for (values, _) in all.into_iter().chain(on_ranks(&mesh, REGIONS, nan, |point| point)) {
        assert!(values["whole.mean"].is_nan() && values["surface.mean"].is_nan());
        is_near(values["cut.mean"], values["cut.integral"] / values["cut.size"], "cut");
    }
}

#[test]
fn lines_have_a_flux_across_one_plane() {
    let mut cells = Cells::new();
    cells.push(CellType::Quad, &[0, 1, 2, 3]).unwrap();
    let points = vec![[0.0; 3], [2.0, 0.0, 0.0], [2.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let part = Part { points, cells, ..Part::default() };
    let pipelines = r#"
        {"name": "a", "stages": [{"slice": {"origin": [0.5, 0, 0], "normal": [3, 0, 0]}}, {"integrate": {"name": "line", "vector": "u"}}]},
        {"name": "b", "stages": [{"contour": {"field": "p", "values": [0.5]}}, {"integrate": {"name": "level", "vector": "u"}}]}"#;
    let (values, messages) =
        found(pipelines, &part, Arc::new(Solo), |[x, ..]| x, |[_, y, _]| [y, 7.0, 0.0]);
    is_near(values["line.size"], 1.0, "length");
    is_near(values["line.flow_rate"], 0.5, "flux");
    is_near(values["level.mean.y"], 7.0, "mean");
    assert!(values["level.flow_rate"].is_nan());
    assert!(messages[0].contains("lines have no normal"), "{messages:?}");
}

#[test]
fn a_stage_that_means_nothing_is_refused() {
    for (stages, expected) in [
        (r#"{"integrate": {"name": "a", "features": ["b"]}}"#, "which are those of a `surface`"),
        (
            r#"{"surface": {}}, {"integrate": {"name": "a", "features": ["b", "b"]}}"#,
            "the same feature twice",
        ),
        (r#"{"integrate": {"name": "time"}}"#, "a meaning of its own"),
        (
            r#"{"integrate": {"name": "a"}}, {"integrate": {"name": "a"}}"#,
            "another stage has monitors named `a`",
        ),
        (
            r#"{"probe": {"points": [[0, 0, 0]]}}, {"integrate": {"name": "a"}}"#,
            "what `probe` takes has no size to integrate over",
        ),
    ] {
        let text =
            format!(r#"{{"version": 1, "pipelines": [{{"name": "a", "stages": [{stages}]}}]}}"#);
        let message = parse(&text, "test.json").unwrap_err().to_string();
        assert!(message.contains(expected), "{message}");
    }
    let text = r#"{"version": 1, "pipelines": [{"name": "a", "stages": [
        {"surface": {}}, {"integrate": {"name": "outlet", "vector": "u"}}],
        "when": "outlet.flow_rate < 0 && outlet.mean.x > 1", "then": [{"pause": {}}]}]}"#;
    assert!(parse(text, "test.json").is_ok());
}
