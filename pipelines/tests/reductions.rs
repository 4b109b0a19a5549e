//! Reductions beside integrals: histograms, forces, wall shear, differences, statistics over time and
//! spectra; closed forms, on one process and on several ranks.

mod common;

use std::collections::BTreeMap;
use std::sync::Arc;

use common::{cell_numbers, runner, shown};
use tombolo_deform::communicator::{Communicator, Solo, threads};
use tombolo_deform::distributed::{Part, in_order};
use tombolo_deform::features::FeatureSettings;
use tombolo_deform::mesh::{FeatureSource, Mesh, MeshView, Vector};
use tombolo_deform::shapes::{box_of_hexahedra, box_of_mixed_cells, box_of_tets};
use tombolo_deform::surface::Surface;
use tombolo_pipelines::extract::{Association, Channel, Extract, FieldView, Snapshot};
use tombolo_pipelines::language::parse;
use tombolo_pipelines::run::{Output, Runner};

const UPPER: Vector = [2.0, 1.0, 1.0];

/// What a run of some steps made: monitors of the last one, extracts of it, and all messages.
#[derive(Default)]
struct Made {
    monitors: BTreeMap<String, f64>,
    extracts: BTreeMap<String, Arc<Extract>>,
    messages: Vec<String>,
}

/// The fields of a case: `p` of vertices, `u` of vertices, at a point and time; `load` of elements
/// is the number of the cell.
#[derive(Clone, Copy)]
struct Case {
    p: fn(Vector, f64) -> f64,
    u: fn(Vector, f64) -> Vector,
    times: &'static [f64],
}

impl Case {
    fn steady(p: fn(Vector, f64) -> f64, u: fn(Vector, f64) -> Vector) -> Self {
        Self { p, u, times: &[0.0] }
    }

    fn made(&self, pipelines: &str, part: &Part, communicator: Arc<dyn Communicator>) -> Made {
        let mut runner = runner(pipelines, communicator);
        let load = cell_numbers(part);
        let mut made = Made::default();
        for (cycle, &time) in (0..).zip(self.times) {
            let p: Vec<f64> = part.points.iter().map(|&point| (self.p)(point, time)).collect();
            let u: Vec<Vector> = part.points.iter().map(|&point| (self.u)(point, time)).collect();
            let fields = [
                FieldView::vertex("p", &p),
                FieldView::vertex("u", &u),
                FieldView::element("load", &load),
            ];
            let channels = [Channel::new("fluid", part.view(), shown(part, &fields))];
            for output in runner.run(&Snapshot { cycle, time, channels: &channels }) {
                match output {
                    Output::Monitor(monitor) => made.monitors.extend(monitor.values),
                    Output::Error { message, .. } => made.messages.push(message),
                    Output::Write { pipeline, extract, .. } => {
                        made.extracts.insert(pipeline.to_string(), extract);
                    }
                    other => panic!("{other:?}"),
                }
            }
        }
        made
    }

    /// On one process, after several ranks have made the same: with and without copies of each
    /// other's cells, and with an empty rank.
    fn everywhere(&self, mesh: &Mesh, pipelines: &str) -> Made {
        let whole = Part::whole(mesh).unwrap();
        let one = self.made(pipelines, &whole, Arc::new(Solo));
        let of_cells: Vec<usize> =
            in_order(mesh.cells().len(), 7).iter().map(|piece| piece % 3).collect();
        for (ranks, ghosts) in [(3, true), (3, false), (4, true)] {
            let several = threads::run(ranks, |ranks| {
                let part = Part::cut(mesh, &of_cells, ranks.rank(), ghosts).unwrap();
                self.made(pipelines, &part, Arc::new(ranks))
            });
            for made in &several {
                assert_eq!(made.monitors.len(), one.monitors.len());
                for (name, value) in &made.monitors {
                    is_near(*value, one.monitors[name], name);
                }
            }
            assert_eq!(several[0].extracts.len(), one.extracts.len());
            for (name, extract) in &several[0].extracts {
                is_alike(extract, &one.extracts[name], name);
            }
        }
        one
    }
}

