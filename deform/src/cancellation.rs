//! Long work that another thread can have given up.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether work under way is to be given up. Its clones are the same; any thread may ask.
///
/// Work that looks at it stops at its next look, and leaves nothing half-done. In the iterations of a
/// solve and the checks of a mesh that is some milliseconds away, on a mesh of a million cells. A
/// step of a set-up is finished first: the order of the cells, an assembly, the levels of multigrid,
/// a factor; so are the sweeps that improve a shape. Ranks do not tell each other: work of several is
/// given up by all or by none.
///
/// ```
/// use tombolo_deform::cancellation::Cancellation;
///
/// let cancellation = Cancellation::default();
/// cancellation.clone().cancel();
/// assert!(cancellation.is_cancelled());
/// cancellation.renew();
/// assert!(!cancellation.is_cancelled());
/// ```
#[derive(Debug, Clone, Default)]
pub struct Cancellation {
    is_cancelled: Arc<AtomicBool>,
}

impl Cancellation {
    /// Has the work given up.
    pub fn cancel(&self) {
        self.is_cancelled.store(true, Ordering::Release);
    }

    /// Whether the work is to be given up.
    #[must_use]
    pub fn is_cancelled(&self) -> bool {
        self.is_cancelled.load(Ordering::Acquire)
    }

    /// Lets the work that comes next go on.
    pub fn renew(&self) {
        self.is_cancelled.store(false, Ordering::Release);
    }
}
