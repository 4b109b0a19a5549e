//! The intake of commands: from viewers, files and pipelines to what they change.

use std::{
    collections::VecDeque,
    sync::{Arc, OnceLock},
    time::Duration,
};

use serde_json::{Value, json};
use tombolo_deform::{communicator::Reduction, shape::Forecast};
use tombolo_pipelines::{
    extract::Channel,
    files::{UnreadFile, read_displacements},
    language::{Command, JournalNote, Message, Order, Problem, Question, locate},
};

use super::{Adaptor, SteeredMesh, absence::Absence};
use crate::{
    changes::{Changes, make_absolute},
    meeting,
    steering::{
        Asked, Forecaster, Log, OVERTAKEN, Queue, Received, Reservation, Source, WITHDRAWN,
        taken_back,
    },
    step::Moment,
    stream::{CommandSink, Hub},
};

impl Adaptor {
    /// Takes in a command that no viewer sent. All ranks come here with the same one; rank 0 reads
    /// its files, names it and writes it to the journal, and what it takes, all obey.
    pub(super) fn accept(
        &mut self,
        id: Option<String>,
        source: Source,
        command: Command,
        moment: Moment,
    ) {
        let taken = if self.communicator.rank() == 0 {
            self.take_in(id, &source, command, moment)
        } else {
            None
        };
        for (id, command) in self.agreed_with_all(taken.into_iter().collect()) {
            self.obey(id, &source, command, None, moment);
        }
    }

    /// Takes in what pipelines command; a replay has it from the journal. Collective.
    pub(super) fn accept_from_pipelines(
        &mut self,
        commands: Vec<(String, Command)>,
        moment: Moment,
    ) {
        if self.is_replay {
            return;
        }
        for (pipeline, command) in commands {
            self.accept(None, Source::Pipeline(pipeline), command, moment);
        }
    }

    fn take_in(
        &self,
        id: Option<String>,
        source: &Source,
        mut command: Command,
        moment: Moment,
    ) -> Option<(String, Command)> {
        // The journal gets what a file holds and not its name, so that it replays whatever becomes
        // of the file.
        let read = self.read_files(&mut command);
        if let Command::Pipelines(change) = &mut command {
            make_absolute(change);
        }
        match self.log.accept(id, source, &command, moment) {
            Ok(id) => match read {
                Ok(()) => return Some((id, command)),
                Err(reason) => self.log.reject(&id, moment, &reason.into()),
            },
            Err(reason) => self.complain(&format!("a command was not taken: {reason}")),
        }
        None
    }

    /// The commands of rank 0 on all ranks, so that they take effect at the same cycle everywhere.
    /// Collective; free on one process.
    fn agreed_with_all(&self, commands: Vec<(String, Command)>) -> Vec<(String, Command)> {
        meeting::share(&*self.communicator, commands).unwrap_or_else(|reason| {
            self.complain(&reason);
            Vec::new()
        })
    }

    fn read_files(&self, command: &mut Command) -> Result<(), UnreadFile> {
        match (command, &self.mesh) {
            (Command::Order(order), SteeredMesh::Steered(_, Some(surface))) => {
                read_displacements(order.edits_mut(), surface)
            }
            // Without a surface every order is rejected.
            _ => Ok(()),
        }
    }

    /// Says to whom it may concern what no order's outcome can say. Once: only rank 0 tells it.
    pub(super) fn complain(&self, message: &str) {
        if self.communicator.rank() > 0 {
            return;
        }
        let (run, cycle) = (&*self.run, self.moment.cycle);
        tracing::warn!(run, cycle, "{message}");
        if let Some(hub) = &self.hub {
            let message = message.to_owned();
            hub.tell(move || json!({"error": {"message": message}}));
        }
    }

