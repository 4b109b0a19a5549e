//! The waits inside of `execute` that last until somebody comes: of a run that is paused, and for
//! its first viewer.

use std::time::{Duration, Instant};

use tombolo_pipelines::extract::Channel;

use super::{Adaptor, SteeredMesh};
use crate::step::Moment;

/// How long a paused run waits between two calls of `look`.
const LOOK_PERIOD: Duration = Duration::from_millis(100);

/// A function of the host that `execute` calls while it waits.
pub(super) type Look = Box<dyn FnMut() + Send>;

impl Adaptor {
    /// Has `look` called ten times a second or more while [`execute`](Adaptor::execute) waits, in a run
    /// that is paused or for its first viewer, on the thread that is in `execute`. It is for a host
    /// that handles signals between its own calls alone: what it sees there can end the wait by a
    /// [`Stopper`](crate::Stopper). On several ranks it is called on rank 0.
    ///
    /// ```
    /// use std::sync::atomic::{AtomicBool, Ordering};
    ///
    /// static SIGNALLED: AtomicBool = AtomicBool::new(false);
    /// let mut adaptor = tombolo::Settings::default().start()?;
    /// let stopper = adaptor.stopper();
    /// adaptor.while_waiting(move || {
    ///     if SIGNALLED.swap(false, Ordering::Relaxed) {
    ///         stopper.stop();
    ///     }
    /// });
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn while_waiting(&mut self, look: impl FnMut() + Send + 'static) {
        self.look = Some(Box::new(look));
    }

    /// Returns once a viewer is connected, or the run is to stop.
    pub(super) fn wait_for_viewer(&mut self) {
        let Self { hub, queue, look, .. } = self;
        let Some(hub) = hub.as_ref().filter(|_| self.config.steering.wait_for_viewer) else {
            return;
        };
        let begun = Instant::now();
        hub.wait_for_viewer(|| {
            look.iter_mut().for_each(|look| look());
            queue.has_stop()
        });
        self.timing.paused.add(begun.elapsed());
    }

    /// Returns once the run is not paused any more, or is to stop. Collective.
    pub(super) fn wait_for_resume(&mut self, moment: Moment, channels: &[Channel<'_>]) {
        if !self.paused {
            return;
        }
        self.show_before_waiting(moment, channels);
        let begun = Instant::now();
        while self.paused && !self.stopped {
            if self.communicator.rank() == 0 {
                while !self.queue.wait(LOOK_PERIOD) && !self.has_overdue() {
                    self.look.iter_mut().for_each(|look| look());
                }
            }
            self.serve(moment, channels);
        }
        self.timing.paused.add(begun.elapsed());
    }

    /// Whether an order has waited for too long.
    fn has_overdue(&self) -> bool {
        matches!(&self.mesh, SteeredMesh::Steered(steerer, _) if steerer.is_overdue())
    }
}
