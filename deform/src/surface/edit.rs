//! Edits of a shape: the types behind the JSON of a stack of edits.

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize};

use crate::mesh::Vector;

/// One edit of the shape: a handle (the union of some features) is moved, other features are held fixed, and the rest of the
/// surface follows smoothly.
///
/// In JSON an edit is an object with one key, the name of the edit:
///
/// ```
/// use tombolo_deform::surface::{Edit, HarmonicOrder};
///
/// let edit: Edit = serde_json::from_str(
///     r#"{ "scale_direction": { "features": ["throat"], "fixed": ["inlet", "outlet"], "factors": [1, 1, 0.5] } }"#,
/// )?;
/// let Edit::ScaleDirection(scale) = &edit else { panic!() };
/// assert_eq!(scale.harmonic_order, HarmonicOrder::Biharmonic);
/// # Ok::<(), serde_json::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Edit {
    /// Moves the handle as a rigid body.
    Translate(Translate),
    /// Moves every vertex of the handle along its own normal.
    ScaleNormals(ScaleNormals),
    /// Scales the handle along the axes about a centre.
    ScaleDirection(ScaleDirection),
}

/// Moves features as one rigid body.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Translate {
    /// The features that make up the handle: all of them move together.
    #[serde(deserialize_with = "at_least_one")]
    #[schemars(length(min = 1))]
    pub features: Vec<String>,
    /// The features held where they are. A vertex that is also in the handle stays fixed.
    #[serde(default)]
    pub fixed: Vec<String>,
    /// How far the handle moves along x, y and z, in units of the mesh.
    pub by: Vector,
    /// How smoothly the surface between handle and fixed features follows.
    #[serde(default)]
    pub harmonic_order: HarmonicOrder,
}

/// Moves features along their surface normals: outward for a positive distance.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ScaleNormals {
    /// The features that make up the handle.
    #[serde(deserialize_with = "at_least_one")]
    #[schemars(length(min = 1))]
    pub features: Vec<String>,
    /// The features held where they are. A vertex that is also in the handle stays fixed.
    #[serde(default)]
    pub fixed: Vec<String>,
    /// How far each vertex of the handle moves along its normal, in units of the mesh; negative moves inward. The normal of a
    /// vertex is the area-weighted mean of the normals of the handle's own faces around it.
    pub distance: f64,
    /// How smoothly the surface between handle and fixed features follows.
    #[serde(default)]
    pub harmonic_order: HarmonicOrder,
}

/// Scales features along the axes about a centre.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ScaleDirection {
    /// The features that make up the handle: they are scaled as one body.
    #[serde(deserialize_with = "at_least_one")]
    #[schemars(length(min = 1))]
    pub features: Vec<String>,
    /// The features held where they are. A vertex that is also in the handle stays fixed.
    #[serde(default)]
    pub fixed: Vec<String>,
    /// The factors along x, y and z; 1 leaves an axis as it is.
    pub factors: Vector,
    /// The point that stays in place. Left out or null, it is the centre of the handle's bounding box in the shape that the
    /// edits before this one have reached.
    #[serde(default)]
    pub center: Option<Vector>,
    /// How smoothly the surface between handle and fixed features follows.
    #[serde(default)]
    pub harmonic_order: HarmonicOrder,
}

/// The order k of the polyharmonic equation that the displacement of the free surface solves, 1 to 3; a number in JSON.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default, Serialize, Deserialize)]
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
            "description": "The order of the polyharmonic equation that the free surface solves: 1 is a membrane with kinks at the handles, 2 has a continuous slope, 3 a continuous curvature too."
        })
    }
}

impl Edit {
    /// The name of the edit, as JSON has it.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Edit::Translate(_) => "translate",
            Edit::ScaleNormals(_) => "scale_normals",
            Edit::ScaleDirection(_) => "scale_direction",
        }
    }

    /// The features that make up the handle.
    #[must_use]
    pub fn features(&self) -> &[String] {
        match self {
            Edit::Translate(edit) => &edit.features,
            Edit::ScaleNormals(edit) => &edit.features,
            Edit::ScaleDirection(edit) => &edit.features,
        }
    }

    /// The features held fixed.
    #[must_use]
    pub fn fixed(&self) -> &[String] {
        match self {
            Edit::Translate(edit) => &edit.fixed,
            Edit::ScaleNormals(edit) => &edit.fixed,
            Edit::ScaleDirection(edit) => &edit.fixed,
        }
    }

    /// The order of the polyharmonic equation.
    #[must_use]
    pub fn harmonic_order(&self) -> HarmonicOrder {
        match self {
            Edit::Translate(edit) => edit.harmonic_order,
            Edit::ScaleNormals(edit) => edit.harmonic_order,
            Edit::ScaleDirection(edit) => edit.harmonic_order,
        }
    }

    /// Checks what can be checked without a surface: that there is a handle and that every number is finite.
    ///
    /// # Errors
    /// [`InvalidEdit`], naming the field.
    pub fn validate(&self) -> Result<(), InvalidEdit> {
        if self.features().is_empty() {
            return Err(InvalidEdit::NoFeatures);
        }
        let numbers = |field: &'static str, values: &[f64]| match values.iter().position(|value| !value.is_finite()) {
            Some(index) if values.len() > 1 => {
                Err(InvalidEdit::NotFinite { field: format!("{field}[{index}]"), value: values[index] })
            }
            Some(index) => Err(InvalidEdit::NotFinite { field: field.to_string(), value: values[index] }),
            None => Ok(()),
        };
        match self {
            Edit::Translate(edit) => numbers("by", &edit.by),
            Edit::ScaleNormals(edit) => numbers("distance", &[edit.distance]),
            Edit::ScaleDirection(edit) => {
                numbers("factors", &edit.factors)?;
                edit.center.map_or(Ok(()), |center| numbers("center", &center))
            }
        }
    }
}

