//! The runs that are connected to a relay, and the connections that they are asked to make.

use std::{
    collections::{BTreeMap, HashMap},
    net::IpAddr,
    sync::{Arc, Mutex},
    time::{Duration, SystemTime},
};

use hyper::upgrade::Upgraded;
use tokio::{
    sync::{Notify, OwnedSemaphorePermit, Semaphore, mpsc, oneshot},
    time::timeout,
};
use tombolo_pipelines::language::RunName;

use crate::{
    lock::lock,
    stream::{connection::Asked, relay_messages::Open, secret::Secret},
};

/// Runs at once.
pub(super) const RUNS: usize = 64;
/// Of the connections of all viewers, those to one run: the others have the rest.
const SHARE: usize = 2;
/// Requests for connections that wait to be sent to a run.
const ASKED: usize = 64;
/// How long a run may take to make a connection.
const DIAL: Duration = Duration::from_secs(10);

/// A run that is connected.
#[derive(Debug)]
pub(super) struct Run {
    pub(super) name: RunName,
    pub(super) since: SystemTime,
    pub(super) address: IpAddr,
    instance: Secret,
    asks: mpsc::Sender<Open>,
    room: Arc<Semaphore>,
    replaced: Notify,
}

impl Run {
    /// Returns once the run has come back by another connection.
    pub(super) async fn replaced(&self) {
        self.replaced.notified().await;
    }
}

/// Why there is no connection to a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Unreached {
    /// There are too many already.
    TooMany,
    /// The run does not make one.
    NoAnswer,
}

/// A connection that a run has made for a viewer.
pub(super) struct Carried {
    pub(super) stream: Upgraded,
    /// The run is asked by it, and may take its time.
    pub(super) asked: Asked,
}

/// Room for one connection of a viewer, taken as long as it lives.
#[derive(Debug)]
pub(super) struct Room {
    _of_all: OwnedSemaphorePermit,
    _of_run: OwnedSemaphorePermit,
}

/// The runs of a relay.
pub(super) struct Runs {
    state: Mutex<State>,
    room: Arc<Semaphore>,
    viewers: usize,
}

#[derive(Default)]
struct State {
    runs: BTreeMap<RunName, Arc<Run>>,
    /// By its ticket, who waits for a connection.
    waiting: HashMap<String, oneshot::Sender<Carried>>,
}

impl Runs {
    /// `viewers` connections of viewers at once, of which half may lead to one run.
    pub(super) fn new(viewers: usize) -> Self {
        Self { state: Mutex::default(), room: Arc::new(Semaphore::new(viewers)), viewers }
    }

    /// Takes a run in, under the name that it wishes or that with a number behind. One that comes back
    /// takes the place of its lost connection. `None` where there are too many.
    pub(super) fn attach(
        &self,
        wish: &RunName,
        instance: Secret,
        address: IpAddr,
    ) -> Option<(Arc<Run>, mpsc::Receiver<Open>)> {
        let mut state = lock(&self.state);
        let back = state.runs.values().find(|run| run.instance.matches(instance.as_str()));
        let back = back.map(|run| run.name.clone());
        if back.is_none() && state.runs.len() >= RUNS {
            return None;
        }
        let is_free = |name: &RunName| !state.runs.contains_key(name);
        let numbered = || (2..RUNS + 2).map(|number| wish.numbered(number));
        let name = match back {
            Some(name) => name,
            None => std::iter::once(wish.clone()).chain(numbered()).find(is_free)?,
        };
        let (asks, asked) = mpsc::channel(ASKED);
        let room = Arc::new(Semaphore::new(self.viewers.div_ceil(SHARE)));
        let run = Arc::new(Run {
            name,
            since: SystemTime::now(),
            address,
            instance,
            asks,
            room,
            replaced: Notify::new(),
        });
        if let Some(lost) = state.runs.insert(run.name.clone(), Arc::clone(&run)) {
            // Kept for the connection that holds the lost one, also where it does not wait yet.
            lost.replaced.notify_one();
        }
        Some((run, asked))
    }

    /// Lets a run go, unless it has come back since.
    pub(super) fn leave(&self, run: &Arc<Run>) {
        let mut state = lock(&self.state);
        if state.runs.get(&run.name).is_some_and(|known| Arc::ptr_eq(known, run)) {
            state.runs.remove(&run.name);
        }
    }

    pub(super) fn find(&self, name: &str) -> Option<Arc<Run>> {
        let name: RunName = name.parse().ok()?;
        lock(&self.state).runs.get(&name).cloned()
    }

    /// All runs, by name, each with how many connections lead to it.
    pub(super) fn list(&self) -> Vec<(Arc<Run>, usize)> {
        let most = self.viewers.div_ceil(SHARE);
        let open = |run: &Arc<Run>| most.saturating_sub(run.room.available_permits());
        lock(&self.state).runs.values().map(|run| (Arc::clone(run), open(run))).collect()
    }

