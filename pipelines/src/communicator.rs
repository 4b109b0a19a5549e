//! The processes that a mesh is distributed over.
//!
//! A [`Communicator`] is one process ([`Solo`]), the ranks of an MPI communicator (the adaptor's, with its feature `distributed`),
//! or a number of [`threads`] of one process. [`Counted`] counts what goes through one.

mod alarm;
mod counted;
pub mod threads;

pub use alarm::Alarm;
pub use counted::{Counted, Traffic};
pub use threads::Threads;

pub use tombolo_deform::partition::Reduction;

/// The processes that run together: one ([`Solo`]) or the ranks of an MPI communicator.
///
/// Every method but [`rank`](Communicator::rank), [`size`](Communicator::size) and [`abort`](Communicator::abort) is collective: all
/// ranks call it, in the same order, or all wait.
pub trait Communicator: Send + Sync {
    /// This process's number, from 0.
    fn rank(&self) -> usize;
    /// How many processes there are, at least 1.
    fn size(&self) -> usize;
    /// Replaces `bytes` on every rank with those of `root`.
    fn broadcast(&self, root: usize, bytes: &mut Vec<u8>);
    /// The bytes of all ranks in the order of their numbers on `root`; `None` elsewhere.
    fn gather(&self, root: usize, bytes: &[u8]) -> Option<Vec<Vec<u8>>>;
    /// Combines each value over all ranks, which bring the same number of them; every rank has the result.
    fn reduce(&self, reduction: Reduction, values: &mut [f64]);
    /// Returns once every rank has come here.
    fn barrier(&self);
    /// Sends each message to its rank, this one too if it is named, and returns those sent here with their senders, in the
    /// order of the senders and for each in the order in which it named them. A rank with nothing to say sends nothing, but calls.
    fn exchange(&self, messages: Vec<(usize, Vec<u8>)>) -> Vec<(usize, Vec<u8>)>;
    /// The same where every rank knows whom it hears: each of the ranks `from`, none twice, sends one message here, and no other does.
    /// No rank waits for others than those.
    fn exchange_with(
        &self,
        messages: Vec<(usize, Vec<u8>)>,
        from: &[usize],
    ) -> Vec<(usize, Vec<u8>)> {
        let _ = from;
        self.exchange(messages)
    }
    /// Ends all ranks, because this one cannot go on; where the others are processes, this one too. For defects alone: see [`Alarm`].
    fn abort(&self);
}

/// How many ranks hand what they have to one of them in the tree by which values come together.
pub const FAN: usize = 32;

/// Where a rank stands in the tree by which values come together on rank 0: the ranks it hears, in order, and the one that it
/// tells (`None` on rank 0).
///
/// At each level every [`FAN`]-th rank of those that are left hears the ones up to the next. So rank 0 hears
/// `(FAN - 1) * log(size) / log(FAN)` ranks at most, and what a rank has heard is of consecutive ranks that begin with itself.
#[must_use]
pub fn tree(rank: usize, size: usize) -> (Vec<usize>, Option<usize>) {
    let mut children = Vec::new();
    let mut step = 1;
    while step < size {
        let group = step * FAN;
        if !rank.is_multiple_of(group) {
            return (children, Some(rank - rank % group));
        }
        children
            .extend((1..FAN).map(|place| rank + place * step).take_while(|&child| child < size));
        step = group;
    }
    (children, None)
}

/// Combines the values of the ranks in the order in which the [`tree`] does: that of the ranks, for up to [`FAN`] of them.
#[must_use]
pub fn combine(reduction: Reduction, mut parts: Vec<Vec<f64>>) -> Vec<f64> {
    let size = parts.len();
    let mut step = 1;
    while step < size {
        for parent in (0..size).step_by(step * FAN) {
            for child in
                (1..FAN).map(|place| parent + place * step).take_while(|&child| child < size)
            {
                let more = std::mem::take(&mut parts[child]);
                reduction.take_in(&mut parts[parent], &more);
            }
        }
        step *= FAN;
    }
    parts.into_iter().next().unwrap_or_default()
}

/// What went wrong on one rank, known to all.
#[derive(Debug, Clone, PartialEq, Eq, Hash, thiserror::Error)]
#[error("rank {rank}: {message}")]
pub struct RankError {
    /// The rank, the lowest of those on which something went wrong.
    pub rank: usize,
    /// What.
    pub message: String,
}