fn is_near(value: f64, expected: f64, what: &str) {
    let is_near = (value - expected).abs() <= 1e-11 * expected.abs().max(1.0);
    assert!(is_near || value.is_nan() && expected.is_nan(), "{what}: {value}, not {expected}");
}

/// The values of fields, whatever the order of points and cells.
fn is_alike(found: &Extract, expected: &Extract, what: &str) {
    let sorted = |extract: &Extract| {
        let fields = extract.fields.iter().map(|field| {
            let mut tuples: Vec<Vec<i64>> = field
                .values
                .chunks(field.components)
                .map(|tuple| tuple.iter().map(|value| (value * 1e9).round() as i64).collect())
                .collect();
            tuples.sort();
            (field.name.clone(), tuples)
        });
        fields.collect::<BTreeMap<_, _>>()
    };
    assert_eq!(sorted(found), sorted(expected), "{what}");
}

/// The name of the feature whose faces all lie where `axis` is `value`.
fn feature(mesh: &Mesh, axis: usize, value: f64) -> String {
    let surface = Surface::extract(mesh, &FeatureSettings::default()).unwrap();
    let is_there = |face: &usize| {
        let corners = surface.faces().vertices(*face).iter();
        corners.into_iter().all(|&vertex| surface.points()[vertex as usize][axis] == value)
    };
    let face = (0..surface.faces().len()).find(is_there).unwrap();
    let features = surface.features();
    features.names()[features.face_features()[face] as usize].clone()
}

/// The mesh without the names of its features, as parts of it have them.
fn plain(mesh: &Mesh) -> Mesh {
    let (points, cells) = (mesh.points().to_vec(), mesh.cells().clone());
    Mesh::new(points, cells, FeatureSource::SharpEdges).unwrap()
}

fn still(_: Vector, _: f64) -> Vector {
    [0.0; 3]
}

#[test]
fn a_histogram_counts_vertices_and_sizes() {
    let case = Case::steady(|[x, ..], _| x, |[x, y, _], _| [3.0 * y, 4.0 * y, 0.0 * x]);
    let mesh = plain(&box_of_hexahedra([4, 2, 2], [0.0; 3], UPPER));
    let end = feature(&mesh, 0, 2.0);
    let pipelines = format!(
        r#"
        {{"name": "all", "stages": [
            {{"histogram": {{"name": "count", "field": "p", "bins": 4}}}},
            {{"histogram": {{"name": "size", "field": "p", "bins": 4, "by": "size"}}}},
            {{"histogram": {{"name": "middle", "field": "p", "bins": 1, "range": [0.6, 1.2]}}}},
            {{"histogram": {{"name": "cells", "field": "load", "bins": 2, "range": [-0.5, 15.5], "by": "size"}}}},
            {{"histogram": {{"name": "number", "field": "load", "bins": 2, "range": [-0.5, 15.5]}}}},
            {{"histogram": {{"name": "speed", "field": "u", "bins": 2}}}}]}},
        {{"name": "end", "stages": [{{"surface": {{}}}},
            {{"histogram": {{"name": "end", "field": "u", "bins": 2, "features": ["{end}"]}}}},
            {{"histogram": {{"name": "faces", "field": "u", "bins": 2, "by": "size", "features": ["{end}"]}}}}]}},
        {{"name": "cut", "stages": [{{"slice": {{"origin": [0.7, 0, 0], "normal": [1, 0, 0]}}}},
            {{"select": {{"fields": []}}}},
            {{"histogram": {{"name": "cut", "field": "u", "bins": 2}}}},
            {{"histogram": {{"name": "area", "field": "u", "bins": 2, "by": "size"}}}}]}}"#
    );
    let made = case.everywhere(&mesh, &pipelines);
    assert!(made.messages.is_empty(), "{:?}", made.messages);
    let bins = |name: &str, expected: &[f64]| {
        for (bin, &expected) in expected.iter().enumerate() {
            let name = format!("{name}.bins.{bin}");
            is_near(made.monitors[&name], expected, &name);
        }
    };
    // Nine vertices at each of five places; the largest value belongs to the last bin.
    bins("count", &[9.0, 9.0, 9.0, 18.0]);
    bins("size", &[0.25, 0.5, 0.5, 0.75]);
    bins("middle", &[9.0]);
    is_near(made.monitors["middle.below"], 18.0, "below");
    is_near(made.monitors["middle.above"], 18.0, "above");
    bins("cells", &[1.0, 1.0]);
    bins("number", &[8.0, 8.0]);
    is_near(made.monitors["speed.upper"], 5.0, "the magnitude");
    bins("speed", &[15.0, 30.0]);
    bins("end", &[3.0, 6.0]);
    bins("faces", &[0.25, 0.75]);
    bins("cut", &[3.0, 6.0]);
    bins("area", &[0.25, 0.75]);
}

