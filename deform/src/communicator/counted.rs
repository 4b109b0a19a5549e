//! Counting what goes through a communicator.

use std::sync::atomic::{AtomicU64, Ordering};

use serde::Serialize;

use super::{Communicator, Message, tree};

/// The messages and bytes that a rank has sent and heard.
///
/// Messages of a rank to itself are not counted. A broadcast counts once at its root, whatever tree
/// carries it on; values that come together on one rank, once at each rank that they pass.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Traffic {
    /// Collective calls, barriers among them.
    pub calls: u64,
    /// Messages sent.
    pub messages_sent: u64,
    /// Their bytes.
    pub bytes_sent: u64,
    /// Messages heard.
    pub messages_heard: u64,
    /// Their bytes.
    pub bytes_heard: u64,
}

impl std::ops::Sub for Traffic {
    type Output = Self;

    /// The traffic since `before`.
    fn sub(self, before: Self) -> Self {
        Self {
            calls: self.calls - before.calls,
            messages_sent: self.messages_sent - before.messages_sent,
            bytes_sent: self.bytes_sent - before.bytes_sent,
            messages_heard: self.messages_heard - before.messages_heard,
            bytes_heard: self.bytes_heard - before.bytes_heard,
        }
    }
}

/// A communicator that counts.
///
/// ```
/// use tombolo_deform::communicator::{Communicator, Counted, threads};
///
/// let heard = threads::run(3, |ranks| {
///     let ranks = Counted::new(ranks);
///     ranks.gather(0, &[0; 100]);
///     ranks.traffic().bytes_heard
/// });
/// assert_eq!(heard, [200, 0, 0]);
/// ```
#[derive(Debug, Default)]
pub struct Counted<C> {
    communicator: C,
    calls: AtomicU64,
    sent: [AtomicU64; 2],
    heard: [AtomicU64; 2],
}

impl<C: Communicator> Counted<C> {
    /// Counts from 0.
    pub fn new(communicator: C) -> Self {
        let [calls, a, b, c, d] = std::array::from_fn(|_| AtomicU64::new(0));
        Self { communicator, calls, sent: [a, b], heard: [c, d] }
    }

    /// The traffic so far.
    #[must_use]
    pub fn traffic(&self) -> Traffic {
        let read = |count: &AtomicU64| count.load(Ordering::Relaxed);
        Traffic {
            calls: read(&self.calls),
            messages_sent: read(&self.sent[0]),
            bytes_sent: read(&self.sent[1]),
            messages_heard: read(&self.heard[0]),
            bytes_heard: read(&self.heard[1]),
        }
    }

    fn call(&self) {
        self.calls.fetch_add(1, Ordering::Relaxed);
    }

    /// Exchanges messages, and counts them.
    fn counted(
        &self,
        messages: Vec<Message>,
        exchange: impl FnOnce(Vec<Message>) -> Vec<Message>,
    ) -> Vec<Message> {
        self.call();
        let rank = self.rank();
        let others = |messages: &[Message], counts: &[AtomicU64; 2]| {
            let others = messages.iter().filter(|(other, _)| *other != rank);
            others.for_each(|(_, bytes)| Self::count(counts, bytes.len()));
        };
        others(&messages, &self.sent);
        let heard = exchange(messages);
        others(&heard, &self.heard);
        heard
    }

    fn count([messages, bytes]: &[AtomicU64; 2], length: usize) {
        messages.fetch_add(1, Ordering::Relaxed);
        bytes.fetch_add(length as u64, Ordering::Relaxed);
    }
}

impl<C: Communicator> Communicator for Counted<C> {
    fn rank(&self) -> usize {
        self.communicator.rank()
    }

    fn size(&self) -> usize {
        self.communicator.size()
    }

    fn broadcast(&self, root: usize, bytes: &mut Vec<u8>) {
        self.call();
        self.communicator.broadcast(root, bytes);
        if self.size() > 1 {
            Self::count(if self.rank() == root { &self.sent } else { &self.heard }, bytes.len());
        }
    }

    fn gather(&self, root: usize, bytes: &[u8]) -> Option<Vec<Vec<u8>>> {
        self.call();
        let gathered = self.communicator.gather(root, bytes);
        match &gathered {
            None => Self::count(&self.sent, bytes.len()),
            Some(all) => {
                let others = all.iter().enumerate().filter(|(rank, _)| *rank != root);
                others.for_each(|(_, bytes)| Self::count(&self.heard, bytes.len()));
            }
        }
        gathered
    }

    fn combine(&self, bytes: &mut Vec<u8>, take_in: &dyn Fn(&mut [u8], &[u8])) {
        self.call();
        let length = bytes.len();
        self.communicator.combine(bytes, take_in);
        let (children, parent) = tree(self.rank(), self.size());
        children.iter().for_each(|_| Self::count(&self.heard, length));
        if parent.is_some() {
            Self::count(&self.sent, length);
            Self::count(&self.heard, length);
        } else if self.size() > 1 {
            Self::count(&self.sent, length);
        }
    }

    fn barrier(&self) {
        self.call();
        self.communicator.barrier();
    }

    fn exchange(&self, messages: Vec<Message>) -> Vec<Message> {
        self.counted(messages, |messages| self.communicator.exchange(messages))
    }

    fn exchange_with(&self, messages: Vec<Message>, from: &[usize]) -> Vec<Message> {
        self.counted(messages, |messages| self.communicator.exchange_with(messages, from))
    }

    fn abort(&self) {
        self.communicator.abort();
    }
}
