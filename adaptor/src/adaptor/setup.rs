//! What a run is made of before its first step.

use std::{
    path::Path,
    sync::{Arc, atomic::AtomicBool},
    time::SystemTime,
};

use serde_json::json;
use tombolo_pipelines::language::{
    self, Problem, Problems, Recording, RestartedFrom, RunHeader, Validate,
};

use super::{
    Adaptor, Meetings, SteeredMesh, absence::Absence, checkpointing::Given, commands::Intake,
    contract::Lent, restarting::Continued, timing::Timing,
};
use crate::{
    changes::Changes,
    checkpoint::Checkpoint,
    error::InitializeError,
    journal::{Journal, JournalError},
    recorder::Recorder,
    settings::Settings,
    stages::Pipelines,
    steering::{
        Defaults, EditStack, Events, Log, Parameters, Queue, Timed, hash_of, without_carried_out,
    },
    step::Moment,
    stream::{Clock, Hub, Server, warn_of_readable_token},
    watch::Watch,
};

impl Adaptor {
    /// Sets a run up on this rank: what is wrong here alone is not agreed upon yet.
    pub(super) fn set_up(
        settings: Settings,
        continued: Option<Continued>,
        run: Arc<str>,
    ) -> Result<Self, InitializeError> {
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
            restart: _,
        } = settings;
        // A configuration built in Rust is held to the same rules as one read from a file.
        Problems::none(config.problems()).map_err(InitializeError::Configuration)?;
        Problems::none(orders.problems()).map_err(InitializeError::Orders)?;
        let mut parameters = Parameters::new(parameters)?;
        let known: Vec<&str> = parameters.all().iter().map(|known| &*known.name).collect();
        language::check_parameters(&config, &known).map_err(InitializeError::Configuration)?;
        let first = communicator.rank() == 0;
        let is_replay = replay.is_some();
        let Recording { run: before, commands, shapes, mut notes, .. } = replay.unwrap_or_default();
        let orders = if is_replay { commands } else { orders };
        let mut defaults = before.map_or_else(|| Defaults::of(&config), Defaults::from);
        let known: Vec<String> = known.into_iter().map(str::to_owned).collect();
        let mut given = Given { pipelines: config.pipelines.clone(), orders: hash_of(&orders) };
        let (mut orders, mut carried_out) = (orders, Vec::new());
        let mut moment = Moment::default();
        if let Some(Continued { checkpoint: Checkpoint { run: saved, .. }, .. }) = &continued {
            moment = Moment { cycle: saved.cycle, time: saved.time };
            if config.pipelines == saved.pipelines[1] {
                given.pipelines.clone_from(&saved.pipelines[0]);
                defaults.clone_from(&saved.defaults);
            }
            carried_out.clone_from(&saved.carried_out);
            if given.orders == saved.timed.0 {
                orders.clone_from(&saved.timed.1);
            } else {
                // The commands of another file take the place of those that were to come.
                let all = orders.len();
                orders = without_carried_out(orders, &carried_out);
                let count = all - orders.len();
                if first && count > 0 {
                    tracing::info!(
                        run = &*run,
                        "the file of orders is another one than before; {count} of its commands were carried out until \
                         cycle {}, and are not carried out again",
                        saved.cycle
                    );
                }
            }
            notes = continued.iter().flat_map(Continued::notes).cloned().collect();
            for (name, value) in &saved.parameters {
                if let Err(reason) = parameters.resume(name, *value)
                    && first
                {
                    tracing::warn!(run = &*run, "of the checkpoint: {reason}");
                }
            }
        }
        let limits = config.stream.as_ref().map(|stream| stream.limits).unwrap_or_default();
        let queue = Arc::new(Queue::new(&limits));
        let has_audience = config.stream.is_some() || config.record.is_some();
        let hub = (has_audience && first).then(|| Arc::new(Hub::new(Arc::clone(&run))));
        if let Some(hub) = &hub {
            hub.offer_pipelines(&config.pipelines);
        }
        let journal = match config.journal.as_ref().filter(|_| first) {
            Some(path) => {
                let restart = continued.as_ref().map(Continued::restarted_from);
                open_journal(&output.join(path), &run, restart, &defaults, hub.clone())?
            }
            None => Journal::none(),
        };
        let clock: Arc<Clock> = hub.as_ref().map(|hub| Arc::clone(&hub.clock)).unwrap_or_default();
        clock.set(moment);
        let events = Events::new(first.then(|| Arc::clone(&run)), Arc::clone(&clock));
        let log = Arc::new(Log::new(journal, hub.clone(), events));
        log.resume_notes(notes);
        let config = Arc::new(config);
        let mut pipelines =
            Pipelines::new(&config, Arc::clone(&communicator), &output, Arc::clone(&run))?;
        if let Some(Continued { checkpoint, .. }) = &continued {
            log.resume(checkpoint.run.known.clone());
            let last = checkpoint.run.has_begun.then_some(moment);
            pipelines.restore(&checkpoint.pipelines, last)?;
        }
        log.expect(orders.iter().filter_map(|timed| timed.id.as_deref()));
        let changes = Arc::new(Changes::new(
            Arc::clone(&config),
            known.clone(),
            Arc::clone(&queue),
            Arc::clone(&log),
            Arc::clone(&clock),
        ));
        if let (Some(stream), Some(file), true) = (&config.stream, &file, first) {
            warn_of_readable_token(&run, stream, file.path());
        }
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
                    absence: Absence::new(&config.steering, is_replay),
                };
                Some(Server::start(stream, Arc::clone(hub), Arc::new(intake))?)
            }
            _ => None,
        };
        let recorder = match (&config.record, &hub) {
            (Some(file), Some(hub)) => {
                let most = u64::from(config.record_megabytes.get()) << 20;
                let serves = server.is_some();
                Some(Recorder::start(&output.join(file), most, hub, log.told(), serves)?)
            }
            _ => None,
        };
        let met = continued.as_ref().and_then(|continued| continued.checkpoint.run.met);
        let watch = match file {
            Some(file) if config.watch && first && !is_replay => {
                Some(Watch::start(&file, known, Arc::clone(&changes), hub.clone()).map_err(
                    |source| InitializeError::Watch { file: file.path().into(), source },
                )?)
            }
            None if config.watch => {
                let message = "the configuration did not come from a file that could be watched";
                return Err(InitializeError::Configuration(
                    Problem::new(message).within("watch").into(),
                ));
            }
            _ => None,
        };
        let mut adaptor = Self {
            defaults,
            pipelines,
            config,
            communicator,
            solvers,
            parameters,
            timed: Timed::new(orders, carried_out),
            run,
            given,
            has_begun: continued.as_ref().is_some_and(|it| it.checkpoint.run.has_begun),
            resumed: continued.map(Continued::into_resumed).unwrap_or_default(),
            recorded: is_replay.then_some(shapes),
            queue,
            log,
            hub,
            clock,
            changes,
            waiting_changes: Vec::new(),
            changed: 0,
            saved: None,
            is_spared: AtomicBool::new(false),
            watch,
            forecaster,
            server,
            recorder,
            output,
            mesh: SteeredMesh::Unknown,
            replaced: None,
            lent: Lent::default(),
            moment,
            described: Arc::default(),
            reported_stack: EditStack::default(),
            conditions,
            paused: false,
            stopped: false,
            is_replay,
            meetings: Meetings::default(),
            timing: Timing::default(),
            look: None,
            in_plane: Default::default(),
        };
        if let Some(cycle) = met.filter(|_| adaptor.skips_meetings()) {
            adaptor.note_meeting(cycle);
        }
        adaptor.announce_resumed();
        adaptor.describe();
        adaptor.tell_conditions();
        Ok(adaptor)
    }
}

/// Begins the journal of a run, below those of earlier runs, and has viewers told when it cannot be
/// written.
fn open_journal(
    path: &Path,
    run: &str,
    restart: Option<RestartedFrom>,
    defaults: &Defaults,
    hub: Option<Arc<Hub>>,
) -> Result<Journal, JournalError> {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    let Defaults { deform, guard, schedule } = defaults.clone();
    let header = RunHeader {
        id: run.into(),
        version: env!("CARGO_PKG_VERSION").into(),
        began: since.as_secs(),
        deform,
        guard,
        schedule,
        restart,
    };
    let (file, run) = (path.to_owned(), run.to_owned());
    Journal::open(path, header, move |lost| {
        let message = match lost {
            Some(reason) => format!(
                "the journal {} cannot be written: {reason}; no order is taken until it can",
                file.display()
            ),
            None => format!("the journal {} is written again", file.display()),
        };
        let (run, path) = (&*run, file.display());
        tracing::warn!(run, %path, reason = lost, "{message}");
        if let Some(hub) = &hub {
            hub.journal(lost);
            if lost.is_some() {
                hub.tell(move || json!({"error": {"message": message}}));
            }
        }
    })
}
