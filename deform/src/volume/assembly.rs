//! From a mesh to the equations of its free vertices.

use std::sync::Arc;

use super::element::{Elements, Scratch};
use super::{VolumeError, agreed};
use crate::communicator::{Communicator, Reduction};
use crate::linear::{Block, SparseMatrix, reverse_cuthill_mckee};
use crate::mesh::cell_geometry::centroid;
use crate::mesh::{Domain, Mesh, Ordered, Vector, is_left_handed};
use crate::number::{index, real};
use crate::parallel;
use crate::topology::{Groups, indices, marks};
use crate::vector::dot;

/// How many cells are worked on at a time.
const CELL_CHUNK: usize = 4096;

/// How many rows are assembled at a time.
const ASSEMBLY_CHUNK: usize = 8192;

/// Which vertex is what: free ones are numbered first, then those of the boundary.
const NONE: u32 = u32::MAX;

/// A bilinear form: what it couples two shape functions with, by their gradients. It is linear in
/// the product of these, so that products are summed over the cells first.
pub(super) trait Form<const B: usize>: Sync {
    /// A sum of products of gradients.
    type Sum: Copy + Default;

    /// Adds the product of the gradient in the row, times the weight, with that in the column.
    fn add(sum: &mut Self::Sum, row: Vector, column: Vector);

    /// The block that a sum of products makes.
    fn block(&self, sum: &Self::Sum) -> Block<B>;
}

/// `∫ grad u · grad v`.
pub(super) struct Laplace;

impl Form<1> for Laplace {
    type Sum = f64;

    #[inline(always)]
    fn add(sum: &mut f64, row: Vector, column: Vector) {
        *sum += dot(row, column);
    }

    #[inline(always)]
    fn block(&self, sum: &f64) -> Block<1> {
        [[*sum]]
    }
}

/// `∫ grad u : grad v`, for the three components of a displacement together.
pub(super) struct VectorLaplace;

impl Form<3> for VectorLaplace {
    type Sum = f64;

    #[inline(always)]
    fn add(sum: &mut f64, row: Vector, column: Vector) {
        *sum += dot(row, column);
    }

    #[inline(always)]
    fn block(&self, sum: &f64) -> Block<3> {
        std::array::from_fn(|p| std::array::from_fn(|q| if p == q { *sum } else { 0.0 }))
    }
}

/// `∫ λ div u div v + 2 μ ε(u) : ε(v)` for Young's modulus 1.
pub(super) struct Elastic {
    lambda: f64,
    mu: f64,
}

impl Elastic {
    pub(super) fn new(poisson_ratio: f64) -> Self {
        Self {
            lambda: poisson_ratio / ((1.0 + poisson_ratio) * (1.0 - 2.0 * poisson_ratio)),
            mu: 0.5 / (1.0 + poisson_ratio),
        }
    }
}

impl Form<3> for Elastic {
    type Sum = [[f64; 3]; 3];

    #[inline(always)]
    fn add(sum: &mut Self::Sum, row: Vector, column: Vector) {
        for (sum, row) in sum.iter_mut().zip(row) {
            for (sum, column) in sum.iter_mut().zip(column) {
                *sum += row * column;
            }
        }
    }

    #[inline(always)]
    fn block(&self, sum: &Self::Sum) -> Block<3> {
        let shared = self.mu * (sum[0][0] + sum[1][1] + sum[2][2]);
        std::array::from_fn(|p| {
            std::array::from_fn(|q| {
                let value = self.lambda * sum[p][q] + self.mu * sum[q][p];
                if p == q { value + shared } else { value }
            })
        })
    }
}

/// The graph of a mesh's free vertices, in the order in which they are solved for.
#[derive(Debug)]
pub(super) struct Graph {
    /// The cells as they are gone through.
    pub(super) ordered: Arc<Ordered>,
    /// The vertex of each unknown.
    pub(super) vertices: Vec<u32>,
    /// For each vertex of the ordered mesh the number of its unknown; for boundary vertices the
    /// number of unknowns and their number on the boundary.
    slots: Vec<u32>,
    /// The other way round: the vertices of the ordered mesh that are solved for, and those of the
    /// boundary.
    slot_vertices: Vec<u32>,
}

