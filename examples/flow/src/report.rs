//! What a run came to, as one JSON object.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Display;
use std::fs::{File, OpenOptions};
use std::path::Path;

use serde::Serialize;
use tombolo::communicator::Communicator;
use tombolo::stream::StreamCounts;
use tombolo::{OrderReport, PipelineReport, Spread};

use crate::folder::make_folder_of;
use crate::history::Through;
use crate::program_error::ProgramError;
use crate::ranks::agreed;
use crate::solver::{Solver, StepOutcome};

/// The report of a run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// How many steps were taken.
    pub cycles: u64,
    /// The simulated time reached.
    pub time: f64,
    /// The mesh, the worst of all its shapes.
    pub mesh: MeshReport,
    /// The outcome of each order.
    pub orders: Vec<OrderReport>,
    /// Seconds of a step of the solver.
    pub step_seconds: Spread,
    /// Seconds in the adaptor, by part.
    pub adaptor_seconds: BTreeMap<&'static str, Spread>,
    /// The frames that were streamed.
    pub stream: StreamCounts,
    /// The cost and the monitors of each pipeline.
    pub pipelines: Vec<PipelineReport>,
    /// The flow.
    pub flow: FlowReport,
    /// Why the journal could not be written when the run ended, where it could not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub journal_lost: Option<String>,
    /// What could not be written while the run went on, and why: the saved state, the history. Of
    /// several failures in a row the first, and no more than a hundred in all.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub unwritten: Vec<String>,
    /// Why the run ended early, where it did.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
}

/// The mesh of a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MeshReport {
    /// How many vertices it has.
    pub vertices: usize,
    /// How many cells.
    pub cells: usize,
    /// The most inverted cells of any shape since the run began or was restarted.
    pub inverted: usize,
    /// The least scaled Jacobian of any of these shapes.
    pub min_scaled_jacobian: f64,
}

/// The flow at the end of a run, and what its solves took since it began or was restarted.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct FlowReport {
    /// Volume per time that flows in where the velocity is prescribed.
    pub mass_in: f64,
    /// Volume per time that flows out where the pressure is prescribed.
    pub mass_out: f64,
    /// The greatest flux through the whole boundary in any step since the run began or was restarted,
    /// relative to the most that flowed through it; where nothing does, to the greatest velocity
    /// times the area of the boundary.
    pub worst_imbalance: f64,
    /// The part of its volume by which the fluid was stretched in all, or compressed where it is
    /// negative, since nothing lets it in or out: 0 with an outlet.
    pub stretch: f64,
    /// Mean pressure where the velocity is prescribed less that where the pressure is.
    pub pressure_drop: f64,
    /// The flux out through each feature.
    pub fluxes: BTreeMap<String, f64>,
    /// The mean pressure over each feature.
    pub mean_pressures: BTreeMap<String, f64>,
    /// The greatest velocity.
    pub max_velocity: f64,
    /// The greatest Courant number of any element.
    pub courant: f64,
    /// Iterations of the momentum solve per step.
    pub momentum_iterations: f64,
    /// Iterations of the pressure solve per step.
    pub pressure_iterations: f64,
    /// Steps with a solve that did not reach its tolerance.
    pub unconverged: u64,
    /// Seconds of the whole run, the adaptor's included.
    pub seconds: f64,
    #[serde(skip)]
    steps: u64,
    /// The most that flowed through the boundary in any step.
    #[serde(skip)]
    most_through: f64,
}

/// How many failures to write are kept for the report.
const UNWRITTEN: usize = 100;

/// Less than this part of what could flow through the boundary is nothing but rounding.
const NOTHING: f64 = 1e-9;

/// The files that could not be written while the run went on.
#[derive(Debug, Default)]
pub(crate) struct Unwritten {
    /// The first failures, as they were told.
    pub(crate) told: Vec<String>,
    failing: BTreeSet<&'static str>,
}

impl Unwritten {
    /// Notes an attempt to write; returns the text to tell, where it is the first in a row that failed.
    pub(crate) fn note(
        &mut self,
        what: &'static str,
        cycle: u64,
        written: Result<(), impl Display>,
    ) -> Option<String> {
        let Err(error) = written else {
            self.failing.remove(what);
            return None;
        };
        if !self.failing.insert(what) {
            return None;
        }
        let text = format!("cycle {cycle}: {what} could not be written: {error}");
        if self.told.len() < UNWRITTEN {
            self.told.push(text.clone());
        }
        Some(text)
    }
}

/// Opens the file that the report of a run is to go to, and makes it, with its folder, where it is
/// missing: what the run comes to is not to be lost for a name at which no file can be. A report that
/// is there stays as it is, until [`empty_file`]. The first rank does so. Collective.
///
/// # Errors
/// [`ProgramError::File`], on several ranks the same on all of them.
pub fn make_file(communicator: &dyn Communicator, file: &Path) -> Result<(), ProgramError> {
    on_first(communicator, file, || {
        make_folder_of(file)?;
        OpenOptions::new().write(true).create(true).truncate(false).open(file)
    })
}

/// Empties the file that the report of a run is to go to, once the run has begun: what another run
/// came to is not to be taken for it. The first rank does so. Collective.
///
/// # Errors
/// As those of [`make_file`].
pub fn empty_file(communicator: &dyn Communicator, file: &Path) -> Result<(), ProgramError> {
    on_first(communicator, file, || File::create(file))
}

fn on_first(
    communicator: &dyn Communicator,
    file: &Path,
    open: impl FnOnce() -> std::io::Result<File>,
) -> Result<(), ProgramError> {
    let opened = if communicator.rank() == 0 { open().map(drop) } else { Ok(()) };
    agreed(communicator, opened.map_err(|source| ProgramError::File { file: file.into(), source }))
}

impl FlowReport {
    /// Counts one step.
    pub(crate) fn count(&mut self, outcome: &StepOutcome, solver: &Solver) {
        let through: f64 = 0.5 * solver.fluxes().into_iter().map(f64::abs).sum::<f64>();
        self.most_through = self.most_through.max(through);
        self.worst_imbalance = self.worst_imbalance.max(outcome.imbalance.abs());
        self.stretch += outcome.stretch;
        self.steps += 1;
        self.momentum_iterations += outcome.momentum.iterations as f64;
        self.pressure_iterations += outcome.pressure.iterations as f64;
        self.unconverged += u64::from(!(outcome.momentum.converged && outcome.pressure.converged));
    }

    /// Measures the flow as it is at the end.
    pub(crate) fn measure(&mut self, solver: &Solver, time_step: f64) {
        let steps = self.steps.max(1) as f64;
        self.momentum_iterations /= steps;
        self.pressure_iterations /= steps;
        let mut whole_area = 0.0;
        for ((patch, flux), (pressure, area)) in
            solver.patches().iter().zip(solver.fluxes()).zip(solver.mean_pressures())
        {
            self.fluxes.insert(patch.name.clone(), flux);
            self.mean_pressures.insert(patch.name.clone(), pressure);
            whole_area += area;
        }
        Through {
            mass_in: self.mass_in,
            mass_out: self.mass_out,
            pressure_drop: self.pressure_drop,
        } = Through::now(solver);
        self.max_velocity = solver.max_velocity();
        let possible = self.max_velocity * whole_area;
        let through =
            if self.most_through > NOTHING * possible { self.most_through } else { possible };
        if through > 0.0 {
            self.worst_imbalance /= through;
        }
        self.courant = solver.courant(time_step);
    }
}
