//! The parts of a tetrahedral mesh that stay when it moves.

use rayon::prelude::*;
use tombolo_deform::linear::{SparseMatrix, reverse_cuthill_mckee};
use tombolo_deform::mesh::{CellType, Mesh};
use tombolo_deform::topology::Groups;

use crate::SolverError;

/// The tetrahedra of a mesh in the solver's own numbering, and the sparsity of every matrix on
/// them.
///
/// Vertices are numbered anew by reverse Cuthill-McKee (Cuthill and McKee 1969), tetrahedra by
/// their lowest vertex, so that what is near in space is near in memory. On several ranks the
/// vertices that this one owns come first; they alone have rows.
#[derive(Debug)]
pub struct Topology {
    /// The mesh's number of each of the solver's vertices.
    pub vertex_order: Vec<u32>,
    /// The solver's number of each of the mesh's vertices.
    pub vertex_rank: Vec<u32>,
    /// The mesh's cell of each of the solver's elements.
    pub element_order: Vec<u32>,
    /// The vertices of each element, in the solver's numbers.
    pub elements: Vec<[u32; 4]>,
    /// A matrix of zeros with entries where two vertices share an element, in the rows of the
    /// vertices that this rank owns; in those of others the diagonal alone.
    pub zeros: SparseMatrix<1>,
    /// The positions of the entries on the diagonal, in the rows of the vertices that this rank
    /// owns.
    pub diagonal: Vec<usize>,
    /// The rank that owns each vertex, in the solver's numbers.
    owners: Vec<u64>,
    /// This rank.
    rank: u64,
    /// For each vertex, the elements around it.
    pub incidences: Groups<Incidence>,
}

/// An element as seen from one of its vertices.
#[derive(Debug, Clone, Copy, Default)]
pub struct Incidence {
    /// The element.
    pub element: u32,
    /// Which of the element's vertices it is seen from.
    pub local: u8,
    /// For each of the element's vertices, the position of its column within the row, where there
    /// is one.
    pub slots: [u16; 4],
}

impl Topology {
    /// Numbers the tetrahedra of a mesh, or of a rank's part of one; it may have none. Cells of
    /// lower dimension are passed over. `owners` are the ranks that own the vertices.
    ///
    /// # Errors
    /// [`SolverError::CellType`] for a volume cell that is not a tetrahedron.
    pub fn new(mesh: &Mesh, owners: &[u64], rank: usize) -> Result<Self, SolverError> {
        let mut cells: Vec<([u32; 4], u32)> = Vec::new();
        for (cell, (cell_type, vertices)) in mesh.cells().iter().enumerate() {
            match (cell_type, vertices) {
                (CellType::Tetra, &[a, b, c, d]) => cells.push(([a, b, c, d], number(cell))),
                _ if cell_type.dimension() < 3 => {}
                _ => return Err(SolverError::CellType { cell, found: cell_type }),
            }
        }
        let vertex_count = mesh.points().len();
        let (starts, columns) =
            adjacency(vertex_count, vertex_count, cells.iter().map(|(vertices, _)| vertices));
        let around = |vertex: u32| &columns[starts[vertex as usize]..starts[vertex as usize + 1]];
        let order = reverse_cuthill_mckee(vertex_count, around);
        let rank = rank as u64;
        let owns = |vertex: &u32| owners[*vertex as usize] == rank;
        let (mut vertex_order, others): (Vec<u32>, Vec<u32>) = order.into_iter().partition(owns);
        let rows = vertex_order.len();
        vertex_order.extend(others);
        let mut vertex_rank = vec![0u32; vertex_count];
        for (rank, &vertex) in vertex_order.iter().enumerate() {
            vertex_rank[vertex as usize] = number(rank);
        }
        for (vertices, _) in &mut cells {
            *vertices = vertices.map(|vertex| vertex_rank[vertex as usize]);
        }
        cells.sort_by_key(|&(vertices, cell)| (vertices.into_iter().min(), cell));
        let elements: Vec<[u32; 4]> = cells.iter().map(|&(vertices, _)| vertices).collect();
        let (starts, columns) = adjacency(vertex_count, rows, elements.iter());
        let zeros = SparseMatrix::zeros(starts, columns);
        let diagonal = (0..rows).map(|row| {
            let before = zeros.row(row).0.partition_point(|&column| (column as usize) < row);
            zeros.offsets()[row] + before
        });
        let diagonal = diagonal.collect();

        let around = elements.iter().zip(0..).flat_map(|(vertices, element)| {
            let seen_from = move |(local, &vertex): (u8, &u32)| {
                (vertex, Incidence { element, local, ..Incidence::default() })
            };
            (0..).zip(vertices).map(seen_from)
        });
        let mut incidences = Groups::new(vertex_count, around);
        let mut rows = 0..vertex_count;
        let mut crowded = None;
        incidences.for_each_mut(|around| {
            let Some(vertex) = rows.next() else { return };
            let row = zeros.row(vertex).0;
            for incidence in around {
                incidence.slots = elements[incidence.element as usize].map(|column| {
                    let slot = row.partition_point(|&entry| entry < column);
                    u16::try_from(slot).unwrap_or(u16::MAX)
                });
                if incidence.slots.contains(&u16::MAX) {
                    crowded = crowded.or(Some(vertex_order[vertex] as usize));
                }
            }
        });
        if let Some(vertex) = crowded {
            return Err(SolverError::Valence { vertex });
        }
        Ok(Self {
            vertex_rank,
            element_order: cells.iter().map(|&(_, cell)| cell).collect(),
            elements,
            zeros,
            diagonal,
            owners: vertex_order.iter().map(|&vertex| owners[vertex as usize]).collect(),
            rank,
            vertex_order,
            incidences,
        })
    }

