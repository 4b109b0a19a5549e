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
//! Where viewers cannot reach it, it connects to a [relay], through which they do.
//!
//! Connections to any address but loopback are encrypted (TLS 1.3), unless the configuration says
//! that they are not. Who is trusted with what is in `docs/security.md`.
//!
//! [`DOCUMENT`]: tombolo_pipelines::limits::DOCUMENT
//! [`StreamLimits`]: tombolo_pipelines::language::StreamLimits

mod allowance;
mod connect;
mod connection;
mod credentials;
mod encoding;
mod gate;
mod hub;
mod links;
mod listener;
mod metrics;
mod observer;
mod outbox;
mod pace;
mod people;
mod playback;
mod pool;
mod refusals;
pub mod relay;
mod relay_messages;
mod routes;
mod seats;
mod secret;
mod session;
mod sessions;
mod socket;
mod stack;
mod status;
mod surface;
#[cfg(test)]
mod tests;
mod text;
mod tls;
mod together;
mod viewer_files;
mod viewer_lines;
mod wheel;

use std::{
    io,
    net::SocketAddr,
    path::Path,
    sync::{Arc, Mutex},
    thread::JoinHandle,
    time::Duration,
};

use serde::Serialize;
use tokio::sync::oneshot;
use tombolo_pipelines::language::{JournalNote, Listen, Message, StreamLimits, StreamServer};

use crate::lock::lock;

pub(crate) use hub::{Clock, End, Hub};
pub(crate) use links::told_in;
pub(crate) use observer::{Observed, Observer};
pub(crate) use pace::{COARSER, EXACT, LEVELS};
pub(crate) use session::UNDRIVEN;
pub(crate) use surface::ReferenceSurface;

use connect::Connect;
use connection::Connection;
pub(crate) use credentials::warn_of_readable_token;
use credentials::{Access, Credentials};
use gate::{Framing, Gate};
use links::Links;
use listener::Listener;
use refusals::Refusals;
use socket::{Listening, Place, Socket};
use tls::Identity;
use tokio_rustls::TlsAcceptor;
use viewer_files::ViewerFiles;
use viewer_lines::ViewerLines;

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

    /// Hears that a viewer has left.
    fn left(&self, _client: u64) {}

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
    /// Frames that are not in the recording, because the encoder or the disk did not keep up.
    pub unrecorded: u64,
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
    /// The run cannot connect to a relay as the settings say.
    #[error("stream.connect: {0}")]
    Relay(String),
    /// A thread could not be started.
    #[error("the stream's threads could not be started: {0}")]
    Thread(std::io::Error),
}

/// How long the end of a run waits for viewers to read that it ended.
const END_TIME: Duration = Duration::from_secs(3);

/// Threads for what would keep the others from being served.
const BLOCKING_THREADS: usize = 2;

/// A running server. Dropping it ends its threads.
pub(crate) struct Server {
    links: Arc<Links>,
    hub: Arc<Hub>,
    stop: Option<oneshot::Sender<()>>,
    serving: Option<JoinHandle<()>>,
    encoding: Option<JoinHandle<()>>,
}

/// The state that every request is answered from.
#[derive(Clone)]
struct Shared {
    gate: Arc<Gate>,
    hub: Arc<Hub>,
    commands: Arc<dyn CommandSink>,
    files: ViewerFiles,
    limits: StreamLimits,
    lines: Arc<ViewerLines>,
    /// The recording that is served in place of a run.
    playback: Option<Arc<playback::Shown>>,
}

/// The ways by which connections come to a server.
struct Ways {
    socket: Option<Socket>,
    acceptor: Option<TlsAcceptor>,
    relay: Option<Arc<Connect>>,
    links: Arc<Links>,
}

