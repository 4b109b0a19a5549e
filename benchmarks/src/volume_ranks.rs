//! Volume motion on the ranks of MPI: by PETSc with each of its preconditioners, and by the
//! kernel's own solver on as many ranks.
//!
//! The benchmark starts itself again under `mpirun` for each number of ranks; every rank reads or
//! makes the mesh and keeps its part.

use std::{error::Error, path::Path, sync::Arc};

use serde::{Deserialize, Serialize};
use tombolo::{
    communicator::{Communicator, Reduction, agree},
    deform::{
        distributed::{Part, domain},
        features::FeatureSettings,
        linear::{BuiltIn, Solvers},
        mesh::Vector,
        volume::{Deform, VolumeOperator},
    },
    mpi::{Mpi, rsmpi},
    petsc::{Petsc, Preconditioning},
};

use crate::measure::Times;
use crate::peer;
use crate::report::{Report, Row, Target};
use crate::volume_case::{MESHES, THREADS, TOLERANCE, mesh, motion};

const RUNS: usize = 3;

/// Runs the benchmark: some ten minutes.
///
/// # Errors
/// The first error of a part; nothing is skipped.
pub fn run() -> Result<Report, Box<dyn Error>> {
    let mut report = Report { rows: Vec::new(), targets: Vec::new() };
    for number in 0..MESHES {
        let folder = tempfile::tempdir()?;
        let file = folder.path().join("displacement");
        let name = write_displacement(&file, number)?;
        for ranks in [1, 2] {
            let case = |what: &str| format!("{name}, {ranks} rank(s), {what}");
            let found = started(number, ranks, &file)?;
            for OnRanks { solver, set_up, first, later, iterations, .. } in &found {
                let stages = [
                    ("assembly and set-up".to_owned(), set_up),
                    (format!("first order, {iterations} iterations"), first),
                    ("later order".to_owned(), later),
                ];
                for (what, &seconds) in stages {
                    report.rows.push(Row::new(case(&format!("{solver}, {what}")), seconds));
                }
            }
            let worst = found.iter().map(|solver| solver.difference).fold(0.0, f64::max);
            report.targets.push(Target::at_most(
                case("difference from the shared-memory solver"),
                worst,
                1e-6,
            ));
            let cold = |solver: &OnRanks| solver.set_up + solver.first;
            let petsc = || found.iter().filter(|solver| solver.solver.starts_with("PETSc"));
            let quickest = petsc().map(cold).fold(f64::INFINITY, f64::min);
            let default = petsc().find(|solver| solver.is_default).map_or(f64::INFINITY, cold);
            report.targets.push(Target::at_most(
                case("PETSc as it is by default by its quickest"),
                default / quickest,
                1.0,
            ));
        }
    }
    Ok(report)
}

/// The seconds that one solver took on a number of ranks.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct OnRanks {
    solver: String,
    is_default: bool,
    /// Assembly and set-up.
    set_up: f64,
    first: f64,
    later: f64,
    iterations: usize,
    /// The largest difference from the displacement on one process by the largest displacement,
    /// both solved to the kernel's default tolerance.
    difference: f64,
}

/// Writes the displacement on one process, for ranks to compare theirs with, and says which mesh
/// it is of.
fn write_displacement(file: &Path, number: usize) -> Result<String, Box<dyn Error>> {
    let (source, mesh) = mesh(number)?;
    let surface = tombolo::deform::surface::Surface::extract(&mesh, &FeatureSettings::default())?;
    let operator = VolumeOperator::new(&mesh, surface.vertices(), &Deform::default())?;
    let displacement = operator.solve(&motion(&mesh, surface.vertices()))?.displacement;
    let bytes: Vec<u8> =
        displacement.as_flattened().iter().flat_map(|value| value.to_le_bytes()).collect();
    std::fs::write(file, bytes)?;
    Ok(format!("mesh {number} ({source}, {} tets)", mesh.cells().len()))
}

/// Runs the solvers on `ranks` ranks of MPI.
fn started(
    number: usize,
    ranks: usize,
    displacement: &Path,
) -> Result<Vec<OnRanks>, Box<dyn Error>> {
    let mut command = peer::on_ranks(ranks);
    command.arg(std::env::current_exe()?).args([
        "volume-ranks",
        "--part-of",
        &number.to_string(),
        "--displacement",
    ]);
    let printed = peer::run(command.arg(displacement))?;
    Ok(serde_json::from_str(peer::answer(&printed)?)?)
}

