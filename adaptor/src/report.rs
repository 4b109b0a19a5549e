//! The report of a run, for people and for programs.

use std::{collections::BTreeMap, time::Duration};

use serde::Serialize;

use tombolo_pipelines::{
    language::Monitor,
    run::{Cost, History},
};

use crate::{steering::OrderReport, stream::StreamCounts};

/// The report that [`Adaptor::finalize`](crate::Adaptor::finalize) hands back.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// Calls of `execute`.
    pub cycles: u64,
    /// The orders, in the order in which they came in; of more than
    /// [`ORDERS_KEPT`](crate::ORDERS_KEPT) only the newest.
    pub orders: Vec<OrderReport>,
    /// Seconds between one `execute` and the next, the adaptor's own left out: the solver's step.
    pub step_seconds: Spread,
    /// Seconds spent in the adaptor, by part: `execute` (all of it), `reference` (the copy of the
    /// mesh and its surface, once), `pipelines`, `steering` (plans made inside `execute`, shapes
    /// handed out), `paused`.
    pub adaptor_seconds: BTreeMap<&'static str, Spread>,
    /// The frames and bytes that were streamed.
    pub stream: StreamCounts,
    /// The cost and the monitors of each pipeline.
    pub pipelines: Vec<PipelineReport>,
    /// Why the end of the journal could not be written, or that lines of it are missing; `None`
    /// where all of it is there.
    pub journal_lost: Option<String>,
}

/// The cost of a pipeline and its monitors, over the whole run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PipelineReport {
    /// Its name.
    pub name: String,
    /// The number of its runs.
    pub runs: u64,
    /// Seconds inside its stages, on this rank.
    pub seconds: f64,
    /// Bytes of the extracts that were streamed and written, before they were encoded.
    pub bytes: u64,
    /// Bytes that it kept from run to run.
    pub memory: u64,
    /// The pipeline ran at one in so many of its due times when the run ended: 1, or more where
    /// it exceeded its budget.
    pub every: u32,
    /// Its monitors.
    pub monitors: Vec<MonitorReport>,
}

/// The last, least and largest value of a monitor.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MonitorReport {
    /// Its name.
    pub name: String,
    /// Its unit, where one is given.
    pub unit: Option<String>,
    /// The last value; `None` where nothing was measured, or the value is not finite.
    pub last: Option<f64>,
    /// The least of the values that the history keeps.
    pub min: Option<f64>,
    /// The largest of the values that the history keeps.
    pub max: Option<f64>,
}

impl PipelineReport {
    pub(crate) fn new(name: &str, cost: Cost, history: Option<&History>) -> Self {
        let Cost { runs, seconds, bytes, memory, every, .. } = cost;
        let monitor = |(index, monitor): (usize, &Monitor)| {
            let values = || {
                let measured = history.into_iter().flat_map(History::measured);
                measured
                    .filter_map(move |measured| measured.values.get(index))
                    .copied()
                    .filter(|value| value.is_finite())
            };
            let last = history.and_then(History::last).and_then(|last| last.values.get(index));
            MonitorReport {
                name: monitor.name.clone(),
                unit: monitor.unit.clone(),
                last: last.copied().filter(|value| value.is_finite()),
                min: values().reduce(f64::min),
                max: values().reduce(f64::max),
            }
        };
        let monitors = history.map(History::monitors).unwrap_or_default().iter();
        let monitors = monitors.enumerate().map(monitor).collect();
        Self { name: name.into(), runs, seconds, bytes, memory, every, monitors }
    }
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