impl Server {
    /// Listens on an address (port 0 for any that is free), connects to a relay, or both, and serves on
    /// threads of its own.
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
        let relay = Connect::of(settings, hub.run())?;
        let bind = |listen: Listen| {
            Socket::bind(&listen).map_err(|source| match source.kind() {
                std::io::ErrorKind::AddrInUse => StreamError::InUse { address: listen },
                _ => StreamError::Listen { address: listen, source },
            })
        };
        let (socket, place) = settings.place().map(bind).transpose()?.unzip();
        if let Some(Place::Address(address)) = &place {
            let setting = if playback.is_some() { "--listen" } else { "`stream.listen`" };
            links::warn_of_open(hub.run(), *address, setting);
        }
        let identity = match &place {
            Some(place) => Identity::of_server(settings, place)?,
            None => None,
        };
        let is_loopback =
            matches!(&place, Some(Place::Address(address)) if address.ip().is_loopback());
        let credentials = Arc::new(Credentials::of(settings)?);
        hub.set_driver_silence(Duration::from_secs(settings.limits.driver_silence.get().into()));
        let gate = Gate {
            credentials: Arc::clone(&credentials),
            refusals: Arc::new(Refusals::of_run(hub.run())),
            is_loopback,
            public: None,
            is_encrypted: identity.is_some(),
            framing: Framing::of(&settings.embed),
        };
        let shared = Shared {
            gate: Arc::new(gate),
            hub: Arc::clone(&hub),
            commands,
            files: ViewerFiles::find(),
            limits: settings.limits,
            lines: Arc::default(),
            playback,
        };
        let (acceptor, fingerprint) =
            identity.map(|identity| (identity.acceptor, identity.fingerprint)).unzip();
        let links = Arc::new(Links {
            place,
            fingerprint,
            credentials,
            relay: relay.clone(),
            file: Mutex::default(),
            is_of_recording: shared.playback.is_some(),
        });
        let ways = Ways { socket, acceptor, relay, links: Arc::clone(&links) };
        let (stop, stopped) = oneshot::channel();
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            // Answers that take long, of which there may be many asked for at once, and names that
            // are looked up: none of them waits for another.
            .max_blocking_threads(BLOCKING_THREADS)
            .build()
            .map_err(StreamError::Thread)?;
        let mut server =
            Self { links, hub: Arc::clone(&hub), stop: Some(stop), serving: None, encoding: None };
        let thread = |name: &str| std::thread::Builder::new().name(name.into());
        let serving = move || serve_until_stopped(runtime, &ways, &shared, stopped);
        let serving = thread("tombolo-stream").spawn(serving);
        server.serving = Some(serving.map_err(StreamError::Thread)?);
        let encoding = move || while went_wrong("encoder", || hub.encode_until_closed()) {};
        let encoding = thread("tombolo-encode").spawn(encoding);
        server.encoding = Some(encoding.map_err(StreamError::Thread)?);
        Ok(server)
    }

    /// The address that it listens on; `None` for a socket at a path, and where it only connects to a
    /// relay.
    pub(crate) fn address(&self) -> Option<SocketAddr> {
        match self.links.place {
            Some(Place::Address(address)) => Some(address),
            Some(Place::Socket(_)) | None => None,
        }
    }

    /// The link of those who drive, with their secret.
    pub(crate) fn link(&self) -> String {
        self.links.link(Access::Drive)
    }

    /// The link of those who watch, with their secret.
    pub(crate) fn watching_link(&self) -> String {
        self.links.link(Access::Watch)
    }

    /// A link that opens one browser, once, for driving; `None` where the system has no random
    /// numbers.
    pub(crate) fn browser_link(&self) -> Option<String> {
        self.links.browser_link()
    }

    /// Writes the links of the run into a directory, and says how to open it. Only to a terminal is
    /// a link itself told: what is printed elsewhere others may read.
    pub(crate) fn invitation(&self, directory: &Path, terminal: bool) -> io::Result<String> {
        self.links.invitation(directory, terminal)
    }
}

impl Drop for Server {
    /// The last frames come before the word of the end.
    fn drop(&mut self) {
        self.hub.close();
        if let Some(encoding) = self.encoding.take() {
            let _ = encoding.join();
        }
        if let Some(stop) = self.stop.take() {
            let _ = stop.send(());
        }
        if let Some(serving) = self.serving.take() {
            let _ = serving.join();
        }
    }
}

/// Does a thing; whether it panicked, which is logged once. What it shares with others is guarded
/// by [`lock`], and never half done.
fn went_wrong(what: &'static str, act: impl FnOnce()) -> bool {
    static REPORTED: Mutex<Vec<&str>> = Mutex::new(Vec::new());
    let outcome = std::panic::catch_unwind(std::panic::AssertUnwindSafe(act));
    if outcome.is_err() {
        let mut reported = lock(&REPORTED);
        if !reported.contains(&what) {
            reported.push(what);
            tracing::error!(
                "the {what} of the stream failed, which is a fault of Tombolo; it goes on"
            );
        }
        drop(reported);
        // Whatever it was must not happen without a pause.
        std::thread::sleep(STATUS_PERIOD);
    }
    outcome.is_err()
}

fn serve_until_stopped(
    runtime: tokio::runtime::Runtime,
    ways: &Ways,
    shared: &Shared,
    mut stopped: oneshot::Receiver<()>,
) {
    while went_wrong("server", || {
        let listening = {
            let _context = runtime.enter();
            ways.socket.as_ref().map(Socket::listener).transpose()
        };
        match listening {
            Ok(listening) => {
                runtime.block_on(serve(listening, ways, shared.clone(), &mut stopped));
            }
            Err(error) => tracing::error!("the server of the stream cannot go on: {error}"),
        }
    }) && !shared.hub.is_closed()
    {}
    // The name of a relay that is still being looked up is not waited for.
    runtime.shutdown_background();
}

async fn serve(
    listening: Option<Listening>,
    ways: &Ways,
    shared: Shared,
    stopped: &mut oneshot::Receiver<()>,
) {
    let hub = Arc::clone(&shared.hub);
    let commands = Arc::clone(&shared.commands);
    let (listener, entrance) =
        Listener::new(listening, ways.acceptor.clone(), &shared.limits, &shared.gate.refusals);
    let router = routes::router(shared).into_make_service_with_connect_info::<Connection>();
    let connecting = async {
        match &ways.relay {
            Some(relay) => relay.keep(&entrance, || ways.links.renew()).await,
            None => std::future::pending().await,
        }
    };
    let statuses = async {
        let mut tick = tokio::time::interval(STATUS_PERIOD);
        tick.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
        loop {
            tick.tick().await;
            went_wrong("status", || {
                commands.look_at_time();
                hub.status();
                hub.people();
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
        () = connecting => {}
        () = statuses => {}
        () = ended => {}
    }
}
