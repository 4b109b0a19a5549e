//! Trouble of every kind, met by whole programs: a clear error, the solver runs on, nothing changes
//! shape.

use std::io::{Read, Write};
use std::net::TcpListener;

use serde_json::{Value, json};
use tokio_tungstenite::tungstenite::Message as Wire;
use tombolo_tests::{Link, NOZZLE_FEATURES, PATIENCE, Run, Small, Viewer, program, tombolo};

/// A run that streams its surface, waits at its first step, and writes its mesh at its last.
fn paused() -> Small {
    let small = Small::new();
    small.write("pipelines.json", &paused_pipelines(0));
    small
}

fn paused_pipelines(port: u16) -> Value {
    json!({
        "version": 1,
        "stream": {"listen": format!("127.0.0.1:{port}")},
        "pipelines": [
            {"name": "surface", "every": {"steps": 1},
             "stages": [{"surface": {}}, {"stream": {"error": {"relative": 1e-3}}}]},
            {"name": "hold", "at": {"cycle": 2}, "stages": [{"pause": {}}]},
            {"name": "last", "at": {"cycle": 19}, "stages": [{"write": {"file": "last.vtu"}}]}
        ]
    })
}

/// The same run without the waiting.
fn unpaused() -> Small {
    let small = Small::new();
    let mut pipelines = paused_pipelines(0);
    pipelines["pipelines"].as_array_mut().expect("a list").remove(1);
    small.write("pipelines.json", &pipelines);
    small
}

fn start(small: &Small) -> (Run, Link) {
    let mut run = Run::flow(&small.arguments(&["--pipelines", "@pipelines.json", "--steps", "20"]));
    let link = run.link();
    (run, link)
}

/// Lets a paused run go on to its end: it must end well and say nothing of a panic.
fn finish(run: Run, mut driver: Viewer) -> String {
    driver.resume();
    let (status, text) = run.finish(PATIENCE);
    assert!(status.success(), "{text}");
    assert!(!text.contains("panicked"), "{text}");
    text
}

/// What `last.vtu` holds when nobody interferes.
fn undisturbed() -> Vec<u8> {
    let small = unpaused();
    let (status, text) =
        Run::flow(&small.arguments(&["--pipelines", "@pipelines.json", "--headless"]))
            .finish(PATIENCE);
    assert!(status.success(), "{text}");
    small.bytes("out/last.vtu")
}

/// Runs a program that must refuse its input: the exit code is not 0, and its errors say all of
/// this.
fn refused(name: &str, arguments: &[String], says: &[&str]) {
    let output = program(name).args(arguments).output().expect("the program starts");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success(), "{arguments:?} was accepted");
    for part in says {
        assert!(errors.contains(part), "{arguments:?}: '{part}' is not in:\n{errors}");
    }
    assert!(!errors.contains("panicked"), "{errors}");
}

#[test]
fn bad_json_is_answered_with_its_place() {
    let small = Small::new();
    std::fs::write(
        small.path("bad.json"),
        "{\n  \"version\": 1,\n  \"pipelines\": [\n    {\"name\": \"a\", \"stages\": [{\"slcie\": {}}]}\n  ]\n}",
    )
    .expect("a file can be written");
    let path = small.path("bad.json").display().to_string();
    let place = "bad.json:4:";
    refused(
        "tombolo",
        &["check".into(), path],
        &[place, "pipelines[0].stages[0]", "slcie", "slice"],
    );
    refused(
        "flow",
        &small.arguments(&["--pipelines", "@bad.json", "--headless"]),
        &[place, "slcie", "slice"],
    );

    std::fs::write(small.path("cut.json"), "{\"version\": 1, \"pipelines\": [")
        .expect("a file can be written");
    refused(
        "flow",
        &small.arguments(&["--pipelines", "@cut.json", "--headless"]),
        &["cut.json:1:"],
    );
    std::fs::write(small.path("case.json"), "{\"mesh\": \"nozzle.msh\", \"densty\": 1}")
        .expect("a file can be written");
    refused("flow", &small.arguments(&["--headless"]), &["case.json:1:", "densty", "density"]);
}

