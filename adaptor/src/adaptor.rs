//! The three calls.

mod absence;
mod changing;
mod checkpointing;
mod commands;
mod contract;
mod description;
mod ending;
mod restarting;
mod setup;
mod steered;
mod stopper;
mod tagged;
#[cfg(test)]
mod tests;
mod timing;
mod waiting;
mod watching;

pub use stopper::Stopper;

use std::{
    collections::{BTreeMap, BTreeSet},
    net::SocketAddr,
    path::Path,
    path::PathBuf,
    sync::{
        Arc, OnceLock,
        atomic::{AtomicBool, Ordering},
    },
    time::Instant,
};

use checkpointing::{Given, random_name};
use contract::Lent;
use restarting::{Continued, Resumed};
use serde_json::Value;
use steered::SteeredMesh;
use timing::Timing;
use tombolo_deform::{
    communicator::{Alarm, Communicator, agree},
    linear::Solvers,
};
use tombolo_pipelines::{
    extract::Channel,
    language::{Config, HandedShape, ReadError},
    run::History,
};

use crate::{
    changes::Changes,
    condition::Condition,
    error::{ExecuteError, InitializeError},
    meeting,
    recorder::Recorder,
    settings::Settings,
    stages::Pipelines,
    steering::{Defaults, EditStack, Forecaster, Log, Parameters, Queue, Source, Steering, Timed},
    step::{Moment, Outside, Step},
    stream::{Clock, Hub, Server},
    watch::Watch,
};

/// Links a solver to its viewers and to the orders that change its shape.
///
/// See the [crate's page](crate) for a whole solver.
pub struct Adaptor {
    config: Arc<Config>,
    communicator: Arc<dyn Communicator>,
    solvers: Arc<dyn Solvers>,
    parameters: Parameters,
    defaults: Defaults,
    pipelines: Pipelines,
    timed: Timed,
    /// The number of the run, by which its journal tells it apart from others.
    run: Arc<str>,
    given: Given,
    /// The rest of the checkpoint that the run goes on from.
    resumed: Resumed,
    /// The shapes of the journal that is carried out again, until there is a mesh.
    recorded: Option<Vec<HandedShape>>,
    queue: Arc<Queue>,
    log: Arc<Log>,
    hub: Option<Arc<Hub>>,
    clock: Arc<Clock>,
    /// The changes of pipelines that were taken in.
    changes: Arc<Changes>,
    /// Changes of pipelines that all ranks know of and that were not made yet.
    waiting_changes: Vec<changing::WaitingChange>,
    /// How many changes of pipelines were made.
    changed: u64,
    /// How many of the commands in the queue are in the checkpoint that was made since the last call;
    /// `None` where none was made.
    saved: Option<usize>,
    /// Whether the solver was told that the step to come does not look at its mesh and fields.
    is_spared: AtomicBool,
    /// Looks at the configuration's file.
    watch: Option<Watch>,
    /// Answers viewers, once there is a mesh.
    forecaster: Arc<OnceLock<Forecaster>>,
    server: Option<Server>,
    /// Keeps what viewers are told.
    recorder: Option<Recorder>,
    /// The directory of the output.
    output: PathBuf,
    mesh: SteeredMesh,
    /// Why the mesh that this call lends is another one, where the solver says so.
    replaced: Option<&'static str>,
    lent: Lent,
    /// The step of the last call, and whether there was one.
    moment: Moment,
    has_begun: bool,
    described: Arc<Described>,
    /// The stack of edits that viewers were told of last.
    reported_stack: EditStack,
    /// The flow conditions of the features, by name.
    conditions: BTreeMap<String, Condition>,
    paused: bool,
    stopped: bool,
    /// Whether the run is carried out as a journal says.
    is_replay: bool,
    meetings: Meetings,
    timing: Timing,
    /// The host's function that `execute` calls while it waits.
    look: Option<waiting::Look>,
    /// The channels whose vertices have two coordinates.
    in_plane: BTreeSet<String>,
}

/// When the ranks come together.
#[derive(Default)]
struct Meetings {
    /// Calls so far.
    calls: u64,
    /// The fault of this rank since the last meeting.
    fault: Option<ExecuteError>,
    /// The cycle of the last, where they do not come together at every call.
    last: Option<u64>,
}

/// The part of `hello` that does not change from order to order.
#[derive(Default)]
struct Described {
    channel: String,
    fields: Value,
    features: Value,
    surface: Value,
}

impl Settings {
    /// Starts the run: [`Adaptor::initialize`].
    ///
    /// # Errors
    /// [`InitializeError`].
    pub fn start(self) -> Result<Adaptor, InitializeError> {
        Adaptor::initialize(self)
    }
}

