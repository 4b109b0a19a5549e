//! One component of a field, in whole steps of its grid: each value as its difference to a
//! prediction.

use tombolo_deform::lanes::with_wide_registers;

use super::CodecError;
use super::bits::unzigzag;
use super::bytes::{Input, put_count};
use super::hierarchy::{BLOCK, Hierarchy};
use super::node::Node;
use super::prediction::{predict, sums, sums_of_block};
use super::rans::{Decoder, Histogram, Number, TABLES, encode};
use super::temporal::{Modes, SPACE, Ways, cheapest};

/// The number of contexts.
const CLASSES: usize = 17;
/// Where each context but the first begins.
const EDGES: [u16; CLASSES - 1] =
    [1, 3, 5, 8, 12, 17, 25, 35, 49, 70, 101, 145, 232, 377, 638, 1160];
/// The tables of the contexts before any are sent.
const FIRST_TABLES: [u8; CLASSES] =
    [2, 7, 9, 10, 11, 11, 12, 14, 15, 16, 18, 19, 20, 21, 23, 25, 28];
/// No difference counts for more than this in a context.
const MOST: f32 = 64.0;
/// The weights of the last frame's difference and of the preceding component's.
const LAST: f32 = 20.0;
const BESIDE: f32 = 12.0;
/// No difference is larger: in single precision all of them are exact.
const MOST_STEPS: f64 = 16_777_216.0;
/// From so many points on, one of so many is asked which way of prediction is best: it takes less
/// time, and costs two bits in a hundred.
const SAMPLED: [usize; 2] = [1 << 16, 3];
/// The bits that another table costs.
const TABLE_PRICE: f32 = 9.0;

/// One component of a field at all points.
#[derive(Debug, Clone)]
pub(super) struct Plane {
    pub(super) nodes: Vec<Node>,
    tables: [u8; CLASSES],
}

/// Everything that goes with a plane.
#[derive(Clone, Copy)]
pub(super) struct Around<'a> {
    pub(super) hierarchy: &'a Hierarchy,
    /// The points whose values are known without.
    pub(super) mask: Option<&'a [bool]>,
    /// The component before this one.
    pub(super) beside: Option<&'a [Node]>,
    /// Grid steps in a step of the difference.
    pub(super) step: f32,
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

/// The nearest whole number, the even one of two; by adding and subtracting a number that has no
/// digits behind the point. Beyond 2²², where it would have to be even, it is even.
#[inline(always)]
fn nearest(value: f32) -> f32 {
    const WHOLE: f32 = 12_582_912.0;
    (value + WHOLE) - WHOLE
}

/// The nearest whole number in double precision, up to 2⁵¹.
#[inline(always)]
fn nearest_double(value: f64) -> f64 {
    const WHOLE: f64 = 6_755_399_441_055_744.0;
    (value + WHOLE) - WHOLE
}

/// The context of each sum of magnitudes, which is a whole number below 2¹³.
#[inline(always)]
fn class(context: f32) -> usize {
    const LENGTH: usize = 1 << 13;
    static CLASS: [u8; LENGTH] = {
        let mut classes = [0; LENGTH];
        let (mut value, mut class) = (0, 0);
        while value < LENGTH {
            if class < EDGES.len() && value >= EDGES[class] as usize {
                class += 1;
            } else {
                classes[value] = class as u8;
                value += 1;
            }
        }
        classes
    };
    // With 2²³ added, the number stands in the lowest bits.
    let context = (context + 8_388_608.0).to_bits() as usize;
    usize::from(CLASS[context & (LENGTH - 1)])
}

impl Plane {
    /// A component of which nothing is known.
    pub(super) fn new(points: usize) -> Self {
        Self { nodes: vec![Node::ZERO; points], tables: FIRST_TABLES }
    }

    /// Makes the last frame the one before; `scale` is what a step of the old grid is in the new one.
    pub(super) fn shift(&mut self, scale: f32, is_second: bool) {
        for node in &mut self.nodes {
            let [magnitude, now, last, _] = node.0;
            let before = if is_second { now } else { last };
            *node = Node([magnitude, now, now * scale, before * scale]);
        }
    }

    #[inline(always)]
    fn context(&self, around: &Around<'_>, point: usize, sums: Node) -> usize {
        let beside = around.beside.map_or(0.0, |beside| beside[point].magnitude());
        class(sums.magnitude() + LAST * self.nodes[point].magnitude() + BESIDE * beside)
    }

    /// The ways of prediction for a frame that goes on. The nodes have its values then.
    #[inline(always)]
    fn ways(&mut self, around: &Around<'_>, wanted: &Wanted<'_>) -> Ways {
        let per_unit = two_to(-i32::from(wanted.exponent));
        for (point, (node, value)) in self.nodes.iter_mut().zip(wanted.values).enumerate() {
            if around.mask.is_some_and(|mask| mask[point]) {
                continue;
            }
            #[expect(clippy::cast_possible_truncation, reason = "to compare with")]
            let value = ((value - wanted.offset) * per_unit) as f32;
            // Where nothing can be compared, nothing has changed.
            let [magnitude, _, last, _] = node.0;
            node.set(magnitude, if value.is_finite() { value } else { last });
        }
        Ways::new(&self.nodes, around.hierarchy.stencils(), around.mask, around.step)
    }

