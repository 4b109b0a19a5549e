//! The quality of cells, and the guard that lets no broken mesh through.
//!
//! - [`scaled_jacobian`] and [`scaled_jacobians`] measure cells, [`quality`] sums up a mesh.
//! - [`judge`] checks a whole path from one shape to another before the first step of it is handed out.

mod cell;
mod change;
mod fold;
mod inside;
mod judge;
mod path;
#[cfg(test)]
mod tests;

use schemars::JsonSchema;
use serde::Serialize;

pub use cell::scaled_jacobian;
pub(crate) use cell::{
    HEXAHEDRON_CORNERS, PYRAMID_CORNERS, VOXEL_AS_HEXAHEDRON, WEDGE_CORNERS, corner_tets,
};
pub use change::{Change, Spread, change, change_in_parts, swept_volume, volumes};
pub use fold::turns_over;
pub use judge::{
    BrokenPath, FailingCell, Guard, Otherwise, PathQuality, Refusal, ShapeQuality, SurfaceRule,
    judge, judge_in_parts, keeps, keeps_in_parts, shape_at,
};

use crate::mesh::{CellType, Cells, Vector};
use crate::parallel;
use crate::partition::{Partition, Whole};
use crate::vector::{determinant, mean, subtract};
pub(crate) use cell::Scratch;
use cell::scaled_jacobian_of;
use inside::least_inside;

/// How many cells are measured at a time.
const CHUNK: usize = 4096;

/// How many of the worst cells are named.
pub(crate) const WORST: usize = 10;

/// How many classes a histogram has.
pub const CLASSES: usize = 20;

/// The quality of a mesh: of its cells of the highest dimension, where that is 2 or 3.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Quality {
    /// How many cells were measured. Where there is none, nothing is broken: the values below are 1.
    pub cells: usize,
    /// The least scaled Jacobian.
    pub min: f64,
    /// The mean scaled Jacobian.
    pub mean: f64,
    /// The largest scaled Jacobian.
    pub max: f64,
    /// How many cells are turned inside out or flat: a volume cell with a corner whose determinant is not positive
    /// (hexahedra, wedges and pyramids: any place inside whose determinant may not be), a polygon with a corner turned against its normal, any cell with a coordinate that is not finite.
    pub inverted: usize,
    /// How many cells have a scaled Jacobian in each of 20 equal classes from -1 to 1.
    pub histogram: [u64; CLASSES],
    /// The worst cells, at most 10, the worst first.
    pub worst: Vec<WorstCell>,
}

/// A cell of poor quality.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct WorstCell {
    /// The cell's number in the mesh.
    pub cell: usize,
    /// Its scaled Jacobian.
    pub scaled_jacobian: f64,
    /// The mean of its vertices.
    pub centroid: Vector,
}

/// The quality of `cells` at `points` (one for each vertex).
///
/// A cell whose measure is NaN counts as inverted with the value -1. Cells that are no mesh's yet are taken as
/// [`Cells::right_handed`] has them at these points.
///
/// Cost: one pass over the cells, on all threads; the same bits for any number of them.
///
/// # Panics
/// Where a cell names a vertex beyond `points`; a [`Mesh`](crate::mesh::Mesh) never does.
#[must_use]
pub fn quality(cells: &Cells, points: &[Vector]) -> Quality {
    quality_in_parts(cells, points, &Whole)
}