    /// Carries out what viewers and others have asked for meanwhile, as far as it can be now.
    pub(super) fn serve(&mut self, moment: Moment, channels: &[Channel<'_>]) {
        let received = self.take_received(moment);
        let (whence, own): (Vec<_>, _) = received
            .into_iter()
            .map(|Received { source, reservation, id, command }| {
                ((source, reservation), (id, command))
            })
            .unzip();
        let mut whence = whence.into_iter();
        for (id, command) in self.agreed_with_all(own) {
            // Only rank 0 has viewers to answer.
            let (source, reservation) = whence.next().unwrap_or((Source::Viewer(0), None));
            self.obey(id, &source, command, reservation, moment);
        }
        self.make_ready();
        self.forecast();
        if let SteeredMesh::Steered(steerer, _) = &mut self.mesh {
            steerer.set_paused(self.paused);
            steerer.reject_overdue(moment);
        }
        // A command that came after the solver had asked whether its mesh is looked at is for the next
        // call, which is lent the mesh whole.
        let looks = !self.waiting_changes.is_empty()
            || matches!(&self.mesh, SteeredMesh::Steered(steerer, _) if steerer.looks_at_mesh());
        if looks && self.communicator.any(*self.is_spared.get_mut()) {
            return;
        }
        self.make_changes(moment, channels);
        let named = self.steered_channel().map(str::to_owned);
        if let (SteeredMesh::Steered(steerer, _), Ok(channel)) =
            (&mut self.mesh, Channel::find(channels, named.as_deref()))
            && steerer.looks_at_mesh()
        {
            steerer.observe(&channel.mesh.points);
        }
        let step_seconds = self.timing.steps.median();
        if let SteeredMesh::Steered(steerer, _) = &mut self.mesh
            && steerer.advance(moment, step_seconds)
        {
            self.tell_stack();
            self.tell_conditions();
        }
    }

    /// The commands whose turn it is. While a restarted run repeats what was done before, new ones wait,
    /// but for pauses and stops: they would change what is repeated.
    fn take_received(&mut self, moment: Moment) -> VecDeque<Received> {
        let Some(until) = self.resumed.repeats_until(moment.cycle) else {
            let mut received = self.queue.take();
            if std::mem::take(&mut self.resumed.put_off) > 0 {
                received
                    .iter_mut()
                    .filter_map(|it| it.reservation.as_mut())
                    .for_each(Reservation::renew);
            }
            return received;
        };
        let pauses = self.queue.take_pauses();
        let mut waiting = Vec::new();
        self.queue.look(|received| waiting.push(received.id.clone()));
        for id in &waiting[self.resumed.put_off.min(waiting.len())..] {
            self.log.update(id, |order| {
                let what = "up to which the run repeats what it has done before";
                order.waits_for = Some(format!("cycle {until}, {what}"));
            });
        }
        self.resumed.put_off = waiting.len();
        pauses
    }

    /// Has the steered mesh made ready for orders once somebody may give one. Collective.
    fn make_ready(&mut self) {
        if let SteeredMesh::Steered(steerer, _) = &mut self.mesh
            && !steerer.is_ready()
        {
            // Only rank 0 has viewers.
            let mut driven = [u64::from(self.queue.is_driven())];
            self.communicator.reduce_integers(Reduction::Maximum, &mut driven);
            if driven == [1] {
                steerer.make_ready();
            }
        }
    }

    /// Answers what viewers want to know of a mesh in parts: only the ranks together can, here. On
    /// one process another thread does.
    fn forecast(&self) {
        if self.communicator.size() == 1 {
            return;
        }
        let questions = self.queue.take_questions();
        let asked = questions
            .iter()
            .map(|asked| (String::new(), Command::Order((*asked.order).clone())))
            .collect();
        for (index, (_, command)) in self.agreed_with_all(asked).into_iter().enumerate() {
            let question = questions.get(index);
            let forecast = match (command, &self.mesh) {
                (Command::Order(order), SteeredMesh::Steered(steerer, _)) => {
                    Ok(steerer.forecast(&order, question.map(|asked| asked.client)))
                }
                _ => Err(NO_MESH),
            };
            if let (Some(Asked { client, id, .. }), Some(hub)) = (question, &self.hub) {
                let forecast =
                    if self.queue.is_wanted(*client) { forecast } else { Err(WITHDRAWN) };
                tell_forecast(hub, *client, id.clone(), forecast);
            }
        }
    }

    pub(super) fn obey(
        &mut self,
        id: String,
        source: &Source,
        command: Command,
        reservation: Option<Reservation>,
        moment: Moment,
    ) {
        let name = command.name();
        let outcome = match command {
            Command::Order(order) => {
                let background = self.config.steering.background
                    && matches!(source, Source::Viewer(_) | Source::Earlier(_, false));
                let index = match self.make_way(&order, &id, source, moment) {
                    Ok(index) => index,
                    Err(reason) => return self.log.reject(&id, moment, &reason.into()),
                };
                match &mut self.mesh {
                    SteeredMesh::Steered(steerer, _) => {
                        steerer.take(id, order, background, reservation, index);
                    }
                    SteeredMesh::Refused(reason) => self.log.reject(&id, moment, &reason.into()),
                    SteeredMesh::Unknown | SteeredMesh::Unsteered => {
                        self.log.reject(&id, moment, &"no reference mesh was taken".into());
                    }
                }
                return;
            }
            Command::Pause {} if self.config.stream.is_none() => {
                Err("there is no stream, so that nobody could resume".to_owned())
            }
            Command::Pause {} => {
                self.paused = true;
                Ok(())
            }
            Command::Resume {} => {
                self.paused = false;
                Ok(())
            }
            Command::Stop {} => {
                self.stopped = true;
                // Whoever asked, no shape is found any more; but a replay has the orders of the cycle
                // in which the run was stopped.
                if !self.is_replay {
                    self.forecaster.get().into_iter().for_each(Forecaster::give_up);
                }
                Ok(())
            }
            Command::Cancel(cancel) => self.cancel(&cancel.order, source, moment),
            Command::Parameter(change) => {
                let set = self.parameters.set(&change.name, change.value);
                self.describe_values();
                set.map_err(|error| error.to_string())
            }
            Command::Pipelines(change) => {
                return self.keep_change(id, source.clone(), change, reservation);
            }
        };
        self.settle(name, &id, source, moment, outcome);
    }

    /// Takes an order back that has not begun to move the mesh.
    fn cancel(&mut self, order: &str, source: &Source, moment: Moment) -> Result<(), String> {
        let index = self.withdraw(order)?;
        self.log.cancel(order, moment, format!("cancelled{}", by(source)));
        if let SteeredMesh::Steered(steerer, _) = &mut self.mesh {
            steerer.say_why(index);
        }
        Ok(())
    }

    /// Takes the order back that another one replaces, and returns its place in the queue.
    fn make_way(
        &mut self,
        order: &Order,
        id: &str,
        source: &Source,
        moment: Moment,
    ) -> Result<Option<usize>, String> {
        let Some(replaced) = &order.replaces else { return Ok(None) };
        // In a run that is carried out again the other one is gone already.
        let may_be_gone = self.is_replay || matches!(source, Source::Earlier(..));
        match self.withdraw(replaced) {
            Ok(index) => {
                let reason = format!("replaced by order {id}{}", by(source));
                self.log.reject(replaced, moment, &reason.into());
                Ok(Some(index))
            }
            Err(_) if may_be_gone => Ok(None),
            Err(reason) => Err(reason),
        }
    }

    /// Takes an order out of the queue, whatever then becomes of it; the error says why it cannot be.
    fn withdraw(&mut self, order: &str) -> Result<usize, String> {
        let withdrawn = match &mut self.mesh {
            SteeredMesh::Steered(steerer, _) => steerer.withdraw(order),
            _ => None,
        };
        withdrawn.unwrap_or_else(|| {
            Err(match self.log.has_order(order) {
                true => format!("order '{order}' no longer waits, so it cannot be taken back"),
                false => format!("there is no order '{order}'"),
            })
        })
    }

    /// Notes what became of a command that is no order, and tells who gave it.
    pub(super) fn settle(
        &self,
        command: &str,
        id: &str,
        source: &Source,
        moment: Moment,
        outcome: Result<(), String>,
    ) {
        if let (Err(reason), false) = (&outcome, matches!(source, Source::Viewer(_))) {
            self.complain(&format!("command '{id}': {reason}"));
        }
        self.log.settle(command, id, source, moment, outcome);
        self.tell_conditions();
    }
}

/// Names the viewer that a command came from.
fn by(source: &Source) -> String {
    match source {
        Source::Viewer(client) => format!(" by {}", Hub::name(*client)),
        _ => String::new(),
    }
}

/// Takes the commands of viewers in, on the stream's thread.
pub(super) struct Intake {
    pub(super) queue: Arc<Queue>,
    pub(super) log: Arc<Log>,
    pub(super) hub: Arc<Hub>,
    pub(super) forecaster: Arc<OnceLock<Forecaster>>,
    pub(super) changes: Arc<Changes>,
    /// Whether the mesh is on several ranks.
    pub(super) is_in_parts: bool,
    /// Whether the run is carried out as a journal says.
    pub(super) is_replay: bool,
    /// How long the run waits for people who are gone.
    pub(super) absence: Absence,
}

impl Intake {
    /// Has the run do what is wanted where people have been gone for long enough.
    fn look_for_people(&self) {
        if let Some(patience) = self.absence.of_drivers(&self.hub) {
            let why = "it was paused and nobody was there who could resume it";
            self.give(Command::Resume {}, "goes on", why, patience);
        }
        if let Some((patience, command)) = self.absence.of_viewers(&self.hub) {
            let what = match command {
                Command::Stop {} => "is stopped",
                _ => "is paused",
            };
            self.give(command, what, "nobody has watched it", patience);
        }
    }

