//! Which rows a coarser system puts together, by smoothed aggregation.

use std::collections::BTreeMap;

use super::transfer::Interpolation;
use super::{ROW_CHUNK, SparseMatrix};
use crate::number::{index, real};
use crate::parallel;
use crate::vector::{Vector, add, dot, scale, subtract};

/// A row that belongs to no aggregate.
const NONE: u32 = u32::MAX;

/// An aggregate is taken to be at least this part as large as those of its level are on average.
const LEAST_SIZE: f64 = 1e-2;

/// For each block of a matrix one number, the trace of its first three rows and columns: for
/// elasticity that is the Laplacian of the same material, which tells how strongly two vertices are
/// coupled whatever the direction.
pub(super) fn couplings<const B: usize>(matrix: &SparseMatrix<B>) -> Vec<f64> {
    let mut couplings = vec![0.0; matrix.values().len()];
    parallel::for_each_chunk(&mut couplings, 16 * ROW_CHUNK, |chunk, part| {
        for (value, block) in part.iter_mut().zip(&matrix.values()[chunk * 16 * ROW_CHUNK..]) {
            *value = block.iter().take(3).enumerate().map(|(axis, row)| row[axis]).sum();
        }
    });
    couplings
}

/// For rows how strongly they are coupled to aggregates by what is not in their own columns.
pub(super) type Across = BTreeMap<u32, Vec<(u32, f64)>>;

/// Rows put together into coarser ones: all rows of a matrix, or the first ones, which make
/// aggregates by themselves.
#[derive(Debug)]
pub(super) struct Aggregates {
    /// For each block of these rows, whether it counts in smoothing.
    strong: Vec<bool>,
    /// The aggregate of each row.
    of_row: Vec<u32>,
    count: usize,
}

impl Aggregates {
    /// The first `rows` rows with those of them that they are strongly coupled to: `a_ij² >
    /// threshold² a_ii a_jj`. A row that is so coupled to none is in no aggregate, smoothing alone
    /// solves for it; or in one of its own, where `reaches` says that it is coupled to other rows
    /// than these.
    pub(super) fn new<const B: usize>(
        matrix: &SparseMatrix<B>,
        couplings: &[f64],
        threshold: f64,
        rows: usize,
        reaches: impl Fn(usize) -> bool,
    ) -> Self {
        let diagonal: Vec<f64> = parallel::map_chunks(rows, ROW_CHUNK, |range| {
            let own = |row: usize| {
                let entry = matrix.row(row).0.binary_search_by_key(&row, |&column| column as usize);
                entry.map_or(0.0, |entry| couplings[matrix.offsets()[row] + entry])
            };
            range.map(own).collect::<Vec<_>>()
        })
        .concat();
        let threshold = threshold * threshold;
        let strong: Vec<bool> = parallel::map_chunks(rows, ROW_CHUNK, |range| {
            let mut strong =
                Vec::with_capacity(matrix.offsets()[range.end] - matrix.offsets()[range.start]);
            for row in range {
                let couplings = &couplings[matrix.offsets()[row]..matrix.offsets()[row + 1]];
                strong.extend(matrix.row(row).0.iter().zip(couplings).map(
                    |(&column, coupling)| {
                        let other = column as usize;
                        other != row
                            && other < rows
                            && coupling * coupling > threshold * diagonal[row] * diagonal[other]
                    },
                ));
            }
            strong
        })
        .concat();
        let (of_row, count) = group(matrix, &strong, rows, reaches);
        Self { strong, of_row, count }
    }

    /// The interpolation from the aggregates to the rows: constant on each, smoothed by one step of
    /// damped Jacobi with the matrix of couplings, the weak ones lumped into its diagonal (P.
    /// Vaněk, J. Mandel, M. Brezina 1996).
    ///
    /// With `bodies` each aggregate turns as well. `across` are couplings beside those of the rows
    /// with each other, all of them strong.
    pub(super) fn interpolation<const B: usize>(
        &self,
        matrix: &SparseMatrix<B>,
        couplings: &[f64],
        damping: f64,
        bodies: Option<&Bodies>,
        across: &Across,
    ) -> Interpolation {
        let (offsets, rows) = (matrix.offsets(), self.of_row.len());
        let parts = parallel::map_chunks(rows, ROW_CHUNK, |range| {
            let (mut lengths, mut columns, mut weights, mut arms) =
                (Vec::new(), Vec::new(), Vec::new(), Vec::new());
            let mut found: Vec<(u32, f64, Vector)> = Vec::new();
            for row in range {
                found.clear();
                let own = self.of_row[row];
                if own == NONE {
                    lengths.push(0);
                    continue;
                }
                let among = matrix.row(row).0.partition_point(|&column| (column as usize) < rows);
                let entries = offsets[row]..offsets[row] + among;
                let (mut lumped, mut whole) = (0.0, 0.0);
                for entry in entries.clone().filter(|&entry| !self.strong[entry]) {
                    lumped += couplings[entry];
                    if matrix.columns()[entry] as usize == row {
                        whole = couplings[entry];
                    }
                }
                let diagonal = if lumped > 0.1 * whole { lumped } else { whole };
                let mut gather = |row: usize, aggregate: u32, weight: f64| {
                    let arm =
                        bodies.map_or([0.0; 3], |bodies| scale(bodies.arm(row, aggregate), weight));
                    match found.iter_mut().find(|(other, ..)| *other == aggregate) {
                        Some((_, sum, arms)) => {
                            *sum += weight;
                            *arms = add(*arms, arm);
                        }
                        None => found.push((aggregate, weight, arm)),
                    }
                };
                gather(row, own, 1.0 - damping);
                for entry in entries.filter(|&entry| self.strong[entry]) {
                    let other = matrix.columns()[entry] as usize;
                    let aggregate = self.of_row[other];
                    if aggregate != NONE {
                        gather(other, aggregate, -damping * couplings[entry] / diagonal);
                    }
                }
                for &(aggregate, coupling) in across.get(&index(row)).into_iter().flatten() {
                    gather(row, aggregate, -damping * coupling / diagonal);
                }
                found.sort_unstable_by_key(|(aggregate, ..)| *aggregate);
                lengths.push(found.len());
                for &(aggregate, weight, arm) in &found {
                    columns.push(aggregate);
                    weights.push(weight);
                    if bodies.is_some() {
                        arms.push(arm);
                    }
                }
            }
            (lengths, columns, weights, arms)
        });
        let mut result = Interpolation {
            offsets: vec![0],
            turn: bodies.map_or(0.0, |bodies| bodies.turn),
            ..Default::default()
        };
        let mut end = 0;
        for (lengths, columns, weights, arms) in parts {
            result.offsets.extend(lengths.into_iter().map(|length| {
                end += length;
                end
            }));
            result.columns.extend(columns);
            result.weights.extend(weights);
            result.arms.extend(arms);
        }
        result
    }

