//! Connections that are made to others: to runs by the client, to relays by runs.

mod tls;

use std::{io, sync::Arc, time::Duration};

use rustls::{CertificateError, InvalidMessage, pki_types::ServerName};
use tokio::{
    io::{AsyncRead, AsyncWrite},
    net::TcpStream,
    time::timeout,
};
use tokio_rustls::TlsConnector;

/// How long a host may take to take a connection, and to shake hands.
const CONNECT: Duration = Duration::from_secs(10);

/// A connection of any kind.
pub(crate) trait Stream: AsyncRead + AsyncWrite + Send + Unpin {}

impl<S: AsyncRead + AsyncWrite + Send + Unpin> Stream for S {}

/// Why there is no connection.
#[derive(Debug, thiserror::Error)]
pub(crate) enum DialError {
    /// The system knows no address of the host.
    #[error("its host is not known: {0}")]
    Unknown(String),
    /// Nobody listens there.
    #[error("nobody listens there")]
    Refused,
    /// It is not reached.
    #[error("{0}")]
    Unreachable(String),
    /// It does not speak TLS.
    #[error("it answers without encryption; where it has none, its address begins with http://")]
    NotEncrypted,
    /// The certificate is not the one that was expected.
    #[error("its certificate: {0}")]
    Certificate(String),
    /// The connection was closed before anything was answered.
    #[error("it closes the connection without an answer")]
    HungUp,
}

/// Whether an error says that the other side has ended a connection.
pub(crate) fn is_end(error: &io::Error) -> bool {
    use io::ErrorKind::{BrokenPipe, ConnectionAborted, ConnectionReset, UnexpectedEof};
    matches!(error.kind(), UnexpectedEof | ConnectionReset | ConnectionAborted | BrokenPipe)
}

/// Why the two sides did not agree on an encryption.
fn not_agreed(error: &io::Error) -> DialError {
    let of_tls = error.get_ref().and_then(|source| source.downcast_ref::<rustls::Error>());
    match of_tls {
        Some(rustls::Error::InvalidMessage(InvalidMessage::InvalidContentType)) => {
            DialError::NotEncrypted
        }
        // The verifier of pinned certificates refuses another fingerprint by this error alone.
        Some(rustls::Error::InvalidCertificate(
            CertificateError::ApplicationVerificationFailure,
        )) => DialError::Certificate(
            "it has another fingerprint; the link is that of another run, or somebody else answers there"
                .into(),
        ),
        None if is_end(error) => DialError::HungUp,
        _ => DialError::Certificate(error.to_string()),
    }
}

/// Connects to a host; encrypted where a `certificate` is asked for: that of this fingerprint, or without
/// one any that this machine trusts.
pub(crate) async fn dial(
    host: &str,
    port: u16,
    certificate: Option<Option<&str>>,
) -> Result<Box<dyn Stream>, DialError> {
    encrypt(connect(host, port).await?, host, certificate).await
}

/// Connects to the addresses that the system knows for a host, tried one after the other.
pub(crate) async fn connect(host: &str, port: u16) -> Result<TcpStream, DialError> {
    let addresses = tokio::net::lookup_host((host, port)).await;
    let mut failure = DialError::Unknown("the system names none".into());
    for address in addresses.map_err(|error| DialError::Unknown(error.to_string()))? {
        failure = match timeout(CONNECT, TcpStream::connect(address)).await {
            Ok(Ok(stream)) => {
                // Small messages should not wait for more bytes; without it works too.
                let _ = stream.set_nodelay(true);
                return Ok(stream);
            }
            Ok(Err(error)) if error.kind() == std::io::ErrorKind::ConnectionRefused => {
                DialError::Refused
            }
            Ok(Err(error)) => DialError::Unreachable(error.to_string()),
            Err(_) => {
                DialError::Unreachable(format!("no answer within {} seconds", CONNECT.as_secs()))
            }
        };
    }
    Err(failure)
}

/// Encrypts a connection as [`dial`] does.
pub(crate) async fn encrypt(
    stream: TcpStream,
    host: &str,
    certificate: Option<Option<&str>>,
) -> Result<Box<dyn Stream>, DialError> {
    let Some(pinned) = certificate else { return Ok(Box::new(stream)) };
    let wrong = |reason: String| DialError::Certificate(reason);
    let config = tls::config(pinned).map_err(|error| wrong(error.to_string()))?;
    let name = ServerName::try_from(host.to_owned()).map_err(|error| wrong(error.to_string()))?;
    match timeout(CONNECT, TlsConnector::from(Arc::new(config)).connect(name, stream)).await {
        Ok(Ok(stream)) => Ok(Box::new(stream)),
        Ok(Err(error)) => Err(not_agreed(&error)),
        Err(_) => Err(DialError::Unreachable("it does not shake hands".into())),
    }
}
