//! The program `tombolo` at a run that is reached through its link.

mod common;

use std::{path::Path, process::Output, time::Instant};

use common::{
    LINK_TO_ALL, PATIENCE,
    program::tombolo,
    proxy::Proxy,
    running::{MONITORED, Run, until},
    squeeze,
};
use serde_json::Value;
use tombolo::{
    OrderStatus,
    client::{Client, Drives, Event, Options},
};

fn lines(output: &Output) -> Vec<Value> {
    let text = String::from_utf8_lossy(&output.stdout);
    text.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
}

#[test]
fn the_program_reaches_a_run() {
    let run = Run::new(MONITORED);
    let directory = tempfile::tempdir().expect("a directory");
    let write = |name: &str, text: &str| {
        std::fs::write(directory.path().join(name), text).expect("written");
    };
    write("link.txt", &format!("viewer: {}\n", run.link));
    write("squeeze.json", &squeeze(0.3).to_string());
    write("too-far.json", &squeeze(1.5).to_string());
    write("nothing.json", "[]");
    write("slip.json", r#"[{"translate": {"featurs": ["z-max"], "by": [0, 0, 1]}}]"#);
    let call = |arguments: &[&str]| tombolo(directory.path(), arguments);
    for (arguments, code, expected) in [
        (&["status", "link.txt"][..], 0, "running: cycle"),
        (&["doctor", "link.txt"], 0, "token: ok"),
        (&["link", "link.txt"], 0, "/?key="),
        (&["link", "link.txt", "--for", "drive", "--json"], 0, "{\"link\":{\"address\":\"http://"),
        (&["link", "link.txt", "--for", "look"], 2, "watch"),
        (&["forecast", "link.txt", "squeeze.json"], 0, "would be applied"),
        (&["forecast", "link.txt", "too-far.json"], 1, "would be rejected"),
        (&["order", "link.txt", "squeeze.json", "--wait"], 0, "applied"),
        (&["order", "link.txt", "too-far.json", "--wait"], 1, "rejected"),
        (&["order", "link.txt", "slip.json"], 1, "did you mean `features`?"),
        (&["order", "link.txt", "nothing.json"], 2, "nothing.json: expected at least one edit"),
        (&["undo", "link.txt", "--wait"], 0, "applied"),
        (&["set", "link.txt", "inflow", "2"], 0, ""),
        (&["set", "link.txt", "inflow", "NaN"], 2, "expected a number"),
        (&["set", "link.txt", "inflaw", "2"], 1, "inflow"),
        (&["pause", "link.txt"], 0, "paused"),
        (&["resume", "link.txt"], 0, ""),
        (&["cancel", "link.txt", "no-such-order"], 1, "no-such-order"),
        (&["status"], 2, "LINK"),
        (&["status", "nonsense"], 2, "expected http://HOST:PORT/?token=TOKEN"),
        (&["doctor", "http://127.0.0.1:1/?token=a"], 2, "ssh -L 1:127.0.0.1:1 HOST"),
    ] {
        let (found, said, _) = call(arguments);
        assert!(found == code && said.contains(expected), "{arguments:?}: {found}: {said}");
    }
    let (code, _, output) = call(&["status", "link.txt", "--json"]);
    assert!(code == 0 && lines(&output)[0]["status"]["cycle"].is_u64());
    let (code, _, output) = call(&["order", "link.txt", "squeeze.json", "--wait", "--json"]);
    let told = lines(&output);
    assert_eq!((code, &told.last().expect("a line")["order"]["status"]), (0, &"applied".into()));
    let (code, _, output) =
        call(&["doctor", &run.link.to_string().replace("token=", "token=x"), "--json"]);
    let told = lines(&output);
    assert_eq!((code, &told[4]["step"], &told[4]["ok"]), (2, &"token".into(), &false.into()));

    let held = Client::connect(&run.link, &Options::default()).expect("connected");
    held.drive(PATIENCE).expect("the wheel");
    let (code, said, _) = call(&["pause", "link.txt"]);
    assert!(code == 1 && said.contains("has the wheel"), "{said}");
    drop(held);

    let watching = std::thread::scope(|scope| {
        let watching = scope.spawn(|| call(&["watch", "link.txt", "--json"]));
        // Told to stop once the watching program is there.
        let other = Client::connect(&run.link, &Options::default()).expect("connected");
        other.wait_for_status(PATIENCE, |status| status.viewers >= 2).expect("a watcher");
        run.solver.stop();
        watching.join().expect("no panic")
    });
    let told = lines(&watching.2);
    assert_eq!((watching.0, &told.last().expect("a line")["end"]["how"]), (0, &"finished".into()));
    assert_eq!(run.end().orders.len(), 4);
}

#[test]
fn the_program_waits_until_a_command_has_taken_effect() {
    let run = Run::new(LINK_TO_ALL);
    let watches = Options { drives: Drives::Never, ..Options::default() };
    let watching = Client::connect(&run.link, &watches).expect("connected");
    run.solver.rest(4000);
    let cycle = watching.wait_for_status(PATIENCE, |_| true).expect("a status").cycle;
    let status = watching.wait_for_status(PATIENCE, |status| status.cycle > cycle + 1);
    let cycle = status.expect("a step").cycle;
    let (code, said, _) =
        tombolo(Path::new("."), &["set", &run.link.to_string(), "inflow", "2", "--json"]);
    let told: Value = serde_json::from_str(&said).expect("JSON");
    let at = told["done"]["cycle"].as_u64();
    assert!(code == 0 && at.is_some_and(|at| at > cycle), "{code}: {said}");
    run.solver.rest(2);
    drop(watching);
    run.end();
}

#[test]
fn the_program_lists_what_waits_and_replaces_it() {
    let run = Run::new(LINK_TO_ALL);
    let directory = tempfile::tempdir().expect("a directory");
    for (name, by) in [("second.json", 0.2), ("better.json", 0.05)] {
        std::fs::write(directory.path().join(name), squeeze(by).to_string()).expect("written");
    }
    let link = run.link.to_string();
    let call = |task: &str, arguments: &[&str]| {
        let (code, said, output) =
            tombolo(directory.path(), &[&[task, link.as_str()], arguments, &["--json"]].concat());
        (code, said, lines(&output))
    };
    let given = |task: &str, arguments: &[&str]| {
        let (code, said, told) = call(task, arguments);
        assert_eq!(code, 0, "{task} {arguments:?}: {said}");
        told[0]["order"]["id"].as_str().expect("a name").to_owned()
    };
    let watches = Options { drives: Drives::Never, ..Options::default() };
    let watching = Client::connect(&run.link, &watches).expect("connected");
    // All of it comes while the solver computes one step.
    let rest = 900_000;
    run.solver.rest(rest);
    run.solver.wait_for_rest(rest);
    let second = given("order", &["second.json"]);
    let (code, said, _) = tombolo(directory.path(), &["queue", link.as_str()]);
    let expected = format!("order {second}: waits for the solver's next call, since cycle");
    assert!(code == 0 && said.contains(&expected), "{said}");
    // The program waits for the next call, which comes once the order is there.
    let better = std::thread::scope(|scope| {
        let better = scope.spawn(|| given("replace", &[&second, "better.json"]));
        until(&watching, "the better order", |told| match &told.event {
            Event::Order(order) if order.id != second => Some(()),
            _ => None,
        });
        run.solver.rest(2);
        better.join().expect("no panic")
    });
    let begun = Instant::now();
    while tombolo(directory.path(), &["queue", link.as_str()]).1 != "no order waits\n" {
        assert!(begun.elapsed() < PATIENCE, "it never moves the mesh");
    }
    for (order, reason) in [
        (second.as_str(), "no longer waits"),
        (better.as_str(), "no longer waits"),
        ("nobody", "there is no order 'nobody'"),
    ] {
        let (code, said, _) = call("replace", &[order, "second.json"]);
        assert!(code == 1 && said.contains(reason), "{order}: {code}: {said}");
    }
    let orders = run.end().orders;
    let of = |id: &str| orders.iter().find(|order| order.id == id).expect("it was taken");
    let reason = of(&second).reason.as_deref().unwrap_or_default();
    assert!(reason.contains(&format!("replaced by order {better}")), "{reason}");
    assert_eq!(of(&better).status, OrderStatus::Applied);
}

/// The run keeps an order whose giver has lost the connection; the program says so and waits on.
#[test]
fn the_program_says_when_its_connection_is_lost_and_waits_on() {
    let run = Run::new(LINK_TO_ALL);
    let proxy = Proxy::to(run.address);
    let directory = tempfile::tempdir().expect("a directory");
    std::fs::write(directory.path().join("order.json"), squeeze(0.2).to_string()).expect("written");
    let rest = 900_000;
    run.solver.rest(rest);
    run.solver.wait_for_rest(rest);
    let link = run.over(proxy.port).to_string();
    let watches = Options { drives: Drives::Never, ..Options::default() };
    let watching = Client::connect(&run.link, &watches).expect("connected");
    let (code, said, _) = std::thread::scope(|scope| {
        let order =
            scope.spawn(|| tombolo(directory.path(), &["order", &link, "order.json", "--wait"]));
        until(&watching, "the order", |told| matches!(told.event, Event::Order(_)).then_some(()));
        proxy.drop_all();
        watching.wait_for_status(PATIENCE, |status| status.viewers >= 2).expect("it is back");
        run.solver.rest(2);
        order.join().expect("no panic")
    });
    assert!(code == 0 && said.contains("applied"), "{code}: {said}");
    assert!(said.contains("the run keeps orders that it has taken"), "{said}");
    drop(watching);
    assert_eq!(run.end().orders.len(), 1);
}
