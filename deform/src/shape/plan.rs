//! Ways from one shape to another, and the shapes on them.

use std::num::NonZeroU32;
use std::sync::Arc;

use crate::{
    mesh::Vector,
    quality::{PathQuality, shape_at},
    schedule::Schedule,
};
use serde::{Deserialize, Serialize};

use super::{ShapeSeconds, Target, body::Body};
use crate::communicator::Reduction;

/// Shapes that a way back may have; of a longer one nothing is remembered.
const REMEMBERED: usize = 64;

/// A shape of the mesh, and the shapes over which it can go back to the reference.
#[derive(Debug, Clone, PartialEq)]
pub struct CurrentShape {
    /// The coordinates of every vertex.
    pub points: Arc<[Vector]>,
    /// The shapes from here back to the reference, which is the last; every straight piece between
    /// them was judged. Empty where no such way is known, and at the reference itself.
    pub back: Vec<Arc<[Vector]>>,
    /// Whether only the boundary is known to lie there: the volume is the solver's.
    pub surface_only: bool,
}

impl From<Arc<[Vector]>> for CurrentShape {
    /// A shape from which no way back is known.
    fn from(points: Arc<[Vector]>) -> Self {
        Self { points, back: Vec::new(), surface_only: false }
    }
}

/// One shape of a plan: how far along which straight piece of the way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Shape {
    pub(super) piece: usize,
    pub(super) fraction: f64,
}

/// A way from one shape to another, every mesh of which has been judged.
///
/// The way is straight where a straight one keeps to the guard, and else goes over shapes in
/// between. The shapes of the schedule are spread along it evenly. Where the mesh cannot go from
/// one of these straight to the next, the corners of the way are handed out too, so that there are
/// more shapes than the schedule asked for, each `every` so much after the one before.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// From the start to the end, both among them.
    pub(super) way: Vec<Arc<[Vector]>>,
    pub(super) shapes: Vec<Shape>,
    pub(super) asked: Schedule,
    pub(super) schedule: Schedule,
    pub(super) quality: PathQuality,
    pub(super) back: Vec<Arc<[Vector]>>,
    pub(super) target: Target,
    pub(super) largest_displacement: f64,
    pub(super) seconds: ShapeSeconds,
    /// Whether only the surface was judged.
    pub(super) surface_only: bool,
}

/// The part of every mesh on a way that the guard has judged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Judged {
    /// All cells.
    Volume,
    /// The surface alone: the volume is left to the solver.
    Surface,
}

impl Plan {
    /// A plan along a way from `start`; how far the surface goes is still to be told.
    pub(super) fn new(
        way: Vec<Arc<[Vector]>>,
        shapes: Vec<Shape>,
        start: &CurrentShape,
        target: &Target,
        asked: &Schedule,
        quality: PathQuality,
    ) -> Self {
        let steps =
            u32::try_from(shapes.len()).ok().and_then(NonZeroU32::new).unwrap_or(asked.steps);
        Self {
            way,
            shapes,
            asked: *asked,
            schedule: Schedule { steps, ..*asked },
            quality,
            back: start.back.clone(),
            target: target.clone(),
            largest_displacement: 0.0,
            seconds: target.seconds,
            surface_only: false,
        }
    }

    /// How many shapes there are.
    #[must_use]
    pub fn shapes(&self) -> u32 {
        self.schedule.steps.get()
    }

    /// When they are due; with as many steps as there are shapes.
    #[must_use]
    pub fn schedule(&self) -> &Schedule {
        &self.schedule
    }

    /// The schedule that was asked for.
    #[must_use]
    pub fn asked(&self) -> &Schedule {
        &self.asked
    }

    /// Writes the coordinates of the `shape`-th shape, counted from 1, into `points`; the last is
    /// exactly [`Plan::end`].
    ///
    /// # Panics
    /// Where `points` has another length than the mesh has vertices.
    pub fn write_shape(&self, shape: u32, points: &mut [Vector]) {
        assert_eq!(points.len(), self.end().len(), "one point for each vertex");
        let (start, end, fraction) = match self.shape(shape) {
            Some(at) => (&self.way[at.piece], &self.way[at.piece + 1], at.fraction),
            None if shape == 0 => (self.start(), self.start(), 1.0),
            None => (self.end(), self.end(), 1.0),
        };
        write(start, end, fraction, points);
    }

    /// Writes the coordinates at a position on the way, counted in shapes, into `points`: at 0 the
    /// start, at a whole number that shape, and between two shapes on the straight way from one to
    /// the other.
    ///
    /// # Panics
    /// Where `points` has another length than the mesh has vertices.
    pub fn write_position(&self, position: f64, points: &mut [Vector]) {
        let (before, after, fraction) = self.between(position);
        self.write_shape(before, points);
        if fraction > 0.0 {
            let mut next = vec![[0.0; 3]; points.len()];
            self.write_shape(after, &mut next);
            for (point, &next) in points.iter_mut().zip(&next) {
                *point = shape_at(*point, next, fraction);
            }
        }
    }

