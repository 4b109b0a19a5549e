//! The cells and reference positions of a mesh, in one message.

use std::sync::OnceLock;

use super::CodecError;
use super::bits::{Bits, Model, Number, Reader, Writer};
use super::bytes::{Input, put_count};
use super::connectivity::{Across, Guide, Third, walk};
use super::hierarchy::Hierarchy;

/// The most points, triangles and lines together that a byte of a message stands for.
const PER_BYTE: usize = 1024;
/// The most points, triangles and lines together.
const MOST: usize = 1 << 27;
/// Positions are below it, in steps of their grid.
const MOST_STEPS: f64 = 268_435_456.0;

/// The cells and the reference positions of a mesh of triangles and lines, as they are decoded.
/// Points have the numbers of their places in the hierarchy.
#[derive(Debug, Clone)]
pub struct Topology {
    points: Hierarchy,
    places: Vec<[i32; 3]>,
    step: f64,
    offset: [f64; 3],
    triangles: Vec<[u32; 3]>,
    features: Option<Vec<u32>>,
    lines: Vec<[u32; 2]>,
    elements: OnceLock<Hierarchy>,
}

/// A topology, its message, and where everything came from.
#[derive(Debug, Clone)]
pub struct Coded {
    /// What will be decoded.
    pub topology: Topology,
    /// The bytes.
    pub message: Vec<u8>,
    /// For each point as it will be decoded, the point that it was.
    pub points: Vec<u32>,
    /// For each triangle as it will be decoded, the triangle that it was.
    pub triangles: Vec<u32>,
}

impl Topology {
    /// Codes the triangles, the feature of each, and the lines between these points, and their
    /// positions within `bound`. Triangles and points change their order, and a triangle may begin
    /// with another of its corners; lines stay as they are.
    ///
    /// # Errors
    /// [`CodecError::Point`] where a cell names a point that there is none of,
    /// [`CodecError::Length`] where there is not one feature for each triangle,
    /// [`CodecError::Positions`] where the positions are not finite or the bound is less than about
    /// 2⁻²⁹ of their extent.
    pub fn encode(
        points: &[[f64; 3]],
        triangles: &[[u32; 3]],
        features: Option<&[u32]>,
        lines: &[[u32; 2]],
        bound: f64,
    ) -> Result<Coded, CodecError> {
        let count = points.len();
        let named = triangles.as_flattened().iter().chain(lines.as_flattened());
        if let Some(&point) = named.clone().find(|&&point| point as usize >= count) {
            return Err(CodecError::Point { point, points: count });
        }
        let (found, expected) = (features.map_or(triangles.len(), <[u32]>::len), triangles.len());
        if found != expected {
            return Err(CodecError::Length { found, expected });
        }
        let total = count + triangles.len() + lines.len();
        check_total(total as u64, MOST)?;
        let (places, step, offset) = grid(points, bound).ok_or(CodecError::Positions)?;

        let mut message = Vec::new();
        put_count(&mut message, count);
        put_count(&mut message, triangles.len());
        put_count(&mut message, lines.len());
        message.push(u8::from(features.is_some()));
        message.extend(step.to_le_bytes());
        message.extend(offset.iter().flat_map(|offset| offset.to_le_bytes()));
        let mut bits = Writer::new();
        let mut from = From::new(&places, triangles, features, lines);
        let coded = code(&mut bits, &mut from, count, triangles.len(), lines.len())?;
        message.extend(bits.finish());
        message.resize(message.len().max(total.div_ceil(PER_BYTE)), 0);

        let From { old_points, old_triangles, .. } = from;
        let topology = Self::new(coded, step, offset, features.is_some());
        let order = topology.points.order();
        let points = order.iter().map(|&point| old_points[point as usize]).collect();
        Ok(Coded { topology, message, points, triangles: old_triangles })
    }

    /// Reads a message.
    ///
    /// # Errors
    /// [`CodecError`]. Takes no more memory than some hundred bytes for each point, triangle and
    /// line, of which there are at most 1024 for each byte of the message.
    pub fn decode(message: &[u8]) -> Result<Self, CodecError> {
        let mut input = Input(message);
        let [points, triangles, lines] = [input.count()?, input.count()?, input.count()?];
        let total = points as u64 + triangles as u64 + lines as u64;
        check_total(total, MOST.min(message.len().saturating_mul(PER_BYTE)))?;
        let has_features = input.byte()? & 1 == 1;
        let step = input.double()?;
        let offset = [input.double()?, input.double()?, input.double()?];
        if !step.is_finite() || offset.iter().any(|offset| !offset.is_finite()) {
            return Err(CodecError::Positions);
        }
        let mut into = Into { has_features };
        let coded = code(&mut Reader::new(input.0), &mut into, points, triangles, lines)?;
        Ok(Self::new(coded, step, offset, has_features))
    }

