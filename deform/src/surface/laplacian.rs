//! The Laplacian of a surface, robust against bad triangles.

use super::Surface;
use super::adjacency::{Adjacency, OPEN, around};
use super::double_double::DoubleDouble;
use crate::parallel;
use crate::vector::subtract;

/// The cotangent Laplacian of a surface with its lumped mass, on the intrinsic Delaunay triangulation.
///
/// `(L u)_i = sum over j of w_ij (u_i - u_j)` with `w_ij = (cot a + cot b) / 2` for the angles opposite the edge. Where the sum of
/// cotangents of an inner edge is negative, the edge is flipped within the surface, which changes no length and no angle of the
/// surface itself but only what is a triangle (Bobenko and Springborn 2007); so the weights of inner edges are not negative.
/// `L` is symmetric and positive semidefinite; its kernel are the constants on each component. At an open rim the natural
/// boundary condition holds: no flux.
///
/// The mass of a vertex is its mixed Voronoi area (Meyer, Desbrun, Schröder and Barr 2003) divided by the mean of all, so that
/// nothing here depends on the units of the mesh.
///
/// Triangles without area are given one by lengthening all edges by the same least amount (Sharp and Crane 2020), so that the
/// longest side of each triangle is shorter than the two others by at least `slack` of its length; surfaces without such
/// triangles are taken as they are.
#[derive(Debug, Clone)]
pub(super) struct Laplacian {
    offsets: Vec<usize>,
    columns: Vec<u32>,
    weights: Vec<f64>,
    diagonal: Vec<f64>,
    mass: Vec<f64>,
}

impl Laplacian {
    /// Time and memory are linear in the surface, but for the flips.
    pub fn new(surface: &Surface, adjacency: &Adjacency, slack: f64) -> Self {
        let mut triangulation = Triangulation::new(surface, adjacency, slack);
        triangulation.make_delaunay();
        let mass = triangulation.mass(surface.points().len());
        let (offsets, columns, weights) = triangulation.compressed_rows(surface.points().len());
        let diagonal = offsets.windows(2).map(|row| weights[row[0]..row[1]].iter().sum()).collect();
        Self { offsets, columns, weights, diagonal, mass }
    }

    /// How many vertices the surface has.
    pub fn len(&self) -> usize {
        self.mass.len()
    }

    /// The mass of each vertex; their mean is 1.
    pub fn mass(&self) -> &[f64] {
        &self.mass
    }

    /// The neighbours of a vertex with their weights.
    pub fn neighbours(&self, vertex: usize) -> impl Iterator<Item = (usize, f64)> {
        let row = self.offsets[vertex]..self.offsets[vertex + 1];
        self.columns[row.clone()]
            .iter()
            .zip(&self.weights[row])
            .map(|(&column, &weight)| (column as usize, weight))
    }

    /// The row of `L` of a vertex, its diagonal first.
    pub fn row(&self, vertex: usize) -> impl Iterator<Item = (usize, f64)> {
        std::iter::once((vertex, self.diagonal[vertex]))
            .chain(self.neighbours(vertex).map(|(column, weight)| (column, -weight)))
    }

    /// `L u`. Constants give exact zeros.
    pub fn apply(&self, values: &[f64]) -> Vec<f64> {
        (0..self.len())
            .map(|vertex| {
                let own = values[vertex];
                self.neighbours(vertex)
                    .map(|(column, weight)| weight * (own - values[column]))
                    .sum()
            })
            .collect()
    }

    /// `(L M^-1)^(order - 1) L u`.
    pub fn apply_power(&self, order: usize, values: &[f64]) -> Vec<f64> {
        let mut result = self.apply(values);
        for _ in 1..order {
            for (value, mass) in result.iter_mut().zip(&self.mass) {
                *value /= mass;
            }
            result = self.apply(&result);
        }
        result
    }

    /// [`Laplacian::apply_power`] in twice the digits.
    pub fn apply_power_exactly(&self, order: usize, values: &[DoubleDouble]) -> Vec<DoubleDouble> {
        let apply = |values: &[DoubleDouble]| -> Vec<DoubleDouble> {
            let row = |vertex: usize| {
                let terms = self
                    .neighbours(vertex)
                    .map(|(column, weight)| (values[vertex] - values[column]).times(weight));
                terms.fold(DoubleDouble::default(), |sum, term| sum + term)
            };
            (0..self.len()).map(row).collect()
        };
        let mut result = apply(values);
        for _ in 1..order {
            let divided: Vec<DoubleDouble> =
                result.iter().zip(&self.mass).map(|(value, &mass)| value.over(mass)).collect();
            result = apply(&divided);
        }
        result
    }
}

