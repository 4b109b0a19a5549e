//! Fields: tuples of values at the points of a hierarchy, frame after frame.

use super::CodecError;
use super::bytes::{Input, put_block, put_count};
use super::exact::{self, Precision};
use super::grid::{Grid, MOST_STEPS};
use super::hierarchy::Hierarchy;
use super::mask::Mask;
use super::plane::{Shift, Values, Wanted, two_to};
use super::ranges::ranges;
use super::run::Around;

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
/// for (index, value) in decoded.iter().enumerate() {
///     let sent = values[coded.points[index] as usize];
///     assert!((value - sent).abs() <= 0.01 || value.is_nan() && sent.is_nan());
/// }
/// # Ok::<(), tombolo_pipelines::codec::CodecError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Field {
    components: usize,
    known: Known,
    /// Room for the values of a frame in order, which is kept for the next one.
    ordered: Vec<f64>,
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
        Self { components, known: Known::Nothing, ordered: Vec::new() }
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
    /// at each index of the hierarchy.
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
        self.encode_frame(hierarchy, order, values, bound, message).map(|_| ())
    }

    /// Codes the next frame, and returns the values that no step reaches.
    fn encode_frame(
        &mut self,
        hierarchy: &Hierarchy,
        order: &[u32],
        values: &[f64],
        bound: Bound,
        message: &mut Vec<u8>,
    ) -> Result<Vec<(usize, f64)>, CodecError> {
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
            return Ok(Vec::new());
        }
        if let Bound::Absolute(bound) = bound
            && let Some((grid, shift)) = self.grid(hierarchy.len(), values, bound)
        {
            return self.encode_grid(grid, shift, hierarchy, order, values, bound, message);
        }
        self.encode_exact(hierarchy, order, values, message)?;
        Ok(Vec::new())
    }

    /// Codes the next frame as [`Field::encode`] does, and returns what [`Field::decode`] will.
    pub(super) fn encode_and_show(
        &mut self,
        hierarchy: &Hierarchy,
        order: &[u32],
        values: &[f64],
        bound: Bound,
        message: &mut Vec<u8>,
    ) -> Result<Vec<f64>, CodecError> {
        let exceptions = self.encode_frame(hierarchy, order, values, bound, message)?;
        let Known::Grid(grid) = &self.known else {
            // Nothing is lost.
            return Ok(order
                .iter()
                .flat_map(|&tuple| &values[tuple as usize * self.components..][..self.components])
                .copied()
                .collect());
        };
        let mut shown = grid.values();
        exceptions.into_iter().for_each(|(index, value)| shown[index] = value);
        Ok(shown)
    }

    /// The grid for the next frame, and how the last one is shifted if it goes on. `None` where no
    /// grid has steps small enough.
    fn grid(&mut self, points: usize, values: &[f64], bound: f64) -> Option<(Grid, Option<Shift>)> {
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
            && let Some(shift) = grid.follow(exponent)
        {
            grid.steps = steps;
            return Some((grid, Some(shift)));
        }
        Some((Grid::new(exponent, steps, offsets, points), None))
    }

    #[expect(clippy::too_many_arguments, reason = "those of `encode`, and its grid")]
    fn encode_grid(
        &mut self,
        mut grid: Grid,
        shift: Option<Shift>,
        hierarchy: &Hierarchy,
        order: &[u32],
        values: &[f64],
        bound: f64,
        message: &mut Vec<u8>,
    ) -> Result<Vec<(usize, f64)>, CodecError> {
        let stencils = hierarchy.stencils();
        let (components, follows) = (self.components, shift.is_some());
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
        let mut ordered = std::mem::take(&mut self.ordered);
        put_in_order(values, components, order, &mut ordered);
        let lists = || ordered.chunks_exact(order.len().max(1));
        let exponent = grid.exponent;
        let wanted = |values, offset| Wanted { values, offset, exponent, bound };
        if let Some(shift) = shift {
            for ((plane, &offset), values) in grid.planes.iter_mut().zip(&grid.offsets).zip(lists())
            {
                plane.shift_to(shift, &wanted(values, offset));
            }
        }
        grid.set_masked();
        let mask = grid.mask.as_ref().map(|mask| &mask.points[..]);
        let mut exceptions = Vec::new();
        for (component, ordered) in lists().enumerate() {
            let (before, plane) = grid.planes.split_at_mut(component);
            let beside = before.last().map(|plane| &plane.nodes[..]);
            let step = f32::from(grid.steps);
            let around = Around { hierarchy, mask, beside, step, follows };
            let wanted = wanted(ordered, grid.offsets[component]);
            let beyond = plane[0].encode(around, wanted, message);
            let exception = |index| (index * components + component, ordered[index]);
            exceptions.extend(beyond.into_iter().map(exception));
        }
        if !exceptions.is_empty() {
            message[start] |= EXCEPTIONS;
            put_exceptions(&mut exceptions, message);
        }
        grid.frames = grid.frames.saturating_add(1);
        self.known = Known::Grid(grid);
        self.ordered = ordered;
        Ok(exceptions)
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
                    .flat_map(|index| planes.iter().map(move |plane| plane[index]));
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
            let shift = grid.follow(exponent).ok_or(NOT_KNOWN)?;
            grid.planes.iter_mut().for_each(|plane| plane.shift(shift));
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
        let (components, unit) = (self.components, grid.unit());
        let mut values = vec![0.0; hierarchy.len() * components];
        for component in 0..components {
            let (before, plane) = grid.planes.split_at_mut(component);
            let beside = before.last().map(|plane| &plane.nodes[..]);
            let (step, follows) = (f32::from(grid.steps), flags & FOLLOWS != 0);
            let around = Around { hierarchy, mask, beside, step, follows };
            let (tuples, offset) = (&mut values[..], grid.offsets[component]);
            let values = Values { tuples, components, component, offset, unit };
            plane[0].decode(around, input, values)?;
        }
        grid.put_masked(&mut values);
        if flags & EXCEPTIONS != 0 {
            take_exceptions(&mut values, input)?;
        }
        grid.frames = grid.frames.saturating_add(1);
        self.known = Known::Grid(grid);
        Ok(values)
    }
}

