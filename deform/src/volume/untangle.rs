//! Moving the inside of a mesh so that no cell is turned inside out.

use std::sync::{Arc, OnceLock};

use super::{Improver, foldover};
use crate::linear::{
    ConjugateGradients, DistributedMultigrid, LinearError, Multigrid, MultigridSettings,
    SparseMatrix, Tolerance, reverse_cuthill_mckee,
};
use crate::mesh::{CellType, Mesh, Numbering, Ordered, Vector};
use crate::parallel;
use crate::partition::{Partition, Reduction, Shares, Solver, all, any, whole};
use crate::quality::{
    HEXAHEDRON_CORNERS, PYRAMID_CORNERS, VOXEL_AS_HEXAHEDRON, WEDGE_CORNERS, quality_in_parts,
    tet_determinant,
};
use crate::vector::{add, cross, dot, scale, subtract};

/// How many corners are worked on at a time, and how many such pieces are kept before they are added up.
const CHUNK: usize = 1024;
const PIECES: usize = 16;

/// Newton steps at most.
const STEPS: usize = 60;

/// A mesh is settled once a Newton step takes less than this part of the energy off.
const SETTLED: f64 = 1e-3;

/// The least regularisation of a mesh with inverted corners, and what it is raised to where the mesh settles with some: this many
/// steps in a row make it settled, so often it is raised, and by this factor it falls again from step to step.
const LEAST_EPSILON: f64 = 1e-6;
const RAISED_EPSILON: f64 = 0.1;
const SETTLED_STEPS: usize = 3;
const RAISES: usize = 2;
const FALLING: f64 = 0.3;

/// Newton steps in which a shape goes back to another at most; how stiff the springs to that are at first and at last, by the stiffness
/// of the cells, and by how much they become stiffer where the shape has settled.
const RETURNING_STEPS: usize = 300;
const FIRST_PULL: f64 = 1e-5;
const LAST_PULL: f64 = 1e3;
const STIFFER_PULL: f64 = 10.0;

/// A shape on its way back is settled once a Newton step takes less than this part of what energy it has more than at rest.
const SETTLED_PULL: f64 = 0.01;

/// Iterations of the linear solver in a Newton step: a direction that is not exact is good enough.
const ITERATIONS: usize = 400;

/// What a Newton step leaves of the right side: a body on its way back bends as a whole, which is little of it.
const TOLERANCE: f64 = 1e-2;
const RETURNING_TOLERANCE: f64 = 1e-4;

/// Rounds of sweeps that lift the quality of a valid mesh to the floor, and the sweeps in each.
const ROUNDS: usize = 10;
const SWEEPS: u32 = 10;

/// Cells of a valid mesh that is below the floor are lifted to this times the quality that they have in the reference.
const LIFTED: f64 = 1.5;

const NONE: u32 = u32::MAX;

/// Moves the free vertices of one mesh so that no cell is turned inside out, and cells are as much like those of the reference
/// mesh as the boundary allows.
///
/// With `J` the gradient of the map from the reference at each corner of each cell (tetrahedra are their own), it minimises the
/// sum of `½ tr(JᵀJ) / χ^⅔ + ½ (1 + det²J) / χ`, the foldover-free energy of V. Garanzha, I. Kaporin, L. Kudryavtseva,
/// F. Protais, N. Ray and D. Sokolov (2021), by Newton's method: `χ = ½ (det J + √(ε² + det²J))` makes it finite for cells
/// that are inside out, and ε is brought down as they turn. Hessians are projected to positive definite ones corner by corner in
/// closed form (B. Smith, F. de Goes, T. Kim 2019), so that the linear systems suit [`ConjugateGradients`]; the line search
/// makes the energy fall in every step. All corners weigh the same, so that thin layers keep their shape.
///
/// Cells of types that are neither tetrahedra, hexahedra, voxels, wedges nor pyramids are passed over.
///
/// # Guarantees
/// - Vertices that are not free do not move.
/// - The same bits whatever the number of threads.
///
/// It does *not* guarantee to find a mesh that is valid, even where there is one.
#[derive(Debug)]
pub struct Untangler {
    /// That of the ordered mesh, whose numbers all vertices here have.
    numbering: Numbering,
    corners: Vec<Corner>,
    /// The vertex of each unknown.
    unknowns: Vec<u32>,
    /// The unknown of each vertex.
    slots: Vec<u32>,
    offsets: Vec<usize>,
    columns: Vec<u32>,
    partition: Arc<dyn Partition>,
    shares: Shares,
    boundary: Vec<u32>,
    /// The least scaled Jacobian of the reference mesh.
    least: f64,
    improver: OnceLock<Improver>,
}

