//! The operator that carries boundary motion into a volume.

use super::assembly::{Elastic, Graph, Laplace, stiffness};
use super::element::Elements;
use super::rigid::RigidMotion;
use super::{Deform, Method, VolumeError};
use crate::linear::{Convergence, LinearError, LinearSolver, SparseMatrix, Tolerance};
use crate::mesh::{Mesh, Vector};

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
    vertex_count: usize,
    boundary: Vec<u32>,
    boundary_points: Vec<Vector>,
    /// The vertex of each unknown, and where it lies.
    unknowns: Vec<u32>,
    unknown_points: Vec<Vector>,
    equations: Equations,
    tolerance: f64,
}

#[derive(Debug)]
enum Equations {
    Elastic { coupling: SparseMatrix<3>, solver: Box<dyn LinearSolver<3>> },
    Harmonic { coupling: SparseMatrix<1>, solver: Box<dyn LinearSolver<1>> },
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
    /// Memory: about 130 bytes for each pair of neighbouring vertices (elasticity) or 20 (harmonic).
    ///
    /// # Errors
    /// [`VolumeError::Setting`], [`VolumeError::BoundaryVertex`], [`VolumeError::BoundaryTwice`]; [`VolumeError::InvertedCell`]
    /// for a flat or inverted reference cell; [`VolumeError::Unattached`] for cells that no boundary vertex holds.
    pub fn new(mesh: &Mesh, boundary: &[u32], settings: &Deform) -> Result<Self, VolumeError> {
        settings.validate()?;
        if u32::try_from(mesh.cells().len()).is_err() {
            return Err(VolumeError::TooLarge { cells: mesh.cells().len() });
        }
        let elements = Elements::new(mesh);
        let stiffness = stiffness(mesh, &elements, settings.stiffening)?;
        let graph = Graph::new(mesh, boundary)?;
        let equations = match settings.method {
            Method::Elasticity => {
                let form = Elastic::new(settings.poisson_ratio);
                let (matrix, coupling) = graph.assemble(mesh, &elements, &form, &stiffness);
                Equations::Elastic { coupling, solver: crate::linear::solver(matrix)? }
            }
            Method::Harmonic => {
                let (matrix, coupling) = graph.assemble(mesh, &elements, &Laplace, &stiffness);
                Equations::Harmonic { coupling, solver: crate::linear::solver(matrix)? }
            }
        };
        let places = |vertices: &[u32]| vertices.iter().map(|&vertex| mesh.points()[vertex as usize]).collect();
        Ok(Self {
            vertex_count: mesh.points().len(),
            boundary_points: places(boundary),
            boundary: boundary.to_vec(),
            unknown_points: places(&graph.vertices),
            unknowns: graph.vertices,
            equations,
            tolerance: settings.tolerance,
        })
    }

    /// The vertices whose displacement is prescribed, in the order in which [`VolumeOperator::solve`] takes them.
    #[must_use]
    pub fn boundary(&self) -> &[u32] {
        &self.boundary
    }

    /// How many vertices are solved for.
    #[must_use]
    pub fn unknowns(&self) -> usize {
        self.unknowns.len()
    }

    /// The displacement of every vertex for these displacements of the boundary vertices, one for each of
    /// [`VolumeOperator::boundary`].
    ///
    /// # Errors
    /// [`VolumeError::BoundaryCount`]; [`VolumeError::NotFinite`] for a displacement that is NaN or infinite;
    /// [`VolumeError::Linear`] where the iteration fails, or a displacement is so large that arithmetic overflows.
    pub fn solve(&self, boundary_displacement: &[Vector]) -> Result<VolumeSolution, VolumeError> {
        if boundary_displacement.len() != self.boundary.len() {
            return Err(VolumeError::BoundaryCount {
                found: boundary_displacement.len(),
                expected: self.boundary.len(),
            });
        }
        let mut displacement = vec![[0.0; 3]; self.vertex_count];
        for (&vertex, &value) in self.boundary.iter().zip(boundary_displacement) {
            if !value.iter().all(|component| component.is_finite()) {
                return Err(VolumeError::NotFinite { vertex, value });
            }
            displacement[vertex as usize] = value;
        }
        let convergence = match &self.equations {
            Equations::Elastic { coupling, solver } => {
                self.solve_elastic(coupling, solver.as_ref(), boundary_displacement, &mut displacement)?
            }
            Equations::Harmonic { coupling, solver } => {
                self.solve_harmonic(coupling, solver.as_ref(), boundary_displacement, &mut displacement)?
            }
        };
        if !displacement.as_flattened().iter().all(|value| value.is_finite()) {
            return Err(LinearError::NotFinite { iteration: convergence.iterations }.into());
        }
        Ok(VolumeSolution { displacement, iterations: convergence.iterations, residual: convergence.residual })
    }

