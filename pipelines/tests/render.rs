//! Pictures: known pixels of known scenes, beside the rays of VTK, and the same bits on one process
//! and on three ranks.

mod common;

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use common::{runner, shown};
use serde_json::Value;
use tombolo_deform::communicator::{Communicator, Solo, threads};
use tombolo_deform::distributed::{Part, in_order};
use tombolo_deform::mesh::{Mesh, Vector, ghosts};
use tombolo_deform::shapes::{box_of_mixed_cells, box_of_tets};
use tombolo_pipelines::extract::{Channel, Extract, FieldView, Snapshot};
use tombolo_pipelines::files::{self, Database};
use tombolo_pipelines::render::Picture;
use tombolo_pipelines::run::Output;

/// What pipelines make of a part.
#[derive(Default)]
struct Made {
    /// By the names of their files.
    pictures: BTreeMap<String, Arc<Picture>>,
    extracts: BTreeMap<String, Arc<Extract>>,
    errors: Vec<String>,
}

fn made(pipelines: &str, part: &Part, communicator: Arc<dyn Communicator>) -> Made {
    let number =
        |cell: usize| part.global_cells.as_ref().map_or(cell as f64, |all| all[cell] as f64);
    let p: Vec<f64> = part.points.iter().map(|[x, y, z]| x * y + z * z - 0.5 * x).collect();
    let axes: [Vec<f64>; 3] =
        [0, 1, 2].map(|axis| part.points.iter().map(|point| point[axis]).collect());
    let u: Vec<Vector> = part.points.iter().map(|[x, y, z]| [y * z, x + z, 0.5 * x * x]).collect();
    let load: Vec<f64> = (0..part.cells.len()).map(|cell| number(cell) % 17.0).collect();
    let fields = [
        FieldView::vertex("p", &p),
        FieldView::vertex("x", &axes[0]),
        FieldView::vertex("z", &axes[2]),
        FieldView::vertex("u", &u),
        FieldView::element("load", &load),
    ];
    let channels = [Channel::new("fluid", part.view(), shown(part, &fields))];
    let mut runner = runner(pipelines, communicator);
    let mut made = Made::default();
    for output in runner.run(&Snapshot { cycle: 7, time: 0.25, channels: &channels }) {
        match output {
            Output::Picture { path, picture, .. } => {
                made.pictures.insert(path, picture);
            }
            Output::Write { path, extract, .. } => {
                made.extracts.insert(path, extract);
            }
            Output::Error { message, .. } => made.errors.push(message),
            other => panic!("{other:?}"),
        }
    }
    made
}

