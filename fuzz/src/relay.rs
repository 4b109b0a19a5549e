//! What a relay reads of a run, a run of a relay, and the server of a recording of a viewer: each is
//! the real one, on this machine.

use std::{
    io::Write,
    net::{SocketAddr, TcpStream},
    path::Path,
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicU64, Ordering},
        mpsc::{Sender, channel},
    },
    time::Instant,
};

use serde_json::{Value, json};
use tokio_tungstenite::tungstenite::{Message, WebSocket, client};
use tombolo::{
    client::Link,
    pipelines::language::{RunName, StreamServer},
    play::Playback,
    stream::relay::{Relay, RelaySettings},
};

use crate::server::{PATIENCE, Server, asks_for, head, patient, read_to_end, shake_hands};

/// A secret as runs and relays show it.
const SECRET: &str = "0123456789abcdef0123456789abcdef";
/// The ticket by which it is known that a run has read everything.
const LAST: &str = "ffffffffffffffffffffffffffffffff";
/// Messages of a relay: a run lets those go that ask for more than 64 connections at once.
const SAID: usize = 32;
/// Bytes of a message between a run and a relay, and of one that a viewer may say to a recording.
const RELAYED: usize = 4096;
const WATCHED: usize = 1 << 16;

/// What is begun once, and serves every input.
#[derive(Default)]
pub(crate) struct Services {
    relay: Mutex<Option<(Relay, String)>>,
    watching: Mutex<Option<Watching>>,
}

fn text_of(error: impl ToString) -> String {
    error.to_string()
}

/// A WebSocket at an address of this machine.
fn connect(address: SocketAddr, path: &str) -> Result<WebSocket<TcpStream>, String> {
    let stream = TcpStream::connect(address).map_err(text_of)?;
    patient(&stream).map_err(text_of)?;
    let (socket, _) = client(format!("ws://{address}{path}"), stream).map_err(text_of)?;
    Ok(socket)
}

/// The first words of runs.
pub(crate) fn attach_seeds() -> Vec<Vec<u8>> {
    let attach = |name: &str| json!({"version": 1, "name": name, "instance": SECRET});
    let seeds = [attach("nozzle"), attach(&"n".repeat(48)), attach("a b"), json!({"version": 2})];
    seeds.map(|seed| seed.to_string().into_bytes()).to_vec()
}

/// A run's first words to a relay: it is taken in under a name, or told why not.
pub(crate) fn attach(services: &Services, folder: &Path, text: &str) -> Result<String, String> {
    let mut relay = services.relay.lock().unwrap_or_else(PoisonError::into_inner);
    if relay.is_none() {
        let directory = folder.join("relay");
        let listen = SocketAddr::from(([127, 0, 0, 1], 0));
        let settings = RelaySettings { listen, ..RelaySettings::new(&directory) };
        let started = Relay::start(&settings).map_err(text_of)?;
        let kept = std::fs::read(directory.join("runs.json")).map_err(text_of)?;
        let kept: Value = serde_json::from_slice(&kept).map_err(text_of)?;
        let secret = kept["relay"].as_str().ok_or("the relay has kept no secret")?.to_owned();
        *relay = Some((started, secret));
    }
    let (relay, secret) = relay.as_ref().ok_or("no relay")?;
    let mut socket = connect(relay.address(), &format!("/-/attach?token={secret}"))?;
    let is_long = text.len() > RELAYED;
    let answered = socket.send(Message::text(text)).and_then(|()| {
        loop {
            match socket.read()? {
                Message::Ping(_) | Message::Pong(_) => {}
                answer => break Ok(answer),
            }
        }
    });
    match answered {
        Ok(Message::Text(text)) => {
            let attached: Value = serde_json::from_str(&text).map_err(text_of)?;
            let name = attached["name"].as_str().unwrap_or_default();
            let address = attached["address"].as_str().unwrap_or_default();
            if name.parse::<RunName>().is_err() || !address.ends_with(&format!("/{name}/")) {
                return Err(format!("no name and address: {text}"));
            }
            let _ = socket.close(None);
            read_to_end(&mut socket);
            Ok("taken in".into())
        }
        Ok(Message::Close(Some(close))) if !close.reason.is_empty() => Ok(close.reason.to_string()),
        Ok(other) => Err(format!("neither a name nor a reason: {other:?}")),
        // The rest of it lies unread when the connection ends.
        Err(_) if is_long => Ok("it is too long".into()),
        Err(error) => Err(format!("neither a name nor a reason: {error}")),
    }
}

