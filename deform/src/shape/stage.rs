//! What a shaper is at, for whoever waits for it.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

/// The stages of a plan, whose seconds [`ShapeSeconds`](super::ShapeSeconds) has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// The displacement of the surface is made from the edits, and checked.
    Surface,
    /// The volume follows.
    Volume,
    /// The meshes on the way are checked.
    Guard,
}

impl Stage {
    const ALL: [Self; 3] = [Self::Surface, Self::Volume, Self::Guard];

    /// Its name, that of its seconds.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Stage::Surface => "surface",
            Stage::Volume => "volume",
            Stage::Guard => "guard",
        }
    }
}

/// The stage that a shaper has come to. Clones share it; any thread may look. Stages may come back:
/// a shape that is checked and found wanting is mended, and checked again.
///
/// ```
/// use tombolo_deform::shape::{CurrentStage, Stage};
///
/// let stage = CurrentStage::default();
/// stage.clone().enter(Stage::Volume);
/// assert_eq!(stage.get(), Stage::Volume);
/// ```
#[derive(Debug, Clone, Default)]
pub struct CurrentStage(Arc<AtomicU8>);

impl CurrentStage {
    /// The stage that was entered last; at first that of the surface.
    #[must_use]
    pub fn get(&self) -> Stage {
        let index = usize::from(self.0.load(Ordering::Relaxed));
        Stage::ALL.get(index).copied().unwrap_or(Stage::Surface)
    }

    /// Notes that a stage is entered.
    pub fn enter(&self, stage: Stage) {
        self.0.store(stage as u8, Ordering::Relaxed);
    }
}
