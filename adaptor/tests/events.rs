//! What a run tells of itself by events of `tracing`, to a subscriber of the host.

mod common;

use std::{
    collections::BTreeMap,
    fmt::Debug,
    path::Path,
    sync::{Mutex, Once, PoisonError},
};

use common::{LINK_TO_ALL, Solver, Viewer, config, secrets, squeeze};
use serde_json::{Value, json};
use tombolo::{
    Settings,
    logging::{self, LevelFilter, LoggingError},
    pipelines::language::parse_orders,
};
use tracing::{
    Event, Level, Metadata, Subscriber,
    field::{Field, Visit},
    span,
};

/// The fields of an event as text, and its level.
#[derive(Debug, Clone, Default)]
struct Told(BTreeMap<String, String>);

impl Told {
    fn get(&self, name: &str) -> &str {
        self.0.get(name).map_or("", String::as_str)
    }
}

impl Visit for Told {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        self.0.insert(field.name().into(), format!("{value:?}"));
    }

    fn record_str(&mut self, field: &Field, value: &str) {
        self.0.insert(field.name().into(), value.into());
    }
}

/// The host's own subscriber, which keeps what all threads tell.
struct Keeping;

static KEPT: Mutex<Vec<Told>> = Mutex::new(Vec::new());

impl Subscriber for Keeping {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        metadata.target().starts_with("tombolo")
    }

    fn event(&self, event: &Event<'_>) {
        let mut told = Told::default();
        event.record(&mut told);
        told.0.insert("level".into(), event.metadata().level().to_string());
        KEPT.lock().unwrap_or_else(PoisonError::into_inner).push(told);
    }

    fn new_span(&self, _: &span::Attributes<'_>) -> span::Id {
        span::Id::from_u64(1)
    }

    fn record(&self, _: &span::Id, _: &span::Record<'_>) {}

    fn record_follows_from(&self, _: &span::Id, _: &span::Id) {}

    fn enter(&self, _: &span::Id) {}

    fn exit(&self, _: &span::Id) {}
}

fn listen() {
    static LISTENS: Once = Once::new();
    LISTENS.call_once(|| tracing::subscriber::set_global_default(Keeping).expect("no other"));
}

/// The events of a run so far in which a field is so.
fn told(run: &str, field: &str, value: &str) -> Vec<Told> {
    let kept = KEPT.lock().unwrap_or_else(PoisonError::into_inner);
    let fits = |told: &&Told| told.get("run") == run && told.get(field) == value;
    kept.iter().filter(fits).cloned().collect()
}

/// Checks that no field of any event so far has this text in it.
fn assert_untold(text: &str) {
    let kept = KEPT.lock().unwrap_or_else(PoisonError::into_inner);
    let tells = |told: &&Told| told.0.values().any(|value| value.contains(text));
    let telling = kept.iter().find(tells);
    assert!(telling.is_none(), "{telling:?}");
}

fn statuses(told: &[Told]) -> Vec<&str> {
    told.iter().map(|told| told.get("status")).collect()
}

fn solver(orders: &Value) -> Solver {
    let orders = parse_orders(&orders.to_string(), "orders.json").expect("orders");
    Solver::new(Settings { orders, ..Settings::default() })
}

