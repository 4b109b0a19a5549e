//! The mesh is the solver's: what is handed out is asked for, and what is lent at the next call
//! says whether it was done.

mod common;

use std::sync::Arc;

use common::squeeze;
use serde_json::{Value, json};
use tombolo::{
    Adaptor, MeshMotion, OrderReport, OrderStatus, Settings, Step,
    communicator::{Communicator, threads},
    deform::distributed::{Part, in_order},
    deform::{
        mesh::{ArrayView, Mesh, MeshView, Values, Vector},
        quality::quality,
        shapes::box_of_tets,
    },
    pipelines::{
        extract::Channel,
        language::{parse, parse_orders},
    },
};

const STEPS: u64 = 16;

fn at(cycle: u64, order: &Value, steps: u32) -> Value {
    let mut order = order.clone();
    order["schedule"] = json!({"steps": steps});
    json!({"at": {"cycle": cycle}, "order": order})
}

fn settings(orders: &Value, method: &str) -> Settings {
    let config = json!({"version": 1, "pipelines": [
        {"name": "shape", "on": "order", "stages": [{"deform": {"method": method}}]}]});
    Settings {
        orders: parse_orders(&orders.to_string(), "orders.json").expect("orders"),
        config: parse(&config.to_string(), "test.json").expect("a configuration"),
        ..Settings::default()
    }
}

/// How a solver moves its mesh in one step: from the coordinates it has, the cycle, and what it is
/// asked for.
type Move<'a> = &'a mut dyn FnMut(&mut Vec<Vector>, u64, Option<&MeshMotion>);

/// Runs a solver; the coordinates before each step, and what became of the orders.
fn run(settings: Settings, moves: Move<'_>) -> (Vec<Vec<Vector>>, Vec<OrderReport>) {
    let mesh = box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]);
    let mut adaptor = Adaptor::initialize(settings).expect("initialize");
    let mut points = mesh.points().to_vec();
    let mut before = Vec::new();
    for cycle in 0..STEPS {
        before.push(points.clone());
        let step = Step { cycle, time: 0.1 * cycle as f64, time_step: 0.1 };
        let lent = mesh.with_points(points.clone()).expect("finite");
        let channels = [Channel { name: "fluid", mesh: MeshView::from(&lent), fields: &[] }];
        let motion = adaptor.execute(&step, &channels).expect("execute").motion;
        if let Some(motion) = &motion {
            starts_where_it_was_lent(motion, &points, 0.1);
        }
        moves(&mut points, cycle, motion.as_ref());
    }
    (before, adaptor.finalize().expect("finalize").orders)
}

fn starts_where_it_was_lent(motion: &MeshMotion, lent: &[Vector], time_step: f64) {
    for (vertex, point) in lent.iter().enumerate() {
        for (axis, from) in point.iter().enumerate() {
            assert_eq!(motion.displacement[vertex][axis], motion.coordinates[vertex][axis] - from);
            assert_eq!(
                motion.velocity[vertex][axis],
                motion.displacement[vertex][axis] / time_step
            );
        }
    }
    let surface = &motion.surface;
    assert_eq!(surface.vertices.len(), surface.coordinates.len());
    for (place, &vertex) in surface.vertices.iter().enumerate() {
        let vertex = vertex as usize;
        assert_eq!(surface.coordinates[place], motion.coordinates[vertex]);
        assert_eq!(surface.displacement[place], motion.displacement[vertex]);
        assert_eq!(surface.velocity[place], motion.velocity[vertex]);
    }
}

fn largest(a: &[Vector], b: &[Vector]) -> f64 {
    let distance = |(a, b): (&Vector, &Vector)| (a[0] - b[0]).hypot(a[1] - b[1]).hypot(a[2] - b[2]);
    a.iter().zip(b).map(distance).fold(0.0, f64::max)
}

