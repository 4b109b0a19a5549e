//! The order of points from coarse to fine, and what each is predicted from.

use std::ops::Range;

use tombolo_deform::lanes::{LANES, with_wide_registers};

use super::graph::{Graph, Level, coarsen};
use super::kriging::{Four, NEIGHBOURS, square, weights};

/// A level with no more points than this is not made coarser.
const COARSEST: usize = 48;
/// The most levels.
const LEVELS: usize = 24;
/// The weights of neighbours in a context, the nearest first.
pub(super) const CONTEXT: [f32; NEIGHBOURS] = [9.0, 7.0, 6.0, 5.0, 4.0, 4.0, 0.0, 0.0];
/// The number of points that share a way of prediction.
pub(super) const BLOCK: usize = 256;

/// An order of points from coarse to fine. Each is predicted from up to eight that come earlier,
/// the nearest in space among those that are near in the mesh, by ordinary kriging.
#[derive(Debug, Clone, PartialEq)]
pub struct Hierarchy {
    /// The point that stands at each index of the order.
    order: Vec<u32>,
    stencils: Vec<Stencil>,
    /// The ends of the runs.
    runs: Vec<u32>,
}

/// The points that a value is predicted from, all earlier in the order, the nearest first, with
/// their weights. Where there are fewer than eight the nearest stands again, with no weight.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(64))]
pub(super) struct Stencil {
    pub(super) indices: [u32; NEIGHBOURS],
    pub(super) weights: [f32; NEIGHBOURS],
}

impl Stencil {
    const NONE: Self = Self { indices: [0; NEIGHBOURS], weights: [0.0; NEIGHBOURS] };
}

impl Hierarchy {
    /// The hierarchy of points at these positions, joined by these edges.
    ///
    /// # Panics
    /// If an edge names a point that there is none of.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "points are numbered with 32 bits")]
    pub fn new(positions: &[[i32; 3]], edges: impl Iterator<Item = [u32; 2]> + Clone) -> Self {
        let count = positions.len();
        let mut levels = Vec::new();
        let mut graph = Graph::new(count, edges);
        let mut points: Vec<u32> = (0..count as u32).collect();
        while points.len() > COARSEST && levels.len() < LEVELS {
            let (level, coarser, kept) = coarsen(graph, points);
            let is_same = kept.len() == level.points.len();
            (graph, points) = (coarser, kept);
            if is_same {
                break;
            }
            levels.push(level);
        }

        let mut order = Vec::with_capacity(count);
        order.extend(&points);
        levels.iter().rev().for_each(|level| level.put_in_order(&mut order));
        let mut index_of = vec![0; count];
        for (index, &point) in (0u32..).zip(&order) {
            index_of[point as usize] = index;
        }
        let mut stencils = vec![Stencil::NONE; count];
        with_wide_registers(
            #[inline(always)]
            || set_stencils(positions, &index_of, &points, &levels, &mut stencils),
        );
        let runs = runs(&stencils);
        Self { order, stencils, runs }
    }

    /// How many points there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.order.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.order.is_empty()
    }

    /// The point that stands at each index of the order.
    #[must_use]
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    pub(super) fn stencils(&self) -> &[Stencil] {
        &self.stencils
    }

    /// All indices, in runs of which none is predicted from another of its run. Each lies in one
    /// [`BLOCK`].
    #[inline(always)]
    pub(super) fn runs(&self) -> impl Iterator<Item = Range<usize>> {
        let mut start = 0;
        self.runs.iter().map(move |&end| {
            let run = start..end as usize;
            start = run.end;
            run
        })
    }
}

