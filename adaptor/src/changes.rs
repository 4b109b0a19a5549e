//! Changes of the pipelines on their way from whoever asks for them to the solver's thread.

use std::collections::VecDeque;
use std::path::absolute;
use std::sync::{Arc, Mutex};

use tombolo_pipelines::{
    language::{Command, Config, PipelineChange, Problem, Stage},
    limits::CHANGES,
};

use crate::{
    lock::lock,
    steering::{Log, Queue, Received, Source},
    stream::Clock,
};

/// Knows what the pipelines will be once all changes that were taken have been made, so that one
/// that does not go with them is refused at once, on the thread of whoever asks.
pub(crate) struct Changes {
    queue: Arc<Queue>,
    log: Arc<Log>,
    clock: Arc<Clock>,
    /// The names of the solver's parameters.
    parameters: Vec<String>,
    state: Mutex<State>,
}

struct State {
    /// The configuration as it is now.
    config: Arc<Config>,
    /// The changes that were taken and not made yet, by their ids.
    under_way: Vec<(String, Arc<PipelineChange>)>,
    /// The ids of the newest that were taken and then refused.
    refused: VecDeque<String>,
}

impl Changes {
    pub(crate) fn new(
        config: Arc<Config>,
        parameters: Vec<String>,
        queue: Arc<Queue>,
        log: Arc<Log>,
        clock: Arc<Clock>,
    ) -> Self {
        let state = Mutex::new(State { config, under_way: Vec::new(), refused: VecDeque::new() });
        Self { queue, log, clock, parameters, state }
    }

    /// The number of the run, as its events have it.
    pub(crate) fn run(&self) -> Option<&str> {
        self.log.run()
    }

    /// The configuration as it will be once the changes that wait have been made.
    pub(crate) fn ahead(&self) -> Arc<Config> {
        let (mut config, under_way) = {
            let state = lock(&self.state);
            (Arc::clone(&state.config), state.under_way.clone())
        };
        for (_, change) in under_way {
            // The solver's thread will find the same of one that does not go with those before.
            if let Ok(after) = self.after(&change, &config) {
                config = Arc::new(after);
            }
        }
        config
    }

    /// The configuration after a change of `before`.
    ///
    /// # Errors
    /// The first problem of the pipelines as they would be, with the way to it from the change.
    pub(crate) fn after(
        &self,
        change: &PipelineChange,
        before: &Config,
    ) -> Result<Config, Problem> {
        let parameters: Vec<&str> = self.parameters.iter().map(String::as_str).collect();
        change.after(before, &parameters)
    }

    /// Finds out whether a change goes with the pipelines as they will be then.
    ///
    /// # Errors
    /// The first problem of the pipelines as they would be, with the way to it from the change.
    pub(crate) fn check(&self, change: &PipelineChange) -> Result<(), Problem> {
        let waiting = lock(&self.state).under_way.len();
        CHANGES.check(waiting + 1).map_err(come_back)?;
        self.after(change, &self.ahead()).map(drop)
    }

    /// Takes a change of so many bytes in: the solver's thread makes it at its next safe point.
    /// Tells its id.
    ///
    /// # Errors
    /// Why it was not taken, with the way to it from the change.
    pub(crate) fn take(
        &self,
        id: Option<String>,
        source: Source,
        mut change: PipelineChange,
        bytes: usize,
    ) -> Result<String, Problem> {
        self.check(&change)?;
        make_absolute(&mut change);
        let command = Command::Pipelines(change.clone());
        let reservation = self.queue.reserve(&command, bytes).map_err(come_back)?;
        let id = self.log.accept(id, &source, &command, self.clock.get()).map_err(Problem::new)?;
        lock(&self.state).under_way.push((id.clone(), Arc::new(change)));
        let reservation = Some(reservation);
        self.queue.push(Received { source, id: id.clone(), command, reservation });
        Ok(id)
    }

    /// Takes a change of a viewer in, from the message `text`, as [`Changes::take`] does; it counts
    /// once it is on disk.
    ///
    /// # Errors
    /// Why it was not taken, with the way to it from the change.
    pub(crate) fn take_from(
        self: &Arc<Self>,
        client: u64,
        id: Option<String>,
        change: PipelineChange,
        text: &str,
    ) -> Result<(), Problem> {
        let mut absolute = change.clone();
        make_absolute(&mut absolute);
        let command = Command::Pipelines(absolute.clone());
        let Some(id) = self.log.name(client, id, &command).map_err(Problem::new)? else {
            return Ok(());
        };
        if let Err(problem) = self.check(&change) {
            self.log.forget(&id);
            return Err(problem);
        }
        let reservation = self.queue.reserve(&command, text.len()).map_err(|exceeded| {
            self.log.forget(&id);
            come_back(exceeded)
        })?;
        lock(&self.state).under_way.push((id.clone(), Arc::new(absolute)));
        let changes = Arc::clone(self);
        let source = Source::Viewer(client);
        let received = Received {
            source,
            id: id.clone(),
            command: command.clone(),
            reservation: Some(reservation),
        };
        self.log.accept_from(client, id, &command, self.clock.get(), move |taken| match taken {
            Some(tell) => changes.queue.push_and_tell(received, tell),
            None => lock(&changes.state).under_way.retain(|(waiting, _)| *waiting != received.id),
        });
        Ok(())
    }

