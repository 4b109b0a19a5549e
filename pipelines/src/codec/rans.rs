//! Small whole numbers by rANS, with fixed distributions.
//!
//! The coder is several coders that take turns (its lanes) and share one list of 16-bit words, so that
//! a processor works on several at once.

use super::CodecError;
use super::bytes::{Input, put_block, put_count};
use super::tables::{
    BITS, ESCAPE, Histogram, SINGLE, TOKEN_BITS, TOKENS, Table, least, tables, token,
};

/// A lane's state is never below it.
pub(super) const LOW: u32 = 1 << 16;
/// The most lanes.
const LANES: usize = 8;
/// The most classes.
const MOST_CLASSES: usize = 64;

/// Numbers to code, each with a class, and how often each token was met in each class.
pub(super) struct Numbers {
    /// The class of each, and in the lowest bits its token.
    codes: Vec<u16>,
    /// Those that are more than their tokens.
    long: Vec<u32>,
    counts: Vec<u32>,
}

impl Numbers {
    /// None yet, with room for so many.
    pub(super) fn new(classes: usize, capacity: usize) -> Self {
        let counts = vec![0; classes << TOKEN_BITS];
        Self { codes: Vec::with_capacity(capacity), long: Vec::new(), counts }
    }

    pub(super) fn len(&self) -> usize {
        self.codes.len()
    }

    /// Adds numbers, each with its class.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "a class and a token have 13 bits")]
    pub(super) fn extend(&mut self, numbers: &[u32], classes: &[u8]) {
        let (start, end) = (self.codes.len(), self.long.len());
        self.codes.resize(start + numbers.len(), 0);
        let codes = &mut self.codes[start..];
        let code = |class: u8, token: u32| u16::from(class) << TOKEN_BITS | token as u16;
        if numbers.iter().fold(0, |all, number| all | number) < SINGLE {
            for ((to, &number), &class) in codes.iter_mut().zip(numbers).zip(classes) {
                *to = code(class, number);
            }
        } else {
            // No branch: whether a number is long comes as a surprise each time.
            self.long.resize(end + numbers.len(), 0);
            let mut at = end;
            for ((to, &number), &class) in codes.iter_mut().zip(numbers).zip(classes) {
                *to = code(class, token(number));
                self.long[at] = number;
                at += usize::from(number >= SINGLE);
            }
            self.long.truncate(at);
        }
        for &mut code in codes {
            self.counts[usize::from(code)] += 1;
        }
    }

    /// How often each token was met in a class.
    pub(super) fn histogram(&self, class: usize) -> Histogram<'_> {
        Histogram(&self.counts[class << TOKEN_BITS..][..=ESCAPE])
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
        if self.count >= 32 {
            self.bytes.extend((self.held as u32).to_le_bytes());
            self.held >>= 32;
            self.count -= 32;
        }
    }

    fn finish(mut self) -> Vec<u8> {
        let left = self.count.div_ceil(8) as usize;
        self.bytes.extend(&self.held.to_le_bytes()[..left]);
        self.bytes
    }
}

/// The tables of classes.
fn tables_of(classes: &[u8]) -> [&'static Table; MOST_CLASSES] {
    let all = &tables().all;
    let mut of = [&all[0]; MOST_CLASSES];
    for (of, &table) in of.iter_mut().zip(classes) {
        *of = &all[usize::from(table)];
    }
    of
}

/// Codes numbers, each with the table that its class has; writes `2^lanes` lanes. `has_plain` says
/// whether one of them needs more than its token.
pub(super) fn encode(
    numbers: &Numbers,
    of_classes: &[u8],
    has_plain: bool,
    lanes: u32,
    out: &mut Vec<u8>,
) {
    let tables = tables_of(of_classes);
    let mut plain = PlainWriter::default();
    let mut long = numbers.long.iter();
    for &code in numbers.codes.iter().filter(|_| has_plain) {
        let (class, token) = (usize::from(code) / TOKENS, usize::from(code) % TOKENS);
        let is_long = token >= SINGLE as usize;
        let number = if is_long { long.next().copied().unwrap_or_default() } else { token as u32 };
        if tables[class % MOST_CLASSES].frequency(token) == 0 {
            plain.put(number, 32);
        } else if is_long {
            let bits = least(token).1;
            plain.put(number & ((1 << bits) - 1), bits);
        }
    }
    match lanes {
        0 => encode_lanes::<1>(&numbers.codes, &tables, out),
        1 => encode_lanes::<2>(&numbers.codes, &tables, out),
        2 => encode_lanes::<4>(&numbers.codes, &tables, out),
        _ => encode_lanes::<8>(&numbers.codes, &tables, out),
    }
    put_block(out, &plain.finish());
}

