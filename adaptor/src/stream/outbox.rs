//! The messages that a viewer has yet to read.
//!
//! What is kept for a viewer is bounded: a few frames of each view, short queues of texts.

use std::{
    collections::{BTreeMap, BTreeSet, VecDeque},
    sync::{Arc, Mutex},
};

use axum::body::Bytes;
use serde_json::json;
use tokio::sync::Notify;
use tombolo_pipelines::{encode::Encoded, run::Audience};

use super::{
    credentials::Access,
    pace::{COARSER, EXACT, Pace},
    secret::Secret,
    stack::StackChange,
    text::Text,
};
use crate::lock::lock;

/// Texts that may wait for a viewer; one that leaves more unread is let go.
const TEXTS: usize = 1024;
/// Frames of a view that may wait for a viewer, and that may be on their way to it.
const FRAMES: usize = 2;
/// Frames that are remembered of a viewer that has not acknowledged any.
const UNACKNOWLEDGED: usize = 64;
/// Monitor values that may wait for a viewer; older ones make way.
const MONITORS: usize = 256;

/// One encoded frame of a view, shared by all viewers.
#[derive(Debug)]
pub(super) struct Frame {
    encoded: Encoded,
    /// How exact it is.
    level: usize,
    /// The frame's message.
    pub(super) message: Bytes,
}

impl Frame {
    pub(super) fn new(mut encoded: Encoded, level: usize) -> Self {
        // Key frames are asked for with their topology too, which is put in front of them.
        let is_key = encoded.is_key();
        let message =
            if is_key { encoded.message.clone() } else { std::mem::take(&mut encoded.message) };
        Self { message: message.into(), level, encoded }
    }

    /// How many bytes the frame's values are before they are encoded.
    pub(super) fn raw_bytes(&self) -> u64 {
        self.encoded.raw_bytes as u64
    }

    /// Whether it can be read without those before it.
    pub(super) fn is_key(&self) -> bool {
        self.encoded.is_key()
    }

    /// Which topology the frame belongs to.
    pub(super) fn topology_id(&self) -> u64 {
        self.encoded.topology_id
    }

    /// The message of a key frame with its topology.
    pub(super) fn with_topology(&self) -> Bytes {
        self.encoded.with_topology().into()
    }
}

/// The frames of one view that a viewer has yet to read: a part of the view's chain.
#[derive(Default)]
struct Unread {
    frames: VecDeque<Arc<Frame>>,
    /// How many were sent and are not acknowledged.
    in_flight: usize,
    /// Frames of the chain were left out: the viewer can go on with a key frame only.
    is_behind: bool,
    /// The encoder was asked for a key frame.
    has_asked: bool,
    /// How exact the frames are.
    pace: Pace,
}

impl Unread {
    /// Takes the next frame of the view; returns how many the viewer will miss for it, and whether
    /// frames are coarser or finer from now on.
    fn put(&mut self, frame: &Arc<Frame>) -> (usize, bool) {
        if frame.level != self.pace.level() {
            return (0, false);
        }
        let missed = if frame.encoded.is_key() {
            let missed = self.frames.len();
            self.frames.clear();
            (self.is_behind, self.has_asked) = (false, false);
            missed
        } else if self.is_behind {
            return (1, false);
        } else if self.frames.len() >= FRAMES {
            let missed = self.frames.len() + 1;
            self.begin_anew();
            return (missed, self.pace.fell_behind());
        } else {
            0
        };
        if self.pace.carried() {
            // Those that wait are read, or the viewer would miss them for nothing.
            self.is_behind = true;
            return (missed + 1, true);
        }
        self.frames.push_back(Arc::clone(frame));
        (missed, false)
    }

    /// Lets go of what waits: the viewer goes on with a key frame.
    fn begin_anew(&mut self) {
        self.frames.clear();
        (self.is_behind, self.has_asked) = (true, false);
    }
}