    /// Notes whether a change was made, and the configuration as it is now.
    pub(crate) fn settle(&self, id: &str, is_made: bool, config: &Arc<Config>) {
        let mut state = lock(&self.state);
        state.under_way.retain(|(waiting, _)| waiting != id);
        state.config = Arc::clone(config);
        if !is_made {
            if state.refused.len() >= CHANGES.most {
                state.refused.pop_front();
            }
            state.refused.push_back(id.to_owned());
        }
    }

    /// Whether a change was taken, and then refused by the solver's thread.
    pub(crate) fn was_refused(&self, id: &str) -> bool {
        lock(&self.state).refused.iter().any(|refused| refused == id)
    }
}

fn come_back(exceeded: tombolo_pipelines::limits::Exceeded) -> Problem {
    Problem::new(format!(
        "{exceeded}; the solver has not come to those before this one yet, try again later"
    ))
}

/// Names the files that pipelines read by their whole paths, so that a journal replays wherever it
/// lies.
pub(crate) fn make_absolute(change: &mut PipelineChange) {
    for stage in change.pipelines_mut().iter_mut().flat_map(|pipeline| &mut pipeline.stages) {
        if let Stage::Displacement(import) = stage
            && let Some(file) = &mut import.file
            && let Ok(whole) = absolute(&*file)
        {
            *file = whole.to_string_lossy().into_owned();
        }
    }
}

#[cfg(test)]
mod tests {
    use tombolo_pipelines::language::{parse, parse_json};

    use super::*;
    use crate::journal::Journal;
    use crate::steering::Events;

    fn changes() -> Changes {
        let text = r#"{"version": 1, "pipelines": [{"name": "a", "stages": [{"quality": {}}]}]}"#;
        let config = Arc::new(parse(text, "test.json").unwrap());
        let (queue, log) =
            (Arc::default(), Arc::new(Log::new(Journal::none(), None, Events::default())));
        Changes::new(config, Vec::new(), queue, log, Arc::default())
    }

    fn take(changes: &Changes, change: &str) -> Result<(), String> {
        let change: PipelineChange = parse_json(change, "change").unwrap();
        let taken = changes.take(None, Source::Program, change, 10);
        taken.map(drop).map_err(|problem| problem.to_string())
    }

    fn names(changes: &Changes) -> Vec<String> {
        changes.ahead().pipelines.iter().map(|pipeline| pipeline.name.clone()).collect()
    }

    #[test]
    fn a_change_is_judged_by_what_those_before_will_have_made() {
        let changes = changes();
        let halt = r#"{"set": [{"name": "halt", "stages": [], "when": "speed.max > 1", "then": [{"stop": {}}]}]}"#;
        assert!(take(&changes, halt).unwrap_err().contains("unknown name `speed.max`"));
        let speed = r#"{"set": [{"name": "b", "stages": [{"statistics": {"field": "speed"}}]}]}"#;
        take(&changes, speed).unwrap();
        take(&changes, halt).unwrap();
        assert_eq!(names(&changes), ["a", "b", "halt"]);
        assert!(
            take(&changes, r#"{"remove": ["b"]}"#).unwrap_err().contains("`halt` could not go on")
        );
        // The first of them was not made, so that the second will not be either.
        let received = changes.queue.take();
        let config = Arc::clone(&lock(&changes.state).config);
        changes.settle(&received[0].id, false, &config);
        assert_eq!(names(&changes), ["a"]);
        assert!(changes.was_refused(&received[0].id) && !changes.was_refused(&received[1].id));
        changes.settle(&received[1].id, false, &config);
        take(&changes, r#"{"remove": ["a"]}"#).unwrap();
        assert!(names(&changes).is_empty());
    }

    #[test]
    fn only_so_many_changes_wait() {
        let changes = changes();
        let another =
            |index: usize| format!(r#"{{"set": [{{"name": "b{index}", "stages": []}}]}}"#);
        (0..CHANGES.most).for_each(|index| take(&changes, &another(index)).unwrap());
        let said = take(&changes, &another(CHANGES.most)).unwrap_err();
        assert!(said.starts_with("found 65 changes of pipelines, expected at most 64"), "{said}");
        for received in changes.queue.take() {
            let after = match &received.command {
                Command::Pipelines(change) => changes.after(change, &changes.ahead()).unwrap(),
                other => panic!("{other:?}"),
            };
            changes.settle(&received.id, true, &Arc::new(after));
        }
        take(&changes, &another(CHANGES.most)).unwrap();
    }
}
