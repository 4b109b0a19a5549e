//! The stack of edits, order by order, so that orders can be taken back.

use std::{num::NonZeroU32, sync::Arc};

use serde::{Deserialize, Serialize};
use tombolo_deform::{edit::Edit, quality::Guard, shape::check_stack};
use tombolo_pipelines::{
    language::{Change, Deformation},
    limits::{Exceeded, ORDERS, ORDERS_BYTES},
};

/// The change that one order made to the stack.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Entry {
    replaces: bool,
    edits: Vec<Edit>,
    /// About how much memory the edits take.
    bytes: usize,
    settings: ShapeSettings,
}

/// The settings that the shape of a stack depends on besides its edits.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct ShapeSettings {
    pub(crate) deform: Deformation,
    pub(crate) guard: Guard,
}

/// The edits that make the present shape, and how they came there.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct EditStack {
    entries: Vec<Arc<Entry>>,
}

/// Why an order makes no stack.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub(crate) enum StackError {
    #[error("undo {wanted}: {}", if *held == 0 { "there is no order to take back".into() } else { format!("only {held} order(s) can be taken back") })]
    Undo { wanted: u32, held: usize },
    #[error("stack: {0}")]
    Full(#[from] Exceeded),
}

impl EditStack {
    /// The stack after an order, and the settings that its shape is made with: the order's own,
    /// else for an undo those that the shape it goes back to was made with (so that the same bits
    /// come back), else `default`.
    pub(crate) fn after(
        &self,
        change: &Change,
        deform: Option<&Deformation>,
        guard: Option<Guard>,
        default: &ShapeSettings,
    ) -> Result<(Self, ShapeSettings), StackError> {
        let mut entries = self.entries.clone();
        let own = |before: &ShapeSettings| ShapeSettings {
            deform: deform.unwrap_or(&before.deform).clone(),
            guard: guard.unwrap_or(before.guard),
        };
        match change {
            Change::Edits(edits) | Change::Stack(edits) => entries.push(Arc::new(Entry {
                replaces: matches!(change, Change::Stack(_)),
                edits: edits.clone(),
                bytes: edits.iter().map(Edit::bytes).fold(0, usize::saturating_add),
                settings: own(default),
            })),
            Change::Undo(count) => {
                let kept = kept_after(entries.len(), *count)?;
                entries.truncate(kept);
            }
        }
        let settings = own(entries.last().map_or(default, |entry| &entry.settings));
        let stack = Self { entries };
        ORDERS.check(stack.entries.len())?;
        ORDERS_BYTES.check(stack.entries.iter().map(|entry| entry.bytes).sum())?;
        check_stack(stack.present())?;
        Ok((stack, settings))
    }

    /// How many edits it begins with that `other` begins with too.
    pub(crate) fn shared(&self, other: &Self) -> usize {
        self.present()
            .zip(other.present())
            .take_while(|(a, b)| std::ptr::eq(*a, *b) || a == b)
            .count()
    }

    /// The stack with a fraction of the last order's edits, those after the first `kept` edits of
    /// the stack.
    pub(crate) fn clamped(mut self, kept: usize, fraction: f64) -> Self {
        let count = self.count();
        if let Some(last) = self.entries.last_mut().map(Arc::make_mut) {
            let before = count - last.edits.len();
            for (index, edit) in last.edits.iter_mut().enumerate() {
                if before + index >= kept {
                    *edit = edit.scaled(fraction);
                }
            }
        }
        self
    }

    /// How many orders made it: so many can be taken back.
    pub(crate) fn orders(&self) -> usize {
        self.entries.len()
    }

    /// The edits, the oldest first.
    pub(crate) fn edits(&self) -> Vec<Edit> {
        self.present().cloned().collect()
    }

    /// How many edits there are.
    pub(crate) fn count(&self) -> usize {
        self.present().count()
    }

    pub(crate) fn present(&self) -> impl Iterator<Item = &Edit> {
        let from = self.entries.iter().rposition(|entry| entry.replaces).unwrap_or(0);
        self.entries.iter().skip(from).flat_map(|entry| &entry.edits)
    }
}

fn kept_after(held: usize, count: NonZeroU32) -> Result<usize, StackError> {
    held.checked_sub(count.get() as usize).ok_or(StackError::Undo { wanted: count.get(), held })
}

