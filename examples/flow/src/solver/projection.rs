//! The pressure equation, by which the velocity is made to satisfy continuity.

use std::sync::Arc;

use tombolo_deform::communicator::{Garbled, Halo, Reader, Writer};
use tombolo_deform::linear::{
    LinearError, LinearSolver, Multigrid, MultigridSettings, NullSpace, SparseMatrix, Tolerance,
};
use tombolo_deform::mesh::Vector;
use tombolo_deform::vector::length;

use crate::boundary::Boundary;
use crate::geometry::Geometry;
use crate::linear::{Outcome, sum};
use crate::ranks::total;
use crate::topology::Topology;

/// What a solve begins with, which says how many iterations are usual.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Start {
    /// Nothing, as one of the projections of an impulse.
    Impulse,
    /// Nothing, in a step behind an impulse.
    Zero,
    /// The solution of the step before.
    Last,
}

/// The pressure equation.
#[derive(Debug)]
pub(super) struct Projection {
    solver: Multigrid<1>,
    /// Whether the preconditioner was set up for another shape than the matrix.
    is_stale: bool,
    /// Whether the solves take many more iterations for that.
    is_worn: bool,
    /// How many iterations a solve of each [`Start`] takes at most with a fresh preconditioner; 0
    /// where there was none.
    usual_iterations: [usize; 3],
    /// Where the mesh lay when the preconditioner was set up; `None` where that was at the beginning.
    set_up_at: Option<Vec<Vector>>,
    /// Of this rank: zero at the vertices of others.
    pub(super) right: Vec<f64>,
}

impl Projection {
    pub(super) fn new(
        topology: &Topology,
        geometry: &Geometry,
        boundary: &Boundary,
        halo: &Halo,
        iteration_limit: usize,
    ) -> Result<Self, LinearError> {
        let null_space = if boundary.is_open() { NullSpace::Zero } else { NullSpace::Constants };
        let settings =
            MultigridSettings { max_iterations: iteration_limit, null_space, ..Default::default() };
        let matrix = pressure_matrix(topology, geometry, boundary);
        let solver = Multigrid::distributed(halo.clone(), matrix, settings)?;
        let right = vec![0.0; topology.vertex_count()];
        Ok(Self {
            solver,
            is_stale: false,
            is_worn: false,
            usual_iterations: [0; 3],
            set_up_at: None,
            right,
        })
    }

    /// Brings the matrix up to date with the coordinates. Collective.
    ///
    /// An old preconditioner still serves a mesh that has moved a little; conjugate gradients have
    /// the true matrix.
    pub(super) fn renew(
        &mut self,
        topology: &Topology,
        geometry: &Geometry,
        boundary: &Boundary,
    ) -> Result<(), LinearError> {
        let matrix = Arc::new(pressure_matrix(topology, geometry, boundary));
        self.is_stale = true;
        if self.is_worn {
            return self.refresh(matrix, &geometry.points);
        }
        self.solver = self.solver.of_similar_matrix(matrix);
        Ok(())
    }

    /// Sets the preconditioner up for the shape at which the mesh has come to rest, where it was for
    /// another: what it saves is saved in every step to come. Collective.
    pub(super) fn settle(&mut self, points: &[Vector]) {
        if self.is_stale && self.refresh(self.solver.matrix(), points).is_err() {
            // The old one serves, and is not to be tried again in every step.
            self.is_stale = false;
        }
    }

    /// Sets the preconditioner up for this matrix. Collective.
    fn refresh(
        &mut self,
        matrix: Arc<SparseMatrix<1>>,
        points: &[Vector],
    ) -> Result<(), LinearError> {
        self.solver = self.solver.of_like_matrix(matrix)?;
        self.set_up_at = Some(points.to_vec());
        (self.is_stale, self.is_worn, self.usual_iterations) = (false, false, [0; 3]);
        Ok(())
    }

    /// Writes down what is not in the matrix.
    pub(super) fn save(&self, writer: &mut Writer, topology: &Topology) {
        writer.u8(self.is_stale.into());
        writer.u8(self.is_worn.into());
        self.usual_iterations.iter().for_each(|&usual| writer.u64(usual as u64));
        writer.u8(self.set_up_at.is_some().into());
        if let Some(points) = &self.set_up_at {
            writer.f64s(topology.to_mesh(points).as_flattened());
        }
    }

