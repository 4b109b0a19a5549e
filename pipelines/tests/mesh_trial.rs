//! What a mesh lacks that a configuration or an order asks for, all of it at once.

mod common;

use std::fs;
use std::path::Path;
use std::sync::Arc;

use common::assert_told;
use tombolo_deform::features::FeatureSettings;
use tombolo_deform::mesh::{FeatureSource, Mesh, MeshView};
use tombolo_deform::shapes::box_of_tets;
use tombolo_deform::surface::Surface;
use tombolo_pipelines::extract::{Channel, FieldView};
use tombolo_pipelines::language::check_content;
use tombolo_pipelines::run::MeshTrial;

/// The errors of a text tried on a box with a vertex field `p`, a vertex vector `u` and an element
/// field `load`, whose features are its sides.
fn told_of(text: &str, channel: Option<&str>) -> String {
    let mesh = box_of_tets([3, 3, 3], [0.0; 3], [1.0; 3]);
    let surface = Arc::new(Surface::extract(&mesh, &FeatureSettings::default()).unwrap());
    let p: Vec<f64> = mesh.points().iter().map(|point| point[0]).collect();
    let u = vec![[1.0, 0.0, 0.0]; mesh.points().len()];
    let load = vec![1.0; mesh.cells().len()];
    let fields =
        [FieldView::vertex("p", &p), FieldView::vertex("u", &u), FieldView::element("load", &load)];
    let mut trial = MeshTrial::new(Channel::new("mesh", MeshView::from(&mesh), &fields), surface);
    if let Some(channel) = channel {
        trial = trial.of_channel(channel);
    }
    match check_content(text, "a.json", Some(&mut trial)) {
        Ok(_) => String::new(),
        Err(errors) => errors.to_string(),
    }
}

#[test]
fn fields_and_features_are_looked_up() {
    let text = r#"{"version": 1, "pipelines": [
  {"name": "a", "stages": [
    {"gradient": {"field": "pp", "name": "g"}},
    {"magnitude": {"field": "g"}},
    {"expression": {"name": "e", "formula": "p + load"}},
    {"expression": {"name": "f", "formula": "u + parameter.inflow"}},
    {"contour": {"field": "load", "values": [1]}},
    {"select": {"fields": ["g", "uu", "p"]}},
    {"integrate": {"name": "p", "field": "u"}},
    {"stream": {}}]},
  {"name": "b", "every": {"steps": 1000}, "stages": [
    {"surface": {}},
    {"integrate": {"name": "in", "features": ["x-min", "x-mx"], "field": "p"}},
    {"force": {"name": "f", "pressure": "p", "velocity": "uu", "viscosity": 1}},
    {"statistics": {"field": "p"}}],
    "when": "in.mean > 3", "then": [{"render": {"file": "a-{cycle}.png", "field": "presure"}}]},
  {"name": "c", "stages": [{"streamlines": {"field": "p", "points": [[0.5, 0.5, 0.5]]}}]},
  {"name": "d", "stages": [{"probe": {"points": [[0.5, 0.5, 0.5], [3, 0, 0]]}}]},
  {"name": "e", "on": "order", "stages": [{"deform": {"sliding": ["x-min", "y-mun"], "free": ["zmax"]}}]},
  {"name": "f", "at": {"time": 3}, "stages": [
    {"translate": {"features": ["x-max"], "fixed": ["x-mini"], "by": [0, 0, 1]}},
    {"order": {"deform": {"free": ["top"]}}}]},
  {"name": "g", "stages": [{"vorticity": {"field": "p"}}, {"divergence": {"field": "u", "name": "p"}}, {"slice": {"origin": [0, 0, 0.5], "normal": [0, 0, 1]}}, {"render": {"field": "vorticity", "file": "b.png"}}]}
]}"#;
    assert_told(
        &told_of(text, None),
        r#"
a.json:3:28: pipelines[0].stages[0].gradient.field: the channel has no field `pp`; its fields are p, u, load; did you mean `p`?
a.json:5:45: pipelines[0].stages[2].expression.formula: `p` is a field of association vertex, `load` of association element; expected fields of one
a.json:6:45: pipelines[0].stages[3].expression.formula: field `u` has 3 components, expected one of them, such as `u.x`
a.json:7:27: pipelines[0].stages[4].contour.field: field `load` has values for element entities, expected a vertex field
a.json:8:33: pipelines[0].stages[5].select.fields[1]: the channel has no field `uu`; its fields are p, u, load, g, magnitude, e, f; did you mean `u`?
a.json:13:56: pipelines[1].stages[1].integrate.features[1]: the surface has no feature `x-mx`; its features are x-min, x-max, y-min, y-max, z-min, z-max; did you mean `x-max`?
a.json:14:58: pipelines[1].stages[2].force.velocity: the channel has no field `uu`; its fields are p, u, load; did you mean `u`?
a.json:16:83: pipelines[1].then[0].render.field: the channel has no field `presure`; its fields are p, u, load
a.json:17:54: pipelines[2].stages[0].streamlines.field: field `p` has 1 components, expected a vector of 2 or 3
a.json:18:38: pipelines[3].stages[0].probe: 1 of 2 points lie in no cell and are left out, first (3, 0, 0)
a.json:19:76: pipelines[4].stages[0].deform.sliding[1]: there is no feature `y-mun`; the features are x-min, x-max, y-min, y-max, z-min, z-max; did you mean `y-min`?
a.json:19:95: pipelines[4].stages[0].deform.free[0]: there is no feature `zmax`; the features are x-min, x-max, y-min, y-max, z-min, z-max; did you mean `z-max`?
a.json:21:53: pipelines[5].stages[0].translate.fixed[0]: there is no feature `x-mini`; the features are x-min, x-max, y-min, y-max, z-min, z-max; did you mean `x-min`?
a.json:22:36: pipelines[5].stages[1].order.deform.free[0]: there is no feature `top`; the features are x-min, x-max, y-min, y-max, z-min, z-max
a.json:23:52: pipelines[6].stages[0].vorticity.field: field `p` has 1 components, expected a vector of 2 or 3
a.json:23:97: pipelines[6].stages[1].divergence.name: the channel has a field `p` already
"#,
    );
}

