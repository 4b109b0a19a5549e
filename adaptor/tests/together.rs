//! What viewers have to do with each other: links for others, names, the camera of the one that
//! drives, notes.

mod common;

use std::{
    io::{Read, Write},
    time::Duration,
};

use common::{LINK_TO_ALL, Solver, Viewer, config, socket_url};
use serde_json::{Value, json};
use tombolo::{
    Adaptor, Settings,
    client::{Client, ClientError, Drives, Link, Options},
    pipelines::language::{LinkFor, StreamServer, parse_journal},
    play::Playback,
};

/// A message that comes only once all before it were answered.
fn after_all(viewer: &mut Viewer) {
    viewer.send(&json!({"id": "last", "kick": {"client": "nobody"}}));
    viewer.wait_for("error", |error| error["id"] == "last");
}

fn watching(adaptor: &Adaptor) -> Viewer {
    Viewer::try_connect(&format!("{}&role=watch", socket_url(adaptor))).expect("connected")
}

fn camera() -> Value {
    json!({"position": [0.0, -3.0, 0.5], "focal_point": [0.5, 0.5, 0.5], "view_up": [0.0, 0.0, 1.0],
           "parallel": false, "parallel_scale": 1.0, "view_angle": 30.0})
}

/// The first line and the cookie of the answer to `GET /?key=...`, and the whole page's address.
fn opened(adaptor: &Adaptor, path: &str) -> (String, Option<String>) {
    let link: Link = adaptor.link().expect("a server").parse().expect("a link");
    let mut stream = std::net::TcpStream::connect((link.host(), link.port())).expect("connected");
    let request =
        format!("GET /{path} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n\r\n", link.address());
    stream.write_all(request.as_bytes()).expect("sent");
    let mut answer = String::new();
    stream.read_to_string(&mut answer).expect("read");
    let cookie = answer.lines().find_map(|line| line.strip_prefix("set-cookie: "));
    (answer.lines().next().unwrap_or_default().to_owned(), cookie.map(str::to_owned))
}

#[test]
fn a_viewer_gives_links_that_open_one_browser_once() {
    let mut solver = Solver::with_config(LINK_TO_ALL);
    solver.step();
    let mut driver = Viewer::connect(&solver.adaptor);
    let mut watcher = watching(&solver.adaptor);
    let ask = |viewer: &mut Viewer, rights: &str| {
        viewer.send(&json!({"id": rights, "link": {"for": rights}}));
        let link = viewer.wait_for("link", |link| link["id"] == rights && link["for"] == rights);
        link["path"].as_str().expect("a path").to_owned()
    };
    for rights in ["watch", "drive"] {
        let path = ask(&mut driver, rights);
        assert!(path.starts_with("?key="), "relative to the page: {path}");
        let (status, cookie) = opened(&solver.adaptor, &path);
        assert!(status.contains("303") && cookie.is_some(), "{status}");
        assert!(opened(&solver.adaptor, &path).0.contains("401"), "it opens one browser, once");
    }
    // One who watches gives no more than it has.
    let path = ask(&mut watcher, "watch");
    assert!(opened(&solver.adaptor, &path).0.contains("303"));
    watcher.send(&json!({"id": "more", "link": {"for": "drive"}}));
    let error = watcher.wait_for("error", |error| error["id"] == "more");
    assert!(error["message"].as_str().expect("a text").contains("for watching"), "{error}");
    watcher.send(&json!({"id": "else", "link": {"for": "wotch"}}));
    let error = watcher.wait_for("error", |error| error["id"] == "else");
    assert!(error["message"].as_str().expect("a text").contains("watch"), "{error}");
    // Those that nobody opens are bounded, and push out none of others.
    let kept = ask(&mut driver, "drive");
    let first = ask(&mut watcher, "watch");
    (0..20).for_each(|_| drop(ask(&mut watcher, "watch")));
    assert!(opened(&solver.adaptor, &first).0.contains("401"), "its oldest has made way");
    assert!(opened(&solver.adaptor, &kept).0.contains("303"), "that of another has not");
    solver.finish();
}

