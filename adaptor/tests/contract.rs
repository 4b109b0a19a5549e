//! A mistake of the solver is an error of the call that made it, wherever it is made; nothing has
//! changed then, and the solver may go on.

mod common;

use std::{num::NonZeroU32, sync::Arc};

use common::{config, squeeze};
use serde_json::json;
use tombolo::{
    Adaptor, ExecuteError, OrderStatus, Settings, Step,
    communicator::{Communicator, threads},
    deform::{
        mesh::{ArrayView, CellsView, FeatureSource, MeshView, Values},
        shapes::box_of_tets,
    },
    pipelines::{
        extract::{Association, Channel, FieldView},
        language::{Config, parse_orders},
    },
};

const NAN: f64 = f64::NAN;

/// The arrays of a solver.
#[derive(Clone)]
struct Lent {
    points: Vec<f64>,
    components: usize,
    types: Vec<u8>,
    offsets: Vec<i32>,
    connectivity: Vec<i32>,
    ghosts: Vec<u8>,
    numbers: Vec<i64>,
    cell_numbers: Vec<i64>,
    features: FeatureSource,
    temperature: Vec<f64>,
    temperature_on: Association,
    stress: Vec<f64>,
    second_name: &'static str,
    generation: u64,
}

impl Lent {
    /// A box, on each rank that at another place.
    fn new(rank: usize) -> Self {
        let mesh = box_of_tets([3, 3, 3], [rank as f64, 0.0, 0.0], [rank as f64 + 1.0, 1.0, 1.0]);
        let connectivity: Vec<i32> =
            mesh.cells().connectivity().iter().map(|&vertex| vertex as i32).collect();
        let (vertices, cells) = (mesh.points().len(), mesh.cells().len());
        Self {
            points: mesh.points().as_flattened().to_vec(),
            components: 3,
            types: vec![10; cells],
            offsets: (0..=cells as i32).map(|cell| 4 * cell).collect(),
            connectivity,
            ghosts: vec![0; cells],
            // Neighbours share the face between them.
            numbers: mesh
                .points()
                .iter()
                .map(|point| {
                    point.iter().fold(0, |number, x| 100 * number + (x * 3.0).round() as i64)
                })
                .collect(),
            cell_numbers: (0..cells as i64).map(|cell| cell + (rank * cells) as i64).collect(),
            features: mesh.features().clone(),
            temperature: vec![300.0; vertices],
            temperature_on: Association::Vertex,
            stress: vec![0.0; 6 * cells],
            second_name: "other",
            generation: 0,
        }
    }

    fn with<T>(&self, given: impl FnOnce(&[Channel<'_>]) -> T) -> T {
        let fields = [
            FieldView {
                name: "temperature",
                association: self.temperature_on,
                values: ArrayView::scalars(&self.temperature),
            },
            FieldView::element(
                "stress",
                ArrayView::interleaved(Values::F64(&self.stress), 6).expect("whole tuples"),
            ),
        ];
        let cells = CellsView::Mixed {
            types: &self.types,
            offsets: (&self.offsets).into(),
            connectivity: (&self.connectivity).into(),
        };
        let points = ArrayView::interleaved(Values::F64(&self.points), self.components)
            .expect("whole tuples");
        let mesh = MeshView {
            generation: self.generation,
            ghost_cells: Some(&self.ghosts),
            global_vertices: Some((&self.numbers).into()),
            global_cells: Some((&self.cell_numbers).into()),
            ..MeshView::new(points, cells)
        };
        let mesh = mesh.with_features(&self.features);
        given(&[
            Channel { name: "solid", mesh, fields: &fields },
            Channel { name: self.second_name, mesh, fields: &[] },
        ])
    }
}

/// A mistake, what is said of it, and whether it costs a pass to find.
struct Mistake {
    make: fn(&mut Lent),
    says: &'static [&'static str],
    cost: Cost,
}

#[derive(Clone, Copy, PartialEq)]
enum Cost {
    /// Found in every call.
    Lengths,
    /// Found where a mesh is lent first or replaced.
    Replaced,
    /// Found where it is used too. Where nothing is due, that is a matter of chance: what was set
    /// up on another thread may be taken over in any call.
    Used,
}

const MISTAKES: &[Mistake] = {
    use Cost::{Lengths, Replaced, Used};
    const fn of(cost: Cost, make: fn(&mut Lent), says: &'static [&'static str]) -> Mistake {
        Mistake { make, says, cost }
    }
    &[
        of(
            Lengths,
            |lent| lent.temperature.truncate(63),
            &["'solid'", "'temperature'", "63", "64", "each vertex"],
        ),
        of(
            Lengths,
            |lent| lent.temperature.push(1.0),
            &["'temperature'", "65", "64", "each vertex"],
        ),
        of(
            Lengths,
            |lent| lent.stress.truncate(6 * 161),
            &["'stress'", "161", "162", "each element"],
        ),
        of(
            Lengths,
            |lent| lent.temperature_on = Association::Element,
            &["'temperature'", "64", "162", "one for each vertex"],
        ),
        of(Lengths, |lent| lent.ghosts.truncate(161), &["'solid'", "'ghost_cells'", "161", "162"]),
        of(Lengths, |lent| lent.numbers.truncate(63), &["'global_vertices'", "63", "64"]),
        of(Lengths, |lent| lent.cell_numbers.truncate(161), &["'global_cells'", "161", "162"]),
        of(Lengths, |lent| lent.offsets.truncate(162), &["'offsets'", "162", "163"]),
        of(Lengths, |lent| lent.connectivity.truncate(600), &["648", "600"]),
        of(Lengths, |lent| lent.components = 4, &["4 components", "1 to 3"]),
        of(
            Lengths,
            |lent| lent.features = FeatureSource::Vertices(vec![1; 63].into()),
            &["63", "64", "vertices"],
        ),
        of(Lengths, |lent| lent.second_name = "solid", &["'solid'", "twice"]),
        of(
            Replaced,
            |lent| lent.connectivity[9] = 64,
            &["'solid'", "cell 2", "vertex 64", "64 vertices"],
        ),
        of(Replaced, |lent| lent.connectivity[9] = -1, &["cell 2"]),
        of(Replaced, |lent| lent.types[5] = 99, &["cell 5", "99"]),
        of(Replaced, |lent| lent.types[5] = 12, &["cell 5", "4 vertices", "8"]),
        of(Replaced, |lent| lent.offsets.swap(3, 4), &["cell 2", "8 vertices"]),
        of(Used, |lent| lent.points[7] = NAN, &["'solid'", "vertex 2", "y", "NaN", "finite"]),
        of(Used, |lent| lent.points[189] = f64::NEG_INFINITY, &["vertex 63", "x", "-inf"]),
    ]
};

