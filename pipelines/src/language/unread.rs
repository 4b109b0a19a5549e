//! What of a configuration could not be read.

use std::collections::HashSet;

use super::Problem;
use super::error::Step;

/// The parts of a configuration that could not be read: what would be wrong for the lack of them
/// alone is not told.
#[derive(Debug, Default)]
pub(super) struct Unread {
    /// Whether a setting of the configuration itself is missing.
    pub(super) of_configuration: bool,
    /// The pipelines that lack a setting, a stage or an action.
    pub(super) pipelines: HashSet<usize>,
    /// The prefixes of monitors that stages which could not be read may measure.
    pub(super) monitors: HashSet<String>,
}

impl Unread {
    /// Whether all of a pipeline was read.
    pub(super) fn is_whole(&self, pipeline: usize) -> bool {
        !self.pipelines.contains(&pipeline)
    }

    /// Whether a stage that could not be read may measure a monitor of this name.
    pub(super) fn may_measure(&self, name: &str) -> bool {
        let of_pipeline = name.split_once('/').map_or(name, |(_, rest)| rest);
        [name, of_pipeline].iter().any(|name| {
            let first = name.split_once('.').map_or(*name, |(first, _)| first);
            self.monitors.contains(first) || self.monitors.contains(*name)
        })
    }
}

/// Problems as they are found.
#[derive(Debug, Default)]
pub(super) struct Found {
    problems: Vec<Problem>,
}

impl Found {
    /// Notes a problem, where there is one, at its place.
    pub(super) fn note(
        &mut self,
        result: Result<(), Problem>,
        place: impl FnOnce(Problem) -> Problem,
    ) {
        self.problems.extend(result.err().map(place));
    }

    /// Notes several problems at their place.
    pub(super) fn extend(&mut self, problems: Vec<Problem>, place: impl Fn(Problem) -> Problem) {
        self.problems.extend(problems.into_iter().map(place));
    }

    /// The first problem, where there is any.
    pub(super) fn first(self) -> Result<(), Problem> {
        self.problems.into_iter().next().map_or(Ok(()), Err)
    }

    pub(super) fn push(&mut self, problem: Problem) {
        self.problems.push(problem);
    }

    /// The stages and actions that have problems.
    pub(super) fn parts(&self) -> HashSet<Vec<Step>> {
        self.problems.iter().filter_map(Problem::part).collect()
    }

    pub(super) fn into_problems(self) -> Vec<Problem> {
        self.problems
    }
}
