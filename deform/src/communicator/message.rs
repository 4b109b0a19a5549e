//! Numbers and texts as the bytes of messages.

/// A message that does not hold what it should.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, thiserror::Error)]
#[error("what rank {rank} said cannot be read; the ranks must all run the same program")]
pub struct Garbled {
    /// The rank that sent it.
    pub rank: usize,
}

/// Writes a message: numbers one after the other, the lowest byte first.
#[derive(Debug, Default)]
pub struct Writer {
    bytes: Vec<u8>,
}

impl Writer {
    /// A message with room for so many bytes.
    #[must_use]
    pub fn with_capacity(bytes: usize) -> Self {
        Self { bytes: Vec::with_capacity(bytes) }
    }

    /// The message.
    #[must_use]
    pub fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }

    /// Whether nothing was written yet.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    /// Appends a byte.
    pub fn u8(&mut self, value: u8) {
        self.bytes.push(value);
    }

    /// Appends a number.
    pub fn u32(&mut self, value: u32) {
        self.bytes.extend(value.to_le_bytes());
    }

    /// Appends a number.
    pub fn u64(&mut self, value: u64) {
        self.bytes.extend(value.to_le_bytes());
    }

    /// Appends a number.
    pub fn i64(&mut self, value: i64) {
        self.bytes.extend(value.to_le_bytes());
    }

    /// Appends numbers, not their count.
    pub fn f64s(&mut self, values: &[f64]) {
        self.bytes.reserve(values.len() * 8);
        values.iter().for_each(|value| self.bytes.extend(value.to_le_bytes()));
    }

    /// Appends a count and as many numbers.
    pub fn u32s(&mut self, values: &[u32]) {
        self.u64(values.len() as u64);
        self.bytes.reserve(values.len() * 4);
        values.iter().for_each(|value| self.bytes.extend(value.to_le_bytes()));
    }

    /// Appends a length and a text.
    pub fn text(&mut self, text: &str) {
        self.bytes(text.as_bytes());
    }

    /// Appends a length and as many bytes.
    pub fn bytes(&mut self, bytes: &[u8]) {
        self.u64(bytes.len() as u64);
        self.bytes.extend(bytes);
    }
}

/// Reads a message that a [`Writer`] wrote.
#[derive(Debug)]
pub struct Reader<'a> {
    from: usize,
    bytes: &'a [u8],
}

impl<'a> Reader<'a> {
    /// Reads what rank `from` said.
    #[must_use]
    pub fn new(from: usize, bytes: &'a [u8]) -> Self {
        Self { from, bytes }
    }

    /// Whether everything was read.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    /// The error for a message that makes no sense.
    #[must_use]
    pub fn garbled(&self) -> Garbled {
        Garbled { rank: self.from }
    }

    fn chunk<const N: usize>(&mut self) -> Result<[u8; N], Garbled> {
        let (chunk, rest) = self.bytes.split_first_chunk().ok_or(self.garbled())?;
        self.bytes = rest;
        Ok(*chunk)
    }

    fn take(&mut self, length: usize) -> Result<&'a [u8], Garbled> {
        let (taken, rest) = self.bytes.split_at_checked(length).ok_or(self.garbled())?;
        self.bytes = rest;
        Ok(taken)
    }

    /// Reads a count of things of `size` bytes each that follow.
    ///
    /// # Errors
    /// [`Garbled`] where the message is shorter than they are.
    pub fn count(&mut self, size: usize) -> Result<usize, Garbled> {
        let count = usize::try_from(self.u64()?).map_err(|_| self.garbled())?;
        match count.checked_mul(size) {
            Some(length) if length <= self.bytes.len() => Ok(count),
            _ => Err(self.garbled()),
        }
    }

    /// Reads a byte.
    ///
    /// # Errors
    /// [`Garbled`].
    pub fn u8(&mut self) -> Result<u8, Garbled> {
        self.chunk::<1>().map(|[byte]| byte)
    }

    /// Reads a number.
    ///
    /// # Errors
    /// [`Garbled`].
    pub fn u32(&mut self) -> Result<u32, Garbled> {
        self.chunk().map(u32::from_le_bytes)
    }

    /// Reads a number.
    ///
    /// # Errors
    /// [`Garbled`].
    pub fn u64(&mut self) -> Result<u64, Garbled> {
        self.chunk().map(u64::from_le_bytes)
    }

    /// Reads a number.
    ///
    /// # Errors
    /// [`Garbled`].
    pub fn i64(&mut self) -> Result<i64, Garbled> {
        self.chunk().map(i64::from_le_bytes)
    }

    /// Reads three numbers.
    ///
    /// # Errors
    /// [`Garbled`].
    pub fn vector(&mut self) -> Result<[f64; 3], Garbled> {
        let eights = self.take(24)?.as_chunks().0;
        Ok(std::array::from_fn(|axis| f64::from_le_bytes(eights[axis])))
    }

    /// Reads so many numbers.
    ///
    /// # Errors
    /// [`Garbled`].
    pub fn f64s(&mut self, count: usize) -> Result<Vec<f64>, Garbled> {
        let length = count.checked_mul(8).ok_or(self.garbled())?;
        Ok(self
            .take(length)?
            .as_chunks()
            .0
            .iter()
            .map(|eight| f64::from_le_bytes(*eight))
            .collect())
    }

    /// Reads a count and as many numbers.
    ///
    /// # Errors
    /// [`Garbled`].
    pub fn u32s(&mut self) -> Result<Vec<u32>, Garbled> {
        let count = self.count(4)?;
        Ok(self
            .take(4 * count)?
            .as_chunks()
            .0
            .iter()
            .map(|four| u32::from_le_bytes(*four))
            .collect())
    }

    /// Reads a length and a text.
    ///
    /// # Errors
    /// [`Garbled`].
    pub fn text(&mut self) -> Result<String, Garbled> {
        String::from_utf8(self.bytes()?.to_vec()).map_err(|_| self.garbled())
    }

    /// Reads a length and as many bytes.
    ///
    /// # Errors
    /// [`Garbled`].
    pub fn bytes(&mut self) -> Result<&'a [u8], Garbled> {
        let count = self.count(1)?;
        self.take(count)
    }
}