/// What a relay says to a run, a message a line, and then the head by which a connection for a viewer
/// goes over.
pub(crate) fn relayed_seeds() -> Vec<Vec<u8>> {
    let digits = "0a".repeat(32);
    let open = json!({"ticket": SECRET, "viewer": "192.0.2.1"});
    let attached = |address: &str, sha256: Option<&str>| json!({"name": "nozzle", "address": address, "sha256": sha256});
    let upgraded = "HTTP/1.1 101 Switching Protocols\nconnection: upgrade\nupgrade: tombolo\n\n";
    let refused = "HTTP/1.1 410 Gone\n\nnobody waits for this connection any more\n";
    let request = "GET / HTTP/1.1\nHost: 127.0.0.1\n\n";
    [
        format!("{}\n{open}\n{upgraded}", attached("http://127.0.0.1:7400/nozzle/", None)),
        format!("{}\n{open}\n{upgraded}{request}", attached("http://[::1]:1/nozzle/", None)),
        format!("{}\n{open}\n{open}\n{refused}", attached("https://relay/n/", Some(&digits))),
        format!("{}\n{upgraded}", attached("https://portal.example/a/n-2/", None)),
    ]
    .map(String::into_bytes)
    .to_vec()
}

/// The end of what a run reads of a relay.
enum Read {
    /// It has come for the last ticket.
    All,
    /// It has ended the connection.
    GivenUp,
}

/// A run, which serves a recording, hears all that from a relay. It goes on to do what the relay asks, or
/// ends the connection; its links can be read by clients, whatever name and address it was given.
pub(crate) fn relayed(folder: &Path, recording: &Path, text: &str) -> Result<String, String> {
    let at = text.match_indices("HTTP/").map(|(at, _)| at).next().unwrap_or(text.len());
    let (said, answer) = text.split_at(at);
    let mut said: Vec<String> = said.lines().take(SAID).map(str::to_owned).collect();
    said.push(json!({"ticket": LAST, "viewer": "192.0.2.2"}).to_string());
    let answer = answer.replace('\n', "\r\n");
    let (tell, told) = channel();
    let server = Server::start(move |stream| serve(stream, &said, &answer, &tell));
    let server = server.map_err(text_of)?;
    let settings = json!({"connect": format!("http://{}", server.address()),
                          "secrets": secrets(folder).map_err(text_of)?,
                          "name": "nozzle"});
    let settings: StreamServer = serde_json::from_value(settings).map_err(text_of)?;
    let playback = Playback::start(recording, &settings).map_err(text_of)?;
    match told.recv_timeout(PATIENCE) {
        Ok(Read::GivenUp) => Ok("given up".into()),
        Ok(Read::All) => {
            let link = playback.link();
            match link.parse::<Link>() {
                Ok(read) => Ok(format!("reached at {}", read.host())),
                Err(error) => Err(format!("its link cannot be read: {error}: {link}")),
            }
        }
        Err(_) => Err("it neither does what it is asked nor gives up".into()),
    }
}

/// Serves one connection of a run as a relay would.
fn serve(mut stream: TcpStream, said: &[String], answer: &str, tell: &Sender<Read>) {
    if asks_for(&stream, "/-/attach") {
        let Some(mut socket) = shake_hands(stream) else { return };
        // Its own first words.
        let _ = socket.read();
        let all = said.iter().try_for_each(|line| socket.send(Message::text(line.as_str())));
        let tell = tell.clone();
        std::thread::spawn(move || {
            if all.is_ok() {
                read_to_end(&mut socket);
            }
            let _ = tell.send(Read::GivenUp);
        });
        return;
    }
    let asked = head(&mut stream);
    let _ = stream.write_all(answer.as_bytes());
    if asked.contains(LAST) {
        let _ = tell.send(Read::All);
    }
}

/// The file with the secret that a run shows a relay.
fn secrets(folder: &Path) -> std::io::Result<std::path::PathBuf> {
    let file = folder.join("secrets.json");
    if !file.exists() {
        let mut options = std::fs::OpenOptions::new();
        options.write(true).create_new(true);
        #[cfg(unix)]
        std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
        options.open(&file)?.write_all(json!({"relay": SECRET}).to_string().as_bytes())?;
    }
    Ok(file)
}

