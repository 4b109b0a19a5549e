//! The contraction of a surface by mean curvature flow, centred by its poles.

use faer::Mat;

use super::medial::{self, NearestPoints};
use super::system::{Row, least_squares};
use super::triangulation::Triangulation;
use super::{SkeletonError, SkeletonSettings};
use crate::mesh::Vector;
use crate::vector::{add, distance, dot, length, scale, subtract};

/// Edges whose opposite angles have both no larger cosine than this are split (110 degrees).
const SPLIT_COSINE: f64 = -0.342_020_143_325_668_7;

/// The largest cotangent a weight is made of: what is lost of a needle's stiffness is nothing to
/// see, and the least squares system keeps its digits.
const LARGEST_COTANGENT: f64 = 1e3;

/// A pole counts as inside while it lies deeper than this below its vertex, in units of the
/// shortest edge kept.
const DEPTH: f64 = 0.5;

/// How far about a vertex the surface is looked at to see whether it has closed to a curve, in
/// units of the shortest edge kept.
const REACH: f64 = 2.0;

/// Contracts a surface of diagonal 1 until it hardly has an area (Tagliasacchi, Alhashim, Olson and
/// Zhang 2012). `go_on` is asked before each step; its error ends the flow.
pub(super) fn contract(
    mesh: &mut Triangulation,
    tree: &NearestPoints,
    settings: &SkeletonSettings,
    go_on: impl Fn() -> Result<(), SkeletonError>,
) -> Result<(), SkeletonError> {
    go_on()?;
    let first_area = mesh.area();
    let mut flow = Flow {
        shortest: settings.shortest_edge,
        poles: medial::poles(mesh, tree),
        fixed: vec![false; mesh.points.len()],
        mesh,
        work: [Vec::new(), Vec::new()],
    };
    let largest = 2 * flow.mesh.points.len() + 1000;
    let mut area = 0.0;
    for _ in 0..settings.iterations {
        go_on()?;
        flow.step(settings);
        flow.collapse_short_edges();
        if flow.mesh.vertex_count() < largest {
            flow.split_flat_triangles(largest);
        }
        flow.fix_degenerate();
        let reached = flow.mesh.area();
        let moves = (area - reached).abs() >= settings.area_change * first_area;
        if !moves {
            break;
        }
        area = reached;
    }
    Ok(())
}

struct Flow<'a> {
    mesh: &'a mut Triangulation,
    /// The pole of each vertex that has one.
    poles: Vec<Option<Vector>>,
    /// Vertices that have come to rest on the skeleton.
    fixed: Vec<bool>,
    shortest: f64,
    work: [Vec<u32>; 2],
}

