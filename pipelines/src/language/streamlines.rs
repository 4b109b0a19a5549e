//! The stage that follows a flow, and the rules that it keeps to.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tombolo_deform::mesh::Vector;

use super::error::above_zero;
use super::extracts::{check_point, check_points};
use super::{ProbeGrid, ProbeLine, Problem};
use crate::limits::{SEEDS, STEPS};

/// Lines along a vector field, from seeds. The time from the seed is the field `integration_time`,
/// below 0 against the flow.
///
/// Integrated by the method of Dormand and Prince, of order 5, whose step is halved and doubled as
/// its estimate of the error says. A line ends at the boundary (to a thousandth of a cell), where
/// the field is 0, and by `max_length` and `max_steps`. Lines that have more than two million points
/// in the part of a rank are refused.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "StreamlinesKeys", into = "StreamlinesKeys")]
pub struct Streamlines {
    /// The vertex field that is followed, of 2 or 3 components.
    pub field: String,
    /// Where lines begin.
    pub seeds: Seeds,
    /// Which way they go.
    pub direction: Direction,
    /// The length of a line in each direction; `None` for 5 diagonals of the mesh.
    pub max_length: Option<f64>,
    /// The steps of a line in each direction.
    pub max_steps: usize,
    /// The error of a step, as part of the size of the cell.
    pub error: f64,
}

/// The places that streamlines begin at.
#[derive(Debug, Clone, PartialEq)]
pub enum Seeds {
    /// These points.
    Points(Vec<Vector>),
    /// Points at equal distances on a line.
    Line(ProbeLine),
    /// The points of a grid along the axes.
    Grid(ProbeGrid),
    /// Points of a plane.
    Plane(SeedPlane),
    /// Points spread over features of the surface by area, just inside.
    Features(SeedFeatures),
}

/// Points at equal distances on a parallelogram.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SeedPlane {
    /// A corner.
    pub origin: Vector,
    /// The corner at the other end of the first side.
    pub first: Vector,
    /// The corner at the other end of the second side.
    pub second: Vector,
    /// How many points lie along each side, the ends among them.
    pub counts: [usize; 2],
}

/// Points spread over features.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SeedFeatures {
    /// The features' names.
    pub names: Vec<String>,
    /// How many points there are.
    pub count: usize,
}

/// Which way streamlines go.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Direction {
    /// With the flow and against it.
    #[default]
    Both,
    /// With the flow.
    Forward,
    /// Against the flow.
    Backward,
}

/// Streamlines as they stand in JSON.
#[derive(Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct StreamlinesKeys {
    /// The vertex field that is followed, of 2 or 3 components.
    field: String,
    /// Seeds: these points. One of `points`, `line`, `grid`, `plane` and `features` is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    points: Option<Vec<Vector>>,
    /// Seeds at equal distances on a line.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    line: Option<ProbeLine>,
    /// Seeds on a grid along the axes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    grid: Option<ProbeGrid>,
    /// Seeds on a parallelogram.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    plane: Option<SeedPlane>,
    /// Seeds spread over features of the surface.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    features: Option<SeedFeatures>,
    /// Which way the lines go.
    #[serde(default)]
    direction: Direction,
    /// The length of a line in each direction, in units of the mesh; left out, 5 diagonals of the
    /// mesh.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    max_length: Option<f64>,
    /// The steps of a line in each direction.
    #[serde(default = "max_steps")]
    max_steps: usize,
    /// The error of a step, as part of the diagonal of the cell.
    #[serde(default = "error")]
    error: f64,
}

fn max_steps() -> usize {
    2000
}
fn error() -> f64 {
    1e-5
}

impl TryFrom<StreamlinesKeys> for Streamlines {
    type Error = String;

    fn try_from(keys: StreamlinesKeys) -> Result<Self, String> {
        let StreamlinesKeys { field, direction, max_length, max_steps, error, .. } = keys;
        let StreamlinesKeys { points, line, grid, plane, features, .. } = keys;
        let mut given = Seeds::given(points, line, grid, plane, features);
        match (given.next(), given.next()) {
            (Some(seeds), None) => {
                Ok(Self { field, seeds, direction, max_length, max_steps, error })
            }
            (None, _) => Err("found no seeds, expected `points`, `line`, `grid`, `plane` or \
                              `features`"
                .into()),
            _ => {
                Err("found more than one of `points`, `line`, `grid`, `plane` and `features`"
                    .into())
            }
        }
    }
}

impl From<Streamlines> for StreamlinesKeys {
    fn from(stage: Streamlines) -> Self {
        let Streamlines { field, seeds, direction, max_length, max_steps, error } = stage;
        let keys = Self { field, direction, max_length, max_steps, error, ..Self::default() };
        match seeds {
            Seeds::Points(points) => Self { points: Some(points), ..keys },
            Seeds::Line(line) => Self { line: Some(line), ..keys },
            Seeds::Grid(grid) => Self { grid: Some(grid), ..keys },
            Seeds::Plane(plane) => Self { plane: Some(plane), ..keys },
            Seeds::Features(features) => Self { features: Some(features), ..keys },
        }
    }
}

impl Seeds {
    /// Those of the keys that are there.
    pub(super) fn given(
        points: Option<Vec<Vector>>,
        line: Option<ProbeLine>,
        grid: Option<ProbeGrid>,
        plane: Option<SeedPlane>,
        features: Option<SeedFeatures>,
    ) -> impl Iterator<Item = Self> {
        let all = [
            points.map(Self::Points),
            line.map(Self::Line),
            grid.map(Self::Grid),
            plane.map(Self::Plane),
            features.map(Self::Features),
        ];
        all.into_iter().flatten()
    }

    pub(super) fn check(&self) -> Result<(), Problem> {
        let count = |count: usize, key: &str| {
            if count == 0 {
                return Err(Problem::new("expected at least one seed").within(key));
            }
            SEEDS.check(count).map_err(|exceeded| Problem::from(exceeded).within(key))
        };
        let located = |key: &'static str| move |problem: Problem| problem.within(key);
        match self {
            Seeds::Points(points) => {
                count(points.len(), "points")?;
                check_points(points)?;
            }
            Seeds::Line(line) => {
                line.check().map_err(located("line"))?;
                count(line.count, "line")?;
            }
            Seeds::Grid(grid) => {
                grid.check().map_err(located("grid"))?;
                count(grid.counts.iter().product(), "grid")?;
            }
            Seeds::Plane(plane) => {
                let points = [("origin", plane.origin), ("first", plane.first)];
                for (key, point) in points.into_iter().chain([("second", plane.second)]) {
                    check_point(point, key).map_err(located("plane"))?;
                }
                count(plane.counts[0].saturating_mul(plane.counts[1]), "plane")?;
            }
            Seeds::Features(features) => {
                if features.names.is_empty() {
                    let problem = Problem::new("expected at least one feature").within("names");
                    return Err(problem.within("features"));
                }
                count(features.count, "features")?;
            }
        }
        Ok(())
    }
}

impl Streamlines {
    pub(super) fn check(&self) -> Result<(), Problem> {
        self.seeds.check()?;
        self.max_length.map_or(Ok(()), above_zero).map_err(|it| it.within("max_length"))?;
        if self.max_steps == 0 {
            return Err(Problem::new("found 0, expected at least 1 step").within("max_steps"));
        }
        STEPS.check(self.max_steps).map_err(|it| Problem::from(it).within("max_steps"))?;
        if !(1e-12..=0.1).contains(&self.error) {
            let message = format!("found {}, expected a number from 1e-12 to 0.1", self.error);
            return Err(Problem::new(message).within("error"));
        }
        Ok(())
    }
}