    /// The shapes between which a position lies, and how far along the way from one to the other.
    fn between(&self, position: f64) -> (u32, u32, f64) {
        let position = position.clamp(0.0, f64::from(self.shapes()));
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to the shapes"
        )]
        let before = position as u32;
        (before, (before + 1).min(self.shapes()), position - f64::from(before))
    }

    /// The least and the mean scaled Jacobian at a shape of the way. Between two shapes they are those
    /// of the worse one, though the mesh may be worse there than at both. `None` at the start, and
    /// where the volume was not judged.
    #[must_use]
    pub fn quality_at(&self, position: f64) -> Option<(f64, f64)> {
        let (before, after, fraction) = self.between(position);
        let of = |shape: u32| {
            let quality = self.quality.shapes.get((shape as usize).checked_sub(1)?)?;
            Some((quality.min, quality.mean))
        };
        match (of(before), of(after)) {
            (before, _) if fraction == 0.0 => before,
            (Some(before), Some(after)) => Some((before.0.min(after.0), before.1.min(after.1))),
            (_, after) => after,
        }
    }

    /// Where it starts.
    #[must_use]
    pub fn start(&self) -> &Arc<[Vector]> {
        &self.way[0]
    }

    /// Where it ends.
    #[must_use]
    pub fn end(&self) -> &Arc<[Vector]> {
        &self.way[self.way.len() - 1]
    }

    /// The corners of the way, its start and end among them.
    #[must_use]
    pub fn way(&self) -> &[Arc<[Vector]>] {
        &self.way
    }

    /// The target that it leads to.
    #[must_use]
    pub fn target(&self) -> &Target {
        &self.target
    }

    /// The part of the meshes on the way that was judged.
    #[must_use]
    pub fn judged(&self) -> Judged {
        if self.surface_only { Judged::Surface } else { Judged::Volume }
    }

    /// The least scaled Jacobian of the shapes on the way; `None` where the volume was not judged.
    #[must_use]
    pub fn min_scaled_jacobian(&self) -> Option<f64> {
        (!self.surface_only).then_some(self.quality.min_scaled_jacobian)
    }

    /// Whether the way from one position to another, counted in shapes with 0 for the start, is a
    /// piece of a straight one.
    #[must_use]
    pub fn is_straight(&self, from: f64, to: f64) -> bool {
        let ((before, after, fraction), (other, ..)) = (self.between(from), self.between(to));
        // From one shape to the next the mesh goes straight, whatever corners of the way lie there.
        if before == other || to == f64::from(after) {
            return true;
        }
        // The end of a piece is the start of the next.
        let begins = |shape: u32| {
            self.shape(shape).map_or(0, |at| at.piece + usize::from(at.fraction >= 1.0))
        };
        let piece = |shape: u32| self.shape(shape).map(|at| at.piece);
        let start = if fraction == 0.0 { Some(begins(before)) } else { self.piece_between(from) };
        let end = self.piece_between(to);
        start.is_some() && (start == end || piece(before).is_some() && piece(before) == end)
    }

    /// The straight piece of the way that holds a position, where the mesh does not leave it between
    /// two shapes.
    fn piece_between(&self, position: f64) -> Option<usize> {
        let (before, after, fraction) = self.between(position);
        if fraction == 0.0 {
            return self.shape(before).map(|at| at.piece);
        }
        let begins = self.shape(before).map_or(0, |at| at.piece + usize::from(at.fraction >= 1.0));
        let ends = self.shape(after)?.piece;
        (begins == ends).then_some(ends)
    }

    /// The quality of the meshes on the way; nothing is known of it where only the surface was
    /// judged.
    #[must_use]
    pub fn quality(&self) -> &PathQuality {
        &self.quality
    }

    /// Seconds that it took to make.
    #[must_use]
    pub fn seconds(&self) -> ShapeSeconds {
        self.seconds
    }

    /// The longest way that a vertex of the surface goes from the start to the end, in units of the
    /// mesh.
    #[must_use]
    pub fn largest_displacement(&self) -> f64 {
        self.largest_displacement
    }

    /// With the seconds it took, and how far the surface goes.
    pub(super) fn finished(self, body: &Body, seconds: ShapeSeconds) -> Self {
        let largest = body.vertices().iter().fold(0.0_f64, |largest, &vertex| {
            let [from, to] = [self.start(), self.end()].map(|points| points[vertex as usize]);
            largest.max((to[0] - from[0]).hypot(to[1] - from[1]).hypot(to[2] - from[2]))
        });
        let largest_displacement = body.reduced(Reduction::Maximum, largest);
        Self { seconds, largest_displacement, ..self }
    }

    /// The current shape once the mesh is at a position on the way, counted in shapes, where its
    /// coordinates are `points`.
    #[must_use]
    pub fn reached(&self, position: f64, points: Arc<[Vector]>) -> CurrentShape {
        let is_at_end = position >= f64::from(self.shapes());
        if self.surface_only {
            let surface_only = self.target.surface_only || !is_at_end;
            return CurrentShape { points, back: Vec::new(), surface_only };
        }
        if is_at_end && !self.target.way.is_empty() {
            return self.target.reached();
        }
        let is_at_shape = position.fract() == 0.0;
        let Some(piece) = self.piece_between(position).or(is_at_shape.then_some(0)) else {
            return CurrentShape { points, back: Vec::new(), surface_only: false };
        };
        let mut back: Vec<_> = self.way[..=piece].iter().rev().cloned().collect();
        back.extend(self.back.iter().cloned());
        // The way back ends at the reference, or nothing is known of it.
        if (self.back.is_empty() && !self.starts_at_reference()) || back.len() > REMEMBERED {
            back.clear();
        }
        CurrentShape { points, back, surface_only: false }
    }

    /// Where on the way a shape lies, counted from 1; `None` at the start and beyond the end.
    fn shape(&self, shape: u32) -> Option<&Shape> {
        self.shapes.get((shape as usize).checked_sub(1)?)
    }

    fn starts_at_reference(&self) -> bool {
        Arc::ptr_eq(self.start(), &self.target.reference)
    }
}

pub(super) fn write(start: &[Vector], end: &[Vector], fraction: f64, points: &mut [Vector]) {
    for ((point, &start), &end) in points.iter_mut().zip(start).zip(end) {
        *point = shape_at(start, end, fraction);
    }
}