/// Gives all points their stencils. They are looked at in the order of their numbers, in which those
/// that are near each other lie near each other in memory.
#[inline(always)]
fn set_stencils(
    positions: &[[i32; 3]],
    index_of: &[u32],
    coarsest: &[u32],
    levels: &[Level],
    stencils: &mut [Stencil],
) {
    let mut weighing = Weighing { fours: [const { Waiting::NONE }; NEIGHBOURS + 1], stencils };
    for (index, &point) in coarsest.iter().enumerate() {
        let mut nearest = Nearest::to(positions[point as usize]);
        for &earlier in &coarsest[index.saturating_sub(COARSEST)..index] {
            nearest.look(positions[earlier as usize], earlier);
        }
        weighing.add(index_of[point as usize], &nearest, positions, index_of);
    }
    for level in levels {
        let mut last = vec![u32::MAX; level.points.len()];
        for (local, &point) in (0u32..).zip(&level.points) {
            let colour = level.colours[local as usize];
            if colour == 0 {
                continue;
            }
            let mut nearest = Nearest::to(positions[point as usize]);
            let mut look = |other: u32| {
                if level.colours[other as usize] < colour
                    && std::mem::replace(&mut last[other as usize], local) != local
                {
                    let other = level.points[other as usize];
                    nearest.look(positions[other as usize], other);
                }
            };
            for &other in level.graph.of(local) {
                look(other);
                level.graph.of(other).iter().for_each(|&further| look(further));
            }
            weighing.add(index_of[point as usize], &nearest, positions, index_of);
        }
    }
    weighing.finish();
}

/// The nearest of the points that were looked at, by distance and then by number.
struct Nearest {
    to: [i32; 3],
    squares: [f64; NEIGHBOURS],
    points: [u32; NEIGHBOURS],
    count: usize,
}

impl Nearest {
    #[inline(always)]
    fn to(to: [i32; 3]) -> Self {
        let (squares, points) = ([f64::INFINITY; NEIGHBOURS], [u32::MAX; NEIGHBOURS]);
        Self { to, squares, points, count: 0 }
    }

    /// Looks at another point, which is at this position.
    #[inline(always)]
    fn look(&mut self, position: [i32; 3], point: u32) {
        let square = square(position, self.to);
        let Self { squares, points, count, .. } = self;
        let is_before = |a: f64, of: u32| square < a || (square == a && point < of);
        if !is_before(squares[NEIGHBOURS - 1], points[NEIGHBOURS - 1]) {
            return;
        }
        let mut index = (*count).min(NEIGHBOURS - 1);
        while index > 0 && is_before(squares[index - 1], points[index - 1]) {
            (squares[index], points[index]) = (squares[index - 1], points[index - 1]);
            index -= 1;
        }
        (squares[index], points[index]) = (square, point);
        *count = (*count + 1).min(NEIGHBOURS);
    }
}

/// Points that wait until there are four with as many neighbours.
#[derive(Clone, Copy)]
struct Waiting {
    count: usize,
    /// The index of each, and those of its neighbours.
    indices: [(u32, [u32; NEIGHBOURS]); LANES],
    four: Four,
}

impl Waiting {
    const NONE: Self = Self { count: 0, indices: [(0, [0; NEIGHBOURS]); LANES], four: Four::NONE };
}

/// Weighs the neighbours of points, four points at a time.
struct Weighing<'a> {
    fours: [Waiting; NEIGHBOURS + 1],
    stencils: &'a mut [Stencil],
}

impl Weighing<'_> {
    /// Takes the point that stands at this index of the order, with its nearest.
    #[inline(always)]
    fn add(&mut self, own: u32, nearest: &Nearest, at: &[[i32; 3]], index_of: &[u32]) {
        let count = nearest.count;
        let waiting = &mut self.fours[count];
        let lane = waiting.count;
        let mut indices = [0; NEIGHBOURS];
        for (neighbour, &point) in nearest.points[..count].iter().enumerate() {
            indices[neighbour] = index_of[point as usize];
            waiting.four.set(lane, neighbour, at[point as usize], nearest.squares[neighbour]);
        }
        // Behind the last stands the nearest again, with no weight.
        let first = indices[0];
        indices[count..].fill(first);
        waiting.indices[lane] = (own, indices);
        waiting.count = lane + 1;
        if waiting.count == LANES {
            waiting.put(count, self.stencils);
        }
    }

    #[inline(always)]
    fn finish(mut self) {
        for (count, waiting) in self.fours.iter_mut().enumerate() {
            waiting.put(count, self.stencils);
        }
    }
}

