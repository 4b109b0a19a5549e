//! The files that pipelines write: which of them stay, the series that name them, and what a restart
//! finds again.

mod common;

use std::{fs::read_to_string, path::Path};

use common::{Solver, config};
use tombolo::Settings;

fn settings(pipelines: &str, folder: &Path) -> Settings {
    let text = format!(r#"{{"version": 1, "pipelines": {pipelines}}}"#);
    Settings { config: config(&text), output: folder.into(), ..Settings::default() }
}

fn run(pipelines: &str, steps: u64, folder: &Path) {
    let mut solver = Solver::new(settings(pipelines, folder));
    solver.steps(steps);
    solver.finish();
}

/// The names in a folder that begin so, in their order.
fn there(folder: &Path, begin: &str) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let names = entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned());
    let mut names: Vec<String> = names.filter(|name| name.starts_with(begin)).collect();
    names.sort();
    names
}

/// The files that a series names, which are all there.
fn named(series: &Path) -> Vec<String> {
    let text = read_to_string(series).unwrap_or_else(|_| panic!("{}", series.display()));
    let entries = text.split("file=\"").skip(1);
    let names: Vec<String> =
        entries.map(|rest| rest.split('"').next().unwrap_or_default().to_owned()).collect();
    for name in &names {
        assert!(series.with_file_name(name).is_file(), "{name} is not there: {text}");
    }
    names
}

#[test]
fn stages_of_one_pipeline_keep_their_own_files() {
    let folder = tempfile::tempdir().unwrap();
    let same = r#"[{"name": "two", "stages": [{"surface": {}},
        {"write": {"file": "newest-a.vtp", "keep": 2}}, {"write": {"file": "newest-b.vtp", "keep": 2}}]}]"#;
    run(same, 8, folder.path());
    assert_eq!(there(folder.path(), ""), ["newest-a.vtp", "newest-b.vtp"]);

    let folder = tempfile::tempdir().unwrap();
    let alerts = r#"[{"name": "mix", "stages": [{"surface": {}}, {"statistics": {"field": "speed"}},
        {"write": {"file": "mix-{cycle}.vtp", "keep": 2}}], "when": "speed.max > 1",
        "again_after": {"steps": 2}, "then": [{"write": {"file": "alert-{cycle}.vtp"}}]}]"#;
    run(alerts, 8, folder.path());
    let kept = there(folder.path(), "mix-0");
    assert_eq!(kept, ["mix-000006.vtp", "mix-000007.vtp"]);
    assert_eq!(named(&folder.path().join("mix.pvd")), kept);
    let alerts = there(folder.path(), "alert");
    assert!(alerts.len() > 2, "{alerts:?}");
    assert_eq!(named(&folder.path().join("mix-2.pvd")), alerts);
}

#[test]
fn a_series_lies_above_the_folders_of_its_files() {
    let folder = tempfile::tempdir().unwrap();
    let pipelines = r#"[
        {"name": "di/rs", "stages": [{"surface": {}}, {"write": {"file": "out/{cycle}/wall.vtp", "keep": 2}}]},
        {"name": "di_rs", "stages": [{"surface": {}}, {"write": {"file": "out/{cycle}.vtp"}}]}]"#;
    run(pipelines, 4, folder.path());
    let out = folder.path().join("out");
    let files = ["000000.vtp", "000001.vtp", "000002.vtp", "000003.vtp"];
    let mut all = [&["000002", "000003"][..], &files[..], &["di_rs.pvd", "di_rs_.pvd"]].concat();
    all.sort_unstable();
    assert_eq!(there(&out, ""), all, "folders that are left empty go with their files");
    assert_eq!(named(&out.join("di_rs.pvd")), ["000002/wall.vtp", "000003/wall.vtp"]);
    assert_eq!(named(&out.join("di_rs_.pvd")), files);
}

