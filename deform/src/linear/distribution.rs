//! Systems whose rows are distributed over ranks, as multigrid has them.

use std::collections::{BTreeMap, BTreeSet};

use super::aggregation::{Across, Aggregates};
use super::transfer::{Interpolation, RowsFound, collected};
use super::{Block, SparseMatrix, add};
use crate::communicator::{Communicator, Garbled, Halo, Message, Neighbour, Reader, Writer};
use crate::number::index;
use crate::parallel;
use crate::topology::indices;

/// How many rows are put together at a time.
const CHUNK: usize = 64;

/// An index that is not in a list.
const NONE: u32 = u32::MAX;

/// An aggregate by the rank that has formed it, and its number there.
type Key = (usize, u32);

/// The rows that a rank has of a system: first those that it owns, then those of other ranks that
/// its own are coupled to.
#[derive(Debug, Clone)]
pub(super) struct Distribution {
    halo: Halo,
    own: usize,
    /// The ranks that own the rows after the own ones.
    owners: Vec<usize>,
}

/// An order of rows.
#[derive(Debug, Clone)]
pub(super) struct Order {
    /// The old number of each row, and the new one.
    pub(super) old: Vec<u32>,
    pub(super) new: Vec<u32>,
}

impl Distribution {
    /// `rows` rows in any order, and the order that has this rank's own ones first, otherwise as
    /// they were.
    pub(super) fn new(halo: &Halo, rows: usize) -> (Self, Order) {
        let (mut old, foreign): (Vec<u32>, Vec<u32>) =
            (0..).take(rows).partition(|&row: &u32| halo.owns(row as usize));
        let own = old.len();
        old.extend(foreign);
        let new = indices(rows, &old);
        let halo = halo.moved(|row| new[row as usize]);
        let mut owners = vec![halo.communicator().rank(); rows - own];
        for Neighbour { rank, entries } in halo.taken() {
            entries.iter().for_each(|&row| owners[row as usize - own] = *rank);
        }
        (Self { halo, own, owners }, Order { old, new })
    }

    pub(super) fn halo(&self) -> &Halo {
        &self.halo
    }

    pub(super) fn communicator(&self) -> &dyn Communicator {
        &**self.halo.communicator()
    }

    /// How many rows this rank owns.
    pub(super) fn own(&self) -> usize {
        self.own
    }

    /// How many rows this rank has.
    pub(super) fn rows(&self) -> usize {
        self.own + self.owners.len()
    }

    /// The value found here, where all ranks have found one.
    pub(super) fn agreed<R>(&self, found: Option<R>) -> Option<R> {
        let everywhere = self.communicator().all(found.is_some());
        found.filter(|_| everywhere)
    }

    fn owner(&self, row: usize) -> usize {
        row.checked_sub(self.own)
            .map_or_else(|| self.communicator().rank(), |foreign| self.owners[foreign])
    }

