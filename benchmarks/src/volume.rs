//! Volume motion: seconds at the sizes of the paper's meshes, beside the paper's own and beside
//! PETSc on the same matrix.

use std::error::Error;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::sync::Arc;

use tombolo::deform::features::FeatureSettings;
use tombolo::deform::linear::{
    BuiltIn, Cholesky, LinearError, LinearSolver, Multigrid, MultigridSettings, SparseMatrix,
    Tolerance,
};
use tombolo::deform::mesh::{Mesh, Vector};
use tombolo::deform::surface::Surface;
use tombolo::deform::vector::add;
use tombolo::deform::volume::{Deform, Improver, Method, Sliding, VolumeOperator};
use tombolo_tests::project;

use crate::measure::{Times, memory_peak, processor_seconds};
use crate::peer::{self, apart};
use crate::report::{Report, Row, Target};
use crate::volume_case::{MESHES, THREADS, TOLERANCE, jiggled_box, mesh, motion};

/// Runs of each of our own measurements.
const RUNS: usize = 5;

/// The paper's table: elements, processes, milliseconds to allocate and assemble the matrix and to
/// solve.
const PAPER: [(&str, usize, f64, f64); MESHES] = [
    ("mesh 0", 12, 40.0 + 441.0, 23.0),
    ("mesh 1", 24, 71.0 + 573.0, 22.0),
    ("mesh 2", 48, 154.0 + 943.0, 30.0),
    ("mesh 3", 96, 102.0 + 1163.0, 46.0),
    ("mesh 4", 256, 579.0 + 3925.0, 131.0),
];

/// Runs the benchmark: some minutes.
///
/// # Errors
/// The first error of a part; nothing is skipped.
pub fn run() -> Result<Report, Box<dyn Error>> {
    let threads = rayon::ThreadPoolBuilder::new().num_threads(THREADS).build()?;
    Ok(threads.install(|| measured().map_err(|error| error.to_string()))?)
}

fn measured() -> Result<Report, Box<dyn Error>> {
    let mut report = Report { rows: Vec::new(), targets: Vec::new() };
    small_systems(&mut report)?;
    sliding_sides(&mut report)?;
    for (number, &(name, processes, allocate_and_assemble, solve)) in PAPER.iter().enumerate() {
        let (source, mesh) = mesh(number)?;
        let tets = mesh.cells().len();
        let surface = Surface::extract(&mesh, &FeatureSettings::default())?;
        let motion = motion(&mesh, surface.vertices());
        let case = |what: &str| format!("{name} ({source}, {tets} tets), {what}");
        let mut push = |what: &str, seconds: f64| {
            report.rows.push(Row::new(case(what), seconds));
        };
        push(
            &format!("paper on {processes} processes, allocate and assemble"),
            1e-3 * allocate_and_assemble,
        );
        push(&format!("paper on {processes} processes, solve"), 1e-3 * solve);

        let ours = elasticity(&mesh, surface.vertices(), &motion)?;
        push("elasticity, assembly", ours.assembly);
        push("elasticity, set-up", ours.set_up);
        push("elasticity, first order", ours.solve);
        push("elasticity, later order", ours.later);
        push("elasticity, improvement", ours.improvement);
        push("elasticity, cells moved: assembly and set-up again", ours.updated);
        push("elasticity, cold, processor seconds of both threads", ours.processor);
        let harmonic = harmonic(&mesh, surface.vertices(), &motion)?;
        push("harmonic, assembly", harmonic.assembly);
        push("harmonic, set-up", harmonic.set_up);
        push("harmonic, one component", harmonic.one);
        push("harmonic, three components", harmonic.three);
        push("harmonic, cold, processor seconds of both threads", harmonic.processor);

        let folder = tempfile::tempdir()?;
        let file = folder.path().join("system");
        write_system(&file, &ours)?;
        let mut worst: f64 = 0.0;
        let mut quickest = f64::INFINITY;
        for solver in ["icc", "gamg"] {
            let peer = petsc(&file, solver)?;
            push(&format!("PETSc {solver} on 2 ranks, set-up"), peer.set_up);
            push(
                &format!("PETSc {solver} on 2 ranks, solve, {} iterations", peer.iterations),
                peer.solve,
            );
            worst = worst.max(apart(ours.solution.as_flattened(), &peer.solution));
            quickest = quickest.min(peer.set_up + peer.solve);
        }
        report.targets.push(Target::at_most(case("difference from PETSc"), worst, 1e-5));
        let ratio = (ours.set_up + ours.solve) / quickest;
        report.targets.push(Target::at_most(
            case("set-up and solve by PETSc's quickest"),
            ratio,
            1.0,
        ));
        let ratio = ours.improvement / ours.later;
        report.targets.push(Target::at_most(case("improvement by a later order"), ratio, 1.0));
        if number + 1 == PAPER.len() {
            let cold = ours.assembly + ours.set_up + ours.solve;
            report.targets.push(Target::at_most(case("elasticity, cold [s]"), cold, 2.0));
            report.targets.push(Target::at_most(
                case("elasticity, cold, half the processor seconds"),
                0.5 * ours.processor,
                2.0,
            ));
            report.targets.push(Target::at_most(
                case("elasticity, set-up and solve [s]"),
                ours.set_up + ours.solve,
                1.3,
            ));
            report.targets.push(Target::at_most(
                case("elasticity, later order [s]"),
                ours.later,
                0.5,
            ));
            let later = harmonic.three;
            report.targets.push(Target::at_most(
                case("harmonic, later order, three components [s]"),
                later,
                0.4,
            ));
            let cold = harmonic.set_up + harmonic.one;
            report.targets.push(Target::at_most(case("harmonic, set-up and solve [s]"), cold, 0.4));
            let cold = harmonic.assembly + cold;
            report.targets.push(Target::at_most(
                case("harmonic, cold, with assembly [s]"),
                cold,
                0.4,
            ));
            report.targets.push(Target::at_most("peak memory [GB]", memory_peak()? / 1e9, 3.0));
        }
    }
    Ok(report)
}

