//! Shapes that several ranks find together, inside of a step: what a viewer says meanwhile has them
//! given up on all ranks at the same place. The ranks are threads here.

mod common;

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use common::{LINK_TO_ALL, Viewer, config, has_status, long, squeeze};
use serde_json::json;
use tombolo::{
    Adaptor, Settings, Step,
    communicator::{Communicator, threads},
    deform::{
        distributed::{Part, in_order},
        shapes::box_of_tets,
    },
    pipelines::extract::Channel,
};

const RANKS: usize = 3;

/// A rank's last cycle, the orders that moved its mesh, and on rank 0 the viewer's findings.
type Outcome<T> = (u64, Vec<String>, Option<T>);

/// Steps on all ranks until the viewer stops them, which says something from a thread of its own.
fn run<T: Send>(say: impl Fn(&mut Viewer) -> T + Send + Sync) -> Vec<Outcome<T>> {
    let mesh = box_of_tets([24, 24, 24], [0.0; 3], [1.0; 3]);
    let of_cells = in_order(mesh.cells().len(), RANKS);
    let say = &say;
    threads::run(RANKS, |ranks| {
        let rank = ranks.rank();
        let part = Part::cut(&mesh, &of_cells, rank, true).expect("a part");
        let settings = Settings {
            config: config(LINK_TO_ALL),
            communicator: Arc::new(ranks),
            ..Settings::default()
        };
        let mut adaptor = Adaptor::initialize(settings).expect("initialize");
        std::thread::scope(|scope| {
            let (mut saying, mut moved, mut cycle) = (None, Vec::new(), 0);
            loop {
                let step = Step { cycle, time: cycle as f64 * 0.01, time_step: 0.01 };
                let channels = [Channel::new("fluid", part.view(), &[])];
                let steering = adaptor.execute(&step, &channels).expect("execute");
                moved.extend(steering.motion.map(|motion| motion.order.to_owned()));
                if steering.stop {
                    break;
                }
                if rank == 0 && cycle == 0 {
                    let mut viewer = Viewer::connect(&adaptor);
                    viewer.hello();
                    saying = Some(scope.spawn(move || {
                        let found = say(&mut viewer);
                        viewer.send(&json!({"id": "end", "stop": {}}));
                        found
                    }));
                }
                std::thread::sleep(Duration::from_millis(2));
                cycle += 1;
                assert!(cycle < 100_000, "nobody stopped the run");
            }
            adaptor.finalize().expect("finalize");
            let found = saying.map(|thread| thread.join().expect("the viewer"));
            (cycle, moved, found)
        })
    })
}

/// Whatever was given up, the ranks have done the same.
fn assert_same<T>(outcomes: &[Outcome<T>]) {
    for (cycle, moved, _) in outcomes {
        assert_eq!((cycle, moved), (&outcomes[0].0, &outcomes[0].1));
    }
}

/// The next order is carried out.
#[test]
fn an_order_is_cancelled_while_all_ranks_find_its_shapes() {
    let outcomes = run(|viewer| {
        viewer.send(&json!({"id": "long", "order": long(0.3)}));
        viewer.wait_for("order", has_status("long", "computing"));
        viewer.send(&json!({"id": "c", "cancel": {"order": "long"}}));
        let told = viewer.wait_for("order", has_status("long", "rejected"));
        viewer.send(&json!({"id": "short", "order": squeeze(0.1)}));
        viewer.wait_for("order", has_status("short", "applied"));
        told["reason"].as_str().map(str::to_owned)
    });
    assert_eq!(outcomes[0].2, Some(Some("cancelled by c1".into())));
    assert_same(&outcomes);
    let moved = &outcomes[0].1;
    assert!(!moved.is_empty() && moved.iter().all(|order| order == "short"), "{moved:?}");
}

/// It is given up, before it has begun or in its midst; the next one is found.
#[test]
fn a_forecast_is_withdrawn_while_all_ranks_find_it() {
    let outcomes = run(|viewer| {
        let begun = Instant::now();
        viewer.send(&json!({"id": "whole", "forecast": long(0.3)}));
        viewer.wait_for("forecast", |told| told["id"] == "whole");
        let whole = begun.elapsed();
        for (pause, edits) in [(0.0, 0.31), (0.1, 0.32)] {
            let pause = whole.mul_f64(pause);
            let mut long = long(0.3);
            long["edits"] = squeeze(edits)["edits"].clone();
            let begun = Instant::now();
            viewer.send(&json!({"id": "long", "forecast": long}));
            std::thread::sleep(pause);
            viewer.send(&json!({"withdraw_forecast": {}}));
            let error = viewer.wait_for("error", |error| error["id"] == "long");
            assert!(error["message"].as_str().unwrap().contains("withdrawn"), "{error}");
            // Found to its end and then not told it would take as long as the first.
            let took = begun.elapsed();
            assert!(took < whole.mul_f64(0.6), "{took:?} of {whole:?}");
            viewer.send(&json!({"id": "short", "forecast": squeeze(0.1)}));
            let told = viewer.wait_for("forecast", |told| !told.is_null());
            let outcome = (&told["id"], &told["order"]["outcome"]);
            assert_eq!(outcome, (&json!("short"), &json!("applied")));
        }
    });
    assert_same(&outcomes);
    assert!(outcomes[0].1.is_empty());
}
