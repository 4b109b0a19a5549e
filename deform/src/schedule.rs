//! In how many shapes, and when, a new shape of the domain is reached.

use std::num::{NonZeroU32, NonZeroU64};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::limits::{Exceeded, SHAPES};
use crate::number::Number;

/// How a change of shape is spread over the run: in `steps` shapes, one `every` so many cycles or
/// so much simulated time, at equal distances or eased.
///
/// # Example
/// ```
/// use tombolo_deform::schedule::Schedule;
///
/// let schedule: Schedule = serde_json::from_str(r#"{"steps": 4, "every": {"steps": 10}}"#).unwrap();
/// assert_eq!(schedule.fractions(), [0.25, 0.5, 0.75, 1.0]);
/// let steps = |cycles| schedule.position(cycles, 0.0, 0.1);
/// assert_eq!([steps(0), steps(4), steps(9)], [0.1, 0.5, 1.0], "ten steps go to the first shape");
/// assert_eq!([steps(24), steps(39), steps(40)], [2.5, 4.0, 4.0]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Schedule {
    /// How many shapes lie between the present one (not counted) and the new one (counted). At
    /// least 1.
    #[schemars(range(max = SHAPES.most), extend("x-label" = "shapes"))]
    pub steps: NonZeroU32,
    /// The distance between one shape and the next: solver steps, or simulated time.
    #[schemars(extend("x-label" = "one every"))]
    pub every: Every,
    /// How far apart the shapes lie.
    #[schemars(extend("x-label" = "pace", "x-advanced" = true))]
    pub ease: Ease,
    /// How the mesh goes from one shape to the next.
    #[schemars(extend("x-label" = "between shapes", "x-advanced" = true))]
    pub motion: Motion,
}

/// How the mesh goes from one shape of a schedule to the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Motion {
    /// At one mesh velocity, over all steps until the next shape is due. The guard's floor holds at
    /// the shapes; between them no cell is turned inside out.
    #[default]
    Spread,
    /// In one step, and then the mesh rests until the next shape is due: an impulse for the flow.
    AtOnce,
}

/// How the shapes of a [`Schedule`] lie on the way.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Ease {
    /// At equal distances: the mesh sets off and stops at full speed.
    #[default]
    Linear,
    /// Closer together at both ends (the smooth step `3 s² - 2 s³`): the mesh sets off and stops
    /// gently, and is 1.5 times as fast in the middle.
    Smooth,
}

/// The distance between two shapes of a [`Schedule`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Every {
    /// This many solver steps. At least 1.
    Steps(NonZeroU64),
    /// This much simulated time, in the solver's unit. Above 0.
    Time(Interval),
}

/// A length of simulated time: finite and above 0.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "f64", into = "f64")]
#[schemars(extend("exclusiveMinimum" = 0))]
pub struct Interval(f64);

/// A length of time that is not above 0, or not a finite number.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("{} is not a length of time; it must be a finite number above 0", Number(*.0))]
pub struct IntervalError(f64);

impl Interval {
    /// This length of time.
    ///
    /// # Errors
    /// [`IntervalError`] unless it is finite and above 0.
    pub fn new(time: f64) -> Result<Self, IntervalError> {
        if time.is_finite() && time > 0.0 { Ok(Self(time)) } else { Err(IntervalError(time)) }
    }

    /// The length, in the solver's unit of time.
    #[must_use]
    pub fn get(self) -> f64 {
        self.0
    }
}

impl TryFrom<f64> for Interval {
    type Error = IntervalError;

    fn try_from(time: f64) -> Result<Self, IntervalError> {
        Self::new(time)
    }
}

impl From<Interval> for f64 {
    fn from(interval: Interval) -> f64 {
        interval.0
    }
}

impl Default for Schedule {
    /// The whole change at once.
    fn default() -> Self {
        Self {
            steps: NonZeroU32::MIN,
            every: Every::Steps(NonZeroU64::MIN),
            ease: Ease::Linear,
            motion: Motion::Spread,
        }
    }
}

impl Schedule {
    /// How far along the way from the present shape to the new one each shape lies: `k / steps` for
    /// `k` in `1..=steps`, eased, the last exactly 1.
    #[must_use]
    pub fn fractions(&self) -> Vec<f64> {
        (1..=self.steps.get()).map(|step| self.fraction(step)).collect()
    }

    /// Whether it has as few shapes as are allowed.
    ///
    /// # Errors
    /// [`Exceeded`] for more than [`SHAPES`].
    pub fn check(&self) -> Result<(), Exceeded> {
        SHAPES.check(usize::try_from(self.steps.get()).unwrap_or(usize::MAX))
    }

    /// How far along the way shape `step` lies (from 1; 0 is the present shape, and beyond the last
    /// is the last).
    #[must_use]
    pub fn fraction(&self, step: u32) -> f64 {
        let even = f64::from(step.min(self.steps.get())) / f64::from(self.steps.get());
        match self.ease {
            Ease::Linear => even,
            Ease::Smooth => even * even * (3.0 - 2.0 * even),
        }
    }

    /// Where the mesh is to be at the end of a step, counted in shapes: 0 is where the schedule
    /// begins, 2.5 half way from the second shape to the third. The step begins `cycles` and `time`
    /// after the schedule, and takes `time_step`.
    ///
    /// Time is compared with a slack of one part in 10⁹ of the interval, so that adding up time
    /// steps does not make a shape a step late. In a steady solver, whose steps take no time, shapes
    /// that are due at a time are reached at once.
    #[must_use]
    pub fn position(&self, cycles: u64, time: f64, time_step: f64) -> f64 {
        let position = match (self.every, self.motion) {
            (Every::Steps(steps), Motion::Spread) => (real(cycles) + 1.0) / real(steps.get()),
            (Every::Steps(steps), Motion::AtOnce) => real(cycles / steps) + 1.0,
            (Every::Time(Interval(interval)), Motion::Spread) if time_step > 0.0 => {
                let position = (time + time_step) / interval;
                let whole = position.round();
                if (position - whole).abs() <= SLACK { whole } else { position }
            }
            (Every::Time(Interval(interval)), _) => (time / interval + SLACK).floor() + 1.0,
        };
        position.clamp(0.0, f64::from(self.steps.get()))
    }
}

