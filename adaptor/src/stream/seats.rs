//! Viewers come and go, and the wheel goes from one to the other.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use serde_json::json;

use super::{
    credentials::Access,
    hub::{Hub, HubState, name},
    outbox::Client,
    secret::Secret,
    text::Text,
    wheel::{LEFT, WHEEL_KEPT},
};
use crate::lock::lock;

impl HubState {
    /// The viewer that comes back, where what it shows is right. A connection of it that is not known
    /// to be lost yet is closed.
    pub(super) fn recognise(
        &mut self,
        access: Access,
        called: &str,
        back: &str,
    ) -> Option<(u64, Secret)> {
        if let Some(client) = self.clients.values().find(|client| name(client.id) == called) {
            let is_right = client.back.matches(back) && client.access == access;
            return is_right.then(|| {
                client.close((4002, "this viewer has come back by another connection"));
                (client.id, client.back.clone())
            });
        }
        let mut left = self.wheel.left.iter();
        let found = left.position(|(id, known, of)| {
            name(*id) == called && known.matches(back) && *of == access
        })?;
        self.wheel.left.remove(found).map(|(id, back, _)| (id, back))
    }

    /// Gives a viewer its seat, and the wheel where it is its own, or free and it takes it unasked.
    pub(super) fn seat(&mut self, client: &Arc<Client>, takes_wheel: bool) {
        let had_it = self.wheel.lost.is_some_and(|(_, driver)| driver == client.id);
        let is_there = had_it || takes_wheel && self.wheel.is_free();
        if client.access == Access::Drive && self.wheel.driver.is_none() && is_there {
            self.take_wheel(client.id);
        }
        self.clients.insert(client.id, Arc::clone(client));
        self.status_dirty = true;
        self.together.changed();
    }

    fn is_paused(&self) -> bool {
        self.conditions.get("paused") == Some(&true.into())
    }

    fn take_wheel(&mut self, client: u64) {
        self.wheel.driver = Some(client);
        self.wheel.asking.clear();
        self.wheel.heard = Some(Instant::now());
        self.wheel.lost = None;
        self.status_dirty = true;
        self.together.changed();
    }

    fn named(&self, called: &str) -> Result<&Arc<Client>, String> {
        let mut clients = self.clients.values();
        clients
            .find(|client| name(client.id) == called)
            .ok_or_else(|| format!("there is no viewer {called:?}"))
    }
}

impl Hub {
    /// Sets how long a driver may be silent before another may take the wheel.
    pub(super) fn set_driver_silence(&self, silence: Duration) {
        lock(&self.state).wheel.silence = silence;
    }

    /// Lets a viewer go, unless it has come back by another connection; whether it is gone.
    pub(super) fn leave(&self, client: &Arc<Client>) -> bool {
        let mut state = lock(&self.state);
        if !state.clients.get(&client.id).is_some_and(|seated| Arc::ptr_eq(seated, client)) {
            return false;
        }
        state.clients.remove(&client.id);
        state.wheel.asking.remove(&client.id);
        self.note_audience(&state);
        if state.wheel.driver == Some(client.id) {
            state.wheel.driver = None;
            state.wheel.lost = Some((Instant::now(), client.id));
        }
        if state.wheel.left.len() >= LEFT {
            state.wheel.left.pop_front();
        }
        state.wheel.left.push_back((client.id, client.back.clone(), client.access));
        state.status_dirty = true;
        state.together.left(client.id);
        true
    }

    /// Takes note that a viewer ends its connection by itself: the wheel is not kept for it.
    pub(super) fn let_go(&self, client: &Arc<Client>) {
        let mut state = lock(&self.state);
        // It may have come back by another connection.
        let is_seated = state.clients.get(&client.id).is_some_and(|it| Arc::ptr_eq(it, client));
        if is_seated && state.wheel.driver == Some(client.id) {
            (state.wheel.driver, state.wheel.lost) = (None, None);
            state.status_dirty = true;
            state.together.changed();
        }
    }

    /// Whether the run is paused and nobody is connected who could resume it.
    pub(crate) fn is_paused_alone(&self) -> bool {
        let state = lock(&self.state);
        state.is_paused() && !state.clients.values().any(|client| client.access == Access::Drive)
    }

