//! One time step after the other.

mod checks;
mod measures;
mod motion;
mod parameters;
mod projection;
mod saved;

use tombolo_deform::communicator::Halo;
use tombolo_deform::linear::SparseMatrix;
use tombolo_deform::mesh::{Mesh, Vector};
use tombolo_deform::vector::{dot, length};

use crate::SolverError;
use crate::boundary::{Boundary, Patch, Place, Rule, Value};
use crate::fluid::Fluid;
use crate::geometry::Geometry;
use crate::linear::{BiCgStab, BlockIncompleteLu, Outcome, for_each, sum};
use crate::momentum::{self, ElementState, Known};
use crate::ranks::{agreed, total};
use crate::topology::Topology;
use checks::check_elements;
use projection::{Projection, Start};

/// How much of the energy that flows in at an outlet is damped; one half makes the energy of the
/// scheme bounded.
const BACKFLOW: f64 = 0.5;

/// How often the velocity is projected at the beginning of a step with an impulse.
const IMPULSE_PROJECTIONS: usize = 4;

/// How much longer than the last one a step may be with a time derivative of second order, which is
/// stable up to 1 + sqrt(2) (Grigorieff 1983).
const MOST_GROWTH: f64 = 2.0;

/// How the equations are solved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// The residual of the momentum equation, relative to its right-hand side.
    pub momentum_tolerance: f64,
    /// The residual of the pressure equation, relative to its right-hand side.
    pub pressure_tolerance: f64,
    /// The same of each of the projections by which an impulse acts. They are approximate however
    /// well they are solved; what they leave is for the solve of the step, at its own tolerance.
    pub impulse_tolerance: f64,
    /// No solve takes more iterations than this, with the preconditioner that it begins with.
    pub iteration_limit: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            momentum_tolerance: 1e-7,
            pressure_tolerance: 1e-6,
            impulse_tolerance: 1e-2,
            iteration_limit: 200,
        }
    }
}

/// Where the mesh is at the end of a step.
#[derive(Debug, Clone, Copy)]
pub struct Motion<'a> {
    /// The coordinates of each vertex, in the mesh's numbering.
    pub points: &'a [Vector],
}

/// The outcome of one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepOutcome {
    /// The solve of the momentum equation.
    pub momentum: Outcome,
    /// The solve of the pressure equation; where the step began with an impulse, the iterations of
    /// its projections too.
    pub pressure: Outcome,
    /// The flux of the velocity out through the whole boundary; where there is an outlet, 0 up to the
    /// tolerance of the pressure solve.
    pub imbalance: f64,
    /// The part of its volume by which the fluid was stretched in this step, or compressed where it is
    /// negative: without an outlet nothing makes up for what the mesh gains or loses, or for
    /// prescribed velocities that bring in more or less than they take out. 0 with an outlet.
    pub stretch: f64,
}

/// The flow on one mesh.
///
/// Arrays go in and come out in the mesh's numbering; within, the solver has its own.
///
/// On several ranks each has a part of the mesh; then [`Solver::new`] and all that steps, changes
/// or measures the whole is collective, and errors are the same on all ranks.
#[derive(Debug)]
pub struct Solver {
    settings: Settings,
    fluid: Fluid,
    topology: Topology,
    geometry: Geometry,
    boundary: Boundary,
    halo: Halo,
    cycle: u64,
    time: f64,
    parameters: Vec<f64>,

    velocity: Vec<Vector>,
    previous_velocity: Vec<Vector>,
    pressure: Vec<f64>,
    potential: Vec<f64>,
    mesh_velocity: Vec<Vector>,
    moving: bool,
    /// How much volume the mesh has gained in the last step.
    gain: f64,
    /// Whether the boundary values jump before the next step.
    jump: bool,
    /// The length of the last step.
    last_step: f64,

    momentum: SparseMatrix<1>,
    momentum_preconditioner: BlockIncompleteLu,
    momentum_solver: BiCgStab,
    projection: Projection,
    states: Vec<ElementState>,
    convecting: Vec<Vector>,
    history: Vec<Vector>,
    right: Vec<Vector>,
    scratch: Vec<Vector>,
}

