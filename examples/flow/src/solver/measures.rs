//! What can be read off a flow: its fields, and what they come to over the mesh and its boundary.

use tombolo_deform::communicator::Reduction;
use tombolo_deform::mesh::Vector;
use tombolo_deform::vector::dot;

use super::Solver;
use crate::boundary::{Condition, Patch};
use crate::fluid::Fluid;
use crate::geometry::Element;
use crate::linear::sum;
use crate::ranks::total;

impl Solver {
    pub(super) fn imbalance(&self) -> f64 {
        self.fluxes().into_iter().sum()
    }

    /// The volume of the mesh. Collective.
    pub(super) fn volume(&self) -> f64 {
        let volumes = &self.geometry.vertex_volumes;
        let own = sum(self.topology.rows(), |range| [volumes[range].iter().sum::<f64>()]);
        total(self.halo.communicator(), own)[0]
    }

    /// The part of its volume by which the fluid was stretched in the last step. Collective.
    pub(super) fn stretch(&self, time_step: f64) -> f64 {
        if self.boundary.is_open() {
            return 0.0;
        }
        let patches = self.boundary.patches.iter().zip(self.fluxes());
        let prescribed =
            patches.filter(|(patch, _)| matches!(patch.condition, Condition::Velocity(_)));
        let out: f64 = prescribed.map(|(_, flux)| flux * time_step).sum();
        (self.gain + out) / self.volume()
    }

    /// How many steps have been done.
    #[must_use]
    pub fn cycle(&self) -> u64 {
        self.cycle
    }

    /// The time reached.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.time
    }

    /// The fluid.
    #[must_use]
    pub fn fluid(&self) -> Fluid {
        self.fluid
    }

    /// The velocity at each vertex.
    #[must_use]
    pub fn velocity(&self) -> Vec<Vector> {
        self.topology.to_mesh(&self.velocity)
    }

    /// The pressure at each vertex.
    #[must_use]
    pub fn pressure(&self) -> Vec<f64> {
        self.topology.to_mesh(&self.pressure)
    }

    /// The velocity at each vertex, in place of what `values` holds.
    pub fn velocity_into(&self, values: &mut Vec<Vector>) {
        values.clear();
        values.extend(self.topology.vertex_rank.iter().map(|&rank| self.velocity[rank as usize]));
    }

    /// The pressure at each vertex, in place of what `values` holds.
    pub fn pressure_into(&self, values: &mut Vec<f64>) {
        values.clear();
        values.extend(self.topology.vertex_rank.iter().map(|&rank| self.pressure[rank as usize]));
    }

    /// The coordinates of each vertex.
    #[must_use]
    pub fn points(&self) -> Vec<Vector> {
        self.topology.to_mesh(&self.geometry.points)
    }

    /// The patches, in the order in which they were given; their triangles in the solver's own
    /// numbering.
    #[must_use]
    pub fn patches(&self) -> &[Patch] {
        &self.boundary.patches
    }

    /// The flux of the velocity out through each patch (volume per time).
    #[must_use]
    pub fn fluxes(&self) -> Vec<f64> {
        self.boundary.fluxes(&self.velocity, &self.geometry.points, self.halo.communicator())
    }

    /// The mean pressure over each patch, and the patch's area.
    #[must_use]
    pub fn mean_pressures(&self) -> Vec<(f64, f64)> {
        self.boundary.means(&self.pressure, &self.geometry.points, self.halo.communicator())
    }

    /// The greatest velocity of any vertex.
    #[must_use]
    pub fn max_velocity(&self) -> f64 {
        let fastest = self
            .velocity
            .iter()
            .map(|&velocity| dot(velocity, velocity))
            .fold(0.0, f64::max)
            .sqrt();
        self.halo.communicator().reduced(Reduction::Maximum, fastest)
    }

    /// The largest Courant number of any element for a time step: how many elements the fluid
    /// crosses in it.
    #[must_use]
    pub fn courant(&self, time_step: f64) -> f64 {
        let across = |(vertices, element): (&[u32; 4], &Element)| {
            let mean: Vector = std::array::from_fn(|axis| {
                0.25 * vertices
                    .iter()
                    .map(|&vertex| self.velocity[vertex as usize][axis])
                    .sum::<f64>()
            });
            0.5 * time_step
                * element.gradients.iter().map(|&gradient| dot(mean, gradient).abs()).sum::<f64>()
        };
        let elements = self.topology.elements.iter().zip(&self.geometry.elements);
        let largest = elements.map(across).fold(0.0, f64::max);
        self.halo.communicator().reduced(Reduction::Maximum, largest)
    }
}
