//! The flow step by step, as a table.

use std::fs::{File, OpenOptions};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use tombolo_pipelines::files::write_durably;

use crate::Condition;
use crate::folder::make_folder_of;
use crate::solver::Solver;

/// The flux through the domain, and the pressure that it takes.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Through {
    /// Volume per time that flows in where the velocity is prescribed.
    pub mass_in: f64,
    /// Volume per time that flows out where the pressure is prescribed.
    pub mass_out: f64,
    /// Mean pressure where the velocity is prescribed less that where the pressure is; 0 where one
    /// of them is nowhere.
    pub pressure_drop: f64,
}

impl Through {
    /// As it is now.
    #[must_use]
    pub fn now(solver: &Solver) -> Self {
        let mut through = Self::default();
        let (mut inlets, mut outlets) = ((0.0, 0.0), (0.0, 0.0));
        for ((patch, flux), (pressure, area)) in
            solver.patches().iter().zip(solver.fluxes()).zip(solver.mean_pressures())
        {
            match patch.condition {
                Condition::Velocity(_) => {
                    through.mass_in -= flux;
                    inlets = (inlets.0 + pressure * area, inlets.1 + area);
                }
                Condition::Pressure(_) => {
                    through.mass_out += flux;
                    outlets = (outlets.0 + pressure * area, outlets.1 + area);
                }
                Condition::NoSlip | Condition::Slip => {}
            }
        }
        if inlets.1 > 0.0 && outlets.1 > 0.0 {
            through.pressure_drop = inlets.0 / inlets.1 - outlets.0 / outlets.1;
        }
        through
    }
}

const HEADER: &str = "cycle,time,pressure_drop,mass_in,mass_out,seconds";

/// A file of comma-separated values that gets one line for each step: the state at its end, and the
/// seconds since the run began.
///
/// An existing file keeps its content until the first step, so that a run that fails before it loses
/// nothing.
#[derive(Debug)]
pub(crate) struct History {
    file: PathBuf,
    /// The lines of an earlier run that this table goes on from.
    before: Option<String>,
    /// The seconds that it goes on from.
    seconds: f64,
    lines: Option<File>,
}

impl History {
    /// A table of its own.
    pub(crate) fn create(file: &Path) -> Result<Self, (PathBuf, io::Error)> {
        // Whether there can be such a file is to be known before the run.
        make_folder_of(file)
            .and_then(|()| OpenOptions::new().create(true).append(true).open(file))
            .map_err(|error| (file.to_owned(), error))?;
        Ok(Self { file: file.into(), before: None, seconds: 0.0, lines: None })
    }

    /// Goes on with the table of a run that is restarted: the lines of later steps are cut off, and
    /// one that is not whole.
    pub(crate) fn resume(file: &Path, cycle: u64) -> Result<Self, (PathBuf, io::Error)> {
        let text = match std::fs::read_to_string(file) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => String::new(),
            Err(error) => return Err((file.to_owned(), error)),
        };
        let mut history = Self::create(file)?;
        let mut before = HEADER.to_owned() + "\n";
        let columns = HEADER.split(',').count();
        let is_whole = |line: &&str| line.ends_with('\n') && line.split(',').count() == columns;
        for line in text.split_inclusive('\n').skip(1).filter(is_whole) {
            let number = line.split(',').next().and_then(|number| number.parse::<u64>().ok());
            if number.is_some_and(|number| number <= cycle) {
                before.push_str(line);
                let seconds = line.trim_end().rsplit(',').next().and_then(|it| it.parse().ok());
                history.seconds = seconds.unwrap_or(history.seconds);
            }
        }
        history.before = Some(before);
        Ok(history)
    }

    /// Adds what flows through at the end of a step.
    pub(crate) fn add(
        &mut self,
        cycle: u64,
        time: f64,
        through: Through,
        seconds: f64,
    ) -> Result<(), (PathBuf, io::Error)> {
        let Through { mass_in, mass_out, pressure_drop } = through;
        let seconds = self.seconds + seconds;
        let line = format!("{cycle},{time},{pressure_drop},{mass_in},{mass_out},{seconds:.6}\n");
        // At once: a run may be watched through it, may be ended by force, and goes on where a disk is
        // full.
        self.begin()
            .and_then(|lines| write_row(lines, line.as_bytes()))
            .map_err(|error| (self.file.clone(), error))
    }

    /// The end of the file, which is begun where it has not been.
    fn begin(&mut self) -> io::Result<&mut File> {
        let lines = match self.lines.take() {
            Some(lines) => lines,
            None => match &self.before {
                Some(before) => {
                    write_durably(&self.file, |out| out.write_all(before.as_bytes()))?;
                    let lines = OpenOptions::new().append(true).open(&self.file)?;
                    self.before = None;
                    lines
                }
                None => {
                    let mut lines = File::create(&self.file)?;
                    lines.write_all(format!("{HEADER}\n").as_bytes())?;
                    lines
                }
            },
        };
        Ok(self.lines.insert(lines))
    }
}

/// Writes a row whole or not at all: the next one would go on in the same line.
fn write_row(lines: &mut File, row: &[u8]) -> io::Result<()> {
    let end = lines.seek(SeekFrom::End(0))?;
    lines.write_all(row).inspect_err(|_| {
        let _ = lines.set_len(end);
    })
}
