//! The pipelines at work, of which those that only show something rest while nobody watches.

use std::time::Instant;

use tombolo_pipelines::{extract::Channel, language::Command, run::Audience};

use super::{Adaptor, SteeredMesh};
use crate::step::{Moment, Outside};

impl Adaptor {
    /// Runs the pipelines that are due; the commands that they give. Collective.
    pub(super) fn run_pipelines(
        &mut self,
        moment: Moment,
        channels: &[Channel<'_>],
    ) -> Vec<(String, Command)> {
        let begun = Instant::now();
        let parameters = self.parameters.all();
        let asked = self.pipelines.run(moment, channels, parameters, self.hub.as_ref());
        self.timing.pipelines.add(begun.elapsed());
        for fault in asked.faults {
            self.complain(&fault);
        }
        asked.commands
    }

    /// The clock and the viewers, by which pipelines are due; the default where none of them heeds these.
    #[inline]
    pub(super) fn outside(&self, entered: Instant) -> Outside {
        if !self.pipelines.listens() {
            return Outside::default();
        }
        // A run that waits for its first viewer has one when it goes on.
        let is_waited_for =
            self.config.steering.wait_for_viewer && matches!(self.mesh, SteeredMesh::Unknown);
        let hub = self.hub.as_ref();
        Outside {
            seconds: entered.duration_since(self.timing.begun).as_secs_f64(),
            viewers: hub.map_or(0, |hub| hub.arrivals()),
            audience: match hub {
                _ if is_waited_for => Audience::OF_ALL,
                Some(hub) => hub.audience(),
                None => Audience::NOBODY,
            },
        }
    }

    /// Wakes the views that rest, once somebody looks at them. Where the solver was told that nothing
    /// looks at this step, the next one wakes them. Returns whether they are awake from now on. Collective.
    #[inline]
    pub(super) fn notice_viewers(&mut self, outside: Outside) -> bool {
        let wakes = !self.pipelines.audience().includes(outside.audience)
            && !self.communicator.any(*self.is_spared.get_mut());
        if wakes {
            self.pipelines.set_audience(outside.audience);
        }
        wakes
    }

    /// Makes the views that rest before the run waits, so that whoever comes meanwhile sees it as it is.
    /// Makes none where the solver was told that nothing looks at this step. Collective.
    pub(super) fn show_before_waiting(&mut self, moment: Moment, channels: &[Channel<'_>]) {
        if self.pipelines.audience() == Audience::OF_ALL
            || self.communicator.any(*self.is_spared.get_mut())
        {
            return;
        }
        self.pipelines.set_audience(Audience::OF_ALL);
        if self.pipelines.is_due(moment) {
            let commands = self.run_pipelines(moment, channels);
            self.accept_from_pipelines(commands, moment);
        }
    }
}
