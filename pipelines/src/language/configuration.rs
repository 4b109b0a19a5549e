//! A configuration: the views to stream, the monitors to watch, and how orders become mesh motion.

use std::collections::BTreeMap;
use std::fmt;
use std::net::SocketAddr;
use std::num::NonZeroU32;
use std::path::PathBuf;
use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Problem;
use super::as_text::as_text;
use super::pipeline::{Due, Pipeline};
use super::{
    page_origin::Embedders,
    relay_address::{RelayAddress, RunName},
};
use crate::limits::{Limit, PENDING, PENDING_BYTES};

/// A whole configuration file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// The version of this language: 1.
    #[schemars(range(min = 1, max = 1))]
    pub version: u32,
    /// A description of the file, for people.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub description: Option<String>,
    /// The server that viewers connect to; left out, there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stream: Option<StreamServer>,
    /// The file that every command, its outcome and every shape handed out are written to, one JSON
    /// object a line, below those of earlier runs. A run can be carried out again from it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub journal: Option<String>,
    /// The file that everything viewers are told is kept in, frames and all, whether anybody watches or
    /// not; what is in it already stays. `tombolo play` shows it, `tombolo export` writes files of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub record: Option<String>,
    /// The most that the recording may have, in units of 2^20 bytes: it ends there, and the run goes
    /// on.
    #[serde(default = "record_megabytes")]
    pub record_megabytes: NonZeroU32,
    /// How orders from viewers are carried out.
    #[serde(default)]
    pub steering: Steering,
    /// Whether the file is looked at again while the run goes on, about once a second: pipelines
    /// that are changed in it are changed in the run. Everything else needs a restart.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub watch: bool,
    /// The units of fields and of the solver's parameters, by name, such as `{"velocity": "m/s"}`. They are
    /// shown to people; nothing is converted.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub units: BTreeMap<String, String>,
    /// The pipelines, each with the steps at which it runs.
    #[serde(default)]
    pub pipelines: Vec<Pipeline>,
}

/// The size of a recording where nothing else is said.
pub fn record_megabytes() -> NonZeroU32 {
    NonZeroU32::MIN.saturating_add(4095)
}

impl Config {
    /// A configuration of pipelines alone.
    pub(super) fn of_pipelines(pipelines: Vec<Pipeline>) -> Self {
        Self {
            version: 1,
            description: None,
            stream: None,
            journal: None,
            record: None,
            record_megabytes: record_megabytes(),
            steering: Steering::default(),
            watch: false,
            units: BTreeMap::new(),
            pipelines,
        }
    }

    /// The name of the channel whose mesh orders change, where a pipeline that runs on orders
    /// names one.
    #[must_use]
    pub fn steered_channel(&self) -> Option<&str> {
        let pipeline = self.pipelines.iter().find(|pipeline| pipeline.due == Due::OnOrder);
        pipeline.and_then(|pipeline| pipeline.channel.as_deref())
    }
}

/// The server that viewers connect to.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StreamServer {
    /// The address and port to listen on, where port 0 takes any free one, or `unix:/PATH` for a
    /// socket that its owner alone can connect to. Anything but a loopback address is open to the
    /// network, and encrypted. Left out, it is `127.0.0.1:7070`, or where `connect` is given nothing.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<String>")]
    pub listen: Option<Listen>,
    /// The relay to connect to, through which viewers reach the run: `HOST:PORT`, or
    /// `HOST:PORT#sha256=FINGERPRINT` where its certificate is known by that, or
    /// `http://HOST:PORT` without encryption, on this machine. The relay's secret for runs is
    /// `relay` in the file that `secrets` names, or `TOMBOLO_RELAY_SECRET`. While it is not reached
    /// the run goes on, and it is tried again.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<String>")]
    pub connect: Option<RelayAddress>,
    /// The run's name at the relay: 1 to 48 letters, digits, `-`, `_` or `.`. Left out, it is that of
    /// its machine. Where another run has it, a number is put behind it.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<String>")]
    pub name: Option<RunName>,
    /// The encryption of connections. An address that is not loopback always has it; left out, its
    /// certificate is made for the run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tls: Option<Tls>,
    /// Whether an address that is not loopback goes without encryption, such as behind a proxy that
    /// encrypts: whoever is on the way reads the secrets and the fields.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub insecure: bool,
    /// The secret of those who may drive: 16 to 128 letters, digits, `-` or `_`. Left out, a new one
    /// is made for each run. A file that others can read is no place for it: see `secrets`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub token: Option<String>,
    /// A file with the secrets, `{"drive": "...", "watch": "...", "relay": "..."}` or some of them, that
    /// only its owner can read (mode 0600). The environment variables `TOMBOLO_DRIVING_SECRET` and
    /// `TOMBOLO_WATCHING_SECRET` go before it; those that nothing gives are made for each run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub secrets: Option<String>,
    /// The pages that may show the viewer inside of them, such as a notebook's: `http://HOST:PORT` or
    /// `https://HOST:PORT` of each, 16 at most. What lies over the viewer in such a page can mislead whoever
    /// clicks there. Left out, no page may.
    #[serde(skip_serializing_if = "Embedders::is_empty")]
    #[schemars(with = "Vec<String>")]
    pub embed: Embedders,
    /// How many may connect, what they may send, and how long a driver may be silent.
    pub limits: StreamLimits,
}