/// Where a mistake is made.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Place {
    First,
    /// Nothing is due.
    Idle,
    /// The mesh is replaced, nothing is due.
    Replaced,
    /// A pipeline looks.
    Looked,
    /// An order is planned.
    Ordered,
    /// A schedule is under way.
    Moving,
}

const PLACES: [(Place, u64); 6] = [
    (Place::First, 0),
    (Place::Idle, 1),
    (Place::Replaced, 2),
    (Place::Looked, 3),
    (Place::Ordered, 5),
    (Place::Moving, 9),
];

fn settings(is_watched: bool) -> Settings {
    let pipelines = r#"{"version": 1, "pipelines": [
        {"name": "look", "at": {"cycle": 3}, "stages": [{"statistics": {"field": "temperature"}}]}]}"#;
    let mut order = squeeze(0.2);
    order["schedule"] = json!({"steps": 6});
    let orders = json!([{"at": {"cycle": 5}, "order": order}]).to_string();
    Settings {
        config: if is_watched { config(pipelines) } else { Settings::default().config },
        orders: parse_orders(&orders, "orders.json").expect("orders"),
        ..Settings::default()
    }
}

/// Runs with a mistake at one place, mended at once; what is said of it.
fn run(
    settings: Settings,
    rank: usize,
    mistaken: bool,
    mistake: &Mistake,
    place: (Place, u64),
) -> Result<(), String> {
    let mut adaptor = Adaptor::initialize(settings).expect("initialize");
    let mut lent = Lent::new(rank);
    let reference = lent.points.clone();
    let mut outcome = Ok(());
    let mut motions = 0;
    for cycle in 0..14 {
        let step = Step { cycle, time: 0.1 * cycle as f64, time_step: 0.1 };
        if cycle == place.1 {
            let mut wrong = lent.clone();
            if mistaken {
                // Where nothing is said to have changed, the arrays stay where they are.
                wrong = std::mem::replace(&mut lent, wrong);
                (mistake.make)(&mut wrong);
                if place.0 == Place::Replaced {
                    wrong.generation += 1;
                }
            }
            outcome = wrong.with(|channels| match adaptor.execute(&step, channels) {
                Err(error @ (ExecuteError::Channel { .. } | ExecuteError::Lent(_))) => {
                    Err(error.to_string())
                }
                Err(error) => panic!("{error}"),
                Ok(_) => Ok(()),
            });
            if outcome.is_ok() {
                return outcome;
            }
        }
        lent.points = lent.with(|channels| {
            let steering = adaptor.execute(&step, channels).expect("mended");
            motions += u32::from(steering.motion.is_some());
            steering.motion.map_or_else(
                || lent.points.clone(),
                |motion| motion.coordinates.as_flattened().to_vec(),
            )
        });
    }
    assert!(lent.points != reference);
    let report = adaptor.finalize().expect("finalize");
    if rank == 0 {
        assert_eq!(report.orders[0].status, OrderStatus::Applied, "{:?}", report.orders[0]);
        assert_eq!(report.orders[0].shapes, 6);
    }
    assert_eq!(motions, 6, "no shape was lost");
    outcome
}

