//! The guard: every mesh on the path from one shape to another is checked before the first of them is handed out.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::cell::Scratch;
use super::fold::folded_faces;
use super::path::least_on_path;
use super::{CHUNK, Measure, WORST, centroid};
use crate::mesh::{Mesh, Vector};
use crate::number::{Number, Position};
use crate::parallel;
use crate::partition::{Partition, Reduction, Whole, all, any};

/// What a mesh must keep to on its way to a new shape, and what is done when it would not.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Guard {
    /// The least scaled Jacobian that any cell may have in any shape handed to the solver: 1 is the ideal cell, 0 a flat one.
    /// A mesh with worse cells to begin with may not get worse than it was. From 0 up to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub min_scaled_jacobian: f64,
    /// What is done with a change of shape that does not keep to it.
    pub otherwise: Otherwise,
    /// What is done with a surface that is broken before the volume comes into it: faces that lose their area, fold over or
    /// intersect, where they did not in the reference.
    pub surface: SurfaceRule,
}

/// What is done with a change of shape that the guard does not let through.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Otherwise {
    /// It is rejected, with the reason, the worst cells and the largest feasible fraction. The shape stays as it is.
    #[default]
    Reject,
    /// It is mended: in sub-steps stiffened anew on the way, with an inversion-free solve where these are not enough. Rejected
    /// where that does not succeed. [`judge`] itself only judges: it refuses the path either way.
    Untangle,
    /// As much of it is done as keeps to the guard: the largest feasible fraction of the order's amounts, which is reported.
    /// Rejected where that is nothing.
    Clamp,
}

/// What is done with a surface that is broken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum SurfaceRule {
    /// The change of shape is rejected before any volume work, with the faces, the place and the largest feasible fraction.
    #[default]
    Reject,
    /// The surface is taken as it is, not looked at; the quality of the cells alone decides. For bodies that are meant to come
    /// into contact.
    Allow,
}

impl Default for Guard {
    /// A floor of 0.02; whatever would fall under it is rejected, and so is a broken surface.
    fn default() -> Self {
        Self {
            min_scaled_jacobian: 0.02,
            otherwise: Otherwise::Reject,
            surface: SurfaceRule::Reject,
        }
    }
}

/// The quality along a path that the guard lets through.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct PathQuality {
    /// The floor that held: the guard's, or the least scaled Jacobian of the reference mesh where that is lower.
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

/// A cell that a path would break.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct FailingCell {
    /// The cell's number in the mesh.
    pub cell: usize,
    /// Its type, by VTK's number.
    pub cell_type: u8,
    /// The mean of its vertices at the start of the path.
    pub centroid: Vector,
    /// The least scaled Jacobian found on the path, -1 where it is no number.
    pub scaled_jacobian: f64,
    /// How far along the path that is.
    pub fraction: f64,
    /// Whether the cell is turned inside out somewhere on the path, in one of the shapes or between them.
    pub inverts: bool,
}

/// What is wrong with a path.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct BrokenPath {
    /// The floor that does not hold.
    pub floor: f64,
    /// The least scaled Jacobian found on the path.
    pub min_scaled_jacobian: f64,
    /// How many cells are turned inside out somewhere on the path.
    pub inverted: usize,
    /// How many cells fail, those turned inside out among them.
    pub failing: usize,
    /// The worst of the failing cells, at most 10, the worst first.
    pub worst: Vec<FailingCell>,
    /// How far along the path a mesh can go, in one straight step, with every cell valid all the way and above the floor at
    /// its end. 0 where not at all; below what is possible by at most one part in a million.
    pub feasible_fraction: f64,
    /// How many boundary faces have at the end of the path a normal that points against the one they started with. Where
    /// this is not 0, the prescribed surface folds over itself or turns by more than a right angle: no motion of the inside
    /// along this path can mend that.
    pub folded_faces: usize,
    /// Where the first of these faces started.
    pub folded_at: Option<Vector>,
}

