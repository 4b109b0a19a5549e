//! A relay: runs connect to it, and viewers reach them through it, where they cannot reach the runs
//! themselves.
//!
//! A relay lets two kinds in. Runs show the secret for runs; people show the secret, link or cookie for
//! its page, which lists the runs. What goes to `/NAME/...` is passed on to the run of that name, which
//! asks for its own secrets: the relay knows none of them. Its certificate tells runs and viewers that
//! it is this relay.
//!
//! What it guarantees: connections, runs, the connections to one run and the time for showing a secret
//! are bounded; a viewer that reads slowly holds up its own connection alone; a run whose connection is
//! lost leaves the list.

mod attach;
mod forward;
mod page;
mod runs;

use std::{
    fs::DirBuilder,
    io,
    net::SocketAddr,
    num::NonZeroU32,
    path::{Path, PathBuf},
    sync::Arc,
    thread::JoinHandle,
};

use axum::{
    Router,
    extract::{ConnectInfo, Request, State},
    middleware::{self, Next},
    response::Response,
    routing::get,
};
use tokio::sync::oneshot;
use tombolo_pipelines::language::{Embedders, StreamLimits, Tls};

use super::{
    connect::is_address,
    connection::Connection,
    credentials::{Access, Credentials, KeptSecret},
    gate::{self, Gate},
    links::{LinkFile, authority, fragment, with_colons},
    listener::Listener,
    refusals::Refusals,
    relay_messages::{ATTACH, CARRY},
    socket::Socket,
    tls::{Identity, names_of},
};
pub(crate) use forward::{NOT_CONNECTED, SILENT_RUN};
use runs::{RUNS, Runs};

/// The files of a relay's directory: the secret that runs name as `stream.secrets`, that of its page,
/// and its certificate.
const RUNS_FILE: &str = "runs.json";
const PEOPLE_FILE: &str = "people.json";
/// The name of the cookie, before its port.
const COOKIE: &str = "tombolo-relay";

/// The settings of a relay.
#[derive(Debug, Clone)]
pub struct RelaySettings {
    /// The address for runs and viewers; port 0 takes any free one.
    pub listen: SocketAddr,
    /// The certificate; left out, one is made, and kept in the directory. A relay on a loopback address
    /// encrypts nothing, unless this says so.
    pub tls: Option<Tls>,
    /// Where its secrets and its certificate are kept, so that runs know it again after a restart. Made
    /// where it is missing, with mode 0700.
    pub directory: PathBuf,
    /// The address at which viewers reach it, where that is not the one that runs connect to, such as
    /// `https://portal.example.org/tombolo`.
    pub public: Option<String>,
    /// Connections of viewers to runs, at once; half of them to one run.
    pub connections: NonZeroU32,
}

impl RelaySettings {
    /// A relay for this machine alone, with its files in a directory.
    #[must_use]
    pub fn new(directory: impl Into<PathBuf>) -> Self {
        Self {
            listen: SocketAddr::from(([127, 0, 0, 1], 7400)),
            tls: None,
            directory: directory.into(),
            public: None,
            connections: NonZeroU32::MIN.saturating_add(255),
        }
    }
}

/// Why a relay could not be started.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RelayError {
    /// Nothing can listen there.
    #[error("cannot listen on {address}: {source}")]
    Listen {
        /// The address.
        address: SocketAddr,
        /// The system's reason.
        source: io::Error,
    },
    /// Its directory, or a file in it, cannot be made or read.
    #[error("{}: {reason}", .path.display())]
    Directory {
        /// The directory or file.
        path: PathBuf,
        /// The reason.
        reason: String,
    },
    /// Viewers could not be given links below its public address.
    #[error("public: found {found:?}, expected https://HOST or http://HOST, with a path at will")]
    Public {
        /// The address.
        found: String,
    },
    /// Its secrets, its certificate or its threads are not to be had.
    #[error(transparent)]
    Stream(#[from] super::StreamError),
}