#[test]
fn a_program_gives_links_too() {
    let mut solver = Solver::with_config(LINK_TO_ALL);
    solver.step();
    let link: Link = solver.adaptor.link().expect("a server").parse().expect("a link");
    let wait = Duration::from_secs(60);
    let client = Client::connect(&link, &Options::default()).expect("connected");
    for rights in [LinkFor::Watch, LinkFor::Drive] {
        let address = client.link_for(rights, wait).expect("a link");
        let path =
            address.strip_prefix(&format!("http://{}/", link.address())).expect("its address");
        assert!(opened(&solver.adaptor, path).0.contains("303"), "{address}");
    }
    let watches = Options { drives: Drives::Never, ..Options::default() };
    let watcher = Client::connect(&link, &watches).expect("connected");
    watcher.link_for(LinkFor::Watch, wait).expect("a link");
    let refused = watcher.link_for(LinkFor::Drive, wait);
    assert!(matches!(refused, Err(ClientError::Rejected { .. })), "{refused:?}");
    drop((client, watcher));
    solver.finish();
}

#[test]
fn who_asks_first_leaves_the_wheel_to_others() {
    let mut solver = Solver::with_config(LINK_TO_ALL);
    solver.step();
    let link: Link = solver.adaptor.link().expect("a server").parse().expect("a link");
    let wait = Duration::from_secs(60);
    let on_request = Options { drives: Drives::OnRequest, ..Options::default() };
    let script = Client::connect(&link, &on_request).expect("connected");
    assert!(!script.drives(), "nobody drives, and it has not asked");
    assert_eq!(script.hello().expect("told").may_drive, Some(true));
    // One who comes to drive does, while the script is there.
    let mut engineer = Viewer::connect(&solver.adaptor);
    assert_eq!(engineer.hello()["role"], "driver");
    let refused = script.drive(Duration::ZERO);
    assert!(matches!(refused, Err(ClientError::NotDriver { .. })), "{refused:?}");
    let asked = engineer.wait_for("wheel", |_| true);
    engineer.send(&json!({"hand_over": {"to": asked["asked_by"]}}));
    script.drive(wait).expect("handed over");
    let refused = script.hand_over("c99", wait);
    assert!(matches!(refused, Err(ClientError::Rejected { .. })), "{refused:?}");
    script.hand_over(engineer.hello()["client"].as_str().expect("a name"), wait).expect("given");
    engineer.wait_for("hello", |hello| hello["role"] == "driver");
    let refused = script.hand_over("c1", wait);
    assert!(matches!(refused, Err(ClientError::NotDriver { .. })), "{refused:?}");
    // Once nobody else is there it has the wheel as soon as it asks.
    drop((engineer, script));
    let script = Client::connect(&link, &on_request).expect("connected");
    script.drive(wait).expect("free");
    assert!(script.drives());
    drop(script);
    solver.finish();
}

#[test]
fn pages_that_are_named_may_show_the_viewer_and_no_others() {
    let headers = |settings: &str| {
        let text = json!({"version": 1, "pipelines": [], "stream": serde_json::from_str::<Value>(settings).expect("JSON")});
        let mut solver = Solver::with_config(&text.to_string());
        solver.step();
        let mut viewer = Viewer::connect(&solver.adaptor);
        let named = viewer.hello()["embed"].clone();
        let link: Link = solver.adaptor.link().expect("a server").parse().expect("a link");
        let mut stream =
            std::net::TcpStream::connect((link.host(), link.port())).expect("connected");
        let request =
            format!("GET / HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n\r\n", link.address());
        stream.write_all(request.as_bytes()).expect("sent");
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).expect("read");
        let answer = String::from_utf8_lossy(&answer).to_lowercase();
        drop(viewer);
        solver.finish();
        let head = answer.split("\r\n\r\n").next().unwrap_or_default().to_owned();
        (named, head)
    };
    let (named, head) = headers(r#"{"listen": "127.0.0.1:0"}"#);
    assert_eq!(named, json!([]));
    assert!(
        head.contains("frame-ancestors 'none'") && head.contains("x-frame-options: deny"),
        "{head}"
    );
    let (named, head) = headers(
        r#"{"listen": "127.0.0.1:0", "embed": ["http://localhost:8888/", "https://Hub.example.org"]}"#,
    );
    assert_eq!(named, json!(["http://localhost:8888", "https://hub.example.org"]));
    let expected =
        "form-action 'none'; frame-ancestors http://localhost:8888 https://hub.example.org\r\n";
    assert!(head.contains(expected) && !head.contains("x-frame-options"), "{head}");
}