#[test]
fn a_force_of_pressure_is_its_gradient_times_the_volume() {
    let case = Case::steady(|[x, y, z], _| 1.0 + x - 3.0 * y + 2.0 * z, still);
    let pipelines = r#"
        {"name": "a", "stages": [{"surface": {}}, {"select": {"fields": []}},
            {"force": {"name": "whole", "pressure": "p", "about": [1, 2, 3]}},
            {"force": {"name": "heavy", "pressure": "p", "density": 10, "reference_pressure": 7}}]}"#;
    for mesh in
        [box_of_tets([4, 3, 3], [0.0; 3], UPPER), box_of_mixed_cells([4, 4, 4], [0.0; 3], UPPER)]
    {
        let is_simple = mesh.cells().iter().all(|(_, vertices)| vertices.len() == 4);
        let made = case.everywhere(&plain(&mesh), pipelines);
        assert!(made.messages.is_empty(), "{:?}", made.messages);
        let at = |name: &str, expected: f64| is_near(made.monitors[name], expected, name);
        for (name, force) in [("x", 2.0), ("y", -6.0), ("z", 4.0)] {
            at(&format!("whole.{name}"), force);
            at(&format!("whole.pressure.{name}"), force);
            at(&format!("heavy.{name}"), 10.0 * force);
        }
        at("whole.size", 10.0);
        at("whole.mean_pressure", 1.5);
        // From the point to the middle of the box, across the gradient, times the volume.
        let moment = [-1.5 * 2.0 - 2.5 * 3.0, -2.5 - 0.0, 0.0 + 1.5].map(|part| 2.0 * part);
        for (name, expected) in ["x", "y", "z"].into_iter().zip(moment) {
            let found = made.monitors[&format!("whole.moment.{name}")];
            let tolerance = if is_simple { 1e-11 } else { 0.2 };
            assert!((found - expected).abs() < tolerance, "{name}: {found}, not {expected}");
        }
    }
}

