//! A curve of a skeleton as the axis of a tube: where along it a point lies, and how its frames
//! turn when it bends.

use super::Skeleton;
use super::drag::is_free_loop;
use super::rotation::{Rotation, direction, smooth_step, transported};
use crate::mesh::Vector;
use crate::vector::{add, distance, dot, scale, subtract};

/// The axis of a curve. Skeletons are rough, so positions and tangents are those of parabolas
/// fitted to the nodes within one local radius, each weighted by the length it stands for: the axis
/// does not depend on how densely nodes lie.
#[derive(Debug, Clone)]
pub(super) struct Axis {
    /// The nodes of the skeleton; those of a closed axis without the first one again.
    nodes: Vec<u32>,
    /// Arc length from the first node.
    lengths: Vec<f64>,
    /// The whole length of a closed axis.
    period: Option<f64>,
    /// The parabolas fitted to the nodes.
    fits: Vec<Fit>,
    /// The parabolas fitted to the means of the vertices that nodes carry, where these lie along
    /// the axis.
    carried_fits: Vec<Fit>,
    radii: Vec<f64>,
    /// How much of its turn each node makes: none at a branch node, all of it one radius away.
    turns: Vec<f64>,
    points: Vec<Vector>,
    slopes: Vec<Vector>,
    tangents: Vec<Vector>,
}

/// A parabola fitted around a node, as weights of the nodes from `first` on (counted around a
/// closed axis): of its value and of its slope at the node.
#[derive(Debug, Clone)]
struct Fit {
    first: usize,
    weights: Vec<[f64; 2]>,
}

/// A position on an axis: a part of the way from a node to the next.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Station {
    node: u32,
    next: u32,
    fraction: f64,
    length: f64,
}

impl Axis {
    /// The axis of a curve, where `radii` are those of the nodes of the skeleton and `surface` are
    /// the points of its surface.
    pub fn new(skeleton: &Skeleton, curve: usize, radii: &[f64], surface: &[Vector]) -> Self {
        let closed = is_free_loop(skeleton, curve);
        let mut nodes = skeleton.curves()[curve].nodes().to_vec();
        let at = |node: u32| skeleton.nodes()[node as usize];
        let mut lengths = vec![0.0];
        for pair in nodes.windows(2) {
            lengths.push(lengths[lengths.len() - 1] + distance(at(pair[0]), at(pair[1])));
        }
        let whole = lengths[lengths.len() - 1];
        let period = closed.then(|| {
            nodes.pop();
            lengths.pop();
            whole
        });
        let reference: Vec<Vector> = nodes.iter().map(|&node| at(node)).collect();
        let own: Vec<f64> = nodes.iter().map(|&node| radii[node as usize]).collect();
        let mut axis = Self {
            turns: vec![1.0; nodes.len()],
            fits: Vec::new(),
            carried_fits: Vec::new(),
            radii: own.clone(),
            points: Vec::new(),
            slopes: Vec::new(),
            tangents: Vec::new(),
            nodes,
            lengths,
            period,
        };
        // Near an end as many nodes as elsewhere, though they are all on one side.
        let reach = |node: usize, radius: f64| match period {
            Some(_) => radius,
            None => (2.0 * radius - axis.lengths[node].min(whole - axis.lengths[node])).max(radius),
        };
        let reaches: Vec<f64> =
            own.iter().enumerate().map(|(node, &radius)| reach(node, radius)).collect();
        let fit_all = |axis: &Self, leads: &[Option<f64>]| {
            reaches.iter().enumerate().map(|(node, &reach)| axis.fit(node, reach, leads)).collect()
        };
        axis.fits = fit_all(&axis, &vec![Some(0.0); own.len()]);
        let lift: Vec<Vector> = own.iter().map(|&radius| [radius, 0.0, 0.0]).collect();
        axis.radii = smooth(&axis.fits, &lift, 0)
            .iter()
            .zip(&own)
            .map(|(fit, own)| fit[0].max(0.5 * own))
            .collect();
        (axis.points, axis.slopes) =
            (smooth(&axis.fits, &reference, 0), smooth(&axis.fits, &reference, 1));
        axis.tangents = directions(&axis.slopes);
        let leads = axis.mean_leads(skeleton, surface);
        axis.carried_fits = fit_all(&axis, &leads);
        if !closed {
            let branch = |node: u32| skeleton.degree(node as usize) > 2;
            let [first, last] = [axis.nodes[0], axis.nodes[axis.nodes.len() - 1]];
            for (node, turn) in axis.turns.iter_mut().enumerate() {
                for (end, away) in [(first, axis.lengths[node]), (last, whole - axis.lengths[node])]
                {
                    let radius = radii[end as usize];
                    if branch(end) && away < radius {
                        *turn *= smooth_step(away / radius);
                    } else if branch(end) && away == 0.0 {
                        *turn = 0.0;
                    }
                }
            }
        }
        axis
    }

