//! What source stages take out of a mesh and derive from its fields, beside VTK's own filters, on
//! one process and on three ranks.

mod common;

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use common::{runner, shown};
use serde_json::Value;
use tombolo_deform::communicator::{Communicator, Solo, threads};
use tombolo_deform::distributed::{Part, in_order};
use tombolo_deform::mesh::{CellType, Cells, FeatureSource, Mesh, Vector};
use tombolo_deform::shapes::{box_of_mixed_cells, box_of_tets};
use tombolo_pipelines::extract::{Channel, Extract, FieldView, Snapshot};
use tombolo_pipelines::files;
use tombolo_pipelines::run::Output;

/// What is compared, beside what every comparison has: the values at common points.
#[derive(Clone, Copy, PartialEq)]
enum Compared {
    /// Sizes, integrals of all fields, and every point.
    All,
    /// Sizes, integrals of element fields, and every point.
    Elements,
    /// Sizes and integrals of element fields; the points may be others.
    Sizes,
    /// Every point.
    Points,
}

const SLICES: &str = r#"
    {"name": "plane", "stages": [{"slice": {"origin": [0.9, 0.4, 0.5], "normal": [1, 0.3, -0.2]}}, {"write": {"file": "plane.vtu"}}]},
    {"name": "planes", "stages": [{"slice": {"planes": [
        {"origin": [0.9, 0.4, 0.5], "normal": [1, 0.3, -0.2]}, {"origin": [0.3, 0.2, 0.55], "normal": [0.1, 0.3, 2]}]}}, {"write": {"file": "planes.vtu"}}]}"#;
const ROUND: &str = r#"
    {"name": "cylinder", "stages": [{"slice": {"cylinder": {"origin": [1, 0.5, 0], "axis": [0.3, 0.1, 1], "radius": 0.37}}}, {"write": {"file": "cylinder.vtu"}}]},
    {"name": "sphere", "stages": [{"slice": {"sphere": {"center": [1.1, 0.45, 0.5], "radius": 0.43}}}, {"write": {"file": "sphere.vtu"}}]},
    {"name": "contour", "stages": [{"contour": {"field": "p", "values": [0.11, 0.42]}}, {"write": {"file": "contour.vtu"}}]},
    {"name": "contour of a magnitude", "stages": [{"magnitude": {"field": "u", "name": "speed"}}, {"contour": {"field": "speed", "values": [0.9]}}, {"write": {"file": "contour-of-a-magnitude.vtu"}}]}"#;
const THRESHOLDS: &str = r#"
    {"name": "by elements", "stages": [{"threshold": {"field": "load", "min": 3, "max": 11}}, {"write": {"file": "by-elements.vtu"}}]},
    {"name": "all vertices", "stages": [{"threshold": {"field": "p", "min": 0.2}}, {"write": {"file": "all-vertices.vtu"}}]},
    {"name": "any vertex", "stages": [{"threshold": {"field": "p", "max": 0.1, "vertices": "any"}}, {"write": {"file": "any-vertex.vtu"}}]}"#;
const CLIPS: &str = r#"
    {"name": "clip", "stages": [{"clip": {"plane": {"origin": [0.9, 0.4, 0.5], "normal": [1, 0.3, -0.2]}}}, {"write": {"file": "clip.vtu"}}]},
    {"name": "other side", "stages": [{"clip": {"plane": {"origin": [0.9, 0.4, 0.5], "normal": [1, 0.3, -0.2]}, "invert": true}}, {"write": {"file": "other-side.vtu"}}]},
    {"name": "clip by a sphere", "stages": [{"clip": {"sphere": {"center": [1.1, 0.45, 0.5], "radius": 0.43}}}, {"write": {"file": "clip-by-a-sphere.vtu"}}]},
    {"name": "outside of a sphere", "stages": [{"clip": {"sphere": {"center": [1.1, 0.45, 0.5], "radius": 0.43}, "invert": true}}, {"write": {"file": "outside-of-a-sphere.vtu"}}]},
    {"name": "clip by a field", "stages": [{"clip": {"field": {"name": "p", "value": 0.2}}}, {"write": {"file": "clip-by-a-field.vtu"}}]}"#;
