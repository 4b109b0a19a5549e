//! A surface that changes at each step, streamed from a solver in Python to another process, beside
//! Rerun.

use std::error::Error;
use std::fs;
use std::path::Path;
use std::process::Command;

use serde::{Deserialize, Serialize};
use tombolo_tests::{project, target};

use crate::measure::Times;
use crate::peer;
use crate::report::{Line, Report, Target};

/// Ours, and Rerun's with the whole mesh logged at each step or with what changes alone.
const PEERS: [&str; 3] = ["tombolo", "rerun", "rerun-changes"];
/// Triangles, and steps without a pause: Rerun's server keeps less than its gigabyte of them.
const SIZES: [(u32, u32); 2] = [(20_000, 1000), (200_000, 200)];
/// Steps with a pause, and the seconds from one to the next.
const STEPS: u32 = 100;
const PAUSE: f64 = 0.05;
/// How often each has its turn.
const ROUNDS: usize = 3;

/// A stream of one size by one library.
#[derive(Serialize)]
pub struct Row {
    peer: &'static str,
    /// What changes at each step: `values`, or `points` beside them.
    change: &'static str,
    /// Seconds from one step to the next; 0 where none is waited for.
    pause: f64,
    #[serde(flatten)]
    measured: Measured,
}

/// The figures that the program prints.
#[derive(Clone, Copy, Serialize, Deserialize)]
struct Measured {
    triangles: u64,
    steps: u64,
    /// The median of a call of `execute` or `log`.
    seconds: f64,
    /// Processor seconds that the solver's process takes for a step, in all its threads.
    busy: f64,
    /// How many of the steps' frames arrived, and how many in a second.
    arrived: f64,
    frames_a_second: f64,
    /// Bytes of a frame on the wire.
    frame_bytes: f64,
    /// Seconds a frame from Rerun's file to arrays; frames of ours are arrays when they arrive.
    #[serde(skip_serializing_if = "Option::is_none")]
    to_arrays: Option<f64>,
}

/// Runs the benchmark on the package that `scripts/python --release` compiles; some seven minutes.
///
/// # Errors
/// The first error of building and running; a peer that is missing is an error.
pub fn run() -> Result<Report<Row>, Box<dyn Error>> {
    peer::run(Command::new(project().join("scripts/python")).arg("--release"))?;
    let mut rows = Vec::new();
    for (triangles, without_pause) in SIZES {
        for (change, steps, pause) in
            [("values", STEPS, PAUSE), ("points", STEPS, PAUSE), ("points", without_pause, 0.0)]
        {
            rows.extend(of_peers(triangles, change, steps, pause)?);
        }
    }
    let targets = targets(&rows);
    Ok(Report { rows, targets })
}

/// The streams of all peers of surfaces whose points change, without a pause: how many frames a
/// second a client gets.
pub(crate) fn without_pause() -> Result<Vec<Row>, Box<dyn Error>> {
    let mut rows = Vec::new();
    for (triangles, steps) in SIZES {
        rows.extend(of_peers(triangles, "points", steps, 0.0)?);
    }
    Ok(rows)
}

/// A stream by each peer, which take turns.
fn of_peers(
    triangles: u32,
    change: &'static str,
    steps: u32,
    pause: f64,
) -> Result<Vec<Row>, Box<dyn Error>> {
    let directory = target().join("benchmark-stream");
    fs::create_dir_all(&directory)?;
    let numbers = [triangles.to_string(), steps.to_string(), pause.to_string()];
    let mut rounds: [Vec<Measured>; 3] = Default::default();
    for _ in 0..ROUNDS {
        for (peer, rounds) in PEERS.into_iter().zip(&mut rounds) {
            rounds.push(measure(peer, &numbers, change, &directory)?);
        }
    }
    let row = |(peer, rounds): (_, &Vec<_>)| {
        median(rounds).map(|measured| Row { peer, change, pause, measured })
    };
    PEERS.into_iter().zip(&rounds).map(row).collect()
}

fn measure(
    peer: &str,
    numbers: &[String; 3],
    change: &str,
    directory: &Path,
) -> Result<Measured, Box<dyn Error>> {
    let mut command = peer::python();
    command.arg(project().join("benchmarks/peers/stream.py"));
    command.arg(peer).args(numbers).arg(change).arg(directory);
    Ok(serde_json::from_str(&peer::run(&mut command)?)?)
}

/// The median of each figure over the rounds.
fn median(rounds: &[Measured]) -> Result<Measured, Box<dyn Error>> {
    let first = *rounds.first().ok_or("there was no round")?;
    let of = |figure: fn(&Measured) -> f64| rounds.iter().map(figure).collect::<Times>().median();
    let to_arrays = rounds.iter().filter_map(|round| round.to_arrays).collect::<Times>().median();
    Ok(Measured {
        seconds: of(|round| round.seconds),
        busy: of(|round| round.busy),
        arrived: of(|round| round.arrived),
        frames_a_second: of(|round| round.frames_a_second),
        frame_bytes: of(|round| round.frame_bytes),
        to_arrays: first.to_arrays.map(|_| to_arrays),
        ..first
    })
}

/// Ours beside Rerun's that logs what changes alone.
pub(crate) fn targets(rows: &[Row]) -> Vec<Target> {
    let mut targets = Vec::new();
    for [ours, _, theirs] in rows.as_chunks::<3>().0 {
        let (change, pause) = (ours.change, ours.pause);
        let [ours, theirs] = [ours.measured, theirs.measured];
        let mut at_most = |what: &str, value: f64, most: f64| {
            let name = format!("{} triangles, {change}: {what}", ours.triangles);
            targets.push(Target::at_most(name, value, most));
        };
        if pause > 0.0 {
            at_most("frames missed at 20 a second", ours.steps as f64 - ours.arrived, 0.0);
            at_most("bytes a frame, ours / Rerun's", ours.frame_bytes / theirs.frame_bytes, 1.0);
            at_most("a call, ours / Rerun's", ours.seconds / theirs.seconds, 1.0);
        } else {
            let ratio = theirs.frames_a_second / ours.frames_a_second;
            at_most("frames a second without a pause, Rerun's / ours", ratio, 1.0);
        }
    }
    targets
}

impl Row {
    /// Its peer, how many triangles there are, the median of a call in seconds, and frames a second.
    pub(crate) fn throughput(&self) -> (&'static str, u64, f64, f64) {
        let Measured { triangles, seconds, frames_a_second, .. } = self.measured;
        (self.peer, triangles, seconds, frames_a_second)
    }
}

impl Line for Row {
    const HEADINGS: &'static [&'static str] = &[
        "stream",
        "triangles",
        "changes",
        "pause [s]",
        "call [s]",
        "processors [s]",
        "arrived",
        "frames/s",
        "frame [kB]",
        "to arrays [s]",
    ];

    fn cells(&self) -> Vec<String> {
        let measured = self.measured;
        vec![
            self.peer.to_owned(),
            measured.triangles.to_string(),
            self.change.to_owned(),
            self.pause.to_string(),
            format!("{:.2e}", measured.seconds),
            format!("{:.2e}", measured.busy),
            format!("{} of {}", measured.arrived, measured.steps),
            format!("{:.1}", measured.frames_a_second),
            format!("{:.1}", measured.frame_bytes / 1e3),
            measured.to_arrays.map_or_else(String::new, |seconds| format!("{seconds:.2e}")),
        ]
    }
}
