//! What is kept between `initialize` and `finalize`.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::CatalystError;
use crate::node::{Node, Number};

/// One run of a solver.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Session {
    /// The last step that was read, as (cycle, time).
    last: Option<(u64, f64)>,
}

impl Session {
    /// Reads the state of one step.
    pub(crate) fn execute(&mut self, node: &Node<'_>) -> Result<(), CatalystError> {
        if !node.has(c"catalyst") {
            return Err(CatalystError::Missing { path: "catalyst" });
        }
        self.last = Some((cycle(node)?, time(node)?));
        if node.has(c"catalyst/channels") { Err(CatalystError::ChannelsNotRead) } else { Ok(()) }
    }
}

fn cycle(node: &Node<'_>) -> Result<u64, CatalystError> {
    // ParaView's blueprint says `timestep`, Conduit's `cycle`; the first wins where both are there.
    for path in [c"catalyst/state/timestep", c"catalyst/state/cycle"] {
        let wrong = |found| CatalystError::NotANumber {
            path: path.to_string_lossy().into_owned(),
            expected: "integer that is not negative",
            found,
        };
        match node.number(path)? {
            Some(Number::Integer(value)) => return u64::try_from(value).map_err(|_| wrong(6)),
            Some(Number::Real(_)) => return Err(wrong(12)),
            None => {}
        }
    }
    Err(CatalystError::Missing { path: "catalyst/state/timestep (or catalyst/state/cycle)" })
}

fn time(node: &Node<'_>) -> Result<f64, CatalystError> {
    const PATH: &str = "catalyst/state/time";
    let value = match node.number(c"catalyst/state/time")? {
        Some(Number::Real(value)) => value,
        #[expect(clippy::cast_precision_loss, reason = "a time written as an integer is small")]
        Some(Number::Integer(value)) => value as f64,
        None => return Err(CatalystError::Missing { path: PATH }),
    };
    if value.is_finite() { Ok(value) } else { Err(CatalystError::NotFinite { path: PATH, value }) }
}

/// Whether an error has yet to be told: that channels are not read is said once in a process, everything else each time.
pub(crate) fn is_news(error: &CatalystError) -> bool {
    static TOLD: AtomicBool = AtomicBool::new(false);
    *error != CatalystError::ChannelsNotRead || !TOLD.swap(true, Ordering::Relaxed)
}
