//! Pruning: from a graph of merged vertices to polylines without spurs.

use std::collections::HashMap;

use super::SkeletonSettings;
use super::medial::NearestPoints;
use super::thinning::Graph;
use crate::mesh::Vector;
use crate::topology::lead_to_roots;
use crate::vector::{add, distance, dot, length, scale, subtract};

/// How fast the distance to the surface falls along an end that runs straight at it, as a part of
/// the way.
const STRAIGHT: f64 = 0.5;

/// The distance of an end from its cap, in parts of the distance to the surface before it.
const CAP: f64 = 0.82;

/// How much farther that is where a tube is flat, in parts of what its mean radius is more than the
/// least.
const WIDE: f64 = 2.5;

/// A piece whose only curve is shorter than this many times its radius is as long as wide: it has
/// one node.
const LONE: f64 = 2.0;

/// How many times the least radius the mean one is at least where a tube counts as flat.
const FLAT: f64 = 1.3;

/// How much farther than the nearest the points of a flat tube may be from its middle.
const FLATTEST: f64 = 2.5;

/// The skeleton of one piece.
pub(super) struct Curves {
    pub nodes: Vec<Vector>,
    pub polylines: Vec<Vec<u32>>,
    /// For each original vertex the node that carries it.
    pub node_of_original: Vec<u32>,
}

impl Curves {
    /// `originals` are surface vertices, each with the vertex of the graph it has become part of;
    /// `surface` has the points that the graph lies amid.
    pub fn new(
        graph: Graph,
        originals: &[(u32, u32)],
        surface: &NearestPoints,
        settings: &SkeletonSettings,
    ) -> Self {
        let radii = graph.points.iter().map(|&point| surface.distance(point)).collect();
        let mut pruning = Pruning { graph, radii };
        pruning.prune(settings.shortest_branch);
        pruning.finish_ends(surface);
        pruning.prune(settings.shortest_branch);
        pruning.smooth();
        pruning.into_curves(originals)
    }
}

fn distance_to_segment(point: Vector, [from, to]: [Vector; 2]) -> f64 {
    let [along, away] = [subtract(to, from), subtract(point, from)];
    let part = (dot(along, away) / dot(along, along)).clamp(0.0, 1.0);
    length(subtract(away, scale(along, if part.is_finite() { part } else { 0.0 })))
}

struct Pruning {
    graph: Graph,
    /// The distance of each vertex from the surface.
    radii: Vec<f64>,
}

/// A path between two vertices that are no inner vertex of one, or round a loop.
struct Chain {
    vertices: Vec<u32>,
    length: f64,
}

impl Pruning {
    fn is_alive(&self, vertex: u32) -> bool {
        self.graph.merged[vertex as usize] == vertex
    }

    fn degree(&self, vertex: u32) -> usize {
        self.graph.neighbours[vertex as usize].len()
    }

    /// All chains, from ends and branch vertices first, then the loops that have none.
    fn chains(&self) -> Vec<Chain> {
        let mut chains = Vec::new();
        let mut walked = vec![false; self.graph.points.len()];
        let count = self.graph.points.len() as u32;
        for start in (0..count)
            .filter(|&vertex| self.is_alive(vertex) && !matches!(self.degree(vertex), 0 | 2))
        {
            for &second in &self.graph.neighbours[start as usize] {
                let vertices = self.walk(start, second);
                // Each chain is met from both ends; the one walk that began at the lower end
                // counts.
                let last = vertices[vertices.len() - 1];
                let back = vertices[vertices.len() - 2];
                if (start, second) <= (last, back) {
                    chains.push(self.chain(vertices, &mut walked));
                }
            }
        }
        for start in 0..count {
            if self.is_alive(start) && self.degree(start) == 2 && !walked[start as usize] {
                let vertices = self.walk(start, self.graph.neighbours[start as usize][0]);
                chains.push(self.chain(vertices, &mut walked));
            }
        }
        chains
    }

    fn walk(&self, start: u32, second: u32) -> Vec<u32> {
        let mut vertices = vec![start, second];
        let mut before = start;
        let mut vertex = second;
        while vertex != start && self.degree(vertex) == 2 {
            let around = &self.graph.neighbours[vertex as usize];
            let next = if around[0] == before { around[1] } else { around[0] };
            vertices.push(next);
            (before, vertex) = (vertex, next);
        }
        vertices
    }

    fn chain(&self, vertices: Vec<u32>, walked: &mut [bool]) -> Chain {
        vertices.iter().for_each(|&vertex| walked[vertex as usize] = true);
        let point = |vertex: u32| self.graph.points[vertex as usize];
        let length = vertices.windows(2).map(|pair| distance(point(pair[1]), point(pair[0]))).sum();
        Chain { vertices, length }
    }

