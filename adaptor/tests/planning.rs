//! What becomes of orders whose shapes take long to find: they are cancelled, or given up at the
//! end.

mod common;

use std::{
    io::{BufRead, BufReader},
    process::{Command, Stdio},
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
    time::{Duration, Instant},
};

use common::{LINK_TO_ALL, Solver, Viewer, config, has_status, long, squeeze};
use serde_json::{Value, json};
use tombolo::{
    OrderStatus, Settings,
    pipelines::language::{parse_journal, parse_orders},
};

/// A run whose long orders take seconds.
fn solver() -> Solver {
    let settings = Settings { config: config(LINK_TO_ALL), ..Settings::default() };
    Solver::of_box([24, 24, 24], settings)
}

fn driven(solver: &mut Solver) -> Viewer {
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    solver.step();
    viewer
}

#[test]
fn an_order_is_cancelled_while_its_shapes_are_found() {
    let mut solver = solver();
    let mut viewer = driven(&mut solver);
    viewer.send(&json!({"id": "long", "order": long(0.3)}));
    solver.step_until_told(&mut viewer, "order", has_status("long", "computing"));
    viewer.send(&json!({"id": "next", "order": long(0.2)}));
    viewer.send(&json!({"id": "short", "order": squeeze(0.1)}));
    viewer.wait_for("order", has_status("short", "accepted"));
    viewer.send(&json!({"id": "c1", "cancel": {"order": "long"}}));
    viewer.send(&json!({"id": "c2", "cancel": {"order": "next"}}));
    let cancelled = solver.step_until_told(&mut viewer, "order", has_status("long", "rejected"));
    assert_eq!(cancelled["reason"], "cancelled by c1");
    solver.step_until_told(&mut viewer, "done", |done| done["id"] == "c1");
    solver.step_until_told(&mut viewer, "done", |done| done["id"] == "c2");
    solver.step_until_told(&mut viewer, "order", has_status("short", "applied"));
    assert!(solver.motions.iter().all(|(_, _, order)| order == "short"), "{:?}", solver.motions);
    for (id, order, reason) in [
        ("c3", "short", "no longer waits"),
        ("c4", "long", "no longer waits"),
        ("c5", "nobody", "there is no order 'nobody'"),
    ] {
        viewer.send(&json!({"id": id, "cancel": {"order": order}}));
        let error = solver.step_until_told(&mut viewer, "error", |error| error["id"] == id);
        assert!(error["message"].as_str().unwrap().contains(reason), "{error}");
    }
    solver.finish();
}