    /// Reads what was written down; where the mesh lay when the preconditioner was set up.
    pub(super) fn read(
        &mut self,
        reader: &mut Reader<'_>,
        topology: &Topology,
    ) -> Result<Option<Vec<Vector>>, Garbled> {
        (self.is_stale, self.is_worn) = (reader.u8()? != 0, reader.u8()? != 0);
        for usual in &mut self.usual_iterations {
            *usual = reader.count(0)?;
        }
        self.set_up_at = match reader.u8()? {
            0 => None,
            _ => {
                let points = reader.f64s(3 * topology.vertex_count())?;
                Some(topology.to_solver(points.as_chunks().0))
            }
        };
        Ok(self.set_up_at.clone())
    }

    /// Sets the preconditioner up for the matrix of an earlier shape. Collective.
    pub(super) fn prepare(&mut self, matrix: SparseMatrix<1>) -> Result<(), LinearError> {
        self.solver = self.solver.of_like_matrix(Arc::new(matrix))?;
        Ok(())
    }

    /// Takes the matrix of the present shape, with the preconditioner as it is.
    pub(super) fn take_matrix(&mut self, matrix: Arc<SparseMatrix<1>>) {
        self.solver = self.solver.of_similar_matrix(matrix);
    }

    /// Counts the iterations of a solve, to see whether the preconditioner still serves: beside
    /// solves that began alike.
    fn count(&mut self, start: Start, iterations: usize) {
        let most = self.usual_iterations.iter().copied().max().unwrap_or(0);
        let usual = &mut self.usual_iterations[start as usize];
        if !self.is_stale {
            *usual = (*usual).max(iterations);
        } else {
            // Where none has begun alike, the hardest of the others says what is usual.
            let usual = if *usual > 0 { *usual } else { most };
            self.is_worn = iterations > usual + usual / 2 + 2;
        }
    }

    /// Solves for the potential; `through` is the sum of the fluxes through the boundary's parts,
    /// which says what is small.
    #[expect(clippy::too_many_arguments, reason = "one step's mesh, flux and tolerance")]
    pub(super) fn solve(
        &mut self,
        topology: &Topology,
        halo: &Halo,
        potential: &mut [f64],
        points: &[Vector],
        start: Start,
        relative: f64,
        through: f64,
        open: bool,
    ) -> Outcome {
        for row in (0..topology.rows()).filter(|&row| topology.around(row).is_empty()) {
            self.right[row] = 0.0;
        }
        let sums = sum(topology.rows(), |range| {
            let used = range.clone().filter(|&row| !topology.around(row).is_empty()).count();
            let right = &self.right[range];
            [right.iter().map(|value| value * value).sum(), right.iter().sum(), used as f64]
        });
        let [square, whole, used] = total(halo.communicator(), sums);
        // Without an outlet only a right-hand side without a mean has a solution; the solver leaves
        // the mean out.
        let square = if open { square } else { (square - whole * whole / used.max(1.0)).max(0.0) };
        let size = square.sqrt();
        let small = 1e-9 * through / used.max(1.0).sqrt();
        // The residual is a loss of mass, and as such says alone what is good enough.
        let tolerance = Tolerance { relative: 0.0, absolute: (relative * size).max(small) };
        if self.is_worn && self.refresh(self.solver.matrix(), points).is_err() {
            // The old one has served so far, if slowly.
            self.is_worn = false;
        }
        let (right, potential) = (self.right.as_chunks().0, potential.as_chunks_mut().0);
        let outcome = match self.solver.solve_from(right, potential, tolerance) {
            Ok(found) => Outcome {
                iterations: found.iterations,
                residual: found.residual * size,
                converged: true,
            },
            Err(LinearError::NotConverged { iterations, residual, .. }) => {
                Outcome { iterations, residual: residual * size, converged: false }
            }
            Err(_) => Outcome { iterations: 0, residual: size, converged: false },
        };
        self.count(start, outcome.iterations);
        outcome
    }
}

/// The Laplacian, and at outlets the flux that a potential drives out of each vertex.
pub(super) fn pressure_matrix(
    topology: &Topology,
    geometry: &Geometry,
    boundary: &Boundary,
) -> SparseMatrix<1> {
    let mut matrix = geometry.laplacian(topology);
    let values = matrix.values_mut();
    for outlet in &boundary.outlets {
        let vertex = outlet.vertex as usize;
        values[topology.diagonal[vertex]][0][0] += outlet.yield_rate * length(outlet.area);
    }
    for vertex in (0..topology.rows()).filter(|&vertex| topology.around(vertex).is_empty()) {
        values[topology.diagonal[vertex]] = [[1.0]];
    }
    matrix
}
