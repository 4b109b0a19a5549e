//! What ranks have in common of their lists of values.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::{Neighbour, Partition};
use crate::linear::Real;

/// Other ranks, rising, and places of what is shared with each, in the same order on both.
type WithOthers = Vec<(usize, Vec<u32>)>;

/// A place, and whether the other rank speaks for it.
type Shared = (u32, bool);

/// Which of a list of values, one for each of some vertices, are those of vertices that other ranks list too.
#[derive(Debug, Clone)]
pub struct Shares {
    rank: usize,
    /// All that is shared with each other rank.
    others: WithOthers,
    /// What this rank speaks for of it, and what the other one does.
    given: WithOthers,
    taken: WithOthers,
    /// All places that are shared, each once.
    places: Vec<u32>,
    /// Whether this rank speaks for each value; empty where it does for all.
    owned: Arc<[bool]>,
}

impl Shares {
    /// What is shared of a list of vertices, no vertex twice. Collective.
    #[must_use]
    pub fn new(partition: &dyn Partition, vertices: &[u32]) -> Self {
        const LISTED: f64 = 1.0;
        const OWNED: f64 = 2.0;
        let rank = partition.rank();
        if partition.ranks() == 1 {
            return Self::with_others(rank, Vec::new(), Arc::new([]));
        }
        let count = vertices.iter().max().map_or(0, |&last| last as usize + 1);
        let mut place_of = vec![u32::MAX; count];
        (0..).zip(vertices).for_each(|(place, &vertex)| place_of[vertex as usize] = place);
        let place =
            |vertex: u32| place_of.get(vertex as usize).copied().filter(|&place| place != u32::MAX);
        let mark = |vertex: u32| {
            place(vertex).map_or(0.0, |_| if partition.owns(vertex) { OWNED } else { LISTED })
        };
        let listed =
            |neighbour: &Neighbour| neighbour.vertices.iter().map(|&vertex| mark(vertex)).collect();
        let messages = partition
            .neighbours()
            .iter()
            .map(|neighbour| (neighbour.rank, listed(neighbour)))
            .collect();
        let heard = partition.exchange(messages);
        let mut others = Vec::new();
        for neighbour in partition.neighbours() {
            let theirs = heard
                .iter()
                .find(|(from, _)| *from == neighbour.rank)
                .map_or(&[][..], |(_, marks)| marks);
            let common = neighbour.vertices.iter().zip(theirs).filter(|(_, mark)| **mark > 0.0);
            let common =
                common.filter_map(|(&vertex, &mark)| Some((place(vertex)?, mark >= OWNED)));
            others.push((neighbour.rank, common.collect()));
        }
        Self::with_others(
            rank,
            others,
            vertices.iter().map(|&vertex| partition.owns(vertex)).collect(),
        )
    }

