//! `viewer-memory`: the heap of the viewer's page over half an hour of the demo.

use std::error::Error;

use serde::{Deserialize, Serialize};

use crate::peer::mesh_file;
use crate::report::{Line, Report, Target};
use crate::viewer::{built, watched};

/// The minutes at the beginning that are passed over: until then the history of the monitors fills.
const SETTLED: usize = 5;

/// The minutes whose median is compared: what waits to be collected differs from one to the next by
/// some megabytes.
const MINUTES: usize = 10;

/// The output of `benchmarks/browser/memory.mjs`: the bytes of the heap after each minute, and how many
/// frames were shown.
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
    let median = |heaps: &[f64]| {
        let mut heaps = heaps.to_vec();
        heaps.sort_by(f64::total_cmp);
        heaps[heaps.len() / 2]
    };
    let settled = heaps.get(SETTLED..SETTLED + MINUTES).ok_or("too few minutes were watched")?;
    let last = &heaps[heaps.len() - MINUTES..];
    let name = format!(
        "heap of the last ten of {} minutes beyond that of minutes {} to {}, {frames} frames [bytes]",
        heaps.len(),
        SETTLED + 1,
        SETTLED + MINUTES
    );
    let targets = vec![Target::at_most(name, median(last) - median(settled), 3e6)];
    let rows = (1..).zip(heaps).map(|(minutes, bytes)| Row { minutes, bytes }).collect();
    Ok(Report { rows, targets })
}
