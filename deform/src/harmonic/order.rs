//! The order of a polyharmonic equation.

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

/// The order k of the polyharmonic equation that the displacement of the free surface solves, 1 to
/// 3; a number in JSON.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default, Serialize, Deserialize,
)]
#[serde(try_from = "i64", into = "i64")]
pub enum HarmonicOrder {
    /// k = 1: like a stretched membrane, with a kink where it meets a handle.
    Harmonic = 1,
    /// k = 2: like a bent plate, with a continuous slope where it meets a handle.
    #[default]
    Biharmonic = 2,
    /// k = 3: with a continuous slope and curvature where it meets a handle.
    Triharmonic = 3,
}

impl TryFrom<i64> for HarmonicOrder {
    type Error = String;

    fn try_from(order: i64) -> Result<Self, String> {
        match order {
            1 => Ok(Self::Harmonic),
            2 => Ok(Self::Biharmonic),
            3 => Ok(Self::Triharmonic),
            other => Err(format!(
                "harmonic order {other} does not exist: expected 1 (harmonic), 2 (biharmonic) or 3 (triharmonic)"
            )),
        }
    }
}

impl From<HarmonicOrder> for i64 {
    fn from(order: HarmonicOrder) -> i64 {
        order as i64
    }
}

impl std::fmt::Display for HarmonicOrder {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}", *self as i64)
    }
}

impl JsonSchema for HarmonicOrder {
    fn schema_name() -> Cow<'static, str> {
        "HarmonicOrder".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "type": "integer",
            "minimum": 1,
            "maximum": 3,
            "x-titles": ["1, kinks at the handle", "2, a continuous slope", "3, a continuous curvature"],
            "description": "The order of the polyharmonic equation that the free surface solves: 1 is a membrane with kinks at the handles, 2 has a continuous slope, 3 a continuous curvature too."
        })
    }
}
