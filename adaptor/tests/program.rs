//! The program `tombolo`.

use std::{
    path::Path,
    process::{Command, Output},
};

use serde_json::Value;
use tombolo::{
    deform::{
        mesh::{CellType, Cells, FeatureSource, Mesh, NumberType},
        shapes::{self, box_of_tets},
    },
    pipelines::{
        extract::{Association, Field},
        files::{Compression, read_mesh, write_mesh},
    },
};

fn tombolo(directory: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tombolo"))
        .args(arguments)
        .current_dir(directory)
        .output()
        .expect("runs")
}

fn error_text(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn json(output: &Output) -> Value {
    assert!(output.status.code().is_some());
    serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|error| panic!("{error}: {}", error_text(output)))
}

fn with_box(edits: &str) -> (tempfile::TempDir, Mesh) {
    let directory = tempfile::tempdir().unwrap();
    let mesh = box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]);
    write_mesh(directory.path().join("box.vtu"), &mesh, &[], Compression::None).unwrap();
    std::fs::write(directory.path().join("edits.json"), edits).unwrap();
    (directory, mesh)
}

const EDIT: [&str; 8] =
    ["edit", "--mesh", "box.vtu", "--edits", "edits.json", "--out", "out.vtu", "--json"];

#[test]
fn check_points_at_what_is_wrong() {
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(directory.path().join("bad.json"), "{\"version\": 1,\n \"pipelnes\": []}")
        .unwrap();
    std::fs::write(directory.path().join("good.json"), "{\"version\": 1}").unwrap();
    let bad = tombolo(directory.path(), &["check", "bad.json"]);
    assert_eq!(bad.status.code(), Some(1));
    let text = error_text(&bad);
    assert!(text.contains("bad.json:2:2") && text.contains("did you mean `pipelines`?"), "{text}");
    assert_eq!(tombolo(directory.path(), &["check", "good.json"]).status.code(), Some(0));
    let missing = tombolo(directory.path(), &["check", "missing.json"]);
    assert!(missing.status.code() == Some(1) && error_text(&missing).contains("missing.json"));
    let lists_one = |arguments: &[&str], said: &str| {
        let output = tombolo(directory.path(), &[&["check", "--json"], arguments].concat());
        let (errors, code) = (json(&output), output.status.code());
        assert_eq!((errors.as_array().map(Vec::len), code), (Some(1), Some(1)), "{errors}");
        assert!(errors[0]["message"].as_str().is_some_and(|it| it.contains(said)), "{errors}");
    };
    std::fs::write(directory.path().join("binary.json"), b"\xff").unwrap();
    lists_one(&["missing.json"], "missing.json");
    lists_one(&["binary.json"], "UTF-8");
    lists_one(&["good.json", "--mesh", "none.vtu"], "none.vtu");
    assert!(json(&tombolo(directory.path(), &["schema"]))["properties"]["pipelines"].is_object());
}

