//! The plans that the guard lets through: straight ways, and ways over known shapes.

use std::sync::Arc;

use super::plan::{CurrentShape, Plan, Shape, write};
use super::{Refused, Target, body::Body};
use crate::communicator::{Communicator, Reduction};
use crate::mesh::Vector;
use crate::quality::{Guard, PathQuality, Refusal};
use crate::schedule::Schedule;

/// Straight steps between two ways that are tried before a way is gone back to the reference.
const SHORTCUTS: usize = 24;

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
