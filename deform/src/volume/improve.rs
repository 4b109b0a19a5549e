//! Raising the quality of the cells of a valid mesh beyond the guard's floor.

use std::sync::Arc;

use super::colours::{Held, colours};
use crate::mesh::{CellType, Mesh, Vector};
use crate::parallel;
use crate::partition::{Partition, Reduction, Shares, all, most, whole};
use crate::quality::{
    HEXAHEDRON_CORNERS, Measure, PYRAMID_CORNERS, VOXEL_AS_HEXAHEDRON, WEDGE_CORNERS, scaled_jacobians, tet_determinant,
};
use crate::vector::{add, cross, dot, scale, subtract};

/// How many vertices or corners are worked on at a time.
const VERTICES: usize = 64;
const CHUNK: usize = 4096;

/// Vertices stay where none of their cells has lost more than this part of its quality.
const GOOD: f64 = 0.95;

/// How far below the least quality the barrier stands, as a part of what that has lost (of this much at least).
const GAP: f64 = 0.05;
const LOST: f64 = 0.05;

/// The weight of the mean against the barrier.
const MEAN: f64 = 0.01;

/// Longest and shortest step tried along a direction, as powers of 2.
const LONGER: usize = 30;
const SHORTER: usize = 12;

/// Where a vertex comes first, the others of a tetrahedron follow so that its orientation stays.
const FIRST: [[usize; 4]; 4] = [[0, 1, 2, 3], [1, 0, 3, 2], [2, 0, 1, 3], [3, 0, 2, 1]];

/// Moves the free vertices of a mesh so that its worst cells get better, without making a new one as bad.
///
/// The quality of a cell is its scaled Jacobian by that of the same cell in the reference. One sweep moves every free vertex
/// that has a cell of less than 0.95, one after the other, down
///
/// `Σ (δ / (q - τ))² - 0.01 ln q`
///
/// over the corners `q` of its cells (a corner's determinant by the product of its edges) by one step of Newton's method with a
/// line search both ways. The barrier `τ` stands `δ` below the least `q` of the mesh and rises with it from sweep to sweep, so
/// that the worst cells are lifted first and all others gain as far as these let them. L. Freitag, C. Ollivier-Gooch (*Tetrahedral
/// mesh improvement using swapping and smoothing*, 1997) show why one vertex at a time is enough where a mesh is nearly good:
/// what a linear solve leaves to be mended lies close by.
///
/// Vertices of one colour share no cell and move at the same time, on all threads.
///
/// Vertices of pentagonal and hexagonal prisms and of polyhedra stay.
///
/// # Guarantees
/// - Vertices that are not free do not move, nor does any where no cell has lost a twentieth of its quality: rigid motions come
///   back bit for bit.
/// - The least quality is not lower afterwards, and no cell that was valid is turned inside out.
/// - The same bits whatever the number of threads; the same places, to rounding, however the vertices are numbered and whatever
///   parts the mesh is in.
#[derive(Debug)]
pub struct Improver {
    pieces: Vec<Piece>,
    /// Free vertices, none of a list with a cell in common.
    colours: Vec<Vec<u32>>,
    /// The pieces of each vertex: four times the piece, plus the vertex's place in it.
    incident: Vec<u32>,
    offsets: Vec<usize>,
    /// The pieces that have a free vertex.
    movable: Vec<u32>,
    parts: Option<Parts>,
}

/// What is known of the other ranks.
#[derive(Debug)]
struct Parts {
    partition: Arc<dyn Partition>,
    held: Held,
    /// For each colour which of its vertices are shared; these are in no list of `Improver::colours`.
    colours: Vec<Shares>,
}

/// A tetrahedron at a corner of a cell, or a cell that is one.
#[derive(Debug, Clone, Copy)]
struct Piece {
    vertices: [u32; 4],
    /// Makes a corner's determinant by the product of its edges the quality.
    factor: f64,
    /// Whether all four corners count, or the first alone.
    whole: bool,
}

