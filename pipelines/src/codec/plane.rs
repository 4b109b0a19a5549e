//! One component of a field, in whole steps of its grid: each value as its difference to a
//! prediction.

use tombolo_deform::lanes::with_wide_registers;

use super::CodecError;
use super::bytes::{Input, put_count};
use super::hierarchy::BLOCK;
use super::node::Node;
use super::prediction::{sums_of, sums_of_some};
use super::rans::{Decoder, Numbers, encode};
use super::run::{Around, CLASSES, Run};
use super::tables::TABLES;
use super::temporal::{Modes, SPACE, Ways, cheapest};

/// The tables of the contexts before any are sent.
const FIRST_TABLES: [u8; CLASSES] =
    [2, 7, 9, 10, 11, 11, 12, 14, 15, 16, 18, 19, 20, 21, 23, 25, 28];
/// No difference is larger: in single precision all of them are exact.
const MOST_STEPS: f64 = 16_777_216.0;
/// The bits that another table costs.
const TABLE_PRICE: f32 = 9.0;

/// One component of a field at all points.
#[derive(Debug, Clone)]
pub(super) struct Plane {
    pub(super) nodes: Vec<Node>,
    tables: [u8; CLASSES],
}

/// The values that a plane is to hold, place after place.
#[derive(Clone, Copy)]
pub(super) struct Wanted<'a> {
    pub(super) values: &'a [f64],
    /// A value is this and steps of two to the exponent.
    pub(super) offset: f64,
    pub(super) exponent: i16,
    /// The most that a value may be off.
    pub(super) bound: f64,
}

/// Two to the power of a number between -1000 and 1000.
#[expect(clippy::cast_sign_loss, reason = "the exponent of a double, from 23 on")]
pub(super) fn two_to(exponent: i32) -> f64 {
    f64::from_bits(((exponent + 1023) as u64) << 52)
}

/// The nearest whole number in double precision, up to 2⁵¹.
#[inline(always)]
fn nearest_double(value: f64) -> f64 {
    const WHOLE: f64 = 6_755_399_441_055_744.0;
    (value + WHOLE) - WHOLE
}

/// How a frame becomes the one before.
#[derive(Clone, Copy)]
pub(super) struct Shift {
    /// What a step of the old grid is in the new one.
    pub(super) scale: f32,
    /// Whether the frame is the first, which then is the one before that, too.
    pub(super) is_second: bool,
}

impl Shift {
    #[inline(always)]
    fn of(self, node: Node) -> Node {
        let [magnitude, now, last, _] = node.0;
        let before = if self.is_second { now } else { last };
        Node([magnitude, now, now * self.scale, before * self.scale])
    }
}

/// Where the values of a plane go that is decoded.
pub(super) struct Values<'a> {
    /// Tuples, place after place.
    pub(super) tuples: &'a mut [f64],
    /// How many values a tuple has, and which of them is the plane's.
    pub(super) components: usize,
    pub(super) component: usize,
    /// A value is this and steps of this size.
    pub(super) offset: f64,
    pub(super) unit: f64,
}

impl Plane {
    /// A component of which nothing is known.
    pub(super) fn new(points: usize) -> Self {
        Self { nodes: vec![Node::ZERO; points], tables: FIRST_TABLES }
    }

    /// Makes the last frame the one before.
    pub(super) fn shift(&mut self, shift: Shift) {
        for node in &mut self.nodes {
            *node = shift.of(*node);
        }
    }

    /// Makes the last frame the one before, and gives the nodes the next values, as near as single
    /// precision has them: to choose a way of prediction by.
    pub(super) fn shift_to(&mut self, shift: Shift, wanted: &Wanted<'_>) {
        let per_unit = two_to(-i32::from(wanted.exponent));
        for (node, value) in self.nodes.iter_mut().zip(wanted.values) {
            #[expect(clippy::cast_possible_truncation, reason = "to compare with")]
            let value = ((value - wanted.offset) * per_unit) as f32;
            let [magnitude, _, last, before] = shift.of(*node).0;
            // Where nothing can be compared, nothing has changed.
            *node = Node([magnitude, if value.is_finite() { value } else { last }, last, before]);
        }
    }

