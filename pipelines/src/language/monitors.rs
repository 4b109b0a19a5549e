//! The monitors of pipelines: their names and units, and what of them a pipeline may name.

use std::collections::{HashMap, HashSet};

use super::configuration::Config;
use super::derived::{Formula, PARAMETER};
use super::pipeline::{AgainAfter, Due, Pipeline};
use super::stage::{Action, FileSink, Stage};
use super::unread::Found;
use super::{Csv, Log, Parameter, Problem, Problems, nearest};
use crate::expression::{Expression, UsedName};
use crate::limits::{BINS, HISTORY};

/// A number that a pipeline measures.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Monitor {
    /// Its name, which no other monitor of the pipeline has: `quality.min`.
    pub name: String,
    /// Its unit, where one is given.
    pub unit: Option<String>,
}

impl Monitor {
    /// The name with the unit in brackets behind it, where there is one.
    #[must_use]
    pub fn titled(&self) -> String {
        match &self.unit {
            Some(unit) => format!("{} [{unit}]", self.name),
            None => self.name.clone(),
        }
    }
}

/// Names among which the nearest to an unknown one is looked for: there may be a million.
const NEAR: usize = 10_000;

/// The suffixes of the names of vector components.
const XYZ: [&str; 3] = ["x", "y", "z"];

/// The monitors of a pipeline, in the order in which the runner gives their values; the first two
/// are `cycle` and `time`.
#[must_use]
pub fn monitors(pipeline: &Pipeline) -> Vec<Monitor> {
    let mut all = vec![Monitor { name: "cycle".into(), unit: None }];
    all.push(Monitor { name: "time".into(), unit: None });
    let has_faces = pipeline.stages.iter().any(Stage::takes_faces);
    pipeline.stages.iter().for_each(|stage| all.extend(monitors_of(stage, has_faces)));
    all
}

/// The monitors of one stage, no more than its limits allow: where all errors of a file are looked for,
/// the names of a stage beyond them are asked for too. `has_faces` says whether the extract is one of
/// faces, through which a vector field has a flux.
pub(crate) fn monitors_of(stage: &Stage, has_faces: bool) -> Vec<Monitor> {
    let mut all = Vec::new();
    let mut add = |prefix: &str, suffix: &str, unit: Option<&String>| {
        let name = if suffix.is_empty() { prefix.into() } else { format!("{prefix}.{suffix}") };
        all.push(Monitor { name, unit: unit.cloned() });
    };
    match stage {
        Stage::Quality {} => {
            ["min", "mean", "max", "inverted"].iter().for_each(|name| add("quality", name, None));
        }
        Stage::Statistics(stage) => {
            let unit = stage.unit.as_ref();
            ["min", "max", "mean", "l2"].iter().for_each(|name| add(stage.name(), name, unit));
            add(stage.name(), "non_finite", None);
        }
        Stage::Integrate(stage) => {
            let (name, mean) = (&stage.name, stage.unit.as_ref());
            let unit = |suffix: &str| stage.units.get(suffix);
            add(name, "size", unit("size"));
            if stage.field.is_some() {
                add(name, "integral", unit("integral"));
                add(name, "mean", mean.or(unit("mean")));
            }
            if stage.vector.is_some() {
                XYZ.iter().for_each(|xyz| add(name, &format!("integral.{xyz}"), unit("integral")));
                XYZ.iter().for_each(|xyz| add(name, &format!("mean.{xyz}"), mean.or(unit("mean"))));
                if has_faces {
                    add(name, "flow_rate", unit("flow_rate"));
                }
            }
        }
        Stage::Decimate(_) => {
            ["error", "triangles"].iter().for_each(|name| add("decimate", name, None));
        }
        Stage::Histogram(stage) => {
            ["lower", "upper"].iter().for_each(|name| add(&stage.name, name, stage.unit.as_ref()));
            ["below", "above"].iter().for_each(|name| add(&stage.name, name, None));
            let bins = (stage.bins as usize).min(BINS.most);
            (0..bins).for_each(|bin| add(&stage.name, &format!("bins.{bin}"), None));
        }
        Stage::Force(stage) => {
            let (name, force) = (&stage.name, stage.unit.as_ref());
            let unit = |suffix: &str| stage.units.get(suffix);
            XYZ.iter().for_each(|xyz| add(name, xyz, force));
            XYZ.iter().for_each(|xyz| add(name, &format!("moment.{xyz}"), unit("moment")));
            add(name, "size", unit("size"));
            if stage.pressure.is_some() {
                XYZ.iter().for_each(|xyz| add(name, &format!("pressure.{xyz}"), force));
                add(name, "mean_pressure", unit("mean_pressure"));
            }
            if stage.velocity.is_some() {
                XYZ.iter().for_each(|xyz| add(name, &format!("viscous.{xyz}"), force));
            }
        }
        Stage::Difference(stage) => add(&stage.name, "", stage.unit.as_ref()),
        Stage::TimeStatistics(stage) if stage.monitor.is_some() => {
            let unit = stage.unit.as_ref();
            stage.measures.iter().for_each(|measure| add(&stage.name, measure.name(), unit));
            add(&stage.name, "time", None);
        }
        Stage::Spectrum(stage) => {
            ["frequency", "resolution"].iter().for_each(|name| add(&stage.name, name, None));
            add(&stage.name, "amplitude", stage.unit.as_ref());
            let samples = (stage.samples as usize).min(HISTORY.most);
            (0..=samples / 2).for_each(|k| add(&stage.name, &format!("power.{k}"), None));
        }
        _ => {}
    }
    all
}

