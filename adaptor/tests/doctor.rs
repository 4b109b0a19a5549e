//! What the program `tombolo` says of a link that does not work, and of one that works less than was
//! thought.
#![cfg(unix)]

mod common;

use std::{io::Read, net::TcpListener, os::unix::fs::PermissionsExt, path::Path, time::Duration};

use common::{Solver, config, program::tombolo, running::Running, secrets, squeeze};
use serde_json::{Value, json};
use tombolo::{
    Settings,
    pipelines::language::StreamServer,
    play::Playback,
    stream::relay::{Relay, RelaySettings},
};

/// Checks what `doctor` says of a link.
fn doctor(link: &str, code: i32, expected: &[&str]) {
    let (found, said, _) = tombolo(Path::new("."), &["doctor", link]);
    assert_eq!(found, code, "{said}");
    for part in expected {
        assert!(said.contains(part), "{part:?} in {said}");
    }
    assert!(!said.contains("Another program has the port"), "{said}");
}

/// A run, with the folder that it writes to, the text that invites to it, and the lines of its links.
struct Run {
    directory: tempfile::TempDir,
    invitation: String,
    drive: String,
    watch: String,
    _running: Running,
}

/// The link of a file of links that is for this.
fn link(file: &Path, name: &str) -> Option<String> {
    let text = std::fs::read_to_string(file).expect("the links");
    text.lines().find_map(|line| line.strip_prefix(&format!("{name}: ")).map(str::to_owned))
}

/// The path that the first line of an invitation tells.
fn told(invitation: &str) -> &Path {
    Path::new(invitation.lines().next().and_then(|line| line.split(" in ").nth(1)).expect("a path"))
}

impl Run {
    fn new(stream: Value) -> Self {
        let directory = tempfile::tempdir().expect("a folder");
        let config = config(&json!({"version": 1, "stream": stream}).to_string());
        let output = directory.path().to_owned();
        let mut solver = Solver::new(Settings { config, output, ..Settings::default() });
        let invitation = solver.adaptor.invitation(false).expect("written").expect("a server");
        let of = |name| link(told(&invitation), name).expect("a link");
        let (drive, watch) = (of("drive"), of("watch"));
        Self { directory, drive, watch, _running: Running::start(solver), invitation }
    }
}

#[test]
fn the_output_of_a_run_is_enough_to_steer_it() {
    let run = Run::new(json!({"listen": "127.0.0.1:0"}));
    let at = run.directory.path();
    std::fs::write(at.join("run.log"), format!("begins\n{}\nstep 1\n", run.invitation))
        .expect("written");
    std::fs::write(at.join("squeeze.json"), squeeze(0.1).to_string()).expect("written");
    let (code, said, _) = tombolo(at, &["order", "run.log", "squeeze.json", "--wait"]);
    assert!(code == 0 && said.contains("applied"), "{code}: {said}");
    // A rejection is told once.
    std::fs::write(at.join("too-far.json"), squeeze(1.5).to_string()).expect("written");
    let (code, said, _) = tombolo(at, &["order", "run.log", "too-far.json", "--wait"]);
    assert!(code == 1 && said.matches("rejected").count() == 1, "{code}: {said}");
    // What a run that was killed leaves lies beside it.
    std::fs::write(at.join("tombolo-1.link"), "drive: http://127.0.0.1:1/?token=a\n")
        .expect("written");
    let own = told(&run.invitation).to_str().expect("a path");
    for more in [&[][..], &["squeeze.json"]] {
        let (code, said, _) = tombolo(at, &[&["order", own, "tombolo-1.link"][..], more].concat());
        assert!(code == 2 && said.contains("found 2 files of links"), "{code}: {said}");
    }
    let (code, said, _) = tombolo(at, &["pause", &run.watch]);
    let reason =
        "this client only watches: the secret or link that this viewer came with is for watching";
    assert!(code == 1 && said.contains(reason), "{code}: {said}");
}

