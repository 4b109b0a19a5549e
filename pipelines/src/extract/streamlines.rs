//! Lines along a vector field, by the method of Dormand and Prince.
//!
//! A rank follows a line as far as it has the cells. The point that it cannot look at is told to
//! all; the rank that has it goes on, in the middle of the step, so that the steps are those
//! that one process takes. A point that no rank has lies outside, and the step is halved.
//!
//! J. R. Dormand and P. J. Prince, "A family of embedded Runge-Kutta formulae", Journal of
//! Computational and Applied Mathematics 6 (1980).

use std::sync::Arc;

use tombolo_deform::bounds::Bounds;
use tombolo_deform::communicator::{Communicator, Reader, Reduction, Writer};
use tombolo_deform::distributed::DistributedError;
use tombolo_deform::mesh::{Cells, Vector};
use tombolo_deform::vector::{distance, length};

use super::ExtractError;
use super::gather::{Rows, weighted};
use super::input::Input;
use super::layout::Layout;
use super::pattern::{Base, Pattern};
use super::probe::{Finder, Found, keys};
use super::source::{Origin, Source};
use crate::language::{Direction, Streamlines};
use crate::limits::Limit;

/// The weights of the slopes at each stage; the last are those of the result.
const STAGES: [&[f64]; 6] = [
    &[1.0 / 5.0],
    &[3.0 / 40.0, 9.0 / 40.0],
    &[44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0],
    &[19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0],
    &[9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0],
    &[35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
];
/// The weights of the difference between the results of order 5 and 4.
const DIFFERENCE: [f64; 7] = [
    71.0 / 57600.0,
    0.0,
    -71.0 / 16695.0,
    71.0 / 1920.0,
    -17253.0 / 339200.0,
    22.0 / 525.0,
    -1.0 / 40.0,
];

/// The shortest and the longest step, and the first, in diagonals of the cell.
const SHORTEST: f64 = 1e-3;
const LONGEST: f64 = 0.5;
const FIRST: f64 = 0.1;

/// How far and how exactly lines are followed.
pub(super) struct Settings {
    pub(super) max_length: f64,
    pub(super) max_steps: u32,
    /// As part of the diagonal of the cell.
    pub(super) error: f64,
    /// The speed below which a line ends.
    pub(super) least_speed: f64,
    /// How many points a rank may have of all lines; they end beyond it.
    pub(super) points: Limit,
}

/// The cells of a rank and the field in them.
pub(super) struct Ground<'a> {
    finder: &'a Finder<'a>,
    /// The number by which all ranks know a cell.
    key: &'a dyn Fn(u32) -> u64,
    /// The field where a point was found.
    field: &'a dyn Fn(&Found) -> Vector,
}

/// A point of a line on the rank that has it.
pub(super) struct Reached {
    /// The line: twice its seed, and 1 more against the flow.
    pub(super) line: u32,
    /// How many points of the line lie between it and the seed, and one more.
    pub(super) step: u32,
    pub(super) point: Vector,
    pub(super) time: f64,
    pub(super) found: Found,
}

/// A line under way.
#[derive(Debug, Clone)]
struct Line {
    number: u32,
    /// Steps that were taken.
    steps: u32,
    /// Steps that were tried since one was taken.
    tries: u32,
    point: Vector,
    /// The time of the next step.
    step: f64,
    time: f64,
    length: f64,
    /// The diagonal of the cell that the point lies in.
    size: f64,
    /// How many of the slopes are known.
    stage: usize,
    slopes: [Vector; 7],
}

/// How a line ended on this rank.
enum Outcome {
    Ended,
    /// It needs the field at this point, which this rank does not have.
    Needs(Vector),
}

impl Line {
    fn new(number: u32, seed: Vector) -> Self {
        Self {
            number,
            steps: 0,
            tries: 0,
            point: seed,
            step: 0.0,
            time: 0.0,
            length: 0.0,
            size: 0.0,
            stage: 0,
            slopes: [[0.0; 3]; 7],
        }
    }

    /// The point at which the next slope is looked for.
    fn ahead(&self) -> Vector {
        let Some(weights) = self.stage.checked_sub(1).and_then(|stage| STAGES.get(stage)) else {
            return self.point;
        };
        let by = self.weighted(weights);
        [0, 1, 2].map(|axis| self.point[axis] + self.step * by[axis])
    }

