//! What the adaptor costs a solver: nothing to do, each stage, an order; in seconds and in steps of
//! the flow solver.

use std::error::Error;
use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use serde_json::{Value, json};
use tombolo::communicator::Halo;
use tombolo::deform::edit::Edit;
use tombolo::deform::features::FeatureSettings;
use tombolo::deform::mesh::{ArrayView, FeatureSource, Mesh, MeshView, TaggedFaces};
use tombolo::deform::schedule::Schedule;
use tombolo::deform::shape::{Request, Shaper};
use tombolo::deform::shapes::box_of_tets;
use tombolo::deform::surface::Surface;
use tombolo::pipelines::encode::Encoder;
use tombolo::pipelines::extract::{Channel, FieldView, Snapshot};
use tombolo::pipelines::files;
use tombolo::pipelines::language::{self, Config};
use tombolo::pipelines::run::{Output, Runner};
use tombolo::{Adaptor, Settings, Step};
use tombolo_flow::{Condition, Fluid, Patch, Solver, Value as Given};

use crate::measure::{RUNS, Times, median};
use crate::report::{Report, Row, Target};

/// Boxes along the sides of the paper's channel that make about 60 000 tetrahedra.
pub(crate) const SMALL: [usize; 3] = [6, 130, 13];
/// Those that make about 480 000.
pub(crate) const LARGE: [usize; 3] = [12, 260, 26];
const LOWER: [f64; 3] = [-0.025, -0.525, -0.05];
const UPPER: [f64; 3] = [0.025, 0.525, 0.05];
pub(crate) const TIME_STEP: f64 = 1e-3;

/// Calls of `execute` that are timed together.
const CALLS: u32 = 200_000;

/// Runs the benchmark; about a minute.
///
/// # Errors
/// The first error of a part; nothing is skipped.
pub fn run() -> Result<Report, Box<dyn Error>> {
    let mesh = channel(SMALL)?;
    let mut solver = solver(&mesh)?;
    let step = solver_step(&mut solver)?;
    let velocity = solver.velocity();
    let pressure = solver.pressure();
    let fields =
        [FieldView::vertex("velocity", &velocity), FieldView::vertex("pressure", &pressure)];
    let channels = [Channel { name: "fluid", mesh: MeshView::from(&mesh), fields: &fields }];

    let mut rows = vec![Row {
        case: format!("solver step, {} tets", mesh.cells().len()),
        seconds: step,
        steps: Some(1.0),
    }];
    let mut push = |case: &str, seconds: f64| {
        rows.push(Row { case: case.to_owned(), seconds, steps: Some(seconds / step) });
        seconds
    };
    let idle = push("execute, nothing due, no order", idle(&channels)?);

    let slice = json!({"slice": {"origin": [0, 0, 0], "normal": [1, 0, 0]}});
    let select = json!({"select": {"fields": ["velocity", "pressure"]}});
    let stream = json!({"stream": {"error": {"relative": 1e-3}}});
    push("surface", stages(&[json!({"surface": {}})], &channels)?);
    push("slice", stages(std::slice::from_ref(&slice), &channels)?);
    push("slice, the mesh moving", moving(std::slice::from_ref(&slice), &channels[0])?);
    push("surface, select", stages(&[json!({"surface": {}}), select.clone()], &channels)?);
    push("quality", stages(&[json!({"quality": {}})], &channels)?);
    push("statistics", stages(&[json!({"statistics": {"field": "velocity"}})], &channels)?);
    let surface_view = [json!({"surface": {}}), select.clone(), stream.clone()];
    let slice_view = [slice, select, stream];
    let views = push("surface, select, stream", stages(&surface_view, &channels)?)
        + push("slice, select, stream", stages(&slice_view, &channels)?);

    let mut raw = 0;
    for (name, view) in [("surface", &surface_view), ("slice", &slice_view)] {
        let (seconds, bytes) = encoding(view, &channels)?;
        push(&format!("encode {name} (another thread)"), seconds);
        raw += bytes;
    }
    black_box(raw);
    push("write surface.vtp", writing("surface.vtp", &[json!({"surface": {}})], &channels)?);
    push("write mesh.vtu", writing("mesh.vtu", &[], &channels)?);

    let order = order(&mesh)?;
    push("order: set up the reference (once)", order.reference);
    push("order: set up surface and volume (once)", order.first - order.later);
    push("order: surface", order.surface);
    push("order: volume", order.volume);
    push("order: guard, 10 shapes", order.guard);
    let later = push("order: every one after the first", order.later);

    let targets = vec![
        Target::at_most("execute, nothing due, no order [s]", idle, 1e-6),
        Target::at_most("two views every 10 steps [part of a step]", views / 10.0 / step, 0.005),
        Target::at_most("an order when no core is free [steps]", later / step, 3.0),
    ];
    Ok(Report { rows, targets })
}

