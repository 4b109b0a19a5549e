//! Numbers of the solver that can be steered.

use serde::{Deserialize, Serialize};
use tombolo_deform::number::Number;
use tombolo_pipelines::language::nearest;

/// A scalar that the solver lets itself be steered by.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    /// Its name.
    pub name: String,
    /// Its value now.
    pub value: f64,
    /// The least value it may take.
    pub minimum: f64,
    /// The greatest.
    pub maximum: f64,
}

/// Why a declaration or a change of a parameter was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ParameterError {
    /// There is none of that name.
    #[error("there is no parameter '{name}'{}; the solver has {}", near_text(near.as_deref()), known_text(known))]
    Unknown {
        /// The name.
        name: String,
        /// The name that was likely meant.
        near: Option<String>,
        /// All names.
        known: Vec<String>,
    },
    /// Bounds that are no numbers, or leave nothing between them.
    #[error("parameter '{name}' has the bounds {} and {}; expected two finite numbers, the least first",
        Number(*minimum), Number(*maximum)
    )]
    Bounds {
        /// The name.
        name: String,
        /// The least that was given.
        minimum: f64,
        /// The greatest.
        maximum: f64,
    },
    /// A value out of its bounds, or none at all.
    #[error("parameter '{name}' cannot be {}; it must be a number from {} to {}",
        Number(*value), Number(*minimum), Number(*maximum)
    )]
    Value {
        /// The name.
        name: String,
        /// The value.
        value: f64,
        /// The least it may be.
        minimum: f64,
        /// The greatest.
        maximum: f64,
    },
    /// Two parameters of one name.
    #[error("parameter '{name}' is declared twice")]
    Twice {
        /// The name.
        name: String,
    },
}

fn near_text(near: Option<&str>) -> String {
    near.map_or_else(String::new, |name| format!(" (did you mean '{name}'?)"))
}

fn known_text(known: &[String]) -> String {
    if known.is_empty() { "none".into() } else { known.join(", ") }
}

/// The parameters of a run and which of them changed since the solver last looked.
#[derive(Debug, Default)]
pub(crate) struct Parameters {
    all: Vec<Parameter>,
    changed: Vec<(String, f64)>,
    read: bool,
}

impl Parameters {
    pub(crate) fn new(all: Vec<Parameter>) -> Result<Self, ParameterError> {
        for (index, parameter) in all.iter().enumerate() {
            let Parameter { ref name, value, minimum, maximum } = *parameter;
            // JSON, by which viewers are told, has no infinity.
            if !(minimum.is_finite() && maximum.is_finite() && minimum <= maximum) {
                return Err(ParameterError::Bounds { name: name.clone(), minimum, maximum });
            }
            check(parameter, value)?;
            if all[..index].iter().any(|other| other.name == parameter.name) {
                return Err(ParameterError::Twice { name: parameter.name.clone() });
            }
        }
        Ok(Self { all, changed: Vec::new(), read: true })
    }

    pub(crate) fn all(&self) -> &[Parameter] {
        &self.all
    }

    pub(crate) fn set(&mut self, name: &str, value: f64) -> Result<(), ParameterError> {
        let Some(parameter) = self.all.iter_mut().find(|parameter| parameter.name == name) else {
            let known: Vec<String> =
                self.all.iter().map(|parameter| parameter.name.clone()).collect();
            let near = nearest(name, known.iter().map(String::as_str)).map(str::to_owned);
            return Err(ParameterError::Unknown { name: name.into(), near, known });
        };
        check(parameter, value)?;
        parameter.value = value;
        self.forget_read();
        self.changed.retain(|(other, _)| other != name);
        self.changed.push((name.into(), value));
        Ok(())
    }

    /// Goes on with a value that an earlier run has come to; the solver is told of one that is not the
    /// one it declares.
    pub(crate) fn resume(&mut self, name: &str, value: f64) -> Result<(), ParameterError> {
        let is_declared = |it: &Parameter| it.name == name && it.value.to_bits() == value.to_bits();
        if self.all.iter().any(is_declared) { Ok(()) } else { self.set(name, value) }
    }

    /// The changes that the solver is about to read.
    pub(crate) fn take_changed(&mut self) -> &[(String, f64)] {
        self.forget_read();
        self.read = true;
        &self.changed
    }

    fn forget_read(&mut self) {
        if std::mem::take(&mut self.read) {
            self.changed.clear();
        }
    }
}

fn check(parameter: &Parameter, value: f64) -> Result<(), ParameterError> {
    let Parameter { name, minimum, maximum, .. } = parameter;
    if value.is_finite() && *minimum <= value && value <= *maximum {
        return Ok(());
    }
    Err(ParameterError::Value { name: name.clone(), value, minimum: *minimum, maximum: *maximum })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parameters() -> Parameters {
        let parameter =
            |name: &str| Parameter { name: name.into(), value: 1.0, minimum: 0.0, maximum: 2.0 };
        Parameters::new(vec![parameter("inlet_speed"), parameter("viscosity")]).unwrap()
    }

    #[test]
    fn a_change_is_read_once() {
        let mut parameters = parameters();
        assert!(parameters.take_changed().is_empty());
        parameters.set("viscosity", 0.5).unwrap();
        parameters.set("viscosity", 0.25).unwrap();
        assert_eq!(parameters.take_changed(), [("viscosity".to_owned(), 0.25)]);
        assert!(parameters.take_changed().is_empty());
        assert_eq!(parameters.all()[1].value, 0.25);
    }

    #[test]
    fn what_is_no_value_of_a_parameter_is_refused_by_name() {
        let mut parameters = parameters();
        for bad in [f64::NAN, f64::INFINITY, -0.1, 2.1] {
            let message = parameters.set("viscosity", bad).unwrap_err().to_string();
            assert!(
                message.contains("viscosity") && message.contains(&bad.to_string()),
                "{message}"
            );
        }
        let message = parameters.set("viscositi", 1.0).unwrap_err().to_string();
        assert!(
            message.contains("did you mean 'viscosity'?") && message.contains("inlet_speed"),
            "{message}"
        );
        assert!(parameters.take_changed().is_empty());
    }

    #[test]
    fn bounds_that_leave_nothing_between_them_are_refused_by_name() {
        for (minimum, maximum) in
            [(f64::NAN, 2.0), (0.0, f64::INFINITY), (f64::NEG_INFINITY, 2.0), (2.0, 0.0)]
        {
            let bad = Parameter { name: "x".into(), value: 1.0, minimum, maximum };
            let message = Parameters::new(vec![bad]).unwrap_err().to_string();
            assert!(message.contains("'x' has the bounds"), "{message}");
        }
    }
}
