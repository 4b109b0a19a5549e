//! Surfaces of fewer triangles, for viewers that are far away.
//!
//! Vertices are taken out one by one, each onto a neighbour, the one that costs least first: the sum
//! of the squared distances of the neighbour from the planes of all faces that have gone into the
//! vertex (M. Garland and P. Heckbert, "Surface simplification using quadric error metrics", 1997).
//! What is left are vertices of the extract, so that their fields are exact.

use std::cmp::Reverse;
use std::collections::{BTreeSet, BinaryHeap, HashMap};
use std::sync::Arc;

use tombolo_deform::bounds::{Bounds, BoxTree};
use tombolo_deform::mesh::{CellType, Cells, MeshError, Vector};
use tombolo_deform::number::real;
use tombolo_deform::vector::{cross, dot, length, scale, subtract};

use super::{Extract, ExtractFeatures};
use crate::language::Decimate;

/// By how much more a bend of a border counts than one of the surface.
const BORDER: f64 = 4.0;
/// The cosine of the angle that a face may turn by when a vertex goes.
const TURN: f64 = 0.2;

/// A surface with fewer triangles, and how it was made.
#[derive(Debug)]
pub(crate) struct Decimation {
    /// The surface that it was made of.
    points: Vec<Vector>,
    cells: Arc<Cells>,
    /// The points that are left, rising, and the triangles between them by their numbers there.
    kept: Vec<u32>,
    triangles: Arc<Cells>,
    /// The cell that each triangle is a part of.
    owners: Vec<u32>,
    /// The largest distance of a point of the extract from what is left.
    pub(crate) error: f64,
}

impl Decimation {
    /// Takes vertices out of a surface until the stage's part of the triangles is left, or every
    /// other would cost more than it allows. Borders and those between features keep their ends.
    ///
    /// # Errors
    /// None for an extract whose cells are sound.
    pub(crate) fn new(extract: &Extract, stage: &Decimate) -> Result<Self, MeshError> {
        let mut surface = Surface::new(extract);
        let count = surface.triangles.len();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a part of a count"
        )]
        let wanted = (real(count) * stage.fraction).ceil() as usize;
        surface.reduce(wanted, stage.error.map_or(f64::INFINITY, |error| error * error));
        let alive = || surface.triangles.iter().zip(&surface.owners).filter(|(it, _)| is_alive(it));
        let mut triangles = Cells::new();
        let mut owners = Vec::new();
        for (corners, owner) in alive() {
            triangles.push(CellType::Triangle, corners)?;
            owners.push(*owner);
        }
        let (triangles, kept) = triangles.compact(extract.points.len());
        let left: Vec<[Vector; 3]> = alive()
            .map(|(corners, _)| corners.map(|corner| extract.points[corner as usize]))
            .collect();
        let error = largest_distance(&surface.gone, &extract.points, &left);
        Ok(Self {
            points: extract.points.clone(),
            cells: Arc::clone(&extract.cells),
            kept,
            triangles: Arc::new(triangles),
            owners,
            error,
        })
    }

    /// Whether it was made of this surface.
    pub(crate) fn is_of(&self, extract: &Extract) -> bool {
        self.points == extract.points
            && (Arc::ptr_eq(&self.cells, &extract.cells) || self.cells == extract.cells)
    }

    /// The surface with fewer triangles, with the present fields.
    pub(crate) fn apply(&self, extract: &Extract) -> Extract {
        extract.part(&self.kept, Arc::clone(&self.triangles), &self.owners)
    }
}

/// Sums of squared distances from planes, as the ten numbers of a symmetric matrix.
#[derive(Debug, Clone, Copy, Default)]
struct Quadric([f64; 10]);

impl Quadric {
    /// The squared distance from a plane through a point, times a weight.
    fn plane(normal: Vector, point: Vector, weight: f64) -> Self {
        let [a, b, c] = normal;
        let d = -dot(normal, point);
        Self(
            [a * a, a * b, a * c, a * d, b * b, b * c, b * d, c * c, c * d, d * d]
                .map(|x| weight * x),
        )
    }

    fn add(&mut self, other: &Self) {
        self.0.iter_mut().zip(other.0).for_each(|(mine, more)| *mine += more);
    }

    fn at(&self, [x, y, z]: Vector) -> f64 {
        let [aa, ab, ac, ad, bb, bc, bd, cc, cd, dd] = self.0;
        let linear = 2.0 * (ad * x + bd * y + cd * z) + dd;
        let mixed = 2.0 * (ab * x * y + ac * x * z + bc * y * z);
        (aa * x * x + bb * y * y + cc * z * z + mixed + linear).max(0.0)
    }
}

const GONE: [u32; 3] = [u32::MAX; 3];

fn is_alive(corners: &[u32; 3]) -> bool {
    *corners != GONE
}

