//! The stages that take something out of a mesh, and the rules that they keep to.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tombolo_deform::edit::{BoxRegion, SphereRegion};
use tombolo_deform::mesh::Vector;

use super::Problem;
use super::error::{above_zero, finite};
use crate::limits::CUTS;

/// A plane.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Plane {
    /// A point of the plane.
    pub origin: Vector,
    /// The direction across the plane, of any length but 0.
    pub normal: Vector,
}

/// A cylinder without ends.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cylinder {
    /// A point of the axis.
    pub origin: Vector,
    /// The direction of the axis, of any length but 0.
    pub axis: Vector,
    /// The radius, in units of the mesh.
    pub radius: f64,
}

/// The surface that cuts a mesh: a plane, several planes, a cylinder or a sphere.
///
/// A cylinder and a sphere are cut out as the linear cells show them: the square of the distance
/// less that of the radius is interpolated along the edges.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "SliceKeys", into = "SliceKeys")]
pub enum Slice {
    /// One plane.
    Plane(Plane),
    /// Several planes; their cuts make one extract.
    Planes(Vec<Plane>),
    /// A cylinder.
    Cylinder(Cylinder),
    /// A sphere.
    Sphere(SphereRegion),
}

/// A slice as it stands in JSON.
#[derive(Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct SliceKeys {
    /// A point of the plane. Goes with `normal`; of `origin` with `normal`, `planes`, `cylinder`
    /// and `sphere` one is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    origin: Option<Vector>,
    /// The direction across the plane, of any length but 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    normal: Option<Vector>,
    /// Several planes; their cuts make one extract.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    planes: Option<Vec<Plane>>,
    /// A cylinder.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    cylinder: Option<Cylinder>,
    /// A sphere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    sphere: Option<SphereRegion>,
}

impl TryFrom<SliceKeys> for Slice {
    type Error = String;

    fn try_from(keys: SliceKeys) -> Result<Self, String> {
        match keys {
            SliceKeys {
                origin: Some(origin),
                normal: Some(normal),
                planes: None,
                cylinder: None,
                sphere: None,
            } => Ok(Slice::Plane(Plane { origin, normal })),
            SliceKeys { origin: None, normal: None, planes, cylinder, sphere } => {
                match (planes, cylinder, sphere) {
                    (Some(planes), None, None) => Ok(Slice::Planes(planes)),
                    (None, Some(cylinder), None) => Ok(Slice::Cylinder(cylinder)),
                    (None, None, Some(sphere)) => Ok(Slice::Sphere(sphere)),
                    (None, None, None) => Err("found nothing that cuts, expected `origin` with \
                                               `normal`, `planes`, `cylinder` or `sphere`"
                        .into()),
                    _ => Err(SEVERAL.into()),
                }
            }
            SliceKeys { origin: Some(_), normal: None, .. } => {
                Err("the key `normal` is missing".into())
            }
            SliceKeys { origin: None, normal: Some(_), .. } => {
                Err("the key `origin` is missing".into())
            }
            _ => Err(SEVERAL.into()),
        }
    }
}

const SEVERAL: &str =
    "found more than one of `origin` with `normal`, `planes`, `cylinder` and `sphere`";

impl From<Slice> for SliceKeys {
    fn from(slice: Slice) -> Self {
        let none = Self::default();
        match slice {
            Slice::Plane(Plane { origin, normal }) => {
                Self { origin: Some(origin), normal: Some(normal), ..none }
            }
            Slice::Planes(planes) => Self { planes: Some(planes), ..none },
            Slice::Cylinder(cylinder) => Self { cylinder: Some(cylinder), ..none },
            Slice::Sphere(sphere) => Self { sphere: Some(sphere), ..none },
        }
    }
}

/// The surfaces on which a vertex field has given values.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Contour {
    /// The vertex field: a scalar, or a vector, of which the magnitude is taken.
    pub field: String,
    /// The values, at least one. The surfaces of all of them make one extract.
    pub values: Vec<f64>,
}

