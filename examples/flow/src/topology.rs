//! The parts of a tetrahedral mesh that stay when it moves.

use std::collections::VecDeque;
use std::sync::Arc;

use rayon::prelude::*;
use tombolo_deform::mesh::{CellType, Mesh};

use crate::SolverError;
use crate::linear::Pattern;

/// The tetrahedra of a mesh in the solver's own numbering, and the sparsity of every matrix on them.
///
/// Vertices are numbered anew by reverse Cuthill-McKee (Cuthill and McKee 1969), tetrahedra by their lowest vertex, so that
/// what is near in space is near in memory. On several ranks the vertices that this one owns come first; they alone have rows.
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
    /// Where two vertices share an element, in the rows of the vertices that this rank owns.
    pub pattern: Arc<Pattern>,
    /// Row starts into `incidences`.
    pub incidence_starts: Vec<usize>,
    /// For each vertex, the elements around it.
    pub incidences: Vec<Incidence>,
}

/// An element as seen from one of its vertices.
#[derive(Debug, Clone, Copy)]
pub struct Incidence {
    /// The element.
    pub element: u32,
    /// Which of the element's vertices it is seen from.
    pub local: u8,
    /// For each of the element's vertices, the position of its column within the row, where there is one.
    pub slots: [u16; 4],
}

impl Topology {
    /// Numbers the tetrahedra of a mesh. Cells of lower dimension are passed over.
    ///
    /// # Errors
    /// [`SolverError::CellType`] for a volume cell that is not a tetrahedron, [`SolverError::NoCells`] where there is none.
    pub fn new(mesh: &Mesh) -> Result<Self, SolverError> {
        let topology = Self::of_part(mesh, |_| true)?;
        if topology.elements.is_empty() { Err(SolverError::NoCells) } else { Ok(topology) }
    }

    /// The same of a rank's part of a mesh, of which it owns some vertices; it may be empty.
    ///
    /// # Errors
    /// [`SolverError::CellType`].
    pub fn of_part(mesh: &Mesh, owns: impl Fn(u32) -> bool) -> Result<Self, SolverError> {
        let mut cells: Vec<([u32; 4], u32)> = Vec::new();
        for (cell, (cell_type, vertices)) in mesh.cells().iter().enumerate() {
            match (cell_type, vertices) {
                (CellType::Tetra, &[a, b, c, d]) => cells.push(([a, b, c, d], number(cell))),
                _ if cell_type.dimension() < 3 => {}
                _ => return Err(SolverError::CellType { cell, found: cell_type }),
            }
        }
        let vertex_count = mesh.points().len();
        let natural =
            adjacency(vertex_count, vertex_count, cells.iter().map(|(vertices, _)| vertices));
        let (mut vertex_order, others): (Vec<u32>, Vec<u32>) =
            reverse_cuthill_mckee(&natural).into_iter().partition(|&vertex| owns(vertex));
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
        let pattern = adjacency(vertex_count, rows, elements.iter());

        let mut incidence_starts = vec![0usize; vertex_count + 1];
        for &vertex in elements.iter().flatten() {
            incidence_starts[vertex as usize + 1] += 1;
        }
        for vertex in 0..vertex_count {
            incidence_starts[vertex + 1] += incidence_starts[vertex];
        }
        let mut next = incidence_starts.clone();
        let mut incidences =
            vec![Incidence { element: 0, local: 0, slots: [0; 4] }; elements.len() * 4];
        for (element, vertices) in elements.iter().enumerate() {
            for (local, &vertex) in vertices.iter().enumerate() {
                let row =
                    if (vertex as usize) < rows { pattern.row(vertex as usize) } else { 0..0 };
                let row = &pattern.columns[row];
                let slots = vertices.map(|column| {
                    let slot = row.partition_point(|&entry| entry < column);
                    u16::try_from(slot).unwrap_or(u16::MAX)
                });
                if slots.contains(&u16::MAX) {
                    return Err(SolverError::Valence {
                        vertex: vertex_order[vertex as usize] as usize,
                    });
                }
                incidences[next[vertex as usize]] =
                    Incidence { element: number(element), local: local as u8, slots };
                next[vertex as usize] += 1;
            }
        }
        Ok(Self {
            vertex_order,
            vertex_rank,
            element_order: cells.iter().map(|&(_, cell)| cell).collect(),
            elements,
            pattern: Arc::new(pattern),
            incidence_starts,
            incidences,
        })
    }

