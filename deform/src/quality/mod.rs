//! The quality of cells, and the guard that lets no broken mesh through.
//!
//! - [`scaled_jacobian`] and [`scaled_jacobians`] measure cells, [`quality`] sums up a mesh.
//! - [`judge`] checks a whole path from one shape to another before the first step of it is handed
//!   out.

mod change;
mod cubic;
mod fold;
mod fours;
mod guard;
mod inside;
mod judge;
mod path;
mod refusal;
#[cfg(test)]
mod tests;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use crate::mesh::cell_geometry::scaled_jacobian;
use crate::mesh::cell_geometry::{
    Scratch, centroid, corner_tets, scaled_jacobian_of, tet_determinant,
};
use crate::number::real;
pub use change::{Change, Spread, change, volumes};
pub use fold::turns_over;
pub use guard::{Guard, Otherwise, SurfaceRule};
pub(crate) use judge::check_ends;
pub use judge::{PathQuality, ShapeQuality, judge, judge_unless, keeps, keeps_unless, shape_at};
pub use refusal::{BrokenPath, FailingCell, Refusal};

use crate::communicator::{Garbled, Reader, Writer};
use crate::lanes::LANES;
use crate::mesh::{CellType, Cells, Domain, Vector};
use crate::parallel;
use inside::least_inside;

/// How many cells are measured at a time.
const CHUNK: usize = 4096;

/// How many of the worst cells are named.
pub(crate) const WORST: usize = 10;

/// How many classes a histogram has.
pub const CLASSES: usize = 20;

/// The quality of a mesh: of its cells of the highest dimension, where that is 2 or 3.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Quality {
    /// How many cells were measured. Where there is none, nothing is broken: the values below are
    /// 1.
    pub cells: usize,
    /// The least scaled Jacobian.
    pub min: f64,
    /// The mean scaled Jacobian.
    pub mean: f64,
    /// The largest scaled Jacobian.
    pub max: f64,
    /// How many cells are turned inside out or flat: a volume cell with a corner whose determinant
    /// is not positive (hexahedra, wedges and pyramids: any place inside whose determinant may not
    /// be), a polygon with a corner turned against its normal, any cell with a coordinate that is
    /// not finite.
    pub inverted: usize,
    /// How many cells have a scaled Jacobian in each of 20 equal classes from -1 to 1.
    pub histogram: [u64; CLASSES],
    /// The worst cells, at most 10, the worst first.
    pub worst: Vec<WorstCell>,
}

/// A cell of poor quality.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct WorstCell {
    /// The cell's number in the mesh.
    pub cell: usize,
    /// Its scaled Jacobian.
    pub scaled_jacobian: f64,
    /// The mean of its vertices.
    pub centroid: Vector,
}

/// The quality of `cells` at `points` (one for each vertex). That of a domain of several ranks is
/// the [gathered](Quality::gathered) one of their cells.
///
/// A cell whose measure is NaN counts as inverted with the value -1. Cells that are no mesh's yet
/// are taken as [`Cells::right_handed`] has them at these points.
///
/// Cost: one pass over the cells, on all threads; the same bits for any number of them.
///
/// # Panics
/// Where a cell names a vertex beyond `points`; a [`Mesh`](crate::mesh::Mesh) never does.
#[must_use]
pub fn quality(cells: &Cells, points: &[Vector]) -> Quality {
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
    }
    total.with_mean()
}

/// The scaled Jacobian of each cell, NaN for those that have none: vertices, lines, cells with a
/// coordinate that is NaN. Cells that are no mesh's yet are taken as in [`quality`].
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

/// The scaled Jacobian of each cell at `points` by that of the same cell at `reference`: below 1
/// where motion made the cell worse. NaN where there is no measure or the reference is flat.
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
        let class =
            ((value + 1.0) * 0.5 * CLASSES as f64).clamp(0.0, CLASSES as f64 - 1.0) as usize;
        self.histogram[class] += 1;
        if self.worst.len() < WORST
            || self.worst.last().is_some_and(|last| value < last.scaled_jacobian)
        {
            let index = self.worst.partition_point(|other| other.scaled_jacobian <= value);
            self.worst
                .insert(index, WorstCell { cell, scaled_jacobian: value, centroid: [0.0; 3] });
            self.worst.truncate(WORST);
        }
    }

    /// The quality of the whole domain, of which this is that of one rank's cells: cells are then
    /// named by their numbers in the whole mesh. Collective.
    #[must_use]
    pub fn gathered(mut self, domain: &Domain) -> Self {
        self.worst.iter_mut().for_each(|worst| worst.cell = domain.cell_number(worst.cell));
        if domain.communicator().size() == 1 {
            return self;
        }
        let mut message = Writer::default();
        [self.cells, self.inverted].iter().for_each(|&count| message.u64(count as u64));
        message.f64s(&[self.min, self.mean, self.max]);
        self.histogram.iter().for_each(|&count| message.u64(count));
        for worst in &self.worst {
            message.u64(worst.cell as u64);
            message.f64s(&[worst.scaled_jacobian]);
            message.f64s(&worst.centroid);
        }
        let all = domain.communicator().gather_all(&message.into_bytes());
        let parts = all
            .iter()
            .enumerate()
            .filter_map(|(rank, bytes)| Self::read(Reader::new(rank, bytes)).ok());
        let mut total = Self::empty();
        for mut part in parts.filter(|part| part.cells > 0) {
            part.mean *= real(part.cells);
            total.merge(part);
        }
        total.with_mean()
    }

    fn read(mut reader: Reader<'_>) -> Result<Self, Garbled> {
        let count =
            |reader: &mut Reader<'_>| Ok(usize::try_from(reader.u64()?).unwrap_or(usize::MAX));
        let (cells, inverted) = (count(&mut reader)?, count(&mut reader)?);
        let values = reader.f64s(3)?;
        let mut part = Self {
            cells,
            inverted,
            min: values[0],
            mean: values[1],
            max: values[2],
            ..Self::empty()
        };
        for class in &mut part.histogram {
            *class = reader.u64()?;
        }
        while !reader.is_empty() {
            let (cell, values) = (count(&mut reader)?, reader.f64s(1)?);
            part.worst.push(WorstCell {
                cell,
                scaled_jacobian: values[0],
                centroid: reader.vector()?,
            });
        }
        Ok(part)
    }

    /// Makes the mean of the sum.
    fn with_mean(mut self) -> Self {
        if self.cells == 0 {
            (self.min, self.mean, self.max) = (1.0, 1.0, 1.0);
        } else {
            self.mean /= real(self.cells);
        }
        self
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

    /// Calls `fours` with each four tetrahedra of a range that are measured, in order, and `each`
    /// with every other cell that is.
    #[inline(always)]
    pub(crate) fn in_fours(
        &self,
        range: std::ops::Range<usize>,
        mut fours: impl FnMut([usize; LANES]),
        mut each: impl FnMut(usize),
    ) {
        let mut pending = [0; LANES];
        let mut count = 0;
        for cell in range {
            if self.cells.cell_type(cell) == CellType::Tetra {
                pending[count] = cell;
                count += 1;
                if count == LANES {
                    fours(pending);
                    count = 0;
                }
            } else if self.is_measured(cell) {
                each(cell);
            }
        }
        pending[..count].iter().for_each(|&cell| each(cell));
    }

    /// The scaled Jacobian (-1 for NaN) of a cell whose vertices lie `at`, and whether the cell is
    /// inverted.
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
