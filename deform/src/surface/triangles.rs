//! The triangles that the faces of a surface are split into.

use crate::mesh::{Cells, Vector};
use crate::vector::{cross, dot, polygon_normal, subtract};

/// The triangles of some faces, and the face that each triangle is part of.
pub(super) fn split_into_triangles(points: &[Vector], faces: &Cells) -> (Vec<[u32; 3]>, Vec<u32>) {
    let mut triangles = Vec::with_capacity(faces.len());
    let mut triangle_faces = Vec::with_capacity(faces.len());
    for (face, (_, vertices)) in faces.iter().enumerate() {
        let count = vertices.len();
        let start = if count == 3 { 0 } else { best_fan(points, vertices) };
        for step in 1..count - 1 {
            triangles.push([
                vertices[start],
                vertices[(start + step) % count],
                vertices[(start + step + 1) % count],
            ]);
            triangle_faces.push(face as u32);
        }
    }
    (triangles, triangle_faces)
}

/// Where a fan of triangles over a polygon should start: where its smallest triangle is largest, so
/// that a polygon that is not convex is still covered rightly wherever a fan can; the lowest vertex
/// number where it makes no difference.
fn best_fan(points: &[Vector], vertices: &[u32]) -> usize {
    let count = vertices.len();
    let point = |corner: usize| points[vertices[corner % count] as usize];
    let normal = polygon_normal(points, vertices);
    let length = dot(normal, normal);
    let mut best: Option<(f64, u32, usize)> = None;
    for (start, &vertex) in vertices.iter().enumerate() {
        let smallest = (1..count - 1)
            .map(|step| {
                let apex = point(start);
                let area = cross(
                    subtract(point(start + step), apex),
                    subtract(point(start + step + 1), apex),
                );
                dot(area, normal) / length
            })
            .fold(f64::INFINITY, f64::min);
        let better = best.is_none_or(|(value, number, _)| {
            smallest > value + 1e-9 || (smallest > value - 1e-9 && vertex < number)
        });
        if better {
            best = Some((smallest, vertex, start));
        }
    }
    best.map_or(0, |(_, _, start)| start)
}
