//! The settings of orders that bring none.

use serde::{Deserialize, Serialize};
use tombolo_deform::{
    quality::Guard,
    schedule::Schedule,
    shape::{CurrentShape, Request},
};
use tombolo_pipelines::language::{Config, Deformation, Due, Order, RunHeader, Stage};

use super::stack::{EditStack, ShapeSettings, StackError};

/// The settings of orders that bring none.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Defaults {
    pub(crate) deform: Deformation,
    pub(crate) guard: Guard,
    pub(crate) schedule: Schedule,
}

impl Defaults {
    /// The settings of the pipeline that waits for orders, else the kernel's.
    pub(crate) fn of(config: &Config) -> Self {
        let mut defaults = Self::default();
        let stages = config
            .pipelines
            .iter()
            .filter(|pipeline| pipeline.due == Due::OnOrder)
            .flat_map(|it| &it.stages);
        for stage in stages {
            match stage {
                Stage::Deform(deform) => defaults.deform.clone_from(deform),
                Stage::Guard(guard) => defaults.guard = *guard,
                Stage::Schedule(schedule) => defaults.schedule = *schedule,
                _ => {}
            }
        }
        defaults
    }

    /// The stack that an order makes of `stack`, and the request for its shape from the present
    /// one.
    pub(super) fn request(
        &self,
        stack: &EditStack,
        start: CurrentShape,
        order: &Order,
    ) -> Result<(EditStack, Request), StackError> {
        let default = ShapeSettings { deform: self.deform.clone(), guard: self.guard };
        let (after, settings) =
            stack.after(&order.change, order.deform.as_ref(), order.guard, &default)?;
        let ShapeSettings { deform, guard } = settings;
        let request = Request {
            stack: after.edits().into(),
            kept: stack.shared(&after),
            start,
            deformation: deform,
            schedule: order.schedule.unwrap_or(self.schedule),
            guard,
        };
        Ok((after, request))
    }
}

impl From<RunHeader> for Defaults {
    /// The settings that the run of a journal began with.
    fn from(run: RunHeader) -> Self {
        let RunHeader { deform, guard, schedule, .. } = run;
        Self { deform, guard, schedule }
    }
}
