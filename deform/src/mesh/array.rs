//! Arrays of a solver, borrowed as they lie in its memory.

use super::{MeshError, Vector};

/// A type of number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum NumberType {
    /// 8-bit integers.
    I8,
    /// 16-bit integers.
    I16,
    /// 32-bit integers.
    I32,
    /// 64-bit integers.
    I64,
    /// 8-bit integers without a sign.
    U8,
    /// 16-bit integers without a sign.
    U16,
    /// 32-bit integers without a sign.
    U32,
    /// 64-bit integers without a sign.
    U64,
    /// Single precision.
    F32,
    /// Double precision.
    #[default]
    F64,
}

impl NumberType {
    /// All of them.
    pub const ALL: [NumberType; 10] = [
        NumberType::I8,
        NumberType::I16,
        NumberType::I32,
        NumberType::I64,
        NumberType::U8,
        NumberType::U16,
        NumberType::U32,
        NumberType::U64,
        NumberType::F32,
        NumberType::F64,
    ];

    /// How many bytes one takes.
    #[must_use]
    pub fn bytes(self) -> usize {
        match self {
            NumberType::I8 | NumberType::U8 => 1,
            NumberType::I16 | NumberType::U16 => 2,
            NumberType::I32 | NumberType::U32 | NumberType::F32 => 4,
            NumberType::I64 | NumberType::U64 | NumberType::F64 => 8,
        }
    }

    /// Its name, such as `int32`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            NumberType::I8 => "int8",
            NumberType::I16 => "int16",
            NumberType::I32 => "int32",
            NumberType::I64 => "int64",
            NumberType::U8 => "uint8",
            NumberType::U16 => "uint16",
            NumberType::U32 => "uint32",
            NumberType::U64 => "uint64",
            NumberType::F32 => "float32",
            NumberType::F64 => "float64",
        }
    }

    /// Whether there are numbers between the whole ones.
    #[must_use]
    pub fn is_real(self) -> bool {
        matches!(self, NumberType::F32 | NumberType::F64)
    }
}

