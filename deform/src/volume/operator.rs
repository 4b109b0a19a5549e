//! The operator that carries boundary motion into a volume.

use std::sync::Arc;

use super::assembly::{Graph, Pattern, stiffness};
use super::element::Elements;
use super::equations::{Equations, Start, Stiffened, coupled, equations, separate};
use super::sliding::{Constraint, Sliding, constrain, constraints};
use super::{Deform, VolumeError, agreed};
use crate::communicator::{Communicator, Halo};
use crate::linear::{BuiltIn, LinearError, Solvers, SparseMatrix};
use crate::mesh::{Cells, Domain, Mesh, Ordered, Vector};

/// The operator that carries boundary motion into the volume of one reference mesh. Set up once
/// (checked, assembled, preconditioned), immutable afterwards, and shared between threads as it is.
///
/// # Guarantees
/// - Vertices of the boundary get exactly what is prescribed; vertices in no volume cell stay where
///   they are.
/// - No motion gives exact zeros; with [`Harmonic`](super::Method::Harmonic) so does every
///   component that does not move.
/// - A translation of the whole boundary, and a linearised rotation with elasticity, comes out to
///   rounding whatever the tolerance.
/// - The same bits whatever the number of threads.
///
/// It does *not* guarantee that no cell is turned inside out: that is what
/// [`judge`](crate::quality::judge) is for.
///
/// # Example
/// ```
/// use tombolo_deform::{shapes, volume::{Deform, VolumeOperator}};
///
/// let mesh = shapes::box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]);
/// let on_boundary = |p: &[f64; 3]| p.iter().any(|&x| x == 0.0 || x == 1.0);
/// let boundary: Vec<u32> = (0..).zip(mesh.points()).filter(|(_, p)| on_boundary(p)).map(|(v, _)| v).collect();
/// let operator = VolumeOperator::new(&mesh, &boundary, &Deform::default())?;
///
/// // Stretch the box along x by half.
/// let motion: Vec<_> = boundary.iter().map(|&v| [0.5 * mesh.points()[v as usize][0], 0.0, 0.0]).collect();
/// let solution = operator.solve(&motion)?;
/// let centre = 2 + 5 * (2 + 5 * 2);
/// assert!((solution.displacement[centre][0] - 0.25).abs() < 1e-6);
/// # Ok::<(), tombolo_deform::volume::VolumeError>(())
/// ```
#[derive(Debug)]
pub struct VolumeOperator {
    /// The graph, which depends on the cells alone.
    pub(super) graph: Arc<Graph>,
    /// The pattern of the equations, where this operator was made from another: others will be,
    /// then.
    pattern: Option<Arc<Pattern>>,
    pub(super) cells: Arc<Cells>,
    pub(super) settings: Deform,
    pub(super) boundary: Vec<u32>,
    pub(super) boundary_points: Vec<Vector>,
    pub(super) sliding: Vec<Sliding>,
    pub(super) constraints: Vec<Constraint>,
    /// Where the vertex of each unknown lies.
    pub(super) unknown_points: Vec<Vector>,
    pub(super) equations: Equations,
    pub(super) domain: Domain,
    /// The halo of the unknowns.
    pub(super) halo: Halo,
    /// The positions in `boundary` of the vertices that this rank owns.
    pub(super) own_boundary: Arc<[u32]>,
}

/// The displacement of every vertex of a mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct VolumeSolution {
    /// The displacement of each mesh vertex, from the reference.
    pub displacement: Vec<Vector>,
    /// How many iterations the solve took; with several solves (harmonic), the most of any.
    pub iterations: usize,
    /// The relative residual reached; with several solves, the largest of any.
    pub residual: f64,
}

impl VolumeOperator {
    /// Sets up the operator of a domain as it lies, where the displacement of the vertices
    /// `boundary` will be prescribed: all vertices on the mesh's boundary, each once, in any order.
    /// Cells of lower dimension are passed over; in a mesh that has no others, there is nothing to
    /// solve for.
    ///
    /// Of a domain of several ranks, `boundary` are those vertices of the part that are so in the
    /// whole mesh, be it that no cell of this rank has a face on its boundary. Collective, as is
    /// all that is done with the operator: every rank brings its part of the displacement of the
    /// boundary.
    ///
    /// Memory: about 100 bytes for each pair of neighbouring vertices (elasticity) or 25 (harmonic);
    /// while it is set up, twice as much.
    ///
    /// # Errors
    /// [`VolumeError::Setting`], [`VolumeError::BoundaryVertex`], [`VolumeError::BoundaryTwice`];
    /// [`VolumeError::InvertedCell`] for a flat or inverted reference cell;
    /// [`VolumeError::Unattached`] for cells that no boundary vertex holds;
    /// [`VolumeError::OtherRank`], where another rank has an error of its own.
    pub fn new(
        domain: impl Into<Domain>,
        boundary: &[u32],
        settings: &Deform,
    ) -> Result<Self, VolumeError> {
        Self::with_sliding(domain, boundary, &[], settings, &BuiltIn)
    }

