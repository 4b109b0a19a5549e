use std::sync::Arc;

use super::super::rotation::{Rotation, direction};
use super::*;
use crate::features::FeatureSettings;
use crate::mesh::{CellType, Cells, FeatureSource, Mesh};
use crate::shapes;
use crate::vector::{cross, dot, subtract};

fn line(from: Vector, to: Vector, steps: usize) -> Vec<Vector> {
    let at = |step: usize| {
        add(scale(from, 1.0 - step as f64 / steps as f64), scale(to, step as f64 / steps as f64))
    };
    (0..=steps).map(at).collect()
}

fn surface_of(mesh: &Mesh) -> Arc<Surface> {
    Arc::new(Surface::extract(mesh, &FeatureSettings::default()).unwrap())
}

fn nearest(nodes: &[Vector], point: Vector) -> u32 {
    let away = |node: &Vector| dot(subtract(*node, point), subtract(*node, point));
    let nearest = (0..nodes.len()).min_by(|&a, &b| away(&nodes[a]).total_cmp(&away(&nodes[b])));
    nearest.unwrap() as u32
}

/// A tube around an axis and its skeleton: one curve through `nodes`, which may be others than
/// those of the axis.
fn tube(axis: &[Vector], nodes: Vec<Vector>) -> (Arc<Surface>, Arc<Skeleton>) {
    let surface = surface_of(&shapes::tube(axis, 1.0, 48));
    let carriers = surface.points().iter().map(|&point| nearest(&nodes, point)).collect();
    let curve = (0..nodes.len() as u32).collect();
    (surface, Arc::new(Skeleton::new(nodes, vec![curve], carriers).unwrap()))
}

struct Case {
    surface: Arc<Surface>,
    skeleton: Arc<Skeleton>,
    held: Vec<bool>,
    moves: Vec<(usize, Vector)>,
    below: Vec<Vector>,
}

impl Case {
    fn new(
        (surface, skeleton): (Arc<Surface>, Arc<Skeleton>),
        moves: Vec<(usize, Vector)>,
    ) -> Self {
        let count = surface.points().len();
        Self { surface, skeleton, held: vec![false; count], moves, below: vec![[0.0; 3]; count] }
    }

    fn displacement(&self, skinning: Skinning) -> Vec<Vector> {
        let dragged: Vec<usize> = self.moves.iter().map(|(node, _)| *node).collect();
        let by: Vec<Vector> = self.moves.iter().map(|(_, by)| *by).collect();
        let drag = SkeletonDrag::new(&self.skeleton, &dragged).unwrap();
        let skin =
            Skin::new(self.surface.clone(), self.skeleton.clone(), drag, &self.held, skinning)
                .unwrap();
        skin.displacement(&by, &self.below)
    }

    fn shape(&self, skinning: Skinning) -> Vec<Vector> {
        self.surface
            .points()
            .iter()
            .zip(self.displacement(skinning))
            .map(|(&point, moved)| add(point, moved))
            .collect()
    }

    fn bent_nodes(&self) -> Vec<Vector> {
        let dragged: Vec<usize> = self.moves.iter().map(|(node, _)| *node).collect();
        let by: Vec<Vector> = self.moves.iter().map(|(_, by)| *by).collect();
        let moved = SkeletonDrag::new(&self.skeleton, &dragged).unwrap().displacement(&by);
        self.skeleton.nodes().iter().zip(moved).map(|(&node, moved)| add(node, moved)).collect()
    }

    /// The area of the cross-section at each inner node of the bent curve, in the plane normal to
    /// it, by that of the tube.
    fn areas(&self, skinning: Skinning) -> Vec<f64> {
        let (shape, nodes) = (self.shape(skinning), self.bent_nodes());
        let area = |node: usize| {
            let normal = direction(subtract(nodes[node + 1], nodes[node - 1])).unwrap();
            section(self.surface.triangles(), &shape, nodes[node], normal, 2.0)
        };
        let whole = 24.0 * (std::f64::consts::TAU / 48.0).sin();
        (2..nodes.len() - 2).map(|node| area(node) / whole).collect()
    }
}

