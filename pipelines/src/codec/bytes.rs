//! Numbers in a message, little endian.

use super::CodecError;

/// A whole number in as few bytes as it needs, seven bits in each, the lowest first.
#[expect(clippy::cast_possible_truncation, reason = "seven bits at a time")]
pub(crate) fn put_count(out: &mut Vec<u8>, mut value: usize) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

/// A list of bytes, its length first.
pub(crate) fn put_block(out: &mut Vec<u8>, bytes: &[u8]) {
    put_count(out, bytes.len());
    out.extend(bytes);
}

/// The next bytes of a message.
#[derive(Debug, Clone)]
pub(crate) struct Input<'bytes>(pub(crate) &'bytes [u8]);

impl<'bytes> Input<'bytes> {
    pub(crate) fn take(&mut self, count: usize) -> Result<&'bytes [u8], CodecError> {
        let (taken, rest) = self.0.split_at_checked(count).ok_or(CodecError::Truncated)?;
        self.0 = rest;
        Ok(taken)
    }

    pub(crate) fn array<const N: usize>(&mut self) -> Result<[u8; N], CodecError> {
        let (taken, rest) = self.0.split_first_chunk().ok_or(CodecError::Truncated)?;
        self.0 = rest;
        Ok(*taken)
    }

    pub(crate) fn byte(&mut self) -> Result<u8, CodecError> {
        self.array().map(|[byte]| byte)
    }

    pub(crate) fn double(&mut self) -> Result<f64, CodecError> {
        self.array().map(f64::from_le_bytes)
    }

    pub(crate) fn doubles(&mut self, count: usize) -> Result<Vec<f64>, CodecError> {
        let bytes = self.take(count.saturating_mul(8))?;
        Ok(bytes.as_chunks().0.iter().map(|&bytes| f64::from_le_bytes(bytes)).collect())
    }

    /// A whole number below 2³⁵.
    pub(crate) fn count(&mut self) -> Result<usize, CodecError> {
        let mut value = 0u64;
        for shift in (0..35).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return usize::try_from(value)
                    .map_err(|_| CodecError::Damaged("a count is too large"));
            }
        }
        Err(CodecError::Damaged("a count is too large"))
    }

    pub(crate) fn block(&mut self) -> Result<&'bytes [u8], CodecError> {
        let length = self.count()?;
        self.take(length)
    }
}
