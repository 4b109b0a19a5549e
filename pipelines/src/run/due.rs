//! When pipelines run.

use tombolo_deform::schedule::Every;

use crate::language::Due;

/// How much of an interval a step may come too early: time steps add up with rounding.
const SLACK: f64 = 1e-9;

/// When a pipeline runs, and when it last did.
#[derive(Debug, Clone, Copy)]
pub(super) struct Clock {
    due: Due,
    last_cycle: Option<u64>,
    last_interval: Option<f64>,
}

impl Clock {
    pub(super) fn new(due: Due) -> Self {
        Self { due, last_cycle: None, last_interval: None }
    }

    pub(super) fn is_due(&self, cycle: u64, time: f64) -> bool {
        if self.last_cycle == Some(cycle) {
            return false;
        }
        match self.due {
            Due::Every(Every::Steps(steps)) => cycle % steps == 0,
            Due::Every(Every::Time(length)) => {
                let interval = (time / length.get() + SLACK).floor();
                self.last_interval.is_none_or(|last| interval > last)
            }
            Due::At(at) => self.last_cycle.is_none() && at.has_come(cycle, time),
            Due::OnOrder => false,
        }
    }

    /// Notes that the pipeline runs at this step.
    pub(super) fn take(&mut self, cycle: u64, time: f64) {
        self.last_cycle = Some(cycle);
        if let Due::Every(Every::Time(length)) = self.due {
            self.last_interval = Some((time / length.get() + SLACK).floor());
        }
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
            if clock.is_due(cycle, time) {
                clock.take(cycle, time);
                taken.push(cycle);
            }
            time += time_step;
        }
        taken
    }

    #[test]
    fn clocks_strike_when_they_should() {
        assert_eq!(cycles(Due::Every(Every::Steps(5.try_into().unwrap())), 0.1, 12), [0, 5, 10]);
        // 0.1 is no binary fraction: ten of them add up to a little less than 1.
        let every_second = Due::Every(Every::Time(Interval::new(1.0).unwrap()));
        assert_eq!(cycles(every_second, 0.1, 31), [0, 10, 20, 30]);
        assert_eq!(cycles(every_second, 1.7, 5), [0, 1, 2, 3, 4]);
        assert_eq!(cycles(Due::At(At::Cycle(3)), 0.1, 10), [3]);
        assert_eq!(cycles(Due::At(At::Time(0.3)), 0.1, 10), [3]);
        assert_eq!(cycles(Due::OnOrder, 0.1, 10), [0; 0]);
    }
}