/// A tetrahedron at a corner of a cell.
#[derive(Debug, Clone, Copy)]
pub(super) struct Corner {
    pub(super) vertices: [u32; 4],
    pub(super) cell: u32,
    /// The gradients of its linear shape functions in the reference.
    gradients: [Vector; 4],
}

/// What draws each unknown to a place, as a spring does: the energy `½ weight |x - place|²`.
struct Pull {
    places: Vec<Vector>,
    weights: Vec<f64>,
}

/// What is known of a shape.
#[derive(Debug, Clone, Copy, Default)]
struct State {
    energy: f64,
    /// The least determinant.
    least: f64,
}

impl Untangler {
    /// An untangler of the cells of the reference mesh `mesh`; the vertices of `boundary` are not free.
    #[must_use]
    pub fn new(mesh: &Mesh, boundary: &[u32]) -> Self {
        Self::of_part(mesh, boundary, &whole())
    }

    /// The same where `mesh` is the part of this rank, whose cells no other rank has, and `boundary` its vertices on the boundary
    /// of the whole mesh. Collective, as is its use.
    #[must_use]
    pub fn of_part(mesh: &Mesh, boundary: &[u32], partition: &Arc<dyn Partition>) -> Self {
        let (near, numbering) = Ordered::new(mesh).into_parts();
        let corners = corners(&near);
        let mut free = vec![true; mesh.points().len()];
        boundary
            .iter()
            .filter_map(|&vertex| numbering.place(vertex))
            .for_each(|place| free[place as usize] = false);
        let mut pairs = Vec::with_capacity(12 * corners.len());
        let mut used = vec![false; free.len()];
        for corner in &corners {
            for &a in &corner.vertices {
                used[a as usize] = true;
                if free[a as usize] {
                    pairs.extend(
                        corner
                            .vertices
                            .iter()
                            .filter(|&&b| free[b as usize] && a != b)
                            .map(|&b| (a, b)),
                    );
                }
            }
        }
        pairs.sort_unstable();
        pairs.dedup();
        let vertices: Vec<u32> = (0..)
            .zip(free.iter().zip(&used))
            .filter(|(_, (free, used))| **free && **used)
            .map(|(v, _)| v)
            .collect();
        let mut slots = vec![NONE; free.len()];
        for (slot, &vertex) in (0..).zip(&vertices) {
            slots[vertex as usize] = slot;
        }
        let mut starts = Vec::with_capacity(vertices.len() + 1);
        let mut place = 0;
        for &vertex in &vertices {
            starts.push(place);
            while pairs.get(place).is_some_and(|pair| pair.0 == vertex) {
                place += 1;
            }
        }
        starts.push(place);
        let neighbours: Vec<u32> = pairs.iter().map(|pair| slots[pair.1 as usize]).collect();
        drop(pairs);
        let order = reverse_cuthill_mckee(vertices.len(), |row| {
            &neighbours[starts[row as usize]..starts[row as usize + 1]]
        });
        let mut new = vec![0u32; order.len()];
        for (place, &old) in (0..).zip(&order) {
            new[old as usize] = place;
        }
        let (mut offsets, mut columns) =
            (vec![0], Vec::with_capacity(neighbours.len() + order.len()));
        for (row, &old) in (0..).zip(&order) {
            let from = columns.len();
            columns.push(row);
            columns.extend(
                neighbours[starts[old as usize]..starts[old as usize + 1]]
                    .iter()
                    .map(|&slot| new[slot as usize]),
            );
            columns[from..].sort_unstable();
            offsets.push(columns.len());
        }
        let unknowns: Vec<u32> = order.iter().map(|&old| vertices[old as usize]).collect();
        for (slot, &vertex) in (0..).zip(&unknowns) {
            slots[vertex as usize] = slot;
        }
        let vertices: Vec<u32> = unknowns.iter().map(|&place| numbering.vertex(place)).collect();
        let shares = Shares::new(&**partition, &vertices);
        let least = quality_in_parts(mesh.cells(), mesh.points(), &**partition).min;
        Self {
            numbering,
            corners,
            unknowns,
            slots,
            offsets,
            columns,
            partition: Arc::clone(partition),
            shares,
            boundary: boundary.to_vec(),
            least,
            improver: OnceLock::new(),
        }
    }

