//! Finding equal faces among many: the boundary of a mesh, and the boundary faces that carry a tag.

use std::collections::HashMap;

use super::{SurfaceError, tetra_faces};
use crate::mesh::{CellType, Cells};

/// A boundary face: its cell and its place among the faces of that cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct CellFace {
    pub cell: u32,
    pub face: u32,
}

/// Faces of cells of this dimension that belong to one cell only, in the order of the cells and of the faces in a cell. Cells
/// marked in `left_out` are none.
///
/// A face of a collapsed cell (one that names a vertex twice) counts with its distinct vertices, and not at all where fewer than
/// three are left.
pub(super) fn boundary_faces(
    cells: &Cells,
    vertex_count: usize,
    dimension: usize,
    left_out: Option<&[bool]>,
) -> Result<Vec<CellFace>, SurfaceError> {
    let of_tetrahedra = || tetra_faces::boundary_faces(cells, vertex_count, left_out);
    match (dimension == 3).then(of_tetrahedra).flatten() {
        Some(found) => Ok(found),
        None => boundary_faces_of_any(cells, vertex_count, dimension, left_out),
    }
}

/// The same for cells of any type, and with what is wrong.
pub(super) fn boundary_faces_of_any(
    cells: &Cells,
    vertex_count: usize,
    dimension: usize,
    left_out: Option<&[bool]>,
) -> Result<Vec<CellFace>, SurfaceError> {
    let counts = |cell: &usize| {
        !left_out.is_some_and(|left_out| left_out.get(*cell).is_some_and(|&out| out))
    };
    let mut starts = vec![0usize; vertex_count + 1];
    let mut buffer = FaceBuffer::default();
    let mut any_large = false;
    for cell in (0..cells.len()).filter(counts) {
        buffer.for_each(cells, cell, dimension, |_, face| {
            any_large |= face.len() > 4;
            starts[face.iter().copied().min().unwrap_or(0) as usize + 1] += 1;
        });
    }
    for vertex in 0..vertex_count {
        starts[vertex + 1] += starts[vertex];
    }
    // Faces are dealt into a bucket for each lowest vertex, so that all of it is linear in time and local in memory.
    let mut entries = vec![Entry::default(); starts[vertex_count]];
    let mut next = starts.clone();
    for cell in (0..cells.len()).filter(counts) {
        buffer.for_each(cells, cell, dimension, |face, vertices| {
            let key = key(vertices);
            let slot = &mut next[key[0] as usize];
            entries[*slot] =
                Entry { second: key[1], third: key[2], fourth: key[3], cell: cell as u32, face };
            *slot += 1;
        });
    }

    let mut boundary = Vec::new();
    for vertex in 0..vertex_count {
        let bucket = &mut entries[starts[vertex]..starts[vertex + 1]];
        bucket.sort_unstable();
        for group in bucket.chunk_by(Entry::same_lowest_four) {
            if any_large && group.len() > 1 {
                for same in split_by_all_vertices(cells, dimension, group) {
                    match_faces(cells, dimension, &same, &mut boundary)?;
                }
            } else {
                match_faces(cells, dimension, group, &mut boundary)?;
            }
        }
    }
    boundary.sort_unstable();
    Ok(boundary)
}

/// One face under its lowest vertex.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
struct Entry {
    second: u32,
    third: u32,
    fourth: u32,
    cell: u32,
    face: u32,
}

impl Entry {
    fn same_lowest_four(&self, other: &Entry) -> bool {
        (self.second, self.third, self.fourth) == (other.second, other.third, other.fourth)
    }
}

fn match_faces(
    cells: &Cells,
    dimension: usize,
    group: &[Entry],
    boundary: &mut Vec<CellFace>,
) -> Result<(), SurfaceError> {
    let face_of = |entry: &Entry| CellFace { cell: entry.cell, face: entry.face };
    match group {
        // A cell of dimension 2 is a face of its own.
        [first, second, ..] if dimension == 2 => {
            Err(SurfaceError::DuplicateCells { first: first.cell, second: second.cell })
        }
        [only] => {
            boundary.push(face_of(only));
            Ok(())
        }
        [first, second] => {
            if same_vertices(
                cells.vertices(first.cell as usize),
                cells.vertices(second.cell as usize),
            ) && first.cell != second.cell
            {
                return Err(SurfaceError::DuplicateCells {
                    first: first.cell,
                    second: second.cell,
                });
            }
            Ok(())
        }
        [] => Ok(()),
        more => {
            let mut owners: Vec<u32> = more.iter().map(|entry| entry.cell).collect();
            owners.dedup();
            for pair in owners.windows(2) {
                if same_vertices(cells.vertices(pair[0] as usize), cells.vertices(pair[1] as usize))
                {
                    return Err(SurfaceError::DuplicateCells { first: pair[0], second: pair[1] });
                }
            }
            Err(SurfaceError::SharedFace {
                vertices: face_vertices(cells, dimension, face_of(&more[0])),
                cells: owners,
            })
        }
    }
}

fn same_vertices(first: &[u32], second: &[u32]) -> bool {
    let sum = |vertices: &[u32]| vertices.iter().map(|&vertex| u64::from(vertex)).sum::<u64>();
    first.len() == second.len() && sum(first) == sum(second) && sorted(first) == sorted(second)
}

fn sorted(vertices: &[u32]) -> Vec<u32> {
    let mut vertices = vertices.to_vec();
    vertices.sort_unstable();
    vertices
}