/// What the equations of a graph are assembled by.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Pattern {
    /// The volume cells at each vertex of the ordered mesh.
    cells_at: Groups<u32>,
    matrix: (Vec<usize>, Vec<u32>),
    coupling: (Vec<usize>, Vec<u32>),
}

/// The volume cells at each vertex of a mesh.
fn volume_cells_at(mesh: &Mesh) -> Groups<u32> {
    let cells =
        mesh.cells().iter().zip(0u32..).filter(|((cell_type, _), _)| cell_type.dimension() == 3);
    let corners =
        cells.flat_map(|((_, vertices), cell)| vertices.iter().map(move |&vertex| (vertex, cell)));
    Groups::new(mesh.points().len(), corners)
}

impl Graph {
    /// # Errors
    /// [`VolumeError::BoundaryVertex`], [`VolumeError::BoundaryTwice`],
    /// [`VolumeError::Unattached`].
    pub(super) fn new(
        ordered: Arc<Ordered>,
        boundary: &[u32],
        domain: &Domain,
    ) -> Result<(Self, Pattern), VolumeError> {
        let boundary: Vec<u32> =
            agreed(domain.communicator(), boundary_indices(&ordered, boundary))?;
        let mesh = ordered.mesh();
        let vertex_count = mesh.points().len();
        let on_boundary = marks(vertex_count, &boundary);
        let cells_at = volume_cells_at(mesh);
        let is_free =
            |&vertex: &u32| !on_boundary[vertex as usize] && !cells_at.of(vertex).is_empty();
        let free: Vec<u32> = (0..index(vertex_count)).filter(is_free).collect();
        let free_count = index(free.len());
        let slots = indices(vertex_count, &[&free[..], &boundary].concat());
        let (offsets, neighbours) = neighbours(mesh, &cells_at, &free, &slots);
        let row = |index: u32| &neighbours[offsets[index as usize]..offsets[index as usize + 1]];
        let split = |index: u32| {
            let row = row(index);
            row.split_at(row.partition_point(|&slot| slot < free_count))
        };
        let order = reverse_cuthill_mckee(free.len(), |index| split(index).0);

        let new_index = indices(free.len(), &order);
        let parts = parallel::map_chunks(order.len(), ASSEMBLY_CHUNK, |range| {
            let mut inner_rows = (Vec::with_capacity(range.len()), Vec::new());
            let mut outer_rows = (Vec::with_capacity(range.len()), Vec::new());
            for &old in &order[range] {
                let (inner, outer) = split(old);
                let start = inner_rows.1.len();
                inner_rows.1.extend(inner.iter().map(|&slot| new_index[slot as usize]));
                inner_rows.1[start..].sort_unstable();
                inner_rows.0.push(inner.len());
                outer_rows.1.extend(outer.iter().map(|&slot| slot - free_count));
                outer_rows.0.push(outer.len());
            }
            (inner_rows, outer_rows)
        });
        let (inner, outer): (Vec<_>, Vec<_>) = parts.into_iter().unzip();
        let (matrix, coupling) = (compressed(inner), compressed(outer));
        let slot_vertices: Vec<u32> =
            order.iter().map(|&old| free[old as usize]).chain(boundary).collect();
        let slots = indices(vertex_count, &slot_vertices);
        let vertices: Vec<u32> = slot_vertices[..free.len()]
            .iter()
            .map(|&vertex| ordered.numbering().vertex(vertex))
            .collect();
        agreed(
            domain.communicator(),
            check_attached(&vertices, (&matrix.0, &matrix.1), &coupling.0, domain),
        )?;
        let graph = Self { ordered, vertices, slots, slot_vertices };
        Ok((graph, Pattern { cells_at, matrix, coupling }))
    }