    /// Moves the free vertices of `points` until every corner's determinant is positive, and on until the energy has settled; where
    /// a scaled Jacobian is then below `floor`, the worst cells are lifted (see [`Improver`]). Says whether all cells are valid and
    /// none is below `floor`, or below the least of the reference mesh where that is lower.
    ///
    /// `mesh` is the reference mesh.
    pub fn untangle(&self, mesh: &Mesh, points: &mut [Vector], floor: f64) -> bool {
        let partition = &*self.partition;
        if all(partition, self.unknowns.is_empty())
            || any(partition, points.len() != self.slots.len())
        {
            return false;
        }
        let mut near = self.numbering.gather(points).into_owned();
        self.lower(&mut near);
        self.numbering.scatter(&near, points);
        let floor = floor.min(self.least);
        let mut quality = quality_in_parts(mesh.cells(), points, partition);
        for _ in 0..ROUNDS {
            let improver =
                || Improver::of_part(mesh, &self.boundary, &self.partition).lifting_to(LIFTED);
            if quality.inverted > 0
                || quality.min >= floor
                || !self.improver.get_or_init(improver).improve(points, SWEEPS)
            {
                break;
            }
            quality = quality_in_parts(mesh.cells(), points, partition);
        }
        quality.inverted == 0 && quality.min >= floor
    }

    /// Brings the energy down until it settles.
    fn lower(&self, points: &mut [Vector]) {
        let (mut epsilon, mut lower_bound) = (1.0, LEAST_EPSILON);
        let (mut settled, mut raises) = (0, 0);
        let mut direction = vec![[0.0; 3]; self.unknowns.len()];
        for step in 0..STEPS {
            let least = self.state(points, 1.0).least;
            // As Garanzha et al.: the regularisation follows the worst determinant; a valid mesh has none.
            epsilon = if least > 0.0 {
                (0.01 * least).min(epsilon)
            } else {
                lower_bound.hypot(0.2 * least)
            };
            lower_bound = LEAST_EPSILON.max(FALLING * lower_bound);
            let before = self.state(points, epsilon).energy;
            let Some(slope) = self.direction(points, epsilon, None, &mut direction) else { break };
            let energy = |points: &[Vector]| self.state(points, epsilon).energy;
            let after = self.descend(points, &direction, &energy, before, slope);
            let falls = after.is_some_and(|after| before - after >= SETTLED * before.abs());
            settled = if falls { 0 } else { settled + 1 };
            if settled > 0 && least > 0.0 && (step > 2 || after.is_none()) {
                break;
            }
            if settled >= SETTLED_STEPS || after.is_none() {
                if raises == RAISES {
                    break;
                }
                raises += 1;
                (settled, lower_bound) = (0, RAISED_EPSILON);
            }
        }
    }

