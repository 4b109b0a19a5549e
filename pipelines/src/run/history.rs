//! The values that monitors have had.

use std::collections::VecDeque;

use tombolo_deform::communicator::{Garbled, Reader, Writer};

use crate::language::{Monitor, Slot};
use crate::limits::{HISTORY, HISTORY_NUMBERS};

/// The monitors of a pipeline and what they have measured, in memory that does not grow with the
/// run: the newest [`HISTORY`] measurements, and of many monitors fewer, so that there are no more
/// than [`HISTORY_NUMBERS`].
#[derive(Debug, Clone)]
pub struct History {
    monitors: Vec<Monitor>,
    measured: VecDeque<Measured>,
    count: u64,
}

/// The values of a pipeline's monitors at one step.
#[derive(Debug, Clone, PartialEq)]
pub struct Measured {
    /// The step.
    pub cycle: u64,
    /// The simulated time.
    pub time: f64,
    /// The values, in the order of [`History::monitors`]; NaN where nothing could be measured.
    pub values: Vec<f64>,
}

impl History {
    pub(super) fn new(monitors: Vec<Monitor>) -> Self {
        Self { monitors, measured: VecDeque::new(), count: 0 }
    }

    /// The monitors.
    #[must_use]
    pub fn monitors(&self) -> &[Monitor] {
        &self.monitors
    }

    /// The values that are kept, the oldest first.
    pub fn measured(&self) -> impl ExactSizeIterator<Item = &Measured> {
        self.measured.iter()
    }

    /// The newest values; `None` before the first.
    #[must_use]
    pub fn last(&self) -> Option<&Measured> {
        self.measured.back()
    }

    /// How often they were measured, those forgotten included.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.count
    }

    pub(super) fn push(&mut self, measured: Measured) {
        let most = HISTORY.most.min(HISTORY_NUMBERS.most / self.monitors.len().max(1)).max(1);
        if self.measured.len() >= most {
            self.measured.pop_front();
        }
        self.measured.push_back(measured);
        self.count += 1;
    }

    /// Writes down what is kept.
    pub(super) fn save(&self, writer: &mut Writer) {
        writer.u64(self.count);
        writer.u64(self.measured.len() as u64);
        for Measured { cycle, time, values } in &self.measured {
            writer.u64(*cycle);
            writer.f64s(&[*time]);
            writer.f64s(values);
        }
    }

    /// Goes on from what was written down, of as many monitors.
    pub(super) fn restore(&mut self, reader: &mut Reader<'_>) -> Result<(), Garbled> {
        let count = reader.u64()?;
        for _ in 0..reader.count(8 * (2 + self.monitors.len()))? {
            let (cycle, time) = (reader.u64()?, reader.f64s(1)?[0]);
            self.push(Measured { cycle, time, values: reader.f64s(self.monitors.len())? });
        }
        self.count = count;
        Ok(())
    }

    /// Bytes of memory.
    pub(super) fn bytes(&self) -> usize {
        let row = size_of::<Measured>() + self.monitors.len() * size_of::<f64>();
        self.measured.len() * row
    }
}

/// The values that pipelines may name.
#[derive(Debug, Default)]
pub(super) struct Board {
    /// By the indices of the pipelines in the configuration.
    pub(super) histories: Vec<History>,
    pub(super) parameters: Vec<(String, f64)>,
}

impl Board {
    /// The value of a name; NaN where there is none yet. The values of the pipeline itself begin
    /// with the cycle and the time.
    pub(super) fn value(&self, slot: &Slot, own: &[f64]) -> f64 {
        let found = match slot {
            Slot::Own(index) => own.get(*index).copied(),
            Slot::Other { pipeline, monitor } => {
                let last = self.histories.get(*pipeline).and_then(History::last);
                let index = monitor.checked_sub(2);
                last.zip(index).and_then(|(last, index)| last.values.get(index).copied())
            }
            Slot::Parameter(name) => {
                self.parameters.iter().find(|(known, _)| known == name).map(|(_, value)| *value)
            }
        };
        found.unwrap_or(f64::NAN)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_are_forgotten() {
        for (monitors, expected) in [(1, HISTORY.most), (HISTORY_NUMBERS.most / 8, 8)] {
            let monitor = Monitor { name: "a".into(), unit: None };
            let mut history = History::new(vec![monitor; monitors]);
            for cycle in 0..HISTORY.most as u64 + 10 {
                history.push(Measured { cycle, time: 0.0, values: Vec::new() });
            }
            assert_eq!(history.measured().len(), expected);
            assert_eq!(history.count(), HISTORY.most as u64 + 10);
            let oldest = history.measured().next().map(|measured| measured.cycle);
            assert_eq!(oldest, Some(history.count() - expected as u64));
        }
    }
}
