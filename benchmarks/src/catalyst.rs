//! What an attached Catalyst implementation costs a solver at the steps at which nothing is due: a program in C, a channel of
//! tetrahedra, `catalyst_execute`.

use std::error::Error;
use std::fmt;
use std::fs;
use std::path::Path;
use std::process::Command;

use serde::{Deserialize, Serialize};
use tombolo_tests::{project, target};

use crate::report::Target;

/// Cubes along an edge, each of six tetrahedra: 1 296 000 of them, and a hundredth of that.
const SIZES: [u32; 2] = [60, 13];
const CALLS: u32 = 20_000;
const NEVER: u64 = 1_000_000_000_000;

#[derive(Serialize)]
pub struct Catalyst {
    rows: Vec<Row>,
    targets: Vec<Target>,
}

#[derive(Serialize)]
struct Row {
    case: &'static str,
    #[serde(flatten)]
    measured: Measured,
}

/// What the program prints.
#[derive(Serialize, Deserialize)]
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
/// Whatever building and running fails with.
pub fn run() -> Result<Catalyst, Box<dyn Error>> {
    let directory = target().join("benchmark-catalyst");
    let prefix = directory.join("prefix");
    fs::create_dir_all(&directory)?;
    succeed(Command::new(project().join("scripts/install-catalyst")).arg(&prefix))?;
    let program = directory.join("catalyst");
    let mut compile = Command::new("cc");
    compile.args(["-O2", "-o"]).arg(&program).arg(project().join("benchmarks/peers/catalyst.c"));
    compile.arg(format!("-I{}", prefix.join("include/catalyst-2.0").display()));
    compile.arg(format!("-L{0}", prefix.join("lib").display()));
    compile.arg(format!("-Wl,-rpath,{}", prefix.join("lib").display())).arg("-lcatalyst");
    succeed(&mut compile)?;

    let pipeline = format!(
        r#""pipelines": [{{"name": "surface", "at": {{"cycle": {NEVER}}}, "stages": [{{"surface": {{}}}}, {{"stream": {{}}}}]}}]"#
    );
    let watched = format!(r#"{{"version": 1, "stream": {{"listen": "127.0.0.1:0"}}, {pipeline}}}"#);
    let unwatched = format!(r#"{{"version": 1, {pipeline}}}"#).replace(r#", {"stream": {}}"#, "");
    let mut rows = Vec::new();
    for (case, config) in [("nobody watches", unwatched), ("a server for viewers", watched)] {
        let file = directory.join("pipelines.json");
        fs::write(&file, config)?;
        for size in SIZES {
            rows.push(Row { case, measured: measure(&program, &file, size)? });
        }
    }
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
    ];
    Ok(Catalyst { rows, targets })
}

fn measure(program: &Path, config: &Path, size: u32) -> Result<Measured, Box<dyn Error>> {
    let mut command = Command::new(program);
    command
        .args([size.to_string(), CALLS.to_string()])
        .env("CATALYST_IMPLEMENTATION_NAME", "tombolo");
    for name in
        ["TOMBOLO_ORDERS", "TOMBOLO_OUTPUT", "TOMBOLO_REPORT", "CATALYST_IMPLEMENTATION_PATHS"]
    {
        command.env_remove(name);
    }
    Ok(serde_json::from_str(&succeed(command.env("TOMBOLO_PIPELINES", config))?)?)
}

fn succeed(command: &mut Command) -> Result<String, Box<dyn Error>> {
    let output = command.output().map_err(|error| format!("{command:?}: {error}"))?;
    if output.status.success() {
        return Ok(String::from_utf8(output.stdout)?);
    }
    Err(format!("{command:?}: {}", String::from_utf8_lossy(&output.stderr)).into())
}

impl Catalyst {
    /// As one line of JSON.
    pub fn json(&self) -> String {
        serde_json::to_string(self).unwrap_or_else(|error| format!("{{\"error\": \"{error}\"}}"))
    }
}

impl fmt::Display for Catalyst {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mega = |bytes: f64| bytes / 1e6;
        writeln!(
            f,
            "{:<24} {:>10} {:>12} {:>12} {:>12} {:>14} {:>14}",
            "case", "tets", "median [s]", "p95 [s]", "bytes/call", "added [MB]", "own mesh [MB]"
        )?;
        for Row { case, measured } in &self.rows {
            let Measured { tets, seconds, p95, allocated, added_bytes, mesh_bytes } = measured;
            let (added, own) = (mega(*added_bytes as f64), mega(*mesh_bytes as f64));
            writeln!(
                f,
                "{case:<24} {tets:>10} {seconds:>12.3e} {p95:>12.3e} {allocated:>12} {added:>14.1} {own:>14.1}"
            )?;
        }
        writeln!(f, "\n{:<44} {:>12} {:>14}", "target", "value", "at most")?;
        for target in &self.targets {
            let verdict = if target.holds { "holds" } else { "does not hold" };
            writeln!(
                f,
                "{:<44} {:>12.3e} {:>14.3e}  {verdict}",
                target.name, target.value, target.target
            )?;
        }
        Ok(())
    }
}
