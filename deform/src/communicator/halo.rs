//! The entries of a list that several ranks have.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::{Communicator, Message, Reader, Solo, Writer};

/// The entries of a list that another rank lists too.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Neighbour {
    /// The other rank.
    pub rank: usize,
    /// The indices of the entries in this rank's list, in the same order on both ranks.
    pub entries: Vec<u32>,
}

/// An entry, and whether the other rank owns it.
type Shared = (u32, bool);

/// Which entries of a list of values, such as those of the vertices of a mesh, other ranks list
/// too, and who owns them.
///
/// Of the ranks that list an entry one owns it. [`Halo::sum`] adds up what the ranks have;
/// [`Halo::update`] gives all ranks what the owner has. With one process there are no such entries,
/// and nothing is done.
#[derive(Debug, Clone)]
pub struct Halo {
    communicator: Arc<dyn Communicator>,
    /// All that is shared with each other rank.
    neighbours: Vec<Neighbour>,
    /// Of that, the entries that this rank owns, and those that the other one does.
    given: Vec<Neighbour>,
    taken: Vec<Neighbour>,
    /// All entries that are shared, each once, rising.
    shared: Vec<u32>,
    /// Whether this rank owns each entry; empty where it owns all.
    owned: Arc<[bool]>,
}

impl Halo {
    /// A list that one process has.
    #[must_use]
    pub fn none() -> Self {
        Self::alone(Arc::new(Solo))
    }

    /// A list of which this rank shares nothing.
    pub(crate) fn alone(communicator: Arc<dyn Communicator>) -> Self {
        let [neighbours, given, taken] = [const { Vec::new() }; 3];
        Self { communicator, neighbours, given, taken, shared: Vec::new(), owned: Arc::new([]) }
    }

    /// A list that shares entries with other ranks: for each of them, rising, the entries, in the
    /// same order on both, and whether the other one owns them. `owned` says for each entry whether
    /// this rank does.
    pub(crate) fn new(
        communicator: Arc<dyn Communicator>,
        others: Vec<(usize, Vec<Shared>)>,
        owned: Arc<[bool]>,
    ) -> Self {
        let only = |wanted: &dyn Fn(Shared) -> bool| -> Vec<Neighbour> {
            let entries = |shared: &[Shared]| -> Vec<u32> {
                shared.iter().filter(|shared| wanted(**shared)).map(|(entry, _)| *entry).collect()
            };
            let lists = others
                .iter()
                .map(|(rank, shared)| Neighbour { rank: *rank, entries: entries(shared) });
            lists.filter(|neighbour| !neighbour.entries.is_empty()).collect()
        };
        let given = only(&|(entry, _)| owned.get(entry as usize).is_none_or(|&owned| owned));
        let (neighbours, taken) = (only(&|_| true), only(&|(_, theirs)| theirs));
        Self { communicator, shared: shared(&neighbours), neighbours, given, taken, owned }
    }

    /// A list whose first `own` entries this rank owns; of each of the others it has the rank that
    /// does, and which of that rank's entries it is, rising. Collective.
    #[must_use]
    pub fn of_owners(
        communicator: Arc<dyn Communicator>,
        own: usize,
        foreign: &[(usize, u32)],
    ) -> Self {
        if communicator.size() == 1 {
            return Self::alone(communicator);
        }
        let rank = communicator.rank();
        let mut asked: BTreeMap<usize, Writer> = BTreeMap::new();
        foreign.iter().for_each(|&(owner, index)| asked.entry(owner).or_default().u32(index));
        let mut holders: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for (from, bytes) in communicator.exchange(finished(asked)) {
            let indices = bytes.as_chunks().0.iter().map(|index| u32::from_le_bytes(*index));
            for index in indices.filter(|&index| (index as usize) < own) {
                holders.entry(index).or_default().push(from);
            }
        }
        // Each holder is told of the others.
        let mut replies: BTreeMap<usize, Writer> = BTreeMap::new();
        for (&index, holding) in &holders {
            for &to in holding {
                let reply = replies.entry(to).or_default();
                reply.u32(index);
                let others = holding.iter().filter(|&&other| other != to);
                reply.u32s(
                    &others
                        .map(|&other| u32::try_from(other).unwrap_or(u32::MAX))
                        .collect::<Vec<_>>(),
                );
            }
        }
        // By the other rank, then by the owner's index, which both have.
        let mut found: BTreeMap<usize, BTreeMap<(usize, u32), Shared>> = BTreeMap::new();
        for (&index, holding) in &holders {
            for &other in holding {
                found.entry(other).or_default().insert((rank, index), (index, false));
            }
        }
        for (owner, bytes) in communicator.exchange(finished(replies)) {
            let mut reader = Reader::new(owner, &bytes);
            while let (Ok(index), Ok(others)) = (reader.u32(), reader.u32s()) {
                let Ok(position) = foreign.binary_search(&(owner, index)) else { continue };
                let entry = crate::number::index(own + position);
                found.entry(owner).or_default().insert((owner, index), (entry, true));
                for other in others {
                    found.entry(other as usize).or_default().insert((owner, index), (entry, false));
                }
            }
        }
        let others = found
            .into_iter()
            .map(|(other, shared)| (other, shared.into_values().collect()))
            .collect();
        Self::new(communicator, others, (0..own + foreign.len()).map(|entry| entry < own).collect())
    }