    /// A part of the same sum: blocks between rows of one rank are moved there, those between rows
    /// of different ranks stay where they are. So the first [`own`](Self::own) rows and columns are
    /// those of the sum. `order` is that of the rows where those of `matrix` have another one.
    pub(super) fn assembled<const B: usize>(
        &self,
        matrix: &SparseMatrix<B>,
        order: Option<&Order>,
    ) -> SparseMatrix<B> {
        let old = |row: usize| order.map_or(row, |order| order.old[row] as usize);
        let new = |row: u32| order.map_or(row, |order| order.new[row as usize]);
        let mut messages = Vec::new();
        let mut listed = vec![NONE; self.rows()];
        for Neighbour { rank, entries } in self.halo.neighbours() {
            let theirs =
                || (0..).zip(entries).filter(|(_, row)| self.owner(**row as usize) == *rank);
            theirs().for_each(|(index, &row): (u32, _)| listed[row as usize] = index);
            let mut message = Writer::default();
            for (index, &row) in theirs() {
                let (columns, blocks) = matrix.row(old(row as usize));
                for (&column, block) in columns.iter().zip(blocks) {
                    let other = listed[new(column) as usize];
                    if other != NONE {
                        message.u32(index);
                        message.u32(other);
                        message.f64s(block.as_flattened());
                    }
                }
            }
            theirs().for_each(|(_, &row)| listed[row as usize] = NONE);
            messages.push((*rank, message.into_bytes()));
        }
        let mut more: Vec<(u32, u32, Block<B>)> = Vec::new();
        for (from, message) in self.communicator().exchange(messages) {
            let neighbour = self.halo.neighbours().iter().find(|neighbour| neighbour.rank == from);
            let entries = neighbour.map_or(&[][..], |neighbour| &neighbour.entries);
            let mut reader = Reader::new(from, &message);
            while let (Ok(row), Ok(column), Ok(block)) =
                (reader.u32(), reader.u32(), reader.f64s(B * B))
            {
                let (row, column) = (entries.get(row as usize), entries.get(column as usize));
                let (Some(&row), Some(&column)) = (row, column) else { continue };
                more.push((
                    row,
                    column,
                    std::array::from_fn(|i| std::array::from_fn(|j| block[B * i + j])),
                ));
            }
        }
        // As the ranks come, so that sums are always taken in the same order.
        more.sort_by_key(|&(row, column, _)| (row, column));
        let parts = parallel::map_chunks(self.rows(), CHUNK, |range| {
            let mut found = RowsFound::default();
            let mut blocks_of_row: Vec<(u32, Block<B>)> = Vec::new();
            for row in range {
                blocks_of_row.clear();
                let (columns, blocks) = matrix.row(old(row));
                let blocks = columns.iter().map(|&column| new(column)).zip(blocks.iter().copied());
                let foreign = |&(column, _): &(u32, Block<B>)| column as usize >= self.own;
                if row < self.own {
                    let from = more.partition_point(|(other, ..)| (*other as usize) < row);
                    let until =
                        from + more[from..].partition_point(|(other, ..)| *other as usize == row);
                    blocks_of_row.extend(blocks.clone().filter(|block| !foreign(block)));
                    for &(_, column, block) in &more[from..until] {
                        match blocks_of_row.binary_search_by_key(&column, |(column, _)| *column) {
                            Ok(index) => add(&mut blocks_of_row[index].1, &block),
                            Err(index) => blocks_of_row.insert(index, (column, block)),
                        }
                    }
                    blocks_of_row.extend(blocks.filter(foreign));
                } else {
                    let owner = self.owner(row);
                    let across =
                        |(column, _): &(u32, Block<B>)| self.owner(*column as usize) != owner;
                    blocks_of_row.extend(blocks.filter(across));
                    blocks_of_row.sort_unstable_by_key(|(column, _)| *column);
                }
                for &(column, block) in &blocks_of_row {
                    found.push(column, block);
                }
                found.end();
            }
            found
        });
        collected(CHUNK, &parts)
    }

    /// The interpolation from the aggregates of all ranks to the rows that this one has, and these
    /// ranks' parts of the aggregates. All couplings across ranks are taken as strong.
    pub(super) fn interpolation<const B: usize>(
        &self,
        matrix: &SparseMatrix<B>,
        couplings: &[f64],
        aggregates: &Aggregates,
        damping: f64,
    ) -> (Interpolation, Self) {
        let rank = self.communicator().rank();
        let mut of_row = vec![NONE; self.rows()];
        (0..self.own).for_each(|row| of_row[row] = aggregates.of(row).unwrap_or(NONE));
        self.halo.update(1, &mut of_row);
        let key = |row: usize| (of_row[row] != NONE).then(|| (self.owner(row), of_row[row]));
        let across = self.across(matrix, couplings, key);

        // Aggregates of others are numbered as they are met, and in the order of their keys in the
        // end.
        let met: BTreeSet<Key> =
            across.values().flat_map(BTreeMap::keys).copied().filter(|key| key.0 != rank).collect();
        let met: Vec<Key> = met.into_iter().collect();
        let count = aggregates.count();
        let numbered = |keys: &[Key], key: &Key| match key {
            (owner, number) if *owner == rank => *number,
            _ => index(count + keys.binary_search(key).unwrap_or_default()),
        };
        let across: Across = across
            .iter()
            .map(|(&row, sums)| {
                (row, sums.iter().map(|(key, &sum)| (numbered(&met, key), sum)).collect())
            })
            .collect();
        let own = aggregates.interpolation(matrix, couplings, damping, None, &across);
        let key_of = |column: u32| {
            (column as usize).checked_sub(count).map_or((rank, column), |beyond| met[beyond])
        };

        let of_row = |row: u32| {
            let range = own.offsets[row as usize]..own.offsets[row as usize + 1];
            let weights = own.weights[range.clone()].iter().copied();
            own.columns[range].iter().map(|&column| key_of(column)).zip(weights).collect()
        };
        let messages = self.halo.given().iter().map(|given| message(given, of_row));
        let mut theirs: Vec<Vec<(Key, f64)>> = vec![Vec::new(); self.owners.len()];
        for (row, weights) in
            lists(self.halo.taken(), &self.communicator().exchange(messages.collect()))
        {
            theirs[row as usize - self.own] = weights;
        }
        let foreign = theirs.iter().flatten().map(|(key, _)| *key).chain(met.iter().copied());
        let foreign: BTreeSet<Key> = foreign.filter(|key| key.0 != rank).collect();
        let foreign: Vec<Key> = foreign.into_iter().collect();
        let mut result = own.clone();
        result.columns.iter_mut().for_each(|column| *column = numbered(&foreign, &key_of(*column)));
        for weights in theirs {
            result.columns.extend(weights.iter().map(|(key, _)| numbered(&foreign, key)));
            result.weights.extend(weights.iter().map(|(_, weight)| weight));
            result.offsets.push(result.columns.len());
        }
        let halo = Halo::of_owners(self.halo.communicator().clone(), count, &foreign);
        let coarse =
            Self { halo, own: count, owners: foreign.iter().map(|(owner, _)| *owner).collect() };
        (result, coarse)
    }

