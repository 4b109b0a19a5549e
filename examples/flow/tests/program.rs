//! Cases, orders and reports, on a mesh small enough for a test.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use tombolo_deform::communicator::threads;
use tombolo_deform::mesh::FeatureSource;
use tombolo_deform::shapes::{BOX_FEATURES, box_of_tets};
use tombolo_flow::Settings;
use tombolo_flow::case::{Case, CaseError};
use tombolo_flow::parts::Dealing;
use tombolo_flow::program::{Options, Run};
use tombolo_flow::report::{Report, empty_file, make_file};
use tombolo_pipelines::files::{self, Compression};

const CASE: &str = r#"{
  "mesh": "channel.vtu",
  "density": 1.0,
  "viscosity": "0.01 * thickness",
  "parameters": { "thickness": { "value": 1, "minimum": 0.1, "maximum": 10 } },
  "boundary": {
    "x-min": { "velocity": ["y * (1 - y)", 0, 0] },
    "x-max": { "pressure": 0 },
    "y-min": { "wall": "no_slip" },
    "y-max": { "wall": "no_slip" },
    "z-min": { "wall": "slip" },
    "z-max": { "wall": "slip" }
  },
  "time_step": 0.05,
  "steps": 12
}"#;

const ORDERS: &str = r#"[
  { "at": { "cycle": 2 },
    "order": { "edits": [ { "translate": { "features": ["y-max"], "fixed": ["y-min"], "by": [0, -0.2, 0], "harmonic_order": 1 } } ],
               "schedule": { "steps": 2, "every": { "steps": 2 } } } },
  { "at": { "cycle": 5 }, "parameter": { "name": "thickness", "value": 2 } },
  { "at": { "cycle": 6 }, "order": { "edits": [ { "translate": { "features": ["y-max"], "fixed": ["y-min"], "by": [0, -3, 0] } } ] } },
  { "at": { "cycle": 8 }, "order": { "undo": 1 } }
]"#;

fn folder(case: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let mut mesh = box_of_tets([8, 4, 3], [0.0; 3], [2.0, 1.0, 0.75]);
    if let FeatureSource::Faces(tagged) = mesh.features() {
        let mut tagged = tagged.clone();
        tagged.names = (1..).zip(BOX_FEATURES.map(str::to_owned)).collect();
        mesh = tombolo_deform::mesh::Mesh::new(
            mesh.points().to_vec(),
            mesh.cells().clone(),
            FeatureSource::Faces(tagged),
        )
        .unwrap();
    }
    files::write_mesh(folder.path().join("channel.vtu"), &mesh, &[], Compression::default())
        .unwrap();
    let file = folder.path().join("case.json");
    std::fs::write(&file, case).unwrap();
    (folder, file)
}

fn headless(case: &Path) -> Options {
    Options { case: case.into(), headless: true, ..Options::default() }
}

fn run(options: &Options) -> Report {
    Run::new(options).unwrap().finish().unwrap()
}

