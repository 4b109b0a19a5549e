//! What a shaper is at, for whoever waits for it.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

/// The phases of a plan, whose seconds [`ShapeSeconds`](super::ShapeSeconds) has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// The displacement of the surface is made from the edits, and checked.
    Surface,
    /// The volume follows.
    Volume,
    /// The meshes on the way are checked.
    Guard,
}

impl Phase {
    const ALL: [Self; 3] = [Self::Surface, Self::Volume, Self::Guard];

    /// Its name, that of its seconds.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Phase::Surface => "surface",
            Phase::Volume => "volume",
            Phase::Guard => "guard",
        }
    }
}

/// The phase that a shaper has come to. Clones share it; any thread may look. Phases may come back:
/// a shape that is checked and found wanting is mended, and checked again.
///
/// ```
/// use tombolo_deform::shape::{CurrentPhase, Phase};
///
/// let phase = CurrentPhase::default();
/// phase.clone().enter(Phase::Volume);
/// assert_eq!(phase.get(), Phase::Volume);
/// ```
#[derive(Debug, Clone, Default)]
pub struct CurrentPhase(Arc<AtomicU8>);

impl CurrentPhase {
    /// The phase that was entered last; at first that of the surface.
    #[must_use]
    pub fn get(&self) -> Phase {
        let index = usize::from(self.0.load(Ordering::Relaxed));
        Phase::ALL.get(index).copied().unwrap_or(Phase::Surface)
    }

    /// Notes that a phase is entered.
    pub fn enter(&self, phase: Phase) {
        self.0.store(phase as u8, Ordering::Relaxed);
    }
}