#[test]
fn who_is_here_is_told_with_names_and_rights() {
    let mut solver = Solver::with_config(LINK_TO_ALL);
    solver.step();
    let mut driver = Viewer::connect(&solver.adaptor);
    let mut other = Viewer::connect(&solver.adaptor);
    let mut watcher = watching(&solver.adaptor);
    driver.send(&json!({"name": {"name": "  Anna "}}));
    other.send(&json!({"name": {"name": "<b>Bo</b>"}}));
    let person = |client, name: Option<&str>, role, may_drive| json!({"client": client, "name": name, "role": role, "may_drive": may_drive});
    let expected = json!([
        person("c1", Some("Anna"), "driver", true),
        person("c2", Some("<b>Bo</b>"), "watcher", true),
        person("c3", None, "watcher", false)
    ]);
    for viewer in [&mut driver, &mut other, &mut watcher] {
        viewer.wait_for("people", |people| people["viewers"] == expected);
    }
    // Who asks for the wheel is told by name.
    other.send(&json!({"drive": {}}));
    let asked = driver.wait_for("wheel", |_| true);
    assert_eq!(asked, json!({"asked_by": "c2", "name": "<b>Bo</b>"}));
    driver.send(&json!({"hand_over": {"to": "c2"}}));
    watcher.wait_for("people", |people| {
        people["viewers"][0]["role"] == "watcher" && people["viewers"][1]["role"] == "driver"
    });
    // What cannot be a name is refused, and the one of before stays.
    for name in ["x".repeat(41), "a\u{7}".into(), "\u{202e}b".into()] {
        driver.send(&json!({"id": "bad", "name": {"name": name}}));
        driver.wait_for("error", |error| error["id"] == "bad");
    }
    driver.send(&json!({"name": {"name": "Anna B"}}));
    watcher.wait_for("people", |people| people["viewers"][0]["name"] == "Anna B");
    driver.send(&json!({"name": {"name": "  "}}));
    watcher.wait_for("people", |people| people["viewers"][0]["name"].is_null());
    drop(other);
    watcher.wait_for("people", |people| {
        people["viewers"].as_array().is_some_and(|all| all.len() == 2)
    });
    solver.finish();
}

#[test]
fn the_drivers_camera_is_sent_to_those_who_follow_and_to_nobody_else() {
    let mut solver = Solver::with_config(LINK_TO_ALL);
    solver.step();
    let mut driver = Viewer::connect(&solver.adaptor);
    let mut follower = watching(&solver.adaptor);
    let mut other = watching(&solver.adaptor);
    driver.wait_for("followed", |followed| followed["by"] == 0);
    follower.send(&json!({"follow": {"on": true}}));
    driver.wait_for("followed", |followed| followed["by"] == 1);
    // Earlier ones, from before anybody followed, are of no use.
    driver.seen.retain(|message| message.get("followed").is_none());
    driver.send(&json!({"camera": camera()}));
    assert_eq!(follower.wait_for("camera", |_| true), camera());
    // Nobody but the driver shows a camera, and none that is nowhere.
    other.send(&json!({"id": "not", "camera": camera()}));
    other.wait_for("error", |error| error["id"] == "not");
    let mut nowhere = camera();
    nowhere["view_angle"] = json!(0);
    driver.send(&json!({"id": "nowhere", "camera": nowhere}));
    driver.wait_for("error", |error| error["id"] == "nowhere");
    driver.send_text(r#"{"id": "far", "camera": {"position": [1e999, 0, 0]}}"#);
    driver.wait_for("error", |error| {
        error["message"].as_str().is_some_and(|it| it.contains("beyond the range"))
    });
    // One that follows no more hears nothing, and the driver does.
    follower.send(&json!({"follow": {"on": false}}));
    driver.wait_for("followed", |followed| followed["by"] == 0);
    driver.send(&json!({"camera": camera()}));
    after_all(&mut driver);
    for viewer in [&mut follower, &mut other] {
        viewer.send(&json!({"id": "last", "drive": {}}));
        viewer.wait_for("error", |error| error["id"] == "last");
        assert!(viewer.seen.iter().all(|message| message.get("camera").is_none()));
    }
    // A follower that is gone follows no more.
    follower.send(&json!({"follow": {"on": true}}));
    driver.wait_for("followed", |followed| followed["by"] == 1);
    drop(follower);
    driver.wait_for("followed", |followed| followed["by"] == 0);
    solver.finish();
}

const WITH_JOURNAL: &str = r#"{"version": 1, "stream": {"listen": "127.0.0.1:0"}, "journal": "journal.jsonl",
    "record": "run.tombolo"}"#;