    /// The aggregate of a row.
    pub(super) fn of(&self, row: usize) -> Option<u32> {
        self.of_row.get(row).copied().filter(|&aggregate| aggregate != NONE)
    }

    /// How many aggregates there are.
    pub(super) fn count(&self) -> usize {
        self.count
    }
}

/// Where the rows of a matrix and their aggregates lie, so that aggregates can turn as rigid
/// bodies.
#[derive(Debug)]
pub(super) struct Bodies {
    /// The position of each row, and the centre of each aggregate.
    positions: Vec<Vector>,
    centres: Vec<Vector>,
    /// The mean size of an aggregate: a turn is told by how far it moves what is as far from the
    /// centre as this.
    size: f64,
    /// A turn of a row, as this level tells it, for one of its aggregate.
    turn: f64,
    /// The size of each aggregate, in parts of the mean one.
    sizes: Vec<f64>,
}

impl Bodies {
    /// `turn_size` is the size that tells a turn of the rows themselves; 0 where these do not turn.
    pub(super) fn new(aggregates: &Aggregates, positions: Vec<Vector>, turn_size: f64) -> Self {
        let mut centres = vec![[0.0; 3]; aggregates.count];
        let mut members = vec![0.0f64; aggregates.count];
        let pairs = || {
            aggregates.of_row.iter().zip(&positions).filter(|(aggregate, _)| **aggregate != NONE)
        };
        for (&aggregate, &position) in pairs() {
            centres[aggregate as usize] = add(centres[aggregate as usize], position);
            members[aggregate as usize] += 1.0;
        }
        for (centre, members) in centres.iter_mut().zip(&members) {
            *centre = scale(*centre, 1.0 / members);
        }
        let mut sizes = vec![0.0; aggregates.count];
        for (&aggregate, &position) in pairs() {
            let arm = subtract(position, centres[aggregate as usize]);
            sizes[aggregate as usize] += dot(arm, arm) / members[aggregate as usize];
        }
        let size = (sizes.iter().sum::<f64>() / real(sizes.len().max(1))).sqrt();
        let size = if size.is_normal() { size } else { 1.0 };
        let sizes =
            sizes.into_iter().map(|square| (square.sqrt() / size).max(LEAST_SIZE)).collect();
        Self { positions, centres, size, turn: turn_size / size, sizes }
    }

    fn arm(&self, row: usize, aggregate: u32) -> Vector {
        scale(subtract(self.positions[row], self.centres[aggregate as usize]), 1.0 / self.size)
    }

    /// The size of each aggregate, in parts of the mean one.
    pub(super) fn sizes(&self) -> &[f64] {
        &self.sizes
    }

    /// The mean size of an aggregate, and the centres, which are the positions of the coarser rows.
    pub(super) fn into_coarse(self) -> (Vec<Vector>, f64) {
        (self.centres, self.size)
    }
}

/// Each row that is free, with all that it is coupled to, makes an aggregate; then what is left
/// joins its neighbours.
fn group<const B: usize>(
    matrix: &SparseMatrix<B>,
    strong: &[bool],
    rows: usize,
    reaches: impl Fn(usize) -> bool,
) -> (Vec<u32>, usize) {
    let (offsets, columns) = (matrix.offsets(), matrix.columns());
    let neighbours = |row: usize| {
        let range = offsets[row]..offsets[row + 1];
        columns[range.clone()]
            .iter()
            .zip(&strong[range])
            .filter(|(_, strong)| **strong)
            .map(|(&column, _)| column as usize)
    };
    let mut of_row = vec![NONE; rows];
    let mut count = 0u32;
    for row in 0..rows {
        if of_row[row] == NONE
            && neighbours(row).next().is_some()
            && neighbours(row).all(|other| of_row[other] == NONE)
        {
            of_row[row] = count;
            for other in neighbours(row) {
                of_row[other] = count;
            }
            count += 1;
        }
    }
    let first = of_row.clone();
    for (row, own) in of_row.iter_mut().enumerate() {
        if *own == NONE
            && let Some(other) = neighbours(row).find(|&other| first[other] != NONE)
        {
            *own = first[other];
        }
    }
    for row in 0..rows {
        if of_row[row] == NONE && (neighbours(row).next().is_some() || reaches(row)) {
            of_row[row] = count;
            for other in neighbours(row) {
                if of_row[other] == NONE {
                    of_row[other] = count;
                }
            }
            count += 1;
        }
    }
    (of_row, count as usize)
}
