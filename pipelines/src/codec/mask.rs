//! Which points share one and the same tuple with many others: walls, an inlet, a hole.

use super::CodecError;
use super::bits::{Bits, Model, Reader, Writer};
use super::bytes::{Input, put_block};
use super::hierarchy::Stencil;

/// How many neighbours a point's context counts.
const COUNTED: usize = 4;
/// The most tuples.
const MOST: usize = 4;
/// Fewer points are not worth a tuple of their own, but for the first.
const LEAST: usize = 32;

/// The points that have one of a few tuples.
#[derive(Debug, Clone)]
pub(super) struct Mask {
    /// The points that have one.
    pub(super) points: Vec<bool>,
    /// Which: 1 is the first, 0 is none.
    of: Vec<u8>,
    tuples: Vec<Vec<f64>>,
}

/// Codes which points have a tuple, of those that have none yet.
fn code<B: Bits>(
    bits: &mut B,
    stencils: &[Stencil],
    of: &mut [u8],
    tuple: u8,
) -> Result<(), CodecError> {
    let mut models = [Model::NEW; COUNTED + 1];
    for (point, stencil) in stencils.iter().enumerate() {
        if (1..tuple).contains(&of[point]) {
            continue;
        }
        let is_set = |&index: &u32| (index as usize) < point && of[index as usize] == tuple;
        let context = stencil.indices[..COUNTED].iter().filter(|index| is_set(index)).count();
        if bits.bit(&mut models[context], of[point] == tuple)? {
            of[point] = tuple;
        }
    }
    Ok(())
}

fn same(a: &[f64], b: &[f64]) -> bool {
    a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
}

/// A number that equal tuples share; of one value its bits.
fn print(tuple: &[f64]) -> u64 {
    let add = |print: u64, value: &f64| {
        print.wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(32) ^ value.to_bits()
    };
    tuple.iter().fold(0, add)
}

impl Mask {
    /// The tuples that many points share, where they are enough to be worth it. `order` says which
    /// tuple stands at each index.
    pub(super) fn find(values: &[f64], components: usize, order: &[u32]) -> Option<Self> {
        const SAMPLES: usize = 64;
        let tuple = |index: usize| &values[order[index] as usize * components..][..components];
        let mut mask = Self { points: vec![], of: vec![0; order.len()], tuples: vec![] };
        let mut number = 0;
        // The indices that have no tuple yet; at first all of them.
        let mut left: Option<Vec<usize>> = None;
        while mask.tuples.len() < MOST {
            let count = left.as_ref().map_or(order.len(), Vec::len);
            let at = |index: usize| left.as_ref().map_or(index, |left| left[index]);
            let stride = count.div_ceil(SAMPLES).max(1);
            let sample: Vec<&[f64]> =
                (0..count).step_by(stride).map(|index| tuple(at(index))).collect();
            let prints: Vec<u64> = sample.iter().map(|tuple| print(tuple)).collect();
            let shares = |print: u64| prints.iter().filter(|&&other| other == print).count();
            let found = sample.iter().zip(&prints).map(|(tuple, &print)| (shares(print), *tuple));
            let found = found.max_by_key(|of| of.0);
            let Some((share, best)) = found else { break };
            if share * 16 < sample.len() || share < 2 {
                break;
            }
            let (set, rest): (Vec<usize>, Vec<usize>) =
                (0..count).map(at).partition(|&index| same(tuple(index), best));
            if set.len() * 16 < count || (number > 0 && set.len() < LEAST) {
                break;
            }
            left = Some(rest);
            number += 1;
            set.into_iter().for_each(|index| mask.of[index] = number);
            mask.tuples.push(best.to_vec());
        }
        if number == 0 {
            return None;
        }
        mask.points = mask.of.iter().map(|&of| of != 0).collect();
        Some(mask)
    }

    pub(super) fn is_as(&self, other: &Self) -> bool {
        let tuples = || self.tuples.iter().zip(&other.tuples).all(|(a, b)| same(a, b));
        self.of == other.of && self.tuples.len() == other.tuples.len() && tuples()
    }

    #[expect(clippy::cast_possible_truncation, reason = "there are at most four")]
    pub(super) fn write(
        &self,
        stencils: &[Stencil],
        message: &mut Vec<u8>,
    ) -> Result<(), CodecError> {
        let is_zero = |tuple: &[f64]| tuple.iter().all(|value| value.to_bits() == 0);
        // How many there are, and which of them are all zero.
        let zeros =
            self.tuples.iter().rev().fold(0, |bits, tuple| bits << 1 | u8::from(is_zero(tuple)));
        message.push(self.tuples.len() as u8 | zeros << 3);
        for (tuple, number) in self.tuples.iter().zip(1..) {
            if !is_zero(tuple) {
                message.extend(tuple.iter().flat_map(|value| value.to_le_bytes()));
            }
            let mut bits = Writer::new();
            code(&mut bits, stencils, &mut self.of.clone(), number)?;
            put_block(message, &bits.finish());
        }
        Ok(())
    }

    #[expect(clippy::cast_possible_truncation, reason = "there are at most four")]
    pub(super) fn read(
        components: usize,
        stencils: &[Stencil],
        input: &mut Input<'_>,
    ) -> Result<Self, CodecError> {
        let byte = input.byte()?;
        let count = usize::from(byte & 7);
        if count > MOST {
            return Err(CodecError::Damaged("more tuples than there may be"));
        }
        let (mut of, mut tuples) = (vec![0; stencils.len()], Vec::new());
        for number in 1..=count as u8 {
            let is_zero = byte >> (2 + number) & 1 == 1;
            tuples.push(if is_zero { vec![0.0; components] } else { input.doubles(components)? });
            code(&mut Reader::new(input.block()?), stencils, &mut of, number)?;
        }
        Ok(Self { points: of.iter().map(|&of| of != 0).collect(), of, tuples })
    }

    /// The indices that have a tuple, with it.
    pub(super) fn tuples(&self) -> impl Iterator<Item = (usize, &[f64])> {
        let tuple = |(index, &of): (usize, &u8)| {
            let tuple = usize::from(of).checked_sub(1)?;
            Some((index, &self.tuples[tuple][..]))
        };
        self.of.iter().enumerate().filter_map(tuple)
    }
}
