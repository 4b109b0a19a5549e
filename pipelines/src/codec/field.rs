//! Fields: tuples of values at the points of a hierarchy, frame after frame.

use super::CodecError;
use super::bytes::{Input, put_block, put_count};
use super::exact::{self, Precision};
use super::grid::{Grid, MOST_STEPS};
use super::hierarchy::Hierarchy;
use super::mask::Mask;
use super::plane::{Around, Wanted, two_to};

/// By how much a finite value may differ after it was coded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Bound {
    /// By this much at most.
    Absolute(f64),
    /// Not in one bit.
    Exact,
}

/// The first byte of a frame: what follows, in the lowest two bits, and what goes with it.
const CONSTANT: u8 = 0;
const GRID: u8 = 1;
const SINGLE: u8 = 2;
const DOUBLE: u8 = 3;
/// Earlier frames are used.
const FOLLOWS: u8 = 1 << 2;
/// The mask of the last frame holds.
const SAME_MASK: u8 = 1 << 3;
/// A mask follows.
const NEW_MASK: u8 = 1 << 4;
/// Values that no step reaches follow at the end.
const EXCEPTIONS: u8 = 1 << 5;

/// A little less than twice the bound, for the rounding of the numbers themselves.
const NEARLY_TWICE: f64 = 2.0 * (1.0 - 1e-9);

/// A field of which frame after frame is coded, or decoded: what both sides know of it.
///
/// ```
/// use tombolo_pipelines::codec::{Bound, Field, Topology};
///
/// let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
/// let coded = Topology::encode(&points, &[[0, 1, 2], [2, 1, 3]], None, &[], 1e-6)?;
/// let mut message = Vec::new();
/// let values = [1.0, f64::NAN, 3.0, 4.0];
/// Field::new(1).encode(coded.topology.points(), &coded.points, &values, Bound::Absolute(0.01), &mut message)?;
///
/// let copy = Topology::decode(&coded.message)?;
/// let decoded = Field::new(1).decode(copy.points(), &mut &message[..])?;
/// for (place, value) in decoded.iter().enumerate() {
///     let sent = values[coded.points[place] as usize];
///     assert!((value - sent).abs() <= 0.01 || value.is_nan() && sent.is_nan());
/// }
/// # Ok::<(), tombolo_pipelines::codec::CodecError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Field {
    components: usize,
    known: Known,
}

/// The frame before, as both sides have it.
#[derive(Debug, Clone)]
enum Known {
    Nothing,
    Grid(Grid),
    Exact(Precision, Vec<Vec<f64>>),
}

impl Field {
    /// A field with tuples of so many values, of which nothing is known.
    #[must_use]
    pub fn new(components: usize) -> Self {
        Self { components, known: Known::Nothing }
    }

    /// How many values a tuple has.
    #[must_use]
    pub fn components(&self) -> usize {
        self.components
    }

    /// Forgets the earlier frames: the next one can be read by itself.
    pub fn forget(&mut self) {
        self.known = Known::Nothing;
    }

    /// Codes the next frame and appends it to a message. `order` says which tuple of `values` stands
    /// at each place of the hierarchy.
    ///
    /// # Errors
    /// [`CodecError::Length`] where the values or the order do not fit the hierarchy.
    pub fn encode(
        &mut self,
        hierarchy: &Hierarchy,
        order: &[u32],
        values: &[f64],
        bound: Bound,
        message: &mut Vec<u8>,
    ) -> Result<(), CodecError> {
        let (found, expected) = (values.len(), hierarchy.len() * self.components);
        let fits = order.len() == hierarchy.len()
            && order.iter().all(|&tuple| (tuple as usize) < hierarchy.len());
        if found != expected || !fits {
            return Err(CodecError::Length { found, expected });
        }
        let first = values.get(..self.components).unwrap_or_default();
        let same = |(a, b): (&f64, &f64)| a.to_bits() == b.to_bits();
        if self.components == 0 || values.iter().zip(first.iter().cycle()).all(same) {
            self.known = Known::Nothing;
            message.push(CONSTANT);
            message.extend(first.iter().flat_map(|value| value.to_le_bytes()));
            if first.is_empty() {
                message.extend([0; 8].repeat(self.components));
            }
            return Ok(());
        }
        if let Bound::Absolute(bound) = bound
            && let Some((grid, follows)) = self.grid(hierarchy.len(), values, bound)
        {
            return self.encode_grid(grid, follows, hierarchy, order, values, bound, message);
        }
        self.encode_exact(hierarchy, order, values, message)
    }

