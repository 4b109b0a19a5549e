//! A run as solvers in other languages show it: a step that is refused leaves nothing of it behind,
//! on one rank and on two that do not meet at every call.

use std::sync::Arc;

use tombolo::communicator::{Communicator, threads};
use tombolo::deform::mesh::CellType;
use tombolo::deform::shapes::box_of_tets;
use tombolo::foreign::mesh::{Block, Channel, Coordset, Domain, Label, Mask, Roles, Topology};
use tombolo::foreign::{Array, Kind, NumberType, Run, Shown};
use tombolo::pipelines::language;
use tombolo::{OrderReport, OrderStatus, Settings, Step};

/// A mesh in the memory of a solver, by the addresses of its arrays.
fn channel<'call>(points: &'call [[f64; 3]], cells: &'call [u32]) -> Channel<'call> {
    // SAFETY: the numbers live as long as the array.
    let connectivity =
        unsafe { Array::new(cells.as_ptr().cast(), cells.len(), 4, NumberType::U32, false) };
    channel_of(points, connectivity)
}

fn channel_of<'call>(points: &'call [[f64; 3]], connectivity: Array<'call>) -> Channel<'call> {
    let axis = |axis: usize| {
        let first = points.as_flattened()[axis..].as_ptr().cast();
        // SAFETY: one coordinate of each point, which live as long as the array.
        unsafe { Array::new(first, points.len(), 24, NumberType::F64, false) }
    };
    let label = Label::Words("channel 'solid'".into());
    let domain = Domain {
        coordset: Coordset::Explicit { axes: (0..3).map(axis).collect() },
        topology: Topology::Uniform {
            cell_type: CellType::Tetra,
            connectivity,
            label: label.part("cells", "cells"),
        },
        fields: Vec::new(),
        faces: Vec::new(),
        roles: Roles::default(),
        label: label.clone(),
    };
    Channel {
        name: "solid".into(),
        label,
        blocks: vec![Block { name: String::new(), domain, mask: Mask::default() }],
        ..Channel::default()
    }
}

const ORDERS: &str = r#"[{"at": {"cycle": 4}, "order": {"edits": [{"translate": {
    "region": {"half_space": {"origin": [0, 0, 0.99], "normal": [0, 0, 1]}},
    "fixed_region": {"half_space": {"origin": [0, 0, 0.01], "normal": [0, 0, -1]}}, "by": [0, 0, -0.1]}}],
    "schedule": {"steps": 1}}}]"#;

/// What became of the cycles: whether the mesh was to move over each, or why it was refused; and what
/// became of the order.
type Outcome = (Vec<Result<bool, String>>, Vec<OrderReport>);

/// Runs a box for each rank, side by side, whose cells `change` replaces at each cycle; it is told
/// whether the rank is the last.
fn run_through(
    count: usize,
    change: impl Fn(usize, bool, &[u32]) -> Vec<u32> + Sync,
) -> Vec<Outcome> {
    threads::run(count, |ranks| {
        let rank = ranks.rank();
        // The pipeline has the mesh looked at in each step.
        let config = r#"{"version": 1, "steering": {"poll_steps": 3},
                         "pipelines": [{"name": "health", "stages": [{"quality": {}}]}]}"#;
        let mut run = Run::new(Settings {
            config: language::check(config, "configuration").expect("a configuration"),
            orders: language::check_orders(ORDERS, "orders").expect("orders"),
            communicator: Arc::new(ranks),
            ..Settings::default()
        })
        .expect("a run");
        let lower = rank as f64;
        let mesh = box_of_tets([2, 2, 2], [lower, 0.0, 0.0], [lower + 1.0, 1.0, 1.0]);
        let mut points = mesh.points().to_vec();
        let cycles = (0..10).map(|cycle| {
            let cells = change(cycle, rank + 1 == count, mesh.cells().connectivity());
            let step = Step { cycle: cycle as u64, time: 0.1 * cycle as f64, time_step: 0.1 };
            let looked_at = run.looks_at(&step);
            let shown = Shown { step, looked_at, channels: vec![channel(&points, &cells)] };
            let shown = run.execute(Ok(shown)).map_err(|error| error.to_string());
            let motion = run.asked().motion.as_ref();
            let moves = motion.is_some();
            if let Some(motion) = motion {
                points.clone_from_slice(&motion.coordinates);
            }
            shown.map(|_| moves)
        });
        let cycles = cycles.collect();
        (cycles, run.orders())
    })
}

/// The same cells, with a vertex that does not exist.
fn broken(mut cells: Vec<u32>) -> Vec<u32> {
    cells[1] = 1000;
    cells
}

/// The same cells from the last to the first.
fn reversed(cells: &[u32]) -> Vec<u32> {
    cells.as_chunks::<4>().0.iter().rev().flatten().copied().collect()
}

#[test]
fn cells_that_are_refused_end_no_steering() {
    for count in [1, 2] {
        let outcomes = run_through(count, |cycle, is_last, cells| match (cycle, is_last) {
            (1, true) => broken(cells.to_vec()),
            _ => cells.to_vec(),
        });
        for (cycles, _) in &outcomes {
            let said = cycles[1].as_ref().expect_err("a vertex that does not exist");
            assert!(said.contains("vertex 1000 does not exist"), "{said}");
            assert!(cycles.iter().enumerate().all(|(cycle, it)| cycle == 1 || it.is_ok()));
            assert!(cycles.contains(&Ok(true)), "{cycles:?}");
        }
        assert_eq!(outcomes[0].1[0].status, OrderStatus::Applied);
    }
}

