//! How the values of a field are spread over an extract or the whole mesh.

use tombolo_deform::communicator::Reduction;

use super::region::{Chosen, Part, Region, Wanted};
use super::weights::Weights;
use crate::extract::{Association, FieldView, is_absent};
use crate::language::{Histogram, Weight};

/// The values of the monitors of a stage: the range, what lies below and above, and the bins; NaN
/// where any rank has failed. Collective.
///
/// # Errors
/// In the second part: what is missing on this rank, or does not fit.
pub(crate) fn histogram(stage: &Histogram, region: &Region) -> (Vec<f64>, Option<String>) {
    const ANY: [usize; 9] = [1, 2, 3, 4, 5, 6, 7, 8, 9];
    let wanted = [Wanted { name: &stage.field, components: &ANY }];
    let gathered = match stage.by {
        // A vertex that several ranks have counts once.
        Weight::Count => region.gathered(&wanted),
        Weight::Size => region.surface(&wanted),
    };
    let part = region.part(&gathered, &wanted, &stage.features);
    let Chosen { dimension, is_known } = region.agreed(&part);
    let mut entries = Vec::new();
    if let Ok(part) = &part
        && let Some(field) = part.fields.first().and_then(Option::as_ref)
    {
        entries = match stage.by {
            Weight::Size => by_size(region, part, field, dimension),
            Weight::Count => by_count(region, part, field, dimension),
        };
    }
    let [lower, upper] = range(stage, region, &entries);
    let bins = stage.bins as usize;
    let mut counts = vec![0.0; bins + 2];
    for &(value, weight) in &entries {
        counts[place(value, [lower, upper], bins)] += weight;
    }
    region.communicator.reduce(Reduction::Sum, &mut counts);
    let mut values = vec![lower, upper, counts[bins], counts[bins + 1]];
    values.extend(&counts[..bins]);
    if !is_known {
        values.fill(f64::NAN);
    }
    (values, part.err().filter(|message| !message.is_empty()))
}

/// The magnitude of a value; `None` where it is absent or not finite.
fn magnitude(field: &FieldView, entity: usize) -> Option<f64> {
    let values = &field.values;
    if (0..values.components()).any(|part| is_absent(values.get(entity, part))) {
        return None;
    }
    let value = values.magnitude(entity);
    value.is_finite().then_some(value)
}

/// Each vertex or cell once.
fn by_count(region: &Region, part: &Part, field: &FieldView, dimension: usize) -> Vec<(f64, f64)> {
    let counted = |entity: usize| magnitude(field, entity).map(|value| (value, 1.0));
    let cells = (0..part.cells.len()).filter(|&cell| region.counts(part, cell, dimension));
    if field.association == Association::Element {
        return cells.filter_map(counted).collect();
    }
    let mut is_of_region = vec![false; part.points.len()];
    if region.stage.is_none() {
        is_of_region.fill(true);
    }
    for cell in cells {
        part.cells.vertices(cell).iter().for_each(|&vertex| is_of_region[vertex as usize] = true);
    }
    let is_own = |vertex: &usize| {
        is_of_region[*vertex]
            && (region.stage.is_some() || region.source.counts(Association::Vertex, *vertex))
    };
    (0..part.points.len()).filter(is_own).filter_map(counted).collect()
}

/// Each vertex with its part of the sizes of the cells around, or each cell with its size.
fn by_size(region: &Region, part: &Part, field: &FieldView, dimension: usize) -> Vec<(f64, f64)> {
    let mut entries = Vec::new();
    let mut weights = Weights::default();
    for cell in (0..part.cells.len()).filter(|&cell| region.counts(part, cell, dimension)) {
        weights.find(part.cells, cell, part.points);
        if field.association == Association::Element {
            entries.extend(magnitude(field, cell).map(|value| (value, weights.size)));
            continue;
        }
        let of_vertex = |&(vertex, size, _): &(u32, f64, _)| {
            magnitude(field, vertex as usize).map(|value| (value, size))
        };
        entries.extend(weights.parts.iter().filter_map(of_vertex));
    }
    entries
}

/// The range that was given, or that of the values. Collective.
fn range(stage: &Histogram, region: &Region, entries: &[(f64, f64)]) -> [f64; 2] {
    if let Some(range) = stage.range {
        return range;
    }
    let mut range = [f64::INFINITY, f64::NEG_INFINITY];
    for &(value, _) in entries {
        range = [range[0].min(value), range[1].max(value)];
    }
    region.communicator.join_ranges(std::slice::from_mut(&mut range));
    let [lower, upper] = range;
    if lower <= upper { [lower, upper] } else { [f64::NAN; 2] }
}

/// The bin of a value; behind the bins stand what is below and what is above.
fn place(value: f64, [lower, upper]: [f64; 2], bins: usize) -> usize {
    if value < lower {
        return bins;
    }
    if value > upper {
        return bins + 1;
    }
    #[expect(clippy::cast_precision_loss, reason = "few bins")]
    let place = (value / 2.0 - lower / 2.0) / (upper / 2.0 - lower / 2.0) * bins as f64;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "from 0 to the number of bins; NaN, where all values are one, is 0"
    )]
    let place = place as usize;
    place.min(bins - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ends_belong_to_the_outer_bins() {
        let place = |value| place(value, [-1.0, 3.0], 4);
        assert_eq!([-1.0, -0.001, 0.0, 2.0, 3.0].map(place), [0, 0, 1, 3, 3]);
        assert_eq!([-1.001, 3.001].map(place), [4, 5]);
        assert_eq!(super::place(2.0, [2.0, 2.0], 4), 0, "one value alone");
        let wide = super::place(f64::MAX, [-f64::MAX, f64::MAX], 7);
        assert_eq!(wide, 6, "a range that no number holds");
    }
}
