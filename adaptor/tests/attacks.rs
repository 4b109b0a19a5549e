//! Those who should not be let in, who should not command, and who want to keep others out: each is
//! refused, the solver goes on, and one with a right secret gets in meanwhile.

mod common;

use std::{
    io::{Read, Write},
    net::{SocketAddr, TcpStream},
    time::{Duration, Instant},
};

use common::{LINK_TO_ALL, Solver, Viewer, socket_url, squeeze};
use serde_json::json;
use tokio_tungstenite::tungstenite::Message;
use tombolo::{
    Adaptor,
    deform::shapes::box_of_tets,
    pipelines::{encode::Decoder, limits::VALUES},
};

/// How soon one with a right secret gets in, on however busy a machine.
const SOON: Duration = Duration::from_secs(5);
/// How soon most of those with a right secret get in during a flood.
const SOON_MOSTLY: Duration = Duration::from_secs(1);

fn address(adaptor: &Adaptor) -> SocketAddr {
    adaptor.address().expect("a server")
}

/// Sends bytes and reads what comes until the other side closes.
fn raw(adaptor: &Adaptor, bytes: &[u8]) -> String {
    let mut stream = TcpStream::connect(address(adaptor)).expect("connected");
    stream.set_read_timeout(Some(Duration::from_secs(20))).expect("a timeout");
    let _ = stream.write_all(bytes);
    let mut answer = Vec::new();
    let _ = stream.read_to_end(&mut answer);
    String::from_utf8_lossy(&answer).into_owned()
}

fn get(adaptor: &Adaptor, path: &str, headers: &str) -> String {
    let host = format!("localhost:{}", address(adaptor).port());
    let request =
        format!("GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n{headers}\r\n");
    raw(adaptor, request.as_bytes())
}

/// The status and the headers of an answer.
fn head(answer: &str) -> (&str, Vec<(String, &str)>) {
    let mut lines = answer.split("\r\n");
    let status = lines.next().unwrap_or_default().get(9..12).unwrap_or_default();
    let headers =
        lines.take_while(|line| !line.is_empty()).filter_map(|line| line.split_once(": "));
    (status, headers.map(|(name, value)| (name.to_ascii_lowercase(), value)).collect())
}

fn header<'a>(answer: &'a str, name: &str) -> Option<&'a str> {
    head(answer).1.into_iter().find(|(key, _)| key == name).map(|(_, value)| value)
}

fn path_of(link: &str) -> String {
    format!("/{}", link.rsplit_once('/').expect("a link has a path").1)
}

fn watching_url(adaptor: &Adaptor) -> String {
    let link = adaptor.watching_link().expect("a server");
    link.replacen("http://", "ws://", 1).replacen("/?", "/ws?", 1)
}

/// Connects with a right secret, which takes less than [`SOON`], and steps the solver; returns how
/// long the connection took.
fn all_is_well(solver: &mut Solver) -> Duration {
    let begun = Instant::now();
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    let taken = begun.elapsed();
    assert!(taken < SOON, "it took {taken:?}");
    solver.steps(3);
    assert!(solver.is_at_reference() && !solver.stopped);
    drop(viewer);
    taken
}

/// How long a step of the solver takes at the median.
fn median_step(solver: &mut Solver) -> Duration {
    median((0..101).map(|_| {
        let begun = Instant::now();
        solver.step();
        begun.elapsed()
    }))
}

fn median(times: impl IntoIterator<Item = Duration>) -> Duration {
    let mut times: Vec<Duration> = times.into_iter().collect();
    times.sort();
    times[times.len() / 2]
}

