//! Streamlines of fields in closed form, beside VTK's, and over the parts of a mesh.

mod common;

use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use common::{runner, shown};
use serde_json::Value;
use tombolo_deform::communicator::{Communicator, Solo, threads};
use tombolo_deform::distributed::{Part, in_order};
use tombolo_deform::mesh::{CellType, Cells, FeatureSource, Mesh, Vector, ghosts};
use tombolo_deform::shapes::{box_of_mixed_cells, box_of_tets};
use tombolo_pipelines::extract::{Channel, Extract, FieldView, Snapshot};
use tombolo_pipelines::files;
use tombolo_pipelines::run::Output;

/// The lines that a stage takes out of a part, on rank 0, and what was told.
fn lines(
    stage: &str,
    part: &Part,
    field: impl Fn(Vector) -> Vector,
    communicator: Arc<dyn Communicator>,
) -> (Option<Arc<Extract>>, Vec<String>) {
    let u: Vec<Vector> = part.points.iter().map(|&point| field(point)).collect();
    let x: Vec<f64> = part.points.iter().map(|point| point[0]).collect();
    let load: Vec<f64> = (0..part.cells.len()).map(|_| 2.5).collect();
    let fields =
        [FieldView::vertex("u", &u), FieldView::vertex("x", &x), FieldView::element("load", &load)];
    let channels = [Channel::new("fluid", part.view(), shown(part, &fields))];
    let pipeline = format!(
        r#"{{"name": "a", "stages": [{{"streamlines": {stage}}}, {{"write": {{"file": "a.vtu"}}}}]}}"#
    );
    let mut runner = runner(&pipeline, communicator);
    let (mut extract, mut errors) = (None, Vec::new());
    for output in runner.run(&Snapshot { cycle: 0, time: 0.0, channels: &channels }) {
        match output {
            Output::Write { extract: taken, .. } => extract = Some(taken),
            Output::Error { message, .. } => errors.push(message),
            other => panic!("{other:?}"),
        }
    }
    (extract, errors)
}

fn alone(stage: &str, mesh: &Mesh, field: impl Fn(Vector) -> Vector) -> Arc<Extract> {
    let part = Part::whole(mesh).unwrap();
    let (extract, errors) = lines(stage, &part, field, Arc::new(Solo));
    assert!(errors.is_empty(), "{errors:?}");
    extract.unwrap()
}

fn values<'a>(extract: &'a Extract, name: &str) -> &'a [f64] {
    &extract.fields.iter().find(|field| field.name == name).unwrap().values
}

/// Turns about (1, 0.5) once in 2 pi.
fn rotation([x, y, _]: Vector) -> Vector {
    [0.5 - y, x - 1.0, 0.0]
}

#[test]
fn a_rigid_rotation_has_circles() {
    // The field is linear, so that tetrahedra have it exactly.
    let mesh = box_of_tets([8, 5, 4], [0.0; 3], [2.0, 1.0, 1.0]);
    let stage = r#"{"field": "u", "points": [[1.3, 0.5, 0.37]], "direction": "forward",
                    "error": 1e-9, "max_length": 1.884955592153876}"#;
    let extract = alone(stage, &mesh, rotation);
    let radius = |[x, y, _]: Vector| ((x - 1.0).powi(2) + (y - 0.5).powi(2)).sqrt();
    for point in &extract.points {
        assert!((radius(*point) - 0.3).abs() < 1e-7, "{point:?}");
        assert_eq!(point[2], 0.37);
    }
    // Once around, by the length and by the time. Chords are shorter than the circle.
    let times = values(&extract, "integration_time");
    let [x, y, _] = *extract.points.last().unwrap();
    let turned = times.last().unwrap() - std::f64::consts::TAU;
    assert!((0.0..0.2).contains(&turned), "{turned}");
    assert!((x - 1.0 - 0.3 * turned.cos()).abs() < 1e-6, "{x}");
    assert!((y - 0.5 - 0.3 * turned.sin()).abs() < 1e-6, "{y}");
    assert!(extract.cells.len() + 1 == extract.points.len() && extract.points.len() > 20);
    assert!(values(&extract, "load").iter().all(|&load| load == 2.5));
    let x = values(&extract, "x");
    assert!(extract.points.iter().zip(x).all(|(point, x)| (point[0] - x).abs() < 1e-12));
}