/// The messages that a viewer has yet to read.
#[derive(Default)]
struct Outbox {
    texts: VecDeque<Text>,
    monitors: VecDeque<Text>,
    stack: Option<StackChange>,
    /// The newest values of parameters.
    parameters: Option<Text>,
    status: Option<Text>,
    /// The newest camera of the one that drives.
    camera: Option<Text>,
    hello: bool,
    has_been_greeted: bool,
    views: BTreeMap<usize, Unread>,
    /// The names of the views that the viewer looks at; all where it has chosen none.
    chosen: Option<BTreeSet<String>>,
    /// The pace at which a view begins.
    pace: Pace,
    /// The view that was served last: they take turns.
    last_view: usize,
    /// The view of each frame that was sent and not acknowledged, the oldest first; from the first
    /// acknowledgement on.
    in_flight: VecDeque<usize>,
    /// How many frames were acknowledged; `None` for a viewer that does not.
    acknowledged: Option<u64>,
    sent: u64,
    /// The connection is to be closed at once, with this code and reason.
    closing: Option<Closing>,
    /// Nothing comes any more, but for what waits and then the last text.
    has_ended: bool,
    last: Option<Text>,
}

/// Whether a view is among those chosen; all are where nothing was.
fn is_chosen(chosen: Option<&BTreeSet<String>>, name: &str) -> bool {
    chosen.is_none_or(|chosen| chosen.contains(name))
}

impl Outbox {
    fn looks_at(&self, name: &str) -> bool {
        is_chosen(self.chosen.as_ref(), name)
    }

    /// The next frame, or a view whose next key frame is to be asked for.
    fn frame(&mut self) -> Option<Message> {
        let waits = |unread: &Unread| {
            unread.in_flight < FRAMES
                && (!unread.frames.is_empty() || unread.is_behind && !unread.has_asked)
        };
        let after =
            self.views.range(self.last_view + 1..).chain(self.views.range(..=self.last_view));
        let view = after.filter(|(_, unread)| waits(unread)).map(|(&view, _)| view).next()?;
        let unread = self.views.get_mut(&view)?;
        let Some(frame) = unread.frames.pop_front() else {
            unread.has_asked = true;
            return Some(Message::Behind(view, unread.pace.level()));
        };
        self.last_view = view;
        self.sent += 1;
        self.in_flight.push_back(view);
        if self.acknowledged.is_some() {
            unread.in_flight += 1;
        } else if self.in_flight.len() > UNACKNOWLEDGED {
            self.in_flight.pop_front();
        }
        Some(Message::Frame(view, frame))
    }

    /// The viewer has decoded so many frames in all.
    fn acknowledge(&mut self, count: u64) -> bool {
        let before = self.acknowledged.unwrap_or(0);
        if count <= before || count > self.sent {
            return false;
        }
        if self.acknowledged.is_none() {
            self.in_flight.iter().for_each(|view| {
                if let Some(unread) = self.views.get_mut(view) {
                    unread.in_flight += 1;
                }
            });
        }
        self.acknowledged = Some(count);
        while self.in_flight.len() as u64 > self.sent - count {
            let view = self.in_flight.pop_front();
            if let Some(unread) = view.and_then(|view| self.views.get_mut(&view)) {
                unread.in_flight = unread.in_flight.saturating_sub(1);
            }
        }
        true
    }
}

