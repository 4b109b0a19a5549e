//! A client of a run: what it is told, what it does, and what becomes of it when the connection is
//! lost or something else answers.

mod common;

use std::{
    io::{Read, Write},
    net::TcpListener,
    sync::atomic::{AtomicBool, Ordering},
    time::{Duration, Instant},
};

use common::{
    LINK_TO_ALL, PATIENCE,
    proxy::Proxy,
    running::{MONITORED, Run, until},
    squeeze,
};
use tokio_tungstenite::tungstenite;
use tombolo::{
    OrderStatus,
    client::{Client, ClientError, Drives, Event, Link, Options},
    pipelines::language::{Order, parse_valid},
};

fn quick() -> Options {
    Options { attempts: 1000, longest_pause: Duration::from_millis(250), ..Options::default() }
}

fn order(by: f64) -> Order {
    parse_valid(&squeeze(by).to_string(), "order").expect("an order")
}

fn applied(client: &Client, id: &str) {
    until(client, "applied order", |told| match &told.event {
        Event::Order(order) if order.id == id => {
            assert_ne!(order.status, OrderStatus::Rejected, "{:?}", order.reason);
            (order.status == OrderStatus::Applied).then_some(())
        }
        Event::Error(error) => panic!("{}", error.message),
        _ => None,
    });
}

#[test]
fn a_client_watches_and_steers() {
    let run = Run::new(MONITORED);
    let client = Client::connect(&run.link, &Options::default()).expect("connected");
    client.drive(PATIENCE).expect("the wheel");
    let inflow = client.hello().expect("said").parameters[0].clone();
    assert_eq!((&*inflow.name, inflow.unit.as_deref()), ("inflow", Some("m/s")));
    until(&client, "monitor", |told| match &told.event {
        Event::Monitor(values) => {
            assert_eq!(values.pipeline, "health");
            values.values.get("speed.max").copied().flatten()
        }
        _ => None,
    });
    let asked = client.forecast(&order(0.3)).expect("sent");
    let foretold = until(&client, "forecast", |told| match &told.event {
        Event::Forecast(foretold) if foretold.id.as_ref() == Some(&asked) => {
            Some(foretold.order.clone())
        }
        Event::Error(error) => panic!("{}", error.message),
        _ => None,
    });
    assert_eq!(foretold.quality.map(|quality| quality.inverted), Some(0));
    // More than may wait for an answer: none of them does for ever.
    for _ in 0..150 {
        client.forecast(&order(0.2)).expect("sent");
        let withdrawn = client.withdraw_forecast().expect("sent");
        until(&client, "done", |told| match &told.event {
            Event::Done(done) => (done.id == withdrawn).then_some(()),
            _ => None,
        });
    }
    applied(&client, &client.order(&order(0.3)).expect("sent"));
    applied(&client, &client.undo(std::num::NonZeroU32::MIN).expect("sent"));
    let refused = client.set("inflaw", 2.0).expect("sent");
    until(&client, "error", |told| match &told.event {
        Event::Error(error) if error.id.as_ref() == Some(&refused) => {
            assert!(error.message.contains("inflow"), "{}", error.message);
            Some(())
        }
        _ => None,
    });
    client.pause().expect("sent");
    client.wait_for_status(PATIENCE, |status| status.paused).expect("paused");
    client.resume().expect("sent");
    client.wait_for_status(PATIENCE, |status| !status.paused).expect("going on");
    assert_eq!(client.pipelines().expect("a list")[0]["name"], "boundary");
    assert_eq!(client.surface().expect("a surface").points().len(), 98);

    let other = Client::connect(&run.link, &Options::default()).expect("connected");
    // Whoever reads events meanwhile does not take the reason away.
    let asked = AtomicBool::new(false);
    let refused = std::thread::scope(|scope| {
        scope.spawn(|| {
            while !asked.load(Ordering::Relaxed) {
                let _ = other.next(Duration::from_millis(1));
            }
        });
        let refused = other.drive(PATIENCE);
        asked.store(true, Ordering::Relaxed);
        refused
    });
    let Err(ClientError::NotDriver { reason }) = refused else { panic!("{refused:?}") };
    assert_ne!(reason, "nothing was said");
    drop(other);

    client.stop().expect("sent");
    let end = until(&client, "end", |told| match &told.event {
        Event::End(end) => Some(end.how.clone()),
        _ => None,
    });
    assert_eq!(end, "stopped");
    while client.next(PATIENCE).is_ok() {}
    assert!(matches!(client.next(PATIENCE), Err(ClientError::Closed)));
    assert_eq!(run.end().orders.len(), 2);
}