/// The same of a mesh that is in parts: `cells` are those of this rank alone. Collective; all ranks get the whole mesh's.
///
/// # Panics
/// As [`quality`].
#[must_use]
pub fn quality_in_parts(cells: &Cells, points: &[Vector], partition: &dyn Partition) -> Quality {
    let cells = &*cells.right_handed(points);
    let measure = Measure::new(cells);
    let mut parts = parallel::map_chunks(cells.len(), CHUNK, |range| {
        let mut part = Quality::empty();
        let mut scratch = Scratch::default();
        for cell in range {
            if let Some((value, inverted)) =
                measure.cell(cell, |vertex| points[vertex as usize], &mut scratch)
            {
                part.add(cell, value, inverted);
            }
        }
        part
    })
    .into_iter();
    let mut total = parts.next().unwrap_or_else(Quality::empty);
    parts.for_each(|part| total.merge(part));
    for worst in &mut total.worst {
        worst.centroid = centroid(cells, worst.cell, points);
        worst.cell = partition.cell_number(worst.cell);
    }
    if partition.ranks() > 1 {
        total = total.added_up(partition);
    }
    #[expect(clippy::cast_precision_loss, reason = "fewer cells than 2^53")]
    if total.cells == 0 {
        (total.min, total.mean, total.max) = (1.0, 1.0, 1.0);
    } else {
        total.mean /= total.cells as f64;
    }
    total
}

/// The scaled Jacobian of each cell, NaN for those that have none: vertices, lines, cells with a coordinate that is NaN.
/// Cells that are no mesh's yet are taken as in [`quality`].
///
/// # Panics
/// Where a cell names a vertex beyond `points`.
#[must_use]
pub fn scaled_jacobians(cells: &Cells, points: &[Vector]) -> Vec<f64> {
    let cells = &*cells.right_handed(points);
    let mut values = vec![f64::NAN; cells.len()];
    parallel::for_each_chunk(&mut values, CHUNK, |chunk, part| {
        let mut scratch = Scratch::default();
        for (index, value) in part.iter_mut().enumerate() {
            let cell = chunk * CHUNK + index;
            if let Some(measured) =
                scaled_jacobian_of(cells, cell, |vertex| points[vertex as usize], &mut scratch)
            {
                *value = measured;
            }
        }
    });
    values
}

/// The scaled Jacobian of each cell at `points` by that of the same cell at `reference`: below 1 where motion made the cell
/// worse. NaN where there is no measure or the reference is flat.
///
/// # Panics
/// Where a cell names a vertex beyond `reference` or `points`.
#[must_use]
pub fn normalized_scaled_jacobians(
    cells: &Cells,
    reference: &[Vector],
    points: &[Vector],
) -> Vec<f64> {
    let cells = &*cells.right_handed(reference);
    let mut values = scaled_jacobians(cells, points);
    for (value, start) in values.iter_mut().zip(scaled_jacobians(cells, reference)) {
        *value = if start == 0.0 { f64::NAN } else { *value / start };
    }
    values
}

impl Quality {
    fn empty() -> Self {
        Self {
            cells: 0,
            min: f64::INFINITY,
            mean: 0.0,
            max: f64::NEG_INFINITY,
            inverted: 0,
            histogram: [0; CLASSES],
            worst: Vec::new(),
        }
    }

