//! Rows of different lengths: what `connectivity`, `sizes` and `offsets` describe.

use tombolo_deform::mesh::{Indices, MeshError};

use crate::foreign::array::{Array, Fingerprint};
use crate::foreign::error::RunError;
use crate::foreign::label::Label;

/// Rows of whole numbers.
#[derive(Debug, Clone)]
pub struct Rows<'call> {
    connectivity: Array<'call>,
    extents: Extents<'call>,
    label: Label,
}

/// Where rows begin and end.
#[derive(Debug, Clone)]
enum Extents<'call> {
    /// By their sizes, and by where they begin unless they lie one behind the other.
    Sizes(Array<'call>, Option<Array<'call>>),
    /// By where they begin, one more than there are rows: each ends where the next begins.
    Offsets(Array<'call>),
}

impl<'call> Rows<'call> {
    /// Rows of these sizes, which begin at the `offsets`, or else one behind the other, up to the
    /// end of the connectivity; `label` is what errors call them.
    #[must_use]
    pub fn new(
        connectivity: Array<'call>,
        sizes: Array<'call>,
        offsets: Option<Array<'call>>,
        label: Label,
    ) -> Self {
        Self { connectivity, extents: Extents::Sizes(sizes, offsets), label }
    }

    /// Rows each of which ends where the next begins, by offsets of which there is one more than
    /// there are rows; `label` is what errors call them.
    #[must_use]
    pub fn between(connectivity: Array<'call>, offsets: Array<'call>, label: Label) -> Self {
        Self { connectivity, extents: Extents::Offsets(offsets), label }
    }

    /// How many rows there are.
    #[must_use]
    pub fn count(&self) -> usize {
        match &self.extents {
            Extents::Sizes(sizes, _) => sizes.len(),
            Extents::Offsets(offsets) => offsets.len().saturating_sub(1),
        }
    }

    /// Whether each row ends where the next begins ([`between`](Self::between)).
    pub(super) fn has_offsets(&self) -> bool {
        matches!(self.extents, Extents::Offsets(_))
    }

    /// The offsets and the connectivity as they lie in the solver's memory, where they can be lent.
    pub(super) fn lent(&self) -> Option<(Indices<'call>, Indices<'call>)> {
        match &self.extents {
            Extents::Sizes(..) => None,
            Extents::Offsets(offsets) => Some((offsets.indices()?, self.connectivity.indices()?)),
        }
    }

    /// Calls `visit` with each row, whose entries are vertices, of which there are `vertices`.
    pub(super) fn for_each_of_vertices(
        &self,
        vertices: usize,
        visit: impl FnMut(usize, &[u32]) -> Result<(), RunError>,
    ) -> Result<(), RunError> {
        let label = || self.part("connectivity");
        self.for_each_of(
            |entry, cell| vertex(&self.connectivity, &label, entry, cell, vertices),
            visit,
        )
    }

    /// Calls `visit` with each row, whose entries are below `limit`.
    pub(super) fn for_each(
        &self,
        limit: usize,
        visit: impl FnMut(usize, &[u32]) -> Result<(), RunError>,
    ) -> Result<(), RunError> {
        self.for_each_of(
            |entry, _| self.at(&self.connectivity, "connectivity", entry, limit as u64),
            visit,
        )
    }

    fn for_each_of(
        &self,
        read: impl Fn(usize, usize) -> Result<u32, RunError>,
        mut visit: impl FnMut(usize, &[u32]) -> Result<(), RunError>,
    ) -> Result<(), RunError> {
        let mut row = Vec::new();
        let mut next = 0;
        for index in 0..self.count() {
            let (start, size) = self.extent(index, next)?;
            let end = start.checked_add(size).filter(|end| *end <= self.connectivity.len());
            let Some(end) = end else {
                let entries = self.connectivity.len();
                return Err(self.part("connectivity").wrong(
                    format_args!(
                        "{entries} entries, but row {index} begins at {start} and has {size}"
                    ),
                    "rows that end within it",
                ));
            };
            next = end;
            row.clear();
            for entry in start..end {
                row.push(read(entry, index)?);
            }
            visit(index, &row)?;
        }
        let entries = self.connectivity.len();
        if next < entries && matches!(self.extents, Extents::Sizes(_, None)) {
            let found = format_args!("{entries} entries, of which the rows have {next}");
            return Err(self.part("connectivity").wrong(found, "as many as the sizes add up to"));
        }
        Ok(())
    }

