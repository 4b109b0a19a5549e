//! What becomes of orders whose shapes take long to find: they are cancelled, or given up at the
//! end.

mod common;

use std::sync::{
    Arc,
    atomic::{AtomicU64, Ordering},
};

use common::{LINK_TO_ALL, Solver, Viewer, config, squeeze};
use serde_json::{Value, json};
use tombolo::{OrderStatus, Settings, pipelines::language::parse_orders};

/// A run whose long orders take seconds.
fn solver() -> Solver {
    let settings = Settings { config: config(LINK_TO_ALL), ..Settings::default() };
    Solver::of_box([24, 24, 24], settings)
}

/// An order of as many shapes as there may be.
fn long(by: f64) -> Value {
    let mut order = squeeze(by);
    order["schedule"] = json!({"steps": 10_000});
    order
}

fn has_status<'s>(id: &'s str, status: &'s str) -> impl Fn(&Value) -> bool + 's {
    move |order| order["id"] == id && order["status"] == status
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
        ("c3", "short", "waits no more"),
        ("c4", "long", "waits no more"),
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

#[test]
fn a_stop_does_not_wait_for_shapes() {
    let mut solver = solver();
    let mut viewer = driven(&mut solver);
    viewer.send(&json!({"id": "long", "order": long(0.3)}));
    solver.step_until_told(&mut viewer, "order", has_status("long", "computing"));
    viewer.send(&json!({"id": "next", "order": squeeze(0.2)}));
    viewer.wait_for("order", has_status("next", "accepted"));
    viewer.send(&json!({"id": "stop", "stop": {}}));
    solver.step_until("the stop", |solver| solver.stopped);
    let report = solver.finish();
    // Neither was carried out, and both say why.
    for order in &report.orders {
        assert_eq!(order.status, OrderStatus::Rejected, "{order:?}");
        let reason = order.reason.as_deref().unwrap();
        assert!(reason.contains("given up") || reason.contains("the run ended"), "{reason}");
    }
    assert_eq!(report.orders.len(), 2);
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
    let report = solver.finish();
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