    fn weighted(&self, weights: &[f64]) -> Vector {
        let mut sum = [0.0; 3];
        for (weight, slope) in weights.iter().zip(&self.slopes) {
            (0..3).for_each(|axis| sum[axis] += weight * slope[axis]);
        }
        sum
    }

    /// The sign of time.
    fn sign(&self) -> f64 {
        if self.number.is_multiple_of(2) { 1.0 } else { -1.0 }
    }

    /// Keeps the step within its bounds at the point.
    fn bound(&mut self, settings: &Settings) {
        let speed = length(self.slopes[0]);
        let left = (settings.max_length - self.length).max(0.0);
        let longest = (LONGEST * self.size).min(left);
        if self.step * speed > longest {
            self.step = longest / speed;
        }
    }

    /// Tries half of the step from the same point; `false` where it is too short.
    fn halve(&mut self) -> bool {
        if self.stage == 0 || self.step * length(self.slopes[0]) < SHORTEST * self.size {
            return false;
        }
        self.step /= 2.0;
        self.tries += 1;
        self.stage = 1;
        self.tries < 60
    }

    /// Takes in the slope at the point ahead; `None` where the line ends.
    fn take(
        &mut self,
        slope: Vector,
        size: f64,
        found: Found,
        settings: &Settings,
        reached: &mut Vec<Reached>,
    ) -> Option<()> {
        let slope = slope.map(|part| self.sign() * part);
        if self.stage > 0 && !slope.iter().all(|part| part.is_finite()) {
            // Where the field is absent, as where there is no cell.
            return self.halve().then_some(());
        }
        let ahead = self.ahead();
        self.slopes[self.stage] = slope;
        if self.stage == 0 {
            self.size = size;
            reached.push(self.reached(found));
            let speed = length(slope);
            if speed.is_nan() || speed <= settings.least_speed {
                return None;
            }
            self.step = FIRST * size / speed;
            self.bound(settings);
            self.stage = 1;
            return Some(());
        }
        if self.stage < 6 {
            self.stage += 1;
            return Some(());
        }
        let error = self.step * length(self.weighted(&DIFFERENCE));
        let allowed = settings.error * self.size;
        if error > allowed && self.halve() {
            return Some(());
        }
        // Taken.
        self.length += distance(self.point, ahead);
        self.time += self.sign() * self.step;
        (self.point, self.size) = (ahead, size);
        self.steps += 1;
        self.tries = 0;
        reached.push(self.reached(found));
        let speed = length(slope);
        let is_over = self.steps >= settings.max_steps
            || self.length >= settings.max_length * (1.0 - 1e-9)
            || speed.is_nan()
            || speed <= settings.least_speed;
        if is_over {
            return None;
        }
        // The error grows with the fifth power of the step: twice the step, 32 times the error.
        if error < allowed / 64.0 {
            self.step *= 2.0;
        }
        self.slopes[0] = slope;
        self.bound(settings);
        self.stage = 1;
        Some(())
    }

    fn reached(&self, found: Found) -> Reached {
        let Self { number: line, steps: step, point, time, .. } = *self;
        Reached { line, step, point, time, found }
    }

    /// Follows the line as far as this rank can.
    fn advance(
        &mut self,
        ground: &Ground,
        settings: &Settings,
        reached: &mut Vec<Reached>,
    ) -> Outcome {
        // More points are refused, and need not be found first.
        while settings.points.check(reached.len()).is_ok() {
            let ahead = self.ahead();
            let Some(found) = ground.finder.find(ahead, ground.key) else {
                return Outcome::Needs(ahead);
            };
            let (slope, size) = ((ground.field)(&found), ground.finder.size(found.cell));
            if self.take(slope, size, found, settings, reached).is_none() {
                return Outcome::Ended;
            }
        }
        Outcome::Ended
    }

    fn write(&self, message: &mut Writer) {
        message.u32(self.number);
        message.u32(self.steps);
        message.u32(self.tries);
        message.u64(self.stage as u64);
        message.f64s(&[self.step, self.time, self.length, self.size]);
        message.f64s(&self.point);
        self.slopes.iter().for_each(|slope| message.f64s(slope));
    }

