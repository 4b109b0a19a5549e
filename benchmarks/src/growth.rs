//! How the time and the memory of an order grow with the mesh: boxes of tetrahedra of ten thousand
//! to five million cells, sheared by a tenth, on a quiet machine and beside a busy solver.

use std::error::Error;
use std::hint::black_box;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Instant;

use serde::{Deserialize, Serialize};
use tombolo::deform::edit::Edit;
use tombolo::deform::features::FeatureSettings;
use tombolo::deform::shape::{Request, Shaper};
use tombolo::deform::shapes::box_of_tets;
use tombolo::deform::surface::Surface;

use crate::measure::{memory_peak, processor_seconds};
use crate::peer;
use crate::report::{Line, Report, Target};

/// Cubes along an edge, each of six tetrahedra.
const CUBES: [usize; 7] = [12, 17, 26, 37, 55, 75, 94];

/// How many numbers each thread of the busy solver goes through: more than its caches hold.
const NUMBERS: usize = 1 << 22;

/// An order on a mesh of one size.
#[derive(Debug, Serialize)]
pub struct Row {
    busy: bool,
    #[serde(flatten)]
    order: Order,
}

/// The figures of one process.
#[derive(Debug, Serialize, Deserialize)]
struct Order {
    cells: usize,
    /// Seconds from the mesh to a shaper that is ready for orders.
    set_up: f64,
    /// Seconds of the first order and of the one that takes it back half way.
    first: f64,
    later: f64,
    /// Processor seconds of all three, whatever else the machine was doing.
    processor: f64,
    /// The most memory beyond the mesh itself, in bytes.
    memory: f64,
    /// The least scaled Jacobian of the first order.
    least: f64,
}

/// Measures every size twice, each in a process of its own: some minutes.
///
/// # Errors
/// The first error of a process.
pub fn run() -> Result<Report<Row>, Box<dyn Error>> {
    let mut rows = Vec::new();
    for busy in [false, true] {
        for cubes in CUBES {
            let mut command = Command::new(std::env::current_exe()?);
            command.args(["growth", "--cubes", &cubes.to_string()]);
            command.args(busy.then_some("--busy"));
            let order = serde_json::from_str(peer::answer(&peer::run(&mut command)?)?)?;
            rows.push(Row { busy, order });
        }
    }
    let (quiet, beside) = rows.split_at(CUBES.len());
    let whole = |row: &Row| row.order.set_up + row.order.first;
    let per_cell = |rows: &[Row]| {
        let large = rows.iter().filter(|row| row.order.cells > 100_000);
        large.map(|row| row.order.memory / row.order.cells as f64).fold(0.0, f64::max)
    };
    let cores = std::thread::available_parallelism()?.get();
    let slowdown = beside.last().map_or(f64::NAN, |row| {
        let order = &row.order;
        // Half of the machine is the solver's.
        (order.set_up + order.first + order.later) * cores as f64 / 2.0 / order.processor
    });
    let targets = vec![
        Target::at_most("slope of the time in cells, quiet", slope(quiet, whole), 1.05),
        Target::at_most("slope of the time in cells, beside a solver", slope(beside, whole), 1.05),
        Target::at_most("memory of an order beyond the mesh [bytes/cell]", per_cell(quiet), 350.0),
        Target::at_most("wall beside a solver / processor time on its share", slowdown, 1.3),
    ];
    Ok(Report { rows, targets })
}

/// The exponent of the cells in a quantity: a straight line through the logarithms of all rows.
fn slope(rows: &[Row], quantity: impl Fn(&Row) -> f64) -> f64 {
    let points: Vec<[f64; 2]> =
        rows.iter().map(|row| [(row.order.cells as f64).ln(), quantity(row).ln()]).collect();
    let count = points.len() as f64;
    let [x, y] = [0, 1].map(|axis| points.iter().map(|point| point[axis]).sum::<f64>() / count);
    let above: f64 = points.iter().map(|point| (point[0] - x) * (point[1] - y)).sum();
    above / points.iter().map(|point| (point[0] - x).powi(2)).sum::<f64>()
}