/// An order waits for the disk; what cancels it does not overtake it there.
#[test]
fn an_order_is_cancelled_in_the_moment_after_it_is_given() {
    let output = tempfile::tempdir().unwrap();
    let config = config(&LINK_TO_ALL.replacen('{', r#"{"journal": "journal.jsonl", "#, 1));
    let settings = Settings { config, output: output.path().into(), ..Settings::default() };
    let mut solver = Solver::of_box([24, 24, 24], settings);
    let mut viewer = driven(&mut solver);
    for index in 0..5 {
        let (order, cancel) = (format!("order-{index}"), format!("cancel-{index}"));
        viewer.send(&json!({"id": order, "order": long(0.3)}));
        viewer.send(&json!({"id": cancel, "cancel": {"order": order}}));
        let rejected = solver.step_until_told(&mut viewer, "order", has_status(&order, "rejected"));
        assert_eq!(rejected["reason"], "cancelled by c1");
        solver.step_until_told(&mut viewer, "done", |done| done["id"] == *cancel);
    }
    assert!(solver.motions.is_empty(), "{:?}", solver.motions);
}

#[test]
fn an_order_that_moves_the_mesh_is_not_cancelled() {
    let mut solver = Solver::with_config(LINK_TO_ALL);
    let mut viewer = driven(&mut solver);
    viewer.send(&json!({"id": "slow", "order": {
        "edits": squeeze(0.2)["edits"], "schedule": {"steps": 3, "every": {"steps": 100_000}}}}));
    solver.step_until_told(&mut viewer, "order", has_status("slow", "applying"));
    viewer.send(&json!({"id": "c", "cancel": {"order": "slow"}}));
    let error = solver.step_until_told(&mut viewer, "error", |error| error["id"] == "c");
    assert!(error["message"].as_str().unwrap().contains("moves the mesh already"), "{error}");
    solver.finish();
}

/// In a paused run an order is planned and begins nothing: it can be taken back as long as the pause
/// lasts, and takes effect in the cycle of the pause.
#[test]
fn an_order_given_in_a_pause_is_taken_back_until_the_run_goes_on() {
    for background in [true, false] {
        let output = tempfile::tempdir().unwrap();
        let more = format!(
            r#"{{"journal": "journal.jsonl", "steering": {{"background": {background}}}, "#
        );
        let settings = || {
            let config = config(&LINK_TO_ALL.replacen('{', &more, 1));
            Settings { config, output: output.path().into(), ..Settings::default() }
        };
        let mut solver = Solver::new(settings());
        let mut viewer = driven(&mut solver);
        viewer.send(&json!({"id": "p", "pause": {}}));
        let steered = std::thread::spawn(move || {
            let waits = |viewer: &mut Viewer, id: &str, what: &str| {
                viewer.wait_for("order", |order| {
                    let reason = order["waits_for"].as_str().unwrap_or_default();
                    order["id"] == id && reason.contains(what)
                })
            };
            let paused = viewer.wait_for("done", |done| done["id"] == "p");
            viewer.send(&json!({"id": "first", "order": squeeze(0.2)}));
            let first = waits(&mut viewer, "first", "paused");
            assert!(first["status"] == "computing" && first["cycle_applied"].is_null(), "{first}");
            viewer.send(&json!({"id": "c", "cancel": {"order": "first"}}));
            let cancelled = viewer.wait_for("order", has_status("first", "rejected"));
            assert_eq!(cancelled["reason"], "cancelled by c1");
            viewer.wait_for("done", |done| done["id"] == "c");
            viewer.send(&json!({"id": "second", "order": squeeze(0.3)}));
            waits(&mut viewer, "second", "paused");
            viewer.send(&json!({"id": "late", "order": squeeze(0.05)}));
            waits(&mut viewer, "late", "order second");
            let mut third = json!({"id": "third", "order": squeeze(0.1)});
            third["order"]["replaces"] = "second".into();
            viewer.send(&third);
            let replaced = viewer.wait_for("order", has_status("second", "rejected"));
            assert_eq!(replaced["reason"], "replaced by order third by c1");
            waits(&mut viewer, "third", "paused");
            viewer.send(&json!({"resume": {}}));
            (viewer, paused["cycle"].as_u64().unwrap())
        });
        solver.step_until("the third order", |solver| !solver.motions.is_empty());
        let (mut viewer, paused) = steered.join().unwrap();
        if background {
            assert_eq!(solver.motions, [(paused, (1, 1), "third".to_owned())]);
        }
        if !has_been(&viewer, "late") {
            solver.step_until_told(&mut viewer, "order", has_status("late", "applied"));
        }
        solver.steps(2);
        let (motions, cycles, mesh) =
            (solver.motions.clone(), solver.cycle, common::bits(&solver.mesh));
        solver.finish();
        let journal = std::fs::read_to_string(output.path().join("journal.jsonl")).unwrap();
        for (id, has_begun) in [("first", 0), ("second", 0), ("third", 1), ("late", 1)] {
            let begun = format!(r#""id":"{id}","status":"applied""#);
            assert_eq!(journal.matches(&begun).count(), has_begun, "{id}: {journal}");
            let refused = format!(r#""id":"{id}","status":"rejected""#);
            assert_eq!(journal.matches(&refused).count(), 1 - has_begun, "{id}: {journal}");
        }
        let again = tempfile::tempdir().unwrap();
        let replay = Some(parse_journal(&journal, "journal.jsonl").unwrap());
        let output = again.path().into();
        let mut replayed = Solver::new(Settings { replay, output, ..settings() });
        replayed.steps(cycles);
        assert_eq!(replayed.motions, motions);
        assert!(common::bits(&replayed.mesh) == mesh, "{journal}");
        replayed.finish();
    }
}

fn has_been(viewer: &Viewer, applied: &str) -> bool {
    let fits = has_status(applied, "applied");
    viewer.seen.iter().any(|message| message.get("order").is_some_and(&fits))
}

#[test]
fn a_stop_of_a_paused_run_begins_no_order() {
    let mut solver = Solver::with_config(LINK_TO_ALL);
    let mut viewer = driven(&mut solver);
    viewer.send(&json!({"pause": {}}));
    let steered = std::thread::spawn(move || {
        viewer.wait_for("status", |status| status["paused"] == true);
        viewer.send(&json!({"id": "held", "order": squeeze(0.2)}));
        let is_paused = |order: &Value| {
            order["waits_for"].as_str().is_some_and(|reason| reason.contains("paused"))
        };
        viewer.wait_for("order", is_paused);
        viewer.send(&json!({"stop": {}}));
        viewer
    });
    solver.step_until("the stop", |solver| solver.stopped);
    drop(steered.join().unwrap());
    solver.step();
    assert!(solver.motions.is_empty(), "{:?}", solver.motions);
    let order = &solver.finish().orders[0];
    assert_eq!(order.status, OrderStatus::Rejected);
    assert!(order.reason.as_deref().unwrap().contains("while it was paused"), "{order:?}");
}

/// How long the end may take whatever is under way: two seconds for shapes and as many for the last
/// frames, as docs/operations.md says, and a slow machine's own.
const END: Duration = Duration::from_secs(10);

#[test]
fn a_stop_does_not_wait_for_shapes() {
    let mut solver = solver();
    let mut viewer = driven(&mut solver);
    viewer.send(&json!({"id": "long", "order": long(0.3)}));
    solver.step_until_told(&mut viewer, "order", has_status("long", "computing"));
    viewer.send(&json!({"id": "next", "order": squeeze(0.2)}));
    viewer.wait_for("order", has_status("next", "accepted"));
    viewer.send(&json!({"id": "stop", "stop": {}}));
    let asked = Instant::now();
    solver.step_until("the stop", |solver| solver.stopped);
    let report = solver.finish();
    assert!(asked.elapsed() < END, "the run went on for {:?}", asked.elapsed());
    // Neither was carried out, and both say why.
    for order in &report.orders {
        assert_eq!(order.status, OrderStatus::Rejected, "{order:?}");
        let reason = order.reason.as_deref().unwrap();
        assert!(reason.contains("given up") || reason.contains("the run ended"), "{reason}");
    }
    assert_eq!(report.orders.len(), 2);
}

/// A forecast that nobody wants to know any more is given up, before it has begun or in its midst; the
/// shapes of an order that has been given are found in spite of it.
#[test]
fn a_forecast_is_withdrawn() {
    let mut solver = solver();
    let mut viewer = driven(&mut solver);
    let begun = Instant::now();
    viewer.send(&json!({"id": "whole", "forecast": long(0.3)}));
    viewer.wait_for("forecast", |told| told["id"] == "whole");
    let whole = begun.elapsed();
    for (pause, by) in [(0.0, 0.31), (0.1, 0.32)] {
        let begun = Instant::now();
        viewer.send(&json!({"id": "long", "forecast": long(by)}));
        std::thread::sleep(whole.mul_f64(pause));
        viewer.send(&json!({"id": "w", "withdraw_forecast": {}}));
        let error = viewer.wait_for("error", |error| error["id"] == "long");
        assert!(error["message"].as_str().unwrap().contains("withdrawn"), "{error}");
        // Found to its end and then not told it would take as long as the first.
        let took = begun.elapsed();
        assert!(took < whole.mul_f64(0.6), "{took:?} of {whole:?}");
        viewer.wait_for("done", |done| done["id"] == "w");
        viewer.send(&json!({"id": "short", "forecast": squeeze(0.1)}));
        let told = viewer.wait_for("forecast", |told| !told.is_null());
        assert_eq!((&told["id"], &told["order"]["outcome"]), (&json!("short"), &json!("applied")));
    }
    let mut given = squeeze(0.2);
    given["schedule"] = json!({"steps": 2000});
    viewer.send(&json!({"id": "asked", "forecast": given}));
    viewer.send(&json!({"id": "given", "order": given}));
    viewer.send(&json!({"withdraw_forecast": {}}));
    solver.step_until_told(&mut viewer, "order", has_status("given", "applying"));
    solver.finish();
}

/// Whoever waits for a forecast in a terminal is told why it takes long.
#[test]
fn a_forecast_that_takes_long_is_explained() {
    let mut solver = solver();
    solver.step();
    let directory = tempfile::tempdir().expect("a directory");
    let file = directory.path().join("long.json");
    std::fs::write(&file, long(0.3).to_string()).expect("written");
    let mut asking = Command::new(env!("CARGO_BIN_EXE_tombolo"))
        .args(["forecast", &solver.adaptor.link().expect("a server")])
        .arg(&file)
        .stderr(Stdio::piped())
        .spawn()
        .expect("runs");
    let said = BufReader::new(asking.stderr.take().expect("its errors")).lines().next();
    let said = said.expect("a line").expect("text");
    assert!(said.contains("not found yet; the shapes of orders come before forecasts"), "{said}");
    asking.kill().expect("it waits still");
    asking.wait().expect("it has ended");
    let begun = Instant::now();
    solver.finish();
    assert!(begun.elapsed() < Duration::from_secs(10), "{:?}", begun.elapsed());
}

#[test]
fn a_stop_gives_shapes_up_where_nobody_watches() {
    let orders = json!([{"at": {"cycle": 1}, "order": long(0.3)}]).to_string();
    let orders = parse_orders(&orders, "orders.json").unwrap();
    let mut solver = Solver::of_box([24, 24, 24], Settings { orders, ..Settings::default() });
    solver.step();
    solver.adaptor.stopper().stop();
    solver.step();
    assert!(solver.stopped && solver.motions.is_empty());
    let report = solver.finish();
    let order = &report.orders[0];
    assert_eq!(order.status, OrderStatus::Rejected);
    assert!(order.reason.as_deref().unwrap().contains("given up"), "{order:?}");
}

#[test]
fn a_stop_of_a_list_begins_no_order_of_its_step() {
    let orders = json!([
        {"at": {"cycle": 1}, "order": long(0.3)},
        {"at": {"cycle": 1}, "stop": {}}
    ]);
    let orders = parse_orders(&orders.to_string(), "orders.json").unwrap();
    let mut solver = Solver::of_box([24, 24, 24], Settings { orders, ..Settings::default() });
    solver.steps(2);
    assert!(solver.stopped && solver.motions.is_empty());
    let order = &solver.finish().orders[0];
    assert_eq!(order.status, OrderStatus::Rejected);
    assert!(order.reason.as_deref().unwrap().contains("given up"), "{order:?}");
}

#[test]
fn orders_of_a_mesh_that_was_replaced_have_an_outcome() {
    let mut solver = solver();
    let mut viewer = driven(&mut solver);
    let mut first = squeeze(0.2);
    first["schedule"] = json!({"steps": 1000});
    viewer.send(&json!({"id": "first", "order": first}));
    solver.step_until_told(&mut viewer, "order", has_status("first", "applying"));
    solver.steps(2);
    viewer.send(&json!({"id": "second", "order": long(0.3)}));
    solver.step_until_told(&mut viewer, "order", has_status("second", "computing"));
    viewer.send(&json!({"id": "third", "order": squeeze(0.1)}));
    solver.step_until_told(&mut viewer, "order", has_status("third", "accepted"));
    solver.adaptor.release_shape("the solver refines its mesh");
    solver.step();
    let orders = solver.finish().orders;
    let reasons = orders.iter().map(|order| (order.status, order.reason.as_deref()));
    let reasons: Vec<_> = reasons.map(|(status, why)| (status, why.unwrap_or_default())).collect();
    let [first, second, third] = reasons[..] else { panic!("{orders:?}") };
    let (status, why) = first;
    assert!(
        status == OrderStatus::Applied && why.ends_with("of 1000: the solver refines its mesh"),
        "{why}"
    );
    let refused = (OrderStatus::Rejected, "the solver refines its mesh");
    assert_eq!([second, third], [refused, refused]);
}

#[test]
fn a_host_is_called_while_its_solver_waits() {
    let pause = parse_orders(r#"[{"at": {"cycle": 0}, "pause": {}}]"#, "orders.json").unwrap();
    for (steering, orders) in [("{}", pause), (r#"{"wait_for_viewer": true}"#, Vec::new())] {
        let config = config(&format!(
            r#"{{"version": 1, "stream": {{"listen": "127.0.0.1:0"}}, "steering": {steering}}}"#
        ));
        let mut solver = Solver::new(Settings { config, orders, ..Settings::default() });
        let stopper = solver.adaptor.stopper();
        let (calls, thread) = (Arc::new(AtomicU64::new(0)), std::thread::current().id());
        let counted = Arc::clone(&calls);
        solver.adaptor.while_waiting(move || {
            assert_eq!(std::thread::current().id(), thread);
            if counted.fetch_add(1, Ordering::Relaxed) == 2 {
                stopper.stop();
            }
        });
        solver.step();
        assert!(solver.stopped);
        assert!(calls.load(Ordering::Relaxed) >= 3, "{steering}");
    }
}

#[test]
fn the_end_of_a_run_does_not_wait_for_shapes() {
    let mut solver = solver();
    let mut viewer = driven(&mut solver);
    viewer.send(&json!({"id": "long", "order": long(0.3)}));
    solver.step_until_told(&mut viewer, "order", has_status("long", "computing"));
    let asked = Instant::now();
    let report = solver.finish();
    assert!(asked.elapsed() < END, "the run went on for {:?}", asked.elapsed());
    let order = &report.orders[0];
    assert_eq!(order.status, OrderStatus::Rejected);
    assert!(order.reason.as_deref().unwrap().contains("given up"), "{order:?}");
}

#[test]
fn what_takes_effect_is_answered() {
    let settings = Settings { config: config(LINK_TO_ALL), ..Settings::default() };
    let mut solver = Solver::new(settings.parameter("heating", 1.0, 0.0..=2.0));
    let mut viewer = driven(&mut solver);
    viewer.send(&json!({"id": "p", "parameter": {"name": "heating", "value": 1.5}}));
    let done = solver.step_until_told(&mut viewer, "done", |done| done["id"] == "p");
    assert!(done["cycle"].as_u64().is_some_and(|cycle| cycle < solver.cycle), "{done}");
    viewer.send(&json!({"id": "q", "parameter": {"name": "heating", "value": 9.0}}));
    let error = solver.step_until_told(&mut viewer, "error", |error| error["id"] == "q");
    assert!(error["message"].as_str().unwrap().contains("heating"), "{error}");
    viewer.send(&json!({"id": "a", "pause": {}}));
    viewer.send(&json!({"id": "b", "resume": {}}));
    solver.step_until_told(&mut viewer, "done", |done| done["id"] == "a");
    solver.step_until_told(&mut viewer, "done", |done| done["id"] == "b");
    solver.finish();
}