/// The seconds that elasticity took, and its equations.
struct Elasticity {
    assembly: f64,
    set_up: f64,
    solve: f64,
    later: f64,
    /// What follows the solve in an order.
    improvement: f64,
    updated: f64,
    /// Of all threads, for assembly, set-up and solve.
    processor: f64,
    matrix: SparseMatrix<3>,
    places: Vec<Vector>,
    right_side: Vec<Vector>,
    solution: Vec<Vector>,
}

fn elasticity(
    mesh: &Mesh,
    boundary: &[u32],
    motion: &[Vector],
) -> Result<Elasticity, Box<dyn Error>> {
    let settings = Deform { tolerance: TOLERANCE, ..Deform::default() };
    let [mut whole, mut set_up, mut first, mut later, mut updated, mut processor] =
        [const { Times::new() }; 6];
    let (improver, mut improvement) = (Improver::new(mesh, boundary), Times::new());
    let mut kept = None;
    for _ in 0..RUNS {
        drop(kept.take());
        let before = processor_seconds()?;
        let operator = whole.of(|| VolumeOperator::new(mesh, boundary, &settings))?;
        first.of(|| operator.solve(motion))?;
        processor.add(processor_seconds()? - before);
        let solved = later.of(|| operator.solve(motion))?;
        let mut points: Vec<Vector> =
            mesh.points().iter().zip(&solved.displacement).map(|(&p, &by)| add(p, by)).collect();
        improvement.of(|| improver.improve(&mut points, settings.improve));
        updated.of(|| operator.updated(mesh))?;
        // The solver once more, by itself, to tell its set-up from the assembly.
        let (matrix, _) =
            operator.coupled_equations(motion).ok_or("the operator is not elastic")?;
        let matrix = Arc::new(matrix);
        set_up.of(|| Multigrid::<3>::new(matrix, MultigridSettings::default()))?;
        kept = Some(operator);
    }
    let operator = kept.ok_or("nothing was run")?;
    let (matrix, right_side) =
        operator.coupled_equations(motion).ok_or("the operator is not elastic")?;
    let mut solution = vec![[0.0; 3]; right_side.len()];
    let tolerance = Tolerance { relative: TOLERANCE, absolute: 0.0 };
    Multigrid::<3>::new(matrix.clone(), MultigridSettings::default())?.solve(
        &right_side,
        &mut solution,
        tolerance,
    )?;
    let set_up = set_up.median();
    Ok(Elasticity {
        assembly: whole.median() - set_up,
        set_up,
        solve: first.median(),
        later: later.median(),
        improvement: improvement.median(),
        updated: updated.median(),
        processor: processor.median(),
        matrix,
        places: operator.unknown_points().to_vec(),
        right_side,
        solution,
    })
}