    /// The nodes of the skeleton along the axis.
    pub fn nodes(&self) -> &[u32] {
        &self.nodes
    }

    /// How far a node lies ahead of another in terms of arc length, across the start of a closed
    /// axis where that is shorter.
    fn ahead(&self, from: usize, to: usize) -> f64 {
        let ahead = self.lengths[to] - self.lengths[from];
        self.period.map_or(ahead, |period| ahead - (ahead / period).round() * period)
    }

    fn next(&self, node: usize) -> Option<usize> {
        match (node + 1 < self.nodes.len(), self.period) {
            (true, _) => Some(node + 1),
            (false, Some(_)) => Some(0),
            (false, None) => None,
        }
    }

    fn before(&self, node: usize) -> Option<usize> {
        match (node, self.period) {
            (0, Some(_)) => Some(self.nodes.len() - 1),
            (0, None) => None,
            _ => Some(node - 1),
        }
    }

    /// The length of the segment from a node to the next.
    fn segment(&self, node: usize, next: usize) -> f64 {
        if next > node {
            self.lengths[next] - self.lengths[node]
        } else {
            self.period.unwrap_or(0.0) - self.lengths[node]
        }
    }

    /// Fits a parabola around a node to samples within a distance, that lie ahead of their nodes by
    /// `leads` (`None`: none).
    fn fit(&self, node: usize, within: f64, leads: &[Option<f64>]) -> Fit {
        let count = self.nodes.len();
        let wanted = leads.iter().flatten().count().min(if self.period.is_some() { 3 } else { 4 });
        let most = if self.period.is_some() { (count - 1) / 2 } else { count };
        let offset = |index: usize| leads[index].map(|lead| self.ahead(node, index) + lead);
        // The samples within the distance, and so many more that a parabola has enough of them.
        let mut reach = within;
        let mut found = usize::from(leads[node].is_some());
        let [mut low, mut high] = [(0, node), (0, node)];
        loop {
            let next = |(steps, index): (usize, usize), next: Option<usize>| match next {
                Some(next) if steps < most => (self.ahead(node, next).abs(), (steps + 1, next)),
                _ => (f64::INFINITY, (steps, index)),
            };
            let below = next(low, self.before(low.1));
            let above = next(high, self.next(high.1));
            let nearest = below.0.min(above.0);
            if nearest == f64::INFINITY || (nearest >= within && found >= wanted) {
                break;
            }
            let side = if below.0 <= above.0 { &mut low } else { &mut high };
            *side = if below.0 <= above.0 { below.1 } else { above.1 };
            let index = side.1;
            if let Some(offset) = offset(index) {
                found += 1;
                if nearest >= within {
                    reach = reach.max(1.25 * offset.abs());
                }
            }
        }
        let (first, steps) = (low.1, low.0 + high.0);
        let share = |index: usize| {
            let before = self.before(index).map_or(0.0, |before| self.segment(before, index));
            0.5 * (before + self.next(index).map_or(0.0, |next| self.segment(index, next)))
        };
        let terms: Vec<(f64, f64)> = (0..=steps)
            .map(|step| (first + step) % count)
            .map(|index| match offset(index).map(|offset| offset / reach) {
                Some(offset) => {
                    ((1.0 - offset.abs().powi(3)).max(0.0).powi(3) * share(index), offset)
                }
                None => (0.0, 0.0),
            })
            .collect();
        let m: [f64; 5] = std::array::from_fn(|power| {
            terms.iter().map(|(weight, offset)| weight * offset.powi(power as i32)).sum()
        });
        // The first two rows of the inverse of the matrix m[i + j], by cofactors.
        let cofactors = [
            [m[2] * m[4] - m[3] * m[3], m[2] * m[3] - m[1] * m[4], m[1] * m[3] - m[2] * m[2]],
            [m[2] * m[3] - m[1] * m[4], m[0] * m[4] - m[2] * m[2], m[1] * m[2] - m[0] * m[3]],
        ];
        let determinant = m[0] * cofactors[0][0] + m[1] * cofactors[0][1] + m[2] * cofactors[0][2];
        if determinant.abs() <= 1e-9 * m[0] * m[0] * m[0] || !determinant.is_finite() {
            return self.difference(node);
        }
        let row = |cofactors: [f64; 3], weight: f64, offset: f64| {
            weight * (cofactors[0] + offset * (cofactors[1] + offset * cofactors[2])) / determinant
        };
        let weights = terms
            .iter()
            .map(|&(weight, offset)| {
                [row(cofactors[0], weight, offset), row(cofactors[1], weight, offset) / reach]
            })
            .collect();
        Fit { first, weights }
    }

