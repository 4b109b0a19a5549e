//! Moving the inside of a mesh so that no cell is turned inside out.

use std::sync::OnceLock;

use super::colours::Held;
use super::corners::{Corner, corners, edges, has_corners};
use super::newton::{Energy, Newton};
use super::{Improver, foldover};
use crate::cancellation::Cancellation;
use crate::communicator::Communicator;
use crate::mesh::cell_geometry::Scratch;
use crate::mesh::{CellType, Domain, Mesh, Numbering, Ordered, Vector};
use crate::quality::{Measure, Quality, quality};

/// Newton steps at most, in one descent.
const STEPS: usize = 150;

/// A valid mesh is settled once a Newton step takes less than this part of the energy off.
const SETTLED: f64 = 1e-3;

/// It is given up where the least determinant has not come this part of its way to zero in so many
/// steps.
const BETTER: f64 = 0.05;
const PATIENCE: usize = 15;

/// The regularisation at first: at least so much, and so much of the least determinant; and that of
/// a descent that is made again.
const LEAST_EPSILON: f64 = 1e-3;
const OF_LEAST: f64 = 0.2;
const LARGE_EPSILON: f64 = 1.0;

/// By how much `χ` of the worst corner falls in each step at least: `σ₀`.
const LEAST_FALL: f64 = 0.1;

/// The regularisation of a valid mesh, by its least determinant.
const VALID_EPSILON: f64 = 0.01;

/// Descents in which cells are made valid inside whose corners are valid.
const INSIDES: usize = 3;

/// Rounds of sweeps that lift the quality of a valid mesh to the floor, and the sweeps in each.
const ROUNDS: usize = 10;
const SWEEPS: u32 = 10;

/// Cells of a valid mesh that is below the floor are lifted to this times the quality that they
/// have in the reference.
const LIFTED: f64 = 1.5;

/// Moves the free vertices of one mesh so that no cell is turned inside out, and cells are as much
/// like those of the reference mesh as the boundary allows.
///
/// With `J` the gradient of the map from the reference at each corner of each cell (tetrahedra are
/// their own), it minimises the sum of `½ tr(JᵀJ) / χ^⅔ + ½ (1 + det²J) / χ`, the foldover-free
/// energy of V. Garanzha, I. Kaporin, L. Kudryavtseva, F. Protais, N. Ray and D. Sokolov (2021), by
/// Newton's method: `χ = ½ (det J + √(ε² + det²J))` makes it finite for cells that are inside out,
/// and ε is brought down as they turn. Hessians are projected to positive definite ones corner by
/// corner in closed form (B. Smith, F. de Goes, T. Kim 2019), so that the linear systems suit
/// [`ConjugateGradients`](crate::linear::ConjugateGradients); the line search makes the energy fall
/// in every step. All corners weigh the same, so that thin layers keep their shape.
///
/// Cells of types that are neither tetrahedra, hexahedra, voxels, wedges nor pyramids are passed
/// over.
///
/// # Guarantees
/// - Vertices that are not free do not move.
/// - The same bits whatever the number of threads.
///
/// It does *not* guarantee to find a mesh that is valid, even where there is one.
#[derive(Debug)]
pub struct Untangler {
    /// The numbering of the ordered mesh, whose numbers all vertices here have.
    pub(super) numbering: Numbering,
    pub(super) corners: Vec<Corner>,
    pub(super) newton: Newton,
    /// The ordered reference mesh, where its cells can be broken inside.
    curved: Option<Mesh>,
    pub(super) domain: Domain,
    boundary: Vec<u32>,
    /// The least scaled Jacobian of the reference mesh.
    least: f64,
    improver: OnceLock<Improver>,
}

/// The start of a descent: it decides to which of several minima it leads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Regularisation {
    /// As small as the least determinant allows: the quickest.
    Fitting,
    /// So large that inverted cells weigh little at first, and the others take their shape.
    Large,
}

