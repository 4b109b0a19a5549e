//! The server that viewers connect to, on a thread of its own.
//!
//! It serves the viewer's files at `/`, one WebSocket at `/ws`, the reference surface at `/surface`,
//! the pipelines at `/pipelines`, the schema of one at `/schema` and that of an order at
//! `/schema/order`, and `/metrics` (the protocol is in
//! `docs/protocol.md`). Nothing that a client does reaches the solver but commands that were read
//! and found valid.
//!
//! What it guarantees: it listens on the loopback address unless told otherwise; nothing of the run
//! without a secret, and no command with that for watching; no page of another site can use a
//! browser's connection (the `Origin` must be the server's own), nor reach it under another name (on
//! loopback the `Host` must be loopback too); messages over [`DOCUMENT`], more viewers than
//! [`StreamLimits`] says, and floods of messages are refused; a client that takes no byte for 20
//! seconds, or says nothing for 30, is let go; connections that have shown no secret make way for
//! newer ones.
//!
//! What it does not: it does not encrypt. Over an open network use an SSH tunnel to the loopback
//! address. Who is trusted with what is in `docs/security.md`.
//!
//! [`StreamLimits`]: tombolo_pipelines::language::StreamLimits

mod allowance;
mod connection;
mod credentials;
mod gate;
mod hub;
mod invitation;
mod metrics;
mod observer;
mod outbox;
mod playback;
mod pool;
mod seats;
mod secret;
mod session;
mod surface;
mod viewer_files;
mod wheel;

use std::{
    net::{SocketAddr, TcpListener},
    path::Path,
    sync::{Arc, Mutex},
    thread::JoinHandle,
    time::Duration,
};

use axum::{
    Extension, Router,
    extract::{
        ConnectInfo, Request, State, WebSocketUpgrade, ws::rejection::WebSocketUpgradeRejection,
    },
    http::{HeaderName, StatusCode, Uri, header},
    middleware,
    response::{IntoResponse, Response},
    routing::get,
};
use serde::Serialize;
use tokio::sync::oneshot;
use tombolo_pipelines::{
    language::{JournalNote, Message, StreamLimits, StreamServer, order_schema, pipeline_schema},
    limits::DOCUMENT,
};

use crate::lock::lock;

pub(crate) use hub::{Clock, End, Hub};
pub(crate) use observer::{Observer, Told};
pub(crate) use surface::ReferenceSurface;

use connection::{Connection, Listener};
use credentials::{Access, Credentials, Holder, parameter};
use gate::Refusals;
use hub::Arrival;
use viewer_files::ViewerFiles;

/// The largest message that is read at all, in bytes: so much more than a document may have that
/// one too long is told so.
const MESSAGE_SIZE: usize = DOCUMENT.most + (1 << 16);
/// How often a viewer is asked whether it is still there.
const PING_PERIOD: Duration = Duration::from_secs(10);
/// How often the status is told, where it changed.
const STATUS_PERIOD: Duration = Duration::from_millis(100);

/// Takes the commands of viewers, already known to come from the one that drives.
pub(crate) trait CommandSink: Send + Sync {
    /// Takes one message, which was read from this text.
    ///
    /// # Errors
    /// A text for the viewer that says what is wrong; then nothing was taken.
    fn receive(
        &self,
        client: u64,
        id: Option<String>,
        message: Message,
        text: &str,
    ) -> Result<(), String>;

    /// Hears that a viewer has connected which may steer.
    fn driven(&self);

    /// Is called a few times a second, for what may take only so long.
    fn look_at_time(&self) {}

    /// The orders so far, for a viewer that connects.
    fn orders(&self) -> serde_json::Value;

    /// How many orders have come to which state.
    fn order_counts(&self) -> Vec<(&'static str, usize)>;

    /// Notes in the journal who came, went or was refused.
    fn note(&self, note: JournalNote);
}

/// How much was streamed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct StreamCounts {
    /// Frames that viewers were sent, each viewer counted.
    pub frames: u64,
    /// Frames that made way for newer ones before a viewer had read them or the encoder had come to
    /// them.
    pub dropped: u64,
    /// Bytes of all frames sent.
    pub bytes: u64,
    /// Bytes that the values in them fill uncompressed.
    pub raw_bytes: u64,
}

