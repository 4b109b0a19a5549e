//! Raising the quality of the cells of a valid mesh beyond the guard's floor.

use super::barrier::{Barrier, LENGTHS, Simplex, Star, length, newton, searched};
use super::colours::{Held, colours};
use crate::communicator::{Communicator, Halo, Reduction};
use crate::mesh::cell_geometry::{
    HEXAHEDRON_CORNERS, PYRAMID_CORNERS, VOXEL_AS_HEXAHEDRON, WEDGE_CORNERS, tet_determinant,
};
use crate::mesh::{CellType, Domain, Mesh, Numbering, Ordered, Vector};
use crate::parallel;
use crate::quality::scaled_jacobians;
use crate::topology::{Groups, marked};
use crate::vector::{add, dot, scale};

/// How many vertices or corners are worked on at a time.
const VERTICES: usize = 64;
const CHUNK: usize = 4096;

/// Vertices stay where none of their cells has lost more than this part of its quality.
const GOOD: f64 = 0.95;

/// How far below the least quality the barrier stands, as a part of what that has lost (of this
/// much at least).
const GAP: f64 = 0.05;
const LOST: f64 = 0.05;

/// Moves the free vertices of a mesh so that its worst cells get better, without making a new one
/// as bad.
///
/// The quality of a cell is its scaled Jacobian by that of the same cell in the reference. One
/// sweep moves every free vertex that has a cell of less than 0.95, one after the other, down
///
/// `Σ (δ / (q - τ))² - 0.01 ln q`
///
/// over the corners `q` of its cells (a corner's determinant by the product of its edges) by one
/// step of Newton's method with a line search both ways. The barrier `τ` stands `δ` below the least
/// `q` of the mesh and rises with it from sweep to sweep, so that the worst cells are lifted first
/// and all others gain as far as these let them. L. Freitag, C. Ollivier-Gooch (*Tetrahedral mesh
/// improvement using swapping and smoothing*, 1997) show why one vertex at a time is enough where a
/// mesh is nearly good: what a linear solve leaves to be mended lies close by.
///
/// Vertices of one colour share no cell and move at the same time, on all threads.
///
/// Vertices of pentagonal and hexagonal prisms and of polyhedra stay.
///
/// # Guarantees
/// - Vertices that are not free do not move, nor does any where no cell has lost a twentieth of its
///   quality: rigid motions come back bit for bit.
/// - The least quality is not lower afterwards, and no cell that was valid is turned inside out.
/// - The same bits whatever the number of threads; the same places, to rounding, however the
///   vertices are numbered and whatever parts the mesh is in.
#[derive(Debug)]
pub struct Improver {
    /// The numbering of the ordered mesh, whose numbers all vertices here have.
    numbering: Numbering,
    simplices: Vec<Simplex>,
    /// Free vertices, none of a list with a cell in common.
    colours: Vec<Vec<u32>>,
    /// The simplices of each vertex: four times the simplex, plus the vertex's index in it.
    incident: Groups<u32>,
    /// The simplices that have a free vertex.
    movable: Vec<u32>,
    interface: Option<Interface>,
    /// Vertices none of whose cells is below this stay.
    good: f64,
}

/// The vertices that other ranks have too.
#[derive(Debug)]
struct Interface {
    held: Held,
    /// For each colour which of its vertices are shared; these are in no list of
    /// `Improver::colours`.
    colours: Vec<Halo>,
}

