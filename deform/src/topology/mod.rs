//! How triangles and edges meet, whatever their points.

mod disjoint_sets;
mod edges;
mod groups;
mod marks;
mod triangle_sides;

pub use disjoint_sets::DisjointSets;
pub(crate) use disjoint_sets::lead_to_roots;
pub(crate) use edges::{EdgeSide, edges};
pub use groups::Groups;
pub(crate) use groups::triangles_at;
pub(crate) use marks::{indices, marked, marks};
pub(crate) use triangle_sides::{CrowdedEdge, OPEN, SidesOfEdges, around, ends_of_sides};
