//! The connections that runs make to a relay: one of each run itself, and one for each request of a
//! viewer.

use std::{sync::Arc, time::Duration};

use axum::{
    Extension,
    extract::{
        ConnectInfo, Path, Request, State, WebSocketUpgrade,
        ws::{CloseFrame, Message, WebSocket, rejection::WebSocketUpgradeRejection},
    },
    http::{HeaderMap, HeaderValue, StatusCode, header},
    response::{IntoResponse, Response},
};
use tokio::time::timeout;

use super::{
    RelayState,
    runs::{Carried, RUNS},
};
use crate::stream::{
    PING_PERIOD,
    connection::Connection,
    credentials::{Access, Holder},
    relay_messages::{Attach, Attached, MESSAGE, PROTOCOL, VERSION},
    secret::Secret,
};

/// How long a run may take to say who it is.
const INTRODUCTION: Duration = Duration::from_secs(5);
/// The code of a connection that ends because the run cannot be taken in.
const REFUSED: u16 = 1008;
/// Bytes that the reason in a close frame may have.
const REASON: usize = 123;

/// Takes a run in that has shown the secret for runs.
pub(super) async fn attach(
    State(relay): State<Arc<RelayState>>,
    ConnectInfo(connection): ConnectInfo<Connection>,
    Extension(holder): Extension<Holder>,
    headers: HeaderMap,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> Response {
    if holder.access != Access::Drive {
        return for_runs_only();
    }
    let upgrade = match upgrade {
        Ok(upgrade) => upgrade.max_message_size(MESSAGE).max_frame_size(MESSAGE),
        Err(rejection) => return rejection.into_response(),
    };
    let host = headers.get(header::HOST).and_then(|host| host.to_str().ok());
    let host = host.unwrap_or_default().to_owned();
    upgrade.on_upgrade(move |mut socket| async move {
        connection.upgraded();
        if let Err(reason) = keep(&mut socket, &relay, &connection, &host).await {
            let address = connection.address();
            tracing::warn!(%address, reason, "a run from {address} was not taken in: {reason}");
            let close = CloseFrame { code: REFUSED, reason: truncated(&reason).into() };
            let _ = socket.send(Message::Close(Some(close))).await;
        }
    })
}

/// The beginning of a reason that a close frame has room for. A longer one would be no frame, and the
/// run would never read why.
fn truncated(reason: &str) -> &str {
    let ends = reason.char_indices().map(|(at, c)| at + c.len_utf8());
    let end = ends.take_while(|&end| end <= REASON).last().unwrap_or_default();
    reason.get(..end).unwrap_or_default()
}

fn for_runs_only() -> Response {
    (StatusCode::FORBIDDEN, "this needs the relay's secret for runs\n").into_response()
}

/// Serves a run until its connection ends; the error says why it is not taken in.
async fn keep(
    socket: &mut WebSocket,
    relay: &RelayState,
    connection: &Connection,
    host: &str,
) -> Result<(), String> {
    let first = match timeout(INTRODUCTION, socket.recv()).await {
        Ok(Some(Ok(Message::Text(text)))) => text,
        _ => return Err("it did not say who it is".into()),
    };
    let Attach { version, name, instance } =
        serde_json::from_str(&first).map_err(|error| format!("its first message: {error}"))?;
    if version != VERSION {
        return Err(format!("found version {version} of a run's messages, expected {VERSION}"));
    }
    let instance = Secret::given(&instance).ok_or("what it comes back by is no secret")?;
    let (run, mut asked) = relay
        .runs
        .attach(&name, instance, connection.address())
        .ok_or_else(|| format!("{RUNS} runs are connected already"))?;
    let run = Seat { relay, run };
    let (name, address) = (&run.run.name, connection.address());
    tracing::info!(%name, %address, "the run {name} has connected from {address}");
    let attached = Attached {
        address: format!("{}/{}/", relay.base(host), run.run.name),
        name: run.run.name.clone(),
        sha256: relay.fingerprint_in_links().map(str::to_owned),
    };
    let mut ping = tokio::time::interval(PING_PERIOD);
    let mut message = text(&attached);
    let kept = async {
        loop {
            if let Some(message) = message.take()
                && socket.send(message).await.is_err()
            {
                return;
            }
            message = tokio::select! {
                Some(open) = asked.recv() => text(&open),
                _ = ping.tick() => Some(Message::Ping(Default::default())),
                said = socket.recv() => match said {
                    Some(Ok(Message::Ping(_) | Message::Pong(_))) => None,
                    // It has nothing more to say.
                    _ => return,
                },
            };
        }
    };
    tokio::select! {
        () = kept => {}
        // Also where what it was sent is not read.
        () = run.run.replaced() => {}
    }
    Ok(())
}

fn text(message: &impl serde::Serialize) -> Option<Message> {
    serde_json::to_string(message).ok().map(Message::text)
}

/// A run's place among the others, which it leaves however its connection ends.
struct Seat<'a> {
    relay: &'a RelayState,
    run: Arc<super::runs::Run>,
}

impl Drop for Seat<'_> {
    fn drop(&mut self) {
        self.relay.runs.leave(&self.run);
        let name = &self.run.name;
        tracing::info!(%name, "the run {name} has left");
    }
}

/// Takes a connection that a run has made for a viewer.
pub(super) async fn carry(
    State(relay): State<Arc<RelayState>>,
    ConnectInfo(connection): ConnectInfo<Connection>,
    Extension(holder): Extension<Holder>,
    Path(ticket): Path<String>,
    mut request: Request,
) -> Response {
    if holder.access != Access::Drive {
        return for_runs_only();
    }
    let asks = request.headers().get(header::UPGRADE).map(HeaderValue::as_bytes);
    if asks != Some(PROTOCOL.as_bytes()) {
        return (StatusCode::UPGRADE_REQUIRED, "expected `Upgrade: tombolo`\n").into_response();
    }
    let Some(waiting) = relay.runs.redeem(&ticket) else {
        return (StatusCode::GONE, "nobody waits for this connection any more\n").into_response();
    };
    let upgrade = hyper::upgrade::on(&mut request);
    tokio::spawn(async move {
        if let Ok(stream) = upgrade.await {
            connection.upgraded();
            let _ = waiting.send(Carried { stream, asked: connection.asked() });
        }
    });
    let mut response = StatusCode::SWITCHING_PROTOCOLS.into_response();
    let headers = response.headers_mut();
    headers.insert(header::CONNECTION, HeaderValue::from_static("upgrade"));
    headers.insert(header::UPGRADE, HeaderValue::from_static(PROTOCOL));
    response
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reason_fits_into_a_close_frame() {
        assert_eq!(truncated("short"), "short");
        assert_eq!(truncated(&"x".repeat(500)).len(), REASON);
        assert_eq!(truncated(&"é".repeat(500)), "é".repeat(61));
    }
}
