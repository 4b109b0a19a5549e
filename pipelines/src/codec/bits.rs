//! Adaptive binary arithmetic coding: one yes or no at a time, each with a probability that learns.
//!
//! Topologies and masks are coded by it. A coder of either direction is a [`Bits`], so that what is
//! written and what is read is one and the same piece of code.

use super::CodecError;

/// How fast a probability follows, by how many decisions it has seen: 65536 / (seen + 2).
const RATES: [u32; 24] = {
    let mut rates = [0; 24];
    let mut seen = 0;
    while seen < 24 {
        rates[seen] = 65536 / (seen as u32 + 2);
        seen += 1;
    }
    rates
};
/// The least and the largest probability of a no, of 65536.
const LEAST: u32 = 64;
/// Below it, the range is widened by a byte.
const NARROW: u32 = 1 << 24;

/// The probability of a no, of 65536, and how many decisions it has seen.
#[derive(Debug, Clone, Copy)]
pub(super) struct Model {
    no: u16,
    seen: u8,
}

impl Model {
    pub(super) const NEW: Self = Self { no: 1 << 15, seen: 0 };

    #[inline(always)]
    fn learn(&mut self, bit: bool) {
        let rate = RATES[usize::from(self.seen) % RATES.len()];
        let no = u32::from(self.no);
        let no = if bit { no - ((no * rate) >> 16) } else { no + (((65536 - no) * rate) >> 16) };
        self.no = no.clamp(LEAST, 65536 - LEAST) as u16;
        self.seen = (self.seen + 1).min(RATES.len() as u8 - 1);
    }
}

/// A coder of decisions. The one that writes writes what it is given; the one that reads passes it
/// over. Both return what was coded.
pub(super) trait Bits {
    /// A decision with a probability that learns.
    fn bit(&mut self, model: &mut Model, bit: bool) -> Result<bool, CodecError>;

    /// The lowest `count` bits of a number, each as likely as not; at most 64.
    fn plain(&mut self, value: u64, count: u32) -> Result<u64, CodecError>;

    /// A whole number, by its length in bits and then the bits below the highest.
    fn number(&mut self, model: &mut Number, value: u64) -> Result<u64, CodecError> {
        let length = u64::BITS - value.leading_zeros();
        let mut node = 1;
        for level in (0..7).rev() {
            let bit = self.bit(&mut model.0[node], length >> level & 1 == 1)?;
            node = node << 1 | usize::from(bit);
        }
        let length = node as u32 & 127;
        match length {
            0 => Ok(0),
            1..=64 => {
                let highest = 1u64 << (length - 1);
                Ok(highest | self.plain(value & (highest - 1), length - 1)?)
            }
            _ => Err(CodecError::Damaged("a number is longer than 64 bits")),
        }
    }

    /// A whole number with its sign.
    fn signed(&mut self, model: &mut Number, value: i64) -> Result<i64, CodecError> {
        Ok(unzigzag(self.number(model, zigzag(value))?))
    }
}

/// The adaptive model of the lengths of numbers.
#[derive(Debug, Clone)]
pub(super) struct Number([Model; 128]);

impl Number {
    pub(super) const NEW: Self = Self([Model::NEW; 128]);
}

/// 0, -1, 1, -2, 2 ... as 0, 1, 2, 3, 4 ...
#[expect(clippy::cast_sign_loss, reason = "the bits are meant")]
pub(super) fn zigzag(value: i64) -> u64 {
    (value << 1 ^ value >> 63) as u64
}

/// The number behind a zigzag.
#[expect(clippy::cast_possible_wrap, reason = "the bits are meant")]
pub(super) fn unzigzag(value: u64) -> i64 {
    (value >> 1) as i64 ^ -((value & 1) as i64)
}

/// The most zeros at the end that a writer leaves out.
const LEFT_OUT: usize = 5;

/// Writes decisions.
#[derive(Debug, Clone)]
pub(super) struct Writer {
    low: u64,
    range: u32,
    /// A byte that a carry may still change, and how many 0xff bytes stand behind it.
    held: Option<u8>,
    full: usize,
    bytes: Vec<u8>,
}

impl Writer {
    pub(super) fn new() -> Self {
        Self { low: 0, range: u32::MAX, held: None, full: 0, bytes: Vec::new() }
    }

    #[expect(clippy::cast_possible_truncation, reason = "bytes are taken out of the number")]
    fn shift(&mut self) {
        if self.low < 0xff00_0000 || self.low > u64::from(u32::MAX) {
            let carry = (self.low >> 32) as u8;
            if let Some(held) = self.held {
                self.bytes.push(held.wrapping_add(carry));
            }
            self.bytes.extend(std::iter::repeat_n(0xff_u8.wrapping_add(carry), self.full));
            self.full = 0;
            self.held = Some((self.low >> 24) as u8);
        } else {
            self.full += 1;
        }
        self.low = (self.low & 0x00ff_ffff) << 8;
    }

    #[inline]
    fn widen(&mut self) {
        while self.range < NARROW {
            self.range <<= 8;
            self.shift();
        }
    }