#[test]
fn a_solver_that_ignores_its_motion_is_found_out() {
    let orders = json!([at(2, &squeeze(0.4), 4), at(10, &json!({"undo": 1}), 2)]);
    let mut asked = Vec::new();
    let (_, orders) = run(settings(&orders, "elasticity"), &mut |_, cycle, motion| {
        asked.extend(
            motion.map(|motion| (cycle, largest(&motion.displacement, &vec![[0.0; 3]; 125]))),
        );
    });
    let not = orders[0].not_followed.expect("not followed");
    assert_eq!((orders[0].status, not.cycle, not.shape), (OrderStatus::Applied, 2, 1));
    assert!((not.distance - 0.1).abs() < 1e-12, "{not:?}");
    // Each shape is asked for from where the mesh is.
    for (shape, (cycle, by)) in asked[..4].iter().enumerate() {
        assert_eq!(*cycle, 2 + shape as u64);
        assert!((by - 0.1 * (shape + 1) as f64).abs() < 1e-12, "{asked:?}");
    }
    // The mesh is where the undo leads already.
    assert!(asked[4..].iter().all(|(_, by)| *by == 0.0), "{asked:?}");
    assert_eq!(orders[1].not_followed, None);
}

#[test]
fn a_shape_that_was_left_out_is_made_up_for() {
    let orders = json!([at(2, &squeeze(0.4), 4)]);
    let (before, orders) = run(settings(&orders, "elasticity"), &mut |points, cycle, motion| {
        if let Some(motion) = motion.filter(|_| cycle != 3) {
            *points = motion.coordinates.to_vec();
        }
    });
    assert_eq!(orders[0].not_followed.map(|not| (not.cycle, not.shape)), Some((3, 2)));
    let (all, _) = run(settings(&json!([at(2, &squeeze(0.4), 4)]), "elasticity"), &mut follow);
    assert_eq!(before.last(), all.last());
}

fn follow(points: &mut Vec<Vector>, _: u64, motion: Option<&MeshMotion>) {
    if let Some(motion) = motion {
        *points = motion.coordinates.to_vec();
    }
}

/// One that follows gets the bits it always got: those of the shapes, and those of the reference in
/// the end.
#[test]
fn a_solver_that_follows_gets_the_shapes_bit_for_bit() {
    let orders = json!([at(2, &squeeze(0.4), 4), at(10, &json!({"undo": 1}), 3)]);
    let (before, orders) = run(settings(&orders, "elasticity"), &mut follow);
    assert!(
        orders.iter().all(|order| order.not_followed.is_none() && order.deviation.is_none()),
        "{orders:?}"
    );
    let bits =
        |points: &[Vector]| points.iter().map(|point| point.map(f64::to_bits)).collect::<Vec<_>>();
    assert_eq!(bits(&before[15]), bits(&before[0]));
    // Adding the displacement, or a velocity, rounds: that is following too, and what is rounded
    // does not add up.
    for by_velocity in [false, true] {
        let given = json!([at(2, &squeeze(0.4), 4), at(10, &json!({"undo": 1}), 3)]);
        let mut handed = Vec::new();
        let (_, orders) = run(settings(&given, "elasticity"), &mut |points, _, motion| {
            let Some(motion) = motion else { return };
            handed = motion.coordinates.to_vec();
            for (vertex, point) in points.iter_mut().enumerate() {
                for (axis, at) in point.iter_mut().enumerate() {
                    let by = if by_velocity {
                        0.1 * motion.velocity[vertex][axis]
                    } else {
                        motion.displacement[vertex][axis]
                    };
                    *at += by;
                }
            }
        });
        assert!(
            orders.iter().all(|order| order.not_followed.is_none() && order.deviation.is_none()),
            "{orders:?}"
        );
        assert_eq!(bits(&handed), bits(&before[0]));
    }
}

#[test]
fn single_precision_is_rounding_and_no_motion() {
    let mesh = box_of_tets([4, 4, 4], [0.3, 0.1, 0.7], [1.0; 3]);
    let orders = json!([at(2, &squeeze(0.4), 4), at(10, &json!({"undo": 1}), 3)]);
    let mut adaptor = Adaptor::initialize(settings(&orders, "elasticity")).expect("initialize");
    let mut points: Vec<f32> = mesh.points().as_flattened().iter().map(|x| *x as f32).collect();
    let reference = points.clone();
    for cycle in 0..STEPS {
        let view = ArrayView::interleaved(Values::F32(&points), 3).expect("whole tuples");
        let view = MeshView { points: view, ..MeshView::from(&mesh) };
        let channels = [Channel { name: "fluid", mesh: view, fields: &[] }];
        let step = Step { cycle, time: 0.1 * cycle as f64, time_step: 0.1 };
        let motion = adaptor.execute(&step, &channels).expect("execute").motion;
        let moved = motion
            .map(|motion| motion.coordinates.as_flattened().iter().map(|x| *x as f32).collect());
        points = moved.unwrap_or(points);
    }
    let orders = adaptor.finalize().expect("finalize").orders;
    assert!(
        orders.iter().all(|order| order.not_followed.is_none() && order.deviation.is_none()),
        "{orders:?}"
    );
    assert_eq!(points, reference);
}

