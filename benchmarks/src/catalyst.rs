//! What an attached Catalyst implementation costs a solver at the steps at which nothing is due: a
//! program in C, a channel of tetrahedra, `catalyst_execute`.

use std::error::Error;
use std::fs;
use std::path::Path;
use std::process::Command;

use serde::{Deserialize, Serialize};
use tombolo_tests::{project, target};

use crate::peer;
use crate::report::{Line, Report, Target};

/// Cubes along an edge, each of six tetrahedra: 1 296 000 of them, and a hundredth of that.
const SIZES: [u32; 2] = [60, 13];
const CALLS: u32 = 20_000;
const NEVER: u64 = 1_000_000_000_000;

/// A channel that is shown at a step at which nothing is due.
#[derive(Serialize)]
pub struct Row {
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
    /// Bytes that a call allocates at most.
    allocated: u64,
    /// Bytes of memory since before `catalyst_initialize`.
    added_bytes: i64,
    /// Bytes of the solver's own arrays.
    mesh_bytes: u64,
}

/// Runs the benchmark.
///
/// # Errors
/// The first error of building and running.
pub fn run() -> Result<Report<Row>, Box<dyn Error>> {
    let directory = target().join("benchmark-catalyst");
    let prefix = directory.join("prefix");
    fs::create_dir_all(&directory)?;
    peer::run(Command::new(project().join("scripts/install-catalyst")).arg(&prefix))?;
    let program = directory.join("catalyst");
    let mut compile = Command::new("cc");
    compile.args(["-O2", "-o"]).arg(&program).arg(project().join("benchmarks/peers/catalyst.c"));
    compile.arg(format!("-I{}", prefix.join("include/catalyst-2.0").display()));
    compile.arg(format!("-L{0}", prefix.join("lib").display()));
    compile.arg(format!("-Wl,-rpath,{}", prefix.join("lib").display())).arg("-lcatalyst");
    peer::run(&mut compile)?;

    let pipeline = format!(
        r#""pipelines": [{{"name": "surface", "at": {{"cycle": {NEVER}}}, "stages": [{{"surface": {{}}}}, {{"stream": {{}}}}]}}]"#
    );
    let watched = format!(r#"{{"version": 1, "stream": {{"listen": "127.0.0.1:0"}}, {pipeline}}}"#);
    let unwatched = format!(r#"{{"version": 1, {pipeline}}}"#).replace(r#", {"stream": {}}"#, "");
    let orders = format!(
        r#"[{{"at": {{"cycle": {NEVER}}}, "order": {{"edits": [{{"translate": {{"features": ["feature-1"], "by": [0, 0, 0]}}}}]}}}}]"#
    );
    let mut rows = Vec::new();
    for (case, config, orders) in [
        ("nobody watches", &unwatched, None),
        ("a server for viewers", &watched, None),
        ("an order to come", &watched, Some(&orders)),
    ] {
        let file = directory.join("pipelines.json");
        fs::write(&file, config)?;
        let orders = orders.map(|orders| {
            let file = directory.join("orders.json");
            fs::write(&file, orders).map(|()| file)
        });
        let orders = orders.transpose()?;
        for size in SIZES {
            rows.push(Row { case, measured: measure(&program, &file, orders.as_deref(), size)? });
        }
    }
    let added = |index: usize| {
        rows.get(index).map_or(f64::NAN, |row: &Row| row.measured.added_bytes as f64)
    };
    let slowest = rows.iter().map(|row| row.measured.seconds).fold(0.0, f64::max);
    let growth = rows.chunks(2).map(|pair| match pair {
        [large, small] => large.measured.allocated as f64 - small.measured.allocated as f64,
        _ => f64::NAN,
    });
    let targets = vec![
        Target::at_most("catalyst_execute with nothing due [s]", slowest, 10e-6),
        Target::at_most(
            "bytes it allocates more for a larger mesh",
            growth.fold(0.0, f64::max),
            0.0,
        ),
        Target::at_most("memory added by a server [bytes]", added(2), 60e6),
        Target::at_most("memory added once an order is to come [bytes]", added(4), 325e6),
    ];
    Ok(Report { rows, targets })
}

fn measure(
    program: &Path,
    config: &Path,
    orders: Option<&Path>,
    size: u32,
) -> Result<Measured, Box<dyn Error>> {
    let mut command = Command::new(program);
    command
        .args([size.to_string(), CALLS.to_string()])
        .env("CATALYST_IMPLEMENTATION_NAME", "tombolo");
    for name in
        ["TOMBOLO_ORDERS", "TOMBOLO_OUTPUT", "TOMBOLO_REPORT", "CATALYST_IMPLEMENTATION_PATHS"]
    {
        command.env_remove(name);
    }
    command.envs(orders.map(|orders| ("TOMBOLO_ORDERS", orders)));
    Ok(serde_json::from_str(&peer::run(command.env("TOMBOLO_PIPELINES", config))?)?)
}

impl Line for Row {
    const HEADINGS: &'static [&'static str] =
        &["case", "tets", "median [s]", "p95 [s]", "bytes/call", "added [MB]", "own mesh [MB]"];

    fn cells(&self) -> Vec<String> {
        let Measured { tets, seconds, p95, allocated, added_bytes, mesh_bytes } = self.measured;
        vec![
            self.case.into(),
            tets.to_string(),
            format!("{seconds:.3e}"),
            format!("{p95:.3e}"),
            allocated.to_string(),
            format!("{:.1}", added_bytes as f64 / 1e6),
            format!("{:.1}", mesh_bytes as f64 / 1e6),
        ]
    }
}
