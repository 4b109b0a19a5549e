//! What the solver's side has to say to the viewers, the newest of each kind, and who the viewers
//! are.
//!
//! Every call returns at once. What is kept is bounded: the newest extract of each view, one that
//! waits to be encoded, a few frames for each viewer that has not read them yet, and short queues of
//! texts.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::{
        Arc, Condvar, Mutex,
        atomic::{AtomicU64, Ordering},
    },
    time::{Duration, Instant},
};

use serde_json::{Map, Value, json};
use tombolo_deform::edit::Edit;
use tombolo_pipelines::{
    encode::Encoded,
    language::Pipeline,
    run::{Audience, Cost},
};

use super::{
    ReferenceSurface, StreamCounts,
    credentials::Access,
    outbox::{Client, Frame},
    pace::{LEVELS, Pace},
    stack::ReportedStack,
    text::Text,
    together::Together,
    wheel::Wheel,
};
use crate::{lock::lock, step::Moment};

/// How often it is looked for a viewer that is waited for.
const LOOK_AGAIN: Duration = Duration::from_millis(20);

/// Encodes a frame on the encoder's thread at one of the [`LEVELS`], as a key frame or as the next of
/// its chain; the message says why it could not be done.
pub(crate) type Encode = Arc<dyn Fn(usize, bool) -> Result<Encoded, String> + Send + Sync>;

/// Makes what `hello` says of the run.
type Describe = Arc<dyn Fn() -> Map<String, Value> + Send + Sync>;

/// How a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum End {
    /// The solver came to its end.
    Finished,
    /// The solver was asked to stop.
    Stopped,
    /// The solver went without a word.
    #[default]
    Failed,
}

impl End {
    fn name(self) -> &'static str {
        match self {
            End::Finished => "finished",
            End::Stopped => "stopped",
            End::Failed => "failed",
        }
    }
}

/// The part of the status that changes with every step: written by the solver's thread with plain
/// stores.
#[derive(Debug, Default)]
pub(crate) struct Clock {
    cycle: AtomicU64,
    time: AtomicU64,
}

impl Clock {
    pub(crate) fn set(&self, Moment { cycle, time }: Moment) {
        self.cycle.store(cycle, Ordering::Relaxed);
        self.time.store(time.to_bits(), Ordering::Relaxed);
    }

    pub(crate) fn get(&self) -> Moment {
        Moment {
            cycle: self.cycle.load(Ordering::Relaxed),
            time: f64::from_bits(self.time.load(Ordering::Relaxed)),
        }
    }
}

/// Counted as it happens, for the report.
#[derive(Debug, Default)]
pub(super) struct Counters {
    frames: AtomicU64,
    pub(super) dropped: AtomicU64,
    pub(super) unrecorded: AtomicU64,
    bytes: AtomicU64,
    raw_bytes: AtomicU64,
}

/// A view, and what the encoder has to make of it.
#[derive(Default)]
pub(super) struct View {
    pub(super) name: Arc<str>,
    /// The extract that is newer than the last frame.
    pub(super) waiting: Option<Encode>,
    /// The extract of the last frame.
    pub(super) newest: Option<Encode>,
    /// The levels at which it is still to be encoded.
    pub(super) pending: [bool; LEVELS],
    /// The levels at which somebody cannot go on without a key frame.
    pub(super) key_wanted: [bool; LEVELS],
}

/// The answer to a viewer that connects.
pub(super) enum Arrival {
    Client(Arc<Client>),
    Full,
}

/// The viewers, and the newest message of each kind for them.
#[derive(Default)]
pub(super) struct HubState {
    description: Option<Describe>,
    stack: ReportedStack,
    pub(super) conditions: Map<String, Value>,
    /// By their numbers, which no later view gets again.
    pub(super) views: BTreeMap<usize, View>,
    pipelines: Option<Arc<[Pipeline]>>,
    surface: Option<Arc<ReferenceSurface>>,
    pub(super) clients: BTreeMap<u64, Arc<Client>>,
    /// Somebody inside the program who is told what viewers are told.
    pub(super) observer: Option<Arc<Client>>,
    pub(super) wheel: Wheel,
    pub(super) together: Together,
    /// The cost of each pipeline, by name.
    pub(super) costs: Vec<(String, Cost)>,
    /// Why the journal cannot be written.
    pub(super) journal_lost: Option<String>,
    pub(super) last_status: Option<(u64, Instant)>,
    pub(super) status_dirty: bool,
    pub(super) status_told: Option<Instant>,
    /// The seconds of a step, as they were measured last.
    pub(super) step_seconds: Option<f64>,
    end: End,
    /// Since when nothing new comes.
    pub(super) closed: Option<Instant>,
}

