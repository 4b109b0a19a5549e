//! The settings of volume motion.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::VolumeError;

/// How the motion of the boundary is carried into the volume.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Deform {
    /// The equation that is solved for the displacement.
    pub method: Method,
    /// How much stiffer small cells are than large ones: the stiffness of a cell is (mean volume /
    /// volume) to this power. 0 is a uniform material; 1 keeps thin boundary layers more nearly
    /// rigid and bends the cells about them the more. 0 to 4.
    #[schemars(range(min = 0.0, max = 4.0))]
    pub stiffening: f64,
    /// Poisson's ratio of the elastic material: how far it resists a change of volume. Above -1 and
    /// below 0.5; for `elasticity` only.
    #[schemars(extend("exclusiveMinimum" = -1.0, "exclusiveMaximum" = 0.5))]
    pub poisson_ratio: f64,
    /// The relative residual at which the iterative solve stops. Above 0, at most 0.1.
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 0.1))]
    pub tolerance: f64,
    /// How often the vertices inside are gone through after the solve, at most: each moves to
    /// where its worst cells are more like those of the reference. Vertices whose cells have all
    /// kept 95 % of their scaled Jacobian stay, and all do where moving them would gain nothing. 0
    /// leaves the shape as it was solved for. 0 to 100.
    #[schemars(range(min = 0, max = 100))]
    pub improve: u32,
}

/// The equation for the displacement.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Linear elasticity: the three components of the displacement are one coupled problem. The
    /// better choice for thin cells at walls.
    Elasticity,
    /// Laplace's equation for each component by itself; a component that moves nowhere costs
    /// nothing. The cheaper choice for motion along one axis.
    Harmonic,
}

impl Default for Deform {
    /// Elasticity, stiffening 0.5, Poisson's ratio 0.2, tolerance 1e-8, 10 sweeps of improvement.
    fn default() -> Self {
        Self {
            method: Method::Elasticity,
            stiffening: 0.5,
            poisson_ratio: 0.2,
            tolerance: 1e-8,
            improve: 10,
        }
    }
}

impl Deform {
    /// Refuses values out of range, and NaN, by name.
    ///
    /// # Errors
    /// [`VolumeError::Setting`].
    pub fn validate(&self) -> Result<(), VolumeError> {
        let refuse = |name, value, expected| Err(VolumeError::Setting { name, value, expected });
        if !(0.0..=4.0).contains(&self.stiffening) {
            return refuse("stiffening", self.stiffening, "from 0 to 4");
        }
        if !(self.poisson_ratio > -1.0 && self.poisson_ratio < 0.5) {
            return refuse("poisson_ratio", self.poisson_ratio, "above -1 and below 0.5");
        }
        if !(self.tolerance > 0.0 && self.tolerance <= 0.1) {
            return refuse("tolerance", self.tolerance, "above 0 and at most 0.1");
        }
        if self.improve > 100 {
            return refuse("improve", f64::from(self.improve), "from 0 to 100");
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_visible_and_unknown_names_refused() {
        let deform: Deform = serde_json::from_str(r#"{"method": "harmonic"}"#).unwrap();
        assert_eq!(deform, Deform { method: Method::Harmonic, ..Deform::default() });
        let message =
            serde_json::from_str::<Deform>(r#"{"stiffness": 1}"#).unwrap_err().to_string();
        assert!(message.contains("stiffness") && message.contains("stiffening"), "{message}");
        let schema = serde_json::to_value(schemars::schema_for!(Deform)).unwrap();
        assert_eq!(schema["properties"]["poisson_ratio"]["default"], 0.2);
        assert_eq!(schema["properties"]["method"]["default"], "elasticity");
    }

    #[test]
    fn values_out_of_range_are_refused_by_name() {
        let good = Deform::default();
        for (bad, name) in [
            (Deform { stiffening: f64::NAN, ..good }, "stiffening"),
            (Deform { stiffening: -1.0, ..good }, "stiffening"),
            (Deform { poisson_ratio: 0.5, ..good }, "poisson_ratio"),
            (Deform { tolerance: 0.0, ..good }, "tolerance"),
            (Deform { tolerance: f64::INFINITY, ..good }, "tolerance"),
            (Deform { improve: 101, ..good }, "improve"),
        ] {
            assert!(bad.validate().unwrap_err().to_string().contains(name));
        }
        assert_eq!(good.validate(), Ok(()));
    }
}
