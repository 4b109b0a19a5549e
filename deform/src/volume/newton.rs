//! Newton's method on the foldover-free energy of all cells at once.

use std::sync::Arc;

use super::corners::Corner;
use super::foldover;
use crate::cancellation::Cancellation;
use crate::communicator::{Communicator, Halo, Reduction};
use crate::linear::{
    Cancellable, ConjugateGradients, LinearError, Multigrid, MultigridSettings, Solver, Solvers,
    SparseMatrix, Tolerance, reverse_cuthill_mckee,
};
use crate::mesh::{Mesh, Numbering, Vector};
use crate::parallel;
use crate::topology::{Groups, indices, marks};
use crate::vector::{add, dot, scale, subtract};

/// How many corners are worked on at a time, and how many such pieces are kept before they are
/// added up.
const CHUNK: usize = 1024;
const PIECES: usize = 16;

/// Iterations of the linear solver in a Newton step: a direction that is not exact is good enough.
const ITERATIONS: usize = 400;

/// The part of the right side that a Newton step may leave: a body on its way back bends as a
/// whole, which is little of it.
const TOLERANCE: f64 = 1e-2;
const RETURNING_TOLERANCE: f64 = 1e-4;

/// How often a step is halved before it is given up.
const HALVINGS: usize = 30;

const NONE: u32 = u32::MAX;

/// The positions of the free vertices as unknowns, and the energy of corners as a function of them.
#[derive(Debug)]
pub(super) struct Newton {
    /// The vertex of each unknown.
    pub(super) unknowns: Vec<u32>,
    /// The unknown of each vertex.
    slots: Vec<u32>,
    offsets: Vec<usize>,
    columns: Vec<u32>,
    halo: Halo,
    /// Looked at before each step, each length of one and each iteration of its solve.
    pub(super) cancellation: Cancellation,
}

/// Springs that draw each unknown to a position: the energy `½ weight |x - position|²`.
pub(super) struct Pull {
    pub(super) positions: Vec<Vector>,
    pub(super) weights: Vec<f64>,
}

/// The energy that is brought down: the foldover-free one of `corners` with the regularisation
/// `epsilon`, and that of the springs.
#[derive(Clone, Copy)]
pub(super) struct Energy<'a> {
    pub(super) corners: &'a [Corner],
    pub(super) epsilon: f64,
    pub(super) pull: Option<&'a Pull>,
}

/// The energy before and after a step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Step {
    pub(super) before: f64,
    pub(super) after: f64,
}

impl Newton {
    /// The unknowns of a mesh whose vertices have `numbering`'s numbers: those that are `free` and
    /// have a corner. Collective.
    pub(super) fn new(
        mesh: &Mesh,
        corners: &[Corner],
        free: &[bool],
        numbering: &Numbering,
        of_mesh: &Halo,
    ) -> Self {
        let mut pairs = Vec::with_capacity(12 * mesh.cells().len());
        let used = marks(free.len(), corners.iter().flat_map(|corner| &corner.vertices));
        let is_unknown = |vertex: u32| free[vertex as usize] && used[vertex as usize];
        for (_, vertices) in mesh.cells().iter() {
            for &a in vertices.iter().filter(|&&a| is_unknown(a)) {
                pairs
                    .extend(vertices.iter().filter(|&&b| is_unknown(b) && a != b).map(|&b| (a, b)));
            }
        }
        pairs.sort_unstable();
        pairs.dedup();
        let vertices: Vec<u32> =
            (0u32..).take(free.len()).filter(|&vertex| is_unknown(vertex)).collect();
        let slots = indices(free.len(), &vertices);
        let pairs = pairs.iter().map(|&(a, b): &(u32, u32)| (slots[a as usize], slots[b as usize]));
        let neighbours = Groups::new(vertices.len(), pairs);
        let order = reverse_cuthill_mckee(vertices.len(), |row| neighbours.of(row));
        let new = indices(order.len(), &order);
        let (mut offsets, mut columns) =
            (vec![0], Vec::with_capacity(neighbours.items.len() + order.len()));
        for (row, &old) in (0..).zip(&order) {
            let from = columns.len();
            columns.push(row);
            columns.extend(neighbours.of(old).iter().map(|&slot| new[slot as usize]));
            columns[from..].sort_unstable();
            offsets.push(columns.len());
        }
        let unknowns: Vec<u32> = order.iter().map(|&old| vertices[old as usize]).collect();
        let slots = indices(free.len(), &unknowns);
        let vertices: Vec<u32> = unknowns.iter().map(|&index| numbering.vertex(index)).collect();
        let (halo, cancellation) = (of_mesh.of(&vertices), Cancellation::default());
        Self { unknowns, slots, offsets, columns, halo, cancellation }
    }

