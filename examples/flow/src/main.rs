//! The program `flow`: see `flow --help`.

use std::io::{IsTerminal, Write};
use std::num::NonZeroU64;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

use clap::Parser;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use tombolo::Stopper;
use tombolo::communicator::{Communicator, Solo};
use tombolo::deform::linear::{BuiltIn, Solvers};
use tombolo::pipelines::language::Listen;
use tombolo_flow::Settings;
use tombolo_flow::parts::{Dealing, Ranks};
use tombolo_flow::program::{Options, Run, tell};
use tombolo_flow::ranks::{agreed, threads};
use tombolo_flow::report::{empty_file, make_file};

/// Solves incompressible flow on a mesh of tetrahedra that can be steered: watched in a browser,
/// and given another shape while it runs.
///
/// Built with the feature `distributed` it runs under mpirun too: each rank gets a part of the
/// mesh.
#[derive(Debug, Parser)]
#[command(name = "flow", version)]
struct Arguments {
    /// The case: mesh, fluid, boundary conditions, time step
    #[arg(long, value_name = "CASE.json")]
    case: PathBuf,
    /// Pipelines to stream, watch and write; without them those that the case names
    #[arg(long, value_name = "PIPELINES.json")]
    pipelines: Option<PathBuf>,
    /// Orders and commands to carry out at stated steps or times; a journal is one too
    #[arg(long, value_name = "ORDERS.json")]
    orders: Option<PathBuf>,
    /// Carry the newest run of a journal out again: the same shapes at the same cycles, to the bit
    #[arg(long, value_name = "JOURNAL.jsonl", conflicts_with_all = ["orders", "restart"])]
    replay: Option<PathBuf>,
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
    /// Write the flow at the end of each step (pressure drop, mass in and out) and the seconds
    /// since the start, as a table
    #[arg(long, value_name = "HISTORY.csv")]
    history: Option<PathBuf>,
    /// Where viewers connect to, in place of what the pipelines say; port 0 takes any free one
    #[arg(long, value_name = "ADDRESS:PORT|unix:/PATH", conflicts_with = "headless")]
    listen: Option<Listen>,
    /// Save the state of the run every so many steps, and at the end; a run that is stopped takes the step
    /// under way to its end, and saves that
    #[arg(long, value_name = "N")]
    checkpoint_every: Option<NonZeroU64>,
    /// The file of the state; without it flow.state in the folder of the output
    #[arg(long, value_name = "FILE", requires = "checkpoint_every")]
    checkpoint: Option<PathBuf>,
    /// Go on from a state that was saved, with the same case on as many ranks
    #[arg(long, value_name = "FILE")]
    restart: Option<PathBuf>,
    /// How many threads each rank uses; without it the cores that it may run on are shared out evenly
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// Take no less than so many seconds for a step, at most 1: what a small case does in milliseconds can
    /// be followed by eye, and leaves the cores to others meanwhile
    #[arg(long, value_name = "SECONDS", value_parser = pace)]
    pace: Option<Duration>,
    /// Leave this rank without any of the mesh (to test what must work on any partition)
    #[arg(long, value_name = "RANK", hide_short_help = true)]
    empty_rank: Option<usize>,
    /// Number each rank's vertices and cells at random, from this seed (to test)
    #[arg(long, value_name = "SEED", hide_short_help = true)]
    shuffle: Option<u64>,
    /// Do not tell the adaptor which vertices of the ranks are the same (to test)
    #[arg(long, hide_short_help = true)]
    without_numbers: bool,
    /// How well the projections of an impulse are solved (to test that ranks solve the same)
    #[arg(long, value_name = "RELATIVE", hide_short_help = true)]
    impulse_tolerance: Option<f64>,
}

/// The least time of a step, from its text.
fn pace(text: &str) -> Result<Duration, String> {
    let seconds: Option<f64> = text.parse().ok();
    // The end of a run waits for the step that is under way.
    match seconds.filter(|seconds| (0.0..=1.0).contains(seconds)) {
        Some(seconds) => Ok(Duration::from_secs_f64(seconds)),
        None => Err("expected a number of seconds from 0 to 1".into()),
    }
}

fn main() -> ExitCode {
    tombolo::logging::start();
    let arguments = Arguments::parse();
    match on_ranks(|ranks, solvers| run(arguments, ranks, solvers)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            if !error.is_empty() {
                tell(format_args!("{error}"));
            }
            ExitCode::FAILURE
        }
    }
}

/// Has the run stop, and say what it came to, when the process is asked to end, or its terminal is
/// gone. Who asks twice is obeyed at once; a terminal may say that it is gone more than once.
fn stop_on_signals(stopper: Stopper) -> std::io::Result<()> {
    let mut signals = Signals::new([SIGINT, SIGTERM])?;
    if !outlives_terminal() {
        signals.add_signal(SIGHUP)?;
    }
    std::thread::Builder::new().name("signals".into()).spawn(move || {
        let mut has_asked = false;
        for signal in signals.forever() {
            if signal != SIGHUP && std::mem::replace(&mut has_asked, true) {
                let _ = signal_hook::low_level::emulate_default_handler(signal);
            }
            stopper.stop();
        }
    })?;
    Ok(())
}

/// Whether this process was started to go on without its terminal, as by `nohup`; where the system does
/// not say, it is left as it is.
fn outlives_terminal() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let ignored = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    ignored.is_none_or(|mask| mask & (1 << (SIGHUP - 1)) != 0)
}

