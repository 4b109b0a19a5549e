//! The wheel: asked for, and handed over.

use std::time::{Duration, Instant};

use serde_json::json;

use super::{Client, ClientError, Event, Role, no_answer, state::State};

/// How long the wheel is asked for again, while it is kept for a driver that was lost.
const ASK_AGAIN: Duration = Duration::from_millis(300);

/// Whether the client drives, as it was last told.
fn drives(state: &State) -> bool {
    state.hello.as_ref().is_some_and(|hello| hello.role == Role::Driver)
}

impl Client {
    /// Asks for the wheel until it is there: at once where nobody drives, and after some seconds
    /// where the last driver's connection was lost.
    ///
    /// # Errors
    /// [`ClientError::NotDriver`] where somebody else drives, or the wheel is still refused after
    /// `patience`; [`ClientError::NoAnswer`] where the run has said nothing by then, as while a lost
    /// connection is made again.
    pub fn drive(&self, patience: Duration) -> Result<(), ClientError> {
        let until = Instant::now() + patience.min(Duration::from_secs(1 << 30));
        let hello = self.hello();
        if hello.as_ref().is_some_and(|hello| hello.recording.is_some()) {
            let reason = "this is a recording, of which nothing can be ordered".into();
            return Err(ClientError::NotDriver { reason });
        }
        let may_drive = hello.is_none_or(|hello| hello.may_drive != Some(false));
        loop {
            if self.drives() {
                return Ok(());
            }
            let id = self.id();
            self.shared.with(|state| state.asked.insert(id.clone(), None));
            let message = json!({"id": id, "drive": {}});
            let left = until.saturating_duration_since(Instant::now());
            let answered = self.transmit(id.clone(), &message).map(|()| {
                self.shared.wait(left.max(ASK_AGAIN), |state| {
                    let drives = drives(state);
                    let waits = state.pending.iter().any(|pending| pending.id == id);
                    match &state.failure {
                        Some(failure) => Some(Err(failure.clone())),
                        None => (drives || !waits).then_some(Ok(drives)),
                    }
                })
            });
            // Where it was heard, the hello says so, and no answer has this id.
            let answer = self.shared.with(|state| {
                state.pending.retain(|pending| pending.id != id);
                state.asked.remove(&id).flatten()
            });
            if answered?.unwrap_or(Ok(false))? {
                return Ok(());
            }
            let is_late = Instant::now() >= until;
            if let Some(Event::Error(error)) = answer {
                let kept = may_drive && self.status().is_none_or(|status| status.driver.is_none());
                if !kept || is_late {
                    return Err(ClientError::NotDriver { reason: error.message });
                }
            } else if is_late {
                return Err(no_answer("the wheel that was asked for", patience));
            }
            self.shared.wait(ASK_AGAIN, |state| state.failure.clone());
        }
    }

    /// Gives the wheel to another client by its name in the run, such as `c4`, as [`Event::People`]
    /// tells it; returns once that client has it.
    ///
    /// # Errors
    /// [`ClientError::NotDriver`] where this client does not drive, [`ClientError::Rejected`] where
    /// the other cannot, and [`ClientError::NoAnswer`] after `patience`.
    pub fn hand_over(&self, to: &str, patience: Duration) -> Result<(), ClientError> {
        if !self.drives() {
            let reason = "only the one that drives hands the wheel over".into();
            return Err(ClientError::NotDriver { reason });
        }
        let id = self.id();
        self.shared.with(|state| state.asked.insert(id.clone(), None));
        let message = json!({"id": id, "hand_over": {"to": to}});
        let answered = self.transmit(id.clone(), &message).map(|()| {
            self.shared.wait(patience, |state| {
                match state.asked.get_mut(&id).and_then(Option::take) {
                    Some(Event::Error(error)) => {
                        Some(Err(ClientError::Rejected { reason: error.message }))
                    }
                    _ if !drives(state) => {
                        // A connection that is lost from now on does not ask for it again.
                        state.drives = false;
                        Some(Ok(()))
                    }
                    _ => state.failure.clone().map(Err),
                }
            })
        });
        // Where it was heard, the hello says so, and no answer has this id.
        self.shared.with(|state| {
            state.pending.retain(|pending| pending.id != id);
            state.asked.remove(&id);
        });
        answered?.unwrap_or_else(|| Err(no_answer("the wheel that was handed over", patience)))
    }
}
