//! Curve skeletons of surfaces.
//!
//! A [`Skeleton`] is a graph of polylines along the middle of a surface, with the surface vertices
//! that each of its nodes carries.
//!
//! # Dragging
//! A [`SkeletonDrag`] bends the curves of a skeleton on which nodes are dragged, and a [`Skin`]
//! says how the surface follows. The [`SkeletonEdit`](crate::edit::SkeletonEdit) does both.

mod axis;
mod closing;
mod curve_deformation;
mod distance;
mod drag;
mod error;
mod extraction;
mod flow;
mod graph;
mod medial;
mod pruning;
mod resolution;
mod rotation;
mod settings;
mod skinning;
mod system;
mod thinning;
mod triangulation;

pub use curve_deformation::{CurveDeformation, CurveError};
pub use drag::{DragError, SkeletonDrag};
pub use error::SkeletonError;
pub use graph::{Curve, InvalidSkeleton, Skeleton};
pub use settings::SkeletonSettings;
pub use skinning::{Skin, SkinError, Skinning};
