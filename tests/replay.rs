//! The same orders give the same bits, whoever watches and however often.

use std::time::Duration;

use serde_json::{Value, json};
use tombolo_tests::{PATIENCE, Run, Small, Viewer, pinch};

fn pipelines(hold: bool) -> Value {
    let mut list = vec![
        json!({"name": "surface", "every": {"steps": 1}, "stages": [{"surface": {}}, {"stream": {}}]}),
        json!({"name": "middle", "every": {"steps": 2},
               "stages": [{"slice": {"origin": [0, 0, 0], "normal": [1, 0, 0]}}, {"stream": {}}]}),
        json!({"name": "last", "at": {"cycle": 38}, "stages": [{"write": {"file": "last.vtu"}}]}),
    ];
    if hold {
        list.push(json!({"name": "hold", "at": {"cycle": 3}, "stages": [{"pause": {}}]}));
    }
    json!({"version": 1, "stream": {"listen": "127.0.0.1:0"}, "journal": "journal.jsonl", "pipelines": list})
}

/// Whether an order is planned and begins once the run is paused no more.
fn waits_for_resume(order: &Value, id: &Value) -> bool {
    let reason = order["waits_for"].as_str().unwrap_or_default();
    order["id"] == *id && reason.contains("paused")
}

fn last(small: &Small) -> Vec<u8> {
    small.bytes("out/last.vtu")
}

/// An unsteady run with an order from a file; with viewers that read everything, or with none.
fn watched(viewers: usize) -> Vec<u8> {
    let small = Small::new();
    small.write("pipelines.json", &pipelines(viewers > 0));
    small.write("orders.json", &json!([{"at": {"cycle": 5}, "order": pinch(0.8, 4, 2)}]));
    let mut more = vec!["--pipelines @pipelines.json --orders @orders.json --steps 40"];
    if viewers == 0 {
        more.push("--headless");
    }
    let mut run = Run::flow(&small.arguments(&more));
    if viewers > 0 {
        let link = run.link();
        let mut all: Vec<Viewer> =
            (0..viewers).map(|_| Viewer::connect(&link).expect("the run lets in")).collect();
        all[0].wait_for("hello", |hello| hello["role"] == "driver");
        assert!(all[0].frame().starts_with(b"TMBL"));
        all[0].resume();
        while all[0].next(Duration::from_secs(5)).is_some() {}
    }
    let (status, text) = run.finish(PATIENCE);
    assert!(status.success(), "{text}");
    assert_eq!(small.read("report.json")["orders"][0]["status"], "applied");
    last(&small)
}

#[test]
fn who_watches_makes_no_difference() {
    let alone = watched(0);
    assert!(watched(0) == alone, "two runs alike differ");
    assert!(watched(2) == alone, "a run with viewers differs");
}

#[test]
fn a_journal_plays_back_to_the_same_bits() {
    let live = Small::new();
    live.write("pipelines.json", &pipelines(true));
    let mut run = Run::flow(&live.arguments(&["--pipelines @pipelines.json --steps 40"]));
    let mut driver = Viewer::connect(&run.link()).expect("the run lets in");
    driver.wait_for("hello", |hello| hello["role"] == "driver");
    driver.wait_for("status", |status| status["paused"] == true);
    driver.send(&json!({"id": "first", "order": pinch(0.8, 4, 2)}));
    // What is planned before the run goes on is carried out before it ends.
    driver.wait_for("order", |order| waits_for_resume(order, &order["id"]));
    driver.resume();
    let (status, text) = run.finish(PATIENCE);
    assert!(status.success(), "{text}");
    let report = live.read("report.json");
    assert_eq!(report["orders"][0]["status"], "applied", "{report}");

    let again = Small::new();
    again.write("pipelines.json", &pipelines(false));
    std::fs::copy(live.path("out/journal.jsonl"), again.path("orders.jsonl"))
        .expect("the run wrote its journal");
    let (replayed, _) =
        again.run(&["--pipelines @pipelines.json --orders @orders.jsonl --headless --steps 40"]);
    assert_eq!(
        replayed["orders"][0]["cycle_applied"], report["orders"][0]["cycle_applied"],
        "{replayed}"
    );
    assert!(last(&again) == last(&live), "the journal gives another flow");
}

#[test]
fn a_journal_is_carried_out_again_to_the_bit_where_orders_overlap() {
    let live = Small::new();
    let mut held = pipelines(true);
    let again_held = json!({"name": "again", "at": {"cycle": 9}, "stages": [{"pause": {}}]});
    held["pipelines"].as_array_mut().expect("a list").push(again_held);
    live.write("pipelines.json", &held);
    let mut run = Run::flow(&live.arguments(&["--pipelines @pipelines.json --steps 40"]));
    let mut driver = Viewer::connect(&run.link()).expect("the run lets in");
    driver.wait_for("hello", |hello| hello["role"] == "driver");
    let mut order = pinch(0.9, 4, 2);
    order["schedule"] = json!({"steps": 12, "every": {"steps": 2}});
    driver.wait_for("status", |status| status["paused"] == true);
    driver.send(&json!({"id": "first", "order": order}));
    driver.wait_for("order", |order| waits_for_resume(order, &json!("first")));
    driver.resume();
    // The second comes while the mesh is on its way to the first, the third is never carried out.
    driver.wait_for("status", |status| status["cycle"] == 9 && status["paused"] == true);
    driver.send(&json!({"id": "second", "order": pinch(0.8, 4, 2)}));
    driver.wait_for("order", |order| waits_for_resume(order, &json!("second")));
    driver.send(&json!({"id": "third", "order": pinch(0.95, 4, 2)}));
    driver.send(&json!({"id": "not", "cancel": {"order": "third"}}));
    driver.resume();
    let (status, text) = run.finish(PATIENCE);
    assert!(status.success(), "{text}");

    let again = Small::new();
    again.write("pipelines.json", &pipelines(false));
    std::fs::copy(live.path("out/journal.jsonl"), again.path("run.jsonl")).expect("a journal");
    again.run(&["--pipelines @pipelines.json --replay @run.jsonl --headless --steps 40"]);
    assert!(last(&again) == last(&live), "the journal gives another flow");
    let shapes = |of: &Small| -> Vec<String> {
        let journal = String::from_utf8(of.bytes("out/journal.jsonl")).expect("UTF-8");
        journal.lines().filter(|line| line.starts_with("{\"shape\"")).map(str::to_owned).collect()
    };
    let of_first = |line: &&String| line.contains("\"first\"");
    let overlapped = shapes(&live).iter().filter(of_first).count();
    assert!((1..12).contains(&overlapped), "{:?}", shapes(&live));
    assert_eq!(shapes(&again), shapes(&live));
}
