//! `tombolo export`.

use std::{
    collections::{BTreeMap, BTreeSet},
    fmt::Write as _,
    fs::File,
    io::{BufWriter, Write},
    path::{Path, PathBuf},
    sync::Arc,
};

use crate::{
    deform::mesh::{CellType, Cells},
    pipelines::{
        encode::{DecodedCells, DecodedFrame, Decoder},
        extract::Extract,
        files::{Series, write, write_picture},
        language::Render,
        render::draw,
    },
    recording::{RecordedMessage, Recording},
};
use clap::Args;
use serde_json::Value;

use super::{Failure, say};

#[derive(Debug, Args)]
pub(crate) struct Options {
    /// The recording that a run has written
    file: PathBuf,
    /// The directory of the files
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Only this view
    #[arg(long, value_name = "NAME")]
    view: Option<String>,
    /// One in so many frames of each view
    #[arg(long, value_name = "N", default_value = "1")]
    every: std::num::NonZeroUsize,
    /// Write each frame as a .vtp, and a .pvd of each view that ParaView opens
    #[arg(long)]
    vtk: bool,
    /// Write the monitors of each pipeline as a .csv
    #[arg(long)]
    csv: bool,
    /// Draw each frame as a .png
    #[arg(long)]
    png: bool,
    /// The field that colours the pictures
    #[arg(long, value_name = "NAME", requires = "png")]
    color_by: Option<String>,
}

/// A view on its way into files.
#[derive(Default)]
struct View {
    cells: Arc<Cells>,
    seen: usize,
    series: Option<Series>,
    written: usize,
}

/// The monitors of a pipeline.
#[derive(Default)]
struct Table {
    titles: BTreeSet<String>,
    rows: Vec<(u64, f64, BTreeMap<String, f64>)>,
}

/// Rows of a table that are kept until all columns are known.
const ROWS: usize = 4 << 20;

/// Writes files of a recording: VTK and CSV where nothing else is asked for.
pub(crate) fn export(options: &Options) -> Result<(), Failure> {
    let mut recording = Recording::open(&options.file)?;
    std::fs::create_dir_all(&options.out)?;
    let is_all = !(options.vtk || options.csv || options.png);
    let (vtk, csv) = (options.vtk || is_all, options.csv || is_all);
    let mut decoder = Decoder::new();
    let mut views: BTreeMap<String, View> = BTreeMap::new();
    let mut tables: BTreeMap<String, Table> = BTreeMap::new();
    let mut undecoded = 0_usize;
    while let Some(recorded) = recording.read_next()? {
        match recorded.message {
            RecordedMessage::Frame { bytes, .. } if vtk || options.png => {
                // One that goes on from a damaged one; the next key frame is of use again.
                let Ok(frame) = decoder.decode(&bytes) else {
                    undecoded += 1;
                    continue;
                };
                if options.view.as_ref().is_none_or(|name| *name == frame.view) {
                    let view = views.entry(frame.view.clone()).or_default();
                    view.take(frame, options, vtk)?;
                }
            }
            RecordedMessage::Text(text) if csv && text.starts_with("{\"monitor\"") => {
                add(&mut tables, &text);
            }
            _ => {}
        }
    }
    for (pipeline, table) in &tables {
        table.write(&options.out.join(format!("{}.csv", file_name(pipeline))))?;
    }
    for (name, view) in &views {
        say(format!("{name}: {} of {} frames", view.written, view.seen))?;
    }
    for (name, table) in &tables {
        say(format!("{name}: {} measurements", table.rows.len()))?;
    }
    if undecoded > 0 || recording.lost_bytes() > 0 {
        let lost = recording.lost_bytes();
        say(format!("{undecoded} frames and the last {lost} bytes could not be read"))?;
    }
    match (&options.view, views.is_empty()) {
        (Some(name), true) if vtk || options.png => {
            Err(Failure::Wrong(format!("there is no view `{name}` in the recording")))
        }
        _ => Ok(()),
    }
}

impl View {
    fn take(&mut self, frame: DecodedFrame, options: &Options, vtk: bool) -> Result<(), Failure> {
        let DecodedFrame { view, cells, cycle, time, points, mut fields, .. } = frame;
        if let Some(cells) = cells {
            self.cells = Arc::new(cells_of(&cells)?);
        }
        self.seen += 1;
        if !(self.seen - 1).is_multiple_of(options.every.get()) {
            return Ok(());
        }
        fields.retain(|field| !field.values.is_empty());
        let cells = Arc::clone(&self.cells);
        let extract = Arc::new(Extract { points, vertices: None, cells, features: None, fields });
        let name = file_name(&view);
        if vtk {
            let path = options.out.join(format!("{name}-{cycle:06}.vtp"));
            write(&path, &extract)?;
            if self.series.is_none() {
                self.series = Some(Series::create(&options.out.join(format!("{name}.pvd")))?);
            }
            if let Some(series) = &mut self.series {
                series.push(time, &path)?;
            }
        }
        if options.png {
            let render = Render { field: options.color_by.clone(), ..Render::default() };
            let pictures = draw(&render, &extract, cycle, time).map_err(Failure::Wrong)?;
            for picture in pictures {
                let path = options.out.join(format!("{name}-{cycle:06}.png"));
                write_picture(&path, &picture.image)?;
            }
        }
        self.written += 1;
        Ok(())
    }
}

fn cells_of(decoded: &DecodedCells) -> Result<Cells, Failure> {
    let mut cells = Cells::new();
    for triangle in &decoded.triangles {
        cells.push(CellType::Triangle, triangle)?;
    }
    for line in &decoded.lines {
        cells.push(CellType::Line, line)?;
    }
    Ok(cells)
}

/// Adds what a message tells of monitors.
fn add(tables: &mut BTreeMap<String, Table>, text: &str) {
    let Ok(told) = serde_json::from_str::<Value>(text) else { return };
    let monitor = &told["monitor"];
    let (Some(pipeline), Some(cycle)) = (monitor["pipeline"].as_str(), monitor["cycle"].as_u64())
    else {
        return;
    };
    let table = tables.entry(pipeline.to_owned()).or_default();
    if table.rows.len() >= ROWS {
        return;
    }
    let values = monitor["values"].as_object().into_iter().flatten();
    let values: BTreeMap<String, f64> =
        values.map(|(name, value)| (name.clone(), value.as_f64().unwrap_or(f64::NAN))).collect();
    table.titles.extend(values.keys().cloned());
    table.rows.push((cycle, monitor["time"].as_f64().unwrap_or(f64::NAN), values));
}

impl Table {
    fn write(&self, path: &Path) -> std::io::Result<()> {
        let mut out = BufWriter::new(File::create(path)?);
        let mut line = "cycle,time".to_owned();
        self.titles.iter().for_each(|title| _ = write!(line, ",{title}"));
        writeln!(out, "{line}")?;
        for (cycle, time, values) in &self.rows {
            line.clear();
            let _ = write!(line, "{cycle},{time}");
            for title in &self.titles {
                match values.get(title).filter(|value| !value.is_nan()) {
                    Some(value) => _ = write!(line, ",{value}"),
                    None => line.push_str(",nan"),
                }
            }
            writeln!(out, "{line}")?;
        }
        out.flush()
    }
}

/// A name as that of a file.
fn file_name(name: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || matches!(c, '-' | '_' | '.');
    name.chars().map(|c| if is_plain(c) { c } else { '_' }).collect()
}
