//! A closed triangulated surface whose edges can be collapsed and split.

use crate::bounds::Bounds;
use crate::mesh::Vector;
use crate::topology::{indices, lead_to_roots};
use crate::vector::{add, cross, distance, dot, length, scale, subtract, triangle_normal};

/// A closed, oriented, manifold triangulation that changes, and keeps account of which vertex was
/// merged into which.
#[derive(Debug, Clone)]
pub(super) struct Triangulation {
    pub points: Vec<Vector>,
    /// Triangles by vertices, counter-clockwise seen from outside; [`GONE`] where one was removed.
    pub triangles: Vec<[u32; 3]>,
    /// The triangles at each vertex.
    pub triangles_at: Vec<Vec<u32>>,
    /// The vertex that each one was merged into: itself while it is there.
    merged_into: Vec<u32>,
    alive: usize,
}

/// A triangle that was removed.
pub(super) const GONE: [u32; 3] = [u32::MAX; 3];

impl Triangulation {
    pub fn new(points: Vec<Vector>, triangles: Vec<[u32; 3]>) -> Self {
        let mut triangles_at = vec![Vec::new(); points.len()];
        for (number, triangle) in triangles.iter().enumerate() {
            for &vertex in triangle {
                triangles_at[vertex as usize].push(number as u32);
            }
        }
        let merged_into = (0..points.len() as u32).collect();
        Self { alive: points.len(), points, triangles, triangles_at, merged_into }
    }

    /// The rest of it, numbered from 0 on, and for each vertex there ever was the one it has become
    /// there. The numbers are scattered: neighbours have no close ones, so that passes over all
    /// vertices lean towards no side.
    pub fn scattered(self) -> (Self, Vec<u32>) {
        let merged = self.merged();
        let mut alive: Vec<u32> =
            (0..self.points.len() as u32).filter(|&vertex| self.is_alive(vertex)).collect();
        // The golden ratio of the range spreads them evenly.
        alive.sort_unstable_by_key(|vertex| vertex.wrapping_mul(0x9E37_79B1));
        let numbers = indices(self.points.len(), &alive);
        let points = alive.iter().map(|&vertex| self.points[vertex as usize]).collect();
        let triangles = self
            .live_triangles()
            .map(|triangle| triangle.map(|vertex| numbers[vertex as usize]))
            .collect();
        let into = merged.iter().map(|&root| numbers[root as usize]).collect();
        (Self::new(points, triangles), into)
    }

    /// How many vertices there are still.
    pub fn vertex_count(&self) -> usize {
        self.alive
    }

    pub fn is_alive(&self, vertex: u32) -> bool {
        self.merged_into[vertex as usize] == vertex
    }

    /// For each vertex there ever was the one it has become.
    pub fn merged(&self) -> Vec<u32> {
        let mut found = self.merged_into.clone();
        lead_to_roots(&mut found);
        found
    }

    pub fn length(&self, a: u32, b: u32) -> f64 {
        distance(self.points[a as usize], self.points[b as usize])
    }

    pub fn middle(&self, a: u32, b: u32) -> Vector {
        scale(add(self.points[a as usize], self.points[b as usize]), 0.5)
    }

    /// The triangles that are there.
    pub fn live_triangles(&self) -> impl Iterator<Item = [u32; 3]> {
        self.triangles.iter().copied().filter(|triangle| *triangle != GONE)
    }

    /// Twice the area of a triangle along its normal.
    pub fn normal(&self, triangle: [u32; 3]) -> Vector {
        triangle_normal(triangle.map(|vertex| self.points[vertex as usize]))
    }

    pub fn area(&self) -> f64 {
        self.live_triangles().map(|triangle| 0.5 * length(self.normal(triangle))).sum()
    }

    /// The middle of the surface, by area.
    pub fn centroid(&self) -> Vector {
        let (mut sum, mut whole) = ([0.0; 3], 0.0);
        for triangle in self.live_triangles() {
            let area = length(self.normal(triangle));
            let corners = triangle.map(|vertex| self.points[vertex as usize]);
            (0..3).for_each(|axis| {
                sum[axis] += area / 3.0 * corners.iter().map(|corner| corner[axis]).sum::<f64>()
            });
            whole += area;
        }
        sum.map(|value| value / whole)
    }

    /// Six times the volume enclosed, about the first point.
    pub fn signed_volume(&self) -> f64 {
        let Some(&origin) = self.points.first() else { return 0.0 };
        self.live_triangles()
            .map(|triangle| {
                let [a, b, c] =
                    triangle.map(|vertex| subtract(self.points[vertex as usize], origin));
                dot(a, cross(b, c))
            })
            .sum()
    }

