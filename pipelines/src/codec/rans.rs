//! Small whole numbers by rANS, with fixed distributions.
//!
//! A number is a token and as many plain bits as the token says. Tokens are coded with one of
//! [`TABLES`] distributions: a Laplace distribution rounded to whole numbers, mixed with a wider
//! one. The coder is several coders that take turns (its lanes) and share one list of 16-bit words,
//! so that a processor works on several at once.

use std::sync::OnceLock;

use super::CodecError;
use super::bytes::{Input, put_block, put_count};

/// The number of distributions, from all but zeros to thousands.
pub(super) const TABLES: usize = 40;
/// The frequencies of a table add up to 2 to this.
const BITS: u32 = 12;
const TOTAL: u32 = 1 << BITS;
/// Numbers below it have a token each; above it, each octave has two.
const SINGLE: u32 = 32;
/// The token before a number whose own token its table has not.
const ESCAPE: usize = 86;
/// A lane's state is never below it.
const LOW: u32 = 1 << 16;
/// The most lanes.
pub(super) const LANES: usize = 8;

/// One distribution.
pub(super) struct Table {
    /// The frequency of each token, and the sum of those before it.
    frequencies: [(u32, u32); ESCAPE + 1],
    /// The token of each value below the total.
    slots: Box<[u8; TOTAL as usize]>,
    /// The bits that each token costs, plain ones among them.
    costs: [f32; ESCAPE + 1],
}

/// The token of a number, and how many plain bits follow it.
#[inline]
fn token(number: u32) -> (usize, u32) {
    if number < SINGLE {
        return (number as usize, 0);
    }
    let octave = number.ilog2();
    let half = number >> (octave - 1) & 1;
    ((SINGLE + 2 * (octave - 5) + half) as usize, octave - 1)
}

/// The least number of a token, and how many plain bits follow it.
fn least(token: usize) -> (u32, u32) {
    if token < SINGLE as usize {
        return (token as u32, 0);
    }
    #[expect(clippy::cast_possible_truncation, reason = "there are 87 tokens")]
    let token = token as u32 - SINGLE;
    let octave = 5 + token / 2;
    ((2 + token % 2) << (octave - 1), octave - 1)
}

/// All distributions.
pub(super) fn tables() -> &'static [Table] {
    static ALL: OnceLock<Vec<Table>> = OnceLock::new();
    ALL.get_or_init(|| {
        let mut width = 1.0 / 256.0;
        let mut tables = Vec::with_capacity(TABLES);
        for _ in 0..TABLES {
            tables.push(Table::new(width));
            width *= std::f64::consts::SQRT_2;
        }
        tables
    })
}

/// `base` to the power of a whole number, by repeated squaring.
fn power(mut base: f64, mut exponent: u64) -> f64 {
    let mut result = 1.0;
    while exponent > 0 {
        if exponent & 1 == 1 {
            result *= base;
        }
        base *= base;
        exponent >>= 1;
    }
    result
}

/// The probability that a zigzag number is at least `number`, which is even, where `ratio` is that
/// of half a step of the Laplace distribution.
fn at_least(ratio: f64, number: u64) -> f64 {
    if number == 0 {
        return 1.0;
    }
    let half = number / 2;
    0.5 * (power(ratio, 2 * half - 1) + power(ratio, 2 * half + 1))
}

/// The probability of a token, where the width is that of the Laplace distribution.
fn probability(width: f64, token: usize) -> f64 {
    let ratio = width / (1.0 + width);
    let (first, plain) = least(token);
    let first = u64::from(first);
    if token == 0 {
        1.0 - ratio
    } else if token < SINGLE as usize {
        let magnitude = first.div_ceil(2);
        0.5 * (power(ratio, 2 * magnitude - 1) - power(ratio, 2 * magnitude + 1))
    } else {
        at_least(ratio, first) - at_least(ratio, first + (1 << plain))
    }
}

impl Table {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "probabilities are between 0 and 1"
    )]
    fn new(width: f64) -> Self {
        let mut frequencies = [0u32; ESCAPE + 1];
        for (token, frequency) in frequencies[..ESCAPE].iter_mut().enumerate() {
            let wider = probability(4.0 * width + 0.02, token);
            let mixed = (15.0 * probability(width, token) + wider) / 16.0;
            *frequency = (mixed * f64::from(TOTAL) + 0.5).floor() as u32;
        }
        frequencies[ESCAPE] = 1;
        // What rounding left over or took too much goes to the most frequent.
        let mut most = 0;
        for token in 0..ESCAPE {
            if frequencies[token] > frequencies[most] {
                most = token;
            }
        }
        let sum: u32 = frequencies.iter().sum();
        frequencies[most] = frequencies[most] + TOTAL - sum;

        let mut start = 0;
        let mut slots = Box::new([0; TOTAL as usize]);
        let starts = frequencies.map(|frequency| {
            start += frequency;
            (frequency, start - frequency)
        });
        let costs = std::array::from_fn(|token| {
            let (frequency, _) = starts[token];
            let plain = if token == ESCAPE { 32 } else { least(token).1 };
            let frequency = if frequency == 0 { 2f32.powi(-32) } else { frequency as f32 };
            BITS as f32 - frequency.log2() + plain as f32
        });
        for (token, (frequency, start)) in (0u8..).zip(starts) {
            slots[start as usize..(start + frequency) as usize].fill(token);
        }
        Self { frequencies: starts, slots, costs }
    }
}

