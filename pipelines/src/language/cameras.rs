//! Where pictures are taken from, and the rules that cameras keep to.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tombolo_deform::edit::BoxRegion;
use tombolo_deform::mesh::Vector;

use super::Problem;
use super::error::finite;
use super::extracts::{check_box, check_direction, check_point};
use crate::limits::CAMERAS;

/// A camera.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "CameraKeys", into = "CameraKeys")]
pub struct Camera {
    /// Its name; without one, its number from 0.
    pub name: Option<String>,
    /// Where it stands.
    pub viewpoint: Viewpoint,
    /// The direction that is up in the picture.
    pub up: Vector,
    /// Whether it sees along parallel rays.
    pub parallel: bool,
    /// The angle that the height of the picture spans, in degrees.
    pub angle: f64,
    /// How many times larger all is shown.
    pub zoom: f64,
}

/// Where a camera stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Viewpoint {
    /// At a point.
    At {
        /// The point.
        position: Vector,
        /// The point that is in the middle of the picture.
        focal_point: Vector,
    },
    /// In a direction, as far away as shows all of the extract.
    Around {
        /// The angle about the direction up, in degrees: 0 lies on x where z is up.
        azimuth: f64,
        /// The angle above the horizon, in degrees.
        elevation: f64,
        /// The box that fills the picture; `None` for that around the extract.
        bounds: Option<BoxRegion>,
    },
}

/// A camera as it stands in JSON.
#[derive(Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct CameraKeys {
    /// Its name, of letters, digits, `-`, `_` and `.`; left out, its number from 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    name: Option<String>,
    /// Where it stands. Goes with `focal_point`; one of `position` and `azimuth` is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    position: Option<Vector>,
    /// The point that is in the middle of the picture.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    focal_point: Option<Vector>,
    /// The direction that it sees the extract from, in degrees about `up`, as far away as shows all
    /// of it. With z up, 0 is at x and 90 at y; with y up, 0 is at z and 90 at x.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    azimuth: Option<f64>,
    /// How high it stands above the horizon, in degrees, -90 to 90. Left out, 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    elevation: Option<f64>,
    /// The box that fills the picture; left out, that around the extract at each step. Goes with
    /// `azimuth`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    bounds: Option<BoxRegion>,
    /// The direction that is up in the picture, of any length but 0.
    #[serde(default = "upwards")]
    up: Vector,
    /// Whether it sees along parallel rays. What is at the distance of the focal point looks as
    /// large as without.
    #[serde(default)]
    parallel: bool,
    /// The angle that the height of the picture spans, in degrees, 1 to 150.
    #[serde(default = "angle")]
    angle: f64,
    /// How many times larger all is shown.
    #[serde(default = "one")]
    zoom: f64,
}

fn upwards() -> Vector {
    [0.0, 0.0, 1.0]
}
fn angle() -> f64 {
    30.0
}
fn one() -> f64 {
    1.0
}

impl Camera {
    /// One that sees all of an extract from a direction, z being up.
    #[must_use]
    pub fn around(azimuth: f64, elevation: f64) -> Self {
        let viewpoint = Viewpoint::Around { azimuth, elevation, bounds: None };
        Self { name: None, viewpoint, up: upwards(), parallel: false, angle: angle(), zoom: one() }
    }
}

impl TryFrom<CameraKeys> for Camera {
    type Error = String;

    fn try_from(keys: CameraKeys) -> Result<Self, String> {
        let CameraKeys { name, up, parallel, angle, zoom, elevation, bounds, .. } = keys;
        let viewpoint = match (keys.position, keys.focal_point, keys.azimuth) {
            (Some(position), Some(focal_point), None) => {
                if elevation.is_some() || bounds.is_some() {
                    return Err("found `elevation` or `bounds`, which go with `azimuth`".into());
                }
                Viewpoint::At { position, focal_point }
            }
            (Some(_), None, None) => return Err("the key `focal_point` is missing".into()),
            (None, Some(_), None) => return Err("the key `position` is missing".into()),
            (None, None, Some(azimuth)) => {
                Viewpoint::Around { azimuth, elevation: elevation.unwrap_or(0.0), bounds }
            }
            (None, None, None) => {
                return Err(
                    "found no viewpoint, expected `position` with `focal_point`, or `azimuth`"
                        .into(),
                );
            }
            _ => return Err("found `azimuth` and `position` or `focal_point`".into()),
        };
        Ok(Self { name, viewpoint, up, parallel, angle, zoom })
    }
}

