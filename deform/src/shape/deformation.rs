//! How the volume follows, as it is said in JSON.

use std::borrow::Cow;

use crate::volume::{Deform, Method};
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Deserialize, Serialize};

/// How the motion of the surface is carried into the volume: the equation, and the features whose
/// vertices are not taken along as they are.
///
/// Of the other features every vertex gets the displacement that the edits make.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(from = "Fields", into = "Fields")]
pub struct Deformation {
    /// The equation, and how it is solved.
    pub equation: Deform,
    /// Features whose vertices slide along their surface.
    pub sliding: Vec<String>,
    /// Features whose vertices follow the volume.
    pub free: Vec<String>,
    /// Whether only the boundary is moved, and the volume is left to the solver: then no equation
    /// is solved.
    pub surface_only: bool,
}

impl From<Deform> for Deformation {
    /// Every feature gets the displacement that the edits make.
    fn from(equation: Deform) -> Self {
        Self { equation, ..Self::default() }
    }
}

impl Deformation {
    /// Whether any feature slides or is free.
    #[must_use]
    pub fn lets_go(&self) -> bool {
        !(self.sliding.is_empty() && self.free.is_empty())
    }
}

/// How the motion of the surface is carried into the volume.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(rename = "Deform")]
struct Fields {
    /// The equation that is solved for the displacement, or that there is none.
    #[schemars(extend("x-label" = "the volume follows"))]
    method: Following,
    /// How much stiffer small cells are than large ones: the stiffness of a cell is (mean volume /
    /// volume) to this power. 0 is a uniform material; 1 keeps thin boundary layers more nearly
    /// rigid and bends the cells about them the more. 0 to 4.
    #[schemars(range(min = 0.0, max = 4.0), extend("x-label" = "stiffer small cells"))]
    stiffening: f64,
    /// Poisson's ratio of the elastic material: how far it resists a change of volume. Above -1 and
    /// below 0.5; for `elasticity` only.
    #[schemars(extend("exclusiveMinimum" = -1.0, "exclusiveMaximum" = 0.5, "x-label" = "Poisson's ratio", "x-advanced" = true))]
    poisson_ratio: f64,
    /// The relative residual at which the iterative solve stops. Above 0, at most 0.1.
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 0.1, "x-advanced" = true))]
    tolerance: f64,
    /// How often the vertices inside are gone through after the solve, at most: each moves to
    /// where its worst cells are more like those of the reference. Vertices whose cells have all
    /// kept 95 % of their scaled Jacobian stay, and all do where moving them would gain nothing. 0
    /// leaves the shape as it was solved for. 0 to 100.
    #[schemars(range(min = 0, max = 100), extend("x-label" = "improving sweeps", "x-advanced" = true))]
    improve: u32,
    /// Features whose vertices slide along their surface as it lies in the reference mesh: of the
    /// displacement that the edits make only the part across it is prescribed, and along it the
    /// vertices go where the volume takes them. Where such a feature meets one that is in neither
    /// list, its rim gets the whole displacement; where two of them meet, vertices slide along
    /// their edge. Exact on flat features; on curved ones a vertex leaves the surface by about the
    /// square of how far it slides over twice the radius.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    #[schemars(extend("x-label" = "features that slide"))]
    sliding: Vec<String>,
    /// Features whose vertices follow the volume without force, whatever the edits make of them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    #[schemars(extend("x-label" = "features that are free"))]
    free: Vec<String>,
}

/// How the volume follows its surface.
#[derive(Clone, Copy, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(rename = "Method")]
enum Following {
    /// Linear elasticity: the three components of the displacement are one coupled problem. The
    /// better choice for thin cells at walls.
    Elasticity,
    /// Laplace's equation for each component by itself; a component that moves nowhere costs
    /// nothing. The cheaper choice for motion along one axis.
    Harmonic,
    /// Not at all: the vertices of the boundary move, and the solver moves its volume by itself.
    /// Nothing is solved, no other setting here counts, and the guard judges the surface alone.
    Surface,
}

impl Default for Fields {
    fn default() -> Self {
        Deformation::default().into()
    }
}

impl From<Fields> for Deformation {
    fn from(fields: Fields) -> Self {
        let Fields { method, stiffening, poisson_ratio, tolerance, improve, sliding, free } =
            fields;
        let (method, surface_only) = match method {
            Following::Elasticity => (Method::Elasticity, false),
            Following::Harmonic => (Method::Harmonic, false),
            Following::Surface => (Method::Elasticity, true),
        };
        let equation = Deform { method, stiffening, poisson_ratio, tolerance, improve };
        Self { equation, sliding, free, surface_only }
    }
}

impl From<Deformation> for Fields {
    fn from(stage: Deformation) -> Self {
        let Deform { method, stiffening, poisson_ratio, tolerance, improve } = stage.equation;
        let method = match method {
            _ if stage.surface_only => Following::Surface,
            Method::Elasticity => Following::Elasticity,
            Method::Harmonic => Following::Harmonic,
        };
        Self {
            method,
            stiffening,
            poisson_ratio,
            tolerance,
            improve,
            sliding: stage.sliding,
            free: stage.free,
        }
    }
}

impl JsonSchema for Deformation {
    fn schema_name() -> Cow<'static, str> {
        Fields::schema_name()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        Fields::json_schema(generator)
    }
}
