//! Distances along a surface.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::mesh::Vector;
use crate::number::Ordered;
use crate::topology::triangles_at;
use crate::vector::{distance, dot, subtract};

/// For each vertex its distance along the surface from the nearest of some vertices, and which of
/// them that is: the fast marching method (Kimmel and Sethian 1998), which takes the front within a
/// triangle as straight. At obtuse corners it may go along the edges instead, which is up to some
/// percent longer. Vertices farther than `farthest`, or not connected, have none.
pub(super) fn from_vertices(
    points: &[Vector],
    triangles: &[[u32; 3]],
    sources: impl Iterator<Item = u32>,
    farthest: f64,
) -> Vec<Option<(f64, u32)>> {
    let around = triangles_at(triangles, points.len());

    let mut best: Vec<Option<(f64, u32)>> = vec![None; points.len()];
    let mut is_final = vec![false; points.len()];
    // By distance, and then by number.
    let mut front = BinaryHeap::new();
    for source in sources {
        best[source as usize] = Some((0.0, source));
        front.push(Reverse((Ordered(0.0), source)));
    }
    while let Some(Reverse((Ordered(reached), vertex))) = front.pop() {
        if std::mem::replace(&mut is_final[vertex as usize], true) {
            continue;
        }
        let source = best[vertex as usize].map_or(vertex, |(_, source)| source);
        for &triangle in around.of(vertex) {
            let corners = triangles[triangle as usize];
            for [target, other] in others(corners, vertex) {
                if is_final[target as usize] {
                    continue;
                }
                let [a, b, c] = [vertex, other, target].map(|corner| points[corner as usize]);
                let mut length = reached + distance(a, c);
                if is_final[other as usize]
                    && let Some((other, _)) = best[other as usize]
                    && let Some(straight) =
                        straight_front(subtract(a, c), subtract(b, c), reached, other)
                {
                    length = length.min(straight);
                }
                if length <= farthest
                    && best[target as usize].is_none_or(|(known, _)| length < known)
                {
                    best[target as usize] = Some((length, source));
                    front.push(Reverse((Ordered(length), target)));
                }
            }
        }
    }
    best
}

/// The two other corners of a triangle, each with the third one.
fn others([a, b, c]: [u32; 3], vertex: u32) -> [[u32; 2]; 2] {
    match vertex {
        _ if vertex == a => [[b, c], [c, b]],
        _ if vertex == b => [[a, c], [c, a]],
        _ => [[a, b], [b, a]],
    }
}

/// The distance at the corner from which `to_a` and `to_b` lead to corners of known distance, for a
/// straight front that reaches it through their side.
fn straight_front(to_a: Vector, to_b: Vector, at_a: f64, at_b: f64) -> Option<f64> {
    let [aa, ab, bb] = [dot(to_a, to_a), dot(to_a, to_b), dot(to_b, to_b)];
    let determinant = aa * bb - ab * ab;
    if determinant <= 1e-12 * aa * bb {
        return None;
    }
    // Of the inverse Gram matrix Q: 1'Q1, 1'Qd and d'Qd.
    let inverse = |x: [f64; 2], y: [f64; 2]| {
        (bb * x[0] * y[0] - ab * (x[0] * y[1] + x[1] * y[0]) + aa * x[1] * y[1]) / determinant
    };
    let (ones, known) = ([1.0, 1.0], [at_a, at_b]);
    let [quadratic, linear, constant] =
        [inverse(ones, ones), inverse(ones, known), inverse(known, known) - 1.0];
    let discriminant = linear * linear - quadratic * constant;
    if discriminant < 0.0 {
        return None;
    }
    let reached = (linear + discriminant.sqrt()) / quadratic;
    // The front must come from between the two.
    let rise = [at_a - reached, at_b - reached];
    let from_a = bb * rise[0] - ab * rise[1];
    let from_b = aa * rise[1] - ab * rise[0];
    (from_a <= 0.0 && from_b <= 0.0 && reached >= at_a.max(at_b)).then_some(reached)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::features::FeatureSettings;
    use crate::shapes;
    use crate::surface::Surface;

    #[test]
    fn distances_on_a_plate_converge_to_straight_lines() {
        let error = |count: usize| {
            let mesh = shapes::plate([count, count], [0.0; 2], [1.0; 2]);
            let surface = Surface::extract(&mesh, &FeatureSettings::default()).unwrap();
            let distances =
                from_vertices(surface.points(), surface.triangles(), [0].into_iter(), 10.0);
            let error = |(vertex, found): (usize, &Option<(f64, u32)>)| {
                (found.unwrap().0 - distance(surface.points()[vertex], surface.points()[0])).abs()
            };
            distances.iter().enumerate().map(error).fold(0.0, f64::max)
        };
        let [coarse, fine] = [error(16), error(64)];
        assert!(coarse < 0.06 && fine < 0.5 * coarse, "{coarse} {fine}");
    }

    #[test]
    fn from_a_side_they_are_exact_and_end_at_the_farthest() {
        let mesh = shapes::plate([10, 4], [0.0; 2], [1.0, 0.4]);
        let surface = Surface::extract(&mesh, &FeatureSettings::default()).unwrap();
        let side = (0..surface.points().len() as u32)
            .filter(|&vertex| surface.points()[vertex as usize][0] == 0.0);
        let distances = from_vertices(surface.points(), surface.triangles(), side, 0.55);
        for (point, found) in surface.points().iter().zip(&distances) {
            match found {
                Some((found, _)) => assert!((found - point[0]).abs() < 1e-14, "{found} {point:?}"),
                None => assert!(point[0] > 0.55),
            }
        }
    }
}
