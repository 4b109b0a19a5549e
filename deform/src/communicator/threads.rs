//! Ranks that are threads of one process: what runs on several ranks can be tried without MPI.

use std::{
    any::Any,
    sync::{Arc, Condvar, Mutex, PoisonError},
    thread,
};

use super::{Communicator, Message, combine};

/// Where the ranks meet.
#[derive(Debug)]
struct Board {
    state: Mutex<Exchange>,
    met: Condvar,
}

#[derive(Debug)]
struct Exchange {
    /// How often all have met.
    meeting: u64,
    /// Who has come to the next meeting, and for what.
    arrived: usize,
    purpose: &'static str,
    /// The messages brought to the next meeting for each rank, and those that the last one left for
    /// it.
    brought: Vec<Vec<Message>>,
    left: Vec<Vec<Message>>,
    /// The rank that will not come any more.
    gone: Option<usize>,
}

/// One of the ranks that [`run`] started.
#[derive(Debug, Clone)]
pub struct Threads {
    rank: usize,
    size: usize,
    board: Arc<Board>,
}

impl Threads {
    /// # Panics
    /// Where a rank will not come any more.
    fn require_all(&self, purpose: &str, state: &Exchange) {
        if let Some(gone) = state.gone {
            panic!("rank {} waits in `{purpose}` for rank {gone}, which has ended", self.rank);
        }
    }

    /// Brings messages to the next meeting of all ranks and takes those for this rank home from it.
    ///
    /// # Panics
    /// Where another rank has come for something else, or will not come at all: with MPI both would
    /// wait for ever.
    fn meet(&self, purpose: &'static str, messages: Vec<Message>) -> Vec<Message> {
        let mut state = self.board.state.lock().unwrap_or_else(PoisonError::into_inner);
        self.require_all(purpose, &state);
        if state.arrived == 0 {
            state.purpose = purpose;
        } else if state.purpose != purpose {
            let other = state.purpose;
            state.gone = Some(self.rank);
            drop(state);
            self.board.met.notify_all();
            panic!("rank {} calls `{purpose}` where another one calls `{other}`", self.rank);
        }
        for (to, bytes) in messages {
            state.brought[to].push((self.rank, bytes));
        }
        state.arrived += 1;
        let meeting = state.meeting;
        if state.arrived == self.size {
            state.left = std::mem::replace(&mut state.brought, vec![Vec::new(); self.size]);
            state.arrived = 0;
            state.meeting += 1;
            self.board.met.notify_all();
        }
        while state.meeting == meeting {
            self.require_all(purpose, &state);
            state = self.board.met.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        let mut mine = std::mem::take(&mut state.left[self.rank]);
        drop(state);
        // Of each sender they are in order already.
        mine.sort_by_key(|(from, _)| *from);
        mine
    }

    /// The bytes of each rank, in the order of the ranks, on all of them.
    fn meet_all(&self, purpose: &'static str, bytes: &[u8]) -> Vec<Vec<u8>> {
        let messages = (0..self.size).map(|to| (to, bytes.to_vec())).collect();
        self.meet(purpose, messages).into_iter().map(|(_, bytes)| bytes).collect()
    }
}

impl Communicator for Threads {
    fn rank(&self) -> usize {
        self.rank
    }

    fn size(&self) -> usize {
        self.size
    }

    fn broadcast(&self, root: usize, bytes: &mut Vec<u8>) {
        let messages = if self.rank == root {
            (0..self.size).filter(|&to| to != root).map(|to| (to, bytes.clone())).collect()
        } else {
            Vec::new()
        };
        if let Some((_, sent)) = self.meet("broadcast", messages).pop() {
            *bytes = sent;
        }
    }

    fn gather(&self, root: usize, bytes: &[u8]) -> Option<Vec<Vec<u8>>> {
        let gathered = self.meet("gather", vec![(root, bytes.to_vec())]);
        (self.rank == root).then(|| gathered.into_iter().map(|(_, bytes)| bytes).collect())
    }

