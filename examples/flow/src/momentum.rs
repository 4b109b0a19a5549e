//! Assembly of the momentum equation.

use rayon::prelude::*;
use tombolo_deform::communicator::Halo;
use tombolo_deform::linear::SparseMatrix;
use tombolo_deform::mesh::Vector;
use tombolo_deform::vector::dot;

use crate::fluid::Fluid;
use crate::geometry::{Element, Geometry};
use crate::linear::for_each;
use crate::topology::Topology;

/// The contributions of one element beside its shape.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ElementState {
    /// The mean convecting velocity, u - w.
    pub convecting: Vector,
    /// The intrinsic time of the stabilisation.
    pub intrinsic_time: f64,
    /// The gradient of the known pressure.
    pub pressure_gradient: Vector,
    /// The mean of the known part of the time derivative.
    pub history: Vector,
}

/// The known fields of one step, in the solver's numbering.
pub(crate) struct Known<'a> {
    /// The convecting velocity, u - w, extrapolated to the end of the step.
    pub convecting: &'a [Vector],
    /// The time derivative at the end of the step is `rate * u - history`.
    pub history: &'a [Vector],
    /// See `history`.
    pub rate: f64,
    /// The known pressure.
    pub pressure: &'a [f64],
    /// The length of the step.
    pub time_step: f64,
    /// The fluid.
    pub fluid: Fluid,
}

/// Gathers each element's state.
pub(crate) fn element_states(
    topology: &Topology,
    geometry: &Geometry,
    known: &Known,
    states: &mut Vec<ElementState>,
) {
    (&topology.elements, &geometry.elements)
        .into_par_iter()
        .with_min_len(1024)
        .map(|(vertices, element)| {
            let corners = vertices.map(|vertex| vertex as usize);
            let convecting = mean(corners.map(|vertex| known.convecting[vertex]));
            ElementState {
                convecting,
                intrinsic_time: intrinsic_time(element, convecting, known),
                pressure_gradient: element.gradient(corners.map(|vertex| known.pressure[vertex])),
                history: mean(corners.map(|vertex| known.history[vertex])),
            }
        })
        .collect_into_vec(states);
}

/// The intrinsic time of an element (Tezduyar 2003): what is fastest of the step, the flow across
/// and diffusion rules.
fn intrinsic_time(element: &Element, convecting: Vector, known: &Known) -> f64 {
    let across: f64 =
        element.gradients.iter().map(|&gradient| dot(convecting, gradient).abs()).sum();
    let inverse_size: f64 = element.gradients.iter().map(|&gradient| dot(gradient, gradient)).sum();
    let diffusion = 3.0 * known.fluid.viscosity / known.fluid.density * inverse_size;
    let step = 2.0 / known.time_step;
    1.0 / (step * step + across * across + diffusion * diffusion).sqrt()
}

fn mean(corners: [Vector; 4]) -> Vector {
    std::array::from_fn(|axis| {
        0.25 * (corners[0][axis] + corners[1][axis] + corners[2][axis] + corners[3][axis])
    })
}

