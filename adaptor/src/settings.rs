//! What a run is set up with.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use tombolo_deform::{
    communicator::{Communicator, Solo},
    linear::{BuiltIn, Solvers},
};
use tombolo_pipelines::language::{self, Config, ReadError, Recording, TimedCommand};

use crate::{
    checkpoint::{Checkpoint, Restart},
    condition::Condition,
    steering::Parameter,
    watch::ConfigurationFile,
};

/// Everything that a run is set up with.
#[derive(Clone)]
pub struct Settings {
    /// The configuration: what to watch, stream and write, and how orders become mesh motion; read
    /// it with [`language::check`](tombolo_pipelines::language::check).
    pub config: Config,
    /// The processes that the mesh is distributed over.
    pub communicator: Arc<dyn Communicator>,
    /// The choice of solvers for the motion of a volume on several ranks, such as PETSc's.
    pub solvers: Arc<dyn Solvers>,
    /// The numbers of the solver that can be steered.
    pub parameters: Vec<Parameter>,
    /// The conditions on the features of the mesh, by the features' names. Viewers hold inflow and
    /// outflow still until somebody wants otherwise. A feature that is not named may be anything.
    pub conditions: BTreeMap<String, Condition>,
    /// Commands known beforehand; read a file of them, or a journal, with
    /// [`language::check_orders`](tombolo_pipelines::language::check_orders). They take effect at
    /// their cycle exactly: the solver waits for their plans.
    pub orders: Vec<TimedCommand>,
    /// The journal that this run carries out again, in place of `orders`; read it with
    /// [`language::parse_journal`](tombolo_pipelines::language::parse_journal). A solver that is the
    /// same, with the same configuration, is handed the same shapes at the same cycles, to the bit.
    /// What pipelines order meanwhile is passed over, because the journal holds it.
    pub replay: Option<Recording>,
    /// Where the run goes on from: the checkpoint of an earlier one, made with the same mesh and on as
    /// many ranks. With the same configuration and `orders` it goes on as that one would have; other
    /// pipelines or orders take the place of those that it had. The first call of `execute` is the one
    /// that would have come next.
    pub restart: Option<Restart>,
    /// The directory of the files that pipelines write and of the journal, where their names are
    /// relative.
    pub output: PathBuf,
    /// The file that the configuration was read from, where it was: with `"watch": true` the
    /// adaptor looks at it again while the run goes on.
    pub file: Option<ConfigurationFile>,
}

impl Settings {
    /// Settings with the configuration that is in a file. See
    /// [`Adaptor::from_file`](crate::Adaptor::from_file).
    ///
    /// # Errors
    /// [`ReadError`], which names the file, and the line and column of everything that is wrong.
    pub fn from_file(file: impl AsRef<Path>) -> Result<Self, ReadError> {
        let file = ConfigurationFile::read(file.as_ref())?;
        Ok(Self { config: file.config().clone(), file: Some(file), ..Self::default() })
    }

    /// Lets a number of the solver be steered, from its value now to any in a range.
    #[must_use]
    pub fn parameter(
        mut self,
        name: impl Into<String>,
        value: f64,
        range: RangeInclusive<f64>,
    ) -> Self {
        let (minimum, maximum) = range.into_inner();
        self.parameters.push(Parameter { name: name.into(), value, minimum, maximum });
        self
    }

    /// Says which condition the solver imposes on a feature of the mesh.
    #[must_use]
    pub fn condition(mut self, feature: impl Into<String>, condition: Condition) -> Self {
        self.conditions.insert(feature.into(), condition);
        self
    }

    /// Adds the commands that are in a file, such as a journal.
    ///
    /// # Errors
    /// [`ReadError`], which names the file, and the line and column of everything that is wrong.
    pub fn orders_from_file(mut self, file: impl AsRef<Path>) -> Result<Self, ReadError> {
        let file = file.as_ref();
        let text = language::read_orders_text(file)?;
        self.orders.extend(language::check_orders(&text, &file.display().to_string())?);
        Ok(self)
    }

    /// Carries out the newest run of a journal again.
    ///
    /// # Errors
    /// [`ReadError`], which names the file, and the line and column of what is wrong.
    pub fn replay_from_file(self, file: impl AsRef<Path>) -> Result<Self, ReadError> {
        let file = file.as_ref();
        let text = language::read_orders_text(file)?;
        let recording = language::parse_journal(&text, &file.display().to_string())?;
        if recording.lost > 0 {
            let (path, lost) = (file.display(), recording.lost);
            tracing::warn!(%path, "{path}: {lost} lines are missing; the replay is that of what is there");
        }
        Ok(Self { replay: Some(recording), ..self })
    }

    /// Goes on from a checkpoint: see [`Settings::restart`](Settings#structfield.restart).
    #[must_use]
    pub fn restart(self, checkpoint: Checkpoint) -> Self {
        Self { restart: Some(Restart::Checkpoint(Box::new(checkpoint))), ..self }
    }

    /// Goes on from the file that [`Adaptor::write_checkpoint`](crate::Adaptor::write_checkpoint) has
    /// written. It is read when the run starts.
    #[must_use]
    pub fn restart_from_file(self, file: impl Into<PathBuf>) -> Self {
        Self { restart: Some(Restart::File(file.into())), ..self }
    }

    /// Distributes the run over the processes of a communicator.
    #[must_use]
    pub fn on(self, communicator: Arc<dyn Communicator>) -> Self {
        Self { communicator, ..self }
    }
}

impl Default for Settings {
    /// One process, nothing to watch, nothing to steer, files in the current directory.
    fn default() -> Self {
        let config = Config {
            version: 1,
            description: None,
            stream: None,
            journal: None,
            record: None,
            record_megabytes: language::record_megabytes(),
            steering: Default::default(),
            watch: false,
            units: BTreeMap::new(),
            pipelines: Vec::new(),
        };
        Self {
            config,
            communicator: Arc::new(Solo),
            solvers: Arc::new(BuiltIn),
            parameters: Vec::new(),
            conditions: BTreeMap::new(),
            orders: Vec::new(),
            replay: None,
            restart: None,
            output: PathBuf::from("."),
            file: None,
        }
    }
}
