//! The viewers of the benchmark `service`: a process of their own, which does one task and prints what
//! it saw.

use std::{
    collections::HashMap,
    error::Error,
    io::{self, Read, Write},
    net::TcpStream,
    num::NonZeroU32,
    sync::mpsc,
    time::{Duration, Instant, SystemTime},
};

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use tokio_tungstenite::tungstenite::{self, Message, WebSocket, client::client};
use tombolo::{
    OrderStatus,
    client::{Client, Event, Link, Options},
    pipelines::{
        encode::Decoder,
        language::{Change, Order, parse_valid},
    },
};

/// Steps between two frames of a view.
pub const EVERY: u64 = 5;
/// Bytes a second of a slow viewer, and the pieces in which it reads them.
const SLOW: usize = 10_000;
const PIECE: usize = 1_000;
/// Orders that may be under way at once.
const UNDER_WAY: usize = 16;
/// How long anything is waited for.
const PATIENCE: Duration = Duration::from_secs(600);

/// Seconds since the epoch, the clock that both processes have.
pub fn now() -> f64 {
    SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default().as_secs_f64()
}

/// What the viewers do.
#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Task {
    /// They watch, so many of each kind, for so long.
    Watch {
        /// Viewers that read all.
        fast: usize,
        /// Viewers at 10 kB/s.
        slow: usize,
        /// Viewers that never read.
        deaf: usize,
        /// Seconds.
        seconds: f64,
    },
    /// Orders one after the other, each given when the one before is done.
    Latency {
        /// How many.
        count: usize,
    },
    /// Small orders.
    Small {
        /// How many.
        count: usize,
    },
    /// Orders of 0.94 MB that bring the displacement of many vertices.
    Large {
        /// How many.
        count: usize,
        /// The vertices, of the surface.
        vertices: Vec<u32>,
    },
}

/// What they saw.
#[derive(Debug, Default, Serialize, Deserialize)]
pub struct Seen {
    /// The part of the frames that the worst of the fast viewers got.
    pub least_part: f64,
    /// The cycles that slow viewers saw, and when.
    pub slow: Vec<(u64, f64)>,
    /// The orders, and when each was sent.
    pub sent: Vec<(String, f64)>,
    /// Why orders were rejected.
    pub rejected: Vec<String>,
    /// Bytes of the longest text.
    pub longest: usize,
}

/// Does a task against the run that the environment's `TOMBOLO_LINK` leads to, and prints what was
/// seen for [`crate::service`].
///
/// # Errors
/// The first error of a viewer.
pub fn run(task: &str) -> Result<(), Box<dyn Error>> {
    let link = std::env::var("TOMBOLO_LINK")?;
    let seen = match serde_json::from_str(task)? {
        Task::Watch { fast, slow, deaf, seconds } => watch(&link, [fast, slow, deaf], seconds)?,
        Task::Latency { count } => orders(&link, (0..count).map(small), 1)?,
        Task::Small { count } => orders(&link, (0..count).map(small), UNDER_WAY)?,
        Task::Large { count, vertices } => {
            orders(&link, (0..count).map(|index| large(index, &vertices)), UNDER_WAY)?
        }
    };
    println!("tombolo {}", serde_json::to_string(&seen)?);
    Ok(())
}

/// A connection that reads at a given speed.
struct Line {
    stream: TcpStream,
    slowly: bool,
}

impl Read for Line {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if !self.slowly {
            return self.stream.read(buffer);
        }
        let most = buffer.len().min(PIECE);
        let read = self.stream.read(&mut buffer[..most])?;
        std::thread::sleep(Duration::from_secs_f64(read as f64 / SLOW as f64));
        Ok(read)
    }
}

impl Write for Line {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.stream.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.stream.flush()
    }
}

fn connect(link: &str, slowly: bool) -> Result<WebSocket<Line>, Box<dyn Error + Send + Sync>> {
    let address = link.trim_start_matches("http://").split('/').next().unwrap_or_default();
    let url = link.replacen("http://", "ws://", 1).replacen("/?", "/ws?role=watch&", 1);
    let stream = TcpStream::connect(address)?;
    if slowly {
        // What lies in buffers on this side is not what it sees.
        socket2::SockRef::from(&stream).set_recv_buffer_size(4096)?;
    }
    let (mut socket, _) = client(url, Line { stream, slowly: false })
        .map_err(|error| format!("no connection: {error}"))?;
    socket.get_mut().slowly = slowly;
    Ok(socket)
}

/// Reads for so long, and acknowledges each frame; `each` has the messages.
fn read(
    mut socket: WebSocket<Line>,
    until: Instant,
    mut each: impl FnMut(&Message),
) -> Result<(), Box<dyn Error + Send + Sync>> {
    let mut frames = 0_u64;
    while Instant::now() < until {
        let message = match socket.read() {
            Ok(message) => message,
            Err(tungstenite::Error::ConnectionClosed) => return Err("cut off".into()),
            Err(error) => return Err(error.into()),
        };
        if message.is_binary() {
            frames += 1;
            socket.send(Message::binary(frames.to_le_bytes().to_vec()))?;
        }
        each(&message);
    }
    Ok(())
}

