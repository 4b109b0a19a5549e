//! Viewers, good and bad: what they are shown, what they can do, and that none of it costs the
//! solver.

mod common;

use std::{
    io::{Read, Write},
    net::TcpStream,
    path::Path,
    time::{Duration, Instant},
};

use common::{LINK_TO_ALL, PATIENCE, Solver, Viewer, bits, config, socket_url, squeeze};
use serde_json::{Value, json};
use tokio_tungstenite::tungstenite::{Error, Message};
use tombolo::{
    Adaptor, Condition, InitializeError, OrderStatus, Parameter, Settings,
    pipelines::{
        encode::{Decoder, decode_surface},
        language::{self, parse_journal, parse_orders},
        limits::{DOCUMENT, EDITS, SHAPES},
    },
    stream::StreamError,
};

/// Bytes of a message that are read of a viewer that does not drive.
const UNDRIVEN: usize = 16 << 10;

/// Sends raw bytes and reads the answer until the server closes.
fn raw(adaptor: &Adaptor, bytes: &[u8]) -> String {
    String::from_utf8_lossy(&answer(adaptor, bytes)).into_owned()
}

fn answer(adaptor: &Adaptor, bytes: &[u8]) -> Vec<u8> {
    let mut stream = TcpStream::connect(adaptor.address().expect("a server")).expect("connected");
    stream.set_read_timeout(Some(Duration::from_secs(20))).expect("a timeout");
    stream.write_all(bytes).expect("sent");
    let mut answer = Vec::new();
    let _ = stream.read_to_end(&mut answer);
    answer
}

fn get(adaptor: &Adaptor, path: &str, headers: &str) -> String {
    raw(
        adaptor,
        format!("GET {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n{headers}\r\n")
            .as_bytes(),
    )
}

fn status_of(error: &Error) -> Option<u16> {
    match error {
        Error::Http(response) => Some(response.status().as_u16()),
        _ => None,
    }
}

/// Frames that come within a second, while the solver steps.
fn frames_within_a_second(solver: &mut Solver, viewer: &mut Viewer) -> usize {
    let (before, begun) = (viewer.frames.len(), Instant::now());
    while begun.elapsed() < Duration::from_secs(1) {
        solver.step();
        let _ = viewer.look_for("nothing", Duration::from_millis(5), |_| false);
    }
    viewer.frames.len() - before
}

#[test]
fn a_viewer_that_counts_its_frames_is_sent_no_more_than_it_takes() {
    let mut solver = Solver::with_config(LINK_TO_ALL);
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    assert!(frames_within_a_second(&mut solver, &mut viewer) > 2, "nothing holds them back");
    let acknowledge = |viewer: &mut Viewer| {
        let count = viewer.frames.len() as u64;
        viewer.send_message(Message::binary(count.to_le_bytes().to_vec()));
    };
    acknowledge(&mut viewer);
    let _ = frames_within_a_second(&mut solver, &mut viewer);
    assert_eq!(frames_within_a_second(&mut solver, &mut viewer), 0, "two are on their way");
    let (held, cycle) = (viewer.frames.len(), solver.cycle);
    acknowledge(&mut viewer);
    let _ = frames_within_a_second(&mut solver, &mut viewer);
    acknowledge(&mut viewer);
    while viewer.frames.len() < held + 3 {
        let _ = frames_within_a_second(&mut solver, &mut viewer);
    }
    // What it missed it missed: everything that came can be read, and the last of it is new.
    let mut decoder = Decoder::new();
    let cycles: Vec<u64> =
        viewer.frames.iter().map(|frame| decoder.decode(frame).expect("a frame").cycle).collect();
    assert!(cycles.is_sorted(), "{cycles:?}");
    assert!(cycles[held + 2] >= cycle, "{cycles:?}, held back at {held} and cycle {cycle}");
    // A number that says nothing new, or too much, is an error.
    for count in [0, 1 << 40] {
        viewer.send_message(Message::binary(u64::to_le_bytes(count).to_vec()));
        let error = solver.step_until_told(&mut viewer, "error", |_| true);
        let message = error["message"].as_str().unwrap_or_default();
        assert!(message.contains("the number of frames decoded"), "{error}");
    }
    solver.finish();
}

#[test]
fn a_late_viewer_needs_one_message() {
    let mut solver = Solver::with_config(LINK_TO_ALL);
    let mut early = Viewer::connect(&solver.adaptor);
    early.hello();
    let _ = frames_within_a_second(&mut solver, &mut early);
    // No step is made for it: it is sent what is there.
    let mut late = Viewer::connect(&solver.adaptor);
    late.hello();
    let begun = Instant::now();
    while late.frames.is_empty() && begun.elapsed() < PATIENCE {
        let _ = late.look_for("nothing", Duration::from_millis(20), |_| false);
    }
    let mut decoder = Decoder::new();
    let first = decoder.decode(&late.frames[0]).expect("the first message is enough");
    assert_eq!((first.cycle, first.cells.is_some()), (solver.cycle - 1, true));
    let _ = frames_within_a_second(&mut solver, &mut late);
    let _ = early.look_for("nothing", Duration::from_millis(100), |_| false);
    assert!(late.frames[1..].iter().all(|frame| decoder.decode(frame).is_ok()));
    let mut decoder = Decoder::new();
    assert!(early.frames.iter().all(|frame| decoder.decode(frame).is_ok()));
    solver.finish();
}

