//! A case: the JSON that says what flows where.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use schemars::JsonSchema;
use serde::Deserialize;
use tombolo::Parameter;
use tombolo_deform::number;
use tombolo_deform::surface::Surface;
use tombolo_pipelines::expression::Expression;
use tombolo_pipelines::language::{
    LanguageError, Problem, ReadError, Validate, nearest, parse_valid, read_text,
};
use tombolo_pipelines::limits::DOCUMENT;

use crate::boundary::{Condition, Patch, Place, Value};
use crate::fluid::Fluid;

/// The names that every formula knows before the parameters.
const PLACE_NAMES: [&str; 4] = ["x", "y", "z", "t"];

/// A case file.
///
/// A number may also be a formula, as a string, of `x`, `y`, `z`, `t` and the names of the
/// parameters.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Case {
    /// A description of the case: the flow, and where its data are from.
    #[serde(default)]
    pub description: String,
    /// The mesh file, relative to the case file: `.msh`, `.vtu` or `.vtk`, of tetrahedra.
    pub mesh: PathBuf,
    /// Mass per volume. A formula may name parameters only.
    pub density: Number,
    /// The dynamic viscosity. A formula may name parameters only.
    pub viscosity: Number,
    /// The numbers that can be steered, by name.
    #[serde(default)]
    pub parameters: BTreeMap<String, ParameterRange>,
    /// The boundary condition on each feature of the mesh. Every feature must be named.
    pub boundary: BTreeMap<String, BoundaryCondition>,
    /// The state at time 0; left out, the fluid is at rest.
    #[serde(default)]
    pub initial: Initial,
    /// The length of a time step.
    #[schemars(range(min = 0.0))]
    pub time_step: f64,
    /// How many steps a run takes that is not told otherwise. With viewers a run goes on until it
    /// is stopped.
    pub steps: u64,
    /// The pipelines to use where none are given, relative to the case file.
    #[serde(default)]
    pub pipelines: Option<PathBuf>,
    /// The orders to carry out where none are given, relative to the case file.
    #[serde(default)]
    pub orders: Option<PathBuf>,
}

/// A number, or a formula for one.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Number {
    /// One value everywhere and always.
    Constant(f64),
    /// A formula.
    Formula(String),
}

impl Default for Number {
    fn default() -> Self {
        Number::Constant(0.0)
    }
}

/// A steerable number with its bounds.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ParameterRange {
    /// Its value at the start.
    pub value: f64,
    /// The least value it may take.
    pub minimum: f64,
    /// The greatest.
    pub maximum: f64,
}

/// The boundary condition on a feature.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum BoundaryCondition {
    /// The velocity, as three numbers or formulas.
    Velocity([Number; 3]),
    /// The pressure, with zero viscous traction.
    Pressure(Number),
    /// A wall, which takes the fluid with it when it moves.
    Wall(Wall),
}

/// How the fluid passes a wall.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Wall {
    /// It sticks to it.
    NoSlip,
    /// It slides along it without friction.
    Slip,
}

/// The state at time 0.
#[derive(Debug, Clone, PartialEq, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Initial {
    /// The velocity, as three numbers or formulas.
    pub velocity: [Number; 3],
    /// The pressure.
    pub pressure: Number,
}

/// Why a case cannot be run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CaseError {
    /// The file cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The file is not a case.
    #[error(transparent)]
    Language(#[from] LanguageError),
    /// A condition for a feature that the mesh does not have.
    #[error("{}: boundary: the mesh has no feature '{feature}'{}; its features are {}", file.display(), near.as_ref().map_or_else(String::new, |near| format!(" (did you mean '{near}'?)")), features.join(", "))]
    UnknownFeature {
        /// The case file.
        file: PathBuf,
        /// The name.
        feature: String,
        /// The name that was likely meant.
        near: Option<String>,
        /// All features of the mesh.
        features: Vec<String>,
    },
    /// A feature without a condition.
    #[error("{}: boundary: feature '{feature}' of the mesh has no condition; give it a velocity, a pressure or a wall", file.display())]
    NoCondition {
        /// The case file.
        file: PathBuf,
        /// The feature.
        feature: String,
    },
}

