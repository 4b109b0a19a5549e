//! What holds on the boundary: prescribed velocities, walls, outlets.

mod walls;

use std::fmt;
use std::sync::Arc;

use tombolo_deform::communicator::{Communicator, Reduction};
use tombolo_deform::mesh::Vector;
use tombolo_deform::vector::{cross, dot, length, subtract};

use crate::SolverError;
use crate::geometry::Geometry;
use crate::topology::Topology;

/// Where and when a [`Value`] is asked for.
#[derive(Debug, Clone, Copy)]
pub struct Place<'a> {
    /// The position.
    pub position: Vector,
    /// The time.
    pub time: f64,
    /// The values of the parameters, in the order in which they were declared.
    pub parameters: &'a [f64],
}

/// A number that may depend on place, time and parameters.
#[derive(Clone)]
pub enum Value {
    /// One value everywhere and always.
    Uniform(f64),
    /// A function of place, time and parameters.
    Function(Arc<dyn Fn(&Place) -> f64 + Send + Sync>),
}

impl Value {
    /// The value at a place.
    #[must_use]
    pub fn at(&self, place: &Place) -> f64 {
        match self {
            Value::Uniform(value) => *value,
            Value::Function(function) => function(place),
        }
    }

    /// A function of position and time.
    pub fn function(function: impl Fn(Vector, f64) -> f64 + Send + Sync + 'static) -> Self {
        Value::Function(Arc::new(move |place| function(place.position, place.time)))
    }
}

impl fmt::Debug for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Value::Uniform(value) => write!(f, "{value}"),
            Value::Function(_) => f.write_str("function"),
        }
    }
}

/// The boundary condition on one part of the boundary.
#[derive(Debug, Clone)]
pub enum Condition {
    /// The fluid moves with the wall.
    NoSlip,
    /// The fluid moves along the wall without friction; normal to it, with the wall.
    Slip,
    /// The velocity is prescribed.
    Velocity([Value; 3]),
    /// The pressure is prescribed, with zero viscous traction. It holds weakly: through the
    /// traction on the fluid.
    Pressure(Value),
}

/// A part of the boundary with its condition. The patches together must cover the whole boundary.
///
/// Where patches meet, a prescribed velocity rules before a no-slip wall, so that what flows in is
/// exactly what was prescribed, and both before slip and pressure; between two prescribed
/// velocities the earlier patch rules.
#[derive(Debug, Clone)]
pub struct Patch {
    /// Its name.
    pub name: String,
    /// Its faces by vertices of the mesh, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// The boundary condition there.
    pub condition: Condition,
}

impl Patch {
    /// What the patch is to the flow at time 0: the sign of the flux of a prescribed velocity says
    /// whether it brings fluid in, takes it out or only drags it along. `points` are those of the
    /// mesh.
    #[must_use]
    pub fn role(&self, points: &[Vector], parameters: &[f64]) -> tombolo::Condition {
        let velocity = match &self.condition {
            Condition::NoSlip | Condition::Slip => return tombolo::Condition::Wall,
            Condition::Pressure(_) => return tombolo::Condition::Outflow,
            Condition::Velocity(velocity) => velocity,
        };
        let (mut flux, mut most) = (0.0, 0.0);
        for triangle in &self.triangles {
            let [a, b, c] = triangle.map(|vertex| points[vertex as usize]);
            let position = [0, 1, 2].map(|axis| (a[axis] + b[axis] + c[axis]) / 3.0);
            let place = Place { position, time: 0.0, parameters };
            let velocity = [0, 1, 2].map(|axis| velocity[axis].at(&place));
            // Twice the outward area.
            let area = cross(subtract(b, a), subtract(c, a));
            flux += dot(velocity, area);
            most += length(velocity) * length(area);
        }
        if flux.abs() <= TANGENTIAL * most {
            tombolo::Condition::Wall
        } else if flux < 0.0 {
            tombolo::Condition::Inflow
        } else {
            tombolo::Condition::Outflow
        }
    }
}

/// How much of a velocity may point through a patch that only drags the fluid along.
const TANGENTIAL: f64 = 1e-6;