    /// Gives a command that nobody has asked for.
    fn give(&self, command: Command, what: &str, why: &str, patience: Duration) {
        let source = Source::Program;
        // It has no name of its own that could be taken.
        let Ok(id) = self.log.accept(None, &source, &command, self.hub.clock.get()) else { return };
        let (run, seconds) = (self.log.run(), patience.as_secs());
        tracing::warn!(run, "the run {what}: {why} for {seconds} seconds");
        let stops = matches!(command, Command::Stop {});
        self.queue.push(Received { source, id, command, reservation: None });
        if stops {
            self.forecaster.get().into_iter().for_each(Forecaster::give_up);
        }
    }

    /// Lets go of what a viewer wanted to know, and tells it so.
    fn withdraw_forecast(&self, client: u64) {
        // One that the ranks have taken up is answered where they leave it.
        for Asked { id, .. } in self.queue.withdraw(client) {
            tell_forecast(&self.hub, client, id, Err(WITHDRAWN));
        }
        self.forecaster.get().into_iter().for_each(|forecaster| forecaster.withdraw(client));
    }

    /// Has a viewer told what an order would come to.
    fn forecast(&self, client: u64, id: Option<String>, order: Order) -> Result<(), String> {
        let command = Command::Order(order);
        check_files(&command)?;
        let Command::Order(order) = command else { return Ok(()) };
        if self.is_in_parts {
            let overtaken = self.queue.ask(Asked { client, id, order: Box::new(order) });
            if let Some(Asked { client, id, .. }) = overtaken {
                tell_forecast(&self.hub, client, id, Err(OVERTAKEN));
            }
            return Ok(());
        }
        let forecaster = self.forecaster.get().ok_or(NO_MESH)?;
        let hub = Arc::clone(&self.hub);
        forecaster.ask(client, &order, move |forecast| tell_forecast(&hub, client, id, forecast));
        Ok(())
    }
}

/// Why there is no forecast.
const NO_MESH: &str = "there is no mesh yet whose shape could be changed";

/// Tells a client what an order would come to, or why that is not found out.
fn tell_forecast(
    hub: &Hub,
    client: u64,
    id: Option<String>,
    forecast: Result<Forecast, &'static str>,
) {
    hub.tell_client(client, move || match forecast {
        Ok(forecast) => json!({"forecast": {"id": id, "order": forecast}}),
        Err(message) => json!({"error": {"message": message, "id": id}}),
    });
}

/// Refuses a command from the network that names a file of this machine.
fn check_files(command: &Command) -> Result<(), String> {
    match command.file() {
        None => Ok(()),
        Some((edit, file)) => Err(format!(
            "edit {edit} (displacement): file: found {file:?}; an order over the network names no files of this machine, \
             expected `vertices` and `values`"
        )),
    }
}

impl CommandSink for Intake {
    fn receive(
        &self,
        client: u64,
        id: Option<String>,
        message: Message,
        text: &str,
    ) -> Result<(), String> {
        let command = match message {
            Message::Command(Command::Order(_) | Command::Parameter(_) | Command::Cancel(_))
                if self.is_replay =>
            {
                return Err("this run replays a journal: it can be watched, paused and stopped, \
                            and its shape is that of the journal"
                    .into());
            }
            Message::Command(Command::Pipelines(change)) => {
                let taken = change
                    .check_files()
                    .and_then(|()| self.changes.take_from(client, id, change, text));
                let located =
                    |problem: Problem| locate(problem.within("pipelines"), text, "message");
                return taken.map_err(|problem| located(problem).to_string());
            }
            Message::Question(Question::Forecast(order)) => {
                return self.forecast(client, id, order);
            }
            Message::Question(Question::WithdrawForecast {}) => {
                self.withdraw_forecast(client);
                if let Some(id) = id {
                    let Moment { cycle, time } = self.hub.clock.get();
                    let done = move || json!({"done": {"id": id, "cycle": cycle, "time": time}});
                    self.hub.tell_client(client, done);
                }
                return Ok(());
            }
            Message::Command(command) => command,
            // The session has answered it.
            Message::Wheel(_) | Message::Together(_) => return Ok(()),
        };
        check_files(&command)?;
        // A command that came before is answered, however many wait.
        let Some(id) = self.log.name(client, id, &command)? else { return Ok(()) };
        let reservation = self.queue.reserve(&command, text.len()).map_err(|exceeded| {
            self.log.forget(&id);
            format!(
                "{exceeded}; the turn of those before this one has not come yet, try again later"
            )
        })?;
        let moment = self.hub.clock.get();
        let received = Received {
            source: Source::Viewer(client),
            id: id.clone(),
            command: command.clone(),
            reservation: Some(reservation),
        };
        let (queue, forecaster) = (Arc::clone(&self.queue), Arc::clone(&self.forecaster));
        self.log.accept_from(client, id, &command, moment, move |taken| {
            if let Some(tell) = taken {
                let stops = matches!(received.command, Command::Stop {});
                let order = taken_back(&received.command).map(str::to_owned);
                queue.push_and_tell(received, tell);
                if let Some(forecaster) = forecaster.get() {
                    if stops {
                        forecaster.give_up();
                    }
                    order.iter().for_each(|order| forecaster.take_back(order));
                }
            }
        });
        Ok(())
    }

    fn look_at_time(&self) {
        self.log.look_at_time();
        self.look_for_people();
    }

    fn driven(&self) {
        self.queue.drive();
    }

    fn left(&self, client: u64) {
        self.withdraw_forecast(client);
    }

    fn orders(&self) -> Value {
        self.log.told()
    }

    fn order_counts(&self) -> Vec<(&'static str, usize)> {
        self.log.order_counts()
    }

    fn note(&self, note: JournalNote) {
        self.log.note(&note);
    }
}