/// Why no server could be started.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StreamError {
    /// Another program listens there already.
    #[error(
        "stream.listen: {address} is in use by another program; choose another port, or port 0 for any that is free"
    )]
    InUse {
        /// The address.
        address: SocketAddr,
    },
    /// The system refuses to listen there.
    #[error("stream.listen: cannot listen on {address}: {source}")]
    Listen {
        /// The address.
        address: SocketAddr,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The system has no random numbers for a secret.
    #[error("no secret could be made: {0}")]
    Token(getrandom::Error),
    /// A secret that was given cannot be taken.
    #[error("stream.secrets: {0}")]
    Secrets(String),
    /// A thread could not be started.
    #[error("the stream's threads could not be started: {0}")]
    Thread(std::io::Error),
}

/// How long the end of a run waits for viewers to read that it ended.
const END_TIME: Duration = Duration::from_secs(1);

/// A running server. Dropping it ends its threads.
pub(crate) struct Server {
    address: SocketAddr,
    credentials: Arc<Credentials>,
    hub: Arc<Hub>,
    links: Option<invitation::LinkFile>,
    stop: Option<oneshot::Sender<()>>,
    threads: Vec<JoinHandle<()>>,
}

#[derive(Clone)]
struct Shared {
    credentials: Arc<Credentials>,
    refusals: Arc<Refusals>,
    hub: Arc<Hub>,
    commands: Arc<dyn CommandSink>,
    files: ViewerFiles,
    loopback: bool,
    limits: StreamLimits,
    /// The recording that is served in place of a run.
    playback: Option<Arc<playback::Shown>>,
}

impl Server {
    /// Listens on an address (port 0 for any that is free) and serves on threads of its own.
    pub(crate) fn start(
        settings: &StreamServer,
        hub: Arc<Hub>,
        commands: Arc<dyn CommandSink>,
    ) -> Result<Self, StreamError> {
        Self::start_with(settings, hub, commands, None)
    }

    /// Serves a recording.
    pub(crate) fn play(settings: &StreamServer, file: &Path) -> Result<Self, StreamError> {
        let shown = Arc::new(playback::Shown::new(file));
        Self::start_with(settings, Arc::default(), Arc::new(playback::Nothing), Some(shown))
    }

    fn start_with(
        settings: &StreamServer,
        hub: Arc<Hub>,
        commands: Arc<dyn CommandSink>,
        playback: Option<Arc<playback::Shown>>,
    ) -> Result<Self, StreamError> {
        let wanted = settings.listen;
        let socket = TcpListener::bind(wanted).map_err(|source| match source.kind() {
            std::io::ErrorKind::AddrInUse => StreamError::InUse { address: wanted },
            _ => StreamError::Listen { address: wanted, source },
        })?;
        let listen_error = |source| StreamError::Listen { address: wanted, source };
        let address = socket.local_addr().map_err(listen_error)?;
        socket.set_nonblocking(true).map_err(listen_error)?;
        if !address.ip().is_loopback() {
            log::warn!(
                "viewers reach {address} from other machines, and what they send and see can be \
                 read on the way; an SSH tunnel to a server on 127.0.0.1 keeps it private"
            );
        }
        let credentials = Arc::new(Credentials::of(settings)?);
        hub.set_driver_silence(Duration::from_secs(settings.limits.driver_silence.get().into()));
        let shared = Shared {
            credentials: Arc::clone(&credentials),
            refusals: Arc::default(),
            hub: Arc::clone(&hub),
            commands,
            files: ViewerFiles::find(),
            loopback: address.ip().is_loopback(),
            limits: settings.limits,
            playback,
        };
        let (stop, stopped) = oneshot::channel();
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .map_err(StreamError::Thread)?;
        let mut server = Self {
            address,
            credentials,
            hub: Arc::clone(&hub),
            links: None,
            stop: Some(stop),
            threads: Vec::new(),
        };
        let thread = |name: &str| std::thread::Builder::new().name(name.into());
        let serving = move || serve_until_stopped(&runtime, &socket, &shared, stopped);
        server.threads.push(thread("tombolo-stream").spawn(serving).map_err(StreamError::Thread)?);
        let encoding = move || while went_wrong("encoder", || hub.encode_until_closed()) {};
        server.threads.push(thread("tombolo-encode").spawn(encoding).map_err(StreamError::Thread)?);
        Ok(server)
    }