/// A piece as one of its vertices sees it.
#[derive(Debug, Clone, Copy)]
struct Seen {
    others: [Vector; 3],
    /// The gradient of the determinant by the vertex.
    normal: Vector,
    factor: f64,
    /// What does not depend on the vertex of the product of the squared edges at each corner, the vertex's own first; infinite
    /// for corners that do not count.
    products: [f64; 4],
}

impl Improver {
    /// An improver of the cells of the reference mesh `mesh`; the vertices of `boundary` are not free.
    #[must_use]
    pub fn new(mesh: &Mesh, boundary: &[u32]) -> Self {
        Self::of_part(mesh, boundary, &whole())
    }

    /// The same where `mesh` is the part of this rank, whose cells no other rank has, and `boundary` its vertices on the boundary
    /// of the whole mesh. Collective, as is its use.
    #[must_use]
    pub fn of_part(mesh: &Mesh, boundary: &[u32], partition: &Arc<dyn Partition>) -> Self {
        let mut free = vec![true; mesh.points().len()];
        for &vertex in boundary {
            if let Some(free) = free.get_mut(vertex as usize) {
                *free = false;
            }
        }
        let pieces = pieces(mesh, &mut free);
        let held = (partition.ranks() > 1).then(|| Held::new(mesh, &**partition));
        if let Some(held) = &held {
            held.all(&**partition, &mut free);
        }
        let mut offsets = vec![0usize; free.len() + 1];
        for piece in &pieces {
            for &vertex in &piece.vertices {
                offsets[vertex as usize + 1] += usize::from(free[vertex as usize]);
            }
        }
        for vertex in 0..free.len() {
            offsets[vertex + 1] += offsets[vertex];
        }
        let mut next = offsets.clone();
        let mut incident = vec![0u32; offsets[free.len()]];
        let mut movable = Vec::new();
        for (number, piece) in (0u32..).zip(&pieces) {
            for (place, &vertex) in (0..).zip(&piece.vertices) {
                if free[vertex as usize] {
                    incident[next[vertex as usize]] = 4 * number + place;
                    next[vertex as usize] += 1;
                }
            }
            if piece.vertices.iter().any(|&vertex| free[vertex as usize]) {
                movable.push(number);
            }
        }
        let mut improver = Self { pieces, colours: Vec::new(), incident, offsets, movable, parts: None };
        let around = |vertex: u32, visit: &mut dyn FnMut(u32)| {
            for &code in improver.incident(vertex) {
                improver.pieces[(code / 4) as usize].vertices.iter().for_each(|&other| visit(other));
            }
        };
        let free: Vec<u32> = (0..).zip(&free).filter(|(_, free)| **free).map(|(vertex, _)| vertex).collect();
        let colour_of = colours(mesh.points(), &free, around, held.as_ref().map(|held| (&**partition, held)));
        let mut colours: Vec<Vec<u32>> = Vec::new();
        for &vertex in &free {
            let shared = held.as_ref().is_some_and(|held| held.is_shared(vertex));
            if !shared && let Some(colour) = colour_of[vertex as usize].map(usize::from) {
                colours.resize_with(colours.len().max(colour + 1), Vec::new);
                colours[colour].push(vertex);
            }
        }
        improver.parts = held.map(|held| {
            let of_place = |place: u32| colour_of[held.vertex(place) as usize].map(usize::from);
            let shared = held.shares().places().iter().filter_map(|&place| of_place(place));
            let own = shared.fold(colours.len(), |count, colour| count.max(colour + 1));
            colours.resize_with(most(&**partition, own), Vec::new);
            let of_colour = |colour: usize| held.shares().only(|place| of_place(place) == Some(colour));
            let shares = (0..colours.len()).map(of_colour).collect();
            Parts { partition: Arc::clone(partition), held, colours: shares }
        });
        improver.colours = colours;
        improver
    }

