//! What is asked of the kernel, and what it answered last.

use std::{collections::VecDeque, sync::Arc};

use tombolo_deform::{
    mesh::Vector,
    quality::{Guard, Otherwise, judge_in_parts},
    schedule::Schedule,
    surface::Edit,
};
use tombolo_pipelines::{
    language::DeformStage,
    shape::{Forecast, Judged, Place, Plan, Refused, ShapeSeconds, Shaper},
};

/// Plans that are remembered: that of a forecast and that of the next order of a file.
const REMEMBERED: usize = 2;

/// What a plan is made from.
#[derive(Debug, Clone)]
pub(crate) struct Wish {
    pub(crate) stack: Vec<Edit>,
    /// How many of them the present shape has already.
    pub(crate) kept: usize,
    pub(crate) start: Place,
    /// What the solver's own motion has added to the present shape.
    pub(crate) own: Option<Arc<[Vector]>>,
    pub(crate) deform: DeformStage,
    pub(crate) schedule: Schedule,
    pub(crate) guard: Guard,
}

impl Wish {
    /// Whether both ask for the same shape, wherever they start.
    fn ends_like(&self, other: &Self) -> bool {
        self.stack == other.stack
            && self.kept == other.kept
            && self.deform == other.deform
            && self.guard == other.guard
    }

    pub(crate) fn is(&self, other: &Self) -> bool {
        let same_own = match (&self.own, &other.own) {
            (None, None) => true,
            (Some(own), Some(other)) => Arc::ptr_eq(own, other),
            _ => false,
        };
        let same_start = Arc::ptr_eq(&self.start.points, &other.start.points) && same_own;
        same_start && self.schedule == other.schedule && self.ends_like(other)
    }
}

/// Why an order is not carried out, and what it took to find out.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Rejection {
    pub(crate) reason: String,
    /// What the way would have come down to, where the guard did not let it through.
    pub(crate) min_scaled_jacobian: Option<f64>,
    /// What fraction would have passed.
    pub(crate) fraction: Option<f64>,
    pub(crate) seconds: ShapeSeconds,
}

impl<T: ToString> From<T> for Rejection {
    fn from(reason: T) -> Self {
        Self {
            reason: reason.to_string(),
            min_scaled_jacobian: None,
            fraction: None,
            seconds: ShapeSeconds::default(),
        }
    }
}

/// The kernel, and the plans that it has made last: what a forecast or a look ahead has found serves the order itself.
pub(crate) struct Planner {
    shaper: Shaper,
    known: VecDeque<(Wish, Result<Plan, Rejection>)>,
}

impl Planner {
    pub(crate) fn new(shaper: Shaper) -> Self {
        Self { shaper, known: VecDeque::new() }
    }

    pub(crate) fn shaper(&self) -> &Shaper {
        &self.shaper
    }

    /// The plan for a wish. Whether it was made now or before, it is the same bits.
    pub(crate) fn plan(&mut self, wish: &Wish) -> Result<Plan, Rejection> {
        if let Some((_, plan)) = self.known.iter().find(|(known, _)| known.is(wish)) {
            return plan.clone();
        }
        // How far a clamped shape goes depends on where it is reached from.
        let same_end = |(known, plan): &&(Wish, Result<Plan, Rejection>)| {
            plan.is_ok() && known.ends_like(wish) && wish.guard.otherwise != Otherwise::Clamp
        };
        let target = match self.known.iter().find(same_end) {
            Some((_, Ok(plan))) => Some(plan.target().clone()),
            _ => None,
        };
        let Wish { stack, kept, start, own, deform, schedule, guard } = wish;
        let shaper = &mut self.shaper;
        let plan = match target {
            Some(target) => caught(shaper, |shaper| shaper.go(start, &target, schedule, guard)),
            None => {
                caught(shaper, |shaper| shaper.reach(stack, *kept, start, deform, schedule, guard))
            }
        };
        let plan = plan.and_then(|plan| match own {
            Some(own) if plan.judged() == Judged::Volume => self.with_own_motion(plan, own, guard),
            _ => Ok(plan),
        });
        let plan =
            plan.map_err(|rejection| Rejection { seconds: self.shaper.spent(), ..rejection });
        if self.known.len() >= REMEMBERED {
            self.known.pop_front();
        }
        self.known.push_back((wish.clone(), plan.clone()));
        plan
    }

