//! `viewer`: the viewer in Debian's Chromium, whose WebGL a processor draws, watching a run of `flow`
//! of the lowest priority.

use std::error::Error;
use std::fs;
use std::path::Path;
use std::process::Command;

use serde::{Deserialize, de::DeserializeOwned};
use serde_json::json;
use tombolo_tests::{Run, project};

use crate::peer::{self, mesh_file};
use crate::report::{Report, Row, Target};

/// The script that measures all but what half an hour takes.
const SCRIPT: &str = "viewer.mjs";

/// Slices of the channel of 60 000 tetrahedra that have 200 000 triangles together.
const PLANES: usize = 32;

/// The figures that `benchmarks/browser/viewer.mjs` prints, of one run: seconds, or bytes.
#[derive(Deserialize)]
struct Seen {
    triangles: usize,
    first_picture: f64,
    wire: f64,
    shown: Spread,
    rotating: Spread,
    frames_with_values: f64,
    rotating_by_mouse: Spread,
    longest_task: f64,
    first_preview: Option<f64>,
    dragging: Option<Spread>,
    heap_growth: f64,
}

/// The median and the 95th percentile.
#[derive(Deserialize)]
struct Spread {
    median: f64,
    late: f64,
}

/// Measures the demo, a view with ten times as many triangles, and a mesh of 480 000 cells.
pub fn run() -> Result<Report, Box<dyn Error>> {
    mesh_file("channel-60k")?;
    mesh_file("bypass-3")?;
    built()?;
    let directory = tempfile::tempdir()?;
    let demo: Seen = watched("nozzle", None, SCRIPT)?;
    let many = directory.path().join("many.json");
    fs::write(&many, many_triangles().to_string())?;
    let many: Seen = watched("nozzle", Some(&many), SCRIPT)?;
    let large: Seen = watched("bypass-3", None, SCRIPT)?;

    let mut rows = Vec::new();
    for (seen, what) in [(&demo, "demo"), (&many, "slices"), (&large, "bypass of 481 545 cells")] {
        let name = |measured: &str| format!("{what}, {} triangles: {measured}", seen.triangles);
        rows.push(Row::new(name("page to first picture"), seen.first_picture));
        rows.push(Row::new(name("frame arrived, decoded and shown"), seen.shown.median));
        rows.push(Row::new(name("the same, 95th percentile"), seen.shown.late));
        rows.push(Row::new(name("frame, rotating while streaming"), seen.rotating.median));
        rows.push(Row::new(name("the same, 95th percentile"), seen.rotating.late));
        rows.push(Row::new(name("streamed frames in one of these"), seen.frames_with_values));
        rows.push(Row::new(name("frame, rotating by mouse"), seen.rotating_by_mouse.median));
        rows.push(Row::new(name("the same, 95th percentile"), seen.rotating_by_mouse.late));
        rows.push(Row::new(name("longest task while streaming"), seen.longest_task));
        if let Some(first) = seen.first_preview {
            rows.push(Row::new(name("first preview"), first));
        }
        if let Some(dragging) = &seen.dragging {
            rows.push(Row::new(name("drag to picture"), dragging.median));
            rows.push(Row::new(name("the same, 95th percentile"), dragging.late));
        }
    }
    let dragging = demo.dragging.as_ref().ok_or("nothing was dragged")?;
    let targets = vec![
        Target::at_most("22 k, frame, rotating while streaming [s]", demo.rotating.median, 0.025),
        Target::at_most("200 k, frame, rotating while streaming [s]", many.rotating.median, 0.06),
        Target::at_most("200 k, frame arrived, decoded and shown [s]", many.shown.median, 0.1),
        Target::at_most("22 k, longest task while streaming [s]", demo.longest_task, 0.05),
        Target::at_most("200 k, longest task while streaming [s]", many.longest_task, 0.05),
        Target::at_most("page to first picture [s]", demo.first_picture, 0.6),
        Target::at_most("480 k cells, page to first picture [s]", large.first_picture, 1.0),
        Target::at_most("first load on the wire [bytes]", demo.wire, 0.7e6),
        Target::at_most(
            "first preview [s]",
            demo.first_preview.ok_or("there was no preview")?,
            0.3,
        ),
        Target::at_most("drag to picture [s]", dragging.median, 0.035),
        Target::at_most("drag to picture, 95th percentile [s]", dragging.late, 0.06),
        Target::at_most("heap grown in half a minute of streaming [bytes]", demo.heap_growth, 2e6),
    ];
    Ok(Report { rows, targets })
}

/// Builds `flow` as it is measured.
pub(crate) fn built() -> Result<(), Box<dyn Error>> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let release = ["build", "--release", "--quiet", "-p", "tombolo-flow"];
    peer::run(Command::new(cargo).current_dir(project()).args(release))?;
    Ok(())
}

/// Watches a run of a case of `flow`, with its own pipelines or others, by a script of `benchmarks/browser`.
pub(crate) fn watched<Seen: DeserializeOwned>(
    case: &str,
    pipelines: Option<&Path>,
    script: &str,
) -> Result<Seen, Box<dyn Error>> {
    let output = tempfile::tempdir()?;
    // It stands for another machine: what it computes is not to be taken from the browser.
    let mut flow = Command::new("nice");
    flow.current_dir(project())
        .args(["-n", "19"])
        .arg(project().join("target/release/flow"))
        .args(["--listen", "127.0.0.1:0", "--out"])
        .arg(output.path())
        .arg("--case")
        .arg(format!("examples/flow/cases/{case}.json"));
    if let Some(pipelines) = pipelines {
        flow.arg("--pipelines").arg(pipelines);
    }
    let mut run = Run::start(&mut flow);
    let link = run.link();
    let printed = peer::run(
        Command::new("node")
            .current_dir(project())
            .env("TOMBOLO_URL", link.url())
            .arg(Path::new("benchmarks/browser").join(script)),
    )?;
    Ok(serde_json::from_str(&printed)?)
}

/// Slices along the channel, as one view.
fn many_triangles() -> serde_json::Value {
    let planes: Vec<_> = (0..PLANES)
        .map(|plane| {
            let height = -0.045 + 0.09 * plane as f64 / (PLANES - 1) as f64;
            json!({"origin": [0, 0, height], "normal": [0, 0, 1]})
        })
        .collect();
    json!({"version": 1, "stream": {"listen": "127.0.0.1:0"}, "pipelines": [
        {"name": "slices", "every": {"steps": 5}, "stages": [
            {"slice": {"planes": planes}}, {"select": {"fields": ["velocity"]}},
            {"stream": {"error": {"relative": 1e-3}}}]}]})
}
