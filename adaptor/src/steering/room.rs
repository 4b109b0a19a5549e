//! Room for the commands that wait, counted from when one comes in until its turn has come.

use std::{
    sync::{Arc, Mutex},
    time::{Duration, Instant},
};

use tombolo_pipelines::{
    language::{Command, StreamLimits},
    limits::{Exceeded, Limit},
};

use crate::lock::lock;

/// Whether a run must hear a command also where the journal cannot be written, or much else waits.
pub(super) fn is_urgent(command: &Command) -> bool {
    matches!(
        command,
        Command::Pause {} | Command::Resume {} | Command::Stop {} | Command::Cancel(_)
    )
}

/// Room for so many commands, and so many bytes of them.
#[derive(Debug)]
pub(crate) struct Room {
    taken: Mutex<Taken>,
    commands: Limit,
    bytes: Limit,
}

#[derive(Debug, Default)]
struct Taken {
    commands: usize,
    bytes: usize,
}

impl Room {
    pub(super) fn new(limits: &StreamLimits) -> Self {
        let (commands, bytes) = (limits.pending(), limits.pending_bytes());
        Self { taken: Mutex::default(), commands, bytes }
    }

    /// Takes room for one more command, until the reservation is dropped.
    ///
    /// # Errors
    /// [`Exceeded`] where there is none.
    pub(crate) fn reserve(self: &Arc<Self>, bytes: usize) -> Result<Reservation, Exceeded> {
        let mut taken = lock(&self.taken);
        self.commands.check(taken.commands + 1)?;
        self.bytes.check(taken.bytes.saturating_add(bytes))?;
        taken.commands += 1;
        taken.bytes += bytes;
        Ok(Reservation { room: Arc::clone(self), bytes, since: Instant::now() })
    }
}

/// The room that one command takes, wherever it waits.
#[derive(Debug)]
pub(crate) struct Reservation {
    room: Arc<Room>,
    bytes: usize,
    since: Instant,
}

impl Reservation {
    /// Counts from now on how long it waits.
    pub(crate) fn renew(&mut self) {
        self.since = Instant::now();
    }

    /// How long it has waited.
    pub(crate) fn age(&self) -> Duration {
        self.since.elapsed()
    }
}

impl Drop for Reservation {
    fn drop(&mut self) {
        let mut taken = lock(&self.room.taken);
        taken.commands -= 1;
        taken.bytes -= self.bytes;
    }
}

#[cfg(test)]
mod tests {
    use tombolo_pipelines::limits::{PENDING, PENDING_BYTES};

    use super::*;

    #[test]
    fn as_much_waits_as_the_settings_say() {
        let limits = serde_json::from_str(r#"{"waiting": 2, "waiting_megabytes": 1}"#).unwrap();
        let room = Arc::new(Room::new(&limits));
        let first = room.reserve(1).unwrap();
        assert_eq!(room.reserve(1 << 20).unwrap_err().limit.most, 1 << 20);
        let _second = room.reserve(1).unwrap();
        assert_eq!(room.reserve(1).unwrap_err().limit.most, 2);
        drop(first);
        assert!(room.reserve(1).is_ok());
    }

    #[test]
    fn room_is_taken_until_it_is_given_back() {
        let room = Arc::new(Room::new(&StreamLimits::default()));
        let mut taken: Vec<_> = (0..PENDING.most).map(|_| room.reserve(1).unwrap()).collect();
        assert_eq!(room.reserve(1).unwrap_err(), PENDING.check(PENDING.most + 1).unwrap_err());
        taken.truncate(1);
        let rest = room.reserve(PENDING_BYTES.most - 1).unwrap();
        assert_eq!(
            room.reserve(1).unwrap_err(),
            PENDING_BYTES.check(PENDING_BYTES.most + 1).unwrap_err()
        );
        drop(rest);
        assert!(room.reserve(PENDING_BYTES.most).is_err());
        drop(taken);
        assert!(room.reserve(PENDING_BYTES.most).is_ok());
    }
}