    /// Judges a plan of the mesh that will be there: each shape and the solver's own motion up to now.
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
        let partition = &**self.shaper.partition();
        for ends in plan.way().windows(2) {
            let judged = judge_in_parts(
                self.shaper.mesh(),
                &moved(&ends[0]),
                &moved(&ends[1]),
                &[1.0],
                guard,
                partition,
            );
            if let Err(refusal) = judged {
                let refused = Refused::from(refusal);
                return Err(Rejection {
                    min_scaled_jacobian: refused.min_scaled_jacobian(),
                    fraction: refused.feasible_fraction(),
                    ..Rejection::from(format!("with the mesh's own motion {refused}"))
                });
            }
        }
        Ok(plan)
    }

    /// What a wish would come to.
    pub(crate) fn forecast(&mut self, wish: &Wish) -> Forecast {
        match self.plan(wish) {
            Ok(plan) => self.shaper.outlook(&plan),
            Err(Rejection { reason, min_scaled_jacobian, fraction, seconds }) => {
                Forecast::rejected(reason, fraction, min_scaled_jacobian, seconds)
            }
        }
    }

    /// Sets the operator of the volume up. One that cannot be made is reported by the order that needs it.
    pub(crate) fn prepare(&mut self, deform: &DeformStage) {
        let _ = caught(&mut self.shaper, |shaper| shaper.prepare(deform));
    }
}

/// Runs a piece of the kernel so that a fault in it rejects one order instead of ending the solver. A panic leaves at worst a
/// cache without its entry. In parts it goes through, because the ranks that did not panic wait for this one.
fn caught<T>(
    shaper: &mut Shaper,
    attempt: impl FnOnce(&mut Shaper) -> Result<T, Refused>,
) -> Result<T, Rejection> {
    let attempted = if shaper.partition().ranks() > 1 {
        Ok(attempt(shaper))
    } else {
        std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| attempt(shaper)))
    };
    match attempted {
        Ok(result) => result.map_err(|refused| Rejection {
            min_scaled_jacobian: refused.min_scaled_jacobian(),
            fraction: refused.feasible_fraction(),
            ..Rejection::from(&refused)
        }),
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
        quality::Guard,
        shapes::box_of_tets,
        surface::{FeatureSettings, Surface},
    };

    use super::*;

    #[test]
    fn what_was_planned_before_is_not_planned_again() {
        let mesh = Arc::new(box_of_tets([3, 3, 3], [0.0; 3], [1.0; 3]));
        let surface = Arc::new(Surface::extract(&mesh, &FeatureSettings::default()).unwrap());
        let mut planner = Planner::new(Shaper::new(mesh, surface).unwrap());
        let reference = Place::from(Arc::clone(planner.shaper().reference()));
        let wish = |by: f64| Wish {
            stack: serde_json::from_value(serde_json::json!([
                {"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0.0, 0.0, by]}}
            ]))
            .unwrap(),
            kept: 0,
            start: reference.clone(),
            own: None,
            deform: DeformStage::default(),
            schedule: Schedule::default(),
            guard: Guard::default(),
        };
        let forecast = planner.forecast(&wish(-0.2));
        let plan = planner.plan(&wish(-0.2)).unwrap();
        assert_eq!(planner.known.len(), 1);
        assert_eq!(forecast.min_scaled_jacobian, Some(plan.quality().min_scaled_jacobian));
        // From elsewhere: the same end by a way of its own.
        let aside = planner.plan(&wish(0.1)).unwrap();
        let from_there = Wish { start: aside.place(1, Arc::clone(aside.end())), ..wish(-0.2) };
        let again = planner.plan(&from_there).unwrap();
        assert!(Arc::ptr_eq(again.end(), plan.end()) && Arc::ptr_eq(again.start(), aside.end()));
        let mut fresh = Planner::new(
            Shaper::new(
                Arc::clone(planner.shaper.mesh()),
                Arc::clone(planner.shaper.surface().unwrap()),
            )
            .unwrap(),
        );
        assert_eq!(*fresh.plan(&from_there).unwrap().way(), *again.way());
        assert!(planner.plan(&wish(-3.0)).is_err());
        assert_eq!(planner.known.len(), REMEMBERED);
    }
}