/// The seconds that a harmonic displacement took.
struct Harmonic {
    assembly: f64,
    set_up: f64,
    /// A solve for one component, and for three.
    one: f64,
    three: f64,
    /// Of all threads, for assembly, set-up and a solve for one.
    processor: f64,
}

fn harmonic(mesh: &Mesh, boundary: &[u32], motion: &[Vector]) -> Result<Harmonic, Box<dyn Error>> {
    let settings = Deform { method: Method::Harmonic, tolerance: TOLERANCE, ..Deform::default() };
    let along: Vec<Vector> = motion.iter().map(|value| [0.0, 0.0, value[2]]).collect();
    let [mut whole, mut set_up, mut one, mut three, mut processor] = [const { Times::new() }; 5];
    for _ in 0..RUNS {
        let before = processor_seconds()?;
        let operator = whole.of(|| VolumeOperator::new(mesh, boundary, &settings))?;
        one.of(|| operator.solve(&along))?;
        processor.add(processor_seconds()? - before);
        three.of(|| operator.solve(motion))?;
        // The solver once more, by itself, to tell its set-up from the assembly.
        let matrix = operator.separate_matrix().ok_or("the operator is not harmonic")?;
        let matrix = Arc::new(matrix);
        set_up.of(|| Multigrid::<1>::new(matrix, MultigridSettings::default()))?;
    }
    let set_up = set_up.median();
    Ok(Harmonic {
        assembly: whole.median() - set_up,
        set_up,
        one: one.median(),
        three: three.median(),
        processor: processor.median(),
    })
}

/// Small systems, factored and by multigrid: where one overtakes the other is where
/// [`tombolo::deform::linear::solver`] changes over.
fn small_systems(report: &mut Report) -> Result<(), Box<dyn Error>> {
    for count in [7, 9, 11, 14, 17] {
        let mesh = jiggled_box(count)?;
        let surface = Surface::extract(&mesh, &FeatureSettings::default())?;
        let operator = VolumeOperator::new(&mesh, surface.vertices(), &Deform::default())?;
        let motion = motion(&mesh, surface.vertices());
        let (matrix, right_side) =
            operator.coupled_equations(&motion).ok_or("the operator is not elastic")?;
        let matrix = Arc::new(matrix);
        let mut solution = vec![[0.0; 3]; right_side.len()];
        let tolerance = Tolerance { relative: 1e-8, absolute: 0.0 };
        let unknowns = 3 * right_side.len();
        for direct in [true, false] {
            let (mut set_up, mut solve) = (Times::new(), Times::new());
            for _ in 0..RUNS {
                let solver = set_up.of(|| -> Result<Box<dyn LinearSolver<3>>, LinearError> {
                    Ok(if direct {
                        Box::new(Cholesky::new(Arc::clone(&matrix))?)
                    } else {
                        Box::new(Multigrid::new(Arc::clone(&matrix), MultigridSettings::default())?)
                    })
                })?;
                solve.of(|| solver.solve(&right_side, &mut solution, tolerance))?;
            }
            let name = if direct { "Cholesky" } else { "multigrid" };
            for (what, times) in [("set-up", set_up), ("solve", solve)] {
                report
                    .rows
                    .push(Row::new(format!("{unknowns} unknowns, {name}, {what}"), times.median()));
            }
        }
    }
    Ok(())
}

