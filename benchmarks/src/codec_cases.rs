//! The fields that `codec` codes: frames of flow, and two that are made up.

use std::error::Error;
use std::sync::Arc;

use serde_json::{Value, json};
use tombolo::communicator::Halo;
use tombolo::deform::features::FeatureSettings;
use tombolo::deform::mesh::{MeshView, Vector};
use tombolo::deform::shapes::torus;
use tombolo::deform::surface::Surface;
use tombolo::pipelines::extract::{Channel, Extract, FieldView, Snapshot};
use tombolo::pipelines::files::read_mesh;
use tombolo::pipelines::language;
use tombolo::pipelines::run::{Output, Runner};
use tombolo_flow::Solver;
use tombolo_flow::case::Case as FlowCase;
use tombolo_tests::project;

use crate::peer;

/// Frames on one topology.
pub struct Case {
    /// The case and the view.
    pub name: String,
    /// The positions.
    pub points: Vec<Vector>,
    /// The triangles.
    pub triangles: Vec<[u32; 3]>,
    /// For each field its name, the values in a tuple, and its frames.
    pub fields: Vec<(String, usize, Vec<Vec<f64>>)>,
}

/// All cases.
pub fn all() -> Result<Vec<Case>, Box<dyn Error>> {
    let mut cases = flow("nozzle", "channel-60k", [1, 0, 0], 30, 5)?;
    cases.extend(flow("bypass", "bypass-0", [0, 0, 1], 60, 10)?);
    cases.push(made_up("smooth, 1 M points", 3));
    cases.push(made_up("turbulent, 1 M points", 400));
    Ok(cases)
}

/// Six frames of flow's surface and of a slice, from a cycle on.
fn flow(
    name: &str,
    mesh: &str,
    normal: [i32; 3],
    first: usize,
    every: usize,
) -> Result<Vec<Case>, Box<dyn Error>> {
    let file = project().join(format!("examples/flow/cases/{name}.json"));
    let case = FlowCase::read(&file)?;
    let mesh = read_mesh(&peer::mesh_file(mesh)?)?.mesh;
    let surface = Surface::extract(&mesh, &FeatureSettings::default())?;
    let patches = case.patches(&file, &surface)?;
    let parameters: Vec<f64> =
        case.declared_parameters().iter().map(|parameter| parameter.value).collect();
    let settings = tombolo_flow::Settings::default();
    let fluid = case.fluid(&parameters);
    let mut solver = Solver::new(&mesh, &Halo::none(), patches, fluid, settings)?;
    let (velocity, pressure) = case.initial_values();
    solver.initialise(&velocity, &pressure);
    solver.set_parameters(&parameters);

    let pipeline = |name: &str, stage: Value| {
        let select = json!({"select": {"fields": ["velocity", "pressure"]}});
        json!({"name": name, "every": {"steps": 1}, "stages": [stage, select, {"stream": {}}]})
    };
    let slice = json!({"slice": {"origin": [0, 0, 0], "normal": normal}});
    let pipelines = [pipeline("surface", json!({"surface": {}})), pipeline("slice", slice)];
    let config = language::parse(&json!({"version": 1, "pipelines": pipelines}).to_string(), name)?;
    let mut runner = Runner::new(&config).map_err(|problem| format!("{problem:?}"))?;
    let mut cases: Vec<Case> = Vec::new();
    for step in 0..first + 6 * every {
        if step >= first && (step - first).is_multiple_of(every) {
            let (velocity, pressure) = (solver.velocity(), solver.pressure());
            let fields = [
                FieldView::vertex("velocity", &velocity),
                FieldView::vertex("pressure", &pressure),
            ];
            let channel = Channel { name: "fluid", mesh: MeshView::from(&mesh), fields: &fields };
            let snapshot = Snapshot { cycle: step as u64, time: step as f64, channels: &[channel] };
            for output in runner.run(&snapshot) {
                match output {
                    Output::Frame(frame) => take(&mut cases, name, &frame.pipeline, &frame.extract),
                    Output::Error { message, .. } => return Err(message.into()),
                    _ => {}
                }
            }
        }
        solver.step(case.time_step, None)?;
    }
    Ok(cases)
}

/// Adds a frame to the case of its view.
fn take(cases: &mut Vec<Case>, flow: &str, view: &str, extract: &Arc<Extract>) {
    let name = format!("{flow} {view}");
    let known = cases.iter().position(|case| case.name == name);
    let index = known.unwrap_or_else(|| {
        let fans = extract.cells.iter().flat_map(|(_, points)| {
            let fan = points[1..].windows(2).map(|edge| [points[0], edge[0], edge[1]]);
            fan.collect::<Vec<_>>()
        });
        let fields = extract.fields.iter();
        let fields = fields.map(|field| (field.name.clone(), field.components, Vec::new()));
        cases.push(Case {
            name,
            points: extract.points.clone(),
            triangles: fans.collect(),
            fields: fields.collect(),
        });
        cases.len() - 1
    });
    for (field, (_, _, frames)) in extract.fields.iter().zip(&mut cases[index].fields) {
        frames.push(field.values.clone());
    }
}

/// A field of so many waves on a torus, three frames of it. The more waves there are the shorter
/// they get, with the energy that turbulence has at their length.
fn made_up(name: &str, waves: u32) -> Case {
    let mesh = torus(2.0, 0.5, [1440, 700]);
    let points = mesh.points().to_vec();
    let triangles = mesh
        .cells()
        .iter()
        .flat_map(|(_, corners)| {
            let fan = corners[1..].windows(2).map(|edge| [corners[0], edge[0], edge[1]]);
            fan.collect::<Vec<_>>()
        })
        .collect();
    let mut random = 1u64;
    let mut next = || {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (random >> 11) as f64 / (1u64 << 53) as f64
    };
    let waves: Vec<([f64; 3], f64, f64)> = (0..waves)
        .map(|wave| {
            let number = 1.0 + f64::from(wave).powf(0.8);
            let direction = [0; 3].map(|_| next() - 0.5);
            let length = direction.iter().map(|x| x * x).sum::<f64>().sqrt();
            // E(k) ~ k^(-5/3), over waves that are k^(1/4) apart.
            let amplitude = number.powf(-5.0 / 6.0 + 0.125);
            (direction.map(|x| x * number / length), std::f64::consts::TAU * next(), amplitude)
        })
        .collect();
    let frame = |time: f64| {
        let value = |point: &Vector| {
            let wave = |(number, phase, amplitude): &([f64; 3], f64, f64)| {
                let along: f64 = number.iter().zip(point).map(|(k, x)| k * x).sum();
                amplitude * (along + phase + time * number[0]).sin()
            };
            waves.iter().map(wave).sum()
        };
        points.iter().map(value).collect()
    };
    let frames = (0..3).map(|index| frame(0.01 * f64::from(index))).collect();
    Case {
        name: name.into(),
        points: points.clone(),
        triangles,
        fields: vec![("value".into(), 1, frames)],
    }
}
