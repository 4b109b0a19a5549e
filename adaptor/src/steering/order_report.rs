//! The fate of each order, as the report and the viewers are told of it.

use serde::{Deserialize, Serialize};
use tombolo_deform::shape::{Judged, ShapeSeconds};

use super::NotFollowed;

/// The most orders that a report and a viewer's list keep.
pub const ORDERS_KEPT: usize = 4096;

/// The fate of one order.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct OrderReport {
    /// Its name, unique in the run.
    pub id: String,
    /// How far it has come.
    pub status: OrderStatus,
    /// The cycle of the solver's last call when it came in.
    pub cycle_accepted: u64,
    /// The reason why the order waits, as long as it is `accepted`, or `computing` in a run that is
    /// paused.
    pub waits_for: Option<String>,
    /// Why it was rejected, or what else there is to know.
    pub reason: Option<String>,
    /// The cycle whose step was the first to move the mesh for it.
    pub cycle_applied: Option<u64>,
    /// Shapes handed out so far.
    pub shape: u32,
    /// Shapes in all.
    pub shapes: u32,
    /// The least scaled Jacobian of all shapes on its way; of an order that the guard rejected,
    /// what it would have come to.
    pub min_scaled_jacobian: Option<f64>,
    /// The part of every shape that the guard judged: the volume, or the surface alone where the
    /// volume is left to the solver.
    pub judged: Option<Judged>,
    /// The first shape that the solver did not move its mesh to; `None` where it followed them all.
    pub not_followed: Option<NotFollowed>,
    /// The shape that the last call of the run handed out: no later one shows whether the solver
    /// went there.
    pub not_confirmed: Option<u32>,
    /// The largest distance between where a vertex was asked to be and where it was lent at the
    /// next call, in units of the mesh, beyond rounding: the solver's own motion, or what it did
    /// not follow.
    pub deviation: Option<f64>,
    /// The longest way that a vertex of the surface goes for it, in units of the mesh.
    pub largest_displacement: Option<f64>,
    /// The fraction of its amounts that is done: below 1 where the guard clamped it; of one that
    /// was rejected, what would pass, where that is known.
    pub fraction: Option<f64>,
    /// Seconds that its plan took.
    pub seconds: ShapeSeconds,
    /// Seconds that the solver waited inside `execute` for this order, in steps of the solver
    /// (their median).
    pub added_steps: Option<f64>,
}

/// How far an order has come.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OrderStatus {
    /// Read, found valid, and waiting for its turn.
    #[default]
    Accepted,
    /// Its plan is being made.
    Computing,
    /// Its shapes are being handed to the solver.
    Applying,
    /// Its last shape was handed to the solver.
    Applied,
    /// It changed nothing.
    Rejected,
}

impl OrderStatus {
    pub(crate) const ALL: [Self; 5] =
        [Self::Accepted, Self::Computing, Self::Applying, Self::Applied, Self::Rejected];

    /// The state as JSON has it.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Accepted => "accepted",
            Self::Computing => "computing",
            Self::Applying => "applying",
            Self::Applied => "applied",
            Self::Rejected => "rejected",
        }
    }
}
