//! Stops that are asked for outside of `execute`, as by a signal.

use std::sync::{Arc, OnceLock};

use tombolo_pipelines::language::Command;

use super::Adaptor;
use crate::{
    steering::{Forecaster, Log, Queue, Received, Source},
    stream::Clock,
};

/// Asks a run to stop, from any thread. [`Adaptor::stopper`] makes one.
#[derive(Clone)]
pub struct Stopper {
    queue: Arc<Queue>,
    log: Arc<Log>,
    clock: Arc<Clock>,
    forecaster: Arc<OnceLock<Forecaster>>,
}

impl Stopper {
    /// Asks the run to stop, as a viewer's `stop` does: the next call of `execute` says so to the
    /// solver on all ranks, and one that is paused, or waits for a viewer, goes on. Returns at once.
    ///
    /// Shapes that are being found are given up. Several ranks find them together, inside of
    /// `execute`: they give them up behind their next reduction, and that call returns.
    ///
    /// It counts on rank 0. It takes locks, so that it must not be called inside of a signal's
    /// handler; a thread that waits for signals may call it.
    pub fn stop(&self) {
        let command = Command::Stop {};
        // It has no name of its own that could be taken.
        if let Ok(id) = self.log.accept(None, &Source::Program, &command, self.clock.get()) {
            self.queue.push(Received { source: Source::Program, id, command, reservation: None });
            self.forecaster.get().into_iter().for_each(Forecaster::give_up);
        }
    }
}

impl std::fmt::Debug for Stopper {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Stopper").finish_non_exhaustive()
    }
}

impl Adaptor {
    /// Something that asks this run to stop, from any thread: for a program that is to end well when
    /// a batch system sends it a signal. The adaptor handles no signal by itself.
    ///
    /// ```
    /// use tombolo::{Adaptor, Channel, MeshView, Step};
    /// # let mesh = tombolo::deform::shapes::box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]);
    /// # let mesh = MeshView::from(&mesh);
    ///
    /// let mut adaptor = tombolo::Settings::default().start()?;
    /// let stopper = adaptor.stopper();
    /// std::thread::spawn(move || stopper.stop()).join().unwrap();
    /// let step = Step { cycle: 0, time: 0.0, time_step: 0.1 };
    /// assert!(adaptor.execute(&step, &[Channel::new("fluid", mesh, &[])])?.stop);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn stopper(&self) -> Stopper {
        Stopper {
            queue: Arc::clone(&self.queue),
            log: Arc::clone(&self.log),
            clock: Arc::clone(&self.clock),
            forecaster: Arc::clone(&self.forecaster),
        }
    }
}