const BOXES: &str = r#"
    {"name": "clip by a box", "stages": [{"clip": {"box": {"lower": [0.33, 0.21, -1], "upper": [1.4, 0.7, 0.62]}}}, {"write": {"file": "clip-by-a-box.vtu"}}]},
    {"name": "around a box", "stages": [{"clip": {"box": {"lower": [0.33, 0.21, 0.2], "upper": [1.4, 0.7, 0.62]}, "invert": true}}, {"write": {"file": "around-a-box.vtu"}}]}"#;
const PROBES: &str = r#"
    {"name": "probe", "stages": [{"probe": {"points": [[0.31, 0.22, 0.13], [1.07, 0.55, 0.61], [1.93, 0.91, 0.87]]}}, {"write": {"file": "probe.vtu"}}]},
    {"name": "line", "stages": [{"probe": {"line": {"from": [0.013, 0.047, 0.171], "to": [1.931, 0.89, 0.773], "count": 57}}}, {"write": {"file": "line.vtu"}}]},
    {"name": "grid", "stages": [{"probe": {"grid": {"lower": [0.03, 0.04, 0.05], "upper": [1.94, 0.93, 0.89], "counts": [9, 7, 5]}}}, {"write": {"file": "grid.vtu"}}]}"#;
const DERIVED: &str = r#"
    {"name": "gradient", "stages": [{"gradient": {"field": "p"}}, {"write": {"file": "gradient.vtu"}}]},
    {"name": "gradient of a vector", "stages": [{"gradient": {"field": "u", "name": "du"}}, {"write": {"file": "gradient-of-a-vector.vtu"}}]},
    {"name": "gradient in cells", "stages": [{"gradient": {"field": "load"}}, {"write": {"file": "gradient-in-cells.vtu"}}]},
    {"name": "vorticity", "stages": [{"vorticity": {"field": "u"}}, {"write": {"file": "vorticity.vtu"}}]},
    {"name": "vorticity in cells", "stages": [{"vorticity": {"field": "flux", "name": "turning"}}, {"write": {"file": "vorticity-in-cells.vtu"}}]},
    {"name": "divergence", "stages": [{"divergence": {"field": "u"}}, {"write": {"file": "divergence.vtu"}}]},
    {"name": "q", "stages": [{"q_criterion": {"field": "u"}}, {"write": {"file": "q.vtu"}}]},
    {"name": "magnitude", "stages": [{"magnitude": {"field": "flux"}}, {"write": {"file": "magnitude.vtu"}}]},
    {"name": "vortices", "stages": [{"q_criterion": {"field": "u"}}, {"contour": {"field": "q_criterion", "values": [0.05]}}, {"write": {"file": "vortices.vtu"}}]}"#;

/// What the pipelines write of a part, by the names of the pipelines.
fn made(
    pipelines: &str,
    part: &Part,
    communicator: Arc<dyn Communicator>,
) -> BTreeMap<String, Arc<Extract>> {
    let number = |cell: usize| {
        part.global_cells.as_ref().map_or(cell as f64, |numbers| numbers[cell] as f64)
    };
    let p: Vec<f64> = part.points.iter().map(|[x, y, z]| x * y + z * z - 0.5 * x).collect();
    let u: Vec<Vector> = part
        .points
        .iter()
        .map(|[x, y, z]| [y * z - 0.3 * x, (2.0 * x).sin() + z, 0.5 * x * x - y])
        .collect();
    let load: Vec<f64> = (0..part.cells.len()).map(|cell| number(cell) % 17.0).collect();
    let flux: Vec<Vector> =
        (0..part.cells.len()).map(|cell| [number(cell).sin(), 0.1 * number(cell), 1.0]).collect();
    let fields = [
        FieldView::vertex("p", &p),
        FieldView::vertex("u", &u),
        FieldView::element("load", &load),
        FieldView::element("flux", &flux),
    ];
    let channels = [Channel::new("fluid", part.view(), shown(part, &fields))];
    let mut runner = runner(pipelines, communicator);
    let mut extracts = BTreeMap::new();
    // The second time from what was kept.
    for cycle in 0..2 {
        for output in runner.run(&Snapshot { cycle, time: 0.5, channels: &channels }) {
            match output {
                Output::Write { pipeline, extract, .. } => {
                    if let Some(before) =
                        extracts.insert(pipeline.to_string(), Arc::clone(&extract))
                    {
                        assert_eq!(before, extract, "{pipeline}");
                    }
                }
                other => panic!("{other:?}"),
            }
        }
    }
    extracts
}

