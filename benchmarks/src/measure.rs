//! Time and memory, measured.

use std::time::Instant;

/// Runs of each measurement.
pub const RUNS: usize = 7;

/// The seconds that each of several runs took.
#[derive(Debug, Clone)]
pub struct Times(Vec<f64>);

impl Times {
    /// Seconds of no run yet.
    pub const fn new() -> Self {
        Self(Vec::new())
    }

    /// Runs something, and keeps the seconds that it takes.
    pub fn of<T>(&mut self, run: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = run();
        self.0.push(start.elapsed().as_secs_f64());
        result
    }

    /// Keeps seconds that were measured otherwise.
    pub fn add(&mut self, seconds: f64) {
        self.0.push(seconds);
    }

    /// The median of the runs; NaN of none.
    pub fn median(&self) -> f64 {
        self.percentile(0.5)
    }

    /// The mean of the runs; NaN of none.
    pub fn mean(&self) -> f64 {
        self.0.iter().sum::<f64>() / self.0.len() as f64
    }

    /// What this part of the runs, from 0 to 1, do not exceed; NaN of none.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an index")]
    pub fn percentile(&self, part: f64) -> f64 {
        let mut sorted = self.0.clone();
        sorted.sort_by(f64::total_cmp);
        let index = (part * sorted.len() as f64) as usize;
        sorted.get(index.min(sorted.len().saturating_sub(1))).copied().unwrap_or(f64::NAN)
    }
}

impl FromIterator<f64> for Times {
    fn from_iter<I: IntoIterator<Item = f64>>(seconds: I) -> Self {
        Self(seconds.into_iter().collect())
    }
}

/// The median of the seconds that `RUNS` runs take, after one that is not counted.
///
/// # Errors
/// The first error of a run.
pub fn median<E>(mut run: impl FnMut() -> Result<(), E>) -> Result<f64, E> {
    run()?;
    let mut times = Times::new();
    for _ in 0..RUNS {
        times.of(&mut run)?;
    }
    Ok(times.median())
}

/// The most memory that this process has had, in bytes.
///
/// # Errors
/// Where the system does not say.
pub fn memory_peak() -> Result<f64, Box<dyn std::error::Error>> {
    status("VmHWM:")
}

/// The memory that this process has now, in bytes.
///
/// # Errors
/// Where the system does not say.
pub fn memory() -> Result<f64, Box<dyn std::error::Error>> {
    status("VmRSS:")
}

fn status(key: &str) -> Result<f64, Box<dyn std::error::Error>> {
    let status = std::fs::read_to_string("/proc/self/status")?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix(key))
        .ok_or_else(|| format!("/proc/self/status has no {key}"))?;
    let kilobytes: f64 = line.trim().trim_end_matches("kB").trim().parse()?;
    Ok(1024.0 * kilobytes)
}

/// The processor seconds that this process has used in all its threads, to the hundredth.
///
/// # Errors
/// Where the system does not say.
pub fn processor_seconds() -> Result<f64, Box<dyn std::error::Error>> {
    let text = std::fs::read_to_string("/proc/self/stat")?;
    // After the program's name, in brackets, the 12th and 13th values are ticks in the program and
    // in the system.
    let after = text.rsplit(')').next().unwrap_or_default();
    let ticks =
        after.split_whitespace().skip(11).take(2).map(str::parse::<f64>).sum::<Result<f64, _>>()?;
    Ok(ticks / 100.0)
}
