//! Regions: parts of a surface given by a shape in space or by picked faces.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::bounds::Bounds;
use crate::mesh::Vector;
use crate::surface::Surface;
use crate::topology::marked;
use crate::vector::{dot, subtract};

/// A part of a surface. It is measured on the reference surface, whatever the edits before have
/// done to it.
///
/// A vertex lies in a region when its reference point does. The boundary belongs to the region,
/// with a slack of 1e-9 of the diagonal of the surface's bounding box, so that rounding decides
/// nothing.
///
/// ```
/// use tombolo_deform::{shapes, edit::Region, features::FeatureSettings, surface::Surface};
///
/// let surface = Surface::extract(&shapes::box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]), &FeatureSettings::default())?;
/// let region: Region = serde_json::from_str(r#"{ "half_space": { "origin": [0.5, 0, 0], "normal": [1, 0, 0] } }"#)?;
/// assert_eq!(region.vertices(&surface)?.len(), 9 + 8);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Region {
    /// The vertices in a box along the axes.
    Box(BoxRegion),
    /// The vertices in a ball.
    Sphere(SphereRegion),
    /// The vertices on one side of a plane.
    HalfSpace(HalfSpaceRegion),
    /// The vertices of these faces of the surface, numbered from 0 in the order of the surface.
    Faces(Vec<u32>),
}

/// A box along the axes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BoxRegion {
    /// The corner with the least coordinates.
    pub lower: Vector,
    /// The corner with the greatest coordinates.
    pub upper: Vector,
}

/// A ball.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SphereRegion {
    /// Its centre.
    pub center: Vector,
    /// Its radius, in units of the mesh.
    #[schemars(extend("x-unit" = "mesh units"))]
    pub radius: f64,
}

/// One side of a plane.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HalfSpaceRegion {
    /// A point of the plane.
    pub origin: Vector,
    /// The direction from the plane into the region, of any length but 0.
    #[schemars(extend("x-start" = [0, 0, 1]))]
    pub normal: Vector,
}

/// The slack at the boundary of a region, in diagonals of the surface's bounding box.
const SLACK: f64 = 1e-9;

impl Region {
    /// The surface vertices in the region, rising. There may be none.
    ///
    /// # Errors
    /// [`RegionError`] for a face that the surface does not have.
    pub fn vertices(&self, surface: &Surface) -> Result<Vec<u32>, RegionError> {
        let mut inside = vec![false; surface.points().len()];
        if let Region::Faces(faces) = self {
            for (index, &face) in faces.iter().enumerate() {
                if face as usize >= surface.faces().len() {
                    return Err(RegionError::UnknownFace {
                        index,
                        face,
                        faces: surface.faces().len(),
                    });
                }
                for &vertex in surface.faces().vertices(face as usize) {
                    inside[vertex as usize] = true;
                }
            }
        } else {
            let diagonal = Bounds::around(surface.points().iter().copied()).diagonal();
            let slack = if diagonal.is_finite() { SLACK * diagonal } else { 0.0 };
            for (point, inside) in surface.points().iter().zip(&mut inside) {
                *inside = self.distance(*point) <= slack;
            }
        }
        Ok(marked(&inside))
    }

    /// How far a point is from the region; 0 in it. Infinite for picked faces, which are no part of
    /// space.
    fn distance(&self, point: Vector) -> f64 {
        let length =
            |vector: Vector| vector.iter().fold(0.0f64, |length, part| length.hypot(*part));
        match self {
            Region::Box(region) => length([0, 1, 2].map(|axis| {
                (region.lower[axis] - point[axis]).max(point[axis] - region.upper[axis]).max(0.0)
            })),
            Region::Sphere(region) => {
                (length(subtract(point, region.center)) - region.radius).max(0.0)
            }
            Region::HalfSpace(region) => {
                // In units of its largest part, so that no length overflows.
                let largest =
                    region.normal.iter().fold(0.0f64, |largest, part| largest.max(part.abs()));
                let normal = region.normal.map(|part| part / largest);
                (-dot(normal, subtract(point, region.origin)) / length(normal)).max(0.0)
            }
            Region::Faces(_) => f64::INFINITY,
        }
    }

    /// The surface vertex nearest to the region, and how far it is.
    pub(super) fn nearest(&self, surface: &Surface) -> Option<(u32, f64)> {
        let distances = surface
            .points()
            .iter()
            .enumerate()
            .map(|(vertex, point)| (vertex as u32, self.distance(*point)));
        distances.min_by(|a, b| a.1.total_cmp(&b.1)).filter(|(_, distance)| distance.is_finite())
    }
}

/// Why a region does not fit a surface.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RegionError {
    /// A picked face that the surface does not have.
    #[error(
        "faces[{index}]: there is no face {face}; the surface has {faces} faces, numbered from 0"
    )]
    UnknownFace {
        /// Its index in the list.
        index: usize,
        /// The face.
        face: u32,
        /// How many faces there are.
        faces: usize,
    },
}
