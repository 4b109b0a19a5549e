//! The parts of a surface between its sharp edges.

use super::extraction::polygon_normal;
use super::features::FeatureSettings;
use crate::mesh::{Cells, Vector};
use crate::vector::{cross, dot, subtract};

/// The number of each face's part, and how many there are. Parts are numbered by their lowest faces.
///
/// Faces are joined over every edge that is not sharp and has exactly two faces. For triangles the rule and its arithmetic are
/// those of CGAL's `sharp_edges_segmentation` (`Polygon_mesh_processing/detect_features.h`), step by step, so that surfaces
/// whose edges turn by exactly the angle come apart in the same places.
pub(super) fn parts_between_sharp_edges(
    points: &[Vector],
    faces: &Cells,
    settings: &FeatureSettings,
) -> (usize, Vec<u32>) {
    let rule = Sharpness::new(settings.sharp_angle_degrees);
    let points = brought_to_order_one(points);
    let mut parts = Parts::new(faces.len());
    for pair in
        edges((0..faces.len()).map(|face| faces.vertices(face))).chunk_by(|a, b| a.ends == b.ends)
    {
        if let [first, second] = pair {
            let [a, b] = normals_at_edge(&points, faces, *first, *second);
            if !rule.is_sharp(a, b) {
                parts.join(first.face, second.face);
            }
        }
    }
    let mut numbers: Vec<Option<u32>> = vec![None; faces.len()];
    let mut count = 0;
    let face_parts = (0..faces.len() as u32)
        .map(|face| {
            *numbers[parts.root(face) as usize].get_or_insert_with(|| {
                count += 1;
                count - 1
            })
        })
        .collect();
    (count as usize, face_parts)
}

/// The rule by which an edge between two faces is sharp.
enum Sharpness {
    Always,
    Never,
    /// Whether the angle's cosine is negative, and its square.
    From {
        obtuse: bool,
        square: f64,
    },
}

impl Sharpness {
    fn new(degrees: f64) -> Self {
        if degrees == 0.0 {
            return Self::Always;
        }
        if degrees == 180.0 {
            return Self::Never;
        }
        let cosine = (degrees * std::f64::consts::PI / 180.0).cos();
        Self::From { obtuse: cosine < 0.0, square: cosine * cosine }
    }

    /// Whether the normals, of any lengths, are at the angle or further apart. Below a right angle a face without area is sharp
    /// to all its neighbours, from there on to none.
    fn is_sharp(&self, a: Vector, b: Vector) -> bool {
        match *self {
            Self::Always => true,
            Self::Never => false,
            Self::From { obtuse, square } => {
                let product = dot(a, b);
                let limit = square * dot(a, a) * dot(b, b);
                if obtuse {
                    product < 0.0 && product * product >= limit
                } else {
                    product < 0.0 || product * product <= limit
                }
            }
        }
    }
}

/// The normals of the two faces at an edge, as long as twice their areas, on the same side of the surface even where the faces
/// run opposite ways round.
fn normals_at_edge(
    points: &[Vector],
    faces: &Cells,
    first: EdgeSide,
    second: EdgeSide,
) -> [Vector; 2] {
    let [source, target] = if first.forward { first.ends } else { [first.ends[1], first.ends[0]] };
    let [source, along] = {
        let [source, target] = [source, target].map(|vertex| points[vertex as usize]);
        [source, subtract(target, source)]
    };
    // The vertex of a triangle that is no end of the edge.
    let third = |side: EdgeSide| match faces.vertices(side.face as usize) {
        [a, b, c] => [a, b, c]
            .into_iter()
            .find(|vertex| !side.ends.contains(vertex))
            .map(|&vertex| points[vertex as usize]),
        _ => None,
    };
    let whole = |side: EdgeSide| polygon_normal(points, faces.vertices(side.face as usize));
    let a =
        third(first).map_or_else(|| whole(first), |third| cross(along, subtract(third, source)));
    let b = third(second).map_or_else(
        || whole(second).map(|part| if first.forward == second.forward { -part } else { part }),
        |third| cross(along, subtract(source, third)),
    );
    [a, b]
}

/// The points times a power of 2, so that products of eight coordinates neither overflow nor vanish and no other bit changes.
fn brought_to_order_one(points: &[Vector]) -> Vec<Vector> {
    let largest = points.iter().flatten().fold(0.0f64, |largest, value| largest.max(value.abs()));
    let exponent = largest.to_bits() >> 52;
    let factor = f64::from_bits(2046u64.saturating_sub(exponent).max(1) << 52);
    points.iter().map(|point| point.map(|value| value * factor)).collect()
}

/// One face's side at an edge; `ends` rise, `forward` where the face walks from the lower to the higher.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct EdgeSide {
    pub ends: [u32; 2],
    pub face: u32,
    pub forward: bool,
}

/// The sides of all edges, those of one edge together, in rising order.
pub(super) fn edges<'a>(faces: impl Iterator<Item = &'a [u32]> + Clone) -> Vec<EdgeSide> {
    let sides_of = |face: &'a [u32]| {
        let next = face.iter().cycle().skip(1);
        face.iter().zip(next).map(|(&a, &b)| (a.min(b), a.max(b), a < b))
    };
    let vertex_count = faces.clone().flatten().max().map_or(0, |&highest| highest as usize + 1);
    let mut starts = vec![0usize; vertex_count + 1];
    for (low, ..) in faces.clone().flat_map(sides_of) {
        starts[low as usize + 1] += 1;
    }
    for vertex in 0..vertex_count {
        starts[vertex + 1] += starts[vertex];
    }
    let mut sides = vec![EdgeSide { ends: [0; 2], face: 0, forward: false }; starts[vertex_count]];
    let mut next = starts.clone();
    for (face, vertices) in faces.enumerate() {
        for (low, high, forward) in sides_of(vertices) {
            sides[next[low as usize]] = EdgeSide { ends: [low, high], face: face as u32, forward };
            next[low as usize] += 1;
        }
    }
    for vertex in 0..vertex_count {
        sides[starts[vertex]..starts[vertex + 1]].sort_unstable();
    }
    sides
}

/// Disjoint sets of numbers; the root of a set is its lowest member.
pub(super) struct Parts {
    parents: Vec<u32>,
}

impl Parts {
    pub fn new(count: usize) -> Self {
        Self { parents: (0..count as u32).collect() }
    }

    /// The connected component of each of `count` vertices that triangles hold together, by its lowest vertex.
    pub fn components(count: usize, triangles: &[[u32; 3]]) -> Vec<u32> {
        let mut parts = Self::new(count);
        for &[a, b, c] in triangles {
            parts.join(a, b);
            parts.join(b, c);
        }
        (0..count as u32).map(|vertex| parts.root(vertex)).collect()
    }

    pub fn root(&mut self, mut member: u32) -> u32 {
        while self.parents[member as usize] != member {
            let grandparent = self.parents[self.parents[member as usize] as usize];
            self.parents[member as usize] = grandparent;
            member = grandparent;
        }
        member
    }

    pub fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.parents[a.max(b) as usize] = a.min(b);
    }
}
