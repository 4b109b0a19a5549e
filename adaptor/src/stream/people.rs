//! Viewers give themselves names, follow the one that drives, and pin notes.

use std::sync::Arc;

use serde_json::{Value, json};
use tombolo_pipelines::{
    language::{CameraStand, NewNote, PinnedNote, UnpinnedNote},
    limits::NOTES,
};

use super::{
    credentials::Access,
    hub::{Hub, HubState, name},
    text::Text,
};
use crate::lock::lock;

/// Said by the solver's side.
impl Hub {
    /// Goes on with the notes of an earlier run.
    pub(crate) fn resume_notes(&self, notes: Vec<PinnedNote>) {
        let together = &mut lock(&self.state).together;
        together.last_note = notes.iter().map(|note| note.number).max().unwrap_or(0);
        together.notes = Arc::new(notes);
    }
}

/// Done on the stream's thread.
impl Hub {
    /// The name that a viewer has given itself.
    pub(super) fn called(&self, client: u64) -> Option<String> {
        lock(&self.state).together.called(client).map(str::to_owned)
    }

    /// Gives a viewer a name; an empty one takes it away.
    pub(super) fn call(&self, client: u64, called: &str) {
        let together = &mut lock(&self.state).together;
        let before = if called.is_empty() {
            together.names.remove(&client)
        } else {
            together.names.insert(client, called.to_owned())
        };
        // A name that has not changed is told to nobody.
        if before.as_deref().unwrap_or_default() != called {
            together.changed();
        }
    }

    /// Has a viewer sent the camera of the one that drives, or not any more.
    pub(super) fn follow(&self, client: u64, follows: bool) {
        let together = &mut lock(&self.state).together;
        let is_new = if follows {
            together.followers.insert(client)
        } else {
            together.followers.remove(&client)
        };
        if is_new {
            together.changed();
        }
    }

    /// Shows the camera of the one that drives to those who follow it; the error says why not.
    pub(super) fn show_camera(&self, client: u64, camera: CameraStand) -> Result<(), String> {
        let state = lock(&self.state);
        if state.wheel.driver() != Some(client) {
            return Err("the camera of the one that drives is followed, and no other".into());
        }
        let text = Text::of(move || json!({ "camera": camera }));
        for follower in state.followers() {
            if let Some(follower) = state.clients.get(&follower) {
                follower.camera(&text);
            }
        }
        Ok(())
    }

    /// Pins a note of a viewer, and has it told; the error says why not.
    pub(super) fn pin(&self, client: u64, note: NewNote) -> Result<PinnedNote, String> {
        let now = self.clock.get().cycle;
        let mut state = lock(&self.state);
        state.check_journal()?;
        let together = &mut state.together;
        NOTES.check(together.notes.len() + 1).map_err(|exceeded| {
            format!("{exceeded}; one that is not needed any more can be taken away")
        })?;
        together.last_note += 1;
        let pinned = PinnedNote {
            number: together.last_note,
            text: note.text.trim().to_owned(),
            at: note.at,
            cycle: note.cycle.unwrap_or(now),
            by: together.called(client).map_or_else(|| name(client), str::to_owned),
        };
        Arc::make_mut(&mut together.notes).push(pinned.clone());
        state.tell_note("note", json!(pinned));
        Ok(pinned)
    }

    /// Takes a note away, and has it told; the error says why not.
    pub(super) fn unpin(&self, number: u64) -> Result<UnpinnedNote, String> {
        let mut state = lock(&self.state);
        state.check_journal()?;
        let notes = &mut state.together.notes;
        let found = notes.iter().position(|note| note.number == number);
        let found = found.ok_or_else(|| format!("there is no note {number}"))?;
        Arc::make_mut(notes).remove(found);
        let unpinned = UnpinnedNote { number };
        state.tell_note("note_removed", json!(unpinned));
        Ok(unpinned)
    }

    /// Tells every viewer who is here, and the driver how many follow it, where that has changed.
    /// Called a few times a second.
    pub(super) fn people(&self) {
        let mut state = lock(&self.state);
        if !std::mem::take(&mut state.together.is_changed) {
            return;
        }
        let driver = state.wheel.driver();
        let viewers = state.clients.values().map(|client| {
            let role = if driver == Some(client.id) { "driver" } else { "watcher" };
            json!({"client": name(client.id), "name": state.together.called(client.id),
                   "role": role, "may_drive": client.access == Access::Drive})
        });
        let viewers: Vec<Value> = viewers.collect();
        state.tell_viewers("people", json!({ "viewers": viewers }));
        let Some(driver) = driver else { return };
        let followed = state.followers().count();
        // It sends its camera for it, also where it has sent it to others before.
        if let Some(client) = state.clients.get(&driver) {
            client.text(&Text::of(move || json!({"followed": {"by": followed}})));
        }
    }
}

impl HubState {
    /// Those who follow the one that drives.
    fn followers(&self) -> impl Iterator<Item = u64> {
        let driver = self.wheel.driver();
        self.together.followers.iter().copied().filter(move |&client| driver != Some(client))
    }

    fn tell_viewers(&self, kind: &'static str, body: Value) {
        let text = Text::of(move || json!({ kind: body }));
        self.clients.values().for_each(|client| client.text(&text));
    }

    fn tell_note(&self, kind: &'static str, body: Value) {
        self.tell_viewers(kind, body);
        // A recording has all notes in each description of the run, so that any moment of it shows
        // those of that moment.
        self.observer.iter().for_each(|observer| observer.greet());
    }

    /// The error says why nothing is taken that the journal is to hold.
    fn check_journal(&self) -> Result<(), String> {
        match &self.journal_lost {
            None => Ok(()),
            Some(reason) => Err(format!(
                "it was not taken, because the journal cannot be written: {reason}; try again once it can"
            )),
        }
    }
}