#[test]
fn runs_a_case_with_orders_and_undoes_them_bit_for_bit() {
    let (folder, case) = folder(CASE);
    let orders = folder.path().join("orders.json");
    std::fs::write(&orders, ORDERS).unwrap();
    let mut options = headless(&case);
    options.orders = Some(orders);
    options.out = Some(folder.path().join("out"));

    // Two shapes, two steps each.
    options.steps = Some(6);
    let squeezed = run(&options);
    assert_eq!(squeezed.error, None);
    let mesh = files::read_mesh(folder.path().join("out/final.vtu")).unwrap().mesh;
    let highest = mesh.points().iter().map(|point| point[1]).fold(0.0, f64::max);
    assert!((highest - 0.8).abs() < 1e-12, "{highest}");

    options.steps = None;
    let report = run(&options);
    assert_eq!((report.cycles, report.mesh.inverted, report.error.as_deref()), (12, 0, None));
    assert!((report.time - 0.6).abs() < 1e-12);
    let json = serde_json::to_value(&report).unwrap();
    let statuses: Vec<&str> = json["orders"]
        .as_array()
        .unwrap()
        .iter()
        .map(|order| order["status"].as_str().unwrap())
        .collect();
    assert_eq!(statuses, ["applied", "rejected", "applied"], "{json:#}");
    assert_eq!(json["orders"][0]["cycle_applied"], 2);
    assert!(json["orders"][1]["reason"].as_str().unwrap().len() > 20);
    for key in ["median", "p95"] {
        assert!(json["step_seconds"][key].as_f64().unwrap() > 0.0);
    }
    for key in ["surface", "volume", "guard"] {
        assert!(json["orders"][0]["seconds"][key].is_number());
    }
    for key in ["frames", "dropped", "unrecorded", "bytes", "raw_bytes"] {
        assert!(json["stream"][key].is_number());
    }
    assert!(report.flow.mass_in > 0.1);
    assert!(
        (report.flow.mass_in - report.flow.mass_out).abs() < 1e-5 * report.flow.mass_in,
        "{:?}",
        report.flow
    );
    assert!(report.flow.worst_imbalance < 1e-5);

    let restored = files::read_mesh(folder.path().join("out/final.vtu")).unwrap();
    let reference = files::read_mesh(folder.path().join("channel.vtu")).unwrap();
    assert!(restored.mesh.points() == reference.mesh.points(), "undo did not restore every bit");
    let names: Vec<&str> = restored.fields.iter().map(|field| field.name.as_str()).collect();
    assert!(names.contains(&"velocity") && names.contains(&"pressure"), "{names:?}");
}

#[test]
fn a_step_takes_no_less_than_its_pace() {
    let (_folder, case) = folder(CASE);
    let pace = Duration::from_millis(50);
    let report = run(&Options { pace, steps: Some(4), ..headless(&case) });
    assert_eq!((report.error, report.cycles), (None, 4));
    assert!(report.flow.seconds >= 0.2, "{} s", report.flow.seconds);
}

#[test]
fn a_flow_that_diverges_ends_the_run_with_its_place() {
    let diverging = CASE.replace("\"y * (1 - y)\"", "\"1 / max(0, 0.22 - t)\"");
    let (_folder, case) = folder(&diverging);
    let report = run(&headless(&case));
    let error = report.error.unwrap();
    assert!(error.starts_with("cycle 5, time 0.25") && error.contains("velocity"), "{error}");
    assert_eq!(report.cycles, 5);
}

