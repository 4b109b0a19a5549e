//! Runs behind a relay: listed, driven, refused, lost and found again.
#![cfg(unix)]

mod common;

use std::{
    io::{BufRead, BufReader, Read, Write},
    net::{SocketAddr, TcpStream},
    path::Path,
    process::{Child, Command, Stdio},
    time::{Duration, Instant},
};

use common::{
    Solver, config,
    running::{self, Running, connect},
};
use serde_json::{Value, json};
use tempfile::TempDir;
use tokio_tungstenite::tungstenite::{self, WebSocket};
use tombolo::{
    Settings,
    client::{Client, ClientError, Drives, Event, Link, Options},
    pipelines::language::Tls,
    stream::relay::{Relay, RelaySettings},
};

const PATIENCE: Duration = Duration::from_secs(300);

/// A relay on a loopback address, with its files in a directory.
struct Here {
    directory: TempDir,
    relay: Relay,
}

impl Here {
    fn new(tls: Option<Tls>) -> Self {
        Self::with(|settings| settings.tls = tls)
    }

    fn with(set: impl FnOnce(&mut RelaySettings)) -> Self {
        let directory = tempfile::tempdir().expect("a directory");
        let listen = "127.0.0.1:0".parse().expect("an address");
        let mut settings = RelaySettings { listen, ..RelaySettings::new(directory.path()) };
        set(&mut settings);
        Self { relay: Relay::start(&settings).expect("a relay"), directory }
    }

    /// The `stream` of a run's configuration.
    fn stream(&self, name: &str) -> Value {
        let mut stream: Value =
            serde_json::from_str(&self.relay.stream_settings()).expect("an object");
        stream["name"] = name.into();
        stream
    }

    fn secret(&self) -> String {
        token(&self.relay.link())
    }

    /// A run that is on the list.
    fn run(&self, name: &str) -> Run {
        let before = self.names().len();
        Run::new(&self.stream(name), || self.names().len() > before)
    }

    /// The names of the runs that are listed.
    fn names(&self) -> Vec<String> {
        names(self.relay.address(), &self.secret())
    }

    /// The secret for runs.
    fn secret_for_runs(&self) -> String {
        let file = self.directory.path().join("runs.json");
        let kept = std::fs::read_to_string(file).expect("read");
        let kept: Value = serde_json::from_str(&kept).expect("an object");
        kept["relay"].as_str().expect("a secret").to_owned()
    }

    /// A connection like that of a run, with its first words.
    fn attach(&self, first: &str) -> WebSocket<TcpStream> {
        let address = self.relay.address();
        let stream = TcpStream::connect(address).expect("connected");
        let address = format!("ws://{address}/-/attach?token={}", self.secret_for_runs());
        let (mut socket, _) = tungstenite::client(&address, stream).expect("let in");
        let _ = socket.send(tungstenite::Message::text(first));
        socket
    }

    fn get(&self, path: &str, headers: &[(&str, &str)]) -> Answer {
        request(self.relay.address(), "GET", path, headers)
    }
}

fn token(link: &str) -> String {
    let (_, rest) = link.split_once("token=").expect("a token");
    rest.split('#').next().unwrap_or_default().to_owned()
}

fn names(relay: SocketAddr, secret: &str) -> Vec<String> {
    let bearer = format!("Bearer {secret}");
    let answer = request(relay, "GET", "/-/runs", &[("Authorization", &bearer)]);
    assert_eq!(answer.status, 200, "{answer:?}");
    let runs: Value = serde_json::from_str(&answer.body).expect("a list");
    let runs = runs["runs"].as_array().expect("a list");
    runs.iter().map(|run| run["name"].as_str().expect("a name").to_owned()).collect()
}

