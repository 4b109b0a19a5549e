//! The operator that carries boundary motion into a volume.

use std::sync::Arc;

use super::assembly::{Elastic, Graph, Laplace, VectorLaplace, stiffness};
use super::element::Elements;
use super::rigid::RigidMotion;
use super::sliding::{Constraint, Sliding, constrain, constraints};
use super::{Deform, Method, VolumeError, agreed};
use crate::linear::{Convergence, LinearError, LinearSolver, SparseMatrix, Tolerance};
use crate::mesh::{Cells, Mesh, Ordered, Vector};
use crate::partition::{
    Partition, Reduction, Shares, all, any, scalar_solver, vector_solver, whole,
};
use crate::vector::{add, subtract};

/// A residual this small against the right side is rounding.
const ROUNDING: f64 = 1e-12;

/// The operator that carries boundary motion into the volume of one reference mesh. Set up once (checked, assembled,
/// preconditioned), immutable afterwards, and shared between threads as it is.
///
/// # Guarantees
/// - Vertices of the boundary get exactly what is prescribed; vertices in no volume cell stay where they are.
/// - No motion gives exact zeros; with [`Method::Harmonic`] so does every component that does not move.
/// - A translation of the whole boundary, and a linearised rotation with elasticity, comes out to rounding whatever the
///   tolerance.
/// - The same bits whatever the number of threads.
///
/// It does *not* guarantee that no cell is turned inside out: that is what [`judge`](crate::quality::judge) is for.
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
    /// What depends on the cells alone.
    graph: Arc<Graph>,
    cells: Arc<Cells>,
    settings: Deform,
    boundary: Vec<u32>,
    boundary_points: Vec<Vector>,
    sliding: Vec<Sliding>,
    constraints: Vec<Constraint>,
    /// Where the vertex of each unknown lies.
    unknown_points: Vec<Vector>,
    equations: Equations,
    partition: Arc<dyn Partition>,
    /// Which unknowns other ranks have too.
    shares: Arc<Shares>,
    /// The places in `boundary` of the vertices that this rank speaks for.
    own_boundary: Arc<[u32]>,
}

#[derive(Debug)]
enum Equations {
    /// The three components together: elasticity, and whatever has sliding vertices.
    Coupled(System<3>),
    /// Each component by itself.
    Separate(System<1>),
}

