//! `codec`: bits a value and MB/s of the codec that frames are sent with, beside SZ3, zfp and zstd,
//! on frames of flow and on made-up fields.

use std::error::Error;
use std::fs;
use std::path::Path;
use std::time::Instant;

use serde::{Deserialize, Serialize};
use serde_json::json;
use tombolo::pipelines::codec::{Bound, Coded, Field, Topology};
use tombolo_tests::project;

use crate::codec_cases::{Case, all};
use crate::peer;
use crate::report::{Line, Report, Target};

/// The bounds, in parts of the range.
const BOUNDS: [f64; 3] = [1e-2, 1e-3, 1e-4];
/// The bound of positions, in parts of the diagonal.
const POSITIONS: f64 = 1e-5;
/// Frames of a series that are not counted: what follows the second knows two.
const FIRST: usize = 2;

/// One field, coded one way.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// The case, the view and the field.
    name: String,
    /// The bound, in parts of the range.
    bound: f64,
    /// The codec, or one that it is compared with.
    method: String,
    /// Whether earlier frames are used.
    is_temporal: bool,
    /// Bits a value.
    bits: f64,
    /// MB/s of values in double precision, in encoding; 0 where not measured.
    speed: f64,
    /// The same of decoding; 0 where not measured.
    #[serde(default)]
    decoding: f64,
    /// The largest error of all values, in parts of the bound.
    error: f64,
}

impl Line for Row {
    const HEADINGS: &'static [&'static str] =
        &["field", "bound", "method", "frames", "bits", "MB/s", "decode MB/s", "error"];

    fn cells(&self) -> Vec<String> {
        let frames = if self.is_temporal { "series" } else { "single" };
        vec![
            self.name.clone(),
            format!("{:.0e}", self.bound),
            self.method.clone(),
            frames.into(),
            format!("{:.3}", self.bits),
            format!("{:.0}", self.speed),
            format!("{:.0}", self.decoding),
            format!("{:.4}", self.error),
        ]
    }
}

/// Measures all cases.
pub fn run() -> Result<Report<Row>, Box<dyn Error>> {
    let directory = tempfile::tempdir()?;
    let (mut rows, mut targets, mut jobs) = (Vec::new(), Vec::new(), Vec::new());
    for case in all()? {
        let start = Instant::now();
        let coded = topology(&case)?;
        let seconds = start.elapsed().as_secs_f64();
        let triangles = case.triangles.len() as f64;
        let alone =
            Topology::encode(&vec![[0.0; 3]; case.points.len()], &case.triangles, None, &[], 1.0)?;
        let bits = 8.0 * alone.message.len() as f64 / triangles;
        let name = |what: &str| format!("{}: {what}", case.name);
        let most = if case.name.contains("slice") { 5.2 } else { 3.0 };
        targets.push(Target::at_most(name("connectivity [bits a triangle]"), bits, most));
        let of_200k = seconds * 2e5 / case.points.len() as f64;
        if case.points.len() > 100_000 {
            targets.push(Target::at_most(name("a new topology of 200 k points [s]"), of_200k, 0.2));
        }
        for (field, components, frames) in &case.fields {
            let field = name(field);
            jobs.push(job(
                directory.path(),
                jobs.len(),
                &field,
                &case.points,
                *components,
                frames,
            )?);
            for bound in BOUNDS {
                rows.push(series(&field, &coded, *components, &frames[..1], bound)?);
                if frames.len() > FIRST {
                    rows.push(series(&field, &coded, *components, frames, bound)?);
                }
            }
        }
    }
    fs::write(directory.path().join("jobs.json"), json!(jobs).to_string())?;
    let mut peers = peer::python();
    peers.arg(project().join("benchmarks/peers/codec.py")).arg(directory.path());
    for line in peer::run(&mut peers)?.lines() {
        rows.push(serde_json::from_str(line)?);
    }
    rows.sort_by(|a: &Row, b: &Row| {
        (&a.name, a.is_temporal).cmp(&(&b.name, b.is_temporal)).then(b.bound.total_cmp(&a.bound))
    });

    let ours = |row: &&Row| row.method == "codec";
    let most = rows.iter().filter(ours).map(|row| row.error).fold(0.0, f64::max);
    targets.push(Target::at_most("the largest error [bounds]", most, 1.0));
    let mut worst = 0.0_f64;
    for row in rows.iter().filter(ours) {
        let same = |other: &&Row| {
            (&other.name, other.bound, other.is_temporal) == (&row.name, row.bound, row.is_temporal)
                && other.method != row.method
        };
        let best = rows.iter().filter(same).map(|other| other.bits).fold(f64::INFINITY, f64::min);
        worst = worst.max(row.bits / best);
    }
    targets.push(Target::at_most("bits beside the best other, in the worst row", worst, 1.0));
    Ok(Report { rows, targets })
}