#[test]
fn names_what_is_wrong_in_a_case() {
    let failure = |from: &str, to: &str| {
        assert!(CASE.contains(from));
        let (_folder, file) = folder(&CASE.replace(from, to));
        match Run::new(&headless(&file)) {
            Ok(_) => panic!("{to} was taken"),
            Err(error) => error.to_string(),
        }
    };
    let expect = |found: String, parts: &[&str]| {
        for part in parts {
            assert!(found.contains(part), "'{part}' is not in: {found}");
        }
    };
    expect(failure("\"x-min\"", "\"x-mni\""), &["x-mni", "did you mean 'x-min'", "z-max"]);
    expect(
        failure(r#""z-max": { "wall": "slip" }"#, r#""z-min": { "wall": "slip" }"#),
        &["case.json:", "z-min"],
    );
    expect(failure(",\n    \"z-max\": { \"wall\": \"slip\" }", ""), &["z-max", "no condition"]);
    expect(
        failure("viscosity\": \"0.01 * thickness\"", "viscosity\": \"0.01 * thicknes\""),
        &["case.json:4:", "thickness"],
    );
    expect(
        failure("viscosity\": \"0.01 * thickness\"", "viscosity\": \"0.01 * x\""),
        &["viscosity"],
    );
    expect(
        failure("\"density\": 1.0", "\"density\": \"max(0.01, x - 1)\""),
        &["case.json:3:", "density", "the same everywhere"],
    );
    expect(
        failure("\"density\": 1.0", "\"density\": -1.0"),
        &["case.json:3:", "density", "positive"],
    );
    expect(failure("\"density\"", "\"densty\""), &["case.json:3:", "density"]);
    expect(failure("no_slip", "no_slipp"), &["no_slip"]);
    expect(failure("0.05", "0"), &["time_step", "positive"]);
    expect(failure("channel.vtu", "chanel.vtu"), &["chanel.vtu"]);
}

#[test]
fn every_case_that_comes_with_the_program_is_well_formed() {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let files = |folder: &str| -> Vec<PathBuf> {
        let entries = std::fs::read_dir(here.join(folder)).unwrap();
        let found: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
        assert!(!found.is_empty(), "{folder}");
        found
    };
    for file in files("cases") {
        let case = Case::read(&file).unwrap_or_else(|error: CaseError| panic!("{error}"));
        assert!(case.pipelines.unwrap().is_file());
        assert!(
            case.mesh.extension().is_some_and(|extension| extension == "msh"),
            "scripts/demo makes .msh files"
        );
    }
    for file in files("pipelines") {
        tombolo_pipelines::language::parse(
            &std::fs::read_to_string(&file).unwrap(),
            &file.display().to_string(),
        )
        .unwrap_or_else(|error| panic!("{error}"));
    }
    for file in files("orders") {
        tombolo_pipelines::language::parse_orders(
            &std::fs::read_to_string(&file).unwrap(),
            &file.display().to_string(),
        )
        .unwrap_or_else(|error| panic!("{error}"));
    }
}

/// A uniform stream through a box whose walls let it pass, and pipelines that stop the run at the
/// first step at which it is not one.
#[test]
fn a_uniform_stream_stays_uniform_through_any_schedule() {
    const STREAM: &str = r#"{
      "mesh": "channel.vtu", "density": 1.0, "viscosity": 0.01,
      "boundary": {
        "x-min": { "velocity": [0.9, 0.3, -0.2] }, "x-max": { "pressure": 0 },
        "y-min": { "velocity": [0.9, 0.3, -0.2] }, "y-max": { "velocity": [0.9, 0.3, -0.2] },
        "z-min": { "velocity": [0.9, 0.3, -0.2] }, "z-max": { "velocity": [0.9, 0.3, -0.2] }
      },
      "initial": { "velocity": [0.9, 0.3, -0.2] }, "time_step": 0.05, "steps": 16, "pipelines": "watch.json" }"#;
    const WATCH: &str = r#"{ "version": 1, "pipelines": [
      { "name": "stream", "stages": [ { "statistics": { "field": "velocity" } }, { "statistics": { "field": "pressure" } } ],
        "when": "velocity.min < 0.969535971483 || velocity.max > 0.969535971484 || pressure.min < -1e-10 || pressure.max > 1e-10",
        "then": [ { "stop": {} } ] } ] }"#;
    const EDITS: &str = r#"[ { "translate": { "features": ["y-max"], "fixed": ["y-min"], "by": [0.1, -0.3, 0.05] } },
                             { "scale_direction": { "features": ["x-min"], "fixed": ["y-min"], "factors": [1, 1, 1.3] } } ]"#;
    const FURTHER: &str = r#"[ { "translate": { "features": ["z-max"], "fixed": ["z-min"], "by": [0.2, 0, 0.3] } } ]"#;
    let schedules = [
        r#"{ "steps": 1 }"#,
        r#"{ "steps": 5, "every": { "steps": 2 } }"#,
        r#"{ "steps": 8, "ease": "smooth" }"#,
        r#"{ "steps": 6, "every": { "time": 0.05 } }"#,
        r#"{ "steps": 3, "every": { "time": 0.13 }, "ease": "smooth" }"#,
    ];
    let first = |schedule: &str| {
        format!(
            r#"{{ "at": {{ "cycle": 1 }}, "order": {{ "edits": {EDITS}, "schedule": {schedule} }} }}"#
        )
    };
    let then = |change: &str, schedule: &str| {
        format!(r#"{{ "at": {{ "cycle": 5 }}, "order": {{ {change}, "schedule": {schedule} }} }}"#)
    };
    let mut runs: Vec<(String, usize)> =
        schedules.iter().map(|schedule| (format!("[{}]", first(schedule)), 1)).collect();
    // In the midst of one schedule another begins: more edits, or those of the first taken back.
    for (under_way, next) in
        [(schedules[1], schedules[2]), (schedules[2], schedules[4]), (schedules[4], schedules[0])]
    {
        for change in [format!(r#""edits": {FURTHER}"#), r#""undo": 1"#.to_owned()] {
            runs.push((format!("[{}, {}]", first(under_way), then(&change, next)), 2));
        }
    }
    let (folder, case) = folder(STREAM);
    std::fs::write(folder.path().join("watch.json"), WATCH).unwrap();
    let orders = folder.path().join("orders.json");
    for (text, count) in runs {
        std::fs::write(&orders, &text).unwrap();
        let report = run(&Options {
            orders: Some(orders.clone()),
            out: Some(folder.path().into()),
            history: Some(folder.path().join("history.csv")),
            ..headless(&case)
        });
        assert_eq!(
            (report.cycles, report.error.as_deref()),
            (16, None),
            "not uniform any more: {text}"
        );
        let json = serde_json::to_value(&report.orders).unwrap();
        let orders = json.as_array().unwrap();
        assert!(
            orders.len() == count && orders.iter().all(|order| order["status"] == "applied"),
            "{json:#}"
        );
        let end = files::read_mesh(folder.path().join("final.vtu")).unwrap();
        assert_eq!(report.mesh.inverted, 0);
        let velocity = end.fields.iter().find(|field| field.name == "velocity").unwrap();
        let worst = velocity
            .values
            .chunks(3)
            .flat_map(|u| [u[0] - 0.9, u[1] - 0.3, u[2] + 0.2])
            .fold(0.0, |a: f64, b| a.max(b.abs()));
        assert!(worst < 1e-12, "{worst}: {text}");
        let table = std::fs::read_to_string(folder.path().join("history.csv")).unwrap();
        let lines: Vec<&str> = table.lines().collect();
        assert!(
            lines.len() == 17
                && lines[0].starts_with("cycle,time,pressure_drop,")
                && lines[16].starts_with("16,0.8"),
            "{table}"
        );
    }
}

/// Runs the options on several ranks, which are threads here; gives the report of the first.
fn run_on(ranks: usize, options: &Options) -> Report {
    let reports = threads::run(ranks, |communicator| {
        Run::on(Arc::new(communicator), options).unwrap().finish().unwrap()
    });
    reports.into_iter().next().unwrap()
}

/// How far the fields and coordinates of two files are apart, relative to the largest value of
/// each.
fn difference(a: &Path, b: &Path) -> Vec<(String, f64)> {
    let [a, b] = [a, b].map(|file| files::read_mesh(file).unwrap());
    assert_eq!(a.mesh.cells(), b.mesh.cells());
    let apart = |a: &[f64], b: &[f64]| {
        let largest = a.iter().map(|value| value.abs()).fold(0.0, f64::max);
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
            / largest.max(f64::MIN_POSITIVE)
    };
    let mut apart_by = vec![(
        "coordinates".to_owned(),
        apart(a.mesh.points().as_flattened(), b.mesh.points().as_flattened()),
    )];
    for field in &a.fields {
        let other = b.fields.iter().find(|other| other.name == field.name).unwrap();
        apart_by.push((field.name.clone(), apart(&field.values, &other.values)));
    }
    apart_by
}

#[test]
fn ranks_solve_what_one_process_solves() {
    let (folder, case) = folder(CASE);
    let settings = Settings::default();
    let solves = Settings { impulse_tolerance: settings.pressure_tolerance, ..settings };
    let alone = Options { out: Some(folder.path().join("alone")), solves, ..headless(&case) };
    let expected = run(&alone);
    let dealings = [
        Dealing::default(),
        Dealing { empty_rank: Some(0), ..Dealing::default() },
        Dealing { empty_rank: Some(1), shuffle: Some(7), without_numbers: true },
    ];
    for (ranks, dealing) in [(2, dealings[0]), (3, dealings[1]), (4, dealings[2])] {
        let options = Options { out: Some(folder.path().join("ranks")), dealing, ..alone.clone() };
        let report = run_on(ranks, &options);
        assert_eq!((report.cycles, report.error.as_deref()), (12, None));
        assert_eq!(
            (report.mesh.vertices, report.mesh.cells),
            (expected.mesh.vertices, expected.mesh.cells)
        );
        assert_eq!(
            (report.mesh.inverted, report.mesh.min_scaled_jacobian),
            (0, expected.mesh.min_scaled_jacobian)
        );
        assert_eq!(report.flow.unconverged, 0);
        for (name, apart) in difference(
            &folder.path().join("alone/final.vtu"),
            &folder.path().join("ranks/final.vtu"),
        ) {
            // The solves stop at residuals of 1e-6 and 1e-7; `ranks_solve_the_same_equations` asks
            // for more.
            let tolerance = if name == "coordinates" { 1e-8 } else { 5e-5 };
            assert!(apart <= tolerance, "{ranks} ranks, {dealing:?}: {name} is {apart:e} apart");
        }
        for (name, flux) in &expected.flow.fluxes {
            assert!(
                (flux - report.flow.fluxes[name]).abs() < 1e-6,
                "{name}: {flux} {}",
                report.flow.fluxes[name]
            );
        }
        // Preconditioners that are worse, but not by much.
        let [few, many] = [&expected, &report].map(|report| report.flow.pressure_iterations);
        assert!(many < 3.0 * few + 10.0, "{few} iterations, on {ranks} ranks {many}");
    }
}

/// A state that cannot be saved, and a history that cannot be gone on with, are told; the run goes
/// on.
#[test]
fn a_run_goes_on_where_its_state_cannot_be_saved() {
    let (folder, case) = folder(CASE);
    let at = |name: &str| folder.path().join(name);
    let every = 3.try_into().unwrap();
    let saving = |name: &str| Options { checkpoint: Some((at(name), every)), ..headless(&case) };
    // Folders are made.
    let options = Options { history: Some(at("tables/history.csv")), ..saving("new/flow.state") };
    let report = run(&options);
    assert_eq!((report.cycles, report.error.as_deref()), (12, None));
    assert!(at("new/flow.state").is_file() && at("tables/history.csv").is_file());
    assert!(report.unwritten.is_empty(), "{:?}", report.unwritten);
    // Where they cannot be, that is told before the run.
    let refused = Run::new(&saving("case.json/flow.state")).err().unwrap().to_string();
    assert!(refused.contains("case.json/flow.state"), "{refused}");
    // A folder lies where the state should.
    std::fs::create_dir_all(at("taken/flow.state")).unwrap();
    let options = Options { out: Some(at("out")), ..saving("taken/flow.state") };
    let report = run(&options);
    assert_eq!((report.cycles, report.error.as_deref()), (12, None));
    let [told] = &report.unwritten[..] else { panic!("{:?}", report.unwritten) };
    assert!(told.starts_with("cycle 3: the state") && told.contains("flow.state"), "{told}");
    assert!(at("out/final.vtu").is_file());
}

/// A parameter that would make a boundary value infinite is refused, and the run goes on as before
/// until another comes.
#[test]
fn a_parameter_that_makes_no_flow_is_refused() {
    let divided = CASE
        .replace("y * (1 - y)", "y * (1 - y) / thickness")
        .replace("\"minimum\": 0.1", "\"minimum\": 0")
        .replace("0.01 * thickness", "0.01 + 0 * thickness");
    let (folder, case) = folder(&divided);
    let orders = folder.path().join("orders.json");
    let change = |cycle: u64, value: f64| {
        format!(
            r#"{{ "at": {{ "cycle": {cycle} }}, "parameter": {{ "name": "thickness", "value": {value} }} }}"#
        )
    };
    let flow_in = |orders_text: String, ranks: usize| {
        std::fs::write(&orders, orders_text).unwrap();
        let report = run_on(ranks, &Options { orders: Some(orders.clone()), ..headless(&case) });
        assert_eq!((report.cycles, report.error.as_deref()), (12, None));
        report.flow.mass_in
    };
    let before = flow_in("[]".into(), 1);
    for ranks in [1, 2] {
        let refused = flow_in(format!("[{}]", change(3, 0.0)), ranks);
        assert!((refused - before).abs() < 1e-9 * before, "{refused} {before}");
        let halved = flow_in(format!("[{}, {}]", change(3, 0.0), change(6, 2.0)), ranks);
        assert!((halved - 0.5 * before).abs() < 1e-9 * before, "{halved} {before}");
    }
}

/// A replay has all its orders from the journal.
#[test]
fn a_replay_does_not_read_the_orders_of_the_case() {
    let (folder, case) = folder(&CASE.replace(
        "\"steps\": 12",
        "\"steps\": 12, \"orders\": \"orders.json\", \"pipelines\": \"pipelines.json\"",
    ));
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("orders.json"), ORDERS).unwrap();
    std::fs::write(at("pipelines.json"), r#"{ "version": 1, "journal": "journal.jsonl" }"#)
        .unwrap();
    let applied = |options: Options| {
        let report = run(&options);
        let json = serde_json::to_value(&report.orders).unwrap();
        let orders = json.as_array().unwrap();
        orders.iter().filter(|order| order["status"] == "applied").count()
    };
    assert_eq!(applied(Options { out: Some(at("out")), ..headless(&case) }), 2);
    std::fs::remove_file(at("orders.json")).unwrap();
    let replay = Some(at("out/journal.jsonl"));
    assert_eq!(applied(Options { out: Some(at("again")), replay, ..headless(&case) }), 2);
}

/// A lid drags the fluid along in a box that nothing enters: no flux is lost there.
#[test]
fn a_closed_box_has_no_imbalance() {
    let cavity = CASE
        .replace(r#""velocity": ["y * (1 - y)", 0, 0]"#, r#""wall": "no_slip""#)
        .replace(r#""pressure": 0"#, r#""wall": "no_slip""#)
        .replace(r#""y-max": { "wall": "no_slip" }"#, r#""y-max": { "velocity": [1, 0, 0] }"#);
    let (_folder, case) = folder(&cavity);
    let report = run(&headless(&case));
    assert!(report.flow.max_velocity > 0.5 && report.flow.worst_imbalance < 1e-6);
}

#[test]
fn one_process_cannot_be_left_empty() {
    let (_folder, case) = folder(CASE);
    let dealing = Dealing { empty_rank: Some(0), ..Dealing::default() };
    let refused = Run::new(&Options { dealing, ..headless(&case) }).err().unwrap().to_string();
    assert!(refused.contains("rank 0 cannot be left empty"), "{refused}");
}

/// The table of a run that is killed and restarted is that of one run; until it goes on, nothing of
/// it is lost.
#[test]
fn a_history_goes_on_where_the_run_does() {
    let (folder, case) = folder(CASE);
    let at = |name: &str| folder.path().join(name);
    let saving = Options {
        steps: Some(7),
        checkpoint: Some((at("flow.state"), 5.try_into().unwrap())),
        history: Some(at("history.csv")),
        ..headless(&case)
    };
    run(&saving);
    // A line that a full disk cut, one of a step behind the state, and one that was being written.
    let table = std::fs::read_to_string(at("history.csv")).unwrap();
    std::fs::write(at("history.csv"), format!("{table}3,0.15\n8,0.4,0,0,0,99\n1")).unwrap();
    let torn = std::fs::read_to_string(at("history.csv")).unwrap();
    let further = Options { steps: Some(12), restart: Some(at("flow.state")), ..saving.clone() };
    drop(Run::new(&further).unwrap());
    assert_eq!(std::fs::read_to_string(at("history.csv")).unwrap(), torn);
    run(&further);
    let whole = std::fs::read_to_string(at("history.csv")).unwrap();
    assert!(whole.starts_with(&table), "{whole}");
    let lines: Vec<Vec<f64>> = whole
        .lines()
        .skip(1)
        .map(|line| line.split(',').map(|value| value.parse().unwrap()).collect())
        .collect();
    assert!(lines.iter().zip(1..).all(|(line, cycle)| line[0] == f64::from(cycle)), "{whole}");
    assert!(lines.len() == 12 && lines.is_sorted_by_key(|line| line[5]), "{whole}");
    // Nor is a table lost to a run that does not begin.
    drop(Run::new(&Options { history: Some(at("history.csv")), ..headless(&case) }).unwrap());
    assert_eq!(std::fs::read_to_string(at("history.csv")).unwrap(), whole);
}

#[test]
#[cfg(not(feature = "distributed"))]
fn processes_that_do_not_know_of_each_other_are_refused() {
    let (_folder, case) = folder(CASE);
    let started_by = |name: &str, value: &str| {
        let mut flow = std::process::Command::new(env!("CARGO_BIN_EXE_flow"));
        flow.arg("--case").arg(&case).args(["--headless", "--steps", "1"]);
        for other in ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "SLURM_STEP_NUM_TASKS", "PMIX_RANK"] {
            flow.env_remove(other);
        }
        let output = flow.env(name, value).output().unwrap();
        let told = String::from_utf8_lossy(&output.stderr).contains("started on several ranks");
        assert!(output.status.success() != told, "{output:?}");
        told
    };
    assert!(started_by("PMIX_RANK", "1") && started_by("SLURM_STEP_NUM_TASKS", "2"));
    assert!(!started_by("PMIX_RANK", "0") && !started_by("OMPI_COMM_WORLD_SIZE", "1"));
}

#[test]
fn the_state_at_the_end_is_saved_too() {
    let (folder, case) = folder(CASE);
    let state = folder.path().join("flow.state");
    let saving = Options {
        steps: Some(7),
        checkpoint: Some((state.clone(), 3.try_into().unwrap())),
        ..headless(&case)
    };
    assert_eq!(run(&saving).cycles, 7);
    // As many steps have been done before this one begins.
    let again = Options { steps: Some(1), restart: Some(state.clone()), ..headless(&case) };
    let report = run(&again);
    assert_eq!((report.cycles, report.error.as_deref()), (7, None));
    let mut flow = std::process::Command::new(env!("CARGO_BIN_EXE_flow"));
    flow.arg("--case").arg(&case).args(["--headless", "--steps", "1", "--restart"]).arg(&state);
    let output = flow.output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    assert!(said.contains("the state is at cycle 7: 1 steps leave nothing to do"), "{said}");
    // Among the coordinates.
    let mut damaged = std::fs::read(&state).unwrap();
    damaged[1000] ^= 4;
    std::fs::write(&state, damaged).unwrap();
    let refused = Run::new(&again).err().unwrap().to_string();
    assert!(refused.contains("flow.state") && refused.contains("damaged"), "{refused}");
}

#[test]
fn the_file_of_the_report_is_made_with_its_folder_or_refused_by_all() {
    let folder = tempfile::tempdir().unwrap();
    let report = folder.path().join("new/report.json");
    let make = |file: &Path| -> Vec<Option<String>> {
        threads::run(2, |ranks| make_file(&ranks, file).err().map(|error| error.to_string()))
    };
    assert_eq!(make(&report), [None, None]);
    // What a run before has left stays where the next one does not begin, and is not taken for the
    // report of one that comes to no end.
    std::fs::write(&report, "{}").unwrap();
    assert_eq!(make(&report), [None, None]);
    assert_eq!(std::fs::read_to_string(&report).unwrap(), "{}");
    let emptied = threads::run(2, |ranks| empty_file(&ranks, &report).is_ok());
    assert_eq!(emptied, [true, true]);
    assert_eq!(std::fs::read_to_string(&report).unwrap(), "");
    let refused = make(&report.join("report.json"));
    assert!(
        refused[0] == refused[1]
            && refused[0].as_ref().is_some_and(|it| it.contains("report.json/report.json")),
        "{refused:?}"
    );
}

#[test]
fn ranks_fail_together() {
    let diverging = CASE.replace("\"y * (1 - y)\"", "\"1 / max(0, 0.22 - t)\"");
    let (_folder, case) = folder(&diverging);
    let reports = threads::run(3, |communicator| {
        Run::on(Arc::new(communicator), &headless(&case))
            .unwrap()
            .finish()
            .map(|report| report.error)
    });
    let errors: Vec<String> = reports.into_iter().map(|report| report.unwrap().unwrap()).collect();
    assert!(errors.iter().all(|error| *error == errors[0]), "{errors:?}");
    assert!(
        errors[0].starts_with("rank ") && errors[0].contains("cycle 5, time 0.25"),
        "{}",
        errors[0]
    );
    let refused = threads::run(3, |communicator| {
        let dealing = Dealing { empty_rank: Some(3), ..Dealing::default() };
        Run::on(Arc::new(communicator), &Options { dealing, ..headless(&case) })
            .err()
            .map(|error| error.to_string())
    });
    assert!(refused.iter().all(|error| {
        error.as_ref().is_some_and(|text| text.contains("rank 3 cannot be left empty"))
    }));
}