#[test]
fn check_tells_every_error_and_those_on_a_mesh() {
    let directory = tempfile::tempdir().unwrap();
    let mesh = box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]);
    let pressure = Field {
        name: "pressure".into(),
        association: Association::Vertex,
        components: 1,
        number: NumberType::F64,
        values: vec![0.0; mesh.points().len()],
    };
    write_mesh(directory.path().join("box.vtu"), &mesh, &[pressure], Compression::None).unwrap();
    let views = r#"{"version": 1, "pipelines": [
  {"name": "a", "stages": [{"surface": {"all": true}}, {"statistics": {"field": "presure"}}]},
  {"name": "b", "stages": [{"vorticity": {"field": "velocity"}}, {"statistics": {"field": "vorticity"}}],
   "when": "vorticity.mx > 1", "then": [{"stop": {}}]},
  {"name": "c", "channel": "solid", "stages": [{"statistics": {"field": "heat"}}]}
]}"#;
    std::fs::write(directory.path().join("views.json"), views).unwrap();
    let check = |more: &[&str]| {
        let output = tombolo(directory.path(), &[&["check", "views.json"], more].concat());
        assert_eq!(output.status.code(), Some(1));
        output
    };
    let lines = |output: &Output| -> Vec<String> {
        error_text(output).lines().map(str::to_owned).collect()
    };
    let all = "views.json:2:41: pipelines[0].stages[0].surface.all: found the unknown key `all`, expected no key at all";
    let presure = "views.json:2:81: pipelines[0].stages[1].statistics.field: the channel has no field `presure`; its fields are pressure; did you mean `pressure`?";
    // The field that it would derive is not told of.
    let velocity = "views.json:3:52: pipelines[1].stages[0].vorticity.field: the channel has no field `velocity`; its fields are pressure";
    let when = "views.json:4:12: pipelines[1].when: column 1 of the formula: found the unknown name `vorticity.mx`, expected a monitor; did you mean `vorticity.max`?";
    let heat = "views.json:5:73: pipelines[2].stages[0].statistics.field: the channel has no field `heat`; its fields are pressure";
    assert_eq!(lines(&check(&[])), [all, when, "tombolo: 2 error(s)"]);
    assert_eq!(
        lines(&check(&["--mesh", "box.vtu"])),
        [all, presure, velocity, when, heat, "tombolo: 5 error(s)"]
    );
    let solid = check(&["--mesh", "box.vtu", "--channel", "solid", "--field", "heat:1:element"]);
    assert_eq!(lines(&solid), [all, when, "tombolo: 2 error(s)"]);

    let errors = json(&check(&["--mesh", "box.vtu", "--json"]));
    assert_eq!(errors.as_array().map(Vec::len), Some(5));
    assert_eq!(
        errors[1],
        serde_json::json!({
            "file": "views.json", "line": 2, "column": 81,
            "path": "pipelines[0].stages[1].statistics.field",
            "message": "the channel has no field `presure`; its fields are pressure",
            "suggestion": "pressure"
        })
    );

    // What `edit` takes, a list of commands and a journal.
    for (text, code, expected) in [
        (
            r#"[{"translate": {"features": ["x-mox"], "by": [0, 0, 1]}}]"#,
            1,
            "did you mean `x-max`?",
        ),
        (r#"[{"translate": {"features": ["x-max"], "by": [0, 0, 1]}}]"#, 0, "1 edit(s), all well"),
        (r#"{"undo": 1}"#, 0, "an order of 0 edit(s), all well"),
        (r#"[{"order": {"undo": 0}}, {"puase": {}}]"#, 1, "tombolo: 2 error(s)"),
        ("{\"pause\": {}}\n{\"stop\": {}}\n", 0, "2 command(s), all well"),
    ] {
        std::fs::write(directory.path().join("orders.json"), text).unwrap();
        let output = tombolo(directory.path(), &["check", "orders.json", "--mesh", "box.vtu"]);
        assert_eq!(output.status.code(), Some(code), "{text}");
        let said = error_text(&output) + &String::from_utf8_lossy(&output.stdout);
        assert!(said.contains(expected), "{text}: {said}");
    }
    let well = tombolo(directory.path(), &["check", "orders.json", "--json"]);
    assert_eq!((well.status.code(), json(&well)), (Some(0), serde_json::json!([])));
    let wrong = check(&["--mesh", "box.vtu", "--field", "velocity:12"]);
    assert!(error_text(&wrong).contains("1 to 9 components"), "{}", error_text(&wrong));
}

/// The tutorial shows what the program says of the tutorial's file with three slips.
#[test]
fn the_tutorial_shows_what_check_says() {
    let page = include_str!("../../docs/tutorial.md");
    let (_, section) = page.split_once("## 7. Say what is streamed").expect("the section");
    let (_, file) = section.split_once("```json\n").expect("a file");
    let (file, rest) = file.split_once("```").expect("its end");
    let (_, shown) =
        rest.split_once("$ tombolo check views.json --mesh duct.vtu\n").expect("a call");
    let (shown, _) = shown.split_once("```").expect("its end");
    let file = file
        .replace("\"normal\"", "\"nromal\"")
        .replace("\"pressure\"", "\"pressur\"")
        .replace("quality.min", "qality.min");
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(directory.path().join("views.json"), file).unwrap();
    let mesh = box_of_tets([2, 2, 2], [-1.0; 3], [1.0; 3]);
    let field = |name: &str, components: usize| Field {
        name: name.into(),
        association: Association::Vertex,
        components,
        number: NumberType::F64,
        values: vec![0.0; components * mesh.points().len()],
    };
    let fields = [field("velocity", 3), field("pressure", 1)];
    write_mesh(directory.path().join("duct.vtu"), &mesh, &fields, Compression::None).unwrap();
    let output = tombolo(directory.path(), &["check", "views.json", "--mesh", "duct.vtu"]);
    assert_eq!(error_text(&output), shown);
}

/// A run that does not start says all that is wrong, not the first thing alone.
#[test]
fn a_run_that_does_not_start_tells_every_error() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("views.json");
    let start = |text: &str| {
        std::fs::write(&file, text).unwrap();
        let settings = tombolo::Adaptor::from_file(&file).map_err(|error| error.to_string())?;
        settings.parameter("inflow", 1.0, 0.0..=2.0).start().map(drop).map_err(|it| it.to_string())
    };
    let text =
        start("{\"version\": 2,\n \"pipelines\": [{\"name\": \"\", \"stages\": []}]}").unwrap_err();
    let name = file.display();
    assert_eq!(
        text,
        format!(
            "{name}:1:13: version: found version 2, expected 1\n\
             {name}:2:25: pipelines[0].name: expected a name of 1 to 200 visible characters"
        )
    );
    let text = start(
        r#"{"version": 1, "pipelines": [{"name": "a", "when": "parameter.inflw > 0", "stages": [
            {"expression": {"name": "e", "formula": "2 * parameter.outflow"}},
            {"expression": {"name": "f", "formula": "2 * parameter.inflow"}}], "then": [{"stop": {}}]}]}"#,
    );
    assert_eq!(
        text.unwrap_err(),
        "the configuration: pipelines[0].when: the solver has no parameter `inflw`; it has inflow; did you mean `inflow`?\n\
         pipelines[0].stages[0].expression.formula: the solver has no parameter `outflow`; it has inflow"
    );
    let orders = directory.path().join("orders.json");
    std::fs::write(&orders, r#"[{"order": {"undo": 0}}, {"puase": {}}]"#).unwrap();
    let failure = tombolo::Settings::default().orders_from_file(&orders).err().unwrap();
    assert_eq!(failure.to_string().lines().count(), 2, "{failure}");
}