    fn read(reader: &mut Reader) -> Result<Self, DistributedError> {
        let (number, steps, tries) = (reader.u32()?, reader.u32()?, reader.u32()?);
        let stage = usize::try_from(reader.u64()?).unwrap_or(usize::MAX);
        if stage > 6 {
            return Err(reader.garbled().into());
        }
        let numbers = reader.f64s(4)?;
        let [step, time, length, size] = [0, 1, 2, 3].map(|index| numbers[index]);
        let point = reader.vector()?;
        let mut slopes = [[0.0; 3]; 7];
        for slope in &mut slopes {
            *slope = reader.vector()?;
        }
        Ok(Self { number, steps, tries, point, step, time, length, size, stage, slopes })
    }
}

/// Follows lines from seeds, which all ranks have; `numbers` are the lines to follow, each twice the
/// number of its seed, and 1 more against the flow. Each rank gets the points that it has.
/// Collective.
pub(super) fn follow(
    communicator: &dyn Communicator,
    ground: &Ground,
    seeds: &[Vector],
    numbers: &[u32],
    settings: &Settings,
) -> Result<Vec<Reached>, DistributedError> {
    let mut reached = Vec::new();
    let (rank, size) = (communicator.rank(), communicator.size());
    // All ranks begin with all lines in turn, and hand on those whose seeds they do not have.
    let own = numbers.iter().filter(|&&number| number as usize / 2 % size == rank);
    let mut lines: Vec<Line> =
        own.map(|&number| Line::new(number, seeds[number as usize / 2])).collect();
    loop {
        let mut stopped: Vec<(Line, Vector)> = Vec::new();
        for mut line in lines.drain(..) {
            loop {
                match line.advance(ground, settings, &mut reached) {
                    Outcome::Ended => break,
                    Outcome::Needs(_) if size == 1 => {
                        if !line.halve() {
                            break;
                        }
                    }
                    Outcome::Needs(point) => {
                        stopped.push((line, point));
                        break;
                    }
                }
            }
        }
        if size == 1 {
            return Ok(reached);
        }
        // Which rank has the points that others need.
        let mut message = Writer::default();
        stopped.iter().for_each(|(_, point)| message.f64s(point));
        let messages = communicator.gather_all(&message.into_bytes());
        if messages.iter().all(Vec::is_empty) {
            return Ok(reached);
        }
        let mut keys = Vec::new();
        let mut first = 0;
        for (from, bytes) in messages.iter().enumerate() {
            if from == rank {
                first = keys.len();
            }
            let mut reader = Reader::new(from, bytes);
            while !reader.is_empty() {
                let point = reader.vector()?;
                let found = Some(point).filter(|_| from != rank);
                let found = found.and_then(|point| ground.finder.find(point, ground.key));
                keys.push(found.map_or(u64::MAX, |found| (ground.key)(found.cell)));
            }
        }
        let mut least = keys.clone();
        communicator.reduce_integers(Reduction::Minimum, &mut least);
        let is_own = |(own, least): (&u64, &u64)| own == least && *own < u64::MAX;
        let rank_of = |pair| if is_own(pair) { rank as u64 } else { u64::MAX };
        let mut ranks: Vec<u64> = keys.iter().zip(&least).map(rank_of).collect();
        communicator.reduce_integers(Reduction::Minimum, &mut ranks);
        let mut leaving: Vec<Writer> = (0..size).map(|_| Writer::default()).collect();
        for (index, (mut line, _)) in stopped.into_iter().enumerate() {
            match usize::try_from(ranks[first + index]).ok().and_then(|to| leaving.get_mut(to)) {
                Some(message) => line.write(message),
                None if line.halve() => lines.push(line),
                None => {}
            }
        }
        let leaving = leaving.into_iter().enumerate();
        let leaving = leaving.filter(|(_, message)| !message.is_empty());
        let leaving = leaving.map(|(to, message)| (to, message.into_bytes())).collect();
        let mut arriving = communicator.exchange(leaving);
        arriving.sort_by_key(|(from, _)| *from);
        for (from, bytes) in arriving {
            let mut reader = Reader::new(from, &bytes);
            while !reader.is_empty() {
                lines.push(Line::read(&mut reader)?);
            }
        }
    }
}

/// The field that says the time from the seed.
pub(super) const TIME: &str = "integration_time";