impl Case {
    /// Reads a case file; paths in it become relative to where the program runs.
    ///
    /// # Errors
    /// [`CaseError::Read`], or [`CaseError::Language`] with line, column and path.
    pub fn read(file: &Path) -> Result<Self, CaseError> {
        let mut case: Case = parse_valid(&read_text(file, DOCUMENT)?, &file.display().to_string())?;
        let folder = file.parent().unwrap_or(Path::new(""));
        case.mesh = folder.join(&case.mesh);
        case.pipelines = case.pipelines.map(|path| folder.join(path));
        case.orders = case.orders.map(|path| folder.join(path));
        Ok(case)
    }

    /// The parameters as the adaptor wants them, in the order in which formulas know them.
    #[must_use]
    pub fn declared_parameters(&self) -> Vec<Parameter> {
        let declare = |(name, range): (&String, &ParameterRange)| Parameter {
            name: name.clone(),
            value: range.value,
            minimum: range.minimum,
            maximum: range.maximum,
        };
        self.parameters.iter().map(declare).collect()
    }

    /// The fluid for these values of the parameters.
    #[must_use]
    pub fn fluid(&self, parameters: &[f64]) -> Fluid {
        let place = Place { position: [0.0; 3], time: 0.0, parameters };
        Fluid {
            density: self.value(&self.density).at(&place),
            viscosity: self.value(&self.viscosity).at(&place),
        }
    }

    /// The velocity and the pressure at time 0.
    #[must_use]
    pub fn initial_values(&self) -> ([Value; 3], Value) {
        (self.vector(&self.initial.velocity), self.value(&self.initial.pressure))
    }

    /// The conditions on the boundary of a mesh, one patch for each feature; `file` is the case's,
    /// for errors.
    ///
    /// # Errors
    /// [`CaseError::UnknownFeature`] with the near name, and [`CaseError::NoCondition`].
    pub fn patches(&self, file: &Path, surface: &Surface) -> Result<Vec<Patch>, CaseError> {
        let features = surface.features();
        for feature in self.boundary.keys() {
            if !features.names().contains(feature) {
                return Err(CaseError::UnknownFeature {
                    file: file.into(),
                    feature: feature.clone(),
                    near: nearest(feature, features.names().iter().map(String::as_str))
                        .map(str::to_owned),
                    features: features.names().to_vec(),
                });
            }
        }
        let mut patches = Vec::with_capacity(features.names().len());
        for name in features.names() {
            let condition = self.boundary.get(name).ok_or_else(|| CaseError::NoCondition {
                file: file.into(),
                feature: name.clone(),
            })?;
            let condition = match condition {
                BoundaryCondition::Velocity(velocity) => Condition::Velocity(self.vector(velocity)),
                BoundaryCondition::Pressure(pressure) => Condition::Pressure(self.value(pressure)),
                BoundaryCondition::Wall(Wall::NoSlip) => Condition::NoSlip,
                BoundaryCondition::Wall(Wall::Slip) => Condition::Slip,
            };
            patches.push(Patch { name: name.clone(), triangles: Vec::new(), condition });
        }
        for (triangle, &face) in surface.triangles().iter().zip(surface.triangle_faces()) {
            let feature = features.face_features()[face as usize];
            patches[feature as usize]
                .triangles
                .push(triangle.map(|vertex| surface.vertices()[vertex as usize]));
        }
        Ok(patches)
    }

    fn vector(&self, numbers: &[Number; 3]) -> [Value; 3] {
        [0, 1, 2].map(|axis: usize| self.value(&numbers[axis]))
    }

