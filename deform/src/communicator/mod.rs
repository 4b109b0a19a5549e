//! The processes that share a mesh, and what they say to each other.
//!
//! A [`Communicator`] is one process ([`Solo`]), the ranks of an MPI communicator, or a number of
//! [`threads`] of one process; [`Counted`] counts what goes through one. [`agree`] is the way in
//! which ranks fail together, [`Cancelling`] that in which they give up together. A [`Halo`] knows
//! which entries of a list other ranks list too.

mod alarm;
mod cancelling;
mod counted;
mod halo;
mod message;
pub mod threads;
mod tree;

pub use alarm::Alarm;
pub use cancelling::Cancelling;
pub use counted::{Counted, Traffic};

pub use halo::{Halo, Neighbour, Value};
pub use message::{Garbled, Reader, Writer};
pub use threads::Threads;
pub use tree::{combine, tree};

/// Bytes for a rank, or from one.
pub type Message = (usize, Vec<u8>);

/// How the values of the ranks are combined.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reduction {
    /// The smallest; NaN is passed over.
    Minimum,
    /// The largest; NaN is passed over.
    Maximum,
    /// The sum, added in a fixed order, so that the bits do not depend on chance.
    Sum,
}

impl Reduction {
    fn of_numbers(self, a: f64, b: f64) -> f64 {
        match self {
            Reduction::Minimum => a.min(b),
            Reduction::Maximum => a.max(b),
            Reduction::Sum => a + b,
        }
    }

    fn of_integers(self, a: u64, b: u64) -> u64 {
        match self {
            Reduction::Minimum => a.min(b),
            Reduction::Maximum => a.max(b),
            Reduction::Sum => a.saturating_add(b),
        }
    }
}

/// The processes that run together: one ([`Solo`]) or the ranks of an MPI communicator.
///
/// Every method but [`rank`](Communicator::rank), [`size`](Communicator::size) and
/// [`abort`](Communicator::abort) is collective: all ranks call it, in the same order, or all wait.
pub trait Communicator: std::fmt::Debug + Send + Sync {
    /// This process's number, from 0.
    fn rank(&self) -> usize;

    /// How many processes there are, at least 1.
    fn size(&self) -> usize;

    /// Replaces `bytes` on every rank with those of `root`.
    fn broadcast(&self, root: usize, bytes: &mut Vec<u8>);

    /// The bytes of all ranks in the order of their numbers on `root`; `None` elsewhere.
    fn gather(&self, root: usize, bytes: &[u8]) -> Option<Vec<Vec<u8>>>;

    /// Combines the bytes of all ranks, which bring the same number of them, in the order of the
    /// [`tree`]; every rank has the result. `take_in` puts what its second argument says into its
    /// first.
    fn combine(&self, bytes: &mut Vec<u8>, take_in: &dyn Fn(&mut [u8], &[u8]));

    /// Returns once every rank has come here.
    fn barrier(&self);

    /// Sends each message to its rank, this one too if it is named, and returns those sent here
    /// with their senders, in the order of the senders and for each in the order in which it named
    /// them. A rank with nothing to say sends nothing, but calls.
    fn exchange(&self, messages: Vec<Message>) -> Vec<Message>;

    /// [`exchange`](Communicator::exchange) where every rank knows whom it hears: each of the ranks
    /// `from`, none twice, sends one message here, and no other does. No rank waits for others than
    /// those.
    fn exchange_with(&self, messages: Vec<Message>, from: &[usize]) -> Vec<Message> {
        let _ = from;
        self.exchange(messages)
    }

    /// Ends all ranks, because this one cannot go on; where the others are processes, this one too.
    /// For defects alone: see [`Alarm`].
    fn abort(&self);

    /// Combines each number over all ranks, which bring as many of them; every rank has the result,
    /// to the same bits.
    fn reduce(&self, reduction: Reduction, values: &mut [f64]) {
        let join = |a, b| reduction.of_numbers(a, b);
        join_values(self, values, f64::to_le_bytes, f64::from_le_bytes, &join);
    }

    /// The combination of the ranks' numbers, on every rank to the same bits.
    fn reduced(&self, reduction: Reduction, mine: f64) -> f64 {
        let mut values = [mine];
        self.reduce(reduction, &mut values);
        values[0]
    }

    /// Combines each integer over all ranks, which bring as many of them; every rank has the
    /// result. Sums end at the largest integer.
    fn reduce_integers(&self, reduction: Reduction, values: &mut [u64]) {
        let join = |a, b| reduction.of_integers(a, b);
        join_values(self, values, u64::to_le_bytes, u64::from_le_bytes, &join);
    }

    /// Widens ranges, each its least and its largest number, to those of all ranks. One from infinity
    /// to minus infinity holds nothing, and widens none.
    fn join_ranges(&self, ranges: &mut [[f64; 2]]) {
        // The least of some numbers is the largest of those below 0, in one message with the others.
        let mut ends: Vec<f64> =
            ranges.iter().flat_map(|[least, largest]| [-least, *largest]).collect();
        self.reduce(Reduction::Maximum, &mut ends);
        for (range, [least, largest]) in ranges.iter_mut().zip(ends.as_chunks().0) {
            *range = [-least, *largest];
        }
    }

