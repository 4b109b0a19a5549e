//! Extraction on shapes whose skeletons are known, and on input that has none.

use proptest::prelude::*;

use tombolo_deform::cancellation::Cancellation;
use tombolo_deform::features::FeatureSettings;
use tombolo_deform::mesh::{CellType, Cells, FeatureSource, Mesh, Vector};
use tombolo_deform::shapes;
use tombolo_deform::skeleton::{Skeleton, SkeletonError, SkeletonSettings};
use tombolo_deform::surface::Surface;

fn surface_of(points: Vec<Vector>, triangles: &[[u32; 3]]) -> Surface {
    let cells = Cells::uniform(CellType::Triangle, triangles.concat()).unwrap();
    Surface::extract(
        &Mesh::new(points, cells, FeatureSource::SharpEdges).unwrap(),
        &FeatureSettings::default(),
    )
    .unwrap()
}

fn extract(surface: &Surface) -> Result<Skeleton, SkeletonError> {
    let skeleton = Skeleton::extract(surface, &SkeletonSettings::default())?;
    assert_eq!(skeleton.node_of_vertex().len(), surface.points().len());
    Ok(skeleton)
}

/// Pieces, loops, branch nodes and ends.
fn counts(skeleton: &Skeleton) -> [usize; 4] {
    [
        skeleton.component_count(),
        skeleton.loop_count(),
        skeleton.branch_count(),
        skeleton.end_count(),
    ]
}

/// A tube about the z axis without its ends: `rings` rings of `about` vertices from z = 0 to
/// `height`.
fn open_tube(radius: f64, height: f64, [rings, about]: [u32; 2]) -> (Vec<Vector>, Vec<[u32; 3]>) {
    let mut points = Vec::new();
    let mut triangles = Vec::new();
    for ring in 0..rings {
        for place in 0..about {
            let turn = std::f64::consts::TAU * f64::from(place) / f64::from(about);
            let z = height * f64::from(ring) / f64::from(rings - 1);
            points.push([radius * turn.cos(), radius * turn.sin(), z]);
            if ring > 0 {
                let [a, b] = [place, (place + 1) % about].map(|place| (ring - 1) * about + place);
                triangles.extend([[a, b, b + about], [a, b + about, a + about]]);
            }
        }
    }
    (points, triangles)
}

/// The surface of a set of unit cubes of a grid, every square split in two and `fine` times finer.
fn cubes(wanted: &[[i32; 3]], fine: i32) -> (Vec<Vector>, Vec<[u32; 3]>) {
    let has = |cube: [i32; 3]| wanted.contains(&cube);
    let mut numbers = std::collections::HashMap::new();
    let mut points = Vec::new();
    let mut triangles = Vec::new();
    for &cube in wanted {
        for axis in 0..3 {
            for side in [0, 1] {
                let mut beyond = cube;
                beyond[axis] += 2 * side - 1;
                if has(beyond) {
                    continue;
                }
                let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
                for i in 0..fine {
                    for j in 0..fine {
                        let corners = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[a, b]| {
                            let mut at = cube.map(|value| value * fine);
                            at[axis] += side * fine;
                            at[u] += i + a;
                            at[v] += j + b;
                            *numbers.entry(at).or_insert_with(|| {
                                points.push(at.map(|value| f64::from(value) / f64::from(fine)));
                                points.len() as u32 - 1
                            })
                        });
                        let [a, b, c, d] = if side == 1 {
                            corners
                        } else {
                            [corners[0], corners[3], corners[2], corners[1]]
                        };
                        triangles.extend([[a, b, c], [a, c, d]]);
                    }
                }
            }
        }
    }
    (points, triangles)
}

/// A ladder of cubes with `holes` holes.
fn ladder(holes: i32) -> Vec<[i32; 3]> {
    let width = 2 * holes + 1;
    (0..width)
        .flat_map(|x| (0..3).map(move |y| [x, y, 0]))
        .filter(|[x, y, _]| x % 2 == 0 || *y != 1)
        .collect()
}

#[test]
fn a_torus_has_its_core() {
    let mesh = shapes::torus(1.0, 0.3, [60, 24]);
    let surface = Surface::extract(&mesh, &FeatureSettings::default()).unwrap();
    let skeleton = extract(&surface).unwrap();
    assert_eq!(counts(&skeleton), [1, 1, 0, 0]);
    for &[x, y, z] in skeleton.nodes() {
        assert!((x.hypot(y) - 1.0).hypot(z) < 0.03, "{x} {y} {z}");
    }
    for (&point, &node) in surface.points().iter().zip(skeleton.node_of_vertex()) {
        let carrier = skeleton.nodes()[node as usize];
        assert!(
            (0..3).map(|axis| (point[axis] - carrier[axis]).powi(2)).sum::<f64>().sqrt() < 0.45
        );
    }
    assert_eq!(extract(&surface).unwrap(), skeleton, "the same input gives the same bits");
}