impl Improver {
    /// An improver of the cells of a reference mesh; the vertices of `boundary`, those on the
    /// boundary of the whole mesh, are not free. Collective, as is its use.
    #[must_use]
    pub fn new(domain: impl Into<Domain>, boundary: &[u32]) -> Self {
        let domain = domain.into();
        let ordered = Ordered::new(domain.mesh());
        let held = (domain.communicator().size() > 1).then(|| Held::new(&ordered, domain.halo()));
        let (mesh, numbering) = ordered.into_parts();
        let mut free = vec![true; mesh.points().len()];
        boundary
            .iter()
            .filter_map(|&vertex| numbering.index(vertex))
            .for_each(|index| free[index as usize] = false);
        let simplices = simplices(&mesh, &mut free);
        if let Some(held) = &held {
            held.all(&mut free);
        }
        let corners = simplices.iter().flat_map(|simplex| simplex.vertices).zip(0u32..);
        let incident =
            Groups::new(free.len(), corners.filter(|(vertex, _)| free[*vertex as usize]));
        let is_movable =
            |simplex: &Simplex| simplex.vertices.iter().any(|&vertex| free[vertex as usize]);
        let movable = marked(&simplices.iter().map(is_movable).collect::<Vec<_>>());
        let mut improver = Self {
            numbering,
            simplices,
            colours: Vec::new(),
            incident,
            movable,
            interface: None,
            good: GOOD,
        };
        let around = |vertex: u32, visit: &mut dyn FnMut(u32)| {
            for &code in improver.incident.of(vertex) {
                improver.simplices[(code / 4) as usize]
                    .vertices
                    .iter()
                    .for_each(|&other| visit(other));
            }
        };
        let free = marked(&free);
        let colour_of = colours(mesh.points(), &free, around, held.as_ref());
        let mut colours: Vec<Vec<u32>> = Vec::new();
        for &vertex in &free {
            let shared = held.as_ref().is_some_and(|held| held.is_shared(vertex));
            if !shared && let Some(colour) = colour_of[vertex as usize].map(usize::from) {
                colours.resize_with(colours.len().max(colour + 1), Vec::new);
                colours[colour].push(vertex);
            }
        }
        improver.interface = held.map(|held| {
            let of_index = |index: u32| colour_of[held.vertex(index) as usize].map(usize::from);
            let shared = held.halo().shared().iter().filter_map(|&index| of_index(index));
            let own = shared.fold(colours.len(), |count, colour| count.max(colour + 1));
            colours.resize_with(domain.communicator().most(own), Vec::new);
            let of_colour =
                |colour: usize| held.halo().only(|index| of_index(index) == Some(colour));
            let colours = (0..colours.len()).map(of_colour).collect();
            Interface { held, colours }
        });
        improver.colours = colours;
        improver
    }

    /// The improver where cells are lifted to `good` times the quality that they have in the
    /// reference, and above it.
    #[must_use]
    pub(super) fn lifting_to(self, good: f64) -> Self {
        Self { good, ..self }
    }

    /// Improves `points` (coordinates of each vertex) in at most `sweeps` sweeps. Says whether
    /// anything has moved; nothing does where a cell is turned inside out.
    pub fn improve(&self, points: &mut [Vector], sweeps: u32) -> bool {
        let fits = points.len() + 1 == self.incident.offsets.len();
        if !self
            .interface
            .as_ref()
            .map_or(fits, |interface| interface.held.halo().communicator().all(fits))
        {
            return false;
        }
        let mut near = self.numbering.gather(points).into_owned();
        let before = self.least(&near);
        if sweeps == 0 || before.is_nan() || before <= 0.0 || before >= self.good {
            return false;
        }
        let mut least = before;
        for _ in 0..sweeps {
            self.sweep(&mut near, least);
            least = self.least(&near);
        }
        let better = least >= before;
        if better {
            self.numbering.scatter(&near, points);
        }
        better
    }

    /// The least quality of what can be moved.
    fn least(&self, points: &[Vector]) -> f64 {
        let least =
            parallel::map_chunks(self.movable.len(), CHUNK, |range| {
                self.movable[range]
                    .iter()
                    .map(|&simplex| self.simplices[simplex as usize].least(points))
                    .fold(f64::INFINITY, |least, value| {
                        if value < least || value.is_nan() { value } else { least }
                    })
            })
            .into_iter()
            .fold(f64::INFINITY, |least, value| {
                if value < least || value.is_nan() { value } else { least }
            });
        match &self.interface {
            None => least,
            Some(Interface { held, .. }) => {
                // The reduction passes over NaN.
                let mut least = [if least.is_nan() { f64::NEG_INFINITY } else { least }];
                held.halo().communicator().reduce(Reduction::Minimum, &mut least);
                least[0]
            }
        }
    }

    fn sweep(&self, points: &mut [Vector], least: f64) {
        let gap = GAP * least * (1.0 - least).max(LOST);
        let barrier = Barrier { floor: least - gap, gap };
        for (number, colour) in self.colours.iter().enumerate() {
            let moved = parallel::map_chunks(colour.len(), VERTICES, |range| {
                let mut star = Star::default();
                colour[range]
                    .iter()
                    .map(|&vertex| {
                        self.gather(vertex, points, &mut star);
                        barrier.improved(points[vertex as usize], &star, self.good)
                    })
                    .collect::<Vec<Vector>>()
            });
            for (&vertex, position) in colour.iter().zip(moved.into_iter().flatten()) {
                points[vertex as usize] = position;
            }
            if let Some(interface) = &self.interface {
                self.sweep_shared(points, &barrier, &interface.held, &interface.colours[number]);
            }
        }
    }