/// The picture `a.png` of a mesh by one process.
fn picture(mesh: &Mesh, stages: &str) -> Arc<Picture> {
    let pipeline = format!(r#"{{"name": "a", "stages": [{stages}]}}"#);
    let made = made(&pipeline, &Part::whole(mesh).unwrap(), Arc::new(Solo));
    assert!(made.errors.is_empty(), "{:?}", made.errors);
    Arc::clone(&made.pictures["a.png"])
}

fn is_near(found: Option<[u8; 3]>, expected: [u8; 3]) -> bool {
    found.is_some_and(|found| (0..3).all(|at| found[at].abs_diff(expected[at]) <= 2))
}

/// Looks down on a square of 2 by 2 around (1, 0.5): 100 pixels for each unit.
const ABOVE: &str = r#""width": 200, "height": 200, "axes": false, "scalar_bar": false,
    "cameras": [{"position": [1, 0.5, 10], "focal_point": [1, 0.5, 0], "up": [0, 1, 0],
                 "parallel": true, "angle": 11.421186274999286}]"#;

#[test]
fn a_value_has_its_color_in_its_place() {
    let mesh = box_of_tets([4, 3, 3], [0.0; 3], [2.0, 1.0, 1.0]);
    let stages = format!(
        r#"{{"slice": {{"origin": [0, 0, 0.4], "normal": [0, 0, 1]}}}},
           {{"render": {{"file": "a.png", "field": "x", "range": [0, 2], {ABOVE}}}}}"#
    );
    let picture = picture(&mesh, &stages);
    assert_eq!(picture.range, Some([0.0, 2.0]));
    // The colours that Matplotlib has at a quarter, half and three quarters.
    let expected = [(50, [59, 82, 139]), (100, [33, 145, 140]), (150, [94, 201, 98])];
    for (column, color) in expected {
        let found = picture.image.pixel(column, 100);
        assert!(is_near(found, color), "{column}: {found:?}");
    }
    // The extract fills 200 by 100 pixels: from 50 below the upper edge to 150.
    assert_eq!(picture.image.pixel(100, 49), Some([255; 3]));
    assert_ne!(picture.image.pixel(100, 50), Some([255; 3]));
    assert_ne!(picture.image.pixel(100, 149), Some([255; 3]));
    assert_eq!(picture.image.pixel(100, 150), Some([255; 3]));
}

#[test]
fn the_nearer_hides_the_farther() {
    let mesh = box_of_tets([4, 3, 3], [0.0; 3], [2.0, 1.0, 1.0]);
    let stages = |height: f64| {
        format!(
            r#"{{"slice": {{"planes": [{{"origin": [0, 0, 0.2], "normal": [0, 0, 1]}},
                                       {{"origin": [0, 0, 0.9], "normal": [0, 0.1, 1]}}]}}}},
               {{"render": {{"file": "a.png", "field": "z", "range": [0, 1], "width": 80, "height": 80,
                   "color_map": "grey", "axes": false, "scalar_bar": false,
                   "cameras": [{{"position": [1, 0.5, {height}], "focal_point": [1, 0.5, 0.5],
                                 "up": [0, 1, 0]}}]}}}}"#
        )
    };
    let light = |value: f64| [(26.0 + 216.0 * value + 0.5) as u8; 3];
    let from_above = picture(&mesh, &stages(9.0)).image.pixel(40, 40);
    assert!(is_near(from_above, light(0.85)), "{from_above:?}");
    let from_below = picture(&mesh, &stages(-9.0)).image.pixel(40, 40);
    assert!(is_near(from_below, light(0.2)), "{from_below:?}");
}

#[test]
fn lines_and_points_are_as_wide_as_they_are_said_to_be() {
    let mesh = box_of_tets([4, 3, 3], [0.0; 3], [2.0, 1.0, 1.0]);
    let stages = format!(
        r#"{{"probe": {{"line": {{"from": [0.5, 0.5, 0.5], "to": [1.5, 0.5, 0.5], "count": 5}}}}}},
           {{"render": {{"file": "a.png", "line_width": 8, {ABOVE}}}}}"#
    );
    let lines = picture(&mesh, &stages);
    let dark = |column: u32| {
        (0..200).filter(|&row| lines.image.pixel(column, row) != Some([255; 3])).count()
    };
    assert_eq!(dark(100), 8);
    assert_eq!(dark(40), 0);
    let stages = format!(
        r#"{{"probe": {{"points": [[0.5, 0.5, 0.5]]}}}},
           {{"render": {{"file": "a.png", "point_size": 20, {ABOVE}}}}}"#
    );
    let points = picture(&mesh, &stages);
    let count = points.image.pixels.chunks(3).filter(|pixel| **pixel != [255; 3]).count();
    let area = 100.0 * std::f64::consts::PI;
    assert!((count as f64 - area).abs() < 0.12 * area, "{count}");
    assert_ne!(points.image.pixel(50, 100), Some([255; 3]));
}

