//! The orders of a run and how far each has come; kept for the viewers, the report and the journal.

use std::{
    collections::VecDeque,
    sync::{Arc, Mutex},
};

use serde_json::{Value, json};
use tombolo_pipelines::language::{Command, JournalEntry, Order, OrderStatus as JournalStatus};

use super::{
    NotFollowed,
    order_report::{ORDERS_KEPT, OrderReport, OrderStatus},
    planner::Rejection,
};
use crate::{journal::Journal, lock::lock, step::Moment, stream::Hub};

/// Orders that a viewer is told of when it connects.
const ORDERS_TOLD: usize = 100;
/// Bytes of JSON up to which an order itself is told too; a longer one holds the numbers of a
/// displacement.
const TOLD_WHOLE: usize = 16 << 10;

/// Who gave a command.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Source {
    /// The viewer of this number.
    Viewer(u64),
    /// A file of orders.
    File,
    /// The pipeline of this name.
    Pipeline(String),
    /// The file of the configuration, which has changed.
    Configuration,
    /// The program that the adaptor is linked into.
    Program,
}

/// The commands that were given, as far as they are kept.
#[derive(Default)]
struct KnownCommands {
    orders: VecDeque<OrderReport>,
    /// The newest orders as they were given, by their names.
    given: VecDeque<(String, Value)>,
    /// Names of the other commands, so that none is given twice.
    others: VecDeque<String>,
    counted: u64,
}

/// Shared by the thread that reads from viewers and the solver's.
pub(crate) struct Log {
    state: Mutex<KnownCommands>,
    journal: Journal,
    hub: Option<Arc<Hub>>,
}

impl Log {
    pub(crate) fn new(journal: Journal, hub: Option<Arc<Hub>>) -> Self {
        Self { state: Mutex::default(), journal, hub }
    }

    /// Takes a command in: gives it a name unless it has one, writes it to the journal, tells the
    /// viewers of an order.
    ///
    /// # Errors
    /// Where another command has that name already.
    pub(crate) fn accept(
        &self,
        wanted: Option<String>,
        source: &Source,
        command: &Command,
        moment: Moment,
    ) -> Result<String, String> {
        let given = match command {
            Command::Order(order) => told_whole(order),
            _ => None,
        };
        let id = {
            let mut state = lock(&self.state);
            let id = match wanted {
                Some(id) if state.has(&id) => {
                    return Err(format!("the id '{id}' was given to another command"));
                }
                Some(id) => id,
                None => state.next_id(),
            };
            if matches!(command, Command::Order(_)) {
                if state.given.len() >= ORDERS_TOLD {
                    state.given.pop_front();
                }
                state.given.extend(given.map(|given| (id.clone(), given)));
                if state.orders.len() >= ORDERS_KEPT {
                    state.orders.pop_front();
                }
                state.orders.push_back(OrderReport { id: id.clone(), ..OrderReport::default() });
            } else {
                if state.others.len() >= ORDERS_KEPT {
                    state.others.pop_front();
                }
                state.others.push_back(id.clone());
            }
            id
        };
        // A replay's own pipelines give their commands again; those of the journal would double
        // them.
        let command = (!matches!(source, Source::Pipeline(_))).then(|| command.clone());
        let reason = match source {
            Source::Pipeline(name) => Some(format!("from pipeline '{name}'")),
            Source::Configuration => Some("from the file of the configuration".into()),
            _ => None,
        };
        let changes_pipelines = matches!(command, Some(Command::Pipelines(_)));
        if command.is_some() {
            self.journal(&id, JournalStatus::Accepted, moment, command, reason, [None; 2]);
        }
        self.tell(&id);
        if let Some(hub) = self.hub.as_ref().filter(|_| changes_pipelines) {
            hub.tell(&json!({"pipelines": {"id": id, "status": JournalStatus::Accepted}}));
        }
        Ok(id)
    }

    /// Notes that a command that is no order took effect, or why it did not.
    pub(crate) fn settle(&self, id: &str, moment: Moment, outcome: Result<(), String>) {
        match outcome {
            Ok(()) => self.journal(id, JournalStatus::Applied, moment, None, None, [None; 2]),
            Err(reason) => {
                self.journal(id, JournalStatus::Rejected, moment, None, Some(reason), [None; 2])
            }
        }
    }

    /// Changes what is known of an order and tells the viewers.
    pub(crate) fn update(&self, id: &str, change: impl FnOnce(&mut OrderReport)) {
        {
            let mut state = lock(&self.state);
            let Some(order) = state.orders.iter_mut().rev().find(|order| order.id == id) else {
                return;
            };
            change(order);
        }
        self.tell(id);
    }

    /// Notes that an order changes nothing, and why.
    pub(crate) fn reject(&self, id: &str, moment: Moment, rejection: &Rejection) {
        let Rejection { reason, min_scaled_jacobian, fraction, seconds } = rejection;
        let numbers = [*min_scaled_jacobian, *fraction];
        self.journal(id, JournalStatus::Rejected, moment, None, Some(reason.clone()), numbers);
        self.update(id, |order| {
            order.status = OrderStatus::Rejected;
            order.reason = Some(reason.clone());
            order.min_scaled_jacobian = *min_scaled_jacobian;
            order.fraction = *fraction;
            order.seconds = *seconds;
        });
    }