    /// Sets up the operator where other vertices on the mesh's boundary slide, and those in neither
    /// list are free of force; its systems are solved by `solvers`. With any vertices that slide,
    /// all components of a harmonic displacement are solved for together.
    ///
    /// Each connected part of the mesh must still have a vertex in `boundary`; enough of them, or
    /// of sliding ones, that it cannot turn.
    ///
    /// # Errors
    /// Also [`VolumeError::SlidingNormal`], and [`VolumeError::BoundaryTwice`] for a vertex of
    /// `boundary` that is said to slide.
    pub fn with_sliding(
        domain: impl Into<Domain>,
        boundary: &[u32],
        sliding: &[Sliding],
        settings: &Deform,
        solvers: &dyn Solvers,
    ) -> Result<Self, VolumeError> {
        settings.validate()?;
        let domain = domain.into();
        let mesh = domain.mesh();
        let cells = mesh.cells().len();
        let go_on = || {
            if solvers.are_wanted() { Ok(()) } else { Err(LinearError::Cancelled) }
        };
        let countable = if u32::try_from(cells).is_ok() {
            Ok(())
        } else {
            Err(VolumeError::TooLarge { cells })
        };
        agreed(domain.communicator(), countable)?;
        go_on()?;
        let ordered = Arc::new(Ordered::new(mesh));
        let elements = Elements::new(ordered.mesh());
        go_on()?;
        let stiffness =
            stiffness(&ordered, ordered.mesh(), &elements, settings.stiffening, &domain)?;
        go_on()?;
        let (graph, pattern) = Graph::new(Arc::clone(&ordered), boundary, &domain)?;
        let graph = Arc::new(graph);
        let constraints =
            agreed(domain.communicator(), checked_constraints(mesh, &graph, sliding))?;
        let halo = domain.halo().of(&graph.vertices);
        let positions = |vertices: &[u32]| -> Vec<Vector> {
            vertices.iter().map(|&vertex| mesh.points()[vertex as usize]).collect()
        };
        let unknown_points = positions(&graph.vertices);
        go_on()?;
        let start = Start::Fresh(solvers, &halo, &unknown_points);
        let stiffened = Stiffened { mesh: ordered.mesh(), elements, stiffness };
        let pattern = Arc::new(pattern);
        let equations = equations(&graph, pattern, &stiffened, &constraints, settings, start)?;
        let owned = (0..).zip(boundary).filter(|(_, vertex)| domain.owns(**vertex));
        Ok(Self {
            cells: Arc::clone(mesh.shared_cells()),
            settings: *settings,
            boundary_points: positions(boundary),
            boundary: boundary.to_vec(),
            sliding: sliding.to_vec(),
            constraints,
            unknown_points,
            halo,
            own_boundary: owned.map(|(position, _)| position).collect(),
            domain,
            graph,
            pattern: None,
            equations,
        })
    }

    /// The operator of the same cells with the vertices elsewhere: the stiffness is that of the
    /// cells as they lie now, and what depends on the cells alone (the graph, its order, the
    /// aggregates of multigrid) is used again.
    ///
    /// # Errors
    /// [`VolumeError::OtherCells`] where `mesh` does not have the cells that this operator was set
    /// up for; [`VolumeError::InvertedCell`].
    pub fn updated(&self, mesh: &Mesh) -> Result<Self, VolumeError> {
        self.restiffened(mesh, self.settings.stiffening)
    }