    /// How many vertices this rank owns: they are the first.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.diagonal.len()
    }

    /// The entries of a matrix like [`Topology::zeros`], row by row, in the rows of the vertices
    /// that this rank owns.
    #[must_use]
    pub fn own_rows<'a>(&self, matrix: &'a mut SparseMatrix<1>) -> Vec<&'a mut [f64]> {
        let mut entries = matrix.values_mut().as_flattened_mut().as_flattened_mut();
        let mut rows = Vec::with_capacity(self.rows());
        for bounds in self.zeros.offsets()[..=self.rows()].windows(2) {
            let (row, rest) = entries.split_at_mut(bounds[1] - bounds[0]);
            rows.push(row);
            entries = rest;
        }
        rows
    }

    /// Whether a triangle that other ranks may have too is counted here: by the lowest of the ranks
    /// that own its corners, which has all cells around that corner, and so the triangle.
    #[must_use]
    pub fn counts(&self, triangle: &[u32; 3]) -> bool {
        let owner = triangle.iter().filter_map(|&vertex| self.owners.get(vertex as usize)).min();
        owner == Some(&self.rank)
    }

    /// How many vertices there are.
    #[must_use]
    pub fn vertex_count(&self) -> usize {
        self.vertex_order.len()
    }

    /// The elements around a vertex.
    #[must_use]
    pub fn around(&self, vertex: usize) -> &[Incidence] {
        self.incidences.of(number(vertex))
    }

    /// Values given in the mesh's numbering, in the solver's.
    #[must_use]
    pub fn to_solver<T: Copy>(&self, values: &[T]) -> Vec<T> {
        self.vertex_order.iter().map(|&vertex| values[vertex as usize]).collect()
    }

    /// Values given in the solver's numbering, in the mesh's.
    #[must_use]
    pub fn to_mesh<T: Copy>(&self, values: &[T]) -> Vec<T> {
        self.vertex_rank.iter().map(|&rank| values[rank as usize]).collect()
    }
}

#[expect(clippy::cast_possible_truncation, reason = "meshes number vertices and cells in 32 bits")]
fn number(index: usize) -> u32 {
    index as u32
}

/// Which vertices share an element, each with itself, in the first `row_count` rows; in the others
/// each has itself alone. Row starts, and columns.
fn adjacency<'a>(
    vertex_count: usize,
    row_count: usize,
    elements: impl Iterator<Item = &'a [u32; 4]> + Clone,
) -> (Vec<usize>, Vec<u32>) {
    let around = elements.flat_map(|vertices| vertices.map(|row| (row, *vertices)));
    let around = Groups::new(vertex_count, around);
    let rows: Vec<Vec<u32>> = (0..vertex_count)
        .into_par_iter()
        .map(|row| {
            let mut columns = around.of(number(row)).as_flattened().to_vec();
            if row >= row_count {
                columns.clear();
            }
            if columns.is_empty() {
                columns.push(number(row));
            }
            columns.sort_unstable();
            columns.dedup();
            columns
        })
        .collect();
    let mut offsets = Vec::with_capacity(vertex_count + 1);
    offsets.push(0);
    for row in &rows {
        offsets.push(offsets[offsets.len() - 1] + row.len());
    }
    (offsets, rows.concat())
}
