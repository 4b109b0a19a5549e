//! Arrays by their addresses, and how they are lent to the adaptor.

use std::marker::PhantomData;

pub use tombolo_deform::mesh::NumberType;
use tombolo_deform::mesh::{Indices, Values};

/// The type that Conduit gives this number, as does `tombolo.h`; `None` where it is that of no type
/// of numbers.
#[must_use]
pub fn conduit_type(number: i64) -> Option<NumberType> {
    use NumberType::{F32, F64, I8, I16, I32, I64, U8, U16, U32, U64};
    let index = usize::try_from(number.checked_sub(3)?).ok()?;
    [I8, I16, I32, I64, U8, U16, U32, U64, F32, F64].get(index).copied()
}

/// Numbers of any type at any distance from each other, borrowed from the solver for the length of
/// one call: a list, or a table read row by row.
#[derive(Debug, Clone, Copy)]
pub struct Array<'call> {
    first: *const u8,
    count: usize,
    /// From one row to the next, in bytes; of a list from one number to the next.
    stride: isize,
    /// Numbers of a row, and from one to the next, in bytes. A list has rows of one.
    columns: (usize, isize),
    number: NumberType,
    swapped: bool,
    call: PhantomData<&'call [u8]>,
}

/// A piece of memory as numbers, and where those of an array are among them.
struct Span<'call, T> {
    values: &'call [T],
    first: usize,
    /// Rows and columns.
    shape: [usize; 2],
    /// From one row and from one column to the next, in numbers.
    strides: [isize; 2],
}

impl<'call, T> Span<'call, T> {
    /// The numbers, where one lies beside the other.
    fn compact(&self) -> Option<&'call [T]> {
        let [rows, columns] = self.shape;
        (columns == 1 && (rows <= 1 || self.strides[0] == 1)).then_some(self.values)
    }

    /// Takes numbers into a fingerprint, where one lies beside the other; says whether they do.
    fn fingerprint(&self, into: &mut Fingerprint, number: impl Fn(T) -> i64) -> bool
    where
        T: Copy,
    {
        let compact = self.compact();
        if let Some(values) = compact {
            into.integers(values.len(), |index| number(values[index]));
        }
        compact.is_some()
    }

    /// The numbers of a list: among which values, from which on, and how far apart.
    fn list(
        self,
        values: impl Fn(&'call [T]) -> Values<'call>,
    ) -> Option<(Values<'call>, usize, isize)> {
        (self.shape[1] == 1).then(|| (values(self.values), self.first, self.strides[0]))
    }

    fn indices(&self) -> Option<Indices<'call>>
    where
        Indices<'call>: From<&'call [T]>,
    {
        match self.compact() {
            Some(values) => Some(values.into()),
            None => Indices::from(self.values).table(self.first, self.shape, self.strides).ok(),
        }
    }
}

impl<'call> Array<'call> {
    /// Numbers at an address, of which those of a big-endian machine are turned round as they are
    /// read.
    ///
    /// # Safety
    /// From `first` on there are `count` numbers of this type, `stride` bytes apart (not aligned,
    /// it may be), that live and do not change during `'call`, nor does what lies between them, all
    /// of which can be read; `count * stride` is at most `isize::MAX`.
    pub unsafe fn new(
        first: *const u8,
        count: usize,
        stride: usize,
        number: NumberType,
        big_endian: bool,
    ) -> Self {
        // SAFETY: the caller's promise; `isize` holds a distance within an array.
        unsafe { Self::table(first, [count, 1], [stride.cast_signed(), 0], number, big_endian) }
    }

    /// A table of rows and columns at an address, with these distances in bytes from one row and
    /// from one column to the next: of any sign, and not aligned, it may be. It is read row by row.
    ///
    /// # Safety
    /// There is a number of this type at every `first + row * strides[0] + column * strides[1]`. All
    /// lie in one piece of memory, which lives and does not change during `'call` from the lowest of
    /// them to the highest, and can be read.
    pub unsafe fn table(
        first: *const u8,
        [rows, columns]: [usize; 2],
        [mut stride, of_column]: [isize; 2],
        number: NumberType,
        big_endian: bool,
    ) -> Self {
        let swapped = big_endian && cfg!(target_endian = "little");
        let count = rows * columns;
        // Rows that follow each other without a gap are one list.
        let is_list = columns <= 1
            || rows == 1
            || of_column.checked_mul(columns.cast_signed()).is_some_and(|row| row == stride);
        let mut columns = (columns.max(1), of_column);
        if is_list {
            if columns.0 > 1 {
                stride = of_column;
            }
            columns = (1, 0);
        }
        Self { first, count, stride, columns, number, swapped, call: PhantomData }
    }

