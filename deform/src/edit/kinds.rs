//! The kinds of edits: the types behind the JSON of a stack of edits.

use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

use super::region::Region;
use crate::harmonic::HarmonicOrder;
use crate::mesh::Vector;
use crate::skeleton::Skinning;
use crate::vector::scale;

/// One edit of the shape, a layer of the stack: a handle is moved, other parts are held fixed, and
/// the rest of the surface follows smoothly.
///
/// The handle is the vertices of `features` that lie in `region`; with one of the two alone, all
/// vertices of the features or all surface vertices in the region. A vertex that is also in `fixed`
/// or in `fixed_region` stays fixed. A muted edit is checked like any other and does nothing.
///
/// In JSON an edit is an object with one key, the name of the edit:
///
/// ```
/// use tombolo_deform::edit::{Edit, HarmonicOrder};
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
    Skeleton(SkeletonEdit),
}

/// Declares the body of an edit: what every edit has, then its own fields. (serde's `flatten` would
/// let unknown keys pass.)
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
            /// The part of the reference surface that makes up the handle; with `features`, what of
            /// them lies in it.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            #[schemars(extend("x-label" = "only in a region", "x-advanced" = true))]
            pub region: Option<Region>,
            /// The features held where they are. A vertex that is also in the handle stays fixed.
            #[serde(default)]
            pub fixed: Vec<String>,
            /// A part of the reference surface that is held where it is, beside the fixed features.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            #[schemars(extend("x-label" = "hold a region", "x-advanced" = true))]
            pub fixed_region: Option<Region>,
            $($(#[$field_attribute])* pub $field: $type,)*
            /// Whether the edit is passed over.
            #[serde(default, skip_serializing_if = "is_false")]
            #[schemars(extend("x-hidden" = true))]
            pub muted: bool,
            /// A name for the layer, in reports and lists.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            #[schemars(extend("x-hidden" = true))]
            pub name: Option<String>,
        }

        impl Body for $name {
            fn common(&self) -> Common<'_> {
                Common {
                    features: &self.features,
                    region: self.region.as_ref(),
                    fixed: &self.fixed,
                    fixed_region: self.fixed_region.as_ref(),
                    muted: self.muted,
                    name: self.name.as_deref(),
                }
            }
        }
    };
}

layer! {
    /// Moves the handle as one rigid body.
    ///
    /// ```
    /// use tombolo_deform::edit::{Edit, Translate};
    ///
    /// let edit = Edit::Translate(Translate { features: vec!["outlet".into()], by: [0.0, 0.0, 0.1], ..Translate::default() });
    /// assert_eq!(edit.name(), "translate");
    /// ```
    #[derive(Default)]
    #[schemars(extend("anyOf" = [{"required": ["features"]}, {"required": ["region"]}], "x-label" = "Move"))]
    pub struct Translate {
        /// How far the handle moves along x, y and z, in units of the mesh.
        #[schemars(extend("x-label" = "move by", "x-unit" = "mesh units", "x-neutral" = [0, 0, 0]))]
        pub by: Vector,
        /// How smoothly the surface between handle and fixed parts follows.
        #[serde(default)]
        #[schemars(extend("x-label" = "smoothness", "x-advanced" = true))]
        pub harmonic_order: HarmonicOrder,
    }
}

layer! {
    /// Turns the handle as one rigid body about an axis.
    #[derive(Default)]
    #[schemars(extend("anyOf" = [{"required": ["features"]}, {"required": ["region"]}], "x-label" = "Turn"))]
    pub struct Rotate {
        /// The direction of the axis, of any length but 0.
        #[schemars(extend("x-label" = "about the direction", "x-start" = [0, 0, 1]))]
        pub axis: Vector,
        /// The angle in degrees, counter-clockwise seen against the axis (right-hand rule).
        /// Multiples of 90 are exact.
        #[schemars(extend("x-label" = "turn by", "x-unit" = "°", "x-neutral" = 0))]
        pub degrees: f64,
        /// A point of the axis. Left out or null, it is the centre of the handle's bounding box in
        /// the shape that the edits before this one have reached.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("x-label" = "about a point", "x-unit" = "mesh units", "x-advanced" = true))]
        pub center: Option<Vector>,
        /// How smoothly the surface between handle and fixed parts follows.
        #[serde(default)]
        #[schemars(extend("x-label" = "smoothness", "x-advanced" = true))]
        pub harmonic_order: HarmonicOrder,
    }
}

