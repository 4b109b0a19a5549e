//! Edits of a shape: the types behind the JSON of a stack of edits.

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize};

use super::Region;
use crate::mesh::Vector;

/// One edit of the shape, a layer of the stack: a handle is moved, other parts are held fixed, and the rest of the surface
/// follows smoothly.
///
/// The handle is the vertices of `features` that lie in `region`; with one of the two alone, all vertices of the features or all
/// surface vertices in the region. A vertex that is also in `fixed` or in `fixed_region` stays fixed. A muted edit is checked
/// like any other and does nothing.
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
///
/// let edit: Edit = serde_json::from_str(
///     r#"{ "rotate": { "region": { "sphere": { "center": [0, 0, 1], "radius": 0.2 } }, "axis": [0, 1, 0], "degrees": 15,
///                      "name": "tilt the outlet", "muted": true } }"#,
/// )?;
/// assert!(edit.muted() && edit.features().is_empty());
/// # Ok::<(), serde_json::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Edit {
    /// Moves the handle as a rigid body.
    Translate(Translate),
    /// Turns the handle as a rigid body.
    Rotate(Rotate),
    /// Scales the handle along the axes about a centre.
    ScaleDirection(ScaleDirection),
    /// Moves every vertex of the handle along its own normal.
    ScaleNormals(ScaleNormals),
    /// Moves the handle by a matrix and a translation.
    Affine(Affine),
    /// Adds a displacement made elsewhere, exactly as it is: nothing else follows.
    Displacement(Displacement),
    /// Drags the surface by its skeleton.
    Skeleton(Skeleton),
}