    /// No numbers.
    #[must_use]
    pub fn none(number: NumberType) -> Self {
        let first = std::ptr::dangling();
        // SAFETY: there is none of which anything is promised.
        unsafe { Self::new(first, 0, number.bytes(), number, false) }
    }

    /// The components of tuples as one list, where they lie in memory tuple after tuple without a gap:
    /// `x0 y0 z0 x1 y1 z1 ...`.
    pub(super) fn interleaved(components: &[Self]) -> Option<Self> {
        let first = *components.first()?;
        let bytes = first.number.bytes().cast_signed();
        let tuple = bytes * components.len().cast_signed();
        let follows = |(index, array): (usize, &Self)| {
            array.first == first.first.wrapping_offset(index.cast_signed() * bytes)
                && (array.count, array.stride, array.columns.0) == (first.count, tuple, 1)
                && (array.number, array.swapped) == (first.number, first.swapped)
        };
        // Each of these numbers is one of a component's, for which its maker has answered (`new`).
        let all = Self { count: first.count * components.len(), stride: bytes, ..first };
        components.iter().enumerate().all(follows).then_some(all)
    }

    /// The distance of a number from the first, in bytes.
    fn offset(&self, index: usize) -> isize {
        match self.columns {
            (1, _) => index.cast_signed() * self.stride,
            (columns, stride) => {
                (index / columns).cast_signed() * self.stride
                    + (index % columns).cast_signed() * stride
            }
        }
    }

