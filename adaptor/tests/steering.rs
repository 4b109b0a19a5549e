//! Orders of files and pipelines, without a server: all of it is exact.

mod common;

use std::time::{Duration, Instant};

use common::{PATIENCE, Solver, Viewer, bits, config, squeeze};
use serde_json::{Value, json};
use tombolo::{
    Adaptor, ExecuteError, InitializeError, OrderStatus, Parameter, Settings, Step,
    deform::{
        mesh::{ArrayView, CellType, CellsView, MeshView, Vector},
        quality::quality,
        shapes::box_of_tets,
    },
    pipelines::{
        extract::Channel,
        language::{At, Slice, Stage, TimedCommand, parse_orders},
    },
};

fn orders(list: &Value) -> Vec<TimedCommand> {
    parse_orders(&list.to_string(), "orders.json").expect("orders")
}

fn with_orders(list: &Value) -> Solver {
    Solver::new(Settings { orders: orders(list), ..Settings::default() })
}

fn at(cycle: u64, order: Value) -> Value {
    json!({"at": {"cycle": cycle}, "order": order})
}

fn scheduled(mut order: Value, steps: u32, every: u32) -> Value {
    order["schedule"] = json!({"steps": steps, "every": {"steps": every}, "motion": "at_once"});
    order
}

#[test]
fn a_schedule_is_kept_and_ends_exactly() {
    let mut solver = with_orders(&json!([at(3, scheduled(squeeze(0.4), 4, 2))]));
    solver.steps(20);
    let cycles: Vec<u64> = solver.motions.iter().map(|(cycle, _, _)| *cycle).collect();
    assert_eq!(cycles, [3, 5, 7, 9]);
    assert_eq!(solver.motions[3].1, (4, 4));
    for (point, reference) in solver.mesh.points().iter().zip(solver.reference.points()) {
        if reference[2] == 1.0 {
            assert_eq!(*point, [reference[0], reference[1], reference[2] + -0.4]);
        }
        if reference[2] == 0.0 {
            assert_eq!(point, reference);
        }
    }
    let report = solver.finish();
    let order = &report.orders[0];
    assert_eq!(
        (order.status, order.cycle_applied, order.shape, order.shapes),
        (OrderStatus::Applied, Some(3), 4, 4)
    );
    assert!(order.min_scaled_jacobian.is_some_and(|min| min > 0.02), "{order:?}");
    assert!(order.seconds.surface > 0.0 && order.seconds.volume > 0.0 && order.seconds.guard > 0.0);
    assert!(order.added_steps.is_some());
    assert_eq!(report.cycles, 20);
}

#[test]
fn a_way_is_spread_over_its_steps_at_one_velocity() {
    let mut order = squeeze(0.4);
    order["schedule"] = json!({"steps": 2, "every": {"steps": 5}});
    let mut solver = with_orders(&json!([at(3, order)]));
    let top = |solver: &Solver| {
        let heights = solver.mesh.points().iter().map(|point| point[2]);
        heights.fold(f64::MIN, f64::max)
    };
    let mut heights = Vec::new();
    for _ in 0..16 {
        heights.push(top(&solver));
        solver.step();
        assert_eq!(quality(solver.mesh.cells(), solver.mesh.points()).inverted, 0);
    }
    let cycles: Vec<u64> = solver.motions.iter().map(|(cycle, _, _)| *cycle).collect();
    assert_eq!(cycles, (3..13).collect::<Vec<_>>(), "it never rests on the way");
    let shapes: Vec<u32> = solver.motions.iter().map(|(_, (shape, _), _)| *shape).collect();
    assert_eq!(shapes, [1, 1, 1, 1, 1, 2, 2, 2, 2, 2]);
    for pair in heights[3..14].windows(2) {
        assert!((pair[0] - pair[1] - 0.04).abs() < 1e-12, "{heights:?}");
    }
    // The shapes themselves are those that the same schedule makes at once.
    let mut order = squeeze(0.4);
    order["schedule"] = json!({"steps": 2, "every": {"steps": 5}, "motion": "at_once"});
    let mut at_once = with_orders(&json!([at(3, order)]));
    at_once.steps(16);
    assert!(bits(&at_once.mesh) == bits(&solver.mesh));
    let report = solver.finish();
    assert_eq!((report.orders[0].shape, report.orders[0].status), (2, OrderStatus::Applied));
}

