//! What may be changed while the flow goes on.

use super::Solver;
use crate::SolverError;
use crate::fluid::Fluid;
use crate::ranks::agreed;

impl Solver {
    /// The parameters that boundary values may depend on.
    #[must_use]
    pub fn parameters(&self) -> &[f64] {
        &self.parameters
    }

    /// Sets the parameters that boundary values may depend on; a change acts from the next step on,
    /// as a jump.
    pub fn set_parameters(&mut self, parameters: &[f64]) {
        if self.parameters != parameters {
            self.parameters = parameters.to_vec();
            self.jump = true;
        }
    }

    /// Changes the fluid from the next step on.
    ///
    /// # Errors
    /// [`SolverError::NotPositive`]; the fluid then stays as it is.
    pub fn set_fluid(&mut self, fluid: Fluid) -> Result<(), SolverError> {
        fluid.check()?;
        self.fluid = fluid;
        Ok(())
    }

    /// Changes the parameters and the fluid that they make, from the next step on, which is this
    /// long. Collective.
    ///
    /// # Errors
    /// [`SolverError::NotPositive`] for the fluid, and [`SolverError::NotFinite`] where a boundary
    /// value would not be finite at the end of that step; on several ranks [`SolverError::Rank`], the
    /// same on all. Everything then stays as it is.
    pub fn change(
        &mut self,
        parameters: &[f64],
        fluid: Fluid,
        time_step: f64,
    ) -> Result<(), SolverError> {
        let (points, end) = (&self.geometry.points, self.time + time_step);
        let own = fluid.check().and_then(|()| self.boundary.check(points, end, parameters));
        agreed(self.halo.communicator(), own)?;
        self.set_parameters(parameters);
        self.fluid = fluid;
        Ok(())
    }
}