#[test]
fn an_open_tube_has_its_axis() {
    let (points, triangles) = open_tube(0.5, 5.0, [40, 20]);
    let skeleton = extract(&surface_of(points, &triangles)).unwrap();
    assert_eq!(counts(&skeleton), [1, 0, 0, 2]);
    let reach = skeleton.nodes().iter().fold([f64::INFINITY, 0.0f64], |[low, high], node| {
        assert!(node[0].hypot(node[1]) < 0.08, "{node:?}");
        [low.min(node[2]), high.max(node[2])]
    });
    assert!(reach[0] < 0.6 && reach[1] > 4.4, "{reach:?}");
}

#[test]
fn curves_end_in_the_middle_of_caps_round_or_flat() {
    for (squeeze, reach) in [(1.0, 0.35..0.6), (0.5, 0.2..0.65)] {
        let (points, triangles) = cubes(&(0..12).map(|x| [x, 0, 0]).collect::<Vec<_>>(), 6);
        // A round tube of radius 0.5, or an elliptic one, with flat caps: squares become discs.
        let round = |[x, y, z]: Vector| {
            let [y, z] = [y - 0.5, z - 0.5];
            let size = if y == 0.0 && z == 0.0 { 1.0 } else { y.abs().max(z.abs()) / y.hypot(z) };
            [x, size * y, squeeze * size * z]
        };
        let skeleton =
            extract(&surface_of(points.into_iter().map(round).collect(), &triangles)).unwrap();
        assert_eq!(counts(&skeleton), [1, 0, 0, 2]);
        for &[x, y, z] in skeleton.nodes() {
            assert!(y.hypot(z) < 0.1, "{x} {y} {z}");
        }
        for end in skeleton.curves()[0].ends().map(|end| skeleton.nodes()[end as usize]) {
            let away = end[0].min(12.0 - end[0]);
            assert!(reach.contains(&away), "{end:?} is {away} from the cap");
        }
    }
}

#[test]
fn numbers_of_vertices_and_triangles_do_not_matter() {
    let tee: Vec<[i32; 3]> =
        (-4..=4).map(|x| [x, 0, 0]).chain((1..=4).map(|y| [0, y, 0])).collect();
    let (points, triangles) = cubes(&tee, 3);
    let points: Vec<Vector> = points
        .into_iter()
        .enumerate()
        .map(|(vertex, point)| noisy(point, vertex, 5, 0.1))
        .collect();
    let skeleton = extract(&surface_of(points.clone(), &triangles)).unwrap();
    for stride in [7, 1001] {
        // A number without a factor in common with the counts visits all of them.
        let number = |place: usize, count: usize| {
            let stride = (stride..)
                .find(|stride| {
                    (2..=*stride).all(|by| {
                        !usize::is_multiple_of(*stride, by) || !usize::is_multiple_of(count, by)
                    })
                })
                .unwrap();
            place * stride % count
        };
        let mut shuffled = vec![[0.0; 3]; points.len()];
        (0..points.len())
            .for_each(|vertex| shuffled[number(vertex, points.len())] = points[vertex]);
        let mut turned = vec![[0; 3]; triangles.len()];
        for (place, triangle) in triangles.iter().enumerate() {
            let mut triangle = triangle.map(|vertex| number(vertex as usize, points.len()) as u32);
            triangle.rotate_left(place % 3);
            turned[number(place, triangles.len())] = triangle;
        }
        let other = extract(&surface_of(shuffled, &turned)).unwrap();
        assert_eq!((other.nodes(), other.curves()), (skeleton.nodes(), skeleton.curves()));
        for (vertex, node) in skeleton.node_of_vertex().iter().enumerate() {
            assert_eq!(other.node_of_vertex()[number(vertex, points.len())], *node);
        }
    }
}