/// How the velocity of a vertex comes about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Rule {
    /// From the equations.
    Free,
    /// It is the mesh's velocity.
    Wall,
    /// A patch prescribes it.
    Prescribed(usize),
}

/// A vertex on an outlet whose velocity is free.
#[derive(Debug, Clone, Copy)]
pub(crate) struct OutletVertex {
    pub vertex: u32,
    pub patch: usize,
    /// The integral of the vertex's shape function times the outward normal.
    pub area: Vector,
    /// The velocity with which a potential of one drives fluid out (1/length); the same all over
    /// the patch.
    pub yield_rate: f64,
}

/// How much stiffer an outlet is than the lumped mass of its vertices says: no tetrahedron's mass
/// matrix is less than a fifth of its lumped one (Wathen 1987), and the projection is stable only
/// where the pressure equation is the stiffer one.
const OUTLET_STIFFNESS: f64 = 5.0;

/// A direction in which a vertex moves with the wall: of one on a frictionless wall, or of one where
/// an inlet meets a wall. Those of one vertex are perpendicular.
#[derive(Debug, Clone, Copy)]
struct SlipVertex {
    vertex: u32,
    normal: Vector,
}

/// The boundary in the solver's numbering.
#[derive(Debug)]
pub(crate) struct Boundary {
    pub patches: Vec<Patch>,
    pub rules: Vec<Rule>,
    /// Components held by walls that lie along the axes.
    pub held: Vec<[bool; 3]>,
    /// The outlet vertices that this rank owns.
    pub outlets: Vec<OutletVertex>,
    /// For each patch whether any rank has one there.
    has_outlets: Vec<bool>,
    /// For each patch how many of its triangles are counted on this rank: they are the first.
    counted: Vec<usize>,
    slip: Vec<SlipVertex>,
}

impl Boundary {
    /// The boundary of one rank's part. Its patches hold all triangles of the whole boundary that
    /// belong to a cell of the part. Normals and areas are not known before [`Boundary::measure`].
    pub fn new(topology: &Topology, mut patches: Vec<Patch>) -> Result<Self, SolverError> {
        let vertex_count = topology.vertex_count();
        for patch in &mut patches {
            for vertex in patch.triangles.iter_mut().flatten() {
                *vertex = *topology.vertex_rank.get(*vertex as usize).ok_or_else(|| {
                    SolverError::PatchVertex { patch: patch.name.clone(), vertex: *vertex }
                })?;
            }
        }
        let mut counted = Vec::with_capacity(patches.len());
        for patch in &mut patches {
            let triangles = std::mem::take(&mut patch.triangles).into_iter();
            let (mut own, others): (Vec<_>, Vec<_>) =
                triangles.partition(|triangle| topology.counts(triangle));
            counted.push(own.len());
            own.extend(others);
            patch.triangles = own;
        }
        let mut rules = vec![Rule::Free; vertex_count];
        for patch in patches.iter().filter(|patch| matches!(patch.condition, Condition::NoSlip)) {
            for &vertex in patch.triangles.iter().flatten() {
                rules[vertex as usize] = Rule::Wall;
            }
        }
        for (index, patch) in patches.iter().enumerate().rev() {
            if let Condition::Velocity(_) = patch.condition {
                for &vertex in patch.triangles.iter().flatten() {
                    rules[vertex as usize] = Rule::Prescribed(index);
                }
            }
        }
        // A vertex that no element uses has no equation.
        for (vertex, rule) in rules.iter_mut().enumerate() {
            if topology.around(vertex).is_empty() {
                *rule = Rule::Wall;
            }
        }
        let held = vec![[false; 3]; vertex_count];
        Ok(Self {
            patches,
            rules,
            held,
            outlets: Vec::new(),
            has_outlets: Vec::new(),
            counted,
            slip: Vec::new(),
        })
    }

