//! A tiny solver, and a viewer that speaks the protocol, for the tests.
#![allow(dead_code, reason = "each test file uses a part")]

pub mod program;
pub mod proxy;
pub mod running;

use std::time::{Duration, Instant};

use futures_util::{SinkExt, StreamExt};
use serde_json::{Value, json};
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream, tungstenite::Message};
use tombolo::{
    Adaptor, Report, Settings, Step,
    deform::{
        mesh::{Mesh, MeshView, Vector},
        shapes::box_of_tets,
    },
    pipelines::{
        encode::{DecodedFrame, Decoder},
        extract::{Channel, FieldView},
        language::{self, Config},
    },
};

/// Long enough for a loaded machine; a test that waits so long has failed.
pub const PATIENCE: Duration = Duration::from_secs(900);

pub const LINK_TO_ALL: &str = r#"{"version": 1, "stream": {"listen": "127.0.0.1:0"}, "pipelines": [
    {"name": "boundary", "every": {"steps": 1}, "stages": [{"surface": {}}, {"stream": {}}]}]}"#;

pub fn config(text: &str) -> Config {
    language::parse(text, "test.json").expect("a configuration")
}

/// The secrets of a run with a server, for driving and for watching.
pub fn secrets(adaptor: &Adaptor) -> [String; 2] {
    [adaptor.link(), adaptor.watching_link()].map(|link| {
        let link = link.expect("a server");
        link.split_once("token=").expect("a secret").1.to_owned()
    })
}

