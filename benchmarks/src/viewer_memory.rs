//! `viewer-memory`: the heap of the viewer's page over half an hour of the demo.

use std::error::Error;

use serde::{Deserialize, Serialize};

use crate::peer::mesh_file;
use crate::report::{Line, Report, Target};
use crate::viewer::{built, watched};

/// The minute from which on the heap is to be flat: by then the history of the monitors has all the
/// times that it keeps.
const SETTLED: usize = 10;

/// The minutes whose mean is compared: what waits to be collected differs from one to the next.
const MEAN: usize = 3;

/// What `benchmarks/browser/memory.mjs` prints: bytes after each minute.
#[derive(Deserialize)]
struct Seen {
    heaps: Vec<f64>,
    frames: usize,
}

/// The heap after garbage collection.
#[derive(Serialize)]
pub struct Row {
    minutes: usize,
    bytes: f64,
}

impl Line for Row {
    const HEADINGS: &'static [&'static str] = &["minutes", "heap [bytes]"];

    fn cells(&self) -> Vec<String> {
        vec![self.minutes.to_string(), format!("{:.3e}", self.bytes)]
    }
}

/// Watches the demo for half an hour.
pub fn run() -> Result<Report<Row>, Box<dyn Error>> {
    mesh_file("channel-60k")?;
    built()?;
    let Seen { heaps, frames } = watched("nozzle", None, "memory.mjs")?;
    let mean = |until: usize| {
        let heaps = heaps.get(until.checked_sub(MEAN)?..until)?;
        Some(heaps.iter().sum::<f64>() / MEAN as f64)
    };
    let grown = mean(SETTLED).zip(mean(heaps.len())).map(|(settled, last)| last - settled);
    let name = format!("grown from minute {SETTLED} to {}, {frames} frames [bytes]", heaps.len());
    let targets = vec![Target::at_most(name, grown.ok_or("too few minutes were watched")?, 1e6)];
    let rows = (1..).zip(heaps).map(|(minutes, bytes)| Row { minutes, bytes }).collect();
    Ok(Report { rows, targets })
}
