//! The stage that shows a field by small bodies, and the rules that it keeps to.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tombolo_deform::mesh::Vector;

use super::error::above_zero;
use super::{ProbeGrid, ProbeLine, Problem, SeedFeatures, SeedPlane, Seeds};
use crate::limits::GLYPHS;

/// Arrows or spheres in the mesh, as triangles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "GlyphsKeys", into = "GlyphsKeys")]
pub struct Glyphs {
    /// The shape of each glyph.
    pub shape: GlyphShape,
    /// The vertex field that arrows point along, and that scales.
    pub field: Option<String>,
    /// Whether a glyph is as large as its field against the largest of all.
    pub scaled: bool,
    /// The length of the largest; `None` for a twentieth of the mesh's diagonal.
    pub size: Option<f64>,
    /// Where they stand.
    pub at: GlyphsAt,
}

/// Where glyphs stand.
#[derive(Debug, Clone, PartialEq)]
pub enum GlyphsAt {
    /// At about so many vertices, spread evenly over the box around the mesh.
    Spread(usize),
    /// At every nth vertex by its number in the whole mesh.
    Every(usize),
    /// At these points.
    Points(Seeds),
}

/// The shape of a glyph.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum GlyphShape {
    /// An arrow along the field, whose tail is at its point.
    #[default]
    Arrow,
    /// A sphere around its point; its size is the diameter.
    Sphere,
}

/// Glyphs as they stand in JSON.
#[derive(Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct GlyphsKeys {
    /// The shape of each glyph.
    #[serde(default)]
    shape: GlyphShape,
    /// The vertex field that arrows point along, of 2 or 3 components, and that scales; spheres
    /// need none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    field: Option<String>,
    /// Whether a glyph is as large as its field against the largest of all. Otherwise all are
    /// alike.
    #[serde(default = "yes")]
    scaled: bool,
    /// The length of the largest in units of the mesh; left out, a twentieth of the mesh's diagonal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    size: Option<f64>,
    /// About how many there are: the vertices nearest to the middles of so many boxes of equal
    /// size. Left out, and without `every` and points, 500.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    count: Option<usize>,
    /// One at every nth vertex, by its number in the whole mesh.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    every: Option<usize>,
    /// At these points. Of `count`, `every`, `points`, `line`, `grid`, `plane` and `features` at
    /// most one is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    points: Option<Vec<Vector>>,
    /// At equal distances on a line.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    line: Option<ProbeLine>,
    /// On a grid along the axes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    grid: Option<ProbeGrid>,
    /// On a parallelogram.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    plane: Option<SeedPlane>,
    /// Spread over features of the surface.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    features: Option<SeedFeatures>,
}

fn yes() -> bool {
    true
}

impl TryFrom<GlyphsKeys> for Glyphs {
    type Error = String;

    fn try_from(keys: GlyphsKeys) -> Result<Self, String> {
        let GlyphsKeys { shape, field, scaled, size, .. } = keys;
        let GlyphsKeys { points, line, grid, plane, features, .. } = keys;
        let vertices = [keys.count.map(GlyphsAt::Spread), keys.every.map(GlyphsAt::Every)];
        let seeds = Seeds::given(points, line, grid, plane, features).map(GlyphsAt::Points);
        let mut given = vertices.into_iter().flatten().chain(seeds);
        let at = given.next().unwrap_or(GlyphsAt::Spread(500));
        if given.next().is_some() {
            return Err("found more than one of `count`, `every`, `points`, `line`, `grid`, \
                        `plane` and `features`"
                .into());
        }
        if field.is_none() && shape == GlyphShape::Arrow {
            return Err("the key `field` is missing: arrows point along it".into());
        }
        Ok(Self { shape, field, scaled, size, at })
    }
}

impl From<Glyphs> for GlyphsKeys {
    fn from(Glyphs { shape, field, scaled, size, at }: Glyphs) -> Self {
        let mut keys = Self { shape, field, scaled, size, ..Self::default() };
        match at {
            GlyphsAt::Spread(count) => keys.count = Some(count),
            GlyphsAt::Every(every) => keys.every = Some(every),
            GlyphsAt::Points(Seeds::Points(points)) => keys.points = Some(points),
            GlyphsAt::Points(Seeds::Line(line)) => keys.line = Some(line),
            GlyphsAt::Points(Seeds::Grid(grid)) => keys.grid = Some(grid),
            GlyphsAt::Points(Seeds::Plane(plane)) => keys.plane = Some(plane),
            GlyphsAt::Points(Seeds::Features(features)) => keys.features = Some(features),
        }
        keys
    }
}

impl Glyphs {
    pub(super) fn check(&self) -> Result<(), Problem> {
        match &self.at {
            GlyphsAt::Spread(0) => {
                return Err(Problem::new("expected at least one glyph").within("count"));
            }
            GlyphsAt::Spread(count) => {
                GLYPHS.check(*count).map_err(|it| Problem::from(it).within("count"))?;
            }
            GlyphsAt::Every(0) => {
                return Err(Problem::new("found 0, expected at least 1").within("every"));
            }
            GlyphsAt::Every(_) => {}
            GlyphsAt::Points(seeds) => seeds.check()?,
        }
        self.size.map_or(Ok(()), above_zero).map_err(|problem| problem.within("size"))
    }
}