/// Puts the values index after index, one component after the other.
fn put_in_order(values: &[f64], components: usize, order: &[u32], ordered: &mut Vec<f64>) {
    ordered.resize(values.len(), 0.0);
    match components {
        1 => put_in_order_of::<1>(values, order, ordered),
        2 => put_in_order_of::<2>(values, order, ordered),
        3 => put_in_order_of::<3>(values, order, ordered),
        _ => {
            let lists = ordered.chunks_exact_mut(order.len().max(1));
            for (component, list) in lists.enumerate() {
                for (to, &at) in list.iter_mut().zip(order) {
                    *to = values[at as usize * components + component];
                }
            }
        }
    }
}

/// The values of tuples of so many, index after index, one component after the other; each is looked
/// up once.
fn put_in_order_of<const COMPONENTS: usize>(values: &[f64], order: &[u32], ordered: &mut [f64]) {
    let mut lists = ordered.chunks_exact_mut(order.len().max(1));
    let mut lists: [&mut [f64]; COMPONENTS] =
        std::array::from_fn(|_| lists.next().unwrap_or_default());
    let tuples = values.as_chunks::<COMPONENTS>().0;
    for (index, &at) in order.iter().enumerate() {
        let tuple = tuples[at as usize];
        lists.iter_mut().zip(tuple).for_each(|(list, value)| list[index] = value);
    }
}

const NOT_KNOWN: CodecError = CodecError::Damaged("the frame goes on from one that is not known");

/// Values by their index, the lowest first: each as how many lie between it and the one before.
fn put_exceptions(exceptions: &mut [(usize, f64)], message: &mut Vec<u8>) {
    exceptions.sort_unstable_by_key(|exception| exception.0);
    put_count(message, exceptions.len());
    let mut next = 0;
    for &mut (index, value) in exceptions {
        put_count(message, index - next);
        message.extend(value.to_le_bytes());
        next = index + 1;
    }
}

fn take_exceptions(values: &mut [f64], input: &mut Input<'_>) -> Result<(), CodecError> {
    let mut next = 0usize;
    for _ in 0..input.count()? {
        let index = next.saturating_add(input.count()?);
        let value = input.double()?;
        let there = values.get_mut(index);
        *there.ok_or(CodecError::Damaged("a value stands beyond the last"))? = value;
        next = index + 1;
    }
    Ok(())
}
