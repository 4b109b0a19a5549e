//! Recordings, shown to viewers over the protocol of a run: each viewer goes through them by itself.

use std::{
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicU64, AtomicUsize, Ordering},
        mpsc::{Receiver, RecvTimeoutError, sync_channel},
    },
    time::{Duration, Instant},
};

use axum::extract::ws::{CloseFrame, Message as Wire, WebSocket};
use futures_util::{SinkExt, StreamExt};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use tokio::sync::mpsc;
use tombolo_pipelines::language::{JournalNote, Message, parse_json};

use super::{
    CommandSink,
    stack::{Answer, recorded_change, recorded_edits},
};
use crate::recording::{Moment, Recorded, RecordedMessage, Recording};

/// How often a viewer is told where in the recording it is.
const PERIOD: Duration = Duration::from_millis(250);
/// Messages on their way to a viewer.
const WAITING: usize = 4;
/// Frames that a viewer may have yet to decode, and how long it is waited for.
const UNDECODED: u64 = 8;
const PATIENCE: Duration = Duration::from_secs(5);
/// How fast a recording may be gone through.
const SPEEDS: std::ops::RangeInclusive<f64> = 0.01..=1000.0;
/// Requests of a viewer that may wait for their turn.
const SAID: usize = 64;
/// Errors that may wait for a viewer to read them.
const ERRORS: usize = 16;
/// Orders that a viewer is told of at once, the newest.
const ORDERS: usize = 100;

/// What a viewer asks for.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Asked {
    #[serde(default)]
    id: Option<String>,
    play: Play,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Play {
    seek: Option<Seek>,
    speed: Option<f64>,
    paused: Option<bool>,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum Seek {
    Seconds(f64),
    Cycle(u64),
    Time(f64),
}

/// Where a viewer is in a recording.
#[derive(Debug, Serialize)]
struct Progress {
    seconds: f64,
    cycle: u64,
    time: f64,
    speed: f64,
    paused: bool,
    at_end: bool,
}

/// The recording that a server shows.
pub(super) struct Shown {
    file: PathBuf,
    viewers: AtomicUsize,
}

impl Shown {
    pub(super) fn new(file: &Path) -> Self {
        Self { file: file.into(), viewers: AtomicUsize::new(0) }
    }

    /// The edits from one on of the stack that lies at a place in the recording, else of the last one;
    /// `None` where there is none.
    pub(super) fn stack(&self, place: Option<u64>, from: usize) -> Option<Answer> {
        let (place, text) = match place {
            Some(place) => (place, Recording::stack_at(&self.file, place).ok()??),
            None => Recording::open(&self.file).ok()?.stack(f64::INFINITY)?,
        };
        recorded_edits(place, &text, from).ok()
    }

    /// Shows it to one viewer until either side ends.
    pub(super) async fn serve(self: Arc<Self>, mut socket: WebSocket, limit: usize) {
        let _seat = Seat(&self.viewers);
        if self.viewers.fetch_add(1, Ordering::Relaxed) >= limit {
            let reason = format!("{limit} viewers watch already");
            let close = CloseFrame { code: 1013, reason: reason.into() };
            let _ = socket.send(Wire::Close(Some(close))).await;
            return;
        }
        let (messages, mut waiting) = mpsc::channel(WAITING);
        let (says, said) = sync_channel(SAID);
        let decoded = Arc::new(AtomicU64::new(0));
        let player = {
            let (file, decoded) = (self.file.clone(), Arc::clone(&decoded));
            move || {
                let player = Recording::open(&file).map_err(|error| error.to_string());
                match player.map(|recording| Player::new(recording, messages, said, decoded)) {
                    Ok(mut player) => player.run(),
                    Err(reason) => tracing::warn!(path = %file.display(), "{reason}"),
                }
            }
        };
        if std::thread::Builder::new().name("tombolo-play".into()).spawn(player).is_err() {
            return;
        }
        let (mut sink, mut stream) = socket.split();
        let errors = tokio::sync::Mutex::new(Vec::<String>::new());
        // One that says much and reads nothing is told no more than it can read.
        let complain = async |error: String| {
            let mut errors = errors.lock().await;
            if errors.len() < ERRORS {
                errors.push(error);
            }
        };
        let write = async {
            while let Some(message) = waiting.recv().await {
                for error in errors.lock().await.drain(..) {
                    if sink.send(Wire::text(error)).await.is_err() {
                        return;
                    }
                }
                if sink.send(message).await.is_err() {
                    return;
                }
            }
        };
        let read = async {
            while let Some(Ok(message)) = stream.next().await {
                match message {
                    Wire::Close(_) => return,
                    Wire::Binary(bytes) => {
                        if let Ok(count) = <[u8; 8]>::try_from(&bytes[..]) {
                            decoded.fetch_max(u64::from_le_bytes(count), Ordering::Relaxed);
                        }
                    }
                    Wire::Text(text) => match understood(&text) {
                        Ok(Some(play)) => {
                            if says.try_send(play).is_err() {
                                complain(too_many()).await;
                            }
                        }
                        Ok(None) => {}
                        Err(error) => complain(error).await,
                    },
                    Wire::Ping(_) | Wire::Pong(_) => {}
                }
            }
        };
        tokio::select! {
            () = write => {}
            () = read => {}
        }
    }
}

/// One of the viewers, which leaves however its session ends.
struct Seat<'a>(&'a AtomicUsize);