impl Untangler {
    /// An untangler of the cells of a reference mesh; the vertices of `boundary`, those on the
    /// boundary of the whole mesh, are not free. Collective, as is its use.
    #[must_use]
    pub fn new(domain: impl Into<Domain>, boundary: &[u32]) -> Self {
        let domain = domain.into();
        let mesh = domain.mesh();
        let least = quality(mesh.cells(), mesh.points()).gathered(&domain).min;
        let ordered = Ordered::new(mesh);
        let held = (domain.communicator().size() > 1).then(|| Held::new(&ordered, domain.halo()));
        let (near, numbering) = ordered.into_parts();
        let corners = corners(&near);
        let mut free = vec![true; mesh.points().len()];
        boundary
            .iter()
            .filter_map(|&vertex| numbering.index(vertex))
            .for_each(|index| free[index as usize] = false);
        // The energy knows nothing of cells without corners: what they hold stays where it is, on all ranks.
        for (cell_type, vertices) in near.cells().iter() {
            if cell_type.dimension() == 3 && !has_corners(cell_type) {
                vertices.iter().for_each(|&vertex| free[vertex as usize] = false);
            }
        }
        if let Some(held) = &held {
            held.all(&mut free);
        }
        let newton = Newton::new(&near, &corners, &free, &numbering, domain.halo());
        let curved = domain
            .communicator()
            .any(near.cells().uniform_type() != Some(CellType::Tetra))
            .then_some(near);
        Self {
            numbering,
            corners,
            newton,
            curved,
            domain,
            boundary: boundary.to_vec(),
            least,
            improver: OnceLock::new(),
        }
    }

    /// The untangler with what has its work given up, which is looked at in each Newton step and
    /// each sweep: it then says that no mesh was found.
    #[must_use]
    pub fn with_cancellation(mut self, cancellation: Cancellation) -> Self {
        self.newton.cancellation = cancellation;
        self
    }

    pub(super) fn is_given_up(&self) -> bool {
        self.newton.cancellation.is_cancelled()
    }

    /// Whether there is nothing that it could move in a mesh with these points.
    pub(super) fn is_idle(&self, points: &[Vector]) -> bool {
        let ranks = self.domain.communicator();
        ranks.all(self.newton.unknowns.is_empty())
            || ranks.any(points.len() != self.newton.vertices())
    }

    /// Moves the free vertices of `points` until every corner's determinant is positive, and on
    /// until the energy has settled; where a scaled Jacobian is then below `floor`, the worst cells
    /// are lifted (see [`Improver`]). Says whether all cells are valid and none is below `floor`,
    /// or below the least of the reference mesh where that is lower.
    pub fn untangle(&self, points: &mut [Vector], floor: f64) -> bool {
        if self.domain.communicator().all(points.len() == self.newton.vertices()) {
            let mut again = points.to_vec();
            if self.untangle_from(points, floor, Regularisation::Fitting) {
                return true;
            }
            if !self.is_given_up() && self.untangle_from(&mut again, floor, Regularisation::Large) {
                points.copy_from_slice(&again);
                return true;
            }
        }
        false
    }

    /// Untangles by one descent, from the regularisation `from`.
    pub(super) fn untangle_from(
        &self,
        points: &mut [Vector],
        floor: f64,
        from: Regularisation,
    ) -> bool {
        if self.is_idle(points) {
            return false;
        }
        let floor = floor.min(self.least);
        // 1. Valid corners.
        let mut near = self.numbering.gather(points).into_owned();
        self.descends(&self.corners, from, &mut near);
        self.numbering.scatter(&near, points);
        if self.is_given_up() {
            return false;
        }
        // 2. Cells that are valid at their corners and not inside.
        let mut found = self.quality(points);
        let mut with_edges = self.corners.clone();
        for _ in 0..INSIDES {
            if found.inverted == 0
                || self.newton.least(&with_edges, &near) <= 0.0
                || !self.add_edges(&near, &mut with_edges)
            {
                break;
            }
            self.descends(&with_edges, Regularisation::Fitting, &mut near);
            self.numbering.scatter(&near, points);
            if self.is_given_up() {
                return false;
            }
            found = self.quality(points);
        }
        // 3. The quality of the worst cells.
        self.lift(points, floor, found)
    }

