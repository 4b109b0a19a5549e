//! Runs that are carried out again from their journals: to the bit, whatever came between.

mod common;

use std::{path::Path, time::Duration};

use common::{Solver, Viewer, bits, config, squeeze};
use fastrand::Rng;
use serde_json::{Value, json};
use tokio_tungstenite::tungstenite::Message;
use tombolo::{
    OrderReport, OrderStatus, Settings,
    pipelines::language::{parse_journal, parse_orders},
};

/// A pipeline gives orders too, and viewers look on.
const CONFIGURATION: &str = r#"{"version": 1, "stream": {"listen": "127.0.0.1:0"}, "journal": "journal.jsonl", "pipelines": [
    {"name": "shape", "on": "order", "stages": [{"schedule": {"steps": 3, "every": {"steps": 2}}}]},
    {"name": "breathe", "every": {"steps": 17}, "stages": [
        {"translate": {"features": ["x-max"], "fixed": ["x-min"], "by": [0.01, 0.0, 0.0]}},
        {"order": {"schedule": {"steps": 2, "every": {"steps": 3}}}}]}]}"#;

fn settings(output: &Path) -> Settings {
    let settings =
        Settings { config: config(CONFIGURATION), output: output.into(), ..Settings::default() };
    settings.parameter("heating", 1.0, 0.0..=2.0)
}

/// The mesh and the parameters after each cycle.
type Trace = Vec<(Vec<[u64; 3]>, usize)>;

fn step(solver: &mut Solver, trace: &mut Trace) {
    solver.step();
    trace.push((bits(&solver.mesh), solver.parameters.len()));
}

fn random_message(random: &mut Rng, sent: u64) -> Value {
    let amount = 0.05 + 0.01 * random.u64(..25) as f64;
    let schedule = json!({"steps": 1 + random.u64(..5), "every": {"steps": 1 + random.u64(..4)}});
    let id = format!("m{sent}");
    match random.u64(..14) {
        0 => json!({"id": id, "order": {"undo": 1 + random.u64(..2), "schedule": schedule}}),
        1 => json!({"id": id, "order": {"stack": squeeze(amount)["edits"], "schedule": schedule}}),
        2 => json!({"id": id, "cancel": {"order": format!("m{}", random.u64(..sent + 1))}}),
        3 => json!({"id": id, "order": {"edits": [
            {"translate": {"features": ["nowhere"], "by": [1.0, 0.0, 0.0]}}]}}),
        // More than the guard lets through: clamped to what it does.
        4 => json!({"id": id, "order": {"edits": squeeze(1.5)["edits"], "schedule": schedule,
                    "guard": {"otherwise": "clamp"}}}),
        5 => json!({"id": id, "parameter": {"name": "heating", "value": amount}}),
        6 => json!({"id": id, "pipelines": {"set": [{"name": "shape", "on": "order",
                    "stages": [{"schedule": schedule}]}]}}),
        7 => json!({"id": id, "pause": {}}),
        8 => json!({"id": id, "order": squeeze(amount)}),
        9 | 10 => {
            json!({"id": id, "order": {"edits": squeeze(amount)["edits"], "schedule": schedule,
                         "replaces": format!("m{}", random.u64(..sent + 1))}})
        }
        _ => json!({"id": id, "order": {"edits": squeeze(amount)["edits"], "schedule": schedule}}),
    }
}

/// A run that a viewer steers at random. Returns what the solver saw, the journal at its end, and
/// the orders that were acknowledged.
fn random_run(seed: u64, output: &Path) -> (Trace, String, Vec<String>) {
    let mut random = Rng::with_seed(seed);
    let mut solver = Solver::new(settings(output));
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    let mut trace = Trace::new();
    let mut sent = 0;
    for _ in 0..20 + random.u64(..60) {
        if random.u64(..4) == 0 {
            let message = random_message(&mut random, sent);
            let pauses = message.get("pause").is_some();
            viewer.send(&message);
            if pauses {
                viewer.send(&json!({"id": format!("r{sent}"), "resume": {}}));
            }
            sent += 1;
            if random.u64(..2) == 0 {
                // Sometimes what was sent has come in before the next step, and sometimes not.
                viewer.look_for("order", Duration::from_millis(5), |_| false);
            }
        }
        step(&mut solver, &mut trace);
        std::thread::sleep(Duration::from_micros(random.u64(..3000)));
    }
    while viewer.look_for("nothing", Duration::from_millis(1), |_| true).is_some() {}
    let accepted = |message: &Value| {
        let order = message.get("order")?;
        (order["status"] == "accepted").then(|| order["id"].as_str().unwrap().to_owned())
    };
    let acknowledged = viewer.seen.iter().filter_map(accepted).collect();
    solver.finish();
    let journal = std::fs::read_to_string(output.join("journal.jsonl")).unwrap();
    (trace, journal, acknowledged)
}