/// The equations of the free vertices.
#[derive(Debug)]
struct System<const B: usize> {
    matrix: Arc<SparseMatrix<B>>,
    /// What couples them to the boundary.
    coupling: SparseMatrix<B>,
    /// What couples them to the prescribed displacements of sliding vertices.
    sliding: SparseMatrix<B>,
    solver: Box<dyn LinearSolver<B>>,
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
        let matrix = Arc::new(matrix);
        let solver = set_up(Arc::clone(&matrix))?;
        Ok(Self { matrix, coupling, sliding, solver })
    }
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
    /// Sets up the operator of `mesh` as it lies, where the displacement of the vertices `boundary` will be prescribed: all
    /// vertices of the mesh's boundary, each once, in any order. Cells of lower dimension are passed over; in a mesh that has
    /// no others, there is nothing to solve for.
    ///
    /// Memory: about 150 bytes for each pair of neighbouring vertices (elasticity) or 30 (harmonic).
    ///
    /// # Errors
    /// [`VolumeError::Setting`], [`VolumeError::BoundaryVertex`], [`VolumeError::BoundaryTwice`]; [`VolumeError::InvertedCell`]
    /// for a flat or inverted reference cell; [`VolumeError::Unattached`] for cells that no boundary vertex holds.
    pub fn new(mesh: &Mesh, boundary: &[u32], settings: &Deform) -> Result<Self, VolumeError> {
        Self::with_sliding(mesh, boundary, &[], settings)
    }

    /// The same where other vertices of the mesh's boundary slide, and those in neither list are free of force. With any that
    /// slide, all components of a harmonic displacement are solved for together.
    ///
    /// Each connected part of the mesh must still have a vertex in `boundary`; enough of them, or of sliding ones, that it cannot
    /// turn.
    ///
    /// # Errors
    /// Also [`VolumeError::SlidingNormal`], and [`VolumeError::BoundaryTwice`] for a vertex of `boundary` that is said to slide.
    pub fn with_sliding(
        mesh: &Mesh,
        boundary: &[u32],
        sliding: &[Sliding],
        settings: &Deform,
    ) -> Result<Self, VolumeError> {
        Self::of_part(mesh, boundary, sliding, settings, &whole())
    }

    /// The same where `mesh` is the part of this rank, whose cells no other rank has. `boundary` and `sliding` are those vertices
    /// of the part that are so in the whole mesh, be it that no cell of this rank has a face on its boundary. Collective, as is all
    /// that is done with the operator: every rank calls it with its own part, and its part of the displacement of the boundary.
    ///
    /// # Errors
    /// Also [`VolumeError::OtherRank`], where another rank has an error of its own.
    pub fn of_part(
        mesh: &Mesh,
        boundary: &[u32],
        sliding: &[Sliding],
        settings: &Deform,
        partition: &Arc<dyn Partition>,
    ) -> Result<Self, VolumeError> {
        settings.validate()?;
        let cells = mesh.cells().len();
        let countable = if u32::try_from(cells).is_ok() {
            Ok(())
        } else {
            Err(VolumeError::TooLarge { cells })
        };
        agreed(&**partition, countable)?;
        let ordered = Arc::new(Ordered::new(mesh));
        let elements = Elements::new(ordered.mesh());
        let stiffness =
            stiffness(&ordered, ordered.mesh(), &elements, settings.stiffening, &**partition)?;
        let graph = Arc::new(Graph::new(Arc::clone(&ordered), boundary, &**partition)?);
        let constraints = agreed(&**partition, checked_constraints(mesh, &graph, sliding))?;
        let start = Start::Fresh(partition);
        let equations = equations(
            &graph,
            ordered.mesh(),
            &elements,
            &stiffness,
            &constraints,
            settings,
            start,
        )?;
        let places = |vertices: &[u32]| {
            vertices.iter().map(|&vertex| mesh.points()[vertex as usize]).collect()
        };
        let owned = (0..).zip(boundary).filter(|(_, vertex)| partition.owns(**vertex));
        Ok(Self {
            cells: Arc::clone(mesh.shared_cells()),
            settings: *settings,
            boundary_points: places(boundary),
            boundary: boundary.to_vec(),
            sliding: sliding.to_vec(),
            constraints,
            unknown_points: places(&graph.vertices),
            shares: Arc::new(Shares::new(&**partition, &graph.vertices)),
            own_boundary: owned.map(|(place, _)| place).collect(),
            partition: Arc::clone(partition),
            graph,
            equations,
        })
    }

    /// The operator of the same cells with the vertices elsewhere: the stiffness is that of the cells as they lie now, and what
    /// depends on the cells alone (the graph, its order, the aggregates of multigrid) is used again.
    ///
    /// # Errors
    /// [`VolumeError::OtherCells`] where `mesh` does not have the cells that this operator was set up for;
    /// [`VolumeError::InvertedCell`].
    pub fn updated(&self, mesh: &Mesh) -> Result<Self, VolumeError> {
        self.restiffened(mesh, self.settings.stiffening)
    }

    /// The same with another exponent of the stiffening.
    ///
    /// # Errors
    /// As [`VolumeOperator::updated`], and [`VolumeError::Setting`].
    pub fn restiffened(&self, mesh: &Mesh, stiffening: f64) -> Result<Self, VolumeError> {
        let settings = Deform { stiffening, ..self.settings };
        settings.validate()?;
        let same =
            *mesh.shared_cells() == self.cells && mesh.points().len() == self.graph.vertex_count();
        agreed(&*self.partition, if same { Ok(()) } else { Err(VolumeError::OtherCells) })?;
        let ordered = self.graph.ordered.like(mesh);
        let elements = Elements::new(&ordered);
        let stiffness =
            stiffness(&self.graph.ordered, &ordered, &elements, stiffening, &*self.partition)?;
        let like = Start::Like(&self.equations);
        let equations = equations(
            &self.graph,
            &ordered,
            &elements,
            &stiffness,
            &self.constraints,
            &settings,
            like,
        )?;
        let places = |vertices: &[u32]| {
            vertices.iter().map(|&vertex| mesh.points()[vertex as usize]).collect()
        };
        Ok(Self {
            graph: Arc::clone(&self.graph),
            cells: Arc::clone(&self.cells),
            settings,
            boundary: self.boundary.clone(),
            boundary_points: places(&self.boundary),
            sliding: self.sliding.clone(),
            constraints: self.constraints.clone(),
            unknown_points: places(&self.graph.vertices),
            shares: Arc::clone(&self.shares),
            own_boundary: Arc::clone(&self.own_boundary),
            partition: Arc::clone(&self.partition),
            equations,
        })
    }

    /// The same operator, whose solves are to leave another part of the right side.
    #[must_use]
    pub fn with_tolerance(mut self, tolerance: f64) -> Self {
        self.settings.tolerance = tolerance;
        self
    }

    /// The vertices whose displacement is prescribed, in the order in which [`VolumeOperator::solve`] takes them.
    #[must_use]
    pub fn boundary(&self) -> &[u32] {
        &self.boundary
    }

    /// How many vertices are solved for.
    #[must_use]
    pub fn unknowns(&self) -> usize {
        self.graph.vertices.len()
    }

    /// Where the vertices that are solved for lie in the mesh of this operator, in the order of the equations.
    #[must_use]
    pub fn unknown_points(&self) -> &[Vector] {
        &self.unknown_points
    }

    /// Where each component is solved for by itself, as with [`Method::Harmonic`] unless vertices slide, the matrix of its
    /// equations: to try other solvers on.
    #[must_use]
    pub fn separate_matrix(&self) -> Option<&SparseMatrix<1>> {
        match &self.equations {
            Equations::Separate(system) => Some(&system.matrix),
            Equations::Coupled(_) => None,
        }
    }

    /// Where the three components are solved for together, as with [`Method::Elasticity`], the matrix and the right side of the
    /// equations that [`VolumeOperator::solve`] solves for these displacements of the boundary, less the rigid motion nearest to
    /// them: to try other solvers on.
    ///
    /// # Panics
    /// Where there is not one displacement for each of [`VolumeOperator::boundary`].
    #[must_use]
    pub fn coupled_equations(
        &self,
        boundary_displacement: &[Vector],
    ) -> Option<(&SparseMatrix<3>, Vec<Vector>)> {
        assert_eq!(
            boundary_displacement.len(),
            self.boundary.len(),
            "one displacement for each boundary vertex"
        );
        let Equations::Coupled(system) = &self.equations else { return None };
        let (rigid, rest) = self.less_rigid(boundary_displacement);
        let across = |constraint: &Constraint| {
            constraint.across(rigid.at(self.unknown_points[constraint.row]))
        };
        let rest_sliding: Vec<Vector> = self.constraints.iter().map(across).collect();
        Some((&system.matrix, self.coupled_right_side(system, &rest, &rest_sliding)))
    }

    /// The displacement of every vertex for these displacements of the boundary vertices, one for each of
    /// [`VolumeOperator::boundary`].
    ///
    /// # Errors
    /// [`VolumeError::BoundaryCount`]; [`VolumeError::NotFinite`] for a displacement that is NaN or infinite;
    /// [`VolumeError::Linear`] where the iteration fails, or a displacement is so large that arithmetic overflows.
    pub fn solve(&self, boundary_displacement: &[Vector]) -> Result<VolumeSolution, VolumeError> {
        self.solve_sliding(boundary_displacement, &vec![[0.0; 3]; self.sliding.len()])
    }

    /// The same from a displacement of every vertex that is near to it, such as that of a like motion: fewer iterations where it
    /// is. Within the tolerance the result then depends on where it started from; where orders must come out to the same bits
    /// whatever came before, start from zero.
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

    /// The same where sliding surfaces move: of each displacement in `sliding_displacement`, one for each of the sliding vertices
    /// in the order in which they were given, the part across the surface is prescribed. A vertex that is listed several times
    /// takes the displacement of its first place.
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
            &*self.partition,
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
        if !all(&*self.partition, displacement.as_flattened().iter().all(|value| value.is_finite()))
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

    /// The 2-norm of what the ranks' values of the unknowns add up to.
    fn norms<const B: usize, const K: usize>(&self, values: &[[[f64; B]; K]]) -> [f64; K] {
        if self.partition.ranks() == 1 {
            return crate::linear::norms(values);
        }
        let mut values = values.to_vec();
        self.shares.sum(&*self.partition, B * K, values.as_flattened_mut().as_flattened_mut());
        for &place in self.shares.places() {
            if !self.shares.owns(place as usize) {
                values[place as usize] = [[0.0; B]; K];
            }
        }
        let mut squares = crate::linear::norms(&values).map(|norm| norm * norm);
        self.partition.reduce(Reduction::Sum, &mut squares);
        squares.map(f64::sqrt)
    }

    /// The values of the boundary vertices that this rank speaks for.
    fn own<T: Copy>(&self, boundary: &[T]) -> Vec<T> {
        self.own_boundary.iter().map(|&place| boundary[place as usize]).collect()
    }

    /// The rigid motion nearest to the boundary's, and that motion less the boundary's.
    fn less_rigid(&self, boundary: &[Vector]) -> (RigidMotion, Vec<Vector>) {
        let mut rigid = RigidMotion::nearest(
            &self.own(&self.boundary_points),
            &self.own(boundary),
            &*self.partition,
        );
        if self.settings.method == Method::Harmonic {
            // A rotation is no solution where the boundary is free.
            rigid = rigid.translation();
        }
        let rest = self.boundary_points.iter().zip(boundary).map(|(&point, &value)| {
            let motion = rigid.at(point);
            std::array::from_fn(|axis| motion[axis] - value[axis])
        });
        (rigid, rest.collect())
    }

    /// A rigid motion strains nothing, so the one nearest to the boundary's motion is taken off, and added again at the end.
    fn solve_coupled(
        &self,
        system: &System<3>,
        boundary: &[Vector],
        sliding: &[Vector],
        start: Option<&[Vector]>,
        displacement: &mut [Vector],
    ) -> Result<Convergence, LinearError> {
        if all(&*self.partition, boundary.iter().chain(sliding).all(|value| *value == [0.0; 3])) {
            return Ok(Convergence::default());
        }
        let (rigid, rest) = self.less_rigid(boundary);
        let across = |part: &dyn Fn(&Constraint) -> Vector| -> Vec<Vector> {
            self.constraints.iter().map(|constraint| constraint.across(part(constraint))).collect()
        };
        let whole_sliding = across(&|constraint| sliding[constraint.first]);
        let rest_sliding = across(&|constraint| {
            subtract(rigid.at(self.unknown_points[constraint.row]), sliding[constraint.first])
        });
        let whole = self.coupled_right_side(system, boundary, &whole_sliding);
        let [norm] = self.norms::<3, 1>(whole.as_chunks().0);
        let absolute = ROUNDING * norm;
        let right_side = self.coupled_right_side(system, &rest, &rest_sliding);
        let tolerance = Tolerance { relative: self.settings.tolerance, absolute };
        let mut solution = vec![[0.0; 3]; right_side.len()];
        if let Some(start) = start {
            for ((value, &vertex), &point) in
                solution.iter_mut().zip(&self.graph.vertices).zip(&self.unknown_points)
            {
                *value = subtract(start[vertex as usize], rigid.at(point));
            }
            for constraint in &self.constraints {
                solution[constraint.row] = constraint.along(solution[constraint.row]);
            }
        }
        let convergence = system.solver.solve_from(&right_side, &mut solution, tolerance)?;
        for (constraint, &rest) in self.constraints.iter().zip(&rest_sliding) {
            solution[constraint.row] = subtract(constraint.along(solution[constraint.row]), rest);
        }
        for ((&vertex, &point), value) in
            self.graph.vertices.iter().zip(&self.unknown_points).zip(solution)
        {
            let motion = rigid.at(point);
            displacement[vertex as usize] = std::array::from_fn(|axis| motion[axis] + value[axis]);
        }
        Ok(convergence)
    }

    /// The right side for the boundary motion `-rest`, the prescribed motion of sliding vertices being `-rest_sliding`.
    fn coupled_right_side(
        &self,
        system: &System<3>,
        rest: &[Vector],
        rest_sliding: &[Vector],
    ) -> Vec<Vector> {
        let mut right_side = vec![[0.0; 3]; self.graph.vertices.len()];
        system.coupling.multiply(rest, &mut right_side);
        if !self.constraints.is_empty() {
            let mut other = vec![[0.0; 3]; right_side.len()];
            system.sliding.multiply(rest_sliding, &mut other);
            for (value, other) in right_side.iter_mut().zip(other) {
                *value = add(*value, other);
            }
            for constraint in &self.constraints {
                right_side[constraint.row] = constraint.along(right_side[constraint.row]);
            }
        }
        right_side
    }

    /// A solve for each component that moves, its mean taken off first; all three at once where more than one does.
    fn solve_separate(
        &self,
        system: &System<1>,
        boundary: &[Vector],
        start: Option<&[Vector]>,
        displacement: &mut [Vector],
    ) -> Result<Convergence, LinearError> {
        let from = |vertex: u32, axis: usize, mean: f64| {
            start.map_or(0.0, |start| start[vertex as usize][axis] - mean)
        };
        let mut moves: Vector = std::array::from_fn(|axis| {
            f64::from(u8::from(boundary.iter().any(|value| value[axis] != 0.0)))
        });
        self.partition.reduce(Reduction::Maximum, &mut moves);
        let moving = moves.map(|moves| moves > 0.0);
        let own = self.own(boundary);
        let sum = |axis: usize| own.iter().map(|value| value[axis]).sum::<f64>();
        #[expect(clippy::cast_precision_loss, reason = "fewer vertices than 2^53")]
        let mut sums = [sum(0), sum(1), sum(2), own.len() as f64];
        self.partition.reduce(Reduction::Sum, &mut sums);
        let mean: Vector = std::array::from_fn(|axis| sums[axis] / sums[3].max(1.0));
        if let [axis] = (0..3).filter(|&axis| moving[axis]).collect::<Vec<_>>()[..] {
            let values: Vec<[f64; 1]> = boundary.iter().map(|value| [value[axis]]).collect();
            let rest: Vec<[f64; 1]> = values.iter().map(|[value]| [mean[axis] - value]).collect();
            let mut right_side = vec![[0.0]; self.graph.vertices.len()];
            system.coupling.multiply(&values, &mut right_side);
            let [norm] = self.norms::<1, 1>(right_side.as_chunks().0);
            let absolute = ROUNDING * norm;
            system.coupling.multiply(&rest, &mut right_side);
            let mut solution: Vec<[f64; 1]> = self
                .graph
                .vertices
                .iter()
                .map(|&vertex| [from(vertex, axis, mean[axis])])
                .collect();
            let tolerance = Tolerance { relative: self.settings.tolerance, absolute };
            let convergence = system.solver.solve_from(&right_side, &mut solution, tolerance)?;
            for (&vertex, [value]) in self.graph.vertices.iter().zip(solution) {
                displacement[vertex as usize][axis] = mean[axis] + value;
            }
            return Ok(convergence);
        }
        if !moving.contains(&true) {
            return Ok(Convergence::default());
        }
        let columns = |values: Vec<Vector>| {
            values.into_iter().map(|value| value.map(|entry| [entry])).collect()
        };
        let values: Vec<[[f64; 1]; 3]> = columns(boundary.to_vec());
        let rest = boundary
            .iter()
            .map(|value| std::array::from_fn(|axis| mean[axis] - value[axis]))
            .collect();
        let rest: Vec<[[f64; 1]; 3]> = columns(rest);
        let mut right_side = vec![[[0.0]; 3]; self.graph.vertices.len()];
        system.coupling.multiply_columns(&values, &mut right_side);
        let absolute = self.norms(&right_side).map(|norm| ROUNDING * norm);
        system.coupling.multiply_columns(&rest, &mut right_side);
        let tolerances =
            absolute.map(|absolute| Tolerance { relative: self.settings.tolerance, absolute });
        let at = |&vertex: &u32| {
            std::array::from_fn(|axis| {
                [if moving[axis] { from(vertex, axis, mean[axis]) } else { 0.0 }]
            })
        };
        let mut solution: Vec<[[f64; 1]; 3]> = self.graph.vertices.iter().map(at).collect();
        let convergence = system.solver.solve_three_from(&right_side, &mut solution, tolerances)?;
        for (&vertex, value) in self.graph.vertices.iter().zip(solution) {
            for axis in (0..3).filter(|&axis| moving[axis]) {
                displacement[vertex as usize][axis] = mean[axis] + value[axis][0];
            }
        }
        Ok(convergence.into_iter().fold(Convergence::default(), |worst, column| Convergence {
            iterations: worst.iterations.max(column.iterations),
            residual: worst.residual.max(column.residual),
        }))
    }
}

