//! Orders on their way from the queue to the motion of the mesh.

use std::time::Instant;

use tombolo_deform::{quality::Quality, shape::Plan};

use super::{Computing, Motion, Steerer, Task};
use crate::{
    lock::lock,
    steering::{
        OrderStatus,
        planner::Rejection,
        together::UnderWay,
        worker::{Done, Worker},
    },
    step::Moment,
};

fn is_given_up(plan: &Result<Plan, Rejection>) -> bool {
    plan.as_ref().is_err_and(|rejection| rejection.is_cancelled)
}

impl Steerer {
    /// Brings orders as far as they can come now; says whether anything changed. Called at safe
    /// points only. On several ranks an order whose plan is given up waits again, in its place, and
    /// so do those behind it: the next call brings what it was given up for.
    pub(crate) fn advance(&mut self, moment: Moment, step_seconds: Option<f64>) -> bool {
        let mut changed = false;
        loop {
            changed |= self.collect(moment, step_seconds);
            if self.ends {
                return changed;
            }
            if let Some(computing) = &self.computing {
                if self.paused {
                    return changed;
                }
                if computing.planned.is_some() {
                    self.begin_planned(moment, step_seconds);
                    changed = true;
                    continue;
                }
                // An order that must take effect at this cycle waits for the one before it.
                if self.waiting.iter().all(|task| task.background) {
                    return changed;
                }
                let done = self.worker.as_ref().map(Worker::take);
                if let Some(done) = done {
                    self.finish(done, moment, step_seconds);
                }
                changed = true;
                continue;
            }
            let Some(task) = self.waiting.pop_front() else { return changed };
            changed = true;
            if let Some(given_up) = self.start(task, moment, step_seconds) {
                self.wait_again(given_up);
                return changed;
            }
        }
    }

    /// Takes what the worker has finished.
    fn collect(&mut self, moment: Moment, step_seconds: Option<f64>) -> bool {
        let mut changed = false;
        while let Some(done) = self.worker.as_ref().and_then(Worker::try_take) {
            self.finish(done, moment, step_seconds);
            changed = true;
        }
        changed
    }

    /// Has the shapes of an order found; of one that the ranks gave up meanwhile, the order.
    fn start(&mut self, task: Task, moment: Moment, step_seconds: Option<f64>) -> Option<Task> {
        let Task { id, order, background, reservation, .. } = task;
        let (stack, asked) = match self.asked(&order) {
            Ok(asked) => asked,
            Err(error) => {
                self.log.reject(&id, moment, &error.into());
                return None;
            }
        };
        self.log.update(&id, |order| {
            order.status = OrderStatus::Computing;
            order.waits_for = None;
        });
        let defaults = self.defaults.clone();
        let mut computing = Computing {
            id,
            number: 0,
            order,
            defaults,
            stack,
            asked,
            resting: false,
            planned: None,
            background,
            reservation,
        };
        match &mut self.worker {
            Some(worker) if background => {
                computing.number = worker.plan(computing.asked.clone());
                self.computing = Some(computing);
            }
            worker => {
                let begun = Instant::now();
                let plan = match (worker, &self.together) {
                    (Some(worker), _) => worker.plan_here(&self.planner, &computing.asked),
                    (None, None) => lock(&self.planner).plan(&computing.asked),
                    (None, Some(together)) => {
                        // A replay repeats what was done, which cannot be cancelled any more.
                        let recorded = self.recorded.as_ref();
                        let is_repeated = recorded.is_some_and(|it| it.repeats(moment.cycle));
                        let order = (!is_repeated).then(|| UnderWay::Order(computing.id.clone()));
                        let plan = || lock(&self.planner).plan(&computing.asked);
                        let plan = together.run(order, plan);
                        if is_given_up(&plan) {
                            return Some(computing.into_task());
                        }
                        plan
                    }
                };
                if is_given_up(&plan) {
                    self.leave(computing);
                } else {
                    self.take_plan(computing, plan, moment, begun, step_seconds);
                }
            }
        }
        None
    }