#[test]
fn every_mesh_on_the_way_is_sound() {
    let mut solver = with_orders(&json!([
        at(0, scheduled(squeeze(0.5), 5, 1)),
        at(7, scheduled(json!({"undo": 1}), 3, 1))
    ]));
    for _ in 0..12 {
        solver.step();
        assert_eq!(quality(solver.mesh.cells(), solver.mesh.points()).inverted, 0);
    }
    assert_eq!(solver.motions.len(), 8);
    assert!(solver.is_at_reference());
}

#[test]
fn taking_orders_back_restores_each_shape_bit_for_bit() {
    let mut solver = with_orders(&json!([
        at(1, squeeze(0.2)),
        at(
            2,
            json!({"edits": [{"scale_normals": {"features": ["x-max"], "fixed": ["x-min"], "distance": 0.1}}]})
        ),
        at(3, json!({"undo": 1})),
        at(4, json!({"undo": 1})),
        at(5, squeeze(0.2)),
        at(6, json!({"stack": []})),
        at(7, json!({"undo": 1})),
        at(8, json!({"undo": 2})),
    ]));
    let mut shapes = Vec::new();
    for _ in 0..10 {
        shapes.push(bits(&solver.mesh));
        solver.step();
    }
    shapes.push(bits(&solver.mesh));
    // shapes[n + 1] is the shape after cycle n.
    assert_ne!(shapes[2], shapes[1]);
    assert_ne!(shapes[3], shapes[2]);
    assert_eq!(shapes[4], shapes[2], "the second order taken back");
    assert_eq!(shapes[5], shapes[0], "both taken back");
    assert_eq!(shapes[6], shapes[2], "the same order again");
    assert_eq!(shapes[7], shapes[0], "an empty stack");
    assert_eq!(shapes[8], shapes[2], "the replacement taken back");
    assert_eq!(solver.adaptor_reports_rejected(), vec![(8, true)]);
}

trait Rejected {
    fn adaptor_reports_rejected(self) -> Vec<(u64, bool)>;
}

impl Rejected for Solver {
    /// The last order asks for more than there is: one order is left to take back.
    fn adaptor_reports_rejected(self) -> Vec<(u64, bool)> {
        let report = self.finish();
        let last = report.orders.last().expect("orders");
        let reason = last.reason.clone().unwrap_or_default();
        vec![(
            report.orders.len() as u64,
            last.status == OrderStatus::Rejected && reason.contains("only 1 order"),
        )]
    }
}

#[test]
fn an_order_in_the_middle_of_another_starts_where_the_mesh_is() {
    let mut solver = with_orders(&json!([
        at(0, scheduled(squeeze(0.4), 10, 1)),
        at(4, scheduled(json!({"undo": 1}), 2, 1))
    ]));
    solver.steps(4);
    assert_eq!(solver.motions.len(), 4);
    let there = solver.mesh.clone();
    solver.step();
    let half: Vec<_> = there
        .points()
        .iter()
        .zip(solver.reference.points())
        .map(|(a, b)| 0.5 * (a[2] + b[2]))
        .collect();
    assert!(
        solver.mesh.points().iter().zip(half).all(|(point, half)| (point[2] - half).abs() < 1e-14)
    );
    solver.steps(10);
    assert_eq!(solver.motions.len(), 6);
    assert!(solver.is_at_reference());
    let report = solver.finish();
    assert_eq!((report.orders[0].status, report.orders[0].shape), (OrderStatus::Applied, 4));
    assert!(report.orders[0].reason.as_ref().is_some_and(|reason| reason.contains("o2")));
}

#[test]
fn a_refused_order_leaves_the_schedule_under_way_alone() {
    // The walls fold in their own planes on the way.
    let mut through_itself = squeeze(1.5);
    through_itself["guard"] = json!({"surface": "allow"});
    let list = json!([
        at(0, scheduled(squeeze(0.4), 6, 1)),
        at(3, through_itself),
        at(3, squeeze(0.8)),
        at(
            3,
            json!({"edits": [
        {"translate": {"features": ["z-mx"], "by": [0.0, 0.0, 0.1]}}]})
        )
    ]);
    let mut solver = with_orders(&list);
    let mut alone = with_orders(&json!([list[0]]));
    for _ in 0..8 {
        solver.step();
        alone.step();
        assert_eq!(bits(&solver.mesh), bits(&alone.mesh));
    }
    let report = solver.finish();
    let reason = |index: usize| report.orders[index].reason.clone().unwrap_or_default();
    assert_eq!(report.orders[1].status, OrderStatus::Rejected);
    assert!(
        report.orders[1].min_scaled_jacobian.is_some_and(|reached| reached < 0.0),
        "what it would have come to"
    );
    assert!(
        report.orders[1].seconds.volume > 0.0 && report.orders[1].seconds.guard > 0.0,
        "what it took to find out"
    );
    assert!(
        reason(1).contains("inside out") && reason(1).contains("largest feasible fraction"),
        "{}",
        reason(1)
    );
    assert_eq!(report.orders[2].status, OrderStatus::Rejected);
    assert!(
        reason(2).contains("intersect") && reason(2).contains("largest feasible fraction"),
        "{}",
        reason(2)
    );
    assert!(
        reason(3).contains("z-mx") && reason(3).contains("z-max") && reason(3).contains("x-min"),
        "{}",
        reason(3)
    );
}

