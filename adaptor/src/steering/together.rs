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

/// Work of all ranks together that a viewer can take back.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum UnderWay {
    /// The plan of the order of this id.
    Order(String),
    /// The forecast that this client asked for.
    Forecast(u64),
}

#[derive(Default)]
struct State {
    under_way: Option<UnderWay>,
    /// Whatever is asked for is given up.
    gives_up: bool,
}

impl PlanTogether {
    pub(super) fn new(cancellation: Cancellation, queue: Arc<Queue>) -> Self {
        Self { state: Mutex::default(), cancellation, queue }
    }

    /// Does work that all ranks do together. It is given up where the run is to end, and where rank 0
    /// says what it is and that is taken back. Collective.
    pub(super) fn run<T>(&self, what: Option<UnderWay>, work: impl FnOnce() -> T) -> T {
        {
            let mut state = lock(&self.state);
            // On every rank: what was agreed on before is over. The wish of rank 0 stays.
            self.cancellation.renew();
            if state.gives_up {
                self.cancellation.cancel();
            }
            state.under_way.clone_from(&what);
        }
        // The queue knows before [`PlanTogether::take_back`] and [`PlanTogether::withdraw`] come here:
        // it is seen now, or there.
        let is_given_up = match &what {
            Some(UnderWay::Order(order)) => {
                let mut is_taken_back = false;
                self.queue.look(|received| {
                    is_taken_back |= taken_back(&received.command) == Some(order);
                });
                is_taken_back
            }
            Some(UnderWay::Forecast(client)) => !self.queue.is_wanted(*client),
            None => false,
        };
        if is_given_up {
            self.cancellation.cancel();
        }
        let done = work();
        lock(&self.state).under_way = None;
        done
    }

    /// Gives the plan of an order up that is taken back by a command in the queue.
    pub(super) fn take_back(&self, order: &str) {
        self.give_up_one(&UnderWay::Order(order.to_owned()));
    }

    /// Gives up the forecast that a client asked for, which is not in the queue any more.
    pub(super) fn withdraw(&self, client: u64) {
        self.give_up_one(&UnderWay::Forecast(client));
    }

    fn give_up_one(&self, what: &UnderWay) {
        // Locked until it is cancelled: what comes next must not be.
        let state = lock(&self.state);
        if state.under_way.as_ref() == Some(what) {
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