/// The states of so many lanes, and the words behind them.
fn encode_lanes<const LANES: usize>(
    codes: &[u16],
    tables: &[&Table; MOST_CLASSES],
    out: &mut Vec<u8>,
) {
    let mut states = [LOW; LANES];
    // One for each number at most, from the last to the first.
    let mut words = vec![0u16; codes.len() + 1];
    let mut at = codes.len();
    #[expect(clippy::cast_possible_truncation, reason = "the lowest bits are the word")]
    let mut take = |state: &mut u32, code: u16| {
        let (class, token) = (usize::from(code) / TOKENS, usize::from(code) % TOKENS);
        let step = tables[class % MOST_CLASSES].steps[token];
        // No branch: whether a word is full comes as a surprise each time.
        let is_full = u32::from(*state >> (32 - BITS) >= u32::from(step.frequency));
        words[at] = *state as u16;
        at -= is_full as usize;
        *state = step.take(*state >> (16 * is_full));
    };
    let (rounds, rest) = codes.as_chunks::<LANES>();
    for (state, &code) in states.iter_mut().zip(rest).rev() {
        take(state, code);
    }
    for round in rounds.iter().rev() {
        for lane in (0..LANES).rev() {
            take(&mut states[lane], round[lane]);
        }
    }
    for state in states {
        out.extend(state.to_le_bytes());
    }
    let words = &words[at + 1..];
    put_count(out, words.len());
    let start = out.len();
    out.resize(start + 2 * words.len(), 0);
    for (bytes, word) in out[start..].as_chunks_mut().0.iter_mut().zip(words) {
        *bytes = word.to_le_bytes();
    }
}

/// Reads numbers one after the other.
pub(super) struct Decoder<'bytes> {
    /// The table of each class.
    tables: [&'static Table; MOST_CLASSES],
    states: [u32; LANES],
    lanes: usize,
    /// The lane whose turn it is.
    lane: usize,
    words: &'bytes [[u8; 2]],
    at: usize,
    plain: &'bytes [u8],
    bit: usize,
}

impl<'bytes> Decoder<'bytes> {
    /// Reads `2^lanes` lanes of numbers, which were coded with these tables of their classes.
    pub(super) fn new(
        lanes: u32,
        of_classes: &[u8],
        input: &mut Input<'bytes>,
    ) -> Result<Self, CodecError> {
        let lanes = 1 << lanes;
        let mut states = [LOW; LANES];
        for state in states.iter_mut().take(lanes) {
            *state = u32::from_le_bytes(input.array()?);
        }
        let count = input.count()?;
        let words = input.take(count.saturating_mul(2))?.as_chunks().0;
        let plain = input.block()?;
        let tables = tables_of(of_classes);
        Ok(Self { tables, states, lanes, lane: 0, words, at: 0, plain, bit: 0 })
    }

    /// The next numbers, which are of these classes.
    #[inline(always)]
    pub(super) fn take(&mut self, classes: &[u8], numbers: &mut [u32]) {
        match self.lanes {
            1 => self.take_rounds::<1>(classes, numbers),
            2 => self.take_rounds::<2>(classes, numbers),
            4 => self.take_rounds::<4>(classes, numbers),
            _ => self.take_rounds::<8>(classes, numbers),
        }
    }

    /// The next numbers, lane beside lane where the first has its turn.
    #[inline(always)]
    fn take_rounds<const LANES: usize>(&mut self, classes: &[u8], numbers: &mut [u32]) {
        let until_first = ((LANES - self.lane) % LANES).min(classes.len());
        self.take_each(&classes[..until_first], &mut numbers[..until_first]);
        let (classes, numbers) = (&classes[until_first..], &mut numbers[until_first..]);
        let mut states = [LOW; LANES];
        states.copy_from_slice(&self.states[..LANES]);
        let mut taken = 0;
        let rounds = classes.as_chunks::<LANES>().0.iter().zip(numbers.as_chunks_mut::<LANES>().0);
        for (classes, numbers) in rounds {
            // Near the end there are fewer.
            let words = self.words.get(self.at..).and_then(<[_]>::first_chunk::<LANES>);
            let Some(words) = words else { break };
            let (mut at, mut all) = (0, 0);
            for lane in 0..LANES {
                let table = self.tables[usize::from(classes[lane]) % MOST_CLASSES];
                let (token, state) = table.take(states[lane]);
                let is_due;
                (states[lane], is_due) = filled(state, words[at % LANES]);
                at += is_due;
                numbers[lane] = u32::from(token);
                all |= u32::from(token);
            }
            self.at += at;
            if all >= SINGLE {
                numbers.iter_mut().for_each(|number| *number = self.whole(*number));
            }
            taken += LANES;
        }
        self.states[..LANES].copy_from_slice(&states);
        self.take_each(&classes[taken..], &mut numbers[taken..]);
    }

