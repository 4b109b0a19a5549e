//! Numbers as small integers within a bound.

use super::wire::{Filter, Kind, delta};
use crate::language::ErrorBound;

/// Values ready to be compressed.
pub(super) struct Packed {
    pub(super) kind: Kind,
    pub(super) quantum: Option<Vec<f64>>,
    pub(super) offset: Option<Vec<f64>>,
    pub(super) filter: Filter,
    pub(super) bytes: Vec<u8>,
}

/// The least and largest value of a component; 0 and 0 where there is none.
pub(super) fn range(values: &[f64], components: usize, component: usize) -> [f64; 2] {
    let mut values = values.iter().skip(component).step_by(components.max(1));
    let Some(&first) = values.next() else { return [0.0, 0.0] };
    values.fold([first, first], |[least, largest], &value| [least.min(value), largest.max(value)])
}

/// Packs finite tuples so that no value changes by more than the bound. `extent` is what a relative
/// bound is relative to.
///
/// The bound is kept by trial: each value is worked out as the decoder will, and where one would be
/// off by more (values far larger than the bound, beyond what double precision resolves; ranges
/// that overflow) the array is sent in single or double precision.
pub(super) fn pack(values: &[f64], components: usize, bound: ErrorBound, extent: f64) -> Packed {
    let bound = match bound {
        // A range that overflows is at least the largest number.
        ErrorBound::Relative(part) => part * extent.min(f64::MAX),
        ErrorBound::Absolute(bound) => bound,
        ErrorBound::Lossless => return exact(values, components, 0.0),
    };
    quantized(values, components, bound).unwrap_or_else(|| exact(values, components, bound))
}

/// Component after component.
fn planar(values: &[f64], components: usize) -> impl Iterator<Item = f64> {
    (0..components)
        .flat_map(move |component| values.iter().skip(component).step_by(components).copied())
}

fn quantized(values: &[f64], components: usize, bound: f64) -> Option<Packed> {
    let count = values.len().checked_div(components)?;
    let (mut quanta, mut offsets) = (Vec::new(), Vec::new());
    let mut integers = Vec::with_capacity(values.len());
    let mut largest_integer = 0u32;
    for component in 0..components {
        let [least, largest] = range(values, components, component);
        // A little under twice the bound: rounding to the nearest leaves half a quantum, and
        // rounding of the numbers themselves a trace more.
        let quantum = if least == largest { 0.0 } else { 2.0 * bound * (1.0 - 1e-9) };
        if least != largest
            && !(quantum.is_normal() && ((largest - least) / quantum) < f64::from(u32::MAX))
        {
            return None;
        }
        for index in 0..count {
            let value = values[index * components + component];
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "checked against the range above"
            )]
            let integer =
                if quantum == 0.0 { 0 } else { ((value - least) / quantum).round() as u32 };
            let decoded = least + quantum * f64::from(integer);
            // Not `>`: a NaN must not pass.
            if !((decoded - value).abs() <= bound || decoded == value) {
                return None;
            }
            largest_integer = largest_integer.max(integer);
            integers.push(integer);
        }
        quanta.push(quantum);
        offsets.push(least);
    }
    let kind = match largest_integer {
        0..=0xff => Kind::U8,
        0x100..=0xffff => Kind::U16,
        _ => Kind::U32,
    };
    let bytes = delta(integers.into_iter(), kind);
    Some(Packed {
        kind,
        quantum: Some(quanta),
        offset: Some(offsets),
        filter: Filter::Delta,
        bytes,
    })
}

/// In single precision where that is within the bound, else in double.
fn exact(values: &[f64], components: usize, bound: f64) -> Packed {
    #[expect(clippy::cast_possible_truncation, reason = "what is lost is measured")]
    let fits = |value: f64| {
        let single = f64::from(value as f32);
        single.to_bits() == value.to_bits()
            || (single.is_finite() && (single - value).abs() <= bound)
    };
    let (kind, bytes) = if values.iter().all(|&value| fits(value)) {
        #[expect(clippy::cast_possible_truncation, reason = "measured above")]
        (
            Kind::F32,
            planar(values, components).flat_map(|value| (value as f32).to_le_bytes()).collect(),
        )
    } else {
        (Kind::F64, planar(values, components).flat_map(f64::to_le_bytes).collect())
    };
    Packed { kind, quantum: None, offset: None, filter: Filter::None, bytes }
}

#[cfg(test)]
mod tests {
    use super::super::wire::integers;
    use super::*;
    use proptest::prelude::*;