    fn combine(&self, bytes: &mut Vec<u8>, take_in: &dyn Fn(&mut [u8], &[u8])) {
        *bytes = combine(self.meet_all("combine", bytes), take_in);
    }

    fn barrier(&self) {
        self.meet("barrier", Vec::new());
    }

    fn exchange(&self, messages: Vec<Message>) -> Vec<Message> {
        self.meet("exchange", messages)
    }

    /// The others panic where they wait for this one, now or later.
    fn abort(&self) {
        self.board
            .state
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .gone
            .get_or_insert(self.rank);
        self.board.met.notify_all();
    }
}

/// Tells the others when its rank ends before its time.
struct Presence(Threads);

impl Drop for Presence {
    fn drop(&mut self) {
        if thread::panicking() {
            self.0.abort();
        }
    }
}

/// Runs `work` on `size` ranks, each a thread of this process, and returns what they return, in the
/// order of the ranks.
///
/// ```
/// use tombolo_deform::communicator::{Communicator, Reduction, threads};
///
/// let sums = threads::run(3, |ranks| {
///     let mut values = [ranks.rank() as f64];
///     ranks.reduce(Reduction::Sum, &mut values);
///     values[0]
/// });
/// assert_eq!(sums, [3.0; 3]);
/// ```
///
/// # Panics
/// Where the work of a rank panics, with what the first of them said: the others are told and do
/// not wait for it.
pub fn run<T: Send>(size: usize, work: impl Fn(Threads) -> T + Sync) -> Vec<T> {
    let state = Exchange {
        meeting: 0,
        arrived: 0,
        purpose: "",
        brought: vec![Vec::new(); size],
        left: vec![Vec::new(); size],
        gone: None,
    };
    let board = Arc::new(Board { state: Mutex::new(state), met: Condvar::new() });
    let outcomes: Vec<Result<T, Box<dyn Any + Send>>> = thread::scope(|scope| {
        let rank = |rank: usize| {
            let (board, work) = (Arc::clone(&board), &work);
            scope.spawn(move || {
                let communicator = Threads { rank, size, board };
                let _presence = Presence(communicator.clone());
                work(communicator)
            })
        };
        let threads: Vec<_> = (0..size).map(rank).collect();
        threads.into_iter().map(thread::ScopedJoinHandle::join).collect()
    });
    let gone = board.state.lock().unwrap_or_else(PoisonError::into_inner).gone;
    let mut results = Vec::with_capacity(size);
    let mut panics = Vec::new();
    for (rank, outcome) in outcomes.into_iter().enumerate() {
        match outcome {
            Ok(result) => results.push(result),
            Err(panic) => panics.push((gone != Some(rank), panic)),
        }
    }
    // The one that ended first says why; the others only that they waited for it.
    panics.sort_by_key(|(waited, _)| *waited);
    match panics.into_iter().next() {
        Some((_, panic)) => std::panic::resume_unwind(panic),
        None => results,
    }
}

// WebAssembly does not have threads.
#[cfg(all(test, not(target_family = "wasm")))]
mod tests {
    use super::super::Reduction;
    use super::*;