const SCENES: &str = r##"
    {"name": "surface", "stages": [{"surface": {}}, {"render": {"file": "surface.png", "field": "p", RENDER}}]},
    {"name": "edges", "stages": [{"surface": {}},
        {"render": {"file": "edges-{camera}.png", "field": "load", "edges": true, "shading": "flat", RENDER,
                    "cameras": [{"azimuth": 20, "elevation": 40, "parallel": true}, {"azimuth": 200, "elevation": -15, "up": [0, 1, 0]}]}}]},
    {"name": "plane", "stages": [{"slice": {"origin": [0.9, 0.4, 0.5], "normal": [1, 0.3, -0.2]}},
        {"render": {"file": "plane.png", "field": "u", "component": "y", "edges": true, RENDER}}]},
    {"name": "along the grid", "stages": [{"slice": {"origin": [1, 0.4, 0.5], "normal": [1, 0, 0]}},
        {"render": {"file": "grid.png", "field": "p", "edges": true, RENDER, "cameras": [{"azimuth": 0, "parallel": true}]}}]},
    {"name": "sphere", "stages": [{"slice": {"sphere": {"center": [1.1, 0.45, 0.5], "radius": 0.43}}},
        {"render": {"file": "sphere.png", RENDER}}]},
    {"name": "contour", "stages": [{"contour": {"field": "p", "values": [0.11, 0.42]}},
        {"render": {"file": "contour.png", "field": "x", RENDER}}]},
    {"name": "threshold", "stages": [{"threshold": {"field": "load", "min": 3, "max": 11}},
        {"render": {"file": "threshold.png", "field": "load", RENDER}}]},
    {"name": "clip", "stages": [{"clip": {"sphere": {"center": [1.1, 0.45, 0.5], "radius": 0.43}, "invert": true}},
        {"render": {"file": "clip.png", "field": "p", RENDER}}]},
    {"name": "inside", "stages": [{"clip": {"plane": {"origin": [0.9, 0.4, 0.5], "normal": [1, 0.3, -0.2]}}},
        {"render": {"file": "inside.png", "field": "p", RENDER,
                    "cameras": [{"position": [1.4, 0.5, 0.5], "focal_point": [2, 0.7, 0.4], "angle": 80}]}}]},
    {"name": "whole", "stages": [{"render": {"file": "whole.png", "field": "load", "caption": "t = {time}", RENDER}}]},
    {"name": "line", "stages": [{"probe": {"line": {"from": [0.1, 0.2, 0.3], "to": [1.9, 0.7, 0.8], "count": 20}}},
        {"render": {"file": "line.png", "field": "p", RENDER}}]}"##;