#[test]
fn shear_is_that_of_couette_and_poiseuille() {
    let couette = Case::steady(|_, _| 0.25, |[_, _, z], _| [3.0 * z, 0.0, 0.0]);
    let mesh = plain(&box_of_tets([4, 3, 3], [0.0; 3], UPPER));
    let [top, bottom] = [1.0, 0.0].map(|z| feature(&mesh, 2, z));
    let stages = |viscosity: &str| {
        format!(
            r#"{{"name": "a", "stages": [{{"surface": {{}}}},
            {{"wall_shear_stress": {{"velocity": "u", "viscosity": {viscosity}, "density": 2}}}},
            {{"force": {{"name": "top", "features": ["{top}"], "velocity": "u", "viscosity": {viscosity}}}}},
            {{"force": {{"name": "bottom", "features": ["{bottom}"], "velocity": "u", "viscosity": {viscosity}, "about": [1, 0.5, 1]}}}},
            {{"integrate": {{"name": "stress", "features": ["{bottom}"], "vector": "wall_shear_stress"}}}},
            {{"select": {{"fields": ["wall_shear_stress"]}}}}, {{"write": {{"file": "a.vtu"}}}}]}}"#
        )
    };
    // A number, and a field that is the same everywhere.
    for viscosity in ["0.25", r#""p""#] {
        let made = couette.everywhere(&mesh, &stages(viscosity));
        assert!(made.messages.is_empty(), "{:?}", made.messages);
        let at = |name: &str, expected: f64| is_near(made.monitors[name], expected, name);
        // The flow drags the lower wall along, and the upper one, which moves, back.
        at("bottom.x", 0.75 * 2.0);
        at("bottom.viscous.x", 0.75 * 2.0);
        at("top.x", -0.75 * 2.0);
        at("top.z", 0.0);
        at("bottom.moment.y", -0.75 * 2.0);
        at("stress.mean.x", 2.0 * 0.75);
        at("stress.mean.z", 0.0);
        let extract = &made.extracts["a"];
        assert!(extract.fields.len() == 1 && extract.fields[0].association == Association::Element);
        for ((_, corners), stress) in extract.cells.iter().zip(extract.fields[0].values.chunks(3)) {
            let heights = [0, 1, 2].map(|corner| extract.points[corners[corner] as usize][2]);
            let expected = match () {
                () if heights == [1.0; 3] => -1.5,
                () if heights == [0.0; 3] => 1.5,
                // Elsewhere it acts across the wall, or in z at the ends.
                () => 0.0,
            };
            is_near(stress[0], expected, "stress");
        }
    }
    // Between plates: 4 U z (1 - z), whose shear at the wall is 4 times viscosity and U.
    let poiseuille = Case::steady(|_, _| 0.0, |[_, _, z], _| [4.0 * z * (1.0 - z), 0.0, 0.0]);
    let error = |cells: usize| {
        let mesh = plain(&box_of_tets([2, 2, cells], [0.0; 3], UPPER));
        let whole = Part::whole(&mesh).unwrap();
        let made = poiseuille.made(&stages("0.25"), &whole, Arc::new(Solo));
        is_near(made.monitors["stress.mean.x"] * 2.0, 2.0 * made.monitors["bottom.x"], "both ways");
        (made.monitors["bottom.x"] - 4.0 * 0.25 * 2.0).abs() / 2.0
    };
    let [coarse, fine] = [8, 16].map(error);
    assert!(fine < 0.07 && (coarse / fine - 2.0).abs() < 0.1, "{coarse} {fine}");
}

#[test]
fn a_difference_reaches_across_pipelines() {
    let case = Case::steady(|[x, ..], _| 100.0 - 30.0 * x, still);
    let mesh = plain(&box_of_tets([4, 2, 2], [0.0; 3], UPPER));
    let [inlet, outlet] = [0.0, 2.0].map(|x| feature(&mesh, 0, x));
    let end = |name: &str, feature: &str| {
        format!(
            r#"{{"name": "{name}", "stages": [{{"surface": {{}}}},
            {{"integrate": {{"name": "end", "features": ["{feature}"], "field": "p", "unit": "Pa"}}}}]}}"#
        )
    };
    let drop = r#"{"name": "drop", "stages": [
        {"difference": {"name": "drop", "of": "in/end.mean", "minus": "out/end.mean", "unit": "Pa"}},
        {"difference": {"name": "twice", "of": "drop", "minus": "rise"}}]}"#;
    // A pipeline that comes later has not measured yet.
    let rise = r#"{"name": "rise", "stages": [
        {"difference": {"name": "rise", "of": "out/end.mean", "minus": "in/end.mean"}}]}"#;
    let pipelines = format!("{}, {}, {drop}, {rise}", end("in", &inlet), end("out", &outlet));
    let made = Case { times: &[0.0], ..case }.everywhere(&mesh, &pipelines);
    is_near(made.monitors["drop"], 60.0, "drop");
    is_near(made.monitors["rise"], -60.0, "rise");
    assert!(made.monitors["twice"].is_nan());
    let made = Case { times: &[0.0, 1.0], ..case }.everywhere(&mesh, &pipelines);
    is_near(made.monitors["twice"], 120.0, "the step after");
}