/// Why a path was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Refusal {
    /// A mesh on the path would be broken.
    #[error("{}", describe(.0))]
    Quality(Box<BrokenPath>),
    /// A shape with another number of points than the mesh.
    #[error("the {which} shape has {found} points; the mesh has {expected}")]
    PointCount {
        /// `start` or `end`.
        which: &'static str,
        /// How many there are.
        found: usize,
        /// How many there should be.
        expected: usize,
    },
    /// A coordinate that is NaN or infinite.
    #[error(
        "vertex {vertex} of the {which} shape lies at {point:?}; every coordinate must be finite"
    )]
    NotFinite {
        /// `start` or `end`.
        which: &'static str,
        /// The vertex.
        vertex: usize,
        /// Its coordinates.
        point: Vector,
    },
    /// A fraction that is not on the path.
    #[error("fraction {index} of the path is {}; fractions are above 0, rise, and are at most 1", Number(*value))]
    Fraction {
        /// Which of the fractions.
        index: usize,
        /// What it is.
        value: f64,
    },
    /// What another rank was given makes no sense.
    #[error("the shapes given on another rank make no sense")]
    OtherRank,
    /// A floor out of range.
    #[error("guard.min_scaled_jacobian is {}; it must be from 0 to 1", Number(*value))]
    Floor {
        /// What it is.
        value: f64,
    },
}

impl BrokenPath {
    /// What is wrong, without the fractions of the path: for those who follow a longer way, of which it is a piece.
    #[must_use]
    pub fn flaw(&self) -> String {
        self.described(|_| String::new())
    }

    fn described(&self, way_of: impl Fn(&FailingCell) -> String) -> String {
        let mut text = match self.inverted {
            0 => {
                format!(
                    "{} cell(s) would fall under the scaled Jacobian of {:.4}",
                    self.failing,
                    Number(self.floor)
                )
            }
            inverted => format!("{inverted} cell(s) would be turned inside out"),
        };
        if let Some(worst) = self.worst.first() {
            let (place, value) = (Position(worst.centroid), Number(worst.scaled_jacobian));
            text += &format!(
                "; the worst is cell {} at {place} with {value:.4}{}",
                worst.cell,
                way_of(worst)
            );
        }
        if self.folded_faces > 0 {
            text += &format!(
                "; the prescribed surface itself turns over at {} face(s)",
                self.folded_faces
            );
            if let Some(place) = self.folded_at {
                text += &format!(", the first at {}", Position(place));
            }
        }
        text
    }
}

impl Refusal {
    /// What is wrong, without the fractions of the path that was judged: see [`BrokenPath::flaw`].
    #[must_use]
    pub fn flaw(&self) -> String {
        match self {
            Refusal::Quality(path) => path.flaw(),
            other => other.to_string(),
        }
    }
}

fn describe(path: &BrokenPath) -> String {
    let text = path.described(|worst| format!(" at {:.1} % of the way", 100.0 * worst.fraction));
    // Rounded down, so that what is shown is feasible.
    text + &format!(
        "; the largest feasible fraction is {:.4}",
        (path.feasible_fraction * 1e4).floor() / 1e4
    )
}

/// The point of a straight path a `fraction` of the way from `start` to `end`; at 0 and 1 exactly these.
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

/// Judges the straight path from the shape `start` to the shape `end` (coordinates of every vertex), of which the shapes at
/// `fractions` will be handed to the solver.
///
/// - Every shape keeps to the guard's floor, or to the least scaled Jacobian of the reference mesh (`mesh` as it lies) where
///   that is lower; a slack of one part in 10⁹ allows for rounding.
/// - No cell is turned inside out at any place of the path, between the shapes too. A tetrahedron's determinant along a straight
///   path is a cubic, of which the least value is found in closed form; of hexahedra, wedges and pyramids
///   the determinants at the corners are looked at in the same way, and bounds of it everywhere inside; of prisms and polyhedra
///   the tetrahedra that they are split into (see [`scaled_jacobian`](super::scaled_jacobian)).
/// - In a mesh of polygons, no corner turns against the polygon's normal at the start.
///
/// Cost: one pass over the cells, on all threads. Only a refusal costs more (the bisection for the feasible fraction).
///
/// # Errors
/// [`Refusal::Quality`] with what would break, where, and how far one could go; other [`Refusal`]s for senseless arguments.
pub fn judge(
    mesh: &Mesh,
    start: &[Vector],
    end: &[Vector],
    fractions: &[f64],
    guard: &Guard,
) -> Result<PathQuality, Refusal> {
    judge_in_parts(mesh, start, end, fractions, guard, &Whole)
}

