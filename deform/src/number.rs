//! Numbers in messages, and counts as numbers of other types.

use std::cmp::Ordering;
use std::fmt;

/// A number as a message shows it: the shortest that reads back as the same, with an exponent where
/// it is far from 1. A precision is the most digits that it is given.
///
/// ```
/// use tombolo_deform::number::Number;
///
/// assert_eq!(Number(0.5).to_string(), "0.5");
/// assert_eq!(Number(1e308).to_string(), "1e308");
/// assert_eq!(format!("{:.4}", Number(2.0 / 3.0)), "0.6667");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Number(pub f64);

impl fmt::Display for Number {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (value, most) = match formatter.precision() {
            Some(digits) if self.0.is_finite() => {
                (format!("{:.*e}", digits.saturating_sub(1), self.0).parse().unwrap_or(self.0), 1e7)
            }
            _ => (self.0, 1e15),
        };
        if value == 0.0 || !value.is_finite() || (1e-4..most).contains(&value.abs()) {
            write!(formatter, "{value}")
        } else {
            write!(formatter, "{value:e}")
        }
    }
}

/// A number in the total order of `f64`: what heaps and sorts need.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ordered(pub f64);

impl Ord for Ordered {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl PartialOrd for Ordered {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Ordered {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Ordered {}

/// A count as a real number: exact below 2^53, which is more than memory holds of anything.
#[inline]
#[must_use]
pub fn real(count: usize) -> f64 {
    count as f64
}

/// A number of a vertex, row or cell in 32 bits: meshes with more of them are refused before.
#[inline]
#[must_use]
pub(crate) fn index(number: usize) -> u32 {
    debug_assert!(u32::try_from(number).is_ok(), "{number} is beyond 32 bits");
    number as u32
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Every number is short and reads back as what it is.
        #[test]
        fn numbers_are_short_and_exact(value in prop::num::f64::ANY) {
            let text = Number(value).to_string();
            prop_assert!(text.len() <= 24, "{text}");
            prop_assert!(value.is_nan() || text.parse() == Ok(value), "{text}");
            let text = format!("{:.7}", Number(value));
            prop_assert!(text.len() <= 15, "{text}");
            let read: f64 = text.parse().unwrap();
            prop_assert!(!value.is_normal() || ((read - value) / value).abs() < 1e-6 || read.is_infinite(), "{text}");
        }
    }
}
