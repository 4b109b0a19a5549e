//! The boundary faces of a mesh of tetrahedra alone, which most meshes are, in a third of the time
//! that any cells take.

use crate::mesh::{CellFace, CellType, Cells};

/// The corner that each face of a tetrahedron leaves out.
const OPPOSITE: [usize; 4] = [2, 0, 1, 3];
/// Up to as many faces with the same lowest vertex are compared one by one; more are sorted.
const COMPARED: usize = 96;

/// A face under its lowest vertex.
#[derive(Debug, Clone, Copy, Default)]
struct Entry {
    /// The second and third vertex.
    others: u64,
    /// The fourth vertex of its cell.
    opposite: u32,
    /// Four times its cell, plus its position among the faces of the cell.
    face: u32,
}

/// The faces that belong to one cell only, in the order of the cells and of the faces in a cell.
/// Cells marked in `left_out` are none.
///
/// `None` where there are other cells, where one is collapsed, and where something is wrong: what
/// that is, is not said here.
pub(super) fn boundary_faces(
    cells: &Cells,
    vertex_count: usize,
    left_out: Option<&[bool]>,
) -> Option<Vec<CellFace>> {
    if cells.uniform_type() != Some(CellType::Tetra) || u32::try_from(4 * cells.len()).is_err() {
        return None;
    }
    let tetrahedra = cells.connectivity().as_chunks::<4>().0;
    let counts =
        |cell: usize| !left_out.is_some_and(|left_out| left_out.get(cell).is_some_and(|&out| out));
    let mut starts = vec![0_usize; vertex_count + 1];
    for (_, &corners) in tetrahedra.iter().enumerate().filter(|(cell, _)| counts(*cell)) {
        let [first, second, third, fourth] = rising(corners);
        if first == second || second == third || third == fourth {
            return None;
        }
        *starts.get_mut(first as usize + 1)? += 3;
        *starts.get_mut(second as usize + 1)? += 1;
    }
    for vertex in 0..vertex_count {
        starts[vertex + 1] += starts[vertex];
    }
    let mut entries = vec![Entry::default(); starts[vertex_count]];
    let mut next = starts.clone();
    for (cell, &corners) in tetrahedra.iter().enumerate().filter(|(cell, _)| counts(*cell)) {
        let [first, second, third, fourth] = rising(corners);
        for (position, corner) in (0..).zip(OPPOSITE) {
            let opposite = corners[corner];
            let [lowest, middle, highest] = if opposite == fourth {
                [first, second, third]
            } else if opposite == third {
                [first, second, fourth]
            } else if opposite == second {
                [first, third, fourth]
            } else {
                [second, third, fourth]
            };
            let slot = &mut next[lowest as usize];
            let face = 4 * cell as u32 + position;
            entries[*slot] =
                Entry { others: u64::from(middle) << 32 | u64::from(highest), opposite, face };
            *slot += 1;
        }
    }
    let mut boundary = Vec::new();
    let mut seen = Seen::default();
    for vertex in 0..vertex_count {
        let bucket = &mut entries[starts[vertex]..starts[vertex + 1]];
        if bucket.len() <= COMPARED {
            seen.take(bucket, &mut boundary)?;
        } else {
            bucket.sort_unstable_by_key(|entry| entry.others);
            for same in bucket.chunk_by(|a, b| a.others == b.others) {
                seen.take(same, &mut boundary)?;
            }
        }
    }
    boundary.sort_unstable();
    Some(boundary)
}

/// The faces seen so far with one lowest vertex.
#[derive(Default)]
struct Seen {
    others: Vec<u64>,
    /// Whether a second cell has the face, and else what it is.
    open: Vec<Option<Entry>>,
}

impl Seen {
    /// Puts those of these faces that come once into `boundary`; `None` where one comes a third
    /// time, or a cell a second time.
    fn take(&mut self, entries: &[Entry], boundary: &mut Vec<CellFace>) -> Option<()> {
        self.others.clear();
        self.open.clear();
        for entry in entries {
            match self.others.iter().position(|&others| others == entry.others) {
                None => {
                    self.others.push(entry.others);
                    self.open.push(Some(*entry));
                }
                Some(index) => {
                    let before = self.open[index].take()?;
                    if before.opposite == entry.opposite {
                        return None;
                    }
                }
            }
        }
        let open = self.open.iter().flatten();
        boundary.extend(open.map(|entry| CellFace { cell: entry.face / 4, face: entry.face % 4 }));
        Some(())
    }
}

/// Four numbers in rising order.
fn rising([a, b, c, d]: [u32; 4]) -> [u32; 4] {
    let (a, b) = (a.min(b), a.max(b));
    let (c, d) = (c.min(d), c.max(d));
    let (first, c) = (a.min(c), a.max(c));
    let (b, fourth) = (b.min(d), b.max(d));
    [first, b.min(c), b.max(c), fourth]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::box_of_tets;
    use crate::surface::boundary_of_cells;

    /// Faces of a box whose vertices are numbered at random, with some cells left out, and of a
    /// star with many cells around one vertex, are those found among any cells.
    #[test]
    fn finds_what_is_found_among_any_cells() {
        let mesh = box_of_tets([5, 4, 3], [0.0; 3], [1.0; 3]);
        let count = mesh.points().len();
        let mut state = 9_u64;
        let mut random = move |below: usize| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as usize % below
        };
        for round in 0..20 {
            let mut numbers: Vec<u32> = (0..count as u32).collect();
            for last in (1..count).rev() {
                numbers.swap(last, random(last + 1));
            }
            let mut corners: Vec<u32> = mesh
                .cells()
                .connectivity()
                .iter()
                .map(|&vertex| numbers[vertex as usize])
                .collect();
            if round == 3 {
                // A hub: the least vertex of more than a hundred faces.
                corners.chunks_mut(4).enumerate().filter(|(cell, _)| cell % 3 == 0).for_each(
                    |(cell, tetra)| {
                        tetra.copy_from_slice(&[
                            0,
                            count as u32 + 2 * cell as u32,
                            count as u32 + 2 * cell as u32 + 1,
                            5,
                        ]);
                    },
                );
            }
            let vertices = corners.iter().max().map_or(0, |&vertex| vertex as usize + 1);
            let cells = Cells::uniform(CellType::Tetra, corners).unwrap();
            let left_out: Vec<bool> =
                (0..cells.len()).map(|_| round % 2 == 1 && random(4) == 0).collect();
            let found = boundary_faces(&cells, vertices, Some(&left_out));
            let expected = boundary_of_cells::boundary_faces(&cells, vertices, 3, Some(&left_out));
            match expected {
                Ok(expected) => assert_eq!(found, Some(expected), "round {round}"),
                Err(_) => assert_eq!(found, None, "round {round}"),
            }
        }
    }

    #[test]
    fn leaves_to_others_what_is_wrong() {
        let none = |corners: &[u32]| {
            let cells = Cells::uniform(CellType::Tetra, corners.to_vec()).unwrap();
            boundary_faces(&cells, 8, None).is_none()
        };
        assert!(!none(&[0, 1, 2, 3, 1, 2, 3, 4]));
        // A cell twice, a collapsed one, a face of three cells, a vertex that is not there.
        assert!(none(&[0, 1, 2, 3, 3, 1, 0, 2]));
        assert!(none(&[0, 1, 2, 1]));
        assert!(none(&[0, 1, 2, 3, 0, 1, 2, 4, 0, 1, 2, 5]));
        assert!(none(&[8, 9, 10, 11]));
    }
}