/// Two runs in one process, at cycles of their own.
#[test]
fn each_step_of_an_order_is_told_with_its_run_cycle_and_id() {
    listen();
    let mut order = squeeze(0.2);
    order["schedule"] = json!({"steps": 2});
    let unknown = json!({"edits": [{"translate": {"features": ["nowhere"], "by": [0, 0, 1]}}]});
    let mut solvers = [2_u64, 4].map(|cycle| {
        let orders = json!([
            {"id": "a", "at": {"cycle": cycle}, "order": order},
            {"id": "b", "at": {"cycle": cycle + 4}, "order": {"undo": 1}},
            {"id": "c", "at": {"cycle": cycle + 6}, "order": unknown},
        ]);
        (solver(&orders), cycle)
    });
    for _ in 0..20 {
        solvers.iter_mut().for_each(|(solver, _)| solver.step());
    }
    let runs: Vec<String> =
        solvers.iter().map(|(solver, _)| solver.adaptor.run_id().to_owned()).collect();
    assert_ne!(runs[0], runs[1]);
    for ((solver, cycle), run) in solvers.into_iter().zip(runs) {
        let whole = ["accepted", "computing", "applying", "applied"];
        for (id, at) in [("a", cycle), ("b", cycle + 4)] {
            let steps = told(&run, "order", id);
            assert_eq!(statuses(&steps), whole, "{steps:?}");
            let cycles: Vec<u64> =
                steps.iter().map(|it| it.get("cycle").parse().expect("a cycle")).collect();
            assert_eq!(cycles[..3], [at; 3], "{steps:?}");
            assert!(cycles[3] >= at && cycles[3] < at + 4, "{steps:?}");
            assert_eq!(steps[0].get("undo"), if id == "b" { "1" } else { "" });
            assert_eq!(steps[1].get("level"), Level::DEBUG.as_str());
            assert!(steps.iter().all(|it| it.get("message").starts_with(&format!("order '{id}'"))));
        }
        let refused = told(&run, "order", "c");
        let last = refused.last().expect("its outcome");
        assert_eq!((last.get("status"), last.get("level")), ("rejected", "INFO"));
        assert!(last.get("reason").contains("nowhere"), "{last:?}");
        // Nothing was due any more.
        let last = told(&run, "run", &run).len();
        assert!(told(&run, "cycle", "19").is_empty());
        solver.finish();
        assert_eq!(told(&run, "run", &run).len(), last);
    }
    // The host has a subscriber: the library's own takes no place.
    logging::start();
    let taken = logging::send_to(LevelFilter::WARN, None);
    assert!(matches!(taken, Err(LoggingError::OtherLogger)));
}

/// What the threads of the stream and the journal tell has the run too.
#[test]
fn viewers_commands_and_checkpoints_are_told_with_their_run() {
    listen();
    let directory = tempfile::tempdir().expect("a directory");
    let mut settings = Settings { config: config(LINK_TO_ALL), ..Settings::default() };
    settings.config.journal = Some("journal.jsonl".into());
    settings.output = directory.path().into();
    let mut solver = Solver::new(settings);
    let run = solver.adaptor.run_id().to_owned();
    let secrets = secrets(&solver.adaptor);
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    solver.step();
    viewer.send(&json!({"id": "x", "order": squeeze(0.2)}));
    viewer.wait_for("order", |order| order["id"] == "x");
    viewer.send(&json!({"id": "y", "cancel": {"order": "x"}}));
    viewer.send(&json!({"id": "p", "pause": {}}));
    viewer.send(&json!({"id": "r", "resume": {}}));
    // The answer to what comes behind them says that they are in the queue.
    viewer.send_text("nonsense");
    viewer.wait_for("error", |_| true);
    solver.step();
    assert_eq!(statuses(&told(&run, "order", "x")), ["accepted", "cancelled"]);
    assert_eq!(told(&run, "order", "x")[0].get("viewer"), "c1");
    for (id, command) in [("y", "cancel"), ("p", "pause"), ("r", "resume")] {
        let [taken, done] = &told(&run, "id", id)[..] else { panic!("{:?}", told(&run, "id", id)) };
        assert_eq!((taken.get("level"), done.get("level")), ("DEBUG", "INFO"));
        for it in [taken, done] {
            assert_eq!((it.get("command"), it.get("viewer")), (command, "c1"), "{it:?}");
        }
        assert_eq!(done.get("cycle"), "1");
    }
    let file = directory.path().join("run.checkpoint");
    solver.adaptor.write_checkpoint(&file).expect("written");
    let written = told(&run, "path", &file.display().to_string());
    assert_eq!((written.len(), written[0].get("cycle")), (1, "1"));
    solver.finish();
    let seen = told(&run, "viewer", "c1");
    let seen: Vec<_> = seen.iter().filter(|it| it.get("address") == "127.0.0.1").collect();
    assert_eq!(seen.len(), 2, "{seen:?}");
    assert!(seen[0].get("message").contains("has come"), "{seen:?}");
    assert!(seen[1].get("message").contains("has left"), "{seen:?}");
    secrets.iter().for_each(|secret| assert_untold(secret));
}

