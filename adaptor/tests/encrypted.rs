//! Encrypted connections, and sockets at a path: one server, however it is reached.
#![cfg(unix)]

mod common;

use std::{
    io::{Read, Write},
    net::TcpStream,
    os::unix::{
        fs::{FileTypeExt, PermissionsExt},
        net::UnixStream,
    },
    path::Path,
    time::{Duration, Instant},
};

use common::{
    Solver, config,
    running::{self, Running, connect},
};
use serde_json::{Value, json};
use tombolo::{
    Adaptor, Settings,
    client::{ClientError, Link},
};

const PATIENCE: Duration = Duration::from_secs(300);

fn settings(stream: Value) -> Settings {
    let config = config(&json!({"version": 1, "stream": stream}).to_string());
    Settings { config, ..Settings::default() }
}

/// A run that goes on by itself.
struct Run {
    link: Link,
    _running: Running,
}

impl Run {
    fn new(stream: Value) -> Self {
        let solver = Solver::new(settings(stream));
        let link = solver.adaptor.link().expect("a server").parse().expect("a link");
        Self { link, _running: Running::start(solver) }
    }
}

/// Steers a run through its link, and reads what it serves beside its WebSocket.
fn steer(link: &Link) {
    let client = running::steer(link);
    assert_eq!(client.pipelines().expect("an answer"), json!([]));
}

fn with_fingerprint(link: &Link, fingerprint: &str) -> Link {
    let text = link.to_string();
    let (place, _) = text.split_once('#').expect("a fingerprint");
    format!("{place}{fingerprint}").parse().expect("a link")
}

#[test]
fn a_run_is_steered_through_tls_by_those_who_know_its_certificate() {
    let run = Run::new(json!({"listen": "127.0.0.1:0", "tls": {}}));
    assert!(run.link.to_string().starts_with("https://127.0.0.1:"), "{:?}", run.link);
    steer(&run.link);
    // Neither another certificate's fingerprint nor one that nobody has signed.
    let another = format!("#sha256={}", "0".repeat(64));
    for (fingerprint, words) in [(another.as_str(), "another fingerprint"), ("", "certificate")] {
        let error = connect(&with_fingerprint(&run.link, fingerprint)).err().expect("refused");
        assert!(matches!(error, ClientError::Certificate { .. }), "{error}");
        assert!(error.to_string().contains(words), "{error}");
    }
    // Those who do not encrypt are told that, and nothing else.
    let plain = run.link.to_string().replacen("https://", "http://", 1).parse().expect("a link");
    let error = connect(&plain).err().expect("refused");
    assert!(matches!(error, ClientError::Encrypted { .. }), "{error}");
}

#[test]
fn what_others_can_reach_is_encrypted_unless_it_is_expressly_not() {
    let link = |stream: Value| settings(stream).start().map(|run| run.link().expect("a server"));
    let open = link(json!({"listen": "0.0.0.0:0"})).expect("started");
    assert!(open.starts_with("https://") && open.contains("#sha256="), "{open}");
    let insecure = link(json!({"listen": "0.0.0.0:0", "insecure": true})).expect("started");
    assert!(insecure.starts_with("http://"), "{insecure}");
    // Nobody can connect to every address: the links name the machine, where the system tells its name.
    if let Ok(name) = std::fs::read_to_string("/proc/sys/kernel/hostname") {
        for link in [&open, &insecure] {
            let (_, rest) = link.split_once("://").expect("a scheme");
            let (host, _) = rest.split_once(':').expect("a port");
            assert!(host == name.trim() && host != "0.0.0.0", "{link}");
        }
    }
    let loopback = link(json!({"listen": "127.0.0.1:0"})).expect("started");
    assert!(loopback.starts_with("http://"), "{loopback}");
    let both = json!({"listen": "127.0.0.1:0", "insecure": true, "tls": {}});
    assert!(link(both).expect_err("refused").to_string().contains("stream.tls"));
}

#[test]
fn a_certificate_comes_from_files_whose_key_nobody_else_can_read() {
    let directory = tempfile::tempdir().expect("a directory");
    let files = ["certificate.pem", "key.pem"].map(|name| directory.path().join(name));
    let made = rcgen::generate_simple_self_signed(["localhost".into()]).expect("made");
    std::fs::write(&files[0], made.cert.pem()).expect("written");
    std::fs::write(&files[1], made.signing_key.serialize_pem()).expect("written");
    let stream =
        json!({"listen": "127.0.0.1:0", "tls": {"certificate": files[0], "key": files[1]}});
    let set =
        |mode| std::fs::set_permissions(&files[1], PermissionsExt::from_mode(mode)).expect("set");
    set(0o644);
    let refused = settings(stream.clone()).start().err().expect("refused").to_string();
    assert!(refused.contains("chmod 600"), "{refused}");
    set(0o600);
    steer(&Run::new(stream).link);
    let half = json!({"listen": "127.0.0.1:0", "tls": {"certificate": files[0]}});
    let refused = settings(half).start().err().expect("refused").to_string();
    assert!(refused.contains("go together"), "{refused}");
}