#[test]
fn edits_and_orders_are_looked_at() {
    assert_told(
        &told_of(
            r#"[{"translate": {"features": ["x-max"], "fixed": ["x-min"], "by": [0, 0, 1]}},
 {"rotate": {"features": ["x-max", "x-mn"], "axis": [0, 0, 1], "degrees": 1}},
 {"translate": {"region": {"box": {"lower": [5, 5, 5], "upper": [6, 6, 6]}}, "by": [0, 0, 1]}},
 {"displacement": {"file": "nowhere.txt"}}]"#,
            None,
        ),
        r#"
a.json:2:36: [1].rotate.features[1]: there is no feature `x-mn`; the features are x-min, x-max, y-min, y-max, z-min, z-max; did you mean `x-min`?
a.json:3:27: [2].translate.region: no vertex of the surface lies in it; the nearest, mesh vertex 63 at (1, 1, 1), is 6.928203 away; the surface reaches from (0, 0, 0) to (1, 1, 1)
a.json:4:28: [3].displacement.file: nowhere.txt: No such file or directory (os error 2)
"#,
    );
    // Of a journal, what was rejected is not looked at.
    assert_told(
        &told_of(
            r#"{"id":"a","status":"accepted","cycle":3,"time":0.3,"order":{"edits":[{"translate":{"features":["no"],"by":[0,0,1]}}]}}
{"id":"a","status":"rejected","cycle":3,"time":0.3,"reason":"there is no feature"}
{"id":"b","status":"accepted","cycle":3,"time":0.3,"order":{"stack":[{"translate":{"features":["top"],"by":[0,0,1]}}],"deform":{"free":["y-mim"]}}}
{"at":{"cycle":3},"order":{"undo":1,"schedule":{"steps":0}}}"#,
            None,
        ),
        r#"
a.json:3:96: order.stack[0].translate.features[0]: there is no feature `top`; the features are x-min, x-max, y-min, y-max, z-min, z-max
a.json:3:137: order.deform.free[0]: there is no feature `y-mim`; the features are x-min, x-max, y-min, y-max, z-min, z-max; did you mean `y-min`?
a.json:4:57: order.schedule.steps: found 0, expected a whole number from 1 to 4294967295
"#,
    );
    assert_eq!(
        told_of(r#"{"edits": [{"translate": {"features": ["x-max"], "by": [0, 0, 1]}}]}"#, None),
        ""
    );
}