    /// Takes a valid shape back towards the one that `towards` makes of it: the cells are drawn to those of the reference, and every
    /// vertex that is free to its place in the other shape, the more the longer it takes. Each step is one that `goes` from a
    /// shape to the next; it ends where `arrives` says so, and says whether it did.
    ///
    /// A body that is let go springs back: this is how a way is found between shapes whose boundaries a straight one breaks.
    pub(super) fn take_back(
        &self,
        points: &[Vector],
        towards: &dyn Fn(&[Vector]) -> Vec<Vector>,
        goes: &dyn Fn(&[Vector], &[Vector]) -> bool,
        arrives: &mut dyn FnMut(&[Vector]) -> bool,
    ) -> bool {
        let partition = &*self.partition;
        if all(partition, self.unknowns.is_empty())
            || any(partition, points.len() != self.slots.len())
        {
            return false;
        }
        let mut points = points.to_vec();
        let mut near = self.numbering.gather(&points).into_owned();
        #[expect(clippy::cast_precision_loss, reason = "fewer cells than 2^53")]
        let rest = foldover::REST * sum(partition, self.corners.len() as f64);
        let stiffnesses = self.stiffnesses();
        let mut stiffness = FIRST_PULL;
        let mut direction = vec![[0.0; 3]; self.unknowns.len()];
        for _ in 0..RETURNING_STEPS {
            let towards = towards(&points);
            let towards = self.numbering.gather(&towards);
            let pull = Pull {
                places: self.unknowns.iter().map(|&vertex| towards[vertex as usize]).collect(),
                weights: stiffnesses.iter().map(|value| stiffness * value).collect(),
            };
            let epsilon = 0.01 * self.state(&near, 1.0).least.max(0.0);
            let valid = |next: &[Vector]| {
                let mut moved = points.clone();
                self.numbering.scatter(next, &mut moved);
                goes(&points, &moved)
            };
            let energy =
                |points: &[Vector]| self.state(points, epsilon).energy + self.pulled(points, &pull);
            let before = energy(&near);
            let after =
                self.direction(&near, epsilon, Some(&pull), &mut direction).and_then(|slope| {
                    // Where the way to a shape would be broken, that is no shape to go to.
                    let energy = |next: &[Vector]| {
                        let energy = energy(next);
                        if all(partition, energy < before) && valid(next) {
                            energy
                        } else {
                            f64::INFINITY
                        }
                    };
                    self.descend(&mut near, &direction, &energy, before, slope)
                });
            if after.is_some() {
                self.numbering.scatter(&near, &mut points);
                if arrives(&points) {
                    return true;
                }
            }
            if after.is_none_or(|after| before - after < SETTLED_PULL * (before - rest)) {
                stiffness *= STIFFER_PULL;
                if stiffness > LAST_PULL {
                    return false;
                }
            }
        }
        false
    }

    /// How stiff the cells about each unknown are in the reference; of several ranks the one that owns a vertex has all of it.
    fn stiffnesses(&self) -> Vec<f64> {
        let mut sums = vec![0.0; self.unknowns.len()];
        for corner in &self.corners {
            for (&vertex, &gradient) in corner.vertices.iter().zip(&corner.gradients) {
                if let Some(sum) = sums.get_mut(self.slots[vertex as usize] as usize) {
                    *sum += dot(gradient, gradient);
                }
            }
        }
        self.shares.sum(&*self.partition, 1, &mut sums);
        for &place in self.shares.places() {
            if !self.shares.owns(place as usize) {
                sums[place as usize] = 0.0;
            }
        }
        sums
    }

    /// The energy of the springs.
    fn pulled(&self, points: &[Vector], pull: &Pull) -> f64 {
        let springs = self.unknowns.iter().zip(&pull.places).zip(&pull.weights);
        let mine = springs.map(|((&vertex, &place), weight)| {
            let off = subtract(points[vertex as usize], place);
            0.5 * weight * dot(off, off)
        });
        sum(&*self.partition, mine.sum())
    }

