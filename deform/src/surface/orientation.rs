//! Which way round the faces of a surface run.

use crate::mesh::{Cells, Vector};
use crate::topology::edges;
use crate::vector::{cross, dot, length, polygon_normal, subtract};

/// Which faces have to be turned for all to run the same way round.
///
/// Faces that meet at an edge of two should walk it opposite ways. In each piece that hangs
/// together by such edges, what has the smaller area is turned. Closed pieces are then turned
/// together where they enclose a negative volume in all, so that normals point outward. Pieces with
/// one side only, as a Moebius strip, stay as they are.
pub(super) fn faces_to_turn(points: &[Vector], faces: &Cells) -> Vec<bool> {
    let sides = edges((0..faces.len()).map(|face| faces.vertices(face)));
    let mut open = vec![false; faces.len()];
    let mut neighbours = vec![Vec::new(); faces.len()];
    for same in sides.chunk_by(|a, b| a.ends == b.ends) {
        match same {
            [a, b] => {
                let against = a.forward == b.forward;
                neighbours[a.face as usize].push((b.face, against));
                neighbours[b.face as usize].push((a.face, against));
            }
            others => others.iter().for_each(|side| open[side.face as usize] = true),
        }
    }
    let mut turned: Vec<Option<bool>> = vec![None; faces.len()];
    let mut closed = Vec::new();
    let mut volume = 0.0;
    for first in 0..faces.len() {
        if turned[first].is_some() {
            continue;
        }
        turned[first] = Some(false);
        let mut piece = vec![first];
        let mut has_two_sides = true;
        let mut next = 0;
        while let Some(&face) = piece.get(next) {
            next += 1;
            for &(other, against) in &neighbours[face] {
                let expected = turned[face].map(|turned| turned != against);
                match &mut turned[other as usize] {
                    Some(found) => has_two_sides &= Some(*found) == expected,
                    none => {
                        *none = expected;
                        piece.push(other as usize);
                    }
                }
            }
        }
        let [mut kept, mut changed] = [0.0, 0.0];
        for &face in &piece {
            let normal = polygon_normal(points, faces.vertices(face));
            *if turned[face] == Some(true) { &mut changed } else { &mut kept } += length(normal);
        }
        for &face in &piece {
            turned[face] = Some(has_two_sides && (turned[face] == Some(true)) != (changed > kept));
        }
        if has_two_sides && piece.iter().all(|&face| !open[face]) {
            let origin = points[faces.vertices(first)[0] as usize];
            for &face in &piece {
                let sign = if turned[face] == Some(true) { -1.0 } else { 1.0 };
                volume += sign * cone(points, faces.vertices(face), origin);
            }
            closed.extend(piece);
        }
    }
    if volume < 0.0 {
        for face in closed {
            turned[face] = turned[face].map(|turned| !turned);
        }
    }
    turned.into_iter().map(|turned| turned == Some(true)).collect()
}

/// Six times the volume between a face and a point.
fn cone(points: &[Vector], vertices: &[u32], origin: Vector) -> f64 {
    let corner = |index: usize| subtract(points[vertices[index] as usize], origin);
    (2..vertices.len()).map(|index| dot(corner(0), cross(corner(index - 1), corner(index)))).sum()
}
