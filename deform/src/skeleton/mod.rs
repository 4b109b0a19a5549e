//! Curve skeletons of surfaces.
//!
//! A [`Skeleton`] is a graph of polylines along the middle of a surface, with the surface vertices that each of its nodes
//! carries.

mod closing;
mod curves;
mod extraction;
mod flow;
mod graph;
mod medial;
mod resolution;
mod system;
mod thinning;
mod triangulation;

pub use extraction::{SkeletonError, SkeletonSettings};
pub use graph::{Curve, InvalidSkeleton, Skeleton};
