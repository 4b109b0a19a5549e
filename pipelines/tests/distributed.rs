//! Pipelines over parts of meshes, against the same meshes on one process.

mod common;

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

use common::{cell_numbers, runner, shown};
use tombolo_deform::{
    communicator::{Communicator, Solo, threads},
    distributed::Part,
    mesh::{ArrayView, CellType, Cells, Mesh, NumberType},
    shapes::box_of_tets,
};
use tombolo_pipelines::{
    extract::{Association, Channel, Extract, FieldView, Snapshot},
    language::{Command, parse},
    run::{Output, Runner},
};

/// Cells dealt out in the order of their numbers; the rank `empty` gets none.
fn dealt(mesh: &Mesh, ranks: usize, empty: Option<usize>) -> Vec<usize> {
    let ranks: Vec<usize> = (0..ranks).filter(|&rank| Some(rank) != empty).collect();
    let count = mesh.cells().len();
    (0..count).map(|cell| ranks[cell * ranks.len() / count]).collect()
}

const PIPELINES: &str = r#"
    {"name": "surface", "every": {"steps": 1}, "stages": [{"surface": {}}, {"stream": {}}]},
    {"name": "cut", "every": {"steps": 1}, "stages": [
        {"slice": {"origin": [1.05, 0.3, 0.4], "normal": [1, 0.2, 0.1]}}, {"quality": {}}, {"stream": {}}]},
    {"name": "along a grid plane", "every": {"steps": 1}, "stages": [
        {"slice": {"origin": [0.8, 0, 0], "normal": [1, 0, 0]}}, {"stream": {}}]},
    {"name": "beside", "every": {"steps": 1}, "stages": [
        {"slice": {"origin": [9, 0, 0], "normal": [1, 0, 0]}}, {"histogram": {"name": "h", "field": "speed", "range": [0, 1], "bins": 2}}, {"stream": {}}]},
    {"name": "above", "every": {"steps": 1}, "stages": [
        {"threshold": {"field": "speed", "min": 1e9}}, {"write": {"file": "above-{cycle}.vtu"}}]},
    {"name": "all", "every": {"steps": 1}, "stages": [{"write": {"file": "all-{cycle}.vtu"}}]},
    {"name": "health", "every": {"steps": 1}, "stages": [
        {"quality": {}}, {"statistics": {"field": "speed"}}, {"statistics": {"field": "load"}}],
        "when": "quality.min < 2", "then": [{"pause": {}}]}"#;

type Rounded = Vec<i64>;

fn rounded(values: &[f64]) -> Rounded {
    values.iter().map(|value| (value * 1e9).round() as i64).collect()
}

/// The number of points, the fields by name with their components, and the cells with all that is on them.
type Content = (usize, BTreeMap<String, usize>, BTreeSet<(Vec<Rounded>, Rounded)>);

/// The content of an extract, whatever the numbering.
fn content(extract: &Extract) -> Content {
    let corner = |point: u32| {
        let mut all = extract.points[point as usize].to_vec();
        for field in extract.fields.iter().filter(|field| field.association == Association::Vertex)
        {
            all.extend(&field.values[point as usize * field.components..][..field.components]);
        }
        rounded(&all)
    };
    let cell = |(cell, (_, points)): (usize, (CellType, &[u32]))| {
        let mut corners: Vec<Rounded> = points.iter().map(|&point| corner(point)).collect();
        corners.sort();
        let mut values = Vec::new();
        for field in extract.fields.iter().filter(|field| field.association == Association::Element)
        {
            values.extend(&field.values[cell * field.components..][..field.components]);
        }
        (corners, rounded(&values))
    };
    let fields = extract.fields.iter().map(|field| (field.name.clone(), field.components));
    let cells = extract.cells.iter().enumerate().map(cell);
    (extract.points.len(), fields.collect(), cells.collect())
}

/// Extracts by the names of their pipelines, and the values of monitors.
type Made = (BTreeMap<String, Arc<Extract>>, Vec<(String, f64)>);

/// What the pipelines make of a part.
fn made(part: &Part, communicator: Arc<dyn Communicator>) -> Made {
    let speed: Vec<f64> = part.points.iter().map(|[x, y, z]| x + y * z).collect();
    let load = cell_numbers(part);
    let fields = [FieldView::vertex("speed", &speed), FieldView::element("load", &load)];
    let channels = [Channel { name: "fluid", mesh: part.view(), fields: shown(part, &fields) }];
    let rank = communicator.rank();
    let mut runner = runner(PIPELINES, communicator);
    let (mut extracts, mut values, mut pauses) = (BTreeMap::new(), Vec::new(), 0);
    for cycle in 0..2 {
        for output in runner.run(&Snapshot { cycle, time: 0.0, channels: &channels }) {
            match output {
                Output::Frame(frame) => {
                    drop(extracts.insert(frame.pipeline.to_string(), frame.extract))
                }
                Output::Write { pipeline, extract, .. } => {
                    drop(extracts.insert(pipeline.to_string(), extract))
                }
                Output::Monitor(monitor) => values.extend(monitor.values),
                Output::Command { command: Command::Pause {}, .. } => pauses += 1,
                other => panic!("{other:?}"),
            }
        }
    }
    assert_eq!(pauses, 2);
    assert!(rank == 0 || extracts.is_empty());
    (extracts, values)
}

