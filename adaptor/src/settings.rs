//! What a solver hands to the adaptor and gets back.

use std::{path::PathBuf, sync::Arc};

use tombolo_deform::{mesh::Vector, number::Number, partition::Partition};
use tombolo_pipelines::{
    communicator::{Communicator, RankError, Solo},
    distributed::Ranks,
    extract::ChannelError,
    language::{Config, LanguageError, TimedCommand},
};

use crate::{
    journal::JournalError,
    steering::{Parameter, ParameterError},
    stream::StreamError,
};

/// Makes of the ranks that have the parts of a mesh, and of where the vertices of this rank's part lie, a partition with solvers of
/// its own.
pub type Solvers = Arc<dyn Fn(Ranks, &[Vector]) -> Arc<dyn Partition> + Send + Sync>;

/// Everything that a run is set up with.
#[derive(Clone)]
pub struct Settings {
    /// What to watch, stream and write, and how orders become mesh motion; read it with
    /// [`language::parse`](tombolo_pipelines::language::parse).
    pub config: Config,
    /// The processes that the mesh is distributed over.
    pub communicator: Arc<dyn Communicator>,
    /// What puts solvers of linear systems in place of the ones that several ranks have otherwise, such as PETSc's; `None`: these.
    pub solvers: Option<Solvers>,
    /// The numbers of the solver that can be steered.
    pub parameters: Vec<Parameter>,
    /// Commands known beforehand; read a file of them, or a journal, with
    /// [`language::parse_orders`](tombolo_pipelines::language::parse_orders). They take effect at their cycle exactly: the
    /// solver waits for their plans.
    pub orders: Vec<TimedCommand>,
    /// The directory of the files that pipelines write and of the journal, where their names are relative.
    pub output: PathBuf,
}

impl Default for Settings {
    /// One process, nothing to watch, nothing to steer, files in the current directory.
    fn default() -> Self {
        let config = Config {
            version: 1,
            stream: None,
            journal: None,
            steering: Default::default(),
            pipelines: Vec::new(),
        };
        Self {
            config,
            communicator: Arc::new(Solo),
            solvers: None,
            parameters: Vec::new(),
            orders: Vec::new(),
            output: PathBuf::from("."),
        }
    }
}

/// A step that the solver is about to take, from `time` to `time + time_step`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// Its number.
    pub cycle: u64,
    /// The simulated time at its start.
    pub time: f64,
    /// Its length; it may vary from step to step. 0 for a steady solver, whose mesh then has no velocity.
    pub time_step: f64,
}

/// What the solver is asked to do in the step that follows.
#[derive(Debug, Clone, Copy, Default)]
pub struct Steering<'a> {
    /// Where to move the mesh over the step; `None`: it stays where it is.
    pub motion: Option<MeshMotion<'a>>,
    /// Parameters that changed since the last call, by name, each with its new value.
    pub parameters: &'a [(String, f64)],
    /// Whether the solver should end. Once true it stays true.
    pub stop: bool,
}

/// A motion of the mesh over one step.
///
/// It is asked for, not assumed to be made: the coordinates lent at the next call say whether it was.
#[derive(Debug, Clone, Copy)]
pub struct MeshMotion<'a> {
    /// The coordinates of each vertex at the end of the step: the reference's plus the displacement that the stack of edits
    /// makes (or a shape on the way there), plus what the solver has moved the mesh by itself. With every order taken back, and no
    /// motion of the solver's own, they are the reference's, bit for bit.
    pub coordinates: &'a [Vector],
    /// From the coordinates as they were lent to these.
    pub displacement: &'a [Vector],
    /// `displacement / time_step`, for an arbitrary Lagrangian-Eulerian (ALE) solver; 0 in a steady one.
    pub velocity: &'a [Vector],
    /// The motion of the boundary's vertices alone, for a solver that moves its volume by itself.
    pub surface: SurfaceMotion<'a>,
    /// Which shape of the order's schedule this is, counted from 1, and how many there are.
    pub shape: (u32, u32),
    /// The order's name.
    pub order: &'a str,
}