/// What equations are set up from besides the mesh.
#[derive(Clone, Copy)]
enum Start<'a> {
    Fresh(&'a Arc<dyn Partition>),
    /// Equations of the same graph.
    Like(&'a Equations),
}

impl Start<'_> {
    /// Whether the components of a harmonic displacement are solved for together: where any rank has sliding vertices.
    fn is_coupled(self, constraints: &[Constraint]) -> bool {
        match self {
            Start::Fresh(partition) => any(&**partition, !constraints.is_empty()),
            Start::Like(equations) => matches!(equations, Equations::Coupled(_)),
        }
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

/// Assembles the equations and sets up their solver.
fn equations(
    graph: &Graph,
    mesh: &Mesh,
    elements: &Elements<'_>,
    stiffness: &[f64],
    constraints: &[Constraint],
    settings: &Deform,
    start: Start<'_>,
) -> Result<Equations, LinearError> {
    let coupled = |system| {
        let slide = |matrix: &mut SparseMatrix<3>| constrain(matrix, constraints);
        let set_up = |matrix: Arc<SparseMatrix<3>>| match start {
            Start::Like(Equations::Coupled(like)) => like.solver.renewed(matrix),
            Start::Like(Equations::Separate(_)) => crate::linear::solver(matrix),
            Start::Fresh(partition) => vector_solver(partition, matrix, &graph.vertices),
        };
        System::new(system, slide, set_up).map(Equations::Coupled)
    };
    match settings.method {
        Method::Elasticity => {
            let form = Elastic::new(settings.poisson_ratio);
            coupled(graph.assemble(mesh, elements, &form, stiffness))
        }
        // On one rank that has sliding vertices all ranks must solve for the components together.
        Method::Harmonic if start.is_coupled(constraints) => {
            coupled(graph.assemble(mesh, elements, &VectorLaplace, stiffness))
        }
        Method::Harmonic => {
            let system = graph.assemble(mesh, elements, &Laplace, stiffness);
            let none = |matrix: &mut SparseMatrix<1>| {
                SparseMatrix::zeros(vec![0; matrix.rows() + 1], Vec::new())
            };
            let set_up = |matrix: Arc<SparseMatrix<1>>| match start {
                Start::Like(Equations::Separate(like)) => like.solver.renewed(matrix),
                Start::Like(Equations::Coupled(_)) => crate::linear::solver(matrix),
                Start::Fresh(partition) => scalar_solver(partition, matrix, &graph.vertices),
            };
            System::new(system, none, set_up).map(Equations::Separate)
        }
    }
}