#[test]
fn extracts_are_those_of_one_process() {
    let mesh = box_of_tets([5, 4, 3], [0.0; 3], [2.0, 1.0, 1.0]);
    let whole = Part::whole(&mesh).unwrap();
    let (serial, monitors) = made(&whole, Arc::new(Solo));
    for (ranks, empty, ghosts, shuffle) in
        [(2, None, false, 0), (3, Some(1), true, 0), (4, None, true, 9), (4, Some(0), false, 5)]
    {
        let of_cells = dealt(&mesh, ranks, empty);
        let outcomes = threads::run(ranks, |ranks| {
            let mut part = Part::cut(&mesh, &of_cells, ranks.rank(), ghosts).unwrap();
            if shuffle > 0 {
                part = part.shuffled(shuffle + ranks.rank() as u64);
                part.global_vertices = None;
            }
            made(&part, Arc::new(ranks))
        });
        let (extracts, _) = &outcomes[0];
        assert_eq!(extracts.keys().collect::<Vec<_>>(), serial.keys().collect::<Vec<_>>());
        for (name, extract) in extracts {
            assert_eq!(content(extract), content(&serial[name]), "{name} on {ranks} ranks");
        }
        for (_, values) in &outcomes {
            assert_eq!(values.len(), monitors.len());
            for ((name, value), (expected_name, expected)) in values.iter().zip(&monitors) {
                assert_eq!(name, expected_name);
                assert!(
                    (value - expected).abs() <= 1e-12 * expected.abs(),
                    "{name}: {value}, {expected}"
                );
            }
        }
    }
}

#[test]
fn a_field_that_is_wrong_on_one_rank_stops_nobody() {
    let mesh = box_of_tets([3, 2, 2], [0.0; 3], [2.0, 1.0, 1.0]);
    let of_cells = dealt(&mesh, 3, None);
    let outcomes = threads::run(3, |ranks| {
        let rank = ranks.rank();
        let part = Part::cut(&mesh, &of_cells, rank, false).unwrap();
        let mut speed: Vec<f64> = part.points.iter().map(|point| point[0]).collect();
        if rank == 2 {
            *speed.last_mut().unwrap() = f64::NAN;
        }
        // Rank 1 lacks one field.
        let fields = [FieldView::vertex("speed", &speed), FieldView::vertex("other", &speed)];
        let shown = &fields[..if rank == 1 { 1 } else { 2 }];
        let channels = [Channel { name: "fluid", mesh: part.view(), fields: shown }];
        let text = r#"{"version": 1, "pipelines": [{"name": "all", "every": {"steps": 1}, "stages": [
            {"surface": {}}, {"statistics": {"field": "other"}}, {"statistics": {"field": "speed"}}, {"stream": {}}]}]}"#;
        let mut runner =
            Runner::with_communicator(&parse(text, "test.json").unwrap(), Arc::new(ranks)).unwrap();
        let outputs = runner.run(&Snapshot { cycle: 0, time: 0.0, channels: &channels });
        let mut said = Vec::new();
        for output in outputs {
            match output {
                Output::Error { message, .. } => said.push(message),
                Output::Frame(frame) => {
                    assert!(
                        frame.extract.fields.is_empty(),
                        "a field with NaN, and one that is missing"
                    )
                }
                Output::Monitor(monitor) => {
                    let value = |name: &str| {
                        monitor.values.iter().find(|(other, _)| other == name).unwrap().1
                    };
                    assert!(value("other.max").is_nan());
                    assert_eq!((value("speed.max"), value("speed.non_finite")), (2.0, 1.0));
                }
                _ => {}
            }
        }
        said
    });
    assert!(outcomes[1].is_empty() && outcomes[2].is_empty(), "rank 0 speaks for all");
    let said = outcomes[0].join("\n");
    assert!(said.contains("rank 1: statistics: the channel has no field `other`"), "{said}");
    assert!(said.contains("rank 2: cycle 0: field `speed` is NaN"), "{said}");
}

#[test]
fn points_alone_are_never_merged() {
    for global in [None, Some(vec![0, 1])] {
        let extracts = threads::run(2, |ranks| {
            let mut cells = Cells::new();
            (0..2).for_each(|vertex| cells.push(CellType::Vertex, &[vertex]).unwrap());
            // Both ranks have points at the same places, and by the same numbers.
            let points = vec![[0.0; 3], [1.0, 0.0, 0.0]];
            let part = Part { points, cells, global_vertices: global.clone(), ..Part::default() };
            let mass = [ranks.rank() as f64, 2.0];
            let fields =
                [FieldView::vertex("mass", ArrayView::scalars(&mass).copied_from(NumberType::F32))];
            let channels = [Channel { name: "drops", mesh: part.view(), fields: &fields }];
            let text = r#"{"version": 1, "pipelines": [{"name": "all", "stages": [{"write": {"file": "a.vtu"}}]}]}"#;
            let config = parse(text, "test.json").unwrap();
            let mut runner = Runner::with_communicator(&config, Arc::new(ranks)).unwrap();
            let outputs = runner.run(&Snapshot { cycle: 0, time: 0.0, channels: &channels });
            outputs.into_iter().find_map(|output| match output {
                Output::Write { extract, .. } => Some(extract),
                _ => None,
            })
        });
        let extract = extracts[0].as_ref().unwrap();
        assert_eq!((extract.points.len(), extract.cells.len()), (4, 4));
        assert_eq!(extract.fields[0].values, [0.0, 2.0, 1.0, 2.0]);
        assert_eq!(extract.fields[0].number, NumberType::F32);
    }
}