#[test]
fn smaller_errors_come_nearer_by_the_order_of_the_method() {
    let mesh = box_of_tets([2, 1, 1], [-1.0; 3], [1.0; 3]);
    let stage = |error: f64| {
        format!(
            r#"{{"field": "u", "points": [[0.5, 0, 0.1]], "direction": "forward", "error": {error}, "max_length": 6}}"#
        )
    };
    let error = |allowed: f64| {
        let extract = alone(&stage(allowed), &mesh, |[x, y, _]| [-y, x, 0.0]);
        let radius = |[x, y, _]: &Vector| ((x * x + y * y).sqrt() - 0.5).abs();
        extract.points.iter().map(radius).fold(0.0, f64::max)
    };
    let [coarse, fine] = [1e-4, 1e-9].map(error);
    assert!(coarse < 1e-3 && fine < 1e-7 && fine < coarse / 100.0, "{coarse} {fine}");
}

#[test]
fn lines_of_a_channel_are_straight_and_end_at_its_ends() {
    let mesh = box_of_mixed_cells([6, 4, 4], [0.0; 3], [2.0, 1.0, 1.0]);
    let stage = r#"{"field": "u", "plane": {"origin": [0.7, 0.1, 0.2], "first": [0.7, 0.9, 0.2], "second": [0.7, 0.1, 0.8], "counts": [5, 3]}}"#;
    let extract = alone(stage, &mesh, |[_, y, _]| [y * (1.0 - y) + 0.01, 0.0, 0.0]);
    let mut ends = Vec::new();
    for point in &extract.points {
        let to_seed =
            |at: f64, seeds: &[f64]| seeds.iter().map(|seed| (at - seed).abs()).fold(1.0, f64::min);
        assert!(to_seed(point[1], &[0.1, 0.3, 0.5, 0.7, 0.9]) < 1e-12);
        assert!(to_seed(point[2], &[0.2, 0.5, 0.8]) < 1e-12);
        ends.push(point[0]);
    }
    // 15 lines, each with both ends, to a thousandth of a cell.
    let near = |end: f64| ends.iter().filter(|&&x| (x - end).abs() < 1e-3).count();
    assert!(near(0.0) >= 15 && near(2.0) >= 15);
    assert_eq!(extract.points.len() - extract.cells.len(), 15);
    // Against the flow time runs backwards.
    let times = values(&extract, "integration_time");
    assert!(extract.points.iter().zip(times).all(|(point, time)| (point[0] - 0.7) * time >= 0.0));
}

fn swirl([x, y, z]: Vector) -> Vector {
    [0.6 + 0.3 * z, 0.5 * (z - 0.5) + 0.1 * (3.0 * x).sin(), 0.5 * (0.5 - y) * x]
}

const SEEDS: &str =
    r#"[[0.2, 0.3, 0.4], [0.6, 0.55, 0.52], [1.1, 0.2, 0.7], [1.7, 0.8, 0.6], [0.4, 0.71, 0.13]]"#;

