//! Plans for requests, and those that were made last.

use std::{collections::VecDeque, sync::Arc};

use tombolo_deform::shape::{Forecast, Judged, Plan, Refused, Request, ShapeSeconds, Shaper};
use tombolo_deform::{
    mesh::Vector,
    quality::{Guard, Otherwise, judge_unless},
};
use tombolo_pipelines::language::Deformation;

/// Plans that are remembered: that of a forecast and that of the next order of a file.
const REMEMBERED: usize = 2;

/// A request, and the solver's own motion that its shapes are judged with.
#[derive(Debug, Clone)]
pub(crate) struct PlanRequest {
    pub(crate) request: Request,
    /// The motion that the solver itself has added to the present shape.
    pub(crate) own: Option<Arc<[Vector]>>,
}

impl PlanRequest {
    pub(crate) fn is(&self, other: &Self) -> bool {
        let same_own = match (&self.own, &other.own) {
            (None, None) => true,
            (Some(own), Some(other)) => Arc::ptr_eq(own, other),
            _ => false,
        };
        let (mine, theirs) = (&self.request, &other.request);
        let same_start = Arc::ptr_eq(&mine.start.points, &theirs.start.points) && same_own;
        same_start && mine.schedule == theirs.schedule && mine.ends_like(theirs)
    }
}

/// Why an order is not carried out, and what it took to find out.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Rejection {
    pub(crate) reason: String,
    /// The least scaled Jacobian on the way, where the guard did not let it through.
    pub(crate) min_scaled_jacobian: Option<f64>,
    /// The fraction that would have passed.
    pub(crate) fraction: Option<f64>,
    /// The place at which it failed.
    pub(crate) place: Option<Vector>,
    pub(crate) seconds: ShapeSeconds,
    /// Whether it was given up, of which nothing follows for the next such order.
    pub(crate) is_cancelled: bool,
}

impl<T: ToString> From<T> for Rejection {
    fn from(reason: T) -> Self {
        Self {
            reason: reason.to_string(),
            min_scaled_jacobian: None,
            fraction: None,
            place: None,
            seconds: ShapeSeconds::default(),
            is_cancelled: false,
        }
    }
}

impl Rejection {
    /// The rejection of what the kernel refuses, in these words.
    fn of(refused: &Refused, reason: String) -> Self {
        let (min_scaled_jacobian, fraction) =
            (refused.min_scaled_jacobian(), refused.feasible_fraction());
        let is_cancelled = refused.is_cancelled();
        let place = refused.place();
        Self { min_scaled_jacobian, fraction, place, is_cancelled, ..Self::from(reason) }
    }
}

/// The kernel, and the plans that it has made last: what a forecast or a look ahead has found
/// serves the order itself.
pub(crate) struct Planner {
    shaper: Shaper,
    known: VecDeque<(PlanRequest, Result<Plan, Rejection>)>,
}

impl Planner {
    pub(crate) fn new(shaper: Shaper) -> Self {
        Self { shaper, known: VecDeque::new() }
    }

    pub(crate) fn shaper(&self) -> &Shaper {
        &self.shaper
    }

    /// The plan for a request. Whether it was made now or before, it is the same bits.
    pub(crate) fn plan(&mut self, asked: &PlanRequest) -> Result<Plan, Rejection> {
        if let Some((_, plan)) = self.known.iter().find(|(known, _)| known.is(asked)) {
            return plan.clone();
        }
        // How far a clamped shape goes depends on where it is reached from.
        let same_end = |(known, plan): &&(PlanRequest, Result<Plan, Rejection>)| {
            plan.is_ok()
                && known.request.ends_like(&asked.request)
                && asked.request.guard.otherwise != Otherwise::Clamp
        };
        let target = match self.known.iter().find(same_end) {
            Some((_, Ok(plan))) => Some(plan.target().clone()),
            _ => None,
        };
        let PlanRequest { request, own } = asked;
        let Request { start, schedule, guard, .. } = request;
        let shaper = &mut self.shaper;
        let plan = match target {
            Some(target) => caught(shaper, |shaper| shaper.go(start, &target, schedule, guard)),
            None => caught(shaper, |shaper| shaper.plan(request)),
        };
        let plan = plan.and_then(|plan| match own {
            Some(own) if plan.judged() == Judged::Volume => self.with_own_motion(plan, own, guard),
            _ => Ok(plan),
        });
        let plan =
            plan.map_err(|rejection| Rejection { seconds: self.shaper.spent(), ..rejection });
        if plan.as_ref().is_err_and(|rejection| rejection.is_cancelled) {
            return plan;
        }
        if self.known.len() >= REMEMBERED {
            self.known.pop_front();
        }
        self.known.push_back((asked.clone(), plan.clone()));
        plan
    }