#[test]
fn a_link_is_traded_for_a_cookie_and_used_up() {
    let mut solver = Solver::with_config(LINK_TO_ALL);
    let adaptor = &solver.adaptor;
    let link = path_of(&adaptor.browser_link().expect("a link"));
    let answer = get(adaptor, &format!("{link}&view=side"), "");
    assert_eq!((head(&answer).0, header(&answer, "location")), ("303", Some("./?view=side")));
    let cookie = header(&answer, "set-cookie").expect("a cookie").to_owned();
    let name = format!("tombolo-{}=", address(adaptor).port());
    assert!(cookie.starts_with(&name), "{cookie}");
    assert!(cookie.contains("HttpOnly") && cookie.contains("SameSite=Strict"), "{cookie}");
    let shown = format!("Cookie: {}\r\n", cookie.split(';').next().unwrap());

    // The cookie opens what a secret opens, in a second tab too.
    for _ in 0..2 {
        assert_eq!(head(&get(adaptor, "/pipelines", &shown)).0, "200");
    }
    assert_eq!(head(&get(adaptor, "/pipelines", "")).0, "401");
    // The key opens no second browser, and says what to do; the first one goes on.
    let again = get(adaptor, &link, "");
    assert!(head(&again).0 == "401" && again.contains("once"), "{again}");
    assert!(header(&again, "set-cookie").is_none());
    let again = get(adaptor, &link, &shown);
    assert!(head(&again).0 == "303" && header(&again, "set-cookie").is_none(), "{again}");
    // A link with the secret itself is traded too.
    let answer = get(adaptor, &path_of(&adaptor.link().expect("a link")), "");
    assert_eq!((head(&answer).0, header(&answer, "location")), ("303", Some("./")));
    assert!(header(&answer, "set-cookie").is_some());
    all_is_well(&mut solver);
}

#[test]
fn no_wrong_and_stale_secrets_let_nobody_in() {
    let stale = Solver::with_config(LINK_TO_ALL);
    let (old, key) = (stale.adaptor.link().unwrap(), stale.adaptor.browser_link().unwrap());
    let answer = get(&stale.adaptor, &path_of(&stale.adaptor.browser_link().unwrap()), "");
    let cookie =
        header(&answer, "set-cookie").unwrap().split(['=', ';']).nth(1).unwrap().to_owned();
    stale.finish();

    let mut solver = Solver::with_config(LINK_TO_ALL);
    let adaptor = &solver.adaptor;
    let port = address(adaptor).port();
    let right = path_of(&adaptor.link().unwrap());
    let secret = right.split_once('=').unwrap().1;
    let no_headers = String::new();
    for path in ["/ws", "/surface", "/pipelines", "/schema"] {
        for (query, headers) in [
            ("", no_headers.clone()),
            ("?token=", no_headers.clone()),
            ("?token=%00", no_headers.clone()),
            (&format!("?token={}", &secret[1..]), no_headers.clone()),
            (&format!("?token=0&token={secret}"), no_headers.clone()),
            (&format!("?{}", old.split_once('?').unwrap().1), no_headers.clone()),
            (&format!("?{}", key.split_once('?').unwrap().1), no_headers.clone()),
            ("", format!("Cookie: tombolo-{port}={cookie}\r\n")),
            ("", format!("Cookie: tombolo-{port}={secret}\r\n")),
            ("", "Authorization: Bearer 0\r\n".into()),
            ("", format!("Authorization: Basic {secret}\r\n")),
        ] {
            let answer = get(adaptor, &format!("{path}{query}"), &headers);
            assert_eq!(head(&answer).0, "401", "{path}{query} {headers}: {answer}");
            assert!(!answer.contains(secret), "the answer tells the secret");
        }
    }
    let bearer = format!("Authorization: Bearer {secret}\r\n");
    assert_eq!(head(&get(adaptor, "/pipelines", &bearer)).0, "200");
    all_is_well(&mut solver);
}