    /// All bytes; zeros at the end are left out, up to five.
    pub(super) fn finish(mut self) -> Vec<u8> {
        // Any number of the last range will do: the one with the most zeros at its end.
        let end = self.low + u64::from(self.range) - 1;
        for zeros in [24, 16, 8] {
            let round = end >> zeros << zeros;
            if round >= self.low {
                self.low = round;
                break;
            }
        }
        for _ in 0..5 {
            self.shift();
        }
        for _ in 0..LEFT_OUT {
            self.bytes.pop_if(|byte| *byte == 0);
        }
        self.bytes
    }
}

impl Bits for Writer {
    #[inline]
    fn bit(&mut self, model: &mut Model, bit: bool) -> Result<bool, CodecError> {
        let no = (self.range >> 16) * u32::from(model.no);
        // No branch: what is coded here comes as a surprise.
        self.low += u64::from(if bit { no } else { 0 });
        self.range = if bit { self.range - no } else { no };
        self.widen();
        model.learn(bit);
        Ok(bit)
    }

    fn plain(&mut self, value: u64, count: u32) -> Result<u64, CodecError> {
        let mut left = count;
        while left > 0 {
            let part = left.min(16);
            left -= part;
            self.range >>= part;
            self.low += u64::from(self.range) * (value >> left & ((1 << part) - 1));
            self.widen();
        }
        Ok(value)
    }
}

/// Reads decisions.
#[derive(Debug)]
pub(super) struct Reader<'bytes> {
    bytes: &'bytes [u8],
    at: usize,
    code: u32,
    range: u32,
}

impl<'bytes> Reader<'bytes> {
    pub(super) fn new(bytes: &'bytes [u8]) -> Self {
        let mut reader = Self { bytes, at: 0, code: 0, range: u32::MAX };
        for _ in 0..4 {
            reader.code = reader.code << 8 | u32::from(reader.next());
        }
        reader
    }

    /// The next byte; zero behind the last.
    fn next(&mut self) -> u8 {
        let byte = self.bytes.get(self.at).copied().unwrap_or(0);
        self.at += 1;
        byte
    }

    fn widen(&mut self) -> Result<(), CodecError> {
        while self.range < NARROW {
            self.range <<= 8;
            self.code = self.code << 8 | u32::from(self.next());
            if self.at > self.bytes.len() + LEFT_OUT {
                return Err(CodecError::Truncated);
            }
        }
        Ok(())
    }
}

impl Bits for Reader<'_> {
    fn bit(&mut self, model: &mut Model, _: bool) -> Result<bool, CodecError> {
        let no = (self.range >> 16) * u32::from(model.no);
        let bit = self.code >= no;
        if bit {
            self.code -= no;
            self.range -= no;
        } else {
            self.range = no;
        }
        self.widen()?;
        model.learn(bit);
        Ok(bit)
    }

    fn plain(&mut self, _: u64, count: u32) -> Result<u64, CodecError> {
        let (mut value, mut left) = (0, count);
        while left > 0 {
            let part = left.min(16);
            left -= part;
            self.range >>= part;
            let bits = (self.code / self.range).min((1 << part) - 1);
            self.code -= bits * self.range;
            value = value << part | u64::from(bits);
            self.widen()?;
        }
        Ok(value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Decisions of all kinds, driven by a small generator.
    fn all<B: Bits>(bits: &mut B, count: u32) -> Vec<u64> {
        let (mut models, mut number) = ([Model::NEW; 3], Number::NEW);
        let mut random = 12345u64;
        let mut next = || {
            random = random.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            random >> 20
        };
        let mut coded = Vec::new();
        for index in 0..count {
            let value = next();
            let bit = bits.bit(&mut models[index as usize % 3], value % 50 == 0).unwrap();
            coded.push(u64::from(bit));
            coded.push(bits.number(&mut number, value >> (index % 45)).unwrap());
            coded.push(bits.plain(value & 0x1_ffff, 17).unwrap());
        }
        coded.push(bits.number(&mut number, u64::MAX).unwrap());
        coded.push(zigzag(bits.signed(&mut number, i64::MIN).unwrap()));
        coded
    }

    #[test]
    fn what_is_written_is_read() {
        for count in [0, 1, 2, 100, 20_000] {
            let mut writer = Writer::new();
            let written = all(&mut writer, count);
            let bytes = writer.finish();
            assert_eq!(all(&mut Reader::new(&bytes), count), written);
        }
    }

    #[test]
    fn many_zeros_at_the_end_are_read() {
        let mut writer = Writer::new();
        let values = [u64::MAX, 0, 0, 0, 1 << 63, 0, 0, 0];
        for (last, &value) in values.iter().enumerate() {
            writer.plain(value, 64).unwrap();
            let bytes = writer.clone().finish();
            let mut reader = Reader::new(&bytes);
            for &value in &values[..=last] {
                assert_eq!(reader.plain(0, 64), Ok(value));
            }
        }
    }

    #[test]
    fn a_decision_that_never_changes_costs_next_to_nothing() {
        let (mut writer, mut model) = (Writer::new(), Model::NEW);
        for _ in 0..100_000 {
            writer.bit(&mut model, false).unwrap();
        }
        let bytes = writer.finish();
        assert!(bytes.len() < 32, "{}", bytes.len());
        let (mut reader, mut model) = (Reader::new(&bytes), Model::NEW);
        assert!((0..100_000).all(|_| !reader.bit(&mut model, true).unwrap()));
        // No message can make a reader go on for ever.
        assert!((0..u32::MAX).any(|_| reader.bit(&mut model, true).is_err()));
    }
}
