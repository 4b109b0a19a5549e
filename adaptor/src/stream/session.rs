//! One viewer's WebSocket, from the upgrade to its end.

use std::{collections::HashMap, net::IpAddr, sync::Arc, time::Duration};

use axum::{
    body::Bytes,
    extract::ws::{CloseFrame, Message as Wire, WebSocket},
};
use futures_util::{
    SinkExt, StreamExt,
    stream::{SplitSink, SplitStream},
};
use serde_json::json;
use tokio_tungstenite::tungstenite;
use tombolo_pipelines::language::{
    JournalNote, LinkFor, Message as Said, Question, Together, ViewerMove, ViewerNote, Wheel,
    parse_message,
};
use tracing::info;

use super::{
    CommandSink, PING_PERIOD, Shared,
    credentials::{Access, Credentials, Holder},
    gate::Gate,
    hub::Hub,
    outbox::{Client, Message},
    refusals::{Refusals, Refused},
    text::Text,
    viewer_lines::ViewerLines,
};
use crate::lock::lock;

/// Bytes of a message that are read of a viewer that does not drive: it may choose many views.
pub(crate) const UNDRIVEN: usize = 1 << 14;
/// Bytes of short texts that may wait to be written together with what comes next: for many viewers a
/// write of its own for each text costs the machine more than its bytes.
const GATHERED: usize = 1 << 12;
/// How long a message beyond the allowance is held back before it is looked at again.
const HELD_BACK: Duration = Duration::from_millis(100);

/// Serves one viewer until either side ends it.
pub(super) async fn serve(
    socket: WebSocket,
    client: Arc<Client>,
    holder: Holder,
    address: IpAddr,
    shared: Shared,
) {
    let Shared { hub, commands, gate, lines, .. } = shared;
    let (hub, lines, refusals) = (&*hub, &*lines, &*gate.refusals);
    let seat = Seat { client: &client, hub, commands: &*commands, lines, refusals, address };
    seat.note(ViewerMove::Came);
    if hub.is_driver(client.id) {
        commands.driven();
    }
    let (sink, stream) = socket.split();
    // Reading goes on while a write waits, so that a command is never stuck behind a frame.
    tokio::select! {
        () = write(sink, &client, hub, &*commands) => {}
        () = read(stream, &seat, &holder, &gate) => {}
    }
}

/// A viewer's place among the others, which it leaves however its session ends.
struct Seat<'a> {
    client: &'a Arc<Client>,
    hub: &'a Hub,
    commands: &'a dyn CommandSink,
    lines: &'a ViewerLines,
    refusals: &'a Refusals,
    address: IpAddr,
}

impl Seat<'_> {
    /// Tells that something of this viewer was refused, unless that was told of late; `what` says what, of
    /// whom it is told.
    fn refuse(&self, refused: Refused, what: impl FnOnce(&str) -> String) {
        let (viewer, address) = (Hub::name(self.client.id), self.address);
        let what = || what(&format!("the viewer {viewer} from {address}"));
        self.refusals.tell(address, refused, Some(&viewer), what);
    }

    /// Notes in the journal who came and went, and who was given a link for others, unless there has
    /// been too much of it of late.
    fn note(&self, did: ViewerMove) {
        let Ok(left_out) = self.lines.take(self.client.access) else { return };
        let (viewer, address) = (Hub::name(self.client.id), self.address);
        let (run, cycle) = (self.hub.run(), self.hub.clock.get().cycle);
        let what = match did {
            ViewerMove::Came => "has come",
            ViewerMove::Left => "has left",
            ViewerMove::TookDrivingLink => "took a link for driving",
            ViewerMove::TookWatchingLink => "took a link for watching",
        };
        info!(run, cycle, viewer, %address, "the viewer {viewer} from {address} {what}");
        self.commands.note(JournalNote::Viewer(ViewerNote {
            name: viewer,
            address: address.to_string(),
            called: self.hub.called(self.client.id),
            may_drive: self.client.access == Access::Drive,
            did,
            left_out,
        }));
    }
}

impl Drop for Seat<'_> {
    fn drop(&mut self) {
        self.note(ViewerMove::Left);
        if self.hub.leave(self.client) {
            self.commands.left(self.client.id);
        }
    }
}

