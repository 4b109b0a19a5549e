//! The state of the steering, written down and gone on from.

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use tombolo_deform::{
    communicator::Garbled,
    quality::Guard,
    shape::{CurrentShape, Plan, SavedPlan, SavedPoints, SavedShape},
};
use tombolo_pipelines::language::Order;

use super::{Motion, Pending, Steerer};
use crate::{
    lock::lock,
    steering::{EditStack, lent::HandedOut},
    step::Moment,
};

/// The shape of a mesh and the orders that change it, beside the coordinates of all shapes.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SavedSteering {
    stack: EditStack,
    here: SavedShape,
    /// The orders that were taken in and do not move the mesh yet, each with its name.
    pub(crate) waiting: Vec<(String, Order)>,
    motion: Option<SavedMotion>,
    pending: Option<SavedPending>,
    /// The bits of the quality of the present shape.
    quality: Option<[u64; 2]>,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SavedMotion {
    id: String,
    plan: SavedPlan,
    guard: Guard,
    begun: (u64, f64),
    taken: f64,
    reached: f64,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SavedPending {
    from: u32,
    to: u32,
    before: SavedShape,
    quality: Option<[u64; 2]>,
    reached: f64,
    id: String,
    shape: u32,
    moment: (u64, f64),
}

fn bits(quality: Option<(f64, f64)>) -> Option<[u64; 2]> {
    quality.map(|(min, mean)| [min, mean].map(f64::to_bits))
}

fn numbers(bits: Option<[u64; 2]>) -> Option<(f64, f64)> {
    bits.map(|[min, mean]| (f64::from_bits(min), f64::from_bits(mean)))
}

impl Steerer {
    /// Writes the state down, with the coordinates in `points`.
    pub(crate) fn save(&self) -> (SavedSteering, SavedPoints) {
        let mut points = SavedPoints::new(&self.reference);
        let computing = self.computing.iter().map(|it| (&it.id, &it.order));
        let waiting = computing.chain(self.waiting.iter().map(|task| (&task.id, &task.order)));
        let saved = SavedSteering {
            stack: self.stack.clone(),
            here: self.here.save(&mut points),
            waiting: waiting.map(|(id, order)| (id.clone(), order.clone())).collect(),
            motion: self.motion.as_ref().map(|motion| SavedMotion {
                id: motion.id.clone(),
                plan: motion.plan.save(&mut points),
                guard: motion.guard,
                begun: (motion.begun.cycle, motion.begun.time),
                taken: motion.taken,
                reached: motion.reached,
            }),
            pending: self.pending.as_ref().map(|pending| SavedPending {
                from: points.add(&pending.handed.from),
                to: points.add(&pending.handed.to),
                before: pending.before.0.save(&mut points),
                quality: bits(pending.before.1),
                reached: pending.reached,
                id: pending.id.clone(),
                shape: pending.shape,
                moment: (pending.moment.cycle, pending.moment.time),
            }),
            quality: bits(self.quality),
        };
        (saved, points)
    }

    /// Goes on from the state of a mesh with the same reference, but for the orders that wait.
    ///
    /// # Errors
    /// [`Garbled`] where the parts do not go together; nothing has changed then.
    pub(crate) fn resume(
        &mut self,
        saved: &SavedSteering,
        points: SavedPoints,
    ) -> Result<(), Garbled> {
        if points.reference().len() != self.reference.len() {
            return Err(Garbled { rank: 0 });
        }
        let points = points.with_reference(&self.reference);
        let moment = |(cycle, time): (u64, f64)| Moment { cycle, time };
        let here = CurrentShape::restored(&saved.here, &points)?;
        let motion = |motion: &SavedMotion| -> Result<Motion, Garbled> {
            Ok(Motion {
                id: motion.id.clone(),
                plan: Plan::restored(&motion.plan, &points)?,
                guard: motion.guard,
                begun: moment(motion.begun),
                taken: motion.taken,
                reached: motion.reached,
            })
        };
        let pending = |pending: &SavedPending| -> Result<Pending, Garbled> {
            Ok(Pending {
                handed: HandedOut {
                    from: Arc::clone(points.get(pending.from)?),
                    to: Arc::clone(points.get(pending.to)?),
                },
                before: (
                    CurrentShape::restored(&pending.before, &points)?,
                    numbers(pending.quality),
                ),
                reached: pending.reached,
                id: pending.id.clone(),
                shape: pending.shape,
                moment: moment(pending.moment),
            })
        };
        let motion = saved.motion.as_ref().map(motion).transpose()?;
        let pending = saved.pending.as_ref().map(pending).transpose()?;
        (self.motion, self.pending, self.here) = (motion, pending, here);
        self.stack = saved.stack.clone();
        self.quality = numbers(saved.quality);
        let mut present = lock(&self.present);
        present.stack.clone_from(&self.stack);
        present.here.clone_from(&self.here);
        Ok(())
    }
}
