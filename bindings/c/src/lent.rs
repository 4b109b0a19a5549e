//! Addresses that a solver has named, kept until `tombolo_execute` reads what lies there.

use std::ffi::{c_int, c_void};

use tombolo::foreign::{Array, NumberType, conduit_type};

use crate::Fault;

/// The type of a Rust number.
pub(super) trait Typed {
    const NUMBER: NumberType;
}

macro_rules! typed {
    ($($type:ty => $number:ident),*) => { $(impl Typed for $type { const NUMBER: NumberType = NumberType::$number; })* };
}

typed!(u8 => U8, i32 => I32, i64 => I64, f32 => F32, f64 => F64);

/// The type that the header gives this number.
pub(super) fn number(what: &str, kind: c_int) -> Result<NumberType, Fault> {
    conduit_type(kind.into())
        .ok_or_else(|| Fault::invalid(what, format!("the type {kind}"), "one of enum tombolo_type"))
}

/// An array as it was named.
#[derive(Debug, Clone, Copy)]
pub(super) struct Address {
    first: *const c_void,
    pub(super) count: usize,
    /// In bytes.
    stride: usize,
    number: NumberType,
}

// SAFETY: an address is followed inside `tombolo_execute` alone, by the thread that calls it; the
// header says that the array is there for it.
unsafe impl Send for Address {}

impl Address {
    /// Values one behind the other.
    pub(super) fn beside<T: Typed>(
        what: &str,
        first: *const T,
        count: usize,
    ) -> Result<Self, Fault> {
        Self::apart(what, T::NUMBER, first.cast(), count, T::NUMBER.bytes().cast_signed())
    }

    /// Values so many bytes apart.
    pub(super) fn apart(
        what: &str,
        number: NumberType,
        first: *const c_void,
        count: usize,
        stride: isize,
    ) -> Result<Self, Fault> {
        if count > 0 && first.is_null() {
            return Err(Fault::invalid(
                what,
                "a null pointer",
                format!("the address of {count} values"),
            ));
        }
        let least = number.bytes();
        let Some(stride) = usize::try_from(stride).ok().filter(|stride| *stride >= least) else {
            let expected =
                format!("{least} or more from one value of type {} to the next", number.name());
            return Err(Fault::invalid(what, format!("a stride of {stride} bytes"), expected));
        };
        if count.checked_mul(stride).is_none_or(|bytes| isize::try_from(bytes).is_err()) {
            let found = format!("{count} values, {stride} bytes apart");
            return Err(Fault::invalid(what, found, "as many as memory can hold"));
        }
        Ok(Self { first, count, stride, number })
    }

    /// The components of `count` tuples, each beside the next.
    pub(super) fn interleaved<T: Typed>(
        what: &str,
        first: *const T,
        count: usize,
        components: usize,
    ) -> Result<Vec<Self>, Fault> {
        let size = T::NUMBER.bytes();
        let stride = (components * size).cast_signed();
        let all = Self::apart(what, T::NUMBER, first.cast(), count, stride)?;
        Ok((0..components)
            .map(|at| Self { first: all.first.wrapping_byte_add(at * size), ..all })
            .collect())
    }

    /// The components of `count` tuples, each at an address of its own.
    ///
    /// # Safety
    /// `components` is null or the address of as many addresses.
    pub(super) unsafe fn separate(
        what: &str,
        number: NumberType,
        components: *const *const c_void,
        dimension: usize,
        count: usize,
        stride: isize,
    ) -> Result<Vec<Self>, Fault> {
        if components.is_null() {
            return Err(Fault::invalid(
                what,
                "a null pointer",
                format!("the addresses of {dimension} components"),
            ));
        }
        // SAFETY: not null, and of this length by the caller's promise.
        let components = unsafe { std::slice::from_raw_parts(components, dimension) };
        components.iter().map(|&first| Self::apart(what, number, first, count, stride)).collect()
    }

    /// # Safety
    /// The array lives, unchanged by others, during `'call`.
    pub(super) unsafe fn array<'call>(&self) -> Array<'call> {
        // SAFETY: the caller's promise, and the header's: so many values, so far apart.
        unsafe { Array::new(self.first.cast(), self.count, self.stride, self.number, false) }
    }
}