/// The sum of Fowler, Noll and Vo.
fn fnv(bytes: impl Iterator<Item = u8>) -> u64 {
    bytes.fold(0xcbf2_9ce4_8422_2325, |sum, byte| {
        (sum ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

#[test]
fn one_and_three_ranks_draw_the_same_bits() {
    let scenes = SCENES.replace("RENDER", r#""width": 300, "height": 200, "samples": 2"#);
    // The sums say that they are the same bits on every machine.
    for (mesh, sum) in [
        (bent(&box_of_tets([5, 4, 4], [0.0; 3], [2.0, 1.0, 1.0])), 5_146_431_304_096_962_729),
        (box_of_mixed_cells([6, 4, 4], [0.0; 3], [2.0, 1.0, 1.0]), 7_133_610_293_070_344_132),
    ] {
        let alone = made(&scenes, &Part::whole(&mesh).unwrap(), Arc::new(Solo));
        assert!(alone.errors.is_empty(), "{:?}", alone.errors);
        assert_eq!(alone.pictures.len(), 12);
        let pixels = alone.pictures.values().flat_map(|picture| &picture.image.pixels);
        assert_eq!(fnv(pixels.copied()), sum);
        let count = mesh.cells().len();
        let of_cells: Vec<usize> = in_order(count, 7).iter().map(|piece| piece % 3).collect();
        let by_ranks = threads::run(3, |ranks| {
            let part = Part::cut(&mesh, &of_cells, ranks.rank(), true).unwrap();
            // The ranks number their vertices and cells in other ways.
            let turned = |count: usize| (0..count).rev().collect::<Vec<usize>>();
            let part = part.reordered(&turned(part.points.len()), &turned(part.cells.len()));
            made(&scenes, &part, Arc::new(ranks))
        });
        assert!(by_ranks[0].errors.is_empty(), "{:?}", by_ranks[0].errors);
        assert!(by_ranks[1].pictures.is_empty());
        for (name, picture) in &alone.pictures {
            let theirs = &by_ranks[0].pictures[name];
            let [least, largest] = picture.range.unwrap_or_default();
            let their = theirs.range.unwrap_or_default();
            assert!((least - their[0]).abs() + (largest - their[1]).abs() < 1e-12, "{name}");
            let pixels = picture.image.pixels.chunks(3).zip(theirs.image.pixels.chunks(3));
            let others = pixels.filter(|(ours, theirs)| ours != theirs).count();
            assert!(picture.image == theirs.image, "{name}: {others} pixels differ");
        }
    }
}

/// The mesh with its vertices moved, so that few things lie where they are expected.
fn bent(mesh: &Mesh) -> Mesh {
    let bend = |&[x, y, z]: &Vector| [x + 0.1 * y * z, y + 0.07 * x * x, z + 0.05 * (x - y)];
    let points = mesh.points().iter().map(bend).collect();
    Mesh::new(points, mesh.cells().clone(), mesh.features().clone()).unwrap()
}

#[test]
fn pixels_are_what_the_rays_of_vtk_meet() {
    let meshes = [
        ("tetrahedra", bent(&box_of_tets([5, 4, 4], [0.0; 3], [2.0, 1.0, 1.0]))),
        ("mixed cells", box_of_mixed_cells([6, 4, 4], [0.0; 3], [2.0, 1.0, 1.0])),
    ];
    for (what, mesh) in &meshes {
        for parallel in [true, false] {
            let stages = |source: &str| {
                format!(
                    r#"{{"name": "a", "stages": [{source}, {{"write": {{"file": "a.vtu"}}}},
                     {{"render": {{"file": "a.png", "field": "x", "range": [-1, 2], "shading": "none",
                     "color_map": "grey", "width": 160, "height": 120, "samples": 1, "axes": false, "scalar_bar": false,
                     "cameras": [{{"position": [3.5, -3, 2.4], "focal_point": [1, 0.5, 0.4], "parallel": {parallel}, "angle": 30}}]}}}}]}}"#
                )
            };
            // Others than triangles are flat here: VTK divides them along other diagonals.
            let cut = match *what {
                "tetrahedra" => r#"{"contour": {"field": "p", "values": [0.11, 0.42]}}"#,
                _ => r#"{"slice": {"origin": [0.9, 0.4, 0.5], "normal": [1, 0.3, -0.2]}}"#,
            };
            let sources = [
                r#"{"surface": {}}"#,
                cut,
                r#"{"clip": {"sphere": {"center": [1.1, 0.45, 0.5], "radius": 0.6}}}"#,
            ];
            for source in sources {
                let made = made(&stages(source), &Part::whole(mesh).unwrap(), Arc::new(Solo));
                let folder = tempfile::tempdir().unwrap();
                let [mesh_file, picture_file] =
                    ["a.vtu", "a.png"].map(|name| folder.path().join(name));
                files::write(&mesh_file, &made.extracts["a.vtu"]).unwrap();
                files::write_picture(&picture_file, &made.pictures["a.png"].image).unwrap();
                let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/vtk/picture.py");
                let output = Command::new("/usr/bin/python3")
                    .args([script, mesh_file, picture_file])
                    .args([parallel.to_string()])
                    .output()
                    .expect("scripts/setup installs VTK");
                let error = String::from_utf8_lossy(&output.stderr);
                assert!(output.status.success(), "{what}: {source}: {error}");
                let result: Value = serde_json::from_slice(&output.stdout).expect("JSON");
                let count = |key: &str| result[key].as_u64().unwrap();
                assert!(count("hit") > 300, "{what}: {source}: {result}");
                // A ray through the very edge of a face may miss it, or another one.
                assert!(count("outline") <= 12, "{what}: {source}: {result}");
                assert!(count("color") <= 12, "{what}: {source}: {result}");
            }
        }
    }
}

/// What is selected is written; what is drawn need not be.
#[test]
fn a_field_that_is_not_selected_is_drawn_without_a_source() {
    let mesh = box_of_tets([1, 1, 1], [0.0; 3], [1.0; 3]);
    for source in ["", r#"{"surface": {}}, "#] {
        let stages = format!(
            r#"{source}{{"select": {{"fields": ["p"]}}}}, {{"render": {{"file": "a.png", "field": "x"}}}}"#
        );
        let picture = picture(&mesh, &stages);
        assert!(picture.range.is_some(), "{stages}");
    }
}

#[test]
fn a_field_that_is_not_there_is_named_and_nothing_is_drawn() {
    let mesh = box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]);
    let failed = |render: &str| {
        let pipeline =
            format!(r#"{{"name": "a", "stages": [{{"render": {{"file": "a.png", {render}}}}}]}}"#);
        let made = made(&pipeline, &Part::whole(&mesh).unwrap(), Arc::new(Solo));
        assert!(made.pictures.is_empty());
        made.errors.join("\n")
    };
    let error = failed(r#""field": "presure""#);
    assert!(error.starts_with("render: the channel has no field `presure`"), "{error}");
    let error = failed(r#""field": "p", "component": "z""#);
    assert_eq!(error, "render: field `p` has 1 components, found number 2 from 0");
}

#[test]
fn a_database_says_what_its_pictures_show() {
    let mesh = box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]);
    let pipeline = r#"{"name": "a", "stages": [{"render": {"file": "run.cdb", "width": 40, "height": 30,
        "orbit": {"azimuths": 2, "elevations": [-10, 30]}, "cameras": [{"name": "front", "position": [9, 0, 0], "focal_point": [0, 0, 0]}]}}]}"#;
    let made = made(pipeline, &Part::whole(&mesh).unwrap(), Arc::new(Solo));
    // All go to one database.
    assert_eq!(made.pictures.keys().collect::<Vec<_>>(), ["run.cdb"]);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.cdb");
    let mut database = Database::create(&path).unwrap();
    let picture = Arc::clone(&made.pictures["run.cdb"]);
    database.push(7, 0.25, &picture).unwrap();
    let camera = Picture { camera: "front".into(), angles: None, ..Picture::clone(&picture) };
    database.push(8, 0.5, &camera).unwrap();
    let table = std::fs::read_to_string(path.join("data.csv")).unwrap();
    assert_eq!(
        table,
        "time,cycle,camera,azimuth,elevation,FILE\n\
         0.25,7,180+30,180,30,000007-180+30.png\n0.5,8,front,,,000008-front.png\n"
    );
    assert!(path.join("000007-180+30.png").is_file());
}

