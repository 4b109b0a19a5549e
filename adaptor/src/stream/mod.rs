//! The server that viewers connect to, on a thread of its own.
//!
//! It serves the viewer's files at `/`, one WebSocket at `/ws?token=...`, the reference surface at
//! `/surface?token=...`, the pipelines at `/pipelines?token=...` and the schema of one at
//! `/schema?token=...` (the protocol is in `docs/protocol.md`). Nothing that a client does
//! reaches the solver but commands that were read and found valid.
//!
//! What it guarantees: it listens on the loopback address unless told otherwise; nothing of the run
//! without the token; no page of another site can use a browser's connection (the `Origin` must be
//! the server's own), nor reach it under another name (on loopback the `Host` must be loopback
//! too); messages over [`DOCUMENT`], more than [`VIEWERS`] viewers, and floods of messages are
//! refused; a client that does not read for 10 seconds, or says nothing for 30, is let go.
//!
//! What it does not: it does not encrypt. Over an open network use an SSH tunnel to the loopback
//! address.

mod connection;
mod hub;
mod outbox;
mod session;
mod surface;
mod token;
mod viewer_files;

use std::{
    net::{SocketAddr, TcpListener},
    sync::Arc,
    thread::JoinHandle,
    time::Duration,
};

use axum::{
    Router,
    extract::{
        ConnectInfo, Query, Request, State, WebSocketUpgrade,
        ws::rejection::WebSocketUpgradeRejection,
    },
    http::{HeaderMap, HeaderName, HeaderValue, StatusCode, Uri, header},
    middleware::{self, Next},
    response::{IntoResponse, Response},
    routing::get,
};
use serde::{Deserialize, Serialize};
use tokio::sync::oneshot;
use tombolo_pipelines::{
    language::{Message, StreamServer, pipeline_schema},
    limits::DOCUMENT,
};

pub(crate) use hub::{Clock, End, Hub};
pub(crate) use surface::ReferenceSurface;
pub use token::Token;

use connection::{Connection, Listener};
use viewer_files::ViewerFiles;

/// The most viewers that may watch at once.
pub const VIEWERS: usize = 16;
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
    /// The system has no random numbers for a token.
    #[error("no token could be made: {0}")]
    Token(getrandom::Error),
    /// A thread could not be started.
    #[error("the stream's threads could not be started: {0}")]
    Thread(std::io::Error),
}

/// How long the end of a run waits for viewers to read that it ended.
const END_TIME: Duration = Duration::from_secs(1);

/// A running server. Dropping it ends its threads.
pub(crate) struct Server {
    address: SocketAddr,
    token: Token,
    hub: Arc<Hub>,
    stop: Option<oneshot::Sender<()>>,
    threads: Vec<JoinHandle<()>>,
}

#[derive(Clone)]
struct Shared {
    token: Token,
    hub: Arc<Hub>,
    commands: Arc<dyn CommandSink>,
    files: ViewerFiles,
    loopback: bool,
}

impl Server {
    /// Listens on an address (port 0 for any that is free) and serves on threads of its own.
    pub(crate) fn start(
        settings: &StreamServer,
        hub: Arc<Hub>,
        commands: Arc<dyn CommandSink>,
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
        let token = match &settings.token {
            Some(given) => Token::given(given),
            None => Token::random().map_err(StreamError::Token)?,
        };
        let shared = Shared {
            token: token.clone(),
            hub: Arc::clone(&hub),
            commands,
            files: ViewerFiles::find(),
            loopback: address.ip().is_loopback(),
        };
        let (stop, stopped) = oneshot::channel();
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .map_err(StreamError::Thread)?;
        let mut server =
            Self { address, token, hub: Arc::clone(&hub), stop: Some(stop), threads: Vec::new() };
        let thread = |name: &str| std::thread::Builder::new().name(name.into());
        let serving = move || runtime.block_on(serve(socket, shared, stopped));
        server.threads.push(thread("tombolo-stream").spawn(serving).map_err(StreamError::Thread)?);
        let encoding = move || hub.encode_until_closed();
        server.threads.push(thread("tombolo-encode").spawn(encoding).map_err(StreamError::Thread)?);
        Ok(server)
    }