fn texts(hello: &Value) -> Vec<(u64, String)> {
    let notes = hello["notes"].as_array().expect("notes").iter();
    let text = |note: &Value| note["text"].as_str().expect("a text").to_owned();
    notes.map(|note| (note["number"].as_u64().expect("a number"), text(note))).collect()
}

#[test]
fn notes_are_pinned_told_kept_in_the_journal_and_taken_away() {
    let directory = tempfile::tempdir().expect("a directory");
    let settings = || Settings {
        config: config(WITH_JOURNAL),
        output: directory.path().into(),
        ..Settings::default()
    };
    let mut solver = Solver::new(settings());
    solver.steps(3);
    let mut driver = Viewer::connect(&solver.adaptor);
    let mut second = Viewer::connect(&solver.adaptor);
    let mut watcher = watching(&solver.adaptor);
    assert_eq!(texts(&watcher.hello()), []);
    second.send(&json!({"name": {"name": "Bo"}}));
    second.send(&json!({"id": "n", "note": {"text": " the eddy\nhere ", "at": [0.5, 0.25, 1.0], "cycle": 2}}));
    let pinned = json!({"number": 1, "text": "the eddy\nhere", "at": [0.5, 0.25, 1.0], "cycle": 2, "by": "Bo"});
    for viewer in [&mut driver, &mut second, &mut watcher] {
        assert_eq!(viewer.wait_for("note", |_| true), pinned);
    }
    driver.send(&json!({"note": {"text": "<img src=x onerror=alert(1)>", "at": [0, 0, 0]}}));
    let note = watcher.wait_for("note", |_| true);
    assert_eq!(
        (&note["cycle"], &note["by"], &note["number"]),
        (&json!(2), &json!("c1"), &json!(2))
    );
    driver.send(&json!({"note": {"text": "third", "at": [0, 0, 0]}}));
    // One who watches writes none and takes none away.
    for message in [json!({"text": "mine", "at": [0, 0, 0]}), json!({"number": 1})] {
        let key = if message.get("text").is_some() { "note" } else { "remove_note" };
        watcher.send(&json!({"id": key, key: message}));
        let error = watcher.wait_for("error", |error| error["id"] == key);
        assert!(error["message"].as_str().expect("a text").contains("for watching"), "{error}");
    }
    for wrong in [
        json!({"text": "", "at": [0, 0, 0]}),
        json!({"text": "x".repeat(501), "at": [0, 0, 0]}),
        json!({"text": "x"}),
    ] {
        second.send(&json!({"id": "wrong", "note": wrong}));
        second.wait_for("error", |error| error["id"] == "wrong");
    }
    driver.send(&json!({"remove_note": {"number": 2}}));
    assert_eq!(watcher.wait_for("note_removed", |_| true), json!({"number": 2}));
    driver.send(&json!({"id": "gone", "remove_note": {"number": 2}}));
    driver.wait_for("error", |error| error["id"] == "gone");
    let expected = vec![(1, "the eddy\nhere".to_owned()), (3, "third".to_owned())];
    assert_eq!(texts(&watching(&solver.adaptor).hello()), expected);
    drop((driver, second, watcher));
    solver.finish();
    // A replay shows them, and writes them into its own journal.
    let journal = directory.path().join("journal.jsonl");
    let replays = tempfile::tempdir().expect("a directory");
    for from in [journal, replays.path().join("journal.jsonl")] {
        let settings = Settings {
            config: config(WITH_JOURNAL),
            output: replays.path().into(),
            ..Settings::default()
        };
        let mut solver = Solver::new(settings.replay_from_file(from).expect("a journal"));
        solver.step();
        assert_eq!(texts(&watching(&solver.adaptor).hello()), expected);
        solver.finish();
    }
    // So does a recording, at each moment those of that moment.
    let settings = StreamServer {
        listen: Some("127.0.0.1:0".parse().expect("an address")),
        ..StreamServer::default()
    };
    let playback =
        Playback::start(directory.path().join("run.tombolo"), &settings).expect("a recording");
    let url = playback.link().replacen("http://", "ws://", 1).replacen("/?", "/ws?", 1);
    let mut viewer = Viewer::try_connect(&url).expect("connected");
    assert_eq!(texts(&viewer.hello()), []);
    viewer.send(&json!({"play": {"seek": {"seconds": 1e6}}}));
    viewer.wait_for("hello", |hello| texts(hello) == expected);
}

