//! What a part of the boundary is to the flow.

use serde::Serialize;

/// The condition that a solver imposes on a feature of the boundary, in a word: enough for a viewer
/// to hold still what must not move by mistake.
///
/// ```
/// use tombolo::{Condition, Settings};
///
/// let settings = Settings::default()
///     .condition("inlet", Condition::Inflow)
///     .condition("outlet", Condition::Outflow)
///     .condition("pipe", Condition::Wall);
/// assert_eq!(settings.conditions["inlet"], Condition::Inflow);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Condition {
    /// Something flows in: a velocity, a mass flow or a total pressure is prescribed.
    Inflow,
    /// Something may flow out: a static pressure is prescribed, or a convective condition.
    Outflow,
    /// Nothing passes.
    Wall,
}
