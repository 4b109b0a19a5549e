//! The way of a volume that follows its boundary: what it is asked for, and what comes of it.

use std::sync::Arc;

use super::{Impossible, VolumeError, VolumeOperator};
use crate::cancellation::Cancellation;
use crate::linear::Solvers;
use crate::mesh::Domain;
use crate::mesh::Vector;
use crate::quality::Refusal;

/// A shape on the way of [`follow`](super::follow).
#[derive(Debug, Clone, PartialEq)]
pub struct Waypoint {
    /// How far along the motion of the boundary it lies, from 0 to 1. Where that motion could not
    /// be followed, but a way to its end was found on which the boundary goes elsewhere, how far
    /// along that.
    pub fraction: f64,
    /// The coordinates of every vertex of the mesh.
    pub points: Arc<[Vector]>,
}

/// A way along which the volume followed its boundary: every straight piece of it was judged.
#[derive(Debug, Clone, PartialEq)]
pub struct Route {
    /// The shapes after the first one; the last has the fraction 1.
    pub waypoints: Vec<Waypoint>,
    /// Sub-steps that were tried and did not hold.
    pub rejected: usize,
    /// Sub-steps that held only after they were untangled.
    pub untangled: usize,
    /// Iterations of the linear solver in all.
    pub iterations: usize,
}

/// A way that ended before the boundary had come to its place.
#[derive(Debug, Clone, PartialEq)]
pub struct Stalled {
    /// As far as it came; its last fraction is the largest that was reached.
    pub route: Route,
    /// The flaw of the smallest sub-step from there.
    pub refusal: Refusal,
    /// Whether it is the boundary itself that folds in that sub-step.
    pub folds: bool,
    /// Why there is no valid mesh at the end of the way, where that is proved.
    pub impossible: Option<Impossible>,
    /// Whether a valid mesh was found at the end of the way: then it is the way to it that was not.
    pub end_is_valid: bool,
}

impl Stalled {
    /// How far along the motion of the boundary the volume could follow.
    #[must_use]
    pub fn fraction(&self) -> f64 {
        self.route.waypoints.last().map_or(0.0, |last| last.fraction)
    }
}

/// Why the volume did not follow.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FollowError<E> {
    /// The boundary has no place at some fraction.
    #[error(transparent)]
    Boundary(E),
    /// An equation could not be set up or solved.
    #[error(transparent)]
    Volume(VolumeError),
    /// No further sub-step keeps to the guard.
    #[error("the volume can follow {:.1} % of the way: {}", 100.0 * .0.fraction(), .0.refusal.flaw())]
    Stalled(Box<Stalled>),
}

/// A motion of the boundary: where its vertices lie at the fraction `to`, going on from the shape
/// of the whole mesh that was reached at the fraction `from`.
pub trait BoundaryMotion {
    /// Why there is no such place.
    type Error;

    /// The coordinates of each boundary vertex at the fraction `to`.
    ///
    /// # Errors
    /// Where there are none.
    fn at(&mut self, from: f64, to: f64, shape: &[Vector]) -> Result<Vec<Vector>, Self::Error>;

    /// Whether its positions at a fraction do not depend on the shape that was reached before it:
    /// then they are asked for in any order.
    fn is_stated(&self) -> bool {
        true
    }

    /// Whether the boundary of a shape is one that may be handed out, beyond what the cells say.
    /// Asked of shapes whose boundary is not where the motion has it. Collective, where the mesh is
    /// in parts.
    fn is_sound(&self, shape: &[Vector]) -> bool {
        let _ = shape;
        true
    }

    /// Whether the boundary folds over itself on its way to `positions`, so that no motion of the
    /// inside can help.
    fn folds(&self, shape: &[Vector], positions: &[Vector]) -> bool {
        let _ = (shape, positions);
        false
    }
}

/// A volume that is taken along with its boundary.
#[derive(Debug, Clone, Copy)]
pub struct Volume<'a> {
    /// The reference mesh.
    pub domain: &'a Domain,
    /// Its vertices on the boundary of the whole mesh.
    pub boundary: &'a [u32],
    /// The choice of solvers.
    pub solvers: &'a dyn Solvers,
    /// An operator of this boundary, set up on the mesh where it starts, if there is one already.
    pub operator: Option<&'a Arc<VolumeOperator>>,
    /// What has it given up.
    pub cancellation: &'a Cancellation,
}