/// A copy of a cell that another part has is not drawn, and neither is the face towards it, which
/// lies inside the whole mesh; a hidden cell leaves a hole.
#[test]
fn ghosts_are_not_drawn() {
    let stages = r#"{"surface": {}}, {"render": {"file": "a.png", "field": "x", "range": [0, 5], "width": 120, "height": 90,
        "axes": false, "cameras": [{"position": [-9, -7, 8], "focal_point": [2, 1.5, 1.5], "up": [0, 0, 1]}]}}"#;
    let mesh = box_of_tets([5, 3, 3], [0.0; 3], [5.0, 3.0, 3.0]);
    let is_last = |cell: usize| {
        let vertices = mesh.cells().vertices(cell);
        vertices.iter().all(|&vertex| mesh.points()[vertex as usize][0] > 3.9)
    };
    let drawn = |bits: u8| {
        let ghosts = (0..mesh.cells().len()).map(|cell| if is_last(cell) { bits } else { 0 });
        let part = Part { ghosts: Some(ghosts.collect()), ..Part::whole(&mesh).unwrap() };
        let made =
            made(&format!(r#"{{"name": "a", "stages": [{stages}]}}"#), &part, Arc::new(Solo));
        assert!(made.errors.is_empty(), "{:?}", made.errors);
        Arc::clone(&made.pictures["a.png"])
    };
    let shorter = picture(&box_of_tets([4, 3, 3], [0.0; 3], [4.0, 3.0, 3.0]), stages);
    let all = picture(&mesh, stages);
    assert_ne!(all.image, shorter.image);
    assert_eq!(drawn(0).image, all.image);
    // From this side the open end is not seen: what is left looks as the shorter box.
    assert_eq!(drawn(ghosts::DUPLICATE).image, shorter.image);
    assert_eq!(drawn(ghosts::HIDDEN).image, shorter.image);
}
