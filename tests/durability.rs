//! What was promised is on disk: on a full disk nothing is promised, and a run that is killed has
//! kept its word.

use std::process::Command;

use serde_json::{Value, json};
use tombolo_tests::{PATIENCE, Run, Small, Viewer, pinch, programs};

/// Bytes that a file of the run may have, in the blocks of the shell.
const BLOCKS: u64 = 400;
const LIMIT: u64 = BLOCKS << 10;

fn pipelines() -> Value {
    json!({"version": 1, "stream": {"listen": "127.0.0.1:0"}, "journal": "journal.jsonl", "pipelines": [
        {"name": "hold", "at": {"cycle": 3}, "stages": [{"pause": {}}]}]})
}

/// Lines of an earlier run, so many bytes of them.
fn earlier(bytes: u64) -> String {
    let line = "{\"end\":{\"cycle\":1,\"time\":0.1}}\n";
    line.repeat(usize::try_from(bytes).expect("a size") / line.len())
}

/// A run whose journal has little room left: the disk is full for every file of [`LIMIT`].
fn on_a_disk_that_is_nearly_full() -> (Small, Run) {
    let small = Small::new();
    small.write("pipelines.json", &pipelines());
    std::fs::create_dir_all(small.path("out")).expect("a folder");
    std::fs::write(small.path("out/journal.jsonl"), earlier(LIMIT - 2000)).expect("a journal");
    let arguments = small.arguments(&["--pipelines", "@pipelines.json", "--steps", "12"]);
    let script = format!("trap '' XFSZ; ulimit -S -f {BLOCKS}; exec \"$0\" \"$@\"");
    let flow = programs().join("flow");
    let mut shell = Command::new("bash");
    let run = Run::start(shell.args(["-c", &script]).arg(flow).args(arguments));
    (small, run)
}

/// Gives the files of a run another limit.
fn limit(run: &Run, bytes: &str) {
    let (process, size) = (run.process().to_string(), format!("--fsize={bytes}"));
    let status = Command::new("prlimit").args(["--pid", &process, &size]).status();
    assert!(status.is_ok_and(|status| status.success()));
}

/// An order for which that journal has no room.
fn long() -> Value {
    let mut long = pinch(0.9, 2, 1);
    long["edits"][0]["scale_direction"]["name"] = json!("x".repeat(190));
    let edit = long["edits"][0].clone();
    long["edits"] = json!(vec![edit; 20]);
    long
}

#[test]
fn the_report_of_a_run_says_that_its_journal_was_lost() {
    let (small, mut run) = on_a_disk_that_is_nearly_full();
    let mut driver = Viewer::connect(&run.link()).expect("the run lets in");
    driver.wait_for("hello", |hello| hello["role"] == "driver");
    driver.wait_for("status", |status| status["paused"] == true);
    driver.send(&json!({"id": "long", "order": long()}));
    driver.wait_for("error", |error| error["id"] == "long");
    // From now on not even a short line has room.
    limit(&run, "65536:");
    driver.resume();
    let (_, text) = run.finish(PATIENCE);
    let report = small.read("report.json");
    let lost = report["journal_lost"].as_str();
    assert!(lost.is_some_and(|why| why.contains("File too large")), "{report}\n{text}");
}

#[test]
fn on_a_full_disk_no_order_is_taken_and_the_run_goes_on() {
    let (small, mut run) = on_a_disk_that_is_nearly_full();
    let link = run.link();
    let mut driver = Viewer::connect(&link).expect("the run lets in");
    driver.wait_for("hello", |hello| hello["role"] == "driver");
    driver.wait_for("status", |status| status["paused"] == true);

    driver.send(&json!({"id": "long", "order": long()}));
    let refused = driver.wait_for("error", |error| error["id"] == "long");
    let message = refused["message"].as_str().expect("a message");
    assert!(message.contains("the journal cannot be written"), "{message}");
    driver.wait_for("status", |status| status["journal_lost"].is_string());
    let mut late = Viewer::connect(&link).expect("the run lets in");
    late.wait_for("status", |status| status["journal_lost"].is_string());
    driver.send(&json!({"id": "short", "order": pinch(0.9, 2, 1)}));
    driver.wait_for("error", |error| error["id"] == "short");

    // There is room again.
    limit(&run, "unlimited:");
    driver.wait_for("status", |status| status["journal_lost"].is_null());
    driver.send(&json!({"id": "again", "order": pinch(0.9, 2, 1)}));
    driver.wait_for("order", |order| {
        let reason = order["waits_for"].as_str().unwrap_or_default();
        order["id"] == "again" && reason.contains("paused")
    });
    driver.resume();
    let (status, text) = run.finish(PATIENCE);
    assert!(status.success(), "{text}");
    assert!(text.contains("cannot be written") && text.contains("is written again"), "{text}");
    let report = small.read("report.json");
    assert_eq!(report["orders"].as_array().map(Vec::len), Some(1), "{report}");
    let journal = String::from_utf8(small.bytes("out/journal.jsonl")).expect("UTF-8");
    assert!(journal.contains("\"id\":\"again\",\"status\":\"accepted\""), "{journal}");
    for id in ["long", "short"] {
        assert!(!journal.contains(&format!("\"id\":\"{id}\"")), "{id}");
    }
    for line in journal.lines() {
        serde_json::from_str::<Value>(line).expect("no line is torn");
    }
}

#[test]
fn a_run_that_is_killed_has_what_it_acknowledged_and_the_next_goes_on_below() {
    let small = Small::new();
    small.write("pipelines.json", &pipelines());
    let arguments = small.arguments(&["--pipelines", "@pipelines.json", "--steps", "12"]);
    for round in 0..3 {
        let mut run = Run::flow(&arguments);
        let mut driver = Viewer::connect(&run.link()).expect("the run lets in");
        driver.wait_for("hello", |hello| hello["role"] == "driver");
        let id = format!("round-{round}");
        driver.send(&json!({"id": id, "order": pinch(0.9, 2, 1)}));
        driver.wait_for("order", |order| order["id"] == id && order["status"] == "accepted");
        run.signal("KILL");
        drop(run);
        let journal = String::from_utf8(small.bytes("out/journal.jsonl")).expect("UTF-8");
        for earlier in 0..=round {
            let accepted = format!("\"id\":\"round-{earlier}\",\"status\":\"accepted\"");
            assert_eq!(journal.matches(&accepted).count(), 1, "{journal}");
        }
        assert_eq!(journal.matches("{\"run\":").count(), round + 1, "{journal}");
    }
}
