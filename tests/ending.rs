//! How a run ends when it is asked to, and when what it leaves behind cannot be written.

use std::fs;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tombolo_tests::{PATIENCE, Run, Small, Viewer};

/// A run that goes on until it is stopped; `change` adds to its configuration.
fn endless(change: impl FnOnce(&mut Value)) -> Small {
    let small = Small::new();
    let mut pipelines = json!({
        "version": 1, "stream": {"listen": "127.0.0.1:0"}, "journal": "journal.jsonl",
        "pipelines": [{"name": "surface", "every": {"steps": 1}, "stages": [{"surface": {}}, {"stream": {}}]}]
    });
    change(&mut pipelines);
    small.write("pipelines.json", &pipelines);
    small
}

/// What a run leaves behind that was asked to end: its report, its journal, and its last state.
fn ends(small: &Small, signal: &str, prepare: impl FnOnce(&mut Run) -> Option<Viewer>) -> Value {
    let mut run = Run::flow(&small.arguments(&["--pipelines", "@pipelines.json"]));
    let viewer = prepare(&mut run);
    let begun = Instant::now();
    run.signal(signal);
    let (status, text) = run.finish(PATIENCE);
    assert!(status.success(), "{text}");
    assert!(begun.elapsed() < Duration::from_secs(20), "it took {:?}", begun.elapsed());
    drop(viewer);
    assert!(small.bytes("out/final.vtu").len() > 1000);
    let journal = String::from_utf8(small.bytes("out/journal.jsonl")).expect("UTF-8");
    assert!(journal.lines().any(|line| line.contains("\"stop\"")), "{journal}");
    // Nothing comes behind the line that says so, and it is whole.
    let last = journal.lines().last().expect("a line");
    assert!(last.starts_with("{\"end\":") && journal.ends_with('\n'), "{journal}");
    serde_json::from_slice(&small.bytes("report.json")).expect("a report")
}

#[test]
fn a_signal_ends_a_run_with_all_that_it_leaves_behind() {
    let small = endless(|_| ());
    let report = ends(&small, "TERM", |run| {
        let mut viewer = Viewer::connect(&run.link()).expect("the run lets in");
        viewer.wait_for("status", |status| status["cycle"].as_u64().is_some_and(|cycle| cycle > 3));
        Some(viewer)
    });
    assert!(report["cycles"].as_u64().is_some_and(|cycles| cycles > 3), "{report}");
}

/// The shapes of an order are given up, and the run does not wait for them.
#[test]
fn a_signal_ends_a_run_whose_order_is_being_planned() {
    let small = endless(|_| ());
    let report = ends(&small, "TERM", |run| {
        let mut viewer = Viewer::connect(&run.link()).expect("the run lets in");
        viewer.wait_for("hello", |hello| hello["role"] == "driver");
        // So many edits and shapes take longer than it takes to send the signal.
        let edit = json!({"translate": {
            "features": ["throat"], "fixed": ["inlet", "outlet"], "by": [0, 0, 1e-6]}});
        let order = json!({"edits": vec![edit; 4000], "schedule": {"steps": 10_000}});
        viewer.send(&json!({"id": "long", "order": order}));
        viewer.wait_for("order", |order| order["id"] == "long" && order["status"] == "computing");
        Some(viewer)
    });
    let order = &report["orders"][0];
    assert_eq!((&order["id"], &order["status"]), (&json!("long"), &json!("rejected")), "{report}");
    assert!(order["reason"].as_str().is_some_and(|reason| reason.contains("given up")), "{report}");
    assert_eq!(report["mesh"]["inverted"], 0, "{report}");
}

#[test]
fn a_terminal_that_is_gone_ends_a_run_as_a_signal_does() {
    let small = endless(|_| ());
    let report = ends(&small, "HUP", |run| {
        run.link();
        None
    });
    assert!(report["error"].is_null(), "{report}");
    let left = fs::read_dir(small.path("out")).expect("the folder");
    let names: Vec<_> = left.map(|file| file.expect("a file").file_name()).collect();
    assert!(names.iter().all(|name| !name.to_string_lossy().ends_with(".link")), "{names:?}");
}

#[test]
fn a_signal_ends_a_run_that_is_paused() {
    let small = endless(|pipelines| {
        let hold = json!({"name": "hold", "at": {"cycle": 2}, "stages": [{"pause": {}}]});
        pipelines["pipelines"].as_array_mut().expect("a list").push(hold);
    });
    let report = ends(&small, "INT", |run| {
        let mut viewer = Viewer::connect(&run.link()).expect("the run lets in");
        viewer.wait_for("status", |status| status["paused"] == true);
        Some(viewer)
    });
    assert_eq!(report["cycles"], 2);
}

#[test]
fn a_signal_ends_a_run_that_waits_for_a_viewer() {
    let small = endless(|pipelines| pipelines["steering"] = json!({"wait_for_viewer": true}));
    let report = ends(&small, "TERM", |run| {
        run.link();
        std::thread::sleep(Duration::from_secs(1));
        None
    });
    assert_eq!(report["cycles"], 0);
}

#[test]
fn a_report_that_cannot_be_written_is_told_before_the_run() {
    let small = Small::new();
    let mut arguments = small.arguments(&["--headless", "--steps", "100000"]);
    let report = arguments.iter().position(|argument| argument == "--report").expect("a report");
    // A file where a folder should be.
    arguments[report + 1] = small.path("case.json/report.json").display().to_string();
    let (status, text) = Run::flow(&arguments).finish(PATIENCE);
    assert!(!status.success());
    assert!(text.contains("case.json/report.json"), "{text}");
}

#[test]
fn a_last_state_that_cannot_be_written_costs_no_report() {
    let small = Small::new();
    fs::create_dir_all(small.path("out/final.vtu")).expect("a folder in its place");
    let (status, text) =
        Run::flow(&small.arguments(&["--headless", "--steps", "3"])).finish(PATIENCE);
    assert!(!status.success(), "{text}");
    let report: Value = serde_json::from_slice(&small.bytes("report.json")).expect("a report");
    assert_eq!(report["cycles"], 3);
    assert!(report["error"].as_str().is_some_and(|error| error.contains("final.vtu")), "{report}");
}