/// Earlier runs have made a journal longer than any file of orders may be; its newest run is short.
#[test]
fn a_journal_is_checked_and_replayed_however_long_it_has_become() {
    use std::io::{Seek, SeekFrom, Write};
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("journal.jsonl");
    let run = |id: &str| {
        let settings = r#""version":"0","began":0,"deform":{},"guard":{},"schedule":{"steps":1}"#;
        format!(r#"{{"run":{{"id":"{id}",{settings}}}}}"#)
    };
    let mut journal = std::fs::File::create(&path).unwrap();
    writeln!(journal, "{}", run("before")).unwrap();
    // Lines of 50 MiB, of which nothing but the ends is on the disk.
    for line in 1..=6 {
        journal.seek(SeekFrom::Start(line * (50 << 20))).unwrap();
        writeln!(journal).unwrap();
    }
    writeln!(journal, "{}", run("newest")).unwrap();
    let applied = r#"{"id":"a","status":"applied","cycle":5,"time":0.5,"order":{"undo":1}}"#;
    writeln!(journal, "{applied}").unwrap();
    let output = tombolo(directory.path(), &["check", "journal.jsonl"]);
    let said = error_text(&output) + &String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && said.contains("1 command(s), all well"), "{said}");
    let recording = tombolo::Settings::default().replay_from_file(&path).unwrap().replay.unwrap();
    assert_eq!((recording.commands.len(), recording.run.unwrap().id), (1, "newest".into()));
    assert_eq!(tombolo::Settings::default().orders_from_file(&path).unwrap().orders.len(), 1);
}

