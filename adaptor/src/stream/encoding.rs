//! The encoder's thread: makes a frame of the newest extract of each view, as long as somebody looks.

use std::{
    sync::{Arc, atomic::Ordering},
    time::Duration,
};

use serde_json::json;

use super::{
    hub::{Encode, Hub, HubState, View},
    outbox::{Client, Frame},
    pace::LEVELS,
};
use crate::lock::{lock, wait};

/// How long frames are encoded after the end of the run.
const LAST_FRAMES: Duration = Duration::from_secs(2);

impl Hub {
    /// Encodes what waits, as long as anybody looks, until the hub is closed; what waits then too, for
    /// two seconds.
    pub(crate) fn encode_until_closed(&self) {
        loop {
            let mut state = lock(&self.state);
            let (view, encode, level, key) = loop {
                if state.closed.is_some_and(|since| since.elapsed() >= LAST_FRAMES) {
                    return;
                }
                let HubState { views, clients, observer, .. } = &mut *state;
                let audience = || clients.values().chain(&*observer);
                let mut views = views.iter_mut().filter(|(_, view)| view.has_work());
                let waiting = views.find_map(|(&number, view)| {
                    let name = Arc::clone(&view.name);
                    let mut looking = audience().filter(|client| client.looks_at(&name)).peekable();
                    looking.peek().is_some().then(|| view.due(number, looking)).flatten()
                });
                match waiting {
                    Some(found) => break found,
                    None if state.closed.is_some() => return,
                    None => state = wait(&self.work, state),
                }
            };
            drop(state);
            // A frame that cannot be encoded must not take the others with it.
            let encoded =
                std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| encode(level, key)))
                    .unwrap_or_else(|_| Err("the encoder failed".into()));
            match encoded {
                Ok(encoded) => self.publish(view, &Arc::new(Frame::new(encoded, level))),
                Err(reason) => self.tell(
                    move || json!({"error": {"message": format!("a frame was not encoded: {reason}")}}),
                ),
            }
        }
    }

    fn publish(&self, view: usize, frame: &Arc<Frame>) {
        let state = lock(&self.state);
        // It may have been let go of while it was encoded.
        let Some(name) = state.views.get(&view).map(|view| &view.name) else { return };
        for client in state.audience() {
            let missed = client.frame(view, name, frame) as u64;
            self.counters.dropped.fetch_add(missed, Ordering::Relaxed);
            if state.observer.as_ref().is_some_and(|observer| Arc::ptr_eq(observer, client)) {
                self.counters.unrecorded.fetch_add(missed, Ordering::Relaxed);
            }
        }
    }
}

impl View {
    /// Whether there is anything to encode, should somebody look at it.
    fn has_work(&self) -> bool {
        self.waiting.is_some() || self.pending.contains(&true) || self.key_wanted.contains(&true)
    }

    /// The next frame to encode, its level of precision, and whether it is a key frame.
    fn due<'a>(
        &mut self,
        index: usize,
        audience: impl Iterator<Item = &'a Arc<Client>>,
    ) -> Option<(usize, Encode, usize, bool)> {
        // Each extract is encoded at every level that somebody is at, so that none is left out.
        if !self.pending.contains(&true)
            && let Some(waiting) = self.waiting.take()
        {
            self.newest = Some(waiting);
            audience.for_each(|client| self.pending[client.level(index)] = true);
        }
        let level = (0..LEVELS).find(|&level| self.pending[level] || self.key_wanted[level])?;
        self.pending[level] = false;
        let key = std::mem::take(&mut self.key_wanted[level]);
        self.newest.clone().map(|encode| (index, encode, level, key))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use serde_json::Map;

    use super::*;
    use crate::stream::Observer;

    /// The encoder comes to nothing before the end.
    #[test]
    fn frames_that_make_way_are_missing_in_a_recording_and_the_last_is_encoded() {
        let hub = Hub::default();
        hub.describe(Map::new);
        let _recording = Observer::of(&hub).unwrap();
        let encoded = Arc::new(Mutex::new(Vec::new()));
        for cycle in 0..3 {
            let encoded = Arc::clone(&encoded);
            let encode = move |_, _| {
                lock(&encoded).push(cycle);
                Err("it is not wanted here".into())
            };
            hub.frame(0, &"cut".into(), Arc::new(encode));
        }
        assert_eq!(hub.counts().unrecorded, 2);
        hub.close();
        hub.encode_until_closed();
        assert_eq!(*lock(&encoded), [2]);
    }
}
