//! Curve skeletons of surfaces.
//!
//! A [`Skeleton`] is a graph of polylines along the middle of a surface, with the surface vertices that each of its nodes
//! carries.

mod graph;

pub use graph::{Curve, InvalidSkeleton, Skeleton};