    /// Improves `points` (coordinates of each vertex) in at most `sweeps` sweeps. Says whether anything has moved; nothing does
    /// where a cell is turned inside out.
    pub fn improve(&self, points: &mut [Vector], sweeps: u32) -> bool {
        let fits = points.len() + 1 == self.offsets.len();
        if !self.parts.as_ref().map_or(fits, |parts| all(&*parts.partition, fits)) {
            return false;
        }
        let before = self.least(points);
        if sweeps == 0 || before.is_nan() || before <= 0.0 || before >= GOOD {
            return false;
        }
        let start = points.to_vec();
        let mut least = before;
        for _ in 0..sweeps {
            self.sweep(points, least);
            least = self.least(points);
        }
        let better = least >= before;
        if !better {
            points.copy_from_slice(&start);
        }
        better
    }

    /// The least quality of what can be moved.
    fn least(&self, points: &[Vector]) -> f64 {
        let least = parallel::map_chunks(self.movable.len(), CHUNK, |range| {
            self.movable[range]
                .iter()
                .map(|&piece| {
                    let piece = &self.pieces[piece as usize];
                    piece.seen(0, points).least(points[piece.vertices[0] as usize])
                })
                .fold(f64::INFINITY, |least, value| if value < least || value.is_nan() { value } else { least })
        })
        .into_iter()
        .fold(f64::INFINITY, |least, value| if value < least || value.is_nan() { value } else { least });
        match &self.parts {
            None => least,
            Some(Parts { partition, .. }) => {
                // The reduction passes over NaN.
                let mut least = [if least.is_nan() { f64::NEG_INFINITY } else { least }];
                partition.reduce(Reduction::Minimum, &mut least);
                least[0]
            }
        }
    }

    fn sweep(&self, points: &mut [Vector], least: f64) {
        let gap = GAP * least * (1.0 - least).max(LOST);
        let barrier = Barrier { floor: least - gap, gap };
        for (number, colour) in self.colours.iter().enumerate() {
            let moved = parallel::map_chunks(colour.len(), VERTICES, |range| {
                let mut star = Vec::new();
                colour[range]
                    .iter()
                    .map(|&vertex| {
                        self.gather(vertex, points, &mut star);
                        barrier.improved(points[vertex as usize], &star)
                    })
                    .collect::<Vec<Vector>>()
            });
            for (&vertex, place) in colour.iter().zip(moved.into_iter().flatten()) {
                points[vertex as usize] = place;
            }
            if let Some(parts) = &self.parts {
                self.sweep_shared(points, &barrier, parts, &parts.colours[number]);
            }
        }
    }

    /// The same for the vertices of one colour that other ranks have too: what the cells of all of them say is added up, so that
    /// all move them to the same place.
    fn sweep_shared(&self, points: &mut [Vector], barrier: &Barrier, parts: &Parts, shares: &Shares) {
        let Parts { partition, held, .. } = parts;
        let vertices: Vec<(u32, u32)> = shares.places().iter().map(|&place| (place, held.vertex(place))).collect();
        let mut star = Vec::new();
        // Whether any cell is not good, the gradient and the Hessian.
        let mut slopes = vec![[0.0; 13]; held.len()];
        for &(place, vertex) in &vertices {
            let point = points[vertex as usize];
            self.gather(vertex, points, &mut star);
            let (gradient, hessian) = barrier.derivatives(point, &star);
            let slope = &mut slopes[place as usize];
            slope[0] = f64::from(u8::from(!star.iter().all(|seen| seen.least(point) >= GOOD)));
            slope[1..4].copy_from_slice(&gradient);
            slope[4..].copy_from_slice(hessian.as_flattened());
        }
        shares.sum(&**partition, 13, slopes.as_flattened_mut());
        let direction = |place: u32| {
            let [bad, a, b, c, hessian @ ..] = slopes[place as usize];
            let gradient = [a, b, c];
            let direction =
                newton(&gradient, &std::array::from_fn(|row| std::array::from_fn(|k| hessian[3 * row + k])))?;
            (bad > 0.0).then(|| (direction, dot(direction, gradient)))
        };
        let mut energies = vec![[0.0; LENGTHS + 1]; held.len()];
        for &(place, vertex) in &vertices {
            let Some((direction, _)) = direction(place) else { continue };
            let point = points[vertex as usize];
            self.gather(vertex, points, &mut star);
            for (index, energy) in energies[place as usize].iter_mut().enumerate() {
                *energy = barrier.energy(add(point, scale(direction, length(index))), &star);
            }
        }
        shares.sum(&**partition, LENGTHS + 1, energies.as_flattened_mut());
        for &(place, vertex) in &vertices {
            let Some((direction, slope)) = direction(place) else { continue };
            let energies = &energies[place as usize];
            let along = |wanted: f64| energies[(0..=LENGTHS).find(|&index| length(index) == wanted).unwrap_or(0)];
            points[vertex as usize] = searched(points[vertex as usize], direction, slope, along);
        }
    }