    /// How many vertices this rank owns: they are the first.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.pattern.rows()
    }

    /// How many vertices there are.
    #[must_use]
    pub fn vertex_count(&self) -> usize {
        self.vertex_order.len()
    }

    /// The elements around a vertex.
    #[must_use]
    pub fn around(&self, vertex: usize) -> &[Incidence] {
        &self.incidences[self.incidence_starts[vertex]..self.incidence_starts[vertex + 1]]
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

/// Which vertices share an element, each with itself, in the first `row_count` rows.
fn adjacency<'a>(
    vertex_count: usize,
    row_count: usize,
    elements: impl Iterator<Item = &'a [u32; 4]> + Clone,
) -> Pattern {
    let mut starts = vec![0usize; vertex_count + 1];
    for &vertex in elements.clone().flatten() {
        starts[vertex as usize + 1] += 4;
    }
    for vertex in 0..vertex_count {
        starts[vertex + 1] += starts[vertex];
    }
    let mut next = starts.clone();
    let mut all = vec![0u32; starts[vertex_count]];
    for vertices in elements {
        for &row in vertices {
            let slot = next[row as usize];
            all[slot..slot + 4].copy_from_slice(vertices);
            next[row as usize] += 4;
        }
    }
    let rows: Vec<Vec<u32>> = (0..row_count)
        .into_par_iter()
        .map(|row| {
            let mut columns = all[starts[row]..starts[row + 1]].to_vec();
            if columns.is_empty() {
                columns.push(number(row));
            }
            columns.sort_unstable();
            columns.dedup();
            columns
        })
        .collect();
    let mut offsets = Vec::with_capacity(row_count + 1);
    offsets.push(0);
    for row in &rows {
        offsets.push(offsets[offsets.len() - 1] + row.len());
    }
    Pattern { starts: offsets, columns: rows.concat() }
}

fn reverse_cuthill_mckee(pattern: &Pattern) -> Vec<u32> {
    let rows = pattern.rows();
    let degree = |row: u32| pattern.row(row as usize).len();
    let mut visited = vec![false; rows];
    let mut order: Vec<u32> = Vec::with_capacity(rows);
    let mut starts: Vec<u32> = (0..rows).map(number).collect();
    starts.sort_by_key(|&row| (degree(row), row));
    for start in starts {
        if visited[start as usize] {
            continue;
        }
        let root = far_end(pattern, far_end(pattern, start));
        let mut queue = VecDeque::from([root]);
        visited[root as usize] = true;
        while let Some(row) = queue.pop_front() {
            order.push(row);
            let mut next: Vec<u32> = pattern.columns[pattern.row(row as usize)]
                .iter()
                .copied()
                .filter(|&c| !visited[c as usize])
                .collect();
            next.sort_by_key(|&column| (degree(column), column));
            for column in next {
                visited[column as usize] = true;
                queue.push_back(column);
            }
        }
    }
    order.reverse();
    order
}

/// The last vertex that a breadth-first walk from `start` reaches.
fn far_end(pattern: &Pattern, start: u32) -> u32 {
    let mut visited = std::collections::HashSet::from([start]);
    let mut queue = VecDeque::from([start]);
    let mut last = start;
    while let Some(row) = queue.pop_front() {
        last = row;
        for &column in &pattern.columns[pattern.row(row as usize)] {
            if visited.insert(column) {
                queue.push_back(column);
            }
        }
    }
    last
}
