//! Runs that nobody watches: their views rest, and what becomes of them is a stated policy.

mod common;

use std::{
    collections::BTreeSet,
    num::NonZeroU32,
    sync::Arc,
    thread::JoinHandle,
    time::{Duration, Instant},
};

use common::{LINK_TO_ALL, PATIENCE, Solver, Viewer, config};
use serde_json::{Value, json};
use tokio_tungstenite::tungstenite::Message;
use tombolo::{
    Settings, Step,
    communicator::{Communicator, threads},
    deform::{
        distributed::{Part, in_order},
        shapes::box_of_tets,
    },
    pipelines::{
        encode::Decoder,
        extract::{Channel, FieldView},
        language::{Unwatched, parse, parse_orders},
    },
    recording::{RecordedMessage, Recording},
};

/// Reads until a frame of a cycle comes.
fn see(viewer: &mut Viewer, cycle: u64) {
    let begun = Instant::now();
    while !viewer.decoded().iter().any(|frame| frame.cycle == cycle) {
        assert!(begun.elapsed() < PATIENCE, "no frame of cycle {cycle} came");
        viewer.look_for("nothing", Duration::from_millis(10), |_| true);
    }
}

/// How often the first pipeline ran, as a status says.
fn runs(status: &Value) -> u64 {
    status["pipelines"][0]["runs"].as_u64().unwrap_or(0)
}

#[test]
fn a_view_rests_while_nobody_watches_and_is_there_for_whoever_comes() {
    let mut solver = Solver::with_config(LINK_TO_ALL);
    solver.steps(400);
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    let rested = runs(&viewer.wait_for("status", |_| true));
    assert!((1..200).contains(&rested), "{rested} runs for nobody");
    // Without a step there is something to see, if not the newest.
    let begun = Instant::now();
    while viewer.frames.is_empty() {
        assert!(begun.elapsed() < PATIENCE, "there is nothing to see");
        viewer.look_for("nothing", Duration::from_millis(10), |_| true);
    }
    // The next step is seen, and each behind it.
    for cycle in 400..410 {
        solver.step();
        see(&mut viewer, cycle);
    }
    viewer.wait_for("status", |status| runs(status) == rested + 10);
    drop(viewer);
    std::thread::sleep(Duration::from_millis(300));
    solver.steps(400);
    let report = solver.finish();
    assert!(report.pipelines[0].runs < rested + 210, "{report:?}");
}

/// Reads until a frame of a cycle comes; all of it and of later ones are of one view.
fn see_of(viewer: &mut Viewer, view: &str, cycle: u64) {
    let begun = Instant::now();
    loop {
        let frames = viewer.decoded();
        let other = frames.iter().find(|frame| frame.view != view && frame.cycle >= cycle);
        let other = other.map(|frame| (&frame.view, frame.cycle));
        assert!(other.is_none(), "looking at {view}, {cycle}: {other:?}");
        if frames.iter().any(|frame| frame.cycle == cycle) {
            return;
        }
        assert!(begun.elapsed() < PATIENCE, "no frame of cycle {cycle} came");
        viewer.look_for("nothing", Duration::from_millis(10), |_| true);
    }
}

/// Chooses views, and returns once the run has heard it.
fn choose(viewer: &mut Viewer, views: &Value, name: &str) {
    viewer.send(&json!({"views": views}));
    viewer.send(&json!({"name": {"name": name}}));
    viewer.wait_for("people", |people| people.to_string().contains(name));
}

#[test]
fn a_view_at_which_nobody_looks_rests_and_is_not_sent() {
    let mut solver = Solver::with_config(
        r#"{"version": 1, "stream": {"listen": "127.0.0.1:0"}, "pipelines": [
            {"name": "boundary", "stages": [{"surface": {}}, {"stream": {}}]},
            {"name": "middle", "stages": [
                {"slice": {"origin": [0.5, 0.5, 0.5], "normal": [1, 0, 0]}}, {"stream": {}}]}]}"#,
    );
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    // Also one that there is not.
    choose(&mut viewer, &json!({"names": ["middle", "nothing"]}), "Anna");
    for cycle in 0..5 {
        solver.step();
        see_of(&mut viewer, "middle", cycle);
    }
    solver.steps(400);
    see_of(&mut viewer, "middle", 404);
    // One who looks at nothing wakes none.
    let mut other = Viewer::connect(&solver.adaptor);
    other.hello();
    choose(&mut other, &json!({"names": []}), "Zoe");
    other.decoded();
    choose(&mut viewer, &json!({"names": ["boundary"]}), "Berta");
    for cycle in 405..410 {
        solver.step();
        see_of(&mut viewer, "boundary", cycle);
    }
    choose(&mut viewer, &json!({}), "Clara");
    solver.step();
    let (begun, mut shown) = (Instant::now(), std::collections::BTreeSet::new());
    while shown.len() < 2 {
        assert!(begun.elapsed() < PATIENCE, "both views are chosen, and {shown:?} came");
        viewer.look_for("nothing", Duration::from_millis(10), |_| true);
        let newest = viewer.decoded().into_iter().filter(|frame| frame.cycle == 410);
        shown.extend(newest.map(|frame| frame.view));
    }
    other.look_for("nothing", Duration::from_millis(100), |_| true);
    assert!(other.decoded().is_empty());
    let runs = solver.finish().pipelines.into_iter().map(|pipeline| pipeline.runs);
    let [boundary, middle] = runs.collect::<Vec<_>>()[..] else { panic!("two pipelines") };
    assert!((6..200).contains(&boundary) && middle >= 406, "{boundary} and {middle} runs");
}

