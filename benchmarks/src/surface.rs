//! `surface`: polyharmonic deformation of tori beside libigl's `harmonic`, on the same triangles.

use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::time::Instant;

use serde_json::json;
use tombolo::deform::mesh::Vector;
use tombolo::deform::surface::{Edit, Editor, FeatureSettings, Surface, check};
use tombolo::pipelines::files::read_mesh;

use crate::measure::middle;
use crate::report::{Report, Row, Target};

/// Vertices of each torus, and runs of libigl on it: the largest takes it half a minute.
const SIZES: [(usize, &str, usize); 3] =
    [(2_000, "2 k", 7), (20_000, "20 k", 5), (200_000, "200 k", 1)];
/// Cold runs of ours.
const RUNS: usize = 5;
/// Drags after the first displacement.
const DRAGS: usize = 41;
/// The handle is what lies beyond this along x, the fixed part the same on the other side: two thirds are free.
const BEYOND: f64 = 1.7;

/// Measures every size at every order: a minute or two, and once as much again to make the tori.
///
/// # Errors
/// Whatever the parts fail with; a peer that is missing is an error.
pub fn run() -> Result<Report, Box<dyn Error>> {
    let project =
        Path::new(env!("CARGO_MANIFEST_DIR")).parent().ok_or("the project is not there")?;
    let mut report = Report { rows: Vec::new(), targets: Vec::new() };
    for (count, name, peer_runs) in SIZES {
        let surface = Arc::new(torus(project, count)?);
        for order in 1..=3 {
            let ours = measure(&surface, order)?;
            let peer = libigl(project, &surface, &ours, order, peer_runs)?;
            let case = |what: &str| format!("{name}, order {order}, {what}");
            let rows = [
                ("cold", ours.cold),
                ("cold, libigl", peer.0),
                ("drag", ours.drag),
                ("surface check", ours.check),
            ];
            for (what, seconds) in rows {
                report.rows.push(Row { case: case(what), seconds, steps: None });
            }
            let mut at_most = |what: &str, value: f64, most: f64| {
                report.targets.push(Target::at_most(&case(what), value, most));
            };
            at_most(
                "cold: ours / libigl",
                ours.cold / peer.0,
                if count == 200_000 { 0.125 } else { 1.0 / 3.0 },
            );
            if count == 200_000 {
                at_most("drag [s]", ours.drag, 0.002);
                if order == 2 {
                    at_most("cold [s]", ours.cold, 0.7);
                }
            }
            at_most("forward error, of the motion", ours.forward_error, 1e-8);
            // With its entries assembled and no refinement, libigl's own error at order 3 is larger.
            at_most("from libigl, of the motion", peer.1, if order == 3 { 1e-3 } else { 1e-6 });
        }
    }
    Ok(report)
}

struct Ours {
    cold: f64,
    drag: f64,
    /// What looking at the surface that it leads to takes.
    check: f64,
    forward_error: f64,
    displacement: Vec<Vector>,
}

fn measure(surface: &Arc<Surface>, order: usize) -> Result<Ours, Box<dyn Error>> {
    let mut cold = Vec::new();
    for _ in 0..RUNS {
        let stack = stack(order, 0)?;
        let start = Instant::now();
        let mut editor = Editor::new(Arc::clone(surface))?;
        editor.displacement(&stack)?;
        cold.push(start.elapsed().as_secs_f64());
    }
    let mut editor = Editor::new(Arc::clone(surface))?;
    let displacement = editor.displacement(&stack(order, 0)?)?;
    let mut drag = Vec::new();
    let mut moved = Vec::new();
    for number in 0..DRAGS {
        let stack = stack(order, number)?;
        let start = Instant::now();
        editor.displacement_into(&stack, &mut moved)?;
        drag.push(start.elapsed().as_secs_f64());
    }
    let points = surface.points();
    let shape: Vec<Vector> = points
        .iter()
        .zip(&displacement)
        .map(|(point, by)| std::array::from_fn(|axis| point[axis] + by[axis]))
        .collect();
    let mut looked = Vec::new();
    for _ in 0..RUNS {
        let start = Instant::now();
        std::hint::black_box(check(surface, points, &shape));
        looked.push(start.elapsed().as_secs_f64());
    }
    let forward_error = editor.forward_error(&stack(order, 0)?)?;
    let [cold, drag, check] = [cold, drag, looked].map(|mut seconds| middle(&mut seconds));
    Ok(Ours { cold, drag, check, forward_error, displacement })
}

