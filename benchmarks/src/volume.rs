//! Volume motion: seconds at the sizes of the paper's meshes, beside the paper's own and beside PETSc on the same matrix.

use std::error::Error;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::time::Instant;

use tombolo::deform::linear::{
    Cholesky, LinearSolver, Multigrid, MultigridSettings, SparseMatrix, Tolerance,
};
use tombolo::deform::mesh::{Mesh, Vector};
use tombolo::deform::shapes::box_of_tets;
use tombolo::deform::surface::{FeatureSettings, Surface};
use tombolo::deform::volume::{Deform, Method, Sliding, VolumeOperator};
use tombolo::pipelines::files;

use crate::measure::{memory_peak, middle, processor_seconds};
use crate::report::{Report, Row, Target};

/// Runs of each of our own measurements.
const RUNS: usize = 5;

pub const TOLERANCE: f64 = 1e-6;

/// The paper's table: elements, processes, milliseconds to allocate and assemble the matrix and to solve.
const PAPER: [(&str, usize, f64, f64); 5] = [
    ("mesh 0", 12, 40.0 + 441.0, 23.0),
    ("mesh 1", 24, 71.0 + 573.0, 22.0),
    ("mesh 2", 48, 154.0 + 943.0, 30.0),
    ("mesh 3", 96, 102.0 + 1163.0, 46.0),
    ("mesh 4", 256, 579.0 + 3925.0, 131.0),
];

/// The threads of everything measured, as many as PETSc has ranks.
pub const THREADS: usize = 2;

/// Runs the benchmark: some minutes.
///
/// # Errors
/// Whatever the parts fail with; nothing is skipped.
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
            report.rows.push(Row { case: case(what), seconds, steps: None });
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
            worst = worst.max(difference(&ours.solution, &peer.solution));
            quickest = quickest.min(peer.set_up + peer.solve);
        }
        report.targets.push(Target::at_most(&case("difference from PETSc"), worst, 1e-5));
        let ratio = (ours.set_up + ours.solve) / quickest;
        report.targets.push(Target::at_most(
            &case("set-up and solve by PETSc's quickest"),
            ratio,
            1.0,
        ));
        #[cfg(feature = "distributed")]
        on_ranks(number, &case, folder.path(), &mut report)?;
        if number + 1 == PAPER.len() {
            let cold = ours.assembly + ours.set_up + ours.solve;
            report.targets.push(Target::at_most(&case("elasticity, cold [s]"), cold, 2.0));
            report.targets.push(Target::at_most(
                &case("elasticity, cold, half the processor seconds"),
                0.5 * ours.processor,
                2.0,
            ));
            report.targets.push(Target::at_most(
                &case("elasticity, set-up and solve [s]"),
                ours.set_up + ours.solve,
                1.3,
            ));
            report.targets.push(Target::at_most(
                &case("elasticity, later order [s]"),
                ours.later,
                0.5,
            ));
            let later = harmonic.three;
            report.targets.push(Target::at_most(
                &case("harmonic, later order, three components [s]"),
                later,
                0.4,
            ));
            let cold = harmonic.set_up + harmonic.one;
            report.targets.push(Target::at_most(
                &case("harmonic, set-up and solve [s]"),
                cold,
                0.4,
            ));
            let cold = harmonic.assembly + cold;
            report.targets.push(Target::at_most(
                &case("harmonic, cold, with assembly [s]"),
                cold,
                0.4,
            ));
            report.targets.push(Target::at_most("peak memory [GB]", memory_peak()? / 1e9, 3.0));
        }
    }
    Ok(report)
}

