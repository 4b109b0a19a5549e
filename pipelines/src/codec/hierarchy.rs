//! The order of points from coarse to fine, and what each is predicted from.

use std::ops::Range;

use tombolo_deform::lanes::{LANES, with_wide_registers};

use super::kriging::{NEIGHBOURS, Neighbours, square, weights};

/// The most neighbours of a point that are looked at.
const MOST_NEIGHBOURS: usize = 32;
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
    /// The point that stands at each place of the order.
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
    pub(super) places: [u32; NEIGHBOURS],
    pub(super) weights: [f32; NEIGHBOURS],
}

/// Lists of neighbours, rising, one list after the other.
#[derive(Debug, Clone)]
struct Graph {
    starts: Vec<u32>,
    neighbours: Vec<u32>,
}

impl Graph {
    /// The graph of edges in both directions; of each list only the beginning.
    #[expect(clippy::cast_possible_truncation, reason = "points are numbered with 32 bits")]
    fn new(count: usize, edges: impl Iterator<Item = [u32; 2]> + Clone) -> Self {
        let mut ends = vec![0u32; count + 1];
        for [a, b] in edges.clone() {
            ends[a as usize + 1] += 1;
            ends[b as usize + 1] += 1;
        }
        for index in 0..count {
            ends[index + 1] += ends[index];
        }
        let mut all = vec![0u32; ends[count] as usize];
        let mut next = ends.clone();
        for [a, b] in edges {
            for [a, b] in [[a, b], [b, a]] {
                all[next[a as usize] as usize] = b;
                next[a as usize] += 1;
            }
        }
        let (mut starts, mut neighbours) = (vec![0u32], Vec::with_capacity(all.len() / 2));
        for point in 0..count {
            let list = &mut all[ends[point] as usize..ends[point + 1] as usize];
            list.sort_unstable();
            let before = neighbours.len();
            for &neighbour in &*list {
                let last = neighbours[before..].last();
                if neighbours.len() - before < MOST_NEIGHBOURS
                    && neighbour as usize != point
                    && last != Some(&neighbour)
                {
                    neighbours.push(neighbour);
                }
            }
            starts.push(neighbours.len() as u32);
        }
        Self { starts, neighbours }
    }

    fn of(&self, point: u32) -> &[u32] {
        let point = point as usize;
        &self.neighbours[self.starts[point] as usize..self.starts[point + 1] as usize]
    }
}

/// One level: its points by their numbers in the whole, what is kept of them, and the colours of the
/// rest, from 1.
struct Level {
    graph: Graph,
    points: Vec<u32>,
    colours: Vec<u8>,
}