    /// Codes the next frame of these values; `follows` says whether it goes on from the last. Returns
    /// the places whose values come out further off than they may: those that are not finite, or
    /// beyond every step.
    pub(super) fn encode(
        &mut self,
        around: Around<'_>,
        follows: bool,
        wanted: Wanted<'_>,
        out: &mut Vec<u8>,
    ) -> Vec<usize> {
        with_wide_registers(
            #[inline(always)]
            || self.encode_with(around, follows, wanted, out),
        )
    }

    #[inline(always)]
    fn encode_with(
        &mut self,
        around: Around<'_>,
        follows: bool,
        wanted: Wanted<'_>,
        out: &mut Vec<u8>,
    ) -> Vec<usize> {
        let points = self.nodes.len();
        let (stencils, leans) = (around.hierarchy.stencils(), around.hierarchy.leans());
        let per_step = 1.0 / f64::from(around.step);
        let (unit, per_unit) =
            (two_to(i32::from(wanted.exponent)), two_to(-i32::from(wanted.exponent)));
        let ways = follows.then(|| self.ways(&around, &wanted));
        let mut modes = match &ways {
            Some(ways) => ways.modes(points),
            None => Modes::uniform(SPACE),
        };
        let stride = if points < SAMPLED[0] { 1 } else { SAMPLED[1] };
        let mut known = [Node::ZERO; BLOCK];
        let mut coded = Vec::with_capacity(points);
        let mut histograms = [const { Histogram::NEW }; CLASSES];
        let mut beyond = Vec::new();
        for start in (0..points).step_by(BLOCK) {
            let block = start..points.min(start + BLOCK);
            let mut by = modes.coefficients(SPACE);
            let mask = around.mask.map(|mask| &mask[block.clone()]);
            let is_masked = |point: usize| mask.is_some_and(|mask| mask[point - start]);
            sums_of_block(&self.nodes, &stencils[block.clone()], mask, &mut known);
            if let Some(ways) = &ways {
                // Neighbours in this block are taken as they are, not as they will be coded.
                let mut costs = [0.0; 4];
                for point in block.clone().step_by(stride) {
                    if !is_masked(point) {
                        ways.add_costs(known[point - start], self.nodes[point], &mut costs);
                    }
                }
                let mode = cheapest(costs);
                modes.push(mode);
                by = modes.coefficients(mode);
            }
            for point in block {
                if is_masked(point) {
                    continue;
                }
                let sums = match leans[point] {
                    true => sums(&self.nodes, &stencils[point]),
                    false => known[point - start],
                };
                let class = self.context(&around, point, sums);
                let near = nearest(predict(sums, self.nodes[point], by));
                let value = wanted.values[point];
                let scaled = (value - wanted.offset) * per_unit;
                let steps = nearest_double((scaled - f64::from(near)) * per_step);
                // NaN, too.
                let steps = if steps.abs() < MOST_STEPS { steps as f32 } else { 0.0 };
                let now = near + around.step * steps;
                self.nodes[point].set(steps.abs().min(MOST), now);
                let off = (wanted.offset + f64::from(now) * unit - value).abs();
                if off.is_nan() || off > wanted.bound {
                    beyond.push(point);
                }
                #[expect(clippy::cast_possible_truncation, reason = "checked above")]
                let difference = steps as i32;
                #[expect(
                    clippy::cast_sign_loss,
                    clippy::cast_possible_truncation,
                    reason = "the bits are meant, and there are 17 classes"
                )]
                let number = Number::new((difference << 1 ^ difference >> 31) as u32, class as u8);
                histograms[class].add(number);
                coded.push(number);
            }
        }
        modes.settle();

        let (mut changed, mut has_plain) = (0u32, false);
        for (class, histogram) in histograms.iter().enumerate() {
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
        let lanes = match coded.len() {
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
        encode(&coded, &self.tables, has_plain, u32::from(lanes), out);
        beyond
    }

    /// Reads the next frame.
    pub(super) fn decode(
        &mut self,
        around: Around<'_>,
        input: &mut Input<'_>,
    ) -> Result<(), CodecError> {
        with_wide_registers(
            #[inline(always)]
            || self.decode_with(around, input),
        )
    }

    #[inline(always)]
    fn decode_with(&mut self, around: Around<'_>, input: &mut Input<'_>) -> Result<(), CodecError> {
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
        let mut decoder = Decoder::new(u32::from(flags & 3), input)?;
        let (stencils, leans) = (around.hierarchy.stencils(), around.hierarchy.leans());
        let mut known = [Node::ZERO; BLOCK];
        for start in (0..points).step_by(BLOCK) {
            let block = start..points.min(start + BLOCK);
            let by = modes.of(start);
            let mask = around.mask.map(|mask| &mask[block.clone()]);
            let is_masked = |point: usize| mask.is_some_and(|mask| mask[point - start]);
            sums_of_block(&self.nodes, &stencils[block.clone()], mask, &mut known);
            for point in block {
                if is_masked(point) {
                    continue;
                }
                let sums = match leans[point] {
                    true => sums(&self.nodes, &stencils[point]),
                    false => known[point - start],
                };
                let class = self.context(&around, point, sums);
                let number = decoder.next(self.tables[class]);
                #[expect(clippy::cast_possible_truncation, reason = "of 32 bits")]
                let difference = unzigzag(u64::from(number)) as i32;
                let near = nearest(predict(sums, self.nodes[point], by));
                let difference = difference as f32;
                let now = near + around.step * difference;
                self.nodes[point].set(difference.abs().min(MOST), now);
            }
        }
        decoder.finish()
    }
}
