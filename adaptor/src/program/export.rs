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
    deform::{
        mesh::{CellType, Cells},
        names,
    },
    pipelines::{
        encode::{DecodedCells, DecodedFrame, Decoder},
        extract::Extract,
        files::{Series, write, write_picture},
        language::Render,
        render::draw,
    },
    recording::{RecordedMessage, Recording},
    table::head,
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
    written: usize,
    /// What its files of this run are called.
    name: String,
    series: Option<Series>,
    /// How many runs have shown it so far.
    runs: usize,
    /// The cycle of its last frame, and how many greetings came before it.
    last: Option<(u64, usize)>,
    /// Why pictures lack the colours that were asked for.
    plain: Option<String>,
}

/// The names of files that are taken.
#[derive(Default)]
struct Names(BTreeSet<String>);

impl Names {
    /// The name of the files of a view or a pipeline, which no other has.
    fn take(&mut self, name: &str) -> String {
        let plain = file_name(name);
        let all = std::iter::once(plain.clone()).chain((2..).map(|n| format!("{plain}-{n}")));
        // Some file systems do not tell capitals from others.
        let mut free = all.filter(|name| self.0.insert(name.to_lowercase()));
        free.next().unwrap_or(plain)
    }
}

/// The monitors of a pipeline.
#[derive(Default)]
struct Table {
    titles: BTreeSet<String>,
    rows: Vec<(u64, f64, BTreeMap<String, f64>)>,
}

/// Rows of a table that are kept until all columns are known.
const ROWS: usize = 4 << 20;

/// Views that are named where the one that is asked for is none of them.
const NAMED: usize = 40;

/// Writes files of a recording: VTK and CSV where nothing else is asked for.
pub(crate) fn export(options: &Options) -> Result<(), Failure> {
    let mut recording = Recording::open(&options.file)?;
    std::fs::create_dir_all(&options.out).map_err(|error| unwritten(&options.out, &error))?;
    let is_all = !(options.vtk || options.csv || options.png);
    let (vtk, csv) = (options.vtk || is_all, options.csv || is_all);
    let mut decoder = Decoder::new();
    let mut views: BTreeMap<String, View> = BTreeMap::new();
    let mut names = Names::default();
    let mut tables: BTreeMap<String, Table> = BTreeMap::new();
    let mut undecoded = 0_usize;
    let mut greetings = 0_usize;
    let mut others = BTreeSet::new();
    let mut take = |recorded: RecordedMessage| -> Result<(), Failure> {
        match recorded {
            RecordedMessage::Frame { bytes, .. } if vtk || options.png => {
                // One that goes on from a damaged one; the next key frame is of use again.
                let Ok(frame) = decoder.decode(&bytes) else {
                    undecoded += 1;
                    return Ok(());
                };
                if options.view.as_ref().is_none_or(|name| *name == frame.view) {
                    let view = views.entry(frame.view.clone()).or_default();
                    view.go_on(&frame, greetings, &mut names);
                    view.take(frame, options, vtk)?;
                } else if others.len() < NAMED && !others.contains(&frame.view) {
                    others.insert(frame.view.clone());
                }
            }
            RecordedMessage::Text(text) if begins_run(&text) => greetings += 1,
            RecordedMessage::Text(text) if csv && text.starts_with("{\"monitor\"") => {
                add(&mut tables, &text);
            }
            _ => {}
        }
        Ok(())
    };
    let mut outcome = Ok(());
    while let Some(recorded) = recording.read_next()? {
        let is_text = matches!(recorded.message, RecordedMessage::Text(_));
        // Whatever is wrong with a frame, tables are written.
        if outcome.is_ok() || is_text {
            outcome = outcome.and(take(recorded.message));
        }
    }
    if let (Some(name), true, Ok(())) = (&options.view, views.is_empty(), &outcome)
        && (vtk || options.png)
    {
        return Err(unknown(name, &others));
    }
    let mut names = Names::default();
    for (pipeline, table) in &tables {
        let path = options.out.join(format!("{}.csv", names.take(pipeline)));
        table.write(&path).map_err(|error| unwritten(&path, &error))?;
    }
    outcome?;
    for (name, view) in &views {
        say(format!("{name}: {} of {} frames", view.written, view.seen))?;
        if let Some(reason) = &view.plain {
            say(format!("{name}: drawn without colours: {reason}"))?;
        }
    }
    for (name, table) in &tables {
        say(format!("{name}: {} measurements", table.rows.len()))?;
    }
    if undecoded > 0 || recording.lost_bytes() > 0 {
        let lost = recording.lost_bytes();
        say(format!("{undecoded} frames and {lost} bytes could not be read"))?;
    }
    Ok(())
}

