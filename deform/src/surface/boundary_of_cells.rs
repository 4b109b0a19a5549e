//! The boundary faces of cells of any types.

use super::SurfaceError;
use crate::mesh::{CellFace, Cells, FaceBuffer, face_vertices, lowest_four, sorted};

/// The faces that belong to one cell only, in the order of the cells and of the faces in a cell.
///
/// Cells of another dimension, and those marked in `left_out`, do not count. A face of a collapsed
/// cell (one that names a vertex twice) counts with its distinct vertices, and not at all where
/// fewer than three are left.
///
/// # Errors
/// [`SurfaceError::SharedFace`], [`SurfaceError::DuplicateCells`].
pub(super) fn boundary_faces(
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
    // Faces are dealt into a bucket for each lowest vertex, so that all of it is linear in time and
    // local in memory.
    let mut entries = vec![Entry::default(); starts[vertex_count]];
    let mut next = starts.clone();
    for cell in (0..cells.len()).filter(counts) {
        buffer.for_each(cells, cell, dimension, |face, vertices| {
            let key = lowest_four(vertices);
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