/// What is wrong with an edit whatever the surface.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum InvalidEdit {
    /// The list of features is empty.
    #[error("features: the list is empty; at least one feature must be named")]
    NoFeatures,
    /// A number is NaN or infinite.
    #[error("{field}: {value} is not a finite number")]
    NotFinite {
        /// The field, and the place in it.
        field: String,
        /// The number.
        value: f64,
    },
}

fn at_least_one<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<String>, D::Error> {
    let names = Vec::<String>::deserialize(deserializer)?;
    if names.is_empty() {
        return Err(serde::de::Error::invalid_length(0, &"the name of at least one feature"));
    }
    Ok(names)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(json: &str) -> String {
        serde_json::from_str::<Edit>(json).expect_err(json).to_string()
    }

    #[test]
    fn the_json_of_an_edit_reads_and_writes_back() {
        let json = r#"{"translate":{"features":["a","b"],"fixed":["c"],"by":[1.0,-2.5,0.1],"harmonic_order":3}}"#;
        let edit: Edit = serde_json::from_str(json).unwrap();
        assert_eq!(edit.harmonic_order(), HarmonicOrder::Triharmonic);
        assert_eq!(edit.fixed(), ["c"]);
        assert_eq!(serde_json::to_string(&edit).unwrap(), json);

        let short: Edit = serde_json::from_str(r#"{"scale_normals":{"features":["a"],"distance":-1}}"#).unwrap();
        assert_eq!(short.harmonic_order(), HarmonicOrder::Biharmonic);
        assert!(short.fixed().is_empty());
        assert_eq!(serde_json::from_str::<Edit>(&serde_json::to_string(&short).unwrap()).unwrap(), short);
    }

    #[test]
    fn json_that_is_not_an_edit_is_refused_by_name() {
        assert!(error(r#"{"translate":{"features":[],"by":[0,0,0]}}"#).contains("at least one feature"));
        assert!(error(r#"{"translate":{"features":["a"]}}"#).contains("missing field `by`"));
        assert!(error(r#"{"translate":{"features":["a"],"by":[0,0,0],"fix":[]}}"#).contains("unknown field `fix`"));
        assert!(error(r#"{"translate":{"features":["a"],"by":[0,0]}}"#).contains("array of length 3"));
        assert!(error(r#"{"rotate":{}}"#).contains("unknown variant `rotate`"));
        for order in ["0", "4", "-1"] {
            let json = format!(r#"{{"translate":{{"features":["a"],"by":[0,0,0],"harmonic_order":{order}}}}}"#);
            assert!(error(&json).contains(&format!("harmonic order {order} does not exist")));
        }
    }

    #[test]
    fn numbers_that_are_not_finite_are_refused_by_field() {
        let features = vec!["a".to_string()];
        let scale = ScaleDirection {
            features: features.clone(),
            fixed: vec![],
            factors: [1.0, f64::NAN, 1.0],
            center: None,
            harmonic_order: HarmonicOrder::default(),
        };
        let message = |edit: Edit| edit.validate().unwrap_err().to_string();
        assert_eq!(message(Edit::ScaleDirection(scale.clone())), "factors[1]: NaN is not a finite number");
        let scale = ScaleDirection { factors: [1.0; 3], center: Some([0.0, 0.0, f64::INFINITY]), ..scale };
        assert_eq!(message(Edit::ScaleDirection(scale)), "center[2]: inf is not a finite number");
        let normals =
            ScaleNormals { features, fixed: vec![], distance: f64::NEG_INFINITY, harmonic_order: Default::default() };
        assert_eq!(message(Edit::ScaleNormals(normals.clone())), "distance: -inf is not a finite number");
        assert!(message(Edit::ScaleNormals(ScaleNormals { features: vec![], ..normals })).contains("at least one"));
    }

    #[test]
    fn the_schema_shows_defaults_and_bounds() {
        let schema = serde_json::to_value(schemars::schema_for!(Edit)).unwrap();
        let fields = &schema["$defs"]["ScaleDirection"]["properties"];
        assert_eq!(fields["harmonic_order"]["default"], 2);
        assert_eq!(fields["features"]["minItems"], 1);
        assert_eq!(fields["factors"]["maxItems"], 3);
        assert_eq!(schema["$defs"]["HarmonicOrder"]["maximum"], 3);
        assert_eq!(schema["$defs"]["Translate"]["additionalProperties"], false);
        for (name, field) in fields.as_object().unwrap() {
            assert!(field["description"].is_string(), "{name} has no description");
        }
    }
}
