//! The fields at given points: in which cell each lies, and between which vertices.

use std::sync::Arc;

use tombolo_deform::bounds::Bounds;
use tombolo_deform::communicator::Reduction;
use tombolo_deform::mesh::{CellType, Cells, Vector};
use tombolo_deform::number::real;
use tombolo_deform::vector::distance;

use super::ExtractError;
use super::bins::Bins;
use super::decompose::Faces;
use super::gather::Rows;
use super::input::Input;
use super::layout::Layout;
use super::pattern::{Base, Pattern};
use super::search::{self, SLACK, Search};
use super::source::{Origin, Source};
use crate::interpolation::{is_inside, locate, shape};
use crate::language::{Probe, ProbeAt, ProbeGrid, ProbeLine, ProbeMethod};

/// The points of a probe.
pub(super) fn points(at: &ProbeAt) -> (Vec<Vector>, Option<[usize; 3]>) {
    let between = |from: Vector, to: Vector, fraction: f64| -> Vector {
        std::array::from_fn(|axis| from[axis] * (1.0 - fraction) + to[axis] * fraction)
    };
    match at {
        ProbeAt::Points(points) => (points.clone(), None),
        ProbeAt::Line(ProbeLine { from, to, count }) => {
            let fraction = |index: usize| real(index) / real(count - 1);
            let points = (0..*count).map(|index| between(*from, *to, fraction(index)));
            (points.collect(), Some([*count, 1, 1]))
        }
        ProbeAt::Grid(ProbeGrid { lower, upper, counts }) => {
            let along = |axis: usize, index: usize| match counts[axis] {
                1 => lower[axis],
                count => {
                    let fraction = real(index) / real(count - 1);
                    lower[axis] * (1.0 - fraction) + upper[axis] * fraction
                }
            };
            let all = (0..counts[2]).flat_map(|k| {
                (0..counts[1]).flat_map(move |j| (0..counts[0]).map(move |i| [i, j, k]))
            });
            let points = all.map(|at| [0, 1, 2].map(|axis| along(axis, at[axis])));
            (points.collect(), Some(*counts))
        }
    }
}

/// The points that this rank answers for: those whose cell of the lowest number is its own.
/// Collective.
pub(super) fn pattern(
    source: &Source,
    input: &Input,
    probe: &Probe,
    fault: Result<(), ExtractError>,
) -> Result<Pattern, ExtractError> {
    let communicator = input.communicator;
    let (points, counts) = points(&probe.at);
    let finder = fault.map(|()| Finder::new(source, probe.method));
    let key = keys(source, input);
    let found = match &finder {
        Ok(finder) => finder.find_all(&points, key),
        Err(_) => FoundAll::none(points.len()),
    };
    let own = &found.keys;
    let mut least = own.clone();
    communicator.reduce_integers(Reduction::Minimum, &mut least);
    finder?;

    let is_outside = |index: &usize| least[*index] == u64::MAX;
    let first_outside = (0..points.len()).find(is_outside).map(|index| points[index]);
    let layout = Layout {
        counts,
        lines: None,
        points: points.len(),
        asked: points.len(),
        outside: (0..points.len()).filter(is_outside).count(),
        told: first_outside.filter(|_| communicator.rank() == 0),
    };
    let mut rows = Rows::default();
    let (mut indices, mut owners, mut taken) = (Vec::new(), Vec::new(), Vec::new());
    let mut numbers = vec![u32::MAX; points.len()];
    for (index, &point) in points.iter().enumerate() {
        if own[index] != least[index] || is_outside(&index) {
            continue;
        }
        #[expect(clippy::cast_possible_truncation, reason = "a limited number of points")]
        {
            numbers[index] = taken.len() as u32;
            indices.push(index as u32);
        }
        rows.push(found.rows.row(found.numbers[index]).iter().copied());
        owners.push(found.cells[index]);
        taken.push(point);
    }
    // Those of several ranks hang together once they are merged.
    let cells = if communicator.size() > 1 { Cells::new() } else { layout.cells(&numbers)? };
    Ok(Pattern {
        points: taken,
        base: Base::Probe(layout.clone(), rows),
        cells: Arc::new(cells),
        owners: owners.into(),
        origin: Origin::Probe(layout, indices.into()),
    })
}

