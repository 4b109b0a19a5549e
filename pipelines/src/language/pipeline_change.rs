//! Changes of the pipelines while a run goes on.

use std::collections::HashSet;
use std::path::{Component, Path};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::pipeline::{Due, Pipeline};
use super::stage::{FileSink, Stage};
use super::{Config, Problem, Problems, Validate, check_parameters, nearest};
use crate::limits::PIPELINES;

/// A change of the pipelines of a run. All of it takes effect at one step, or none of it.
///
/// A pipeline that stays the same goes on as if nothing had happened; one that is replaced starts
/// anew.
///
/// ```
/// use tombolo_pipelines::language::{PipelineChange, parse, parse_json};
///
/// let config = parse(
///     r#"{"version": 1, "pipelines": [
///         {"name": "speed", "stages": [{"statistics": {"field": "velocity", "name": "speed"}}]},
///         {"name": "halt", "stages": [], "when": "speed.max > 9", "then": [{"stop": {}}]}]}"#,
///     "halt.json",
/// )?;
/// let change: PipelineChange = parse_json(r#"{"remove": ["speed"]}"#, "message")?;
/// assert_eq!(
///     change.after(&config, &[]).unwrap_err().to_string(),
///     "remove: pipeline `halt` could not go on: when: column 1 of the formula: found the unknown \
///      name `speed.max`, expected a monitor"
/// );
/// let change: PipelineChange = parse_json(r#"{"remove": ["halt"]}"#, "message")?;
/// assert_eq!(change.after(&config, &[])?.pipelines.len(), 1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum PipelineChange {
    /// Adds these pipelines behind the others. One whose name is known replaces the pipeline of
    /// that name, in its place.
    Set(Vec<Pipeline>),
    /// Removes the pipelines of these names.
    Remove(Vec<String>),
    /// Replaces all pipelines by these.
    All(Vec<Pipeline>),
}

impl PipelineChange {
    /// The change's key in JSON.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            PipelineChange::Set(_) => "set",
            PipelineChange::Remove(_) => "remove",
            PipelineChange::All(_) => "all",
        }
    }

    /// The pipelines that the change brings.
    #[must_use]
    pub fn pipelines(&self) -> &[Pipeline] {
        match self {
            PipelineChange::Set(pipelines) | PipelineChange::All(pipelines) => pipelines,
            PipelineChange::Remove(_) => &[],
        }
    }

    /// The pipelines that the change brings, to be changed.
    #[must_use]
    pub fn pipelines_mut(&mut self) -> &mut [Pipeline] {
        match self {
            PipelineChange::Set(pipelines) | PipelineChange::All(pipelines) => pipelines,
            PipelineChange::Remove(_) => &mut [],
        }
    }

    /// Whether it changes how orders are carried out: it brings a pipeline that runs on orders, or
    /// replaces or removes one of `before`.
    #[must_use]
    pub fn changes_orders(&self, before: &Config) -> bool {
        let on_order = |pipeline: &Pipeline| pipeline.due == Due::OnOrder;
        let goes = |known: &Pipeline| match self {
            PipelineChange::All(_) => true,
            PipelineChange::Set(pipelines) => pipelines.iter().any(|new| new.name == known.name),
            PipelineChange::Remove(names) => names.contains(&known.name),
        };
        self.pipelines().iter().any(on_order)
            || before.pipelines.iter().any(|known| on_order(known) && goes(known))
    }

    /// The configuration with the change made, whole and valid: also what pipelines say of each
    /// other's monitors, and the parameters that they name, of which the solver has `parameters`.
    ///
    /// # Errors
    /// The first [`Problem`], with the way to it from the change. Of a pipeline that the change
    /// does not bring it tells the name.
    pub fn after(&self, before: &Config, parameters: &[&str]) -> Result<Config, Problem> {
        self.validate()?;
        let mut after = before.clone();
        let all = &mut after.pipelines;
        // Of each pipeline its index in the change, where the change brings it.
        let mut brought = vec![None; all.len()];
        match self {
            PipelineChange::All(pipelines) => {
                all.clone_from(pipelines);
                brought = (0..pipelines.len()).map(Some).collect();
            }
            PipelineChange::Set(pipelines) => {
                for (index, pipeline) in pipelines.iter().enumerate() {
                    match all.iter().position(|known| known.name == pipeline.name) {
                        Some(place) => {
                            all[place].clone_from(pipeline);
                            brought[place] = Some(index);
                        }
                        None => {
                            all.push(pipeline.clone());
                            brought.push(Some(index));
                        }
                    }
                }
            }
            PipelineChange::Remove(names) => {
                for (index, name) in names.iter().enumerate() {
                    let Some(place) = all.iter().position(|known| known.name == *name) else {
                        let known = before.pipelines.iter().map(|known| known.name.as_str());
                        let message = format!("found `{name:.60}`, which no pipeline is named");
                        let problem = Problem::new(message).suggest(nearest(name, known));
                        return Err(problem.at(index).within("remove"));
                    };
                    all.remove(place);
                    brought.remove(place);
                }
            }
        }
        let checked = after
            .validate()
            .and_then(|()| check_parameters(&after, parameters).map_err(Problems::into_first));
        let checked = checked.and_then(|()| check_steered(before, &after));
        checked.map_err(|problem| self.found(problem, &after, &brought))?;
        Ok(after)
    }

    /// A problem of the configuration after the change, as one of the change.
    fn found(&self, problem: Problem, after: &Config, brought: &[Option<usize>]) -> Problem {
        let (index, problem) = problem.of_pipeline();
        let Some(index) = index else { return problem.within(self.name()) };
        match (brought.get(index), after.pipelines.get(index)) {
            (Some(Some(own)), _) => problem.at(*own).within(self.name()),
            (_, Some(pipeline)) => {
                let message = format!("pipeline `{}` could not go on: {problem}", pipeline.name);
                Problem::new(message).within(self.name())
            }
            _ => problem.within(self.name()),
        }
    }

    /// Refuses what a change may not do that comes over the network: name a file to be read, or one
    /// to be written that lies outside the run's output directory.
    ///
    /// # Errors
    /// The first [`Problem`], with the way to it from the change.
    pub fn check_files(&self) -> Result<(), Problem> {
        for (index, pipeline) in self.pipelines().iter().enumerate() {
            check_files(pipeline).map_err(|problem| problem.at(index).within(self.name()))?;
        }
        Ok(())
    }
}