impl Flow<'_> {
    /// One implicit step: the free vertices minimise
    /// `|L x|^2 + keep^2 |x - x_0|^2 + centre^2 |x - pole|^2`.
    fn step(&mut self, settings: &SkeletonSettings) {
        const NONE: u32 = u32::MAX;
        let mesh = &*self.mesh;
        let mut slots = vec![NONE; mesh.points.len()];
        let mut free = Vec::with_capacity(mesh.vertex_count());
        for vertex in 0..mesh.points.len() as u32 {
            if mesh.is_alive(vertex) && !self.fixed[vertex as usize] {
                slots[vertex as usize] = free.len() as u32;
                free.push(vertex);
            }
        }
        if free.is_empty() {
            return;
        }
        let normals = mesh.vertex_normals();
        let mut rows = Vec::with_capacity(free.len());
        let mut diagonal = Vec::with_capacity(free.len());
        let mut right_side = Mat::<f64>::zeros(free.len(), 3);
        let mut weights: Vec<(u32, f64)> = Vec::new();
        for (slot, &vertex) in free.iter().enumerate() {
            let point = mesh.points[vertex as usize];
            let mut pull = settings.keep * settings.keep;
            let mut target = scale(point, pull);
            if let Some(pole) = self.poles[vertex as usize]
                && dot(subtract(pole, point), normals[vertex as usize]) < -DEPTH * self.shortest
            {
                let centre = settings.centre * settings.centre;
                pull += centre;
                target = add(target, scale(pole, centre));
            }
            diagonal.push(pull);
            for axis in 0..3 {
                right_side[(slot, axis)] = target[axis];
            }

            weights.clear();
            for &number in &mesh.triangles_at[vertex as usize] {
                let [_, next, last] = starting_at(mesh.triangles[number as usize], vertex);
                weights.push((next, mesh.cotangent(last, vertex, next)));
                weights.push((last, mesh.cotangent(next, last, vertex)));
            }
            weights.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
            let mut row =
                Row { entries: Vec::with_capacity(weights.len() / 2 + 1), right_side: [0.0; 3] };
            let mut total = 0.0;
            for same in weights.chunk_by(|a, b| a.0 == b.0) {
                let weight: f64 = same.iter().map(|(_, weight)| weight).sum();
                let other = same[0].0;
                total += weight;
                match slots[other as usize] {
                    NONE => {
                        row.right_side =
                            subtract(row.right_side, scale(mesh.points[other as usize], weight));
                    }
                    column => row.entries.push((column, weight)),
                }
            }
            row.entries.push((slot as u32, -total));
            rows.push(row);
        }
        let Some(solution) = least_squares(&rows, &diagonal, right_side) else { return };
        for (slot, &vertex) in free.iter().enumerate() {
            let point = [0, 1, 2].map(|axis| solution[(slot, axis)]);
            if point.iter().all(|value| value.is_finite()) {
                self.mesh.points[vertex as usize] = point;
            }
        }
    }

    fn collapse_short_edges(&mut self) {
        let mut around = Vec::new();
        loop {
            let before = self.mesh.vertex_count();
            for vertex in 0..self.mesh.points.len() as u32 {
                // Until the vertex has no short edge left that may go.
                while self.mesh.is_alive(vertex) {
                    self.mesh.neighbours(vertex, &mut around);
                    let mut short: Vec<(f64, u32)> = around
                        .iter()
                        .filter(|&&other| {
                            !(self.fixed[vertex as usize] && self.fixed[other as usize])
                        })
                        .map(|&other| (self.mesh.length(vertex, other), other))
                        .filter(|edge| edge.0 < self.shortest)
                        .collect();
                    short.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                    let found = short
                        .into_iter()
                        .find(|&(_, other)| self.mesh.can_collapse(vertex, other, &mut self.work));
                    let Some((_, other)) = found else { break };
                    self.collapse(vertex, other);
                }
            }
            if self.mesh.vertex_count() == before {
                return;
            }
        }
    }

    fn collapse(&mut self, kept: u32, gone: u32) {
        let [kept_fixed, gone_fixed] = [kept, gone].map(|vertex| self.fixed[vertex as usize]);
        let merged = match (kept_fixed, gone_fixed) {
            (true, _) => self.mesh.points[kept as usize],
            (_, true) => self.mesh.points[gone as usize],
            _ => self.mesh.middle(kept, gone),
        };
        self.fixed[kept as usize] |= gone_fixed;
        self.mesh.collapse(kept, gone, merged);
        // Of two poles the nearer is the more likely to be still inside.
        let distance = |pole: Vector| distance(pole, merged);
        let nearer = match (self.poles[kept as usize], self.poles[gone as usize]) {
            (Some(own), Some(other)) => {
                Some(if distance(other) < distance(own) { other } else { own })
            }
            (own, other) => own.or(other),
        };
        self.poles[kept as usize] = nearer;
    }

    fn split_flat_triangles(&mut self, largest: usize) {
        let mut wide: Vec<(u32, u32, u32)> = Vec::new();
        for triangle in self.mesh.live_triangles() {
            for corner in 0..3 {
                let [a, b, c] = [0, 1, 2].map(|step| triangle[(corner + step) % 3]);
                if a < b
                    && self.mesh.cosine(c, a, b) <= SPLIT_COSINE
                    && let Some([(_, first), (_, second)]) = self.mesh.sides(a, b)
                {
                    let opposite = if first == c { second } else { first };
                    if self.mesh.cosine(opposite, a, b) <= SPLIT_COSINE {
                        let wider = self.mesh.cosine(c, a, b) <= self.mesh.cosine(opposite, a, b);
                        wide.push((a, b, if wider { c } else { opposite }));
                    }
                }
            }
        }
        for (a, b, c) in wide {
            if self.mesh.points.len() >= 8 * largest {
                return;
            }
            let [start, end, tip] = [a, b, c].map(|vertex| self.mesh.points[vertex as usize]);
            let along = subtract(end, start);
            let part = (dot(subtract(tip, start), along) / dot(along, along)).clamp(0.05, 0.95);
            if part.is_finite() && self.mesh.split(a, b, add(start, scale(along, part))).is_some() {
                self.poles.push(None);
                self.fixed.push(false);
            }
        }
    }

    /// Fixes the vertices about which the surface within [`REACH`] is no disc: it has closed to a
    /// curve there.
    fn fix_degenerate(&mut self) {
        let reach = REACH * self.shortest;
        let mut disc: Vec<u32> = Vec::new();
        let mut triangles: Vec<u32> = Vec::new();
        let mut around = Vec::new();
        for vertex in 0..self.mesh.points.len() as u32 {
            if !self.mesh.is_alive(vertex) || self.fixed[vertex as usize] {
                continue;
            }
            disc.clear();
            disc.push(vertex);
            let mut next = 0;
            while let Some(&inside) = disc.get(next) {
                next += 1;
                self.mesh.neighbours(inside, &mut around);
                for &other in &around {
                    if self.mesh.length(vertex, other) < reach && !disc.contains(&other) {
                        disc.push(other);
                    }
                }
            }
            if disc.len() < 3 {
                continue;
            }
            let mut edges = 0;
            triangles.clear();
            for &inside in &disc {
                self.mesh.neighbours(inside, &mut around);
                edges +=
                    around.iter().filter(|&&other| other > inside && disc.contains(&other)).count();
                triangles.extend(&self.mesh.triangles_at[inside as usize]);
            }
            triangles.sort_unstable();
            let whole = triangles.chunk_by(|a, b| a == b).filter(|same| same.len() == 3).count();
            if disc.len() + whole != edges + 1 {
                self.fixed[vertex as usize] = true;
            }
        }
    }
}