#[test]
fn holes_become_loops_and_a_crossing_becomes_a_branch_node() {
    for holes in 0..4 {
        let (points, triangles) = cubes(&ladder(holes), 4);
        let found = counts(&extract(&surface_of(points, &triangles)).unwrap());
        assert_eq!(found[..2], [1, holes as usize], "{holes} holes: {found:?}");
        if holes >= 2 {
            assert_eq!(found[2], 2 * (holes as usize - 1), "{holes} holes: {found:?}");
        }
    }
    let tee: Vec<[i32; 3]> =
        (-4..=4).map(|x| [x, 0, 0]).chain((1..=4).map(|y| [0, y, 0])).collect();
    let (points, triangles) = cubes(&tee, 3);
    assert_eq!(counts(&extract(&surface_of(points, &triangles)).unwrap()), [1, 0, 1, 3]);
}

#[test]
fn each_piece_has_its_own_whichever_way_it_is_turned() {
    let (mut points, mut triangles) = open_tube(0.5, 5.0, [20, 12]);
    let (other, mut turned) = cubes(&ladder(1), 3);
    let offset = points.len() as u32;
    points.extend(other.into_iter().map(|[x, y, z]| [x + 20.0, y, z]));
    turned.iter_mut().step_by(2).for_each(|triangle| triangle.swap(0, 1));
    triangles.extend(turned.into_iter().map(|triangle| triangle.map(|vertex| vertex + offset)));
    let surface = surface_of(points, &triangles);
    let skeleton = extract(&surface).unwrap();
    assert_eq!(counts(&skeleton), [2, 1, 0, 2]);
    for (point, &node) in surface.points().iter().zip(skeleton.node_of_vertex()) {
        assert_eq!(point[0] > 10.0, skeleton.nodes()[node as usize][0] > 10.0);
    }
}

#[test]
fn the_last_digits_add_no_branches() {
    for (shape, fine, expected) in [(ladder(1), 10, [1, 1, 0, 0]), (ladder(3), 6, [1, 3, 4, 0])] {
        let (points, triangles) = cubes(&shape, fine);
        for turn in [1e-9f64, 0.3] {
            let (sine, cosine) = turn.sin_cos();
            let turned = points
                .iter()
                .map(|&[x, y, z]| [cosine * x - sine * y, sine * x + cosine * y, z])
                .collect();
            let surface = surface_of(turned, &triangles);
            // Neither as they are nor refined.
            for least_vertices in [2000, SkeletonSettings::default().least_vertices] {
                let settings = SkeletonSettings { least_vertices, ..SkeletonSettings::default() };
                let skeleton = Skeleton::extract(&surface, &settings).unwrap();
                assert_eq!(counts(&skeleton), expected, "{fine} {turn} {least_vertices}");
            }
        }
    }
}

