//! Ways from one shape to another, and the shapes on them.

use std::num::NonZeroU32;
use std::sync::Arc;

use crate::{
    mesh::Vector,
    quality::{Guard, PathQuality, Refusal, shape_at},
    schedule::Schedule,
};
use serde::{Deserialize, Serialize};

use super::{Refused, ShapeSeconds, Target, body::Body};
use crate::communicator::{Communicator, Reduction};

/// Straight steps between two ways that are tried before a way is gone back to the reference.
const SHORTCUTS: usize = 24;

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
    fn new(
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

fn write(start: &[Vector], end: &[Vector], fraction: f64, points: &mut [Vector]) {
    for ((point, &start), &end) in points.iter_mut().zip(start).zip(end) {
        *point = shape_at(start, end, fraction);
    }
}

/// The straight plan from `start` to `end`, of which only the surface was judged.
pub(super) fn of_surface(
    start: &CurrentShape,
    end: Arc<[Vector]>,
    target: &Target,
    schedule: &Schedule,
) -> Plan {
    let plan = straight(start, end, target, schedule, NOTHING_JUDGED);
    Plan { back: Vec::new(), surface_only: true, ..plan }
}

/// The quality of no mesh.
const NOTHING_JUDGED: PathQuality =
    PathQuality { floor: 0.0, min_scaled_jacobian: 1.0, shapes: Vec::new() };

/// The straight plan from `start` to `end`.
fn straight(
    start: &CurrentShape,
    end: Arc<[Vector]>,
    target: &Target,
    schedule: &Schedule,
    quality: PathQuality,
) -> Plan {
    let shapes =
        schedule.fractions().iter().map(|&fraction| Shape { piece: 0, fraction }).collect();
    Plan::new(vec![Arc::clone(&start.points), end], shapes, start, target, schedule, quality)
}

/// The way from `start` to a target in the steps of `schedule`: straight where the guard lets it
/// through, else over shapes that lie on the known ways from and to the reference.
///
/// # Errors
/// [`Refused::Guard`] of the straight way, where no other is known.
pub(super) fn travel(
    body: &Body,
    start: &CurrentShape,
    target: &Target,
    schedule: &Schedule,
    guard: &Guard,
) -> Result<Plan, Refused> {
    match body.judge(&start.points, &target.points, &schedule.fractions(), guard) {
        Ok(quality) => Ok(straight(start, Arc::clone(&target.points), target, schedule, quality)),
        Err(refusal @ Refusal::Quality(_)) => match around(body, start, target, guard) {
            Some(way) => along(body, way, start, target, schedule, guard),
            None => Err(refusal.into()),
        },
        Err(refusal) => Err(refusal.into()),
    }
}

/// A way over known shapes.
fn around(
    body: &Body,
    start: &CurrentShape,
    target: &Target,
    guard: &Guard,
) -> Option<Vec<Arc<[Vector]>>> {
    let reference = &target.reference;
    let at_reference = body
        .communicator()
        .all(Arc::ptr_eq(&start.points, reference) || *start.points == **reference);
    let leaving: Vec<&Arc<[Vector]>> = if at_reference {
        // The start's own points, by which it is known whose plan this is.
        vec![&start.points]
    } else {
        std::iter::once(&start.points).chain(&start.back).collect()
    };
    let arriving: Vec<&Arc<[Vector]>> = if target.way.is_empty() {
        vec![&target.points]
    } else {
        target.way.iter().rev().chain([reference]).collect()
    };
    // Compared by their numbers: whether a shape was found anew or is known from before, and whether
    // the run was restarted meanwhile, makes no difference to the way.
    let mut different: Vec<u64> = (leaving.iter())
        .flat_map(|from| arriving.iter().map(move |to| u64::from(!is_same(from, to))))
        .collect();
    body.communicator().reduce_integers(Reduction::Maximum, &mut different);
    let same = |from: usize, to: usize| different[from * arriving.len() + to] == 0;
    let join = |from: usize, to: usize| {
        let mut way: Vec<Arc<[Vector]>> =
            leaving[..=from].iter().map(|&shape| Arc::clone(shape)).collect();
        way.extend(
            arriving[..=to]
                .iter()
                .rev()
                .skip(usize::from(same(from, to)))
                .map(|&shape| Arc::clone(shape)),
        );
        way
    };
    // What both ways have in common costs nothing.
    let common = (0..leaving.len())
        .find_map(|from| (0..arriving.len()).find(|&to| same(from, to)).map(|to| (from, to)));
    // Straight steps between them, the shortest ways first.
    let limit = common.map_or(leaving.len() + arriving.len(), |(from, to)| from + to);
    let mut pairs: Vec<(usize, usize)> = (0..leaving.len())
        .flat_map(|from| (0..arriving.len()).map(move |to| (from, to)))
        .filter(|&(from, to)| from + to > 0 && from + to < limit)
        .collect();
    pairs.sort_by_key(|&(from, to)| (from + to, from));
    let straight = pairs
        .into_iter()
        .take(SHORTCUTS)
        .find(|&(from, to)| body.keeps(leaving[from], arriving[to], guard));
    straight.or(common).map(|(from, to)| join(from, to)).filter(|way| way.len() > 1)
}

/// Whether two shapes are the same bits.
fn is_same(a: &Arc<[Vector]>, b: &Arc<[Vector]>) -> bool {
    let mut pairs = a.as_flattened().iter().zip(b.as_flattened());
    Arc::ptr_eq(a, b) || pairs.all(|(a, b)| a.to_bits() == b.to_bits())
}

/// The plan along a way of several pieces, each of which was judged.
fn along(
    body: &Body,
    way: Vec<Arc<[Vector]>>,
    start: &CurrentShape,
    target: &Target,
    schedule: &Schedule,
    guard: &Guard,
) -> Result<Plan, Refused> {
    // Where each corner lies on the way, by how far the vertices move.
    let mut corners = vec![0.0];
    let mut length = 0.0;
    for pair in way.windows(2) {
        let square: f64 = (0_u32..)
            .zip(pair[0].iter().zip(&*pair[1]))
            .filter(|(vertex, _)| body.domain.owns(*vertex))
            .flat_map(|(_, (a, b))| (0..3).map(|axis| (b[axis] - a[axis]) * (b[axis] - a[axis])))
            .sum();
        length += body.reduced(Reduction::Sum, square).sqrt();
        corners.push(length);
    }
    let last = corners.len() - 1;
    corners.iter_mut().for_each(|corner| *corner /= if length > 0.0 { length } else { 1.0 });
    corners[last] = 1.0;
    let locate = |fraction: f64| {
        let piece = corners[1..last].partition_point(|&corner| corner < fraction);
        let (from, to) = (corners[piece], corners[piece + 1]);
        let within =
            if fraction >= to { 1.0 } else { ((fraction - from) / (to - from)).clamp(0.0, 1.0) };
        Shape { piece, fraction: within }
    };
    let asked: Vec<f64> = schedule.fractions();
    let reached: Vec<Shape> = asked.iter().map(|&fraction| locate(fraction)).collect();
    let (shapes, quality) = match hop(body, &way, &reached, &asked, guard) {
        Some(quality) => (reached, quality),
        None => {
            let mut fractions: Vec<f64> = asked.iter().chain(&corners[1..]).copied().collect();
            fractions.sort_by(f64::total_cmp);
            fractions.dedup();
            let shapes: Vec<Shape> = fractions.iter().map(|&fraction| locate(fraction)).collect();
            let quality = follow(body, &way, &shapes, &fractions, guard)?;
            (shapes, quality)
        }
    };
    Ok(Plan::new(way, shapes, start, target, schedule, quality))
}

/// The quality of shapes that the mesh goes straight between, whatever corners of the way lie
/// between them; `None` where it cannot.
fn hop(
    body: &Body,
    way: &[Arc<[Vector]>],
    shapes: &[Shape],
    fractions: &[f64],
    guard: &Guard,
) -> Option<PathQuality> {
    let mut before: Vec<Vector> = way.first()?.to_vec();
    let mut next = before.clone();
    let mut sum: Option<PathQuality> = None;
    for (shape, &fraction) in shapes.iter().zip(fractions) {
        write(&way[shape.piece], &way[shape.piece + 1], shape.fraction, &mut next);
        if !body.keeps(&before, &next, guard) {
            return None;
        }
        let mut quality = body.judge(&before, &next, &[1.0], guard).ok()?;
        quality.shapes.iter_mut().for_each(|shape| shape.fraction = fraction);
        sum = Some(merged(sum, quality));
        std::mem::swap(&mut before, &mut next);
    }
    sum
}

/// The quality of shapes that hold every corner of the way.
fn follow(
    body: &Body,
    way: &[Arc<[Vector]>],
    shapes: &[Shape],
    fractions: &[f64],
    guard: &Guard,
) -> Result<PathQuality, Refused> {
    let mut sum: Option<PathQuality> = None;
    for (piece, ends) in way.windows(2).enumerate() {
        let on = |index: &usize| shapes[*index].piece == piece;
        let indices: Vec<usize> = (0..shapes.len()).filter(on).collect();
        let within: Vec<f64> = indices.iter().map(|&index| shapes[index].fraction).collect();
        let mut quality = body.judge(&ends[0], &ends[1], &within, guard)?;
        for (shape, &index) in quality.shapes.iter_mut().zip(&indices) {
            shape.fraction = fractions[index];
        }
        sum = Some(merged(sum, quality));
    }
    Ok(sum.unwrap_or(NOTHING_JUDGED))
}

fn merged(sum: Option<PathQuality>, more: PathQuality) -> PathQuality {
    match sum {
        None => more,
        Some(mut sum) => {
            sum.min_scaled_jacobian = sum.min_scaled_jacobian.min(more.min_scaled_jacobian);
            sum.shapes.extend(more.shapes);
            sum
        }
    }
}
