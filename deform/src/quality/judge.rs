//! Every mesh on the path from one shape to another is checked before the first of them is handed
//! out.

use schemars::JsonSchema;
use serde::Serialize;

use super::fold::folded_faces;
use super::fours::{FourTets, scaled_jacobians_at};
use super::guard::Guard;
use super::path::least_on_path;
use super::refusal::{BrokenPath, FailingCell, Refusal};
use super::{CHUNK, Measure, WORST};
use crate::cancellation::Cancellation;
use crate::communicator::{Communicator, Garbled, Reader, Reduction, Writer};
use crate::lanes::{LANES, Lanes, with_wide_registers};
use crate::mesh::cell_geometry::{Scratch, centroid};
use crate::mesh::{Domain, Mesh, Vector};
use crate::number::real;
use crate::parallel;

/// Shapes of cells that are looked at between two places where it can be given up: a tenth of a second
/// of work. On several ranks these must meet there to know.
const TOGETHER: usize = 1 << 22;

/// The quality along a path that the guard lets through.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct PathQuality {
    /// The floor that held: the guard's, or the least scaled Jacobian of the reference mesh where
    /// that is lower.
    pub floor: f64,
    /// The least scaled Jacobian in any of the shapes.
    pub min_scaled_jacobian: f64,
    /// The quality of each shape, in the order of the fractions.
    pub shapes: Vec<ShapeQuality>,
}

/// The quality of one shape on a path.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct ShapeQuality {
    /// How far along the path it lies.
    pub fraction: f64,
    /// The least scaled Jacobian.
    pub min: f64,
    /// The mean scaled Jacobian.
    pub mean: f64,
}

/// The point of a straight path a `fraction` of the way from `start` to `end`; at 0 and 1 exactly
/// these.
///
/// Shapes are handed to the solver by this formula and judged by it.
#[must_use]
#[inline]
pub fn shape_at(start: Vector, end: Vector, fraction: f64) -> Vector {
    if fraction == 1.0 {
        return end;
    }
    std::array::from_fn(|axis| start[axis] + (end[axis] - start[axis]) * fraction)
}

/// Judges the straight path of a domain from the shape `start` to the shape `end` (coordinates of
/// every vertex), of which the shapes at `fractions` will be handed to the solver.
///
/// - Every shape keeps to the guard's floor, or to the least scaled Jacobian of the reference mesh
///   (the domain as it lies) where that is lower; a slack of one part in 10⁹ allows for rounding.
/// - No cell is turned inside out at any place of the path, between the shapes too. A tetrahedron's
///   determinant along a straight path is a cubic, of which the least value is found in closed
///   form; of hexahedra, wedges and pyramids the determinants at the corners are looked at in the
///   same way, and bounds of it everywhere inside; of prisms and polyhedra the tetrahedra that they
///   are split into (see [`scaled_jacobian`](super::scaled_jacobian)).
/// - In a mesh of polygons, no corner turns against the polygon's normal at the start.
/// - A cell whose vertices all stay where the reference mesh has them passes, however it is there.
///
/// Cost: one pass over the cells, on all threads; tetrahedra are read once, four at a time, whatever
/// the number of shapes. Only a refusal costs more (the bisection for the
/// feasible fraction).
///
/// Collective; all ranks get the verdict on the whole mesh.
///
/// # Errors
/// [`Refusal::Quality`] with what would break, where, and how far one could go; other [`Refusal`]s
/// for senseless arguments, and [`Refusal::OtherRank`] for those of another rank.
pub fn judge(
    domain: impl Into<Domain>,
    start: &[Vector],
    end: &[Vector],
    fractions: &[f64],
    guard: &Guard,
) -> Result<PathQuality, Refusal> {
    judge_unless(domain, start, end, fractions, guard, &Cancellation::default())
}