/// The numbers by which all ranks know a rank's cells: those of the whole mesh, or where there are
/// none those of the ranks in turn. Collective.
pub(super) fn keys<'a>(source: &Source, input: &Input<'a>) -> impl Fn(u32) -> u64 + use<'a> {
    let communicator = input.communicator;
    let numbers = input.channel.mesh.global_cells;
    let numbers = numbers.filter(|numbers| numbers.len() == source.cells().len());
    let is_numbered = !communicator.any(numbers.is_none() && !source.cells().is_empty());
    move |cell: u32| match numbers.filter(|_| is_numbered) {
        Some(numbers) => numbers.get(cell as usize),
        None => (communicator.rank() as u64) << 32 | u64::from(cell),
    }
}

/// The cell that a point lies in, and the vertices that its values come from, with their weights.
#[derive(Clone)]
pub(super) struct Found {
    pub(super) cell: u32,
    pub(super) row: Vec<(u32, f64)>,
}

/// The cell that each of some points lies in.
struct FoundAll {
    /// The key of the cell; `u64::MAX` where there is none.
    keys: Vec<u64>,
    cells: Vec<u32>,
    /// The number of each point's row.
    numbers: Vec<usize>,
    /// The vertices that the points' values come from, with their weights.
    rows: Rows,
}

impl FoundAll {
    fn none(points: usize) -> Self {
        let (keys, rows) = (vec![u64::MAX; points], Rows::default());
        Self { keys, cells: vec![0; points], numbers: vec![0; points], rows }
    }
}

/// The vertices that a point's values come from, with their weights: no more than a cell with
/// parametric coordinates has.
#[derive(Clone, Copy)]
struct Row {
    entries: [(u32, f64); 8],
    count: usize,
}

impl Row {
    fn new(vertices: &[u32], weights: &[f64]) -> Self {
        let mut entries = [(0, 0.0); 8];
        let parts = vertices.iter().copied().zip(weights.iter().copied());
        entries.iter_mut().zip(parts).for_each(|(entry, part)| *entry = part);
        Self { entries, count: vertices.len().min(weights.len()) }
    }

    fn entries(&self) -> &[(u32, f64)] {
        &self.entries[..self.count]
    }
}

/// The own cells of a rank, and which of them a point lies in.
pub(super) struct Finder<'a> {
    source: &'a Source,
    method: ProbeMethod,
    search: Arc<Search>,
}

impl<'a> Finder<'a> {
    /// A finder that is needed once for the mesh as it lies.
    pub(super) fn new(source: &'a Source, method: ProbeMethod) -> Self {
        Self { source, method, search: source.search_once() }
    }

    /// A finder that is needed at each step, as long as the mesh does not move.
    pub(super) fn kept(source: &'a Source) -> Self {
        let search = Arc::clone(source.search());
        Self { source, method: ProbeMethod::Interpolated, search }
    }

    /// The box around a cell.
    fn bounds(&self, cell: u32) -> Bounds {
        search::bounds(self.source.cells(), &self.source.positions.points, cell)
    }

    /// The diagonal of the box around a cell.
    pub(super) fn size(&self, cell: u32) -> f64 {
        self.bounds(cell).diagonal()
    }