#[test]
fn a_missing_file_is_named() {
    let small = Small::new();
    refused(
        "flow",
        &small.arguments(&["--pipelines", "@nowhere.json", "--headless"]),
        &["nowhere.json"],
    );
    refused(
        "tombolo",
        &["mesh".into(), "info".into(), "/nowhere/mesh.vtu".into()],
        &["/nowhere/mesh.vtu"],
    );
}

#[test]
fn a_mesh_that_cannot_be_read_is_refused() {
    let small = Small::new();
    let whole = small.bytes("nozzle.msh");
    for (name, bytes) in [
        ("cut.msh", &whole[..whole.len() / 2]),
        (
            "cut.vtu",
            b"<VTKFile type=\"UnstructuredGrid\" version=\"1.0\"><UnstructuredGrid>".as_slice(),
        ),
        ("noise.msh", &[0xff, 0x00, 0x17, 0x80, 0x0a, 0x24]),
        ("noise.vtu", &[0xff, 0x00, 0x17, 0x80, 0x0a, 0x3c]),
        ("noise.vtk", &[0xff, 0x00, 0x17, 0x80, 0x0a, 0x23]),
        ("empty.msh", b""),
        ("mesh.stl", b"solid"),
    ] {
        std::fs::write(small.path(name), bytes).expect("a file can be written");
        refused(
            "tombolo",
            &["mesh".into(), "info".into(), small.path(name).display().to_string()],
            &[name],
        );
    }
    let mut case = small.read("case.json");
    case["mesh"] = "cut.msh".into();
    small.write("case.json", &case);
    refused("flow", &small.arguments(&["--headless"]), &["cut.msh"]);
}

/// The report of a run that is given an order of this edit at cycle 3.
fn report_of_order(small: &Small, edit: &Value) -> Value {
    small.write("orders.json", &json!([{"at": {"cycle": 3}, "order": {"edits": [edit]}}]));
    small.run(&["--pipelines @pipelines.json --orders @orders.json --headless"]).0
}

#[test]
fn an_unknown_feature_is_rejected_with_the_near_and_all_names() {
    let small = unpaused();
    let report = report_of_order(
        &small,
        &json!({"scale_direction": {"features": ["thraot"], "fixed": ["inlet"], "factors": [1, 1, 0.5]}}),
    );
    let order = &report["orders"][0];
    assert_eq!(order["status"], "rejected", "{report}");
    let reason = order["reason"].as_str().expect("a reason");
    assert!(reason.contains("thraot"), "{reason}");
    for feature in NOZZLE_FEATURES {
        assert!(reason.contains(feature), "'{feature}' is not in: {reason}");
    }
    assert_eq!(report["mesh"]["inverted"], 0);
    assert!(small.bytes("out/last.vtu") == undisturbed(), "a rejected order changed the run");
}

#[test]
fn numbers_that_are_none_are_refused_by_name() {
    let small = Small::new();
    for (text, says) in [
        (
            r#"[{"order": {"edits": [{"translate": {"features": ["throat"], "by": [0, NaN, 0]}}]}}]"#,
            "orders.json:1:",
        ),
        (
            r#"[{"order": {"edits": [{"translate": {"features": ["throat"], "by": [0, 1e999, 0]}}]}}]"#,
            "by[1]",
        ),
        (
            r#"[{"order": {"edits": [{"translate": {"features": ["throat"], "by": [0, null, 0]}}]}}]"#,
            "by[1]",
        ),
    ] {
        std::fs::write(small.path("orders.json"), text).expect("a file can be written");
        refused("flow", &small.arguments(&["--orders", "@orders.json", "--headless"]), &[says]);
    }
}

#[test]
fn a_port_in_use_is_named() {
    let taken = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let port = taken.local_addr().expect("a bound socket").port();
    let small = Small::new();
    small.write("pipelines.json", &paused_pipelines(port));
    let output = program("flow")
        .args(small.arguments(&["--pipelines", "@pipelines.json", "--steps", "20"]))
        .output()
        .expect("flow starts");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(errors.contains(&format!("127.0.0.1:{port}")) && errors.contains("in use"), "{errors}");
    assert!(!errors.contains("panicked"), "{errors}");
}

