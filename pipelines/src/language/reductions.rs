//! The stages that reduce an extract, the mesh or other monitors to monitors, and the rules that
//! they keep to.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tombolo_deform::mesh::Vector;
use tombolo_deform::schedule::Interval;

use super::derived::check_name;
use super::error::{above_zero, finite, none_twice};
use super::extracts::check_point;
use super::{Problem, nearest};
use crate::limits::{BINS, HISTORY};

/// A field to measure: monitors `<name>.min`, `.max`, `.mean`, `.l2` (of the magnitude, for a
/// vector) and `.non_finite`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Statistics {
    /// The field's name.
    pub field: String,
    /// The name that its monitors begin with; left out, that of the field.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// The unit of the field, as files, reports and viewers show it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
}

/// Integrals over the extract, or over the whole mesh where no stage has taken one.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Integrate {
    /// The name that its monitors begin with.
    pub name: String,
    /// After `surface`: the features to integrate over; left out, the whole surface.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub features: Vec<String>,
    /// A scalar field: monitors `<name>.integral` and `<name>.mean`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub field: Option<String>,
    /// A vector field: monitors `<name>.integral.x`, `.y`, `.z` and `<name>.mean.x`, `.y`, `.z`;
    /// after `surface`, `slice` or `contour` also `<name>.flow_rate`, the flux through the faces.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vector: Option<String>,
    /// The unit of the means.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// The units of other monitors, by what follows the name: `{"flow_rate": "m3/s"}`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub units: BTreeMap<String, String>,
}

/// How the values of a field are spread: monitors `<name>.lower` and `.upper` (the range),
/// `<name>.below` and `.above` (what lies outside of it), and `<name>.bins.0`, `.1` ... Of a vector
/// the magnitude counts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Histogram {
    /// The name that its monitors begin with.
    pub name: String,
    /// The field.
    pub field: String,
    /// How many bins the range is divided into, all of the same width.
    #[serde(default = "default_bins")]
    #[schemars(range(min = 1, max = BINS.most))]
    pub bins: u32,
    /// The least and the largest value of the bins, which a value of either belongs to; left out,
    /// those of the field at each time it is measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub range: Option<[f64; 2]>,
    /// The weight of a value.
    #[serde(default)]
    pub by: Weight,
    /// After `surface`: the features that count; left out, the whole surface.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub features: Vec<String>,
    /// The unit of the field.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
}

fn default_bins() -> u32 {
    16
}

/// The weight of a value in a histogram.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Weight {
    /// 1 for each vertex, or cell where it is a field of elements.
    #[default]
    Count,
    /// The length, area or volume of the cell; of a vertex its part of that of the cells around.
    Size,
}

/// The force of the fluid on a surface or its features, and its moment: monitors `<name>.x`, `.y`,
/// `.z`, `<name>.moment.x`, `.y`, `.z` and `<name>.size` (the area); with `pressure` also
/// `<name>.pressure.x`, `.y`, `.z` and `<name>.mean_pressure`; with `velocity` also
/// `<name>.viscous.x`, `.y`, `.z`.
///
/// With the outward normal `n` of the mesh the force on a piece of wall is
/// `density * (p n - viscosity (G + G^T) n)` times its area, `G` being the velocity's gradient as
/// `gradient` has it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Force {
    /// The name that its monitors begin with.
    pub name: String,
    /// The features that the force acts on; left out, the whole surface.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub features: Vec<String>,
    /// The field of the pressure. At least one of `pressure` and `velocity` is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pressure: Option<String>,
    /// The pressure on the other side, which is taken off.
    #[serde(default)]
    pub reference_pressure: f64,
    /// The field of the velocity; with it `viscosity` is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity: Option<String>,
    /// The dynamic viscosity, a number or the name of a scalar field; of a solver whose pressure is
    /// over the density the kinematic one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub viscosity: Option<Viscosity>,
    /// The factor of both parts: the density, for a solver that divides its pressure by it.
    #[serde(default = "one")]
    pub density: f64,
    /// The point that the moment is about.
    #[serde(default)]
    pub about: Vector,
    /// The unit of the force.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// The units of other monitors, by what follows the name: `{"moment": "N m"}` is that of
    /// `moment.x`, `.y` and `.z`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub units: BTreeMap<String, String>,
}