    pub(crate) fn address(&self) -> SocketAddr {
        self.address
    }

    /// The link that a viewer opens.
    pub(crate) fn link(&self) -> String {
        let port = self.address.port();
        let host = match self.address.ip() {
            ip if ip.is_unspecified() => machine(),
            _ => None,
        };
        let authority = host.map_or(self.address.to_string(), |name| format!("{name}:{port}"));
        format!("http://{authority}/?token={}", self.token.as_str())
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

async fn serve(socket: TcpListener, shared: Shared, stopped: oneshot::Receiver<()>) {
    let Ok(socket) = tokio::net::TcpListener::from_std(socket) else { return };
    let hub = Arc::clone(&shared.hub);
    let commands = Arc::clone(&shared.commands);
    let router = Router::new()
        .route("/ws", get(upgrade))
        .route("/surface", get(reference_surface))
        .route("/pipelines", get(pipelines))
        .route("/schema", get(schema))
        .fallback(file)
        .layer(middleware::from_fn_with_state(shared.clone(), guard))
        .with_state(shared)
        .into_make_service_with_connect_info::<Connection>();
    let statuses = async {
        let mut tick = tokio::time::interval(STATUS_PERIOD);
        tick.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
        loop {
            tick.tick().await;
            commands.look_at_time();
            hub.status();
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
        _ = axum::serve(Listener::new(socket), router) => {}
        () = statuses => {}
        () = ended => {}
    }
}

const HEADERS: [(HeaderName, &str); 6] = [
    (header::CACHE_CONTROL, "no-store"),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::REFERRER_POLICY, "no-referrer"),
    (header::X_FRAME_OPTIONS, "DENY"),
    (
        header::CONTENT_SECURITY_POLICY,
        "default-src 'self'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self' 'unsafe-inline'; \
         img-src 'self' data: blob:; worker-src 'self' blob:; connect-src 'self'; object-src 'none'; \
         base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    ),
    (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
];

/// Refuses requests under a foreign name or from a foreign page, and puts the headers on every
/// answer.
async fn guard(State(shared): State<Shared>, request: Request, next: Next) -> Response {
    let mut response = match refuse(request.uri(), request.headers(), shared.loopback) {
        Some(reason) => (StatusCode::FORBIDDEN, reason).into_response(),
        None => next.run(request).await,
    };
    for (name, value) in HEADERS {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}

fn refuse(uri: &Uri, headers: &HeaderMap, loopback: bool) -> Option<&'static str> {
    let text = |name: HeaderName| headers.get(name).map(|value| value.to_str().unwrap_or(""));
    let host = text(header::HOST).unwrap_or("");
    if headers.get_all(header::HOST).iter().count() > 1
        || uri.authority().is_some_and(|authority| authority.as_str() != host)
    {
        return Some("this request names more than one host\n");
    }
    // Any port will do: a tunnel may end on another one.
    let name = host
        .rsplit_once(':')
        .map_or(host, |(name, port)| if port.ends_with(']') { host } else { name });
    if loopback && !matches!(name, "localhost" | "127.0.0.1" | "[::1]") {
        return Some("this server answers to localhost, 127.0.0.1 and [::1] only\n");
    }
    match text(header::ORIGIN) {
        Some(origin) if origin.split_once("://").map(|(_, authority)| authority) != Some(host) => {
            Some("this request comes from a page of another site\n")
        }
        _ => None,
    }
}

/// The query of a URL; anything else in it is left alone.
#[derive(Deserialize)]
struct Credentials {
    token: Option<String>,
    /// The name of the viewer before it lost its connection.
    client: Option<String>,
}

const UNAUTHORIZED: &str = "the token is missing or wrong; open the link that the solver printed\n";

async fn upgrade(
    State(shared): State<Shared>,
    ConnectInfo(connection): ConnectInfo<Connection>,
    Query(credentials): Query<Credentials>,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> Response {
    if !credentials.token.is_some_and(|token| shared.token.matches(&token)) {
        return (StatusCode::UNAUTHORIZED, UNAUTHORIZED).into_response();
    }
    let upgrade = match upgrade {
        Ok(upgrade) => upgrade,
        Err(rejection) => return rejection.into_response(),
    };
    let upgrade = upgrade.max_message_size(MESSAGE_SIZE).max_frame_size(MESSAGE_SIZE);
    upgrade.on_upgrade(move |mut socket| async move {
        connection.upgraded();
        match shared.hub.join(VIEWERS, credentials.client.as_deref()) {
            Some(client) => session::serve(socket, client, shared.hub, shared.commands).await,
            None => {
                use axum::extract::ws::{CloseFrame, Message as Wire};
                let reason = format!("{VIEWERS} viewers watch already");
                let _ = socket
                    .send(Wire::Close(Some(CloseFrame { code: 1013, reason: reason.into() })))
                    .await;
            }
        }
    })
}

/// The reference surface as a frame, 404 as long as there is none.
async fn reference_surface(
    State(shared): State<Shared>,
    Query(credentials): Query<Credentials>,
) -> Response {
    if !credentials.token.is_some_and(|token| shared.token.matches(&token)) {
        return (StatusCode::UNAUTHORIZED, UNAUTHORIZED).into_response();
    }
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
async fn pipelines(
    State(shared): State<Shared>,
    Query(credentials): Query<Credentials>,
) -> Response {
    if !credentials.token.is_some_and(|token| shared.token.matches(&token)) {
        return (StatusCode::UNAUTHORIZED, UNAUTHORIZED).into_response();
    }
    (JSON, shared.hub.pipelines().to_string()).into_response()
}

/// The JSON Schema of a pipeline.
async fn schema(State(shared): State<Shared>, Query(credentials): Query<Credentials>) -> Response {
    if !credentials.token.is_some_and(|token| shared.token.matches(&token)) {
        return (StatusCode::UNAUTHORIZED, UNAUTHORIZED).into_response();
    }
    (JSON, pipeline_schema().to_string()).into_response()
}

async fn file(State(shared): State<Shared>, uri: Uri, request: Request) -> Response {
    if request.method() != axum::http::Method::GET {
        return StatusCode::METHOD_NOT_ALLOWED.into_response();
    }
    // A link with a wrong token is answered here, where a person can read it, rather than by a page
    // that cannot connect.
    let shown = Query::<Credentials>::try_from_uri(&uri).ok().and_then(|query| query.0.token);
    if shown.is_some_and(|token| !shared.token.matches(&token)) {
        return (StatusCode::UNAUTHORIZED, UNAUTHORIZED).into_response();
    }
    match shared.files.get(uri.path()) {
        Some((content_type, bytes)) => {
            ([(header::CONTENT_TYPE, content_type)], bytes).into_response()
        }
        None => (StatusCode::NOT_FOUND, "no such file\n").into_response(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(host: &'static str, origin: Option<&'static str>) -> HeaderMap {
        let mut headers = HeaderMap::new();
        headers.insert(header::HOST, HeaderValue::from_static(host));
        if let Some(origin) = origin {
            headers.insert(header::ORIGIN, HeaderValue::from_static(origin));
        }
        headers
    }

    #[test]
    fn foreign_pages_and_names_are_refused() {
        for (host, origin) in [
            ("127.0.0.1:7070", None),
            ("localhost:9000", Some("http://localhost:9000")),
            ("[::1]:7070", Some("http://[::1]:7070")),
            ("localhost", Some("https://localhost")),
        ] {
            assert_eq!(
                refuse(&Uri::from_static("/"), &headers(host, origin), true),
                None,
                "{host} {origin:?}"
            );
        }
        for (host, origin) in [
            ("rebound.example:7070", None),
            ("127.0.0.1:7070", Some("http://evil.example")),
            ("127.0.0.1:7070", Some("null")),
            ("127.0.0.1:7070", Some("http://127.0.0.1:8080")),
            ("127.0.0.1.evil.example:7070", None),
            ("", None),
        ] {
            assert!(
                refuse(&Uri::from_static("/"), &headers(host, origin), true).is_some(),
                "{host} {origin:?}"
            );
        }
        assert_eq!(
            refuse(&Uri::from_static("/"), &headers("cluster.example:7070", None), false),
            None
        );
    }
}
