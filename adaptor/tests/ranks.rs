//! Runs on several ranks, which are threads here: they do the same at the same cycle, whatever
//! viewers or one of them do.

mod common;

use std::{sync::Arc, time::Duration};

use common::{LINK_TO_ALL, Viewer, config, squeeze};
use serde_json::json;
use tokio_tungstenite::tungstenite::Message;
use tombolo::{
    Adaptor, Parameter, Settings, Step,
    communicator::{Communicator, Counted, threads},
    deform::distributed::{Part, in_order},
    deform::{
        mesh::{CellType, FeatureSource, Mesh},
        shapes::{BOX_FEATURES, box_of_tets},
    },
    pipelines::{
        encode::Decoder,
        extract::{Channel, FieldView},
        language::parse_orders,
    },
};

const RANKS: usize = 3;

fn part(mesh: &Mesh, rank: usize) -> Part {
    let of_cells = in_order(mesh.cells().len(), RANKS);
    Part::cut(mesh, &of_cells, rank, true).expect("a part")
}

fn speed(part: &Part) -> Vec<f64> {
    part.points.iter().map(|[x, y, z]| x + y * z).collect()
}

fn step(cycle: u64) -> Step {
    Step { cycle, time: cycle as f64 * 0.01, time_step: 0.01 }
}

#[test]
fn what_viewers_ask_for_happens_at_the_same_cycle() {
    let mesh = box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]);
    let outcomes = threads::run(RANKS, |ranks| {
        let rank = ranks.rank();
        let part = part(&mesh, rank);
        let inflow = Parameter { name: "inflow".into(), value: 1.0, minimum: 0.0, maximum: 10.0 };
        let mut adaptor = Adaptor::initialize(Settings {
            config: config(LINK_TO_ALL),
            communicator: Arc::new(ranks),
            parameters: vec![inflow],
            ..Settings::default()
        })
        .expect("initialize");
        assert_eq!(adaptor.link().is_some(), rank == 0);
        let speed = speed(&part);
        let fields = [FieldView::vertex("speed", &speed)];
        let channels = [Channel { name: "fluid", mesh: part.view(), fields: &fields }];
        let (mut first, mut second) = (None::<Viewer>, None::<Viewer>);
        let (mut cycle, mut changes) = (0, Vec::new());
        let (mut moved, mut is_told) = (None, false);
        loop {
            let steering = adaptor.execute(&step(cycle), &channels).expect("execute");
            if let Some(motion) = steering.motion {
                moved.get_or_insert(cycle);
                assert_eq!(motion.coordinates.len(), part.points.len());
            }
            changes.extend(
                steering.parameters.iter().map(|(name, value)| (cycle, name.clone(), *value)),
            );
            if steering.stop {
                break;
            }
            if rank == 0 {
                match cycle {
                    // Sees the whole surface, says something, and is gone.
                    0 => first = Some(Viewer::connect(&adaptor)),
                    5 => {
                        let viewer = first.as_mut().expect("connected");
                        viewer.hello();
                        viewer.send(
                            &json!({"id": "more", "parameter": {"name": "inflow", "value": 2.0}}),
                        );
                    }
                    25 => {
                        let mut viewer = Viewer::connect(&adaptor);
                        viewer.hello();
                        viewer.send(&json!({"id": "what", "forecast": squeeze(0.2)}));
                        viewer.send(&json!({"id": "far", "forecast": squeeze(2.0)}));
                        viewer.send(&json!({"id": "press", "order": squeeze(0.1)}));
                        second = Some(viewer);
                    }
                    _ => {}
                }
                // Only steps bring frames and answers.
                let short = Duration::from_millis(5);
                if cycle > 5
                    && let Some(viewer) = &mut first
                {
                    let _ = viewer.look_for("nothing", short, |_| false);
                    if !viewer.frames.is_empty() {
                        let mut decoder = Decoder::new();
                        assert!(viewer.frames.iter().all(|frame| decoder.decode(frame).is_ok()));
                        // The wheel is kept for one that is gone without a word.
                        viewer.send_message(Message::Close(None));
                        first = None;
                    }
                }
                if cycle >= 40 && !is_told && first.is_none() {
                    let viewer = second.as_mut().expect("connected");
                    // The newest question of a client is the one that is answered.
                    let told = viewer.look_for("forecast", short, |told| told["id"] == "far");
                    if let Some(told) = told {
                        is_told = true;
                        if viewer.look_for("forecast", short, |told| told["id"] == "what").is_none()
                        {
                            let error = viewer.wait_for("error", |error| error["id"] == "what");
                            let message = error["message"].as_str();
                            assert!(message.is_some_and(|it| it.contains("a later forecast")));
                        }
                        assert_eq!(told["order"]["outcome"], "rejected", "{told}");
                        viewer.send(&json!({"pause": {}}));
                        viewer.send(&json!({"resume": {}}));
                        viewer.send(&json!({"id": "end", "stop": {}}));
                    }
                }
                std::thread::sleep(Duration::from_millis(5));
            }
            cycle += 1;
            assert!(cycle < 100_000, "nobody stopped the run");
        }
        drop(second);
        adaptor.finalize().expect("finalize");
        (cycle, changes, moved)
    });
    assert!(outcomes.iter().all(|outcome| *outcome == outcomes[0]), "{outcomes:?}");
    assert!(outcomes[0].2.is_some(), "the order was not carried out");
    assert!(
        outcomes[0].0 >= 40
            && outcomes[0].1.iter().any(|(_, name, value)| name == "inflow" && *value == 2.0)
    );
}