/// Goes on where all ranks can: where one cannot, all of them get its error. Collective.
///
/// Whatever can fail on one rank alone is agreed upon before the next thing that all do together, so that none waits for one that
/// has given up.
///
/// ```
/// use tombolo_pipelines::communicator::{Communicator, agree, threads};
///
/// let outcomes = threads::run(3, |ranks| {
///     let mine = if ranks.rank() == 1 { Err("a coordinate is NaN") } else { Ok(()) };
///     agree(&ranks, mine).map_err(|error| error.to_string())
/// });
/// assert_eq!(outcomes, vec![Err("rank 1: a coordinate is NaN".to_owned()); 3]);
/// ```
///
/// # Errors
/// The error of the lowest rank that has one.
pub fn agree<T, E: ToString>(
    communicator: &dyn Communicator,
    mine: Result<T, E>,
) -> Result<T, RankError> {
    let (rank, size) = (communicator.rank(), communicator.size());
    #[expect(clippy::cast_precision_loss, reason = "ranks below 2^53")]
    let mut failing = [if mine.is_err() { rank } else { size } as f64];
    communicator.reduce(Reduction::Minimum, &mut failing);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a rank")]
    let failing = failing[0] as usize;
    match mine {
        Ok(value) if failing >= size => Ok(value),
        mine => {
            let message = mine.err().map(|error| error.to_string()).unwrap_or_default();
            let mut bytes = if rank == failing { message.into_bytes() } else { Vec::new() };
            communicator.broadcast(failing.min(size - 1), &mut bytes);
            Err(RankError {
                rank: failing.min(size - 1),
                message: String::from_utf8_lossy(&bytes).into_owned(),
            })
        }
    }
}

macro_rules! forwarded {
    ($($type:ty),*) => {$(
        impl<C: Communicator + ?Sized> Communicator for $type {
            fn rank(&self) -> usize {
                (**self).rank()
            }
            fn size(&self) -> usize {
                (**self).size()
            }
            fn broadcast(&self, root: usize, bytes: &mut Vec<u8>) {
                (**self).broadcast(root, bytes);
            }
            fn gather(&self, root: usize, bytes: &[u8]) -> Option<Vec<Vec<u8>>> {
                (**self).gather(root, bytes)
            }
            fn reduce(&self, reduction: Reduction, values: &mut [f64]) {
                (**self).reduce(reduction, values);
            }
            fn barrier(&self) {
                (**self).barrier();
            }
            fn exchange(&self, messages: Vec<(usize, Vec<u8>)>) -> Vec<(usize, Vec<u8>)> {
                (**self).exchange(messages)
            }
            fn exchange_with(&self, messages: Vec<(usize, Vec<u8>)>, from: &[usize]) -> Vec<(usize, Vec<u8>)> {
                (**self).exchange_with(messages, from)
            }
            fn abort(&self) {
                (**self).abort();
            }
        }
    )*};
}

forwarded!(&C, std::sync::Arc<C>);

/// A communicator of one process.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Solo;

impl Communicator for Solo {
    fn rank(&self) -> usize {
        0
    }
    fn size(&self) -> usize {
        1
    }
    fn broadcast(&self, _root: usize, _bytes: &mut Vec<u8>) {}
    fn gather(&self, _root: usize, bytes: &[u8]) -> Option<Vec<Vec<u8>>> {
        Some(vec![bytes.to_vec()])
    }
    fn reduce(&self, _reduction: Reduction, _values: &mut [f64]) {}
    fn barrier(&self) {}
    fn exchange(&self, messages: Vec<(usize, Vec<u8>)>) -> Vec<(usize, Vec<u8>)> {
        messages.into_iter().filter(|(to, _)| *to == 0).collect()
    }
    fn abort(&self) {}
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_rank_is_heard_once_and_in_order() {
        for size in [1, 2, 3, 31, 32, 33, 64, 1000, 1025, 40_000] {
            let mut heard: Vec<Vec<usize>> = (0..size).map(|rank| vec![rank]).collect();
            for rank in (0..size).rev() {
                let (children, parent) = tree(rank, size);
                assert_eq!(parent.is_none(), rank == 0);
                for child in children {
                    assert_eq!(tree(child, size).1, Some(rank));
                    let more = std::mem::take(&mut heard[child]);
                    heard[rank].extend(more);
                }
            }
            assert!(heard[0].iter().copied().eq(0..size), "{size}");
            assert!(tree(0, size).0.len() <= 31 * 4);
        }
    }

    #[test]
    fn sums_do_not_depend_on_chance() {
        let parts = |size: usize| {
            (0..size).map(|rank| vec![1.0 / (rank as f64 + 3.0), 1e16 * (-1f64).powi(rank as i32)])
        };
        let few: Vec<Vec<f64>> = parts(7).collect();
        let mut in_order = few[0].clone();
        few[1..].iter().for_each(|more| Reduction::Sum.take_in(&mut in_order, more));
        assert_eq!(combine(Reduction::Sum, few), in_order);
        // As the tree does it.
        let many: Vec<Vec<f64>> = parts(1030).collect();
        let mut held = many.clone();
        for rank in (0..held.len()).rev() {
            for child in tree(rank, many.len()).0 {
                let more = held[child].clone();
                Reduction::Sum.take_in(&mut held[rank], &more);
            }
        }
        assert_eq!(combine(Reduction::Sum, many), held[0]);
        assert_eq!(
            combine(Reduction::Maximum, vec![vec![f64::NAN, 1.0], vec![2.0, f64::NAN]]),
            [2.0, 1.0]
        );
    }
}
