//! Ranks that give up together what they do together.

use std::sync::Arc;

use super::{Communicator, Message};
use crate::cancellation::Cancellation;

/// A communicator by which work that is to be given up is given up by all ranks at the same place.
///
/// Each [combination](Communicator::combine) of values, thus each reduction, carries one more byte:
/// whether a rank has asked ([`Cancellation::cancel`], from any of its threads). Nothing else is
/// sent for it, and no call is added.
///
/// # Why no rank waits for another
/// The work looks at what the ranks have *agreed* on ([`Cancellation::is_cancelled`]), never at what
/// was asked for on this rank.
///
/// 1. Before the work all ranks have it unset ([`Cancellation::renew`]).
/// 2. It changes inside of a combination alone, on the thread that does the work: from the byte that
///    the combination has brought to all ranks, the same on each.
/// 3. Combinations are collective: all ranks make the same ones, in the same order. So between one
///    of them and the next all ranks see the same.
/// 4. A look whose outcome decides what the ranks do together next stands at a place that all come
///    to, with the same number of combinations behind them. So all leave there, or none does.
///
/// What one rank does alone between two such places, such as the edit of a surface that it alone
/// has, may look at its own threads' wish: that it failed is
/// [agreed upon](super::first_failure), as any other failure is.
///
/// Each step of work in which the ranks combine something is given up in it; iterations of a solve
/// do so several times each.
#[derive(Debug)]
pub struct Cancelling {
    ranks: Arc<dyn Communicator>,
    cancellation: Cancellation,
}

impl Cancelling {
    pub(crate) fn new(ranks: Arc<dyn Communicator>, cancellation: Cancellation) -> Self {
        Self { ranks, cancellation }
    }
}

impl Communicator for Cancelling {
    fn rank(&self) -> usize {
        self.ranks.rank()
    }

    fn size(&self) -> usize {
        self.ranks.size()
    }

    fn broadcast(&self, root: usize, bytes: &mut Vec<u8>) {
        self.ranks.broadcast(root, bytes);
    }

    fn gather(&self, root: usize, bytes: &[u8]) -> Option<Vec<Vec<u8>>> {
        self.ranks.gather(root, bytes)
    }

    fn combine(&self, bytes: &mut Vec<u8>, take_in: &dyn Fn(&mut [u8], &[u8])) {
        bytes.push(u8::from(self.cancellation.is_asked()));
        self.ranks.combine(bytes, &|mine, more| {
            if let (Some((asked, mine)), Some((also, more))) =
                (mine.split_last_mut(), more.split_last())
            {
                *asked |= also;
                take_in(mine, more);
            }
        });
        if bytes.pop().is_some_and(|asked| asked > 0) {
            self.cancellation.agree();
        }
    }

    fn barrier(&self) {
        self.ranks.barrier();
    }

    fn exchange(&self, messages: Vec<Message>) -> Vec<Message> {
        self.ranks.exchange(messages)
    }

    fn exchange_with(&self, messages: Vec<Message>, from: &[usize]) -> Vec<Message> {
        self.ranks.exchange_with(messages, from)
    }

    fn abort(&self) {
        self.ranks.abort();
    }
}

// Ranks are threads, which WebAssembly does not have.
#[cfg(all(test, not(target_family = "wasm")))]
mod tests {
    use super::*;
    use crate::communicator::{Counted, Reduction, threads};

    /// What one rank asks for, all see behind the next reduction and not before, whose values are
    /// the same bits as without; no call is added.
    #[test]
    fn all_ranks_know_behind_the_same_reduction() {
        for asking in 0..3 {
            let seen = threads::run(3, |ranks| {
                let mine = 0.1 + ranks.rank() as f64;
                let mut expected = [mine, -mine];
                ranks.reduce(Reduction::Sum, &mut expected);
                let rank = ranks.rank();
                let (counted, cancellation) =
                    (Arc::new(Counted::new(ranks)), Cancellation::of_ranks());
                let ranks = Cancelling::new(counted.clone(), cancellation.clone());
                let mut seen = Vec::new();
                for step in 0..4 {
                    if step == 2 && rank == asking {
                        cancellation.cancel();
                    }
                    seen.push(cancellation.is_cancelled());
                    let mut values = [mine, -mine];
                    ranks.reduce(Reduction::Sum, &mut values);
                    assert_eq!(values.map(f64::to_bits), expected.map(f64::to_bits));
                    seen.push(cancellation.is_cancelled());
                }
                assert_eq!(counted.traffic().calls, 4);
                cancellation.renew();
                assert_eq!(ranks.most(rank), 2);
                seen.push(cancellation.is_cancelled());
                seen
            });
            let expected = [false, false, false, false, false, true, true, true, false];
            assert!(seen.iter().all(|seen| *seen == expected), "{seen:?}");
        }
    }
}