    /// The grid for the next frame, and whether it goes on from the last. `None` where no grid has
    /// steps small enough.
    fn grid(&mut self, points: usize, values: &[f64], bound: f64) -> Option<(Grid, bool)> {
        let mut offsets = Vec::with_capacity(self.components);
        let mut span = 0.0_f64;
        for (component, [least, largest]) in ranges(values, self.components).into_iter().enumerate()
        {
            let known = match &self.known {
                Known::Grid(grid) => Some(grid.offsets[component]),
                _ => None,
            };
            let middle = if least <= largest { least / 2.0 + largest / 2.0 } else { 0.0 };
            #[expect(clippy::cast_possible_truncation, reason = "near the middle is enough")]
            let offset = known.unwrap_or(f64::from(middle as f32));
            if !offset.is_finite() {
                return None;
            }
            span = span.max((least - offset).abs().min(f64::MAX));
            span = span.max((largest - offset).abs().min(f64::MAX));
            offsets.push(offset);
        }
        let step = NEARLY_TWICE * bound;
        let floor_log2 = |value: f64| (value.to_bits() >> 52 & 0x7ff) as i32 - 1023;
        if !step.is_normal() {
            return None;
        }
        let least = if span == 0.0 { -900 } else { floor_log2(span / MOST_STEPS) + 1 };
        let exponent = (floor_log2(step) - 6).max(least);
        if exponent.abs() > 900 {
            return None;
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "between 0 and 127"
        )]
        let steps = (step * two_to(-exponent)).floor().min(127.0) as u8;
        if steps == 0 {
            let was_known = matches!(self.known, Known::Grid(_));
            self.known = Known::Nothing;
            // Around an offset of its own it may yet fit.
            return if was_known { self.grid(points, values, bound) } else { None };
        }
        #[expect(clippy::cast_possible_truncation, reason = "checked above")]
        let exponent = exponent as i16;
        if let Known::Grid(mut grid) = std::mem::replace(&mut self.known, Known::Nothing)
            && grid.follow(exponent)
        {
            grid.steps = steps;
            return Some((grid, true));
        }
        Some((Grid::new(exponent, steps, offsets, points), false))
    }

    #[expect(clippy::too_many_arguments, reason = "those of `encode`, and its grid")]
    fn encode_grid(
        &mut self,
        mut grid: Grid,
        follows: bool,
        hierarchy: &Hierarchy,
        order: &[u32],
        values: &[f64],
        bound: f64,
        message: &mut Vec<u8>,
    ) -> Result<(), CodecError> {
        let stencils = hierarchy.stencils();
        let components = self.components;
        let start = message.len();
        message.push(GRID | if follows { FOLLOWS } else { 0 });
        message.extend(grid.exponent.to_le_bytes());
        message.push(grid.steps);
        if !follows {
            #[expect(clippy::cast_possible_truncation, reason = "they are rounded already")]
            message.extend(grid.offsets.iter().flat_map(|offset| (*offset as f32).to_le_bytes()));
        }
        let mask = Mask::find(values, components, order);
        if let Some(mask) = &mask {
            if grid.mask.as_ref().is_some_and(|last| last.is_as(mask)) {
                message[start] |= SAME_MASK;
            } else {
                message[start] |= NEW_MASK;
                mask.write(stencils, message)?;
            }
        }
        grid.mask = mask;
        grid.set_masked();
        let mask = grid.mask.as_ref().map(|mask| &mask.points[..]);
        let mut exceptions = Vec::new();
        let mut ordered = vec![0.0; order.len()];
        for component in 0..components {
            for (ordered, &tuple) in ordered.iter_mut().zip(order) {
                *ordered = values[tuple as usize * components + component];
            }
            let (before, plane) = grid.planes.split_at_mut(component);
            let beside = before.last().map(|plane| &plane.nodes[..]);
            let around = Around { hierarchy, mask, beside, step: f32::from(grid.steps) };
            let (offset, exponent) = (grid.offsets[component], grid.exponent);
            let wanted = Wanted { values: &ordered, offset, exponent, bound };
            let beyond = plane[0].encode(around, follows, wanted, message);
            let exception = |place| (place * components + component, ordered[place]);
            exceptions.extend(beyond.into_iter().map(exception));
        }
        if !exceptions.is_empty() {
            message[start] |= EXCEPTIONS;
            put_exceptions(exceptions, message);
        }
        grid.frames = grid.frames.saturating_add(1);
        self.known = Known::Grid(grid);
        Ok(())
    }

    fn encode_exact(
        &mut self,
        hierarchy: &Hierarchy,
        order: &[u32],
        values: &[f64],
        message: &mut Vec<u8>,
    ) -> Result<(), CodecError> {
        let stencils = hierarchy.stencils();
        let precision = exact::precision(values);
        let planes: Vec<Vec<f64>> = (0..self.components)
            .map(|component| {
                let value = |&tuple: &u32| values[tuple as usize * self.components + component];
                order.iter().map(value).collect()
            })
            .collect();
        let alone = |last: Option<&Vec<Vec<f64>>>| -> Result<Vec<Vec<u8>>, CodecError> {
            let coded = planes.iter().enumerate().map(|(component, plane)| {
                let last = last.map(|last| &last[component][..]);
                exact::encode(stencils, plane, last, precision)
            });
            coded.collect()
        };
        let mut blocks = alone(None)?;
        let mut follows = 0;
        if let Known::Exact(last_precision, last) = &self.known
            && *last_precision == precision
        {
            let following = alone(Some(last))?;
            let size = |blocks: &[Vec<u8>]| blocks.iter().map(Vec::len).sum::<usize>();
            if size(&following) <= size(&blocks) {
                (blocks, follows) = (following, FOLLOWS);
            }
        }
        let kind = if precision == Precision::Single { SINGLE } else { DOUBLE };
        message.push(kind | follows);
        blocks.iter().for_each(|block| put_block(message, block));
        self.known = Known::Exact(precision, planes);
        Ok(())
    }

    /// Reads the next frame and takes its bytes off the message. The tuples come in the order of the
    /// hierarchy.
    ///
    /// # Errors
    /// [`CodecError`]. What was known of earlier frames is forgotten then.
    pub fn decode(
        &mut self,
        hierarchy: &Hierarchy,
        message: &mut &[u8],
    ) -> Result<Vec<f64>, CodecError> {
        let mut input = Input(message);
        let values = self.read(hierarchy, &mut input)?;
        *message = input.0;
        Ok(values)
    }

    fn read(
        &mut self,
        hierarchy: &Hierarchy,
        input: &mut Input<'_>,
    ) -> Result<Vec<f64>, CodecError> {
        let known = std::mem::replace(&mut self.known, Known::Nothing);
        let flags = input.byte()?;
        let follows = flags & FOLLOWS != 0;
        match flags & 3 {
            CONSTANT => {
                let tuple = input.doubles(self.components)?;
                Ok(tuple.repeat(hierarchy.len()))
            }
            GRID => self.read_grid(known, flags, hierarchy, input),
            kind => {
                let precision = if kind == SINGLE { Precision::Single } else { Precision::Double };
                let last = match known {
                    Known::Exact(last, values) if last == precision && follows => Some(values),
                    _ if follows => return Err(NOT_KNOWN),
                    _ => None,
                };
                let planes = (0..self.components).map(|component| {
                    let last = last.as_ref().map(|last| &last[component][..]);
                    exact::decode(hierarchy.stencils(), last, precision, input.block()?)
                });
                let planes: Vec<Vec<f64>> = planes.collect::<Result<_, _>>()?;
                let tuples = (0..hierarchy.len())
                    .flat_map(|place| planes.iter().map(move |plane| plane[place]));
                let values = tuples.collect();
                self.known = Known::Exact(precision, planes);
                Ok(values)
            }
        }
    }

    fn read_grid(
        &mut self,
        known: Known,
        flags: u8,
        hierarchy: &Hierarchy,
        input: &mut Input<'_>,
    ) -> Result<Vec<f64>, CodecError> {
        let stencils = hierarchy.stencils();
        let exponent = i16::from_le_bytes(input.array()?);
        let steps = input.byte()?;
        if !(-900..=900).contains(&exponent) {
            return Err(CodecError::Damaged("a grid is too fine or too coarse"));
        }
        let mut grid = if flags & FOLLOWS == 0 {
            let offsets = (0..self.components).map(|_| input.array().map(f32::from_le_bytes));
            let offsets = offsets.map(|offset| offset.map(f64::from)).collect::<Result<_, _>>()?;
            Grid::new(exponent, steps, offsets, hierarchy.len())
        } else {
            let Known::Grid(mut grid) = known else { return Err(NOT_KNOWN) };
            if !grid.follow(exponent) {
                return Err(NOT_KNOWN);
            }
            grid.steps = steps;
            grid
        };
        if flags & NEW_MASK != 0 {
            grid.mask = Some(Mask::read(self.components, stencils, input)?);
        } else if flags & SAME_MASK == 0 {
            grid.mask = None;
        } else if grid.mask.is_none() {
            return Err(NOT_KNOWN);
        }
        grid.set_masked();
        let mask = grid.mask.as_ref().map(|mask| &mask.points[..]);
        for component in 0..self.components {
            let (before, plane) = grid.planes.split_at_mut(component);
            let beside = before.last().map(|plane| &plane.nodes[..]);
            let around = Around { hierarchy, mask, beside, step: f32::from(grid.steps) };
            plane[0].decode(around, input)?;
        }
        let mut values = grid.values();
        if flags & EXCEPTIONS != 0 {
            take_exceptions(&mut values, input)?;
        }
        grid.frames = grid.frames.saturating_add(1);
        self.known = Known::Grid(grid);
        Ok(values)
    }
}

