//! What a semi-definite matrix takes to zero.

use super::{ROW_CHUNK, SparseMatrix};
use crate::communicator::{Communicator, Halo, Reduction};
use crate::number::real;
use crate::parallel;

/// The vectors that a symmetric matrix takes to zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum NullSpace {
    /// The zero vector alone: the matrix is positive definite.
    #[default]
    Zero,
    /// The vectors that are constant over all rows that are coupled to others, as those of a
    /// Laplacian with no value prescribed anywhere. Of a right side the solver leaves out the
    /// constants, for which there is no solution; those of a solution, which are not determined,
    /// are zero.
    Constants,
}

/// The constants over those rows of a matrix that are coupled to others.
#[derive(Debug)]
pub(super) struct Constants {
    /// Whether each row is coupled to others, and whether this rank owns it besides.
    coupled: Vec<bool>,
    counted: Vec<bool>,
    /// The number of coupled rows of all ranks.
    count: f64,
}

impl Constants {
    /// The constants of the sum of the ranks' matrices. Collective.
    pub(super) fn new<const B: usize>(matrix: &SparseMatrix<B>, halo: &Halo) -> Self {
        let is_coupled = |row: usize| {
            let (columns, blocks) = matrix.row(row);
            let mut others =
                columns.iter().zip(blocks).filter(|(column, _)| **column as usize != row);
            others.any(|(_, block)| block.as_flattened().iter().any(|&entry| entry != 0.0))
        };
        let mut coupled: Vec<bool> = (0..matrix.rows()).map(is_coupled).collect();
        halo.any(&mut coupled);
        let counted: Vec<bool> =
            coupled.iter().enumerate().map(|(row, &coupled)| coupled && halo.owns(row)).collect();
        let count = halo.communicator().total(counted.iter().filter(|&&counted| counted).count());
        Self { coupled, counted, count: real(count.max(1)) }
    }

