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
pub(in crate::stream) const ATTACH: &str = "/-/attach";
/// Where connections for viewers are made; the ticket follows.
pub(in crate::stream) const CARRY: &str = "/-/carry/";
/// The protocol that these connections go over to.
pub(in crate::stream) const PROTOCOL: &str = "tombolo";
/// Says to the relay alone that a viewer has shown a secret of the run, and which.
pub(in crate::stream) const ACCESS: &str = "tombolo-access";
/// The version of these messages.
pub(in crate::stream) const VERSION: u32 = 1;
/// Bytes of a message.
pub(in crate::stream) const MESSAGE: usize = 4096;

/// The first message of a run.
#[derive(Debug, Serialize, Deserialize)]
pub(in crate::stream) struct Attach {
    pub(in crate::stream) version: u32,
    pub(in crate::stream) name: RunName,
    /// Known to this run and the relay alone, so that the run has its name again after a connection
    /// that was lost.
    pub(in crate::stream) instance: String,
}

/// The answer to it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(in crate::stream) struct Attached {
    pub(in crate::stream) name: RunName,
    /// The address at which viewers reach the run, with a slash at its end.
    pub(in crate::stream) address: String,
    /// SHA-256 of the certificate that they see there, where the relay knows it.
    pub(in crate::stream) sha256: Option<String>,
}

/// A viewer has come.
#[derive(Debug, Serialize, Deserialize)]
pub(in crate::stream) struct Open {
    pub(in crate::stream) ticket: String,
    /// The address that the viewer comes from.
    pub(in crate::stream) viewer: IpAddr,
}
