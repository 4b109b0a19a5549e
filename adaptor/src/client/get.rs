//! One request for what a run serves beside its WebSocket.

use std::{path::Path, time::Duration};

use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    time::timeout,
};

use super::{ClientError, Link};
use crate::dial::{DialError, Stream, dial};
use crate::link::Way;

/// How long it may take to hear whether something is encrypted.
const PROBE: Duration = Duration::from_secs(5);
/// How an alert of TLS begins.
const ALERT: [u8; 2] = [21, 3];
/// Bytes that the head of an answer may have, and its headers.
const HEAD: usize = 1 << 14;
const HEADERS: usize = 64;
/// Characters of a server's reason that are told.
const REASON: usize = 200;

/// A run's answer, or that of whatever else listens there.
pub(super) struct Answer {
    pub(super) status: u16,
    pub(super) body: Vec<u8>,
}

/// Connects to where a link leads.
pub(super) async fn open(link: &Link) -> Result<Box<dyn Stream>, ClientError> {
    let certificate = match link.way() {
        Way::Plain => None,
        Way::Encrypted(pinned) => Some(pinned.as_deref()),
        Way::Socket(path) => return open_path(link, path).await,
    };
    let dialled = dial(link.name(), link.port(), certificate).await;
    dialled.map_err(|error| failed(link, error))
}

#[cfg(unix)]
async fn open_path(link: &Link, path: &Path) -> Result<Box<dyn Stream>, ClientError> {
    let address = link.address();
    match tokio::net::UnixStream::connect(path).await {
        Ok(stream) => Ok(Box::new(stream)),
        Err(error) if error.kind() == std::io::ErrorKind::ConnectionRefused => {
            Err(ClientError::Refused { address })
        }
        Err(error) => Err(ClientError::Unreachable { address, reason: error.to_string() }),
    }
}

#[cfg(not(unix))]
async fn open_path(link: &Link, _: &Path) -> Result<Box<dyn Stream>, ClientError> {
    let reason = "this system has no such sockets".into();
    Err(ClientError::Unreachable { address: link.address(), reason })
}

/// A failure to connect, as the client says it.
fn failed(link: &Link, error: DialError) -> ClientError {
    let address = link.address();
    match error {
        DialError::Unknown(reason) => ClientError::Unknown { host: link.host().into(), reason },
        DialError::Refused => ClientError::Refused { address },
        DialError::Unreachable(reason) => ClientError::Unreachable { address, reason },
        DialError::Certificate(reason) => ClientError::Certificate { address, reason },
        DialError::NotEncrypted => ClientError::NotEncrypted { address },
        DialError::HungUp => ClientError::HungUp { address },
    }
}

/// Whether what answers where a plain link leads is encrypted: it refuses plain text by an alert of TLS.
pub(super) async fn is_encrypted(link: &Link) -> bool {
    if *link.way() != Way::Plain {
        return false;
    }
    let asked = async {
        let mut stream = open(link).await.ok()?;
        stream.write_all(b"GET / HTTP/1.0\r\n\r\n").await.ok()?;
        let mut begun = [0; 2];
        stream.read_exact(&mut begun).await.ok()?;
        Some(begun == ALERT)
    };
    matches!(timeout(PROBE, asked).await, Ok(Some(true)))
}

/// Asks for a path of a run, of whose answer no more than `most` bytes are read.
pub(super) async fn get(
    link: &Link,
    path: &'static str,
    query: &[(&str, &str)],
    most: usize,
) -> Result<Answer, ClientError> {
    let mut stream = open(link).await?;
    let not_tombolo = |found: String| not_tombolo(link, found);
    let asked = link.path(path, query);
    let bytes = exchange(&mut *stream, link, &asked, HEAD.saturating_add(most)).await;
    let bytes = bytes.map_err(|error| not_tombolo(format!("no answer ({error})")))?;
    let mut headers = [httparse::EMPTY_HEADER; HEADERS];
    let mut response = httparse::Response::new(&mut headers);
    let head = match response.parse(&bytes) {
        Ok(httparse::Status::Complete(head)) if head <= HEAD => head,
        _ => return Err(not_tombolo(shown(&bytes))),
    };
    let length = response
        .headers
        .iter()
        .find(|header| header.name.eq_ignore_ascii_case("content-length"))
        .and_then(|header| std::str::from_utf8(header.value).ok()?.trim().parse::<usize>().ok());
    let body = bytes.get(head..).unwrap_or_default();
    if body.len() > most || length.is_some_and(|length| length > most) {
        let found = length.unwrap_or(body.len());
        return Err(ClientError::TooMuch { what: "bytes of an answer", found, most });
    }
    if length.is_some_and(|length| length != body.len()) {
        return Err(not_tombolo(format!("{} bytes of an answer of more", body.len())));
    }
    Ok(Answer { status: response.code.unwrap_or_default(), body: body.to_vec() })
}

async fn exchange(
    stream: &mut dyn Stream,
    link: &Link,
    path: &str,
    most: usize,
) -> std::io::Result<Vec<u8>> {
    // HTTP/1.0 is answered in one piece, and the connection closed behind it.
    let request = format!(
        "GET {} HTTP/1.0\r\nHost: {}\r\nAuthorization: Bearer {}\r\nConnection: close\r\n\r\n",
        path,
        link.authority(),
        link.token()
    );
    stream.write_all(request.as_bytes()).await?;
    let mut bytes = Vec::new();
    stream.take(most as u64 + 1).read_to_end(&mut bytes).await?;
    Ok(bytes)
}

/// The error of an answer that is not what was asked for.
pub(super) fn refused(link: &Link, path: &'static str, status: u16, body: &[u8]) -> ClientError {
    let address = link.address();
    match status {
        401 => ClientError::WrongToken { address },
        403 => ClientError::HostRefused { address, reason: shown(body) },
        _ => ClientError::Answer { address, path, status, reason: shown(body) },
    }
}

pub(super) fn not_tombolo(link: &Link, found: String) -> ClientError {
    let expected = "the WebSocket of a run, version 2 of the protocol";
    ClientError::NotTombolo { address: link.address(), found, expected }
}

/// The beginning of what somebody else has said, in one line that can be printed.
pub(super) fn shown(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes.get(..4 * REASON).unwrap_or(bytes));
    let visible: String =
        text.chars().map(|c| if c.is_control() { ' ' } else { c }).take(REASON).collect();
    match visible.trim() {
        "" => "no text".into(),
        visible => visible.into(),
    }
}