#[test]
fn frames_come_decoded_to_those_who_ask_and_to_no_others() {
    let run = Run::new(LINK_TO_ALL);
    let options = Options { views: true, ..Options::default() };
    let seeing = Client::connect(&run.link, &options).expect("connected");
    let mut cycles: Vec<u64> = Vec::new();
    while cycles.len() < 6 {
        cycles.push(until(&seeing, "frame", |told| match &told.event {
            Event::Frame(frame) => {
                assert_eq!((frame.view.as_str(), frame.points.len()), ("boundary", 98));
                Some(frame.cycle)
            }
            _ => None,
        }));
    }
    assert!(cycles.is_sorted(), "{cycles:?}");
    drop(seeing);
    run.end();
    let run = Run::new(LINK_TO_ALL);
    let blind = Client::connect(&run.link, &Options::default()).expect("connected");
    let from = blind.wait_for_status(PATIENCE, |_| true).expect("a status").cycle;
    blind.wait_for_status(PATIENCE, |status| status.cycle > from + 300).expect("steps");
    drop(blind);
    let report = run.end();
    let (frames, runs) = (report.stream.frames, report.pipelines[0].runs);
    assert!(frames == 0 && runs < 200, "{frames} frames and {runs} runs for one that sees none");
}

#[test]
fn the_views_that_were_chosen_are_those_that_come_also_after_a_lost_connection() {
    let run = Run::new(
        r#"{"version": 1, "stream": {"listen": "127.0.0.1:0"}, "pipelines": [
            {"name": "boundary", "stages": [{"surface": {}}, {"stream": {}}]},
            {"name": "middle", "stages": [
                {"slice": {"origin": [0.5, 0.5, 0.5], "normal": [1, 0, 0]}}, {"stream": {}}]}]}"#,
    );
    let proxy = Proxy::to(run.address);
    let options = Options { views: true, ..quick() };
    let client = Client::connect(&run.over(proxy.port), &options).expect("connected");
    let next = |client: &Client| {
        until(client, "frame", |told| match &told.event {
            Event::Frame(frame) => Some((frame.view.clone(), frame.cycle)),
            _ => None,
        })
    };
    for view in ["middle", "boundary"] {
        client.choose_views(Some([view.to_owned()].into())).expect("few");
        // Frames that were on their way come first.
        while next(&client).0 != view {}
        let (_, from) = next(&client);
        // Frames of the other view that were on their way have come by then.
        while next(&client).1 < from + 300 {}
        assert_eq!(next(&client).0, view);
    }
    proxy.drop_all();
    until(&client, "another connection", |told| {
        matches!(told.event, Event::Hello(_)).then_some(())
    });
    let from = client.status().expect("told").cycle;
    while next(&client).1 < from + 300 {}
    assert_eq!(next(&client).0, "boundary");
    let many = (0..2000).map(|number| format!("view {number}")).collect();
    let refused = client.choose_views(Some(many));
    assert!(matches!(refused, Err(ClientError::TooMuch { .. })), "{refused:?}");
    drop(client);
    run.end();
}

#[test]
fn a_lost_connection_is_made_again_and_an_order_is_given_once() {
    let run = Run::new(LINK_TO_ALL);
    let proxy = Proxy::to(run.address);
    let client = Client::connect(&run.over(proxy.port), &quick()).expect("connected");
    client.drive(PATIENCE).expect("the wheel");
    let first = client.hello().expect("said").client.clone();
    for round in 1..=3 {
        // It may be lost before the order has come, or before its answer has.
        let id = client.order(&order(0.05)).expect("sent");
        proxy.drop_all();
        let begun = std::time::Instant::now();
        loop {
            assert!(begun.elapsed() < PATIENCE, "order {round} is not applied");
            let told = client.next(PATIENCE).expect("connected").expect("an event");
            let reports = match &told.event {
                Event::Order(report) => vec![(**report).clone()],
                Event::Hello(hello) => hello.orders.clone(),
                Event::Error(error) => panic!("{}", error.message),
                _ => continue,
            };
            let own = reports.iter().find(|report| report.id == id);
            assert!(own.is_none_or(|report| report.status != OrderStatus::Rejected), "{own:?}");
            if own.is_some_and(|report| report.status == OrderStatus::Applied) {
                break;
            }
        }
    }
    assert_eq!(client.hello().expect("said").client, first, "it came back by its name");
    assert!(client.drives(), "it has the wheel again");
    drop(client);
    assert_eq!(run.end().orders.len(), 3);
}

#[test]
fn a_command_that_the_network_swallows_is_sent_again() {
    let run = Run::new(LINK_TO_ALL);
    let proxy = Proxy::to(run.address);
    let client = Client::connect(&run.over(proxy.port), &quick()).expect("connected");
    client.drive(PATIENCE).expect("the wheel");
    proxy.swallow(true);
    let id = client.set("inflow", 2.0).expect("sent");
    // However long nobody answers, it is not given up.
    std::thread::sleep(Duration::from_secs(2));
    proxy.drop_all();
    proxy.swallow(false);
    let begun = Instant::now();
    loop {
        assert!(begun.elapsed() < PATIENCE, "the command is lost");
        match client.next(PATIENCE).expect("connected").expect("an event").event {
            Event::Done(done) if done.id == id => break,
            Event::Error(error) => panic!("{}", error.message),
            _ => {}
        }
    }
    drop(client);
    run.end();
}

