//! One viewer's WebSocket, from the upgrade to its end.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use axum::{
    body::Bytes,
    extract::ws::{CloseFrame, Message as Wire, WebSocket},
};
use futures_util::{
    SinkExt, StreamExt,
    stream::{SplitSink, SplitStream},
};
use serde_json::{Value, json};

use super::{
    CommandSink, PING_PERIOD,
    hub::{Client, Hub, Message},
};

/// Messages that a viewer may send at once.
const BURST: f64 = 40.0;
/// Messages a second that a viewer may send in the long run.
const RATE: f64 = 20.0;

/// Serves one viewer until either side ends it.
pub(super) async fn serve(socket: WebSocket, client: Arc<Client>, hub: Arc<Hub>, commands: Arc<dyn CommandSink>) {
    let (sink, stream) = socket.split();
    // Reading goes on while a write waits, so that a command is never stuck behind a frame.
    tokio::select! {
        () = write(sink, &client, &hub, &*commands) => {}
        () = read(stream, &client, &hub, &*commands) => {}
    }
    hub.leave(client.id);
}

async fn write(mut sink: SplitSink<WebSocket, Wire>, client: &Client, hub: &Hub, commands: &dyn CommandSink) {
    let mut topologies: Vec<Option<u64>> = Vec::new();
    let mut ping = tokio::time::interval(PING_PERIOD);
    loop {
        let written = match client.next() {
            Ok(Some(Message::Hello)) => sink.send(Wire::text(&*hub.hello(client.id, commands.orders()))).await,
            Ok(Some(Message::Text(text))) => sink.send(Wire::text(&*text)).await,
            Ok(Some(Message::Frame(view, frame))) => {
                if topologies.len() <= view {
                    topologies.resize(view + 1, None);
                }
                let mut bytes = frame.data.len();
                let mut written = Ok(());
                if topologies[view] != Some(frame.topology_id) {
                    bytes += frame.topology.len();
                    written = sink.send(Wire::Binary(frame.topology.clone())).await;
                    topologies[view] = Some(frame.topology_id);
                }
                if written.is_ok() {
                    written = sink.send(Wire::Binary(frame.data.clone())).await;
                }
                if written.is_ok() {
                    hub.sent(bytes, &frame);
                }
                written
            }
            Ok(None) => {
                tokio::select! {
                    () = client.wake.notified() => Ok(()),
                    _ = ping.tick() => sink.send(Wire::Ping(Bytes::new())).await,
                }
            }
            Err(()) => {
                let reason = "too much was left unread";
                let _ = sink.send(Wire::Close(Some(CloseFrame { code: 1008, reason: reason.into() }))).await;
                return;
            }
        };
        if written.is_err() {
            return;
        }
    }
}

async fn read(mut stream: SplitStream<WebSocket>, client: &Client, hub: &Hub, commands: &dyn CommandSink) {
    let mut allowance = Allowance { left: BURST, since: Instant::now() };
    while let Some(Ok(message)) = stream.next().await {
        let answer = match message {
            Wire::Close(_) => return,
            Wire::Ping(_) | Wire::Pong(_) => continue,
            _ if !allowance.take() => {
                // Waiting here leaves the rest in the viewer's own socket.
                tokio::time::sleep(Duration::from_secs(1)).await;
                Err((None, format!("more than {RATE} messages a second; this one was not read")))
            }
            Wire::Text(text) => receive(&text, client, hub, commands),
            Wire::Binary(_) => Err((None, "a binary message; commands are JSON text".into())),
        };
        if let Err((id, message)) = answer {
            let error = json!({"error": {"message": message, "id": id}});
            client.text(&error.to_string().into());
        }
    }
}

/// Takes one message: `{"id"?, "order" | "pause" | "resume" | "stop" | "parameter" | "drive": ...}`.
fn receive(text: &str, client: &Client, hub: &Hub, commands: &dyn CommandSink) -> Result<(), (Option<String>, String)> {
    let (id, command) = split_id(text)?;
    let failed = |message: String| (id.clone(), message);
    if is_drive(&command) {
        return hub.drive(client.id).map_err(failed);
    }
    if !hub.is_driver(client.id) {
        return Err(failed(
            "this viewer watches; only the one that drives steers. {\"drive\": {}} asks for the wheel".into(),
        ));
    }
    commands.receive(client.id, id.clone(), &command).map_err(failed)
}

/// The message's `id`, and the rest of it as it was written where there is none.
fn split_id(text: &str) -> Result<(Option<String>, String), (Option<String>, String)> {
    // What is not an object with an id goes on as it is: the language's own reader has the better error for it.
    let Ok(Value::Object(mut members)) = serde_json::from_str::<Value>(text) else {
        return Ok((None, text.into()));
    };
    match members.remove("id") {
        None => Ok((None, text.into())),
        Some(Value::String(id)) if (1..=64).contains(&id.len()) && id.chars().all(|c| !c.is_control()) => {
            Ok((Some(id), Value::Object(members).to_string()))
        }
        Some(other) => {
            let shown: String = other.to_string().chars().take(80).collect();
            Err((None, format!("id: found {shown}, expected a text of 1 to 64 characters")))
        }
    }
}

fn is_drive(command: &str) -> bool {
    matches!(serde_json::from_str::<Value>(command), Ok(Value::Object(members))
        if members.len() == 1 && members.get("drive").is_some_and(|drive| *drive == json!({})))
}

/// A bucket that fills at [`RATE`] up to [`BURST`].
struct Allowance {
    left: f64,
    since: Instant,
}

impl Allowance {
    fn take(&mut self) -> bool {
        let now = Instant::now();
        self.left = (self.left + RATE * now.duration_since(self.since).as_secs_f64()).min(BURST);
        self.since = now;
        if self.left < 1.0 {
            return false;
        }
        self.left -= 1.0;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_id_is_taken_off_and_the_rest_left() {
        assert_eq!(split_id(r#"{"pause": {}}"#), Ok((None, r#"{"pause": {}}"#.into())));
        assert_eq!(split_id(r#"{"id":"a","pause":{}}"#), Ok((Some("a".into()), r#"{"pause":{}}"#.into())));
        assert_eq!(split_id("not json"), Ok((None, "not json".into())));
        assert!(split_id(r#"{"id":7,"pause":{}}"#).is_err());
        assert!(split_id(&format!(r#"{{"id":"{}","pause":{{}}}}"#, "x".repeat(65))).is_err());
    }

    #[test]
    fn only_a_bare_drive_asks_for_the_wheel() {
        assert!(is_drive(r#"{"drive": {}}"#));
        for other in [r#"{"drive": 1}"#, r#"{"drive": {}, "stop": {}}"#, "[]", "", r#"{"order": {}}"#] {
            assert!(!is_drive(other), "{other}");
        }
    }

    #[test]
    fn a_flood_is_held_back() {
        let mut allowance = Allowance { left: BURST, since: Instant::now() };
        let taken = (0..1000).filter(|_| allowance.take()).count();
        assert!((40..60).contains(&taken), "{taken}");
    }
}
