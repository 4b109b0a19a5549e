//! Damaged input for the readers of Tombolo. See the crate's page.

use std::{path::PathBuf, process::ExitCode, time::Duration};

use clap::Parser;
use tombolo_fuzz::{Target, fuzz};

/// Gives readers damaged input, and says which does harm.
#[derive(Parser)]
struct Arguments {
    /// The readers; all where none is named.
    targets: Vec<Target>,
    /// Seconds for each.
    #[arg(long, default_value_t = 60)]
    seconds: u64,
    /// Another number gives other inputs.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Keep inputs with an outcome of their own in the corpus.
    #[arg(long)]
    keep: bool,
    /// The folder for the input that does harm.
    #[arg(long, default_value = "fuzz-found")]
    folder: PathBuf,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let targets = match &arguments.targets[..] {
        [] => &Target::ALL[..],
        named => named,
    };
    let time = Duration::from_secs(arguments.seconds);
    for &target in targets {
        match fuzz(target, arguments.seed, time, &arguments.folder, arguments.keep) {
            Ok(pass) => {
                println!("{}: {} inputs, {} outcomes", target.name(), pass.inputs, pass.outcomes)
            }
            Err(fault) => {
                eprintln!("{}: {} ({})", target.name(), fault.reason, fault.file.display());
                return ExitCode::FAILURE;
            }
        }
    }
    ExitCode::SUCCESS
}