    /// The node itself and the slope between its neighbours, where no parabola can be fitted.
    fn difference(&self, node: usize) -> Fit {
        let first = self.before(node).unwrap_or(node);
        let last = self.next(node).unwrap_or(node);
        let steps = (last + self.nodes.len() - first) % self.nodes.len();
        let length = self.ahead(node, last) - self.ahead(node, first);
        let slope = if length > 0.0 { 1.0 / length } else { 0.0 };
        let mut weights = vec![[0.0; 2]; steps + 1];
        weights[0][1] -= slope;
        weights[steps][1] += slope;
        weights[(node + self.nodes.len() - first) % self.nodes.len()][0] = 1.0;
        Fit { first, weights }
    }

    /// How far the vertices that each node carries lie ahead of it on the mean; `None` where it
    /// carries none.
    fn mean_leads(&self, skeleton: &Skeleton, surface: &[Vector]) -> Vec<Option<f64>> {
        let mut indices = vec![None; skeleton.nodes().len()];
        for (index, &node) in self.nodes.iter().enumerate() {
            indices[node as usize] = Some(index);
        }
        let mut sums = vec![(0.0, 0u32); self.nodes.len()];
        for (&point, &node) in surface.iter().zip(skeleton.node_of_vertex()) {
            if let Some(index) = indices[node as usize] {
                let (sum, count) = &mut sums[index];
                *sum += self.lead(point, index);
                *count += 1;
            }
        }
        sums.into_iter().map(|(sum, count)| (count > 0).then(|| sum / f64::from(count))).collect()
    }

    /// How far a point lies ahead of a node, along its tangent.
    fn lead(&self, point: Vector, node: usize) -> f64 {
        dot(subtract(point, self.points[node]), self.tangents[node])
    }

    /// The station whose normal plane a point lies in: the first one met from `start` on (an index
    /// along the axis). Points before the start of an open axis or beyond its end belong to the
    /// end; those whose plane is not found nearby to `start` itself.
    pub fn station(&self, point: Vector, start: usize) -> Station {
        let spacing = self.next(start).map_or(0.0, |next| self.segment(start, next));
        let limit = 2.0 * distance(point, self.points[start]) + spacing;
        let mut node = start;
        for _ in 0..self.nodes.len() {
            if self.ahead(start, node).abs() > limit {
                return self.at(start, 0.0);
            }
            if self.lead(point, node) < 0.0 {
                match self.before(node) {
                    Some(before) if self.lead(point, before) >= 0.0 => {
                        return self.between(point, before);
                    }
                    Some(before) => node = before,
                    None => return self.at(node, 0.0),
                }
            } else {
                match self.next(node) {
                    Some(next) if self.lead(point, next) < 0.0 => return self.between(point, node),
                    Some(next) => node = next,
                    None => return self.at(node, 0.0),
                }
            }
        }
        self.at(start, 0.0)
    }

    fn at(&self, node: usize, fraction: f64) -> Station {
        // The last node of an open axis is the end of the segment before it.
        let (node, fraction) = match (self.next(node), self.before(node)) {
            (None, Some(before)) => (before, 1.0),
            _ => (node, fraction),
        };
        let next = self.next(node).unwrap_or(node);
        Station { node: node as u32, next: next as u32, fraction, length: self.segment(node, next) }
    }

    /// The station between a node that the point is ahead of and the next, which it is behind.
    fn between(&self, point: Vector, node: usize) -> Station {
        let mut station = self.at(node, 0.0);
        let (from, to) = (station.node as usize, station.next as usize);
        let lead = |fraction: f64| {
            let center = Station { fraction, ..station }.cubic(&self.points, &self.slopes);
            let tangent =
                add(scale(self.tangents[from], 1.0 - fraction), scale(self.tangents[to], fraction));
            dot(subtract(point, center), tangent)
        };
        let ([mut low, mut high], [mut at_low, mut at_high]) = ([0.0, 1.0], [lead(0.0), lead(1.0)]);
        // Regula falsi, which halves the value of an end that stays (the Illinois rule).
        for _ in 0..12 {
            if !(at_low > 0.0 && at_high < 0.0) {
                break;
            }
            let middle: f64 = (low * at_high - high * at_low) / (at_high - at_low);
            let value = lead(middle);
            if value > 0.0 {
                (low, at_low, at_high) = (middle, value, 0.5 * at_high);
            } else {
                (high, at_high, at_low) = (middle, value, 0.5 * at_low);
            }
        }
        station.fraction = if at_low <= 0.0 { low } else { high };
        station
    }

    /// The index of the node nearest to a station.
    pub fn nearest(&self, station: Station) -> usize {
        if station.fraction < 0.5 { station.node as usize } else { station.next as usize }
    }

    /// The radius of the surface at a station.
    pub fn radius(&self, station: Station) -> f64 {
        self.radii[station.node as usize] * (1.0 - station.fraction)
            + self.radii[station.next as usize] * station.fraction
    }

