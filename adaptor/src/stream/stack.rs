//! The stack of edits for viewers: they are told how many edits there are, and fetch those that they
//! do not have.

use std::sync::Arc;

use serde::{Deserialize, Serialize, de::IgnoredAny};
use serde_json::{Value, json};
use tombolo_deform::edit::Edit;

use super::text::Text;

/// Bytes of edits in one answer, but for an edit that is longer by itself.
const ANSWER: usize = 4 << 20;

/// Calls a visitor with the edits of a stack from one on, the oldest first, until it has enough.
pub(super) type Visit = dyn Fn(usize, &mut dyn FnMut(&Edit) -> bool) + Send + Sync;

/// The stack of edits as it is now.
#[derive(Clone, Default)]
pub(super) struct ReportedStack {
    revision: u64,
    edits: usize,
    undoable: usize,
    visit: Option<Arc<Visit>>,
}

/// A change of the stack that a viewer has yet to hear of.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct StackChange {
    revision: u64,
    edits: usize,
    /// So many edits are the same as before.
    kept: usize,
    /// So many orders can be taken back.
    undoable: usize,
}

impl StackChange {
    /// This change after another that was not sent.
    pub(super) fn after(self, earlier: Option<Self>) -> Self {
        let kept = earlier.map_or(self.kept, |earlier| earlier.kept.min(self.kept));
        Self { kept, ..self }
    }

    pub(super) fn text(self) -> Text {
        let Self { revision, edits, kept, undoable } = self;
        let stack =
            json!({"revision": revision, "edits": edits, "kept": kept, "undoable": undoable});
        Text::of(move || json!({ "stack": stack }))
    }

    /// What `hello` says of the stack that it leads to.
    pub(super) fn described(self) -> Value {
        let Self { revision, edits, undoable, .. } = self;
        json!({"revision": revision, "edits": edits, "undoable": undoable})
    }
}

impl ReportedStack {
    /// The stack after a change, and what viewers are told of it: so many edits, of which the first
    /// `kept` are those of before, and so many orders that can be taken back.
    pub(super) fn changed(
        &self,
        [edits, kept, undoable]: [usize; 3],
        visit: Arc<Visit>,
    ) -> (Self, StackChange) {
        let revision = self.revision + 1;
        let change = StackChange { revision, edits, kept, undoable };
        (Self { revision, edits, undoable, visit: Some(visit) }, change)
    }

    /// What the first `hello` says of it.
    pub(super) fn described(&self) -> Value {
        json!({"revision": self.revision, "edits": self.edits, "undoable": self.undoable})
    }

    /// The text that a recording has in place of what viewers are told: with the edits themselves,
    /// all of them, so that it needs no other.
    pub(super) fn whole(&self, change: Option<StackChange>) -> String {
        // It may have changed again since: nothing is known of how many are those of before, then.
        let change = change.filter(|change| change.revision == self.revision);
        let kept = change.map_or(0, |change| change.kept);
        let mut edits = Vec::with_capacity(self.edits);
        if let Some(visit) = &self.visit {
            visit(0, &mut |edit| {
                edits.push(edit.clone());
                true
            });
        }
        json!({"stack": WholeStack { kept, undoable: self.undoable, edits }}).to_string()
    }

    /// The edits from one on, as many as go into one answer.
    pub(super) fn answer(&self, from: usize) -> Answer {
        let (mut edits, mut bytes) = (Vec::new(), 0_usize);
        if let Some(visit) = &self.visit {
            visit(from, &mut |edit| {
                edits.push(edit.clone());
                bytes = bytes.saturating_add(edit.bytes());
                bytes < ANSWER
            });
        }
        Answer { revision: self.revision, count: self.edits, from, edits }
    }
}

/// The stack in a recording.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct WholeStack<E> {
    /// So many edits are the same as before.
    kept: usize,
    /// So many orders can be taken back.
    undoable: usize,
    edits: Vec<E>,
}

/// The text with the stack in a recording.
#[derive(Debug, Deserialize)]
struct Recorded<E> {
    stack: WholeStack<E>,
}

/// What viewers are told of a stack that was recorded. Its place in the recording is its revision.
pub(super) fn recorded_change(revision: u64, text: &str) -> serde_json::Result<StackChange> {
    let Recorded::<IgnoredAny> { stack } = serde_json::from_str(text)?;
    let WholeStack { kept, undoable, edits } = stack;
    Ok(StackChange { revision, edits: edits.len(), kept, undoable })
}

/// The edits of a stack that was recorded, from one on.
pub(super) fn recorded_edits(revision: u64, text: &str, from: usize) -> serde_json::Result<Answer> {
    let Recorded::<Edit> { stack } = serde_json::from_str(text)?;
    let WholeStack { undoable, edits, .. } = stack;
    let count = edits.len();
    let visit = move |from: usize, next: &mut dyn FnMut(&Edit) -> bool| {
        let _all = edits.iter().skip(from).all(next);
    };
    let stack = ReportedStack { revision, edits: count, undoable, visit: Some(Arc::new(visit)) };
    Ok(stack.answer(from))
}

/// A part of the stack.
#[derive(Serialize)]
pub(super) struct Answer {
    revision: u64,
    /// How many there are in all.
    count: usize,
    from: usize,
    edits: Vec<Edit>,
}
