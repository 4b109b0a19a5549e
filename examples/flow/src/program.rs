//! The program `flow`: a case, steered through the adaptor.

use std::io::Write;
use std::mem::replace;
use std::num::NonZeroU64;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use tombolo::communicator::{Communicator, Solo};
use tombolo::{Adaptor, ConfigurationFile, FinalizeError, Restart, Settings, Step, Stopper};
use tombolo_deform::features::FeatureSettings;
use tombolo_deform::linear::{BuiltIn, Solvers};
use tombolo_deform::mesh::{Mesh, NumberType, Vector};
use tombolo_deform::surface::Surface;
use tombolo_pipelines::extract::{Association, Channel, Field, FieldView};
use tombolo_pipelines::files::{self, Compression};
use tombolo_pipelines::language::{Config, Listen, Recording, StreamServer, TimedCommand};

use crate::Patch;
use crate::case::Case;
use crate::folder::make_folder_of;
use crate::history::{History, Through};
use crate::parts::{Dealing, Share};
pub use crate::program_error::ProgramError;
use crate::ranks::agreed;
use crate::report::{FlowReport, MeshReport, Report, Unwritten};
use crate::saved::{self, State};
use crate::solver::{Motion, Settings as SolverSettings, Solver};

/// Tells something of a run. Whoever has closed the terminal or file that it goes to wants to hear nothing.
pub fn tell(what: std::fmt::Arguments<'_>) {
    drop(writeln!(std::io::stderr(), "flow: {what}"));
}

/// By which part of its volume a fluid may be stretched before that is told.
const STRETCH: f64 = 1e-6;

/// The options of a run.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// The case file.
    pub case: PathBuf,
    /// The pipelines; without them those that the case names.
    pub pipelines: Option<PathBuf>,
    /// The orders to carry out; without them those that the case names.
    pub orders: Option<PathBuf>,
    /// The journal whose newest run is carried out again, in place of all orders.
    pub replay: Option<PathBuf>,
    /// How many steps to take.
    pub steps: Option<u64>,
    /// The least time that a step takes on the clock.
    pub pace: Duration,
    /// Whether to run without a server for viewers.
    pub headless: bool,
    /// Where the server listens, in place of what the pipelines say.
    pub listen: Option<Listen>,
    /// Where the final state is written, and what the pipelines write.
    pub out: Option<PathBuf>,
    /// Where the flow is written step by step, as comma-separated values.
    pub history: Option<PathBuf>,
    /// Where the state of the run is saved, and after how many steps again; at the end of the run too.
    pub checkpoint: Option<(PathBuf, NonZeroU64)>,
    /// The saved state that the run goes on from.
    pub restart: Option<PathBuf>,
    /// How the mesh is dealt out, where there are several ranks.
    pub dealing: Dealing,
    /// How the equations are solved.
    pub solves: SolverSettings,
}

/// A run that has been set up.
pub struct Run {
    case: Case,
    communicator: Arc<dyn Communicator>,
    out: Option<PathBuf>,
    steps: Option<u64>,
    pace: Duration,
    checkpoint: Option<(PathBuf, NonZeroU64)>,
    adaptor: Adaptor,
    solver: Solver,
    share: Share,
    /// The mesh as it was read, on the rank that writes it.
    whole: Option<Mesh>,
    points: Vec<Vector>,
    /// The parameters that are asked for; where they make no flow, the solver still has those before.
    parameters: Vec<f64>,
    worst: MeshReport,
    flow: FlowReport,
    /// Whether the flow is written step by step: by the first rank, and measured by all.
    has_history: bool,
    has_told_stretch: bool,
    history: Option<History>,
    unwritten: Unwritten,
}

/// The input that every rank reads from files.
struct Read {
    case: Case,
    config: Config,
    /// The file that the configuration was read from.
    pipelines: Option<ConfigurationFile>,
    orders: Vec<TimedCommand>,
    replay: Option<Recording>,
    mesh: Mesh,
    surface: Surface,
    patches: Vec<Patch>,
    state: Option<State>,
}

impl Read {
    fn new(options: &Options, rank: usize) -> Result<Self, ProgramError> {
        let case = Case::read(&options.case)?;
        let (config, pipelines) = config(options, &case)?;
        let orders = orders(options, &case)?;
        let replay = replay(options)?;
        let mesh = files::read_mesh(&case.mesh)?.mesh;
        let surface = Surface::extract(&mesh, &FeatureSettings::default())?;
        let patches = case.patches(&options.case, &surface)?;
        let state = options.restart.as_deref().map(|file| State::read(file, rank)).transpose()?;
        Ok(Self { case, config, pipelines, orders, replay, mesh, surface, patches, state })
    }
}