/// The least and the largest finite value of each component; none is larger than infinity.
fn ranges(values: &[f64], components: usize) -> Vec<[f64; 2]> {
    let lanes = match components {
        1 => ranges_of::<4>(values),
        2 => ranges_of::<8>(values),
        3 => ranges_of::<12>(values),
        _ => values.chunks(components).fold(vec![NO_RANGE; components], |mut ranges, tuple| {
            ranges.iter_mut().zip(tuple).for_each(|(range, &value)| widen(range, value));
            ranges
        }),
    };
    let mut ranges = vec![NO_RANGE; components];
    for (lane, of_lane) in lanes.into_iter().enumerate() {
        let [least, largest] = &mut ranges[lane % components];
        *least = least.min(of_lane[0]);
        *largest = largest.max(of_lane[1]);
    }
    ranges
}

const NO_RANGE: [f64; 2] = [f64::INFINITY, f64::NEG_INFINITY];

#[inline(always)]
fn widen([least, largest]: &mut [f64; 2], value: f64) {
    let is_finite = value.abs() < f64::INFINITY;
    *least = if is_finite && value < *least { value } else { *least };
    *largest = if is_finite && value > *largest { value } else { *largest };
}

/// The ranges of so many values that stand side by side.
fn ranges_of<const LANES: usize>(values: &[f64]) -> Vec<[f64; 2]> {
    let (mut least, mut largest) = ([NO_RANGE[0]; LANES], [NO_RANGE[1]; LANES]);
    let (rounds, rest) = values.as_chunks::<LANES>();
    let mut take = |lane: usize, value: f64| {
        let mut range = [least[lane], largest[lane]];
        widen(&mut range, value);
        [least[lane], largest[lane]] = range;
    };
    for round in rounds {
        (0..LANES).for_each(|lane| take(lane, round[lane]));
    }
    rest.iter().enumerate().for_each(|(lane, &value)| take(lane, value));
    least.into_iter().zip(largest).map(|(least, largest)| [least, largest]).collect()
}

const NOT_KNOWN: CodecError = CodecError::Damaged("the frame goes on from one that is not known");

/// Values by their place, the lowest first: each as how many lie between it and the one before.
fn put_exceptions(mut exceptions: Vec<(usize, f64)>, message: &mut Vec<u8>) {
    exceptions.sort_unstable_by_key(|exception| exception.0);
    put_count(message, exceptions.len());
    let mut next = 0;
    for (place, value) in exceptions {
        put_count(message, place - next);
        message.extend(value.to_le_bytes());
        next = place + 1;
    }
}

fn take_exceptions(values: &mut [f64], input: &mut Input<'_>) -> Result<(), CodecError> {
    let mut next = 0usize;
    for _ in 0..input.count()? {
        let place = next.saturating_add(input.count()?);
        let value = input.double()?;
        let there = values.get_mut(place);
        *there.ok_or(CodecError::Damaged("a value stands beyond the last"))? = value;
        next = place + 1;
    }
    Ok(())
}