impl StreamServer {
    /// The place that it listens on, if it does.
    #[must_use]
    pub fn place(&self) -> Option<Listen> {
        let usual = || Listen::Address(SocketAddr::from(([127, 0, 0, 1], 7070)));
        self.listen.clone().or_else(|| self.connect.is_none().then(usual))
    }
}

/// The place that a server listens on.
///
/// ```
/// use tombolo_pipelines::language::Listen;
///
/// let listen: Listen = "unix:/run/user/1000/tombolo.sock".parse()?;
/// assert_eq!(listen, Listen::Socket("/run/user/1000/tombolo.sock".into()));
/// assert!(matches!("127.0.0.1:7070".parse()?, Listen::Address(address) if address.port() == 7070));
/// let error = "localhost".parse::<Listen>().unwrap_err();
/// assert_eq!(error, "found \"localhost\", expected ADDRESS:PORT, such as 127.0.0.1:7070, or unix:/PATH");
/// # Ok::<(), String>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Listen {
    /// An address and port of the network; port 0 takes any free one.
    Address(SocketAddr),
    /// A socket at a path of this machine, which its owner alone can connect to.
    Socket(PathBuf),
}

impl FromStr for Listen {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!("found {text:?}, expected ADDRESS:PORT, such as 127.0.0.1:7070, or unix:/PATH")
        };
        match text.strip_prefix("unix:") {
            Some(path) if path.starts_with('/') => Ok(Self::Socket(path.into())),
            Some(_) => Err(wrong()),
            None => text.parse().map(Self::Address).map_err(|_| wrong()),
        }
    }
}

impl fmt::Display for Listen {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Address(address) => address.fmt(f),
            Self::Socket(path) => write!(f, "unix:{}", path.display()),
        }
    }
}

as_text!(Listen);

/// The certificate of a server whose connections are encrypted. Without files, one is made for the run;
/// the run tells its fingerprint.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Tls {
    /// A PEM file with the certificate, and those that it was signed by.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub certificate: Option<String>,
    /// A PEM file with the certificate's key, that only its owner can read (mode 0600).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub key: Option<String>,
}

/// How many may connect, what they may send, and how long a driver may be silent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StreamLimits {
    /// Viewers at once. One more is let in with the secret for driving.
    pub viewers: NonZeroU32,
    /// Connections at once of those who have shown a secret, viewers and other requests together.
    pub connections: NonZeroU32,
    /// Seconds after which another may take the wheel from a driver who gives no command and sends
    /// no sign of being there.
    pub driver_silence: NonZeroU32,
    /// Messages a second, in the long run, of all who show the same secret or cookie, and of all who
    /// watch with cookies from one address. Each 2^20 bytes of a message count as one more. What is
    /// beyond it waits in the client's own socket.
    #[schemars(range(min = 1, max = 10_000))]
    pub messages: NonZeroU32,
    /// Messages that they may send at once, after a silence.
    #[schemars(range(min = 1, max = 10_000))]
    pub messages_at_once: NonZeroU32,
    /// Connections at once of those who have shown no secret yet. For one more the oldest makes way.
    #[schemars(range(min = 1, max = 10_000))]
    pub unknown_connections: NonZeroU32,
    /// Of these, from one address that is not this machine's: behind the loopback address there may be
    /// everybody's tunnels.
    #[schemars(range(min = 1, max = 10_000))]
    pub unknown_connections_of_address: NonZeroU32,
    /// Browsers that are known by their cookies, of those who may drive and of those who watch each. For
    /// one more, one that no connection uses is forgotten.
    #[schemars(range(min = 1, max = 10_000))]
    pub sessions: NonZeroU32,
    /// Orders and other commands of viewers that wait for their turn. One more is refused; pauses, stops
    /// and cancels have room of their own.
    #[schemars(range(min = 1, max = 10_000))]
    pub waiting: NonZeroU32,
    /// The most that these may have, in units of 2^20 bytes.
    #[schemars(range(min = 1, max = 10_000))]
    pub waiting_megabytes: NonZeroU32,
}

