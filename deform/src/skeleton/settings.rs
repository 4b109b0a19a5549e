//! The settings of the extraction of a skeleton.

use super::SkeletonError;

/// How a skeleton is extracted. Lengths are parts of the diagonal of the bounding box of each
/// connected piece.
///
/// The defaults are those of CGAL 5.5.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SkeletonSettings {
    /// How strongly a vertex keeps its position in one step of the flow: the lower, the larger the
    /// step.
    pub keep: f64,
    /// How strongly a vertex is drawn to the middle of the surface: to its pole, while that lies
    /// inside.
    pub centre: f64,
    /// Edges shorter than this are collapsed on the way.
    pub shortest_edge: f64,
    /// The flow ends when one step changes the area by less than this part of the first.
    pub area_change: f64,
    /// The flow ends after this many steps.
    pub iterations: usize,
    /// Pieces of fewer vertices are refined to about so many.
    pub least_vertices: usize,
    /// Pieces of more vertices are coarsened to about so many.
    pub most_vertices: usize,
    /// Branches shorter than this many times the largest radius along them are taken for noise and
    /// cut off.
    pub shortest_branch: f64,
}

impl Default for SkeletonSettings {
    fn default() -> Self {
        Self {
            keep: 0.1,
            centre: 0.2,
            shortest_edge: 0.002,
            area_change: 1e-4,
            iterations: 500,
            least_vertices: 3500,
            most_vertices: 8000,
            shortest_branch: 1.75,
        }
    }
}

impl SkeletonSettings {
    pub(super) fn validate(&self) -> Result<(), SkeletonError> {
        for (name, value) in [
            ("keep", self.keep),
            ("centre", self.centre),
            ("shortest_edge", self.shortest_edge),
            ("area_change", self.area_change),
            ("shortest_branch", self.shortest_branch),
        ] {
            if !(value.is_finite() && value >= 0.0) || (name == "keep" && value == 0.0) {
                return Err(SkeletonError::Setting { name, value });
            }
        }
        Ok(())
    }
}