/// Gives orders in a pause: one is cancelled, one waits for too long, and one is carried out.
fn steer_in_a_pause(viewer: &mut Viewer) {
    let wait = |viewer: &mut Viewer, id: &str, status: &str, why: &str| {
        viewer.wait_for("order", |order| {
            let reasons = format!("{} {}", order["waits_for"], order["reason"]);
            order["id"] == id && order["status"] == status && reasons.contains(why)
        });
    };
    viewer.send(&json!({"pause": {}}));
    viewer.wait_for("status", |status| status["paused"] == true);
    viewer.send(&json!({"id": "first", "order": squeeze(0.3)}));
    wait(viewer, "first", "computing", "paused");
    viewer.send(&json!({"cancel": {"order": "first"}}));
    wait(viewer, "first", "rejected", "cancelled by c1");
    viewer.send(&json!({"id": "late", "order": squeeze(0.2)}));
    wait(viewer, "late", "computing", "paused");
    wait(viewer, "late", "rejected", "steering.deadline");
    viewer.send(&json!({"id": "last", "order": squeeze(0.1)}));
    wait(viewer, "last", "computing", "paused");
    viewer.send(&json!({"resume": {}}));
    wait(viewer, "last", "applied", "");
    viewer.send(&json!({"stop": {}}));
}

#[test]
fn orders_given_in_a_pause_begin_nothing_on_any_rank() {
    let mesh = box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]);
    let outcomes = threads::run(RANKS, |ranks| {
        let rank = ranks.rank();
        let part = part(&mesh, rank);
        let mut config = config(LINK_TO_ALL);
        config.steering.deadline = std::num::NonZeroU32::new(10).expect("not 0");
        let communicator = Arc::new(ranks);
        let mut adaptor =
            Adaptor::initialize(Settings { config, communicator, ..Settings::default() })
                .expect("initialize");
        let steered = (rank == 0).then(|| {
            let mut viewer = Viewer::connect(&adaptor);
            std::thread::spawn(move || steer_in_a_pause(&mut viewer))
        });
        let speed = speed(&part);
        let fields = [FieldView::vertex("speed", &speed)];
        let channels = [Channel { name: "fluid", mesh: part.view(), fields: &fields }];
        let mut moved = Vec::new();
        for cycle in 0.. {
            let steering = adaptor.execute(&step(cycle), &channels).expect("execute");
            moved.extend(steering.motion.map(|motion| (cycle, motion.order.to_string())));
            if steering.stop {
                break;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        steered.into_iter().for_each(|steered| steered.join().expect("all was told"));
        adaptor.finalize().expect("finalize");
        moved
    });
    assert!(outcomes.iter().all(|outcome| *outcome == outcomes[0]), "{outcomes:?}");
    assert!(outcomes[0].len() == 1 && outcomes[0][0].1 == "last", "{outcomes:?}");
}

#[test]
fn a_mistake_on_one_rank_is_the_same_error_on_all() {
    let mesh = box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]);
    let outcomes = threads::run(RANKS, |ranks| {
        let rank = ranks.rank();
        let part = part(&mesh, rank);
        let mut adaptor =
            Adaptor::initialize(Settings { communicator: Arc::new(ranks), ..Settings::default() })
                .expect("initialize");
        let channels = [Channel { name: "fluid", mesh: part.view(), fields: &[] }];
        let mut said = Vec::new();
        for cycle in 0..6 {
            let mut step = step(cycle);
            if rank == 2 && cycle == 2 {
                step.time = f64::NAN;
            }
            if rank == 1 && cycle == 4 {
                step.cycle = 40;
            }
            let shown = if rank == 1 && cycle == 3 { &channels[..0] } else { &channels[..] };
            said.push(adaptor.execute(&step, shown).map(|_| ()).map_err(|error| error.to_string()));
        }
        adaptor.finalize().expect("finalize");
        said
    });
    assert!(outcomes.iter().all(|outcome| *outcome == outcomes[0]), "{outcomes:?}");
    let fault = |cycle: usize| outcomes[0][cycle].clone().expect_err("an error");
    assert!(fault(2).starts_with("rank 2: cycle 2: time is NaN"), "{}", fault(2));
    assert!(fault(3).starts_with("rank 1: cycle 3: no channel"), "{}", fault(3));
    assert!(fault(4).contains("cycles from 4 to 40"), "{}", fault(4));
    assert!([0, 1, 5].iter().all(|&cycle: &usize| outcomes[0][cycle].is_ok()), "{outcomes:?}");
}

