//! Surfaces: the boundary of a mesh, and what is wrong with a deformed one.
//!
//! [`Surface::extract`] finds the faces that belong to one cell only, for any mix of linear cells.
//! Surface vertices keep the number of the mesh vertex they are; faces keep the cell they belong
//! to. Every face belongs to one of the [features](crate::features).
//!
//! ```
//! use tombolo_deform::{features::FeatureSettings, shapes, surface::Surface};
//!
//! let mesh = shapes::box_of_tets([6, 2, 2], [0.0; 3], [3.0, 1.0, 1.0]);
//! let surface = Surface::extract(&mesh, &FeatureSettings::default())?;
//! let first = surface.vertices()[0] as usize;
//! assert_eq!(surface.points()[0], mesh.points()[first]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`check`](fn@check) compares a deformed surface with its reference. Where a mesh is spread over
//! ranks, each of them finds the [`BoundaryFaces`] of its part, and [`Surface::assemble`] puts them
//! together.

pub(crate) mod adjacency;
mod boundary;
mod boundary_of_cells;
mod boundary_of_tets;
mod check;
mod error;
mod extraction;
mod inside_out;
mod orientation;
mod report;
mod triangle_pair;
mod triangles;

pub use boundary::BoundaryFaces;
pub use check::{check, check_triangles, require_sound, sound_fraction};
pub use error::SurfaceError;
pub use extraction::Surface;
pub use report::{
    BrokenSurface, FlawedFace, FlawedFaces, Intersection, Intersections, SurfaceReport,
};