    /// The label in errors of one of the arrays.
    fn part(&self, name: &str) -> Label {
        self.label.part(name, name)
    }

    /// Where a row begins, and its size; it begins at `next` where nothing else is said.
    fn extent(&self, index: usize, next: usize) -> Result<(usize, usize), RunError> {
        let limit = self.connectivity.len() as u64 + 1;
        match &self.extents {
            Extents::Sizes(sizes, offsets) => {
                let size = self.at(sizes, "sizes", index, u64::from(u32::MAX))?;
                let start = match offsets {
                    Some(offsets) => self.at(offsets, "offsets", index, limit)?,
                    None => next,
                };
                Ok((start, size))
            }
            Extents::Offsets(offsets) => {
                let [start, end]: [usize; 2] = [
                    self.at(offsets, "offsets", index, limit)?,
                    self.at(offsets, "offsets", index + 1, limit)?,
                ];
                let size = end.checked_sub(start).ok_or_else(|| {
                    let found = format_args!("{end} behind {start} at entry {}", index + 1);
                    self.part("offsets").wrong(found, "offsets that do not fall")
                })?;
                Ok((start, size))
            }
        }
    }

    fn at<T: TryFrom<u64>>(
        &self,
        array: &Array,
        name: &str,
        index: usize,
        limit: u64,
    ) -> Result<T, RunError> {
        entry(array, &|| self.part(name), index, limit)
    }

    /// The error of a cell that names a vertex which does not exist.
    pub(super) fn no_such_vertex(&self, cell: usize, vertex: u32, vertices: usize) -> RunError {
        no_such_vertex(&self.part("connectivity"), cell, vertex.into(), vertices)
    }

    pub(super) fn error(&self, index: usize, found: String, expected: &str) -> RunError {
        self.label.wrong(format_args!("{found} in row {index}"), expected)
    }

    pub(super) fn fingerprint(&self, into: &mut Fingerprint) {
        self.arrays().for_each(|array| array.fingerprint(into));
    }

    pub(super) fn arrays(&self) -> impl Iterator<Item = &Array<'call>> {
        let (first, second) = match &self.extents {
            Extents::Sizes(sizes, offsets) => (sizes, offsets.as_ref()),
            Extents::Offsets(offsets) => (offsets, None),
        };
        [&self.connectivity, first].into_iter().chain(second)
    }
}

/// One whole number of an array that is below `limit`.
fn entry<T: TryFrom<u64>>(
    array: &Array,
    label: &dyn Fn() -> Label,
    index: usize,
    limit: u64,
) -> Result<T, RunError> {
    let value =
        array.whole(index).filter(|value| *value < limit).and_then(|value| T::try_from(value).ok());
    value.ok_or_else(|| {
        let expected = match limit {
            0 => "no entry, as there is nothing to name".to_owned(),
            _ => format!("whole numbers from 0 to {}", limit - 1),
        };
        label().wrong(format_args!("{} at entry {index}", array.get(index)), expected)
    })
}

/// The vertex of a cell, of which there are `vertices`.
pub(super) fn vertex(
    array: &Array,
    label: &dyn Fn() -> Label,
    index: usize,
    cell: usize,
    vertices: usize,
) -> Result<u32, RunError> {
    match array.integer(index).map(i64::cast_unsigned) {
        Some(vertex) if vertex >= vertices as u64 => {
            Err(no_such_vertex(&label(), cell, vertex, vertices))
        }
        _ => entry(array, label, index, vertices as u64),
    }
}

fn no_such_vertex(label: &Label, cell: usize, vertex: u64, vertices: usize) -> RunError {
    let source = MeshError::VertexNumber { cell, vertex, vertex_count: vertices };
    RunError::Cells { place: label.place(), source }
}