fn one() -> f64 {
    1.0
}

/// A viscosity: the same everywhere, or a field.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected a number or the name of a field")]
pub enum Viscosity {
    /// A constant.
    Number(f64),
    /// The name of a scalar field.
    Field(String),
}

/// The shear that the flow exerts on the wall, along the flow: the field of elements
/// `-density * viscosity (G + G^T) n` without its part along the normal `n`, on the faces of the
/// surface; `G` is the velocity's gradient as `gradient` has it, the mean of the face's vertices.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WallShearStress {
    /// The field of the velocity.
    pub velocity: String,
    /// The dynamic viscosity, or the kinematic one beside a `density`.
    pub viscosity: Viscosity,
    /// The factor of the stress.
    #[serde(default = "one")]
    pub density: f64,
    /// The name of the new field; left out, that of the stage.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
}

/// The difference between two monitors: the monitor `<name>`, such as a pressure drop.
///
/// Monitors of other pipelines have the value that was measured last; a pipeline that stands before
/// in the file and is due at the same step has measured its own already.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Difference {
    /// The name of the monitor.
    pub name: String,
    /// A monitor of a stage before, or of another pipeline: `inlet.mean`, or `duct/inlet.mean`
    /// where several pipelines have one of that name.
    pub of: String,
    /// The monitor that is taken off.
    pub minus: String,
    /// The unit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
}

/// A monitor or a field over time: its mean, the root of its mean square, its least and largest
/// value. Exactly one of `monitor` and `field` is given.
///
/// Each time the pipeline runs is one measurement; between two of them a value is taken to change
/// evenly, so that time steps may vary. A NaN of a monitor is passed over; where a field has one,
/// there is no value until the window has left it.
///
/// Of a monitor they are the monitors `<name>.mean`, `.rms`, `.min`, `.max` and `.time`, the time
/// that they cover. Of a field they are the fields `<name>_mean`, `<name>_rms`, `<name>_min` and
/// `<name>_max`, for each component by itself; the stage then stands before the source stage, as
/// those that derive fields do, and begins anew when the cells change.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TimeStatistics {
    /// The name that its monitors or fields begin with.
    pub name: String,
    /// A monitor of a stage before, or of another pipeline.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub monitor: Option<String>,
    /// A field of vertices or elements.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub field: Option<String>,
    /// How far they reach back in simulated time; left out, to the first measurement. Of a field
    /// the window moves on by a quarter of itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub window: Option<Interval>,
    /// Which are kept; left out, all four. Each takes the memory of the field, five times with a
    /// `window`.
    #[serde(default = "all_measures")]
    pub measures: Vec<Measure>,
    /// The unit of the monitor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
}

fn all_measures() -> Vec<Measure> {
    vec![Measure::Mean, Measure::Rms, Measure::Min, Measure::Max]
}

/// A statistic of a value over time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// The mean over time.
    Mean,
    /// The root of the mean square over time.
    Rms,
    /// The least value.
    Min,
    /// The largest value.
    Max,
}

impl Measure {
    /// Its name in JSON.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Measure::Mean => "mean",
            Measure::Rms => "rms",
            Measure::Min => "min",
            Measure::Max => "max",
        }
    }
}

/// The frequencies in a monitor: `<name>.frequency` and `.amplitude` of the strongest, `.resolution`
/// (the distance between two), and `<name>.power.0`, `.1` ..., the power spectral density at
/// multiples of it, whose sum times the resolution is the variance.
///
/// It is the periodogram of the last `samples` measurements less their mean, under a Hann window;
/// before there are as many, all are NaN. Where time steps vary, the values are interpolated at even
/// times first, and that is said once.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Spectrum {
    /// The name that its monitors begin with.
    pub name: String,
    /// A monitor of a stage before, or of another pipeline.
    pub monitor: String,
    /// How many measurements are looked at: a power of two.
    #[serde(default = "default_samples")]
    #[schemars(range(min = 8, max = HISTORY.most))]
    pub samples: u32,
    /// The unit of the monitor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
}