    pub(crate) fn address(&self) -> SocketAddr {
        self.address
    }

    /// The link of those who drive, with their secret.
    pub(crate) fn link(&self) -> String {
        self.link_with("token", self.credentials.secret(Access::Drive).as_str())
    }

    /// The link of those who watch, with their secret.
    pub(crate) fn watching_link(&self) -> String {
        self.link_with("token", self.credentials.secret(Access::Watch).as_str())
    }

    /// A link that opens one browser, once, for driving; `None` where the system has no random
    /// numbers.
    pub(crate) fn browser_link(&self) -> Option<String> {
        let key = self.credentials.key(Access::Drive).ok()?;
        Some(self.link_with("key", key.as_str()))
    }

    fn link_with(&self, name: &str, secret: &str) -> String {
        let port = self.address.port();
        let host = match self.address.ip() {
            ip if ip.is_unspecified() => machine(),
            _ => None,
        };
        let authority = host.map_or(self.address.to_string(), |name| format!("{name}:{port}"));
        format!("http://{authority}/?{name}={secret}")
    }
}

/// The machine's name in its network, as far as the system tells it.
fn machine() -> Option<String> {
    let name = std::fs::read_to_string("/proc/sys/kernel/hostname").ok()?;
    let name = name.trim();
    let is_name = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '.';
    (!name.is_empty() && name.chars().all(is_name)).then(|| name.to_owned())
}

