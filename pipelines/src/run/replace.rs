//! Other pipelines while a run goes on.

use std::collections::HashSet;

use super::history::{Board, History};
use super::output::{Frame, Table};
use super::pipeline::Prepared;
use super::{Runner, prepared, source};
use crate::extract::{Channel, Snapshot};
use crate::language::{Config, Due, Monitored, Pipeline, Problem};

/// Why other pipelines cannot take over. Those before go on as they were.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ReplaceError {
    /// They make no sense.
    #[error(transparent)]
    Configuration(#[from] Problem),
    /// One of them asks for what the mesh at hand does not have.
    #[error("pipeline `{pipeline}` cannot run on this mesh: {message}")]
    Mesh {
        /// The pipeline.
        pipeline: String,
        /// The problem, and what was expected.
        message: String,
    },
}

/// Pipelines that were found fit to take over; made by [`Runner::prepare`] for
/// [`Runner::replace`].
pub struct Replacement {
    pipelines: Vec<Prepared>,
    histories: Vec<History>,
    /// The pipelines of the configuration, also those that wait for orders.
    all: Vec<Pipeline>,
    added: Vec<String>,
    replaced: Vec<String>,
    removed: Vec<String>,
    frames: Vec<Frame>,
}

impl Replacement {
    /// The names of the pipelines that there were not before.
    #[must_use]
    pub fn added(&self) -> &[String] {
        &self.added
    }

    /// The names of the pipelines that are not what they were, and start anew.
    #[must_use]
    pub fn replaced(&self) -> &[String] {
        &self.replaced
    }

    /// The names of the pipelines that there are no more.
    #[must_use]
    pub fn removed(&self) -> &[String] {
        &self.removed
    }

    /// Whether the pipeline of this name goes on as it was.
    #[must_use]
    pub fn keeps(&self, name: &str) -> bool {
        [&self.added, &self.replaced, &self.removed]
            .iter()
            .all(|names| names.iter().all(|changed| changed != name))
    }

    /// The tables that the pipelines write.
    pub fn tables(&self) -> impl Iterator<Item = &Table> {
        self.pipelines.iter().flat_map(Prepared::tables)
    }

    /// Takes the first frames of the views that are new or not what they were: those of the step on
    /// whose mesh they were tried.
    pub fn take_frames(&mut self) -> Vec<Frame> {
        std::mem::take(&mut self.frames)
    }
}

impl Runner {
    /// The tables that the pipelines write.
    pub fn tables(&self) -> impl Iterator<Item = &Table> {
        self.pipelines.iter().flat_map(Prepared::tables)
    }

    /// Finds out whether the pipelines of another configuration can take over, and changes nothing.
    /// Those that are new or not what they were are tried on the mesh of a step: their stages run,
    /// but nothing is drawn, written or ordered. That the solver's numbers are not finite at this
    /// step is no reason against them. Collective.
    ///
    /// # Errors
    /// [`ReplaceError`], the same on all ranks.
    pub fn prepare(
        &mut self,
        config: &Config,
        snapshot: &Snapshot,
    ) -> Result<Replacement, ReplaceError> {
        let (pipelines, histories) = prepared(config)?;
        let all = config.pipelines.clone();
        let (mut added, mut replaced, mut removed) = (Vec::new(), Vec::new(), Vec::<String>::new());
        for pipeline in &all {
            match self.all.iter().find(|known| known.name == pipeline.name) {
                Some(known) if known == pipeline => {}
                Some(_) => replaced.push(pipeline.name.clone()),
                None => added.push(pipeline.name.clone()),
            }
        }
        let names: HashSet<&String> = all.iter().map(|pipeline| &pipeline.name).collect();
        let gone = self.all.iter().filter(|known| !names.contains(&known.name));
        removed.extend(gone.map(|known| known.name.clone()));
        let mut next =
            Replacement { pipelines, histories, all, added, replaced, removed, frames: Vec::new() };
        let monitored = Monitored::of(&next.all);
        for (index, pipeline) in next.all.iter().enumerate() {
            // When the run ends there is no mesh, and orders are settings alone.
            let is_of_mesh = !matches!(pipeline.due, Due::OnEnd | Due::OnOrder);
            if is_of_mesh && !next.keeps(&pipeline.name) {
                next.frames.extend(self.try_out(&monitored, index, snapshot)?);
            }
        }
        Ok(next)
    }

    fn try_out(
        &mut self,
        all: &Monitored<'_>,
        index: usize,
        snapshot: &Snapshot,
    ) -> Result<Vec<Frame>, ReplaceError> {
        let (trial, pipeline) = (Prepared::new(all, index)?, &all.pipelines[index]);
        let name = pipeline.channel.as_deref();
        let found = source(&mut self.sources, snapshot.channels, name, &self.communicator);
        let tried = match found {
            Ok((channel, source)) => {
                let parameters = &self.board.parameters;
                trial.try_out(snapshot, channel, source, &*self.communicator, parameters)
            }
            Err(message) => Err(message),
        };
        tried.map_err(|message| ReplaceError::Mesh { pipeline: pipeline.name.clone(), message })
    }

    /// Lets other pipelines take over. One that is what it was goes on: its times, its condition,
    /// what it has measured, kept and told. Every other starts anew, and is due as if the run had
    /// just begun: at once, where its moment has passed already. On all ranks alike.
    pub fn replace(&mut self, replacement: Replacement, channels: &[Channel]) {
        let kept: HashSet<String> = (self.all.iter())
            .map(|pipeline| &pipeline.name)
            .filter(|name| replacement.keeps(name))
            .cloned()
            .collect();
        let Replacement { pipelines, mut histories, all, .. } = replacement;
        let mut before = std::mem::take(&mut self.pipelines);
        let mut measured: Vec<Option<History>> =
            std::mem::take(&mut self.board.histories).into_iter().map(Some).collect();
        let index_before = |name: &str| self.all.iter().position(|known| known.name == name);
        for (index, pipeline) in all.iter().enumerate().filter(|(_, it)| kept.contains(&it.name)) {
            let history =
                index_before(&pipeline.name).and_then(|was| measured.get_mut(was)?.take());
            if let (Some(place), Some(history)) = (histories.get_mut(index), history) {
                *place = history;
            }
        }
        let go_on = |mut prepared: Prepared| {
            let was = before.iter().position(|was| was.name == prepared.name);
            if let Some(was) = was.map(|was| before.swap_remove(was)) {
                prepared.is_chosen = was.is_chosen;
                if kept.contains(&*prepared.name) {
                    prepared.go_on_from(was);
                }
            }
            prepared
        };
        self.pipelines = pipelines.into_iter().map(go_on).collect();
        self.board = Board { histories, parameters: std::mem::take(&mut self.board.parameters) };
        self.all = all;
        // What is known of a channel that nobody reads any more takes memory for nothing.
        let first = Channel::find(channels, None).map(|channel| channel.name);
        let pipelines = &self.pipelines;
        self.sources.retain(|channel, _| {
            let reads = |name: Option<&str>| match name {
                Some(name) => name == channel,
                None => first.as_ref().map_or(true, |first| first == channel),
            };
            pipelines.iter().any(|prepared| reads(prepared.pipeline.channel.as_deref()))
        });
    }
}