impl Hierarchy {
    /// The hierarchy of points at these places, joined by these edges.
    ///
    /// # Panics
    /// If an edge names a point that there is none of.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "points are numbered with 32 bits")]
    pub fn new(places: &[[i32; 3]], edges: impl Iterator<Item = [u32; 2]> + Clone) -> Self {
        let count = places.len();
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

        let mut builder = Builder {
            places,
            place_of: vec![0; count],
            order: Vec::with_capacity(count),
            stencils: Vec::with_capacity(count),
            counts: Vec::with_capacity(count),
        };
        for (index, &point) in points.iter().enumerate() {
            let earlier = &points[index.saturating_sub(COARSEST)..index];
            builder.push(point, earlier.iter().copied());
        }
        let mut near = Vec::new();
        for level in levels.iter().rev() {
            let most = level.colours.iter().copied().max().unwrap_or(0);
            let mut by_colour: Vec<Vec<u32>> = vec![Vec::new(); usize::from(most) + 1];
            for (local, &colour) in (0u32..).zip(&level.colours) {
                by_colour[usize::from(colour)].push(local);
            }
            let mut last = vec![u32::MAX; level.points.len()];
            for local in by_colour.into_iter().skip(1).flatten() {
                level.near(local, &mut last, &mut near);
                builder.push(level.points[local as usize], near.iter().copied());
            }
        }
        builder.finish()
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

    /// The point that stands at each place of the order.
    #[must_use]
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    pub(super) fn stencils(&self) -> &[Stencil] {
        &self.stencils
    }

    /// All places, in runs of which none is predicted from another of its run. Each lies in one
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

/// A level, and the next coarser one: a maximal set of points of which no two are neighbours. Each
/// other point belongs to its first neighbour in it; two points of it are neighbours where points
/// that belong to them are.
#[expect(clippy::cast_possible_truncation, reason = "points are numbered with 32 bits")]
fn coarsen(graph: Graph, points: Vec<u32>) -> (Level, Graph, Vec<u32>) {
    const UNSEEN: u32 = u32::MAX;
    let count = points.len() as u32;
    // The number in the coarser level of what each point belongs to.
    let mut owner = vec![UNSEEN; points.len()];
    let mut kept = Vec::new();
    let mut colours = vec![0u8; points.len()];
    let mut is_kept = vec![false; points.len()];
    for point in 0..count {
        let first = graph.of(point).iter().find(|&&other| is_kept[other as usize]);
        if let Some(&first) = first {
            owner[point as usize] = owner[first as usize];
            continue;
        }
        is_kept[point as usize] = true;
        owner[point as usize] = kept.len() as u32;
        kept.push(points[point as usize]);
    }
    for point in 0..count {
        if is_kept[point as usize] {
            continue;
        }
        let mut used = 0u64;
        for &other in graph.of(point) {
            used |= 1 << colours[other as usize];
        }
        // Colour 0 is that of points that are kept, or have none yet.
        colours[point as usize] = ((used | 1).trailing_ones() as u8).min(63);
    }
    let edges = (0..count).flat_map(|point| {
        let (graph, owner) = (&graph, &owner);
        graph.of(point).iter().filter_map(move |&other| {
            let edge = [owner[point as usize], owner[other as usize]];
            (edge[0] < edge[1]).then_some(edge)
        })
    });
    let coarser = Graph::new(kept.len(), edges);
    (Level { graph, points, colours }, coarser, kept)
}

impl Level {
    /// The points of the level that are coded before this one and no further than two edges away,
    /// by their numbers in the whole. `last` is for each point the one that last looked at it.
    fn near(&self, point: u32, last: &mut [u32], near: &mut Vec<u32>) {
        near.clear();
        let colour = self.colours[point as usize];
        let mut look = |other: u32| {
            let is_new = std::mem::replace(&mut last[other as usize], point) != point;
            if is_new && self.colours[other as usize] < colour {
                near.push(self.points[other as usize]);
            }
        };
        for &other in self.graph.of(point) {
            look(other);
            self.graph.of(other).iter().for_each(|&further| look(further));
        }
    }
}

struct Builder<'places> {
    places: &'places [[i32; 3]],
    place_of: Vec<u32>,
    order: Vec<u32>,
    stencils: Vec<Stencil>,
    /// How many neighbours each stencil has.
    counts: Vec<u8>,
}

impl Builder<'_> {
    /// Adds the next point, which is predicted from the nearest of those, all different.
    #[expect(clippy::cast_possible_truncation, reason = "points are numbered with 32 bits")]
    fn push(&mut self, point: u32, earlier: impl Iterator<Item = u32>) {
        let at = self.places[point as usize];
        // The nearest, by distance and then by number.
        let mut nearest = [(f64::INFINITY, u32::MAX); NEIGHBOURS];
        let mut count = 0;
        for other in earlier {
            let new = (square(self.places[other as usize], at), other);
            let is_before = |a: (f64, u32), b: (f64, u32)| a.0 < b.0 || (a.0 == b.0 && a.1 < b.1);
            if !is_before(new, nearest[NEIGHBOURS - 1]) {
                continue;
            }
            let mut index = count.min(NEIGHBOURS - 1);
            while index > 0 && is_before(new, nearest[index - 1]) {
                nearest[index] = nearest[index - 1];
                index -= 1;
            }
            nearest[index] = new;
            count = (count + 1).min(NEIGHBOURS);
        }
        // Behind the last stands the nearest again, with no weight.
        let first = nearest[..count].first().map_or(0, |&(_, other)| self.place_of[other as usize]);
        let mut places = [first; NEIGHBOURS];
        for (place, &(_, other)) in places.iter_mut().zip(&nearest[..count]) {
            *place = self.place_of[other as usize];
        }
        self.place_of[point as usize] = self.order.len() as u32;
        self.order.push(point);
        self.stencils.push(Stencil { places, weights: [0.0; NEIGHBOURS] });
        self.counts.push(count as u8);
    }

