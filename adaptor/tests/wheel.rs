//! Who drives, and to whom the wheel goes.

mod common;

use std::time::{Duration, Instant};

use common::{LINK_TO_ALL, PATIENCE, Solver, Viewer, socket_url, squeeze};
use serde_json::json;
use tokio_tungstenite::tungstenite::Message;

#[test]
fn one_drives_and_the_others_watch() {
    let mut solver = Solver::with_config(LINK_TO_ALL);
    solver.step();
    let mut driver = Viewer::connect(&solver.adaptor);
    let name = driver.hello()["client"].clone();
    let mut watcher = Viewer::connect(&solver.adaptor);
    assert_eq!(watcher.hello()["role"], "watcher");
    watcher.send(&json!({"id": "w", "order": squeeze(0.2)}));
    assert!(
        watcher.wait_for("error", |error| error["id"] == "w")["message"]
            .as_str()
            .unwrap()
            .contains("watches")
    );
    watcher.send(&json!({"id": "d", "drive": {}}));
    let refused = watcher.wait_for("error", |error| error["id"] == "d");
    assert!(refused["message"].as_str().unwrap().contains(name.as_str().unwrap()));
    let asked = driver.wait_for("wheel", |_| true);
    assert_eq!(asked["asked_by"], "c2");
    driver.send(&json!({"name": {"name": "Bo"}}));
    driver.send(&json!({"keep": {}}));
    assert_eq!(watcher.wait_for("kept", |_| true), json!({"by": name, "name": "Bo"}));
    driver.send(&json!({"keep": {}}));
    watcher.send(&json!({"id": "k", "keep": {}}));
    watcher.wait_for("error", |error| error["id"] == "k");
    let again = watcher.look_for("kept", Duration::from_millis(1), |_| true);
    assert_eq!(again, None, "who was answered did not ask again");
    driver.send(&json!({"id": "seen by both", "order": squeeze(0.2)}));
    solver.step_until_told(&mut watcher, "order", |order| {
        order["id"] == "seen by both" && order["status"] == "applied"
    });

    let begun = Instant::now();
    drop(driver);
    loop {
        watcher.send(&json!({"drive": {}}));
        if watcher
            .look_for("hello", Duration::from_millis(300), |hello| hello["role"] == "driver")
            .is_some()
        {
            break;
        }
        assert!(begun.elapsed() < PATIENCE, "the wheel never came free");
    }
    assert!(begun.elapsed() > Duration::from_secs(2), "the wheel is kept for a moment");
    watcher.send(&json!({"id": "mine", "order": {"undo": 1}}));
    solver.step_until_told(&mut watcher, "order", |order| {
        order["id"] == "mine" && order["status"] == "applied"
    });
    assert!(solver.is_at_reference());
}

#[test]
fn a_driver_that_comes_back_has_the_wheel() {
    let solver = Solver::with_config(LINK_TO_ALL);
    let mut driver = Viewer::connect(&solver.adaptor);
    let hello = driver.hello();
    let (name, back) = (hello["client"].as_str().unwrap(), hello["back"].as_str().unwrap());
    let mut watcher = Viewer::connect(&solver.adaptor);
    watcher.hello();
    drop(driver);
    watcher.wait_for("status", |status| status["viewers"] == 1);
    // The name alone is known to all.
    let link = socket_url(&solver.adaptor);
    let mut thief = Viewer::try_connect(&format!("{link}&client={name}&back=0")).unwrap();
    let told = thief.hello();
    assert!(told["role"] == "watcher" && told["client"] != name, "{told}");
    let mut again = Viewer::try_connect(&format!("{link}&client={name}&back={back}")).unwrap();
    let told = again.hello();
    assert!(told["role"] == "driver" && told["client"] == name, "{told}");
}

/// Also where nobody else is there who may drive.
#[test]
fn the_wheel_is_kept_for_a_driver_that_is_lost_and_not_for_one_that_has_closed() {
    let solver = Solver::with_config(LINK_TO_ALL);
    let link = socket_url(&solver.adaptor);
    let mut watcher = Viewer::try_connect(&format!("{link}&role=watch")).unwrap();
    watcher.hello();
    let mut driver = Viewer::connect(&solver.adaptor);
    let hello = driver.hello();
    let (name, back) = (hello["client"].as_str().unwrap(), hello["back"].as_str().unwrap());
    watcher.wait_for("status", |status| status["viewers"] == 2 && status["driver"] == name);
    watcher.seen.clear();
    let lost = Instant::now();
    drop(driver);
    watcher.wait_for("status", |status| status["viewers"] == 1);
    let mut other = Viewer::connect(&solver.adaptor);
    let role = other.hello()["role"].clone();
    // It is kept for three seconds, and no longer: a slow machine proves nothing here.
    if lost.elapsed() > Duration::from_millis(2500) {
        return;
    }
    assert_eq!(role, "watcher");
    let mut again = Viewer::try_connect(&format!("{link}&client={name}&back={back}")).unwrap();
    assert_eq!(again.hello()["role"], "driver");
    drop(other);
    watcher.seen.clear();
    again.send_message(Message::Close(None));
    watcher.wait_for("status", |status| status["driver"].is_null());
    assert_eq!(Viewer::connect(&solver.adaptor).hello()["role"], "driver");
}

#[test]
fn one_that_only_watches_never_has_the_wheel() {
    let mut solver = Solver::with_config(LINK_TO_ALL);
    solver.step();
    let url = format!("{}&role=watch", socket_url(&solver.adaptor));
    let mut watcher = Viewer::try_connect(&url).expect("connected");
    assert_eq!(watcher.hello()["role"], "watcher");
    watcher.send(&json!({"id": "a", "drive": {}}));
    watcher.wait_for("error", |error| error["id"] == "a");
    let mut driver = Viewer::connect(&solver.adaptor);
    assert_eq!(driver.hello()["role"], "driver");
    solver.finish();
}
