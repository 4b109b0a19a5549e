//! A configuration: the views to stream, the monitors to watch, and how orders become mesh motion.

use std::net::SocketAddr;
use std::num::NonZeroU32;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::pipeline::{Due, Pipeline};

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
    /// The pipelines, each with the steps at which it runs.
    #[serde(default)]
    pub pipelines: Vec<Pipeline>,
}

/// The size of a recording where nothing else is said.
pub fn record_megabytes() -> NonZeroU32 {
    NonZeroU32::MIN.saturating_add(4095)
}

impl Config {
    /// The name of the channel whose mesh orders change, where a pipeline that runs on orders
    /// names one.
    #[must_use]
    pub fn steered_channel(&self) -> Option<&str> {
        let pipeline = self.pipelines.iter().find(|pipeline| pipeline.due == Due::OnOrder);
        pipeline.and_then(|pipeline| pipeline.channel.as_deref())
    }
}

/// The server that viewers connect to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StreamServer {
    /// The address and port to listen on. Port 0 takes any free one. Anything but a loopback
    /// address is open to the network.
    #[schemars(with = "String")]
    pub listen: SocketAddr,
    /// The secret of those who may drive: 16 to 128 letters, digits, `-` or `_`. Left out, a new one
    /// is made for each run. A file that others can read is no place for it: see `secrets`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub token: Option<String>,
    /// A file with the secrets, `{"drive": "...", "watch": "..."}` or one of them, that only its
    /// owner can read (mode 0600). The environment variables `TOMBOLO_DRIVING_SECRET` and
    /// `TOMBOLO_WATCHING_SECRET` go before it; those that nothing gives are made for each run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub secrets: Option<String>,
    /// How many may connect, and how long a driver may be silent.
    pub limits: StreamLimits,
}

impl Default for StreamServer {
    fn default() -> Self {
        Self {
            listen: SocketAddr::from(([127, 0, 0, 1], 7070)),
            token: None,
            secrets: None,
            limits: StreamLimits::default(),
        }
    }
}

/// How many may connect, and how long a driver may be silent.
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
}

impl Default for StreamLimits {
    fn default() -> Self {
        const fn number(number: u32) -> NonZeroU32 {
            match NonZeroU32::new(number) {
                Some(number) => number,
                None => NonZeroU32::MIN,
            }
        }
        Self { viewers: number(64), connections: number(256), driver_silence: number(60) }
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
    /// was asked for and whether one of them has an error, by one reduction of six numbers. In
    /// between a call returns at once, and what falls due waits for the next such call. While the
    /// mesh moves they come together at every call.
    pub poll_steps: NonZeroU32,
}

impl Default for Steering {
    fn default() -> Self {
        Self { background: true, wait_for_viewer: false, poll_steps: NonZeroU32::MIN }
    }
}