#[test]
fn a_run_that_goes_on_from_a_checkpoint_has_the_notes_of_before() {
    let directory = tempfile::tempdir().expect("a directory");
    let settings = || Settings {
        config: config(
            r#"{"version": 1, "stream": {"listen": "127.0.0.1:0"}, "journal": "journal.jsonl"}"#,
        ),
        output: directory.path().into(),
        ..Settings::default()
    };
    let mut solver = Solver::new(settings());
    let pin = |solver: &Solver, text: &str| {
        let mut viewer = Viewer::connect(&solver.adaptor);
        viewer.send(&json!({"note": {"text": text, "at": [0, 0, 0]}}));
        viewer.wait_for("note", |note| note["text"] == text)["number"].clone()
    };
    solver.steps(3);
    pin(&solver, "before");
    let gone = pin(&solver, "taken away");
    let (checkpoint, mesh) = (solver.adaptor.checkpoint(), solver.mesh.clone());
    pin(&solver, "after");
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.send(&json!({"remove_note": {"number": gone}}));
    viewer.wait_for("note_removed", |_| true);
    solver.step();
    solver.finish();
    let mut again = Solver::new(settings().restart(checkpoint));
    (again.mesh, again.cycle) = (mesh, 3);
    again.step();
    let expected = vec![(1, "before".to_owned()), (3, "after".to_owned())];
    assert_eq!(texts(&Viewer::connect(&again.adaptor).hello()), expected);
    assert_eq!(pin(&again, "later"), 4);
    again.finish();
    // Both runs in one journal are one run.
    let replay =
        settings().replay_from_file(directory.path().join("journal.jsonl")).expect("a journal");
    let notes = replay.replay.expect("a recording").notes;
    let numbers: Vec<u64> = notes.iter().map(|note| note.number).collect();
    assert_eq!(numbers, [1, 3, 4]);
}

#[test]
fn a_run_has_so_many_notes_and_no_more() {
    let note = |number| json!({"note": {"number": number, "text": "x", "at": [0, 0, 0], "cycle": 1, "by": "c1"}});
    let journal: String = (1..=199).map(|number| format!("{}\n", note(number))).collect();
    let replay = parse_journal(&journal, "journal.jsonl").expect("a journal");
    let settings =
        Settings { config: config(LINK_TO_ALL), replay: Some(replay), ..Settings::default() };
    let mut solver = Solver::new(settings);
    solver.step();
    let mut driver = Viewer::connect(&solver.adaptor);
    let mut pin =
        |id: &str| driver.send(&json!({"id": id, "note": {"text": "x", "at": [0, 0, 0]}}));
    ["fits", "over"].into_iter().for_each(&mut pin);
    assert_eq!(driver.wait_for("note", |_| true)["number"], 200);
    let refused = driver.wait_for("error", |error| error["id"] == "over");
    let message = refused["message"].as_str().expect("a text");
    assert!(message.contains("found 201 notes, expected at most 200"), "{message}");
    assert_eq!(texts(&Viewer::connect(&solver.adaptor).hello()).len(), 200);
    solver.finish();
    let journal = format!("{journal}{}\n{}\n", note(200), note(201));
    let error = parse_journal(&journal, "journal.jsonl").expect_err("too many").to_string();
    assert!(error.contains("found 201 notes"), "{error}");
}