/// A relay that is running. Dropping it ends every connection through it.
///
/// ```no_run
/// use tombolo::stream::relay::{Relay, RelaySettings};
///
/// let relay = Relay::start(&RelaySettings::new("/home/me/.tombolo-relay"))?;
/// println!("in the configuration of each run: {}", relay.stream_settings());
/// # Ok::<(), tombolo::stream::relay::RelayError>(())
/// ```
pub struct Relay {
    state: Arc<RelayState>,
    address: SocketAddr,
    directory: PathBuf,
    links: Option<LinkFile>,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

/// The state that every request is answered from.
struct RelayState {
    gate: Gate,
    credentials: Arc<Credentials>,
    runs: Runs,
    fingerprint: Option<String>,
    public: Option<String>,
}

impl RelayState {
    /// The beginning of the addresses that viewers use; `host` is the one that a run has connected to.
    fn base(&self, host: &str) -> String {
        let scheme = if self.gate.is_encrypted { "https" } else { "http" };
        self.public.clone().unwrap_or_else(|| format!("{scheme}://{host}"))
    }

    /// The fingerprint in the links of viewers. Behind a public address there may be another certificate.
    fn fingerprint_in_links(&self) -> Option<&str> {
        self.fingerprint.as_deref().filter(|_| self.public.is_none())
    }
}

impl Relay {
    /// Listens, and serves on a thread of its own.
    ///
    /// # Errors
    /// [`RelayError`].
    pub fn start(settings: &RelaySettings) -> Result<Self, RelayError> {
        let public = settings.public.as_ref().map(|base| base.trim_end_matches('/').to_owned());
        if public.as_ref().is_some_and(|base| !is_address(&format!("{base}/run/"))) {
            return Err(RelayError::Public { found: settings.public.clone().unwrap_or_default() });
        }
        let directory = &settings.directory;
        make_private(directory).map_err(|error| RelayError::Directory {
            path: directory.clone(),
            reason: error.to_string(),
        })?;
        let kept = |file: &str, secret: KeptSecret| {
            let path = directory.join(file);
            secret.kept(&path).map_err(|reason| RelayError::Directory { path, reason })
        };
        let of_runs = kept(RUNS_FILE, KeptSecret::Relay)?;
        let of_people = kept(PEOPLE_FILE, KeptSecret::Watch)?;
        // Each viewer takes one connection here and one of its run.
        let of_viewers = settings.connections.saturating_add(settings.connections.get());
        let most = of_viewers.saturating_add(u32::try_from(RUNS).unwrap_or(u32::MAX));
        let limits = StreamLimits { connections: most, ..StreamLimits::default() };
        let credentials = Credentials::new(of_runs, of_people, COOKIE, limits);
        let credentials = Arc::new(credentials);
        let failed = |source| RelayError::Listen { address: settings.listen, source };
        let (socket, address) = Socket::bind_address(settings.listen).map_err(failed)?;
        super::links::warn_of_open(None, address, "--listen");
        let is_open = !address.ip().is_loopback();
        let identity = match &settings.tls {
            Some(tls) => Some(Identity::of(tls, names_of(address))?),
            None if is_open => Some(Identity::kept(directory, names_of(address))?),
            None => None,
        };
        let refusals = Arc::<Refusals>::default();
        let state = Arc::new(RelayState {
            gate: Gate {
                credentials: Arc::clone(&credentials),
                refusals: Arc::clone(&refusals),
                is_loopback: !is_open,
                public: public.as_deref().and_then(host_of).map(str::to_owned),
                is_encrypted: identity.is_some(),
                // Of its own pages; those of a run have what the run says.
                framing: gate::Framing::of(&Embedders::default()),
            },
            credentials,
            runs: Runs::new(settings.connections.get() as usize),
            fingerprint: identity.as_ref().map(|identity| identity.fingerprint.clone()),
            public,
        });
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .map_err(super::StreamError::Thread)?;
        let (stop, stopped) = oneshot::channel();
        let router = router(Arc::clone(&state));
        let serving = move || {
            let listening = {
                let _context = runtime.enter();
                socket.listener()
            };
            let acceptor = identity.map(|identity| identity.acceptor);
            match listening {
                Ok(listening) => runtime.block_on(async move {
                    let (listener, _) =
                        Listener::new(Some(listening), acceptor, &limits, &refusals);
                    let router = router.into_make_service_with_connect_info::<Connection>();
                    tokio::select! {
                        _ = axum::serve(listener, router) => {}
                        _ = stopped => {}
                    }
                }),
                Err(error) => tracing::error!("the relay cannot listen: {error}"),
            }
        };
        let thread = std::thread::Builder::new().name("tombolo-relay".into()).spawn(serving);
        Ok(Self {
            state,
            address,
            directory: directory.clone(),
            links: None,
            stop: Some(stop),
            thread: Some(thread.map_err(super::StreamError::Thread)?),
        })
    }