    /// Sweeps through the vertices of one colour that other ranks have too: what the cells of all
    /// of them say is added up, so that all move them to the same place.
    fn sweep_shared(&self, points: &mut [Vector], barrier: &Barrier, held: &Held, halo: &Halo) {
        let vertices: Vec<(u32, u32)> =
            halo.shared().iter().map(|&index| (index, held.vertex(index))).collect();
        let mut star = Star::default();
        // Whether any cell is not good, the gradient and the Hessian.
        let mut slopes = vec![[0.0; 13]; held.len()];
        for &(entry, vertex) in &vertices {
            let point = points[vertex as usize];
            self.gather(vertex, points, &mut star);
            let (gradient, hessian) = barrier.derivatives(point, &star);
            let slope = &mut slopes[entry as usize];
            slope[0] = f64::from(u8::from(!star.is_above(point, self.good)));
            slope[1..4].copy_from_slice(&gradient);
            slope[4..].copy_from_slice(hessian.as_flattened());
        }
        halo.sum(13, slopes.as_flattened_mut());
        let direction = |entry: u32| {
            let [bad, a, b, c, hessian @ ..] = slopes[entry as usize];
            let gradient = [a, b, c];
            let direction = newton(
                &gradient,
                &std::array::from_fn(|row| std::array::from_fn(|k| hessian[3 * row + k])),
            )?;
            (bad > 0.0).then(|| (direction, dot(direction, gradient)))
        };
        let mut energies = vec![[0.0; LENGTHS + 1]; held.len()];
        for &(entry, vertex) in &vertices {
            let Some((direction, _)) = direction(entry) else { continue };
            let point = points[vertex as usize];
            self.gather(vertex, points, &mut star);
            for (index, energy) in energies[entry as usize].iter_mut().enumerate() {
                *energy = barrier.energy(add(point, scale(direction, length(index))), &star);
            }
        }
        halo.sum(LENGTHS + 1, energies.as_flattened_mut());
        for &(entry, vertex) in &vertices {
            let Some((direction, slope)) = direction(entry) else { continue };
            let energies = &energies[entry as usize];
            let along = |wanted: f64| {
                energies[(0..=LENGTHS).find(|&index| length(index) == wanted).unwrap_or(0)]
            };
            points[vertex as usize] = searched(points[vertex as usize], direction, slope, along);
        }
    }

    fn gather(&self, vertex: u32, points: &[Vector], star: &mut Star) {
        star.clear();
        for &code in self.incident.of(vertex) {
            star.push(&self.simplices[(code / 4) as usize], (code % 4) as usize, points);
        }
    }
}