impl Solver {
    /// A fluid at rest on a mesh of tetrahedra, of which each rank may have a part. Collective.
    ///
    /// On one process the halo is [`Halo::none`]. On several ranks `mesh` is this rank's part, its
    /// own cells and those of others that touch one of them by a vertex, and `halo` says which
    /// vertices other ranks have too; a part may be empty. The patches are the same on all ranks,
    /// with those of their triangles here that belong to a cell of the part. What is wrong is told
    /// by the part's own numbers.
    ///
    /// # Errors
    /// [`SolverError`] for a mesh that is not of tetrahedra, that has an inverted one, or for a
    /// fluid that is none; on several ranks [`SolverError::Rank`], the same on all.
    pub fn new(
        mesh: &Mesh,
        halo: &Halo,
        patches: Vec<Patch>,
        fluid: Fluid,
        settings: Settings,
    ) -> Result<Self, SolverError> {
        fluid.check()?;
        let communicator = halo.communicator();
        let mut owners = vec![communicator.rank() as u64; mesh.points().len()];
        halo.update(1, &mut owners);
        let topology = agreed(communicator, Topology::new(mesh, &owners, communicator.rank()))?;
        if !communicator.any(!topology.elements.is_empty()) {
            return Err(SolverError::NoCells);
        }
        let halo = halo.of(&topology.vertex_order);
        // What can fail on one rank alone, before anything that all do together.
        let geometry = Geometry::new(&topology, topology.to_solver(mesh.points()));
        let own = check_elements(&topology, &geometry, 0)
            .and_then(|()| Boundary::new(&topology, patches));
        let mut boundary = agreed(communicator, own)?;
        boundary.measure(&topology, &geometry, halo.communicator());
        boundary.check_outlets(halo.communicator())?;
        let (vertices, rows) = (topology.vertex_count(), topology.rows());
        let projection =
            Projection::new(&topology, &geometry, &boundary, &halo, settings.iteration_limit);
        let projection = agreed(halo.communicator(), projection.map_err(SolverError::from))?;
        Ok(Self {
            settings,
            fluid,
            cycle: 0,
            time: 0.0,
            parameters: Vec::new(),
            velocity: vec![[0.0; 3]; vertices],
            previous_velocity: vec![[0.0; 3]; vertices],
            pressure: vec![0.0; vertices],
            potential: vec![0.0; vertices],
            mesh_velocity: vec![[0.0; 3]; vertices],
            moving: false,
            gain: 0.0,
            jump: true,
            last_step: 0.0,
            momentum: topology.zeros.clone(),
            momentum_preconditioner: BlockIncompleteLu::new(&topology.zeros, &topology.diagonal),
            momentum_solver: BiCgStab::default(),
            projection,
            states: Vec::new(),
            convecting: vec![[0.0; 3]; vertices],
            history: vec![[0.0; 3]; vertices],
            right: vec![[0.0; 3]; rows],
            scratch: Vec::new(),
            topology,
            geometry,
            boundary,
            halo,
        })
    }

    /// Starts from this velocity and pressure instead of from rest.
    pub fn initialise(&mut self, velocity: &[Value; 3], pressure: &Value) {
        for (vertex, &position) in self.geometry.points.iter().enumerate() {
            let place = Place { position, time: self.time, parameters: &self.parameters };
            self.velocity[vertex] = [0, 1, 2].map(|axis: usize| velocity[axis].at(&place));
            self.pressure[vertex] = pressure.at(&place);
        }
        self.jump = true;
    }

    /// Goes on by one time step; `motion` says where the mesh is at its end, where it moves.
    ///
    /// The mesh velocity over the step is the displacement divided by the time step. No-slip walls
    /// take the fluid with them; a prescribed velocity is taken as it stands.
    ///
    /// Steps may have any lengths: the weights of the time derivative follow them. Behind a step
    /// that is less than half as long it is of first order, as the second order is unstable there.
    ///
    /// # Errors
    /// [`SolverError::Inverted`] for a motion that turns an element inside out, and
    /// [`SolverError::Length`]: the solver then is as before. [`SolverError::Diverged`] where the
    /// solution is no longer finite, and [`SolverError::Pressure`] where a mesh is so distorted
    /// that its Laplacian is not: there is no going on from there.
    pub fn step(
        &mut self,
        time_step: f64,
        motion: Option<Motion>,
    ) -> Result<StepOutcome, SolverError> {
        if !(time_step > 0.0 && time_step.is_finite()) {
            return Err(SolverError::NotPositive { what: "the time step", value: time_step });
        }
        let moves = self.move_mesh(time_step, motion)?;
        if !moves && !self.moving {
            // A mesh that only pauses between two shapes of a schedule moves again in the next step.
            self.projection.settle(&self.geometry.points);
        }
        let end = self.time + time_step;
        let impulse = self.jump || moves != self.moving;
        let mut pressure_outcome = None;
        if impulse {
            self.boundary.impose(
                &mut self.velocity,
                &self.mesh_velocity,
                &self.geometry.points,
                end,
                &self.parameters,
            );
            self.halo.update(3, self.velocity.as_flattened_mut());
            pressure_outcome = Some(self.apply_impulse());
        }
        // How much longer this step is than the last; nothing is behind an impulse.
        let growth = (!impulse).then(|| time_step / self.last_step);
        let second_order = !moves && growth.is_some_and(|growth| growth <= MOST_GROWTH);
        let growth = growth.unwrap_or(0.0).min(MOST_GROWTH);
        let rate = self.predict(time_step, growth, second_order);
        self.assemble(time_step, rate, end);

        std::mem::swap(&mut self.previous_velocity, &mut self.velocity);
        // `scratch` is the first guess: the solution extrapolated, with the boundary values of the
        // end of the step.
        std::mem::swap(&mut self.velocity, &mut self.scratch);
        let momentum = self.solve_momentum();
        self.boundary.impose_slip(&mut self.velocity, &self.mesh_velocity);
        self.halo.update(3, self.velocity.as_flattened_mut());

        let start = if impulse { Start::Zero } else { Start::Last };
        let mut pressure = self.project(Some(self.fluid.density), start);
        let scale = self.fluid.density * rate;
        let potential = &self.potential;
        for_each(&mut self.pressure, |index, value| {
            *value += scale * potential[index];
        });
        if !self.boundary.is_open() {
            self.centre_pressure();
        }
        if let Some(first) = pressure_outcome {
            pressure.iterations += first.iterations;
            pressure.converged &= first.converged;
        }
        self.moving = moves;
        self.jump = false;
        self.last_step = time_step;
        self.cycle += 1;
        self.time = end;
        self.check_finite()?;
        let (imbalance, stretch) = (self.imbalance(), self.stretch(time_step));
        Ok(StepOutcome { momentum, pressure, imbalance, stretch })
    }