    /// Cuts off short branches, and draws branch vertices together that a short chain joins,
    /// shortest first.
    fn prune(&mut self, shortest: f64) {
        loop {
            let mut chains = self.with_reach(self.chains());
            let alone = chains.len() == 1;
            chains.sort_by(|a, b| a.length.total_cmp(&b.length));
            let found = chains.into_iter().find_map(|chain| {
                let [first, last] = [chain.vertices[0], chain.vertices[chain.vertices.len() - 1]];
                let [radius_first, radius_last] = [first, last].map(|end| self.radii[end as usize]);
                // The widest, not where a branch begins: at a corner that may lie well off the
                // middle.
                let widest = || {
                    chain
                        .vertices
                        .iter()
                        .map(|&vertex| self.radii[vertex as usize])
                        .fold(0.0, f64::max)
                };
                let is_short = || chain.length < shortest * widest();
                match (self.degree(first) == 1, self.degree(last) == 1) {
                    (true, true) => (alone && chain.length < LONE * widest())
                        .then(|| (chain.vertices[chain.vertices.len() / 2], chain)),
                    (true, false) => is_short().then_some((last, chain)),
                    (false, true) => is_short().then_some((first, chain)),
                    (false, false) => (first != last
                        && chain.length < 0.25 * shortest * radius_first.max(radius_last)
                        && self.may_join(first, last, &chain.vertices))
                    .then_some((first, chain)),
                }
            });
            match found {
                Some((kept, chain)) => self.merge(kept, &chain.vertices),
                None => return,
            }
        }
    }

    /// Takes for the length of a chain with one free end how far it leads away from the others: one
    /// that runs back along them leads nowhere.
    fn with_reach(&self, mut chains: Vec<Chain>) -> Vec<Chain> {
        let point = |vertex: u32| self.graph.points[vertex as usize];
        let reaches: Vec<f64> = (0..chains.len())
            .map(|own| {
                let vertices = &chains[own].vertices;
                let [first, last] = [vertices[0], vertices[vertices.len() - 1]];
                if (self.degree(first) == 1) == (self.degree(last) == 1) {
                    return chains[own].length;
                }
                let others = || chains.iter().enumerate().filter(|(other, _)| *other != own);
                let away = |vertex: u32| {
                    others()
                        .flat_map(|(_, chain)| chain.vertices.windows(2))
                        .map(|pair| {
                            distance_to_segment(point(vertex), [point(pair[0]), point(pair[1])])
                        })
                        .fold(f64::INFINITY, f64::min)
                };
                vertices
                    .iter()
                    .map(|&vertex| away(vertex))
                    .fold(0.0, f64::max)
                    .min(chains[own].length)
            })
            .collect();
        chains.iter_mut().zip(reaches).for_each(|(chain, reach)| chain.length = reach);
        chains
    }

    /// Leads every end anew. What contracts last is blurred by the spacing of the vertices and
    /// drawn to the corners of caps: it is cut back to where the surface is about as far as before,
    /// or by one radius where the tube is flat, and the curve goes straight on from there until it
    /// is about one radius from the cap.
    fn finish_ends(&mut self, surface: &NearestPoints) {
        for chain in self.chains() {
            for mut vertices in
                [chain.vertices.clone(), chain.vertices.iter().rev().copied().collect()]
            {
                if self.degree(vertices[0]) != 1 {
                    continue;
                }
                // Half a curve with two free ends for each of them.
                if self.degree(vertices[vertices.len() - 1]) == 1 {
                    vertices.truncate(vertices.len().div_ceil(2));
                }
                self.finish_end(&vertices, surface);
            }
        }
    }

    /// `vertices` run from the end inwards.
    fn finish_end(&mut self, vertices: &[u32], surface: &NearestPoints) {
        let point = |vertex: u32| self.graph.points[vertex as usize];
        let mut runs = vec![0.0];
        for pair in vertices.windows(2) {
            runs.push(runs[runs.len() - 1] + distance(point(pair[1]), point(pair[0])));
        }
        let whole = runs[runs.len() - 1];
        let at = |run: f64| runs.partition_point(|&own| own < run).min(vertices.len() - 1);
        let largest = |from: usize, to: usize| {
            vertices[from..=to]
                .iter()
                .map(|&vertex| self.radii[vertex as usize])
                .fold(0.0, f64::max)
        };
        // The distance to the surface where the end has become a tube, and the mean distance to it
        // across, which is more where the tube is flat.
        let depth = largest(0, at(2.0 * self.radii[vertices[0] as usize]));
        let [near, far] = [at(depth), at(2.5 * depth)];
        let width = match surface
            .mean_across([point(vertices[near]), point(vertices[far])], FLATTEST * depth)
        {
            Some(width) if near < far => width.max(depth),
            _ => depth,
        };
        let is_flat = width > FLAT * depth;
        let whole_tube = at(width);
        let reached = 0.93 * largest(0, whole_tube);
        let cut = match vertices[..whole_tube]
            .iter()
            .position(|&vertex| self.radii[vertex as usize] >= reached)
        {
            Some(cut) if !is_flat => cut,
            _ => whole_tube,
        };
        let back = at(runs[cut] + width);
        let depth = self.radii[vertices[cut] as usize];
        let along = subtract(point(vertices[cut]), point(vertices[back]));
        let chord = length(along);
        if chord <= 0.0 || !depth.is_finite() || whole < 2.0 * width {
            return self.cut_straight(vertices, &runs);
        }
        let along = scale(along, 1.0 / chord);
        let start = point(vertices[cut]);
        let ahead = |run: f64| add(start, scale(along, run));
        let step = 0.05 * depth;
        let steps = (0..200)
            .take_while(|&count| surface.distance(ahead(f64::from(count) * step)) >= CAP * depth)
            .count();
        if steps == 0 {
            return;
        }
        let reach =
            (steps as f64 - 1.0) * step - if is_flat { WIDE * (width - FLAT * depth) } else { 0.0 };
        // As many of its vertices as lie as close as those before them.
        let spacing = (runs[back] - runs[cut]) / (back - cut) as f64;
        let wanted = ((reach / spacing).round().max(0.0) as usize).min(cut);
        self.merge(vertices[cut - wanted], &vertices[..=cut - wanted]);
        if wanted == 0 && reach > 0.0 {
            self.graph.points[vertices[cut] as usize] = ahead(reach);
        }
        for (count, &vertex) in (1..=wanted).zip(vertices[..cut].iter().rev()) {
            let moved = ahead(reach * count as f64 / wanted as f64);
            self.graph.points[vertex as usize] = moved;
            self.radii[vertex as usize] = surface.distance(moved);
        }
    }

