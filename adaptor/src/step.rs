//! The steps of a solver.

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

/// A cycle and its simulated time.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Moment {
    pub(crate) cycle: u64,
    pub(crate) time: f64,
}