impl Validate for PipelineChange {
    /// Checks each pipeline by itself.
    fn validate(&self) -> Result<(), Problem> {
        let located = |problem: Problem| problem.within(self.name());
        let (count, names): (usize, Vec<&String>) = match self {
            PipelineChange::Set(pipelines) | PipelineChange::All(pipelines) => {
                (pipelines.len(), pipelines.iter().map(|pipeline| &pipeline.name).collect())
            }
            PipelineChange::Remove(names) => (names.len(), names.iter().collect()),
        };
        PIPELINES.check(count).map_err(|exceeded| located(exceeded.into()))?;
        if count == 0 && !matches!(self, PipelineChange::All(_)) {
            return Err(located(Problem::new("expected at least one pipeline")));
        }
        let mut known = HashSet::new();
        if let Some(index) = names.iter().position(|name| !known.insert(*name)) {
            let message = format!("found the pipeline `{:.60}` twice", names[index]);
            return Err(located(Problem::new(message).at(index)));
        }
        for (index, pipeline) in self.pipelines().iter().enumerate() {
            if let Some(problem) = pipeline.problems(true).into_iter().next() {
                return Err(located(problem.at(index)));
            }
        }
        Ok(())
    }
}

/// Refuses to change the channel whose shape is measured from its first mesh.
pub(super) fn check_steered(before: &Config, after: &Config) -> Result<(), Problem> {
    let (was, is) = (before.steered_channel(), after.steered_channel());
    if was == is {
        return Ok(());
    }
    let told = |channel: Option<&str>| match channel {
        Some(channel) => format!("`{channel}`"),
        None => "the solver's first".to_owned(),
    };
    let (was, is) = (told(was), told(is));
    let message = format!(
        "the channel whose mesh orders change would be {is}; it stays {was} for the whole run"
    );
    let place = after.pipelines.iter().position(|pipeline| pipeline.due == Due::OnOrder);
    Err(match place {
        Some(index) => Problem::new(message).within("channel").at(index).within("pipelines"),
        None => Problem::new(message),
    })
}

/// Refuses a pipeline that names a file which one that comes over the network may not name.
pub(super) fn check_files(pipeline: &Pipeline) -> Result<(), Problem> {
    let check = |sink: Option<FileSink<'_>>| {
        sink.map_or(Ok(()), |sink| check_written(sink.file(), pipeline))
    };
    for (index, stage) in pipeline.stages.iter().enumerate() {
        let located = |problem: Problem| problem.within(stage.name()).at(index).within("stages");
        if matches!(stage, Stage::Displacement(import) if import.file.is_some()) {
            let message = "found the name of a file; what comes over the network names no \
                           files of this machine, expected `vertices` and `values`";
            return Err(located(Problem::new(message).within("file")));
        }
        check(stage.file_sink()).map_err(located)?;
    }
    for (index, action) in pipeline.then.iter().enumerate() {
        let located = |problem: Problem| problem.within(action.name()).at(index).within("then");
        check(action.file_sink()).map_err(located)?;
    }
    Ok(())
}