impl From<Camera> for CameraKeys {
    fn from(Camera { name, viewpoint, up, parallel, angle, zoom }: Camera) -> Self {
        let keys = Self {
            name,
            position: None,
            focal_point: None,
            azimuth: None,
            elevation: None,
            bounds: None,
            up,
            parallel,
            angle,
            zoom,
        };
        match viewpoint {
            Viewpoint::At { position, focal_point } => {
                Self { position: Some(position), focal_point: Some(focal_point), ..keys }
            }
            Viewpoint::Around { azimuth, elevation, bounds } => {
                Self { azimuth: Some(azimuth), elevation: Some(elevation), bounds, ..keys }
            }
        }
    }
}

/// Cameras all around, at equal angles, for each of some elevations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Orbit {
    /// How many cameras stand around at each elevation, the first at azimuth 0: 1 to 360.
    pub azimuths: u32,
    /// The elevations in degrees, whole numbers, -90 to 90.
    #[serde(default = "horizon")]
    pub elevations: Vec<i32>,
    /// The direction that is up in the picture, of any length but 0.
    #[serde(default = "upwards")]
    pub up: Vector,
    /// Whether they see along parallel rays.
    #[serde(default)]
    pub parallel: bool,
}

fn horizon() -> Vec<i32> {
    vec![20]
}

impl Camera {
    pub(super) fn check(&self) -> Result<(), Problem> {
        let known = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
        if let Some(name) = &self.name
            && (name.is_empty() || name.len() > 64 || !name.chars().all(known))
        {
            let message = "expected a name of 1 to 64 letters, digits, `-`, `_` or `.`";
            return Err(Problem::new(message).within("name"));
        }
        check_direction(self.up, "up")?;
        match self.viewpoint {
            Viewpoint::At { position, focal_point } => {
                check_point(position, "position")?;
                check_point(focal_point, "focal_point")?;
                if position == focal_point {
                    let message = "found the same point as `position`, expected another";
                    return Err(Problem::new(message).within("focal_point"));
                }
            }
            Viewpoint::Around { azimuth, elevation, bounds } => {
                finite(azimuth).map_err(|problem| problem.within("azimuth"))?;
                check_between(elevation, [-90.0, 90.0], "elevation")?;
                if let Some(BoxRegion { lower, upper }) = bounds {
                    check_box(lower, upper, true).map_err(|problem| problem.within("bounds"))?;
                }
            }
        }
        check_between(self.angle, [1.0, 150.0], "angle")?;
        check_between(self.zoom, [1e-3, 1e6], "zoom")
    }
}

impl Orbit {
    pub(super) fn check(&self) -> Result<(), Problem> {
        check_between(f64::from(self.azimuths), [1.0, 360.0], "azimuths")?;
        if self.elevations.is_empty() {
            return Err(Problem::new("expected at least one elevation").within("elevations"));
        }
        CAMERAS
            .check(self.elevations.len())
            .map_err(|it| Problem::from(it).within("elevations"))?;
        for (index, &elevation) in self.elevations.iter().enumerate() {
            if !(-90..=90).contains(&elevation) {
                let message = format!("found {elevation}, expected a number from -90 to 90");
                return Err(Problem::new(message).at(index).within("elevations"));
            }
        }
        check_direction(self.up, "up")
    }
}

fn check_between(value: f64, [least, most]: [f64; 2], key: &str) -> Result<(), Problem> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    let message = format!("found {value}, expected a number from {least} to {most}");
    Err(Problem::new(message).within(key))
}
