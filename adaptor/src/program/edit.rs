//! `tombolo edit`.

use std::{num::NonZeroU32, path::PathBuf, sync::Arc, time::Instant};

use crate::{
    deform::shape::{Forecast, Outcome as Expected, Refused, Request, Shaper},
    deform::{
        distributed::DistributedError,
        edit::{Edit, Layer},
        mesh::Mesh,
        quality::{Quality, quality},
        surface::BrokenSurface,
        volume::Method,
    },
    pipelines::{
        files::{
            Compression, check_displacement_name, check_mesh_name, read_displacements, read_mesh,
            write_displacement, write_mesh,
        },
        language::{Change, Order, Validate, parse_valid, resolve_files},
    },
};
use clap::{ArgGroup, Args, ValueEnum};
use serde::Serialize;

use super::{Failure, features::surface, json, read, say};

#[derive(Debug, Args)]
#[command(group(ArgGroup::new("result").required(true).multiple(true).args(["out", "displacement", "forecast"])))]
pub(crate) struct Options {
    /// The mesh to start from: .vtu, .vtk, .vtp or .msh
    #[arg(long, value_name = "IN")]
    mesh: PathBuf,
    /// A JSON list of edits, or an order: an object with `edits` and, at will, `deform`, `guard`
    /// and `schedule`
    #[arg(long, value_name = "EDITS.json")]
    edits: PathBuf,
    /// The file to write: .vtu, or .vtp for a surface
    #[arg(long, value_name = "OUT.vtu")]
    out: Option<PathBuf>,
    /// Say what the edits would come to, and write nothing; it succeeds also where they would be
    /// rejected
    #[arg(long, conflicts_with_all = ["out", "displacement"])]
    forecast: bool,
    /// Write what each surface vertex was moved by, beside the mesh or alone: .txt, .csv or .vtp;
    /// an edit `displacement` reads it again
    #[arg(long, value_name = "OUT.txt")]
    displacement: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
    /// Name the parts between edges of this many degrees or more feature-1, feature-2, ...,
    /// whatever features the mesh names; see `tombolo features`
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true)]
    angle: Option<f64>,
    /// How the volume follows; wins over the order's
    #[arg(long)]
    method: Option<VolumeMethod>,
    /// How much stiffer small cells are, from 0 to 4; wins over the order's
    #[arg(long, allow_negative_numbers = true)]
    stiffening: Option<f64>,
    /// The least scaled Jacobian allowed, from 0 to 1; wins over the order's
    #[arg(long, allow_negative_numbers = true)]
    min_quality: Option<f64>,
    /// In how many shapes the way is looked at; wins over the order's
    #[arg(long)]
    steps: Option<NonZeroU32>,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum VolumeMethod {
    Elasticity,
    Harmonic,
}

#[derive(Serialize)]
struct Outcome {
    status: &'static str,
    reason: Option<String>,
    /// The fault of the surface, where that is why it was refused.
    surface: Option<BrokenSurface>,
    vertices: usize,
    cells: usize,
    before: Quality,
    after: Option<Quality>,
    inverted: Option<usize>,
    iterations: Option<usize>,
    sub_steps: Option<usize>,
    fraction: Option<f64>,
    /// The edits, the oldest first; empty where the order was refused before they were evaluated.
    layers: Vec<Layer>,
    seconds: Seconds,
}

/// Seconds of each part; 0 where it was not come to.
#[derive(Default, Serialize)]
struct Seconds {
    read: f64,
    features: f64,
    surface: f64,
    volume: f64,
    guard: f64,
    write: f64,
}