/// A cotangent sum above this is no reason to flip: the four points lie on a circle up to rounding.
const FLIP_BELOW: f64 = -1e-10;

/// Triangles that one thread looks at in one go.
const CHUNK: usize = 1 << 13;

/// An intrinsic triangulation: side `3 t + s` of triangle `t` runs from its corner `s` to the next one.
struct Triangulation {
    corners: Vec<u32>,
    lengths: Vec<f64>,
    /// The cotangent of the angle opposite each side.
    cotangents: Vec<f64>,
    twins: Vec<u32>,
}

impl Triangulation {
    fn new(surface: &Surface, adjacency: &Adjacency, least_slack: f64) -> Self {
        let corners = surface.triangles().as_flattened().to_vec();
        let lengths = edge_lengths(surface, least_slack);
        let mut cotangents = vec![0.0; lengths.len()];
        parallel::for_each_chunk(&mut cotangents, 3 * CHUNK, |chunk, part| {
            for (sides, lengths) in
                part.chunks_exact_mut(3).zip(lengths[3 * CHUNK * chunk..].chunks_exact(3))
            {
                sides.copy_from_slice(&three_cotangents(lengths[0], lengths[1], lengths[2]));
            }
        });
        // Triangles that walk their edge the same way have no common side to flip in; both keep their weight.
        let twin = |(side, &other): (usize, &u32)| {
            if other != OPEN && corners[side] != corners[other as usize] { other } else { OPEN }
        };
        let twins = adjacency.across().iter().enumerate().map(twin).collect();
        Self { corners, lengths, cotangents, twins }
    }

    /// Flips sides until no inner edge has a negative sum of cotangents.
    fn make_delaunay(&mut self) {
        let sum = |side: usize, twin: u32| self.cotangents[side] + self.cotangents[twin as usize];
        let mut waiting: Vec<usize> = (0..self.twins.len())
            .rev()
            .filter(|&side| {
                let twin = self.twins[side];
                twin != OPEN && twin as usize > side && sum(side, twin) < FLIP_BELOW
            })
            .collect();
        if waiting.is_empty() {
            return;
        }
        let mut is_waiting = vec![false; self.twins.len()];
        for &side in &waiting {
            is_waiting[side] = true;
        }
        // Flipping ends by itself; the bound is for rounding alone, and leaves a valid triangulation.
        let mut flips_left = 64 * self.twins.len();
        while let Some(side) = waiting.pop() {
            is_waiting[side] = false;
            let twin = self.twins[side];
            if twin == OPEN || twin as usize / 3 == side / 3 {
                continue;
            }
            let twin = twin as usize;
            let sum = self.cotangents[side] + self.cotangents[twin];
            if sum >= FLIP_BELOW || flips_left == 0 || !self.flip(side, twin) {
                continue;
            }
            flips_left -= 1;
            for moved in
                [side, twin].into_iter().flat_map(|side| [around(side)[1], around(side)[2]])
            {
                let other = self.twins[moved];
                if other != OPEN {
                    let lower = moved.min(other as usize);
                    if !std::mem::replace(&mut is_waiting[lower], true) {
                        waiting.push(lower);
                    }
                }
            }
        }
    }