    /// How many numbers there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.count
    }

    /// The type of the numbers.
    #[must_use]
    pub fn number(&self) -> NumberType {
        self.number
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    fn read<const N: usize>(&self, index: usize) -> [u8; N] {
        assert!(index < self.count && N == self.number.bytes(), "element {index}");
        // SAFETY: the element is there (`new`), and bytes need no alignment.
        let mut bytes: [u8; N] =
            unsafe { self.first.offset(self.offset(index)).cast::<[u8; N]>().read_unaligned() };
        if self.swapped {
            bytes.reverse();
        }
        bytes
    }

    /// A value as double precision.
    ///
    /// # Panics
    /// Where `index` is out of range.
    #[expect(
        clippy::cast_precision_loss,
        reason = "fields of large integers are shown, not computed with"
    )]
    #[must_use]
    pub fn get(&self, index: usize) -> f64 {
        match self.number {
            NumberType::I8 => f64::from(i8::from_ne_bytes(self.read(index))),
            NumberType::I16 => f64::from(i16::from_ne_bytes(self.read(index))),
            NumberType::I32 => f64::from(i32::from_ne_bytes(self.read(index))),
            NumberType::I64 => i64::from_ne_bytes(self.read(index)) as f64,
            NumberType::U8 => f64::from(u8::from_ne_bytes(self.read(index))),
            NumberType::U16 => f64::from(u16::from_ne_bytes(self.read(index))),
            NumberType::U32 => f64::from(u32::from_ne_bytes(self.read(index))),
            NumberType::U64 => u64::from_ne_bytes(self.read(index)) as f64,
            NumberType::F32 => f64::from(f32::from_ne_bytes(self.read(index))),
            NumberType::F64 => f64::from_ne_bytes(self.read(index)),
        }
    }

    /// A value as an integer; `None` for a real number that is none.
    ///
    /// # Panics
    /// Where `index` is out of range.
    #[must_use]
    pub fn integer(&self, index: usize) -> Option<i64> {
        match self.number {
            NumberType::I64 => Some(i64::from_ne_bytes(self.read(index))),
            NumberType::U64 => i64::try_from(u64::from_ne_bytes(self.read(index))).ok(),
            _ => {
                let value = self.get(index);
                #[expect(clippy::cast_possible_truncation, reason = "a whole number below 2^53")]
                (value.fract() == 0.0 && value.abs() < 9.0e15).then_some(value as i64)
            }
        }
    }

    /// A value as a whole number from 0 on.
    ///
    /// # Panics
    /// Where `index` is out of range.
    #[must_use]
    pub fn whole(&self, index: usize) -> Option<u64> {
        self.integer(index).and_then(|value| u64::try_from(value).ok())
    }

    /// The memory in which the values lie as a slice of numbers of their type, where it can be seen
    /// as one.
    fn span<T>(&self) -> Option<Span<'call, T>> {
        let size = size_of::<T>();
        if size != self.number.bytes() || self.swapped {
            return None;
        }
        let (columns, of_column) = self.columns;
        let rows = self.count / columns;
        if rows == 0 {
            return Some(Span { values: &[], first: 0, shape: [0, columns], strides: [1; 2] });
        }
        let bytes = size.cast_signed();
        // A distance that is never gone need not be one of whole numbers.
        let distance = |count: usize, stride: isize| match count {
            1 => Some(0),
            _ => (stride % bytes == 0).then_some(stride / bytes),
        };
        let strides = [distance(rows, self.stride)?, distance(columns, of_column)?];
        let far = |count: usize, stride: isize| (count - 1).cast_signed().checked_mul(stride);
        let [down, along] = [far(rows, strides[0])?, far(columns, strides[1])?];
        let before = down.min(0).checked_add(along.min(0))?.unsigned_abs();
        let length = down.unsigned_abs().checked_add(along.unsigned_abs())?.checked_add(1)?;
        let lowest = self.first.wrapping_sub(before.checked_mul(size)?);
        if !lowest.addr().is_multiple_of(align_of::<T>()) {
            return None;
        }
        // SAFETY: aligned; the first and the last element are the lowest and the highest of the
        // values in memory, and what lies between them lies between two addresses of the solver's
        // array (`new`, `table`), live and unchanged during the call. Every pattern of bits is a
        // number.
        let values = unsafe { std::slice::from_raw_parts(lowest.cast::<T>(), length) };
        Some(Span { values, first: before, shape: [rows, columns], strides })
    }

    /// The values as the adaptor borrows them, where the first of them is, and the distance between
    /// two; `None` where they have to be copied.
    pub(super) fn values(&self) -> Option<(Values<'call>, usize, isize)> {
        match self.number {
            NumberType::F32 => self.span().and_then(|span| span.list(Values::F32)),
            NumberType::F64 => self.span().and_then(|span| span.list(Values::F64)),
            NumberType::I32 => self.span().and_then(|span| span.list(Values::I32)),
            NumberType::I64 => self.span().and_then(|span| span.list(Values::I64)),
            NumberType::U8 => self.span().and_then(|span| span.list(Values::U8)),
            NumberType::I8
            | NumberType::I16
            | NumberType::U16
            | NumberType::U32
            | NumberType::U64 => None,
        }
    }

    /// The values as vertex numbers; `None` where they have to be copied.
    pub(super) fn indices(&self) -> Option<Indices<'call>> {
        match self.number {
            NumberType::I32 => self.span::<i32>()?.indices(),
            NumberType::I64 => self.span::<i64>()?.indices(),
            NumberType::U32 => self.span::<u32>()?.indices(),
            NumberType::U64 => self.span::<u64>()?.indices(),
            _ => None,
        }
    }

    /// The values as bytes one beside the other; `None` where they have to be copied.
    pub(super) fn bytes(&self) -> Option<&'call [u8]> {
        match self.number {
            NumberType::U8 => self.span().and_then(|span| span.compact()),
            _ => None,
        }
    }

    /// Where the first and the last value lie.
    pub(super) fn ends(&self) -> Option<[(*const u8, usize); 2]> {
        let last = self.first.wrapping_offset(self.offset(self.count.checked_sub(1)?));
        Some([(self.first, self.number.bytes()), (last, self.number.bytes())])
    }

    /// The address of the first value.
    pub(super) fn address(&self) -> usize {
        self.first.addr()
    }

    /// Whether its values are whole numbers by their type.
    #[must_use]
    pub fn is_integer(&self) -> bool {
        !self.number.is_real()
    }

    /// Takes the values into a fingerprint, whatever their type and wherever each lies.
    pub(super) fn fingerprint(&self, into: &mut Fingerprint) {
        into.add(self.count as u64);
        let is_taken = match self.number {
            NumberType::I32 => self.span().is_some_and(|span| span.fingerprint(into, i32::into)),
            NumberType::U32 => self.span().is_some_and(|span| span.fingerprint(into, u32::into)),
            NumberType::I64 => self.span().is_some_and(|span| span.fingerprint(into, i64::into)),
            _ => false,
        };
        if !is_taken {
            into.integers(self.count, |index| {
                self.integer(index).unwrap_or(self.get(index).to_bits().cast_signed())
            });
        }
    }
}

