//! The distributions of small whole numbers.
//!
//! A number is a token and as many plain bits as the token says. Tokens are coded with one of
//! [`TABLES`] distributions: a Laplace distribution rounded to whole numbers, mixed with a wider
//! one.

use std::sync::OnceLock;

/// The number of distributions, from all but zeros to thousands.
pub(super) const TABLES: usize = 40;
/// The frequencies of a table add up to 2 to this.
pub(super) const BITS: u32 = 12;
pub(super) const TOTAL: u32 = 1 << BITS;
/// Numbers below it have a token each; above it, each octave has two.
pub(super) const SINGLE: u32 = 32;
/// The token before a number whose own token its table has not.
pub(super) const ESCAPE: usize = 86;
/// A token has so many bits, in a list that has room for each of them.
pub(super) const TOKEN_BITS: u32 = 7;
pub(super) const TOKENS: usize = 1 << TOKEN_BITS;

/// One distribution.
pub(super) struct Table {
    /// The frequency of each token, and from the 16th bit on the sum of those before it.
    frequencies: [u32; TOKENS],
    /// The token of each value below the total.
    slots: [u8; TOTAL as usize],
    /// The ways into the state of a lane; where a token has no frequency, that of the escape.
    pub(super) steps: [Step; TOKENS],
}

/// The way of a token into the state of a lane, without a division.
#[derive(Debug, Clone, Copy)]
pub(super) struct Step {
    /// 2⁶⁴ by the frequency, rounded up.
    inverse: u64,
    /// What is added beside the multiple of the quotient.
    bias: u32,
    pub(super) frequency: u16,
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
    pub(super) fn take(self, state: u32) -> u32 {
        let quotient = ((u128::from(state) * u128::from(self.inverse)) >> 64) as u32;
        state.wrapping_add(self.bias).wrapping_add(quotient.wrapping_mul(u32::from(self.others)))
    }
}

/// Everything about the distributions.
pub(super) struct Tables {
    pub(super) all: Vec<Table>,
    /// For each token the bits that it costs with each table, plain ones among them.
    costs: Vec<[f32; TABLES]>,
}

/// The token of a number.
#[inline(always)]
pub(super) fn token(number: u32) -> u32 {
    // The same octave where it counts.
    let octave = (number | SINGLE).ilog2();
    let half = number >> (octave - 1) & 1;
    if number < SINGLE { number } else { SINGLE + 2 * (octave - 5) + half }
}

/// The least number of a token, and how many plain bits follow it.
pub(super) fn least(token: usize) -> (u32, u32) {
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

        let mut table = Self {
            frequencies: [0; TOKENS],
            slots: [0; TOTAL as usize],
            steps: [Step::new(1, TOTAL - 1); TOKENS],
        };
        let mut start = 0;
        for (token, frequency) in frequencies.into_iter().enumerate().filter(|token| token.1 > 0) {
            table.frequencies[token] = frequency | start << 16;
            table.slots[start as usize..(start + frequency) as usize].fill(token as u8);
            table.steps[token] = Step::new(frequency, start);
            start += frequency;
        }
        table
    }

    /// How many of all values below the total are this token's.
    pub(super) fn frequency(&self, token: usize) -> u32 {
        self.frequencies[token] & 0xffff
    }

    /// The token that a lane's state holds, and the state without it.
    #[inline(always)]
    pub(super) fn take(&self, state: u32) -> (u8, u32) {
        let slot = state & (TOTAL - 1);
        let token = self.slots[slot as usize];
        let frequency = self.frequencies[usize::from(token) % TOKENS];
        let multiple = (frequency & 0xffff).wrapping_mul(state >> BITS);
        (token, multiple.wrapping_add(slot).wrapping_sub(frequency >> 16))
    }

    /// The bits that a token costs, plain ones among them.
    fn cost(&self, token: usize) -> f32 {
        let frequency = self.frequency(token);
        let plain = if token == ESCAPE { 32 } else { least(token).1 };
        let frequency = if frequency == 0 { 2f32.powi(-32) } else { frequency as f32 };
        BITS as f32 - frequency.log2() + plain as f32
    }
}

/// How often each token was met.
pub(super) struct Histogram<'counts>(pub(super) &'counts [u32]);

impl Histogram<'_> {
    pub(super) fn is_empty(&self) -> bool {
        self.0.iter().all(|&count| count == 0)
    }

    /// Whether a number needs more than its token, with this table.
    pub(super) fn has_plain(&self, table: u8) -> bool {
        let table = &tables().all[usize::from(table)];
        let needs = |token: usize| token >= SINGLE as usize || table.frequency(token) == 0;
        self.0.iter().enumerate().any(|(token, &count)| count > 0 && needs(token))
    }

    /// The bits that all of it costs with each table.
    pub(super) fn costs(&self) -> [f32; TABLES] {
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

#[cfg(test)]
mod tests {
    use super::super::rans::LOW;
    use super::*;

    #[test]
    fn tokens_cover_all_numbers() {
        for number in (0..100_000).chain([u32::MAX, u32::MAX / 2, 1 << 31, (1 << 31) - 1]) {
            let token = token(number) as usize;
            let (first, bits) = least(token);
            assert!(token < ESCAPE, "{number}");
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
            let sum: u32 = (0..=ESCAPE).map(|token| table.frequency(token)).sum();
            assert_eq!(sum, TOTAL, "table {index}");
            assert!(table.frequency(0) >= table.frequency(2));
            for slot in 0..TOTAL {
                let token = usize::from(table.slots[slot as usize]);
                let start = table.frequencies[token] >> 16;
                assert!((start..start + table.frequency(token)).contains(&slot));
            }
        }
        let width = 10.0;
        let all: f64 = (0..ESCAPE).map(|token| probability(width, token)).sum();
        assert!((all - 1.0).abs() < 1e-12, "{all}");
    }
}