    /// The length of the diagonal of the bounding box.
    pub fn diagonal(&self) -> f64 {
        length(Bounds::around(self.points.iter().copied()).extent())
    }

    /// Writes the neighbours of a vertex, rising.
    pub fn neighbours(&self, vertex: u32, out: &mut Vec<u32>) {
        out.clear();
        for &triangle in &self.triangles_at[vertex as usize] {
            out.extend(self.triangles[triangle as usize].iter().filter(|&&other| other != vertex));
        }
        out.sort_unstable();
        out.dedup();
    }

    /// Whether merging the ends of an edge leaves the surface a manifold of the same topology:
    /// their common neighbours are the two opposite corners, and the surface is more than a
    /// tetrahedron (Dey, Edelsbrunner, Guha and Nekhayev 1999).
    pub fn can_collapse(&self, a: u32, b: u32, work: &mut [Vec<u32>; 2]) -> bool {
        let [around_a, around_b] = work;
        self.neighbours(a, around_a);
        self.neighbours(b, around_b);
        if around_a.binary_search(&b).is_err() || (around_a.len() == 3 && around_b.len() == 3) {
            return false;
        }
        let (mut i, mut j, mut common) = (0, 0, 0);
        while let (Some(x), Some(y)) = (around_a.get(i), around_b.get(j)) {
            common += usize::from(x == y);
            i += usize::from(x <= y);
            j += usize::from(y <= x);
        }
        common == 2
    }

    /// Merges `gone` into `kept`, which comes to lie at `point`.
    pub fn collapse(&mut self, kept: u32, gone: u32, point: Vector) {
        self.points[kept as usize] = point;
        for number in std::mem::take(&mut self.triangles_at[gone as usize]) {
            let triangle = self.triangles[number as usize];
            if triangle.contains(&kept) {
                for vertex in triangle {
                    if vertex != gone {
                        self.triangles_at[vertex as usize].retain(|&other| other != number);
                    }
                }
                self.triangles[number as usize] = GONE;
            } else {
                self.triangles[number as usize] =
                    triangle.map(|vertex| if vertex == gone { kept } else { vertex });
                self.triangles_at[kept as usize].push(number);
            }
        }
        self.merged_into[gone as usize] = kept;
        self.alive -= 1;
    }

    /// The two triangles at an edge with their opposite corners.
    pub fn sides(&self, a: u32, b: u32) -> Option<[(u32, u32); 2]> {
        let mut found = self.triangles_at[a as usize].iter().filter_map(|&number| {
            let triangle = self.triangles[number as usize];
            let opposite = triangle.iter().copied().find(|&vertex| vertex != a && vertex != b)?;
            triangle.contains(&b).then_some((number, opposite))
        });
        Some([found.next()?, found.next()?])
    }

    /// Puts a new vertex on an edge; `None` where there is no such edge.
    pub fn split(&mut self, a: u32, b: u32, point: Vector) -> Option<u32> {
        let sides = self.sides(a, b)?;
        let new = u32::try_from(self.points.len()).ok()?;
        self.points.push(point);
        self.merged_into.push(new);
        self.triangles_at.push(Vec::with_capacity(4));
        self.alive += 1;
        for (number, opposite) in sides {
            let triangle = self.triangles[number as usize];
            let added = self.triangles.len() as u32;
            // The old triangle keeps the end a, the new one gets b.
            self.triangles[number as usize] =
                triangle.map(|vertex| if vertex == b { new } else { vertex });
            self.triangles.push(triangle.map(|vertex| if vertex == a { new } else { vertex }));
            self.triangles_at[b as usize].retain(|&other| other != number);
            self.triangles_at[b as usize].push(added);
            self.triangles_at[opposite as usize].push(added);
            self.triangles_at[new as usize].extend([number, added]);
        }
        Some(new)
    }

    /// Area-weighted normals of the vertices, of length 1, or 0 where there is none.
    pub fn vertex_normals(&self) -> Vec<Vector> {
        let mut normals = vec![[0.0; 3]; self.points.len()];
        for triangle in self.live_triangles() {
            let normal = self.normal(triangle);
            for vertex in triangle {
                normals[vertex as usize] = add(normals[vertex as usize], normal);
            }
        }
        for normal in &mut normals {
            let size = length(*normal);
            *normal = if size > 0.0 { scale(*normal, 1.0 / size) } else { [0.0; 3] };
        }
        normals
    }
}