/// The area that a plane cuts out of a closed surface within some distance of a point: the sum of
/// the signed triangles between the point and each cut, which follow the boundary counter-clockwise
/// about the normal.
fn section(
    triangles: &[[u32; 3]],
    points: &[Vector],
    center: Vector,
    normal: Vector,
    within: f64,
) -> f64 {
    let mut twice = 0.0;
    for triangle in triangles {
        let corners = triangle.map(|vertex| subtract(points[vertex as usize], center));
        if corners.iter().any(|corner| dot(*corner, *corner) > within * within) {
            continue;
        }
        let heights = corners.map(|corner| dot(corner, normal));
        let (mut enters, mut leaves) = (None, None);
        for side in 0..3 {
            let [a, b] = [side, (side + 1) % 3];
            let cut = || {
                let t = heights[a] / (heights[a] - heights[b]);
                add(scale(corners[a], 1.0 - t), scale(corners[b], t))
            };
            if heights[a] >= 0.0 && heights[b] < 0.0 {
                leaves = Some(cut());
            } else if heights[a] < 0.0 && heights[b] >= 0.0 {
                enters = Some(cut());
            }
        }
        if let (Some(enters), Some(leaves)) = (enters, leaves) {
            twice += dot(cross(leaves, enters), normal);
        }
    }
    0.5 * twice
}

fn straight_tube(nodes: usize) -> (Arc<Surface>, Arc<Skeleton>) {
    let [from, to] = [[0.0; 3], [0.0, 0.0, 10.0]];
    tube(&line(from, to, 160), line(from, to, nodes))
}

fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, f64::max)
}

fn worst(areas: &[f64]) -> f64 {
    largest(areas.iter().map(|area| (area - 1.0).abs()))
}

fn difference(a: &[Vector], b: &[Vector]) -> f64 {
    largest(a.iter().zip(b).map(|(&a, &b)| distance_of(a, b)))
}

fn distance_of(a: Vector, b: Vector) -> f64 {
    dot(subtract(a, b), subtract(a, b)).sqrt()
}

#[test]
fn a_tube_bent_by_90_degrees_with_one_drag_keeps_its_cross_sections() {
    // The slope of the curve at its ends is 3 by / length: 45 degrees there, 90 between them.
    let case = Case::new(straight_tube(80), vec![(40, [10.0 / 3.0, 0.0, 0.0])]);
    let nodes = case.bent_nodes();
    let [start, end] = [subtract(nodes[1], nodes[0]), subtract(nodes[80], nodes[79])]
        .map(|v| direction(v).unwrap());
    assert!(dot(start, end).abs() < 0.01, "90 degrees");

    let smooth = worst(&case.areas(Skinning::Smooth));
    let nearest = worst(&case.areas(Skinning::Nearest));
    assert!(smooth < 0.03, "{smooth}");
    assert!(nearest > 0.2, "{nearest}");
}

#[test]
fn so_does_one_bent_to_a_quarter_of_a_circle() {
    let nodes = straight_tube(40).1.nodes().to_vec();
    // The circle through both ends that turns by 90 degrees in between.
    let radius = 10.0 / 2.0f64.sqrt();
    let on_circle = |node: usize| {
        let angle = std::f64::consts::FRAC_PI_2 * (node as f64 / 40.0 - 0.5);
        [radius * (angle.cos() - 0.5f64.sqrt()), 0.0, 5.0 + radius * angle.sin()]
    };
    let moves = (1..40).map(|node| (node, subtract(on_circle(node), nodes[node]))).collect();
    let case = Case::new(straight_tube(40), moves);
    let smooth = worst(&case.areas(Skinning::Smooth));
    let nearest = worst(&case.areas(Skinning::Nearest));
    assert!(smooth < 0.01, "{smooth}");
    assert!(nearest > 0.2, "{nearest}");
}

#[test]
fn so_does_a_bent_tube_that_is_made_straight_and_one_with_a_rough_skeleton() {
    let arc: Vec<Vector> = (0..=80)
        .map(|step| std::f64::consts::FRAC_PI_2 * f64::from(step) / 80.0)
        .map(|angle| [6.0 * angle.cos(), 6.0 * angle.sin(), 0.0])
        .collect();
    let chord = line(arc[0], arc[80], 80);
    let moves = (1..80).map(|node| (node, subtract(chord[node], arc[node]))).collect();
    let case = Case::new(tube(&arc, arc.clone()), moves);
    assert!(worst(&case.areas(Skinning::Smooth)) < 0.03, "{:?}", case.areas(Skinning::Smooth));
    assert!(worst(&case.areas(Skinning::Nearest)) > 0.2);

    // Nodes off the axis by some hundredths of the radius, this way and that.
    let rough: Vec<Vector> = line([0.0; 3], [0.0, 0.0, 10.0], 40)
        .into_iter()
        .enumerate()
        .map(|(node, [_, _, z])| {
            [0.03 * (7.3 * node as f64).sin(), 0.03 * (3.1 * node as f64).cos(), z]
        })
        .collect();
    let even = Case::new(straight_tube(40), vec![(20, [3.0, 0.0, 0.0])]);
    let rough =
        Case::new(tube(&line([0.0; 3], [0.0, 0.0, 10.0], 160), rough), vec![(20, [3.0, 0.0, 0.0])]);
    let (even, rough) = (even.displacement(Skinning::Smooth), rough.displacement(Skinning::Smooth));
    assert!(difference(&even, &rough) < 0.1, "{}", difference(&even, &rough));
}