    /// Brings normals and areas up to date with the coordinates. Collective.
    pub fn measure(
        &mut self,
        topology: &Topology,
        geometry: &Geometry,
        communicator: &dyn Communicator,
    ) {
        let points = geometry.points.as_slice();
        self.outlets.clear();
        self.slip.clear();
        self.held.fill([false; 3]);
        let mut areas = vec![[0.0; 3]; points.len()];
        // Area and volume of each patch's outlet vertices.
        let mut sizes = vec![0.0; 2 * self.patches.len()];
        let mut walls = Vec::new();
        self.measure_rims(points, &mut areas, topology.rows(), &mut walls);
        for (index, patch) in self.patches.iter().enumerate() {
            if !matches!(patch.condition, Condition::Slip | Condition::Pressure(_)) {
                continue;
            }
            let mut vertices: Vec<u32> = patch.triangles.iter().flatten().copied().collect();
            vertices.sort_unstable();
            vertices.dedup();
            for &vertex in &vertices {
                areas[vertex as usize] = [0.0; 3];
            }
            for triangle in &patch.triangles {
                let area = triangle_area(points, *triangle);
                for &vertex in triangle {
                    for axis in 0..3 {
                        areas[vertex as usize][axis] += area[axis] / 3.0;
                    }
                }
            }
            let first_outlet = self.outlets.len();
            let is_free = |vertex: u32| {
                (vertex as usize) < topology.rows() && self.rules[vertex as usize] == Rule::Free
            };
            for &vertex in vertices.iter().filter(|&&vertex| is_free(vertex)) {
                let area = areas[vertex as usize];
                if length(area) == 0.0 {
                    continue;
                }
                if let Condition::Pressure(_) = patch.condition {
                    self.outlets.push(OutletVertex { vertex, patch: index, area, yield_rate: 0.0 });
                } else {
                    walls.push((vertex, area));
                }
            }
            for outlet in &self.outlets[first_outlet..] {
                sizes[2 * index] += length(outlet.area);
                sizes[2 * index + 1] += geometry.vertex_volumes[outlet.vertex as usize];
            }
        }
        self.hold(walls);
        communicator.reduce(Reduction::Sum, &mut sizes);
        self.has_outlets = sizes.chunks(2).map(|size| size[0] > 0.0).collect();
        for outlet in &mut self.outlets {
            let patch = 2 * outlet.patch;
            outlet.yield_rate = OUTLET_STIFFNESS * sizes[patch] / sizes[patch + 1];
        }
    }

    /// Whether some part of the boundary lets the fluid choose how much of it passes.
    pub fn is_open(&self) -> bool {
        self.has_outlets.contains(&true)
    }

    /// Refuses an outlet that walls and inlets leave no vertex of, so that nothing gets out there.
    /// Collective.
    pub fn check_outlets(&self, communicator: &dyn Communicator) -> Result<(), SolverError> {
        let mut counts: Vec<f64> = self.counted.iter().map(|&counted| counted as f64).collect();
        communicator.reduce(Reduction::Sum, &mut counts);
        for (patch, (count, has_outlets)) in
            self.patches.iter().zip(counts.into_iter().zip(&self.has_outlets))
        {
            if matches!(patch.condition, Condition::Pressure(_)) && count > 0.0 && !has_outlets {
                return Err(SolverError::Outlet { patch: patch.name.clone() });
            }
        }
        Ok(())
    }

    /// Writes the prescribed velocities into `velocity`, and takes the part through walls from the
    /// mesh.
    pub fn impose(
        &self,
        velocity: &mut [Vector],
        mesh_velocity: &[Vector],
        points: &[Vector],
        time: f64,
        parameters: &[f64],
    ) {
        for (vertex, rule) in self.rules.iter().enumerate() {
            match *rule {
                Rule::Free => {}
                Rule::Wall => velocity[vertex] = mesh_velocity[vertex],
                Rule::Prescribed(patch) => {
                    if let Condition::Velocity(values) = &self.patches[patch].condition {
                        let place = Place { position: points[vertex], time, parameters };
                        velocity[vertex] = [0, 1, 2].map(|axis: usize| values[axis].at(&place));
                    }
                }
            }
        }
        self.impose_slip(velocity, mesh_velocity);
    }