/// The corners whose least is the quality of their cell. Vertices of cells that have none are taken
/// out of `free`.
fn simplices(mesh: &Mesh, free: &mut [bool]) -> Vec<Simplex> {
    let (cells, points) = (mesh.cells(), mesh.points());
    let reference = scaled_jacobians(cells, points);
    let mut simplices = Vec::with_capacity(cells.len());
    for ((cell_type, vertices), &scaled) in cells.iter().zip(&reference) {
        let root = std::f64::consts::SQRT_2;
        let (corners, regular, whole): (&[[usize; 4]], f64, bool) = match cell_type {
            CellType::Tetra => (&[[0, 1, 2, 3]], root, true),
            CellType::Hexahedron | CellType::Voxel => (&HEXAHEDRON_CORNERS, 1.0, false),
            CellType::Wedge => (&WEDGE_CORNERS, 2.0 / 3.0f64.sqrt(), false),
            CellType::Pyramid => (&PYRAMID_CORNERS, 2.0, true),
            _ => (&[], 0.0, false),
        };
        let from = simplices.len();
        for corner in corners {
            let local = if cell_type == CellType::Voxel {
                corner.map(|local| VOXEL_AS_HEXAHEDRON[local])
            } else {
                *corner
            };
            let vertices = local.map(|index| vertices[index]);
            if tet_determinant(vertices.map(|vertex| points[vertex as usize])) > 0.0 {
                simplices.push(Simplex { vertices, factor: regular / scaled, whole });
            }
        }
        let known = simplices.len() - from == corners.len() && !corners.is_empty() && scaled > 0.0;
        if !known && cell_type.dimension() == 3 {
            simplices.truncate(from);
            vertices.iter().for_each(|&vertex| free[vertex as usize] = false);
        }
    }
    simplices
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quality::{normalized_scaled_jacobians, quality};
    use crate::shapes;

    fn boundary(mesh: &Mesh) -> Vec<u32> {
        let on = |p: &Vector| p.iter().any(|&x| x == 0.0 || x == 1.0);
        (0..).zip(mesh.points()).filter(|(_, p)| on(p)).map(|(vertex, _)| vertex).collect()
    }

    /// The inside shaken by less than would turn a cell inside out.
    fn shaken(mesh: &Mesh, boundary: &[u32]) -> Vec<Vector> {
        let mut points = mesh.points().to_vec();
        for (vertex, point) in points.iter_mut().enumerate() {
            if !boundary.contains(&(vertex as u32)) {
                let wave = |phase: f64| 0.045 * (12.9898 * vertex as f64 + phase).sin();
                *point = [point[0] + wave(0.0), point[1] + wave(2.0), point[2] + wave(4.0)];
            }
        }
        points
    }

    fn spread(mesh: &Mesh, points: &[Vector]) -> (f64, f64) {
        let values = normalized_scaled_jacobians(mesh.cells(), mesh.points(), points);
        (
            values.iter().copied().fold(f64::INFINITY, f64::min),
            values.iter().sum::<f64>() / values.len() as f64,
        )
    }

    fn meshes() -> Vec<Mesh> {
        let size = ([5, 6, 4], [0.0; 3], [1.0; 3]);
        vec![
            shapes::box_of_tets(size.0, size.1, size.2),
            shapes::box_of_hexahedra(size.0, size.1, size.2),
        ]
    }

    /// With the boundary where it was, every cell can have the quality of the reference.
    #[test]
    fn the_worst_cells_and_the_mean_get_better() {
        for mesh in meshes() {
            let boundary = boundary(&mesh);
            let start = shaken(&mesh, &boundary);
            let mut points = start.clone();
            let (least, mean) = spread(&mesh, &start);
            assert!(least > 0.0 && least < 0.7, "{least}");
            assert!(Improver::new(&mesh, &boundary).improve(&mut points, 20));
            let (after, mean_after) = spread(&mesh, &points);
            assert!(after > 0.9 && mean_after > mean, "{least} -> {after}, {mean} -> {mean_after}");
            assert_eq!(quality(mesh.cells(), &points).inverted, 0);
            for &vertex in &boundary {
                assert_eq!(points[vertex as usize], start[vertex as usize]);
            }
        }
    }

    #[test]
    fn good_and_broken_meshes_stay_as_they_are() {
        for mesh in meshes() {
            let boundary = boundary(&mesh);
            let improver = Improver::new(&mesh, &boundary);
            // Turned and moved.
            let (s, c) = 0.7f64.sin_cos();
            let turned: Vec<Vector> = mesh
                .points()
                .iter()
                .map(|&[x, y, z]| [c * x - s * y + 3.0, s * x + c * y, z - 1.0])
                .collect();
            let mirrored: Vec<Vector> = mesh.points().iter().map(|&[x, y, z]| [x, y, -z]).collect();
            for mut points in [turned, mirrored] {
                let start = points.clone();
                assert!(!improver.improve(&mut points, 5));
                assert_eq!(points, start);
            }
            assert!(!improver.improve(&mut shaken(&mesh, &boundary), 0));
            assert!(!improver.improve(&mut shaken(&mesh, &boundary)[1..], 5));
        }
    }

    #[cfg(feature = "parallel")]
    #[test]
    fn the_same_bits_whatever_the_number_of_threads() {
        let mesh = shapes::box_of_tets([9, 9, 9], [0.0; 3], [1.0; 3]);
        let boundary = boundary(&mesh);
        let improver = Improver::new(&mesh, &boundary);
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut points = shaken(&mesh, &boundary);
            let start = points.clone();
            for point in &mut points {
                *point = [point[0], point[1], point[2] + 0.3 * point[0]];
            }
            pool.install(|| improver.improve(&mut points, 3));
            assert_ne!(points, start);
            points
        };
        let one = run(1);
        assert_eq!(one, run(2));
        assert_eq!(one, run(3));
    }
}