    /// Replaces the common side of two triangles by the other diagonal; refuses where rounding leaves a triangle without area.
    fn flip(&mut self, side: usize, twin: usize) -> bool {
        let [h, h1, h2] = around(side);
        let [g, g1, g2] = around(twin);
        let length = self.lengths[h];
        let (x, y) = apex(length, self.lengths[h2], self.lengths[h1]);
        let (u, v) = apex(length, self.lengths[g1], self.lengths[g2]);
        let diagonal = (x - u).hypot(y + v);
        let [bc, ca, ad, db] = [h1, h2, g1, g2].map(|side| self.lengths[side]);
        let has_area = |a, b, c| cotangent(a, b, c).is_finite() && area(a, b, c) > 0.0;
        if !(has_area(diagonal, ca, ad) && has_area(diagonal, db, bc)) {
            return false;
        }
        let [a, b, c, d] = [h, h1, h2, g2].map(|side| self.corners[side]);
        let outer = [h1, h2, g1, g2].map(|side| self.twins[side]);
        // Triangle h becomes d-c-a, triangle g becomes c-d-b.
        for (slot, corner) in [(h, d), (h1, c), (h2, a), (g, c), (g1, d), (g2, b)] {
            self.corners[slot] = corner;
        }
        for (slot, length) in [(h, diagonal), (h1, ca), (h2, ad), (g, diagonal), (g1, db), (g2, bc)]
        {
            self.lengths[slot] = length;
        }
        for [first, second, third] in [[h, h1, h2], [g, g1, g2]] {
            let cotangents =
                three_cotangents(self.lengths[first], self.lengths[second], self.lengths[third]);
            for (slot, cotangent) in [first, second, third].into_iter().zip(cotangents) {
                self.cotangents[slot] = cotangent;
            }
        }
        // Outer sides have moved: b-c to g2, c-a to h1, a-d to h2, d-b to g1. Two of them may be twins of each other.
        let moved = |old: u32| match old {
            old if old == OPEN => OPEN,
            old if old as usize == h1 => g2 as u32,
            old if old as usize == h2 => h1 as u32,
            old if old as usize == g1 => h2 as u32,
            old if old as usize == g2 => g1 as u32,
            old => old,
        };
        for (slot, old) in [(g2, outer[0]), (h1, outer[1]), (h2, outer[2]), (g1, outer[3])] {
            let other = moved(old);
            self.twins[slot] = other;
            if other != OPEN {
                self.twins[other as usize] = slot as u32;
            }
        }
        true
    }

    fn mass(&self, vertex_count: usize) -> Vec<f64> {
        let mut mass = vec![0.0; vertex_count];
        for triangle in 0..self.corners.len() / 3 {
            let [a, b, c] = [0, 1, 2].map(|side| self.lengths[3 * triangle + side]);
            let [i, j, k] = [0, 1, 2].map(|corner| self.corners[3 * triangle + corner]);
            // The cotangents of the angles at k, i and j: opposite the sides i-j, j-k and k-i.
            let opposite = [0, 1, 2].map(|side| self.cotangents[3 * triangle + side]);
            let obtuse = opposite.iter().any(|&cotangent| cotangent < 0.0);
            let area = if obtuse { area(a, b, c) } else { 0.0 };
            let corners = [
                (i, opposite[1], a * a * opposite[0] + c * c * opposite[2]),
                (j, opposite[2], a * a * opposite[0] + b * b * opposite[1]),
                (k, opposite[0], b * b * opposite[1] + c * c * opposite[2]),
            ];
            for (vertex, own, voronoi) in corners {
                mass[vertex as usize] += match obtuse {
                    false => voronoi / 8.0,
                    true if own < 0.0 => area / 2.0,
                    true => area / 4.0,
                };
            }
        }
        let mean = mass.iter().sum::<f64>() / vertex_count as f64;
        for value in &mut mass {
            *value /= mean;
            if *value < 1e-12 {
                *value = 1e-12;
            }
        }
        mass
    }

    /// The weights of the neighbours of each vertex, rising.
    fn compressed_rows(&self, vertex_count: usize) -> (Vec<usize>, Vec<u32>, Vec<f64>) {
        // Each edge once, at the lower one of its sides; edges may join the same vertices, or one with itself.
        let edges = || {
            (0..self.corners.len()).filter_map(|side| {
                let [from, to] = [side, around(side)[1]].map(|side| self.corners[side]);
                let twin = self.twins[side];
                let weight = 0.5 * self.cotangents[side];
                match twin {
                    _ if from == to => None,
                    OPEN => Some((from, to, weight)),
                    twin if (twin as usize) < side => None,
                    twin => Some((from, to, weight + 0.5 * self.cotangents[twin as usize])),
                }
            })
        };
        let mut starts = vec![0usize; vertex_count + 1];
        for (from, to, _) in edges() {
            starts[from as usize + 1] += 1;
            starts[to as usize + 1] += 1;
        }
        for row in 0..vertex_count {
            starts[row + 1] += starts[row];
        }
        let mut entries = vec![(0u32, 0.0f64); starts[vertex_count]];
        let mut next = starts.clone();
        for (from, to, weight) in edges() {
            for (row, column) in [(from, to), (to, from)] {
                entries[next[row as usize]] = (column, weight);
                next[row as usize] += 1;
            }
        }
        let mut offsets = Vec::with_capacity(vertex_count + 1);
        offsets.push(0);
        let mut columns = Vec::with_capacity(entries.len());
        let mut weights = Vec::with_capacity(entries.len());
        for row in starts.windows(2) {
            let entries = &mut entries[row[0]..row[1]];
            entries.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
            for same in entries.chunk_by(|a, b| a.0 == b.0) {
                columns.push(same[0].0);
                weights.push(same.iter().map(|(_, weight)| weight).sum());
            }
            offsets.push(columns.len());
        }
        (offsets, columns, weights)
    }
}