#[test]
fn silence_is_no_refusal_of_the_wheel() {
    let run = Run::new(LINK_TO_ALL);
    let proxy = Proxy::to(run.address);
    let options = Options { drives: Drives::OnRequest, ..quick() };
    let client = Client::connect(&run.over(proxy.port), &options).expect("connected");
    proxy.swallow(true);
    let silent = client.drive(Duration::from_millis(300));
    assert!(matches!(silent, Err(ClientError::NoAnswer { .. })), "{silent:?}");
    proxy.drop_all();
    proxy.swallow(false);
    client.drive(PATIENCE).expect("the wheel, once the connection is there again");
    drop(client);
    run.end();
}

#[test]
fn a_closed_client_has_let_go_of_the_wheel_while_it_is_still_there() {
    let run = Run::new(MONITORED);
    let first = Client::connect(&run.link, &Options::default()).expect("connected");
    first.drive(PATIENCE).expect("the wheel");
    first.close();
    first.close();
    assert_eq!(first.pause(), Err(ClientError::Closed));
    let second = Client::connect(&run.link, &Options::default()).expect("connected");
    second.drive(PATIENCE).expect("the wheel");
    let over = loop {
        match first.next(PATIENCE) {
            Ok(Some(_)) => {}
            other => break other.map(drop),
        }
    };
    assert_eq!(over, Err(ClientError::Closed));
    drop(second);
    run.end();
}

/// What listens answers each connection so, and is asked by a client.
fn answered_by(answer: &'static [u8]) -> ClientError {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let port = listener.local_addr().expect("an address").port();
    std::thread::spawn(move || {
        for mut stream in listener.incoming().flatten() {
            let mut asked = [0; 4096];
            let _ = stream.read(&mut asked);
            let _ = stream.write_all(answer);
        }
    });
    let link: Link = format!("http://127.0.0.1:{port}/?token=abc").parse().expect("a link");
    Client::connect(&link, &Options::default()).err().expect("no run")
}

/// A server that greets as a run does, and answers every request by this.
fn asked_of(answer: &'static str) -> Client {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let port = listener.local_addr().expect("an address").port();
    std::thread::spawn(move || {
        let hello = r#"{"hello": {"protocol": 2, "client": "c1", "role": "watcher"}}"#;
        let first = listener.accept().expect("a client").0;
        let mut socket = tungstenite::accept(first).expect("a WebSocket");
        socket.send(tungstenite::Message::text(hello)).expect("sent");
        for mut stream in listener.incoming().flatten() {
            let _ = stream.read(&mut [0; 4096]);
            let _ = write!(stream, "HTTP/1.0 200 OK\r\n\r\n{answer}");
        }
    });
    let link: Link = format!("http://127.0.0.1:{port}/?token=abc").parse().expect("a link");
    Client::connect(&link, &Options::default()).expect("connected")
}

#[test]
fn answers_without_an_end_or_with_what_is_not_seen_are_refused() {
    // It would be asked for more 16384 times.
    let begun = Instant::now();
    let error = asked_of(r#"{"revision": 1, "count": 2, "edits": []}"#).stack().err();
    assert!(matches!(error, Some(ClientError::NotTombolo { .. })), "{error:?}");
    assert!(begun.elapsed() < Duration::from_secs(10), "{:?}", begun.elapsed());
    let strange = r#"{"revision": 1, "count": 1, "edits": [{"\u001b[31m": {}}]}"#;
    let error = asked_of(strange).stack().expect_err("no edit").to_string();
    assert!(error.contains("[31m") && !error.chars().any(char::is_control), "{error:?}");
}

#[test]
fn what_is_no_run_or_not_this_one_is_told_by_name() {
    for nonsense in [
        &b"SSH-2.0-OpenSSH_9.6\r\n"[..],
        b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\nhi",
        b"HTTP/1.1 404 Not Found\r\n\r\n",
        b"\xff\x00\xfe\xfe\xfe\xfe\r\n\r\n",
    ] {
        let error = answered_by(nonsense);
        assert!(matches!(error, ClientError::NotTombolo { .. }), "{error:?}");
    }
    let error = answered_by(b"");
    assert!(matches!(error, ClientError::HungUp { .. }), "{error:?}");
    let run = Run::new(LINK_TO_ALL);
    let wrong: Link = format!("http://{}/?token=0123", run.address).parse().expect("a link");
    let error = Client::connect(&wrong, &Options::default()).err();
    assert!(matches!(error, Some(ClientError::WrongToken { .. })), "{error:?}");
    let few = r#"{"version": 1, "stream": {"listen": "127.0.0.1:0", "limits": {"viewers": 2}}}"#;
    let full = Run::new(few);
    let (mut held, mut error) = (Vec::new(), None);
    while error.is_none() && held.len() < 8 {
        match Client::connect(&full.link, &Options::default()) {
            Ok(client) => held.push(client),
            Err(refused) => error = Some(refused),
        }
    }
    assert!(matches!(error, Some(ClientError::TooManyViewers { .. })), "{error:?}");
    drop(held);
    full.end();
    let link = run.link.clone();
    run.end();
    let error = Client::connect(&link, &Options::default()).err();
    assert!(matches!(error, Some(ClientError::Refused { .. })), "{error:?}");
}
