//! The stages that derive a field from others, and the rules that they keep to.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Problem;
use crate::expression::Expression;
use crate::limits::NAME;

/// A field that is derived from another one.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Derived {
    /// The field it is derived from.
    pub field: String,
    /// The name of the new field; left out, that of the stage.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
}

/// A field that formulas give. They may name scalar fields, components of others (`velocity.x`,
/// `stress.0`), the coordinates `x`, `y` and `z` (of a cell those of its centre, the mean of its
/// vertices), `time`, `cycle` and the parameters of the solver (`parameter.inflow`) as they are at
/// the step. The fields must all be of vertices or all of elements; without any, the new field is of
/// vertices.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "FormulaKeys", into = "FormulaKeys")]
pub struct Formula {
    /// The name of the new field.
    pub name: String,
    /// One formula for each component.
    pub components: Vec<String>,
}

/// Formulas as they stand in JSON.
#[derive(Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct FormulaKeys {
    /// The name of the new field.
    name: String,
    /// The formula of a scalar. Either this or `components` is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    formula: Option<String>,
    /// The formulas of a vector's or tensor's components, up to 9.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    components: Option<Vec<String>>,
}

impl TryFrom<FormulaKeys> for Formula {
    type Error = String;

    fn try_from(keys: FormulaKeys) -> Result<Self, String> {
        match (keys.formula, keys.components) {
            (Some(formula), None) => Ok(Self { name: keys.name, components: vec![formula] }),
            (None, Some(components)) => Ok(Self { name: keys.name, components }),
            (None, None) => Err("found no formula, expected `formula` or `components`".into()),
            _ => Err("found both `formula` and `components`, expected one of them".into()),
        }
    }
}

impl From<Formula> for FormulaKeys {
    fn from(Formula { name, mut components }: Formula) -> Self {
        if components.len() == 1 {
            return Self { name, formula: components.pop(), components: None };
        }
        Self { name, formula: None, components: Some(components) }
    }
}

/// The names that formulas give to what is no field.
pub(crate) const GIVEN: [&str; 5] = ["x", "y", "z", "time", "cycle"];

/// The prefix of a parameter's name in formulas and conditions.
pub(crate) const PARAMETER: &str = "parameter.";

/// Checks of a new field's name what can be checked without a mesh.
pub(super) fn check_name(name: &str) -> Result<(), Problem> {
    let is_visible = !name.trim().is_empty() && !name.chars().any(char::is_control);
    if !is_visible || NAME.check(name.chars().count()).is_err() {
        let message = format!("expected a name of 1 to {} visible characters", NAME.most);
        return Err(Problem::new(message));
    }
    if GIVEN.contains(&name) || name == "quality" || name.starts_with(PARAMETER) {
        return Err(Problem::new(format!("found `{name}`, which has a meaning of its own")));
    }
    Ok(())
}

impl Formula {
    pub(super) fn check(&self) -> Result<(), Problem> {
        let count = self.components.len();
        if count == 0 || count > 9 {
            let message = format!("found {count} formulas, expected 1 to 9");
            return Err(Problem::new(message).within("components"));
        }
        for (index, text) in self.components.iter().enumerate() {
            Expression::parse_open(text).map_err(|error| {
                let message = format!("column {} of the formula: {}", error.column, error.message);
                self.at(index, Problem::new(message).suggest(error.suggestion.as_deref()))
            })?;
        }
        Ok(())
    }

    /// Puts a problem at the formula of a component.
    pub(super) fn at(&self, component: usize, problem: Problem) -> Problem {
        match self.components.len() {
            1 => problem.within("formula"),
            _ => problem.at(component).within("components"),
        }
    }

    /// The parameters that the formulas name, each with the component whose formula does.
    pub(crate) fn parameters(&self) -> impl Iterator<Item = (usize, String)> + '_ {
        self.components.iter().enumerate().flat_map(|(component, text)| {
            let names =
                Expression::parse_open(text).map_or_else(|_| Vec::new(), |(_, names)| names);
            let parameter = move |name: String| {
                name.strip_prefix(PARAMETER).map(|name| (component, name.to_owned()))
            };
            names.into_iter().filter_map(parameter)
        })
    }
}
