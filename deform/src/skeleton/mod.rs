//! Curve skeletons of surfaces.
//!
//! A [`Skeleton`] is a graph of polylines along the middle of a surface, with the surface vertices that each of its nodes
//! carries.
//!
//! # Dragging
//! A [`SkeletonDrag`] bends the curves of a skeleton on which nodes are dragged, and a [`Skin`] says how the surface follows. The
//! `skeleton` edit ([`surface::Skeleton`](crate::surface::Skeleton)) does both.

mod axis;
mod closing;
mod curve;
mod curves;
mod distance;
mod editing;
mod extraction;
mod flow;
mod graph;
mod medial;
mod resolution;
mod rotation;
mod skinning;
mod system;
mod thinning;
mod triangulation;

pub use curve::{CurveDeformation, CurveError, DragError, SkeletonDrag};
pub use editing::SkeletonEditError;
pub(crate) use editing::SkeletonEditor;
pub use extraction::{SkeletonError, SkeletonSettings};
pub use graph::{Curve, InvalidSkeleton, Skeleton};
pub use skinning::{Skin, SkinError};
