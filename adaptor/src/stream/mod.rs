//! The server that viewers connect to, on a thread of its own.
//!
//! It serves the viewer's files at `/`, one WebSocket at `/ws`, the reference surface at `/surface`,
//! the stack of edits at `/stack`, the pipelines at `/pipelines`, the schema of one at `/schema` and that of an order at
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
//! Connections to any address but loopback are encrypted (TLS 1.3), unless the configuration says
//! that they are not. Who is trusted with what is in `docs/security.md`.
//!
//! [`StreamLimits`]: tombolo_pipelines::language::StreamLimits

mod allowance;
mod connection;
mod credentials;
mod gate;
mod hub;
mod invitation;
mod listener;
mod metrics;
mod observer;
mod outbox;
mod pace;
mod playback;
mod pool;
mod seats;
mod secret;
mod secured;
mod session;
mod socket;
mod stack;
mod surface;
mod text;
mod tls;
mod viewer_files;
mod wheel;

use std::{
    net::SocketAddr,
    path::Path,
    sync::{Arc, Mutex},
    thread::JoinHandle,
    time::Duration,
};

use axum::{
    Extension, Router,
    extract::{
        ConnectInfo, Query, Request, State, WebSocketUpgrade,
        ws::rejection::WebSocketUpgradeRejection,
    },
    http::{HeaderName, StatusCode, Uri, header},
    middleware,
    response::{IntoResponse, Response},
    routing::get,
};
use serde::{Deserialize, Serialize};
use tokio::sync::oneshot;
use tombolo_pipelines::{
    language::{
        JournalNote, Listen, Message, StreamLimits, StreamServer, order_schema, pipeline_schema,
    },
    limits::DOCUMENT,
};

use crate::lock::lock;

pub(crate) use hub::{Clock, End, Hub};
pub(crate) use observer::{Observer, Told};
pub(crate) use pace::{COARSER, EXACT, LEVELS};
pub(crate) use surface::ReferenceSurface;

use connection::Connection;
use credentials::{Access, Credentials, Holder, parameter};
use gate::Refusals;
use hub::Arrival;
use listener::Listener;
use socket::{Place, Socket};
use tls::Identity;
use tokio_rustls::TlsAcceptor;
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
        "stream.listen: {address} is in use by another program; choose another port or path, or port 0 for any that is free"
    )]
    InUse {
        /// The address or path.
        address: Listen,
    },
    /// The system refuses to listen there.
    #[error("stream.listen: cannot listen on {address}: {source}")]
    Listen {
        /// The address or path.
        address: Listen,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The system has no random numbers for a secret.
    #[error("no secret could be made: {0}")]
    Token(getrandom::Error),
    /// A secret that was given cannot be taken.
    #[error("stream.secrets: {0}")]
    Secrets(String),
    /// Connections cannot be encrypted as the settings say.
    #[error("stream.tls: {0}")]
    Tls(String),
    /// A thread could not be started.
    #[error("the stream's threads could not be started: {0}")]
    Thread(std::io::Error),
}

/// How long the end of a run waits for viewers to read that it ended.
const END_TIME: Duration = Duration::from_secs(1);

/// A running server. Dropping it ends its threads.
pub(crate) struct Server {
    place: Place,
    identity: Option<Identity>,
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
    is_encrypted: bool,
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
        let (socket, place) = Socket::bind(&settings.listen).map_err(|source| {
            let address = settings.listen.clone();
            match source.kind() {
                std::io::ErrorKind::AddrInUse => StreamError::InUse { address },
                _ => StreamError::Listen { address, source },
            }
        })?;
        let identity = identity(settings, &place)?;
        let loopback = matches!(&place, Place::Address(address) if address.ip().is_loopback());
        let credentials = Arc::new(Credentials::of(settings)?);
        hub.set_driver_silence(Duration::from_secs(settings.limits.driver_silence.get().into()));
        let shared = Shared {
            credentials: Arc::clone(&credentials),
            refusals: Arc::default(),
            hub: Arc::clone(&hub),
            commands,
            files: ViewerFiles::find(),
            loopback,
            is_encrypted: identity.is_some(),
            limits: settings.limits,
            playback,
        };
        let (stop, stopped) = oneshot::channel();
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .map_err(StreamError::Thread)?;
        let acceptor = identity.as_ref().map(|identity| identity.acceptor.clone());
        let mut server = Self {
            place,
            identity,
            credentials,
            hub: Arc::clone(&hub),
            links: None,
            stop: Some(stop),
            threads: Vec::new(),
        };
        let thread = |name: &str| std::thread::Builder::new().name(name.into());
        let serving = move || {
            serve_until_stopped(&runtime, (&socket, acceptor.as_ref()), &shared, stopped);
        };
        server.threads.push(thread("tombolo-stream").spawn(serving).map_err(StreamError::Thread)?);
        let encoding = move || while went_wrong("encoder", || hub.encode_until_closed()) {};
        server.threads.push(thread("tombolo-encode").spawn(encoding).map_err(StreamError::Thread)?);
        Ok(server)
    }

    /// The address that it listens on; `None` for a socket at a path.
    pub(crate) fn address(&self) -> Option<SocketAddr> {
        match self.place {
            Place::Address(address) => Some(address),
            Place::Socket(_) => None,
        }
    }

    /// SHA-256 of its certificate, where connections are encrypted.
    fn fingerprint(&self) -> Option<&str> {
        self.identity.as_ref().map(|identity| &*identity.fingerprint)
    }

    /// The name of its file of links: the port, or that of its socket.
    fn called(&self) -> String {
        match &self.place {
            Place::Address(address) => address.port().to_string(),
            Place::Socket(path) => {
                path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
            }
        }
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
        let address = match &self.place {
            Place::Address(address) => *address,
            Place::Socket(path) => return format!("unix:{}?{name}={secret}", path.display()),
        };
        let host = machine().filter(|_| address.ip().is_unspecified());
        let authority =
            host.map_or(address.to_string(), |name| format!("{name}:{}", address.port()));
        // What stands behind the `#` no browser sends; programs know the certificate by it.
        match self.fingerprint() {
            Some(fingerprint) => {
                format!("https://{authority}/?{name}={secret}#sha256={fingerprint}")
            }
            None => format!("http://{authority}/?{name}={secret}"),
        }
    }
}