/// The lines from these seeds but for their fields, and the time of each point of this rank.
/// Collective.
///
/// # Errors
/// [`ExtractError::Distributed`]; [`ExtractError::Exceeded`] on a rank where the lines have more
/// than `limit` points, and [`ExtractError::Elsewhere`] on the others.
pub(super) fn pattern(
    source: &Source,
    input: &Input,
    vectors: &[Vector],
    seeds: &[Vector],
    stage: &Streamlines,
    limit: Limit,
) -> Result<(Pattern, Vec<f64>), ExtractError> {
    let communicator = input.communicator;
    let points = &source.positions.points;
    let bounds = Bounds::around(points.iter().copied()).of_ranks(communicator);
    let speeds = vectors.iter().map(|vector| length(*vector));
    let fastest = speeds.filter(|speed| speed.is_finite()).fold(0.0, f64::max);
    let fastest = communicator.reduced(Reduction::Maximum, fastest);
    let settings = Settings {
        max_length: stage.max_length.unwrap_or(5.0 * bounds.diagonal()),
        max_steps: u32::try_from(stage.max_steps).unwrap_or(u32::MAX),
        error: stage.error,
        least_speed: 1e-12 * fastest,
        points: limit,
    };
    let finder = Finder::kept(source);
    let field = |found: &Found| weighted(&found.row, vectors);
    #[expect(clippy::cast_possible_truncation, reason = "a limited number of seeds")]
    let of_seed = |seed: usize| {
        let (forward, backward) = (2 * seed as u32, 2 * seed as u32 + 1);
        match stage.direction {
            Direction::Both => vec![forward, backward],
            Direction::Forward => vec![forward],
            Direction::Backward => vec![backward],
        }
    };
    let numbers: Vec<u32> = (0..seeds.len()).flat_map(of_seed).collect();
    let key = keys(source, input);
    let ground = Ground { finder: &finder, key: &key, field: &field };
    let mut reached = follow(communicator, &ground, seeds, &numbers, &settings)?;
    let is_bounded = limit.check(reached.len());
    if !communicator.all(is_bounded.is_ok()) {
        is_bounded?;
        return Err(ExtractError::Elsewhere);
    }
    reached.sort_by_key(|it| (it.line, it.step));

    // How many points each line has, over all ranks.
    let mut counts = vec![0_u64; 2 * seeds.len()];
    for Reached { line, step, .. } in &reached {
        let count = &mut counts[*line as usize];
        *count = (*count).max(u64::from(*step) + 1);
    }
    communicator.reduce_integers(Reduction::Maximum, &mut counts);
    #[expect(clippy::cast_possible_truncation, reason = "counts of what lies in memory")]
    let count = |line: usize| counts[line] as usize;
    let mut starts = vec![0];
    for seed in 0..seeds.len() {
        let (forward, backward) = (count(2 * seed), count(2 * seed + 1));
        // Both have the seed.
        let all = forward + backward - usize::from(forward > 0 && backward > 0);
        starts.push(starts[seed] + all);
    }
    let index = |line: u32, step: u32| {
        let (line, step) = (line as usize, step as usize);
        let (seed, before) = (line / 2, count(line | 1).saturating_sub(1));
        if line % 2 == 0 { starts[seed] + before + step } else { starts[seed] + before - step }
    };
    let is_twice =
        |it: &Reached| it.line % 2 == 1 && it.step == 0 && count(it.line as usize - 1) > 0;
    reached.retain(|it| !is_twice(it));
    reached.sort_by_key(|it| index(it.line, it.step));

    let is_outside = |seed: &usize| starts[*seed] == starts[*seed + 1];
    let first_outside = (0..seeds.len()).find(is_outside).map(|seed| seeds[seed]);
    let all = starts[seeds.len()];
    let layout = Layout {
        counts: None,
        points: all,
        asked: seeds.len(),
        outside: (0..seeds.len()).filter(is_outside).count(),
        told: first_outside.filter(|_| communicator.rank() == 0),
        lines: Some(starts.clone().into()),
    };
    let mut rows = Rows::default();
    let (mut indices, mut owners, mut taken) = (Vec::new(), Vec::new(), Vec::new());
    let mut numbers = vec![u32::MAX; all];
    let mut times = Vec::with_capacity(reached.len());
    for Reached { line, step, point, time, found } in reached {
        let index = index(line, step);
        #[expect(clippy::cast_possible_truncation, reason = "points are numbered with 32 bits")]
        {
            numbers[index] = taken.len() as u32;
            indices.push(index as u32);
        }
        rows.push(found.row);
        owners.push(found.cell);
        taken.push(point);
        times.push(time);
    }
    // Those of several ranks hang together once they are merged.
    let cells = if communicator.size() > 1 { Cells::new() } else { layout.cells(&numbers)? };
    let pattern = Pattern {
        points: taken,
        base: Base::Probe(layout.clone(), rows),
        cells: Arc::new(cells),
        owners: owners.into(),
        origin: Origin::Probe(layout, indices.into()),
    };
    Ok((pattern, times))
}

