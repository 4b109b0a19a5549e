//! How far a run is and what it costs, for viewers: the newest alone, a few times a second.

use std::time::{Duration, Instant};

use serde_json::{Map, Value, json};
use tombolo_pipelines::run::Cost;

use super::{
    hub::{Hub, name},
    text::Text,
};
use crate::{lock::lock, step::Moment};

/// A status is told again after this long though nothing in it has changed: a page, which cannot see
/// a server's pings, knows by it that it is still connected.
const SIGN_OF_LIFE: Duration = Duration::from_secs(10);

impl Hub {
    /// Puts a status into every outbox if anything in it changed, and into those of viewers if none
    /// was told for ten seconds. Called a few times a second.
    pub(crate) fn status(&self) {
        // The solver could wait for the lock: what is told is copied under it, and written later.
        let (is_news, text) = match self.new_status() {
            Some((is_news, status)) => {
                (is_news, Some(Text::of(move || json!({ "status": status() }))))
            }
            None => (false, None),
        };
        let state = lock(&self.state);
        state.clients.values().for_each(|client| client.status(text.as_ref()));
        // A recording of a run that rests does not grow.
        let observer = state.observer.iter().filter(|_| is_news);
        observer.for_each(|observer| observer.status(text.as_ref()));
    }

    /// The status, where it is to be told, and whether anything in it has changed.
    fn new_status(&self) -> Option<(bool, impl FnOnce() -> Map<String, Value> + Send + use<>)> {
        let Moment { cycle, time } = self.clock.get();
        let mut state = lock(&self.state);
        if !state.has_audience() {
            state.last_status = None;
            return None;
        }
        let now = Instant::now();
        let before = state.last_status;
        let is_news = before.is_none_or(|(last, _)| last != cycle) || state.status_dirty;
        let is_late = state.status_told.is_none_or(|told| now.duration_since(told) >= SIGN_OF_LIFE);
        if !is_news && !is_late {
            return None;
        }
        (state.status_dirty, state.status_told) = (false, Some(now));
        // Measured over the steps since the last status, so that the solver need not look at a
        // clock for it.
        let measured = before.and_then(|(last, at)| {
            let steps = cycle.checked_sub(last).filter(|&steps| steps > 0)?;
            #[expect(clippy::cast_precision_loss, reason = "steps of a fraction of a second")]
            Some(now.duration_since(at).as_secs_f64() / steps as f64)
        });
        state.step_seconds = measured.or(state.step_seconds);
        let step_seconds = state.step_seconds;
        if before.is_none_or(|(last, _)| last != cycle) {
            state.last_status = Some((cycle, now));
        }
        let mut status = state.conditions.clone();
        let (viewers, driver) = (state.clients.len(), state.wheel.driver());
        let (journal_lost, costs) = (state.journal_lost.clone(), state.costs.clone());
        let told = move || {
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
        };
        Some((is_news, told))
    }
}

#[cfg(test)]
mod tests {
    use futures_util::FutureExt;

    use super::*;
    use crate::stream::{credentials::Access, hub::Arrival};

    /// Whether a status is told, and whether it has news.
    fn told(hub: &Hub) -> Option<(bool, Value)> {
        hub.new_status().map(|(is_news, status)| (is_news, status().into()))
    }

    #[test]
    fn a_status_waits_for_another_message_until_the_next_is_due() {
        let hub = Hub::default();
        let Ok(Arrival::Client(viewer)) = hub.join(1, Access::Watch, true, true, None) else {
            panic!("there is room for a viewer")
        };
        let is_woken = || viewer.wake.notified().now_or_never().is_some();
        is_woken();
        hub.status();
        assert!(!is_woken());
        // Nothing has changed, and nothing else was sent.
        hub.status();
        assert!(is_woken());
    }

    #[test]
    fn a_status_is_told_again_where_none_was_told_for_long() {
        let hub = Hub::default();
        let Ok(Arrival::Client(_viewer)) = hub.join(1, Access::Watch, true, true, None) else {
            panic!("there is room for a viewer")
        };
        assert!(told(&hub).is_some_and(|(is_news, _)| is_news));
        std::thread::sleep(Duration::from_millis(1));
        hub.clock.set(Moment { cycle: 1, time: 0.1 });
        let (is_news, first) = told(&hub).expect("a step is news");
        assert!(is_news && first["step_seconds"].as_f64() > Some(0.0), "{first}");
        assert!(told(&hub).is_none());
        lock(&hub.state).status_told = Instant::now().checked_sub(SIGN_OF_LIFE);
        // No step was taken meanwhile, and what is known of steps is not forgotten for it.
        assert_eq!(told(&hub), Some((false, first)));
        assert!(told(&hub).is_none());
    }
}
