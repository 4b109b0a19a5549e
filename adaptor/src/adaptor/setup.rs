//! What a run is made of before its first step.

use std::{
    path::Path,
    sync::{Arc, atomic::AtomicBool},
    time::SystemTime,
};

use serde_json::json;
use tombolo_pipelines::language::{
    self, JournalNote, Problem, Problems, Recording, RunHeader, Validate,
};

use super::{
    Adaptor, Meetings, SteeredMesh, Told, commands::Intake, contract::Lent, timing::Timing,
};
use crate::{
    changes::Changes,
    error::InitializeError,
    journal::{Journal, JournalError},
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
        let Settings {
            config,
            communicator,
            solvers,
            parameters,
            conditions,
            orders,
            replay,
            output,
            file,
        } = settings;
        // A configuration built in Rust is held to the same rules as one read from a file.
        Problems::none(config.problems()).map_err(InitializeError::Configuration)?;
        Problems::none(orders.problems()).map_err(InitializeError::Orders)?;
        let parameters = Parameters::new(parameters)?;
        let known: Vec<&str> = parameters.all().iter().map(|known| &*known.name).collect();
        language::check_parameters(&config, &known).map_err(InitializeError::Configuration)?;
        let first = communicator.rank() == 0;
        let is_replay = replay.is_some();
        let Recording { run, commands, shapes, .. } = replay.unwrap_or_default();
        let orders = if is_replay { commands } else { orders };
        let defaults = run.map_or_else(|| Defaults::of(&config), Defaults::from);
        let queue = Arc::new(Queue::default());
        let hub = config.stream.as_ref().filter(|_| first).map(|_| Arc::new(Hub::default()));
        if let Some(hub) = &hub {
            hub.offer_pipelines(&config.pipelines);
        }
        let journal = match config.journal.as_ref().filter(|_| first) {
            Some(path) => open_journal(&output.join(path), &defaults, hub.clone())?,
            None => Journal::none(),
        };
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
                    is_replay,
                };
                Some(Server::start(stream, Arc::clone(hub), Arc::new(intake))?)
            }
            _ => None,
        };
        let watch = match file {
            Some(file) if config.watch && first && !is_replay => Some(
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
            defaults,
            pipelines: Pipelines::new(&config, Arc::clone(&communicator), &output)?,
            config,
            communicator,
            solvers,
            parameters,
            timed: Timed::new(orders),
            recorded: is_replay.then_some(shapes),
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
            output,
            mesh: SteeredMesh::Unknown,
            lent: Lent::default(),
            moment: Moment::default(),
            told: Told::default(),
            conditions,
            paused: false,
            stopped: false,
            is_replay,
            meetings: Meetings::default(),
            timing: Timing::default(),
        };
        adaptor.describe();
        adaptor.tell_conditions();
        Ok(adaptor)
    }
}

/// Begins the journal of a run, below those of earlier runs, and has viewers told when it cannot be
/// written.
fn open_journal(
    path: &Path,
    defaults: &Defaults,
    hub: Option<Arc<Hub>>,
) -> Result<Journal, JournalError> {
    let mut number = [0; 8];
    // Without random numbers the moment tells runs apart well enough.
    let _ = getrandom::fill(&mut number);
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    let Defaults { deform, guard, schedule } = defaults.clone();
    let header = RunHeader {
        id: format!("{:016x}", u64::from_le_bytes(number)),
        version: env!("CARGO_PKG_VERSION").into(),
        began: since.as_secs(),
        deform,
        guard,
        schedule,
    };
    let file = path.to_owned();
    Journal::open(path, &JournalNote::Run(header), move |lost| {
        let message = match lost {
            Some(reason) => format!(
                "the journal {} cannot be written: {reason}; no order is taken until it can",
                file.display()
            ),
            None => format!("the journal {} is written again", file.display()),
        };
        log::warn!("{message}");
        if let Some(hub) = &hub {
            hub.journal(lost);
            if lost.is_some() {
                hub.tell(&json!({"error": {"message": message}}));
            }
        }
    })
}
