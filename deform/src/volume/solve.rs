//! One solve for the displacement of a volume.

use super::Method;
use super::equations::System;
use super::operator::VolumeOperator;
use super::rigid::RigidMotion;
use super::sliding::Constraint;
use crate::communicator::{Communicator, Reduction};
use crate::linear::{Convergence, LinearError, SparseMatrix, Tolerance};
use crate::mesh::Vector;
use crate::number::real;
use crate::vector::{add, subtract};

/// A residual this small against the right side is rounding.
const ROUNDING: f64 = 1e-12;

/// A motion of the boundary whose components are solved for by themselves.
struct Motion<'a> {
    boundary: &'a [Vector],
    /// The displacement of every vertex that the solve starts from.
    start: Option<&'a [Vector]>,
    /// The axes along which any vertex of the boundary moves, on any rank.
    moving: [bool; 3],
    mean: Vector,
}

impl VolumeOperator {
    /// The 2-norm of what the ranks' values of the unknowns add up to.
    fn norms<const B: usize, const K: usize>(&self, values: &[[[f64; B]; K]]) -> [f64; K] {
        if self.domain.communicator().size() == 1 {
            return crate::linear::norms(values);
        }
        let mut values = values.to_vec();
        self.halo.sum(B * K, values.as_flattened_mut().as_flattened_mut());
        for &entry in self.halo.shared() {
            if !self.halo.owns(entry as usize) {
                values[entry as usize] = [[0.0; B]; K];
            }
        }
        let mut squares = crate::linear::norms(&values).map(|norm| norm * norm);
        self.domain.communicator().reduce(Reduction::Sum, &mut squares);
        squares.map(f64::sqrt)
    }

    /// The values of the boundary vertices that this rank owns.
    fn own<T: Copy>(&self, boundary: &[T]) -> Vec<T> {
        self.own_boundary.iter().map(|&index| boundary[index as usize]).collect()
    }

    /// The rigid motion nearest to the boundary's, and that motion less the boundary's.
    pub(super) fn less_rigid(&self, boundary: &[Vector]) -> (RigidMotion, Vec<Vector>) {
        let mut rigid = RigidMotion::nearest(
            &self.own(&self.boundary_points),
            &self.own(boundary),
            self.domain.communicator(),
        );
        if self.settings.method == Method::Harmonic {
            // A rotation is no solution where the boundary is free.
            rigid = rigid.translation();
        }
        let rest = self.boundary_points.iter().zip(boundary).map(|(&point, &value)| {
            let motion = rigid.at(point);
            std::array::from_fn(|axis| motion[axis] - value[axis])
        });
        (rigid, rest.collect())
    }

    /// A rigid motion strains nothing, so the one nearest to the boundary's motion is taken off,
    /// and added again at the end.
    pub(super) fn solve_coupled(
        &self,
        system: &System<3>,
        boundary: &[Vector],
        sliding: &[Vector],
        start: Option<&[Vector]>,
        displacement: &mut [Vector],
    ) -> Result<Convergence, LinearError> {
        if self
            .domain
            .communicator()
            .all(boundary.iter().chain(sliding).all(|value| *value == [0.0; 3]))
        {
            return Ok(Convergence::default());
        }
        let (rigid, rest) = self.less_rigid(boundary);
        let across = |part: &dyn Fn(&Constraint) -> Vector| -> Vec<Vector> {
            self.constraints.iter().map(|constraint| constraint.across(part(constraint))).collect()
        };
        let whole_sliding = across(&|constraint| sliding[constraint.first]);
        let rest_sliding = across(&|constraint| {
            subtract(rigid.at(self.unknown_points[constraint.row]), sliding[constraint.first])
        });
        let whole = self.coupled_right_side(system, boundary, &whole_sliding);
        let [norm] = self.norms::<3, 1>(whole.as_chunks().0);
        let absolute = ROUNDING * norm;
        let right_side = self.coupled_right_side(system, &rest, &rest_sliding);
        let tolerance = Tolerance { relative: self.settings.tolerance, absolute };
        let mut solution = vec![[0.0; 3]; right_side.len()];
        if let Some(start) = start {
            for ((value, &vertex), &point) in
                solution.iter_mut().zip(&self.graph.vertices).zip(&self.unknown_points)
            {
                *value = subtract(start[vertex as usize], rigid.at(point));
            }
            for constraint in &self.constraints {
                solution[constraint.row] = constraint.along(solution[constraint.row]);
            }
        }
        let convergence = system.solver.solve_from(&right_side, &mut solution, tolerance)?;
        for (constraint, &rest) in self.constraints.iter().zip(&rest_sliding) {
            solution[constraint.row] = subtract(constraint.along(solution[constraint.row]), rest);
        }
        for ((&vertex, &point), value) in
            self.graph.vertices.iter().zip(&self.unknown_points).zip(solution)
        {
            let motion = rigid.at(point);
            displacement[vertex as usize] = std::array::from_fn(|axis| motion[axis] + value[axis]);
        }
        Ok(convergence)
    }