/// A number of the results of tests/vtk/extracts.py.
fn at(value: &Value, indices: [usize; 2]) -> f64 {
    value[indices[0]][indices[1]].as_f64().unwrap()
}

fn agree(mesh: &Mesh, what: &str, pipelines: &str, compared: Compared) {
    let whole = Part::whole(mesh).unwrap();
    let mut extracts = made(pipelines, &whole, Arc::new(Solo));
    // Cells in an order that leaves each rank several pieces, and copies of those of the others.
    let of_cells: Vec<usize> =
        in_order(mesh.cells().len(), 7).iter().map(|piece| piece % 3).collect();
    let by_ranks = threads::run(3, |ranks| {
        let part = Part::cut(mesh, &of_cells, ranks.rank(), true).unwrap();
        made(pipelines, &part, Arc::new(ranks))
    });
    for (name, extract) in &by_ranks[0] {
        assert_eq!(extract.points.len(), extracts[name].points.len(), "{what}: {name}");
        assert_eq!(extract.cells.len(), extracts[name].cells.len(), "{what}: {name}");
    }
    assert_eq!(by_ranks[0].len(), extracts.len());
    extracts.extend(
        by_ranks[0].iter().map(|(name, extract)| (format!("{name}@3"), Arc::clone(extract))),
    );

    let folder = tempfile::tempdir().unwrap();
    let written = |name: &str, extract: &Extract| {
        let path = folder.path().join(format!("{name}.vtu"));
        files::write(&path, extract).unwrap();
        path.display().to_string()
    };
    let all = r#"{"name": "all", "stages": [{"write": {"file": "a.vtu"}}]}"#;
    let input = written("the mesh", &made(all, &whole, Arc::new(Solo))["all"]);
    let file = folder.path().join("pipelines.json");
    let text = format!(r#"{{"version": 1, "pipelines": [{pipelines}]}}"#);
    std::fs::write(&file, text).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/vtk/extracts.py");
    let mut command = Command::new("/usr/bin/python3");
    command.arg(script).arg(&file).arg(input);
    for (name, extract) in &extracts {
        command.arg(format!("{name}={}", written(name, extract)));
    }
    let output = command.output().expect("scripts/setup installs VTK");
    assert!(output.status.success(), "{what}: {}", String::from_utf8_lossy(&output.stderr));
    let results: Value = serde_json::from_slice(&output.stdout).expect("JSON");

    let mut wrong = Vec::new();
    for name in extracts.keys() {
        let result = &results[name];
        let mut differ = |part: &str, ours: f64, theirs: f64| {
            let difference = (ours - theirs).abs();
            if difference.is_nan() || difference > 1e-6 * theirs.abs().max(1.0) {
                wrong.push(format!("{what}: {name}: {part}: {ours}, VTK has {theirs}"));
            }
        };
        if compared != Compared::Points {
            for (part, theirs) in result["sizes"][1].as_object().unwrap() {
                let counts = compared == Compared::All || !part.starts_with("vertex");
                if counts {
                    let ours = result["sizes"][0][part].as_f64().unwrap_or(f64::NAN);
                    differ(part, ours, theirs.as_f64().unwrap());
                }
            }
        }
        if compared != Compared::Sizes {
            for part in ["points", "elements"] {
                if result[part].is_array() {
                    for indices in [[0, 0], [0, 1], [1, 0], [1, 1]] {
                        // The centre of a wedge, which has six digits in VTK.
                        if part == "elements" && what == "warped cells" {
                            assert!(at(&result[part], indices) < 2e-5, "{what}: {name}: {result}");
                            continue;
                        }
                        differ(&format!("{part} {indices:?}"), at(&result[part], indices), 0.0);
                    }
                }
            }
        }
        if result["names"][0] != result["names"][1] {
            wrong.push(format!("{what}: {name}: {}", result["names"]));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The mesh with its vertices moved a little, each in its own way; those of the faces of the box
/// stay in them.
fn warped(mesh: &Mesh, amount: f64) -> Mesh {
    let bend = |[x, y, z]: Vector| {
        let inside = x * (2.0 - x) * y * (1.0 - y) * z * (1.0 - z);
        let wave = |phase: f64| amount * inside * (7.0 * x + 5.0 * y - 6.0 * z + phase).sin();
        [x + wave(0.0), y + wave(1.0), z + wave(2.0)]
    };
    let points = mesh.points().iter().copied().map(bend).collect();
    Mesh::new(points, mesh.cells().clone(), FeatureSource::SharpEdges).unwrap()
}

/// The mesh with its hexahedra turned to voxels and polyhedra by turns.
fn with_polyhedra(mesh: &Mesh) -> Mesh {
    let mut cells = Cells::new();
    for (cell, (cell_type, vertices)) in mesh.cells().iter().enumerate() {
        match (cell_type, cell % 3) {
            (CellType::Hexahedron, 0) => {
                let mut faces = Vec::new();
                mesh.cells().for_each_face(cell, |face| faces.push(face.to_vec()));
                cells.push_polyhedron(&faces).unwrap();
            }
            (CellType::Hexahedron, 1) => {
                let voxel = [0, 1, 3, 2, 4, 5, 7, 6].map(|local| vertices[local]);
                cells.push(CellType::Voxel, &voxel).unwrap();
            }
            _ => cells.push(cell_type, vertices).unwrap(),
        }
    }
    Mesh::new(mesh.points().to_vec(), cells, FeatureSource::SharpEdges).unwrap()
}

const UPPER: Vector = [2.0, 1.0, 1.0];

#[test]
fn cuts_are_those_of_vtk() {
    let tets = warped(&box_of_tets([5, 4, 4], [0.0; 3], UPPER), 0.5);
    agree(&tets, "tetrahedra", &format!("{SLICES}, {ROUND}"), Compared::All);
    let mixed = box_of_mixed_cells([6, 4, 4], [0.0; 3], UPPER);
    agree(&mixed, "mixed cells", SLICES, Compared::Elements);
    // VTK cuts the diagonals of a polyhedron's faces too.
    agree(&with_polyhedra(&mixed), "polyhedra", SLICES, Compared::Sizes);
    // What is not plane is triangulated in more than one way.
    agree(&warped(&mixed, 0.5), "warped cells", &format!("{SLICES}, {ROUND}"), Compared::Points);
}

#[test]
fn parts_of_the_volume_are_those_of_vtk() {
    let tets = warped(&box_of_tets([5, 4, 4], [0.0; 3], UPPER), 0.5);
    agree(&tets, "tetrahedra", &format!("{THRESHOLDS}, {CLIPS}"), Compared::All);
    agree(&tets, "tetrahedra", BOXES, Compared::Sizes);
    let mixed = box_of_mixed_cells([6, 4, 4], [0.0; 3], UPPER);
    agree(&mixed, "mixed cells", THRESHOLDS, Compared::Elements);
    for (what, mesh) in [("mixed cells", &mixed), ("polyhedra", &with_polyhedra(&mixed))] {
        agree(mesh, what, &format!("{CLIPS}, {BOXES}"), Compared::Sizes);
    }
}

#[test]
fn values_at_points_are_those_of_vtk() {
    let tets = warped(&box_of_tets([5, 4, 4], [0.0; 3], UPPER), 0.5);
    let mixed = warped(&box_of_mixed_cells([6, 4, 4], [0.0; 3], UPPER), 0.5);
    agree(&tets, "tetrahedra", PROBES, Compared::Points);
    agree(&mixed, "warped cells", PROBES, Compared::Points);
}

#[test]
fn derived_fields_are_those_of_vtk() {
    let tets = warped(&box_of_tets([5, 4, 4], [0.0; 3], UPPER), 0.5);
    let mixed = warped(&box_of_mixed_cells([6, 4, 4], [0.0; 3], UPPER), 0.5);
    agree(&tets, "tetrahedra", DERIVED, Compared::Points);
    agree(&mixed, "warped cells", DERIVED, Compared::Points);
}
