//! A viewer without a picture: the protocol's client in a few lines.

use std::net::TcpStream;
use std::time::{Duration, Instant};

use futures_util::{SinkExt, StreamExt};
use serde_json::Value;
use tokio::runtime::{Builder, Runtime};
use tokio_tungstenite::tungstenite;
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream};

use crate::PATIENCE;

/// The link a run prints: where it listens and the token.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Link {
    /// `host:port`.
    pub address: String,
    /// The token.
    pub token: String,
}

impl Link {
    /// The link in a line of output, or in the file that the line names, if there is one.
    #[must_use]
    pub fn find(line: &str) -> Option<Link> {
        if let Some(url) = driving(line) {
            return Link::find(&url);
        }
        let rest = &line[line.find("http://")? + "http://".len()..];
        let address = rest.split('/').next()?.to_owned();
        let token = rest.split("token=").nth(1)?;
        let token: String = token.chars().take_while(char::is_ascii_alphanumeric).collect();
        (!token.is_empty()).then_some(Link { address, token })
    }

    /// The address with a token, for a browser.
    #[must_use]
    pub fn url(&self) -> String {
        format!("http://{}/?token={}", self.address, self.token)
    }

    /// A link to this run with another token.
    #[must_use]
    pub fn with_token(&self, token: &str) -> Link {
        Link { address: self.address.clone(), token: token.to_owned() }
    }

    /// A bare TCP connection to the run.
    ///
    /// # Panics
    /// Where nobody listens.
    #[must_use]
    pub fn tcp(&self) -> TcpStream {
        let stream = TcpStream::connect(&self.address).expect("the run listens");
        stream.set_read_timeout(Some(PATIENCE)).expect("a timeout can be set");
        stream
    }
}

/// The address for a browser that drives, from the file that a line of a run's output names.
#[must_use]
pub fn driving(line: &str) -> Option<String> {
    let (_, path) = line.split_once("the links to this run are in ")?;
    let text = std::fs::read_to_string(crate::project().join(path)).ok()?;
    text.lines().find_map(|line| line.strip_prefix("drive: ")).map(str::to_owned)
}

/// A message of the server.
#[derive(Debug, Clone, PartialEq)]
pub enum Message {
    /// A JSON message.
    Text(Value),
    /// A frame.
    Frame(Vec<u8>),
}

/// A connected client.
pub struct Viewer {
    runtime: Runtime,
    socket: WebSocketStream<MaybeTlsStream<tokio::net::TcpStream>>,
}

impl Viewer {
    /// Connects.
    ///
    /// # Errors
    /// The server's answer instead, as text.
    ///
    /// # Panics
    /// Where no runtime can be made.
    pub fn connect(link: &Link) -> Result<Viewer, String> {
        let runtime = Builder::new_current_thread().enable_all().build().expect("a runtime");
        let url = format!("ws://{}/ws?token={}", link.address, link.token);
        let (socket, _) = runtime
            .block_on(tokio_tungstenite::connect_async(url))
            .map_err(|error| error.to_string())?;
        Ok(Viewer { runtime, socket })
    }

    /// Sends one JSON message.
    ///
    /// # Panics
    /// Where the connection is gone.
    pub fn send(&mut self, message: &Value) {
        self.send_raw(tungstenite::Message::text(message.to_string()));
    }

    /// Sends any message, well formed or not.
    ///
    /// # Panics
    /// Where the connection is gone.
    pub fn send_raw(&mut self, message: tungstenite::Message) {
        self.runtime.block_on(self.socket.send(message)).expect("the connection holds");
    }

    /// The next message; `None` when the connection is closed or `limit` has passed.
    pub fn next(&mut self, limit: Duration) -> Option<Message> {
        let until = Instant::now() + limit;
        loop {
            let left = until.saturating_duration_since(Instant::now());
            let message = self
                .runtime
                .block_on(async { tokio::time::timeout(left, self.socket.next()).await });
            match message.ok()??.ok()? {
                tungstenite::Message::Text(text) => {
                    return Some(Message::Text(
                        serde_json::from_str(&text).expect("the server sends JSON"),
                    ));
                }
                tungstenite::Message::Binary(bytes) => return Some(Message::Frame(bytes.to_vec())),
                _ => {}
            }
        }
    }

    /// Waits for the first JSON message of this name for which `wanted` holds, and returns its
    /// content.
    ///
    /// # Panics
    /// Where none comes in a long time.
    pub fn wait_for(&mut self, name: &str, wanted: impl Fn(&Value) -> bool) -> Value {
        let until = Instant::now() + PATIENCE;
        let mut last = Value::Null;
        while let Some(message) = self.next(until.saturating_duration_since(Instant::now())) {
            let Message::Text(message) = message else { continue };
            if let Some(content) = message.get(name) {
                if wanted(content) {
                    return content.clone();
                }
                last = content.clone();
            }
        }
        panic!("no such '{name}' came; the last was {last}");
    }

    /// Waits until the run is paused, and lets it go on: a resume that comes before the pause would
    /// do nothing.
    ///
    /// # Panics
    /// Where it is not paused in a long time.
    pub fn resume(&mut self) {
        self.wait_for("status", |status| status["paused"] == true);
        self.send(&serde_json::json!({"resume": {}}));
    }

    /// Asks for the wheel until it is there: it may be kept for another for some seconds. Frames that
    /// come meanwhile are passed over.
    ///
    /// # Panics
    /// Where it is not there in a long time.
    pub fn take_wheel(&mut self) {
        let until = Instant::now() + PATIENCE;
        loop {
            self.send(&serde_json::json!({"id": "wheel", "drive": {}}));
            // It is answered with a new hello where it is granted, and else with an error; who has it
            // already is answered with nothing.
            loop {
                match self.next(PATIENCE).expect("an answer comes") {
                    Message::Text(answer) if answer["hello"]["role"] == "driver" => return,
                    Message::Text(answer) if answer["error"]["id"] == "wheel" => break,
                    Message::Text(_) | Message::Frame(_) => {}
                }
            }
            assert!(Instant::now() < until, "the wheel was never free");
            std::thread::sleep(Duration::from_millis(500));
        }
    }

    /// Waits for the next frame.
    ///
    /// # Panics
    /// Where none comes in a long time.
    pub fn frame(&mut self) -> Vec<u8> {
        let until = Instant::now() + PATIENCE;
        while let Some(message) = self.next(until.saturating_duration_since(Instant::now())) {
            if let Message::Frame(bytes) = message {
                return bytes;
            }
        }
        panic!("no frame came");
    }

    /// Drops the connection without a word, as a killed browser does.
    pub fn kill(self) {
        drop(self.socket);
    }
}
