//! A request for a shape.

use std::sync::Arc;

use super::{CurrentShape, Deformation};
use crate::edit::Edit;
use crate::quality::Guard;
use crate::schedule::Schedule;

/// A request for the shape that a stack of edits makes of the reference mesh, and for the way
/// there.
///
/// ```
/// use tombolo_deform::{quality::Guard, shape::{CurrentShape, Request}};
///
/// let here = CurrentShape::from(std::sync::Arc::from(vec![[0.0; 3]]));
/// let request = Request { guard: Guard { min_scaled_jacobian: 0.1, ..Guard::default() }, ..Request::new([], here) };
/// assert!(request.stack.is_empty() && request.kept == 0);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Request {
    /// The edits, each measured from the reference mesh with those before it.
    pub stack: Arc<[Edit]>,
    /// How many of them, from the first on, the present shape has already: they stay whole where
    /// the others are clamped.
    pub kept: usize,
    /// The present shape, where the way starts.
    pub start: CurrentShape,
    /// How the motion of the surface is carried into the volume.
    pub deformation: Deformation,
    /// The shapes on the way that are handed out.
    pub schedule: Schedule,
    /// The guard that every mesh on the way must keep to.
    pub guard: Guard,
}

impl Request {
    /// A request with the default deformation, schedule and guard.
    pub fn new(stack: impl Into<Arc<[Edit]>>, start: impl Into<CurrentShape>) -> Self {
        Self {
            stack: stack.into(),
            kept: 0,
            start: start.into(),
            deformation: Deformation::default(),
            schedule: Schedule::default(),
            guard: Guard::default(),
        }
    }

    /// Whether both ask for the same shape, wherever they start and however they go there.
    #[must_use]
    pub fn ends_like(&self, other: &Self) -> bool {
        (Arc::ptr_eq(&self.stack, &other.stack) || self.stack == other.stack)
            && self.kept == other.kept
            && self.deformation == other.deformation
            && self.guard == other.guard
    }
}