/// A rotor, or a structure that moves in the flow: its motion is kept, and an undo takes back what
/// the order did and no more.
#[test]
fn a_motion_of_the_solvers_own_is_carried() {
    let own = |cycle: u64, [x, y, _]: Vector| -> Vector {
        let angle = 0.15 * cycle as f64;
        [x * angle.cos() - y * angle.sin() - x, x * angle.sin() + y * angle.cos() - y, 0.0]
    };
    let reference = box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]).points().to_vec();
    let rotated = |points: &[Vector], cycle: u64| -> Vec<Vector> {
        let sum = |(&point, &at): (&Vector, &Vector)| {
            let by = own(cycle, at);
            std::array::from_fn(|axis| point[axis] + by[axis])
        };
        points.iter().zip(&reference).map(sum).collect()
    };
    let step = |points: &mut Vec<Vector>, cycle: u64, motion: Option<&MeshMotion>| {
        if let Some(motion) = motion {
            *points = motion.coordinates.to_vec();
        }
        for (point, &at) in points.iter_mut().zip(&reference) {
            let (now, next) = (own(cycle, at), own(cycle + 1, at));
            (0..3).for_each(|axis| point[axis] += next[axis] - now[axis]);
        }
    };
    let orders = json!([at(2, &squeeze(0.4), 4), at(10, &json!({"undo": 1}), 3)]);
    let (before, reports) = run(settings(&orders, "elasticity"), &mut { step });
    assert!(reports.iter().all(|order| order.status == OrderStatus::Applied), "{reports:?}");
    assert!(reports.iter().all(|order| order.not_followed.is_none()), "{reports:?}");
    assert!(reports[0].deviation.is_some_and(|deviation| deviation > 0.1), "{reports:?}");
    let (shapes, _) = run(settings(&orders, "elasticity"), &mut follow);
    for cycle in 0..STEPS as usize {
        let expected = rotated(&shapes[cycle], cycle as u64);
        assert!(largest(&before[cycle], &expected) < 1e-13, "cycle {cycle}");
    }
}

/// What the guard promises is promised of the mesh that will be there.
#[test]
fn the_guard_judges_the_mesh_that_will_be_there() {
    // The solver squeezes its mesh by itself; the order alone would be harmless.
    let orders = json!([at(6, &squeeze(0.6), 1), at(8, &squeeze(0.1), 1)]);
    let (before, reports) = run(settings(&orders, "elasticity"), &mut |points, cycle, motion| {
        follow(points, cycle, motion);
        if cycle < 5 {
            points
                .iter_mut()
                .for_each(|point| point[2] -= 0.12 * point[2] / (1.0 - 0.12 * cycle as f64));
        }
    });
    assert_eq!(reports[0].status, OrderStatus::Rejected, "{reports:?}");
    assert!(
        reports[0].reason.as_ref().is_some_and(|reason| reason.contains("own motion")),
        "{reports:?}"
    );
    assert_eq!(reports[1].status, OrderStatus::Applied, "{reports:?}");
    let cells = box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]).cells().clone();
    assert!(before.iter().all(|points| quality(&cells, points).inverted == 0));
    assert_eq!(run(settings(&orders, "elasticity"), &mut follow).1[0].status, OrderStatus::Applied);
}

/// A solver that takes the boundary alone: its own volume, here each vertex between the bottom and
/// the top, comes back as it was lent.
fn elastic(points: &mut [Vector], reference: &[Vector], boundary: &[u32], surface: &[Vector]) {
    for (&vertex, &place) in boundary.iter().zip(surface) {
        points[vertex as usize] = place;
    }
    let top =
        boundary.iter().zip(surface).filter(|(vertex, _)| reference[**vertex as usize][2] == 1.0);
    let height = top.map(|(_, place)| place[2]).fold(f64::NEG_INFINITY, f64::max);
    let is_boundary =
        |vertex: usize| boundary.iter().any(|&of_boundary| of_boundary as usize == vertex);
    for (vertex, point) in points.iter_mut().enumerate() {
        if !is_boundary(vertex) && height.is_finite() {
            point[2] = reference[vertex][2] * height;
        }
    }
}