    /// The pieces of a free vertex.
    fn incident(&self, vertex: u32) -> &[u32] {
        &self.incident[self.offsets[vertex as usize]..self.offsets[vertex as usize + 1]]
    }

    fn gather(&self, vertex: u32, points: &[Vector], star: &mut Vec<Seen>) {
        star.clear();
        star.extend(self.incident(vertex).iter().map(|&code| {
            let piece = &self.pieces[(code / 4) as usize];
            piece.seen((code % 4) as usize, points)
        }));
    }
}

impl Piece {
    fn seen(&self, place: usize, points: &[Vector]) -> Seen {
        let order = FIRST[place];
        let others = [order[1], order[2], order[3]].map(|local| points[self.vertices[local] as usize]);
        let [a, b, c] = others;
        let square = |p: Vector, q: Vector| {
            let edge = subtract(p, q);
            dot(edge, edge)
        };
        let (ab, ac, bc) = (square(a, b), square(a, c), square(b, c));
        let mut products = [1.0, ab * ac, ab * bc, ac * bc];
        if !self.whole {
            for (product, local) in products.iter_mut().zip(order) {
                if local != 0 {
                    *product = f64::INFINITY;
                }
            }
        }
        Seen { others, normal: cross(subtract(c, a), subtract(b, a)), factor: self.factor, products }
    }
}

impl Seen {
    /// Calls `visit` with the quality at each corner that counts where the vertex is at `point`, and the corner.
    #[inline]
    fn for_each_corner(&self, point: Vector, mut visit: impl FnMut(f64, usize)) {
        let squares = self.others.map(|other| {
            let edge = subtract(point, other);
            dot(edge, edge)
        });
        let determinant = self.factor * dot(self.normal, subtract(point, self.others[0]));
        for (corner, &product) in self.products.iter().enumerate() {
            if product < f64::INFINITY {
                let own = if corner == 0 { squares[0] * squares[1] * squares[2] } else { squares[corner - 1] };
                visit(determinant / (own * product).sqrt(), corner);
            }
        }
    }

    fn least(&self, point: Vector) -> f64 {
        let mut least = f64::INFINITY;
        self.for_each_corner(point, |quality, _| {
            if quality < least || quality.is_nan() {
                least = quality;
            }
        });
        least
    }
}

/// What one sweep brings down.
#[derive(Debug, Clone, Copy)]
struct Barrier {
    floor: f64,
    gap: f64,
}

impl Barrier {
    fn energy(&self, point: Vector, star: &[Seen]) -> f64 {
        let mut energy = 0.0;
        for seen in star {
            seen.for_each_corner(point, |quality, _| {
                let above = quality - self.floor;
                // Also where it is no number.
                energy += if above > 0.0 { (self.gap / above).powi(2) - MEAN * quality.ln() } else { f64::INFINITY };
            });
            if energy == f64::INFINITY {
                break;
            }
        }
        energy
    }

    /// A better place of a vertex, or its own.
    fn improved(&self, point: Vector, star: &[Seen]) -> Vector {
        let good = star.iter().all(|seen| seen.least(point) >= GOOD);
        if good {
            return point;
        }
        let (gradient, hessian) = self.derivatives(point, star);
        let Some(direction) = newton(&gradient, &hessian) else { return point };
        let energy = |length: f64| self.energy(add(point, scale(direction, length)), star);
        searched(point, direction, dot(direction, gradient), energy)
    }

