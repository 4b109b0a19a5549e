//! `extract`: what pipelines take out of a mesh of 1.3 million tetrahedra, beside VTK's filters.

use std::collections::BTreeMap;
use std::error::Error;
use std::hint::black_box;
use std::io::Write;
use std::process::{Command, Stdio};

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use tombolo::deform::mesh::{ArrayView, Mesh, MeshView, Vector};
use tombolo::deform::shapes::box_of_tets;
use tombolo::pipelines::extract::{Association, Channel, Extract, Field, FieldView, Snapshot};
use tombolo::pipelines::files::{Compression, write_mesh};
use tombolo::pipelines::language;
use tombolo::pipelines::run::{Output, Runner};

use crate::measure::Times;
use crate::peer;
use crate::report::{Line, Report, Target};

/// Cubes of six tetrahedra along each edge of the box: 1 296 000 tetrahedra.
const CUBES: usize = 60;
/// Runs of each extract, on a mesh that has moved and on the same again.
const RUNS: usize = 5;

/// An extract by Tombolo and by VTK.
#[derive(Debug, Serialize)]
pub struct Row {
    /// The extract, and whether the mesh has moved since the one before.
    case: String,
    /// The seconds of ours.
    seconds: f64,
    /// The seconds of VTK's filter.
    vtk: f64,
    /// Points and cells of ours.
    counts: [usize; 2],
    /// Points and cells of VTK's.
    vtk_counts: [usize; 2],
}

impl Line for Row {
    const HEADINGS: &'static [&'static str] =
        &["extract", "seconds", "VTK", "ours / VTK", "points, cells", "VTK's"];

    fn cells(&self) -> Vec<String> {
        let counts = |[points, cells]: [usize; 2]| format!("{points}, {cells}");
        vec![
            self.case.clone(),
            format!("{:.4}", self.seconds),
            format!("{:.4}", self.vtk),
            format!("{:.2}", self.seconds / self.vtk),
            counts(self.counts),
            counts(self.vtk_counts),
        ]
    }
}

/// What the peer prints of an extract.
#[derive(Deserialize)]
struct Peer {
    changed: f64,
    again: f64,
    counts: [usize; 2],
}

/// An extract: its name, its stage, and what must hold of the time on an unmoved mesh in parts of
/// VTK's.
struct Case {
    name: &'static str,
    stage: &'static str,
    settings: Value,
    again: f64,
}

/// The extracts. Those that repeat on an unmoved mesh should take a third of VTK's time.
fn cases() -> Vec<Case> {
    let case = |name, stage, settings, again| Case { name, stage, settings, again };
    let grid =
        json!({"lower": [0.01, 0.01, 0.01], "upper": [0.99, 0.99, 0.99], "counts": [50, 50, 50]});
    vec![
        case("surface", "surface", json!({}), 1.0),
        case(
            "slice",
            "slice",
            json!({"origin": [0.5, 0.5, 0.503], "normal": [0.2, 0.1, 1]}),
            1.0 / 3.0,
        ),
        case(
            "slice, sphere",
            "slice",
            json!({"sphere": {"center": [0.5, 0.5, 0.5], "radius": 0.3}}),
            1.0 / 3.0,
        ),
        case("contour", "contour", json!({"field": "pressure", "values": [0.2]}), 1.0 / 3.0),
        case("threshold", "threshold", json!({"field": "pressure", "min": 0.5, "max": 2.0}), 1.0),
        case(
            "clip, plane",
            "clip",
            json!({"plane": {"origin": [0.5, 0.5, 0.503], "normal": [0.2, 0.1, 1]}}),
            1.0,
        ),
        case("clip, field", "clip", json!({"field": {"name": "pressure", "value": 0.2}}), 1.0),
        case("probe, 125 000 points", "probe", json!({"grid": grid}), 1.0 / 3.0),
        case("gradient", "gradient", json!({"field": "velocity"}), 1.0),
        case("vorticity", "vorticity", json!({"field": "velocity"}), 1.0),
        case("q_criterion", "q_criterion", json!({"field": "velocity"}), 1.0),
        case(
            "integrate",
            "integrate",
            json!({"name": "all", "field": "pressure", "vector": "velocity"}),
            1.0,
        ),
    ]
}

/// Runs the extracts, each on one thread, and after them VTK's; some two minutes.
///
/// # Errors
/// The first error of a part; a peer that is missing is an error.
pub fn run() -> Result<Report<Row>, Box<dyn Error>> {
    let mesh = box_of_tets([CUBES; 3], [0.0; 3], [1.0; 3]);
    let fields = [fields(&mesh, 0.0), fields(&mesh, 0.1)];
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let theirs = theirs(&mesh, &fields[0])?;
    let (mut rows, mut targets) = (Vec::new(), Vec::new());
    for case in cases() {
        let peer =
            theirs.get(case.name).ok_or_else(|| format!("{}: VTK did not say", case.name))?;
        let ours =
            one.install(|| ours(&case, &mesh, &fields).map_err(|error| error.to_string()))?;
        let kinds = [
            ("the mesh has moved", ours.moved, peer.changed, 1.0),
            ("again", ours.again, peer.again, case.again),
        ];
        for (kind, seconds, vtk, most) in kinds {
            let name = format!("{}, {kind}", case.name);
            targets.push(Target::at_most(format!("{name}, ours / VTK"), seconds / vtk, most));
            rows.push(Row {
                case: name,
                seconds,
                vtk,
                counts: ours.counts,
                vtk_counts: peer.counts,
            });
        }
    }
    Ok(Report { rows, targets })
}

