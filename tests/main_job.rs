//! The main job, without a picture: the throat of a nozzle is pinched to half its height while the
//! flow runs, on the schedules of the paper, and opened again.

use serde_json::{Value, json};
use tombolo_deform::mesh::{Mesh, Vector};
use tombolo_deform::quality::quality;
use tombolo_tests::Small;

/// Vertices of the throat: on the wall, 0.1 to either side of the middle.
fn throat(mesh: &Mesh) -> Vec<usize> {
    let on_wall = |p: &Vector| p[0].abs() > 0.025 - 1e-9 || p[2].abs() > 0.05 - 1e-9;
    let points = mesh.points().iter().enumerate();
    points
        .filter(|(_, p)| p[1].abs() < 0.1 + 1e-9 && on_wall(p))
        .map(|(vertex, _)| vertex)
        .collect()
}

/// Runs 60 steps with an order at its schedule and an undo at cycle 45; the mesh is written at
/// every cycle.
fn pinch(order: &Value) -> (Small, Value) {
    let small = Small::new();
    small.write(
        "pipelines.json",
        &json!({"version": 1, "pipelines": [
            {"name": "mesh", "every": {"steps": 1}, "stages": [{"write": {"file": "mesh-{cycle}.vtu"}}]}]}),
    );
    small.write("orders.json", &json!([order, {"at": {"cycle": 45}, "order": {"undo": 1}}]));
    let more = "--pipelines @pipelines.json --orders @orders.json --headless --steps 60";
    let (report, _) = small.run(&[more]);
    (small, report)
}

fn check(small: &Small, report: &Value, shapes: usize) {
    let reference = small.mesh("nozzle.msh");
    let throat = throat(&reference);
    assert!(throat.len() > 50);
    for order in report["orders"].as_array().expect("a list of orders") {
        assert_eq!(order["status"], "applied", "{report}");
    }
    assert_eq!(report["mesh"]["inverted"], 0);

    let mut heights = Vec::new();
    for cycle in 0..60 {
        let mesh = small.mesh(&format!("out/mesh-{cycle:06}.vtu"));
        let measured = quality(mesh.cells(), mesh.points());
        assert_eq!(measured.inverted, 0, "cycle {cycle}");
        assert!(measured.min > 0.0, "cycle {cycle}: {}", measured.min);
        let height =
            throat.iter().map(|&vertex| mesh.points()[vertex][2].abs()).fold(0.0, f64::max);
        if heights.last() != Some(&height) {
            heights.push(height);
        }
        if cycle == 44 {
            for &vertex in &throat {
                let (was, is) = (reference.points()[vertex], mesh.points()[vertex]);
                for axis in 0..3 {
                    let wanted = was[axis] * if axis == 2 { 0.5 } else { 1.0 };
                    assert!(
                        (is[axis] - wanted).abs() <= 1e-6 * 0.1,
                        "vertex {vertex}: {was:?} became {is:?}"
                    );
                }
            }
        }
    }
    // From open over the shapes of the schedule to half, and back in one step.
    assert_eq!(heights.len(), shapes + 2, "{heights:?}");
    for (shape, height) in heights[..=shapes].iter().enumerate() {
        let wanted = 0.05 * (1.0 - 0.5 * shape as f64 / shapes as f64);
        assert!((height - wanted).abs() < 1e-9, "shape {shape}: {heights:?}");
    }

    let undone = small.mesh("out/mesh-000059.vtu");
    for (vertex, (was, is)) in reference.points().iter().zip(undone.points()).enumerate() {
        assert_eq!(
            was.map(f64::to_bits),
            is.map(f64::to_bits),
            "vertex {vertex}: {was:?} came back as {is:?}"
        );
    }
}

fn order(at: Value, schedule: Value) -> Value {
    json!({"at": at, "order": {
        "edits": [{"scale_direction": {
            "features": ["throat"], "fixed": ["inlet", "outlet"], "factors": [1, 1, 0.5], "harmonic_order": 2}}],
        "schedule": schedule}})
}

#[test]
fn in_one_step_before_the_first() {
    let (small, report) = pinch(&order(json!({"cycle": 0}), json!({"steps": 1})));
    // The shape is there at the end of the first step already.
    assert_eq!(report["orders"][0]["cycle_applied"], 0, "{report}");
    check(&small, &report, 1);
}

#[test]
fn in_one_step_of_a_running_flow() {
    let (small, report) = pinch(&order(json!({"time": 0.02}), json!({"steps": 1})));
    assert_eq!(report["orders"][0]["cycle_applied"], 10, "{report}");
    check(&small, &report, 1);
}

#[test]
fn in_ten_steps_of_a_running_flow() {
    let (small, report) = pinch(&order(
        json!({"time": 0.02}),
        json!({"steps": 10, "every": {"steps": 3}, "motion": "at_once"}),
    ));
    check(&small, &report, 10);
}