/// The run that a journal tells of, for so many cycles.
fn replay(journal: &str, cycles: usize) -> Trace {
    let output = tempfile::tempdir().unwrap();
    let replay = Some(parse_journal(journal, "journal.jsonl").unwrap());
    let mut solver = Solver::new(Settings { replay, ..settings(output.path()) });
    let mut trace = Trace::new();
    (0..cycles).for_each(|_| step(&mut solver, &mut trace));
    solver.finish();
    trace
}

/// The cycle of the last whole line that names one.
fn last_cycle(journal: &str) -> usize {
    let whole = journal.rsplit_once('\n').map_or("", |(whole, _)| whole);
    let cycle = |line: &str| {
        let line: Value = serde_json::from_str(line).ok()?;
        line["cycle"].as_u64().or(line["shape"]["cycle"].as_u64())
    };
    let cycle = whole.lines().rev().find_map(cycle).unwrap_or(0);
    usize::try_from(cycle).unwrap()
}

#[test]
fn random_runs_replay_to_the_bit_wherever_their_journals_end() {
    let seeds = std::env::var("TOMBOLO_SEEDS").ok().and_then(|text| text.parse().ok());
    let mut moved = 0;
    for seed in 0..seeds.unwrap_or(12) {
        let output = tempfile::tempdir().unwrap();
        let (trace, journal, acknowledged) = random_run(seed, output.path());
        for id in &acknowledged {
            let accepted = format!("{{\"id\":\"{id}\",\"status\":\"accepted\"");
            assert_eq!(journal.matches(&accepted).count(), 1, "seed {seed}: {id} in {journal}");
        }
        let again = replay(&journal, trace.len());
        if let Some(cycle) = (0..trace.len()).find(|&cycle| trace[cycle] != again[cycle]) {
            panic!("seed {seed}: the replay differs at cycle {cycle}:\n{journal}");
        }
        moved += trace.windows(2).filter(|pair| pair[0] != pair[1]).count();
        // What the disk had when the machine lost its power: any beginning of the journal.
        let mut random = Rng::with_seed(seed ^ 0x0dd);
        for _ in 0..3 {
            let end = random.u64(..journal.len() as u64 + 1) as usize;
            let torn = &journal[..journal.floor_char_boundary(end)];
            let cycles = last_cycle(torn);
            let again = replay(torn, cycles);
            assert!(trace[..cycles] == again[..], "seed {seed}, {end} bytes:\n{torn}");
        }
    }
    assert!(moved > 50, "only {moved} shapes were handed out");
}

#[test]
fn what_waits_at_the_end_is_not_carried_out_again() {
    let output = tempfile::tempdir().unwrap();
    let mut solver = Solver::new(settings(output.path()));
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    let mut trace = Trace::new();
    step(&mut solver, &mut trace);
    viewer.send(&json!({"id": "a", "order": squeeze(0.2)}));
    let is_applied = |order: &Value| order["id"] == "a" && order["status"] == "applied";
    solver.step_until_told(&mut viewer, "order", is_applied);
    viewer.send(&json!({"id": "b", "order": squeeze(0.1)}));
    viewer.wait_for("order", |order| order["id"] == "b" && order["status"] == "accepted");
    let (cycles, mesh) = (solver.cycle, bits(&solver.mesh));
    let report = solver.finish();
    let waiting = report.orders.iter().find(|order| order.id == "b").unwrap();
    assert_eq!(waiting.status, OrderStatus::Rejected, "{waiting:?}");
    assert_eq!(report.journal_lost, None);
    let journal = std::fs::read_to_string(output.path().join("journal.jsonl")).unwrap();
    let again = replay(&journal, usize::try_from(cycles).unwrap() + 10);
    assert!(again.last().unwrap().0 == mesh, "{journal}");
}