    /// Whether the run is paused.
    pub(crate) fn is_paused(&self) -> bool {
        lock(&self.state).is_paused()
    }

    pub(super) fn is_driver(&self, client: u64) -> bool {
        lock(&self.state).wheel.driver == Some(client)
    }

    /// Takes note that a viewer has said something.
    pub(super) fn heard(&self, client: u64) {
        let mut state = lock(&self.state);
        if state.wheel.driver == Some(client) {
            state.wheel.heard = Some(Instant::now());
        }
    }

    /// Gives a viewer the wheel, or tells the driver that it wants it; the message says why not.
    pub(super) fn drive(&self, client: u64) -> Result<(), String> {
        let mut state = lock(&self.state);
        match state.wheel.driver {
            Some(driver) if driver == client => Ok(()),
            Some(driver) if !state.wheel.is_silent() => {
                state.wheel.asking.insert(client);
                if let Some(driver) = state.clients.get(&driver) {
                    let called = state.together.called(client).map(str::to_owned);
                    driver.text(&Text::of(
                        move || json!({"wheel": {"asked_by": name(client), "name": called}}),
                    ));
                }
                Err(format!(
                    "{} has the wheel and is told that you ask for it; it is free once that viewer \
                     hands it over, has left, or has been silent for {} seconds",
                    name(driver),
                    state.wheel.silence.as_secs()
                ))
            }
            None if !state.wheel.is_free() => Err(format!(
                "the wheel is kept for {} seconds for the driver whose connection was lost; ask again",
                WHEEL_KEPT.as_secs()
            )),
            _ => {
                state.take_wheel(client);
                state.greet();
                Ok(())
            }
        }
    }

    /// The driver gives the wheel to another viewer; the message says why not.
    pub(super) fn hand_over(&self, driver: u64, to: &str) -> Result<(), String> {
        let mut state = lock(&self.state);
        if state.wheel.driver != Some(driver) {
            return Err("only the one that drives hands the wheel over".into());
        }
        let other = state.named(to)?;
        if other.access != Access::Drive {
            return Err(format!("{to} came with the secret for watching"));
        }
        let other = other.id;
        state.take_wheel(other);
        state.greet();
        Ok(())
    }

    /// The driver has those told that it keeps the wheel who asked for it; the message says why not.
    pub(super) fn keep(&self, driver: u64) -> Result<(), String> {
        let mut state = lock(&self.state);
        if state.wheel.driver != Some(driver) {
            return Err("only the one that drives keeps the wheel".into());
        }
        let called = state.together.called(driver).map(str::to_owned);
        let text = Text::of(move || json!({"kept": {"by": name(driver), "name": called}}));
        for client in std::mem::take(&mut state.wheel.asking) {
            state.clients.get(&client).into_iter().for_each(|client| client.text(&text));
        }
        Ok(())
    }

    /// The driver ends the connection of another viewer; the message says why not.
    pub(super) fn kick(&self, driver: u64, other: &str) -> Result<(), String> {
        let state = lock(&self.state);
        let other = state.named(other)?;
        if state.wheel.driver != Some(driver) || other.id == driver {
            return Err("only the one that drives ends connections, those of others".into());
        }
        other.close((4001, "the one that drives has ended this connection"));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stream::hub::Arrival;

    fn joined(hub: &Hub, returning: Option<(&str, &str)>) -> Arc<Client> {
        match hub.join(9, Access::Drive, true, true, returning) {
            Ok(Arrival::Client(client)) => client,
            _ => panic!("there is room"),
        }
    }

    #[test]
    fn the_end_of_an_old_connection_takes_nothing_from_the_new_one() {
        let hub = Hub::default();
        let old = joined(&hub, None);
        assert!(hub.is_driver(old.id));
        let new = joined(&hub, Some((&name(old.id), old.back.as_str())));
        assert_eq!(old.id, new.id);
        // What it said last comes late.
        hub.let_go(&old);
        hub.leave(&old);
        assert!(hub.is_driver(new.id));
        hub.let_go(&new);
        assert!(!hub.is_driver(new.id));
    }
}
