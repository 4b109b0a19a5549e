//! How many lines about viewers the journal gets.
//!
//! Whoever has a secret can connect as often as they like. The journal is kept, and read again whole:
//! it must not become longer by that without end.

use std::{num::NonZeroU64, sync::Mutex};

use super::{allowance::Allowance, credentials::Access};
use crate::lock::lock;

/// Lines that may be written at once.
const AT_ONCE: f64 = 100.0;
/// Lines a second that may be written in the long run: one in ten seconds.
const PER_SECOND: f64 = 0.1;

/// What may be written about viewers that may drive, and apart from that about those that watch,
/// who must not be able to keep the lines about the others out.
#[derive(Debug, Default)]
pub(super) struct ViewerLines {
    of_drivers: Mutex<Lines>,
    of_watchers: Mutex<Lines>,
}

#[derive(Debug)]
struct Lines {
    allowance: Allowance,
    left_out: u64,
}

impl Default for Lines {
    fn default() -> Self {
        Self { allowance: Allowance::new(AT_ONCE, PER_SECOND), left_out: 0 }
    }
}

impl ViewerLines {
    /// Takes room for a line: how many were left out since the one before. The error says that this
    /// one is left out too, and is counted.
    pub(super) fn take(&self, access: Access) -> Result<Option<NonZeroU64>, LeftOut> {
        let mut lines = lock(match access {
            Access::Drive => &self.of_drivers,
            Access::Watch => &self.of_watchers,
        });
        if lines.allowance.take(0) {
            Ok(NonZeroU64::new(std::mem::take(&mut lines.left_out)))
        } else {
            lines.left_out += 1;
            Err(LeftOut)
        }
    }
}

/// A line is not written.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct LeftOut;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn watchers_fill_neither_the_disk_nor_the_room_of_others() {
        let lines = ViewerLines::default();
        let written = (0..1000).filter(|_| lines.take(Access::Watch).is_ok()).count();
        // A busy machine may take some seconds for it.
        assert!((100..110).contains(&written), "{written}");
        assert_eq!(lines.take(Access::Drive), Ok(None));
        let left_out = lock(&lines.of_watchers).left_out;
        lock(&lines.of_watchers).allowance = Allowance::new(1.0, PER_SECOND);
        assert_eq!(lines.take(Access::Watch), Ok(NonZeroU64::new(left_out)));
        assert_eq!(lines.take(Access::Watch), Err(LeftOut));
    }
}
