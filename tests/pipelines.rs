//! The files of `docs/pipelines` do what they say, on a small nozzle.

use std::collections::BTreeMap;
use std::fs::{read_dir, read_to_string};

use serde_json::{Value, json};
use tombolo_tests::{PATIENCE, Run, Small, gallery, generated_mesh, project};

/// Runs `flow` for some steps with a file of `docs/pipelines`; its report, and what it said.
fn run(file: &str, steps: u32) -> (Small, Value, String) {
    let small = Small::new();
    let mut case = small.read("case.json");
    case["parameters"] = json!({"inlet_velocity": {"value": 1.0, "minimum": 0.0, "maximum": 2.0}});
    case["boundary"]["inlet"] = json!({"velocity": [0, "inlet_velocity", 0]});
    small.write("case.json", &case);
    let pipelines = project().join("docs/pipelines").join(file).display().to_string();
    let steps = steps.to_string();
    let more =
        ["--pipelines", &pipelines, "--headless", "--steps", &steps, "--history", "@history.csv"];
    let (report, text) = small.run(&more);
    (small, report, text)
}

/// The monitors of a report that were measured, by pipeline and name.
fn monitors(report: &Value) -> BTreeMap<String, f64> {
    let mut all = BTreeMap::new();
    for pipeline in report["pipelines"].as_array().expect("a list") {
        for monitor in pipeline["monitors"].as_array().expect("a list") {
            let name = format!("{}/{}", pipeline["name"], monitor["name"]).replace('"', "");
            all.extend(monitor["last"].as_f64().map(|value| (name, value)));
        }
    }
    all
}

/// The columns of a table by their titles.
fn table(text: &str) -> BTreeMap<String, Vec<f64>> {
    let mut lines = text.lines();
    let titles: Vec<&str> = lines.next().expect("a first line").split(',').collect();
    let rows: Vec<Vec<f64>> = lines
        .map(|line| line.split(',').map(|cell| cell.parse().expect("a number")).collect())
        .collect();
    let column = |index: usize| rows.iter().map(|row: &Vec<f64>| row[index]).collect();
    titles.iter().enumerate().map(|(index, title)| ((*title).to_owned(), column(index))).collect()
}

#[test]
fn every_file_runs_without_a_complaint() {
    let mut count = 0;
    for entry in read_dir(project().join("docs/pipelines")).expect("the folder is there") {
        let path = entry.expect("the folder can be read").path();
        if path.extension().is_none_or(|extension| extension != "json") {
            continue;
        }
        let file = path.file_name().expect("a file").to_string_lossy().into_owned();
        let (_, report, text) = run(&file, 21);
        for wrong in ["no field", "could not", "not finite", "unknown", "has no"] {
            assert!(!text.contains(wrong), "{file}: {text}");
        }
        let config: Value =
            serde_json::from_str(&read_to_string(&path).expect("a text")).expect("JSON");
        assert!(config["description"].is_string(), "{file}");
        for (pipeline, cost) in config["pipelines"]
            .as_array()
            .expect("a list")
            .iter()
            .zip(report["pipelines"].as_array().expect("a list"))
        {
            assert_eq!(pipeline["name"], cost["name"], "{file}");
            let waits = pipeline["on"].as_str().is_some_and(|event| event != "end");
            assert_eq!(cost["runs"].as_u64().unwrap_or(0) == 0, waits, "{file}: {cost}");
        }
        count += 1;
    }
    assert!(count >= 5, "{count} files");
}

#[test]
fn the_pressure_drop_is_that_of_the_solver() {
    let (small, report, text) = run("pressure-drop.json", 21);
    let rows = table(&read_to_string(small.path("out/pressure-drop.csv")).expect("a table"));
    let drops = &rows["drop [Pa]"];
    assert_eq!(rows["cycle"], (0..21).map(f64::from).collect::<Vec<_>>());
    // A row shows the state before its step, the solver's own line that after it.
    let history = table(&read_to_string(small.path("history.csv")).expect("a table"));
    let (_, own) = history.iter().find(|(title, _)| title.contains("drop")).expect("the drop");
    for (cycle, (found, expected)) in drops[1..].iter().zip(own).enumerate() {
        let difference = (found - expected).abs();
        assert!(difference < 1e-9 * expected.abs().max(1.0), "{cycle}: {found}, not {expected}");
    }
    let monitors = monitors(&report);
    let trapezoids: f64 = drops.windows(2).map(|pair| (pair[0] + pair[1]) / 2.0).sum();
    assert!((monitors["ends/whole.mean"] - trapezoids / 20.0).abs() < 1e-9 * trapezoids.abs());
    let volume: f64 = (0..8).map(|bin| monitors[&format!("spread/speed.bins.{bin}")]).sum();
    assert!(volume > 0.0 && text.contains("the pressure drop was"), "{text}");
    // Of three files two stay, and the series shows them.
    let mean = |cycle: u32| small.path(&format!("out/mean-flow-{cycle:06}.vtu"));
    assert!(!mean(0).exists() && mean(10).exists() && mean(20).exists());
    let series = read_to_string(small.path("out/mean-flow.pvd")).expect("a series");
    assert!(
        series.matches("<DataSet ").count() == 2 && !series.contains("mean-flow-000000"),
        "{series}"
    );
}

#[test]
fn forces_and_triggers_are_seen_outside() {
    let (small, report, _) = run("forces-on-a-wing.json", 21);
    let rows = table(&read_to_string(small.path("out/forces.csv")).expect("a table"));
    assert_eq!(rows["force.y [N]"].len(), 21);
    assert!(rows["force.viscous.y [N]"][20] > 0.0, "the flow drags the wall along");
    assert!(rows["shedding.frequency"][14].is_nan() && rows["shedding.frequency"][15] > 0.0);
    assert!(monitors(&report)["wing/force.size"] > 0.0);
    assert!(small.path("out/shear-000020.vtp").exists());

    let (_, report, text) = run("relieve-pressure.json", 21);
    assert!(text.contains("it is slowed down at"), "{text}");
    assert!(report["pipelines"][1]["runs"].as_u64() == Some(21));

    let (small, _, _) = run("stop-on-divergence.json", 21);
    let there = (0..21).filter(|cycle| small.path(&format!("out/state-{cycle:06}.vtu")).exists());
    assert_eq!(there.collect::<Vec<_>>(), [10, 15, 20]);
}

#[test]
fn the_pictures_for_a_paper_are_drawn() {
    let _ = generated_mesh("channel-60k");
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().display().to_string();
    let files = ["examples/flow/cases/nozzle.json", "docs/pipelines/pictures-for-a-paper.json"]
        .map(|file| project().join(file).display().to_string());
    let arguments = ["--case", &files[0], "--pipelines", &files[1], "--out", &out];
    let (status, text) =
        Run::flow(&[&arguments[..], &["--headless", "--steps", "61"]].concat()).finish(PATIENCE);
    assert!(status.success(), "{text}");
    for (drawn, shown) in
        [("arrows", "nozzle.png"), ("cut", "nozzle-cut.png"), ("wall", "nozzle-wall.png")]
    {
        std::fs::copy(folder.path().join(format!("{drawn}-000060.png")), gallery(shown))
            .expect("drawn");
    }
}
