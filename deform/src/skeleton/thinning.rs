//! From a contracted surface to a graph of curves.

use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

use super::triangulation::{GONE, Triangulation, length};
use crate::mesh::Vector;
use crate::vector::{add, scale, subtract};

/// A graph whose vertices were merged from those of a surface.
pub(super) struct Graph {
    /// Where the vertices lie; those that are gone too.
    pub points: Vec<Vector>,
    /// For each vertex the one it has become.
    pub merged: Vec<u32>,
    /// The neighbours of each vertex, rising.
    pub neighbours: Vec<Vec<u32>>,
}

/// Merges the ends of edges that bound a triangle, shortest first, until no triangle is left (Au, Tai, Chu, Cohen-Or and Lee
/// 2008). Edges without triangles stay, so that what has become a curve keeps its loops. A merged vertex lies at the mean of
/// what it was merged from.
pub(super) fn thin(mesh: &Triangulation) -> Graph {
    let count = mesh.points.len();
    let mut thinning = Thinning {
        points: mesh.points.clone(),
        weights: vec![1.0; count],
        merged: mesh.merged(),
        triangles: mesh.triangles.clone(),
        triangles_at: mesh.triangles_at.clone(),
        neighbours: vec![Vec::new(); count],
        waiting: BinaryHeap::new(),
    };
    let mut around = Vec::new();
    for vertex in 0..count as u32 {
        if mesh.is_alive(vertex) {
            mesh.neighbours(vertex, &mut around);
            thinning.neighbours[vertex as usize].clone_from(&around);
            for &other in around.iter().filter(|&&other| other > vertex) {
                thinning.push(vertex, other);
            }
        }
    }
    while let Some(Reverse(edge)) = thinning.waiting.pop() {
        if thinning.is_current(&edge) && thinning.bounds_triangle(edge.ends) {
            thinning.collapse(edge.ends);
        }
    }
    let Thinning { points, mut merged, neighbours, .. } = thinning;
    for vertex in 0..count {
        let mut root = vertex as u32;
        while merged[root as usize] != root {
            root = merged[root as usize];
        }
        merged[vertex] = root;
    }
    Graph { points, merged, neighbours }
}

struct Thinning {
    points: Vec<Vector>,
    weights: Vec<f64>,
    merged: Vec<u32>,
    triangles: Vec<[u32; 3]>,
    triangles_at: Vec<Vec<u32>>,
    neighbours: Vec<Vec<u32>>,
    waiting: BinaryHeap<Reverse<Waiting>>,
}

#[derive(Debug, Clone, Copy)]
struct Waiting {
    length: f64,
    ends: [u32; 2],
}

impl Ord for Waiting {
    fn cmp(&self, other: &Self) -> Ordering {
        self.length.total_cmp(&other.length).then(self.ends.cmp(&other.ends))
    }
}

impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Waiting {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Waiting {}

impl Thinning {
    fn length(&self, [a, b]: [u32; 2]) -> f64 {
        length(subtract(self.points[a as usize], self.points[b as usize]))
    }

    fn push(&mut self, a: u32, b: u32) {
        let ends = [a.min(b), a.max(b)];
        self.waiting.push(Reverse(Waiting { length: self.length(ends), ends }));
    }

    /// Whether an edge is still there and as long as it was.
    fn is_current(&self, edge: &Waiting) -> bool {
        let [a, b] = edge.ends;
        self.merged[a as usize] == a
            && self.merged[b as usize] == b
            && self.neighbours[a as usize].binary_search(&b).is_ok()
            && self.length(edge.ends) == edge.length
    }

    fn bounds_triangle(&self, [a, b]: [u32; 2]) -> bool {
        self.triangles_at[a as usize]
            .iter()
            .any(|&number| self.triangles[number as usize].contains(&b))
    }

    fn collapse(&mut self, [kept, gone]: [u32; 2]) {
        let [own, other] = [kept, gone].map(|vertex| self.weights[vertex as usize]);
        let sum =
            add(scale(self.points[kept as usize], own), scale(self.points[gone as usize], other));
        self.points[kept as usize] = scale(sum, 1.0 / (own + other));
        self.weights[kept as usize] = own + other;
        self.merged[gone as usize] = kept;

        for number in std::mem::take(&mut self.triangles_at[gone as usize]) {
            let triangle = self.triangles[number as usize];
            let changed = triangle.map(|vertex| if vertex == gone { kept } else { vertex });
            let is_double = || {
                self.triangles_at[kept as usize].iter().any(|&same| {
                    let same = self.triangles[same as usize];
                    changed.iter().all(|vertex| same.contains(vertex))
                })
            };
            if triangle.contains(&kept) || is_double() {
                for vertex in triangle {
                    self.triangles_at[vertex as usize].retain(|&at| at != number);
                }
                self.triangles[number as usize] = GONE;
            } else {
                self.triangles[number as usize] = changed;
                self.triangles_at[kept as usize].push(number);
            }
        }

        for neighbour in std::mem::take(&mut self.neighbours[gone as usize]) {
            let list = &mut self.neighbours[neighbour as usize];
            if let Ok(place) = list.binary_search(&gone) {
                list.remove(place);
            }
            if neighbour != kept {
                for (from, to) in [(neighbour, kept), (kept, neighbour)] {
                    if let Err(place) = self.neighbours[from as usize].binary_search(&to) {
                        self.neighbours[from as usize].insert(place, to);
                    }
                }
            }
        }
        for neighbour in self.neighbours[kept as usize].clone() {
            self.push(kept, neighbour);
        }
    }
}