#[test]
fn one_with_the_secret_for_watching_never_commands() {
    let mut solver = Solver::with_config(LINK_TO_ALL);
    solver.step();
    // The first to come, and alone: it does not drive.
    let mut watcher = Viewer::try_connect(&watching_url(&solver.adaptor)).expect("let in");
    let hello = watcher.hello();
    assert_eq!((&hello["role"], &hello["may_drive"]), (&json!("watcher"), &json!(false)));
    for (index, message) in [
        json!({"drive": {}}),
        json!({"order": squeeze(0.3)}),
        json!({"forecast": squeeze(0.3)}),
        json!({"pause": {}}),
        json!({"stop": {}}),
        json!({"pipelines": {"remove": ["boundary"]}}),
        json!({"hand_over": {"to": "c1"}}),
        json!({"keep": {}}),
        json!({"kick": {"client": "c2"}}),
    ]
    .into_iter()
    .enumerate()
    {
        let mut message = message;
        message["id"] = json!(index.to_string());
        watcher.send(&message);
        let told =
            solver.step_until_told(&mut watcher, "error", |error| error["id"] == message["id"]);
        assert!(told["message"].as_str().unwrap().contains("watch"), "{told}");
    }
    // The cookie that its link is traded for is one for watching too.
    let link = path_of(&solver.adaptor.watching_link().unwrap());
    let answer = get(&solver.adaptor, &link, "");
    assert!(header(&answer, "set-cookie").is_some());
    let mut driver = Viewer::connect(&solver.adaptor);
    assert_eq!(driver.hello()["role"], "driver", "the wheel was free all the time");
    solver.step_until_told(&mut watcher, "status", |status| status["driver"] == "c2");
    // Its frames it has.
    assert!(!watcher.frames.is_empty());
    drop(driver);
    all_is_well(&mut solver);
}

#[test]
fn the_wheel_goes_to_whom_the_driver_gives_it_and_to_no_thief_of_names() {
    let mut solver = Solver::with_config(LINK_TO_ALL);
    solver.step();
    let mut first = Viewer::connect(&solver.adaptor);
    let told = first.hello();
    let name = told["client"].as_str().unwrap().to_owned();
    let mut second = Viewer::connect(&solver.adaptor);
    let other = second.hello()["client"].clone();
    // The name is public; what goes with it is not.
    let url = socket_url(&solver.adaptor);
    for back in ["", "&back=", "&back=0", &format!("&back={name}")] {
        let mut thief = Viewer::try_connect(&format!("{url}&client={name}{back}")).unwrap();
        let hello = thief.hello();
        assert!(hello["role"] == "watcher" && hello["client"] != name.as_str(), "{hello}");
    }
    let back = told["back"].as_str().unwrap();
    let by_watching = format!("{}&client={name}&back={back}", watching_url(&solver.adaptor));
    assert_eq!(Viewer::try_connect(&by_watching).unwrap().hello()["role"], "watcher");

    second.send(&json!({"id": "take", "hand_over": {"to": other}}));
    second.wait_for("error", |error| error["id"] == "take");
    second.send(&json!({"id": "kick", "kick": {"client": name}}));
    second.wait_for("error", |error| error["id"] == "kick");
    second.send(&json!({"id": "ask", "drive": {}}));
    second.wait_for("error", |error| error["id"] == "ask");
    first.wait_for("wheel", |wheel| wheel["asked_by"] == other);
    first.send(&json!({"hand_over": {"to": other}}));
    second.wait_for("hello", |hello| hello["role"] == "driver");
    first.wait_for("hello", |hello| hello["role"] == "watcher");
    first.send(&json!({"id": "late", "pause": {}}));
    first.wait_for("error", |error| error["id"] == "late");
    second.send(&json!({"kick": {"client": name}}));
    assert_eq!(first.closed(), Some(4001));
    drop(second);
    all_is_well(&mut solver);
}

#[test]
fn a_driver_that_comes_back_before_its_loss_is_noticed_has_the_wheel_at_once() {
    let mut solver = Solver::with_config(LINK_TO_ALL);
    let mut lost = Viewer::connect(&solver.adaptor);
    let told = lost.hello();
    let (name, back) = (told["client"].as_str().unwrap(), told["back"].as_str().unwrap());
    let url = format!("{}&client={name}&back={back}", socket_url(&solver.adaptor));
    let mut again = Viewer::try_connect(&url).expect("let in");
    let told = again.hello();
    assert_eq!((&told["client"], &told["role"]), (&json!(name), &json!("driver")));
    assert_eq!(lost.closed(), Some(4002));
    again.send(&json!({"pause": {}}));
    again.send(&json!({"resume": {}}));
    again.wait_for("status", |status| status["viewers"] == 1);
    drop(again);
    all_is_well(&mut solver);
}

