//! The precisions that a preconditioner can be kept in.

use std::ops::{Mul, Neg, Sub};

use crate::communicator::Value;

/// `f32` or `f64`.
pub(crate) trait Real:
    Copy
    + Default
    + Send
    + Sync
    + std::fmt::Debug
    + Value
    + Mul<Output = Self>
    + Sub<Output = Self>
    + Neg<Output = Self>
    + 'static
{
    /// Whether it holds every number of double precision.
    const IS_EXACT: bool;

    fn of(value: f64) -> Self;
    fn wide(self) -> f64;
}

impl Real for f32 {
    const IS_EXACT: bool = false;

    #[inline(always)]
    fn of(value: f64) -> Self {
        value as Self
    }

    #[inline(always)]
    fn wide(self) -> f64 {
        f64::from(self)
    }
}

impl Real for f64 {
    const IS_EXACT: bool = true;

    #[inline(always)]
    fn of(value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn wide(self) -> f64 {
        self
    }
}