impl Drop for Seat<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

/// The answer to one that says more than is listened to.
fn too_many() -> String {
    let message = format!(
        "found more than {SAID} messages that wait, expected fewer; try again once the recording has followed"
    );
    json!({"error": {"message": message}}).to_string()
}

/// What a message asks for; the error is the answer.
fn understood(text: &str) -> Result<Option<Play>, String> {
    let value: Value = serde_json::from_str(text).unwrap_or_default();
    // One that is no text is not told back: it may be nested as deep as anything that is read.
    let id = value.get("id").and_then(Value::as_str);
    if value.get("play").is_none() {
        // A viewer says by itself that somebody is there, and which views it looks at. A recording sends
        // all of them.
        if ["here", "drive", "views"].iter().any(|said| value.get(said).is_some()) {
            return Ok(None);
        }
        let message =
            "this is a recording: it is gone through with `play`, and nothing can be ordered";
        return Err(json!({"error": {"message": message, "id": id}}).to_string());
    }
    let asked: Asked = parse_json(text, "message")
        .map_err(|error| json!({"error": {"message": error.to_string(), "id": id}}).to_string())?;
    let wrong =
        |message: String| json!({"error": {"message": message, "id": asked.id}}).to_string();
    if let Some(speed) = asked.play.speed.filter(|speed| !SPEEDS.contains(speed)) {
        let (least, most) = (SPEEDS.start(), SPEEDS.end());
        return Err(wrong(format!("play.speed: found {speed}, expected {least} to {most}")));
    }
    match asked.play.seek {
        Some(Seek::Seconds(to) | Seek::Time(to)) if !to.is_finite() => {
            Err(wrong(format!("play.seek: found {to}, expected a finite number")))
        }
        _ => Ok(Some(asked.play)),
    }
}

/// Goes through a recording for one viewer, on a thread of its own.
struct Player {
    recording: Recording,
    messages: mpsc::Sender<Wire>,
    said: Receiver<Play>,
    decoded: Arc<AtomicU64>,
    sent: u64,
    speed: f64,
    is_paused: bool,
    /// Where it was at this moment.
    at: (f64, Instant),
    moment: Moment,
    reported: Instant,
}

/// The viewer has gone.
struct Gone;

impl Player {
    fn new(
        recording: Recording,
        messages: mpsc::Sender<Wire>,
        said: Receiver<Play>,
        decoded: Arc<AtomicU64>,
    ) -> Self {
        let now = Instant::now();
        let moment = recording.first();
        Self {
            recording,
            messages,
            said,
            decoded,
            sent: 0,
            speed: 1.0,
            is_paused: false,
            at: (moment.seconds, now),
            moment,
            reported: now,
        }
    }