    /// The pattern of the equations, as it was when the graph was made.
    pub(super) fn pattern(&self) -> Pattern {
        let mesh = self.ordered.mesh();
        let cells_at = volume_cells_at(mesh);
        let (free, _) = self.slot_vertices.split_at(self.vertices.len());
        let (offsets, slots) = neighbours(mesh, &cells_at, free, &self.slots);
        let free_count = index(free.len());
        let parts = parallel::map_chunks(free.len(), ASSEMBLY_CHUNK, |range| {
            let (mut inner, mut outer) = ((Vec::new(), Vec::new()), (Vec::new(), Vec::new()));
            for row in range {
                let row = &slots[offsets[row]..offsets[row + 1]];
                let (own, other) = row.split_at(row.partition_point(|&slot| slot < free_count));
                inner.0.push(own.len());
                inner.1.extend_from_slice(own);
                outer.0.push(other.len());
                outer.1.extend(other.iter().map(|&slot| slot - free_count));
            }
            (inner, outer)
        });
        let (inner, outer): (Vec<_>, Vec<_>) = parts.into_iter().unzip();
        Pattern { cells_at, matrix: compressed(inner), coupling: compressed(outer) }
    }

    /// The unknown of a vertex that is solved for.
    pub(super) fn unknown(&self, vertex: u32) -> Option<usize> {
        Some(self.slot(vertex) as usize).filter(|&slot| slot < self.vertices.len())
    }

    /// Whether a vertex's displacement is prescribed.
    pub(super) fn is_boundary(&self, vertex: u32) -> bool {
        let slot = self.slot(vertex);
        slot != NONE && slot as usize >= self.vertices.len()
    }

    fn slot(&self, vertex: u32) -> u32 {
        self.ordered.numbering().index(vertex).map_or(NONE, |index| self.slots[index as usize])
    }

    /// How many vertices the mesh has.
    pub(super) fn vertex_count(&self) -> usize {
        self.slots.len()
    }

    /// The matrix of the free vertices, and that which couples them to the boundary. `mesh` is in
    /// the order of the graph, and `stiffness` has a factor for each of its cells.
    pub(super) fn assemble<const B: usize, F: Form<B>>(
        &self,
        pattern: Arc<Pattern>,
        mesh: &Mesh,
        elements: &Elements<'_>,
        form: &F,
        stiffness: &[f64],
    ) -> (SparseMatrix<B>, SparseMatrix<B>) {
        // What nobody else needs becomes the matrices' own.
        let Pattern { cells_at, matrix, coupling } = Arc::unwrap_or_clone(pattern);
        let mut matrix = SparseMatrix::<B>::zeros(matrix.0, matrix.1);
        let mut coupling = SparseMatrix::<B>::zeros(coupling.0, coupling.1);
        let (offsets, columns, values) = matrix.offsets_and_values_mut();
        let (outer_offsets, outer_columns, outer_values) = coupling.offsets_and_values_mut();
        let free_count = self.vertices.len();
        parallel::for_each_rows(
            ASSEMBLY_CHUNK,
            (offsets, values),
            (outer_offsets, outer_values),
            |rows, inner, outer| {
                let mut scratch = Scratch::default();
                // Where in the present row the block of each vertex of the ordered mesh lies.
                let mut column_of = vec![0u32; self.slots.len()];
                let mut sums: Vec<F::Sum> = Vec::new();
                let (first, outer_first) = (offsets[rows.start], outer_offsets[rows.start]);
                for row in rows {
                    let inner_range = offsets[row]..offsets[row + 1];
                    let outer_range = outer_offsets[row]..outer_offsets[row + 1];
                    let inner_columns =
                        columns[inner_range.clone()].iter().map(|&column| column as usize);
                    let outer_columns = outer_columns[outer_range.clone()]
                        .iter()
                        .map(|&column| free_count + column as usize);
                    for (column, slot) in (0..).zip(inner_columns.chain(outer_columns)) {
                        column_of[self.slot_vertices[slot] as usize] = column;
                    }
                    sums.clear();
                    sums.resize(inner_range.len() + outer_range.len(), F::Sum::default());
                    let vertex = self.slot_vertices[row];
                    for &cell in cells_at.of(vertex) {
                        let cell = cell as usize;
                        let vertices = mesh.cells().vertices(cell);
                        let Some(own) = vertices.iter().position(|&other| other == vertex) else {
                            continue;
                        };
                        elements.for_each_point(cell, &mut scratch, |weight, gradients| {
                            let weight = weight * stiffness[cell];
                            let own: Vector = gradients[own].map(|value| value * weight);
                            for (&other, &gradient) in vertices.iter().zip(gradients) {
                                F::add(
                                    &mut sums[column_of[other as usize] as usize],
                                    own,
                                    gradient,
                                );
                            }
                        });
                    }
                    let (own, other) = sums.split_at(inner_range.len());
                    let inner = &mut inner[inner_range.start - first..inner_range.end - first];
                    let outer =
                        &mut outer[outer_range.start - outer_first..outer_range.end - outer_first];
                    for (block, sum) in inner.iter_mut().zip(own).chain(outer.iter_mut().zip(other))
                    {
                        *block = form.block(sum);
                    }
                }
            },
        );
        (matrix, coupling)
    }
}