    fn new(coded: Walked, step: f64, offset: [f64; 3], has_features: bool) -> Self {
        let Walked { places, mut triangles, features, mut lines, .. } = coded;
        let sides = |&[a, b, c]: &[u32; 3]| [[a, b], [b, c], [c, a]];
        let edges = triangles.iter().flat_map(sides).chain(lines.iter().copied());
        let points = Hierarchy::new(&places, edges);
        let mut place_of = vec![0u32; places.len()];
        for (place, &point) in (0u32..).zip(points.order()) {
            place_of[point as usize] = place;
        }
        let cells = triangles.as_flattened_mut().iter_mut().chain(lines.as_flattened_mut());
        cells.for_each(|point| *point = place_of[*point as usize]);
        let places = points.order().iter().map(|&point| places[point as usize]).collect();
        let features = has_features.then_some(features);
        let elements = OnceLock::new();
        Self { points, places, step, offset, triangles, features, lines, elements }
    }

    /// The hierarchy of the points.
    #[must_use]
    pub fn points(&self) -> &Hierarchy {
        &self.points
    }

    /// The hierarchy of the elements: triangles, and after them lines. Worked out when it is first
    /// asked for.
    #[must_use]
    pub fn elements(&self) -> &Hierarchy {
        self.elements.get_or_init(|| {
            let place = |point: u32| self.places[point as usize];
            let centres: Vec<[i32; 3]> = (self.triangles.iter())
                .map(|&corners| {
                    let [a, b, c] = corners.map(place);
                    std::array::from_fn(|axis| a[axis] + b[axis] + c[axis])
                })
                .chain(self.lines.iter().map(|&ends| {
                    let [a, b] = ends.map(place);
                    std::array::from_fn(|axis| a[axis] + b[axis] + (a[axis] + b[axis]) / 2)
                }))
                .collect();
            let edges = shared(&self.triangles, &self.lines);
            Hierarchy::new(&centres, edges.iter().copied())
        })
    }

    /// The triangles, by the places of their points.
    #[must_use]
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// The feature of each triangle.
    #[must_use]
    pub fn features(&self) -> Option<&[u32]> {
        self.features.as_deref()
    }

    /// The lines, by the places of their points.
    #[must_use]
    pub fn lines(&self) -> &[[u32; 2]] {
        &self.lines
    }

    /// The reference positions.
    #[must_use]
    pub fn positions(&self) -> Vec<[f64; 3]> {
        let position = |place: &[i32; 3]| {
            std::array::from_fn(|axis| self.offset[axis] + self.step * f64::from(place[axis]))
        };
        self.places.iter().map(position).collect()
    }
}

fn check_total(found: u64, most: usize) -> Result<(), CodecError> {
    if found > most as u64 {
        let what = "points, triangles and lines";
        return Err(CodecError::TooLarge { what, found, most: most as u64 });
    }
    Ok(())
}

/// Positions as whole steps from an offset.
type Grid = (Vec<[i32; 3]>, f64, [f64; 3]);

fn grid(points: &[[f64; 3]], bound: f64) -> Option<Grid> {
    let mut offset = points.first().copied().unwrap_or_default();
    let mut largest = offset;
    for point in points {
        for axis in 0..3 {
            offset[axis] = offset[axis].min(point[axis]);
            largest[axis] = largest[axis].max(point[axis]);
        }
    }
    // A little less than twice the bound, for the rounding of the numbers themselves.
    let step = 2.0 * bound * (1.0 - 1e-9);
    let extent = (0..3).map(|axis| largest[axis] - offset[axis]).fold(0.0, f64::max);
    let step = if extent == 0.0 { 1.0 } else { step };
    if !bound.is_finite() || !step.is_normal() || !(extent / step < MOST_STEPS) {
        return None;
    }
    let mut places = Vec::with_capacity(points.len());
    for point in points {
        let mut place = [0; 3];
        for axis in 0..3 {
            let steps = ((point[axis] - offset[axis]) / step).round_ties_even();
            // Not `>`: a NaN must not pass.
            if !((offset[axis] + step * steps - point[axis]).abs() <= bound) {
                return None;
            }
            #[expect(clippy::cast_possible_truncation, reason = "checked above")]
            {
                place[axis] = steps as i32;
            }
        }
        places.push(place);
    }
    Some((places, step, offset))
}

