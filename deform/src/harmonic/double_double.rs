//! Numbers of about 32 digits: unevaluated sums of two `f64` (Dekker 1971; Hida, Li and Bailey
//! 2001).

use std::ops::{Add, Sub};

/// The sum of a number and a part that it has no room for.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct DoubleDouble {
    high: f64,
    low: f64,
}

/// `a + b` and what rounding took from it.
fn two_sum(a: f64, b: f64) -> DoubleDouble {
    let high = a + b;
    let part = high - a;
    DoubleDouble { high, low: (a - (high - part)) + (b - part) }
}

/// The exact sum of two numbers with `|a| >= |b|`.
fn quick_two_sum(a: f64, b: f64) -> DoubleDouble {
    let high = a + b;
    DoubleDouble { high, low: b - (high - a) }
}

impl DoubleDouble {
    /// The product with a number.
    pub fn times(self, factor: f64) -> Self {
        let high = self.high * factor;
        let rounded = self.high.mul_add(factor, -high);
        quick_two_sum(high, self.low.mul_add(factor, rounded))
    }

    /// The quotient by a number.
    pub fn over(self, divisor: f64) -> Self {
        let first = self.high / divisor;
        let rest = self - Self::from(divisor).times(first);
        quick_two_sum(first, rest.high / divisor)
    }

    /// The nearest number.
    pub fn rounded(self) -> f64 {
        self.high + self.low
    }
}

impl From<f64> for DoubleDouble {
    fn from(value: f64) -> Self {
        Self { high: value, low: 0.0 }
    }
}

impl Add for DoubleDouble {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        let high = two_sum(self.high, other.high);
        let low = two_sum(self.low, other.low);
        let sum = quick_two_sum(high.high, high.low + low.high);
        quick_two_sum(sum.high, sum.low + low.low)
    }
}

impl Sub for DoubleDouble {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + Self { high: -other.high, low: -other.low }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_one_number_fits_two() {
        let tiny = 1e-25;
        let sum = DoubleDouble::from(1.0) + DoubleDouble::from(tiny);
        assert_eq!((sum - DoubleDouble::from(1.0)).rounded(), tiny);
        let third = DoubleDouble::from(1.0).over(3.0);
        let back = (third.times(3.0) - DoubleDouble::from(1.0)).rounded();
        assert!(back.abs() < 1e-31 && (third.rounded() - 1.0 / 3.0).abs() == 0.0, "{back:e}");
        let square = sum.times(1.0 / 3.0).times(3.0) - sum;
        assert!(square.rounded().abs() < 1e-15);
    }
}