#[test]
fn parameters_are_steered_within_their_bounds() {
    let list = json!([
        {"at": {"cycle": 1}, "parameter": {"name": "inflow", "value": 2.5}},
        {"at": {"cycle": 2}, "parameter": {"name": "inflow", "value": 99.0}},
        {"at": {"cycle": 3}, "parameter": {"name": "inflo", "value": 1.0}},
        {"at": {"cycle": 5}, "stop": {}}]);
    let parameter = Parameter { name: "inflow".into(), value: 1.0, minimum: 0.0, maximum: 10.0 };
    let mut solver = Solver::new(Settings {
        orders: orders(&list),
        parameters: vec![parameter],
        ..Settings::default()
    });
    solver.steps(5);
    assert!(!solver.stopped);
    solver.step();
    assert!(solver.stopped);
    assert_eq!(solver.parameters, [("inflow".to_owned(), 2.5)]);
}

#[test]
fn a_pipeline_gives_an_order_once() {
    let text = r#"{"version": 1, "pipelines": [
        {"name": "shape", "on": "order", "stages": [{"schedule": {"steps": 2, "every": {"steps": 3}, "motion": "at_once"}}]},
        {"name": "pinch", "at": {"time": 0.045}, "stages": [
            {"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0, 0, -0.2]}}, {"order": {}}]}]}"#;
    let mut solver = Solver::with_config(text);
    solver.steps(20);
    let cycles: Vec<u64> = solver.motions.iter().map(|(cycle, _, _)| *cycle).collect();
    assert_eq!(cycles, [5, 8]);
}

#[test]
fn a_pause_that_nobody_could_end_is_refused() {
    let mut solver = with_orders(&json!([{"at": {"cycle": 1}, "pause": {}}]));
    solver.steps(3);
    assert_eq!(solver.cycle, 3);
}

#[test]
fn the_solvers_own_mistakes_are_told_and_change_nothing() {
    let mesh = box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]);
    let other = box_of_tets([3, 2, 2], [0.0; 3], [1.0; 3]);
    let list = orders(&json!([at(3, squeeze(0.2))]));
    let mut adaptor =
        Adaptor::initialize(Settings { orders: list, ..Settings::default() }).unwrap();
    let step = |cycle| Step { cycle, time: 0.0, time_step: 0.1 };
    let channel = |mesh| [Channel { name: "fluid", mesh: MeshView::from(mesh), fields: &[] }];
    assert!(matches!(adaptor.execute(&step(0), &[]), Err(ExecuteError::NoChannel { .. })));
    adaptor.execute(&step(0), &channel(&mesh)).unwrap();
    let error = adaptor.execute(&step(1), &channel(&other)).unwrap_err();
    assert!(matches!(error, ExecuteError::VertexCount { found: 36, expected: 27, .. }), "{error}");
    for time_step in [f64::NAN, -1.0, f64::INFINITY] {
        assert!(adaptor.execute(&Step { time_step, ..step(1) }, &channel(&mesh)).is_err());
    }
    assert!(adaptor.execute(&Step { time: f64::NAN, ..step(1) }, &channel(&mesh)).is_err());
    let steady = Step { time_step: 0.0, ..step(3) };
    let channels = channel(&mesh);
    let steering = adaptor.execute(&steady, &channels).unwrap();
    let motion = steering.motion.expect("a motion");
    assert!(motion.velocity.iter().all(|velocity| *velocity == [0.0; 3]));
    assert!(motion.displacement.iter().any(|displacement| *displacement != [0.0; 3]));
}

/// The errors name the value where it stands, not a text that nobody has written.
#[test]
fn what_is_built_by_hand_is_refused_where_it_stands() {
    let refused =
        |settings: Settings| Adaptor::initialize(settings).err().expect("refused").to_string();
    let mut cut = config(
        r#"{"version": 1, "pipelines": [
            {"name": "cut", "stages": [{"slice": {"origin": [0, 0, 0], "normal": [1, 0, 0]}}]}
        ]}"#,
    );
    let Stage::Slice(Slice::Plane(plane)) = &mut cut.pipelines[0].stages[0] else { panic!() };
    plane.origin[1] = f64::NAN;
    assert_eq!(
        refused(Settings { config: cut, ..Settings::default() }),
        "the configuration: pipelines[0].stages[0].slice.origin[1]: found NaN, expected a finite number"
    );
    let mut late = orders(&json!([at(0, squeeze(0.1)), at(1, squeeze(0.2))]));
    late[1].at = Some(At::Time(f64::INFINITY));
    assert_eq!(
        refused(Settings { orders: late, ..Settings::default() }),
        "the orders given beforehand: [1].at.time: found inf, expected a finite number"
    );
}

