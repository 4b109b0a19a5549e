//! From `catalyst_initialize` to `catalyst_finalize`: what the nodes say.

use std::{io::IsTerminal, sync::Arc};

use tombolo::communicator::{Alarm, Communicator};
use tombolo::deform::linear::BuiltIn;
use tombolo::foreign::{Asked, Run, RunError, Shown, ranks};
use tombolo::pipelines::language::{Listen, nearest};
use tombolo::{InitializeError, Restart, Settings, Step};

use crate::configuration::{self, Configuration, Groups, with_default_views};
use crate::mesh;
use crate::node::{Kind, Node, NodeMut};
use crate::results::{self, STEERING};

/// A run that is described by nodes.
pub(crate) struct Session {
    stage: Stage,
    communicator: Arc<dyn Communicator>,
    groups: Groups,
    /// The channels of the last step that are said to have several meshes, though this rank may
    /// have none of them.
    with_blocks: Vec<String>,
}

enum Stage {
    /// Nobody says what to watch, so that it begins with the first step: its channels are watched.
    Waiting {
        settings: Box<Settings>,
        asked: Asked,
    },
    UnderWay(Box<Run>),
}

/// The configuration of a run and its ranks, read and agreed upon before the run begins: one that cannot
/// be read ends no earlier run.
pub(crate) struct SetUp {
    communicator: Arc<dyn Communicator>,
    configuration: Configuration,
}

impl SetUp {
    /// Reads the node of `catalyst_initialize`. Collective.
    pub(crate) fn read(node: &Node<'_, '_>) -> Result<Self, RunError> {
        // First, and by itself: what else is wrong on one rank is told by the communicator of all.
        let handle = configuration::communicator(node)?;
        // SAFETY: Catalyst's blueprint says that `catalyst/mpi_comm` is the handle of a live
        // communicator.
        let communicator = unsafe { ranks::communicator(handle) }?;
        let configuration = ranks::agree(&*communicator, Configuration::read(node))?;
        Ok(Self { communicator, configuration })
    }
}

impl Session {
    /// Sets a run up. Collective.
    pub(crate) fn new(set_up: SetUp) -> Result<Self, RunError> {
        let SetUp { communicator, configuration } = set_up;
        let Configuration {
            config,
            is_default,
            groups,
            parameters,
            orders,
            output,
            file,
            restart,
            notes,
        } = configuration;
        let settings = Settings {
            config,
            communicator: Arc::clone(&communicator),
            solvers: Arc::new(BuiltIn),
            parameters,
            orders,
            output,
            file,
            restart: restart.map(|file| Restart::File(file.into())),
            ..Settings::default()
        };
        let stage = if is_default {
            let asked = Asked::of(&settings.parameters);
            Stage::Waiting { settings: Box::new(settings), asked }
        } else {
            Stage::UnderWay(Box::new(Run::new(settings)?))
        };
        let mut session = Self { stage, communicator, groups, with_blocks: Vec::new() };
        if session.communicator.rank() == 0 {
            notes.iter().for_each(|note| eprintln!("tombolo: {note}"));
        }
        session.tell_link();
        Ok(session)
    }

    fn tell_link(&mut self) {
        let Stage::UnderWay(run) = &mut self.stage else { return };
        if self.communicator.rank() != 0 {
            return;
        }
        match run.invitation(std::io::stderr().is_terminal()) {
            Ok(Some(invitation)) => eprintln!("tombolo: {invitation}"),
            Ok(None) => {}
            Err(error) => eprintln!("tombolo: the links to this run were not written: {error}"),
        }
    }

    /// Shows a step to the adaptor. Collective.
    pub(crate) fn execute(&mut self, node: &Node<'_, '_>) -> Result<(), RunError> {
        let _alarm = Alarm::among(&self.communicator);
        let mut given = self.read(node);
        if let Stage::Waiting { settings, .. } = &self.stage {
            let shown = ranks::agree(&*self.communicator, given)?;
            let own: Vec<&str> =
                shown.channels.iter().map(|channel| channel.name.as_str()).collect();
            let names = ranks::union(&*self.communicator, &own);
            // A solver that shows nothing yet is asked for nothing.
            if names.is_empty() {
                return Ok(());
            }
            // Nothing of a start that fails is kept: the next step tries it again from the same.
            let config = with_default_views(&settings.config, &names)?;
            let mut settings = Settings { config, ..(**settings).clone() };
            let run = match Run::new(settings.clone()) {
                // Nobody asked for that very port. On several ranks all have the error of the one
                // that could not have it.
                Err(RunError::Initialize(
                    InitializeError::Stream(_) | InitializeError::Rank(_),
                )) => {
                    if let Some(stream) = &mut settings.config.stream
                        && let Some(Listen::Address(mut address)) = stream.place()
                    {
                        address.set_port(0);
                        stream.listen = Some(Listen::Address(address));
                    }
                    Run::new(settings)?
                }
                run => run?,
            };
            self.stage = Stage::UnderWay(Box::new(run));
            self.tell_link();
            // Now that there are pipelines, the step may choose among them.
            given = self.read(node).map(|again| Shown { step: shown.step, ..again });
        }
        match &mut self.stage {
            Stage::UnderWay(run) => {
                let checkpoint = checkpoint_file(node);
                run.execute(given).map_err(at_path)?;
                run.checkpoint(checkpoint, "catalyst/state/checkpoint")
            }
            Stage::Waiting { .. } => Ok(()),
        }
    }