layer! {
    /// Scales the handle along the axes about a centre, as one body.
    #[derive(Default)]
    #[schemars(extend("anyOf" = [{"required": ["features"]}, {"required": ["region"]}], "x-label" = "Scale"))]
    pub struct ScaleDirection {
        /// The factors along x, y and z; 1 leaves an axis as it is.
        #[schemars(extend("x-label" = "scale by", "x-unit" = "1 leaves it", "x-neutral" = [1, 1, 1]))]
        pub factors: Vector,
        /// The point that stays in place. Left out or null, it is the centre of the handle's
        /// bounding box in the shape that the edits before this one have reached.
        #[serde(default)]
        #[schemars(extend("x-label" = "about a point", "x-unit" = "mesh units", "x-advanced" = true))]
        pub center: Option<Vector>,
        /// How smoothly the surface between handle and fixed parts follows.
        #[serde(default)]
        #[schemars(extend("x-label" = "smoothness", "x-advanced" = true))]
        pub harmonic_order: HarmonicOrder,
    }
}

layer! {
    /// Moves the handle along its surface normals: outward for a positive distance.
    #[derive(Default)]
    #[schemars(extend("anyOf" = [{"required": ["features"]}, {"required": ["region"]}], "x-label" = "Grow or shrink"))]
    pub struct ScaleNormals {
        /// How far each vertex of the handle moves along its normal, in units of the mesh; negative
        /// moves inward. The normal of a vertex is the area-weighted mean of the normals of the
        /// handle's own faces around it.
        #[schemars(extend("x-label" = "outward by", "x-unit" = "mesh units", "x-neutral" = 0))]
        pub distance: f64,
        /// How smoothly the surface between handle and fixed parts follows.
        #[serde(default)]
        #[schemars(extend("x-label" = "smoothness", "x-advanced" = true))]
        pub harmonic_order: HarmonicOrder,
    }
}

layer! {
    /// Moves the handle by a matrix about a centre and a translation: `x` goes to
    /// `matrix (x - center) + center + translation`.
    #[derive(Default)]
    #[schemars(extend("anyOf" = [{"required": ["features"]}, {"required": ["region"]}], "x-label" = "Apply a matrix"))]
    pub struct Affine {
        /// The rows of the matrix. It may be singular: what is flattened is the guard's business.
        #[schemars(extend("x-neutral" = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]))]
        pub matrix: [Vector; 3],
        /// The translation after it, in units of the mesh.
        #[serde(default)]
        #[schemars(extend("x-label" = "then move by", "x-unit" = "mesh units", "x-neutral" = [0, 0, 0]))]
        pub translation: Vector,
        /// The point that the matrix leaves in place. Left out or null, it is the centre of the
        /// handle's bounding box in the shape that the edits before this one have reached.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("x-label" = "about a point", "x-unit" = "mesh units", "x-advanced" = true))]
        pub center: Option<Vector>,
        /// How smoothly the surface between handle and fixed parts follows.
        #[serde(default)]
        #[schemars(extend("x-label" = "smoothness", "x-advanced" = true))]
        pub harmonic_order: HarmonicOrder,
    }
}

