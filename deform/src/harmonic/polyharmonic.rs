//! Polyharmonic equations on a surface.

use super::double_double::DoubleDouble;
use super::{HarmonicOrder, Laplacian};
use crate::linear::cholesky::{MultifrontalFactor, NoFactor, Rows, dissect};
use crate::mesh::Vector;
use crate::topology::indices;

/// The largest error that one step of refinement, which squares it, still brings below what
/// matters.
const LARGEST_ERROR: f64 = 1e-3;

/// Steps of refinement in twice the digits: each brings three digits at the least.
const REFINEMENTS: usize = 6;

/// More couplings than this for each vertex, in the mean, are too many: some vertices then have
/// most others for neighbours.
const COUPLINGS: f64 = 4096.0;

/// The factored polyharmonic operator `L`, `L M^-1 L` or `L M^-1 L M^-1 L` with some vertices
/// prescribed.
///
/// Free vertices minimise the energy of the whole surface: that of order 2 also counts the bending
/// at the outermost prescribed vertices, so that a handle or fixed part at least one ring of faces
/// wide is met with its own slope, and one two rings wide with its own curvature for order 3.
pub(crate) struct Polyharmonic {
    order: HarmonicOrder,
    prescribed: Vec<bool>,
    /// Which of the editor's Laplacians it is made from.
    level: usize,
    free: Vec<u32>,
    factor: Option<MultifrontalFactor>,
}

impl Polyharmonic {
    /// `points` are the coordinates of the vertices, from which the order of elimination is found.
    /// `parts` gives each vertex its component; components without a prescribed vertex take no
    /// part.
    ///
    /// The operator is tried out on a known solution, so that one that has lost too many digits is
    /// refused as well.
    pub fn new(
        points: &[Vector],
        laplacian: &Laplacian,
        level: usize,
        order: HarmonicOrder,
        prescribed: Vec<bool>,
        parts: &[u32],
    ) -> Result<Self, NotFactored> {
        let mut held = vec![false; prescribed.len()];
        for (vertex, &part) in parts.iter().enumerate() {
            held[part as usize] |= prescribed[vertex];
        }
        let free: Vec<u32> = (0..prescribed.len())
            .filter(|&vertex| !prescribed[vertex] && held[parts[vertex] as usize])
            .map(|vertex| vertex as u32)
            .collect();
        let mut operator = Self { order, prescribed, level, free, factor: None };
        if operator.free.is_empty() {
            return Ok(operator);
        }
        let couplings: f64 = (0..laplacian.len())
            .map(|vertex| (laplacian.neighbours(vertex).count() as f64).powi(order as i32))
            .sum();
        if order != HarmonicOrder::Harmonic && couplings > COUPLINGS * laplacian.len() as f64 {
            return Err(NotFactored::TooLarge);
        }
        let neighbours = |vertex: usize| laplacian.neighbours(vertex).map(|(other, _)| other);
        let branch = dissect(points, &neighbours, order as usize, &mut operator.free);
        let positions = indices(laplacian.len(), &operator.free);
        let rows = || OperatorRows {
            laplacian,
            order,
            free: &operator.free,
            positions: &positions,
            row: SparseRow::new(laplacian.len()),
            product: SparseRow::new(laplacian.len()),
        };
        let factor = MultifrontalFactor::new(&branch, &rows).map_err(|reason| match reason {
            NoFactor::OutOfMemory => NotFactored::TooLarge,
            NoFactor::NotPositive => NotFactored::NotPositive,
        })?;
        operator.factor = Some(factor);
        if operator.error_on_ones(laplacian) < LARGEST_ERROR {
            Ok(operator)
        } else {
            Err(NotFactored::NotPositive)
        }
    }

    /// The largest error, before refinement, where the solution is 1 at every free vertex and 0 at
    /// every prescribed one.
    fn error_on_ones(&self, laplacian: &Laplacian) -> f64 {
        let mut ones = vec![0.0; laplacian.len()];
        for &vertex in &self.free {
            ones[vertex as usize] = 1.0;
        }
        let image = laplacian.apply_power(self.order as usize, &ones);
        let mut solution: Vec<f64> =
            self.free.iter().map(|&vertex| image[vertex as usize]).collect();
        self.solve_in_place(&mut solution);
        // A maximum that keeps NaN.
        solution
            .iter()
            .map(|value| (value - 1.0).abs())
            .fold(0.0, |a, b| if b <= a { a } else { b })
    }

    /// Whether this operator answers for an order and a set of prescribed vertices.
    pub fn is_for(&self, order: HarmonicOrder, prescribed: &[bool]) -> bool {
        self.order == order && self.prescribed == prescribed
    }

    /// Which of the editor's Laplacians it is made from.
    pub fn level(&self) -> usize {
        self.level
    }

    /// How many numbers the factor holds.
    pub fn size(&self) -> usize {
        self.factor.as_ref().map_or(0, MultifrontalFactor::len)
    }