    /// A rigid motion strains nothing, so the one nearest to the boundary's motion is taken off, and added again at the end.
    fn solve_elastic(
        &self,
        coupling: &SparseMatrix<3>,
        solver: &dyn LinearSolver<3>,
        boundary: &[Vector],
        displacement: &mut [Vector],
    ) -> Result<Convergence, LinearError> {
        if boundary.iter().all(|value| *value == [0.0; 3]) {
            return Ok(Convergence::default());
        }
        let rigid = RigidMotion::nearest(&self.boundary_points, boundary);
        let rest: Vec<Vector> = self
            .boundary_points
            .iter()
            .zip(boundary)
            .map(|(&point, &value)| {
                let motion = rigid.at(point);
                std::array::from_fn(|axis| motion[axis] - value[axis])
            })
            .collect();
        let (solution, convergence) = self.solve_rest(coupling, solver, boundary, &rest)?;
        for ((&vertex, &point), value) in self.unknowns.iter().zip(&self.unknown_points).zip(solution) {
            let motion = rigid.at(point);
            displacement[vertex as usize] = std::array::from_fn(|axis| motion[axis] + value[axis]);
        }
        Ok(convergence)
    }

    /// One solve for each component that moves, its mean taken off first.
    fn solve_harmonic(
        &self,
        coupling: &SparseMatrix<1>,
        solver: &dyn LinearSolver<1>,
        boundary: &[Vector],
        displacement: &mut [Vector],
    ) -> Result<Convergence, LinearError> {
        let mut worst = Convergence::default();
        for axis in 0..3 {
            if boundary.iter().all(|value| value[axis] == 0.0) {
                continue;
            }
            let values: Vec<[f64; 1]> = boundary.iter().map(|value| [value[axis]]).collect();
            #[expect(clippy::cast_precision_loss, reason = "fewer vertices than 2^53")]
            let mean = values.as_flattened().iter().sum::<f64>() / values.len() as f64;
            let rest: Vec<[f64; 1]> = values.iter().map(|[value]| [mean - value]).collect();
            let (solution, convergence) = self.solve_rest(coupling, solver, &values, &rest)?;
            for (&vertex, [value]) in self.unknowns.iter().zip(solution) {
                displacement[vertex as usize][axis] = mean + value;
            }
            worst.iterations = worst.iterations.max(convergence.iterations);
            worst.residual = worst.residual.max(convergence.residual);
        }
        Ok(worst)
    }

    /// Solves for the boundary motion `-rest`, what is left of `boundary`: to the tolerance, or to rounding against the whole.
    fn solve_rest<const B: usize>(
        &self,
        coupling: &SparseMatrix<B>,
        solver: &dyn LinearSolver<B>,
        boundary: &[[f64; B]],
        rest: &[[f64; B]],
    ) -> Result<(Vec<[f64; B]>, Convergence), LinearError> {
        let mut right_side = vec![[0.0; B]; self.unknowns.len()];
        coupling.multiply(boundary, &mut right_side);
        let absolute = ROUNDING * crate::linear::norm(&right_side);
        coupling.multiply(rest, &mut right_side);
        let mut solution = vec![[0.0; B]; self.unknowns.len()];
        let tolerance = Tolerance { relative: self.tolerance, absolute };
        let convergence = solver.solve(&right_side, &mut solution, tolerance)?;
        Ok((solution, convergence))
    }
}
