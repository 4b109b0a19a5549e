//! Faces of a polyhedron that all look outward. A face that two cells share is stored once, and so
//! faces one of them the wrong way.

use std::collections::HashMap;

use tombolo_deform::vector::{Vector, determinant, subtract};

/// Turns faces round where it takes so that each is counter-clockwise seen from outside. Faces that
/// do not close are left as they are told.
pub(super) fn turn_outward(faces: &mut [Vec<u32>], position: impl Fn(u32) -> Vector) {
    let mut by_edge: HashMap<(u32, u32), Vec<usize>> = HashMap::new();
    for (face, vertices) in faces.iter().enumerate() {
        for (from, to) in edges(vertices) {
            by_edge.entry((from.min(to), from.max(to))).or_default().push(face);
        }
    }
    // One face after the other is made to run against its neighbour along the edge between them.
    let mut seen = vec![false; faces.len()];
    for first in 0..faces.len() {
        if std::mem::replace(&mut seen[first], true) {
            continue;
        }
        let mut piece = vec![first];
        let mut next = 0;
        while let Some(&face) = piece.get(next) {
            next += 1;
            for (from, to) in edges(&faces[face].clone()) {
                let across =
                    by_edge.get(&(from.min(to), from.max(to))).map_or(&[][..], Vec::as_slice);
                for &other in across {
                    if std::mem::replace(&mut seen[other], true) {
                        continue;
                    }
                    if edges(&faces[other]).any(|edge| edge == (from, to)) {
                        faces[other].reverse();
                    }
                    piece.push(other);
                }
            }
        }
        if volume(piece.iter().map(|&face| faces[face].as_slice()), &position) < 0.0 {
            piece.iter().for_each(|&face| faces[face].reverse());
        }
    }
}

fn edges(face: &[u32]) -> impl Iterator<Item = (u32, u32)> {
    let after = face.iter().skip(1).chain(face.first());
    face.iter().copied().zip(after.copied())
}

/// Six times the volume that the faces enclose.
fn volume<'a>(faces: impl Iterator<Item = &'a [u32]>, position: &impl Fn(u32) -> Vector) -> f64 {
    let mut origin = None;
    let mut sum = 0.0;
    for face in faces {
        let Some((&first, rest)) = face.split_first() else { continue };
        let origin = *origin.get_or_insert_with(|| position(first));
        let from_origin = |vertex: u32| subtract(position(vertex), origin);
        for pair in rest.windows(2) {
            sum += determinant(from_origin(first), from_origin(pair[0]), from_origin(pair[1]));
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_face_of_a_cube_looks_outward_however_it_was_told() {
        let position = |vertex: u32| {
            [f64::from(vertex & 1), f64::from(vertex >> 1 & 1), f64::from(vertex >> 2 & 1)]
        };
        let told =
            [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        for turned in 0..64_u32 {
            let mut faces: Vec<Vec<u32>> = told.iter().map(|face| face.to_vec()).collect();
            for (face, vertices) in faces.iter_mut().enumerate() {
                if turned >> face & 1 == 1 {
                    vertices.reverse();
                }
            }
            turn_outward(&mut faces, position);
            let one = volume(faces.iter().map(Vec::as_slice), &position);
            assert!((one - 6.0).abs() < 1e-12, "{turned:b}: {one}");
        }
    }
}
