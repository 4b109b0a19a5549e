//! Recordings: made without anybody watching, read again, and gone through by viewers.

mod common;

use std::{collections::BTreeSet, path::Path, time::Duration};

use common::{Solver, Viewer, config, squeeze};
use serde_json::{Value, json};
use tokio_tungstenite::tungstenite::Message;
use tombolo::{
    Settings,
    client::{Client, Link, Options},
    deform::edit::Edit,
    pipelines::{encode::Decoder, language::StreamServer},
    play::Playback,
    recording::{Recorded, RecordedMessage, Recording},
};

const PIPELINES: &str = r#""pipelines": [
    {"name": "boundary", "every": {"steps": 1}, "stages": [{"surface": {}}, {"stream": {}}]},
    {"name": "middle", "every": {"steps": 3}, "stages": [
        {"slice": {"origin": [0.5, 0.5, 0.5], "normal": [0, 0, 1]}}, {"stream": {}}]},
    {"name": "health", "every": {"steps": 2}, "stages": [{"quality": {}}]}]"#;

/// A run of so many steps with an order at cycle 5.
fn record(output: &Path, more: &str, steps: u64) {
    let text = format!(r#"{{"version": 1, "record": "run.tombolo", {more}{PIPELINES}}}"#);
    let orders = json!([{"at": {"cycle": 5}, "order": squeeze(0.2)}]).to_string();
    let orders = tombolo::pipelines::language::parse_orders(&orders, "orders.json").unwrap();
    let settings =
        Settings { config: config(&text), output: output.into(), orders, ..Settings::default() };
    let mut solver = Solver::new(settings);
    for _ in 0..steps {
        solver.step();
        std::thread::sleep(Duration::from_millis(10));
    }
    solver.finish();
}

fn all(file: &Path) -> Vec<Recorded> {
    let mut recording = Recording::open(file).unwrap();
    assert_eq!(recording.lost_bytes(), 0);
    std::iter::from_fn(|| recording.read_next().unwrap()).collect()
}

fn texts(recorded: &[Recorded]) -> Vec<Value> {
    let text = |recorded: &Recorded| match &recorded.message {
        RecordedMessage::Text(text) => serde_json::from_str(text).ok(),
        RecordedMessage::Frame { .. } => None,
    };
    recorded.iter().filter_map(text).collect()
}

#[test]
fn a_run_is_recorded_without_a_viewer_and_without_a_server() {
    for more in ["", r#""stream": {"listen": "127.0.0.1:0"}, "#] {
        let output = tempfile::tempdir().unwrap();
        let file = output.path().join("run.tombolo");
        record(output.path(), more, 30);
        let recorded = all(&file);
        let told = texts(&recorded);
        let first = told[0].get("hello").expect("it begins with what viewers are greeted with");
        assert!(first.get("back").is_none() && first.get("client").is_none(), "{first}");
        assert!(told.iter().any(|it| it["order"]["status"] == "applied"));
        assert!(told.iter().any(|it| it["monitor"]["pipeline"] == "health"));
        assert_eq!(told.iter().filter(|it| it.get("end").is_some()).count(), 1, "{more}");
        assert_eq!(told.last().unwrap()["end"]["how"], "finished");
        let mut decoder = Decoder::new();
        let mut cycles = std::collections::BTreeMap::<String, Vec<u64>>::new();
        for recorded in &recorded {
            if let RecordedMessage::Frame { bytes, .. } = &recorded.message {
                let frame = decoder.decode(bytes).expect("every frame can be read");
                cycles.entry(frame.view).or_default().push(frame.cycle);
            }
        }
        assert!(cycles["boundary"].len() > 2 && cycles["middle"].len() > 1, "{cycles:?}");
        assert!(cycles.values().all(|cycles| cycles.is_sorted()));
        // The next run goes on below.
        let before = std::fs::read(&file).unwrap();
        std::fs::write(&file, [&before[..], b"half-writ"].concat()).unwrap();
        record(output.path(), more, 5);
        let both = std::fs::read(&file).unwrap();
        assert!(both.starts_with(&before) && all(&file).len() > recorded.len() + 5);
    }
}

#[test]
fn a_run_goes_on_below_a_recording_that_is_damaged_in_the_middle() {
    let output = tempfile::tempdir().unwrap();
    let file = output.path().join("run.tombolo");
    record(output.path(), "", 20);
    let mut damaged = std::fs::read(&file).unwrap();
    // The head of a message, 41 bytes before its text.
    let texts = damaged.windows(9).enumerate().filter(|(_, bytes)| bytes == b"{\"monitor");
    let at = texts.map(|(at, _)| at - 41).nth(2).expect("a third one");
    damaged[at] ^= 1;
    std::fs::write(&file, &damaged).unwrap();
    let before = Recording::open(&file).unwrap();
    record(output.path(), "", 5);
    assert!(std::fs::read(&file).unwrap().starts_with(&damaged), "nothing is cut off");
    let after = Recording::open(&file).unwrap();
    assert!(before.lost_bytes() > 41 && after.lost_bytes() == before.lost_bytes());
    assert!(after.last().seconds > before.last().seconds);
}

#[test]
fn a_recording_has_a_limit_and_the_run_goes_on() {
    let output = tempfile::tempdir().unwrap();
    let file = output.path().join("run.tombolo");
    let text =
        format!(r#"{{"version": 1, "record": "run.tombolo", "record_megabytes": 1, {PIPELINES}}}"#);
    let settings =
        Settings { config: config(&text), output: output.path().into(), ..Settings::default() };
    let mut solver = Solver::of_box([20, 20, 20], settings);
    solver.steps(60);
    let bytes = std::fs::metadata(&file).unwrap().len();
    solver.steps(60);
    solver.finish();
    let after = std::fs::metadata(&file).unwrap().len();
    assert!(after <= 1 << 20, "{bytes} and {after} bytes");
    all(&file);
}

/// The cycle and the moment of a picture of the boundary in the middle of those behind the order.
fn changed_picture(file: &Path) -> (u64, f64) {
    let (mut decoder, mut is_changed, mut shown) = (Decoder::new(), false, Vec::new());
    for recorded in all(file) {
        match &recorded.message {
            RecordedMessage::Frame { bytes, .. } => {
                let frame = decoder.decode(bytes).expect("every frame can be read");
                if is_changed && frame.view == "boundary" {
                    shown.push((frame.cycle, recorded.moment.seconds));
                }
            }
            RecordedMessage::Text(text) => is_changed |= text.starts_with("{\"stack\""),
        }
    }
    shown[shown.len() / 2]
}

#[test]
fn viewers_go_through_a_recording() {
    let output = tempfile::tempdir().unwrap();
    let file = output.path().join("run.tombolo");
    record(output.path(), "", 60);
    let last = Recording::open(&file).unwrap().last();
    let settings =
        StreamServer { listen: Some("127.0.0.1:0".parse().unwrap()), ..StreamServer::default() };
    let playback = Playback::start(&file, &settings).unwrap();
    let link: Link = playback.link().parse().unwrap();
    let client = Client::connect(&link, &Options::default()).unwrap();
    let squeezed: Vec<Edit> = serde_json::from_value(squeeze(0.2)["edits"].clone()).unwrap();
    assert_eq!(client.stack().unwrap(), squeezed);
    let url = playback.link().replacen("http://", "ws://", 1).replacen("/?", "/ws?", 1);
    let mut viewer = Viewer::try_connect(&url).unwrap();
    let hello = viewer.hello();
    assert_eq!((&hello["role"], &hello["may_drive"]), (&json!("watcher"), &json!(false)));
    assert_eq!(hello["recording"]["last"]["cycle"], last.cycle);
    assert_eq!(hello["stack"]["edits"], 0);
    // What would steer is refused.
    viewer.send(&json!({"id": "x", "order": squeeze(0.1)}));
    let error = viewer.wait_for("error", |error| error["id"] == "x");
    assert!(error["message"].as_str().unwrap().contains("recording"), "{error}");
    viewer.send(&json!({"id": "y", "play": {"speed": 0}}));
    viewer.wait_for("error", |error| error["id"] == "y");
    // An id that is no text is not told back: around it, what is told would be too deep to be read.
    let deep = format!("{}1{}", "[".repeat(126), "]".repeat(126));
    viewer.send_message(Message::text(format!(r#"{{"id": {deep}, "play": {{}}}}"#)));
    viewer.wait_for("error", |error| error["id"].is_null());
    // To its end, faster.
    viewer.send(&json!({"play": {"speed": 100}}));
    viewer.wait_for("play", |play| play["at_end"] == true);
    viewer.wait_for("order", |order| order["status"] == "applied");
    let changed = viewer.wait_for("stack", |stack| stack["edits"] == 1);
    let frames = viewer.decoded();
    assert!(frames.iter().any(|frame| frame.view == "boundary" && frame.cycle > 40));
    // Back: the picture is that of the moment, and stays while it is paused.
    let (cycle, seconds) = changed_picture(&file);
    viewer.seen.clear();
    viewer.send(&json!({"play": {"paused": true, "seek": {"seconds": seconds}}}));
    let hello = viewer.wait_for("hello", |_| true);
    assert!(hello["orders"].as_array().is_some_and(|orders| orders.len() == 1), "{hello}");
    // The same as when it went past.
    let stack = &hello["stack"];
    assert_eq!((&stack["revision"], &stack["edits"]), (&changed["revision"], &json!(1)));
    let play = viewer.wait_for("play", |play| play["paused"] == true);
    assert!((play["seconds"].as_f64().unwrap() - seconds).abs() < 1e-9, "{play}");
    let shown = viewer.decoded();
    let newest =
        shown.iter().filter(|frame| frame.view == "boundary").map(|frame| frame.cycle).max();
    let newest = newest.expect("the view is shown at once");
    assert_eq!(newest, cycle);
    viewer.look_for("nothing", Duration::from_millis(600), |_| true);
    assert!(viewer.decoded().is_empty());
    // At its beginning there is a picture too.
    viewer.send(&json!({"play": {"seek": {"seconds": 0}}}));
    viewer.wait_for("play", |play| play["seconds"].as_f64() < Some(seconds));
    let views: BTreeSet<String> = viewer.decoded().into_iter().map(|frame| frame.view).collect();
    assert!(views.contains("boundary"), "{views:?}");
    viewer.send(&json!({"play": {"seek": {"cycle": 0}, "paused": false, "speed": 100}}));
    viewer.wait_for("play", |play| play["at_end"] == true);
    // Who says much that is wrong is told no more of it than there is room for.
    (0..2000).for_each(|_| viewer.send_text("{}"));
    viewer.look_for("nothing", Duration::from_millis(600), |_| true);
    let errors = viewer.seen.iter().filter(|told| told.get("error").is_some()).count();
    assert!((1..1500).contains(&errors), "{errors} errors");
}

#[test]
fn runs_and_views_are_exported_to_files_of_their_own() {
    let output = tempfile::tempdir().unwrap();
    let text = r#"{"version": 1, "record": "run.tombolo", "pipelines": [
        {"name": "wall two", "stages": [{"surface": {}}, {"stream": {}}]},
        {"name": "wall_two", "stages": [{"surface": {}}, {"select": {"fields": []}}, {"stream": {}}]},
        {"name": "health", "stages": [{"quality": {}}]}]}"#;
    let mut cycles = Vec::new();
    for steps in [20, 12] {
        let settings =
            Settings { config: config(text), output: output.path().into(), ..Settings::default() };
        let mut solver = Solver::new(settings);
        for _ in 0..steps {
            solver.step();
            std::thread::sleep(Duration::from_millis(50));
        }
        solver.finish();
    }
    let (mut decoder, mut last) = (Decoder::new(), std::collections::BTreeMap::new());
    for recorded in all(&output.path().join("run.tombolo")) {
        if let RecordedMessage::Frame { bytes, .. } = &recorded.message {
            let frame = decoder.decode(bytes).unwrap();
            // One that was sent again is the same file.
            if last.insert(frame.view.clone(), frame.cycle) != Some(frame.cycle) {
                cycles.push((frame.view, frame.cycle));
            }
        }
    }
    let again = cycles.iter().filter(|it| cycles.iter().filter(|other| other == it).count() > 1);
    assert!(again.count() > 0, "both runs show the same cycle: {cycles:?}");
    let exported = std::process::Command::new(env!("CARGO_BIN_EXE_tombolo"))
        .args([
            "export",
            "run.tombolo",
            "--out",
            "out",
            "--vtk",
            "--csv",
            "--png",
            "--color-by",
            "speed",
        ])
        .current_dir(output.path())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&exported.stdout);
    assert!(exported.status.success(), "{said}{}", String::from_utf8_lossy(&exported.stderr));
    assert!(said.contains("wall_two: drawn without colours"), "{said}");
    // A view that there is not leaves no files, and the error says which there are.
    let wrong = std::process::Command::new(env!("CARGO_BIN_EXE_tombolo"))
        .args(["export", "run.tombolo", "--out", "wrong", "--view", "wall_tow"])
        .current_dir(output.path())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&wrong.stderr);
    assert_eq!(wrong.status.code(), Some(1), "{said}");
    assert!(said.contains("there is no view `wall_tow`") && said.contains("it has `"), "{said}");
    assert!(said.contains("did you mean `wall"), "{said}");
    assert_eq!(std::fs::read_dir(output.path().join("wrong")).unwrap().count(), 0);
    let out = output.path().join("out");
    let count = |ending: &str| {
        let entries = std::fs::read_dir(&out).unwrap();
        let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
        names.filter(|name| name.ends_with(ending)).count()
    };
    assert_eq!((count(".vtp"), count(".png")), (cycles.len(), cycles.len()));
    assert_eq!((count(".pvd"), count(".csv")), (4, 1));
    let mut entries = 0;
    for name in ["wall_two", "wall_two-2", "wall_two-run-2", "wall_two-run-2-2"] {
        let series = std::fs::read_to_string(out.join(format!("{name}.pvd"))).expect(name);
        entries += series.matches("<DataSet ").count();
    }
    assert_eq!(entries, cycles.len());
}