layer! {
    /// Adds a displacement made elsewhere to what the edits before it have reached.
    ///
    /// An import is exact: vertices that are not named do not move, and nothing follows. Without
    /// `features` and `region` every named vertex moves; with them, those in the handle alone.
    #[schemars(extend("x-label" = "Import a displacement"))]
    pub struct Displacement {
        /// A file that holds the displacement: `.vtp`, `.vtu` or `.vtk` with the point array
        /// `displacement`, or plain text. A relative one lies beside the JSON file that names it.
        /// Only files name files: an order that comes over the network must hold the numbers.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("x-hidden" = true))]
        pub file: Option<String>,
        /// The vertices that move, by mesh vertex numbers, where no file is given.
        #[serde(default, skip_serializing_if = "is_nothing")]
        pub vertices: Arc<[u32]>,
        /// How far each of them moves along x, y and z, in units of the mesh.
        #[serde(default, skip_serializing_if = "is_nothing")]
        #[schemars(extend("x-label" = "displacements", "x-unit" = "mesh units"))]
        pub values: Arc<[Vector]>,
        /// A factor for all of them.
        #[serde(default = "one", skip_serializing_if = "is_one")]
        #[schemars(extend("x-label" = "times", "x-start" = 1, "x-neutral" = 0))]
        pub scale: f64,
    }
}

layer! {
    /// Drags the surface by its skeleton: each vertex follows the part of the skeleton that carries
    /// it.
    ///
    /// Features and region say which vertices follow; without them, all do. What is fixed is held
    /// exactly, and the motion fades out towards it.
    #[derive(Default)]
    #[schemars(rename = "Skeleton", extend("x-label" = "Bend by the skeleton"))]
    pub struct SkeletonEdit {
        /// A point of the reference shape: the node of the reference skeleton nearest to it is
        /// dragged.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("x-hidden" = true))]
        pub at: Option<Vector>,
        /// How far it is dragged along x, y and z, in units of the mesh.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("x-hidden" = true))]
        pub by: Option<Vector>,
        /// Several drags at once, in place of `at` and `by`.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        #[schemars(extend("x-label" = "nodes", "x-hint" = "Show the skeleton and drag its nodes in the picture, one after the other."))]
        pub moves: Vec<SkeletonMove>,
        /// How the surface follows its skeleton.
        #[serde(default)]
        #[schemars(extend("x-label" = "the surface follows", "x-advanced" = true))]
        pub skinning: Skinning,
    }
}

/// A drag of one node of the skeleton.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SkeletonMove {
    /// A point of the reference shape: the node of the reference skeleton nearest to it is dragged.
    #[schemars(extend("x-label" = "node at", "x-unit" = "mesh units"))]
    pub at: Vector,
    /// How far it is dragged along x, y and z, in units of the mesh.
    #[schemars(extend("x-label" = "drag by", "x-unit" = "mesh units", "x-neutral" = [0, 0, 0]))]
    pub by: Vector,
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
            vertices: Arc::default(),
            values: Arc::default(),
            scale: 1.0,
            muted: false,
            name: None,
        }
    }
}

impl SkeletonEdit {
    /// The drags, however they were given.
    #[must_use]
    pub fn moves(&self) -> Vec<SkeletonMove> {
        let single = self.at.zip(self.by).map(|(at, by)| SkeletonMove { at, by });
        single.into_iter().chain(self.moves.iter().copied()).collect()
    }
}

/// The fields that edits of every kind have.
struct Common<'a> {
    features: &'a [String],
    region: Option<&'a Region>,
    fixed: &'a [String],
    fixed_region: Option<&'a Region>,
    muted: bool,
    name: Option<&'a str>,
}

/// The body of an edit of any kind.
trait Body {
    fn common(&self) -> Common<'_>;
}

impl Edit {
    /// The name of the edit, as JSON has it, and its body.
    fn parts(&self) -> (&'static str, &dyn Body) {
        match self {
            Edit::Translate(edit) => ("translate", edit),
            Edit::Rotate(edit) => ("rotate", edit),
            Edit::ScaleDirection(edit) => ("scale_direction", edit),
            Edit::ScaleNormals(edit) => ("scale_normals", edit),
            Edit::Affine(edit) => ("affine", edit),
            Edit::Displacement(edit) => ("displacement", edit),
            Edit::Skeleton(edit) => ("skeleton", edit),
        }
    }

