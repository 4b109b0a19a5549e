//! Features: the named parts of a surface.

use std::collections::{BTreeMap, HashMap};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::mesh::{Cells, MeshError, Vector};
use crate::names::near;
use crate::number::Number;
use crate::topology::Groups;

mod misplaced;
mod sharp_edges;
mod tags;

pub use misplaced::{MisplacedFaces, check_feature_names, misplaced_faces};
use sharp_edges::parts_between_sharp_edges;
pub use tags::{FaceTags, face_tags};

/// How features are found where the mesh does not name them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FeatureSettings {
    /// Two faces belong to different features where the angle between their normals is this or
    /// larger, in degrees. 0 makes every face a feature, and at 180 no edge is sharp.
    #[schemars(range(min = 0.0, max = 180.0))]
    pub sharp_angle_degrees: f64,
}

impl Default for FeatureSettings {
    fn default() -> Self {
        Self { sharp_angle_degrees: 30.0 }
    }
}

impl FeatureSettings {
    pub(crate) fn validate(&self) -> Result<(), InvalidSharpAngle> {
        let angle = self.sharp_angle_degrees;
        if (0.0..=180.0).contains(&angle) { Ok(()) } else { Err(InvalidSharpAngle(angle)) }
    }
}

/// A sharp angle that is not an angle between faces.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("sharp_angle_degrees is {}; expected an angle from 0 to 180 degrees", Number(*.0))]
pub struct InvalidSharpAngle(pub f64);

/// The features of a surface: every face belongs to exactly one.
///
/// Features named by the mesh are in the order of their numbers, `untagged` last; those found at
/// sharp edges are named `feature-1`, `feature-2` and so on in the order of their lowest faces. A
/// feature has at least one face.
#[derive(Debug, Clone, PartialEq)]
pub struct Features {
    names: Vec<String>,
    face_features: Vec<u32>,
    /// The vertices of each feature, rising.
    vertices: Groups<u32>,
}

/// How large a feature is.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct FeatureSize {
    /// Its name.
    pub name: String,
    /// How many faces it has.
    pub faces: usize,
    /// How many vertices these have.
    pub vertices: usize,
    /// Their area, in the mesh's unit of length squared.
    pub area: f64,
    /// The lowest and the highest coordinates.
    pub bounds: [Vector; 2],
}

/// The name of the feature of all faces that the mesh's tags leave out.
const UNTAGGED: &str = "untagged";

impl Features {
    /// The features that the tags of the faces name; where there are none, those between sharp
    /// edges.
    pub(crate) fn of_tags(
        tags: Option<&FaceTags>,
        points: &[Vector],
        faces: &Cells,
        settings: &FeatureSettings,
    ) -> Self {
        let (names, face_features) = match tags {
            None => sharp_features(points, faces, settings),
            Some(tags) => named_features(&tags.tags, &tags.names),
        };
        let vertices = feature_vertices(names.len(), &face_features, faces);
        Self { names, face_features, vertices }
    }

    /// Features that are known already: `face_features` are indices into `names`, one for each
    /// face.
    pub(crate) fn of_faces(
        names: Vec<String>,
        face_features: Vec<u32>,
        faces: &Cells,
    ) -> Result<Self, MeshError> {
        if face_features.len() != faces.len() {
            return Err(MeshError::FeatureCount {
                found: face_features.len(),
                expected: faces.len(),
                what: "faces",
            });
        }
        if let Some(&feature) =
            face_features.iter().find(|&&feature| feature as usize >= names.len())
        {
            let found = feature as usize + 1;
            return Err(MeshError::FeatureCount {
                found,
                expected: names.len(),
                what: "feature names",
            });
        }
        let vertices = feature_vertices(names.len(), &face_features, faces);
        Ok(Self { names, face_features, vertices })
    }

    /// The names, all different.
    #[must_use]
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The feature of each face of the surface, as an index into [`Features::names`].
    #[must_use]
    pub fn face_features(&self) -> &[u32] {
        &self.face_features
    }

