//! Several ranks, which are threads here, that go on from a checkpoint while viewers take orders back.

mod common;

use std::{path::Path, sync::Arc, thread::JoinHandle};

use common::{Viewer, bits, config, has_status, long, squeeze};
use serde_json::{Value, json};
use tombolo::{
    Adaptor, OrderReport, Settings, Step,
    communicator::{Communicator, threads},
    deform::{
        distributed::{Part, in_order},
        mesh::{Mesh, Vector},
        shapes::box_of_tets,
    },
    pipelines::extract::Channel,
};

const CONFIG: &str = r#"{"version": 1, "journal": "journal.jsonl",
    "stream": {"listen": "127.0.0.1:0"}, "pipelines": []}"#;

fn has(viewer: &mut Viewer, id: &str, status: &str) -> Value {
    viewer.wait_for("order", has_status(id, status))
}

/// The end of a run on one rank.
struct Ended {
    /// The cycle in which it was stopped.
    cycle: u64,
    /// The orders that moved the mesh.
    moved: Vec<String>,
    points: Vec<Vector>,
    global: Vec<u64>,
    orders: Vec<OrderReport>,
}

/// Runs until a viewer stops it, who is connected before the first step, and saves the state.
fn run(
    ranks: usize,
    mesh: &Mesh,
    output: &Path,
    first: u64,
    steers: fn(&mut Viewer),
) -> Vec<Ended> {
    let file = output.join("run.checkpoint");
    threads::run(ranks, |communicator| {
        let rank = communicator.rank();
        let of_cells = in_order(mesh.cells().len(), ranks);
        let mut part = Part::cut(mesh, &of_cells, rank, true).expect("a part");
        let settings =
            Settings { config: config(CONFIG), output: output.into(), ..Settings::default() };
        let settings = settings.on(Arc::new(communicator));
        let settings = if first > 0 { settings.restart_from_file(&file) } else { settings };
        let mut adaptor = Adaptor::initialize(settings).expect("initialize");
        let steering: Option<JoinHandle<()>> = (rank == 0).then(|| {
            let mut viewer = Viewer::connect(&adaptor);
            viewer.hello();
            std::thread::spawn(move || steers(&mut viewer))
        });
        let (mut cycle, mut moved) = (first, Vec::new());
        loop {
            let step = Step { cycle, time: cycle as f64 * 0.01, time_step: 0.01 };
            let channel = Channel { name: "fluid", mesh: part.view(), fields: &[] };
            let steering = adaptor.execute(&step, &[channel]).expect("execute");
            if let Some(motion) = steering.motion {
                moved.push(motion.order.clone());
                part.points.copy_from_slice(&motion.coordinates);
            }
            if steering.stop {
                break;
            }
            std::thread::sleep(std::time::Duration::from_millis(2));
            cycle += 1;
            assert!(cycle < 100_000, "nobody stopped the run");
        }
        adaptor.write_checkpoint(&file).expect("saved");
        let orders = adaptor.finalize().expect("finalize").orders;
        steering.into_iter().for_each(|thread| thread.join().expect("the viewer"));
        let global = part.global_vertices.clone().expect("numbers");
        Ended { cycle, moved, points: part.points, global, orders }
    })
}

/// The mesh that all ranks have come to; those that share a vertex have it at the same place.
fn gathered(mesh: &Mesh, ended: &[Ended]) -> Mesh {
    let mut points: Vec<Option<Vector>> = vec![None; mesh.points().len()];
    for of_rank in ended {
        for (number, point) in of_rank.global.iter().zip(&of_rank.points) {
            let place = &mut points[usize::try_from(*number).unwrap()];
            assert!(place.is_none_or(|known| known.map(f64::to_bits) == point.map(f64::to_bits)));
            *place = Some(*point);
        }
    }
    mesh.with_points(points.into_iter().map(|point| point.expect("all")).collect()).expect("finite")
}

fn same_on_all_ranks(ended: &[Ended]) {
    for of_rank in ended {
        assert_eq!((of_rank.cycle, &of_rank.moved), (ended[0].cycle, &ended[0].moved));
    }
}

/// Moves the mesh, and stops the run while the shapes of an order are found: that is left to the run that
/// goes on.
fn leave_open(viewer: &mut Viewer) {
    viewer.send(&json!({"id": "first", "order": squeeze(0.1)}));
    has(viewer, "first", "applied");
    viewer.send(&json!({"id": "long", "order": long(0.3)}));
    has(viewer, "long", "computing");
    viewer.send(&json!({"stop": {}}));
    // Its shapes are given up, and it waits again.
    let again = has_again(viewer, "long");
    assert_eq!(again["waits_for"], "the solver's next call");
}

/// Waits until an order whose shapes were being found waits again.
fn has_again(viewer: &mut Viewer, id: &str) -> Value {
    viewer.seen.retain(|message| message["order"]["id"] != id);
    has(viewer, id, "accepted")
}

/// Takes back what the run before has left, and an order of its own.
fn take_back(viewer: &mut Viewer) {
    for (id, is_new) in [("long", false), ("longer", true)] {
        if is_new {
            viewer.send(&json!({"id": id, "order": long(0.3)}));
        }
        has(viewer, id, "computing");
        viewer.send(&json!({"id": format!("cancel-{id}"), "cancel": {"order": id}}));
        has_again(viewer, id);
        let rejected = has(viewer, id, "rejected");
        let reason = rejected["reason"].as_str().expect("a reason");
        assert!(reason.starts_with("cancelled by c"), "{reason}");
    }
    viewer.send(&json!({"id": "short", "order": squeeze(0.05)}));
    has(viewer, "short", "applied");
    viewer.send(&json!({"stop": {}}));
}

#[test]
fn an_order_is_cancelled_on_all_ranks_of_a_run_that_goes_on() {
    for ranks in [2, 3] {
        let output = tempfile::tempdir().unwrap();
        let reference = box_of_tets([16, 16, 16], [0.0; 3], [1.0; 3]);
        let before = run(ranks, &reference, output.path(), 0, leave_open);
        same_on_all_ranks(&before);
        assert!(!before[0].moved.is_empty());
        assert!(before[0].moved.iter().all(|order| order == "first"), "{:?}", before[0].moved);
        let mesh = gathered(&reference, &before);
        let after = run(ranks, &mesh, output.path(), before[0].cycle + 1, take_back);
        same_on_all_ranks(&after);
        assert!(!after[0].moved.is_empty());
        assert!(after[0].moved.iter().all(|order| order == "short"), "{:?}", after[0].moved);
        assert!(bits(&gathered(&reference, &after)) != bits(&mesh));
        let orders = after[0].orders.iter();
        let ids: Vec<String> =
            orders.map(|order| format!("{} {:?}", order.id, order.status)).collect();
        assert_eq!(
            ids,
            ["first Applied", "long Rejected", "longer Rejected", "short Applied"],
            "{ranks} ranks"
        );
        // The one that goes on from there has nothing left to do.
        let mesh = gathered(&reference, &after);
        let last = run(ranks, &mesh, output.path(), after[0].cycle + 1, |viewer| {
            viewer.wait_for("status", |status| status["cycle"].as_u64() > Some(0));
            viewer.send(&json!({"stop": {}}));
        });
        same_on_all_ranks(&last);
        assert!(last[0].moved.is_empty(), "{:?}", last[0].moved);
        assert!(bits(&gathered(&reference, &last)) == bits(&mesh));
    }
}
