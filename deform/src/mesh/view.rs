//! A solver's arrays, borrowed as they lie in its memory.

use super::{CellType, Cells, FeatureSource, Mesh, MeshError, Vector};

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

    fn get(&self, index: usize) -> f64 {
        match self {
            Values::F32(values) => f64::from(values[index]),
            Values::F64(values) => values[index],
            Values::I32(values) => f64::from(values[index]),
            #[expect(
                clippy::cast_precision_loss,
                reason = "fields of large integers are shown, not computed with"
            )]
            Values::I64(values) => values[index] as f64,
            Values::U8(values) => f64::from(values[index]),
        }
    }
}

/// One component of an [`ArrayView`]: every `stride`-th value from `offset` on.
#[derive(Debug, Clone, Copy)]
struct Column<'a> {
    values: Values<'a>,
    offset: usize,
    stride: usize,
}

/// An array of tuples borrowed from the solver: scalars, vectors or tensors of up to 9 components, each component with its own
/// memory, offset and stride. Making one costs no allocation and looks at no value.
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
    /// [`MeshError::ArrayLength`] where `values` is not a whole number of tuples, or `components` is 0 or more than 9.
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
        let column = Column { values: Values::F64(values), offset: 0, stride: 1 };
        Self { columns: [column; 9], components: 1, len: values.len(), number: NumberType::F64 }
    }

    /// One vector for each entity.
    #[must_use]
    pub fn vectors(values: &'a [Vector]) -> Self {
        let flat = Values::F64(values.as_flattened());
        let mut columns = [Column { values: flat, offset: 0, stride: 3 }; 9];
        columns[1].offset = 1;
        columns[2].offset = 2;
        Self { columns, components: 3, len: values.len(), number: NumberType::F64 }
    }

    /// `len` tuples whose components each have their own values, offset and stride (in values, not bytes).
    ///
    /// # Errors
    /// [`MeshError::ArrayLength`] where a component's values end before its last one, or there are none or more than 9.
    pub fn strided(
        len: usize,
        components: &[(Values<'a>, usize, usize)],
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
                _ => (len - 1)
                    .checked_mul(stride)
                    .and_then(|span| span.checked_add(offset)?.checked_add(1)),
            };
            if needed.is_none_or(|needed| needed > values.len()) {
                return Err(MeshError::ArrayLength {
                    name: "component".into(),
                    found: values.len(),
                    expected: needed.unwrap_or(usize::MAX),
                });
            }
            *column = Column { values, offset, stride };
        }
        let number = first.number();
        let is_of_one = components.iter().all(|(values, ..)| values.number() == number);
        let number = if is_of_one { number } else { NumberType::F64 };
        Ok(Self { columns, components: components.len(), len, number })
    }

    /// The type of number that the values are, or are a copy of; double precision where the components differ in it.
    #[must_use]
    pub fn number(&self) -> NumberType {
        self.number
    }

    /// The same values as a copy of numbers of another type, which is what files hold then.
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
    pub fn get(&self, tuple: usize, component: usize) -> f64 {
        assert!(
            component < self.components && tuple < self.len,
            "tuple {tuple}, component {component}"
        );
        let column = &self.columns[component];
        column.values.get(column.offset + tuple * column.stride)
    }

    /// A tuple as a vector; components that the array lacks are 0, so that plane coordinates lie at z = 0.
    ///
    /// # Panics
    /// Where `tuple` is out of range.
    #[must_use]
    pub fn vector(&self, tuple: usize) -> Vector {
        std::array::from_fn(|component| {
            if component < self.components { self.get(tuple, component) } else { 0.0 }
        })
    }

    /// The values as they lie in memory, where they lie tuple after tuple in double precision.
    pub(super) fn contiguous(&self) -> Option<&'a [f64]> {
        let Values::F64(first) = self.columns[0].values else { return None };
        let follows = |(component, column): (usize, &Column<'a>)| {
            let is_same =
                matches!(column.values, Values::F64(values) if std::ptr::eq(values, first));
            is_same && column.stride == self.components && column.offset == component
        };
        let whole = self.columns[..self.components].iter().enumerate().all(follows);
        first.get(..self.len * self.components).filter(|_| whole)
    }

    /// A copy as vectors.
    #[must_use]
    pub fn to_vectors(&self) -> Vec<Vector> {
        (0..self.len).map(|tuple| self.vector(tuple)).collect()
    }
}

