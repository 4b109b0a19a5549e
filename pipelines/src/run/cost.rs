//! What pipelines cost, and what they may.

use crate::language::Budget;

/// The cost of a pipeline so far.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Cost {
    /// The number of its runs.
    pub runs: u64,
    /// Seconds inside its stages, on this rank; what other threads encode and write is not in it.
    pub seconds: f64,
    /// Seconds of its last run.
    pub last_seconds: f64,
    /// Bytes of the extracts that it handed out to be streamed and written, before they were encoded.
    pub bytes: u64,
    /// Bytes that it keeps from run to run: cuts of a mesh that stands still, histories, windows of
    /// time.
    pub memory: u64,
    /// The pipeline runs at one in so many of its due times: 1, or more where it exceeds its budget.
    pub every: u32,
}

impl Cost {
    /// Notes a run that took so many seconds.
    pub(super) fn ran(&mut self, seconds: f64) {
        let seconds = seconds.max(0.0);
        self.runs += 1;
        self.seconds += seconds;
        self.last_seconds = seconds;
    }
}

/// The most that a cadence is thinned.
const MOST: u32 = 1 << 16;
/// After so many runs a judgement is made anew.
const LOOK_BACK: u32 = 8;

/// Thins the cadence of a pipeline that takes more than its part of the time.
#[derive(Debug, Clone)]
pub(super) struct Thinning {
    budget: Option<Budget>,
    every: u32,
    passed: u32,
    /// Since when it is judged, what it has taken since, and in how many runs.
    since: Option<f64>,
    spent: f64,
    runs: u32,
}

impl Thinning {
    pub(super) fn new(budget: Option<Budget>) -> Self {
        Self { budget, every: 1, passed: 0, since: None, spent: 0.0, runs: 0 }
    }

    pub(super) fn is_limited(&self) -> bool {
        self.budget.is_some()
    }

    pub(super) fn every(&self) -> u32 {
        self.every
    }

    /// Whether it runs at this one of its times.
    pub(super) fn admits(&mut self) -> bool {
        self.passed += 1;
        if self.passed < self.every {
            return false;
        }
        self.passed = 0;
        true
    }

    /// Judges by what comes from the next run on: what was before is of another cadence.
    pub(super) fn forget(&mut self) {
        (self.since, self.spent, self.runs) = (None, 0.0, 0);
    }

    /// Notes a run that took so many seconds and ended at this second of the clock; where the
    /// cadence changes, what there is to say.
    pub(super) fn ran(&mut self, seconds: f64, now: f64) -> Option<String> {
        let budget = self.budget?;
        let Some(since) = self.since else {
            // From the end of one run to the end of another, so that as many steps as runs count.
            self.since = Some(now);
            return None;
        };
        self.spent += seconds;
        self.runs += 1;
        let percent = 100.0 * self.spent / (now - since).max(f64::MIN_POSITIVE);
        let every = match () {
            () if self.runs < 2 => return None,
            () if percent > budget.percent && self.every < MOST => self.every * 2,
            () if percent < budget.percent / 4.0 && self.every > 1 => self.every / 2,
            () if self.runs < LOOK_BACK => return None,
            () => self.every,
        };
        (self.since, self.spent, self.runs) = (Some(now), 0.0, 0);
        if every == self.every {
            return None;
        }
        self.every = every;
        let times = if every == 1 { "all".into() } else { format!("one in {every}") };
        Some(format!(
            "it has taken {percent:.1} % of the run's time, with a budget of {} %: from now on it \
             runs at {times} of its times",
            budget.percent
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// At each due time one second goes by beside what a run takes.
    fn runs(percent: f64, cost: impl Fn(u32) -> f64, steps: u32) -> (Vec<u32>, Vec<String>) {
        let mut thinning = Thinning::new(Some(Budget { percent }));
        let (mut now, mut taken, mut said) = (0.0, Vec::new(), Vec::new());
        for step in 0..steps {
            now += 1.0;
            if thinning.admits() {
                now += cost(step);
                taken.push(step);
                said.extend(thinning.ran(cost(step), now));
            }
        }
        (taken, said)
    }

    #[test]
    fn a_cadence_is_thinned_until_it_keeps_to_its_budget() {
        // 0.09 of 1.09 seconds are 8 %; at one in eight 1.1 %.
        let (taken, said) = runs(2.0, |_| 0.09, 400);
        assert_eq!(said.len(), 3, "{said:?}");
        assert!(said[0].starts_with("it has taken 8.3 %") && said[0].contains("one in 2 of"));
        assert!(taken.windows(2).rev().take(20).all(|pair| pair[1] - pair[0] == 8));
    }

    #[test]
    fn a_cadence_recovers_where_a_pipeline_has_become_cheap() {
        let (taken, said) = runs(2.0, |step| if step < 100 { 0.09 } else { 0.0001 }, 400);
        assert_eq!(said.len(), 6, "{said:?}");
        assert!(said[5].ends_with("it runs at all of its times"));
        assert!(taken.windows(2).rev().take(20).all(|pair| pair[1] - pair[0] == 1));
    }

    #[test]
    fn what_keeps_to_its_budget_is_left_alone() {
        let (taken, said) = runs(10.0, |_| 0.09, 50);
        assert!(taken.len() == 50 && said.is_empty());
    }
}