#[test]
fn info_counts_what_is_there() {
    let (directory, _) = with_box("[]");
    let info = json(&tombolo(directory.path(), &["mesh", "info", "box.vtu", "--json"]));
    assert_eq!((&info["vertices"], &info["cells"]), (&125.into(), &384.into()));
    assert_eq!(info["cell_types"]["tetra"], 384);
    assert_eq!(info["features"].as_array().unwrap().len(), 6);
    assert_eq!(info["features"][0]["faces"], 32);
    assert_eq!(info["quality"]["inverted"], 0);
    let text = tombolo(directory.path(), &["mesh", "info", "box.vtu"]);
    assert!(String::from_utf8_lossy(&text.stdout).contains("z-max: 32 faces, 25 vertices"));
}

#[test]
fn edit_moves_the_mesh_as_asked() {
    let (directory, mesh) = with_box(
        r#"[{"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0, 0, -0.5]}}]"#,
    );
    for more in [&[][..], &["--method", "harmonic"], &["--stiffening", "0.5", "--steps", "3"]] {
        let output = tombolo(directory.path(), &[&EDIT[..], more].concat());
        assert_eq!(output.status.code(), Some(0), "{}", error_text(&output));
        let outcome = json(&output);
        assert_eq!((&outcome["status"], &outcome["inverted"]), (&"applied".into(), &0.into()));
        assert!(outcome["before"]["min"].as_f64() > outcome["after"]["min"].as_f64());
        for part in ["read", "surface", "volume", "guard", "write"] {
            assert!(outcome["seconds"][part].as_f64() > Some(0.0), "{part}");
        }
        let shaped = read_mesh(directory.path().join("out.vtu")).unwrap().mesh;
        assert!(matches!(shaped.features(), FeatureSource::Faces(_)));
        for (point, reference) in shaped.points().iter().zip(mesh.points()) {
            match reference[2] {
                0.0 => assert_eq!(point, reference),
                1.0 => assert_eq!(*point, [reference[0], reference[1], 0.5]),
                _ => assert!(point[2] > 0.0 && point[2] < reference[2]),
            }
        }
    }
}