    /// The energy's gradient and Hessian by the place of the vertex.
    fn derivatives(&self, point: Vector, star: &[Seen]) -> (Vector, [Vector; 3]) {
        let (mut gradient, mut hessian) = ([0.0; 3], [[0.0; 3]; 3]);
        for seen in star {
            let determinant = dot(seen.normal, subtract(point, seen.others[0]));
            let normal = scale(seen.normal, 1.0 / determinant);
            let edges = seen.others.map(|other| subtract(point, other));
            let inverse = edges.map(|edge| 1.0 / dot(edge, edge));
            seen.for_each_corner(point, |quality, corner| {
                // The derivatives of -ln q.
                let mut slope = scale(normal, -1.0);
                let mut bend: [Vector; 3] = std::array::from_fn(|row| scale(normal, normal[row]));
                let own = if corner == 0 { 0..3 } else { corner - 1..corner };
                for edge in own {
                    let unit = scale(edges[edge], inverse[edge]);
                    slope = add(slope, unit);
                    for row in 0..3 {
                        bend[row][row] += inverse[edge];
                        bend[row] = subtract(bend[row], scale(unit, 2.0 * unit[row]));
                    }
                }
                let above = quality - self.floor;
                let barrier = (self.gap / above).powi(2);
                let first = -2.0 * barrier / above - MEAN / quality;
                let second = 6.0 * barrier / (above * above) + MEAN / (quality * quality);
                let (linear, square) = (first * quality, second * quality * quality);
                gradient = subtract(gradient, scale(slope, linear));
                for row in 0..3 {
                    let outer = scale(slope, (square + linear) * slope[row]);
                    hessian[row] = add(hessian[row], subtract(outer, scale(bend[row], linear)));
                }
            });
        }
        (gradient, hessian)
    }
}

/// All steps that [`searched`] may try, and none.
const LENGTHS: usize = LONGER + SHORTER;

fn length(index: usize) -> f64 {
    let power = |power: usize| f64::from(i32::try_from(power).unwrap_or(0));
    if index == 0 { 0.0 } else { (power(index) - power(SHORTER)).exp2() }
}

/// The place along a direction where the energy, a function of the length, has fallen enough: where the direction itself is not too
/// long but falls short, as it does near the barrier, it is doubled while that helps.
fn searched(point: Vector, direction: Vector, slope: f64, mut energy: impl FnMut(f64) -> f64) -> Vector {
    let before = energy(0.0);
    let at = |length: f64| add(point, scale(direction, length));
    let mut length = 1.0;
    for _ in 0..SHORTER {
        let reached = energy(length);
        if reached <= before + 1e-4 * length * slope {
            if length < 1.0 {
                return at(length);
            }
            let mut least = reached;
            for _ in 0..LONGER {
                let longer = energy(2.0 * length);
                if longer.is_nan() || longer >= least {
                    break;
                }
                (least, length) = (longer, 2.0 * length);
            }
            return at(length);
        }
        length *= 0.5;
    }
    point
}

/// The direction of Newton's method, with as much of the identity added to the Hessian as makes it positive definite.
fn newton(gradient: &Vector, hessian: &[Vector; 3]) -> Option<Vector> {
    let size = (hessian[0][0] + hessian[1][1] + hessian[2][2]).abs();
    let least = 1e-9 * size;
    let mut shift = 0.0;
    for _ in 0..20 {
        let added = shift;
        let h = |row: usize, column: usize| hessian[row][column] + if row == column { added } else { 0.0 };
        shift = if shift == 0.0 { 1e-3 * size } else { 4.0 * shift };
        let first = h(0, 0);
        if first.is_nan() || first <= least {
            continue;
        }
        let (l10, l20) = (h(1, 0) / first, h(2, 0) / first);
        let second = h(1, 1) - l10 * h(1, 0);
        if second <= least {
            continue;
        }
        let l21 = (h(2, 1) - l20 * h(1, 0)) / second;
        let third = h(2, 2) - l20 * h(2, 0) - l21 * l21 * second;
        if third <= least {
            continue;
        }
        let y = [-gradient[0], -gradient[1] + l10 * gradient[0]];
        let y = [y[0], y[1], -gradient[2] - l20 * y[0] - l21 * y[1]];
        let z = y[2] / third;
        let middle = y[1] / second - l21 * z;
        let direction = [y[0] / first - l10 * middle - l20 * z, middle, z];
        return direction.iter().all(|value| value.is_finite()).then_some(direction);
    }
    None
}

