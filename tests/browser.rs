//! The demo in a headless browser: frames change, the throat is pinched, the order is reported
//! applied, undo brings it back.

use std::path::Path;
use std::process::Command;

use tombolo_tests::{Run, project};

#[test]
fn the_demo_in_a_browser() {
    let mesh = project().join("meshes/channel-60k.msh");
    if !mesh.exists() {
        let made = Command::new(project().join(".venv/bin/python"))
            .current_dir(project())
            .args(["scripts/meshes", "channel-60k"])
            .status()
            .expect("gmsh is installed (scripts/setup)");
        assert!(made.success() && Path::new(&mesh).exists(), "scripts/meshes made no mesh");
    }
    let mut run =
        Run::flow(&["--case", "examples/flow/cases/nozzle.json", "--listen", "127.0.0.1:0"]);
    let link = run.link();
    let output = Command::new("node")
        .current_dir(project())
        .env("TOMBOLO_URL", link.url())
        .arg("tests/browser/demo.mjs")
        .output()
        .expect("node is installed (scripts/setup)");
    assert!(
        output.status.success(),
        "{}\n{}\nflow said:\n{}",
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr),
        run.text()
    );
    assert!(run.is_running(), "the run ended:\n{}", run.text());
}