#[test]
fn a_recording_has_the_frames_though_nobody_watches() {
    let output = tempfile::tempdir().unwrap();
    let text = r#"{"version": 1, "record": "run.tombolo", "pipelines": [
        {"name": "boundary", "stages": [{"surface": {}}, {"stream": {}}]}]}"#;
    let settings =
        Settings { config: config(text), output: output.path().into(), ..Settings::default() };
    let mut solver = Solver::new(settings);
    solver.steps(50);
    let report = solver.finish();
    assert_eq!(report.pipelines[0].runs, 50);
    // A frame is in the recording, or it is counted as missing.
    let mut recording = Recording::open(output.path().join("run.tombolo")).unwrap();
    let (mut decoder, mut cycles) = (Decoder::new(), BTreeSet::new());
    while let Some(recorded) = recording.read_next().unwrap() {
        if let RecordedMessage::Frame { bytes, .. } = recorded.message {
            cycles.insert(decoder.decode(&bytes).unwrap().cycle);
        }
    }
    let missing = report.stream.unrecorded;
    assert!(cycles.len() as u64 + missing >= 50, "{cycles:?}, {missing}");
    assert_eq!(cycles.last(), Some(&49), "the last is not missing");
}

/// A solver that steps on a thread of its own until it is stopped.
fn goes_on(mut solver: Solver) -> JoinHandle<Solver> {
    std::thread::spawn(move || {
        solver.step_until("a stop", |solver| solver.stopped);
        solver
    })
}

/// Whoever comes to a run that was paused meanwhile sees the cycle in which it was.
#[test]
fn a_pause_that_nobody_saw_is_shown_as_it_is() {
    let orders = r#"[{"at": {"cycle": 300}, "pause": {}}]"#;
    let orders = parse_orders(orders, "orders.json").unwrap();
    let solver =
        Solver::new(Settings { config: config(LINK_TO_ALL), orders, ..Settings::default() });
    let url = common::socket_url(&solver.adaptor);
    let running = goes_on(solver);
    std::thread::sleep(Duration::from_secs(4));
    let mut viewer = Viewer::try_connect(&url).expect("connected");
    viewer.hello();
    let status = viewer.wait_for("status", |status| status["paused"] == true);
    assert_eq!(status["cycle"], 300);
    see(&mut viewer, 300);
    viewer.send(&json!({"stop": {}}));
    running.join().unwrap().finish();
}

fn second(policy: fn(NonZeroU32) -> Unwatched) -> Solver {
    let mut settings = Settings { config: config(LINK_TO_ALL), ..Settings::default() };
    settings.config.steering.unwatched = Some(policy(NonZeroU32::MIN));
    Solver::new(settings)
}

#[test]
fn a_run_that_nobody_watches_is_paused_where_that_is_wanted() {
    let solver = second(Unwatched::PauseAfter);
    let url = common::socket_url(&solver.adaptor);
    let running = goes_on(solver);
    for id in ["first", "second"] {
        std::thread::sleep(Duration::from_secs(4));
        let mut viewer = Viewer::try_connect(&url).expect("connected");
        viewer.hello();
        // It does not go on by itself for one who looks.
        viewer.wait_for("status", |status| status["paused"] == true);
        viewer.send(&json!({"id": id, "resume": {}}));
        viewer.wait_for("done", |done| done["id"] == id);
        viewer.wait_for("status", |status| status["paused"] == false);
        // As long as somebody watches, it goes on.
        let begun = Instant::now();
        while begun.elapsed() < Duration::from_secs(4) {
            viewer.seen.clear();
            let status = viewer.wait_for("status", |_| true);
            assert_eq!(status["paused"], false, "{status}");
        }
        // The wheel is not kept for one that has closed.
        viewer.send_message(Message::Close(None));
        viewer.closed();
    }
    std::thread::sleep(Duration::from_secs(4));
    let mut viewer = Viewer::try_connect(&url).expect("connected");
    viewer.hello();
    viewer.wait_for("status", |status| status["paused"] == true);
    viewer.send(&json!({"stop": {}}));
    running.join().unwrap().finish();
}

#[test]
fn a_run_that_nobody_watches_is_stopped_where_that_is_wanted() {
    // Nobody ever comes.
    let begun = Instant::now();
    goes_on(second(Unwatched::StopAfter)).join().unwrap().finish();
    assert!(begun.elapsed() > Duration::from_millis(900));
    // The driver pauses it, and leaves.
    let mut solver = second(Unwatched::StopAfter);
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    solver.step();
    let running = goes_on(solver);
    viewer.send(&json!({"pause": {}}));
    viewer.wait_for("status", |status| status["paused"] == true);
    std::thread::sleep(Duration::from_secs(4));
    assert!(!running.is_finished(), "somebody watches");
    drop(viewer);
    running.join().unwrap().finish();
}