impl Adaptor {
    /// The settings of a run whose configuration is in a file: to be completed, and started.
    ///
    /// ```
    /// use tombolo::Adaptor;
    ///
    /// # let directory = tempfile::tempdir()?;
    /// # let file = directory.path().join("pipelines.json");
    /// # std::fs::write(&file, r#"{"version": 1}"#)?;
    /// let adaptor = Adaptor::from_file(&file)?.parameter("heating", 1.0, 0.0..=10.0).start()?;
    /// assert_eq!(adaptor.parameter("heating"), Some(1.0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`ReadError`], which names the file, and the line and column of everything that is wrong.
    pub fn from_file(file: impl AsRef<Path>) -> Result<Settings, ReadError> {
        Settings::from_file(file)
    }

    /// The number of the run, the same on all ranks: its journal and the events that it tells of itself
    /// ([`logging`](crate::logging)) have it, so that they can be told apart from those of another run.
    #[must_use]
    pub fn run_id(&self) -> &str {
        &self.run
    }

    /// The value of a parameter now; `None` where there is none of that name.
    #[must_use]
    pub fn parameter(&self, name: &str) -> Option<f64> {
        self.parameters
            .all()
            .iter()
            .find(|parameter| parameter.name == name)
            .map(|parameter| parameter.value)
    }

    /// Sets a run up: starts the server and the journal that the configuration asks for.
    ///
    /// # Errors
    /// [`InitializeError`]: an address in use, a journal that cannot be written, a configuration, a
    /// parameter or a command that makes no sense. On several ranks all have the same error, also
    /// where they were given different configurations.
    ///
    /// Collective, as the other two calls are.
    pub fn initialize(mut settings: Settings) -> Result<Self, InitializeError> {
        let communicator = Arc::clone(&settings.communicator);
        let _alarm = Alarm::among(&communicator);
        let own = serde_json::to_vec(&(
            (&settings.config, &settings.orders, &settings.replay),
            (&settings.parameters, &settings.conditions),
        ));
        let continued = Continued::of(&mut settings)?;
        let mut run = random_name().into_bytes();
        communicator.broadcast(0, &mut run);
        let adaptor = Self::set_up(settings, continued, String::from_utf8_lossy(&run).into());
        if communicator.size() == 1 {
            return adaptor;
        }
        let is_mistake = adaptor.as_ref().is_err_and(InitializeError::is_mistake);
        let is_mistake = communicator.any(is_mistake);
        let adaptor = agree(&*communicator, adaptor);
        let adaptor = if is_mistake { adaptor.map_err(InitializeError::Given)? } else { adaptor? };
        let own = own.unwrap_or_default();
        let mut first = own.clone();
        communicator.broadcast(0, &mut first);
        let same = if own == first {
            Ok(())
        } else {
            Err("its configuration, orders, parameters or conditions are not those of rank 0")
        };
        agree(&*communicator, same).map_err(InitializeError::Given)?;
        Ok(adaptor)
    }

    /// The link that a viewer opens, with the secret of those who may drive; `None` without a server.
    /// Of a server that listens on all addresses it has the machine's name.
    ///
    /// It is for programs: whoever reads it can steer the run. To tell a person how to open the run
    /// there is [`invitation`](Adaptor::invitation).
    #[must_use]
    pub fn link(&self) -> Option<String> {
        self.server.as_ref().map(Server::link)
    }

    /// The link of those who watch and can never drive; `None` without a server.
    #[must_use]
    pub fn watching_link(&self) -> Option<String> {
        self.server.as_ref().map(Server::watching_link)
    }

    /// A new link that opens one browser, once; `None` without a server, or where the system has no
    /// random numbers for it.
    #[must_use]
    pub fn browser_link(&self) -> Option<String> {
        self.server.as_ref().and_then(Server::browser_link)
    }

    /// The text that invites a person to open the run; `None` without a server.
    ///
    /// All links, for driving and for watching, are written to the file `tombolo-PORT.link` in the
    /// directory of the output, which only its owner can read and which goes with the adaptor. On a
    /// `terminal` the text has a link that opens one browser, once; anywhere else, such as in the log
    /// of a batch job, it names the file alone. So it does on several ranks: what starts them lends
    /// them a terminal of its own, and passes what they print on to wherever it goes.
    ///
    /// # Errors
    /// Where the file cannot be written.
    pub fn invitation(&mut self, terminal: bool) -> std::io::Result<Option<String>> {
        let terminal = terminal && self.communicator.size() == 1;
        let invite = |server: &Server| server.invitation(&self.output, terminal);
        self.server.as_ref().map(invite).transpose()
    }

    /// The address that viewers connect to; `None` without a server, and where it listens on a path.
    #[must_use]
    pub fn address(&self) -> Option<SocketAddr> {
        self.server.as_ref().and_then(Server::address)
    }

