//! What is given out for the secrets: keys to use once, and the sessions that they are traded for.

use std::{
    cmp::Reverse,
    collections::VecDeque,
    net::IpAddr,
    sync::{Arc, Mutex},
};

use tombolo_pipelines::language::StreamLimits;

use super::{allowance::Allowance, secret::Secret};
use crate::lock::lock;

/// Keys of each access that may wait to be used, and of those that one viewer has asked for; older
/// ones make way.
const KEYS: usize = 64;
const KEYS_OF_VIEWER: usize = 8;

/// The rights of a secret's holder.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Access {
    /// Sees everything and changes nothing.
    Watch,
    /// May be the driver.
    Drive,
}

impl Access {
    /// The name of these rights.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Watch => "watch",
            Self::Drive => "drive",
        }
    }
}

/// One who has shown a secret.
#[derive(Debug, Clone)]
pub(super) struct Holder {
    pub(super) access: Access,
    pub(super) allowance: Arc<Mutex<Allowance>>,
    /// Of a session, which is in use as long as another has this too.
    in_use: Arc<()>,
}

impl Holder {
    pub(super) fn new(access: Access, limits: &StreamLimits) -> Self {
        let allowance = Arc::new(Mutex::new(Allowance::of_messages(limits)));
        Self { access, allowance, in_use: Arc::default() }
    }
}

struct Session {
    id: Secret,
    holder: Holder,
    /// The address that it was begun from.
    address: IpAddr,
}

impl Session {
    /// Whether a connection shows its cookie.
    fn is_in_use(&self) -> bool {
        Arc::strong_count(&self.holder.in_use) > 1
    }
}

/// A key to use once.
struct Key {
    key: Secret,
    access: Access,
    /// The viewer that has asked for it.
    asked_by: Option<u64>,
}

/// The keys and sessions that were given out.
pub(super) struct Sessions {
    issued: Mutex<Issued>,
    limits: StreamLimits,
}

#[derive(Default)]
struct Issued {
    keys: VecDeque<Key>,
    sessions: VecDeque<Session>,
}

impl Sessions {
    /// None yet, and no more than the limits say.
    pub(super) fn new(limits: StreamLimits) -> Self {
        Self { issued: Mutex::default(), limits }
    }

    /// A new key to use once, which a viewer may have asked for. Those who watch push out no keys of
    /// those who drive.
    pub(super) fn key(
        &self,
        access: Access,
        asked_by: Option<u64>,
    ) -> Result<Secret, getrandom::Error> {
        let key = Secret::random()?;
        let keys = &mut lock(&self.issued).keys;
        let of_viewer = |known: &Key| asked_by.is_some() && known.asked_by == asked_by;
        make_way(keys, KEYS_OF_VIEWER, of_viewer);
        make_way(keys, KEYS, |known| known.access == access);
        keys.push_back(Key { key: key.clone(), access, asked_by });
        Ok(key)
    }

    /// Uses up a key, and returns the rights that it gives.
    pub(super) fn redeem(&self, key: &str) -> Option<Access> {
        let mut issued = lock(&self.issued);
        let found = issued.keys.iter().position(|known| known.key.matches(key))?;
        issued.keys.remove(found).map(|known| known.access)
    }

    /// Begins a session for a browser at an address; its id is for the cookie. All who watch from one
    /// address share an allowance, so that a new cookie is no way around it.
    pub(super) fn begin(
        &self,
        access: Access,
        address: IpAddr,
    ) -> Result<Secret, getrandom::Error> {
        let id = Secret::random()?;
        let sessions = &mut lock(&self.issued).sessions;
        let mut holder = Holder::new(access, &self.limits);
        let is_near = |it: &&Session| it.holder.access == access && it.address == address;
        if let (Access::Watch, Some(known)) = (access, sessions.iter().find(is_near)) {
            holder.allowance = Arc::clone(&known.holder.allowance);
        }
        end_one(sessions, access, self.limits.sessions.get() as usize);
        sessions.push_back(Session { id: id.clone(), holder, address });
        Ok(id)
    }

    /// Who shows this cookie.
    pub(super) fn holder(&self, id: &str) -> Option<Holder> {
        let issued = lock(&self.issued);
        let mut sessions = issued.sessions.iter();
        sessions.find(|session| session.id.matches(id)).map(|session| session.holder.clone())
    }
}

