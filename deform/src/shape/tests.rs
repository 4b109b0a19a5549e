//! Shapes of meshes in parts against those of the same meshes on one process.

use crate::{
    communicator::Halo,
    linear::{Convergence, LinearError, LinearSolver, Solver, SparseMatrix, Tolerance},
    quality::{Otherwise, Refusal, judge, quality},
    shapes::{box_of_hexahedra, box_of_tets},
    volume::{Deform, Method},
};
use serde_json::json;

use super::*;
use crate::communicator::{Communicator, threads};
use crate::distributed::tests::dealt;
use crate::distributed::{Part, domain};
use crate::features::FeatureSettings;
use crate::mesh::{CellType, Cells, FeatureSource};

/// How a mesh is dealt out.
#[derive(Clone, Copy)]
struct Deal {
    ranks: usize,
    empty: Option<usize>,
    ghosts: bool,
    shuffle: u64,
    numbers: bool,
}

const PLAIN: Deal = Deal { ranks: 2, empty: None, ghosts: false, shuffle: 0, numbers: true };

const DEALS: [Deal; 5] = [
    Deal { ranks: 1, ..PLAIN },
    PLAIN,
    Deal { ranks: 3, empty: Some(1), ghosts: true, ..PLAIN },
    Deal { ranks: 4, shuffle: 3, numbers: false, ..PLAIN },
    Deal { ranks: 4, empty: Some(0), ghosts: true, shuffle: 5, ..PLAIN },
];

pub(super) fn stack(edits: serde_json::Value) -> Vec<Edit> {
    serde_json::from_value(edits).unwrap()
}

/// Runs a function on each rank's part, with the global number of each of its vertices.
fn on_ranks<T: Send>(
    mesh: &Mesh,
    of_cells: &[usize],
    deal: Deal,
    work: impl Fn(&mut Shaper, &[usize]) -> T + Sync,
) -> Vec<T> {
    threads::run(deal.ranks, |ranks| {
        let mut part = Part::cut(mesh, of_cells, ranks.rank(), deal.ghosts).unwrap();
        if deal.shuffle > 0 {
            part = part.shuffled(deal.shuffle + ranks.rank() as u64);
        }
        let numbers: Vec<usize> =
            part.global_vertices.iter().flatten().map(|&number| number as usize).collect();
        if !deal.numbers {
            (part.global_vertices, part.global_cells) = (None, None);
        }
        let ranks: Arc<dyn Communicator> = Arc::new(ranks);
        let mut shaper = of_part(&ranks, &part);
        work(&mut shaper, &numbers)
    })
}

/// A request from the reference on.
pub(super) fn asked(shaper: &Shaper, edits: &[Edit], deformation: &Deformation) -> Request {
    Request {
        deformation: deformation.clone(),
        ..Request::new(edits, Arc::clone(shaper.reference()))
    }
}

pub(super) fn of_part(ranks: &Arc<dyn Communicator>, part: &Part) -> Shaper {
    let (domain, boundary) = domain(ranks, part, &FeatureSettings::default()).unwrap();
    Shaper::new(domain, boundary).unwrap()
}

pub(super) fn alone(mesh: &Mesh) -> Shaper {
    let mesh = Arc::new(mesh.clone());
    let surface = Arc::new(Surface::extract(&mesh, &FeatureSettings::default()).unwrap());
    Shaper::new(mesh, surface).unwrap()
}

/// The largest difference of a coordinate.
fn apart(part: &[Vector], numbers: &[usize], whole: &[Vector]) -> f64 {
    let pairs = part.iter().zip(numbers);
    pairs
        .flat_map(|(a, &number)| (0..3).map(move |k| (a[k] - whole[number][k]).abs()))
        .fold(0.0, f64::max)
}

fn tight(deform: serde_json::Value) -> Deformation {
    let stage: Deformation = serde_json::from_value(deform).unwrap();
    Deformation { equation: Deform { tolerance: 1e-10, ..stage.equation }, ..stage }
}

