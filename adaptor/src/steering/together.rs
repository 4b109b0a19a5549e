//! The plan that several ranks make together, inside of a call, and how rank 0 has it given up.
//!
//! It is made on the solvers' threads, so that no rank takes commands in meanwhile. But the stream's
//! thread of rank 0 does, and any thread may ask to stop: they say so to the kernel's
//! [`Cancellation`], and the next reduction of the plan tells all ranks
//! ([`Cancelling`](tombolo_deform::communicator::Cancelling)). All leave the plan at the same place,
//! with the same outcome, and put the order back into their queues. The command that it was given up
//! for waits in the queue of rank 0; the next call hands it to all.

use std::sync::{Arc, Mutex};

use tombolo_deform::cancellation::Cancellation;
use tombolo_pipelines::language::Command;

use super::queue::Queue;
use crate::lock::lock;

/// What the ranks plan together.
pub(crate) struct PlanTogether {
    state: Mutex<State>,
    cancellation: Cancellation,
    queue: Arc<Queue>,
}

#[derive(Default)]
struct State {
    /// The order whose plan is being made.
    order: Option<String>,
    /// Whatever is asked for is given up.
    gives_up: bool,
}

impl PlanTogether {
    pub(super) fn new(cancellation: Cancellation, queue: Arc<Queue>) -> Self {
        Self { state: Mutex::default(), cancellation, queue }
    }

    /// Does work that all ranks do together. It is given up where the run is to end and, where it is
    /// the plan of an `order`, where somebody takes that back. Collective.
    pub(super) fn run<T>(&self, order: Option<&str>, work: impl FnOnce() -> T) -> T {
        {
            let mut state = lock(&self.state);
            // On every rank: what was agreed on before is over. The wish of rank 0 stays.
            self.cancellation.renew();
            if state.gives_up {
                self.cancellation.cancel();
            }
            state.order = order.map(str::to_owned);
        }
        // A command is in the queue before [`PlanTogether::take_back`] hears of it: here it is found, or
        // there.
        let mut is_taken_back = false;
        self.queue.look(|received| {
            is_taken_back |= order.is_some() && taken_back(&received.command) == order;
        });
        if is_taken_back {
            self.cancellation.cancel();
        }
        let done = work();
        lock(&self.state).order = None;
        done
    }

    /// Gives the plan of an order up that is taken back by a command in the queue.
    pub(super) fn take_back(&self, order: &str) {
        if lock(&self.state).order.as_deref() == Some(order) {
            self.cancellation.cancel();
        }
    }

    /// Gives up what is under way, and what will be asked for from now on.
    pub(super) fn give_up(&self) {
        let mut state = lock(&self.state);
        state.gives_up = true;
        self.cancellation.cancel();
    }
}

/// The order that a command takes back.
pub(crate) fn taken_back(command: &Command) -> Option<&str> {
    match command {
        Command::Cancel(cancel) => Some(&cancel.order),
        Command::Order(order) => order.replaces.as_deref(),
        _ => None,
    }
}