/// The code and the reason with which a connection is closed.
pub(super) type Closing = (u16, &'static str);

/// One viewer.
pub(super) struct Client {
    pub(super) id: u64,
    /// The client's rights.
    pub(super) access: Access,
    /// The secret with which it comes back under its name.
    pub(super) back: Secret,
    pub(super) wake: Notify,
    outbox: Mutex<Outbox>,
}

/// A message for a viewer.
pub(super) enum Message {
    Text(Text),
    /// The stack of edits has changed.
    Stack(StackChange),
    /// The first of a connection, or one more.
    Hello {
        is_first: bool,
    },
    Frame(usize, Arc<Frame>),
    /// The viewer is ready for a view of which it missed frames, at this level.
    Behind(usize, usize),
    /// The run has ended.
    End,
}

impl Client {
    /// A viewer that is to be greeted, now or once it `is_known` what the run is, and needs a key
    /// frame of each of these views; `pace` is how each of its views begins.
    pub(super) fn new(
        id: u64,
        access: Access,
        back: Secret,
        views: impl Iterator<Item = usize>,
        pace: Pace,
        is_known: bool,
    ) -> Self {
        let behind = || Unread { is_behind: true, pace: pace.clone(), ..Unread::default() };
        let views = views.map(|view| (view, behind())).collect();
        let outbox = Outbox { hello: is_known, views, pace, ..Outbox::default() };
        Self { id, access, back, wake: Notify::new(), outbox: Mutex::new(outbox) }
    }

    /// The next thing to send, the most urgent first; `Err` once the connection is to be closed, as
    /// when the viewer has left too much unread.
    pub(super) fn next(&self) -> Result<Option<Message>, Closing> {
        let mut outbox = lock(&self.outbox);
        if let Some(closing) = outbox.closing {
            return Err(closing);
        }
        if std::mem::take(&mut outbox.hello) {
            let is_first = !std::mem::replace(&mut outbox.has_been_greeted, true);
            return Ok(Some(Message::Hello { is_first }));
        }
        // Nothing comes before it: who comes while the run is set up is greeted at the end of that.
        if !outbox.has_been_greeted && !outbox.has_ended {
            return Ok(None);
        }
        // Whoever hears that a parameter was set finds its value changed.
        if let Some(text) = outbox.parameters.take() {
            return Ok(Some(Message::Text(text)));
        }
        if let Some(text) = outbox.texts.pop_front() {
            return Ok(Some(Message::Text(text)));
        }
        if let Some(change) = outbox.stack.take() {
            return Ok(Some(Message::Stack(change)));
        }
        if let Some(text) = outbox.status.take() {
            return Ok(Some(Message::Text(text)));
        }
        if let Some(text) = outbox.camera.take() {
            return Ok(Some(Message::Text(text)));
        }
        if let Some(text) = outbox.monitors.pop_front() {
            return Ok(Some(Message::Text(text)));
        }
        let ended = outbox.has_ended.then_some(Message::End);
        Ok(outbox.frame().or_else(|| outbox.last.take().map(Message::Text)).or(ended))
    }

    /// Takes note that the viewer has decoded so many frames in all; from then on it is sent new
    /// ones only as it gets on with them. `false` where the number is more than were sent, or no more
    /// than before.
    pub(super) fn acknowledge(&self, frames: u64) -> bool {
        let done = lock(&self.outbox).acknowledge(frames);
        self.wake.notify_one();
        done
    }

    /// Tells something, unless the end was told.
    fn tell(&self, change: impl FnOnce(&mut Outbox)) {
        self.put(|outbox| {
            if !outbox.has_ended {
                change(outbox);
            }
        });
    }

    fn put(&self, change: impl FnOnce(&mut Outbox)) {
        change(&mut lock(&self.outbox));
        self.wake.notify_one();
    }

    /// Has `hello` sent, for the first time or again.
    pub(super) fn greet(&self) {
        self.put(|outbox| outbox.hello = true);
    }

    /// Has a change of the stack told, with those that were not told yet.
    pub(super) fn stack(&self, change: StackChange) {
        self.tell(|outbox| outbox.stack = Some(change.after(outbox.stack)));
    }

    /// Puts values of parameters in the place of the last ones.
    pub(super) fn parameters(&self, text: &Text) {
        self.tell(|outbox| outbox.parameters = Some(text.clone()));
    }

    /// Puts a status, if there is a new one, in the place of the last one. It is sent with what comes
    /// next: alone only where nothing has come until this is called again.
    pub(super) fn status(&self, text: Option<&Text>) {
        let mut outbox = lock(&self.outbox);
        if outbox.status.is_some() {
            self.wake.notify_one();
        }
        if let Some(text) = text.filter(|_| !outbox.has_ended) {
            outbox.status = Some(text.clone());
        }
    }

    /// Puts a camera in the place of the last one.
    pub(super) fn camera(&self, text: &Text) {
        self.tell(|outbox| outbox.camera = Some(text.clone()));
    }

    /// Adds values of monitors; where very many are unread, the oldest make way.
    pub(super) fn monitor(&self, text: &Text) {
        self.tell(|outbox| {
            if outbox.monitors.len() >= MONITORS {
                outbox.monitors.pop_front();
            }
            outbox.monitors.push_back(text.clone());
        });
    }

    /// Adds the next frame of a view; returns how many frames the viewer will miss for it.
    pub(super) fn frame(&self, view: usize, name: &Arc<str>, frame: &Arc<Frame>) -> usize {
        let mut missed = 0;
        self.put(|outbox| {
            if !outbox.looks_at(name) {
                return;
            }
            let begun = || Unread { pace: outbox.pace.clone(), ..Unread::default() };
            let unread = outbox.views.entry(view).or_insert_with(begun);
            let is_changed;
            (missed, is_changed) = unread.put(frame);
            if is_changed {
                let (name, coarser) = (Arc::clone(name), COARSER[unread.pace.level()]);
                outbox.texts.push_back(Text::of(
                    move || json!({"precision": {"view": *name, "coarser": coarser}}),
                ));
            }
        });
        missed
    }

    /// Chooses the views that the viewer looks at, all of them where that is `None`. It needs a key frame
    /// of each that it did not look at before; `known` are the views there are. What is on its way
    /// counts on.
    pub(super) fn choose<'a>(
        &self,
        chosen: Option<BTreeSet<String>>,
        known: impl Iterator<Item = (usize, &'a str)>,
    ) {
        self.put(|outbox| {
            let before = std::mem::replace(&mut outbox.chosen, chosen);
            for (view, name) in known {
                let begun = || Unread { pace: outbox.pace.clone(), ..Unread::default() };
                let looked = is_chosen(before.as_ref(), name);
                let looks = is_chosen(outbox.chosen.as_ref(), name);
                let unread = outbox.views.entry(view).or_insert_with(begun);
                if looks != looked {
                    unread.begin_anew();
                }
                // No key frame is made of what nobody looks at.
                unread.has_asked |= !looks;
            }
        });
    }

    /// Whether the viewer looks at the view of this name.
    pub(super) fn looks_at(&self, name: &str) -> bool {
        lock(&self.outbox).looks_at(name)
    }

    /// The views that the viewer looks at.
    pub(super) fn audience(&self) -> Audience {
        let outbox = lock(&self.outbox);
        let names = outbox.chosen.as_ref();
        names.map_or(Audience::OF_ALL, |names| Audience::of(names.iter().map(String::as_str)))
    }

    /// How exact the frames of a view are for it.
    pub(super) fn level(&self, view: usize) -> usize {
        lock(&self.outbox).views.get(&view).map_or(EXACT, |unread| unread.pace.level())
    }

    /// Forgets what is unread of a view.
    pub(super) fn forget(&self, view: usize) {
        lock(&self.outbox).views.remove(&view);
    }

    /// Ends the connection at once.
    pub(super) fn close(&self, closing: Closing) {
        self.put(|outbox| outbox.closing = Some(closing));
    }

    /// Ends the connection once all else was sent, and behind it the last text. What is told later
    /// is not sent.
    pub(super) fn end(&self, last: Option<&Text>) {
        self.tell(|outbox| outbox.last = last.cloned());
        self.put(|outbox| outbox.has_ended = true);
    }

    /// Adds a text, which is never left out; a viewer that leaves very many unread is let go.
    pub(super) fn text(&self, text: &Text) {
        self.tell(|outbox| {
            if outbox.texts.len() >= TEXTS {
                outbox.closing.get_or_insert((1008, "too much was left unread"));
            } else {
                outbox.texts.push_back(text.clone());
            }
        });
    }
}