    /// The address that it listens on.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// The link of those who may see its page, with their secret.
    #[must_use]
    pub fn link(&self) -> String {
        self.link_with("token", self.state.credentials.secret(Access::Watch).as_str())
    }

    /// The `stream` of a configuration with which a run on this file system connects to it.
    #[must_use]
    pub fn stream_settings(&self) -> String {
        let fragment = fragment(self.state.fingerprint.as_deref());
        let scheme = if self.state.gate.is_encrypted { "" } else { "http://" };
        let connect = format!("{scheme}{}{fragment}", authority(self.address));
        let secrets = self.directory.join(RUNS_FILE);
        let secrets = std::path::absolute(&secrets).unwrap_or(secrets);
        serde_json::json!({"connect": connect, "secrets": secrets}).to_string()
    }

    /// Writes the link of its page into its directory, and says how to open it and how runs connect. Only
    /// to a terminal is a link itself printed, which opens one browser, once.
    ///
    /// # Errors
    /// Where the file of the link cannot be written.
    pub fn invitation(&mut self, terminal: bool) -> io::Result<String> {
        let path = self.directory.join("relay.link");
        self.links = None;
        self.links = Some(LinkFile::write(path.clone(), &format!("page: {}\n", self.link()))?);
        let key = self.state.credentials.sessions.key(Access::Watch, None).ok();
        let mut text = match key.filter(|_| terminal) {
            Some(key) => format!(
                "open {}\nIt opens one browser, once; a link for others is in {}",
                self.link_with("key", key.as_str()),
                path.display()
            ),
            None => format!("the link to the page of this relay is in {}", path.display()),
        };
        text += &format!("\nruns connect with \"stream\": {}", self.stream_settings());
        if let Some(fingerprint) = &self.state.fingerprint {
            text += &format!(
                "\nits certificate has the SHA-256 fingerprint {}",
                with_colons(fingerprint)
            );
        }
        Ok(text)
    }

    fn link_with(&self, name: &str, secret: &str) -> String {
        let base = self.state.base(&authority(self.address));
        format!("{base}/?{name}={secret}{}", fragment(self.state.fingerprint_in_links()))
    }
}

impl Drop for Relay {
    fn drop(&mut self) {
        if let Some(stop) = self.stop.take() {
            let _ = stop.send(());
        }
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn router(state: Arc<RelayState>) -> Router {
    Router::new()
        .route("/", get(page::page))
        .route("/-/page.js", get(page::script))
        .route("/-/runs", get(page::list))
        .route(ATTACH, get(attach::attach))
        .route(&format!("{}{{ticket}}", CARRY), get(attach::carry))
        .route_layer(middleware::from_fn(gate::holders_only))
        .fallback(forward::forward)
        .layer(middleware::from_fn_with_state(Arc::clone(&state), guard))
        .with_state(state)
}

/// Lets those in to the relay's own pages who have its secrets. What is for a run passes: the run asks
/// for its own.
async fn guard(
    State(relay): State<Arc<RelayState>>,
    ConnectInfo(connection): ConnectInfo<Connection>,
    mut request: Request,
    next: Next,
) -> Response {
    let _asked = connection.asked();
    let path = request.uri().path();
    let is_own = path == "/" || path.starts_with("/-/");
    let refused = if is_own {
        relay.gate.admit(&connection, &mut request)
    } else {
        relay.gate.foreign(&connection, &request)
    };
    let is_answered = refused.is_some();
    let mut response = match refused {
        Some(answer) => answer,
        None => next.run(request).await,
    };
    if is_own || is_answered {
        relay.gate.log_refusal(&connection, &response);
        relay.gate.add_headers(&mut response);
    }
    response
}

/// The host of an address such as `https://portal.example.org/tombolo`.
fn host_of(address: &str) -> Option<&str> {
    let (_, rest) = address.split_once("://")?;
    rest.split('/').next().map(gate::without_port)
}

/// A directory that nobody else gets into, if it is not there yet.
fn make_private(directory: &Path) -> io::Result<()> {
    let mut builder = DirBuilder::new();
    builder.recursive(true);
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder.create(directory)
}