    /// Newton's direction, and the slope of the energy along it; `None` where there is none downwards.
    fn direction(
        &self,
        points: &[Vector],
        epsilon: f64,
        pull: Option<&Pull>,
        direction: &mut [Vector],
    ) -> Option<f64> {
        let partition = &*self.partition;
        let (mut matrix, mut right_side) = self.assemble(points, epsilon);
        if let Some(pull) = pull {
            let (offsets, columns, values) = matrix.offsets_and_values_mut();
            for (row, &vertex) in self.unknowns.iter().enumerate() {
                let weight = pull.weights[row];
                let place = offsets[row]
                    + columns[offsets[row]..offsets[row + 1]]
                        .partition_point(|&c| (c as usize) < row);
                (0..3).for_each(|axis| values[place][axis][axis] += weight);
                let off = subtract(pull.places[row], points[vertex as usize]);
                right_side[row] = add(right_side[row], scale(off, weight));
            }
        }
        let relative = if pull.is_some() { RETURNING_TOLERANCE } else { TOLERANCE };
        let places =
            pull.map(|_| self.unknowns.iter().map(|&vertex| points[vertex as usize]).collect());
        let solved = self.solver(matrix, places).and_then(|solver| {
            solver.solve(&right_side, direction, Tolerance { relative, absolute: 0.0 })
        });
        // The right side is the sum of the ranks', the direction the same on all.
        let slope = -sum(partition, inner(&right_side, direction));
        // Conjugate gradients that were stopped early lead downwards too.
        let solved = matches!(solved, Ok(_) | Err(LinearError::NotConverged { .. }));
        all(partition, solved && slope < 0.0 && slope.is_finite()).then_some(slope)
    }

    /// A body that is held at few places, or nowhere, bends and turns as a whole: its equations need aggregates that turn. `places` are
    /// then those of the unknowns.
    fn solver(&self, matrix: SparseMatrix<3>, places: Option<Vec<Vector>>) -> Solver<3> {
        if self.partition.ranks() == 1 {
            return match places {
                Some(places) => Ok(Box::new(Multigrid::with_rigid_bodies(
                    matrix,
                    places,
                    MultigridSettings::default(),
                )?)),
                None => {
                    Ok(Box::new(ConjugateGradients::new(matrix)?.with_max_iterations(ITERATIONS)))
                }
            };
        }
        let shares = self.shares.clone();
        Ok(Box::new(DistributedMultigrid::with_shares(
            Arc::clone(&self.partition),
            shares,
            Arc::new(matrix),
            None,
        )?))
    }

    /// Goes along `direction` as far as the energy falls enough (Armijo); the energy there.
    fn descend(
        &self,
        points: &mut [Vector],
        direction: &[Vector],
        energy: &dyn Fn(&[Vector]) -> f64,
        before: f64,
        slope: f64,
    ) -> Option<f64> {
        let start: Vec<Vector> =
            self.unknowns.iter().map(|&vertex| points[vertex as usize]).collect();
        let mut length = 1.0;
        for _ in 0..30 {
            for ((&vertex, &from), &by) in self.unknowns.iter().zip(&start).zip(direction) {
                points[vertex as usize] = add(from, scale(by, length));
            }
            let after = energy(points);
            if after <= before + 1e-4 * length * slope {
                return Some(after);
            }
            length *= 0.5;
        }
        for (&vertex, &from) in self.unknowns.iter().zip(&start) {
            points[vertex as usize] = from;
        }
        None
    }

    fn state(&self, points: &[Vector], epsilon: f64) -> State {
        let mut state = parallel::map_chunks(self.corners.len(), CHUNK, |range| {
            let mut state = State { energy: 0.0, least: f64::INFINITY };
            for corner in &self.corners[range] {
                let j = corner.jacobian(points);
                state.energy += foldover::energy(&j, epsilon);
                state.least = state.least.min(foldover::determinant_of(&j));
            }
            state
        })
        .into_iter()
        .fold(State { energy: 0.0, least: f64::INFINITY }, |sum, part| State {
            energy: sum.energy + part.energy,
            least: sum.least.min(part.least),
        });
        state.energy = sum(&*self.partition, state.energy);
        let mut least = [state.least];
        self.partition.reduce(Reduction::Minimum, &mut least);
        state.least = least[0];
        state
    }

