//! What ranks say to each other, as bytes.

use super::DistributedError;

/// Puts numbers one after the other, the lowest byte first.
#[derive(Debug, Default)]
pub(crate) struct Writer {
    bytes: Vec<u8>,
}

impl Writer {
    pub(crate) fn with_capacity(bytes: usize) -> Self {
        Self { bytes: Vec::with_capacity(bytes) }
    }

    pub(crate) fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    pub(crate) fn u8(&mut self, value: u8) {
        self.bytes.push(value);
    }

    pub(crate) fn u32(&mut self, value: u32) {
        self.bytes.extend(value.to_le_bytes());
    }

    pub(crate) fn u64(&mut self, value: u64) {
        self.bytes.extend(value.to_le_bytes());
    }

    pub(crate) fn i64(&mut self, value: i64) {
        self.bytes.extend(value.to_le_bytes());
    }

    pub(crate) fn f64s(&mut self, values: &[f64]) {
        self.bytes.reserve(values.len() * 8);
        values.iter().for_each(|value| self.bytes.extend(value.to_le_bytes()));
    }

    /// As many numbers as there are, and they themselves.
    pub(crate) fn u32s(&mut self, values: &[u32]) {
        self.u64(values.len() as u64);
        self.bytes.reserve(values.len() * 4);
        values.iter().for_each(|value| self.bytes.extend(value.to_le_bytes()));
    }

    pub(crate) fn text(&mut self, text: &str) {
        self.u64(text.len() as u64);
        self.bytes.extend(text.as_bytes());
    }
}

/// Takes them off again.
#[derive(Debug)]
pub(crate) struct Reader<'a> {
    from: usize,
    bytes: &'a [u8],
}

impl<'a> Reader<'a> {
    /// Reads what rank `from` said.
    pub(crate) fn new(from: usize, bytes: &'a [u8]) -> Self {
        Self { from, bytes }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    pub(crate) fn garbled(&self) -> DistributedError {
        DistributedError::Garbled { rank: self.from }
    }

    fn chunk<const N: usize>(&mut self) -> Result<[u8; N], DistributedError> {
        let (chunk, rest) = self.bytes.split_first_chunk().ok_or(self.garbled())?;
        self.bytes = rest;
        Ok(*chunk)
    }

    fn take(&mut self, length: usize) -> Result<&'a [u8], DistributedError> {
        let (taken, rest) = self.bytes.split_at_checked(length).ok_or(self.garbled())?;
        self.bytes = rest;
        Ok(taken)
    }

    /// A count of things of `size` bytes each that follow.
    pub(crate) fn count(&mut self, size: usize) -> Result<usize, DistributedError> {
        let count = usize::try_from(self.u64()?).map_err(|_| self.garbled())?;
        match count.checked_mul(size) {
            Some(length) if length <= self.bytes.len() => Ok(count),
            _ => Err(self.garbled()),
        }
    }

    pub(crate) fn u8(&mut self) -> Result<u8, DistributedError> {
        self.chunk::<1>().map(|[byte]| byte)
    }

    pub(crate) fn u32(&mut self) -> Result<u32, DistributedError> {
        self.chunk().map(u32::from_le_bytes)
    }

    pub(crate) fn u64(&mut self) -> Result<u64, DistributedError> {
        self.chunk().map(u64::from_le_bytes)
    }

    pub(crate) fn i64(&mut self) -> Result<i64, DistributedError> {
        self.chunk().map(i64::from_le_bytes)
    }

    pub(crate) fn vector(&mut self) -> Result<[f64; 3], DistributedError> {
        let eights = self.take(24)?.as_chunks().0;
        Ok(std::array::from_fn(|axis| f64::from_le_bytes(eights[axis])))
    }

    pub(crate) fn f64s(&mut self, count: usize) -> Result<Vec<f64>, DistributedError> {
        let length = count.checked_mul(8).ok_or(self.garbled())?;
        Ok(self
            .take(length)?
            .as_chunks()
            .0
            .iter()
            .map(|eight| f64::from_le_bytes(*eight))
            .collect())
    }

    pub(crate) fn u32s(&mut self) -> Result<Vec<u32>, DistributedError> {
        let count = self.count(4)?;
        Ok(self
            .take(4 * count)?
            .as_chunks()
            .0
            .iter()
            .map(|four| u32::from_le_bytes(*four))
            .collect())
    }

    pub(crate) fn text(&mut self) -> Result<String, DistributedError> {
        let count = self.count(1)?;
        String::from_utf8(self.take(count)?.to_vec()).map_err(|_| self.garbled())
    }
}
