//! What is known of a pipeline before its first run.

use std::collections::HashSet;
use std::sync::Arc;

use tombolo_deform::communicator::{Garbled, Reader, Writer};

use super::super::cost::{Cost, Thinning};
use super::super::dormancy::Dormancy;
use super::super::due::Clock;
use super::super::output::Table;
use super::super::trigger::Trigger;
use super::Prepared;
use crate::derive::Running;
use crate::extract::Kept;
use crate::language::{
    Action, Csv, Derived, Line, Monitor, Monitored, Problem, Scope, Slot, Stage, Viscosity,
    columns, line, monitors,
};
use crate::reduce::{OverTime, Samples};

/// The names that a stage uses, looked up.
#[derive(Debug)]
pub(super) enum Names {
    None,
    One(Slot),
    Difference(Slot, Slot),
    Table(Arc<Table>, Vec<Slot>),
    Line(Line),
}

/// The state that a stage keeps from run to run.
#[derive(Debug)]
pub(super) enum State {
    None,
    OverTime(OverTime),
    Samples(Samples),
    Running(Running),
}

impl State {
    /// Bytes of memory.
    pub(super) fn bytes(&self) -> usize {
        match self {
            State::None => 0,
            State::OverTime(over_time) => over_time.bytes(),
            State::Samples(samples) => samples.bytes(),
            State::Running(running) => running.bytes(),
        }
    }
}

/// The name of the field of a velocity's gradient that a stage derives for itself.
pub(super) fn gradient_of(velocity: &str) -> String {
    format!("gradient of {velocity}")
}

impl Prepared {
    /// Prepares the pipeline at an index of a valid configuration.
    pub(crate) fn new(all: &Monitored<'_>, index: usize) -> Result<Self, Problem> {
        let pipeline = &all.pipelines[index];
        let scope = all.scope(index);
        let mut selected: Option<HashSet<String>> = None;
        for stage in &pipeline.stages {
            if let Stage::Select(select) = stage {
                let fields: HashSet<String> = select.fields.iter().cloned().collect();
                selected = Some(match selected {
                    Some(before) => before.intersection(&fields).cloned().collect(),
                    None => fields,
                });
            }
        }
        let (stages, hidden) = with_gradients(&pipeline.stages);
        let names = stages.iter().map(|stage| names_of(stage, &scope));
        let of_actions = pipeline.then.iter().map(|action| match action {
            Action::Csv(csv) => table(csv, &scope),
            Action::Log(log) => line(log, &scope).map(Names::Line),
            _ => Ok(Names::None),
        });
        let coloured = pipeline.then.iter().filter_map(|action| match action {
            Action::Render(render) => render.field.as_deref(),
            _ => None,
        });
        let used = stages.iter().flat_map(used_fields).chain(coloured).map(str::to_owned);
        Ok(Self {
            index,
            used: used.chain(hidden.iter().cloned()).collect(),
            hidden,
            due: Clock::new(pipeline.due),
            dormancy: Dormancy::of(pipeline),
            thinning: Thinning::new(pipeline.budget),
            cost: Cost::default(),
            is_chosen: true,
            name: pipeline.name.as_str().into(),
            selected,
            trigger: Trigger::new(pipeline, &scope)?,
            names: names.collect::<Result<_, _>>()?,
            names_of_actions: of_actions.collect::<Result<_, _>>()?,
            states: stages.iter().map(state_of).collect(),
            stages,
            monitors: monitors(pipeline).split_off(2),
            reported: HashSet::new(),
            kept: Kept::default(),
            decimation: None,
            pipeline: pipeline.clone(),
        })
    }

    /// Takes over what the same pipeline has come to, whose place among the others may have changed.
    pub(crate) fn go_on_from(&mut self, before: Self) {
        self.due = before.due;
        self.dormancy = before.dormancy;
        self.thinning = before.thinning;
        self.cost = before.cost;
        self.is_chosen = before.is_chosen;
        self.trigger.go_on_from(&before.trigger);
        self.states = before.states;
        self.reported = before.reported;
        self.kept = before.kept;
        self.decimation = before.decimation;
    }

