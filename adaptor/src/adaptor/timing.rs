//! Where the time went.

use std::{collections::BTreeMap, time::Instant};

use crate::report::{Durations, Spread};

/// Where the time of a run went.
pub(super) struct Timing {
    pub(super) begun: Instant,
    pub(super) cycles: u64,
    /// When the last call ended.
    pub(super) left: Option<Instant>,
    pub(super) steps: Durations,
    pub(super) execute: Durations,
    pub(super) reference: Durations,
    pub(super) pipelines: Durations,
    pub(super) steering: Durations,
    pub(super) paused: Durations,
}

impl Default for Timing {
    fn default() -> Self {
        Self {
            begun: Instant::now(),
            cycles: 0,
            left: None,
            steps: Durations::default(),
            execute: Durations::default(),
            reference: Durations::default(),
            pipelines: Durations::default(),
            steering: Durations::default(),
            paused: Durations::default(),
        }
    }
}

impl Timing {
    /// The time spent in the adaptor, by part.
    pub(super) fn parts(&self) -> BTreeMap<&'static str, Spread> {
        let parts = [
            ("execute", &self.execute),
            ("reference", &self.reference),
            ("pipelines", &self.pipelines),
            ("steering", &self.steering),
            ("paused", &self.paused),
        ];
        parts.into_iter().map(|(name, durations)| (name, durations.spread())).collect()
    }
}