/// A surface of triangles from which vertices are taken.
struct Surface {
    /// From the middle of the box around them.
    points: Vec<Vector>,
    triangles: Vec<[u32; 3]>,
    owners: Vec<u32>,
    /// The triangles around each point.
    around: Vec<Vec<u32>>,
    quadrics: Vec<Quadric>,
    /// For each point the other ends of its edges on a border.
    borders: Vec<BTreeSet<u32>>,
    /// How often each point has changed.
    versions: Vec<u32>,
    /// The points that were taken out.
    gone: Vec<u32>,
}

impl Surface {
    fn new(extract: &Extract) -> Self {
        let center = Bounds::around(extract.points.iter().copied()).center();
        let points: Vec<Vector> =
            extract.points.iter().map(|&point| subtract(point, center)).collect();
        let mut surface = Self {
            triangles: Vec::new(),
            owners: Vec::new(),
            around: vec![Vec::new(); points.len()],
            quadrics: vec![Quadric::default(); points.len()],
            borders: vec![BTreeSet::new(); points.len()],
            versions: vec![0; points.len()],
            gone: Vec::new(),
            points,
        };
        for (owner, cell) in (0..).zip(0..extract.cells.len()) {
            extract.cells.for_each_polygon(cell, |polygon| {
                for pair in polygon[1..].windows(2) {
                    surface.triangles.push([polygon[0], pair[0], pair[1]]);
                    surface.owners.push(owner);
                }
            });
        }
        surface.prepare(extract.features.as_deref());
        surface
    }

    fn prepare(&mut self, features: Option<&ExtractFeatures>) {
        let mut edges: HashMap<[u32; 2], (usize, u32, bool)> = HashMap::new();
        for (number, corners) in (0..).zip(&self.triangles) {
            let feature =
                features.map_or(0, |it| it.of_cells[self.owners[number as usize] as usize]);
            for at in 0..3 {
                let mut ends = [corners[at], corners[(at + 1) % 3]];
                self.around[ends[0] as usize].push(number);
                ends.sort_unstable();
                let edge = edges.entry(ends).or_insert((0, feature, false));
                edge.0 += 1;
                edge.2 |= edge.1 != feature;
            }
        }
        for number in 0..self.triangles.len() {
            let corners = self.triangles[number];
            let Some(normal) = unit(self.normal(corners)) else { continue };
            let first = self.points[corners[0] as usize];
            let plane = Quadric::plane(normal, first, 1.0);
            corners.iter().for_each(|&corner| self.quadrics[corner as usize].add(&plane));
            for at in 0..3 {
                let ends = [corners[at], corners[(at + 1) % 3]];
                let mut sorted = ends;
                sorted.sort_unstable();
                let is_border =
                    edges.get(&sorted).is_some_and(|(count, _, differ)| *count != 2 || *differ);
                if is_border {
                    let [a, b] = ends.map(|end| self.points[end as usize]);
                    if let Some(aside) = unit(cross(subtract(b, a), normal)) {
                        let plane = Quadric::plane(aside, a, BORDER);
                        ends.iter().for_each(|&end| self.quadrics[end as usize].add(&plane));
                    }
                    self.borders[ends[0] as usize].insert(ends[1]);
                    self.borders[ends[1] as usize].insert(ends[0]);
                }
            }
        }
    }

    fn normal(&self, corners: [u32; 3]) -> Vector {
        let [a, b, c] = corners.map(|corner| self.points[corner as usize]);
        cross(subtract(b, a), subtract(c, a))
    }

    fn neighbours(&self, point: u32) -> BTreeSet<u32> {
        let triangles = self.around[point as usize].iter();
        let corners = triangles.flat_map(|&number| self.triangles[number as usize]);
        corners.filter(|&corner| corner != point).collect()
    }

    /// Whether a point may go along the edge to another, by where borders lie.
    fn may_go(&self, from: u32, to: u32) -> bool {
        let border = &self.borders[from as usize];
        border.is_empty() || border.len() == 2 && border.contains(&to)
    }

    /// Takes points out while there are more triangles than wanted and none costs more than `most`.
    fn reduce(&mut self, wanted: usize, most: f64) {
        let mut count = self.triangles.len();
        let mut heap = BinaryHeap::new();
        #[expect(clippy::cast_possible_truncation, reason = "points are numbered with 32 bits")]
        for point in 0..self.points.len() as u32 {
            self.offer(point, &mut heap);
        }
        while count > wanted {
            let Some(Reverse((bits, from, to, versions))) = heap.pop() else { return };
            if f64::from_bits(bits) > most {
                return;
            }
            let now = [from, to].map(|point| self.versions[point as usize]);
            if now != versions || !self.fits(from, to) {
                continue;
            }
            count -= self.collapse(from, to);
            let mut changed = self.neighbours(to);
            changed.insert(to);
            for point in changed {
                self.versions[point as usize] += 1;
            }
            for point in self.neighbours(to).into_iter().chain([to]) {
                self.offer(point, &mut heap);
                for other in self.neighbours(point) {
                    self.offer_edge(other, point, &mut heap);
                }
            }
        }
    }

    fn offer(&self, from: u32, heap: &mut BinaryHeap<Reverse<Offer>>) {
        for to in self.neighbours(from) {
            self.offer_edge(from, to, heap);
        }
    }