/// Squeezes the box of [`Solver`] from above.
pub fn squeeze(by: f64) -> Value {
    json!({"edits": [{"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0.0, 0.0, -by]}}]})
}

/// Squeezes the box in as many shapes as there may be, which take long to find.
pub fn long(by: f64) -> Value {
    let mut order = squeeze(by);
    order["schedule"] = json!({"steps": 10_000});
    order
}

/// Whether a message is about this order and has this status.
pub fn has_status<'s>(id: &'s str, status: &'s str) -> impl Fn(&Value) -> bool + 's {
    move |order| order["id"] == id && order["status"] == status
}

pub struct Solver {
    pub adaptor: Adaptor,
    pub reference: Mesh,
    pub mesh: Mesh,
    pub cycle: u64,
    pub slowest: Duration,
    pub stopped: bool,
    pub parameters: Vec<(String, f64)>,
    /// The cycle, shape and order of each motion.
    pub motions: Vec<(u64, (u32, u32), String)>,
}

impl Solver {
    pub fn new(settings: Settings) -> Self {
        Self::of_box([4, 4, 4], settings)
    }

    pub fn of_box(divisions: [usize; 3], settings: Settings) -> Self {
        let reference = box_of_tets(divisions, [0.0; 3], [1.0; 3]);
        Self {
            adaptor: Adaptor::initialize(settings).expect("initialize"),
            mesh: reference.clone(),
            reference,
            cycle: 0,
            slowest: Duration::ZERO,
            stopped: false,
            parameters: Vec::new(),
            motions: Vec::new(),
        }
    }

    pub fn with_config(text: &str) -> Self {
        Self::new(Settings { config: config(text), ..Settings::default() })
    }

    pub fn step(&mut self) {
        let step = Step { cycle: self.cycle, time: self.cycle as f64 * 0.01, time_step: 0.01 };
        let speed: Vec<f64> =
            self.mesh.points().iter().map(|[x, y, z]| x + y * z + step.time).collect();
        let fields = [FieldView::vertex("speed", &speed)];
        let channels =
            [Channel { name: "fluid", mesh: MeshView::from(&self.mesh), fields: &fields }];
        let begun = Instant::now();
        let steering = self.adaptor.execute(&step, &channels).expect("execute");
        self.slowest = self.slowest.max(begun.elapsed());
        let mut moved: Option<Vec<Vector>> = None;
        if let Some(motion) = steering.motion {
            for (vertex, point) in self.mesh.points().iter().enumerate() {
                for (axis, from) in point.iter().enumerate() {
                    let displacement = motion.displacement[vertex][axis];
                    assert!((motion.coordinates[vertex][axis] - from - displacement).abs() < 1e-15);
                    assert_eq!(motion.velocity[vertex][axis], displacement / 0.01);
                }
            }
            self.motions.push((self.cycle, motion.shape, motion.order.to_owned()));
            moved = Some(motion.coordinates.to_vec());
        }
        self.parameters.extend(steering.parameters);
        self.stopped |= steering.stop;
        if let Some(points) = moved {
            self.mesh = self.mesh.with_points(points).expect("finite");
        }
        self.cycle += 1;
    }

    pub fn steps(&mut self, count: u64) {
        for _ in 0..count {
            self.step();
        }
    }

    /// Steps until something holds.
    pub fn step_until(&mut self, what: &str, mut holds: impl FnMut(&Self) -> bool) {
        let begun = Instant::now();
        while !holds(self) {
            assert!(begun.elapsed() < PATIENCE, "still waiting for: {what}");
            self.step();
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Steps until a viewer has a message that fits.
    pub fn step_until_told(
        &mut self,
        viewer: &mut Viewer,
        key: &str,
        fits: impl Fn(&Value) -> bool,
    ) -> Value {
        let begun = Instant::now();
        loop {
            self.step();
            if let Some(found) = viewer.look_for(key, Duration::from_millis(2), &fits) {
                return found;
            }
            assert!(
                begun.elapsed() < PATIENCE,
                "still waiting for {key}; seen: {:#?}",
                viewer.seen
            );
        }
    }

    pub fn is_at_reference(&self) -> bool {
        bits(&self.mesh) == bits(&self.reference)
    }

    pub fn finish(self) -> Report {
        self.adaptor.finalize().expect("finalize")
    }
}

pub fn bits(mesh: &Mesh) -> Vec<[u64; 3]> {
    mesh.points().iter().map(|point| point.map(f64::to_bits)).collect()
}

/// The lines of a journal that say what became of commands.
pub fn statuses(journal: &str) -> Vec<Value> {
    let lines = journal.lines().map(|line| serde_json::from_str(line).expect("a line of JSON"));
    lines.filter(|line: &Value| line.get("status").is_some()).collect()
}

/// One viewer.
pub struct Viewer {
    runtime: tokio::runtime::Runtime,
    socket: WebSocketStream<MaybeTlsStream<tokio::net::TcpStream>>,
    /// Texts that nobody has looked for yet.
    pub seen: Vec<Value>,
    pub frames: Vec<Vec<u8>>,
    /// The views that a `hello` has listed, the first one first.
    listed: Vec<String>,
    /// How many of them were listed before each frame.
    listed_before: Vec<usize>,
    decoder: Decoder,
}

pub fn socket_url(adaptor: &Adaptor) -> String {
    let link = adaptor.link().expect("a server");
    link.replacen("http://", "ws://", 1).replacen("/?", "/ws?", 1)
}

impl Viewer {
    pub fn connect(adaptor: &Adaptor) -> Self {
        Self::try_connect(&socket_url(adaptor)).expect("connected")
    }

    pub fn try_connect(url: &str) -> Result<Self, Box<tokio_tungstenite::tungstenite::Error>> {
        let runtime =
            tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
        let (socket, _) =
            runtime.block_on(tokio_tungstenite::connect_async(url)).map_err(Box::new)?;
        let decoder = Decoder::new();
        let (seen, frames) = (Vec::new(), Vec::new());
        let (listed, listed_before) = (Vec::new(), Vec::new());
        Ok(Self { runtime, socket, seen, frames, listed, listed_before, decoder })
    }

    pub fn send(&mut self, message: &Value) {
        self.send_text(&message.to_string());
    }

    pub fn send_text(&mut self, text: &str) {
        self.send_message(Message::text(text));
    }

    pub fn send_message(&mut self, message: Message) {
        self.runtime.block_on(self.socket.send(message)).expect("sent");
    }

    /// Sends what the server may refuse, and cut the connection, before it is all sent.
    pub fn send_unwelcome(&mut self, message: Message) {
        let _ = self.runtime.block_on(self.socket.send(message));
    }

    /// Reads one message; `None` after `wait`, or once the connection has ended.
    fn read(&mut self, wait: Duration) -> Option<Message> {
        let next = async { tokio::time::timeout(wait, self.socket.next()).await };
        match self.runtime.block_on(next) {
            Ok(Some(Ok(message))) => Some(message),
            _ => None,
        }
    }

    /// Decodes the frames that came since the last call, and takes them away. Each is of a view that
    /// was listed before.
    pub fn decoded(&mut self) -> Vec<DecodedFrame> {
        let (decoder, listed) = (&mut self.decoder, &self.listed);
        let frames = self.frames.drain(..).zip(self.listed_before.drain(..));
        let decode = |(frame, before): (Vec<u8>, usize)| {
            let frame = decoder.decode(&frame).expect("a frame");
            assert!(listed[..before].contains(&frame.view), "{} is not listed yet", frame.view);
            frame
        };
        frames.map(decode).collect()
    }

    fn keep_text(&mut self, text: &str) {
        let message: Value = serde_json::from_str(text).expect("JSON");
        let views = message["hello"]["views"].as_array().into_iter().flatten();
        self.listed.extend(views.filter_map(|view| view["name"].as_str().map(str::to_owned)));
        self.seen.push(message);
    }

    /// A text message under `key` that fits, from those seen or the next ones.
    pub fn look_for(
        &mut self,
        key: &str,
        wait: Duration,
        fits: impl Fn(&Value) -> bool,
    ) -> Option<Value> {
        let until = Instant::now() + wait;
        loop {
            let found = self.seen.iter().position(|message| message.get(key).is_some_and(&fits));
            if let Some(found) = found {
                return self.seen.remove(found).get(key).cloned();
            }
            let left = until.saturating_duration_since(Instant::now());
            match self.read(left)? {
                Message::Text(text) => self.keep_text(&text),
                Message::Binary(bytes) => {
                    self.frames.push(bytes.to_vec());
                    self.listed_before.push(self.listed.len());
                }
                _ => {}
            }
        }
    }

    pub fn wait_for(&mut self, key: &str, fits: impl Fn(&Value) -> bool) -> Value {
        self.look_for(key, PATIENCE, fits)
            .unwrap_or_else(|| panic!("no {key}; seen: {:#?}", self.seen))
    }

    pub fn hello(&mut self) -> Value {
        self.wait_for("hello", |_| true)
    }

    /// The code with which the other side has closed the connection; reads until then.
    pub fn closed(&mut self) -> Option<u16> {
        loop {
            match self.read(PATIENCE)? {
                Message::Close(frame) => return frame.map(|frame| frame.code.into()),
                Message::Text(text) => self.keep_text(&text),
                _ => {}
            }
        }
    }

    /// Reads until the other side has closed the connection.
    pub fn wait_for_end(&mut self) {
        let until = Instant::now() + PATIENCE;
        let next = |viewer: &mut Self| {
            let next = async { tokio::time::timeout(PATIENCE, viewer.socket.next()).await };
            viewer.runtime.block_on(next).expect("the connection ends")
        };
        while let Some(Ok(_)) = next(self) {
            assert!(Instant::now() < until, "still connected");
        }
    }
}
