//! From a graph of merged vertices to polylines without spurs.

use std::collections::HashMap;

use super::SkeletonSettings;
use super::medial::NearestPoints;
use super::thinning::Graph;
use super::triangulation::length;
use crate::mesh::Vector;
use crate::vector::{add, scale, subtract};

/// How fast the distance to the surface falls along an end that runs straight at it, as a part of the way.
const STRAIGHT: f64 = 0.5;

/// The skeleton of one piece.
pub(super) struct Curves {
    pub nodes: Vec<Vector>,
    pub polylines: Vec<Vec<u32>>,
    /// For each original vertex the node that carries it.
    pub node_of_original: Vec<u32>,
}

impl Curves {
    /// `originals` are surface vertices, each with the vertex of the graph it has become part of; `surface` has the points that
    /// the graph lies amid.
    pub fn new(graph: Graph, originals: &[(u32, u32)], surface: &NearestPoints, settings: &SkeletonSettings) -> Self {
        let radii = graph.points.iter().map(|&point| surface.distance(point)).collect();
        let mut pruning = Pruning { graph, radii };
        pruning.prune(settings.shortest_branch);
        pruning.trim();
        pruning.prune(settings.shortest_branch);
        pruning.smooth();
        pruning.into_curves(originals)
    }
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
        for start in (0..count).filter(|&vertex| self.is_alive(vertex) && !matches!(self.degree(vertex), 0 | 2)) {
            for &second in &self.graph.neighbours[start as usize] {
                let vertices = self.walk(start, second);
                // Each chain is met from both ends; the one walk that began at the lower end counts.
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
        let place = |vertex: u32| self.graph.points[vertex as usize];
        let length = vertices.windows(2).map(|pair| length(subtract(place(pair[1]), place(pair[0])))).sum();
        Chain { vertices, length }
    }

    /// Cuts off short branches, and draws branch vertices together that a short chain joins, shortest first.
    fn prune(&mut self, shortest: f64) {
        loop {
            let mut chains = self.chains();
            let alone = chains.len() == 1;
            chains.sort_by(|a, b| a.length.total_cmp(&b.length));
            let found = chains.into_iter().find_map(|chain| {
                let [first, last] = [chain.vertices[0], chain.vertices[chain.vertices.len() - 1]];
                let [radius_first, radius_last] = [first, last].map(|end| self.radii[end as usize]);
                match (self.degree(first) == 1, self.degree(last) == 1) {
                    (true, true) => {
                        let widest =
                            chain.vertices.iter().map(|&vertex| self.radii[vertex as usize]).fold(0.0, f64::max);
                        (alone && chain.length < shortest * widest)
                            .then(|| (chain.vertices[chain.vertices.len() / 2], chain))
                    }
                    (true, false) => (chain.length < shortest * radius_last).then_some((last, chain)),
                    (false, true) => (chain.length < shortest * radius_first).then_some((first, chain)),
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

    /// Cuts off what of an end runs straight at the surface, as the contracted middle of a flat cap does: there the distance to
    /// the surface falls nearly as fast as the curve runs, where along the middle of a tube it does not.
    fn trim(&mut self) {
        for chain in self.chains() {
            for mut vertices in [chain.vertices.clone(), chain.vertices.into_iter().rev().collect()] {
                if self.degree(vertices[0]) != 1 {
                    continue;
                }
                // Half a curve with two free ends for each of them.
                if self.degree(vertices[vertices.len() - 1]) == 1 {
                    vertices.truncate(vertices.len().div_ceil(2));
                }
                let first = self.radii[vertices[0] as usize];
                let mut run = 0.0;
                let mut excess = vec![0.0];
                for pair in vertices.windows(2) {
                    let [from, to] = [pair[0] as usize, pair[1] as usize];
                    run += length(subtract(self.graph.points[to], self.graph.points[from]));
                    excess.push(self.radii[to] - first - STRAIGHT * run);
                }
                let most = excess.iter().copied().fold(0.0, f64::max);
                // Not to the last node before the turn: where exactly it lies is blurred by the spacing of the vertices.
                let cut = excess.iter().position(|&excess| excess >= 0.7 * most).unwrap_or(0);
                if cut > 0 {
                    self.merge(vertices[cut], &vertices[..=cut]);
                }
            }
        }
    }

    /// Whether two vertices have no neighbour in common other than on the chain between them: no loop is lost.
    fn may_join(&self, a: u32, b: u32, chain: &[u32]) -> bool {
        let around = &self.graph.neighbours[b as usize];
        let direct = around.contains(&a) && chain.len() > 2;
        !direct
            && !self.graph.neighbours[a as usize]
                .iter()
                .any(|vertex| around.contains(vertex) && !chain.contains(vertex))
    }

    /// Merges the vertices of a chain into one of them, in the middle of its ends where both are branch vertices.
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

    /// Takes the jitter of single vertices out of the curves: each moves half the way to the middle of its neighbours, ends and
    /// branch vertices stay.
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
        for vertex in 0..self.graph.merged.len() {
            let mut root = vertex as u32;
            while self.graph.merged[root as usize] != root {
                root = self.graph.merged[root as usize];
            }
            self.graph.merged[vertex] = root;
        }
        let mut numbers: HashMap<u32, u32> = HashMap::new();
        let mut nodes = Vec::new();
        let mut number = |vertex: u32| {
            *numbers.entry(vertex).or_insert_with(|| {
                nodes.push(self.graph.points[vertex as usize]);
                nodes.len() as u32 - 1
            })
        };
        let chains = self.chains();
        let polylines: Vec<Vec<u32>> =
            chains.iter().map(|chain| chain.vertices.iter().map(|&vertex| number(vertex)).collect()).collect();
        let node_of_original =
            originals.iter().map(|&(_, vertex)| number(self.graph.merged[vertex as usize])).collect();
        Curves { nodes, polylines, node_of_original }
    }
}