#[test]
fn what_makes_no_sense_is_refused_before_the_run() {
    let twice = Parameter { name: "a".into(), value: 1.0, minimum: 0.0, maximum: 2.0 };
    let settings = Settings { parameters: vec![twice.clone(), twice], ..Settings::default() };
    assert!(matches!(Adaptor::initialize(settings).err(), Some(InitializeError::Parameter(_))));
    let mut nan = orders(&json!([at(0, squeeze(0.1))]));
    let tombolo::pipelines::language::Command::Order(order) = &mut nan[0].command else { panic!() };
    order.guard = Some(tombolo::deform::quality::Guard {
        min_scaled_jacobian: f64::NAN,
        ..Default::default()
    });
    let settings = Settings { orders: nan, ..Settings::default() };
    let error = Adaptor::initialize(settings).err().expect("refused").to_string();
    assert!(error.contains("min_scaled_jacobian"), "{error}");
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(directory.path().join("file"), "").unwrap();
    let journal = Settings {
        config: config(r#"{"version": 1, "journal": "file/journal.jsonl"}"#),
        output: directory.path().into(),
        ..Settings::default()
    };
    let error = Adaptor::initialize(journal).err().expect("refused").to_string();
    assert!(error.contains("journal.jsonl"), "{error}");
}

#[test]
fn a_journal_replays_to_the_same_bits() {
    let directory = tempfile::tempdir().unwrap();
    let run = |name: &str, orders: Vec<TimedCommand>| {
        let text = format!(r#"{{"version": 1, "journal": "{name}"}}"#);
        let mut solver = Solver::new(Settings {
            config: config(&text),
            orders,
            output: directory.path().into(),
            ..Settings::default()
        });
        let mut shapes = Vec::new();
        for _ in 0..12 {
            solver.step();
            shapes.push(bits(&solver.mesh));
        }
        // Nothing is finalized.
        drop(solver);
        let text = std::fs::read_to_string(directory.path().join(name)).unwrap();
        (shapes, text)
    };
    let list = json!([
        at(1, scheduled(squeeze(0.3), 3, 2)),
        at(4, json!({"edits": [{"translate": {"features": ["nowhere"], "by": [1.0, 0.0, 0.0]}}]})),
        at(4, scheduled(squeeze(0.1), 2, 1)),
        at(9, json!({"undo": 1}))
    ]);
    let (shapes, journal) = run("first.jsonl", orders(&list));
    assert_eq!(common::statuses(&journal).len(), 8, "{journal}");
    let (again, _) = run("second.jsonl", parse_orders(&journal, "first.jsonl").unwrap());
    assert!(shapes == again);
    // Of the last order nothing is known but that it was accepted.
    let torn = &journal[..journal.rfind("\"applied\"").unwrap() + 3];
    assert_eq!(parse_orders(torn, "torn.jsonl").unwrap().len(), 2);
}

#[test]
fn a_journal_holds_what_a_displacement_file_held() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("lift.txt");
    std::fs::write(&file, "0 0 1 0 0 0.1\n1 0 1 0 0 0.0625\n").unwrap();
    let run = |name: &str, orders: Vec<TimedCommand>| {
        let text = format!(r#"{{"version": 1, "journal": "{name}"}}"#);
        let output = directory.path().into();
        let mut solver =
            Solver::new(Settings { config: config(&text), orders, output, ..Settings::default() });
        for _ in 0..6 {
            solver.step();
        }
        let shape = bits(&solver.mesh);
        drop(solver);
        (shape, std::fs::read_to_string(directory.path().join(name)).unwrap())
    };
    let list = json!([
        at(1, json!({"edits": [{"displacement": {"file": "lift.txt"}}]})),
        at(3, json!({"edits": [{"displacement": {"file": "missing.txt"}}]}))
    ]);
    let beside = directory.path().join("orders.json");
    let (shape, journal) =
        run("first.jsonl", parse_orders(&list.to_string(), &beside.to_string_lossy()).unwrap());
    let (still, _) = run("none.jsonl", Vec::new());
    assert!(shape != still);
    let lines: Vec<&str> = journal.lines().collect();
    assert!(
        lines[1].contains("\"values\":[[0.0,0.0,0.1],[0.0,0.0,0.0625]]")
            && !lines[1].contains("lift.txt"),
        "{journal}"
    );
    assert!(
        lines.iter().any(|line| line.contains("rejected") && line.contains("missing.txt")),
        "{journal}"
    );
    std::fs::remove_file(file).unwrap();
    let (again, _) = run("second.jsonl", parse_orders(&journal, "first.jsonl").unwrap());
    assert!(shape == again);
}

/// Two boxes as two channels, and a configuration in which orders change the one called `named`.
fn two_channels(named: &str) -> (Vec<(u64, usize)>, OrderStatus, String) {
    let text = json!({"version": 1, "pipelines": [{"name": "shape", "on": "order", "channel": named, "stages": []}]});
    let settings = Settings {
        config: config(&text.to_string()),
        orders: orders(&json!([at(1, squeeze(0.2))])),
        ..Settings::default()
    };
    let mut adaptor = Adaptor::initialize(settings).expect("initialize");
    assert_eq!(adaptor.steered_channel(), Some(named));
    let boxes =
        [box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]), box_of_tets([3, 3, 3], [2.0; 3], [3.0; 3])];
    let mut motions = Vec::new();
    for cycle in 0..4 {
        let [first, second] = &boxes;
        let channels = [
            Channel { name: "particles", mesh: MeshView::from(first), fields: &[] },
            Channel { name: "fluid", mesh: MeshView::from(second), fields: &[] },
        ];
        let step = Step { cycle, time: cycle as f64, time_step: 1.0 };
        let steering = adaptor.execute(&step, &channels).expect("execute");
        motions.extend(steering.motion.map(|motion| (cycle, motion.coordinates.len())));
        if cycle == 3 && named == "fluid" {
            let error = adaptor
                .execute(&Step { cycle: 4, ..step }, &channels[..1])
                .map(|_| ())
                .unwrap_err();
            assert!(matches!(&error, ExecuteError::SteeredChannel { cycle: 4, .. }), "{error}");
            assert!(
                error.to_string().contains("no channel `fluid`; its channels are particles"),
                "{error}"
            );
        }
    }
    let report = adaptor.finalize().expect("report");
    let order = report.orders.into_iter().next().expect("an order");
    (motions, order.status, order.reason.unwrap_or_default())
}