#[test]
fn shapes_are_those_of_one_process() {
    let lowered = json!([{"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0.05, 0.02, -0.3]}}]);
    let stretched = json!([{"scale_direction": {"features": ["z-max"], "fixed": ["z-min"], "factors": [1.2, 0.9, 1.0]}}]);
    for (mesh, edits, deform) in [
        (box_of_tets([9, 8, 7], [0.0; 3], [1.0; 3]), &lowered, json!({})),
        (box_of_tets([9, 8, 7], [0.0; 3], [1.0; 3]), &stretched, json!({"method": "harmonic"})),
        (
            box_of_hexahedra([5, 5, 5], [0.0; 3], [1.0; 3]),
            &lowered,
            json!({"method": "harmonic", "improve": 0}),
        ),
        (
            box_of_hexahedra([5, 6, 5], [0.0; 3], [1.0; 3]),
            &lowered,
            json!({"sliding": ["x-min", "y-max"]}),
        ),
        (
            box_of_tets([6, 6, 5], [0.0; 3], [1.0; 3]),
            &lowered,
            json!({"method": "harmonic", "sliding": ["x-max"], "free": ["y-min"]}),
        ),
    ] {
        let (edits, deform) = (stack(edits.clone()), tight(deform));
        let mut serial = alone(&mesh);
        let plan = serial.plan(&asked(&serial, &edits, &deform)).unwrap();
        let forecast = serial.forecast_of(&plan);
        for deal in DEALS {
            let of_cells = dealt(&mesh, deal.ranks, deal.empty);
            on_ranks(&mesh, &of_cells, deal, |shaper, numbers| {
                let found = shaper.plan(&asked(shaper, &edits, &deform)).unwrap();
                let off = apart(found.end(), numbers, plan.end());
                assert!(off <= 1e-8 * 0.3, "{} ranks, {deform:?}: {off:e}", deal.ranks);
                assert!(
                    (found.quality().min_scaled_jacobian - plan.quality().min_scaled_jacobian)
                        .abs()
                        < 1e-7
                );
                assert!((found.largest_displacement() - plan.largest_displacement()).abs() < 1e-8);
                let of_parts = shaper.forecast_of(&found);
                let (quality, expected) =
                    (of_parts.quality.unwrap(), forecast.quality.clone().unwrap());
                assert_eq!((quality.cells, quality.inverted), (expected.cells, 0));
                assert!((quality.mean - expected.mean).abs() < 1e-7);
                // It begins at the reference mesh.
                let before = of_parts.quality_before.unwrap();
                let expected = crate::quality::quality(mesh.cells(), mesh.points());
                assert_eq!((before.cells, before.histogram), (expected.cells, expected.histogram));
                let (change, expected) = (of_parts.change.unwrap(), forecast.change.unwrap());
                assert!((change.volume_ratio.mean - expected.volume_ratio.mean).abs() < 1e-7);
                // Back: exactly.
                let there = found.reached(f64::from(found.shapes()), Arc::clone(found.end()));
                let request = Request { deformation: deform.clone(), ..Request::new([], there) };
                let back = shaper.plan(&request).unwrap();
                assert_eq!(back.end(), shaper.reference());
            });
        }
    }
}

/// A line between vertices inside of the volume is passed over, whoever has it.
#[test]
fn lines_that_another_rank_has_change_no_shape() {
    let plain = box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]);
    let is_inside =
        |vertex: &u32| plain.points()[*vertex as usize].iter().all(|&x| x > 0.1 && x < 0.9);
    let inside: Vec<u32> = (0..plain.points().len() as u32).filter(is_inside).collect();
    let mut cells = plain.cells().clone();
    cells.push(CellType::Line, &inside[..2]).unwrap();
    let mesh = Mesh::new(plain.points().to_vec(), cells, plain.features().clone()).unwrap();
    let edits = stack(
        json!([{"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0.05, 0.02, -0.2]}}]),
    );
    let deform = tight(json!({}));
    let mut serial = alone(&mesh);
    let plan = serial.plan(&asked(&serial, &edits, &deform)).unwrap();
    let mut of_cells = vec![1; mesh.cells().len()];
    of_cells[plain.cells().len()] = 0;
    for ghosts in [false, true] {
        for numbers in [false, true] {
            let deal = Deal { ghosts, numbers, ..PLAIN };
            on_ranks(&mesh, &of_cells, deal, |shaper, numbers| {
                let found = shaper.plan(&asked(shaper, &edits, &deform)).unwrap();
                let off = apart(found.end(), numbers, plan.end());
                assert!(off <= 1e-8, "ghosts {ghosts}: {off:e}");
            });
        }
    }
}

/// A mesh of faces is judged on several ranks as on one process.
#[test]
fn faces_are_judged_in_parts_too() {
    let points: Vec<Vector> =
        (0..9).map(|vertex| [f64::from(vertex % 3), f64::from(vertex / 3), 0.0]).collect();
    let mut cells = Cells::new();
    for first in [0, 1, 3, 4] {
        cells.push(CellType::Quad, &[first, first + 1, first + 4, first + 3]).unwrap();
    }
    let mesh = Mesh::new(points, cells, FeatureSource::SharpEdges).unwrap();
    let verdict = |shaper: &mut Shaper, by: f64| {
        let edits =
            stack(json!([{"displacement": {"vertices": [4], "values": [[-by, -by, 0.0]]}}]));
        let asked = asked(shaper, &edits, &Deformation::default());
        shaper.plan(&asked).map(|plan| plan.quality().min_scaled_jacobian)
    };
    for (by, passes) in [(0.1, true), (0.7, false)] {
        let whole = verdict(&mut alone(&mesh), by);
        assert_eq!(whole.is_ok(), passes, "{whole:?}");
        for ghosts in [false, true] {
            let deal = Deal { ghosts, ..PLAIN };
            for found in on_ranks(&mesh, &[0, 0, 1, 1], deal, |shaper, _| verdict(shaper, by)) {
                match (&found, &whole) {
                    (Ok(found), Ok(whole)) => assert!((found - whole).abs() < 1e-9),
                    (Err(found), Err(Refused::Guard(_))) if found.is_quality() => {}
                    _ => panic!("{found:?}, expected {whole:?}"),
                }
            }
        }
    }
}

#[test]
fn a_start_of_another_length_is_refused_whatever_follows() {
    let mut shaper = alone(&box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]));
    let edits = stack(
        json!([{"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0.0, 0.0, 0.1]}}]),
    );
    for method in [json!({}), json!({"method": "surface"})] {
        let deformation: Deformation = serde_json::from_value(method).unwrap();
        let short: Arc<[Vector]> = shaper.reference()[1..].into();
        let request = Request { deformation, ..Request::new(&edits[..], short) };
        let found = shaper.plan(&request);
        let is_told = matches!(
            &found,
            Err(Refused::Guard(Refusal::PointCount { which: "start", found: 26, expected: 27 }))
        );
        assert!(is_told, "{found:?}");
    }
}

/// What is improved must not fall below the guard's floor where the solve's shape keeps to it.
#[test]
fn an_improved_shape_gives_way_where_it_is_below_the_floor() {
    let mesh = box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]);
    let shaper = alone(&mesh);
    let middle = mesh.points().iter().position(|point| *point == [0.5; 3]).unwrap();
    let with_middle = |x: f64| {
        let mut points = mesh.points().to_vec();
        points[middle][0] = x;
        points
    };
    let guard = Guard { min_scaled_jacobian: 0.1, ..Guard::default() };
    let (sound, poor, poorer) = (with_middle(0.5), with_middle(0.96), with_middle(0.98));
    let least = |points: &[Vector]| quality(mesh.cells(), points).min;
    assert!(least(&sound) > 0.1 && least(&poor) < 0.1 && least(&poorer) > 0.0);
    assert!(shaper.may_replace(&sound, &poor, &guard));
    assert!(!shaper.may_replace(&poor, &sound, &guard));
    // Neither keeps to it: the improver has the last word, unless it has turned a cell inside out.
    assert!(shaper.may_replace(&poor, &poorer, &guard));
    assert!(!shaper.may_replace(&with_middle(1.1), &poor, &guard));
}

/// Quality does not depend on how the mesh is divided.
#[test]
fn quality_is_that_of_one_process() {
    let mesh = box_of_tets([6, 5, 4], [0.0; 3], [1.0; 3]);
    let wave = |p: &Vector, size: f64| {
        [
            p[0] + size * (7.0 * p[1]).sin(),
            p[1] + size * (9.0 * p[2]).sin(),
            p[2] + size * (8.0 * p[0]).cos(),
        ]
    };
    let guard = Guard { min_scaled_jacobian: 0.05, ..Guard::default() };
    for size in [0.02, 0.3] {
        let moved: Vec<Vector> = mesh.points().iter().map(|point| wave(point, size)).collect();
        let serial = quality(mesh.cells(), &moved);
        let verdict = judge(&mesh, mesh.points(), &moved, &[0.5, 1.0], &guard);
        for deal in DEALS.into_iter().filter(|deal| deal.numbers) {
            let of_cells = dealt(&mesh, deal.ranks, deal.empty);
            on_ranks(&mesh, &of_cells, deal, |shaper, numbers| {
                let points: Vec<Vector> = numbers.iter().map(|&number| moved[number]).collect();
                let domain = shaper.domain().clone();
                let found = quality(shaper.mesh().cells(), &points).gathered(&domain);
                assert_eq!((found.cells, found.inverted), (serial.cells, serial.inverted));
                assert_eq!(
                    (found.min, found.max, found.histogram),
                    (serial.min, serial.max, serial.histogram)
                );
                assert!((found.mean - serial.mean).abs() < 1e-12);
                let measured = |quality: &crate::quality::Quality| {
                    quality.worst.iter().map(|worst| worst.scaled_jacobian).collect::<Vec<f64>>()
                };
                assert_eq!(measured(&found), measured(&serial));
                let start = shaper.reference();
                match (judge(&domain, start, &points, &[0.5, 1.0], &guard), &verdict) {
                    (Ok(found), Ok(verdict)) => {
                        assert_eq!(found.min_scaled_jacobian, verdict.min_scaled_jacobian);
                        assert!((found.shapes[0].mean - verdict.shapes[0].mean).abs() < 1e-12);
                    }
                    (Err(Refusal::Quality(found)), Err(Refusal::Quality(verdict))) => {
                        assert_eq!(
                            (found.failing, found.inverted),
                            (verdict.failing, verdict.inverted)
                        );
                        assert_eq!(found.feasible_fraction, verdict.feasible_fraction);
                        assert_eq!(found.folded_faces, verdict.folded_faces);
                        assert_eq!(found.worst[0].cell, verdict.worst[0].cell);
                    }
                    (found, verdict) => panic!("{found:?} {verdict:?}"),
                }
            });
        }
    }
}

/// One rank has the core alone, so that no vertex of its own is prescribed.
#[test]
fn a_rank_without_boundary_follows_the_others() {
    let mesh = box_of_tets([8, 8, 8], [0.0; 3], [1.0; 3]);
    let is_core = |vertices: &[u32]| {
        vertices
            .iter()
            .all(|&vertex| mesh.points()[vertex as usize].iter().all(|&x| (0.2..=0.8).contains(&x)))
    };
    let of_cells: Vec<usize> =
        mesh.cells().iter().map(|(_, vertices)| usize::from(is_core(vertices))).collect();
    let edits = stack(
        json!([{"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0.0, 0.0, -0.3]}}]),
    );
    let deform = tight(json!({}));
    let mut serial = alone(&mesh);
    let plan = serial.plan(&asked(&serial, &edits, &deform)).unwrap();
    let vertices = on_ranks(&mesh, &of_cells, PLAIN, |shaper, numbers| {
        let found = shaper.plan(&asked(shaper, &edits, &deform)).unwrap();
        let off = apart(found.end(), numbers, plan.end());
        assert!(off <= 1e-8 * 0.3, "{off:e}");
        shaper.boundary_vertices().len()
    });
    assert!(vertices[0] > 300 && vertices[1] == 0, "{vertices:?}");
}

/// Sub-steps, the inversion-free solve and clamping take the same decisions on all ranks as on one.
#[test]
fn what_one_solve_does_not_reach_is_mended_alike() {
    let mesh = box_of_tets([4, 4, 8], [0.0; 3], [1.0, 1.0, 2.0]);
    let turned = stack(
        json!([{"rotate": {"features": ["z-max"], "fixed": ["z-min"], "axis": [0, 0, 1], "degrees": 130}}]),
    );
    for otherwise in [Otherwise::Untangle, Otherwise::Clamp, Otherwise::Reject] {
        let guard = Guard { min_scaled_jacobian: 0.05, otherwise, surface: SurfaceRule::Allow };
        let reach = |shaper: &mut Shaper| {
            shaper.plan(&Request { guard, ..asked(shaper, &turned, &tight(json!({}))) })
        };
        let serial = reach(&mut alone(&mesh));
        for deal in [PLAIN, Deal { ranks: 3, ghosts: true, ..PLAIN }] {
            let of_cells = dealt(&mesh, deal.ranks, deal.empty);
            let outcomes = on_ranks(&mesh, &of_cells, deal, |shaper, numbers| {
                match (reach(shaper), &serial) {
                    (Ok(found), Ok(plan)) => {
                        assert_eq!(found.target().sub_steps, plan.target().sub_steps);
                        assert_eq!(found.shapes(), plan.shapes());
                        assert!((found.target().fraction - plan.target().fraction).abs() < 1e-6);
                        let off = apart(found.end(), numbers, plan.end());
                        assert!(off <= 1e-5, "{otherwise:?} {} ranks: {off:e}", deal.ranks);
                        "done".to_owned()
                    }
                    (Err(found), Err(refused)) => {
                        assert!(
                            (found.feasible_fraction().unwrap()
                                - refused.feasible_fraction().unwrap())
                            .abs()
                                < 1e-5
                        );
                        found.to_string()
                    }
                    (found, refused) => panic!(
                        "{otherwise:?}: {:?} {:?}",
                        found.map(drop),
                        refused.as_ref().map(drop)
                    ),
                }
            });
            assert!(outcomes.iter().all(|outcome| *outcome == outcomes[0]), "{outcomes:?}");
        }
    }
}

/// Edits that turn, and shapes that were improved, do not lie on the straight way to the whole.
#[test]
fn the_fraction_that_is_told_of_a_refused_order_passes() {
    let mesh = box_of_tets([6, 6, 6], [0.0; 3], [1.0; 3]);
    let turn = json!({"rotate": {"features": ["z-max"], "fixed": ["z-min"], "axis": [0, 0, 1], "degrees": 170}});
    let squeeze = json!({"scale_direction": {"features": ["z-max"], "fixed": ["z-min"], "factors": [0.7, 0.7, 1]}});
    let sink =
        json!({"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0.3, 0, -1.4]}});
    let slight =
        json!({"translate": {"features": ["x-max"], "fixed": ["x-min"], "by": [0.1, 0, 0]}});
    let guard = Guard { surface: SurfaceRule::Allow, ..Guard::default() };
    for edits in
        [json!([turn]), json!([slight, turn]), json!([slight, squeeze, sink]), json!([sink])]
    {
        let edits = stack(edits);
        let kept = edits.len() - 1;
        let mut shaper = alone(&mesh);
        let before = Request { guard, ..asked(&shaper, &edits[..kept], &Deformation::default()) };
        let start = shaper.plan(&before).unwrap().target().reached();
        let whole = Request {
            kept,
            start,
            ..Request { guard, ..asked(&shaper, &edits, &Deformation::default()) }
        };
        let refused = shaper.plan(&whole).unwrap_err();
        let fraction = refused.feasible_fraction().unwrap();
        assert!(fraction > 0.1 && fraction < 1.0, "{refused}");
        let mut part = edits.clone();
        part[kept] = edits[kept].scaled(fraction * (1.0 - 1e-6));
        let passes = shaper.plan(&Request { stack: part.into(), ..whole.clone() });
        assert!(passes.is_ok(), "{fraction}: {}", passes.unwrap_err());
        let clamp = Guard { otherwise: Otherwise::Clamp, ..guard };
        let clamped = shaper.plan(&Request { guard: clamp, ..whole }).unwrap().target().fraction;
        // A search may find more where an edit turns: no part of it lies on the straight way to all of it.
        assert!(fraction < clamped + 0.01, "{clamped} {fraction}");
    }
}

/// It is by the points themselves that a plan is known to begin where the mesh is.
#[test]
fn a_way_over_other_shapes_begins_with_the_start_that_was_asked_for() {
    let mesh = box_of_tets([4, 4, 8], [0.0; 3], [1.0, 1.0, 2.0]);
    let turned = stack(
        json!([{"rotate": {"features": ["z-max"], "fixed": ["z-min"], "axis": [0, 0, 1], "degrees": 165}}]),
    );
    let otherwise = Otherwise::Untangle;
    let guard = Guard { min_scaled_jacobian: 0.01, otherwise, surface: SurfaceRule::Allow };
    let mut shaper = alone(&mesh);
    let copy: Arc<[Vector]> = shaper.reference().to_vec().into();
    let deformation = tight(json!({}));
    let request = Request { guard, deformation, ..Request::new(&turned[..], Arc::clone(&copy)) };
    let plan = shaper.plan(&request).unwrap();
    assert!(plan.way().len() > 2);
    assert!(Arc::ptr_eq(plan.start(), &copy));
}

/// The solver moves its volume by itself on the way there; what it is to come to is Tombolo's.
#[test]
fn a_volume_that_follows_a_surface_alone_is_judged_where_it_ends() {
    let mesh = box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]);
    let mut shaper = alone(&mesh);
    let lower = |by: f64| {
        stack(
            json!([{"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0, 0, by], "harmonic_order": 1}}]),
        )
    };
    let surface_only = Deformation { surface_only: true, ..Deformation::default() };
    let plan = shaper.plan(&asked(&shaper, &lower(-0.1), &surface_only)).unwrap();
    let start = plan.reached(f64::from(plan.shapes()), Arc::clone(plan.end()));
    assert!(start.surface_only);
    for (by, is_sound) in [(-0.3, true), (-0.999, false), (0.0, true)] {
        let from_there =
            Request { start: start.clone(), ..asked(&shaper, &lower(by), &Deformation::default()) };
        match shaper.plan(&from_there) {
            Ok(plan) => {
                assert!(is_sound, "{by}");
                let end = quality(mesh.cells(), plan.end());
                assert!(end.inverted == 0 && end.min > 0.02, "{by}: {end:?}");
            }
            Err(refused) => assert!(!is_sound && refused.is_quality(), "{by}: {refused}"),
        }
    }
}

/// An error of one rank is the error of all ranks, in the same words.
#[test]
fn an_error_of_one_rank_is_that_of_all() {
    let mesh = box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]);
    let mut points = mesh.points().to_vec();
    // The middle vertex beyond its neighbours.
    let middle = points.iter().position(|point| *point == [0.5; 3]).unwrap();
    points[middle][0] = 0.9;
    let broken = mesh.with_points(points).unwrap();
    let of_cells = dealt(&mesh, 3, None);
    let down = stack(
        json!([{"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0.0, 0.0, -0.1]}}]),
    );
    let plan = |shaper: &mut Shaper, edits: &[Edit], method: Method| {
        let deform = Deformation {
            equation: Deform { method, ..Deform::default() },
            ..Deformation::default()
        };
        shaper.plan(&asked(shaper, edits, &deform)).map(drop).map_err(|refused| refused.to_string())
    };
    for method in [Method::Elasticity, Method::Harmonic] {
        let told = on_ranks(&broken, &of_cells, Deal { ranks: 3, ..PLAIN }, |shaper, _| {
            plan(shaper, &down, method)
        });
        let message = told[0].clone().unwrap_err();
        assert!(message.contains("no positive volume"), "{message}");
        assert!(told.iter().all(|told| told.as_ref() == Err(&message)), "{told:?}");
    }
    // An edit that makes no sense; one that goes through the floor.
    for edits in [
        json!([{"translate": {"features": ["z-mox"], "fixed": ["z-min"], "by": [0.0, 0.0, -0.1]}}]),
        json!([{"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0.0, 0.0, -3.0]}}]),
    ] {
        let edits = stack(edits);
        let expected = plan(&mut alone(&mesh), &edits, Method::Elasticity).unwrap_err();
        let told = on_ranks(&mesh, &of_cells, Deal { ranks: 3, ..PLAIN }, |shaper, _| {
            plan(shaper, &edits, Method::Elasticity)
        });
        assert!(told.iter().all(|told| told.as_ref() == Err(&expected)), "{told:?}, {expected}");
    }
}

/// A choice of solvers that never come to an end.
#[derive(Debug)]
struct Failing;

impl Solvers for Failing {
    fn scalar(&self, matrix: Arc<SparseMatrix<1>>, halo: &Halo, _: &[Vector]) -> Solver<1> {
        crate::linear::solver(matrix, halo)
    }

    fn vector(&self, matrix: Arc<SparseMatrix<3>>, _: &Halo, _: &[Vector]) -> Solver<3> {
        Ok(Box::new(Never(matrix.rows())))
    }
}

#[derive(Debug)]
struct Never(usize);

impl LinearSolver<3> for Never {
    fn unknowns(&self) -> usize {
        self.0
    }

    fn solve_from(
        &self,
        _: &[Vector],
        _: &mut [Vector],
        _: Tolerance,
    ) -> Result<Convergence, LinearError> {
        Err(LinearError::NotFinite { iteration: 0 })
    }

    fn renewed(&self, _: Arc<SparseMatrix<3>>) -> Result<Box<dyn LinearSolver<3>>, LinearError> {
        Ok(Box::new(Never(self.0)))
    }
}

/// A first solve that fails is followed in sub-steps on several ranks as on one: the order is done
/// by untangling alone, or refused with how much of it can be done.
#[test]
fn a_solve_that_fails_on_several_ranks_says_how_far_the_order_can_go() {
    let mesh = box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]);
    let guard = Guard { otherwise: Otherwise::Untangle, ..Guard::default() };
    let of_cells: Vec<usize> =
        (0..mesh.cells().len()).map(|cell| 2 * cell / mesh.cells().len()).collect();
    let outcomes = threads::run(2, |ranks| {
        let part = Part::cut(&mesh, &of_cells, ranks.rank(), false).unwrap();
        let ranks: Arc<dyn Communicator> = Arc::new(ranks);
        let mut shaper = of_part(&ranks, &part).with_solvers(Arc::new(Failing));
        [-0.2, -1.5].map(|by| {
            let edits = stack(json!([{"translate": {
                "features": ["z-max"], "fixed": ["z-min"], "by": [0.0, 0.0, by], "harmonic_order": 1}}]));
            let request = Request { guard, ..asked(&shaper, &edits, &Deformation::default()) };
            shaper.plan(&request).map(|_| ())
        })
    });
    for [moderate, beyond] in outcomes {
        assert_eq!(moderate.map_err(|refused| refused.to_string()), Ok(()));
        let refused = beyond.unwrap_err();
        let text = refused.to_string();
        assert!(text.contains("edit 0 (translate) can be done to"), "{text}");
        assert!(
            refused.feasible_fraction().is_some_and(|fraction| fraction > 0.2 && fraction < 0.67),
            "{text}"
        );
    }
}

#[test]
fn a_mesh_of_two_coordinates_stays_in_its_plane() {
    let mesh = crate::shapes::plate([4, 4], [0.0; 2], [1.0; 2]);
    let mut shaper = alone(&mesh).in_plane(true);
    let by = |by: [f64; 3]| {
        let region = json!({"box": {"lower": [-1, -1, -1], "upper": [0.5, 2, 1]}});
        stack(json!([{"translate": {"region": region, "by": by}}]))
    };
    let deformation = Deformation::default();
    let inside = asked(&shaper, &by([0.1, 0.0, 0.0]), &deformation);
    assert!(shaper.plan(&inside).unwrap().end().iter().all(|point| point[2] == 0.0));
    let outside = asked(&shaper, &by([0.1, 0.0, 0.3]), &deformation);
    let refused = shaper.plan(&outside).unwrap_err();
    assert!(refused.place().is_some());
    let Refused::LeavesPlane { by: distance, .. } = refused else { panic!("{refused}") };
    assert!((distance - 0.3).abs() < 1e-9, "{distance}");
    let forecast = shaper.forecast(&outside);
    assert!(forecast.reason.is_some_and(|reason| reason.contains("along z, expected 0")));
    assert!(alone(&mesh).plan(&outside).is_ok());
    // Half a turn about an axis of the plane ends in it, mirrored; on the way there it is outside.
    let all = json!({"box": {"lower": [-1, -1, -1], "upper": [2, 2, 1]}});
    let turned = stack(json!([{"rotate": {"region": all, "axis": [1, 0, 0], "degrees": 180}}]));
    for otherwise in [Otherwise::Reject, Otherwise::Clamp, Otherwise::Untangle] {
        let guard = Guard { otherwise, ..Guard::default() };
        let outcome = shaper.plan(&Request { guard, ..asked(&shaper, &turned, &deformation) });
        assert!(outcome.is_err(), "{otherwise:?}");
    }
}
