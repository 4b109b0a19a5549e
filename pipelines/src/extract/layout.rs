//! How the points of a probe or of streamlines hang together.

use std::sync::Arc;

use tombolo_deform::mesh::{CellType, Cells, MeshError, Vector};

use super::ExtractError;

/// How the points of a probe or of streamlines hang together, and how many of those that were asked
/// for lie outside of the mesh.
#[derive(Debug, Clone)]
pub(crate) struct Layout {
    /// How many points there are along each axis; `None` for loose points.
    pub(super) counts: Option<[usize; 3]>,
    /// Of streamlines, where each begins among the points, and where the last ends.
    pub(super) lines: Option<Arc<[usize]>>,
    pub(crate) points: usize,
    /// How many points were asked for: those of a probe, or the seeds of streamlines.
    pub(super) asked: usize,
    pub(super) outside: usize,
    /// The first point outside, on the rank that tells of it.
    pub(super) told: Option<Vector>,
}

impl Layout {
    /// The cells between the points that were found: vertices, lines, quadrilaterals or hexahedra.
    /// A point that was not found has the number `u32::MAX`.
    pub(crate) fn cells(&self, numbers: &[u32]) -> Result<Cells, MeshError> {
        let mut cells = Cells::new();
        let mut push = |cell_type: CellType, points: &[usize]| {
            let mut corners = [0; 8];
            let corners = &mut corners[..points.len()];
            corners.iter_mut().zip(points).for_each(|(corner, &point)| *corner = numbers[point]);
            if corners.contains(&u32::MAX) { Ok(()) } else { cells.push(cell_type, corners) }
        };
        if let Some(lines) = &self.lines {
            for ends in lines.windows(2) {
                (ends[0] + 1..ends[1])
                    .try_for_each(|point| push(CellType::Line, &[point - 1, point]))?;
            }
            return Ok(cells);
        }
        let Some(counts) = self.counts else {
            (0..self.points).try_for_each(|point| push(CellType::Vertex, &[point]))?;
            return Ok(cells);
        };
        let strides = [1, counts[0], counts[0] * counts[1]];
        let along: Vec<usize> = (0..3).filter(|&axis| counts[axis] > 1).collect();
        // The first corners of all cells; along an axis with one point the cells have no length.
        let firsts = |axis: usize| 0..counts[axis] - usize::from(counts[axis] > 1);
        let all = firsts(2).flat_map(|k| firsts(1).map(move |j| [j, k]));
        let all =
            all.flat_map(|[j, k]| firsts(0).map(move |i| i + j * strides[1] + k * strides[2]));
        for point in all {
            let at = |steps: &[usize]| {
                point + steps.iter().map(|&step| strides[along[step]]).sum::<usize>()
            };
            match along.len() {
                0 => push(CellType::Vertex, &[point])?,
                1 => push(CellType::Line, &[point, at(&[0])])?,
                2 => push(CellType::Quad, &[point, at(&[0]), at(&[0, 1]), at(&[1])])?,
                _ => {
                    let [a, b, c, d] = [point, at(&[0]), at(&[0, 1]), at(&[1])];
                    let [e, f, g, h] = [a, b, c, d].map(|corner| corner + strides[2]);
                    push(CellType::Hexahedron, &[a, b, c, d, e, f, g, h])?;
                }
            }
        }
        Ok(cells)
    }

    /// The error for points outside the mesh; `None` where there are none.
    pub(super) fn error(&self) -> Option<ExtractError> {
        let Self { outside, asked: points, .. } = *self;
        self.told.map(|first| ExtractError::OutsidePoints { outside, points, first })
    }
}
