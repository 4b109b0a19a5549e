//! How a recording lies in its file: a header, and one message after the other, each with a head that
//! says how long it is, when it came, and a checksum of both.

use std::io::{self, Read, Seek, SeekFrom, Write};

/// The first bytes of a recording: a name and a version.
pub(crate) const MAGIC: &[u8; 12] = b"TMBLRECD\x01\0\0\0";
/// Bytes of a message's head.
pub(crate) const HEAD: usize = 41;
/// Bytes that a message may have.
pub(crate) const MESSAGE: u32 = 1 << 30;
/// Bytes that are looked through at once for a head.
const WINDOW: u64 = 1 << 16;

/// What a message is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// What viewers are greeted with.
    Hello,
    /// How far the run is.
    Status,
    /// Values of monitors.
    Monitor,
    /// What became of an order.
    Order,
    /// Any other text.
    Text,
    /// The stack of edits, whole.
    Stack,
    /// A frame that can be read by itself.
    KeyFrame,
    /// A frame that goes on from the one before of its view.
    NextFrame,
}

impl Kind {
    const ALL: [Kind; 8] = [
        Kind::Hello,
        Kind::Status,
        Kind::Monitor,
        Kind::Order,
        Kind::Text,
        Kind::KeyFrame,
        Kind::NextFrame,
        Kind::Stack,
    ];

    /// What a text message is, by its beginning.
    pub(crate) fn of_text(text: &str) -> Self {
        let begins = |key: &str| text.strip_prefix("{\"").is_some_and(|rest| rest.starts_with(key));
        match () {
            () if begins("hello\"") => Kind::Hello,
            () if begins("status\"") => Kind::Status,
            () if begins("monitor\"") => Kind::Monitor,
            () if begins("order\"") => Kind::Order,
            () => Kind::Text,
        }
    }

    pub(crate) fn is_frame(self) -> bool {
        matches!(self, Kind::KeyFrame | Kind::NextFrame)
    }
}

/// The head of a message.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Head {
    pub(crate) kind: Kind,
    /// The number of the view that a frame is of.
    pub(crate) view: u32,
    pub(crate) length: u32,
    /// The step, and its simulated time.
    pub(crate) cycle: u64,
    pub(crate) time: f64,
    /// Milliseconds since the recording began.
    pub(crate) milliseconds: u64,
    checksum: u32,
}

impl Head {
    /// The head of a message.
    pub(crate) fn of(
        kind: Kind,
        view: u32,
        (cycle, time): (u64, f64),
        milliseconds: u64,
        message: &[u8],
    ) -> Option<Self> {
        let length = u32::try_from(message.len()).ok().filter(|length| *length <= MESSAGE)?;
        let checksum = crc32fast::hash(message);
        Some(Self { kind, view, length, cycle, time, milliseconds, checksum })
    }

    fn bytes(&self) -> [u8; HEAD] {
        let mut bytes = [0; HEAD];
        bytes[0..4].copy_from_slice(&self.length.to_le_bytes());
        bytes[4] = Kind::ALL.iter().position(|kind| *kind == self.kind).unwrap_or(0) as u8;
        bytes[5..9].copy_from_slice(&self.view.to_le_bytes());
        bytes[9..17].copy_from_slice(&self.cycle.to_le_bytes());
        bytes[17..25].copy_from_slice(&self.time.to_le_bytes());
        bytes[25..33].copy_from_slice(&self.milliseconds.to_le_bytes());
        bytes[33..37].copy_from_slice(&self.checksum.to_le_bytes());
        let checksum = crc32fast::hash(&bytes[..37]);
        bytes[37..].copy_from_slice(&checksum.to_le_bytes());
        bytes
    }

    /// `None` for bytes that are no head.
    fn read(bytes: &[u8; HEAD]) -> Option<Self> {
        let four = |from: usize| -> [u8; 4] { std::array::from_fn(|at| bytes[from + at]) };
        let eight = |from: usize| -> [u8; 8] { std::array::from_fn(|at| bytes[from + at]) };
        if crc32fast::hash(&bytes[..37]) != u32::from_le_bytes(four(37)) {
            return None;
        }
        let length = u32::from_le_bytes(four(0));
        let kind = *Kind::ALL.get(usize::from(bytes[4]))?;
        (length <= MESSAGE).then(|| Self {
            kind,
            view: u32::from_le_bytes(four(5)),
            length,
            cycle: u64::from_le_bytes(eight(9)),
            time: f64::from_le_bytes(eight(17)),
            milliseconds: u64::from_le_bytes(eight(25)),
            checksum: u32::from_le_bytes(four(33)),
        })
    }
}

/// Writes a message; how many bytes that are.
pub(crate) fn write(out: &mut impl Write, head: &Head, message: &[u8]) -> io::Result<u64> {
    out.write_all(&head.bytes())?;
    out.write_all(message)?;
    Ok((HEAD + message.len()) as u64)
}

/// Reads the head at this place; `None` where none can be read.
pub(crate) fn read_head(file: &mut (impl Read + Seek), at: u64) -> io::Result<Option<Head>> {
    file.seek(SeekFrom::Start(at))?;
    let mut bytes = [0; HEAD];
    match file.read_exact(&mut bytes) {
        Ok(()) => Ok(Head::read(&bytes)),
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => Ok(None),
        Err(error) => Err(error),
    }
}

/// The first message from a place on whose head can be read, and its place: there, or behind bytes
/// that are damaged, which the checksums of heads tell. `None` where no message is whole.
pub(crate) fn find_head(
    file: &mut (impl Read + Seek),
    from: u64,
    length: u64,
) -> io::Result<Option<(u64, Head)>> {
    let is_whole = |at: u64, head: &Head| at + HEAD as u64 + u64::from(head.length) <= length;
    if let Some(head) = read_head(file, from)? {
        return Ok(is_whole(from, &head).then_some((from, head)));
    }
    let mut at = from + 1;
    let mut bytes = Vec::with_capacity(WINDOW as usize);
    while at + HEAD as u64 <= length {
        file.seek(SeekFrom::Start(at))?;
        bytes.clear();
        (&mut *file).take(WINDOW).read_to_end(&mut bytes)?;
        for (place, bytes) in (at..).zip(bytes.windows(HEAD)) {
            let is_kind = bytes.get(4).is_some_and(|kind| usize::from(*kind) < Kind::ALL.len());
            let head = bytes.try_into().ok().filter(|_| is_kind).and_then(Head::read);
            if let Some(head) = head.filter(|head| is_whole(place, head)) {
                return Ok(Some((place, head)));
            }
        }
        if bytes.len() < HEAD {
            break;
        }
        at += (bytes.len() - HEAD) as u64 + 1;
    }
    Ok(None)
}

/// Reads the message whose head lies at this place; `None` where it is not what was written.
pub(crate) fn read_message(
    file: &mut (impl Read + Seek),
    at: u64,
    head: &Head,
) -> io::Result<Option<Vec<u8>>> {
    file.seek(SeekFrom::Start(at + HEAD as u64))?;
    let mut message = Vec::new();
    // Only as much memory as the file has bytes.
    file.take(u64::from(head.length)).read_to_end(&mut message)?;
    let is_whole = message.len() == head.length as usize;
    Ok((is_whole && crc32fast::hash(&message) == head.checksum).then_some(message))
}