/// Where the value of a name is found.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Slot {
    /// Among the values of the pipeline itself.
    Own(usize),
    /// Among those of another pipeline, by its index in the configuration.
    Other { pipeline: usize, monitor: usize },
    /// Among the solver's parameters.
    Parameter(String),
}

/// The pipelines of a configuration with the monitors of each, which are listed once: a pipeline may name
/// those of all others.
pub(crate) struct Monitored<'a> {
    pub(crate) pipelines: &'a [Pipeline],
    monitors: Vec<Vec<Monitor>>,
}

impl<'a> Monitored<'a> {
    pub(crate) fn of(pipelines: &'a [Pipeline]) -> Self {
        Self { pipelines, monitors: pipelines.iter().map(monitors).collect() }
    }

    /// The names that the pipeline at an index may use.
    pub(crate) fn scope(&self, index: usize) -> Scope<'_> {
        Scope { all: self, index }
    }
}

/// The names that a pipeline may use.
pub(crate) struct Scope<'a> {
    all: &'a Monitored<'a>,
    index: usize,
}

impl Scope<'_> {
    /// The pipeline's own monitors.
    pub(crate) fn own(&self) -> &[Monitor] {
        &self.all.monitors[self.index]
    }

    /// The monitors of other pipelines but `cycle` and `time`, with their indices and with the names
    /// by which any of them may be called.
    fn of_others(&self) -> impl Iterator<Item = (Slot, &str, &Monitor)> {
        let all = self.all.pipelines.iter().zip(&self.all.monitors).enumerate();
        let others = all.filter(|(index, _)| *index != self.index);
        others.flat_map(|(pipeline, (of, monitors))| {
            monitors
                .iter()
                .enumerate()
                .skip(2)
                .map(move |(monitor, it)| (Slot::Other { pipeline, monitor }, of.name.as_str(), it))
        })
    }

    /// Where the value of a name is found: among the own monitors, or those of another pipeline.
    ///
    /// # Errors
    /// A [`Problem`] with the nearest name, or with the full names where several pipelines have it.
    pub(crate) fn find(&self, name: &str) -> Result<Slot, Problem> {
        if let Some(parameter) = name.strip_prefix(PARAMETER) {
            return Ok(Slot::Parameter(parameter.to_owned()));
        }
        if let Some(own) = self.own().iter().position(|monitor| monitor.name == name) {
            return Ok(Slot::Own(own));
        }
        let qualified = |pipeline: &str, monitor: &Monitor| format!("{pipeline}/{}", monitor.name);
        let is_meant = |pipeline: &str, monitor: &Monitor| {
            monitor.name == name
                || name.strip_prefix(pipeline).and_then(|rest| rest.strip_prefix('/'))
                    == Some(&monitor.name)
        };
        let mut found = self.of_others().filter(|(_, pipeline, it)| is_meant(pipeline, it));
        match (found.next(), found.next()) {
            (Some((slot, ..)), None) => Ok(slot),
            (Some((_, a, first)), Some((_, b, second))) => Err(Problem::new(format!(
                "found `{name}`, which several pipelines have, expected `{}` or `{}`",
                qualified(a, first),
                qualified(b, second)
            ))),
            (None, _) => {
                let own = self.own().iter().map(|monitor| monitor.name.clone());
                let others = self.of_others().flat_map(|(_, pipeline, monitor)| {
                    [monitor.name.clone(), qualified(pipeline, monitor)]
                });
                let known: Vec<String> = own.chain(others).take(NEAR).collect();
                let near = nearest(name, known.iter().map(String::as_str));
                Err(Problem::new(format!(
                    "found the unknown name `{name:.60}`, expected a monitor"
                ))
                .suggest(near)
                .of_unmeasured(name))
            }
        }
    }

    /// The monitor at an index, with the name by which it was called.
    pub(crate) fn monitor(&self, name: &str, slot: &Slot) -> Monitor {
        let monitor = match slot {
            Slot::Own(index) => self.own().get(*index),
            Slot::Other { pipeline, monitor } => {
                self.all.monitors.get(*pipeline).and_then(|monitors| monitors.get(*monitor))
            }
            Slot::Parameter(_) => None,
        };
        Monitor { name: name.to_owned(), unit: monitor.and_then(|monitor| monitor.unit.clone()) }
    }
}