    /// The largest radius along the axis.
    pub fn largest_radius(&self) -> f64 {
        self.radii.iter().copied().fold(0.0, f64::max)
    }

    /// The axis where edits below have moved what its nodes carry by `below` on the mean, and where
    /// it now bends by `moved`.
    pub fn bend(&self, below: &[Vector], moved: &[Vector]) -> Bent {
        let (mut points, mut slopes, mut tangents) =
            (self.points.clone(), self.slopes.clone(), self.tangents.clone());
        if below.iter().any(|moved| *moved != [0.0; 3]) {
            let plus = |a: &mut Vec<Vector>, b: Vec<Vector>| {
                a.iter_mut().zip(b).for_each(|(a, b)| *a = add(*a, b))
            };
            plus(&mut points, smooth(&self.carried_fits, below, 0));
            plus(&mut slopes, smooth(&self.carried_fits, below, 1));
            tangents = directions(&slopes);
        }
        let turned: Vec<Vector> = slopes
            .iter()
            .zip(smooth(&self.fits, moved, 1))
            .map(|(&slope, change)| add(slope, change))
            .collect();
        let mut rotations =
            transported(&tangents, &directions(&turned), &self.lengths, self.period);
        for (rotation, &turn) in rotations.iter_mut().zip(&self.turns) {
            *rotation = rotation.part(turn);
        }
        let moved_slopes = (0..moved.len()).map(|node| self.slope(moved, node)).collect();
        Bent { points, slopes, moved: moved.to_vec(), moved_slopes, rotations }
    }

    /// The slope of the parabola through a node and its neighbours; at an end, that of the segment.
    fn slope(&self, field: &[Vector], node: usize) -> Vector {
        let secant = |from: usize, to: usize| {
            let length = self.segment(from, to);
            scale(subtract(field[to], field[from]), if length > 0.0 { 1.0 / length } else { 0.0 })
        };
        match (self.before(node), self.next(node)) {
            (Some(before), Some(next)) => {
                let [h, k] = [self.segment(before, node), self.segment(node, next)];
                let [a, b] = [secant(before, node), secant(node, next)];
                if h + k > 0.0 { add(scale(a, k / (h + k)), scale(b, h / (h + k))) } else { a }
            }
            (None, Some(next)) => secant(node, next),
            (Some(before), None) => secant(before, node),
            (None, None) => [0.0; 3],
        }
    }
}

/// The values (`which` 0) or slopes (1) of the fitted parabolas of a field on the nodes.
fn smooth(fits: &[Fit], field: &[Vector], which: usize) -> Vec<Vector> {
    let value = |fit: &Fit| {
        let terms = fit.weights.iter().enumerate();
        terms.fold([0.0; 3], |sum, (step, weights)| {
            add(sum, scale(field[(fit.first + step) % field.len()], weights[which]))
        })
    };
    fits.iter().map(value).collect()
}

/// Unit vectors; where there is no direction, that of a neighbour.
fn directions(slopes: &[Vector]) -> Vec<Vector> {
    let found: Vec<Option<Vector>> = slopes.iter().map(|&slope| direction(slope)).collect();
    let mut last = found.iter().flatten().next().copied().unwrap_or([1.0, 0.0, 0.0]);
    found
        .into_iter()
        .map(|found| {
            last = found.unwrap_or(last);
            last
        })
        .collect()
}

impl Station {
    /// The cubic with these values and slopes at the nodes.
    fn cubic(self, values: &[Vector], slopes: &[Vector]) -> Vector {
        let (from, to, t) = (self.node as usize, self.next as usize, self.fraction);
        let s = 1.0 - t;
        let [a, b] = [s * s * (1.0 + 2.0 * t), t * t * (1.0 + 2.0 * s)];
        let [u, v] = [s * s * t * self.length, -t * t * s * self.length];
        [0, 1, 2].map(|axis| {
            a * values[from][axis]
                + b * values[to][axis]
                + u * slopes[from][axis]
                + v * slopes[to][axis]
        })
    }
}

/// A bent axis.
#[derive(Debug, Clone)]
pub(super) struct Bent {
    points: Vec<Vector>,
    slopes: Vec<Vector>,
    moved: Vec<Vector>,
    moved_slopes: Vec<Vector>,
    rotations: Vec<Rotation>,
}

impl Bent {
    /// How a point that belongs to a station moves: with the axis, and turning about it.
    pub fn displacement(&self, station: Station, point: Vector) -> Vector {
        let center = station.cubic(&self.points, &self.slopes);
        let rotation = self.rotations[station.node as usize]
            .blend(self.rotations[station.next as usize], station.fraction);
        add(
            station.cubic(&self.moved, &self.moved_slopes),
            rotation.change(subtract(point, center)),
        )
    }
}
