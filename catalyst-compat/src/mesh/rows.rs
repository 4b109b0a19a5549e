//! Rows of different lengths: what `connectivity`, `sizes` and `offsets` describe.

use crate::array::{Array, Fingerprint};
use crate::error::CatalystError;
use crate::node::Node;

/// Rows of whole numbers.
#[derive(Debug, Clone)]
pub(super) struct Rows<'call> {
    connectivity: Array<'call>,
    sizes: Array<'call>,
    offsets: Option<Array<'call>>,
    path: String,
}

impl<'call> Rows<'call> {
    /// Reads `connectivity`, `sizes` and, where it is there, `offsets`.
    pub(super) fn read(node: &Node<'_, 'call>) -> Result<Self, CatalystError> {
        let connectivity = node.need(c"connectivity", "whole numbers, cell after cell")?.array()?;
        let sizes_node = node.need(c"sizes", "the number of entries of each cell")?;
        let sizes = sizes_node.array()?;
        let offsets = match node.child(c"offsets") {
            Some(offsets_node) => {
                let offsets = offsets_node.array()?;
                // Some give the end of the last row too.
                if offsets.len() != sizes.len() && offsets.len() != sizes.len() + 1 {
                    return Err(offsets_node
                        .wrong(format!("{} values, as many as in 'sizes'", sizes.len())));
                }
                Some(offsets)
            }
            None => None,
        };
        Ok(Self { connectivity, sizes, offsets, path: node.path() })
    }

    /// Rows one behind the other, and what to call them in errors.
    pub(super) fn of(connectivity: Array<'call>, sizes: Array<'call>, path: String) -> Self {
        Self { connectivity, sizes, offsets: None, path }
    }

    pub(super) fn len(&self) -> usize {
        self.sizes.len()
    }

    /// Calls `visit` with each row, whose entries are below `limit`.
    pub(super) fn for_each(
        &self,
        limit: usize,
        mut visit: impl FnMut(usize, &[u32]) -> Result<(), CatalystError>,
    ) -> Result<(), CatalystError> {
        let mut row = Vec::new();
        let mut next = 0;
        for index in 0..self.len() {
            let size = self.at(&self.sizes, "sizes", index, u64::from(u32::MAX))?;
            let start = match &self.offsets {
                Some(offsets) => {
                    self.at(offsets, "offsets", index, self.connectivity.len() as u64 + 1)?
                }
                None => next,
            };
            let end = start.checked_add(size).filter(|end| *end <= self.connectivity.len());
            let Some(end) = end else {
                return Err(CatalystError::Wrong {
                    path: format!("{}/connectivity", self.path),
                    found: format!(
                        "{} entries, but row {index} begins at {start} and has {size}",
                        self.connectivity.len()
                    ),
                    expected: "rows that end within it".into(),
                });
            };
            next = end;
            row.clear();
            for entry in start..end {
                #[expect(clippy::cast_possible_truncation, reason = "below a count that fits")]
                row.push(self.at(&self.connectivity, "connectivity", entry, limit as u64)? as u32);
            }
            visit(index, &row)?;
        }
        Ok(())
    }

    fn at(
        &self,
        array: &Array,
        name: &str,
        index: usize,
        limit: u64,
    ) -> Result<usize, CatalystError> {
        entry(array, &format_args!("{}/{name}", self.path), index, limit)
    }

    pub(super) fn error(&self, index: usize, found: String, expected: &str) -> CatalystError {
        CatalystError::Wrong {
            path: self.path.clone(),
            found: format!("{found} in row {index}"),
            expected: expected.to_owned(),
        }
    }

    pub(super) fn fingerprint(&self, into: &mut Fingerprint) {
        self.arrays().for_each(|array| array.fingerprint(into));
    }

    pub(super) fn arrays(&self) -> impl Iterator<Item = &Array<'call>> {
        [&self.connectivity, &self.sizes].into_iter().chain(&self.offsets)
    }
}

/// One whole number of an array that is below `limit`.
pub(super) fn entry(
    array: &Array,
    path: &dyn std::fmt::Display,
    index: usize,
    limit: u64,
) -> Result<usize, CatalystError> {
    match array.whole(index).filter(|value| *value < limit) {
        Some(value) => Ok(usize::try_from(value).unwrap_or(usize::MAX)),
        None => Err(CatalystError::Wrong {
            path: path.to_string(),
            found: format!("{} at entry {index}", array.get(index)),
            expected: match limit {
                0 => "no entry, as there is nothing to name".into(),
                _ => format!("whole numbers from 0 to {}", limit - 1),
            },
        }),
    }
}
