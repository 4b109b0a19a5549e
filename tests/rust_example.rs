//! The example in Rust, run as a newcomer runs it.

use std::path::Path;
use std::process::Command;

use serde_json::{Value, json};
use tombolo_tests::{programs, succeed};

/// The regions at the top and at the floor of the box.
fn ends() -> [Value; 2] {
    [(0.99, 1), (0.01, -1)]
        .map(|(z, up)| json!({"half_space": {"origin": [0, 0, z], "normal": [0, 0, up]}}))
}

/// The output of the example, run in a folder for so many steps.
fn heat(folder: &Path, pipelines: &Value, steps: &str) -> String {
    let config = json!({"version": 1, "steering": {"background": false}, "pipelines": pipelines});
    std::fs::write(folder.join("pipelines.json"), config.to_string()).expect("a file");
    let mut program = Command::new(programs().join("examples/heat"));
    succeed(program.current_dir(folder).args(["pipelines.json", steps]))
}

/// The box is pressed flat while it is heated: what is written holds the shape and the heat, both
/// in closed form.
#[test]
fn the_box_is_heated_and_pressed() {
    let folder = tempfile::tempdir().expect("a folder");
    let [above, below] = ends();
    let pipelines = json!([
        {"name": "solid", "every": {"steps": 4}, "stages": [{"write": {"file": "solid-{cycle:1}.vtu"}}]},
        {"name": "press", "at": {"cycle": 2}, "stages": [
            {"translate": {"region": above, "fixed_region": below, "by": [0, 0, -0.2]}}, {"order": {}}]}]);
    let told = heat(folder.path(), &pipelines, "9");
    // Nine steps of a thousandth, in which the cold of the floor comes no further than to the
    // middle.
    assert_eq!(told, "1 orders, warmest 0.009000\n");
    for (cycle, height) in [(0, 1.0), (4, 0.8), (8, 0.8)] {
        let file = folder.path().join(format!("solid-{cycle}.vtu"));
        let written = tombolo::pipelines::files::read_mesh(&file).expect("was written");
        let (points, cells) = (written.mesh.points(), written.mesh.cells().len());
        assert_eq!((points.len(), cells), (13 * 13 * 13, 6 * 12 * 12 * 12));
        let highest = points.iter().map(|point| point[2]).fold(0.0, f64::max);
        assert!((highest - height).abs() < 1e-12, "cycle {cycle}: {highest}");
        let temperature = &written.fields[0].values;
        for (point, &value) in points.iter().zip(temperature) {
            let expected = match point[2] / height {
                z if z < 1e-9 => 0.0..1e-12,
                z if z > 0.9 => {
                    0.999_999e-3 * f64::from(cycle)..1.000_001e-3 * f64::from(cycle) + 1e-12
                }
                _ => 0.0..1.000_001e-3 * f64::from(cycle) + 1e-12,
            };
            assert!(expected.contains(&value), "cycle {cycle}, {point:?}: {value}");
        }
    }
}

/// A box that is pressed to half of its height needs shorter steps, and takes them.
#[test]
fn a_box_that_is_pressed_flat_stays_finite() {
    let folder = tempfile::tempdir().expect("a folder");
    let [above, below] = ends();
    let pipelines = json!([
        {"name": "press", "at": {"cycle": 2}, "stages": [
            {"translate": {"region": above, "fixed_region": below, "by": [0, 0, -0.5]}},
            {"order": {"schedule": {"steps": 20}}}]}]);
    let told = heat(folder.path(), &pipelines, "600");
    let warmest = told.trim().strip_prefix("1 orders, warmest ").and_then(|it| it.parse().ok());
    // Heated at 1, cold below and insulated above: half of the square of the height in the end.
    assert!(warmest.is_some_and(|warmest: f64| (warmest - 0.125).abs() < 2e-3), "{told}");
}
