//! Room for the commands that wait, counted from when one comes in until its turn has come.

use std::{
    sync::{Arc, Mutex},
    time::{Duration, Instant},
};

use tombolo_pipelines::{
    language::Command,
    limits::{Exceeded, PENDING, PENDING_BYTES},
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
#[derive(Debug, Default)]
pub(crate) struct Room(Mutex<Taken>);

#[derive(Debug, Default)]
struct Taken {
    commands: usize,
    bytes: usize,
}

impl Room {
    /// Takes room for one more command, until the reservation is dropped.
    ///
    /// # Errors
    /// [`Exceeded`] where there is none.
    pub(crate) fn reserve(self: &Arc<Self>, bytes: usize) -> Result<Reservation, Exceeded> {
        let mut taken = lock(&self.0);
        PENDING.check(taken.commands + 1)?;
        PENDING_BYTES.check(taken.bytes.saturating_add(bytes))?;
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
        let mut taken = lock(&self.room.0);
        taken.commands -= 1;
        taken.bytes -= self.bytes;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn room_is_taken_until_it_is_given_back() {
        let room = Arc::<Room>::default();
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