/// Whether this process was started by mpirun, together with others or alone.
#[cfg(feature = "distributed")]
fn under_mpirun() -> bool {
    ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "PMIX_RANK"]
        .into_iter()
        .any(|name| std::env::var_os(name).is_some())
}

/// Does the work on the ranks that mpirun started, or on this process. The message is empty where
/// the first rank has said what is wrong.
#[cfg(feature = "distributed")]
fn on_ranks(
    work: impl FnOnce(Ranks, Arc<dyn Solvers>) -> Result<(), Box<dyn std::error::Error>>,
) -> Result<(), String> {
    use tombolo::{
        communicator::Alarm,
        mpi::{Mpi, rsmpi},
        petsc::Petsc,
    };
    if !under_mpirun() {
        return work(Arc::new(Solo), Arc::new(BuiltIn)).map_err(|error| error.to_string());
    }
    let (universe, _) = rsmpi::initialize_with_threading(rsmpi::Threading::Funneled)
        .ok_or_else(|| "MPI could not be initialized".to_owned())?;
    let ranks: Ranks = Arc::new(Mpi::new(&universe.world()).map_err(|error| error.to_string())?);
    // Before MPI would be finalized, which waits for the other ranks.
    let _alarm = Alarm::among(&ranks);
    let is_first = ranks.rank() == 0;
    let solvers = Petsc::solvers(&universe.world(), None).map_err(|error| error.to_string())?;
    work(ranks, solvers).map_err(|error| {
        // Before MPI is finalized: once a rank has failed and gone, mpirun ends the others.
        if is_first {
            tell(format_args!("{error}"));
        }
        String::new()
    })
}

/// Whether this process was started together with others, which would write the same files.
#[cfg(not(feature = "distributed"))]
fn is_one_of_several() -> bool {
    let said = |name: &str| std::env::var(name).ok();
    let size =
        ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "SLURM_STEP_NUM_TASKS"].into_iter().find_map(said);
    // A launcher that uses PMIx alone does not tell the number of processes.
    size.is_some_and(|size| size != "1") || said("PMIX_RANK").is_some_and(|rank| rank != "0")
}

#[cfg(not(feature = "distributed"))]
fn on_ranks(
    work: impl FnOnce(Ranks, Arc<dyn Solvers>) -> Result<(), Box<dyn std::error::Error>>,
) -> Result<(), String> {
    if is_one_of_several() {
        return Err(
            "started on several ranks, but built for one process; build it with `--features distributed`".into()
        );
    }
    work(Arc::new(Solo), Arc::new(BuiltIn)).map_err(|error| error.to_string())
}

/// Lets people and signals reach the run.
fn open(run: &mut Run) -> Result<(), Box<dyn std::error::Error>> {
    stop_on_signals(run.stopper())?;
    let mut output = std::io::stdout();
    let invitation = run.invitation(output.is_terminal());
    let invitation = invitation.map_err(|error| format!("the links were not written: {error}"))?;
    if let Some(invitation) = invitation {
        // Where nobody reads it the run goes on; the links are in their file.
        let _ = writeln!(output, "flow: {invitation}").and_then(|()| output.flush());
    }
    Ok(())
}

fn run(
    arguments: Arguments,
    ranks: Ranks,
    solvers: Arc<dyn Solvers>,
) -> Result<(), Box<dyn std::error::Error>> {
    let is_first = ranks.rank() == 0;
    let threads = arguments.threads.or_else(|| (ranks.size() > 1).then(|| threads(&*ranks)));
    if let Some(threads) = threads {
        // A rank that goes on its own would leave the others waiting.
        let started = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
        agreed(&*ranks, started.map_err(Box::<dyn std::error::Error>::from))?;
    }
    let state = || arguments.out.clone().unwrap_or_default().join("flow.state");
    let options = Options {
        checkpoint: arguments
            .checkpoint_every
            .map(|every| (arguments.checkpoint.clone().unwrap_or_else(state), every)),
        restart: arguments.restart,
        case: arguments.case,
        pipelines: arguments.pipelines,
        orders: arguments.orders,
        replay: arguments.replay,
        steps: arguments.steps,
        pace: arguments.pace.unwrap_or_default(),
        headless: arguments.headless,
        listen: arguments.listen,
        out: arguments.out,
        history: arguments.history,
        dealing: Dealing {
            empty_rank: arguments.empty_rank,
            shuffle: arguments.shuffle,
            without_numbers: arguments.without_numbers,
        },
        solves: Settings {
            impulse_tolerance: arguments
                .impulse_tolerance
                .unwrap_or(Settings::default().impulse_tolerance),
            ..Settings::default()
        },
    };
    if let Some(file) = &arguments.report {
        make_file(&*ranks, file)?;
    }
    let mut run = Run::solved_by(Arc::clone(&ranks), solvers, &options)?;
    agreed(&*ranks, open(&mut run))?;
    if let Some(file) = &arguments.report {
        empty_file(&*ranks, file)?;
    }
    let report = run.finish()?;
    if let Some(file) = arguments.report.filter(|_| is_first) {
        let text = serde_json::to_string_pretty(&report)? + "\n";
        std::fs::write(&file, text).map_err(|error| format!("{}: {error}", file.display()))?;
    }
    match report.error {
        Some(error) => Err(error.into()),
        None => Ok(()),
    }
}