/// The newest messages of the solver, for all viewers.
#[derive(Default)]
pub(crate) struct Hub {
    pub(super) state: Mutex<HubState>,
    pub(super) work: Condvar,
    pub(crate) clock: Arc<Clock>,
    pub(super) counters: Counters,
    arrivals: AtomicU64,
    /// The bits of the [`Audience`].
    audience: AtomicU64,
    /// The number of the run, where one is shown.
    run: Option<Arc<str>>,
}

/// The name of a viewer in messages.
pub(super) fn name(client: u64) -> String {
    Hub::name(client)
}

/// Said by the solver's side.
impl Hub {
    /// The hub of the run of a number.
    pub(crate) fn new(run: Arc<str>) -> Self {
        Self { run: Some(run), ..Self::default() }
    }

    /// The number of the run, where one is shown.
    pub(crate) fn run(&self) -> Option<&str> {
        self.run.as_deref()
    }

    /// The name of a viewer in messages and in the journal.
    pub(crate) fn name(client: u64) -> String {
        format!("c{client}")
    }

    /// Notes why the journal cannot be written; `None` where it can.
    pub(crate) fn journal(&self, lost: Option<&str>) {
        let mut state = lock(&self.state);
        state.journal_lost = lost.map(str::to_owned);
        state.status_dirty = true;
    }

    /// Replaces what `hello` tells about the run, and has it told to every viewer again. The stream's
    /// thread asks for it.
    pub(crate) fn describe(
        &self,
        description: impl Fn() -> Map<String, Value> + Send + Sync + 'static,
    ) {
        let mut state = lock(&self.state);
        state.description = Some(Arc::new(description));
        state.greet();
    }

    /// Replaces what `hello` tells about the run where nothing but the values of parameters has changed,
    /// and has viewers told these alone.
    pub(crate) fn describe_values(
        &self,
        description: impl Fn() -> Map<String, Value> + Send + Sync + 'static,
        values: BTreeMap<String, f64>,
    ) {
        let text = Text::of(move || json!({"parameters": {"values": values}}));
        let mut state = lock(&self.state);
        state.description = Some(Arc::new(description));
        state.clients.values().for_each(|client| client.parameters(&text));
        // Whoever goes to a moment of a recording begins with the `hello` before it.
        state.observer.iter().for_each(|observer| observer.greet());
    }

    /// Replaces the stack of edits: so many, of which the first `kept` are those of before; so many
    /// orders can be taken back. `visit` calls back with the edits from one on, until it is told
    /// that it is enough.
    pub(crate) fn stack(
        &self,
        counts: [usize; 3],
        visit: impl Fn(usize, &mut dyn FnMut(&Edit) -> bool) + Send + Sync + 'static,
    ) {
        let mut state = lock(&self.state);
        let (stack, change) = state.stack.changed(counts, Arc::new(visit));
        let before = std::mem::replace(&mut state.stack, stack);
        state.audience().for_each(|client| client.stack(change));
        drop(state);
        // It may be long, and nobody waits for the lock.
        drop(before);
    }

    /// Offers the surface from which shapes are measured.
    pub(crate) fn offer_surface(&self, surface: Arc<ReferenceSurface>) {
        lock(&self.state).surface = Some(surface);
    }

    /// Replaces the slowly changing part of the status: `paused`, `stopped`, `quality`.
    pub(crate) fn conditions(&self, conditions: Map<String, Value>) {
        let mut state = lock(&self.state);
        state.conditions = conditions;
        state.status_dirty = true;
    }