/// The features of the channel, in the order of their tags.
const FEATURES: [&str; 5] = ["inlet", "upstream", "throat", "downstream", "outlet"];

/// The channel of so many boxes along each side, with the features of the demo.
pub(crate) fn channel(counts: [usize; 3]) -> Result<Mesh, Box<dyn Error>> {
    let mesh = box_of_tets(counts, LOWER, UPPER);
    let FeatureSource::Faces(tagged) = mesh.features() else {
        return Err("a box has tagged faces".into());
    };
    let tag = |vertices: &[u32]| {
        let along = |vertex: &u32| mesh.points()[*vertex as usize][1];
        let centre = vertices.iter().map(along).sum::<f64>() / vertices.len() as f64;
        // Faces of the ends have their centre on them, those of the walls between.
        match centre {
            y if y < LOWER[1] + 1e-9 => 0,
            y if y > UPPER[1] - 1e-9 => 4,
            y if y < -0.1 => 1,
            y if y > 0.1 => 3,
            _ => 2,
        }
    };
    let tags = tagged.faces.iter().map(|(_, vertices)| tag(vertices)).collect();
    let names = (0..).zip(FEATURES.map(str::to_owned)).collect();
    let features = FeatureSource::Faces(TaggedFaces { faces: tagged.faces.clone(), tags, names });
    Ok(Mesh::new(mesh.points().to_vec(), mesh.cells().clone(), features)?)
}

pub(crate) fn solver(mesh: &Mesh) -> Result<Solver, Box<dyn Error>> {
    let FeatureSource::Faces(tagged) = mesh.features() else {
        return Err("a box has tagged faces".into());
    };
    let mut patches: Vec<Patch> = tagged
        .names
        .iter()
        .map(|(_, name)| Patch {
            name: name.clone(),
            triangles: Vec::new(),
            condition: match name.as_str() {
                "inlet" => Condition::Velocity([
                    Given::Uniform(0.0),
                    Given::Uniform(10.0),
                    Given::Uniform(0.0),
                ]),
                "outlet" => Condition::Pressure(Given::Uniform(0.0)),
                _ => Condition::NoSlip,
            },
        })
        .collect();
    for ((_, vertices), tag) in tagged.faces.iter().zip(&tagged.tags) {
        let patch = tagged
            .names
            .iter()
            .position(|(number, _)| number == tag)
            .ok_or("every tag has a name")?;
        patches[patch].triangles.push(vertices.try_into()?);
    }
    let fluid = Fluid { density: 1.0, viscosity: 1e-2 };
    Ok(Solver::new(mesh, &Halo::none(), patches, fluid, tombolo_flow::Settings::default())?)
}

/// The median of the steps once the flow is on its way.
fn solver_step(solver: &mut Solver) -> Result<f64, Box<dyn Error>> {
    for _ in 0..10 {
        solver.step(TIME_STEP, None)?;
    }
    let mut times = Times::new();
    for _ in 0..3 * RUNS {
        times.of(|| solver.step(TIME_STEP, None))?;
    }
    Ok(times.median())
}

fn config(value: &Value) -> Result<Config, Box<dyn Error>> {
    Ok(language::parse(&value.to_string(), "benchmark")?)
}

/// One call of `execute`, with a server that listens, views that are not due and no viewer.
fn idle(channels: &[Channel]) -> Result<f64, Box<dyn Error>> {
    let config = config(&json!({
        "version": 1,
        "stream": {"listen": "127.0.0.1:0"},
        "pipelines": [
            {"name": "surface", "every": {"steps": 1_000_000_000_000_u64}, "stages": [{"surface": {}}, {"stream": {}}]},
            {"name": "health", "every": {"steps": 1_000_000_000_000_u64}, "stages": [{"quality": {}}]}
        ]
    }))?;
    let mut adaptor = Adaptor::initialize(Settings { config, ..Settings::default() })?;
    let mut cycle = 0;
    let seconds = median(|| {
        for _ in 0..CALLS {
            let step = Step { cycle, time: 1e-3 * cycle as f64, time_step: TIME_STEP };
            black_box(adaptor.execute(black_box(&step), channels)?);
            cycle += 1;
        }
        Ok::<(), tombolo::ExecuteError>(())
    })?;
    adaptor.finalize()?;
    Ok(seconds / f64::from(CALLS))
}

/// A runner of one pipeline that is due at every step.
fn runner(stages: &[Value]) -> Result<Runner, Box<dyn Error>> {
    let pipeline = json!({"name": "view", "every": {"steps": 1}, "stages": stages});
    Runner::new(&config(&json!({"version": 1, "pipelines": [pipeline]}))?)
        .map_err(|problem| format!("{problem:?}").into())
}