/// A fault between two meetings waits for the next, and what falls due between them too.
#[test]
fn ranks_come_together_as_often_as_they_are_told() {
    let text = LINK_TO_ALL.replacen('{', r#"{"steering": {"poll_steps": 4}, "#, 1);
    let mesh = box_of_tets([3, 3, 3], [0.0; 3], [1.0; 3]);
    let outcomes = threads::run(RANKS, |ranks| {
        let rank = ranks.rank();
        let part = part(&mesh, rank);
        let ranks = Counted::new(ranks);
        let counted = Arc::new(ranks);
        let communicator: Arc<dyn Communicator> = Arc::clone(&counted) as Arc<dyn Communicator>;
        let mut adaptor = Adaptor::initialize(Settings {
            config: config(&text),
            communicator,
            ..Settings::default()
        })
        .expect("set up");
        let channels = [Channel { name: "fluid", mesh: part.view(), fields: &[] }];
        let mut said = Vec::new();
        for cycle in 0..13 {
            let mut step = step(cycle);
            // Between two meetings, and for one rank only: a NaN, and another cycle.
            if rank == 2 && cycle == 5 {
                step.time = f64::NAN;
            }
            if rank == 1 && cycle == 10 {
                step.cycle = 11;
            }
            let before = counted.traffic();
            let outcome =
                adaptor.execute(&step, &channels).map(|_| ()).map_err(|error| error.to_string());
            said.push((outcome, counted.traffic() == before));
        }
        adaptor.finalize().expect("finalize");
        said
    });
    for said in &outcomes {
        for (cycle, (outcome, silent)) in said.iter().enumerate() {
            assert_eq!(*silent, cycle % 4 != 0, "cycle {cycle}");
            match cycle {
                8 => assert!(
                    outcome
                        .clone()
                        .is_err_and(|text| text.starts_with("rank 2: cycle 5: time is NaN")),
                    "{outcome:?}"
                ),
                _ => assert_eq!(*outcome, Ok(()), "cycle {cycle}"),
            }
        }
    }
}

/// Also where a rank is shown another cycle between them, which is told at none.
#[test]
fn steps_that_fall_due_between_two_meetings_run_at_the_next() {
    let text = r#"{"version": 1, "steering": {"poll_steps": 10}, "pipelines": [
        {"name": "rare", "every": {"steps": 10}, "stages": [{"quality": {}}]},
        {"name": "rarer", "every": {"steps": 30}, "stages": [{"quality": {}}]}]}"#;
    let mesh = box_of_tets([3, 3, 3], [0.0; 3], [1.0; 3]);
    let output = tempfile::tempdir().expect("a directory");
    let file = output.path().join("run.checkpoint");
    let run = |cycles: std::ops::Range<u64>, restarts: bool| {
        threads::run(RANKS, |ranks| {
            let rank = ranks.rank();
            let part = part(&mesh, rank);
            let settings = Settings { config: config(text), ..Settings::default() };
            let settings = settings.on(Arc::new(ranks));
            let settings = if restarts { settings.restart_from_file(&file) } else { settings };
            let mut adaptor = settings.start().expect("set up");
            let channels = [Channel { name: "fluid", mesh: part.view(), fields: &[] }];
            for cycle in cycles.clone() {
                let shown = if rank == 1 && [10, 20].contains(&cycle) { cycle + 1 } else { cycle };
                adaptor.execute(&step(shown), &channels).expect("a step");
            }
            adaptor.write_checkpoint(&file).expect("saved");
            ["rare", "rarer"].map(|name| {
                let history = adaptor.history(name).expect("a pipeline");
                history.measured().map(|measured| measured.cycle).collect::<Vec<u64>>()
            })
        })
    };
    let outcomes = run(1..45, false);
    assert_eq!(outcomes, vec![[vec![11, 21, 31, 41], vec![31]]; RANKS]);
    // A run that goes on has not forgotten what fell due before.
    run(1..31, false);
    let outcomes = run(31..45, true);
    assert_eq!(outcomes, vec![[vec![11, 21, 31, 41], vec![31]]; RANKS]);
}