#[test]
fn a_socket_at_a_path_is_its_owners_alone_and_goes_with_the_run() {
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path().join("tombolo.sock");
    let listen = json!({"listen": format!("unix:{}", path.display())});
    let run = Run::new(listen.clone());
    let metadata = std::fs::symlink_metadata(&path).expect("a socket");
    assert!(metadata.file_type().is_socket());
    assert_eq!(metadata.permissions().mode() & 0o777, 0o600);
    assert_eq!(run.link.socket_path(), Some(Path::new(&path)));
    steer(&run.link);
    // `tombolo link` prints a link with a key, and how a browser reaches a socket.
    let printed = std::process::Command::new(env!("CARGO_BIN_EXE_tombolo"))
        .args(["link", &run.link.to_string()])
        .output()
        .expect("the program runs");
    let (address, advice) =
        (String::from_utf8_lossy(&printed.stdout), String::from_utf8_lossy(&printed.stderr));
    let (socket, query) = address.trim_end().split_once('?').expect("a link with a key");
    assert_eq!(socket, format!("unix:{}", path.display()));
    assert!(advice.contains(&format!("ssh -N -L 7070:{} HOST", path.display())), "{advice}");
    assert!(advice.contains(&format!("http://127.0.0.1:7070/?{query} ")), "{advice}");
    // A secret is asked for here too.
    let mut stream = UnixStream::connect(&path).expect("connected");
    stream.write_all(b"GET /pipelines HTTP/1.0\r\nHost: localhost\r\n\r\n").expect("sent");
    let mut answer = String::new();
    stream.read_to_string(&mut answer).expect("an answer");
    assert!(answer.starts_with("HTTP/1.0 401"), "{answer}");
    // Nobody else has it meanwhile.
    let refused = settings(listen.clone()).start().err().expect("refused").to_string();
    assert!(refused.contains("in use"), "{refused}");
    steer_again(&run);
    drop(run);
    assert!(!path.exists(), "it goes with the run");
    // One that was left behind makes way, and any other file does not.
    drop(std::os::unix::net::UnixListener::bind(&path).expect("bound"));
    assert!(path.exists());
    steer(&Run::new(listen.clone()).link);
    std::fs::write(&path, "precious").expect("written");
    let refused = settings(listen).start().err().expect("refused").to_string();
    assert!(refused.contains("another file"), "{refused}");
    assert_eq!(std::fs::read_to_string(&path).expect("read"), "precious");
    assert_eq!(std::fs::read_dir(directory.path()).expect("read").count(), 1, "something is left");
}

fn steer_again(run: &Run) {
    let client = connect(&run.link).expect("connected");
    client.wait_for_status(PATIENCE, |_| true).expect("it goes on");
}

/// nginx, as a process of its own.
struct Proxy(std::process::Child);

impl Proxy {
    /// Serves at a port with the part of a configuration that the documentation prints.
    fn start(directory: &Path, port: u16, location: &str) -> Self {
        let place = directory.display();
        let temporary: String = ["client_body", "proxy", "fastcgi", "uwsgi", "scgi"]
            .map(|kind| format!("{kind}_temp_path {place}/{kind};\n"))
            .concat();
        let text = format!(
            "user root;\ndaemon off;\npid {place}/pid;\nerror_log {place}/error.log;\nevents {{}}\n\
             http {{\naccess_log off;\n{temporary}server {{\nlisten 127.0.0.1:{port};\n{location}\n}}\n}}\n"
        );
        let file = directory.join("nginx.conf");
        std::fs::write(&file, text).expect("written");
        let unpacked = concat!(env!("CARGO_MANIFEST_DIR"), "/../.venv/nginx/usr/sbin/nginx");
        let is_unpacked = Path::new(unpacked).exists();
        let program = if is_unpacked { unpacked } else { "/usr/sbin/nginx" };
        let mut command = std::process::Command::new(program);
        let child = command.arg("-e").arg(directory.join("error.log")).arg("-c").arg(file).spawn();
        Self(child.expect("nginx, which scripts/setup unpacks"))
    }
}