#[test]
fn how_densely_nodes_lie_makes_no_difference() {
    let moved = |nodes: usize| {
        Case::new(straight_tube(nodes), vec![(nodes / 2, [2.0, 1.0, 0.0])])
            .displacement(Skinning::Smooth)
    };
    let finest = moved(320);
    let errors = [10, 20, 40, 80].map(|nodes| difference(&moved(nodes), &finest));
    assert!(errors[0] < 0.1 && errors[3] < 2e-3, "{errors:?}");
    assert!(errors.windows(2).all(|pair| pair[1] < 0.5 * pair[0]), "{errors:?}");
}

#[test]
fn dragging_by_zero_and_held_vertices_are_exact_zeros() {
    for skinning in [Skinning::Smooth, Skinning::Nearest] {
        let mut case = Case::new(straight_tube(40), vec![(20, [0.0; 3]), (11, [0.0; 3])]);
        assert!(case.displacement(skinning).iter().all(|moved| *moved == [0.0; 3]));

        case.moves = vec![(20, [0.0, 2.0, 0.0])];
        let free = case.displacement(skinning);
        for (held, point) in case.held.iter_mut().zip(case.surface.points()) {
            *held = point[2] < 2.0;
        }
        let moved = case.displacement(skinning);
        for ((point, moved), free) in case.surface.points().iter().zip(&moved).zip(&free) {
            if point[2] < 2.0 {
                assert_eq!(*moved, [0.0; 3]);
            } else if point[2] > 3.1 {
                assert_eq!(moved, free);
            }
        }
        assert!(
            steepest(&case.surface, &moved) < if skinning == Skinning::Smooth { 3.0 } else { 6.0 }
        );
    }
}

/// The largest difference of two neighbours' displacements by their distance.
fn steepest(surface: &Surface, moved: &[Vector]) -> f64 {
    largest(surface.triangles().iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]).map(
        |(a, b)| {
            let [a, b] = [a as usize, b as usize];
            distance_of(moved[a], moved[b]) / distance_of(surface.points()[a], surface.points()[b])
        },
    ))
}

#[test]
fn a_loop_is_carried_as_a_body() {
    let nodes: Vec<Vector> = (0..32)
        .map(|node| std::f64::consts::TAU * f64::from(node) / 32.0)
        .map(|angle| [3.0 * angle.cos(), 3.0 * angle.sin(), 0.0])
        .collect();
    let surface = surface_of(&shapes::torus(3.0, 1.0, [96, 32]));
    let carriers = surface.points().iter().map(|&point| nearest(&nodes, point)).collect();
    let curve = (0..32).chain([0]).collect();
    let pair = (surface, Arc::new(Skeleton::new(nodes, vec![curve], carriers).unwrap()));
    for moved in Case::new(pair.clone(), vec![(7, [1.0, -2.0, 0.5])]).displacement(Skinning::Smooth)
    {
        assert!(distance_of(moved, [1.0, -2.0, 0.5]) < 1e-12, "{moved:?}");
    }
    // Bent out of its plane, it is the same about both dragged nodes.
    let case = Case::new(
        pair,
        vec![(0, [0.0, 0.0, 2.0]), (16, [0.0, 0.0, 2.0]), (8, [0.0; 3]), (24, [0.0; 3])],
    );
    let moved = case.displacement(Skinning::Smooth);
    for (point, value) in case.surface.points().iter().zip(&moved) {
        let mirror = case
            .surface
            .points()
            .iter()
            .position(|other| distance_of(*other, [-point[0], -point[1], point[2]]) < 1e-9);
        assert!((moved[mirror.unwrap()][2] - value[2]).abs() < 1e-9);
    }
    assert!(steepest(&case.surface, &moved) < 2.0);
}