    /// Writes down what it has come to; what it has cost is not among that.
    pub(crate) fn save(&self, writer: &mut Writer) {
        self.due.save(writer);
        self.trigger.save(writer);
        for state in &self.states {
            match state {
                State::None => {}
                State::OverTime(over_time) => over_time.save(writer),
                State::Samples(samples) => samples.save(writer),
                State::Running(running) => running.save(writer),
            }
        }
    }

    /// Goes on from what the same pipeline has written down.
    pub(crate) fn restore(&mut self, reader: &mut Reader<'_>) -> Result<(), Garbled> {
        self.due.restore(reader)?;
        self.trigger.restore(reader)?;
        self.states.iter_mut().try_for_each(|state| match state {
            State::None => Ok(()),
            State::OverTime(over_time) => over_time.restore(reader),
            State::Samples(samples) => samples.restore(reader),
            State::Running(running) => running.restore(reader),
        })
    }

    /// The tables that it writes.
    pub(crate) fn tables(&self) -> impl Iterator<Item = &Table> {
        self.names.iter().chain(&self.names_of_actions).filter_map(|names| match names {
            Names::Table(table, _) => Some(&**table),
            _ => None,
        })
    }

    pub(crate) fn streams(&self) -> bool {
        self.pipeline.streams()
    }
}

/// The stages, with those in front of the source stage that derive the gradients of velocities that
/// later ones need, and the names of these fields.
fn with_gradients(stages: &[Stage]) -> (Vec<Stage>, HashSet<String>) {
    let (mut gradients, mut hidden) = (Vec::new(), HashSet::new());
    for stage in stages {
        let velocity = match stage {
            Stage::Force(force) => force.velocity.as_ref(),
            Stage::WallShearStress(stress) => Some(&stress.velocity),
            _ => None,
        };
        let Some(velocity) = velocity else { continue };
        let name = gradient_of(velocity);
        if hidden.insert(name.clone()) {
            gradients.push(Stage::Gradient(Derived { field: velocity.clone(), name: Some(name) }));
        }
    }
    let source = stages.iter().position(Stage::is_source).unwrap_or(stages.len());
    let (before, after) = stages.split_at(source);
    let all = before.iter().cloned().chain(gradients).chain(after.iter().cloned()).collect();
    (all, hidden)
}

/// The fields that a stage reduces or colours by, which the extract must have whatever is selected.
fn used_fields(stage: &Stage) -> Vec<&str> {
    match stage {
        Stage::Integrate(it) => {
            it.field.as_deref().into_iter().chain(it.vector.as_deref()).collect()
        }
        Stage::Histogram(it) => vec![&it.field],
        Stage::Render(it) => it.field.as_deref().into_iter().collect(),
        Stage::Force(it) => {
            let viscosity = it.viscosity.as_ref().and_then(Viscosity::field);
            it.pressure.as_deref().into_iter().chain(viscosity).collect()
        }
        _ => Vec::new(),
    }
}

fn names_of(stage: &Stage, scope: &Scope<'_>) -> Result<Names, Problem> {
    Ok(match stage {
        Stage::Difference(stage) => {
            Names::Difference(scope.find(&stage.of)?, scope.find(&stage.minus)?)
        }
        Stage::TimeStatistics(stage) => match &stage.monitor {
            Some(monitor) => Names::One(scope.find(monitor)?),
            None => Names::None,
        },
        Stage::Spectrum(stage) => Names::One(scope.find(&stage.monitor)?),
        Stage::Csv(csv) => table(csv, scope)?,
        Stage::Log(log) => Names::Line(line(log, scope)?),
        _ => Names::None,
    })
}

fn table(csv: &Csv, scope: &Scope<'_>) -> Result<Names, Problem> {
    let (monitors, slots): (Vec<Monitor>, Vec<Slot>) = columns(csv, scope)?.into_iter().unzip();
    let titles = monitors.iter().map(Monitor::titled).collect();
    let table = Table { file: csv.file.clone(), titles, existing: csv.existing };
    Ok(Names::Table(Arc::new(table), slots))
}

fn state_of(stage: &Stage) -> State {
    match stage {
        Stage::TimeStatistics(stage) if stage.field.is_some() => State::Running(Running::default()),
        Stage::TimeStatistics(stage) => {
            State::OverTime(OverTime::new(stage.window.map(|window| window.get())))
        }
        Stage::Spectrum(stage) => State::Samples(Samples::new(stage.samples as usize)),
        _ => State::None,
    }
}