/// The corners whose least is the quality of their cell. Vertices of cells that have none are taken out of `free`.
fn pieces(mesh: &Mesh, free: &mut [bool]) -> Vec<Piece> {
    let (cells, points) = (mesh.cells(), mesh.points());
    let measure = Measure::new(cells, points);
    let reference = scaled_jacobians(cells, points);
    let mut pieces = Vec::with_capacity(cells.len());
    for ((cell, (cell_type, vertices)), &scaled) in cells.iter().enumerate().zip(&reference) {
        let root = std::f64::consts::SQRT_2;
        let (corners, regular, whole): (&[[usize; 4]], f64, bool) = match cell_type {
            CellType::Tetra => (&[[0, 1, 2, 3]], root, true),
            CellType::Hexahedron | CellType::Voxel => (&HEXAHEDRON_CORNERS, 1.0, false),
            CellType::Wedge => (&WEDGE_CORNERS, 2.0 / 3.0f64.sqrt(), false),
            CellType::Pyramid => (&PYRAMID_CORNERS, 2.0, true),
            _ => (&[], 0.0, false),
        };
        let (from, sign) = (pieces.len(), measure.sign(cell));
        for corner in corners {
            let local =
                if cell_type == CellType::Voxel { corner.map(|local| VOXEL_AS_HEXAHEDRON[local]) } else { *corner };
            let [a, b, c, d] = local.map(|index| vertices[index]);
            let vertices = if sign < 0.0 { [a, c, b, d] } else { [a, b, c, d] };
            if tet_determinant(vertices.map(|vertex| points[vertex as usize])) > 0.0 {
                pieces.push(Piece { vertices, factor: regular / scaled, whole });
            }
        }
        let known = pieces.len() - from == corners.len() && !corners.is_empty() && scaled > 0.0;
        if !known && cell_type.dimension() == 3 {
            pieces.truncate(from);
            vertices.iter().for_each(|&vertex| free[vertex as usize] = false);
        }
    }
    pieces
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
        (values.iter().copied().fold(f64::INFINITY, f64::min), values.iter().sum::<f64>() / values.len() as f64)
    }

    fn meshes() -> Vec<Mesh> {
        let size = ([5, 6, 4], [0.0; 3], [1.0; 3]);
        vec![shapes::box_of_tets(size.0, size.1, size.2), shapes::box_of_hexahedra(size.0, size.1, size.2)]
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
            let turned: Vec<Vector> =
                mesh.points().iter().map(|&[x, y, z]| [c * x - s * y + 3.0, s * x + c * y, z - 1.0]).collect();
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

    /// The derivatives against central differences.
    #[test]
    fn derivatives_are_those_of_the_energy() {
        let mesh = &meshes()[0];
        let boundary = boundary(mesh);
        let points = shaken(mesh, &boundary);
        let improver = Improver::new(mesh, &boundary);
        let barrier = Barrier { floor: 0.2, gap: 0.1 };
        let vertex = improver.colours[0][3];
        let mut star = Vec::new();
        improver.gather(vertex, &points, &mut star);
        let point = points[vertex as usize];
        let (gradient, hessian) = barrier.derivatives(point, &star);
        for axis in 0..3 {
            let at = |step: f64| {
                let mut moved = point;
                moved[axis] += step;
                moved
            };
            let slope = (barrier.energy(at(1e-6), &star) - barrier.energy(at(-1e-6), &star)) / 2e-6;
            assert!((slope - gradient[axis]).abs() < 1e-5 * (1.0 + slope.abs()), "{slope} {}", gradient[axis]);
            let [after, before] = [1e-6, -1e-6].map(|step| barrier.derivatives(at(step), &star).0);
            for row in 0..3 {
                let bend = (after[row] - before[row]) / 2e-6;
                assert!((bend - hessian[row][axis]).abs() < 1e-4 * (1.0 + bend.abs()), "{bend} {}", hessian[row][axis]);
            }
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