/// Pairs of elements that share an edge, or a point where they are lines.
#[expect(clippy::cast_possible_truncation, reason = "elements are numbered with 32 bits")]
fn shared(triangles: &[[u32; 3]], lines: &[[u32; 2]]) -> Vec<[u32; 2]> {
    let mut sides: Vec<([u32; 2], u32)> = Vec::with_capacity(3 * triangles.len() + 2 * lines.len());
    for (&[a, b, c], element) in triangles.iter().zip(0u32..) {
        let sorted = [[a, b], [b, c], [c, a]].map(|[a, b]| [a.min(b), a.max(b)]);
        sides.extend(sorted.map(|side| (side, element)));
    }
    for (ends, element) in lines.iter().zip(triangles.len() as u32..) {
        // No side of a triangle ends beyond the last point.
        sides.extend(ends.map(|point| ([point, u32::MAX], element)));
    }
    sides.sort_unstable();
    let next_to = sides.windows(2).filter(|pair| pair[0].0 == pair[1].0);
    next_to.map(|pair| [pair[0].1, pair[1].1]).collect()
}

/// What a walk finds, points numbered in the order of the walk.
struct Walked {
    places: Vec<[i32; 3]>,
    triangles: Vec<[u32; 3]>,
    features: Vec<u32>,
    lines: Vec<[u32; 2]>,
    models: Models,
    most_triangles: usize,
}

struct Models {
    /// For points opposite a triangle, and for others.
    axes: [[Number; 3]; 2],
    is_same_feature: Model,
    feature: Number,
    goes_on: Model,
    is_new: Model,
    end: Number,
}

/// Knows the mesh (the encoder), or knows nothing (the decoder).
trait Source {
    fn seed(&mut self, fresh: u32) -> Option<[u32; 3]>;
    fn behind(&mut self, gate: [u32; 2]) -> Third;
    /// The place of a point that was met.
    fn place(&mut self, point: u32) -> [i32; 3];
    /// Takes note of the triangle that was last asked for, and says its feature.
    fn feature(&mut self) -> Option<u32>;
    /// The ends of a line.
    fn line(&mut self, line: usize, fresh: u32) -> [u32; 2];
    /// Any point that was not met.
    fn rest(&mut self, fresh: u32);
}

/// The guide of a walk that codes positions and features.
struct Coding<'a, S> {
    source: &'a mut S,
    walked: Walked,
}

impl<S: Source> Coding<'_, S> {
    fn place<B: Bits>(
        &mut self,
        bits: &mut B,
        point: u32,
        across: Option<Across>,
    ) -> Result<(), CodecError> {
        let place = self.source.place(point);
        let places = &mut self.walked.places;
        let near = across.map_or([0; 3], |Across { ends: [x, y], opposite }| {
            let at = |point: u32| places[point as usize].map(i64::from);
            let (x, y, opposite) = (at(x), at(y), at(opposite));
            std::array::from_fn(|axis| x[axis] + y[axis] - opposite[axis])
        });
        let is_opposite = across.is_some_and(|across| across.opposite != across.ends[0]);
        let models = &mut self.walked.models.axes[usize::from(is_opposite)];
        let mut coded = [0; 3];
        for axis in 0..3 {
            let difference = i64::from(place[axis]) - near[axis];
            let difference = bits.signed(&mut models[axis], difference)?;
            let steps = near[axis].wrapping_add(difference);
            let steps = i32::try_from(steps).ok();
            let steps = steps.filter(|steps| f64::from(*steps).abs() <= MOST_STEPS);
            coded[axis] = steps.ok_or(CodecError::Positions)?;
        }
        places.push(coded);
        Ok(())
    }
}