/// A box whose four sides slide, with rigid bodies in the hierarchy and without.
fn sliding_sides(report: &mut Report) -> Result<(), Box<dyn Error>> {
    let mesh = jiggled_box(34)?;
    let (mut held, mut sliding) = (Vec::new(), Vec::new());
    for (vertex, point) in (0..).zip(mesh.points()) {
        if point[2] == 0.0 || point[2] == 1.0 {
            held.push(vertex);
            continue;
        }
        for (axis, &x) in point.iter().enumerate().take(2).filter(|(_, x)| **x == 0.0 || **x == 1.0)
        {
            let mut normal = [0.0; 3];
            normal[axis] = 2.0 * x - 1.0;
            sliding.push(Sliding { vertex, normal });
        }
    }
    let operator =
        VolumeOperator::with_sliding(&mesh, &held, &sliding, &Deform::default(), &BuiltIn)?;
    let motion = motion(&mesh, &held);
    let (matrix, right_side) =
        operator.coupled_equations(&motion).ok_or("the operator is not elastic")?;
    let (matrix, tets) = (Arc::new(matrix.clone()), mesh.cells().len());
    let tolerance = Tolerance { relative: TOLERANCE, absolute: 0.0 };
    for bodies in [false, true] {
        let (mut set_up, mut solve, mut iterations) = (Times::new(), Times::new(), 0);
        for _ in 0..RUNS {
            let settings = MultigridSettings::default();
            let solver = set_up.of(|| match bodies {
                true => Multigrid::with_rigid_bodies(
                    Arc::clone(&matrix),
                    operator.unknown_points(),
                    settings,
                ),
                false => Multigrid::new(Arc::clone(&matrix), settings),
            })?;
            let mut solution = vec![[0.0; 3]; right_side.len()];
            iterations =
                solve.of(|| solver.solve(&right_side, &mut solution, tolerance))?.iterations;
        }
        let name = if bodies { "with rigid bodies" } else { "without rigid bodies" };
        for (what, times) in
            [("set-up".into(), set_up), (format!("solve, {iterations} iterations"), solve)]
        {
            report.rows.push(Row::new(
                format!("sliding sides, {tets} tets, {name}, {what}"),
                times.median(),
            ));
        }
    }
    Ok(())
}

/// The equations in PETSc's binary format: big-endian, numbered from 0.
fn write_system(file: &Path, ours: &Elasticity) -> std::io::Result<()> {
    const MATRIX: i32 = 1_211_216;
    const VECTOR: i32 = 1_211_214;
    let mut out = BufWriter::new(File::create(file)?);
    let matrix = &ours.matrix;
    let count = |value: usize| i32::try_from(value).map_err(std::io::Error::other);
    let rows = 3 * matrix.rows();
    for value in [MATRIX, count(rows)?, count(rows)?, count(9 * matrix.columns().len())?] {
        out.write_all(&value.to_be_bytes())?;
    }
    for row in 0..rows {
        out.write_all(&count(3 * matrix.row(row / 3).0.len())?.to_be_bytes())?;
    }
    for row in 0..rows {
        for &column in matrix.row(row / 3).0 {
            for axis in 0..3 {
                out.write_all(&count(3 * column as usize + axis)?.to_be_bytes())?;
            }
        }
    }
    for row in 0..rows {
        for value in matrix.row(row / 3).1.iter().flat_map(|block| block[row % 3]) {
            out.write_all(&value.to_be_bytes())?;
        }
    }
    for vector in [&ours.right_side, &ours.places] {
        for value in [VECTOR, count(rows)?] {
            out.write_all(&value.to_be_bytes())?;
        }
        for value in vector.as_flattened() {
            out.write_all(&value.to_be_bytes())?;
        }
    }
    out.flush()
}

/// The seconds that PETSc took, and its solution.
struct Peer {
    set_up: f64,
    solve: f64,
    iterations: usize,
    solution: Vec<f64>,
}

fn petsc(system: &Path, solver: &str) -> Result<Peer, Box<dyn Error>> {
    let mut command = peer::on_ranks(2);
    command
        .arg("/usr/bin/python3")
        .arg(project().join("benchmarks/peers/petsc.py"))
        .arg(system)
        .arg(solver);
    let printed = peer::run(command.env("OMP_NUM_THREADS", "1"))?;
    let [set_up, solve, iterations] = peer::answer(&printed)?.split(' ').collect::<Vec<_>>()[..]
    else {
        return Err(format!("PETSc gave no three figures: {printed}").into());
    };
    let bytes = std::fs::read(system.with_extension(solver))?;
    let values = bytes.get(8..).ok_or("PETSc wrote no solution")?.as_chunks::<8>().0;
    let solution = values.iter().map(|&bytes| f64::from_be_bytes(bytes)).collect();
    Ok(Peer {
        set_up: set_up.parse()?,
        solve: solve.parse()?,
        iterations: iterations.parse()?,
        solution,
    })
}