    /// Replaces what the status tells of the cost of pipelines.
    pub(crate) fn costs<'a>(&self, costs: impl Iterator<Item = (&'a str, Cost)>) {
        let mut state = lock(&self.state);
        state.costs.clear();
        state.costs.extend(costs.map(|(name, cost)| (name.to_owned(), cost)));
    }

    /// How many viewers have come so far.
    pub(crate) fn arrivals(&self) -> u64 {
        self.arrivals.load(Ordering::Relaxed)
    }

    /// The views that viewers look at; a recording looks at all.
    #[inline]
    pub(crate) fn audience(&self) -> Audience {
        Audience::from_bits(self.audience.load(Ordering::Relaxed))
    }

    /// Notes which views somebody looks at, where that may have changed.
    pub(super) fn note_audience(&self, state: &HubState) {
        let of_each = state.audience().map(|client| client.audience());
        let audience = of_each.fold(Audience::NOBODY, Audience::with);
        self.audience.store(audience.to_bits(), Ordering::Relaxed);
    }

    /// Returns once a viewer is connected, or the run is to stop.
    pub(crate) fn wait_for_viewer(&self, mut is_to_stop: impl FnMut() -> bool) {
        let is_alone = || lock(&self.state).clients.is_empty();
        while is_alone() && !is_to_stop() {
            std::thread::sleep(LOOK_AGAIN);
        }
    }

    /// Tells every viewer, one after the other, and drops none of it. The stream's thread makes the
    /// message and writes it out.
    pub(crate) fn tell(&self, message: impl FnOnce() -> Value + Send + 'static) {
        let text = Text::of(message);
        lock(&self.state).audience().for_each(|client| client.text(&text));
    }

    /// Tells one viewer, if it is still there.
    pub(crate) fn tell_client(
        &self,
        client: u64,
        message: impl FnOnce() -> Value + Send + 'static,
    ) {
        if let Some(client) = lock(&self.state).clients.get(&client) {
            client.text(&Text::of(message));
        }
    }

    /// Tells the values of monitors; a viewer that is behind misses the oldest.
    pub(crate) fn monitor(&self, message: impl FnOnce() -> Value + Send + 'static) {
        let text = Text::of(message);
        lock(&self.state).audience().for_each(|client| client.monitor(&text));
    }

    /// Hands over the newest extract of a view. The one before it, if nobody came to encode it, is
    /// dropped.
    pub(crate) fn frame(&self, view: usize, name: &Arc<str>, encode: Encode) {
        let mut state = lock(&self.state);
        let is_watched = self.audience().includes(Audience::of([&**name]));
        let named = || View { name: Arc::clone(name), ..View::default() };
        let known = state.views.entry(view).or_insert_with(named);
        if known.waiting.replace(encode).is_some() && is_watched {
            self.counters.dropped.fetch_add(1, Ordering::Relaxed);
            let recordings = u64::from(state.observer.is_some());
            self.counters.unrecorded.fetch_add(recordings, Ordering::Relaxed);
        }
        if is_watched {
            self.work.notify_one();
        }
    }

    /// Lets go of a view that is not streamed any more; its number is not given again.
    pub(crate) fn forget(&self, view: usize) {
        let mut state = lock(&self.state);
        state.views.remove(&view);
        state.audience().for_each(|client| client.forget(view));
    }

    /// Offers the pipelines as they are now.
    pub(crate) fn offer_pipelines(&self, pipelines: &[Pipeline]) {
        let pipelines: Arc<[Pipeline]> = pipelines.into();
        lock(&self.state).pipelines = Some(pipelines);
    }

    pub(crate) fn counts(&self) -> StreamCounts {
        let get = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        StreamCounts {
            frames: get(&self.counters.frames),
            dropped: get(&self.counters.dropped),
            unrecorded: get(&self.counters.unrecorded),
            bytes: get(&self.counters.bytes),
            raw_bytes: get(&self.counters.raw_bytes),
        }
    }

    /// Has viewers told, once the run ends, how it did; without a word it has failed.
    pub(crate) fn ends(&self, how: End) {
        lock(&self.state).end = how;
    }

    /// Whether the end has begun.
    pub(super) fn is_closed(&self) -> bool {
        lock(&self.state).closed.is_some()
    }

    /// Ends the encoder's thread, once the last frames are encoded.
    pub(crate) fn close(&self) {
        lock(&self.state).closed = Some(Instant::now());
        self.work.notify_all();
    }
}

/// Done on the stream's thread.
impl Hub {
    /// Lets a viewer in, unless there are `limit` already; one more of those who may drive has a
    /// place beyond it. One that does not look at views (`looks`) is sent none until it chooses some.
    /// `returning` is what it was called before its connection was lost, and what it was told to come
    /// back with.
    pub(super) fn join(
        &self,
        limit: usize,
        access: Access,
        takes_wheel: bool,
        looks: bool,
        returning: Option<(&str, &str)>,
    ) -> Result<Arrival, getrandom::Error> {
        let mut state = lock(&self.state);
        let place = limit + usize::from(access == Access::Drive);
        let known = returning.and_then(|(name, back)| state.recognise(access, name, back));
        let (id, back) = match known {
            Some(known) => known,
            None if state.clients.len() >= place => return Ok(Arrival::Full),
            None => state.wheel.stranger()?,
        };
        let (views, is_known) = (state.view_numbers(), state.is_described());
        let client = Arc::new(Client::new(id, access, back, views, Pace::default(), is_known));
        if !looks {
            client.choose(Some(BTreeSet::new()), state.known_views());
        }
        state.seat(&client, takes_wheel);
        self.note_audience(&state);
        self.arrivals.fetch_add(1, Ordering::Relaxed);
        drop(state);
        self.work.notify_one();
        Ok(Arrival::Client(client))
    }

