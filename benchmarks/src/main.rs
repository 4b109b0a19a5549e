//! Benchmarks of Tombolo, side by side with their peers where there are any.
//!
//! ```sh
//! cargo run --release -p tombolo-benchmarks -- overhead
//! cargo run --release -p tombolo-benchmarks -- overhead --json
//! cargo run --release -p tombolo-benchmarks -- surface --json
//! cargo run --release -p tombolo-benchmarks -- paper --json
//! cargo run --release -p tombolo-benchmarks -- surface-wasm --json
//! cargo run --release -p tombolo-benchmarks -- skeleton --json
//! cargo run --release -p tombolo-benchmarks -- scaling --json
//! cargo run --release -p tombolo-benchmarks -- catalyst --json
//! cargo run --release -p tombolo-benchmarks --features distributed -- volume --json
//! ```

mod catalyst;
mod measure;
mod overhead;
mod paper;
mod report;
mod scaling;
mod skeleton;
mod stiffening;
mod surface;
mod surface_wasm;
mod volume;
#[cfg(feature = "distributed")]
mod volume_ranks;

use std::process::ExitCode;

use clap::{Parser, ValueEnum};
use report::Report;

/// Measures Tombolo and prints what was measured against what it should be.
#[derive(Parser)]
#[command(name = "tombolo-benchmarks", version)]
struct Arguments {
    /// Which benchmark.
    name: Name,
    /// Print one JSON object instead of a table.
    #[arg(long)]
    json: bool,
    /// Be one of the ranks that `volume` starts for this mesh.
    #[cfg(feature = "distributed")]
    #[arg(long, hide = true, requires = "displacement")]
    part_of: Option<usize>,
    /// The displacement on one process.
    #[cfg(feature = "distributed")]
    #[arg(long, hide = true)]
    displacement: Option<std::path::PathBuf>,
}

#[derive(Clone, Copy, ValueEnum)]
enum Name {
    /// What `execute` costs with nothing to do, and what each stage costs against a step of the solver.
    Overhead,
    /// Polyharmonic deformation of surfaces, beside libigl.
    Surface,
    /// The paper's experiments on the quality of deformed meshes, beside its tables.
    Paper,
    /// The surface kernel in the viewer's WebAssembly module, in Node, beside the native one.
    SurfaceWasm,
    /// Curve skeletons, beside CGAL's.
    Skeleton,
    /// The quality of deformed meshes at several exponents of the stiffening.
    Stiffening,
    /// Surfaces of meshes in parts: the time it takes, and what goes from rank to rank.
    Scaling,
    /// What an attached Catalyst implementation costs when nothing is due, and the memory that it adds.
    Catalyst,
    /// Volume motion at the sizes of the paper's meshes, beside the paper and PETSc.
    Volume,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    #[cfg(feature = "distributed")]
    if let (Some(number), Some(displacement)) = (arguments.part_of, &arguments.displacement) {
        return said(volume_ranks::run(number, displacement).map(|()| String::new()));
    }
    let result: Result<Report, Box<dyn std::error::Error>> = match arguments.name {
        Name::Paper => {
            return said(paper::run().map(|report| {
                if arguments.json { report.json() + "\n" } else { report.to_string() }
            }));
        }
        Name::Stiffening => {
            return said(stiffening::run().map(|report| {
                if arguments.json { report.json() + "\n" } else { report.to_string() }
            }));
        }
        Name::Scaling => {
            return said(scaling::run().map(|report| {
                if arguments.json { report.json() + "\n" } else { report.to_string() }
            }));
        }
        Name::Catalyst => {
            return said(catalyst::run().map(|report| {
                if arguments.json { report.json() + "\n" } else { report.to_string() }
            }));
        }
        Name::Overhead => overhead::run(),
        Name::Surface => surface::run(),
        Name::SurfaceWasm => surface_wasm::run(),
        Name::Skeleton => skeleton::run(),
        Name::Volume => volume::run(),
    };
    said(
        result.map(|report| if arguments.json { report.json() + "\n" } else { report.to_string() }),
    )
}

fn said(result: Result<String, Box<dyn std::error::Error>>) -> ExitCode {
    match result {
        Ok(text) => print!("{text}"),
        Err(error) => {
            eprintln!("tombolo-benchmarks: {error}");
            return ExitCode::FAILURE;
        }
    }
    ExitCode::SUCCESS
}