#[test]
fn the_surface_moves_and_the_volume_is_the_solvers() {
    let reference = box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]).points().to_vec();
    let orders =
        json!([at(2, &squeeze(0.4), 4), at(8, &squeeze(3.0), 1), at(10, &json!({"undo": 1}), 3)]);
    let mut inside = 0.0_f64;
    let (before, reports) = run(settings(&orders, "surface"), &mut |points, _, motion| {
        let Some(motion) = motion else { return };
        let MeshMotion { surface, .. } = motion;
        for (vertex, by) in motion.displacement.iter().enumerate() {
            if !surface.vertices.contains(&(vertex as u32)) {
                inside = inside.max(by.iter().fold(0.0, |most, x| most.max(x.abs())));
            }
        }
        elastic(points, &reference, &surface.vertices, &surface.coordinates);
    });
    assert_eq!(inside, 0.0, "what is inside is handed back as it was lent");
    let order = &reports[0];
    assert_eq!(order.status, OrderStatus::Applied, "{order:?}");
    assert_eq!(
        (order.min_scaled_jacobian, order.seconds.volume, order.not_followed),
        (None, 0.0, None)
    );
    assert_eq!(serde_json::to_value(order).unwrap()["judged"], "surface");
    assert_eq!(
        (reports[1].status, reports[2].status),
        (OrderStatus::Rejected, OrderStatus::Applied),
        "{reports:?}"
    );
    let bottom_and_top =
        |z: f64| before[7].iter().zip(&reference).filter(move |(_, at)| at[2] == z);
    assert!(
        bottom_and_top(1.0).all(|(point, _)| point[2] == 1.0 + -0.4),
        "the top is where it was asked to be"
    );
    assert!(bottom_and_top(0.0).all(|(point, at)| point == at));
    for (point, at) in before[15].iter().zip(&reference) {
        let is_inside = at.iter().all(|x| *x > 0.0 && *x < 1.0);
        assert!(point == at || is_inside && (point[2] - at[2]).abs() < 1e-15, "undone");
    }
}

fn parts(mesh: &Mesh, rank: usize) -> Part {
    let of_cells = in_order(mesh.cells().len(), 3);
    Part::cut(mesh, &of_cells, rank, true).expect("a part")
}

#[test]
fn three_ranks_find_out_what_one_does() {
    let mesh = box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]);
    let orders = json!([at(2, &squeeze(0.4), 4), at(8, &json!({"undo": 1}), 3)]);
    for (method, does_follow) in [("elasticity", false), ("elasticity", true), ("surface", true)] {
        let mut one = Vec::new();
        let expected = run(settings(&orders, method), &mut |points, cycle, motion| {
            one.extend(motion.map(|motion| (cycle, motion.coordinates.to_vec())));
            if does_follow {
                follow(points, cycle, motion);
            }
        });
        let all = threads::run(3, |ranks| {
            let rank = ranks.rank();
            let mut part = parts(&mesh, rank);
            let numbers = part.global_vertices.clone().expect("numbers");
            let settings = Settings { communicator: Arc::new(ranks), ..settings(&orders, method) };
            let mut adaptor = Adaptor::initialize(settings).expect("initialize");
            let mut motions = 0;
            for cycle in 0..STEPS {
                let step = Step { cycle, time: 0.1 * cycle as f64, time_step: 0.1 };
                let lent = part.points.clone();
                let moved = {
                    let channels = [Channel { name: "fluid", mesh: part.view(), fields: &[] }];
                    let motion = adaptor.execute(&step, &channels).expect("execute").motion;
                    if let Some(motion) = &motion {
                        starts_where_it_was_lent(motion, &lent, 0.1);
                        let (at, whole) = &one[motions];
                        assert_eq!(*at, cycle);
                        motions += 1;
                        for (point, &number) in motion.coordinates.iter().zip(&numbers) {
                            assert!(
                                largest(&[*point], &[whole[number as usize]]) < 1e-6,
                                "{method}, cycle {cycle}"
                            );
                        }
                    }
                    motion.map(|motion| motion.coordinates.to_vec())
                };
                if let Some(moved) = moved.filter(|_| does_follow) {
                    part.points = moved;
                }
            }
            assert_eq!(motions, one.len());
            adaptor.finalize().expect("finalize").orders
        });
        for (order, expected) in all[0].iter().zip(&expected.1) {
            assert_eq!((order.status, order.judged), (expected.status, expected.judged));
            let [not, expected] = [order.not_followed, expected.not_followed]
                .map(|not| not.map(|it| (it.cycle, it.shape)));
            assert_eq!(not, expected);
            assert_eq!(not.is_some(), !does_follow && order.shapes == 4, "{method}");
        }
    }
}

