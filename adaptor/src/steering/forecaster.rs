//! Forecasts for viewers that ask while the solver keeps stepping.

use std::sync::{Arc, Mutex};

use tombolo_deform::mesh::Vector;
use tombolo_deform::shape::{CurrentShape, Forecast, ShapeSeconds};
use tombolo_pipelines::language::Order;

use super::{
    Defaults, EditStack,
    planner::{PlanRequest, Rejection},
    together::PlanTogether,
    worker::Jobs,
};
use crate::lock::lock;

/// The shape that the mesh has now and the settings of orders, as those see them who are not the
/// solver's thread.
#[derive(Debug, Clone)]
pub(super) struct Present {
    pub(super) defaults: Defaults,
    pub(super) stack: EditStack,
    pub(super) here: CurrentShape,
    /// The motion that the solver itself has added to it, as far as it was looked at.
    pub(super) own: Option<Arc<[Vector]>>,
}

/// Asks the worker without going through the solver's thread, so that an answer does not wait for
/// the end of a step, and has shapes given up.
pub(crate) struct Forecaster {
    pub(super) present: Arc<Mutex<Present>>,
    pub(super) planning: Planning,
}

/// Where shapes are found.
pub(super) enum Planning {
    /// On a thread of its own.
    Beside(Arc<Jobs>),
    /// On all ranks together, inside of a call.
    Together(Arc<PlanTogether>),
}

impl Forecaster {
    /// Gives up all shapes that are being found, and those that will be asked for: the run is to end.
    pub(crate) fn give_up(&self) {
        match &self.planning {
            Planning::Beside(jobs) => jobs.give_up(),
            Planning::Together(planned) => planned.give_up(),
        }
    }

    /// Gives up the forecasts of an asker who has taken them back, or is gone.
    pub(crate) fn withdraw(&self, asker: u64) {
        match &self.planning {
            Planning::Beside(jobs) => jobs.withdraw(asker),
            Planning::Together(planned) => planned.withdraw(asker),
        }
    }

    /// Has the ranks give up the shapes of an order that a command in the queue takes back: none of
    /// them can obey it before. On one process the next call obeys it while they are found.
    pub(crate) fn take_back(&self, order: &str) {
        if let Planning::Together(planned) = &self.planning {
            planned.take_back(order);
        }
    }

    /// Has `answer` called with what `order` would come to, were it given now, or with why that is
    /// not found out. A question of the same `asker` is forgotten, and told so, where it has not
    /// begun or takes more than two seconds.
    pub(crate) fn ask(
        &self,
        asker: u64,
        order: &Order,
        answer: impl FnOnce(Result<Forecast, &'static str>) + Send + 'static,
    ) {
        let Planning::Beside(jobs) = &self.planning else {
            let reason = "only all ranks together can tell, at a safe point";
            let seconds = ShapeSeconds::default();
            return answer(Ok(Forecast::rejected(reason.into(), None, None, seconds)));
        };
        let Present { defaults, stack, here, own } = lock(&self.present).clone();
        match defaults.request(&stack, here, order) {
            Ok((_, request)) => {
                jobs.forecast(asker, PlanRequest { request, own }, Box::new(answer))
            }
            Err(error) => {
                let Rejection { reason, seconds, .. } = Rejection::from(error);
                answer(Ok(Forecast::rejected(reason, None, None, seconds)));
            }
        }
    }
}