#[cfg(test)]
mod tests {
    use tombolo_deform::quality::Otherwise;
    use tombolo_pipelines::limits::EDITS;

    use super::*;

    fn edit(x: f64) -> Edit {
        serde_json::from_value(
            serde_json::json!({"translate": {"features": ["a"], "by": [x, 0.0, 0.0]}}),
        )
        .unwrap()
    }

    fn after(stack: &EditStack, change: Change) -> EditStack {
        stack.after(&change, None, None, &ShapeSettings::default()).unwrap().0
    }

    fn undo(count: u32) -> Change {
        Change::Undo(NonZeroU32::new(count).unwrap())
    }

    #[test]
    fn orders_are_taken_back_one_by_one() {
        let none = EditStack::default();
        let one = after(&none, Change::Edits(vec![edit(1.0), edit(2.0)]));
        let two = after(&one, Change::Edits(vec![edit(3.0)]));
        let replaced = after(&two, Change::Stack(vec![edit(4.0)]));
        let more = after(&replaced, Change::Edits(vec![edit(5.0)]));
        assert_eq!(two.edits(), [edit(1.0), edit(2.0), edit(3.0)]);
        assert_eq!(more.edits(), [edit(4.0), edit(5.0)]);
        assert_eq!(after(&more, undo(1)), replaced);
        assert_eq!(after(&more, undo(2)), two);
        assert_eq!(after(&more, undo(4)), none);
        let error = more.after(&undo(5), None, None, &ShapeSettings::default()).unwrap_err();
        assert!(error.to_string().contains("only 4"), "{error}");
    }

    #[test]
    fn an_undo_deforms_as_the_shape_it_goes_back_to() {
        let stiff = Deformation { sliding: vec!["a".into()], ..Deformation::default() };
        let mending = Guard { otherwise: Otherwise::Untangle, ..Guard::default() };
        let none = EditStack::default();
        let default = ShapeSettings::default();
        let (one, _) = none
            .after(&Change::Edits(vec![edit(1.0)]), Some(&stiff), Some(mending), &default)
            .unwrap();
        let two = after(&one, Change::Edits(vec![edit(2.0)]));
        let settings = ShapeSettings { deform: stiff, guard: mending };
        assert_eq!(two.after(&undo(1), None, None, &default).unwrap(), (one, settings));
    }

    #[test]
    fn only_what_an_order_brought_is_clamped() {
        let one = after(&EditStack::default(), Change::Edits(vec![edit(1.0)]));
        let two = after(&one, Change::Edits(vec![edit(2.0), edit(4.0)]));
        assert_eq!(
            (one.shared(&two), two.clone().clamped(1, 0.5).edits()),
            (1, vec![edit(1.0), edit(1.0), edit(2.0)])
        );
        let replaced = after(&two, Change::Stack(vec![edit(1.0), edit(2.0), edit(8.0)]));
        assert_eq!(two.shared(&replaced), 2);
        assert_eq!(replaced.clamped(2, 0.25).edits(), [edit(1.0), edit(2.0), edit(2.0)]);
    }

    /// Whole stacks that replace one another are all kept, because undo goes back to them.
    #[test]
    fn what_was_replaced_counts_too() {
        let long: Edit = serde_json::from_value(serde_json::json!({"displacement": {
            "vertices": (0..100_000).collect::<Vec<u32>>(), "values": vec![[0.0, 0.0, 1.0]; 100_000]}}))
        .unwrap();
        let bytes = long.bytes();
        assert!(bytes > 2_800_000 && bytes < 2_802_000, "{bytes}");
        let replace = Change::Stack(vec![long]);
        let mut stack = EditStack::default();
        let refused = loop {
            match stack.after(&replace, None, None, &ShapeSettings::default()) {
                Ok((after, _)) => stack = after,
                Err(refused) => break refused,
            }
        };
        assert_eq!(stack.entries.len(), ORDERS_BYTES.most / bytes);
        assert!(refused.to_string().contains("bytes of edits"), "{refused}");
        assert_eq!(after(&stack, undo(1)).entries.len(), stack.entries.len() - 1);
    }

    #[test]
    fn a_stack_does_not_grow_without_end() {
        let edits = vec![edit(1.0); EDITS.most + 1];
        assert!(
            EditStack::default()
                .after(&Change::Edits(edits), None, None, &ShapeSettings::default())
                .is_err()
        );
    }
}
