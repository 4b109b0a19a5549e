//! The forecast of an order: what it would give, without giving it.

use crate::mesh::Vector;
use crate::quality::{Change, Quality, change, quality};
use serde::{Deserialize, Serialize};

use super::{Judged, Plan, Request, ShapeSeconds, Shaper};

/// Whether an order would be carried out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// All of it.
    Applied,
    /// A part of it: [`Forecast::fraction`].
    Clamped,
    /// Nothing of it.
    Rejected,
}

/// The forecast of an order.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Forecast {
    /// Whether it would be carried out.
    pub outcome: Outcome,
    /// Why not.
    pub reason: Option<String>,
    /// The fraction that would be done; of an order that would be rejected, the fraction that would
    /// pass, where it is known.
    pub fraction: Option<f64>,
    /// The least scaled Jacobian of the shapes on the way.
    pub min_scaled_jacobian: Option<f64>,
    /// The place at which it would fail, where that is known: the worst cell before the change, or
    /// the first face of the surface that is broken.
    #[serde(default)]
    pub place: Option<Vector>,
    /// The part of every mesh on the way that was judged; `None` where the order would be rejected.
    pub judged: Option<Judged>,
    /// The longest way that a vertex of the surface would go, in units of the mesh.
    pub largest_displacement: Option<f64>,
    /// In how many shapes it would be reached.
    pub shapes: u32,
    /// Sub-steps that its shape takes beyond one solve from the reference.
    pub sub_steps: usize,
    /// The quality of the mesh in the end.
    pub quality: Option<Quality>,
    /// The quality of the mesh where the order would begin.
    #[serde(default)]
    pub quality_before: Option<Quality>,
    /// How its cells differ from those of the reference mesh.
    pub change: Option<Change>,
    /// Seconds that it took to find out.
    pub seconds: ShapeSeconds,
}

impl Shaper {
    /// The outcome of [`Shaper::plan`]. Nothing is changed by asking; what is set up on the way
    /// serves the order itself.
    ///
    /// ```
    /// use std::sync::Arc;
    /// use tombolo_deform::{shapes::box_of_tets, edit::Edit, features::FeatureSettings, surface::Surface};
    /// use tombolo_deform::shape::{Outcome, Request, Shaper};
    ///
    /// let mesh = Arc::new(box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]));
    /// let surface = Arc::new(Surface::extract(&mesh, &FeatureSettings::default())?);
    /// let mut shaper = Shaper::new(mesh, surface)?;
    /// let edits: Vec<Edit> = serde_json::from_value(serde_json::json!([
    ///     {"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0.0, 0.0, -2.0]}}
    /// ]))?;
    /// let here = Arc::clone(shaper.reference());
    /// let forecast = shaper.forecast(&Request::new(edits, here));
    /// assert_eq!(forecast.outcome, Outcome::Rejected);
    /// assert!(forecast.fraction.is_some_and(|fraction| fraction > 0.1 && fraction < 0.5));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn forecast(&mut self, request: &Request) -> Forecast {
        match self.plan(request) {
            Ok(plan) => self.forecast_of(&plan),
            Err(refused) => Forecast::rejected(
                refused.to_string(),
                refused.feasible_fraction(),
                refused.min_scaled_jacobian(),
                self.spent(),
            )
            .at(refused.place()),
        }
    }

    /// The forecast of a plan. Collective, as the plan was.
    #[must_use]
    pub fn forecast_of(&self, plan: &Plan) -> Forecast {
        let target = plan.target();
        let volume = plan.judged() == Judged::Volume;
        let domain = &self.body.domain;
        let cells = domain.mesh().cells();
        let quality_of = |points| volume.then(|| quality(cells, points).gathered(domain));
        Forecast {
            outcome: if target.fraction < 1.0 { Outcome::Clamped } else { Outcome::Applied },
            reason: None,
            fraction: Some(target.fraction),
            min_scaled_jacobian: plan.min_scaled_jacobian(),
            place: None,
            judged: Some(plan.judged()),
            largest_displacement: Some(plan.largest_displacement()),
            shapes: plan.shapes(),
            sub_steps: target.sub_steps,
            quality: quality_of(plan.end()),
            quality_before: quality_of(plan.start()),
            change: volume.then(|| change(domain, plan.end())),
            seconds: plan.seconds(),
        }
    }
}

impl Forecast {
    /// The forecast of an order that would be rejected; `fraction` of it would pass.
    #[must_use]
    pub fn rejected(
        reason: String,
        fraction: Option<f64>,
        min_scaled_jacobian: Option<f64>,
        seconds: ShapeSeconds,
    ) -> Self {
        Self {
            outcome: Outcome::Rejected,
            reason: Some(reason),
            fraction,
            min_scaled_jacobian,
            place: None,
            judged: None,
            largest_displacement: None,
            shapes: 0,
            sub_steps: 0,
            quality: None,
            quality_before: None,
            change: None,
            seconds,
        }
    }

    /// The forecast with the place at which it would fail.
    #[must_use]
    pub fn at(self, place: Option<Vector>) -> Self {
        Self { place, ..self }
    }
}
