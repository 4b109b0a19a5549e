//! Volume motion: seconds at the sizes of the paper's meshes, beside the paper's own and beside PETSc on the same matrix.

use std::error::Error;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use tombolo::deform::linear::{LinearSolver, Multigrid, MultigridSettings, SparseMatrix, Tolerance};
use tombolo::deform::mesh::{Mesh, Vector};
use tombolo::deform::shapes::box_of_tets;
use tombolo::deform::surface::{FeatureSettings, Surface};
use tombolo::deform::volume::{Deform, Method, VolumeOperator};
use tombolo::pipelines::files;

use crate::measure::{memory_peak, middle};
use crate::report::{Report, Row, Target};

/// Runs of each of our own measurements.
const RUNS: usize = 5;

const TOLERANCE: f64 = 1e-6;

/// The paper's table: elements, processes, milliseconds to allocate and assemble the matrix and to solve.
const PAPER: [(&str, usize, f64, f64); 5] = [
    ("mesh 0", 12, 40.0 + 441.0, 23.0),
    ("mesh 1", 24, 71.0 + 573.0, 22.0),
    ("mesh 2", 48, 154.0 + 943.0, 30.0),
    ("mesh 3", 96, 102.0 + 1163.0, 46.0),
    ("mesh 4", 256, 579.0 + 3925.0, 131.0),
];

/// Runs the benchmark: some minutes, and once some more to make the meshes.
///
/// # Errors
/// Whatever the parts fail with; nothing is skipped.
pub fn run() -> Result<Report, Box<dyn Error>> {
    let mut report = Report { rows: Vec::new(), targets: Vec::new() };
    for (number, &(name, processes, allocate_and_assemble, solve)) in PAPER.iter().enumerate() {
        let mesh = mesh(number)?;
        let tets = mesh.cells().len();
        let surface = Surface::extract(&mesh, &FeatureSettings::default())?;
        let motion = motion(&mesh, surface.vertices());
        let case = |what: &str| format!("{name}, {tets} tets, {what}");
        let mut push = |what: &str, seconds: f64| {
            report.rows.push(Row { case: case(what), seconds, steps: None });
        };
        push(&format!("paper on {processes} processes, allocate and assemble"), 1e-3 * allocate_and_assemble);
        push(&format!("paper on {processes} processes, solve"), 1e-3 * solve);

        let ours = elasticity(&mesh, surface.vertices(), &motion)?;
        push("elasticity, assembly", ours.assembly);
        push("elasticity, set-up", ours.set_up);
        push("elasticity, first order", ours.solve);
        push("elasticity, later order", ours.later);
        push("elasticity, cells moved: assembly and set-up again", ours.updated);
        let harmonic = harmonic(&mesh, surface.vertices(), &motion)?;
        push("harmonic, assembly and set-up", harmonic.0);
        push("harmonic, one component", harmonic.1);
        push("harmonic, three components", harmonic.2);

        let folder = tempfile::tempdir()?;
        let file = folder.path().join("system");
        write_system(&file, &ours)?;
        let mut worst: f64 = 0.0;
        let mut quickest = f64::INFINITY;
        for solver in ["icc", "gamg"] {
            let peer = petsc(&file, solver)?;
            push(&format!("PETSc {solver} on 2 ranks, set-up"), peer.set_up);
            push(&format!("PETSc {solver} on 2 ranks, solve, {} iterations", peer.iterations), peer.solve);
            worst = worst.max(difference(&ours.solution, &peer.solution));
            quickest = quickest.min(peer.set_up + peer.solve);
        }
        report.targets.push(Target::at_most(&case("difference from PETSc"), worst, 1e-5));
        let ratio = (ours.set_up + ours.solve) / quickest;
        report.targets.push(Target::at_most(&case("set-up and solve by PETSc's quickest"), ratio, 1.0));
        if number + 1 == PAPER.len() {
            let cold = ours.assembly + ours.set_up + ours.solve;
            report.targets.push(Target::at_most(&case("elasticity, cold [s]"), cold, 2.0));
            report.targets.push(Target::at_most(
                &case("elasticity, set-up and solve [s]"),
                ours.set_up + ours.solve,
                1.3,
            ));
            report.targets.push(Target::at_most(&case("elasticity, later order [s]"), ours.later, 0.5));
            report.targets.push(Target::at_most(&case("harmonic, one component [s]"), harmonic.1, 0.4));
            report.targets.push(Target::at_most(&case("harmonic, cold [s]"), harmonic.0 + harmonic.1, 0.4));
            report.targets.push(Target::at_most("peak memory [GB]", memory_peak()? / 1e9, 3.0));
        }
    }
    Ok(report)
}

/// What elasticity took, and its equations.
struct Elasticity {
    assembly: f64,
    set_up: f64,
    solve: f64,
    later: f64,
    updated: f64,
    matrix: SparseMatrix<3>,
    places: Vec<Vector>,
    right_side: Vec<Vector>,
    solution: Vec<Vector>,
}