    /// The Hessian, and the energy's gradient with its sign turned.
    fn assemble(&self, points: &[Vector], epsilon: f64) -> (SparseMatrix<3>, Vec<Vector>) {
        let mut matrix = SparseMatrix::<3>::zeros(self.offsets.clone(), self.columns.clone());
        let mut right_side = vec![[0.0; 3]; self.unknowns.len()];
        let (offsets, columns, values) = matrix.offsets_and_values_mut();
        for corners in self.corners.chunks(CHUNK * PIECES) {
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
                        let place =
                            start + columns[start..end].partition_point(|&other| other < column);
                        for (p, entries) in values[place].iter_mut().enumerate() {
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
        (matrix, right_side)
    }
}

impl Corner {
    #[inline]
    fn jacobian(&self, points: &[Vector]) -> [Vector; 3] {
        foldover::jacobian(self.vertices.map(|vertex| points[vertex as usize]), &self.gradients)
    }
}

fn sum(partition: &dyn Partition, mine: f64) -> f64 {
    let mut sum = [mine];
    partition.reduce(Reduction::Sum, &mut sum);
    sum[0]
}

fn inner(a: &[Vector], b: &[Vector]) -> f64 {
    a.iter().zip(b).map(|(a, b)| dot(*a, *b)).sum()
}

/// The corners of the cells, each right-handed in a valid mesh; those flat in the reference are left out.
pub(super) fn corners(mesh: &Mesh) -> Vec<Corner> {
    let (cells, points) = (mesh.cells(), mesh.points());
    let mut corners = Vec::with_capacity(cells.len());
    let mut take = |cell: usize, vertices: [u32; 4]| {
        let [p, q, r, s] = vertices.map(|vertex| points[vertex as usize]);
        let (u, v, w) = (subtract(q, p), subtract(r, p), subtract(s, p));
        let determinant = tet_determinant([p, q, r, s]);
        if determinant > 0.0 {
            let [g, h, k] =
                [cross(v, w), cross(w, u), cross(u, v)].map(|face| scale(face, 1.0 / determinant));
            #[expect(clippy::cast_possible_truncation, reason = "fewer cells than 2^32")]
            corners.push(Corner {
                vertices,
                cell: cell as u32,
                gradients: [scale(add(add(g, h), k), -1.0), g, h, k],
            });
        }
    };
    for (cell, (cell_type, vertices)) in cells.iter().enumerate() {
        let mut take_all = |locals: &[[usize; 4]]| {
            for local in locals {
                take(cell, local.map(|index| vertices[index]));
            }
        };
        match cell_type {
            CellType::Tetra => take_all(&[[0, 1, 2, 3]]),
            CellType::Hexahedron => take_all(&HEXAHEDRON_CORNERS),
            CellType::Voxel => {
                take_all(
                    &HEXAHEDRON_CORNERS
                        .map(|corner| corner.map(|local| VOXEL_AS_HEXAHEDRON[local])),
                );
            }
            CellType::Wedge => take_all(&WEDGE_CORNERS),
            CellType::Pyramid => take_all(&PYRAMID_CORNERS),
            _ => {}
        }
    }
    corners
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quality::quality;
    use crate::shapes;

    fn boundary(mesh: &Mesh) -> Vec<u32> {
        let on = |p: &Vector| p.iter().any(|&x| x == 0.0 || x == 1.0);
        (0..).zip(mesh.points()).filter(|(_, p)| on(p)).map(|(vertex, _)| vertex).collect()
    }

    /// The inside of a cube thrown about by far more than the size of a cell.
    fn thrown(mesh: &Mesh, boundary: &[u32]) -> Vec<Vector> {
        let mut points = mesh.points().to_vec();
        for (vertex, point) in points.iter_mut().enumerate() {
            if !boundary.contains(&(vertex as u32)) {
                let wave = |phase: f64| 0.3 * (12.9898 * vertex as f64 + phase).sin();
                *point = [point[0] + wave(0.0), point[1] + wave(2.0), point[2] + wave(4.0)];
            }
        }
        points
    }

    /// With the boundary where it was, the reference is the one minimum.
    #[test]
    fn a_thrown_inside_comes_back() {
        for mesh in [
            shapes::box_of_tets([5, 6, 4], [0.0; 3], [1.0; 3]),
            shapes::box_of_hexahedra([5, 6, 4], [0.0; 3], [1.0; 3]),
        ] {
            let boundary = boundary(&mesh);
            let mut points = thrown(&mesh, &boundary);
            assert!(quality(mesh.cells(), &points).inverted > 50);
            assert!(Untangler::new(&mesh, &boundary).untangle(&mesh, &mut points, 0.0));
            for (vertex, (point, reference)) in points.iter().zip(mesh.points()).enumerate() {
                let off = subtract(*point, *reference);
                assert!(dot(off, off).sqrt() < 0.02, "vertex {vertex}: {off:?}");
                if boundary.contains(&(vertex as u32)) {
                    assert_eq!(point, reference);
                }
            }
        }
    }

    /// What the reference has of poor cells is not what untangling is to mend.
    #[test]
    fn slivers_of_the_reference_are_no_failure() {
        let whole = shapes::box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]);
        let boundary = boundary(&whole);
        let mut points = whole.points().to_vec();
        let middle = points.iter().position(|point| *point == [0.5; 3]).unwrap();
        // Almost in the plane of one of its cells' faces.
        points[middle] = [0.5, 0.5, 0.7495];
        let mesh = whole.with_points(points).unwrap();
        let least = quality(mesh.cells(), mesh.points()).min;
        assert!(least > 0.0 && least < 0.01, "{least}");
        let mut points = thrown(&mesh, &boundary);
        assert!(quality(mesh.cells(), &points).inverted > 20);
        assert!(Untangler::new(&mesh, &boundary).untangle(&mesh, &mut points, 0.02));
    }