/// The error where no frame is of the view that is asked for; `others` are the views that there are.
fn unknown(name: &str, others: &BTreeSet<String>) -> Failure {
    let near = names::hint(name, others.iter().map(String::as_str));
    let others: Vec<_> = others.iter().map(|other| format!("`{other}`")).collect();
    let known = match others.as_slice() {
        [] => "it has none".to_owned(),
        others => format!("it has {}", others.join(", ")),
    };
    Failure::Wrong(format!("there is no view `{name}` in the recording: {known}{near}"))
}

fn unwritten(path: &Path, error: &std::io::Error) -> Failure {
    Failure::Wrong(format!("{} cannot be written: {error}", path.display()))
}

/// Whether a message is the first of a run: later greetings of it have no orders.
fn begins_run(text: &str) -> bool {
    text.starts_with("{\"hello\"")
        && serde_json::from_str::<serde_json::Value>(text)
            .is_ok_and(|told| told["hello"]["orders"].is_array())
}

impl View {
    /// Goes on to a frame. Where another run has begun it has files and a series of its own: cycles
    /// rise in a run.
    fn go_on(&mut self, frame: &DecodedFrame, greetings: usize, names: &mut Names) {
        let is_of_run = self.last.is_some_and(|(cycle, greeted)| {
            frame.cycle > cycle || (frame.cycle == cycle && greetings == greeted)
        });
        if !is_of_run {
            self.runs += 1;
            self.name = match self.runs {
                1 => names.take(&frame.view),
                runs => names.take(&format!("{}-run-{runs}", frame.view)),
            };
            self.series = None;
        }
        self.last = Some((frame.cycle, greetings));
    }

    fn take(&mut self, frame: DecodedFrame, options: &Options, vtk: bool) -> Result<(), Failure> {
        let DecodedFrame { cells, cycle, time, points, mut fields, .. } = frame;
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
        let name = &self.name;
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
            let pictures = match draw(&render, &extract, cycle, time) {
                Err(reason) if render.field.is_some() => {
                    self.plain.get_or_insert(reason);
                    draw(&Render { field: None, ..render }, &extract, cycle, time)
                }
                drawn => drawn,
            };
            let pictures = pictures.map_err(Failure::Wrong)?;
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
        let titles: Vec<String> = self.titles.iter().cloned().collect();
        writeln!(out, "{}", head(&titles))?;
        let mut line = String::new();
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_several_names_are_never_called_alike() {
        let mut names = Names::default();
        let taken = ["wall two", "wall_two", "Wall two", "wall_two-2"].map(|name| names.take(name));
        assert_eq!(taken, ["wall_two", "wall_two-2", "Wall_two-3", "wall_two-2-2"]);
    }

    #[test]
    fn titles_with_commas_are_one_column() {
        let folder = tempfile::tempdir().unwrap();
        let mut tables = BTreeMap::new();
        let text = r#"{"monitor": {"pipeline": "a", "cycle": 3, "time": 0.5, "values": {"p, Pa": 2, "q": null}}}"#;
        add(&mut tables, text);
        let file = folder.path().join("a.csv");
        tables["a"].write(&file).unwrap();
        let text = std::fs::read_to_string(file).unwrap();
        assert_eq!(text, "cycle,time,\"p, Pa\",q\n3,0.5,2,nan\n");
    }
}
