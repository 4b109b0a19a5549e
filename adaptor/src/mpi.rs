//! The ranks of an MPI communicator.
//!
//! ```no_run
//! use std::sync::Arc;
//! use tombolo::{Settings, mpi::{Mpi, rsmpi}};
//!
//! // A solver in another language has initialized MPI already and has a handle: `Mpi::from_raw`, `Mpi::from_fortran`.
//! let universe = rsmpi::initialize().ok_or("MPI was initialized before")?;
//! let settings = Settings { communicator: Arc::new(Mpi::new(&universe.world())?), ..Settings::default() };
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use std::{
    collections::{BTreeMap, VecDeque},
    mem::ManuallyDrop,
    os::raw::c_int,
    sync::{Mutex, MutexGuard},
};

pub use ::mpi as rsmpi;

use rsmpi::{
    datatype::Equivalence,
    environment, ffi,
    point_to_point::{Destination, Message, Source, Status},
    request,
    topology::{Communicator as _, SimpleCommunicator},
    traits::{AsRaw, CommunicatorCollectives, FromRaw, Root},
};

use tombolo_deform::communicator::{Communicator, Message as Sent, tree};

use crate::lock::lock;

/// Bytes of one message at most: MPI counts them with 32 bits. Longer ones go in pieces, of which
/// only the last is shorter.
const PIECE: usize = 1 << 30;
/// The tag of what goes up the tree.
const TREE: c_int = 0;
/// The tag of what neighbours tell each other: of any two, messages come in the order in which they
/// were sent.
const NEIGHBOURS: c_int = 1;
/// Tags from here on that exchanges take in turn: a rank may be in the next one before this one has
/// seen that all are through with this.
const FIRST_ROUND: c_int = 2;
const ROUNDS: c_int = 1024;

/// The ranks of an MPI communicator. Messages go through a copy of it, so that none is ever taken
/// for one of the solver's.
///
/// `MPI_THREAD_FUNNELED` is enough: the adaptor calls MPI inside `initialize`, `execute` and
/// `finalize` alone, and from the thread that calls these.
///
/// The copy is freed when this is dropped, which is to be done on all ranks, and before MPI is
/// finalized (after that, nothing is freed).
pub struct Mpi {
    rank: usize,
    size: usize,
    ranks: Mutex<Ranks>,
}

impl std::fmt::Debug for Mpi {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter
            .debug_struct("Mpi")
            .field("rank", &self.rank)
            .field("size", &self.size)
            .finish_non_exhaustive()
    }
}

struct Ranks {
    communicator: ManuallyDrop<SimpleCommunicator>,
    round: c_int,
}

// SAFETY: what is not `Send` is the handle of a communicator, which MPI lets any thread use as long
// as the calls of threads do not overlap (`MPI_THREAD_SERIALIZED`); the mutex around `Ranks` keeps
// them apart. That under `MPI_THREAD_FUNNELED` it is the main thread that calls is what the adaptor
// promises: it calls from the thread that called it.
unsafe impl Send for Ranks {}

/// Why a communicator cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MpiError {
    /// Too early.
    #[error("MPI has not been initialized; call MPI_Init or MPI_Init_thread first")]
    NotInitialized,
    /// Too late.
    #[error("MPI has been finalized")]
    Finalized,
    /// No communicator.
    #[error("the communicator is MPI_COMM_NULL: this process is not among its ranks")]
    Null,
    /// Two groups of ranks.
    #[error("the communicator is an inter-communicator; expected one of a single group of ranks")]
    Between,
}

impl Mpi {
    /// The ranks of `communicator`. Collective over them.
    ///
    /// # Errors
    /// [`MpiError::Finalized`].
    pub fn new(communicator: &impl AsRaw<Raw = ffi::MPI_Comm>) -> Result<Self, MpiError> {
        // SAFETY: a communicator of rsmpi is alive for as long as it is borrowed.
        unsafe { Self::from_raw(communicator.as_raw()) }
    }

    /// The ranks of a communicator given by its handle in C. Collective over them; the handle stays
    /// the caller's.
    ///
    /// # Errors
    /// [`MpiError`].
    ///
    /// # Safety
    /// `communicator` must be a handle that MPI gave out and that has not been freed, or
    /// `MPI_COMM_NULL`.
    pub unsafe fn from_raw(communicator: ffi::MPI_Comm) -> Result<Self, MpiError> {
        if !environment::is_initialized() {
            return Err(MpiError::NotInitialized);
        }
        if environment::is_finalized() {
            return Err(MpiError::Finalized);
        }
        // SAFETY: constants of MPI, there once it is initialized.
        let null = unsafe { ffi::RSMPI_COMM_NULL };
        if communicator == null {
            return Err(MpiError::Null);
        }
        let mut between = 0;
        // SAFETY: the caller vouches for the handle.
        unsafe { ffi::MPI_Comm_test_inter(communicator, &raw mut between) };
        if between != 0 {
            return Err(MpiError::Between);
        }
        let mut copy = null;
        // SAFETY: as above; `copy` is written.
        unsafe { ffi::MPI_Comm_dup(communicator, &raw mut copy) };
        // SAFETY: a copy is a communicator of the user's, alive, of one group, and nobody else has
        // its handle.
        let communicator = unsafe { SimpleCommunicator::from_raw(copy) };
        let number = |count: c_int| usize::try_from(count).unwrap_or_default();
        Ok(Self {
            rank: number(communicator.rank()),
            size: number(communicator.size()),
            ranks: Mutex::new(Ranks { communicator: ManuallyDrop::new(communicator), round: 0 }),
        })
    }

