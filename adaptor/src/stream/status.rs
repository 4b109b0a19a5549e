//! How far a run is and what it costs, for viewers: the newest alone, a few times a second.

use std::time::{Duration, Instant};

use serde_json::{Map, Value, json};
use tombolo_pipelines::run::Cost;

use super::{
    hub::{Hub, name},
    text::Text,
};
use crate::lock::lock;

/// A status is told again after this long though nothing in it has changed: a page, which cannot see
/// a server's pings, knows by it that it is still connected.
const SIGN_OF_LIFE: Duration = Duration::from_secs(10);

impl Hub {
    /// Puts a status into every outbox if anything in it changed, or none was told for ten seconds.
    /// Called a few times a second.
    pub(crate) fn status(&self) {
        // The solver could wait for the lock: what is told is copied under it, and written later.
        let Some(status) = self.new_status() else { return };
        let text = Text::of(move || json!({ "status": status() }));
        lock(&self.state).audience().for_each(|client| client.status(&text));
    }

    /// The status, where it is to be told.
    fn new_status(&self) -> Option<impl FnOnce() -> Map<String, Value> + Send + use<>> {
        let (cycle, time) = self.clock.get();
        let mut state = lock(&self.state);
        if !state.has_audience() {
            state.last_status = None;
            return None;
        }
        let now = Instant::now();
        let before = state.last_status;
        let is_late = state.status_told.is_none_or(|told| now.duration_since(told) >= SIGN_OF_LIFE);
        if before.is_some_and(|(last, _)| last == cycle) && !state.status_dirty && !is_late {
            return None;
        }
        (state.status_dirty, state.status_told) = (false, Some(now));
        // Measured over the steps since the last status, so that the solver need not look at a
        // clock for it.
        let step_seconds = before.and_then(|(last, at)| {
            let steps = cycle.checked_sub(last).filter(|&steps| steps > 0)?;
            #[expect(clippy::cast_precision_loss, reason = "steps of a fraction of a second")]
            Some(now.duration_since(at).as_secs_f64() / steps as f64)
        });
        if before.is_none_or(|(last, _)| last != cycle) {
            state.last_status = Some((cycle, now));
        }
        let mut status = state.conditions.clone();
        let (viewers, driver) = (state.clients.len(), state.wheel.driver());
        let (journal_lost, costs) = (state.journal_lost.clone(), state.costs.clone());
        Some(move || {
            status.insert("cycle".into(), cycle.into());
            status.insert("time".into(), time.into());
            status.insert("step_seconds".into(), step_seconds.into());
            status.insert("viewers".into(), viewers.into());
            status.insert("driver".into(), driver.map(name).into());
            status.insert("journal_lost".into(), journal_lost.into());
            let pipeline = |(name, cost): &(String, Cost)| {
                json!({"name": name, "runs": cost.runs, "seconds": cost.seconds, "bytes": cost.bytes,
                       "memory": cost.memory, "every": cost.every})
            };
            status.insert("pipelines".into(), costs.iter().map(pipeline).collect());
            status
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stream::{credentials::Access, hub::Arrival};

    #[test]
    fn a_status_is_told_again_where_none_was_told_for_long() {
        let hub = Hub::default();
        let Ok(Arrival::Client(_viewer)) = hub.join(1, Access::Watch, None) else {
            panic!("there is room for a viewer")
        };
        assert!(hub.new_status().is_some());
        assert!(hub.new_status().is_none());
        lock(&hub.state).status_told = Instant::now().checked_sub(SIGN_OF_LIFE);
        assert!(hub.new_status().is_some());
        assert!(hub.new_status().is_none());
    }
}