/// The cotangents of the angles opposite each side of a triangle.
#[cfg_attr(target_arch = "wasm32", inline(never))]
fn three_cotangents(a: f64, b: f64, c: f64) -> [f64; 3] {
    let area = 4.0 * area(a, b, c);
    let [a, b, c] = [a * a, b * b, c * c];
    [(b + c - a) / area, (c + a - b) / area, (a + b - c) / area]
}

/// The cotangent of the angle opposite the side of length `a`.
fn cotangent(a: f64, b: f64, c: f64) -> f64 {
    (b * b + c * c - a * a) / (4.0 * area(a, b, c))
}

/// The area of a triangle from its sides, without loss of digits (Kahan 2014).
fn area(a: f64, b: f64, c: f64) -> f64 {
    let (a, b) = if a < b { (b, a) } else { (a, b) };
    let (b, c) = if b < c { (c, b) } else { (b, c) };
    let (a, b) = if a < b { (b, a) } else { (a, b) };
    0.25 * ((a + (b + c)) * (c - (a - b)) * (c + (a - b)) * (a + (b - c))).max(0.0).sqrt()
}

/// The place of a triangle's third corner when its first side lies on the x axis from the origin.
fn apex(base: f64, from_origin: f64, from_end: f64) -> (f64, f64) {
    let x = (base * base + from_origin * from_origin - from_end * from_end) / (2.0 * base);
    (x, 2.0 * area(base, from_origin, from_end) / base)
}