    /// The ranks of a communicator given by its handle in Fortran, as Catalyst passes it.
    ///
    /// # Errors
    /// [`MpiError`].
    ///
    /// # Safety
    /// As [`Mpi::from_raw`].
    pub unsafe fn from_fortran(communicator: c_int) -> Result<Self, MpiError> {
        if !environment::is_initialized() {
            return Err(MpiError::NotInitialized);
        }
        // SAFETY: MPI is initialized, and the caller vouches for the handle.
        unsafe { Self::from_raw(ffi::RSMPI_Comm_f2c(communicator)) }
    }

    /// The C handle of the copy of the communicator, for libraries that are to run on the same
    /// ranks. It is freed with this value.
    #[must_use]
    pub fn as_raw(&self) -> ffi::MPI_Comm {
        self.ranks().communicator.as_raw()
    }

    fn ranks(&self) -> MutexGuard<'_, Ranks> {
        lock(&self.ranks)
    }
}

impl Drop for Ranks {
    fn drop(&mut self) {
        if !environment::is_finalized() {
            // SAFETY: it is not used again.
            unsafe { ManuallyDrop::drop(&mut self.communicator) };
        }
    }
}

/// The pieces in which a message goes: all of the full length but the last, which is shorter and
/// may be empty.
fn pieces(bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
    let full = bytes.len() / PIECE;
    (0..=full).map(move |piece| &bytes[piece * PIECE..bytes.len().min((piece + 1) * PIECE)])
}

fn number(rank: usize) -> c_int {
    // Ranks came from MPI as such numbers.
    c_int::try_from(rank).unwrap_or(c_int::MAX)
}

fn receive_piece(message: Message, status: &Status) -> Vec<u8> {
    let count = status.count(u8::equivalent_datatype());
    let mut piece = vec![0_u8; usize::try_from(count).unwrap_or_default()];
    message.matched_receive_into(&mut piece[..]);
    piece
}

impl Ranks {
    fn send(&self, to: usize, bytes: &[u8]) {
        let process = self.communicator.process_at_rank(number(to));
        pieces(bytes).for_each(|piece| process.send_with_tag(piece, TREE));
    }

    fn receive(&self, from: usize, tag: c_int) -> Vec<u8> {
        let process = self.communicator.process_at_rank(number(from));
        let mut bytes = Vec::new();
        loop {
            let (message, status) = process.matched_probe_with_tag(tag);
            let piece = receive_piece(message, &status);
            let last = piece.len() < PIECE;
            if bytes.is_empty() {
                bytes = piece;
            } else {
                bytes.extend(piece);
            }
            if last {
                return bytes;
            }
        }
    }
}

impl Communicator for Mpi {
    fn rank(&self) -> usize {
        self.rank
    }

    fn size(&self) -> usize {
        self.size
    }

    fn broadcast(&self, root: usize, bytes: &mut Vec<u8>) {
        let ranks = self.ranks();
        let root = ranks.communicator.process_at_rank(number(root));
        let mut length = bytes.len() as u64;
        root.broadcast_into(&mut length);
        bytes.resize(usize::try_from(length).unwrap_or(usize::MAX), 0);
        bytes.chunks_mut(PIECE).for_each(|piece| root.broadcast_into(piece));
    }

    fn gather(&self, root: usize, bytes: &[u8]) -> Option<Vec<Vec<u8>>> {
        let ranks = self.ranks();
        // The tree leads to its first rank: they are counted from the root on.
        let (children, parent) = tree((self.rank + self.size - root) % self.size, self.size);
        let back = |position: usize| (position + root) % self.size;
        let mut packed = Vec::with_capacity(8 + bytes.len());
        packed.extend((bytes.len() as u64).to_le_bytes());
        packed.extend(bytes);
        for child in children {
            packed.extend(ranks.receive(back(child), TREE));
        }
        if let Some(parent) = parent {
            ranks.send(back(parent), &packed);
            return None;
        }
        let mut rest = &packed[..];
        let mut all = vec![Vec::new(); self.size];
        for position in 0..self.size {
            let Some((length, after)) = rest.split_first_chunk() else { break };
            let length = usize::try_from(u64::from_le_bytes(*length)).unwrap_or(usize::MAX);
            let (bytes, after) = after.split_at_checked(length).unwrap_or((after, &[]));
            all[back(position)] = bytes.to_vec();
            rest = after;
        }
        Some(all)
    }

