//! How exact the frames of a view are for a viewer, by what its link carries.

/// How much wider the bounds of fields are at each level, than what the view asks for.
pub(crate) const COARSER: [f64; 3] = [1.0, 8.0, 64.0];
/// The levels, the exact one first.
pub(crate) const LEVELS: usize = COARSER.len();
/// The level of exact frames.
pub(crate) const EXACT: usize = 0;
/// Frames that a link must carry one after the other, to count as one that keeps up.
const SOON: u32 = 16;
/// The most frames that are waited for before a finer level is tried again.
const LONGEST: u32 = 512;

/// How exact the frames of a view are for a viewer.
///
/// A link that falls behind twice, soon one after the other, gets coarser frames; one that has kept up
/// for a while gets finer ones. Where these are too much again, the next attempt comes later.
#[derive(Debug, Clone)]
pub(super) struct Pace {
    level: usize,
    /// The last level that is tried.
    coarsest: usize,
    /// Frames since it fell behind or the level changed.
    kept: u32,
    /// Frames after which a finer level is tried.
    patience: u32,
    /// The level was reached by trying, and has not proved itself yet.
    is_tried: bool,
}

impl Default for Pace {
    fn default() -> Self {
        Self { level: EXACT, coarsest: LEVELS - 1, kept: SOON, patience: 2 * SOON, is_tried: false }
    }
}

impl Pace {
    /// Exact frames, or none: for what is kept.
    pub(super) fn exact() -> Self {
        Self { coarsest: EXACT, ..Self::default() }
    }

    pub(super) fn level(&self) -> usize {
        self.level
    }

    /// Takes note of a frame for which there was room; whether frames are finer from now on.
    pub(super) fn carried(&mut self) -> bool {
        self.kept = self.kept.saturating_add(1);
        if self.kept >= SOON && std::mem::take(&mut self.is_tried) {
            self.patience = 2 * SOON;
        }
        if self.level == EXACT || self.kept < self.patience {
            return false;
        }
        self.level -= 1;
        (self.kept, self.is_tried) = (0, true);
        true
    }

    /// Takes note that frames had to be left out; whether they are coarser from now on.
    pub(super) fn fell_behind(&mut self) -> bool {
        let is_soon = self.kept < SOON;
        self.kept = 0;
        if !is_soon || self.level == self.coarsest {
            return false;
        }
        if std::mem::take(&mut self.is_tried) {
            self.patience = (2 * self.patience).min(LONGEST);
        }
        self.level += 1;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_hiccup_changes_nothing_and_a_slow_link_gets_coarser_frames() {
        let mut pace = Pace::default();
        assert!(!pace.fell_behind());
        (0..SOON).for_each(|_| assert!(!pace.carried()));
        assert!(!pace.fell_behind() && pace.level() == 0);
        assert!(pace.fell_behind() && pace.level() == 1);
        assert!(pace.fell_behind() && pace.level() == 2);
        assert!(!pace.fell_behind() && pace.level() == 2, "there is no coarser one");
    }

    #[test]
    fn what_is_kept_stays_exact() {
        let mut pace = Pace::exact();
        (0..100).for_each(|_| assert!(!pace.fell_behind() && pace.level() == 0));
    }

    #[test]
    fn exact_frames_return_with_the_link_and_are_tried_ever_later_where_they_are_too_much() {
        let mut pace = Pace::default();
        pace.fell_behind();
        pace.fell_behind();
        let mut waits = Vec::new();
        for _ in 0..8 {
            let wait = (1..).find(|_| pace.carried()).unwrap_or(0);
            assert_eq!(pace.level(), 0);
            waits.push(wait);
            assert!(pace.fell_behind() && pace.level() == 1);
        }
        assert!(waits.is_sorted() && waits[0] == 2 * SOON && waits[7] == LONGEST, "{waits:?}");
        while !pace.carried() {}
        (0..1000).for_each(|_| assert!(!pace.carried() && pace.level() == 0));
        // It has proved itself: the next time is as the first.
        pace.fell_behind();
        pace.fell_behind();
        assert_eq!((1..).find(|_| pace.carried()), Some(2 * SOON));
    }
}
