//! Vertex and cell numbers, borrowed as they lie in a solver's memory.

use super::MeshError;

/// Integers of any common type, one beside the other.
#[derive(Debug, Clone, Copy)]
enum Integers<'a> {
    I32(&'a [i32]),
    I64(&'a [i64]),
    U32(&'a [u32]),
    U64(&'a [u64]),
}

impl Integers<'_> {
    fn len(&self) -> usize {
        match self {
            Integers::I32(values) => values.len(),
            Integers::I64(values) => values.len(),
            Integers::U32(values) => values.len(),
            Integers::U64(values) => values.len(),
        }
    }

    /// The address of the value at `index`, or where it would lie.
    fn address(&self, index: usize) -> usize {
        match self {
            Integers::I32(values) => values.as_ptr().wrapping_add(index).addr(),
            Integers::I64(values) => values.as_ptr().wrapping_add(index).addr(),
            Integers::U32(values) => values.as_ptr().wrapping_add(index).addr(),
            Integers::U64(values) => values.as_ptr().wrapping_add(index).addr(),
        }
    }
}

/// Where the numbers of a table lie among others.
#[derive(Debug, Clone, Copy)]
struct Table {
    first: usize,
    rows: usize,
    columns: usize,
    /// From one row and from one column to the next, in numbers.
    strides: [isize; 2],
}

impl Table {
    fn position(&self, index: usize) -> usize {
        assert!(index < self.rows * self.columns, "number {index} of a table");
        let [row, column] = self.strides.map(isize::cast_unsigned);
        self.first
            .wrapping_add((index / self.columns).wrapping_mul(row))
            .wrapping_add((index % self.columns).wrapping_mul(column))
    }

    /// Among how many numbers it lies at least; `None` where it begins before the first of them.
    fn needed(&self) -> Option<usize> {
        if self.rows.checked_mul(self.columns)? == 0 {
            return Some(0);
        }
        let [row, column] = self.strides;
        let far = |count: usize, stride: isize| {
            isize::try_from(count - 1).ok().and_then(|last| last.checked_mul(stride))
        };
        let (down, along) = (far(self.rows, row)?, far(self.columns, column)?);
        self.first.checked_add_signed(down.min(0).checked_add(along.min(0))?)?;
        self.first.checked_add_signed(down.max(0).checked_add(along.max(0))?)?.checked_add(1)
    }
}

/// Vertex or cell numbers of any common integer type, borrowed: a slice, or a table whose numbers
/// lie apart in memory. Making them costs no allocation and looks at no number.
///
/// ```
/// use tombolo_deform::mesh::Indices;
///
/// // Two triangles, 0 1 2 and 1 3 2, a column for each.
/// let columns = Indices::from(&[0_u32, 1, 1, 3, 2, 2][..]);
/// let rows = columns.table(0, [2, 3], [1, 2])?;
/// assert_eq!((0..6).map(|index| rows.get(index)).collect::<Vec<_>>(), [0, 1, 2, 1, 3, 2]);
/// # Ok::<(), tombolo_deform::mesh::MeshError>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Indices<'a> {
    integers: Integers<'a>,
    table: Option<Table>,
}

impl Indices<'_> {
    /// No numbers.
    pub const EMPTY: Self = Self { integers: Integers::U32(&[]), table: None };

    /// The numbers of a table of `[rows, columns]` among these, row by row: the first of them at
    /// `first`, with these distances, in numbers, from one row and from one column to the next.
    ///
    /// # Errors
    /// [`MeshError::ArrayLength`] where a number of the table is not among these, or these are a
    /// table already.
    pub fn table(
        self,
        first: usize,
        [rows, columns]: [usize; 2],
        strides: [isize; 2],
    ) -> Result<Self, MeshError> {
        let table = Table { first, rows, columns, strides };
        let needed = table.needed().filter(|_| self.table.is_none());
        if needed.is_some_and(|needed| needed <= self.integers.len()) {
            return Ok(Self { table: Some(table), ..self });
        }
        Err(MeshError::ArrayLength {
            name: format!("table of {rows} rows of {columns} numbers"),
            found: self.len(),
            expected: needed.unwrap_or(usize::MAX),
        })
    }

    /// How many numbers there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.table.map_or_else(|| self.integers.len(), |table| table.rows * table.columns)
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// One number; a negative one becomes a number beyond any mesh, which validation then names.
    ///
    /// # Panics
    /// Where `index` is out of range.
    #[must_use]
    #[inline]
    pub fn get(&self, index: usize) -> u64 {
        let position = self.position(index);
        match self.integers {
            Integers::I32(values) => u64::try_from(values[position]).unwrap_or(u64::MAX),
            Integers::I64(values) => u64::try_from(values[position]).unwrap_or(u64::MAX),
            Integers::U32(values) => u64::from(values[position]),
            Integers::U64(values) => values[position],
        }
    }

    /// A number as it is told to people: negative ones in two's complement.
    pub(super) fn signed(&self, index: usize) -> u64 {
        let position = self.position(index);
        match self.integers {
            Integers::I32(values) => i64::from(values[position]).cast_unsigned(),
            Integers::I64(values) => values[position].cast_unsigned(),
            Integers::U32(_) | Integers::U64(_) => self.get(index),
        }
    }

    #[inline]
    fn position(&self, index: usize) -> usize {
        self.table.map_or(index, |table| table.position(index))
    }

    /// Where the numbers lie in memory: the address of the first, how many there are, and the
    /// distances between them.
    pub(super) fn location(&self) -> [usize; 5] {
        let whole = Table { first: 0, rows: self.integers.len(), columns: 1, strides: [1, 0] };
        let Table { first, rows, columns, strides: [row, column] } = self.table.unwrap_or(whole);
        let address = self.integers.address(first);
        [address, rows, columns, row.cast_unsigned(), column.cast_unsigned()]
    }
}