    /// The faces of a feature, rising, as the region `faces` of an edit takes them; none for a
    /// feature that does not exist.
    ///
    /// ```
    /// use tombolo_deform::{shapes, features::FeatureSettings, surface::Surface};
    ///
    /// let mesh = shapes::box_of_hexahedra([2, 2, 2], [0.0; 3], [1.0; 3]);
    /// let surface = Surface::extract(&mesh, &FeatureSettings::default())?;
    /// let floor = surface.features().index("z-min")?;
    /// assert!(surface.features().faces(floor).all(|face| {
    ///     surface.faces().vertices(face as usize).iter().all(|&vertex| surface.points()[vertex as usize][2] == 0.0)
    /// }));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn faces(&self, feature: u32) -> impl Iterator<Item = u32> {
        (0..)
            .zip(&self.face_features)
            .filter(move |(_, other)| **other == feature)
            .map(|(face, _)| face)
    }

    /// The index of the feature with this name.
    ///
    /// # Errors
    /// [`UnknownFeature`] with the near names and all the features there are.
    ///
    /// ```
    /// use tombolo_deform::{shapes, features::FeatureSettings, surface::Surface};
    ///
    /// let mesh = shapes::box_of_tets([1, 1, 1], [0.0; 3], [1.0; 3]);
    /// let surface = Surface::extract(&mesh, &FeatureSettings::default())?;
    /// assert_eq!(surface.features().index("y-max")?, 3);
    /// let error = surface.features().index("y_max").unwrap_err();
    /// assert!(error.to_string().starts_with("there is no feature 'y_max'; did you mean 'y-max'"));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn index(&self, name: &str) -> Result<u32, UnknownFeature> {
        match self.names.iter().position(|known| known == name) {
            Some(found) => Ok(found as u32),
            None => Err(UnknownFeature {
                name: name.to_string(),
                near: near(name, self.names.iter().map(String::as_str))
                    .map(str::to_owned)
                    .take(3)
                    .collect(),
                features: self.names.clone(),
            }),
        }
    }

    /// The surface vertices of the faces of a feature, rising; none for a feature that does not
    /// exist.
    #[must_use]
    pub fn vertices(&self, feature: u32) -> &[u32] {
        if (feature as usize) < self.names.len() { self.vertices.of(feature) } else { &[] }
    }
}

/// A name that is no feature of the surface.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "there is no feature '{name}'{}; the features are {}",
    did_you_mean(near),
    listed(features)
)]
pub struct UnknownFeature {
    /// The name.
    pub name: String,
    /// Features with names like it, the nearest first; at most three.
    pub near: Vec<String>,
    /// All features.
    pub features: Vec<String>,
}

fn did_you_mean(near: &[String]) -> String {
    let quoted: Vec<String> = near.iter().map(|name| format!("'{name}'")).collect();
    if quoted.is_empty() {
        String::new()
    } else {
        format!("; did you mean {}?", quoted.join(" or "))
    }
}

fn listed(names: &[String]) -> String {
    const SHOWN: usize = 40;
    let shown = names.iter().take(SHOWN).map(String::as_str).collect::<Vec<_>>().join(", ");
    if names.len() > SHOWN { format!("{shown} and {} more", names.len() - SHOWN) } else { shown }
}

fn named_features(tags: &[Option<i64>], names: &[(i64, String)]) -> (Vec<String>, Vec<u32>) {
    let given: HashMap<i64, &String> = names.iter().rev().map(|(tag, name)| (*tag, name)).collect();
    // In the order of the numbers, untagged last; numbers with one name are one feature.
    let mut order: BTreeMap<(bool, i64), u32> =
        tags.iter().map(|tag| ((tag.is_none(), tag.unwrap_or(0)), 0)).collect();
    let mut found: Vec<String> = Vec::new();
    let mut indices: HashMap<String, u32> = HashMap::new();
    for (&(untagged, tag), index) in &mut order {
        let name = match given.get(&tag) {
            _ if untagged => UNTAGGED.to_string(),
            Some(name) => (*name).clone(),
            None => format!("feature-{tag}"),
        };
        *index = *indices.entry(name.clone()).or_insert_with(|| {
            found.push(name);
            found.len() as u32 - 1
        });
    }
    let face_features = tags.iter().map(|tag| order[&(tag.is_none(), tag.unwrap_or(0))]).collect();
    (found, face_features)
}

fn sharp_features(
    points: &[Vector],
    faces: &Cells,
    settings: &FeatureSettings,
) -> (Vec<String>, Vec<u32>) {
    let (count, face_features) =
        parts_between_sharp_edges(points, faces, settings.sharp_angle_degrees);
    ((1..=count).map(|number| format!("feature-{number}")).collect(), face_features)
}

fn feature_vertices(count: usize, face_features: &[u32], faces: &Cells) -> Groups<u32> {
    let mut pairs: Vec<(u32, u32)> = Vec::with_capacity(faces.connectivity().len());
    for (&feature, (_, vertices)) in face_features.iter().zip(faces.iter()) {
        pairs.extend(vertices.iter().map(|&vertex| (feature, vertex)));
    }
    pairs.sort_unstable();
    pairs.dedup();
    Groups::new(count, pairs.iter().copied())
}
