//! The equations of the free vertices of a volume, and their set-up.

use std::sync::Arc;

use super::assembly::{Elastic, Graph, Laplace, Pattern, VectorLaplace};
use super::element::Elements;
use super::sliding::{Constraint, constrain};
use super::{Deform, Method};
use crate::communicator::{Communicator, Halo};
use crate::linear::{LinearError, LinearSolver, Solvers, SparseMatrix};
use crate::mesh::{Mesh, Vector};

/// The equations of a volume.
#[derive(Debug)]
pub(super) enum Equations {
    /// The three components together: elasticity, and whatever has sliding vertices.
    Coupled(System<3>),
    /// Each component by itself.
    Separate(System<1>),
}

/// The equations of the free vertices.
#[derive(Debug)]
pub(super) struct System<const B: usize> {
    /// The blocks that couple them to the boundary.
    pub(super) coupling: SparseMatrix<B>,
    /// The blocks that couple them to the prescribed displacements of sliding vertices.
    pub(super) sliding: SparseMatrix<B>,
    pub(super) solver: Box<dyn LinearSolver<B>>,
}

impl<const B: usize> System<B> {
    /// `slide` brings sliding vertices into the matrix, `set_up` makes its solver.
    fn new(
        (matrix, coupling): (SparseMatrix<B>, SparseMatrix<B>),
        slide: impl FnOnce(&mut SparseMatrix<B>) -> SparseMatrix<B>,
        set_up: impl FnOnce(Arc<SparseMatrix<B>>) -> Result<Box<dyn LinearSolver<B>>, LinearError>,
    ) -> Result<Self, LinearError> {
        let mut matrix = matrix;
        let sliding = slide(&mut matrix);
        // The solver keeps what it needs of the matrix.
        let solver = set_up(Arc::new(matrix))?;
        Ok(Self { coupling, sliding, solver })
    }
}

/// The start of a set-up of equations.
#[derive(Clone, Copy)]
pub(super) enum Start<'a> {
    /// The solvers, the halo of the unknowns, and where these lie.
    Fresh(&'a dyn Solvers, &'a Halo, &'a [Vector]),
    /// Equations of the same graph.
    Like(&'a Equations),
}

impl Start<'_> {
    /// Whether the components of a harmonic displacement are solved for together: where any rank
    /// has sliding vertices.
    fn is_coupled(self, constraints: &[Constraint]) -> bool {
        match self {
            Start::Fresh(_, halo, _) => halo.communicator().any(!constraints.is_empty()),
            Start::Like(equations) => matches!(equations, Equations::Coupled(_)),
        }
    }
}

/// The mesh in the order of a graph, with the stiffness of each of its cells.
pub(super) struct Stiffened<'a> {
    pub(super) mesh: &'a Mesh,
    pub(super) elements: Elements<'a>,
    pub(super) stiffness: Vec<f64>,
}

/// Assembles the matrix of the equations of a displacement whose components are solved for
/// together, and that which couples them to the boundary.
pub(super) fn coupled(
    graph: &Graph,
    pattern: Arc<Pattern>,
    stiffened: &Stiffened<'_>,
    settings: &Deform,
) -> (SparseMatrix<3>, SparseMatrix<3>) {
    let Stiffened { mesh, elements, stiffness } = stiffened;
    match settings.method {
        Method::Elasticity => {
            let form = Elastic::new(settings.poisson_ratio);
            graph.assemble(pattern, mesh, elements, &form, stiffness)
        }
        Method::Harmonic => graph.assemble(pattern, mesh, elements, &VectorLaplace, stiffness),
    }
}

/// Assembles the matrix of the equations of each component, and that which couples them to the
/// boundary.
pub(super) fn separate(
    graph: &Graph,
    pattern: Arc<Pattern>,
    stiffened: &Stiffened<'_>,
) -> (SparseMatrix<1>, SparseMatrix<1>) {
    let Stiffened { mesh, elements, stiffness } = stiffened;
    graph.assemble(pattern, mesh, elements, &Laplace, stiffness)
}

/// Assembles the equations and sets up their solver.
pub(super) fn equations(
    graph: &Graph,
    pattern: Arc<Pattern>,
    stiffened: &Stiffened<'_>,
    constraints: &[Constraint],
    settings: &Deform,
    start: Start<'_>,
) -> Result<Equations, LinearError> {
    // On one rank that has sliding vertices all ranks must solve for the components together.
    if settings.method == Method::Harmonic && !start.is_coupled(constraints) {
        let system = separate(graph, pattern, stiffened);
        let none = |matrix: &mut SparseMatrix<1>| {
            SparseMatrix::zeros(vec![0; matrix.rows() + 1], Vec::new())
        };
        let set_up = |matrix: Arc<SparseMatrix<1>>| match start {
            Start::Like(Equations::Separate(like)) => like.solver.renewed(matrix),
            Start::Like(Equations::Coupled(_)) => crate::linear::solver(matrix, &Halo::none()),
            Start::Fresh(solvers, halo, positions) => solvers.scalar(matrix, halo, positions),
        };
        return System::new(system, none, set_up).map(Equations::Separate);
    }
    let system = coupled(graph, pattern, stiffened, settings);
    let slide = |matrix: &mut SparseMatrix<3>| constrain(matrix, constraints);
    let set_up = |matrix: Arc<SparseMatrix<3>>| match start {
        Start::Like(Equations::Coupled(like)) => like.solver.renewed(matrix),
        Start::Like(Equations::Separate(_)) => crate::linear::solver(matrix, &Halo::none()),
        Start::Fresh(solvers, halo, positions) => solvers.vector(matrix, halo, positions),
    };
    System::new(system, slide, set_up).map(Equations::Coupled)
}
