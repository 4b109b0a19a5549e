//! Orders that wait: for their turn, for the end of a pause, and no longer than they may.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use tombolo_deform::shape::Plan;
use tombolo_pipelines::language::Order;

use super::{Computing, Steerer, Task};
use crate::{
    steering::{OrderStatus, Reservation, known::NEXT_CALL, planner::Rejection},
    step::Moment,
};

impl Steerer {
    /// Puts an order into the queue, with the room that it takes there: at the end, or where a
    /// withdrawn one was.
    pub(crate) fn take(
        &mut self,
        id: String,
        order: Order,
        background: bool,
        reservation: Option<Reservation>,
        index: Option<usize>,
    ) {
        let background = background && self.worker.is_some();
        let index = index.unwrap_or(self.waiting.len()).min(self.waiting.len());
        self.waiting.insert(index, Task { id, order, background, reservation, behind: None });
        self.say_why(index);
        self.say_why(index + 1);
    }

    /// Says what the order at an index of the queue waits for, where that has changed.
    pub(crate) fn say_why(&mut self, index: usize) {
        let before = match index.checked_sub(1).and_then(|index| self.waiting.get(index)) {
            Some(before) => Some(&before.id),
            None => self.computing.as_ref().map(|computing| &computing.id),
        };
        let before = before.cloned();
        let Some(task) = self.waiting.get_mut(index) else { return };
        if task.behind == before {
            return;
        }
        let reason = match &before {
            Some(before) => format!("order {before}, which came before it"),
            None => NEXT_CALL.into(),
        };
        task.behind = before;
        self.log.update(&task.id, |order| order.waits_for = Some(reason));
    }

    /// Takes an order out of the queue, or one that does not move the mesh yet, and returns its index
    /// in the queue; the error says that it moves the mesh already. `None` where it is neither. The caller
    /// puts another order there, or has the one behind [say](Self::say_why) what it waits for now.
    pub(crate) fn withdraw(&mut self, id: &str) -> Option<Result<usize, String>> {
        if let Some(index) = self.waiting.iter().position(|task| task.id == id) {
            self.waiting.remove(index);
            return Some(Ok(index));
        }
        if let Some(computing) = self.computing.take_if(|computing| computing.id == id) {
            if let Some(worker) = &self.worker {
                worker.cancel(computing.number);
            }
            return Some(Ok(0));
        }
        let motion = self.motion.as_ref().filter(|motion| motion.id == id)?;
        Some(Err(format!(
            "order '{id}' moves the mesh already (shape {} of {}), so that it cannot be taken back; an order {{\"undo\": 1}} goes back",
            motion.taken,
            motion.plan.shapes()
        )))
    }

    /// Puts an order whose plan was given up back to its place, the first of the queue.
    pub(super) fn wait_again(&mut self, task: Task) {
        self.log.update(&task.id, |order| {
            order.status = OrderStatus::Accepted;
            order.waits_for = Some(NEXT_CALL.into());
        });
        self.waiting.push_front(task);
    }

    /// Says whether the run is paused. Until it goes on no order begins to move the mesh, so that each
    /// can be taken back. It goes on in the cycle in which it was paused: the wait changes no cycle at
    /// which an order takes effect.
    pub(crate) fn set_paused(&mut self, paused: bool) {
        self.paused = paused;
    }

    /// Makes a plan the motion under way, or keeps it as long as the run is paused. What is refused is
    /// refused at once.
    pub(super) fn take_plan(
        &mut self,
        mut computing: Computing,
        plan: Result<Plan, Rejection>,
        moment: Moment,
        begun: Instant,
        step_seconds: Option<f64>,
    ) {
        match plan {
            Ok(plan) if self.paused => {
                // It is the pause that it waits for from now on, and no more the finding of its shapes.
                computing.reservation.iter_mut().for_each(Reservation::renew);
                self.log.update(&computing.id, |order| {
                    order.waits_for = Some("the run to go on, which is paused".into());
                });
                self.computing = Some(Computing { planned: Some(plan), ..computing });
            }
            plan => self.commit(computing, plan, moment, begun, step_seconds),
        }
    }

    /// Begins the order whose plan was kept while the run was paused. Where the settings of orders or
    /// the mesh have changed meanwhile it is planned anew.
    pub(super) fn begin_planned(&mut self, moment: Moment, step_seconds: Option<f64>) {
        let Some(mut computing) = self.computing.take() else { return };
        match computing.planned.take() {
            Some(plan) if computing.defaults == self.defaults && self.is_of_now(&plan) => {
                self.commit(computing, Ok(plan), moment, Instant::now(), step_seconds);
            }
            _ => self.waiting.push_front(computing.into_task()),
        }
    }

    /// Whether a plan begins at the shape that the mesh has.
    pub(super) fn is_of_now(&self, plan: &Plan) -> bool {
        Arc::ptr_eq(plan.start(), &self.here.points)
    }

    /// Whether an order has waited for too long, by the clock of this process.
    pub(crate) fn is_overdue(&self) -> bool {
        let mut waiting = self.may_be_overdue();
        waiting.any(|(_, order, reservation)| self.is_too_old(order, reservation))
    }

    /// The orders that wait for their turn or for the end of a pause, and the room that they take.
    fn may_be_overdue(&self) -> impl Iterator<Item = (&str, &Order, Option<&Reservation>)> {
        let planned = self.computing.iter().filter(|computing| computing.planned.is_some());
        let planned = planned.map(|it| (&*it.id, &it.order, it.reservation.as_ref()));
        let waiting = self.waiting.iter();
        planned.chain(waiting.map(|it| (&*it.id, &it.order, it.reservation.as_ref())))
    }

    /// How long an order may wait, and the setting that says so.
    fn deadline_of(&self, order: &Order) -> (Duration, &'static str) {
        let own = order.deadline.map(|seconds| Duration::from_secs(seconds.get().into()));
        match own.filter(|own| *own < self.deadline) {
            Some(own) => (own, "its own `deadline`"),
            None => (self.deadline, "steering.deadline"),
        }
    }

    fn is_too_old(&self, order: &Order, reservation: Option<&Reservation>) -> bool {
        reservation.is_some_and(|reservation| reservation.age() > self.deadline_of(order).0)
    }

    /// Rejects orders that have waited for too long. Collective where any wait.
    pub(crate) fn reject_overdue(&mut self, moment: Moment) {
        let waiting = self.may_be_overdue();
        // The clock of rank 0 counts.
        let mut overdue: Vec<u8> =
            waiting.map(|(_, order, held)| self.is_too_old(order, held).into()).collect();
        if overdue.is_empty() {
            return;
        }
        self.domain.communicator().broadcast(0, &mut overdue);
        let waiting = self.may_be_overdue().zip(overdue).filter(|(_, is_overdue)| *is_overdue == 1);
        let reason = |order| {
            let (deadline, setting) = self.deadline_of(order);
            format!("it has waited for more than {} seconds ({setting})", deadline.as_secs())
        };
        let overdue: Vec<(String, String)> =
            waiting.map(|((id, order, _), _)| (id.to_owned(), reason(order))).collect();
        for (id, reason) in overdue {
            self.waiting.retain(|task| task.id != id);
            self.computing.take_if(|computing| computing.id == id);
            self.log.reject(&id, moment, &reason.into());
        }
        (0..self.waiting.len()).for_each(|index| self.say_why(index));
    }
}
