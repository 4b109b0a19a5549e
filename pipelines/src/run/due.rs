//! When pipelines run.

use tombolo_deform::communicator::{Garbled, Reader, Writer};

use super::audience::Audience;
use crate::language::{Cadence, Due};

/// How much of an interval a step may come too early: time steps add up with rounding.
pub(super) const SLACK: f64 = 1e-9;

/// A step, and what all ranks know alike of the world outside.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Now {
    pub(super) cycle: u64,
    pub(super) time: f64,
    /// Seconds on the clock of rank 0 since the run began.
    pub(super) seconds: f64,
    /// How many viewers have come so far.
    pub(super) viewers: u64,
    /// The views that somebody looks at.
    pub(super) audience: Audience,
    /// The last cycle at which pipelines could run, where they cannot at every step.
    pub(super) met: Option<u64>,
}

/// When a pipeline runs, and when it last did.
#[derive(Debug, Clone, Copy)]
pub(super) struct Clock {
    due: Due,
    last_cycle: Option<u64>,
    last_interval: Option<f64>,
    viewers: u64,
}

impl Clock {
    pub(super) fn new(due: Due) -> Self {
        Self { due, last_cycle: None, last_interval: None, viewers: 0 }
    }

    #[inline]
    pub(super) fn is_due(&self, now: &Now) -> bool {
        if self.last_cycle == Some(now.cycle) {
            return false;
        }
        match self.due {
            Due::Every(Cadence::Steps(steps)) => {
                // A multiple that went by where it could not run is made up for.
                now.cycle % steps == 0 || now.met.is_some_and(|met| now.cycle / steps > met / steps)
            }
            Due::Every(cadence) => {
                // An earlier one as well: a solver may go back in time.
                self.last_interval != Some(interval(cadence, now))
            }
            Due::At(at) => self.last_cycle.is_none() && at.has_come(now.cycle, now.time),
            Due::OnViewer => now.viewers > self.viewers,
            Due::OnOrder | Due::OnEnd => false,
        }
    }

    /// Whether one of its times has come or gone by since it last ran.
    #[inline]
    pub(super) fn has_struck(&self, now: &Now) -> bool {
        let met = match (now.met, self.last_cycle) {
            (Some(met), Some(last)) => Some(met.min(last)),
            (met, last) => met.or(last),
        };
        self.is_due(&Now { met, ..*now })
    }

    /// Whether it waits for what is not in the step itself.
    pub(super) fn listens(&self) -> bool {
        matches!(self.due, Due::OnViewer | Due::Every(Cadence::Seconds(_)))
    }

    /// Writes down when the pipeline last ran.
    pub(super) fn save(&self, writer: &mut Writer) {
        writer.u64(self.last_cycle.map_or(u64::MAX, |cycle| cycle));
        writer.f64s(&[self.last_interval.unwrap_or(f64::NAN)]);
    }

    /// Goes on from what was written down. The seconds and the viewers of another run do not count.
    pub(super) fn restore(&mut self, reader: &mut Reader<'_>) -> Result<(), Garbled> {
        self.last_cycle = Some(reader.u64()?).filter(|cycle| *cycle != u64::MAX);
        let interval = reader.f64s(1)?[0];
        let counts = !matches!(self.due, Due::Every(Cadence::Seconds(_)));
        self.last_interval = Some(interval).filter(|interval| counts && !interval.is_nan());
        Ok(())
    }

    /// Notes that the pipeline runs at this step.
    pub(super) fn take(&mut self, now: &Now) {
        self.last_cycle = Some(now.cycle);
        self.viewers = now.viewers;
        if let Due::Every(cadence) = self.due {
            self.last_interval = Some(interval(cadence, now));
        }
    }
}

/// In which of the intervals of a cadence a step lies.
fn interval(cadence: Cadence, now: &Now) -> f64 {
    match cadence {
        Cadence::Steps(_) => 0.0,
        Cadence::Time(length) => (now.time / length.get() + SLACK).floor(),
        Cadence::Seconds(length) => (now.seconds / length.get()).floor(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::language::At;
    use tombolo_deform::schedule::Interval;

    fn cycles(due: Due, time_step: f64, steps: u64) -> Vec<u64> {
        let mut clock = Clock::new(due);
        let mut time = 0.0;
        let mut taken = Vec::new();
        for cycle in 0..steps {
            // Each step takes 0.3 seconds, and viewers come before the fifth and the sixth.
            let seconds = 0.3 * cycle as f64;
            let now =
                Now { cycle, time, seconds, viewers: cycle.clamp(3, 5) - 3, ..Now::default() };
            if clock.is_due(&now) {
                clock.take(&now);
                taken.push(cycle);
            }
            time += time_step;
        }
        taken
    }

    #[test]
    fn clocks_strike_when_they_should() {
        assert_eq!(cycles(Due::Every(Cadence::Steps(5.try_into().unwrap())), 0.1, 12), [0, 5, 10]);
        // 0.1 is no binary fraction: ten of them add up to a little less than 1.
        let every_second = Due::Every(Cadence::Time(Interval::new(1.0).unwrap()));
        assert_eq!(cycles(every_second, 0.1, 31), [0, 10, 20, 30]);
        assert_eq!(cycles(every_second, 1.7, 5), [0, 1, 2, 3, 4]);
        assert_eq!(cycles(Due::At(At::Cycle(3)), 0.1, 10), [3]);
        assert_eq!(cycles(Due::At(At::Time(0.3)), 0.1, 10), [3]);
        let every_second = Due::Every(Cadence::Seconds(Interval::new(1.0).unwrap()));
        assert_eq!(cycles(every_second, 0.1, 15), [0, 4, 7, 10, 14]);
        assert_eq!(cycles(Due::OnViewer, 0.1, 10), [4, 5]);
        assert_eq!(cycles(Due::OnOrder, 0.1, 10), [0; 0]);
        assert_eq!(cycles(Due::OnEnd, 0.1, 10), [0; 0]);
    }

    #[test]
    fn time_may_go_back() {
        let mut clock = Clock::new(Due::Every(Cadence::Time(Interval::new(1.0).unwrap())));
        let times = [0.0, 0.7, 1.4, 2.1, 0.2, 0.9, 1.6, 1.1];
        let taken = (0..).zip(times).filter(|&(cycle, time)| {
            let now = Now { cycle, time, ..Now::default() };
            let is_due = clock.is_due(&now);
            if is_due {
                clock.take(&now);
            }
            is_due
        });
        assert_eq!(taken.map(|(cycle, _)| cycle).collect::<Vec<u64>>(), [0, 2, 3, 4, 6]);
    }

    #[test]
    fn steps_that_went_by_are_made_up_for() {
        let due = Due::Every(Cadence::Steps(5.try_into().unwrap()));
        // The cycles at which it runs, where it can at each third from some cycle on.
        let taken = |first: u64| -> Vec<u64> {
            let (mut clock, mut met) = (Clock::new(due), None);
            let of_meetings = (first..30).step_by(3);
            let run = of_meetings.filter(|&cycle| {
                let now = Now { cycle, met, ..Now::default() };
                let is_due = clock.is_due(&now);
                if is_due {
                    clock.take(&now);
                }
                met = Some(cycle);
                is_due
            });
            run.collect()
        };
        assert_eq!(taken(0), [0, 6, 12, 15, 21, 27]);
        assert_eq!(taken(1), [7, 10, 16, 22, 25]);
    }
}
