//! `surface`: polyharmonic deformation of tori beside libigl's `harmonic`, on the same triangles.

use std::error::Error;
use std::ffi::OsStr;
use std::fs;
use std::path::PathBuf;
use std::sync::Arc;

use serde_json::json;
use tombolo::deform::edit::{Edit, Editor};
use tombolo::deform::features::FeatureSettings;
use tombolo::deform::mesh::Vector;
use tombolo::deform::surface::{Surface, check};
use tombolo::deform::vector::add;
use tombolo::pipelines::files::read_mesh;
use tombolo_tests::project;

use crate::measure::Times;
use crate::peer::{self, numbers};
use crate::report::{Report, Row, Target};

/// Vertices of each torus, and runs of libigl on it: the largest takes it half a minute.
const SIZES: [(usize, &str, usize); 3] =
    [(2_000, "2 k", 7), (20_000, "20 k", 5), (200_000, "200 k", 1)];
/// Cold runs of ours.
const RUNS: usize = 5;
/// Drags after the first displacement.
const DRAGS: usize = 41;
/// The handle is what lies beyond this along x, the fixed part the same on the other side: two
/// thirds are free.
const BEYOND: f64 = 1.7;

/// Measures every size at every order: a minute or two, and once as much again to make the tori.
///
/// # Errors
/// The first error of a part; a peer that is missing is an error.
pub fn run() -> Result<Report, Box<dyn Error>> {
    let mut report = Report { rows: Vec::new(), targets: Vec::new() };
    for (count, name, peer_runs) in SIZES {
        let surface = Arc::new(torus(count)?);
        for order in 1..=3 {
            let ours = measure(&surface, order)?;
            let peer = libigl(&surface, &ours, order, peer_runs)?;
            let case = |what: &str| format!("{name}, order {order}, {what}");
            let rows = [
                ("cold", ours.cold),
                ("cold, libigl", peer.0),
                ("drag", ours.drag),
                ("surface check", ours.check),
            ];
            for (what, seconds) in rows {
                report.rows.push(Row::new(case(what), seconds));
            }
            let mut at_most = |what: &str, value: f64, most: f64| {
                report.targets.push(Target::at_most(case(what), value, most));
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
            // With its entries assembled and no refinement, libigl's own error at order 3 is
            // larger.
            at_most("from libigl, of the motion", peer.1, if order == 3 { 1e-3 } else { 1e-6 });
        }
    }
    Ok(report)
}

struct Ours {
    cold: f64,
    drag: f64,
    /// The seconds of looking at the surface that it leads to.
    check: f64,
    forward_error: f64,
    displacement: Vec<Vector>,
}

fn measure(surface: &Arc<Surface>, order: usize) -> Result<Ours, Box<dyn Error>> {
    let (mut cold, mut drag, mut looked) = (Times::new(), Times::new(), Times::new());
    for _ in 0..RUNS {
        let stack = stack(order, 0)?;
        // The editor is dropped after the clock has stopped.
        let _editor = cold.of(|| -> Result<Editor, Box<dyn Error>> {
            let mut editor = Editor::new(Arc::clone(surface))?;
            editor.displacement(&stack)?;
            Ok(editor)
        })?;
    }
    let mut editor = Editor::new(Arc::clone(surface))?;
    let displacement = editor.displacement(&stack(order, 0)?)?;
    let mut moved = Vec::new();
    for number in 0..DRAGS {
        let stack = stack(order, number)?;
        drag.of(|| editor.displacement_into(&stack, &mut moved).map(drop))?;
    }
    let points = surface.points();
    let shape: Vec<Vector> =
        points.iter().zip(&displacement).map(|(&point, &by)| add(point, by)).collect();
    for _ in 0..RUNS {
        looked.of(|| std::hint::black_box(check(surface, points, &shape)));
    }
    let forward_error = editor.forward_error(&stack(order, 0)?)?;
    let [cold, drag, check] = [cold, drag, looked].map(|times| times.median());
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
pub(crate) fn torus(count: usize) -> Result<Surface, Box<dyn Error>> {
    let file = project().join(format!("meshes/torus-{count}.msh"));
    if !file.exists() {
        fs::create_dir_all(project().join("meshes"))?;
        python(&["torus".as_ref(), count.to_string().as_ref(), file.as_os_str()])?;
    }
    Ok(Surface::extract(&read_mesh(&file)?.mesh, &FeatureSettings::default())?)
}

/// Seconds that libigl takes, and its largest difference from ours in units of the motion.
fn libigl(
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
    let indices = |values: &[u32]| -> Vec<u8> {
        values.iter().flat_map(|value| value.to_le_bytes()).collect()
    };
    let prescribed: Vec<u32> = (0..surface.points().len())
        .filter(|&vertex| surface.points()[vertex][0].abs() >= BEYOND)
        .map(|vertex| vertex as u32)
        .collect();
    let motion: Vec<f64> =
        prescribed.iter().flat_map(|&vertex| ours.displacement[vertex as usize]).collect();
    fs::write(file("points"), floats(surface.points().as_flattened()))?;
    fs::write(file("triangles"), indices(surface.triangles().as_flattened()))?;
    fs::write(file("prescribed"), indices(&prescribed))?;
    fs::write(file("motion"), floats(&motion))?;
    let (order, runs) = (order.to_string(), runs.to_string());
    let printed =
        python(&["harmonic".as_ref(), folder.path().as_os_str(), order.as_ref(), runs.as_ref()])?;
    let times = printed.lines().map(str::parse).collect::<Result<Times, _>>()?;
    let theirs = numbers(&fs::read(file("libigl"))?);
    let largest = motion.iter().fold(f64::MIN_POSITIVE, |largest, value| largest.max(value.abs()));
    let apart = ours.displacement.as_flattened().iter().zip(&theirs).map(|(a, b)| (a - b).abs());
    Ok((times.median(), apart.fold(0.0, f64::max) / largest))
}

/// Runs `benchmarks/peers/surface.py`.
fn python(arguments: &[&OsStr]) -> Result<String, Box<dyn Error>> {
    peer::run(peer::python().arg(project().join("benchmarks/peers/surface.py")).args(arguments))
}