fn check_written(file: &str, pipeline: &Pipeline) -> Result<(), Problem> {
    let is_inside = |part: Component| matches!(part, Component::Normal(_) | Component::CurDir);
    if !Path::new(file).components().all(is_inside) || file.contains('\\') {
        let message = format!(
            "found `{file}`; what comes over the network is written below the run's output \
             directory, expected a relative name without `..`"
        );
        return Err(Problem::new(message).within("file"));
    }
    // The series of a pipeline's files has the pipeline's name.
    if pipeline.name.contains(['/', '\\']) {
        let message = format!(
            "found files of the pipeline `{}`; one that comes over the network and writes files \
             has no `/` in its name",
            pipeline.name
        );
        return Err(Problem::new(message));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::language::{locate, parse, parse_json, parse_message};

    fn config() -> Config {
        let text = r#"{"version": 1, "pipelines": [
            {"name": "inlet", "stages": [{"statistics": {"field": "pressure", "name": "inlet"}}]},
            {"name": "outlet", "stages": [{"statistics": {"field": "pressure", "name": "outlet"}}]},
            {"name": "drop", "stages": [{"difference": {"name": "drop", "of": "inlet.mean", "minus": "outlet.mean"}}]},
            {"name": "shape", "on": "order", "channel": "fluid", "stages": [{"schedule": {"steps": 3}}]}]}"#;
        parse(text, "test.json").unwrap()
    }

    fn after(change: &str) -> Result<Config, String> {
        let change: PipelineChange = parse_json(change, "change").unwrap();
        change.after(&config(), &["valve"]).map_err(|problem| problem.to_string())
    }

    fn names(config: &Config) -> Vec<&str> {
        config.pipelines.iter().map(|pipeline| pipeline.name.as_str()).collect()
    }

    #[test]
    fn a_known_name_is_replaced_in_its_place_and_a_new_one_added() {
        let changed = after(
            r#"{"set": [{"name": "health", "stages": [{"quality": {}}]},
                {"name": "outlet", "stages": [{"statistics": {"field": "speed", "name": "outlet"}}]}]}"#,
        )
        .unwrap();
        assert_eq!(names(&changed), ["inlet", "outlet", "drop", "shape", "health"]);
        let before = config();
        let same = |index: usize| changed.pipelines[index] == before.pipelines[index];
        assert_eq!([0, 1, 2, 3].map(same), [true, false, true, true]);
        assert_eq!(names(&after(r#"{"remove": ["drop", "inlet"]}"#).unwrap()), ["outlet", "shape"]);
        let all = r#"{"all": [{"name": "a", "stages": []},
            {"name": "shape", "on": "order", "channel": "fluid", "stages": []}]}"#;
        assert_eq!(names(&after(all).unwrap()), ["a", "shape"]);
    }

    #[test]
    fn what_would_not_hold_together_is_refused_at_its_place() {
        let cases = [
            (
                r#"{"remove": ["outlet"]}"#,
                "remove: pipeline `drop` could not go on: stages[0].difference.minus: found the \
                 unknown name `outlet.mean`",
            ),
            (
                r#"{"set": [{"name": "inlet", "stages": [{"quality": {}}]}]}"#,
                "set: pipeline `drop` could not go on: stages[0].difference.of",
            ),
            (
                r#"{"set": [{"name": "a", "stages": []}, {"name": "b", "stages": [], "when": "c > 1", "then": [{"pause": {}}]}]}"#,
                "set[1].when: column 1",
            ),
            (
                r#"{"set": [{"name": "a", "stages": [{"set": {"name": "valbe", "value": 1}}]}]}"#,
                "set[0].stages[0].set.name: the solver has no parameter `valbe`; it has valve",
            ),
            (
                r#"{"remove": ["inlte"]}"#,
                "remove[0]: found `inlte`, which no pipeline is named; did you mean `inlet`?",
            ),
            (r#"{"remove": []}"#, "remove: expected at least one"),
            (r#"{"remove": ["drop", "drop"]}"#, "remove[1]: found the pipeline `drop` twice"),
            (
                r#"{"set": [{"name": "a", "stages": []}, {"name": "a", "stages": []}]}"#,
                "set[1]: found the pipeline `a` twice",
            ),
            (r#"{"set": [{"name": "", "stages": []}]}"#, "set[0].name: expected a name"),
            (
                r#"{"remove": ["shape"]}"#,
                "remove: the channel whose mesh orders change would be the solver's first; it stays `fluid`",
            ),
            (
                r#"{"set": [{"name": "shape", "on": "order", "channel": "solid", "stages": []}]}"#,
                "set[0].channel: the channel whose mesh orders change would be `solid`",
            ),
            (
                r#"{"set": [{"name": "other", "on": "order", "stages": []}]}"#,
                "set[0].on: two pipelines run on orders",
            ),
        ];
        for (change, expected) in cases {
            let said = after(change).unwrap_err();
            assert!(said.starts_with(expected), "{change}: {said}");
        }
        let many: Vec<String> =
            (0..1025).map(|index| format!(r#"{{"name": "{index}", "stages": []}}"#)).collect();
        let said = after(&format!(r#"{{"all": [{}]}}"#, many.join(","))).unwrap_err();
        assert_eq!(said, "all: found 1025 pipelines, expected at most 1024");
        let said = after(&format!(r#"{{"set": [{}]}}"#, many[..1021].join(","))).unwrap_err();
        assert_eq!(said, "set: found 1025 pipelines, expected at most 1024");
        let view = |index| {
            format!(r#"{{"name": "{index}", "stages": [{{"surface": {{}}}}, {{"stream": {{}}}}]}}"#)
        };
        let views: Vec<String> = (0..257).map(view).collect();
        let said = after(&format!(r#"{{"set": [{}]}}"#, views.join(","))).unwrap_err();
        assert_eq!(said, "set: found 257 pipelines that stream, expected at most 256");
    }

    #[test]
    fn a_problem_is_found_at_its_token() {
        let text = r#"{"id": "a",
            "pipelines": {"set": [{"name": "b", "stages": [], "when": "c > 1", "then": [{"pause": {}}]}]}}"#;
        let (_, message) = parse_message(text);
        let Ok(crate::language::Message::Command(crate::language::Command::Pipelines(change))) =
            message
        else {
            panic!("{message:?}")
        };
        let problem = change.after(&config(), &[]).unwrap_err().within("pipelines");
        let error = locate(problem, text, "message");
        assert_eq!((error.line, error.column), (2, 71));
        assert_eq!(error.path, "pipelines.set[0].when");
        let (_, message) =
            parse_message(r#"{"pipelines": {"set": [{"name": "b", "stages": [{"slcie": {}}]}]}}"#);
        let error = message.unwrap_err();
        assert_eq!(error.suggestion.as_deref(), Some("slice"));
        assert!(error.path.starts_with("pipelines.set[0].stages[0]"), "{error}");
    }

    #[test]
    fn what_comes_over_the_network_stays_in_the_output_directory() {
        let check = |name: &str, stage: &str| {
            let text = format!(r#"{{"set": [{{"name": "{name}", "stages": [{stage}]}}]}}"#);
            let change: PipelineChange = parse_json(&text, "change").unwrap();
            change.check_files().map_err(|problem| problem.to_string())
        };
        check("a", r#"{"write": {"file": "out/{cycle}.vtu"}}"#).unwrap();
        check("a/b", r#"{"quality": {}}"#).unwrap();
        for (name, stage, expected) in [
            (
                "a",
                r#"{"write": {"file": "/etc/a.vtu"}}"#,
                "set[0].stages[0].write.file: found `/etc/a.vtu`",
            ),
            ("a", r#"{"csv": {"file": "b/../../a.csv"}}"#, "set[0].stages[0].csv.file"),
            (
                "../a",
                r#"{"write": {"file": "a.vtu"}}"#,
                "set[0].stages[0].write: found files of the pipeline `../a`",
            ),
            (
                "a",
                r#"{"displacement": {"file": "a.vtp"}}"#,
                "set[0].stages[0].displacement.file: found the name",
            ),
        ] {
            let said = check(name, stage).unwrap_err();
            assert!(said.starts_with(expected), "{said}");
        }
        let text =
            r#"{"all": [{"name": "a", "stages": [], "then": [{"write": {"file": "../a.vtu"}}]}]}"#;
        let change: PipelineChange = parse_json(text, "change").unwrap();
        assert!(
            change.check_files().unwrap_err().to_string().starts_with("all[0].then[0].write.file")
        );
    }
}
