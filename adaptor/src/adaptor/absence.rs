//! What a run does by itself when its people are gone.

use std::{
    sync::Mutex,
    time::{Duration, Instant},
};

use tombolo_pipelines::language::{Command, Steering, Unwatched};

use crate::{lock::lock, stream::Hub};

/// Since when people are gone, and how long the run waits for them.
pub(super) struct Absence {
    /// Of those who could resume the run while it is paused.
    of_drivers: Option<Duration>,
    /// Of all who watch.
    of_viewers: Option<Unwatched>,
    /// Whether the run waits for its first viewer, so that until one has come there is nothing to pause.
    waits_for_first: bool,
    since: Mutex<Since>,
}

struct Since {
    /// Since when the run is paused and nobody is there who could resume it.
    drivers: Option<Instant>,
    /// Since when nobody watches, and how many viewers had come by then.
    viewers: (Instant, u64),
    /// Whether what is to become of a run that nobody watches was asked for.
    has_asked: bool,
}

impl Absence {
    /// Begins to count. What becomes of a replay is in its journal.
    pub(super) fn new(steering: &Steering, is_replay: bool) -> Self {
        let since = Since { drivers: None, viewers: (Instant::now(), 0), has_asked: false };
        Self {
            of_drivers: steering.resume_after.map(|after| seconds(after.get())),
            of_viewers: steering.unwatched.filter(|_| !is_replay),
            waits_for_first: steering.wait_for_viewer,
            since: Mutex::new(since),
        }
    }

    /// How long nobody was there who could resume a paused run, once that is long enough.
    pub(super) fn of_drivers(&self, hub: &Hub) -> Option<Duration> {
        let patience = self.of_drivers?;
        let since = &mut lock(&self.since).drivers;
        if !hub.is_paused_alone() {
            *since = None;
            return None;
        }
        if since.get_or_insert_with(Instant::now).elapsed() < patience {
            return None;
        }
        *since = None;
        Some(patience)
    }

    /// The command for a run that nobody has watched for long enough, and how long that is; given once.
    pub(super) fn of_viewers(&self, hub: &Hub) -> Option<(Duration, Command)> {
        let (patience, command) = match self.of_viewers? {
            Unwatched::PauseAfter(after) => (after, Command::Pause {}),
            Unwatched::StopAfter(after) => (after, Command::Stop {}),
        };
        let (patience, mut since) = (seconds(patience.get()), lock(&self.since));
        // One who has come and gone between two looks was there too.
        let arrivals = hub.arrivals();
        if hub.has_viewers() || since.viewers.1 != arrivals {
            since.viewers = (Instant::now(), arrivals);
            since.has_asked = false;
        }
        if since.has_asked || since.viewers.0.elapsed() < patience {
            return None;
        }
        since.has_asked = true;
        let waits = hub.is_paused() || self.waits_for_first && arrivals == 0;
        let is_news = !waits || !matches!(command, Command::Pause {});
        is_news.then_some((patience, command))
    }
}

fn seconds(seconds: u32) -> Duration {
    Duration::from_secs(seconds.into())
}
