//! `flow` killed anywhere and restarted ends as if nothing had happened, to the bit.

use std::time::Duration;

use fastrand::Rng;
use serde_json::json;
use tombolo_tests::{PATIENCE, Run, Small, Viewer, pinch};

/// Orders that overlap, are refused and are undone, and one that a pipeline gives.
fn prepared() -> Small {
    let small = Small::new();
    small.write(
        "pipelines.json",
        &json!({"version": 1, "journal": "journal.jsonl", "pipelines": [
            {"name": "last", "at": {"cycle": 38}, "stages": [{"write": {"file": "last.vtu"}}]},
            {"name": "wide", "at": {"cycle": 21}, "stages": [{"scale_direction": {
                "features": ["throat"], "fixed": ["inlet", "outlet"], "factors": [1, 1.1, 1]}},
                {"order": {"schedule": {"steps": 2, "every": {"steps": 2}}}}]}]}),
    );
    small.write(
        "orders.json",
        &json!([
            {"at": {"cycle": 4}, "order": pinch(0.8, 4, 3)},
            {"at": {"cycle": 11}, "order": pinch(1.2, 5, 2)},
            {"at": {"cycle": 15}, "order": {"undo": 9}},
            {"at": {"cycle": 28}, "order": {"undo": 1, "schedule": {"steps": 3, "every": {"steps": 2}}}}
        ]),
    );
    small
}

fn arguments<'a>(more: &[&'a str]) -> Vec<&'a str> {
    let all = "--pipelines @pipelines.json --orders @orders.json --steps 40 --headless";
    [&[all], more].concat()
}

/// The mesh and the fields at the end, and the shape before it.
fn results(small: &Small) -> [Vec<u8>; 2] {
    [small.bytes("out/final.vtu"), small.bytes("out/last.vtu")]
}

#[test]
fn a_run_that_is_killed_and_restarted_ends_as_one_that_never_was() {
    let whole = prepared();
    whole.run(&arguments(&[]));
    let small = prepared();
    let state = small.path("out/flow.state");
    std::fs::create_dir_all(small.path("out")).expect("a folder");
    let mut random = Rng::with_seed(11);
    let mut killed = 0;
    loop {
        let before = std::fs::read(&state).ok();
        let mut more = vec!["--checkpoint-every", "3"];
        let restart = state.display().to_string();
        if before.is_some() {
            more.extend(["--restart", &restart]);
        }
        let mut run = Run::flow(&small.arguments(&arguments(&more)));
        // Each piece comes as far as to save its state, and somewhere beyond that.
        while killed < 5 && run.is_running() && std::fs::read(&state).ok() == before {
            std::thread::sleep(Duration::from_millis(1));
        }
        if killed == 0 && !run.is_running() {
            // It was quicker than the look at it.
            let (status, text) = run.finish(PATIENCE);
            assert!(status.success(), "{text}");
            std::fs::remove_dir_all(small.path("out")).expect("its files");
            std::fs::create_dir_all(small.path("out")).expect("a folder");
            continue;
        }
        if killed == 5 || !run.is_running() {
            let (status, text) = run.finish(PATIENCE);
            assert!(status.success(), "after {killed} kills: {text}");
            break;
        }
        std::thread::sleep(Duration::from_micros(random.u64(..20_000)));
        run.signal("KILL");
        drop(run);
        killed += 1;
    }
    assert!(results(&small) == results(&whole), "after {killed} kills it differs");
    let journal = String::from_utf8(small.bytes("out/journal.jsonl")).expect("UTF-8");
    assert!(journal.contains("\"checkpoint\""), "{journal}");
    // The journals of all its pieces are that of one run.
    let replay = prepared();
    let journal = small.path("out/journal.jsonl").display().to_string();
    let options = "--pipelines @pipelines.json --steps 40 --headless --replay";
    replay.run(&[options, &journal]);
    assert!(results(&replay) == results(&whole), "the replay differs");
}

/// An order that is on disk and whose shapes are being found when the run is stopped is carried out by
/// the run that goes on.
#[test]
fn an_order_that_is_being_planned_at_a_signal_is_not_lost() {
    let small = Small::new();
    small.write(
        "pipelines.json",
        &json!({"version": 1, "stream": {"listen": "127.0.0.1:0"}, "journal": "journal.jsonl"}),
    );
    let options = ["--pipelines", "@pipelines.json", "--checkpoint-every", "100000"];
    let mut run = Run::flow(&small.arguments(&options));
    let mut viewer = Viewer::connect(&run.link()).expect("the run lets in");
    viewer.wait_for("hello", |hello| hello["role"] == "driver");
    // So many edits and shapes take longer than it takes to send the signal.
    let edit = json!({"translate": {
        "features": ["throat"], "fixed": ["inlet", "outlet"], "by": [0, 0, 1e-6]}});
    let order = json!({"edits": vec![edit; 2000], "schedule": {"steps": 10_000}});
    viewer.send(&json!({"id": "long", "order": order}));
    viewer.wait_for("order", |order| order["id"] == "long" && order["status"] == "computing");
    run.signal("TERM");
    let (status, text) = run.finish(PATIENCE);
    assert!(status.success(), "{text}");
    let journal = String::from_utf8(small.bytes("out/journal.jsonl")).expect("UTF-8");
    assert!(!journal.contains("rejected"), "{journal:.2000}");
    let state = small.path("out/flow.state").display().to_string();
    let mut run = Run::flow(&small.arguments(&[&options[..], &["--restart", &state]].concat()));
    let mut viewer = Viewer::connect(&run.link()).expect("the run lets in");
    viewer.wait_for("order", |order| order["id"] == "long" && order["status"] == "applying");
    run.signal("TERM");
    let (status, text) = run.finish(PATIENCE);
    assert!(status.success(), "{text}");
}

#[test]
fn a_run_that_is_asked_to_stop_saves_its_state() {
    let whole = prepared();
    whole.run(&arguments(&[]));
    let small = prepared();
    small.write(
        "stop.json",
        &json!([{"at": {"cycle": 4}, "order": pinch(0.8, 4, 3)},
                {"at": {"cycle": 11}, "order": pinch(1.2, 5, 2)},
                {"at": {"cycle": 13}, "stop": {}}]),
    );
    let stopped = "--pipelines @pipelines.json --orders @stop.json --headless --steps 40 --checkpoint-every 1000";
    small.run(&[stopped]);
    let state = small.path("out/flow.state").display().to_string();
    // The rest of the orders: other commands take the place of those that were to come.
    small.write(
        "rest.json",
        &json!([{"at": {"cycle": 15}, "order": {"undo": 9}},
                {"at": {"cycle": 28}, "order": {"undo": 1, "schedule": {"steps": 3, "every": {"steps": 2}}}}]),
    );
    let rest = "--pipelines @pipelines.json --orders @rest.json --headless --steps 40 --restart";
    small.run(&[rest, &state]);
    assert!(results(&small) == results(&whole));
    let torn = small.path("torn");
    std::fs::write(&torn, &small.bytes("out/flow.state")[..1000]).expect("written");
    let torn = torn.display().to_string();
    let bad = ["--headless", "--steps", "40", "--restart", &torn];
    let (status, text) = Run::flow(&small.arguments(&bad)).finish(PATIENCE);
    assert!(!status.success() && text.contains("not the whole state"), "{text}");
}
