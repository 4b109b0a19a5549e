//! Where messages go that belong to no call: what was passed over, what a pipeline could not do,
//! how far an order has come.
//!
//! The library tells of itself by events of the crate [`tracing`]. Each has a message that makes
//! sense alone, and what it is about in fields, where that is known:
//!
//! | field | what it holds |
//! |---|---|
//! | `run` | the number of the run: [`Adaptor::run_id`](crate::Adaptor::run_id) |
//! | `cycle` | the cycle of the solver |
//! | `order` | the id of an order |
//! | `status` | how far it has come: a state of [`OrderStatus`](crate::OrderStatus), or `cancelled` |
//! | `undo` | of an order that takes others back, how many |
//! | `command`, `id` | the kind of a command that is no order, such as `pause`, and its id |
//! | `pipeline`, `viewer` | their names |
//! | `address`, `path` | an address, a file |
//! | `rank`, `shape`, `checkpoint`, `name` | a rank, a shape of an order, a checkpoint, a run at a relay |
//! | `reason` | why something was not done |
//!
//! A mistake is a warning or an error; the life of orders, what was commanded, who watches and what
//! was written are told at `INFO` and `DEBUG`. On several ranks only rank 0 tells them, but for one
//! that ends the job.
//!
//! A host that has set a subscriber of `tracing` has all events there. One that has set a logger of
//! the crate `log`, and no subscriber, has them there as records, with the fields behind the
//! message. A host that has neither calls [`start`], as the programs do, and has the warnings on
//! standard error.

use std::{
    cell::Cell,
    fmt::{Debug, Write as _},
    io::Write as _,
    sync::{Mutex, OnceLock},
};

use tracing::{
    Dispatch, Event, Metadata, Subscriber, callsite, dispatcher,
    field::{Field, Visit},
    span,
};
pub use tracing::{Level, level_filters::LevelFilter};

use crate::lock::lock;

/// Takes messages, one at a time and from any thread.
pub type Sink = Box<dyn Fn(Level, &str) + Send>;

/// Why the destination of messages could not be changed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LoggingError {
    /// The process has a subscriber or a logger that is not this one.
    #[error("the process logs by a logger of its own, which has these messages already")]
    OtherLogger,
    /// A sink wants to replace itself.
    #[error("called by the function that takes the messages; expected before or after it")]
    WithinSink,
}

/// The subscriber of a process that has none of its own.
struct Printer;

static SINK: Mutex<Option<Sink>> = Mutex::new(None);
static MOST: Mutex<LevelFilter> = Mutex::new(LevelFilter::WARN);

thread_local! {
    static IS_IN_SINK: Cell<bool> = const { Cell::new(false) };
}

impl Subscriber for Printer {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        // Of other crates in the same library nobody has asked to hear.
        metadata.is_event()
            && metadata.target().starts_with("tombolo")
            && *metadata.level() <= *lock(&MOST)
    }

    fn max_level_hint(&self) -> Option<LevelFilter> {
        Some(*lock(&MOST))
    }

    fn event(&self, event: &Event<'_>) {
        // What a sink does in turn must not wait for the sink.
        if IS_IN_SINK.replace(true) {
            return;
        }
        let mut message = Message::default();
        event.record(&mut message);
        match &*lock(&SINK) {
            Some(sink) => sink(*event.metadata().level(), &message.0),
            // Whoever has closed it wants to hear nothing.
            None => drop(writeln!(std::io::stderr(), "tombolo: {}", message.0)),
        }
        IS_IN_SINK.set(false);
    }

    fn new_span(&self, _: &span::Attributes<'_>) -> span::Id {
        // None is enabled.
        span::Id::from_u64(1)
    }

    fn record(&self, _: &span::Id, _: &span::Record<'_>) {}

    fn record_follows_from(&self, _: &span::Id, _: &span::Id) {}

    fn enter(&self, _: &span::Id) {}

    fn exit(&self, _: &span::Id) {}
}

/// The message of an event, which says in words what its fields hold.
#[derive(Default)]
struct Message(String);

impl Visit for Message {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        if field.name() == "message" {
            // A text takes whatever it is given.
            let _ = write!(self.0, "{value:?}");
        }
    }
}

/// Logs warnings to standard error, unless the process has a subscriber or a logger, or [`send_to`]
/// was called before. Calls after the first change nothing.
pub fn start() {
    is_started();
}

/// Makes this the subscriber of the process; whether it is.
fn is_started() -> bool {
    static STARTED: OnceLock<bool> = OnceLock::new();
    *STARTED.get_or_init(|| {
        // A logger of `log` has the events as long as there is no subscriber.
        let has_logger = log::max_level() > log::LevelFilter::Off;
        !has_logger && dispatcher::set_global_default(Dispatch::new(Printer)).is_ok()
    })
}

/// Logs messages up to this level to `sink`; without one, to standard error. The sink before is not
/// called any more once this returns.
///
/// ```
/// use tombolo::logging::{LevelFilter, send_to};
///
/// send_to(LevelFilter::INFO, Some(Box::new(|level, message| println!("{level}: {message}"))))?;
/// # Ok::<(), tombolo::logging::LoggingError>(())
/// ```
///
/// # Errors
/// [`LoggingError::OtherLogger`] where the host has set a subscriber or a logger,
/// [`LoggingError::WithinSink`] in a call of a sink.
pub fn send_to(level: LevelFilter, sink: Option<Sink>) -> Result<(), LoggingError> {
    if IS_IN_SINK.get() {
        return Err(LoggingError::WithinSink);
    }
    if !is_started() {
        return Err(LoggingError::OtherLogger);
    }
    let before = std::mem::replace(&mut *lock(&SINK), sink);
    *lock(&MOST) = level;
    // Each place that tells something remembers whether anybody listens.
    callsite::rebuild_interest_cache();
    drop(before);
    Ok(())
}