impl Run {
    /// Reads everything, and starts the server where there is to be one.
    ///
    /// # Errors
    /// [`ProgramError`] naming the file and the place in it.
    pub fn new(options: &Options) -> Result<Self, ProgramError> {
        Self::on(Arc::new(Solo), options)
    }

    /// A run on several ranks, each of which gets a part of the mesh. Collective, as everything is
    /// that a run does; the first rank has the server and writes the files.
    ///
    /// Every rank reads the mesh file and keeps its part.
    ///
    /// # Errors
    /// [`ProgramError`], on several ranks the same on all of them.
    pub fn on(
        communicator: Arc<dyn Communicator>,
        options: &Options,
    ) -> Result<Self, ProgramError> {
        Self::solved_by(communicator, Arc::new(BuiltIn), options)
    }

    /// Starts a run with another choice of solvers for the motion of the mesh, such as PETSc's.
    ///
    /// # Errors
    /// As [`Run::on`].
    pub fn solved_by(
        communicator: Arc<dyn Communicator>,
        solvers: Arc<dyn Solvers>,
        options: &Options,
    ) -> Result<Self, ProgramError> {
        let is_first = communicator.rank() == 0;
        let read = agreed(&*communicator, Read::new(options, communicator.rank()))?;
        let Read { case, config, pipelines, orders, replay, mesh, surface, patches, state } = read;
        let declared = case.declared_parameters();
        let mut parameters: Vec<f64> = declared.iter().map(|parameter| parameter.value).collect();
        let role = |patch: &Patch| (patch.name.clone(), patch.role(mesh.points(), &parameters));
        let conditions = patches.iter().map(role).collect();
        let (share, patches) = Share::of(&communicator, &mesh, &surface, patches, options.dealing)?;
        let whole = (is_first && options.out.is_some()).then_some(mesh);
        let (fluid, settings) = (case.fluid(&parameters), options.solves);
        let mut solver = Solver::new(&share.mesh, share.shared.halo(), patches, fluid, settings)?;
        solver.set_parameters(&parameters);
        let (velocity, pressure) = case.initial_values();
        solver.initialise(&velocity, &pressure);
        let mut restart = None;
        if let Some(state) = &state {
            let checkpoint = state.restore(&*communicator, &mut solver)?;
            restart = Some(Restart::Checkpoint(Box::new(checkpoint)));
            parameters.copy_from_slice(solver.parameters());
        }
        let history = options.history.as_deref().filter(|_| is_first).map(|file| match &state {
            Some(_) => History::resume(file, solver.cycle()),
            None => History::create(file),
        });
        let history = agreed(&*communicator, history.transpose().map_err(unwritten))?;
        if let Some(out) = &options.out {
            let made = if is_first { std::fs::create_dir_all(out) } else { Ok(()) };
            agreed(&*communicator, made.map_err(|source| unwritten((out.clone(), source))))?;
        }
        if let Some((file, _)) = &options.checkpoint {
            let made = if is_first { make_folder_of(file) } else { Ok(()) };
            agreed(&*communicator, made.map_err(|source| unwritten((file.clone(), source))))?;
        }
        let adaptor = Adaptor::initialize(Settings {
            config,
            communicator: Arc::clone(&communicator),
            solvers,
            parameters: declared,
            conditions,
            orders,
            replay,
            restart,
            output: options.out.clone().unwrap_or_else(|| PathBuf::from(".")),
            file: pipelines,
        })?;
        let points = solver.points();
        // With viewers a run goes on until somebody stops it, unless it was told when to end.
        let steps = options.steps.or_else(|| options.headless.then_some(case.steps));
        Ok(Self {
            worst: share.measure(&*communicator, &points),
            points,
            flow: FlowReport::default(),
            has_history: options.history.is_some(),
            has_told_stretch: false,
            history,
            unwritten: Unwritten::default(),
            out: options.out.clone(),
            steps,
            pace: options.pace,
            checkpoint: options.checkpoint.clone(),
            case,
            communicator,
            adaptor,
            solver,
            share,
            whole,
            parameters,
        })
    }

    /// The link that programs open, with the secret of those who may drive; `None` without a server.
    #[must_use]
    pub fn link(&self) -> Option<String> {
        self.adaptor.link()
    }

    /// The text that invites a person to open the run: see [`Adaptor::invitation`].
    ///
    /// # Errors
    /// Where the file of the links cannot be written.
    pub fn invitation(&mut self, terminal: bool) -> std::io::Result<Option<String>> {
        self.adaptor.invitation(terminal)
    }