/// Ends a session where there are `most` of this access, as many as there may be: one that no connection uses,
/// of the address that has the most, the oldest. So nobody who comes again and again ends those of others,
/// and one who watches none of those who drive.
fn end_one(sessions: &mut VecDeque<Session>, access: Access, most: usize) {
    let alike = |session: &&Session| session.holder.access == access;
    if sessions.iter().filter(alike).count() < most {
        return;
    }
    let alike_from = |address: IpAddr| {
        sessions.iter().filter(|it| it.holder.access == access && it.address == address).count()
    };
    let all = sessions.iter().enumerate().filter(|(_, session)| alike(session));
    let first = all.max_by_key(|(index, session)| {
        (!session.is_in_use(), alike_from(session.address), Reverse(*index))
    });
    if let Some(index) = first.map(|(index, _)| index) {
        sessions.remove(index);
    }
}

/// Makes room for one more of those that are `alike`, where there are so many already.
fn make_way<T>(all: &mut VecDeque<T>, most: usize, alike: impl Fn(&T) -> bool) {
    if all.iter().filter(|one| alike(one)).count() >= most
        && let Some(oldest) = all.iter().position(alike)
    {
        all.remove(oldest);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HERE: IpAddr = IpAddr::V4(std::net::Ipv4Addr::LOCALHOST);

    const SESSIONS: usize = 60;

    fn sessions() -> Sessions {
        let limits = r#"{"sessions": 60, "messages": 30, "messages_at_once": 25}"#;
        Sessions::new(serde_json::from_str(limits).expect("limits"))
    }

    #[test]
    fn a_key_is_used_once() {
        let sessions = sessions();
        let key = sessions.key(Access::Watch, None).expect("a key");
        assert_eq!(sessions.redeem(&key.as_str()[1..]), None);
        assert_eq!(sessions.redeem(key.as_str()), Some(Access::Watch));
        assert_eq!(sessions.redeem(key.as_str()), None);
    }

    #[test]
    fn sessions_are_bounded_and_watching_ones_push_no_driving_one_out() {
        let sessions = sessions();
        let driving = sessions.begin(Access::Drive, HERE).expect("a session");
        let watching = sessions.begin(Access::Watch, HERE).expect("a session");
        for _ in 0..SESSIONS {
            sessions.begin(Access::Watch, HERE).expect("a session");
        }
        assert!(sessions.holder(driving.as_str()).is_some());
        assert!(sessions.holder(watching.as_str()).is_none());
    }

    #[test]
    fn one_who_watches_ends_no_session_of_another_address_and_none_in_use() {
        let sessions = sessions();
        let there = IpAddr::from([10, 0, 0, 2]);
        let begin = |address| sessions.begin(Access::Watch, address).expect("a session");
        let (used, unused, other) = (begin(HERE), begin(HERE), begin(there));
        let connection = sessions.holder(used.as_str()).expect("known");
        (0..3 * SESSIONS).for_each(|_| drop(begin(HERE)));
        let last = begin(HERE);
        let is_known = |id: &Secret| sessions.holder(id.as_str()).is_some();
        assert!(is_known(&used) && is_known(&other) && is_known(&last) && !is_known(&unused));
        assert_eq!(lock(&sessions.issued).sessions.len(), SESSIONS);
        // Its connection has ended.
        drop(connection);
        begin(HERE);
        assert!(!is_known(&used) && is_known(&other));
    }

    #[test]
    fn a_new_cookie_is_no_new_allowance_for_those_who_watch() {
        let sessions = sessions();
        let holder = |access, address| {
            let id = sessions.begin(access, address).expect("a session");
            sessions.holder(id.as_str()).expect("known")
        };
        let taken = |holder: &Holder| {
            (0..1000).take_while(|_| lock(&holder.allowance).take(0)).count() > 20
        };
        assert!(taken(&holder(Access::Watch, HERE)));
        assert!(!taken(&holder(Access::Watch, HERE)), "a new cookie is a way around it");
        assert!(taken(&holder(Access::Watch, IpAddr::from([10, 0, 0, 2]))));
        assert!(taken(&holder(Access::Drive, HERE)) && taken(&holder(Access::Drive, HERE)));
    }
}