    /// Takes the mean of each value off a vector that all ranks have the same of. Rows of six
    /// values are shifts and turns; the constants are shifts. Collective.
    pub(super) fn remove<const B: usize, const K: usize>(
        &self,
        halo: &Halo,
        vector: &mut [[[f64; B]; K]],
    ) {
        let axes = if B == 6 { 3 } else { B };
        let parts = parallel::map_chunks(vector.len(), ROW_CHUNK, |range| {
            let mut sum = [[0.0; B]; K];
            for row in range.filter(|&row| self.counted[row]) {
                for (sum, value) in
                    sum.as_flattened_mut().iter_mut().zip(vector[row].as_flattened())
                {
                    *sum += value;
                }
            }
            sum
        });
        let mut mean = [[0.0; B]; K];
        for part in &parts {
            mean.as_flattened_mut()
                .iter_mut()
                .zip(part.as_flattened())
                .for_each(|(mean, part)| *mean += part);
        }
        halo.communicator().reduce(Reduction::Sum, mean.as_flattened_mut());
        mean.as_flattened_mut().iter_mut().for_each(|value| *value /= self.count);
        parallel::for_each_chunk(vector, ROW_CHUNK, |chunk, part| {
            for (value, _) in part
                .iter_mut()
                .zip(&self.coupled[chunk * ROW_CHUNK..])
                .filter(|(_, coupled)| **coupled)
            {
                for (value, mean) in value.iter_mut().zip(&mean) {
                    value.iter_mut().zip(mean).take(axes).for_each(|(value, mean)| *value -= mean);
                }
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;
    use std::sync::Arc;

    use super::*;
    use crate::communicator::{Solo, threads};
    use crate::linear::{LinearSolver, Multigrid, MultigridSettings, Precision, Tolerance};

    const TIGHT: Tolerance = Tolerance { relative: 1e-11, absolute: 0.0 };
    /// The right side and solution of a row that is coupled to no other.
    const ALONE: f64 = 3.0;

    /// A box of `count` by `count` by `long` vertices with a spring of 1 along each edge and none
    /// to a wall, and one vertex more that is coupled to nothing.
    struct Grid {
        count: usize,
        long: usize,
    }

    impl Grid {
        fn rows(&self) -> usize {
            self.count * self.count * self.long + 1
        }

        fn row(&self, vertex: usize) -> Vec<(usize, f64)> {
            let mut row = vec![(vertex, 0.0)];
            if vertex + 1 == self.rows() {
                return vec![(vertex, 1.0)];
            }
            for (stride, length) in self.strides() {
                let step = vertex / stride % length;
                let others = [
                    (step > 0).then(|| vertex - stride),
                    (step + 1 < length).then_some(vertex + stride),
                ];
                for other in others.into_iter().flatten() {
                    row.push((other, -1.0));
                    row[0].1 += 1.0;
                }
            }
            row
        }

        fn strides(&self) -> [(usize, usize); 3] {
            [(1, self.count), (self.count, self.count), (self.count * self.count, self.long)]
        }

        /// A discrete cosine at a vertex, and the number that the Laplacian multiplies it by.
        fn solution(&self, vertex: usize) -> (f64, f64) {
            let (mut value, mut factor) = (1.0, 0.0);
            for (waves, (stride, length)) in [1.0, 2.0, 1.0].into_iter().zip(self.strides()) {
                let angle = PI * waves / length as f64;
                value *= (angle * ((vertex / stride % length) as f64 + 0.5)).cos();
                factor += 2.0 - 2.0 * angle.cos();
            }
            (value, factor)
        }

        /// The largest error of a solve, and its iterations, with `constant` added to the right
        /// side. A rank owns consecutive rows, and has no others in its part of the matrix.
        fn solved(
            &self,
            communicator: Arc<dyn Communicator>,
            settings: MultigridSettings,
            constant: f64,
        ) -> (f64, usize) {
            let (rank, ranks) = (communicator.rank(), communicator.size());
            let first = |rank: usize| rank * self.rows() / ranks;
            let own = first(rank)..first(rank + 1);
            let mut foreign: Vec<usize> =
                own.clone().flat_map(|row| self.row(row)).map(|(column, _)| column).collect();
            foreign.retain(|column| !own.contains(column));
            foreign.sort_unstable();
            foreign.dedup();
            let number = |row: usize| {
                let position = |row| own.len() + foreign.binary_search(&row).unwrap();
                if own.contains(&row) { row - own.start } else { position(row) }
            };
            let owner = |row: usize| (0..ranks).find(|&rank| row < first(rank + 1)).unwrap();
            let owners: Vec<(usize, u32)> =
                foreign.iter().map(|&row| (owner(row), (row - first(owner(row))) as u32)).collect();
            let halo = Halo::of_owners(communicator, own.len(), &owners);
            let (mut offsets, mut columns, mut blocks) = (vec![0], Vec::new(), Vec::new());
            for row in own.clone() {
                let mut entries: Vec<(u32, f64)> = self
                    .row(row)
                    .into_iter()
                    .map(|(column, value)| (number(column) as u32, value))
                    .collect();
                entries.sort_by_key(|(column, _)| *column);
                columns.extend(entries.iter().map(|(column, _)| *column));
                blocks.extend(entries.iter().map(|(_, value)| [[*value]]));
                offsets.push(columns.len());
            }
            offsets.resize(own.len() + foreign.len() + 1, columns.len());
            let matrix = SparseMatrix::from_parts(offsets, columns, blocks);
            let solver = Multigrid::distributed(halo, matrix, settings).unwrap();
            let exact = |row: usize| {
                let (value, factor) = self.solution(row);
                if row + 1 == self.rows() {
                    (ALONE, ALONE)
                } else {
                    (value, factor * value + constant)
                }
            };
            let mut right_side: Vec<[f64; 1]> = own.clone().map(|row| [exact(row).1]).collect();
            right_side.resize(own.len() + foreign.len(), [0.0]);
            let mut solution = vec![[0.0]; right_side.len()];
            let convergence = solver.solve(&right_side, &mut solution, TIGHT).unwrap();
            let error = |(row, value): (usize, &[f64; 1])| (value[0] - exact(row).0).abs();
            (
                own.chain(foreign).zip(&solution).map(error).fold(0.0, f64::max),
                convergence.iterations,
            )
        }
    }

    const SETTINGS: MultigridSettings = MultigridSettings {
        precision: Precision::Single,
        max_iterations: 100,
        null_space: NullSpace::Constants,
        by_half: true,
    };

    #[test]
    fn a_laplacian_without_prescribed_values_is_solved_up_to_a_constant() {
        // One that is factored, and one of several levels.
        for (count, long, limit) in [(6, 9, 3), (16, 48, 30)] {
            for constant in [0.0, 5.0] {
                for settings in
                    [SETTINGS, MultigridSettings { precision: Precision::Double, ..SETTINGS }]
                {
                    let (error, iterations) =
                        Grid { count, long }.solved(Arc::new(Solo), settings, constant);
                    assert!(error < 1e-8, "{count}, {constant}: {error:e}");
                    assert!(iterations <= limit, "{count}, {constant}: {iterations} iterations");
                }
            }
        }
    }

    #[test]
    fn the_fallback_solves_it_too() {
        let settings = MultigridSettings { max_iterations: 2, ..SETTINGS };
        let (error, iterations) =
            Grid { count: 16, long: 20 }.solved(Arc::new(Solo), settings, 5.0);
        assert!(error < 1e-8 && iterations > 2, "{error:e}, {iterations}");
    }

    #[test]
    #[cfg_attr(target_family = "wasm", ignore = "no threads")]
    fn ranks_solve_it_together() {
        for ranks in [1, 2, 3] {
            for (count, long) in [(6, 9), (16, 48)] {
                let solved = threads::run(ranks, |own| {
                    Grid { count, long }.solved(Arc::new(own), SETTINGS, 5.0)
                });
                for (error, iterations) in solved {
                    assert!(error < 1e-8, "{count} on {ranks}: {error:e}");
                    assert!(iterations <= 40, "{count} on {ranks}: {iterations} iterations");
                }
            }
        }
    }
}