impl<B: Bits, S: Source> Guide<B> for Coding<'_, S> {
    fn seed(&mut self, fresh: u32) -> Option<[u32; 3]> {
        self.source.seed(fresh)
    }

    fn behind(&mut self, gate: [u32; 2]) -> Third {
        self.source.behind(gate)
    }

    fn point(
        &mut self,
        bits: &mut B,
        point: u32,
        across: Option<Across>,
    ) -> Result<(), CodecError> {
        self.place(bits, point, across)
    }

    fn triangle(
        &mut self,
        bits: &mut B,
        triangle: [u32; 3],
        beside: Option<u32>,
    ) -> Result<(), CodecError> {
        let feature = self.source.feature();
        let walked = &mut self.walked;
        if walked.triangles.len() >= walked.most_triangles {
            return Err(CodecError::Damaged("more triangles than the message states"));
        }
        walked.triangles.push(triangle);
        let Some(feature) = feature else { return Ok(()) };
        let beside = beside.map(|beside| walked.features[beside as usize]);
        let models = &mut walked.models;
        if let Some(beside) = beside
            && bits.bit(&mut models.is_same_feature, feature == beside)?
        {
            walked.features.push(beside);
            return Ok(());
        }
        let feature = bits.number(&mut models.feature, u64::from(feature))?;
        let wrong = CodecError::Damaged("the number of a feature is too large");
        walked.features.push(u32::try_from(feature).map_err(|_| wrong)?);
        Ok(())
    }
}

/// Codes triangles, lines, and the points that belong to none.
fn code<B: Bits, S: Source>(
    bits: &mut B,
    source: &mut S,
    points: usize,
    triangles: usize,
    lines: usize,
) -> Result<Walked, CodecError> {
    let models = Models {
        axes: [const { [Number::NEW; 3] }; 2],
        is_same_feature: Model::NEW,
        feature: Number::NEW,
        goes_on: Model::NEW,
        is_new: Model::NEW,
        end: Number::NEW,
    };
    let walked = Walked {
        places: Vec::new(),
        triangles: Vec::new(),
        features: Vec::new(),
        lines: Vec::new(),
        models,
        most_triangles: triangles,
    };
    let mut coding = Coding { source, walked };
    let mut fresh = walk(bits, &mut coding, points)?;
    if coding.walked.triangles.len() != triangles {
        return Err(CodecError::Damaged("fewer triangles than the message states"));
    }
    let beside = |fresh: u32, point: Option<u32>| {
        let point = point.or(fresh.checked_sub(1));
        point.map(|point| Across { ends: [point; 2], opposite: point })
    };
    for line in 0..lines {
        let wanted = coding.source.line(line, fresh);
        let last = coding.walked.lines.last().map(|line| line[1]);
        let mut ends = [0; 2];
        for end in 0..2 {
            if let (0, Some(last)) = (end, last)
                && bits.bit(&mut coding.walked.models.goes_on, wanted[0] == last)?
            {
                ends[0] = last;
                continue;
            }
            if bits.bit(&mut coding.walked.models.is_new, wanted[end] == fresh)? {
                if fresh as usize >= points {
                    return Err(CodecError::Damaged("more points than the message states"));
                }
                let near = beside(fresh, (end == 1).then_some(ends[0]));
                coding.place(bits, fresh, near)?;
                ends[end] = fresh;
                fresh += 1;
            } else {
                let back = u64::from(fresh.wrapping_sub(1).wrapping_sub(wanted[end]));
                let back = bits.number(&mut coding.walked.models.end, back)?;
                let newer = u32::try_from(back).ok().and_then(|back| back.checked_add(1));
                let known = newer.and_then(|newer| fresh.checked_sub(newer));
                let wrong = CodecError::Damaged("a line names a point that is not known yet");
                ends[end] = known.ok_or(wrong)?;
            }
        }
        coding.walked.lines.push(ends);
    }
    coding.source.rest(fresh);
    while (fresh as usize) < points {
        coding.place(bits, fresh, beside(fresh, None))?;
        fresh += 1;
    }
    Ok(coding.walked)
}

/// The decoder's source.
struct Into {
    has_features: bool,
}

impl Source for Into {
    fn seed(&mut self, _: u32) -> Option<[u32; 3]> {
        None
    }

    fn behind(&mut self, _: [u32; 2]) -> Third {
        Third::Nothing
    }

    fn place(&mut self, _: u32) -> [i32; 3] {
        [0; 3]
    }

    fn feature(&mut self) -> Option<u32> {
        self.has_features.then_some(0)
    }

