//! Where messages go that belong to no call: what was passed over, what a pipeline could not do.
//!
//! The library logs through the crate `log`, so that a host's logger has its messages beside all
//! others. A host that has no logger calls [`start`], as the programs do, and has the warnings on
//! standard error.

use std::cell::Cell;
use std::sync::{Mutex, Once};

pub use log::{Level, LevelFilter};
use log::{Log, Metadata, Record};

use crate::lock::lock;

/// Takes messages, one at a time and from any thread.
pub type Sink = Box<dyn Fn(Level, &str) + Send>;

/// Why the destination of messages could not be changed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LoggingError {
    /// The process has a logger that is not this one.
    #[error("the process logs by a logger of its own, which has these messages already")]
    OtherLogger,
    /// A sink wants to replace itself.
    #[error("called by the function that takes the messages; expected before or after it")]
    WithinSink,
}

struct Logger {
    sink: Mutex<Option<Sink>>,
}

static LOGGER: Logger = Logger { sink: Mutex::new(None) };

thread_local! {
    static IS_IN_SINK: Cell<bool> = const { Cell::new(false) };
}

impl Log for Logger {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        // Of other crates in the same library nobody has asked to hear.
        metadata.level() <= log::max_level() && metadata.target().starts_with("tombolo")
    }

    fn log(&self, record: &Record<'_>) {
        // What a sink does in turn must not wait for the sink.
        if !self.enabled(record.metadata()) || IS_IN_SINK.replace(true) {
            return;
        }
        match &*lock(&self.sink) {
            Some(sink) => sink(record.level(), &record.args().to_string()),
            None => eprintln!("tombolo: {}", record.args()),
        }
        IS_IN_SINK.set(false);
    }

    fn flush(&self) {}
}

/// Logs warnings to standard error, unless the process has a logger or [`send_to`] was called
/// before. Calls after the first change nothing.
pub fn start() {
    static STARTED: Once = Once::new();
    STARTED.call_once(|| {
        if log::set_logger(&LOGGER).is_ok() {
            log::set_max_level(LevelFilter::Warn);
        }
    });
}

/// Logs messages up to this level to `sink`; without one, to standard error. The sink before is not
/// called any more once this returns.
///
/// ```
/// use tombolo::logging::{LevelFilter, send_to};
///
/// send_to(LevelFilter::Info, Some(Box::new(|level, message| println!("{level}: {message}"))))?;
/// # Ok::<(), tombolo::logging::LoggingError>(())
/// ```
///
/// # Errors
/// [`LoggingError::OtherLogger`] where the host has set a logger, [`LoggingError::WithinSink`] in a
/// call of a sink.
pub fn send_to(level: LevelFilter, sink: Option<Sink>) -> Result<(), LoggingError> {
    if IS_IN_SINK.get() {
        return Err(LoggingError::WithinSink);
    }
    start();
    if !std::ptr::addr_eq(log::logger(), &raw const LOGGER) {
        return Err(LoggingError::OtherLogger);
    }
    let before = std::mem::replace(&mut *lock(&LOGGER.sink), sink);
    log::set_max_level(level);
    drop(before);
    Ok(())
}