    /// The right side for the boundary motion `-rest`, the prescribed motion of sliding vertices
    /// being `-rest_sliding`.
    pub(super) fn coupled_right_side(
        &self,
        system: &System<3>,
        rest: &[Vector],
        rest_sliding: &[Vector],
    ) -> Vec<Vector> {
        let mut right_side = vec![[0.0; 3]; self.graph.vertices.len()];
        system.coupling.multiply(rest, &mut right_side);
        if !self.constraints.is_empty() {
            let mut other = vec![[0.0; 3]; right_side.len()];
            system.sliding.multiply(rest_sliding, &mut other);
            for (value, other) in right_side.iter_mut().zip(other) {
                *value = add(*value, other);
            }
            for constraint in &self.constraints {
                right_side[constraint.row] = constraint.along(right_side[constraint.row]);
            }
        }
        right_side
    }

    /// A solve for each component that moves, its mean taken off first; all three at once where
    /// more than one does.
    pub(super) fn solve_separate(
        &self,
        system: &System<1>,
        boundary: &[Vector],
        start: Option<&[Vector]>,
        displacement: &mut [Vector],
    ) -> Result<Convergence, LinearError> {
        let mut moves: Vector = std::array::from_fn(|axis| {
            f64::from(u8::from(boundary.iter().any(|value| value[axis] != 0.0)))
        });
        self.domain.communicator().reduce(Reduction::Maximum, &mut moves);
        let moving = moves.map(|moves| moves > 0.0);
        let own = self.own(boundary);
        let sum = |axis: usize| own.iter().map(|value| value[axis]).sum::<f64>();
        let mut sums = [sum(0), sum(1), sum(2), real(own.len())];
        self.domain.communicator().reduce(Reduction::Sum, &mut sums);
        let mean: Vector = std::array::from_fn(|axis| sums[axis] / sums[3].max(1.0));
        let motion = Motion { boundary, start, moving, mean };
        let solver = &system.solver;
        let converged = match (0..3).filter(|&axis| moving[axis]).collect::<Vec<_>>()[..] {
            [] => Vec::new(),
            [axis] => {
                let solve = |right_side: &[[[f64; 1]; 1]],
                             solution: &mut [[[f64; 1]; 1]],
                             [tolerance]: [Tolerance; 1]| {
                    let (right_side, solution) =
                        (right_side.as_flattened(), solution.as_flattened_mut());
                    solver
                        .solve_from(right_side, solution, tolerance)
                        .map(|convergence| [convergence])
                };
                self.solve_axes(&system.coupling, [axis], &motion, displacement, solve)?.to_vec()
            }
            _ => {
                let solve = |right_side: &[_], solution: &mut [_], tolerances| {
                    solver.solve_three_from(right_side, solution, tolerances)
                };
                self.solve_axes(&system.coupling, [0, 1, 2], &motion, displacement, solve)?.to_vec()
            }
        };
        Ok(converged.into_iter().fold(Convergence::default(), |worst, column| Convergence {
            iterations: worst.iterations.max(column.iterations),
            residual: worst.residual.max(column.residual),
        }))
    }

    /// Solves for the displacement along some axes side by side, less its mean on the boundary;
    /// those that do not move stay 0.
    fn solve_axes<const K: usize>(
        &self,
        coupling: &SparseMatrix<1>,
        axes: [usize; K],
        &Motion { boundary, start, moving, mean }: &Motion<'_>,
        displacement: &mut [Vector],
        solve: impl FnOnce(
            &[[[f64; 1]; K]],
            &mut [[[f64; 1]; K]],
            [Tolerance; K],
        ) -> Result<[Convergence; K], LinearError>,
    ) -> Result<[Convergence; K], LinearError> {
        let whole: Vec<[[f64; 1]; K]> =
            boundary.iter().map(|value| axes.map(|axis| [value[axis]])).collect();
        let rest: Vec<[[f64; 1]; K]> =
            boundary.iter().map(|value| axes.map(|axis| [mean[axis] - value[axis]])).collect();
        let mut right_side = vec![[[0.0]; K]; self.graph.vertices.len()];
        coupling.multiply_columns(&whole, &mut right_side);
        let tolerances = self
            .norms(&right_side)
            .map(|norm| Tolerance { relative: self.settings.tolerance, absolute: ROUNDING * norm });
        coupling.multiply_columns(&rest, &mut right_side);
        let from = |vertex: u32, axis: usize| match start {
            Some(start) if moving[axis] => start[vertex as usize][axis] - mean[axis],
            _ => 0.0,
        };
        let vertices = self.graph.vertices.iter();
        let mut solution: Vec<[[f64; 1]; K]> =
            vertices.clone().map(|&vertex| axes.map(|axis| [from(vertex, axis)])).collect();
        let convergence = solve(&right_side, &mut solution, tolerances)?;
        for (&vertex, values) in vertices.zip(solution) {
            for (axis, [value]) in axes.into_iter().zip(values).filter(|(axis, _)| moving[*axis]) {
                displacement[vertex as usize][axis] = mean[axis] + value;
            }
        }
        Ok(convergence)
    }
}
