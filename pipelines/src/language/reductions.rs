//! The stages that reduce an extract or the mesh to monitors, and the rules that they keep to.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Problem;
use super::derived::check_name;

/// Integrals over the extract, or over the whole mesh where no stage has taken one.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Integrate {
    /// The name that its monitors begin with.
    pub name: String,
    /// After `surface`: the features to integrate over; left out, the whole surface.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub features: Vec<String>,
    /// A scalar field: monitors `<name>.integral` and `<name>.mean`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub field: Option<String>,
    /// A vector field: monitors `<name>.integral.x`, `.y`, `.z` and `<name>.mean.x`, `.y`, `.z`;
    /// after `surface`, `slice` or `contour` also `<name>.flow_rate`, the flux through the faces.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vector: Option<String>,
}

impl Integrate {
    /// The monitors, in the order in which the runner gives their values; `has_faces` says whether
    /// the extract is one of faces, through which a vector field has a flux.
    pub(crate) fn monitors(&self, has_faces: bool) -> Vec<String> {
        let mut names = vec!["size"];
        if self.field.is_some() {
            names.extend(["integral", "mean"]);
        }
        if self.vector.is_some() {
            names.extend(["integral.x", "integral.y", "integral.z", "mean.x", "mean.y", "mean.z"]);
            names.extend(has_faces.then_some("flow_rate"));
        }
        names.into_iter().map(|monitor| format!("{}.{monitor}", self.name)).collect()
    }

    pub(super) fn check(&self, is_after_surface: bool) -> Result<(), Problem> {
        check_name(&self.name).map_err(|problem| problem.within("name"))?;
        if !self.features.is_empty() && !is_after_surface {
            let message = "found features, which are those of a `surface` stage before it";
            return Err(Problem::new(message).within("features"));
        }
        for (index, name) in self.features.iter().enumerate() {
            if self.features[..index].contains(name) {
                let problem = Problem::new("found the same feature twice");
                return Err(problem.at(index).within("features"));
            }
        }
        Ok(())
    }
}