    /// Something that asks the run to stop, from another thread.
    #[must_use]
    pub fn stopper(&self) -> Stopper {
        self.adaptor.stopper()
    }

    /// Steps until the end, writes the final state where it is wanted, and says what happened.
    ///
    /// A flow that diverges ends the run early; the report then says so in `error`, and where the
    /// final state cannot be written.
    ///
    /// # Errors
    /// [`ProgramError`] where the adaptor cannot go on.
    pub fn finish(mut self) -> Result<Report, ProgramError> {
        let begun = Instant::now();
        let mut error = match self.advance(begun) {
            Ok(()) => None,
            Err(error @ ProgramError::Solver(_)) => Some(error.to_string()),
            Err(error) => return Err(error),
        };
        self.flow.seconds = begun.elapsed().as_secs_f64();
        self.flow.measure(&self.solver, self.case.time_step);
        if let Some(folder) = &self.out {
            let written = self.write(&folder.join("final.vtu"));
            let fault = agreed(&*self.communicator, written).err();
            error = error.or(fault.map(|fault| fault.to_string()));
        }
        let adaptor = match self.adaptor.finalize() {
            Ok(report) => report,
            Err(FinalizeError::Files { report, first, count }) => {
                let text = format!(
                    "{count} file(s) of the pipelines could not be written; the first: {first}"
                );
                tell(format_args!("{text}"));
                self.unwritten.told.push(text);
                *report
            }
            Err(error) => return Err(error.into()),
        };
        Ok(Report {
            cycles: self.solver.cycle(),
            time: self.solver.time(),
            mesh: self.worst,
            orders: adaptor.orders,
            step_seconds: adaptor.step_seconds,
            adaptor_seconds: adaptor.adaptor_seconds,
            stream: adaptor.stream,
            pipelines: adaptor.pipelines,
            flow: self.flow,
            journal_lost: adaptor.journal_lost,
            unwritten: self.unwritten.told,
            error,
        })
    }

    /// Takes the steps.
    fn advance(&mut self, begun: Instant) -> Result<(), ProgramError> {
        if let (Some(steps), cycle @ 1..) = (self.steps, self.solver.cycle())
            && steps <= cycle
            && self.communicator.rank() == 0
        {
            tell(format_args!("the state is at cycle {cycle}: {steps} steps leave nothing to do"));
        }
        let time_step = self.case.time_step;
        let (mut velocity, mut pressure) = (self.solver.velocity(), self.solver.pressure());
        while self.steps.is_none_or(|steps| self.solver.cycle() < steps) {
            let step_begun = Instant::now();
            let step = Step { cycle: self.solver.cycle(), time: self.solver.time(), time_step };
            let fields = [
                FieldView::vertex("velocity", &velocity),
                FieldView::vertex("pressure", &pressure),
            ];
            let mesh = self.share.view(&self.points);
            let steering =
                self.adaptor.execute(&step, &[Channel { name: "fluid", mesh, fields: &fields }])?;
            // What the adaptor saves belongs to the end of the step that it was shown.
            if steering.stop && self.checkpoint.is_none() {
                break;
            }
            for (name, value) in &steering.parameters {
                if let Some(index) = self.case.parameters.keys().position(|known| known == name) {
                    self.parameters[index] = *value;
                }
            }
            if !steering.parameters.is_empty() {
                let fluid = self.case.fluid(&self.parameters);
                let changed = self.solver.change(&self.parameters, fluid, time_step);
                if let Err(error) = changed
                    && self.communicator.rank() == 0
                {
                    tell(format_args!(
                        "cycle {}: {error}; the flow goes on with the parameters before",
                        step.cycle
                    ));
                }
            }
            let coordinates = steering.motion.map(|motion| motion.coordinates);
            let motion = coordinates.as_deref().map(|points| Motion { points });
            let outcome = match self.solver.step(time_step, motion) {
                Ok(outcome) => outcome,
                Err(error) => {
                    // The mesh that the flow belongs to: a shape that is refused is none of the run's.
                    self.points = self.solver.points();
                    return Err(error.into());
                }
            };
            if let Some(coordinates) = coordinates {
                self.points.copy_from_slice(&coordinates);
                let shape = self.share.measure(&*self.communicator, &self.points);
                self.worst.inverted = self.worst.inverted.max(shape.inverted);
                self.worst.min_scaled_jacobian =
                    self.worst.min_scaled_jacobian.min(shape.min_scaled_jacobian);
            }
            self.flow.count(&outcome, &self.solver);
            let tells =
                self.flow.stretch.abs() > STRETCH && !replace(&mut self.has_told_stretch, true);
            if tells && self.communicator.rank() == 0 {
                tell(format_args!(
                    "cycle {}: the domain has no outlet, but its volume changes: the fluid is stretched by {:e} of it; an outlet would let it pass",
                    step.cycle, self.flow.stretch
                ));
            }
            if self.has_history {
                let (cycle, time, through) =
                    (self.solver.cycle(), self.solver.time(), Through::now(&self.solver));
                let seconds = begun.elapsed().as_secs_f64();
                let add = |history: &mut History| {
                    history.add(cycle, time, through, seconds).map_err(unwritten)
                };
                let added = self.history.as_mut().map_or(Ok(()), add);
                let added = agreed(&*self.communicator, added);
                self.note("the history", added);
            }
            self.solver.velocity_into(&mut velocity);
            self.solver.pressure_into(&mut pressure);
            let is_last = steering.stop || self.steps == Some(self.solver.cycle());
            if let Some((file, every)) = &self.checkpoint
                && (is_last || self.solver.cycle() % *every == 0)
            {
                let checkpoint = self.adaptor.checkpoint();
                let saved = saved::write(&*self.communicator, file, &self.solver, &checkpoint);
                self.note("the state", saved);
            }
            if steering.stop {
                break;
            }
            std::thread::sleep(self.pace.saturating_sub(step_begun.elapsed()));
        }
        Ok(())
    }

