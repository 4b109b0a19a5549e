//! From a contracted surface to a graph of curves.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::triangulation::{GONE, Triangulation};
use crate::mesh::Vector;
use crate::number::Ordered;
use crate::topology::lead_to_roots;
use crate::vector::{add, distance, scale};

/// A graph whose vertices were merged from those of a surface.
pub(super) struct Graph {
    /// Where the vertices lie; those that are gone too.
    pub points: Vec<Vector>,
    /// For each vertex the one it has become.
    pub merged: Vec<u32>,
    /// The neighbours of each vertex, rising.
    pub neighbours: Vec<Vec<u32>>,
}

/// Merges the ends of edges that bound a triangle, shortest first, until no triangle is left (Au,
/// Tai, Chu, Cohen-Or and Lee 2008). Edges without triangles stay, so that what has become a curve
/// keeps its loops. A merged vertex lies at the mean of what it was merged from.
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
    while let Some(Reverse((Ordered(length), ends))) = thinning.waiting.pop() {
        if thinning.is_current(length, ends) && thinning.bounds_triangle(ends) {
            thinning.collapse(ends);
        }
    }
    let Thinning { points, mut merged, neighbours, .. } = thinning;
    lead_to_roots(&mut merged);
    Graph { points, merged, neighbours }
}

struct Thinning {
    points: Vec<Vector>,
    weights: Vec<f64>,
    merged: Vec<u32>,
    triangles: Vec<[u32; 3]>,
    triangles_at: Vec<Vec<u32>>,
    neighbours: Vec<Vec<u32>>,
    /// Edges by their lengths, the shortest first.
    waiting: BinaryHeap<Reverse<(Ordered, [u32; 2])>>,
}

impl Thinning {
    fn length(&self, [a, b]: [u32; 2]) -> f64 {
        distance(self.points[a as usize], self.points[b as usize])
    }

    fn push(&mut self, a: u32, b: u32) {
        let ends = [a.min(b), a.max(b)];
        self.waiting.push(Reverse((Ordered(self.length(ends)), ends)));
    }

    /// Whether an edge is still there and as long as it was.
    fn is_current(&self, length: f64, [a, b]: [u32; 2]) -> bool {
        self.merged[a as usize] == a
            && self.merged[b as usize] == b
            && self.neighbours[a as usize].binary_search(&b).is_ok()
            && self.length([a, b]) == length
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
            if let Ok(index) = list.binary_search(&gone) {
                list.remove(index);
            }
            if neighbour != kept {
                for (from, to) in [(neighbour, kept), (kept, neighbour)] {
                    if let Err(index) = self.neighbours[from as usize].binary_search(&to) {
                        self.neighbours[from as usize].insert(index, to);
                    }
                }
            }
        }
        for neighbour in self.neighbours[kept as usize].clone() {
            self.push(kept, neighbour);
        }
    }
}
