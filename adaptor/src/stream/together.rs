//! What viewers have to do with each other: their names, the camera that they follow, their notes.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

use tombolo_pipelines::language::PinnedNote;

/// The names of viewers, who follows the one that drives, and the notes of the run.
#[derive(Default)]
pub(super) struct Together {
    pub(super) names: BTreeMap<u64, String>,
    pub(super) followers: BTreeSet<u64>,
    /// The oldest first.
    pub(super) notes: Arc<Vec<PinnedNote>>,
    /// The number of the newest note.
    pub(super) last_note: u64,
    /// Who is here has changed since it was told.
    pub(super) is_changed: bool,
}

impl Together {
    /// Has it told who is here.
    pub(super) fn changed(&mut self) {
        self.is_changed = true;
    }

    /// Forgets a viewer.
    pub(super) fn left(&mut self, client: u64) {
        self.names.remove(&client);
        self.followers.remove(&client);
        self.changed();
    }

    /// The name that a viewer has given itself.
    pub(super) fn called(&self, client: u64) -> Option<&str> {
        self.names.get(&client).map(String::as_str)
    }

    /// The notes, the oldest first.
    pub(super) fn notes(&self) -> Arc<Vec<PinnedNote>> {
        Arc::clone(&self.notes)
    }
}