/// Numbers of any common type, borrowed.
#[derive(Debug, Clone, Copy)]
pub enum Values<'a> {
    /// Single precision.
    F32(&'a [f32]),
    /// Double precision.
    F64(&'a [f64]),
    /// 32-bit integers.
    I32(&'a [i32]),
    /// 64-bit integers.
    I64(&'a [i64]),
    /// Bytes.
    U8(&'a [u8]),
}

impl Values<'_> {
    fn number(&self) -> NumberType {
        match self {
            Values::F32(_) => NumberType::F32,
            Values::F64(_) => NumberType::F64,
            Values::I32(_) => NumberType::I32,
            Values::I64(_) => NumberType::I64,
            Values::U8(_) => NumberType::U8,
        }
    }

    fn len(&self) -> usize {
        match self {
            Values::F32(values) => values.len(),
            Values::F64(values) => values.len(),
            Values::I32(values) => values.len(),
            Values::I64(values) => values.len(),
            Values::U8(values) => values.len(),
        }
    }

    #[inline]
    fn get(&self, index: usize) -> f64 {
        match self {
            Values::F32(values) => f64::from(values[index]),
            Values::F64(values) => values[index],
            Values::I32(values) => f64::from(values[index]),
            // Fields of large integers are shown, not computed with.
            Values::I64(values) => values[index] as f64,
            Values::U8(values) => f64::from(values[index]),
        }
    }
}

/// One component of an [`ArrayView`]: every `stride`-th value from `offset` on. A stride that leads
/// back is held in two's complement.
#[derive(Debug, Clone, Copy)]
struct Column<'a> {
    values: Values<'a>,
    offset: usize,
    stride: usize,
}

/// An array of tuples borrowed from the solver: scalars, vectors or tensors of up to 9 components,
/// each component with its own memory, offset and stride. Making one costs no allocation and looks
/// at no value.
#[derive(Debug, Clone, Copy)]
pub struct ArrayView<'a> {
    columns: [Column<'a>; 9],
    components: usize,
    len: usize,
    number: NumberType,
}

impl<'a> ArrayView<'a> {
    /// `len` tuples of `components` values each, tuple after tuple: `x0 y0 z0 x1 y1 z1 ...`.
    ///
    /// # Errors
    /// [`MeshError::ArrayLength`] where `values` is not a whole number of tuples, or `components`
    /// is 0 or more than 9.
    pub fn interleaved(values: Values<'a>, components: usize) -> Result<Self, MeshError> {
        if components == 0 || components > 9 || !values.len().is_multiple_of(components) {
            return Err(MeshError::ArrayLength {
                name: format!("{components} interleaved components"),
                found: values.len(),
                expected: values.len().next_multiple_of(components.clamp(1, 9)),
            });
        }
        let mut columns = [Column { values, offset: 0, stride: components }; 9];
        for (offset, column) in columns.iter_mut().enumerate() {
            column.offset = offset;
        }
        Ok(Self { columns, components, len: values.len() / components, number: values.number() })
    }

    /// One value for each entity.
    #[must_use]
    pub fn scalars(values: &'a [f64]) -> Self {
        values.into()
    }

    /// One vector for each entity.
    #[must_use]
    pub fn vectors(values: &'a [Vector]) -> Self {
        values.into()
    }

    /// `len` tuples whose components each have their own values, offset and stride (in values, not
    /// bytes; negative where the last tuple lies first).
    ///
    /// # Errors
    /// [`MeshError::ArrayLength`] where a component has a tuple that is not among its values, or
    /// there are none or more than 9.
    pub fn strided(
        len: usize,
        components: &[(Values<'a>, usize, isize)],
    ) -> Result<Self, MeshError> {
        let Some(&(first, _, _)) = components.first().filter(|_| components.len() <= 9) else {
            return Err(MeshError::ArrayLength {
                name: "components".into(),
                found: components.len(),
                expected: 9,
            });
        };
        let mut columns = [Column { values: first, offset: 0, stride: 1 }; 9];
        for (column, &(values, offset, stride)) in columns.iter_mut().zip(components) {
            let needed = match len {
                0 => Some(0),
                _ => isize::try_from(len - 1)
                    .ok()
                    .and_then(|last| offset.checked_add_signed(last.checked_mul(stride)?))
                    .and_then(|last| last.max(offset).checked_add(1)),
            };
            if needed.is_none_or(|needed| needed > values.len()) {
                return Err(MeshError::ArrayLength {
                    name: "component".into(),
                    found: values.len(),
                    expected: needed.unwrap_or(usize::MAX),
                });
            }
            *column = Column { values, offset, stride: stride.cast_unsigned() };
        }
        let number = first.number();
        let is_of_one = components.iter().all(|(values, ..)| values.number() == number);
        let number = if is_of_one { number } else { NumberType::F64 };
        Ok(Self { columns, components: components.len(), len, number })
    }

    /// The type of number that the values are, or are a copy of; double precision where the
    /// components differ in it.
    #[must_use]
    pub fn number(&self) -> NumberType {
        self.number
    }

    /// The array as a copy of numbers of another type, which is what files hold then.
    #[must_use]
    pub fn copied_from(self, number: NumberType) -> Self {
        Self { number, ..self }
    }

    /// How many tuples there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// How many components each tuple has.
    #[must_use]
    pub fn components(&self) -> usize {
        self.components
    }

    /// One component of one tuple, as double precision.
    ///
    /// # Panics
    /// Where `tuple` or `component` is out of range.
    #[must_use]
    #[inline]
    pub fn get(&self, tuple: usize, component: usize) -> f64 {
        assert!(
            component < self.components && tuple < self.len,
            "tuple {tuple}, component {component}"
        );
        let column = &self.columns[component];
        column.values.get(column.offset.wrapping_add(tuple.wrapping_mul(column.stride)))
    }

    /// A tuple as a vector; components that the array lacks are 0, so that plane coordinates lie at
    /// z = 0.
    ///
    /// # Panics
    /// Where `tuple` is out of range.
    #[must_use]
    #[inline]
    pub fn vector(&self, tuple: usize) -> Vector {
        std::array::from_fn(|component| {
            if component < self.components { self.get(tuple, component) } else { 0.0 }
        })
    }

    /// The value of a scalar, with its sign, and the magnitude of any other tuple. No square
    /// overflows on the way to it.
    ///
    /// ```
    /// use tombolo_deform::mesh::ArrayView;
    ///
    /// assert_eq!(ArrayView::vectors(&[[3.0, 0.0, -4.0]]).magnitude(0), 5.0);
    /// assert_eq!(ArrayView::vectors(&[[1e200, 0.0, 0.0]]).magnitude(0), 1e200);
    /// assert_eq!(ArrayView::scalars(&[-2.0]).magnitude(0), -2.0);
    /// ```
    ///
    /// # Panics
    /// Where `tuple` is out of range.
    #[must_use]
    #[inline]
    pub fn magnitude(&self, tuple: usize) -> f64 {
        if self.components == 1 {
            return self.get(tuple, 0);
        }
        let parts = (0..self.components).map(|component| self.get(tuple, component));
        let square: f64 = parts.clone().map(|part| part * part).sum();
        // The root is the same everywhere, `hypot` is not.
        if square.is_normal() {
            square.sqrt()
        } else {
            parts.fold(0.0, |length: f64, part| length.hypot(part))
        }
    }

    /// The array as coordinates: one of single values is taken as `x0 y0 z0 x1 y1 z1 ...` where it
    /// has whole triples.
    pub(super) fn as_coordinates(self) -> Self {
        let Column { values, offset: 0, stride: 1 } = self.columns[0] else { return self };
        if self.components > 1 || self.len != values.len() {
            return self;
        }
        Self::interleaved(values, 3).unwrap_or(self)
    }

    /// The values as they lie in memory, where they lie tuple after tuple in double precision.
    #[must_use]
    pub fn contiguous(&self) -> Option<&'a [f64]> {
        let Values::F64(first) = self.columns[0].values else { return None };
        let follows = |(component, column): (usize, &Column<'a>)| {
            let is_same =
                matches!(column.values, Values::F64(values) if std::ptr::eq(values, first));
            is_same && column.stride == self.components && column.offset == component
        };
        let whole = self.columns[..self.components].iter().enumerate().all(follows);
        first.get(..self.len * self.components).filter(|_| whole)
    }

    /// Whether the tuples, as vectors, have the bits of these. One pass, which copies nothing.
    #[must_use]
    pub fn is_same_as(&self, vectors: &[Vector]) -> bool {
        if self.len != vectors.len() {
            return false;
        }
        let is_same = |a: f64, b: f64| a.to_bits() == b.to_bits();
        let Some(values) = self.contiguous().filter(|_| self.components == 3) else {
            let is_same = |(a, b): (Vector, &Vector)| (0..3).all(|axis| is_same(a[axis], b[axis]));
            return (0..self.len).map(|tuple| self.vector(tuple)).zip(vectors).all(is_same);
        };
        // Chunk by chunk without a branch, which processors do many at a time.
        let mut chunks = values.chunks(1024).zip(vectors.as_flattened().chunks(1024));
        chunks.all(|(values, known)| {
            let differ = |differing, (a, b): (&f64, &f64)| differing | (a.to_bits() ^ b.to_bits());
            values.iter().zip(known).fold(0, differ) == 0
        })
    }

    /// A copy as vectors.
    #[must_use]
    pub fn to_vectors(&self) -> Vec<Vector> {
        (0..self.len).map(|tuple| self.vector(tuple)).collect()
    }
}

macro_rules! scalars {
    ($($type:ty: $values:ident),*) => {$(
        /// One value for each entity.
        impl<'a> From<&'a [$type]> for ArrayView<'a> {
            fn from(values: &'a [$type]) -> Self {
                let values = Values::$values(values);
                Self {
                    columns: [Column { values, offset: 0, stride: 1 }; 9],
                    components: 1,
                    len: values.len(),
                    number: values.number(),
                }
            }
        }

        /// One value for each entity.
        impl<'a> From<&'a Vec<$type>> for ArrayView<'a> {
            fn from(values: &'a Vec<$type>) -> Self {
                values.as_slice().into()
            }
        }

        /// One tuple of `N` components, at most 9, for each entity.
        impl<'a, const N: usize> From<&'a [[$type; N]]> for ArrayView<'a> {
            fn from(values: &'a [[$type; N]]) -> Self {
                const { assert!(N > 0 && N <= 9, "from 1 to 9 components") };
                let flat = Values::$values(values.as_flattened());
                let mut columns = [Column { values: flat, offset: 0, stride: N }; 9];
                columns.iter_mut().take(N).enumerate().for_each(|(offset, column)| column.offset = offset);
                Self { columns, components: N, len: values.len(), number: flat.number() }
            }
        }

        /// One tuple of `N` components, at most 9, for each entity.
        impl<'a, const N: usize> From<&'a Vec<[$type; N]>> for ArrayView<'a> {
            fn from(values: &'a Vec<[$type; N]>) -> Self {
                values.as_slice().into()
            }
        }
    )*};
}

