//! The state of the flow, saved and gone on from, to the bit.

use std::sync::Arc;

use tombolo_deform::communicator::{Garbled, Reader, Writer};
use tombolo_deform::mesh::Vector;

use super::Solver;
use super::checks::check_elements;
use super::projection::pressure_matrix;
use crate::SolverError;
use crate::geometry::Geometry;
use crate::ranks::agreed;

impl Solver {
    /// Writes down all that the steps to come depend on, of this rank's part.
    pub fn save(&self, writer: &mut Writer) {
        writer.u64(self.cycle);
        writer.f64s(&[self.time]);
        writer.u64(self.parameters.len() as u64);
        writer.f64s(&self.parameters);
        writer.u8(self.moving.into());
        writer.u8(self.jump.into());
        writer.f64s(&[self.last_step]);
        let fluid = self.fluid;
        writer.f64s(&[fluid.density, fluid.viscosity]);
        writer.u64(self.velocity.len() as u64);
        // In the mesh's numbering: the solver's own is nobody else's business.
        for vectors in
            [&self.geometry.points, &self.velocity, &self.previous_velocity, &self.mesh_velocity]
        {
            writer.f64s(self.topology.to_mesh(vectors).as_flattened());
        }
        writer.f64s(&self.topology.to_mesh(&self.pressure));
        writer.f64s(&self.topology.to_mesh(&self.potential));
        self.projection.save(writer, &self.topology);
    }

    /// Goes on from what [`Solver::save`] wrote on this rank, of the same mesh with the same patches;
    /// of a solver that was just made. Collective.
    ///
    /// # Errors
    /// [`SolverError::Saved`] for a state of another mesh, [`SolverError::Inverted`] for one that no
    /// step has left so, and [`SolverError::Diverged`] for a flow that is not finite; on several ranks
    /// [`SolverError::Rank`], the same on all.
    pub fn restore(&mut self, reader: &mut Reader<'_>) -> Result<(), SolverError> {
        let read = self.read(reader).map_err(|Garbled { .. }| SolverError::Saved);
        let read = read.and_then(|worn| {
            check_elements(&self.topology, &self.geometry, self.cycle)?;
            Ok(worn)
        });
        let worn = agreed(self.halo.communicator(), read)?;
        self.check_finite()?;
        let communicator = self.halo.communicator();
        if let Some(points) = worn {
            // The preconditioner belongs to an earlier shape: it decides over the last bits.
            let geometry = Geometry::new(&self.topology, points);
            self.boundary.measure(&self.topology, &geometry, communicator);
            let matrix = pressure_matrix(&self.topology, &geometry, &self.boundary);
            agreed(communicator, self.projection.prepare(matrix).map_err(SolverError::from))?;
        }
        self.boundary.measure(&self.topology, &self.geometry, communicator);
        let matrix = pressure_matrix(&self.topology, &self.geometry, &self.boundary);
        self.projection.take_matrix(Arc::new(matrix));
        Ok(())
    }

    /// Reads the state; where the shape is another that the preconditioner was set up for, that.
    fn read(&mut self, reader: &mut Reader<'_>) -> Result<Option<Vec<Vector>>, Garbled> {
        self.cycle = reader.u64()?;
        self.time = reader.f64s(1)?[0];
        let count = reader.count(8)?;
        if count != self.parameters.len() {
            return Err(reader.garbled());
        }
        self.parameters = reader.f64s(count)?;
        (self.moving, self.jump) = (reader.u8()? != 0, reader.u8()? != 0);
        self.last_step = reader.f64s(1)?[0];
        let fluid = reader.f64s(2)?;
        (self.fluid.density, self.fluid.viscosity) = (fluid[0], fluid[1]);
        let vertices = self.velocity.len();
        if reader.count(0)? != vertices || self.fluid.check().is_err() {
            return Err(reader.garbled());
        }
        let topology = &self.topology;
        let mut vectors = || -> Result<Vec<Vector>, Garbled> {
            Ok(topology.to_solver(reader.f64s(3 * vertices)?.as_chunks().0))
        };
        let points = vectors()?;
        (self.velocity, self.previous_velocity, self.mesh_velocity) =
            (vectors()?, vectors()?, vectors()?);
        self.geometry = Geometry::new(&self.topology, points);
        self.pressure = self.topology.to_solver(&reader.f64s(vertices)?);
        self.potential = self.topology.to_solver(&reader.f64s(vertices)?);
        self.projection.read(reader, &self.topology)
    }
}
