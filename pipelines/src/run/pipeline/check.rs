//! A pipeline tried once, to see what is wrong with it.

use std::collections::HashSet;

use tombolo_deform::communicator::Communicator;

use super::prepare::gradient_of;
use super::{Board, Keyed, Prepared};
use crate::extract::{Snapshot, Source};
use crate::language::{Problem, Stage};

impl Prepared {
    /// Runs the stages and all actions on the first channel, and says what is wrong with each.
    pub(crate) fn check_all(
        &mut self,
        snapshot: &Snapshot,
        source: &mut Source,
        communicator: &dyn Communicator,
        board: &Board,
    ) -> Vec<Problem> {
        let Some(channel) = snapshot.channels.first() else { return Vec::new() };
        let mut outputs = Vec::new();
        let mut progress = self.begin(snapshot, channel, source, communicator, board, &mut outputs);
        let mut noted = Noted::default();
        self.check_selection(&mut progress);
        for (index, stage) in self.pipeline.stages.iter().enumerate() {
            if matches!(stage, Stage::Select(_)) {
                let located = |it: Problem| it.within(stage.name()).at(index).within("stages");
                noted.take(stage.name(), progress.errors.drain(..), located);
            }
        }
        let mut states = std::mem::take(&mut self.states);
        for (index, state) in states.iter_mut().enumerate() {
            self.stage(index, state, &mut progress);
            let Some(own) = self.own_stage(index) else { continue };
            let name = self.pipeline.stages[own].name();
            if !progress.errors.is_empty() {
                noted.lacking.extend(self.stages[index].added_fields());
            }
            let located = |it: Problem| it.within(name).at(own).within("stages");
            noted.take(self.stages[index].name(), progress.errors.drain(..), located);
        }
        for (index, action) in self.pipeline.then.iter().enumerate() {
            self.act(action, &self.names_of_actions[index], &mut progress);
            let located = |it: Problem| it.within(action.name()).at(index).within("then");
            noted.take(action.name(), progress.errors.drain(..), located);
        }
        noted.problems
    }

    /// The stage of the configuration for whose sake the stage at an index is there.
    fn own_stage(&self, index: usize) -> Option<usize> {
        let is_hidden =
            |stage: &&Stage| stage.derived_name().is_some_and(|name| self.hidden.contains(name));
        let stage = self.stages.get(index)?;
        if !is_hidden(&stage) {
            return Some(index - self.stages[..index].iter().filter(is_hidden).count());
        }
        let name = stage.derived_name();
        self.pipeline.stages.iter().position(|stage| {
            let velocity = match stage {
                Stage::Force(force) => force.velocity.as_ref(),
                Stage::WallShearStress(stress) => Some(&stress.velocity),
                _ => None,
            };
            velocity.map(|velocity| gradient_of(velocity)).as_deref() == name
        })
    }
}

/// The problems, each once.
#[derive(Default)]
struct Noted {
    problems: Vec<Problem>,
    keys: HashSet<String>,
    /// Fields that are not there because the stages that derive them have failed.
    lacking: HashSet<String>,
}

impl Noted {
    fn take(
        &mut self,
        stage: &str,
        errors: impl Iterator<Item = Keyed>,
        located: impl Fn(Problem) -> Problem,
    ) {
        for (key, message) in errors {
            // Which stage it is, and which step, shows in the place.
            let of_stage = message.split_once(": ").filter(|(before, _)| {
                before.split(' ').next() == Some(stage) || before.starts_with("cycle ")
            });
            let message = of_stage.map_or(message.as_str(), |(_, message)| message);
            let named = message.split('`').nth(1).unwrap_or_default();
            let field = named.rsplit_once('.').map_or(named, |(field, _)| field);
            let follows = [named, field].iter().any(|name| self.lacking.contains(*name))
                && message.contains("no field");
            // Several stages may tell of the same: that a point is not finite, for one.
            if !follows && self.keys.insert(format!("{key} {message}")) {
                self.problems.push(located(Problem::told(message)));
            }
        }
    }
}