async fn write(
    mut sink: SplitSink<WebSocket, Wire>,
    client: &Client,
    hub: &Hub,
    commands: &dyn CommandSink,
) {
    // By view, the topology that was sent last.
    let mut topologies: HashMap<usize, u64> = HashMap::new();
    let mut ping = tokio::time::interval(PING_PERIOD);
    // Bytes of texts since the last message that was sent at once.
    let mut gathered = 0;
    loop {
        let written = match client.next() {
            Ok(Some(Message::Hello { is_first })) => {
                gathered = 0;
                topologies.retain(|&view, _| hub.has_view(view));
                // Of later ones the viewer hears one by one.
                let orders = is_first.then(|| commands.orders());
                sink.send(Wire::text(hub.hello(client.id, orders))).await
            }
            Ok(Some(Message::Text(text))) => {
                let text = text.written();
                gathered += text.len();
                if gathered <= GATHERED {
                    sink.feed(Wire::Text(text)).await
                } else {
                    gathered = 0;
                    sink.send(Wire::Text(text)).await
                }
            }
            Ok(Some(Message::Stack(change))) => {
                gathered = 0;
                sink.send(Wire::Text(change.text().written())).await
            }
            Ok(Some(Message::Frame(view, frame))) => {
                gathered = 0;
                // One that goes on from another follows a frame of the same topology.
                let topology = frame.topology_id();
                let is_known = topologies.insert(view, topology) == Some(topology);
                let message = if is_known { frame.message.clone() } else { frame.with_topology() };
                let bytes = message.len();
                let written = sink.send(Wire::Binary(message)).await;
                if written.is_ok() {
                    hub.sent(bytes, &frame);
                }
                written
            }
            Ok(Some(Message::End)) => {
                let reason = "the run has ended";
                let _ = sink
                    .send(Wire::Close(Some(CloseFrame { code: 1000, reason: reason.into() })))
                    .await;
                return;
            }
            Ok(Some(Message::Behind(view, level))) => {
                hub.want_key(view, level);
                Ok(())
            }
            Ok(None) if gathered > 0 => {
                gathered = 0;
                sink.flush().await
            }
            Ok(None) => {
                tokio::select! {
                    () = client.wake.notified() => Ok(()),
                    _ = ping.tick() => sink.send(Wire::Ping(Bytes::new())).await,
                }
            }
            Err((code, reason)) => {
                let _ =
                    sink.send(Wire::Close(Some(CloseFrame { code, reason: reason.into() }))).await;
                return;
            }
        };
        if written.is_err() {
            return;
        }
    }
}

async fn read(mut stream: SplitStream<WebSocket>, seat: &Seat<'_>, holder: &Holder, gate: &Gate) {
    let client = seat.client;
    while let Some(message) = stream.next().await {
        let message = match message {
            Err(error) => {
                if is_too_long(error) {
                    seat.refuse(Refused::Long, |who| {
                        format!("a message of {who} ended its connection")
                    });
                }
                return;
            }
            Ok(message) => message,
        };
        let message = match message {
            Wire::Close(close) => {
                // A program that is done says nothing or 1000. A page that is left or loaded again
                // says 1001, and may come back.
                if close.is_none_or(|close| close.code == 1000) {
                    seat.hub.let_go(client);
                }
                return;
            }
            Wire::Ping(_) | Wire::Pong(_) => continue,
            // Not counted: there is no more of it than there are frames.
            Wire::Binary(bytes) if acknowledged(&bytes, client) => continue,
            message => message,
        };
        // Waiting here leaves the rest in the viewer's own socket.
        while !lock(&holder.allowance).take(bytes(&message)) {
            seat.refuse(Refused::Flood, |who| format!("messages of {who} are held back"));
            tokio::time::sleep(HELD_BACK).await;
        }
        let answer = match message {
            Wire::Text(text) => receive(&text, seat, &gate.credentials),
            _ => Err((
                None,
                "a binary message that is not the number of frames decoded, 8 bytes, more than \
                 before and no more than were sent; commands are JSON text"
                    .into(),
            )),
        };
        if let Err((id, message)) = answer {
            client.text(&Text::of(move || json!({"error": {"message": message, "id": id}})));
        }
    }
}

/// Whether a connection ends for a message that is longer than any that is read.
fn is_too_long(error: axum::Error) -> bool {
    let error = error.into_inner().downcast::<tungstenite::Error>();
    error.is_ok_and(|error| matches!(*error, tungstenite::Error::Capacity(_)))
}