    /// The next numbers, one by one.
    #[inline(always)]
    fn take_each(&mut self, classes: &[u8], numbers: &mut [u32]) {
        for (number, &class) in numbers.iter_mut().zip(classes) {
            let table = self.tables[usize::from(class) % MOST_CLASSES];
            let (token, state) = table.take(self.states[self.lane % LANES]);
            let word = self.words.get(self.at).copied().unwrap_or_default();
            let is_due;
            (self.states[self.lane % LANES], is_due) = filled(state, word);
            self.at += is_due;
            self.lane = (self.lane + 1) % self.lanes;
            *number = self.whole(u32::from(token));
        }
    }

    /// The number of a token, with its plain bits.
    #[inline(always)]
    fn whole(&mut self, token: u32) -> u32 {
        if token < SINGLE { token } else { self.long(token as usize) }
    }

    /// A number with plain bits.
    fn long(&mut self, token: usize) -> u32 {
        let (first, count) = if token == ESCAPE { (0, 32) } else { least(token) };
        let mut held = [0u8; 8];
        let bytes = self.plain.get(self.bit / 8..).unwrap_or_default();
        match bytes.first_chunk() {
            Some(bytes) => held = *bytes,
            None => held[..bytes.len()].copy_from_slice(bytes),
        }
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

/// A state with the next word where one is due, and how many were.
#[inline(always)]
fn filled(state: u32, word: [u8; 2]) -> (u32, usize) {
    // No branch: whether a word is due comes as a surprise each time.
    let is_due = u32::from(state < LOW);
    let word = u32::from(u16::from_le_bytes(word)) & is_due.wrapping_neg();
    (state << (16 * is_due) | word, is_due as usize)
}

#[cfg(test)]
mod tests {
    use super::super::tables::TABLES;
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        let mut random = 7u64;
        let every: Vec<u8> = (0..TABLES as u8).collect();
        let (numbers, classes): (Vec<u32>, Vec<u8>) = (0..50_000)
            .map(|index| {
                random = random.wrapping_mul(6364136223846793005).wrapping_add(1);
                ((random >> 33) as u32 >> (index % 32), (random >> 20) as u8 % TABLES as u8)
            })
            .unzip();
        for (lanes, count) in [(0, 0), (0, 1), (1, 77), (3, 50_000), (3, 5), (2, 1000)] {
            let (numbers, classes) = (&numbers[..count], &classes[..count]);
            let mut all = Numbers::new(TABLES, 0);
            let mut bytes = Vec::new();
            for (numbers, classes) in numbers.chunks(333).zip(classes.chunks(333)) {
                all.extend(numbers, classes);
            }
            encode(&all, &every, true, lanes, &mut bytes);
            // A few at a time, so that each lane is the first.
            for length in [1, 2, 13, 64, 5000] {
                let mut input = Input(&bytes);
                let mut decoder = Decoder::new(lanes, &every, &mut input).unwrap();
                for (numbers, classes) in numbers.chunks(length).zip(classes.chunks(length)) {
                    let mut read = vec![0; numbers.len()];
                    decoder.take(classes, &mut read);
                    assert_eq!(read, numbers);
                }
                decoder.finish().unwrap();
                assert!(input.0.is_empty());
            }
        }
    }

    #[test]
    fn coding_costs_what_the_table_says() {
        let list: Vec<u32> = (0..20_000u32).map(|i| (i * i % 97) / 12).collect();
        let mut numbers = Numbers::new(1, list.len());
        numbers.extend(&list, &vec![0; list.len()]);
        let histogram = numbers.histogram(0);
        let best = histogram.best(0, 0.0);
        let mut bytes = Vec::new();
        encode(&numbers, &[best], histogram.has_plain(best), 3, &mut bytes);
        let expected = f64::from(histogram.costs()[usize::from(best)]) / 8.0;
        assert!((bytes.len() as f64 - expected).abs() < 0.01 * expected + 40.0);
    }
}