    #[test]
    fn what_cannot_be_untangled_is_said() {
        let mesh = shapes::box_of_tets([3, 3, 3], [0.0; 3], [1.0; 3]);
        let boundary = boundary(&mesh);
        let untangler = Untangler::new(&mesh, &boundary);
        let mut mirrored: Vec<Vector> = mesh.points().iter().map(|&[x, y, z]| [x, y, -z]).collect();
        assert!(!untangler.untangle(&mesh, &mut mirrored, 0.0));
        assert!(!untangler.untangle(&mesh, &mut mesh.points()[1..].to_vec(), 0.0));
        let all: Vec<u32> = (0..mesh.points().len() as u32).collect();
        assert!(
            !Untangler::new(&mesh, &all).untangle(&mesh, &mut mesh.points().to_vec(), 0.0),
            "nothing is free"
        );
    }

    #[cfg(feature = "parallel")]
    #[test]
    fn the_same_bits_whatever_the_number_of_threads() {
        let mesh = shapes::box_of_tets([8, 8, 8], [0.0; 3], [1.0; 3]);
        let boundary = boundary(&mesh);
        let untangler = Untangler::new(&mesh, &boundary);
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut points = thrown(&mesh, &boundary);
            let done = pool.install(|| untangler.untangle(&mesh, &mut points, 0.0));
            assert_ne!(points, thrown(&mesh, &boundary), "the inside has moved");
            (points, done)
        };
        let one = run(1);
        assert_eq!(one, run(2));
        assert_eq!(one, run(3));
    }
}