/// A motion of the boundary over one step: one entry for each of its vertices on this rank.
///
/// It holds what [`MeshMotion`] holds of these vertices. With `"deform": {"method": "surface"}` there is no other motion: no volume
/// is solved for, the vertices inside are handed back as they were lent, and the solver moves them by itself.
#[derive(Debug, Clone, Copy)]
pub struct SurfaceMotion<'a> {
    /// The vertices: numbers into the coordinates that the solver lends. The same, in the same order, in the whole run.
    pub vertices: &'a [u32],
    /// Where each is at the end of the step.
    pub coordinates: &'a [Vector],
    /// From where it was lent to there.
    pub displacement: &'a [Vector],
    /// `displacement / time_step`; 0 in a steady solver.
    pub velocity: &'a [Vector],
}

/// Why a run could not be set up.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum InitializeError {
    /// The server for viewers could not be started.
    #[error(transparent)]
    Stream(#[from] StreamError),
    /// The journal could not be created.
    #[error(transparent)]
    Journal(#[from] JournalError),
    /// A parameter's declaration makes no sense.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The configuration, or one of the commands given beforehand, makes no sense.
    #[error(transparent)]
    Language(#[from] LanguageError),
    /// The configuration or a command cannot be written as JSON.
    #[error("the configuration or the orders cannot be written as JSON: {0}")]
    Unwritable(serde_json::Error),
    /// Something is wrong on one rank, or the ranks were given different configurations. All ranks have this error.
    #[error(transparent)]
    Rank(#[from] RankError),
    /// The pipelines cannot be run.
    #[error("{0}")]
    Pipelines(String),
}

/// What a solver did wrong. Nothing was changed; it may go on and call again.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExecuteError {
    /// Nothing was handed over.
    #[error("cycle {cycle}: no channel was given")]
    NoChannel {
        /// The step.
        cycle: u64,
    },
    /// The channel that orders change was there, and is not any more.
    #[error("cycle {cycle}: {reason}; orders change the shape of that channel")]
    SteeredChannel {
        /// The step.
        cycle: u64,
        /// Which channel, and which there are.
        reason: String,
    },
    /// A time that is none.
    #[error("cycle {cycle}: {what} is {}; it must be finite{}", Number(*value), if *what == "time_step" { " and not below 0" } else { "" })]
    Time {
        /// The step.
        cycle: u64,
        /// `time` or `time_step`.
        what: &'static str,
        /// What it is.
        value: f64,
    },
    /// What was lent makes no sense.
    #[error("cycle {cycle}: {source}")]
    Channel {
        /// The step.
        cycle: u64,
        /// Which channel, which array, and what was expected.
        source: ChannelError,
    },
    /// The mesh has the vertices of the first call, and other cells.
    #[error(
        "cycle {cycle}: channel '{channel}' has other cells than the reference mesh of the first call ({found} now, {expected} then); \
         shapes are measured from that mesh, so its cells must stay the same, in their order; a solver that makes another mesh calls release_shape"
    )]
    OtherCells {
        /// The step.
        cycle: u64,
        /// The channel.
        channel: String,
        /// How many there are.
        found: usize,
        /// How many there were.
        expected: usize,
    },
    /// Something is wrong on one rank. All ranks have this error, that of the lowest rank on which something is wrong.
    #[error(transparent)]
    Rank(#[from] RankError),
    /// The ranks have come to different cycles.
    #[error(
        "the ranks call execute for cycles from {lowest} to {highest}; expected the same cycle on all of them"
    )]
    Cycles {
        /// The lowest.
        lowest: u64,
        /// The highest.
        highest: u64,
    },
    /// The ranks have come to different times.
    #[error(
        "cycle {cycle}: the ranks call execute for times from {earliest} to {latest}; expected the same time on all of them"
    )]
    Times {
        /// The step.
        cycle: u64,
        /// The earliest.
        earliest: f64,
        /// The latest.
        latest: f64,
    },
    /// The mesh is not the one of the first call.
    #[error(
        "cycle {cycle}: channel '{channel}' has {found} vertices, but the reference mesh of the first call had {expected}; \
         shapes are measured from that mesh, so its vertices must stay the same"
    )]
    VertexCount {
        /// The step.
        cycle: u64,
        /// The channel.
        channel: String,
        /// How many there are.
        found: usize,
        /// How many there were.
        expected: usize,
    },
}

/// What went wrong in the course of a run without stopping it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FinalizeError {
    /// Files that pipelines asked for were not written.
    #[error("{count} file(s) could not be written; the first: {first}")]
    Files {
        /// How many.
        count: usize,
        /// What was wrong with the first.
        first: String,
        /// The report of the run.
        report: Box<crate::Report>,
    },
}