/// Tells arrays apart that differ: of arrays that solvers hand over, not of ones made to deceive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Fingerprint([u64; 4]);

impl Default for Fingerprint {
    fn default() -> Self {
        Self([
            0x9e37_79b9_7f4a_7c15,
            0xbf58_476d_1ce4_e5b9,
            0x94d0_49bb_1331_11eb,
            0x2545_f491_4f6c_dd1d,
        ])
    }
}

impl Fingerprint {
    fn mix(state: u64, word: u64) -> u64 {
        (state ^ word).wrapping_mul(0x9fb2_1c65_1e98_df25).rotate_left(29)
    }

    pub(super) fn add(&mut self, word: u64) {
        self.0[0] = Self::mix(self.0[0], word);
        self.0.rotate_left(1);
    }

    /// Takes whole numbers in, most of which are below 2^32.
    #[inline]
    fn integers(&mut self, count: usize, value: impl Fn(usize) -> i64) {
        let whole = count - count % 8;
        let mut above = 0;
        for first in (0..whole).step_by(8) {
            for (lane, state) in self.0.iter_mut().enumerate() {
                let [low, high] = [0, 1].map(|at| value(first + 2 * lane + at).cast_unsigned());
                *state = Self::mix(*state, low & 0xffff_ffff | high << 32);
                above |= (low | high) >> 32;
            }
        }
        (whole..count).for_each(|index| self.add(value(index).cast_unsigned()));
        if above > 0 {
            (0..whole).for_each(|index| self.add((value(index) >> 32).cast_unsigned()));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fingerprint<T>(
        values: &[T],
        stride: usize,
        number: NumberType,
        swapped: bool,
    ) -> Fingerprint {
        let (count, bytes) = (values.len().div_ceil(stride), stride * number.bytes());
        // SAFETY: every `stride`-th of the values, which live longer than this.
        let array = unsafe { Array::new(values.as_ptr().cast(), count, bytes, number, swapped) };
        let mut found = Fingerprint::default();
        array.fingerprint(&mut found);
        found
    }

    #[test]
    fn numbers_are_the_same_in_every_type_and_layout() {
        let numbers: Vec<i64> = (0..37).map(|number| number * number % 29).collect();
        let expected = fingerprint(&numbers, 1, NumberType::I64, false);
        let small: Vec<i32> = numbers.iter().map(|&number| number as i32).collect();
        let real: Vec<f64> = numbers.iter().map(|&number| number as f64).collect();
        let swapped: Vec<i64> = numbers.iter().map(|number| number.to_be()).collect();
        let apart: Vec<i64> = numbers.iter().flat_map(|&number| [number, 7]).collect();
        for found in [
            fingerprint(&small, 1, NumberType::I32, false),
            fingerprint(&small, 1, NumberType::U32, false),
            fingerprint(&numbers, 1, NumberType::U64, false),
            fingerprint(&real, 1, NumberType::F64, false),
            fingerprint(&swapped, 1, NumberType::I64, true),
            fingerprint(&apart, 2, NumberType::I64, false),
        ] {
            assert_eq!(found, expected);
        }
        for (index, by) in [(0, 1), (36, 1), (3, 1 << 32), (36, 1 << 40), (8, -100)] {
            let mut others = numbers.clone();
            others[index] += by;
            assert_ne!(fingerprint(&others, 1, NumberType::I64, false), expected, "{index}, {by}");
        }
    }
}
