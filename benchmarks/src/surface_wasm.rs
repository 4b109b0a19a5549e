//! `surface-wasm`: the polyharmonic deformation in the viewer's WebAssembly module, in Node, beside the native kernel.

use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::time::Instant;

use serde::Deserialize;
use serde_json::{Value, json};
use tombolo::deform::mesh::Vector;
use tombolo::deform::surface::{Edit, Editor, FeatureSettings, Surface};
use tombolo::pipelines::encode::encode_surface;
use tombolo::pipelines::files::read_mesh;

use crate::measure::{RUNS, middle};
use crate::report::{Report, Row, Target};

/// A torus whose triangles are about `SIZE` long: 20 000 vertices.
const TORUS: &str = "
import gmsh, sys
gmsh.initialize()
gmsh.option.setNumber('General.Terminal', 0)
gmsh.model.occ.addTorus(0, 0, 0, 1, 0.4)
gmsh.model.occ.synchronize()
gmsh.model.addPhysicalGroup(2, [tag for _, tag in gmsh.model.getEntities(2)], name='torus')
gmsh.option.setNumber('Mesh.MeshSizeMax', float(sys.argv[2]))
gmsh.option.setNumber('Mesh.MeshSizeMin', float(sys.argv[2]))
gmsh.model.mesh.generate(2)
gmsh.write(sys.argv[1])
";
const SIZE: &str = "0.0305";
/// Drags after the first displacement, in one process.
const DRAGS: usize = 40;

/// What `viewer/wasm/run.mjs` prints.
#[derive(Deserialize)]
struct Ran {
    compile: f64,
    rehearse: f64,
    open: f64,
    stacks: Vec<f64>,
    memory: usize,
}

/// From the frame of a surface to its first displacement.
fn cold_of(ran: &Ran) -> f64 {
    ran.open + ran.stacks.first().copied().unwrap_or(f64::NAN)
}

/// Measures one torus at every order.
pub fn run() -> Result<Report, Box<dyn Error>> {
    let project =
        Path::new(env!("CARGO_MANIFEST_DIR")).parent().ok_or("the project is not there")?;
    let directory = tempfile::tempdir()?;
    let surface = Arc::new(torus(project, directory.path())?);
    let module = project.join("viewer/wasm/pkg/kernel.wasm");
    if !module.exists() {
        return Err(format!("{} is not there; run scripts/setup", module.display()).into());
    }
    let [frame, input, output] =
        ["surface", "json", "bin"].map(|kind| directory.path().join(format!("torus.{kind}")));
    fs::write(&frame, encode_surface(&surface)?)?;
    let free = free(&surface);
    let size = surface.points().len();
    let name = format!("torus, {size} vertices, {:.0} % free", 100.0 * free as f64 / size as f64);
    let row = |case: String, seconds: f64| Row { case, seconds, steps: None };
    let (mut rows, mut targets, mut most_memory) = (Vec::new(), Vec::new(), 0);
    for order in 1..=3 {
        let stacks: Vec<Value> = (0..=DRAGS).map(|drag| stack(order, drag)).collect();
        fs::write(&input, json!(stacks).to_string())?;
        let mut ran = Vec::new();
        for _ in 0..RUNS {
            ran.push(in_node(project, [&module, &frame, &input, &output], true)?);
        }
        let (mut native_cold, mut native_drag, mut apart) = (Vec::new(), Vec::new(), 0.0_f64);
        let displacements = read(&output)?;
        for _ in 0..RUNS {
            let start = Instant::now();
            let mut editor = Editor::new(Arc::clone(&surface))?;
            let mut theirs = displacements.chunks_exact(size);
            for (drag, stack) in stacks.iter().enumerate() {
                let edits: Vec<Edit> = serde_json::from_value(stack.clone())?;
                let begun = Instant::now();
                let ours = editor.displacement(&edits)?;
                if drag == 0 {
                    native_cold.push(start.elapsed())
                } else {
                    native_drag.push(begun.elapsed())
                };
                apart =
                    apart.max(distance(&ours, theirs.next().ok_or("the module stopped early")?));
            }
        }
        let seconds = |times: Vec<std::time::Duration>| {
            middle(&mut times.iter().map(std::time::Duration::as_secs_f64).collect::<Vec<_>>())
        };
        let of_module =
            |value: &dyn Fn(&Ran) -> f64| middle(&mut ran.iter().map(value).collect::<Vec<_>>());
        let compile = of_module(&|ran| ran.compile);
        let cold = of_module(&cold_of);
        let mut at_once = Vec::new();
        for _ in 0..RUNS {
            at_once.push(cold_of(&in_node(project, [&module, &frame, &input, &output], false)?));
        }
        let drag =
            of_module(&|ran| middle(&mut ran.stacks.iter().skip(1).copied().collect::<Vec<_>>()));
        most_memory = most_memory.max(ran.iter().map(|ran| ran.memory).max().unwrap_or(0));
        let (native_cold, native_drag) = (seconds(native_cold), seconds(native_drag));
        if order == 1 {
            rows.push(row(format!("{name}: compile the module"), compile));
            rows.push(row(
                "rehearse, once, while nobody waits".into(),
                of_module(&|ran| ran.rehearse),
            ));
        }
        rows.push(row(format!("order {order}, cold, module, not rehearsed"), middle(&mut at_once)));
        for (what, module, native) in [("cold", cold, native_cold), ("drag", drag, native_drag)] {
            rows.push(row(format!("order {order}, {what}, module"), module));
            rows.push(row(format!("order {order}, {what}, native"), native));
        }
        if order == 2 {
            targets.push(Target::at_most("order 2, cold [s]", cold, 0.2));
            targets.push(Target::at_most("order 2, drag [s]", drag, 0.016));
        }
        for (what, module, native) in [("cold", cold, native_cold), ("drag", drag, native_drag)] {
            targets.push(Target::at_most(
                &format!("order {order}, {what}: module / native"),
                module / native,
                4.0,
            ));
        }
        targets.push(Target::at_most(
            &format!("order {order}: apart, of the motion"),
            apart,
            [1e-12, 1e-10, 1e-8][order - 1],
        ));
    }
    targets.push(Target::at_most(
        "memory of the module [MiB]",
        most_memory as f64 / f64::from(1 << 20),
        256.0,
    ));
    Ok(Report { rows, targets })
}