/// Judges a straight path as [`judge`] does, unless another thread has it given up, which is looked
/// at for each few thousand cells, and so in the search for the feasible fraction. On several ranks
/// all have to see the same: see [`Cancelling`](crate::communicator::Cancelling).
///
/// # Errors
/// [`Refusal::Cancelled`]; those of [`judge`].
pub fn judge_unless(
    domain: impl Into<Domain>,
    start: &[Vector],
    end: &[Vector],
    fractions: &[f64],
    guard: &Guard,
    cancellation: &Cancellation,
) -> Result<PathQuality, Refusal> {
    let domain = domain.into();
    let mesh = domain.mesh();
    let arguments = check_arguments(mesh, start, end, fractions, guard);
    if !domain.communicator().all(arguments.is_ok()) {
        arguments?;
        return Err(Refusal::OtherRank);
    }
    let (path, floor) = Path::new(&domain, start, end, guard, cancellation);
    // Here too: a rank without cells has no chunk to look before.
    path.require_wanted()?;
    let look = |range: std::ops::Range<usize>| {
        (!cancellation.is_cancelled()).then(|| path.look(range, fractions))
    };
    let mut total = Part::new(fractions.len());
    let (cells, is_alone) = (mesh.cells().len(), domain.communicator().size() == 1);
    let groups = path.most_cells.saturating_mul(fractions.len()).div_ceil(TOGETHER).max(1);
    let group = cells.div_ceil(CHUNK).div_ceil(groups) * CHUNK;
    for index in 0..groups {
        if index > 0 && !is_alone {
            domain.communicator().all(true);
            path.require_wanted()?;
        }
        let (from, to) = ((index * group).min(cells), ((index + 1) * group).min(cells));
        let parts = parallel::map_chunks(to - from, CHUNK, |range| {
            look(from + range.start..from + range.end)
        });
        for part in parts {
            total.merge(part.ok_or(Refusal::Cancelled)?);
        }
    }
    if domain.communicator().size() > 1 {
        total = total.gathered(&**domain.communicator());
    }
    if total.failing > 0 {
        let broken = path.broken(total, floor);
        path.require_wanted()?;
        return Err(Refusal::Quality(Box::new(broken)));
    }
    let count = real(total.cells.max(1));
    let value = |sum: f64| if total.cells == 0 { 1.0 } else { sum };
    let shapes: Vec<ShapeQuality> = fractions
        .iter()
        .zip(&total.shapes)
        .map(|(&fraction, &(min, sum))| ShapeQuality {
            fraction,
            min: value(min),
            mean: value(sum / count),
        })
        .collect();
    let min_scaled_jacobian = shapes.iter().map(|shape| shape.min).fold(1.0, f64::min);
    Ok(PathQuality { floor, min_scaled_jacobian, shapes })
}

/// Whether [`judge`] would let a straight step through, without saying why not. Collective.
#[must_use]
pub fn keeps(domain: impl Into<Domain>, start: &[Vector], end: &[Vector], guard: &Guard) -> bool {
    keeps_unless(domain, start, end, guard, &Cancellation::default())
}

/// [`keeps`], unless another thread has it given up: then it is said not to. Collective, as
/// [`judge_unless`].
#[must_use]
pub fn keeps_unless(
    domain: impl Into<Domain>,
    start: &[Vector],
    end: &[Vector],
    guard: &Guard,
    cancellation: &Cancellation,
) -> bool {
    let domain = domain.into();
    if !domain.communicator().all(check_arguments(domain.mesh(), start, end, &[1.0], guard).is_ok())
    {
        return false;
    }
    let path = Path::new(&domain, start, end, guard, cancellation).0;
    path.require_wanted().is_ok() && !path.fails(1.0)
}

fn check_arguments(
    mesh: &Mesh,
    start: &[Vector],
    end: &[Vector],
    fractions: &[f64],
    guard: &Guard,
) -> Result<(), Refusal> {
    check_ends(mesh, start, end)?;
    let mut before = 0.0;
    for (index, &value) in fractions.iter().enumerate() {
        if !(value > before && value <= 1.0) {
            return Err(Refusal::Fraction { index, value });
        }
        before = value;
    }
    if !(0.0..=1.0).contains(&guard.min_scaled_jacobian) {
        return Err(Refusal::Floor { value: guard.min_scaled_jacobian });
    }
    Ok(())
}

/// Refuses shapes of another number of points than the mesh has, and coordinates that are not
/// finite.
pub(crate) fn check_ends(mesh: &Mesh, start: &[Vector], end: &[Vector]) -> Result<(), Refusal> {
    let expected = mesh.points().len();
    for (which, shape) in [("start", start), ("end", end)] {
        if shape.len() != expected {
            return Err(Refusal::PointCount { which, found: shape.len(), expected });
        }
        if let Some(vertex) =
            shape.iter().position(|point| !point.iter().all(|value| value.is_finite()))
        {
            return Err(Refusal::NotFinite { which, vertex, point: shape[vertex] });
        }
    }
    Ok(())
}