    /// What is shared of a list whose first `own` values this rank speaks for; of each of the others it has the rank that does, and
    /// which of that rank's values it is, rising. Collective.
    #[expect(
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "32-bit numbers as they were sent"
    )]
    pub(crate) fn of_owners(
        partition: &dyn Partition,
        own: usize,
        foreign: &[(usize, u32)],
    ) -> Self {
        let rank = partition.rank();
        if partition.ranks() == 1 {
            return Self::with_others(rank, Vec::new(), Arc::new([]));
        }
        let mut asked: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
        for &(owner, index) in foreign {
            asked.entry(owner).or_default().push(f64::from(index));
        }
        let mut holders: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for (from, indices) in partition.exchange(asked.into_iter().collect()) {
            for index in indices
                .into_iter()
                .map(|index| index as u32)
                .filter(|&index| (index as usize) < own)
            {
                holders.entry(index).or_default().push(from);
            }
        }
        // Each holder is told of the others: a number, how many they are, and who.
        let mut replies: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
        for (&index, holding) in &holders {
            for &to in holding {
                let reply = replies.entry(to).or_default();
                reply.extend([f64::from(index), (holding.len() - 1) as f64]);
                reply.extend(
                    holding.iter().filter(|&&other| other != to).map(|&other| other as f64),
                );
            }
        }
        // By the other rank, then by the owner's number, which both have.
        let mut found: BTreeMap<usize, BTreeMap<(usize, u32), Shared>> = BTreeMap::new();
        for (&index, holding) in &holders {
            for &other in holding {
                found.entry(other).or_default().insert((rank, index), (index, false));
            }
        }
        for (owner, told) in partition.exchange(replies.into_iter().collect()) {
            let mut told = told.into_iter();
            while let (Some(index), Some(count)) = (told.next(), told.next()) {
                let index = index as u32;
                let others: Vec<usize> =
                    told.by_ref().take(count as usize).map(|other| other as usize).collect();
                let Ok(place) = foreign.binary_search(&(owner, index)) else { continue };
                let place = (own + place) as u32;
                found.entry(owner).or_default().insert((owner, index), (place, true));
                for other in others {
                    found.entry(other).or_default().insert((owner, index), (place, false));
                }
            }
        }
        let others = found
            .into_iter()
            .map(|(other, shared)| (other, shared.into_values().collect()))
            .collect();
        Self::with_others(rank, others, (0..own + foreign.len()).map(|place| place < own).collect())
    }

    fn with_others(rank: usize, others: Vec<(usize, Vec<Shared>)>, owned: Arc<[bool]>) -> Self {
        let owns = |place: u32| owned.get(place as usize).is_none_or(|&owned| owned);
        let only = |wanted: &dyn Fn(u32, bool) -> bool| -> WithOthers {
            let filter = |shared: &[Shared]| -> Vec<u32> {
                shared
                    .iter()
                    .filter(|(place, theirs)| wanted(*place, *theirs))
                    .map(|(place, _)| *place)
                    .collect()
            };
            others
                .iter()
                .map(|(rank, shared)| (*rank, filter(shared)))
                .filter(|(_, places)| !places.is_empty())
                .collect()
        };
        let (given, taken) = (only(&|place, _| owns(place)), only(&|_, theirs| theirs));
        Self { rank, given, taken, places: Vec::new(), others: only(&|_, _| true), owned }
            .with_places()
    }

    fn with_places(mut self) -> Self {
        self.places = self.others.iter().flat_map(|(_, places)| places.iter().copied()).collect();
        self.places.sort_unstable();
        self.places.dedup();
        self
    }

    /// The places of what other ranks list too, rising.
    #[must_use]
    pub fn places(&self) -> &[u32] {
        &self.places
    }

    /// Whether this rank speaks for the value at a place: exactly one of those that list the vertex does.
    #[must_use]
    pub fn owns(&self, place: usize) -> bool {
        self.owned.get(place).is_none_or(|&owned| owned)
    }

    /// The other ranks, and what is shared with each.
    pub(crate) fn others(&self) -> &[(usize, Vec<u32>)] {
        &self.others
    }

    /// What this rank speaks for of that.
    pub(crate) fn given(&self) -> &[(usize, Vec<u32>)] {
        &self.given
    }

    /// What the other one speaks for of that: every place that is not this rank's is there once.
    pub(crate) fn taken(&self) -> &[(usize, Vec<u32>)] {
        &self.taken
    }

    /// Those of the places for which `wanted` holds, the same ones on all ranks.
    #[must_use]
    pub fn only(&self, wanted: impl Fn(u32) -> bool) -> Self {
        let filter = |lists: &WithOthers| -> WithOthers {
            let lists = lists.iter().map(|(rank, places)| {
                (*rank, places.iter().copied().filter(|&place| wanted(place)).collect::<Vec<u32>>())
            });
            lists.filter(|(_, places)| !places.is_empty()).collect()
        };
        Self {
            rank: self.rank,
            others: filter(&self.others),
            given: filter(&self.given),
            taken: filter(&self.taken),
            places: Vec::new(),
            owned: Arc::clone(&self.owned),
        }
        .with_places()
    }

    /// The same of a list in another order: `moved` is where each value has gone.
    pub(crate) fn moved(&self, moved: impl Fn(u32) -> u32) -> Self {
        let all = |lists: &WithOthers| -> WithOthers {
            lists
                .iter()
                .map(|(rank, places)| (*rank, places.iter().map(|&place| moved(place)).collect()))
                .collect()
        };
        let mut owned = self.owned.to_vec();
        for (place, &value) in (0..).zip(&*self.owned) {
            owned[moved(place) as usize] = value;
        }
        Self {
            rank: self.rank,
            others: all(&self.others),
            given: all(&self.given),
            taken: all(&self.taken),
            places: Vec::new(),
            owned: owned.into(),
        }
        .with_places()
    }

    /// Adds up what the ranks have at the places that they share, in the order of the ranks: all get the same bits. `values` holds
    /// `width` values for each place. What is missing of a message becomes NaN. Collective.
    pub fn sum(&self, partition: &dyn Partition, width: usize, values: &mut [f64]) {
        self.sum_real(partition, width, values);
    }

    /// The same in either precision.
    pub(crate) fn sum_real<T: Real>(
        &self,
        partition: &dyn Partition,
        width: usize,
        values: &mut [T],
    ) {
        if partition.ranks() == 1 {
            return;
        }
        let messages = self
            .others
            .iter()
            .map(|(rank, places)| (*rank, message(places, width, values)))
            .collect();
        let heard = partition.exchange_with(messages, &ranks(&self.others));
        let own = message(&self.places, width, values);
        self.places.iter().for_each(|&place| values[at(place, width)].fill(T::default()));
        let mut add = |places: &[u32], more: &[f64]| {
            let mut more = more.iter();
            for &place in places {
                for value in &mut values[at(place, width)] {
                    *value += T::of(more.next().copied().unwrap_or(f64::NAN));
                }
            }
        };
        let theirs = |rank: usize| {
            heard.iter().find(|(from, _)| *from == rank).map_or(&[][..], |(_, values)| values)
        };
        let below = self.others.partition_point(|(rank, _)| *rank < self.rank);
        self.others[..below].iter().for_each(|(rank, places)| add(places, theirs(*rank)));
        add(&self.places, &own);
        self.others[below..].iter().for_each(|(rank, places)| add(places, theirs(*rank)));
    }

    /// Gives all ranks, of what they share, the values of the one that speaks for them. Otherwise as [`Shares::sum`].
    pub(crate) fn spread<T: Real>(
        &self,
        partition: &dyn Partition,
        width: usize,
        values: &mut [T],
    ) {
        if partition.ranks() == 1 {
            return;
        }
        let messages = self
            .given
            .iter()
            .map(|(rank, places)| (*rank, message(places, width, values)))
            .collect();
        let heard = partition.exchange_with(messages, &ranks(&self.taken));
        for (rank, places) in &self.taken {
            let theirs =
                heard.iter().find(|(from, _)| from == rank).map_or(&[][..], |(_, values)| values);
            let mut theirs = theirs.iter();
            for &place in places {
                for value in &mut values[at(place, width)] {
                    *value = T::of(theirs.next().copied().unwrap_or(f64::NAN));
                }
            }
        }
    }
}

fn ranks(lists: &WithOthers) -> Vec<usize> {
    lists.iter().map(|(rank, _)| *rank).collect()
}

/// Where the values of a place are.
fn at(place: u32, width: usize) -> std::ops::Range<usize> {
    place as usize * width..(place as usize + 1) * width
}

fn message<T: Real>(places: &[u32], width: usize, values: &[T]) -> Vec<f64> {
    let mut message = Vec::with_capacity(width * places.len());
    places.iter().for_each(|&place| {
        message.extend(values[at(place, width)].iter().map(|value| value.wide()))
    });
    message
}
