//! Shapes on their way to the solver: each is handed out when it is due, and the next call shows
//! whether the solver went there.

use std::sync::Arc;

use tombolo_deform::{
    mesh::{ArrayView, Vector},
    quality::{Guard, judge},
    shape::{CurrentShape, Judged, Plan},
    vector::subtract,
};

use super::Steerer;
use crate::{
    lock::lock,
    steering::{MeshMotion, NotFollowed, OrderStatus, SurfaceMotion, lent::HandedOut},
    step::Moment,
};

/// A schedule under way.
pub(super) struct Motion {
    pub(super) id: String,
    pub(super) plan: Plan,
    pub(super) guard: Guard,
    pub(super) begun: Moment,
    /// The position on the way that was handed out last, counted in shapes.
    pub(super) taken: f64,
    /// The position that the mesh has, which is the last one taken if that was followed.
    pub(super) reached: f64,
}

/// The last shape that was handed out, until the next call shows whether the solver went there.
pub(super) struct Pending {
    pub(super) handed: HandedOut,
    /// Where the shape was before, and its quality.
    pub(super) before: (CurrentShape, Option<(f64, f64)>),
    pub(super) reached: f64,
    pub(super) id: String,
    pub(super) shape: u32,
    pub(super) moment: Moment,
}

impl Steerer {
    /// Finds out where the solver has moved the mesh since the last call: whether it followed what
    /// was handed out, and what motion of its own there is. Collective.
    pub(crate) fn observe(&mut self, lent: &ArrayView<'_>) {
        if let Some(Pending { handed, before, reached, id, shape, moment }) = self.pending.take() {
            let outcome = self.rounding.compare(&handed, lent, &self.domain);
            let distance = outcome.distance;
            if outcome.is_followed {
                self.log.deviates(&id, distance);
            } else {
                self.log.not_followed(
                    &id,
                    moment,
                    NotFollowed { cycle: moment.cycle, shape, distance },
                );
                (self.here, self.quality) = before;
                lock(&self.present).here.clone_from(&self.here);
                if let Some(motion) = self.motion.as_mut().filter(|motion| motion.id == id) {
                    motion.reached = reached;
                }
            }
        }
        self.own = self.rounding.own(&self.here.points, lent, &self.domain);
        lock(&self.present).own.clone_from(&self.own.offsets);
    }

    /// Notes that the run ends: orders whose turn has not come change nothing, and no call will show
    /// whether the solver went to the last shape that it was handed. With `is_saved` a checkpoint
    /// holds these orders, for a run that goes on from there.
    pub(crate) fn end(&mut self, moment: Moment, is_saved: bool) {
        let end = |id: &str, reason: &str| {
            if is_saved {
                self.log.leave_open(id);
            } else {
                self.log.reject(id, moment, &reason.into());
            }
        };
        if let Some(computing) = self.computing.take() {
            let reason = match computing.planned {
                Some(_) => "the run ended while it was paused, before the order moved the mesh",
                None => "it was given up: the run ended before its shapes were known",
            };
            end(&computing.id, reason);
        }
        for task in std::mem::take(&mut self.waiting) {
            end(&task.id, "the run ended before its turn came");
        }
        if let Some(Pending { id, shape, moment, .. }) = self.pending.take() {
            self.log.not_confirmed(&id, moment, shape);
        }
    }

    /// Ends the steering of a mesh that the solver has replaced: no order has its turn any more, and
    /// the one under way goes no further.
    pub(crate) fn release(&mut self, moment: Moment, reason: &str) {
        let computing = self.computing.take().map(|computing| computing.id);
        let waiting = std::mem::take(&mut self.waiting).into_iter().map(|task| task.id);
        for id in computing.into_iter().chain(waiting) {
            self.log.reject(&id, moment, &reason.into());
        }
        if let Some(Pending { id, shape, moment, .. }) = self.pending.take() {
            self.log.not_confirmed(&id, moment, shape);
        }
        self.give_up(reason);
    }

    /// The motion that was handed out last.
    pub(crate) fn motion(&self) -> &MeshMotion {
        &self.handed_out
    }

