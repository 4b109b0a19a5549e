//! The client's thread: it connects, reads, sends, and connects again.

use std::{collections::BTreeSet, sync::Arc, time::Duration};

use axum::http::{HeaderValue, header};
use futures_util::{SinkExt, StreamExt};
use serde_json::json;
use tokio::time::{Instant, sleep, timeout};
use tokio_tungstenite::{
    WebSocketStream, client_async_with_config,
    tungstenite::{
        Error, Message,
        client::IntoClientRequest,
        error::ProtocolError,
        protocol::{WebSocketConfig, frame::CloseFrame},
    },
};
use tombolo_pipelines::{encode::Decoder, limits::DOCUMENT};

use super::{
    ClientError, Event, Link, Options,
    get::{is_encrypted, not_tombolo, open, refused, shown},
    no_answer,
    state::Shared,
};
use crate::{
    dial::{self, Stream},
    stream::relay::{NOT_CONNECTED, SILENT_RUN},
};

/// How long a server may take to answer the request for a WebSocket, and to say hello then.
const HELLO: Duration = Duration::from_secs(20);
/// How long the server may be silent, which pings every ten seconds.
const SILENT: Duration = Duration::from_secs(40);
/// Bytes of a message, which is a frame where it is so long.
const MESSAGE: usize = 1 << 28;
/// Bytes of a text: what a run may tell in one document, and what stands around it.
const TEXT: usize = 2 * DOCUMENT.most;
/// How long the server may take to take a message.
const WRITE: Duration = Duration::from_secs(10);
/// How long the last words to a server may take.
const CLOSE: Duration = Duration::from_millis(500);
/// How often the wheel is asked for again, and how often the server's silence is looked for.
const REGAIN: Duration = Duration::from_millis(200);
/// The version of the protocol.
const PROTOCOL: u32 = 2;

type Socket = WebSocketStream<Box<dyn Stream>>;

/// Why a connection is over.
enum Over {
    /// The run has ended, or the owner lets go.
    Ended,
    /// It may be made again.
    Lost(String),
}

/// Keeps the connection until the run has ended, the owner lets go, or it cannot be made again.
pub(super) async fn run(link: &Link, options: &Options, shared: &Arc<Shared>) -> ClientError {
    let mut socket = match until_closing(shared, join(link, options, shared)).await {
        Some(Ok(socket)) => socket,
        Some(Err(error)) => return error,
        None => return ClientError::Closed,
    };
    loop {
        let reason = match session(&mut socket, options, shared).await {
            Over::Ended => return ClientError::Closed,
            Over::Lost(reason) => reason,
        };
        shared.with(|state| state.put(Event::Lost { reason: reason.clone() }, ""));
        match until_closing(shared, again(link, options, shared, reason)).await {
            Some(Ok(new)) => socket = new,
            Some(Err(error)) => return error,
            None => return ClientError::Closed,
        }
    }
}

/// Does something unless the owner lets go before.
async fn until_closing<T>(shared: &Shared, done: impl Future<Output = T>) -> Option<T> {
    let closing = async {
        while !shared.with(|state| state.closing) {
            shared.wake.notified().await;
        }
    };
    tokio::select! {
        done = done => Some(done),
        () = closing => None,
    }
}

/// Connects anew, with growing pauses.
async fn again(
    link: &Link,
    options: &Options,
    shared: &Shared,
    reason: String,
) -> Result<Socket, ClientError> {
    let (mut pause, mut reason) = (options.first_pause, reason);
    for _ in 0..options.attempts {
        sleep(pause).await;
        pause = pause.saturating_mul(2).min(options.longest_pause);
        match join(link, options, shared).await {
            Ok(socket) => return Ok(socket),
            // Another run listens there now.
            Err(
                error @ (ClientError::WrongToken { .. }
                | ClientError::HostRefused { .. }
                | ClientError::Certificate { .. }),
            ) => return Err(error),
            Err(error) => reason = error.to_string(),
        }
    }
    Err(ClientError::Lost { address: link.address(), reason, tries: options.attempts })
}

/// Connects and waits for the hello.
async fn join(link: &Link, options: &Options, shared: &Shared) -> Result<Socket, ClientError> {
    let before = shared.with(|state| state.hello.clone());
    let is_plain = |text: &str| text.chars().all(|c| c.is_ascii_alphanumeric());
    let name = before.as_ref().map(|hello| hello.client.as_str()).filter(|name| is_plain(name));
    let back = before.as_ref().and_then(|hello| hello.back.as_deref()).filter(|it| is_plain(it));
    let stream = open(link).await?;
    let wrong = |found: String| not_tombolo(link, found);
    let patience = HELLO.min(options.answer);
    let late = || {
        if patience < HELLO {
            no_answer("the request for a connection", patience)
        } else {
            wrong(format!("no answer within {} seconds", HELLO.as_secs()))
        }
    };
    let looks = shared.with(|state| state.chosen.as_ref().is_none_or(|names| !names.is_empty()));
    let mut request = link
        .socket(options.drives.role(), name, back, looks)
        .into_client_request()
        .map_err(|error| wrong(error.to_string()))?;
    if let Ok(value) = HeaderValue::from_str(&format!("Bearer {}", link.token())) {
        request.headers_mut().insert(header::AUTHORIZATION, value);
    }
    let limits =
        WebSocketConfig::default().max_message_size(Some(MESSAGE)).max_frame_size(Some(MESSAGE));
    let shaken = timeout(patience, client_async_with_config(request, stream, Some(limits))).await;
    let mut socket = match shaken.map_err(|_| late())? {
        Ok((socket, _)) => socket,
        Err(Error::Http(response)) => {
            let body = response.body().as_deref().unwrap_or_default();
            let status = response.status().as_u16();
            return Err(match status {
                401 | 403 => refused(link, "ws", status, body),
                _ if [NOT_CONNECTED, SILENT_RUN].iter().any(|said| said.as_bytes() == body) => {
                    ClientError::NotAtRelay { address: link.address(), reason: shown(body) }
                }
                _ => wrong(format!("the status {status} ({})", shown(body))),
            });
        }
        Err(error) if is_end(&error) => {
            return Err(ClientError::HungUp { address: link.address() });
        }
        Err(_) if is_encrypted(link).await => {
            return Err(ClientError::Encrypted { address: link.address() });
        }
        Err(error) => return Err(wrong(shown(error.to_string().as_bytes()))),
    };
    let first = timeout(patience, first_text(&mut socket)).await.map_err(|_| late())?;
    let text = match first {
        Ok(text) => text,
        Err(Some(close)) if u16::from(close.code) == 1013 => {
            let reason = shown(close.reason.as_bytes());
            return Err(ClientError::TooManyViewers { address: link.address(), reason });
        }
        Err(_) => return Err(wrong("a connection that closes at once".into())),
    };
    let hello = match Event::read(&text) {
        Ok(Event::Hello(hello)) if hello.protocol == PROTOCOL => hello,
        Ok(Event::Hello(hello)) => {
            return Err(wrong(format!("version {} of the protocol", hello.protocol)));
        }
        _ => return Err(wrong(shown(text.as_bytes()))),
    };
    shared.with(|state| {
        state.begin(&hello);
        state.put(Event::Hello(hello), &text);
    });
    Ok(socket)
}