impl Drop for Server {
    fn drop(&mut self) {
        self.hub.close();
        if let Some(stop) = self.stop.take() {
            let _ = stop.send(());
        }
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}

/// Does a thing; whether it panicked, which is logged once. What it shares with others is guarded
/// by [`lock`], and never half done.
fn went_wrong(what: &'static str, act: impl FnOnce()) -> bool {
    static TOLD: Mutex<Vec<&str>> = Mutex::new(Vec::new());
    let outcome = std::panic::catch_unwind(std::panic::AssertUnwindSafe(act));
    if outcome.is_err() {
        let mut told = lock(&TOLD);
        if !told.contains(&what) {
            told.push(what);
            log::error!("the {what} of the stream failed, which is a fault of Tombolo; it goes on");
        }
        drop(told);
        // Whatever it was must not happen without a pause.
        std::thread::sleep(STATUS_PERIOD);
    }
    outcome.is_err()
}

fn serve_until_stopped(
    runtime: &tokio::runtime::Runtime,
    socket: &TcpListener,
    shared: &Shared,
    mut stopped: oneshot::Receiver<()>,
) {
    while went_wrong("server", || {
        let socket = socket.try_clone().and_then(|socket| {
            let _context = runtime.enter();
            tokio::net::TcpListener::from_std(socket)
        });
        match socket {
            Ok(socket) => runtime.block_on(serve(socket, shared.clone(), &mut stopped)),
            Err(error) => log::error!("the server of the stream cannot go on: {error}"),
        }
    }) && !shared.hub.is_closed()
    {}
}

async fn serve(
    socket: tokio::net::TcpListener,
    shared: Shared,
    stopped: &mut oneshot::Receiver<()>,
) {
    let hub = Arc::clone(&shared.hub);
    let commands = Arc::clone(&shared.commands);
    let listener = Listener::new(socket, shared.limits.connections.get() as usize);
    let router = Router::new()
        .route("/ws", get(upgrade))
        .route("/surface", get(reference_surface))
        .route("/pipelines", get(pipelines))
        .route("/schema", get(schema))
        .route("/schema/order", get(schema_of_order))
        .route("/metrics", get(metrics::metrics))
        .route_layer(middleware::from_fn(gate::holders_only))
        .fallback(file)
        .layer(middleware::from_fn_with_state(shared.clone(), gate::guard))
        .with_state(shared)
        .into_make_service_with_connect_info::<Connection>();
    let statuses = async {
        let mut tick = tokio::time::interval(STATUS_PERIOD);
        tick.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
        loop {
            tick.tick().await;
            went_wrong("status", || {
                commands.look_at_time();
                hub.status();
            });
        }
    };
    let ended = async {
        let _ = stopped.await;
        hub.tell_end();
        let until = tokio::time::Instant::now() + END_TIME;
        while hub.has_viewers() && tokio::time::Instant::now() < until {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    };
    // Ending this future drops the runtime, and with it every connection.
    tokio::select! {
        _ = axum::serve(listener, router) => {}
        () = statuses => {}
        () = ended => {}
    }
}

async fn upgrade(
    State(shared): State<Shared>,
    ConnectInfo(connection): ConnectInfo<Connection>,
    Extension(holder): Extension<Holder>,
    uri: Uri,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> Response {
    let upgrade = match upgrade {
        Ok(upgrade) => upgrade,
        Err(rejection) => return rejection.into_response(),
    };
    let upgrade = upgrade.max_message_size(MESSAGE_SIZE).max_frame_size(MESSAGE_SIZE);
    upgrade.on_upgrade(move |mut socket| async move {
        connection.upgraded();
        if let Some(shown) = &shared.playback {
            let shown = Arc::clone(shown);
            return shown.serve(socket, shared.limits.viewers.get() as usize).await;
        }
        let returning = parameter(&uri, "client").zip(parameter(&uri, "back"));
        let limit = shared.limits.viewers.get() as usize;
        let only_watches = parameter(&uri, "role") == Some("watch");
        let access = if only_watches { Access::Watch } else { holder.access };
        let refusal = match shared.hub.join(limit, access, returning) {
            Ok(Arrival::Client(client)) => {
                let address = connection.address();
                return session::serve(socket, client, holder, address, shared).await;
            }
            Ok(Arrival::Full) => format!("{limit} viewers watch already"),
            Err(error) => format!("no secret could be made: {error}"),
        };
        use axum::extract::ws::{CloseFrame, Message as Wire};
        let _ =
            socket.send(Wire::Close(Some(CloseFrame { code: 1013, reason: refusal.into() }))).await;
    })
}

/// The reference surface as a frame, 404 as long as there is none.
async fn reference_surface(State(shared): State<Shared>) -> Response {
    let Some(surface) = shared.hub.surface() else {
        return (StatusCode::NOT_FOUND, "this run has no mesh whose shape could be changed\n")
            .into_response();
    };
    // Elsewhere: the others are served while it is encoded.
    let failed = |reason: String| (StatusCode::INTERNAL_SERVER_ERROR, reason).into_response();
    match tokio::task::spawn_blocking(move || surface.frame()).await {
        Ok(Ok(frame)) => {
            ([(header::CONTENT_TYPE, "application/octet-stream")], frame).into_response()
        }
        Ok(Err(reason)) => failed(format!("the surface was not encoded: {reason}\n")),
        Err(_) => failed("the encoder failed\n".into()),
    }
}

const JSON: [(HeaderName, &str); 1] = [(header::CONTENT_TYPE, "application/json")];

/// The pipelines as they are now, as JSON.
async fn pipelines(State(shared): State<Shared>) -> Response {
    (JSON, shared.hub.pipelines().to_string()).into_response()
}

/// The JSON Schema of a pipeline.
async fn schema() -> Response {
    (JSON, pipeline_schema().to_string()).into_response()
}

/// The JSON Schema of an order.
async fn schema_of_order() -> Response {
    (JSON, order_schema().to_string()).into_response()
}

async fn file(State(shared): State<Shared>, uri: Uri, request: Request) -> Response {
    if request.method() != axum::http::Method::GET {
        return StatusCode::METHOD_NOT_ALLOWED.into_response();
    }
    match shared.files.answer(uri.path(), request.headers()) {
        Some(answer) => answer,
        None => (StatusCode::NOT_FOUND, "no such file\n").into_response(),
    }
}