/// The cells in which a field keeps to a range.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Threshold {
    /// The field: a scalar, or a vector, of which the magnitude is taken. `scaled_jacobian` is the
    /// quality of the cells, measured where the solver has no field of that name.
    pub field: String,
    /// The least value; left out, there is none. At least one of `min` and `max` is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min: Option<f64>,
    /// The largest value; left out, there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max: Option<f64>,
    /// For a vertex field: how many vertices of a cell must keep to the range.
    #[serde(default)]
    pub vertices: Quantifier,
}

/// How many of a cell's vertices a rule must hold for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Quantifier {
    /// Every one.
    #[default]
    All,
    /// One or more.
    Any,
}

/// The part of the volume on one side of a surface. Cells that the surface cuts become tetrahedra,
/// pyramids and wedges.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "ClipKeys", into = "ClipKeys")]
pub struct Clip {
    /// The surface.
    pub by: ClipBy,
    /// Whether the other side is kept.
    pub invert: bool,
}

/// The surface that a volume is clipped by.
#[derive(Debug, Clone, PartialEq)]
pub enum ClipBy {
    /// The side that the normal points to is kept.
    Plane(Plane),
    /// The inside is kept.
    Box(BoxRegion),
    /// The inside is kept.
    Sphere(SphereRegion),
    /// The part is kept in which the field is not below the value.
    Field(ClipField),
}

/// A value of a field.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ClipField {
    /// The vertex field: a scalar, or a vector, of which the magnitude is taken.
    pub name: String,
    /// The value.
    pub value: f64,
}

/// A clip as it stands in JSON.
#[derive(Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct ClipKeys {
    /// The side that the normal points to is kept. One of `plane`, `box`, `sphere` and `field` is
    /// given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    plane: Option<Plane>,
    /// The inside of the box is kept.
    #[serde(default, rename = "box", skip_serializing_if = "Option::is_none")]
    region: Option<BoxRegion>,
    /// The inside of the sphere is kept, as the linear cells show it: the square of the distance is
    /// interpolated along the edges.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    sphere: Option<SphereRegion>,
    /// The part is kept in which the field is not below the value.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    field: Option<ClipField>,
    /// Whether the other side is kept.
    #[serde(default)]
    invert: bool,
}

impl TryFrom<ClipKeys> for Clip {
    type Error = String;

    fn try_from(keys: ClipKeys) -> Result<Self, String> {
        let ClipKeys { plane, region, sphere, field, invert } = keys;
        let by = [
            plane.map(ClipBy::Plane),
            region.map(ClipBy::Box),
            sphere.map(ClipBy::Sphere),
            field.map(ClipBy::Field),
        ];
        let mut given = by.into_iter().flatten();
        match (given.next(), given.next()) {
            (Some(by), None) => Ok(Self { by, invert }),
            (None, _) => {
                Err("found nothing to clip by, expected `plane`, `box`, `sphere` or `field`".into())
            }
            _ => Err("found more than one of `plane`, `box`, `sphere` and `field`".into()),
        }
    }
}

impl From<Clip> for ClipKeys {
    fn from(Clip { by, invert }: Clip) -> Self {
        let keys = Self { invert, ..Self::default() };
        match by {
            ClipBy::Plane(plane) => Self { plane: Some(plane), ..keys },
            ClipBy::Box(region) => Self { region: Some(region), ..keys },
            ClipBy::Sphere(sphere) => Self { sphere: Some(sphere), ..keys },
            ClipBy::Field(field) => Self { field: Some(field), ..keys },
        }
    }
}

impl Slice {
    pub(super) fn check(&self) -> Result<(), Problem> {
        match self {
            Slice::Plane(plane) => plane.check(),
            Slice::Planes(planes) => {
                at_least_one(planes.len(), "plane").map_err(|problem| problem.within("planes"))?;
                for (index, plane) in planes.iter().enumerate() {
                    plane.check().map_err(|problem| problem.at(index).within("planes"))?;
                }
                Ok(())
            }
            Slice::Cylinder(cylinder) => cylinder.check().map_err(|it| it.within("cylinder")),
            Slice::Sphere(sphere) => check_sphere(sphere).map_err(|it| it.within("sphere")),
        }
    }
}