/// Orders that come in while the run ends are the last that the server takes.
#[test]
fn what_is_accepted_while_a_run_ends_has_an_outcome() {
    for _ in 0..10 {
        let output = tempfile::tempdir().unwrap();
        let mut solver = Solver::new(settings(output.path()));
        let mut viewer = Viewer::connect(&solver.adaptor);
        viewer.hello();
        solver.step();
        let sending = std::thread::spawn(move || {
            for sent in 0..35 {
                let message = json!({"id": format!("m{sent}"), "order": squeeze(0.01)});
                viewer.send_unwelcome(Message::text(message.to_string()));
                std::thread::sleep(Duration::from_micros(200));
            }
        });
        let orders = solver.finish().orders;
        sending.join().unwrap();
        let is_open = |order: &&OrderReport| order.status == OrderStatus::Accepted;
        assert_eq!(orders.iter().find(is_open), None);
        let journal = std::fs::read_to_string(output.path().join("journal.jsonl")).unwrap();
        for order in orders.iter().filter(|order| order.id.starts_with('m')) {
            let rejected = format!("{{\"id\":\"{}\",\"status\":\"rejected\"", order.id);
            assert_eq!(journal.matches(&rejected).count(), 1, "{order:?} in {journal}");
        }
        assert!(journal.lines().last().unwrap().starts_with("{\"end\":"), "{journal}");
    }
}

#[test]
fn an_order_that_replaces_another_has_its_place_and_a_replay_says_the_same() {
    let output = tempfile::tempdir().unwrap();
    let mut solver = Solver::new(settings(output.path()));
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    let mut trace = Trace::new();
    let order = |id: &str, by: f64, replaces: Option<&str>| {
        let mut message = json!({"id": id, "order": squeeze(by)});
        if let Some(other) = replaces {
            message["order"]["replaces"] = other.into();
        }
        message
    };
    // The first moves the mesh for long; the others wait behind it.
    let mut first = order("first", 0.1, None);
    first["order"]["schedule"] = json!({"steps": 40, "every": {"steps": 10}});
    viewer.send(&first);
    let moves = |order: &Value| order["id"] == "first" && order["status"] == "applying";
    // A busy machine may tell late that it moves.
    while viewer.look_for("order", Duration::from_millis(20), moves).is_none() {
        step(&mut solver, &mut trace);
    }
    viewer.send(&order("second", 0.2, None));
    viewer.send(&order("third", 0.01, None));
    for id in ["second", "third"] {
        viewer.wait_for("order", |order| order["id"] == id && order["status"] == "accepted");
    }
    // No step between them: a busy machine may have found the shapes of the second by then.
    viewer.send(&order("better", 0.05, Some("second")));
    viewer.send(&order("late", 0.3, Some("first")));
    viewer.send(&order("lost", 0.3, Some("nobody")));
    // The mesh is not moved on before they are there.
    for id in ["better", "late", "lost"] {
        viewer.wait_for("order", |order| order["id"] == id && order["status"] == "accepted");
    }
    let is_over = |order: &Value| order["status"] == "applied" || order["status"] == "rejected";
    let mut ended = std::collections::BTreeMap::new();
    // A pipeline gives orders too.
    let all = ["first", "second", "third", "better", "late", "lost"];
    while !all.iter().all(|id| ended.contains_key(*id)) {
        step(&mut solver, &mut trace);
        let wait = Duration::from_millis(1);
        while let Some(order) = viewer.look_for("order", wait, is_over) {
            ended.insert(order["id"].as_str().unwrap().to_owned(), order);
        }
        assert!(trace.len() < 20_000, "{ended:?}");
    }
    let reason = |id: &str| ended[id]["reason"].as_str().unwrap_or_default();
    assert!(reason("second").contains("replaced by order better by c1"), "{ended:?}");
    assert!(reason("late").contains("moves the mesh already"), "{ended:?}");
    assert!(reason("lost").contains("there is no order 'nobody'"), "{ended:?}");
    let cycle = |id: &str| ended[id]["cycle_applied"].as_u64().unwrap_or_else(|| panic!("{id}"));
    assert!(cycle("first") < cycle("better") && cycle("better") <= cycle("third"), "{ended:?}");
    for _ in 0..10 {
        step(&mut solver, &mut trace);
    }
    solver.finish();
    let journal = std::fs::read_to_string(output.path().join("journal.jsonl")).unwrap();
    let again = replay(&journal, trace.len());
    assert!(again == trace, "the replay differs");
    // As a file of orders it is for a run in which nothing waits that could be replaced.
    let output = tempfile::tempdir().unwrap();
    let orders = parse_orders(&journal, "journal.jsonl").unwrap();
    let mut other = Solver::new(Settings { orders, ..settings(output.path()) });
    other.steps(trace.len() as u64);
    let orders = other.finish().orders;
    for id in ["first", "better", "third"] {
        let order = orders.iter().find(|order| order.id == id).unwrap();
        assert_ne!(order.status, OrderStatus::Rejected, "{order:?}");
    }
}

