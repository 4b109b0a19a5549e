//! Faces between the grids of a mesh of several levels.
//!
//! Where a grid meets a finer one, one coarse face lies against several fine ones. No cell has the
//! corners of its neighbour there, so that no comparison of vertices tells that these faces are
//! inside. The boxes that the grids fill do.

use super::Part;
use crate::bounds::Bounds;
use crate::mesh::Vector;
use crate::surface::BoundaryFaces;
use crate::vector::{add, cross, length, scale, subtract};

/// How far outside a face its other side is looked for, as a fraction of its size: within the
/// neighbour, however much finer that is.
const OUTSIDE: f64 = 1e-3;

/// Leaves out the faces that have a grid on their outer side, at each of their corners.
pub(super) fn outside_of_grids(faces: BoundaryFaces, part: &Part) -> BoundaryFaces {
    if part.grid_boxes.is_empty() {
        return faces;
    }
    let boxes = Boxes::new(&part.grid_boxes);
    let corners: Vec<Vec<Vector>> = faces
        .faces
        .iter()
        .map(|(_, vertices)| vertices.iter().map(|&vertex| part.points[vertex as usize]).collect())
        .collect();
    faces.of_faces(|face| {
        !probes(&corners[face]).is_some_and(|probes| probes.iter().all(|&probe| boxes.hold(probe)))
    })
}

/// A point beside each corner of a face, a little outside of it; `None` for a face without an area.
fn probes(corners: &[Vector]) -> Option<Vec<Vector>> {
    #[expect(clippy::cast_precision_loss, reason = "corners of a face")]
    let center = scale(
        corners.iter().fold([0.0; 3], |sum, &corner| add(sum, corner)),
        1.0 / corners.len() as f64,
    );
    let next = corners.iter().cycle().skip(1);
    let twice_area = corners
        .iter()
        .zip(next)
        .fold([0.0; 3], |sum, (&a, &b)| add(sum, cross(subtract(a, center), subtract(b, center))));
    // The normal, as long as the square root of twice the area.
    let normal = scale(twice_area, 1.0 / length(twice_area).sqrt());
    let probe = |&corner: &Vector| add(scale(add(corner, center), 0.5), scale(normal, OUTSIDE));
    let probes: Vec<Vector> = corners.iter().map(probe).collect();
    probes.iter().flatten().all(|coordinate| coordinate.is_finite()).then_some(probes)
}

/// Boxes by their lowest x.
struct Boxes {
    rising: Vec<Bounds>,
    /// The highest x of each box and those before it.
    highest: Vec<f64>,
}

impl Boxes {
    fn new(boxes: &[Bounds]) -> Self {
        let mut rising = boxes.to_vec();
        rising.sort_by(|a, b| a.lower[0].total_cmp(&b.lower[0]));
        let mut so_far = f64::NEG_INFINITY;
        let highest = rising
            .iter()
            .map(|bounds| {
                so_far = so_far.max(bounds.upper[0]);
                so_far
            })
            .collect();
        Self { rising, highest }
    }

    /// Whether a point lies in one of them.
    fn hold(&self, point: Vector) -> bool {
        let end = self.rising.partition_point(|bounds| bounds.lower[0] <= point[0]);
        let start = self.highest.partition_point(|&highest| highest < point[0]).min(end);
        let point = Bounds { lower: point, upper: point };
        self.rising[start..end].iter().rev().any(|bounds| bounds.meets(&point))
    }
}
