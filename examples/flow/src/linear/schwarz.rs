//! A preconditioner for matrices whose rows are dealt out to ranks.

use super::multigrid::DenseCholesky;
use super::{Halo, Matrix, Multigrid};

/// Unknowns of the coarse system on all ranks together, where there are fewer ranks than that.
const COARSE: usize = 256;
/// Unknowns of the coarse system that one rank has at most.
const PER_RANK: usize = 24;

/// On one process [`Multigrid`]; on several additive Schwarz on two levels (Dryja and Widlund 1987; coarse space of Nicolaides
/// 1987): multigrid of each rank's own rows, and a coarse system of aggregates of consecutive rows, which is what keeps the number
/// of iterations from growing with the length of the domain. It is factored on every rank, from the same bits.
///
/// Rows are numbered by reverse Cuthill-McKee, so that consecutive rows are slabs across the domain's longest extent.
#[derive(Debug)]
pub struct Schwarz {
    own: Multigrid,
    coarse: Option<Coarse>,
}

#[derive(Debug)]
struct Coarse {
    /// The aggregate of each of the rank's rows.
    aggregates: Vec<usize>,
    factor: DenseCholesky,
    values: Vec<f64>,
}

impl Schwarz {
    /// Sets it up for a symmetric positive (semi-)definite matrix. Collective.
    #[must_use]
    pub fn new(matrix: &Matrix, halo: &Halo) -> Self {
        if halo.ranks() == 1 {
            return Self { own: Multigrid::new(matrix), coarse: None };
        }
        Self {
            own: Multigrid::new(&matrix.leading_block(halo.rows())),
            coarse: Some(Coarse::new(matrix, halo)),
        }
    }

    /// `result` = the preconditioner times `right`, on the rank's own rows. Collective.
    pub fn apply(&mut self, right: &[f64], result: &mut [f64], halo: &Halo) {
        self.own.apply(right, result);
        if let Some(coarse) = &mut self.coarse {
            coarse.add(right, result, halo);
        }
    }
}

impl Coarse {
    fn new(matrix: &Matrix, halo: &Halo) -> Self {
        let rows = halo.rows();
        let each = (COARSE / halo.ranks()).clamp(1, PER_RANK);
        let size = each * halo.ranks();
        let first = each * halo.rank();
        let aggregates: Vec<usize> = (0..rows).map(|row| first + row * each / rows).collect();
        #[expect(clippy::cast_precision_loss, reason = "few aggregates")]
        let mut of_all: Vec<f64> = aggregates.iter().map(|&aggregate| aggregate as f64).collect();
        of_all.resize(halo.vertices(), 0.0);
        halo.update(&mut of_all);
        let mut dense = vec![0.0; size * size];
        for (row, aggregate) in aggregates.iter().enumerate() {
            for entry in matrix.pattern.row(row) {
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "a number of an aggregate"
                )]
                let other = of_all[matrix.pattern.columns[entry] as usize] as usize;
                dense[aggregate * size + other.min(size - 1)] += matrix.values[entry];
            }
        }
        halo.add(&mut dense);
        // An aggregate without a row: a rank has fewer rows than that, or none.
        for aggregate in 0..size {
            let diagonal = &mut dense[aggregate * size + aggregate];
            if *diagonal <= 0.0 {
                *diagonal = 1.0;
            }
        }
        Self { aggregates, factor: DenseCholesky::of_dense(dense, size), values: vec![0.0; size] }
    }

    fn add(&mut self, right: &[f64], result: &mut [f64], halo: &Halo) {
        self.values.fill(0.0);
        for (value, &aggregate) in right.iter().zip(&self.aggregates) {
            self.values[aggregate] += value;
        }
        halo.add(&mut self.values);
        self.factor.solve(&mut self.values);
        for (value, &aggregate) in result.iter_mut().zip(&self.aggregates) {
            *value += self.values[aggregate];
        }
    }
}
