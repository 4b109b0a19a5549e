//! The viewer's WebAssembly module, in Node: its displacements are those of the native kernel.

use std::fs;
use std::process::Command;
use std::sync::Arc;

use serde_json::{Value, json};
use tombolo_deform::edit::{Edit, Editor};
use tombolo_deform::features::FeatureSettings;
use tombolo_deform::mesh::{CellType, Cells, FeatureSource, Mesh, TaggedFaces, Vector};
use tombolo_deform::shapes;
use tombolo_deform::surface::Surface;
use tombolo_pipelines::encode::encode_surface;
use tombolo_tests::project;

/// How far the two may be apart, in parts of the largest displacement.
const AGREEMENT: f64 = 1e-12;

/// A closed tube, bent into a ring, in three features along it: curved everywhere, with no symmetry
/// that would hide a fault.
fn ring() -> Mesh {
    let mesh = shapes::torus(1.0, 0.35, [48, 18]);
    let points = mesh
        .points()
        .iter()
        .map(|[x, y, z]| [x * 1.3 + 0.1 * y * y, y - 0.05 * x * z, z * 0.8 + 0.1 * x]);
    let points: Vec<Vector> = points.collect();
    let faces = mesh.cells().clone();
    let tags = (0..faces.len()).map(|face| (face * 8 / faces.len()) as i64).collect();
    let names = ["handle", "a", "b", "c", "fixed", "d", "e", "f"];
    let names = names.iter().zip(0..).map(|(name, tag)| (tag, (*name).to_string())).collect();
    let features = FeatureSource::Faces(TaggedFaces { faces: faces.clone(), tags, names });
    Mesh::new(points, faces, features).expect("a mesh")
}

/// An open sheet of quadrilaterals with a step in it.
fn sheet() -> Mesh {
    let (columns, rows) = (24, 14);
    let number = |i: usize, j: usize| (j * (columns + 1) + i) as u32;
    let mut cells = Cells::new();
    let mut tags = Vec::new();
    for j in 0..rows {
        for i in 0..columns {
            let corners = [number(i, j), number(i + 1, j), number(i + 1, j + 1), number(i, j + 1)];
            cells.push(CellType::Quad, &corners).expect("a quadrilateral");
            tags.push(if i < 4 {
                0
            } else if i + 4 < columns {
                1
            } else {
                2
            });
        }
    }
    let height = |x: f64, y: f64| 0.1 * (3.0 * x).sin() + 0.05 * (5.0 * y).cos();
    let points = (0..=rows).flat_map(|j| {
        (0..=columns).map(move |i| {
            let (x, y) = (i as f64 / 12.0, (j as f64 / 14.0).powf(1.2));
            [x, y, height(x, y)]
        })
    });
    let names =
        vec![(0, "fixed".to_string()), (1, "middle".to_string()), (2, "handle".to_string())];
    let features = FeatureSource::Faces(TaggedFaces { faces: cells.clone(), tags, names });
    Mesh::new(points.collect(), cells, features).expect("a mesh")
}

/// The skin of a box, its ends the handle and the fixed part.
fn duct() -> Mesh {
    shapes::box_of_tets([16, 4, 5], [0.0; 3], [4.0, 1.0, 1.2])
}

/// Every kind of edit at every order, alone; and stacks of all of them.
fn stacks(handle: &str, fixed: &str) -> Vec<Value> {
    let followed = [
        ("translate", json!({"by": [0.1, -0.25, 0.3]})),
        ("rotate", json!({"axis": [0.2, 1, -0.3], "degrees": 25})),
        ("scale_direction", json!({"factors": [1.1, 0.6, 1.4]})),
        ("scale_direction", json!({"factors": [0.9, 1.2, 0.8], "center": [0.3, 0.1, -0.2]})),
        ("scale_normals", json!({"distance": 0.07})),
        (
            "affine",
            json!({"matrix": [[1, 0.2, 0], [0, 1.1, 0.1], [-0.1, 0, 0.9]], "translation": [0, 0.1, 0]}),
        ),
        (
            "translate",
            json!({"by": [0, 0.1, 0], "region": {"sphere": {"center": [1, 0, 0], "radius": 3.2}}}),
        ),
        ("translate", json!({"by": [0, 9, 0], "muted": true, "name": "not this one"})),
    ];
    let mut stacks = vec![json!([])];
    for order in 1..=3 {
        let mut edits: Vec<Value> = followed
            .iter()
            .map(|(name, body)| {
                let mut body = body.clone();
                body["features"] = json!([handle]);
                body["fixed"] = json!([fixed]);
                body["harmonic_order"] = json!(order);
                json!({ *name: body })
            })
            .collect();
        edits
            .push(json!({"displacement": {"vertices": [3, 5], "values": [[0.1, 0, 0.2], [0, -0.1, 0]], "scale": 0.5}}));
        stacks.extend(edits.iter().map(|edit| json!([edit])));
        stacks.push(json!(edits));
    }
    stacks
}

#[test]
fn the_module_computes_what_the_native_kernel_computes() {
    let module = project().join("viewer/wasm/pkg/kernel.wasm");
    assert!(module.exists(), "{} is not there; run scripts/setup", module.display());
    let directory = tempfile::tempdir().expect("a directory");
    let cases = [
        ("ring", ring(), "handle", "fixed"),
        ("sheet", sheet(), "handle", "fixed"),
        ("duct", duct(), "x-max", "x-min"),
    ];
    for (name, mesh, handle, fixed) in cases {
        let surface =
            Arc::new(Surface::extract(&mesh, &FeatureSettings::default()).expect("a surface"));
        let stacks = stacks(handle, fixed);
        let [frame, input, output] =
            ["surface", "json", "bin"].map(|kind| directory.path().join(format!("{name}.{kind}")));
        fs::write(&frame, encode_surface(&surface).expect("a frame")).expect("written");
        fs::write(&input, json!(stacks).to_string()).expect("written");
        let ran = Command::new("node")
            .arg(project().join("viewer/wasm/run.mjs"))
            .args([&module, &frame, &input, &output])
            .output()
            .expect("node is installed (scripts/setup)");
        assert!(ran.status.success(), "{name}: {}", String::from_utf8_lossy(&ran.stderr));
        let bytes = fs::read(&output).expect("displacements");
        let values: Vec<f64> =
            bytes.as_chunks().0.iter().map(|&value| f64::from_le_bytes(value)).collect();
        let mut values = values.as_chunks::<3>().0.chunks_exact(surface.points().len());

        let mut editor = Editor::new(surface).expect("an editor");
        let mut worst = 0.0_f64;
        for stack in &stacks {
            let edits: Vec<Edit> = serde_json::from_value(stack.clone()).expect("edits");
            let native = editor.displacement(&edits).expect("a displacement");
            let module = values.next().expect("a displacement of the module");
            let largest = native
                .as_flattened()
                .iter()
                .fold(0.0_f64, |largest, value| largest.max(value.abs()));
            let apart = native.as_flattened().iter().zip(module.as_flattened());
            let apart =
                apart.fold(0.0_f64, |apart, (ours, theirs)| apart.max((ours - theirs).abs()));
            assert!(
                apart <= AGREEMENT * largest,
                "{name}, {stack}: {apart:e} apart, of {largest:e}"
            );
            worst = worst.max(apart / largest.max(f64::MIN_POSITIVE));
        }
        assert!(values.next().is_none(), "{name}: more displacements than stacks");
        println!("{name}: {} stacks, {worst:.1e} apart at most", stacks.len());
    }
}