#[test]
fn orders_change_the_channel_that_the_configuration_names() {
    assert_eq!(two_channels("fluid"), (vec![(1, 64)], OrderStatus::Applied, String::new()));
    assert_eq!(two_channels("particles").0, [(1, 27)]);
    // A channel that is not there is no mistake of the solver's: it goes on, and orders are told
    // why they are rejected.
    let (motions, status, reason) = two_channels("fluids");
    assert_eq!((motions.len(), status), (0, OrderStatus::Rejected));
    assert!(
        reason.contains("no channel `fluids`") && reason.contains("did you mean `fluid`?"),
        "{reason}"
    );
}

/// The last coordinates that an order leads to on a mesh of these arrays.
fn squeezed(
    points: &[Vector],
    cell_type: CellType,
    connectivity: &[u32],
) -> Result<Vec<Vector>, ExecuteError> {
    let settings = Settings {
        config: config(
            r#"{"version": 1, "pipelines": [{"name": "shape", "on": "order", "stages": []}]}"#,
        ),
        orders: orders(&json!([at(
            1,
            json!({"edits": [{"translate": {"region": {"box": {"lower": [-9, -9, 0.99], "upper": [9, 9, 9]}},
            "fixed_region": {"box": {"lower": [-9, -9, -9], "upper": [9, 9, 0.01]}}, "by": [0.0, 0.1, -0.3]}}], "deform": {"improve": 0}})
        )])),
        ..Settings::default()
    };
    let mut adaptor = Adaptor::initialize(settings).expect("initialize");
    let mut reached = points.to_vec();
    for cycle in 0..4 {
        let cells = CellsView::Uniform { cell_type, connectivity: connectivity.into() };
        let channels = [Channel {
            name: "solid",
            mesh: MeshView::new(ArrayView::vectors(&reached), cells),
            fields: &[],
        }];
        let steering =
            adaptor.execute(&Step { cycle, time: cycle as f64, time_step: 1.0 }, &channels)?;
        if let Some(motion) = steering.motion {
            let motion = motion.coordinates.to_vec();
            reached = motion;
        }
    }
    let report = adaptor.finalize().expect("report");
    assert_eq!(report.orders[0].status, OrderStatus::Applied, "{:?}", report.orders[0].reason);
    Ok(reached)
}