    /// How many vertices the mesh has.
    pub(super) fn vertices(&self) -> usize {
        self.slots.len()
    }

    /// The positions of the unknowns.
    pub(super) fn positions(&self, points: &[Vector]) -> Vec<Vector> {
        self.unknowns.iter().map(|&vertex| points[vertex as usize]).collect()
    }

    /// How stiff the cells about each unknown are in the reference; of several ranks the one that
    /// owns a vertex has all of it.
    pub(super) fn stiffnesses(&self, corners: &[Corner]) -> Vec<f64> {
        let mut sums = vec![0.0; self.unknowns.len()];
        for corner in corners {
            for (&vertex, &gradient) in corner.vertices.iter().zip(&corner.gradients) {
                if let Some(sum) = sums.get_mut(self.slots[vertex as usize] as usize) {
                    *sum += dot(gradient, gradient);
                }
            }
        }
        self.halo.sum(1, &mut sums);
        for &entry in self.halo.shared() {
            if !self.halo.owns(entry as usize) {
                sums[entry as usize] = 0.0;
            }
        }
        sums
    }

    /// The energy of the springs.
    fn pulled(&self, points: &[Vector], pull: &Pull) -> f64 {
        let springs = self.unknowns.iter().zip(&pull.positions).zip(&pull.weights);
        let mine = springs.map(|((&vertex, &position), weight)| {
            let off = subtract(points[vertex as usize], position);
            0.5 * weight * dot(off, off)
        });
        self.halo.communicator().reduced(Reduction::Sum, mine.sum())
    }

    /// Goes a step of Newton's method down, over `allowed` shapes alone; `None` where there is
    /// none or it is given up, and `points` are then as they were.
    pub(super) fn step(
        &self,
        energy: &Energy<'_>,
        points: &mut [Vector],
        allowed: &dyn Fn(&[Vector]) -> bool,
    ) -> Option<Step> {
        if self.cancellation.is_cancelled() {
            return None;
        }
        let before = self.energy(energy, points);
        let (direction, slope) = self.direction(energy, points)?;
        let start = self.positions(points);
        let mut length = 1.0;
        for _ in 0..HALVINGS {
            if self.cancellation.is_cancelled() {
                break;
            }
            for ((&vertex, &from), &by) in self.unknowns.iter().zip(&start).zip(&direction) {
                points[vertex as usize] = add(from, scale(by, length));
            }
            let after = self.energy(energy, points);
            // Far enough down (Armijo).
            if after < before && after <= before + 1e-4 * length * slope && allowed(points) {
                return Some(Step { before, after });
            }
            length *= 0.5;
        }
        for (&vertex, &from) in self.unknowns.iter().zip(&start) {
            points[vertex as usize] = from;
        }
        None
    }

    /// Newton's direction, and the slope of the energy along it; `None` where there is none
    /// downwards.
    fn direction(&self, energy: &Energy<'_>, points: &[Vector]) -> Option<(Vec<Vector>, f64)> {
        let ranks = self.halo.communicator();
        let (matrix, right_side) = self.assemble(energy, points);
        let relative = if energy.pull.is_some() { RETURNING_TOLERANCE } else { TOLERANCE };
        let positions = energy.pull.map(|_| self.positions(points));
        let mut direction = vec![[0.0; 3]; self.unknowns.len()];
        let solved = self.solver(matrix, positions).and_then(|solver| {
            solver.solve(&right_side, &mut direction, Tolerance { relative, absolute: 0.0 })
        });
        // The right side is the sum of the ranks', the direction the same on all.
        let slope = -ranks.reduced(Reduction::Sum, inner(&right_side, &direction));
        // Conjugate gradients that were stopped early lead downwards too.
        let solved = matches!(solved, Ok(_) | Err(LinearError::NotConverged { .. }));
        ranks.all(solved && slope < 0.0 && slope.is_finite()).then_some((direction, slope))
    }

