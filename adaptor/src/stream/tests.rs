//! Faults of Tombolo itself: a server goes on.

use std::sync::atomic::{AtomicUsize, Ordering};

use serde_json::{Map, Value, json};
use tokio_tungstenite::tungstenite;

use super::*;

/// How long a test waits before it fails.
const PATIENCE: Duration = Duration::from_secs(60);

#[test]
fn a_part_of_the_stream_that_panics_is_begun_again() {
    let mut begun = 0;
    while went_wrong("test", || {
        begun += 1;
        assert!(begun > 2, "a fault");
    }) {}
    assert_eq!(begun, 3);
}

/// Panics whenever the time is looked at, and when the first viewer is greeted.
#[derive(Default)]
struct Faulty {
    looked: AtomicUsize,
    greeted: AtomicUsize,
}

impl CommandSink for Faulty {
    fn receive(&self, _: u64, _: Option<String>, _: Message, _: &str) -> Result<(), String> {
        Err("it is not wanted here".into())
    }

    fn driven(&self) {}

    fn look_at_time(&self) {
        self.looked.fetch_add(1, Ordering::Relaxed);
        panic!("a fault");
    }

    fn orders(&self) -> Value {
        assert!(self.greeted.fetch_add(1, Ordering::Relaxed) > 0, "a fault");
        json!([])
    }

    fn order_counts(&self) -> Vec<(&'static str, usize)> {
        Vec::new()
    }

    fn note(&self, _: JournalNote) {}
}

/// The first text that a viewer of a server reads, if it reads one.
fn first_text(server: &Server) -> Option<String> {
    let url = server.link().replacen("http://", "ws://", 1).replacen("/?", "/ws?", 1);
    let address = server.address().expect("an address");
    let stream = std::net::TcpStream::connect(address).expect("connected");
    stream.set_read_timeout(Some(PATIENCE)).expect("set");
    let (mut socket, _) = tungstenite::client(url, stream).expect("let in");
    loop {
        match socket.read() {
            Ok(tungstenite::Message::Text(text)) => return Some(text.to_string()),
            Ok(_) => {}
            Err(tungstenite::Error::Io(error)) if error.kind() == io::ErrorKind::WouldBlock => {
                panic!("nothing is said");
            }
            Err(_) => return None,
        }
    }
}

/// Those who are connected and those who come are served.
#[test]
fn viewers_are_served_by_a_server_with_faults() {
    let settings =
        StreamServer { listen: Some("127.0.0.1:0".parse().unwrap()), ..StreamServer::default() };
    let (hub, faulty) = (Arc::<Hub>::default(), Arc::<Faulty>::default());
    hub.describe(Map::new);
    let commands: Arc<dyn CommandSink> = Arc::clone(&faulty) as Arc<_>;
    let server = Server::start(&settings, Arc::clone(&hub), commands).unwrap();
    let looks = |times: usize| {
        let (begun, before) = (std::time::Instant::now(), faulty.looked.load(Ordering::Relaxed));
        while faulty.looked.load(Ordering::Relaxed) < before + times {
            assert!(begun.elapsed() < PATIENCE, "nobody looks at the time any more");
            std::thread::sleep(STATUS_PERIOD);
        }
    };
    looks(2);
    assert_eq!(first_text(&server), None);
    let greeted = first_text(&server).unwrap();
    assert!(greeted.contains("hello"), "{greeted}");
    looks(1);
    drop(server);
}
