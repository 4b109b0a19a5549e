//! The memory of a long run: bounded by what is there, never by how long it has lasted.
#![cfg(target_os = "linux")]

mod common;

use common::{LINK_TO_ALL, Solver, Viewer, config, squeeze};
use serde_json::json;
use tombolo::Settings;

/// Steps, of which `TOMBOLO_STEPS` makes more: a million take some twenty seconds.
const STEPS: u64 = 100_000;
/// Steps after which a viewer comes, and after which it goes again.
const COMES: u64 = 200;
const STAYS: u64 = 60;
/// Bytes by which the memory may differ between the first quarter and the end.
const SPREAD: u64 = 24 << 20;

/// Mebibytes that the recording may have.
const RECORDED: u64 = 8;
/// Bytes of the journal for each order: what was asked for, its outcome and its shapes.
const JOURNALED: u64 = 4 << 10;

fn resident() -> u64 {
    let statm = std::fs::read_to_string("/proc/self/statm").expect("Linux says");
    let pages: u64 = statm.split_whitespace().nth(1).expect("a number").parse().expect("a number");
    4096 * pages
}

#[test]
fn memory_is_flat_while_a_viewer_comes_and_goes() {
    let steps = std::env::var("TOMBOLO_STEPS").ok().and_then(|text| text.parse().ok());
    let steps: u64 = steps.unwrap_or(STEPS);
    let output = tempfile::tempdir().expect("a folder");
    let kept = r#"{"journal": "journal.jsonl", "record": "run.tombolo", "record_megabytes": 8,"#;
    let config = config(&LINK_TO_ALL.replacen('{', kept, 1));
    let mut solver =
        Solver::new(Settings { config, output: output.path().into(), ..Settings::default() });
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
    let bytes = |file: &str| std::fs::metadata(output.path().join(file)).expect("written").len();
    // The journal grows with what was asked for, and not with viewers that only come and go.
    let journal = bytes("journal.jsonl");
    assert!(journal < (1 << 20) + JOURNALED * orders, "{journal} bytes for {orders} orders");
    let recorded = bytes("run.tombolo");
    assert!(recorded <= RECORDED << 20, "{recorded} bytes");
}