/// The tolerance of comparisons of time, as a fraction of the interval.
const SLACK: f64 = 1e-9;

/// A count as a number.
#[expect(clippy::cast_precision_loss, reason = "fewer than 2^53 cycles")]
fn real(count: u64) -> f64 {
    count as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Schedule, String> {
        serde_json::from_str(text).map_err(|error| error.to_string())
    }

    #[test]
    fn nothing_said_means_all_at_once() {
        assert_eq!(parse("{}").unwrap(), Schedule::default());
        assert_eq!(Schedule::default().fractions(), [1.0]);
    }

    #[test]
    fn the_last_fraction_is_exactly_one() {
        for (steps, ease) in [1, 3, 7, 10, 49, 100, 1013]
            .into_iter()
            .flat_map(|n| [(n, Ease::Linear), (n, Ease::Smooth)])
        {
            let schedule =
                Schedule { steps: NonZeroU32::new(steps).unwrap(), ease, ..Schedule::default() };
            let fractions = schedule.fractions();
            assert_eq!(fractions.len(), steps as usize);
            assert!(fractions.windows(2).all(|pair| pair[0] < pair[1]));
            assert_eq!(fractions.last().unwrap().to_bits(), 1.0f64.to_bits());
        }
    }

    #[test]
    fn an_eased_schedule_starts_and_stops_gently() {
        let schedule = parse(r#"{"steps": 4, "ease": "smooth"}"#).unwrap();
        assert_eq!(schedule.fractions(), [0.15625, 0.5, 0.84375, 1.0]);
        assert!(parse(r#"{"ease": "fast"}"#).unwrap_err().contains("smooth"));
    }

    #[test]
    fn senseless_schedules_are_refused() {
        for (text, named) in [
            (r#"{"steps": 0}"#, "nonzero"),
            (r#"{"every": {"steps": 0}}"#, "nonzero"),
            (r#"{"every": {"time": 0}}"#, "above 0"),
            (r#"{"every": {"time": -1.5}}"#, "-1.5"),
            (r#"{"every": {"cycles": 3}}"#, "cycles"),
            (r#"{"step": 3}"#, "step"),
        ] {
            let message = parse(text).unwrap_err();
            assert!(message.contains(named), "{text}: {message}");
        }
        assert!(Interval::new(f64::NAN).is_err() && Interval::new(f64::INFINITY).is_err());
    }

    #[test]
    fn a_way_is_spread_over_its_steps_or_made_in_one() {
        let at = |text: &str, cycles: std::ops::Range<u64>| -> Vec<f64> {
            let schedule = parse(text).unwrap();
            cycles.map(|cycle| schedule.position(cycle, 0.0, 0.1)).collect()
        };
        let spread = at(r#"{"steps": 2, "every": {"steps": 4}}"#, 0..10);
        assert_eq!(spread, [0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0, 2.0, 2.0]);
        let at_once = at(r#"{"steps": 2, "every": {"steps": 4}, "motion": "at_once"}"#, 0..6);
        assert_eq!(at_once, [1.0, 1.0, 1.0, 1.0, 2.0, 2.0]);
        // Each shape is reached exactly, however many steps its way takes.
        for steps in [3, 7, 10, 49] {
            let text = format!(r#"{{"steps": 5, "every": {{"steps": {steps}}}}}"#);
            let reached = at(&text, 0..5 * steps).into_iter().filter(|at| at.fract() == 0.0);
            assert_eq!(reached.collect::<Vec<_>>(), [1.0, 2.0, 3.0, 4.0, 5.0]);
        }
    }

    #[test]
    fn shapes_are_reached_by_time_in_spite_of_rounding() {
        for (motion, expected) in [("spread", [2, 5, 8, 11]), ("at_once", [0, 3, 6, 9])] {
            let text = format!(r#"{{"steps": 4, "every": {{"time": 0.3}}, "motion": "{motion}"}}"#);
            let schedule = parse(&text).unwrap();
            let (mut time, mut before, mut reached) = (0.0, 0.0, Vec::new());
            for cycle in 0..20 {
                let position = schedule.position(cycle, time, 0.1);
                assert!(position >= before);
                if position.fract() == 0.0 && position > before {
                    reached.push(cycle);
                }
                before = position;
                time += 0.1;
            }
            assert_eq!(reached, expected, "{motion}");
        }
        let steady = parse(r#"{"steps": 2, "every": {"time": 0.3}}"#).unwrap();
        assert_eq!([0.0, 0.3].map(|time| steady.position(0, time, 0.0)), [1.0, 2.0]);
    }

    #[test]
    fn round_trips_and_has_a_schema() {
        let schedule = parse(r#"{"steps": 3, "every": {"time": 0.25}}"#).unwrap();
        assert_eq!(parse(&serde_json::to_string(&schedule).unwrap()).unwrap(), schedule);
        let schema = serde_json::to_string(&schemars::schema_for!(Schedule)).unwrap();
        assert!(schema.contains("exclusiveMinimum"), "{schema}");
        assert!(schema.contains("\"default\""), "{schema}");
    }
}