scalars!(f32: F32, f64: F64, i32: I32, i64: I64, u8: U8);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn components_are_read_forwards_backwards_and_at_one_place() {
        let numbers: Vec<f64> = (0..9).map(f64::from).collect();
        let of = |len, offset, stride| {
            ArrayView::strided(len, &[(Values::F64(&numbers), offset, stride)])
                .map(|view| (0..len).map(|tuple| view.get(tuple, 0)).collect::<Vec<_>>())
        };
        assert_eq!(of(3, 1, 3).unwrap(), [1.0, 4.0, 7.0]);
        assert_eq!(of(3, 8, -4).unwrap(), [8.0, 4.0, 0.0]);
        assert_eq!(of(4, 5, 0).unwrap(), [5.0; 4]);
        assert_eq!(of(0, 99, -1).unwrap(), [0.0; 0]);
        for (len, offset, stride, needed) in [
            (4, 0, 3, 10),
            (3, 8, -5, usize::MAX),
            (1, 9, 0, 10),
            (2, 9, -1, 10),
            (2, 0, isize::MIN, usize::MAX),
        ] {
            let MeshError::ArrayLength { found, expected, .. } =
                of(len, offset, stride).unwrap_err()
            else {
                panic!("{len} {offset} {stride}")
            };
            assert_eq!((found, expected), (9, needed), "{len} {offset} {stride}");
        }
    }
}
