//! Long work that another thread can have given up.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether work under way is to be given up. Clones share it; any thread may ask.
///
/// Work that looks at it stops at its next look, and leaves nothing half-done. In the iterations of a
/// solve, of an untangling, in its line searches, in sweeps and in the checks of a mesh that is some
/// milliseconds away, on a mesh of a million cells. A step of a set-up is finished first: the order
/// of the cells, an assembly, the levels of multigrid, a factor.
///
/// Ranks stop at the same look, behind the next reduction in which all have heard of it; in the checks
/// of a mesh that is after some million cells. See [`Cancelling`](crate::communicator::Cancelling).
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
#[derive(Debug, Clone)]
pub struct Cancellation {
    asked: Arc<AtomicBool>,
    /// What work looks at: `asked` itself on one process, else what the ranks have agreed on.
    agreed: Arc<AtomicBool>,
    #[cfg(all(test, not(target_family = "wasm")))]
    looks: Arc<tests::Looks>,
}

impl Default for Cancellation {
    fn default() -> Self {
        let asked = Arc::<AtomicBool>::default();
        Self {
            agreed: Arc::clone(&asked),
            asked,
            #[cfg(all(test, not(target_family = "wasm")))]
            looks: Arc::default(),
        }
    }
}

impl Cancellation {
    /// Of work that several ranks do together: what one of them asks for is looked at once all know.
    pub(crate) fn of_ranks() -> Self {
        Self { agreed: Arc::default(), ..Self::default() }
    }

    /// The cancellation of work that this rank does alone, which may stop as soon as it is asked to.
    pub(crate) fn of_this_rank(&self) -> Self {
        Self { agreed: Arc::clone(&self.asked), ..self.clone() }
    }

    /// Has the work given up. Of several ranks any may ask.
    pub fn cancel(&self) {
        self.asked.store(true, Ordering::Release);
    }

    /// Whether the work is to be given up; on several ranks, whether all of them know that it is.
    #[must_use]
    pub fn is_cancelled(&self) -> bool {
        #[cfg(all(test, not(target_family = "wasm")))]
        self.looks.count(self);
        self.agreed.load(Ordering::Acquire)
    }

    /// Lets the work that comes next go on. On several ranks all do so, before they begin it.
    pub fn renew(&self) {
        self.asked.store(false, Ordering::Release);
        self.agreed.store(false, Ordering::Release);
    }

    /// Whether this rank has asked, which the others may not know yet.
    pub(crate) fn is_asked(&self) -> bool {
        self.asked.load(Ordering::Acquire)
    }

    /// Notes what all ranks have come to know.
    pub(crate) fn agree(&self) {
        self.agreed.store(true, Ordering::Release);
    }
}

// What counts the looks is asked by tests of ranks, which are threads; WebAssembly has none.
#[cfg(all(test, not(target_family = "wasm")))]
mod tests {
    use std::sync::atomic::AtomicUsize;

    use super::*;

    /// How often work has looked, and at which look it is to be given up.
    #[derive(Debug, Default)]
    pub(super) struct Looks {
        count: AtomicUsize,
        last: AtomicUsize,
    }

    impl Looks {
        pub(super) fn count(&self, cancellation: &Cancellation) {
            if self.count.fetch_add(1, Ordering::AcqRel) + 1 == self.last.load(Ordering::Acquire) {
                cancellation.cancel();
            }
        }
    }

    impl Cancellation {
        /// Counts looks anew, and gives up at the one of this number, counted from 1; at none for 0.
        pub(crate) fn cancel_at(&self, look: usize) {
            self.looks.count.store(0, Ordering::Release);
            self.looks.last.store(look, Ordering::Release);
        }

        /// How often work has looked since.
        pub(crate) fn looks(&self) -> usize {
            self.looks.count.load(Ordering::Acquire)
        }
    }
}
