//! Edits of a surface.
//!
//! An [`Edit`] moves a handle (some features, or a region) by an affine motion, holds other parts
//! fixed, and lets the rest of the surface follow. A stack of edits is a list of them, each of
//! which acts on the shape that those before it have reached. An [`Editor`] turns a stack into one
//! displacement for each surface vertex, from the reference.
//!
//! ```
//! use std::sync::Arc;
//! use tombolo_deform::edit::{Edit, Editor};
//! use tombolo_deform::{features::FeatureSettings, shapes, surface::Surface};
//!
//! let mesh = shapes::box_of_tets([6, 2, 2], [0.0; 3], [3.0, 1.0, 1.0]);
//! let surface = Surface::extract(&mesh, &FeatureSettings::default())?;
//! let stack: Vec<Edit> = serde_json::from_str(r#"[
//!     { "scale_direction": { "features": ["x-max"], "fixed": ["x-min"], "factors": [1, 2, 2] } },
//!     { "translate": { "features": ["x-max"], "fixed": ["x-min"], "by": [0, 0, 0.5], "harmonic_order": 3 } }
//! ]"#)?;
//! let mut editor = Editor::new(Arc::new(surface))?;
//! let displacement = editor.displacement(&stack)?;
//! let corner = editor.surface().points().iter().position(|point| *point == [3.0, 1.0, 1.0]).unwrap();
//! assert_eq!(displacement[corner], [0.0, 0.5, 0.5 + 0.5]);
//!
//! assert!(editor.displacement(&[])?.iter().all(|moved| *moved == [0.0; 3]));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! To add an edit: its type and its name in `kinds`, the checks that need no surface in `validate`,
//! how its handle moves in `motion`. How the free surface follows is
//! [`harmonic`](crate::harmonic)'s business.
//!
//! # What is guaranteed
//! - The same mesh, settings and stack give the same bits, whatever was evaluated before.
//!   Renumbering the vertices changes results by rounding alone.
//! - Prescribed vertices move exactly as stated, fixed ones by exact zeros, and an empty stack is
//!   exact zeros everywhere.
//! - No input makes it panic: what cannot be answered is an [`EditError`] that names the edit, and
//!   the vertex, the feature or the number at fault.
//!
//! # What is not
//! A displacement says nothing about whether the shape it leads to can be meshed:
//! [`surface::check`](fn@crate::surface::check) finds folds and self-intersections of the surface,
//! [`quality`](crate::quality) inversions of the volume. Surfaces that are no manifold can be
//! extracted and looked at, but not edited.

mod advance;
mod editor;
mod error;
mod handle;
mod kept_layers;
mod kinds;
mod layers;
mod motion;
mod region;
mod skeleton;
#[cfg(test)]
mod tests;
mod validate;

pub use crate::harmonic::HarmonicOrder;
pub use advance::Advance;
pub use editor::Editor;
pub use error::{EditError, InvalidEdit, Surroundings};
pub use kinds::{
    Affine, Displacement, Edit, Rotate, ScaleDirection, ScaleNormals, SkeletonEdit, SkeletonMove,
    Translate,
};
pub use layers::Layer;
pub use region::{BoxRegion, HalfSpaceRegion, Region, RegionError, SphereRegion};
pub use skeleton::SkeletonEditError;