    /// The halo of another list: `entries` names each of its values by an entry of this list, none
    /// twice. Collective.
    #[must_use]
    pub fn of(&self, entries: &[u32]) -> Self {
        const LISTED: u8 = 1;
        const OWNED: u8 = 2;
        if self.communicator.size() == 1 {
            return Self::alone(Arc::clone(&self.communicator));
        }
        let count = entries.iter().max().map_or(0, |&last| last as usize + 1);
        let mut positions = vec![u32::MAX; count];
        (0..).zip(entries).for_each(|(position, &entry)| positions[entry as usize] = position);
        let position = |entry: u32| {
            positions.get(entry as usize).copied().filter(|&position| position != u32::MAX)
        };
        let mark = |entry: u32| {
            position(entry).map_or(0, |_| if self.owns(entry as usize) { OWNED } else { LISTED })
        };
        let marks: Vec<u8> = (0..).take(self.length()).map(mark).collect();
        let heard = self.swap(&self.neighbours, &self.neighbours, 1, &marks);
        let others = self.neighbours.iter().zip(heard).map(|(neighbour, theirs)| {
            let common = neighbour.entries.iter().zip(theirs).filter(|(_, mark)| *mark > 0);
            (
                neighbour.rank,
                common
                    .filter_map(|(&entry, mark)| Some((position(entry)?, mark >= OWNED)))
                    .collect(),
            )
        });
        let owned = entries.iter().map(|&entry| self.owns(entry as usize)).collect();
        Self::new(Arc::clone(&self.communicator), others.collect(), owned)
    }

    /// One more than the last entry that is shared.
    fn length(&self) -> usize {
        self.shared.last().map_or(0, |&last| last as usize + 1)
    }

    /// The halo with another way to speak to the same ranks.
    pub(crate) fn among(&self, communicator: Arc<dyn Communicator>) -> Self {
        Self { communicator, ..self.clone() }
    }

    /// The ranks that list the entries.
    #[must_use]
    pub fn communicator(&self) -> &Arc<dyn Communicator> {
        &self.communicator
    }

    /// The ranks that list entries of this rank too, rising.
    #[must_use]
    pub fn neighbours(&self) -> &[Neighbour] {
        &self.neighbours
    }

    /// Of the entries shared with each neighbour those that this rank owns.
    pub(crate) fn given(&self) -> &[Neighbour] {
        &self.given
    }

    /// Of the entries shared with each neighbour those that the neighbour owns: each entry that is
    /// not this rank's is there once.
    pub(crate) fn taken(&self) -> &[Neighbour] {
        &self.taken
    }

    /// The entries that other ranks list too, each once, rising.
    #[must_use]
    pub fn shared(&self) -> &[u32] {
        &self.shared
    }

    /// Whether this rank owns an entry: exactly one of those that list it does.
    #[must_use]
    pub fn owns(&self, entry: usize) -> bool {
        self.owned.get(entry).is_none_or(|&owned| owned)
    }

    /// The halo of those entries for which `wanted` holds, as it does of each on all ranks that
    /// list it or on none.
    #[must_use]
    pub fn only(&self, wanted: impl Fn(u32) -> bool) -> Self {
        self.mapped(|entry| wanted(entry).then_some(entry), Arc::clone(&self.owned))
    }

    /// The halo of the list in another order: `moved` is the new index of each entry.
    pub(crate) fn moved(&self, moved: impl Fn(u32) -> u32) -> Self {
        let mut owned = self.owned.to_vec();
        for (entry, &value) in (0..).zip(&*self.owned) {
            owned[moved(entry) as usize] = value;
        }
        self.mapped(|entry| Some(moved(entry)), owned.into())
    }

    fn mapped(&self, map: impl Fn(u32) -> Option<u32>, owned: Arc<[bool]>) -> Self {
        let each = |lists: &[Neighbour]| -> Vec<Neighbour> {
            let lists = lists.iter().map(|Neighbour { rank, entries }| Neighbour {
                rank: *rank,
                entries: entries.iter().filter_map(|&entry| map(entry)).collect(),
            });
            lists.filter(|neighbour| !neighbour.entries.is_empty()).collect()
        };
        let neighbours = each(&self.neighbours);
        Self {
            communicator: Arc::clone(&self.communicator),
            given: each(&self.given),
            taken: each(&self.taken),
            shared: shared(&neighbours),
            neighbours,
            owned,
        }
    }

