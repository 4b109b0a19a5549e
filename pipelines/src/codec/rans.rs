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
    /// The ways into the state of a lane; where a token has no frequency, that of the escape.
    steps: Box<[Step; ESCAPE + 1]>,
}

/// The way of a token into the state of a lane, without a division.
#[derive(Debug, Clone, Copy)]
struct Step {
    /// 2⁶⁴ by the frequency, rounded up.
    inverse: u64,
    /// What is added beside the multiple of the quotient.
    bias: u32,
    frequency: u16,
    /// What the frequency lacks to the total.
    others: u16,
}

impl Step {
    #[expect(clippy::cast_possible_truncation, reason = "frequencies have 13 bits")]
    fn new(frequency: u32, start: u32) -> Self {
        // With 1 the quotient comes out one too small, which the bias makes good.
        let (inverse, more) = match frequency {
            1 => (u64::MAX, TOTAL - 1),
            _ => ((u64::MAX / u64::from(frequency)) + 1, 0),
        };
        let others = (TOTAL - frequency) as u16;
        Self { inverse, bias: start + more, frequency: frequency as u16, others }
    }

    /// `state / frequency * TOTAL + state % frequency + start`.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "a quotient of 32 bits")]
    fn take(self, state: u32) -> u32 {
        let quotient = ((u128::from(state) * u128::from(self.inverse)) >> 64) as u32;
        state.wrapping_add(self.bias).wrapping_add(quotient.wrapping_mul(u32::from(self.others)))
    }
}

/// Everything about the distributions.
pub(super) struct Tables {
    all: Vec<Table>,
    /// For each token the bits that it costs with each table, plain ones among them.
    costs: Vec<[f32; TABLES]>,
}

/// A number with its token and the class whose table codes it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Number {
    pub(super) number: u32,
    pub(super) class: u8,
    token: u8,
}

impl Number {
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "there are 87 tokens")]
    pub(super) fn new(number: u32, class: u8) -> Self {
        Self { number, class, token: token(number).0 as u8 }
    }
}

/// The token of a number, and how many plain bits follow it.
#[inline(always)]
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
pub(super) fn tables() -> &'static Tables {
    static ALL: OnceLock<Tables> = OnceLock::new();
    ALL.get_or_init(|| {
        let mut width = 1.0 / 256.0;
        let mut all = Vec::with_capacity(TABLES);
        for _ in 0..TABLES {
            all.push(Table::new(width));
            width *= std::f64::consts::SQRT_2;
        }
        let cost = |token: usize| std::array::from_fn(|table| all[table].cost(token));
        let costs = (0..=ESCAPE).map(cost).collect();
        Tables { all, costs }
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
        for (token, (frequency, start)) in (0u8..).zip(starts) {
            slots[start as usize..(start + frequency) as usize].fill(token);
        }
        let steps = Box::new(starts.map(|(frequency, start)| match frequency {
            0 => Step::new(1, starts[ESCAPE].1),
            _ => Step::new(frequency, start),
        }));
        Self { frequencies: starts, slots, steps }
    }

    /// The bits that a token costs, plain ones among them.
    fn cost(&self, token: usize) -> f32 {
        let (frequency, _) = self.frequencies[token];
        let plain = if token == ESCAPE { 32 } else { least(token).1 };
        let frequency = if frequency == 0 { 2f32.powi(-32) } else { frequency as f32 };
        BITS as f32 - frequency.log2() + plain as f32
    }
}

/// How often each token was met.
#[derive(Clone)]
pub(super) struct Histogram([u32; ESCAPE + 1]);

impl Histogram {
    pub(super) const NEW: Self = Self([0; ESCAPE + 1]);

    #[inline(always)]
    pub(super) fn add(&mut self, number: Number) {
        self.0[usize::from(number.token)] += 1;
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.iter().all(|&count| count == 0)
    }

    /// Whether a number needs more than its token, with this table.
    pub(super) fn has_plain(&self, table: u8) -> bool {
        let frequencies = &tables().all[usize::from(table)].frequencies;
        let needs = |token: usize| token >= SINGLE as usize || frequencies[token].0 == 0;
        self.0.iter().enumerate().any(|(token, &count)| count > 0 && needs(token))
    }

    /// The bits that all of it costs with each table.
    fn costs(&self) -> [f32; TABLES] {
        let mut sums = [0.0; TABLES];
        let met = self.0.iter().zip(&tables().costs).filter(|(count, _)| **count > 0);
        for (&count, costs) in met {
            for (sum, cost) in sums.iter_mut().zip(costs) {
                *sum += count as f32 * cost;
            }
        }
        sums
    }