/// Declares the body of an edit: what every edit has, then its own fields. (serde's `flatten` would let unknown keys pass.)
macro_rules! layer {
    ($(#[$attribute:meta])* pub struct $name:ident { $($(#[$field_attribute:meta])* pub $field:ident: $type:ty,)* }) => {
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
        #[serde(deny_unknown_fields)]
        $(#[$attribute])*
        pub struct $name {
            /// The features that make up the handle: all of them move together.
            #[serde(default, deserialize_with = "at_least_one", skip_serializing_if = "Vec::is_empty")]
            #[schemars(length(min = 1))]
            pub features: Vec<String>,
            /// The part of the reference surface that makes up the handle; with `features`, what of them lies in it.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            pub region: Option<Region>,
            /// The features held where they are. A vertex that is also in the handle stays fixed.
            #[serde(default)]
            pub fixed: Vec<String>,
            /// A part of the reference surface that is held where it is, beside the fixed features.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            pub fixed_region: Option<Region>,
            $($(#[$field_attribute])* pub $field: $type,)*
            /// Whether the edit is passed over.
            #[serde(default, skip_serializing_if = "is_false")]
            pub muted: bool,
            /// A name for the layer, in reports and lists.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            pub name: Option<String>,
        }

        impl Layer for $name {
            fn features(&self) -> &[String] {
                &self.features
            }

            fn region(&self) -> Option<&Region> {
                self.region.as_ref()
            }

            fn fixed(&self) -> &[String] {
                &self.fixed
            }

            fn fixed_region(&self) -> Option<&Region> {
                self.fixed_region.as_ref()
            }

            fn muted(&self) -> bool {
                self.muted
            }

            fn layer_name(&self) -> Option<&str> {
                self.name.as_deref()
            }
        }
    };
}

layer! {
    /// Moves the handle as one rigid body.
    ///
    /// ```
    /// use tombolo_deform::surface::{Edit, Translate};
    ///
    /// let edit = Edit::Translate(Translate { features: vec!["outlet".into()], by: [0.0, 0.0, 0.1], ..Translate::default() });
    /// assert_eq!(edit.name(), "translate");
    /// ```
    #[derive(Default)]
    #[schemars(extend("anyOf" = [{"required": ["features"]}, {"required": ["region"]}]))]
    pub struct Translate {
        /// How far the handle moves along x, y and z, in units of the mesh.
        pub by: Vector,
        /// How smoothly the surface between handle and fixed parts follows.
        #[serde(default)]
        pub harmonic_order: HarmonicOrder,
    }
}

layer! {
    /// Turns the handle as one rigid body about an axis.
    #[derive(Default)]
    #[schemars(extend("anyOf" = [{"required": ["features"]}, {"required": ["region"]}]))]
    pub struct Rotate {
        /// The direction of the axis, of any length but 0.
        pub axis: Vector,
        /// The angle in degrees, counter-clockwise seen against the axis (right-hand rule). Multiples of 90 are exact.
        pub degrees: f64,
        /// A point of the axis. Left out or null, it is the centre of the handle's bounding box in the shape that the edits
        /// before this one have reached.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub center: Option<Vector>,
        /// How smoothly the surface between handle and fixed parts follows.
        #[serde(default)]
        pub harmonic_order: HarmonicOrder,
    }
}

layer! {
    /// Scales the handle along the axes about a centre, as one body.
    #[derive(Default)]
    #[schemars(extend("anyOf" = [{"required": ["features"]}, {"required": ["region"]}]))]
    pub struct ScaleDirection {
        /// The factors along x, y and z; 1 leaves an axis as it is.
        pub factors: Vector,
        /// The point that stays in place. Left out or null, it is the centre of the handle's bounding box in the shape that the
        /// edits before this one have reached.
        #[serde(default)]
        pub center: Option<Vector>,
        /// How smoothly the surface between handle and fixed parts follows.
        #[serde(default)]
        pub harmonic_order: HarmonicOrder,
    }
}

layer! {
    /// Moves the handle along its surface normals: outward for a positive distance.
    #[derive(Default)]
    #[schemars(extend("anyOf" = [{"required": ["features"]}, {"required": ["region"]}]))]
    pub struct ScaleNormals {
        /// How far each vertex of the handle moves along its normal, in units of the mesh; negative moves inward. The normal of
        /// a vertex is the area-weighted mean of the normals of the handle's own faces around it.
        pub distance: f64,
        /// How smoothly the surface between handle and fixed parts follows.
        #[serde(default)]
        pub harmonic_order: HarmonicOrder,
    }
}

layer! {
    /// Moves the handle by a matrix about a centre and a translation: `x` goes to `matrix (x - center) + center + translation`.
    #[derive(Default)]
    #[schemars(extend("anyOf" = [{"required": ["features"]}, {"required": ["region"]}]))]
    pub struct Affine {
        /// The rows of the matrix. It may be singular: what is flattened is the guard's business.
        pub matrix: [Vector; 3],
        /// The translation after it, in units of the mesh.
        #[serde(default)]
        pub translation: Vector,
        /// The point that the matrix leaves in place. Left out or null, it is the centre of the handle's bounding box in the
        /// shape that the edits before this one have reached.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub center: Option<Vector>,
        /// How smoothly the surface between handle and fixed parts follows.
        #[serde(default)]
        pub harmonic_order: HarmonicOrder,
    }
}

layer! {
    /// Adds a displacement made elsewhere to what the edits before it have reached.
    ///
    /// What is imported is exact: vertices that are not named do not move, and nothing follows. Without `features` and `region`
    /// every named vertex moves; with them, those in the handle alone.
    pub struct Displacement {
        /// A file that holds the displacement: `.vtp`, `.vtu` or `.vtk` with the point array `displacement`, or plain text. A
        /// relative one lies beside the JSON file that names it. Only files name files: an order that comes over the network
        /// must hold the numbers.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub file: Option<String>,
        /// The vertices that move, by mesh vertex numbers, where no file is given.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        pub vertices: Vec<u32>,
        /// How far each of them moves along x, y and z, in units of the mesh.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        pub values: Vec<Vector>,
        /// A factor for all of them.
        #[serde(default = "one", skip_serializing_if = "is_one")]
        pub scale: f64,
    }
}

layer! {
    /// Drags the surface by its skeleton: each vertex follows the part of the skeleton that carries it.
    ///
    /// Features and region say which vertices follow; without them, all do. What is fixed is held exactly, and the motion fades
    /// out towards it.
    #[derive(Default)]
    pub struct Skeleton {
        /// A place in the reference shape: the node of the reference skeleton nearest to it is dragged.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub at: Option<Vector>,
        /// How far it is dragged along x, y and z, in units of the mesh.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub by: Option<Vector>,
        /// Several drags at once, in place of `at` and `by`.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        pub moves: Vec<SkeletonMove>,
        /// How the surface follows its skeleton.
        #[serde(default)]
        pub skinning: Skinning,
    }
}

/// A drag of one node of the skeleton.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SkeletonMove {
    /// A place in the reference shape: the node of the reference skeleton nearest to it is dragged.
    pub at: Vector,
    /// How far it is dragged along x, y and z, in units of the mesh.
    pub by: Vector,
}

/// How the surface follows its skeleton.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Skinning {
    /// With the rotation of the skeleton too, blended along its arc length: cross-sections keep their shape.
    #[default]
    Smooth,
    /// With the translation of the nearest node alone.
    Nearest,
}

impl Default for Displacement {
    /// Nothing, at a scale of 1.
    fn default() -> Self {
        Self {
            features: Vec::new(),
            region: None,
            fixed: Vec::new(),
            fixed_region: None,
            file: None,
            vertices: Vec::new(),
            values: Vec::new(),
            scale: 1.0,
            muted: false,
            name: None,
        }
    }
}

impl Skeleton {
    /// The drags, however they were given.
    #[must_use]
    pub fn moves(&self) -> Vec<SkeletonMove> {
        let single = self.at.zip(self.by).map(|(at, by)| SkeletonMove { at, by });
        single.into_iter().chain(self.moves.iter().copied()).collect()
    }
}

/// The order k of the polyharmonic equation that the displacement of the free surface solves, 1 to 3; a number in JSON.
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
            "description": "The order of the polyharmonic equation that the free surface solves: 1 is a membrane with kinks at the handles, 2 has a continuous slope, 3 a continuous curvature too."
        })
    }
}