#[test]
fn a_wrong_token_lets_nobody_in() {
    let small = paused();
    let (run, link) = start(&small);
    for token in ["", "0", "00000000000000000000000000000000", "%00", &link.token[1..]] {
        let refusal = Viewer::connect(&link.with_token(token))
            .err()
            .unwrap_or_else(|| panic!("'{token}' lets in"));
        assert!(refusal.contains("401"), "{refusal}");
    }
    let mut stream = link.tcp();
    write!(
        stream,
        "GET /ws?token=wrong HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n\r\n",
        link.address
    )
    .expect("the run listens");
    let mut answer = String::new();
    let _ = stream.read_to_string(&mut answer);
    assert!(answer.starts_with("HTTP/1.1 401"), "{answer}");
    assert!(!answer.contains(&link.token), "the answer tells the token");
    let driver = Viewer::connect(&link).expect("the right token lets in");
    finish(run, driver);
    assert!(small.bytes("out/last.vtu") == undisturbed());
}

/// Batch systems hand secrets on in the environment.
#[test]
fn secrets_of_the_environment_let_in_and_are_not_printed() {
    let (driving, watching) = ("DrivingSecretOfTheTest1", "WatchingSecretOfTheTest2");
    let small = paused();
    let mut run = Run::start(
        program("flow")
            .args(small.arguments(&["--pipelines", "@pipelines.json", "--steps", "20"]))
            .env("TOMBOLO_DRIVING_SECRET", driving)
            .env("TOMBOLO_WATCHING_SECRET", watching),
    );
    let link = run.link();
    assert_eq!(link.token, driving);
    // The one that watches is the first to come, and does not drive.
    let mut watcher = Viewer::connect(&link.with_token(watching)).expect("the run lets in");
    let hello = watcher.wait_for("hello", |_| true);
    assert_eq!((&hello["role"], &hello["may_drive"]), (&json!("watcher"), &json!(false)));
    let mut driver = Viewer::connect(&link.with_token(driving)).expect("the run lets in");
    driver.wait_for("hello", |hello| hello["role"] == "driver" && hello["may_drive"] == true);
    let text = finish(run, driver);
    for secret in [driving, watching] {
        assert!(!text.contains(secret), "{text}");
    }
}

#[test]
fn a_viewer_that_dies_in_mid_frame_costs_nothing() {
    let small = paused();
    let (run, link) = start(&small);
    for _ in 0..5 {
        // A handshake by hand, a few bytes of what follows, and the line is cut.
        let mut stream = link.tcp();
        write!(
            stream,
            "GET /ws?token={} HTTP/1.1\r\nHost: {}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n\
             Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n",
            link.token, link.address
        )
        .expect("the run listens");
        let mut some = [0; 400];
        stream.read_exact(&mut some).expect("the run answers");
        assert!(some.starts_with(b"HTTP/1.1 101"), "{}", String::from_utf8_lossy(&some));
    }
    let mut dead = Viewer::connect(&link).expect("the run lets in");
    dead.wait_for("hello", |_| true);
    dead.kill();
    // The wheel is free again a few seconds after its holder has gone.
    let mut driver = Viewer::connect(&link).expect("the run lets in");
    driver.take_wheel();
    let mut other = Viewer::connect(&link).expect("the run lets in");
    assert!(other.frame().starts_with(b"TMBL"));
    // Not before the run holds by itself: it would hold again after a pause and a resume that come
    // earlier.
    driver.wait_for("status", |status| status["paused"] == true && status["cycle"] == 2);
    driver.send(&json!({"id": "after", "pause": {}}));
    finish(run, driver);
    assert!(small.bytes("out/last.vtu") == undisturbed());
}