    /// How strongly each row of this rank is coupled to aggregates by blocks between rows of
    /// different ranks, summed over all ranks.
    fn across<const B: usize>(
        &self,
        matrix: &SparseMatrix<B>,
        couplings: &[f64],
        key: impl Fn(usize) -> Option<Key>,
    ) -> BTreeMap<u32, BTreeMap<Key, f64>> {
        let mut across: BTreeMap<u32, BTreeMap<Key, f64>> = BTreeMap::new();
        for row in 0..self.rows() {
            let (columns, first) = (matrix.row(row).0, matrix.offsets()[row]);
            let from = if row < self.own {
                columns.partition_point(|&column| (column as usize) < self.own)
            } else {
                0
            };
            for (position, &column) in columns.iter().enumerate().skip(from) {
                if let Some(key) = key(column as usize) {
                    let sums = across.entry(index(row)).or_default();
                    *sums.entry(key).or_default() += couplings[first + position];
                }
            }
        }
        let of_row = |row: u32| {
            across
                .get(&row)
                .map_or_else(Vec::new, |sums| sums.iter().map(|(k, v)| (*k, *v)).collect())
        };
        let messages = self.halo.taken().iter().map(|taken| message(taken, of_row));
        let heard = self.communicator().exchange(messages.collect());
        across.retain(|&row, _| (row as usize) < self.own);
        for (row, list) in lists(self.halo.given(), &heard) {
            for (key, value) in list {
                *across.entry(row).or_default().entry(key).or_default() += value;
            }
        }
        across
    }
}

/// A list of aggregates with a value each for every row that a neighbour is told of.
fn message(to: &Neighbour, list: impl Fn(u32) -> Vec<(Key, f64)>) -> Message {
    let mut message = Writer::default();
    for &row in &to.entries {
        let list = list(row);
        message.u64(list.len() as u64);
        for ((owner, index), value) in list {
            message.u64(owner as u64);
            message.u32(index);
            message.f64s(&[value]);
        }
    }
    (to.rank, message.into_bytes())
}

/// The lists that neighbours have sent, each for a row of this rank.
fn lists<'a>(
    from: &'a [Neighbour],
    heard: &'a [Message],
) -> impl Iterator<Item = (u32, Vec<(Key, f64)>)> + use<'a> {
    heard.iter().flat_map(move |(rank, message)| {
        let neighbour = from.iter().find(|neighbour| neighbour.rank == *rank);
        let mut reader = Reader::new(*rank, message);
        let mut list = move || -> Result<Vec<(Key, f64)>, Garbled> {
            let count = reader.count(20)?;
            (0..count)
                .map(|_| {
                    let owner = usize::try_from(reader.u64()?).map_err(|_| reader.garbled())?;
                    Ok(((owner, reader.u32()?), reader.f64s(1)?[0]))
                })
                .collect()
        };
        let entries = neighbour.map_or(&[][..], |neighbour| &neighbour.entries);
        entries.iter().map_while(move |&row| Some((row, list().ok()?)))
    })
}
