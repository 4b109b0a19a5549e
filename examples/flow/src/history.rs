//! The flow step by step, as a table.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

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

/// A file of comma-separated values that gets one line for each step.
#[derive(Debug)]
pub(crate) struct History {
    file: PathBuf,
    lines: BufWriter<File>,
}

impl History {
    /// Creates the file, with the names of its columns: the state at the end of each step, and the
    /// seconds since the run began.
    pub(crate) fn create(file: &Path) -> Result<Self, (PathBuf, std::io::Error)> {
        let failed = |error| (file.to_owned(), error);
        make_folder_of(file).map_err(failed)?;
        let mut lines = BufWriter::new(File::create(file).map_err(failed)?);
        writeln!(lines, "cycle,time,pressure_drop,mass_in,mass_out,seconds").map_err(failed)?;
        Ok(Self { file: file.into(), lines })
    }

    /// Goes on with the file of a run that is restarted: the lines of later steps are cut off.
    pub(crate) fn resume(file: &Path, cycle: u64) -> Result<Self, (PathBuf, std::io::Error)> {
        let before = match std::fs::read_to_string(file) {
            Ok(before) => before,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => String::new(),
            Err(error) => return Err((file.to_owned(), error)),
        };
        let mut history = Self::create(file)?;
        let is_kept = |line: &&str| {
            let number = line.split(',').next().and_then(|number| number.parse::<u64>().ok());
            number.is_some_and(|number| number <= cycle)
        };
        for line in before.lines().skip(1).filter(is_kept) {
            writeln!(history.lines, "{line}").map_err(|error| (file.to_owned(), error))?;
        }
        Ok(history)
    }

    /// Adds what flows through at the end of a step.
    pub(crate) fn add(
        &mut self,
        cycle: u64,
        time: f64,
        through: Through,
        seconds: f64,
    ) -> Result<(), (PathBuf, std::io::Error)> {
        let Through { mass_in, mass_out, pressure_drop } = through;
        writeln!(self.lines, "{cycle},{time},{pressure_drop},{mass_in},{mass_out},{seconds:.6}")
            // A run may be watched through it, and may be ended by force.
            .and_then(|()| self.lines.flush())
            .map_err(|error| (self.file.clone(), error))
    }
}