    /// Cuts off what of a short end runs straight at the surface: there the distance to the surface
    /// falls nearly as fast as the curve runs. `runs` are the lengths from the end to each vertex.
    fn cut_straight(&mut self, vertices: &[u32], runs: &[f64]) {
        let first = self.radii[vertices[0] as usize];
        let excess =
            |index: usize| self.radii[vertices[index] as usize] - first - STRAIGHT * runs[index];
        let most = (0..vertices.len()).map(excess).fold(0.0, f64::max);
        // Not to the last node before the turn: where exactly it lies is blurred by the spacing of
        // the vertices.
        let cut = (0..vertices.len()).position(|index| excess(index) >= 0.7 * most).unwrap_or(0);
        if cut > 0 {
            self.merge(vertices[cut], &vertices[..=cut]);
        }
    }

    /// Whether two vertices have no neighbour in common other than on the chain between them: no
    /// loop is lost.
    fn may_join(&self, a: u32, b: u32, chain: &[u32]) -> bool {
        let around = &self.graph.neighbours[b as usize];
        let direct = around.contains(&a) && chain.len() > 2;
        !direct
            && !self.graph.neighbours[a as usize]
                .iter()
                .any(|vertex| around.contains(vertex) && !chain.contains(vertex))
    }

    /// Merges the vertices of a chain into one of them, in the middle of its ends where both are
    /// branch vertices.
    fn merge(&mut self, kept: u32, chain: &[u32]) {
        let [first, last] = [chain[0], chain[chain.len() - 1]];
        if self.degree(first) > 2 && self.degree(last) > 2 {
            let sum = add(self.graph.points[first as usize], self.graph.points[last as usize]);
            self.graph.points[kept as usize] = scale(sum, 0.5);
        }
        let mut around = Vec::new();
        for &vertex in chain {
            around.append(&mut self.graph.neighbours[vertex as usize]);
            self.graph.merged[vertex as usize] = kept;
        }
        around.retain(|vertex| !chain.contains(vertex));
        around.sort_unstable();
        around.dedup();
        for &vertex in &around {
            let list = &mut self.graph.neighbours[vertex as usize];
            list.retain(|other| !chain.contains(other));
            list.push(kept);
            list.sort_unstable();
        }
        self.graph.neighbours[kept as usize] = around;
    }

    /// Takes the jitter of single vertices out of the curves: each moves half the way to the middle
    /// of its neighbours, ends and branch vertices stay.
    fn smooth(&mut self) {
        for _ in 0..4 {
            let old = self.graph.points.clone();
            for vertex in 0..old.len() {
                if let [a, b] = self.graph.neighbours[vertex][..] {
                    let middle = scale(add(old[a as usize], old[b as usize]), 0.5);
                    self.graph.points[vertex] = scale(add(old[vertex], middle), 0.5);
                }
            }
        }
    }

    fn into_curves(mut self, originals: &[(u32, u32)]) -> Curves {
        lead_to_roots(&mut self.graph.merged);
        let mut numbers: HashMap<u32, u32> = HashMap::new();
        let mut nodes = Vec::new();
        let mut number = |vertex: u32| {
            *numbers.entry(vertex).or_insert_with(|| {
                nodes.push(self.graph.points[vertex as usize]);
                nodes.len() as u32 - 1
            })
        };
        let chains = self.chains();
        let polylines: Vec<Vec<u32>> = chains
            .iter()
            .map(|chain| chain.vertices.iter().map(|&vertex| number(vertex)).collect())
            .collect();
        let node_of_original = originals
            .iter()
            .map(|&(_, vertex)| number(self.graph.merged[vertex as usize]))
            .collect();
        Curves { nodes, polylines, node_of_original }
    }
}
