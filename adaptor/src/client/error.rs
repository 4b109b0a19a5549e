//! Why a run is not reached, or does not do what it was asked.

use crate::link::LinkError;

/// Why a run is not reached, or does not do what it was asked.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ClientError {
    /// A text that is no link.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The host has no address.
    #[error("the host {host} has no address: {reason}")]
    Unknown {
        /// The host.
        host: String,
        /// The system's reason.
        reason: String,
    },
    /// Nothing listens there.
    #[error("nothing listens on {address}: the connection was refused")]
    Refused {
        /// The host and port.
        address: String,
    },
    /// The machine does not answer.
    #[error("{address} is not reached: {reason}")]
    Unreachable {
        /// The host and port.
        address: String,
        /// The system's reason.
        reason: String,
    },
    /// Who answers there cannot be known for sure.
    #[error("the certificate of {address} is not that of the link, or not trusted: {reason}")]
    Certificate {
        /// The host and port.
        address: String,
        /// The reason why it is not trusted.
        reason: String,
    },
    /// The server at the link speaks TLS, and the link begins with `http://`.
    #[error("what answers on {address} is encrypted, and the link begins with http://")]
    Encrypted {
        /// The host and port.
        address: String,
    },
    /// The server at the link speaks no TLS, and the link begins with `https://`.
    #[error("what answers on {address} is not encrypted, and the link begins with https://")]
    NotEncrypted {
        /// The host and port.
        address: String,
    },
    /// A connection is taken there, and closed before anything was answered.
    #[error("{address} takes the connection, and closes it without an answer")]
    HungUp {
        /// The host and port.
        address: String,
    },
    /// A relay answers there, which does not reach the run.
    #[error("a relay answers on {address}, and does not reach the run: {reason}")]
    NotAtRelay {
        /// The host and port.
        address: String,
        /// The relay's reason.
        reason: String,
    },
    /// A run answers there, and the token is not its own (401).
    #[error("{address} answers, but the token of this link is not that of the run there (401)")]
    WrongToken {
        /// The host and port.
        address: String,
    },
    /// A run answers there, but not under this host's name (403).
    #[error("{address} refuses this host's name (403): {reason}")]
    HostRefused {
        /// The host and port.
        address: String,
        /// The server's reason.
        reason: String,
    },
    /// Something answers there that is no run.
    #[error("what answers on {address} is no run of Tombolo: found {found}, expected {expected}")]
    NotTombolo {
        /// The host and port.
        address: String,
        /// The answer that came.
        found: String,
        /// The answer that a run would have given.
        expected: &'static str,
    },
    /// As many viewers watch as may (1013).
    #[error("{address} takes no more viewers (1013): {reason}")]
    TooManyViewers {
        /// The host and port.
        address: String,
        /// The server's reason.
        reason: String,
    },
    /// A request was answered with an error.
    #[error("{address} answers to {path} with {status}: {reason}")]
    Answer {
        /// The host and port.
        address: String,
        /// The path asked for, without the token.
        path: &'static str,
        /// The status of HTTP.
        status: u16,
        /// The server's reason.
        reason: String,
    },
    /// The connection was lost, and could not be made again.
    #[error(
        "the connection to {address} was lost ({reason}), and {tries} attempts to make it again have failed"
    )]
    Lost {
        /// The host and port.
        address: String,
        /// Why the last attempt failed, or why the connection was lost.
        reason: String,
        /// How many attempts were made.
        tries: u32,
    },
    /// The run has ended, and all that it told was read.
    #[error("the run has ended")]
    Closed,
    /// Somebody else drives.
    #[error("this client only watches: {reason}")]
    NotDriver {
        /// The server's reason.
        reason: String,
    },
    /// The run refuses what it was asked.
    #[error("refused: {reason}")]
    Rejected {
        /// The run's reason.
        reason: String,
    },
    /// The run did not answer in time.
    #[error("no answer within {seconds} seconds to {what}")]
    NoAnswer {
        /// The request.
        what: String,
        /// How long was waited.
        seconds: f64,
    },
    /// More is waiting for an answer, or is to be sent, than the client keeps.
    #[error("found {found} {what}, expected at most {most}")]
    TooMuch {
        /// The things counted.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// How many there may be.
        most: usize,
    },
    /// The system gives no thread, socket or random numbers.
    #[error("the client could not be started: {reason}")]
    System {
        /// The system's reason.
        reason: String,
    },
}