impl Plane {
    fn check(&self) -> Result<(), Problem> {
        check_point(self.origin, "origin")?;
        check_direction(self.normal, "normal")
    }
}

impl Cylinder {
    fn check(&self) -> Result<(), Problem> {
        check_point(self.origin, "origin")?;
        check_direction(self.axis, "axis")?;
        above_zero(self.radius).map_err(|problem| problem.within("radius"))
    }
}

impl Contour {
    pub(super) fn check(&self) -> Result<(), Problem> {
        at_least_one(self.values.len(), "value").map_err(|problem| problem.within("values"))?;
        for (index, &value) in self.values.iter().enumerate() {
            let located = |problem: Problem| problem.at(index).within("values");
            finite(value).map_err(located)?;
            if self.values[..index].contains(&value) {
                return Err(located(Problem::new("found the same value twice")));
            }
        }
        Ok(())
    }
}

impl Threshold {
    pub(super) fn check(&self) -> Result<(), Problem> {
        for (key, bound) in [("min", self.min), ("max", self.max)] {
            bound.map_or(Ok(()), finite).map_err(|problem| problem.within(key))?;
        }
        match (self.min, self.max) {
            (None, None) => Err(Problem::new("found no range, expected `min` or `max`")),
            (Some(min), Some(max)) if min > max => {
                Err(Problem::new(format!("found {min}, which is above `max`: {max}")).within("min"))
            }
            _ => Ok(()),
        }
    }
}

impl Clip {
    pub(super) fn check(&self) -> Result<(), Problem> {
        match &self.by {
            ClipBy::Plane(plane) => plane.check().map_err(|it| it.within("plane")),
            ClipBy::Box(region) => check_box(region.lower, region.upper, false)
                .map_err(|problem| problem.within("box")),
            ClipBy::Sphere(sphere) => check_sphere(sphere).map_err(|it| it.within("sphere")),
            ClipBy::Field(field) => {
                finite(field.value).map_err(|problem| problem.within("value").within("field"))
            }
        }
    }
}

fn at_least_one(count: usize, what: &str) -> Result<(), Problem> {
    if count == 0 {
        return Err(Problem::new(format!("expected at least one {what}")));
    }
    CUTS.check(count).map_err(Problem::from)
}

pub(super) fn check_point(point: Vector, key: &str) -> Result<(), Problem> {
    for (axis, &value) in point.iter().enumerate() {
        finite(value).map_err(|problem| problem.at(axis).within(key))?;
    }
    Ok(())
}

/// Refuses coordinates of the key `points` that are not finite.
pub(super) fn check_points(points: &[Vector]) -> Result<(), Problem> {
    for (index, point) in points.iter().enumerate() {
        for (axis, &value) in point.iter().enumerate() {
            finite(value).map_err(|it| it.at(axis).at(index).within("points"))?;
        }
    }
    Ok(())
}

pub(super) fn check_direction(direction: Vector, key: &str) -> Result<(), Problem> {
    let length = direction.iter().fold(0.0_f64, |sum, x| sum.hypot(*x));
    if length.is_normal() {
        return Ok(());
    }
    Err(Problem::new("expected a direction, whose length is not 0").within(key))
}

fn check_sphere(sphere: &SphereRegion) -> Result<(), Problem> {
    check_point(sphere.center, "center")?;
    above_zero(sphere.radius).map_err(|problem| problem.within("radius"))
}

pub(super) fn check_box(lower: Vector, upper: Vector, may_be_flat: bool) -> Result<(), Problem> {
    check_point(lower, "lower")?;
    check_point(upper, "upper")?;
    let wrong =
        |axis: &usize| lower[*axis] > upper[*axis] || !may_be_flat && lower[*axis] == upper[*axis];
    match (0..3).find(wrong) {
        None => Ok(()),
        Some(axis) => {
            let than = if may_be_flat { "at most" } else { "less than" };
            let message =
                format!("found {}, expected {than} `upper[{axis}]`: {}", lower[axis], upper[axis]);
            Err(Problem::new(message).at(axis).within("lower"))
        }
    }
}