#[test]
fn what_was_moved_before_is_turned_with_it() {
    let mut case =
        Case::new(straight_tube(32), vec![(12, [1.0, 2.0, 0.5]), (24, [-1.0, 0.0, 0.0])]);
    let first = case.displacement(Skinning::Smooth);
    // Carried along as a body, the curve bends as before.
    case.below = vec![[3.0, -1.0, 2.0]; first.len()];
    assert!(difference(&case.displacement(Skinning::Smooth), &first) < 1e-12);
    // Turned as a body and dragged as turned, everything is turned.
    let turn = Rotation::about(direction([1.0, 2.0, -0.5]).unwrap(), 1.2);
    case.below = case.surface.points().iter().map(|&point| turn.change(point)).collect();
    for (_, by) in &mut case.moves {
        *by = turn.apply(*by);
    }
    let turned: Vec<Vector> = first.iter().map(|&moved| turn.apply(moved)).collect();
    let found = difference(&case.displacement(Skinning::Smooth), &turned);
    assert!(found < 1e-12, "{found}");
    // A tube that was widened before keeps the wider cross-sections.
    case.moves = vec![(16, [10.0 / 3.0, 0.0, 0.0])];
    case.below = case.surface.points().iter().map(|&[x, y, _]| [0.5 * x, 0.5 * y, 0.0]).collect();
    let moved = case.displacement(Skinning::Smooth);
    let shape: Vec<Vector> = (0..moved.len())
        .map(|vertex| add(add(case.surface.points()[vertex], case.below[vertex]), moved[vertex]))
        .collect();
    let nodes = case.bent_nodes();
    for node in 4..28 {
        let normal = direction(subtract(nodes[node + 1], nodes[node - 1])).unwrap();
        let area = section(case.surface.triangles(), &shape, nodes[node], normal, 2.5);
        assert!(
            (area / 2.25 / (24.0 * (std::f64::consts::TAU / 48.0).sin()) - 1.0).abs() < 0.03,
            "{node} {area}"
        );
    }
}

/// A bar along x with a leg along y, of `fine` cubes a unit, with the skeleton one expects of it.
fn tee(fine: usize) -> (Arc<Surface>, Arc<Skeleton>) {
    let counts = [12 * fine, 8 * fine, 2 * fine];
    let mesh = shapes::box_of_hexahedra(counts, [-6.0, -1.0, -1.0], [6.0, 7.0, 1.0]);
    let mut connectivity = Vec::new();
    for (_, vertices) in mesh.cells().iter() {
        let center = scale(
            vertices.iter().fold([0.0; 3], |sum, &vertex| add(sum, mesh.points()[vertex as usize])),
            0.125,
        );
        if center[1] < 1.0 || center[0].abs() < 1.0 {
            connectivity.extend(vertices);
        }
    }
    let cells = Cells::uniform(CellType::Hexahedron, connectivity).unwrap();
    let surface =
        surface_of(&Mesh::new(mesh.points().to_vec(), cells, FeatureSource::SharpEdges).unwrap());
    let mut nodes = line([-6.0, 0.0, 0.0], [6.0, 0.0, 0.0], 48);
    nodes.extend(line([0.0, 0.25, 0.0], [0.0, 7.0, 0.0], 27));
    let leg = [24].into_iter().chain(49..=76).collect();
    // As skeletons do, the leg carries a bit of the bar around it.
    let carriers = surface.points().iter().map(|&point| nearest(&nodes, point)).collect();
    let curves = vec![(0..=24).collect(), (24..=48).collect(), leg];
    (surface, Arc::new(Skeleton::new(nodes, curves, carriers).unwrap()))
}

#[test]
fn a_branch_is_met_without_a_jump_and_the_rest_does_not_move() {
    let steep = |fine: usize, skinning| {
        let case = Case::new(tee(fine), vec![(62, [1.5, 0.0, 0.5])]);
        let moved = case.displacement(skinning);
        for (point, moved) in case.surface.points().iter().zip(&moved) {
            if point[0].abs() > 3.0 {
                assert_eq!(*moved, [0.0; 3], "{point:?}");
            }
        }
        assert!(moved.iter().any(|moved| moved[0] > 1.4));
        steepest(&case.surface, &moved)
    };
    let [coarse, fine] = [steep(2, Skinning::Smooth), steep(8, Skinning::Smooth)];
    assert!(coarse < 2.0 && fine < 2.0, "{coarse} {fine}");
    let [coarse, fine] = [steep(2, Skinning::Nearest), steep(8, Skinning::Nearest)];
    assert!(fine > 2.0 * coarse, "where nearest joint tears: {coarse} {fine}");
}

#[test]
fn skeletons_of_other_surfaces_are_refused() {
    let (surface, skeleton) = straight_tube(10);
    let drag = SkeletonDrag::new(&skeleton, &[5]).unwrap();
    let error = Skin::new(surface, skeleton, drag, &[false; 3], Skinning::Smooth).unwrap_err();
    assert!(error.to_string().ends_with("and 3 were said to be held or not"), "{error}");
}
