//! The guard of a mesh on its way to a new shape, as it is said in JSON.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The guard: the floor that a mesh keeps to on its way to a new shape, and what is done when it
/// would not.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Guard {
    /// The least scaled Jacobian that any cell may have in any shape of a schedule: 1 is the ideal
    /// cell, 0 a flat one. Between two shapes no cell is turned inside out, but it may come below
    /// this, as where a schedule of few shapes turns the mesh by much. A mesh with worse cells to
    /// begin with may not get worse than it was. From 0 up to 1.
    #[schemars(range(min = 0.0, max = 1.0), extend("x-label" = "least quality"))]
    pub min_scaled_jacobian: f64,
    /// The answer to a change of shape that does not keep to it.
    #[schemars(extend("x-label" = "where it is not kept"))]
    pub otherwise: Otherwise,
    /// The answer to a surface that is broken before the volume comes into it: faces that lose
    /// their area, fold over or intersect, where they did not in the reference.
    #[schemars(extend("x-label" = "a broken surface"))]
    pub surface: SurfaceRule,
}

/// The answer to a change of shape that the guard does not let through.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Otherwise {
    /// It is rejected, with the reason, the worst cells and the largest feasible fraction. The
    /// shape stays as it is.
    #[default]
    Reject,
    /// It is mended: in sub-steps stiffened anew on the way, with an inversion-free solve where
    /// these are not enough. Rejected where that does not succeed. `judge` itself only judges: it
    /// refuses the path either way.
    Untangle,
    /// As much of it is done as keeps to the guard: the largest feasible fraction of the order's
    /// amounts, which is reported. Rejected where that is nothing.
    Clamp,
}

/// The answer to a surface that is broken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum SurfaceRule {
    /// The change of shape is rejected before any volume work, with the faces, the place and the
    /// largest feasible fraction.
    #[default]
    Reject,
    /// The surface is taken as it is, not looked at; the quality of the cells alone decides. For
    /// bodies that are meant to come into contact.
    Allow,
}

impl Default for Guard {
    /// A floor of 0.02; whatever would fall under it is rejected, and so is a broken surface.
    fn default() -> Self {
        Self {
            min_scaled_jacobian: 0.02,
            otherwise: Otherwise::Reject,
            surface: SurfaceRule::Reject,
        }
    }
}