    /// Tells what could not be written at the end of a step. A run does not end for that: what was
    /// written before is still there, and there may be room again the next time.
    fn note<E: std::fmt::Display>(&mut self, what: &'static str, written: Result<(), E>) {
        if let Some(told) = self.unwritten.note(what, self.solver.cycle(), written)
            && self.communicator.rank() == 0
        {
            tell(format_args!("{told}; the run goes on"));
        }
    }

    /// Writes the mesh as it is, its features, the velocity and the pressure, in the numbers of the
    /// file it was read from. Collective; the first rank writes.
    fn write(&self, file: &Path) -> Result<(), ProgramError> {
        let communicator = &*self.communicator;
        let before = || self.whole.as_ref().map_or(Vec::new(), |mesh| mesh.points().to_vec());
        let none = || vec![[0.0; 3]; self.whole.as_ref().map_or(0, |mesh| mesh.points().len())];
        let pressure: Vec<Vector> =
            self.solver.pressure().into_iter().map(|value| [value, 0.0, 0.0]).collect();
        let gathered = [
            self.share.gather(communicator, &self.points, before()),
            self.share.gather(communicator, &self.solver.velocity(), none()),
            self.share.gather(communicator, &pressure, none()),
        ];
        let (Some(whole), [Some(points), Some(velocity), Some(pressure)]) = (&self.whole, gathered)
        else {
            return Ok(());
        };
        let velocity = Field {
            name: "velocity".into(),
            association: Association::Vertex,
            components: 3,
            number: NumberType::F64,
            values: velocity.into_flattened(),
        };
        let pressure = Field {
            name: "pressure".into(),
            association: Association::Vertex,
            components: 1,
            number: NumberType::F64,
            values: pressure.into_iter().map(|[value, ..]| value).collect(),
        };
        let mesh = whole.with_points(points)?;
        Ok(files::write_mesh(file, &mesh, &[velocity, pressure], Compression::default())?)
    }
}

fn unwritten((file, source): (PathBuf, std::io::Error)) -> ProgramError {
    ProgramError::File { file, source }
}

fn config(
    options: &Options,
    case: &Case,
) -> Result<(Config, Option<ConfigurationFile>), ProgramError> {
    let settings = match options.pipelines.as_ref().or(case.pipelines.as_ref()) {
        None => Settings::default(),
        Some(file) => Settings::from_file(file)?,
    };
    let mut config = settings.config;
    if options.headless {
        config.stream = None;
    } else {
        let server = config.stream.get_or_insert_with(StreamServer::default);
        if options.listen.is_some() {
            server.listen.clone_from(&options.listen);
        }
    }
    Ok((config, settings.file))
}

fn orders(options: &Options, case: &Case) -> Result<Vec<TimedCommand>, ProgramError> {
    if options.replay.is_some() {
        return Ok(Vec::new());
    }
    match options.orders.as_ref().or(case.orders.as_ref()) {
        None => Ok(Vec::new()),
        Some(file) => Ok(Settings::default().orders_from_file(file)?.orders),
    }
}

fn replay(options: &Options) -> Result<Option<Recording>, ProgramError> {
    match &options.replay {
        None => Ok(None),
        Some(file) => Ok(Settings::default().replay_from_file(file)?.replay),
    }
}