fn default_samples() -> u32 {
    256
}

impl Statistics {
    /// The name that its monitors begin with.
    #[must_use]
    pub fn name(&self) -> &str {
        self.name.as_deref().unwrap_or(&self.field)
    }

    pub(super) fn check(&self) -> Result<(), Problem> {
        let Some(name) = &self.name else {
            if ["quality", "decimate", "cycle", "time", "parameter"].contains(&self.field.as_str())
            {
                let message = "a field of this name cannot be told from other monitors, expected a \
                               `name` beside it";
                return Err(Problem::new(message).within("field"));
            }
            return Ok(());
        };
        check_monitor(name)
    }
}

impl Integrate {
    pub(super) fn check(&self, is_after_surface: bool) -> Result<(), Problem> {
        check_monitor(&self.name)?;
        check_units(&self.units, &["size", "integral", "mean", "flow_rate"])?;
        check_features(&self.features, is_after_surface)
    }
}

impl Histogram {
    pub(super) fn check(&self, is_after_surface: bool) -> Result<(), Problem> {
        check_monitor(&self.name)?;
        check_features(&self.features, is_after_surface)?;
        if self.bins == 0 {
            return Err(Problem::new("expected at least one bin").within("bins"));
        }
        BINS.check(self.bins as usize)
            .map_err(|exceeded| Problem::from(exceeded).within("bins"))?;
        let Some([lower, upper]) = self.range else { return Ok(()) };
        for (index, bound) in [lower, upper].into_iter().enumerate() {
            finite(bound).map_err(|problem| problem.at(index).within("range"))?;
        }
        if lower < upper && (upper - lower).is_finite() {
            return Ok(());
        }
        let message = format!("found {lower}, expected less than `range[1]`: {upper}");
        Err(Problem::new(message).at(0).within("range"))
    }
}

impl Force {
    pub(super) fn check(&self, is_after_surface: bool) -> Result<(), Problem> {
        check_monitor(&self.name)?;
        if !is_after_surface {
            return Err(Problem::new(
                "expected a `surface` stage before it, which a force acts on",
            ));
        }
        check_features(&self.features, true)?;
        check_units(&self.units, &["moment", "size", "mean_pressure"])?;
        let numbers = [("reference_pressure", self.reference_pressure), ("density", self.density)];
        for (key, number) in numbers {
            finite(number).map_err(|problem| problem.within(key))?;
        }
        check_point(self.about, "about")?;
        match (&self.pressure, &self.velocity, &self.viscosity) {
            (None, None, None) => Err(Problem::new(
                "found no cause of a force, expected `pressure`, or `velocity` \
                                  with `viscosity`",
            )),
            (_, Some(_), None) => Err(Problem::new("found `velocity` without `viscosity`")),
            (_, None, Some(_)) => {
                Err(Problem::new("found `viscosity` without `velocity`").within("viscosity"))
            }
            (_, _, Some(viscosity)) => viscosity.check(),
            _ => Ok(()),
        }
    }
}

impl Viscosity {
    fn check(&self) -> Result<(), Problem> {
        match self {
            Viscosity::Number(number) => finite(*number).map_err(|it| it.within("viscosity")),
            Viscosity::Field(_) => Ok(()),
        }
    }

    /// The field, where it is one.
    pub(crate) fn field(&self) -> Option<&str> {
        match self {
            Viscosity::Number(_) => None,
            Viscosity::Field(name) => Some(name),
        }
    }
}

impl WallShearStress {
    /// The name of the new field.
    #[must_use]
    pub fn name(&self) -> &str {
        self.name.as_deref().unwrap_or("wall_shear_stress")
    }