    /// Moves the mesh on along the schedule under way over the coming step; says whether it moves.
    pub(crate) fn next_shape(&mut self, moment: Moment, time_step: f64) -> bool {
        if self.computing.as_ref().is_some_and(|computing| computing.resting) {
            return false;
        }
        let Some(motion) = self.motion.as_mut() else { return false };
        let position = match &self.recorded {
            Some(recorded) if recorded.ends(&motion.id, moment.cycle) => {
                self.give_up("the run that is carried out again went no further");
                return false;
            }
            Some(recorded) if recorded.knows(&motion.id, moment.cycle) => {
                recorded.position(&motion.id, moment.cycle).unwrap_or(motion.taken)
            }
            _ => {
                let begun = motion.begun;
                let cycles = moment.cycle.saturating_sub(begun.cycle);
                let schedule = motion.plan.schedule();
                let due = schedule.position(cycles, moment.time - begun.time, time_step);
                // No shape is left out, however long a step is.
                due.min(motion.taken.floor() + 1.0)
            }
        };
        if position <= motion.taken {
            return false;
        }
        let shape = whole(position.ceil());
        if !motion.plan.is_straight(motion.reached, position) {
            let reason = format!(
                "the mesh stayed at shape {}, from which the way to shape {shape} is not straight",
                motion.reached
            );
            self.give_up(&reason);
            return false;
        }
        let last = position >= f64::from(motion.plan.shapes());
        let points: Arc<[Vector]> = if last {
            Arc::clone(motion.plan.end())
        } else {
            let mut points = vec![[0.0; 3]; self.here.points.len()];
            motion.plan.write_position(position, &mut points);
            points.into()
        };
        let before = self.own.lent.as_ref().unwrap_or(&self.here.points);
        let carried: Option<Arc<[Vector]>> = self.own.lent.as_ref().map(|lent| {
            let shapes = self.here.points.iter().zip(&*points);
            lent.iter()
                .zip(shapes)
                .map(|(&lent, (&now, &next))| self.rounding.carried(lent, now, next))
                .collect()
        });
        let after = carried.as_ref().unwrap_or(&points);
        // The shape was judged as it is; what the mesh will be with the solver's own motion was
        // known up to the last call at most.
        if self.own.offsets.is_some() && motion.plan.judged() == Judged::Volume {
            let judged = judge(&self.domain, before, after, &[1.0], &motion.guard);
            if let Err(refusal) = judged {
                let reason = format!(
                    "shape {shape} is not handed out; with the mesh's own motion {refusal}"
                );
                self.give_up(&reason);
                return false;
            }
        }
        let MeshMotion { coordinates, displacement, velocity, surface, .. } = &mut self.handed_out;
        *coordinates = Arc::clone(after);
        refill(displacement, after.len(), |vertex| subtract(after[vertex], before[vertex]));
        let per_time = |by: f64| if time_step > 0.0 { by / time_step } else { 0.0 };
        refill(velocity, after.len(), |vertex| displacement[vertex].map(per_time));
        let SurfaceMotion { vertices, coordinates: of_surface, displacement: by, velocity: speed } =
            surface;
        let at = |all: &[Vector], index: usize| all[vertices[index] as usize];
        refill(of_surface, vertices.len(), |index| at(coordinates, index));
        refill(by, vertices.len(), |index| at(displacement, index));
        refill(speed, vertices.len(), |index| at(velocity, index));
        self.pending = Some(Pending {
            handed: HandedOut { from: Arc::clone(before), to: Arc::clone(after) },
            before: (self.here.clone(), self.quality),
            reached: motion.reached,
            id: motion.id.clone(),
            shape,
            moment,
        });
        let known = whole(motion.taken.floor());
        (motion.taken, motion.reached) = (position, position);
        self.handed_out.shape = (shape, motion.plan.shapes());
        self.handed_out.position = position;
        self.handed_out.order.clone_from(&motion.id);
        self.here = motion.plan.reached(position, points);
        lock(&self.present).here.clone_from(&self.here);
        self.quality = motion.plan.quality_at(position);
        self.log.handed(&motion.id, position, moment);
        let reached = whole(position.floor());
        if reached > known {
            self.log.update(&motion.id, |order| {
                order.shape = reached;
                if last {
                    order.status = OrderStatus::Applied;
                }
            });
        }
        if last {
            self.motion = None;
        }
        true
    }

    /// Ends the schedule under way where the mesh is.
    fn give_up(&mut self, reason: &str) {
        let Some(motion) = self.motion.take() else { return };
        self.log.update(&motion.id, |order| {
            order.status = OrderStatus::Applied;
            order.reason = Some(format!(
                "ended at shape {} of {}: {reason}",
                motion.reached,
                motion.plan.shapes()
            ));
        });
    }
}

/// A whole number of shapes.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a number of shapes")]
fn whole(shapes: f64) -> u32 {
    shapes as u32
}

/// Writes vectors anew, into the same memory where nobody has kept it.
fn refill(vectors: &mut Arc<[Vector]>, count: usize, vector: impl Fn(usize) -> Vector) {
    match Arc::get_mut(vectors).filter(|kept| kept.len() == count) {
        Some(kept) => kept.iter_mut().enumerate().for_each(|(index, kept)| *kept = vector(index)),
        None => *vectors = (0..count).map(vector).collect(),
    }
}