    /// Judges a plan of the mesh that will be there: each shape and the solver's own motion up to
    /// now.
    fn with_own_motion(
        &self,
        plan: Plan,
        own: &[Vector],
        guard: &Guard,
    ) -> Result<Plan, Rejection> {
        let moved = |shape: &Arc<[Vector]>| -> Vec<Vector> {
            let sum = |(shape, own): (&Vector, &Vector)| {
                std::array::from_fn(|axis| shape[axis] + own[axis])
            };
            shape.iter().zip(own).map(sum).collect()
        };
        for ends in plan.way().windows(2) {
            let (start, end) = (moved(&ends[0]), moved(&ends[1]));
            let (domain, cancellation) = (self.shaper.domain(), self.shaper.cancellation());
            let judged = judge_unless(domain, &start, &end, &[1.0], guard, cancellation);
            if let Err(refusal) = judged {
                let refused = Refused::from(refusal);
                return Err(Rejection::of(
                    &refused,
                    format!("with the mesh's own motion {refused}"),
                ));
            }
        }
        Ok(plan)
    }

    /// The forecast of a request.
    pub(crate) fn forecast(&mut self, asked: &PlanRequest) -> Forecast {
        match self.plan(asked) {
            Ok(plan) => self.shaper.forecast_of(&plan),
            Err(Rejection { reason, min_scaled_jacobian, fraction, place, seconds, .. }) => {
                Forecast::rejected(reason, fraction, min_scaled_jacobian, seconds).at(place)
            }
        }
    }

    /// Sets the operator of the volume up. One that cannot be made is reported by the order that
    /// needs it.
    pub(crate) fn prepare(&mut self, deform: &Deformation) {
        let _ = caught(&mut self.shaper, |shaper| shaper.prepare(deform));
    }
}

/// Runs a piece of the kernel so that a fault in it rejects one order instead of ending the solver.
/// A panic leaves at worst a cache without its entry. In parts it goes through, because the ranks
/// that did not panic wait for this one.
fn caught<T>(
    shaper: &mut Shaper,
    attempt: impl FnOnce(&mut Shaper) -> Result<T, Refused>,
) -> Result<T, Rejection> {
    let attempted = if shaper.domain().communicator().size() > 1 {
        Ok(attempt(shaper))
    } else {
        std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| attempt(shaper)))
    };
    match attempted {
        Ok(result) => result.map_err(|refused| Rejection::of(&refused, refused.to_string())),
        Err(panic) => {
            let message = panic
                .downcast_ref::<&str>()
                .map(|text| (*text).to_owned())
                .or_else(|| panic.downcast_ref::<String>().cloned())
                .unwrap_or_else(|| "no reason given".into());
            Err(Rejection::from(format!(
                "the geometry kernel failed, which is a defect of it: {message}"
            )))
        }
    }
}

#[cfg(test)]
mod tests {
    use tombolo_deform::{
        edit::Edit, features::FeatureSettings, shapes::box_of_tets, surface::Surface,
    };

    use super::*;

    #[test]
    fn what_was_planned_before_is_not_planned_again() {
        let mesh = Arc::new(box_of_tets([3, 3, 3], [0.0; 3], [1.0; 3]));
        let surface = Arc::new(Surface::extract(&mesh, &FeatureSettings::default()).unwrap());
        let mut planner = Planner::new(Shaper::new(mesh, surface).unwrap());
        let reference = Arc::clone(planner.shaper().reference());
        let stack = |by: f64| -> Vec<Edit> {
            serde_json::from_value(serde_json::json!([
                {"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0.0, 0.0, by]}}
            ]))
            .unwrap()
        };
        let asked = |by: f64| PlanRequest {
            request: Request::new(stack(by), Arc::clone(&reference)),
            own: None,
        };
        let forecast = planner.forecast(&asked(-0.2));
        let plan = planner.plan(&asked(-0.2)).unwrap();
        assert_eq!(planner.known.len(), 1);
        assert_eq!(forecast.min_scaled_jacobian, Some(plan.quality().min_scaled_jacobian));
        // From elsewhere: the same end by a way of its own.
        let aside = planner.plan(&asked(0.1)).unwrap();
        let there = aside.reached(1.0, Arc::clone(aside.end()));
        let from_there = PlanRequest { request: Request::new(stack(-0.2), there), own: None };
        let again = planner.plan(&from_there).unwrap();
        assert!(Arc::ptr_eq(again.end(), plan.end()) && Arc::ptr_eq(again.start(), aside.end()));
        let mut fresh = Planner::new(
            Shaper::new(planner.shaper.mesh(), Arc::clone(planner.shaper.surface().unwrap()))
                .unwrap(),
        );
        assert_eq!(*fresh.plan(&from_there).unwrap().way(), *again.way());
        assert!(planner.plan(&asked(-3.0)).is_err());
        assert_eq!(planner.known.len(), REMEMBERED);
    }
}
