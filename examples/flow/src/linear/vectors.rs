//! Loops and sums over long vectors, threaded and with the same bits whatever the number of
//! threads.

use rayon::prelude::*;

/// How many entries one task works on. Fixed, so that sums do not depend on the number of threads.
pub const CHUNK: usize = 2048;

/// Below this length a second thread costs more than it gains.
const SERIAL: usize = 2 * CHUNK;

/// Calls `visit` with each entry of `values` and its index.
pub fn for_each<T: Send>(values: &mut [T], visit: impl Fn(usize, &mut T) + Sync) {
    let visit_all = |first: usize, values: &mut [T]| {
        (first..).zip(values).for_each(|(index, value)| visit(index, value))
    };
    if values.len() <= SERIAL {
        visit_all(0, values);
    } else {
        values
            .par_chunks_mut(CHUNK)
            .enumerate()
            .for_each(|(chunk, slice)| visit_all(chunk * CHUNK, slice));
    }
}

/// The sum over `0..length` of several quantities at once; `part` sums over a range.
#[must_use]
pub fn sum<const N: usize>(
    length: usize,
    part: impl Fn(std::ops::Range<usize>) -> [f64; N] + Sync,
) -> [f64; N] {
    let range = |chunk: usize| chunk * CHUNK..((chunk + 1) * CHUNK).min(length);
    let chunks = length.div_ceil(CHUNK);
    let add = |mut total: [f64; N], more: [f64; N]| {
        for (total, more) in total.iter_mut().zip(more) {
            *total += more;
        }
        total
    };
    if length <= SERIAL {
        return (0..chunks).map(|chunk| part(range(chunk))).fold([0.0; N], add);
    }
    let parts: Vec<[f64; N]> =
        (0..chunks).into_par_iter().map(|chunk| part(range(chunk))).collect();
    parts.into_iter().fold([0.0; N], add)
}
