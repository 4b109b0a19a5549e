//! Many and large orders, and what the stack of edits costs those who watch.

mod common;

use std::time::Duration;

use common::{LINK_TO_ALL, Solver, Viewer, config, has_status, long, squeeze};
use serde_json::{Value, json};
use tokio_tungstenite::tungstenite::Message;
use tombolo::{
    Settings,
    client::{Client, Event, Link},
    deform::edit::Edit,
    pipelines::limits::PENDING_BYTES,
};

/// An order that moves these vertices by next to nothing.
fn displacement(vertices: &[u32], seed: f64) -> Value {
    let by = |&vertex: &u32| [1e-9 * (f64::from(vertex) + seed).sin(), 0.0, 0.0];
    let values: Vec<_> = vertices.iter().map(by).collect();
    json!({"edits": [{"displacement": {"vertices": vertices, "values": values}}]})
}

/// A solver and its driver, whose order `long` is being planned for longer than a test takes.
fn beside_a_long_plan(settings: Settings) -> (Solver, Viewer) {
    let mut solver = Solver::of_box([24, 24, 24], settings);
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    solver.step();
    viewer.send(&json!({"id": "long", "order": long(0.3)}));
    solver.step_until_told(&mut viewer, "order", has_status("long", "computing"));
    (solver, viewer)
}

