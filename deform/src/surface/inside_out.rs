//! Closed pieces of a surface that are turned inside out.

use crate::mesh::Vector;
use crate::topology::{DisjointSets, edges};
use crate::vector::{determinant, subtract};

/// A volume under this part of what its piece would hold as a ball is rounding.
const EMPTY: f64 = 1e-12;

/// The triangles of closed pieces that enclose a volume of another sign at `shape` than at
/// `reference`.
pub(super) fn turned_inside_out(
    triangles: &[[u32; 3]],
    reference: &[Vector],
    shape: &[Vector],
) -> Vec<u32> {
    let parts =
        DisjointSets::components(reference.len(), triangles.iter().map(<[u32; 3]>::as_slice));
    let [before, after] = [reference, shape].map(|points| volumes(triangles, points, &parts));
    let mut suspect: Vec<bool> =
        before.iter().zip(&after).map(|(before, after)| before * after < 0.0).collect();
    if !suspect.contains(&true) {
        return Vec::new();
    }
    // An open piece encloses nothing.
    let part = |triangle: &[u32; 3]| parts[triangle[0] as usize] as usize;
    let chosen: Vec<u32> = (0..)
        .zip(triangles)
        .filter(|(_, triangle)| suspect[part(triangle)])
        .map(|(number, _)| number)
        .collect();
    let faces = chosen.iter().map(|&number| &triangles[number as usize][..]);
    for same in edges(faces).chunk_by(|a, b| a.ends == b.ends) {
        let is_closed = matches!(same, [a, b] if a.forward != b.forward);
        if !is_closed {
            suspect[parts[same[0].ends[0] as usize] as usize] = false;
        }
    }
    chosen.into_iter().filter(|&number| suspect[part(&triangles[number as usize])]).collect()
}

/// Six times the volume of each piece, in units of the cube of its extent; 0 where that is
/// rounding.
fn volumes(triangles: &[[u32; 3]], points: &[Vector], parts: &[u32]) -> Vec<f64> {
    // Counted from a vertex of the piece, which costs no digits where it lies far from the origin.
    let from = |vertex: u32| {
        let origin = parts[vertex as usize];
        subtract(points[vertex as usize], points[origin as usize])
    };
    let mut extents = vec![0.0f64; points.len()];
    for vertex in 0..points.len() as u32 {
        let extent = &mut extents[parts[vertex as usize] as usize];
        for value in from(vertex) {
            if value.abs() > *extent {
                *extent = value.abs();
            }
        }
    }
    let mut volumes = vec![0.0; points.len()];
    for triangle in triangles {
        let part = parts[triangle[0] as usize] as usize;
        if extents[part] > 0.0 {
            let [a, b, c] = triangle.map(|vertex| from(vertex).map(|value| value / extents[part]));
            volumes[part] += determinant(a, b, c);
        }
    }
    volumes.iter().map(|&volume| if volume.abs() > EMPTY { volume } else { 0.0 }).collect()
}