/// A pipeline that is due in the call in which the run is paused gives its command.
#[test]
fn what_a_pipeline_commands_while_the_run_pauses_is_not_lost() {
    let late = json!({"name": "late", "at": {"cycle": 2}, "stages": [{"stop": {}}]});
    let orders = json!([
        {"at": {"cycle": 5}, "pipelines": {"set": [late]}},
        {"at": {"cycle": 5}, "pause": {}},
    ]);
    let orders = parse_orders(&orders.to_string(), "orders.json").expect("orders");
    let settings = Settings { config: config(LINK_TO_ALL), orders, ..Settings::default() };
    // It would stay paused for ever.
    let running = goes_on(Solver::new(settings));
    let begun = Instant::now();
    while !running.is_finished() {
        assert!(begun.elapsed() < Duration::from_secs(60), "the stop was lost");
        std::thread::sleep(Duration::from_millis(10));
    }
    running.join().unwrap().finish();
}

/// A replay is carried out to its end, whoever watches.
#[test]
fn a_replay_is_not_stopped_because_nobody_watches() {
    let mut settings = Settings { config: config(LINK_TO_ALL), ..Settings::default() };
    settings.config.steering.unwatched = Some(Unwatched::StopAfter(NonZeroU32::MIN));
    settings.replay = Some(Default::default());
    let mut solver = Solver::new(settings);
    let begun = Instant::now();
    while begun.elapsed() < Duration::from_secs(4) {
        solver.step();
    }
    assert!(!solver.stopped);
    solver.finish();
}

#[test]
fn what_becomes_of_a_run_that_nobody_watches_is_said_in_its_configuration() {
    let steering = |text: &str| {
        let text = LINK_TO_ALL.replacen('{', &format!("{{\"steering\": {text}, "), 1);
        parse(&text, "test.json").map(|config| config.steering.unwatched)
    };
    let seconds = NonZeroU32::new(600).unwrap();
    let found = steering(r#"{"unwatched": {"pause_after": 600}}"#).unwrap();
    assert_eq!(found, Some(Unwatched::PauseAfter(seconds)));
    let found = steering(r#"{"unwatched": {"stop_after": 600}, "resume_after": 5}"#).unwrap();
    assert_eq!(found, Some(Unwatched::StopAfter(seconds)));
    assert_eq!(steering("{}").unwrap(), None);
    let both = steering(r#"{"unwatched": {"pause_after": 600}, "resume_after": 5}"#);
    let both = both.unwrap_err().to_string();
    assert!(both.contains("steering.unwatched.pause_after: found `resume_after` too"), "{both}");
    let alone = r#"{"version": 1, "steering": {"unwatched": {"stop_after": 5}}}"#;
    let alone = parse(alone, "alone.json").unwrap_err().to_string();
    assert!(alone.contains("steering.unwatched: there is no `stream`"), "{alone}");
}

/// All ranks take a view, or none does, whenever viewers come and go.
#[test]
fn views_rest_on_all_ranks_alike() {
    const RANKS: usize = 3;
    let mesh = box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]);
    let runs = threads::run(RANKS, |ranks| {
        let rank = ranks.rank();
        let of_cells = in_order(mesh.cells().len(), RANKS);
        let part = Part::cut(&mesh, &of_cells, rank, true).expect("a part");
        let settings = Settings { config: config(LINK_TO_ALL), ..Settings::default() };
        let mut adaptor = settings.on(Arc::new(ranks)).start().expect("initialize");
        let speed: Vec<f64> = part.points.iter().map(|[x, y, z]| x + y * z).collect();
        let fields = [FieldView::vertex("speed", &speed)];
        let channels = [Channel { name: "fluid", mesh: part.view(), fields: &fields }];
        let mut viewer = None::<Viewer>;
        for cycle in 0..300 {
            if rank == 0 && cycle % 100 == 50 {
                let viewer = viewer.insert(Viewer::connect(&adaptor));
                viewer.hello();
            }
            let step = Step { cycle, time: cycle as f64 * 0.01, time_step: 0.01 };
            // A solver that asks first is told before a step whether it is looked at.
            let asks = cycle >= 200;
            let looks = asks && adaptor.looks_at(&step);
            adaptor.execute(&step, &channels).expect("execute");
            let first = if asks { 51 } else { 50 };
            if rank == 0 && (first..60).contains(&(cycle % 100)) {
                assert!(looks || !asks, "cycle {cycle}");
                see(viewer.as_mut().expect("a viewer"), cycle);
            }
            if rank == 0 && cycle % 100 == 60 {
                viewer = None;
                std::thread::sleep(Duration::from_millis(300));
            }
        }
        adaptor.finalize().expect("finalize").pipelines[0].runs
    });
    assert!(runs.iter().all(|of_rank| *of_rank == runs[0]), "{runs:?}");
    assert!((30..250).contains(&runs[0]), "{runs:?}");
}
