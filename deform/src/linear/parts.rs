//! Systems whose rows are spread over ranks, as multigrid has them.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::aggregation::{Across, Aggregates};
use super::transfer::{Interpolation, RowsFound, collected};
use super::{Block, SparseMatrix, add};
use crate::parallel;
use crate::partition::{Partition, Shares, all, count};

/// How many rows are put together at a time.
const CHUNK: usize = 64;

/// A place that is not in a list.
const NONE: u32 = u32::MAX;

/// An aggregate by the rank that has formed it, and its number there.
type Key = (usize, u32);

/// The rows that a rank has of a system: first those that it speaks for, then those that others do and that its own are coupled to.
#[derive(Debug, Clone)]
pub(super) struct Parts {
    partition: Arc<dyn Partition>,
    shares: Shares,
    own: usize,
    /// The ranks that speak for the rows after the own ones.
    owners: Vec<usize>,
}

/// An order of rows.
#[derive(Debug, Clone)]
pub(super) struct Order {
    /// The old number of each row, and the new one.
    pub(super) old: Vec<u32>,
    pub(super) new: Vec<u32>,
}

impl Parts {
    /// `rows` rows in any order, and the order that has this rank's own ones first, otherwise as they were.
    pub(super) fn new(
        partition: Arc<dyn Partition>,
        shares: &Shares,
        rows: usize,
    ) -> (Self, Order) {
        let (mut old, foreign): (Vec<u32>, Vec<u32>) =
            (0..).take(rows).partition(|&row: &u32| shares.owns(row as usize));
        let own = old.len();
        old.extend(foreign);
        let mut new = vec![0; rows];
        (0..).zip(&old).for_each(|(place, &row)| new[row as usize] = place);
        let shares = shares.moved(|row| new[row as usize]);
        (Self::own_first(partition, shares, own, rows), Order { old, new })
    }

    fn own_first(partition: Arc<dyn Partition>, shares: Shares, own: usize, rows: usize) -> Self {
        let mut owners = vec![partition.rank(); rows - own];
        for (rank, places) in shares.taken() {
            places.iter().for_each(|&place| owners[place as usize - own] = *rank);
        }
        Self { partition, shares, own, owners }
    }

    pub(super) fn partition(&self) -> &Arc<dyn Partition> {
        &self.partition
    }

    pub(super) fn shares(&self) -> &Shares {
        &self.shares
    }

    /// How many rows this rank speaks for.
    pub(super) fn own(&self) -> usize {
        self.own
    }

    /// How many rows this rank has.
    pub(super) fn rows(&self) -> usize {
        self.own + self.owners.len()
    }

    /// The sum of counts of all ranks.
    pub(super) fn sum(&self, mine: usize) -> usize {
        count(&*self.partition, mine)
    }

    /// What was found here, where all ranks have found something.
    pub(super) fn agreed<R>(&self, found: Option<R>) -> Option<R> {
        let everywhere = all(&*self.partition, found.is_some());
        found.filter(|_| everywhere)
    }

    fn owner(&self, row: usize) -> usize {
        row.checked_sub(self.own).map_or_else(|| self.partition.rank(), |place| self.owners[place])
    }