    /// Projects the velocity onto its new boundary values. The projection is approximate where the
    /// velocity jumps, hence repeated.
    fn apply_impulse(&mut self) -> Outcome {
        let mut total = Outcome { converged: true, ..Outcome::default() };
        for _ in 0..IMPULSE_PROJECTIONS {
            self.potential.fill(0.0);
            let outcome = self.project(None, Start::Impulse);
            total.iterations += outcome.iterations;
            total.residual = outcome.residual;
            total.converged &= outcome.converged;
        }
        self.potential.fill(0.0);
        total
    }

    /// Prepares the known part of the time derivative, the convecting velocity and the first guess
    /// (in `scratch`); the rate. Nodal values travel with the mesh, so that they are extrapolated
    /// while it moves too, by `growth`: the length of the step in lengths of the last, 0 where nothing
    /// is behind it.
    fn predict(&mut self, time_step: f64, growth: f64, second_order: bool) -> f64 {
        let (now, before, mesh) = (&self.velocity, &self.previous_velocity, &self.mesh_velocity);
        self.scratch.resize(now.len(), [0.0; 3]);
        let (rate, weights) = if second_order {
            let both = 1.0 + growth;
            ((1.0 + 2.0 * growth) / both, [both, -growth * growth / both])
        } else {
            (1.0, [1.0, 0.0])
        };
        for_each(&mut self.history, |index, value| {
            let (now, before) = (now[index], before[index]);
            *value =
                std::array::from_fn(|c| (weights[0] * now[c] + weights[1] * before[c]) / time_step);
        });
        for_each(&mut self.scratch, |index, value| {
            let (now, before) = (now[index], before[index]);
            *value = std::array::from_fn(|c| now[c] + growth * (now[c] - before[c]));
        });
        let guess = &self.scratch;
        for_each(&mut self.convecting, |index, value| {
            let (guess, mesh) = (guess[index], mesh[index]);
            *value = std::array::from_fn(|c| guess[c] - mesh[c]);
        });
        rate / time_step
    }

    /// Fills the momentum matrix and its right-hand side, boundary conditions included.
    fn assemble(&mut self, time_step: f64, rate: f64, end: f64) {
        let known = Known {
            convecting: &self.convecting,
            history: &self.history,
            rate,
            pressure: &self.pressure,
            time_step,
            fluid: self.fluid,
        };
        momentum::element_states(&self.topology, &self.geometry, &known, &mut self.states);
        momentum::assemble(
            &self.topology,
            &self.geometry,
            &known,
            &self.states,
            &mut self.momentum,
            &mut self.right,
        );
        for outlet in &self.boundary.outlets {
            let vertex = outlet.vertex as usize;
            let given =
                self.boundary.outlet_pressure(outlet, &self.geometry.points, end, &self.parameters);
            for axis in 0..3 {
                self.right[vertex][axis] += outlet.area[axis] * (self.pressure[vertex] - given);
            }
            // Inflow both through space and through the mesh: a stream that leaves is not damped
            // because the outlet moves.
            let outward = dot(self.convecting[vertex], outlet.area)
                .max(dot(self.scratch[vertex], outlet.area));
            self.momentum.values_mut()[self.topology.diagonal[vertex]][0][0] -=
                BACKFLOW * self.fluid.density * outward.min(0.0);
        }
        self.boundary.impose(
            &mut self.scratch,
            &self.mesh_velocity,
            &self.geometry.points,
            end,
            &self.parameters,
        );
        for (vertex, rule) in self.boundary.rules.iter().enumerate().take(self.topology.rows()) {
            if *rule != Rule::Free {
                let offsets = self.topology.zeros.offsets();
                let values = self.momentum.values_mut();
                values[offsets[vertex]..offsets[vertex + 1]].fill([[0.0]]);
                values[self.topology.diagonal[vertex]] = [[1.0]];
                self.right[vertex] = self.scratch[vertex];
            } else {
                for axis in (0..3).filter(|&axis| self.boundary.held[vertex][axis]) {
                    self.right[vertex][axis] = self.scratch[vertex][axis];
                }
            }
        }
    }