/// The same of a mesh that is in parts, of which `mesh` is this rank's: its cells are no other rank's. Collective; all ranks get the
/// verdict on the whole mesh.
///
/// # Errors
/// As [`judge`]; [`Refusal::OtherRank`] where the arguments of another rank make no sense.
pub fn judge_in_parts(
    mesh: &Mesh,
    start: &[Vector],
    end: &[Vector],
    fractions: &[f64],
    guard: &Guard,
    partition: &dyn Partition,
) -> Result<PathQuality, Refusal> {
    let arguments = check_arguments(mesh, start, end, fractions, guard);
    if !all(partition, arguments.is_ok()) {
        arguments?;
        return Err(Refusal::OtherRank);
    }
    let (path, floor) = Path::new(mesh, start, end, guard, partition);
    let parts =
        parallel::map_chunks(mesh.cells().len(), CHUNK, |range| path.look(range, fractions));
    let mut total = Part::new(fractions.len());
    for part in parts {
        total.merge(part);
    }
    if partition.ranks() > 1 {
        total = total.added_up(partition);
    }
    if total.failing > 0 {
        return Err(Refusal::Quality(Box::new(path.broken(total, floor))));
    }
    #[expect(clippy::cast_precision_loss, reason = "fewer cells than 2^53")]
    let count = total.cells.max(1) as f64;
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

/// Whether [`judge`] would let a straight step through, without saying why not.
#[must_use]
pub fn keeps(mesh: &Mesh, start: &[Vector], end: &[Vector], guard: &Guard) -> bool {
    keeps_in_parts(mesh, start, end, guard, &Whole)
}

/// Whether [`judge_in_parts`] would let a straight step through. Collective.
#[must_use]
pub fn keeps_in_parts(
    mesh: &Mesh,
    start: &[Vector],
    end: &[Vector],
    guard: &Guard,
    partition: &dyn Partition,
) -> bool {
    if !all(partition, check_arguments(mesh, start, end, &[1.0], guard).is_ok()) {
        return false;
    }
    let path = Path::new(mesh, start, end, guard, partition).0;
    !path.fails(1.0)
}

fn check_arguments(
    mesh: &Mesh,
    start: &[Vector],
    end: &[Vector],
    fractions: &[f64],
    guard: &Guard,
) -> Result<(), Refusal> {
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

/// The least scaled Jacobian at `points`, but not below 0: a reference that is inverted gives nothing away.
fn least_scaled_jacobian(measure: &Measure<'_>, points: &[Vector]) -> f64 {
    parallel::map_chunks(measure.cells.len(), CHUNK, |range| {
        let mut scratch = Scratch::default();
        range
            .filter_map(|cell| measure.cell(cell, |vertex| points[vertex as usize], &mut scratch))
            .fold(1.0, |least: f64, (value, _)| least.min(value))
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
    partition: &'a dyn Partition,
}

/// What was found in some of the cells.
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

    /// What the ranks have found.
    #[expect(
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "counts below 2^53"
    )]
    fn added_up(mut self, partition: &dyn Partition) -> Self {
        self.keep_worst();
        let shapes = self.shapes.len();
        let mut mine = vec![
            self.cells as f64,
            self.failing as f64,
            self.inverted as f64,
            self.worst.len() as f64,
        ];
        mine.extend(self.shapes.iter().flat_map(|&(least, sum)| [least, sum]));
        mine.extend(self.worst.iter().flat_map(|worst| {
            let [x, y, z] = worst.centroid;
            let kind = [worst.cell as f64, f64::from(worst.cell_type)];
            let measures =
                [worst.scaled_jacobian, worst.fraction, f64::from(u8::from(worst.inverts))];
            kind.into_iter().chain([x, y, z]).chain(measures)
        }));
        let mut values = partition.gather(&mine).into_iter();
        let mut next = || values.next().unwrap_or(f64::NAN);
        let mut total = Self::new(shapes);
        for _ in 0..partition.ranks() {
            let mut part = Self::new(shapes);
            (part.cells, part.failing, part.inverted) =
                (next() as usize, next() as usize, next() as usize);
            let worst = next() as usize;
            part.shapes.iter_mut().for_each(|shape| *shape = (next(), next()));
            part.worst = (0..worst.min(WORST))
                .map(|_| FailingCell {
                    cell: next() as usize,
                    cell_type: next() as u8,
                    centroid: [next(), next(), next()],
                    scaled_jacobian: next(),
                    fraction: next(),
                    inverts: next() > 0.0,
                })
                .collect();
            total.merge(part);
        }
        total
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
        mesh: &'a Mesh,
        start: &'a [Vector],
        end: &'a [Vector],
        guard: &Guard,
        partition: &'a dyn Partition,
    ) -> (Self, f64) {
        let measure = Measure::new(mesh.cells());
        let mut least = [least_scaled_jacobian(&measure, mesh.points())];
        partition.reduce(Reduction::Minimum, &mut least);
        let floor = guard.min_scaled_jacobian.min(least[0]);
        (Self { measure, start, end, floor: floor - 1e-9 * floor.abs(), partition }, floor)
    }

    fn look(&self, range: std::ops::Range<usize>, fractions: &[f64]) -> Part {
        let mut part = Part::new(fractions.len());
        let mut memory = Memory::default();
        for cell in range.filter(|&cell| self.measure.is_measured(cell)) {
            part.cells += 1;
            let (mut value, mut at, mut inverts) = (f64::INFINITY, 0.0, false);
            for (&fraction, shape) in fractions.iter().zip(&mut part.shapes) {
                let (scaled, inverted) = self.quality_at(cell, fraction, &mut memory);
                *shape = (shape.0.min(scaled), shape.1 + scaled);
                inverts |= inverted;
                if scaled < value {
                    (value, at) = (scaled, fraction);
                }
            }
            let least =
                least_on_path(&self.measure, cell, self.start, self.end, 1.0, &mut memory.ends);
            if !least.positive {
                inverts = true;
                let (scaled, _) = self.quality_at(cell, least.at, &mut memory);
                if scaled < value {
                    (value, at) = (scaled, least.at);
                }
            }
            if inverts || value < self.floor {
                let cells = self.measure.cells;
                part.fail(FailingCell {
                    cell: self.partition.cell_number(cell),
                    cell_type: cells.cell_type(cell).vtk(),
                    centroid: centroid(cells, cell, self.start),
                    scaled_jacobian: value,
                    fraction: at,
                    inverts,
                });
            }
        }
        part
    }

    fn quality_at(&self, cell: usize, fraction: f64, memory: &mut Memory) -> (f64, bool) {
        let point = |vertex: u32| {
            shape_at(self.start[vertex as usize], self.end[vertex as usize], fraction)
        };
        self.measure.cell(cell, point, &mut memory.measure).unwrap_or((1.0, false))
    }

    fn broken(&self, total: Part, floor: f64) -> BrokenPath {
        let (folded_faces, folded_at) =
            folded_faces(self.measure.cells, self.start, self.end, self.partition);
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

    /// By bisection of "every cell is valid up to here and above the floor here", to 2⁻²⁰.
    fn feasible_fraction(&self) -> f64 {
        if self.fails(1.0) {
            let (mut low, mut high) = (0.0, 1.0);
            for _ in 0..20 {
                let middle = 0.5 * (low + high);
                if self.fails(middle) { high = middle } else { low = middle }
            }
            low
        } else {
            1.0
        }
    }

    fn fails(&self, fraction: f64) -> bool {
        let fails = parallel::any_chunk(self.measure.cells.len(), CHUNK, |mut range| {
            let mut memory = Memory::default();
            range.any(|cell| {
                self.measure.is_measured(cell) && {
                    let (value, inverted) = self.quality_at(cell, fraction, &mut memory);
                    inverted
                        || value < self.floor
                        || !least_on_path(
                            &self.measure,
                            cell,
                            self.start,
                            self.end,
                            fraction,
                            &mut memory.ends,
                        )
                        .positive
                }
            })
        });
        any(self.partition, fails)
    }
}