fn torus(project: &Path, directory: &Path) -> Result<Surface, Box<dyn Error>> {
    let file = directory.join("torus.msh");
    let made = Command::new(project.join(".venv/bin/python"))
        .args(["-c", TORUS])
        .arg(&file)
        .arg(SIZE)
        .status()?;
    if !made.success() {
        return Err("gmsh made no torus; scripts/setup installs it".into());
    }
    Ok(Surface::extract(&read_mesh(&file)?.mesh, &FeatureSettings::default())?)
}

/// One side of the torus is the handle, the other is held.
fn stack(order: usize, drag: usize) -> Value {
    let by = 0.3 + 0.002 * drag as f64;
    json!([{"translate": {
        "region": {"half_space": {"origin": [0.9, 0, 0], "normal": [1, 0, 0]}},
        "fixed_region": {"half_space": {"origin": [-0.9, 0, 0], "normal": [-1, 0, 0]}},
        "by": [0.1, 0.05, by], "harmonic_order": order,
    }}])
}

fn free(surface: &Surface) -> usize {
    surface.points().iter().filter(|point| point[0].abs() < 0.9).count()
}

fn in_node(
    project: &Path,
    [module, frame, input, output]: [&PathBuf; 4],
    rehearsed: bool,
) -> Result<Ran, Box<dyn Error>> {
    let run = project.join("viewer/wasm/run.mjs");
    let rehearse = if rehearsed { "1" } else { "0" };
    let ran = Command::new("node")
        .env("REHEARSE", rehearse)
        .arg(run)
        .args([module, frame, input, output])
        .output()?;
    if !ran.status.success() {
        return Err(format!("the module failed: {}", String::from_utf8_lossy(&ran.stderr)).into());
    }
    Ok(serde_json::from_slice(&ran.stdout)?)
}

fn read(path: &Path) -> Result<Vec<Vector>, Box<dyn Error>> {
    let values: Vec<f64> =
        fs::read(path)?.as_chunks().0.iter().map(|&value| f64::from_le_bytes(value)).collect();
    Ok(values.as_chunks().0.to_vec())
}

/// The largest difference of a component, in parts of the largest component.
fn distance(ours: &[Vector], theirs: &[Vector]) -> f64 {
    let largest = ours
        .as_flattened()
        .iter()
        .fold(f64::MIN_POSITIVE, |largest, value| largest.max(value.abs()));
    let apart = ours.as_flattened().iter().zip(theirs.as_flattened()).map(|(a, b)| (a - b).abs());
    apart.fold(0.0, f64::max) / largest
}
