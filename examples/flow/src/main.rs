//! The program `flow`: see `flow --help`.

use std::io::Write;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use tombolo_flow::program::{Options, Run};

/// Solves incompressible flow on a mesh of tetrahedra that can be steered: watched in a browser, and given another shape while
/// it runs.
#[derive(Debug, Parser)]
#[command(name = "flow", version)]
struct Arguments {
    /// The case: mesh, fluid, boundary conditions, time step
    #[arg(long, value_name = "CASE.json")]
    case: PathBuf,
    /// What to stream, watch and write; without it what the case names
    #[arg(long, value_name = "PIPELINES.json")]
    pipelines: Option<PathBuf>,
    /// Orders and commands to carry out at stated steps or times; a journal is one too
    #[arg(long, value_name = "ORDERS.json")]
    orders: Option<PathBuf>,
    /// How many steps to take; without it the case's when headless, else until stopped
    #[arg(long, value_name = "N")]
    steps: Option<u64>,
    /// Run without a server for viewers
    #[arg(long)]
    headless: bool,
    /// Write a report of the run, as JSON
    #[arg(long, value_name = "REPORT.json")]
    report: Option<PathBuf>,
    /// Write the final state (final.vtu), and what the pipelines write, into this folder
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write the flow at the end of each step (pressure drop, mass in and out) and the seconds since the start, as a table
    #[arg(long, value_name = "HISTORY.csv")]
    history: Option<PathBuf>,
    /// Where viewers connect to, in place of what the pipelines say; port 0 takes any free one
    #[arg(long, value_name = "ADDRESS:PORT", conflicts_with = "headless")]
    listen: Option<SocketAddr>,
    /// How many threads to use; without it one for each core
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
}

fn main() -> ExitCode {
    match run(Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("flow: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: Arguments) -> Result<(), Box<dyn std::error::Error>> {
    if let Some(threads) = arguments.threads {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build_global()?;
    }
    let run = Run::new(&Options {
        case: arguments.case,
        pipelines: arguments.pipelines,
        orders: arguments.orders,
        steps: arguments.steps,
        headless: arguments.headless,
        listen: arguments.listen,
        out: arguments.out,
        history: arguments.history,
    })?;
    if let Some(link) = run.link() {
        let mut output = std::io::stdout();
        writeln!(output, "Open {link}")?;
        output.flush()?;
    }
    let report = run.finish()?;
    if let Some(file) = arguments.report {
        let text = serde_json::to_string_pretty(&report)? + "\n";
        std::fs::write(&file, text).map_err(|error| format!("{}: {error}", file.display()))?;
    }
    match report.error {
        Some(error) => Err(error.into()),
        None => Ok(()),
    }
}