    /// Tells viewers the last status, and that and how the run has ended; what they have not read of
    /// it comes before, and nothing behind.
    pub(super) fn tell_end(&self) {
        self.status();
        let Moment { cycle, time } = self.clock.get();
        let how = lock(&self.state).end.name();
        let end = Text::of(move || json!({"end": {"how": how, "cycle": cycle, "time": time}}));
        lock(&self.state).audience().for_each(|client| client.end(Some(&end)));
    }

    /// Whether anybody is connected.
    pub(crate) fn has_viewers(&self) -> bool {
        !lock(&self.state).clients.is_empty()
    }

    /// Takes note of the views that a viewer looks at; all of them where that is `None`.
    pub(super) fn choose_views(&self, client: u64, chosen: Option<BTreeSet<String>>) {
        let state = lock(&self.state);
        if let Some(client) = state.clients.get(&client) {
            client.choose(chosen, state.known_views());
        }
        self.note_audience(&state);
        drop(state);
        self.work.notify_one();
    }

    /// Has the encoder make a key frame of a view at a level, of its newest extract.
    pub(crate) fn want_key(&self, view: usize, level: usize) {
        if let Some(view) = lock(&self.state).views.get_mut(&view) {
            view.key_wanted[level] = true;
        }
        self.work.notify_one();
    }

    pub(super) fn surface(&self) -> Option<Arc<ReferenceSurface>> {
        lock(&self.state).surface.clone()
    }

    pub(super) fn stack_of_edits(&self) -> ReportedStack {
        lock(&self.state).stack.clone()
    }

    /// The pipelines as JSON.
    pub(super) fn pipelines(&self) -> String {
        let pipelines = lock(&self.state).pipelines.clone();
        json!(pipelines.unwrap_or_default()).to_string()
    }

    pub(super) fn has_view(&self, view: usize) -> bool {
        lock(&self.state).views.contains_key(&view)
    }

    /// What `hello` tells about the run.
    pub(super) fn described(&self) -> Map<String, Value> {
        let description = lock(&self.state).description.clone();
        description.map(|describe| describe()).unwrap_or_default()
    }

    /// Has the encoder look whether there is something to do.
    pub(super) fn look(&self) {
        self.work.notify_one();
    }

    /// The `hello` of a viewer; the first has the orders so far, and what there is of the stack.
    pub(super) fn hello(&self, client: u64, orders: Option<Value>) -> String {
        // Nothing is written while the solver could wait for the lock.
        let (stack, is_driver, viewer, notes) = {
            let state = lock(&self.state);
            let is_driver = state.wheel.driver() == Some(client);
            let viewer = state.clients.get(&client).cloned();
            (state.stack.clone(), is_driver, viewer, state.together.notes())
        };
        let mut hello = self.described();
        if let Some(orders) = orders {
            hello.insert("stack".into(), stack.described());
            hello.insert("orders".into(), orders);
            hello.insert("notes".into(), json!(*notes));
        }
        hello.insert("client".into(), name(client).into());
        let role = if is_driver { "driver" } else { "watcher" };
        hello.insert("role".into(), role.into());
        if let Some(client) = viewer {
            hello.insert("back".into(), client.back.as_str().into());
            hello.insert("may_drive".into(), (client.access == Access::Drive).into());
        }
        json!({ "hello": hello }).to_string()
    }

    pub(super) fn sent(&self, bytes: usize, frame: &Frame) {
        self.counters.frames.fetch_add(1, Ordering::Relaxed);
        self.counters.bytes.fetch_add(bytes as u64, Ordering::Relaxed);
        self.counters.raw_bytes.fetch_add(frame.raw_bytes(), Ordering::Relaxed);
    }
}

impl HubState {
    pub(super) fn greet(&self) {
        self.audience().for_each(|client| client.greet());
    }

    /// All who are told what happens.
    pub(super) fn audience(&self) -> impl Iterator<Item = &Arc<Client>> {
        self.clients.values().chain(&self.observer)
    }

    pub(super) fn has_audience(&self) -> bool {
        self.audience().next().is_some()
    }

    /// Whether the run has said what it is.
    pub(super) fn is_described(&self) -> bool {
        self.description.is_some()
    }

    /// The views by their numbers, with their names.
    fn known_views(&self) -> impl Iterator<Item = (usize, &str)> {
        self.views.iter().map(|(&view, known)| (view, &*known.name))
    }

    /// The numbers of the views.
    pub(super) fn view_numbers(&self) -> impl Iterator<Item = usize> {
        self.known_views().map(|(view, _)| view)
    }
}