    /// Seconds into the recording.
    fn seconds(&self) -> f64 {
        let (seconds, since) = self.at;
        let passed = if self.is_paused { 0.0 } else { since.elapsed().as_secs_f64() };
        (seconds + self.speed * passed).min(self.recording.last().seconds)
    }

    fn run(&mut self) {
        // The viewer has gone.
        let _ = self.show();
    }

    fn show(&mut self) -> Result<(), Gone> {
        self.go_to(self.moment.seconds)?;
        loop {
            let next = self.recording.next_moment();
            let wait = match next {
                Some(next) if !self.is_paused => (next.seconds - self.seconds()) / self.speed,
                _ => PERIOD.as_secs_f64(),
            };
            if wait <= 0.0 {
                match self.recording.read_next() {
                    Ok(Some(recorded)) => self.send(recorded, true)?,
                    Ok(None) => {}
                    Err(error) => return self.fail(&error.to_string()),
                }
            }
            let wait = Duration::try_from_secs_f64(wait.max(0.0)).unwrap_or(PERIOD).min(PERIOD);
            match self.said.recv_timeout(wait) {
                Ok(asked) => self.hear(asked)?,
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Err(Gone),
            }
            if self.reported.elapsed() >= PERIOD {
                self.tell()?;
            }
        }
    }

    fn fail(&self, reason: &str) -> Result<(), Gone> {
        self.put(Wire::text(json!({"error": {"message": reason}}).to_string()))
    }

    fn put(&self, message: Wire) -> Result<(), Gone> {
        self.messages.blocking_send(message).map_err(|_| Gone)
    }

    fn hear(&mut self, asked: Play) -> Result<(), Gone> {
        let Play { seek, speed, paused } = asked;
        self.at = (self.seconds(), Instant::now());
        if let Some(paused) = paused {
            self.is_paused = paused;
        }
        if let Some(speed) = speed {
            self.speed = speed;
        }
        if let Some(seek) = seek {
            // Before its first frame a recording has nothing to show.
            let first = self.recording.first_frame().seconds;
            let last = self.recording.last().seconds;
            let seconds = match seek {
                Seek::Seconds(seconds) => seconds,
                Seek::Cycle(cycle) => self.recording.seconds_of_cycle(cycle),
                Seek::Time(time) => self.recording.seconds_of_time(time),
            };
            // A damaged file may have them the wrong way round.
            self.go_to(seconds.max(first).min(last))?;
        }
        self.tell()
    }

    /// Shows the run as it was at a moment.
    fn go_to(&mut self, seconds: f64) -> Result<(), Gone> {
        let hello = self.hello(seconds);
        self.put(Wire::text(hello))?;
        self.recording.seek(seconds);
        let mut status = None;
        while self.recording.next_moment().is_some_and(|next| next.seconds <= seconds) {
            // Who goes on to another place does not wait for this one.
            match self.recording.read_next() {
                Ok(Some(recorded)) => match &recorded.message {
                    RecordedMessage::Frame { .. } => self.send(recorded, false)?,
                    RecordedMessage::Text(text) if text.starts_with("{\"status\"") => {
                        status = Some(recorded);
                    }
                    RecordedMessage::Text(_) => {}
                },
                Ok(None) => break,
                Err(error) => return self.fail(&error.to_string()),
            }
        }
        status.map_or(Ok(()), |status| self.send(status, false))?;
        self.at = (seconds, Instant::now());
        self.tell()
    }

