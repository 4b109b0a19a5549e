//! The mesh moves.

use super::checks::check_elements;
use super::{Motion, Solver};
use crate::SolverError;
use crate::geometry::Geometry;
use crate::ranks::agreed;

impl Solver {
    /// Puts the mesh where it is at the end of the step; whether it moved.
    pub(super) fn move_mesh(
        &mut self,
        time_step: f64,
        motion: Option<Motion>,
    ) -> Result<bool, SolverError> {
        self.gain = 0.0;
        let Some(motion) = motion else {
            if self.moving {
                self.mesh_velocity.fill([0.0; 3]);
            }
            return Ok(false);
        };
        let geometry = agreed(self.halo.communicator(), self.moved(motion))?;
        let mut moves = false;
        for (velocity, (new, old)) in
            self.mesh_velocity.iter_mut().zip(geometry.points.iter().zip(&self.geometry.points))
        {
            *velocity = std::array::from_fn(|axis| (new[axis] - old[axis]) / time_step);
            moves |= *velocity != [0.0; 3];
        }
        if !self.halo.communicator().any(moves) {
            return Ok(false);
        }
        let before = (!self.boundary.is_open()).then(|| self.volume());
        self.geometry = geometry;
        self.gain = before.map_or(0.0, |before| self.volume() - before);
        self.boundary.measure(&self.topology, &self.geometry, self.halo.communicator());
        let renewed = self.projection.renew(&self.topology, &self.geometry, &self.boundary);
        agreed(self.halo.communicator(), renewed.map_err(SolverError::from))?;
        Ok(true)
    }

    /// The shape of the mesh at the end of a motion.
    fn moved(&self, motion: Motion) -> Result<Geometry, SolverError> {
        let vertices = self.topology.vertex_count();
        if motion.points.len() != vertices {
            return Err(SolverError::Length {
                what: "coordinates",
                found: motion.points.len(),
                expected: vertices,
            });
        }
        let geometry = Geometry::new(&self.topology, self.topology.to_solver(motion.points));
        check_elements(&self.topology, &geometry, self.cycle)?;
        Ok(geometry)
    }
}