macro_rules! indices {
    ($($type:ty: $integers:ident),*) => {$(
        impl<'a> From<&'a [$type]> for Indices<'a> {
            fn from(values: &'a [$type]) -> Self {
                Indices { integers: Integers::$integers(values), table: None }
            }
        }

        impl<'a> From<&'a Vec<$type>> for Indices<'a> {
            fn from(values: &'a Vec<$type>) -> Self {
                values.as_slice().into()
            }
        }

        impl<'a, const N: usize> From<&'a [[$type; N]]> for Indices<'a> {
            fn from(values: &'a [[$type; N]]) -> Self {
                values.as_flattened().into()
            }
        }

        impl<'a, const N: usize> From<&'a Vec<[$type; N]>> for Indices<'a> {
            fn from(values: &'a Vec<[$type; N]>) -> Self {
                values.as_slice().into()
            }
        }
    )*};
}

indices!(i32: I32, i64: I64, u32: U32, u64: U64);

#[cfg(test)]
mod tests {
    use super::*;

    fn all(indices: Indices<'_>) -> Vec<u64> {
        (0..indices.len()).map(|index| indices.get(index)).collect()
    }

    #[test]
    fn tables_are_read_row_by_row_wherever_their_numbers_lie() {
        let numbers: Vec<i64> = (0..12).collect();
        let of = |first, shape, strides| Indices::from(&numbers).table(first, shape, strides);
        for (first, shape, strides, expected) in [
            (0, [3, 4], [4, 1], (0..12).collect::<Vec<u64>>()),
            (0, [3, 4], [1, 3], vec![0, 3, 6, 9, 1, 4, 7, 10, 2, 5, 8, 11]),
            (8, [2, 2], [-8, 1], vec![8, 9, 0, 1]),
            (11, [2, 3], [-3, -1], vec![11, 10, 9, 8, 7, 6]),
            (5, [2, 2], [0, 0], vec![5; 4]),
            (99, [0, 4], [4, 1], vec![]),
        ] {
            assert_eq!(all(of(first, shape, strides).unwrap()), expected, "{first} {strides:?}");
        }
    }

    #[test]
    fn a_table_beyond_its_numbers_is_refused() {
        let numbers = [0_u32; 12];
        let of = |first, shape, strides| Indices::from(&numbers[..]).table(first, shape, strides);
        for (first, shape, strides) in [
            (1, [3, 4], [4, 1]),
            (0, [2, 2], [-1, 1]),
            (0, [2, 2], [isize::MAX, 1]),
            (usize::MAX, [1, 1], [1, 1]),
            (0, [usize::MAX, 2], [0, 0]),
            (0, [2, 2], [11, 1]),
        ] {
            let found = of(first, shape, strides);
            assert!(matches!(found, Err(MeshError::ArrayLength { .. })), "{first} {strides:?}");
        }
        let table = of(0, [2, 3], [6, 2]).unwrap();
        assert!(table.table(0, [1, 1], [1, 1]).is_err());
    }

    #[test]
    fn numbers_in_other_layouts_lie_elsewhere() {
        let numbers = [0_u64; 12];
        let whole = Indices::from(&numbers[..]);
        let locations = [
            whole.location(),
            Indices::from(&numbers[..6]).location(),
            Indices::from(&numbers[6..]).location(),
            whole.table(0, [3, 2], [4, 1]).unwrap().location(),
            whole.table(0, [3, 2], [2, 1]).unwrap().location(),
            whole.table(6, [3, 2], [2, 1]).unwrap().location(),
        ];
        for (index, location) in locations.iter().enumerate() {
            assert!(!locations[..index].contains(location), "{index}");
        }
    }
}
