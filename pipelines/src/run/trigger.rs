//! When the actions of a pipeline are taken: a condition that must last, and may not flap.

use tombolo_deform::communicator::{Garbled, Reader, Writer};
use tombolo_deform::schedule::Every;

use super::due::SLACK;
use crate::language::{AgainAfter, Condition, Pipeline, Problem, Scope, Slot};

/// The condition of a pipeline and what became of it.
#[derive(Debug)]
pub(super) struct Trigger {
    condition: Option<Condition>,
    lasting: Option<Every>,
    again: Option<Again>,
    /// Since when the condition has held.
    since: Option<Moment>,
    /// When the actions were taken last.
    fired: Option<Moment>,
    /// Whether they may be taken.
    is_armed: bool,
}

/// A cycle and its time.
type Moment = (u64, f64);

#[derive(Debug)]
enum Again {
    After(Every),
    Once(Condition),
}

impl Trigger {
    /// # Errors
    /// A [`Problem`] of a condition.
    pub(super) fn new(pipeline: &Pipeline, scope: &Scope<'_>) -> Result<Self, Problem> {
        let parse = |text: &String| Condition::parse(text, scope);
        let condition = pipeline.when.as_ref().map(parse).transpose();
        let again = match &pipeline.again_after {
            None => None,
            Some(AgainAfter::Steps(steps)) => Some(Again::After(Every::Steps(*steps))),
            Some(AgainAfter::Time(time)) => Some(Again::After(Every::Time(*time))),
            Some(AgainAfter::Condition(text)) => {
                Some(Again::Once(parse(text).map_err(|problem| problem.within("again_after"))?))
            }
        };
        Ok(Self {
            condition: condition.map_err(|problem| problem.within("when"))?,
            lasting: pipeline.lasting,
            again,
            since: None,
            fired: None,
            is_armed: true,
        })
    }

    /// Takes over what the same condition has come to.
    pub(super) fn go_on_from(&mut self, before: &Self) {
        (self.since, self.fired, self.is_armed) = (before.since, before.fired, before.is_armed);
    }

    /// Writes down what became of the condition.
    pub(super) fn save(&self, writer: &mut Writer) {
        for moment in [self.since, self.fired] {
            let (cycle, time) = moment.unwrap_or((u64::MAX, 0.0));
            writer.u64(cycle);
            writer.f64s(&[time]);
        }
        writer.u8(self.is_armed.into());
    }

    /// Goes on from what was written down.
    pub(super) fn restore(&mut self, reader: &mut Reader<'_>) -> Result<(), Garbled> {
        let mut moment = || -> Result<Option<Moment>, Garbled> {
            let (cycle, time) = (reader.u64()?, reader.f64s(1)?[0]);
            Ok((cycle != u64::MAX).then_some((cycle, time)))
        };
        (self.since, self.fired) = (moment()?, moment()?);
        self.is_armed = reader.u8()? != 0;
        Ok(())
    }

    /// Forgets since when the condition has held: whether it still does is not known.
    pub(super) fn lapse(&mut self) {
        self.since = None;
    }

    /// Whether the actions are taken now.
    pub(super) fn fires(&mut self, now: Moment, value: impl Fn(&Slot) -> f64) -> bool {
        let holds = self.condition.as_ref().is_none_or(|condition| condition.holds(&value));
        match (&self.again, self.fired) {
            (Some(Again::After(every)), Some(fired)) => {
                self.is_armed = has_passed(*every, fired, now)
            }
            (Some(Again::Once(condition)), Some(_)) => self.is_armed |= condition.holds(&value),
            _ => {}
        }
        if !holds {
            self.since = None;
            return false;
        }
        let since = *self.since.get_or_insert(now);
        let fires = self.is_armed && self.lasting.is_none_or(|every| has_passed(every, since, now));
        if fires {
            self.fired = Some(now);
            self.is_armed = self.again.is_none();
        }
        fires
    }
}

/// Whether so many steps, or so much time, lie between two moments.
fn has_passed(every: Every, since: Moment, now: Moment) -> bool {
    match every {
        Every::Steps(steps) => now.0.saturating_sub(since.0) >= steps.get(),
        Every::Time(time) => (now.1 - since.1) / time.get() + SLACK >= 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::language::{Monitored, parse};

    /// The cycles at which a pipeline acts that watches a parameter.
    fn acts(keys: &str, values: &[f64]) -> Vec<u64> {
        let text = format!(
            r#"{{"version": 1, "pipelines": [{{"name": "a", "stages": [], {keys}, "then": [{{"stop": {{}}}}]}}]}}"#
        );
        let config = parse(&text, "test.json").unwrap_or_else(|error| panic!("{error}"));
        let monitored = Monitored::of(&config.pipelines);
        let mut trigger = Trigger::new(&config.pipelines[0], &monitored.scope(0)).unwrap();
        let mut found = Vec::new();
        for (cycle, &value) in (0..).zip(values) {
            if trigger.fires((cycle, 0.1 * cycle as f64), |_| value) {
                found.push(cycle);
            }
        }
        found
    }

    #[test]
    fn a_condition_must_last_and_does_not_flap() {
        let noisy = [0.0, 9.0, 0.0, 9.0, 9.0, 9.0, 9.0, 4.0, 9.0, 9.0, 9.0, 1.0, 9.0, 9.0, 9.0];
        let when = r#""when": "parameter.x > 5""#;
        let with = |keys: &str| acts(&format!("{when}{keys}"), &noisy);
        assert_eq!(with(""), [1, 3, 4, 5, 6, 8, 9, 10, 12, 13, 14]);
        assert_eq!(with(r#", "for": {"steps": 2}"#), [5, 6, 10, 14]);
        // Ten tenths of a second add up to a little less than one.
        assert_eq!(with(r#", "for": {"time": 0.2}"#), [5, 6, 10, 14]);
        assert_eq!(with(r#", "again_after": {"steps": 4}"#), [1, 5, 9, 13]);
        assert_eq!(with(r#", "again_after": {"time": 0.4}"#), [1, 5, 9, 13]);
        let again = r#", "again_after": {"condition": "parameter.x < 2"}"#;
        assert_eq!(with(again), [1, 3, 12]);
        assert_eq!(with(&format!(r#", "for": {{"steps": 2}}{again}"#)), [5, 14]);
        // What is not known does not hold, and breaks what held.
        assert_eq!(
            acts(&format!(r#"{when}, "for": {{"steps": 2}}"#), &[9.0, 9.0, f64::NAN, 9.0]),
            [0; 0]
        );
        assert_eq!(acts(r#""again_after": {"steps": 3}"#, &[0.0; 8]), [0, 3, 6]);
    }
}