    /// For each point what [`find`](Self::find) finds. Points alone are sorted, and each cell is
    /// looked at once: quicker than a tree of all cells, which are more than the points.
    fn find_all(&self, points: &[Vector], key: impl Fn(u32) -> u64) -> FoundAll {
        let mut found = FoundAll::none(points.len());
        let finite = points.iter().copied().zip(0..);
        let finite = finite.filter(|(point, _)| point.iter().all(|x| x.is_finite()));
        let bins = Bins::new(&finite.collect::<Vec<(Vector, u32)>>());
        // Twice, as coordinates are rounded.
        let (search, slack) = (&*self.search, self.search.slack);
        let reach = 2.0 * slack;
        for &cell in &search.cells {
            let bounds = self.bounds(cell);
            let lower = bounds.lower.map(|x| x - reach);
            let upper = bounds.upper.map(|x| x + reach);
            bins.near(&Bounds { lower, upper }, &mut |point, number| {
                let is_beside = (0..3).fold(false, |is_beside, axis| {
                    is_beside | (point[axis] < lower[axis]) | (point[axis] > upper[axis])
                });
                if is_beside || bounds.squared_distance(point) > slack * slack {
                    return;
                }
                let index = number as usize;
                let key = key(cell);
                if key < found.keys[index]
                    && let Some(row) = self.row(cell as usize, point)
                {
                    found.keys[index] = key;
                    found.cells[index] = cell;
                    found.numbers[index] = found.rows.len();
                    found.rows.push(row.entries().iter().copied());
                }
            });
        }
        found
    }

    /// Of the cells that a point lies in, that of the lowest key. A point whose coordinates are not
    /// finite lies in none.
    pub(super) fn find(&self, point: Vector, key: &dyn Fn(u32) -> u64) -> Option<Found> {
        let mut candidates =
            self.search.around(self.source.cells(), &self.source.positions.points, point);
        candidates.sort_unstable_by_key(|&cell| key(cell));
        let found = |cell: u32| {
            let row = self.row(cell as usize, point)?;
            Some(Found { cell, row: row.entries().to_vec() })
        };
        candidates.into_iter().find_map(found)
    }

    /// The vertices that the values at a point in a cell come from; `None` where it lies beside.
    fn row(&self, cell: usize, point: Vector) -> Option<Row> {
        let row = self.interpolated(cell, point)?;
        if self.method == ProbeMethod::Interpolated {
            return Some(row);
        }
        let from = |vertex: u32| distance(self.source.positions.points[vertex as usize], point);
        let vertices = self.source.cells().vertices(cell).iter().copied();
        let nearest = vertices.min_by(|&a, &b| from(a).total_cmp(&from(b)))?;
        Some(Row::new(&[nearest], &[1.0]))
    }

    /// The weights of a cell's vertices at a point in it.
    fn interpolated(&self, cell: usize, point: Vector) -> Option<Row> {
        let cells = self.source.cells();
        let (cell_type, vertices) = (cells.cell_type(cell), cells.vertices(cell));
        if shape(cell_type, [0.0; 3]).is_some() {
            return self.within(cell_type, vertices, point);
        }
        // Others are linear in their tetrahedra or triangles.
        let mut simplices = Vec::new();
        Faces::default().decompose(cells, cell, |vertex| vertex, &mut simplices);
        simplices.iter().find_map(|simplex| match simplex {
            [vertices @ .., u32::MAX] => self.within(CellType::Triangle, vertices, point),
            vertices => self.within(CellType::Tetra, vertices, point),
        })
    }

    fn within(&self, cell_type: CellType, vertices: &[u32], point: Vector) -> Option<Row> {
        let mut points = [[0.0; 3]; 8];
        for (slot, &vertex) in points.iter_mut().zip(vertices) {
            *slot = self.source.positions.points[vertex as usize];
        }
        let at = locate(cell_type, &points[..vertices.len()], point)?;
        let is_beside = cell_type.dimension() == 2 && at[2].abs() > self.search.slack;
        if is_beside || !is_inside(cell_type, at, SLACK) {
            return None;
        }
        Some(Row::new(vertices, shape(cell_type, at)?.weights()))
    }
}

#[cfg(test)]
mod tests;