/// In the run and in its replay, what has no name of its own is counted from `o1`.
#[test]
fn a_command_of_a_replay_has_its_name_whatever_is_said_before_it() {
    const CONFIGURATION: &str = r#"{"version": 1, "stream": {"listen": "127.0.0.1:0"},
        "journal": "journal.jsonl", "pipelines": []}"#;
    let settings = |output: &Path| Settings {
        config: config(CONFIGURATION),
        output: output.into(),
        ..Settings::default()
    };
    let output = tempfile::tempdir().unwrap();
    let mut solver = Solver::new(settings(output.path()));
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    solver.steps(50);
    viewer.send(&json!({"order": squeeze(0.2)}));
    let order = solver.step_until_told(&mut viewer, "order", |order| order["status"] == "applied");
    assert_eq!(order["id"], "o1");
    let (cycles, mesh) = (solver.cycle, bits(&solver.mesh));
    solver.finish();
    let journal = std::fs::read_to_string(output.path().join("journal.jsonl")).unwrap();
    let again = tempfile::tempdir().unwrap();
    let replay = Some(parse_journal(&journal, "journal.jsonl").unwrap());
    let mut replayed = Solver::new(Settings { replay, ..settings(again.path()) });
    let mut viewer = Viewer::connect(&replayed.adaptor);
    viewer.hello();
    viewer.send(&json!({"pause": {}}));
    viewer.send(&json!({"resume": {}}));
    // A refused message is answered too: what was sent before it has come in.
    viewer.send(&json!({"id": "o1", "resume": {}}));
    let error = viewer.wait_for("error", |error| error["id"] == "o1");
    assert!(error["message"].as_str().unwrap().contains("another command"), "{error}");
    replayed.step();
    let done = viewer.wait_for("done", |_| true);
    assert_eq!(done["id"], "o2");
    replayed.steps(cycles - 1);
    assert!(bits(&replayed.mesh) == mesh, "{journal}");
    let orders = replayed.finish().orders;
    assert!(orders.len() == 1 && orders[0].id == "o1", "{orders:?}");
}

#[test]
fn the_same_command_sent_again_is_carried_out_once() {
    let output = tempfile::tempdir().unwrap();
    let mut solver = Solver::new(settings(output.path()));
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    let order = json!({"id": "mine", "order": squeeze(0.2)});
    viewer.send(&order);
    let is_applied = |order: &Value| order["id"] == "mine" && order["status"] == "applied";
    solver.step_until_told(&mut viewer, "order", is_applied);
    // Its sender has not heard of it and sends it again: it hears what became of it.
    viewer.seen.clear();
    viewer.send(&order);
    let told = solver.step_until_told(&mut viewer, "order", |order| order["id"] == "mine");
    assert_eq!(told["status"], "applied");
    let parameter = json!({"id": "p", "parameter": {"name": "heating", "value": 1.5}});
    for _ in 0..2 {
        viewer.send(&parameter);
        solver.step_until_told(&mut viewer, "done", |done| done["id"] == "p");
    }
    viewer.send(&json!({"id": "mine", "order": squeeze(0.1)}));
    let error = solver.step_until_told(&mut viewer, "error", |error| error["id"] == "mine");
    assert!(error["message"].as_str().unwrap().contains("another command"), "{error}");
    assert_eq!(solver.parameters.len(), 1);
    let orders = solver.finish().orders;
    assert_eq!(orders.iter().filter(|order| order.id == "mine").count(), 1, "{orders:?}");
    let journal = std::fs::read_to_string(output.path().join("journal.jsonl")).unwrap();
    assert_eq!(journal.matches("\"id\":\"mine\",\"status\":\"accepted\"").count(), 1, "{journal}");
}