/// Others may read what a run prints: its secrets stay in a file that only its owner can read, and a
/// link on a terminal lets one browser in, once.
#[test]
fn an_invitation_holds_no_secret() {
    let directory = tempfile::tempdir().expect("a folder");
    let config = config(r#"{"version": 1, "stream": {"listen": "127.0.0.1:0"}}"#);
    let output = directory.path().to_owned();
    let mut solver = Solver::new(Settings { config, output, ..Settings::default() });
    let secrets = secrets(&solver.adaptor);
    let mut invite =
        |terminal| solver.adaptor.invitation(terminal).expect("written").expect("a server");
    let (to_log, to_terminal, once_more) = (invite(false), invite(true), invite(true));
    for invitation in [&to_log, &to_terminal, &once_more] {
        assert!(!invitation.contains("token="), "{invitation}");
        for secret in &secrets {
            assert!(!invitation.contains(secret), "{invitation}");
        }
    }
    assert!(!to_log.contains("key="), "{to_log}");
    let key = |invitation: &str| {
        assert_eq!(invitation.matches("key=").count(), 1, "{invitation}");
        let (_, rest) = invitation.split_once("?key=").expect("a link with a key");
        rest.lines().next().expect("a key").to_owned()
    };
    assert_ne!(key(&to_terminal), key(&once_more), "a key is given out once");
    // The secrets are in the file, which is its owner's alone, also once it was written again.
    let file = told(&to_log);
    let text = std::fs::read_to_string(file).expect("the links");
    assert!(secrets.iter().all(|secret| text.contains(secret)), "a secret is missing");
    let mode = std::fs::metadata(file).expect("the file").permissions().mode();
    assert_eq!(mode & 0o777, 0o600);
}

/// With port 0 the file of each run has another name.
#[test]
fn the_links_that_a_killed_run_has_left_are_removed_by_the_next() {
    let first = Run::new(json!({"listen": "127.0.0.1:0"}));
    let at = first.directory.path();
    let left = at.join("tombolo-1.link");
    std::fs::copy(told(&first.invitation), &left).expect("copied");
    let config = config(r#"{"version": 1, "stream": {"listen": "127.0.0.1:0"}}"#);
    let mut next = Solver::new(Settings { config, output: at.into(), ..Settings::default() });
    let invitation = next.adaptor.invitation(false).expect("written").expect("a server");
    assert!(!left.exists());
    assert!(told(&first.invitation).exists() && told(&invitation).exists());
}

#[test]
fn a_link_that_works_less_than_was_thought_is_explained() {
    let run = Run::new(json!({"listen": "127.0.0.1:0"}));
    doctor(&run.drive, 0, &["token: ok", "it may steer"]);
    doctor(&run.watch, 0, &["token: ok", "it watches, because the link is for watching"]);
    let encrypted = run.drive.replacen("http://", "https://", 1);
    doctor(&encrypted, 2, &["server: wrong", "is not encrypted", "Begin the link with http://"]);
    let key = run.drive.replacen("token=", "key=", 1);
    doctor(&key, 2, &["link: wrong", "it opens one browser, once", "Give the file of links"]);
    let bare = run.drive.strip_prefix("http://").expect("a link");
    doctor(bare, 2, &["it does not begin with http://"]);
    let file = told(&run.invitation).to_str().expect("a path").to_owned();
    drop(run);
    doctor(&file, 2, &["link: wrong", &file, "The run has ended"]);

    let run = Run::new(json!({"listen": "127.0.0.1:0", "tls": {}}));
    let plain = run.drive.replacen("https://", "http://", 1);
    doctor(&plain, 2, &["server: wrong", "is encrypted", "Begin the link with https://"]);
    doctor(&run.drive, 0, &["it may steer"]);

    // The near end of a tunnel whose run has ended.
    let tunnel = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = tunnel.local_addr().expect("an address");
    std::thread::spawn(move || {
        for (count, mut stream) in tunnel.incoming().flatten().enumerate() {
            // It is closed before or after something was said.
            if count % 2 == 1 {
                let _ = stream.read(&mut [0; 4096]);
            }
        }
    });
    for scheme in ["http", "https"] {
        for _ in 0..2 {
            let link = format!("{scheme}://{address}/?token=a");
            doctor(&link, 2, &["server: wrong", "without an answer", "The run has ended"]);
        }
    }
}

#[test]
fn a_relay_without_the_run_is_told_from_another_program() {
    let directory = tempfile::tempdir().expect("a folder");
    let listen = "127.0.0.1:0".parse().expect("an address");
    let settings = RelaySettings { listen, ..RelaySettings::new(directory.path()) };
    let relay = Relay::start(&settings).expect("a relay");
    doctor(&relay.link(), 2, &["server: wrong", "that of the relay's page"]);
    let gone = format!("http://{}/gone/?token=a", relay.address());
    doctor(&gone, 2, &["server: wrong", "no run of this name", "has not come to the relay yet"]);
}

#[test]
fn a_recording_is_called_one() {
    let directory = tempfile::tempdir().expect("a folder");
    let config = config(r#"{"version": 1, "record": "run.tombolo"}"#);
    let output = directory.path().to_owned();
    let mut solver = Solver::new(Settings { config, output, ..Settings::default() });
    for _ in 0..20 {
        solver.step();
        std::thread::sleep(Duration::from_millis(10));
    }
    solver.finish();
    let listen = Some("127.0.0.1:0".parse().expect("an address"));
    let settings = StreamServer { listen, ..StreamServer::default() };
    let playback =
        Playback::start(directory.path().join("run.tombolo"), &settings).expect("it is shown");
    let invitation = playback.invitation(directory.path(), false).expect("written");
    assert!(invitation.starts_with("the links to this recording are in "), "{invitation}");
    assert_eq!(link(told(&invitation), "drive"), None);
    let file = told(&invitation).to_str().expect("a path");
    doctor(file, 0, &["this is a recording, of which nothing can be ordered"]);
    let (code, said, _) = tombolo(directory.path(), &["status", file]);
    assert!(code == 0 && said.starts_with("recording: cycle "), "{code}: {said}");
    let (code, said, _) = tombolo(directory.path(), &["pause", file]);
    assert!(code == 1 && said.contains("this is a recording"), "{code}: {said}");
}
