//! The parts of a surface between its sharp edges.

use crate::mesh::{Cells, Vector};
use crate::topology::{DisjointSets, EdgeSide, edges};
use crate::vector::{cross, dot, polygon_normal, subtract};

/// The number of each face's part, and how many there are. Parts are numbered by their lowest
/// faces.
///
/// Faces are joined over every edge that is not sharp and has exactly two faces. For triangles the
/// rule and its arithmetic are those of CGAL's `sharp_edges_segmentation`
/// (`Polygon_mesh_processing/detect_features.h`), step by step, so that surfaces whose edges turn
/// by exactly the angle come apart at the same edges.
pub(super) fn parts_between_sharp_edges(
    points: &[Vector],
    faces: &Cells,
    sharp_angle_degrees: f64,
) -> (usize, Vec<u32>) {
    let rule = Sharpness::new(sharp_angle_degrees);
    let points = brought_to_order_one(points);
    let mut parts = DisjointSets::new(faces.len());
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

    /// Whether the normals, of any lengths, are at the angle or further apart. Below a right angle
    /// a face without area is sharp to all its neighbours, from there on to none.
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

/// The normals of the two faces at an edge, as long as twice their areas, on the same side of the
/// surface even where the faces run opposite ways round.
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

/// The points times a power of 2, so that products of eight coordinates neither overflow nor vanish
/// and no other bit changes.
fn brought_to_order_one(points: &[Vector]) -> Vec<Vector> {
    let largest = points.iter().flatten().fold(0.0f64, |largest, value| largest.max(value.abs()));
    let exponent = largest.to_bits() >> 52;
    let factor = f64::from_bits(2046u64.saturating_sub(exponent).max(1) << 52);
    points.iter().map(|point| point.map(|value| value * factor)).collect()
}
