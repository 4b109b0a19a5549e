//! Bringing a surface to a workable number of vertices.

use super::triangulation::Triangulation;
use crate::mesh::Vector;
use crate::vector::{dot, triangle_normal};

/// A bound on passes that end by themselves but for surfaces made to resist.
const MOST_PASSES: usize = 60;

/// Collapses short edges until at most about `most` vertices are left, and splits edges that are
/// long for a surface of `least` vertices. The topology stays as it is; the vertices that resist
/// stay too.
pub(super) fn resample(mesh: &mut Triangulation, least: usize, most: usize) {
    coarsen(mesh, most);
    refine(mesh, least, most);
    coarsen(mesh, most + most / 2);
}

/// The edge length of equilateral triangles that cover an area with a number of vertices.
fn edge_length(area: f64, vertices: usize) -> f64 {
    (area / (0.75f64.sqrt() * vertices.max(4) as f64)).sqrt()
}

fn coarsen(mesh: &mut Triangulation, most: usize) {
    let area = mesh.area();
    let wanted = edge_length(area, most);
    let mut threshold = 0.5 * edge_length(area, mesh.vertex_count()).min(wanted);
    let mut work = [Vec::new(), Vec::new()];
    let mut around = Vec::new();
    for _ in 0..MOST_PASSES {
        let before = mesh.vertex_count();
        if before <= most {
            return;
        }
        threshold *= 1.35;
        for vertex in 0..mesh.points.len() as u32 {
            if !mesh.is_alive(vertex) {
                continue;
            }
            mesh.neighbours(vertex, &mut around);
            let mut edges: Vec<(f64, u32)> =
                around.iter().map(|&other| (mesh.length(vertex, other), other)).collect();
            edges.retain(|edge| edge.0 < threshold);
            edges.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            for (_, other) in edges {
                let merged = mesh.middle(vertex, other);
                if mesh.can_collapse(vertex, other, &mut work)
                    && !folds(mesh, vertex, other, merged)
                {
                    mesh.collapse(vertex, other, merged);
                    break;
                }
            }
            if mesh.vertex_count() <= most {
                return;
            }
        }
        if mesh.vertex_count() == before && threshold > 8.0 * wanted {
            return;
        }
    }
}

/// Whether merging the ends of an edge would turn a triangle by more than 75 degrees.
fn folds(mesh: &Triangulation, a: u32, b: u32, merged: Vector) -> bool {
    let turns = |vertex: u32, other: u32| {
        mesh.triangles_at[vertex as usize].iter().any(|&number| {
            let triangle = mesh.triangles[number as usize];
            if triangle.contains(&other) {
                return false;
            }
            let old = mesh.normal(triangle);
            let moved = triangle
                .map(|corner| if corner == vertex { merged } else { mesh.points[corner as usize] });
            let new = triangle_normal(moved);
            let size = (dot(old, old) * dot(new, new)).sqrt();
            dot(old, new) < 0.25 * size
        })
    };
    turns(a, b) || turns(b, a)
}

fn refine(mesh: &mut Triangulation, least: usize, most: usize) {
    let longest = 4.0 / 3.0 * edge_length(mesh.area(), least);
    for _ in 0..MOST_PASSES {
        let mut edges: Vec<(f64, u32, u32)> = Vec::new();
        for [a, b, c] in mesh.live_triangles() {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                let length = mesh.length(from, to);
                if from < to && length > longest {
                    edges.push((length, from, to));
                }
            }
        }
        if edges.is_empty() {
            return;
        }
        edges.sort_unstable_by(|x, y| y.0.total_cmp(&x.0).then((x.1, x.2).cmp(&(y.1, y.2))));
        for (_, a, b) in edges {
            if mesh.vertex_count() >= 2 * most {
                return;
            }
            let middle = mesh.middle(a, b);
            mesh.split(a, b, middle);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes;
    use crate::vector::{length, subtract};

    fn torus(counts: [usize; 2]) -> Triangulation {
        let mesh = shapes::torus(1.0, 0.3, counts);
        let triangles =
            mesh.cells().connectivity().chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
        Triangulation::new(mesh.points().to_vec(), triangles)
    }

    fn euler_characteristic(mesh: &Triangulation) -> i64 {
        let triangles = mesh.live_triangles().count() as i64;
        mesh.vertex_count() as i64 - triangles / 2
    }

    #[test]
    fn a_fine_torus_is_brought_to_size_and_stays_a_torus() {
        let mut mesh = torus([200, 60]);
        let (area, volume) = (mesh.area(), mesh.signed_volume());
        resample(&mut mesh, 500, 2000);
        assert!((500..=2000).contains(&mesh.vertex_count()), "{}", mesh.vertex_count());
        assert_eq!(euler_characteristic(&mesh), 0);
        assert!(
            (mesh.area() / area - 1.0).abs() < 0.02
                && (mesh.signed_volume() / volume - 1.0).abs() < 0.03
        );
        let merged = mesh.merged();
        for (vertex, &into) in merged.iter().enumerate().take(12000) {
            assert!(mesh.is_alive(into));
            let [i, j] = [vertex / 60, vertex % 60].map(|number| number as f64);
            let [u, v] = [i / 200.0, j / 60.0].map(|turn| std::f64::consts::TAU * turn);
            let radius = 1.0 + 0.3 * v.cos();
            let center = [radius * u.cos(), radius * u.sin(), 0.3 * v.sin()];
            let away = subtract(mesh.points[into as usize], center);
            assert!(length(away) < 0.2);
        }
    }

    #[test]
    fn a_coarse_torus_is_refined() {
        let mut mesh = torus([6, 4]);
        let volume = mesh.signed_volume();
        resample(&mut mesh, 500, 2000);
        assert!((300..3000).contains(&mesh.vertex_count()), "{}", mesh.vertex_count());
        assert_eq!(euler_characteristic(&mesh), 0);
        assert!((mesh.signed_volume() / volume - 1.0).abs() < 1e-12);
    }
}
