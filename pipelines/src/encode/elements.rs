//! The triangles and lines of an extract's cells.

use tombolo_deform::mesh::CellType;

use super::error::EncodeError;
use crate::extract::Extract;

/// The elements of an extract that a viewer draws.
#[derive(Debug, Default)]
pub(super) struct Elements {
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) lines: Vec<[u32; 2]>,
    /// The cell that each triangle is part of.
    pub(super) triangle_cells: Vec<u32>,
    /// The cell that each line is part of.
    pub(super) line_cells: Vec<u32>,
}

impl Elements {
    pub(super) fn of(extract: &Extract) -> Result<Self, EncodeError> {
        let mut elements = Self::default();
        let Self { triangles, lines, triangle_cells, line_cells } = &mut elements;
        for (cell, (cell_type, points)) in extract.cells.iter().enumerate() {
            match cell_type {
                CellType::Vertex | CellType::PolyVertex => {}
                CellType::Line | CellType::PolyLine => {
                    lines.extend(points.windows(2).map(|line| [line[0], line[1]]))
                }
                _ if cell_type.dimension() == 2 => {
                    extract.cells.for_each_polygon(cell, |polygon| {
                        let ends = polygon[1..].windows(2);
                        triangles.extend(ends.map(|ends| [polygon[0], ends[0], ends[1]]));
                    })
                }
                _ => return Err(EncodeError::VolumeCell { cell, cell_type }),
            }
            #[expect(clippy::cast_possible_truncation, reason = "cells are numbered with 32 bits")]
            let cell = cell as u32;
            triangle_cells.resize(triangles.len(), cell);
            line_cells.resize(lines.len(), cell);
        }
        Ok(elements)
    }

    /// The feature of each triangle, where the extract knows features.
    pub(super) fn features(&self, extract: &Extract) -> Option<Vec<u32>> {
        extract.features.as_ref().map(|features| {
            let feature = |&cell: &u32| features.of_cells.get(cell as usize).copied().unwrap_or(0);
            self.triangle_cells.iter().map(feature).collect()
        })
    }
}
