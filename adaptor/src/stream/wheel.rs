//! Who drives, and who may come back for the wheel.

use std::{
    collections::{BTreeSet, VecDeque},
    time::{Duration, Instant},
};

use super::{credentials::Access, secret::Secret};

/// How long the wheel is kept for a driver whose connection was lost.
pub(super) const WHEEL_KEPT: Duration = Duration::from_secs(3);
/// Viewers that have left and may come back under their names.
pub(super) const LEFT: usize = 64;

/// Who drives, and who has driven.
#[derive(Default)]
pub(super) struct Wheel {
    pub(super) driver: Option<u64>,
    /// When the driver last said anything.
    pub(super) heard: Option<Instant>,
    /// When the driver's connection was lost, and whose it was.
    pub(super) lost: Option<(Instant, u64)>,
    /// Those who have asked the driver for the wheel, and were not answered.
    pub(super) asking: BTreeSet<u64>,
    /// How long a driver may be silent.
    pub(super) silence: Duration,
    /// Clients that have left, the oldest first.
    pub(super) left: VecDeque<(u64, Secret, Access)>,
    last: u64,
}

impl Wheel {
    pub(super) fn driver(&self) -> Option<u64> {
        self.driver
    }

    /// A name that nobody had, and what its owner comes back with.
    pub(super) fn stranger(&mut self) -> Result<(u64, Secret), getrandom::Error> {
        let back = Secret::random()?;
        self.last += 1;
        Ok((self.last, back))
    }

    pub(super) fn is_free(&self) -> bool {
        self.driver.is_none() && self.lost.is_none_or(|(at, _)| at.elapsed() >= WHEEL_KEPT)
    }

    pub(super) fn is_silent(&self) -> bool {
        self.heard.is_none_or(|at| at.elapsed() >= self.silence)
    }
}