/// Whether a connection has ended where an answer was expected.
fn is_end(error: &Error) -> bool {
    match error {
        Error::ConnectionClosed | Error::Protocol(ProtocolError::HandshakeIncomplete) => true,
        Error::Io(error) => dial::is_end(error),
        _ => false,
    }
}

/// The message that chooses views.
pub(super) fn choice(names: Option<&BTreeSet<String>>) -> String {
    json!({"views": {"names": names}}).to_string()
}

/// The first text; the close frame where there is none.
async fn first_text(socket: &mut Socket) -> Result<String, Option<CloseFrame>> {
    loop {
        match socket.next().await {
            Some(Ok(Message::Text(text))) => return Ok(text.to_string()),
            Some(Ok(Message::Close(close))) => return Err(close),
            Some(Ok(_)) => {}
            Some(Err(_)) | None => return Err(None),
        }
    }
}

/// Reads and sends until the connection is over.
async fn session(socket: &mut Socket, options: &Options, shared: &Shared) -> Over {
    let mut decoder = Decoder::new();
    let (mut frames, mut acknowledged) = (0_u64, 0_u64);
    let mut regain = tokio::time::interval(REGAIN);
    let mut heard = Instant::now();
    loop {
        // A recording sends frames also to one that asks for no views. It acknowledges the first alone, so
        // that few are on their way.
        let (unsent, taken, closing, choices) = shared.with(|state| {
            (state.unsent(), state.taken, state.closing, std::mem::take(&mut state.choices))
        });
        let count = if options.views { taken.clamp(1, frames.max(1)) } else { 1 };
        let mut messages: Vec<Message> = unsent.into_iter().map(Message::text).collect();
        if frames > 0 && count > acknowledged {
            acknowledged = count;
            messages.push(Message::binary(count.to_le_bytes().to_vec()));
        }
        messages.extend(choices.iter().map(|names| Message::text(choice(names.as_ref()))));
        for message in messages {
            match timeout(WRITE, socket.send(message)).await {
                Ok(Ok(())) => {}
                Ok(Err(error)) => return Over::Lost(error.to_string()),
                Err(_) => return Over::Lost("the server does not read".into()),
            }
        }
        if closing {
            let _ = timeout(CLOSE, socket.close(None)).await;
            return Over::Ended;
        }
        let message = tokio::select! {
            message = socket.next() => message,
            () = shared.wake.notified() => continue,
            _ = regain.tick() => {
                shared.with(super::state::State::regain);
                if heard.elapsed() > SILENT {
                    return Over::Lost(format!("silence of {} seconds", SILENT.as_secs()));
                }
                continue;
            }
        };
        heard = Instant::now();
        let ended = || shared.with(|state| state.end.is_some());
        match message {
            Some(Ok(Message::Text(text))) if text.len() > TEXT => {
                return Over::Lost(format!("a text of {} bytes, expected {TEXT}", text.len()));
            }
            Some(Ok(Message::Text(text))) => match Event::read(&text) {
                Ok(event) => shared.with(|state| state.put(event, &text)),
                Err(reason) => return Over::Lost(format!("a text that is no message: {reason}")),
            },
            Some(Ok(Message::Binary(bytes))) => {
                frames += 1;
                if options.views {
                    match decoder.decode(&bytes) {
                        Ok(frame) => shared.with(|state| state.put_frame(frame)),
                        Err(error) => {
                            let reason = shown(error.to_string().as_bytes());
                            return Over::Lost(format!("a broken frame: {reason}"));
                        }
                    }
                }
            }
            Some(Ok(Message::Close(_))) | None if ended() => return Over::Ended,
            Some(Ok(Message::Close(close))) => {
                let reason = close.map_or_else(String::new, |close| {
                    format!(" with {}: {}", u16::from(close.code), shown(close.reason.as_bytes()))
                });
                return Over::Lost(format!("closed by the server{reason}"));
            }
            Some(Ok(_)) => {}
            Some(Err(_)) if ended() => return Over::Ended,
            Some(Err(error)) => return Over::Lost(error.to_string()),
            None => return Over::Lost("the connection has ended".into()),
        }
    }
}
