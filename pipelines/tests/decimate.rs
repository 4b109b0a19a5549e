//! Fewer triangles: how many, how far from the surface that they stand for, and what stays.

mod common;

use std::sync::Arc;

use common::runner;
use tombolo_deform::communicator::{Communicator, Solo, threads};
use tombolo_deform::distributed::{Part, in_order};
use tombolo_deform::mesh::{Mesh, Vector};
use tombolo_deform::shapes::{box_of_tets, torus};
use tombolo_deform::vector::determinant;
use tombolo_pipelines::extract::{Channel, Extract, FieldView, Snapshot};
use tombolo_pipelines::run::Output;

/// What is left of the surface, and the monitors.
fn left(
    stage: &str,
    part: &Part,
    communicator: Arc<dyn Communicator>,
) -> (Option<Arc<Extract>>, Vec<f64>) {
    let x: Vec<f64> = part.points.iter().map(|point| point[0]).collect();
    let load: Vec<f64> = (0..part.cells.len()).map(|cell| cell as f64).collect();
    let fields = [FieldView::vertex("x", &x), FieldView::element("load", &load)];
    let channels = [Channel::new("fluid", part.view(), &fields)];
    let pipeline = format!(
        r#"{{"name": "a", "stages": [{{"surface": {{}}}}, {{"decimate": {stage}}}, {{"write": {{"file": "a.vtu"}}}}]}}"#
    );
    let mut runner = runner(&pipeline, communicator);
    let (mut extract, mut monitors): (Option<Arc<Extract>>, _) = (None, Vec::new());
    // The second time from what was kept.
    for cycle in 0..2 {
        for output in runner.run(&Snapshot { cycle, time: 0.0, channels: &channels }) {
            match output {
                Output::Write { extract: taken, .. } => {
                    assert!(extract.as_ref().is_none_or(|before| *before == taken));
                    extract = Some(taken);
                }
                Output::Monitor(values) => {
                    monitors = values.values.iter().map(|(_, value)| *value).collect();
                }
                other => panic!("{other:?}"),
            }
        }
    }
    (extract, monitors)
}

fn alone(stage: &str, mesh: &Mesh) -> (Arc<Extract>, Vec<f64>) {
    let part = Part::whole(mesh).unwrap();
    let (extract, monitors) = left(stage, &part, Arc::new(Solo));
    (extract.unwrap(), monitors)
}

/// Six times the volume within a closed surface.
fn volume(extract: &Extract) -> f64 {
    let at = |point: u32| extract.points[point as usize];
    let of = |[a, b, c]: [Vector; 3]| determinant(a, b, c);
    extract.cells.iter().map(|(_, corners)| of([0, 1, 2].map(|corner| at(corners[corner])))).sum()
}

#[test]
fn a_box_needs_twelve_triangles() {
    let mesh = box_of_tets([8, 6, 5], [0.0; 3], [2.0, 1.0, 1.0]);
    let (extract, monitors) = alone(r#"{"fraction": 0.001, "error": 1e-6}"#, &mesh);
    assert_eq!(extract.cells.len(), 12);
    assert_eq!(extract.points.len(), 8);
    assert!(monitors[0] < 1e-12 && monitors[1] == 12.0, "{monitors:?}");
    assert!((volume(&extract) / 6.0 - 2.0).abs() < 1e-12);
    // The features keep their sides, and the fields their values.
    let features = extract.features.as_ref().unwrap();
    assert!(
        (0..features.names.len() as u32)
            .all(|feature| { features.of_cells.iter().filter(|&&of| of == feature).count() == 2 })
    );
    let field = |name: &str| extract.fields.iter().find(|field| field.name == name).unwrap();
    let x = &field("x").values;
    assert!(extract.points.iter().zip(x).all(|(point, x)| point[0] == *x));
    assert_eq!(field("load").values.len(), 12);
}

#[test]
fn a_ring_stays_closed_and_the_error_is_what_is_told() {
    let mesh = torus(1.0, 0.4, [60, 40]);
    let exact = volume(&alone(r#"{"fraction": 1}"#, &mesh).0);
    let mut before = 0.0;
    for (fraction, least) in [(0.5, 1e-5), (0.2, 1e-4), (0.05, 1e-3)] {
        let (extract, monitors) = alone(&format!(r#"{{"fraction": {fraction}}}"#), &mesh);
        let all = 2.0 * 60.0 * 40.0;
        assert!((extract.cells.len() as f64 - fraction * all).abs() <= 2.0);
        // Closed: each edge once in each direction, and still with a hole.
        let mut edges = std::collections::HashSet::new();
        for (_, corners) in extract.cells.iter() {
            for at in 0..3 {
                assert!(edges.insert((corners[at], corners[(at + 1) % 3])));
            }
        }
        assert!(edges.iter().all(|&(a, b)| edges.contains(&(b, a))));
        let euler =
            extract.points.len() as i64 - edges.len() as i64 / 2 + extract.cells.len() as i64;
        assert_eq!(euler, 0);
        assert!(monitors[0] > before && monitors[0] > least && monitors[0] < 0.2, "{monitors:?}");
        assert!((volume(&extract) / exact - 1.0).abs() < monitors[0] * 4.0);
        before = monitors[0];
    }
    // A bound that is kept to: no further is gone than it allows.
    let (extract, monitors) = alone(r#"{"fraction": 0.01, "error": 0.01}"#, &mesh);
    assert!(extract.cells.len() > 96 && monitors[0] <= 0.01, "{monitors:?}");
}

#[test]
fn ranks_leave_what_one_process_leaves() {
    let mesh = box_of_tets([6, 4, 4], [0.0; 3], [2.0, 1.0, 1.0]);
    let stage = r#"{"fraction": 0.2}"#;
    let (whole, monitors) = alone(stage, &mesh);
    let of_cells = in_order(mesh.cells().len(), 3);
    let by_ranks = threads::run(3, |ranks| {
        let part = Part::cut(&mesh, &of_cells, ranks.rank(), true).unwrap();
        left(stage, &part, Arc::new(ranks))
    });
    let extract = by_ranks[0].0.as_ref().unwrap();
    assert_eq!(extract.cells.len(), whole.cells.len());
    assert!((volume(extract) - volume(&whole)).abs() < 1e-9);
    assert!(by_ranks.iter().all(|(_, theirs)| (theirs[0] - monitors[0]).abs() < 1e-9));
    assert!(by_ranks[1].0.is_none());
}