/// Measures one order in this process, and prints it for [`run`].
///
/// # Errors
/// Where the order is refused.
pub fn one(cubes: usize, busy: bool) -> Result<(), Box<dyn Error>> {
    let threads = if busy { std::thread::available_parallelism()?.get() } else { 0 };
    println!("tombolo {}", serde_json::to_string(&order(cubes, threads)?)?);
    Ok(())
}

/// A solver that computes beside the order, on threads of its own.
struct Solver {
    done: Arc<AtomicBool>,
    threads: Vec<JoinHandle<f64>>,
}

impl Solver {
    /// Starts threads that have their arrays already, so that these count as memory from before.
    fn start(threads: usize) -> Self {
        let done = Arc::new(AtomicBool::new(false));
        let thread = |_| {
            let (done, values) = (Arc::clone(&done), vec![1.0; NUMBERS]);
            std::thread::spawn(move || compute(&done, values))
        };
        let threads = (0..threads).map(thread).collect();
        Self { done, threads }
    }

    /// Ends the solver; the processor seconds that it took.
    fn stop(self) -> f64 {
        self.done.store(true, Ordering::Release);
        self.threads.into_iter().filter_map(|thread| thread.join().ok()).sum()
    }
}

/// Goes through an array as a solver does, step after step, until it is told to stop. The processor
/// seconds of this thread.
fn compute(done: &AtomicBool, mut values: Vec<f64>) -> f64 {
    let mut step = 0.0;
    while !done.load(Ordering::Acquire) {
        step += 1.0;
        values.iter_mut().for_each(|value| *value = 0.5 * (*value + step));
        black_box(&values);
    }
    thread_seconds()
}

/// The processor seconds of this thread; none where the system does not say.
fn thread_seconds() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let nanoseconds = text.split_whitespace().next().and_then(|number| number.parse::<f64>().ok());
    nanoseconds.unwrap_or_default() * 1e-9
}

fn order(cubes: usize, threads: usize) -> Result<Order, Box<dyn Error>> {
    let mesh = Arc::new(box_of_tets([cubes; 3], [0.0; 3], [1.0; 3]));
    let spent = processor_seconds()?;
    let solver = Solver::start(threads);
    let own = memory_peak()?;
    let begun = Instant::now();
    let surface = Arc::new(Surface::extract(&mesh, &FeatureSettings::default())?);
    let mut shaper = Shaper::new(Arc::clone(&mesh), surface)?;
    let reference = Arc::clone(shaper.reference());
    let request = |by: f64, start| -> Result<Request, serde_json::Error> {
        let edits: Vec<Edit> = serde_json::from_value(serde_json::json!([
            {"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [by, 0.0, 0.0]}}
        ]))?;
        Ok(Request::new(edits, start))
    };
    let first = request(0.1, reference)?;
    shaper.prepare(&first.deformation)?;
    let set_up = begun.elapsed().as_secs_f64();
    let begun = Instant::now();
    let plan = shaper.plan(&first)?;
    let seconds = begun.elapsed().as_secs_f64();
    let begun = Instant::now();
    shaper.plan(&request(0.05, Arc::clone(plan.end()))?)?;
    let later = begun.elapsed().as_secs_f64();
    let processor = -solver.stop() + processor_seconds()? - spent;
    Ok(Order {
        cells: mesh.cells().len(),
        set_up,
        first: seconds,
        later,
        processor,
        memory: memory_peak()? - own,
        least: plan.quality().min_scaled_jacobian,
    })
}

impl Line for Row {
    const HEADINGS: &'static [&'static str] = &[
        "cells",
        "beside a solver",
        "set-up [s]",
        "first order [s]",
        "later [s]",
        "processor [s]",
        "bytes/cell",
        "least",
    ];

    fn cells(&self) -> Vec<String> {
        let Order { cells, set_up, first, later, processor, memory, least } = self.order;
        vec![
            cells.to_string(),
            if self.busy { "yes" } else { "no" }.into(),
            format!("{set_up:.3}"),
            format!("{first:.3}"),
            format!("{later:.3}"),
            format!("{processor:.2}"),
            format!("{:.0}", memory / cells as f64),
            format!("{least:.6}"),
        ]
    }
}