/// The least scaled Jacobian at `points`, but not below 0: a reference that is inverted gives
/// nothing away.
fn least_scaled_jacobian(measure: &Measure<'_>, points: &[Vector]) -> f64 {
    parallel::map_chunks(measure.cells.len(), CHUNK, |range| {
        with_wide_registers(
            #[inline(always)]
            || {
                let mut least = Lanes::all(1.0);
                let mut scratch = Scratch::default();
                let mut others = 1.0f64;
                let each = |cell: usize| {
                    if let Some((value, _)) =
                        measure.cell(cell, |vertex| points[vertex as usize], &mut scratch)
                    {
                        others = others.min(value);
                    }
                };
                let fours = |cells: [usize; LANES]| {
                    let vertices = cells.map(|cell| measure.cells.vertices(cell));
                    least = least.least(scaled_jacobians_at(vertices, points));
                };
                measure.in_fours(range, fours, each);
                others.min(least.min())
            },
        )
    })
    .into_iter()
    .fold(1.0, f64::min)
    .max(0.0)
}

struct Path<'a> {
    measure: Measure<'a>,
    start: &'a [Vector],
    end: &'a [Vector],
    /// With the slack taken off.
    floor: f64,
    domain: &'a Domain,
    cancellation: &'a Cancellation,
    /// The cells of the rank that has most of them.
    most_cells: usize,
}

/// The findings in some of the cells.
struct Part {
    cells: usize,
    failing: usize,
    inverted: usize,
    /// The least and the sum for each shape.
    shapes: Vec<(f64, f64)>,
    worst: Vec<FailingCell>,
}

impl Part {
    fn new(shapes: usize) -> Self {
        Self {
            cells: 0,
            failing: 0,
            inverted: 0,
            shapes: vec![(f64::INFINITY, 0.0); shapes],
            worst: Vec::new(),
        }
    }

    fn fail(&mut self, cell: FailingCell) {
        self.failing += 1;
        self.inverted += usize::from(cell.inverts);
        self.worst.push(cell);
        if self.worst.len() >= 4 * WORST {
            self.keep_worst();
        }
    }

    fn keep_worst(&mut self) {
        self.worst.sort_by(|a, b| {
            a.scaled_jacobian.total_cmp(&b.scaled_jacobian).then(a.cell.cmp(&b.cell))
        });
        self.worst.truncate(WORST);
    }

    /// The findings of all ranks. Collective.
    fn gathered(mut self, communicator: &dyn Communicator) -> Self {
        self.keep_worst();
        let mut message = Writer::default();
        [self.cells, self.failing, self.inverted]
            .iter()
            .for_each(|&count| message.u64(count as u64));
        self.shapes.iter().for_each(|&(least, sum)| message.f64s(&[least, sum]));
        for worst in &self.worst {
            message.u64(worst.cell as u64);
            message.u8(worst.cell_type);
            message.f64s(&worst.centroid);
            message.f64s(&[worst.scaled_jacobian, worst.fraction]);
            message.u8(u8::from(worst.inverts));
        }
        let mut total = Self::new(self.shapes.len());
        for (rank, bytes) in communicator.gather_all(&message.into_bytes()).iter().enumerate() {
            // What cannot be read would be a defect; it counts as a failure, so that nothing is let
            // through.
            let broken = Self { failing: 1, ..Self::new(self.shapes.len()) };
            total.merge(Self::read(Reader::new(rank, bytes), self.shapes.len()).unwrap_or(broken));
        }
        total
    }

    fn read(mut reader: Reader<'_>, shapes: usize) -> Result<Self, Garbled> {
        let count =
            |reader: &mut Reader<'_>| Ok(usize::try_from(reader.u64()?).unwrap_or(usize::MAX));
        let mut part = Self::new(shapes);
        (part.cells, part.failing, part.inverted) =
            (count(&mut reader)?, count(&mut reader)?, count(&mut reader)?);
        for shape in &mut part.shapes {
            *shape = reader.f64s(2).map(|values| (values[0], values[1]))?;
        }
        while !reader.is_empty() {
            let (cell, cell_type, centroid) = (count(&mut reader)?, reader.u8()?, reader.vector()?);
            let (values, inverts) = (reader.f64s(2)?, reader.u8()? != 0);
            let (scaled_jacobian, fraction) = (values[0], values[1]);
            part.worst.push(FailingCell {
                cell,
                cell_type,
                centroid,
                scaled_jacobian,
                fraction,
                inverts,
            });
        }
        Ok(part)
    }