/// Measures as one of the ranks that [`started`] starts.
pub fn part(number: usize, displacement: &Path) -> Result<(), Box<dyn Error>> {
    let universe = rsmpi::initialize().ok_or("MPI was initialized before")?;
    let world = universe.world();
    let communicator: Arc<dyn Communicator> = Arc::new(Mpi::new(&world)?);
    let (rank, ranks) = (communicator.rank(), communicator.size());
    let threads = rayon::ThreadPoolBuilder::new().num_threads((THREADS / ranks).max(1)).build()?;
    let read = prepared(number, rank, ranks, displacement).map_err(|error| error.to_string());
    let (part, motion, expected) = agree(&*communicator, read)?;
    let (domain, boundary) = domain(&communicator, &part, &FeatureSettings::default())?;
    let motion: Vec<Vector> =
        boundary.vertices().iter().map(|&vertex| motion[vertex as usize]).collect();
    // Those whose displacement is not prescribed.
    let mut prescribed = vec![false; part.points.len()];
    boundary.vertices().iter().for_each(|&vertex| prescribed[vertex as usize] = true);
    let solvers = [
        ("kernel", None),
        ("PETSc, multigrid", Some(Preconditioning::Multigrid)),
        ("PETSc, incomplete Cholesky", Some(Preconditioning::IncompleteCholesky)),
        ("PETSc, GAMG", Some(Preconditioning::Gamg)),
        ("PETSc, Jacobi", Some(Preconditioning::Jacobi)),
    ];
    let mut found = Vec::new();
    for (solver, preconditioning) in solvers {
        let solvers: Arc<dyn Solvers> = match preconditioning {
            Some(preconditioning) => Petsc::solvers(&world, Some(preconditioning))?,
            None => Arc::new(BuiltIn),
        };
        let unknown = (0..)
            .zip(&prescribed)
            .filter(|&(vertex, &known)| !known && domain.owns(vertex))
            .count();
        let default = Preconditioning::quickest(communicator.total(unknown), communicator.size());
        let measure = || -> Result<OnRanks, Box<dyn Error + Send + Sync>> {
            let (mut set_up, mut first, mut later, mut iterations) =
                (Times::new(), Times::new(), Times::new(), 0);
            let settings = Deform { tolerance: TOLERANCE, ..Deform::default() };
            for _ in 0..RUNS {
                communicator.barrier();
                let boundary = boundary.vertices();
                let operator = set_up.of(|| {
                    let operator =
                        VolumeOperator::with_sliding(&domain, boundary, &[], &settings, &*solvers);
                    communicator.barrier();
                    operator
                })?;
                for times in [&mut first, &mut later] {
                    let solution = times.of(|| {
                        let solution = operator.solve(&motion);
                        communicator.barrier();
                        solution
                    });
                    iterations = solution?.iterations;
                }
            }
            let operator = VolumeOperator::with_sliding(
                &domain,
                boundary.vertices(),
                &[],
                &Deform::default(),
                &*solvers,
            )?;
            let solution = operator.solve(&motion)?.displacement;
            let largest = |values: &mut dyn Iterator<Item = f64>| {
                values.fold(0.0, |most: f64, value| most.max(value.abs()))
            };
            let mut sizes = [
                largest(
                    &mut solution
                        .as_flattened()
                        .iter()
                        .zip(expected.as_flattened())
                        .map(|(a, b)| a - b),
                ),
                largest(&mut expected.as_flattened().iter().copied()),
            ];
            communicator.reduce(Reduction::Maximum, &mut sizes);
            Ok(OnRanks {
                solver: solver.into(),
                is_default: preconditioning == Some(default),
                set_up: set_up.median(),
                first: first.median(),
                later: later.median(),
                iterations,
                difference: sizes[0] / sizes[1],
            })
        };
        found.push(threads.install(measure).map_err(|error| error.to_string())?);
    }
    if rank == 0 {
        println!("tombolo {}", serde_json::to_string(&found)?);
    }
    Ok(())
}

/// This rank's part of a mesh, and for each of its vertices the motion that is prescribed on the
/// boundary and the displacement on one process.
type Prepared = (Part, Vec<Vector>, Vec<Vector>);

fn prepared(
    number: usize,
    rank: usize,
    ranks: usize,
    displacement: &Path,
) -> Result<Prepared, Box<dyn Error>> {
    let (_, mesh) = mesh(number)?;
    let all: Vec<u32> = (0..).take(mesh.points().len()).collect();
    let motion = motion(&mesh, &all);
    // Slabs of as many cells each, across the longest axis.
    let spread = |axis: usize| {
        let places = mesh.points().iter().map(|point| point[axis]);
        places.clone().fold(f64::MIN, f64::max) - places.fold(f64::MAX, f64::min)
    };
    let axis = (0..3).max_by(|&a, &b| spread(a).total_cmp(&spread(b))).unwrap_or(0);
    let place = |cell: usize| -> f64 {
        mesh.cells().vertices(cell).iter().map(|&vertex| mesh.points()[vertex as usize][axis]).sum()
    };
    let mut order: Vec<usize> = (0..mesh.cells().len()).collect();
    order.sort_by(|&a, &b| place(a).total_cmp(&place(b)));
    let mut of_cells = vec![0; order.len()];
    for (index, &cell) in order.iter().enumerate() {
        of_cells[cell] = index * ranks / order.len();
    }
    let part = Part::cut(&mesh, &of_cells, rank, false)?;
    let bytes = std::fs::read(displacement)?;
    let values = peer::numbers(&bytes);
    let values = values.as_chunks::<3>().0;
    if values.len() != mesh.points().len() {
        return Err("the displacement is not that of this mesh".into());
    }
    let numbers = || part.global_vertices.iter().flatten().map(|&number| number as usize);
    let (motion, expected) =
        (numbers().map(|number| motion[number]).collect(), numbers().map(|n| values[n]).collect());
    Ok((part, motion, expected))
}
