//! Arrows and spheres: how many, how large, which way, and over the parts of a mesh.

mod common;

use std::sync::Arc;

use common::runner;
use tombolo_deform::communicator::{Communicator, Solo, threads};
use tombolo_deform::distributed::{Part, in_order};
use tombolo_deform::mesh::{CellType, Mesh, Vector};
use tombolo_deform::shapes::{box_of_mixed_cells, box_of_tets};
use tombolo_pipelines::extract::{Channel, Extract, FieldView, Snapshot};
use tombolo_pipelines::run::Output;

fn glyphs(stage: &str, part: &Part, communicator: Arc<dyn Communicator>) -> Option<Arc<Extract>> {
    let u: Vec<Vector> = part.points.iter().map(|&[x, ..]| [0.0, 1.0 + x, 0.0]).collect();
    let load: Vec<f64> = part.global_cells.iter().flatten().map(|&cell| cell as f64).collect();
    let fields = [FieldView::vertex("u", &u), FieldView::element("load", &load)];
    let channels = [Channel::new("fluid", part.view(), &fields)];
    let pipeline = format!(
        r#"{{"name": "a", "stages": [{{"glyphs": {stage}}}, {{"write": {{"file": "a.vtu"}}}}]}}"#
    );
    let mut runner = runner(&pipeline, communicator);
    let outputs = runner.run(&Snapshot { cycle: 0, time: 0.0, channels: &channels });
    let taken = outputs.into_iter().map(|output| match output {
        Output::Write { extract, .. } => extract,
        other => panic!("{other:?}"),
    });
    taken.last()
}

fn mesh() -> Mesh {
    box_of_mixed_cells([6, 4, 4], [0.0; 3], [2.0, 1.0, 1.0])
}

fn alone(stage: &str) -> Arc<Extract> {
    let mesh = mesh();
    let part = Part::whole(&mesh).unwrap();
    glyphs(stage, &part, Arc::new(Solo)).unwrap()
}

/// The triangles of an arrow or a sphere that stands at one point.
fn triangles(shape: &str) -> usize {
    let stage = format!(r#"{{"shape": "{shape}", "field": "u", "points": [[1, 0.5, 0.5]]}}"#);
    alone(&stage).cells.len()
}

#[test]
fn an_arrow_points_along_its_field_and_is_as_long_as_it_says() {
    let stage = r#"{"field": "u", "points": [[0.5, 0.2, 0.5], [1.5, 0.2, 0.5]], "size": 0.4}"#;
    let extract = alone(stage);
    let values = &extract.fields[0].values;
    for (at, speed, length) in [(0.5, 1.5, 0.24), (1.5, 2.5, 0.4)] {
        let ends = extract
            .points
            .iter()
            .zip(values.chunks(3))
            .filter(|(point, _)| (point[0] - at).abs() < 0.1);
        let mut bounds = [f64::INFINITY, f64::NEG_INFINITY];
        for (point, value) in ends {
            bounds = [bounds[0].min(point[1]), bounds[1].max(point[1])];
            assert!((value[1] - speed).abs() < 1e-12 && value[0] == 0.0);
        }
        assert!((bounds[0] - 0.2).abs() < 1e-12 && (bounds[1] - 0.2 - length).abs() < 1e-12);
    }
}

#[test]
fn there_are_as_many_as_were_asked_for() {
    let arrow = triangles("arrow");
    let sphere = triangles("sphere");
    let vertices = mesh().points().len();
    assert_eq!(alone(r#"{"field": "u", "every": 1}"#).cells.len(), vertices * arrow);
    let tenth = vertices.div_ceil(10);
    assert_eq!(alone(r#"{"field": "u", "every": 10}"#).cells.len(), tenth * arrow);
    let spread =
        alone(r#"{"shape": "sphere", "field": "u", "count": 40, "scaled": false, "size": 0.01}"#);
    let count = spread.cells.len() / sphere;
    assert!((16..=40).contains(&count), "{count}");
    // They stand on both sides of each middle.
    for axis in 0..3 {
        let middle = if axis == 0 { 1.0 } else { 0.5 };
        let below = spread.points.iter().filter(|point| point[axis] < middle).count();
        let part = below as f64 / spread.points.len() as f64;
        assert!((0.25..0.75).contains(&part), "{axis}: {part}");
    }
}

/// The triangles of glyphs, with the value that the solver's cell gave them.
fn with_loads(extract: &Extract) -> Vec<[i64; 10]> {
    let round = |point: &Vector| point.map(|x| (x * 1e9).round() as i64);
    let load = extract.fields.iter().find(|field| field.name == "load").unwrap();
    let triangle = |((_, corners), load): ((CellType, &[u32]), &f64)| {
        let mut all = [*load as i64; 10];
        for (slot, &corner) in all.chunks_mut(3).zip(corners) {
            slot.copy_from_slice(&round(&extract.points[corner as usize]));
        }
        all
    };
    let mut triangles: Vec<_> = extract.cells.iter().zip(&load.values).map(triangle).collect();
    triangles.sort_unstable();
    triangles
}

#[test]
fn ranks_make_those_that_one_process_makes() {
    let mixed = mesh();
    let count = mixed.cells().len();
    let in_turn = in_order(count, 7).iter().map(|piece| piece % 3).collect();
    // Vertices lie at equal distances from the middles of boxes, and the cells of a rank all about.
    let even = box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]);
    let mut cases: Vec<(&Mesh, Vec<usize>)> = vec![(&mixed, in_turn)];
    let mut state = 1_u64;
    for _ in 0..6 {
        let mut dealt = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 33) as usize % 3
        };
        cases.push((&even, (0..even.cells().len()).map(|_| dealt()).collect()));
    }
    for (mesh, of_cells) in cases {
        for stage in [
            r#"{"field": "u", "every": 3}"#,
            r#"{"field": "u", "count": 64}"#,
            r#"{"shape": "sphere", "grid": {"lower": [0, 0, 0], "upper": [1, 1, 1], "counts": [5, 4, 3]}}"#,
        ] {
            let part = Part::whole(mesh).unwrap();
            let whole = glyphs(stage, &part, Arc::new(Solo)).unwrap();
            let by_ranks = threads::run(3, |ranks| {
                let part = Part::cut(mesh, &of_cells, ranks.rank(), true).unwrap();
                glyphs(stage, &part, Arc::new(ranks))
            });
            let extract = by_ranks[0].as_ref().unwrap();
            assert!(with_loads(extract) == with_loads(&whole), "{stage}");
        }
    }
}