/// What was refused is told once, with who and what: a flood, a long message, a command of one who watches.
#[test]
fn what_is_refused_is_told_once_with_who_and_what() {
    listen();
    let text = LINK_TO_ALL.replace(
        "127.0.0.1:0\"",
        "127.0.0.1:0\", \"limits\": {\"messages\": 20, \"messages_at_once\": 3, \"unknown_connections\": 2}",
    );
    let solver = Solver::new(Settings { config: config(&text), ..Settings::default() });
    let run = solver.adaptor.run_id().to_owned();
    let told = |reason: &str| {
        let told = told(&run, "reason", reason);
        assert_eq!(told.len(), 1, "{reason}: {told:?}");
        assert_eq!(told[0].get("address"), "127.0.0.1", "{told:?}");
        told[0].clone()
    };
    let link = solver.adaptor.watching_link().expect("a server");
    let socket = link.replacen("http://", "ws://", 1).replacen("/?", "/ws?", 1);
    let mut watcher = Viewer::try_connect(&socket).expect("connected");
    watcher.hello();
    watcher.send(&json!({"id": "p", "pause": {}}));
    watcher.wait_for("error", |error| error["id"] == "p");
    watcher.send(&json!({"id": "s", "stop": {}}));
    watcher.wait_for("error", |error| error["id"] == "s");
    let command = told("this viewer does not drive");
    assert_eq!((command.get("viewer"), command.get("level")), ("c1", "WARN"));
    assert!(command.get("message").contains("asked for pause"), "{command:?}");
    watcher.send_text(&" ".repeat(20_000));
    watcher.wait_for("error", |error| error["id"].is_null());
    let long = told("it is longer than it may be");
    assert!(long.get("message").contains("c1 from 127.0.0.1 of 20000 bytes"), "{long:?}");
    // More than three at once, which wait then.
    (0..10).for_each(|_| watcher.send(&json!({"stop": {}})));
    (0..10).for_each(|_| drop(watcher.wait_for("error", |_| true)));
    assert_eq!(told("it sends more messages than it may").get("viewer"), "c1");
    let address = solver.adaptor.address().expect("a server");
    let connect = || std::net::TcpStream::connect(address).expect("connected");
    let mut half = connect();
    std::io::Write::write_all(&mut half, b"GET / HTTP/1.1\r\nHost:").expect("sent");
    let mut end = Vec::new();
    let _ = std::io::Read::read_to_end(&mut half, &mut end);
    assert_eq!(told("it began a request and did not end it in time").get("level"), "INFO");
    let crowd: Vec<_> = (0..6).map(|_| connect()).collect();
    for mut ended in crowd.into_iter().take(4) {
        let _ = std::io::Read::read_to_end(&mut ended, &mut end);
    }
    told("too many connections at once have shown no secret");
    secrets(&solver.adaptor).iter().for_each(|secret| assert_untold(secret));
}

/// A refused request is told without the secret that it showed, which may be right, or nearly right.
#[test]
fn a_wrong_secret_and_a_foreign_page_are_told_once_each() {
    listen();
    let solver = Solver::with_config(LINK_TO_ALL);
    let run = solver.adaptor.run_id().to_owned();
    let secrets = secrets(&solver.adaptor);
    let address = solver.adaptor.address().expect("a server");
    let ask = |secret: &str, headers: &str| {
        let mut stream = std::net::TcpStream::connect(address).expect("connected");
        let request = format!(
            "GET /pipelines?token={secret} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n{headers}\r\n"
        );
        std::io::Write::write_all(&mut stream, request.as_bytes()).expect("sent");
        let mut answer = String::new();
        std::io::Read::read_to_string(&mut stream, &mut answer).expect("an answer");
        answer
    };
    for wrong in ["wrong-secret-1", "wrong-secret-2", &secrets[0][1..]] {
        let answer = ask(wrong, "");
        assert!(answer.starts_with("HTTP/1.1 401"), "{answer}");
    }
    for secret in &secrets {
        let answer = ask(secret, "Origin: http://evil.example\r\n");
        assert!(answer.starts_with("HTTP/1.1 403"), "{answer}");
    }
    for reason in [
        "it showed no secret that is known here",
        "it came under a foreign name or from a page of another site",
    ] {
        let told = told(&run, "reason", reason);
        assert_eq!(told.len(), 1, "{reason}: {told:?}");
        let told = &told[0];
        assert_eq!((told.get("address"), told.get("level")), ("127.0.0.1", "WARN"), "{told:?}");
        assert!(told.get("message").contains("a request from 127.0.0.1 was refused"), "{told:?}");
    }
    assert_untold("wrong-secret");
    secrets.iter().for_each(|secret| assert_untold(&secret[1..]));
}

