//! `surface-wasm`: the polyharmonic deformation in the viewer's WebAssembly module, in Node, beside
//! the native kernel.

use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::time::Instant;

use serde::Deserialize;
use serde_json::{Value, json};
use tombolo::deform::edit::{Edit, Editor};
use tombolo::deform::features::FeatureSettings;
use tombolo::deform::surface::Surface;
use tombolo::pipelines::encode::encode_surface;
use tombolo::pipelines::files::read_mesh;
use tombolo_tests::project;

use crate::measure::{RUNS, Times};
use crate::peer::{self, apart, numbers};
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

/// The figures that `viewer/wasm/run.mjs` prints.
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
    let directory = tempfile::tempdir()?;
    let surface = Arc::new(torus(directory.path())?);
    let module = project().join("viewer/wasm/pkg/kernel.wasm");
    if !module.exists() {
        return Err(format!("{} is not there; run scripts/setup", module.display()).into());
    }
    let [frame, input, output] =
        ["surface", "json", "bin"].map(|kind| directory.path().join(format!("torus.{kind}")));
    fs::write(&frame, encode_surface(&surface)?)?;
    let free = free(&surface);
    let size = surface.points().len();
    let name = format!("torus, {size} vertices, {:.0} % free", 100.0 * free as f64 / size as f64);
    let (mut rows, mut targets, mut most_memory) = (Vec::new(), Vec::new(), 0);
    for order in 1..=3 {
        let stacks: Vec<Value> = (0..=DRAGS).map(|drag| stack(order, drag)).collect();
        fs::write(&input, json!(stacks).to_string())?;
        let mut ran = Vec::new();
        for _ in 0..RUNS {
            ran.push(in_node([&module, &frame, &input, &output], true)?);
        }
        let (mut native_cold, mut native_drag, mut most_apart) =
            (Times::new(), Times::new(), 0.0_f64);
        let displacements = numbers(&fs::read(&output)?);
        for _ in 0..RUNS {
            let start = Instant::now();
            let mut editor = Editor::new(Arc::clone(&surface))?;
            let mut theirs = displacements.chunks_exact(3 * size);
            for (drag, stack) in stacks.iter().enumerate() {
                let edits: Vec<Edit> = serde_json::from_value(stack.clone())?;
                let begun = Instant::now();
                let ours = editor.displacement(&edits)?;
                match drag {
                    0 => native_cold.add(start.elapsed().as_secs_f64()),
                    _ => native_drag.add(begun.elapsed().as_secs_f64()),
                }
                let theirs = theirs.next().ok_or("the module stopped early")?;
                most_apart = most_apart.max(apart(theirs, ours.as_flattened()));
            }
        }
        let of_module =
            |value: &dyn Fn(&Ran) -> f64| ran.iter().map(value).collect::<Times>().median();
        let compile = of_module(&|ran| ran.compile);
        let cold = of_module(&cold_of);
        let mut at_once = Times::new();
        for _ in 0..RUNS {
            at_once.add(cold_of(&in_node([&module, &frame, &input, &output], false)?));
        }
        let drag = of_module(&|ran| ran.stacks.iter().skip(1).copied().collect::<Times>().median());
        most_memory = most_memory.max(ran.iter().map(|ran| ran.memory).max().unwrap_or(0));
        let (native_cold, native_drag) = (native_cold.median(), native_drag.median());
        if order == 1 {
            rows.push(Row::new(format!("{name}: compile the module"), compile));
            rows.push(Row::new(
                "rehearse, once, while nobody waits",
                of_module(&|ran| ran.rehearse),
            ));
        }
        rows.push(Row::new(
            format!("order {order}, cold, module, not rehearsed"),
            at_once.median(),
        ));
        for (what, module, native) in [("cold", cold, native_cold), ("drag", drag, native_drag)] {
            rows.push(Row::new(format!("order {order}, {what}, module"), module));
            rows.push(Row::new(format!("order {order}, {what}, native"), native));
        }
        if order == 2 {
            targets.push(Target::at_most("order 2, cold [s]", cold, 0.2));
            targets.push(Target::at_most("order 2, drag [s]", drag, 0.016));
        }
        for (what, module, native) in [("cold", cold, native_cold), ("drag", drag, native_drag)] {
            targets.push(Target::at_most(
                format!("order {order}, {what}: module / native"),
                module / native,
                4.0,
            ));
        }
        targets.push(Target::at_most(
            format!("order {order}: apart, of the motion"),
            most_apart,
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

fn torus(directory: &Path) -> Result<Surface, Box<dyn Error>> {
    let file = directory.join("torus.msh");
    peer::run(peer::python().args(["-c", TORUS]).arg(&file).arg(SIZE))?;
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

fn in_node(files: [&PathBuf; 4], rehearsed: bool) -> Result<Ran, Box<dyn Error>> {
    let run = project().join("viewer/wasm/run.mjs");
    let rehearse = if rehearsed { "1" } else { "0" };
    let printed = peer::run(Command::new("node").env("REHEARSE", rehearse).arg(run).args(files))?;
    Ok(serde_json::from_str(&printed)?)
}
