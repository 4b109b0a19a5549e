//! Somebody inside the program who is told what viewers are told.

use std::{io, sync::Arc, time::Duration};

use axum::body::Bytes;
use serde_json::{Value, json};

use super::{
    credentials::Access,
    hub::Hub,
    outbox::{Client, Message},
    pace::Pace,
    secret::Secret,
    stack::StackChange,
    text::Text,
};
use crate::lock::lock;

/// A message for somebody inside the program.
pub(crate) enum Observed {
    /// The run is described anew.
    Hello,
    /// A text message.
    Text(Text),
    /// The stack of edits has changed.
    Stack(StackChange),
    /// A frame; a key frame with its topology.
    Frame { view: usize, is_key: bool, bytes: Bytes },
    /// Frames of a view were missed: a key frame of it is needed.
    Behind(usize),
    /// So much was left unread that the rest is not told.
    TooMuch,
    /// Nothing comes any more.
    End,
}

/// Is told what viewers are told, with exact frames only, as long as it is the one that the hub has.
pub(crate) struct Observer {
    client: Arc<Client>,
    runtime: tokio::runtime::Runtime,
}

impl Observer {
    /// The observer of a hub, of which it has one.
    pub(crate) fn of(hub: &Hub) -> io::Result<Self> {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build()?;
        let secret = Secret::random().map_err(|error| io::Error::other(error.to_string()))?;
        let mut state = lock(&hub.state);
        let (views, is_known) = (state.view_numbers(), state.is_described());
        let client =
            Arc::new(Client::new(0, Access::Watch, secret, views, Pace::exact(), is_known));
        state.observer = Some(Arc::clone(&client));
        hub.note_audience(&state);
        drop(state);
        hub.look();
        Ok(Self { client, runtime })
    }

    /// The next message, if there is one.
    pub(crate) fn next(&self) -> Option<Observed> {
        Some(match self.client.next() {
            Ok(message) => match message? {
                Message::Hello { .. } => Observed::Hello,
                Message::Text(text) => Observed::Text(text),
                Message::Stack(change) => Observed::Stack(change),
                Message::Frame(view, frame) => {
                    let is_key = frame.is_key();
                    let bytes = if is_key { frame.with_topology() } else { frame.message.clone() };
                    Observed::Frame { view, is_key, bytes }
                }
                Message::Behind(view, _) => Observed::Behind(view),
                Message::End => Observed::End,
            },
            Err(_) => Observed::TooMuch,
        })
    }

    /// Returns once there may be something, or after this time.
    pub(crate) fn wait(&self, time: Duration) {
        let notified = self.client.wake.notified();
        self.runtime.block_on(async { _ = tokio::time::timeout(time, notified).await });
    }
}

impl Hub {
    /// Tells the observer nothing behind what it was told; how the run ends where that `is_unfinished`.
    pub(crate) fn end_observing(&self, is_unfinished: bool) {
        let Some(observer) = lock(&self.state).observer.clone() else { return };
        if is_unfinished {
            self.tell_end();
        }
        observer.end(None);
    }

    /// Tells nothing more to the observer.
    pub(crate) fn stop_observing(&self) {
        let mut state = lock(&self.state);
        state.observer = None;
        self.note_audience(&state);
    }

    /// The description of the run, without anything that is meant for one viewer alone.
    pub(crate) fn hello_for_all(&self, orders: Option<Value>) -> String {
        let mut hello = self.described();
        hello.extend(orders.map(|orders| ("orders".into(), orders)));
        hello.insert("notes".into(), json!(*lock(&self.state).together.notes()));
        json!({ "hello": hello }).to_string()
    }

    /// The stack of edits with the edits themselves, after a change or from the beginning.
    pub(crate) fn whole_stack(&self, change: Option<StackChange>) -> String {
        self.stack_of_edits().whole(change)
    }
}

#[cfg(test)]
mod tests {
    use serde_json::Map;

    use super::*;

    /// A recording begins with what the run is, also where it is begun before that is known.
    #[test]
    fn nothing_comes_before_the_run_is_described() {
        let hub = Hub::default();
        let early = Observer::of(&hub).unwrap();
        hub.tell(|| json!({"pipelines": {}}));
        assert!(early.next().is_none());
        hub.describe(Map::new);
        assert!(matches!(early.next(), Some(Observed::Hello)));
        assert!(matches!(early.next(), Some(Observed::Text(_))));
        let late = Observer::of(&hub).unwrap();
        assert!(matches!(late.next(), Some(Observed::Hello)));
    }

    #[test]
    fn how_the_run_has_ended_is_the_last_that_is_told() {
        let hub = Hub::default();
        hub.describe(Map::new);
        let observer = Observer::of(&hub).unwrap();
        hub.tell_end();
        hub.tell(|| json!({"people": []}));
        hub.status();
        let mut told = Vec::new();
        while let Some(message) = observer.next() {
            match message {
                Observed::Text(text) => told.push(text.written()),
                Observed::End => break,
                _ => {}
            }
        }
        assert!(told.last().is_some_and(|last| last.contains("\"end\"")), "{told:?}");
        assert!(told.len() == 2 && told[0].contains("\"status\""), "{told:?}");
    }
}