/// A rank whose mesh makes no sense takes no other with it: the error is named, with its rank, and
/// the run goes on.
#[test]
fn a_bad_cell_on_one_rank_holds_nobody_up() {
    let mesh = box_of_tets([3, 3, 3], [0.0; 3], [1.0; 3]);
    let faults = [
        |part: &mut Part| part.points[3][1] = f64::NAN,
        |part: &mut Part| {
            let vertices = part.cells.vertices(0).to_vec();
            // The same tetrahedron a second time and a third: its faces have three cells.
            for _ in 0..2 {
                part.cells.push(CellType::Tetra, &vertices).expect("a cell");
                part.global_cells.iter_mut().for_each(|numbers| numbers.push(9999));
                part.ghosts.iter_mut().for_each(|ghosts| ghosts.push(0));
            }
        },
        |part: &mut Part| {
            part.global_vertices.iter_mut().for_each(|numbers| numbers[1] = numbers[0])
        },
    ];
    for fault in faults {
        let outcomes = threads::run(RANKS, |ranks| {
            let rank = ranks.rank();
            let mut part = part(&mesh, rank);
            if rank == 1 {
                fault(&mut part);
            }
            let settings = Settings {
                config: config(LINK_TO_ALL),
                communicator: Arc::new(ranks),
                ..Settings::default()
            };
            let mut adaptor = Adaptor::initialize(settings).expect("initialize");
            let speed = speed(&part);
            let fields = [FieldView::vertex("speed", &speed)];
            let channels = [Channel { name: "fluid", mesh: part.view(), fields: &fields }];
            let said: Vec<_> = (0..4)
                .map(|cycle| {
                    adaptor
                        .execute(&step(cycle), &channels)
                        .map(|_| ())
                        .map_err(|error| error.to_string())
                })
                .collect();
            adaptor.finalize().expect("finalize");
            said
        });
        assert!(outcomes.iter().all(|outcome| *outcome == outcomes[0]), "{outcomes:?}");
        assert!(
            outcomes[0]
                .iter()
                .flat_map(|outcome| outcome.as_ref().err())
                .all(|text| text.contains("rank 1"))
        );
    }
}