impl Drop for Proxy {
    fn drop(&mut self) {
        // So that its workers end too.
        let _ = std::process::Command::new("kill").arg(self.0.id().to_string()).status();
        let _ = self.0.wait();
    }
}

#[test]
fn behind_nginx_as_the_documentation_sets_it_up_a_run_is_steered_under_a_prefix() {
    let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/operations.md");
    let page = std::fs::read_to_string(page).expect("read");
    let (_, rest) = page.split_once("```nginx\n").expect("a configuration");
    let (location, _) = rest.split_once("```").expect("its end");
    let directory = tempfile::tempdir().expect("a directory");
    let socket = directory.path().join("nozzle.sock");
    let printed = "/run/tombolo/nozzle.sock";
    assert!(location.contains(printed));
    let location = location.replace(printed, &socket.display().to_string());
    let run = Run::new(json!({"listen": format!("unix:{}", socket.display())}));
    let free = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    let port = free.local_addr().expect("an address").port();
    drop(free);
    let _proxy = Proxy::start(directory.path(), port, &location);
    let begun = Instant::now();
    while TcpStream::connect(("127.0.0.1", port)).is_err() {
        assert!(begun.elapsed() < PATIENCE, "nginx does not listen");
        std::thread::sleep(Duration::from_millis(20));
    }
    let link = run.link.to_string();
    let (_, token) = link.split_once("?token=").expect("a token");
    let link = format!("http://127.0.0.1:{port}/runs/nozzle/?token={token}");
    steer(&link.parse().expect("a link"));
    // A browser is given a cookie for what is below the prefix, and comes by the name of the proxy.
    let ask = |path: &str, more: &str| {
        let mut stream = TcpStream::connect(("127.0.0.1", port)).expect("connected");
        let request = format!(
            "GET {path} HTTP/1.1\r\nHost: localhost:{port}\r\nConnection: close\r\n{more}\r\n"
        );
        stream.write_all(request.as_bytes()).expect("sent");
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).expect("an answer");
        String::from_utf8_lossy(&answer).into_owned()
    };
    let traded = ask(&format!("/runs/nozzle/?token={token}"), "");
    assert!(traded.starts_with("HTTP/1.1 303"), "{traded}");
    let cookie = traded.lines().find_map(|line| line.strip_prefix("set-cookie: "));
    let cookie =
        cookie.or_else(|| traded.lines().find_map(|line| line.strip_prefix("Set-Cookie: ")));
    let cookie = cookie.expect("a cookie").split(';').next().expect("a pair").to_owned();
    assert!(
        cookie.starts_with(&format!("tombolo-{port}=")) && !traded.contains("Path="),
        "{traded}"
    );
    let cookie = format!("Cookie: {cookie}\r\n");
    assert!(ask("/runs/nozzle/stack", &cookie).starts_with("HTTP/1.1 200"));
    assert!(ask("/runs/nozzle/stack", "").starts_with("HTTP/1.1 401"));
    let foreign = format!("{cookie}Origin: http://evil.example\r\n");
    assert!(ask("/runs/nozzle/stack", &foreign).starts_with("HTTP/1.1 403"));
}

#[test]
fn who_shakes_no_hands_keeps_nobody_out() {
    let run = Run::new(json!({"listen": "127.0.0.1:0", "tls": {}}));
    let flood: Vec<TcpStream> = (0..200)
        .map(|number: u32| {
            let mut stream = TcpStream::connect(run.link.address()).expect("taken");
            // Silence, rubbish, or the first bytes of a handshake that never goes on.
            let bytes: &[u8] = match number % 3 {
                0 => b"",
                1 => b"GET / HTTP/1.1\r\n\r\n",
                _ => b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03",
            };
            let _ = stream.write_all(bytes);
            stream
        })
        .collect();
    let begun = Instant::now();
    steer(&run.link);
    assert!(begun.elapsed() < Duration::from_secs(60), "{:?}", begun.elapsed());
    drop(flood);
}

#[test]
fn the_invitation_tells_the_fingerprint() {
    let directory = tempfile::tempdir().expect("a directory");
    let stream = json!({"listen": "127.0.0.1:0", "tls": {}});
    let settings = Settings { output: directory.path().into(), ..settings(stream) };
    let mut adaptor = Adaptor::initialize(settings).expect("started");
    let link = adaptor.link().expect("a server");
    let (_, digits) = link.split_once("#sha256=").expect("a fingerprint");
    let told = adaptor.invitation(true).expect("written").expect("a server");
    let fingerprint = told.lines().last().expect("a line").replace(':', "");
    assert!(fingerprint.ends_with(digits), "{told}");
}
