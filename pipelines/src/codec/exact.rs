//! Values bit by bit: the bits of each as a whole number, less those of a prediction.

use super::CodecError;
use super::bits::{Bits, Number, Reader, Writer, zigzag};
use super::hierarchy::Stencil;

/// The contexts: by how long the number of the nearest neighbour was, in bytes.
const CONTEXTS: usize = 9;

/// The precision of the numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Precision {
    Single,
    Double,
}

/// A number whose order is that of the values.
#[expect(clippy::cast_possible_truncation, clippy::cast_possible_wrap, reason = "bits are meant")]
fn ordered(value: f64, precision: Precision) -> i64 {
    match precision {
        Precision::Single => {
            let bits = (value as f32).to_bits() as i32;
            i64::from(bits ^ (((bits >> 31) as u32) >> 1) as i32)
        }
        Precision::Double => {
            let bits = value.to_bits() as i64;
            bits ^ (((bits >> 63) as u64) >> 1) as i64
        }
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "bits are meant")]
fn value(ordered: i64, precision: Precision) -> f64 {
    match precision {
        Precision::Single => {
            let bits = ordered as i32;
            f64::from(f32::from_bits((bits ^ (((bits >> 31) as u32) >> 1) as i32) as u32))
        }
        Precision::Double => {
            f64::from_bits((ordered ^ (((ordered >> 63) as u64) >> 1) as i64) as u64)
        }
    }
}

/// The precision that holds all of these values bit by bit.
pub(super) fn precision(values: &[f64]) -> Precision {
    #[expect(clippy::cast_possible_truncation, reason = "that is the question")]
    let is_single = |&value: &f64| !value.is_nan() && f64::from(value as f32) == value;
    if values.iter().all(is_single) { Precision::Single } else { Precision::Double }
}

/// Codes one component, index after index. `last` are its values in the last frame.
fn code<B: Bits>(
    bits: &mut B,
    stencils: &[Stencil],
    values: &mut [f64],
    last: Option<&[f64]>,
    precision: Precision,
) -> Result<(), CodecError> {
    let mut models = vec![Number::NEW; CONTEXTS];
    let mut lengths = vec![0u8; values.len()];
    for (point, stencil) in stencils.iter().enumerate() {
        let near = match last {
            Some(last) => last[point],
            None => {
                let mut sum = 0.0;
                for (&index, &weight) in stencil.indices.iter().zip(&stencil.weights) {
                    if weight != 0.0 {
                        sum += f64::from(weight) * values[index as usize];
                    }
                }
                sum
            }
        };
        let near = ordered(if near.is_finite() { near } else { 0.0 }, precision);
        let difference = ordered(values[point], precision).wrapping_sub(near);
        let context = usize::from(lengths[stencil.indices[0] as usize]).div_ceil(8);
        let difference = bits.signed(&mut models[context], difference)?;
        #[expect(clippy::cast_possible_truncation, reason = "at most 64")]
        {
            lengths[point] = (u64::BITS - zigzag(difference).leading_zeros()) as u8;
        }
        values[point] = value(near.wrapping_add(difference), precision);
    }
    Ok(())
}

pub(super) fn encode(
    stencils: &[Stencil],
    values: &[f64],
    last: Option<&[f64]>,
    precision: Precision,
) -> Result<Vec<u8>, CodecError> {
    let mut bits = Writer::new();
    code(&mut bits, stencils, &mut values.to_vec(), last, precision)?;
    Ok(bits.finish())
}

pub(super) fn decode(
    stencils: &[Stencil],
    last: Option<&[f64]>,
    precision: Precision,
    bytes: &[u8],
) -> Result<Vec<f64>, CodecError> {
    let mut values = vec![0.0; stencils.len()];
    code(&mut Reader::new(bytes), stencils, &mut values, last, precision)?;
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::super::bits::unzigzag;
    use super::*;

    #[test]
    fn every_bit_comes_back() {
        for bits in [0, 1, 1 << 63, u64::MAX, 0x7ff0 << 48, 0xfff8_0000_0000_0001, 0x3ff << 52] {
            let there = f64::from_bits(bits);
            let back = value(ordered(there, Precision::Double), Precision::Double);
            assert_eq!(back.to_bits(), bits);
        }
        for single in [0.0f32, -0.0, 1.5, -1.5e-40, f32::INFINITY, f32::NEG_INFINITY, f32::MAX] {
            let back = value(ordered(f64::from(single), Precision::Single), Precision::Single);
            assert_eq!(back.to_bits(), f64::from(single).to_bits());
        }
        let rising = [f64::NEG_INFINITY, -1.0, -1e-310, -0.0, 0.0, 1e-310, 2.0, f64::INFINITY];
        assert!(rising.map(|value| ordered(value, Precision::Double)).is_sorted());
        assert_eq!(unzigzag(zigzag(i64::MIN)), i64::MIN);
    }
}