/// What every edit has.
trait Layer {
    fn features(&self) -> &[String];
    fn region(&self) -> Option<&Region>;
    fn fixed(&self) -> &[String];
    fn fixed_region(&self) -> Option<&Region>;
    fn muted(&self) -> bool;
    fn layer_name(&self) -> Option<&str>;
}

impl Edit {
    /// The name of the edit, as JSON has it.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Edit::Translate(_) => "translate",
            Edit::Rotate(_) => "rotate",
            Edit::ScaleDirection(_) => "scale_direction",
            Edit::ScaleNormals(_) => "scale_normals",
            Edit::Affine(_) => "affine",
            Edit::Displacement(_) => "displacement",
            Edit::Skeleton(_) => "skeleton",
        }
    }

    fn layer(&self) -> &dyn Layer {
        match self {
            Edit::Translate(edit) => edit,
            Edit::Rotate(edit) => edit,
            Edit::ScaleDirection(edit) => edit,
            Edit::ScaleNormals(edit) => edit,
            Edit::Affine(edit) => edit,
            Edit::Displacement(edit) => edit,
            Edit::Skeleton(edit) => edit,
        }
    }

    /// The features that make up the handle.
    #[must_use]
    pub fn features(&self) -> &[String] {
        self.layer().features()
    }

    /// The region that makes up the handle, or cuts it out of the features.
    #[must_use]
    pub fn region(&self) -> Option<&Region> {
        self.layer().region()
    }

    /// The features held fixed.
    #[must_use]
    pub fn fixed(&self) -> &[String] {
        self.layer().fixed()
    }

    /// The region held fixed.
    #[must_use]
    pub fn fixed_region(&self) -> Option<&Region> {
        self.layer().fixed_region()
    }

    /// Whether the edit is passed over.
    #[must_use]
    pub fn muted(&self) -> bool {
        self.layer().muted()
    }

    /// The name that the layer was given.
    #[must_use]
    pub fn layer_name(&self) -> Option<&str> {
        self.layer().layer_name()
    }

    /// The order of the polyharmonic equation; `None` for edits where nothing follows by it.
    #[must_use]
    pub fn harmonic_order(&self) -> Option<HarmonicOrder> {
        match self {
            Edit::Translate(edit) => Some(edit.harmonic_order),
            Edit::Rotate(edit) => Some(edit.harmonic_order),
            Edit::ScaleDirection(edit) => Some(edit.harmonic_order),
            Edit::ScaleNormals(edit) => Some(edit.harmonic_order),
            Edit::Affine(edit) => Some(edit.harmonic_order),
            Edit::Displacement(_) | Edit::Skeleton(_) => None,
        }
    }

    /// How many vertices and faces it lists: what it takes to hold it.
    #[must_use]
    pub fn listed(&self) -> usize {
        let faces = |region: Option<&Region>| match region {
            Some(Region::Faces(faces)) => faces.len(),
            _ => 0,
        };
        let own = match self {
            Edit::Displacement(edit) => edit.vertices.len().max(edit.values.len()),
            Edit::Skeleton(edit) => edit.moves.len(),
            _ => 0,
        };
        own + faces(self.region()) + faces(self.fixed_region())
    }

    /// Whether the edit acts on the whole surface where it names neither features nor a region.
    pub(super) fn may_take_all(&self) -> bool {
        matches!(self, Edit::Displacement(_) | Edit::Skeleton(_))
    }
}