/// A solver whose cells are left-handed, or whose mesh is mirrored, is steered as any other; one
/// that has its cells in the order of another program hears of it.
#[test]
fn the_order_of_a_solvers_vertices_is_its_own() {
    let tets = box_of_tets([3, 3, 3], [0.0; 3], [1.0; 3]);
    let hexahedra = tombolo::deform::shapes::box_of_hexahedra([3, 3, 3], [0.0; 3], [1.0; 3]);
    let mirror =
        |points: &[Vector]| points.iter().map(|&[x, y, z]| [-x, y, z]).collect::<Vec<Vector>>();
    for mesh in [&tets, &hexahedra] {
        let cell_type = mesh.cells().types()[0];
        let connectivity = mesh.cells().connectivity();
        let plain = squeezed(mesh.points(), cell_type, connectivity).expect("steered");
        let image = squeezed(&mirror(mesh.points()), cell_type, connectivity).expect("steered");
        assert!(plain != mesh.points());
        for (a, b) in plain.iter().flatten().zip(mirror(&image).iter().flatten()) {
            assert!((a - b).abs() < 1e-6, "{a} {b}");
        }
    }
    // Tetrahedra with two vertices exchanged, and hexahedra along x, then y, then z.
    let other = |rows: &[u32], order: &[usize]| -> Vec<u32> {
        rows.chunks(order.len()).flat_map(|row| order.iter().map(|&local| row[local])).collect()
    };
    let turned = other(tets.cells().connectivity(), &[0, 2, 1, 3]);
    let plain =
        squeezed(tets.points(), CellType::Tetra, tets.cells().connectivity()).expect("steered");
    assert_eq!(squeezed(tets.points(), CellType::Tetra, &turned).expect("steered"), plain);
    let lexicographic = other(hexahedra.cells().connectivity(), &[0, 1, 3, 2, 4, 5, 7, 6]);
    let error = squeezed(hexahedra.points(), CellType::Hexahedron, &lexicographic)
        .expect_err("refused")
        .to_string();
    assert!(error.contains("VTK's order is") && error.contains("lexicographic"), "{error}");
}

/// A solver that copies its coordinates only where they are looked at.
#[test]
fn an_order_waits_for_a_solver_that_was_spared_its_coordinates() {
    let mut solver = Solver::with_config(
        r#"{"version": 1, "stream": {"listen": "127.0.0.1:0"}, "steering": {"background": false}}"#,
    );
    solver.step();
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    let begun = Instant::now();
    while solver.adaptor.looks_at(&Step { cycle: solver.cycle, time: 0.0, time_step: 0.01 }) {
        assert!(begun.elapsed() < PATIENCE, "the mesh is looked at for ever");
        solver.step();
        std::thread::sleep(Duration::from_millis(1));
    }
    // Behind its back.
    viewer.send(&json!({"id": "o", "order": squeeze(0.2)}));
    viewer.wait_for("order", |order| order["status"] == "accepted");
    let stale: Vec<Vector> =
        solver.mesh.points().iter().map(|[x, y, z]| [x + 9.0, *y, *z]).collect();
    let mesh = solver.mesh.clone();
    solver.mesh = mesh.with_points(stale).expect("finite");
    solver.step();
    assert!(solver.motions.is_empty());
    solver.mesh = mesh;
    solver.step_until("the shape", |solver| !solver.motions.is_empty());
    solver.steps(1);
    for (point, reference) in solver.mesh.points().iter().zip(solver.reference.points()) {
        if reference[2] == 1.0 {
            assert_eq!(*point, [reference[0], reference[1], reference[2] + -0.2]);
        }
    }
}
