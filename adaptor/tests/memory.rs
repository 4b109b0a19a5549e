//! The memory of a long run: bounded by what is there, never by how long it has lasted.
#![cfg(target_os = "linux")]

mod common;

use common::{LINK_TO_ALL, Solver, Viewer, squeeze};
use serde_json::json;

/// Steps, of which `TOMBOLO_STEPS` makes more: a million take some minutes.
const STEPS: u64 = 20_000;
/// Steps after which a viewer comes, and after which it goes again.
const COMES: u64 = 200;
const STAYS: u64 = 60;
/// Bytes by which the memory may differ between the first quarter and the end.
const SPREAD: u64 = 24 << 20;

fn resident() -> u64 {
    let statm = std::fs::read_to_string("/proc/self/statm").expect("Linux says");
    let pages: u64 = statm.split_whitespace().nth(1).expect("a number").parse().expect("a number");
    4096 * pages
}

#[test]
fn memory_is_flat_while_a_viewer_comes_and_goes() {
    let steps = std::env::var("TOMBOLO_STEPS").ok().and_then(|text| text.parse().ok());
    let steps: u64 = steps.unwrap_or(STEPS);
    let mut solver = Solver::with_config(LINK_TO_ALL);
    let mut viewer: Option<Viewer> = None;
    let mut settled = 0;
    let mut orders = 0;
    for step in 0..steps {
        solver.step();
        match step % COMES {
            0 => {
                let mut new = Viewer::connect(&solver.adaptor);
                new.hello();
                viewer = Some(new);
            }
            20 => {
                // The wheel is kept for a driver that has just left: what is not taken is refused.
                orders += 1;
                let order = if orders % 2 == 0 { json!({"undo": 1}) } else { squeeze(0.01) };
                viewer.iter_mut().for_each(|viewer| viewer.send(&json!({"order": order})));
            }
            STAYS => viewer = None,
            _ => {}
        }
        if step == steps / 4 {
            settled = resident();
        }
    }
    let grown = resident().saturating_sub(settled);
    assert!(grown < SPREAD, "{grown} bytes more after {steps} steps than after a quarter of them");
    solver.finish();
}
