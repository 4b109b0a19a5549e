//! The commands of a run that are kept, by their names.

use std::{
    collections::{HashMap, HashSet, VecDeque},
    sync::Arc,
};

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use tombolo_deform::edit::Edit;
use tombolo_pipelines::language::{Command, Order};

use super::order_report::{ORDERS_KEPT, OrderReport, OrderStatus};
use crate::fingerprint::hash;

/// Orders that a viewer is told of when it connects.
const ORDERS_TOLD: usize = 100;
/// Bytes of JSON up to which an order itself is told too; a longer one holds the numbers of a
/// displacement.
const TOLD_WHOLE: usize = 16 << 10;

/// The reason of an order that waits for no other order.
pub(super) const NEXT_CALL: &str = "the solver's next call";

/// The commands that were given, as far as they are kept.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct KnownCommands {
    orders: VecDeque<OrderReport>,
    /// The newest orders as they were given, by their names, but for long ones.
    given: VecDeque<(String, Arc<Order>)>,
    /// The answers to the newest of the other commands.
    outcomes: VecDeque<(String, Value)>,
    /// The names that are taken, with hashes of what viewers have asked for under them; oldest first in
    /// `named`.
    names: HashMap<String, Option<u64>>,
    named: VecDeque<String>,
    /// The names of commands that were given beforehand and whose turn has not come.
    #[serde(skip)]
    expected: HashSet<String>,
    counted: u64,
}

/// An order's report, and what was asked for where it is not long.
pub(super) struct KnownOrder {
    pub(super) report: OrderReport,
    pub(super) given: Option<Arc<Order>>,
}

impl KnownOrder {
    /// The order as viewers see it, in JSON.
    pub(super) fn told(&self) -> Value {
        let mut told = json!(self.report);
        if let Some(given) = self.given.as_ref().and_then(|given| told_whole(given)) {
            told["order"] = given;
        }
        told
    }
}

/// A name for a command.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Named {
    /// It is a new command.
    New(String),
    /// The same command came before under this name.
    Again(String),
}

impl KnownCommands {
    /// Gives a command a name: the one that is wanted, or a new one. `digest` is the [hash](hash_of) of
    /// a viewer's, who may send it again.
    ///
    /// # Errors
    /// Where another command has that name already.
    pub(super) fn name(
        &mut self,
        wanted: Option<String>,
        digest: Option<u64>,
    ) -> Result<Named, String> {
        let id = match wanted {
            Some(id) => match self.names.get(&id) {
                Some(known) if known.is_some() && *known == digest => return Ok(Named::Again(id)),
                None if !self.expected.contains(&id) => id,
                _ => return Err(format!("the id '{id}' was given to another command")),
            },
            None => self.next_id(),
        };
        if self.named.len() >= 2 * ORDERS_KEPT
            && let Some(oldest) = self.named.pop_front()
        {
            self.names.remove(&oldest);
        }
        self.names.insert(id.clone(), digest);
        self.named.push_back(id.clone());
        Ok(Named::New(id))
    }

    /// Keeps the name of a command of an earlier run from others, but for the viewer that sends it
    /// again; whether it is an order that is known.
    pub(super) fn reserve(&mut self, id: &str, digest: u64) -> bool {
        if !self.names.contains_key(id) {
            self.names.insert(id.to_owned(), Some(digest));
            self.named.push_back(id.to_owned());
        }
        self.order(id).is_some()
    }

    /// Keeps a name, unless it is taken, for a command that will come at its moment.
    pub(super) fn expect(&mut self, id: &str) {
        if !self.names.contains_key(id) {
            self.expected.insert(id.to_owned());
        }
    }

    /// Lets the command have its name for which it was kept.
    pub(super) fn has_come(&mut self, id: &str) {
        self.expected.remove(id);
    }

    /// Whether the name was given to a command and no order of that name is kept.
    pub(super) fn is_only_named(&self, id: &str) -> bool {
        self.names.contains_key(id) && self.order(id).is_none()
    }

    /// Lets go of the name of a command that was not taken.
    pub(super) fn forget(&mut self, id: &str) {
        self.names.remove(id);
        self.named.retain(|named| named != id);
    }

    /// Notes an order, and what it asks for.
    pub(super) fn add(&mut self, id: &str, order: &Order, cycle: u64) {
        if self.given.len() >= ORDERS_TOLD {
            self.given.pop_front();
        }
        let bytes = order.edits().iter().map(Edit::bytes).fold(0, usize::saturating_add);
        if bytes <= TOLD_WHOLE {
            self.given.push_back((id.to_owned(), Arc::new(order.clone())));
        }
        if self.orders.len() >= ORDERS_KEPT {
            self.orders.pop_front();
        }
        self.orders.push_back(OrderReport {
            id: id.to_owned(),
            cycle_accepted: cycle,
            waits_for: Some(NEXT_CALL.into()),
            ..OrderReport::default()
        });
    }

    /// Notes what the sender of a command that is no order was told.
    pub(super) fn settle(&mut self, id: &str, told: Value) {
        if self.outcomes.len() >= ORDERS_KEPT {
            self.outcomes.pop_front();
        }
        self.outcomes.push_back((id.to_owned(), told));
    }