    /// Notes that the motion of an order begins; `clamped` is the fraction that is done, where that
    /// is not all of it.
    pub(crate) fn begin(
        &self,
        id: &str,
        moment: Moment,
        min_scaled_jacobian: Option<f64>,
        clamped: Option<f64>,
    ) {
        self.journal(
            id,
            JournalStatus::Applied,
            moment,
            None,
            None,
            [min_scaled_jacobian, clamped],
        );
    }

    /// Notes how far the mesh was from where it was asked to be, which is not far.
    pub(crate) fn deviates(&self, id: &str, distance: f64) {
        if distance > 0.0 {
            self.update(id, |order| {
                order.deviation =
                    Some(order.deviation.map_or(distance, |known| known.max(distance)))
            });
        }
    }

    /// Notes that the solver did not take a motion; it is said once for each order.
    pub(crate) fn not_followed(&self, id: &str, handed_out: Moment, not: NotFollowed) {
        let NotFollowed { cycle, shape, distance } = not;
        let mut first = None;
        self.update(id, |order| {
            order.deviation = Some(order.deviation.map_or(distance, |known| known.max(distance)));
            if order.not_followed.is_none() {
                order.not_followed = Some(not);
                first = Some(order.shapes);
            }
        });
        let Some(shapes) = first else { return };
        let reason = format!(
            "shape {shape} of {shapes}, handed out at cycle {cycle}, is not where the solver's mesh is at the next call; its \
             vertices are up to {distance:.3e} from there"
        );
        let message = format!("order '{id}': applied, not followed: {reason}");
        self.journal(id, JournalStatus::NotFollowed, handed_out, None, Some(reason), [None; 2]);
        log::warn!("{message}");
        if let Some(hub) = &self.hub {
            hub.tell(&json!({"error": {"message": message, "id": id}}));
        }
    }

    /// Notes that no call came after the one that handed a shape out.
    pub(crate) fn not_confirmed(&self, id: &str, handed_out: Moment, shape: u32) {
        let mut shapes = shape;
        self.update(id, |order| {
            order.not_confirmed = Some(shape);
            shapes = order.shapes;
        });
        let reason = format!(
            "shape {shape} of {shapes}, handed out at cycle {}, was the last: no call after it shows whether the solver's mesh is there",
            handed_out.cycle
        );
        log::info!("order '{id}': applied, not confirmed: {reason}");
        self.journal(id, JournalStatus::NotConfirmed, handed_out, None, Some(reason), [None; 2]);
    }

    fn journal(
        &self,
        id: &str,
        status: JournalStatus,
        moment: Moment,
        command: Option<Command>,
        reason: Option<String>,
        [min_scaled_jacobian, fraction]: [Option<f64>; 2],
    ) {
        let Moment { cycle, time } = moment;
        let entry = JournalEntry {
            id: id.into(),
            status,
            cycle,
            time,
            command,
            reason,
            min_scaled_jacobian,
            fraction,
        };
        if let Err(error) = self.journal.write(&entry) {
            // The solver goes on without; it must not go unsaid.
            log::warn!("{error}; this run has no journal from here on");
            if let Some(hub) = &self.hub {
                hub.tell(&json!({"error": {"message": format!("{error}; this run has no journal from here on")}}));
            }
        }
    }

    fn tell(&self, id: &str) {
        let Some(hub) = &self.hub else { return };
        let state = lock(&self.state);
        if let Some(order) = state.orders.iter().rev().find(|order| order.id == id) {
            // The edits of an order are sent once, when it is accepted; a viewer that connects later
            // gets them in its `hello`.
            let told = if order.status == OrderStatus::Accepted {
                state.told(order)
            } else {
                json!(order)
            };
            hub.tell(&json!({ "order": told }));
        }
    }

    /// The newest orders, for a viewer that connects.
    pub(crate) fn told(&self) -> Value {
        let state = lock(&self.state);
        let skipped = state.orders.len().saturating_sub(ORDERS_TOLD);
        state.orders.iter().skip(skipped).map(|order| state.told(order)).collect()
    }

    pub(crate) fn reports(&self) -> Vec<OrderReport> {
        lock(&self.state).orders.iter().cloned().collect()
    }
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

impl KnownCommands {
    /// An order's report, with what was asked for.
    fn told(&self, order: &OrderReport) -> Value {
        let mut told = json!(order);
        if let Some((_, given)) = self.given.iter().rev().find(|(id, _)| *id == order.id) {
            told["order"] = given.clone();
        }
        told
    }

    fn has(&self, id: &str) -> bool {
        self.orders.iter().any(|order| order.id == id)
            || self.others.iter().any(|other| other == id)
    }

    fn next_id(&mut self) -> String {
        loop {
            self.counted += 1;
            let id = format!("o{}", self.counted);
            if !self.has(&id) {
                return id;
            }
        }
    }
}