#[cfg(test)]
mod tests {
    use tombolo_deform::communicator::Solo;
    use tombolo_deform::distributed::Part;
    use tombolo_deform::shapes::box_of_tets;

    use super::*;
    use crate::extract::Channel;
    use crate::language::{Seeds, Streamlines};
    use crate::limits::LINE_POINTS;

    /// Eight lines of a field that turns, of some hundred points each.
    fn turning(
        part: &Part,
        communicator: &dyn Communicator,
        most: usize,
    ) -> Result<usize, ExtractError> {
        let channel = Channel::new("fluid", part.view(), &[]);
        let mut source = Source::new(&channel)?;
        let input = Input { channel: &channel, cycle: 0, wanted: &|_| false, communicator };
        source.update(&input)?;
        let vectors: Vec<Vector> =
            part.points.iter().map(|[x, y, _]| [0.5 - y, x - 0.5, 0.0]).collect();
        let seeds: Vec<Vector> =
            (0..8).map(|seed| [0.6, 0.5, 0.1 * f64::from(seed) + 0.1]).collect();
        let stage = Streamlines {
            field: "u".into(),
            seeds: Seeds::Points(seeds.clone()),
            direction: Direction::Forward,
            max_length: Some(1e3),
            max_steps: 300,
            error: 1e-6,
        };
        let limit = Limit { most, ..LINE_POINTS };
        let (pattern, _) = pattern(&source, &input, &vectors, &seeds, &stage, limit)?;
        Ok(pattern.points.len())
    }

    /// A field may be absent in a part of the mesh.
    #[test]
    fn lines_end_where_the_field_does() {
        let mesh = box_of_tets([8, 4, 4], [0.0; 3], [2.0, 1.0, 1.0]);
        let part = Part::whole(&mesh).unwrap();
        let channel = Channel::new("fluid", part.view(), &[]);
        let mut source = Source::new(&channel).unwrap();
        let input = Input { channel: &channel, cycle: 0, wanted: &|_| false, communicator: &Solo };
        source.update(&input).unwrap();
        let finder = Finder::kept(&source);
        // Keys are asked for of the cells that a point may lie in.
        assert!(finder.find([f64::NAN; 3], &|cell| panic!("cell {cell}")).is_none());
        let field = |found: &Found| {
            let is_there = |&(vertex, _): &(u32, f64)| part.points[vertex as usize][0] <= 1.0;
            let is_there = found.row.iter().all(is_there);
            [if is_there { 1.0 } else { f64::NAN }, 0.0, 0.0]
        };
        let ground = Ground { finder: &finder, key: &u64::from, field: &field };
        let seeds = [[0.3, 0.41, 0.37], [0.1, 0.83, 0.22]];
        let settings = Settings {
            max_length: 10.0,
            max_steps: 1000,
            error: 1e-6,
            least_speed: 1e-12,
            points: LINE_POINTS,
        };
        let reached = follow(&Solo, &ground, &seeds, &[0, 2], &settings).unwrap();
        for line in [0, 2] {
            let ends = reached.iter().filter(|it| it.line == line).map(|it| it.point[0]);
            let end = ends.fold(0.0, f64::max);
            assert!((0.99..=1.0).contains(&end), "{end}");
        }
    }

    #[test]
    fn lines_of_too_many_points_are_refused() {
        let mesh = box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]);
        let whole = Part::whole(&mesh).unwrap();
        let all = turning(&whole, &Solo, 1 << 20).unwrap();
        assert_eq!(all, 8 * 301);
        assert_eq!(turning(&whole, &Solo, all).unwrap(), all);
        let error = turning(&whole, &Solo, 1000).unwrap_err();
        assert_eq!(error.to_string(), "found 1001 points, expected at most 1000");
    }
}
