//! How a run is asked to end by any thread, also while another is in a call of it.

use std::sync::{Mutex, MutexGuard, PoisonError};

use tombolo::Stopper;

use crate::{Fault, Opened};

/// How far a run has come, as far as its end is asked for.
#[derive(Default)]
pub(super) enum Ending {
    /// It has not begun.
    #[default]
    Open,
    /// It was asked to end before it has begun.
    Asked,
    UnderWay(Stopper),
    Ended,
}

impl Ending {
    /// Holds it for a moment.
    pub(super) fn of(ending: &Mutex<Self>) -> MutexGuard<'_, Self> {
        // It is replaced whole.
        ending.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Asks the run to end; one that has not begun is asked when it does.
    pub(super) fn ask(&mut self) -> Result<(), Fault> {
        match self {
            Self::Open | Self::Asked => *self = Self::Asked,
            Self::UnderWay(stopper) => stopper.stop(),
            Self::Ended => return Err(Opened::after_the_end()),
        }
        Ok(())
    }

    /// The run has begun, and can be asked to end by this.
    pub(super) fn begin(&mut self, stopper: Stopper) {
        if matches!(self, Self::Asked) {
            stopper.stop();
        }
        *self = Self::UnderWay(stopper);
    }
}