#[test]
fn garbage_on_the_port_changes_nothing() {
    let small = paused();
    let (mut run, link) = start(&small);
    let mut noise = vec![0u8; 1 << 16];
    fastrand::Rng::with_seed(1).fill(&mut noise);
    let long_line = [b"GET /".as_slice(), &[b'a'; 1 << 16], b" HTTP/1.1\r\n\r\n"].concat();
    for bytes in [
        noise.as_slice(),
        b"\r\n\r\n\r\n",
        b"GET / HTTP/9.9\r\n\r\n",
        b"POST /ws HTTP/1.1\r\nContent-Length: 99999999999999999999\r\n\r\n",
        b"GET /../../../../etc/passwd HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n",
        b"GET /%2e%2e/%2e%2e/etc/passwd HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n",
        &long_line,
        b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03",
    ] {
        let mut stream = link.tcp();
        let _ = stream.write_all(bytes);
        let _ = stream.shutdown(std::net::Shutdown::Write);
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        assert!(
            !String::from_utf8_lossy(&answer).contains("root:"),
            "a file of the machine was served"
        );
    }

    let mut driver = Viewer::connect(&link).expect("the run lets in");
    driver.wait_for("hello", |hello| hello["role"] == "driver");
    for (text, says) in [
        ("", ""),
        ("null", ""),
        ("[]", ""),
        ("{", ""),
        (r#"{"oder": {}}"#, "order"),
        (
            r#"{"order": {"edits": [{"translate": {"features": ["throat"], "by": [0, 1e999, 0]}}]}}"#,
            "by[1]",
        ),
        (r#"{"order": {"edits": [{"translate": {"features": ["throat"], "by": [0, 0]}}]}}"#, "by"),
        (
            r#"{"order": {"edits": [{"translat": {"features": ["throat"], "by": [0, 0, 0]}}]}}"#,
            "translate",
        ),
        (r#"{"order": {"undo": -1}}"#, "undo"),
        (r#"{"pause": {}, "stop": {}}"#, ""),
        (r#"{"parameter": {"name": "no such", "value": 1}}"#, "no such"),
    ] {
        driver.send_raw(Wire::text(text));
        let error = driver.wait_for("error", |_| true);
        let message = error["message"].as_str().expect("a message");
        assert!(!message.is_empty() && message.contains(says), "{text}: {message}");
    }
    let deep = format!("{}{}", "[".repeat(20_000), "]".repeat(20_000));
    driver.send_raw(Wire::text(deep));
    driver.wait_for("error", |_| true);
    driver.send_raw(Wire::Binary(noise[..1000].to_vec().into()));
    driver.wait_for("error", |_| true);
    assert!(run.is_running(), "{}", run.text());
    finish(run, driver);
    assert!(small.bytes("out/last.vtu") == undisturbed());
}

#[test]
fn an_order_that_would_break_the_mesh_is_refused_and_the_solver_runs_on() {
    let small = unpaused();
    let report = report_of_order(
        &small,
        &json!({"scale_direction": {"features": ["throat"], "fixed": ["inlet", "outlet"], "factors": [1, 1, -0.5]}}),
    );
    assert_eq!(report["orders"][0]["status"], "rejected", "{report}");
    assert!(report["orders"][0]["cycle_applied"].is_null(), "{report}");
    assert!(small.bytes("out/last.vtu") == undisturbed(), "a rejected order changed the run");
}

#[test]
fn edits_offline_meet_the_same_errors() {
    let small = Small::new();
    small.write(
        "edits.json",
        &json!([{"translate": {"features": ["outlat"], "fixed": ["inlet"], "by": [0, 0, 0.1]}}]),
    );
    let path = |name: &str| small.path(name).display().to_string();
    let output = tombolo(&[
        "edit",
        "--mesh",
        &path("nozzle.msh"),
        "--edits",
        &path("edits.json"),
        "--out",
        &path("new.vtu"),
    ]);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(
        !output.status.success() && errors.contains("outlat") && errors.contains("outlet"),
        "{errors}"
    );
    assert!(!small.path("new.vtu").exists(), "a refused edit wrote a mesh");
}

/// Orders of a file are held to what viewers are, and refused before the run begins.
#[test]
fn flow_refuses_orders_beyond_the_limits() {
    let small = unpaused();
    let edit =
        json!({"translate": {"features": ["throat"], "fixed": ["inlet"], "by": [0, 0, 1e-6]}});
    for (order, named) in [
        (
            json!({"edits": [edit], "schedule": {"steps": 1_000_000_000}}),
            "found 1000000000 shapes, expected at most 10000",
        ),
        (
            json!({"edits": [edit], "schedule": {"steps": u32::MAX}}),
            "found 4294967295 shapes, expected at most 10000",
        ),
        (json!({"edits": vec![edit.clone(); 20_000]}), "found 20000 edits, expected at most 16384"),
    ] {
        small.write("orders.json", &json!([{"order": order}]));
        let arguments =
            small.arguments(&["--pipelines @pipelines.json --headless --orders @orders.json"]);
        let (status, text) = Run::flow(&arguments).finish(PATIENCE);
        assert!(!status.success() && text.contains(named) && !text.contains("panicked"), "{text}");
    }
}