#[test]
fn features_are_listed_written_and_named_by_edits() {
    let (directory, mesh) = with_box(
        r#"[{"translate": {"features": ["feature-2"], "fixed": ["feature-1"], "by": [0, 0, 0.02]}}]"#,
    );
    let at = |more: &[&str]| {
        tombolo(directory.path(), &[&["features", "--mesh", "box.vtu"], more].concat())
    };
    let own = json(&at(&["--json"]));
    assert_eq!((&own["source"], &own["features"][0]["name"]), (&"mesh".into(), &"x-min".into()));
    let found =
        json(&at(&["--angle", "45", "--out", "parts.vtp", "--faces", "feature-3", "--json"]));
    assert_eq!(
        (&found["source"], found["features"].as_array().unwrap().len()),
        (&"sharp edges".into(), 6)
    );
    for feature in found["features"].as_array().unwrap() {
        assert_eq!((&feature["faces"], &feature["vertices"]), (&32.into(), &25.into()));
        assert!((feature["area"].as_f64().unwrap() - 1.0).abs() < 1e-12);
    }
    assert_eq!(found["faces"].as_array().unwrap().len(), 32);
    // Our own reader takes the file back with the same features.
    let parts = json(&tombolo(
        directory.path(),
        &["features", "--mesh", "parts.vtp", "--faces", "feature-3", "--json"],
    ));
    assert_eq!(
        (&parts["source"], &parts["features"], &parts["faces"]),
        (&"mesh".into(), &found["features"], &found["faces"])
    );

    let output = tombolo(directory.path(), &[&EDIT[..], &["--angle", "45"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", error_text(&output));
    let shaped = read_mesh(directory.path().join("out.vtu")).unwrap().mesh;
    assert_eq!(shaped.features(), mesh.features(), "the file keeps its own features");
    let named = at(&["--angle", "200"]);
    assert!(
        named.status.code() == Some(1) && error_text(&named).contains("from 0 to 180"),
        "{}",
        error_text(&named)
    );
    let none = at(&["--faces", "x-mon"]);
    assert!(error_text(&none).contains("did you mean 'x-min'"), "{}", error_text(&none));
}

#[test]
fn edit_tells_what_is_wrong_with_the_surface() {
    let (directory, _) = with_box(
        r#"[{"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0, 0, -1.2]}}]"#,
    );
    let output = tombolo(directory.path(), &EDIT);
    assert_eq!(output.status.code(), Some(2));
    let outcome = json(&output);
    assert!(
        outcome["reason"].as_str().unwrap().contains("the surface itself would be broken"),
        "{outcome}"
    );
    let broken = &outcome["surface"];
    assert!(broken["report"]["intersections"]["count"].as_u64() > Some(0), "{outcome}");
    assert_eq!(
        broken["report"]["intersections"]["first"][0]["position"].as_array().unwrap().len(),
        3
    );
    // The walls fold in their own planes where the profile is steepest, and the lid goes through
    // the floor.
    let fraction = broken["sound_fraction"].as_f64().unwrap();
    assert!((0.5..0.85).contains(&fraction), "{fraction}");
}

/// Not by a panic, not by asking for more memory than there is.
#[test]
fn edit_refuses_more_than_is_allowed() {
    let edit = r#"{"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0, 0, -1e-6]}}"#;
    let many = format!("[{}]", vec![edit; 20_000].join(","));
    let steps = |steps: u32| format!(r#"{{"edits": [{edit}], "schedule": {{"steps": {steps}}}}}"#);
    for (edits, more, named) in [
        (many, &[][..], "edits.json:1:1: found 20000 edits, expected at most 16384"),
        (
            steps(1_000_000_000),
            &[],
            "schedule.steps: found 1000000000 shapes, expected at most 10000",
        ),
        (steps(u32::MAX), &[], "schedule.steps: found 4294967295 shapes, expected at most 10000"),
        (steps(1), &["--steps", "1000000000"], "found 1000000000 shapes, expected at most 10000"),
    ] {
        let (directory, _) = with_box(&edits);
        let output = tombolo(directory.path(), &[&EDIT[..], more].concat());
        assert_eq!(output.status.code(), Some(1), "{}", error_text(&output));
        assert!(error_text(&output).contains(named), "{}", error_text(&output));
    }
    let (directory, _) = with_box(&steps(10_000));
    let output = tombolo(directory.path(), &EDIT);
    assert_eq!(output.status.code(), Some(0), "{}", error_text(&output));
}

#[test]
fn edit_refuses_with_the_reason_and_writes_nothing() {
    let good =
        r#"[{"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0, 0, -1.5]}}]"#;
    for (edits, more, code, named) in [
        (good, &[][..], 2, "feasible fraction"),
        (r#"[{"translate": {"features": ["z-mux"], "by": [0, 0, 1]}}]"#, &[], 2, "z-max"),
        (r#"[{"translate": {"features": ["z-max"], "by": [0, 0]}}]"#, &[], 1, "edits.json:1:"),
        (r#"{"undo": 1}"#, &[], 1, "undo"),
        (r#"{"stack": [], "guard": {"min_scaled_jacobian": 7}}"#, &[], 1, "min_scaled_jacobian"),
        (r#"{"stack": []}"#, &["--stiffening", "NaN"], 1, "stiffening"),
    ] {
        let (directory, _) = with_box(edits);
        let output = tombolo(directory.path(), &[&EDIT[..], more].concat());
        assert_eq!(output.status.code(), Some(code), "{edits}: {}", error_text(&output));
        assert!(error_text(&output).contains(named), "{}", error_text(&output));
        assert!(!directory.path().join("out.vtu").exists());
    }
}

#[test]
fn a_saved_stack_and_its_displacement_replay_to_the_same_bits() {
    let (directory, _) = with_box(
        r#"{"stack": [
            {"rotate": {"features": ["z-max"], "fixed": ["z-min"], "axis": [1, 2, 3], "degrees": 7, "name": "tilt"}},
            {"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0, 0, 9], "muted": true}},
            {"scale_normals": {"region": {"sphere": {"center": [0.5, 0.5, 1], "radius": 0.3}}, "fixed": ["z-min"],
                               "fixed_region": {"box": {"lower": [0, 0, 0], "upper": [1, 1, 0.1]}}, "distance": 0.05}}
        ]}"#,
    );
    let path = |name: &str| directory.path().join(name);
    for file in ["first.txt", "first.vtp", "first.csv"] {
        let output = tombolo(directory.path(), &[&EDIT[..], &["--displacement", file]].concat());
        assert_eq!(output.status.code(), Some(0), "{}", error_text(&output));
        let layers = &json(&output)["layers"];
        assert_eq!((&layers[0]["edit"], &layers[0]["name"]), (&"rotate".into(), &"tilt".into()));
        assert_eq!(layers[0]["handle_vertices"], 25);
        assert_eq!(
            (&layers[1]["muted"], &layers[1]["largest_displacement"]),
            (&true.into(), &0.0.into())
        );
        assert_eq!(layers[2]["handle_vertices"], 5);
        assert!((layers[2]["largest_displacement"].as_f64().unwrap() - 0.05).abs() < 1e-15);
    }
    let bytes = std::fs::read(path("out.vtu")).unwrap();
    let surface = std::fs::read(path("first.vtp")).unwrap();

    // The same stack again; then the surface displacement in its place, from each kind of file.
    assert_eq!(
        tombolo(directory.path(), &[&EDIT[..], &["--displacement", "again.vtp"]].concat())
            .status
            .code(),
        Some(0)
    );
    assert!(
        std::fs::read(path("out.vtu")).unwrap() == bytes
            && std::fs::read(path("again.vtp")).unwrap() == surface
    );
    std::fs::create_dir(path("orders")).unwrap();
    for file in ["first.txt", "first.vtp", "first.csv"] {
        let order = format!(r#"[{{"displacement": {{"file": "../{file}"}}}}]"#);
        std::fs::write(path("orders/edits.json"), order).unwrap();
        let arguments =
            ["edit", "--mesh", "box.vtu", "--edits", "orders/edits.json", "--out", "new.vtu"];
        let output =
            tombolo(directory.path(), &[&arguments[..], &["--displacement", "new.vtp"]].concat());
        assert_eq!(output.status.code(), Some(0), "{}", error_text(&output));
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(
            text.contains(
                "edit 0 (displacement): 98 vertices in the handle, moves the surface by at most 0."
            ),
            "{text}"
        );
        assert!(std::fs::read(path("new.vtu")).unwrap() == bytes, "{file}");
        assert!(std::fs::read(path("new.vtp")).unwrap() == surface, "{file}");
    }
}

#[test]
fn a_displacement_file_that_is_wrong_is_named_by_line_and_column() {
    let (directory, _) = with_box(r#"[{"displacement": {"file": "lift.txt"}}]"#);
    let output = tombolo(directory.path(), &EDIT);
    assert!(
        output.status.code() == Some(1) && error_text(&output).contains("lift.txt"),
        "{}",
        error_text(&output)
    );
    std::fs::write(directory.path().join("lift.txt"), "0 0 0 0 0 0\n0 0 1 0 zero 0\n").unwrap();
    let output = tombolo(directory.path(), &EDIT);
    assert_eq!(output.status.code(), Some(1));
    let text = error_text(&output);
    assert!(
        text.contains("edit 0 (displacement): file: lift.txt, line 2, column 9: found \"zero\""),
        "{text}"
    );
    assert!(!directory.path().join("out.vtu").exists());
}

/// What `tombolo edit` says to an edit of a surface of triangles.
fn refused_on(points: &[[f64; 3]], corners: &[u32], tags: &[i64], edit: &str) -> String {
    let directory = tempfile::tempdir().unwrap();
    let cells = Cells::uniform(CellType::Triangle, corners.to_vec()).unwrap();
    let mesh =
        Mesh::new(points.to_vec(), cells, FeatureSource::Vertices(tags.to_vec().into())).unwrap();
    write_mesh(directory.path().join("box.vtu"), &mesh, &[], Compression::None).unwrap();
    std::fs::write(directory.path().join("edits.json"), format!("[{edit}]")).unwrap();
    let output = tombolo(directory.path(), &EDIT[..7]);
    assert_ne!(output.status.code(), Some(0));
    assert!(!directory.path().join("out.vtu").exists());
    error_text(&output)
}

#[test]
fn surfaces_that_cannot_be_edited_are_named_to_the_user() {
    let square = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let lift =
        r#"{"translate": {"features": ["feature-1"], "fixed": ["feature-0"], "by": [0, 0, 1]}}"#;
    // Three faces at one edge.
    let book = [&square[..], &[[0.5, 0.5, 1.0]]].concat();
    let text = refused_on(&book, &[0, 1, 2, 0, 2, 3, 0, 2, 4], &[0, 0, 0, 0, 1], lift);
    assert!(text.contains("mesh vertices 0 and 2") && text.contains("3 faces"), "{text}");
    // Two faces at one vertex.
    let bow = [&square[..], &[[2.0, 1.0, 0.0], [2.0, 2.0, 0.0]]].concat();
    let text = refused_on(&bow, &[0, 1, 2, 0, 2, 3, 2, 4, 5], &[0, 0, 0, 0, 1, 1], lift);
    assert!(text.contains("mesh vertex 2"), "{text}");
    // The same face twice.
    let text = refused_on(&square, &[0, 1, 2, 0, 2, 3, 2, 0, 1], &[0, 0, 1, 1], lift);
    assert!(text.contains("cells 0 and 2"), "{text}");
    // Two vertices at one place, which the edit would part.
    let seam = [&square[..], &[square[1], square[2], [2.0, 0.0, 0.0], [2.0, 1.0, 0.0]]].concat();
    let text =
        refused_on(&seam, &[0, 1, 2, 0, 2, 3, 4, 6, 7, 4, 7, 5], &[0, 0, 0, 0, 1, 1, 1, 1], lift);
    assert!(text.contains("seam") && text.contains("mesh vertices"), "{text}");
    // All that should move is held.
    let held =
        r#"{"translate": {"features": ["feature-1"], "fixed": ["feature-1"], "by": [0, 0, 1]}}"#;
    let text = refused_on(&square, &[0, 1, 2, 0, 2, 3], &[0, 0, 1, 1], held);
    assert!(text.contains("feature-1"), "{text}");
}

/// A mesh in a mirror has left-handed cells: it is edited, and the file has the cells as they were
/// in the file that was read.
#[test]
fn a_left_handed_mesh_keeps_its_order_of_vertices() {
    let upper = [1.0, 1.0, 2.0];
    for mesh in [
        box_of_tets([3, 3, 3], [0.0; 3], upper),
        shapes::box_of_hexahedra([3, 3, 3], [0.0; 3], upper),
        shapes::box_of_mixed_cells([3, 3, 4], [0.0; 3], upper),
    ] {
        let directory = tempfile::tempdir().unwrap();
        let mirrored = mesh.points().iter().map(|&[x, y, z]| [-x, y, z]).collect();
        let given = mesh.cells().as_given().into_owned();
        let image = Mesh::new(mirrored, given.clone(), mesh.features().clone()).unwrap();
        write_mesh(directory.path().join("box.vtu"), &image, &[], Compression::None).unwrap();
        let edits =
            r#"[{"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0.1, 0, -0.5]}}]"#;
        std::fs::write(directory.path().join("edits.json"), edits).unwrap();
        let output = tombolo(directory.path(), &EDIT);
        let text = error_text(&output);
        assert_eq!(output.status.code(), Some(0), "{text}");
        assert_eq!(text.matches("left-handed cells").count(), 1, "said once: {text}");
        assert_eq!(json(&output)["inverted"], 0);
        let [before, after] =
            ["box.vtu", "out.vtu"].map(|name| read_mesh(directory.path().join(name)).unwrap());
        assert_eq!(*before.mesh.cells().as_given(), given);
        assert_eq!(*after.mesh.cells().as_given(), given);
        assert!(before.notes.iter().any(|note| note.contains("left-handed")), "{:?}", before.notes);
    }
}

/// Where nothing is refused but something is wrong, scripts must not take it for a refusal.
#[test]
fn wrong_arguments_are_no_refusal() {
    let (directory, _) = with_box(
        r#"[{"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0, 0, 0.1]}}]"#,
    );
    let edit = ["edit", "--mesh", "box.vtu", "--edits", "edits.json"];
    let wrong = |more: &[&str], why: &str| {
        let output = tombolo(directory.path(), &[&edit[..], more].concat());
        let text = error_text(&output);
        assert_eq!(output.status.code(), Some(1), "{more:?}: {text}");
        assert!(text.contains(why), "{more:?}: {text}");
    };
    wrong(&[], "--displacement");
    wrong(&["--output", "out.vtu"], "'--out'");
    wrong(&["--out", "out.vtu", "--steps", "0"], "--steps");
    wrong(&["--out", "out.vtu", "--stiffening", "9"], "stiffening");
    wrong(&["--out", "out.vtu", "--stiffening", "nan"], "stiffening");
    wrong(&["--out", "out.vtu", "--min-quality", "5"], "min_scaled_jacobian");
    // Before the work, not after it.
    wrong(&["--out", "out.stl"], "known are .vtu, .vtp and .vtk");
    wrong(&["--out", "out.vtp"], "write it as .vtu");
    wrong(&["--displacement", "out.stl"], ".txt, .csv and .vtp");
    wrong(&["--out", "same.vtu", "--displacement", "same.vtu"], ".txt, .csv and .vtp");
    let surface = ["features", "--mesh", "box.vtu", "--out", "box.vtp"];
    assert!(tombolo(directory.path(), &surface).status.success());
    let same = [
        "edit",
        "--mesh",
        "box.vtp",
        "--edits",
        "edits.json",
        "--out",
        "a.vtp",
        "--displacement",
        "a.vtp",
    ];
    assert!(error_text(&tombolo(directory.path(), &same)).contains("the same file"));
    for usage in [&[][..], &["mesh"]] {
        assert_eq!(tombolo(directory.path(), usage).status.code(), Some(1), "{usage:?}");
    }
    // It may have been meant as a task that reaches a run, of which 2 is wrong use.
    assert_eq!(tombolo(directory.path(), &["ordr", "run.link"]).status.code(), Some(2));
    let help = tombolo(directory.path(), &["--help"]);
    assert!(
        help.status.success() && String::from_utf8_lossy(&help.stdout).contains("Exit codes: 0")
    );
    let version = tombolo(directory.path(), &["--version"]);
    assert_eq!(
        String::from_utf8_lossy(&version.stdout),
        concat!("tombolo ", env!("CARGO_PKG_VERSION"), "\n")
    );
}

/// The displacement is enough to ask for; so are the numbers of a skeleton.
#[test]
fn one_result_is_enough() {
    let (directory, _) = with_box(
        r#"[{"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0, 0, 0.1]}}]"#,
    );
    let edit = [
        "edit",
        "--mesh",
        "box.vtu",
        "--edits",
        "edits.json",
        "--displacement",
        "lift.txt",
        "--json",
    ];
    let outcome = json(&tombolo(directory.path(), &edit));
    assert_eq!(outcome["status"], "applied");
    let both = [&edit[..5], &["--out", "out.vtu", "--displacement", "both.txt"]].concat();
    assert!(tombolo(directory.path(), &both).status.success());
    let read = |name: &str| std::fs::read(directory.path().join(name)).unwrap();
    assert_eq!(read("lift.txt"), read("both.txt"));
    let skeleton = json(&tombolo(directory.path(), &["skeleton", "--mesh", "box.vtu", "--json"]));
    assert!(skeleton["nodes"].as_u64().unwrap() > 0, "{skeleton}");
}
