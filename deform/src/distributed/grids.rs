//! Faces between the grids of a mesh of several levels.
//!
//! Where a grid meets a finer one, one coarse face lies against several fine ones. No cell has the
//! corners of its neighbour there, so that no comparison of vertices tells that these faces are
//! inside. The boxes that the grids fill do.

use super::Part;
use crate::bounds::BoxTree;
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
    let boxes = BoxTree::new(&part.grid_boxes);
    let corners: Vec<Vec<Vector>> = faces
        .faces
        .iter()
        .map(|(_, vertices)| vertices.iter().map(|&vertex| part.points[vertex as usize]).collect())
        .collect();
    faces.of_faces(|face| {
        !probes(&corners[face])
            .is_some_and(|probes| probes.iter().all(|&probe| boxes.contains(probe)))
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