    /// Refuses values that are not finite.
    pub fn check(
        &self,
        points: &[Vector],
        time: f64,
        parameters: &[f64],
    ) -> Result<(), SolverError> {
        let not_finite = |patch: usize, quantity: &'static str, vertex: usize, value: f64| {
            Err(SolverError::NotFinite {
                patch: self.patches[patch].name.clone(),
                quantity,
                position: points[vertex],
                value,
            })
        };
        for (vertex, rule) in self.rules.iter().enumerate() {
            if let Rule::Prescribed(patch) = *rule
                && let Condition::Velocity(values) = &self.patches[patch].condition
            {
                let place = Place { position: points[vertex], time, parameters };
                let mut values = values.iter().map(|value| value.at(&place));
                if let Some(value) = values.find(|value| !value.is_finite()) {
                    return not_finite(patch, "velocity", vertex, value);
                }
            }
        }
        for outlet in &self.outlets {
            let value = self.outlet_pressure(outlet, points, time, parameters);
            if !value.is_finite() {
                return not_finite(outlet.patch, "pressure", outlet.vertex as usize, value);
            }
        }
        Ok(())
    }

    /// Takes the part of the velocity through walls, where it is not prescribed to be the wall's,
    /// from the mesh.
    pub fn impose_slip(&self, velocity: &mut [Vector], mesh_velocity: &[Vector]) {
        for slip in &self.slip {
            let (own, wall) =
                (&mut velocity[slip.vertex as usize], mesh_velocity[slip.vertex as usize]);
            let through = dot(subtract(*own, wall), slip.normal);
            for axis in 0..3 {
                own[axis] -= through * slip.normal[axis];
            }
        }
    }

    /// The prescribed pressure at an outlet vertex.
    pub fn outlet_pressure(
        &self,
        outlet: &OutletVertex,
        points: &[Vector],
        time: f64,
        parameters: &[f64],
    ) -> f64 {
        match &self.patches[outlet.patch].condition {
            Condition::Pressure(value) => {
                value.at(&Place { position: points[outlet.vertex as usize], time, parameters })
            }
            _ => 0.0,
        }
    }

    /// The flux of a vector field out through each patch. Collective.
    pub fn fluxes(
        &self,
        field: &[Vector],
        points: &[Vector],
        communicator: &dyn Communicator,
    ) -> Vec<f64> {
        let outward = |triangle: &[u32; 3]| {
            let area = triangle_area(points, *triangle);
            triangle.iter().map(|&vertex| dot(field[vertex as usize], area)).sum::<f64>() / 3.0
        };
        let mut fluxes: Vec<f64> =
            self.counted_triangles().map(|patch| patch.iter().map(outward).sum()).collect();
        communicator.reduce(Reduction::Sum, &mut fluxes);
        fluxes
    }

    /// The mean of a scalar field over each patch, and the patch's area. Collective.
    pub fn means(
        &self,
        field: &[f64],
        points: &[Vector],
        communicator: &dyn Communicator,
    ) -> Vec<(f64, f64)> {
        let mut sums = Vec::with_capacity(2 * self.patches.len());
        for triangles in self.counted_triangles() {
            let (mut total, mut whole) = (0.0, 0.0);
            for triangle in triangles {
                let area = triangle_area(points, *triangle);
                let size = length(area);
                total +=
                    size * triangle.iter().map(|&vertex| field[vertex as usize]).sum::<f64>() / 3.0;
                whole += size;
            }
            sums.extend([total, whole]);
        }
        communicator.reduce(Reduction::Sum, &mut sums);
        let mean =
            |&[total, whole]: &[f64; 2]| (if whole > 0.0 { total / whole } else { 0.0 }, whole);
        sums.as_chunks().0.iter().map(mean).collect()
    }

    fn counted_triangles(&self) -> impl Iterator<Item = &[[u32; 3]]> {
        self.patches.iter().zip(&self.counted).map(|(patch, &counted)| &patch.triangles[..counted])
    }
}

/// The outward normal of a triangle, as long as its area.
fn triangle_area(points: &[Vector], triangle: [u32; 3]) -> Vector {
    let [a, b, c] = triangle.map(|vertex| points[vertex as usize]);
    cross(subtract(b, a), subtract(c, a)).map(|value| 0.5 * value)
}
