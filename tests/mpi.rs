//! `flow` under mpirun: what one process computes, several do together.

use std::collections::BTreeSet;

use serde_json::{Value, json};
use tombolo_deform::mesh::{Mesh, Vector};
use tombolo_deform::vector::{cross, length, subtract};
use tombolo_pipelines::files::{MeshFile, read_mesh};
use tombolo_tests::{PATIENCE, Run, Small, Viewer, generated_mesh, project};

fn read(small: &Small, name: &str) -> MeshFile {
    read_mesh(small.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// The largest difference relative to the largest value.
fn apart(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    let largest = a.iter().map(|value| value.abs()).fold(f64::MIN_POSITIVE, f64::max);
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / largest
}

/// The triangles of a surface by where their corners are, whatever their numbers.
fn triangles(mesh: &Mesh) -> BTreeSet<[[i64; 3]; 3]> {
    let diagonal = 1.0;
    let place = |point: Vector| point.map(|value| (value / (1e-7 * diagonal)).round() as i64);
    let corners = |vertices: &[u32]| {
        let mut corners: Vec<[i64; 3]> =
            vertices.iter().map(|&vertex| place(mesh.points()[vertex as usize])).collect();
        corners.sort_unstable();
        [corners[0], corners[1], corners[2]]
    };
    mesh.cells().iter().map(|(_, vertices)| corners(vertices)).collect()
}

/// What an order's report tells of where and when it took effect.
fn outcomes(report: &Value) -> Vec<Value> {
    let orders = report["orders"].as_array().expect("a list of orders");
    let told = |order: &Value| {
        let fraction = order["fraction"].as_f64().map(|fraction| (1e9 * fraction).round());
        json!([order["id"], order["status"], order["cycle_applied"], order["shapes"], fraction])
    };
    orders.iter().map(told).collect()
}

/// The ways in which a mesh may be dealt out.
fn dealings() -> [(usize, &'static [&'static str]); 7] {
    [
        (1, &[]),
        (2, &[]),
        (3, &[]),
        (4, &[]),
        (3, &["--empty-rank", "0"]),
        (4, &["--empty-rank", "2", "--shuffle", "5"]),
        (3, &["--shuffle", "11", "--without-numbers"]),
    ]
}

/// A number of ranks, and the options that say how the mesh is dealt out to them.
type Dealing<'a> = (usize, &'a [&'a str]);

/// The same case on one process and dealt out in each way: the orders take effect at the same
/// cycles, the meshes and fields agree.
fn agrees(small: &Small, common: &[&str], dealings: &[Dealing<'_>]) {
    let common = &[common, &["--impulse-tolerance", "1e-6"]].concat()[..];
    let (alone, _) = small.run(common);
    assert_eq!(alone["mesh"]["inverted"], 0);
    let expected = outcomes(&alone);
    assert!(expected.iter().any(|order| order[1] == "applied"), "{alone}");
    let (last, surface) = (read(small, "out/final.vtu"), triangles(&small.mesh("out/surface.vtp")));
    assert!(surface.len() > 500);
    for &(ranks, dealing) in dealings {
        for name in ["final.vtu", "surface.vtp"] {
            std::fs::remove_file(small.path("out").join(name)).expect("it was written");
        }
        let (report, text) = small.run_on(ranks, &[common, dealing].concat());
        let said = format!("{ranks} ranks, {dealing:?}: {text}");
        assert_eq!(outcomes(&report), expected, "{said}");
        for key in ["vertices", "cells", "inverted"] {
            assert_eq!(report["mesh"][key], alone["mesh"][key], "{said}");
        }
        assert_eq!(
            (&report["cycles"], &report["flow"]["unconverged"]),
            (&alone["cycles"], &json!(0)),
            "{said}"
        );
        let found = read(small, "out/final.vtu");
        assert_eq!(found.mesh.cells(), last.mesh.cells());
        let moved = apart(last.mesh.points().as_flattened(), found.mesh.points().as_flattened());
        assert!(moved <= 1e-8, "{said}: coordinates {moved:e} apart");
        for field in &last.fields {
            let other = found
                .fields
                .iter()
                .find(|other| other.name == field.name)
                .expect("the same fields");
            let apart = apart(&field.values, &other.values);
            // The residuals at which the solves stop are 1e-6 and 1e-7 of their right-hand sides.
            assert!(apart < 2e-4, "{said}: {} {apart:e} apart", field.name);
        }
        assert_eq!(triangles(&small.mesh("out/surface.vtp")), surface, "{said}");
    }
}

/// Writes the surface once, at the last step.
fn surface_at(cycle: u64) -> Value {
    json!({"version": 1, "pipelines": [
        {"name": "surface", "at": {"cycle": cycle}, "stages": [{"surface": {}}, {"write": {"file": "surface.vtp"}}]},
        {"name": "health", "every": {"steps": 2}, "stages": [{"quality": {}}, {"statistics": {"field": "velocity"}}],
         "when": "quality.inverted > 0 || velocity.non_finite > 0", "then": [{"stop": {}}]}]})
}

#[test]
fn a_nozzle_is_pinched_alike_on_any_ranks() {
    let small = Small::new();
    small.write("pipelines.json", &surface_at(15));
    small.write(
        "orders.json",
        &json!([
            {"at": {"cycle": 2}, "order": {
                "edits": [{"scale_direction": {
                    "features": ["throat"], "fixed": ["inlet", "outlet"], "factors": [1, 1, 0.6], "harmonic_order": 2}}],
                "schedule": {"steps": 4, "every": {"steps": 2}}}},
            // In the middle of the schedule of the first.
            {"at": {"cycle": 5}, "order": {
                "edits": [{"translate": {"features": ["throat"], "fixed": ["inlet", "outlet"], "by": [0, 0, 0.01]}}],
                "schedule": {"steps": 3}}},
            // One that cannot be done.
            {"at": {"cycle": 10}, "order": {
                "edits": [{"translate": {"features": ["nothing"], "fixed": ["inlet"], "by": [0, 0, 0.01]}}]}},
            {"at": {"cycle": 12}, "order": {"undo": 1}}
        ]),
    );
    let common = ["--pipelines @pipelines.json --orders @orders.json --headless --steps 16"];
    agrees(&small, &common, &dealings());
}

#[test]
fn a_bypass_is_bent_alike_on_any_ranks() {
    let mesh = generated_mesh("bypass-0");
    let small = Small::new();
    let text = std::fs::read_to_string(project().join("examples/flow/cases/bypass.json"))
        .expect("the case");
    let mut case: Value = serde_json::from_str(&text).expect("JSON");
    case["mesh"] = json!(mesh);
    if let Some(case) = case.as_object_mut() {
        case.remove("pipelines");
    }
    small.write("case.json", &case);
    small.write("pipelines.json", &surface_at(4));
    let common = ["--pipelines @pipelines.json --orders @orders.json --headless --steps 5"];
    // A skeleton depends on how the surface is numbered, if little: where the ranks do not say
    // which vertices are the same, one that is not dragged.
    let runs: [(&str, &[Dealing<'_>]); 2] = [
        ("bypass-angle", &[(2, &[]), (4, &["--empty-rank", "0", "--shuffle", "3"])]),
        ("bypass-widen", &[(4, &["--empty-rank", "1", "--shuffle", "3", "--without-numbers"])]),
    ];
    for (name, dealings) in runs {
        let orders = project().join(format!("examples/flow/orders/{name}.json"));
        let mut orders: Value =
            serde_json::from_slice(&std::fs::read(orders).expect("the order")).expect("JSON");
        orders[0]["at"] = json!({"cycle": 1});
        orders[0]["order"]["schedule"] = json!({"steps": 2});
        small.write("orders.json", &orders);
        agrees(&small, &common, dealings);
    }
}

/// The area of the faces of a cut, and the integral of each field over them; both by the corners.
fn integrals(file: &MeshFile) -> Vec<f64> {
    let (points, cells) = (file.mesh.points(), file.mesh.cells());
    let mut integrals = vec![0.0; 1 + file.fields.len()];
    for (_, vertices) in cells.iter() {
        for pair in vertices.windows(2).skip(1) {
            let corners = [vertices[0], pair[0], pair[1]].map(|vertex| vertex as usize);
            let [a, b, c] = corners.map(|vertex| points[vertex]);
            let area = 0.5 * length(cross(subtract(b, a), subtract(c, a)));
            integrals[0] += area;
            for (integral, field) in integrals[1..].iter_mut().zip(&file.fields) {
                let size = |vertex: usize| {
                    let tuple = &field.values[vertex * field.components..][..field.components];
                    tuple.iter().map(|value| value * value).sum::<f64>().sqrt()
                };
                *integral += area * corners.map(size).iter().sum::<f64>() / 3.0;
            }
        }
    }
    integrals
}

/// Cuts, what is kept of cells, probes and derived fields of a mesh that orders move, on each number
/// of ranks as on one process.
#[test]
fn extracts_of_any_ranks_are_alike() {
    let small = Small::new();
    let derive = json!({"expression": {"name": "range", "formula": "x^2 + 0.3 * y + z^2"}});
    let extracts = [
        ("slice.vtp", json!({"slice": {"origin": [0, 0, 0.011], "normal": [0.1, 0.2, 1]}})),
        (
            "cylinder.vtp",
            json!({"slice": {"cylinder": {
            "origin": [0, 0, 0], "axis": [0, 1, 0], "radius": 0.021}}}),
        ),
        ("contour.vtp", json!({"contour": {"field": "range", "values": [-0.05, 0.01]}})),
        ("clip.vtu", json!({"clip": {"plane": {"origin": [0, 0, 0.011], "normal": [0, 0.3, 1]}}})),
        ("threshold.vtu", json!({"threshold": {"field": "range", "min": 0.0}})),
        (
            "probe.vtu",
            json!({"probe": {"grid": {
            "lower": [-0.02, -0.5, -0.031], "upper": [0.021, 0.51, 0.034], "counts": [5, 8, 4]}}}),
        ),
    ];
    let pipelines: Vec<Value> = extracts
        .iter()
        .map(|(file, stage)| {
            json!({"name": file.replace('.', "-"), "at": {"cycle": 9},
                "stages": [derive, stage, {"write": {"file": file}}]})
        })
        .collect();
    small.write("pipelines.json", &json!({"version": 1, "pipelines": pipelines}));
    small.write(
        "orders.json",
        &json!([{"at": {"cycle": 2}, "order": {
            "edits": [{"translate": {
                "features": ["throat"], "fixed": ["inlet", "outlet"], "by": [0, 0, 0.01]}}],
            "schedule": {"steps": 2}}}]),
    );
    let options = [
        "--pipelines @pipelines.json --orders @orders.json",
        "--headless --steps 10 --impulse-tolerance 1e-6",
    ];
    small.run(&options);
    let files = || extracts.each_ref().map(|(file, _)| read(&small, &format!("out/{file}")));
    let alone = files();
    for (ranks, dealing) in dealings() {
        std::fs::remove_dir_all(small.path("out")).expect("it was written");
        let (_, text) = small.run_on(ranks, &[&options[..], dealing].concat());
        for ((name, _), (found, expected)) in extracts.iter().zip(files().iter().zip(&alone)) {
            let said = format!("{name} on {ranks} ranks, {dealing:?}: {text}");
            assert_eq!(found.mesh.cells().len(), expected.mesh.cells().len(), "{said}");
            assert_eq!(found.mesh.points().len(), expected.mesh.points().len(), "{said}");
            let names = |file: &MeshFile| -> Vec<String> {
                file.fields.iter().map(|field| field.name.clone()).collect()
            };
            assert_eq!(names(found), names(expected), "{said}");
            if name.ends_with(".vtp") {
                let (found, expected) = (integrals(found), integrals(expected));
                assert!(expected.iter().all(|integral| *integral > 0.0), "{expected:?}");
                // The area to rounding, the flow as well as its solves agree.
                assert!(apart(&found[..1], &expected[..1]) < 1e-7, "{said}");
                for (found, expected) in found.iter().zip(&expected) {
                    assert!((found - expected).abs() < 1e-3 * expected, "{said}");
                }
            }
            if name.starts_with("probe") {
                for (field, other) in expected.fields.iter().zip(&found.fields) {
                    let apart = apart(&field.values, &other.values);
                    assert!(apart < 1e-3, "{said}: {} {apart:e} apart", field.name);
                }
            }
        }
    }
}

/// Viewers come and go, one of them killed, an order falls into another's schedule: all ranks go on
/// and stop together.
#[test]
fn viewers_steer_three_ranks() {
    let small = Small::new();
    small.write(
        "pipelines.json",
        &json!({"version": 1, "stream": {"listen": "127.0.0.1:0"}, "pipelines": [
            {"name": "surface", "every": {"steps": 2}, "stages": [{"surface": {}}, {"stream": {"error": {"relative": 1e-3}}}]}]}),
    );
    let mut run = Run::flow_on(
        3,
        &small.arguments(&["--pipelines", "@pipelines.json", "--listen", "127.0.0.1:0"]),
    );
    let link = run.link();
    let mut first = Viewer::connect(&link).expect("a viewer connects");
    assert!(!first.frame().is_empty());
    let pinch = |factor: f64, steps: u32| {
        json!({"edits": [{"scale_direction": {
            "features": ["throat"], "fixed": ["inlet", "outlet"], "factors": [1, 1, factor], "harmonic_order": 2}}],
            "schedule": {"steps": steps, "every": {"steps": 2}}})
    };
    first.send(&json!({"id": "long", "order": pinch(0.7, 400)}));
    first.wait_for("order", |order| order["id"] == "long" && order["status"] == "applying");
    first.kill();
    let mut second = Viewer::connect(&link).expect("another viewer connects");
    // The wheel is kept for a moment for the one whose connection was lost.
    second.take_wheel();
    assert!(!second.frame().is_empty());
    second.send(&json!({"id": "amid", "order": pinch(0.9, 2)}));
    second.wait_for("order", |order| order["id"] == "amid" && order["status"] == "applied");
    second.send(
        &json!({"id": "nonsense", "order": {"edits": [{"translate": {"features": ["nowhere"], "by": [0, 0, 1]}}]}}),
    );
    second.wait_for("order", |order| order["id"] == "nonsense" && order["status"] == "rejected");
    second.send(&json!({"id": "end", "stop": {}}));
    let (status, text) = run.finish(PATIENCE);
    assert!(status.success(), "{text}");
    let report = small.read("report.json");
    let orders: Vec<_> =
        report["orders"].as_array().expect("orders").iter().map(|order| &order["status"]).collect();
    assert_eq!(orders, ["applied", "applied", "rejected"], "{report}");
    assert_eq!(report["mesh"]["inverted"], 0);
}

/// What is wrong on all ranks is said once, and all of them end.
#[test]
fn ranks_give_up_together() {
    let small = Small::new();
    let mut case = small.read("case.json");
    case["boundary"]["inlet"]["velocity"][1] = json!("1 / max(0, 0.0101 - t)");
    small.write("case.json", &case);
    let (status, text) = Run::flow_on(3, &small.arguments(&["--headless"])).finish(PATIENCE);
    assert!(!status.success());
    assert_eq!(text.matches("flow: ").count(), 1, "{text}");
    assert!(text.contains("flow: rank ") && text.contains("diverged"), "{text}");
    // What only the first rank finds out.
    let mut arguments = small.arguments(&["--headless"]);
    arguments.extend(["--report".to_owned(), small.path("case.json/r.json").display().to_string()]);
    arguments.drain(4..6);
    let (status, text) = Run::flow_on(3, &arguments).finish(PATIENCE);
    assert!(!status.success() && text.contains("case.json/r.json"), "{text}");
    case["mesh"] = json!("nowhere.msh");
    small.write("case.json", &case);
    let (status, text) = Run::flow_on(3, &small.arguments(&["--headless"])).finish(PATIENCE);
    assert!(!status.success() && text.contains("nowhere.msh"), "{text}");
}
