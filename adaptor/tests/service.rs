//! Many and large orders.

mod common;

use common::{LINK_TO_ALL, Solver, Viewer, config, squeeze};
use serde_json::{Value, json};
use tombolo::Settings;

/// Bytes of the commands of viewers that may wait.
const PENDING_BYTES: usize = 64 << 20;

fn has_status<'s>(id: &'s str, status: &'s str) -> impl Fn(&Value) -> bool + 's {
    move |order| order["id"] == id && order["status"] == status
}

/// An order that moves these vertices by next to nothing.
fn displacement(vertices: &[u32], seed: f64) -> Value {
    let by = |&vertex: &u32| [1e-9 * (f64::from(vertex) + seed).sin(), 0.0, 0.0];
    let values: Vec<_> = vertices.iter().map(by).collect();
    json!({"edits": [{"displacement": {"vertices": vertices, "values": values}}]})
}

/// A solver takes its commands in at once; those whose turn has not come count all the same.
#[test]
fn what_waits_is_limited_in_bytes_also_when_the_solver_has_taken_it() {
    let settings = Settings { config: config(LINK_TO_ALL), ..Settings::default() };
    let mut solver = Solver::of_box([24, 24, 24], settings);
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    solver.step();
    let mut long = squeeze(0.3);
    long["schedule"] = json!({"steps": 10_000});
    viewer.send(&json!({"id": "long", "order": long}));
    solver.step_until_told(&mut viewer, "order", has_status("long", "computing"));
    let text = displacement(&(0..300_000).collect::<Vec<_>>(), 0.0).to_string();
    let fit = PENDING_BYTES / text.len();
    assert!((2..8).contains(&fit), "{}", text.len());
    for index in 0..fit {
        viewer.send_text(&format!(r#"{{"id": "big-{index}", "order": {text}}}"#));
        let id = format!("big-{index}");
        // The solver has taken it: nothing is left in the queue that viewers fill.
        solver.step_until_told(&mut viewer, "order", has_status(&id, "accepted"));
        solver.steps(2);
    }
    viewer.send_text(&format!(r#"{{"id": "too-much", "order": {text}}}"#));
    let error = solver.step_until_told(&mut viewer, "error", |error| error["id"] == "too-much");
    assert!(error["message"].as_str().unwrap().contains("bytes that wait"), "{error}");
    // What must be heard is heard.
    for index in 0..fit {
        let id = format!("cancel-{index}");
        viewer.send(&json!({"id": id, "cancel": {"order": format!("big-{index}")}}));
        solver.step_until_told(&mut viewer, "done", |done| done["id"] == *id);
    }
    // There is room again, also under the name of before.
    viewer.send_text(&format!(r#"{{"id": "too-much", "order": {text}}}"#));
    solver.step_until_told(&mut viewer, "order", has_status("too-much", "accepted"));
    solver.finish();
}