    /// Checks the contract of a communicator; the tests of MPI check the same.
    fn check(ranks: &dyn Communicator) {
        let (rank, size) = (ranks.rank(), ranks.size());
        let mut bytes = if rank == size - 1 { vec![7; 1000] } else { vec![1] };
        ranks.broadcast(size - 1, &mut bytes);
        assert_eq!(bytes, [7; 1000]);
        let gathered = ranks.gather(0, &vec![rank as u8; rank]);
        assert_eq!(
            gathered,
            (rank == 0).then(|| (0..size).map(|rank| vec![rank as u8; rank]).collect())
        );
        let mut values = [rank as f64, -(rank as f64)];
        ranks.reduce(Reduction::Minimum, &mut values);
        assert_eq!(values, [0.0, -(size as f64 - 1.0)]);
        let mut values = [f64::NAN, if rank == 0 { 2.0 } else { f64::NAN }];
        ranks.reduce(Reduction::Maximum, &mut values);
        assert!(values[0].is_nan() && values[1] == 2.0, "NaN is passed over");
        let none = [f64::INFINITY, f64::NEG_INFINITY];
        let mut ranges =
            [if rank == 0 { [1.0, 2.0] } else { none }, [-(rank as f64), rank as f64], none];
        ranks.join_ranges(&mut ranges);
        let last = size as f64 - 1.0;
        assert_eq!(ranges, [[1.0, 2.0], [-last, last], none]);
        let sums = [1.0 / (rank as f64 + 3.0), 1e16 * (-1f64).powi(rank as i32)];
        let mut values = sums;
        ranks.reduce(Reduction::Sum, &mut values);
        let expected = (1..size).fold([1.0 / 3.0, 1e16], |sum, rank| {
            [sum[0] + 1.0 / (rank as f64 + 3.0), sum[1] + 1e16 * (-1f64).powi(rank as i32)]
        });
        assert_eq!(values, expected, "in the order of the ranks");
        // Beyond 2^53, where floats would round.
        let mut values = [(1 << 60) + rank as u64, u64::MAX - 1];
        ranks.reduce_integers(Reduction::Maximum, &mut values);
        assert_eq!(values[0], (1 << 60) + size as u64 - 1);
        ranks.reduce_integers(Reduction::Sum, &mut values[1..]);
        assert_eq!(values[1], if size == 1 { u64::MAX - 1 } else { u64::MAX });
        assert_eq!(
            (ranks.total(rank), ranks.most(rank), ranks.least(rank + 7)),
            (size * (size - 1) / 2, size - 1, 7)
        );
        assert!(
            ranks.any(rank == size - 1)
                && ranks.all(rank < size)
                && ranks.all(rank == 0) == (size == 1)
        );
        let all: Vec<Vec<u8>> = (0..size).map(|rank| vec![rank as u8; rank]).collect();
        assert_eq!(ranks.gather_all(&vec![rank as u8; rank]), all);
        ranks.barrier();
        for round in 0..20 {
            // To the next rank twice, to itself, and to nobody else.
            let next = (rank + 1) % size;
            let say = |what: u8| vec![rank as u8, what, round];
            let heard = ranks.exchange(vec![(next, say(1)), (rank, say(2)), (next, say(3))]);
            let before = (rank + size - 1) % size;
            let mut expected = vec![(before, 1), (rank, 2), (before, 3)];
            expected.sort_by_key(|(from, _)| *from);
            let expected: Vec<_> = expected
                .into_iter()
                .map(|(from, what)| (from, vec![from as u8, what, round]))
                .collect();
            assert_eq!(heard, expected);
        }
        assert_eq!(ranks.exchange(Vec::new()), []);
    }

    #[test]
    fn ranks_exchange_what_they_have() {
        check(&super::super::Solo);
        for size in 1..=5 {
            run(size, |ranks| check(&ranks));
        }
    }

    #[test]
    fn a_rank_that_ends_does_not_leave_the_others_waiting() {
        let caught = std::panic::catch_unwind(|| {
            run(3, |ranks| {
                assert!(ranks.rank() != 1, "rank 1 has had enough");
                ranks.barrier();
            });
        });
        let said = caught.unwrap_err();
        assert!(
            said.downcast_ref::<String>().is_some_and(|said| said.contains("had enough"))
                || said.downcast_ref::<&str>().is_some_and(|said| said.contains("had enough"))
        );
    }

    #[test]
    fn calls_that_do_not_fit_together_are_found() {
        let caught = std::panic::catch_unwind(|| {
            run(2, |ranks| {
                if ranks.rank() == 0 {
                    ranks.barrier()
                } else {
                    ranks.reduce(Reduction::Sum, &mut [1.0])
                }
            });
        });
        assert!(
            caught
                .unwrap_err()
                .downcast_ref::<String>()
                .is_some_and(|said| said.contains("where another one calls"))
        );
    }
}