#[test]
fn viewers_know_what_the_features_are_to_the_flow_and_what_can_be_taken_back() {
    let settings = Settings { config: config(LINK_TO_ALL), ..Settings::default() }
        .condition("x-min", Condition::Inflow)
        .condition("x-max", Condition::Outflow)
        .condition("z-mox", Condition::Wall);
    let mut solver = Solver::new(settings);
    let mut viewer = Viewer::connect(&solver.adaptor);
    assert_eq!(viewer.hello()["stack"]["undoable"], 0);
    solver.step();
    let error = viewer.wait_for("error", |error| error["id"].is_null());
    let message = error["message"].as_str().unwrap();
    assert!(message.contains("no feature 'z-mox' (did you mean 'z-max'?)"), "{message}");
    let hello = viewer.wait_for("hello", |hello| hello["features"][0].is_object());
    let conditions: Vec<(&Value, &Value)> = hello["features"]
        .as_array()
        .unwrap()
        .iter()
        .map(|feature| (&feature["name"], &feature["condition"]))
        .collect();
    assert_eq!(
        conditions[..3],
        [
            (&json!("x-min"), &json!("inflow")),
            (&json!("x-max"), &json!("outflow")),
            (&json!("y-min"), &Value::Null)
        ]
    );
    assert!(hello.get("stack").is_none(), "it is told once, and then its changes");
    viewer.send(&json!({"id": "squeeze", "order": squeeze(0.1)}));
    solver.step_until_told(&mut viewer, "order", |order| order["status"] == "applied");
    viewer.send(&json!({"id": "clear", "order": {"stack": []}}));
    solver.step_until_told(&mut viewer, "stack", |stack| {
        stack["edits"] == 0 && stack["undoable"] == 2
    });
    solver.finish();
}