    /// The operator of the same cells with the vertices elsewhere, and another exponent of the
    /// stiffening.
    ///
    /// # Errors
    /// As [`VolumeOperator::updated`], and [`VolumeError::Setting`].
    pub fn restiffened(&self, mesh: &Mesh, stiffening: f64) -> Result<Self, VolumeError> {
        let settings = Deform { stiffening, ..self.settings };
        settings.validate()?;
        let same =
            *mesh.shared_cells() == self.cells && mesh.points().len() == self.graph.vertex_count();
        agreed(
            self.domain.communicator(),
            if same { Ok(()) } else { Err(VolumeError::OtherCells) },
        )?;
        let ordered = self.graph.ordered.like(mesh);
        let stiffened = self.stiffened(&ordered, stiffening)?;
        let pattern = self.pattern();
        let equations = equations(
            &self.graph,
            Arc::clone(&pattern),
            &stiffened,
            &self.constraints,
            &settings,
            Start::Like(&self.equations),
        )?;
        let positions = |vertices: &[u32]| {
            vertices.iter().map(|&vertex| mesh.points()[vertex as usize]).collect()
        };
        Ok(Self {
            graph: Arc::clone(&self.graph),
            pattern: Some(pattern),
            cells: Arc::clone(&self.cells),
            settings,
            boundary: self.boundary.clone(),
            boundary_points: positions(&self.boundary),
            sliding: self.sliding.clone(),
            constraints: self.constraints.clone(),
            unknown_points: positions(&self.graph.vertices),
            halo: self.halo.clone(),
            own_boundary: Arc::clone(&self.own_boundary),
            domain: self.domain.with_mesh(mesh.clone()),
            equations,
        })
    }

    fn pattern(&self) -> Arc<Pattern> {
        self.pattern.clone().unwrap_or_else(|| Arc::new(self.graph.pattern()))
    }