/// How often each token was met.
#[derive(Clone)]
pub(super) struct Histogram([u32; ESCAPE + 1]);

impl Histogram {
    pub(super) const NEW: Self = Self([0; ESCAPE + 1]);

    pub(super) fn add(&mut self, number: u32) {
        self.0[token(number).0] += 1;
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.iter().all(|&count| count == 0)
    }

    /// The bits that all of it costs with a table.
    fn cost(&self, table: &Table) -> f32 {
        self.0.iter().zip(&table.costs).map(|(&count, cost)| count as f32 * cost).sum()
    }

    /// The table with which it costs least; another only if that saves more bits than `price`.
    pub(super) fn best(&self, otherwise: u8, price: f32) -> u8 {
        let tables = tables();
        let (mut best, mut least) = (otherwise, self.cost(&tables[usize::from(otherwise)]) - price);
        for (index, table) in (0u8..).zip(tables) {
            let cost = self.cost(table);
            if cost < least {
                (best, least) = (index, cost);
            }
        }
        best
    }
}

/// The bits of numbers that are not in their tokens, the lowest first.
#[derive(Default)]
struct PlainWriter {
    bytes: Vec<u8>,
    held: u64,
    count: u32,
}

impl PlainWriter {
    #[expect(clippy::cast_possible_truncation, reason = "bytes are taken out of the number")]
    fn put(&mut self, value: u32, count: u32) {
        self.held |= u64::from(value) << self.count;
        self.count += count;
        while self.count >= 8 {
            self.bytes.push(self.held as u8);
            self.held >>= 8;
            self.count -= 8;
        }
    }

    #[expect(clippy::cast_possible_truncation, reason = "bytes are taken out of the number")]
    fn finish(mut self) -> Vec<u8> {
        if self.count > 0 {
            self.bytes.push(self.held as u8);
        }
        self.bytes
    }
}

/// Codes numbers, each with the table of its number; writes `2^lanes` lanes.
#[expect(clippy::cast_possible_truncation, reason = "states and words have their sizes")]
pub(super) fn encode(numbers: &[(u8, u32)], lanes: u32, out: &mut Vec<u8>) {
    let tables = tables();
    let mask = (1usize << lanes) - 1;
    let mut plain = PlainWriter::default();
    for &(table, number) in numbers {
        let (token, bits) = token(number);
        if tables[usize::from(table)].frequencies[token].0 == 0 {
            plain.put(number, 32);
        } else if bits > 0 {
            plain.put(number & ((1 << bits) - 1), bits);
        }
    }
    let mut states = [LOW; LANES];
    let mut words = Vec::with_capacity(numbers.len() / 2);
    for (index, &(table, number)) in numbers.iter().enumerate().rev() {
        let frequencies = &tables[usize::from(table)].frequencies;
        let (mut frequency, mut start) = frequencies[token(number).0];
        if frequency == 0 {
            (frequency, start) = frequencies[ESCAPE];
        }
        let state = &mut states[index & mask];
        if u64::from(*state) >= u64::from(frequency) << (32 - BITS) {
            words.push(*state as u16);
            *state >>= 16;
        }
        *state = ((*state / frequency) << BITS) + *state % frequency + start;
    }
    for state in &states[..=mask] {
        out.extend(state.to_le_bytes());
    }
    put_count(out, words.len());
    out.extend(words.iter().rev().flat_map(|word| word.to_le_bytes()));
    put_block(out, &plain.finish());
}

/// Reads numbers one after the other.
pub(super) struct Decoder<'bytes> {
    tables: &'static [Table],
    states: [u32; LANES],
    mask: usize,
    index: usize,
    words: &'bytes [[u8; 2]],
    at: usize,
    plain: &'bytes [u8],
    bit: usize,
}

impl<'bytes> Decoder<'bytes> {
    pub(super) fn new(lanes: u32, input: &mut Input<'bytes>) -> Result<Self, CodecError> {
        let mut states = [LOW; LANES];
        for state in states.iter_mut().take(1 << lanes) {
            *state = u32::from_le_bytes(input.array()?);
        }
        let count = input.count()?;
        let words = input.take(count.saturating_mul(2))?.as_chunks().0;
        let plain = input.block()?;
        let mask = (1 << lanes) - 1;
        Ok(Self { tables: tables(), states, mask, index: 0, words, at: 0, plain, bit: 0 })
    }