    /// A body that is held at few places, or nowhere, bends and turns as a whole: its equations
    /// need aggregates that turn. `positions` are then those of the unknowns.
    fn solver(&self, matrix: SparseMatrix<3>, positions: Option<Vec<Vector>>) -> Solver<3> {
        let cancellation = self.cancellation.clone();
        if self.halo.communicator().size() > 1 {
            return Cancellable(cancellation).vector(Arc::new(matrix), &self.halo, &[]);
        }
        Ok(match positions {
            Some(positions) => {
                let settings = MultigridSettings::default();
                let multigrid = Multigrid::with_rigid_bodies(matrix, positions, settings)?;
                Box::new(multigrid.with_cancellation(cancellation))
            }
            None => {
                let gradients = ConjugateGradients::new(matrix)?.with_max_iterations(ITERATIONS);
                Box::new(gradients.with_cancellation(cancellation))
            }
        })
    }

    fn energy(&self, energy: &Energy<'_>, points: &[Vector]) -> f64 {
        let epsilon = energy.epsilon;
        let of_corners = parallel::map_chunks(energy.corners.len(), CHUNK, |range| {
            energy.corners[range]
                .iter()
                .map(|corner| foldover::energy(&corner.jacobian(points), epsilon))
                .sum::<f64>()
        });
        let mine = of_corners.into_iter().sum();
        self.halo.communicator().reduced(Reduction::Sum, mine)
            + energy.pull.map_or(0.0, |pull| self.pulled(points, pull))
    }

    /// The least determinant.
    pub(super) fn least(&self, corners: &[Corner], points: &[Vector]) -> f64 {
        let least = parallel::map_chunks(corners.len(), CHUNK, |range| {
            let determinants = corners[range]
                .iter()
                .map(|corner| foldover::determinant_of(&corner.jacobian(points)));
            determinants.fold(f64::INFINITY, f64::min)
        });
        let least = least.into_iter().fold(f64::INFINITY, f64::min);
        self.halo.communicator().reduced(Reduction::Minimum, least)
    }

    /// The Hessian, and the energy's gradient with its sign turned.
    fn assemble(&self, energy: &Energy<'_>, points: &[Vector]) -> (SparseMatrix<3>, Vec<Vector>) {
        let epsilon = energy.epsilon;
        let mut matrix = SparseMatrix::<3>::zeros(self.offsets.clone(), self.columns.clone());
        let mut right_side = vec![[0.0; 3]; self.unknowns.len()];
        let (offsets, columns, values) = matrix.offsets_and_values_mut();
        for corners in energy.corners.chunks(CHUNK * PIECES) {
            let locals = parallel::map_chunks(corners.len(), CHUNK, |range| {
                corners[range]
                    .iter()
                    .map(|corner| {
                        foldover::local(&corner.jacobian(points), epsilon, &corner.gradients)
                    })
                    .collect::<Vec<_>>()
            });
            for (corner, local) in corners.iter().zip(locals.iter().flatten()) {
                let slots = corner.vertices.map(|vertex| self.slots[vertex as usize]);
                for (&slot, &gradient) in slots.iter().zip(&local.gradient) {
                    if slot != NONE {
                        right_side[slot as usize] = subtract(right_side[slot as usize], gradient);
                    }
                }
                for ([a, b], block) in foldover::PAIRS.into_iter().zip(&local.blocks) {
                    let (row, column) = (slots[a], slots[b]);
                    if row == NONE || column == NONE {
                        continue;
                    }
                    let mut put = |row: u32, column: u32, transposed: bool| {
                        let (start, end) = (offsets[row as usize], offsets[row as usize + 1]);
                        let entry =
                            start + columns[start..end].partition_point(|&other| other < column);
                        for (p, entries) in values[entry].iter_mut().enumerate() {
                            for (q, entry) in entries.iter_mut().enumerate() {
                                *entry += if transposed { block[q][p] } else { block[p][q] };
                            }
                        }
                    };
                    put(row, column, false);
                    if a != b {
                        put(column, row, true);
                    }
                }
            }
        }
        if let Some(pull) = energy.pull {
            for (row, &vertex) in self.unknowns.iter().enumerate() {
                let weight = pull.weights[row];
                let entry = offsets[row]
                    + columns[offsets[row]..offsets[row + 1]]
                        .partition_point(|&c| (c as usize) < row);
                (0..3).for_each(|axis| values[entry][axis][axis] += weight);
                let off = subtract(pull.positions[row], points[vertex as usize]);
                right_side[row] = add(right_side[row], scale(off, weight));
            }
        }
        (matrix, right_side)
    }
}

fn inner(a: &[Vector], b: &[Vector]) -> f64 {
    a.iter().zip(b).map(|(a, b)| dot(*a, *b)).sum()
}
