//! The alarm that ends all ranks where one fails in itself.

use std::sync::Arc;

use super::Communicator;

/// Held while all ranks work together. Where this rank unwinds meanwhile, which is a defect, all
/// ranks are ended ([`Communicator::abort`]): the others would wait for it for ever. On one process
/// it does nothing.
///
/// Failures that can be foreseen are errors, and [agreed upon](super::agree).
///
/// ```
/// use std::sync::Arc;
/// use tombolo_deform::communicator::{Alarm, Communicator, threads};
///
/// let outcome = std::panic::catch_unwind(|| {
///     threads::run(2, |ranks| {
///         let ranks: Arc<dyn Communicator> = Arc::new(ranks);
///         // Whoever catches the panic further up comes too late to leave the other rank waiting.
///         let work = std::panic::AssertUnwindSafe(|| {
///             let _alarm = Alarm::among(&ranks);
///             assert!(ranks.rank() == 0, "a defect");
///         });
///         let _ = std::panic::catch_unwind(work);
///         ranks.barrier();
///     })
/// });
/// assert!(outcome.is_err());
/// ```
#[must_use = "it is armed for as long as it is held"]
pub struct Alarm(Option<Arc<dyn Communicator>>);

impl Alarm {
    /// Armed where there are several ranks.
    pub fn among(communicator: &Arc<dyn Communicator>) -> Self {
        Self((communicator.size() > 1).then(|| Arc::clone(communicator)))
    }
}

impl Drop for Alarm {
    fn drop(&mut self) {
        if let Some(communicator) = self.0.as_ref().filter(|_| std::thread::panicking()) {
            communicator.abort();
        }
    }
}