/// PETSc on the ranks of MPI, with a part of the mesh each, beside the shared-memory solver.
#[cfg(feature = "distributed")]
fn on_ranks(
    number: usize,
    case: &dyn Fn(&str) -> String,
    folder: &Path,
    report: &mut Report,
) -> Result<(), Box<dyn Error>> {
    use crate::volume_ranks::{OnRanks, started, write_displacement};

    let file = folder.join("displacement");
    write_displacement(&file, number)?;
    for ranks in [1, 2] {
        let found = started(number, ranks, &file)?;
        for OnRanks { solver, set_up, first, later, iterations, .. } in &found {
            let on = format!("{solver}, parts on {ranks} rank(s)");
            let stages = [
                ("assembly and set-up".to_owned(), set_up),
                (format!("first order, {iterations} iterations"), first),
                ("later order".to_owned(), later),
            ];
            for (what, &seconds) in stages {
                report.rows.push(Row {
                    case: case(&format!("{on}, {what}")),
                    seconds,
                    steps: None,
                });
            }
        }
        let worst = found.iter().map(|solver| solver.difference).fold(0.0, f64::max);
        let on = case(&format!("{ranks} rank(s), difference from the shared-memory solver"));
        report.targets.push(Target::at_most(&on, worst, 1e-6));
        let cold = |solver: &OnRanks| solver.set_up + solver.first;
        let petsc = || found.iter().filter(|solver| solver.solver.starts_with("PETSc"));
        let quickest = petsc().map(cold).fold(f64::INFINITY, f64::min);
        let default = petsc().find(|solver| solver.is_default).map_or(f64::INFINITY, cold);
        let on = case(&format!("{ranks} rank(s), PETSc as it is by default by its quickest"));
        report.targets.push(Target::at_most(&on, default / quickest, 1.0));
    }
    Ok(())
}

/// What elasticity took, and its equations.
struct Elasticity {
    assembly: f64,
    set_up: f64,
    solve: f64,
    later: f64,
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
    let (mut whole, mut set_up, mut first, mut later, mut updated) =
        (vec![], vec![], vec![], vec![], vec![]);
    let mut processor = vec![];
    let mut kept = None;
    for _ in 0..RUNS {
        drop(kept.take());
        let (start, before) = (Instant::now(), processor_seconds()?);
        let operator = VolumeOperator::new(mesh, boundary, &settings)?;
        whole.push(start.elapsed().as_secs_f64());
        for times in [&mut first, &mut later] {
            let start = Instant::now();
            operator.solve(motion)?;
            if times.len() == processor.len() {
                processor.push(processor_seconds()? - before);
            }
            times.push(start.elapsed().as_secs_f64());
        }
        let start = Instant::now();
        operator.updated(mesh)?;
        updated.push(start.elapsed().as_secs_f64());
        // The solver once more, by itself, to tell its set-up from the assembly.
        let (matrix, _) =
            operator.coupled_equations(motion).ok_or("the operator is not elastic")?;
        let matrix = Arc::new(matrix.clone());
        let start = Instant::now();
        Multigrid::<3>::new(matrix, MultigridSettings::default())?;
        set_up.push(start.elapsed().as_secs_f64());
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
    let set_up = middle(&mut set_up);
    Ok(Elasticity {
        assembly: middle(&mut whole) - set_up,
        set_up,
        solve: middle(&mut first),
        later: middle(&mut later),
        updated: middle(&mut updated),
        processor: middle(&mut processor),
        matrix: matrix.clone(),
        places: operator.unknown_points().to_vec(),
        right_side,
        solution,
    })
}

/// What a harmonic displacement took.
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
    let (mut whole, mut set_up, mut one, mut three, mut processor) =
        (vec![], vec![], vec![], vec![], vec![]);
    for _ in 0..RUNS {
        let (start, before) = (Instant::now(), processor_seconds()?);
        let operator = VolumeOperator::new(mesh, boundary, &settings)?;
        whole.push(start.elapsed().as_secs_f64());
        for (times, motion) in [(&mut one, &along[..]), (&mut three, motion)] {
            let start = Instant::now();
            operator.solve(motion)?;
            if times.len() == processor.len() {
                processor.push(processor_seconds()? - before);
            }
            times.push(start.elapsed().as_secs_f64());
        }
        // The solver once more, by itself, to tell its set-up from the assembly.
        let matrix = operator.separate_matrix().ok_or("the operator is not harmonic")?;
        let matrix = Arc::new(matrix.clone());
        let start = Instant::now();
        Multigrid::<1>::new(matrix, MultigridSettings::default())?;
        set_up.push(start.elapsed().as_secs_f64());
    }
    let set_up = middle(&mut set_up);
    Ok(Harmonic {
        assembly: middle(&mut whole) - set_up,
        set_up,
        one: middle(&mut one),
        three: middle(&mut three),
        processor: middle(&mut processor),
    })
}

