//! Polyharmonic equations on a surface.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::cholesky::{self, LltRef, SymbolicCholesky, SymmetricOrdering};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, Mat, Par, Side};

use super::HarmonicOrder;
use super::laplacian::Laplacian;

/// The largest error that one step of refinement, which squares it, still brings below what matters.
const LARGEST_ERROR: f64 = 1e-3;

/// The factored polyharmonic operator `L`, `L M^-1 L` or `L M^-1 L M^-1 L` with some vertices prescribed.
///
/// Free vertices minimise the energy of the whole surface: that of order 2 also counts the bending at the outermost prescribed
/// vertices, so that a handle or fixed part at least one ring of faces wide is met with its own slope, and one two rings wide
/// with its own curvature for order 3.
pub(super) struct Polyharmonic {
    order: HarmonicOrder,
    prescribed: Vec<bool>,
    /// Which of the editor's Laplacians it is made from.
    level: usize,
    free: Vec<u32>,
    symbolic: Option<SymbolicCholesky<u32>>,
    values: Vec<f64>,
}

impl Polyharmonic {
    /// `parts` gives each vertex its component; components without a prescribed vertex take no part.
    ///
    /// The operator is tried out on a known solution, so that one that has lost too many digits is refused as well.
    pub fn new(
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
        let mut operator = Self { order, prescribed, level, free, symbolic: None, values: Vec::new() };
        if operator.free.is_empty() {
            return Ok(operator);
        }
        let matrix = assemble(laplacian, order, &operator.free).ok_or(NotFactored::TooLarge)?;
        let (symbolic, values) = factor(&matrix, operator.free.len())?;
        (operator.symbolic, operator.values) = (Some(symbolic), values);
        if operator.error_on_ones(laplacian) < LARGEST_ERROR { Ok(operator) } else { Err(NotFactored::NotPositive) }
    }

    /// The largest error, before refinement, where the solution is 1 at every free vertex and 0 at every prescribed one.
    fn error_on_ones(&self, laplacian: &Laplacian) -> f64 {
        let mut ones = vec![0.0; laplacian.len()];
        for &vertex in &self.free {
            ones[vertex as usize] = 1.0;
        }
        let image = laplacian.apply_power(self.order as usize, &ones);
        let mut solution = Mat::from_fn(self.free.len(), 1, |row, _| image[self.free[row] as usize]);
        self.solve_in_place(&mut solution);
        // A maximum that keeps NaN.
        (0..self.free.len()).map(|row| (solution[(row, 0)] - 1.0).abs()).fold(0.0, |a, b| if b <= a { a } else { b })
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
        self.values.len()
    }

    /// Fills in the free vertices of fields whose prescribed values are given, and leaves all others as they are.
    ///
    /// Where all prescribed vertices of a component have the same value, its free ones get that value exactly. The result is
    /// as accurate as one step of iterative refinement makes it: the residual is evaluated as a chain of differences, where
    /// constants cancel exactly, and not with the assembled matrix, whose entries have lost digits.
    pub fn solve(&self, laplacian: &Laplacian, parts: &[u32], fields: &mut [Vec<f64>]) {
        let mut active = Vec::new();
        for (index, field) in fields.iter_mut().enumerate() {
            let bases = self.bases(parts, field);
            let mut work: Vec<f64> = field
                .iter()
                .enumerate()
                .map(
                    |(vertex, value)| if self.prescribed[vertex] { value - bases[parts[vertex] as usize] } else { 0.0 },
                )
                .collect();
            // In units of the largest value, so that nothing overflows on the way.
            let scale = work.iter().fold(0.0f64, |largest, value| largest.max(value.abs()));
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
            let residuals: Vec<Vec<f64>> =
                active.iter().map(|(_, _, work)| laplacian.apply_power(self.order as usize, work)).collect();
            let mut correction =
                Mat::from_fn(self.free.len(), active.len(), |row, column| -residuals[column][self.free[row] as usize]);
            self.solve_in_place(&mut correction);
            for (column, (_, _, work)) in active.iter_mut().enumerate() {
                for (row, &vertex) in self.free.iter().enumerate() {
                    work[vertex as usize] += correction[(row, column)];
                }
            }
        }
        for (index, scale, work) in active {
            for &vertex in &self.free {
                fields[index][vertex as usize] += work[vertex as usize] * scale;
            }
        }
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

    fn solve_in_place(&self, right_hand_sides: &mut Mat<f64>) {
        if let Some(symbolic) = &self.symbolic {
            let scratch = symbolic.solve_in_place_scratch::<f64>(right_hand_sides.ncols(), Par::Seq);
            LltRef::new(symbolic, &self.values).solve_in_place_with_conj(
                Conj::No,
                right_hand_sides.as_mut(),
                Par::Seq,
                MemStack::new(&mut MemBuffer::new(scratch)),
            );
        }
    }
}

/// Why a polyharmonic operator could not be factored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub(super) enum NotFactored {
    #[error("its factor does not fit in memory")]
    TooLarge,
    #[error("it is too ill-conditioned: the surface has nearly degenerate triangles; a lower harmonic order may work")]
    NotPositive,
}