#[test]
fn a_journal_is_continued_and_never_shared() {
    let output = tempfile::tempdir().unwrap();
    let run = |amount: f64| {
        let mut solver = Solver::new(settings(output.path()));
        let other = tombolo::Adaptor::initialize(settings(output.path()));
        let refused = other.err().expect("two runs write to one journal").to_string();
        assert!(refused.contains("another run"), "{refused}");
        let mut viewer = Viewer::connect(&solver.adaptor);
        viewer.hello();
        viewer.send(&json!({"id": "a", "order": squeeze(amount)}));
        let is_applied = |order: &Value| order["id"] == "a" && order["status"] == "applied";
        solver.step_until_told(&mut viewer, "order", is_applied);
        let mesh = bits(&solver.mesh);
        let cycles = solver.cycle;
        drop(solver);
        (mesh, usize::try_from(cycles).unwrap())
    };
    run(0.1);
    let file = output.path().join("journal.jsonl");
    let first = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, format!("{first}{{\"id\":\"torn")).unwrap();
    let (mesh, cycles) = run(0.2);
    let both = std::fs::read_to_string(&file).unwrap();
    assert!(both.starts_with(&first) && !both.contains("torn"), "{both}");
    assert_eq!(both.matches("{\"run\":").count(), 2);
    // The newest run is the one that is carried out again.
    assert!(replay(&both, cycles).last().unwrap().0 == mesh);
}

#[test]
fn a_replay_is_watched_and_not_steered() {
    let output = tempfile::tempdir().unwrap();
    let replay = Some(parse_journal("", "journal.jsonl").unwrap());
    let mut solver = Solver::new(Settings { replay, ..settings(output.path()) });
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    viewer.send(&json!({"id": "a", "order": squeeze(0.2)}));
    let error = solver.step_until_told(&mut viewer, "error", |error| error["id"] == "a");
    assert!(error["message"].as_str().unwrap().contains("replays a journal"), "{error}");
    viewer.send(&json!({"id": "b", "cancel": {"order": "a"}}));
    let error = solver.step_until_told(&mut viewer, "error", |error| error["id"] == "b");
    assert!(error["message"].as_str().unwrap().contains("replays a journal"), "{error}");
    // Another view is no steering; how orders are carried out is.
    let view = json!({"name": "half", "stages": [
        {"slice": {"origin": [0.5, 0.5, 0.5], "normal": [1.0, 0.0, 0.0]}}, {"stream": {}}]});
    viewer.send(&json!({"id": "c", "pipelines": {"set": [view]}}));
    solver.step_until_told(&mut viewer, "pipelines", |told| {
        told["id"] == "c" && told["status"] == "applied"
    });
    let shape =
        json!({"name": "shape", "on": "order", "stages": [{"guard": {"otherwise": "clamp"}}]});
    viewer.send(&json!({"id": "d", "pipelines": {"set": [shape]}}));
    let error = solver.step_until_told(&mut viewer, "error", |error| error["id"] == "d");
    assert!(error["message"].as_str().unwrap().contains("replays a journal"), "{error}");
    viewer.send(&json!({"stop": {}}));
    solver.step_until("the stop", |solver| solver.stopped);
    // The pipeline of this configuration has given orders, which no journal holds.
    solver.steps(40);
    assert!(solver.is_at_reference());
    assert!(solver.finish().orders.is_empty());
}