/// The certificate of a server, where its connections are to be encrypted: always where others than
/// this machine reach it, unless that was expressly not wanted.
fn identity(settings: &StreamServer, place: &Place) -> Result<Option<Identity>, StreamError> {
    let wrong = |reason: &str| Err(StreamError::Tls(reason.into()));
    let address = match (place, &settings.tls, settings.insecure) {
        (_, Some(_), true) => return wrong("`insecure` says that nothing is encrypted"),
        (Place::Socket(_), Some(_), _) => {
            return wrong("what goes through a socket at a path never leaves the machine");
        }
        (Place::Socket(_), None, _) => return Ok(None),
        (Place::Address(address), _, _) => address,
    };
    let is_open = !address.ip().is_loopback();
    if settings.tls.is_none() && (!is_open || settings.insecure) {
        if is_open {
            log::warn!(
                "viewers reach {address} from other machines, and what they send and see can be \
                 read on the way, because `stream.insecure` says so"
            );
        }
        return Ok(None);
    }
    let names = [Some("localhost".to_owned()), machine(), Some(address.ip().to_string())];
    let names = names.into_iter().flatten().collect();
    Identity::of(&settings.tls.clone().unwrap_or_default(), names).map(Some)
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
    (socket, acceptor): (&Socket, Option<&TlsAcceptor>),
    shared: &Shared,
    mut stopped: oneshot::Receiver<()>,
) {
    while went_wrong("server", || {
        let listening = {
            let _context = runtime.enter();
            socket.listener()
        };
        let most = shared.limits.connections.get() as usize;
        match listening {
            Ok(listening) => {
                let listener = Listener::new(listening, acceptor.cloned(), most);
                runtime.block_on(serve(listener, shared.clone(), &mut stopped));
            }
            Err(error) => log::error!("the server of the stream cannot go on: {error}"),
        }
    }) && !shared.hub.is_closed()
    {}
}

async fn serve(listener: Listener, shared: Shared, stopped: &mut oneshot::Receiver<()>) {
    let hub = Arc::clone(&shared.hub);
    let commands = Arc::clone(&shared.commands);
    let router = Router::new()
        .route("/ws", get(upgrade))
        .route("/surface", get(reference_surface))
        .route("/stack", get(stack_of_edits))
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

/// The part of an address that says from which edit on; and of a recording, which stack.
#[derive(Deserialize)]
struct Wanted {
    #[serde(default)]
    from: usize,
    revision: Option<u64>,
}

/// The edits that make the shape, from one on: as many as go into one answer.
async fn stack_of_edits(
    State(shared): State<Shared>,
    Query(Wanted { from, revision }): Query<Wanted>,
) -> Response {
    // Elsewhere: the others are served while it is written out.
    let written = move || {
        let answer = match &shared.playback {
            Some(shown) => shown.stack(revision, from)?,
            None => shared.hub.told_stack().answer(from),
        };
        Some(serde_json::to_vec(&answer))
    };
    match tokio::task::spawn_blocking(written).await {
        Ok(Some(Ok(answer))) => (JSON, answer).into_response(),
        Ok(None) => (StatusCode::NOT_FOUND, "there is no such stack of edits\n").into_response(),
        _ => StatusCode::INTERNAL_SERVER_ERROR.into_response(),
    }
}

const JSON: [(HeaderName, &str); 1] = [(header::CONTENT_TYPE, "application/json")];

/// The pipelines as they are now, as JSON.
async fn pipelines(State(shared): State<Shared>) -> Response {
    (JSON, shared.hub.pipelines()).into_response()
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