#[test]
fn a_cube_is_one_node_at_any_size_and_a_tetrahedron_too() {
    let (points, triangles) = cubes(&[[0, 0, 0]], 6);
    for size in [1e-150, 1.0, 1e150] {
        let scaled = points.iter().map(|point| point.map(|value| value * size)).collect();
        let skeleton = extract(&surface_of(scaled, &triangles)).unwrap();
        assert_eq!((counts(&skeleton), skeleton.nodes().len()), ([1, 0, 0, 0], 1));
        assert!(
            skeleton.nodes()[0].iter().all(|value| (value / size - 0.5).abs() < 0.1),
            "{:?}",
            skeleton.nodes()
        );
    }
    let corners = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let skeleton =
        extract(&surface_of(corners, &[[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])).unwrap();
    assert_eq!((skeleton.component_count(), skeleton.loop_count()), (1, 0));
}

#[test]
fn a_thin_shell_is_answered() {
    let mut ring = Vec::new();
    for x in 0..8 {
        for y in 0..8 {
            if x == 0 || y == 0 || x == 7 || y == 7 {
                ring.extend((0..8).map(|z| [x, y, z]));
            }
        }
    }
    let (points, triangles) = cubes(&ring, 2);
    let found = counts(&extract(&surface_of(points, &triangles)).unwrap());
    assert_eq!(found[0], 1);
    assert_eq!(found[1], 1, "{found:?}");
}

#[test]
fn open_edges_that_lie_on_each_other_are_joined() {
    let (points, triangles) = cubes(&ladder(1), 3);
    let apart: Vec<Vector> =
        triangles.iter().flatten().map(|&vertex| points[vertex as usize]).collect();
    let numbered: Vec<[u32; 3]> =
        (0..triangles.len() as u32).map(|face| [3 * face, 3 * face + 1, 3 * face + 2]).collect();
    assert_eq!(counts(&extract(&surface_of(apart, &numbered)).unwrap()), [1, 1, 0, 0]);
}

#[test]
fn what_has_no_inside_is_named() {
    let plate = shapes::plate([6, 4], [0.0; 2], [3.0, 2.0]);
    let plate = Surface::extract(&plate, &FeatureSettings::default()).unwrap();
    assert_eq!(extract(&plate), Err(SkeletonError::Flat { vertex: 0, triangles: 48 }));

    let points =
        vec![[0.0; 3], [0.0, 0.0, 1.0], [1.0, 0.0, 0.5], [-1.0, 0.1, 0.5], [0.1, 1.0, 0.5]];
    let fan = extract(&surface_of(points, &[[0, 1, 2], [1, 0, 3], [1, 0, 4]]));
    assert_eq!(fan, Err(SkeletonError::NonManifoldEdge { edge: [0, 1], faces: 3 }));

    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    for place in 0..24u32 {
        let turn = std::f64::consts::TAU * f64::from(place) / 24.0;
        for side in [-0.3, 0.3] {
            let radius = 2.0 + side * (turn / 2.0).cos();
            points.push([radius * turn.cos(), radius * turn.sin(), side * (turn / 2.0).sin()]);
        }
        let [a, b] = [2 * place, 2 * place + 1];
        let [c, d] = if place == 23 { [1, 0] } else { [a + 2, b + 2] };
        triangles.extend([[a, b, c], [b, d, c]]);
    }
    assert!(matches!(
        extract(&surface_of(points, &triangles)),
        Err(SkeletonError::OneSided { .. })
    ));

    let settings = SkeletonSettings { keep: 0.0, ..SkeletonSettings::default() };
    assert_eq!(
        Skeleton::extract(&plate, &settings),
        Err(SkeletonError::Setting { name: "keep", value: 0.0 })
    );
}

#[test]
fn touching_and_crossing_sheets_are_answered() {
    // Two cubes that touch in a vertex alone are parted there.
    let (points, triangles) = cubes(&[[0, 0, 0], [1, 1, 1]], 3);
    assert_eq!(extract(&surface_of(points, &triangles)).unwrap().component_count(), 2);
    // A tube that runs through itself.
    let (points, triangles) = open_tube(0.5, 12.0, [80, 16]);
    let bent = points
        .into_iter()
        .map(|[x, y, z]| {
            let turn = z * 0.75;
            [(2.0 + x) * turn.cos(), (2.0 + x) * turn.sin(), y + 0.02 * z]
        })
        .collect();
    assert_eq!(counts(&extract(&surface_of(bent, &triangles)).unwrap()), [1, 0, 0, 2]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn noise_does_not_change_a_torus(seed in 0u64..1000, size in 0.0..0.15f64) {
        let mesh = shapes::torus(1.0, 0.3, [40, 16]);
        let points = mesh.points().iter().enumerate().map(|(vertex, point)| noisy(*point, vertex, seed, size * 0.12)).collect();
        let triangles: Vec<[u32; 3]> = mesh.cells().iter().map(|(_, face)| [face[0], face[1], face[2]]).collect();
        let skeleton = extract(&surface_of(points, &triangles)).unwrap();
        prop_assert_eq!(skeleton.component_count(), 1);
        prop_assert_eq!(skeleton.loop_count(), 1);
        for &[x, y, z] in skeleton.nodes() {
            prop_assert!((x.hypot(y) - 1.0).hypot(z) < 0.2);
        }
    }

    #[test]
    fn noise_beyond_all_bounds_is_answered(seed in 0u64..1000, size in 0.1..10.0f64) {
        let (points, triangles) = cubes(&ladder(1), 2);
        let points = points.into_iter().enumerate().map(|(vertex, point)| noisy(point, vertex, seed, size)).collect();
        if let Ok(skeleton) = extract(&surface_of(points, &triangles)) {
            prop_assert_eq!(skeleton.component_count(), 1);
            prop_assert!(skeleton.loop_count() <= 2);
        }
    }
}

fn noisy(point: Vector, vertex: usize, seed: u64, size: f64) -> Vector {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15)
        ^ (vertex as u64 + 1).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    point.map(|value| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        value + size * ((state >> 11) as f64 / (1u64 << 53) as f64 - 0.5)
    })
}

#[test]
fn a_skeleton_that_is_given_up_is_none() {
    let torus = shapes::torus(1.0, 0.3, [60, 24]);
    let surface = Surface::extract(&torus, &FeatureSettings::default()).unwrap();
    let (settings, cancellation) = (SkeletonSettings::default(), Cancellation::default());
    cancellation.cancel();
    let found = Skeleton::extract_unless(&surface, &settings, &cancellation);
    assert_eq!(found.err(), Some(SkeletonError::Cancelled));
}