#[test]
fn another_takes_over_from_a_driver_that_is_silent() {
    let config =
        LINK_TO_ALL.replace("127.0.0.1:0\"", "127.0.0.1:0\", \"limits\": {\"driver_silence\": 4}");
    let mut solver = Solver::with_config(&config);
    let mut silent = Viewer::connect(&solver.adaptor);
    silent.hello();
    let mut other = Viewer::connect(&solver.adaptor);
    other.hello();
    for _ in 0..3 {
        std::thread::sleep(Duration::from_secs(1));
        silent.send(&json!({"here": {}}));
        silent.wait_for("status", |_| true);
        other.send(&json!({"id": "early", "drive": {}}));
        other.wait_for("error", |error| error["id"] == "early");
        solver.step();
    }
    std::thread::sleep(Duration::from_secs(4));
    other.send(&json!({"drive": {}}));
    other.wait_for("hello", |hello| hello["role"] == "driver");
    silent.wait_for("hello", |hello| hello["role"] == "watcher");
    drop((silent, other));
    all_is_well(&mut solver);
}

#[test]
fn foreign_pages_and_names_get_nothing_with_the_right_secret_either() {
    let mut solver = Solver::with_config(LINK_TO_ALL);
    let adaptor = &solver.adaptor;
    let path = path_of(&adaptor.link().unwrap());
    let token = path.trim_start_matches('/');
    let port = address(adaptor).port();
    for origin in
        ["http://evil.example", "null", "http://localhost:1", "http://127.0.0.1.evil.example"]
    {
        for path in ["/ws", "/pipelines", "/"] {
            let answer = get(adaptor, &format!("{path}{token}"), &format!("Origin: {origin}\r\n"));
            assert_eq!(head(&answer).0, "403", "{origin} {path}");
            assert!(header(&answer, "set-cookie").is_none());
        }
    }
    for host in
        ["evil.example", "localhost.evil.example", "127.0.0.1@evil.example", "169.254.0.1", ""]
    {
        for path in ["/ws", "/pipelines", "/"] {
            let request = format!(
                "GET {path}{token} HTTP/1.1\r\nHost: {host}:{port}\r\nConnection: close\r\n\r\n"
            );
            assert_eq!(head(&raw(adaptor, request.as_bytes())).0, "403", "{host} {path}");
        }
    }
    for path in [
        "/../Cargo.toml",
        "/..%2f..%2fetc/passwd",
        "/%2e%2e/%2e%2e/etc/passwd",
        "//etc/passwd",
        "/assets/../../secret",
        "/.git/config",
        "/..\\..\\secret",
        "/index.html/..",
    ] {
        let status = get(adaptor, path, "");
        assert!(head(&status).0.starts_with('4'), "{path}: {status}");
    }
    all_is_well(&mut solver);
}

