//! How much may be said in how much time.

use std::time::Instant;

use tombolo_pipelines::language::StreamLimits;

/// Bytes of a message that count as one more.
pub(super) const WEIGHT: usize = 1 << 20;

/// A bucket that fills at a rate up to what may be said at once, and that each message takes one
/// from, and one more for each [`WEIGHT`] of it. Whoever shows the same secret or cookie shares one, so
/// that a new connection is no way around it.
#[derive(Debug)]
pub(super) struct Allowance {
    burst: f64,
    /// How fast the bucket fills, in messages a second.
    rate: f64,
    left: f64,
    since: Instant,
}

impl Allowance {
    /// The one for the messages of viewers.
    pub(super) fn of_messages(limits: &StreamLimits) -> Self {
        Self::new(limits.messages_at_once.get().into(), limits.messages.get().into())
    }

    pub(super) fn new(burst: f64, rate: f64) -> Self {
        Self { burst, rate, left: burst, since: Instant::now() }
    }

    pub(super) fn take(&mut self, bytes: usize) -> bool {
        let now = Instant::now();
        let gained = self.rate * now.duration_since(self.since).as_secs_f64();
        self.left = (self.left + gained).min(self.burst);
        self.since = now;
        if self.left < 1.0 {
            return false;
        }
        #[expect(clippy::cast_precision_loss, reason = "few")]
        let weight = 1.0 + (bytes / WEIGHT) as f64;
        // A long message is taken at once, and paid for by a wait after it.
        self.left -= weight;
        true
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn a_flood_is_held_back() {
        let mut allowance = Allowance::of_messages(&StreamLimits::default());
        let begun = allowance.since;
        let taken = (0..1000).filter(|_| allowance.take(100)).count();
        // As many more as have come in since, on however busy a machine.
        let since = allowance.since.duration_since(begun).as_secs_f64();
        assert!(taken >= 40 && taken as f64 <= 41.0 + 20.0 * since, "{taken} in {since} s");
    }

    #[test]
    fn a_long_message_is_taken_and_paid_for() {
        let mut allowance = Allowance {
            left: 1.0,
            since: Instant::now() + Duration::from_secs(3600),
            ..Allowance::new(40.0, 20.0)
        };
        assert!(allowance.take(100 * WEIGHT));
        assert!(!allowance.take(0) && allowance.left < -90.0);
    }
}