pub(crate) fn edit(options: &Options) -> Result<(), Failure> {
    let (mut edits, order) = read_order(options)?;
    let mut seconds = Seconds::default();
    let mesh_file = timed(&mut seconds.read, || read_mesh(&options.mesh))?;
    for note in &mesh_file.notes {
        eprintln!("note: {note}");
    }
    let mesh = Arc::new(mesh_file.mesh);
    check_results(options, &mesh)?;
    let made = timed(&mut seconds.features, || {
        let surface = Arc::new(surface(&mesh, options.angle)?);
        let shaper = Shaper::new(&mesh, Arc::clone(&surface))?.with_clock(crate::steering::clock);
        Ok::<_, DistributedError>((shaper, surface))
    });
    let (mut shaper, surface) = made?;
    read_displacements(&mut edits, &surface)?;

    let mut outcome = Outcome {
        status: "applied",
        reason: None,
        surface: None,
        vertices: mesh.points().len(),
        cells: mesh.cells().len(),
        before: quality(mesh.cells(), mesh.points()),
        after: None,
        inverted: None,
        iterations: None,
        sub_steps: None,
        fraction: None,
        layers: Vec::new(),
        seconds,
    };
    let request = Request {
        deformation: order.deform.unwrap_or_default(),
        guard: order.guard.unwrap_or_default(),
        schedule: order.schedule.unwrap_or_default(),
        ..Request::new(edits, Arc::clone(shaper.reference()))
    };

    if options.forecast {
        let forecast = shaper.forecast(&request);
        return if options.json {
            json(&forecast)
        } else {
            print_forecast(&forecast, &outcome.before)
        };
    }
    let plan = shaper.plan(&request);
    let spent = shaper.spent();
    (outcome.seconds.surface, outcome.seconds.volume, outcome.seconds.guard) =
        (spent.surface, spent.volume, spent.guard);
    outcome.layers =
        shaper.editor().and_then(|editor| editor.layers(&request.stack).ok()).unwrap_or_default();
    let plan = match plan {
        Ok(plan) => plan,
        Err(refused) => {
            outcome.status = "rejected";
            outcome.reason = Some(refused.to_string());
            outcome.fraction = refused.feasible_fraction();
            if let Refused::Surface(broken) = &refused {
                outcome.surface = Some((**broken).clone());
            }
            if options.json {
                json(&outcome)?;
            }
            return Err(Failure::Refused(refused.to_string()));
        }
    };
    let target = plan.target();
    (outcome.iterations, outcome.sub_steps) = (Some(target.iterations), Some(target.sub_steps));
    outcome.fraction = Some(target.fraction);
    let shaped = mesh.with_points(plan.end().to_vec())?;
    let after = quality(shaped.cells(), shaped.points());
    outcome.inverted = Some(after.inverted);
    outcome.after = Some(after);
    if let Some(out) = &options.out {
        timed(&mut outcome.seconds.write, || {
            write_mesh(out, &shaped, &mesh_file.fields, Compression::None)
        })?;
    }
    if let Some(file) = &options.displacement {
        let whole = shaper.editor().filter(|_| target.fraction == 1.0);
        let displacement = if let Some(editor) = whole {
            editor.displacement(&request.stack)?
        } else {
            // Clamped: what was reached, and not what was asked for.
            let reached = |&vertex: &u32| {
                let [reference, end] =
                    [mesh.points(), plan.end()].map(|points| points[vertex as usize]);
                [0, 1, 2].map(|axis| end[axis] - reference[axis])
            };
            surface.vertices().iter().map(reached).collect()
        };
        write_displacement(file, &surface, &displacement)?;
    }
    if options.json { json(&outcome) } else { tell(&outcome, options) }
}

/// Refuses files that could not be written, before the work that would be lost.
fn check_results(options: &Options, mesh: &Mesh) -> Result<(), Failure> {
    if let Some(out) = &options.out {
        check_mesh_name(out, mesh.cells())?;
    }
    if let Some(file) = &options.displacement {
        check_displacement_name(file)?;
    }
    if options.out.is_some() && options.out == options.displacement {
        let message = "--out and --displacement name the same file; each writes one of its own";
        return Err(Failure::Wrong(message.to_owned()));
    }
    Ok(())
}

/// The edits and the order's settings.
fn read_order(options: &Options) -> Result<(Vec<Edit>, Order), Failure> {
    let name = options.edits.to_string_lossy();
    let text = read(&options.edits)?;
    // A list of edits is read as an order that holds it, so that both are held to the same rules.
    let is_list = text.trim_start_matches('\u{feff}').trim_start().starts_with('[');
    let order: Order = if is_list {
        Change::Edits(parse_valid::<Vec<Edit>>(&text, &name)?).into()
    } else {
        parse_valid(&text, &name)?
    };
    let order = with_options(order, options)?;
    match &order.change {
        Change::Edits(edits) | Change::Stack(edits) => {
            let mut edits = edits.clone();
            resolve_files(&mut edits, &name);
            Ok((edits, order))
        }
        Change::Undo(_) => Err(Failure::Wrong(format!(
            "{name}: undo: a mesh from a file has no orders to take back"
        ))),
    }
}