    /// Leaves an order whose plan was given up because the run ends. Whoever cancels an order takes it away
    /// before.
    fn leave(&mut self, computing: Computing) {
        self.ends = true;
        self.computing = Some(computing);
    }

    fn finish(&mut self, done: Done, moment: Moment, step_seconds: Option<f64>) {
        match done {
            Done::Prepared(quality) => {
                let Quality { min, mean, inverted, .. } = *quality;
                self.reference_quality = Some((min, mean, inverted));
            }
            Done::Gone => {
                self.worker = None;
                if let Some(computing) = self.computing.take_if(|asked| asked.planned.is_none()) {
                    let gone = Rejection::from("the thread that plans shapes has ended");
                    self.log.reject(&computing.id, moment, &gone);
                }
            }
            Done::Planned(number, plan) => {
                // One that was cancelled counts no more.
                let Some(computing) = self.computing.take_if(|asked| asked.number == number) else {
                    return;
                };
                if is_given_up(&plan) {
                    return self.leave(computing);
                }
                let is_stale = (*plan).as_ref().is_ok_and(|plan| !self.is_of_now(plan))
                    || computing.defaults != self.defaults;
                if is_stale && self.worker.is_some() {
                    return self.plan_anew(computing, moment);
                }
                self.take_plan(computing, *plan, moment, Instant::now(), step_seconds);
            }
        }
    }

    /// Has the plan of an order made from where the mesh is now. The worker may be at a forecast: the
    /// mesh waits for the plan, not the solver.
    fn plan_anew(&mut self, computing: Computing, moment: Moment) {
        let (stack, asked) = match self.asked(&computing.order) {
            Ok(asked) => asked,
            Err(error) => return self.log.reject(&computing.id, moment, &error.into()),
        };
        let Some(worker) = &mut self.worker else { return };
        let number = worker.plan(asked.clone());
        let defaults = self.defaults.clone();
        self.computing =
            Some(Computing { number, defaults, stack, asked, resting: true, ..computing });
    }

    /// Makes a plan the motion under way, or says why not.
    pub(super) fn commit(
        &mut self,
        computing: Computing,
        plan: Result<Plan, Rejection>,
        moment: Moment,
        begun: Instant,
        step_seconds: Option<f64>,
    ) {
        let Computing { id, stack, asked, .. } = computing;
        let plan = match plan {
            Ok(plan) => plan,
            Err(rejection) => return self.log.reject(&id, moment, &rejection),
        };
        if let Some(before) = self.motion.take() {
            self.log.update(&before.id, |order| {
                order.status = OrderStatus::Applied;
                order.reason = Some(format!("order {id} went on from shape {}", before.taken));
            });
        }
        let fraction = plan.target().fraction;
        self.stack =
            if fraction < 1.0 { stack.clamped(asked.request.kept, fraction) } else { stack };
        self.looked_ahead = false;
        lock(&self.present).stack.clone_from(&self.stack);
        let clamped = (fraction < 1.0).then_some(fraction);
        self.log.begin(&id, moment, plan.min_scaled_jacobian(), clamped);
        self.log.update(&id, |order| {
            order.status = OrderStatus::Applying;
            order.cycle_applied = Some(moment.cycle);
            order.shapes = plan.shapes();
            order.min_scaled_jacobian = plan.min_scaled_jacobian();
            order.judged = Some(plan.judged());
            order.largest_displacement = Some(plan.largest_displacement());
            order.fraction = Some(fraction);
            order.seconds = plan.seconds();
            order.added_steps = step_seconds.map(|step| begun.elapsed().as_secs_f64() / step);
        });
        self.motion = Some(Motion {
            id,
            plan,
            guard: asked.request.guard,
            begun: moment,
            taken: 0.0,
            reached: 0.0,
        });
    }
}