/// The slots of the vertices that share a cell with each free vertex (itself among them), rising,
/// in compressed rows.
fn neighbours(
    mesh: &Mesh,
    cells_at: &Groups<u32>,
    free: &[u32],
    slots: &[u32],
) -> (Vec<usize>, Vec<u32>) {
    let parts = parallel::map_chunks(free.len(), ASSEMBLY_CHUNK, |range| {
        let mut lengths = Vec::with_capacity(range.len());
        let mut found: Vec<u32> = Vec::new();
        // The last row that has met a slot, counted from 1.
        let mut met = vec![0u32; slots.len()];
        for (row, &vertex) in (1..).zip(&free[range]) {
            let start = found.len();
            for &cell in cells_at.of(vertex) {
                for &other in mesh.cells().vertices(cell as usize) {
                    // A vertex that is neither free nor on the boundary is in no volume cell, so
                    // every slot is one.
                    let slot = slots[other as usize];
                    if std::mem::replace(&mut met[slot as usize], row) != row {
                        found.push(slot);
                    }
                }
            }
            found[start..].sort_unstable();
            lengths.push(found.len() - start);
        }
        (lengths, found)
    });
    compressed(parts)
}

/// One array of rows whose lengths and entries were found part by part.
fn compressed(parts: Vec<(Vec<usize>, Vec<u32>)>) -> (Vec<usize>, Vec<u32>) {
    let mut offsets =
        Vec::with_capacity(1 + parts.iter().map(|(lengths, _)| lengths.len()).sum::<usize>());
    let mut all = Vec::with_capacity(parts.iter().map(|(_, found)| found.len()).sum());
    offsets.push(0);
    let mut end = 0;
    for (lengths, found) in parts {
        for length in lengths {
            end += length;
            offsets.push(end);
        }
        all.extend_from_slice(&found);
    }
    (offsets, all)
}

/// The indices of the boundary vertices, each of which must exist and be named once.
fn boundary_indices(ordered: &Ordered, boundary: &[u32]) -> Result<Vec<u32>, VolumeError> {
    let vertex_count = ordered.mesh().points().len();
    let mut named = vec![false; vertex_count];
    let mut index = |&vertex: &u32| {
        let index = ordered
            .numbering()
            .index(vertex)
            .ok_or(VolumeError::BoundaryVertex { vertex, vertex_count })?;
        if std::mem::replace(&mut named[index as usize], true) {
            return Err(VolumeError::BoundaryTwice { vertex });
        }
        Ok(index)
    };
    boundary.iter().map(&mut index).collect()
}

