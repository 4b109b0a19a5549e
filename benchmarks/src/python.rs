//! What the adaptor costs a solver in Python at steps at which nothing is due, the memory that lending
//! a mesh takes, and how many frames a second a client in Python gets, beside Rerun.

use std::error::Error;
use std::fs;
use std::path::Path;

use serde::{Deserialize, Serialize};
use tombolo_tests::{project, target};

use crate::peer;
use crate::report::{Line, Report, Target};
use crate::stream;

/// Cubes along an edge, each of six tetrahedra: 1 296 000 of them, and a hundredth of that.
const SIZES: [u32; 2] = [60, 13];
const CALLS: u32 = 20_000;
const NEVER: u64 = 1_000_000_000_000;

/// A line of the table.
#[derive(Serialize)]
#[serde(untagged)]
pub enum Row {
    /// A mesh that is shown at steps at which nothing is due.
    Lent(Lent),
    /// A surface that changes at each step, streamed to a client.
    Streamed(stream::Row),
}

/// A mesh that is shown at steps at which nothing is due.
#[derive(Serialize)]
pub struct Lent {
    case: &'static str,
    #[serde(flatten)]
    measured: Measured,
}

/// The figures that the program prints.
#[derive(Clone, Copy, Serialize, Deserialize)]
struct Measured {
    tets: u64,
    /// The median and the 95th percentile of a call.
    seconds: f64,
    p95: f64,
    /// Bytes of memory since before the adaptor was made, after its first call; and how far they rose.
    added_bytes: i64,
    peak_bytes: i64,
    /// Bytes of the solver's own arrays.
    mesh_bytes: u64,
}

/// Runs the benchmark on the package that `scripts/python --release` compiles; some three minutes.
///
/// # Errors
/// The first error of building and running; a peer that is missing is an error.
pub fn run() -> Result<Report<Row>, Box<dyn Error>> {
    peer::run(std::process::Command::new(project().join("scripts/python")).arg("--release"))?;
    let directory = target().join("benchmark-python");
    fs::create_dir_all(&directory)?;
    let pipeline = format!(
        r#""pipelines": [{{"name": "q", "at": {{"cycle": {NEVER}}}, "stages": [{{"quality": {{}}}}]}}]"#
    );
    let mut rows = Vec::new();
    for (case, config) in [
        ("nobody watches", format!(r#"{{"version": 1, {pipeline}}}"#)),
        (
            "a server for viewers",
            format!(r#"{{"version": 1, "stream": {{"listen": "127.0.0.1:0"}}, {pipeline}}}"#),
        ),
    ] {
        let file = directory.join("pipelines.json");
        fs::write(&file, config)?;
        for size in SIZES {
            rows.push(Lent { case, measured: measure(&file, size)? });
        }
    }
    let slowest = rows.iter().map(|row| row.measured.seconds).fold(0.0, f64::max);
    let [lent, kept] = match rows.as_slice() {
        [large, small, watched_large, watched_small] => {
            let growth = |of: &Lent, than: &Lent| {
                (of.measured.added_bytes - than.measured.added_bytes) as f64
            };
            let mesh = large.measured.mesh_bytes as f64;
            [growth(large, small), growth(watched_large, watched_small) / mesh]
        }
        _ => [f64::NAN; 2],
    };
    let streamed = stream::without_pause()?;
    let mut targets = vec![
        Target::at_most("execute from Python with nothing due [s]", slowest, 5e-6),
        // The least of the mesh's arrays has 1.8 MB: it would be seen, were it copied.
        Target::at_most("bytes more that lending 1 296 000 tets takes than 13 182", lent, 1e6),
        Target::at_most("the reference that a server keeps for orders [meshes]", kept, 2.0),
    ];
    targets.extend(stream::targets(&streamed));
    let lent = rows.into_iter().map(Row::Lent);
    Ok(Report { rows: lent.chain(streamed.into_iter().map(Row::Streamed)).collect(), targets })
}

fn measure(config: &Path, size: u32) -> Result<Measured, Box<dyn Error>> {
    let mut command = peer::python();
    command.arg(project().join("benchmarks/peers/python.py"));
    command.args([size.to_string(), CALLS.to_string()]).arg(config);
    Ok(serde_json::from_str(&peer::run(&mut command)?)?)
}

impl Line for Row {
    const HEADINGS: &'static [&'static str] = &[
        "case",
        "cells",
        "call [s]",
        "p95 [s]",
        "added [MB]",
        "peak [MB]",
        "own mesh [MB]",
        "frames/s",
    ];

    fn cells(&self) -> Vec<String> {
        let megabytes = |bytes: f64| format!("{:.1}", bytes / 1e6);
        match self {
            Row::Lent(Lent { case, measured }) => {
                let Measured { tets, seconds, p95, added_bytes, peak_bytes, mesh_bytes } = measured;
                vec![
                    (*case).to_owned(),
                    tets.to_string(),
                    format!("{seconds:.2e}"),
                    format!("{p95:.2e}"),
                    megabytes(*added_bytes as f64),
                    megabytes(*peak_bytes as f64),
                    megabytes(*mesh_bytes as f64),
                    String::new(),
                ]
            }
            Row::Streamed(row) => {
                let (peer, triangles, seconds, frames) = row.throughput();
                let mut cells = vec![format!("streamed by {peer}"), triangles.to_string()];
                cells.push(format!("{seconds:.2e}"));
                cells.resize(Self::HEADINGS.len() - 1, String::new());
                cells.push(format!("{frames:.1}"));
                cells
            }
        }
    }
}