/// The upper triangle of a symmetric matrix, column after column.
struct UpperTriangle {
    starts: Vec<u32>,
    rows: Vec<u32>,
    values: Vec<f64>,
}

/// The operator among the free vertices; `None` where it has more entries than can be numbered.
fn assemble(laplacian: &Laplacian, order: HarmonicOrder, free: &[u32]) -> Option<UpperTriangle> {
    const NONE: u32 = u32::MAX;
    let mut slots = vec![NONE; laplacian.len()];
    for (slot, &vertex) in free.iter().enumerate() {
        slots[vertex as usize] = slot as u32;
    }
    let mut matrix = UpperTriangle { starts: vec![0], rows: Vec::new(), values: Vec::new() };
    let mut row = SparseRow::new(laplacian.len());
    let mut product = SparseRow::new(laplacian.len());
    for (column, &vertex) in free.iter().enumerate() {
        row.clear();
        for (neighbour, value) in laplacian.row(vertex as usize) {
            row.add(neighbour, value);
        }
        for _ in 1..order as usize {
            product.clear();
            for &middle in &row.pattern {
                let factor = row.values[middle] / laplacian.mass()[middle];
                for (neighbour, value) in laplacian.row(middle) {
                    product.add(neighbour, factor * value);
                }
            }
            std::mem::swap(&mut row, &mut product);
        }
        row.pattern.sort_unstable();
        for &neighbour in &row.pattern {
            // Free vertices rise, and so do their slots.
            if slots[neighbour] != NONE && slots[neighbour] as usize <= column {
                matrix.rows.push(slots[neighbour]);
                matrix.values.push(row.values[neighbour]);
            }
        }
        matrix.starts.push(i32::try_from(matrix.rows.len()).ok()? as u32);
    }
    Some(matrix)
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

fn factor(matrix: &UpperTriangle, size: usize) -> Result<(SymbolicCholesky<u32>, Vec<f64>), NotFactored> {
    let pattern = SymbolicSparseColMatRef::new_checked(size, size, &matrix.starts, None, &matrix.rows);
    let symbolic = cholesky::factorize_symbolic_cholesky(
        pattern,
        Side::Upper,
        SymmetricOrdering::Amd,
        cholesky::CholeskySymbolicParams::default(),
    )
    .map_err(|_| NotFactored::TooLarge)?;
    let mut values = Vec::new();
    values.try_reserve_exact(symbolic.len_val()).map_err(|_| NotFactored::TooLarge)?;
    values.resize(symbolic.len_val(), 0.0);
    let scratch = symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, faer::Spec::default());
    let mut memory = MemBuffer::try_new(scratch).map_err(|_| NotFactored::TooLarge)?;
    symbolic
        .factorize_numeric_llt(
            &mut values,
            SparseColMatRef::new(pattern, &matrix.values),
            Side::Upper,
            faer::linalg::cholesky::llt::factor::LltRegularization::default(),
            Par::Seq,
            MemStack::new(&mut memory),
            faer::Spec::default(),
        )
        .map_err(|_| NotFactored::NotPositive)?;
    // A factor that is not finite would poison every solution without a word.
    if values.iter().all(|value| value.is_finite()) { Ok((symbolic, values)) } else { Err(NotFactored::NotPositive) }
}
