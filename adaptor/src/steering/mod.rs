//! From orders to mesh motion.
//!
//! Orders are carried out one after the other, in the order in which they came in. Each is planned
//! from the shape that the mesh has when its turn comes: if an earlier order's schedule is still
//! under way then, its remaining shapes are dropped and the new motion starts where the mesh is.
//! Nothing is lost by that, because shapes are measured from the reference: the new target holds
//! the earlier order's edits too (or not, if the new order takes it back). If the new order is
//! refused, the schedule under way goes on as if nothing had been asked.
//!
//! Several ranks plan together, inside of a call, and give up together what is cancelled meanwhile
//! (`together`).
//!
//! Orders of viewers are planned on a thread of their own while the solver keeps stepping, and a
//! schedule under way goes on meanwhile. Where the mesh has moved since, the way from its present
//! shape is judged again before the first shape is handed out, and the mesh rests meanwhile. The
//! journal notes each shape that is handed out, so that a replay gives the same bits.

mod defaults;
mod events;
mod forecaster;
mod known;
mod lent;
mod log;
mod motion;
mod order_report;
mod parameters;
mod planner;
mod queue;
mod room;
mod source;
mod stack;
mod steerer;
mod timed;
mod together;
mod worker;

use std::{sync::LazyLock, time::Instant};

pub(crate) use defaults::Defaults;
pub(crate) use events::Events;
pub(crate) use forecaster::Forecaster;
pub(crate) use known::KnownCommands;
pub use lent::NotFollowed;
pub(crate) use log::Log;
pub use motion::{MeshMotion, Steering, SurfaceMotion};
pub use order_report::{ORDERS_KEPT, OrderReport, OrderStatus};
pub(crate) use parameters::Parameters;
pub use parameters::{Parameter, ParameterError};
pub(crate) use queue::{Asked, Queue, Received};
pub(crate) use room::Reservation;
pub(crate) use source::Source;
pub(crate) use stack::EditStack;
pub(crate) use steerer::{SavedSteering, Steerer};
pub(crate) use timed::{Timed, hash_of, without_carried_out};
pub(crate) use together::taken_back;
pub(crate) use worker::{OVERTAKEN, WITHDRAWN};

/// Seconds since the first call of this function: the clock of a
/// [`Shaper`](tombolo_deform::shape::Shaper).
#[must_use]
pub fn clock() -> f64 {
    static START: LazyLock<Instant> = LazyLock::new(Instant::now);
    START.elapsed().as_secs_f64()
}