    /// The table with which it costs least; another only if that saves more bits than `price`.
    pub(super) fn best(&self, otherwise: u8, price: f32) -> u8 {
        let costs = self.costs();
        let (mut best, mut least) = (otherwise, costs[usize::from(otherwise)] - price);
        for (index, cost) in (0u8..).zip(costs) {
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

/// Codes numbers, each with the table that its class has; writes `2^lanes` lanes. `has_plain` says
/// whether one of them needs more than its token.
pub(super) fn encode(
    numbers: &[Number],
    of_classes: &[u8],
    has_plain: bool,
    lanes: u32,
    out: &mut Vec<u8>,
) {
    let all = &tables().all;
    let of_classes: Vec<&Table> =
        of_classes.iter().map(|&table| &all[usize::from(table)]).collect();
    let mut plain = PlainWriter::default();
    for &Number { number, class, token } in numbers.iter().filter(|_| has_plain) {
        let token = usize::from(token);
        if of_classes[usize::from(class)].frequencies[token].0 == 0 {
            plain.put(number, 32);
        } else if token >= SINGLE as usize {
            let bits = least(token).1;
            plain.put(number & ((1 << bits) - 1), bits);
        }
    }
    match lanes {
        0 => encode_lanes::<1>(numbers, &of_classes, out),
        1 => encode_lanes::<2>(numbers, &of_classes, out),
        2 => encode_lanes::<4>(numbers, &of_classes, out),
        _ => encode_lanes::<8>(numbers, &of_classes, out),
    }
    put_block(out, &plain.finish());
}

/// The states of so many lanes, and the words behind them.
fn encode_lanes<const LANES: usize>(numbers: &[Number], of_classes: &[&Table], out: &mut Vec<u8>) {
    let mut states = [LOW; LANES];
    // One for each number at most, from the last to the first.
    let mut words = vec![0u16; numbers.len() + 1];
    let mut at = numbers.len();
    #[expect(clippy::cast_possible_truncation, reason = "the lowest bits are the word")]
    let mut take = |state: &mut u32, number: &Number| {
        let step = of_classes[usize::from(number.class)].steps[usize::from(number.token)];
        // No branch: whether a word is full comes as a surprise each time.
        let is_full = u32::from(*state >> (32 - BITS) >= u32::from(step.frequency));
        words[at] = *state as u16;
        at -= is_full as usize;
        *state = step.take(*state >> (16 * is_full));
    };
    let (rounds, rest) = numbers.as_chunks::<LANES>();
    for (state, number) in states.iter_mut().zip(rest).rev() {
        take(state, number);
    }
    for round in rounds.iter().rev() {
        for lane in (0..LANES).rev() {
            take(&mut states[lane], &round[lane]);
        }
    }
    for state in states {
        out.extend(state.to_le_bytes());
    }
    let words = &words[at + 1..];
    put_count(out, words.len());
    out.reserve(2 * words.len());
    words.iter().for_each(|word| out.extend_from_slice(&word.to_le_bytes()));
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
        Ok(Self { tables: &tables().all, states, mask, index: 0, words, at: 0, plain, bit: 0 })
    }

    /// The next number, which was coded with this table.
    #[inline(always)]
    pub(super) fn next(&mut self, table: u8) -> u32 {
        let state = &mut self.states[self.index & self.mask & (LANES - 1)];
        self.index += 1;
        let table = &self.tables[usize::from(table)];
        let slot = *state & (TOTAL - 1);
        let token = usize::from(table.slots[slot as usize]);
        let (frequency, start) = table.frequencies[token];
        let next = frequency.wrapping_mul(*state >> BITS).wrapping_add(slot - start);
        // No branch: whether a word is due comes as a surprise each time.
        let is_due = u32::from(next < LOW);
        let word = self.words.get(self.at).map_or(0, |&word| u16::from_le_bytes(word));
        *state = next << (16 * is_due) | u32::from(word) & is_due.wrapping_neg();
        self.at += is_due as usize;
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
    fn steps_are_what_a_division_gives() {
        for frequency in (1..=64).chain([1000, 1365, 2047, 2049, 4001, 4095, 4096]) {
            let step = Step::new(frequency, 0);
            let most = (u64::from(frequency) << (32 - BITS)) - 1;
            let states = (0..2000).map(|i| most - i * i * i % (most / 2)).chain([65536, 0, most]);
            for state in states.map(|state| state as u32) {
                let expected = ((state / frequency) << BITS).wrapping_add(state % frequency);
                // Below 2¹⁶ no lane ever is.
                assert!(state < LOW || step.take(state) == expected, "{frequency} {state}");
            }
        }
    }

    #[test]
    fn tables_are_complete_and_fit_their_distribution() {
        for (index, table) in tables().all.iter().enumerate() {
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
        let every: Vec<u8> = (0..TABLES as u8).collect();
        let numbers: Vec<Number> = (0..50_000)
            .map(|index| {
                random = random.wrapping_mul(6364136223846793005).wrapping_add(1);
                let number = (random >> 33) as u32 >> (index % 32);
                Number::new(number, (random >> 20) as u8 % TABLES as u8)
            })
            .collect();
        for (lanes, count) in [(0, 0), (0, 1), (1, 77), (3, 50_000), (3, 5), (2, 1000)] {
            let mut bytes = Vec::new();
            encode(&numbers[..count], &every, true, lanes, &mut bytes);
            let mut input = Input(&bytes);
            let mut decoder = Decoder::new(lanes, &mut input).unwrap();
            for number in &numbers[..count] {
                assert_eq!(decoder.next(number.class), number.number);
            }
            decoder.finish().unwrap();
            assert!(input.0.is_empty());
        }
    }

    #[test]
    fn coding_costs_what_the_table_says() {
        let mut histogram = Histogram::NEW;
        let number = |i: u32| Number::new((i * i % 97) / 12, 0);
        let numbers: Vec<Number> = (0..20_000u32).map(number).collect();
        numbers.iter().for_each(|&number| histogram.add(number));
        let best = histogram.best(0, 0.0);
        let mut bytes = Vec::new();
        encode(&numbers, &[best], histogram.has_plain(best), 3, &mut bytes);
        let expected = f64::from(histogram.costs()[usize::from(best)]) / 8.0;
        assert!((bytes.len() as f64 - expected).abs() < 0.01 * expected + 40.0);
    }
}