    /// The answer to a command, as a message for a viewer; `None` where there is none yet.
    pub(super) fn outcome(&self, id: &str) -> Option<impl FnOnce() -> Value + Send + use<>> {
        let order = self.known(id);
        let outcome = self.outcomes.iter().rev().find(|known| known.0 == id).map(|it| it.1.clone());
        let is_known = order.is_some() || outcome.is_some();
        is_known.then_some(move || match order {
            Some(order) => json!({"order": order.told()}),
            None => outcome.unwrap_or_default(),
        })
    }

    pub(super) fn order(&self, id: &str) -> Option<&OrderReport> {
        self.orders.iter().rev().find(|order| order.id == id)
    }

    pub(super) fn order_mut(&mut self, id: &str) -> Option<&mut OrderReport> {
        self.orders.iter_mut().rev().find(|order| order.id == id)
    }

    /// An order by its name, with what it asks for.
    pub(super) fn known(&self, id: &str) -> Option<KnownOrder> {
        self.order(id).map(|order| self.with_given(order))
    }

    fn with_given(&self, order: &OrderReport) -> KnownOrder {
        let given = self.given.iter().rev().find(|(id, _)| *id == order.id);
        KnownOrder { report: order.clone(), given: given.map(|(_, given)| Arc::clone(given)) }
    }

    /// The newest orders, for a viewer that connects.
    pub(super) fn newest(&self) -> Vec<KnownOrder> {
        let skipped = self.orders.len().saturating_sub(ORDERS_TOLD);
        self.orders.iter().skip(skipped).map(|order| self.with_given(order)).collect()
    }

    /// How many of the orders have come to which state.
    pub(super) fn counts(&self) -> Vec<(&'static str, usize)> {
        let count = |status| self.orders.iter().filter(|order| order.status == status).count();
        OrderStatus::ALL.map(|status| (status.name(), count(status))).into()
    }

    pub(super) fn reports(&self) -> Vec<OrderReport> {
        self.orders.iter().cloned().collect()
    }

    fn next_id(&mut self) -> String {
        loop {
            self.counted += 1;
            let id = format!("o{}", self.counted);
            if !self.names.contains_key(&id) && !self.expected.contains(&id) {
                return id;
            }
        }
    }
}

/// A hash by which commands of one name are told apart.
pub(super) fn hash_of(command: &Command) -> u64 {
    hash(serde_json::to_vec(command).unwrap_or_default())
}

/// An order as JSON, unless it is long; of a long one no more is written than it takes to find that
/// out.
fn told_whole(order: &Order) -> Option<Value> {
    let mut bytes = [0; TOLD_WHOLE];
    let mut rest = &mut bytes[..];
    serde_json::to_writer(&mut rest, order).ok()?;
    let written = TOLD_WHOLE - rest.len();
    serde_json::from_slice(&bytes[..written]).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_command_again_is_known_and_another_of_its_name_is_refused() {
        let mut known = KnownCommands::default();
        let named = |known: &mut KnownCommands, digest| known.name(Some("a".into()), digest);
        let (pause, stop) = (hash_of(&Command::Pause {}), hash_of(&Command::Stop {}));
        assert_eq!(named(&mut known, Some(pause)), Ok(Named::New("a".into())));
        assert_eq!(named(&mut known, Some(pause)), Ok(Named::Again("a".into())));
        assert!(named(&mut known, Some(stop)).is_err() && named(&mut known, None).is_err());
        known.forget("a");
        assert_eq!(named(&mut known, Some(stop)), Ok(Named::New("a".into())));
        assert_eq!(known.name(None, None), Ok(Named::New("o1".into())));
        assert!(known.name(Some("o1".into()), None).is_err());
        // One of an earlier run may be sent again too.
        known.reserve("b", pause);
        assert_eq!(known.name(Some("b".into()), Some(pause)), Ok(Named::Again("b".into())));
        assert!(known.name(Some("b".into()), Some(stop)).is_err());
    }

    #[test]
    fn the_name_of_a_command_that_will_come_is_kept_for_it() {
        let mut known = KnownCommands::default();
        ["o1", "o3"].iter().for_each(|id| known.expect(id));
        assert_eq!(known.name(None, None), Ok(Named::New("o2".into())));
        assert!(known.name(Some("o3".into()), Some(1)).is_err());
        known.has_come("o3");
        assert_eq!(known.name(Some("o3".into()), None), Ok(Named::New("o3".into())));
        // One that was given to two commands is the first one's.
        known.expect("o3");
        known.has_come("o3");
        assert!(known.name(Some("o3".into()), None).is_err());
        assert_eq!(known.name(None, None), Ok(Named::New("o4".into())));
    }

    #[test]
    fn names_are_not_kept_without_end() {
        let mut known = KnownCommands::default();
        (0..3 * ORDERS_KEPT).for_each(|_| drop(known.name(None, None)));
        assert_eq!((known.names.len(), known.named.len()), (2 * ORDERS_KEPT, 2 * ORDERS_KEPT));
    }
}