/// The lines of a journal, as id and status.
fn journalled(file: &std::path::Path) -> Vec<(String, Value)> {
    let text = std::fs::read_to_string(file).expect("a journal");
    let line = |line: &str| serde_json::from_str::<Value>(line).expect("a line of JSON");
    text.lines()
        .map(line)
        .filter(|line| line.get("status").is_some())
        .map(|line| (line["status"].as_str().expect("a status").to_owned(), line))
        .collect()
}

#[test]
fn what_was_not_followed_stands_in_the_journal_and_replays() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("run.jsonl");
    let orders = json!([at(2, &squeeze(0.4), 4)]);
    let with_journal = |settings: Settings| {
        let mut config = serde_json::to_value(&settings.config).expect("JSON");
        config["journal"] = json!(file);
        Settings {
            config: parse(&config.to_string(), "test.json").expect("a configuration"),
            ..settings
        }
    };
    run(with_journal(settings(&orders, "elasticity")), &mut |_, _, _| {});
    let lines = journalled(&file);
    let statuses: Vec<&str> = lines.iter().map(|(status, _)| status.as_str()).collect();
    assert_eq!(statuses, ["accepted", "applied", "not_followed"]);
    let (_, line) = &lines[2];
    assert_eq!((&line["cycle"], &line["id"]), (&json!(2), &lines[0].1["id"]));
    assert!(
        line["reason"].as_str().is_some_and(|reason| reason.starts_with("shape 1 of 4")),
        "{line}"
    );
    // Played back to a solver that follows, it is the order.
    let text = std::fs::read_to_string(&file).expect("a journal");
    let replayed = Settings {
        orders: parse_orders(&text, "run.jsonl").expect("a journal is a file of orders"),
        ..settings(&json!([]), "elasticity")
    };
    let (before, reports) = run(replayed, &mut follow);
    assert_eq!((reports.len(), reports[0].not_followed, reports[0].not_confirmed), (1, None, None));
    let (all, _) = run(settings(&orders, "elasticity"), &mut follow);
    assert_eq!(before.last(), all.last());
}

#[test]
fn the_last_motion_of_a_run_is_not_confirmed() {
    let folder = tempfile::tempdir().expect("a folder");
    for (cycle, steps, shape) in [
        (STEPS - 1, 1, Some(1)),
        (STEPS - 1, 4, Some(1)),
        (STEPS - 3, 3, Some(3)),
        (STEPS - 4, 3, None),
    ] {
        let file = folder.path().join(format!("{cycle}-{steps}.jsonl"));
        let given = settings(&json!([at(cycle, &squeeze(0.4), steps)]), "elasticity");
        let mut config = serde_json::to_value(&given.config).expect("JSON");
        config["journal"] = json!(file);
        let config = parse(&config.to_string(), "test.json").expect("a configuration");
        let (_, orders) = run(Settings { config, ..given }, &mut follow);
        assert_eq!(
            (orders[0].not_confirmed, orders[0].not_followed),
            (shape, None),
            "{cycle}, {steps}"
        );
        let last = journalled(&file).pop().expect("lines");
        let expected = if shape.is_some() { "not_confirmed" } else { "applied" };
        assert_eq!(last.0, expected, "{cycle}, {steps}: {}", last.1);
        if shape.is_some() {
            assert_eq!(last.1["cycle"], json!(STEPS - 1));
        }
    }
}