    /// Codes the next frame of these values, which the nodes have already where the frame goes on.
    /// Returns the places whose values come out further off than they may: those that are not finite,
    /// or beyond every step.
    pub(super) fn encode(
        &mut self,
        around: Around<'_>,
        wanted: Wanted<'_>,
        out: &mut Vec<u8>,
    ) -> Vec<usize> {
        with_wide_registers(
            #[inline(always)]
            || self.encode_with(around, wanted, out),
        )
    }

    #[inline(always)]
    fn encode_with(
        &mut self,
        around: Around<'_>,
        wanted: Wanted<'_>,
        out: &mut Vec<u8>,
    ) -> Vec<usize> {
        let points = self.nodes.len();
        let stencils = around.hierarchy.stencils();
        // Not by a closure, which would not be compiled for wide registers.
        let ways = if around.follows {
            Some(Ways::new(&self.nodes, stencils, around.mask, around.step))
        } else {
            None
        };
        let mut modes = match &ways {
            Some(ways) => ways.modes(points),
            None => Modes::uniform(SPACE),
        };
        // Some say nearly as well which way of prediction is best.
        let stride = match points {
            0..4096 => 1,
            4096..65536 => 2,
            _ => 3,
        };
        let mut by = modes.coefficients(SPACE);
        let (mut known, mut current) = ([Node::ZERO; BLOCK], Run::new(around.mask.is_some()));
        let mut scratch = Scratch::NEW;
        let mut numbers = Numbers::new(CLASSES, points);
        let mut beyond = Vec::new();
        for run in around.hierarchy.runs() {
            let mask = around.mask.map(|mask| &mask[run.clone()]);
            sums_of(&self.nodes, &stencils[run.clone()], mask, &mut known);
            if let Some(ways) = &ways
                && run.start % BLOCK == 0
            {
                // Neighbours in this block are taken as they are, not as they will be coded.
                let block = run.start..points.min(run.start + BLOCK);
                let mask = around.mask.map(|mask| &mask[block.clone()]);
                let behind = run.len().next_multiple_of(stride);
                let others = &stencils[block.clone()];
                sums_of_some(&self.nodes, others, mask, (behind, stride), &mut known);
                let mut costs = [0.0; 4];
                for (index, point) in block.enumerate().step_by(stride) {
                    if mask.is_none_or(|mask| !mask[index]) {
                        ways.add_costs(known[index], self.nodes[point], &mut costs);
                    }
                }
                let mode = cheapest(costs);
                modes.push(mode);
                by = modes.coefficients(mode);
            }
            current.take(&self.nodes, &around, run, &known);
            current.predict(by);
            wanted.code(&mut current, around.step, &mut scratch, &mut numbers, &mut beyond);
            current.put(&mut self.nodes);
        }
        modes.settle();

        let (mut changed, mut has_plain) = (0u32, false);
        for class in 0..CLASSES {
            let histogram = numbers.histogram(class);
            if histogram.is_empty() {
                continue;
            }
            let table = histogram.best(self.tables[class], TABLE_PRICE);
            if table != self.tables[class] {
                changed |= 1 << class;
                self.tables[class] = table;
            }
            has_plain |= histogram.has_plain(table);
        }
        let lanes = match numbers.len() {
            0..1024 => 0,
            1024..65536 => 1,
            _ => 3u8,
        };
        out.push(lanes | u8::from(changed != 0) << 2 | modes.flags() << 3);
        modes.write(out);
        if changed != 0 {
            put_count(out, changed as usize);
            let sent = (0..CLASSES).filter(|class| changed >> class & 1 == 1);
            out.extend(sent.map(|class| self.tables[class]));
        }
        encode(&numbers, &self.tables, has_plain, u32::from(lanes), out);
        beyond
    }

    /// Reads the next frame.
    pub(super) fn decode(
        &mut self,
        around: Around<'_>,
        input: &mut Input<'_>,
        values: Values<'_>,
    ) -> Result<(), CodecError> {
        with_wide_registers(
            #[inline(always)]
            || self.decode_with(around, input, values),
        )
    }