    fn line(&mut self, _: usize, _: u32) -> [u32; 2] {
        [0; 2]
    }

    fn rest(&mut self, _: u32) {}
}

/// The encoder's source.
struct From<'a> {
    places: &'a [[i32; 3]],
    triangles: &'a [[u32; 3]],
    features: Option<&'a [u32]>,
    lines: &'a [[u32; 2]],
    /// The directed sides of the triangles: where the list of each point begins, and in it where a
    /// side leads and the number of its triangle, rising.
    starts: Vec<u32>,
    sides: Vec<(u32, u32)>,
    is_done: Vec<bool>,
    next_seed: usize,
    asked: u32,
    new_points: Vec<u32>,
    old_points: Vec<u32>,
    old_triangles: Vec<u32>,
}

const UNMET: u32 = u32::MAX;

impl<'a> From<'a> {
    fn new(
        places: &'a [[i32; 3]],
        triangles: &'a [[u32; 3]],
        features: Option<&'a [u32]>,
        lines: &'a [[u32; 2]],
    ) -> Self {
        let mut starts = vec![0u32; places.len() + 1];
        for &point in triangles.as_flattened() {
            starts[point as usize + 1] += 1;
        }
        for point in 0..places.len() {
            starts[point + 1] += starts[point];
        }
        let mut next = starts.clone();
        let mut sides = vec![(0, 0); 3 * triangles.len()];
        for (&[a, b, c], triangle) in triangles.iter().zip(0u32..) {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                sides[next[from as usize] as usize] = (to, triangle);
                next[from as usize] += 1;
            }
        }
        for point in 0..places.len() {
            sides[starts[point] as usize..starts[point + 1] as usize].sort_unstable();
        }
        Self {
            places,
            triangles,
            features,
            lines,
            starts,
            sides,
            is_done: vec![false; triangles.len()],
            next_seed: 0,
            asked: 0,
            new_points: vec![UNMET; places.len()],
            old_points: Vec::with_capacity(places.len()),
            old_triangles: Vec::with_capacity(triangles.len()),
        }
    }

    /// The number of a point, a new one if it has none.
    #[expect(clippy::cast_possible_truncation, reason = "points are numbered with 32 bits")]
    fn number(&mut self, point: u32) -> u32 {
        let number = &mut self.new_points[point as usize];
        if *number == UNMET {
            *number = self.old_points.len() as u32;
            self.old_points.push(point);
        }
        *number
    }
}

impl Source for From<'_> {
    fn seed(&mut self, _: u32) -> Option<[u32; 3]> {
        while *self.is_done.get(self.next_seed)? {
            self.next_seed += 1;
        }
        #[expect(clippy::cast_possible_truncation, reason = "triangles have 32 bits")]
        {
            self.asked = self.next_seed as u32;
        }
        Some(self.triangles[self.next_seed].map(|point| self.number(point)))
    }

    fn behind(&mut self, [from, to]: [u32; 2]) -> Third {
        let [from, to] = [from, to].map(|point| self.old_points[point as usize]);
        let list = self.starts[from as usize] as usize..self.starts[from as usize + 1] as usize;
        let list = &self.sides[list];
        let first = list.partition_point(|side| side.0 < to);
        let mut along = list[first..].iter().take_while(|side| side.0 == to);
        let Some(&(_, triangle)) = along.find(|side| !self.is_done[side.1 as usize]) else {
            return Third::Nothing;
        };
        self.asked = triangle;
        let [a, b, c] = self.triangles[triangle as usize];
        let third = if (a, b) == (from, to) {
            c
        } else if (b, c) == (from, to) {
            a
        } else {
            b
        };
        match self.new_points[third as usize] {
            UNMET => {
                self.number(third);
                Third::New
            }
            known => Third::Known(known),
        }
    }

    fn place(&mut self, point: u32) -> [i32; 3] {
        self.places[self.old_points[point as usize] as usize]
    }

    fn feature(&mut self) -> Option<u32> {
        self.is_done[self.asked as usize] = true;
        self.old_triangles.push(self.asked);
        self.features.map(|features| features[self.asked as usize])
    }

    fn line(&mut self, line: usize, _: u32) -> [u32; 2] {
        self.lines[line].map(|point| self.number(point))
    }

    fn rest(&mut self, _: u32) {
        for point in (0u32..).take(self.places.len()) {
            self.number(point);
        }
    }
}