/// Vertex or cell numbers of any common integer type, borrowed.
#[derive(Debug, Clone, Copy)]
pub enum Indices<'a> {
    /// 32-bit signed.
    I32(&'a [i32]),
    /// 64-bit signed.
    I64(&'a [i64]),
    /// 32-bit unsigned.
    U32(&'a [u32]),
    /// 64-bit unsigned.
    U64(&'a [u64]),
}

impl Indices<'_> {
    /// How many numbers there are.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Indices::I32(values) => values.len(),
            Indices::I64(values) => values.len(),
            Indices::U32(values) => values.len(),
            Indices::U64(values) => values.len(),
        }
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
    pub fn get(&self, index: usize) -> u64 {
        match self {
            Indices::I32(values) => u64::try_from(values[index]).unwrap_or(u64::MAX),
            Indices::I64(values) => u64::try_from(values[index]).unwrap_or(u64::MAX),
            Indices::U32(values) => u64::from(values[index]),
            Indices::U64(values) => values[index],
        }
    }

    fn address(&self) -> usize {
        match self {
            Indices::I32(values) => values.as_ptr().addr(),
            Indices::I64(values) => values.as_ptr().addr(),
            Indices::U32(values) => values.as_ptr().addr(),
            Indices::U64(values) => values.as_ptr().addr(),
        }
    }
}

/// Cells borrowed from the solver.
#[derive(Debug, Clone, Copy)]
pub enum CellsView<'a> {
    /// All of one type with a fixed number of vertices.
    Uniform {
        /// The type.
        cell_type: CellType,
        /// The vertices, cell after cell.
        connectivity: Indices<'a>,
    },
    /// Any mix of types but polyhedra.
    Mixed {
        /// VTK's number of each cell's type.
        types: &'a [u8],
        /// Row starts into `connectivity`, one more than there are cells.
        offsets: Indices<'a>,
        /// The vertices, cell after cell.
        connectivity: Indices<'a>,
    },
    /// Cells that the kernel owns already.
    Owned(&'a Cells),
}

impl CellsView<'_> {
    /// How many cells there are.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            CellsView::Uniform { cell_type, connectivity } => {
                connectivity.len() / cell_type.vertex_count().unwrap_or(1)
            }
            CellsView::Mixed { types, .. } => types.len(),
            CellsView::Owned(cells) => cells.len(),
        }
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// A copy that owns its arrays.
    ///
    /// # Errors
    /// [`MeshError::UnknownCellType`], [`MeshError::Offsets`], [`MeshError::VertexCount`] or [`MeshError::VertexNumber`] with
    /// the first cell that is wrong.
    pub fn to_cells(&self) -> Result<Cells, MeshError> {
        let vertex = |cell: usize, number: u64| {
            u32::try_from(number).map_err(|_| MeshError::VertexNumber {
                cell,
                vertex: number,
                vertex_count: u32::MAX as usize,
            })
        };
        match *self {
            CellsView::Owned(cells) => Ok(cells.clone()),
            CellsView::Uniform { cell_type, connectivity } => {
                let size = cell_type.vertex_count().unwrap_or(1);
                let vertices: Result<Vec<u32>, _> = (0..connectivity.len())
                    .map(|index| vertex(index / size, connectivity.get(index)))
                    .collect();
                Cells::uniform(cell_type, vertices?)
            }
            CellsView::Mixed { types, offsets, connectivity } => {
                let mut cells = Cells::new();
                let mut row = Vec::new();
                if offsets.len() != types.len() + 1 {
                    return Err(MeshError::ArrayLength {
                        name: "offsets".into(),
                        found: offsets.len(),
                        expected: types.len() + 1,
                    });
                }
                for (cell, &number) in types.iter().enumerate() {
                    let cell_type = CellType::from_vtk(number)
                        .ok_or(MeshError::UnknownCellType { cell, number: u64::from(number) })?;
                    let (start, end) = (offsets.get(cell), offsets.get(cell + 1));
                    if start > end || end > connectivity.len() as u64 {
                        return Err(MeshError::Offsets {
                            cell,
                            start,
                            end,
                            length: connectivity.len(),
                        });
                    }
                    row.clear();
                    for index in start..end {
                        #[expect(
                            clippy::cast_possible_truncation,
                            reason = "below a slice's length"
                        )]
                        row.push(vertex(cell, connectivity.get(index as usize))?);
                    }
                    cells.push(cell_type, &row)?;
                }
                Ok(cells)
            }
        }
    }

    /// Where the connectivity lies in memory and how long it is: what tells, without looking at a value, that a solver hands
    /// over the same cells as in the step before.
    #[must_use]
    pub fn identity(&self) -> (usize, usize) {
        match self {
            CellsView::Uniform { connectivity, .. } | CellsView::Mixed { connectivity, .. } => {
                (connectivity.address(), connectivity.len())
            }
            CellsView::Owned(cells) => {
                (cells.connectivity().as_ptr().addr(), cells.connectivity().len())
            }
        }
    }
}

/// A mesh borrowed from the solver for the length of one call.
#[derive(Debug, Clone, Copy)]
pub struct MeshView<'a> {
    /// The coordinates of each vertex: 2 or 3 components.
    pub points: ArrayView<'a>,
    /// The cells.
    pub cells: CellsView<'a>,
    /// Where the features come from.
    pub features: &'a FeatureSource,
    /// Counted up by the solver whenever cells or features change, so that nothing need be compared.
    pub generation: u64,
    /// The vertices' numbers in the whole, distributed mesh, where the solver knows them.
    pub global_vertices: Option<Indices<'a>>,
    /// The cells' numbers in the whole, distributed mesh, where the solver knows them. With both, what is made of the whole mesh
    /// does not depend on how it is distributed.
    pub global_cells: Option<Indices<'a>>,
    /// For each cell, whether it is a ghost (a copy of a cell that another rank owns); `None`: none is.
    pub ghost_cells: Option<&'a [bool]>,
}

impl<'a> MeshView<'a> {
    /// A mesh that is whole on this rank, its features found at sharp edges.
    #[must_use]
    pub fn new(points: ArrayView<'a>, cells: CellsView<'a>) -> Self {
        Self {
            points,
            cells,
            features: &FeatureSource::SharpEdges,
            generation: 0,
            global_vertices: None,
            global_cells: None,
            ghost_cells: None,
        }
    }

    /// The same with these features.
    #[must_use]
    pub fn with_features(self, features: &'a FeatureSource) -> Self {
        Self { features, ..self }
    }

    /// A copy that owns its arrays, checked.
    ///
    /// # Errors
    /// As [`CellsView::to_cells`] and [`Mesh::new`].
    pub fn to_mesh(&self) -> Result<Mesh, MeshError> {
        Mesh::new(self.points.to_vectors(), self.cells.to_cells()?, self.features.clone())
    }
}

impl<'a> From<&'a Mesh> for MeshView<'a> {
    fn from(mesh: &'a Mesh) -> Self {
        MeshView::new(ArrayView::vectors(mesh.points()), CellsView::Owned(mesh.cells()))
            .with_features(mesh.features())
    }
}
