//! Skeletons against those of CGAL: the same pieces, loops and branches, and within 2 % of the
//! bounding box of each other.

use tombolo_deform::features::FeatureSettings;
use tombolo_deform::mesh::{CellType, Cells, FeatureSource, Mesh, Vector};
use tombolo_deform::shapes;
use tombolo_deform::skeleton::{Skeleton, SkeletonSettings};
use tombolo_deform::surface::Surface;
use tombolo_pipelines::files::read_mesh;
use tombolo_tests::{CurveGraph, PATIENCE, generated_surfaces};

/// Branches shorter than this part of the diagonal are noise: CGAL has other ones in each run.
const SPUR: f64 = 0.03;

/// Asserts that both skeletons of a surface have these pieces, loops, branch nodes and ends, and
/// lie close together.
fn agree(name: &str, mesh: &Mesh, counts: [usize; 4]) {
    let surface = Surface::extract(mesh, &FeatureSettings::default()).expect("a surface");
    let ours = CurveGraph::of(
        &Skeleton::extract(&surface, &SkeletonSettings::default()).expect("a skeleton"),
    );
    let (_, theirs) = CurveGraph::of_cgal(&surface, PATIENCE).expect("CGAL ends in time");
    let theirs = theirs.without_spurs(SPUR, &surface);
    assert_eq!(ours.without_spurs(SPUR, &surface), ours, "{name}: ours has no spurs");
    assert_eq!(ours.counts(), counts, "{name}: pieces, loops, branch nodes and ends");
    assert_eq!(theirs.counts(), counts, "{name}: those of CGAL");
    let [there, back] = ours.apart(&theirs, &surface);
    println!("{name}: {:.2} % and {:.2} % of the diagonal apart", 100.0 * there, 100.0 * back);
    assert!(there <= 0.02 && back <= 0.02, "{name}: {there} {back}");
}

#[test]
fn a_torus() {
    agree("torus", &shapes::torus(1.0, 0.3, [120, 40]), [1, 1, 0, 0]);
}

#[test]
fn a_coarse_torus() {
    agree("coarse torus", &shapes::torus(1.0, 0.3, [60, 24]), [1, 1, 0, 0]);
}

#[test]
fn a_surface_of_genus_three() {
    agree("genus 3", &windows(3, 8, 30), [1, 3, 4, 0]);
}

/// A flat frame of unit cubes with some windows in a row, each square cut into `fine` by `fine`,
/// and its corners rounded by moving each vertex `rounds` times to the middle of its neighbours.
fn windows(count: i32, fine: i32, rounds: usize) -> Mesh {
    let has = |[x, y, z]: [i32; 3]| {
        (0..=3 * count).contains(&x) && (0..=3).contains(&y) && z == 0 && (x % 3 == 0 || y % 3 == 0)
    };
    let mut numbers = std::collections::HashMap::new();
    let mut points: Vec<Vector> = Vec::new();
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    for cube in
        (0..=3 * count).flat_map(|x| (0..=3).map(move |y| [x, y, 0])).filter(|&cube| has(cube))
    {
        for (axis, side) in (0..3).flat_map(|axis| [(axis, 0), (axis, 1)]) {
            let mut beyond = cube;
            beyond[axis] += 2 * side - 1;
            if has(beyond) {
                continue;
            }
            let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
            for (i, j) in (0..fine).flat_map(|i| (0..fine).map(move |j| (i, j))) {
                let [a, b, c, d] = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[right, up]| {
                    let mut at = cube.map(|value| value * fine);
                    at[axis] += side * fine;
                    at[u] += i + right;
                    at[v] += j + up;
                    *numbers.entry(at).or_insert_with(|| {
                        points.push(at.map(|value| f64::from(value) / f64::from(fine)));
                        points.len() as u32 - 1
                    })
                });
                triangles.extend(if side == 1 {
                    [[a, b, c], [a, c, d]]
                } else {
                    [[a, c, b], [a, d, c]]
                });
            }
        }
    }
    for _ in 0..rounds {
        let mut sums = vec![([0.0; 3], 0.0); points.len()];
        for (vertex, next) in triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]) {
            let (sum, count) = &mut sums[vertex as usize];
            (0..3).for_each(|axis| sum[axis] += points[next as usize][axis]);
            *count += 1.0;
        }
        points = sums.into_iter().map(|(sum, count)| sum.map(|value| value / count)).collect();
    }
    let cells = Cells::uniform(CellType::Triangle, triangles.concat()).expect("triangles");
    Mesh::new(points, cells, FeatureSource::SharpEdges).expect("a mesh")
}

#[test]
fn the_generated_meshes() {
    let cases = [
        ("pipe-1", [1, 0, 0, 2]),
        ("bypass-0", [1, 1, 2, 2]),
        ("cylinder-coarse", [1, 0, 0, 2]),
        ("boundary-layer", [1, 0, 0, 2]),
    ];
    let names = cases.map(|(name, _)| name);
    for ((name, counts), file) in cases.into_iter().zip(generated_surfaces(&names)) {
        let mesh = read_mesh(&file).expect("a mesh").mesh;
        agree(name, &triangles_of(&mesh), counts);
    }
}

/// The triangles of a surface mesh alone.
fn triangles_of(mesh: &Mesh) -> Mesh {
    let surface = Surface::extract(mesh, &FeatureSettings::default()).expect("a surface");
    let cells =
        Cells::uniform(CellType::Triangle, surface.triangles().concat()).expect("triangles");
    Mesh::new(surface.points().to_vec(), cells, FeatureSource::SharpEdges).expect("a mesh")
}
