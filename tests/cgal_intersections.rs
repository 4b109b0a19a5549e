//! The self-intersections found are those that CGAL finds.

use tombolo_deform::features::FeatureSettings;
use tombolo_deform::mesh::{CellType, Cells, FeatureSource, Mesh, Vector};
use tombolo_deform::shapes;
use tombolo_deform::surface::{Surface, check};
use tombolo_tests::{cgal, off};

/// The triangles of a mesh's surface, far apart from each other in the reference: so that every
/// intersection is new.
fn triangles_of(mesh: &Mesh) -> Surface {
    let surface = Surface::extract(mesh, &FeatureSettings::default()).expect("a surface");
    let cells =
        Cells::uniform(CellType::Triangle, surface.triangles().concat()).expect("triangles");
    let mesh =
        Mesh::new(surface.points().to_vec(), cells, FeatureSource::SharpEdges).expect("a mesh");
    Surface::extract(&mesh, &FeatureSettings::default()).expect("a surface")
}

fn theirs(surface: &Surface, shape: &[Vector]) -> Vec<[u32; 2]> {
    cgal("intersections", &[], &off(shape, surface.triangles()))
        .lines()
        .map(|line| {
            let pair: Vec<u32> =
                line.split(' ').map(|word| word.parse().expect("a face")).collect();
            [pair[0], pair[1]]
        })
        .collect()
}

/// Compares a shape with what CGAL says of it; how many pairs there are.
fn agree(name: &str, surface: &Surface, shape: &[Vector]) -> usize {
    assert!(theirs(surface, surface.points()).is_empty(), "{name}: the reference is sound");
    let expected = theirs(surface, shape);
    let found = check(surface, surface.points(), shape).intersections;
    assert!(!found.more, "{name}");
    assert_eq!(found.count, expected.len(), "{name}");
    let first: Vec<[u32; 2]> = found.first.iter().map(|pair| pair.faces).collect();
    assert_eq!(first, expected[..expected.len().min(16)], "{name}");
    expected.len()
}

/// Numbers from -1 to 1 that are the same in every run.
fn noise(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

#[test]
fn on_surfaces_pushed_about_at_random() {
    let torus = triangles_of(&shapes::torus(1.0, 0.3, [30, 16]));
    let block = triangles_of(&shapes::box_of_tets([6, 6, 6], [0.0; 3], [1.0; 3]));
    let mut met = 0;
    for (name, surface) in [("torus", &torus), ("box", &block)] {
        for seed in 0..12 {
            let mut random = noise(seed + 1);
            let size = 0.02 * f64::from(1 << (seed % 6)) * 0.25;
            let shape: Vec<Vector> = surface
                .points()
                .iter()
                .map(|point| point.map(|value| value + size * random()))
                .collect();
            met += agree(&format!("{name} with noise {seed}"), surface, &shape);
        }
    }
    assert!(met > 1000, "{met}");
}

#[test]
fn on_smooth_deformations() {
    let torus = triangles_of(&shapes::torus(1.0, 0.3, [40, 20]));
    let pinched = |depth: f64| -> Vec<Vector> {
        let pinch = |x: f64| depth * (-20.0 * (x - 1.0) * (x - 1.0)).exp();
        torus.points().iter().map(|&[x, y, z]| [x, y, z * (1.0 - pinch(x))]).collect()
    };
    assert_eq!(agree("a pinch that leaves room", &torus, &pinched(0.9)), 0);
    assert!(agree("a pinch through itself", &torus, &pinched(1.4)) > 0);
    let twisted: Vec<Vector> = torus
        .points()
        .iter()
        .map(|&[x, y, z]| [x, y * (1.0 - 1.3 * (-4.0 * x * x).exp()), z])
        .collect();
    assert!(agree("a ring pressed through itself", &torus, &twisted) > 0);
}

#[test]
fn on_contacts_and_overlaps_in_one_plane() {
    // Coordinates with few digits, so that faces lie in exactly one plane, touch in a vertex, or
    // share a line.
    let block = triangles_of(&shapes::box_of_tets([4, 4, 4], [0.0; 3], [4.0; 3]));
    let mut met = 0;
    for seed in 0..12 {
        let mut random = noise(seed + 100);
        let shape: Vec<Vector> = block
            .points()
            .iter()
            .map(|point| {
                let moves = random() > 0.6;
                point
                    .map(|value| if moves { value + (1.5 * random()).round() * 0.5 } else { value })
            })
            .collect();
        met += agree(&format!("a grid pushed about {seed}"), &block, &shape);
    }
    assert!(met > 100, "{met}");
    let flat: Vec<Vector> =
        block.points().iter().map(|&[x, y, z]| [x, y, if z > 0.0 { 0.25 } else { 0.0 }]).collect();
    agree("a box pressed flat", &block, &flat);
}