    fn unpack(packed: &Packed, components: usize, count: usize) -> Vec<f64> {
        let planar: Vec<f64> = match packed.kind {
            Kind::F32 => packed
                .bytes
                .as_chunks()
                .0
                .iter()
                .map(|&chunk| f64::from(f32::from_le_bytes(chunk)))
                .collect(),
            Kind::F64 => {
                packed.bytes.as_chunks().0.iter().map(|&chunk| f64::from_le_bytes(chunk)).collect()
            }
            kind => {
                let (quantum, offset) =
                    (packed.quantum.as_ref().unwrap(), packed.offset.as_ref().unwrap());
                let integers = integers(&packed.bytes, kind, packed.filter).unwrap();
                let value = |(index, integer)| {
                    let component: usize = index / count.max(1);
                    offset[component] + quantum[component] * f64::from(integer)
                };
                integers.into_iter().enumerate().map(value).collect()
            }
        };
        (0..count * components)
            .map(|index| planar[index % components * count + index / components])
            .collect()
    }

    fn check(values: &[f64], components: usize, bound: ErrorBound) -> Kind {
        let extent = (0..components)
            .map(|component| range(values, components, component))
            .map(|[least, largest]| largest - least)
            .fold(0.0, f64::max);
        let packed = pack(values, components, bound, extent);
        let allowed = match bound {
            ErrorBound::Relative(part) => part * extent.min(f64::MAX),
            ErrorBound::Absolute(bound) => bound,
            ErrorBound::Lossless => 0.0,
        };
        for (sent, received) in
            values.iter().zip(unpack(&packed, components, values.len() / components))
        {
            assert!(
                *sent == received || received.is_finite() && (sent - received).abs() <= allowed,
                "{sent:e} became {received:e}, {bound:?}"
            );
        }
        packed.kind
    }

    #[test]
    fn the_bound_holds_where_numbers_are_unkind() {
        let relative = ErrorBound::Relative(1e-3);
        let ramp = |scale: f64, offset: f64| {
            (0..1000).map(|i| offset + scale * f64::from(i * i % 997)).collect::<Vec<_>>()
        };
        assert_eq!(check(&[], 1, relative), Kind::U8);
        assert_eq!(check(&[-0.1; 9], 3, relative), Kind::U8, "a constant field needs no bits");
        assert_eq!(check(&ramp(1.0, 0.0), 1, relative), Kind::U16);
        assert_eq!(check(&ramp(1.0, 0.0), 1, ErrorBound::Relative(1e-2)), Kind::U8);
        assert_eq!(check(&ramp(1.0, 0.0), 1, ErrorBound::Absolute(1e-5)), Kind::U32);
        check(&ramp(1.0, 1e16), 1, ErrorBound::Absolute(1e-3));
        assert_eq!(check(&ramp(1e-310, 0.0), 1, relative), Kind::F64, "the quantum is denormal");
        assert_eq!(check(&[5e-324, 0.0, -5e-324], 1, relative), Kind::F64);
        assert_eq!(
            check(&[f64::MAX, -f64::MAX, 1.0], 1, relative),
            Kind::F64,
            "the range overflows"
        );
        check(&[1e300, 2e300, -1e300, 1.5e300], 1, relative);
        check(&[1e300, 1e-300, 0.0, -1.0], 1, relative);
        check(&[1e300, 0.0, 0.0, 1e-300, 1.0, 5.0], 3, relative);
        check(&ramp(1e-9, 1e6), 1, relative);
        assert_eq!(check(&[0.5, 0.25, -3.0], 1, ErrorBound::Lossless), Kind::F32);
        assert_eq!(check(&[0.1, 0.2], 1, ErrorBound::Lossless), Kind::F64);
    }

    proptest! {
        #[test]
        fn the_bound_holds_for_any_finite_values(
            values in proptest::collection::vec(any::<f64>().prop_filter("finite", |x| x.is_finite()), 0..40),
            part in prop_oneof![Just(1e-1), Just(1e-3), Just(1e-6), Just(1e-12)],
            components in 1usize..4,
        ) {
            let values = &values[..values.len() / components * components];
            check(values, components, ErrorBound::Relative(part));
            check(values, components, ErrorBound::Absolute(part));
            check(values, components, ErrorBound::Lossless);
        }

        #[test]
        fn the_bound_holds_for_fields_with_an_offset(
            values in proptest::collection::vec(-1.0f64..1.0, 1..60), offset in -1e12f64..1e12, scale in -30i32..30,
        ) {
            let values: Vec<f64> = values.iter().map(|value| offset + value * 10f64.powi(scale)).collect();
            check(&values, 1, ErrorBound::Relative(1e-3));
        }
    }
}