    /// Whether something holds on all ranks.
    fn all(&self, mine: bool) -> bool {
        self.least(usize::from(mine)) > 0
    }

    /// Whether something holds on any rank.
    fn any(&self, mine: bool) -> bool {
        !self.all(!mine)
    }

    /// The sum of the ranks' counts.
    fn total(&self, mine: usize) -> usize {
        integer(self, Reduction::Sum, mine)
    }

    /// The largest of the ranks' counts.
    fn most(&self, mine: usize) -> usize {
        integer(self, Reduction::Maximum, mine)
    }

    /// The smallest of the ranks' counts.
    fn least(&self, mine: usize) -> usize {
        integer(self, Reduction::Minimum, mine)
    }

    /// The bytes of all ranks, in the order of their numbers, on every rank.
    fn gather_all(&self, bytes: &[u8]) -> Vec<Vec<u8>> {
        if self.size() == 1 {
            return vec![bytes.to_vec()];
        }
        let mut packed = Writer::default();
        if let Some(all) = self.gather(0, bytes) {
            all.iter().for_each(|bytes| packed.bytes(bytes));
        }
        let mut packed = packed.into_bytes();
        self.broadcast(0, &mut packed);
        let mut reader = Reader::new(0, &packed);
        (0..self.size()).map(|_| reader.bytes().map(<[u8]>::to_vec).unwrap_or_default()).collect()
    }
}

/// Joins each value with those of the other ranks, on the way as bytes.
fn join_values<C: Communicator + ?Sized, T: Copy>(
    communicator: &C,
    values: &mut [T],
    to_bytes: fn(T) -> [u8; 8],
    from_bytes: fn([u8; 8]) -> T,
    join: &dyn Fn(T, T) -> T,
) {
    if communicator.size() == 1 {
        return;
    }
    let mut bytes = values.iter().flat_map(|&value| to_bytes(value)).collect();
    communicator.combine(&mut bytes, &|mine, more| {
        for (mine, more) in mine.as_chunks_mut().0.iter_mut().zip(more.as_chunks().0) {
            *mine = to_bytes(join(from_bytes(*mine), from_bytes(*more)));
        }
    });
    let joined = bytes.as_chunks().0.iter().copied().map(from_bytes);
    values.iter_mut().zip(joined).for_each(|(value, joined)| *value = joined);
}

fn integer<C: Communicator + ?Sized>(communicator: &C, reduction: Reduction, mine: usize) -> usize {
    let mut values = [mine as u64];
    communicator.reduce_integers(reduction, &mut values);
    usize::try_from(values[0]).unwrap_or(usize::MAX)
}

/// The failure of one rank, known to all.
#[derive(Debug, Clone, PartialEq, Eq, Hash, thiserror::Error)]
#[error("rank {rank}: {message}")]
pub struct RankError {
    /// The rank, the lowest of those that failed.
    pub rank: usize,
    /// The reason, in that rank's words.
    pub message: String,
}

/// Goes on where all ranks can: where one cannot, all of them get its error. Collective.
///
/// Whatever can fail on one rank alone is agreed upon before the next thing that all do together,
/// so that none waits for one that has given up.
///
/// ```
/// use tombolo_deform::communicator::{Communicator, agree, threads};
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
    let told = mine.as_ref().err().map(|error| error.to_string().into_bytes());
    match first_failure(communicator, 0, told) {
        None => mine
            .map_err(|error| RankError { rank: communicator.rank(), message: error.to_string() }),
        Some((rank, bytes)) => {
            Err(RankError { rank, message: String::from_utf8_lossy(&bytes).into_owned() })
        }
    }
}

/// The lowest rank that has failed, and what it tells of that; `None` where no rank has. A failure
/// with a higher `weight` counts only where there is none with a lower one: a rank that failed
/// because another did has no reason of its own. Collective.
pub fn first_failure(
    communicator: &dyn Communicator,
    weight: usize,
    mine: Option<Vec<u8>>,
) -> Option<(usize, Vec<u8>)> {
    let (rank, size) = (communicator.rank(), communicator.size());
    let lowest = communicator.least(if mine.is_some() { weight * size + rank } else { usize::MAX });
    if lowest == usize::MAX {
        return None;
    }
    let failing = lowest % size;
    let mut bytes = mine.filter(|_| rank == failing).unwrap_or_default();
    communicator.broadcast(failing, &mut bytes);
    Some((failing, bytes))
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
            fn combine(&self, bytes: &mut Vec<u8>, take_in: &dyn Fn(&mut [u8], &[u8])) {
                (**self).combine(bytes, take_in);
            }
            fn barrier(&self) {
                (**self).barrier();
            }
            fn exchange(&self, messages: Vec<Message>) -> Vec<Message> {
                (**self).exchange(messages)
            }
            fn exchange_with(&self, messages: Vec<Message>, from: &[usize]) -> Vec<Message> {
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
    fn combine(&self, _bytes: &mut Vec<u8>, _take_in: &dyn Fn(&mut [u8], &[u8])) {}
    fn barrier(&self) {}
    fn exchange(&self, messages: Vec<Message>) -> Vec<Message> {
        messages.into_iter().filter(|(to, _)| *to == 0).collect()
    }
    fn abort(&self) {}
}