fn until(what: &str, mut holds: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !holds() {
        assert!(begun.elapsed() < PATIENCE, "still waiting for: {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[derive(Debug)]
struct Answer {
    status: u16,
    head: String,
    body: String,
}

impl Answer {
    fn header(&self, name: &str) -> Option<&str> {
        self.head.lines().find_map(|line| {
            let (key, value) = line.split_once(':')?;
            key.eq_ignore_ascii_case(name).then(|| value.trim())
        })
    }
}

/// One request in plain text; headers take the place of those that a browser would send.
fn request(relay: SocketAddr, method: &str, path: &str, headers: &[(&str, &str)]) -> Answer {
    let mut stream = TcpStream::connect(relay).expect("connected");
    stream.set_read_timeout(Some(PATIENCE)).expect("set");
    let mut text = format!("{method} {path} HTTP/1.1\r\nConnection: close\r\n");
    if !headers.iter().any(|(name, _)| *name == "Host") {
        text += &format!("Host: {relay}\r\n");
    }
    for (name, value) in headers {
        text += &format!("{name}: {value}\r\n");
    }
    stream.write_all((text + "\r\n").as_bytes()).expect("written");
    let mut bytes = Vec::new();
    stream.read_to_end(&mut bytes).expect("read");
    let text = String::from_utf8_lossy(&bytes).into_owned();
    let (head, body) = text.split_once("\r\n\r\n").expect("an answer");
    let status = head.split(' ').nth(1).and_then(|code| code.parse().ok()).expect("a status");
    let head = head.to_owned();
    let is_chunked = head.to_ascii_lowercase().contains("transfer-encoding: chunked");
    // Short answers come in one chunk.
    let body = if is_chunked { body.split("\r\n").nth(1).unwrap_or_default() } else { body };
    Answer { status, head, body: body.to_owned() }
}

/// A run that goes on by itself.
struct Run {
    link: Link,
    browser_link: String,
    running: Running,
}

impl Run {
    /// A run whose links are asked for once it is `ready`: on a busy machine its relay may take longer
    /// than they are waited for.
    fn new(stream: &Value, ready: impl FnMut() -> bool) -> Self {
        let text = json!({"version": 1, "stream": stream, "pipelines": [
            {"name": "boundary", "every": {"steps": 1}, "stages": [{"surface": {}}, {"stream": {}}]}]});
        let settings = Settings { config: config(&text.to_string()), ..Settings::default() };
        let solver = Solver::of_box([6, 6, 6], settings);
        until("the run at its relay", ready);
        let link = solver.adaptor.link().expect("a server").parse().expect("a link");
        let browser_link = solver.adaptor.browser_link().expect("a link");
        Self { link, browser_link, running: Running::start(solver) }
    }

    fn goes_on(&self) {
        let before = self.running.cycle();
        until("a step", || self.running.cycle() > before + 3);
    }
}

/// Steers a run through its link, and reads what it serves beside its WebSocket.
fn steer(link: &Link) {
    let client = running::steer(link);
    let vertices = client.surface().expect("a surface").vertices().len();
    assert!(vertices > 0);
}

#[test]
fn a_public_address_that_no_link_can_have_is_refused() {
    let directory = tempfile::tempdir().expect("a directory");
    let start = |public: &str| {
        let listen = "127.0.0.1:0".parse().expect("an address");
        let public = Some(public.to_owned());
        Relay::start(&RelaySettings { listen, public, ..RelaySettings::new(directory.path()) })
    };
    for wrong in ["portal.example.org", "https://", "ftp://portal.example.org", "https://a b"] {
        let error = start(wrong).err().expect("refused").to_string();
        assert!(error.contains("public") && error.contains(wrong), "{error}");
    }
    assert!(start("https://portal.example.org/tombolo/").is_ok());
}

#[test]
fn three_runs_are_listed_and_one_is_driven() {
    let here = Here::new(None);
    let address = here.relay.address();
    let runs = ["nozzle", "nozzle", "wing"].map(|name| here.run(name));
    assert_eq!(here.names(), ["nozzle", "nozzle-2", "wing"]);
    let link = runs[1].link.to_string();
    assert!(link.starts_with(&format!("http://{address}/nozzle-2/?token=")), "{link}");
    steer(&runs[1].link);
    for other in [&runs[0], &runs[2]] {
        assert!(connect(&other.link).expect("connected").stack().expect("an answer").is_empty());
    }
    let bearer = format!("Bearer {}", here.secret());
    let page = here.get("/", &[("Authorization", &bearer)]);
    assert_eq!(page.status, 200);
    for name in ["nozzle", "nozzle-2", "wing"] {
        assert!(page.body.contains(&format!("<a href=\"{name}/\">")), "{}", page.body);
    }
    // The name leads to the page of the run, and the page needs nothing.
    let moved = here.get("/wing?x=1", &[]);
    assert_eq!((moved.status, moved.header("location")), (308, Some("wing/?x=1")));
    assert_eq!(here.get("/wing/", &[]).status, 200);
}

#[test]
fn behind_the_relay_a_run_asks_for_its_own_secret() {
    let here = Here::new(None);
    let run = here.run("nozzle");
    let (of_run, of_relay) = (token(&run.link.to_string()), here.secret());
    let bearer = |secret: &str| format!("Bearer {secret}");
    for (path, secret, status) in [
        ("/nozzle/stack", None, 401),
        ("/nozzle/stack", Some("0123456789abcdef0123456789abcdef"), 401),
        ("/nozzle/stack", Some(&*of_relay), 401),
        ("/nozzle/stack", Some(&of_run), 200),
        ("/-/runs", None, 401),
        ("/-/runs", Some(&of_run), 401),
        ("/-/runs", Some(&of_relay), 200),
        ("/", None, 401),
        ("/", Some(&of_run), 401),
        // The secret of the page lets no run in.
        ("/-/attach", Some(&of_relay), 403),
        ("/-/carry/0123456789abcdef", Some(&of_relay), 403),
        ("/other/", None, 404),
        ("/-/other", None, 404),
        ("/nozzle/../wing/", None, 404),
    ] {
        let bearer = secret.map(bearer);
        let headers: Vec<_> = bearer.iter().map(|text| ("Authorization", &**text)).collect();
        let answer = here.get(path, &headers);
        assert_eq!(answer.status, status, "{path} {answer:?}");
    }
    let mut wrong = run.link.to_string();
    wrong = wrong.replace(&of_run, "0123456789abcdef0123456789abcdef");
    let error = connect(&wrong.parse().expect("a link")).err().expect("refused");
    assert!(matches!(error, ClientError::WrongToken { .. }), "{error}");
    assert_eq!(request(here.relay.address(), "POST", "/nozzle/stack", &[]).status, 405);
    // A `HEAD` is answered as the run does: with what a `GET` says, and no more.
    let of_driver = bearer(&of_run);
    for (path, status) in [("/nozzle/stack", 200), ("/nozzle/other", 404), ("/other/", 404)] {
        let [got, asked] = ["GET", "HEAD"].map(|method| {
            request(here.relay.address(), method, path, &[("Authorization", &of_driver)])
        });
        assert_eq!((got.status, asked.status), (status, status), "{path} {asked:?}");
        let length = asked.header("content-length");
        assert!(length.is_some() && length == got.header("content-length"), "{asked:?}");
        assert!(!got.body.is_empty() && asked.body.is_empty(), "{asked:?}");
    }
}

#[test]
fn a_browser_has_a_cookie_of_each_run_and_none_sees_that_of_the_relay() {
    let here = Here::new(None);
    let port = here.relay.address().port();
    let runs = ["nozzle", "wing"].map(|name| here.run(name));
    let cookie = |path: &str| {
        let answer = here.get(path, &[]);
        assert_eq!(answer.status, 303, "{answer:?}");
        assert_eq!(answer.header("location"), Some("./"));
        let cookie = answer.header("set-cookie").expect("a cookie").to_owned();
        // Without a path it goes to the directory of the page alone.
        assert!(!cookie.contains("Path="), "{cookie}");
        cookie.split(';').next().unwrap_or_default().to_owned()
    };
    let of_runs = runs.each_ref().map(|run| {
        let (_, path) = run.browser_link.split_once(&format!(":{port}")).expect("a path");
        cookie(path)
    });
    let of_relay = cookie(&format!("/?token={}", here.secret()));
    assert!(of_relay.starts_with(&format!("tombolo-relay-{port}=")), "{of_relay}");
    assert!(of_runs.iter().all(|text| text.starts_with(&format!("tombolo-{port}="))));
    let status = |path: &str, cookie: &str| here.get(path, &[("Cookie", cookie)]).status;
    // A browser sends the cookie of the run, and that of the relay, which leads to all.
    for (run, cookie) in ["nozzle", "wing"].into_iter().zip(&of_runs) {
        assert_eq!(status(&format!("/{run}/stack"), &format!("{of_relay}; {cookie}")), 200);
        assert_eq!(status("/-/runs", &format!("{cookie}; {of_relay}")), 200);
        assert_eq!(status("/-/runs", cookie), 401);
        assert_eq!(status(&format!("/{run}/stack"), &of_relay), 401);
    }
    assert_eq!(status("/nozzle/stack", &of_runs[1]), 401);
}

#[test]
fn pages_of_other_sites_and_rebound_names_get_to_no_run() {
    let here = Here::new(None);
    let run = here.run("nozzle");
    let bearer = format!("Bearer {}", token(&run.link.to_string()));
    let own = format!("http://{}", here.relay.address());
    for (headers, status) in [
        (vec![("Origin", &*own)], 200),
        (vec![("Origin", "http://evil.example")], 403),
        (vec![("Host", "rebound.example")], 403),
        (vec![("Host", "rebound.example"), ("Origin", "http://rebound.example")], 403),
    ] {
        let mut headers = headers;
        headers.push(("Authorization", &bearer));
        assert_eq!(here.get("/nozzle/stack", &headers).status, status, "{headers:?}");
    }
}

#[test]
fn a_run_with_a_wrong_secret_is_not_taken_in_and_goes_on() {
    let here = Here::new(None);
    let secrets = here.directory.path().join("wrong.json");
    std::fs::write(&secrets, r#"{"relay": "0123456789abcdef0123456789abcdef"}"#).expect("written");
    std::fs::set_permissions(&secrets, std::os::unix::fs::PermissionsExt::from_mode(0o600))
        .expect("set");
    let mut stream = here.stream("nozzle");
    stream["secrets"] = secrets.display().to_string().into();
    let run = Run::new(&stream, || true);
    run.goes_on();
    assert!(here.names().is_empty());
    let error = connect(&run.link).err().expect("nobody there");
    assert!(!error.to_string().contains("0123456789abcdef"), "{error}");
    // Without any secret it does not begin.
    let text = json!({"version": 1, "stream": {"connect": "http://127.0.0.1:1"}}).to_string();
    let settings = Settings { config: config(&text), ..Settings::default() };
    let error = tombolo::Adaptor::initialize(settings).err().expect("refused").to_string();
    assert!(error.contains("TOMBOLO_RELAY_SECRET"), "{error}");
}

#[test]
fn a_run_that_ends_leaves_the_list_and_its_viewers_hear_how() {
    let here = Here::new(None);
    let kept = here.run("kept");
    let run = here.run("nozzle");
    let client = connect(&run.link).expect("connected");
    assert_eq!(here.names(), ["kept", "nozzle"]);
    drop(run);
    until("the end", || here.names() == ["kept"]);
    until("the last word", || {
        let _ = client.next(Duration::from_millis(50));
        client.end().is_some_and(|end| end.how == "finished")
    });
    steer(&kept.link);
}

#[test]
fn through_tls_a_run_knows_its_relay_by_the_certificate() {
    let here = Here::new(Some(Tls::default()));
    let stream = here.stream("nozzle");
    let run = Run::new(&stream, || true);
    until("the run at its relay", || connect(&run.link).is_ok());
    let link = run.link.to_string();
    assert!(link.starts_with("https://127.0.0.1:") && link.contains("#sha256="), "{link}");
    steer(&run.link);
    // A relay with another certificate is none, whatever it says.
    let mut wrong = stream;
    let address = wrong["connect"].as_str().expect("a text").split('#').next().map(str::to_owned);
    for fragment in [format!("#sha256={}", "0".repeat(64)), String::new()] {
        wrong["connect"] = format!("{}{fragment}", address.as_deref().unwrap_or_default()).into();
        wrong["name"] = "misled".into();
        let misled = Run::new(&wrong, || true);
        misled.goes_on();
        assert!(connect(&misled.link).is_err());
    }
}

#[test]
fn behind_a_proxy_runs_know_the_relay_and_viewers_come_by_its_public_name() {
    let here = Here::with(|settings| {
        settings.tls = Some(Tls::default());
        settings.public = Some("https://portal.example/tombolo/".into());
    });
    let connect = here.stream("nozzle")["connect"].to_string();
    assert!(connect.contains("#sha256="), "{connect}");
    let link = here.relay.link();
    assert!(link.starts_with("https://portal.example/tombolo/?token="), "{link}");
    assert!(!link.contains("sha256"), "{link}");
    let here = Here::with(|settings| settings.public = Some("https://portal.example".into()));
    let bearer = format!("Bearer {}", here.secret());
    for (host, status) in [("portal.example", 200), ("localhost", 200), ("evil.example", 403)] {
        let headers = [("Authorization", &*bearer), ("Host", host)];
        assert_eq!(here.get("/-/runs", &headers).status, status, "{host}");
    }
}

/// The program, as a process of its own.
struct Program(Child);

impl Program {
    fn start(directory: &Path, listen: &str) -> (Self, Value) {
        let mut child = Command::new(env!("CARGO_BIN_EXE_tombolo"))
            .args(["relay", "--listen", listen, "--directory"])
            .arg(directory)
            .stdout(Stdio::piped())
            .spawn()
            .expect("started");
        let mut lines = BufReader::new(child.stdout.take().expect("piped")).lines();
        let stream = lines.find_map(|line| {
            let line = line.expect("a line");
            let (_, stream) = line.split_once("\"stream\": ")?;
            Some(serde_json::from_str(stream).expect("an object"))
        });
        (Self(child), stream.expect("the settings of runs"))
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn a_relay_that_is_killed_and_comes_back_is_found_again() {
    let directory = tempfile::tempdir().expect("a directory");
    let (relay, mut stream) = Program::start(directory.path(), "127.0.0.1:0");
    let place =
        stream["connect"].as_str().expect("a text").trim_start_matches("http://").to_owned();
    let link = std::fs::read_to_string(directory.path().join("relay.link")).expect("a link");
    let (address, secret) = (place.parse().expect("an address"), token(link.trim()));
    stream["name"] = "nozzle".into();
    let run = Run::new(&stream, || names(address, &secret) == ["nozzle"]);
    // One that drove would have the wheel again.
    let options = Options { drives: Drives::Never, ..Options::default() };
    let watching = Client::connect(&run.link, &options).expect("connected");
    drop(relay);
    run.goes_on();
    std::thread::sleep(Duration::from_millis(600));
    run.goes_on();
    // Its secrets and the names of its runs are as they were, and so are links and clients.
    let (_relay, _) = Program::start(directory.path(), &place);
    until("the run", || names(address, &secret) == ["nozzle"]);
    steer(&run.link);
    let now = run.running.cycle();
    until("the client", || {
        watching.next(Duration::from_millis(50)).expect("not given up");
        watching.status().is_some_and(|status| status.cycle > now)
    });
}

#[test]
fn a_run_that_begins_before_its_relay_is_reached_later() {
    let directory = tempfile::tempdir().expect("a directory");
    let (relay, mut stream) = Program::start(directory.path(), "127.0.0.1:0");
    let place =
        stream["connect"].as_str().expect("a text").trim_start_matches("http://").to_owned();
    drop(relay);
    stream["name"] = "early".into();
    let begun = Instant::now();
    let run = Run::new(&stream, || true);
    assert!(begun.elapsed() < Duration::from_secs(60), "a link is waited for a few seconds");
    run.goes_on();
    let (_relay, _) = Program::start(directory.path(), &place);
    until("the run", || connect(&run.link).is_ok());
}

#[test]
fn a_viewer_that_never_reads_costs_the_others_nothing() {
    let here = Here::new(None);
    let run = here.run("nozzle");
    let other = here.run("wing");
    let path = format!("/nozzle/ws?token={}", token(&run.link.to_string()));
    let deaf: Vec<TcpStream> = (0..5)
        .map(|_| {
            let mut stream = TcpStream::connect(here.relay.address()).expect("connected");
            let address = here.relay.address();
            let request = format!(
                "GET {path} HTTP/1.1\r\nHost: {address}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n\
                 Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
            );
            stream.write_all(request.as_bytes()).expect("written");
            let mut first = [0; 12];
            stream.read_exact(&mut first).expect("an answer");
            assert_eq!(&first, b"HTTP/1.1 101");
            stream
        })
        .collect();
    // Frames come at every step; one who reads sees them all the while.
    let options = Options { views: true, ..Options::default() };
    let client = Client::connect(&run.link, &options).expect("connected");
    let mut seen = 0;
    let begun = Instant::now();
    while seen < 100 {
        assert!(begun.elapsed() < PATIENCE, "{seen} frames");
        let received = client.next(PATIENCE).expect("connected");
        seen += usize::from(matches!(received.map(|it| it.event), Some(Event::Frame(_))));
    }
    drop(client);
    steer(&other.link);
    run.goes_on();
    drop(deaf);
}

#[test]
fn an_answer_may_take_longer_than_a_request() {
    let here = Here::new(None);
    let mut run = here.attach(r#"{"version": 1, "name": "slow", "instance": "0123456789abcdef"}"#);
    run.read().expect("taken in");
    let address = here.relay.address();
    let secret = here.secret_for_runs();
    std::thread::scope(|scope| {
        let asking = scope.spawn(|| here.get("/slow/surface", &[]));
        let open: Value = loop {
            if let tungstenite::Message::Text(text) = run.read().expect("asked") {
                break serde_json::from_str(&text).expect("an object");
            }
        };
        let mut carried = TcpStream::connect(address).expect("connected");
        let head = format!(
            "GET /-/carry/{} HTTP/1.1\r\nHost: {address}\r\nAuthorization: Bearer {secret}\r\n\
             Connection: Upgrade\r\nUpgrade: tombolo\r\n\r\n",
            open["ticket"].as_str().expect("a ticket")
        );
        carried.write_all(head.as_bytes()).expect("written");
        // The viewer has shown no secret: it is given five seconds to ask.
        std::thread::sleep(Duration::from_secs(7));
        carried.write_all(b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\nhi").expect("written");
        let answer = asking.join().expect("an answer");
        assert_eq!((answer.status, answer.body.as_str()), (200, "hi"), "{answer:?}");
    });
}

#[test]
fn a_run_that_comes_back_has_one_connection() {
    let here = Here::new(None);
    let first = r#"{"version": 1, "name": "again", "instance": "0123456789abcdef"}"#;
    let mut lost = here.attach(first);
    for _ in 0..100 {
        let mut back = here.attach(first);
        back.read().expect("taken in");
        until("the end of it", || lost.read().map_or(true, |said| said.is_close()));
        lost = back;
    }
    assert_eq!(here.names(), ["again"]);
}

#[test]
fn half_requests_and_rubbish_keep_nobody_out() {
    let here = Here::new(None);
    let run = here.run("nozzle");
    let idle: Vec<TcpStream> = (0..80)
        .map(|number| {
            let mut stream = TcpStream::connect(here.relay.address()).expect("connected");
            let bytes: &[u8] = match number % 3 {
                0 => b"",
                1 => b"GET /nozzle/ HTTP/1.1\r\nHost: ",
                _ => b"\x16\x03\x01\x02\x00\xff\xff\r\n\r\n",
            };
            let _ = stream.write_all(bytes);
            stream
        })
        .collect();
    steer(&run.link);
    assert_eq!(here.names(), ["nozzle"]);
    drop(idle);
    // Rubbish in place of a run's first words.
    for first in
        ["", "{}", "null", r#"{"version": 1, "name": "../x", "instance": "0123456789abcdef"}"#]
    {
        let mut socket = here.attach(first);
        // Whatever is wrong, the reason arrives.
        let tungstenite::Message::Close(Some(close)) = socket.read().expect("the end of it") else {
            panic!("neither taken in nor refused")
        };
        assert!(close.reason.starts_with("its first message: "), "{close}");
    }
    assert_eq!(here.names(), ["nozzle"]);
}