#[test]
fn a_difference_at_the_end_is_kept_and_seen_by_those_behind_it() {
    let mesh = plain(&box_of_tets([2, 2, 2], [0.0; 3], UPPER));
    let pressure: Vec<f64> = mesh.points().iter().map(|[x, ..]| 100.0 - 30.0 * x).collect();
    let fields = [FieldView::vertex("p", &pressure)];
    let channel = Channel::new("fluid", MeshView::from(&mesh), &fields);
    let text = r#"{"version": 1, "pipelines": [
        {"name": "p", "stages": [{"statistics": {"field": "p"}}]},
        {"name": "end", "on": "end", "stages": [{"difference": {"name": "range", "of": "p.max", "minus": "p.min"}}]},
        {"name": "last", "on": "end", "stages": [{"difference": {"name": "rest", "of": "range", "minus": "p.max"}}]}]}"#;
    let mut runner = Runner::new(&parse(text, "test.json").unwrap()).unwrap();
    runner.run(&Snapshot { cycle: 3, time: 0.5, channels: &[channel] });
    let outputs = runner.finish(4, 0.75);
    assert_eq!(outputs.len(), 2, "{outputs:?}");
    for (pipeline, expected) in [("end", 60.0), ("last", -40.0)] {
        let history = runner.history(pipeline).expect("a history");
        let kept: Vec<_> = history.measured().collect();
        assert_eq!(kept.len(), 1);
        assert_eq!((kept[0].cycle, kept[0].time), (4, 0.75));
        is_near(kept[0].values[0], expected, pipeline);
        let (_, cost) = runner.costs().find(|(name, _)| *name == pipeline).expect("a cost");
        assert_eq!(cost.runs, 1);
    }
}

#[test]
fn statistics_over_time_are_exact_for_what_changes_evenly() {
    const TIMES: &[f64] = &[0.0, 0.1, 0.3, 0.4, 0.75, 1.0];
    let case = Case {
        p: |[x, ..], time| x * time,
        u: |point, time| point.map(|x| -x * time),
        times: TIMES,
    };
    let pipelines = r#"
        {"name": "fields", "stages": [
            {"time_statistics": {"name": "p", "field": "p"}},
            {"time_statistics": {"name": "late", "field": "u", "window": 0.4, "measures": ["mean", "max"]}},
            {"expression": {"name": "half", "formula": "p_mean / 2"}},
            {"slice": {"origin": [0.5, 0, 0], "normal": [1, 0, 0]}}, {"write": {"file": "a.vtu"}}]},
        {"name": "cells", "stages": [{"time_statistics": {"name": "load", "field": "load"}},
            {"threshold": {"field": "load_max", "min": 5}}, {"select": {"fields": ["load_rms"]}},
            {"integrate": {"name": "cells", "field": "load_mean"}}, {"write": {"file": "b.vtu"}}]},
        {"name": "numbers", "stages": [{"statistics": {"field": "p"}},
            {"time_statistics": {"name": "over", "monitor": "p.max", "unit": "m"}},
            {"time_statistics": {"name": "last", "monitor": "p.max", "window": 0.5, "measures": ["mean", "min"]}}]}"#;
    let made = case.everywhere(&plain(&box_of_tets([4, 2, 2], [0.0; 3], UPPER)), pipelines);
    assert!(made.messages.is_empty(), "{:?}", made.messages);
    let values = |pipeline: &str, name: &str| {
        let fields = &made.extracts[pipeline].fields;
        let field = fields.iter().find(|field| field.name == name);
        field.unwrap_or_else(|| panic!("no {name}")).values.clone()
    };
    for (name, expected) in [
        ("p_mean", 0.25),
        ("p_rms", 0.5 / 3.0_f64.sqrt()),
        ("p_min", 0.0),
        ("p_max", 0.5),
        ("half", 0.125),
    ] {
        values("fields", name).iter().for_each(|&value| is_near(value, expected, name));
    }
    // Blocks of a tenth or more: the window reaches back to 0.4, the last block before it ended then.
    values("fields", "late_mean")
        .chunks(3)
        .for_each(|mean| is_near(mean[0], -0.5 * 0.7, "late mean"));
    values("fields", "late_max").chunks(3).for_each(|max| is_near(max[0], -0.5 * 0.4, "late max"));
    let fields = &made.extracts["cells"].fields;
    assert!(fields.len() == 1 && fields[0].name == "load_rms");
    assert!(
        fields[0].values.iter().all(|&load| load > 4.99 && (load - load.round()).abs() < 1e-12)
    );
    let at = |name: &str, expected: f64| is_near(made.monitors[name], expected, name);
    at("over.mean", 1.0);
    at("over.rms", 2.0 / 3.0_f64.sqrt());
    at("over.max", 2.0);
    at("over.time", 1.0);
    at("last.mean", 1.5);
    at("last.min", 1.0);
    at("last.time", 0.5);
}