    /// The next number, which was coded with this table.
    #[inline]
    pub(super) fn next(&mut self, table: u8) -> u32 {
        let state = &mut self.states[self.index & self.mask & (LANES - 1)];
        self.index += 1;
        let table = &self.tables[usize::from(table)];
        let slot = *state & (TOTAL - 1);
        let token = usize::from(table.slots[slot as usize]);
        let (frequency, start) = table.frequencies[token];
        let mut next = frequency.wrapping_mul(*state >> BITS).wrapping_add(slot - start);
        if next < LOW {
            let word = self.words.get(self.at).map_or(0, |&word| u16::from_le_bytes(word));
            next = next << 16 | u32::from(word);
            self.at += 1;
        }
        *state = next;
        #[expect(clippy::cast_possible_truncation, reason = "there are 87 tokens")]
        if token < SINGLE as usize { token as u32 } else { self.long(token) }
    }

    /// A number with plain bits.
    fn long(&mut self, token: usize) -> u32 {
        let (first, count) = if token == ESCAPE { (0, 32) } else { least(token) };
        let mut held = [0u8; 8];
        let bytes = self.plain.get(self.bit / 8..).unwrap_or_default();
        let there = bytes.len().min(8);
        held[..there].copy_from_slice(&bytes[..there]);
        let value = u64::from_le_bytes(held) >> (self.bit % 8) & ((1u64 << count) - 1);
        self.bit += count as usize;
        #[expect(clippy::cast_possible_truncation, reason = "at most 32 bits")]
        first.wrapping_add(value as u32)
    }

    /// Whether no more was read than there is, and all lanes ended where they began.
    pub(super) fn finish(&self) -> Result<(), CodecError> {
        if self.at != self.words.len() || self.bit.div_ceil(8) != self.plain.len() {
            return Err(CodecError::Truncated);
        }
        if self.states != [LOW; LANES] {
            return Err(CodecError::Damaged("a lane does not end where it began"));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tokens_cover_all_numbers() {
        for number in (0..100_000).chain([u32::MAX, u32::MAX / 2, 1 << 31, (1 << 31) - 1]) {
            let (token, plain) = token(number);
            let (first, bits) = least(token);
            assert!(token < ESCAPE && plain == bits, "{number}");
            assert_eq!(first | number & ((1u64 << bits) - 1) as u32, number);
        }
    }

    #[test]
    fn tables_are_complete_and_fit_their_distribution() {
        for (index, table) in tables().iter().enumerate() {
            let sum: u32 = table.frequencies.iter().map(|token| token.0).sum();
            assert_eq!(sum, TOTAL, "table {index}");
            assert!(table.frequencies[0].0 >= table.frequencies[2].0);
            for slot in 0..TOTAL {
                let (frequency, start) = table.frequencies[usize::from(table.slots[slot as usize])];
                assert!((start..start + frequency).contains(&slot));
            }
        }
        let width = 10.0;
        let all: f64 = (0..ESCAPE).map(|token| probability(width, token)).sum();
        assert!((all - 1.0).abs() < 1e-12, "{all}");
    }

    #[test]
    fn what_is_written_is_read() {
        let mut random = 7u64;
        let numbers: Vec<(u8, u32)> = (0..50_000)
            .map(|index| {
                random = random.wrapping_mul(6364136223846793005).wrapping_add(1);
                let number = (random >> 33) as u32 >> (index % 32);
                ((random >> 20) as u8 % TABLES as u8, number)
            })
            .collect();
        for (lanes, count) in [(0, 0), (0, 1), (1, 77), (3, 50_000), (3, 5), (2, 1000)] {
            let mut bytes = Vec::new();
            encode(&numbers[..count], lanes, &mut bytes);
            let mut input = Input(&bytes);
            let mut decoder = Decoder::new(lanes, &mut input).unwrap();
            for &(table, number) in &numbers[..count] {
                assert_eq!(decoder.next(table), number);
            }
            decoder.finish().unwrap();
            assert!(input.0.is_empty());
        }
    }

    #[test]
    fn coding_costs_what_the_table_says() {
        let mut histogram = Histogram::NEW;
        let numbers: Vec<u32> = (0..20_000u32).map(|i| (i * i % 97) / 12).collect();
        numbers.iter().for_each(|&number| histogram.add(number));
        let best = histogram.best(0, 0.0);
        let mut bytes = Vec::new();
        let coded: Vec<(u8, u32)> = numbers.iter().map(|&number| (best, number)).collect();
        encode(&coded, 3, &mut bytes);
        let expected = f64::from(histogram.cost(&tables()[usize::from(best)])) / 8.0;
        assert!((bytes.len() as f64 - expected).abs() < 0.01 * expected + 40.0);
    }
}