impl Waiting {
    /// Gives those that wait their stencils; each has so many neighbours.
    #[inline(always)]
    fn put(&mut self, neighbours: usize, stencils: &mut [Stencil]) {
        let weights = weights(&self.four, neighbours);
        for (&(own, indices), weights) in self.indices[..self.count].iter().zip(weights) {
            stencils[own as usize] = Stencil { indices, weights };
        }
        self.count = 0;
    }
}

/// The ends of the runs of these stencils.
#[expect(clippy::cast_possible_truncation, reason = "points are numbered with 32 bits")]
fn runs(stencils: &[Stencil]) -> Vec<u32> {
    let (mut runs, mut start) = (Vec::new(), 0);
    for (index, stencil) in stencils.iter().enumerate() {
        let leans = stencil.indices.iter().any(|&other| other as usize >= start);
        if index > start && (leans || index % BLOCK == 0) {
            runs.push(index as u32);
            start = index;
        }
    }
    if !stencils.is_empty() {
        runs.push(stencils.len() as u32);
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The edges of a grid of points, with one diagonal in each square.
    fn grid(side: u32) -> (Vec<[i32; 3]>, Vec<[u32; 2]>) {
        let mut positions = Vec::new();
        let mut edges = Vec::new();
        for y in 0..side {
            for x in 0..side {
                positions.push([x as i32 * 100, y as i32 * 100, 0]);
                let here = y * side + x;
                if x + 1 < side {
                    edges.push([here, here + 1]);
                }
                if y + 1 < side {
                    edges.push([here, here + side]);
                }
                if x + 1 < side && y + 1 < side {
                    edges.push([here, here + side + 1]);
                }
            }
        }
        (positions, edges)
    }

    #[test]
    fn every_point_stands_once_and_behind_those_it_is_predicted_from() {
        let (positions, edges) = grid(40);
        let hierarchy = Hierarchy::new(&positions, edges.iter().copied());
        let mut order = hierarchy.order().to_vec();
        order.sort_unstable();
        assert!(order.into_iter().eq(0..1600));
        for (index, stencil) in (0u32..).zip(hierarchy.stencils()).skip(1) {
            let sum: f32 = stencil.weights.iter().sum();
            assert!((sum - 1.0).abs() < 1e-5, "{sum}");
            for (&other, &weight) in stencil.indices.iter().zip(&stencil.weights) {
                assert!(other < index || weight == 0.0);
            }
        }
        let full = hierarchy.stencils().iter().filter(|stencil| stencil.weights[7] != 0.0).count();
        assert!(full > 800, "{full}");
    }

    #[test]
    fn no_point_is_predicted_from_another_of_its_run() {
        let (positions, edges) = grid(40);
        let hierarchy = Hierarchy::new(&positions, edges.iter().copied());
        let mut next = 0;
        for run in hierarchy.runs() {
            assert_eq!(run.start, next);
            assert!(run.end > next && run.start / BLOCK == (run.end - 1) / BLOCK);
            next = run.end;
            let others = hierarchy.stencils()[run.clone()].iter().flat_map(|of| of.indices);
            assert!(run.start == 0 || others.into_iter().all(|other| (other as usize) < run.start));
        }
        assert_eq!(next, 1600);
        assert!(hierarchy.runs().count() < 200);
        assert_eq!(Hierarchy::new(&[], std::iter::empty()).runs().count(), 0);
    }

    #[test]
    fn points_without_edges_and_points_with_very_many_have_their_place() {
        let positions: Vec<[i32; 3]> = (0..500).map(|x| [x, 0, 0]).collect();
        assert_eq!(Hierarchy::new(&positions, std::iter::empty()).len(), 500);
        let star = (1..500).map(|leaf| [0, leaf]);
        assert_eq!(Hierarchy::new(&positions, star).len(), 500);
        let other_star = (0..499).map(|leaf| [499, leaf]);
        assert_eq!(Hierarchy::new(&positions, other_star).len(), 500);
        assert!(Hierarchy::new(&[], std::iter::empty()).is_empty());
    }
}
