//! Benchmarks of Tombolo, side by side with their peers where there are any.
//!
//! ```sh
//! cargo run --release -p tombolo-benchmarks -- overhead
//! cargo run --release -p tombolo-benchmarks -- overhead --json
//! cargo run --release -p tombolo-benchmarks -- surface --json
//! cargo run --release -p tombolo-benchmarks -- paper --json
//! cargo run --release -p tombolo-benchmarks -- surface-wasm --json
//! cargo run --release -p tombolo-benchmarks -- skeleton --json
//! cargo run --release -p tombolo-benchmarks -- codec --json
//! cargo run --release -p tombolo-benchmarks -- scaling --json
//! cargo run --release -p tombolo-benchmarks -- catalyst --json
//! cargo run --release -p tombolo-benchmarks -- untangle
//! cargo run --release -p tombolo-benchmarks -- growth --json
//! cargo run --release -p tombolo-benchmarks -- extract --json
//! cargo run --release -p tombolo-benchmarks -- viewer --json
//! cargo run --release -p tombolo-benchmarks -- viewer-memory --json
//! cargo run --release -p tombolo-benchmarks -- python --json
//! cargo run --release -p tombolo-benchmarks -- stream --json
//! cargo run --release -p tombolo-benchmarks -- paraview --json
//! cargo run --release -p tombolo-benchmarks -- service --json
//! cargo run --release -p tombolo-benchmarks -- volume --json
//! cargo run --release -p tombolo-benchmarks --features distributed -- volume-ranks --json
//! ```

mod catalyst;
mod codec;
mod codec_cases;
mod desk;
mod extract;
mod growth;
mod measure;
mod overhead;
mod paper;
mod paraview;
mod peer;
mod python;
mod report;
mod scaling;
mod service;
mod service_viewers;
mod skeleton;
mod stiffening;
mod stream;
mod surface;
mod surface_wasm;
mod untangle;
mod viewer;
mod viewer_memory;
mod volume;
mod volume_case;
#[cfg(feature = "distributed")]
mod volume_ranks;

use std::error::Error;
use std::process::ExitCode;

use clap::{Parser, ValueEnum};
use report::{Line, Report};

/// Measures Tombolo and prints what was measured against what it should be.
#[derive(Parser)]
#[command(name = "tombolo-benchmarks", version)]
struct Arguments {
    /// Which benchmark.
    name: Name,
    /// Print one JSON object instead of a table.
    #[arg(long)]
    json: bool,
    /// Be one of the processes that `growth` starts, for a box of so many cubes along an edge.
    #[arg(long, hide = true)]
    cubes: Option<usize>,
    /// Have that process compute something else beside.
    #[arg(long, hide = true, requires = "cubes")]
    busy: bool,
    /// Take less of `service`: a look whether it works, and no measurement.
    #[arg(long)]
    short: bool,
    /// Be the viewers of `service`, with this task.
    #[arg(long, hide = true)]
    viewers: Option<String>,
    /// Be one of the ranks that `volume-ranks` starts for this mesh.
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
    /// The cost of `execute` with nothing to do, and of each stage against a step of the solver.
    Overhead,
    /// Polyharmonic deformation of surfaces, beside libigl.
    Surface,
    /// The paper's experiments on the quality of deformed meshes, beside its tables.
    Paper,
    /// The surface kernel in the viewer's WebAssembly module, in Node, beside the native one.
    SurfaceWasm,
    /// Curve skeletons, beside CGAL's.
    Skeleton,
    /// The codec of topologies and fields, beside SZ3, zfp and zstd.
    Codec,
    /// The quality of deformed meshes at several exponents of the stiffening.
    Stiffening,
    /// Surfaces of meshes in parts: the time it takes, and what goes from rank to rank.
    Scaling,
    /// The cost of an attached Catalyst implementation when nothing is due, and the memory that it
    /// adds.
    Catalyst,
    /// Boundaries that the inside of a mesh cannot follow in a straight line.
    Untangle,
    /// Volume motion at the sizes of the paper's meshes, beside the paper and PETSc.
    Volume,
    /// Volume motion of the same meshes on ranks of MPI, by the kernel and by PETSc.
    #[cfg(feature = "distributed")]
    VolumeRanks,
    /// Extracts and derived fields, beside VTK's filters.
    Extract,
    /// The viewer in a browser, watching a run: its pictures, its previews, its memory.
    Viewer,
    /// The memory of the viewer's page over half an hour.
    ViewerMemory,
    /// The cost of `execute` from Python when nothing is due, and the memory that lending a mesh takes.
    Python,
    /// Streaming a surface from a solver in Python to another process, beside Rerun.
    Stream,
    /// The cost of a step of a run that is followed in ParaView.
    Paraview,
    /// Many viewers, slow ones and deaf ones; many and large orders; how soon the mesh moves.
    Service,
    /// The time and the memory of an order, from ten thousand cells to five million.
    Growth,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    #[cfg(feature = "distributed")]
    if let (Some(number), Some(displacement)) = (arguments.part_of, &arguments.displacement) {
        return said(volume_ranks::part(number, displacement).map(|()| String::new()));
    }
    if let Some(cubes) = arguments.cubes {
        return said(growth::one(cubes, arguments.busy).map(|()| String::new()));
    }
    if let Some(task) = &arguments.viewers {
        return said(service_viewers::run(task).map(|()| String::new()));
    }
    let json = arguments.json;
    said(match arguments.name {
        Name::Paper => text(paper::run(), json),
        Name::Stiffening => text(stiffening::run(), json),
        Name::Untangle => text(untangle::run(), json),
        Name::Scaling => text(scaling::run(), json),
        Name::Catalyst => text(catalyst::run(), json),
        Name::Overhead => text(overhead::run(), json),
        Name::Surface => text(surface::run(), json),
        Name::SurfaceWasm => text(surface_wasm::run(), json),
        Name::Codec => text(codec::run(), json),
        Name::Skeleton => text(skeleton::run(), json),
        Name::Volume => text(volume::run(), json),
        #[cfg(feature = "distributed")]
        Name::VolumeRanks => text(volume_ranks::run(), json),
        Name::Python => text(python::run(), json),
        Name::Stream => text(stream::run(), json),
        Name::Paraview => text(paraview::run(), json),
        Name::Service => text(service::run(arguments.short), json),
        Name::Growth => text(growth::run(), json),
        Name::Extract => text(extract::run(), json),
        Name::Viewer => text(viewer::run(), json),
        Name::ViewerMemory => text(viewer_memory::run(), json),
    })
}

fn text<R: Line>(
    report: Result<Report<R>, Box<dyn Error>>,
    json: bool,
) -> Result<String, Box<dyn Error>> {
    Ok(report?.text(json)?)
}

fn said(result: Result<String, Box<dyn Error>>) -> ExitCode {
    match result {
        Ok(text) => print!("{text}"),
        Err(error) => {
            eprintln!("tombolo-benchmarks: {error}");
            return ExitCode::FAILURE;
        }
    }
    ExitCode::SUCCESS
}