#[test]
fn a_flood_of_connections_keeps_nobody_out() {
    let mut solver = Solver::with_config(LINK_TO_ALL);
    let in_peace = median_step(&mut solver);
    let to = address(&solver.adaptor);
    let connect = move || TcpStream::connect(to).ok();
    // Some say nothing, some half a request, some a byte now and then, as long as they are let.
    let mut held = Vec::new();
    let mut slow = Vec::new();
    for index in 0..240 {
        let Some(mut stream) = connect() else { continue };
        match index % 3 {
            0 => held.push(stream),
            1 => {
                let _ = stream.write_all(b"GET / HTTP/1.1\r\nHost: localhost\r\nX-Wait: ");
                held.push(stream);
            }
            _ => slow.push(stream),
        }
        if index % 60 == 59 {
            all_is_well(&mut solver);
        }
    }
    // And they keep coming while others want in.
    let is_over = std::sync::Arc::new(std::sync::atomic::AtomicBool::new(false));
    let flood = std::thread::spawn({
        let is_over = is_over.clone();
        move || {
            let mut held = std::collections::VecDeque::new();
            while !is_over.load(std::sync::atomic::Ordering::Relaxed) {
                held.extend(connect());
                if held.len() > 150 {
                    held.pop_front();
                }
                for stream in &mut slow {
                    let _ = stream.write_all(b"G");
                }
                std::thread::sleep(Duration::from_millis(4));
            }
        }
    });
    let mut taken = Vec::new();
    for _ in 0..5 {
        taken.push(all_is_well(&mut solver));
        let begun = Instant::now();
        let link = path_of(&solver.adaptor.browser_link().unwrap());
        assert_eq!(head(&get(&solver.adaptor, &link, "")).0, "303");
        taken.push(begun.elapsed());
        assert!(begun.elapsed() < SOON);
    }
    let flooded = median_step(&mut solver);
    println!("let in after {taken:?}, a step takes {flooded:?}, in peace {in_peace:?}");
    assert!(median(taken.iter().copied()) < SOON_MOSTLY, "{taken:?}");
    // A machine whose cores are all taken is slow by itself; waiting for a connection would be far slower.
    assert!(flooded < 10 * in_peace + Duration::from_millis(5), "{flooded:?}, not {in_peace:?}");
    is_over.store(true, std::sync::atomic::Ordering::Relaxed);
    flood.join().expect("no panic");
    // Those that said too little are let go by themselves too.
    let mut last = connect().expect("connected");
    last.set_read_timeout(Some(Duration::from_secs(15))).unwrap();
    last.write_all(b"GET / HT").unwrap();
    let begun = Instant::now();
    assert!(!last.read(&mut [0; 16]).is_ok_and(|count| count > 0), "closed");
    assert!((3..12).contains(&begun.elapsed().as_secs()), "{:?}", begun.elapsed());
    drop(held);
    all_is_well(&mut solver);
}

#[test]
fn the_driver_has_a_place_when_all_others_are_taken() {
    let config =
        LINK_TO_ALL.replace("127.0.0.1:0\"", "127.0.0.1:0\", \"limits\": {\"viewers\": 3}");
    let mut solver = Solver::with_config(&config);
    let url = watching_url(&solver.adaptor);
    let mut watchers: Vec<Viewer> = (0..3).map(|_| Viewer::try_connect(&url).unwrap()).collect();
    watchers.iter_mut().for_each(|watcher| assert_eq!(watcher.hello()["role"], "watcher"));
    assert_eq!(Viewer::try_connect(&url).unwrap().closed(), Some(1013));
    let mut driver = Viewer::connect(&solver.adaptor);
    let told = driver.hello();
    assert_eq!(told["role"], "driver");
    assert_eq!(Viewer::connect(&solver.adaptor).closed(), Some(1013));
    // And comes back to it.
    drop(driver);
    let url = format!(
        "{}&client={}&back={}",
        socket_url(&solver.adaptor),
        told["client"].as_str().unwrap(),
        told["back"].as_str().unwrap()
    );
    let mut driver = Viewer::try_connect(&url).unwrap();
    assert_eq!(driver.hello()["role"], "driver");
    drop(driver);
    solver.step_until_told(&mut watchers[0], "status", |status| status["viewers"] == 3);
    all_is_well(&mut solver);
}

/// Nothing that is longer than what it may say at all is even held in memory.
#[test]
fn one_who_watches_sends_no_long_messages() {
    let mut solver = Solver::with_config(LINK_TO_ALL);
    let as_watcher = format!("{}&role=watch", socket_url(&solver.adaptor));
    for url in [watching_url(&solver.adaptor), as_watcher] {
        let mut watcher = Viewer::try_connect(&url).expect("let in");
        watcher.hello();
        // One that is read, and refused.
        watcher.send_text(&" ".repeat(60 << 10));
        let told = watcher.wait_for("error", |_| true);
        assert!(told["message"].as_str().unwrap().contains("for watching"), "{told}");
        watcher.send_unwelcome(Message::text(" ".repeat(70 << 10)));
        watcher.wait_for_end();
    }
    all_is_well(&mut solver);
}