    /// The cells of a mesh in the order of the graph, as stiff as they are.
    fn stiffened<'a>(
        &self,
        ordered: &'a Mesh,
        stiffening: f64,
    ) -> Result<Stiffened<'a>, VolumeError> {
        let elements = Elements::new(ordered);
        let stiffness =
            stiffness(&self.graph.ordered, ordered, &elements, stiffening, &self.domain)?;
        Ok(Stiffened { mesh: ordered, elements, stiffness })
    }

    /// The operator with another tolerance: the part of the right side that its solves may leave.
    #[must_use]
    pub fn with_tolerance(mut self, tolerance: f64) -> Self {
        self.settings.tolerance = tolerance;
        self
    }

    /// The vertices whose displacement is prescribed, in the order in which
    /// [`VolumeOperator::solve`] takes them.
    #[must_use]
    pub fn boundary(&self) -> &[u32] {
        &self.boundary
    }

    /// How many vertices are solved for.
    #[must_use]
    pub fn unknowns(&self) -> usize {
        self.graph.vertices.len()
    }

    /// Where the vertices that are solved for lie in the mesh of this operator, in the order of the
    /// equations.
    #[must_use]
    pub fn unknown_points(&self) -> &[Vector] {
        &self.unknown_points
    }

    /// Where each component is solved for by itself, as with [`Harmonic`](super::Method::Harmonic)
    /// unless vertices slide, the matrix of its equations: to try other solvers on. It is assembled
    /// anew.
    #[must_use]
    pub fn separate_matrix(&self) -> Option<SparseMatrix<1>> {
        let Equations::Separate(_) = &self.equations else { return None };
        let ordered = self.graph.ordered.like(self.domain.mesh());
        let stiffened = self.stiffened(&ordered, self.settings.stiffening).ok()?;
        Some(separate(&self.graph, self.pattern(), &stiffened).0)
    }

    /// Where the three components are solved for together, as with
    /// [`Elasticity`](super::Method::Elasticity), the matrix and the right side of the equations
    /// that [`VolumeOperator::solve`] solves for these displacements of the boundary, less the
    /// rigid motion nearest to them: to try other solvers on. The matrix is assembled anew.
    ///
    /// # Panics
    /// Where there is not one displacement for each of [`VolumeOperator::boundary`].
    #[must_use]
    pub fn coupled_equations(
        &self,
        boundary_displacement: &[Vector],
    ) -> Option<(SparseMatrix<3>, Vec<Vector>)> {
        assert_eq!(
            boundary_displacement.len(),
            self.boundary.len(),
            "one displacement for each boundary vertex"
        );
        let Equations::Coupled(system) = &self.equations else { return None };
        let ordered = self.graph.ordered.like(self.domain.mesh());
        let stiffened = self.stiffened(&ordered, self.settings.stiffening).ok()?;
        let mut matrix = coupled(&self.graph, self.pattern(), &stiffened, &self.settings).0;
        constrain(&mut matrix, &self.constraints);
        let (rigid, rest) = self.less_rigid(boundary_displacement);
        let across = |constraint: &Constraint| {
            constraint.across(rigid.at(self.unknown_points[constraint.row]))
        };
        let rest_sliding: Vec<Vector> = self.constraints.iter().map(across).collect();
        Some((matrix, self.coupled_right_side(system, &rest, &rest_sliding)))
    }

    /// The displacement of every vertex for these displacements of the boundary vertices, one for
    /// each of [`VolumeOperator::boundary`].
    ///
    /// # Errors
    /// [`VolumeError::BoundaryCount`]; [`VolumeError::NotFinite`] for a displacement that is NaN or
    /// infinite; [`VolumeError::Linear`] where the iteration fails, or a displacement is so large
    /// that arithmetic overflows.
    pub fn solve(&self, boundary_displacement: &[Vector]) -> Result<VolumeSolution, VolumeError> {
        self.solve_sliding(boundary_displacement, &vec![[0.0; 3]; self.sliding.len()])
    }

    /// The displacement of every vertex, solved for from one that is near to it, such as that of a
    /// like motion: fewer iterations where it is. Within the tolerance the result then depends on
    /// where it started from; where orders must come out to the same bits whatever came before,
    /// start from zero.
    ///
    /// # Errors
    /// Also [`VolumeError::StartCount`], and [`VolumeError::NotFinite`] for a start that is not.
    pub fn solve_from(
        &self,
        boundary_displacement: &[Vector],
        start: &[Vector],
    ) -> Result<VolumeSolution, VolumeError> {
        self.solve_all(boundary_displacement, &vec![[0.0; 3]; self.sliding.len()], Some(start))
    }

    /// The displacement of every vertex where sliding surfaces move: of each displacement in
    /// `sliding_displacement`, one for each of the sliding vertices in the order in which they were
    /// given, the part across the surface is prescribed. A vertex that is listed several times
    /// takes the displacement of its first entry.
    ///
    /// # Errors
    /// Also [`VolumeError::SlidingCount`].
    pub fn solve_sliding(
        &self,
        boundary_displacement: &[Vector],
        sliding_displacement: &[Vector],
    ) -> Result<VolumeSolution, VolumeError> {
        self.solve_all(boundary_displacement, sliding_displacement, None)
    }

    fn solve_all(
        &self,
        boundary_displacement: &[Vector],
        sliding_displacement: &[Vector],
        start: Option<&[Vector]>,
    ) -> Result<VolumeSolution, VolumeError> {
        agreed(
            self.domain.communicator(),
            self.check_displacements(boundary_displacement, sliding_displacement, start),
        )?;
        let mut displacement = vec![[0.0; 3]; self.graph.vertex_count()];
        for (&vertex, &value) in self.boundary.iter().zip(boundary_displacement) {
            displacement[vertex as usize] = value;
        }
        let convergence = match &self.equations {
            Equations::Coupled(system) => self.solve_coupled(
                system,
                boundary_displacement,
                sliding_displacement,
                start,
                &mut displacement,
            )?,
            Equations::Separate(system) => {
                self.solve_separate(system, boundary_displacement, start, &mut displacement)?
            }
        };
        if !self
            .domain
            .communicator()
            .all(displacement.as_flattened().iter().all(|value| value.is_finite()))
        {
            return Err(LinearError::NotFinite { iteration: convergence.iterations }.into());
        }
        Ok(VolumeSolution {
            displacement,
            iterations: convergence.iterations,
            residual: convergence.residual,
        })
    }

    fn check_displacements(
        &self,
        boundary: &[Vector],
        sliding: &[Vector],
        start: Option<&[Vector]>,
    ) -> Result<(), VolumeError> {
        if sliding.len() != self.sliding.len() {
            return Err(VolumeError::SlidingCount {
                found: sliding.len(),
                expected: self.sliding.len(),
            });
        }
        if boundary.len() != self.boundary.len() {
            return Err(VolumeError::BoundaryCount {
                found: boundary.len(),
                expected: self.boundary.len(),
            });
        }
        let given = self.sliding.iter().map(|sliding| sliding.vertex).zip(sliding);
        let given = given.chain(self.boundary.iter().copied().zip(boundary));
        if let Some(found) =
            start.map(<[Vector]>::len).filter(|&found| found != self.graph.vertex_count())
        {
            return Err(VolumeError::StartCount { found, expected: self.graph.vertex_count() });
        }
        let start = start.unwrap_or_default();
        if let Some((vertex, &value)) = given
            .chain((0..).zip(start))
            .find(|(_, value)| !value.iter().all(|component| component.is_finite()))
        {
            return Err(VolumeError::NotFinite { vertex, value });
        }
        Ok(())
    }
}

fn checked_constraints(
    mesh: &Mesh,
    graph: &Graph,
    sliding: &[Sliding],
) -> Result<Vec<Constraint>, VolumeError> {
    for &Sliding { vertex, .. } in sliding {
        let vertex_count = mesh.points().len();
        if vertex as usize >= vertex_count {
            return Err(VolumeError::BoundaryVertex { vertex, vertex_count });
        }
        if graph.is_boundary(vertex) {
            return Err(VolumeError::BoundaryTwice { vertex });
        }
    }
    constraints(sliding, |vertex| graph.unknown(vertex))
}
