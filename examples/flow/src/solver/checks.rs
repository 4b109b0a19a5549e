//! What makes it impossible to go on.

use super::Solver;
use crate::SolverError;
use crate::geometry::Geometry;
use crate::linear::sum;
use crate::ranks::{agreed, total};
use crate::topology::Topology;

impl Solver {
    /// Refuses a flow that is not finite. Collective.
    pub(super) fn check_finite(&self) -> Result<(), SolverError> {
        let (velocity, pressure) = (&self.velocity, &self.pressure);
        let zero = sum(pressure.len(), |range| {
            [range
                .map(|v| (velocity[v][0] + velocity[v][1] + velocity[v][2] + pressure[v]) * 0.0)
                .sum()]
        });
        if total(self.halo.communicator(), zero) == [0.0] {
            return Ok(());
        }
        agreed(self.halo.communicator(), self.first_non_finite())
    }

    fn first_non_finite(&self) -> Result<(), SolverError> {
        for (rank, &vertex) in self.topology.vertex_order.iter().enumerate() {
            let values = [
                self.velocity[rank][0],
                self.velocity[rank][1],
                self.velocity[rank][2],
                self.pressure[rank],
            ];
            if let Some(component) = values.iter().position(|value| !value.is_finite()) {
                return Err(SolverError::Diverged {
                    cycle: self.cycle,
                    time: self.time,
                    quantity: if component < 3 { "velocity" } else { "pressure" },
                    vertex: vertex as usize,
                    position: self.geometry.points[rank],
                    value: values[component],
                });
            }
        }
        Ok(())
    }
}

/// Refuses a mesh with an inverted or flat element.
pub(super) fn check_elements(
    topology: &Topology,
    geometry: &Geometry,
    cycle: u64,
) -> Result<(), SolverError> {
    let Some(element) = geometry.inverted() else { return Ok(()) };
    let corners = topology.elements[element].map(|vertex| geometry.points[vertex as usize]);
    Err(SolverError::Inverted {
        cycle,
        cell: topology.element_order[element] as usize,
        position: std::array::from_fn(|axis| {
            0.25 * corners.iter().map(|corner| corner[axis]).sum::<f64>()
        }),
        volume: geometry.elements[element].volume,
    })
}