/// A condition over monitors and parameters.
#[derive(Debug, Clone)]
pub(crate) struct Condition {
    expression: Expression,
    slots: Vec<Slot>,
}

impl Condition {
    /// # Errors
    /// A [`Problem`] at the first token that is wrong.
    pub(crate) fn parse(text: &str, scope: &Scope<'_>) -> Result<Self, Problem> {
        Self::find(text, scope).map_err(|mut problems| problems.swap_remove(0))
    }

    /// # Errors
    /// One [`Problem`] where the text is no condition, or one for each name that is not known.
    fn find(text: &str, scope: &Scope<'_>) -> Result<Self, Vec<Problem>> {
        let (expression, names) = Expression::parse_open_condition(text).map_err(|error| {
            let message = format!("column {} of the formula: {}", error.column, error.message);
            vec![Problem::new(message).suggest(error.suggestion.as_deref())]
        })?;
        let (mut slots, mut problems) = (Vec::new(), Vec::new());
        for UsedName { name, column } in &names {
            match scope.find(name) {
                Ok(slot) => slots.push(slot),
                Err(problem) => {
                    problems.push(problem.after(&format!("column {column} of the formula: ")));
                }
            }
        }
        if problems.is_empty() { Ok(Self { expression, slots }) } else { Err(problems) }
    }

    /// Whether it holds; a comparison with NaN does not.
    pub(crate) fn holds(&self, value: impl Fn(&Slot) -> f64) -> bool {
        let values: Vec<f64> = self.slots.iter().map(value).collect();
        self.expression.holds(&values)
    }
}

/// The monitors of a table, and where each is found.
pub(crate) fn columns(csv: &Csv, scope: &Scope<'_>) -> Result<Vec<(Monitor, Slot)>, Problem> {
    if csv.monitors.is_empty() {
        let own = scope.own().iter().enumerate().skip(2);
        return Ok(own.map(|(index, it)| (it.clone(), Slot::Own(index))).collect());
    }
    let column = |(index, name): (usize, &String)| {
        let slot = scope.find(name).map_err(|it| it.at(index).within("monitors"))?;
        Ok((scope.monitor(name, &slot), slot))
    };
    csv.monitors.iter().enumerate().map(column).collect()
}

/// A line of text with numbers: text, then what stands behind it.
pub(crate) type Line = Vec<(String, Option<Slot>)>;

/// The parts of a line in the log.
pub(crate) fn line(log: &Log, scope: &Scope<'_>) -> Result<Line, Problem> {
    if log.message.is_some() {
        let part = |(text, name): (&str, Option<&str>)| {
            let slot = name.map(|name| scope.find(name)).transpose();
            Ok((text.to_owned(), slot.map_err(|problem| problem.within("message"))?))
        };
        return log.parts()?.into_iter().map(part).collect();
    }
    let own = scope.own().iter().enumerate();
    Ok(own
        .map(|(index, monitor)| {
            let before = if index == 0 { "" } else { ", " };
            (format!("{before}{} ", monitor.titled()), Some(Slot::Own(index)))
        })
        .collect())
}