/// The lengths of all sides, in units of their mean, lengthened where a triangle would have no area.
fn edge_lengths(surface: &Surface, least_slack: f64) -> Vec<f64> {
    let points = surface.points();
    let larger =
        |largest: f64, value: &f64| if value.abs() > largest { value.abs() } else { largest };
    let scale = points.iter().flatten().fold(0.0, larger);
    let scale = if scale > 0.0 { scale } else { 1.0 };
    let triangles = surface.triangles();
    let mut lengths = vec![0.0; 3 * triangles.len()];
    parallel::for_each_chunk(&mut lengths, 3 * CHUNK, |chunk, part| {
        for (sides, triangle) in part.chunks_exact_mut(3).zip(&triangles[CHUNK * chunk..]) {
            let corners = triangle.map(|vertex| points[vertex as usize].map(|value| value / scale));
            for side in 0..3 {
                let [x, y, z] = subtract(corners[(side + 1) % 3], corners[side]);
                sides[side] = (x * x + y * y + z * z).sqrt();
            }
        }
    });
    let mean = lengths.iter().sum::<f64>() / lengths.len() as f64;
    if mean > 0.0 {
        for length in &mut lengths {
            *length /= mean;
        }
    }
    let missing = lengths
        .chunks_exact(3)
        .map(|sides| {
            let longest = sides
                .iter()
                .fold(0.0, |longest, &side| if side > longest { side } else { longest });
            let slack = sides.iter().sum::<f64>() - 2.0 * longest;
            least_slack * if longest > 1e-6 { longest } else { 1e-6 } - slack
        })
        .fold(0.0, |most, missing| if missing > most { missing } else { most });
    if missing > 0.0 {
        for length in &mut lengths {
            *length += missing;
        }
    }
    lengths
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{FeatureSource, Mesh, Vector};
    use crate::shapes;
    use crate::surface::FeatureSettings;

    fn laplacian(mesh: &Mesh, place: impl Fn(Vector) -> Vector) -> (Surface, Laplacian) {
        let points = mesh.points().iter().map(|&point| place(point)).collect();
        let mesh = Mesh::new(points, mesh.cells().clone(), FeatureSource::SharpEdges).unwrap();
        let surface = Surface::extract(&mesh, &FeatureSettings::default()).unwrap();
        let laplacian = Laplacian::new(&surface, &Adjacency::new(&surface).unwrap(), 1e-9);
        (surface, laplacian)
    }

    /// A plate sheared and bent within its plane, so that most of its triangles are obtuse, some by 170 degrees.
    fn sheared([x, y, _]: Vector) -> Vector {
        [x + 4.0 * y + 0.1 * (3.0 * y).sin(), y + 0.03 * (5.0 * x).sin(), 0.0]
    }

    #[test]
    fn inner_edges_of_obtuse_triangles_have_no_negative_weight() {
        let torus = shapes::torus(2.0, 0.5, [30, 18]);
        let (_, laplacian) = laplacian(&torus, |[x, y, z]| [x + 3.0 * z, 4.0 * y + 2.0 * x, z]);
        let lowest = (0..laplacian.len())
            .flat_map(|vertex| laplacian.neighbours(vertex))
            .map(|(_, weight)| weight);
        assert!(lowest.fold(f64::INFINITY, f64::min) > -1e-9);
        let mean = laplacian.mass().iter().sum::<f64>() / laplacian.len() as f64;
        assert!((mean - 1.0).abs() < 1e-12 && laplacian.mass().iter().all(|&mass| mass > 0.0));
    }

    #[test]
    fn flips_change_neither_the_energy_nor_the_kernel_of_linear_functions() {
        let plate = shapes::plate([12, 10], [0.0, 0.0], [1.2, 1.0]);
        let (surface, laplacian) = laplacian(&plate, sheared);
        let triangles = surface.triangles();
        let flipped = (0..laplacian.len()).any(|vertex| {
            laplacian.neighbours(vertex).any(|(other, weight)| {
                let joined =
                    |t: &[u32; 3]| t.contains(&(vertex as u32)) && t.contains(&(other as u32));
                weight > 1e-6 && !triangles.iter().any(joined)
            })
        });
        assert!(flipped, "the test would show nothing");
        let area: f64 = triangles
            .iter()
            .map(|triangle| {
                let [a, b, c] = triangle.map(|vertex| surface.points()[vertex as usize]);
                0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
            })
            .sum();
        for axis in 0..2 {
            let values: Vec<f64> = surface.points().iter().map(|point| point[axis]).collect();
            let image = laplacian.apply(&values);
            // The energy of a coordinate is the integral of 1 over the plate.
            let energy: f64 = values.iter().zip(&image).map(|(value, image)| value * image).sum();
            assert!((energy / area - 1.0).abs() < 1e-11, "{energy} {area}");
            for j in 1..10 {
                for i in 1..12 {
                    assert!(image[i + 13 * j].abs() < 1e-11);
                }
            }
        }
    }

    #[test]
    fn the_laplacian_is_symmetric_and_annihilates_constants() {
        let (_, laplacian) = laplacian(&shapes::torus(2.0, 0.5, [20, 12]), |[x, y, z]| {
            [x, y + 0.3 * x * z, 3.0 * z]
        });
        for vertex in 0..laplacian.len() {
            for (other, weight) in laplacian.neighbours(vertex) {
                let back: Vec<f64> = laplacian
                    .neighbours(other)
                    .filter(|(back, _)| *back == vertex)
                    .map(|(_, weight)| weight)
                    .collect();
                assert_eq!(back, [weight]);
            }
        }
        for order in 1..4 {
            assert!(
                laplacian
                    .apply_power(order, &vec![0.1; laplacian.len()])
                    .iter()
                    .all(|&value| value == 0.0)
            );
        }
    }

    /// `M^-1 L` of the coordinates is twice the mean curvature times the normal.
    #[test]
    fn the_curvature_of_a_torus_converges() {
        let error = |count: usize| {
            let (surface, laplacian) =
                laplacian(&shapes::torus(2.0, 1.0, [2 * count, count]), |point| point);
            let total: f64 = 4.0 * std::f64::consts::PI.powi(2) * 2.0;
            let area = total / laplacian.len() as f64;
            let images = [0, 1, 2].map(|axis| {
                laplacian.apply(&surface.points().iter().map(|p| p[axis]).collect::<Vec<f64>>())
            });
            (0..laplacian.len())
                .map(|vertex| {
                    let [x, y, z] = surface.points()[vertex];
                    let cosine = x.hypot(y) - 2.0;
                    let expected = (2.0 + 2.0 * cosine) / (2.0 + cosine);
                    let image = images
                        .each_ref()
                        .map(|image| image[vertex] / (laplacian.mass()[vertex] * area));
                    let normal = [cosine * x / x.hypot(y), cosine * y / x.hypot(y), z];
                    let found: f64 = (0..3).map(|axis| image[axis] * normal[axis]).sum();
                    (found - expected).abs()
                })
                .fold(0.0, f64::max)
        };
        let [coarse, fine] = [error(24), error(48)];
        assert!(coarse / fine > 3.0 && fine < 0.02, "{coarse} {fine}");
    }
}