    pub(super) fn check(&self, is_after_surface: bool) -> Result<(), Problem> {
        check_name(self.name()).map_err(|problem| problem.within("name"))?;
        if !is_after_surface {
            return Err(Problem::new(
                "expected a `surface` stage before it, whose faces are walls",
            ));
        }
        finite(self.density).map_err(|problem| problem.within("density"))?;
        self.viscosity.check()
    }
}

impl TimeStatistics {
    pub(super) fn check(&self) -> Result<(), Problem> {
        check_monitor(&self.name)?;
        if self.monitor.is_some() == self.field.is_some() {
            return Err(Problem::new("expected exactly one of `monitor` and `field`"));
        }
        if self.measures.is_empty() {
            return Err(Problem::new("expected at least one measure").within("measures"));
        }
        none_twice(&self.measures, "measure").map_err(|problem| problem.within("measures"))
    }

    /// The names of the fields that it makes, with what each holds; none of a monitor.
    pub(crate) fn fields(&self) -> impl Iterator<Item = (String, Measure)> + '_ {
        let measures = self.field.iter().flat_map(|_| &self.measures);
        measures.map(|&measure| (format!("{}_{}", self.name, measure.name()), measure))
    }
}

impl Spectrum {
    pub(super) fn check(&self) -> Result<(), Problem> {
        check_monitor(&self.name)?;
        let samples = self.samples as usize;
        HISTORY.check(samples).map_err(|exceeded| Problem::from(exceeded).within("samples"))?;
        if samples.is_power_of_two() && samples >= 8 {
            return Ok(());
        }
        let near = samples.max(8).next_power_of_two().min(HISTORY.most);
        let message = format!("found {samples}, expected a power of two of at least 8, as {near}");
        Err(Problem::new(message).within("samples"))
    }
}

/// Checks the name that monitors begin with.
pub(super) fn check_monitor(name: &str) -> Result<(), Problem> {
    let check = check_name(name).and_then(|()| match name.contains('/') {
        true => Err(Problem::new("found a `/`, which stands behind the name of a pipeline")),
        false => Ok(()),
    });
    check.map_err(|problem| problem.within("name"))
}

/// Checks that units are those of monitors.
fn check_units(units: &BTreeMap<String, String>, known: &[&str]) -> Result<(), Problem> {
    match units.keys().find(|key| !known.contains(&key.as_str())) {
        None => Ok(()),
        Some(key) => {
            let known = known.iter().copied();
            let all = known.clone().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
            let message = format!("found `{key}`, expected one of {all}");
            Err(Problem::new(message).suggest(nearest(key, known)).within("units"))
        }
    }
}

fn check_features(features: &[String], is_after_surface: bool) -> Result<(), Problem> {
    if !features.is_empty() && !is_after_surface {
        let message = "found features, which are those of a `surface` stage before it";
        return Err(Problem::new(message).within("features"));
    }
    none_twice(features, "feature").map_err(|problem| problem.within("features"))
}

/// Fewer triangles for viewers and files that come after it: of a surface, or of the outside of
/// volumes.
///
/// Vertices are taken out one by one, the one that bends the surface least first. Those that are
/// left, and their fields, are exact. Borders and those between features stay where they are. What
/// `render` draws and `integrate` adds up is not touched.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Decimate {
    /// The part of the triangles that is left, above 0 and at most 1.
    #[serde(default = "tenth")]
    pub fraction: f64,
    /// By how much a face that is gone may lie beside what is left, in units of the mesh; left out,
    /// there is no bound but the fraction.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<f64>,
}

fn tenth() -> f64 {
    0.1
}

impl Decimate {
    pub(super) fn check(&self) -> Result<(), Problem> {
        if !(self.fraction > 0.0 && self.fraction <= 1.0) {
            let message = format!("found {}, expected a number above 0, at most 1", self.fraction);
            return Err(Problem::new(message).within("fraction"));
        }
        self.error.map_or(Ok(()), above_zero).map_err(|problem| problem.within("error"))
    }
}
