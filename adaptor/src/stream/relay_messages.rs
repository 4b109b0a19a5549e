//! The messages between a relay and the runs that have connected to it.
//!
//! A run opens a WebSocket at [`ATTACH`] with the relay's secret for runs, says who it is ([`Attach`]), and
//! is told its name and its address ([`Attached`]). For each request of a viewer the relay sends
//! [`Open`]; the run then makes another connection, a request for [`CARRY`] and the ticket, which both
//! sides go on with as one from that viewer to the run.

use std::net::IpAddr;

use serde::{Deserialize, Serialize};
use tombolo_pipelines::language::RunName;

/// Where a run's own connection is made.
pub(super) const ATTACH: &str = "/-/attach";
/// Where connections for viewers are made; the ticket follows.
pub(super) const CARRY: &str = "/-/carry/";
/// The protocol that these connections go over to.
pub(super) const PROTOCOL: &str = "tombolo";
/// Says to the relay alone that a viewer has shown a secret of the run, and which.
pub(super) const ACCESS: &str = "tombolo-access";
/// The version of these messages.
pub(super) const VERSION: u32 = 1;
/// Bytes of a message.
pub(super) const MESSAGE: usize = 4096;

/// The first message of a run.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Attach {
    pub(super) version: u32,
    pub(super) name: RunName,
    /// Known to this run and the relay alone, so that the run has its name again after a connection
    /// that was lost.
    pub(super) instance: String,
}

/// The answer to it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Attached {
    pub(super) name: RunName,
    /// The address at which viewers reach the run, with a slash at its end.
    pub(super) address: String,
    /// SHA-256 of the certificate that they see there, where the relay knows it.
    pub(super) sha256: Option<String>,
}

/// A viewer has come.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Open {
    pub(super) ticket: String,
    /// The address that the viewer comes from.
    pub(super) viewer: IpAddr,
}
