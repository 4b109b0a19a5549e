//! Whether a prescribed surface folds.

use crate::communicator::{Communicator, Reader, Writer};
use crate::mesh::{Cells, Domain, Vector};
use crate::vector::{dot, mean};

use crate::mesh::cell_geometry::vector_area;

/// Whether a face (its corners in order) that lay at `before` has no area at `after`, or has turned
/// by a right angle or more. A face without area to begin with has no side to turn to.
#[must_use]
pub fn turns_over(before: &[Vector], after: &[Vector]) -> bool {
    let normal = vector_area(before);
    normal != [0.0; 3] && dot(normal, vector_area(after)) <= 0.0
}

/// The boundary faces whose normal at `end` points against that at `start`: how many, and where the
/// first lies at `start`. For a mesh of polygons, the polygons themselves. Collective.
pub(super) fn folded_faces(
    domain: &Domain,
    start: &[Vector],
    end: &[Vector],
) -> (usize, Option<Vector>) {
    let (cells, communicator) = (domain.mesh().cells(), domain.communicator());
    let mut count = 0;
    let mut first = None;
    let (mut before, mut after) = (Vec::new(), Vec::new());
    let mut look = |face: &[u32]| {
        before.clear();
        before.extend(face.iter().map(|&vertex| start[vertex as usize]));
        after.clear();
        after.extend(face.iter().map(|&vertex| end[vertex as usize]));
        if turns_over(&before, &after) {
            count += 1;
            first.get_or_insert_with(|| mean(before.iter().copied()));
        }
    };
    if let Some(faces) = domain.boundary_faces() {
        faces.iter().for_each(|(_, face)| look(face));
    } else if cells.dimension() == 2 {
        (0..cells.len()).for_each(|cell| cells.for_each_polygon(cell, &mut look));
    } else {
        for_each_boundary_face(cells, look);
    }
    let mut message = Writer::default();
    first.iter().for_each(|position| message.f64s(position));
    let all = communicator.gather_all(&message.into_bytes());
    let found =
        all.iter().enumerate().find_map(|(rank, bytes)| Reader::new(rank, bytes).vector().ok());
    (communicator.total(count), found)
}

/// Calls `visit` with each face that only one volume cell has, in the order of the cells.
fn for_each_boundary_face(cells: &Cells, mut visit: impl FnMut(&[u32])) {
    // A face is known by its four lowest vertices and its size.
    let mut faces = Vec::new();
    for cell in 0..cells.len() {
        let mut index = 0u32;
        cells.for_each_face(cell, |face| {
            let mut key = [u32::MAX; 5];
            for &vertex in face {
                key[4] = vertex;
                key.sort_unstable();
            }
            key[4] = u32::try_from(face.len()).unwrap_or(u32::MAX);
            faces.push((key, cell, index));
            index += 1;
        });
    }
    faces.sort_unstable();
    let mut single: Vec<(usize, u32)> = faces
        .chunk_by(|a, b| a.0 == b.0)
        .filter(|same| same.len() == 1)
        .map(|same| (same[0].1, same[0].2))
        .collect();
    single.sort_unstable();
    for (cell, wanted) in single {
        let mut index = 0;
        cells.for_each_face(cell, |face| {
            if index == wanted {
                visit(face);
            }
            index += 1;
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::CellType;

    #[test]
    fn two_tets_have_six_boundary_faces() {
        let cells = Cells::uniform(CellType::Tetra, vec![0, 1, 2, 3, 1, 2, 3, 4]).unwrap();
        let mut faces = Vec::new();
        for_each_boundary_face(&cells, |face| faces.push(face.to_vec()));
        assert_eq!(faces.len(), 6);
        assert!(
            faces.iter().all(|face| !(face.contains(&1) && face.contains(&2) && face.contains(&3)))
        );
    }
}