#[test]
fn other_cells_begin_the_statistics_of_a_field_anew() {
    let pipelines = r#"{"version": 1, "pipelines": [{"name": "a", "stages": [
        {"time_statistics": {"name": "p", "field": "p"}}, {"write": {"file": "a.vtu"}}]}]}"#;
    let mut runner = Runner::new(&parse(pipelines, "test.json").unwrap()).unwrap();
    let (small, large) =
        (box_of_tets([1, 1, 1], [0.0; 3], UPPER), box_of_tets([2, 2, 2], [0.0; 3], UPPER));
    let mut step = |cycle: u64, mesh: &Mesh, value: f64| {
        let values = vec![value; mesh.points().len()];
        let fields = [FieldView::vertex("p", &values)];
        let channels = [Channel::new("fluid", mesh.into(), &fields)];
        let outputs = runner.run(&Snapshot { cycle, time: cycle as f64, channels: &channels });
        let [Output::Write { extract, .. }] = &outputs[..] else { panic!("{outputs:?}") };
        let mean = extract.fields.iter().find(|field| field.name == "p_mean").unwrap();
        assert_eq!(mean.values.len(), mesh.points().len());
        mean.values[0]
    };
    assert_eq!([step(0, &small, 1.0), step(1, &small, 3.0)], [1.0, 2.0]);
    assert_eq!([step(2, &large, 7.0), step(3, &large, 9.0)], [7.0, 8.0]);
}

#[test]
fn a_value_that_is_missing_is_missing_until_the_window_has_left_it() {
    let pipelines = r#"{"version": 1, "pipelines": [{"name": "a", "stages": [
        {"time_statistics": {"name": "p", "field": "p", "window": 1}}, {"write": {"file": "a.vtu"}}]}]}"#;
    let mut runner = Runner::new(&parse(pipelines, "test.json").unwrap()).unwrap();
    let mesh = box_of_tets([1, 1, 1], [0.0; 3], UPPER);
    let mut is_there = Vec::new();
    for cycle in 0..16 {
        let mut values = vec![2.0; mesh.points().len()];
        if cycle == 4 {
            values[0] = f64::NAN;
        }
        let fields = [FieldView::vertex("p", &values)];
        let channels = [Channel::new("fluid", (&mesh).into(), &fields)];
        let time = 0.25 * cycle as f64;
        for output in runner.run(&Snapshot { cycle, time, channels: &channels }) {
            let Output::Write { extract, .. } = output else { continue };
            let of = |name: &str| {
                let field = extract.fields.iter().find(|field| field.name == format!("p_{name}"));
                field.unwrap().values.clone()
            };
            let all = ["mean", "rms", "min", "max"].map(of);
            assert!(all.iter().all(|values| values[1] == 2.0));
            assert!(all.iter().all(|values| values[0].is_nan() == all[0][0].is_nan()), "{cycle}");
            is_there.push(!all[0][0].is_nan());
        }
    }
    assert!(is_there[..4].iter().all(|&is_there| is_there));
    assert!(is_there[4..8].iter().all(|&is_there| !is_there));
    assert!(is_there[12..].iter().all(|&is_there| is_there), "{is_there:?}");
}