/// A server that others reach, and a secret that others can read, are warned of.
#[cfg(unix)]
#[test]
fn a_server_on_every_address_and_a_secret_that_others_can_read_are_warned_of() {
    use std::os::unix::fs::PermissionsExt;
    listen();
    let directory = tempfile::tempdir().expect("a directory");
    let file = directory.path().join("run.json");
    let text = r#"{"version": 1, "stream": {"listen": "0.0.0.0:0", "token": "0123456789abcdef"}}"#;
    std::fs::write(&file, text).expect("written");
    for mode in [0o600, 0o644] {
        std::fs::set_permissions(&file, PermissionsExt::from_mode(mode)).expect("set");
        let adaptor = Settings::from_file(&file).expect("read").start().expect("a run");
        let run = adaptor.run_id();
        let open: Vec<_> = told(run, "level", "WARN");
        let has = |words: &str| open.iter().any(|told| told.get("message").contains(words));
        assert!(has("every address of this machine"), "{open:?}");
        assert_eq!(has("chmod 600"), mode == 0o644, "{open:?}");
    }
}

/// A run that keeps a journal in a folder.
fn with_journal(folder: &Path) -> Settings {
    let config = config(r#"{"version": 1, "journal": "journal.jsonl"}"#);
    Settings { config, output: folder.into(), ..Settings::default() }
}

/// A run that goes on from a checkpoint beside a journal that does not have it may have lost what was
/// accepted since.
#[test]
fn a_journal_of_other_runs_is_warned_of_where_a_run_goes_on() {
    listen();
    let [own, other] = [(); 2].map(|()| tempfile::tempdir().expect("a directory"));
    let mut solver = Solver::new(with_journal(own.path()));
    solver.steps(3);
    let run = solver.adaptor.run_id().to_owned();
    let (mesh, saved) = (solver.mesh.clone(), solver.adaptor.checkpoint());
    solver.finish();
    let mut solver = Solver::new(with_journal(other.path()));
    solver.steps(2);
    solver.finish();
    for (folder, is_other) in [(&own, false), (&other, true)] {
        let mut solver = Solver::new(with_journal(folder.path()).restart(saved.clone()));
        (solver.mesh, solver.cycle) = (mesh.clone(), 3);
        solver.step();
        solver.finish();
        let warned = told(&run, "level", "WARN");
        let has = |told: &Told| told.get("message").contains("does not tell of the checkpoint");
        assert_eq!(warned.iter().any(has), is_other, "{warned:?}");
    }
}

/// A solver that steps faster than its pictures can be written is not held up, and whoever will need
/// them hears once that some are missing.
#[test]
fn a_recording_without_all_frames_is_warned_of_once() {
    listen();
    let folder = tempfile::tempdir().expect("a directory");
    let text = r#"{"version": 1, "record": "run.tombolo", "pipelines": [
        {"name": "boundary", "every": {"steps": 1}, "stages": [{"surface": {}}, {"stream": {}}]}]}"#;
    let settings =
        Settings { config: config(text), output: folder.path().into(), ..Settings::default() };
    let mut solver = Solver::of_box([20, 20, 20], settings);
    let run = solver.adaptor.run_id().to_owned();
    solver.steps(200);
    let missing = solver.finish().stream.unrecorded;
    let warned = told(&run, "level", "WARN");
    assert!(missing > 0);
    let has = |told: &&Told| told.get("message").contains("has not all frames");
    assert_eq!(warned.iter().filter(has).count(), 1, "{warned:?}");
}