#[test]
fn errors_of_the_text_and_of_the_mesh_are_told_together() {
    let text = r#"{"version": 1, "pipelines": [
  {"name": "a", "stages": [{"surface": {"x": 1}}, {"statistics": {"feild": "q"}}]},
  {"name": "b", "channel": "solid", "stages": [{"statistics": {"field": "pp"}}]},
  {"name": "c", "stages": [{"probe": {"grid": {"lower": [0, 0, 0], "upper": [1, 1, 1], "counts": [9999, 9999, 9999]}}}, {"statistics": {"field": "q"}}]}
]}"#;
    let of_text = "
        a.json:2:41: pipelines[0].stages[0].surface.x: found the unknown key `x`, expected no key at all
        a.json:2:67: pipelines[0].stages[1].statistics.feild: found the unknown key `feild`, expected `field`, `name` or `unit`; did you mean `field`?";
    let solid = "a.json:3:73: pipelines[1].stages[0].statistics.field: the channel has no field `pp`; its fields are p, u, load; did you mean `p`?";
    // What means nothing by itself is not tried, let alone a billion points.
    let points = "a.json:4:98: pipelines[2].stages[0].probe.grid.counts: found 999700029999 points, expected at most 1048576";
    let fluid = "a.json:2:76: pipelines[0].stages[1].statistics.feild: the channel has no field `q`; its fields are p, u, load; did you mean `p`?";
    assert_told(&told_of(text, None), &[of_text, fluid, solid, points].join("\n"));
    assert_told(&told_of(text, Some("solid")), &[of_text, solid, points].join("\n"));
}

/// The files of the book are well on a mesh with the features and fields that they name.
#[test]
fn files_of_the_book_are_well_on_a_mesh() {
    let mesh = box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]);
    let FeatureSource::Faces(mut tagged) = mesh.features().clone() else { unreachable!() };
    for ((_, name), new) in tagged.names.iter_mut().zip(["inlet", "outlet", "throat"]) {
        *name = new.to_owned();
    }
    let mesh =
        Mesh::new(mesh.points().to_vec(), mesh.cells().clone(), FeatureSource::Faces(tagged))
            .unwrap();
    let surface = Arc::new(Surface::extract(&mesh, &FeatureSettings::default()).unwrap());
    let pressure: Vec<f64> = mesh.points().iter().map(|point| point[0]).collect();
    let velocity = vec![[1.0, 0.0, 0.0]; mesh.points().len()];
    let fields =
        [FieldView::vertex("pressure", &pressure), FieldView::vertex("velocity", &velocity)];
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/pipelines");
    let mut count = 0;
    for entry in fs::read_dir(folder).expect("the folder is there") {
        let path = entry.expect("it can be read").path();
        if path.extension().is_none_or(|extension| extension != "json") {
            continue;
        }
        let text = fs::read_to_string(&path).expect("a text");
        let channel = Channel::new("fluid", MeshView::from(&mesh), &fields);
        let mut trial = MeshTrial::new(channel, Arc::clone(&surface));
        let name = path.display().to_string();
        if let Err(errors) = check_content(&text, &name, Some(&mut trial)) {
            panic!("{errors}");
        }
        // What the mesh lacks is found in each of them.
        let channel = Channel::new("fluid", MeshView::from(&mesh), &[]);
        let mut trial = MeshTrial::new(channel, Arc::clone(&surface));
        let errors = check_content(&text, &name, Some(&mut trial)).unwrap_err();
        assert!(
            errors.iter().all(|error| error.message.contains("the channel has no field")),
            "{errors}"
        );
        count += 1;
    }
    assert!(count >= 5, "{count} files");
}
