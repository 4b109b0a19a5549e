//! What a run did, for people and for programs.

use std::{collections::BTreeMap, time::Duration};

use serde::Serialize;
use tombolo_pipelines::shape::{Judged, ShapeSeconds};

use crate::{steering::NotFollowed, stream::StreamCounts};

/// What [`Adaptor::finalize`](crate::Adaptor::finalize) hands back.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// Calls of `execute`.
    pub cycles: u64,
    /// The orders, in the order in which they came in; of more than [`ORDERS_KEPT`] only the newest.
    pub orders: Vec<OrderReport>,
    /// Seconds between one `execute` and the next, the adaptor's own left out: the solver's step.
    pub step_seconds: Spread,
    /// Seconds spent in the adaptor, by part: `execute` (all of it), `reference` (the copy of the mesh and its surface, once),
    /// `pipelines`, `steering` (plans made inside `execute`, shapes handed out), `paused`.
    pub adaptor_seconds: BTreeMap<&'static str, Spread>,
    /// What was streamed.
    pub stream: StreamCounts,
}

/// Orders that a report and a viewer's list keep.
pub const ORDERS_KEPT: usize = 4096;

/// What became of one order.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OrderReport {
    /// Its name, unique in the run.
    pub id: String,
    /// How far it has come.
    pub status: OrderStatus,
    /// Why it was rejected, or what else there is to know.
    pub reason: Option<String>,
    /// The cycle whose step was the first to move the mesh for it.
    pub cycle_applied: Option<u64>,
    /// Shapes handed out so far.
    pub shape: u32,
    /// Shapes in all.
    pub shapes: u32,
    /// The least scaled Jacobian of all shapes on its way; of an order that the guard rejected, what it would have come to.
    pub min_scaled_jacobian: Option<f64>,
    /// What the guard judged of every shape: the volume, or the surface alone where the volume is left to the solver.
    pub judged: Option<Judged>,
    /// That the solver did not move its mesh as it was asked to; the first shape that it did not follow.
    pub not_followed: Option<NotFollowed>,
    /// The largest distance between where a vertex was asked to be and where it was lent at the next call, in units of the mesh,
    /// beyond rounding: the solver's own motion, or what it did not follow.
    pub deviation: Option<f64>,
    /// The longest way that a vertex of the surface goes for it, in units of the mesh.
    pub largest_displacement: Option<f64>,
    /// The fraction of its amounts that is done: below 1 where the guard clamped it; of one that was rejected, what would pass,
    /// where that is known.
    pub fraction: Option<f64>,
    /// Seconds that its plan took.
    pub seconds: ShapeSeconds,
    /// Seconds that the solver waited inside `execute` for this order, in steps of the solver (their median).
    pub added_steps: Option<f64>,
}

/// How far an order has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum OrderStatus {
    /// Read, found valid, and waiting for its turn.
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

/// How a duration was spread over its occurrences.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Spread {
    /// How often.
    pub count: u64,
    /// The median in seconds, to 5 %.
    pub median: f64,
    /// The 95th percentile in seconds, to 5 %.
    pub p95: f64,
    /// The sum in seconds.
    pub total: f64,
}

/// Classes for each doubling of the duration.
const PER_OCTAVE: f64 = 8.0;
/// From 1 ns over 44 doublings: beyond 4 hours.
const CLASSES: usize = 352;

/// Counts durations in classes that grow by 9 %, in memory that does not grow.
#[derive(Debug, Clone)]
pub(crate) struct Durations {
    classes: Box<[u64; CLASSES]>,
    count: u64,
    total: f64,
}

impl Default for Durations {
    fn default() -> Self {
        Self { classes: Box::new([0; CLASSES]), count: 0, total: 0.0 }
    }
}

impl Durations {
    pub(crate) fn add(&mut self, duration: Duration) {
        let seconds = duration.as_secs_f64();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to the classes"
        )]
        let class = ((seconds * 1e9).max(1.0).log2() * PER_OCTAVE).clamp(0.0, (CLASSES - 1) as f64)
            as usize;
        self.classes[class] += 1;
        self.count += 1;
        self.total += seconds;
    }

    /// The middle of the class that holds this fraction of the durations.
    fn quantile(&self, fraction: f64) -> f64 {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "at most the count"
        )]
        #[expect(clippy::cast_precision_loss, reason = "fewer steps than 2^53")]
        let rank = ((self.count as f64 * fraction).ceil() as u64).max(1);
        let mut below = 0;
        for (class, count) in self.classes.iter().enumerate() {
            below += count;
            if below >= rank {
                #[expect(clippy::cast_precision_loss, reason = "few classes")]
                return 1e-9 * ((class as f64 + 0.5) / PER_OCTAVE).exp2();
            }
        }
        0.0
    }

    pub(crate) fn median(&self) -> Option<f64> {
        (self.count > 0).then(|| self.quantile(0.5))
    }

    pub(crate) fn spread(&self) -> Spread {
        Spread {
            count: self.count,
            median: self.quantile(0.5),
            p95: self.quantile(0.95),
            total: self.total,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_right_to_five_percent() {
        let mut durations = Durations::default();
        assert_eq!(durations.spread(), Spread::default());
        for step in 1..=1000u64 {
            durations.add(Duration::from_micros(step * 10));
        }
        let spread = durations.spread();
        assert!((spread.median / 5.0e-3 - 1.0).abs() < 0.05, "{spread:?}");
        assert!((spread.p95 / 9.5e-3 - 1.0).abs() < 0.05, "{spread:?}");
        assert!((spread.total - 5.005).abs() < 1e-9, "{spread:?}");
    }
}