#[test]
fn lines_are_those_of_vtk() {
    for (what, mesh) in [
        ("tetrahedra", box_of_tets([6, 4, 4], [0.0; 3], [2.0, 1.0, 1.0])),
        ("mixed cells", box_of_mixed_cells([6, 4, 4], [0.0; 3], [2.0, 1.0, 1.0])),
    ] {
        let stage = format!(r#"{{"field": "u", "points": {SEEDS}, "error": 1e-7}}"#);
        let extract = alone(&stage, &mesh, swirl);
        let folder = tempfile::tempdir().unwrap();
        let [ours, input] = ["lines.vtu", "mesh.vtu"].map(|name| folder.path().join(name));
        files::write(&ours, &extract).unwrap();
        let u: Vec<f64> = mesh.points().iter().flat_map(|&point| swirl(point)).collect();
        let whole = Extract {
            points: mesh.points().to_vec(),
            vertices: None,
            cells: Arc::new(mesh.cells().clone()),
            features: None,
            fields: vec![tombolo_pipelines::extract::Field {
                name: "u".into(),
                association: tombolo_pipelines::extract::Association::Vertex,
                components: 3,
                number: tombolo_deform::mesh::NumberType::F64,
                values: u,
            }],
        };
        files::write(&input, &whole).unwrap();
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/vtk/streamlines.py");
        let output = Command::new("/usr/bin/python3")
            .arg(script)
            .args([&input, &ours])
            .arg(SEEDS)
            .output()
            .expect("scripts/setup installs VTK");
        let error = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{what}: {error}");
        let result: Value = serde_json::from_slice(&output.stdout).expect("JSON");
        let number = |key: &str| result[key].as_f64().unwrap();
        assert!(number("distance") < 1e-4, "{what}: {result}");
        assert!(number("end") < 2e-3, "{what}: {result}");
        assert!(number("time") < 5e-3, "{what}: {result}");
    }
}

#[test]
fn lines_go_on_from_rank_to_rank() {
    for mesh in [
        box_of_tets([6, 4, 4], [0.0; 3], [2.0, 1.0, 1.0]),
        box_of_mixed_cells([6, 4, 4], [0.0; 3], [2.0, 1.0, 1.0]),
    ] {
        let stages = [
            format!(r#"{{"field": "u", "points": {SEEDS}}}"#),
            r#"{"field": "u", "grid": {"lower": [0.31, 0.22, 0.23], "upper": [1.7, 0.81, 0.84], "counts": [3, 3, 3]}, "direction": "backward"}"#.to_owned(),
            r#"{"field": "u", "features": {"names": ["x-min"], "count": 6}, "max_length": 0.7}"#.to_owned(),
        ];
        let of_cells: Vec<usize> =
            in_order(mesh.cells().len(), 7).iter().map(|piece| piece % 3).collect();
        for (stage, has_ghosts) in stages.iter().zip([true, false, true]) {
            let whole = alone(stage, &mesh, swirl);
            let by_ranks = threads::run(3, |ranks| {
                let part = Part::cut(&mesh, &of_cells, ranks.rank(), has_ghosts).unwrap();
                lines(stage, &part, swirl, Arc::new(ranks))
            });
            let (extract, errors) = &by_ranks[0];
            assert!(errors.is_empty(), "{errors:?}");
            let extract = extract.as_ref().unwrap();
            // None of the seeds lies on a face, where either cell could set the first step.
            assert_eq!(extract.points.len(), whole.points.len(), "{stage}");
            assert_eq!(extract.cells, whole.cells);
            for (ours, theirs) in whole.points.iter().zip(&extract.points) {
                assert!((0..3).all(|axis| (ours[axis] - theirs[axis]).abs() < 1e-9), "{ours:?}");
            }
            for name in ["u", "x", "load", "integration_time"] {
                let pairs = values(&whole, name).iter().zip(values(extract, name));
                assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-8), "{name}");
            }
        }
    }
}

/// Lines begin on a feature of a mesh of faces, and of one with cells that are hidden.
#[test]
fn seeds_lie_on_the_features_of_any_mesh() {
    let mesh = box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]);
    let mut part = Part::whole(&mesh).unwrap();
    let hidden = (0..mesh.cells().len()).map(|cell| if cell == 100 { ghosts::HIDDEN } else { 0 });
    part.ghosts = Some(hidden.collect());
    let stage = r#"{"field": "u", "features": {"names": ["x-min"], "count": 4}}"#;
    let (extract, errors) = lines(stage, &part, |_| [1.0, 0.0, 0.0], Arc::new(Solo));
    assert_eq!(errors, [""; 0]);
    let extract = extract.unwrap();
    assert_eq!(extract.points.iter().filter(|point| point[0] < 1e-2).count(), 4);

    let mut cells = Cells::new();
    cells.push(CellType::Quad, &[0, 1, 2, 3]).unwrap();
    let corners = vec![[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let flat = Mesh::new(corners, cells, FeatureSource::SharpEdges).unwrap();
    let part = Part::of(&(&flat).into()).unwrap();
    let stage = r#"{"field": "u", "features": {"names": ["feature-1"], "count": 1}}"#;
    let (extract, errors) = lines(stage, &part, |_| [1.0, 0.0, 0.0], Arc::new(Solo));
    assert_eq!(errors, [""; 0]);
    assert!(extract.unwrap().points.contains(&[0.5, 0.5, 0.0]));
}

#[test]
fn what_cannot_be_followed_is_told() {
    let mesh = box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]);
    let part = Part::whole(&mesh).unwrap();
    let told = |stage: &str| lines(stage, &part, rotation, Arc::new(Solo)).1.join("\n");
    assert_eq!(
        told(r#"{"field": "u", "points": [[0.2, 0.2, 0.2], [3, 0, 0]]}"#),
        "streamlines: 1 of 2 points lie in no cell and are left out, first (3, 0, 0)"
    );
    assert_eq!(
        told(r#"{"field": "x", "points": [[0.2, 0.2, 0.2]]}"#),
        "streamlines: field `x` has 1 components, expected a vector of 2 or 3"
    );
    let error = told(r#"{"field": "u", "features": {"names": ["inlett"], "count": 3}}"#);
    assert!(error.contains("the surface has no feature `inlett`"), "{error}");
}