#[test]
fn a_new_connection_is_no_way_around_the_limit_of_messages() {
    let mut solver = Solver::with_config(LINK_TO_ALL);
    let url = watching_url(&solver.adaptor);
    let begun = Instant::now();
    for _ in 0..5 {
        let mut viewer = Viewer::try_connect(&url).expect("let in");
        (0..20).for_each(|_| viewer.send_unwelcome(Message::text("{}")));
        // Each is answered, late as it may be.
        (0..20).for_each(|_| drop(viewer.wait_for("error", |_| true)));
    }
    // 40 at once, and 20 a second.
    let taken = begun.elapsed();
    assert!(taken > Duration::from_millis(2900), "100 messages in {taken:?}");
    // Who drives has an allowance of its own.
    let mut driver = Viewer::connect(&solver.adaptor);
    driver.hello();
    driver.send(&json!({"id": "wrong", "nothing": {}}));
    driver.wait_for("error", |error| error["id"] == "wrong");
    drop(driver);
    all_is_well(&mut solver);
}

#[test]
fn bytes_of_all_kinds_are_refused() {
    let mut solver = Solver::with_config(LINK_TO_ALL);
    solver.step();
    let in_peace = median_step(&mut solver);
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    for (open, close) in [("[", "]"), ("{\"a\":", "}"), ("{\"order\":[", "]}")] {
        let deep = format!("{}1{}", open.repeat(100_000), close.repeat(100_000));
        viewer.send_text(&deep);
        let told = solver.step_until_told(&mut viewer, "error", |_| true);
        assert!(told["message"].as_str().unwrap().len() < 2000, "{told}");
    }
    // More values than there may be, in fewer bytes than there may be. They are counted while the
    // solver steps.
    let wide =
        format!(r#"{{"id": "wide", "order": {{"stack": [{}1]}}}}"#, "1,".repeat(VALUES.most));
    viewer.send_text(&wide);
    let flooded = median_step(&mut solver);
    let told = solver.step_until_told(&mut viewer, "error", |error| error["id"] == "wide");
    let beyond = VALUES.check(VALUES.most + 1).expect_err("too many").to_string();
    assert!(told["message"].as_str().unwrap().ends_with(&beyond), "{told}");
    let mut random = fastrand::Rng::with_seed(1);
    for length in [1, 3, 16, 300, 5000, 200_000] {
        let mut noise = vec![0; length];
        random.fill(&mut noise);
        let _ = TcpStream::connect(address(&solver.adaptor))
            .and_then(|mut stream| stream.write_all(&noise));
    }
    // A head that is far too long, and a body that nobody asked for.
    let long = format!("GET / HTTP/1.1\r\nHost: localhost\r\nX: {}\r\n\r\n", "a".repeat(1 << 20));
    assert!(!head(&raw(&solver.adaptor, long.as_bytes())).0.starts_with('2'));
    let body = "POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 99999999999\r\nConnection: close\r\n\r\n";
    assert_eq!(head(&raw(&solver.adaptor, body.as_bytes())).0, "405");
    drop(viewer);
    all_is_well(&mut solver);
    let behind = median_step(&mut solver);
    println!("a step takes {flooded:?}, then {behind:?}, in peace {in_peace:?}");
    for taken in [flooded, behind] {
        assert!(taken < 10 * in_peace + Duration::from_millis(5), "{taken:?}, not {in_peace:?}");
    }
}

/// A slow link is at most two frames late, and a reader is not cut off as long as it reads.
#[test]
fn a_slow_reader_sees_new_frames_and_is_not_cut() {
    read_slowly(100_000);
}

#[test]
fn a_reader_of_300_kilobytes_a_second_sees_new_frames_and_is_not_cut() {
    read_slowly(300_000);
}

/// Reads `rate` bytes a second for 25 seconds.
fn read_slowly(rate: usize) {
    let config = r#"{"version": 1, "stream": {"listen": "127.0.0.1:0"}, "pipelines": [
        {"name": "boundary", "stages": [{"surface": {}}, {"stream": {"error": {"absolute": 1e-9}}}]}]}"#;
    let mesh = box_of_tets([30; 3], [0.0; 3], [1.0; 3]);
    let mut solver = Solver { mesh: mesh.clone(), reference: mesh, ..Solver::with_config(config) };
    let begun = Instant::now();
    let mut stepped = vec![begun];
    solver.step();
    let socket = socket2::Socket::new(socket2::Domain::IPV4, socket2::Type::STREAM, None).unwrap();
    // What the system holds for a reader on this machine a slow link does not.
    socket.set_recv_buffer_size(16 << 10).unwrap();
    socket.connect(&address(&solver.adaptor).into()).unwrap();
    let mut stream = TcpStream::from(socket);
    let query = path_of(&solver.adaptor.watching_link().unwrap());
    let request = format!(
        "GET /ws{} HTTP/1.1\r\nHost: localhost\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n\
         Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n",
        query.trim_start_matches('/')
    );
    stream.write_all(request.as_bytes()).unwrap();
    stream.set_nonblocking(true).unwrap();
    let (mut bytes, mut taken) = (Vec::<u8>::new(), 0);
    // How long each frame is, and how old it was when it had come.
    let mut seen: Vec<(usize, Duration)> = Vec::new();
    let mut decoder = Decoder::new();
    while begun.elapsed() < Duration::from_secs(25) {
        stepped.push(Instant::now());
        solver.step();
        std::thread::sleep(Duration::from_millis(5));
        let allowed = (begun.elapsed().as_secs_f64() * rate as f64) as usize;
        let mut buffer = vec![0; allowed.saturating_sub(taken).min(1 << 16)];
        match stream.read(&mut buffer) {
            Ok(0) => assert!(buffer.is_empty(), "it was cut after {:?}", begun.elapsed()),
            Ok(count) => {
                taken += count;
                bytes.extend(&buffer[..count]);
            }
            Err(error) => assert_eq!(error.kind(), std::io::ErrorKind::WouldBlock),
        }
        while let Some((opcode, message)) = next_message(&mut bytes) {
            if opcode == 2 {
                let frame = decoder.decode(&message).expect("a frame");
                let cycle = usize::try_from(frame.cycle).expect("few");
                seen.push((message.len(), stepped[cycle].elapsed()));
            }
        }
    }
    // The first is long, and shows what follows it late.
    let later = &seen[seen.len() / 4..];
    let oldest = later.iter().map(|(_, age)| *age).max().expect("frames");
    let mostly = median(later.iter().map(|(_, age)| *age));
    let size = later.iter().map(|(size, _)| size).sum::<usize>() / later.len();
    let frame = Duration::from_secs_f64(size as f64 / rate as f64);
    let (frames, steps) = (seen.len(), stepped.len());
    println!(
        "{taken} bytes, {frames} frames of {size}, {steps} steps; a frame takes {frame:?}; \
         they are {mostly:?} old, the oldest {oldest:?}"
    );
    assert!(taken > 15 * rate, "the link was not full: {taken} bytes in frames of {size}");
    // Two frames, and the time that a frame itself takes; now and then a busy machine is late.
    assert!(mostly < 3 * frame + Duration::from_millis(100), "{mostly:?}, a frame takes {frame:?}");
    assert!(oldest < 3 * frame + Duration::from_secs(2), "{oldest:?}, a frame takes {frame:?}");
}

/// Takes the first whole message of a server from the bytes, without the head of the answer.
fn next_message(bytes: &mut Vec<u8>) -> Option<(u8, Vec<u8>)> {
    if bytes.starts_with(b"HTTP/1.1") {
        let end = bytes.windows(4).position(|four| four == b"\r\n\r\n")? + 4;
        bytes.drain(..end);
    }
    let (opcode, short) = (bytes.first()? & 15, usize::from(bytes.get(1)? & 127));
    let (start, length) = match short {
        126 => (4, usize::from(u16::from_be_bytes(bytes.get(2..4)?.try_into().ok()?))),
        127 => (10, u64::from_be_bytes(bytes.get(2..10)?.try_into().ok()?) as usize),
        short => (2, short),
    };
    let message = bytes.get(start..start + length)?.to_vec();
    bytes.drain(..start + length);
    Some((opcode, message))
}