    /// The greeting of the run at a moment, for one that looks on.
    fn hello(&mut self, seconds: f64) -> String {
        let text = self.recording.hello(seconds).unwrap_or_default();
        let mut greeting: Map<String, Value> = serde_json::from_str(&text).unwrap_or_default();
        let mut hello = match greeting.remove("hello") {
            Some(Value::Object(hello)) => hello,
            _ => Map::new(),
        };
        // The newest of each order, in the order in which they came in.
        let mut orders: Vec<(String, Value)> = Vec::new();
        for text in self.recording.orders(seconds) {
            let Ok(mut told) = serde_json::from_str::<Value>(&text) else { continue };
            let Value::Object(mut order) = told["order"].take() else { continue };
            let id = order.get("id").and_then(Value::as_str).unwrap_or_default().to_owned();
            match orders.iter_mut().find(|(known, _)| *known == id) {
                Some((_, before)) => {
                    // What was asked for is told once.
                    if let Some(asked) = before.get("order").cloned() {
                        order.entry("order").or_insert(asked);
                    }
                    *before = Value::Object(order);
                }
                None => orders.push((id, Value::Object(order))),
            }
        }
        let skipped = orders.len().saturating_sub(ORDERS);
        let orders: Vec<Value> = orders.into_iter().skip(skipped).map(|(_, told)| told).collect();
        let told = |moment: Moment| json!({"seconds": moment.seconds, "cycle": moment.cycle, "time": moment.time});
        let recording = json!({
            "first": told(self.recording.first_frame()),
            "last": told(self.recording.last()),
            "lost_bytes": self.recording.lost_bytes(),
        });
        let stack = self.recording.stack(seconds);
        let stack = stack.and_then(|(place, text)| recorded_change(place, &text).ok());
        let own = [
            ("stack", stack.unwrap_or_default().described()),
            ("client", json!("c1")),
            ("role", json!("watcher")),
            ("may_drive", json!(false)),
            ("surface", Value::Null),
            ("orders", json!(orders)),
            ("recording", recording),
        ];
        hello.extend(own.map(|(key, value)| (key.to_owned(), value)));
        json!({ "hello": hello }).to_string()
    }

    fn send(&mut self, recorded: Recorded, is_in_time: bool) -> Result<(), Gone> {
        self.moment = recorded.moment;
        match recorded.message {
            RecordedMessage::Frame { bytes, .. } => {
                self.wait_for_decoding()?;
                self.sent += 1;
                self.put(Wire::Binary(bytes.into()))
            }
            // A greeting is made for this viewer; the end of the run is not that of the connection.
            RecordedMessage::Text(text) if text.starts_with("{\"hello\"") => {
                if !is_in_time {
                    return Ok(());
                }
                let hello = self.hello(recorded.moment.seconds);
                self.put(Wire::text(hello))
            }
            RecordedMessage::Text(text) if text.starts_with("{\"end\"") => Ok(()),
            RecordedMessage::Text(text) if text.starts_with("{\"stack\"") => {
                let place = self.recording.place_of_stack().unwrap_or_default();
                match recorded_change(place, &text) {
                    Ok(change) => self.put(Wire::Text(change.text().written())),
                    Err(_) => Ok(()),
                }
            }
            RecordedMessage::Text(text) => self.put(Wire::text(text)),
        }
    }

    /// Waits for a viewer that says how far it is.
    fn wait_for_decoding(&self) -> Result<(), Gone> {
        let until = Instant::now() + PATIENCE;
        loop {
            let decoded = self.decoded.load(Ordering::Relaxed);
            let is_far = decoded > 0 && self.sent.saturating_sub(decoded) >= UNDECODED;
            if !is_far || Instant::now() > until {
                return Ok(());
            }
            if self.messages.is_closed() {
                return Err(Gone);
            }
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    fn tell(&mut self) -> Result<(), Gone> {
        self.reported = Instant::now();
        let seconds = self.seconds();
        let progress = Progress {
            seconds,
            cycle: self.moment.cycle,
            time: self.moment.time,
            speed: self.speed,
            paused: self.is_paused,
            // Messages that wait for a slow viewer come before its end.
            at_end: seconds >= self.recording.last().seconds
                && self.recording.next_moment().is_none(),
        };
        self.put(Wire::text(json!({ "play": progress }).to_string()))
    }
}

/// Nothing can be ordered of a recording.
pub(super) struct Nothing;

impl CommandSink for Nothing {
    fn receive(&self, _: u64, _: Option<String>, _: Message, _: &str) -> Result<(), String> {
        Err("this is a recording".into())
    }

    fn driven(&self) {}

    fn orders(&self) -> Value {
        json!([])
    }

    fn order_counts(&self) -> Vec<(&'static str, usize)> {
        Vec::new()
    }

    fn note(&self, _: JournalNote) {}
}