    fn combine(&self, bytes: &mut Vec<u8>, take_in: &dyn Fn(&mut [u8], &[u8])) {
        let ranks = self.ranks();
        let (children, parent) = tree(self.rank, self.size);
        for child in children {
            take_in(bytes, &ranks.receive(child, TREE));
        }
        if let Some(parent) = parent {
            ranks.send(parent, bytes);
        }
        let root = ranks.communicator.process_at_rank(0);
        bytes.chunks_mut(PIECE).for_each(|piece| root.broadcast_into(piece));
    }

    fn barrier(&self) {
        self.ranks().communicator.barrier();
    }

    /// Nobody need know beforehand from whom to hear: a message counts as sent when it is being
    /// received, and when all ranks have sent theirs all is over, which a barrier that does not
    /// hold anybody up finds out (T. Hoefler, C. Siebert, A. Lumsdaine, *Scalable communication
    /// protocols for dynamic sparse data exchange*, 2010). Memory and messages are those of the
    /// ranks spoken to, whatever the number of all.
    fn exchange(&self, messages: Vec<Sent>) -> Vec<Sent> {
        let mut ranks = self.ranks();
        ranks.round = (ranks.round + 1) % ROUNDS;
        let tag = FIRST_ROUND + ranks.round;
        let ranks = &*ranks;
        let (own, others): (Vec<_>, Vec<_>) =
            messages.into_iter().partition(|(to, _)| *to == self.rank);
        let mut heard = own;
        let mut unfinished: BTreeMap<usize, Vec<u8>> = BTreeMap::new();
        request::scope(|scope| {
            let mut sends: VecDeque<_> = others
                .iter()
                .flat_map(|(to, bytes)| pieces(bytes).map(move |piece| (*to, piece)))
                .map(|(to, piece)| {
                    let process = ranks.communicator.process_at_rank(number(to));
                    process.immediate_synchronous_send_with_tag(scope, piece, tag)
                })
                .collect();
            let mut over = None;
            loop {
                let mut idle = true;
                while let Some((message, status)) =
                    ranks.communicator.any_process().immediate_matched_probe_with_tag(tag)
                {
                    idle = false;
                    let from = usize::try_from(status.source_rank()).unwrap_or_default();
                    let piece = receive_piece(message, &status);
                    let last = piece.len() < PIECE;
                    let bytes = match unfinished.remove(&from) {
                        None => piece,
                        Some(mut bytes) => {
                            bytes.extend(piece);
                            bytes
                        }
                    };
                    if last {
                        heard.push((from, bytes));
                    } else {
                        unfinished.insert(from, bytes);
                    }
                }
                while let Some(send) = sends.pop_front() {
                    if let Err(send) = send.test() {
                        sends.push_front(send);
                        break;
                    }
                    idle = false;
                }
                over = match over {
                    None if sends.is_empty() => Some(ranks.communicator.immediate_barrier()),
                    None => None,
                    Some(barrier) => match request::Request::test(barrier) {
                        Ok(_) => break,
                        Err(barrier) => Some(barrier),
                    },
                };
                if idle {
                    // Where there are more ranks than cores, another one has something to say.
                    std::thread::yield_now();
                }
            }
        });
        // Of each sender they came in order.
        heard.sort_by_key(|(from, _)| *from);
        heard
    }

    fn exchange_with(&self, messages: Vec<Sent>, from: &[usize]) -> Vec<Sent> {
        let ranks = &*self.ranks();
        let (own, others): (Vec<_>, Vec<_>) =
            messages.into_iter().partition(|(to, _)| *to == self.rank);
        let mut heard = own;
        request::scope(|scope| {
            let sends: Vec<_> = others
                .iter()
                .flat_map(|(to, bytes)| pieces(bytes).map(move |piece| (*to, piece)))
                .map(|(to, piece)| {
                    let process = ranks.communicator.process_at_rank(number(to));
                    process.immediate_send_with_tag(scope, piece, NEIGHBOURS)
                })
                .collect();
            let others = from.iter().filter(|&&from| from != self.rank);
            heard.extend(others.map(|&from| (from, ranks.receive(from, NEIGHBOURS))));
            for send in sends {
                send.wait();
            }
        });
        heard.sort_by_key(|(from, _)| *from);
        heard
    }

    fn abort(&self) {
        let rank = self.rank;
        tracing::error!(
            rank,
            "rank {rank} failed in itself; all ranks are ended, because the others would wait for it"
        );
        // SAFETY: the handle is alive while this is.
        unsafe { ffi::MPI_Abort(self.as_raw(), 1) };
    }
}