    /// A new connection to a run for a viewer.
    pub(super) async fn dial(
        &self,
        run: &Run,
        viewer: IpAddr,
    ) -> Result<(Carried, Room), Unreached> {
        let take = |room: &Arc<Semaphore>| {
            Arc::clone(room).try_acquire_owned().map_err(|_| Unreached::TooMany)
        };
        let room = Room { _of_run: take(&run.room)?, _of_all: take(&self.room)? };
        let ticket = Secret::random().map_err(|_| Unreached::NoAnswer)?.as_str().to_owned();
        let (sender, connected) = oneshot::channel();
        lock(&self.state).waiting.insert(ticket.clone(), sender);
        let _ticket = Ticket { runs: self, ticket: &ticket };
        let asked = run.asks.try_send(Open { ticket: ticket.clone(), viewer });
        asked.map_err(|error| match error {
            mpsc::error::TrySendError::Full(_) => Unreached::TooMany,
            mpsc::error::TrySendError::Closed(_) => Unreached::NoAnswer,
        })?;
        match timeout(DIAL, connected).await {
            Ok(Ok(connection)) => Ok((connection, room)),
            _ => Err(Unreached::NoAnswer),
        }
    }

    /// Who waits for the connection of a ticket, which is used up.
    pub(super) fn redeem(&self, ticket: &str) -> Option<oneshot::Sender<Carried>> {
        lock(&self.state).waiting.remove(ticket)
    }
}

/// A ticket that is withdrawn when nobody waits for its connection any more.
struct Ticket<'a> {
    runs: &'a Runs,
    ticket: &'a str,
}

impl Drop for Ticket<'_> {
    fn drop(&mut self) {
        self.runs.redeem(self.ticket);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ADDRESS: IpAddr = IpAddr::V4(std::net::Ipv4Addr::LOCALHOST);

    fn secret() -> Secret {
        Secret::random().expect("random numbers")
    }

    #[tokio::test]
    async fn a_name_belongs_to_one_run_and_to_it_again() {
        let runs = Runs::new(8);
        let wish: RunName = "nozzle".parse().expect("a name");
        let own = secret();
        let (first, _asked) = runs.attach(&wish, own.clone(), ADDRESS).expect("room");
        let (second, _asked) = runs.attach(&wish, secret(), ADDRESS).expect("room");
        assert_eq!((first.name.as_str(), second.name.as_str()), ("nozzle", "nozzle-2"));
        // It comes back before its lost connection was noticed, which ends then.
        let (back, _back) = runs.attach(&wish, own, ADDRESS).expect("room");
        assert_eq!(back.name.as_str(), "nozzle");
        first.replaced().await;
        runs.leave(&first);
        assert_eq!(runs.list().len(), 2);
        runs.leave(&back);
        assert!(runs.find("nozzle").is_none() && runs.find("nozzle-2").is_some());
    }

    #[test]
    fn there_is_an_end_to_runs() {
        let runs = Runs::new(8);
        let wish: RunName = "nozzle".parse().expect("a name");
        let kept: Vec<_> =
            (0..RUNS).map(|_| runs.attach(&wish, secret(), ADDRESS).expect("room")).collect();
        assert!(runs.attach(&wish, secret(), ADDRESS).is_none());
        runs.leave(&kept[3].0);
        let (run, _) = runs.attach(&wish, secret(), ADDRESS).expect("room");
        assert_eq!(run.name, kept[3].0.name);
    }

    #[tokio::test]
    async fn one_run_leaves_room_for_the_others_and_no_ticket_stays() {
        let runs = Arc::new(Runs::new(4));
        let attach = |name: &str| {
            runs.attach(&name.parse().expect("a name"), secret(), ADDRESS).expect("room")
        };
        let ((one, mut asked), (other, _other)) = (attach("one"), attach("other"));
        let dial = |run: &Arc<Run>| {
            let (runs, run) = (Arc::clone(&runs), Arc::clone(run));
            tokio::spawn(async move { runs.dial(&run, ADDRESS).await.err() })
        };
        let waiting = [dial(&one), dial(&one)];
        for _ in &waiting {
            asked.recv().await.expect("asked");
        }
        assert_eq!(dial(&one).await.expect("over"), Some(Unreached::TooMany));
        let of_other = dial(&other);
        tokio::task::yield_now().await;
        assert_eq!(lock(&runs.state).waiting.len(), 3);
        for task in waiting.into_iter().chain([of_other]) {
            task.abort();
            let _ = task.await;
        }
        assert!(lock(&runs.state).waiting.is_empty());
        assert!(runs.list().iter().all(|(_, open)| *open == 0));
    }
}