fn watch(link: &str, [fast, slow, deaf]: [usize; 3], seconds: f64) -> Result<Seen, Box<dyn Error>> {
    let until = Instant::now() + Duration::from_secs_f64(seconds);
    let (parts, all_parts) = mpsc::channel();
    let (ages, all_ages) = mpsc::channel();
    let failed = std::thread::scope(|scope| {
        let mut threads = Vec::new();
        for _ in 0..fast {
            let parts = parts.clone();
            threads.push(scope.spawn(move || {
                let (mut first, mut last, mut frames, mut counted) = (None, 0, 0_u64, 0_u64);
                read(connect(link, false)?, until, |message| match message {
                    Message::Binary(_) => frames += 1,
                    Message::Text(text) if text.starts_with(r#"{"status""#) => {
                        let status: Value = serde_json::from_str(text).unwrap_or_default();
                        last = status["status"]["cycle"].as_u64().unwrap_or(last);
                        // From the first status on that comes behind a frame.
                        if first.is_none() && frames > 1 {
                            (first, frames) = (Some(last), 0);
                        }
                        counted = frames;
                    }
                    _ => {}
                })?;
                let cycles = last.saturating_sub(first.unwrap_or(last));
                // Two views.
                let made = 2 * (cycles / EVERY);
                let _ = parts.send((counted as f64 / made.max(1) as f64).min(1.0));
                Ok::<(), Box<dyn Error + Send + Sync>>(())
            }));
        }
        for _ in 0..slow {
            let ages = ages.clone();
            threads.push(scope.spawn(move || {
                let mut decoder = Decoder::new();
                read(connect(link, true)?, until, |message| {
                    if let Message::Binary(bytes) = message
                        && let Ok(frame) = decoder.decode(bytes)
                    {
                        let _ = ages.send((frame.cycle, now()));
                    }
                })
            }));
        }
        let deaf: Vec<_> = (0..deaf).map(|_| connect(link, false)).collect();
        let failed =
            deaf.iter().filter_map(|deaf| deaf.as_ref().err()).map(ToString::to_string).next();
        let ended = threads.into_iter().filter_map(|thread| match thread.join() {
            Ok(Ok(())) => None,
            Ok(Err(error)) => Some(error.to_string()),
            Err(_) => Some("a viewer failed".into()),
        });
        failed.or(ended.last())
    });
    drop((parts, ages));
    if let Some(reason) = failed {
        return Err(reason.into());
    }
    Ok(Seen {
        least_part: all_parts.iter().fold(1.0, f64::min),
        slow: all_ages.iter().collect(),
        ..Seen::default()
    })
}

/// Pinches the throat by turns.
fn small(index: usize) -> Value {
    let factor = if index.is_multiple_of(2) { 0.98 } else { 0.99 };
    json!({"stack": [{"scale_direction": {
        "features": ["throat"], "fixed": ["inlet", "outlet"], "factors": [1, 1, factor]}}]})
}

/// Moves vertices by next to nothing, in 0.94 MB.
fn large(index: usize, vertices: &[u32]) -> Value {
    let by = |number: usize| 1e-12 * (1.0 + (7 * number + index) as f64).sin();
    let values: Vec<[f64; 3]> =
        (0..vertices.len()).map(|number| [by(number), by(number + 1), by(number + 2)]).collect();
    let edit = json!({"displacement": {"vertices": vertices, "values": values}});
    let copies = 940_000 / edit.to_string().len() + 1;
    // The stack holds so many listed vertices and no more: every tenth order begins anew.
    let key = if index.is_multiple_of(10) { "stack" } else { "edits" };
    json!({key: vec![edit; copies]})
}

/// Gives orders, so many under way at once, and waits until all are done.
fn orders(
    link: &str,
    orders: impl Iterator<Item = Value>,
    most: usize,
) -> Result<Seen, Box<dyn Error>> {
    let link: Link = link.parse()?;
    let client = Client::connect(&link, &Options::default())?;
    client.drive(PATIENCE)?;
    let mut seen = Seen::default();
    let mut under_way: HashMap<String, ()> = HashMap::new();
    let mut orders = orders.peekable();
    while orders.peek().is_some() || !under_way.is_empty() {
        while under_way.len() < most
            && let Some(order) = orders.next()
        {
            let order: Order = parse_valid(&order.to_string(), "order")?;
            let sent = now();
            let id = client.order(&order)?;
            seen.sent.push((id.clone(), sent));
            under_way.insert(id, ());
        }
        let Some(told) = client.next(PATIENCE)? else { return Err("nothing is said".into()) };
        seen.longest = seen.longest.max(told.text.len());
        match told.event {
            Event::Order(order) => {
                if order.status == OrderStatus::Rejected {
                    seen.rejected.extend(order.reason.clone());
                }
                if matches!(order.status, OrderStatus::Applied | OrderStatus::Rejected) {
                    under_way.remove(&order.id);
                }
            }
            Event::Error(error) => {
                if let Some(id) = &error.id
                    && under_way.remove(id).is_some()
                {
                    seen.rejected.push(error.message);
                }
            }
            _ => {}
        }
    }
    // Those who come next find the shape of before.
    let back = client.order(&Change::Undo(NonZeroU32::MIN).into())?;
    drop(back);
    Ok(seen)
}