#[test]
fn a_step_that_is_refused_is_asked_for_no_motion() {
    for count in [1, 2] {
        let undisturbed = run_through(count, |_, _, cells| cells.to_vec());
        let moving = undisturbed[0].0.iter().position(|it| *it == Ok(true)).expect("a motion");
        let outcomes = run_through(count, |cycle, is_last, cells| match (cycle, is_last) {
            (cycle, true) if cycle == moving + 1 => broken(cells.to_vec()),
            _ => cells.to_vec(),
        });
        for (cycles, _) in outcomes {
            assert_eq!(cycles[moving], Ok(true), "{cycles:?}");
            assert!(cycles[moving + 1].is_err() && cycles[moving + 2] == Ok(false), "{cycles:?}");
        }
    }
}

#[test]
fn another_mesh_is_taken_for_one_when_it_is_right() {
    for count in [1, 2] {
        let outcomes = run_through(count, |cycle, is_last, cells| match (cycle, is_last) {
            (0, _) => cells.to_vec(),
            (1, true) => broken(reversed(cells)),
            _ => reversed(cells),
        });
        for (cycles, _) in &outcomes {
            assert!(
                cycles[1].is_err() && cycles[2..].iter().all(|it| *it == Ok(false)),
                "{cycles:?}"
            );
        }
        let order = &outcomes[0].1[0];
        assert_eq!(order.status, OrderStatus::Rejected);
        let reason = order.reason.as_deref().unwrap_or_default();
        assert!(reason.contains("the solver has made another mesh"), "{reason}");
    }
}

/// Where nothing is looked at for some steps, and where everything is.
#[test]
fn cells_that_come_in_another_form_are_the_same_cells() {
    for config in [
        r#"{"version": 1}"#,
        r#"{"version": 1, "pipelines": [{"name": "health", "stages": [{"quality": {}}]}]}"#,
    ] {
        let mut run = Run::new(Settings {
            config: language::check(config, "configuration").expect("a configuration"),
            orders: language::check_orders(ORDERS, "orders").expect("orders"),
            ..Settings::default()
        })
        .expect("a run");
        let mesh = box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]);
        let mut points = mesh.points().to_vec();
        let cells = mesh.cells().connectivity();
        let apart: Vec<[i64; 2]> = cells.iter().map(|&vertex| [vertex.into(), -1]).collect();
        let mut moved = 0;
        for cycle in 0..10_u8 {
            let step = Step { cycle: cycle.into(), time: 0.1 * f64::from(cycle), time_step: 0.1 };
            let looked_at = run.looks_at(&step);
            let channel = if cycle % 4 < 2 {
                channel(&points, cells)
            } else {
                // SAFETY: the first of each pair of numbers, which live as long as the array.
                let connectivity = unsafe {
                    Array::new(apart.as_ptr().cast(), apart.len(), 16, NumberType::I64, false)
                };
                channel_of(&points, connectivity)
            };
            let shown = Shown { step, looked_at, channels: vec![channel] };
            run.execute(Ok(shown)).unwrap_or_else(|error| panic!("cycle {cycle}: {error}"));
            if let Some(motion) = &run.asked().motion {
                points.clone_from_slice(&motion.coordinates);
                moved += 1;
            }
        }
        assert!(moved > 0);
        assert_eq!(run.orders()[0].status, OrderStatus::Applied, "{:?}", run.orders());
    }
}

#[test]
fn a_rank_that_leaves_or_ends_early_holds_none_up() {
    for (leaves, expected) in
        [(true, "the solver has failed: no memory"), (false, "the run was ended on other ranks")]
    {
        let outcomes = threads::run(3, |ranks| {
            let is_last = ranks.rank() == 2;
            let lower = ranks.rank() as f64;
            let communicator: Arc<dyn Communicator> = Arc::new(ranks);
            let mut run =
                Run::new(Settings { communicator, ..Settings::default() }).expect("a run");
            let mesh = box_of_tets([2, 2, 2], [lower, 0.0, 0.0], [lower + 1.0, 1.0, 1.0]);
            let mut refused = None;
            for cycle in 0..5 {
                if is_last && cycle == 2 {
                    break;
                }
                let step = Step { cycle, time: 0.1 * cycle as f64, time_step: 0.1 };
                let looked_at = run.looks_at(&step);
                let channels = vec![channel(mesh.points(), mesh.cells().connectivity())];
                if let Err(error) = run.execute(Ok(Shown { step, looked_at, channels })) {
                    refused = Some((cycle, error.kind(), error.to_string()));
                    break;
                }
            }
            if leaves {
                run.leave("no memory");
            }
            let (report, ended) = run.finalize();
            ended.expect("the end");
            (refused, report.cycles)
        });
        let [first, second, last] = outcomes.try_into().expect("three ranks");
        assert_eq!(last, (None, 2));
        let kind = if leaves { Kind::Failure } else { Kind::Step };
        for (refused, cycles) in [first, second] {
            let (cycle, found, said) = refused.expect("an error in place of a wait");
            assert_eq!((cycle, found, cycles), (2, kind, 2));
            assert!(said.contains(expected), "{said}");
        }
    }
}