fn at_least_one<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<String>, D::Error> {
    let names = Vec::<String>::deserialize(deserializer)?;
    if names.is_empty() {
        return Err(serde::de::Error::invalid_length(0, &"the name of at least one feature"));
    }
    Ok(names)
}

fn is_false(value: &bool) -> bool {
    !value
}

fn one() -> f64 {
    1.0
}

fn is_one(value: &f64) -> bool {
    *value == 1.0
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
        assert_eq!(edit.harmonic_order(), Some(HarmonicOrder::Triharmonic));
        assert_eq!(edit.fixed(), ["c"]);
        assert_eq!(serde_json::to_string(&edit).unwrap(), json);

        let short: Edit =
            serde_json::from_str(r#"{"scale_normals":{"features":["a"],"distance":-1}}"#).unwrap();
        assert_eq!(short.harmonic_order(), Some(HarmonicOrder::Biharmonic));
        assert!(short.fixed().is_empty());
        assert_eq!(
            serde_json::from_str::<Edit>(&serde_json::to_string(&short).unwrap()).unwrap(),
            short
        );
    }

    #[test]
    fn json_that_is_not_an_edit_is_refused_by_name() {
        assert!(
            error(r#"{"translate":{"features":[],"by":[0,0,0]}}"#).contains("at least one feature")
        );
        assert!(error(r#"{"translate":{"features":["a"]}}"#).contains("missing field `by`"));
        assert!(
            error(r#"{"translate":{"features":["a"],"by":[0,0,0],"fix":[]}}"#)
                .contains("unknown field `fix`")
        );
        assert!(
            error(r#"{"translate":{"features":["a"],"by":[0,0]}}"#).contains("array of length 3")
        );
        assert!(error(r#"{"turn":{}}"#).contains("unknown variant `turn`"));
        for order in ["0", "4", "-1"] {
            let json = format!(
                r#"{{"translate":{{"features":["a"],"by":[0,0,0],"harmonic_order":{order}}}}}"#
            );
            assert!(error(&json).contains(&format!("harmonic order {order} does not exist")));
        }
    }

    #[test]
    fn numbers_that_are_not_finite_are_refused_by_field() {
        let features = vec!["a".to_string()];
        let scale = ScaleDirection {
            features: features.clone(),
            factors: [1.0, f64::NAN, 1.0],
            ..ScaleDirection::default()
        };
        let message = |edit: Edit| edit.validate().unwrap_err().to_string();
        assert_eq!(
            message(Edit::ScaleDirection(scale.clone())),
            "factors[1]: NaN is not a finite number"
        );
        let scale =
            ScaleDirection { factors: [1.0; 3], center: Some([0.0, 0.0, f64::INFINITY]), ..scale };
        assert_eq!(message(Edit::ScaleDirection(scale)), "center[2]: inf is not a finite number");
        let normals =
            ScaleNormals { features, distance: f64::NEG_INFINITY, ..ScaleNormals::default() };
        assert_eq!(
            message(Edit::ScaleNormals(normals.clone())),
            "distance: -inf is not a finite number"
        );
        assert!(
            message(Edit::ScaleNormals(ScaleNormals { features: vec![], ..normals }))
                .contains("no handle")
        );
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