    /// Shows the solver's present state and says what to do in the step that follows.
    ///
    /// `channels` are borrowed for the length of the call; the mesh that orders change is the first
    /// one's, or that of the [`steered_channel`](Adaptor::steered_channel). As it is at the first
    /// call it is the reference from which all shapes are measured. A motion is asked for, for the
    /// coming step; the coordinates lent at the next call say whether it was made.
    ///
    /// Where no pipeline is due, no command has arrived and no motion is under way, it costs one
    /// atomic load and a few comparisons and allocates nothing; on several ranks also one reduction
    /// of seven numbers, at every call or, where the configuration says so (`steering.poll_steps`),
    /// at every so many. It waits for nobody, except while it is paused, and for the plans of
    /// orders that take effect at a given cycle.
    ///
    /// On several ranks it is collective: all call it for the same cycle and time.
    ///
    /// # Errors
    /// [`ExecuteError`] for a mistake of the solver alone; nothing that a viewer, a file of orders
    /// or the network did ends up here. Nothing has changed then, and the solver may call again. A
    /// mistake on one rank is an error on all of them.
    ///
    /// Lengths, associations and counts are compared in every call; the numbers of vertices and the
    /// coordinates are looked at when a mesh is lent first or replaced, and the coordinates once
    /// more where a pipeline is due or an order is planned.
    pub fn execute(
        &mut self,
        step: &Step,
        channels: &[Channel<'_>],
    ) -> Result<Steering, ExecuteError> {
        let entered = Instant::now();
        let _alarm = Alarm::among(&self.communicator);
        if let Some(left) = self.timing.left.take() {
            self.timing.steps.add(entered - left);
        }
        self.timing.cycles += 1;
        let moment = step.moment();
        self.clock.set(moment);
        let fault = self.check(step, moment, channels).err();
        self.moment = moment;
        self.has_begun = true;
        let met = self.meet(moment, fault, entered)?;
        if let Some(reason) = self.replaced {
            self.release_shape(reason);
        }
        self.saved = None;
        let moved = match met {
            Some((called, outside)) => {
                // The coordinates were checked before these views were due.
                let called = self.notice_viewers(outside) || called;
                let is_calm = self.is_calm(moment, called);
                let moved = !is_calm && self.act(step, moment, called, channels)?;
                if self.pipelines.listens() {
                    // All ranks must know before a step begins whether a pipeline is due. The clock
                    // therefore counts from the next step on.
                    self.pipelines.tell(outside);
                }
                if self.skips_meetings() {
                    self.note_meeting(moment.cycle);
                }
                moved
            }
            None => false,
        };
        *self.is_spared.get_mut() = false;
        let left = Instant::now();
        self.timing.execute.add(left - entered);
        self.timing.left = Some(left);
        let motion = match &self.mesh {
            SteeredMesh::Steered(steerer, _) if moved => Some(steerer.motion().clone()),
            _ => None,
        };
        Ok(Steering {
            motion,
            parameters: self.parameters.take_changed().to_vec(),
            stop: self.stopped,
        })
    }

    /// Whether `execute` will look at the mesh and the fields of this step.
    ///
    /// A solver that would have to copy them first can ask before it does. Where the answer is no,
    /// `execute` needs the number of the mesh's vertices all the same.
    ///
    /// All ranks get the same answer; of what a viewer has just asked for, several ranks learn
    /// inside `execute` alone.
    #[must_use]
    pub fn looks_at(&self, step: &Step) -> bool {
        let moment = step.moment();
        let is_called = self.communicator.size() == 1 && self.is_called(moment);
        let by_orders = match &self.mesh {
            SteeredMesh::Unknown => true,
            SteeredMesh::Unsteered | SteeredMesh::Refused(_) => false,
            SteeredMesh::Steered(steerer, _) => steerer.looks_at_mesh(),
        };
        let looks = by_orders
            || is_called
            || !self.waiting_changes.is_empty()
            || self.timed.is_due(moment)
            || self.resumed.is_due(moment.cycle)
            || self.pipelines.is_due(moment);
        self.is_spared.store(!looks, Ordering::Relaxed);
        looks
    }

    /// Runs only the chosen pipelines from now on; at first all run. A pipeline that was left out
    /// is due once more when it is chosen again. To be called on all ranks alike.
    pub fn choose_pipelines(&mut self, is_chosen: impl Fn(&str) -> bool) {
        self.pipelines.choose(is_chosen);
    }

    /// The name of the channel whose mesh orders change, where the configuration names one: the
    /// `channel` of the pipeline with `"on": "order"`. Without one it is the first that `execute`
    /// is shown.
    #[must_use]
    pub fn steered_channel(&self) -> Option<&str> {
        self.config.steered_channel()
    }

    /// The orders so far and what became of each, in the order in which they came in; of more than
    /// [`ORDERS_KEPT`](crate::ORDERS_KEPT) only the newest. On rank 0.
    #[must_use]
    pub fn orders(&self) -> Vec<crate::OrderReport> {
        self.log.reports()
    }

    /// The monitors of a pipeline and what they have measured, as far back as is kept
    /// ([`limits::HISTORY`](tombolo_pipelines::limits::HISTORY)); `None` where there is no pipeline of
    /// this name.
    #[must_use]
    pub fn history(&self, pipeline: &str) -> Option<&History> {
        self.pipelines.history(pipeline)
    }

    /// Whether there is something of viewers to be looked at, on rank 0.
    #[inline]
    fn is_called(&self, moment: Moment) -> bool {
        self.queue.has_called() || self.resumed.has_put_off(moment.cycle)
    }

    /// Whether rank 0 was called to look at something; an error where any rank has one. `None`
    /// between two meetings of the ranks: then nothing is done, and a fault waits for the next, so
    /// that all ranks have it at the same call.
    #[inline]
    fn meet(
        &mut self,
        moment: Moment,
        fault: Option<ExecuteError>,
        entered: Instant,
    ) -> Result<Option<(bool, Outside)>, ExecuteError> {
        let called = self.is_called(moment);
        let outside = self.outside(entered);
        if self.communicator.size() == 1 {
            return fault.map_or(Ok(Some((called, outside))), Err);
        }
        let meets = self.meets();
        self.meetings.calls += 1;
        let fault = self.meetings.fault.take().or(fault);
        if !meets {
            self.meetings.fault = fault;
            return Ok(None);
        }
        meeting::meet(&*self.communicator, moment, fault, called, outside).map(Some)
    }

    /// Whether the ranks come together at the next call.
    #[inline]
    fn meets(&self) -> bool {
        // All ranks know alike of a motion under way; what only the step's own numbers could tell
        // is left for the next meeting.
        self.communicator.size() == 1
            || self.meetings.calls.is_multiple_of(self.config.steering.poll_steps.get().into())
            || self.paused
            || self.replaced.is_some()
            || !self.waiting_changes.is_empty()
            || !self.resumed.is_over()
            || matches!(&self.mesh, SteeredMesh::Steered(steerer, _) if !steerer.is_at_rest())
    }

    /// Whether there are calls at which the ranks do not come together.
    #[inline]
    fn skips_meetings(&self) -> bool {
        self.communicator.size() > 1 && self.config.steering.poll_steps.get() > 1
    }

    /// Notes the cycle of a meeting, which all ranks were at: what falls due behind it and before the
    /// next runs at the next. What a step between them says is of one rank alone.
    fn note_meeting(&mut self, cycle: u64) {
        self.meetings.last = Some(cycle);
        self.pipelines.set_met(cycle);
    }

    /// Whether there is nothing to do in this call.
    #[inline]
    fn is_calm(&self, moment: Moment, called: bool) -> bool {
        let at_rest = match &self.mesh {
            SteeredMesh::Unknown => false,
            SteeredMesh::Unsteered | SteeredMesh::Refused(_) => true,
            SteeredMesh::Steered(steerer, _) => steerer.is_at_rest(),
        };
        at_rest
            && !self.paused
            && !called
            && self.waiting_changes.is_empty()
            && !self.timed.is_due(moment)
            && !self.resumed.is_due(moment.cycle)
            && !self.pipelines.is_due(moment)
    }

    /// Does what there is to do; says whether the mesh moves over the coming step.
    fn act(
        &mut self,
        step: &Step,
        moment: Moment,
        called: bool,
        channels: &[Channel<'_>],
    ) -> Result<bool, ExecuteError> {
        if called {
            self.check_called(step, channels)?;
        }
        if matches!(self.mesh, SteeredMesh::Unknown) {
            let begun = Instant::now();
            self.take_reference(step, channels)?;
            self.timing.reference.add(begun.elapsed());
            self.wait_for_viewer();
        }
        let mut commands = Vec::new();
        if self.pipelines.is_due(moment) {
            commands = self.run_pipelines(moment, channels);
        }
        self.obey_again(moment, false);
        self.accept_from_pipelines(commands, moment);
        for timed in self.timed.take_due(moment) {
            self.accept(timed.id, Source::File, timed.command, moment);
        }
        self.obey_again(moment, true);
        let begun = Instant::now();
        self.serve(moment, channels);
        self.timing.steering.add(begun.elapsed());
        self.wait_for_resume(moment, channels);
        let SteeredMesh::Steered(steerer, _) = &mut self.mesh else { return Ok(false) };
        let moved = steerer.next_shape(moment, step.time_step);
        steerer.look_ahead(self.timed.next_order());
        if moved {
            self.tell_conditions();
        }
        Ok(moved)
    }
}