/// Every free vertex must be connected to the boundary, be it on other ranks. `vertices` are in the
/// order of Cuthill and McKee, reversed: every vertex but the last of its component has a neighbour
/// after it.
fn check_attached(
    vertices: &[u32],
    (offsets, columns): (&[usize], &[u32]),
    outer_offsets: &[usize],
    domain: &Domain,
) -> Result<(), VolumeError> {
    let mut component = vec![0usize; vertices.len()];
    let mut attached: Vec<bool> = Vec::new();
    for row in (0..vertices.len()).rev() {
        component[row] = match columns[offsets[row]..offsets[row + 1]].last() {
            Some(&last) if last as usize > row => component[last as usize],
            _ => {
                attached.push(false);
                attached.len() - 1
            }
        };
        attached[component[row]] |= outer_offsets[row] < outer_offsets[row + 1];
    }
    if domain.communicator().size() > 1 {
        // A component that is attached on one rank is attached on every rank that shares it.
        let halo = domain.halo().of(vertices);
        loop {
            let mut held: Vec<f64> = component
                .iter()
                .map(|&component| f64::from(u8::from(attached[component])))
                .collect();
            halo.sum(1, &mut held);
            let mut news = false;
            for &entry in halo.shared() {
                let attached = &mut attached[component[entry as usize]];
                news |= !*attached && held[entry as usize] > 0.0;
                *attached |= held[entry as usize] > 0.0;
            }
            if !domain.communicator().any(news) {
                break;
            }
        }
    }
    let loose =
        || (0..vertices.len()).filter(|&row| !attached[component[row]]).map(|row| vertices[row]);
    match loose().min() {
        None => Ok(()),
        Some(vertex) => {
            Err(VolumeError::Unattached { vertex: vertex as usize, count: loose().count() })
        }
    }
}

/// The stiffness of each cell, `(mean volume / volume)^stiffening`; 0 for cells that are not of
/// volume. Divided by the size of a mean cell, so that the equations are of order 1 whatever the
/// unit of length. `mesh` has the order of `ordered`.
///
/// # Errors
/// [`VolumeError::InvertedCell`].
pub(super) fn stiffness(
    ordered: &Ordered,
    mesh: &Mesh,
    elements: &Elements<'_>,
    stiffening: f64,
    domain: &Domain,
) -> Result<Vec<f64>, VolumeError> {
    let cells = mesh.cells();
    let mut volumes = vec![0.0; cells.len()];
    parallel::for_each_chunk(&mut volumes, CELL_CHUNK, |chunk, part| {
        let mut scratch = Scratch::default();
        for (index, volume) in part.iter_mut().enumerate() {
            let cell = chunk * CELL_CHUNK + index;
            if cells.cell_type(cell).dimension() == 3 {
                *volume = elements.volume(cell, &mut scratch).unwrap_or(f64::NAN);
            }
        }
    });
    let sums = parallel::map_chunks(volumes.len(), CELL_CHUNK, |range| {
        volumes[range].iter().fold((0.0, 0usize), |(sum, count), &volume| {
            (sum + volume, count + usize::from(volume != 0.0))
        })
    });
    let (sum, count) = sums.into_iter().fold((0.0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    let mut sums = [sum, real(count)];
    domain.communicator().reduce(Reduction::Sum, &mut sums);
    let [sum, count] = sums;
    let mean = sum / count.max(1.0);
    let size = mean.cbrt();
    parallel::for_each_chunk(&mut volumes, CELL_CHUNK, |_, part| {
        for value in part.iter_mut().filter(|value| **value != 0.0) {
            let ratio = mean / *value;
            *value = if stiffening == 1.0 { ratio } else { ratio.powf(stiffening) } / size;
        }
    });
    let inverted = |&cell: &usize| !volumes[cell].is_finite() || volumes[cell] < 0.0;
    if domain.communicator().all(sum.is_finite() && (0..cells.len()).all(|cell| !inverted(&cell))) {
        return Ok(volumes);
    }
    // A NaN sum makes all of them NaN: the cells are looked at again to tell which are to blame.
    let mut scratch = Scratch::default();
    let is_broken = |&cell: &usize| {
        cells.cell_type(cell).dimension() == 3 && elements.volume(cell, &mut scratch).is_none()
    };
    let broken: Vec<usize> = (0..cells.len()).filter(is_broken).collect();
    // With cells of another rank to blame there may be none here.
    let first = broken.iter().copied().min_by_key(|&cell| ordered.cell(cell));
    let Some(cell) = first else { return Err(VolumeError::OtherRank) };
    Err(VolumeError::InvertedCell {
        cell: domain.cell_number(ordered.cell(cell)),
        cell_type: cells.cell_type(cell),
        centroid: centroid(cells, cell, mesh.points()),
        count: broken.len(),
        left_handed: broken
            .iter()
            .filter(|&&cell| is_left_handed(cells, cell, mesh.points()))
            .count(),
    })
}