/// A solver takes its commands in at once; those whose turn has not come count all the same.
#[test]
fn what_waits_is_limited_in_bytes_also_when_the_solver_has_taken_it() {
    let settings = Settings { config: config(LINK_TO_ALL), ..Settings::default() };
    let (mut solver, mut viewer) = beside_a_long_plan(settings);
    let text = displacement(&(0..300_000).collect::<Vec<_>>(), 0.0).to_string();
    let fit = PENDING_BYTES.most / text.len();
    assert!((2..8).contains(&fit), "{}", text.len());
    for index in 0..fit {
        viewer.send_text(&format!(r#"{{"id": "big-{index}", "order": {text}}}"#));
        let id = format!("big-{index}");
        // The solver has taken it: nothing is left in the queue that viewers fill.
        let before = if index == 0 { "long".to_owned() } else { format!("big-{}", index - 1) };
        let waits = solver.step_until_told(&mut viewer, "order", |order| {
            order["id"] == *id && order["waits_for"] != "the solver's next call"
        });
        assert_eq!(waits["waits_for"], format!("order {before}, which came before it"));
        assert!(waits["cycle_accepted"].as_u64().is_some_and(|cycle| cycle < solver.cycle));
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

/// Every value of a frame of [`Solver`]'s field is within so much of what it was.
fn assert_within(frame: &tombolo::pipelines::encode::DecodedFrame, error: f64) {
    let (_, speed) = frame.fields.iter().map(|field| (&field.name, &field.values)).next().unwrap();
    for ([x, y, z], value) in frame.points.iter().zip(speed) {
        let exact = x + y * z + frame.time;
        assert!((value - exact).abs() <= error, "{value} for {exact} at cycle {}", frame.cycle);
    }
}

#[test]
fn a_link_that_falls_behind_gets_coarser_frames_and_the_exact_ones_back() {
    let mut solver = Solver::with_config(LINK_TO_ALL);
    solver.step();
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    let mut count = 0_u64;
    // Takes what has come, and says so.
    let mut take = |viewer: &mut Viewer, error: f64| {
        let frames = viewer.decoded();
        frames.iter().for_each(|frame| assert_within(frame, error));
        count += frames.len() as u64;
        if !frames.is_empty() {
            viewer.send_message(Message::binary(count.to_le_bytes().to_vec()));
        }
        !frames.is_empty()
    };
    // The range of the field is 2, of which it is sent to a thousandth; and what is known of the
    // points is less exact than the field.
    let exact = 2.0 * 1e-3 + 1e-4;
    let mut told = None;
    for _ in 0..200 {
        (0..8).for_each(|_| {
            solver.step();
            std::thread::sleep(Duration::from_millis(3));
        });
        told = viewer.look_for("precision", Duration::from_millis(30), |_| true);
        if told.is_some() {
            break;
        }
        take(&mut viewer, exact);
    }
    assert_eq!(told.unwrap(), json!({"view": "boundary", "coarser": 8.0}));
    // Now each frame is carried before the next one comes. Those of before may have been too many
    // for the coarser ones too.
    let (mut coarser, mut coarsest) = (8.0, 8.0);
    for _ in 0..2000 {
        solver.step();
        for _ in 0..50 {
            let told = viewer.look_for("precision", Duration::from_millis(10), |_| true);
            coarser = told.map_or(coarser, |told| told["coarser"].as_f64().unwrap());
            coarsest = coarser.max(coarsest);
            if take(&mut viewer, coarsest * exact) {
                break;
            }
        }
        if coarser == 1.0 {
            break;
        }
    }
    assert_eq!(coarser, 1.0);
    take(&mut viewer, coarsest * exact);
    let before = solver.cycle;
    for _ in 0..20 {
        solver.step();
        viewer.look_for("nothing", Duration::from_millis(20), |_| true);
    }
    let frames = viewer.decoded();
    let newest = frames.iter().filter(|frame| frame.cycle >= before);
    assert!(newest.clone().count() > 0);
    newest.for_each(|frame| assert_within(frame, exact));
    solver.finish();
}

#[test]
fn an_order_that_waits_too_long_is_rejected() {
    let mut settings = Settings { config: config(LINK_TO_ALL), ..Settings::default() };
    settings.config.steering.deadline = std::num::NonZeroU32::MIN;
    let (mut solver, mut viewer) = beside_a_long_plan(settings);
    viewer.send(&json!({"id": "late", "order": squeeze(0.1)}));
    let late = solver.step_until_told(&mut viewer, "order", has_status("late", "rejected"));
    assert!(late["reason"].as_str().unwrap().contains("steering.deadline"), "{late}");
    solver.finish();
}

#[test]
fn an_order_waits_no_longer_than_it_says_itself() {
    let settings = Settings { config: config(LINK_TO_ALL), ..Settings::default() };
    let (mut solver, mut viewer) = beside_a_long_plan(settings);
    let mut order = squeeze(0.1);
    viewer.send(&json!({"id": "patient", "order": order}));
    order["deadline"] = json!(1);
    viewer.send(&json!({"id": "late", "order": order}));
    let late = solver.step_until_told(&mut viewer, "order", has_status("late", "rejected"));
    let reason = "it has waited for more than 1 seconds (its own `deadline`)";
    assert_eq!(late["reason"], reason);
    let is_patient = |order: &tombolo::OrderReport| order.id == "patient" && order.reason.is_none();
    assert!(solver.adaptor.orders().iter().any(is_patient));
    solver.finish();
}

/// An order that waits says behind which, also once that one is gone.
#[test]
fn what_waited_behind_an_order_that_is_gone_says_what_it_waits_for_now() {
    let settings = Settings { config: config(LINK_TO_ALL), ..Settings::default() };
    let (mut solver, mut viewer) = beside_a_long_plan(settings);
    for id in ["a", "b", "c"] {
        let mut order = squeeze(0.1);
        if id == "b" {
            order["deadline"] = json!(10);
        }
        viewer.send(&json!({"id": id, "order": order}));
    }
    let waits = |viewer: &mut Viewer, solver: &mut Solver, id: &str, before: &str| {
        let expected = format!("order {before}, which came before it");
        solver.step_until_told(viewer, "order", |order| {
            order["id"] == id && order["waits_for"] == *expected
        });
    };
    waits(&mut viewer, &mut solver, "a", "long");
    waits(&mut viewer, &mut solver, "b", "a");
    waits(&mut viewer, &mut solver, "c", "b");
    viewer.send(&json!({"cancel": {"order": "a"}}));
    waits(&mut viewer, &mut solver, "b", "long");
    // It waits for too long.
    waits(&mut viewer, &mut solver, "c", "long");
    viewer.send(&json!({"id": "d", "order": squeeze(0.1)}));
    waits(&mut viewer, &mut solver, "d", "c");
    let mut order = squeeze(0.2);
    order["replaces"] = json!("c");
    viewer.send(&json!({"id": "e", "order": order}));
    waits(&mut viewer, &mut solver, "d", "e");
    solver.finish();
}

#[test]
fn an_order_waits_no_longer_in_a_paused_run() {
    let mut settings = Settings { config: config(LINK_TO_ALL), ..Settings::default() };
    settings.config.steering.deadline = std::num::NonZeroU32::MIN;
    let mut solver = Solver::new(settings);
    solver.step();
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    viewer.send(&json!({"pause": {}}));
    let steered = std::thread::spawn(move || {
        viewer.wait_for("status", |status| status["paused"] == true);
        viewer.send(&json!({"id": "first", "order": squeeze(0.1)}));
        viewer.send(&json!({"id": "behind", "order": squeeze(0.2)}));
        for id in ["first", "behind"] {
            let late = viewer.wait_for("order", has_status(id, "rejected"));
            assert!(late["reason"].as_str().unwrap().contains("steering.deadline"), "{late}");
        }
        viewer.send(&json!({"resume": {}}));
        viewer.wait_for("status", |status| status["paused"] == false);
        viewer
    });
    while !steered.is_finished() {
        solver.step();
    }
    drop(steered.join().unwrap());
    assert!(solver.motions.is_empty(), "{:?}", solver.motions);
    solver.finish();
}

#[test]
fn a_paused_run_that_nobody_can_resume_goes_on_where_that_is_wanted() {
    let mut settings = Settings { config: config(LINK_TO_ALL), ..Settings::default() };
    settings.config.steering.resume_after = Some(std::num::NonZeroU32::MIN);
    let mut solver = Solver::new(settings);
    solver.step();
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    viewer.send(&json!({"pause": {}}));
    viewer.send(&json!({"here": {}}));
    // One who only watches cannot resume it.
    let watching = common::socket_url(&solver.adaptor) + "&role=watch";
    let watcher = Viewer::try_connect(&watching).expect("connected");
    let begun = std::time::Instant::now();
    let leaves = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(500));
        drop(viewer);
    });
    // It comes back from the pause by itself, and not before the driver has left.
    while begun.elapsed() < Duration::from_millis(1500) {
        solver.step();
    }
    leaves.join().unwrap();
    drop(watcher);
    solver.steps(3);
    solver.finish();
}

/// However long the stack is, `hello` says how many edits there are; an order sends no `hello`.
#[test]
fn the_stack_is_fetched_by_those_who_want_it_and_sent_to_nobody() {
    let settings = Settings { config: config(LINK_TO_ALL), ..Settings::default() };
    let mut solver = Solver::of_box([12; 3], settings);
    let is_outside = |point: &[f64; 3]| point.iter().any(|&x| x == 0.0 || x == 1.0);
    let points = (0_u32..).zip(solver.reference.points());
    let outside: Vec<u32> =
        points.filter(|(_, point)| is_outside(point)).map(|(vertex, _)| vertex).collect();
    solver.step();
    let mut viewer = Viewer::connect(&solver.adaptor);
    let hello = viewer.hello();
    assert_eq!(hello["stack"], json!({"revision": 0, "edits": 0, "undoable": 0}));
    let orders: Vec<Value> = (0..3).map(|seed| displacement(&outside, f64::from(seed))).collect();
    for (index, order) in orders.iter().enumerate() {
        let id = format!("o-{index}");
        viewer.send(&json!({"id": id, "order": order}));
        let ended = solver.step_until_told(&mut viewer, "order", |order| {
            order["id"] == *id
                && ["applied", "rejected"].contains(&order["status"].as_str().unwrap())
        });
        assert_eq!(ended["status"], "applied", "{ended}");
        let told = viewer.wait_for("stack", |_| true);
        assert_eq!(
            told,
            json!({"revision": index + 1, "edits": index + 1, "kept": index, "undoable": index + 1})
        );
    }
    viewer.send(&json!({"id": "undo", "order": {"undo": 2}}));
    solver.step_until_told(&mut viewer, "order", has_status("undo", "applied"));
    let told = viewer.wait_for("stack", |_| true);
    assert_eq!(told, json!({"revision": 4, "edits": 1, "kept": 1, "undoable": 1}));
    assert!(
        viewer.seen.iter().all(|message| message.get("hello").is_none()),
        "an order sent a hello"
    );
    assert!(
        viewer.seen.iter().all(|message| message.to_string().len() < 2000),
        "something is long"
    );

    let link: Link = solver.adaptor.watching_link().unwrap().parse().unwrap();
    let client = Client::connect(&link, &tombolo::client::Options::default()).unwrap();
    let stack = client.hello().unwrap().stack.unwrap();
    assert_eq!((stack.revision, stack.edits), (4, 1));
    let expected: Vec<Edit> = serde_json::from_value(orders[0]["edits"].clone()).unwrap();
    assert_eq!(client.stack().unwrap(), expected);
    // More than goes into one answer.
    const COUNT: u32 = 180;
    let whole: Vec<Value> = (0..COUNT)
        .flat_map(|seed| {
            displacement(&outside, f64::from(seed))["edits"].as_array().unwrap().clone()
        })
        .collect();
    viewer.send(&json!({"id": "whole", "order": {"stack": whole}}));
    solver.step_until_told(&mut viewer, "order", has_status("whole", "applied"));
    let expected: Vec<Edit> = serde_json::from_value(json!(whole)).unwrap();
    assert_eq!(client.stack().unwrap(), expected);
    let told = loop {
        let told = client.next(Duration::from_secs(60)).unwrap().expect("a change of the stack");
        if let Event::Stack(told) = told.event {
            break told;
        }
    };
    assert_eq!((told.revision, told.edits, told.kept), (5, COUNT as usize, 1));
    solver.finish();
}