/// Medians of the seconds, and the points and cells that came out.
struct Ours {
    moved: f64,
    again: f64,
    counts: [usize; 2],
}

fn ours(case: &Case, mesh: &Mesh, fields: &[Vec<Field>; 2]) -> Result<Ours, Box<dyn Error>> {
    let stage = json!({case.stage: case.settings});
    // Written out, a derived field would bring the whole mesh with it.
    let stages = match case.stage {
        "integrate" => json!([stage]),
        derived @ ("gradient" | "vorticity" | "q_criterion") => {
            json!([stage, {"statistics": {"field": derived}}])
        }
        _ => json!([stage, {"write": {"file": "extract.vtu"}}]),
    };
    let pipeline = json!({"name": "extract", "every": {"steps": 1}, "stages": stages});
    let config = json!({"version": 1, "pipelines": [pipeline]}).to_string();
    let mut runner = Runner::new(&language::parse(&config, "extract.json")?)?;
    let moved: Vec<Vector> = mesh.points().iter().map(|[x, y, z]| [x + 1e-9, *y, *z]).collect();
    let (mut changed, mut again) = (Times::new(), Times::new());
    let mut counts = [mesh.points().len(), mesh.cells().len()];
    for run in 0..=2 * RUNS {
        // The mesh moves at every second run, the fields change at each.
        let points = if (run / 2) % 2 == 0 { mesh.points() } else { &moved };
        let view = MeshView { points: ArrayView::vectors(points), ..MeshView::from(mesh) };
        let views: Vec<FieldView> = fields[run % 2]
            .iter()
            .map(|field| match field.components {
                1 => FieldView::vertex(&field.name, &field.values),
                _ => FieldView::vertex(&field.name, field.values.as_chunks::<3>().0),
            })
            .collect();
        let channels = [Channel { name: "fluid", mesh: view, fields: &views }];
        let snapshot = Snapshot { cycle: run as u64, time: run as f64, channels: &channels };
        let mut first = Times::new();
        let times = match run {
            0 => &mut first,
            _ if run % 2 == 0 => &mut changed,
            _ => &mut again,
        };
        let outputs = times.of(|| runner.run(&snapshot));
        for output in outputs {
            match output {
                Output::Write { extract, .. } => counts = count(&extract),
                Output::Error { message, .. } => return Err(message.into()),
                _ => {}
            }
        }
    }
    Ok(Ours { moved: changed.median(), again: again.median(), counts: black_box(counts) })
}

fn count(extract: &Extract) -> [usize; 2] {
    [extract.points.len(), extract.cells.len()]
}

fn theirs(mesh: &Mesh, fields: &[Field]) -> Result<BTreeMap<String, Peer>, Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let file = folder.path().join("box.vtu");
    // The cells alone: VTK would take tagged faces for more of them.
    let plain = Mesh::new(mesh.points().to_vec(), mesh.cells().clone(), Default::default())?;
    write_mesh(&file, &plain, fields, Compression::None)?;
    let script = tombolo_tests::project().join("benchmarks/peers/extract.py");
    let wanted: Vec<_> =
        cases().into_iter().map(|case| (case.name, case.stage, case.settings)).collect();
    let mut input = tempfile::tempfile()?;
    input.write_all(serde_json::to_string(&wanted)?.as_bytes())?;
    std::io::Seek::rewind(&mut input)?;
    let mut command = Command::new("/usr/bin/python3");
    command.arg(script).arg(&file).arg(RUNS.to_string());
    command.env("VTK_SMP_MAX_THREADS", "1").stdin(Stdio::from(input));
    Ok(serde_json::from_str(&peer::run(&mut command)?)?)
}

/// A smooth pressure and velocity, both in double precision; `phase` makes another of them.
fn fields(mesh: &Mesh, phase: f64) -> Vec<Field> {
    let field = |name: &str, components: usize, values: Vec<f64>| Field {
        name: name.into(),
        association: Association::Vertex,
        components,
        number: tombolo::deform::mesh::NumberType::F64,
        values,
    };
    let wave = |[x, y, z]: Vector| (4.0 * x + phase).sin() * (3.0 * y).cos() * (2.0 * z).cos();
    let swirl = |[x, y, z]: Vector| [0.5 - y, x - 0.5 + phase, (3.0 * z).sin() * x];
    let points = mesh.points();
    vec![
        field("pressure", 1, points.iter().map(|&point| wave(point)).collect()),
        field("velocity", 3, points.iter().flat_map(|&point| swirl(point)).collect()),
    ]
}
