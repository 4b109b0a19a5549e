//! What is set up for orders, and when.

use std::sync::Arc;

use tombolo_deform::{
    communicator::{Communicator, Solo, threads},
    distributed::Part,
    shapes::box_of_tets,
};
use tombolo_pipelines::{
    extract::Channel,
    language::{parse, parse_orders},
};

use super::{Adaptor, SteeredMesh};
use crate::{settings::Settings, step::Step};

/// How many calls may pass before all ranks know.
const CALLS: u64 = 100;

fn settings(communicator: Arc<dyn Communicator>) -> Settings {
    let text = r#"{"version": 1, "stream": {"listen": "127.0.0.1:0"}, "pipelines": []}"#;
    let config = parse(text, "test.json").expect("a configuration");
    Settings { config, communicator, ..Settings::default() }
}

/// Calls `execute` with a part of a box; whether the steerer is then ready for orders.
fn step(adaptor: &mut Adaptor, part: &Part, cycle: u64) -> bool {
    let step = Step { cycle, time: 0.01 * cycle as f64, time_step: 0.01 };
    let channels = [Channel { name: "fluid", mesh: part.view(), fields: &[] }];
    adaptor.execute(&step, &channels).expect("execute");
    matches!(&adaptor.mesh, SteeredMesh::Steered(steerer, _) if steerer.is_ready())
}

/// The operator of a large mesh takes memory that a run without a person should not cost.
#[test]
fn nothing_is_set_up_before_a_viewer_may_steer() {
    let mesh = box_of_tets([3; 3], [0.0; 3], [1.0; 3]);
    for count in [1, 2, 3] {
        let ready_at = threads::run(count, |ranks| {
            let rank = ranks.rank();
            let of_cells: Vec<usize> =
                (0..mesh.cells().len()).map(|cell| cell * count / mesh.cells().len()).collect();
            let part = Part::cut(&mesh, &of_cells, rank, true).expect("a part");
            let mut adaptor = Adaptor::initialize(settings(Arc::new(ranks))).expect("initialize");
            for cycle in 0..CALLS {
                assert!(!step(&mut adaptor, &part, cycle), "rank {rank}, cycle {cycle}");
            }
            if rank == 0 {
                adaptor.queue.drive();
            }
            (CALLS..2 * CALLS).find(|&cycle| step(&mut adaptor, &part, cycle))
        });
        assert!(ready_at.iter().all(|cycle| cycle.is_some()), "{count} ranks: {ready_at:?}");
        assert!(ready_at.windows(2).all(|pair| pair[0] == pair[1]), "{count} ranks: {ready_at:?}");
    }
}

#[test]
fn an_order_of_a_file_is_made_ready_for_at_once() {
    let mesh = box_of_tets([3; 3], [0.0; 3], [1.0; 3]);
    let part = Part::cut(&mesh, &vec![0; mesh.cells().len()], 0, true).expect("a part");
    let orders = r#"[{"at": {"cycle": 50}, "order": {"edits": [{"translate": {
        "features": ["z-max"], "fixed": ["z-min"], "by": [0, 0, -0.1]}}]}}]"#;
    let orders = parse_orders(orders, "orders.json").expect("an order");
    let settings = Settings { orders, ..settings(Arc::new(Solo)) };
    let mut adaptor = Adaptor::initialize(settings).expect("initialize");
    assert!(step(&mut adaptor, &part, 0));
}