#[test]
fn each_mistake_is_told_wherever_it_is_made() {
    for mistake in MISTAKES {
        for place in PLACES {
            let said = run(settings(true), 0, true, mistake, place);
            let (must_be_found, may_be_found) = match mistake.cost {
                Cost::Lengths => (true, true),
                Cost::Replaced => {
                    let is_replaced = matches!(place.0, Place::First | Place::Replaced);
                    (is_replaced, is_replaced)
                }
                Cost::Used => (place.0 != Place::Idle, true),
            };
            match said {
                Ok(()) => assert!(!must_be_found, "{:?} at {place:?}", mistake.says),
                Err(said) => {
                    assert!(may_be_found, "{said} at {place:?}");
                    assert!(said.starts_with(&format!("cycle {}: ", place.1)), "{said}");
                    assert!(
                        mistake.says.iter().all(|part| said.contains(part)),
                        "{said}: {:?}",
                        mistake.says
                    );
                }
            }
        }
    }
}

/// Also where nobody watches and nobody can give an order.
#[test]
fn a_run_that_nobody_watches_is_held_to_the_same() {
    for mistake in MISTAKES {
        let mut lent = Lent::new(0);
        let mut adaptor = Adaptor::initialize(Settings::default()).expect("initialize");
        (mistake.make)(&mut lent);
        let step = Step { cycle: 0, time: 0.0, time_step: 0.1 };
        let said = lent
            .with(|channels| adaptor.execute(&step, channels).map(|_| ()).unwrap_err().to_string());
        assert!(mistake.says.iter().all(|part| said.contains(part)), "{said}: {:?}", mistake.says);
        lent = Lent::new(0);
        lent.with(|channels| adaptor.execute(&step, channels).map(|_| ()).expect("mended"));
    }
}

#[test]
fn a_mistake_on_one_rank_is_the_same_error_on_all() {
    for poll_steps in [1, 4] {
        for mistake in MISTAKES {
            for place in PLACES
                .into_iter()
                .filter(|place| place.0 != Place::Idle || mistake.cost == Cost::Lengths)
            {
                // Between two meetings an error waits for the next.
                if (mistake.cost == Cost::Replaced
                    && !matches!(place.0, Place::First | Place::Replaced))
                    || (poll_steps > 1 && !matches!(place.0, Place::First | Place::Moving))
                {
                    continue;
                }
                let said = threads::run(3, |ranks| {
                    let rank = ranks.rank();
                    let mut settings = Settings { communicator: Arc::new(ranks), ..settings(true) };
                    settings.config.steering.poll_steps =
                        NonZeroU32::new(poll_steps).expect("above 0");
                    run(settings, rank, rank == 1, mistake, place)
                });
                let text = said[0].clone().expect_err("an error");
                assert!(said.iter().all(|other| other.as_ref() == Err(&text)), "{said:?}");
                assert!(text.starts_with("rank 1: "), "{text}");
                assert!(
                    mistake.says.iter().all(|part| text.contains(part)),
                    "{text}: {:?}",
                    mistake.says
                );
            }
        }
    }
}

/// A mesh of as many vertices whose cells are others is not the one that shapes are measured from.
#[test]
fn other_cells_are_not_taken_for_those_of_the_reference() {
    let mut adaptor = Adaptor::initialize(settings(false)).expect("initialize");
    let mut lent = Lent::new(0);
    let step = |cycle| Step { cycle, time: 0.0, time_step: 0.1 };
    lent.with(|channels| adaptor.execute(&step(0), channels).map(|_| ()).expect("the reference"));
    let good = lent.connectivity.clone();
    lent.connectivity.swap(0, 1);
    lent.generation = 1;
    let said = lent.with(|channels| adaptor.execute(&step(1), channels).map(|_| ()).unwrap_err());
    assert!(matches!(said, ExecuteError::OtherCells { found: 162, expected: 162, .. }), "{said}");
    lent.connectivity = good;
    lent.generation = 2;
    lent.with(|channels| {
        adaptor.execute(&step(1), channels).map(|_| ()).expect("the same cells, elsewhere")
    });
}

#[test]
fn values_that_are_not_finite_are_the_runs_state_and_no_mistake() {
    let pipelines = r#"{"version": 1, "pipelines": [
        {"name": "watch", "every": {"steps": 1}, "stages": [{"statistics": {"field": "temperature"}}],
         "when": "temperature.non_finite > 0", "then": [{"stop": {}}]}]}"#;
    let config: Config = config(pipelines);
    let mut adaptor =
        Adaptor::initialize(Settings { config, ..Settings::default() }).expect("initialize");
    let mut lent = Lent::new(0);
    lent.temperature[3] = NAN;
    let step = Step { cycle: 0, time: 0.0, time_step: 0.1 };
    assert!(lent.with(|channels| adaptor.execute(&step, channels).expect("watched").stop));
}
