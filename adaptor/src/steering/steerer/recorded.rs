//! The positions of a journal, each handed out at its cycle.

use std::collections::{BTreeMap, HashMap};

use tombolo_pipelines::language::HandedShape;

/// Where on the way of each order the mesh was at which cycle.
#[derive(Debug, Default)]
pub(super) struct Recorded {
    positions: HashMap<String, BTreeMap<u64, f64>>,
    /// The last cycle of which the journal tells, where the run goes on by itself behind it; `None`
    /// where it is all that is carried out.
    until: Option<u64>,
}

impl Recorded {
    pub(super) fn new(shapes: Vec<HandedShape>) -> Self {
        let mut recorded = Self::default();
        for HandedShape { order, shape, cycle } in shapes {
            recorded.positions.entry(order).or_default().insert(cycle, shape);
        }
        recorded
    }

    /// The positions of the end of a journal, behind which the run goes on by itself.
    pub(super) fn until(self, cycle: u64) -> Self {
        Self { until: Some(cycle), ..self }
    }

    /// Whether an order moved the mesh at no cycle from this one on, and will not.
    pub(super) fn ends(&self, order: &str, cycle: u64) -> bool {
        let positions = self.positions.get(order);
        let goes_on = positions.is_some_and(|positions| positions.range(cycle..).next().is_some());
        self.until.is_none() && !goes_on
    }

    /// Whether it is known where the mesh was at this cycle. In the last cycle of a journal that was
    /// cut off only what stands there is.
    pub(super) fn knows(&self, order: &str, cycle: u64) -> bool {
        self.until.is_none_or(|until| cycle < until) || self.position(order, cycle).is_some()
    }

    /// Whether what happens at this cycle has happened before.
    pub(super) fn repeats(&self, cycle: u64) -> bool {
        self.until.is_none_or(|until| cycle <= until)
    }

    /// Whether a whole run is carried out again.
    pub(super) fn is_whole(&self) -> bool {
        self.until.is_none()
    }

    /// The position that was handed out at this cycle.
    pub(super) fn position(&self, order: &str, cycle: u64) -> Option<f64> {
        self.positions.get(order)?.get(&cycle).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_comes_behind_the_end_of_a_journal_has_not_happened_before() {
        let recorded = Recorded::new(Vec::new());
        assert!(recorded.repeats(u64::MAX), "a whole run is carried out again");
        let recorded = recorded.until(7);
        assert_eq!([6, 7, 8].map(|cycle| recorded.repeats(cycle)), [true, true, false]);
    }
}