#[test]
fn a_spectrum_finds_the_frequency_of_a_flow() {
    // Vortices that shed five times in a unit of time.
    let times: &'static [f64] = Vec::leak((0..140).map(|step| f64::from(step) * 0.02).collect());
    let case =
        Case { p: |[x, ..], time| x * (std::f64::consts::TAU * 5.0 * time).sin(), u: still, times };
    let pipelines = r#"{"name": "a", "stages": [{"integrate": {"name": "lift", "field": "p"}},
        {"spectrum": {"name": "shedding", "monitor": "lift.mean", "samples": 128, "unit": "N"}}]}"#;
    let made = case.everywhere(&plain(&box_of_tets([2, 1, 1], [0.0; 3], UPPER)), pipelines);
    assert!((made.monitors["shedding.frequency"] - 5.0).abs() < 0.02, "{:?}", made.monitors);
    assert!((made.monitors["shedding.amplitude"] - 1.0).abs() < 0.01);
    is_near(made.monitors["shedding.resolution"], 1.0 / (128.0 * 0.02), "resolution");
    assert!(made.messages.is_empty(), "{:?}", made.messages);
    let uneven: &'static [f64] =
        Vec::leak(times.iter().map(|time| time + 0.004 * (9.0 * time).sin()).collect());
    let whole = box_of_tets([2, 1, 1], [0.0; 3], UPPER);
    let part = Part::whole(&whole).unwrap();
    let made = Case { times: uneven, ..case }.made(pipelines, &part, Arc::new(Solo));
    assert_eq!(made.messages.len(), 1, "once: {:?}", made.messages);
    assert!(made.messages[0].contains("the time steps vary"));
    assert!((made.monitors["shedding.frequency"] - 5.0).abs() < 0.05);
}

/// What changes its sign at each step has no partner above half the sampling rate.
#[test]
fn a_spectrum_knows_the_amplitude_of_what_alternates() {
    let times: &'static [f64] = Vec::leak((0..80).map(f64::from).collect());
    let alternating = |[x, ..]: Vector, time: f64| x * (std::f64::consts::PI * time).cos();
    let case = Case { p: alternating, u: still, times };
    let pipelines = r#"{"name": "a", "stages": [{"integrate": {"name": "lift", "field": "p"}},
        {"spectrum": {"name": "odd", "monitor": "lift.mean", "samples": 64}}]}"#;
    let made = case.everywhere(&plain(&box_of_tets([2, 1, 1], [0.0; 3], UPPER)), pipelines);
    is_near(made.monitors["odd.frequency"], 0.5, "frequency");
    is_near(made.monitors["odd.amplitude"], 1.0, "amplitude");
}

#[test]
fn what_cannot_be_reduced_is_told() {
    let case = Case::steady(|[x, ..], _| x, still);
    let mesh = plain(&box_of_tets([2, 1, 1], [0.0; 3], UPPER));
    let pipelines = r#"{"name": "a", "stages": [{"surface": {}},
        {"histogram": {"name": "a", "field": "q"}},
        {"force": {"name": "b", "pressure": "u"}},
        {"force": {"name": "c", "velocity": "p", "viscosity": 1}},
        {"wall_shear_stress": {"velocity": "u", "viscosity": "w"}}]}"#;
    let made = case.everywhere(&mesh, pipelines);
    let said = made.messages.join("\n");
    for expected in [
        "histogram `a`: the channel has no field `q`",
        "force `b`: field `u` is one of vertex values of 3 components, expected a scalar",
        "force `c`: field `gradient of p` is one of vertex values of 3 components",
        "wall_shear_stress: the channel has no field `w`",
    ] {
        assert!(said.contains(expected), "{expected}\n{said}");
    }
    assert!(made.monitors.values().all(|value| value.is_nan()), "{:?}", made.monitors);
}