    /// A part of the same sum: blocks between rows that one rank speaks for are moved there, those between rows of different ranks
    /// stay where they are. So the first [`own`](Self::own) rows and columns are those of the sum. `order` is that of the rows where
    /// those of `matrix` have another one.
    pub(super) fn assembled<const B: usize>(
        &self,
        matrix: &SparseMatrix<B>,
        order: Option<&Order>,
    ) -> SparseMatrix<B> {
        let old = |row: usize| order.map_or(row, |order| order.old[row] as usize);
        let new = |row: u32| order.map_or(row, |order| order.new[row as usize]);
        let mut messages = Vec::new();
        let mut listed = vec![NONE; self.rows()];
        for (rank, common) in self.shares.others() {
            let theirs =
                || (0..).zip(common).filter(|(_, row)| self.owner(**row as usize) == *rank);
            theirs().for_each(|(index, &row): (u32, _)| listed[row as usize] = index);
            let mut message: Vec<f64> = Vec::new();
            for (index, &row) in theirs() {
                let (columns, blocks) = matrix.row(old(row as usize));
                for (&column, block) in columns.iter().zip(blocks) {
                    let place = listed[new(column) as usize];
                    if place != NONE {
                        message.extend([f64::from(index), f64::from(place)]);
                        message.extend(block.as_flattened());
                    }
                }
            }
            theirs().for_each(|(_, &row)| listed[row as usize] = NONE);
            messages.push((*rank, message));
        }
        let mut more: Vec<(u32, u32, Block<B>)> = Vec::new();
        for (from, message) in self.partition.exchange(messages) {
            let Some((_, common)) = self.shares.others().iter().find(|(rank, _)| *rank == from)
            else {
                continue;
            };
            for entry in message.chunks_exact(2 + B * B) {
                let (Some(row), Some(column)) =
                    (place_in(common, entry[0]), place_in(common, entry[1]))
                else {
                    continue;
                };
                more.push((
                    row,
                    column,
                    std::array::from_fn(|i| std::array::from_fn(|j| entry[2 + B * i + j])),
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
                            Ok(place) => add(&mut blocks_of_row[place].1, &block),
                            Err(place) => blocks_of_row.insert(place, (column, block)),
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

    /// The interpolation from the aggregates of all ranks to the rows that this one has, and these ranks' parts of the aggregates.
    /// All couplings across ranks are taken as strong.
    pub(super) fn interpolation<const B: usize>(
        &self,
        matrix: &SparseMatrix<B>,
        couplings: &[f64],
        aggregates: &Aggregates,
        damping: f64,
    ) -> (Interpolation, Self) {
        let rank = self.partition.rank();
        let mut of_row = vec![-1.0; self.rows()];
        (0..self.own).for_each(|row| of_row[row] = aggregates.of(row).map_or(-1.0, f64::from));
        self.shares.spread(&*self.partition, 1, &mut of_row);
        let key = |row: usize| number(of_row[row]).map(|index| (self.owner(row), index));
        let across = self.across(matrix, couplings, key);

        // Aggregates of others are numbered as they are met, and in the order of their keys in the end.
        let met: BTreeSet<Key> =
            across.values().flat_map(BTreeMap::keys).copied().filter(|key| key.0 != rank).collect();
        let met: Vec<Key> = met.into_iter().collect();
        let count = aggregates.count();
        #[expect(clippy::cast_possible_truncation, reason = "aggregates are 32-bit, as rows are")]
        let numbered = |keys: &[Key], key: &Key| match key {
            (owner, index) if *owner == rank => *index,
            _ => (count + keys.binary_search(key).unwrap_or_default()) as u32,
        };
        let across: Across = across
            .iter()
            .map(|(&row, sums)| {
                (row, sums.iter().map(|(key, &sum)| (numbered(&met, key), sum)).collect())
            })
            .collect();
        let own = aggregates.interpolation(matrix, couplings, damping, None, &across);
        let key_of = |column: u32| {
            (column as usize).checked_sub(count).map_or((rank, column), |place| met[place])
        };

        let of_row = |row: u32| {
            let range = own.offsets[row as usize]..own.offsets[row as usize + 1];
            let weights = own.weights[range.clone()].iter().copied();
            own.columns[range].iter().map(|&column| key_of(column)).zip(weights).collect()
        };
        let messages = self
            .shares
            .given()
            .iter()
            .map(|(to, rows)| (*to, message(rows.iter().map(|&row| of_row(row)))));
        let mut theirs: Vec<Vec<(Key, f64)>> = vec![Vec::new(); self.owners.len()];
        for (from, message) in self.partition.exchange(messages.collect()) {
            let Some((_, rows)) = self.shares.taken().iter().find(|(rank, _)| *rank == from) else {
                continue;
            };
            for (&row, weights) in rows.iter().zip(lists(&message)) {
                theirs[row as usize - self.own] = weights;
            }
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
        let shares = Shares::of_owners(&*self.partition, count, &foreign);
        let coarse = Self {
            partition: Arc::clone(&self.partition),
            shares,
            own: count,
            owners: foreign.iter().map(|(owner, _)| *owner).collect(),
        };
        (result, coarse)
    }

    /// How strongly each row that this rank speaks for is coupled to aggregates by blocks between rows of different ranks, summed over
    /// all ranks.
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
            for (place, &column) in columns.iter().enumerate().skip(from) {
                if let Some(key) = key(column as usize) {
                    #[expect(clippy::cast_possible_truncation, reason = "rows are 32-bit")]
                    let sums = across.entry(row as u32).or_default();
                    *sums.entry(key).or_default() += couplings[first + place];
                }
            }
        }
        let of_row = |row: u32| {
            across
                .get(&row)
                .map_or_else(Vec::new, |sums| sums.iter().map(|(k, v)| (*k, *v)).collect())
        };
        let messages = self
            .shares
            .taken()
            .iter()
            .map(|(to, rows)| (*to, message(rows.iter().map(|&row| of_row(row)))));
        let heard = self.partition.exchange(messages.collect());
        across.retain(|&row, _| (row as usize) < self.own);
        for (from, message) in heard {
            let Some((_, rows)) = self.shares.given().iter().find(|(rank, _)| *rank == from) else {
                continue;
            };
            for (&row, list) in rows.iter().zip(lists(&message)) {
                for (key, value) in list {
                    *across.entry(row).or_default().entry(key).or_default() += value;
                }
            }
        }
        across
    }
}

/// Lists of aggregates with a value each, one list after the other.
#[expect(clippy::cast_precision_loss, reason = "counts and ranks below 2^53")]
fn message(lists: impl Iterator<Item = Vec<(Key, f64)>>) -> Vec<f64> {
    let mut message = Vec::new();
    for list in lists {
        message.push(list.len() as f64);
        message.extend(
            list.iter()
                .flat_map(|&((owner, index), value)| [owner as f64, f64::from(index), value]),
        );
    }
    message
}

/// What [`message`] was made of.
fn lists(message: &[f64]) -> impl Iterator<Item = Vec<(Key, f64)>> {
    let mut rest = message;
    std::iter::from_fn(move || {
        let (&length, after) = rest.split_first()?;
        let (list, after) = after.split_at_checked(3 * number(length)? as usize)?;
        rest = after;
        list.chunks_exact(3)
            .map(|entry| Some(((number(entry[0])? as usize, number(entry[1])?), entry[2])))
            .collect()
    })
}

/// A 32-bit number as it was sent; `None` for what is none.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked here")]
fn number(sent: f64) -> Option<u32> {
    (sent >= 0.0 && sent <= f64::from(u32::MAX)).then_some(sent as u32)
}

fn place_in(list: &[u32], sent: f64) -> Option<u32> {
    list.get(number(sent)? as usize).copied()
}
