//! Four numbers side by side, which processors with wide registers compute at once.
//!
//! Every operation is that of its numbers one by one, so that the bits do not depend on the
//! processor.
#![expect(
    clippy::needless_range_loop,
    reason = "loops over lanes and axes read like the formulas, and vectorise"
)]

use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Sub, SubAssign};

/// How many there are.
pub const LANES: usize = 4;

/// Four numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(32))]
pub struct Lanes(pub [f64; LANES]);

impl Lanes {
    /// 0 four times.
    pub const ZERO: Self = Self::all(0.0);

    /// One number four times.
    #[inline(always)]
    #[must_use]
    pub const fn all(value: f64) -> Self {
        Self([value; LANES])
    }

    #[inline(always)]
    fn zip(self, other: Self, operation: impl Fn(f64, f64) -> f64) -> Self {
        let mut result = [0.0; LANES];
        for lane in 0..LANES {
            result[lane] = operation(self.0[lane], other.0[lane]);
        }
        Self(result)
    }

    /// The square roots.
    #[inline(always)]
    #[must_use]
    pub fn sqrt(self) -> Self {
        self.zip(self, |value, _| value.sqrt())
    }

    /// Its numbers where those of `test` are finite, those of `other` elsewhere.
    #[inline(always)]
    #[must_use]
    pub fn where_finite(self, test: Self, other: Self) -> Self {
        let mut result = [0.0; LANES];
        for lane in 0..LANES {
            result[lane] =
                if test.0[lane].abs() < f64::INFINITY { self.0[lane] } else { other.0[lane] };
        }
        Self(result)
    }

    /// The smaller ones; that of `self` where one is no number.
    #[inline(always)]
    #[must_use]
    pub fn least(self, other: Self) -> Self {
        self.zip(other, |a, b| if b < a { b } else { a })
    }

    /// The larger ones; that of `self` where one is no number.
    #[inline(always)]
    #[must_use]
    pub fn greatest(self, other: Self) -> Self {
        self.zip(other, |a, b| if b > a { b } else { a })
    }

    /// Without their signs.
    #[inline(always)]
    #[must_use]
    pub fn magnitude(self) -> Self {
        self.zip(self, |value, _| value.abs())
    }

    /// Its numbers where those of `test` are not below `bound`, 0 elsewhere.
    #[inline(always)]
    #[must_use]
    pub fn unless_below(self, test: Self, bound: f64) -> Self {
        self.zip(test, |value, test| if test < bound { 0.0 } else { value })
    }

    /// The first two added, and the last two, and then both.
    #[inline(always)]
    #[must_use]
    pub fn sum(self) -> f64 {
        let [a, b, c, d] = self.0;
        (a + b) + (c + d)
    }

    /// The smallest.
    #[inline(always)]
    #[must_use]
    pub fn min(self) -> f64 {
        let [a, b, c, d] = self.0;
        a.min(b).min(c.min(d))
    }

    /// The product of all, two and two.
    #[inline(always)]
    #[must_use]
    pub fn product(self) -> f64 {
        let [a, b, c, d] = self.0;
        (a * b) * (c * d)
    }

    /// Whether all are greater than `bound`; none is that is no number.
    #[inline(always)]
    #[must_use]
    pub fn all_above(self, bound: f64) -> bool {
        let mut above = true;
        for lane in 0..LANES {
            above &= self.0[lane] > bound;
        }
        above
    }
}

macro_rules! operator {
    ($trait:ident $method:ident $assign_trait:ident $assign:ident $sign:tt) => {
        operator!($trait $method $sign);

        impl $assign_trait for Lanes {
            #[inline(always)]
            fn $assign(&mut self, other: Self) {
                *self = *self $sign other;
            }
        }
    };
    ($trait:ident $method:ident $sign:tt) => {
        impl $trait for Lanes {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                self.zip(other, |a, b| a $sign b)
            }
        }
    };
}

operator!(Add add AddAssign add_assign +);
operator!(Sub sub SubAssign sub_assign -);
operator!(Mul mul MulAssign mul_assign *);
operator!(Div div /);

/// Calls `work`, compiled for the widest registers that this processor has. What is to use them
/// must be inlined into it.
#[inline(always)]
pub fn with_wide_registers<R>(work: impl FnOnce() -> R) -> R {
    #[cfg(target_arch = "x86_64")]
    {
        struct Task<F>(F);
        impl<R, F: FnOnce() -> R> pulp::WithSimd for Task<F> {
            type Output = R;

            #[inline(always)]
            fn with_simd<S: pulp::Simd>(self, _: S) -> R {
                (self.0)()
            }
        }
        pulp::Arch::new().dispatch(Task(work))
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        work()
    }
}