    fn solve_momentum(&mut self) -> Outcome {
        self.momentum_preconditioner.factor(&self.momentum);
        let (right, rules) = (&self.right, &self.boundary.rules);
        let squares = sum(right.len(), |range| {
            let mut total = [0.0; 1];
            for vertex in range.filter(|&vertex| rules[vertex] == Rule::Free) {
                total[0] += dot(right[vertex], right[vertex]);
            }
            total
        });
        let squares = total(self.halo.communicator(), squares);
        let tolerance = self.settings.momentum_tolerance * squares[0].sqrt().max(f64::MIN_POSITIVE);
        self.momentum_solver.solve(
            &self.momentum,
            &self.momentum_preconditioner,
            &self.halo,
            &self.boundary.held,
            &self.right,
            &mut self.velocity,
            [tolerance; 3],
            self.settings.iteration_limit,
        )
    }

    /// Makes the velocity satisfy continuity: solves for the potential and subtracts its gradient.
    /// With a density, continuity is stabilised by the states of the present step.
    fn project(&mut self, stabilised: Option<f64>, start: Start) -> Outcome {
        let rows = self.topology.rows();
        momentum::divergence(
            &self.topology,
            &self.geometry,
            &self.velocity,
            &mut self.projection.right[..rows],
        );
        self.projection.right.iter_mut().for_each(|value| *value = -*value);
        if let Some(density) = stabilised {
            momentum::subtract_pressure_stabilisation(
                &self.topology,
                &self.geometry,
                &self.states,
                density,
                &self.halo,
                &mut self.scratch,
                &mut self.projection.right[..rows],
            );
        }
        let through: f64 = self.fluxes().into_iter().map(f64::abs).sum();
        let tolerance = match start {
            Start::Impulse => self.settings.impulse_tolerance,
            Start::Zero | Start::Last => self.settings.pressure_tolerance,
        };
        let outcome = self.projection.solve(
            &self.topology,
            &self.halo,
            &mut self.potential,
            &self.geometry.points,
            start,
            tolerance,
            through,
            self.boundary.is_open(),
        );
        self.scratch.resize(self.velocity.len(), [0.0; 3]);
        momentum::gradient(
            &self.topology,
            &self.geometry,
            &self.potential,
            &mut self.scratch[..rows],
        );
        // At an outlet, the part normal to it is that which the pressure equation took into its
        // balance.
        for outlet in &self.boundary.outlets {
            let vertex = outlet.vertex as usize;
            let (own, area) = (&mut self.scratch[vertex], outlet.area);
            let size = length(area);
            let normal = area.map(|value| value / size);
            let driven =
                self.geometry.vertex_volumes[vertex] * outlet.yield_rate * self.potential[vertex];
            let along = dot(*own, normal) + driven;
            for axis in 0..3 {
                own[axis] -= along * normal[axis];
            }
        }
        let (gradient, geometry, boundary) = (&self.scratch, &self.geometry, &self.boundary);
        for_each(&mut self.velocity[..rows], |vertex, value| {
            if boundary.rules[vertex] == Rule::Free {
                for axis in (0..3).filter(|&axis| !boundary.held[vertex][axis]) {
                    value[axis] -= gradient[vertex][axis] / geometry.vertex_volumes[vertex];
                }
            }
        });
        self.boundary.impose_slip(&mut self.velocity, &self.mesh_velocity);
        self.halo.update(3, self.velocity.as_flattened_mut());
        outcome
    }

    fn centre_pressure(&mut self) {
        let (pressure, volumes) = (&self.pressure, &self.geometry.vertex_volumes);
        let sums = sum(self.topology.rows(), |range| {
            let mut parts = [0.0; 2];
            for vertex in range {
                parts[0] += volumes[vertex] * pressure[vertex];
                parts[1] += volumes[vertex];
            }
            parts
        });
        let [integral, whole] = total(self.halo.communicator(), sums);
        self.pressure.iter_mut().for_each(|value| *value -= integral / whole);
    }
}
