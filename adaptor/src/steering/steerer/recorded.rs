//! The shapes of a journal, each handed out at its cycle.

use std::collections::HashMap;

use tombolo_pipelines::language::HandedShape;

/// At which cycle each shape of each order was handed out.
#[derive(Debug, Default)]
pub(super) struct Recorded {
    cycles: HashMap<String, HashMap<u32, u64>>,
}

impl Recorded {
    pub(super) fn new(shapes: Vec<HandedShape>) -> Self {
        let mut recorded = Self::default();
        for HandedShape { order, shape, cycle } in shapes {
            recorded.cycles.entry(order).or_default().insert(shape, cycle);
        }
        recorded
    }

    /// Whether a shape of an order was handed out at all.
    pub(super) fn goes_on(&self, order: &str, shape: u32) -> bool {
        self.cycle(order, shape).is_some()
    }

    /// Whether a shape of an order was handed out by this cycle.
    pub(super) fn is_due(&self, order: &str, shape: u32, cycle: u64) -> bool {
        self.cycle(order, shape).is_some_and(|handed| cycle >= handed)
    }

    fn cycle(&self, order: &str, shape: u32) -> Option<u64> {
        self.cycles.get(order)?.get(&shape).copied()
    }
}
