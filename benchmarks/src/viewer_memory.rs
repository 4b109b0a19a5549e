//! `viewer-memory`: the heap of the viewer's page over half an hour of the demo.

use std::error::Error;

use serde::{Deserialize, Serialize};

use crate::peer::mesh_file;
use crate::report::{Line, Report, Target};
use crate::viewer::{built, watched};

/// The minutes at the beginning that are passed over: until then the history of the monitors fills.
const SETTLED: usize = 5;

/// The minutes whose median is compared: frames that are under way differ from one to the next by some
/// hundred kilobytes.
const MINUTES: usize = 10;

/// The output of `benchmarks/browser/memory.mjs`: the bytes of the heap after each minute, held and not
/// yet collected, and how many frames were shown.
#[derive(Deserialize)]
struct Seen {
    held: Vec<f64>,
    uncollected: Vec<f64>,
    frames: usize,
}

/// The heap after garbage collection, and just before it.
#[derive(Serialize)]
pub struct Row {
    minutes: usize,
    bytes: f64,
    uncollected: f64,
}

impl Line for Row {
    const HEADINGS: &'static [&'static str] =
        &["minutes", "heap held [bytes]", "before collection [bytes]"];

    fn cells(&self) -> Vec<String> {
        vec![
            self.minutes.to_string(),
            format!("{:.3e}", self.bytes),
            format!("{:.3e}", self.uncollected),
        ]
    }
}

/// Watches the demo for half an hour.
pub fn run() -> Result<Report<Row>, Box<dyn Error>> {
    mesh_file("channel-60k")?;
    built()?;
    let Seen { held, uncollected, frames } = watched("nozzle", None, "memory.mjs")?;
    let median = |heaps: &[f64]| {
        let mut heaps = heaps.to_vec();
        heaps.sort_by(f64::total_cmp);
        heaps[heaps.len() / 2]
    };
    let settled = held.get(SETTLED..SETTLED + MINUTES).ok_or("too few minutes were watched")?;
    let last = &held[held.len() - MINUTES..];
    let name = format!(
        "heap held in the last ten of {} minutes beyond that of minutes {} to {}, {frames} frames [bytes]",
        held.len(),
        SETTLED + 1,
        SETTLED + MINUTES
    );
    let targets = vec![Target::at_most(name, median(last) - median(settled), 3e6)];
    let rows = (1..)
        .zip(held.into_iter().zip(uncollected))
        .map(|(minutes, (bytes, uncollected))| Row { minutes, bytes, uncollected })
        .collect();
    Ok(Report { rows, targets })
}
