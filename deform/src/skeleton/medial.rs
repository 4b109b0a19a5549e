//! Points of the medial axis: the centres of the largest balls inside a surface that touch it in
//! its vertices.

use super::triangulation::Triangulation;
use crate::bounds::Bounds;
use crate::mesh::Vector;
use crate::vector::{distance, dot, length, scale, subtract};

/// Two touching points seen from the centre under less than this angle are taken for noise (its
/// cosine: 25 degrees).
const LEAST_SEPARATION: f64 = 0.906;

/// A ball counts from this many times the mean distance to the neighbours on.
const LEAST_RADIUS: f64 = 1.2;

/// Shrinking stops after this many balls, each smaller than the one before.
const MOST_BALLS: usize = 40;

/// The pole of each vertex that is there: the centre of the ball that touches the surface there
/// from inside and holds no other vertex (Ma, Bae and Choi 2012: a ball is shrunk to the vertex
/// nearest to its centre until there is none inside).
///
/// There is none where the vertex has no normal, nor where the ball is not much larger than the
/// space between vertices: at sharp edges it says nothing of the middle. Of noisy vertices the last
/// ball is taken whose touching points are well apart.
pub(super) fn poles(mesh: &Triangulation, tree: &NearestPoints) -> Vec<Option<Vector>> {
    let normals = mesh.vertex_normals();
    let largest = 0.5 * mesh.diagonal();
    let mut around = Vec::new();
    let mut poles = Vec::with_capacity(mesh.points.len());
    for vertex in 0..mesh.points.len() as u32 {
        let [point, normal] = [mesh.points[vertex as usize], normals[vertex as usize]];
        if !mesh.is_alive(vertex) || normal == [0.0; 3] {
            poles.push(None);
            continue;
        }
        mesh.neighbours(vertex, &mut around);
        let spacing = around.iter().map(|&other| mesh.length(vertex, other)).sum::<f64>()
            / around.len() as f64;
        let pole = shrink(tree, vertex, point, normal, largest);
        poles.push((length(subtract(pole, point)) > LEAST_RADIUS * spacing).then_some(pole));
    }
    poles
}

fn shrink(
    tree: &NearestPoints,
    vertex: u32,
    point: Vector,
    normal: Vector,
    largest: f64,
) -> Vector {
    let mut radius = largest;
    let center = |radius: f64| subtract(point, scale(normal, radius));
    for ball in 0..MOST_BALLS {
        let middle = center(radius);
        let Some((nearest, _)) = tree.nearest(middle, vertex) else { break };
        let away = subtract(nearest, middle);
        if length(away) >= radius * (1.0 - 1e-9) {
            break;
        }
        let chord = subtract(point, nearest);
        let depth = dot(chord, normal);
        let next = 0.5 * dot(chord, chord) / depth;
        if !(next.is_finite() && next > 0.0 && next < radius) {
            break;
        }
        let [to_point, to_nearest] =
            [subtract(point, center(next)), subtract(nearest, center(next))];
        let cosine = dot(to_point, to_nearest) / (length(to_point) * length(to_nearest));
        if ball > 0 && cosine > LEAST_SEPARATION {
            break;
        }
        radius = next;
    }
    center(radius)
}

/// A k-d tree (Bentley 1975): the middle of each range parts it along the axis of its largest
/// extent.
pub(super) struct NearestPoints {
    points: Vec<(Vector, u32)>,
    axes: Vec<u8>,
}

/// Ranges no longer than this are searched one by one.
const LEAF: usize = 8;

impl NearestPoints {
    /// The tree of the vertices that are there.
    pub fn of(mesh: &Triangulation) -> Self {
        let alive = (0..mesh.points.len() as u32).filter(|&vertex| mesh.is_alive(vertex));
        Self::new(alive.map(|vertex| (mesh.points[vertex as usize], vertex)).collect())
    }

    /// The distance from a point to the nearest point; infinite where there is none.
    pub fn distance(&self, target: Vector) -> f64 {
        self.nearest(target, u32::MAX).map_or(f64::INFINITY, |(point, _)| distance(point, target))
    }

