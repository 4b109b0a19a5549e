//! From `catalyst_initialize` to `catalyst_finalize`: what the nodes say.

use std::sync::Arc;

use tombolo::{InitializeError, Settings, Step};

use crate::configuration::{self, Configuration};
use crate::error::CatalystError;
use crate::mesh::Channel;
use crate::node::{Kind, Node, NodeMut};
use crate::ranks;
use crate::results::{self, STEERING};
use crate::run::Run;

/// A run that is described by nodes.
pub(crate) struct Session {
    run: Run,
    is_first: bool,
}

impl Session {
    /// Sets a run up. Collective.
    pub(crate) fn new(node: &Node<'_, '_>) -> Result<Self, CatalystError> {
        let configuration = Configuration::read(node);
        let handle = configuration.as_ref().ok().and_then(|configuration| configuration.communicator);
        let communicator = ranks::communicator(handle)?;
        let Configuration { config, is_default, parameters, orders, output, notes, .. } =
            ranks::agree(&*communicator, configuration)?;
        let is_first = communicator.rank() == 0;
        if is_first {
            notes.iter().for_each(|note| eprintln!("tombolo: {note}"));
        }
        let mut settings =
            Settings { config, communicator: Arc::clone(&communicator), solvers: None, parameters, orders, output };
        let run = match Run::new(settings.clone()) {
            // Nobody asked for that very port.
            Err(CatalystError::Initialize(InitializeError::Stream(_))) if is_default && communicator.size() == 1 => {
                if let Some(stream) = &mut settings.config.stream {
                    stream.listen.set_port(0);
                }
                Run::new(settings)?
            }
            run => run?,
        };
        if let Some(link) = run.link().filter(|_| is_first) {
            eprintln!("tombolo: open {link}");
        }
        Ok(Self { run, is_first })
    }

    /// Shows a step to the adaptor. Collective.
    pub(crate) fn execute(&mut self, node: &Node<'_, '_>) -> Result<(), CatalystError> {
        let given = self.read(node);
        self.run.execute(given)
    }

    fn read<'call>(&self, node: &Node<'_, 'call>) -> Result<(Step, Vec<Channel<'call>>), CatalystError> {
        let catalyst = node.need(c"catalyst", "an object with 'state' and 'channels'")?;
        let state = catalyst.need(c"state", "an object with 'timestep' (or 'cycle') and 'time'")?;
        let cycle = match state.child(c"timestep") {
            Some(timestep) => timestep.count()?,
            None => state.need(c"cycle", "the step's number, here or as 'timestep'")?.count()?,
        };
        let finite = |node: &Node<'_, '_>| match node.number()? {
            value if value.is_finite() => Ok(value),
            value => Err(node.wrong_found(format!("{value}"), "a finite number".into())),
        };
        let time = finite(&state.need(c"time", "the simulated time")?)?;
        let time_step = match state.child(c"time_step") {
            Some(length) => match finite(&length)? {
                value if value >= 0.0 => value,
                value => return Err(length.wrong_found(format!("{value}"), "a number from 0 on".into())),
            },
            None => self.run.likely_time_step(time),
        };
        let step = Step { cycle, time, time_step };
        let looked_at = self.run.looks_at(&step);
        let mut channels = Vec::new();
        if let Some(all) = catalyst.child(c"channels") {
            if !matches!(all.kind(), Kind::Object | Kind::Empty) {
                return Err(all.wrong("an object of channels by their names".into()));
            }
            for (index, name) in all.names().iter().enumerate() {
                let Some(channel) = all.at(index, name) else { continue };
                if channel.name() == STEERING {
                    let expected = format!("another name: the results bring a mesh called '{STEERING}'");
                    return Err(channel.wrong_found(format!("a channel called '{STEERING}'"), expected));
                }
                channels.push(Channel::read(&channel, looked_at)?);
            }
        }
        Ok((step, channels))
    }

    /// Fills in what the adaptor asks for the step that follows.
    pub(crate) fn results(&self, node: &mut NodeMut<'_>) {
        let (steered, blocks) = self.run.steered();
        results::fill(node, self.run.asked(), steered, blocks);
    }

    /// Ends the run. Collective.
    pub(crate) fn finalize(self) -> Result<(), CatalystError> {
        let (report, ended) = self.run.finalize();
        if let (Some(report), Some(file)) = (report.filter(|_| self.is_first), configuration::report_file()) {
            let text = serde_json::to_string_pretty(&report).unwrap_or_default();
            std::fs::write(&file, text).map_err(|error| CatalystError::Configuration(format!("{file}: {error}")))?;
        }
        ended
    }
}