    fn value(&self, number: &Number) -> Value {
        let formula = match number {
            Number::Constant(value) => return Value::Uniform(*value),
            Number::Formula(formula) => formula,
        };
        // Formulas were parsed once when the case was read; one that still fails is no number,
        // which the solver tells.
        let Ok(expression) = Expression::parse(formula, &self.names()) else {
            return Value::Uniform(f64::NAN);
        };
        Value::Function(Arc::new(move |place| {
            let [x, y, z] = place.position;
            let mut values = vec![x, y, z, place.time];
            values.extend_from_slice(place.parameters);
            expression.evaluate(&values)
        }))
    }

    fn names(&self) -> Vec<&str> {
        PLACE_NAMES.into_iter().chain(self.parameters.keys().map(String::as_str)).collect()
    }

    fn check_number(&self, number: &Number) -> Result<(), Problem> {
        if let Number::Formula(formula) = number {
            Expression::parse(formula, &self.names())
                .map_err(|error| Problem::new(format!("in the formula `{formula}`: {error}")))?;
        }
        Ok(())
    }

    fn check_vector(&self, numbers: &[Number; 3]) -> Result<(), Problem> {
        for (axis, number) in numbers.iter().enumerate() {
            self.check_number(number).map_err(|problem| problem.at(axis))?;
        }
        Ok(())
    }

    /// A number of the fluid: positive at the start, and the same everywhere.
    fn check_property(&self, number: &Number) -> Result<(), Problem> {
        self.check_number(number)?;
        let parameters: Vec<&str> = self.parameters.keys().map(String::as_str).collect();
        if let Number::Formula(formula) = number
            && Expression::parse(formula, &parameters).is_err()
        {
            return Err(Problem::new(
                "the fluid is the same everywhere and always; found a formula of x, y, z or t",
            ));
        }
        let values: Vec<f64> = self.parameters.values().map(|range| range.value).collect();
        let place = Place { position: [0.0; 3], time: 0.0, parameters: &values };
        let found = self.value(number).at(&place);
        if !(found > 0.0 && found.is_finite()) {
            return Err(Problem::new(format!("found {found}, expected a positive number")));
        }
        Ok(())
    }
}

impl Validate for Case {
    fn validate(&self) -> Result<(), Problem> {
        for (name, range) in &self.parameters {
            let inside = |problem: Problem| problem.within(name).within("parameters");
            if PLACE_NAMES.contains(&name.as_str()) {
                return Err(inside(Problem::new(format!(
                    "`{name}` is a place or the time, and cannot name a parameter"
                ))));
            }
            Expression::parse(name, &[name])
                .map_err(|error| inside(Problem::new(format!("not a name: {error}"))))?;
            if !(range.minimum <= range.value && range.value <= range.maximum) {
                let message = format!(
                    "found {}, expected a number from {} to {}",
                    number::Number(range.value),
                    number::Number(range.minimum),
                    number::Number(range.maximum)
                );
                return Err(inside(Problem::new(message).within("value")));
            }
        }
        self.check_property(&self.density).map_err(|problem| problem.within("density"))?;
        self.check_property(&self.viscosity).map_err(|problem| problem.within("viscosity"))?;
        for (feature, condition) in &self.boundary {
            let checked = match condition {
                BoundaryCondition::Velocity(velocity) => {
                    self.check_vector(velocity).map_err(|problem| problem.within("velocity"))
                }
                BoundaryCondition::Pressure(pressure) => {
                    self.check_number(pressure).map_err(|problem| problem.within("pressure"))
                }
                BoundaryCondition::Wall(_) => Ok(()),
            };
            checked.map_err(|problem| problem.within(feature).within("boundary"))?;
        }
        let initial = |problem: Problem, key| problem.within(key).within("initial");
        self.check_vector(&self.initial.velocity)
            .map_err(|problem| initial(problem, "velocity"))?;
        self.check_number(&self.initial.pressure)
            .map_err(|problem| initial(problem, "pressure"))?;
        if self.time_step <= 0.0 {
            return Err(Problem::new(format!(
                "found {}, expected a positive number",
                number::Number(self.time_step)
            ))
            .within("time_step"));
        }
        Ok(())
    }
}