    /// Adds up what the ranks have of the entries that they share, in the order of the ranks: all
    /// get the same bits. `values` holds `width` values for each entry. What is missing of a
    /// message becomes NaN. Collective.
    pub fn sum<T: Value>(&self, width: usize, values: &mut [T]) {
        if self.communicator.size() == 1 {
            return;
        }
        let heard = self.swap(&self.neighbours, &self.neighbours, width, values);
        let own = collected(&self.shared, width, values);
        self.shared.iter().for_each(|&entry| values[range(entry, width)].fill(T::default()));
        let mut add = |entries: &[u32], more: &[T]| {
            let mut more = more.iter();
            for &entry in entries {
                for value in &mut values[range(entry, width)] {
                    *value += more.next().copied().unwrap_or(T::MISSING);
                }
            }
        };
        let rank = self.communicator.rank();
        let below = self.neighbours.partition_point(|neighbour| neighbour.rank < rank);
        let mut theirs = self.neighbours.iter().zip(&heard);
        theirs.by_ref().take(below).for_each(|(neighbour, more)| add(&neighbour.entries, more));
        add(&self.shared, &own);
        theirs.for_each(|(neighbour, more)| add(&neighbour.entries, more));
    }

    /// Gives all ranks, of the entries that they share, the values of the owner. `values` holds
    /// `width` values for each entry. Values missing from a message become NaN. Collective.
    pub fn update<T: Value>(&self, width: usize, values: &mut [T]) {
        if self.communicator.size() == 1 {
            return;
        }
        let heard = self.swap(&self.given, &self.taken, width, values);
        for (neighbour, theirs) in self.taken.iter().zip(heard) {
            let mut theirs = theirs.into_iter();
            for &entry in &neighbour.entries {
                values[range(entry, width)].fill_with(|| theirs.next().unwrap_or(T::MISSING));
            }
        }
    }

    /// Marks on every rank the entries that any rank marks. Collective.
    pub fn any(&self, marks: &mut [bool]) {
        let mut counts: Vec<u8> = marks.iter().map(|&mark| u8::from(mark)).collect();
        for (neighbour, theirs) in
            self.neighbours.iter().zip(self.swap(&self.neighbours, &self.neighbours, 1, &counts))
        {
            neighbour
                .entries
                .iter()
                .zip(theirs)
                .for_each(|(&entry, theirs)| counts[entry as usize] |= theirs);
        }
        marks.iter_mut().zip(counts).for_each(|(mark, count)| *mark = count != 0);
    }

    /// Sends the values of the entries `to`, and returns those that come for the entries `from`.
    fn swap<T: Value>(
        &self,
        to: &[Neighbour],
        from: &[Neighbour],
        width: usize,
        values: &[T],
    ) -> Vec<Vec<T>> {
        if self.communicator.size() == 1 {
            return Vec::new();
        }
        let message = |Neighbour { rank, entries }: &Neighbour| -> Message {
            let mut bytes = Vec::with_capacity(size_of::<T>() * width * entries.len());
            for &entry in entries {
                values[range(entry, width)].iter().for_each(|value| value.append_to(&mut bytes));
            }
            (*rank, bytes)
        };
        let ranks: Vec<usize> = from.iter().map(|neighbour| neighbour.rank).collect();
        let heard = self.communicator.exchange_with(to.iter().map(message).collect(), &ranks);
        let of = |rank: usize| {
            heard.iter().find(|(from, _)| *from == rank).map_or(&[][..], |(_, bytes)| bytes)
        };
        from.iter()
            .map(|neighbour| of(neighbour.rank).chunks_exact(size_of::<T>()).map(T::read).collect())
            .collect()
    }
}

/// A number that ranks send to each other.
pub trait Value: Copy + Default + std::ops::AddAssign {
    /// The number that stands for one that was not sent.
    const MISSING: Self;

    /// Appends the bytes of the number.
    fn append_to(self, bytes: &mut Vec<u8>);

    /// Reads a number from as many bytes as it has.
    fn read(bytes: &[u8]) -> Self;
}

macro_rules! values {
    ($($type:ty: $missing:expr),*) => {$(
        impl Value for $type {
            const MISSING: Self = $missing;

            fn append_to(self, bytes: &mut Vec<u8>) {
                bytes.extend(self.to_le_bytes());
            }

            fn read(bytes: &[u8]) -> Self {
                bytes.first_chunk().map_or($missing, |bytes| Self::from_le_bytes(*bytes))
            }
        }
    )*};
}

values!(u8: 0, u32: u32::MAX, u64: u64::MAX, f32: f32::NAN, f64: f64::NAN);

fn shared(neighbours: &[Neighbour]) -> Vec<u32> {
    let mut shared: Vec<u32> =
        neighbours.iter().flat_map(|neighbour| neighbour.entries.iter().copied()).collect();
    shared.sort_unstable();
    shared.dedup();
    shared
}

fn finished(messages: BTreeMap<usize, Writer>) -> Vec<Message> {
    messages.into_iter().map(|(rank, message)| (rank, message.into_bytes())).collect()
}

/// The positions of an entry's values.
fn range(entry: u32, width: usize) -> std::ops::Range<usize> {
    entry as usize * width..(entry as usize + 1) * width
}

fn collected<T: Copy>(entries: &[u32], width: usize, values: &[T]) -> Vec<T> {
    entries.iter().flat_map(|&entry| &values[range(entry, width)]).copied().collect()
}
