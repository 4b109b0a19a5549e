//! Numbers of the solver that can be steered.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A new value of a parameter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Parameter {
    /// The parameter's name.
    pub name: String,
    /// Its new value.
    pub value: f64,
}
