//! The steps of a solver.

use tombolo_pipelines::run::Audience;

/// A step that the solver is about to take, from `time` to `time + time_step`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// Its number.
    pub cycle: u64,
    /// The simulated time at its start.
    pub time: f64,
    /// Its length; it may vary from step to step. 0 for a steady solver, whose mesh then has no
    /// velocity.
    pub time_step: f64,
}

impl Step {
    /// When the step begins.
    pub(crate) fn moment(&self) -> Moment {
        Moment { cycle: self.cycle, time: self.time }
    }
}

/// The clock and the viewers of a run, as rank 0 knows them.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Outside {
    /// Seconds since the run began.
    pub(crate) seconds: f64,
    /// How many viewers have come so far.
    pub(crate) viewers: u64,
    /// The views that somebody looks at; a recording looks at all.
    pub(crate) audience: Audience,
}

/// A cycle and its simulated time.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Moment {
    pub(crate) cycle: u64,
    pub(crate) time: f64,
}