/// Fills the matrix of one velocity component, which all three share, and the right-hand sides.
///
/// Galerkin with exact integrals of the linear convecting velocity, and SUPG (Brooks and Hughes
/// 1982) with the residual of the momentum equation, time derivative and known pressure gradient
/// included.
pub(crate) fn assemble(
    topology: &Topology,
    geometry: &Geometry,
    known: &Known,
    states: &[ElementState],
    matrix: &mut SparseMatrix<1>,
    right: &mut [Vector],
) {
    let Fluid { density, viscosity } = known.fluid;
    let rows = topology.own_rows(matrix);
    rows.into_par_iter().zip(right.par_iter_mut()).enumerate().with_min_len(512).for_each(
        |(row, (values, right))| {
            values.fill(0.0);
            let mut total = [0.0; 3];
            let (own_convecting, own_history) = (known.convecting[row], known.history[row]);
            for incidence in topology.around(row) {
                let (local, element) = (incidence.local as usize, incidence.element as usize);
                let (shape, state) = (&geometry.elements[element], &states[element]);
                let volume = shape.volume;
                let own = shape.gradients[local];
                let weight = state.intrinsic_time * dot(state.convecting, own);
                let galerkin: Vector = std::array::from_fn(|axis| {
                    0.05 * (4.0 * state.convecting[axis] + own_convecting[axis])
                });
                for (other, gradient) in shape.gradients.iter().enumerate() {
                    let mass = if other == local { 0.1 } else { 0.05 };
                    let inertia = known.rate * mass
                        + dot(galerkin, *gradient)
                        + weight * (0.25 * known.rate + dot(state.convecting, *gradient));
                    values[incidence.slots[other] as usize] +=
                        volume * (density * inertia + viscosity * dot(own, *gradient));
                }
                for axis in 0..3 {
                    let history = 0.05 * (4.0 * state.history[axis] + own_history[axis])
                        + weight * state.history[axis];
                    total[axis] += volume
                        * (density * history - (0.25 + weight) * state.pressure_gradient[axis]);
                }
            }
            *right = total;
        },
    );
}

/// The integral of each shape function times the divergence of the velocity.
pub(crate) fn divergence(
    topology: &Topology,
    geometry: &Geometry,
    velocity: &[Vector],
    result: &mut [f64],
) {
    for_each(result, |index, value| {
        *value = topology
            .around(index)
            .iter()
            .map(|incidence| {
                let element = &geometry.elements[incidence.element as usize];
                let vertices = topology.elements[incidence.element as usize];
                let divergence: f64 = vertices
                    .iter()
                    .zip(&element.gradients)
                    .map(|(&vertex, &gradient)| dot(velocity[vertex as usize], gradient))
                    .sum();
                0.25 * element.volume * divergence
            })
            .sum();
    });
}

/// The integral of each shape function times the gradient of a scalar field.
pub(crate) fn gradient(
    topology: &Topology,
    geometry: &Geometry,
    field: &[f64],
    result: &mut [Vector],
) {
    for_each(result, |index, value| {
        let mut total = [0.0; 3];
        for incidence in topology.around(index) {
            let element = &geometry.elements[incidence.element as usize];
            let corners =
                topology.elements[incidence.element as usize].map(|vertex| field[vertex as usize]);
            let own = element.gradient(corners);
            for axis in 0..3 {
                total[axis] += 0.25 * element.volume * own[axis];
            }
        }
        *value = total;
    });
}

/// Subtracts the pressure's stabilisation from the continuity equation: the integral of each shape
/// function's gradient times the part of the pressure gradient that is orthogonal to linear fields,
/// scaled by the intrinsic time (Codina 2000). Collective.
pub(crate) fn subtract_pressure_stabilisation(
    topology: &Topology,
    geometry: &Geometry,
    states: &[ElementState],
    density: f64,
    halo: &Halo,
    projected: &mut Vec<Vector>,
    result: &mut [f64],
) {
    projected.resize(topology.vertex_count(), [0.0; 3]);
    for_each(&mut projected[..topology.rows()], |index, value| {
        let mut total = [0.0; 3];
        for incidence in topology.around(index) {
            let element = incidence.element as usize;
            for axis in 0..3 {
                total[axis] += 0.25
                    * geometry.elements[element].volume
                    * states[element].pressure_gradient[axis];
            }
        }
        let volume = geometry.vertex_volumes[index];
        *value = total.map(|value| if volume > 0.0 { value / volume } else { 0.0 });
    });
    halo.update(3, projected.as_flattened_mut());
    let projected = &*projected;
    for_each(result, |index, value| {
        for incidence in topology.around(index) {
            let element = incidence.element as usize;
            let (shape, state) = (&geometry.elements[element], &states[element]);
            let smooth = mean(topology.elements[element].map(|vertex| projected[vertex as usize]));
            let rough = std::array::from_fn(|axis| state.pressure_gradient[axis] - smooth[axis]);
            *value -= state.intrinsic_time / density
                * shape.volume
                * dot(shape.gradients[incidence.local as usize], rough);
        }
    });
}