/// An order falls into the schedule of another, and one cannot be done: at each cycle all ranks are
/// handed the same shape as one process is, and vertices that several of them have, ghosts too, go to
/// the same place.
#[test]
fn orders_take_effect_on_all_ranks_at_the_same_cycle() {
    const ORDERS: &str = r#"[
        {"at": {"cycle": 1}, "id": "first", "order": {"edits": [
            {"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0.1, 0, 0.2]}}],
            "schedule": {"steps": 5, "every": {"steps": 2}}}},
        {"at": {"cycle": 4}, "id": "amid", "order": {"edits": [
            {"translate": {"features": ["x-max"], "fixed": ["x-min"], "by": [0.3, 0, 0]}}], "schedule": {"steps": 3}}},
        {"at": {"cycle": 6}, "id": "none", "order": {"edits": [
            {"translate": {"features": ["z-mxa"], "fixed": ["z-min"], "by": [0, 0, 0.1]}}]}},
        {"at": {"cycle": 9}, "id": "broken", "order": {"edits": [
            {"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0, 0, -3]}}]}},
        {"at": {"cycle": 10}, "id": "back", "order": {"undo": 2}}]"#;
    let mesh = named_box();
    let run = |ranks: usize| {
        threads::run(ranks, |communicator| {
            let rank = communicator.rank();
            let part = if ranks == 1 {
                Part {
                    global_vertices: Some((0..mesh.points().len() as u64).collect()),
                    ..whole(&mesh)
                }
            } else {
                part(&mesh, rank)
            };
            let orders = parse_orders(ORDERS, "orders.json").expect("orders");
            let settings =
                Settings { orders, communicator: Arc::new(communicator), ..Settings::default() };
            let mut adaptor = Adaptor::initialize(settings).expect("initialize");
            let mut present = part.clone();
            let mut shapes = Vec::new();
            for cycle in 0..13 {
                let moved = {
                    let channels = [Channel { name: "fluid", mesh: present.view(), fields: &[] }];
                    let steering = adaptor.execute(&step(cycle), &channels).expect("execute");
                    steering.motion.map(|motion| {
                        (motion.coordinates.to_vec(), motion.order.to_owned(), motion.shape)
                    })
                };
                if let Some((coordinates, order, shape)) = moved {
                    let placed = part
                        .global_vertices
                        .iter()
                        .flatten()
                        .copied()
                        .zip(coordinates.iter().copied());
                    shapes.push((cycle, order, shape, placed.collect::<Vec<_>>()));
                    present.points = coordinates;
                }
            }
            (shapes, adaptor.finalize().expect("finalize"))
        })
    };
    let alone = run(1).remove(0);
    let statuses: Vec<_> = alone
        .1
        .orders
        .iter()
        .map(|order| (order.id.clone(), order.status, order.cycle_applied))
        .collect();
    assert!(alone.0.len() >= 6, "{statuses:?}");
    let many = run(RANKS);
    let told: Vec<_> = many[0]
        .1
        .orders
        .iter()
        .map(|order| (order.id.clone(), order.status, order.cycle_applied))
        .collect();
    assert_eq!(told, statuses);
    for (rank, (shapes, _)) in many.iter().enumerate() {
        assert_eq!(shapes.len(), alone.0.len());
        for (found, expected) in shapes.iter().zip(&alone.0) {
            assert_eq!(
                (found.0, &found.1, found.2),
                (expected.0, &expected.1, expected.2),
                "rank {rank}"
            );
            for (number, place) in &found.3 {
                let there = expected.3[*number as usize].1;
                let apart =
                    (0..3).map(|axis| (place[axis] - there[axis]).abs()).fold(0.0, f64::max);
                assert!(
                    apart < 1e-8,
                    "rank {rank}, cycle {}, vertex {number}: {place:?} and {there:?}",
                    found.0
                );
            }
        }
        // Back to the bits of the beginning.
        let last = &shapes.last().expect("shapes").3;
        assert!(
            last.iter().all(|(number, place)| *place == mesh.points()[*number as usize]),
            "rank {rank}"
        );
    }
}

/// A box whose sides have names.
fn named_box() -> Mesh {
    let mesh = box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]);
    let FeatureSource::Faces(tagged) = mesh.features() else { panic!("a box has tagged faces") };
    let mut tagged = tagged.clone();
    tagged.names = (1..).zip(BOX_FEATURES.map(str::to_owned)).collect();
    Mesh::new(mesh.points().to_vec(), mesh.cells().clone(), FeatureSource::Faces(tagged))
        .expect("a mesh")
}

fn whole(mesh: &Mesh) -> Part {
    Part::of(&mesh.into()).expect("a part")
}

#[test]
fn a_run_does_not_begin_with_different_configurations() {
    let outcomes = threads::run(2, |ranks| {
        let text = if ranks.rank() == 0 {
            LINK_TO_ALL.to_owned()
        } else {
            LINK_TO_ALL.replace("boundary", "border")
        };
        let settings = Settings {
            config: config(&text),
            communicator: Arc::new(ranks),
            ..Settings::default()
        };
        Adaptor::initialize(settings).map(drop).map_err(|error| error.to_string())
    });
    let expected =
        Err("rank 1: its configuration, orders, parameters or conditions are not those of rank 0"
            .to_owned());
    assert_eq!(outcomes, [expected.clone(), expected]);
}

/// Orders take effect at the same cycle on all ranks, and give what they give on one; undone, every
/// rank has its own coordinates back bit for bit. The second order comes in the middle of the first
/// one's schedule, the third makes no sense.
#[test]
fn orders_move_all_parts_at_the_same_cycle() {
    let mesh = box_of_tets([5, 5, 5], [0.0; 3], [1.0; 3]);
    let orders = r#"[
        {"at": {"cycle": 2}, "order": {"edits": [
            {"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0.0, 0.1, -0.2]}}], "schedule": {"steps": 6}}},
        {"at": {"cycle": 4}, "order": {"edits": [
            {"translate": {"features": ["x-max"], "fixed": ["x-min"], "by": [0.1, 0.0, 0.0]}}], "schedule": {"steps": 3}}},
        {"at": {"cycle": 9}, "order": {"edits": [
            {"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0.0, 0.0, -5.0]}}]}},
        {"at": {"cycle": 10}, "order": {"undo": 2}}]"#;
    let run = |communicator: Arc<dyn Communicator>, part: &Part| {
        let numbers: Vec<usize> =
            part.global_vertices.iter().flatten().map(|&number| number as usize).collect();
        let mut points = part.points.clone();
        let orders = tombolo::pipelines::language::parse_orders(orders, "orders").expect("orders");
        let mut adaptor =
            Adaptor::initialize(Settings { communicator, orders, ..Settings::default() })
                .expect("initialize");
        let mut shapes = Vec::new();
        for cycle in 0..14 {
            let moving = Part { points: points.clone(), ..part.clone() };
            let channels = [Channel { name: "fluid", mesh: moving.view(), fields: &[] }];
            if let Some(motion) = adaptor.execute(&step(cycle), &channels).expect("execute").motion
            {
                points.copy_from_slice(&motion.coordinates);
                shapes.push((cycle, motion.shape, points.clone()));
            }
        }
        assert_eq!(points, part.points);
        (numbers, shapes, adaptor.finalize().expect("finalize").orders)
    };
    let whole = Part::whole(&mesh).expect("a part");
    let (_, serial, told) = run(Arc::new(tombolo::communicator::Solo), &whole);
    assert_eq!(
        serial.len(),
        2 + 3 + 1,
        "two shapes of the first order, three of the second, the way back"
    );
    let outcomes = threads::run(RANKS, |ranks| {
        let part = part(&mesh, ranks.rank());
        run(Arc::new(ranks), &part)
    });
    for (rank, (numbers, shapes, orders)) in outcomes.iter().enumerate() {
        assert_eq!(shapes.len(), serial.len());
        for ((cycle, shape, points), (expected_cycle, expected_shape, expected)) in
            shapes.iter().zip(&serial)
        {
            assert_eq!((cycle, shape), (expected_cycle, expected_shape));
            for (point, &number) in points.iter().zip(numbers) {
                let off = (0..3)
                    .map(|axis| (point[axis] - expected[number][axis]).abs())
                    .fold(0.0, f64::max);
                assert!(off < 1e-7, "cycle {cycle}: vertex {number} is {off:e} off");
            }
        }
        if rank == 0 {
            for (order, expected) in orders.iter().zip(&told) {
                assert_eq!(
                    (order.status, order.cycle_applied),
                    (expected.status, expected.cycle_applied)
                );
                assert_eq!(order.reason.is_some(), expected.reason.is_some());
            }
        }
    }
}

#[test]
fn an_order_that_waits_too_long_for_the_solver_is_rejected_on_all_ranks() {
    let mesh = box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]);
    let moved = threads::run(RANKS, |ranks| {
        let rank = ranks.rank();
        let part = part(&mesh, rank);
        let mut settings = Settings {
            config: config(LINK_TO_ALL),
            communicator: Arc::new(ranks),
            ..Settings::default()
        };
        settings.config.steering.deadline = std::num::NonZeroU32::MIN;
        let mut adaptor = Adaptor::initialize(settings).expect("initialize");
        let speed = speed(&part);
        let fields = [FieldView::vertex("speed", &speed)];
        let channels = [Channel { name: "fluid", mesh: part.view(), fields: &fields }];
        let mut viewer = None;
        let mut moved = false;
        for cycle in 0..5 {
            moved |= adaptor.execute(&step(cycle), &channels).expect("execute").motion.is_some();
            if rank == 0 && cycle == 0 {
                let connected = viewer.insert(Viewer::connect(&adaptor));
                connected.hello();
                connected.send(&json!({"id": "late", "order": squeeze(0.1)}));
                connected.wait_for("order", |order| order["status"] == "accepted");
                std::thread::sleep(Duration::from_millis(1200));
            }
        }
        if let Some(mut viewer) = viewer {
            let late = viewer.wait_for("order", |order| order["status"] == "rejected");
            assert!(late["reason"].as_str().unwrap().contains("steering.deadline"), "{late}");
        }
        adaptor.finalize().expect("finalize");
        moved
    });
    assert_eq!(moved, [false; RANKS]);
}