    fn finish(self) -> Hierarchy {
        let Self { places, order, mut stencils, counts, .. } = self;
        let places: Vec<[i32; 3]> = order.iter().map(|&point| places[point as usize]).collect();
        with_wide_registers(
            #[inline(always)]
            || set_weights(&places, &counts, &mut stencils),
        );
        let runs = runs(&stencils);
        Hierarchy { order, stencils, runs }
    }
}

/// The ends of the runs of these places.
#[expect(clippy::cast_possible_truncation, reason = "points are numbered with 32 bits")]
fn runs(stencils: &[Stencil]) -> Vec<u32> {
    let (mut runs, mut start) = (Vec::new(), 0);
    for (place, stencil) in stencils.iter().enumerate() {
        let leans = stencil.places.iter().any(|&other| other as usize >= start);
        if place > start && (leans || place % BLOCK == 0) {
            runs.push(place as u32);
            start = place;
        }
    }
    if !stencils.is_empty() {
        runs.push(stencils.len() as u32);
    }
    runs
}

/// Weighs the neighbours of stencils, four at a time.
#[inline(always)]
fn set_weights(places: &[[i32; 3]], counts: &[u8], stencils: &mut [Stencil]) {
    for (chunk, four) in stencils.chunks_mut(LANES).enumerate() {
        let mut of = [Neighbours::NONE; LANES];
        for (lane, of) in of.iter_mut().enumerate() {
            // Behind the last one stand copies of it.
            let index = lane.min(four.len() - 1);
            let place = LANES * chunk + index;
            of.count = usize::from(counts[place]);
            for neighbour in 0..NEIGHBOURS {
                of.places[neighbour] = places[four[index].places[neighbour] as usize];
                of.squares[neighbour] = square(of.places[neighbour], places[place]);
            }
        }
        for (stencil, weights) in four.iter_mut().zip(weights(&of)) {
            stencil.weights = weights;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The edges of a grid of points, with one diagonal in each square.
    fn grid(side: u32) -> (Vec<[i32; 3]>, Vec<[u32; 2]>) {
        let mut places = Vec::new();
        let mut edges = Vec::new();
        for y in 0..side {
            for x in 0..side {
                places.push([x as i32 * 100, y as i32 * 100, 0]);
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
        (places, edges)
    }

    #[test]
    fn every_point_stands_once_and_behind_those_it_is_predicted_from() {
        let (places, edges) = grid(40);
        let hierarchy = Hierarchy::new(&places, edges.iter().copied());
        let mut order = hierarchy.order().to_vec();
        order.sort_unstable();
        assert!(order.into_iter().eq(0..1600));
        for (place, stencil) in (0u32..).zip(hierarchy.stencils()).skip(1) {
            let sum: f32 = stencil.weights.iter().sum();
            assert!((sum - 1.0).abs() < 1e-5, "{sum}");
            for (&other, &weight) in stencil.places.iter().zip(&stencil.weights) {
                assert!(other < place || weight == 0.0);
            }
        }
        let full = hierarchy.stencils().iter().filter(|stencil| stencil.weights[7] != 0.0).count();
        assert!(full > 800, "{full}");
    }

    #[test]
    fn no_place_is_predicted_from_another_of_its_run() {
        let (places, edges) = grid(40);
        let hierarchy = Hierarchy::new(&places, edges.iter().copied());
        let mut next = 0;
        for run in hierarchy.runs() {
            assert_eq!(run.start, next);
            assert!(run.end > next && run.start / BLOCK == (run.end - 1) / BLOCK);
            next = run.end;
            let others = hierarchy.stencils()[run.clone()].iter().flat_map(|of| of.places);
            assert!(run.start == 0 || others.into_iter().all(|other| (other as usize) < run.start));
        }
        assert_eq!(next, 1600);
        assert!(hierarchy.runs().count() < 200);
        assert_eq!(Hierarchy::new(&[], std::iter::empty()).runs().count(), 0);
    }

    #[test]
    fn points_without_edges_and_points_with_very_many_have_their_place() {
        let places: Vec<[i32; 3]> = (0..500).map(|x| [x, 0, 0]).collect();
        assert_eq!(Hierarchy::new(&places, std::iter::empty()).len(), 500);
        let star = (1..500).map(|leaf| [0, leaf]);
        assert_eq!(Hierarchy::new(&places, star).len(), 500);
        let other_star = (0..499).map(|leaf| [499, leaf]);
        assert_eq!(Hierarchy::new(&places, other_star).len(), 500);
        assert!(Hierarchy::new(&[], std::iter::empty()).is_empty());
    }
}