    /// Fills in the free vertices of fields whose prescribed values are given, and leaves all
    /// others as they are.
    ///
    /// Where all prescribed vertices of a component have the same value, its free ones get that
    /// value exactly. The result is as accurate as one step of iterative refinement makes it: the
    /// residual is evaluated as a chain of differences, where constants cancel exactly, and not
    /// with the assembled matrix, whose entries have lost digits.
    pub fn solve(&self, laplacian: &Laplacian, parts: &[u32], fields: &mut [Vec<f64>]) {
        let mut active = Vec::new();
        for (index, field) in fields.iter_mut().enumerate() {
            let bases = self.bases(parts, field);
            let mut work: Vec<f64> = field
                .iter()
                .enumerate()
                .map(|(vertex, value)| {
                    if self.prescribed[vertex] {
                        value - bases[parts[vertex] as usize]
                    } else {
                        0.0
                    }
                })
                .collect();
            // In units of the largest value, so that nothing overflows on the way.
            let larger = |largest: f64, value: &f64| {
                if value.abs() > largest { value.abs() } else { largest }
            };
            let scale = work.iter().fold(0.0, larger);
            for &vertex in &self.free {
                field[vertex as usize] = bases[parts[vertex as usize] as usize];
            }
            if scale > 0.0 {
                work.iter_mut().for_each(|value| *value /= scale);
                active.push((index, scale, work));
            }
        }
        if active.is_empty() || self.free.is_empty() {
            return;
        }
        let corrections = if self.order == HarmonicOrder::Harmonic { 1 } else { 2 };
        for _ in 0..corrections {
            let residuals: Vec<Vec<f64>> = active
                .iter()
                .map(|(_, _, work)| laplacian.apply_power(self.order as usize, work))
                .collect();
            let mut correction: Vec<f64> = residuals
                .iter()
                .flat_map(|residual| self.free.iter().map(|&vertex| -residual[vertex as usize]))
                .collect();
            self.solve_in_place(&mut correction);
            for (column, (_, _, work)) in active.iter_mut().enumerate() {
                for (row, &vertex) in self.free.iter().enumerate() {
                    work[vertex as usize] += correction[column * self.free.len() + row];
                }
            }
        }
        for (index, scale, work) in active {
            for &vertex in &self.free {
                fields[index][vertex as usize] += work[vertex as usize] * scale;
            }
        }
    }

    /// How far a solved field is from the exact solution for its prescribed values, at each vertex.
    ///
    /// The exact solution is found from the field by refinement, with residuals evaluated in twice
    /// the digits.
    pub fn error(&self, laplacian: &Laplacian, field: &[f64]) -> Vec<f64> {
        let mut exact: Vec<DoubleDouble> = field.iter().map(|&value| value.into()).collect();
        for _ in 0..REFINEMENTS {
            let residual = laplacian.apply_power_exactly(self.order as usize, &exact);
            let mut correction: Vec<f64> =
                self.free.iter().map(|&vertex| -residual[vertex as usize].rounded()).collect();
            self.solve_in_place(&mut correction);
            for (&vertex, correction) in self.free.iter().zip(correction) {
                exact[vertex as usize] = exact[vertex as usize] + correction.into();
            }
        }
        exact.iter().zip(field).map(|(exact, &value)| (*exact - value.into()).rounded()).collect()
    }

    /// For each component the prescribed value nearest to 0, from which the others are counted.
    fn bases(&self, parts: &[u32], field: &[f64]) -> Vec<f64> {
        let mut bases: Vec<Option<f64>> = vec![None; field.len()];
        for (vertex, &value) in field.iter().enumerate() {
            if self.prescribed[vertex] {
                let base = &mut bases[parts[vertex] as usize];
                let nearer = |old: f64| (value.abs(), value) < (old.abs(), old);
                if base.is_none_or(nearer) {
                    *base = Some(value);
                }
            }
        }
        bases.into_iter().map(|base| base.unwrap_or(0.0)).collect()
    }

    fn solve_in_place(&self, right_hand_sides: &mut [f64]) {
        if let Some(factor) = &self.factor {
            factor.solve_in_place(right_hand_sides);
        }
    }
}

/// Why a polyharmonic operator could not be factored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub(crate) enum NotFactored {
    #[error("its factor does not fit in memory")]
    TooLarge,
    #[error(
        "it is too ill-conditioned: the surface has nearly degenerate triangles; a lower harmonic order may work"
    )]
    NotPositive,
}

/// The rows of the operator, in the order of elimination.
struct OperatorRows<'a> {
    laplacian: &'a Laplacian,
    order: HarmonicOrder,
    free: &'a [u32],
    /// The position of each vertex in that order; [`NONE`] for one that is not free.
    positions: &'a [u32],
    row: SparseRow,
    product: SparseRow,
}

const NONE: u32 = u32::MAX;

impl Rows for OperatorRows<'_> {
    fn row(&mut self, position: usize, mut entry: impl FnMut(usize, f64)) {
        let (row, product) = (&mut self.row, &mut self.product);
        row.clear();
        for (neighbour, value) in self.laplacian.row(self.free[position] as usize) {
            row.add(neighbour, value);
        }
        for _ in 1..self.order as usize {
            product.clear();
            for &middle in &row.pattern {
                let factor = row.values[middle] / self.laplacian.mass()[middle];
                for (neighbour, value) in self.laplacian.row(middle) {
                    product.add(neighbour, factor * value);
                }
            }
            std::mem::swap(row, product);
        }
        for &neighbour in &row.pattern {
            if self.positions[neighbour] != NONE {
                entry(self.positions[neighbour] as usize, row.values[neighbour]);
            }
        }
    }
}

/// A row that is dense to look up and sparse to walk.
struct SparseRow {
    values: Vec<f64>,
    present: Vec<bool>,
    pattern: Vec<usize>,
}

impl SparseRow {
    fn new(len: usize) -> Self {
        Self { values: vec![0.0; len], present: vec![false; len], pattern: Vec::new() }
    }

    fn add(&mut self, column: usize, value: f64) {
        if self.present[column] {
            self.values[column] += value;
        } else {
            self.present[column] = true;
            self.values[column] = value;
            self.pattern.push(column);
        }
    }

    fn clear(&mut self) {
        for column in self.pattern.drain(..) {
            self.present[column] = false;
        }
    }
}