fn elasticity(mesh: &Mesh, boundary: &[u32], motion: &[Vector]) -> Result<Elasticity, Box<dyn Error>> {
    let settings = Deform { tolerance: TOLERANCE, ..Deform::default() };
    let (mut whole, mut set_up, mut first, mut later, mut updated) = (vec![], vec![], vec![], vec![], vec![]);
    let mut kept = None;
    for _ in 0..RUNS {
        drop(kept.take());
        let start = Instant::now();
        let operator = VolumeOperator::new(mesh, boundary, &settings)?;
        whole.push(start.elapsed().as_secs_f64());
        for times in [&mut first, &mut later] {
            let start = Instant::now();
            operator.solve(motion)?;
            times.push(start.elapsed().as_secs_f64());
        }
        let start = Instant::now();
        operator.updated(mesh)?;
        updated.push(start.elapsed().as_secs_f64());
        // The solver once more, by itself, to tell its set-up from the assembly.
        let (matrix, _) = operator.coupled_equations(motion).ok_or("the operator is not elastic")?;
        let matrix = std::sync::Arc::new(matrix.clone());
        let start = Instant::now();
        Multigrid::<3>::new(matrix, MultigridSettings::default())?;
        set_up.push(start.elapsed().as_secs_f64());
        kept = Some(operator);
    }
    let operator = kept.ok_or("nothing was run")?;
    let (matrix, right_side) = operator.coupled_equations(motion).ok_or("the operator is not elastic")?;
    let mut solution = vec![[0.0; 3]; right_side.len()];
    let tolerance = Tolerance { relative: TOLERANCE, absolute: 0.0 };
    Multigrid::<3>::new(matrix.clone(), MultigridSettings::default())?.solve(&right_side, &mut solution, tolerance)?;
    let set_up = middle(&mut set_up);
    Ok(Elasticity {
        assembly: middle(&mut whole) - set_up,
        set_up,
        solve: middle(&mut first),
        later: middle(&mut later),
        updated: middle(&mut updated),
        matrix: matrix.clone(),
        places: operator.unknown_points().to_vec(),
        right_side,
        solution,
    })
}

/// Seconds of set-up, of a solve for one component and for three.
fn harmonic(mesh: &Mesh, boundary: &[u32], motion: &[Vector]) -> Result<(f64, f64, f64), Box<dyn Error>> {
    let settings = Deform { method: Method::Harmonic, tolerance: TOLERANCE, ..Deform::default() };
    let along: Vec<Vector> = motion.iter().map(|value| [0.0, 0.0, value[2]]).collect();
    let (mut set_up, mut one, mut three) = (vec![], vec![], vec![]);
    for _ in 0..RUNS {
        let start = Instant::now();
        let operator = VolumeOperator::new(mesh, boundary, &settings)?;
        set_up.push(start.elapsed().as_secs_f64());
        for (times, motion) in [(&mut one, &along[..]), (&mut three, motion)] {
            let start = Instant::now();
            operator.solve(motion)?;
            times.push(start.elapsed().as_secs_f64());
        }
    }
    Ok((middle(&mut set_up), middle(&mut one), middle(&mut three)))
}

/// The bypass at four sizes, made once and kept under `meshes/`; the largest is a box with as many tetrahedra, its inner vertices
/// moved about, because the bypass takes a quarter of an hour to mesh.
fn mesh(number: usize) -> Result<Mesh, Box<dyn Error>> {
    if number == 4 {
        let mesh = box_of_tets([60; 3], [0.0; 3], [1.0; 3]);
        let mut state = 1u64;
        let mut noise = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            #[expect(clippy::cast_precision_loss, reason = "31 bits")]
            (0.3 / 60.0 * ((state >> 33) as f64 / (1u64 << 31) as f64 - 0.5))
        };
        let inside = |point: &Vector| point.iter().all(|&x| x > 0.0 && x < 1.0);
        let points = mesh.points().iter();
        let points = points.map(|point| if inside(point) { point.map(|x| x + noise()) } else { *point }).collect();
        return Ok(mesh.with_points(points)?);
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let name = format!("bypass-{number}");
    let file = root.join("meshes").join(format!("{name}.msh"));
    if !file.exists() {
        eprintln!("making {}", file.display());
        let status =
            Command::new(root.join(".venv/bin/python")).arg(root.join("scripts/meshes")).arg(&name).status()?;
        if !status.success() {
            return Err(format!("scripts/meshes {name} failed; scripts/setup installs what it needs").into());
        }
    }
    Ok(files::read_mesh(&file)?.mesh)
}

/// A smooth motion by up to a tenth of the domain.
fn motion(mesh: &Mesh, boundary: &[u32]) -> Vec<Vector> {
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
        return Err(format!("PETSc failed; `scripts/setup --benchmarks` installs it: {text}{message}").into());
    };
    let bytes = std::fs::read(system.with_extension(solver))?;
    let values = bytes.get(8..).ok_or("PETSc wrote no solution")?.as_chunks::<8>().0;
    let solution = values.iter().map(|&bytes| f64::from_be_bytes(bytes)).collect();
    Ok(Peer { set_up: set_up.parse()?, solve: solve.parse()?, iterations: iterations.parse()?, solution })
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
