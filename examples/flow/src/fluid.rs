//! The fluid.

use crate::SolverError;

/// An incompressible Newtonian fluid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fluid {
    /// Mass per volume.
    pub density: f64,
    /// The dynamic viscosity.
    pub viscosity: f64,
}

impl Fluid {
    /// Refuses a density or viscosity that is not positive and finite.
    pub(crate) fn check(self) -> Result<(), SolverError> {
        for (what, value) in [("the density", self.density), ("the viscosity", self.viscosity)] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(SolverError::NotPositive { what, value });
            }
        }
        Ok(())
    }
}