/// The order with what the options say in place of its own settings, held to the same limits.
fn with_options(mut order: Order, options: &Options) -> Result<Order, Failure> {
    if let Some(method) = options.method {
        let deform = order.deform.get_or_insert_default();
        deform.surface_only = false;
        deform.equation.method = match method {
            VolumeMethod::Elasticity => Method::Elasticity,
            VolumeMethod::Harmonic => Method::Harmonic,
        };
    }
    if options.out.is_some() && order.deform.as_ref().is_some_and(|deform| deform.surface_only) {
        return Err(Failure::Wrong(
            "`method` is `surface`, which leaves the volume to a solver: name one with --method, or leave --out out"
                .into(),
        ));
    }
    if let Some(stiffening) = options.stiffening {
        order.deform.get_or_insert_default().equation.stiffening = stiffening;
    }
    if let Some(least) = options.min_quality {
        order.guard.get_or_insert_default().min_scaled_jacobian = least;
    }
    if let Some(steps) = options.steps {
        order.schedule.get_or_insert_default().steps = steps;
    }
    order
        .validate()
        .map_err(|problem| Failure::Wrong(format!("with the options that are given, {problem}")))?;
    Ok(order)
}

fn timed<T>(seconds: &mut f64, work: impl FnOnce() -> T) -> T {
    let begun = Instant::now();
    let done = work();
    *seconds = begun.elapsed().as_secs_f64();
    done
}

fn line(quality: &Quality) -> String {
    format!("least {:.4}, mean {:.4}, {} inverted", quality.min, quality.mean, quality.inverted)
}

fn print_forecast(forecast: &Forecast, before: &Quality) -> Result<(), Failure> {
    match (forecast.outcome, &forecast.reason) {
        (Expected::Rejected, reason) => {
            say(format_args!(
                "would be rejected: {}",
                reason.as_deref().unwrap_or("no reason given")
            ))?;
            if let Some(fraction) = forecast.fraction {
                say(format_args!("{:.2} % of the amounts would pass", 100.0 * fraction))?;
            }
        }
        (Expected::Clamped, _) => {
            let fraction = forecast.fraction.unwrap_or_default();
            say(format_args!(
                "would be clamped to {:.2} % of the edits' amounts",
                100.0 * fraction
            ))?;
        }
        (Expected::Applied, _) => say(format_args!("would be applied"))?,
    }
    say(format_args!("scaled Jacobian before: {}", line(before)))?;
    if let Some(quality) = &forecast.quality {
        say(format_args!("scaled Jacobian after:  {}", line(quality)))?;
    }
    match forecast.min_scaled_jacobian {
        Some(least) => say(format_args!("scaled Jacobian on the way: least {least:.4}")),
        None => Ok(()),
    }
}

fn tell(outcome: &Outcome, options: &Options) -> Result<(), Failure> {
    say(format_args!("{} vertices, {} cells", outcome.vertices, outcome.cells))?;
    say(format_args!("scaled Jacobian before: {}", line(&outcome.before)))?;
    if let Some(fraction) = outcome.fraction.filter(|fraction| *fraction < 1.0) {
        say(format_args!("clamped to {:.2} % of the edits' amounts", 100.0 * fraction))?;
    }
    if let Some(after) = &outcome.after {
        say(format_args!("scaled Jacobian after:  {}", line(after)))?;
    }
    for (index, layer) in outcome.layers.iter().enumerate() {
        let Layer { edit, name, muted, handle_vertices, fixed_vertices, largest_displacement } =
            layer;
        let name = name.as_ref().map_or_else(String::new, |name| format!(" \"{name}\""));
        let does = if *muted {
            "muted".to_owned()
        } else {
            format!("moves the surface by at most {largest_displacement:.6}")
        };
        say(format_args!(
            "edit {index} ({edit}){name}: {handle_vertices} vertices in the handle, {does}"
        ))?;
        // Those that say of each vertex where it goes move no others.
        if *fixed_vertices == 0 && !muted && !["displacement", "skeleton"].contains(edit) {
            say(format_args!(
                "edit {index} holds nothing fixed, so that whole pieces of the surface go with its handle"
            ))?;
        }
    }
    let Seconds { read, features, surface, volume, guard, write } = outcome.seconds;
    say(format_args!(
        "seconds: read {read:.3}, features {features:.3}, surface {surface:.3}, volume {volume:.3}, guard {guard:.3}, \
         write {write:.3}"
    ))?;
    let written = options.out.iter().chain(&options.displacement);
    written.into_iter().try_for_each(|file| say(format_args!("wrote {}", file.display())))
}
