//! What a run is made of before its first step.

use std::sync::{Arc, atomic::AtomicBool};

use tombolo_pipelines::language::{self, Problem, Problems, Validate};

use super::{
    Adaptor, Meetings, SteeredMesh, Told, commands::Intake, contract::Lent, timing::Timing,
};
use crate::{
    changes::Changes,
    error::InitializeError,
    journal::Journal,
    settings::Settings,
    stages::Pipelines,
    steering::{Defaults, Log, Parameters, Queue, Timed},
    step::Moment,
    stream::{Hub, Server},
    watch::Watch,
};

impl Adaptor {
    /// Sets a run up on this rank: what is wrong here alone is not agreed upon yet.
    pub(super) fn set_up(settings: Settings) -> Result<Self, InitializeError> {
        let Settings { config, communicator, solvers, parameters, orders, output, file } = settings;
        // A configuration built in Rust is held to the same rules as one read from a file.
        Problems::none(config.problems()).map_err(InitializeError::Configuration)?;
        Problems::none(orders.problems()).map_err(InitializeError::Orders)?;
        let parameters = Parameters::new(parameters)?;
        let known: Vec<&str> = parameters.all().iter().map(|known| &*known.name).collect();
        language::check_parameters(&config, &known).map_err(InitializeError::Configuration)?;
        let first = communicator.rank() == 0;
        let journal = match config.journal.as_ref().filter(|_| first) {
            Some(path) => Journal::create(&output.join(path))?,
            None => Journal::none(),
        };
        let queue = Arc::new(Queue::default());
        let hub = config.stream.as_ref().filter(|_| first).map(|_| Arc::new(Hub::default()));
        if let Some(hub) = &hub {
            hub.offer_pipelines(&config.pipelines);
        }
        let log = Arc::new(Log::new(journal, hub.clone()));
        let clock = hub.as_ref().map(|hub| Arc::clone(&hub.clock)).unwrap_or_default();
        let config = Arc::new(config);
        let known: Vec<String> = known.into_iter().map(str::to_owned).collect();
        let changes = Arc::new(Changes::new(
            Arc::clone(&config),
            known.clone(),
            Arc::clone(&queue),
            Arc::clone(&log),
            Arc::clone(&clock),
        ));
        let forecaster = Arc::default();
        let server = match (&config.stream, &hub) {
            (Some(stream), Some(hub)) => {
                let intake = Intake {
                    queue: Arc::clone(&queue),
                    log: Arc::clone(&log),
                    hub: Arc::clone(hub),
                    forecaster: Arc::clone(&forecaster),
                    changes: Arc::clone(&changes),
                    is_in_parts: communicator.size() > 1,
                };
                Some(Server::start(stream, Arc::clone(hub), Arc::new(intake))?)
            }
            _ => None,
        };
        let watch = match file {
            Some(file) if config.watch && first => Some(
                Watch::start(&file, known, Arc::clone(&changes), hub.clone())
                    .map_err(|source| InitializeError::Watch { file, source })?,
            ),
            None if config.watch => {
                let message = "the configuration did not come from a file that could be watched";
                return Err(InitializeError::Configuration(
                    Problem::new(message).within("watch").into(),
                ));
            }
            _ => None,
        };
        let adaptor = Self {
            defaults: Defaults::of(&config),
            pipelines: Pipelines::new(&config, Arc::clone(&communicator), &output)?,
            config,
            communicator,
            solvers,
            parameters,
            timed: Timed::new(orders),
            queue,
            log,
            hub,
            clock,
            changes,
            told_changes: Vec::new(),
            changed: 0,
            is_spared: AtomicBool::new(false),
            watch,
            forecaster,
            server,
            mesh: SteeredMesh::Unknown,
            lent: Lent::default(),
            moment: Moment::default(),
            told: Told { schema: language::order_schema(), ..Told::default() },
            paused: false,
            stopped: false,
            meetings: Meetings::default(),
            timing: Timing::default(),
        };
        adaptor.describe();
        adaptor.tell_conditions();
        Ok(adaptor)
    }
}