/// A triangle's vertices, from one of them on.
fn starting_at(triangle: [u32; 3], vertex: u32) -> [u32; 3] {
    let [a, b, c] = triangle;
    if a == vertex {
        [a, b, c]
    } else if b == vertex {
        [b, c, a]
    } else {
        [c, a, b]
    }
}

impl Triangulation {
    /// The cosine of the angle at `corner` between two other vertices; 1 where there is no angle.
    fn cosine(&self, corner: u32, a: u32, b: u32) -> f64 {
        let [corner, a, b] = [corner, a, b].map(|vertex| self.points[vertex as usize]);
        let [to_a, to_b] = [subtract(a, corner), subtract(b, corner)];
        let cosine = dot(to_a, to_b) / (dot(to_a, to_a) * dot(to_b, to_b)).sqrt();
        if cosine.is_finite() { cosine } else { 1.0 }
    }

    /// The cotangent of the angle at `corner` between two other vertices, not negative and not too
    /// large.
    fn cotangent(&self, corner: u32, a: u32, b: u32) -> f64 {
        let [apex, to_a, to_b] = [corner, a, b].map(|vertex| self.points[vertex as usize]);
        let area = length(self.normal([corner, a, b]));
        let cosine = dot(subtract(to_a, apex), subtract(to_b, apex));
        if cosine <= 0.0 {
            0.0
        } else if cosine >= LARGEST_COTANGENT * area {
            LARGEST_COTANGENT
        } else {
            cosine / area
        }
    }
}