    fn quality(&self, points: &[Vector]) -> Quality {
        quality(self.domain.mesh().cells(), points).gathered(&self.domain)
    }

    /// Whether sweeps bring every cell of a valid mesh up to `floor`.
    fn lift(&self, points: &mut [Vector], floor: f64, mut quality: Quality) -> bool {
        let improver = || {
            let cancellation = self.newton.cancellation.clone();
            let improver = Improver::new(&self.domain, &self.boundary).lifting_to(LIFTED);
            improver.with_cancellation(cancellation)
        };
        for _ in 0..ROUNDS {
            if quality.inverted > 0
                || quality.min >= floor
                || !self.improver.get_or_init(improver).improve(points, SWEEPS)
            {
                break;
            }
            quality = self.quality(points);
        }
        quality.inverted == 0 && quality.min >= floor
    }

    /// Adds the tetrahedra at the edges of cells that are broken inside; says whether there are
    /// any.
    fn add_edges(&self, points: &[Vector], corners: &mut Vec<Corner>) -> bool {
        let before = corners.len();
        if let Some(mesh) = &self.curved {
            let measure = Measure::new(mesh.cells());
            let mut scratch = Scratch::default();
            for cell in 0..mesh.cells().len() {
                let found = measure.cell(cell, |vertex| points[vertex as usize], &mut scratch);
                if found.is_some_and(|(_, inverted)| inverted) {
                    edges(mesh, cell, corners);
                }
            }
        }
        self.domain.communicator().any(corners.len() > before)
    }

