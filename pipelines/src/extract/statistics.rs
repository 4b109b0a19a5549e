//! Measures of a field over the whole mesh.

use super::{FieldView, is_absent};
use tombolo_deform::communicator::{Communicator, Reduction};

/// Measures of a field: of its value for a scalar, of its magnitude for a vector or tensor.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldStatistics {
    /// The least; NaN where there is no finite value.
    pub min: f64,
    /// The largest; NaN where there is no finite value.
    pub max: f64,
    /// The mean over the vertices or cells, not weighted; NaN where there is no finite value.
    pub mean: f64,
    /// The root of the mean square; NaN where there is no finite value.
    pub l2: f64,
    /// How many vertices or cells have a component that is NaN or infinite. They are left out of
    /// the other measures.
    pub non_finite: u64,
    /// The first of them on this rank, and what was found there.
    pub first_non_finite: Option<(usize, f64)>,
}

/// How many tuples or cells are added up before their sum is: the sums lose less to rounding.
pub(crate) const CHUNK: usize = 4096;

/// The statistics of a field over the vertices or cells of all ranks for which `counts` holds.
/// Collective.
///
/// The field must fit its mesh: there is nothing to go wrong then, so that no rank waits for
/// another.
pub fn statistics(
    field: &FieldView,
    communicator: &dyn Communicator,
    counts: &dyn Fn(usize) -> bool,
) -> FieldStatistics {
    let values = &field.values;
    let (mut least, mut largest) = (f64::INFINITY, f64::NEG_INFINITY);
    let (mut sum, mut scaled_squares, mut count, mut non_finite) = (0.0, 0.0, 0.0_f64, 0.0_f64);
    let mut first_non_finite = None;
    // The squares of large values would overflow: they are taken of the values over the largest.
    let mut scale = 0.0_f64;
    for tuple in (0..values.len()).filter(|&tuple| counts(tuple)) {
        let value = values.magnitude(tuple);
        if value.is_finite() {
            scale = scale.max(value.abs());
        }
    }
    let widest = communicator.reduced(Reduction::Maximum, scale);
    let scale = if widest > 0.0 { widest } else { 1.0 };
    for start in (0..values.len()).step_by(CHUNK) {
        let (mut part_sum, mut part_squares) = (0.0, 0.0);
        for tuple in (start..values.len().min(start + CHUNK)).filter(|&tuple| counts(tuple)) {
            let value = values.magnitude(tuple);
            if (0..values.components()).any(|component| is_absent(values.get(tuple, component))) {
                continue;
            }
            if !value.is_finite() {
                non_finite += 1.0;
                let found = (0..values.components()).map(|component| values.get(tuple, component));
                first_non_finite = first_non_finite
                    .or(Some((tuple, found.into_iter().find(|x| !x.is_finite()).unwrap_or(value))));
                continue;
            }
            least = least.min(value);
            largest = largest.max(value);
            part_sum += value / scale;
            part_squares += (value / scale).powi(2);
            count += 1.0;
        }
        sum += part_sum;
        scaled_squares += part_squares;
    }
    let mut range = [[least, largest]];
    communicator.join_ranges(&mut range);
    let [[least, largest]] = range;
    let mut sums = [sum, scaled_squares, count, non_finite];
    communicator.reduce(Reduction::Sum, &mut sums);
    let [sum, scaled_squares, count, non_finite] = sums;
    let or_nan = |value: f64| if count > 0.0 { value } else { f64::NAN };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count")]
    let non_finite = non_finite as u64;
    FieldStatistics {
        min: or_nan(least),
        max: or_nan(largest),
        mean: or_nan(sum / count * scale),
        l2: or_nan((scaled_squares / count).sqrt() * scale),
        non_finite,
        first_non_finite,
    }
}
