//! Which points have one and the same value, and which have not.

use super::CodecError;
use super::bits::{Bits, Model, Reader, Writer};
use super::hierarchy::Stencil;

/// How many neighbours a point's context counts.
const COUNTED: usize = 4;

fn code<B: Bits>(bits: &mut B, stencils: &[Stencil], mask: &mut [bool]) -> Result<(), CodecError> {
    let mut models = [Model::NEW; COUNTED + 1];
    for (point, stencil) in stencils.iter().enumerate() {
        let is_set = |&place: &u32| (place as usize) < point && mask[place as usize];
        let context = stencil.places[..COUNTED].iter().filter(|place| is_set(place)).count();
        mask[point] = bits.bit(&mut models[context], mask[point])?;
    }
    Ok(())
}

pub(super) fn encode(stencils: &[Stencil], mask: &[bool]) -> Result<Vec<u8>, CodecError> {
    let mut bits = Writer::new();
    code(&mut bits, stencils, &mut mask.to_vec())?;
    Ok(bits.finish())
}

pub(super) fn decode(stencils: &[Stencil], bytes: &[u8]) -> Result<Vec<bool>, CodecError> {
    let mut mask = vec![false; stencils.len()];
    code(&mut Reader::new(bytes), stencils, &mut mask)?;
    Ok(mask)
}

/// The tuple that most of a sample share, and the points that have it, where they are enough to be
/// worth a mask. `order` says which tuple stands at each place.
pub(super) fn find(values: &[f64], components: usize, order: &[u32]) -> Option<Vec<bool>> {
    const SAMPLES: usize = 64;
    let tuple = |place: usize| &values[order[place] as usize * components..][..components];
    let same = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits());
    let count = order.len();
    let stride = count.div_ceil(SAMPLES).max(1);
    let sample: Vec<&[f64]> = (0..count).step_by(stride).map(tuple).collect();
    let shares = |candidate: &[f64]| sample.iter().filter(|other| same(candidate, other)).count();
    let (share, best) = sample.iter().map(|tuple| (shares(tuple), *tuple)).max_by_key(|of| of.0)?;
    if share * 16 < sample.len() || share < 2 {
        return None;
    }
    let mask: Vec<bool> = (0..count).map(|place| same(tuple(place), best)).collect();
    let set = mask.iter().filter(|&&is_set| is_set).count();
    (set * 16 >= count).then_some(mask)
}