fn topology(case: &Case) -> Result<Coded, Box<dyn Error>> {
    let diagonal =
        (0..3).map(|axis| range(case.points.as_flattened(), 3, axis).powi(2)).sum::<f64>().sqrt();
    Ok(Topology::encode(&case.points, &case.triangles, None, &[], POSITIONS * diagonal)?)
}

fn range(values: &[f64], components: usize, component: usize) -> f64 {
    let values = values.iter().skip(component).step_by(components);
    let [least, largest] = values
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], &value| [a.min(value), b.max(value)]);
    largest - least
}

fn widest(values: &[f64], components: usize) -> f64 {
    (0..components).map(|component| range(values, components, component)).fold(0.0, f64::max)
}

/// Codes a frame, or a series of them, and holds every value against the bound.
fn series(
    name: &str,
    coded: &Coded,
    components: usize,
    frames: &[Vec<f64>],
    part: f64,
) -> Result<Row, Box<dyn Error>> {
    let hierarchy = coded.topology.points();
    let (mut field, mut copy) = (Field::new(components), Field::new(components));
    let [mut bytes, mut values, mut encoding, mut decoding, mut error] = [0.0_f64; 5];
    let is_temporal = frames.len() > 1;
    for (index, frame) in frames.iter().enumerate() {
        let bound = part * widest(frame, components);
        let mut message = Vec::new();
        // Alone, the best of several runs.
        let runs = if is_temporal { 1 } else { 5 };
        let [mut encode_seconds, mut decode_seconds] = [f64::INFINITY; 2];
        let mut decoded = Vec::new();
        for _ in 0..runs {
            if !is_temporal {
                field.forget();
                message.clear();
            }
            let start = Instant::now();
            field.encode(hierarchy, &coded.points, frame, Bound::Absolute(bound), &mut message)?;
            encode_seconds = encode_seconds.min(start.elapsed().as_secs_f64());
            let start = Instant::now();
            decoded = copy.decode(hierarchy, &mut &message[..])?;
            decode_seconds = decode_seconds.min(start.elapsed().as_secs_f64());
        }
        for (tuple, &old) in decoded.chunks_exact(components).zip(&coded.points) {
            for (value, sent) in tuple.iter().zip(&frame[old as usize * components..]) {
                error = error.max((value - sent).abs() / bound);
            }
        }
        if !is_temporal || index >= FIRST {
            bytes += message.len() as f64;
            values += frame.len() as f64;
            encoding += encode_seconds;
            decoding += decode_seconds;
        }
    }
    Ok(Row {
        name: name.into(),
        bound: part,
        method: "codec".into(),
        is_temporal,
        bits: 8.0 * bytes / values,
        speed: 8e-6 * values / encoding,
        decoding: 8e-6 * values / decoding,
        error,
    })
}

/// Writes what the peers are to code.
fn job(
    directory: &Path,
    number: usize,
    name: &str,
    points: &[[f64; 3]],
    components: usize,
    frames: &[Vec<f64>],
) -> Result<serde_json::Value, Box<dyn Error>> {
    let write = |file: &str, values: &[f64]| {
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        fs::write(directory.join(file), bytes)
    };
    let at = format!("{number}-points");
    write(&at, points.as_flattened())?;
    let mut files = Vec::new();
    for (index, frame) in frames.iter().enumerate() {
        files.push(format!("{number}-{index}"));
        write(&files[index], frame)?;
    }
    let job = json!({"name": name, "components": components, "bounds": BOUNDS, "frames": files, "points": at});
    Ok(job)
}