    fn add(&mut self, cell: usize, value: f64, inverted: bool) {
        self.cells += 1;
        self.min = self.min.min(value);
        self.max = self.max.max(value);
        self.mean += value;
        self.inverted += usize::from(inverted);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to the classes"
        )]
        let class =
            ((value + 1.0) * 0.5 * CLASSES as f64).clamp(0.0, CLASSES as f64 - 1.0) as usize;
        self.histogram[class] += 1;
        if self.worst.len() < WORST
            || self.worst.last().is_some_and(|last| value < last.scaled_jacobian)
        {
            let place = self.worst.partition_point(|other| other.scaled_jacobian <= value);
            self.worst
                .insert(place, WorstCell { cell, scaled_jacobian: value, centroid: [0.0; 3] });
            self.worst.truncate(WORST);
        }
    }

    /// What the ranks have measured.
    #[expect(
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "counts below 2^53"
    )]
    fn added_up(&self, partition: &dyn Partition) -> Self {
        let worst = self.worst.iter().flat_map(|worst| {
            let [x, y, z] = worst.centroid;
            [worst.cell as f64, worst.scaled_jacobian, x, y, z]
        });
        let mut mine = vec![self.cells as f64, self.min, self.mean, self.max, self.inverted as f64];
        mine.extend(self.histogram.iter().map(|&count| count as f64));
        mine.push(self.worst.len() as f64);
        mine.extend(worst);
        let all = partition.gather(&mine);
        let mut values = all.into_iter();
        let mut total = Self::empty();
        let mut next = || values.next().unwrap_or(f64::NAN);
        for _ in 0..partition.ranks() {
            let mut part = Self {
                cells: next() as usize,
                min: next(),
                mean: next(),
                max: next(),
                ..Self::empty()
            };
            part.inverted = next() as usize;
            part.histogram = std::array::from_fn(|_| next() as u64);
            let count = next() as usize;
            part.worst = (0..count.min(WORST))
                .map(|_| WorstCell {
                    cell: next() as usize,
                    scaled_jacobian: next(),
                    centroid: [next(), next(), next()],
                })
                .collect();
            total.merge(part);
        }
        total
    }

    fn merge(&mut self, other: Self) {
        self.cells += other.cells;
        self.min = self.min.min(other.min);
        self.max = self.max.max(other.max);
        self.mean += other.mean;
        self.inverted += other.inverted;
        for (count, more) in self.histogram.iter_mut().zip(other.histogram) {
            *count += more;
        }
        self.worst.extend(other.worst);
        self.worst.sort_by(|a, b| {
            a.scaled_jacobian.total_cmp(&b.scaled_jacobian).then(a.cell.cmp(&b.cell))
        });
        self.worst.truncate(WORST);
    }
}

/// Which cells of a mesh are measured.
pub(crate) struct Measure<'a> {
    pub(crate) cells: &'a Cells,
    dimension: usize,
}

impl<'a> Measure<'a> {
    /// The cells must be right-handed, as those of a mesh are.
    pub(crate) fn new(cells: &'a Cells) -> Self {
        Self { cells, dimension: cells.dimension().max(2) }
    }

    pub(crate) fn is_measured(&self, cell: usize) -> bool {
        self.cells.cell_type(cell).dimension() == self.dimension
    }

    /// The scaled Jacobian (-1 for NaN) of a cell whose vertices lie `at`, and whether the cell is inverted.
    pub(crate) fn cell(
        &self,
        cell: usize,
        at: impl Fn(u32) -> Vector + Copy,
        scratch: &mut Scratch,
    ) -> Option<(f64, bool)> {
        if !self.is_measured(cell) {
            return None;
        }
        let value = scaled_jacobian_of(self.cells, cell, at, scratch)?;
        if !value.is_finite() {
            return Some((-1.0, true));
        }
        let valid = match self.cells.cell_type(cell) {
            CellType::Tetra
            | CellType::PentagonalPrism
            | CellType::HexagonalPrism
            | CellType::Polyhedron => value > 0.0,
            cell_type if cell_type.dimension() == 2 => value > 0.0,
            _ => {
                corner_tets(self.cells, cell, at, &mut scratch.tets);
                scratch.tets.iter().all(|&tet| tet_determinant(tet) > 0.0) && {
                    let Scratch { points, .. } = scratch;
                    points.clear();
                    points.extend(self.cells.vertices(cell).iter().map(|&vertex| at(vertex)));
                    least_inside(self.cells.cell_type(cell), points, points, 1.0).positive
                }
            }
        };
        Some((value, !valid))
    }
}

#[inline]
pub(crate) fn tet_determinant([p, a, b, c]: [Vector; 4]) -> f64 {
    determinant(subtract(a, p), subtract(b, p), subtract(c, p))
}

/// The mean of a cell's vertices.
pub(crate) fn centroid(cells: &Cells, cell: usize, points: &[Vector]) -> Vector {
    mean(cells.vertices(cell).iter().map(|&vertex| points[vertex as usize]))
}