    fn offer_edge(&self, from: u32, to: u32, heap: &mut BinaryHeap<Reverse<Offer>>) {
        if self.may_go(from, to) {
            let mut quadric = self.quadrics[from as usize];
            quadric.add(&self.quadrics[to as usize]);
            // Numbers that are not below 0 are in the order of their bits.
            let cost = quadric.at(self.points[to as usize]).to_bits();
            let versions = [from, to].map(|point| self.versions[point as usize]);
            heap.push(Reverse((cost, from, to, versions)));
        }
    }

    /// Whether the surface stays one, and no face turns over.
    fn fits(&self, from: u32, to: u32) -> bool {
        let shared = self.around[from as usize]
            .iter()
            .filter(|&&number| self.triangles[number as usize].contains(&to))
            .count();
        let (near, beyond) = (self.neighbours(from), self.neighbours(to));
        if shared == 0 || near.intersection(&beyond).count() != shared {
            return false;
        }
        self.around[from as usize].iter().all(|&number| {
            let corners = self.triangles[number as usize];
            if corners.contains(&to) {
                return true;
            }
            let moved = corners.map(|corner| if corner == from { to } else { corner });
            let (before, after) = (self.normal(corners), self.normal(moved));
            dot(before, after) > TURN * length(before) * length(after)
        })
    }

    /// Takes a point out onto another; how many triangles go with it.
    fn collapse(&mut self, from: u32, to: u32) -> usize {
        let mut count = 0;
        for number in std::mem::take(&mut self.around[from as usize]) {
            let corners = self.triangles[number as usize];
            if corners.contains(&to) {
                count += 1;
                for corner in corners.into_iter().filter(|&corner| corner != from) {
                    self.around[corner as usize].retain(|&it| it != number);
                }
                self.triangles[number as usize] = GONE;
            } else {
                let moved = corners.map(|corner| if corner == from { to } else { corner });
                self.triangles[number as usize] = moved;
                self.around[to as usize].push(number);
            }
        }
        let gone = self.quadrics[from as usize];
        self.quadrics[to as usize].add(&gone);
        // The border goes on from the other neighbour to the one that stays.
        for other in std::mem::take(&mut self.borders[from as usize]) {
            self.borders[other as usize].remove(&from);
            if other != to {
                self.borders[other as usize].insert(to);
                self.borders[to as usize].insert(other);
            }
        }
        self.gone.push(from);
        count
    }
}

/// A cost by its bits, the point that goes, that to which it goes, and how often both had changed.
type Offer = (u64, u32, u32, [u32; 2]);

fn unit(vector: Vector) -> Option<Vector> {
    let length = length(vector);
    (length > 0.0).then(|| scale(vector, 1.0 / length))
}

/// The largest distance of some points from triangles.
fn largest_distance(gone: &[u32], points: &[Vector], triangles: &[[Vector; 3]]) -> f64 {
    let boxes: Vec<Bounds> =
        triangles.iter().map(|corners| Bounds::around(corners.iter().copied())).collect();
    let diagonal = boxes.iter().fold(Bounds::EMPTY, |all, it| all.join(it)).diagonal();
    if triangles.is_empty() || diagonal <= 0.0 {
        return 0.0;
    }
    let tree = BoxTree::new(&boxes);
    let mut largest = 0.0_f64;
    for &point in gone {
        let point = points[point as usize];
        // The circle is widened until what it meets lies within it.
        let mut reach = largest.max(1e-6 * diagonal);
        loop {
            let mut nearest = f64::INFINITY;
            tree.around(point, reach, |index| {
                nearest = nearest.min(distance(point, triangles[index as usize]));
            });
            if nearest <= reach || reach > 2.0 * diagonal {
                largest = largest.max(if nearest.is_finite() { nearest } else { 0.0 });
                break;
            }
            reach *= 2.0;
        }
    }
    largest
}

/// The distance of a point from a triangle (C. Ericson, *Real-Time Collision Detection*, 5.1.5).
fn distance(point: Vector, [a, b, c]: [Vector; 3]) -> f64 {
    let (ab, ac, ap) = (subtract(b, a), subtract(c, a), subtract(point, a));
    let normal = cross(ab, ac);
    let square = dot(normal, normal);
    if square > 0.0 {
        let v = dot(cross(ap, ac), normal) / square;
        let w = dot(cross(ab, ap), normal) / square;
        if v >= 0.0 && w >= 0.0 && v + w <= 1.0 {
            return dot(ap, normal).abs() / square.sqrt();
        }
    }
    let to_edge = |from: Vector, to: Vector| {
        let (along, aside) = (subtract(to, from), subtract(point, from));
        let square = dot(along, along);
        let part = if square > 0.0 { (dot(aside, along) / square).clamp(0.0, 1.0) } else { 0.0 };
        length(subtract(aside, scale(along, part)))
    };
    to_edge(a, b).min(to_edge(b, c)).min(to_edge(c, a))
}