#[test]
fn a_viewer_sees_the_run_and_changes_its_shape() {
    let parameter = Parameter { name: "inflow".into(), value: 1.0, minimum: 0.0, maximum: 10.0 };
    let with_unit = |unit: &str| {
        let units = format!(r#"{{"version": 1, "units": {{"speed": "{unit}"}},"#);
        LINK_TO_ALL.replacen(r#"{"version": 1,"#, &units, 1)
    };
    let wrong = tombolo::pipelines::language::parse(&with_unit(" "), "run.json");
    assert!(wrong.is_err_and(|error| error.to_string().contains("units.speed: expected a unit")));
    let mut solver = Solver::new(Settings {
        config: config(&with_unit("m/s")),
        parameters: vec![parameter],
        ..Settings::default()
    });
    solver.step();
    let mut viewer = Viewer::connect(&solver.adaptor);
    let hello = viewer.hello();
    assert_eq!((&hello["protocol"], &hello["role"]), (&json!(2), &json!("driver")));
    assert_eq!(hello["views"], json!([{"name": "boundary", "kind": "surface"}]));
    assert_eq!(
        hello["fields"],
        json!([{"name": "speed", "association": "vertex", "components": 1, "unit": "m/s"}])
    );
    assert_eq!(hello["features"][5]["name"], "z-max");
    assert_eq!(hello["features"][5]["faces"], 32);
    assert_eq!(hello["features"][5]["vertices"], 25);
    assert_eq!(hello["features"][5]["bounds"], json!([[0.0, 0.0, 1.0], [1.0, 1.0, 1.0]]));
    assert_eq!(hello["parameters"][0]["maximum"], 10.0);
    assert_eq!(hello["stack"], json!({"revision": 0, "edits": 0, "undoable": 0}));
    assert_eq!(hello["orders"], json!([]));
    assert!(hello["defaults"]["schedule"]["steps"].is_number());

    viewer.send(&json!({"id": "squeeze", "order": squeeze(0.3)}));
    let accepted = viewer.wait_for("order", |order| order["id"] == "squeeze");
    assert_eq!(accepted["status"], "accepted");
    assert_eq!(accepted["order"]["edits"][0]["translate"]["by"], json!([0.0, 0.0, -0.3]));
    let applied =
        solver.step_until_told(&mut viewer, "order", |order| order["status"] == "applied");
    assert_eq!(
        (&applied["shape"], &applied["shapes"], &applied["reason"]),
        (&json!(1), &json!(1), &Value::Null)
    );
    assert!(
        applied["cycle_applied"].is_u64() && applied["min_scaled_jacobian"].as_f64() > Some(0.02)
    );
    assert!(solver.mesh.points().contains(&[0.0, 0.0, 0.7]), "the lid has come down");
    let stack = viewer.wait_for("stack", |_| true);
    assert_eq!(stack, json!({"revision": 1, "edits": 1, "kept": 0, "undoable": 1}));

    viewer.send(&json!({"id": "set", "parameter": {"name": "inflow", "value": 2.0}}));
    solver.step_until_told(&mut viewer, "done", |done| done["id"] == "set");
    // What has changed alone, before it is done.
    let told = |key: &str| viewer.seen.iter().filter_map(|it| it.get(key)).collect::<Vec<_>>();
    assert_eq!(told("parameters"), [&json!({"values": {"inflow": 2.0}})]);
    assert!(told("hello").is_empty(), "a parameter sent a hello");
    let late = Viewer::connect(&solver.adaptor).hello();
    assert_eq!(late["parameters"][0]["value"], 2.0);
    viewer.send(&json!({"id": "back", "order": {"undo": 1}}));
    solver.step_until_told(&mut viewer, "order", |order| {
        order["id"] == "back" && order["status"] == "applied"
    });
    assert!(solver.is_at_reference());
    assert_eq!(solver.parameters, [("inflow".to_owned(), 2.0)]);
    let status =
        solver.step_until_told(&mut viewer, "status", |status| !status["quality"].is_null());
    assert_eq!(status["quality"]["inverted"], 0);
    assert_eq!(
        (&status["viewers"], &status["driver"], &status["paused"]),
        (&json!(1), &hello["client"], &json!(false))
    );

    assert!(viewer.frames.len() >= 2);
    let mut decoder = Decoder::new();
    let mut squeezed = 0;
    for (index, frame) in viewer.frames.iter().enumerate() {
        let data = decoder.decode(frame).expect("every frame can be read");
        assert_eq!((data.view.as_str(), data.points.len()), ("boundary", 98));
        assert_eq!(data.cells.is_some(), index == 0, "the topology comes first, and once");
        let height = data.points.iter().map(|point| point[2]).fold(0.0, f64::max);
        squeezed += usize::from((height - 0.7).abs() < 1e-4);
        assert!((height - 0.7).abs() < 1e-4 || (height - 1.0).abs() < 1e-4, "{height}");
    }
    assert!(squeezed > 0, "the new shape was seen");
    let report = solver.finish();
    assert_eq!(report.orders.len(), 2);
    assert!(
        report.stream.frames > 0
            && report.stream.bytes > 0
            && report.stream.raw_bytes > report.stream.bytes
    );
    viewer.wait_for_end();
}

#[test]
fn a_forecast_is_told_while_the_solver_is_busy_and_changes_nothing() {
    let mut solver = Solver::with_config(LINK_TO_ALL);
    solver.step();
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    // Nothing steps the solver here: the answers come from the worker.
    viewer.send(&json!({"id": "f1", "forecast": squeeze(0.3)}));
    let told = viewer.wait_for("forecast", |forecast| forecast["id"] == "f1");
    assert_eq!(told["order"]["outcome"], "applied", "{told}");
    assert_eq!(told["order"]["quality"]["inverted"], 0);
    viewer.send(&json!({"id": "f2", "forecast": squeeze(1.5)}));
    let refused = viewer.wait_for("forecast", |forecast| forecast["id"] == "f2");
    assert_eq!(refused["order"]["outcome"], "rejected");
    assert!(
        refused["order"]["fraction"].as_f64().is_some_and(|fraction| fraction < 0.7),
        "{refused}"
    );
    viewer.send(&json!({"id": "f3", "forecast": {"undo": 1}}));
    let nothing = viewer.wait_for("forecast", |forecast| forecast["id"] == "f3");
    assert!(
        nothing["order"]["reason"].as_str().is_some_and(|reason| reason.contains("undo")),
        "{nothing}"
    );
    viewer.send(&json!({"id": "f4", "forecast": {"edits": []}}));
    assert!(viewer.wait_for("error", |error| error["id"] == "f4")["message"].as_str().is_some());
    // None is left without an answer, also where a later one takes its place.
    let ids: Vec<String> = (0..30).map(|number| format!("many-{number}")).collect();
    for (id, number) in ids.iter().zip(1..) {
        viewer.send(&json!({"id": id, "forecast": squeeze(0.01 * f64::from(number))}));
    }
    viewer.wait_for("forecast", |forecast| forecast["id"] == ids[29].as_str());
    let mut overtaken = 0;
    for id in &ids[..29] {
        let short = Duration::from_millis(1);
        if viewer.look_for("forecast", short, |forecast| forecast["id"] == id.as_str()).is_none() {
            let error = viewer.wait_for("error", |error| error["id"] == id.as_str());
            let message = error["message"].as_str().unwrap_or_default();
            assert!(message.contains("a later forecast"), "{error}");
            overtaken += 1;
        }
    }
    assert!(overtaken > 0, "each was begun before the next came");
    solver.step();
    assert!(solver.is_at_reference());

    viewer.send(&json!({"id": "squeeze", "order": squeeze(0.3)}));
    let applied =
        solver.step_until_told(&mut viewer, "order", |order| order["status"] == "applied");
    for key in ["min_scaled_jacobian", "largest_displacement", "shapes"] {
        assert_eq!(applied[key], told["order"][key], "{key}");
    }
    let mut other = Solver::new(Settings {
        orders: parse_orders(&json!([{"order": squeeze(0.3)}]).to_string(), "orders.json")
            .expect("orders"),
        ..Settings::default()
    });
    other.step();
    assert_eq!(bits(&solver.mesh), bits(&other.mesh));
    assert_eq!(solver.finish().orders.len(), 1);
}

#[test]
fn what_a_viewer_gets_wrong_is_told_and_changes_nothing() {
    let mut solver = Solver::with_config(LINK_TO_ALL);
    solver.step();
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    for (message, named) in [
        ("not json", "message:1:1"),
        ("", "message:1:1"),
        ("[]", "message"),
        (r#"{"ordr": {"undo": 1}}"#, "order"),
        (
            r#"{"order": {"edits": [{"translate": {"features": ["z-max"], "by": [NaN, 0, 0]}}]}}"#,
            "NaN",
        ),
        (
            r#"{"order": {"edits": [{"translate": {"features": ["z-max"], "by": [1e999, 0, 0]}}]}}"#,
            "1e999",
        ),
        (
            r#"{"order": {"edits": [{"translate": {"feature": ["z-max"], "by": [0, 0, 0]}}]}}"#,
            "features",
        ),
        (
            r#"{"order": {"edits": [{"rotate": {"features": ["z-max"], "axis": [0, 0, 0], "degrees": 1}}]}}"#,
            "axis",
        ),
        (
            r#"{"order": {"edits": [{"displacement": {"file": "/etc/hostname"}}]}}"#,
            "names no files of this machine",
        ),
        (r#"{"order": {"undo": 1}, "stop": {}}"#, "message"),
        (r#"{"id": 3, "pause": {}}"#, "id"),
        (r#"{"parameter": {"name": "nothing", "value": 1}}"#, "nothing"),
    ] {
        viewer.send_text(message);
        solver.step_until_told(&mut viewer, "error", |error| {
            error["message"].as_str().unwrap().contains(named)
        });
    }
    viewer.send_message(Message::binary(vec![0, 1, 2]));
    viewer.wait_for("error", |error| error["message"].as_str().unwrap().contains("binary"));
    for (edit, named) in [
        (json!({"translate": {"features": ["z-mox"], "by": [0.0, 0.0, 0.1]}}), "z-max"),
        (
            json!({"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0.0, 0.0, -1.2]}}),
            "feasible",
        ),
    ] {
        viewer.send(&json!({"order": {"edits": [edit]}}));
        let order =
            solver.step_until_told(&mut viewer, "order", |order| order["status"] == "rejected");
        assert!(order["reason"].as_str().unwrap().contains(named), "{order}");
    }
    viewer.send(&json!({"id": "same", "order": {"stack": []}}));
    viewer.send(&json!({"id": "same", "order": {"undo": 1}}));
    viewer.wait_for("error", |error| error["id"] == "same");
    solver.steps(3);
    assert!(solver.is_at_reference() && !solver.stopped);
}

#[test]
fn the_reference_surface_is_there_for_those_with_the_token_bit_for_bit() {
    let mut solver = Solver::new(Settings { config: config(LINK_TO_ALL), ..Settings::default() });
    let link = solver.adaptor.link().expect("a link");
    let token = link.split_once('?').expect("a token").1;
    let path = format!("/surface?{token}");
    assert!(
        get(&solver.adaptor, &path, "").starts_with("HTTP/1.1 404"),
        "there is no mesh before the first step"
    );
    solver.step();
    for wrong in ["/surface", "/surface?token=", "/surface?token=0123", &format!("{path}0")] {
        assert!(get(&solver.adaptor, wrong, "").starts_with("HTTP/1.1 401"), "{wrong}");
    }
    for _ in 0..2 {
        let request =
            format!("GET {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
        let answer = answer(&solver.adaptor, request.as_bytes());
        let body = answer.windows(4).position(|four| four == b"\r\n\r\n").expect("a body") + 4;
        assert!(answer.starts_with(b"HTTP/1.1 200"));
        let surface = decode_surface(&answer[body..]).expect("a surface");
        let points: Vec<_> = surface
            .vertices()
            .iter()
            .map(|&vertex| solver.reference.points()[vertex as usize])
            .collect();
        assert_eq!(surface.points(), points);
        assert_eq!(surface.features().names()[5], "z-max");
    }
    let hello = Viewer::connect(&solver.adaptor).hello();
    assert_eq!(
        (&hello["surface"]["vertices"], &hello["surface"]["faces"]),
        (&json!(98), &json!(192))
    );
}

#[test]
fn only_the_token_lets_anybody_in() {
    let mut solver = Solver::with_config(LINK_TO_ALL);
    let right = socket_url(&solver.adaptor);
    let wrong = right.replace("token=", "token=0");
    let none = right.split('?').next().unwrap().to_owned();
    for url in [wrong, none, format!("{right}0")] {
        let error = Viewer::try_connect(&url).err().expect("not let in");
        assert_eq!(status_of(&error), Some(401), "{error}");
    }
    assert!(get(&solver.adaptor, "/?token=0123", "").starts_with("HTTP/1.1 401"));
    let page = get(&solver.adaptor, "/", "");
    assert!(page.starts_with("HTTP/1.1 200") && page.contains("text/html"), "{page}");
    let policy = "content-security-policy: default-src 'self'; script-src 'self' 'wasm-unsafe-eval'; \
        style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; worker-src 'self'; \
        connect-src 'self'; object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'\r\n";
    for header in ["no-cache", "nosniff", policy] {
        assert!(page.contains(header), "{header}: {page}");
    }
    assert!(get(&solver.adaptor, "/no/such/file", "").starts_with("HTTP/1.1 404"));
    assert!(get(&solver.adaptor, "/../Cargo.toml", "").starts_with("HTTP/1.1 4"));
    let path = right.split_once("/ws").map(|(_, query)| format!("/ws{query}")).unwrap();
    assert!(
        get(&solver.adaptor, &path, "Origin: http://evil.example\r\n").starts_with("HTTP/1.1 403")
    );
    let rebound =
        raw(&solver.adaptor, b"GET / HTTP/1.1\r\nHost: evil.example\r\nConnection: close\r\n\r\n");
    assert!(rebound.starts_with("HTTP/1.1 403"), "{rebound}");
    solver.steps(3);
}

#[test]
fn a_paused_solver_waits_and_still_listens() {
    let mut solver = Solver::with_config(LINK_TO_ALL);
    solver.step();
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    viewer.send(&json!({"pause": {}}));
    let helper = std::thread::spawn(move || {
        viewer.wait_for("status", |status| status["paused"] == true);
        viewer.send(&json!({"id": "meanwhile", "order": squeeze(0.2)}));
        let is_planned = |order: &Value| {
            order["id"] == "meanwhile"
                && order["waits_for"].as_str().is_some_and(|reason| reason.contains("paused"))
        };
        viewer.wait_for("order", is_planned);
        std::thread::sleep(Duration::from_millis(200));
        viewer.send(&json!({"resume": {}}));
        viewer.wait_for("status", |status| status["paused"] == false);
        viewer
    });
    solver.step_until("the order's motion, at the cycle of the pause", |solver| {
        !solver.motions.is_empty()
    });
    assert!(solver.slowest >= Duration::from_millis(200), "it did not wait");
    solver.step();
    let mut viewer = helper.join().unwrap();
    viewer.send(&json!({"pause": {}}));
    viewer.send(&json!({"stop": {}}));
    solver.step_until("the stop", |solver| solver.stopped);
    assert!(solver.finish().adaptor_seconds["paused"].count >= 1);
}

#[test]
fn a_solver_may_wait_for_its_first_viewer() {
    let waiting = LINK_TO_ALL
        .replace(r#""pipelines""#, r#""steering": {"wait_for_viewer": true}, "pipelines""#);
    let mut solver = Solver::with_config(&waiting);
    // Something to do that is no stop does not end the waiting.
    let health = r#"{"set": [{"name": "health", "stages": [{"quality": {}}]}]}"#;
    let change = language::parse_json(health, "change").expect("a change");
    solver.adaptor.change_pipelines(change).expect("it goes with the others");
    let address = socket_url(&solver.adaptor);
    let begun = Instant::now();
    let late = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(300));
        Viewer::try_connect(&address).expect("connected")
    });
    solver.step();
    assert!(begun.elapsed() > Duration::from_millis(250), "it did not wait");
    let mut viewer = late.join().expect("a viewer");
    viewer.hello();
    drop(viewer);
    solver.steps(3);
    let alone =
        language::parse(r#"{"version": 1, "steering": {"wait_for_viewer": true}}"#, "alone.json");
    assert!(alone.unwrap_err().to_string().contains("wait_for_viewer"));
}

#[test]
fn garbage_on_the_port_is_no_trouble() {
    let mut solver = Solver::with_config(LINK_TO_ALL);
    let url = socket_url(&solver.adaptor);
    let path = url.split_once("/ws").map(|(_, query)| format!("/ws{query}")).unwrap();
    let noise: Vec<u8> =
        (0..70_000u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
    raw(&solver.adaptor, b"\0\0\0\0\r\n\r\n");
    raw(&solver.adaptor, &noise);
    raw(&solver.adaptor, b"GET / HTTP/9.9\r\n\r\n");
    raw(&solver.adaptor, "GET /\u{fffd} HTTP/1.1\r\n\r\n".as_bytes());
    // A true handshake, then noise instead of frames.
    let mut stream = TcpStream::connect(solver.adaptor.address().unwrap()).unwrap();
    let handshake = format!(
        "GET {path} HTTP/1.1\r\nHost: localhost\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n\
         Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
    );
    stream.write_all(handshake.as_bytes()).unwrap();
    let mut first = [0; 12];
    stream.read_exact(&mut first).unwrap();
    assert_eq!(&first, b"HTTP/1.1 101");
    let _ = stream.write_all(&noise);
    solver.steps(5);
    // And one that goes away in the middle of a frame.
    let mut half = Viewer::connect(&solver.adaptor);
    half.hello();
    solver.step();
    drop(half);
    solver.steps(5);
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    solver.step_until_told(&mut viewer, "status", |_| true);
}

#[test]
fn a_message_that_is_too_long_ends_only_its_own_connection() {
    let mut solver = Solver::with_config(LINK_TO_ALL);
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    let mut long = Viewer::connect(&solver.adaptor);
    long.send_unwelcome(Message::text(" ".repeat(DOCUMENT.most + (1 << 20))));
    long.wait_for_end();
    solver.step_until_told(&mut viewer, "status", |status| status["viewers"] == 1);
}

#[test]
fn a_viewer_is_told_which_limit_its_message_is_beyond() {
    let mut solver = Solver::with_config(LINK_TO_ALL);
    solver.step();
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    let edit =
        json!({"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0.0, 0.0, -1e-6]}});
    let edits = vec![edit.clone(); EDITS.most + 1];
    for (message, named) in [
        (
            json!({"id": "a", "order": {"edits": [edit], "schedule": {"steps": u32::MAX}}}),
            SHAPES.check(u32::MAX as usize),
        ),
        (
            json!({"id": "f", "forecast": {"edits": [edit], "schedule": {"steps": u32::MAX}}}),
            SHAPES.check(u32::MAX as usize),
        ),
        (json!({"id": "b", "order": {"edits": edits}}), EDITS.check(EDITS.most + 1)),
        (json!({"id": "c", "forecast": {"stack": edits}}), EDITS.check(EDITS.most + 1)),
    ] {
        viewer.send(&message);
        let told = viewer.wait_for("error", |error| error["id"] == message["id"]);
        assert!(
            told["message"].as_str().unwrap().ends_with(&named.unwrap_err().to_string()),
            "{told}"
        );
    }
    let mut watcher = Viewer::connect(&solver.adaptor);
    // A longer message of one that does not drive is not even read, so that its id is not known. The
    // answer is the same.
    for (length, id) in [(UNDRIVEN, json!("w")), (UNDRIVEN + 1, Value::Null)] {
        let message = json!({"id": "w", "pause": {}}).to_string();
        watcher.send_text(&format!("{message:<length$}"));
        let told = watcher.wait_for("error", |_| true);
        assert!(told["message"].as_str().unwrap().contains("this viewer watches"), "{told}");
        assert_eq!(told["id"], id, "{length} bytes: {told}");
    }
    let stack = vec![edit; 1500];
    viewer.send(&json!({"id": "d", "forecast": {"stack": stack}}));
    let told = viewer.wait_for("forecast", |forecast| forecast["id"] == "d");
    assert_eq!(told["order"]["outcome"], "applied", "{told}");
    // The last: so long a message is paid for by a wait after it.
    viewer.send_text(&" ".repeat(DOCUMENT.most + 1));
    let beyond = DOCUMENT.check(DOCUMENT.most + 1).unwrap_err().to_string();
    viewer.wait_for("error", |error| error["message"].as_str().unwrap().ends_with(&beyond));
    solver.step();
    assert!(solver.is_at_reference() && !solver.stopped);
}

#[test]
fn a_viewer_that_does_not_read_costs_the_solver_nothing() {
    let mut solver = Solver::with_config(LINK_TO_ALL);
    solver.step();
    let mut deaf = Viewer::connect(&solver.adaptor);
    deaf.hello();
    let begun = Instant::now();
    solver.slowest = Duration::ZERO;
    while begun.elapsed() < Duration::from_secs(3) {
        solver.step();
    }
    // Who waited for it would wait until it is let go, which is after twenty seconds.
    assert!(solver.slowest < Duration::from_secs(8), "{:?}", solver.slowest);
    assert!(solver.cycle > 20);
}

#[test]
fn a_port_in_use_is_told_by_name() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap();
    let text = LINK_TO_ALL.replace("127.0.0.1:0", &address.to_string());
    let error = Adaptor::initialize(Settings { config: config(&text), ..Settings::default() })
        .err()
        .expect("refused");
    assert!(matches!(error, InitializeError::Stream(StreamError::InUse { .. })));
    let message = error.to_string();
    assert!(message.contains(&address.to_string()) && message.contains("port 0"), "{message}");
}

#[test]
fn a_viewer_changes_no_bit_of_the_run() {
    let orders = json!([{"at": {"cycle": 3}, "order": {"edits": squeeze(0.3)["edits"],
        "schedule": {"steps": 3, "every": {"steps": 2}}}}]);
    let run = |watched: bool| {
        let text = if watched { LINK_TO_ALL } else { r#"{"version": 1}"# };
        let mut solver = Solver::new(Settings {
            config: config(text),
            orders: parse_orders(&orders.to_string(), "orders.json").unwrap(),
            ..Settings::default()
        });
        let _viewer = watched.then(|| Viewer::connect(&solver.adaptor));
        let mut shapes = Vec::new();
        for _ in 0..15 {
            solver.step();
            shapes.push(bits(&solver.mesh));
        }
        assert_eq!(solver.finish().orders[0].status, OrderStatus::Applied);
        shapes
    };
    assert!(run(true) == run(false));
}

#[test]
fn orders_of_viewers_replay_from_the_journal() {
    let directory = tempfile::tempdir().unwrap();
    let text =
        LINK_TO_ALL.replacen("\"version\": 1,", "\"version\": 1, \"journal\": \"run.jsonl\",", 1);
    let settings =
        Settings { config: config(&text), output: directory.path().into(), ..Settings::default() };
    let mut solver = Solver::new(settings);
    solver.step();
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    let schedule = json!({"steps": 8, "every": {"steps": 3}});
    viewer
        .send(&json!({"id": "a", "order": {"edits": squeeze(0.3)["edits"], "schedule": schedule}}));
    solver.step_until_told(&mut viewer, "order", |order| order["id"] == "a" && order["shape"] == 3);
    viewer
        .send(&json!({"id": "b", "order": {"edits": squeeze(0.1)["edits"], "schedule": schedule}}));
    solver.step_until_told(&mut viewer, "order", |order| {
        order["id"] == "b" && order["status"] == "applied"
    });
    let (cycles, motions, mesh) = (solver.cycle, solver.motions.clone(), bits(&solver.mesh));
    solver.finish();
    let journal = std::fs::read_to_string(directory.path().join("run.jsonl")).unwrap();
    let mut replay = Solver::new(Settings {
        replay: Some(parse_journal(&journal, "run.jsonl").unwrap()),
        ..Settings::default()
    });
    replay.steps(cycles);
    assert_eq!(replay.motions, motions);
    assert!(bits(&replay.mesh) == mesh);
}

#[test]
fn what_a_monitoring_system_asks_is_answered() {
    let mut solver = Solver::with_config(LINK_TO_ALL);
    solver.steps(3);
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    viewer.send(&json!({"id": "a", "order": squeeze(0.2)}));
    solver.step_until_told(&mut viewer, "order", |order| order["status"] == "applied");
    let link = solver.adaptor.watching_link().expect("a server");
    let secret = link.split_once("token=").expect("a secret").1;
    let answer = get(&solver.adaptor, "/metrics", &format!("Authorization: Bearer {secret}\r\n"));
    let cycle = format!("\ntombolo_cycle {}\n", solver.cycle - 1);
    for line in [
        "200 OK",
        "text/plain; version=0.0.4",
        &cycle,
        "\ntombolo_viewers 1\n",
        "\ntombolo_driver 1\n",
        "\ntombolo_journal_lost 0\n",
        "\ntombolo_orders{status=\"applied\"} 1\n",
        "\ntombolo_pipeline_runs_total{pipeline=\"boundary\"} ",
    ] {
        assert!(answer.contains(line), "{line:?} is not in {answer}");
    }
    assert!(get(&solver.adaptor, "/metrics", "").contains("401 "));
    solver.finish();
}

/// A run whose journal is `run.jsonl` in a folder.
fn journaled(directory: &Path) -> Solver {
    let text =
        LINK_TO_ALL.replacen("\"version\": 1,", "\"version\": 1, \"journal\": \"run.jsonl\",", 1);
    Solver::new(Settings { config: config(&text), output: directory.into(), ..Settings::default() })
}

#[test]
fn who_came_and_left_stands_in_the_journal() {
    let directory = tempfile::tempdir().unwrap();
    let mut solver = journaled(directory.path());
    solver.step();
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    drop(viewer);
    assert!(get(&solver.adaptor, "/pipelines?token=wrong", "").contains("401 "));
    let mut second = Viewer::connect(&solver.adaptor);
    second.wait_for("status", |status| status["viewers"] == 1);
    solver.finish();
    let journal = std::fs::read_to_string(directory.path().join("run.jsonl")).unwrap();
    let lines: Vec<Value> =
        journal.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let did = |name: &str, did: &str| {
        let is_it = |line: &&Value| line["viewer"]["name"] == name && line["viewer"]["did"] == did;
        lines.iter().find(is_it).map(|line| line["viewer"]["address"].clone())
    };
    assert_eq!(did("c1", "came"), Some(json!("127.0.0.1")), "{journal}");
    assert_eq!(did("c1", "left"), Some(json!("127.0.0.1")), "{journal}");
    assert!(did("c2", "came").is_some(), "{journal}");
    assert!(lines.iter().any(|line| line["refused"]["address"] == "127.0.0.1"), "{journal}");
}

#[test]
fn one_who_watches_cannot_make_the_journal_grow_without_end() {
    let directory = tempfile::tempdir().unwrap();
    let mut solver = journaled(directory.path());
    solver.step();
    let link = solver.adaptor.watching_link().unwrap();
    let watching = link.replacen("http://", "ws://", 1).replacen("/?", "/ws?", 1);
    let begun = Instant::now();
    for _ in 0..150 {
        let mut watcher = Viewer::try_connect(&watching).unwrap();
        watcher.hello();
    }
    let mut driver = Viewer::connect(&solver.adaptor);
    driver.wait_for("status", |status| status["viewers"] == 1);
    let seconds = begun.elapsed().as_secs();
    solver.finish();
    let journal = std::fs::read_to_string(directory.path().join("run.jsonl")).unwrap();
    let lines = journal.lines().map(|line| serde_json::from_str(line).unwrap());
    let of_viewers: Vec<Value> =
        lines.filter(|line: &Value| line.get("viewer").is_some()).collect();
    let (of_drivers, of_watchers): (Vec<_>, Vec<_>) =
        of_viewers.iter().partition(|line| line["viewer"]["may_drive"] == true);
    assert!(of_watchers.len() as u64 <= 101 + seconds / 10, "{}", of_watchers.len());
    // Nobody keeps the lines about the others out.
    assert_eq!(of_drivers.len(), 2, "{of_drivers:?}");
    parse_journal(&journal, "run.jsonl").unwrap();
}

mod any_bytes {
    use super::*;
    use proptest::{prelude::*, strategy::ValueTree};

    /// Texts near to messages, so that more than the first byte is looked at.
    fn message() -> impl Strategy<Value = String> {
        let word = prop::sample::select(vec![
            "{",
            "}",
            "[",
            "]",
            ":",
            ",",
            "\"order\"",
            "\"edits\"",
            "\"undo\"",
            "\"stack\"",
            "\"translate\"",
            "\"id\"",
            "\"features\"",
            "\"by\"",
            "\"parameter\"",
            "1e400",
            "-0",
            "4294967296",
            "null",
            "NaN",
            "\"\\ud800\"",
            "\u{0}",
        ]);
        prop_oneof![
            any::<String>(),
            prop::collection::vec(word, 0..20).prop_map(|words| words.concat())
        ]
    }

    #[test]
    fn no_message_stops_the_solver_or_moves_its_mesh() {
        let mut solver = Solver::with_config(LINK_TO_ALL);
        solver.step();
        let mut viewer = Viewer::connect(&solver.adaptor);
        viewer.hello();
        let mut runner = proptest::test_runner::TestRunner::new(ProptestConfig {
            cases: 30,
            ..ProptestConfig::default()
        });
        let mut texts = Vec::new();
        for _ in 0..30 {
            texts.push(message().new_tree(&mut runner).unwrap().current());
        }
        for text in texts {
            viewer.send_text(&text);
            solver.step_until_told(&mut viewer, "error", |_| true);
        }
        assert!(solver.is_at_reference() && !solver.stopped);
    }
}

#[test]
fn the_end_of_a_run_is_told_and_how_it_came() {
    let told = |viewer: &mut Viewer, how: &str| {
        let end = viewer.wait_for("end", |_| true);
        assert_eq!((&end["how"], &end["cycle"]), (&json!(how), &json!(2)));
        assert_eq!(viewer.closed(), Some(1000));
    };
    let mut solver = Solver::with_config(LINK_TO_ALL);
    let mut viewer = Viewer::connect(&solver.adaptor);
    solver.steps(3);
    solver.finish();
    told(&mut viewer, "finished");

    let mut solver = Solver::with_config(LINK_TO_ALL);
    let mut viewer = Viewer::connect(&solver.adaptor);
    solver.steps(2);
    let stopper = solver.adaptor.stopper();
    std::thread::spawn(move || stopper.stop()).join().expect("no panic");
    solver.step();
    assert!(solver.stopped);
    solver.finish();
    viewer.wait_for("status", |status| status["stopped"] == true);
    told(&mut viewer, "stopped");

    let mut solver = Solver::with_config(LINK_TO_ALL);
    let mut viewer = Viewer::connect(&solver.adaptor);
    solver.steps(3);
    drop(solver.adaptor);
    told(&mut viewer, "failed");
}

#[test]
fn a_request_names_one_host() {
    let solver = Solver::with_config(LINK_TO_ALL);
    for (request, code) in [
        ("GET / HTTP/1.1\r\nHost: localhost\r\n", "HTTP/1.1 200"),
        ("GET / HTTP/1.1\r\nHost: localhost\r\nHost: evil.example\r\n", "HTTP/1.1 4"),
        ("GET http://evil.example/ HTTP/1.1\r\nHost: localhost\r\n", "HTTP/1.1 403"),
        ("GET http://evil.example/ HTTP/1.1\r\nHost: evil.example\r\n", "HTTP/1.1 403"),
        ("GET http://localhost/ HTTP/1.1\r\nHost: localhost\r\n", "HTTP/1.1 200"),
    ] {
        let request = format!("{request}Connection: close\r\n\r\n");
        let answer =
            String::from_utf8_lossy(&answer(&solver.adaptor, request.as_bytes())).into_owned();
        assert!(answer.starts_with(code), "{request}: {}", answer.lines().next().unwrap_or(""));
    }
}