/// Small systems, factored and by multigrid: where one overtakes the other is where [`tombolo::deform::linear::solver`] changes over.
fn small_systems(report: &mut Report) -> Result<(), Box<dyn Error>> {
    for count in [7, 9, 11, 14, 17] {
        let mesh = jiggled_box(count)?;
        let surface = Surface::extract(&mesh, &FeatureSettings::default())?;
        let operator = VolumeOperator::new(&mesh, surface.vertices(), &Deform::default())?;
        let motion = motion(&mesh, surface.vertices());
        let (matrix, right_side) =
            operator.coupled_equations(&motion).ok_or("the operator is not elastic")?;
        let matrix = Arc::new(matrix.clone());
        let mut solution = vec![[0.0; 3]; right_side.len()];
        let tolerance = Tolerance { relative: 1e-8, absolute: 0.0 };
        let unknowns = 3 * right_side.len();
        for direct in [true, false] {
            let (mut set_up, mut solve) = (vec![], vec![]);
            for _ in 0..RUNS {
                let start = Instant::now();
                let solver: Box<dyn LinearSolver<3>> = if direct {
                    Box::new(Cholesky::new(Arc::clone(&matrix))?)
                } else {
                    Box::new(Multigrid::new(Arc::clone(&matrix), MultigridSettings::default())?)
                };
                set_up.push(start.elapsed().as_secs_f64());
                let start = Instant::now();
                solver.solve(&right_side, &mut solution, tolerance)?;
                solve.push(start.elapsed().as_secs_f64());
            }
            let name = if direct { "Cholesky" } else { "multigrid" };
            for (what, mut times) in [("set-up", set_up), ("solve", solve)] {
                let case = format!("{unknowns} unknowns, {name}, {what}");
                report.rows.push(Row { case, seconds: middle(&mut times), steps: None });
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
    let operator = VolumeOperator::with_sliding(&mesh, &held, &sliding, &Deform::default())?;
    let motion = motion(&mesh, &held);
    let (matrix, right_side) =
        operator.coupled_equations(&motion).ok_or("the operator is not elastic")?;
    let (matrix, tets) = (Arc::new(matrix.clone()), mesh.cells().len());
    let tolerance = Tolerance { relative: TOLERANCE, absolute: 0.0 };
    for bodies in [false, true] {
        let (mut set_up, mut solve, mut iterations) = (vec![], vec![], 0);
        for _ in 0..RUNS {
            let settings = MultigridSettings::default();
            let start = Instant::now();
            let solver = if bodies {
                Multigrid::with_rigid_bodies(
                    Arc::clone(&matrix),
                    operator.unknown_points(),
                    settings,
                )?
            } else {
                Multigrid::new(Arc::clone(&matrix), settings)?
            };
            set_up.push(start.elapsed().as_secs_f64());
            let mut solution = vec![[0.0; 3]; right_side.len()];
            let start = Instant::now();
            iterations = solver.solve(&right_side, &mut solution, tolerance)?.iterations;
            solve.push(start.elapsed().as_secs_f64());
        }
        let name = if bodies { "with rigid bodies" } else { "without rigid bodies" };
        for (what, mut times) in
            [("set-up".into(), set_up), (format!("solve, {iterations} iterations"), solve)]
        {
            let case = format!("sliding sides, {tets} tets, {name}, {what}");
            report.rows.push(Row { case, seconds: middle(&mut times), steps: None });
        }
    }
    Ok(())
}

/// The paper's bypass where `scripts/meshes` has made it already (the largest takes it a quarter of an hour); else a box with as
/// many tetrahedra, made in a moment.
pub fn mesh(number: usize) -> Result<(String, Mesh), Box<dyn Error>> {
    let name = format!("bypass-{number}");
    let directory = std::env::var_os("TOMBOLO_MESHES")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../meshes"), PathBuf::from);
    let file = directory.join(format!("{name}.msh"));
    if file.exists() {
        return Ok((name, files::read_mesh(&file)?.mesh));
    }
    let counts = [22, 27, 34, 43, 60];
    Ok(("box".into(), jiggled_box(*counts.get(number).ok_or("the paper has five meshes")?)?))
}

/// A box of `6 count³` tetrahedra, its inner vertices moved about.
fn jiggled_box(count: usize) -> Result<Mesh, Box<dyn Error>> {
    let mesh = box_of_tets([count; 3], [0.0; 3], [1.0; 3]);
    let mut state = 1u64;
    #[expect(clippy::cast_precision_loss, reason = "31 bits")]
    let mut noise = move || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        0.3 / count as f64 * ((state >> 33) as f64 / (1u64 << 31) as f64 - 0.5)
    };
    let inside = |point: &Vector| point.iter().all(|&x| x > 0.0 && x < 1.0);
    let points = mesh.points().iter();
    let points = points
        .map(|point| if inside(point) { point.map(|x| x + noise()) } else { *point })
        .collect();
    Ok(mesh.with_points(points)?)
}

/// A smooth motion by up to a tenth of the domain.
pub fn motion(mesh: &Mesh, boundary: &[u32]) -> Vec<Vector> {
    let points = || boundary.iter().map(|&vertex| mesh.points()[vertex as usize]);
    let bound = |start: f64, pick: fn(f64, f64) -> f64| {
        points().fold([start; 3], |a, b| std::array::from_fn(|axis| pick(a[axis], b[axis])))
    };
    let (lower, upper) = (bound(f64::INFINITY, f64::min), bound(f64::NEG_INFINITY, f64::max));
    let size = (0..3).map(|axis| upper[axis] - lower[axis]).fold(0.0, f64::max);
    points()
        .map(|point| {
            let [x, y, z] = std::array::from_fn(|axis| (point[axis] - lower[axis]) / size);
            [(3.0 * y).sin(), 0.4 * (5.0 * x).cos(), x * z].map(|value| 0.1 * size * value)
        })
        .collect()
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

/// What PETSc took.
struct Peer {
    set_up: f64,
    solve: f64,
    iterations: usize,
    solution: Vec<f64>,
}

fn petsc(system: &Path, solver: &str) -> Result<Peer, Box<dyn Error>> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("peers/petsc.py");
    let output = Command::new("mpirun")
        .args(["--allow-run-as-root", "--oversubscribe", "-n", "2", "/usr/bin/python3"])
        .args([&script, &PathBuf::from(system), &PathBuf::from(solver)])
        .env("OMP_NUM_THREADS", "1")
        .output()
        .map_err(|error| format!("mpirun: {error}; `scripts/setup --benchmarks` installs it"))?;
    let text = String::from_utf8_lossy(&output.stdout);
    let line = text.lines().find_map(|line| line.strip_prefix("tombolo ")).unwrap_or_default();
    let [set_up, solve, iterations] = line.split(' ').collect::<Vec<_>>()[..] else {
        let message = String::from_utf8_lossy(&output.stderr);
        return Err(format!(
            "PETSc failed; `scripts/setup --benchmarks` installs it: {text}{message}"
        )
        .into());
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

/// The largest difference of any component, by the largest component.
fn difference(ours: &[Vector], theirs: &[f64]) -> f64 {
    let ours = ours.as_flattened();
    if ours.len() != theirs.len() {
        return f64::INFINITY;
    }
    let largest = theirs.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
    ours.iter().zip(theirs).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / largest
}
