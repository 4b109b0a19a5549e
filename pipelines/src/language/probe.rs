//! The stage that takes fields at points, and the rules that it keeps to.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tombolo_deform::mesh::Vector;

use super::Problem;
use super::extracts::{check_box, check_point, check_points};
use crate::limits::PROBES;

/// The fields at given points. Points in no cell are left out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "ProbeKeys", into = "ProbeKeys")]
pub struct Probe {
    /// The points.
    pub at: ProbeAt,
    /// How a value is found.
    pub method: ProbeMethod,
}

/// The points of a probe.
#[derive(Debug, Clone, PartialEq)]
pub enum ProbeAt {
    /// These points.
    Points(Vec<Vector>),
    /// Points at equal distances on a line.
    Line(ProbeLine),
    /// The points of a grid.
    Grid(ProbeGrid),
}

/// Points at equal distances on a line.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ProbeLine {
    /// The first point.
    pub from: Vector,
    /// The last point.
    pub to: Vector,
    /// How many points there are, the ends among them: at least 2.
    pub count: usize,
}

/// Points at equal distances in a box along the axes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ProbeGrid {
    /// The corner with the least coordinates.
    pub lower: Vector,
    /// The corner with the greatest coordinates.
    pub upper: Vector,
    /// How many points lie along each axis, the ends among them. With 1 they lie at `lower`.
    pub counts: [usize; 3],
}

/// How a value at a point is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ProbeMethod {
    /// Vertex fields are interpolated in the cell that the point lies in; of element fields the
    /// value of that cell is taken.
    #[default]
    Interpolated,
    /// The value at the nearest vertex of the cell that the point lies in, or of that cell.
    Nearest,
}

/// A probe as it stands in JSON.
#[derive(Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct ProbeKeys {
    /// These points. One of `points`, `line` and `grid` is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    points: Option<Vec<Vector>>,
    /// Points at equal distances on a line.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    line: Option<ProbeLine>,
    /// Points at equal distances in a box along the axes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    grid: Option<ProbeGrid>,
    /// How a value is found.
    #[serde(default)]
    method: ProbeMethod,
}

impl TryFrom<ProbeKeys> for Probe {
    type Error = String;

    fn try_from(keys: ProbeKeys) -> Result<Self, String> {
        let ProbeKeys { points, line, grid, method } = keys;
        let at = [points.map(ProbeAt::Points), line.map(ProbeAt::Line), grid.map(ProbeAt::Grid)];
        let mut given = at.into_iter().flatten();
        match (given.next(), given.next()) {
            (Some(at), None) => Ok(Self { at, method }),
            (None, _) => Err("found no points, expected `points`, `line` or `grid`".into()),
            _ => Err("found more than one of `points`, `line` and `grid`".into()),
        }
    }
}

impl From<Probe> for ProbeKeys {
    fn from(Probe { at, method }: Probe) -> Self {
        let keys = Self { method, ..Self::default() };
        match at {
            ProbeAt::Points(points) => Self { points: Some(points), ..keys },
            ProbeAt::Line(line) => Self { line: Some(line), ..keys },
            ProbeAt::Grid(grid) => Self { grid: Some(grid), ..keys },
        }
    }
}

impl Probe {
    pub(super) fn check(&self) -> Result<(), Problem> {
        match &self.at {
            ProbeAt::Points(points) => {
                if points.is_empty() {
                    return Err(Problem::new("expected at least one point").within("points"));
                }
                PROBES.check(points.len()).map_err(|it| Problem::from(it).within("points"))?;
                check_points(points)
            }
            ProbeAt::Line(line) => line.check().map_err(|problem| problem.within("line")),
            ProbeAt::Grid(grid) => grid.check().map_err(|problem| problem.within("grid")),
        }
    }
}

impl ProbeLine {
    pub(super) fn check(&self) -> Result<(), Problem> {
        check_point(self.from, "from")?;
        check_point(self.to, "to")?;
        if self.count < 2 {
            let message = format!("found {}, expected at least 2 points", self.count);
            return Err(Problem::new(message).within("count"));
        }
        PROBES.check(self.count).map_err(|exceeded| Problem::from(exceeded).within("count"))
    }
}

impl ProbeGrid {
    pub(super) fn check(&self) -> Result<(), Problem> {
        check_box(self.lower, self.upper, true)?;
        if let Some(axis) = self.counts.iter().position(|&count| count == 0) {
            let message = "found 0, expected at least 1 point";
            return Err(Problem::new(message).at(axis).within("counts"));
        }
        let count = self.counts.iter().fold(1_usize, |all, &count| all.saturating_mul(count));
        PROBES.check(count).map_err(|exceeded| Problem::from(exceeded).within("counts"))
    }
}