/// Checks of all pipelines what they say of each other's monitors.
pub(super) fn check(config: &Config, found: &mut Found) {
    // Each file, with the pipeline that writes it.
    let mut files = HashMap::new();
    let mut databases = HashSet::new();
    let faulty = found.parts();
    let monitored = Monitored::of(&config.pipelines);
    for (index, pipeline) in config.pipelines.iter().enumerate() {
        let located = |problem: Problem| problem.at(index).within("pipelines");
        let scope = monitored.scope(index);
        let (problems, twice) = check_pipeline(pipeline, &scope);
        found.extend(problems.into_problems(), located);
        // A stage with another fault is told of that.
        let is_new = |problem: &Problem| problem.part().is_none_or(|part| !faulty.contains(&part));
        twice.into_iter().map(located).filter(is_new).for_each(|problem| found.push(problem));
        for sink in pipeline.file_sinks() {
            let file = sink.file();
            let message = match sink {
                FileSink::Csv(_) | FileSink::Write(_) => {
                    let is_other = *files.entry(file).or_insert(index) != index;
                    is_other.then(|| format!("another pipeline writes the file `{file}`"))
                }
                FileSink::Render(render) => {
                    (render.is_database() && !databases.insert(file)).then(|| {
                        format!(
                            "two `render` write the database `{file}`, where their pictures would \
                             be called alike; expected one for each"
                        )
                    })
                }
            };
            if let Some(message) = message {
                found.push(located(Problem::new(message)));
            }
        }
    }
}

/// Checks of a configuration that the parameters it names are among those that a solver has.
///
/// # Errors
/// A [`Problem`] for each condition, stage and action that names another, with the nearest name.
pub fn check_parameters(config: &Config, known: &[&str]) -> Result<(), Problems> {
    let parameters = Parameters { known };
    let mut found = Found::default();
    let monitored = Monitored::of(&config.pipelines);
    for (index, pipeline) in config.pipelines.iter().enumerate() {
        let located = |problem: Problem| problem.at(index).within("pipelines");
        let scope = monitored.scope(index);
        let again = match &pipeline.again_after {
            Some(AgainAfter::Condition(text)) => Some(text),
            _ => None,
        };
        for (key, text) in [("when", pipeline.when.as_ref()), ("again_after", again)] {
            let checked = text.map_or(Ok(()), |text| parameters.check_condition(text, &scope));
            found.note(checked, |problem| located(problem.within(key)));
        }
        for (index, stage) in pipeline.stages.iter().enumerate() {
            let checked = match stage {
                Stage::Set(parameter) => parameters.check_set(parameter),
                Stage::Csv(csv) => parameters.check_table(csv, &scope),
                Stage::Log(log) => parameters.check_line(log, &scope),
                Stage::Expression(formula) => parameters.check_formula(formula),
                _ => Ok(()),
            };
            found.note(checked, |it| located(it.within(stage.name()).at(index).within("stages")));
        }
        for (index, action) in pipeline.then.iter().enumerate() {
            let checked = match action {
                Action::Set(parameter) => parameters.check_set(parameter),
                Action::Csv(csv) => parameters.check_table(csv, &scope),
                Action::Log(log) => parameters.check_line(log, &scope),
                _ => Ok(()),
            };
            found.note(checked, |it| located(it.within(action.name()).at(index).within("then")));
        }
    }
    Problems::none(found.into_problems())
}

/// The parameters that a solver has.
struct Parameters<'a> {
    known: &'a [&'a str],
}