    fn common(&self) -> Common<'_> {
        self.parts().1.common()
    }

    /// The name of the edit, as JSON has it.
    #[must_use]
    pub fn name(&self) -> &'static str {
        self.parts().0
    }

    /// The features that make up the handle.
    #[must_use]
    pub fn features(&self) -> &[String] {
        self.common().features
    }

    /// The region that makes up the handle, or cuts it out of the features.
    #[must_use]
    pub fn region(&self) -> Option<&Region> {
        self.common().region
    }

    /// The features held fixed.
    #[must_use]
    pub fn fixed(&self) -> &[String] {
        self.common().fixed
    }

    /// The region held fixed.
    #[must_use]
    pub fn fixed_region(&self) -> Option<&Region> {
        self.common().fixed_region
    }

    /// Whether the edit is passed over.
    #[must_use]
    pub fn muted(&self) -> bool {
        self.common().muted
    }

    /// The name that the layer was given.
    #[must_use]
    pub fn layer_name(&self) -> Option<&str> {
        self.common().name
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

    /// The edit with a fraction of its amount: 1 is the edit itself, 0 moves nothing. Distances,
    /// angles, and how far factors and matrices are from the identity, are multiplied.
    ///
    /// ```
    /// use tombolo_deform::edit::Edit;
    ///
    /// let edit: Edit = serde_json::from_str(r#"{"scale_direction": {"features": ["throat"], "factors": [1, 1, 0.5]}}"#)?;
    /// let Edit::ScaleDirection(half) = edit.scaled(0.5) else { panic!() };
    /// assert_eq!(half.factors, [1.0, 1.0, 0.75]);
    /// assert_eq!(edit.scaled(1.0), edit);
    /// # Ok::<(), serde_json::Error>(())
    /// ```
    #[must_use]
    pub fn scaled(&self, fraction: f64) -> Self {
        let mut edit = self.clone();
        if fraction == 1.0 {
            return edit;
        }
        match &mut edit {
            Edit::Translate(edit) => edit.by = scale(edit.by, fraction),
            Edit::Rotate(edit) => edit.degrees *= fraction,
            Edit::ScaleDirection(edit) => {
                edit.factors = edit.factors.map(|factor| 1.0 + fraction * (factor - 1.0))
            }
            Edit::ScaleNormals(edit) => edit.distance *= fraction,
            Edit::Affine(edit) => {
                for (index, row) in edit.matrix.iter_mut().enumerate() {
                    for (column, value) in row.iter_mut().enumerate() {
                        let identity = f64::from(u8::from(index == column));
                        *value = identity + fraction * (*value - identity);
                    }
                }
                edit.translation = scale(edit.translation, fraction);
            }
            Edit::Displacement(edit) => edit.scale *= fraction,
            Edit::Skeleton(edit) => {
                edit.by = edit.by.map(|by| scale(by, fraction));
                for drag in &mut edit.moves {
                    drag.by = scale(drag.by, fraction);
                }
            }
        }
        edit
    }

    /// How many vertices, faces and features it lists: what it takes to hold it.
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
        let features = self.features().len() + self.fixed().len();
        own + features + faces(self.region()) + faces(self.fixed_region())
    }

    /// About how many bytes of memory it takes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let names = self.features().iter().chain(self.fixed());
        let names: usize = names.map(|name| size_of::<String>() + name.len()).sum();
        let listed = self.listed().saturating_mul(size_of::<u32>() + size_of::<Vector>());
        listed.saturating_add(size_of::<Self>() + names)
    }

    /// Whether an edit without features and region acts on the whole surface.
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

fn is_nothing<T>(list: &Arc<[T]>) -> bool {
    list.is_empty()
}

fn one() -> f64 {
    1.0
}

fn is_one(value: &f64) -> bool {
    *value == 1.0
}