    fn read<'call>(&mut self, node: &Node<'_, 'call>) -> Result<Shown<'call>, RunError> {
        let catalyst = node.need(c"catalyst", "an object with 'state' and 'channels'")?;
        let state = catalyst.need(c"state", "an object with 'timestep' (or 'cycle') and 'time'")?;
        let cycle = match state.child(c"timestep") {
            Some(timestep) => timestep.count()?,
            None => state.need(c"cycle", "the step's number, here or as 'timestep'")?.count()?,
        };
        let finite = |node: &Node<'_, '_>| match node.number()? {
            value if value.is_finite() => Ok(value),
            value => Err(node.wrong_found(format!("{value}"), "a finite number")),
        };
        let time = finite(&state.need(c"time", "the simulated time")?)?;
        let time_step = match state.child(c"time_step") {
            Some(length) => match finite(&length)? {
                value if value >= 0.0 => value,
                value => return Err(length.wrong_found(format!("{value}"), "a number from 0 on")),
            },
            None => self.under_way().map_or(0.0, |run| run.likely_time_step(time)),
        };
        let step = Step { cycle, time, time_step };
        self.choose(state.child(c"pipelines").or_else(|| catalyst.child(c"pipelines")).as_ref())?;
        let looked_at = self.under_way().is_none_or(|run| run.looks_at(&step));
        let mut channels = Vec::new();
        self.with_blocks.clear();
        if let Some(all) = catalyst.child(c"channels") {
            if !matches!(all.kind(), Kind::Object | Kind::Empty) {
                return Err(all.wrong("an object of channels by their names"));
            }
            all.each(|channel| {
                if channel.name() == STEERING {
                    let expected =
                        format!("another name: the results bring a mesh called '{STEERING}'");
                    return Err(
                        channel.wrong_found(format!("a channel called '{STEERING}'"), expected)
                    );
                }
                channels.push(mesh::read(channel, looked_at)?);
                if mesh::has_blocks(channel) {
                    self.with_blocks.push(channel.name().into_owned());
                }
                Ok(())
            })?;
        }
        Ok(Shown { step, looked_at, channels })
    }

    fn under_way(&self) -> Option<&Run> {
        match &self.stage {
            Stage::UnderWay(run) => Some(run),
            Stage::Waiting { .. } => None,
        }
    }

    /// Lets the pipelines run that a list of names chooses; all where there is none, and none where
    /// it is anything else.
    fn choose(&mut self, node: Option<&Node<'_, '_>>) -> Result<(), RunError> {
        let Stage::UnderWay(run) = &mut self.stage else { return Ok(()) };
        // The names are those of another implementation's scripts where the configuration does not
        // come from the solver.
        let of_solver = |name: &str| {
            self.groups.iter().any(|(_, pipelines)| pipelines.iter().any(|known| known == name))
        };
        let Some(node) = node.filter(|_| !self.groups.is_empty()) else {
            run.choose(None, &of_solver);
            return Ok(());
        };
        let mut chosen: Vec<&str> = Vec::new();
        if matches!(node.kind(), Kind::Object | Kind::List) {
            node.each(|child| {
                let wanted = child.text()?;
                let Some((_, pipelines)) = self.groups.iter().find(|(name, _)| *name == *wanted)
                else {
                    let known: Vec<&str> =
                        self.groups.iter().map(|(name, _)| name.as_str()).collect();
                    let hint = nearest(&wanted, known.iter().copied())
                        .map_or_else(String::new, |name| format!("; did you mean '{name}'?"));
                    let expected = format!("one of {}{hint}", known.join(", "));
                    return Err(child.wrong_found(format!("'{wanted}'"), expected));
                };
                chosen.extend(pipelines.iter().map(String::as_str));
                Ok(())
            })?;
        }
        run.choose(Some(&chosen), &of_solver);
        Ok(())
    }

    /// Fills in what the adaptor asks for the step that follows.
    pub(crate) fn results(&self, node: &mut NodeMut<'_>) {
        match &self.stage {
            Stage::UnderWay(run) => {
                let (steered, blocks) = run.steered();
                let has_blocks = self.with_blocks.iter().any(|name| name == steered);
                results::fill(node, run.asked(), steered, blocks, has_blocks);
            }
            Stage::Waiting { asked, .. } => results::fill(node, asked, "", &[], false),
        }
    }

    /// Ends the run. Collective.
    pub(crate) fn finalize(self) -> Result<(), RunError> {
        let Stage::UnderWay(run) = self.stage else { return Ok(()) };
        let (report, ended) = run.finalize();
        let mut told = Ok(());
        if self.communicator.rank() == 0
            && let Some(file) = configuration::report_file()
        {
            let text = serde_json::to_string_pretty(&report).unwrap_or_default();
            told = std::fs::write(&file, text).map_err(|source| RunError::Report { file, source });
        }
        // No rank goes on before the files are there.
        ranks::agree(&*self.communicator, ended.and(told))
    }
}

/// The file that the state of the run is to be saved in at the end of the coming step.
fn checkpoint_file(node: &Node<'_, '_>) -> Result<Option<String>, RunError> {
    let Some(catalyst) = node.child(c"catalyst") else { return Ok(None) };
    let Some(state) = catalyst.child(c"state") else { return Ok(None) };
    let Some(file) = state.child(c"checkpoint") else { return Ok(None) };
    Ok(Some(file.text()?.into_owned()))
}

/// Names the path of what chooses the pipelines.
fn at_path(error: RunError) -> RunError {
    match error {
        RunError::Choices => RunError::wrong(
            "catalyst/state/pipelines",
            "other names on other ranks",
            "the same on all",
        ),
        error => error,
    }
}