    /// The mean distance from an axis of the points beside it that are not farther than a bound;
    /// `None` where there is none.
    pub fn mean_across(&self, [from, to]: [Vector; 2], farthest: f64) -> Option<f64> {
        let along = subtract(to, from);
        let squared = dot(along, along);
        let (mut sum, mut count) = (0.0, 0u32);
        for (point, _) in &self.points {
            let away = subtract(*point, from);
            let part = dot(away, along) / squared;
            if (0.0..=1.0).contains(&part) {
                let across = length(subtract(away, scale(along, part)));
                if across <= farthest {
                    sum += across;
                    count += 1;
                }
            }
        }
        (count > 0).then(|| sum / f64::from(count))
    }

    fn new(mut points: Vec<(Vector, u32)>) -> Self {
        let mut axes = vec![0; points.len()];
        let mut ranges = vec![(0, points.len())];
        while let Some((start, end)) = ranges.pop() {
            if end - start <= LEAF {
                continue;
            }
            let axis =
                Bounds::around(points[start..end].iter().map(|(point, _)| *point)).longest_axis();
            let middle = usize::midpoint(start, end);
            points[start..end].select_nth_unstable_by(middle - start, |a, b| {
                a.0[axis].total_cmp(&b.0[axis]).then(a.1.cmp(&b.1))
            });
            axes[middle] = axis as u8;
            ranges.extend([(start, middle), (middle + 1, end)]);
        }
        Self { points, axes }
    }

    /// The point nearest to another, not counting than that of number `except`.
    fn nearest(&self, target: Vector, except: u32) -> Option<(Vector, u32)> {
        let mut best = (f64::INFINITY, None);
        // Ranges with the squared distance to the plane that parts them off.
        let mut ranges = [(0usize, 0usize, 0.0f64); 64];
        ranges[0] = (0, self.points.len(), 0.0);
        let mut waiting = 1;
        let look = |candidate: &(Vector, u32), best: &mut (f64, Option<(Vector, u32)>)| {
            let away = subtract(candidate.0, target);
            let distance = dot(away, away);
            if distance < best.0 && candidate.1 != except {
                *best = (distance, Some(*candidate));
            }
        };
        while waiting > 0 {
            waiting -= 1;
            let (start, end, least) = ranges[waiting];
            if least >= best.0 {
                continue;
            }
            if end - start <= LEAF {
                self.points[start..end].iter().for_each(|candidate| look(candidate, &mut best));
                continue;
            }
            let middle = usize::midpoint(start, end);
            let axis = usize::from(self.axes[middle]);
            look(&self.points[middle], &mut best);
            let offset = target[axis] - self.points[middle].0[axis];
            let (near, far) = match offset < 0.0 {
                true => ((start, middle), (middle + 1, end)),
                false => ((middle + 1, end), (start, middle)),
            };
            // The nearer range is searched first: it is put on last. Halving 2^32 points takes
            // fewer slots than there are.
            ranges[waiting] = (far.0, far.1, offset * offset);
            ranges[waiting + 1] = (near.0, near.1, least);
            waiting += 2;
        }
        best.1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes;

    #[test]
    fn the_nearest_point_is_that_of_a_search_one_by_one() {
        let mut state = 1u64;
        let mut random = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f64 / (1u64 << 24) as f64
        };
        let points: Vec<(Vector, u32)> = (0..3000)
            .map(|number| ([random(), random(), (4.0 * random()).floor()], number))
            .collect();
        let tree = NearestPoints::new(points.clone());
        for except in 0..300 {
            let target = [random(), random(), 3.0 * random()];
            let distance = |point: Vector| distance(point, target);
            let others = points.iter().filter(|point| point.1 != except);
            let least = others.map(|point| distance(point.0)).fold(f64::INFINITY, f64::min);
            assert_eq!(distance(tree.nearest(target, except).unwrap().0), least);
        }
        assert!(NearestPoints::new(vec![([0.0; 3], 7)]).nearest([1.0; 3], 7).is_none());
    }

    #[test]
    fn the_poles_of_a_torus_lie_on_its_core() {
        let mesh = shapes::torus(1.0, 0.3, [90, 40]);
        let triangles =
            mesh.cells().connectivity().chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
        let mesh = Triangulation::new(mesh.points().to_vec(), triangles);
        for pole in poles(&mesh, &NearestPoints::of(&mesh)) {
            let [x, y, z] = pole.unwrap();
            assert!((x.hypot(y) - 1.0).hypot(z) < 0.02, "{x} {y} {z}");
        }
    }
}
