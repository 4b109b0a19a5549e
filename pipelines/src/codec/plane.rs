//! One component of a field, in whole steps of its grid: each value as its difference to a
//! prediction.

use super::CodecError;
use super::bits::unzigzag;
use super::bytes::{Input, put_count};
use super::hierarchy::Stencil;
use super::prediction::{Node, predict, sums};
use super::rans::{Decoder, Histogram, TABLES, encode};
use super::temporal::{BLOCK, Modes};

/// The number of contexts.
const CLASSES: usize = 17;
/// Where each context but the first begins.
const EDGES: [u16; CLASSES - 1] =
    [1, 3, 5, 8, 12, 17, 25, 35, 49, 70, 101, 145, 232, 377, 638, 1160];
/// The tables of the contexts before any are sent.
const FIRST_TABLES: [u8; CLASSES] =
    [2, 7, 9, 10, 11, 11, 12, 14, 15, 16, 18, 19, 20, 21, 23, 25, 28];
/// No difference counts for more than this in a context.
const MOST: u32 = 64;
/// The weights of the last frame's difference and of the preceding component's.
const LAST: f32 = 20.0;
const BESIDE: f32 = 12.0;
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

/// Everything that goes with a plane.
#[derive(Clone, Copy)]
pub(super) struct Around<'a> {
    pub(super) stencils: &'a [Stencil],
    /// The points whose values are known without.
    pub(super) mask: Option<&'a [bool]>,
    /// The component before this one.
    pub(super) beside: Option<&'a [Node]>,
    /// Grid steps in a step of the difference.
    pub(super) step: f32,
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
        Self { nodes: vec![[0.0; 4]; points], tables: FIRST_TABLES }
    }

    /// Makes the last frame the one before; `scale` is what a step of the old grid is in the new one.
    pub(super) fn shift(&mut self, scale: f32, is_second: bool) {
        for node in &mut self.nodes {
            let [now, last, _, magnitude] = *node;
            let before = if is_second { now } else { last };
            *node = [now, now * scale, before * scale, magnitude];
        }
    }

    #[inline]
    fn context(&self, around: &Around<'_>, point: usize, sums: Node) -> usize {
        let beside = around.beside.map_or(0.0, |beside| beside[point][3]);
        class(sums[3] + LAST * self.nodes[point][3] + BESIDE * beside)
    }

    /// Codes the next frame of these values, in grid steps. Those that are not finite, or too far
    /// away, become something else: what the nodes hold is what will be read.
    pub(super) fn encode(
        &mut self,
        around: Around<'_>,
        modes: &Modes,
        values: &[f64],
        out: &mut Vec<u8>,
    ) {
        let points = self.nodes.len();
        let per_step = 1.0 / f64::from(around.step);
        let mut coded = Vec::with_capacity(points);
        let mut histograms = [const { Histogram::NEW }; CLASSES];
        for block in 0..points.div_ceil(BLOCK) {
            let by = modes.of(block * BLOCK);
            for point in block * BLOCK..points.min((block + 1) * BLOCK) {
                if around.mask.is_some_and(|mask| mask[point]) {
                    continue;
                }
                let sums = sums(&self.nodes, &around.stencils[point]);
                let class = self.context(&around, point, sums);
                let near = nearest(predict(sums, self.nodes[point], by));
                let steps = nearest_double((values[point] - f64::from(near)) * per_step);
                // NaN, too.
                let steps = if steps.abs() < MOST_STEPS { steps as f32 } else { 0.0 };
                #[expect(clippy::cast_possible_truncation, reason = "checked above")]
                let difference = steps as i32;
                self.nodes[point][0] = near + around.step * steps;
                self.nodes[point][3] = difference.unsigned_abs().min(MOST) as f32;
                #[expect(clippy::cast_sign_loss, reason = "the bits are meant")]
                let number = (difference << 1 ^ difference >> 31) as u32;
                histograms[class].add(number);
                #[expect(clippy::cast_possible_truncation, reason = "there are 17")]
                coded.push((class as u8, number));
            }
        }

        let mut changed = 0u32;
        for (class, histogram) in histograms.iter().enumerate() {
            if histogram.is_empty() {
                continue;
            }
            let table = histogram.best(self.tables[class], TABLE_PRICE);
            if table != self.tables[class] {
                changed |= 1 << class;
                self.tables[class] = table;
            }
        }
        for (class, _) in &mut coded {
            *class = self.tables[usize::from(*class)];
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
        encode(&coded, u32::from(lanes), out);
    }

    /// Reads the next frame.
    pub(super) fn decode(
        &mut self,
        around: Around<'_>,
        input: &mut Input<'_>,
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
        let mut decoder = Decoder::new(u32::from(flags & 3), input)?;
        for block in 0..points.div_ceil(BLOCK) {
            let by = modes.of(block * BLOCK);
            for point in block * BLOCK..points.min((block + 1) * BLOCK) {
                if around.mask.is_some_and(|mask| mask[point]) {
                    continue;
                }
                let sums = sums(&self.nodes, &around.stencils[point]);
                let class = self.context(&around, point, sums);
                let number = decoder.next(self.tables[class]);
                #[expect(clippy::cast_possible_truncation, reason = "of 32 bits")]
                let difference = unzigzag(u64::from(number)) as i32;
                let near = nearest(predict(sums, self.nodes[point], by));
                let node = &mut self.nodes[point];
                node[0] = near + around.step * difference as f32;
                node[3] = difference.unsigned_abs().min(MOST) as f32;
            }
        }
        decoder.finish()
    }
}