impl Parameters<'_> {
    fn check(&self, name: &str) -> Result<(), Problem> {
        if self.known.contains(&name) {
            return Ok(());
        }
        let all = if self.known.is_empty() { "none".into() } else { self.known.join(", ") };
        let message = format!("the solver has no parameter `{name}`; it has {all}");
        Err(Problem::new(message).suggest(nearest(name, self.known.iter().copied())))
    }

    fn check_slot(&self, slot: &Slot) -> Result<(), Problem> {
        match slot {
            Slot::Parameter(name) => self.check(name),
            _ => Ok(()),
        }
    }

    fn check_condition(&self, text: &str, scope: &Scope<'_>) -> Result<(), Problem> {
        let condition = Condition::parse(text, scope)?;
        condition.slots.iter().try_for_each(|slot| self.check_slot(slot))
    }

    fn check_set(&self, parameter: &Parameter) -> Result<(), Problem> {
        self.check(&parameter.name).map_err(|problem| problem.within("name"))
    }

    fn check_table(&self, csv: &Csv, scope: &Scope<'_>) -> Result<(), Problem> {
        let columns = columns(csv, scope)?;
        columns.iter().enumerate().try_for_each(|(index, (_, slot))| {
            self.check_slot(slot).map_err(|problem| problem.at(index).within("monitors"))
        })
    }

    fn check_formula(&self, formula: &Formula) -> Result<(), Problem> {
        formula
            .parameters()
            .try_for_each(|(index, name)| self.check(&name).map_err(|it| formula.at(index, it)))
    }

    fn check_line(&self, log: &Log, scope: &Scope<'_>) -> Result<(), Problem> {
        let mut slots = line(log, scope)?.into_iter().filter_map(|(_, slot)| slot);
        slots
            .try_for_each(|slot| self.check_slot(&slot))
            .map_err(|problem| problem.within("message"))
    }
}

/// The problems of the names that a pipeline uses, and of those that it defines twice.
fn check_pipeline(pipeline: &Pipeline, scope: &Scope<'_>) -> (Found, Vec<Problem>) {
    let (mut found, mut all_twice) = (Found::default(), Vec::new());
    let has_faces = pipeline.stages.iter().any(Stage::takes_faces);
    // How many values there are before a stage, and their monitors.
    let mut before = 2;
    let mut known: HashSet<Monitor> = scope.own().iter().take(before).cloned().collect();
    for (index, stage) in pipeline.stages.iter().enumerate() {
        let located = |problem: Problem| problem.within(stage.name()).at(index).within("stages");
        let earlier = |name: &str, key: &str| {
            let slot = scope.find(name).map_err(|it| it.within(key))?;
            if matches!(slot, Slot::Own(own) if own >= before) {
                let message = format!("found `{name}`, which no stage before has measured");
                return Err(Problem::new(message).within(key));
            }
            Ok(())
        };
        match stage {
            Stage::Difference(difference) => {
                found.note(earlier(&difference.of, "of"), located);
                found.note(earlier(&difference.minus, "minus"), located);
            }
            Stage::TimeStatistics(statistics) => {
                let monitor = statistics.monitor.as_ref();
                found.note(monitor.map_or(Ok(()), |name| earlier(name, "monitor")), located);
            }
            Stage::Spectrum(spectrum) => {
                found.note(earlier(&spectrum.monitor, "monitor"), located);
            }
            Stage::Csv(csv) => found.note(columns(csv, scope).map(drop), located),
            Stage::Log(log) => found.note(line(log, scope).map(drop), located),
            _ => {}
        }
        let mut twice = None;
        for monitor in monitors_of(stage, has_faces) {
            before += 1;
            if let Some(known) = known.replace(monitor) {
                twice.get_or_insert(known.name);
            }
        }
        if let Some(name) = twice {
            let message = format!("another stage has a monitor named `{name}`");
            all_twice.push(located(Problem::new(message).within("name")));
        }
    }
    for (index, action) in pipeline.then.iter().enumerate() {
        let checked = match action {
            Action::Csv(csv) => columns(csv, scope).map(drop),
            Action::Log(log) => line(log, scope).map(drop),
            _ => Ok(()),
        };
        found.note(checked, |it| it.within(action.name()).at(index).within("then"));
    }
    if let Some(when) = &pipeline.when {
        let problems = Condition::find(when, scope).err().unwrap_or_default();
        found.extend(problems, |problem| problem.within("when"));
    }
    if let Some(AgainAfter::Condition(text)) = &pipeline.again_after {
        let problems = Condition::find(text, scope).err().unwrap_or_default();
        found.extend(problems, |problem| problem.within("condition").within("again_after"));
    }
    (found, all_twice)
}

/// Whether a stage works on monitors alone, so that it may stand where there is no mesh.
pub(super) fn needs_no_mesh(stage: &Stage, due: Due) -> bool {
    due != Due::OnEnd || matches!(stage, Stage::Difference(_) | Stage::Csv(_) | Stage::Log(_))
}