    fn merge(&mut self, other: Self) {
        self.cells += other.cells;
        self.failing += other.failing;
        self.inverted += other.inverted;
        for (shape, more) in self.shapes.iter_mut().zip(other.shapes) {
            *shape = (shape.0.min(more.0), shape.1 + more.1);
        }
        self.worst.extend(other.worst);
        self.keep_worst();
    }
}

/// Memory that is used again from cell to cell.
#[derive(Default)]
struct Memory {
    ends: [Scratch; 2],
    measure: Scratch,
}

impl<'a> Path<'a> {
    /// The path, and the floor that holds on it.
    fn new(
        domain: &'a Domain,
        start: &'a [Vector],
        end: &'a [Vector],
        guard: &Guard,
        cancellation: &'a Cancellation,
    ) -> (Self, f64) {
        let mesh = domain.mesh();
        let measure = Measure::new(mesh.cells());
        let cells = mesh.cells().len();
        let mut least = [least_scaled_jacobian(&measure, mesh.points()), -real(cells)];
        domain.communicator().reduce(Reduction::Minimum, &mut least);
        let [least, fewest] = least;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a count of cells"
        )]
        let most_cells = -fewest as usize;
        let floor = guard.min_scaled_jacobian.min(least);
        let with_slack = floor - 1e-9 * floor.abs();
        (Self { measure, start, end, floor: with_slack, domain, cancellation, most_cells }, floor)
    }

    fn require_wanted(&self) -> Result<(), Refusal> {
        if self.cancellation.is_cancelled() { Err(Refusal::Cancelled) } else { Ok(()) }
    }

    /// Looks at each cell of a range at all shapes, at four tetrahedra at a time.
    fn look(&self, range: std::ops::Range<usize>, fractions: &[f64]) -> Part {
        with_wide_registers(
            #[inline(always)]
            || {
                let mut part = Part::new(fractions.len());
                let mut doubtful = Vec::new();
                let mut single = Vec::new();
                let mut shapes = vec![(Lanes::all(f64::INFINITY), Lanes::ZERO); fractions.len()];
                let bound = Lanes::all(self.floor.max(0.0));
                let fours = |cells: [usize; LANES]| {
                    let vertices = cells.map(|cell| self.measure.cells.vertices(cell));
                    let tets = FourTets::new(vertices, self.start, self.end);
                    let mut least = Lanes::all(f64::INFINITY);
                    for (&fraction, (lowest, sum)) in fractions.iter().zip(&mut shapes) {
                        let scaled = tets.scaled_jacobians(fraction);
                        *lowest = lowest.least(scaled);
                        *sum += scaled;
                        least = least.least(scaled);
                    }
                    if !((least - bound).all_above(0.0) && tets.stay_valid(1.0)) {
                        doubtful.extend(cells);
                    }
                    part.cells += LANES;
                };
                self.measure.in_fours(range, fours, |cell| single.push(cell));
                for (total, (lowest, sum)) in part.shapes.iter_mut().zip(shapes) {
                    *total = (lowest.min(), sum.sum());
                }
                let mut memory = Memory::default();
                for cell in single {
                    part.cells += 1;
                    self.look_at(cell, fractions, &mut part, true, &mut memory);
                }
                for cell in doubtful {
                    self.look_at(cell, fractions, &mut part, false, &mut memory);
                }
                part
            },
        )
    }

    /// Looks at one cell at all shapes and between them.
    fn look_at(
        &self,
        cell: usize,
        fractions: &[f64],
        part: &mut Part,
        counts: bool,
        memory: &mut Memory,
    ) {
        let (mut value, mut at, mut inverts) = (f64::INFINITY, 0.0, false);
        for (&fraction, shape) in fractions.iter().zip(&mut part.shapes) {
            let (scaled, inverted) = self.quality_at(cell, fraction, memory);
            if counts {
                *shape = (shape.0.min(scaled), shape.1 + scaled);
            }
            inverts |= inverted;
            if scaled < value {
                (value, at) = (scaled, fraction);
            }
        }
        let least = least_on_path(&self.measure, cell, self.start, self.end, 1.0, &mut memory.ends);
        if !least.positive {
            inverts = true;
            let (scaled, _) = self.quality_at(cell, least.at, memory);
            if scaled < value {
                (value, at) = (scaled, least.at);
            }
        }
        if (inverts || value < self.floor) && !self.rests(cell) {
            let cells = self.measure.cells;
            part.fail(FailingCell {
                cell: self.domain.cell_number(cell),
                cell_type: cells.cell_type(cell).vtk(),
                centroid: centroid(cells, cell, self.start),
                scaled_jacobian: value,
                fraction: at,
                inverts,
            });
        }
    }

    fn quality_at(&self, cell: usize, fraction: f64, memory: &mut Memory) -> (f64, bool) {
        let point = |vertex: u32| {
            shape_at(self.start[vertex as usize], self.end[vertex as usize], fraction)
        };
        self.measure.cell(cell, point, &mut memory.measure).unwrap_or((1.0, false))
    }

    fn broken(&self, total: Part, floor: f64) -> BrokenPath {
        let (folded_faces, folded_at) = folded_faces(self.domain, self.start, self.end);
        BrokenPath {
            floor,
            min_scaled_jacobian: total.worst.first().map_or(floor, |worst| worst.scaled_jacobian),
            inverted: total.inverted,
            failing: total.failing,
            worst: total.worst,
            feasible_fraction: self.feasible_fraction(),
            folded_faces,
            folded_at,
        }
    }

    /// By bisection of "every cell is valid up to here and above the floor here", to 2⁻²⁰; coarser
    /// where it is given up.
    fn feasible_fraction(&self) -> f64 {
        if self.fails(1.0) {
            let (mut low, mut high) = (0.0, 1.0);
            for _ in 0..20 {
                if self.require_wanted().is_err() {
                    break;
                }
                let middle = 0.5 * (low + high);
                if self.fails(middle) { high = middle } else { low = middle }
            }
            low
        } else {
            1.0
        }
    }

    /// Whether a cell is broken at a fraction of the way or before it; also where it is given up.
    fn fails(&self, fraction: f64) -> bool {
        let fails = parallel::any_chunk(self.measure.cells.len(), CHUNK, |range| {
            if self.cancellation.is_cancelled() {
                return true;
            }
            with_wide_registers(
                #[inline(always)]
                || {
                    let mut doubtful = Vec::new();
                    let mut single = Vec::new();
                    let bound = Lanes::all(self.floor.max(0.0));
                    let fours = |cells: [usize; LANES]| {
                        let vertices = cells.map(|cell| self.measure.cells.vertices(cell));
                        let tets = FourTets::new(vertices, self.start, self.end);
                        let above = tets.scaled_jacobians(fraction) - bound;
                        if !(above.all_above(0.0) && tets.stay_valid(fraction)) {
                            doubtful.extend(cells);
                        }
                    };
                    self.measure.in_fours(range, fours, |cell| single.push(cell));
                    let mut memory = Memory::default();
                    doubtful
                        .into_iter()
                        .chain(single)
                        .any(|cell| self.cell_fails(cell, fraction, &mut memory))
                },
            )
        });
        self.domain.communicator().any(fails)
    }

    /// Whether a cell is inverted before a fraction of the way, or below the floor there.
    fn cell_fails(&self, cell: usize, fraction: f64, memory: &mut Memory) -> bool {
        let (value, inverted) = self.quality_at(cell, fraction, memory);
        let ends = &mut memory.ends;
        let is_valid = |ends| {
            least_on_path(&self.measure, cell, self.start, self.end, fraction, ends).positive
        };
        (inverted || value < self.floor || !is_valid(ends)) && !self.rests(cell)
    }

    /// Whether a cell stays on the whole path as the solver itself has it in the reference mesh.
    fn rests(&self, cell: usize) -> bool {
        let reference = self.domain.mesh().points();
        self.measure.cells.vertices(cell).iter().all(|&vertex| {
            [self.start, self.end]
                .iter()
                .all(|shape| shape[vertex as usize] == reference[vertex as usize])
        })
    }
}