fn split_by_all_vertices(cells: &Cells, dimension: usize, group: &[Entry]) -> Vec<Vec<Entry>> {
    let mut keyed: Vec<(Vec<u32>, Entry)> = group
        .iter()
        .map(|entry| {
            let face = CellFace { cell: entry.cell, face: entry.face };
            (sorted(&face_vertices(cells, dimension, face)), *entry)
        })
        .collect();
    keyed.sort_unstable();
    keyed
        .chunk_by(|a, b| a.0 == b.0)
        .map(|same| same.iter().map(|(_, entry)| *entry).collect())
        .collect()
}

/// The vertices of one face, in order around, without repeats.
pub(super) fn face_vertices(cells: &Cells, dimension: usize, wanted: CellFace) -> Vec<u32> {
    let mut found = Vec::new();
    FaceBuffer::default().for_each(cells, wanted.cell as usize, dimension, |face, vertices| {
        if face == wanted.face {
            found = vertices.to_vec();
        }
    });
    found
}

/// The four lowest vertices in rising order (`u32::MAX` for a triangle's fourth).
pub(super) fn key(vertices: &[u32]) -> [u32; 4] {
    let mut lowest = [u32::MAX; 4];
    for &vertex in vertices {
        let mut carried = vertex;
        for slot in &mut lowest {
            if carried < *slot {
                std::mem::swap(slot, &mut carried);
            }
        }
    }
    lowest
}

/// Walks the faces of cells without allocating for each.
#[derive(Default)]
pub(super) struct FaceBuffer {
    distinct: Vec<u32>,
}

impl FaceBuffer {
    /// Calls `visit` with each face of a cell: its place among them, and its distinct vertices in order around. The faces of a
    /// cell of dimension 2 are itself, or the triangles of a strip.
    pub fn for_each(
        &mut self,
        cells: &Cells,
        cell: usize,
        dimension: usize,
        mut visit: impl FnMut(u32, &[u32]),
    ) {
        let cell_type = cells.cell_type(cell);
        if cell_type.dimension() != dimension {
            return;
        }
        let mut place = 0;
        let mut take = |face: &[u32]| {
            if (1..face.len()).all(|end| !face[..end].contains(&face[end])) {
                visit(place, face);
            } else {
                self.distinct.clear();
                for &vertex in face {
                    if !self.distinct.contains(&vertex) {
                        self.distinct.push(vertex);
                    }
                }
                if self.distinct.len() >= 3 {
                    visit(place, &self.distinct);
                }
            }
            place += 1;
        };
        if dimension == 3 {
            cells.for_each_face(cell, take);
            return;
        }
        match (cell_type, cells.vertices(cell)) {
            (CellType::Pixel, &[a, b, c, d]) => take(&[a, b, d, c]),
            (CellType::TriangleStrip, vertices) => {
                for (start, triple) in vertices.windows(3).enumerate() {
                    match *triple {
                        [a, b, c] if start % 2 == 1 => take(&[b, a, c]),
                        _ => take(triple),
                    }
                }
            }
            (_, vertices) => take(vertices),
        }
    }
}

/// The number that comes most often, the lowest on a tie.
pub(super) fn most_frequent(mut numbers: Vec<i64>) -> Option<i64> {
    numbers.sort_unstable();
    let mut best: Option<(usize, i64)> = None;
    for same in numbers.chunk_by(|a, b| a == b) {
        if best.is_none_or(|(count, _)| same.len() > count) {
            best = Some((same.len(), same[0]));
        }
    }
    best.map(|(_, number)| number)
}

/// Tags of faces, looked up by their vertices in any order.
pub(super) struct TagLookup {
    small: HashMap<[u32; 4], i64>,
    large: HashMap<Vec<u32>, i64>,
}

impl TagLookup {
    /// Where a face is tagged more than once, the first tag holds.
    pub fn new(faces: &Cells, tags: &[i64]) -> Self {
        let mut lookup = Self { small: HashMap::with_capacity(faces.len()), large: HashMap::new() };
        let mut buffer = FaceBuffer::default();
        for (cell, &tag) in tags.iter().enumerate().take(faces.len()) {
            buffer.for_each(faces, cell, 2, |_, vertices| {
                if vertices.len() <= 4 {
                    lookup.small.entry(key(vertices)).or_insert(tag);
                } else {
                    lookup.large.entry(sorted(vertices)).or_insert(tag);
                }
            });
        }
        lookup
    }

    /// The tag of the face with these vertices; of a face whose tags stand on triangles that make it up, the one that most of them
    /// carry, the lowest on a tie.
    pub fn get(&self, vertices: &[u32]) -> Option<i64> {
        self.get_whole(vertices).or_else(|| self.get_by_triangles(vertices))
    }

    fn get_by_triangles(&self, vertices: &[u32]) -> Option<i64> {
        let count = vertices.len();
        // Larger faces have too many triangles to try.
        if !(4..=12).contains(&count) {
            return None;
        }
        let mut tags = Vec::new();
        for first in 0..count {
            for second in first + 1..count {
                let corners = |third: usize| [vertices[first], vertices[second], vertices[third]];
                tags.extend(
                    (second + 1..count).filter_map(|third| self.get_whole(&corners(third))),
                );
            }
        }
        if tags.len() < count - 2 { None } else { most_frequent(tags) }
    }

    fn get_whole(&self, vertices: &[u32]) -> Option<i64> {
        if vertices.len() <= 4 {
            self.small.get(&key(vertices)).copied()
        } else {
            self.large.get(&sorted(vertices)).copied()
        }
    }
}