    /// Brings the energy down until it settles, or until no valid mesh is in sight.
    ///
    /// With `F` the energy, `D` the least determinant and `χ` as above: Garanzha et al. (2021),
    /// section 3.
    fn descends(&self, corners: &[Corner], from: Regularisation, points: &mut [Vector]) {
        let mut least = self.newton.least(corners, points);
        let valid = |least: f64, epsilon: f64| epsilon.min(VALID_EPSILON * least);
        // 1. The first regularisation.
        let first = if least > 0.0 {
            valid(least, f64::INFINITY)
        } else {
            LEAST_EPSILON.hypot(OF_LEAST * least)
        };
        let mut epsilon = if from == Regularisation::Large { LARGE_EPSILON } else { first };
        let (mut best, mut since) = (least, 0);
        for _ in 0..STEPS {
            // 2. A step of Newton's method instead of the minimiser: `xᵏ⁺¹` with `F(xᵏ⁺¹, εᵏ) <
            //    F(xᵏ, εᵏ)`.
            let energy = Energy { corners, epsilon, pull: None };
            let step = self.newton.step(&energy, points, &|_| true);
            if self.is_given_up() {
                break;
            }
            least = self.newton.least(corners, points);
            let fall = step.map_or(0.0, |step| 1.0 - step.after / step.before);
            // 3. A valid mesh that has settled.
            if least > 0.0 && fall < SETTLED {
                break;
            }
            // 4. No mesh is found where the worst corner does not turn.
            since += 1;
            if least > best + BETTER * best.abs() {
                (best, since) = (least, 0);
            }
            if since > PATIENCE && least <= 0.0 {
                break;
            }
            // 5. `σ = max(1 - F(xᵏ⁺¹, εᵏ) / F(xᵏ, εᵏ), σ₀)`; `μ = (1 - σ) χ(εᵏ, Dᵏ⁺¹)`; `εᵏ⁺¹ = 2
            //    √(μ (μ - Dᵏ⁺¹))`, with which `χ(εᵏ⁺¹, Dᵏ⁺¹) = μ`.
            let aim = (1.0 - fall.max(LEAST_FALL)) * foldover::chi(least, epsilon);
            epsilon = if least < aim {
                2.0 * (aim * (aim - least)).sqrt()
            } else {
                valid(least, epsilon)
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quality::quality;
    use crate::shapes;
    use crate::vector::{length, subtract};
    use crate::volume::tests::cube_boundary;

    /// The inside of a cube thrown about by far more than the size of a cell.
    fn thrown(mesh: &Mesh, boundary: &[u32]) -> Vec<Vector> {
        let mut points = mesh.points().to_vec();
        for (vertex, point) in points.iter_mut().enumerate() {
            if !boundary.contains(&(vertex as u32)) {
                let wave = |phase: f64| 0.3 * (12.9898 * vertex as f64 + phase).sin();
                *point = [point[0] + wave(0.0), point[1] + wave(2.0), point[2] + wave(4.0)];
            }
        }
        points
    }

    /// With the boundary where it was, the reference is the one minimum.
    #[test]
    fn a_thrown_inside_comes_back() {
        for mesh in [
            shapes::box_of_tets([5, 6, 4], [0.0; 3], [1.0; 3]),
            shapes::box_of_hexahedra([5, 6, 4], [0.0; 3], [1.0; 3]),
        ] {
            let boundary = cube_boundary(&mesh);
            let mut points = thrown(&mesh, &boundary);
            assert!(quality(mesh.cells(), &points).inverted > 50);
            assert!(Untangler::new(&mesh, &boundary).untangle(&mut points, 0.0));
            for (vertex, (point, reference)) in points.iter().zip(mesh.points()).enumerate() {
                let off = subtract(*point, *reference);
                assert!(length(off) < 0.02, "vertex {vertex}: {off:?}");
                if boundary.contains(&(vertex as u32)) {
                    assert_eq!(point, reference);
                }
            }
        }
    }

    /// Poor cells of the reference are no failure of untangling.
    #[test]
    fn slivers_of_the_reference_are_no_failure() {
        let whole = shapes::box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]);
        let boundary = cube_boundary(&whole);
        let mut points = whole.points().to_vec();
        let middle = points.iter().position(|point| *point == [0.5; 3]).unwrap();
        // Almost in the plane of one of its cells' faces.
        points[middle] = [0.5, 0.5, 0.7495];
        let mesh = whole.with_points(points).unwrap();
        let least = quality(mesh.cells(), mesh.points()).min;
        assert!(least > 0.0 && least < 0.01, "{least}");
        let mut points = thrown(&mesh, &boundary);
        assert!(quality(mesh.cells(), &points).inverted > 20);
        assert!(Untangler::new(&mesh, &boundary).untangle(&mut points, 0.02));
    }

    #[test]
    fn what_cannot_be_untangled_is_said() {
        let mesh = shapes::box_of_tets([3, 3, 3], [0.0; 3], [1.0; 3]);
        let boundary = cube_boundary(&mesh);
        let untangler = Untangler::new(&mesh, &boundary);
        let mut mirrored: Vec<Vector> = mesh.points().iter().map(|&[x, y, z]| [x, y, -z]).collect();
        assert!(!untangler.untangle(&mut mirrored, 0.0));
        assert!(!untangler.untangle(&mut mesh.points()[1..].to_vec(), 0.0));
        let all: Vec<u32> = (0..mesh.points().len() as u32).collect();
        assert!(
            !Untangler::new(&mesh, &all).untangle(&mut mesh.points().to_vec(), 0.0),
            "nothing is free"
        );
    }

    #[cfg(feature = "parallel")]
    #[test]
    fn the_same_bits_whatever_the_number_of_threads() {
        let mesh = shapes::box_of_tets([8, 8, 8], [0.0; 3], [1.0; 3]);
        let boundary = cube_boundary(&mesh);
        let untangler = Untangler::new(&mesh, &boundary);
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut points = thrown(&mesh, &boundary);
            let done = pool.install(|| untangler.untangle(&mut points, 0.0));
            assert_ne!(points, thrown(&mesh, &boundary), "the inside has moved");
            (points, done)
        };
        let one = run(1);
        assert_eq!(one, run(2));
        assert_eq!(one, run(3));
    }
}