impl StreamLimits {
    /// The most of each that is counted by the server itself: far beyond what is meant.
    const MOST: u32 = 10_000;

    /// The most commands of viewers that wait.
    #[must_use]
    pub fn pending(&self) -> Limit {
        let most = usize::try_from(self.waiting.get()).unwrap_or(usize::MAX);
        Limit { most, ..PENDING }
    }

    /// The most bytes of the commands of viewers that wait.
    #[must_use]
    pub fn pending_bytes(&self) -> Limit {
        let megabytes = usize::try_from(self.waiting_megabytes.get()).unwrap_or(usize::MAX);
        Limit { most: megabytes.saturating_mul(1 << 20), ..PENDING_BYTES }
    }

    /// What is beyond its range.
    pub(super) fn problems(&self) -> impl Iterator<Item = Problem> {
        let found = [
            ("messages", self.messages),
            ("messages_at_once", self.messages_at_once),
            ("unknown_connections", self.unknown_connections),
            ("unknown_connections_of_address", self.unknown_connections_of_address),
            ("sessions", self.sessions),
            ("waiting", self.waiting),
            ("waiting_megabytes", self.waiting_megabytes),
        ];
        let beyond = found.into_iter().filter(|(_, number)| number.get() > Self::MOST);
        beyond.map(|(key, number)| {
            let message = format!("found {number}, expected 1 to {}", Self::MOST);
            Problem::new(message).within(key)
        })
    }
}

impl Default for StreamLimits {
    fn default() -> Self {
        const fn number(number: u32) -> NonZeroU32 {
            match NonZeroU32::new(number) {
                Some(number) => number,
                None => NonZeroU32::MIN,
            }
        }
        Self {
            viewers: number(64),
            connections: number(256),
            driver_silence: number(60),
            messages: number(20),
            messages_at_once: number(40),
            unknown_connections: number(64),
            unknown_connections_of_address: number(8),
            sessions: number(128),
            waiting: number(256),
            waiting_megabytes: number(64),
        }
    }
}

/// How orders from viewers are carried out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Steering {
    /// Whether the solver keeps stepping while a new shape is computed. The motion then starts at
    /// the first step after it is ready, so that the cycle depends on the machine's speed;
    /// otherwise the solver waits and the cycle is that of the order.
    pub background: bool,
    /// Whether the solver waits before its first step until a viewer has connected. Needs `stream`.
    pub wait_for_viewer: bool,
    /// On several ranks: at every how many calls of `execute` the ranks come together to hear what
    /// was asked for and whether one of them has an error, by one reduction of seven numbers. In
    /// between a call returns at once, and what falls due waits for the next such call. While the
    /// mesh moves they come together at every call.
    pub poll_steps: NonZeroU32,
    /// Seconds that an order of a viewer may wait for its turn, from when it came in: behind others,
    /// for the solver, or for a paused run to go on. It is rejected then, so that nothing moves the mesh that nobody thinks of
    /// any more. An order that a restarted run takes over waits without end.
    pub deadline: NonZeroU32,
    /// Seconds after which a paused run goes on by itself while nobody is connected who could resume
    /// it. Left out, it stays paused.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub resume_after: Option<NonZeroU32>,
    /// What becomes of the run while no viewer is connected, since its beginning or since the last one
    /// left. Left out, it goes on. Needs `stream`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unwatched: Option<Unwatched>,
}

/// What becomes of a run that nobody watches. A recording watches nothing, and a replay goes on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Unwatched {
    /// It is paused after so many seconds, until somebody comes and resumes it. Not beside
    /// `resume_after`, by which it would go on because nobody comes.
    PauseAfter(NonZeroU32),
    /// It is asked to stop after so many seconds, also where it is paused.
    StopAfter(NonZeroU32),
}

impl Default for Steering {
    fn default() -> Self {
        Self {
            background: true,
            wait_for_viewer: false,
            poll_steps: NonZeroU32::MIN,
            deadline: const { NonZeroU32::new(600).unwrap() },
            resume_after: None,
            unwatched: None,
        }
    }
}