#[test]
fn a_series_names_a_file_once_that_is_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let pipelines = r#"[{"name": "coarse", "stages": [{"surface": {}}, {"write": {"file": "rep-{time:1}.vtp"}}]},
        {"name": "kept", "stages": [{"surface": {}}, {"write": {"file": "few-{time:1}.vtp", "keep": 9}}]}]"#;
    run(pipelines, 13, folder.path());
    assert_eq!(named(&folder.path().join("coarse.pvd")), ["rep-0.0.vtp", "rep-0.1.vtp"]);
    assert_eq!(named(&folder.path().join("kept.pvd")), ["few-0.0.vtp", "few-0.1.vtp"]);
    let text = read_to_string(folder.path().join("coarse.pvd")).unwrap();
    assert!(text.contains("timestep=\"0.12\""), "the time is that of the newest: {text}");
}

/// A run that is killed behind a checkpoint and restarted does not write them again.
#[test]
fn a_checkpoint_waits_for_the_files_and_rows_of_its_steps() {
    let folder = tempfile::tempdir().unwrap();
    let pipelines = r#"[{"name": "whole", "stages": [{"write": {"file": "{cycle:1}.vtu"}}]},
        {"name": "health", "stages": [{"quality": {}}, {"csv": {"file": "health.csv"}}]}]"#;
    let mut solver = Solver::of_box([16, 16, 16], settings(pipelines, folder.path()));
    for cycle in 0..8 {
        solver.step();
        let _ = solver.adaptor.checkpoint();
        assert!(folder.path().join(format!("{cycle}.vtu")).exists(), "{cycle}");
        let rows = read_to_string(folder.path().join("health.csv")).unwrap();
        assert!(rows.lines().last().unwrap().starts_with(&format!("{cycle},")), "{rows}");
    }
    solver.finish();
}

#[test]
fn a_restart_goes_on_with_series_and_databases() {
    let folder = tempfile::tempdir().unwrap();
    let pipelines = r#"[
        {"name": "kept", "stages": [{"surface": {}}, {"write": {"file": "kept-{cycle}.vtp", "keep": 2}}]},
        {"name": "rare", "every": {"steps": 4}, "stages": [{"surface": {}}, {"write": {"file": "rare-{cycle}.vtp", "keep": 1}}]},
        {"name": "all", "stages": [{"surface": {}}, {"write": {"file": "all-{cycle}.vtp"}},
            {"render": {"file": "all.cdb", "width": 20, "height": 20}}]}]"#;
    let mut solver = Solver::new(settings(pipelines, folder.path()));
    solver.steps(4);
    let checkpoint = solver.adaptor.checkpoint();
    let mesh = solver.mesh.clone();
    // What it wrote before it was killed is undone.
    solver.steps(3);
    solver.finish();
    let mut again = Solver::new(settings(pipelines, folder.path()).restart(checkpoint));
    (again.mesh, again.cycle) = (mesh, 4);
    again.steps(2);
    again.finish();
    let kept = ["kept-000004.vtp", "kept-000005.vtp"];
    assert_eq!(there(folder.path(), "kept-"), kept);
    assert_eq!(named(&folder.path().join("kept.pvd")), kept);
    assert_eq!(there(folder.path(), "rare-"), ["rare-000004.vtp"]);
    let all: Vec<String> = (0..6).map(|cycle| format!("all-{cycle:06}.vtp")).collect();
    assert_eq!(named(&folder.path().join("all.pvd")), all);
    let table = read_to_string(folder.path().join("all.cdb/data.csv")).unwrap();
    let cycles: Vec<_> = table.lines().skip(1).map(|row| row.split(',').nth(1)).collect();
    assert_eq!(cycles, ["0", "1", "2", "3", "4", "5"].map(Some));
    // A run that goes on from nothing begins anew.
    run(pipelines, 1, folder.path());
    assert_eq!(named(&folder.path().join("all.pvd")), ["all-000000.vtp"]);
}
