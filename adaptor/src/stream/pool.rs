//! The connections that are open, of which those that have shown no secret keep nobody out.

use std::{
    net::IpAddr,
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, AtomicUsize, Ordering},
    },
};

use futures_util::task::AtomicWaker;
use tombolo_pipelines::language::StreamLimits;

use super::{
    credentials::Access,
    refusals::{Refusals, Refused},
};
use crate::lock::lock;

/// Connections beyond the limit for those who may drive.
const RESERVED: usize = 8;

/// One client's connection, as its handlers and the pool know it.
#[derive(Debug)]
pub(super) struct Guest {
    pub(super) address: IpAddr,
    /// It has shown a secret.
    pub(super) is_known: AtomicBool,
    /// It has become a WebSocket.
    pub(super) is_upgraded: AtomicBool,
    /// Requests of it that the server has not answered yet.
    pub(super) unanswered: AtomicUsize,
    /// It is to end, to make way for another.
    pub(super) is_cut: AtomicBool,
    /// Woken when it is cut.
    pub(super) waker: AtomicWaker,
}

impl Guest {
    fn cut(&self) {
        self.is_cut.store(true, Ordering::Release);
        self.waker.wake();
    }
}

/// The connections that are open.
#[derive(Debug)]
pub(super) struct Pool {
    open: Mutex<Open>,
    /// Connections at once that may have shown a secret.
    most: usize,
    /// Those that may have shown none, and of these from one address that is not this machine's.
    unknown: usize,
    unknown_of_address: usize,
    pub(super) refusals: Arc<Refusals>,
}

#[derive(Debug, Default)]
struct Open {
    /// Connections that have shown no secret, the oldest first.
    unknown: Vec<Arc<Guest>>,
    known: usize,
}

impl Pool {
    pub(super) fn new(limits: &StreamLimits, refusals: Arc<Refusals>) -> Self {
        Self {
            open: Mutex::default(),
            most: limits.connections.get() as usize,
            unknown: limits.unknown_connections.get() as usize,
            unknown_of_address: limits.unknown_connections_of_address.get() as usize,
            refusals,
        }
    }

    /// Takes in a connection; where there are too many like it, the oldest makes way. A flood of
    /// them gives each little time, and keeps nobody out who is quicker than that.
    pub(super) fn enter(&self, address: IpAddr) -> Arc<Guest> {
        let guest = Arc::new(Guest {
            address,
            is_known: AtomicBool::new(false),
            is_upgraded: AtomicBool::new(false),
            unanswered: AtomicUsize::new(0),
            is_cut: AtomicBool::new(false),
            waker: AtomicWaker::new(),
        });
        let mut open = lock(&self.open);
        let of_address = |guest: &Arc<Guest>| guest.address == address;
        let count = open.unknown.iter().filter(|guest| of_address(guest)).count();
        let is_much = count >= self.unknown_of_address && !address.is_loopback();
        let oldest = if is_much {
            open.unknown.iter().position(of_address)
        } else {
            (open.unknown.len() >= self.unknown).then_some(0)
        };
        if let Some(oldest) = oldest {
            open.unknown.remove(oldest).cut();
        }
        open.unknown.push(Arc::clone(&guest));
        drop(open);
        if oldest.is_some() {
            let what = || format!("a connection from {address} has ended an older one");
            self.refusals.tell(address, Refused::Crowd, None, what);
        }
        guest
    }

    /// Takes note that a connection has shown a secret; `false` where there are too many of them.
    pub(super) fn know(&self, guest: &Arc<Guest>, access: Access) -> bool {
        if guest.is_known.load(Ordering::Acquire) {
            return true;
        }
        let mut open = lock(&self.open);
        let reserved = if access == Access::Drive { RESERVED } else { 0 };
        if guest.is_cut.load(Ordering::Acquire) || open.known >= self.most + reserved {
            return false;
        }
        open.unknown.retain(|other| !Arc::ptr_eq(other, guest));
        open.known += 1;
        guest.is_known.store(true, Ordering::Release);
        true
    }

    pub(super) fn leave(&self, guest: &Arc<Guest>) {
        let mut open = lock(&self.open);
        if guest.is_known.load(Ordering::Acquire) {
            open.known -= 1;
        } else {
            open.unknown.retain(|other| !Arc::ptr_eq(other, guest));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pool() -> Pool {
        let limits =
            r#"{"connections": 2, "unknown_connections": 50, "unknown_connections_of_address": 5}"#;
        Pool::new(&serde_json::from_str(limits).expect("limits"), Arc::default())
    }

    fn address(last: u8) -> IpAddr {
        IpAddr::from([10, 0, 0, last])
    }

    #[test]
    fn the_oldest_unknown_makes_way_and_those_of_one_address_among_themselves() {
        let pool = pool();
        let other = pool.enter(address(1));
        let flood: Vec<_> = (0..200).map(|_| pool.enter(address(2))).collect();
        let cut = |guest: &Guest| guest.is_cut.load(Ordering::Relaxed);
        assert!(!cut(&other));
        assert_eq!(flood.iter().filter(|guest| !cut(guest)).count(), 5);
        assert!(!cut(&flood[199]));
        // Behind the loopback address there may be anybody.
        let local: Vec<_> = (0..200).map(|_| pool.enter([127, 0, 0, 1].into())).collect();
        assert!(cut(&other));
        assert_eq!(local.iter().filter(|guest| !cut(guest)).count(), 50);
        flood.iter().chain(&local).for_each(|guest| pool.leave(guest));
        assert!(lock(&pool.open).unknown.is_empty());
    }

    #[test]
    fn who_has_shown_a_secret_makes_way_for_nobody() {
        let pool = pool();
        let known: Vec<_> = (0..2).map(|_| pool.enter(address(1))).collect();
        assert!(known.iter().all(|guest| pool.know(guest, Access::Watch)));
        for _ in 0..200 {
            pool.enter(address(1));
        }
        assert!(known.iter().all(|guest| !guest.is_cut.load(Ordering::Relaxed)));
        let third = pool.enter(address(1));
        assert!(!pool.know(&third, Access::Watch), "the limit");
        assert!(pool.know(&third, Access::Drive), "a place is kept");
        pool.leave(&known[0]);
        pool.leave(&known[1]);
        assert_eq!(lock(&pool.open).known, 1);
    }
}