/// A viewer of a recording.
struct Watching {
    socket: WebSocket<TcpStream>,
    frames: u64,
    _playback: Playback,
}

/// What viewers say to a recording.
pub(crate) fn playback_seeds() -> Vec<Vec<u8>> {
    let seeds = [
        json!({"play": {"seek": {"seconds": 0.01}}}),
        json!({"play": {"seek": {"cycle": 7}, "speed": 2.0}}),
        json!({"id": "a", "play": {"seek": {"time": 0.05}, "paused": true}}),
        json!({"play": {"paused": false, "speed": 0.5}}),
        json!({"here": {}}),
        json!({"drive": {}}),
        json!({"views": {"names": ["boundary"]}}),
        json!({"id": "b", "order": {"undo": 1}}),
    ];
    seeds.map(|seed| seed.to_string().into_bytes()).to_vec()
}

/// A viewer says something to a recording: it is obeyed, or told what is wrong under the message's own
/// id, and stays connected.
pub(crate) fn playback(
    services: &Services,
    recording: &Path,
    text: &str,
) -> Result<String, String> {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let mut watching = services.watching.lock().unwrap_or_else(PoisonError::into_inner);
    let mut viewer = match watching.take() {
        Some(viewer) => viewer,
        None => Watching::new(recording)?,
    };
    // What comes back under this id comes behind every answer to the text.
    let id = format!("behind-{}", COUNT.fetch_add(1, Ordering::Relaxed));
    let outcome = viewer.hear(text, &id);
    // One that is cut off comes anew.
    if outcome.as_ref().is_ok_and(Option::is_some) {
        *watching = Some(viewer);
    }
    match outcome? {
        Some(outcome) => Ok(outcome),
        None if text.len() > WATCHED => Ok("it is too long".into()),
        None => Err("the connection has ended".into()),
    }
}

impl Watching {
    fn new(recording: &Path) -> Result<Self, String> {
        let settings = json!({"listen": "127.0.0.1:0"});
        let settings: StreamServer = serde_json::from_value(settings).map_err(text_of)?;
        let playback = Playback::start(recording, &settings).map_err(text_of)?;
        let address = playback.address().ok_or("the recording is served nowhere")?;
        let link = playback.link();
        let token = link.split_once("token=").map_or("", |(_, token)| token);
        let socket = connect(address, &format!("/ws?token={token}"))?;
        Ok(Self { socket, frames: 0, _playback: playback })
    }

    /// Says a text and hears what is answered; `None` where the connection has ended.
    fn hear(&mut self, text: &str, last: &str) -> Result<Option<String>, String> {
        let said = [
            text.to_owned(),
            json!({"id": last, "stop": {}}).to_string(),
            // The answers go before what this has told.
            json!({"play": {}}).to_string(),
        ];
        for text in said {
            if self.socket.send(Message::text(text)).is_err() {
                return Ok(None);
            }
        }
        let said = serde_json::from_str::<Value>(text).unwrap_or_default();
        // One that is no text is not told back.
        let id = said.get("id").filter(|id| id.is_string());
        let until = Instant::now() + PATIENCE;
        let mut outcome = "obeyed".to_owned();
        while Instant::now() < until {
            match self.socket.read() {
                Ok(Message::Binary(_)) => {
                    self.frames += 1;
                    let decoded = self.frames.to_le_bytes().to_vec();
                    if self.socket.send(Message::binary(decoded)).is_err() {
                        return Ok(None);
                    }
                }
                Ok(Message::Text(told)) => {
                    let told: Value = serde_json::from_str(&told).map_err(text_of)?;
                    let Some(error) = told.get("error") else { continue };
                    if error["id"] == last {
                        return Ok(Some(outcome));
                    }
                    let message = error["message"].as_str().unwrap_or_default();
                    // The player has not come to what was said before.
                    let is_late = error["id"].is_null() && message.contains("messages that wait");
                    if !is_late && id.is_some_and(|id| *id != error["id"]) {
                        return Err(format!("it is told of another message: {error}"));
                    }
                    outcome = message.to_owned();
                }
                Ok(Message::Close(_)) | Err(_) => return Ok(None),
                Ok(_) => {}
            }
        }
        Err("it is not answered".into())
    }
}
