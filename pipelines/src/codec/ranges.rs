//! Least and largest values.

/// The least and the largest finite value of each component; none is larger than infinity.
pub(crate) fn ranges(values: &[f64], components: usize) -> Vec<[f64; 2]> {
    let lanes = match components {
        1 => ranges_of::<4>(values),
        2 => ranges_of::<8>(values),
        3 => ranges_of::<12>(values),
        _ => values.chunks(components.max(1)).fold(
            vec![NO_RANGE; components],
            |mut ranges, tuple| {
                ranges.iter_mut().zip(tuple).for_each(|(range, &value)| widen(range, value));
                ranges
            },
        ),
    };
    let mut ranges = vec![NO_RANGE; components];
    for (lane, of_lane) in lanes.into_iter().enumerate() {
        let [least, largest] = &mut ranges[lane % components];
        *least = least.min(of_lane[0]);
        *largest = largest.max(of_lane[1]);
    }
    ranges
}

const NO_RANGE: [f64; 2] = [f64::INFINITY, f64::NEG_INFINITY];

#[inline(always)]
fn widen([least, largest]: &mut [f64; 2], value: f64) {
    let is_finite = value.abs() < f64::INFINITY;
    *least = if is_finite && value < *least { value } else { *least };
    *largest = if is_finite && value > *largest { value } else { *largest };
}

/// The ranges of so many values that stand side by side.
fn ranges_of<const LANES: usize>(values: &[f64]) -> Vec<[f64; 2]> {
    let (mut least, mut largest) = ([NO_RANGE[0]; LANES], [NO_RANGE[1]; LANES]);
    let (rounds, rest) = values.as_chunks::<LANES>();
    let mut take = |lane: usize, value: f64| {
        let mut range = [least[lane], largest[lane]];
        widen(&mut range, value);
        [least[lane], largest[lane]] = range;
    };
    for round in rounds {
        (0..LANES).for_each(|lane| take(lane, round[lane]));
    }
    rest.iter().enumerate().for_each(|(lane, &value)| take(lane, value));
    least.into_iter().zip(largest).map(|(least, largest)| [least, largest]).collect()
}