/// Runs a pipeline once.
fn once(
    runner: &mut Runner,
    cycle: u64,
    channels: &[Channel],
) -> Result<Vec<Output>, Box<dyn Error>> {
    let outputs = runner.run(&Snapshot { cycle, time: 1e-3 * cycle as f64, channels });
    match outputs.iter().find_map(|output| {
        if let Output::Error { message, .. } = output { Some(message) } else { None }
    }) {
        Some(message) => Err(message.clone().into()),
        None => Ok(outputs),
    }
}

/// A pipeline of these stages, once; what is set up once for a mesh is set up before.
fn stages(stages: &[Value], channels: &[Channel]) -> Result<f64, Box<dyn Error>> {
    let mut runner = runner(stages)?;
    let mut cycle = 0;
    median(|| {
        cycle += 1;
        black_box(once(&mut runner, cycle, channels)?);
        Ok(())
    })
}

/// A pipeline of these stages, once, on a mesh whose points have moved since it ran before.
fn moving(stages: &[Value], channel: &Channel) -> Result<f64, Box<dyn Error>> {
    let mut runner = runner(stages)?;
    let still = channel.mesh.points.to_vectors();
    let moved: Vec<_> = still.iter().map(|[x, y, z]| [x + 1e-6, *y, *z]).collect();
    let mut cycle = 0;
    median(|| {
        cycle += 1;
        let points = ArrayView::vectors(if cycle % 2 == 0 { &still } else { &moved });
        let channel = Channel { mesh: MeshView { points, ..channel.mesh }, ..*channel };
        black_box(once(&mut runner, cycle, &[channel])?);
        Ok(())
    })
}

/// Encodes the frame of a view as a key frame; seconds and bytes before.
fn encoding(view: &[Value], channels: &[Channel]) -> Result<(f64, usize), Box<dyn Error>> {
    let outputs = once(&mut runner(view)?, 1, channels)?;
    let frame = outputs
        .into_iter()
        .find_map(|output| if let Output::Frame(frame) = output { Some(frame) } else { None })
        .ok_or("the view gave no frame")?;
    let mut raw = 0;
    let mut encoder = Encoder::new();
    let seconds = median(|| {
        raw = encoder.encode(&frame, true)?.raw_bytes;
        Ok::<(), Box<dyn Error>>(())
    })?;
    Ok((seconds, raw))
}

/// Writes what these stages extract to a file.
fn writing(name: &str, extract: &[Value], channels: &[Channel]) -> Result<f64, Box<dyn Error>> {
    let directory = tempfile::tempdir()?;
    let path = directory.path().join(name);
    let stages: Vec<Value> =
        extract.iter().cloned().chain([json!({"write": {"file": name}})]).collect();
    let mut runner = runner(&stages)?;
    let mut cycle = 0;
    median(|| {
        cycle += 1;
        for output in once(&mut runner, cycle, channels)? {
            if let Output::Write { extract, .. } = output {
                files::write(&path, &extract)?;
            }
        }
        Ok(())
    })
}

/// Seconds of an order's parts.
struct Order {
    reference: f64,
    first: f64,
    surface: f64,
    volume: f64,
    guard: f64,
    later: f64,
}

/// The throat is pinched to 90 % and 80 % by turns, on a schedule of ten shapes.
fn order(mesh: &Mesh) -> Result<Order, Box<dyn Error>> {
    let mesh = Arc::new(mesh.clone());
    let start = Instant::now();
    let surface = Arc::new(Surface::extract(&mesh, &FeatureSettings::default())?);
    let mut shaper = Shaper::new(&mesh, surface)?.with_clock(tombolo::steering::clock);
    let reference = start.elapsed().as_secs_f64();
    let edits = |factor: f64| -> Result<Vec<Edit>, serde_json::Error> {
        serde_json::from_value(json!([{"scale_direction": {
            "features": ["throat"], "fixed": ["inlet", "outlet"], "factors": [1, 1, factor], "harmonic_order": 2}}]))
    };
    let schedule: Schedule = serde_json::from_value(json!({"steps": 10, "every": {"steps": 10}}))?;
    let mut shape: Arc<[_]> = mesh.points().into();
    let mut plan = |factor: f64| -> Result<_, Box<dyn Error>> {
        let start = Instant::now();
        let plan = shaper
            .plan(&Request { schedule, ..Request::new(edits(factor)?, Arc::clone(&shape)) })?;
        let seconds = start.elapsed().as_secs_f64();
        shape = Arc::clone(plan.end());
        Ok((seconds, plan.seconds()))
    };
    let (first, _) = plan(0.9)?;
    let mut parts = [const { Vec::new() }; 4];
    for run in 0..RUNS {
        let (seconds, own) = plan(if run % 2 == 0 { 0.8 } else { 0.9 })?;
        for (values, value) in parts.iter_mut().zip([seconds, own.surface, own.volume, own.guard]) {
            values.push(value);
        }
    }
    let [later, surface, volume, guard] = parts.map(|values| Times::from_iter(values).median());
    Ok(Order { reference, first, surface, volume, guard, later })
}
