//! Refusals, told with who and what, and seldom enough that nobody fills a log with them.

use std::{
    collections::HashMap,
    net::IpAddr,
    sync::{Arc, Mutex},
    time::{Duration, Instant},
};

use crate::lock::lock;

/// How long nothing more like it is told of an address once a refusal of it was.
const QUIET: Duration = Duration::from_secs(60);
/// Addresses and kinds of refusals that are remembered; of others nothing is told meanwhile.
const KNOWN: usize = 256;

/// Why something was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Refused {
    /// A request without a right secret.
    Secret,
    /// A request that came by another name or page.
    Foreign,
    /// Connections without a secret.
    Crowd,
    /// A request that never ended.
    Slow,
    /// Messages.
    Flood,
    /// A message.
    Long,
    /// A command.
    Command,
}

impl Refused {
    fn reason(self) -> &'static str {
        match self {
            Self::Secret => "it showed no secret that is known here",
            Self::Foreign => "it came under a foreign name or from a page of another site",
            Self::Crowd => "too many connections at once have shown no secret",
            Self::Slow => "it began a request and did not end it in time",
            Self::Flood => "it sends more messages than it may",
            Self::Long => "it is longer than it may be",
            Self::Command => "this viewer does not drive",
        }
    }
}

/// The refusals of a run, or of a relay, that were told of late.
#[derive(Debug, Default)]
pub(super) struct Refusals {
    run: Option<Arc<str>>,
    told: Mutex<HashMap<(IpAddr, Refused), Instant>>,
}

impl Refusals {
    /// Those of the run of a number.
    pub(super) fn of_run(run: Option<&str>) -> Self {
        Self { run: run.map(Arc::from), ..Self::default() }
    }

    /// Tells a refusal, unless one like it was told of this address within a minute; whether it did.
    /// `what` says what became of what, and which viewer's it was, where it was one's.
    pub(super) fn tell(
        &self,
        address: IpAddr,
        refused: Refused,
        viewer: Option<&str>,
        what: impl FnOnce() -> String,
    ) -> bool {
        if !self.is_new(address, refused) {
            return false;
        }
        let (run, reason, what) = (self.run.as_deref(), refused.reason(), what());
        if refused == Refused::Slow {
            // Browsers connect beforehand, and then may ask nothing.
            tracing::info!(run, %address, reason, "{what}: {reason}");
        } else {
            tracing::warn!(run, %address, viewer, reason, "{what}: {reason}");
        }
        true
    }

    fn is_new(&self, address: IpAddr, refused: Refused) -> bool {
        let mut told = lock(&self.told);
        told.retain(|_, at| at.elapsed() < QUIET);
        let is_new = !told.contains_key(&(address, refused)) && told.len() < KNOWN;
        if is_new {
            told.insert((address, refused), Instant::now());
        }
        is_new
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refusals_are_told_once_for_each_address_and_kind() {
        let refusals = Refusals::default();
        let address = |last: u32| IpAddr::from((0x0a00_0000 + last).to_be_bytes());
        let tell = |last, refused| refusals.tell(address(last), refused, None, String::new);
        assert!(tell(1, Refused::Secret) && !tell(1, Refused::Secret));
        assert!(tell(1, Refused::Flood) && tell(2, Refused::Secret));
        assert!((0..1000).filter(|&last| tell(last, Refused::Secret)).count() < KNOWN);
    }
}