/// Takes one message: `{"id"?, "order" | "pause" | "resume" | "stop" | "parameter" | "pipelines" |
/// "forecast" | "withdraw_forecast" | "drive" | "hand_over" | "keep" | "kick" | "here" | "link" |
/// "name" | "follow" | "camera" | "note" | "remove_note" | "views": ...}`.
fn receive(
    text: &str,
    seat: &Seat<'_>,
    credentials: &Credentials,
) -> Result<(), (Option<String>, String)> {
    let Seat { client, hub, commands, .. } = *seat;
    let drives = hub.is_driver(client.id);
    let watches = match client.access {
        Access::Drive => {
            "this viewer watches; only the one that drives steers. {\"drive\": {}} asks for the wheel"
        }
        Access::Watch => "the secret or link that this viewer came with is for watching",
    };
    // A viewer that watches sends nothing as long as that: a longer message is not worth reading.
    if !drives && text.len() > UNDRIVEN {
        let bytes = text.len();
        seat.refuse(Refused::Long, |who| {
            format!("a message of {who} of {bytes} bytes was not read")
        });
        return Err((None, watches.into()));
    }
    let (id, message) = parse_message(text);
    // A page says these by itself, also where nobody is there.
    let is_by_itself =
        |it: &_| matches!(it, Together::Camera(_) | Together::Name { .. } | Together::Views { .. });
    if !matches!(&message, Ok(Said::Together(together)) if is_by_itself(together)) {
        hub.heard(client.id);
    }
    let answered = match message {
        Ok(Said::Wheel(Wheel::Here {})) => Ok(()),
        Ok(Said::Wheel(Wheel::Drive {})) if client.access == Access::Drive => hub.drive(client.id),
        Ok(Said::Together(together)) => take(together, id.clone(), seat, credentials),
        // Also of one that has lost the wheel since it asked.
        Ok(message @ Said::Question(Question::WithdrawForecast {})) => {
            commands.receive(client.id, id.clone(), message, text)
        }
        message if !drives => {
            let asked = message.as_ref().map_or("what nobody understands", asked_for);
            seat.refuse(Refused::Command, |who| format!("{who} asked for {asked} in vain"));
            Err(watches.into())
        }
        Ok(Said::Wheel(Wheel::HandOver { to })) => hub.hand_over(client.id, &to),
        Ok(Said::Wheel(Wheel::Keep {})) => hub.keep(client.id),
        Ok(Said::Wheel(Wheel::Kick { client: other })) => hub.kick(client.id, &other),
        Ok(message) => commands.receive(client.id, id.clone(), message, text),
        Err(error) => Err(error.to_string()),
    };
    answered.map_err(|reason| (id, reason))
}

/// The key by which JSON knows a message that none but the driver may send.
fn asked_for(message: &Said) -> &'static str {
    match message {
        Said::Command(command) => command.name(),
        Said::Question(_) => "forecast",
        Said::Wheel(Wheel::HandOver { .. }) => "hand_over",
        Said::Wheel(Wheel::Keep {}) => "keep",
        Said::Wheel(Wheel::Kick { .. }) => "kick",
        Said::Wheel(Wheel::Drive {} | Wheel::Here {}) => "drive",
        Said::Together(_) => "what is free to all",
    }
}

/// Takes a message about the viewers themselves; the error says why it comes to nothing.
fn take(
    message: Together,
    id: Option<String>,
    seat: &Seat<'_>,
    credentials: &Credentials,
) -> Result<(), String> {
    let Seat { client, hub, commands, .. } = *seat;
    let may_drive = || match client.access {
        Access::Drive => Ok(()),
        Access::Watch => Err("the secret or link that this viewer came with is for watching"),
    };
    match message {
        Together::Link { r#for } => {
            let (access, did) = match r#for {
                LinkFor::Watch => (Access::Watch, ViewerMove::TookWatchingLink),
                LinkFor::Drive => (Access::Drive, ViewerMove::TookDrivingLink),
            };
            if access == Access::Drive {
                may_drive()?;
            }
            let key = credentials.sessions.key(access, Some(client.id));
            let key = key.map_err(|error| format!("no link could be made: {error}"))?;
            seat.note(did);
            client.text(&Text::of(move || {
                json!({"link": {"for": r#for, "path": format!("?key={}", key.as_str()), "id": id}})
            }));
        }
        Together::Name { name } => hub.call(client.id, name.trim()),
        Together::Follow { on } => hub.follow(client.id, on),
        Together::Camera(camera) => hub.show_camera(client.id, camera)?,
        Together::Views { names } => hub.choose_views(client.id, names),
        Together::Note(note) => {
            may_drive()?;
            commands.note(JournalNote::Note(hub.pin(client.id, note)?));
        }
        Together::RemoveNote { number } => {
            may_drive()?;
            commands.note(JournalNote::NoteRemoved(hub.unpin(number)?));
        }
    }
    Ok(())
}

/// Whether this is the number of frames that the viewer has decoded.
fn acknowledged(bytes: &[u8], client: &Client) -> bool {
    let count = bytes.try_into().map(u64::from_le_bytes);
    count.is_ok_and(|count| client.acknowledge(count))
}

fn bytes(message: &Wire) -> usize {
    match message {
        Wire::Text(text) => text.len(),
        Wire::Binary(bytes) | Wire::Ping(bytes) | Wire::Pong(bytes) => bytes.len(),
        Wire::Close(_) => 0,
    }
}