    #[inline(always)]
    fn decode_with(
        &mut self,
        around: Around<'_>,
        input: &mut Input<'_>,
        mut values: Values<'_>,
    ) -> Result<(), CodecError> {
        let points = self.nodes.len();
        let flags = input.byte()?;
        let modes = Modes::read(flags >> 3, points, input)?;
        if flags >> 2 & 1 == 1 {
            let changed = input.count()?;
            for class in (0..CLASSES).filter(|class| changed >> class & 1 == 1) {
                let table = input.byte()?;
                if usize::from(table) >= TABLES {
                    return Err(CodecError::Damaged("there is no such table"));
                }
                self.tables[class] = table;
            }
        }
        let mut decoder = Decoder::new(u32::from(flags & 3), &self.tables, input)?;
        let stencils = around.hierarchy.stencils();
        let (mut known, mut current) = ([Node::ZERO; BLOCK], Run::new(around.mask.is_some()));
        let Scratch { mut numbers, mut steps, .. } = Scratch::NEW;
        for run in around.hierarchy.runs() {
            let by = modes.of(run.start);
            let mask = around.mask.map(|mask| &mask[run.clone()]);
            sums_of(&self.nodes, &stencils[run.clone()], mask, &mut known);
            current.take(&self.nodes, &around, run, &known);
            current.predict(by);
            let numbers = &mut numbers[..current.len()];
            decoder.take(current.classes(), numbers);
            for (steps, &number) in steps.iter_mut().zip(&*numbers) {
                #[expect(clippy::cast_possible_wrap, reason = "a zigzag number")]
                let difference = (number >> 1) as i32 ^ -((number & 1) as i32);
                *steps = difference as f32;
            }
            current.step(around.step, &steps);
            current.put(&mut self.nodes);
            values.put(&current);
        }
        decoder.finish()
    }
}

/// Room for the numbers of a run.
struct Scratch {
    values: [f64; BLOCK],
    steps: [f32; BLOCK],
    numbers: [u32; BLOCK],
}

impl Scratch {
    const NEW: Self = Self { values: [0.0; BLOCK], steps: [0.0; BLOCK], numbers: [0; BLOCK] };
}

impl Wanted<'_> {
    /// Takes up the steps that lead from a run's predictions to the values, and adds their numbers to
    /// those that are coded. Adds the places where the value that comes out is off.
    #[inline(always)]
    #[expect(
        clippy::cast_sign_loss,
        clippy::cast_possible_truncation,
        reason = "no step is more than 2^24, and the bits are meant"
    )]
    fn code(
        &self,
        run: &mut Run,
        step: f32,
        scratch: &mut Scratch,
        numbers: &mut Numbers,
        beyond: &mut Vec<usize>,
    ) {
        let count = run.len();
        let (values, steps) = (&mut scratch.values[..count], &mut scratch.steps[..count]);
        run.gather(self.values, values);
        let per_step = 1.0 / f64::from(step);
        let (unit, per_unit) =
            (two_to(i32::from(self.exponent)), two_to(-i32::from(self.exponent)));
        let near = run.near();
        for index in 0..count {
            let scaled = (values[index] - self.offset) * per_unit;
            let number = nearest_double((scaled - f64::from(near[index])) * per_step);
            // NaN, too.
            steps[index] = if number.abs() < MOST_STEPS { number as f32 } else { 0.0 };
        }
        let zigzag = &mut scratch.numbers[..count];
        for index in 0..count {
            let difference = steps[index] as i32;
            zigzag[index] = (difference << 1 ^ difference >> 31) as u32;
        }
        numbers.extend(zigzag, run.classes());
        run.step(step, steps);
        let now = run.now();
        let off = |index: usize| (self.offset + f64::from(now[index]) * unit - values[index]).abs();
        // No value that is no number is near.
        let near = (0..count).fold(0, |near, index| near + usize::from(off(index) <= self.bound));
        if near < count {
            let is_beyond = |&index: &usize| off(index).is_nan() || off(index) > self.bound;
            beyond.extend((0..count).filter(is_beyond).map(|index| run.place(index)));
        }
    }
}

impl Values<'_> {
    /// Puts the values of a run into their tuples.
    #[inline(always)]
    fn put(&mut self, run: &Run) {
        for (at, &now) in run.now().iter().enumerate() {
            self.tuples[run.place(at) * self.components + self.component] =
                self.offset + f64::from(now) * self.unit;
        }
    }
}
