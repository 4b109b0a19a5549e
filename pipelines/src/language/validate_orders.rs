//! The rules that edits, orders and other commands must keep to.

use std::collections::HashSet;

use tombolo_deform::edit::Edit;
use tombolo_deform::number::Number;
use tombolo_deform::quality::Guard;
use tombolo_deform::schedule::Schedule;
use tombolo_deform::shape::check_stack;

use super::error::{finite, none_twice};
use super::order::{Change, Command, Order, Question};
use super::parse::Validate;
use super::pipeline::At;
use super::timed::TimedCommand;
use super::unread::Found;
use super::{Deformation, Problem};

pub(super) fn check_edit(edit: &Edit) -> Result<(), Problem> {
    edit.validate().map_err(|error| {
        let (field, message) = (error.field(), error.to_string());
        let message = message
            .strip_prefix(&field)
            .and_then(|rest| rest.strip_prefix(": "))
            .unwrap_or(&message);
        Problem::new(message).within_path(&field)
    })
}

pub(super) fn check_guard(guard: &Guard) -> Result<(), Problem> {
    if (0.0..=1.0).contains(&guard.min_scaled_jacobian) {
        return Ok(());
    }
    let message =
        format!("found {}, expected a number from 0 to 1", Number(guard.min_scaled_jacobian));
    Err(Problem::new(message).within("min_scaled_jacobian"))
}

pub(super) fn check_schedule(schedule: &Schedule) -> Result<(), Problem> {
    schedule.check().map_err(|exceeded| Problem::from(exceeded).within("steps"))
}

pub(super) fn check_settings(
    deform: Option<&Deformation>,
    guard: Option<&Guard>,
    schedule: Option<&Schedule>,
) -> Found {
    let mut found = Found::default();
    found.note(deform.map_or(Ok(()), check_deformation), |problem| problem.within("deform"));
    found.note(guard.map_or(Ok(()), check_guard), |problem| problem.within("guard"));
    found.note(schedule.map_or(Ok(()), check_schedule), |problem| problem.within("schedule"));
    found
}

/// Checks what all edits come to, and each of them.
fn check_edits(edits: &[Edit]) -> Found {
    let mut found = Found::default();
    found.note(check_stack(edits).map_err(Problem::from), |problem| problem);
    for (index, edit) in edits.iter().enumerate() {
        found.note(check_edit(edit), |problem| problem.within(edit.name()).at(index));
    }
    found
}

/// Checks of a deformation what can be checked without a mesh.
pub(super) fn check_deformation(stage: &Deformation) -> Result<(), Problem> {
    stage.equation.validate().map_err(|error| Problem::new(error.to_string()))?;
    for (key, names) in [("sliding", &stage.sliding), ("free", &stage.free)] {
        none_twice(names, "feature").map_err(|problem| problem.within(key))?;
    }
    if stage.surface_only && stage.lets_go() {
        let key = if stage.free.is_empty() { "sliding" } else { "free" };
        let message = "found features although `method` is `surface`: no volume is moved that they could follow";
        return Err(Problem::new(message).within(key));
    }
    let sliding: HashSet<&String> = stage.sliding.iter().collect();
    match stage.free.iter().position(|name| sliding.contains(name)) {
        Some(index) => {
            let message = format!("found `{}`, which is among `sliding` too", stage.free[index]);
            Err(Problem::new(message).at(index).within("free"))
        }
        None => Ok(()),
    }
}

impl Validate for Vec<Edit> {
    fn validate(&self) -> Result<(), Problem> {
        check_edits(self).first()
    }

    fn problems(&self) -> Vec<Problem> {
        check_edits(self).into_problems()
    }
}

impl Order {
    fn found(&self) -> Found {
        let mut found = Found::default();
        let (key, edits) = match &self.change {
            Change::Edits(edits) => ("edits", edits.as_slice()),
            Change::Stack(edits) => ("stack", edits.as_slice()),
            Change::Undo(_) => ("undo", &[][..]),
        };
        if key == "edits" && edits.is_empty() {
            found.push(Problem::new("expected at least one edit").within("edits"));
        }
        found.extend(check_edits(edits).into_problems(), |problem| problem.within(key));
        let settings =
            check_settings(self.deform.as_ref(), self.guard.as_ref(), self.schedule.as_ref());
        found.extend(settings.into_problems(), |problem| problem);
        found
    }
}

impl Validate for Order {
    fn validate(&self) -> Result<(), Problem> {
        self.found().first()
    }

    fn problems(&self) -> Vec<Problem> {
        self.found().into_problems()
    }
}

impl Validate for Command {
    fn validate(&self) -> Result<(), Problem> {
        match self {
            Command::Order(order) => order.validate().map_err(|problem| problem.within("order")),
            Command::Parameter(parameter) => finite(parameter.value)
                .map_err(|problem| problem.within("value").within("parameter")),
            Command::Pipelines(change) => {
                change.validate().map_err(|problem| problem.within("pipelines"))
            }
            Command::Pause {} | Command::Resume {} | Command::Stop {} | Command::Cancel(_) => {
                Ok(())
            }
        }
    }

    fn problems(&self) -> Vec<Problem> {
        match self {
            Command::Order(order) => {
                order.problems().into_iter().map(|problem| problem.within("order")).collect()
            }
            _ => self.validate().err().into_iter().collect(),
        }
    }
}

impl Validate for Question {
    fn validate(&self) -> Result<(), Problem> {
        match self {
            Question::Forecast(order) => {
                order.validate().map_err(|problem| problem.within("forecast"))
            }
            Question::WithdrawForecast {} => Ok(()),
        }
    }
}

impl TimedCommand {
    fn check_time(&self) -> Result<(), Problem> {
        match self.at {
            Some(At::Time(time)) => {
                finite(time).map_err(|problem| problem.within("time").within("at"))
            }
            _ => Ok(()),
        }
    }
}

impl Validate for TimedCommand {
    fn validate(&self) -> Result<(), Problem> {
        self.check_time().and_then(|()| self.command.validate())
    }

    fn problems(&self) -> Vec<Problem> {
        self.check_time().err().into_iter().chain(self.command.problems()).collect()
    }
}