fn stack(order: usize, drag: usize) -> Result<Vec<Edit>, serde_json::Error> {
    let region = |sign: f64| json!({"half_space": {"origin": [sign * BEYOND, 0, 0], "normal": [sign, 0, 0]}});
    serde_json::from_value(json!([{ "translate": {
        "region": region(1.0), "fixed_region": region(-1.0), "by": [0.1, 0.2, 0.4 + 0.002 * drag as f64],
        "harmonic_order": order,
    } }]))
}

/// The torus from `meshes/`, made where it is not there.
pub(crate) fn torus(project: &Path, count: usize) -> Result<Surface, Box<dyn Error>> {
    let file = project.join(format!("meshes/torus-{count}.msh"));
    if !file.exists() {
        fs::create_dir_all(project.join("meshes"))?;
        python(project, &["torus".as_ref(), count.to_string().as_ref(), file.as_os_str()])?;
    }
    Ok(Surface::extract(&read_mesh(&file)?.mesh, &FeatureSettings::default())?)
}

/// Seconds that libigl takes, and its largest difference from ours in units of the motion.
fn libigl(
    project: &Path,
    surface: &Surface,
    ours: &Ours,
    order: usize,
    runs: usize,
) -> Result<(f64, f64), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let file = |name: &str| -> PathBuf { folder.path().join(name) };
    let floats = |values: &[f64]| -> Vec<u8> {
        values.iter().flat_map(|value| value.to_le_bytes()).collect()
    };
    let numbers = |values: &[u32]| -> Vec<u8> {
        values.iter().flat_map(|value| value.to_le_bytes()).collect()
    };
    let prescribed: Vec<u32> = (0..surface.points().len())
        .filter(|&vertex| surface.points()[vertex][0].abs() >= BEYOND)
        .map(|vertex| vertex as u32)
        .collect();
    let motion: Vec<f64> =
        prescribed.iter().flat_map(|&vertex| ours.displacement[vertex as usize]).collect();
    fs::write(file("points"), floats(surface.points().as_flattened()))?;
    fs::write(file("triangles"), numbers(surface.triangles().as_flattened()))?;
    fs::write(file("prescribed"), numbers(&prescribed))?;
    fs::write(file("motion"), floats(&motion))?;
    let printed = python(
        project,
        &[
            "harmonic".as_ref(),
            folder.path().as_os_str(),
            order.to_string().as_ref(),
            runs.to_string().as_ref(),
        ],
    )?;
    let mut seconds = printed.lines().map(str::parse).collect::<Result<Vec<f64>, _>>()?;
    let theirs: Vec<f64> = fs::read(file("libigl"))?
        .as_chunks()
        .0
        .iter()
        .map(|&value| f64::from_le_bytes(value))
        .collect();
    let largest = motion.iter().fold(f64::MIN_POSITIVE, |largest, value| largest.max(value.abs()));
    let apart = ours.displacement.as_flattened().iter().zip(&theirs).map(|(a, b)| (a - b).abs());
    Ok((middle(&mut seconds), apart.fold(0.0, f64::max) / largest))
}

fn python(project: &Path, arguments: &[&std::ffi::OsStr]) -> Result<String, Box<dyn Error>> {
    let script = project.join("benchmarks/peers/surface.py");
    let ran =
        Command::new(project.join(".venv/bin/python")).arg(script).args(arguments).output()?;
    if !ran.status.success() {
        let said = String::from_utf8_lossy(&ran.stderr);
        return Err(format!(
            "benchmarks/peers/surface.py failed; `scripts/setup --benchmarks` installs its needs: {said}"
        )
        .into());
    }
    Ok(String::from_utf8(ran.stdout)?)
}
