//! The intrinsic Delaunay triangulation of a surface.

use crate::parallel;
use crate::surface::Surface;
use crate::surface::adjacency::Adjacency;
use crate::topology::{Groups, OPEN, around};
use crate::vector::subtract;

/// A cotangent sum above this is no reason to flip: the four points lie on a circle up to rounding.
const FLIP_BELOW: f64 = -1e-10;

/// Triangles that one thread looks at in one go.
const CHUNK: usize = 1 << 13;

/// An intrinsic triangulation: side `3 t + s` of triangle `t` runs from its corner `s` to the next
/// one.
pub(super) struct Triangulation {
    corners: Vec<u32>,
    lengths: Vec<f64>,
    /// The cotangent of the angle opposite each side.
    cotangents: Vec<f64>,
    twins: Vec<u32>,
}

impl Triangulation {
    pub fn new(surface: &Surface, adjacency: &Adjacency, least_slack: f64) -> Self {
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
        // Triangles that walk their edge the same way have no common side to flip in; both keep
        // their weight.
        let twin = |(side, &other): (usize, &u32)| {
            if other != OPEN && corners[side] != corners[other as usize] { other } else { OPEN }
        };
        let twins = adjacency.twins().iter().enumerate().map(twin).collect();
        Self { corners, lengths, cotangents, twins }
    }

    /// Flips sides until no inner edge has a negative sum of cotangents.
    pub fn make_delaunay(&mut self) {
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
        // Flipping ends by itself; the bound is for rounding alone, and leaves a valid
        // triangulation.
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

    /// Replaces the common side of two triangles by the other diagonal; refuses where rounding
    /// leaves a triangle without area.
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
        // Outer sides have moved: b-c to g2, c-a to h1, a-d to h2, d-b to g1. Two of them may be
        // twins of each other.
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

    /// The mass of each vertex (see [`Laplacian`](super::Laplacian)).
    pub fn mass(&self, vertex_count: usize) -> Vec<f64> {
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
    pub fn compressed_rows(&self, vertex_count: usize) -> (Vec<usize>, Vec<u32>, Vec<f64>) {
        // Each edge once, at the lower one of its sides; edges may join the same vertices, or one
        // with itself.
        let edges = (0..self.corners.len()).filter_map(|side| {
            let [from, to] = [side, around(side)[1]].map(|side| self.corners[side]);
            let twin = self.twins[side];
            let weight = 0.5 * self.cotangents[side];
            match twin {
                _ if from == to => None,
                OPEN => Some((from, to, weight)),
                twin if (twin as usize) < side => None,
                twin => Some((from, to, weight + 0.5 * self.cotangents[twin as usize])),
            }
        });
        let entries =
            edges.flat_map(|(from, to, weight)| [(from, (to, weight)), (to, (from, weight))]);
        let mut rows = Groups::new(vertex_count, entries);
        let mut offsets = Vec::with_capacity(vertex_count + 1);
        offsets.push(0);
        let mut columns = Vec::with_capacity(rows.items.len());
        let mut weights = Vec::with_capacity(rows.items.len());
        rows.for_each_mut(|entries| {
            entries.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
            for same in entries.chunk_by(|a, b| a.0 == b.0) {
                columns.push(same[0].0);
                weights.push(same.iter().map(|(_, weight)| weight).sum());
            }
            offsets.push(columns.len());
        });
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

/// The coordinates of a triangle's third corner when its first side lies on the x axis from the
/// origin.
fn apex(base: f64, from_origin: f64, from_end: f64) -> (f64, f64) {
    let x = (base * base + from_origin * from_origin - from_end * from_end) / (2.0 * base);
    (x, 2.0 * area(base, from_origin, from_end) / base)
}

/// The lengths of all sides, in units of their mean, lengthened where a triangle would have no
/// area.
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
