//! The positions of a journal, each handed out at its cycle.

use std::collections::{BTreeMap, HashMap};

use tombolo_pipelines::language::HandedShape;

/// Where on the way of each order the mesh was at which cycle.
#[derive(Debug, Default)]
pub(super) struct Recorded {
    positions: HashMap<String, BTreeMap<u64, f64>>,
}

impl Recorded {
    pub(super) fn new(shapes: Vec<HandedShape>) -> Self {
        let mut recorded = Self::default();
        for HandedShape { order, shape, cycle } in shapes {
            recorded.positions.entry(order).or_default().insert(cycle, shape);
        }
        recorded
    }

    /// Whether an order moved the mesh at this cycle or later.
    pub(super) fn goes_on(&self, order: &str, cycle: u64) -> bool {
        let positions = self.positions.get(order);
        positions.is_some_and(|positions| positions.range(cycle..).next().is_some())
    }

    /// The position that was handed out at this cycle.
    pub(super) fn position(&self, order: &str, cycle: u64) -> Option<f64> {
        self.positions.get(order)?.get(&cycle).copied()
    }
}
